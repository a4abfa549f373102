//! Where feed directions are asked for, to compare passes with.
//!
//! Most directions have a formula at every place. A table asks at its rows, guide curves and borders ask
//! along themselves, and nothing is asked between and beyond: what the field has there is ours. So these
//! leave [`Row`]s. A blend is a mean at every place, and its parts are spread for that.

use std::f64::consts::PI;

use super::chart::Chart;
use crate::levels::planned_field::NO_MATTER;
use crate::vocabulary::FeedDirection;
use field::mesh::{FieldMesh, Sense, Wanted};
use field::{LineField, SamplePlane};
use geometry::{Point2, Point3, Vector3, angle_between};
use part::Part;

/// Ground with a slope of less than this, rad, has no direction up or along it.
const LEAST_SLOPE: f64 = PI / 180.0;

/// Where a curve turns by more than this at one point, rad, it has no tangent.
const CORNER: f64 = PI / 6.0;

/// A place beside a border by less than this, mm, is on it: rounding.
const ROUNDING: f64 = 1e-6;

/// Sides of a polygon along each side of a chart.
const BORDER_SIDES: usize = 96;

/// A direction that is asked for at one place.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Row {
    /// Where; without a meaning of its height where it is of the plan view.
    pub at: Point3,
    /// The line along which its direction is measured: a tangent there, or one of the plan view.
    line: Vector3,
    /// Whether place and line are of the plan view.
    pub is_plan: bool,
    /// Whether passes run along the line or across it.
    sense: Sense,
    /// What it counts: 1, or the length of curve that it stands for, mm.
    pub weight: f64,
    /// Distance along its curve to the next corner, mm.
    pub to_corner: f64,
}

impl Row {
    /// The unit tangent that is asked for, on a surface of unit `normal`; `None` where the line stands square
    /// to it.
    pub fn asked(&self, normal: &Vector3) -> Option<Vector3> {
        let tangent = if self.is_plan {
            Vector3::new(-self.line.y, self.line.x, 0.0).cross(normal)
        } else {
            self.line - normal * normal.dot(&self.line)
        };
        Some(self.sense.feed(tangent.try_normalize(1e-12)?, normal))
    }
}

/// Whether a direction is asked for at every place, not in rows.
pub(crate) fn is_everywhere(direction: &FeedDirection) -> bool {
    !matches!(
        direction,
        FeedDirection::Samples(_)
            | FeedDirection::File { .. }
            | FeedDirection::Guides { .. }
            | FeedDirection::Border(_)
    )
}

/// Where a direction matters less, there is none: level ground, strips as wide in all directions, lines that
/// cancel.
fn least_matter(direction: &FeedDirection) -> f64 {
    match direction {
        FeedDirection::Steepest | FeedDirection::Contour => LEAST_SLOPE.sin(),
        FeedDirection::WidestStrip | FeedDirection::Blend(_) => NO_MATTER,
        _ => 0.0,
    }
}

/// The tangent of a direction that is asked for everywhere, given what the fit wants at a place and how much
/// that matters.
pub(crate) fn everywhere(direction: &FeedDirection, wanted: &Wanted) -> Option<Vector3> {
    let (tangent, matters) = (*wanted)?;
    (is_everywhere(direction) && matters >= least_matter(direction)).then_some(tangent)
}

/// Places and tangents of patches at parameters and a direction in these.
type OnPatches<'a> = &'a dyn Fn([f64; 2], [f64; 2]) -> Vec<(Point3, Vector3)>;

/// What rows are made of besides a direction.
pub(crate) struct Ground<'a> {
    /// The borders, closed polygons.
    pub borders: &'a dyn Fn() -> Vec<Vec<Point3>>,
    /// Place and tangent of a table's row on patches; without it parameters are x and y.
    pub on_patches: Option<OnPatches<'a>>,
    /// Whether a place of the plan view is covered.
    pub covers: &'a dyn Fn(&Point2) -> bool,
    /// Rows along curves are no farther apart, mm.
    pub spacing: f64,
}

impl Ground<'_> {
    /// The rows of a direction, those side by side on a curve together; none of one that is asked for
    /// everywhere.
    pub fn rows(&self, direction: &FeedDirection) -> Vec<Vec<Row>> {
        match direction {
            FeedDirection::Samples(table) | FeedDirection::File { samples: Some(table), .. } => {
                self.of_table(table)
            }
            FeedDirection::Guides { curves, sense } => {
                let lifted = |curve: &Vec<Point2>| -> Vec<Point3> {
                    curve.iter().map(|p| Point3::new(p.x, p.y, 0.0)).collect()
                };
                let along = |curve: &Vec<Point2>| along_curve(&lifted(curve), true, *sense, self.spacing);
                let mut rows: Vec<Vec<Row>> = curves.iter().map(along).collect();
                rows.iter_mut().for_each(|rows| rows.retain(|row| (self.covers)(&row.at.xy())));
                rows
            }
            FeedDirection::Border(sense) => {
                let borders = (self.borders)();
                borders.iter().map(|border| along_curve(border, false, *sense, self.spacing)).collect()
            }
            _ => Vec::new(),
        }
    }

    fn of_table(&self, table: &LineField) -> Vec<Vec<Row>> {
        let row = |at: Point3, line: Vector3, is_plan: bool| {
            vec![Row { at, line, is_plan, sense: Sense::Along, weight: 1.0, to_corner: f64::INFINITY }]
        };
        let of_patches = self.on_patches.filter(|_| table.plane() == SamplePlane::Parameters);
        let rows = table.given().flat_map(|given| match of_patches {
            Some(on_patches) => {
                let places = on_patches(given.at, given.line).into_iter();
                places.map(|(at, line)| row(at, line, false)).collect::<Vec<_>>()
            }
            None => {
                let ([x, y], [tx, ty]) = (given.at, given.line);
                let covered = (self.covers)(&Point2::new(x, y));
                Vec::from_iter(covered.then(|| row(Point3::new(x, y, 0.0), Vector3::new(tx, ty, 0.0), true)))
            }
        });
        rows.collect()
    }
}

/// Rows in the middle of even parts of a polygon's sides; it is closed where it ends at its first point.
fn along_curve(points: &[Point3], is_plan: bool, sense: Sense, spacing: f64) -> Vec<Row> {
    let mut points = points.to_vec();
    points.dedup();
    let sides: Vec<Vector3> = points.windows(2).map(|w| w[1] - w[0]).collect();
    let turns = |a: &Vector3, b: &Vector3| angle_between(a, b) > CORNER;
    let mut begins = vec![0.0];
    sides.iter().for_each(|side| begins.push(begins[begins.len() - 1] + side.norm()));
    let length = begins[sides.len()];
    let mut corners: Vec<f64> =
        (1..sides.len()).filter(|&k| turns(&sides[k - 1], &sides[k])).map(|k| begins[k]).collect();
    if let (Some(first), Some(last)) = (sides.first(), sides.last())
        && points[0] == points[points.len() - 1]
    {
        if turns(last, first) {
            corners.push(0.0);
        }
        // Around its end a closed curve goes on.
        corners = corners.iter().flat_map(|c| [c - length, *c, c + length]).collect();
    }
    let mut rows = Vec::new();
    for (k, side) in sides.iter().enumerate() {
        let parts = (side.norm() / spacing).ceil().max(1.0);
        for part in 0..parts as usize {
            let share = (part as f64 + 0.5) / parts;
            let s = begins[k] + share * side.norm();
            let to_corner = corners.iter().map(|c| (c - s).abs()).fold(f64::INFINITY, f64::min);
            let (at, weight) = (points[k] + side * share, side.norm() / parts);
            rows.push(Row { at, line: *side, is_plan, sense, weight, to_corner });
        }
    }
    rows
}

/// The borders of a mesh as closed polygons.
pub(crate) fn borders_of(mesh: &FieldMesh) -> Vec<Vec<Point3>> {
    let closed = |ring: &Vec<u32>| {
        let corners = ring.iter().chain(ring.first());
        corners.map(|&v| mesh.points()[v as usize]).collect()
    };
    mesh.loops().iter().map(closed).collect()
}

/// Whether a place of the plan view lies on a part, borders included.
fn covers(part: &Part, p: &Point2) -> bool {
    let around = [[0.0, 0.0], [1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]];
    around.iter().any(|[dx, dy]| {
        part.bvh().highest_at(part.mesh(), p.x + ROUNDING * dx, p.y + ROUNDING * dy).is_some()
    })
}

/// The rows of a direction over a chart of a part.
pub(crate) fn on_chart(direction: &FeedDirection, part: &Part, chart: &Chart, spacing: f64) -> Vec<Vec<Row>> {
    let borders = || {
        let corners = [[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]];
        let corner = |k: usize| [0, 1].map(|c| chart.domain[c][corners[k][c]]);
        let side = |k: usize| {
            let (from, to) = (corner(k), corner(k + 1));
            (0..BORDER_SIDES).map(move |n| {
                let t = n as f64 / BORDER_SIDES as f64;
                chart.jet(from[0] + t * (to[0] - from[0]), from[1] + t * (to[1] - from[1])).p
            })
        };
        vec![(0..4).flat_map(side).chain([chart.corners()[0]]).collect()]
    };
    let on_patches = |[u, v]: [f64; 2], [tu, tv]: [f64; 2]| {
        let [u0, v0] = [0, 1].map(|c| clamped([u, v][c], chart.domain[c]));
        let jet = chart.jet(u0, v0);
        let off = (jet.du * (u - u0) + jet.dv * (v - v0)).norm();
        Vec::from_iter((off <= ROUNDING).then(|| (jet.p, jet.du * tu + jet.dv * tv)))
    };
    let covers = |p: &Point2| covers(part, p);
    Ground { borders: &borders, on_patches: Some(&on_patches), covers: &covers, spacing }.rows(direction)
}

fn clamped(x: f64, [lo, hi]: [f64; 2]) -> f64 {
    x.clamp(lo, hi)
}

/// The rows of a direction over a piece of the mesh of a part.
pub(crate) fn on_mesh(
    direction: &FeedDirection,
    part: &Part,
    piece: &FieldMesh,
    spacing: f64,
) -> Vec<Vec<Row>> {
    let on_patches = |[u, v]: [f64; 2], [tu, tv]: [f64; 2]| {
        let of_patch = |patch: &part::Patch| {
            let [[u0, u1], [v0, v1]] = patch.domain();
            let jet = patch.jet(clamped(u, [u0, u1]), clamped(v, [v0, v1]));
            let off = jet.du * (u - clamped(u, [u0, u1])) + jet.dv * (v - clamped(v, [v0, v1]));
            (off.norm() <= ROUNDING).then(|| (jet.p, jet.du * tu + jet.dv * tv))
        };
        part.patches().iter().filter_map(of_patch).collect()
    };
    let (borders, covers) = (|| borders_of(piece), |p: &Point2| covers(part, p));
    let on_patches: Option<OnPatches<'_>> = if part.patches().is_empty() { None } else { Some(&on_patches) };
    Ground { borders: &borders, on_patches, covers: &covers, spacing }.rows(direction)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    fn along(curve: &[[f64; 2]], spacing: f64) -> Vec<Row> {
        let curves = Arc::new(vec![curve.iter().map(|p| Point2::from(*p)).collect::<Vec<_>>()]);
        let direction = FeedDirection::Guides { curves, sense: Sense::Across };
        Ground { borders: &Vec::new, on_patches: None, covers: &|p| p.x <= 4.0, spacing }
            .rows(&direction)
            .remove(0)
    }

    #[test]
    fn a_curve_asks_along_its_whole_length_and_has_corners() {
        let rows = along(&[[0.0, 0.0], [3.0, 0.0], [3.0, 2.0], [8.0, 2.0]], 1.0);
        // What lies beyond x = 4 is not covered.
        assert_eq!(rows.len(), 6);
        let length: f64 = rows.iter().map(|row| row.weight).sum();
        assert!((length - 6.0).abs() < 1e-12, "{length}");
        let to_corner: Vec<f64> = rows.iter().map(|row| row.to_corner).collect();
        assert_eq!(to_corner, [2.5, 1.5, 0.5, 0.5, 0.5, 0.5]);
        let asked = rows[3].asked(&Vector3::z()).unwrap();
        assert!(asked.x.abs() > 1.0 - 1e-12, "across a curve along y: {asked}");
        // On a slope the tangent lies over the line of the plan view.
        let normal = Vector3::new(0.0, -1.0, 1.0).normalize();
        let uphill = Row { sense: Sense::Along, ..rows[3] }.asked(&normal).unwrap();
        assert!((uphill - Vector3::new(0.0, 1.0, 1.0).normalize()).norm() < 1e-12, "{uphill}");
        // A closed square has four corners, and a line none.
        let square = along(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.0, 0.0]], 0.5);
        assert!(square.iter().all(|row| row.to_corner <= 0.5 + 1e-12), "{square:?}");
        assert!(along(&[[0.0, 0.0], [2.0, 0.0]], 0.5).iter().all(|row| row.to_corner.is_infinite()));
    }
}
