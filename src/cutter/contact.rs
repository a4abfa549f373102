//! How a cutter with a vertical axis touches a surface: where its axis stands, and how it is curved
//! there. mm, outward unit normals.

use super::body::Cutter;
use geometry::{Vector2, Vector3};

/// Slope (sine) below which ground counts as nearly level for a cutter with a flat. Less lets the path
/// swerve by the flat's radius at every change of a gentle slope; more leaves its contact inside the
/// flat on slopes where only the rim can touch.
const NEARLY_LEVEL: f64 = 0.05;

/// The least slope that is told from level ground.
const LEAST_LEVEL: f64 = 1e-6;

/// Slope (sine) below which ground counts as level: there the direction of the slope is rounding.
const LEVEL: f64 = 1e-9;

impl Cutter {
    /// Normal curvature of the cutter's surface, 1/mm, at the contact with outward surface normal `n`
    /// (unit) in the tangent direction `b` (unit, `b ⟂ n`), for a vertical tool axis.
    ///
    /// At distance ρ from the axis the surface of revolution bends by `sin λ/ρ` along the parallel, λ
    /// the slope, and in the meridian as the profile: `1/r` on the arc (a torus), not at all on cones;
    /// a sharp edge counts as not bent either. At a point on the axis the bend has no limit: infinite.
    pub fn normal_curvature(&self, n: &Vector3, b: &Vector3) -> f64 {
        let profile = self.profile();
        let slope = n.xy().norm();
        let rho = profile.reach(slope);
        if rho == 0.0 && (profile.bottom.sin > 0.0 || profile.bottom_edge) {
            return f64::INFINITY;
        }
        if slope < LEVEL {
            return if profile.bottom_end > 0.0 { 0.0 } else { 1.0 / profile.corner };
        }
        let parallel_direction = Vector3::new(-n.y, n.x, 0.0) / slope;
        let along_parallel = b.dot(&parallel_direction).powi(2);
        let meridian = if self.touches_arc(slope) { 1.0 / profile.corner } else { 0.0 };
        slope / rho * along_parallel + meridian * (1.0 - along_parallel)
    }

    /// True when a slope of this sine is touched by the arc, not by a cone or an edge.
    fn touches_arc(&self, slope: f64) -> bool {
        let profile = self.profile();
        if profile.corner == 0.0 {
            return false;
        }
        let (bottom_end, arc_end) = (profile.bottom_end, profile.arc_end);
        let sine_at = |rho: f64| (rho - profile.centre_x) / profile.corner;
        let begins = if profile.bottom_edge { sine_at(bottom_end) } else { profile.bottom.sin };
        let ends = if profile.side_edge { sine_at(arc_end) } else { profile.side.sin };
        (begins..=ends).contains(&slope)
    }

    /// True when a surface with outward normal `n` is touched by a sharp edge rather than by the arc (or
    /// by a cutter that has none).
    pub fn touches_with_edge(&self, n: &Vector3) -> bool {
        let profile = self.profile();
        let edges = profile.corner == 0.0 || profile.bottom_edge || profile.side_edge;
        edges && !self.touches_arc(n.xy().norm())
    }

    /// Plan-view offset from a contact with outward surface normal `n` to the cutter's axis, mm: on a
    /// slope the contact is as far from the axis as the profile is as steep. On ground that is nearly
    /// as steep as the bottom any place of the bottom touches; the offset then grows with the slope, so
    /// that it never jumps.
    pub fn axis_offset(&self, n: &Vector3) -> Vector2 {
        self.axis_offset_from(n, NEARLY_LEVEL)
    }

    /// As [`Cutter::axis_offset`] where ground counts as nearly level below the slope (sine) `level`, within
    /// what it takes there.
    pub fn axis_offset_from(&self, n: &Vector3, level: f64) -> Vector2 {
        let level = level.clamp(LEAST_LEVEL, NEARLY_LEVEL);
        let (plan, profile) = (n.xy(), self.profile());
        let slope = plan.norm();
        if profile.bottom.sin == 0.0 && !profile.bottom_edge && !profile.side_edge {
            // Disc and arc as a sum of two terms, which stays exact on level ground.
            let beyond = slope.min(profile.side.sin).min(1.0);
            let arc = if beyond < slope { beyond / slope } else { 1.0 };
            return plan * (profile.corner * arc + profile.bottom_end / slope.max(level));
        }
        let over = ((slope - profile.bottom.sin) / level).clamp(0.0, 1.0);
        if over == 0.0 {
            return Vector2::zeros();
        }
        let arc = (profile.centre_x + profile.corner * slope).min(profile.arc_end) - profile.bottom_end;
        plan * ((profile.bottom_end * over + arc.max(0.0)) / slope)
    }

    /// From the contact with a surface of outward unit normal `n` to the tip.
    pub fn contact_to_tip(&self, n: &Vector3) -> Vector3 {
        let (offset, profile) = (self.axis_offset(n), self.profile());
        let slope = n.xy().norm();
        let height = if self.touches_arc(slope) {
            profile.centre_z - profile.corner * n.z
        } else {
            profile.height(offset.norm().min(profile.radius))
        };
        offset.push(-height)
    }

    /// From the contact with a surface of outward unit normal `n` to the tip of a cutter along the unit
    /// `axis`: on the arc `r n + (R − r) e − r a`, with e the unit part of n square to the axis and R − r the
    /// distance of the arc's centre from it. Unlike [`Cutter::contact_to_tip`] exact for the least lean: a
    /// flat leaning by a hair stands on its rim. Square to the surface it is centred over the contact.
    pub fn contact_to_tip_along(&self, n: &Vector3, axis: &Vector3) -> Vector3 {
        let profile = self.profile();
        let outward = n - axis * n.dot(axis);
        let Some(e) = outward.try_normalize(LEVEL) else { return -axis * profile.height(0.0) };
        let lean = outward.norm();
        let reach = profile.reach(lean);
        let height = if self.touches_arc(lean) {
            profile.centre_z - profile.corner * n.dot(axis)
        } else {
            profile.height(reach.min(profile.radius))
        };
        e * reach - axis * height
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::AptWords;

    #[test]
    fn the_curvature_is_that_of_a_torus() {
        let tilted = Vector3::new(0.5, 0.0, 0.75f64.sqrt());
        let (along, down) = (Vector3::y(), Vector3::new(0.75f64.sqrt(), 0.0, -0.5));
        let ball = Cutter::ball(6.0).unwrap();
        assert!((ball.normal_curvature(&tilted, &along) - 1.0 / 3.0).abs() < 1e-12);
        assert!((ball.normal_curvature(&tilted, &down) - 1.0 / 3.0).abs() < 1e-12);
        let bull = Cutter::bull(6.0, 1.0).unwrap();
        assert!((bull.normal_curvature(&tilted, &along) - 0.5 / 2.5).abs() < 1e-12);
        assert!((bull.normal_curvature(&tilted, &down) - 1.0).abs() < 1e-12);
        assert_eq!(bull.normal_curvature(&Vector3::z(), &along), 0.0);
        let flat = Cutter::flat(6.0).unwrap();
        assert!((flat.normal_curvature(&tilted, &along) - 0.5 / 3.0).abs() < 1e-12, "sin λ / R");
        assert_eq!(flat.normal_curvature(&tilted, &down), 0.0);
    }

    #[test]
    fn the_axis_stands_off_by_corner_and_flat() {
        let n = Vector3::new(0.6, 0.0, 0.8);
        assert!((Cutter::ball(6.0).unwrap().axis_offset(&n).x - 1.8).abs() < 1e-12);
        assert!((Cutter::bull(6.0, 1.0).unwrap().axis_offset(&n).x - 2.6).abs() < 1e-12);
        assert_eq!(Cutter::flat(6.0).unwrap().axis_offset(&Vector3::z()), Vector2::zeros());
    }

    /// A plane under every profile: the cutter put there by the contact stands as it would when dropped
    /// on the plane, on slopes where one place touches.
    #[test]
    fn cutters_put_by_their_contact_rest_on_planes() {
        for words in AptWords::examples() {
            let cutter = Cutter::apt(&words).unwrap();
            let profile = cutter.profile();
            for k in 1..89 {
                let (sin, cos) = f64::from(k).to_radians().sin_cos();
                // Beside the slope of the bottom the offset is drawn out; beyond that of the side only
                // the rim touches.
                if (profile.bottom.sin..profile.bottom.sin + NEARLY_LEVEL).contains(&sin)
                    || sin >= profile.side.sin
                {
                    continue;
                }
                let n = Vector3::new(-sin * 0.6, sin * 0.8, cos);
                let to_tip = cutter.contact_to_tip(&n);
                // The plane z = g·(x, y) rises by tan along (0.6, −0.8): no point of the profile may lie
                // below it with the tip there, and the contact, the origin, lies on both.
                let tan = sin / cos;
                let uphill = -(to_tip.x * 0.6 - to_tip.y * 0.8);
                assert!((to_tip.xy().norm() - uphill.abs()).abs() < 1e-12 && uphill > -1e-12);
                let contact = to_tip.z + cutter.height(uphill.clamp(0.0, cutter.radius())).unwrap();
                assert!(contact.abs() < 1e-9, "{words:?} {k}: {contact}");
                for i in 0..=1000 {
                    let rho = cutter.radius() * f64::from(i) / 1000.0 * (1.0 - 1e-15);
                    let gap = to_tip.z + cutter.height(rho).unwrap() - tan * (rho - uphill);
                    assert!(gap > -1e-9 * (1.0 + tan), "{words:?} {k} at {rho}: {gap}");
                }
            }
        }
    }

    #[test]
    fn the_curvature_follows_the_pieces() {
        let words = AptWords::examples();
        let pointed = Cutter::apt(&words[0]).unwrap();
        let slope = |degrees: f64| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            (Vector3::new(-sin, 0.0, cos), Vector3::new(cos, 0.0, sin))
        };
        let (n, up) = slope(5.0);
        assert_eq!(pointed.normal_curvature(&n, &up), f64::INFINITY, "the point touches");
        let (n, up) = slope(45.0);
        assert!((pointed.normal_curvature(&n, &up) - 1.0 / 0.8).abs() < 1e-12, "the arc");
        let rho = words[0].corner_x + 0.8 * 0.5f64.sqrt();
        assert!((pointed.normal_curvature(&n, &Vector3::y()) - 0.5f64.sqrt() / rho).abs() < 1e-12);
        let barrel = Cutter::apt(&words[5]).unwrap();
        let (n, up) = slope(85.0);
        assert!(
            (barrel.normal_curvature(&n, &up) - 1.0 / 20.0).abs() < 1e-12 && !barrel.touches_with_edge(&n)
        );
        let (n, up) = slope(30.0);
        assert!(
            barrel.normal_curvature(&n, &up) == 0.0 && barrel.touches_with_edge(&n),
            "the edge below the arc"
        );
    }
}
