//! The scene: what a user asks for, in TOML. Enters: a file. Leaves: a [`Scene`], in which every
//! value is checked, every default filled in, lengths are in mm and angles in rad.
//!
//! The text is read as a tree of values with their places (not by derived deserialisation), so that
//! every refusal can point at the very key or value: tagged enums of serde only know the table.

mod axis;
mod bodies;
mod compare;
mod direction;
mod foreign;
mod interference;
mod kinematics;
mod load;
mod named_file;
mod part;
mod read;
mod stock;
#[cfg(test)]
mod tests;
mod tooling;
mod write;

use std::sync::Arc;

pub use axis::AxisRequest;
pub use bodies::{BodyShape, MachineBodies, MachineBody};
pub use compare::EqualTime;
pub use interference::{Fixture, KeepClear};
pub use keys::{Finding, SceneError, SceneText, printable, printable_lines};
pub use kinematics::FiveAxis;
pub use load::{load_mesh, load_part};
pub use named_file::NamedFile;
pub use part::{
    BladeRequest, EarlierCutter, FormulaSource, LoadError, Loaded, MeshFile, NurbsSource, OpenLine,
    OutlineSource, PartSource, PocketSource, unmeasured_beside_walls,
};
pub use stock::StockRequest;
pub use tooling::{CuttingData, Tooling};
pub use write::complete_toml;

pub use foreign::{TableError, described_tools, scene_table, tool_table};
use geometry::Region;
use machine::Machine;
pub use metrology::{EngineChoice, Judged, Simulation};
use metrology::{Limits, ScallopRule};
use toolpath::{Faces, ForeignProgram, Joining, ReadProgram, Step, Strategy};

/// Default allowance of stock above the part's highest point, mm.
pub const DEFAULT_ALLOWANCE: f64 = 1.0;
/// Default margin of stock around the part in the plan view, mm. Cells off the part measure
/// nothing, so that any margin costs time and memory only.
pub const DEFAULT_MARGIN: f64 = 0.0;
/// Default tolerances, mm: scallop, gouge, uncut, chord (finishing of moulds and dies).
pub const DEFAULT_LIMITS: Limits = Limits { scallop: 0.010, gouge: 0.005, uncut: 0.050, chord: 0.001 };
/// Default spindle speed, rev/min; written into programs, measures nothing.
pub const DEFAULT_SPINDLE_SPEED: f64 = 12000.0;
/// Default feed along passes, mm/min.
pub const DEFAULT_FEED_RATE: f64 = 1000.0;
/// Default feed down to a pass, mm/min.
pub const DEFAULT_PLUNGE_RATE: f64 = 300.0;
/// Default height of rapid moves above stock, mm.
pub const DEFAULT_CLEARANCE: f64 = 2.0;
/// Default memory for one simulation, MiB.
pub const DEFAULT_MEMORY_MIB: u32 = 2048;
/// Whether to find out what each move removes by default: a tenth of the time of a run on the wave.
pub const DEFAULT_REMOVAL: bool = true;
/// The error bound asked by default is the least tolerance that is measured against over this: what is left
/// open then decides no verdict but the closest. A greater one costs time along crests.
pub const ERROR_BOUNDS_A_TOLERANCE: f64 = 10.0;

/// No smaller error bound is asked by default, mm: root finding leaves a nanometre in any case.
const LEAST_ERROR_BOUND: f64 = 1e-6;

/// The error bound, mm, that is asked when the scene asks for none.
pub fn default_error_bound(limits: &Limits) -> f64 {
    (limits.scallop.min(limits.gouge).min(limits.uncut) / ERROR_BOUNDS_A_TOLERANCE).max(LEAST_ERROR_BOUND)
}

/// One toolpath to plan.
#[derive(Debug, Clone, PartialEq)]
pub struct ToolpathRequest {
    /// What the user calls it; unique in the scene.
    pub name: String,
    /// Folder of its files; unique in the scene, a plain file name everywhere.
    pub folder: String,
    /// How to plan it.
    pub strategy: Box<dyn Strategy>,
    /// With what.
    pub tooling: Tooling,
    /// How far its passes lie apart.
    pub step: Step,
    /// How deep each of its levels goes below the one above at most, mm; `None` in one step down.
    pub stepdown: Option<f64>,
    /// What it leaves on the part for a toolpath behind it, mm.
    pub allowance: f64,
    /// The files of its feed directions, in the order of the scene; [`Scene::read`] reads them into the
    /// strategy.
    pub directions: Vec<NamedFile>,
    /// Whether passes planned by a scallop height are corrected by what is measured of them.
    pub correct: bool,
    /// How its passes are smoothed and joined.
    pub joining: Joining,
    /// The slopes of the faces that it is made for, degrees from the level.
    pub slope: [f64; 2],
    /// Within it its axis stays, in the plan view; `None` for the whole part.
    pub boundary: Option<Arc<Region>>,
    /// Whether its passes are where the toolpaths before it left too much, and nowhere else.
    pub rest: bool,
    /// How its axis is tilted; `None` for an upright one.
    pub axis: Option<AxisRequest>,
    /// Whether it cuts what the toolpath before it left, and not a block of its own.
    pub stock_is_previous: bool,
    /// The machining time that its scallop height is to take, instead of that of `step`.
    pub equal_time: Option<EqualTime>,
}

impl ToolpathRequest {
    /// Whether its tool may lean.
    pub fn tilts(&self) -> bool {
        self.axis.is_some() || self.foreign().is_some_and(|read| !read.path.is_upright())
    }

    /// The faces that it is made for.
    pub fn faces(&self) -> Faces {
        Faces::of_slopes(self.slope.map(f64::to_radians))
    }

    /// Whether its passes are in some places of the plan view alone.
    pub fn is_for_places(&self) -> bool {
        self.boundary.is_some() || self.rest
    }

    /// What was read of it, where it is a program from elsewhere.
    pub fn foreign(&self) -> Option<&ReadProgram> {
        self.strategy.downcast_ref::<ForeignProgram>().and_then(|program| program.read.as_deref())
    }

    /// Whether it is a program from elsewhere, read or not.
    pub(crate) fn is_foreign(&self) -> bool {
        self.strategy.downcast_ref::<ForeignProgram>().is_some()
    }

    /// The strategy's name as scenes spell it.
    pub fn strategy_name(&self) -> &'static str {
        self.strategy.word()
    }
}

/// A checked scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// The text it was read from.
    pub source: SceneText,
    /// What the user calls it (the file's name without extension by default).
    pub title: String,
    /// What is to be made.
    pub part: PartSource,
    /// What of it is judged.
    pub judged: Judged,
    /// What it is made from.
    pub stock: StockRequest,
    /// Whether the scene says how wide that is, and not the default.
    pub stock_is_stated: bool,
    /// With what, unless a toolpath has a tool of its own.
    pub tooling: Tooling,
    /// What is tolerated.
    pub tolerance: Limits,
    /// Which ridges may exceed the scallop tolerance.
    pub scallop_rule: ScallopRule,
    /// By how much passes may be off the feed directions asked for, rad; `None` leaves it unjudged.
    pub off_direction: Option<f64>,
    /// How it is simulated.
    pub simulation: Simulation,
    /// On what.
    pub machine: Machine,
    /// Its rotary axes; `None` for a machine of three axes, or where none is named.
    pub five_axis: Option<FiveAxis>,
    /// How near arcs of programs stay to the moves that they stand for, mm; `None` writes moves alone.
    pub arcs: Option<f64>,
    /// Its own bodies; `None` where the scene has none.
    pub bodies: Option<MachineBodies>,
    /// Height of rapid moves above stock, mm.
    pub clearance: f64,
    /// What tilted tools keep away from.
    pub keep_clear: KeepClear,
    /// The toolpaths, in the order of the scene; at least one.
    pub toolpaths: Vec<ToolpathRequest>,
}

/// The cell that suits the cutters and the steps of toolpaths: six cells between passes and thirty a radius
/// (sixty for a flat, whose edge is sharp), rounded down to 1, 2 or 5 times a power of ten. A ball of 6 mm
/// gets 0.05 mm at a scallop of 10 µm. With fewer cells between passes a narrow pass may be lowest on none of
/// them, and the error bounds grow; more cost memory and time as their square.
pub fn auto_cell(toolpaths: &[ToolpathRequest]) -> f64 {
    const CELLS_A_PASS: f64 = 6.0;
    const CELLS_A_RADIUS: f64 = 30.0;
    let of_one = |request: &ToolpathRequest| {
        let cutter = &request.tooling.cutter;
        let corner = cutter.corner_radius();
        let coarsest = cutter.radius() / if corner > 0.0 { CELLS_A_RADIUS } else { 2.0 * CELLS_A_RADIUS };
        match request.step {
            Step::Stepover(width) => coarsest.min(width / CELLS_A_PASS),
            // The strip of a corner of radius r on a plane is √(8rh) wide; a flat has none.
            Step::Scallop(height) if corner > 0.0 => {
                coarsest.min((8.0 * corner * height).sqrt() / CELLS_A_PASS)
            }
            Step::Scallop(_) => coarsest,
        }
    };
    let exact = toolpaths.iter().map(of_one).fold(f64::INFINITY, f64::min);
    // Finer than scenes may ask for is finer than heights are resolved.
    let exact = exact.max(*keys::LENGTH.start());
    let exponent = exact.log10().floor() as i32;
    let power = 10f64.powi(exponent);
    // A hair of rounding must not turn 0.05 into 0.02.
    let digit = [5.0, 2.0].into_iter().find(|d| d * power <= exact * (1.0 + 1e-9)).unwrap_or(1.0);
    // Divide rather than multiply by 0.01: 5/100 is the number that a user writes as 0.05.
    if exponent < 0 { digit / 10f64.powi(-exponent) } else { digit * power }
}
