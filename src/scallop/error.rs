//! Why a scallop cannot be calculated.

/// Why no scallop could be calculated.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ScallopError {
    /// A number is not finite or out of its range.
    #[error("{what} is {value}; it must be {wanted}")]
    Range {
        /// Which number.
        what: &'static str,
        /// What was given.
        value: f64,
        /// What it must be.
        wanted: &'static str,
    },
    /// The ball does not fit: the machinable limit.
    #[error(
        "a ball of radius {ball} mm does not fit into a concave section of radius {section} mm: the machinable limit; \
         use a ball of less than {diameter} mm diameter"
    )]
    DoesNotFit {
        /// Radius of the ball, mm.
        ball: f64,
        /// Radius of the section, mm.
        section: f64,
        /// Twice that.
        diameter: f64,
    },
    /// A cutter that is no ball does not fit.
    #[error(
        "the cutter has a radius of {radius:.4} mm across the feed there, and does not fit into a concave section of radius {section} mm: \
         the machinable limit; {cure}"
    )]
    CutterDoesNotFit {
        /// Radius that the cutter shows across the feed, mm.
        radius: f64,
        /// Radius of the section, mm.
        section: f64,
        /// What would fit.
        cure: String,
    },
    /// The two passes leave untouched material between them.
    #[error(
        "passes {step} mm apart leave material that no pass touches: a ball of radius {ball} mm reaches across \
         {} mm there; choose a smaller step", digits(*greatest)
    )]
    Step {
        /// The step along the surface, mm.
        step: f64,
        /// Radius of the ball, mm.
        ball: f64,
        /// The widest step that leaves a ridge and nothing else, mm.
        greatest: f64,
    },
    /// No step leaves so high a ridge.
    #[error(
        "no step leaves a scallop of {height} mm there: the highest that a ball of radius {ball} mm leaves is \
         {} mm; ask for less", digits(*greatest)
    )]
    Height {
        /// The height, mm.
        height: f64,
        /// Radius of the ball, mm.
        ball: f64,
        /// The highest possible, mm.
        greatest: f64,
    },
    /// The cutter has no circle to calculate with.
    #[error("{0}")]
    Cutter(String),
    /// The polynomial cannot be fitted.
    #[error(
        "a polynomial of degree {degree} needs contacts at {needed} or more distances across the feed, and {given} were given"
    )]
    Fit {
        /// Degree of the polynomial.
        degree: usize,
        /// Distinct abscissae that it needs.
        needed: usize,
        /// How many there are.
        given: usize,
    },
    /// The two envelope circles do not meet.
    #[error(
        "the two contacts are {distance} mm apart across the feed, and circles of radius {ball} mm do not meet; take nearer ones"
    )]
    Apart {
        /// Distance of the circles' centres, mm.
        distance: f64,
        /// Radius of the ball, mm.
        ball: f64,
    },
}

/// Four digits that count.
fn digits(value: f64) -> String {
    let decimals = (3.0 - value.abs().log10().floor()).clamp(0.0, 12.0) as usize;
    format!("{value:.decimals$}")
}

/// `value`, if it is finite and above zero.
pub(crate) fn positive(what: &'static str, value: f64) -> Result<f64, ScallopError> {
    if value > 0.0 && value <= geometry::MAX_COORDINATE {
        Ok(value)
    } else {
        Err(ScallopError::Range { what, value, wanted: "a positive number of mm, a million at most" })
    }
}
