//! The words of a path: contact, location, move, toolpath. mm; feed in mm/min.

use std::ops::Range;

use geometry::{Point3, Vector3};

/// Cutter contact: where the cutter touches the design surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CcPoint {
    /// Contact point, mm.
    pub point: Point3,
    /// Outward unit normal of the design surface there.
    pub normal: Vector3,
}

/// Cutter location: the tip of the cutter, always, and the tool axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClPoint {
    /// Tip, mm.
    pub tip: Point3,
    /// Tool axis, a unit vector from the tip to the holder.
    pub axis: Vector3,
}

impl ClPoint {
    /// With the tool axis along z.
    pub fn upright(tip: Point3) -> Self {
        Self { tip, axis: Vector3::z() }
    }

    /// The location at the share `t` of a move from here to `to`: the tip runs straight, the axis turns at
    /// an even rate in the plane of both axes, as controls that follow the tip move them.
    pub fn towards(&self, to: &Self, t: f64) -> Self {
        let tip = self.tip + (to.tip - self.tip) * t;
        // The angle by both sine and cosine, exact for small and for large ones.
        let (sin, cos) = (self.axis.cross(&to.axis).norm(), self.axis.dot(&to.axis));
        if sin == 0.0 {
            return Self { tip, axis: if t < 0.5 { self.axis } else { to.axis } };
        }
        let angle = sin.atan2(cos);
        let axis = (self.axis * ((1.0 - t) * angle).sin() + to.axis * (t * angle).sin()) / sin;
        Self { tip, axis: axis.normalize() }
    }
}

/// What a move is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MoveKind {
    /// Positioning at rapid speed (G0); must not touch stock.
    Rapid,
    /// Feeding down, or in from beside the stock, to the start of a pass.
    Plunge,
    /// Cutting along a pass.
    Cut,
    /// Feeding along the surface from the end of a pass to the start of the next.
    Link,
    /// Feeding up from the end of a pass, and over beside the part to the next.
    Retract,
}

impl MoveKind {
    /// True for moves that feed along the surface.
    pub fn is_on_surface(self) -> bool {
        matches!(self, Self::Cut | Self::Link)
    }
}

/// A straight move of the tip to a new location; the axis turns evenly meanwhile.
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

/// Where the moves of a path stand in a program. The pass that a move belongs to is the move's own.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Origin {
    /// The file of the program; empty for one that is written from the moves.
    pub program: String,
    /// The first moves of the tools and their numbers, in order; empty where no program names one.
    pub tools: Vec<(u32, u32)>,
    /// What the spindle does from a move on, rev/min, anticlockwise below 0 and off at 0, in order; empty where
    /// no program says it.
    pub spindle: Vec<(u32, f64)>,
    /// The line of each move, counted from 1; empty where there is no program.
    pub lines: Vec<u32>,
    /// How far its motion may be off these moves, mm, where arcs and turns are moves here.
    pub strays: f64,
    /// Time for which the program dwells, s.
    pub standing_s: f64,
    /// The moves of each line of the program that several moves stand for, as the chords of an arc, in order.
    pub pieces: Vec<Range<u32>>,
    /// Moves before which the machine comes to rest, in order.
    pub stops: Vec<u32>,
    /// Moves whose beginning no program tells, in order: they come from where the machine stood before, or
    /// from the change of a tool. They count neither as time nor as way.
    pub approaches: Vec<Range<u32>>,
    /// How far the tool's axis may be off theirs, rad, which `strays` has for the cutter alone: what stands
    /// higher is farther off.
    pub leans: f64,
}

/// A start and the moves from there.
#[derive(Debug, Clone, PartialEq)]
pub struct Toolpath {
    /// Where the tip is before the first move.
    pub start: ClPoint,
    /// The moves, in program order; a move's index is its name in maps and reports.
    pub moves: Vec<Move>,
    /// Where they stand in a program.
    pub origin: Origin,
}

impl Toolpath {
    /// Moves that stand in no program yet. They are taken as they are: [`Toolpath::check`] tells whether they
    /// can be cut, and functions that cut or measure return its error.
    pub fn new(start: ClPoint, moves: Vec<Move>) -> Self {
        Self { start, moves, origin: Origin::default() }
    }

    /// The path moved by a vector, mm.
    #[must_use]
    pub fn moved(mut self, by: Vector3) -> Self {
        self.start.tip += by;
        self.moves.iter_mut().for_each(|step| step.to.tip += by);
        self
    }

    /// The line of the program that a move stands in; `None` without a program.
    pub fn line_of(&self, move_index: usize) -> Option<u32> {
        self.origin.lines.get(move_index).copied()
    }

    /// The number of the tool that makes a move; `None` where no program names one.
    pub fn tool_of(&self, move_index: usize) -> Option<u32> {
        let tools = &self.origin.tools;
        let before = tools.partition_point(|(first, _)| *first as usize <= move_index).checked_sub(1)?;
        Some(tools[before].1)
    }

    /// As [`Toolpath::tool_of`], where there are several tools; `None` where it goes without saying.
    pub fn named_tool_of(&self, move_index: usize) -> Option<u32> {
        if self.origin.tools.len() > 1 { self.tool_of(move_index) } else { None }
    }

    /// What messages call the program that the lines are of.
    pub fn program_name(&self) -> &str {
        if self.origin.program.is_empty() { "toolpath.nc" } else { &self.origin.program }
    }

    /// Some of its moves, as a path that begins where they do.
    pub fn part(&self, moves: Range<usize>) -> Self {
        let lines = self.origin.lines.get(moves.clone()).unwrap_or_default().to_vec();
        let (tools, spindle) = (shown(&self.origin.tools, &moves), shown(&self.origin.spindle, &moves));
        let program = self.origin.program.clone();
        let [pieces, approaches] =
            [&self.origin.pieces, &self.origin.approaches].map(|ranges| clipped(ranges, &moves));
        let stops = self.origin.stops.iter().filter(|k| moves.contains(&(**k as usize)));
        let stops = stops.map(|k| k - moves.start as u32).collect();
        let Origin { strays, leans, .. } = self.origin;
        let origin = Origin {
            program,
            tools,
            spindle,
            lines,
            strays,
            standing_s: 0.0,
            pieces,
            stops,
            approaches,
            leans,
        };
        Self { start: self.location_before(moves.start), moves: self.moves[moves].to_vec(), origin }
    }

    /// Whether the way and the time of each move count, in order: not those of approaches.
    pub fn counts(&self) -> impl Iterator<Item = bool> + '_ {
        let mut approaches = self.origin.approaches.iter().peekable();
        (0..self.len() as u32).map(move |k| {
            while approaches.next_if(|range| range.end <= k).is_some() {}
            !approaches.peek().is_some_and(|range| range.contains(&k))
        })
    }

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

    /// The location where move `k` begins.
    pub fn location_before(&self, k: usize) -> ClPoint {
        if k == 0 { self.start } else { self.moves[k - 1].to }
    }

    /// True when the tool axis stands along z all the time.
    pub fn is_upright(&self) -> bool {
        std::iter::once(&self.start).chain(self.moves.iter().map(|m| &m.to)).all(|to| to.axis == Vector3::z())
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

/// What of what holds from a move on does so within some moves, counted from their first.
fn shown<T: Copy>(from: &[(u32, T)], moves: &Range<usize>) -> Vec<(u32, T)> {
    let before = from.partition_point(|(first, _)| *first as usize <= moves.start);
    let shown = from.get(before.saturating_sub(1)..).unwrap_or_default().iter();
    let within = shown.take_while(|(first, _)| (*first as usize) < moves.end);
    within.map(|(first, what)| (first.saturating_sub(moves.start as u32), *what)).collect()
}

/// What of ranges of moves lies within some moves, counted from their first.
fn clipped(ranges: &[Range<u32>], moves: &Range<usize>) -> Vec<Range<u32>> {
    let [first, end] = [moves.start as u32, moves.end as u32];
    let parts = ranges.iter().map(|range| range.start.max(first)..range.end.min(end));
    parts.filter(|range| !range.is_empty()).map(|range| range.start - first..range.end - first).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_axis_turns_evenly() {
        let tilted = |angle: f64| Vector3::new(angle.sin(), 0.0, angle.cos());
        for whole in [1e-9, 0.3, 2.9] {
            let from = ClPoint::upright(Point3::new(1.0, 2.0, 3.0));
            let to = ClPoint { tip: Point3::new(3.0, 2.0, 3.0), axis: tilted(whole) };
            for t in [0.0, 0.25, 0.5, 1.0] {
                let at = from.towards(&to, t);
                assert!((at.axis - tilted(t * whole)).norm() < 1e-15, "{whole} {t}");
                assert!((at.tip.x - 1.0 - 2.0 * t).abs() < 1e-15);
            }
        }
        let still = ClPoint::upright(Point3::origin());
        assert_eq!(still.towards(&ClPoint::upright(Point3::new(1.0, 0.0, 0.0)), 0.3).axis, Vector3::z());
    }
}
