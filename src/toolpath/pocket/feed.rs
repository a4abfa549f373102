//! The feed where more of the cutter is in stock than is good for it.
//!
//! Enters: a program and the angle of the circumference in stock on each move, as it was measured. Leaves:
//! the same moves with feeds reduced, figures of the engagement, and the stretches that exceed a limit.

use geometry::Point3;
use motion::{MoveKind, Toolpath};

/// The feed never falls below this share: rubbing wears a cutter more than load does.
pub const LEAST_SHARE: f64 = 0.3;

/// Angle of the cutter's circumference in stock, rad, when it cuts `width` mm beside cleared ground; π in a
/// slot.
pub fn engagement_angle(width: f64, radius: f64) -> f64 {
    (1.0 - width / radius).clamp(-1.0, 1.0).acos()
}

/// A stretch of moves one after the other that all exceed the limit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Exceeding {
    /// Where it begins: the tip, mm.
    pub from: Point3,
    /// mm.
    pub length: f64,
    /// The greatest angle on it, rad.
    pub max: f64,
    /// Its first move.
    pub first_move: u32,
}

/// The engagement of a program's passes, ways down left out.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Engagement {
    /// Greatest angle, rad.
    pub max: f64,
    /// 95 % of the cutting length have less, rad.
    pub p95: f64,
    /// Share of the cutting length above the limit.
    pub over_limit: f64,
    /// The move with the greatest angle.
    pub max_move: u32,
    /// All stretches above the limit, in the order of the path.
    pub exceeding: Vec<Exceeding>,
}

/// Figures of the passes' engagement. `angles` are those of each move, rad.
pub fn engagement(path: &Toolpath, angles: &[f64], limit: f64) -> Engagement {
    let mut figures = Engagement::default();
    let mut all: Vec<(f64, f64)> = Vec::new();
    let mut last_above = None;
    for (k, (a, b, m)) in path.segments().enumerate() {
        if m.kind != MoveKind::Cut {
            continue;
        }
        if angles[k] > limit {
            let length = (b - a).norm();
            match figures.exceeding.last_mut().filter(|_| last_above == k.checked_sub(1)) {
                Some(one) => (one.length, one.max) = (one.length + length, one.max.max(angles[k])),
                None => figures.exceeding.push(Exceeding {
                    from: a,
                    length,
                    max: angles[k],
                    first_move: k as u32,
                }),
            }
            last_above = Some(k);
        }
        if angles[k] > figures.max {
            (figures.max, figures.max_move) = (angles[k], k as u32);
        }
        all.push((angles[k], (b - a).norm()));
    }
    let whole: f64 = all.iter().map(|a| a.1).sum();
    if whole <= 0.0 {
        return figures;
    }
    // An empty sum is -0.
    figures.over_limit = all.iter().filter(|a| a.0 > limit).map(|a| a.1).fold(0.0, |a, b| a + b) / whole;
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut below = 0.0;
    for (angle, length) in all {
        below += length;
        if below >= 0.95 * whole {
            figures.p95 = angle;
            break;
        }
    }
    figures
}

/// Reduces the feed of cutting moves whose engagement (`angles`, rad) is above `limit`, rad, in
/// proportion, down to three tenths.
pub fn limit_feed(path: &mut Toolpath, angles: &[f64], limit: f64) {
    for (m, &angle) in path.moves.iter_mut().zip(angles) {
        if m.kind == MoveKind::Cut && angle > limit {
            m.feed_rate *= (limit / angle).max(LEAST_SHARE);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use motion::{ClPoint, Move};

    /// Moves of one unit along x: two stretches above the limit, which a way down parts, and one at the
    /// limit.
    #[test]
    fn stretches_above_the_limit_have_place_length_and_angle() {
        use MoveKind::{Cut, Plunge};
        let kinds = [Cut, Cut, Cut, Plunge, Cut, Cut];
        let angles = [0.5, 1.5, 1.2, 3.0, 1.1, 1.0];
        let moves = kinds.iter().enumerate().map(|(k, kind)| {
            let to = ClPoint::upright(Point3::new(1.0 + k as f64, 0.0, -2.0));
            Move { to, kind: *kind, feed_rate: 100.0, pass: 0 }
        });
        let path = Toolpath::new(ClPoint::upright(Point3::new(0.0, 0.0, -2.0)), moves.collect());
        let found = engagement(&path, &angles, 1.0);
        let at = |x: f64| Point3::new(x, 0.0, -2.0);
        let expected = [
            Exceeding { from: at(1.0), length: 2.0, max: 1.5, first_move: 1 },
            Exceeding { from: at(4.0), length: 1.0, max: 1.1, first_move: 4 },
        ];
        assert_eq!(found.exceeding, expected);
        assert_eq!((found.max, found.max_move, found.over_limit), (1.5, 1, 0.6));
    }
}
