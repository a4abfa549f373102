//! Which moves come near to places.

use std::collections::HashSet;

use cutter::Cutter;
use geometry::Point3;
use motion::Toolpath;

use crate::along_normals::NetPlace;

/// Places in cubes, to ask which moves come near.
pub(super) struct Near {
    cubes: HashSet<[i64; 3]>,
    side: f64,
}

impl Near {
    /// Of places, in cubes of a side, mm.
    pub fn new(places: &[NetPlace], side: f64) -> Self {
        let cubes = places.iter().map(|place| cube(&place.point, side)).collect();
        Self { cubes, side }
    }

    /// Whether the middle or the end of a move comes within a side of a cube of a place.
    pub fn is_passed(&self, path: &Toolpath, k: usize, cutter: &Cutter) -> bool {
        let from = path.location_before(k);
        [0.5, 1.0].iter().any(|t| {
            let at = from.towards(&path.moves[k].to, *t);
            let here = cube(&(at.tip + at.axis * cutter.profile().centre_z), self.side);
            let mut around =
                (0..27).map(|n| [here[0] + n % 3 - 1, here[1] + n / 3 % 3 - 1, here[2] + n / 9 - 1]);
            around.any(|cube| self.cubes.contains(&cube))
        })
    }
}

/// The cube of a side, mm, that a point lies in.
pub(super) fn cube(point: &Point3, side: f64) -> [i64; 3] {
    point.coords.map(|c| (c / side).floor() as i64).into()
}
