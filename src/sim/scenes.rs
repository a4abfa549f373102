//! Cutters, paths and random numbers that the tests of this stage share.

use super::Grid;
use cutter::{AptWords, Cutter};
use geometry::{Point2, Point3};
use motion::{ClPoint, Move, MoveKind, Toolpath};

/// Steele and Vigna's SplitMix64: the same numbers on every machine.
pub struct Rng(u64);

impl Rng {
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Uniform in `low..high`.
    pub fn within(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        let unit = ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64;
        low + (high - low) * unit
    }

    pub fn below(&mut self, n: usize) -> usize {
        self.within(0.0, n as f64) as usize
    }
}

/// One of each family, diameter up to 6 mm, and profiles with every piece, with edges and without.
pub fn cutters() -> Vec<Cutter> {
    let angle = f64::to_radians;
    let mut cutters = vec![
        Cutter::ball(6.0).unwrap(),
        Cutter::flat(6.0).unwrap(),
        Cutter::bull(6.0, 1.0).unwrap(),
        Cutter::taper(2.0, 1.0, angle(10.0), 6.0).unwrap(),
        Cutter::taper(2.0, 0.4, angle(35.0), 5.0).unwrap(),
        Cutter::taper(2.0, 0.0, angle(35.0), 5.0).unwrap(),
    ];
    cutters.extend(AptWords::examples().iter().map(|words| Cutter::apt(words).unwrap()));
    cutters
}

/// A path of cutting moves through the given tips; the first one is the start.
pub fn path_through(tips: impl IntoIterator<Item = Point3>) -> Toolpath {
    let mut tips = tips.into_iter().map(ClPoint::upright);
    let start = tips.next().unwrap();
    let moves = tips.map(|to| Move { to, kind: MoveKind::Cut, feed_rate: 1000.0, pass: 0 }).collect();
    Toolpath::new(start, moves)
}

/// Level, gentle, steep and vertical moves and moves of no length, of lengths from 1e-9 to tens of
/// mm, over a square of the given size.
pub fn random_path(rng: &mut Rng, moves: usize, size: f64) -> Toolpath {
    let mut tip = Point3::new(rng.within(0.0, size), rng.within(0.0, size), 0.0);
    let mut tips = vec![tip];
    for _ in 0..moves {
        let (x, y) = (rng.within(0.0, size), rng.within(0.0, size));
        let near = 10f64.powf(rng.within(-9.0, 0.5));
        let z = rng.within(-2.0, 4.0);
        tip = match rng.below(7) {
            0 => Point3::new(tip.x, tip.y, z),
            1 => tip,
            2 => Point3::new(x, y, tip.z),
            3 => Point3::new(tip.x + near * rng.within(-1.0, 1.0), tip.y + near, z),
            4 => Point3::new(tip.x + near, tip.y - near * rng.within(0.0, 1.0), tip.z + near),
            5 => Point3::new(x, tip.y, z),
            _ => Point3::new(x, y, z),
        };
        tip.x = tip.x.clamp(-size, 2.0 * size);
        tip.y = tip.y.clamp(-size, 2.0 * size);
        tip.z = tip.z.clamp(-2.0, 4.0);
        tips.push(tip);
    }
    path_through(tips)
}

/// `z = 2 sin(x/8) cos(y/10)` milled by a ball of radius 3 mm in passes along x over a square of
/// `size` mm: the tip of the ball that touches the wave, approximately (no test of this stage
/// needs the true contact).
pub fn wave_path(size: f64, stepover: f64, chord: f64) -> Toolpath {
    let (rows, steps) = ((size / stepover) as usize + 1, (size / chord) as usize);
    let tip = |i: usize, j: usize| {
        let (x, y) = (i as f64 * chord, j as f64 * stepover);
        let z = 2.0 * (x / 8.0).sin() * (y / 10.0).cos();
        let gradient = [0.25 * (x / 8.0).cos() * (y / 10.0).cos(), -0.2 * (x / 8.0).sin() * (y / 10.0).sin()];
        let size = (1.0 + gradient[0] * gradient[0] + gradient[1] * gradient[1]).sqrt();
        let shift = 3.0 / size;
        Point3::new(x - shift * gradient[0], y - shift * gradient[1], z + shift - 3.0)
    };
    let row = |j: usize| (0..=steps).map(move |k| tip(if j.is_multiple_of(2) { k } else { steps - k }, j));
    path_through((0..rows).flat_map(row))
}

/// Cells of `cell` mm over a square from 0 to `size`.
pub fn square_grid(size: f64, cell: f64) -> Grid {
    let n = (size / cell).round() as usize;
    Grid { origin: Point2::new(0.5 * cell, 0.5 * cell), cell, nx: n, ny: n }
}
