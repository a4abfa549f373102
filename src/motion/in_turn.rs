//! Paths one after the other, as one.

use std::ops::Range;

use crate::{Move, MoveKind, Toolpath};

/// Paths that run one after the other. Between two of them the tool is away: it rises above all of the path,
/// and the next one comes from there. How the machine does that is not known, and counts as an approach.
#[derive(Debug, Clone)]
pub struct PathsInTurn {
    path: Toolpath,
    /// The highest place of the tip so far.
    top: f64,
    passes: u32,
}

impl PathsInTurn {
    /// Begins with a path.
    pub fn new(path: Toolpath) -> Self {
        Self { top: highest(&path), passes: passes(&path), path }
    }

    /// Adds a path, with rapids at a feed of `rapid_rate` mm/min; tells the index of its first move. The two
    /// rapids before that are its own, too.
    pub fn push(&mut self, next: Toolpath, rapid_rate: f64) -> u32 {
        let (path, pass) = (&mut self.path, self.passes);
        self.top = self.top.max(highest(&next));
        let mut from = path.moves.last().map_or(path.start, |step| step.to);
        let mut over = next.start;
        (from.tip.z, over.tip.z) = (self.top, self.top);
        for to in [from, over, next.start] {
            path.moves.push(Move { to, kind: MoveKind::Rapid, feed_rate: rapid_rate, pass });
            path.origin.lines.extend(next.origin.lines.first());
        }
        // The tool that was there rises itself.
        let first = path.moves.len() as u32 - 2;
        for (move_index, tool) in &next.origin.tools {
            if path.origin.tools.last().is_none_or(|(_, last)| last != tool) {
                path.origin.tools.push((first + if *move_index > 0 { move_index + 2 } else { 0 }, *tool));
            }
        }
        let begin = path.moves.len() as u32;
        // What the next path begins with holds on the way there.
        let turned = |(k, speed): &(u32, f64)| (if *k > 0 { k + begin } else { first }, *speed);
        path.origin.spindle.extend(next.origin.spindle.iter().map(turned));
        let behind = |range: &Range<u32>| range.start + begin..range.end + begin;
        path.origin.approaches.push(begin - 3..begin);
        path.origin.approaches.extend(next.origin.approaches.iter().map(behind));
        path.origin.pieces.extend(next.origin.pieces.iter().map(behind));
        path.origin.stops.extend(next.origin.stops.iter().map(|k| k + begin));
        path.origin.strays = path.origin.strays.max(next.origin.strays);
        path.origin.standing_s += next.origin.standing_s;
        path.origin.leans = path.origin.leans.max(next.origin.leans);
        self.passes = self.passes.saturating_add(passes(&next).max(1));
        path.moves
            .extend(next.moves.into_iter().map(|step| Move { pass: step.pass.saturating_add(pass), ..step }));
        path.origin.lines.extend(next.origin.lines);
        first + 2
    }

    /// The path of all.
    pub fn finish(self) -> Toolpath {
        self.path
    }
}

/// Passes of a path, as far as they can be counted.
fn passes(path: &Toolpath) -> u32 {
    u32::try_from(path.passes()).unwrap_or(u32::MAX)
}

/// The highest place of the tip.
fn highest(path: &Toolpath) -> f64 {
    path.moves.iter().map(|step| step.to.tip.z).fold(path.start.tip.z, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ClPoint;
    use geometry::Point3;

    #[test]
    fn the_tool_rises_above_all_between_two_paths() {
        let at = |x: f64, z: f64| ClPoint::upright(Point3::new(x, 0.0, z));
        let step = |x: f64, pass: u32| Move { to: at(x, 0.0), kind: MoveKind::Cut, feed_rate: 1.0, pass };
        let path = |tool: u32, top: f64| {
            let mut path = Toolpath::new(at(0.0, top), vec![step(1.0, 0), step(2.0, 1)]);
            (path.origin.tools, path.origin.lines) = (vec![(0, tool)], vec![10 * tool, 10 * tool + 1]);
            path.origin.strays = 1e-3 * top;
            path.origin.pieces.push(0..2);
            path.origin.stops.push(1);
            path.origin.spindle.push((1, 100.0 * top));
            path
        };
        let mut all = PathsInTurn::new(path(1, 5.0));
        assert_eq!((all.push(path(2, 7.0), 900.0), all.push(path(2, 3.0), 900.0)), (5, 10));
        let all = all.finish();
        let tips: Vec<[f64; 2]> = all.moves.iter().map(|step| [step.to.tip.x, step.to.tip.z]).collect();
        assert_eq!(tips[2..5], [[2.0, 7.0], [0.0, 7.0], [0.0, 7.0]]);
        assert_eq!(tips[7..10], [[2.0, 7.0], [0.0, 7.0], [0.0, 3.0]]);
        let passes: Vec<u32> = all.moves.iter().map(|step| step.pass).collect();
        assert_eq!(passes, [0, 1, 2, 2, 2, 2, 3, 4, 4, 4, 4, 5]);
        assert_eq!(all.origin.lines, [10, 11, 20, 20, 20, 20, 21, 20, 20, 20, 20, 21]);
        assert_eq!(all.origin.tools, [(0, 1), (3, 2)]);
        assert_eq!(all.origin.approaches, [2..5, 7..10]);
        assert_eq!(all.origin.spindle, [(1, 500.0), (6, 700.0), (11, 300.0)]);
        assert_eq!(all.part(7..12).origin.spindle, [(0, 700.0), (4, 300.0)]);
        assert_eq!(
            (&all.origin.pieces[..], &all.origin.stops[..]),
            (&[0..2, 5..7, 10..12][..], &[1, 6, 11][..])
        );
        let part = all.part(4..7).origin;
        assert_eq!((part.approaches.len(), part.approaches[0].clone()), (1, 0..1));
        assert_eq!((part.pieces.len(), part.pieces[0].clone(), part.stops), (1, 1..3, vec![2]));
        assert_eq!(all.counts().filter(|counts| *counts).count(), 6);
        assert_eq!((all.origin.strays, all.part(1..2).origin.strays), (7e-3, 7e-3));
    }
}
