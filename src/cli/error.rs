//! Why a command could not be done, and how that is told.

use std::path::{Path, PathBuf};

use miette::{Diagnostic, GraphicalReportHandler, GraphicalTheme};

use report::ReportError;
use scallop::ScallopError;
use scene::{Engine, LoadError, Scene, SceneError};
use sim::{GridError, OppositeAxes, RaysError, VoxelError};
use toolpath::PlanError;
use work::monitor::Cancelled;

/// Why a command could not be done.
#[derive(Debug, thiserror::Error, Diagnostic)]
pub enum CliError {
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
    /// The engine does not know tilted cutters.
    #[error(
        "{scene}: the toolpath \"{name}\" tilts the cutter, and the engine `{engine}` knows upright ones only"
    )]
    #[diagnostic(help("write `engine = \"rays\"` or \"auto\" in [simulation], or delete `--engine`"))]
    Engine {
        /// The scene, as its messages call it.
        scene: String,
        /// Name of the toolpath.
        name: String,
        /// The engine.
        engine: &'static str,
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
    /// No scallop follows from what was asked.
    #[error("no scallop can be calculated: {0}")]
    #[diagnostic(help("`millstream scallop --help` tells what can be asked"))]
    Scallop(ScallopError),
    /// The part that `scallop` was to look at is none.
    #[error("{}: {reason}", file.display())]
    #[diagnostic(help("{cure}"))]
    ScallopPart {
        /// Its file.
        file: PathBuf,
        /// What is wrong.
        reason: String,
        /// What mends it.
        cure: String,
    },
    /// A result could not be written.
    #[error("cannot write {}: {reason}", path.display())]
    #[diagnostic(help("name another folder with --out"))]
    Output {
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        reason: String,
    },
    /// A figure cannot stand in the report.
    #[error(transparent)]
    Report(#[from] ReportError),
    /// The threads could not be started.
    #[error("cannot start the threads: {0}")]
    #[diagnostic(help("ask for fewer with --threads"))]
    Threads(String),
    /// The user asked to stop.
    #[error("interrupted; nothing was written")]
    Interrupted,
}

impl From<Cancelled> for CliError {
    fn from(_: Cancelled) -> Self {
        Self::Interrupted
    }
}

impl CliError {
    /// For results that could not be written: `map_err(CliError::output(path))`.
    pub fn output(path: &Path) -> impl Fn(std::io::Error) -> Self + use<'_> {
        |error| Self::Output { path: path.to_owned(), reason: error.to_string() }
    }

    /// For grids that do not fit: `map_err(CliError::grid(scene))`.
    pub fn grid(scene: &Scene) -> impl Fn(GridError) -> Self + use<'_> {
        |reason| Self::Grid { scene: scene.source.name.clone(), reason }
    }

    /// For an engine that does not know tilted cutters.
    pub fn engine(scene: &Scene, name: &str, engine: Engine) -> Self {
        Self::Engine { scene: scene.source.name.clone(), name: name.to_owned(), engine: engine.name() }
    }

    /// For paths with turns that no engine knows: `map_err(CliError::rays(scene, name))`.
    pub fn rays(scene: &Scene, name: &str) -> impl Fn(RaysError) -> Self {
        |reason| match reason {
            RaysError::Cancelled(_) => Self::Interrupted,
            RaysError::Opposite(reason) => {
                Self::Turn { scene: scene.source.name.clone(), name: name.to_owned(), reason }
            }
        }
    }

    /// For solids that do not fit.
    pub fn voxels(scene: &Scene, name: &str, reason: VoxelError) -> Self {
        match reason {
            VoxelError::Cancelled(_) => Self::Interrupted,
            reason => Self::Voxels { scene: scene.source.name.clone(), name: name.to_owned(), reason },
        }
    }

    /// A planner's error, told with the toolpath's name.
    pub fn plan(scene: &Scene, name: &str, reason: PlanError) -> Self {
        match reason {
            PlanError::Cancelled(_) => Self::Interrupted,
            reason => Self::Plan { scene: scene.source.name.clone(), name: name.to_owned(), reason },
        }
    }
}

/// The message as it stands on stderr: what, where (file, line, column and caret when the text of a
/// scene is meant), and the cure.
pub fn render(error: &CliError, colour: bool) -> String {
    let theme = if colour { GraphicalTheme::unicode() } else { GraphicalTheme::unicode_nocolor() };
    let handler = GraphicalReportHandler::new_themed(theme).with_width(100).with_links(false);
    let mut text = String::new();
    match handler.render_report(&mut text, error) {
        Ok(()) => text,
        Err(_) => format!("error: {error}\n"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(text: &str) -> String {
        render(&CliError::Scene(Scene::parse("scenes/wave.toml", text).unwrap_err()), false)
    }

    #[test]
    fn a_misspelt_key_is_shown_in_its_line() {
        let text = message("[part]\nfile = \"wave.stl\"\n[cutter]\nshape = \"ball\"\ndiametr = 6.0\n");
        insta::assert_snapshot!(text);
    }

    #[test]
    fn broken_toml_is_shown_where_it_breaks() {
        insta::assert_snapshot!(message("[part]\nfile = \"wave.stl\n"));
        insta::assert_snapshot!(message("[part]\nsurface = \"wav\"\n"));
        insta::assert_snapshot!(message(
            "[part]\nfile = \"wave.stl\"\n[cutter]\nshape = \"ball\"\ndiameter = -6\n"
        ));
        insta::assert_snapshot!(message(""));
    }

    #[test]
    fn errors_without_a_place_name_the_cure() {
        insta::assert_snapshot!(render(&CliError::Interrupted, false));
        insta::assert_snapshot!(render(
            &CliError::Grid { scene: "plate.toml".into(), reason: GridError::Cell(-1.0) },
            false
        ));
    }
}
