//! The words of a path: contact, location, move, toolpath. mm; feed in mm/min.

use crate::geometry::{Point3, Vector3};

/// Cutter contact: where the cutter touches the design surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CcPoint {
    /// Contact point, mm.
    pub point: Point3,
    /// Outward unit normal of the design surface there.
    pub normal: Vector3,
}

/// Cutter location: the tip of the cutter, always.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClPoint {
    /// Tip, mm.
    pub tip: Point3,
}

/// What a move is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MoveKind {
    /// Positioning at rapid speed (G0); must not touch stock.
    Rapid,
    /// Feeding down to the start of a pass.
    Plunge,
    /// Cutting along a pass.
    Cut,
    /// Feeding along the surface from the end of a pass to the start of the next.
    Link,
    /// Feeding up from the end of a pass.
    Retract,
}

impl MoveKind {
    /// True for moves that feed along the surface.
    pub fn is_on_surface(self) -> bool {
        matches!(self, Self::Cut | Self::Link)
    }
}

/// A straight move of the tip to a new location.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Move {
    /// Where the move ends.
    pub to: ClPoint,
    /// What it is for.
    pub kind: MoveKind,
    /// Feed rate, mm/min; ignored for [`MoveKind::Rapid`].
    pub feed_rate: f64,
    /// The pass it belongs to, counted from 0 in program order; rapids and links belong to the
    /// pass that they lead to.
    pub pass: u32,
}

/// A program for one cutter: a start and the moves from there.
#[derive(Debug, Clone, PartialEq)]
pub struct Toolpath {
    /// Where the tip is before the first move.
    pub start: ClPoint,
    /// The moves, in program order; a move's index is its name in maps and reports.
    pub moves: Vec<Move>,
}

impl Toolpath {
    /// Number of moves.
    pub fn len(&self) -> usize {
        self.moves.len()
    }

    /// True without moves.
    pub fn is_empty(&self) -> bool {
        self.moves.is_empty()
    }

    /// Where move `k` begins.
    pub fn start_of(&self, k: usize) -> Point3 {
        if k == 0 { self.start.tip } else { self.moves[k - 1].to.tip }
    }

    /// Start, end and move of every move, in program order.
    pub fn segments(&self) -> impl ExactSizeIterator<Item = (Point3, Point3, &Move)> {
        self.moves.iter().enumerate().map(|(k, m)| (self.start_of(k), m.to.tip, m))
    }

    /// One more than the greatest pass number; 0 without moves.
    pub fn passes(&self) -> usize {
        self.moves.iter().map(|m| m.pass as usize + 1).max().unwrap_or(0)
    }
}
