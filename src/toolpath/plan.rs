//! What a strategy is asked for, and the one entrance to all strategies.

use super::chord::{Watch, reduce, sample_within_chord};
use super::link::chain;
use super::strip::strip_width;
use super::{Toolpath, streamline, zigzag};
use crate::cutter::Cutter;
use crate::geometry::Point3;
use crate::monitor::{Cancelled, Monitor};
use crate::part::Part;

/// How far neighbouring passes lie apart.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Step {
    /// So that the scallop stays below this height, mm.
    Scallop(f64),
    /// This stepover, mm (measured as the strategy steps: in the plan view for zigzag, on the
    /// surface for the others).
    Stepover(f64),
}

/// Which parameter a pass follows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Along {
    /// u grows along a pass, v is constant.
    U,
    /// v grows along a pass, u is constant.
    V,
}

/// Where the feed direction of a streamline comes from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FeedDirection {
    /// Along a parameter of the patch (x and y of a mesh part).
    Parameter(Along),
    /// A fixed angle from the x axis in the plan view, rad.
    Angle(f64),
    /// Across the widest strip, from the principal curvatures.
    WidestStrip,
}

/// A way to cover the part with passes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Strategy {
    /// Parallel vertical planes.
    Zigzag {
        /// Direction of the passes from the x axis in the plan view, rad.
        angle: f64,
        /// Cut in one direction only.
        one_way: bool,
    },
    /// Lines of constant parameter.
    IsoParametric {
        /// Which parameter grows along a pass.
        along: Along,
    },
    /// Level curves of a stream function fitted to feed directions.
    Streamline {
        /// The feed directions.
        direction: FeedDirection,
        /// Control points a side of the stream function's bicubic B-spline.
        control_points: usize,
    },
}

/// What every strategy needs to know besides part and cutter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlanSettings {
    /// Distance of passes.
    pub step: Step,
    /// Largest distance between the straight moves and the exact path, mm.
    pub chord_tolerance: f64,
    /// Height of rapid moves above the highest point of part and stock, mm.
    pub clearance: f64,
    /// Highest point of the stock, mm.
    pub stock_top: f64,
    /// Feed along passes, mm/min.
    pub feed_rate: f64,
    /// Feed down to a pass, mm/min.
    pub plunge_rate: f64,
}

/// Why no path could be planned.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PlanError {
    /// Stopped by the user.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// The strategy does not apply to this part.
    #[error("{strategy} cannot plan this part: {reason}")]
    NotApplicable {
        /// Strategy's name.
        strategy: &'static str,
        /// Why, and what would help.
        reason: String,
    },
    /// No smooth surface, which directions and distances of passes come from, could be fitted to a mesh.
    #[error(
        "no smooth surface could be fitted to the mesh ({0}); export a part that is more than a sliver seen from above"
    )]
    NoFit(String),
    /// The passes lie so close on so large a part that planning them would take days or all memory.
    #[error(
        "passes {step} mm apart over {x} x {y} mm would be too many; set a greater `stepover` or `scallop`, \
         and check the units of the part"
    )]
    TooMany {
        /// Greatest distance of passes that the settings allow, mm.
        step: f64,
        /// Size of the part along x, mm.
        x: f64,
        /// Size of the part along y, mm.
        y: f64,
    },
}

/// A planned path and what the planner has to say about it.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// The path.
    pub path: Toolpath,
    /// Things the user should know (a singular field, a step that was limited), in plain words.
    pub notes: Vec<String>,
}

impl PlanError {
    pub(super) fn mesh(reason: &str) -> Self {
        Self::NoFit(reason.to_owned())
    }
}

/// What every pass needs.
#[derive(Debug, Clone, Copy)]
pub(super) struct PassSettings {
    /// Distance of passes, already less what the chords may add.
    pub step: Step,
    /// First sampling distance along a pass, mm.
    pub sampling: f64,
    /// Chord tolerance, mm.
    pub chord_tolerance: f64,
}

/// Share of the chord tolerance that sampling may use; point reduction uses the rest.
const SAMPLING_SHARE: f64 = 0.4;

impl PassSettings {
    /// Straight moves along `locate` over `[s0, s1]` within the chord tolerance.
    ///
    /// # Errors
    /// [`Cancelled`] when the monitor says so, which is asked every few hundred places.
    pub fn moves(
        &self,
        s0: f64,
        s1: f64,
        locate: &mut dyn FnMut(f64) -> Option<Point3>,
        monitor: &dyn Monitor,
    ) -> Result<Vec<Point3>, Cancelled> {
        let fine = SAMPLING_SHARE * self.chord_tolerance;
        let mut watch = Watch::new(monitor);
        let points = sample_within_chord(s0, s1, self.sampling, fine, locate, &mut watch)?;
        reduce(&points, self.chord_tolerance - fine, &mut watch)
    }
}

/// Planned passes, not yet joined, and remarks for the user.
#[derive(Debug, Clone, Default)]
pub(super) struct Passes {
    /// Tip positions of each pass.
    pub passes: Vec<Vec<Point3>>,
    /// Remarks.
    pub notes: Vec<String>,
}

impl Passes {
    /// Appends the passes and remarks of another piece of the part.
    pub fn append(&mut self, other: Self) {
        self.passes.extend(other.passes);
        self.notes.extend(other.notes);
    }
}

/// First sampling distance along a pass as a share of the cutter's radius: features narrower than
/// that could hide between two samples of a pass.
const SAMPLING_OVER_RADIUS: f64 = 0.15;

/// A scallop target is planned for less the chord tolerance, which may raise a ridge by as much,
/// but not for less than this share of itself.
const LEAST_SHARE_OF_TARGET: f64 = 0.5;

/// Most passes that are planned: ten times what a part of ten metres takes at 0.1 mm. More of them
/// take up memory without end.
const MAX_PASSES: f64 = 1e6;

/// Most samples of passes that are planned; at a million a second they take a quarter of an hour.
const MAX_SAMPLES: f64 = 1e9;

/// Refuses what would never end. Counts no pass too many: steps are taken as great as any strategy
/// plans them.
fn check_extent(part: &Part, cutter: &Cutter, pass: &PassSettings) -> Result<(), PlanError> {
    let step = match pass.step {
        // As wide as the strip may be where cutter and surface fit each other.
        Step::Scallop(h) => strip_width(0.0, 0.0, h, cutter.radius()).0,
        Step::Stepover(s) => s,
    };
    let size = part.bounds().size();
    let samples = size.x / step * (size.y / pass.sampling);
    if size.x.max(size.y) > MAX_PASSES * step || samples > MAX_SAMPLES {
        return Err(PlanError::TooMany { step, x: size.x, y: size.y });
    }
    Ok(())
}

/// Plans one path.
///
/// # Errors
/// See [`PlanError`].
pub fn plan(
    part: &Part,
    cutter: &Cutter,
    strategy: &Strategy,
    settings: &PlanSettings,
    monitor: &dyn Monitor,
) -> Result<Plan, PlanError> {
    let step = match settings.step {
        Step::Scallop(h) => Step::Scallop((h - settings.chord_tolerance).max(LEAST_SHARE_OF_TARGET * h)),
        stepover => stepover,
    };
    let sampling = SAMPLING_OVER_RADIUS * cutter.radius();
    let pass = PassSettings { step, sampling, chord_tolerance: settings.chord_tolerance };
    check_extent(part, cutter, &pass)?;
    let (passes, both_ways) = match *strategy {
        Strategy::Zigzag { angle, one_way } => {
            (zigzag::passes(part, cutter, angle, &pass, monitor)?, !one_way)
        }
        Strategy::IsoParametric { along } => {
            (streamline::iso_parametric(part, cutter, along, &pass, monitor)?, true)
        }
        Strategy::Streamline { direction, control_points } => {
            let passes = streamline::streamline(part, cutter, direction, control_points, &pass, monitor)?;
            (passes, true)
        }
    };
    let Passes { passes, mut notes } = passes;
    let path = chain(passes, both_ways, settings);
    if path.is_empty() {
        notes.push("no pass reaches the part: the program is empty".into());
    }
    Ok(Plan { path, notes })
}
