//! How fast the axis of a tool turns along its passes.
//!
//! Enters: the part, the cutter, the path. Leaves: the greatest turn of a cutting move over the way of its contact on the
//! part, rad a mm. The contact is found from part, cutter and location alone.

use cutter::Cutter;
use geometry::Point3;
use motion::{ClPoint, MoveKind, Toolpath};
use part::{Part, SurfacePoint};
use work::monitor::{self, Cancelled, Monitor};

/// Rounds in which the place where a tilted cutter touches is found: each takes the normal of the one before.
const CONTACT_ROUNDS: usize = 4;

/// Axes that differ by less, rad, are the same to rounding.
const NO_TURN: f64 = 1e-9;

/// The place of the part that a cutter touches, or comes nearest to, how far it is off, and where on the cutter that is.
pub(super) fn contact(part: &Part, cutter: &Cutter, at: &ClPoint) -> (SurfacePoint, f64, Point3) {
    let mut foot = part.closest_point(&(at.tip + at.axis * cutter.profile().centre_z)).0;
    let (mut off, mut contact) = (f64::INFINITY, at.tip);
    for _ in 0..CONTACT_ROUNDS {
        contact = at.tip - cutter.contact_to_tip_along(&foot.normal, &at.axis);
        (foot, off) = part.closest_point(&contact);
    }
    (foot, off, contact)
}

/// The fastest turn of a path's cutting moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FastestTurn {
    /// rad a mm of contact; infinite where the axis turns and the contact stands.
    pub rate: f64,
    /// The move.
    pub move_index: u32,
    /// Where its contact ends.
    pub at: Point3,
}

/// The fastest turn along passes; `None` where no axis turns.
///
/// # Errors
/// [`Cancelled`] when the monitor says so.
///
/// # Tolerance
/// Turn and contacts are exact to rounding at the ends of the moves; between them the axis turns evenly.
pub fn fastest_turn(
    part: &Part,
    cutter: &Cutter,
    path: &Toolpath,
    monitor: &dyn Monitor,
) -> Result<Option<FastestTurn>, Cancelled> {
    let turns = work::parallel::try_map(path.len(), |k| {
        monitor::check(monitor)?;
        let (from, step) = (path.location_before(k), &path.moves[k]);
        let turn = from.axis.cross(&step.to.axis).norm().atan2(from.axis.dot(&step.to.axis));
        if step.kind != MoveKind::Cut || turn <= NO_TURN {
            return Ok(None);
        }
        // On the cutter: past the part's border it goes on, where the nearest place of the part stands.
        let [a, b] = [from, step.to].map(|at| contact(part, cutter, &at).2);
        Ok(Some(FastestTurn { rate: turn / (b - a).norm(), move_index: k as u32, at: b }))
    })?;
    Ok(turns.into_iter().flatten().max_by(|a, b| a.rate.total_cmp(&b.rate)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::{TriangleMesh, Vector3};
    use motion::{CcPoint, Move, location};
    use work::monitor::Silent;

    /// On a plate, contacts 0.5 mm apart, the axis leaning by so much more each time.
    #[test]
    fn turns_are_told_by_the_way_of_the_contact() {
        let corners =
            [[0.0, 0.0, 0.0], [40.0, 0.0, 0.0], [40.0, 9.0, 0.0], [0.0, 9.0, 0.0]].map(Point3::from);
        let mesh = TriangleMesh::new(corners.to_vec(), vec![[0, 1, 2], [0, 2, 3]]).unwrap().0;
        let part = Part::from_mesh(mesh);
        for cutter in [Cutter::ball(6.0).unwrap(), Cutter::bull(6.0, 1.0).unwrap()] {
            let at = |k: usize| {
                let lean: f64 = 0.1 + 0.01 * k as f64 + if k > 4 { 0.02 } else { 0.0 };
                let contact =
                    CcPoint { point: Point3::new(5.0 + 0.5 * k as f64, 4.0, 0.0), normal: Vector3::z() };
                location(&cutter, &contact, &Vector3::new(lean.sin(), 0.0, lean.cos()))
            };
            let step = |k| Move { to: at(k), kind: MoveKind::Cut, feed_rate: 1.0, pass: 0 };
            let path = Toolpath::new(at(0), (1..10).map(step).collect());
            let found = fastest_turn(&part, &cutter, &path, &Silent).unwrap().unwrap();
            assert!((found.rate - 0.06).abs() < 1e-9, "{found:?}");
            assert_eq!(found.move_index, 4);
            let upright =
                Toolpath::new(at(0), vec![Move { to: ClPoint { axis: at(0).axis, ..at(1) }, ..step(1) }]);
            assert_eq!(fastest_turn(&part, &cutter, &upright, &Silent).unwrap(), None);
        }
    }
}
