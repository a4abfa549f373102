//! The figures of a coverage, and the words for them.

use serde::Serialize;

use crate::facing::Judged;

/// A share of this much is told as all of it: areas are sums of triangles.
const ALL: f64 = 1.0 - 1e-9;

/// Areas of the part's surface. They are a partition: measured and not judged sum up to the whole. Lengths in
/// mm.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct CoverageFigures {
    /// What was to be judged.
    pub judge: Judged,
    /// The whole surface of the part.
    pub surface_mm2: f64,
    /// What the verdict covers.
    pub judged_mm2: f64,
    /// What was measured of that.
    pub measured_mm2: f64,
    /// What cells over the plan view measured.
    pub by_cells_mm2: f64,
    /// What was measured along its normals.
    pub along_normals_mm2: f64,
    /// Walls, which were held against the moves.
    pub by_moves_mm2: f64,
    /// Not judged: faces along the tool axis.
    pub walls_mm2: f64,
    /// Not judged: faces that look away from the tool.
    pub facing_away_mm2: f64,
    /// Not judged: faces up that other surface of the part lies over.
    pub hidden_mm2: f64,
    /// Not judged: what lies outside of the block.
    pub outside_stock_mm2: f64,
    /// Not judged: floor and walls of a pocket where the cutter does not fit or only its round corner comes,
    /// and a hair of floor beside the walls.
    pub out_of_reach_mm2: f64,
    /// Bound of the error of each area.
    pub error_bound_mm2: f64,
    /// What the verdict covers, in words; empty where that is all.
    pub scope: String,
}

impl CoverageFigures {
    /// Of a pocket: what was measured of its floor and what the cutter comes to of its walls, each with all
    /// of it, and the bound of their errors, mm². Where all is judged, moves tell the rest, too.
    pub fn of_pocket(
        judge: Judged,
        [floor, whole_floor]: [f64; 2],
        [walls, all_walls]: [f64; 2],
        error_bound_mm2: f64,
    ) -> Self {
        let rest = (whole_floor - floor).max(0.0) + (all_walls - walls).max(0.0);
        let (by_moves, out_of_reach) = if judge == Judged::All { (rest, 0.0) } else { (0.0, rest) };
        Self {
            judge,
            by_cells_mm2: floor,
            by_moves_mm2: walls + by_moves,
            out_of_reach_mm2: out_of_reach,
            error_bound_mm2,
            ..Self::default()
        }
        .summed()
    }

    /// With the sums and the words.
    pub(super) fn summed(mut self) -> Self {
        self.measured_mm2 = self.by_cells_mm2 + self.along_normals_mm2 + self.by_moves_mm2;
        self.judged_mm2 = self.measured_mm2;
        self.surface_mm2 = self.judged_mm2 + self.not_judged().iter().map(|(_, area)| area).sum::<f64>();
        self.scope = self.words();
        self
    }

    /// The kinds of surface that are not judged, with their areas, mm².
    fn not_judged(&self) -> [(&'static str, f64); 5] {
        [
            ("walls", self.walls_mm2),
            ("facing away", self.facing_away_mm2),
            ("hidden from above", self.hidden_mm2),
            ("outside the stock", self.outside_stock_mm2),
            ("out of the cutter's reach", self.out_of_reach_mm2),
        ]
    }

    /// What share of the surface the verdict covers; 0 where there is no surface.
    pub fn share(&self) -> f64 {
        if self.surface_mm2 > 0.0 { self.judged_mm2 / self.surface_mm2 } else { 0.0 }
    }

    /// `on 31 % of the surface; not judged: walls 1500 mm², facing away 1200 mm²`, to stand behind a verdict;
    /// empty where it covers all.
    fn words(&self) -> String {
        if self.share() >= ALL {
            return String::new();
        }
        let kinds = self.not_judged();
        let listed: Vec<String> = kinds
            .iter()
            .filter(|(_, area)| *area > (1.0 - ALL) * self.surface_mm2)
            .map(|(kind, area)| format!("{kind} {} mm²", digits(*area)))
            .collect();
        format!("on {} % of the surface; not judged: {}", per_cent(self.share()), listed.join(", "))
    }
}

/// A share as per cent; what is not all of it is never told as 100 %.
fn per_cent(share: f64) -> String {
    let percent = 100.0 * share;
    if (1.0..99.0).contains(&percent) {
        return format!("{percent:.0}");
    }
    format!("{}", (percent * 100.0).floor() / 100.0)
}

/// A number with three digits that matter.
fn digits(value: f64) -> String {
    let decimals = (2 - value.abs().max(1e-3).log10().floor() as i32).max(0);
    format!("{value:.*}", decimals as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scope_lists_what_is_not_judged() {
        let figures = CoverageFigures {
            by_cells_mm2: 1200.0,
            walls_mm2: 1500.0,
            facing_away_mm2: 1200.0,
            ..Default::default()
        };
        let figures = figures.summed();
        assert_eq!(figures.surface_mm2, 3900.0);
        assert_eq!(figures.scope, "on 31 % of the surface; not judged: walls 1500 mm², facing away 1200 mm²");
        let nearly =
            CoverageFigures { by_cells_mm2: 1000.0, hidden_mm2: 0.04, ..Default::default() }.summed();
        assert_eq!(nearly.scope, "on 99.99 % of the surface; not judged: hidden from above 0.0400 mm²");
        assert_eq!(CoverageFigures { by_cells_mm2: 7.0, ..Default::default() }.summed().scope, "");
        let pocket = CoverageFigures::of_pocket(Judged::Facing, [90.0, 100.0], [50.0, 55.0], 0.5);
        assert_eq!((pocket.surface_mm2, pocket.judged_mm2), (155.0, 140.0));
        assert!(pocket.scope.ends_with("out of the cutter's reach 15.0 mm²"), "{}", pocket.scope);
        let pocket = CoverageFigures::of_pocket(Judged::All, [90.0, 100.0], [50.0, 55.0], 0.5);
        assert_eq!((pocket.surface_mm2, pocket.judged_mm2, &*pocket.scope), (155.0, 155.0, ""));
        assert_eq!(CoverageFigures::default().share(), 0.0);
    }
}
