//! How fast the axis of a tool turns along its passes, and from pass to pass.
//!
//! Enters: the part, the cutter, the path. Leaves: the greatest turn of a cutting move over the way of its
//! contact on the part, and the greatest one between a contact and the nearest of a pass beside it over their
//! distance, rad a mm.

use cutter::Cutter;
use geometry::{Point3, Vector3, angle_between};
use motion::{MoveKind, PassStretches, Toolpath};
use part::Part;
use work::monitor::{self, Cancelled, Monitor};

use crate::contact::contact;

/// Axes that differ by less, rad, are the same to rounding.
const NO_TURN: f64 = 1e-9;

/// The fastest turn of a path's cutting moves, or between them.
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
        let turn = angle_between(&from.axis, &step.to.axis);
        if step.kind != MoveKind::Cut || turn <= NO_TURN {
            return Ok(None);
        }
        // On the cutter: past the part's border it goes on, where the nearest place of the part stands.
        let [a, b] = [from, step.to].map(|at| contact(part, cutter, &at).2);
        Ok(Some(FastestTurn { rate: turn / (b - a).norm(), move_index: k as u32, at: b }))
    })?;
    Ok(turns.into_iter().flatten().max_by(|a, b| a.rate.total_cmp(&b.rate)))
}

/// The fastest turn from pass to pass: between the end of a cutting move and the nearest place of each pass
/// beside it. Beside it are the passes up to twice as far off as the nearest, within a cutter's diameter.
/// `None` where no axis turns.
///
/// # Errors
/// [`Cancelled`] when the monitor says so.
///
/// # Tolerance
/// Exact to rounding for contacts that go straight along each move while the axis turns evenly.
pub fn fastest_turn_across(
    part: &Part,
    cutter: &Cutter,
    path: &Toolpath,
    monitor: &dyn Monitor,
) -> Result<Option<FastestTurn>, Cancelled> {
    let cuts: Vec<usize> = (0..path.len()).filter(|&k| path.moves[k].kind == MoveKind::Cut).collect();
    if cuts.iter().all(|&k| path.moves[k].pass == path.moves[cuts[0]].pass) {
        return Ok(None);
    }
    let stretches = work::parallel::try_map(cuts.len(), |i| {
        monitor::check(monitor)?;
        let k = cuts[i];
        let ends = [path.location_before(k), path.moves[k].to];
        let contacts = ends.map(|at| contact(part, cutter, &at).2);
        Ok::<_, Cancelled>(Stretch {
            contacts,
            axes: ends.map(|at| at.axis),
            pass: path.moves[k].pass,
            move_index: k as u32,
        })
    })?;
    let beside = PassStretches::new(stretches.iter().map(|one| (one.contacts, one.pass)).collect());
    let turns = work::parallel::try_map(stretches.len(), |k| {
        monitor::check(monitor)?;
        let Stretch { contacts: [_, at], axes: [_, axis], pass, move_index } = &stretches[k];
        let near = beside.beside(at, *pass, 2.0 * cutter.radius());
        let rates = near.iter().filter_map(|one| {
            let turn = angle_between(axis, &stretches[one.stretch as usize].axis_at(one.at));
            (turn > NO_TURN).then(|| turn / one.distance)
        });
        Ok(rates.max_by(f64::total_cmp).map(|rate| FastestTurn { rate, move_index: *move_index, at: *at }))
    })?;
    Ok(turns.into_iter().flatten().max_by(|a, b| a.rate.total_cmp(&b.rate)))
}

/// The contact's way along one cutting move.
struct Stretch {
    contacts: [Point3; 2],
    axes: [Vector3; 2],
    pass: u32,
    move_index: u32,
}

impl Stretch {
    fn axis_at(&self, share: f64) -> Vector3 {
        let [from, to] = self.axes;
        (from + (to - from) * share).try_normalize(1e-9).unwrap_or(to)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::TriangleMesh;
    use motion::{CcPoint, ClPoint, Move, location};
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
    /// Passes on a plate, each leaning more than the last: rates in closed form, and none where one pass
    /// stands alone.
    #[test]
    fn turns_from_pass_to_pass_are_told_by_the_distance_of_contacts() {
        let corners =
            [[0.0, 0.0, 0.0], [40.0, 0.0, 0.0], [40.0, 19.0, 0.0], [0.0, 19.0, 0.0]].map(Point3::from);
        let mesh = TriangleMesh::new(corners.to_vec(), vec![[0, 1, 2], [0, 2, 3]]).unwrap().0;
        let part = Part::from_mesh(mesh);
        let step = |to, pass| Move { to, kind: MoveKind::Cut, feed_rate: 1.0, pass };
        for cutter in [Cutter::ball(6.0).unwrap(), Cutter::bull(6.0, 1.0).unwrap()] {
            let at = |x: f64, pass: u32| {
                let lean = 0.02 * f64::from(pass * pass);
                let contact =
                    CcPoint { point: Point3::new(x, 2.0 + 0.4 * f64::from(pass), 0.0), normal: Vector3::z() };
                location(&cutter, &contact, &Vector3::new(lean.sin(), 0.0, lean.cos()))
            };
            // Ends of moves on one pass lie between those of the next.
            let ends = |pass: u32| (0..8).map(move |k| 5.0 + 1.7 * f64::from(k) + 0.8 * f64::from(pass % 2));
            let moves = |pass: u32| {
                let link = Move { kind: MoveKind::Link, ..step(at(ends(pass).next().unwrap(), pass), pass) };
                std::iter::once(link).chain(ends(pass).skip(1).map(move |x| step(at(x, pass), pass)))
            };
            let path = Toolpath::new(at(5.0, 0), (0..5).flat_map(moves).collect());
            let found = fastest_turn_across(&part, &cutter, &path, &Silent).unwrap().unwrap();
            // From the fourth to the fifth pass, and to the third and the fifth in twice that distance.
            let rate = 0.02 * (16.0 - 9.0) / 0.4;
            assert!((found.rate - rate).abs() < 1e-6 * rate, "{found:?}, not {rate}");
            assert!([3, 4].contains(&path.moves[found.move_index as usize].pass));
            let one = Toolpath::new(at(5.0, 3), moves(3).collect());
            assert_eq!(fastest_turn_across(&part, &cutter, &one, &Silent).unwrap(), None);
        }
    }
}
