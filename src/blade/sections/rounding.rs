//! The round trailing edge of a profile: an arc that both sides run into.
//!
//! Enters: a profile with a sharp trailing edge, and a radius. Leaves: where the arc takes over from the
//! sides, and its points; shares of the chord. The arc is tangent to both sides. Its curvature rises linearly
//! from 0 to that of the radius while it turns by an angle of easing (a clothoid), stays, and falls as it
//! rose. Without easing it is a circle; an interpolating cubic spline then answers the jump of curvature with
//! a hollow next to it, a twelfth of the circle's curvature deep however close the points are, in which an
//! offset of 12 radii crosses itself.

use super::naca::NacaProfile;
use geometry::{Point2, Vector2};

/// Greatest radius as a share of the half thickness: with more the arc reaches where the profile is thickest,
/// and hardly anything is left of it behind.
pub(super) const GREATEST_RADIUS: f64 = 0.8;

/// By how much each end of the arc turns before it has its radius, rad. More makes the edge wider (1.04 radii
/// to each side); less leaves a deeper hollow in splines.
pub(super) const EASING: f64 = 0.5;

/// Greatest length between neighbouring points of the arc, in radii: where the arc is a circle 14°, from
/// which a cubic spline departs by 1e-5 of the radius.
const STEP: f64 = 0.25;

/// Steps of the iteration; each gains a digit or more.
const MAX_STEPS: usize = 60;

/// Easings that are tried on either side of one without an arc. With more of them one is found nearer.
const OTHER_EASINGS: u32 = 100;

/// Where four-digit profiles are thickest.
const THICKEST: f64 = 0.3;

/// An arc behind a profile; shares of the chord.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct TailArc {
    pub radius: f64,
    pub easing: f64,
    /// Where it takes over from the upper and the lower side, as places on the camber line.
    pub touches: [f64; 2],
    /// Its beginning on the lower side, and its direction there, rad.
    start: Point2,
    heading: f64,
    /// How much it turns, rad.
    sweep: f64,
}

impl TailArc {
    /// The arc of `radius` and `easing` (0 to 1 rad) of a profile whose trailing edge is closed; `None` when
    /// the radius is more than [`GREATEST_RADIUS`] of the half thickness.
    ///
    /// Both sides have a corner at the greatest camber. The arcs of some easings would be tangent to a side
    /// neither ahead of its corner nor behind it; the nearest easing that has an arc is then taken.
    pub fn of(profile: &NacaProfile, radius: f64, easing: f64) -> Option<Self> {
        if radius.is_nan() || radius <= 0.0 || radius > GREATEST_RADIUS * profile.half_thickness(THICKEST)[0]
        {
            return None;
        }
        let further = (1..=OTHER_EASINGS).map(|k| f64::from(k) / f64::from(OTHER_EASINGS));
        let nearest_first = further.flat_map(|share| [easing * (1.0 - share), easing + share * EASING]);
        std::iter::once(easing).chain(nearest_first).find_map(|easing| Self::tangent(profile, radius, easing))
    }

    /// The arc of a radius and exactly an easing.
    ///
    /// Steps across a corner of a side may go to and fro for ever although there is an arc on one side of it.
    /// Each stretch between the corners is therefore tried alone, continued beyond its corner without one.
    fn tangent(profile: &NacaProfile, radius: f64, easing: f64) -> Option<Self> {
        let alone = |stretches: [bool; 2]| {
            let arc = Self::search(&stretches.map(|ahead| profile.continued(ahead)), radius, easing)?;
            (arc.touches.map(|x| profile.is_ahead(x)) == stretches).then_some(arc)
        };
        let stretches = [[false, false], [false, true], [true, false], [true, true]];
        Self::search(&[*profile; 2], radius, easing).or_else(|| stretches.into_iter().find_map(alone))
    }

    /// The arc of the upper side of one profile and the lower side of another, both of the same thickness.
    fn search(profile: &[NacaProfile; 2], radius: f64, easing: f64) -> Option<Self> {
        let first = fall(|x| profile[0].half_thickness(x)[0] - radius, THICKEST, 1.0);
        let mut arc = Self::between(profile, radius, easing, [first, first]);
        for _ in 0..MAX_STEPS {
            let [upper, lower] = arc.touches;
            let gap = arc.gap(profile);
            // The arc hardly changes while its ends move along the sides, so that their tangents give the
            // step.
            let (t, s) = (profile[0].tangent(upper, true), profile[1].tangent(lower, false));
            let across = t.perp(&s);
            let step = [s.perp(&gap) / across, t.perp(&gap) / across];
            let next = [upper + step[0], lower + step[1]];
            if !next.iter().all(|x| (0.0..=1.0).contains(x)) {
                return None;
            }
            arc = Self::between(profile, radius, easing, next);
            if step[0].abs().max(step[1].abs()) < 1e-15 {
                break;
            }
        }
        (arc.gap(profile).norm() < 1e-12).then_some(arc)
    }

    /// The arc that leaves the lower side at a place and turns as far as the upper side's direction at
    /// another.
    fn between(profile: &[NacaProfile; 2], radius: f64, easing: f64, touches: [f64; 2]) -> Self {
        let (upper, lower) = (-profile[0].tangent(touches[0], true), profile[1].tangent(touches[1], false));
        let heading = lower.y.atan2(lower.x);
        let sweep = (upper.y.atan2(upper.x) - heading).rem_euclid(std::f64::consts::TAU);
        let start = profile[1].point(touches[1], false);
        // Both easings together turn by no more than the arc.
        Self { radius, easing: easing.min(0.5 * sweep), touches, start, heading, sweep }
    }

    /// From the end of the arc to the upper side.
    fn gap(&self, profile: &[NacaProfile; 2]) -> Vector2 {
        profile[0].point(self.touches[0], true) - self.at(self.length())
    }

    /// Lengths at which easing ends and begins again, and at the end.
    fn breaks(&self) -> [f64; 3] {
        let ease = 2.0 * self.easing * self.radius;
        let core = (self.sweep - 2.0 * self.easing) * self.radius;
        [ease, ease + core, 2.0 * ease + core]
    }

    pub fn length(&self) -> f64 {
        self.breaks()[2]
    }

    /// Direction at a length from the start, rad.
    fn direction(&self, s: f64) -> f64 {
        let [rise, fall, end] = self.breaks();
        let eased = |s: f64| s * s / (4.0 * self.easing * self.radius * self.radius);
        self.heading
            + if s < rise {
                eased(s)
            } else if s <= fall {
                self.easing + (s - rise) / self.radius
            } else {
                self.sweep - eased(end - s)
            }
    }

    /// Point at a length from the start.
    pub fn at(&self, s: f64) -> Point2 {
        /// Gauss and Legendre's five places in −1..1 and their weights.
        const GAUSS: [[f64; 2]; 5] = [
            [-0.906_179_845_938_664, 0.236_926_885_056_189_08],
            [-0.538_469_310_105_683_1, 0.478_628_670_499_366_5],
            [0.0, 0.568_888_888_888_888_9],
            [0.538_469_310_105_683_1, 0.478_628_670_499_366_5],
            [0.906_179_845_938_664, 0.236_926_885_056_189_08],
        ];
        /// Parts of each piece: turning by half a radian or less they are integrated to 1e-14.
        const PARTS: usize = 6;
        let [rise, fall, end] = self.breaks();
        let mut point = self.start;
        for (from, to) in [(0.0, rise), (rise, fall), (fall, end)] {
            let to = s.min(to);
            let half = 0.5 * (to - from) / PARTS as f64;
            for part in (0..PARTS).take_while(|_| half > 0.0) {
                let middle = from + (2 * part + 1) as f64 * half;
                for [place, weight] in GAUSS {
                    let (sine, cosine) = self.direction(middle + half * place).sin_cos();
                    point += Vector2::new(cosine, sine) * (half * weight);
                }
            }
        }
        point
    }

    /// Points of the arc from the lower to the upper side without either end, counter-clockwise, at equal
    /// lengths; the one in the middle is the trailing edge.
    pub fn points(&self) -> Vec<Point2> {
        let steps = 2 * (0.5 * self.length() / (STEP * self.radius)).ceil().max(1.0) as usize;
        (1..steps).map(|k| self.at(self.length() * k as f64 / steps as f64)).collect()
    }
}

/// Where a falling function passes 0 between `a` and `b`.
fn fall(f: impl Fn(f64) -> f64, mut a: f64, mut b: f64) -> f64 {
    for _ in 0..60 {
        let middle = 0.5 * (a + b);
        if f(middle) > 0.0 { a = middle } else { b = middle }
    }
    0.5 * (a + b)
}
