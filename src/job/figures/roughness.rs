//! Roughness across the feed.

use cutter::Solid;
use metrology::{
    EngineError, FirstCut, REACH_OVER_UNCUT, RaysCut, RaysCutInTurn, RoughnessFigures, SweptVolume, View,
    path_figures, roughness,
};
use motion::Toolpath;
use report::{Figure, with_bound};
use work::monitor::Monitor;

use super::words::{share, value};
use crate::JobError;
use crate::run::{Finding, Run};

/// What the word means.
const MEANING: (&str, &str) = (
    "roughness",
    "Ra and Rz of profiles of the deviation across the feed, at places spread over the part; the mean line is the \
     mean of each sampling length, one to three path intervals, five of which make a profile. Its ± is how far \
     off a profile's figures may be; how they differ over the part is not in it.",
);

/// Not of pockets.
pub(super) fn find(run: &Run<'_>, monitor: &dyn Monitor) -> Result<Finding, JobError> {
    if run.session.pocket.is_some() {
        return Ok(Finding::default());
    }
    let r = match run.view() {
        View::Normals(view) => {
            let (rays, solid) = (&view.rays, &view.solid);
            measure(run, &RaysCut { rays, path: &run.whole.path, solid }, monitor)?
        }
        View::Heights(cut) => {
            let stretches = run.cutters().stretches(&run.whole.path);
            let solids: Vec<Solid> =
                stretches.iter().map(|stretch| Solid::of_cutter(stretch.cutter, None)).collect();
            let tools: Vec<(&Toolpath, &Solid)> =
                stretches.iter().map(|stretch| &*stretch.path).zip(&solids).collect();
            match run.budget().rays_of_each(&tools, Some(&cut.grid), monitor) {
                Ok(rays) => {
                    let of_tool = |k: usize| {
                        let (path, solid) = tools[k];
                        (stretches[k].first, RaysCut { rays: &rays[k], path, solid })
                    };
                    let tools = (0..rays.len()).map(of_tool).collect();
                    measure(run, &RaysCutInTurn { tools }, monitor)?
                }
                // Nothing is judged by it.
                Err(memory @ EngineError::Rays { .. }) => {
                    RoughnessFigures { reason: Some(memory.to_string()), ..RoughnessFigures::default() }
                }
                Err(reason) => return Err(JobError::engine(run.scene(), &run.request.name, reason)),
            }
        }
    };
    let [ra, rz] = [r.ra_mm, r.rz_mm].map(|height| with_bound(height, r.error_bound_mm));
    let figure = Figure {
        key: "roughness",
        value: value(&r)?,
        rows: vec![("roughness Ra, Rz across the feed", format!("{ra}, {rz} µm"))],
        meaning: Some(MEANING),
        sentence: r.ra_mm.map(|_| sentence(run, &ra, &rz)),
        ..Figure::default()
    };
    Ok(Finding { figure: Some(figure), ..Finding::default() })
}

fn sentence(run: &Run<'_>, ra: &str, rz: &str) -> (&'static str, String) {
    let ratio = run.measurement().pairs.parallel_calculated_over_measured;
    let scallop =
        ratio.map_or_else(String::new, |_| format!("; predicted / measured scallop {}", share(ratio)));
    ("Roughness across the feed, µm", format!("Ra {ra}, Rz {rz}{scallop}: {}", run.request.name))
}

fn measure(run: &Run<'_>, cut: &dyn FirstCut, monitor: &dyn Monitor) -> Result<RoughnessFigures, JobError> {
    let (scene, path) = (run.scene(), &*run.whole.path);
    let reach = REACH_OVER_UNCUT * scene.tolerance.uncut;
    let block =
        run.session.task(run.request, (path, run.cutters()), &scene.simulation, &run.session.cells).block();
    let cut = SweptVolume {
        part: run.part(),
        cut,
        inward: reach,
        outward: reach,
        // A profile is what was cut, of whichever face.
        shallow: f64::INFINITY,
        block,
    };
    // About how far passes are apart.
    let interval = run.measurement().deviation.area_mm2 / path_figures(path, 0.0).cutting_length_mm;
    Ok(roughness(run.part(), run.cutters(), path, &cut, interval, monitor)?)
}
