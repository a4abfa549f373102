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
mod path;
mod regions;
mod removal;
mod ridges;

pub use figures::{
    DeviationFigures, GougeFigures, GougeRegion, Limits, Measurement, PathFigures, ScallopFigures,
    UncutFigures, UncutRegion,
};
pub use path::path_figures;
pub use removal::{RapidContactFigures, RemovalFigures, removal_figures};

use crate::cutter::Cutter;
use crate::geometry::{Point2, Point3};
use crate::monitor::{self, Cancelled, Monitor};
use crate::part::{Part, SurfaceGrid};
use crate::sim::{Envelope, Grid, NOT_CUT, ZMap};
use crate::toolpath::Toolpath;
use cut_surface::CutSurface;
use regions::connected;
use ridges::{NUMERICAL_FLOOR, RidgeFinder, RidgeSample, scallop_figures};

/// Regions listed one by one in the figures; the rest is counted.
const LISTED_REGIONS: usize = 20;

/// Cells in which a cut might be deeper than anything found are searched between their centres, the
/// most promising first, and at most so many: each takes some 0.1 ms. What is left over is the bound.
const MOST_CLOSER: usize = 4000;

/// A place above the uncut tolerance is a scallop, or half of one on the part's border, when a pass
/// came down to the design there and no cell rises above the highest ridge by more than this share.
const RIDGE_IS_TOP: f64 = 1e-3;

/// What is measured at one cell.
#[derive(Debug, Clone, Copy)]
struct Sample {
    /// Signed deviation, mm; NaN off the part.
    deviation: f32,
    /// Sine of the angle between cut and design surface.
    slope: f32,
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
    let design = part.sample_grid(cut.grid.origin, cut.grid.cell, cut.grid.nx, cut.grid.ny, monitor)?;
    let surface = CutSurface::new(Envelope::new(cutter, path), cut, path);
    let inspection = Inspection { part, cutter, limits, surface: &surface, design: &design, grid: cut.grid };
    let samples = inspection.samples(monitor)?;
    let finder = RidgeFinder::new(&surface, part, cutter, path, limits);
    let on_part = |k: usize| !samples[k].deviation.is_nan();
    let ridges = finder.find(&on_part, monitor)?;
    let deviation = inspection.deviation_figures(&samples);
    Ok(Measurement {
        scallop: scallop_figures(&ridges, finder.highest(&ridges), limits),
        gouge: inspection.gouges(&samples),
        uncut: inspection.uncut(&samples, &ridges, deviation.area_mm2),
        deviation,
        ridge_samples: ridges.iter().map(|r| [r.height as f32, r.length as f32]).collect(),
        deviation_map: samples.into_iter().map(|s| s.deviation).collect(),
    })
}

struct Inspection<'a> {
    part: &'a Part,
    cutter: &'a Cutter,
    limits: &'a Limits,
    surface: &'a CutSurface<'a>,
    design: &'a SurfaceGrid,
    grid: Grid,
}

impl Inspection<'_> {
    /// Deviation at the design point over every cell centre.
    fn samples(&self, monitor: &dyn Monitor) -> Result<Vec<Sample>, Cancelled> {
        monitor.start("measuring deviation", self.grid.ny as u64);
        let off = Sample { deviation: f32::NAN, slope: 0.0 };
        let rows = crate::parallel::try_map(self.grid.ny, |j| {
            monitor::check(monitor)?;
            let row: Vec<Sample> = (0..self.grid.nx)
                .map(|i| {
                    let design = self.design.at(i, j);
                    if !design.is_on() {
                        return off;
                    }
                    let centre = self.grid.centre(i, j);
                    let p = Point3::new(centre.x, centre.y, design.z);
                    self.surface
                        .along_normal(&p, &design.normal)
                        .map_or(off, |d| Sample { deviation: d.distance as f32, slope: d.slope as f32 })
                })
                .collect();
            monitor.advance(1);
            Ok(row)
        })?;
        Ok(rows.into_iter().flatten().collect())
    }

    /// Area of the design surface that cell `k` stands for, mm².
    fn area(&self, k: usize) -> f64 {
        let lean = self.design.samples[k].normal.z;
        self.grid.cell * self.grid.cell / lean.max(1e-3)
    }

    /// How far along the surface a place between centres may be from the nearest one, mm.
    fn reach(&self, k: usize) -> f64 {
        let lean = self.design.samples[k].normal.z;
        self.grid.cell * std::f64::consts::FRAC_1_SQRT_2 / lean.max(1e-3)
    }

    fn deviation_figures(&self, samples: &[Sample]) -> DeviationFigures {
        let mut figures = DeviationFigures { min_mm: f64::MAX, max_mm: f64::MIN, ..Default::default() };
        let mut squares = 0.0;
        for (k, d) in measured(samples) {
            let area = self.area(k);
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
            let area: f64 = region.iter().map(|&k| self.area(k as usize)).sum();
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
            let deeper = (s * self.reach(k)).min(s * s * self.cutter.radius());
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
        let mut centre = self.grid.centre(k % self.grid.nx, k / self.grid.nx);
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
        let by = self.surface.cut.cut_by[k];
        let (design, centre) =
            (&self.design.samples[k], self.grid.centre(k % self.grid.nx, k / self.grid.nx));
        by != NOT_CUT && {
            let contact = Point3::new(centre.x, centre.y, design.z);
            let from_contact = self.cutter.contact_to_tip(&design.normal);
            let tip = self.surface.nearest_tip(by, &(contact + from_contact));
            self.part.closest_point(&(tip - from_contact)).1 <= self.limits.uncut
        }
    }

    fn uncut(&self, samples: &[Sample], ridges: &[RidgeSample], measured_area: f64) -> UncutFigures {
        let high = |k: usize| f64::from(samples[k].deviation) > self.limits.uncut;
        let highest_ridge = ridges.iter().map(|r| r.height).fold(0.0, f64::max);
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
                area += self.area(k as usize);
                volume += self.area(k as usize) * height(k as usize);
                let s = f64::from(samples[k as usize].slope);
                possible = possible.max(height(k as usize) + s * self.reach(k as usize));
            }
            let k = highest as usize;
            let centre = self.grid.centre(k % self.grid.nx, k / self.grid.nx);
            let z = self.design.samples[k].z;
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
