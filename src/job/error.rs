//! Why a job could not be done.

use miette::Diagnostic;

use geometry::{MeshError, Point3};
use metrology::EngineError;
use motion::PathError;
use report::ReportError;
use scene::{LoadError, Scene, SceneError};
use sim::{GridError, OppositeAxes, VoxelError};
use toolpath::PlanError;
use work::monitor::Cancelled;

/// Why a job could not be done; each tells what, where, and the cure.
#[derive(Debug, thiserror::Error, Diagnostic)]
pub enum JobError {
    /// The scene, or a file that it names, cannot be used.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Scene(#[from] SceneError),
    /// The part of the scene cannot be used.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Part(#[from] LoadError),
    /// No grid could be laid out.
    #[error("{scene}: the stock cannot be simulated: {reason}")]
    #[diagnostic(help("choose another `cell` or `memory_mib` in [simulation], or `--cell`"))]
    Grid {
        /// The scene, as its messages call it.
        scene: String,
        /// What is wrong with the grid.
        reason: GridError,
    },
    /// The part is larger than its stock.
    #[error(
        "{scene}: the part stands {by:.3} mm out of its stock at x {:.3} y {:.3} z {:.3}", at.x, at.y, at.z
    )]
    #[diagnostic(help("make the stock of [stock] larger, or move it"))]
    OutsideStock {
        /// The scene, as its messages call it.
        scene: String,
        /// How far, mm.
        by: f64,
        /// Where it stands out farthest.
        at: Point3,
    },
    /// A toolpath could not be planned.
    #[error("{scene}: the toolpath \"{name}\" could not be planned: {reason}")]
    #[diagnostic(help("change or delete that [[toolpath]] in the scene"))]
    Plan {
        /// The scene, as its messages call it.
        scene: String,
        /// Name of the toolpath.
        name: String,
        /// What the planner said.
        reason: PlanError,
    },
    /// None of several toolpaths could be planned.
    #[error("{scene}: none of the {} toolpaths could be planned{}", reasons.len(), listed(reasons))]
    #[diagnostic(help("change or delete those [[toolpath]] in the scene"))]
    NonePlanned {
        /// The scene, as its messages call it.
        scene: String,
        /// The name of each, and why.
        reasons: Vec<(String, String)>,
    },
    /// No plan of a toolpath takes as little time as it is compared at.
    #[error(
        "{scene}: the toolpath \"{name}\" takes {least:.2} minutes or more, at scallops of {highest} mm already, and {asked} were asked for"
    )]
    #[diagnostic(help("write `minutes = {least:.2}` or more in [compare]"))]
    TooLittleTime {
        /// The scene, as its messages call it.
        scene: String,
        /// Name of the toolpath.
        name: String,
        /// The least time that was found, minutes, rounded up.
        least: f64,
        /// The scallops that it leaves, mm.
        highest: f64,
        /// The time that was asked for, minutes.
        asked: f64,
    },
    /// No plan of a toolpath takes as much time as it is compared at.
    #[error(
        "{scene}: the toolpath \"{name}\" takes {most:.2} minutes or less, at scallops of {lowest} mm still, and {asked} were asked for"
    )]
    #[diagnostic(help("write `minutes = {most:.2}` or less in [compare]"))]
    TooMuchTime {
        /// The scene, as its messages call it.
        scene: String,
        /// Name of the toolpath.
        name: String,
        /// The most time that was found, minutes, rounded down.
        most: f64,
        /// The scallops that it leaves, mm.
        lowest: f64,
        /// The time that was asked for, minutes.
        asked: f64,
    },
    /// The machine cannot run a toolpath.
    #[error("{scene}: the machine cannot run the toolpath \"{name}\": {reason}")]
    #[diagnostic(help("change [machine.kinematics] or that [[toolpath]] in the scene"))]
    Machine {
        /// The scene, as its messages call it.
        scene: String,
        /// Name of the toolpath.
        name: String,
        /// Why not.
        reason: String,
    },
    /// The path of a toolpath cannot be cut.
    #[error("{scene}: the toolpath \"{name}\" cannot be cut: {reason}")]
    #[diagnostic(help("change that [[toolpath]] in the scene"))]
    Path {
        /// The scene, as its messages call it.
        scene: String,
        /// Name of the toolpath.
        name: String,
        /// Which move, and why.
        reason: PathError,
    },
    /// The engine does not know tilted cutters.
    #[error(
        "{scene}: the toolpath \"{name}\" tilts the cutter, and the engine `{engine}` knows upright ones only"
    )]
    #[diagnostic(help("write `engine = \"rays\"` or \"auto\" in [simulation], or delete `--engine`"))]
    Upright {
        /// The scene, as its messages call it.
        scene: String,
        /// Name of the toolpath.
        name: String,
        /// The engine.
        engine: &'static str,
    },
    /// What is measured along normals needs a surface with two sides.
    #[error(
        "{scene}: the toolpath \"{name}\" cannot be measured along normals, because the part is no surface. {reason}"
    )]
    #[diagnostic(help(
        "write `engine = \"zmap\"` or \"auto\" in [simulation] and delete `axis` in the [[toolpath]]: upright cutters need \
         no surface"
    ))]
    NoSurface {
        /// The scene, as its messages call it.
        scene: String,
        /// Name of the toolpath.
        name: String,
        /// Where it is none.
        reason: Box<MeshError>,
    },
    /// Pockets have no normals to be measured along.
    #[error(
        "{scene}: the toolpath \"{name}\" mills a pocket, and the engines `rays` and `voxel` measure surfaces"
    )]
    #[diagnostic(help("write `engine = \"zmap\"` or \"auto\" in [simulation], or delete `--engine`"))]
    PocketAlongNormals {
        /// The scene, as its messages call it.
        scene: String,
        /// Name of the toolpath.
        name: String,
    },
    /// A tilted path cannot be simulated.
    #[error("{scene}: the toolpath \"{name}\" cannot be simulated: {reason}")]
    #[diagnostic(help("change the `axis` of that [[toolpath]]"))]
    Turn {
        /// The scene, as its messages call it.
        scene: String,
        /// Name of the toolpath.
        name: String,
        /// What is wrong with its moves.
        reason: OppositeAxes,
    },
    /// The solid cannot be cut into voxels.
    #[error("{scene}: the solid of the toolpath \"{name}\" cannot be cut: {reason}")]
    #[diagnostic(help("write another `voxel`, or a greater `memory_mib`, in [simulation]"))]
    Voxels {
        /// The scene, as its messages call it.
        scene: String,
        /// Name of the toolpath.
        name: String,
        /// What is wrong.
        reason: VoxelError,
    },
    /// The moves take more memory than is left, where they are to be met by rays.
    #[error("{scene}: the toolpath \"{name}\" cannot be measured: {reason}")]
    #[diagnostic(help("write a greater `memory_mib` in [simulation]"))]
    Rays {
        /// The scene, as its messages call it.
        scene: String,
        /// Name of the toolpath.
        name: String,
        /// What is needed and what is left.
        reason: EngineError,
    },
    /// The places along the normals take more memory than allowed.
    #[error(
        "{scene}: places {spacing} mm apart on the part need {needed_mib} MiB, and {allowed_mib} MiB are allowed"
    )]
    #[diagnostic(help(
        "write `cell = {fitting}` or a greater one, or a greater `memory_mib`, in [simulation]"
    ))]
    Places {
        /// The scene, as its messages call it.
        scene: String,
        /// What was asked for, mm.
        spacing: f64,
        /// What the run would need.
        needed_mib: u64,
        /// What it may take.
        allowed_mib: u32,
        /// Spacing that fits, mm.
        fitting: f64,
    },
    /// The program could not be put into words.
    #[error("the program cannot be written: {0}")]
    Program(String),
    /// A figure cannot stand in the report.
    #[error(transparent)]
    Report(#[from] ReportError),
    /// The user asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Toolpaths with their reasons, a line each.
fn listed(reasons: &[(String, String)]) -> String {
    reasons.iter().map(|(name, reason)| format!("\n\"{name}\": {reason}")).collect()
}

impl JobError {
    /// Why no toolpath has a path: the error of the only one, or the reasons of all, each with the toolpath's
    /// name.
    pub(crate) fn of_all(scene: &Scene, mut refused: Vec<(String, Self)>) -> Self {
        if refused.len() == 1 {
            return refused.remove(0).1;
        }
        let reason = |error: &Self| error.why_not_planned().unwrap_or_else(|| error.to_string());
        let reasons = refused.iter().map(|(name, error)| (name.clone(), reason(error))).collect();
        Self::NonePlanned { scene: scene.source.name.clone(), reasons }
    }

    /// For grids that do not fit: `map_err(JobError::grid(scene))`.
    pub(crate) fn grid(scene: &Scene) -> impl Fn(GridError) -> Self + use<'_> {
        |reason| Self::Grid { scene: scene.source.name.clone(), reason }
    }

    /// An engine's error, told with the toolpath's name.
    pub(crate) fn engine(scene: &Scene, name: &str, reason: EngineError) -> Self {
        let (scene, name) = (scene.source.name.clone(), name.to_owned());
        match reason {
            EngineError::Cancelled(cancelled) => Self::Cancelled(cancelled),
            EngineError::Grid(reason) => Self::Grid { scene, reason },
            EngineError::Path(reason) => Self::Path { scene, name, reason },
            EngineError::Turn(reason) => Self::Turn { scene, name, reason },
            EngineError::Voxels(reason) => Self::Voxels { scene, name, reason },
            EngineError::Places { spacing, needed_mib, allowed_mib, fitting } => {
                Self::Places { scene, spacing, needed_mib, allowed_mib, fitting }
            }
            EngineError::Rays { .. } => Self::Rays { scene, name, reason },
        }
    }

    /// Why a toolpath has no path, if that is what was wrong. Other toolpaths of its scene may have one.
    pub fn why_not_planned(&self) -> Option<String> {
        match self {
            Self::Plan { reason, .. } => Some(reason.to_string()),
            Self::TooLittleTime { least, highest, asked, .. } => Some(format!(
                "it takes {least:.2} minutes or more, at scallops of {highest} mm already, and {asked} were asked for; write larger \
                 `minutes` in [compare]"
            )),
            Self::TooMuchTime { most, lowest, asked, .. } => Some(format!(
                "it takes {most:.2} minutes or less, at scallops of {lowest} mm still, and {asked} were asked for; write smaller \
                 `minutes` in [compare]"
            )),
            Self::Machine { reason, .. } => Some(format!("the machine cannot run it: {reason}")),
            _ => None,
        }
    }

    /// A planner's error, told with the toolpath's name.
    pub(crate) fn plan(scene: &Scene, name: &str, reason: PlanError) -> Self {
        match reason {
            PlanError::Cancelled(cancelled) => Self::Cancelled(cancelled),
            reason => Self::Plan { scene: scene.source.name.clone(), name: name.to_owned(), reason },
        }
    }
}
