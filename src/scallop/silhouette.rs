//! The outline of a cutter seen along the feed, and where it stands a given height over the surface.
//!
//! A cutter that is fed straight on leaves a groove with the outline of its shadow. That outline is convex,
//! and each of its places is the one where the cutter's surface has the place's normal
//! `d(φ) = sin φ·b − cos φ·n`: φ turns from the contact (0) toward `b`, across the feed. In the frame of
//! contact, `x` along `b` and `y` along the normal,
//!
//! ```text
//! P(φ) = (p·b, p·n),   P′(φ) = ϱ(φ) (cos φ, sin φ),   ϱ = r (1 − q²) + (ρ/sin λ) q²
//! ```
//!
//! with p the place of the profile of slope λ, at ρ from the axis, r the radius of its arc and q the share of
//! the outline's tangent along the parallel (Blaschke: radii of curvature of a shadow are those of the
//! support along it). A place stands `h` over a surface of curvature κ across the feed where
//! `y = h + κ (x² + y² − h²)/2`; nothing in that cancels as κ goes to zero. Cones and discs are jumps of P,
//! edges are stretches of φ without one: the bracket closes around a jump, and what crosses it is a straight
//! line.

use cutter::{Cutter, Profile};
use geometry::Vector3;

/// Steps of the iteration. Halving alone takes the range of φ to [`NARROW`] in 37 of them.
const MOST_STEPS: usize = 60;

/// φ is found where the height is off by less than this share of the wanted one.
const PRECISION: f64 = 1e-11;

/// A bracket of φ narrower than this, rad, holds a jump or an edge; the chord across it lies inside the
/// outline.
const NARROW: f64 = 1e-11;

/// The outline's radius of curvature at the contact is found after this share of the greatest turn.
const BEGIN: f64 = 1e-7;

/// A cutter at its contact, seen along the feed; lengths mm.
pub(crate) struct Silhouette<'a> {
    profile: &'a Profile,
    /// Outward normal of the surface, and across the feed, in the frame of the tool.
    n: Vector3,
    b: Vector3,
    /// Place of the contact in that frame.
    contact: Vector3,
}

/// A place of the outline.
#[derive(Clone, Copy)]
struct OnOutline {
    x: f64,
    y: f64,
    /// Radius of curvature; 0 at edges and on jumps.
    bend: f64,
}

/// The surface across the feed, and the height over it.
#[derive(Clone, Copy)]
pub(crate) struct Over {
    /// Curvature, 1/mm, positive concave.
    pub curvature: f64,
    /// Height, mm.
    pub height: f64,
    /// Places farther away than this, mm, are not of interest.
    pub farthest: f64,
}

impl Over {
    /// How much higher a place stands than asked, mm: the sign is exact, the value to first order.
    fn excess(&self, p: &OnOutline) -> f64 {
        p.y - self.height - 0.5 * self.curvature * (p.x * p.x + p.y * p.y - self.height * self.height)
    }

    /// Whether a place lies beyond the middle of a hollow: a long side may leave it again on the other side.
    fn is_beyond(&self, p: &OnOutline) -> bool {
        self.curvature * p.y > 1.0
    }

    /// Its derivative along the outline's tangent.
    fn slope(&self, p: &OnOutline, [x, y]: [f64; 2]) -> f64 {
        y - self.curvature * (p.x * x + p.y * y)
    }

    /// The way to it along the surface.
    fn arc(&self, p: &OnOutline) -> f64 {
        let straight = p.x / (1.0 - self.curvature * p.y);
        let angle = self.curvature * straight;
        if angle.abs() < 1e-5 {
            straight * (1.0 - angle * angle / 3.0)
        } else {
            angle.atan() / self.curvature
        }
    }
}

impl<'a> Silhouette<'a> {
    /// Of a cutter at a contact with outward normal `n`, seen square to `b`, both unit and in the frame of
    /// the tool.
    pub fn new(cutter: &'a Cutter, n: Vector3, b: Vector3) -> Self {
        let mut outline = Self { profile: cutter.profile(), n, b, contact: Vector3::zeros() };
        outline.contact = outline.place(&-n).0;
        outline
    }

    /// How far apart passes may lie on the surface so that their ridge stands no higher than asked, mm;
    /// infinite where the ridge does not rise to it within reach.
    pub fn width(&self, over: &Over) -> f64 {
        let other = Self { b: -self.b, ..*self };
        self.reach(over) + other.reach(over)
    }

    /// The place of the cutter with the outward normal `d`, and its radii of curvature along the meridian and
    /// the parallel.
    fn place(&self, d: &Vector3) -> (Vector3, [f64; 2]) {
        let profile = self.profile;
        let sine = (d.x * d.x + d.y * d.y).sqrt().min(1.0);
        let rho = profile.reach(sine);
        let on_arc = rho > profile.bottom_end && rho < profile.arc_end;
        let z = if on_arc {
            profile.centre_z + profile.corner * d.z
        } else {
            profile.height(rho.min(profile.radius))
        };
        if sine < 1e-12 {
            return (Vector3::new(0.0, 0.0, z), [profile.corner; 2]);
        }
        let meridian = if on_arc { profile.corner } else { 0.0 };
        (Vector3::new(d.x / sine * rho, d.y / sine * rho, z), [meridian, rho / sine])
    }

    fn at(&self, phi: f64) -> OnOutline {
        let (sin, cos) = phi.sin_cos();
        let d = self.b * sin - self.n * cos;
        let (p, [meridian, parallel]) = self.place(&d);
        let (p, along) = (p - self.contact, self.b * cos + self.n * sin);
        let level = d.x * d.x + d.y * d.y;
        let share = if level > 1e-24 { (along.y * d.x - along.x * d.y).powi(2) / level } else { 0.0 };
        OnOutline {
            x: p.dot(&self.b),
            y: p.dot(&self.n),
            bend: meridian * (1.0 - share).max(0.0) + parallel * share,
        }
    }

    /// The way along the surface, toward `b`, to where the outline stands as high as asked.
    fn reach(&self, over: &Over) -> f64 {
        // Above this the outline is the cutter's side, along its axis.
        let upright = self.n.z.atan2(self.b.z);
        if upright.is_nan() || upright <= 0.0 {
            return f64::INFINITY;
        }
        let high = |p: &OnOutline| p.x >= over.farthest || over.excess(p) >= 0.0 || over.is_beyond(p);
        let (mut low, mut top) = (0.0, upright.min(std::f64::consts::FRAC_PI_2));
        let (mut below, mut above) = (OnOutline { x: 0.0, y: 0.0, bend: 0.0 }, self.at(top));
        if !high(&above) {
            // Where the side leans back over the surface, the widest place of the outline is the last to
            // leave a ridge.
            return if upright > top { over.arc(&above) } else { self.up_the_side(over, &above) };
        }
        // A flat at the contact is behind the cutter's first turn.
        let turned = BEGIN * top;
        let begin = self.at(turned);
        let steps = if high(&begin) {
            above = begin;
            0
        } else {
            (low, below) = (turned, begin);
            MOST_STEPS
        };
        // As if the outline were the circle that it begins with.
        let start =
            (2.0 * over.height / (begin.bend * (1.0 - over.curvature * begin.bend)).max(1e-300)).sqrt();
        let mut phi = start;
        for _ in 0..steps {
            if !(phi > low && phi < top) {
                phi = 0.5 * (low + top);
            }
            let here = self.at(phi);
            let excess = over.excess(&here);
            if high(&here) {
                (top, above) = (phi, here);
            } else {
                (low, below) = (phi, here);
            }
            if excess.abs() <= PRECISION * over.height || top - low <= NARROW {
                break;
            }
            let (sin, cos) = phi.sin_cos();
            // The height over the contact goes with the square of φ.
            let rise = here.bend * over.slope(&here, [cos, sin]);
            phi = phi * (1.0 - 2.0 * excess / (rise * phi)).max(0.0).sqrt();
        }
        let crossing = between(over, &below, &above);
        if over.excess(&above) < 0.0 {
            let within = crossing.filter(|p| p.x < over.farthest);
            return within.map_or(f64::INFINITY, |p| over.arc(&p));
        }
        over.arc(&crossing.unwrap_or(below))
    }

    /// As [`Silhouette::reach`] from the last place of the outline, along the cutter's side.
    fn up_the_side(&self, over: &Over, from: &OnOutline) -> f64 {
        let on = from.along([self.b.z, self.n.z], over);
        on.filter(|on| on.x < over.farthest).map_or(f64::INFINITY, |on| over.arc(&on))
    }
}

impl OnOutline {
    /// Where a straight line in the direction `[x, y]` stands as high as asked; `None` where it never does.
    fn along(&self, [x, y]: [f64; 2], over: &Over) -> Option<Self> {
        let (lacking, slope) = (-over.excess(self), over.slope(self, [x, y]));
        // The excess is slope t − κ t²/2 (x² + y²) less what is lacking.
        let bend = over.curvature * (x * x + y * y);
        let root = slope * slope - 2.0 * bend * lacking;
        let t = 2.0 * lacking / (slope + root.max(0.0).sqrt());
        (root >= 0.0 && t.is_finite()).then_some(Self { x: self.x + t * x, y: self.y + t * y, bend: 0.0 })
    }
}

/// Where the chord from a place below the height to one above, or beyond, first reaches it: it lies inside
/// the outline, so that the way is never too long.
fn between(over: &Over, below: &OnOutline, above: &OnOutline) -> Option<OnOutline> {
    let chord = [above.x - below.x, above.y - below.y];
    below.along(chord, over).filter(|p| p.x <= above.x)
}
