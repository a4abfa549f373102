//! What passes were planned by, as plain data for pictures and figures; nothing is planned by it. mm.

use geometry::{Point2, Point3, Vector2};

use crate::mesh::SingularPoint;

/// What a streamline path was planned by.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PlannedField {
    /// Feed directions, evenly over the part.
    pub directions: Vec<FeedSample>,
    /// Lines along which ψ is constant, at even steps of it.
    pub level_lines: Vec<LevelLine>,
    /// The points around which the feed directions turn.
    pub singular_points: Vec<SingularPoint>,
    /// The contacts of each pass.
    pub passes: Vec<Vec<PassPoint>>,
    /// How far passes are off the directions asked for; `None` where none were.
    pub direction_error: Option<DirectionError>,
}

/// A line along which ψ is constant, in the plan view.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LevelLine {
    /// ψ there: neighbouring passes differ by about 1 where the function counts passes.
    pub psi: f64,
    /// Its points, mm.
    pub points: Vec<Point2>,
    /// The density of passes at each point, `|∇ψ|` on the surface, 1/mm.
    pub densities: Vec<f64>,
}

/// Angles between passes and the feed directions asked for, rad.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DirectionError {
    /// Root mean square over the length of all passes, or over the rows of a table, or over the length of
    /// guides and borders.
    pub rms: f64,
    /// The greatest.
    pub max: f64,
    /// Between the places that were looked at it may be greater by as much, and at a row it may be less.
    pub error_bound: f64,
    /// Where it is.
    pub at: Point3,
}

/// A feed direction at a place of the plan view.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FeedSample {
    /// Where, mm.
    pub at: Point2,
    /// Plan view of the feed, of length 1.
    pub direction: Vector2,
}

/// A contact of a pass and the distance of its neighbours.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PassPoint {
    /// Where, mm.
    pub at: Point3,
    /// The interval that the settings allow here, mm.
    pub allowed: f64,
    /// Distance of the neighbouring pass, of the farther one of two, mm; `None` without neighbours.
    pub interval: Option<f64>,
    /// On the part, not on its continuation beyond the border.
    pub inside: bool,
}

impl PassPoint {
    /// The interval over the allowed one.
    pub fn ratio(&self) -> Option<f64> {
        self.interval.map(|interval| interval / self.allowed)
    }
}

impl PlannedField {
    /// Appends what another chart or piece was planned by.
    pub fn append(&mut self, other: Self) {
        self.directions.extend(other.directions);
        self.level_lines.extend(other.level_lines);
        self.singular_points.extend(other.singular_points);
        self.passes.extend(other.passes);
    }
}

/// The way that no path can be shorter than.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShortestPossible {
    /// Of the cutter's tip: the integral of the least `(1 − κ r)/w` over all directions, mm.
    pub cutting_mm: f64,
    /// Of the contact on the surface: the integral of `1/w_max`, mm.
    pub contact_mm: f64,
    /// Share of the surface where the part is as concave as the cutter, or nearly so: the strip is limited
    /// there.
    pub limited_fraction: f64,
}
