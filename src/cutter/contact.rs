//! How a cutter with a vertical axis touches a surface: where its axis stands, and how it is curved
//! there. mm, outward unit normals.

use super::Cutter;
use crate::geometry::{Vector2, Vector3};

/// Slope (sine) below which ground counts as nearly level for a cutter with a flat. Less lets the path
/// swerve by the flat's radius at every change of a gentle slope; more leaves its contact inside the
/// flat on slopes where only the rim can touch.
const NEARLY_LEVEL: f64 = 0.05;

impl Cutter {
    /// Normal curvature of the cutter's surface, 1/mm, at the contact with outward surface normal `n`
    /// (unit) in the tangent direction `b` (unit, `b ⟂ n`), for a vertical tool axis.
    ///
    /// A torus of corner radius `rc` around a flat disc `e` has the curvature `1/rc` in the meridian
    /// and `sin λ/(e + rc sin λ)` along the parallel, λ the slope of the surface; on a conical side
    /// the meridian is straight, and a sharp corner has none.
    pub fn normal_curvature(&self, n: &Vector3, b: &Vector3) -> f64 {
        let slope = n.xy().norm();
        let (e, rc) = (self.flat_radius(), self.corner_radius());
        if slope < 1e-9 {
            return if e > 0.0 { 0.0 } else { 1.0 / rc };
        }
        let parallel_direction = Vector3::new(-n.y, n.x, 0.0) / slope;
        let along_parallel = b.dot(&parallel_direction).powi(2);
        let on_arc = slope <= self.half_angle().cos();
        let radius_of_parallel = if on_arc { e + rc * slope } else { self.radius() };
        let meridian = if on_arc && rc > 0.0 { 1.0 / rc } else { 0.0 };
        slope / radius_of_parallel * along_parallel + meridian * (1.0 - along_parallel)
    }

    /// Plan-view offset from a contact with outward surface normal `n` to the cutter's axis, mm: the
    /// corner radius and, on a slope, the flat radius up to its rim. On ground that is nearly level any
    /// place of the flat touches; the offset then grows with the slope, so that it never jumps.
    pub fn axis_offset(&self, n: &Vector3) -> Vector2 {
        let plan = n.xy();
        plan * (self.corner_radius() + self.flat_radius() / plan.norm().max(NEARLY_LEVEL))
    }

    /// From the contact with a surface of outward unit normal `n` to the tip.
    pub fn contact_to_tip(&self, n: &Vector3) -> Vector3 {
        self.axis_offset(n).push(self.corner_radius() * (n.z - 1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
}
