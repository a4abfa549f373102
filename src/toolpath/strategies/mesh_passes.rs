//! Passes along the level curves of a stream function on a mesh: open STL surfaces with holes and
//! steps, several patches as one surface.
//!
//! Enters: the part and a feed direction. Leaves: passes. The field stands on the part's mesh
//! (`mesh_surface`); a level curve is a chain of straight pieces through its triangles, evened out and
//! run through by a smooth curve of the places of the cutter's axis; every height comes from dropping
//! the cutter there, so that the mesh decides where passes run, never how deep.

mod edges;
mod guide;

use super::iso_scallop::{FrontStart, StartedFront};
use super::mesh_front::{best_on_piece, fronts_over};
use super::mesh_shortest::{gone_on, shortest_streams};
use super::shortest::{Objective, SEARCHED};
use super::streamline::FITTED;
use crate::levels::halving::along_and_between;
use crate::levels::on_triangles::{OnTriangles, along_directions, refused, smooth_directions};
use crate::levels::spacing::place_levels;
use crate::levels::{obedience, planned_field, spirals};
use crate::surface::mesh_surface::{
    ConnectedPiece, MeshSurface, STEEPEST_COSINE, not_applicable, reachable_of,
};
use crate::surface::{asked, feed};
use crate::vocabulary::{
    Faces, FeedDirection, LevelFunction, Levelled, Lines, Passes, PlanError, Step, Task,
};
use cutter::Cutter;
use drop_cutter::DropCutter;
use field::mesh::{Bend, Held, Line, Sense, Wanted};
use field::{DIRECTION_WEIGHT, Packed};
use geometry::{Aabb, Point3, Vector3};
use guide::MeshGuide;
use scallop::{FeedCurvature, strip_width, strip_width_at, widest_strip_at};

/// Steep places of less area together, mm², are not told of: splinters where facets meet.
const LEAST_TOLD: f64 = 0.05;

/// The strip beyond borders is this share of an interval wide, as on charts.
const BORDER_SHARE: f64 = 0.6;

/// Contacts from one point of a curve to before the next, where passes are compared with directions: at
/// borders, and where the surface is nearly as concave as the cutter, contacts turn far more sharply than the
/// axis.
const PARTS_COMPARED: usize = 4;

/// What the stream function shall do.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Aim<'a> {
    /// Follow a direction, by how much it counts over the distances of passes, along levels or traced lines.
    Fitted(&'a FeedDirection, f64, Lines),
    /// Make the path best; with a direction and how much dearer passes square to it are.
    Shortest(Option<(&'a FeedDirection, f64)>, Objective),
    /// Be the arrival of the front from the start with the shortest path.
    Front(FrontStart),
}

/// Passes along the level curves of a stream function over everything of the part that is reached from
/// above.
pub(crate) fn on_mesh(task: &Task<'_>, aim: Aim) -> Result<Passes, PlanError> {
    let Task { part, cutter, ref settings, .. } = *task;
    let flat = match settings.step {
        Step::Stepover(width) => width,
        Step::Scallop(h) => level_interval(cutter, h),
    };
    let parameters: Vec<_> = match part.patches() {
        // u and v of a mesh are its x and y.
        [] => [part.bounds()].map(|b| [[b.min.x, b.max.x], [b.min.y, b.max.y]]).to_vec(),
        patches => patches.iter().map(|patch| patch.domain()).collect(),
    };
    let faces = Faces { least: STEEPEST_COSINE, ..Faces::default() };
    let mut all = Passes { faces, ..Passes::default() };
    if let Aim::Fitted(direction, ..) | Aim::Shortest(Some((direction, _)), _) = aim {
        all.notes.extend(feed::check(direction, &part.bounds(), &parameters)?);
    }
    // Passes end an interval beyond the faces that are asked for.
    let reached = reachable_of(part, cutter, (settings.faces, flat))?;
    if reached.steep_area >= LEAST_TOLD {
        all.notes.push(format!(
            "{:.1} mm² of the surface are steeper than 80 degrees; passes go around them and touch them only where the \
             cutter leans against them",
            reached.steep_area
        ));
    }
    let count = reached.pieces.len();
    let fronts = match aim {
        Aim::Front(start) if (0..count).any(|k| task.earlier_on_chart(k, count).is_none()) => {
            fronts_over(task, &reached.pieces, start)?
        }
        _ => Vec::new(),
    };
    for (k, piece) in reached.pieces.iter().enumerate() {
        let surface = MeshSurface::with_margin(piece, BORDER_SHARE * flat)?;
        let earlier = match aim {
            Aim::Front(_) => task.earlier_on_chart(k, count),
            _ => task.earlier_on_mesh(k, count),
        };
        let mut passes = on_piece(task, (aim, &fronts), piece, &surface, earlier)?;
        if count > 1 {
            let at = Aabb::of(piece.mesh.points());
            let [from, to] = [at.min, at.max];
            let place = format!("x {:.1} to {:.1} y {:.1} to {:.1}", from.x, to.x, from.y, to.y);
            passes.notes.iter_mut().for_each(|note| *note = format!("on the surface at {place}: {note}"));
        }
        all.append(passes);
    }
    Ok(all)
}

/// What a function is whose levels run along the borders around holes.
const ALONG_BORDERS: &str = "stream function, along borders";

fn on_piece(
    task: &Task<'_>,
    (aim, fronts): (Aim, &[StartedFront]),
    piece: &ConnectedPiece,
    surface: &MeshSurface,
    earlier: Option<&Levelled>,
) -> Result<Passes, PlanError> {
    let wanted = match aim {
        Aim::Fitted(direction, ..) | Aim::Shortest(Some((direction, _)), _) => {
            feed::on_mesh(task.part, task.cutter, direction, piece, surface).map_err(refused)?
        }
        Aim::Shortest(None, _) | Aim::Front(_) => Vec::new(),
    };
    // Notes and field, to which passes come later.
    let mut all = Passes::default();
    let stands_on_it = |levelled: &&Levelled| match &levelled.function {
        LevelFunction::Mesh(values) => values.len() == surface.mesh.points().len(),
        LevelFunction::Chart(_) => true,
    };
    let functions = match (aim, earlier.filter(stands_on_it)) {
        // A fitted function is solved again, with its notes: that takes little.
        (Aim::Fitted(direction, weight, _), _) => {
            let (lines, matters) = feed_lines(task, direction, piece, surface, &wanted, &mut all)?;
            let values = along_lines(task, (&lines, &matters), weight, surface)?;
            let function = LevelFunction::Mesh(values.into());
            vec![Levelled { function, planned_as: FITTED.into(), told: None }]
        }
        (Aim::Shortest(None, objective), Some(levelled)) => {
            let mut functions = vec![levelled.clone()];
            if let LevelFunction::Mesh(values) = &levelled.function
                && task.settings.earlier.is_some_and(|earlier| earlier.anew)
            {
                let found = gone_on(surface, task, values, objective)?;
                let levelled = |values: Vec<f64>| Levelled {
                    function: LevelFunction::Mesh(values.into()),
                    ..levelled.clone()
                };
                functions.extend(found.map(levelled));
            }
            functions
        }
        (_, Some(levelled)) => vec![levelled.clone()],
        (Aim::Front(_), None) => best_on_piece(task, fronts, piece),
        (Aim::Shortest(toward, objective), None) => {
            let lines = toward.map(|(direction, dearer)| {
                let (lines, matters) = feed_lines(task, direction, piece, surface, &wanted, &mut all)?;
                let pull = |(line, matters): (&Line, &f64)| (line.direction, dearer * matters);
                Ok::<_, PlanError>(lines.iter().zip(&matters).map(pull).collect::<Vec<_>>())
            });
            let lines = lines.transpose()?;
            let quickest = toward.is_none() && objective == Objective::Time;
            let around = quickest.then(|| along_borders(task, piece, surface)).flatten();
            let coarser = surface.coarser(piece, task.cutter);
            let search = |further, objective| {
                shortest_streams(surface, coarser.as_ref(), task, lines.as_deref(), further, objective)
            };
            let mut found = search(around.clone(), objective)?;
            if quickest {
                // What the least length promises may still take less time.
                found.extend(search(None, Objective::Length)?);
            }
            let levelled = |found: Packed| {
                let length = found.cost - found.turning + found.ends;
                let told = toward.is_none().then(|| (objective.told().to_owned(), length));
                let function = LevelFunction::Mesh(found.coefficients.into());
                Levelled { function, planned_as: SEARCHED.into(), told }
            };
            let along_borders = around.map(|values| {
                let function = LevelFunction::Mesh(surface.continued(values).into());
                Levelled { function, planned_as: ALONG_BORDERS.into(), told: None }
            });
            // Where a search leads away from them, its levels may still take more time than promised.
            found.into_iter().map(levelled).chain(along_borders).collect()
        }
    };
    let mut best: Option<(f64, Passes)> = None;
    let several = functions.len() > 1;
    for levelled in functions {
        let passes = along_function(task, aim, piece, surface, &wanted, levelled)?;
        let worth = match aim {
            Aim::Shortest(_, objective) if several => objective.worth(task, &passes)?,
            Aim::Front(_) => Objective::Length.worth(task, &passes)?,
            _ => 0.0,
        };
        if best.as_ref().is_none_or(|(least, _)| worth < *least) {
            best = Some((worth, passes));
        }
    }
    let Some((_, best)) = best else {
        return Err(not_applicable("no stream function of least length was found"));
    };
    all.append(best);
    Ok(all)
}

/// A function whose levels run along the borders of a piece with a hole, around which they close; `None`
/// without a hole.
fn along_borders(task: &Task<'_>, piece: &ConnectedPiece, surface: &MeshSurface) -> Option<Vec<f64>> {
    if piece.mesh.loops().len() < 2 {
        return None;
    }
    let direction = FeedDirection::Border(Sense::Along);
    let wanted = feed::on_mesh(task.part, task.cutter, &direction, piece, surface).ok()?;
    let mut unused = Passes::default();
    let (lines, matters) = feed_lines(task, &direction, piece, surface, &wanted, &mut unused).ok()?;
    along_lines(task, (&lines, &matters), DIRECTION_WEIGHT, surface).ok()
}

/// Passes along the lines of a function.
fn along_function(
    task: &Task<'_>,
    aim: Aim,
    piece: &ConnectedPiece,
    surface: &MeshSurface,
    wanted: &[Wanted],
    levelled: Levelled,
) -> Result<Passes, PlanError> {
    let Task { part, cutter, ref settings, monitor, .. } = *task;
    let (values, front) = match &levelled.function {
        LevelFunction::Mesh(values) => (values.clone(), None),
        LevelFunction::Chart(front) => {
            let arrival = |p: &Point3| front.value_and_gradient(p.x, p.y)[0];
            let values = surface.continued(surface.mesh.points().iter().map(arrival).collect());
            (values.into(), Some(&**front))
        }
    };
    let values = &*values;
    let lines = match aim {
        Aim::Fitted(_, _, lines) => lines,
        Aim::Shortest(..) | Aim::Front(_) => Lines::Levels,
    };
    let direction = match aim {
        Aim::Fitted(direction, ..) | Aim::Shortest(Some((direction, _)), _) => Some(direction),
        Aim::Shortest(None, _) | Aim::Front(_) => None,
    };
    let of_vertex = |wanted: &Wanted| asked::everywhere(direction?, wanted);
    let parts = if direction.is_some() { PARTS_COMPARED } else { 1 };
    let asked: Vec<Option<Vector3>> = wanted.iter().map(of_vertex).collect();
    let on = OnTriangles::new(&surface.mesh, values, &asked, lines, settings.sampling)?;
    let own_values = values.iter().zip(&surface.origin).enumerate();
    let own_values = own_values.filter(|&(v, (_, &origin))| origin as usize == v).map(|(_, (psi, _))| *psi);
    let range = own_values.fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], x| [lo.min(x), hi.max(x)]);
    let drop = DropCutter::watched(part, cutter, monitor)?;
    let guide = MeshGuide { part, surface, on, front, parts, cutter, drop, settings, monitor };
    let places = guide.on.places(surface.own_triangles, |p| guide.allowed_at(p));
    let mut notes = Vec::new();
    let placed = place_levels(&places, range, lines.steps(), &mut notes);
    let mut passes = along_and_between(&guide, &placed, range, settings.sampling, monitor)?;
    passes.notes.splice(0..0, notes);
    let along = edges::serve(&guide, &piece.sharp, &mut passes)?;
    if along > 0 {
        let plural = if along == 1 { "pass runs" } else { "passes run" };
        passes
            .notes
            .push(format!("{along} short {plural} along sharp edges that the others do not reach over"));
    }
    let rows = direction.map(|direction| asked::on_mesh(direction, part, &piece.mesh, settings.sampling));
    passes.obedience = obedience::measure(&passes.contacts, &rows.unwrap_or_default());
    planned_field::set_mesh_levels(&mut passes.field, &guide.on.levels, range, surface.own_triangles);
    if matches!(aim, Aim::Shortest(None, _)) {
        let lines = guide.on.level_lines();
        planned_field::set_mesh_feed(&mut passes.field, part, cutter, &lines, surface);
    }
    levelled.put_with(&mut passes);
    if matches!(aim, Aim::Shortest(None, Objective::Time)) {
        return spirals::where_quicker(task, passes);
    }
    Ok(passes)
}

/// ψ at the vertices whose levels follow feed directions.
fn along_lines(
    task: &Task<'_>,
    (lines, matters): (&[Line], &[f64]),
    direction_weight: f64,
    surface: &MeshSurface,
) -> Result<Vec<f64>, PlanError> {
    let Task { cutter, ref settings, .. } = *task;
    let mesh = &surface.mesh;
    // What was measured of an earlier plan moves levels, not the function.
    let width =
        |v: usize, b: &Vector3| width_at(cutter, &mesh.normals()[v], b, &surface.bends[v], settings.step).0;
    let own = |v: usize| surface.origin[v] as usize;
    let across = |v: usize| mesh.normals()[v].cross(&lines[v].direction);
    let density: Vec<f64> = (0..lines.len()).map(|v| 1.0 / width(own(v), &across(own(v)))).collect();
    let matters = |v: usize| matters[own(v)];
    let stream = along_directions(mesh, lines, &density, matters, direction_weight, &Held::default())?;
    Ok(stream.values)
}

/// Strip width across the feed, and whether it had to be limited.
pub(crate) fn width_at(cutter: &Cutter, n: &Vector3, b: &Vector3, bend: &Bend, step: Step) -> (f64, bool) {
    match step {
        Step::Stepover(width) => (width, false),
        Step::Scallop(h) => strip_width_at(cutter, n, b, &bends_across(n, b, bend), h),
    }
}

/// Wider than any path's strip across the feed, as [`width_at`].
pub(crate) fn widest_at(cutter: &Cutter, n: &Vector3, b: &Vector3, bend: &Bend, h: f64) -> (f64, bool) {
    widest_strip_at(cutter, n, b, &bends_across(n, b, bend), h)
}

/// How a surface bends at a place with the unit normal `n`, `b` across the feed.
pub(crate) fn bends_across(n: &Vector3, b: &Vector3, bend: &Bend) -> FeedCurvature {
    FeedCurvature::of(&b.cross(n), b, |d| bend.along(d))
}

/// The distance of passes on level ground that a mesh is made ready for, mm: a flat end may take more where
/// that goes on.
pub(crate) fn level_interval(cutter: &Cutter, h: f64) -> f64 {
    let strip = strip_width_at(cutter, &Vector3::z(), &Vector3::x(), &FeedCurvature::default(), h).0;
    strip.min(strip_width(0.0, 0.0, h, cutter.radius()).0)
}

/// The smooth, oriented field of feed directions, and how much they matter at each vertex (0 to 1, or to the
/// weight of samples).
fn feed_lines(
    task: &Task<'_>,
    direction: &FeedDirection,
    piece: &ConnectedPiece,
    surface: &MeshSurface,
    wanted: &[Wanted],
    passes: &mut Passes,
) -> Result<(Vec<Line>, Vec<f64>), PlanError> {
    let Task { part, cutter, .. } = *task;
    let mut wanted = wanted.to_vec();
    let matters = wanted.iter().map(|w| w.map_or(0.0, |(_, matters)| matters)).collect();
    // Beyond the border the field goes on as it comes.
    for v in 0..wanted.len() {
        if surface.origin[v] as usize != v {
            wanted[v] = None;
        }
    }
    if wanted.iter().all(Option::is_none) {
        return Err(feed::nowhere(direction, piece.mesh.points().iter().copied()));
    }
    let lines = smooth_directions(&surface.mesh, &wanted, cutter)?;
    planned_field::set_mesh_feed(&mut passes.field, part, cutter, &lines, surface);
    passes.notes.extend(planned_field::singular_note(&passes.field));
    Ok((lines, matters))
}
