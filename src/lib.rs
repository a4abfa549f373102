//! Millstream plans milling paths as the streamlines of a field, cuts the part in a simulator,
//! measures the cut surface, and says with numbers and error bounds whether the plan is good.

pub use work::{monitor, parallel};
pub use {
    blade, cli, collision, cutter, field, geometry, io, job, keys, machine, metrology, motion, offset, part,
    report, scallop, scene, sim, toolpath, work,
};
