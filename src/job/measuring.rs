//! Measuring a path: closer, and on finer cells, where a limit hangs on that.

use metrology::{Engine, EngineError, LaidOut, Measured, Simulation, Task};
use motion::{Cutters, Toolpath};
use scene::{Scene, ToolpathRequest, auto_cell};
use work::monitor::Monitor;

use super::{JobError, Session, judge};

/// The cell shrinks to this share where a limit is undecided, and at once to what suits the scene where that
/// is smaller: cells that show no pass decide little, and take longer. Nearer to 1 more cuts are made in
/// vain, nearer to 0 more cells.
const FINER: f64 = 0.5;

/// Rounds in which bounds are asked for that are smaller by the square of that, down to a share of the first;
/// the cell may be the finest already that suits the scene. It shrinks in them, too, up to so many cells:
/// more take minutes.
const CLOSER_ROUNDS: usize = 2;
const MOST_CLOSER_CELLS: usize = 4_000_000;
const CLOSEST_BOUND: f64 = 0.02;

/// How closely a path is measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Closeness {
    /// As the verdict needs it.
    Verdict,
    /// No closer where the path is to be planned anew: its highest place stands above `limit`, mm, for
    /// certain. Where finer cells do not make a look closer, another plan takes less time than that: it is
    /// enough that the place, known to `within` mm, may stand above.
    Plan {
        within: f64,
        limit: f64,
        /// A gouge that is shown to be no deeper than this, mm, is not known more closely; 0 where it is to be.
        allowed_depth: f64,
    },
}

impl Closeness {
    /// Whether no closer look is needed for a plan. Where `coarse` cells may tell heights that finer ones do
    /// not have, these have to be known as closely as was `asked`, mm.
    fn is_enough(self, measured: &Measured, coarse: bool, asked: f64) -> bool {
        let highest = judge::highest_reached(&measured.measurement);
        match self {
            Self::Verdict => false,
            Self::Plan { within, limit, .. } => {
                !coarse && highest.error_bound_mm <= within && highest.at_most() > limit
                    || highest.max_mm > limit && !(coarse && highest.error_bound_mm > asked)
            }
        }
    }
}

impl Closeness {
    fn allowed_depth(self) -> f64 {
        if let Self::Plan { allowed_depth, .. } = self { allowed_depth } else { 0.0 }
    }

    /// As closely, but for gouges that hold their limit, mm: a plan that is compared with another one may be given
    /// up, and the one that is kept is measured again.
    pub fn compared(self, gouge: f64) -> Self {
        match self {
            Self::Plan { within, limit, .. } => Self::Plan { within, limit, allowed_depth: gouge },
            Self::Verdict => Self::Verdict,
        }
    }
}

/// A path as closely measured as was asked.
pub(crate) struct MeasuredClosely {
    pub measured: Measured,
    /// Whether a closer look would change no verdict.
    pub is_as_verdict: bool,
}

impl Session {
    /// Cuts and measures as closely as is asked; closer, and on finer cells where these help, where a limit
    /// hangs on that. The path may begin with the moves of other toolpaths.
    pub(crate) fn measure_closely(
        &self,
        request: &ToolpathRequest,
        engine: &dyn Engine,
        (path, cutters): (&Toolpath, &Cutters),
        closeness: Closeness,
        monitor: &dyn Monitor,
    ) -> Result<MeasuredClosely, JobError> {
        let scene = &self.scene;
        let failed = |reason| JobError::engine(scene, &request.name, reason);
        let own = self.own_cells(request)?;
        let (simulation, cells) =
            own.as_ref().map_or((&scene.simulation, &self.cells), |(simulation, cells)| (simulation, cells));
        let mut finest = auto_cell(&scene.toolpaths).min(simulation.cell);
        // Cells up to twice as wide as suits the scene show every pass.
        let is_first_look = engine.gains_by_cells() && FINER * cells.0.cell > finest;
        let allowed_depth = closeness.allowed_depth();
        let first =
            Task { is_first_look, allowed_depth, ..self.task(request, (path, cutters), simulation, cells) };
        let mut measured = engine.measure(&first, monitor).map_err(failed)?;
        let mut simulation = Simulation { cell_is_auto: false, cell: measured.cell, ..scene.simulation };
        if !engine.gains_by_cells() {
            finest = simulation.cell;
        }
        let (mut rounds, least) = (0, CLOSEST_BOUND * scene.simulation.error_bound);
        while (simulation.cell > finest || rounds < CLOSER_ROUNDS) && self.is_open(&measured) {
            if closeness.is_enough(&measured, engine.gains_by_cells(), simulation.error_bound) {
                return Ok(MeasuredClosely { measured, is_as_verdict: false });
            }
            rounds += 1;
            let before = simulation.cell;
            if engine.gains_by_cells() {
                simulation.cell = finer_cell(&measured, finest, before);
            }
            simulation.error_bound = (FINER * FINER * simulation.error_bound).max(least);
            let cells = self.budget().grid_before_planning(&self.area(), &simulation);
            let finer = cells.map(|cells| {
                let task = self.task(request, (path, cutters), &simulation, &cells);
                let task = Task { allowed_depth, ..task };
                engine.measure(&task, monitor)
            });
            match finer {
                Ok(Ok(finer)) => {
                    let wall_s = measured.wall_s + finer.wall_s;
                    measured =
                        Measured { note: finer_note(&simulation, scene).or(finer.note), wall_s, ..finer }
                }
                Ok(Err(EngineError::Cancelled(cancelled))) => return Err(cancelled.into()),
                // Finer cells do not fit into the memory; smaller bounds on the same ones may be enough.
                _ if simulation.cell < before => (simulation.cell, finest) = (before, before),
                _ => break,
            }
        }
        let is_as_verdict =
            allowed_depth == 0.0 || measured.measurement.gouge.error_bound_mm <= simulation.error_bound;
        Ok(MeasuredClosely { measured, is_as_verdict })
    }

    /// The cells of a toolpath that was planned for a time, where its passes lie nearer than those of the
    /// scene's scallop height.
    fn own_cells(&self, request: &ToolpathRequest) -> Result<Option<(Simulation, LaidOut)>, JobError> {
        let scene = &self.scene;
        let cell = auto_cell(std::slice::from_ref(request));
        if request.equal_time.is_none() || !scene.simulation.cell_is_auto || cell >= scene.simulation.cell {
            return Ok(None);
        }
        let simulation = Simulation { cell, ..scene.simulation };
        let cells = self.budget().grid_before_planning(&self.area(), &simulation);
        Ok(Some((simulation, cells.map_err(JobError::grid(scene))?)))
    }
}

/// The next cell after one that left a limit undecided. Where few cells are enough, it is `finest`, which
/// suits the scene, or half of the last cell if that is smaller. More cells are reached in steps and end at
/// `finest`.
fn finer_cell(measured: &Measured, finest: f64, before: f64) -> f64 {
    let quick = before * (measured.cells as f64 / MOST_CLOSER_CELLS as f64).sqrt();
    let halved = FINER * before;
    if quick <= halved { halved.min(finest.max(quick)) } else { halved.max(finest.min(before)) }
}

fn finer_note(simulation: &Simulation, scene: &Scene) -> Option<String> {
    (simulation.cell < scene.simulation.cell).then(|| {
        format!(
            "measured on cells of {} mm instead of {} mm: on those a limit was undecided",
            simulation.cell, scene.simulation.cell
        )
    })
}
