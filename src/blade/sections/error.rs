//! What is wrong with a set of sections.

use super::{LEAST_POINTS, MAX_POINTS};
use geometry::{MAX_COORDINATE, Point2, SplineError};

/// A curve of a section.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SectionCurve {
    /// The closed outline.
    Outline,
    /// The pressure side.
    Pressure,
    /// The suction side.
    Suction,
}

impl std::fmt::Display for SectionCurve {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Outline => "outline",
            Self::Pressure => "pressure side",
            Self::Suction => "suction side",
        })
    }
}

/// Where in a set of sections.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SectionPlace {
    /// Section, counted from 0 (messages count from 1).
    pub section: usize,
    /// Its height, mm.
    pub height: f64,
    /// The curve, and the point of it counted from 0, where one is meant.
    pub point: Option<(SectionCurve, usize)>,
}

impl std::fmt::Display for SectionPlace {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "section {} (height {} mm)", self.section + 1, shown(self.height))?;
        match self.point {
            None => Ok(()),
            Some((curve, point)) => write!(f, ", {curve}, point {}", point + 1),
        }
    }
}

/// A length as messages show it: to a tenth of a micrometre, without the noise of a unit's conversion.
fn shown(length: f64) -> f64 {
    if length.abs() < MAX_COORDINATE { (length * 1e4).round() / 1e4 + 0.0 } else { length }
}

/// Why sections make no blade. Each names the place, what is wrong and what cures it.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SectionError {
    /// Nothing lies between fewer than two sections.
    #[error("there {} section; a surface needs at least 2", if *.count == 0 { "is no" } else { "is only 1" })]
    TooFewSections {
        /// How many there are.
        count: usize,
    },
    /// More than any surface needs.
    #[error("the sections have {count} points, and {MAX_POINTS} are allowed; thin them out")]
    TooManyPoints {
        /// How many there are.
        count: usize,
    },
    /// A height that is not finite or too large.
    #[error(
        "section {}: the height {height} is no number within ±{MAX_COORDINATE} mm; check its unit",
        section + 1
    )]
    Height {
        /// Section, from 0.
        section: usize,
        /// Its height.
        height: f64,
    },
    /// Heights do not rise.
    #[error(
        "{place} is no higher than the one before (height {} mm); give sections in rising order, each height \
         once",
        shown(*.before)
    )]
    NotRising {
        /// The later section.
        place: SectionPlace,
        /// Height of the one before, mm.
        before: f64,
    },
    /// Some sections are closed outlines, others two sides.
    #[error(
        "{place} is {}, and section 1 is {}; give all sections in the same way",
        if *.closed { "a closed outline" } else { "a pressure and a suction side" },
        if *.closed { "a pressure and a suction side" } else { "a closed outline" }
    )]
    Kind {
        /// The first section unlike section 1.
        place: SectionPlace,
        /// Whether it is closed.
        closed: bool,
    },
    /// Too few points.
    #[error("{place}: the {curve} has {count} points; a curve needs at least {LEAST_POINTS}")]
    TooFewPoints {
        /// The section.
        place: SectionPlace,
        /// Its curve.
        curve: SectionCurve,
        /// How many it has.
        count: usize,
    },
    /// A coordinate that is not finite or too large.
    #[error("{place}: ({}, {}) is no point within ±{MAX_COORDINATE} mm; check its unit", at.x, at.y)]
    Coordinate {
        /// The point.
        place: SectionPlace,
        /// What it is.
        at: Point2,
    },
    /// Two neighbouring points are the same.
    #[error("{place} repeats point {}; delete one of them", of + 1)]
    Repeated {
        /// The later of the two.
        place: SectionPlace,
        /// The other, from 0.
        of: usize,
    },
    /// A section has no extent.
    #[error("{place} encloses no area; its points lie on a line, or run there and back")]
    NoArea {
        /// The section.
        place: SectionPlace,
    },
    /// A curve crosses or touches itself.
    #[error(
        "{place}: the {curve} crosses or touches itself at x {:.4} y {:.4}, between points {} and {} and \
         between {} and {}; look for points out of order, or digits lost",
        at.x, at.y, sides[0][0] + 1, sides[0][1] + 1, sides[1][0] + 1, sides[1][1] + 1
    )]
    CrossesItself {
        /// The section, and the first of the points.
        place: SectionPlace,
        /// Which of its curves.
        curve: SectionCurve,
        /// The points before and after the crossing on both passes, from 0.
        sides: [[usize; 2]; 2],
        /// Where, mm.
        at: Point2,
    },
    /// The two sides cross or touch.
    #[error(
        "{place}: the pressure and the suction side meet at x {:.4} y {:.4}, near point {} and point {} of \
         them; they may share their first and last points only",
        at.x, at.y, points[0] + 1, points[1] + 1
    )]
    SidesCross {
        /// The section, and the point of the pressure side.
        place: SectionPlace,
        /// Points of the pressure and of the suction side before the crossing, from 0.
        points: [usize; 2],
        /// Where, mm.
        at: Point2,
    },
    /// A side runs from trailing to leading edge, the other from leading to trailing.
    #[error(
        "{place}: the pressure and the suction side run against each other; give both from the leading to \
         the trailing edge"
    )]
    SidesOpposed {
        /// The section.
        place: SectionPlace,
    },
    /// Outlines of different senses, or pressure and suction side exchanged.
    #[error(
        "{place}: {}; section {} does it the other way",
        if *.closed {
            "the outline runs in the other sense (clockwise or counter-clockwise): reverse its points"
        } else {
            "the pressure and the suction side have changed places: exchange them"
        },
        place.section
    )]
    Sense {
        /// The first section unlike those before.
        place: SectionPlace,
        /// Whether its outline is closed.
        closed: bool,
    },
    /// The leading edge of a section lies where the trailing edge of the one before is.
    #[error(
        "{place}: its leading edge lies where section {} has its trailing edge; reverse the points of both \
         sides, or add sections in between where the blade twists by more than 90 degrees from one to the \
         next",
        place.section
    )]
    LeadingSwitched {
        /// The first section unlike those before.
        place: SectionPlace,
    },
    /// Sections of very different sizes.
    #[error(
        "{place} is {size:.4} mm across, and most are about {usual:.4} mm; is it in another unit? All lengths \
         of a table have the same"
    )]
    Size {
        /// The section.
        place: SectionPlace,
        /// Its size, mm.
        size: f64,
        /// The median of all sizes, mm.
        usual: f64,
    },
    /// No spline can be laid through an outline.
    #[error("{place}: {source}")]
    Spline {
        /// The section.
        place: SectionPlace,
        /// Why.
        source: SplineError,
    },
    /// Heights of another order than the outlines.
    #[error(
        "the sections span {span:.4} mm of height, and the greatest is {size:.4} mm across; are heights and \
         points in different units?"
    )]
    HeightUnit {
        /// From the lowest to the highest section, mm.
        span: f64,
        /// Greatest size, mm.
        size: f64,
    },
}

impl SectionError {
    /// The place that is meant, where it is one.
    pub fn place(&self) -> Option<SectionPlace> {
        match *self {
            Self::TooFewSections { .. } | Self::TooManyPoints { .. } | Self::HeightUnit { .. } => None,
            Self::Height { section, height } => Some(SectionPlace { section, height, point: None }),
            Self::NotRising { place, .. }
            | Self::Kind { place, .. }
            | Self::TooFewPoints { place, .. }
            | Self::Coordinate { place, .. }
            | Self::Repeated { place, .. }
            | Self::NoArea { place }
            | Self::CrossesItself { place, .. }
            | Self::SidesCross { place, .. }
            | Self::SidesOpposed { place }
            | Self::Sense { place, .. }
            | Self::LeadingSwitched { place }
            | Self::Spline { place, .. }
            | Self::Size { place, .. } => Some(place),
        }
    }
}
