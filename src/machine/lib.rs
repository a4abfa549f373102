//! The machine: speed and acceleration limits, machining time, five-axis kinematics.
//!
//! Enters: a path and the limits of a machine. Leaves: the time it takes, reduced feeds at corners, and the
//! joint positions of five-axis machines ([`kinematics`]). Lengths in mm, rates in mm/min, accelerations in
//! mm/s², times in s, joint angles in rad.

mod axis_limits;
mod blending;
mod feeds;
mod jerk;
pub mod kinematics;
mod merge;
mod program_time;
mod time;

pub use axis_limits::{axes_at_most, machining_time_of_axes, slow_axes};
pub use blending::Blending;
pub use feeds::slow_corners;
pub use merge::{Straying, merge_short_moves};
pub use program_time::machining_time_of_program;
pub use time::{at_most, machining_time};

/// Limits of the machine's motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Machine {
    /// Rapid rate, mm/min.
    pub rapid_rate: f64,
    /// Acceleration along the path and across it, mm/s².
    pub acceleration: f64,
    /// How far the control may round a corner, mm: it sets the speed at corners.
    pub junction_deviation: f64,
    /// How fast acceleration may change, mm/s³: it sets the speed where curvature changes suddenly.
    pub jerk: f64,
    /// Lines of a program that the control can run, 1/s: a shorter move lasts as long as one.
    pub block_rate: f64,
    /// Fastest X, Y and Z of upright tools, mm/min; infinite ones limit nothing.
    pub rates: [f64; 3],
    /// Accelerations of X, Y and Z of upright tools, mm/s²; with infinite ones only `acceleration` limits.
    pub accelerations: [f64; 3],
    /// Jerks of X, Y and Z of upright tools, mm/s³; infinite ones limit nothing.
    pub jerks: [f64; 3],
    /// How acceleration is shared where corners are rounded; of upright tools.
    pub blending: Blending,
    /// Whether programs have the feeds at which corners and bends can be run.
    pub slow_corners: bool,
}

impl Default for Machine {
    /// A mid-sized vertical machining centre: rapids of 15 m/min, 0.3 g, and corners rounded by
    /// 0.01 mm, the usual setting of controls for finishing (also grbl's); jerk as such machines are set
    /// for finishing, 50 m/s³; a thousand lines a second, as controls with a high-speed option run.
    fn default() -> Self {
        Self {
            rapid_rate: 15_000.0,
            acceleration: 3000.0,
            junction_deviation: 0.01,
            jerk: 50_000.0,
            block_rate: 1000.0,
            rates: [f64::INFINITY; 3],
            accelerations: [f64::INFINITY; 3],
            jerks: [f64::INFINITY; 3],
            blending: Blending::Full,
            slow_corners: true,
        }
    }
}

/// Why a machine's limits were refused.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("the machine's {what} is {value}; it must be a positive number of {unit}")]
pub struct MachineError {
    /// Which limit.
    pub what: &'static str,
    /// What was given.
    pub value: f64,
    /// Its unit.
    pub unit: &'static str,
}

impl Machine {
    /// The feed, mm/min, from which the machine stops within its junction deviation: `√(2·a·δ)`. Programs ask
    /// for no less at corners, however sharp; what the control still brakes there takes no longer than the
    /// corner itself.
    pub fn creep_feed(&self) -> f64 {
        60.0 * (2.0 * self.acceleration * self.junction_deviation).sqrt()
    }

    /// Whether upright tools have limits besides rates and the acceleration along and across the path.
    pub(crate) fn limits_axes(&self) -> bool {
        self.blending == Blending::Arcs
            || self.accelerations.iter().chain(&self.jerks).any(|most| most.is_finite())
    }

    /// Refuses limits with which no time could be told.
    ///
    /// # Errors
    /// [`MachineError`] unless all limits are positive, and finite but for those of single axes.
    pub fn check(&self) -> Result<(), MachineError> {
        let limits = [
            ("rapid rate", self.rapid_rate, "mm/min"),
            ("acceleration", self.acceleration, "mm/s²"),
            ("junction deviation", self.junction_deviation, "mm"),
            ("jerk", self.jerk, "mm/s³"),
            ("block rate", self.block_rate, "lines/s"),
        ];
        let refused = limits.into_iter().find(|(_, value, _)| !(*value > 0.0 && value.is_finite()));
        let rates = self.rates.map(|value| ("rate of an axis", value, "mm/min"));
        let accelerations = self.accelerations.map(|value| ("acceleration of an axis", value, "mm/s²"));
        let jerks = self.jerks.map(|value| ("jerk of an axis", value, "mm/s³"));
        let single = || {
            let all = rates.into_iter().chain(accelerations).chain(jerks);
            all.into_iter().find(|(_, value, _)| value.is_nan() || *value <= 0.0)
        };
        match refused.or_else(single) {
            Some((what, value, unit)) => Err(MachineError { what, value, unit }),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_machine_stops_from_its_creep_feed_within_the_junction_deviation() {
        let machine = Machine::default();
        let speed = machine.creep_feed() / 60.0;
        assert!((speed * speed / (2.0 * machine.acceleration) - machine.junction_deviation).abs() < 1e-15);
    }

    #[test]
    fn limits_are_checked() {
        let machine = Machine::default();
        assert_eq!(machine.check(), Ok(()));
        let error = Machine { acceleration: 0.0, ..machine }.check().unwrap_err();
        let message = "the machine's acceleration is 0; it must be a positive number of mm/s²";
        assert_eq!(error.to_string(), message);
        assert!(Machine { rapid_rate: f64::NAN, ..machine }.check().is_err());
        assert!(Machine { junction_deviation: f64::INFINITY, ..machine }.check().is_err());
        assert!(Machine { jerk: -1.0, ..machine }.check().is_err());
        assert!(Machine { rates: [1.0, f64::NAN, 1.0], ..machine }.check().is_err());
        assert!(Machine { accelerations: [1.0, 1.0, 0.0], ..machine }.check().is_err());
    }
}

/// What both are tested with.
#[cfg(test)]
mod fixture {
    use super::{Blending, Machine};
    use geometry::Point3;
    use motion::{ClPoint, Move, MoveKind, Toolpath};

    pub const fn machine(jerk: f64) -> Machine {
        Machine {
            rapid_rate: 12_000.0,
            acceleration: 1000.0,
            junction_deviation: 0.01,
            jerk,
            block_rate: 1e9,
            rates: [f64::INFINITY; 3],
            accelerations: [f64::INFINITY; 3],
            jerks: [f64::INFINITY; 3],
            blending: Blending::Full,
            slow_corners: true,
        }
    }

    /// The time of a path that nothing interrupts.
    pub fn seconds(path: &Toolpath, machine: &Machine) -> f64 {
        super::machining_time(path, machine, &work::monitor::Silent).unwrap()
    }

    /// Cuts at 6000 mm/min = 100 mm/s, which takes 5 mm and 0.1 s to reach.
    pub fn path(tips: impl IntoIterator<Item = [f64; 3]>) -> Toolpath {
        let mut tips = tips.into_iter().map(|t| ClPoint::upright(Point3::from(t)));
        let start = tips.next().unwrap();
        let moves = tips.map(|to| Move { to, kind: MoveKind::Cut, feed_rate: 6000.0, pass: 0 }).collect();
        Toolpath::new(start, moves)
    }
}
