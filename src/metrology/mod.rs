//! Measures the cut surface against the design part, never against a planner's own prediction.
//!
//! Enters: the part, the stock after a path, and the path. Leaves: signed deviation at a design
//! point above or below every cell centre, the heights of the scallop ridges, gouges and uncut
//! places as connected regions, and a bound of the error beside each figure. mm throughout.
//!
//! Deviation at a design point is the signed distance along its outward normal to the cut surface:
//! positive is excess, negative is gouge.

mod cut_surface;
mod figures;
mod meetings;
mod path;
mod regions;
mod removal;
mod ridges;

pub(crate) use cut_surface::CutSurface;
pub use figures::{
    DeviationFigures, GougeFigures, GougeRegion, Limits, Measurement, PathFigures, ScallopFigures,
    UncutFigures, UncutRegion,
};
pub(crate) use meetings::Meetings;
pub use path::path_figures;
pub use removal::{RapidContactFigures, RemovalFigures, removal_figures};

use crate::cutter::Cutter;
use crate::geometry::{Point2, Point3};
use crate::monitor::{self, Cancelled, Monitor};
use crate::part::Part;
use crate::sim::{Envelope, Grid, NOT_CUT, ZMap};
use crate::toolpath::Toolpath;
use regions::connected;
use ridges::{NUMERICAL_FLOOR, RidgeFinder, scallop_figures};

/// Regions listed one by one in the figures; the rest is counted.
const LISTED_REGIONS: usize = 20;

/// Cells in which a cut might be deeper than anything found are searched between their centres, the
/// most promising first, and at most so many: each takes some 0.1 ms. What is left over is the bound.
const MOST_CLOSER: usize = 4000;

/// A place above the uncut tolerance is a scallop, or half of one on the part's border, when a pass
/// came down to the design there and no cell rises above the highest ridge by more than this share.
const RIDGE_IS_TOP: f64 = 1e-3;

/// The design surface is sampled in so many bands of rows, one after the other: it takes 40 bytes a
/// cell, more than all else that is kept. Every band looks at all triangles of the part.
const DESIGN_BANDS: usize = 8;

/// What is measured at one cell.
#[derive(Debug, Clone, Copy)]
struct Sample {
    /// Signed deviation, mm; NaN off the part.
    deviation: f32,
    /// Sine of the angle between cut and design surface.
    slope: f32,
    /// Vertical part of the design surface's unit normal.
    lean: f32,
}

/// Asks the monitor whether to stop, and tells it nothing: for stages within a stage.
struct Within<'a>(&'a dyn Monitor);

impl Monitor for Within<'_> {
    fn cancelled(&self) -> bool {
        self.0.cancelled()
    }
}

/// Measures `cut`, the stock after `path`, against `part`.
///
/// # Errors
/// [`Cancelled`] when the monitor says so.
pub fn measure(
    part: &Part,
    cutter: &Cutter,
    path: &Toolpath,
    cut: &ZMap,
    limits: &Limits,
    monitor: &dyn Monitor,
) -> Result<Measurement, Cancelled> {
    let surface = CutSurface::new(Envelope::new(cutter, path), cut, path);
    let inspection = Inspection { part, cutter, limits, surface: &surface, grid: cut.grid };
    let samples = inspection.samples(monitor)?;
    let finder = RidgeFinder::new(&surface, part, cutter, path, limits);
    let on_part = |k: usize| !samples[k].deviation.is_nan();
    let ridges = finder.find(&on_part, monitor)?;
    let deviation = inspection.deviation_figures(&samples);
    Ok(Measurement {
        scallop: scallop_figures(&ridges, finder.highest(&ridges), limits),
        gouge: inspection.gouges(&samples),
        uncut: inspection.uncut(&samples, ridges.highest_sample(), deviation.area_mm2),
        deviation,
        ridge_samples: ridges.samples,
        deviation_map: samples.into_iter().map(|s| s.deviation).collect(),
    })
}

struct Inspection<'a> {
    part: &'a Part,
    cutter: &'a Cutter,
    limits: &'a Limits,
    surface: &'a CutSurface<'a>,
    grid: Grid,
}

impl Inspection<'_> {
    /// Deviation at the design point over every cell centre.
    fn samples(&self, monitor: &dyn Monitor) -> Result<Vec<Sample>, Cancelled> {
        monitor.start("measuring deviation", self.grid.ny as u64);
        let off = Sample { deviation: f32::NAN, slope: 0.0, lean: 1.0 };
        let mut samples = vec![off; self.grid.len()];
        let nx = self.grid.nx;
        let band_rows = self.grid.ny.div_ceil(DESIGN_BANDS);
        for (band, samples) in samples.chunks_mut((band_rows * nx).max(1)).enumerate() {
            let first = band * band_rows;
            // A row more on either side: gaps between patches are closed from their neighbours.
            let rows = first.saturating_sub(1)..(first + samples.len() / nx + 1).min(self.grid.ny);
            let origin = self.grid.centre(0, rows.start);
            let design = self.part.sample_grid(origin, self.grid.cell, nx, rows.len(), &Within(monitor))?;
            crate::parallel::for_each_chunk(samples, nx, |j, row| {
                if monitor.cancelled() {
                    return;
                }
                for (i, sample) in row.iter_mut().enumerate() {
                    let design = design.at(i, first + j - rows.start);
                    if !design.is_on() {
                        continue;
                    }
                    let centre = self.grid.centre(i, first + j);
                    let p = Point3::new(centre.x, centre.y, design.z);
                    if let Some(d) = self.surface.along_normal(&p, &design.normal) {
                        *sample = Sample {
                            deviation: d.distance as f32,
                            slope: d.slope as f32,
                            lean: design.normal.z as f32,
                        };
                    }
                }
                monitor.advance(1);
            });
            monitor::check(monitor)?;
        }
        Ok(samples)
    }

    /// Area of the design surface that a cell stands for, mm².
    fn area(&self, sample: &Sample) -> f64 {
        self.grid.cell * self.grid.cell / f64::from(sample.lean).max(1e-3)
    }

    /// How far along the surface a place between centres may be from the nearest one, mm.
    fn reach(&self, sample: &Sample) -> f64 {
        self.grid.cell * std::f64::consts::FRAC_1_SQRT_2 / f64::from(sample.lean).max(1e-3)
    }

    /// Centre of cell `k`.
    fn centre(&self, k: usize) -> Point2 {
        self.grid.centre(k % self.grid.nx, k / self.grid.nx)
    }

    fn deviation_figures(&self, samples: &[Sample]) -> DeviationFigures {
        let mut figures = DeviationFigures { min_mm: f64::MAX, max_mm: f64::MIN, ..Default::default() };
        let mut squares = 0.0;
        for (k, d) in measured(samples) {
            let area = self.area(&samples[k]);
            figures.samples += 1;
            figures.min_mm = figures.min_mm.min(d);
            figures.max_mm = figures.max_mm.max(d);
            figures.area_mm2 += area;
            squares += area * d * d;
        }
        if figures.samples == 0 {
            return DeviationFigures::default();
        }
        figures.rms_mm = (squares / figures.area_mm2).sqrt();
        figures
    }

    fn gouges(&self, samples: &[Sample]) -> GougeFigures {
        let deep = |k: usize| f64::from(samples[k].deviation) < -self.limits.gouge;
        let mut figures = GougeFigures { error_bound_mm: NUMERICAL_FLOOR, ..Default::default() };
        let regions = connected(&self.grid, &deep);
        figures.region_count = regions.len();
        for region in &regions {
            let area: f64 = region.iter().map(|&k| self.area(&samples[k as usize])).sum();
            figures.area_mm2 += area;
            let Some(&deepest) = least_by(region, |k| f64::from(samples[k].deviation)) else { continue };
            let (depth, at, by) = self.deepest_near(deepest as usize);
            figures.regions.push(GougeRegion {
                depth_mm: depth,
                area_mm2: area,
                at_mm: at.into(),
                move_index: by,
                line: 0,
            });
        }
        figures.regions.sort_by(|a, b| b.depth_mm.total_cmp(&a.depth_mm));
        figures.regions.truncate(LISTED_REGIONS);
        let deepest = measured(samples).map(|(_, d)| -d).fold(0.0, f64::max);
        let listed = figures.regions.first().map_or(0.0, |r| r.depth_mm);
        figures.max_depth_mm = deepest.max(listed);
        // Between centres a cut may be deeper: by the slope times the distance, but a cutter of
        // radius r that meets the design at a slope s cannot go deeper than about s²r below that.
        let possible = |k: usize| {
            let s = f64::from(samples[k].slope);
            let deeper = (s * self.reach(&samples[k])).min(s * s * self.cutter.radius());
            deeper - f64::from(samples[k].deviation)
        };
        let floor = figures.max_depth_mm + NUMERICAL_FLOOR;
        let mut open: Vec<(f64, usize)> =
            measured(samples).map(|(k, _)| (possible(k), k)).filter(|(p, _)| *p > floor).collect();
        open.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let closer = open.len().min(MOST_CLOSER);
        let depths = crate::parallel::map(closer, |k| self.deepest_near(open[k].1).0);
        figures.max_depth_mm = depths.into_iter().fold(figures.max_depth_mm, f64::max);
        let left = open.get(closer).map_or(0.0, |(possible, _)| possible - figures.max_depth_mm);
        figures.error_bound_mm = left.max(0.0) + NUMERICAL_FLOOR;
        figures
    }

    /// The deepest place within a cell of cell `k`, by compass search on the exact surfaces: depth,
    /// design point, move.
    fn deepest_near(&self, k: usize) -> (f64, Point3, u32) {
        let at = |q: Point2| {
            let design = self.part.highest_at(q.x, q.y)?;
            let d = self.surface.along_normal(&design.point, &design.normal)?;
            Some((-d.distance, design.point, d.by))
        };
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
        let Some(design) = self.part.highest_at(centre.x, centre.y) else { return false };
        by != NOT_CUT && {
            let from_contact = self.cutter.contact_to_tip(&design.normal);
            let tip = self.surface.nearest_tip(by, &(design.point + from_contact));
            self.part.closest_point(&(tip - from_contact)).1 <= self.limits.uncut
        }
    }

    fn uncut(&self, samples: &[Sample], highest_ridge: f64, measured_area: f64) -> UncutFigures {
        let high = |k: usize| f64::from(samples[k].deviation) > self.limits.uncut;
        let mut figures = UncutFigures { error_bound_mm: NUMERICAL_FLOOR, ..Default::default() };
        let mut possible = 0.0f64;
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
                area += self.area(sample);
                volume += self.area(sample) * height(k as usize);
                possible = possible.max(height(k as usize) + f64::from(sample.slope) * self.reach(sample));
            }
            let centre = self.centre(highest as usize);
            let z = self.part.highest_at(centre.x, centre.y).map_or(0.0, |design| design.point.z);
            figures.area_mm2 += area;
            figures.volume_mm3 += volume;
            figures.region_count += 1;
            figures.regions.push(UncutRegion {
                height_mm: top,
                area_mm2: area,
                volume_mm3: volume,
                at_mm: [centre.x, centre.y, z],
            });
        }
        figures.regions.sort_by(|a, b| b.height_mm.total_cmp(&a.height_mm));
        figures.max_height_mm = figures.regions.first().map_or(0.0, |r| r.height_mm);
        figures.regions.truncate(LISTED_REGIONS);
        figures.fraction = if measured_area > 0.0 { figures.area_mm2 / measured_area } else { 0.0 };
        figures.error_bound_mm += (possible - figures.max_height_mm).max(0.0);
        figures
    }
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
