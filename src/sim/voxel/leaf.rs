//! The samples of one brick.

use super::bricks::{BAND, BRICK, Block, Brick, SAMPLES, STEPS};
use super::capsule::{Kernel, LANES, Lanes};
use super::cube::Cube;
use super::divide::{Divider, Scratch};
use super::moves::Tangent;
use crate::NOT_CUT;
use geometry::{Point3, Vector3};
use work::lanes;

/// Samples along the side of what is worked out at once.
const SIDE: u32 = 4;

/// What is known of the samples of one brick; `x` runs fastest.
pub(super) struct Leaf {
    distances: [i16; SAMPLES],
    /// Index of the nearest part, or [`NOT_CUT`].
    nearest: [u32; SAMPLES],
    kernels: Vec<Kernel>,
    /// What no kernel answers for.
    others: Vec<(Tangent, u32)>,
    kept: Vec<u32>,
}

impl Default for Leaf {
    fn default() -> Self {
        Self {
            distances: [0; SAMPLES],
            nearest: [NOT_CUT; SAMPLES],
            kernels: Vec::new(),
            others: Vec::new(),
            kept: Vec::new(),
        }
    }
}

/// Where sample `lane` of a small cube stands in its brick.
fn place(low: [u32; 3], lane: usize) -> usize {
    let at = |axis: usize| low[axis] as usize + (lane >> (2 * axis) & 3);
    at(0) + (BRICK as usize) * (at(1) + (BRICK as usize) * at(2))
}

/// The way from the middle of a small cube to sample `lane`, in samples.
fn offset(lane: usize) -> Vector3 {
    Vector3::from_fn(|axis, _| (lane >> (2 * axis) & 3) as f64 - 0.5 * f64::from(SIDE - 1))
}

impl Leaf {
    /// Works out all samples of a brick.
    pub(super) fn fill(
        &mut self,
        divider: &Divider<'_>,
        cube: &Cube,
        parts: &[u32],
        stock: bool,
        scratch: &mut Scratch,
    ) {
        for k in 0..(BRICK / SIDE).pow(3) {
            let low = [k % 2, k / 2 % 2, k / 4].map(|x| x * SIDE);
            let small = Cube { low: std::array::from_fn(|i| cube.low[i] + low[i]), n: SIDE };
            self.fill_small(divider, &small, low, parts, stock, scratch);
        }
    }

    fn fill_small(
        &mut self,
        divider: &Divider<'_>,
        cube: &Cube,
        low: [u32; 3],
        parts: &[u32],
        stock: bool,
        scratch: &mut Scratch,
    ) {
        let lattice = &divider.lattice;
        let (centre, band) = (lattice.centre(cube), lattice.band());
        let half = 0.5 * f64::from(SIDE - 1) * lattice.pitch;
        let mut kept = std::mem::take(&mut self.kept);
        let seen = divider.look(&centre, half, band, parts, stock, scratch, &mut kept);
        let mut distances = [band; LANES];
        let mut nearest = [NOT_CUT; LANES];
        // Beyond the band only the sign counts.
        if seen.low < band && seen.high > -band {
            self.sweep(divider, &centre, half, &kept, &scratch.tangents, &mut distances, &mut nearest);
            for lane in 0..LANES {
                let q = centre + offset(lane) * lattice.pitch;
                let from_stock = if seen.stock { divider.stock.foot(&q).0 } else { -band };
                if from_stock >= -distances[lane] {
                    (distances[lane], nearest[lane]) = (from_stock, NOT_CUT);
                } else {
                    distances[lane] = -distances[lane];
                }
            }
        } else if seen.high <= -band {
            distances = [-band; LANES];
        }
        for lane in 0..LANES {
            let at = place(low, lane);
            let steps = distances[lane] * (STEPS / lattice.pitch);
            let most = f64::from(i16::MAX);
            // Away from zero by a half and cut off: a call for rounding would cost more than all the rest.
            let half = if steps < 0.0 { -0.5 } else { 0.5 };
            self.distances[at] = (steps + half).clamp(-most, most) as i16;
            self.nearest[at] = nearest[lane];
        }
        self.kept = kept;
    }

    /// Distances from the swept volume below the band.
    fn sweep(
        &mut self,
        divider: &Divider<'_>,
        centre: &Point3,
        half: f64,
        kept: &[u32],
        tangents: &[(u32, Tangent)],
        distances: &mut [f64; LANES],
        nearest: &mut [u32; LANES],
    ) {
        let pitch = divider.lattice.pitch;
        let reach = half * 3f64.sqrt();
        self.kernels.clear();
        self.others.clear();
        let mut tangents = tangents.iter();
        for &k in kept {
            let part = &divider.parts.all[k as usize];
            if let Some(kernel) = Kernel::new(divider.parts, part, k, centre, reach) {
                self.kernels.push(kernel);
            } else if let Some((_, tangent)) = tangents.find(|(of, _)| *of == k) {
                self.others.push((*tangent, k));
            }
        }
        if let (Some(radius), false) = (divider.parts.solid.ball(), self.kernels.is_empty()) {
            let kernels = &self.kernels;
            let near = lanes::dispatch(
                #[inline(always)]
                || Lanes::of(kernels, pitch as f32),
            );
            for lane in 0..LANES {
                let distance = f64::from(near.squared[lane]).sqrt() - radius;
                if distance < distances[lane] {
                    (distances[lane], nearest[lane]) = (distance, near.part[lane]);
                }
            }
        }
        let band = divider.lattice.band();
        // The nearest first: it spares most of the others.
        self.others.sort_by(|a, b| a.0.distance.total_cmp(&b.0.distance));
        for (tangent, k) in &self.others {
            let part = &divider.parts.all[*k as usize];
            for lane in 0..LANES {
                let away = offset(lane) * pitch;
                let now = distances[lane];
                // Deeper than the band is deep enough.
                if now <= -band || tangent.lower + tangent.gradient.dot(&away) >= now {
                    continue;
                }
                if tangent.distance + tangent.slack + away.norm() <= -band {
                    (distances[lane], nearest[lane]) = (-band, *k);
                } else if let Some(found) = divider.parts.distance(part, &(centre + away), now) {
                    (distances[lane], nearest[lane]) = (found, *k);
                }
            }
        }
    }

    /// Keeps the brick if the surface passes in it or in a cell that it has a corner of.
    pub(super) fn store(&self, divider: &Divider<'_>, cube: &Cube, block: &mut Block) {
        if !self.is_near() {
            return;
        }
        let mut brick =
            Brick { distances: self.distances, nearest: [u16::MAX; SAMPLES], moves: Box::default() };
        let mut moves: Vec<u32> = Vec::new();
        let mut last = NOT_CUT;
        let mut slot = u16::MAX;
        for (at, &part) in self.nearest.iter().enumerate() {
            if part == NOT_CUT {
                continue;
            }
            let index = divider.parts.all[part as usize].index;
            if index != last {
                let known = moves.iter().position(|&m| m == index);
                slot = known.unwrap_or(moves.len()) as u16;
                last = index;
                if known.is_none() {
                    moves.push(index);
                }
            }
            brick.nearest[at] = slot;
        }
        brick.moves = moves.into_boxed_slice();
        if divider.budget.take(brick.bytes()) {
            block.put(cube.low, brick);
        }
    }

    /// The distance changes by no more than a place moves. A cell outside that shares a face with the brick
    /// has other corners one pitch from known ones, and so on at edges and corners.
    fn is_near(&self) -> bool {
        /// Distances of cells outside that share 0, 1, 2 or 3 directions, with a hair for rounding.
        const NEAR: [i16; 4] = [0, near(1.0), near(std::f64::consts::SQRT_2), near(1.7320509)];
        const fn near(pitches: f64) -> i16 {
            (pitches * STEPS * 1.005) as i16
        }
        let inside = self.distances[0] < 0;
        let last = BRICK as usize - 1;
        self.distances.iter().enumerate().any(|(k, &d)| {
            let on_face = |i: usize| usize::from(i == 0 || i == last);
            let n = BRICK as usize;
            let faces = on_face(k % n) + on_face(k / n % n) + on_face(k / n / n);
            (d < 0) != inside || d.abs() <= NEAR[faces]
        })
    }
}

const _: () = assert!(1.7320509 * 1.005 < BAND && BAND * STEPS <= 32768.0);
