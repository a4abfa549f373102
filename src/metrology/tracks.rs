//! Which moves belong to neighbouring tracks rather than to one.

use std::collections::BTreeMap;

use geometry::Point3;
use motion::{Cutters, MoveKind, Toolpath};

/// Two moves of one pass that lie farther apart along the path than this many cutter radii are
/// neighbouring turns of a spiral or loop, not neighbouring chords.
const SAME_TRACK: f64 = 4.0;

/// Moves of one pass feed in opposite directions where the cosine between them is less, and aside of each
/// other where they are this share of the cutter's radius apart: the way back beside the way there.
const OPPOSITE: f64 = -0.5;
const ASIDE: f64 = 1e-3;

/// A pass that ends this near to where it began is closed, mm: rounding of coordinates.
const SAME_PLACE: f64 = 1e-9;

/// The passes of a path and the way along it.
pub(crate) struct Tracks<'a> {
    path: &'a Toolpath,
    /// Distance along the path to the end of each move, mm.
    along: Vec<f64>,
    /// Of each move, the length of its pass where that ends where it began, mm.
    closed: Vec<Option<f64>>,
    cutters: Cutters,
}

impl<'a> Tracks<'a> {
    pub fn new(path: &'a Toolpath, cutters: impl Into<Cutters>) -> Self {
        let mut along = Vec::with_capacity(path.len());
        let (mut length, mut closed) = (0.0, BTreeMap::new());
        // Where the pass of the moves so far began to cut: the way to there, and the place.
        let mut begun: Option<(u32, f64, Point3)> = None;
        for (from, to, step) in path.segments() {
            if step.kind == MoveKind::Cut {
                let (_, start, place) = *match &mut begun {
                    Some(begun) if begun.0 == step.pass => begun,
                    begun => begun.insert((step.pass, length, from)),
                };
                let round = length + (to - from).norm() - start;
                if (place - to).norm() <= SAME_PLACE && round > 0.0 {
                    closed.insert(step.pass, round);
                } else {
                    closed.remove(&step.pass);
                }
            }
            length += (to - from).norm();
            along.push(length);
        }
        // Numbers of passes may be any.
        let closed = path.moves.iter().map(|step| closed.get(&step.pass).copied()).collect();
        Self { path, along, closed, cutters: cutters.into() }
    }

    /// What makes the moves.
    pub fn cutters(&self) -> &Cutters {
        &self.cutters
    }

    /// The passes of two moves, in order.
    pub fn passes(&self, a: u32, b: u32) -> [u32; 2] {
        let [x, y] = [a, b].map(|k| self.path.moves[k as usize].pass);
        [x.min(y), x.max(y)]
    }

    /// True when two moves belong to neighbouring tracks. A pass that feeds back beside its way there has
    /// two, however short they are.
    pub fn apart(&self, a: u32, b: u32) -> bool {
        let [x, y] = [a, b].map(|k| &self.path.moves[k as usize]);
        let linked = x.kind == MoveKind::Link || y.kind == MoveKind::Link;
        let way = (self.along[a as usize] - self.along[b as usize]).abs();
        // The end of a closed pass goes on in its start.
        let round = self.closed[a as usize].filter(|_| x.pass == y.pass);
        // Moves of one pass are made by one cutter.
        let same_track = SAME_TRACK * self.cutters.of_move(a).radius();
        let far = round.map_or(way, |round| way.min((round - way).abs())) > same_track;
        (x.pass != y.pass && !linked) || far || x.pass == y.pass && self.is_way_back(a, b)
    }

    /// Whether two cutting moves feed in opposite directions, aside of each other.
    fn is_way_back(&self, a: u32, b: u32) -> bool {
        let moves = [a, b].map(|k| {
            let step = &self.path.moves[k as usize];
            let from = self.path.start_of(k as usize);
            (step.kind == MoveKind::Cut).then(|| (from, step.to.tip - from))
        });
        let [Some((p, along)), Some((q, back))] = moves else { return false };
        let lengths = along.norm() * back.norm();
        if lengths <= 0.0 || along.dot(&back) > OPPOSITE * lengths {
            return false;
        }
        let middle = q + back * 0.5 - p;
        let aside = middle.cross(&along).norm() / along.norm();
        aside > ASIDE * self.cutters.of_move(a).radius()
    }
}
