//! What the short cuts cost: the second-order formula and the polynomial section against the exact scallop,
//! over curvature and step.
//!
//! The surface is a plane or a cylinder of curvature κ. One pass runs along its ruling, its neighbours are
//! turned against it, each by one angle more than the one before, as passes that spread like a fan.
//! Neighbours come nearest to the first contact one step apart. What is exact then stands in the section
//! across the first pass: the place where the cut of the neighbour, swept along its track, meets the circle
//! of the first, and its distance from the cylinder.

use super::{BallSection, ScallopError, SectionFrame, fit_section};
use geometry::{Point3, Vector3};
use motion::CcPoint;

/// Passes on either side of the gap that the polynomial is fitted to.
const PASSES_BESIDE: i32 = 3;

/// Halvings of an angle of half a turn until it is rounding.
const HALVINGS: usize = 60;

/// One curvature and step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Comparison {
    /// Curvature across the feed, 1/mm, positive concave.
    pub curvature: f64,
    /// Step along the surface, mm.
    pub step: f64,
    /// Exact height between parallel passes, mm.
    pub exact: f64,
    /// Error of the second-order formula there, as a share of it.
    pub second_order: f64,
    /// Error of the polynomial section there, as a share of it.
    pub parallel: f64,
    /// Error of the polynomial section between passes that spread, as a share of the exact height in the
    /// section.
    pub spreading: f64,
}

/// Compares for a ball of radius `r`, mm: for each curvature and step, with neighbours turned by `angle`
/// (rad) and a polynomial of `degree`. Steps at which the balls do not meet are left out.
///
/// # Errors
/// [`ScallopError`] for a radius, curvature or degree that is none, or an angle beyond a quarter of a turn.
pub fn compare(
    r: f64,
    curvatures: &[f64],
    steps: &[f64],
    angle: f64,
    degree: usize,
) -> Result<Vec<Comparison>, ScallopError> {
    if !(0.0..std::f64::consts::FRAC_PI_4).contains(&angle) {
        // Without the last digits, which are those of the radians.
        let value = (angle.to_degrees() * 1e9).round() / 1e9;
        let what = "the angle of neighbouring passes, in degrees,";
        return Err(ScallopError::Range { what, value, wanted: "from 0 to less than 45" });
    }
    let mut rows = Vec::new();
    for &curvature in curvatures {
        let section = BallSection::new(r, curvature)?;
        for &step in steps {
            let Ok(exact) = section.height(step) else { continue };
            let parallel = Fan { section, step, angle: 0.0 }.by_section(degree)?;
            let fan = Fan { section, step, angle };
            let (Ok(spread), Some(real)) = (fan.by_section(degree), fan.exact()) else { continue };
            rows.push(Comparison {
                curvature,
                step,
                exact,
                second_order: section.second_order_height(step) / exact - 1.0,
                parallel: parallel / exact - 1.0,
                spreading: spread / real - 1.0,
            });
        }
    }
    Ok(rows)
}

/// Passes on a cylinder along x whose lowest or highest ruling is the first pass.
struct Fan {
    section: BallSection,
    step: f64,
    angle: f64,
}

impl Fan {
    /// The place that lies `along` mm along the ruling and `arc` mm across it, `above` mm over the surface.
    fn on_cylinder(&self, along: f64, arc: f64, above: f64) -> Point3 {
        let k = self.section.curvature();
        let angle = arc * k;
        if k == 0.0 {
            return Point3::new(along, arc, above);
        }
        let lift = 2.0 * (0.5 * angle).sin().powi(2) / k;
        Point3::new(along, angle.sin() / k - above * angle.sin(), lift + above * angle.cos())
    }

    /// A place on pass `n`, `way` mm along it from where it is nearest to the first contact.
    fn on_pass(&self, n: i32, way: f64) -> [f64; 2] {
        let turn = self.angle * f64::from(n);
        let nearest = self.step * f64::from(n);
        [way * turn.cos() - nearest * turn.sin(), way * turn.sin() + nearest * turn.cos()]
    }

    fn contact(&self, n: i32) -> CcPoint {
        let [along, arc] = self.on_pass(n, 0.0);
        let point = self.on_cylinder(along, arc, 0.0);
        CcPoint { point, normal: (self.on_cylinder(along, arc, 1.0) - point).normalize() }
    }

    fn by_section(&self, degree: usize) -> Result<f64, ScallopError> {
        let contacts: Vec<CcPoint> = (1 - PASSES_BESIDE..=PASSES_BESIDE).map(|n| self.contact(n)).collect();
        let pair = [self.contact(0), self.contact(1)];
        let frame = SectionFrame { origin: pair[0].point, across: Vector3::y(), up: Vector3::z() };
        fit_section(frame, &contacts, degree)?.scallop(&pair, self.section.radius())
    }

    /// In the section of the first contact: on the circle of the first pass, where the track of the next
    /// comes as near.
    fn exact(&self) -> Option<f64> {
        let r = self.section.radius();
        let on_circle = |turn: f64| Point3::new(0.0, r * turn.sin(), r - r * turn.cos());
        // The balls of the next pass come nearer the farther the place is toward it.
        let [mut here, mut there] = [0.0, std::f64::consts::FRAC_PI_2];
        if self.distance_from_next(&on_circle(there)) > r {
            return None;
        }
        for _ in 0..HALVINGS {
            let middle = 0.5 * (here + there);
            *(if self.distance_from_next(&on_circle(middle)) > r { &mut here } else { &mut there }) = middle;
        }
        let at = on_circle(there);
        let k = self.section.curvature();
        if k == 0.0 {
            return Some(at.z);
        }
        // 1/|κ| less the distance from the axis, without the difference of the two.
        let distance = at.y.hypot(at.z - 1.0 / k);
        Some((2.0 * at.z - k * (at.y * at.y + at.z * at.z)) / (1.0 + k.abs() * distance))
    }

    /// Distance from the track of the ball's centres on the next pass, mm.
    fn distance_from_next(&self, q: &Point3) -> f64 {
        let r = self.section.radius();
        let distance = |way: f64| {
            let [along, arc] = self.on_pass(1, way);
            (self.on_cylinder(along, arc, r) - q).norm()
        };
        // Golden section: near the foot the distance has one valley.
        const GOLDEN: f64 = 0.618_033_988_749_894_9;
        let (mut low, mut high) = (-self.step, self.step);
        let (mut a, mut b) = (high - GOLDEN * (high - low), low + GOLDEN * (high - low));
        let (mut at_a, mut at_b) = (distance(a), distance(b));
        for _ in 0..HALVINGS {
            if at_a < at_b {
                (high, b, at_b) = (b, a, at_a);
                a = high - GOLDEN * (high - low);
                at_a = distance(a);
            } else {
                (low, a, at_a) = (a, b, at_b);
                b = low + GOLDEN * (high - low);
                at_b = distance(b);
            }
        }
        at_a.min(at_b)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::DEFAULT_DEGREE;

    const CURVATURES: [f64; 5] = [-0.2, -0.02, 0.0, 0.02, 0.1];

    #[test]
    fn parallel_passes_agree_and_spreading_ones_do_not() {
        let rows = compare(5.0, &CURVATURES, &[0.3, 0.6], 5f64.to_radians(), DEFAULT_DEGREE).unwrap();
        assert_eq!(rows.len(), 10);
        for row in &rows {
            assert!(row.parallel.abs() < 1e-3 && row.spreading.abs() > 5e-3, "{row:?}");
            assert!(row.second_order.abs() < 0.02, "{row:?}");
        }
        let without = compare(5.0, &CURVATURES, &[0.3], 0.0, DEFAULT_DEGREE).unwrap();
        // The golden section finds distances, not places: nothing is lost in the square.
        assert!(without.iter().all(|row| (row.spreading - row.parallel).abs() < 1e-9), "{without:?}");
    }

    /// On a plane the section sees the neighbour cos β nearer than it is, and its track square to the
    /// section.
    #[test]
    fn on_a_plane_the_error_of_spreading_passes_is_that_of_the_closed_form() {
        let (r, s, angle) = (5.0f64, 0.6f64, 10f64.to_radians());
        let row = compare(r, &[0.0], &[s], angle, DEFAULT_DEGREE).unwrap()[0];
        let height = |half: f64| r - (r * r - half * half).sqrt();
        let (seen, real) = (0.5 * s * angle.cos(), s / (1.0 + angle.cos()));
        assert!((row.spreading - (height(seen) / height(real) - 1.0)).abs() < 1e-8, "{row:?}");
        assert!(row.spreading < -0.04);
    }

    #[test]
    fn what_cannot_be_compared_is_refused_or_left_out() {
        assert!(matches!(compare(5.0, &[0.25], &[0.5], 0.1, 4), Err(ScallopError::DoesNotFit { .. })));
        assert!(compare(5.0, &[0.0], &[0.5], 1.0, 4).is_err());
        assert!(compare(5.0, &[0.0], &[0.5], f64::NAN, 4).is_err());
        assert_eq!(compare(5.0, &[0.0], &[0.5, 11.0], 0.1, 4).unwrap().len(), 1);
    }
}
