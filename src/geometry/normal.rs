//! The unit normal of a NURBS patch, at poles its limit.

use super::{Jet2, NurbsSurface, Vector3};

/// Shares of the way across the patch at which a place whose normal has no limit of first order
/// borrows one, in the order in which they are tried. Greater borrows from farther away; less meets the same
/// degeneracy again.
const BORROW: [f64; 3] = [1.0e-7, 1.0e-5, 1.0e-3];

/// Below this share of the products that make it, a first-order normal is rounding.
const VANISHING: f64 = 1.0e-9;

/// Unit normal on the side of `du × dv`, at poles its limit. `None` where there is no normal close by either.
///
/// # Tolerance
/// Rounding; within a 1e-8th of the range from a pole, 1e-8 rad.
pub fn unit_normal(surface: &NurbsSurface, u: f64, v: f64) -> Option<Vector3> {
    normal_at(surface, &surface.jet(u, v), [u, v])
}

/// As [`unit_normal`] for a jet that is already there.
pub fn normal_at(surface: &NurbsSurface, jet: &Jet2, [u, v]: [f64; 2]) -> Option<Vector3> {
    jet.normal().or_else(|| {
        let inward = inward(surface, [u, v]);
        let borrow = |&t: &f64| surface.jet(u + t * inward[0], v + t * inward[1]).normal();
        first_order_normal(jet, inward).or_else(|| BORROW.iter().find_map(borrow))
    })
}

/// From parameters into the patch: to the farther ends of its ranges.
pub fn inward(surface: &NurbsSurface, at: [f64; 2]) -> [f64; 2] {
    let domain = surface.domain();
    [0, 1].map(|k| {
        let [lo, hi] = domain[k];
        if at[k] - lo < hi - at[k] { hi - at[k] } else { lo - at[k] }
    })
}

/// Where `du × dv` vanishes, its direction a step `(a, b)` of the parameters farther, in the limit of short
/// steps.
fn first_order_normal(jet: &Jet2, [a, b]: [f64; 2]) -> Option<Vector3> {
    let (du_change, dv_change) = (jet.duu * a + jet.duv * b, jet.duv * a + jet.dvv * b);
    let cross = du_change.cross(&jet.dv) + jet.du.cross(&dv_change);
    let scale = du_change.norm() * jet.dv.norm() + jet.du.norm() * dv_change.norm();
    let length = cross.norm();
    (length > VANISHING * scale).then(|| cross / length)
}
