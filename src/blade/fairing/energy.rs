//! Fairing by energy: the control point whose move lowers an energy most goes to where that is least while
//! all others stay (M. Eck, J. Hadenfeldt, "Local energy fairing of B-spline curves", *Computing Supplement*
//! 10, 1995).
//!
//! They integrate the squared second or third derivative, which straightens honest cubics too. Here it is the
//! next derivative, of which cubic splines have only its peaks: the jump energy.

use super::FairingError;
use super::control_points::control_points;
use super::relaxation::{Unknown, jump_changes};
use geometry::CubicSpline;

pub(super) fn unknowns(spline: &CubicSpline) -> Result<Vec<Unknown>, FairingError> {
    let unknown = |(middle, points): (usize, Vec<(usize, f64)>)| {
        let jumps = jump_changes(spline, &points, middle)?;
        let square: f64 = jumps.iter().map(|(_, change)| change * change).sum();
        let wish = jumps.iter().map(|(point, change)| (*point, change / square)).collect();
        // A move by d lowers the sum of squares by d² · square.
        Ok(Unknown { points, jumps, wish, worth: square.sqrt() })
    };
    control_points(spline)?.into_iter().map(unknown).collect()
}
