//! Passes as levels of a function on a surface. Enters: the function, on a chart or a mesh, and what step
//! each place allows. Leaves: passes on whole levels, further ones at halves and quarters where a step is too
//! wide, and short ones in gaps.

pub mod gaps;
pub mod halving;
pub mod level_passes;
pub mod obedience;
pub mod on_triangles;
pub mod planes;
pub mod planned_field;
pub mod spacing;
pub mod spirals;
pub mod stretches;
