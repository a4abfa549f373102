//! Deviation, gouges and uncut places of one cut surface.
//!
//! Enters: a cut surface over its grid, and the part. Leaves: signed deviation at the design point above
//! or below every cell centre, and the figures of what lies below and above the design, each with the
//! bound of its error. mm.

use super::beside_border::Borders;
use super::closer::{Promising, Square, Value};
use super::creases::Creases;
use super::cut_surface::{CutSurface, Deviation};
use super::every_move::EveryMove;
use super::figures::{
    DeviationFigures, GougeFigures, GougeRegion, Limits, NUMERICAL_FLOOR, UncutFigures, UncutRegion,
};
use super::meetings::Meetings;
use super::regions::connected;
use super::unseen::{Dip, dips};
use super::walls::Walls;
use crate::beneath::{Bounding, corner_at, face_before, leads_out, thinner};
use crate::closer;
use crate::facing::LEAST_FACING;
use geometry::{Point2, Point3, Vector2, Vector3};
use motion::{Cutters, Toolpath};
use part::{Part, SurfaceGrid, SurfacePoint};
use sim::{Grid, NOT_CUT};
use work::monitor::{self, Cancelled, Monitor};

/// Regions listed one by one in the figures; the rest is counted.
const LISTED_REGIONS: usize = 20;

/// Cells that are searched between their centres, the most promising ones: 32 bytes each. What the others
/// promise at most goes into the bound, so that fewer leave it wider.
const MOST_SEARCHED: usize = 1 << 16;

/// A place above the uncut tolerance is a scallop, or half of one on the part's border, when a pass
/// came down to the design there and no cell rises above the highest ridge by more than this share.
const RIDGE_IS_TOP: f64 = 1e-3;

/// Tracks of fewer cells beat with them. Wider ones show in their cells as they are.
const NARROW: usize = 3;

/// Where so large a share of the cells lies in such tracks, the mean deviation is taken at places spread over
/// the cells.
const CROWDED_SHARE: f64 = 0.25;

/// Powers of the inverse of the number whose cube is one more than itself: their multiples fill a square
/// evenly (M. Roberts, "The unreasonable effectiveness of quasirandom sequences", 2018).
const EVEN: [f64; 2] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_3];

/// The design surface is sampled in so many bands of rows, one after the other: it takes 40 bytes a
/// cell, more than all else that is kept. Every band looks at all triangles of the part.
const DESIGN_BANDS: usize = 8;

/// What is measured at one cell.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sample {
    /// Signed deviation, mm; NaN off the part.
    pub deviation: f32,
    /// Sine of the angle between cut and design surface.
    pub slope: f32,
    /// Vertical part of the design surface's unit normal.
    pub lean: f32,
    /// Deviation at most anywhere in the cell, mm; see [`Inspection::top`].
    pub top: f32,
}

/// Asks the monitor whether to stop, and tells it nothing: for stages within a stage.
pub(super) struct Within<'a>(pub &'a dyn Monitor);

impl Monitor for Within<'_> {
    fn cancelled(&self) -> bool {
        self.0.cancelled()
    }
}

/// A cut surface and what it is measured by.
pub(super) struct Inspection<'a> {
    pub part: &'a Part,
    pub cutters: &'a Cutters,
    pub limits: &'a Limits,
    /// The error bound that is asked for, mm.
    pub asked: f64,
    /// A gouge that is shown to be no deeper than this, mm, need not be known more closely.
    pub allowed_depth: f64,
    /// Squares that a search may hold at a time.
    pub most_squares: usize,
    /// Whether finer cells follow where a limit stays open.
    pub is_first_look: bool,
    pub surface: &'a CutSurface<'a>,
    /// Where the passes of that surface meet.
    pub meetings: &'a Meetings<'a>,
    pub grid: Grid,
    /// Where the vertical part of the design's normal is less, faces are measured elsewhere: bounds do not
    /// cover them.
    pub steepest: f64,
    /// The creases of the part, where gouges are sought between the centres of cells.
    pub creases: Option<&'a Creases>,
    /// The borders of the part, where cuts beside them are measured.
    pub borders: Option<&'a Borders>,
    /// The walls beside, where they are measured.
    pub walls: Option<&'a Walls>,
    /// All moves, where heights that one of them cuts away are no figures though it won no cell.
    pub every_move: Option<&'a EveryMove<'a>>,
}

impl Inspection<'_> {
    /// Deviation at the design point over every cell centre.
    pub fn samples(&self, monitor: &dyn Monitor) -> Result<Vec<Sample>, Cancelled> {
        monitor.start("measuring deviation", self.grid.ny as u64);
        let off = Sample { deviation: f32::NAN, slope: 0.0, lean: 1.0, top: f32::NAN };
        let mut samples = vec![off; self.grid.len()];
        let nx = self.grid.nx;
        let band_rows = self.grid.ny.div_ceil(DESIGN_BANDS);
        for (band, samples) in samples.chunks_mut((band_rows * nx).max(1)).enumerate() {
            let first = band * band_rows;
            // A row more on either side: gaps between patches are closed from their neighbours.
            let rows = first.saturating_sub(1)..(first + samples.len() / nx + 1).min(self.grid.ny);
            let origin = self.grid.centre(0, rows.start);
            let design = self.part.sample_grid(origin, self.grid.cell, nx, rows.len(), &Within(monitor))?;
            work::parallel::for_each_chunk(samples, nx, |j, row| {
                for (i, sample) in row.iter_mut().enumerate() {
                    // Beside walls one cell may take milliseconds.
                    if monitor.cancelled() {
                        return;
                    }
                    let row = first + j - rows.start;
                    let here = design.at(i, row);
                    if !here.is_on() || here.normal.z <= LEAST_FACING {
                        continue;
                    }
                    let centre = self.grid.centre(i, first + j);
                    let p = Point3::new(centre.x, centre.y, here.z);
                    if let Some((d, of_wall)) = self.along_normal(&p, &here.normal) {
                        let top = if of_wall { d.distance } else { self.top(&design, (i, row), &p, &d) };
                        *sample = Sample {
                            deviation: d.distance as f32,
                            slope: d.slope as f32,
                            lean: here.normal.z as f32,
                            top: top as f32,
                        };
                    }
                }
                monitor.advance(1);
            });
            monitor::check(monitor)?;
        }
        Ok(samples)
    }

    /// The deviation at a place of the design, and whether a wall beside it accounts for it.
    pub fn along_normal(&self, p: &Point3, normal: &Vector3) -> Option<(Deviation, bool)> {
        self.along_normal_with(p, normal, &[])
    }

    /// The same with further moves that may be lowest between centres.
    fn along_normal_with(&self, p: &Point3, normal: &Vector3, further: &[u32]) -> Option<(Deviation, bool)> {
        let found = self.surface.along_normal_with(p, normal, further)?;
        let distance = self.walls.map_or(found.distance, |walls| walls.beside(p, found.distance));
        if distance != found.distance {
            return Some((Deviation { distance, slope: 0.0, ..found }, true));
        }
        // What is less deep holds every limit.
        if -distance <= self.limits.shallow() {
            return Some((found, false));
        }
        Some((self.on_ridge(p, normal, -distance).unwrap_or(found), false))
    }

    /// The cut of a ridge that is thinner than the cut along the normal is deep, mm; its slope is how much
    /// deeper it may be beside.
    pub fn on_ridge(&self, p: &Point3, normal: &Vector3, depth: f64) -> Option<Deviation> {
        // Below the highest surface it is solid, whatever a file has there.
        let is_highest = |other: &SurfacePoint| {
            let highest = self.part.highest_at(other.point.x, other.point.y);
            let is_below = highest.is_some_and(|highest| highest.point.z > other.point.z + NUMERICAL_FLOOR);
            other.normal.z > LEAST_FACING && !is_below
        };
        let bounding = Bounding { counts: &is_highest, walls: None };
        let thin = thinner(self.part, p, normal, depth, bounding)?;
        let ridges = thin.ridges(self.part, p, normal, depth, bounding);
        let cuts = ridges.flat_map(|normals| {
            let cut = self.out_of_ridge(p, normals, depth);
            let corner = cut.and_then(|cut| corner_at(self.part, p, &normals, normal, -cut.distance));
            [cut, corner.and_then(|normals| self.out_of_ridge(p, normals, depth))]
        });
        cuts.flatten().max_by(|a, b| a.distance.total_cmp(&b.distance))
    }

    /// The cut of a ridge whose faces have this sum of unit normals, where it is less deep, mm.
    fn out_of_ridge(&self, p: &Point3, mut normals: Vector3, depth: f64) -> Option<Deviation> {
        let mut is_corner = false;
        loop {
            let out = normals.normalize();
            let cut = self.surface.along_normal(p, &out).filter(|cut| -cut.distance < depth)?;
            // Where the way leads out through a third face, it is a corner.
            if let Some(third) = face_before(self.part, p, &out, cut.distance) {
                normals = Some(normals + third).filter(|sum| !is_corner && leads_out(sum))?;
                is_corner = true;
                continue;
            }
            let tan = cut.slope / (1.0 - cut.slope * cut.slope).max(f64::MIN_POSITIVE).sqrt();
            return Some(Deviation { distance: cut.distance.min(0.0), slope: 1.0 + tan, ..cut });
        }
    }

    /// What stands at most in the cell `(i, j)` of a band by the move that cut its centre, and with the
    /// normals of the design beside it, mm; infinite where these cannot tell.
    fn top(&self, design: &SurfaceGrid, (i, j): (usize, usize), p: &Point3, cut: &Deviation) -> f64 {
        let normal = design.at(i, j).normal;
        // The cut over a place stands aside of it where the normal leans.
        let high = 2.0 * cut.distance.max(0.0) + 0.25 * self.grid.cell;
        let half = 0.5 * self.grid.cell + high * normal.xy().norm();
        let mut top = f64::NEG_INFINITY;
        let shape = self.surface.cut.shape.as_ref().filter(|_| cut.by == NOT_CUT);
        let stock = shape.map(|shape| shape.highest_within(p.x, p.y, half));
        for (sx, sy) in [(-half, -half), (half, -half), (-half, half), (half, half)] {
            let z = stock.unwrap_or_else(|| self.surface.height(cut.by, p.x + sx, p.y + sy));
            top = top.max((z - p.z) * normal.z + sx * normal.x + sy * normal.y);
        }
        let (mut turned, mut cosine, mut steepest) = (0f64, 1f64, 0f64);
        for nj in j.saturating_sub(1)..=(j + 1).min(design.ny - 1) {
            for ni in i.saturating_sub(1)..=(i + 1).min(design.nx - 1) {
                let beside = design.at(ni, nj);
                if beside.is_on() {
                    turned = turned.max((beside.normal - normal).norm_squared());
                    cosine = cosine.min(beside.normal.dot(&normal));
                    let [x, y] =
                        [(ni, i), (nj, j)].map(|(to, from)| (to as f64 - from as f64) * self.grid.cell);
                    let way = Vector3::new(x, y, beside.z - p.z);
                    steepest =
                        steepest.max((way.dot(&normal).abs() - NUMERICAL_FLOOR) / way.norm().max(half));
                }
            }
        }
        // No smooth surface leaves the tangent plane by more than its normals turn: there is a step.
        if steepest > turned.sqrt() {
            return f64::INFINITY;
        }
        let top = (top + turned.sqrt() * reach(half, normal.z)) / cosine.max(0.1);
        if top <= high { top } else { f64::INFINITY }
    }

    /// Area of the design surface that cell `k` stands for, mm²: no more than lies in the part's rectangle of
    /// the plan.
    fn area(&self, k: usize, sample: &Sample) -> f64 {
        let (centre, bounds) = (self.centre(k), self.part.bounds());
        let breadth = |i: usize| self.grid.breadth(centre[i], [bounds.min[i], bounds.max[i]]).max(0.0);
        breadth(0) * breadth(1) / f64::from(sample.lean).max(LEAST_FACING)
    }

    /// The design surface at a place of the plan, where an upright cutter faces it.
    pub(super) fn design_at(&self, q: Point2) -> Option<SurfacePoint> {
        self.part.highest_at(q.x, q.y).filter(|design| design.normal.z > LEAST_FACING)
    }

    /// Centre of cell `k`.
    pub fn centre(&self, k: usize) -> Point2 {
        self.grid.centre(k % self.grid.nx, k / self.grid.nx)
    }

    /// Figures of the deviations at the centres. Where passes are about as near to each other as the cells
    /// are, centres lie on ridges, or between them, by chance: there the mean is that of places spread over
    /// the cells.
    pub fn deviation_figures(&self, samples: &[Sample]) -> DeviationFigures {
        let figures = DeviationFigures::of(measured(samples).map(|(k, d)| (d, self.area(k, &samples[k]))));
        let row = |j: usize| (0..self.grid.nx).map(move |i| self.grid.index(i, j));
        let on = |k: &usize| !samples[*k].deviation.is_nan();
        let crowded = work::parallel::map(self.grid.ny, |j| {
            row(j).filter(on).filter(|k| self.is_crowded(*k, NARROW)).count()
        });
        if (crowded.iter().sum::<usize>() as f64) < CROWDED_SHARE * figures.samples as f64 {
            return figures;
        }
        let spread = work::parallel::map(self.grid.ny, |j| {
            let of_one = |k: usize| Some((self.beside_centre(k)?, self.area(k, &samples[k])));
            row(j).filter(on).filter_map(of_one).collect::<Vec<_>>()
        });
        DeviationFigures { rms_mm: DeviationFigures::of(spread.into_iter().flatten()).rms_mm, ..figures }
    }

    /// Whether the tracks around are narrower than so many cells, along x or along y.
    pub fn is_crowded(&self, k: usize, cells: usize) -> bool {
        let (nx, ny) = (self.grid.nx, self.grid.ny);
        let cut_by = &self.surface.cut.cut_by;
        let along = |at: usize, count: usize, step: usize| {
            let before = (at >= cells).then(|| k - cells * step);
            let after = (at + cells < count).then(|| k + cells * step);
            let mut others = before.into_iter().chain(after);
            count >= 2 * cells && others.all(|by| self.meetings.apart(cut_by[k], cut_by[by]))
        };
        along(k % nx, nx, 1) || along(k / nx, ny, nx)
    }

    /// The moves that may touch the design near a place of a cell, where its cutter is the one there. What
    /// passes more than a cell above the cell's own height is no cut of it.
    pub fn passing(&self, k: usize, point: &Point3, normal: &Vector3) -> Vec<u32> {
        let cutter = self.cutters.of_move(self.surface.cut.cut_by[k]);
        let passing = self.meetings.passing((point + cutter.contact_to_tip(normal)).xy());
        let highest = f64::from(self.surface.cut.height[k]) + self.grid.cell;
        let cuts = |by: &&u32| self.surface.height(**by, point.x, point.y) <= highest;
        passing.iter().filter(cuts).copied().collect()
    }

    /// The deviation at a place of a cell that differs from cell to cell: they fill the cells evenly, along
    /// any line of them.
    fn beside_centre(&self, k: usize) -> Option<f64> {
        let [i, j] = [k % self.grid.nx, k / self.grid.nx].map(|n| n as f64);
        let share = |a: f64, b: f64| (i * a + j * b).fract() - 0.5;
        let aside = Vector2::new(share(EVEN[0], EVEN[1]), share(EVEN[1], EVEN[0])) * self.grid.cell;
        let SurfacePoint { point, normal, .. } = self.design_at(self.centre(k) + aside)?;
        let hidden = if self.is_crowded(k, 1) { self.passing(k, &point, &normal) } else { Vec::new() };
        let found = self.surface.along_normal_with(&point, &normal, &hidden)?;
        Some(self.walls.map_or(found.distance, |walls| walls.beside(&point, found.distance)))
    }

    /// Gouges, and how deep one may be between centres.
    ///
    /// # Errors
    /// [`Cancelled`] when the monitor says so.
    pub fn gouges(&self, samples: &[Sample], monitor: &dyn Monitor) -> Result<GougeFigures, Cancelled> {
        let deep = |k: usize| f64::from(samples[k].deviation) < -self.limits.gouge;
        let mut figures = GougeFigures { error_bound_mm: NUMERICAL_FLOOR, ..Default::default() };
        let mut regions = connected(&self.grid, &deep);
        regions.retain(|region| {
            let Some(&deepest) = least_by(region, |k| f64::from(samples[k].deviation)) else { return false };
            let mut found = self.deepest_near(deepest as usize);
            if found.0 <= self.limits.gouge {
                // Beside a border the deepest along its normal may count for less than others.
                let counted = |k: &u32| self.depth_at(self.centre(*k as usize)).map_or(0.0, |found| found.0);
                let next = region.iter().max_by(|a, b| counted(a).total_cmp(&counted(b)));
                found = next.map_or(found, |&k| self.deepest_near(k as usize));
            }
            let (depth_mm, at, move_index) = found;
            if depth_mm <= self.limits.gouge {
                return false;
            }
            let area_mm2 = region.iter().map(|&k| self.area(k as usize, &samples[k as usize])).sum();
            figures.area_mm2 += area_mm2;
            figures.regions.push(GougeRegion {
                depth_mm,
                area_mm2,
                at_mm: at.into(),
                move_index,
                ..GougeRegion::default()
            });
            true
        });
        let deepest = measured(samples).filter(|(_, d)| *d < 0.0).min_by(|a, b| a.1.total_cmp(&b.1));
        let deepest =
            deepest.and_then(|(k, d)| Some(self.depth_at(self.centre(k))?.0.min(-d))).unwrap_or(0.0);
        let listed = figures.regions.iter().map(|r| r.depth_mm).fold(0.0, f64::max);
        figures.max_depth_mm = deepest.max(listed);
        let cells = measured(samples).map(|(k, _)| k);
        let known = figures.max_depth_mm;
        // Figures have this floor on top, twice where what was found is the deepest.
        let asked = |depth: f64| self.asked.max(self.allowed_depth - 2.0 * NUMERICAL_FLOOR - depth);
        let sample = |k: usize| samples[k];
        let found =
            self.between_centres(cells, (known, &asked), &sample, &Self::depth, self.creases, monitor)?;
        figures.max_depth_mm = found.greatest.map_or(figures.max_depth_mm, |(depth, _)| depth);
        figures.at_least_mm = (figures.max_depth_mm - NUMERICAL_FLOOR).max(0.0);
        figures.error_bound_mm += found.possible - figures.max_depth_mm;
        figures.region_count = figures.regions.len();
        figures.regions.sort_by(|a, b| b.depth_mm.total_cmp(&a.depth_mm));
        figures.regions.truncate(LISTED_REGIONS);
        if let Some((depth, q)) = found.greatest.filter(|(depth, _)| *depth > self.limits.gouge)
            && let Some((_, at, by)) = self.depth_at(q)
        {
            self.list_gouge(samples, &mut figures, (depth, at, by));
        }
        Ok(figures)
    }

    /// Depth at a centre, and at most in the square with half side `half` around it. Beside the centre a
    /// cut may be deeper by the slope times the distance: along a move it bends no more than the design does.
    fn depth(d: &Deviation, lean: f64, half: f64) -> Value {
        Value { here: -d.distance, possible: -d.distance + d.slope * reach(half, lean) }
    }

    /// The greatest value above `known` in the squares of `cells` and those along `creases`, as closely as is
    /// `asked`, and what may be there at most. `value` makes it of a deviation, the lean of the design's normal, and half the side of
    /// a square.
    fn between_centres(
        &self,
        cells: impl Iterator<Item = usize>,
        (known, asked): (f64, &dyn Fn(f64) -> f64),
        sample: &dyn Fn(usize) -> Sample,
        value: &(dyn Fn(&Deviation, f64, f64) -> Value + Sync),
        creases: Option<&Creases>,
        monitor: &dyn Monitor,
    ) -> Result<closer::BoundedGreatest, Cancelled> {
        let half = 0.5 * self.grid.cell;
        let is_own = |lean: f64| lean >= self.steepest;
        let on = |point: &Point3, normal: &Vector3, half: f64| {
            let (d, _) = self.along_normal(point, normal).filter(|_| is_own(normal.z))?;
            let found = value(&d, normal.z, half);
            let counted = if found.here > known && d.distance < 0.0 {
                self.beside_border(point, normal, &d, &[], reach(half, normal.z))
            } else {
                None
            };
            let counted = counted.map_or(found, |counted| Value {
                here: counted.here,
                possible: counted.possible.min(found.possible),
            });
            Some((point.xy(), counted))
        };
        let at = |q: Point2, half: f64| {
            let centre = self.design_at(q).and_then(|design| on(&design.point, &design.normal, half));
            // From the middle of a stretch of a crease all of the square is no more than twice as far.
            let along = creases.map_or_else(Vec::new, |creases| creases.within(self.part, q, half));
            let along = along.iter().filter_map(|(point, normal)| on(point, normal, 2.0 * half));
            let most = |a: f64, b: f64| if b > a { b } else { a };
            centre.into_iter().chain(along).reduce(|a: (Point2, Value), b| {
                let possible = most(a.1.possible, b.1.possible);
                let (place, Value { here, .. }) = if b.1.here > a.1.here { b } else { a };
                (place, Value { here, possible })
            })
        };
        let creased = creases.map_or_else(Vec::new, |creases| creases.cells(&self.grid));
        let along_creases = work::parallel::try_map(creased.len(), |k| {
            monitor::check(monitor)?;
            let centre = self.centre(creased[k]);
            let possible = at(centre, half).map_or(f64::NEG_INFINITY, |(_, value)| value.possible);
            Ok((possible > known + NUMERICAL_FLOOR).then_some(Square { possible, centre, half }))
        })?;
        let cells = cells.filter(|k| creased.binary_search(k).is_err());
        let squares = cells.filter(|k| is_own(sample(*k).lean.into())).filter_map(|k| {
            let s = sample(k);
            let d = Deviation { distance: s.deviation.into(), slope: s.slope.into(), by: NOT_CUT };
            let possible = value(&d, s.lean.into(), half).possible;
            let centre = self.centre(k);
            (possible > known + NUMERICAL_FLOOR).then_some(Square { possible, centre, half })
        });
        let squares = along_creases.into_iter().flatten().chain(squares);
        let open = Promising::of(squares, MOST_SEARCHED.min(self.most_squares / 2).max(1));
        let mut found = closer::greatest(open.squares, known, asked, self.most_squares, &at, monitor)?;
        found.possible = found.possible.max(open.others);
        Ok(found)
    }

    /// Depth at a place of the plan, its design point, and the move that cut it.
    fn depth_at(&self, q: Point2) -> Option<(f64, Point3, u32)> {
        self.depth_with(q, &[])
    }

    /// The same with further moves that may be lowest between centres.
    fn depth_with(&self, q: Point2, further: &[u32]) -> Option<(f64, Point3, u32)> {
        let design = self.design_at(q)?;
        let (d, _) = self.along_normal_with(&design.point, &design.normal, further)?;
        let counted = self.beside_border(&design.point, &design.normal, &d, further, 0.0);
        Some((counted.map_or(-d.distance, |counted| counted.here), design.point, d.by))
    }

    /// Raises the deepest gouge to that of moves which stand deeper in the design than the cells show: they
    /// may be lowest at no centre, or beside one that another move cut. Leaves the places where one may stand
    /// deeper yet.
    ///
    /// # Errors
    /// [`Cancelled`] when the monitor says so.
    pub fn raise_by_moves(
        &self,
        path: &Toolpath,
        samples: &[Sample],
        gouge: &mut GougeFigures,
        monitor: &dyn Monitor,
    ) -> Result<Vec<Dip>, Cancelled> {
        /// What is found tells the next round what is known.
        const ROUNDS: usize = 3;
        let mut moves: Vec<u32> = (0..path.len() as u32).collect();
        let mut left = Vec::new();
        for _ in 0..ROUNDS {
            let known = gouge.max_depth_mm + NUMERICAL_FLOOR;
            left = dips(self.part, self.cutters, path, &moves, self.grid.cell, known, monitor)?;
            moves = left.iter().map(|dip| dip.by).collect();
            let mut deepest: Option<(f64, Point3, u32)> = None;
            for dip in &mut left {
                monitor::check(monitor)?;
                // A ridge, or a wall, may be cut less deep than the cutter stands in it. What is steep is
                // measured elsewhere.
                let is_own = self.design_at(dip.at).is_some_and(|design| design.normal.z >= self.steepest);
                let found = self.depth_with(dip.at, &[dip.by]).filter(|_| is_own);
                let depth = found.map_or(f64::NEG_INFINITY, |(depth, ..)| depth);
                (dip.depth, dip.possible) = (depth, depth + (dip.possible - dip.depth).max(0.0));
                deepest = deepest.into_iter().chain(found).max_by(|a, b| a.0.total_cmp(&b.0));
            }
            left.retain(|dip| dip.possible > known);
            let Some((depth, at, by)) = deepest.filter(|(depth, ..)| *depth > known) else { break };
            gouge.raise_to(depth);
            if depth > self.limits.gouge {
                self.list_gouge(samples, gouge, (depth, at, by));
            }
        }
        Ok(left)
    }

    /// Lists a gouge with its depth, place and move: as the deepest of the region of cells there, or beside
    /// it, or as one that no centre saw.
    pub(super) fn list_gouge(
        &self,
        samples: &[Sample],
        gouge: &mut GougeFigures,
        (depth_mm, at, move_index): (f64, Point3, u32),
    ) {
        let cell_of = |at: &[f64; 3]| self.grid.cell_at(at[0], at[1]);
        let own = cell_of(&at.into());
        let beside = |a: (usize, usize), b: (usize, usize)| a.0.abs_diff(b.0) <= 1 && a.1.abs_diff(b.1) <= 1;
        let is_deep = |k: usize| f64::from(samples[k].deviation) < -self.limits.gouge;
        let all = connected(&self.grid, &is_deep);
        let touches = |region: &Vec<u32>, cell: (usize, usize)| {
            let (i, j) = cell;
            let rows = j.saturating_sub(1)..=(j + 1).min(self.grid.ny - 1);
            let columns = i.saturating_sub(1)..=(i + 1).min(self.grid.nx - 1);
            let mut around = rows.flat_map(|j| columns.clone().map(move |i| (i, j)));
            around.any(|(i, j)| region.contains(&(self.grid.index(i, j) as u32)))
        };
        // What was listed of the same region lies in its cells or beside them, or beside this place.
        let of_cells = own.and_then(|own| all.iter().find(|region| touches(region, own)));
        let is_same = |listed: &&mut GougeRegion| {
            let (Some(own), Some(cell)) = (own, cell_of(&listed.at_mm)) else { return false };
            beside(own, cell) || of_cells.is_some_and(|region| touches(region, cell))
        };
        let region = GougeRegion { depth_mm, at_mm: at.into(), move_index, ..GougeRegion::default() };
        match gouge.regions.iter_mut().find(is_same) {
            Some(listed) if listed.depth_mm < depth_mm => {
                *listed = GougeRegion { area_mm2: listed.area_mm2, ..region };
            }
            Some(_) => {}
            None => {
                gouge.region_count += 1;
                gouge.regions.push(region);
            }
        }
        gouge.regions.sort_by(|a, b| b.depth_mm.total_cmp(&a.depth_mm));
        gouge.regions.truncate(LISTED_REGIONS);
    }

    /// The deepest place within a cell of cell `k`, by compass search on the exact surfaces: depth,
    /// design point, move.
    fn deepest_near(&self, k: usize) -> (f64, Point3, u32) {
        let at = |q: Point2| self.depth_at(q);
        let mut centre = self.centre(k);
        let Some(mut best) = at(centre) else { return (0.0, Point3::new(centre.x, centre.y, 0.0), 0) };
        let mut step = 0.5 * self.grid.cell;
        while step > 1e-3 * self.grid.cell {
            let around = [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]];
            let better = around.iter().find_map(|d| {
                let q = Point2::new(centre.x + step * d[0], centre.y + step * d[1]);
                at(q).filter(|found| found.0 > best.0).map(|found| (q, found))
            });
            match better {
                Some((q, found)) => (centre, best) = (q, found),
                None => step *= 0.5,
            }
        }
        best
    }

    /// True where the pass that cut cell `k` came down to the design.
    fn reached(&self, k: usize) -> bool {
        let (by, centre) = (self.surface.cut.cut_by[k], self.centre(k));
        let Some(design) = self.design_at(centre) else { return false };
        by != NOT_CUT && {
            let from_contact = self.cutters.of_move(by).contact_to_tip(&design.normal);
            let tip = self.surface.nearest_tip(by, &(design.point + from_contact));
            self.part.closest_point(&(tip - from_contact)).1 <= self.limits.uncut
        }
    }

    /// What stands above the uncut tolerance and is no scallop, `highest_ridge` being the highest of those.
    ///
    /// # Errors
    /// [`Cancelled`] when the monitor says so.
    pub fn uncut(
        &self,
        samples: &[Sample],
        highest_ridge: f64,
        measured_area: f64,
        monitor: &dyn Monitor,
    ) -> Result<UncutFigures, Cancelled> {
        let high = |k: usize| f64::from(samples[k].deviation) > self.limits.uncut;
        let mut figures = UncutFigures { error_bound_mm: NUMERICAL_FLOOR, ..Default::default() };
        let mut cells = Vec::new();
        let mut of_cells = Vec::new();
        for region in connected(&self.grid, &high) {
            let height = |k: usize| f64::from(samples[k].deviation);
            let Some(&highest) = least_by(&region, |k| -height(k)) else { continue };
            let top = height(highest as usize);
            if top <= highest_ridge * (1.0 + RIDGE_IS_TOP) && self.reached(highest as usize) {
                continue;
            }
            let mut area = 0.0;
            let mut volume = 0.0;
            for &k in &region {
                let sample = &samples[k as usize];
                let of_cell = self.area(k as usize, sample);
                area += of_cell;
                volume += of_cell * height(k as usize);
            }
            cells.push(region);
            let centre = self.centre(highest as usize);
            let z = self.part.highest_at(centre.x, centre.y).map_or(0.0, |design| design.point.z);
            figures.area_mm2 += area;
            figures.volume_mm3 += volume;
            figures.region_count += 1;
            of_cells.push(UncutRegion {
                height_mm: top,
                area_mm2: area,
                volume_mm3: volume,
                at_mm: [centre.x, centre.y, z],
            });
        }
        let known = of_cells.iter().map(|r| r.height_mm).fold(0.0, f64::max);
        let all = cells.iter().flatten().map(|&k| k as usize);
        let value = |d: &Deviation, lean: f64, half: f64| Value {
            here: d.distance,
            possible: d.distance + d.slope * reach(half, lean),
        };
        let asked = |_: f64| self.asked;
        let found = self.between_centres(all, (known, &asked), &|k| samples[k], &value, None, monitor)?;
        if let Some((height, q)) = found.greatest {
            let cell = self.grid.cell_at(q.x, q.y).map(|(i, j)| self.grid.index(i, j) as u32);
            let holds = |k: &usize| cell.is_some_and(|cell| cells[*k].contains(&cell));
            let highest = (0..of_cells.len())
                .max_by(|a, b| of_cells[*a].height_mm.total_cmp(&of_cells[*b].height_mm).then(b.cmp(a)));
            let z = self.part.highest_at(q.x, q.y).map_or(0.0, |design| design.point.z);
            // A place on the edge of its cell may belong to the next one.
            if let Some(region) = (0..cells.len()).find(holds).or(highest) {
                (of_cells[region].height_mm, of_cells[region].at_mm) = (height, [q.x, q.y, z]);
            }
        }
        figures.error_bound_mm += found.possible - found.greatest.map_or(known, |(height, _)| height);
        figures.regions = of_cells;
        figures.regions.sort_by(|a, b| b.height_mm.total_cmp(&a.height_mm));
        figures.max_height_mm = figures.regions.first().map_or(0.0, |r| r.height_mm);
        figures.regions.truncate(LISTED_REGIONS);
        figures.fraction = if measured_area > 0.0 { figures.area_mm2 / measured_area } else { 0.0 };
        Ok(figures)
    }
}

/// How far along the design a place in a square of the plan may be from its centre, mm.
fn reach(half: f64, lean: f64) -> f64 {
    half * std::f64::consts::SQRT_2 / lean.max(LEAST_FACING)
}

/// Cells on the part with their deviation.
fn measured(samples: &[Sample]) -> impl Iterator<Item = (usize, f64)> {
    samples
        .iter()
        .enumerate()
        .filter(|(_, s)| !s.deviation.is_nan())
        .map(|(k, s)| (k, f64::from(s.deviation)))
}

/// The cell of a region with the least value, the first of equals.
fn least_by(region: &[u32], value: impl Fn(usize) -> f64) -> Option<&u32> {
    region.iter().min_by(|a, b| value(**a as usize).total_cmp(&value(**b as usize)))
}

#[cfg(test)]
mod tests {
    use cutter::Cutter;
    use geometry::Point3;

    use crate::flat_scene::{gouge_of, plane};

    /// Passes half way between the centres of cells, each of which dips at one place: the centres around it
    /// are cut by other passes, or higher up. On cells of every size the deepest dip is told.
    #[test]
    fn a_dip_between_centres_is_as_deep_on_cells_of_every_size() {
        let (cutter, step) = (Cutter::ball(2.0).unwrap(), 0.2);
        let dips = [0.0018, 0.0009, 0.0021, 0.0012];
        let passes: Vec<Vec<Point3>> = (0..20)
            .map(|k| {
                let (y, dip) = (step * f64::from(k), dips[k as usize % 4]);
                let at = 0.37 * f64::from(k % 7) + 0.5;
                let tips = [[-1.0, 0.0], [at - 0.04, 0.0], [at, -dip], [at + 0.04, 0.0], [5.0, 0.0]];
                tips.map(|[x, z]| Point3::new(x, y, z)).to_vec()
            })
            .collect();
        for cell in [0.05, 0.13, 0.2, 0.31, 0.4] {
            let found = gouge_of(&plane([4.0, 4.0]), &cutter, &passes, cell);
            let off = (found.max_depth_mm - 0.0021).abs();
            assert!(off <= found.error_bound_mm && off < 1e-4, "{cell}: {found:?}");
        }
    }
}
