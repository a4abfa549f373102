//! Why no path could be planned.

use motion::AxisError;
use work::monitor::Cancelled;

/// Why no path could be planned.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PlanError {
    /// Stopped by the user.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// A number of the settings by which no path can be planned.
    #[error("the {setting} is {value}; it must be {wanted}")]
    Setting {
        /// Which, in words.
        setting: &'static str,
        /// What it is, mm or mm/min.
        value: f64,
        /// What is taken.
        wanted: &'static str,
    },
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
    /// Nothing of the part has the slopes that are asked for.
    #[error(
        "no face of the part has such a slope; widen `slope`, degrees from level ground (0) to walls (90)"
    )]
    NoSuchSlope,
    /// The rule gives no tool axis at a place.
    #[error(transparent)]
    Axis(#[from] AxisError),
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
    /// The stepdown is too small for the stock.
    #[error("a `stepdown` of {stepdown} mm makes {levels} levels; set a greater one, and check its unit")]
    TooManyLevels {
        /// What was asked for, mm.
        stepdown: f64,
        /// How many levels that makes.
        levels: f64,
    },
}

impl PlanError {
    pub(crate) fn mesh(reason: &str) -> Self {
        Self::NoFit(reason.to_owned())
    }
}
