//! Where a line first leaves the material: found in the samples, then exactly by the moves that are nearest
//! around.
//!
//! # The bound
//! Of all moves only those are asked that are the nearest at a corner of the cell. Another one may cut deeper
//! in between, but the distance from a tool in one pose is bent by no more than its sharpest radius r: where
//! it comes down to d between samples `p` apart, linear interpolation of samples that are no farther from it
//! gives no more than `d + p²/4r`. So below where the interpolated distance is that, all is material for
//! certain. A tool with a sharp edge is nearer to each corner than the way there, √3/2 p at most.

use super::bricks::{Lattice, STEPS};
use super::engine::VoxelEngine;
use super::surface::Foot;
use super::voxels::Voxels;
use crate::NOT_CUT;
use geometry::{Point3, Vector3};

/// A cell is looked at this share of the line's way through it from both of its ends, and in the middle: on
/// its faces the samples of one cell say what those of the next do, so that a cell with the surface cannot be
/// stepped over.
const FROM_ENDS: f64 = 1e-6;

/// Steps back to where all is material, in voxels, and how many there are at most.
const BACK: f64 = 0.125;
const MOST_BACK: usize = 40;

/// Steps of Newton's method and halvings, and what they reach, mm.
const MOST_LOOKS: usize = 30;
const REACHED: f64 = 1e-9;

/// Where so much is left, mm, there is no material within a voxel.
const UNREACHED: f64 = 1e-6;

/// The cut surface's normal is taken this far inside of the material, in voxels: an edge of the tool has many
/// itself.
const BENEATH: f64 = 0.01;

/// What samples are off besides rounding, mm: turning balls run on chords.
const CHORDS: f64 = 1.1e-5;

/// A place at which a line leaves the material.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LineExit {
    /// How far along the line, mm.
    pub s: f64,
    /// The move that cut there.
    pub index: u32,
    /// Unit normal of the cut surface, away from the material.
    pub normal: Vector3,
    /// How much earlier the line may leave it, mm.
    pub uncertain: f64,
}

/// The cell around a place: the distance of the material by trilinear interpolation, mm, and what is nearest
/// at its corners.
struct Around {
    distance: f64,
    cut_by: [u32; 8],
}

impl Voxels {
    fn around(&self, q: &Point3) -> Option<Around> {
        let lattice = &self.bricks.lattice;
        let at = (q - lattice.origin) / lattice.pitch;
        if !(0..3).all(|i| at[i] >= 0.0 && at[i] < f64::from(lattice.size[i] - 1)) {
            return None;
        }
        let low = at.map(f64::floor);
        let share = at - low;
        let low: [u32; 3] = low.map(|x| x as u32).into();
        // Where the surface passes all corners are kept.
        self.bricks.holding(low)?;
        let mut around = Around { distance: 0.0, cut_by: [NOT_CUT; 8] };
        for k in 0..8 {
            let sample = self.sample(std::array::from_fn(|i| low[i] + (k >> i & 1)))?;
            let weight: f64 =
                (0..3).map(|i| if k >> i & 1 == 1 { share[i] } else { 1.0 - share[i] }).product();
            around.distance += weight * sample.distance;
            around.cut_by[k as usize] = sample.cut_by;
        }
        Some(around)
    }
}

/// Where the line `point + s normal` is looked at from `low` to `high`: at both limits, and in every cell
/// that it passes.
fn looks_in_cells(
    lattice: &Lattice,
    point: &Point3,
    normal: &Vector3,
    [low, high]: [f64; 2],
) -> impl Iterator<Item = f64> {
    let (from, along) = ((point - lattice.origin) / lattice.pitch, normal / lattice.pitch);
    let mut crossings = vec![low, high];
    for i in (0..3).filter(|&i| along[i] != 0.0) {
        let ends = [low, high].map(|s| from[i] + along[i] * s);
        let (first, last) = (ends[0].min(ends[1]).ceil() as i64, ends[0].max(ends[1]).floor() as i64);
        crossings.extend((first..=last).map(|plane| ((plane as f64 - from[i]) / along[i]).clamp(low, high)));
    }
    crossings.sort_by(f64::total_cmp);
    let within = (1..crossings.len()).flat_map(move |k| {
        let [a, b] = [crossings[k - 1], crossings[k]];
        [FROM_ENDS, 0.5, 1.0 - FROM_ENDS].map(|share| a + share * (b - a))
    });
    std::iter::once(low).chain(within).chain(std::iter::once(high))
}

impl VoxelEngine<'_> {
    /// The first place at which the line `point + s normal`, from `low` up to `high`, leaves what
    /// [`VoxelEngine::cut`] of the same engine has left through a cut; `low` where it is outside from the
    /// beginning. `None` where it does not, or leaves through the stock's own surface.
    ///
    /// # Tolerance
    /// [`LineExit::uncertain`], to one side; to the other 1e-5 mm.
    pub fn first_exit(
        &self,
        voxels: &Voxels,
        point: &Point3,
        normal: &Vector3,
        [low, high]: [f64; 2],
    ) -> Option<LineExit> {
        let at = |s: f64| point + normal * s;
        let looks = looks_in_cells(&voxels.bricks.lattice, point, normal, [low, high]);
        let mut inside = None;
        for s in looks {
            let Some(around) = voxels.around(&at(s)) else { continue };
            if around.distance < 0.0 {
                inside = Some((s, around.distance));
                continue;
            }
            let (guess, known) = match inside {
                Some((before, distance)) => {
                    let share: f64 = distance / (distance - around.distance);
                    (before + share * (s - before), true)
                }
                // The material may end on the way from where no samples are kept.
                None => (s, false),
            };
            let here = voxels.around(&at(guess)).map_or(around.cut_by, |around| around.cut_by);
            let (exit, foot) = self.root(point, normal, guess, voxels.voxel(), &here);
            let begun = !known && (s == low || foot.distance > UNREACHED);
            return self.exit_at(voxels, point, normal, if begun { low } else { exit }, foot.cut_by);
        }
        None
    }

    /// Where a line leaves what these moves leave, within a voxel of a guess, and how the material lies
    /// there.
    fn root(&self, point: &Point3, normal: &Vector3, guess: f64, pitch: f64, cut_by: &[u32]) -> (f64, Foot) {
        let (mut low, mut high) = (guess - pitch, guess + pitch);
        let mut s = guess;
        let mut foot = self.foot(&(point + normal * s), cut_by);
        for _ in 0..MOST_LOOKS {
            if foot.distance.abs() < REACHED {
                break;
            }
            *(if foot.distance < 0.0 { &mut low } else { &mut high }) = s;
            let newton = s - foot.distance / foot.normal.dot(normal);
            s = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
            foot = self.foot(&(point + normal * s), cut_by);
        }
        (s, foot)
    }

    fn exit_at(
        &self,
        voxels: &Voxels,
        point: &Point3,
        normal: &Vector3,
        s: f64,
        index: u32,
    ) -> Option<LineExit> {
        if index == NOT_CUT {
            return None;
        }
        let pitch = voxels.voxel();
        let beneath: Foot = self.foot(&(point + normal * (s - BENEATH * pitch)), &[index]);
        let sure = -self.hidden(pitch);
        let mut uncertain = 0.0;
        let mut last: Option<(f64, f64)> = None;
        for k in 0..MOST_BACK {
            let back = BACK * pitch * k as f64;
            let Some(around) = voxels.around(&(point + normal * (s - back))) else { break };
            if around.distance <= sure {
                uncertain = last.map_or(0.0, |(before, distance)| {
                    before + (back - before) * (distance - sure) / (distance - around.distance)
                });
                break;
            }
            (uncertain, last) = (back, Some((back, around.distance)));
        }
        Some(LineExit { s, index, normal: beneath.normal, uncertain })
    }

    /// By how much a move that no corner of a cell sees may be nearer inside of it, mm.
    fn hidden(&self, pitch: f64) -> f64 {
        let (radius, way) = (self.parts.solid.sharpest(), 0.5 * 3f64.sqrt() * pitch);
        // Inside of the tool, where samples may lie, it is bent more.
        let least = radius - 2.0 * way;
        let bent = if least > 0.0 { 0.25 * pitch * pitch / least } else { f64::INFINITY };
        bent.min(way) + CHORDS + pitch / STEPS
    }
}
