//! Chains passes into one program: rapid over, plunge, cut, retract.

use super::{ClPoint, Move, MoveKind, PlanSettings, Toolpath};
use crate::geometry::Point3;

/// Joins passes, in the given order, by retracts to a safe height. Each pass is a run of at least
/// two tip positions without repeats; passes of fewer are left out.
///
/// With `both_ways` a pass is reversed where its other end is nearer to where the last one ended.
/// All rapid moves run at `stock_top + clearance` or vertically above it, so that no rapid can
/// touch the stock.
pub fn chain(passes: Vec<Vec<Point3>>, both_ways: bool, settings: &PlanSettings) -> Toolpath {
    let safe = settings.stock_top + settings.clearance;
    let mut moves: Vec<Move> = Vec::new();
    let mut start = None;
    let mut at: Option<Point3> = None;
    for (pass, mut points) in passes.into_iter().filter(|p| p.len() >= 2).enumerate() {
        let (first, last) = (points[0], points[points.len() - 1]);
        if both_ways && at.is_some_and(|at| (last.xy() - at.xy()).norm() < (first.xy() - at.xy()).norm()) {
            points.reverse();
        }
        let mut push = |tip: Point3, kind, feed_rate| {
            moves.push(Move { to: ClPoint { tip }, kind, feed_rate, pass: pass as u32 });
        };
        let first = points[0];
        let above = Point3::new(first.x, first.y, safe);
        if at.is_none() {
            start = Some(ClPoint { tip: above });
        } else {
            push(above, MoveKind::Rapid, 0.0);
        }
        push(first, MoveKind::Plunge, settings.plunge_rate);
        for &tip in &points[1..] {
            push(tip, MoveKind::Cut, settings.feed_rate);
        }
        let last = points[points.len() - 1];
        let lifted = Point3::new(last.x, last.y, safe);
        push(lifted, MoveKind::Retract, settings.feed_rate);
        at = Some(lifted);
    }
    let start = start.unwrap_or(ClPoint { tip: Point3::new(0.0, 0.0, safe) });
    Toolpath { start, moves }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::toolpath::Step;

    fn settings() -> PlanSettings {
        PlanSettings {
            step: Step::Stepover(1.0),
            chord_tolerance: 1e-3,
            clearance: 2.0,
            stock_top: 5.0,
            feed_rate: 1000.0,
            plunge_rate: 300.0,
        }
    }

    #[test]
    fn passes_are_joined_at_the_safe_height_and_turned() {
        let line = |y: f64| vec![Point3::new(0.0, y, 0.0), Point3::new(10.0, y, 0.0)];
        let path = chain(vec![line(0.0), line(1.0), vec![Point3::origin()]], true, &settings());
        assert_eq!(path.passes(), 2, "a single point is no pass");
        assert_eq!(
            path.moves[3].to.tip,
            Point3::new(10.0, 1.0, 7.0),
            "the second pass starts where the first ended"
        );
        for (from, to, m) in path.segments() {
            assert!(from != to, "no repeated point");
            assert_eq!(m.kind == MoveKind::Rapid, from.z == 7.0 && to.z == 7.0);
        }
        let one_way = chain(vec![line(0.0), line(1.0)], false, &settings());
        assert_eq!(one_way.moves[3].to.tip.x, 0.0);
    }
}
