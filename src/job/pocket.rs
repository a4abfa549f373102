//! A scene's pocket: its region from a drawing or the scene's points, and the floor that is measured.

use super::JobError;
use field::fill;
use geometry::{Point3, Region, TriangleMesh};
use io::outline;
use io::outline::OutlineOptions;
use metrology::{ContactArcs, PocketFigures, wall_gouge_of_cells, wall_gouge_of_moves};
use motion::Toolpath;
use part::Part;
use scene::{OutlineSource, PartSource, Scene, SceneError};
use sim::ZMap;
use toolpath::{Engagement, Pocket, PocketStrategy, Step, engagement, limit_feed};

/// Share of the chord tolerance that drawings are flattened to; the passes have the rest.
const FLATTEN_SHARE: f64 = 0.5;

/// The floor is measured up to this many chord tolerances from its walls, where chords of the last pass
/// leave as much ...
const CHORDS_FROM_WALLS: f64 = 2.0;

/// ... and to this share of the cutter's radius, by which offsets keep to the safe side.
const RADIUS_FROM_WALLS: f64 = 5.0e-4;

/// The pocket of a scene, if it is one.
///
/// # Errors
/// [`SceneError`] when the drawing is refused, at its name in the scene.
pub fn load_pocket(scene: &Scene) -> Result<Option<Pocket>, SceneError> {
    let PartSource::Pocket { outline, depth } = &scene.part else { return Ok(None) };
    pocket_of(scene, outline, *depth).map(|(pocket, _)| Some(pocket))
}

/// The pocket of outlines and a depth, mm, and what is to be said about its drawing.
///
/// # Errors
/// As [`load_pocket`].
pub fn pocket_of(
    scene: &Scene,
    outline: &OutlineSource,
    depth: f64,
) -> Result<(Pocket, Vec<String>), SceneError> {
    let (region, notes) = match outline {
        OutlineSource::File { file, format, unit, layer } => {
            let options = OutlineOptions {
                chord_tolerance: FLATTEN_SHARE * scene.tolerance.chord,
                scale: unit.map(|u| u.1),
                layer: layer.clone(),
            };
            let read = outline::read(&file.path, *format, &options).map_err(|e| {
                let message = format!("the pocket's drawing cannot be used: {}: {e}", file.written);
                scene.source.error(file.span.clone(), message, "mend that file or name another one")
            })?;
            let notes = read.notes.iter().map(|note| format!("{}: {note}", file.written)).collect();
            (read.region, notes)
        }
        OutlineSource::Points { curves } => {
            let region = Region::nested(curves.clone()).map_err(|e| refused(scene, &e.to_string()))?.0;
            (region, Vec::new())
        }
    };
    Ok((Pocket { region, depth }, notes))
}

/// The part that is measured: the floor that the scene's cutter can reach, as far as its passes come.
///
/// # Errors
/// [`JobError`] when the cutter fits nowhere.
pub fn floor_part(scene: &Scene, pocket: &Pocket) -> Result<Part, JobError> {
    let clear = CHORDS_FROM_WALLS * scene.tolerance.chord + RADIUS_FROM_WALLS * scene.cutter.radius();
    let floor = pocket.reachable_floor(&scene.cutter).inset(clear);
    if floor.is_empty() {
        let largest = pocket.region.largest_disc(0.005).map_or(0.0, |d| 2.0 * d.1);
        let message = format!(
            "the cutter of {} mm fits nowhere in the pocket; the largest that would has {:.2} mm",
            2.0 * scene.cutter.radius(),
            (100.0 * largest).floor() / 100.0
        );
        return Err(refused(scene, &message).into());
    }
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for piece in &floor.pieces {
        let (points, corners) = fill(piece).map_err(|e| refused(scene, &e.to_string()))?;
        let first = vertices.len() as u32;
        vertices.extend(points.iter().map(|p| Point3::new(p.x, p.y, -pocket.depth)));
        triangles.extend(corners.iter().map(|t| t.map(|v| first + v)));
    }
    let (mesh, _) = TriangleMesh::new(vertices, triangles).map_err(|e| refused(scene, &e.to_string()))?;
    Ok(Part::from_mesh(mesh))
}

/// Lowers the feed where more of the cutter was measured in stock than the strategy allows. Leaves the
/// engagement of the passes, and the bound of its greatest angle, rad.
pub fn limit_feed_by(
    path: &mut Toolpath,
    arcs: &ContactArcs,
    strategy: &PocketStrategy,
    step: Step,
    radius: f64,
) -> (Engagement, f64) {
    let limit = strategy.engagement_limit(step, radius);
    let found = engagement(path, &arcs.of_moves, limit);
    limit_feed(path, &arcs.of_moves, limit);
    (found, arcs.bound(found.max))
}

/// What is measured of a pocket besides its floor. `top` is the height of the stock, mm.
pub fn pocket_figures(
    scene: &Scene,
    pocket: &Pocket,
    strategy: &PocketStrategy,
    step: Step,
    path: &Toolpath,
    cut: &ZMap,
    top: f64,
    (engaged, engagement_bound): &(Engagement, f64),
) -> PocketFigures {
    let cutter = &scene.cutter;
    let (wall_gouge_mm, wall_gouge_move) = wall_gouge_of_moves(&pocket.region, cutter, path, top);
    let (of_cells, area) = wall_gouge_of_cells(&pocket.region, cut, top);
    PocketFigures {
        area_mm2: pocket.region.area(),
        unreachable_area_mm2: pocket.rest_area(cutter),
        stepover_mm: strategy.stepover(step, cutter.radius()),
        wall_gouge_mm,
        wall_gouge_error_bound_mm: FLATTEN_SHARE * scene.tolerance.chord,
        wall_gouge_move,
        wall_gouge_of_cells_mm: of_cells,
        wall_gouge_of_cells_error_bound_mm: std::f64::consts::FRAC_1_SQRT_2 * cut.grid.cell,
        wall_gouge_area_mm2: area,
        max_engagement_deg: engaged.max.to_degrees(),
        max_engagement_error_bound_deg: engagement_bound.to_degrees(),
        max_engagement_move: engaged.max_move,
        p95_engagement_deg: engaged.p95.to_degrees(),
        engagement_limit_deg: strategy.engagement_limit(step, cutter.radius()).to_degrees(),
        over_engagement_limit_fraction: engaged.over_limit,
    }
}

fn refused(scene: &Scene, what: &str) -> SceneError {
    let span = scene.part_file().map_or(0..0, |file| file.span.clone());
    scene.source.error(span, what.to_owned(), "change the pocket's outline or the cutter")
}
