//! What passes were planned by: feed directions, the function ψ whose levels they are, its singular points,
//! and how far passes lie apart. For pictures and figures; nothing is planned by it.
//!
//! Enters: the field of each chart or piece, and the contacts of the passes. Leaves: plan-view samples, mm.

use crate::vocabulary::Contact;
use std::collections::BTreeMap;

use super::spacing::level_tangent;
use crate::surface::chart::Chart;
use crate::surface::mesh_surface::MeshSurface;
use cutter::Cutter;
use field::mesh::{FieldMesh, Line, MeshLevels, SingularPoint, merge_singular_points, singular_points};
use field::{
    FeedSample, LevelCurve, LevelLine, LevelTracer, PassPoint, PlannedField, ScalarField, grid_turns,
    surface_gradient_length,
};
use geometry::{CurveSegment, Point2, Point3, SegmentGrid, Vector3};
use part::Part;

/// About as many directions are handed out over a part.
const DIRECTIONS: f64 = 900.0;

/// As many levels of ψ are handed out of each chart or piece.
const LEVELS: usize = 32;

/// Cells a side on which levels are found.
const LEVEL_CELLS: usize = 120;

/// Points of a level line are this share of the part's diagonal apart.
const LEVEL_STEP: f64 = 0.01;

/// Places a side of a chart at which the turning of levels is looked at.
const TURN_PLACES: usize = 96;

/// Singular points nearer than this many radii of the cutter count as one.
const MERGE_OVER_RADIUS: f64 = 1.0;

/// Where directions matter less than this all around a place, it is no singular point: they are noise.
pub(crate) const NO_MATTER: f64 = 1e-3;

/// Most singular points that a note names.
const MOST_NAMED: usize = 4;

/// A pass farther away than this many allowed intervals is no neighbour.
const FARTHEST: f64 = 2.5;

/// Passes nearer than this, mm, have met.
const MET: f64 = 1e-6;

/// The field of a function on a chart: its levels, and the directions along them.
pub(crate) fn of_levels(part: &Part, cutter: &Cutter, chart: &Chart, field: &ScalarField) -> PlannedField {
    let tangent = |[u, v]: [f64; 2]| {
        let p = chart.at(u, v)?;
        Some((level_tangent(&p, field, [u, v])?, 1.0))
    };
    let mut planned =
        PlannedField { level_lines: level_lines(part, chart, field), ..PlannedField::default() };
    set_directions(&mut planned, part, chart, tangent);
    let places: Vec<[f64; 2]> = chart.grid(TURN_PLACES).collect();
    let lines: Vec<_> = places.iter().map(|&uv| tangent(uv)).collect();
    set_singular_points(&mut planned, chart, cutter, &places, &lines, TURN_PLACES);
    planned
}

/// Samples the feed, a unit tangent at a place of a chart.
pub(crate) fn set_directions(
    planned: &mut PlannedField,
    part: &Part,
    chart: &Chart,
    feed: impl Fn([f64; 2]) -> Option<(Vector3, f64)>,
) {
    let cell = cell(part);
    let counts = [0, 1].map(|c| {
        let middle = chart.domain.map(|[lo, hi]| 0.5 * (lo + hi));
        let jet = chart.jet(middle[0], middle[1]);
        let range = chart.domain[c][1] - chart.domain[c][0];
        let length = range * if c == 0 { jet.du } else { jet.dv }.norm();
        (length / cell).round().clamp(2.0, DIRECTIONS) as usize
    });
    let at = |c: usize, k: usize| {
        let [lo, hi] = chart.domain[c];
        lo + (hi - lo) * (k as f64 + 0.5) / counts[c] as f64
    };
    let sample = |k: usize| {
        let uv = [at(0, k % counts[0]), at(1, k / counts[0])];
        sample(&chart.jet(uv[0], uv[1]).p, &feed(uv)?.0)
    };
    planned.directions = (0..counts[0] * counts[1]).filter_map(sample).collect();
}

/// Finds the singular points of lines on an even grid of `n` × `n` places of a chart.
pub(crate) fn set_singular_points(
    planned: &mut PlannedField,
    chart: &Chart,
    cutter: &Cutter,
    places: &[[f64; 2]],
    lines: &[Option<(Vector3, f64)>],
    n: usize,
) {
    let in_frame = |(&[u, v], line): (&[f64; 2], &Option<(Vector3, f64)>)| {
        let (p, (t, _)) = (chart.at(u, v)?, (*line)?);
        let e1 = p.jet.du.try_normalize(1e-300)?;
        Some([t.dot(&e1), t.dot(&p.normal.cross(&e1))])
    };
    let framed: Vec<_> = places.iter().zip(lines).map(in_frame).collect();
    let turns = grid_turns(&framed, n).into_iter().filter_map(|(corners, half_turns)| {
        let matters = corners.iter().filter_map(|&k| lines[k]).map(|(_, matters)| matters);
        let sum: Vector3 = corners.iter().map(|&k| chart.jet(places[k][0], places[k][1]).p.coords).sum();
        let point = SingularPoint { position: Point3::from(sum / corners.len() as f64), half_turns };
        (matters.fold(0.0, f64::max) >= NO_MATTER).then_some(point)
    });
    planned.singular_points =
        merge_singular_points(&turns.collect::<Vec<_>>(), MERGE_OVER_RADIUS * cutter.radius());
}

/// Takes the levels of a function on a mesh, as far as its curves run in triangles before `own`.
pub(crate) fn set_mesh_levels(
    planned: &mut PlannedField,
    levels: &MeshLevels<'_>,
    range: [f64; 2],
    own: usize,
) {
    let of_level = |psi: f64| levels.curves(psi).into_iter().map(move |curve| (psi, curve));
    for (psi, curve) in level_values(range).flat_map(of_level) {
        let empty = || LevelLine { psi, ..LevelLine::default() };
        let (mut line, mut ended) = (empty(), Vec::new());
        let closing = curve.closed.then(|| curve.points[0]);
        for point in curve.points.iter().copied().chain(closing) {
            line.points.push(point.position.xy());
            line.densities.push(levels.gradient_at(&point).norm());
            // A point names the triangle after it.
            if point.triangle as usize >= own {
                ended.push(std::mem::replace(&mut line, empty()));
            }
        }
        ended.push(line);
        planned.level_lines.extend(ended.into_iter().filter(|line| line.points.len() > 1));
    }
}

/// Takes the levels of a function on a plane mesh, and directions at its vertices, at some of them evenly.
pub(crate) fn set_plane(
    planned: &mut PlannedField,
    mesh: &FieldMesh,
    levels: &MeshLevels<'_>,
    lines: &[Line],
) {
    set_mesh_levels(planned, levels, levels.range(), mesh.triangles().len());
    let vertices = mesh.points().iter().zip(lines).map(|(p, line)| (*p, line.direction));
    let (low, high) =
        mesh.points().iter().fold(
            (Point3::from([f64::INFINITY; 3]), Point3::from([f64::NEG_INFINITY; 3])),
            |(low, high), p| (low.inf(p), high.sup(p)),
        );
    planned.directions = evenly(vertices, cell_of(high.x - low.x, high.y - low.y));
}

/// Takes directions at the vertices of a mesh, at some of them evenly over the part, and their singular
/// points.
pub(crate) fn set_mesh_feed(
    planned: &mut PlannedField,
    part: &Part,
    cutter: &Cutter,
    lines: &[Line],
    surface: &MeshSurface,
) {
    let mesh = &surface.mesh;
    planned.singular_points = singular_points(mesh, lines, MERGE_OVER_RADIUS * cutter.radius());
    let own = (0..lines.len()).filter(|&v| surface.origin[v] as usize == v);
    let vertices = own.map(|v| (mesh.points()[v], lines[v].direction));
    planned.directions = evenly(vertices, cell(part));
}

/// The direction nearest to the middle of each cell of a size, mm.
fn evenly(vertices: impl Iterator<Item = (Point3, Vector3)>, cell: f64) -> Vec<FeedSample> {
    let mut nearest: BTreeMap<[i64; 2], (f64, FeedSample)> = BTreeMap::new();
    for (p, t) in vertices {
        let key = [p.x, p.y].map(|c| (c / cell).floor() as i64);
        let middle = Point2::new(key[0] as f64 + 0.5, key[1] as f64 + 0.5) * cell;
        let distance = (p.xy() - middle).norm();
        let nearer = nearest.get(&key).is_none_or(|(other, _)| distance < *other);
        if let Some(sample) = sample(&p, &t).filter(|_| nearer) {
            nearest.insert(key, (distance, sample));
        }
    }
    nearest.into_values().map(|(_, sample)| sample).collect()
}

/// The sides of passes in the plan view.
pub(crate) fn in_plan(passes: &[Vec<Contact>]) -> SegmentGrid {
    let sides = |(curve, pass): (usize, &Vec<Contact>)| -> Vec<CurveSegment> {
        let ends = pass.windows(2).map(|w| [w[0].at.xy(), w[1].at.xy()]);
        ends.zip(0..).map(|(ends, index)| CurveSegment { ends, curve: curve as u32, index }).collect()
    };
    SegmentGrid::new(passes.iter().enumerate().flat_map(sides).collect())
}

/// Takes the passes and measures how far they lie apart.
pub(crate) fn measure(planned: &mut PlannedField, passes: &[Vec<Contact>]) {
    let grid = in_plan(passes);
    planned.passes = work::parallel::map(passes.len(), |k| {
        let point = |(i, contact): (usize, &Contact)| {
            let sides = [1.0, -1.0].map(|side| neighbour(&grid, passes, [k, i], side));
            let interval = sides.into_iter().flatten().max_by(f64::total_cmp);
            PassPoint { at: contact.at, allowed: contact.allowed, interval, inside: contact.inside }
        };
        passes[k].iter().enumerate().map(point).collect()
    });
}

/// What to tell of the singular points, if there are any.
pub(crate) fn singular_note(planned: &PlannedField) -> Option<String> {
    let points = &planned.singular_points;
    let name = |s: &SingularPoint| {
        format!("({:.1}, {:.1}) index {:+}", s.position.x, s.position.y, 0.5 * f64::from(s.half_turns))
    };
    let named: Vec<String> = points.iter().take(MOST_NAMED).map(name).collect();
    let more = if points.len() > MOST_NAMED { ", …" } else { "" };
    // Around those no orientation of the field comes back as it was.
    let odd = points.iter().any(|s| s.half_turns % 2 != 0);
    let cut = if odd { ", and turn back along a cut between those of half index" } else { "" };
    let (count, plural) = (points.len(), if points.len() == 1 { "" } else { "s" });
    (count > 0).then(|| {
        let named = named.join(", ");
        format!("the feed directions have {count} singular point{plural}: {named}{more}; passes bend around them{cut}")
    })
}

/// Distance of samples of directions, mm.
fn cell(part: &Part) -> f64 {
    let size = part.bounds().size();
    cell_of(size.x, size.y)
}

/// The same over a rectangle of some sides, mm.
fn cell_of(x: f64, y: f64) -> f64 {
    (x * y / DIRECTIONS).sqrt().max(x.max(y) / DIRECTIONS).max(f64::MIN_POSITIVE)
}

fn sample(at: &Point3, feed: &Vector3) -> Option<FeedSample> {
    feed.xy().try_normalize(1e-9).map(|direction| FeedSample { at: at.xy(), direction })
}

fn level_values([lo, hi]: [f64; 2]) -> impl Iterator<Item = f64> {
    (0..LEVELS).map(move |k| lo + (hi - lo) * (k as f64 + 0.5) / LEVELS as f64)
}

fn level_lines(part: &Part, chart: &Chart, field: &ScalarField) -> Vec<LevelLine> {
    let metric = |u: f64, v: f64| chart.jet(u, v).first_form();
    let step = LEVEL_STEP * part.bounds().size().norm();
    let tracer = LevelTracer::new(field, &metric, chart.domain, [0.0; 2], LEVEL_CELLS, step);
    let line = |psi: f64, curve: LevelCurve| {
        let closing = curve.closed.then(|| curve.points[0]);
        let point = |[u, v]: [f64; 2]| {
            let (jet, [_, psi_u, psi_v]) = (chart.jet(u, v), field.value_and_gradient(u, v));
            (jet.p.xy(), surface_gradient_length(jet.first_form(), psi_u, psi_v))
        };
        let (points, densities) = curve.points.iter().copied().chain(closing).map(point).unzip();
        LevelLine { psi, points, densities }
    };
    let of_level = |psi: f64| tracer.curves(psi).into_iter().map(move |curve| line(psi, curve));
    level_values(tracer.range()).flat_map(of_level).collect()
}

/// How far beyond the ends of a side, as a share of it, a neighbour still meets it.
const END_ROUNDING: f64 = 1e-6;

/// Distance, mm, from point `[pass, index]` to the next pass straight across the feed, to one side; `None`
/// where none is near.
fn neighbour(
    grid: &SegmentGrid,
    passes: &[Vec<Contact>],
    [pass, index]: [usize; 2],
    side: f64,
) -> Option<f64> {
    let from = &passes[pass][index];
    let (p, ray) = (from.at.xy(), from.across.xy() * (side * FARTHEST * from.allowed));
    let mut nearest: Option<(f64, f64)> = None;
    grid.near(&[p, p + ray], |k| {
        let segment = grid.segments()[k as usize];
        let (curve, first) = (segment.curve as usize, segment.index as usize);
        let [a, b] = segment.ends;
        let (d, e) = (a - p, b - a);
        let determinant = ray.perp(&e);
        if determinant == 0.0 || (curve == pass && (first == index || first + 1 == index)) {
            return;
        }
        let (s, t) = (d.perp(&e) / determinant, d.perp(&ray) / determinant);
        // Passes that end at the border end beside each other but for rounding.
        if !(0.0..=1.0).contains(&s) || !(-END_ROUNDING..=1.0 + END_ROUNDING).contains(&t) {
            return;
        }
        let (a, b) = (passes[curve][first].at, passes[curve][first + 1].at);
        let distance = (a + (b - a) * t - from.at).norm();
        if distance > MET && nearest.is_none_or(|(other, _)| s < other) {
            nearest = Some((s, distance));
        }
    });
    nearest.map(|(_, distance)| distance)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Lines along x over [0, 10], points 0.4 mm apart.
    fn line(y: f64) -> Vec<Contact> {
        let at = |k: i32| Point3::new(0.4 * f64::from(k), y, 0.5 * y);
        // The surface rises by half along y.
        let across = Vector3::new(0.0, 1.0, 0.5).normalize();
        (0..=25)
            .map(|k| Contact {
                at: at(k),
                across,
                normal: Vector3::x().cross(&across),
                allowed: 0.5,
                inside: true,
                parameters: None,
                asked: None,
            })
            .collect()
    }

    #[test]
    fn the_farther_neighbour_counts_on_the_surface() {
        let slant = 1.25f64.sqrt();
        let mut field = PlannedField::default();
        measure(&mut field, &[line(0.0), line(0.4), line(1.0), line(9.0)]);
        for (pass, interval) in
            [(0, Some(0.4 * slant)), (1, Some(0.6 * slant)), (2, Some(0.6 * slant)), (3, None)]
        {
            for point in &field.passes[pass] {
                assert!(point.interval.zip(interval).is_none_or(|(a, b)| (a - b).abs() < 1e-12));
                assert_eq!(point.interval.is_some(), interval.is_some());
            }
        }
        assert!((field.passes[1][3].ratio().unwrap() - 1.2 * slant).abs() < 1e-12);
    }

    #[test]
    fn a_short_pass_is_a_neighbour_where_it_runs() {
        let mut field = PlannedField::default();
        measure(&mut field, &[line(0.0), line(0.4)[5..15].to_vec(), line(0.8)]);
        let slant = 1.25f64.sqrt();
        let intervals: Vec<f64> = field.passes[0].iter().map(|p| p.interval.unwrap() / slant).collect();
        for (k, interval) in intervals.iter().enumerate() {
            let expected = if (5..15).contains(&k) { 0.4 } else { 0.8 };
            assert!((interval - expected).abs() < 1e-12, "{k}: {interval}");
        }
    }

    #[test]
    fn a_closed_curve_is_its_own_neighbour() {
        let (radius, n) = (1.0f64, 60);
        let at = |k: usize| {
            let (sin, cos) = (std::f64::consts::TAU * k as f64 / n as f64).sin_cos();
            let across = Vector3::new(cos, sin, 0.0);
            Contact {
                at: Point3::origin() + across * radius,
                across,
                normal: Vector3::z(),
                allowed: 1.0,
                inside: true,
                parameters: None,
                asked: None,
            }
        };
        let mut field = PlannedField::default();
        measure(&mut field, &[(0..=n).map(at).collect()]);
        let point = field.passes[0][7];
        assert!((point.interval.unwrap() - 2.0 * radius).abs() < 0.01, "{point:?}");
    }
}
