//! Which moves belong to neighbouring tracks rather than to one.

use crate::cutter::Cutter;
use crate::toolpath::{MoveKind, Toolpath};

/// Two moves of one pass that lie farther apart along the path than this many cutter radii are
/// neighbouring turns of a spiral or loop, not neighbouring chords.
const SAME_TRACK: f64 = 4.0;

/// The passes of a path and the way along it.
pub(crate) struct Tracks<'a> {
    path: &'a Toolpath,
    /// Distance along the path to the end of each move, mm.
    along: Vec<f64>,
    /// Moves of one pass farther apart than this are of two tracks, mm.
    same_track: f64,
}

impl<'a> Tracks<'a> {
    pub fn new(path: &'a Toolpath, cutter: &Cutter) -> Self {
        let mut length = 0.0;
        let along = path
            .segments()
            .map(|(from, to, _)| {
                length += (to - from).norm();
                length
            })
            .collect();
        Self { path, along, same_track: SAME_TRACK * cutter.radius() }
    }

    /// The passes of two moves, in order.
    pub fn passes(&self, a: u32, b: u32) -> [u32; 2] {
        let [x, y] = [a, b].map(|k| self.path.moves[k as usize].pass);
        [x.min(y), x.max(y)]
    }

    /// True when two moves belong to neighbouring tracks.
    pub fn apart(&self, a: u32, b: u32) -> bool {
        let [x, y] = [a, b].map(|k| &self.path.moves[k as usize]);
        let linked = x.kind == MoveKind::Link || y.kind == MoveKind::Link;
        let far = (self.along[a as usize] - self.along[b as usize]).abs() > self.same_track;
        (x.pass != y.pass && !linked) || far
    }
}
