//! Measures the cut surface against the design part, never against a planner's own prediction.
//!
//! Enters: the part, the stock after a path, and the path. Leaves: signed deviation at a design
//! point above or below every cell centre, the heights of the scallop ridges, gouges and uncut
//! places as connected regions, and a bound of the error beside each figure. mm throughout.
//!
//! Deviation at a design point is the signed distance along its outward normal to the cut surface:
//! positive is excess, negative is gouge.

mod along_normals;
mod closer;
mod cut_surface;
mod engagement;
mod engines;
mod figures;
#[cfg(test)]
mod flat_scene;
mod inspected;
mod inspection;
mod measure;
mod meetings;
mod offset_distance;
mod pairs;
mod path;
mod pocket;
mod refine;
mod regions;
mod removal;
mod ridges;
mod roughness;
mod sections;
mod tracks;
mod unseen;

pub use along_normals::{
    AlongNormal, FirstCut, NormalHit, NormalMap, PatchGrid, RaysCut, SweptVolume, VoxelCut,
    measure_along_normals, net_places,
};
pub use cut_surface::CutSurface;
pub use engagement::{ContactArcs, contact_arcs};
pub use engines::{
    Budget, ENGINES, Engine, EngineChoice, EngineError, LaidOut, MIB, Measured, REACH_OVER_UNCUT, Simulation,
    Task, View,
};
pub use figures::{
    CloserLook, DeviationFigures, GougeFigures, GougeRegion, Limits, Measurement, PathFigures,
    ScallopFigures, UncutFigures, UncutRegion,
};
pub use measure::measure;
pub use meetings::Meetings;
pub use offset_distance::{
    OffsetDistance, OffsetFigures, OffsetPoints, SingularPlaceFigures, measure_offset, offset_figures,
};
pub use pairs::{MOST_PAIRS, PAIRS_HEADER, PairFigures, ScallopPair};
pub use path::path_figures;
pub use pocket::{PocketFigures, wall_gouge_of_cells, wall_gouge_of_moves};
pub use refine::Asked;
pub use removal::{RapidContactFigures, RemovalFigures, removal_figures, voxel_removal_figures};
pub use roughness::{RoughnessFigures, roughness};
pub use sections::{SectionFigures, section_figures};
