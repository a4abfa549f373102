//! Kjellander's fairing: the point with the greatest jump of the third derivative moves to where its
//! neighbours want it (J. A. P. Kjellander, "Smoothing of cubic parametric splines", *Computer-Aided Design*
//! 15(3), 1983).
//!
//! Hermite's cubic from the neighbour before a point to the one after it, with their tangents, would pass the
//! point's parameter at P*; there it has no jump. With the spans a before and b after the point and S = 1/a³
//! + 1/b³,
//!
//! P* = \[ P₋/a³ + P₊/b³ + ½ (P₋′/a² − P₊′/b²) + ½ P′ (1/a² − 1/b²) \] / S
//!
//! (tangents of the interpolating spline), which is ½ (P₋ + P₊) + ¼ (P₋′ − P₊′) for a = b = 1, and the jump
//! at the point is 12 S (P − P*): the way to P* is found from the jump here.

use super::FairingError;
use super::relaxation::{Unknown, jump_changes};
use geometry::CubicSpline;

/// Step, as a multiple of the way to P*, after which the jump of a point is gone once the spline is
/// interpolated again: exact far from the ends where points lie evenly. After a step of 1 the tangents have
/// given way, and 40.192 % of the jump is left.
pub const JUMP_REMOVING_STEP: f64 = 1.672_03;

/// S at point `k`, 1 over the parameter's cube.
fn stiffness(spline: &CubicSpline, k: usize) -> f64 {
    let t = spline.parameters();
    let before = k.checked_sub(1).unwrap_or(t.len() - 2);
    let width = |span: usize| Some(t.get(span + 1)? - t.get(span)?);
    [before, k].into_iter().filter_map(width).map(|width| width.powi(-3)).sum()
}

/// The points that have jumps of their own.
pub(super) fn unknowns(spline: &CubicSpline, step: f64) -> Result<Vec<Unknown>, FairingError> {
    let n = spline.points().len();
    let movable = if spline.is_closed() { 0..n } else { 2..n - 2 };
    movable
        .map(|k| {
            let points = vec![(k, 1.0)];
            let jumps = jump_changes(spline, &points, k)?;
            let worth = 12.0 * stiffness(spline, k) / step;
            Ok(Unknown { points, jumps, wish: vec![(k, 1.0 / worth)], worth })
        })
        .collect()
}
