//! How far a surface lies from a design surface: the true distance of an offset, whatever way it was made.
//!
//! Enters: a surface, mm, a part, and the distance that was asked for. Leaves: least, greatest, mean and root
//! mean square, with places. Distances are those to the nearest point of the part, refined on its exact
//! patches. Places whose nearest point lies on the part's border, where no normal of the part reaches them,
//! are counted and left out.

use crate::geometry::{NurbsSurface, Point3};
use crate::parallel;
use crate::part::Part;

/// Greatest angle, rad, between the way to the nearest point and the normal there; beyond, the nearest point
/// lies on a border or a crease.
const ALONG_NORMAL: f64 = 1.0e-4;

/// Distances of a surface from a part, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OffsetDistance {
    /// Least distance.
    pub least: f64,
    /// Where, on the surface.
    pub least_at: Point3,
    /// Greatest distance.
    pub greatest: f64,
    /// Where, on the surface.
    pub greatest_at: Point3,
    /// Mean distance.
    pub mean: f64,
    /// Root of the mean square of what is missing to the asked distance, or beyond it.
    pub rms_error: f64,
    /// Places that were measured.
    pub places: usize,
    /// Places that were left out, since their nearest point lies on a border or a crease.
    pub left_out: usize,
}

/// Distance of `surface` from `design` at the middles of `cells[0] × cells[1]` equal cells of its parameters;
/// `asked`, mm, is the distance that it should have. `None` where no place is beside the inside of the part.
pub fn measure_offset(
    surface: &NurbsSurface,
    design: &Part,
    asked: f64,
    cells: [usize; 2],
) -> Option<OffsetDistance> {
    let [[u0, u1], [v0, v1]] = surface.domain();
    let middle = |lo: f64, hi: f64, k: usize, n: usize| lo + (hi - lo) * (k as f64 + 0.5) / n as f64;
    let rows = parallel::map(cells[0], |i| {
        let u = middle(u0, u1, i, cells[0]);
        let place = |j: usize| {
            let p = surface.point(u, middle(v0, v1, j, cells[1]));
            let (foot, _) = design.closest_point(&p);
            let way = p - foot.point;
            let distance = way.norm();
            let beside = way.cross(&foot.normal).norm() <= ALONG_NORMAL * distance;
            beside.then_some((distance, p))
        };
        (0..cells[1]).filter_map(place).collect::<Vec<(f64, Point3)>>()
    });
    let places = rows.concat();
    let (least, least_at) = places.iter().copied().min_by(|a, b| a.0.total_cmp(&b.0))?;
    let (greatest, greatest_at) = places.iter().copied().max_by(|a, b| a.0.total_cmp(&b.0))?;
    let count = places.len() as f64;
    let mean = places.iter().map(|p| p.0).sum::<f64>() / count;
    let square = places.iter().map(|p| (p.0 - asked).powi(2)).sum::<f64>() / count;
    Some(OffsetDistance {
        least,
        least_at,
        greatest,
        greatest_at,
        mean,
        rms_error: square.sqrt(),
        places: places.len(),
        left_out: cells[0] * cells[1] - places.len(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{CubicSpline, LoftSection, OffsetSurface, Point2, loft, loft_of_offsets};
    use crate::part::Patch;
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
        let part = Part::from_patches(vec![Patch::Nurbs(base.clone())], 0.005).unwrap();
        // Counter-clockwise: outward is to the right of the sections, along du × dv of the loft.
        let planar = &loft_of_offsets(&sections, -2.0, 1e-4).unwrap()[0].surface;
        let found = measure_offset(planar, &part, 2.0, [40, 60]).unwrap();
        assert!((found.least - 1.8794).abs() < 5e-4 && (found.greatest - 1.8794).abs() < 5e-4, "{found:?}");
        assert!((found.rms_error - 0.1206).abs() < 5e-4 && found.left_out > 0 && found.places > 2000);
        let exact = OffsetSurface::new(&base, 2.0).unwrap();
        let fit = &exact.fit(5e-4).unwrap()[0];
        let found = measure_offset(&fit.surface, &part, 2.0, [40, 60]).unwrap();
        assert!((found.least - 2.0).abs() < 1e-3 && (found.greatest - 2.0).abs() < 1e-3, "{found:?}");
        assert!(found.rms_error < 1e-3 && found.places > 2300);
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
        assert!(measure_offset(&above, &part, 2.0, [6, 6]).is_none());
    }
}
