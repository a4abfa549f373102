//! How far a surface lies from a design surface: the true distance of an offset, whatever way it was made,
//! and where the design is too concave for it.
//!
//! Enters: surfaces, mm, a part, and the distance that was asked for. Leaves: least, greatest, mean and root
//! mean square, with places and a bound of the error; singular places of the offset. Distances are those to
//! the nearest point of the part, refined on its exact patches. Places whose nearest point lies on the part's
//! border, where no normal of the part reaches them, are counted and left out.
//!
//! Surfaces are asked at the middles of cells of their parameters. Over a cell the distance changes by no
//! more than its slope times the way to the farthest corner, to first order; cells that may hold more than
//! the extremes are divided.

use serde::Serialize;

use geometry::{NurbsSurface, Point3};
use offset::OffsetSurface;
use part::{Part, Patch, PatchPoint};
use work::parallel;

/// Greatest angle, rad, between the way to the nearest point and the normal there; beyond, the nearest point
/// lies on a border or a crease.
const ALONG_NORMAL: f64 = 1.0e-4;

/// Cells that may exceed the extremes by no more than this, mm, are not divided. Less costs looks.
const ENOUGH: f64 = 1.0e-4;

/// Divisions of a cell, and looks at cells in all, at most: an extreme along a whole border asks for ever
/// more of them.
const MOST_ROUNDS: usize = 12;
const MOST_LOOKS: usize = 40_000;

/// What rounding may do to a distance, mm.
const ROUNDING: f64 = 1.0e-9;

/// Cells along u and v in which a run looks at each surface.
const CELLS: [usize; 2] = [64, 32];

/// Singular places that are listed at most.
const MOST_PLACES: usize = 100;

/// Distances of a surface from a part.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct OffsetDistance {
    /// Least distance.
    pub least_mm: f64,
    /// Where, on the surface.
    pub least_at_mm: [f64; 3],
    /// Greatest distance.
    pub greatest_mm: f64,
    /// Where, on the surface.
    pub greatest_at_mm: [f64; 3],
    /// By how much, at most and to first order, the true extremes lie beyond these.
    pub error_bound_mm: f64,
    /// Mean distance over equal cells of the parameters.
    pub mean_mm: f64,
    /// Root of the mean square of what is missing to the asked distance, or beyond it.
    pub rms_error_mm: f64,
    /// Cells that were measured.
    pub places: usize,
    /// Cells that were left out, since their nearest point lies on a border or a crease.
    pub places_left_out: usize,
}

/// A surface by its points, over the rectangle `[[u0, u1], [v0, v1]]`.
pub struct OffsetPoints<'a> {
    domain: [[f64; 2]; 2],
    point: Box<dyn Fn(f64, f64) -> Point3 + Sync + 'a>,
}

impl<'a> OffsetPoints<'a> {
    /// The points of a surface.
    pub fn of(surface: &'a NurbsSurface) -> Self {
        Self { domain: surface.domain(), point: Box::new(|u, v| surface.point(u, v)) }
    }

    /// The true offset of a patch of a part, `distance`, mm, outward of it.
    ///
    /// # Panics
    /// When there is no such patch.
    pub fn of_patch(part: &'a Part, patch: u32, distance: f64) -> Self {
        let point = move |u, v| {
            let (point, normal) = part.point_and_normal(PatchPoint { patch, u, v });
            point + normal * distance
        };
        Self { domain: part.patches()[patch as usize].domain(), point: Box::new(point) }
    }
}

/// A cell of a surface's parameters, `[[u0, u1], [v0, v1]]`.
#[derive(Clone, Copy)]
struct Cell {
    surface: usize,
    range: [[f64; 2]; 2],
}

impl Cell {
    fn parts(self, counts: [usize; 2]) -> impl Iterator<Item = Self> {
        let [nu, nv] = counts;
        let part = move |c: usize, k: usize, n: usize| {
            let [lo, hi] = self.range[c];
            [k, k + 1].map(|k| lo + (hi - lo) * k as f64 / n as f64)
        };
        (0..nu * nv).map(move |k| Self { range: [part(0, k / nv, nu), part(1, k % nv, nv)], ..self })
    }
}

/// The middle of a cell, whose nearest point lies along the part's normal.
#[derive(Clone, Copy)]
struct Look {
    cell: Cell,
    at: Point3,
    distance: f64,
    /// What the distance changes by within the cell.
    change: f64,
}

/// Surfaces held against a part.
struct Gauge<'a> {
    surfaces: &'a [OffsetPoints<'a>],
    design: &'a Part,
}

impl Gauge<'_> {
    fn look(&self, cell: Cell) -> Option<Look> {
        let point = &self.surfaces[cell.surface].point;
        let [[u0, u1], [v0, v1]] = cell.range;
        let at = point(0.5 * (u0 + u1), 0.5 * (v0 + v1));
        let (foot, _) = self.design.closest_point(&at);
        let way = at - foot.point;
        let distance = way.norm();
        if way.cross(&foot.normal).norm() > ALONG_NORMAL * distance {
            return None;
        }
        let corners = [point(u0, v0), point(u1, v0), point(u1, v1), point(u0, v1)];
        let reach = corners.iter().map(|corner| (corner - at).norm()).fold(0.0, f64::max);
        let normal = (corners[2] - corners[0]).cross(&(corners[3] - corners[1])).try_normalize(1e-300);
        // The slope is the sine between the way and the normal; a cell without a normal may have any.
        let slope = normal.map_or(1.0, |n| n.cross(&way).norm() / distance.max(f64::MIN_POSITIVE));
        Some(Look { cell, at, distance, change: slope.min(1.0) * reach })
    }

    fn looks(&self, cells: &[Cell]) -> Vec<Look> {
        parallel::map(cells.len(), |k| self.look(cells[k])).into_iter().flatten().collect()
    }
}

/// Distance of `surfaces` from `design` at the middles of `cells[0] × cells[1]` equal cells of the parameters
/// of each, and closer where the extremes may be; `asked`, mm, is the distance that they should have. `None`
/// where no place is beside the inside of the part.
///
/// # Tolerance
/// See [`OffsetDistance::error_bound_mm`].
pub fn measure_offset(
    surfaces: &[OffsetPoints],
    design: &Part,
    asked: f64,
    cells: [usize; 2],
) -> Option<OffsetDistance> {
    let gauge = Gauge { surfaces, design };
    let whole = |(surface, s): (usize, &OffsetPoints)| Cell { surface, range: s.domain };
    let all: Vec<Cell> = surfaces.iter().enumerate().map(whole).flat_map(|cell| cell.parts(cells)).collect();
    let mut open = gauge.looks(&all);
    let first = *open.first()?;
    let (places, left_out) = (open.len(), all.len() - open.len());
    let mean_of = |f: &dyn Fn(f64) -> f64| open.iter().map(|l| f(l.distance)).sum::<f64>() / places as f64;
    let (mean, square) = (mean_of(&|d| d), mean_of(&|d| (d - asked).powi(2)));
    let (mut least, mut greatest) = (first, first);
    let mut possible = [f64::INFINITY, f64::NEG_INFINITY];
    let mut looked = 0;
    for round in 0.. {
        for look in &open {
            least = if look.distance < least.distance { *look } else { least };
            greatest = if look.distance > greatest.distance { *look } else { greatest };
        }
        let range = |l: &Look| [l.distance - l.change, l.distance + l.change];
        let beyond =
            |l: &Look| range(l)[0] < least.distance - ENOUGH || range(l)[1] > greatest.distance + ENOUGH;
        let closer = |l: &Look| round < MOST_ROUNDS && looked < MOST_LOOKS && beyond(l);
        let (divided, settled): (Vec<Look>, Vec<Look>) = open.iter().partition(|l| closer(l));
        for [lo, hi] in settled.iter().map(range) {
            possible = [possible[0].min(lo), possible[1].max(hi)];
        }
        if divided.is_empty() {
            break;
        }
        let cells: Vec<Cell> = divided.iter().flat_map(|l| l.cell.parts([2, 2])).collect();
        looked += cells.len();
        open = gauge.looks(&cells);
    }
    let beyond = (least.distance - possible[0]).max(possible[1] - greatest.distance);
    Some(OffsetDistance {
        least_mm: least.distance,
        least_at_mm: least.at.into(),
        greatest_mm: greatest.distance,
        greatest_at_mm: greatest.at.into(),
        error_bound_mm: beyond.max(0.0) + ROUNDING,
        mean_mm: mean,
        rms_error_mm: square.sqrt(),
        places,
        places_left_out: left_out,
    })
}

/// A place where a patch is as concave as a ball, or more.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SingularPlaceFigures {
    /// Patch, counted from 1.
    pub patch: usize,
    /// Its parameters.
    pub u: f64,
    /// Its parameters.
    pub v: f64,
    /// The point of the patch.
    pub at_mm: [f64; 3],
    /// Its greatest curvature; none on a crease.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub curvature_per_mm: Option<f64>,
    /// The greatest ball that fits; 0 on a crease.
    pub radius_mm: f64,
}

/// The offset surface that a ball's centre rides on, against the part.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OffsetFigures {
    /// `normal`: the true offset; `in-plane`: sections offset in their planes.
    pub made: &'static str,
    /// The distance that it should have: the ball's radius.
    pub asked_mm: f64,
    /// The distance that it has; none where no place is beside the inside of the part.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub distance: Option<OffsetDistance>,
    /// Regions of NURBS patches that are as concave as the ball, or more.
    pub singular_place_count: usize,
    /// The worst place of each, 100 at most.
    pub singular_places: Vec<SingularPlaceFigures>,
}

/// The offset surface of a path, against the part: the `given` surfaces (from sections offset in their
/// planes), or those that the part's patches truly have. `None` of a mesh.
pub fn offset_figures(part: &Part, radius: f64, given: Option<&[NurbsSurface]>) -> Option<OffsetFigures> {
    if part.patches().is_empty() {
        return None;
    }
    let surfaces: Vec<OffsetPoints> = match given {
        Some(given) => given.iter().map(OffsetPoints::of).collect(),
        None => (0..part.patches().len()).map(|k| OffsetPoints::of_patch(part, k as u32, radius)).collect(),
    };
    let mut singular_places = singular_places(part, radius);
    let singular_place_count = singular_places.len();
    singular_places.truncate(MOST_PLACES);
    Some(OffsetFigures {
        made: if given.is_some() { "in-plane" } else { "normal" },
        asked_mm: radius,
        distance: measure_offset(&surfaces, part, radius, CELLS),
        singular_place_count,
        singular_places,
    })
}

/// Places where the offset of a NURBS patch is singular, the most concave first.
fn singular_places(part: &Part, radius: f64) -> Vec<SingularPlaceFigures> {
    let of_patch = |(k, patch): (usize, &Patch)| {
        let Patch::Nurbs(surface) = patch else { return Vec::new() };
        let outward = part.outward_sign(k);
        let Ok(offset) = OffsetSurface::new(surface, outward * radius) else { return Vec::new() };
        let figures = |place: &offset::SingularPlace| SingularPlaceFigures {
            patch: k + 1,
            u: place.at[0],
            v: place.at[1],
            at_mm: place.point.into(),
            curvature_per_mm: place.curvature.is_finite().then_some(place.curvature),
            radius_mm: place.radius,
        };
        offset.singular_places().iter().map(figures).collect()
    };
    let mut all: Vec<SingularPlaceFigures> = part.patches().iter().enumerate().flat_map(of_patch).collect();
    all.sort_by(|a, b| a.radius_mm.total_cmp(&b.radius_mm));
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use blade::{LoftSection, loft, loft_of_offsets};
    use geometry::{CubicSpline, Point2};
    use std::f64::consts::TAU;

    /// Circles of a cone of half angle 20°, as closed splines.
    fn cone() -> Vec<(CubicSpline, f64)> {
        let circle = |radius: f64| {
            let points: Vec<Point2> = (0..240)
                .map(|k| {
                    let angle = TAU * f64::from(k) / 240.0;
                    Point2::new(radius * angle.cos(), radius * angle.sin())
                })
                .collect();
            CubicSpline::closed(CubicSpline::chord_lengths(&points, true), points).unwrap()
        };
        let slope = 20_f64.to_radians().tan();
        (0..6).map(|k| 6.0 * f64::from(k)).map(|z| (circle(10.0 + z * slope), z)).collect()
    }

    #[test]
    fn offset_in_its_sections_planes_a_cone_comes_too_near_and_the_true_one_does_not() {
        let cone = cone();
        let sections: Vec<LoftSection> =
            cone.iter().map(|(curve, height)| LoftSection { curve, height: *height }).collect();
        let base = loft(&sections, 1e-4).unwrap().surface;
        let part = Part::from_patches(vec![Patch::Nurbs(base)], 0.005).unwrap();
        // Counter-clockwise: outward is to the right of the sections, along du × dv of the loft.
        let planar = &loft_of_offsets(&sections, -2.0, 1e-4).unwrap()[0].surface;
        let found = measure_offset(&[OffsetPoints::of(planar)], &part, 2.0, [40, 60]).unwrap();
        assert!(
            (found.least_mm - 1.8794).abs() < 5e-4 && (found.greatest_mm - 1.8794).abs() < 5e-4,
            "{found:?}"
        );
        assert!(found.error_bound_mm < 5e-4, "{found:?}");
        assert!(
            (found.rms_error_mm - 0.1206).abs() < 5e-4 && found.places_left_out > 0 && found.places > 2000
        );
        let found = measure_offset(&[OffsetPoints::of_patch(&part, 0, 2.0)], &part, 2.0, [40, 60]).unwrap();
        assert!((found.least_mm - 2.0).abs() < 1e-3 && (found.greatest_mm - 2.0).abs() < 1e-3, "{found:?}");
        assert!(found.rms_error_mm < 1e-3 && found.places > 2300);
    }

    #[test]
    fn a_surface_beside_the_part_is_not_measured() {
        let cone = cone();
        let of = |lift: f64| -> Vec<LoftSection> {
            cone.iter().map(|(curve, height)| LoftSection { curve, height: height + lift }).collect()
        };
        let part =
            Part::from_patches(vec![Patch::Nurbs(loft(&of(0.0), 1e-3).unwrap().surface)], 0.01).unwrap();
        let above = loft(&of(100.0), 1e-3).unwrap().surface;
        assert!(measure_offset(&[OffsetPoints::of(&above)], &part, 2.0, [6, 6]).is_none());
    }

    /// A surface through open curves, the same at heights 0 to 3.
    fn upright(points: &[Point2]) -> NurbsSurface {
        let curve = CubicSpline::open(CubicSpline::chord_lengths(points, false), points.to_vec()).unwrap();
        let at = |height| LoftSection { curve: &curve, height };
        loft(&[0.0, 1.0, 2.0, 3.0].map(at), 1e-4).unwrap().surface
    }

    #[test]
    fn extremes_between_cells_are_found_or_bounded() {
        // Distances of a wave from a plane are its own, 2 to 4.
        let curve = |y: &dyn Fn(f64) -> f64| -> Vec<Point2> {
            (0..=220).map(|k| 0.05 * f64::from(k)).map(|x| Point2::new(x, y(x))).collect()
        };
        let wave = upright(&curve(&|x| 3.0 + x.sin()));
        let part = Part::from_patches(vec![Patch::Nurbs(upright(&curve(&|_| 0.0)))], 0.01).unwrap();
        let heights = || (0..=20_000).map(|k| wave.point(f64::from(k) / 2e4, 0.5).y);
        let (least, greatest) = (heights().fold(f64::INFINITY, f64::min), heights().fold(0.0, f64::max));
        assert!((least - 2.0).abs() < 1e-3 && (greatest - 4.0).abs() < 1e-3);
        for cells in [[7, 3], [31, 5]] {
            let found = measure_offset(&[OffsetPoints::of(&wave)], &part, 3.0, cells).unwrap();
            assert!(found.error_bound_mm < 2e-4, "{found:?}");
            assert!(
                found.least_mm >= least - 1e-6 && found.least_mm <= least + found.error_bound_mm,
                "{found:?}"
            );
            assert!(found.greatest_mm <= greatest + 1e-6);
            assert!(found.greatest_mm >= greatest - found.error_bound_mm, "{found:?}");
        }
    }

    #[test]
    fn a_hollow_narrower_than_the_ball_is_listed() {
        // A trough of radius 2, over 100 degrees; clockwise, so that du × dv looks at the axis.
        let angles = (0..=60).map(|k| (140.0 - 100.0 * f64::from(k) / 60.0_f64).to_radians());
        let points: Vec<Point2> = angles.map(|a| Point2::new(2.0 * a.cos(), 2.0 * a.sin())).collect();
        let part = Part::from_oriented_patches(vec![Patch::Nurbs(upright(&points))], 0.005).unwrap();
        let found = offset_figures(&part, 3.0, None).unwrap();
        let worst = found.singular_places[0];
        // The spline bends a little more toward its ends.
        assert!((worst.radius_mm - 2.0).abs() < 3e-2 && worst.patch == 1, "{worst:?}");
        assert!((worst.at_mm[0].hypot(worst.at_mm[1]) - 2.0).abs() < 1e-3);
        // A ball's centre beyond the axis is nearest to a border.
        assert_eq!(found.distance, None);
        let fits = offset_figures(&part, 1.5, None).unwrap();
        let distance = fits.distance.unwrap();
        assert_eq!(fits.singular_place_count, 0);
        assert!((distance.least_mm - 1.5).abs() < 1e-9 && (distance.greatest_mm - 1.5).abs() < 1e-9);
        assert!(distance.error_bound_mm < 1e-6, "{distance:?}");
    }
}
