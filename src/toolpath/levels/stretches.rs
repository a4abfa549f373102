//! Stretches between the contacts of passes, by where they are.

use std::collections::HashMap;

use crate::vocabulary::Contact;
use geometry::Point3;

/// Stretches in cubes.
pub(crate) struct Stretches {
    /// Side of a cube, mm.
    reach: f64,
    cubes: HashMap<[i64; 3], Vec<[Point3; 2]>>,
}

impl Stretches {
    /// None yet, to be looked for up to `reach` mm away.
    pub fn new(reach: f64) -> Self {
        Self { reach, cubes: HashMap::new() }
    }

    fn cube(&self, p: &Point3) -> [i64; 3] {
        [p.x, p.y, p.z].map(|x| (x / self.reach).floor() as i64)
    }

    /// Adds those of a pass.
    pub fn insert(&mut self, pass: &[Contact]) {
        for ends in pass.windows(2).map(|w| [w[0].at, w[1].at]) {
            let corners = [ends[0].inf(&ends[1]), ends[0].sup(&ends[1])].map(|p| self.cube(&p));
            let [lo, hi] = corners;
            for i in lo[0]..=hi[0] {
                for j in lo[1]..=hi[1] {
                    for k in lo[2]..=hi[2] {
                        self.cubes.entry([i, j, k]).or_default().push(ends);
                    }
                }
            }
        }
    }

    /// All that come within reach of a point, and some others.
    pub fn around(&self, p: &Point3) -> impl Iterator<Item = &[Point3; 2]> {
        let home = self.cube(p);
        let beside = move |k: i64| [home[0] + k % 3 - 1, home[1] + k / 3 % 3 - 1, home[2] + k / 9 - 1];
        (0..27).filter_map(move |k| self.cubes.get(&beside(k))).flatten()
    }
}

/// The point of a stretch that is nearest to `p`.
pub(crate) fn nearest_on([a, b]: &[Point3; 2], p: &Point3) -> Point3 {
    let d = b - a;
    let t = (p - a).dot(&d) / d.norm_squared().max(f64::MIN_POSITIVE);
    a + d * t.clamp(0.0, 1.0)
}
