//! Which subpaths of a filled path bound its fill (W3C SVG 2, 13.4.2).
//!
//! Outlines that lie in each other are outlines and islands in turn, as under `evenodd`. Under `nonzero` a
//! subpath that runs the way of the one around it has the fill on both of its sides: it is not seen.

use geometry::{Point2, Region, inside_curve, signed_area};

use super::Chords;

/// Which curves of one path have its fill on both sides, by the rule `nonzero`. None where they cross or
/// touch: then all of them are refused.
pub fn within(curves: &[Chords]) -> Vec<usize> {
    // What is open is closed with other pieces, if at all.
    let (places, closed): (Vec<usize>, Vec<Vec<Point2>>) =
        curves.iter().enumerate().filter(|(_, c)| c.closed).map(|(k, c)| (k, c.points.clone())).unzip();
    if closed.len() < 2 || Region::nested(closed.clone()).is_err() {
        return Vec::new();
    }
    let turns: Vec<i64> = closed.iter().map(|c| if signed_area(c) > 0.0 { 1 } else { -1 }).collect();
    let is_within = |k: &usize| {
        let around = |b: &usize| b != k && inside_curve(&closed[*b], &closed[*k][0]);
        let outside: i64 = (0..closed.len()).filter(around).map(|b| turns[b]).sum();
        outside != 0 && outside + turns[*k] != 0
    };
    (0..closed.len()).filter(is_within).map(|k| places[k]).collect()
}
