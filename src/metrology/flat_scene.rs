//! What tests of measurements along normals share.

use geometry::{Point3, TriangleMesh};
use motion::{ClPoint, Move, MoveKind, Toolpath};
use part::Part;

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
