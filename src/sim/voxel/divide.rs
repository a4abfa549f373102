//! From one cube around the stock down to bricks: a cube is divided only where the surface may pass, and
//! hands on only those moves that may come nearest somewhere in it.

use super::bricks::{BLOCK, BRICK, Block, Lattice};
use super::budget::Budget;
use super::cube::Cube;
use super::leaf::Leaf;
use super::moves::{LOOSE, MotionParts, Tangent};
use crate::stock::{Stock, corner};
use geometry::Point3;
use work::monitor::{Cancelled, Monitor, check};
use work::parallel;

/// Rounding of what bounds rest on, mm: distances are least over a move to 1e-9.
const SURE: f64 = 1e-8;

/// A cube, the parts that may be nearest in it, and whether the stock's own surface is near.
struct CubeAndParts {
    cube: Cube,
    parts: Vec<u32>,
    stock: bool,
}

/// Bounds on the signed distance of the material inside a cube, and whether the stock matters there.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seen {
    pub(super) low: f64,
    pub(super) high: f64,
    pub(super) stock: bool,
}

/// What all cubes share.
pub(super) struct Divider<'a> {
    pub(super) parts: &'a MotionParts,
    pub(super) stock: &'a Stock,
    pub(super) lattice: Lattice,
    pub(super) budget: &'a Budget,
}

/// Lists that live from cube to cube.
#[derive(Default)]
pub(super) struct Scratch {
    /// Of the last cube that was looked at: all parts that come near.
    pub(super) tangents: Vec<(u32, Tangent)>,
    lists: Vec<Vec<u32>>,
    pub(super) leaf: Leaf,
}

impl Divider<'_> {
    /// All blocks in which the surface passes; `None` where they are far too many.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub(super) fn run(&self, monitor: &dyn Monitor) -> Result<Option<Vec<Block>>, Cancelled> {
        let whole = Cube { low: [0; 3], n: self.lattice.side() };
        let mut level = vec![CubeAndParts {
            cube: whole,
            parts: (0..self.parts.all.len() as u32).collect(),
            stock: true,
        }];
        while level.first().is_some_and(|d| d.cube.n > BLOCK) {
            check(monitor)?;
            let divided = parallel::map(level.len(), |k| self.children(&level[k]));
            level = divided.into_iter().flatten().collect();
            let n = level.first().map_or(BLOCK, |d| d.cube.n);
            if self.budget.is_hopeless(level.len(), n) {
                return Ok(None);
            }
        }
        monitor.start("cutting voxels", level.len() as u64);
        let blocks = parallel::try_map(level.len(), |k| {
            check(monitor)?;
            let mut block = Block::new(level[k].cube.low.map(|x| x / BLOCK));
            self.divide(&level[k], &mut Scratch::default(), &mut block);
            block.bricks.shrink_to_fit();
            monitor.advance(1);
            Ok(block)
        })?;
        Ok(Some(blocks))
    }

    /// Those of the eight parts of a cube in which the surface may pass.
    fn children(&self, parent: &CubeAndParts) -> Vec<CubeAndParts> {
        let mut children = Vec::new();
        let mut scratch = Scratch::default();
        for cube in parent.cube.children() {
            let mut parts = Vec::new();
            let seen = self.look_at(&cube, parent, &mut scratch, &mut parts);
            if seen.high >= -SURE && seen.low <= SURE {
                children.push(CubeAndParts { cube, parts, stock: seen.stock });
            }
        }
        children
    }

    fn divide(&self, parent: &CubeAndParts, scratch: &mut Scratch, block: &mut Block) {
        for cube in parent.cube.children() {
            let mut parts = scratch.lists.pop().unwrap_or_default();
            let seen = self.look_at(&cube, parent, scratch, &mut parts);
            if seen.high >= -SURE && seen.low <= SURE {
                if cube.n == BRICK {
                    let mut leaf = std::mem::take(&mut scratch.leaf);
                    leaf.fill(self, &cube, &parts, seen.stock, scratch);
                    leaf.store(self, &cube, block);
                    scratch.leaf = leaf;
                } else {
                    let child = CubeAndParts { cube, parts, stock: seen.stock };
                    self.divide(&child, scratch, block);
                    parts = child.parts;
                }
            }
            scratch.lists.push(parts);
        }
    }

    /// As [`Divider::look`], at all samples of a cube and those around it, which cells at its border share.
    fn look_at(
        &self,
        cube: &Cube,
        parent: &CubeAndParts,
        scratch: &mut Scratch,
        kept: &mut Vec<u32>,
    ) -> Seen {
        let centre = self.lattice.centre(cube);
        let half = 0.5 * f64::from(cube.n + 1) * self.lattice.pitch;
        self.look(&centre, half, SURE, &parent.parts, parent.stock, scratch, kept)
    }

    /// Bounds within the cube of half side `half` around `centre`; `kept` becomes what may be nearest in it.
    /// A cube more than `beyond` outside the stock is not looked at any further.
    pub(super) fn look(
        &self,
        centre: &Point3,
        half: f64,
        beyond: f64,
        parts: &[u32],
        stock: bool,
        scratch: &mut Scratch,
        kept: &mut Vec<u32>,
    ) -> Seen {
        kept.clear();
        let reach = half * 3f64.sqrt();
        let band = self.lattice.band();
        let from_stock = if stock { self.stock.foot(centre).0 } else { -2.0 * (reach + band) };
        if from_stock > reach + beyond {
            return Seen { low: from_stock - reach, high: f64::INFINITY, stock };
        }
        let tangents = &mut scratch.tangents;
        tangents.clear();
        let (mut best, mut least, mut limit) = (None, f64::INFINITY, band + reach);
        for &k in parts {
            let part = &self.parts.all[k as usize];
            let Some(t) = self.parts.tangent(part, centre, reach, limit, LOOSE) else { continue };
            if t.distance + t.slack < least {
                (best, least) = (Some((part, t)), t.distance + t.slack);
                limit = limit.min(least + 2.0 * reach);
            }
            tangents.push((k, t));
        }
        let above =
            best.map_or([f64::INFINITY; 8], |(part, t)| self.parts.corners(part, &t, centre, half, LOOSE));
        let mut nearest = band;
        for (k, t) in tangents.iter() {
            let size = t.gradient.map(f64::abs).sum();
            let low = t.lower - half * size;
            nearest = nearest.min(low);
            let reaches = |c: usize| t.lower + t.gradient.dot(&corner(c)) * half < above[c] + SURE;
            // What lies beyond the band has no effect.
            if low < band && t.distance - t.slack < limit && (0..8).any(reaches) {
                kept.push(*k);
            }
        }
        let farthest = above.into_iter().fold(f64::NEG_INFINITY, f64::max).min(band);
        Seen {
            low: (from_stock - reach).max(-farthest),
            high: (from_stock + reach).max(-nearest),
            stock: stock && from_stock + reach > -band,
        }
    }
}
