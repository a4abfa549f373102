//! Sections of a blade: plane curves at rising heights, checked, with their edges and sides.
//!
//! Enters: for each section a height and its curves as points, mm: a closed outline, or a pressure and a
//! suction side, each from the leading to the trailing edge. A section lies in the plane `z = height`, its
//! points are x and y. Leaves: [`Sections`], of which every rule of [`Sections::new`] holds, and for each
//! section the curves that a surface is laid through ([`Sections::sides`]). Sections can be read from tables
//! (`io::section_table`) or generated ([`GeneratedBlade`]).

mod check;
mod edges;
mod error;
mod naca;
mod round;
mod rounding;
mod stations;
#[cfg(test)]
mod tests;

pub use edges::{Edge, OutlineEdges, SectionSides};
pub use error::{SectionCurve, SectionError, SectionPlace};
pub use naca::{NacaDigits, NacaProfile, ProfileError};
pub use stations::{
    GenerateError, GeneratedBlade, MAX_GENERATED_POINTS, MAX_GENERATED_SECTIONS, Stacking, Station,
    TrailingEdge,
};

use geometry::{Point2, signed_area};

/// Fewest points of a curve: an interpolating spline with fewer says more of its end conditions than of the
/// blade.
pub const LEAST_POINTS: usize = 5;

/// Most points of all sections together. Splines, lofts and searches grow with them; more is noise of a scan.
pub const MAX_POINTS: usize = 200_000;

/// The curves of a section, mm.
#[derive(Debug, Clone, PartialEq)]
pub enum Outline {
    /// A closed curve; the last point is joined to the first and does not repeat it.
    Closed(Vec<Point2>),
    /// Both sides from the leading to the trailing edge. Their ends need not meet: a blunt trailing edge.
    Sides {
        /// The side of the higher pressure, the hollow or less curved one.
        pressure: Vec<Point2>,
        /// The side of the lower pressure, the more curved one.
        suction: Vec<Point2>,
    },
}

/// One section: its curves in the plane `z = height`.
#[derive(Debug, Clone, PartialEq)]
pub struct Section {
    /// z of its plane, mm.
    pub height: f64,
    /// Its curves.
    pub outline: Outline,
}

/// Which way the leading edge of closed outlines lies, where that cannot be left to their shape.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LeadingEnd {
    /// It is the end of the lowest section at the lesser x.
    MinusX,
    /// At the greater x.
    PlusX,
    /// At the lesser y.
    MinusY,
    /// At the greater y.
    PlusY,
}

/// Sections of a blade that fit together.
#[derive(Debug, Clone, PartialEq)]
pub struct Sections {
    sections: Vec<Section>,
    leading: Option<LeadingEnd>,
}

impl Outline {
    /// Its curves with their names, the pressure side first.
    pub fn curves(&self) -> impl Iterator<Item = (SectionCurve, &[Point2])> {
        let (first, second) = match self {
            Self::Closed(points) => ((SectionCurve::Outline, points.as_slice()), None),
            Self::Sides { pressure, suction } => (
                (SectionCurve::Pressure, pressure.as_slice()),
                Some((SectionCurve::Suction, suction.as_slice())),
            ),
        };
        std::iter::once(first).chain(second)
    }

    /// True for a closed curve.
    pub fn is_closed(&self) -> bool {
        matches!(self, Self::Closed(_))
    }

    /// Points of all its curves.
    pub fn point_count(&self) -> usize {
        self.curves().map(|(_, points)| points.len()).sum()
    }

    /// Diagonal of the box around it, mm.
    pub fn size(&self) -> f64 {
        let mut points = self.curves().flat_map(|(_, points)| points);
        let Some(first) = points.next() else { return 0.0 };
        let (lo, hi) = points.fold((*first, *first), |(lo, hi), p| (lo.inf(p), hi.sup(p)));
        (hi - lo).norm()
    }

    /// Area that it encloses, mm²: positive for a counter-clockwise outline, and for sides where the pressure
    /// side, run from leading to trailing edge, has the material on its left.
    pub fn signed_area(&self) -> f64 {
        match self {
            Self::Closed(points) => signed_area(points),
            Self::Sides { pressure, suction } => {
                let around: Vec<Point2> = pressure.iter().chain(suction.iter().rev()).copied().collect();
                signed_area(&around)
            }
        }
    }
}

impl Sections {
    /// Checks sections and takes them over. Closed outlines that all run clockwise are turned round; a last
    /// point that repeats the first is left out.
    ///
    /// # Errors
    /// [`SectionError`] for the first thing that is wrong: fewer than 2 sections; heights that do not rise;
    /// fewer than [`LEAST_POINTS`] points on a curve; more than [`MAX_POINTS`] in all; coordinates that are
    /// not finite or beyond [`MAX_COORDINATE`](geometry::MAX_COORDINATE); points that repeat their neighbour
    /// (within 1e-9 of the section's size); curves that cross or touch themselves or each other; closed
    /// outlines of different senses; sides that run against each other, or otherwise than in the section
    /// before; closed outlines among sides; a section more than 20 times larger or smaller than most; heights
    /// that span less than a 200th or more than 200 times the greatest section.
    pub fn new(sections: Vec<Section>) -> Result<Self, SectionError> {
        check::checked(sections).map(|sections| Self { sections, leading: None })
    }

    /// The same sections, their leading edges at a stated end.
    #[must_use]
    pub fn with_leading(mut self, leading: Option<LeadingEnd>) -> Self {
        self.leading = leading;
        self
    }

    /// The sections in rising order of height.
    pub fn sections(&self) -> &[Section] {
        &self.sections
    }

    /// At which end of closed outlines the leading edge was stated to be.
    pub fn leading(&self) -> Option<LeadingEnd> {
        self.leading
    }

    /// True where the sections are closed outlines, false where they are two sides each.
    pub fn are_closed(&self) -> bool {
        self.sections.iter().all(|s| s.outline.is_closed())
    }
}
