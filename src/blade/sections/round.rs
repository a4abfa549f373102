//! Round sections: outlines that are as wide in one direction as in any other have no edges of their own.
//!
//! Enters: an outline's spline, and the chord of the section next to it. Leaves: places for its edges in the
//! directions of that chord from its middle, so that surfaces run straight through round sections, wherever
//! the table begins them.

use super::edges::{Edge, LOOKS, OutlineEdges};
use geometry::{CubicSpline, Point2, Vector2};

/// An outline whose widths differ by less than this share is round: digits of the table decide which way it
/// is longest. An ellipse of ten to nine is none.
const ROUND: f64 = 0.01;

/// Directions in which widths are compared, over half a turn.
const DIRECTIONS: u32 = 60;

/// Halvings of a stretch in which the outline passes a direction.
const HALVINGS: u32 = 60;

/// Places of the outline, more than its points.
fn places(spline: &CubicSpline) -> Vec<f64> {
    let look = |span: &[f64], k: usize| span[0] + (span[1] - span[0]) * k as f64 / LOOKS as f64;
    spline.parameters().windows(2).flat_map(|span| (0..LOOKS).map(move |k| look(span, k))).collect()
}

/// Least and greatest width of the outline, mm.
fn widths(points: &[Point2]) -> [f64; 2] {
    let width = |k: u32| {
        let angle = std::f64::consts::PI * f64::from(k) / f64::from(DIRECTIONS);
        let along = Vector2::new(angle.cos(), angle.sin());
        let reach = points.iter().map(|p| p.coords.dot(&along));
        let [low, high] =
            reach.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)]);
        high - low
    };
    let all = (0..DIRECTIONS).map(width);
    all.fold([f64::INFINITY, 0.0], |[least, most], width| [least.min(width), most.max(width)])
}

impl OutlineEdges {
    /// Whether no direction of the outline is longer than others.
    pub(super) fn is_round(&self) -> bool {
        let points: Vec<Point2> = places(&self.spline).into_iter().map(|t| self.spline.point(t)).collect();
        let [least, most] = widths(&points);
        least > (1.0 - ROUND) * most
    }

    /// Puts the trailing edge in the direction `chord` from the middle, and the leading edge against it.
    pub(super) fn put_along(&mut self, chord: &Vector2) {
        let places = places(&self.spline);
        let points: Vec<Point2> = places.iter().map(|t| self.spline.point(*t)).collect();
        let middle = Point2::from(points.iter().map(|p| p.coords).sum::<Vector2>() / points.len() as f64);
        let radius = 0.25 * widths(&points).iter().sum::<f64>();
        let end = self.spline.domain()[1];
        let edge = |along: Vector2| {
            let across = |t: f64| along.perp(&(self.spline.point(t) - middle));
            let ahead = |k: &usize| along.dot(&(points[*k] - middle)) > 0.0;
            let next = |k: usize| places.get(k + 1).copied().unwrap_or(end);
            // Anticlockwise it passes from the right to the left of the direction once.
            let pass = (0..places.len())
                .filter(ahead)
                .find(|&k| across(places[k]) <= 0.0 && across(next(k)) > 0.0)?;
            let [mut a, mut b] = [places[pass], next(pass)];
            for _ in 0..HALVINGS {
                let t = 0.5 * (a + b);
                if across(t) > 0.0 { b = t } else { a = t }
            }
            let t = super::edges::snapped(&self.spline, a);
            Some(Edge { parameters: [t, t], point: self.spline.point(t), radius })
        };
        if let (Some(leading), Some(trailing)) = (edge(-chord), edge(*chord)) {
            (self.leading, self.trailing) = (leading, trailing);
        }
    }
}
