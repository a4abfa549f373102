//! The figures of one measured toolpath, with the names under which they stand in report.json.
//! Lengths in mm, areas in mm², volumes in mm³, times in s.

use geometry::Point3;
use serde::Serialize;

use super::pairs::PairFigures;

/// Numerical floor of every bound, mm: root finding and the design surface's own evaluation.
pub(crate) const NUMERICAL_FLOOR: f64 = 1e-6;

/// What is tolerated, mm, all positive.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Limits {
    /// Scallop height: the planning target and the limit measured against.
    pub scallop: f64,
    /// Depth below the design surface.
    pub gouge: f64,
    /// Height above the design surface from which a place counts as uncut.
    pub uncut: f64,
    /// Chord tolerance of the path.
    pub chord: f64,
}

impl Limits {
    /// Cuts that are no deeper than this below the design surface hold every limit, mm.
    pub fn shallow(&self) -> f64 {
        self.gouge.min(self.chord)
    }
}

/// A place of a ridge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RidgePlace {
    /// Where it stands.
    pub at: Point3,
    /// Over the design surface, mm.
    pub height: f64,
}

/// Ridges above this share of the scallop limit come near it: what is cut once more, with moves that are a
/// little others, may stand above it.
pub(crate) const NEAR_LIMIT: f64 = 0.985;

/// Which ridges may exceed the scallop target. By default none may.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ScallopRule {
    /// Share of the ridge length that must not exceed the target, above 0 to 1.
    pub share: f64,
    /// The highest ridge must not exceed so many times the target; at least 1.
    pub highest: f64,
}

impl Default for ScallopRule {
    fn default() -> Self {
        Self { share: 1.0, highest: 1.0 }
    }
}

/// Figures of the path itself.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct PathFigures {
    /// Length of all moves that feed along passes.
    pub cutting_length_mm: f64,
    /// Length of the links along the surface from pass to pass.
    pub link_length_mm: f64,
    /// Length of all other moves: plunges, lifts and rapids.
    pub air_length_mm: f64,
    /// Passes.
    pub passes: usize,
    /// Links along the surface.
    pub surface_links: usize,
    /// How often the tool leaves the surface and comes back to it.
    pub retracts: usize,
    /// Cutter locations.
    pub cl_points: usize,
    /// Sum of the angles between moves that follow each other along the surface, passes and links: the
    /// integral of the path's curvature.
    pub total_turning_rad: f64,
    /// Places on the surface, in passes or links, where the direction turns by more than 30°.
    pub sharp_turns: usize,
    /// Time that the machine would take.
    pub machining_time_s: f64,
}

/// Heights of the ridges between neighbouring passes, weighted by ridge length. `None` (and a
/// reason) where the cut surface has no such ridge.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct ScallopFigures {
    /// The planning target.
    pub target_mm: f64,
    /// Greatest height.
    pub max_mm: Option<f64>,
    /// 95 % of the ridge length is lower.
    pub p95_mm: Option<f64>,
    /// Half of the ridge length is lower.
    pub p50_mm: Option<f64>,
    /// Mean over the ridge length.
    pub mean_mm: Option<f64>,
    /// Share of the ridge length above the target.
    pub over_target_fraction: Option<f64>,
    /// Length of all ridges.
    pub ridge_length_mm: f64,
    /// Where the greatest height stands.
    pub max_at_mm: Option<[f64; 3]>,
    /// Bound of the error of `max_mm`.
    pub error_bound_mm: Option<f64>,
    /// Why a figure is missing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
}

/// A connected place deeper than the gouge tolerance.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct GougeRegion {
    /// Greatest depth.
    pub depth_mm: f64,
    /// Area on the design surface; 0, and not written, where no centre of a cell is so deep.
    #[serde(skip_serializing_if = "is_zero")]
    pub area_mm2: f64,
    /// Where the greatest depth is.
    pub at_mm: [f64; 3],
    /// The move that cut there, counted from 0; [`sim::NOT_CUT`], and not written, where it is not known.
    #[serde(rename = "move", skip_serializing_if = "is_not_cut")]
    pub move_index: u32,
    /// Its line in toolpath.nc, counted from 1; 0 where there is no such program.
    pub line: u32,
    /// Its tool, where the program has several.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tool: Option<u32>,
    /// The earlier toolpath whose move it is, where it is none of this one's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub toolpath: Option<String>,
    /// The program of that toolpath, which has the line.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub program: Option<String>,
}

/// Cuts below the design surface.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct GougeFigures {
    /// Greatest depth anywhere, tolerated or not; 0 when nothing lies below the design.
    pub max_depth_mm: f64,
    /// Area deeper than the tolerance.
    pub area_mm2: f64,
    /// Bound of the error of `max_depth_mm`.
    pub error_bound_mm: f64,
    /// So deep something is cut for certain; 0 where that is not known.
    #[serde(skip_serializing_if = "is_zero")]
    pub at_least_mm: f64,
    /// The deepest regions, deepest first.
    pub regions: Vec<GougeRegion>,
    /// Number of regions found, listed or not.
    pub region_count: usize,
}

impl GougeFigures {
    /// As told, and the depth of what another measurement found where that is deeper, or may be.
    #[must_use]
    pub fn or(&self, other: &Self) -> Self {
        let depth = |of: &Self| Bounded {
            at_least_mm: of.at_least_mm,
            ..Bounded::new(of.max_depth_mm, of.error_bound_mm)
        };
        let Bounded { max_mm, error_bound_mm, at_least_mm, .. } = depth(self).or(&depth(other));
        Self { max_depth_mm: max_mm, error_bound_mm, at_least_mm, ..self.clone() }
    }

    /// The deepest cut, mm, its place and its move: those of the deepest region, or, where none is listed
    /// because no place of the grid or net is so deep, of one without an area.
    pub(crate) fn deepest_at(&mut self, depth: f64, at: [f64; 3], by: u32) {
        if self.regions.is_empty() {
            self.regions.push(GougeRegion::default());
            self.region_count = 1;
        }
        let first = &mut self.regions[0];
        (first.depth_mm, first.at_mm, first.move_index) = (depth, at, by);
    }

    /// A deeper cut was found, mm.
    pub(crate) fn raise_to(&mut self, depth: f64) {
        let possible = self.max_depth_mm + self.error_bound_mm;
        self.error_bound_mm = (possible - depth).max(NUMERICAL_FLOOR);
        (self.max_depth_mm, self.at_least_mm) = (depth, depth - NUMERICAL_FLOOR);
    }
}

/// A connected place higher than the uncut tolerance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct UncutRegion {
    /// Greatest height along the design normal.
    pub height_mm: f64,
    /// Area on the design surface.
    pub area_mm2: f64,
    /// Material above the design surface.
    pub volume_mm3: f64,
    /// Where the greatest height is.
    pub at_mm: [f64; 3],
}

/// Material that no pass reached.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct UncutFigures {
    /// Greatest height of any uncut region.
    pub max_height_mm: f64,
    /// Area of all regions.
    pub area_mm2: f64,
    /// Share of the measured area.
    pub fraction: f64,
    /// Volume of all regions.
    pub volume_mm3: f64,
    /// Bound of the error of `max_height_mm`.
    pub error_bound_mm: f64,
    /// The highest regions, highest first.
    pub regions: Vec<UncutRegion>,
    /// Number of regions found, listed or not.
    pub region_count: usize,
}

/// The highest of some places.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Bounded {
    /// Greatest height; 0 where nothing stands above the design.
    pub max_mm: f64,
    /// No place is higher than that by more.
    pub error_bound_mm: f64,
    /// So much stands somewhere for certain: no move cuts it away; 0 where that is not known.
    #[serde(skip_serializing_if = "is_zero")]
    pub at_least_mm: f64,
    /// Where it stands, if anything does.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub at_mm: Option<[f64; 3]>,
}

impl Bounded {
    /// A height without its place.
    pub fn new(max_mm: f64, error_bound_mm: f64) -> Self {
        Self { max_mm, error_bound_mm, at_least_mm: 0.0, at_mm: None }
    }

    /// No place is higher than this, mm.
    pub fn at_most(&self) -> f64 {
        self.max_mm + self.error_bound_mm
    }

    /// So much stands, mm, by figure and bound, or for certain.
    pub fn stands_mm(&self) -> f64 {
        self.at_least_mm.max(self.max_mm - self.error_bound_mm)
    }

    /// The highest of these places and those; of equals, this one.
    #[must_use]
    pub fn or(&self, other: &Self) -> Self {
        let higher = if other.max_mm > self.max_mm { other } else { self };
        let error_bound_mm = self.at_most().max(other.at_most()) - higher.max_mm;
        Self { error_bound_mm, at_least_mm: self.at_least_mm.max(other.at_least_mm), ..*higher }
    }
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks so")]
fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks so")]
fn is_not_cut(move_index: &u32) -> bool {
    *move_index == sim::NOT_CUT
}

/// What the highest material is.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ExcessKind {
    /// Nothing was found above the design.
    #[default]
    None,
    /// A ridge between two passes that came down to the design, or its flank.
    Scallop,
    /// Between a pass that came down to the design and a border of it.
    Border,
    /// Where no pass came down to the design.
    Uncut,
}

impl ExcessKind {
    /// Of the highest material, mm, where passes came down to the design and the highest ridge between them
    /// is `ridge` high.
    pub(crate) fn of_reached(height: f64, ridge: f64) -> Self {
        if height <= NUMERICAL_FLOOR {
            Self::None
        } else if height > ridge + NUMERICAL_FLOOR {
            Self::Border
        } else {
            Self::Scallop
        }
    }
}

/// The highest material anywhere on what was judged. Scallops and remnants along borders are reached: they
/// answer to the scallop tolerance. What no pass came down to answers to the uncut tolerance.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct ExcessFigures {
    /// The highest of all.
    #[serde(flatten)]
    pub highest: Bounded,
    /// What it is.
    pub kind: ExcessKind,
    /// The highest where passes came down to the design.
    pub reached: Bounded,
    /// The highest elsewhere.
    pub unreached: Bounded,
}

impl ExcessFigures {
    /// The highest of these places and those; of equals, this one.
    #[must_use]
    pub fn or(&self, other: &Self) -> Self {
        let kind = if other.highest.max_mm > self.highest.max_mm { other.kind } else { self.kind };
        Self {
            highest: self.highest.or(&other.highest),
            kind,
            reached: self.reached.or(&other.reached),
            unreached: self.unreached.or(&other.unreached),
        }
    }
}

/// Signed deviation over all samples. `None` (and a reason) where nothing was measured.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct DeviationFigures {
    /// Samples taken, one a cell.
    pub samples: usize,
    /// Least (deepest gouge).
    pub min_mm: Option<f64>,
    /// Greatest (highest excess).
    pub max_mm: Option<f64>,
    /// Root mean square, weighted by area.
    pub rms_mm: Option<f64>,
    /// Area of the design surface that was measured.
    pub area_mm2: f64,
    /// Why a figure is missing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<&'static str>,
}

impl DeviationFigures {
    /// Of deviations, mm, and the areas that they stand for, mm².
    pub(crate) fn of(measured: impl Iterator<Item = (f64, f64)>) -> Self {
        let (mut least, mut greatest, mut squares) = (f64::INFINITY, f64::NEG_INFINITY, 0.0);
        let (mut samples, mut area_mm2) = (0, 0.0);
        for (d, area) in measured {
            (least, greatest) = (least.min(d), greatest.max(d));
            squares += area * d * d;
            area_mm2 += area;
            samples += 1;
        }
        if samples == 0 || area_mm2 <= 0.0 {
            return Self { samples, reason: Some("no place of the part was measured"), ..Self::default() };
        }
        let rms_mm = Some((squares / area_mm2).sqrt());
        Self { samples, min_mm: Some(least), max_mm: Some(greatest), rms_mm, area_mm2, reason: None }
    }
}

/// All that is measured on one cut surface.
#[derive(Debug, Clone, PartialEq)]
pub struct Measurement {
    /// Scallops.
    pub scallop: ScallopFigures,
    /// Gouges.
    pub gouge: GougeFigures,
    /// Uncut regions.
    pub uncut: UncutFigures,
    /// The highest material.
    pub excess: ExcessFigures,
    /// Deviation in all.
    pub deviation: DeviationFigures,
    /// Signed deviation at every cell of the stock's grid, mm, `[ny][nx]`; NaN off the part.
    pub deviation_map: Vec<f32>,
    /// Height and weight (ridge length, mm) of every ridge sample.
    pub ridge_samples: Vec<[f32; 2]>,
    /// Places on ridges that cells show near the scallop limit or above it, and all others that stand above
    /// it, within the uncut tolerance: where passes lie too far apart, or as far as they may. Those between
    /// centres have the height that they may have at most.
    pub above: Vec<RidgePlace>,
    /// Scallops of pairs of passes, calculated beside measured.
    pub pairs: PairFigures,
    /// How the figures were refined.
    pub refined: CloserLook,
}

impl Measurement {
    /// Widens the bounds of all heights and depths by how far the path may be off the one that was measured,
    /// mm.
    pub fn widen(&mut self, by: f64) {
        let Self { scallop, gouge, uncut, excess, .. } = self;
        gouge.at_least_mm = (gouge.at_least_mm - by).max(0.0);
        let bounds = [&mut gouge.error_bound_mm, &mut uncut.error_bound_mm];
        let highest = [&mut excess.highest, &mut excess.reached, &mut excess.unreached];
        let highest = highest.map(|bounded| {
            bounded.at_least_mm = (bounded.at_least_mm - by).max(0.0);
            &mut bounded.error_bound_mm
        });
        bounds.into_iter().chain(highest).chain(&mut scallop.error_bound_mm).for_each(|bound| *bound += by);
    }

    /// Share of the ridge length that stands above a height, mm; `None` without ridges.
    pub fn share_above(&self, height: f64) -> Option<f64> {
        let length = |over: f64| -> f64 {
            let high = self.ridge_samples.iter().filter(|s| f64::from(s[0]) > over);
            high.fold(0.0, |sum, s| sum + f64::from(s[1]))
        };
        let all = length(f64::NEG_INFINITY);
        (all > 0.0).then(|| length(height) / all)
    }
}

/// How a measurement was refined.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CloserLook {
    /// Rectangles cut anew.
    pub rectangles: usize,
    /// Pitch of the finest cells, mm.
    pub finest_cell: f64,
    /// Which bounds remain above the asked one.
    pub note: Option<String>,
}
