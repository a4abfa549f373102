//! Why there can be no such machine, and what cures it.

/// Why there can be no such machine.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum KinematicsError {
    /// A letter that programs do not know, or one twice.
    #[error("rotary axes cannot be called {} and {}", letters[0], letters[1])]
    Letters {
        /// First and second.
        letters: [char; 2],
    },
    /// A direction of no length, or of no number.
    #[error("the direction of axis {letter} is not a direction")]
    Direction {
        /// Which axis.
        letter: char,
    },
    /// Both axes turn in one plane.
    #[error("the rotary axes {} and {} are parallel, so that the tool tilts in one plane only", letters[0], letters[1])]
    Parallel {
        /// First and second.
        letters: [char; 2],
    },
    /// The second axis turns the cutter about itself.
    #[error("axis {letter}, the one next to the cutter, is parallel to the spindle and tilts nothing")]
    AlongSpindle {
        /// The second axis.
        letter: char,
    },
    /// A table behind a head.
    #[error(
        "axis {letter} is in the head and comes before the table's; the first axis is that next to the workpiece"
    )]
    Order {
        /// The first axis.
        letter: char,
    },
    /// Limits that nothing lies between.
    #[error("the limits of joint {joint} do not run from a lesser to a greater number and leave it no room")]
    Limits {
        /// Which joint.
        joint: char,
    },
    /// A number out of its range.
    #[error("{what} is {value}; it must be {expected}")]
    Number {
        /// What it is.
        what: &'static str,
        /// What was given.
        value: f64,
        /// What would do.
        expected: &'static str,
    },
}

impl KinematicsError {
    /// What to change, as an order.
    pub fn cure(&self) -> &'static str {
        match self {
            Self::Letters { .. } => "call them A, B or C, each letter once",
            Self::Direction { .. } => "write three numbers, not all zero, such as [0, 0, 1]",
            Self::Parallel { .. } => "give the two axes different directions",
            Self::AlongSpindle { .. } => "give it another direction than z, or exchange first and second",
            Self::Order { .. } => "exchange first and second",
            Self::Limits { .. } => "write the lesser limit first, or leave the limits away",
            Self::Number { .. } => "correct it",
        }
    }
}
