//! What tests of measurements along normals share.

use cutter::Cutter;
use geometry::{Point3, TriangleMesh};
use motion::{ClPoint, Move, MoveKind, Toolpath};
use part::Part;
use sim::{Grid, ZMap, cut};
use work::monitor::Silent;

use crate::figures::{GougeFigures, Limits, Measurement};
use crate::{Asked, measure};

/// What [`gouge_of`] judges by.
pub(super) const LIMITS: Limits = Limits { scallop: 0.02, gouge: 0.005, uncut: 0.05, chord: 0.001 };

/// A path of an upright cutter through the tips of each pass, with a rapid to each.
pub(super) fn path(passes: &[Vec<Point3>]) -> Toolpath {
    let mut moves = Vec::new();
    for (pass, tips) in passes.iter().enumerate() {
        for (k, tip) in tips.iter().enumerate() {
            let kind = if k == 0 { MoveKind::Rapid } else { MoveKind::Cut };
            moves.push(Move { to: ClPoint::upright(*tip), kind, feed_rate: 1000.0, pass: pass as u32 });
        }
    }
    Toolpath::new(ClPoint::upright(passes[0][0]), moves)
}

/// A level rectangle from the origin, mm.
pub(super) fn plane([x, y]: [f64; 2]) -> Part {
    let corners = [[0.0, 0.0, 0.0], [x, 0.0, 0.0], [0.0, y, 0.0], [x, y, 0.0]];
    let corners = corners.map(Point3::from).to_vec();
    Part::from_mesh(TriangleMesh::new(corners, vec![[0, 1, 2], [1, 3, 2]]).unwrap().0)
}

/// What a cutter cuts too deep from a block a millimetre higher than a part, along passes of its tip, by
/// cells.
pub(super) fn gouge_of(part: &Part, cutter: &Cutter, passes: &[Vec<Point3>], cell: f64) -> GougeFigures {
    measured_of(part, cutter, passes, cell).gouge
}

/// All that is measured of such a cut.
pub(super) fn measured_of(part: &Part, cutter: &Cutter, passes: &[Vec<Point3>], cell: f64) -> Measurement {
    let path = path(passes);
    let top = part.bounds().max.z + 1.0;
    let grid = Grid::covering(&part.bounds(), cell, 64, 1 << 30).unwrap();
    let cut = cut(ZMap::block(grid, top), cutter, &path, &Silent).unwrap();
    let asked = Asked {
        allowed_depth: 0.0,
        error_bound: 5e-4,
        border_cuts: true,
        steep_elsewhere: false,
        most_cells: 1 << 20,
        most_squares: 1 << 20,
        is_first_look: true,
    };
    // How high what is left stands is of no account.
    let limits = Limits { scallop: 1e3, uncut: 1e3, ..LIMITS };
    measure(part, cutter, &path, &cut, &limits, &asked, &Silent).unwrap()
}
