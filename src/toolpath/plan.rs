//! What a strategy is asked for, and the one entrance to all strategies.

use crate::levels::planned_field;
use crate::levels::spacing::LevelSteps;
use crate::link::{join, join_tilted};
use crate::pocket::PocketStrategy;
use crate::strategies::iso_scallop::FrontStart;
use crate::strategies::mesh_passes::Aim;
use crate::strategies::offset_surface::{OffsetAlong, OffsetDrive};
use crate::strategies::shortest::shortest_possible;
use crate::strategies::streamline::{Fitting, StreamMethod};
use crate::strategies::{
    contour_spiral, iso_scallop, mesh_passes, offset_mesh, offset_surface, shortest, spiral, streamline,
    waterline, zigzag,
};
use crate::surface::mesh_surface;
use crate::tilt::tilted::{self, TiltedPasses, Tilting};
use crate::vocabulary::{
    Along, Contact, FeedDirection, PassSettings, Passes, PlanError, PlanSettings, SAMPLING_OVER_RADIUS, Step,
};
use cutter::Cutter;
use field::{PlannedField, ShortestPossible, Solver};
use geometry::TriangleMesh;
use motion::{ToolAxis, Toolpath};
use part::Part;
use scallop::strip_width;
use work::monitor::Monitor;

/// A way to cover the part with passes.
#[derive(Debug, Clone, PartialEq)]
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
    /// Parallel vertical planes in the direction with the shortest path: searched over half a turn by the predicted
    /// length, the best few planned.
    BestZigzag {
        /// Cut in one direction only.
        one_way: bool,
    },
    /// Lines of constant parameter, one direction or the shorter of both, and a choice of steps.
    IsoParametricSteps {
        /// Which parameter grows along a pass; the better one without it.
        along: Option<Along>,
        /// How the parameter steps from pass to pass.
        steps: LevelSteps,
    },
    /// Each pass at exactly the strip's width from the one before, measured on the surface across the feed: level curves
    /// of the arrival of a front that starts on a curve and moves by the strip's width.
    IsoScallop {
        /// Where the first pass is.
        start: FrontStart,
    },
    /// Curves of constant height of the cutter. Where the part is nearly level they lie far apart: further passes fill in
    /// as far as six halvings reach.
    Waterline {
        /// How the height steps from pass to pass.
        steps: LevelSteps,
    },
    /// One spiral from the middle of the plan view outward, its pitch that of the tightest place of each turn. Where it
    /// leaves the part it is cut into pieces.
    Spiral,
    /// One spiral from the border to the middle between the passes of an iso-scallop path from all borders, without a
    /// retract; further short passes where its turns have corners. For parts whose front closes in one point.
    ContourSpiral,
    /// Streamlines of the feed directions with the shortest path: each one strip from the next, their first curve
    /// searched.
    ShortestStreamline {
        /// A direction to keep to, and how much dearer a mm of pass square to it is, in mm: 0 leaves all freedom, a great
        /// number none.
        toward: Option<(FeedDirection, f64)>,
    },
    /// A ball whose centre rides on an offset surface.
    OffsetSurface {
        /// How passes run.
        along: OffsetAlong,
        /// On what.
        drive: OffsetDrive,
    },
    /// Level curves of a stream function fitted to feed directions.
    Streamline {
        /// The feed directions.
        direction: FeedDirection,
        /// Control points a side of the stream function's B-spline; differences have three cells for
        /// each.
        control_points: usize,
        /// How the stream function is fitted.
        method: StreamMethod,
        /// What solves its equations.
        solver: Solver,
    },
    /// A pocket's passes; planned by [`plan_pocket`](super::plan_pocket).
    Pocket(PocketStrategy),
}

impl Strategy {
    /// The strategy as one for pockets.
    pub fn pocket(&self) -> Option<&PocketStrategy> {
        match self {
            Self::Pocket(strategy) => Some(strategy),
            _ => None,
        }
    }
}

/// A planned path and what the planner has to say about it.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// The path.
    pub path: Toolpath,
    /// Things the user should know (a singular field, a step that was limited), in plain words.
    pub notes: Vec<String>,
    /// What no path below the asked scallop height can be shorter than.
    pub shortest: Option<ShortestPossible>,
    /// What a streamline path was planned by.
    pub field: Option<PlannedField>,
}

impl Plan {
    fn new(
        path: Toolpath,
        mut notes: Vec<String>,
        mut field: PlannedField,
        contacts: &[Vec<Contact>],
        strategy: &Strategy,
    ) -> Self {
        let by_streamlines =
            matches!(strategy, Strategy::Streamline { .. } | Strategy::ShortestStreamline { .. });
        let field = by_streamlines.then(|| {
            planned_field::measure(&mut field, contacts);
            field
        });
        if path.is_empty() {
            notes.push("no pass reaches the part: the program is empty".into());
        }
        Self { path, notes, shortest: None, field }
    }
}

/// A scallop target is planned for less this share of the chord tolerance. A chord may raise a ridge by half of it, but
/// ridges stand between chords of two passes, whose greatest deviations seldom meet.
const CHORD_SHARE: f64 = 0.26;

/// The same of smoothed passes, whose points and chords stray farther.
const SMOOTHED_CHORD_SHARE: f64 = 0.5;

/// On a mesh it is planned for less by what facets stand off the smooth surface, too: on elements, whose curvature is that of
/// the facets around, and on meshes with steps, by the height that this share of them (by area) stays below. On surfaces
/// fitted to smooth meshes by the height that nearly all stay below, less a share of the target, and by no more than another
/// share: ridges cross facets at any height, and not all passes leave all of the target. Facets at sharper angles than the
/// last, rad, are edges of the part.
const FACETS_ON_ELEMENTS: f64 = 0.6;
const FACETS: f64 = 0.95;
const FACETS_LESS: f64 = 0.055;
const MOST_FACETS: f64 = 0.09;
const SHARPEST_FACETS: f64 = 0.3;

/// But it is not planned for less than this share of itself.
const LEAST_SHARE_OF_TARGET: f64 = 0.5;

/// What the facets of a mesh, planned on a surface fitted to it or on itself, take of a scallop target, mm.
fn facet_charge(mesh: &TriangleMesh, fitted: bool, target: f64) -> f64 {
    if fitted {
        (facet_height(mesh, FACETS) - FACETS_LESS * target).max(0.0).min(MOST_FACETS * target)
    } else {
        facet_height(mesh, FACETS_ON_ELEMENTS)
    }
}

/// How far facets stand off the smooth surface that they are chords of, mm: where two meet at the angle δ, each is as wide
/// as its neighbours and has a sagitta of an eighth of δ times the width; the one that a share of them stays below.
fn facet_height(mesh: &TriangleMesh, share: f64) -> f64 {
    let mut facets: Vec<(f64, f64)> = Vec::new();
    let area = |t: usize| {
        let [a, b, c] = mesh.corners(t);
        0.5 * (b - a).cross(&(c - a)).norm()
    };
    for t in 0..mesh.triangles().len() {
        for k in 0..3 {
            let Some(n) = mesh.neighbour(t, k).filter(|&n| n > t) else { continue };
            let corners = mesh.corners(t);
            let (edge, both) = ((corners[(k + 1) % 3] - corners[k]).norm(), area(t) + area(n));
            let angle = mesh.normal(t).cross(&mesh.normal(n)).norm();
            if angle < SHARPEST_FACETS && edge > 0.0 {
                facets.push((0.125 * angle * both / edge, both));
            }
        }
    }
    facets.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut left = share * facets.iter().map(|(_, area)| area).sum::<f64>();
    let reached = facets.iter().find(|(_, area)| {
        left -= area;
        left <= 0.0
    });
    reached.map_or(0.0, |(height, _)| *height)
}

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

/// Plans one path of an upright cutter.
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
    let (planned, both_ways) = passes(part, cutter, strategy, None, settings, monitor)?;
    let Passes { passes, notes, field, contacts, .. } = planned;
    let path = join(passes, both_ways, part, cutter, settings, monitor)?;
    let mut plan = Plan::new(path, notes, field, &contacts, strategy);
    if let Step::Scallop(h) = settings.step {
        plan.shortest = Some(shortest_possible(part, cutter, h)?);
    }
    Ok(plan)
}

/// Plans one path of a cutter that tilts.
///
/// On patches the cutter is located by its contact, on level curves of the strategy's function. A ball cutter's centre
/// stands where it does upright, so that on meshes, and with strategies that drop the cutter, the upright path is tilted
/// around it. Other cutters are located there by the contacts of a ball that is dropped in their stead.
///
/// # Errors
/// See [`PlanError`].
pub fn plan_tilted(
    part: &Part,
    cutter: &Cutter,
    strategy: &Strategy,
    tilting: &Tilting,
    settings: &PlanSettings,
    monitor: &dyn Monitor,
) -> Result<Plan, PlanError> {
    let (planned, both_ways) = passes(part, cutter, strategy, Some(tilting.axis), settings, monitor)?;
    let Passes { passes, touches, mut notes, field, contacts } = planned;
    let mut touches = if touches.is_empty() && !passes.is_empty() {
        let dropped = tilted::probe(cutter).unwrap_or(*cutter);
        let dropped = tilted::Dropped { passes: &passes, ball: &dropped };
        tilted::around_centres(&dropped, part, cutter, tilting.axis, settings.chord_tolerance, monitor)?
    } else {
        TiltedPasses::located(touches, settings.chord_tolerance)
    };
    touches.smoothing = settings.joining.smoothing.then_some(SAMPLING_OVER_RADIUS * cutter.radius());
    let path = join_tilted(touches, both_ways, part, cutter, tilting, settings, &mut notes, monitor)?;
    Ok(Plan::new(path, notes, field, &contacts, strategy))
}

/// The passes of a strategy, not yet joined, and whether they may be fed both ways.
fn passes(
    part: &Part,
    cutter: &Cutter,
    strategy: &Strategy,
    axis: Option<&ToolAxis>,
    settings: &PlanSettings,
    monitor: &dyn Monitor,
) -> Result<(Passes, bool), PlanError> {
    // A tilted cutter follows the level curves of the plan coordinate instead of being dropped.
    let levels = axis.filter(|_| !part.patches().is_empty());
    let probe = axis.and_then(|_| tilted::probe(cutter));
    let wants_mesh = || levels.is_none() && probe.is_none() && mesh_surface::wants_mesh(part, cutter);
    let on_elements = match strategy {
        Strategy::ShortestStreamline { .. } => wants_mesh(),
        Strategy::Streamline { method: StreamMethod::Automatic, .. } => wants_mesh(),
        Strategy::Streamline { method, .. } => *method == StreamMethod::Elements,
        _ => false,
    };
    let step = match settings.step {
        Step::Scallop(h) => {
            let fitted = !on_elements
                && !matches!(strategy, Strategy::OffsetSurface { .. })
                && !mesh_surface::wants_mesh(part, cutter);
            let facets = if part.patches().is_empty() { facet_charge(part.mesh(), fitted, h) } else { 0.0 };
            let chords = if settings.joining.smoothing { SMOOTHED_CHORD_SHARE } else { CHORD_SHARE };
            let less = chords * settings.chord_tolerance + facets;
            Step::Scallop((h - less).max(LEAST_SHARE_OF_TARGET * h))
        }
        stepover => stepover,
    };
    let sampling = SAMPLING_OVER_RADIUS * cutter.radius();
    // A tilted cutter's passes are smoothed once they are tilted.
    let smoothing = (settings.joining.smoothing && axis.is_none()).then_some(sampling);
    let (chord_tolerance, probe) = (settings.chord_tolerance, probe.as_ref());
    let pass = PassSettings { step, sampling, chord_tolerance, smoothing, axis, probe };
    check_extent(part, cutter, &pass)?;
    let (passes, both_ways) = match strategy {
        Strategy::Pocket(pocket) => {
            let reason = "it mills pockets, and the part is none".to_owned();
            return Err(PlanError::NotApplicable { strategy: pocket.name(), reason });
        }
        Strategy::Zigzag { angle, one_way } if levels.is_some() => {
            (zigzag::on_levels(part, cutter, *angle, &pass, monitor)?, !one_way)
        }
        Strategy::Zigzag { angle, one_way } => {
            (zigzag::passes(part, cutter, *angle, &pass, monitor)?, !one_way)
        }
        Strategy::IsoParametric { along } => (
            streamline::iso_parametric(part, cutter, Some(*along), LevelSteps::Shortest, &pass, monitor)?,
            true,
        ),
        Strategy::BestZigzag { one_way } => (zigzag::best(part, cutter, &pass, monitor)?, !one_way),
        Strategy::IsoParametricSteps { along, steps } => {
            (streamline::iso_parametric(part, cutter, *along, *steps, &pass, monitor)?, true)
        }
        Strategy::IsoScallop { start } => (iso_scallop::passes(part, cutter, *start, &pass, monitor)?, true),
        Strategy::Waterline { steps } => (waterline::passes(part, cutter, *steps, &pass, monitor)?, true),
        Strategy::Spiral => (spiral::passes(part, cutter, &pass, monitor)?, true),
        Strategy::ContourSpiral => (contour_spiral::passes(part, cutter, &pass, monitor)?, true),
        Strategy::OffsetSurface { along: OffsetAlong::Angle(angle), .. } => {
            (offset_mesh::passes(part, cutter, *angle, &pass, monitor)?, true)
        }
        Strategy::OffsetSurface { along, drive } => {
            (offset_surface::passes(part, cutter, *along, drive, &pass, monitor)?, true)
        }
        Strategy::ShortestStreamline { toward } => {
            let toward = toward.as_ref().map(|(direction, dearer)| (direction, *dearer));
            let passes = if on_elements {
                mesh_passes::on_mesh(part, cutter, Aim::Shortest(toward), &pass, monitor)?
            } else {
                shortest::passes(part, cutter, toward, &pass, monitor)?
            };
            (passes, true)
        }
        Strategy::Streamline { direction, .. } if on_elements => {
            if probe.is_some() {
                let reason = "its passes by elements are spaced for an upright cutter; use a ball, or another `method`";
                return Err(PlanError::NotApplicable { strategy: "streamline", reason: reason.to_owned() });
            }
            (mesh_passes::on_mesh(part, cutter, Aim::Fitted(direction), &pass, monitor)?, true)
        }
        Strategy::Streamline { direction, control_points, method, solver } => {
            let fitting = Fitting { controls: *control_points, method: *method, solver: *solver };
            (streamline::streamline(part, cutter, direction, &fitting, &pass, monitor)?, true)
        }
    };
    Ok((passes, both_ways))
}
