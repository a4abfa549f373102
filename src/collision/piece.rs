//! One convex piece of a tool or of a machine that stands somewhere, and its least distance from a triangle.
//!
//! The signed distance `d` is a convex function of the place, so that its gradient g at p supports it:
//! `d(q) >= d(p) + g·(q − p)`. Where the least of a triangle's plane lies off the triangle, a side between
//! the two holds the least of the triangle. Of a solid of revolution `d` is over a plane symmetric about the
//! plane through the axis square to it, hence least in that one: the least of a plane is the least along a
//! line. Of a box it has a closed form. Lines are searched between two supporting lines whose crossing bounds
//! the least from below.

use cutter::Solid;
use geometry::{Point3, Vector3};
use motion::ClPoint;

/// How far above the true one a least distance may lie, mm; each triangle takes two such searches. Less is
/// lost in rounding, more shows in what depends on 1e-9.
const TOLERANCE: f64 = 2.5e-10;

/// Steps along a line at most. A dozen suffice; what is left then is rounding.
const MOST_STEPS: usize = 100;

/// A tool axis nearer than this (sine) to the normal of a plane is square to it: then every direction is as
/// good, and costs less than this times the size of the tool.
const SQUARE: f64 = 1e-12;

/// One convex piece of a tool at a location.
#[derive(Clone, Copy)]
pub struct ToolPiece<'a> {
    pub solid: &'a Solid,
    pub index: usize,
    pub at: ClPoint,
}

/// Signed distance of a place, and a vector by which it is supported there.
#[derive(Clone, Copy)]
pub struct Sample {
    pub distance: f64,
    pub gradient: Vector3,
}

/// A place with its distance.
#[derive(Clone, Copy)]
pub struct NearPlace {
    pub point: Point3,
    pub distance: f64,
}

/// A place on a line.
#[derive(Clone, Copy)]
pub struct OnLine {
    s: f64,
    distance: f64,
    slope: f64,
}

/// A convex body that stands somewhere.
pub trait Convex: Copy {
    /// A place that it turns about.
    fn origin(&self) -> Point3;

    /// The signed distance of a place, and what supports it there.
    fn sample(&self, q: &Point3) -> Sample;

    /// It lies within this of its origin along the unit vector `u`.
    fn support(&self, u: &Vector3) -> f64;

    /// The nearest place of the plane of a triangle with the unit normal `normal`, if it can lie on the
    /// triangle.
    fn lowest_of_plane(&self, corners: &[Point3; 3], normal: &Vector3) -> Option<NearPlace>;

    /// The unit normal of a triangle, toward the side from which the piece can be farther away, and the
    /// signed distance of its plane from the piece: no place of the triangle is nearer. Unlike a gradient it
    /// is good beside sharp edges too.
    fn off_plane(&self, corners: &[Point3; 3]) -> (Vector3, f64) {
        let normal = (corners[1] - corners[0]).cross(&(corners[2] - corners[0])).normalize();
        let off = |u: Vector3| (u, u.dot(&(corners[0] - self.origin())) - self.support(&u));
        let (one, other) = (off(normal), off(-normal));
        if one.1 > other.1 { one } else { other }
    }

    /// The nearest place of a triangle, if it is nearer than `limit`.
    fn nearest_on(&self, corners: &[Point3; 3], limit: f64) -> Option<NearPlace> {
        let centre = middle(corners);
        let inside = self.sample(&centre);
        if inside.distance + least_rise(&inside.gradient, &centre, corners) >= limit {
            return None;
        }
        let (normal, off) = self.off_plane(corners);
        if off >= limit {
            return None;
        }
        let mut best = Nearest { distance: limit, point: None };
        best.take(&centre, inside.distance);
        let samples = corners.map(|corner| self.sample(&corner));
        for (corner, sample) in corners.iter().zip(&samples) {
            best.take(corner, sample.distance);
        }
        // Mostly one corner supports the whole triangle.
        let settled = |(corner, s): (&Point3, &Sample)| {
            s.distance + least_rise(&s.gradient, corner, corners) >= best.distance - TOLERANCE
        };
        if corners.iter().zip(&samples).any(settled) {
            return best.place();
        }
        let sides = [0, 1, 2].map(|k| corners[(k + 1) % 3] - corners[k]);
        let mut beyond = [true; 3];
        if let Some(place) = self.lowest_of_plane(corners, &normal) {
            let inward = sides[0].cross(&sides[1]);
            beyond = [0, 1, 2].map(|k| inward.dot(&sides[k].cross(&(place.point - corners[k]))) < 0.0);
            if beyond == [false; 3] {
                best.take(&place.point, place.distance);
                return best.place();
            }
        }
        for k in (0..3).filter(|&k| beyond[k]) {
            let length = sides[k].norm();
            let along = sides[k] / length;
            let end = |corner: usize, s: f64| OnLine {
                s,
                distance: samples[corner].distance,
                slope: samples[corner].gradient.dot(&along),
            };
            let low =
                self.least_along(&corners[k], &along, end(k, 0.0), end((k + 1) % 3, length), best.distance);
            best.take(&(corners[k] + along * low.s), low.distance);
        }
        best.place()
    }

    /// What a line, with the unit direction `along`, has at a place.
    fn on_line(&self, origin: &Point3, along: &Vector3, s: f64) -> OnLine {
        let sample = self.sample(&(origin + along * s));
        OnLine { s, distance: sample.distance, slope: sample.gradient.dot(along) }
    }

    /// The least along a line between two places. Gives up where no place is below `limit`.
    fn least_along(
        &self,
        origin: &Point3,
        along: &Vector3,
        mut a: OnLine,
        mut b: OnLine,
        limit: f64,
    ) -> OnLine {
        if a.slope >= 0.0 {
            return a;
        }
        if b.slope <= 0.0 {
            return b;
        }
        let mut quick = true;
        for _ in 0..MOST_STEPS {
            let lower = if a.distance < b.distance { a } else { b };
            let width = b.s - a.s;
            let crossing = (b.distance - a.distance - b.slope * width) / (a.slope - b.slope);
            let bound = a.distance + a.slope * crossing;
            if bound >= lower.distance.min(limit) - TOLERANCE {
                return lower;
            }
            let s = if quick { cubic(&a, &b) } else { a.s + crossing };
            // By rounding a step may leave the stretch.
            let s = if s > a.s && s < b.s { s } else { a.s + 0.5 * width };
            let between = self.on_line(origin, along, s);
            if between.slope < 0.0 {
                a = between;
            } else {
                b = between;
            }
            quick = b.s - a.s < 0.5 * width || !quick;
        }
        if a.distance < b.distance { a } else { b }
    }
}

impl Convex for ToolPiece<'_> {
    fn origin(&self) -> Point3 {
        self.at.tip
    }

    #[inline]
    fn sample(&self, q: &Point3) -> Sample {
        let axis = &self.at.axis;
        let away = q - self.at.tip;
        let z = away.dot(axis);
        let outward = away - axis * z;
        let rho = outward.norm();
        let foot = self.solid.piece_foot(self.index, rho, z);
        // On the axis the mean of all gradients supports the distance as well as any.
        let radial = if rho > 0.0 { foot.gradient[0] / rho } else { 0.0 };
        Sample { distance: foot.distance, gradient: outward * radial + axis * foot.gradient[1] }
    }

    fn support(&self, u: &Vector3) -> f64 {
        let along = u.dot(&self.at.axis);
        self.solid.piece_support(self.index, (u - self.at.axis * along).norm(), along)
    }

    fn lowest_of_plane(&self, corners: &[Point3; 3], normal: &Vector3) -> Option<NearPlace> {
        let (tip, axis) = (self.at.tip, self.at.axis);
        let origin = tip - normal * (tip - corners[0]).dot(normal);
        let along = (axis - normal * axis.dot(normal))
            .try_normalize(SQUARE)
            .unwrap_or_else(|| (corners[1] - corners[0]).normalize());
        let reach = corners.map(|c| (c - origin).dot(&along));
        let [low, high] = [
            reach.iter().copied().fold(f64::INFINITY, f64::min),
            reach.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        ];
        let a = self.on_line(&origin, &along, low);
        let b = self.on_line(&origin, &along, high);
        if a.slope > 0.0 || b.slope < 0.0 {
            return None;
        }
        let low = self.least_along(&origin, &along, a, b, f64::INFINITY);
        Some(NearPlace { point: origin + along * low.s, distance: low.distance })
    }
}

/// The lowest place of the cubic through two places that fall toward each other.
fn cubic(a: &OnLine, b: &OnLine) -> f64 {
    let width = b.s - a.s;
    let c = a.slope + b.slope - 3.0 * (b.distance - a.distance) / width;
    let d = (c * c - a.slope * b.slope).sqrt();
    b.s - width * (b.slope + d - c) / (b.slope - a.slope + 2.0 * d)
}

/// The nearest place so far.
struct Nearest {
    distance: f64,
    point: Option<Point3>,
}

impl Nearest {
    fn take(&mut self, point: &Point3, distance: f64) {
        if distance < self.distance {
            *self = Self { distance, point: Some(*point) };
        }
    }

    fn place(&self) -> Option<NearPlace> {
        self.point.map(|point| NearPlace { point, distance: self.distance })
    }
}

pub fn middle(corners: &[Point3; 3]) -> Point3 {
    Point3::from((corners[0].coords + corners[1].coords + corners[2].coords) / 3.0)
}

/// By how much a plane through `at` rises at the lowest corner; below zero where it falls.
fn least_rise(gradient: &Vector3, at: &Point3, corners: &[Point3; 3]) -> f64 {
    corners.iter().map(|c| gradient.dot(&(c - at))).fold(f64::INFINITY, f64::min)
}
