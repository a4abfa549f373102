//! The machine: speed and acceleration limits, machining time.

use crate::toolpath::Toolpath;

/// Limits of the machine's motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Machine {
    /// Rapid rate, mm/min.
    pub rapid_rate: f64,
    /// Acceleration along the path, mm/s².
    pub acceleration: f64,
}

/// Time for the whole path, s.
pub fn machining_time(_path: &Toolpath, _machine: &Machine) -> f64 {
    todo!()
}
