//! The part as planners see it: charts with strips and feed directions.

pub mod border;
pub mod chart;
pub mod feed;
pub mod mesh_surface;
pub mod plan_curve;
