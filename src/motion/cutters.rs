//! Which cutter makes which moves of a path.

use std::borrow::Cow;

use crate::Toolpath;
use cutter::Cutter;

/// The cutters of a path, in the order in which they come: each makes the moves from its first one on, up to
/// that of the next.
#[derive(Debug, Clone, PartialEq)]
pub struct Cutters {
    /// The first move, and what cuts from there; the first one's is 0.
    of: Vec<(u32, Cutter)>,
}

/// The moves that one cutter makes, as a path of their own.
#[derive(Debug, Clone)]
pub struct Stretch<'a> {
    /// What cuts.
    pub cutter: &'a Cutter,
    /// Index of its first move in the whole path.
    pub first: u32,
    /// Its moves.
    pub path: Cow<'a, Toolpath>,
}

impl From<Cutter> for Cutters {
    fn from(cutter: Cutter) -> Self {
        Self { of: vec![(0, cutter)] }
    }
}

impl From<&Cutter> for Cutters {
    fn from(cutter: &Cutter) -> Self {
        Self::from(*cutter)
    }
}

impl From<&Cutters> for Cutters {
    fn from(cutters: &Cutters) -> Self {
        cutters.clone()
    }
}

impl Cutters {
    /// The next cutter, from a move on.
    #[must_use]
    pub fn then(mut self, first_move: u32, cutter: Cutter) -> Self {
        self.of.push((first_move, cutter));
        self
    }

    /// The cutters of another path behind this one: the first from the move `begin` on, the others counted
    /// from `first`. A cutter that goes on is the same one.
    #[must_use]
    pub fn and_then(mut self, begin: u32, first: u32, next: &Self) -> Self {
        for (k, (move_index, cutter)) in next.of.iter().enumerate() {
            if self.of[self.of.len() - 1].1 != *cutter {
                self.of.push((if k == 0 { begin } else { first + move_index }, *cutter));
            }
        }
        self
    }

    /// The cutter that makes a move.
    #[inline]
    pub fn of_move(&self, move_index: u32) -> &Cutter {
        match &self.of[..] {
            [(_, only)] => only,
            all => &all[all.partition_point(|(first, _)| *first <= move_index).max(1) - 1].1,
        }
    }

    /// The first moves and what cuts from there, in order.
    pub fn each(&self) -> impl ExactSizeIterator<Item = (u32, &Cutter)> {
        self.of.iter().map(|(first, cutter)| (*first, cutter))
    }

    /// The cutter of the first move.
    pub fn first(&self) -> &Cutter {
        &self.of[0].1
    }

    /// Whether there are several, also where one comes again.
    pub fn are_several(&self) -> bool {
        self.of.len() > 1
    }

    /// The greatest value of all cutters.
    pub fn greatest(&self, value: impl Fn(&Cutter) -> f64) -> f64 {
        self.of[1..].iter().map(|(_, cutter)| value(cutter)).fold(value(self.first()), f64::max)
    }

    /// The least value of all cutters.
    pub fn least(&self, value: impl Fn(&Cutter) -> f64) -> f64 {
        -self.greatest(|cutter| -value(cutter))
    }

    /// The radius of the widest, mm.
    pub fn greatest_radius(&self) -> f64 {
        self.greatest(Cutter::radius)
    }

    /// The moves of each cutter as a path of its own; the whole path where there is one cutter.
    pub fn stretches<'a>(&'a self, path: &'a Toolpath) -> Vec<Stretch<'a>> {
        if !self.are_several() {
            return vec![Stretch { cutter: self.first(), first: 0, path: Cow::Borrowed(path) }];
        }
        let ends = self.of[1..].iter().map(|(first, _)| *first as usize).chain([path.len()]);
        let of_one = |((first, cutter), end): (&'a (u32, Cutter), usize)| {
            let begin = (*first as usize).min(path.len());
            let path = path.part(begin..end.clamp(begin, path.len()));
            Stretch { cutter, first: *first, path: Cow::Owned(path) }
        };
        self.of.iter().zip(ends).map(of_one).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ClPoint, Move, MoveKind};
    use geometry::Point3;

    #[test]
    fn each_cutter_makes_its_own_moves() {
        let at = |x: usize| ClPoint::upright(Point3::new(x as f64, 0.0, 0.0));
        let step = |x: usize| Move { to: at(x), kind: MoveKind::Cut, feed_rate: 1.0, pass: 0 };
        let mut path = Toolpath::new(at(0), (1..=7).map(step).collect());
        path.origin.lines = (10..17).collect();
        path.origin.tools = vec![(0, 8), (3, 6), (5, 8)];
        let [flat, ball] = [Cutter::flat(8.0).unwrap(), Cutter::ball(6.0).unwrap()];
        let cutters = Cutters::from(flat).then(3, ball).then(5, flat);
        let of: Vec<f64> = (0..7).map(|k| cutters.of_move(k).radius()).collect();
        assert_eq!(of, [4.0, 4.0, 4.0, 3.0, 3.0, 4.0, 4.0]);
        assert_eq!((cutters.greatest_radius(), cutters.least(Cutter::radius)), (4.0, 3.0));
        let stretches = cutters.stretches(&path);
        let lines = |k: usize| stretches[k].path.origin.lines.clone();
        assert_eq!([lines(0), lines(1), lines(2)], [vec![10, 11, 12], vec![13, 14], vec![15, 16]]);
        assert_eq!(stretches[1].path.start, at(3));
        let tools = |k: usize| stretches[k].path.origin.tools.clone();
        assert_eq!([tools(0), tools(1), tools(2)], [vec![(0, 8)], vec![(0, 6)], vec![(0, 8)]]);
        assert_eq!(path.part(2..6).origin.tools, [(0, 8), (1, 6), (3, 8)]);
        assert_eq!([0, 4, 6].map(|k| path.named_tool_of(k)), [Some(8), Some(6), Some(8)]);
        let on = Cutters::from(ball).and_then(18, 20, &cutters);
        assert_eq!(on, Cutters::from(ball).then(18, flat).then(23, ball).then(25, flat));
        assert_eq!(Cutters::from(flat).and_then(18, 20, &flat.into()), flat.into());
        let whole = Cutters::from(ball);
        assert_eq!(*whole.stretches(&path)[0].path, path);
    }
}
