//! What a strategy is asked for, and the one entrance to all strategies.

use super::Toolpath;
use crate::cutter::Cutter;
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
}

/// A planned path and what the planner has to say about it.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// The path.
    pub path: Toolpath,
    /// Things the user should know (a singular field, a step that was limited), in plain words.
    pub notes: Vec<String>,
}

/// Plans one path.
///
/// # Errors
/// See [`PlanError`].
pub fn plan(
    _part: &Part,
    _cutter: &Cutter,
    _strategy: &Strategy,
    _settings: &PlanSettings,
    _monitor: &dyn Monitor,
) -> Result<Plan, PlanError> {
    todo!()
}
