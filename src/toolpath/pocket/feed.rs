//! The feed where more of the cutter is in stock than is good for it.
//!
//! Enters: a program and the angle of the circumference in stock on each move, as it was measured. Leaves:
//! the same moves with feeds reduced, and figures of the engagement.

use motion::{MoveKind, Toolpath};

/// The feed never falls below this share: rubbing wears a cutter more than load does.
pub const LEAST_SHARE: f64 = 0.3;

/// Angle of the cutter's circumference in stock, rad, when it cuts `width` mm beside cleared ground; π in a
/// slot.
pub fn engagement_angle(width: f64, radius: f64) -> f64 {
    (1.0 - width / radius).clamp(-1.0, 1.0).acos()
}

/// The engagement of a program's passes, ways down left out.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Engagement {
    /// Greatest angle, rad.
    pub max: f64,
    /// 95 % of the cutting length have less, rad.
    pub p95: f64,
    /// Share of the cutting length above the limit.
    pub over_limit: f64,
    /// The move with the greatest angle.
    pub max_move: u32,
}

/// Figures of the passes' engagement. `angles` are those of each move, rad.
pub fn engagement(path: &Toolpath, angles: &[f64], limit: f64) -> Engagement {
    let mut figures = Engagement::default();
    let mut all: Vec<(f64, f64)> = Vec::new();
    for (k, (a, b, m)) in path.segments().enumerate() {
        if m.kind != MoveKind::Cut {
            continue;
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
