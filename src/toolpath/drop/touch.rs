//! One triangle under a falling cutter, in closed form.
//!
//! The tip comes to rest at the maximum over the triangle of `F(q) = q.z − f(|q.xy − c|)`, with `f`
//! the cutter's profile and `c` the axis. `f` is convex and never falls, so `F` is concave: first
//! look for its maximum on the triangle's plane; where that lies outside, the maximum over the
//! triangle lies on a side that separates the two. (The contacts known as facet, edge and vertex
//! contact since Bobrow 1985.)

use crate::cutter::{Cutter, CutterShape};
use crate::geometry::{Feature, Point3, Vector3};

/// The profile of [`Cutter`] with its constants worked out, since a drop evaluates it some hundred
/// times; optionally grown on all sides.
#[derive(Debug, Clone, Copy)]
pub(super) struct Profile {
    /// Radius of the flat disc.
    pub(super) flat: f64,
    /// Corner radius.
    pub(super) corner: f64,
    /// Where the arc ends and the cone begins.
    pub(super) arc_end: f64,
    /// Height of the profile there.
    arc_end_height: f64,
    /// Slope of the cone; infinite where a cylinder follows the arc.
    pub(super) cone: f64,
    /// Largest radius.
    pub(super) radius: f64,
    /// A cutter grown by this much has its tip that much lower.
    grown: f64,
}

impl Profile {
    /// The profile of `cutter`, grown by `growth` in every direction (0: as it is). Growing adds
    /// to the corner radius and to the radius: a flat end becomes a bull nose.
    pub(super) fn of(cutter: &Cutter, growth: f64) -> Self {
        let (flat, corner) = (cutter.flat_radius(), cutter.corner_radius() + growth);
        let (sin, cos) = cutter.half_angle().sin_cos();
        let radius = cutter.radius() + growth;
        let tapered = cutter.shape() == CutterShape::Taper;
        Self {
            flat,
            corner,
            arc_end: if tapered { (flat + corner * cos).min(radius) } else { radius },
            arc_end_height: if tapered { corner * (1.0 - sin) } else { corner },
            cone: if tapered { cos / sin } else { f64::INFINITY },
            radius,
            grown: growth,
        }
    }

    /// Height above the (ungrown) tip at distance `rho` from the axis, for `rho` up to the radius.
    pub(super) fn height(&self, rho: f64) -> f64 {
        self.height_squared(rho * rho)
    }

    /// As [`Profile::height`], of the squared distance: a ball needs no other root.
    pub(super) fn height_squared(&self, rho2: f64) -> f64 {
        if self.flat == 0.0 && rho2 <= self.arc_end * self.arc_end {
            return self.arc(rho2);
        }
        let rho = rho2.sqrt();
        let x = rho - self.flat;
        if x <= 0.0 {
            -self.grown
        } else if rho <= self.arc_end || self.cone.is_infinite() {
            self.arc(x * x)
        } else {
            self.arc_end_height + (rho - self.arc_end) * self.cone - self.grown
        }
    }

    fn arc(&self, x2: f64) -> f64 {
        self.corner - (self.corner * self.corner - x2).max(0.0).sqrt() - self.grown
    }

    /// How far from the axis the profile is as steep as `slope >= 0`: where a plane of that slope
    /// touches it.
    fn reach(&self, slope: f64, sine: f64) -> f64 {
        if slope == 0.0 {
            0.0
        } else if slope > self.cone {
            self.radius
        } else {
            (self.flat + self.corner * sine).min(self.arc_end)
        }
    }

    /// Where on a line the cutter touches: the line passes the axis at distance `h` and rises by
    /// `slope` per mm; answers the place along it, counted from the point next to the axis, or
    /// `None` where the line passes by the cutter.
    fn along_line(&self, h: f64, slope: f64) -> Option<f64> {
        let width = self.radius * self.radius - h * h;
        if width < 0.0 {
            return None;
        }
        let rise = slope.abs();
        let place = if rise == 0.0 {
            0.0
        } else if self.flat == 0.0 && self.cone.is_infinite() {
            // A ball: the line sees a circle.
            width.sqrt() * rise / rise.hypot(1.0)
        } else {
            self.along_line_general(h, rise).min(width.sqrt())
        };
        Some(place.copysign(slope))
    }

    fn along_line_general(&self, h: f64, rise: f64) -> f64 {
        let arc_width = (self.arc_end * self.arc_end - h * h).max(0.0).sqrt();
        // Beyond the end of the arc while the line still outruns the cone there?
        if h >= self.arc_end || rise * self.arc_end > self.cone * arc_width {
            let share = rise / self.cone;
            return if share < 1.0 {
                (h * share / (1.0 - share * share).sqrt()).max(arc_width)
            } else {
                f64::INFINITY
            };
        }
        if self.corner == 0.0 {
            return (self.flat * self.flat - h * h).max(0.0).sqrt();
        }
        torus_along_line(self.flat, self.corner, h, rise).min(arc_width)
    }
}

/// Most Newton steps for the torus; from the bounds below it takes two to six.
const MAX_STEPS: usize = 60;

/// Where a torus (ring radius `e`, tube radius `r`) touches a line that passes its axis at
/// distance `h < e + r` and rises by `rise > 0` per mm.
///
/// The contact normal is perpendicular to the line: `C` (0..1) its part across the line in the
/// plan view, `√(1 − C²)` the rest, of which the share `s = sin(atan rise)` lies along the line.
/// Then `h = r C + e C / √(C² + (1 − C²) s²) = H(C)`. `H` is concave and grows, so Newton's method
/// from below never overshoots.
fn torus_along_line(e: f64, r: f64, h: f64, rise: f64) -> f64 {
    let s = rise / rise.hypot(1.0);
    let s2 = s * s;
    // H(C) <= r C + e and H(C) <= (r + e / s) C bound C from below.
    let mut c = (h / (r + e / s)).max((h - e) / r).clamp(0.0, 1.0);
    for _ in 0..MAX_STEPS {
        let q2 = s2 + (1.0 - s2) * c * c;
        let q = q2.sqrt();
        let step = (h - r * c - e * c / q) / (r + e * s2 / (q2 * q));
        c = (c + step).clamp(0.0, 1.0);
        if step <= f64::EPSILON * c {
            break;
        }
    }
    let rest2 = 1.0 - c * c;
    let sine2 = c * c + rest2 * s2;
    if sine2 == 0.0 {
        return 0.0;
    }
    // Along the line: the ring's centre line and the tube, both toward the normal's plan part.
    let along = rest2.max(0.0).sqrt() * s;
    r * along + e * along / sine2.sqrt()
}

/// A triangle prepared for one profile.
#[derive(Debug, Clone, Copy)]
pub(super) struct Facet {
    corners: [Point3; 3],
    /// ∂z/∂x and ∂z/∂y of its plane.
    gradient: [f64; 2],
    /// From the axis to where the profile touches its plane.
    shift: [f64; 2],
    /// Tip height when resting on its plane, less the plane's height at the axis.
    lift: f64,
    /// +1 where its corners run counter-clockwise in the plan view, −1 clockwise, 0 where it is
    /// vertical.
    winding: f64,
}

/// Where a cutter rests on one triangle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Touch {
    /// Height of the tip.
    pub(super) tip_z: f64,
    /// Which part of the triangle.
    pub(super) feature: Feature,
    /// Place along the side, 0 to 1.
    along: f64,
}

/// A triangle counts as vertical where its plan view is less than this share of its area: then its
/// slope is rounding. Its sides still carry the cutter.
const VERTICAL: f64 = 1e-14;

impl Facet {
    pub(super) fn new(corners: [Point3; 3], profile: &Profile) -> Self {
        let [a, b, c] = corners;
        let normal: Vector3 = (b - a).cross(&(c - a)).normalize();
        if normal.z.abs() < VERTICAL {
            return Self { corners, gradient: [0.0; 2], shift: [0.0; 2], lift: 0.0, winding: 0.0 };
        }
        let sine = normal.x.hypot(normal.y);
        let slope = sine / normal.z.abs();
        let reach = profile.reach(slope, sine);
        // Uphill: against the horizontal part of the normal that points up.
        let winding = normal.z.signum();
        let uphill = if sine > 0.0 { -winding / sine } else { 0.0 };
        Self {
            corners,
            gradient: [-normal.x / normal.z, -normal.y / normal.z],
            shift: [normal.x * uphill * reach, normal.y * uphill * reach],
            lift: slope * reach - profile.height(reach),
            winding,
        }
    }

    /// Rests the cutter on this triangle alone; `None` where it passes by or where the tip would
    /// not come above `floor`.
    pub(super) fn touch(&self, profile: &Profile, x: f64, y: f64, floor: f64) -> Option<Touch> {
        let mut best: Option<Touch> = None;
        let mut sides = [true; 3];
        if self.winding != 0.0 {
            let a = &self.corners[0];
            let tip_z = a.z + self.lift + (self.gradient[0] * (x - a.x) + self.gradient[1] * (y - a.y));
            // Nothing on the triangle lifts the tip higher than its whole plane does.
            if tip_z <= floor {
                return None;
            }
            let at = [x + self.shift[0], y + self.shift[1]];
            sides = [0, 1, 2].map(|k| self.outside(k, at));
            if sides == [false; 3] {
                return Some(Touch { tip_z, feature: Feature::Face, along: 0.0 });
            }
        }
        for k in (0..3).filter(|&k| sides[k]) {
            let least = best.map_or(floor, |b| b.tip_z);
            best = self.touch_side(k, profile, x, y, least).or(best);
        }
        best
    }

    fn outside(&self, k: usize, p: [f64; 2]) -> bool {
        let (a, b) = (&self.corners[k], &self.corners[(k + 1) % 3]);
        self.winding * ((b.x - a.x) * (p[1] - a.y) - (b.y - a.y) * (p[0] - a.x)) < 0.0
    }

    fn touch_side(&self, k: usize, profile: &Profile, x: f64, y: f64, floor: f64) -> Option<Touch> {
        let end = (k + 1) % 3;
        let (a, b) = (&self.corners[k], &self.corners[end]);
        if a.z.max(b.z) - profile.height_squared(0.0) <= floor {
            return None;
        }
        let (dx, dy, dz) = (b.x - a.x, b.y - a.y, b.z - a.z);
        let (ax, ay) = (a.x - x, a.y - y);
        let length2 = dx * dx + dy * dy;
        let reach2 = profile.radius * profile.radius;
        let (along, rho2) = if length2 == 0.0 {
            (if dz > 0.0 { 1.0 } else { 0.0 }, ax * ax + ay * ay)
        } else {
            let length = length2.sqrt();
            let (ux, uy) = (dx / length, dy / length);
            let h = ax * uy - ay * ux;
            let start = ax * ux + ay * uy;
            let place = profile.along_line(h.abs(), dz / length)?;
            let place_on_side = place.clamp(start, start + length);
            let along = if place_on_side == start {
                0.0
            } else if place_on_side == start + length {
                1.0
            } else {
                (place_on_side - start) / length
            };
            // A place on the line within reach may lie at the radius up to rounding.
            let limit = if place_on_side == place { reach2 } else { f64::INFINITY };
            (along, (h * h + place_on_side * place_on_side).min(limit))
        };
        if rho2 > reach2 {
            return None;
        }
        let z = if along == 1.0 { b.z } else { a.z + dz * along };
        let tip_z = z - profile.height_squared(rho2);
        let feature = match along {
            0.0 => Feature::Corner(k),
            1.0 => Feature::Corner(end),
            _ => Feature::Side(k),
        };
        (tip_z > floor).then_some(Touch { tip_z, feature, along })
    }

    /// Barycentric coordinates of the place of contact of a cutter at `(x, y)`.
    pub(super) fn barycentric(&self, touch: &Touch, x: f64, y: f64) -> [f64; 3] {
        let mut weights = [0.0; 3];
        match touch.feature {
            Feature::Corner(k) => weights[k] = 1.0,
            Feature::Side(k) => {
                (weights[k], weights[(k + 1) % 3]) = (1.0 - touch.along, touch.along);
            }
            Feature::Face => {
                let p = [x + self.shift[0], y + self.shift[1]];
                let twice = |a: &Point3, b: &Point3| {
                    ((b.x - a.x) * (p[1] - a.y) - (b.y - a.y) * (p[0] - a.x)) * self.winding
                };
                let [a, b, c] = &self.corners;
                let areas = [twice(b, c), twice(c, a), twice(a, b)];
                let sum: f64 = areas.iter().sum();
                weights = areas.map(|w| w / sum);
            }
        }
        weights
    }

    /// The point with the given barycentric coordinates.
    pub(super) fn point(&self, barycentric: [f64; 3]) -> Point3 {
        Point3::from((0..3).map(|k| self.corners[k].coords * barycentric[k]).sum::<Vector3>())
    }
}
