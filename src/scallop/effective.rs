//! The circle that a cutter which is no ball shows across the feed.

use super::ScallopError;
use cutter::Cutter;
use geometry::Vector3;
use motion::in_tool_frame;

/// Radius, mm, with which the cutter bends across the feed at a contact: outward surface normal `normal`,
/// tangent `across` the feed, tool axis `axis`, all unit. A ball's radius; `rc + (R − rc)/sin λ` for a torus
/// that leads by λ, `R/sin λ` for a flat.
///
/// # Errors
/// [`ScallopError::Cutter`] where a flat or a cone lies on the surface, which leaves no scallop by itself, or
/// a point touches, which leaves grooves.
///
/// # Tolerance
/// Exact for a ball. Of others it is the circle that osculates: a flat that leads by λ shows an ellipse with
/// half axes R and R sin λ, whose scallop between passes `s` apart on a plane is higher by the share
/// `s²/(16R²)`, less what the circle itself misses.
pub fn effective_radius(
    cutter: &Cutter,
    axis: &Vector3,
    normal: &Vector3,
    across: &Vector3,
) -> Result<f64, ScallopError> {
    if cutter.profile().is_ball() {
        return Ok(cutter.radius());
    }
    let [n, b] = [normal, across].map(|v| in_tool_frame(axis, v));
    if n.z <= 0.0 {
        return Err(ScallopError::Cutter(
            "the tool axis leans 90 degrees or more from the surface normal; tilt it less".into(),
        ));
    }
    let bend = cutter.normal_curvature(&n, &b);
    if bend.is_infinite() {
        return Err(ScallopError::Cutter("the cutter touches with its point, which leaves grooves and no scallops; use a ball, flat or bull nose".into()));
    }
    // The least bend that is not rounding: a million millimetres.
    if bend < 1e-6 {
        return Err(ScallopError::Cutter(
            "the cutter lies on the surface with a flat or a cone, which leaves no scallop by itself; give it a lead".into(),
        ));
    }
    Ok(1.0 / bend)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::BallSection;

    /// Leading in x over level ground.
    fn of(cutter: &Cutter, lead: f64) -> Result<f64, ScallopError> {
        let axis = Vector3::new(lead.to_radians().sin(), 0.0, lead.to_radians().cos());
        effective_radius(cutter, &axis, &Vector3::z(), &Vector3::y())
    }

    #[test]
    fn leads_make_circles_of_flats_and_bulls() {
        let (flat, bull) = (Cutter::flat(10.0).unwrap(), Cutter::bull(10.0, 2.0).unwrap());
        let sine = 10f64.to_radians().sin();
        assert!((of(&flat, 10.0).unwrap() - 5.0 / sine).abs() < 1e-9);
        assert!((of(&bull, 10.0).unwrap() - (2.0 + 3.0 / sine)).abs() < 1e-9);
        assert_eq!(of(&Cutter::ball(6.0).unwrap(), 30.0), Ok(3.0));
        assert!(of(&flat, 0.0).unwrap_err().to_string().contains("give it a lead"));
        assert!(of(&flat, 95.0).unwrap_err().to_string().contains("90 degrees"));
    }

    #[test]
    fn a_flat_that_leads_is_off_by_what_the_ellipse_is() {
        let (radius, sine) = (5.0, 5f64.to_radians().sin());
        let section = BallSection::new(of(&Cutter::flat(10.0).unwrap(), 5.0).unwrap(), 0.0).unwrap();
        for step in [0.5f64, 1.0, 2.0] {
            let exact = radius * sine * (1.0 - (1.0 - 0.25 * step * step / (radius * radius)).sqrt());
            let share = step * step / (16.0 * radius * radius);
            let off = exact / section.height(step).unwrap() - 1.0;
            assert!(off > 0.9 * share && off < 1.1 * share, "{off} {share}");
        }
    }
}
