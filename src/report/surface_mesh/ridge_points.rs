//! Ridge points: where the cuts of two passes meet on the lines between neighbouring cell centres.
//!
//! Lines run along x, along y, and along one diagonal of each square of four centres, in turn like
//! the fields of a chessboard: the sides of all triangles over single cells. Heights are those of the
//! closed-form cuts at their meeting, mm; places are shares of a line, from its left or lower end.

use super::Node;
use metrology::{CutSurface, Meetings};
use motion::{Cutters, Toolpath};
use sim::{Envelope, NOT_CUT, ZMap};

/// Ridge points keep this share of a line from its ends and from each other, so that no triangle is
/// too thin for coordinates of f32. It moves a point sideways by no more than this share of a cell.
const APART: f32 = 1.0 / 256.0;

/// Lines that begin at a cell.
const FAMILIES: u32 = 3;

/// The points of a row are looked up from the nearest of every so many columns: with more the search
/// is longer, with fewer the table is (4 bytes an entry).
const STRIDE: usize = 16;

/// A ridge on the line between two neighbouring centres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct RidgePoint {
    /// Column of the line's cell, times [`FAMILIES`], plus the line's family.
    key: u32,
    /// Share of the line.
    pub t: f32,
    /// Height, mm.
    pub z: f32,
}

impl RidgePoint {
    /// Column of the cell whose line it lies on.
    fn column(&self) -> usize {
        (self.key / FAMILIES) as usize
    }

    /// Where it lies, in cells, when it stands in `row`.
    pub fn place(&self, row: usize) -> (f64, f64) {
        let (i, t) = (self.column(), f64::from(self.t));
        let (x, y) = (i as f64, row as f64);
        match Line::of(self.key % FAMILIES) {
            Line::AlongX => (x + t, y),
            Line::AlongY => (x, y + t),
            Line::Diagonal if rises((i, row)) => (x + t, y + t),
            Line::Diagonal => (x + t, y + 1.0 - t),
        }
    }
}

/// The lines of a cell: to the right, upward, and across the square to its upper right.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Line {
    AlongX,
    AlongY,
    Diagonal,
}

impl Line {
    fn of(family: u32) -> Self {
        [Self::AlongX, Self::AlongY, Self::Diagonal][family as usize]
    }

    /// Its ends when it belongs to cell `(i, j)`, the left or lower one first.
    fn ends(self, (i, j): Node) -> (Node, Node) {
        match self {
            Self::AlongX => ((i, j), (i + 1, j)),
            Self::AlongY => ((i, j), (i, j + 1)),
            Self::Diagonal if rises((i, j)) => ((i, j), (i + 1, j + 1)),
            Self::Diagonal => ((i, j + 1), (i + 1, j)),
        }
    }
}

/// True when the diagonal of the square at this cell rises from left to right.
pub(super) fn rises((i, j): Node) -> bool {
    (i + j).is_multiple_of(2)
}

/// All ridge points of a map, numbered row by row.
#[derive(Debug)]
pub(super) struct RidgePoints {
    rows: Vec<Vec<RidgePoint>>,
    /// Number of the first point of each row, and of all.
    first: Vec<usize>,
    /// A bit a family for every cell: whether there are points on that line.
    present: Vec<u8>,
    /// Rank in its row of the first point from each [`STRIDE`]-th column on.
    starts: Vec<u32>,
    nx: usize,
}

impl RidgePoints {
    /// Of the map that `path` has cut.
    pub fn find(cut: &ZMap, cutters: &Cutters, path: &Toolpath) -> Self {
        let surface = CutSurface::new(Envelope::new(cutters, path), cut, path);
        let meetings = Meetings::new(&surface, cutters, path, flat_stock(cut));
        let grid = &cut.grid;
        let rows = work::parallel::map(grid.ny, |j| {
            let mut row: Vec<RidgePoint> = Vec::new();
            for key in 0..FAMILIES * grid.nx as u32 {
                let (a, b) = Line::of(key % FAMILIES).ends(((key / FAMILIES) as usize, j));
                if a.0.max(b.0) >= grid.nx || a.1.max(b.1) >= grid.ny {
                    continue;
                }
                let [from, to] = [a, b].map(|node| cut.cut_by[grid.index(node.0, node.1)]);
                if from == to || !meetings.apart(from, to) {
                    continue;
                }
                let (p, q) = (grid.centre(a.0, a.1), grid.centre(b.0, b.1));
                meetings.between(&|t| p + (q - p) * t, (0.0, from), (1.0, to), &mut |meeting| {
                    let t = (meeting.t as f32).clamp(APART, 1.0 - APART);
                    if row.last().is_none_or(|last| last.key != key || t >= last.t + APART) {
                        row.push(RidgePoint { key, t, z: meeting.z as f32 });
                    }
                });
            }
            row
        });
        Self::new(rows, grid.nx)
    }

    /// From the points of each row, in the order of their keys.
    fn new(rows: Vec<Vec<RidgePoint>>, nx: usize) -> Self {
        let mut first = vec![0];
        let mut present = vec![0u8; nx * rows.len()];
        let mut starts = Vec::with_capacity(nx.div_ceil(STRIDE) * rows.len());
        for (j, row) in rows.iter().enumerate() {
            first.push(first[j] + row.len());
            let mut rank = 0;
            for i in (0..nx).step_by(STRIDE) {
                rank += row[rank..].iter().take_while(|p| p.column() < i).count();
                starts.push(rank as u32);
            }
            for point in row {
                present[j * nx + point.column()] |= 1 << (point.key % FAMILIES);
            }
        }
        Self { rows, first, present, starts, nx }
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.first.last().copied().unwrap_or(0)
    }

    /// True where a ridge crosses that line of a cell.
    pub fn crosses(&self, (i, j): Node, line: Line) -> bool {
        self.present[j * self.nx + i] & (1 << line as u8) != 0
    }

    /// Those on one line of a cell, from its left or lower end, and the number of the first.
    pub fn on(&self, (i, j): Node, line: Line) -> (usize, &[RidgePoint]) {
        if !self.crosses((i, j), line) {
            return (0, &[]);
        }
        let (row, key) = (&self.rows[j], FAMILIES * i as u32 + line as u32);
        let start = self.start(i, j);
        let from = start + row[start..].iter().take_while(|p| p.key < key).count();
        let count = row[from..].iter().take_while(|p| p.key == key).count();
        (self.first[j] + from, &row[from..from + count])
    }

    /// Those on all lines of the cells from `from` up to `to` of row `j`.
    pub fn of_cells(&self, from: usize, to: usize, j: usize) -> &[RidgePoint] {
        let bits = &self.present[j * self.nx..][from..(to + 1).min(self.nx)];
        if bits.iter().all(|bits| *bits == 0) {
            return &[];
        }
        let row = &self.rows[j];
        let rank = |i: usize| {
            let start = self.start(i.min(self.nx - 1), j);
            start + row[start..].iter().take_while(|p| p.column() < i).count()
        };
        &row[rank(from)..rank(to + 1)]
    }

    /// Rank in row `j` of a point at or before the first of column `i`.
    fn start(&self, i: usize, j: usize) -> usize {
        self.starts[j * self.nx.div_ceil(STRIDE) + i / STRIDE] as usize
    }
}

/// The height of stock that nothing has touched, if it is the same everywhere.
fn flat_stock(cut: &ZMap) -> Option<f64> {
    let mut untouched = cut.height.iter().zip(&cut.cut_by).filter(|(_, by)| **by == NOT_CUT).map(|(z, _)| *z);
    let first = untouched.next()?;
    untouched.all(|z| z == first).then_some(f64::from(first))
}
