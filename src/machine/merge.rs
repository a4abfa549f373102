//! Lines that are shorter than the control takes are made one.
//!
//! Enters: a path, and how far the tool may stray from it. Leaves: the path with moves in a row made one
//! where each alone would last shorter than the control takes for a line. All tips that are left out lie
//! within the tolerance of the new move, in order along it. As the distance from a straight move is a convex
//! function, all of the way between them does so as well, and the new move lies as near to it. Axes that are
//! left out differ no more from one that turns evenly than moves the cutter's upper end by the tolerance.

use super::Machine;
use super::time::SECONDS_PER_MINUTE;
use motion::{ClPoint, Move, Toolpath};

/// How far the tool may stray from its path, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Straying {
    /// The tip, and what of the cutter is moved by its axis.
    pub tolerance: f64,
    /// From the tip to the cutter's upper end.
    pub length: f64,
}

/// The most moves that become one. More would take time in proportion where nothing moves.
const MOST: usize = 1000;

/// The path with short moves on the surface made one, and how many moves are left out.
pub fn merge_short_moves(path: &Toolpath, machine: &Machine, straying: &Straying) -> (Toolpath, usize) {
    let mut moves: Vec<Move> = Vec::with_capacity(path.len());
    let mut k = 0;
    while let Some(first) = path.moves.get(k) {
        let from = path.location_before(k);
        let shortest = first.feed_rate / SECONDS_PER_MINUTE / machine.block_rate;
        let mut end = k;
        while end + 1 - k < MOST {
            let (last, next) = (&path.moves[end], path.moves.get(end + 1));
            let short = (last.to.tip - from.tip).norm() < shortest;
            let goes_on = |next: &Move| {
                let same = (next.kind, next.pass, next.feed_rate) == (last.kind, last.pass, last.feed_rate);
                same && last.kind.is_on_surface() && straying.allows(&from, &path.moves[k..=end], &next.to)
            };
            if !(short && next.is_some_and(goes_on)) {
                break;
            }
            end += 1;
        }
        moves.push(path.moves[end]);
        k = end + 1;
    }
    let left_out = path.len() - moves.len();
    (Toolpath::new(path.start, moves), left_out)
}

impl Straying {
    /// Whether a move may take the place of others and of one more.
    fn allows(&self, from: &ClPoint, between: &[Move], to: &ClPoint) -> bool {
        let way = to.tip - from.tip;
        let length = way.norm();
        let mut reached = 0.0;
        length > 0.0
            && between.iter().all(|step| {
                let along = (step.to.tip - from.tip).dot(&way) / length;
                let share = along / length;
                if !(along >= reached && share <= 1.0) {
                    return false;
                }
                reached = along;
                let even = from.towards(to, share);
                let off = (step.to.tip - even.tip).norm() + self.length * (step.to.axis - even.axis).norm();
                off <= self.tolerance
            })
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixture::{machine, path, seconds};
    use super::*;
    use geometry::{Point3, Vector3};
    use motion::MoveKind;

    const MACHINE: Machine = machine(1e12);
    const STRAYING: Straying = Straying { tolerance: 1e-3, length: 30.0 };

    /// The distance of a place from a path.
    fn distance(path: &Toolpath, place: &Point3) -> f64 {
        let of_one = |(a, b, _): (Point3, Point3, &Move)| geometry::distance_to_segment(place, &a, &b);
        path.segments().map(of_one).fold(f64::INFINITY, f64::min)
    }

    /// Chords of 4 µm at 100 mm/s, of which the control takes 1000 a second.
    #[test]
    fn chords_shorter_than_the_control_takes_are_made_one_within_the_tolerance() {
        let angle = |k: u32| f64::from(k) * 1e-3;
        let arc = path((0..=3000).map(|k| [4.0 * angle(k).cos(), 4.0 * angle(k).sin(), 0.1 * angle(k)]));
        let slow = Machine { block_rate: 1000.0, ..MACHINE };
        let (merged, left_out) = merge_short_moves(&arc, &slow, &STRAYING);
        assert_eq!(merged.len() + left_out, arc.len());
        assert!(merged.len() < arc.len() / 20, "{}", merged.len());
        assert_eq!(merged.moves.last(), arc.moves.last());
        // Both ways, between the ends as well.
        let dense = |path: &Toolpath| -> Vec<Point3> {
            let inner = |(a, b, _): (Point3, Point3, &Move)| [0.25, 0.5, 0.75, 1.0].map(|s| a + (b - a) * s);
            path.segments().flat_map(inner).collect()
        };
        for (one, other) in [(&arc, &merged), (&merged, &arc)] {
            let worst = dense(one).iter().step_by(7).map(|at| distance(other, at)).fold(0.0, f64::max);
            assert!(worst <= 1e-3 + 1e-12, "{worst}");
        }
        let [before, after] = [&arc, &merged].map(|path| seconds(path, &slow));
        assert!(after < 0.1 * before, "{before} {after}");
        // A control that is quick enough gets the path as it is.
        assert_eq!(merge_short_moves(&arc, &MACHINE, &STRAYING), (arc, 0));
    }

    #[test]
    fn corners_turns_and_other_moves_stay() {
        let slow = Machine { block_rate: 10.0, ..MACHINE };
        let merged = |path: &Toolpath| merge_short_moves(path, &slow, &STRAYING).0.len();
        assert_eq!(merged(&path([[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [2.0, 1.0, 0.0]])), 3);
        assert_eq!(merged(&path([[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [3.0, 0.0, 0.0]])), 1);
        // Back along the same line is no way on.
        assert_eq!(merged(&path([[0.0; 3], [1.0, 0.0, 0.0], [0.5, 0.0, 0.0], [3.0, 0.0, 0.0]])), 3);
        let straight = path([[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]);
        let mut other = straight.clone();
        other.moves[1].kind = MoveKind::Rapid;
        assert_eq!(merged(&other), 2);
        (other.moves[1].kind, other.moves[1].feed_rate) = (MoveKind::Cut, 50.0);
        assert_eq!(merged(&other), 2);
        let mut turning = straight;
        turning.moves[0].to.axis = Vector3::new(1e-4, 0.0, 1.0).normalize();
        assert_eq!(merged(&turning), 2, "the upper end strays by 3 µm");
        turning.moves[0].to.axis = Vector3::new(1e-5, 0.0, 1.0).normalize();
        assert_eq!(merged(&turning), 1);
    }
}
