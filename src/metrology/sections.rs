//! Deviation of the cut surface at the sections of a blade.
//!
//! Enters: deviations at an even net of places over the blade's patches. Leaves: least, greatest and mean
//! deviation along each section, of all patches. Read from the row of places nearest to the section, which
//! lies off it by no more than half the distance of two rows; nothing is measured anew.

use serde::Serialize;

use super::along_normals::NormalMap;

/// Deviation along the normals of the design at one section, excess positive.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SectionFigures {
    /// Height of the section in its table.
    pub height_mm: f64,
    /// Places measured there.
    pub places: usize,
    /// Least deviation.
    pub min_mm: f64,
    /// Greatest deviation.
    pub max_mm: f64,
    /// Mean deviation.
    pub mean_mm: f64,
    /// Farthest that a row of places read lies from the section, along the surface.
    pub row_off_mm: f64,
}

/// Deviation at sections of these heights, mm, which lie at `parameters[patch][section]` of v on the patches
/// of the map. Sections at which nothing was measured are left out.
pub fn section_figures(map: &NormalMap, heights: &[f64], parameters: &[&[f64]]) -> Vec<SectionFigures> {
    let of = |(section, &height_mm): (usize, &f64)| {
        let mut row_off_mm = 0.0f64;
        let rows = map.grids.iter().zip(parameters).flat_map(|(grid, v)| {
            let [nu, nv] = grid.counts;
            let [lo, hi] = grid.domain[1];
            let exact = (v[section] - lo) / (hi - lo) * (nv - 1) as f64;
            let row = exact.round().clamp(0.0, (nv - 1) as f64);
            row_off_mm = row_off_mm.max((exact - row).abs() * grid.pitch[1]);
            &map.deviations[grid.first + row as usize * nu..][..nu]
        });
        let measured: Vec<f64> = rows.map(|d| f64::from(*d)).filter(|d| !d.is_nan()).collect();
        let places = measured.len();
        (places > 0).then(|| SectionFigures {
            height_mm,
            places,
            min_mm: measured.iter().copied().fold(f64::INFINITY, f64::min),
            max_mm: measured.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            mean_mm: measured.iter().sum::<f64>() / places as f64,
            row_off_mm,
        })
    };
    heights.iter().enumerate().filter_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::PatchGrid;

    #[test]
    fn each_section_takes_the_rows_nearest_to_it_of_all_patches() {
        // Two patches of 4 × 5 and 4 × 11 places, deviations as their row's share of v, a hundredth more on
        // the second.
        let grid = |first, rows| PatchGrid {
            first,
            counts: [4, rows],
            pitch: [1.0; 2],
            domain: [[0.0, 1.0], [2.0, 4.0]],
        };
        let rows = |n: usize, more: f32| {
            (0..n)
                .flat_map(move |j| std::iter::repeat_n(j as f32 / (n - 1) as f32 + more, 4))
                .collect::<Vec<f32>>()
        };
        let mut deviations = [rows(5, 0.0), rows(11, 0.01)].concat();
        // One place of the first row was not measured; of the last of the first patch none.
        deviations[0] = f32::NAN;
        deviations[16..20].fill(f32::NAN);
        let map = NormalMap {
            points: Vec::new(),
            normals: Vec::new(),
            triangles: Vec::new(),
            deviations,
            cut_by: Vec::new(),
            grids: vec![grid(0, 5), grid(20, 11)],
        };
        let of = [2.0, 3.04, 4.0];
        let found = section_figures(&map, &[0.0, 5.0, 9.0], &[&of, &of]);
        let near = |a: f64, b: f64| (a - b).abs() < 1e-6;
        assert_eq!(found.iter().map(|f| f.places).collect::<Vec<_>>(), [7, 8, 4]);
        assert!(
            near(found[0].min_mm, 0.0) && near(found[0].max_mm, 0.01) && near(found[0].mean_mm, 0.04 / 7.0)
        );
        assert!(near(found[1].min_mm, 0.5) && near(found[1].max_mm, 0.51) && near(found[1].height_mm, 5.0));
        assert!(near(found[2].mean_mm, 1.01));
        // 3.04 lies at row 2.08 of the first patch, at 5.2 of the second.
        assert_eq!(found.iter().map(|f| (f.row_off_mm * 1e6).round()).collect::<Vec<_>>(), [0.0, 2e5, 0.0]);
    }
}
