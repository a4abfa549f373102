//! The section across the feed as a polynomial, and the scallop measured to it: how a scallop is calculated
//! from path points alone, with no surface at hand.
//!
//! The plane across the feed at a contact is the section. Contacts of neighbouring passes are projected into
//! it, a polynomial is fitted to them, two circles with the cutter's radius stand around the cutter locations
//! of two passes (each its contact plus the radius along the surface normal in the section), and the distance
//! of their meeting from the polynomial is the height.
//!
//! Where tracks are parallel and the surface bends across them only, that is exact but for the fit. Elsewhere
//! the neighbour's contact lies before or behind the section and is taken for a point of it, its pass crosses
//! the section at an angle and is taken for a circle: what that costs is told by [`super::compare`].

use nalgebra::{DMatrix, DVector};

use super::ScallopError;
use geometry::{Point2, Point3, Vector2, Vector3};
use motion::CcPoint;

/// Degree of the polynomial where none is asked for. On circles seen by three passes on either side it errs
/// by less than 0.2 % of the height while three steps are below 0.4 of the circle's radius; a parabola and a
/// cubic by ten times as much and more, and the fifth degree by no less.
pub const DEFAULT_DEGREE: usize = 4;

/// Greatest degree: beyond, contacts within a few steps no longer tell the coefficients apart.
pub const MAX_DEGREE: usize = 9;

/// Abscissae nearer than this share of the widest one are one and the same.
const DISTINCT: f64 = 1e-9;

/// Newton's steps to the foot on the polynomial; it begins above the foot, and a few settle it.
const FOOT_STEPS: usize = 32;

/// The plane across the feed at a contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SectionFrame {
    /// The contact, mm.
    pub origin: Point3,
    /// Unit tangent across the feed.
    pub across: Vector3,
    /// Unit surface normal.
    pub up: Vector3,
}

impl SectionFrame {
    /// A point seen along the feed, mm: across, and up.
    pub fn project(&self, p: &Point3) -> Point2 {
        Point2::from(self.project_vector(&(p - self.origin)))
    }

    fn project_vector(&self, v: &Vector3) -> Vector2 {
        Vector2::new(v.dot(&self.across), v.dot(&self.up))
    }
}

/// A section as a polynomial.
#[derive(Debug, Clone, PartialEq)]
pub struct SectionFit {
    frame: SectionFrame,
    /// Of the powers of `x/scale`, from the constant on, mm.
    coefficients: Vec<f64>,
    scale: f64,
    /// Greatest distance of a contact from the polynomial, up or down, mm.
    pub residual: f64,
}

/// Fits a polynomial of `degree` to contacts seen along the feed, by least squares.
///
/// # Errors
/// [`ScallopError::Range`] for a degree that is none; [`ScallopError::Fit`] for fewer distinct places across
/// the feed than the degree and one.
pub fn fit_section(
    frame: SectionFrame,
    contacts: &[CcPoint],
    degree: usize,
) -> Result<SectionFit, ScallopError> {
    if !(1..=MAX_DEGREE).contains(&degree) {
        let wanted = "a whole number from 1 to 9";
        return Err(ScallopError::Range {
            what: "the degree of the polynomial",
            value: degree as f64,
            wanted,
        });
    }
    let places: Vec<Point2> = contacts.iter().map(|c| frame.project(&c.point)).collect();
    let scale = places.iter().map(|p| p.x.abs()).fold(0.0, f64::max);
    let mut across: Vec<f64> = places.iter().map(|p| p.x).filter(|x| x.is_finite()).collect();
    across.sort_by(f64::total_cmp);
    across.dedup_by(|a, b| (*a - *b).abs() <= DISTINCT * scale);
    let too_few = ScallopError::Fit { degree, needed: degree + 1, given: across.len() };
    if across.len() <= degree || places.iter().any(|p| !(p.x.is_finite() && p.y.is_finite())) {
        return Err(too_few);
    }
    let matrix = DMatrix::from_fn(places.len(), degree + 1, |i, k| (places[i].x / scale).powi(k as i32));
    let heights = DVector::from_iterator(places.len(), places.iter().map(|p| p.y));
    let solved = matrix.svd(true, true).solve(&heights, 1e-14);
    let coefficients: Vec<f64> = solved.map_err(|_| too_few)?.iter().copied().collect();
    let mut fit = SectionFit { frame, coefficients, scale, residual: 0.0 };
    fit.residual = places.iter().map(|p| (fit.jet(p.x)[0] - p.y).abs()).fold(0.0, f64::max);
    Ok(fit)
}

impl SectionFit {
    /// Height of the polynomial over the tangent plane, mm, its slope, and its second derivative, 1/mm, `x`
    /// mm across the feed.
    pub fn jet(&self, x: f64) -> [f64; 3] {
        let t = x / self.scale;
        let horner = |[p, d, dd]: [f64; 3], c: &f64| [p * t + c, d * t + p, dd * t + 2.0 * d];
        let [p, d, dd] = self.coefficients.iter().rev().fold([0.0; 3], horner);
        [p, d / self.scale, dd / (self.scale * self.scale)]
    }

    /// Signed distance of a place of the section from the polynomial, mm, positive above.
    pub fn distance(&self, at: &Point2) -> f64 {
        let mut x = at.x;
        for _ in 0..FOOT_STEPS {
            let [p, d, dd] = self.jet(x);
            let (gap, bend) = (p - at.y, 1.0 + d * d + (p - at.y) * dd);
            let step = (x - at.x + gap * d) / bend.max(0.1);
            x -= step;
            if step.abs() <= 1e-14 * self.scale {
                break;
            }
        }
        let [p, d, _] = self.jet(x);
        // Up is square to the slope.
        ((at.y - p) - (at.x - x) * d) / (1.0 + d * d).sqrt()
    }

    /// Scallop height, mm, between two contacts of a ball of radius `r`, mm: circles around their cutter
    /// locations in the section, measured to the polynomial.
    ///
    /// # Errors
    /// [`ScallopError::Apart`] where the circles do not meet, or a contact's normal lies along the feed.
    pub fn scallop(&self, contacts: &[CcPoint; 2], r: f64) -> Result<f64, ScallopError> {
        super::error::positive("the radius of the ball", r)?;
        let centre = |c: &CcPoint| {
            let up = self.frame.project_vector(&c.normal).try_normalize(1e-9)?;
            Some(self.frame.project(&c.point) + up * r)
        };
        let [Some(a), Some(b)] = contacts.each_ref().map(centre) else {
            return Err(ScallopError::Apart { distance: f64::INFINITY, ball: r });
        };
        let half = 0.5 * (b - a);
        let inside = (r - half.norm()) * (r + half.norm());
        let along = half.try_normalize(1e-300).filter(|_| inside >= 0.0);
        let along = along.ok_or(ScallopError::Apart { distance: 2.0 * half.norm(), ball: r })?;
        let up = Vector2::new(-along.y, along.x) * along.x.signum();
        Ok(self.distance(&(nalgebra::center(&a, &b) - up * inside.sqrt())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::BallSection;

    /// Contacts of parallel passes on a cylinder along x, steps of `arc`, from `first` on.
    fn passes(k: f64, arc: f64, first: i32, count: i32) -> Vec<CcPoint> {
        let at = |n: i32| {
            let angle = arc * k * f64::from(n);
            // Other places along the feed must not matter.
            let along = 0.3 * f64::from(n * n);
            let (y, z) = if k == 0.0 {
                (arc * f64::from(n), 0.0)
            } else {
                (angle.sin() / k, 2.0 * (0.5 * angle).sin().powi(2) / k)
            };
            CcPoint { point: Point3::new(along, y, z), normal: Vector3::new(0.0, -angle.sin(), angle.cos()) }
        };
        (first..first + count).map(at).collect()
    }

    /// The plane across a feed along x.
    fn across_x(contact: &CcPoint) -> SectionFrame {
        let across = contact.normal.cross(&Vector3::x()).normalize();
        SectionFrame { origin: contact.point, across, up: contact.normal }
    }

    fn scallop(k: f64, arc: f64, r: f64, degree: usize) -> f64 {
        let contacts = passes(k, arc, -2, 6);
        let frame = across_x(&contacts[2]);
        fit_section(frame, &contacts, degree).unwrap().scallop(&[contacts[2], contacts[3]], r).unwrap()
    }

    #[test]
    fn parallel_tracks_on_planes_and_cylinders_have_the_exact_height() {
        let plane = scallop(0.0, 0.5, 3.0, DEFAULT_DEGREE);
        assert!((plane - (3.0 - 8.9375f64.sqrt())).abs() < 1e-13, "{plane}");
        for k in [-0.1, -0.02, 0.02, 0.1] {
            let exact = BallSection::new(5.0, k).unwrap().height(0.6).unwrap();
            let off = scallop(k, 0.6, 5.0, DEFAULT_DEGREE) / exact - 1.0;
            assert!(off.abs() < 1e-4, "{k}: {off}");
        }
    }

    #[test]
    fn one_degree_more_errs_less_on_a_circle() {
        let exact = BallSection::new(5.0, 0.1).unwrap().height(1.5).unwrap();
        let off = |degree| (scallop(0.1, 1.5, 5.0, degree) / exact - 1.0f64).abs();
        assert!(off(2) > 10.0 * off(4), "{} {}", off(2), off(4));
    }

    #[test]
    fn contacts_that_do_not_tell_are_refused() {
        let contacts = passes(0.02, 0.6, -1, 4);
        let frame = across_x(&contacts[1]);
        let error = fit_section(frame, &contacts, 4).unwrap_err().to_string();
        assert!(error.contains("at 5 or more distances") && error.contains("4 were given"), "{error}");
        let twice: Vec<CcPoint> = contacts.iter().chain(&contacts).copied().collect();
        assert!(fit_section(frame, &twice, 4).is_err(), "the same places again tell nothing");
        assert!(fit_section(frame, &contacts, 0).is_err() && fit_section(frame, &contacts, 10).is_err());
        let mut bad = passes(0.02, 0.6, -2, 6);
        bad[3].point.z = f64::NAN;
        assert!(fit_section(frame, &bad, 3).is_err());
        let fit = fit_section(frame, &contacts, 3).unwrap();
        assert!(
            fit.scallop(&[contacts[1], contacts[2]], 0.2).unwrap_err().to_string().contains("do not meet")
        );
    }

    #[test]
    fn distances_are_those_of_a_parabola() {
        let at = |x: f64| CcPoint { point: Point3::new(0.0, x, 0.25 * x * x), normal: Vector3::z() };
        let frame = SectionFrame { origin: Point3::origin(), across: Vector3::y(), up: Vector3::z() };
        let fit = fit_section(frame, &[-2.0, -1.0, 0.0, 1.0, 2.0].map(at), 2).unwrap();
        assert!(fit.residual < 1e-13);
        let foot = Vector2::new(0.8, 0.16);
        let up = Vector2::new(-0.4, 1.0).normalize();
        for height in [-0.3, 0.01, 0.4] {
            assert!((fit.distance(&Point2::from(foot + up * height)) - height).abs() < 1e-12);
        }
    }
}
