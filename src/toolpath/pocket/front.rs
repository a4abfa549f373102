//! The front of a cutter's circumference that stands in stock while discs clear it, and the rim of a disc
//! that others cover.
//!
//! Enters: where discs lie from the middle of a move or of a disc. Leaves: the parts of the front, or of the
//! rim, that none of them covers; mm, rad.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::sync::LazyLock;

use super::cleared::FILM;
use geometry::Vector2;

/// Arcs that cover a circumference overlap by more than so much, rad: what is less may be the error of two
/// angles.
const ROUNDING: f64 = 1e-7;

/// Parts of the front half circle that are told apart.
const PARTS: usize = 576;
pub(super) const PART: f64 = PI / PARTS as f64;

/// The front of a move while discs clear it; places as seen from the middle of the move.
pub(super) struct Front {
    radius: f64,
    heading: Vector2,
    /// Half of the length of the move, mm.
    half: f64,
    pub standing: Arc,
    /// So many parts of it.
    pub left: u32,
    /// Where what stands begins and ends on the circumference.
    ends: Option<[Vector2; 2]>,
    /// The middle between them, and the square of the distance from it beyond which no disc clears any of it.
    pub middle: Vector2,
    pub reach: f64,
}

impl Front {
    pub fn new(radius: f64, heading: &Vector2, half: f64) -> Self {
        let (ends, middle, reach, left) = (None, Vector2::zeros(), 0.0, PARTS as u32);
        let mut front =
            Self { radius, heading: *heading, half, standing: Arc::FRONT, left, ends, middle, reach };
        front.find_ends();
        front
    }

    fn find_ends(&mut self) {
        let Self { radius, heading, .. } = *self;
        self.ends = self.standing.ends().map(|ends| {
            ends.map(|end| {
                let [cos, sin] = DIRECTIONS[end];
                Vector2::new(heading.x * cos - heading.y * sin, heading.x * sin + heading.y * cos) * radius
            })
        });
        // The arc between them is half a circle at most: no place of it is farther from the middle of its
        // chord than its ends.
        if let Some([a, b]) = &self.ends {
            self.middle = (a + b) * 0.5;
            let reach = self.radius * (1.0 + FILM + ROUNDING) + self.half + (b - a).norm() * 0.5;
            self.reach = reach * reach;
        }
    }

    /// Whether a disc meets the circumference between the ends: it does along an arc about its direction,
    /// which holds an end or lies between them.
    fn meets(&self, to: &Vector2, grown: f64) -> bool {
        let Some([a, b]) = &self.ends else { return false };
        let square = grown * grown;
        let between = || a.perp(to) >= 0.0 && to.perp(b) >= 0.0;
        (to - a).norm_squared() < square
            || (to - b).norm_squared() < square
            || (to.norm_squared() < (self.radius + grown).powi(2) && between())
    }

    /// Clears what a disc of the radius `grown` clears from both ends of the move; how many parts.
    pub fn clear(&mut self, to: Vector2, grown: f64) -> u32 {
        let (r, heading) = (self.radius, self.heading);
        let [after, before] = [1.0, -1.0].map(|side| to + heading * (side * self.half));
        if !self.meets(&after, grown) || (self.half > 0.0 && !self.meets(&before, grown)) {
            return 0;
        }
        let seen = |to: Vector2| {
            let (square, away) = (to.norm_squared(), to.norm());
            let cos = (r * r + square - grown * grown) / (2.0 * r * away);
            let all = cos <= -1.0 || away <= grown - r;
            let half = if all { PI } else { half_angle(cos.min(1.0)) };
            let towards = angle_of(heading.dot(&to), heading.perp(&to));
            [towards - half, towards + half]
        };
        let [mut from, mut until] = seen(after);
        if self.half > 0.0 {
            let [other_from, other_until] = seen(before);
            // Both are about nearly the same direction.
            let turn = (0.5 * (from + until - other_from - other_until) / TAU).round() * TAU;
            (from, until) = (from.max(other_from + turn), until.min(other_until + turn));
        }
        let cleared = if from < until { self.standing.clear(from, until) } else { 0 };
        if cleared > 0 {
            self.left -= cleared;
            self.find_ends();
        }
        cleared
    }
}

/// The angle of a vector from the x axis, rad, within 3e-8: of a part of the front that is next to nothing,
/// and in half of the time (M. Abramowitz, I. Stegun, 1964, 4.4.49).
fn angle_of(x: f64, y: f64) -> f64 {
    const SERIES: [f64; 9] = [
        0.0028662257,
        -0.0161657367,
        0.0429096138,
        -0.0752896400,
        0.1065626393,
        -0.1420889944,
        0.1999355085,
        -0.3333314528,
        1.0,
    ];
    let (along, across) = (x.abs(), y.abs());
    let longer = along.max(across);
    if longer == 0.0 {
        return 0.0;
    }
    let tangent = along.min(across) / longer;
    let square = tangent * tangent;
    let angle = tangent * SERIES.iter().fold(0.0, |sum, factor| sum * square + factor);
    let angle = if across > along { FRAC_PI_2 - angle } else { angle };
    (if x < 0.0 { PI - angle } else { angle }).copysign(y)
}

/// The angle of a cosine, rad, as near as [`angle_of`].
fn half_angle(cos: f64) -> f64 {
    angle_of(cos, (1.0 - cos * cos).max(0.0).sqrt())
}

/// Where the parts of a circumference begin and end, over the radius.
pub(super) static RIM: LazyLock<[Vector2; 65]> = LazyLock::new(|| {
    std::array::from_fn(|k| {
        let (sin, cos) = (TAU * k as f64 / 64.0).sin_cos();
        Vector2::new(cos, sin)
    })
});

/// Parts of a circumference, and which of them are covered whole.
#[derive(Default)]
pub(super) struct Rim(u64);

impl Rim {
    pub fn is_covered(&self) -> bool {
        self.0 == u64::MAX
    }

    /// Whether the disc lies over a part whose middle is at `to`.
    pub fn part_is_within(part: u32, to: &Vector2) -> bool {
        let held = |k: u32| (RIM[k as usize] - to).norm_squared() <= 1.0 - 4.0 * ROUNDING;
        held(part) && held(part + 1)
    }

    /// The first part that is not covered; any where all are.
    pub fn first_bare(&self) -> u32 {
        self.0.trailing_ones() % 64
    }

    /// Covers the parts that an equal disc does whose middle lies at `to`, over the radius.
    pub fn cover(&mut self, to: &Vector2) {
        const PARTS: f64 = 64.0;
        let square = to.norm_squared();
        // A place that was cleared twice covers all.
        if square == 0.0 {
            self.0 = u64::MAX;
            return;
        }
        let half = half_angle(0.5 * square.sqrt()) - ROUNDING;
        let towards = angle_of(to.x, to.y);
        // A turn is added, so that casts round down. A sixth of the circumference is covered to each side at
        // least.
        let from = 2 * PARTS as u32 - (PARTS - (towards - half) / TAU * PARTS) as u32;
        let until = (PARTS + (towards + half) / TAU * PARTS) as u32;
        let bits = u64::MAX >> (PARTS as u32 - (until - from));
        self.0 |= bits.rotate_left(from % PARTS as u32);
    }
}

/// Cosine and sine of where each part begins, from the heading.
static DIRECTIONS: LazyLock<[[f64; 2]; PARTS + 1]> = LazyLock::new(|| {
    std::array::from_fn(|part| {
        let (sin, cos) = (PART * part as f64 - FRAC_PI_2).sin_cos();
        [cos, sin]
    })
});

/// Parts of the front half circle, from the right to the left.
pub(super) struct Arc([u64; PARTS / 64]);

impl Arc {
    const FRONT: Self = Self([u64::MAX; PARTS / 64]);

    /// Clears the parts whose middles lie between two angles from the heading, less than a turn apart; how
    /// many stood.
    pub fn clear(&mut self, from: f64, to: f64) -> u32 {
        let mut stood = 0;
        for turn in [-TAU, 0.0, TAU] {
            let (a, b) = ((from + turn + FRAC_PI_2) / PART - 0.5, (to + turn + FRAC_PI_2) / PART - 0.5);
            if b < 0.0 || a > (PARTS - 1) as f64 {
                continue;
            }
            let below = a.max(0.0) as usize;
            let (first, last) = (below + usize::from((below as f64) < a), (b as usize).min(PARTS - 1));
            for word in first / 64..=last / 64 {
                let low = first.saturating_sub(64 * word).min(64);
                let high = (last + 1).saturating_sub(64 * word).min(64);
                if low < high {
                    let cleared = (u64::MAX >> (64 - (high - low))) << low;
                    stood += (self.0[word] & cleared).count_ones();
                    self.0[word] &= !cleared;
                }
            }
        }
        stood
    }

    /// The part with which what stands begins, and the one after its last.
    pub fn ends(&self) -> Option<[usize; 2]> {
        let first = self.0.iter().position(|w| *w != 0)?;
        let last = self.0.iter().rposition(|w| *w != 0)?;
        let from = 64 * first + self.0[first].trailing_zeros() as usize;
        Some([from, 64 * (last + 1) - self.0[last].leading_zeros() as usize])
    }

    pub fn angle(&self) -> f64 {
        let parts: u32 = self.0.iter().map(|w| w.count_ones()).sum();
        PI * f64::from(parts) / PARTS as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_of_vectors_are_near_enough() {
        for k in -1000..=1000 {
            let angle = PI * f64::from(k) / 1000.0;
            let (sin, cos) = angle.sin_cos();
            assert!((angle_of(3.0 * cos, 3.0 * sin) - sin.atan2(cos)).abs() < 3e-8, "{angle}");
            assert!((half_angle(cos) - angle.abs()).abs() < 4e-8, "{angle}");
        }
        assert_eq!(angle_of(0.0, 0.0), 0.0);
    }
}
