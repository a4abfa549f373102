//! Measures the cut surface against the design part, never against a planner's own prediction.
//!
//! Enters: the part, the stock after a path, and the path. Leaves: signed deviation at a design point above
//! or below every cell centre, the heights of the scallop ridges, gouges and uncut places as connected
//! regions, and a bound of the error beside each figure. mm throughout.
//!
//! Deviation at a design point is the signed distance along its outward normal to the cut surface: positive
//! is excess, negative is gouge. On a sharp ridge, where the way down along the normal may run along the
//! other face, a cut is no deeper than the ridge is lower (`beneath`).
//!
//! A bound says how much a figure may differ from the truth:
//!
//! - scallop: how much higher a ridge may be between two grid lines, by its slope against the design;
//! - gouge: how much deeper a cut may be between centres, by its slope, but no more than a cutter of its
//!   radius can do;
//! - uncut: how much higher a region may be between centres, by its slope.
//!
//! Where a bound exceeds what the scene asks for, the closed-form surface is searched between the centres.
//! Places that a move or stock may reach unseen are cut anew on finer cells. Areas and shares stay those of
//! the grid.
//!
//! A ridge is a scallop where one of its passes touches the design nearby. Else it stands in a hollow that
//! the cutter does not fit. A place above the uncut tolerance is uncut, unless a pass came down to the design
//! there and the place is no higher than the highest scallop. So a tall scallop, or half of one at the
//! border, is a bad scallop and not an uncut place.

mod along_normals;
mod beneath;
mod beside_border;
mod border_cuts;
mod closer;
mod contact;
mod coverage;
mod creases;
mod cut_surface;
mod engagement;
mod engines;
mod every_move;
mod excess;
mod facing;
mod figures;
#[cfg(test)]
mod flat_scene;
mod inspected;
mod inspection;
mod measure;
mod measured_stock;
mod meetings;
mod offset_distance;
mod pairs;
mod path;
mod plunges;
mod pocket;
mod refine;
mod regions;
mod removal;
mod ridge_map;
mod ridges;
mod roughness;
mod section_polynomial;
mod sections;
#[cfg(test)]
mod several_tools;
mod tracks;
mod turning;
mod unseen;
mod wall_material;
mod walls;

pub use along_normals::{
    AlongNormal, FirstCut, NormalHit, NormalMap, PatchGrid, RaysCut, RaysCutInTurn, SweptVolume, VoxelCut,
    measure_along_normals, net_places,
};
pub use contact::contacts_on_patches;
pub use coverage::{AlongTask, CellsSeen, Coverage, CoverageFigures, UnseenSurface};
pub use cut_surface::CutSurface;
pub use engagement::{ContactArcs, THIN_LAYER, UNCOUNTED_LAYER, contact_arcs};
pub use engines::{
    BYTES_PER_TRIANGLE, Budget, ENGINES, Engine, EngineChoice, EngineError, LaidOut, MIB, Measured,
    NormalView, REACH_OVER_UNCUT, Simulation, Task, View,
};
pub use excess::cells_above;
pub use facing::{Facing, Judged, PlaceKind};
pub use figures::{
    Bounded, CloserLook, DeviationFigures, ExcessFigures, ExcessKind, GougeFigures, GougeRegion, Limits,
    Measurement, PathFigures, RidgePlace, ScallopFigures, ScallopRule, UncutFigures, UncutRegion,
};
pub use measure::measure;
pub use measured_stock::MeasureError;

pub use meetings::Meetings;
pub use offset_distance::{
    OffsetDistance, OffsetFigures, OffsetPoints, SingularPlaceFigures, measure_offset, offset_figures,
};
pub use pairs::{MOST_PAIRS, PAIRS_HEADER, PairFigures, ScallopPair};
pub use path::path_figures;
pub use plunges::StockBefore;
pub use pocket::{
    EngagementFigures, ExceedingStretch, PocketFigures, ThinLayers, WallGouge, radius_below, stock_beside,
    wall_gouge_of_cells, wall_gouge_of_moves,
};
pub use refine::Asked;
pub use removal::{RapidContactFigures, RemovalFigures, removal_figures, voxel_removal_figures};
pub use ridge_map::RidgeMap;
pub use roughness::{RoughnessFigures, roughness};
pub use section_polynomial::{PolynomialFigures, polynomial_figures};
pub use sections::{SectionFigures, section_figures};
pub use turning::{FastestTurn, fastest_turn, fastest_turn_across};
pub use wall_material::{WallMaterial, WallSearch};
