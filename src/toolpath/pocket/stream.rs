//! Passes of a pocket along the levels of a stream function that follows feed directions: open ones from wall
//! to wall, closed ones around islands.
//!
//! Enters: the piece where the cutter's centre may be, directions, the stepover. Leaves: runs, and what they
//! were planned by. Directions stand on triangles that fill the piece, and ψ is fitted to them as on the mesh
//! of a surface ([`field::mesh::solve_stream`]). Where passes shall run along the walls, ψ has one value
//! along each of them, which is found for islands, so that no pass ends at a wall: with the direction of the
//! walls themselves that is the flow that nothing forces. Walls are gone around last. The floor of the
//! design's frame is level, so that z plays no part; mm.

use super::lines::{Line, along_walls, is_clear};
use super::nest::{NestError, planar_mesh};
use super::route::{Entry, Run, begun_near};
use crate::levels::halving::{Allowed, LevelSource, Track, along_and_between};
use crate::levels::on_triangles::{OnTriangles, along_directions, refused, smooth_directions};
use crate::levels::spacing::{AllowedStep, place_levels};
use crate::levels::{obedience, planned_field};
use crate::surface::asked::{self, Ground};
use crate::surface::feed;
use crate::surface::mesh_surface::not_applicable;
use crate::vocabulary::{Contact, FeedDirection, Lines, Passes, PlanError};
use cutter::Cutter;
use field::mesh::{FieldMesh, Held, Line as FeedLine, MeshCurve, MeshPoint, Sense, singular_points};
use geometry::{Piece, Point2, Point3, SegmentGrid, Vector2, Vector3};
use work::monitor::{Cancelled, Monitor};

/// Side of the triangles over the stepover. On longer ones levels stray from streamlines by more than a usual
/// chord tolerance; time grows with the inverse square.
const EDGE_OVER_STEP: f64 = 0.2;

/// Points of passes over the stepover.
const SAMPLING: f64 = 0.1;

/// A pass serves what is so near to it, over the stepover.
const SERVED: f64 = 0.5;

/// Singular points nearer than this many radii of the cutter count as one.
const MERGE_OVER_RADIUS: f64 = 1.0;

/// A function that rises by less than this over what its directions ask for, on average, follows none of
/// them: its levels are noise.
const LEAST_FOLLOWED: f64 = 0.02;

/// Streamlines of a pocket.
#[derive(Debug, Clone, PartialEq)]
pub struct Vectors {
    /// The feed directions.
    pub direction: FeedDirection,
    /// How much following them counts over the distances of passes.
    pub direction_weight: f64,
    /// Whether walls are streamlines, so that passes run along them and none ends there.
    pub along_walls: bool,
    /// Which lines of the function passes are.
    pub lines: Lines,
}

/// Passes over one piece.
///
/// # Errors
/// Directions that are nowhere in it, a piece that needs too many triangles, passes without end.
pub fn runs(
    piece: &Piece,
    vectors: &Vectors,
    cutter: &Cutter,
    step: f64,
    planned: &mut Passes,
    monitor: &dyn Monitor,
) -> Result<Vec<Run>, PlanError> {
    let fitted = Fitted::new(piece, vectors, cutter, step, monitor)?;
    let (source, Fitted { mesh, lines, .. }) = (fitted.source(step, vectors.lines)?, &fitted);
    let range = source.on.levels.range();
    let places = source.on.places(mesh.triangles().len(), |p| Some((source.allowed_at(p), false)));
    let (rise, area) =
        (places.iter().map(|place| place.length), (0..mesh.triangles().len()).map(|t| mesh.area(t)));
    let followed = step * rise.sum::<f64>() / area.sum::<f64>();
    if vectors.along_walls && followed < LEAST_FOLLOWED {
        if vectors.direction != FeedDirection::Border(Sense::Along) {
            return Err(not_applicable(
                "the directions lead from wall to wall, and no function with one value along each wall follows them: write \
                 `along_walls = false`, or take directions that go around",
            ));
        }
        planned.notes.push(
            "both walls of a slot lead the same way, and no function with one value along each wall follows them: passes \
             end at walls there, as with `along_walls = false`"
                .into(),
        );
        let ending = Vectors { along_walls: false, ..vectors.clone() };
        return runs(piece, &ending, cutter, step, planned, monitor);
    }
    // Traced lines follow the narrowest strip. Where the gradient of ψ vanishes no strip is narrow enough: a
    // line beside such a place serves what is within half an interval, and further passes serve the rest.
    let level_at = match vectors.lines {
        Lines::RungeKutta => singular_points(mesh, &source.on.level_lines(), SERVED * step),
        Lines::Levels => Vec::new(),
    };
    let is_served = |t: usize| {
        let [a, b, c] = mesh.corners(t);
        let middle = Point3::from((a.coords + b.coords + c.coords) / 3.0);
        level_at.iter().any(|point| (point.position - middle).norm() < SERVED * step)
    };
    let places: Vec<AllowedStep> =
        places.into_iter().enumerate().filter(|(t, _)| !is_served(*t)).map(|(_, place)| place).collect();
    let placed = place_levels(&places, range, vectors.lines.steps(), &mut planned.notes);
    let mut passes = along_and_between(&source, &placed, range, SAMPLING * step, monitor)?;
    // Parameters of a pocket are x and y.
    let borders = || asked::borders_of(mesh);
    let ground = Ground {
        borders: &borders,
        on_patches: None,
        covers: &|p| piece.contains(p),
        spacing: SAMPLING * step,
    };
    passes.obedience = obedience::measure(&passes.contacts, &ground.rows(&vectors.direction));
    planned_field::set_plane(&mut passes.field, mesh, &source.on.levels, lines);
    passes.field.singular_points = singular_points(mesh, lines, MERGE_OVER_RADIUS * cutter.radius());
    passes.notes.extend(planned_field::singular_note(&passes.field));
    let runs = joined(&passes.passes, piece, step);
    planned.append(passes);
    Ok(runs)
}

/// A stream function on triangles.
pub(super) struct Fitted {
    pub mesh: FieldMesh,
    /// The unit tangents asked for at the vertices, where one is at every place.
    asked: Vec<Option<Vector3>>,
    /// The directions at the vertices, smooth and oriented alike.
    lines: Vec<FeedLine>,
    /// Its values at the vertices.
    psi: Vec<f64>,
}

impl Fitted {
    pub fn new(
        piece: &Piece,
        vectors: &Vectors,
        cutter: &Cutter,
        step: f64,
        monitor: &dyn Monitor,
    ) -> Result<Self, PlanError> {
        let planar = planar_mesh(piece, step, EDGE_OVER_STEP * step, monitor).map_err(|e| match e {
            NestError::Cancelled(cancelled) => PlanError::Cancelled(cancelled),
            e => not_applicable(&e.to_string()),
        })?;
        let points: Vec<[f64; 2]> = planar.points().iter().map(|p| [p.x, p.y]).collect();
        let mesh = FieldMesh::planar(&points, planar.triangles().to_vec()).map_err(refused)?;
        let wanted = feed::on_plane(&mesh, &vectors.direction, cutter).map_err(refused)?;
        if wanted.iter().all(Option::is_none) {
            return Err(feed::nowhere(&vectors.direction, mesh.points().iter().copied()));
        }
        let lines = smooth_directions(&mesh, &wanted, cutter)?;
        let density = vec![1.0 / step; lines.len()];
        let matters = |v: usize| wanted[v].map_or(0.0, |(_, matters)| matters);
        let held = Held { fixed: &[], tied: if vectors.along_walls { mesh.loops() } else { &[] } };
        let weight = vectors.direction_weight;
        let psi = along_directions(&mesh, &lines, &density, matters, weight, &held)?.values;
        let asked = wanted.iter().map(|wanted| asked::everywhere(&vectors.direction, wanted)).collect();
        Ok(Self { mesh, asked, lines, psi })
    }

    /// Its lines, which may lie `step` apart, mm.
    pub fn source(&self, step: f64, lines: Lines) -> Result<Source<'_>, PlanError> {
        let on = OnTriangles::new(&self.mesh, &self.psi, &self.asked, lines, SAMPLING * step)?;
        Ok(Source { on, step })
    }
}

/// Runs along the passes: open ones one after the other, closed ones from the middle outwards, then around
/// each wall.
fn joined(passes: &[Vec<Point3>], piece: &Piece, step: f64) -> Vec<Run> {
    let walls = SegmentGrid::of_curves(piece.curves());
    let plane = |pass: &Vec<Point3>| pass.iter().map(|p| p.xy()).collect::<Vec<Point2>>();
    let (closed, open): (Vec<_>, Vec<_>) =
        passes.iter().map(plane).partition(|pass| pass.len() > 3 && pass.first() == pass.last());
    let mut closed: Vec<Vec<Point2>> = closed.into_iter().map(|pass| climbing(pass, &walls)).collect();
    let depth = |pass: &Vec<Point2>| pass.iter().map(|p| walls.distance(p)).sum::<f64>() / pass.len() as f64;
    closed.sort_by(|a, b| depth(b).total_cmp(&depth(a)));
    let mut runs: Vec<Run> = Vec::new();
    for curve in closed {
        around(&mut runs, &curve, piece, &walls, step);
    }
    let lines = open.into_iter().filter(|pass| pass.len() > 1).map(|points| Line { points, row: 0 });
    // Levels of a function lie side by side, and no row of them is one that others follow.
    along_walls(lines.collect(), runs, piece, step, |_, _| true)
}

/// A closed curve, its last point left out, with what lies farther from the walls, and is cut first, on its
/// left.
fn climbing(mut curve: Vec<Point2>, walls: &SegmentGrid) -> Vec<Point2> {
    curve.pop();
    let mut left = 0.0;
    for k in 0..curve.len() {
        let (a, b) = (curve[k], curve[(k + 1) % curve.len()]);
        let (middle, side) = (nalgebra::center(&a, &b), Vector2::new(a.y - b.y, b.x - a.x));
        left +=
            (b - a).norm() * (walls.distance(&(middle + side)) - walls.distance(&(middle - side))).signum();
    }
    if left < 0.0 {
        curve.reverse();
    }
    curve
}

/// Goes around a closed curve: on from the last run where that ends nearby, with nothing between, or else by
/// a run of its own.
fn around(runs: &mut Vec<Run>, curve: &[Point2], piece: &Piece, walls: &SegmentGrid, step: f64) {
    /// A way to the next curve is at most so many stepovers long.
    const LONGEST_LINK: f64 = 4.0;
    let end = runs.last().and_then(|run| run.points.last()).copied();
    let begun = begun_near(curve, &end.unwrap_or(curve[0]), 0.0);
    let is_near = |end: &Point2| is_clear(piece, walls, &[*end, begun[0]], LONGEST_LINK * step);
    let mut closed = begun.clone();
    closed.push(begun[0]);
    match runs.last_mut() {
        Some(run) if end.as_ref().is_some_and(is_near) => run.points.extend(closed),
        _ => runs.push(Run { entry: Entry::Ramp(closed.clone()), points: closed }),
    }
}

/// A place of a level curve.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spot {
    pub at: MeshPoint,
    allowed: Allowed,
}

/// The lines of ψ on the triangles.
pub(super) struct Source<'a> {
    pub on: OnTriangles<'a>,
    step: f64,
}

impl Source<'_> {
    fn allowed_at(&self, p: &MeshPoint) -> Allowed {
        Allowed { step: self.step * self.on.gradient(p).norm(), width: self.step }
    }

    fn spot(&self, triangle: u32, at: Vector2) -> Spot {
        let at = self.on.in_triangle(triangle, Point3::new(at.x, at.y, 0.0));
        Spot { at, allowed: self.allowed_at(&at) }
    }

    /// The curve at even distances, on a smooth curve through its points (Catmull and Rom 1974).
    fn track(&self, curve: &MeshCurve) -> Option<Track<Spot>> {
        let n = curve.points.len();
        let sides = if curve.closed { n } else { n.checked_sub(1)? };
        let at = |k: isize| {
            let k = if curve.closed { k.rem_euclid(n as isize) } else { k.clamp(0, n as isize - 1) };
            curve.points[k as usize].position.coords.xy()
        };
        let mut s = vec![0.0];
        for k in 0..sides {
            s.push(s[k] + (at(k as isize + 1) - at(k as isize)).norm());
        }
        let length = s[sides];
        if length <= 0.0 {
            return None;
        }
        let count =
            (length / (SAMPLING * self.step)).ceil().max(if curve.closed { 5.0 } else { 1.0 }) as usize;
        let points = (0..count + usize::from(!curve.closed)).map(|i| {
            let here = length * i as f64 / count as f64;
            let k = (s.partition_point(|x| *x <= here).max(1) - 1).min(sides - 1);
            let (p, q, side) = (at(k as isize), at(k as isize + 1), s[k + 1] - s[k]);
            let t = if side > 0.0 { (here - s[k]) / side } else { 0.0 };
            // Tangents by the lengths of both sides, which differ much from triangle to triangle.
            let tangent = |j: isize| {
                let (before, after) = (at(j) - at(j - 1), at(j + 1) - at(j));
                let whole = before.norm() + after.norm();
                if whole > 0.0 { (before + after) * (side / whole) } else { q - p }
            };
            let (m, l, d) = (tangent(k as isize), tangent(k as isize + 1), q - p);
            let place = p + (m + ((d * 3.0 - m * 2.0 - l) + (m + l - d * 2.0) * t) * t) * t;
            self.spot(curve.points[k].triangle, place)
        });
        Some(Track { points: points.collect(), closed: curve.closed })
    }
}

impl LevelSource for Source<'_> {
    type Place = Spot;

    fn curves(&self, level: f64) -> Vec<Track<Spot>> {
        self.on.curves(level).iter().filter_map(|curve| self.track(curve)).collect()
    }

    fn allowed(&self, spot: &Spot) -> Option<Allowed> {
        Some(spot.allowed)
    }

    fn contacts(&self, curve: &Track<Spot>, run: Option<[usize; 2]>) -> Vec<Contact> {
        let Some((spots, [first, end])) = curve.opened(run) else { return Vec::new() };
        let last = spots.len() - 1;
        let contact = |k: usize| {
            let before = if k == 0 && curve.closed { last - 1 } else { k.saturating_sub(1) };
            let after = if k == last && curve.closed { 1 } else { (k + 1).min(last) };
            let along = spots[after].at.position - spots[before].at.position;
            let (Spot { at, allowed }, normal) = (&spots[k], Vector3::z());
            Some(Contact {
                at: at.position,
                across: normal.cross(&along).try_normalize(1e-300)?,
                normal,
                allowed: allowed.width,
                inside: true,
                parameters: None,
                asked: self.on.asked_at(at, &normal),
            })
        };
        (first..=end).filter_map(contact).collect()
    }

    fn pass(
        &self,
        curve: &Track<Spot>,
        _: f64,
        run: Option<[usize; 2]>,
    ) -> Result<Vec<Vec<Point3>>, Cancelled> {
        let points: Vec<Point3> = curve.along(run).map(|spot| spot.at.position).collect();
        Ok(if points.len() > 1 { vec![points] } else { Vec::new() })
    }
}
