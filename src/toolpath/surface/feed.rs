//! Feed directions that a single place cannot tell: those that curves give, on charts and on meshes; and
//! refusals of directions that a part has nowhere.
//!
//! Curves say something beside them only. Elsewhere the field is the smoothest line field that they allow
//! ([`smooth_lines`]), on a mesh of the part or of the chart.
//!
//! At a corner of the border its bisector says in which sense the field turns. Along the mitre inside the
//! corner the bisector of what both sides want says it. Without them both senses are equally good, and the
//! orientation breaks.
//!
//! A blend is the mean of doubled angles, because a direction and its opposite are the same pass.

use std::borrow::Cow;
use std::sync::Arc;

use super::chart::Chart;
use super::mesh_surface::{ConnectedPiece, MeshSurface, not_applicable};
use crate::vocabulary::{Along, FeedDirection, PlanError};
use cutter::Cutter;
use field::mesh::{
    FieldMesh, Line, MeshFieldError, Wanted, blend, borders, fixed_angle, guides, slope, smooth_lines,
};
use field::{LineField, LineSample, SamplePlane};
use geometry::{Aabb, Point2, Point3, Vector3};
use part::Part;

/// Directions give way to their neighbours over this share of the cutter's radius. More bends passes
/// away from what was asked for, less lets the noise of fitted curvature turn them.
pub(crate) const SMOOTHING_OVER_RADIUS: f64 = 0.5;

/// A guide curve speaks for what lies within this share of the cutter's radius of it, and for the nearest
/// vertices.
const REACH_OVER_RADIUS: f64 = 0.5;

/// Nodes a side of the mesh on which curves spread their directions over a chart.
const NODES: usize = 97;

/// Inside a corner of the border lines pass through nothing, where less than this is left of them: nothing
/// tells in which sense they turn. Below it the bisector of what the border wants on both sides does.
const MITRE: f64 = 0.35;

/// How fast a place of the border loses its say with distance, as the exponent of the distance; and the share
/// of all says that must be left of their sum for it to count.
const SAY: i32 = 4;
const LEAST_SAY: f64 = 0.3;

/// Sampled directions that cover less than this share of a part leave most of it to what they are at their
/// border.
const LEAST_COVERED: f64 = 0.5;

/// Refuses directions that are given only outside of a part with bounds `b`, and leaves notes on those that
/// cover little of it. `domains` are the parameters of its patches.
pub(crate) fn check(
    direction: &FeedDirection,
    b: &Aabb,
    domains: &[[[f64; 2]; 2]],
) -> Result<Vec<String>, PlanError> {
    let rectangle = [[b.min.x, b.max.x], [b.min.y, b.max.y]];
    match direction {
        FeedDirection::Samples(samples) | FeedDirection::File { samples: Some(samples), .. } => {
            let (names, all) = match samples.plane() {
                SamplePlane::Plan => (["x", "y"], &[rectangle][..]),
                SamplePlane::Parameters => (["u", "v"], domains),
            };
            let what = format!("{} sampled directions", samples.len());
            let cure = "check their unit and origin, and whether they are x and y or u and v";
            if all.iter().all(|domain| samples.count_inside(*domain) == 0) {
                return Err(outside(&what, names, samples.bounds(), cure));
            }
            let covered = all.iter().map(|domain| share_covered(samples.bounds(), *domain));
            let most = covered.fold(0.0, f64::max);
            let ranges = ranges(names, samples.bounds());
            Ok(Vec::from_iter((most < LEAST_COVERED).then(|| {
                format!(
                    "the {what} ({ranges}) cover {:.2} % of the part; beyond them they go on as they are at their border: {cure}",
                    100.0 * most
                )
            })))
        }
        FeedDirection::Guides { curves, .. } => {
            let mut stretches = curves.iter().flat_map(|curve| curve.windows(2));
            if stretches.any(|ends| meets(rectangle, [ends[0], ends[1]])) {
                return Ok(Vec::new());
            }
            let mut all = Aabb::EMPTY;
            curves.iter().flatten().for_each(|p| all.grow(&Point3::new(p.x, p.y, 0.0)));
            let bounds = [[all.min.x, all.max.x], [all.min.y, all.max.y]];
            let what = format!("{} guide curves", curves.len());
            Err(outside(&what, ["x", "y"], bounds, "check their unit and origin"))
        }
        FeedDirection::File { name, samples: None } => {
            Err(not_applicable(&format!("its directions in {name} were not read")))
        }
        FeedDirection::Blend(parts) => {
            let notes = parts.iter().map(|(part_of, _)| check(part_of, b, domains));
            Ok(notes.collect::<Result<Vec<_>, PlanError>>()?.concat())
        }
        _ => Ok(Vec::new()),
    }
}

fn outside(what: &str, names: [&str; 2], bounds: [[f64; 2]; 2], cure: &str) -> PlanError {
    not_applicable(&format!("all {what} lie outside of it ({}); {cure}", ranges(names, bounds)))
}

fn ranges([name_a, name_b]: [&str; 2], [a, b]: [[f64; 2]; 2]) -> String {
    format!("{name_a} from {} to {}, {name_b} from {} to {}", a[0], a[1], b[0], b[1])
}

/// The share of a domain that bounds cover; where they have no width along a side, of the other one.
fn share_covered(bounds: [[f64; 2]; 2], domain: [[f64; 2]; 2]) -> f64 {
    let along = |c: usize| {
        let ([a, b], [lo, hi]) = (bounds[c], domain[c]);
        if a == b {
            1.0
        } else {
            ((b.min(hi) - a.max(lo)) / (hi - lo).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0)
        }
    };
    along(0) * along(1)
}

/// True where a segment has a point in common with a rectangle, borders included (Liang and Barsky 1984).
fn meets(rectangle: [[f64; 2]; 2], [a, b]: [Point2; 2]) -> bool {
    let (mut from, mut to) = (0.0f64, 1.0f64);
    for c in 0..2 {
        let (d, [lo, hi]) = (b[c] - a[c], rectangle[c]);
        if d == 0.0 {
            if a[c] < lo || a[c] > hi {
                return false;
            }
            continue;
        }
        let (s, t) = ((lo - a[c]) / d, (hi - a[c]) / d);
        (from, to) = (from.max(s.min(t)), to.min(s.max(t)));
    }
    from <= to
}

/// Why there is no feed anywhere among `places`, and what would help.
pub(crate) fn nowhere(direction: &FeedDirection, places: impl Iterator<Item = Point3>) -> PlanError {
    let mut around = Aabb::EMPTY;
    places.for_each(|p| around.grow(&p));
    let why = match direction {
        FeedDirection::Steepest | FeedDirection::Contour => {
            "the part is level there; use another direction, or blend it with one"
        }
        FeedDirection::Blend(_) => "the blended directions cancel there; give them other weights",
        FeedDirection::File { .. } => {
            "the rows of the table are too few there, or cancel each other; check it"
        }
        _ => "use another direction",
    };
    not_applicable(&format!(
        "it has no feed direction anywhere from ({:.1}, {:.1}) to ({:.1}, {:.1}): {why}",
        around.min.x, around.min.y, around.max.x, around.max.y
    ))
}

/// A direction whose curves, if there are any in it, are spread over a chart as samples.
pub(crate) fn on_chart<'a>(
    direction: &'a FeedDirection,
    chart: &Chart,
    cutter: &Cutter,
) -> Result<Cow<'a, FeedDirection>, PlanError> {
    Ok(match direction {
        FeedDirection::Guides { .. } | FeedDirection::Border(_) => {
            let samples = spread(direction, chart, cutter).map_err(|e| not_applicable(&e.to_string()))?;
            let Some(field) = LineField::new(SamplePlane::Parameters, &samples) else {
                return Err(nowhere(direction, chart.corners().into_iter()));
            };
            Cow::Owned(FeedDirection::Samples(Arc::new(field)))
        }
        FeedDirection::Blend(parts) => {
            let spread =
                parts.iter().map(|(part, weight)| Ok((on_chart(part, chart, cutter)?.into_owned(), *weight)));
            Cow::Owned(FeedDirection::Blend(spread.collect::<Result<_, PlanError>>()?))
        }
        local => Cow::Borrowed(local),
    })
}

/// The field of curves at the nodes of a mesh over a chart.
fn spread(
    direction: &FeedDirection,
    chart: &Chart,
    cutter: &Cutter,
) -> Result<Vec<LineSample>, MeshFieldError> {
    let at = |c: usize, k: usize| {
        let [lo, hi] = chart.domain[c];
        lo + (hi - lo) * k as f64 / (NODES - 1) as f64
    };
    let places: Vec<[f64; 2]> = (0..NODES * NODES).map(|k| [at(0, k % NODES), at(1, k / NODES)]).collect();
    let points = places.iter().map(|&[u, v]| chart.jet(u, v).p).collect();
    let corner = |i: usize, j: usize| (j * NODES + i) as u32;
    let squares = (0..NODES - 1).flat_map(|j| (0..NODES - 1).map(move |i| (i, j)));
    let triangles = squares.flat_map(|(i, j)| {
        let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
        [[a, b, c], [a, c, d]]
    });
    let mesh = FieldMesh::new(points, triangles.collect(), None)?;
    let lines = from_curves(direction, &mesh, &beside_curves(direction, &mesh, cutter), cutter)?;
    let sample = |(&[u, v], line): (&[f64; 2], &Line)| {
        let (du, dv) = chart.jet(u, v).pull_back(&line.direction)?;
        Some(LineSample { at: [u, v], line: [du, dv], weight: line.agreement })
    };
    Ok(places.iter().zip(&lines).filter_map(sample).collect())
}

/// What curves want of the vertices beside them; nothing of other directions.
fn beside_curves(direction: &FeedDirection, mesh: &FieldMesh, cutter: &Cutter) -> Vec<Wanted> {
    match direction {
        FeedDirection::Guides { curves, sense } => {
            guides(mesh, curves, REACH_OVER_RADIUS * cutter.radius(), *sense)
        }
        FeedDirection::Border(sense) => borders(mesh, *sense),
        _ => vec![None; mesh.points().len()],
    }
}

/// The field over a whole mesh from what curves want beside them.
fn from_curves(
    direction: &FeedDirection,
    mesh: &FieldMesh,
    wanted: &[Wanted],
    cutter: &Cutter,
) -> Result<Vec<Line>, MeshFieldError> {
    let FeedDirection::Border(_) = direction else {
        return smooth_lines(mesh, wanted, &[], SMOOTHING_OVER_RADIUS * cutter.radius());
    };
    let hard: Vec<(u32, Vector3)> = (0..).zip(wanted).filter_map(|(v, w)| Some((v, w.as_ref()?.0))).collect();
    let length = SMOOTHING_OVER_RADIUS * cutter.radius();
    let lines = smooth_lines(mesh, wanted, &hard, length)?;
    let turned = work::parallel::map(lines.len(), |v| {
        let line = lines[v];
        if line.agreement >= MITRE {
            return Some((line.direction, 1.0));
        }
        let p = mesh.points()[v];
        let (mut sum, mut total) = (Vector3::zeros(), 0.0);
        // Borders are directed along their loops, so that sides of one corner add up to its bisector.
        for (w, tangent) in &hard {
            let say = (mesh.points()[*w as usize] - p).norm().max(1e-9).powi(-SAY);
            (sum, total) = (sum + tangent * say, total + say);
        }
        let normal = &mesh.normals()[v];
        let sum = sum - normal * normal.dot(&sum);
        (sum.norm() > LEAST_SAY * total).then_some((sum, 1.0))
    });
    smooth_lines(mesh, &turned, &hard, length)
}

/// What is wanted at every vertex of a piece of the part and of the strip around it.
pub(crate) fn on_mesh(
    part: &Part,
    cutter: &Cutter,
    direction: &FeedDirection,
    piece: &ConnectedPiece,
    surface: &MeshSurface,
) -> Result<Vec<Wanted>, MeshFieldError> {
    let mesh = &surface.mesh;
    Ok(match direction {
        FeedDirection::Angle(angle) => fixed_angle(mesh, *angle),
        FeedDirection::Parameter(along) => along_parameter(part, mesh, *along),
        FeedDirection::WidestStrip => (0..mesh.points().len())
            .map(|v| {
                let (least, greatest, tangent) = surface.bends[v].principal(mesh.frame(v));
                Some((tangent, ((greatest - least) * cutter.radius()).min(1.0)))
            })
            .collect(),
        FeedDirection::Steepest => slope(mesh, true),
        FeedDirection::Contour => slope(mesh, false),
        FeedDirection::Samples(samples) | FeedDirection::File { samples: Some(samples), .. } => {
            sampled(part, mesh, samples)
        }
        FeedDirection::File { samples: None, .. } => vec![None; mesh.points().len()],
        FeedDirection::Guides { .. } | FeedDirection::Border(_) => {
            // The border is the part's own, not that of the strip around it; the piece's vertices come first.
            let mut wanted = beside_curves(direction, &piece.mesh, cutter);
            wanted.resize(mesh.points().len(), None);
            let lines = from_curves(direction, mesh, &wanted, cutter)?;
            lines.iter().map(|line| Some((line.direction, line.agreement))).collect()
        }
        FeedDirection::Blend(parts) => {
            let wishes =
                parts.iter().map(|(of, weight)| Ok((on_mesh(part, cutter, of, piece, surface)?, *weight)));
            blended(mesh, wishes)?
        }
    })
}

/// What is wanted at every vertex of a plane region; u and v are its x and y, and it is level.
pub(crate) fn on_plane(
    mesh: &FieldMesh,
    direction: &FeedDirection,
    cutter: &Cutter,
) -> Result<Vec<Wanted>, MeshFieldError> {
    Ok(match direction {
        FeedDirection::Angle(angle) => fixed_angle(mesh, *angle),
        FeedDirection::Parameter(along) => along_axis(mesh, *along),
        FeedDirection::Samples(samples) | FeedDirection::File { samples: Some(samples), .. } => {
            let at = |p: &Point3| {
                let ([x, y], sure) = samples.at([p.x, p.y])?;
                Vector3::new(x, y, 0.0).try_normalize(1e-12).map(|t| (t, sure))
            };
            mesh.points().iter().map(at).collect()
        }
        FeedDirection::Guides { .. } | FeedDirection::Border(_) => {
            let lines = from_curves(direction, mesh, &beside_curves(direction, mesh, cutter), cutter)?;
            lines.iter().map(|line| Some((line.direction, line.agreement))).collect()
        }
        FeedDirection::Blend(parts) => {
            let wishes = parts.iter().map(|(of, weight)| Ok((on_plane(mesh, of, cutter)?, *weight)));
            blended(mesh, wishes)?
        }
        FeedDirection::File { samples: None, .. }
        | FeedDirection::WidestStrip
        | FeedDirection::Steepest
        | FeedDirection::Contour => vec![None; mesh.points().len()],
    })
}

/// Wishes blended by their weights.
fn blended(
    mesh: &FieldMesh,
    wishes: impl Iterator<Item = Result<(Vec<Wanted>, f64), MeshFieldError>>,
) -> Result<Vec<Wanted>, MeshFieldError> {
    let wishes = wishes.collect::<Result<Vec<_>, MeshFieldError>>()?;
    let total: f64 = wishes.iter().map(|(_, weight)| weight).sum();
    let lists: Vec<(&[Wanted], f64)> =
        wishes.iter().map(|(wanted, weight)| (&wanted[..], weight / total)).collect();
    blend(mesh, &lists)
}

/// Along x or y.
fn along_axis(mesh: &FieldMesh, along: Along) -> Vec<Wanted> {
    fixed_angle(mesh, if along == Along::U { 0.0 } else { std::f64::consts::FRAC_PI_2 })
}

/// Along a parameter of each patch; along x or y on a mesh.
fn along_parameter(part: &Part, mesh: &FieldMesh, along: Along) -> Vec<Wanted> {
    if part.patches().is_empty() {
        return along_axis(mesh, along);
    }
    work::parallel::map(mesh.points().len(), |v| {
        let at = part.closest_point(&mesh.points()[v]).0.at?;
        let jet = part.patches()[at.patch as usize].jet(at.u, at.v);
        let tangent = if along == Along::U { jet.du } else { jet.dv };
        tangent.try_normalize(1e-12).map(|t| (t, 1.0))
    })
}

/// As sampled; u and v of a mesh are its x and y.
fn sampled(part: &Part, mesh: &FieldMesh, samples: &LineField) -> Vec<Wanted> {
    let by_patch = samples.plane() == SamplePlane::Parameters && !part.patches().is_empty();
    work::parallel::map(mesh.points().len(), |v| {
        let (p, normal) = (&mesh.points()[v], &mesh.normals()[v]);
        let (t, sure) = if by_patch {
            let at = part.closest_point(p).0.at?;
            let (line, sure) = samples.at([at.u, at.v])?;
            let jet = part.patches()[at.patch as usize].jet(at.u, at.v);
            (jet.du * line[0] + jet.dv * line[1], sure)
        } else {
            let (line, sure) = samples.at([p.x, p.y])?;
            (Vector3::new(-line[1], line[0], 0.0).cross(normal), sure)
        };
        t.try_normalize(1e-12).map(|t| (t, sure))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use field::mesh::Sense;
    use geometry::{AnalyticShape, AnalyticSurface, Vector2};
    use part::Patch;

    /// Short stretches of guides at 0.2 rad on one side of a plate and at 0.9 rad on the other: between them
    /// exp(2iθ) is harmonic and depends on x only, so it is a straight line between its values.
    #[test]
    fn between_guides_the_field_is_harmonic() {
        let surface = AnalyticSurface::new(AnalyticShape::Plane { height: 0.0 }, [[0.0, 30.0], [0.0, 20.0]]);
        let part = Part::from_patches(vec![Patch::Analytic(surface.unwrap())], 0.002).unwrap();
        let stretch = |x: f64, y: f64, angle: f64| {
            let half = Vector2::new(angle.cos(), angle.sin()) * 0.05;
            vec![Point2::new(x, y) - half, Point2::new(x, y) + half]
        };
        let (first, last) = (0.2, 0.9);
        let sides = (0..=40)
            .flat_map(|k| [(0.0, first), (30.0, last)].map(|(x, a)| stretch(x, 0.5 * f64::from(k), a)));
        let direction = FeedDirection::Guides { curves: Arc::new(sides.collect()), sense: Sense::Along };
        let cutter = Cutter::ball(6.0).unwrap();
        let chart = Chart::all(&part, &cutter, crate::vocabulary::Guide::default()).unwrap().remove(0);
        let FeedDirection::Samples(field) = on_chart(&direction, &chart, &cutter).unwrap().into_owned()
        else {
            panic!("curves become samples")
        };
        for (x, y) in (3..28).flat_map(|x| [(f64::from(x), 3.0), (f64::from(x), 16.5)]) {
            // The guides hold what is within their reach by (z − w) = ℓ² z'', which for the field between
            // them is as if they held it ℓ coth(reach/ℓ) beyond that reach; both are 1.5 mm.
            let beyond = 1.5 / 1f64.tanh() - 1.5;
            let share = (x + beyond) / (30.0 + 2.0 * beyond);
            let part = |angle: f64| [(2.0 * angle).cos(), (2.0 * angle).sin()];
            let [re, im] = [0, 1].map(|c| (1.0 - share) * part(first)[c] + share * part(last)[c]);
            let exact = 0.5 * im.atan2(re);
            let (line, sure) = field.at([x, y]).unwrap();
            assert!((line[1].atan2(line[0]) - exact).abs() < 0.02, "{x} {y}: {line:?} {exact}");
            assert!((sure - re.hypot(im)).abs() < 0.02, "{x} {y}: {sure}");
        }
    }

    /// u and v from 0 to 1 where the parameters of the part are millimetres.
    #[test]
    fn samples_that_cover_little_of_a_part_are_told() {
        let surface = AnalyticSurface::new(AnalyticShape::Plane { height: 0.0 }, [[0.0, 30.0], [0.0, 20.0]]);
        let part = Part::from_patches(vec![Patch::Analytic(surface.unwrap())], 0.002).unwrap();
        let over = |size: [f64; 2]| {
            let sample = |k: usize| {
                let at = [size[0] * (k % 5) as f64 / 4.0, size[1] * (k / 5) as f64 / 4.0];
                LineSample { at, line: [1.0, 0.0], weight: 1.0 }
            };
            let samples: Vec<_> = (0..25).map(sample).collect();
            let field = LineField::new(SamplePlane::Parameters, &samples).unwrap();
            check(&FeedDirection::Samples(Arc::new(field)), &part.bounds(), &[[[0.0, 30.0], [0.0, 20.0]]])
                .unwrap()
        };
        assert!(
            over([1.0, 1.0])[0].contains("(u from 0 to 1, v from 0 to 1) cover 0.17 %"),
            "{:?}",
            over([1.0; 2])
        );
        assert!(over([30.0, 20.0]).is_empty() && over([28.0, 0.0]).is_empty());
    }

    #[test]
    fn a_segment_meets_a_rectangle_or_passes_by() {
        let meets =
            |a: [f64; 2], b: [f64; 2]| meets([[0.0, 4.0], [0.0, 2.0]], [Point2::from(a), Point2::from(b)]);
        assert!(meets([-1.0, -1.0], [5.0, 3.0]), "through it, with both ends outside");
        assert!(meets([1.0, 1.0], [2.0, 1.0]) && meets([4.0, -1.0], [4.0, 1.0]));
        assert!(!meets([-1.0, 1.5], [1.0, 3.5]), "past a corner");
        assert!(!meets([5.0, 1.0], [9.0, 1.0]) && !meets([1.0, -2.0], [1.0, -1.0]));
    }
}
