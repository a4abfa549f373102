//! Feed-direction fields, stream functions and their level curves, on a rectangular parameter domain with the
//! metric of the surface, and on triangle meshes ([`mesh`]). Knows nothing of cutters.
//!
//! Enters: directions sampled over the domain, or at scattered places, and the density of passes wanted
//! there. Leaves: a stream function ψ whose level curves follow the directions (a B-spline or a grid of
//! differences), and those curves traced by arc length.
//!
//! Three methods fit a stream function: B-splines on a parameter rectangle ([`fit_stream_function`]),
//! differences on a grid, and linear elements on a mesh. Elements serve parts of several patches, and meshes
//! that no height surface follows.

mod difference;
mod direction;
mod eikonal;
mod fit;
mod grid;
mod knots;
mod levels;
pub mod mesh;
mod multigrid;
mod packed;
mod planar;
mod planned;
mod scalar;
mod scattered;
mod solve;
mod sparse;

pub use difference::{GridFit, GridSolution, fit_by_differences};
pub use direction::{grid_turns, orient};
pub use eikonal::{Arrival, EikonalError, Front, Start, eikonal};
pub use fit::{DIRECTION_WEIGHT, FieldError, NormalEquations, StreamFit, StreamSample, fit_stream_function};
pub use grid::GridField;
pub use knots::{KnotRule, averaged_knots, equal_shares, weighted_knots};
pub use levels::{LevelCurve, LevelTracer};
pub use packed::{Gradients, Minimiser, Packed, Roughness, Rounds, Site, Tied, minimise};
pub use planar::{PlanarError, PlanarMesh, fill};
pub use planned::{DirectionError, FeedSample, LevelLine, PassPoint, PlannedField, ShortestPossible};
pub use scalar::{Axis, ScalarField, ScalarSpline, surface_gradient_length};
pub use scattered::{LineField, LineSample, SamplePlane};
pub use solve::{MAX_DENSE, SolveReport, Solver};
