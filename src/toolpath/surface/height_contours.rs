//! Contours of the height at which a dropped cutter comes to rest: where it touches the part at one height of
//! its tip.
//!
//! Enters: a part and a cutter that can be dropped on it. Leaves: closed curves of the plan view, the part's
//! side to their left, on which the cutter comes no lower than a level, and places on them.
//!
//! A lattice tells where the cutter at the level would cut into the part; along its lines the border of that
//! is searched for. So walls are followed that are narrower in the plan view than its cells, however steep.
//!
//! Limits: what lies between two neighbouring lines of the lattice, a slot or a rib of the offset surface, is
//! not seen.

use std::collections::BTreeMap;

use crate::vocabulary::PlanError;
use drop_cutter::{DropCutter, PlanGrid};
use geometry::{Aabb, Point2, Vector2};
use work::monitor::{self, Monitor};

/// Side of a cell as a share of the cutter's radius.
const CELL_OVER_RADIUS: f64 = 1.0 / 16.0;

/// Cells are wider than that where a part would take more than this many, or more than fit into the memory.
const MOST_CELLS: f64 = 4e6;
const BYTES_A_CELL: f64 = 24.0;

/// Rows of the lattice between two questions whether to go on.
const BAND: usize = 16;

/// The cutter may cut in by this, mm: on level ground heights differ by rounding.
const ROUNDING: f64 = 1e-7;

/// How closely a place is found, mm.
const PRECISION: f64 = 1e-9;

/// Looks for a place at most.
const LOOKS: usize = 60;

/// First step away from a curve, as a share of the farthest.
const FIRST_STEP: f64 = 0.02;

/// The heights of a cutter over a lattice.
pub(crate) struct HeightContours<'a> {
    drop: DropCutter<'a>,
    grid: PlanGrid,
    cell: f64,
    /// Of the tip at the nodes, mm, row by row along x.
    tips: Vec<f64>,
}

impl<'a> HeightContours<'a> {
    /// Over a part with these bounds, for a cutter of this radius, mm, in a memory, bytes.
    ///
    /// # Errors
    /// Where the part is too wide for a lattice, or when cancelled.
    pub fn new(
        drop: DropCutter<'a>,
        bounds: &Aabb,
        radius: f64,
        memory: u64,
        monitor: &dyn Monitor,
    ) -> Result<Self, PlanError> {
        let size = bounds.size();
        let least = CELL_OVER_RADIUS * radius;
        let most = MOST_CELLS.min(memory as f64 / BYTES_A_CELL).max(1.0);
        let cell = least.max(((size.x + 2.0 * radius) * (size.y + 2.0 * radius) / most).sqrt());
        // Outermost nodes lie where the cutter does not come to the part.
        let margin = radius + 1.5 * cell;
        let first = [bounds.min.x - margin, bounds.min.y - margin];
        let counts = [size.x, size.y].map(|size| ((size + 2.0 * margin) / cell).ceil() as usize + 1);
        let too_many = || PlanError::TooMany { step: cell, x: size.x, y: size.y };
        let grid = PlanGrid::new(first, [cell; 2], counts).ok_or_else(too_many)?;
        let bands = work::parallel::try_map(counts[1].div_ceil(BAND), |band| {
            monitor::check(monitor)?;
            let from = band * BAND;
            let counts = [counts[0], BAND.min(counts[1] - from)];
            let rows = PlanGrid::new(grid.point(0, from), [cell; 2], counts).ok_or_else(too_many)?;
            Ok::<_, PlanError>(drop.over_grid(&rows))
        })?;
        let tips = bands.iter().flatten().map(|drop| drop.tip_z).collect();
        Ok(Self { drop, grid, cell, tips })
    }

    /// What is dropped.
    pub fn drop(&self) -> &DropCutter<'a> {
        &self.drop
    }

    /// Width of a cell, mm.
    pub fn cell(&self) -> f64 {
        self.cell
    }

    /// How far the cutter that has come to rest at a place stands above a level, mm; minus infinity where
    /// nothing holds it.
    fn above(&self, at: &Point2, level: f64) -> f64 {
        self.drop.at(at.x, at.y).map_or(f64::NEG_INFINITY, |drop| drop.tip_z) - level - ROUNDING
    }

    /// All contours of a level: closed, the part to their left.
    pub fn curves(&self, level: f64) -> Vec<Vec<Point2>> {
        let mut next = self.steps(level);
        let mut curves = Vec::new();
        while let Some((&start, _)) = next.first_key_value() {
            let (mut edge, mut points) = (start, Vec::new());
            while let Some((following, point)) = next.remove(&edge) {
                points.push(point);
                edge = following;
            }
            curves.push(points);
        }
        curves
    }

    /// The crossed edges of the lattice by number: which one follows, and where the edge is crossed. An edge
    /// is that of node `n` along x (2n) or along y (2n + 1).
    fn steps(&self, level: f64) -> BTreeMap<usize, (usize, Point2)> {
        let [nx, ny] = self.grid.counts();
        let holds = |n: usize| self.tips[n] > level + ROUNDING;
        let point = |n: usize| Point2::from(self.grid.point(n % nx, n / nx));
        let mut next = BTreeMap::new();
        for j in 0..ny - 1 {
            for i in 0..nx - 1 {
                let n = j * nx + i;
                // Corners and sides of the cell, counterclockwise; side k lies between corners k and k + 1.
                let corners = [n, n + 1, n + 1 + nx, n + nx];
                let held = corners.map(holds);
                if held == [held[0]; 4] {
                    continue;
                }
                let sides = [2 * n, 2 * (n + 1) + 1, 2 * (n + nx), 2 * n + 1];
                let leaves = |k: usize| held[k] && !held[(k + 1) % 4];
                let enters = |k: usize| !held[k] && held[(k + 1) % 4];
                let is_saddle = (0..4).filter(|&k| leaves(k)).count() == 2;
                let turn = if is_saddle {
                    let middle = point(n) + Vector2::new(0.5, 0.5) * self.cell;
                    if self.above(&middle, level) > 0.0 { 1 } else { 3 }
                } else {
                    0
                };
                for k in (0..4).filter(|&k| leaves(k)) {
                    let to = if is_saddle { Some((k + turn) % 4) } else { (0..4).find(|&k| enters(k)) };
                    let Some(to) = to else { continue };
                    let crossing = self.between(point(corners[k]), point(corners[(k + 1) % 4]), level);
                    next.insert(sides[k], (sides[to], crossing));
                }
            }
        }
        next
    }

    /// The last place on the way from one where the cutter at the level does not cut in to one where it does.
    fn between(&self, mut inside: Point2, mut outside: Point2, level: f64) -> Point2 {
        let [mut above, mut below] = [inside, outside].map(|at| self.above(&at, level));
        for look in 0..LOOKS {
            if -below < ROUNDING || (outside - inside).norm() < PRECISION {
                break;
            }
            let share =
                if look % 3 == 2 || below == f64::NEG_INFINITY { 0.5 } else { above / (above - below) };
            let at = inside + (outside - inside) * share;
            let found = self.above(&at, level);
            if found > 0.0 {
                (inside, above) = (at, found);
            } else {
                (outside, below) = (at, found);
            }
        }
        outside
    }

    /// The place of a contour nearest to a place along the unit vector `out`, to which the cutter does not
    /// cut in, or against it; `None` where there is none within `reach`, mm.
    pub fn beside(&self, at: Point2, out: &Vector2, reach: f64, level: f64) -> Option<Point2> {
        let cuts = |at: &Point2| self.above(at, level) > 0.0;
        let starts_inside = cuts(&at);
        let way = if starts_inside { *out } else { -out };
        let (mut last, mut far) = (at, FIRST_STEP * reach);
        loop {
            let there = at + way * far;
            if cuts(&there) != starts_inside {
                let [inside, outside] = if starts_inside { [last, there] } else { [there, last] };
                return Some(self.between(inside, outside, level));
            }
            if far >= reach {
                return None;
            }
            (last, far) = (there, (2.0 * far).min(reach));
        }
    }
}
