//! Scallops by calculation: what a ridge between two passes of a ball will be, before anything is cut.
//!
//! Enters: the cutter's radius, the curvature of the surface across the feed, and a step or a height; or the
//! contacts of two passes. Leaves: the exact height and the exact step, and what two common simplifications
//! make of them: the second-order formula, and a polynomial fitted to the section across the feed. Lengths
//! mm, curvature 1/mm, positive where the surface is concave toward its outward normal.
//!
//! Calculated heights are predictions. Verdicts rest on what is measured on the cut surface; `metrology` puts
//! both side by side.

mod comparison;
mod contacts;
mod effective;
mod error;
mod place;
mod section;
mod section_fit;
mod silhouette;
mod strip;

pub use comparison::{Comparison, compare};
pub use contacts::ridge_between;
pub use effective::effective_radius;
pub use error::ScallopError;
pub use place::SurfaceCurvature;
pub use section::{BallSection, ScallopStep, ball_scallop_height};
pub use section_fit::{DEFAULT_DEGREE, MAX_DEGREE, SectionFit, SectionFrame, fit_section};
pub use strip::{
    FeedCurvature, cut_ahead, least_gap, strip_width, strip_width_at, strip_width_fed, widest_strip_at,
};
