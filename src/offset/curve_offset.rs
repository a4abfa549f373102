//! The offset of a plane curve to one side, trimmed: what the centre of a disc can reach that rolls along it.
//!
//! Enters: a cubic spline, open or closed, a distance, mm, positive to the left, and a tolerance. Leaves: the
//! parts of the offset that are nowhere nearer to the curve than the distance, joined at the corners where
//! loops were cut off, both local ones (the curve turns with a smaller radius) and global ones (it comes near
//! itself); each smooth stretch between corners is a cubic spline of its own, since one spline through a
//! corner would swing.
//!
//! The offset keeps the parameter of the curve, `O(t) = C(t) + d N(t)` with `O' = (1 − κ d) C'`, and a place
//! is kept where a disc around it touches the curve at `C(t)` and holds no point of it. What is kept begins
//! and ends where `O(a) = O(b)`, solved on the exact curve. Nothing depends on crossings of polylines.

mod sample;
mod stretch;
#[cfg(test)]
mod tests;
mod trim;
mod walls;

use geometry::{CubicSpline, MAX_COORDINATE, Point2, SplineError, Vector2};
use walls::Walls;
pub use walls::distance_from;

/// Why a curve has no such offset.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum CurveOffsetError {
    /// The distance is no usual number.
    #[error("the offset distance is {0} mm; it must be a number of at most 1e6 in size")]
    Distance(f64),
    /// The tolerance is no usual number.
    #[error("the tolerance is {0} mm; it must be a number from 1e-9 of the curve's length up")]
    Tolerance(f64),
    /// The curve stands still, so it has no normal.
    #[error(
        "the curve has a cusp at parameter {parameter} (x {:.4} y {:.4}); move or delete a point of the section \
         there",
        at.x, at.y
    )]
    Cusp {
        /// Where on the curve.
        parameter: f64,
        /// The point, mm.
        at: Point2,
    },
    /// Nothing is left.
    #[error(
        "an offset of {} mm to the {} eats the whole section; {fits:.4} mm leaves something, around x {:.4} y \
         {:.4}: use a smaller cutter or offset less",
        distance.abs(), if *distance > 0.0 { "left" } else { "right" }, at.x, at.y
    )]
    Eaten {
        /// Asked, mm, positive to the left.
        distance: f64,
        /// About the greatest distance of which something is left, mm.
        fits: f64,
        /// The point of the curve beside which it is.
        at: Point2,
    },
    /// The tolerance asks for too many points.
    #[error("the offset needs more than 100000 points; use a greater tolerance than {0:e} mm")]
    TooManyPoints(f64),
    /// No spline goes through the points of the offset.
    #[error("the offset curve: {0}")]
    Spline(#[from] SplineError),
}

/// A place where a curve turns toward the side of its offset with no more than the distance as its radius.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TightPlace {
    /// Where on the curve.
    pub parameter: f64,
    /// The point of the curve, mm.
    pub point: Point2,
    /// Curvature toward the offset, 1/mm, positive: the greatest of its neighbourhood.
    pub curvature: f64,
}

/// A connected part of an offset.
#[derive(Debug, Clone, PartialEq)]
pub struct OffsetPiece {
    /// Smooth stretches in the sense of the curve; one ends where the next begins, in a corner.
    pub stretches: Vec<CubicSpline>,
    /// Parameters of the curve that each stretch belongs to, from and to. On closed curves they may go on
    /// beyond the end of the period.
    pub sources: Vec<[f64; 2]>,
    /// Whether the last stretch ends where the first begins. Without any corner there is one closed spline.
    pub closed: bool,
}

/// The trimmed offset of a curve.
#[derive(Debug, Clone, PartialEq)]
pub struct CurveOffset {
    /// What is left of it, in the order of the curve's parameter.
    pub pieces: Vec<OffsetPiece>,
    /// Where the curve is tighter than the distance, by its parameter; each connected stretch once.
    pub tight: Vec<TightPlace>,
    /// How far the splines lie from the true distance at most, mm, as measured at three places between any
    /// two of their points.
    pub error_mm: f64,
}

/// A curve and how far it is offset.
#[derive(Clone, Copy)]
struct Offset<'a> {
    curve: &'a CubicSpline,
    distance: f64,
}

impl Offset<'_> {
    /// The offset's point, and its derivative by the parameter.
    fn jet(&self, t: f64) -> (Point2, Vector2) {
        let (p, first, second) = self.curve.jet(t);
        let speed = first.norm();
        let unit = first / speed;
        let curvature = first.perp(&second) / (speed * speed * speed);
        (p + left_of(&unit) * self.distance, first * (1.0 - curvature * self.distance))
    }

    fn point(&self, t: f64) -> Point2 {
        self.jet(t).0
    }

    /// Curvature toward the offset times the distance: singular from 1 on.
    fn depth(&self, t: f64) -> f64 {
        self.curve.curvature(t) * self.distance
    }
}

fn left_of(v: &Vector2) -> Vector2 {
    Vector2::new(-v.y, v.x)
}

/// The offset of `curve` by `distance`, mm, positive to its left, without what is nearer to the curve than
/// that. Its splines keep the distance within `tolerance`, mm. Stretches also end at the parameters `breaks`
/// of the curve, as if corners were there.
///
/// # Errors
/// A distance or a tolerance that cannot be, a curve with a cusp, an offset of which nothing is left.
///
/// # Tolerance
/// Kept points are nowhere nearer to the curve than the distance less `tolerance`; loops less deep than that,
/// and stretches shorter than that, may be kept or cut off.
pub fn offset_curve(
    curve: &CubicSpline,
    distance: f64,
    tolerance: f64,
    breaks: &[f64],
) -> Result<CurveOffset, CurveOffsetError> {
    if distance.is_nan() || distance.abs() > MAX_COORDINATE {
        return Err(CurveOffsetError::Distance(distance));
    }
    let size = CubicSpline::chord_lengths(curve.points(), curve.is_closed()).last().copied().unwrap_or(0.0);
    if tolerance.is_nan() || tolerance.is_infinite() || tolerance < 1e-9 * size {
        return Err(CurveOffsetError::Tolerance(tolerance));
    }
    let offset = Offset { curve, distance };
    let places = sample::places(&offset, tolerance)?;
    let tight = sample::tight_places(&offset, &places);
    let walls = Walls::new(curve, tolerance);
    let intervals = trim::kept(&offset, &walls, &sample::with(&places, &tight, curve), tolerance);
    let mut error_mm = 0.0;
    let mut pieces = Vec::new();
    for chain in trim::chains(&offset, intervals, tolerance) {
        let chain = chain.broken_at(breaks, curve.domain());
        let (piece, error) = stretch::piece(&offset, &places, &chain, tolerance)?;
        error_mm = f64::max(error_mm, error);
        pieces.extend(piece);
    }
    if pieces.is_empty() {
        return Err(trim::eaten(&offset, &walls, &places));
    }
    Ok(CurveOffset { pieces, tight, error_mm })
}
