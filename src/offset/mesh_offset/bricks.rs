//! The lattice near the level set: bricks of 8 × 8 × 8 cells, found from coarse to fine.
//!
//! The distance changes by no more than a place moves, so that a cube whose middle is farther from the level
//! set than its corners are from the middle holds nothing of it.

use super::level_set::LevelSet;
use super::{OffsetError, OffsetSettings};
use geometry::{Point3, Vector3};
use work::monitor::{Monitor, check};
use work::parallel;

/// Cells a side of a brick.
pub(super) const SIDE: usize = 8;

/// Corners a side of a brick.
pub(super) const CORNERS: usize = SIDE + 1;

/// What a brick takes, bytes: values at its corners and crossings of its edges while it is worked on, and
/// some 90 cells with a vertex, two triangles and the tables to trim and to look through them (measured: 30
/// to 45 thousand).
const BYTES: f64 = 48e3;

/// Share of the coarse cubes near the level set that is sure to be crossed by it.
const COARSE_SHARE: f64 = 0.1;

/// A cell that is said to fit is wider than the count asks for by this factor.
const SPARE: f64 = 1.2;

/// What rounding may add to a distance, as a share of a cell.
const ROUNDING: f64 = 1e-6;

/// The lattice.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lattice {
    /// Corner 0.
    pub low: Point3,
    /// Side of a cell, mm.
    pub cell: f64,
    /// How often a cube around everything is halved to get bricks.
    levels: u32,
}

impl Lattice {
    /// Around the whole level set.
    fn around(level: &LevelSet, cell: f64) -> Self {
        let bounds = level.mesh().bounds();
        let beyond = level.distance() + 2.0 * cell;
        let bricks_long = ((bounds.size().amax() + 2.0 * beyond) / (cell * SIDE as f64)).ceil().max(1.0);
        // Laid so that no corner of a box lies on it by chance.
        let aside = Vector3::new(0.137, 0.219, 0.311) * cell;
        let low = bounds.min - Vector3::from_element(beyond) - aside;
        Self { low, cell, levels: bricks_long.log2().ceil() as u32 }
    }

    /// Whether the level set may pass through a cube of `side` cells.
    fn is_near(&self, level: &LevelSet, at: [u32; 3], side: u32) -> bool {
        let reach = (0.5 * 3f64.sqrt() * f64::from(side) + ROUNDING) * self.cell;
        level.excess(&self.middle(at, side)).abs() <= reach
    }

    /// Corner `at`.
    pub fn corner(&self, at: [u32; 3]) -> Point3 {
        self.low + Vector3::from_fn(|i, _| f64::from(at[i]) * self.cell)
    }

    /// Middle of a cube of `side` cells with least corner `at`.
    fn middle(&self, at: [u32; 3], side: u32) -> Point3 {
        self.corner(at) + Vector3::from_element(0.5 * f64::from(side) * self.cell)
    }
}

/// A brick: its cells through which the level set passes, and by how much their corners are farther from the
/// mesh than that.
pub(super) struct Brick {
    /// Its least corner in the lattice.
    pub low: [u32; 3],
    /// Excess of the distance at the corners of its crossed cells, `[z][y][x]`; NaN at others.
    pub values: Box<[f64]>,
    /// Its crossed cells, `[z][y][x]`, ascending.
    pub cells: Vec<u16>,
}

/// All bricks with crossed cells, in the order of their least corners.
pub(super) struct Bricks {
    pub lattice: Lattice,
    pub bricks: Vec<Brick>,
}

/// Index of a corner within a brick.
pub(super) fn corner_index([x, y, z]: [usize; 3]) -> usize {
    (z * CORNERS + y) * CORNERS + x
}

/// Place of a cell within a brick.
pub(super) fn cell_place(cell: u16) -> [usize; 3] {
    let cell = usize::from(cell);
    [cell % SIDE, cell / SIDE % SIDE, cell / (SIDE * SIDE)]
}

/// Number of a cell within a brick.
pub(super) fn cell_number([x, y, z]: [usize; 3]) -> u16 {
    ((z * SIDE + y) * SIDE + x) as u16
}

/// The eight cubes of half the side.
fn halves(at: [u32; 3], half: u32) -> impl Iterator<Item = [u32; 3]> {
    (0..8u32).map(move |k| std::array::from_fn(|i| at[i] + (k >> i & 1) * half))
}

impl Bricks {
    /// The bricks near the level set.
    ///
    /// # Errors
    /// [`OffsetError::Memory`] before it is used, [`OffsetError::Cancelled`].
    pub fn around(
        level: &LevelSet,
        settings: &OffsetSettings,
        monitor: &dyn Monitor,
    ) -> Result<Self, OffsetError> {
        let most = settings.memory / BYTES;
        monitor.start("lattice around the offset surface", 0);
        let lattice = Lattice::around(level, settings.cell);
        let Some(cubes) = cubes(level, &lattice, most, monitor)? else {
            // The count of coarser cells tells what finer ones would take: four times as many for half the
            // side.
            let (mut coarser, mut cell) = (None, settings.cell);
            while coarser.is_none() && cell < level.distance() * 1e6 {
                cell *= 2.0;
                coarser = self::cubes(level, &Lattice::around(level, cell), most, monitor)?;
            }
            let count = coarser.map_or(most, |cubes| cubes.len() as f64);
            return Err(OffsetError::Memory {
                cell: settings.cell,
                needed: count * BYTES * (cell / settings.cell).powi(2) * 1e-6,
                allowed: settings.memory * 1e-6,
                fitting: cell * (count / most).sqrt() * SPARE,
            });
        };
        monitor.start("distances near the offset surface", cubes.len() as u64);
        let bricks = parallel::try_map(cubes.len(), |c| {
            check(monitor)?;
            monitor.advance(1);
            Ok::<_, OffsetError>(brick(level, &lattice, cubes[c]))
        })?;
        Ok(Self { lattice, bricks: bricks.into_iter().filter(|b| !b.cells.is_empty()).collect() })
    }

    /// Whether the cell around a place is crossed.
    pub fn crosses(&self, x: &Point3) -> bool {
        let off = (x - self.lattice.low) / self.lattice.cell;
        let at: [u32; 3] = std::array::from_fn(|i| off[i].max(0.0) as u32);
        let low = at.map(|x| x / SIDE as u32 * SIDE as u32);
        let cell = cell_number(std::array::from_fn(|i| (at[i] - low[i]) as usize));
        self.find(low).is_some_and(|k| self.bricks[k].cells.binary_search(&cell).is_ok())
    }

    /// The number of the brick with this least corner.
    pub fn find(&self, low: [u32; 3]) -> Option<usize> {
        self.bricks.binary_search_by_key(&low, |b| b.low).ok()
    }
}

/// The cubes of a brick's size near the level set, ascending; `None` when there are more than `most`.
fn cubes(
    level: &LevelSet,
    lattice: &Lattice,
    most: f64,
    monitor: &dyn Monitor,
) -> Result<Option<Vec<[u32; 3]>>, OffsetError> {
    let mut cubes: Vec<[u32; 3]> = vec![[0; 3]];
    for k in (0..=lattice.levels).rev() {
        check(monitor)?;
        let side = (SIDE as u32) << k;
        let kept = parallel::map(cubes.len(), |c| lattice.is_near(level, cubes[c], side));
        cubes = cubes.iter().zip(kept).filter(|(_, kept)| *kept).map(|(c, _)| *c).collect();
        // A sheet passes through four of the eight halves of a cube; of coarse cubes some hold next to
        // nothing of it.
        let ahead = if k > 0 { COARSE_SHARE * 4f64.powi(k as i32) } else { 1.0 };
        if cubes.len() as f64 * ahead > most {
            return Ok(None);
        }
        if k > 0 {
            cubes = cubes.iter().flat_map(|&c| halves(c, side / 2)).collect();
        }
    }
    cubes.sort_unstable();
    Ok(Some(cubes))
}

fn brick(level: &LevelSet, lattice: &Lattice, low: [u32; 3]) -> Brick {
    let near = |at: [u32; 3], side: u32| lattice.is_near(level, at, side);
    let mut values = vec![f64::NAN; CORNERS * CORNERS * CORNERS].into_boxed_slice();
    let mut cells = Vec::new();
    for four in halves(low, 4).filter(|&at| near(at, 4)) {
        for two in halves(four, 2).filter(|&at| near(at, 2)) {
            for k in 0..27u32 {
                let at: [u32; 3] = [two[0] + k % 3, two[1] + k / 3 % 3, two[2] + k / 9];
                let value = &mut values[corner_index(std::array::from_fn(|i| (at[i] - low[i]) as usize))];
                if value.is_nan() {
                    *value = level.excess(&lattice.corner(at));
                }
            }
            for cell in halves(two, 1) {
                let place = std::array::from_fn(|i| (cell[i] - low[i]) as usize);
                let inside = corners_of(place).map(|c| values[c] < 0.0);
                if inside.iter().any(|&b| b != inside[0]) {
                    cells.push(cell_number(place));
                }
            }
        }
    }
    cells.sort_unstable();
    Brick { low, values, cells }
}

/// The eight corners of a cell; bit `i` of the number of a corner tells its side along axis `i`.
pub(super) fn corners_of(place: [usize; 3]) -> [usize; 8] {
    std::array::from_fn(|k| corner_index(std::array::from_fn(|i| place[i] + (k >> i & 1))))
}
