//! The way that a leaning cutter runs on over the border at the end of a pass.
//!
//! A flat or bull nose end mill that leans forward cuts with the front of its rim. Half an interval aside the
//! rim lies behind the contact, so a pass that ends at the border leaves the corners of its strip standing.

use crate::moves::touch::Touch;
use crate::vocabulary::{Setup, Step};
use geometry::{Point3, Vector3};
use motion::{AxisError, CcPoint, ToolAxis};

/// A lean forward below this, as a sine, is none: the bottom of the cutter covers what is aside.
const LEAST_LEAN: f64 = 1e-3;

/// Beyond the border a pass goes on in its tangent plane. Where the part goes on with a normal off by more
/// than this, as its cosine, there is an edge instead.
const SAME_PLANE: f64 = 0.9;

/// A place within this share of the cutter's radius of the part lies on it.
const ON_PART: f64 = 1e-6;

/// How far behind the contact the rim lies at half an interval aside, mm, for a cutter that leans by a sine.
///
/// # Tolerance
/// To second order in the interval, on a plane. Convex surfaces take less.
fn behind(lean: f64, setup: &Setup<'_>) -> f64 {
    let corner = setup.cutter.corner_radius();
    let flat = setup.cutter.radius() - corner;
    let behind = match setup.settings.step {
        // A torus that leans is curved across the feed like a ball of this radius.
        Step::Scallop(height) => height * (corner + flat / lean) / flat,
        Step::Stepover(width) => width * width / (8.0 * flat),
    };
    behind.min(flat)
}

/// The pass with a further touch beyond the border, at the end that needs one.
///
/// # Errors
/// [`AxisError`] where the rule gives no axis there.
pub(super) fn run_on(
    mut pass: Vec<Touch>,
    rule: &ToolAxis,
    setup: &Setup<'_>,
) -> Result<Vec<Touch>, AxisError> {
    if setup.cutter.is_ball() || setup.cutter.corner_radius() >= setup.cutter.radius() {
        return Ok(pass);
    }
    let lead = |touch: &Touch| touch.at.axis.dot(&touch.feed);
    let further = |touch: &Touch, way: Vector3| -> Result<Option<Touch>, AxisError> {
        let lean = lead(touch).abs();
        let point = touch.contact.point + way * behind(lean, setup);
        if !is_beyond(&point, &touch.contact.normal, setup) {
            return Ok(None);
        }
        let contact = CcPoint { point, normal: touch.contact.normal };
        Touch::by(rule, setup.cutter, contact, touch.feed).map(Some)
    };
    if let Some(first) = pass.first().copied().filter(|first| lead(first) < -LEAST_LEAN)
        && let Some(before) = further(&first, -first.feed)?
    {
        pass.insert(0, before);
    }
    if let Some(last) = pass.last().copied().filter(|last| lead(last) > LEAST_LEAN)
        && let Some(after) = further(&last, last.feed)?
    {
        pass.push(after);
    }
    Ok(pass)
}

/// Whether a place on the tangent plane of a contact lies beyond the border of the part.
fn is_beyond(point: &Point3, normal: &Vector3, setup: &Setup<'_>) -> bool {
    let foot = setup.part.closest_point(point).0;
    let aside = point - foot.point;
    let aside = aside - normal * aside.dot(normal);
    // On a bend of the part the foot lies below or above, not aside.
    let level = (point - foot.point).dot(normal).abs();
    foot.normal.dot(normal) > SAME_PLANE && aside.norm() > level.max(ON_PART * setup.cutter.radius())
}
