//! The part as strategies see it. Enters: patches or a mesh. Leaves: charts with normals, curvatures and
//! strip widths at every parameter; pieces of mesh that are reached from above; borders; feed directions;
//! curves of the plan view.

pub mod asked;
pub mod border;
pub mod chart;
pub mod feed;
pub mod height_contours;
pub mod mesh_surface;
pub mod plan_curve;
