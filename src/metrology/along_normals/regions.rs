//! Gouges and uncut places as regions of a net, and the deviation in all.

use std::collections::HashMap;

use super::closer::Greatest;
use super::net::Net;
use super::ridges::Crossing;
use super::{NormalInspection, Sample};
use crate::figures::{
    DeviationFigures, GougeFigures, GougeRegion, NUMERICAL_FLOOR, UncutFigures, UncutRegion,
};

/// Regions listed one by one in the figures; the rest is counted.
const LISTED_REGIONS: usize = 20;

/// What was found standing between the places.
#[derive(Clone, Copy)]
pub(super) struct Standing<'a> {
    /// The highest ridge that is no scallop.
    pub hollow: Option<Crossing>,
    /// The greatest figures.
    pub greatest: &'a Greatest,
    /// How much more may be uncut, mm.
    pub left: f64,
}

impl NormalInspection<'_> {
    pub fn gouges(&self, net: &Net, samples: &[Sample], areas: &[f64], kept: &[bool]) -> GougeFigures {
        let depth = |k: u32| samples[k as usize].hit.map_or(0.0, |hit| -hit.deviation);
        let mut figures = GougeFigures::default();
        for region in connected(net, self.spacing, &|k| kept[k as usize] && depth(k) > self.limits.gouge) {
            let Some(&deepest) = region.iter().max_by(|a, b| depth(**a).total_cmp(&depth(**b))) else {
                continue;
            };
            let sample = &samples[deepest as usize];
            let area_mm2 = region.iter().map(|&k| areas[k as usize]).sum();
            figures.area_mm2 += area_mm2;
            figures.regions.push(GougeRegion {
                depth_mm: depth(deepest),
                area_mm2,
                at_mm: sample.place.point.into(),
                move_index: sample.hit.map_or(0, |hit| hit.by),
                ..GougeRegion::default()
            });
        }
        figures.region_count = figures.regions.len();
        figures.regions.sort_by(|a, b| b.depth_mm.total_cmp(&a.depth_mm));
        figures.regions.truncate(LISTED_REGIONS);
        figures
    }

    /// What stands above the uncut tolerance and is no scallop.
    pub fn uncut(
        &self,
        net: &Net,
        samples: &[Sample],
        areas: &[f64],
        kept: &[bool],
        standing: &Standing<'_>,
    ) -> UncutFigures {
        let Standing { hollow, greatest, left } = *standing;
        let ridge = greatest.highest_ridge();
        let height = |k: u32| samples[k as usize].height(self.engine);
        let mut figures = UncutFigures::default();
        for region in connected(net, self.spacing, &|k| kept[k as usize] && height(k) > self.limits.uncut) {
            let Some(&highest) = region.iter().max_by(|a, b| height(**a).total_cmp(&height(**b))) else {
                continue;
            };
            if !self.is_uncut(&samples[highest as usize], ridge) {
                continue;
            }
            let area_mm2: f64 = region.iter().map(|&k| areas[k as usize]).sum();
            let volume_mm3 = region.iter().map(|&k| areas[k as usize] * height(k)).sum::<f64>();
            figures.area_mm2 += area_mm2;
            figures.volume_mm3 += volume_mm3;
            figures.regions.push(UncutRegion {
                height_mm: height(highest),
                area_mm2,
                volume_mm3,
                at_mm: samples[highest as usize].place.point.into(),
            });
        }
        let seen = figures.regions.iter().map(|r| r.height_mm).fold(0.0, f64::max);
        // A hollow between places that are lower, all of them.
        if let Some(c) = hollow.filter(|c| c.height > seen) {
            let (area_mm2, volume_mm3) = (0.0, 0.0);
            figures.regions.push(UncutRegion {
                height_mm: c.height,
                area_mm2,
                volume_mm3,
                at_mm: c.at.into(),
            });
        }
        let all: f64 = areas.iter().zip(kept).filter(|(_, kept)| **kept).map(|(area, _)| area).sum();
        figures.fraction = figures.area_mm2 / all.max(f64::MIN_POSITIVE);
        figures.region_count = figures.regions.len();
        figures.regions.sort_by(|a, b| b.height_mm.total_cmp(&a.height_mm));
        figures.regions.truncate(LISTED_REGIONS);
        figures.max_height_mm = figures.regions.first().map_or(0.0, |r| r.height_mm);
        figures.error_bound_mm = left + NUMERICAL_FLOOR;
        if let Some((height, sample)) = &greatest.uncut {
            let more = (height - figures.max_height_mm).max(0.0);
            if self.is_uncut(sample, ridge) {
                figures.max_height_mm += more;
            } else if figures.region_count > 0 {
                // It is part of a ridge that was found later; what is uncut below it was not looked for.
                figures.error_bound_mm += more;
            }
            figures.error_bound_mm += sample.hit.map_or(0.0, |hit| hit.uncertain);
        }
        figures
    }
}

/// Area that each place stands for, mm²: a third of the triangles around.
pub(super) fn areas(net: &Net) -> Vec<f64> {
    let mut areas = vec![0.0; net.places.len()];
    for t in &net.triangles {
        let [a, b, c] = t.map(|k| net.places[k as usize].point);
        let third = (b - a).cross(&(c - a)).norm() / 6.0;
        t.iter().for_each(|&k| areas[k as usize] += third);
    }
    areas
}

pub(super) fn deviation_figures(samples: &[Sample], areas: &[f64], kept: &[bool]) -> DeviationFigures {
    let judged = || samples.iter().zip(areas).zip(kept).filter(|(_, kept)| **kept).map(|(sample, _)| sample);
    let hits = judged().filter_map(|(sample, area)| Some((sample.hit?.deviation, *area)));
    DeviationFigures { samples: judged().count(), ..DeviationFigures::of(hits) }
}

/// The regions of places for which `inside` holds: places closer than `spacing` mm that face the same way
/// belong together, across the borders of facets and patches too. Each in the order of its places, regions in
/// that of their first one.
pub(crate) fn connected(net: &Net, spacing: f64, inside: &dyn Fn(u32) -> bool) -> Vec<Vec<u32>> {
    let marked: Vec<u32> = (0..net.places.len() as u32).filter(|&k| inside(k)).collect();
    let cell = |k: u32| (net.places[k as usize].point.coords / spacing).map(|x| x.floor() as i64);
    let mut cells: HashMap<[i64; 3], Vec<usize>> = HashMap::new();
    for (m, &k) in marked.iter().enumerate() {
        cells.entry(cell(k).into()).or_default().push(m);
    }
    let near = |m: usize| {
        let (here, place) = (cell(marked[m]), &net.places[marked[m] as usize]);
        let around = (0..27).map(|n| [here.x + n % 3 - 1, here.y + n / 3 % 3 - 1, here.z + n / 9 - 1]);
        let others = around.filter_map(|at| cells.get(&at)).flatten().copied();
        let joined = |&o: &usize| {
            let other = &net.places[marked[o] as usize];
            (other.point - place.point).norm() <= spacing && other.normal.dot(&place.normal) > 0.0
        };
        others.filter(joined).collect::<Vec<usize>>()
    };
    let mut seen = vec![false; marked.len()];
    let mut regions = Vec::new();
    for start in 0..marked.len() {
        if std::mem::replace(&mut seen[start], true) {
            continue;
        }
        let (mut region, mut next) = (vec![start], 0);
        while next < region.len() {
            for other in near(region[next]) {
                if !std::mem::replace(&mut seen[other], true) {
                    region.push(other);
                }
            }
            next += 1;
        }
        region.sort_unstable();
        regions.push(region.into_iter().map(|m| marked[m]).collect());
    }
    regions
}
