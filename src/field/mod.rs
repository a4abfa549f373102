//! Feed-direction fields, stream functions and their level curves, on a rectangular parameter
//! domain with the metric of the surface. Knows nothing of cutters.
//!
//! Enters: directions sampled over the domain and the density of passes wanted there. Leaves: a
//! stream function ψ whose level curves follow the directions, and those curves traced by arc
//! length.

mod direction;
mod fit;
mod levels;
mod scalar;

pub use direction::orient;
pub use fit::{FieldError, NormalEquations, StreamFit, StreamSample, fit_stream_function};
pub use levels::{LevelCurve, LevelTracer};
pub use scalar::{Axis, ScalarField, ScalarSpline, surface_gradient_length};
