//! Moves that go a little deeper beside places where an earlier plan left a little too much.
//!
//! What is cut deeper can only sink: no pass has to be placed anew, and no ridge rises elsewhere, as it may
//! when chords or levels change. Chords leave a share of their tolerance unused
//! ([`unused_tolerance`](crate::unused_tolerance)); no point goes deeper by more.
//!
//! Enters: passes as tips of an upright cutter, and places, each with the way that the moves that cut it are
//! to go. Leaves: the passes with the same points, some of them lower. A ridge sinks by as much as the moves
//! on both its sides.

use std::collections::HashMap;

use cutter::Cutter;
use geometry::{Point2, Point3, Vector3};
use motion::{ROUNDING, in_last_decimals};
use work::parallel;

/// A move cuts a place too where it leaves there no more than so many times the way that it is to go above
/// the place: on the other side of a ridge.
const BESIDE: f64 = 2.0;

/// The steepest ground whose normal tells how much lower a way leads.
const LEAST_UPRIGHT: f64 = 0.05;

/// Cells of the plan view along a radius of the cutter, by which places are found that a move may cut.
const CELLS_A_RADIUS: f64 = 4.0;

/// A place where moves are to go deeper.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lowered {
    /// The top of what stands there.
    pub top: Point3,
    /// Which way the moves that left it go, mm: against the part's normal.
    pub by: Vector3,
}

/// The passes of a cutter after rounds of places, one after the other. No point goes farther than `most` mm
/// in all.
pub(crate) fn lowered(
    passes: &[Vec<Point3>],
    cutter: &Cutter,
    rounds: &[Vec<Lowered>],
    most: f64,
) -> Vec<Vec<Point3>> {
    let rounds: Vec<Places> = rounds.iter().map(|places| Places::new(places, cutter)).collect();
    parallel::map(passes.len(), |k| {
        let (before, mut now) = (&passes[k], passes[k].clone());
        for places in &rounds {
            let ways = places.ways(&now);
            for ((point, before), way) in now.iter_mut().zip(before).zip(ways) {
                let deeper = moved(*point, &way);
                if (deeper - before).norm() <= most {
                    *point = deeper;
                }
            }
        }
        now
    })
}

/// A point as a program writes it, moved by a way and a little on, to the nearest place that a program can
/// write.
fn moved(point: Point3, way: &Vector3) -> Point3 {
    const LAST: f64 = 2.0 * ROUNDING;
    let square = way.norm_squared();
    if square == 0.0 {
        return point;
    }
    let written = point.coords.map(in_last_decimals);
    let aim = written + way / LAST;
    let corner = |k: usize| {
        let up = Vector3::new((k & 1) as f64, (k >> 1 & 1) as f64, (k >> 2) as f64);
        aim.map(f64::floor) + up - written
    };
    let far_enough = |by: &Vector3| by.dot(way) * LAST >= (1.0 - 1e-9) * square;
    let nearest =
        (0..8).map(corner).filter(far_enough).min_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared()));
    nearest.map_or(point, |by| Point3::from((written + by) * LAST))
}

/// Places by the cells of the plan view from which a cutter reaches them.
struct Places<'a> {
    places: &'a [Lowered],
    cutter: &'a Cutter,
    around: HashMap<[i64; 2], Vec<usize>>,
}

impl<'a> Places<'a> {
    fn new(places: &'a [Lowered], cutter: &'a Cutter) -> Self {
        let mut found = Self { places, cutter, around: HashMap::new() };
        for (k, place) in places.iter().enumerate() {
            let [x, y] = found.cell(&place.top);
            let far = CELLS_A_RADIUS as i64 + 1;
            for (dx, dy) in (-far..=far).flat_map(|dx| (-far..=far).map(move |dy| (dx, dy))) {
                found.around.entry([x + dx, y + dy]).or_default().push(k);
            }
        }
        found
    }

    /// A move is looked at in steps of a cell: half of one lies between a place within a radius and the next
    /// step.
    fn cell(&self, p: &Point3) -> [i64; 2] {
        [p.x, p.y].map(|x| (x * CELLS_A_RADIUS / self.cutter.radius()).floor() as i64)
    }

    /// For each point of a pass the longest way that a place asks of the moves at it.
    fn ways(&self, pass: &[Point3]) -> Vec<Vector3> {
        let mut ways = vec![Vector3::zeros(); pass.len()];
        for (k, ends) in pass.windows(2).enumerate() {
            let way = ends[1] - ends[0];
            let steps = (way.xy().norm() * CELLS_A_RADIUS / self.cutter.radius()).ceil().max(1.0) as usize;
            let mut cells: Vec<[i64; 2]> =
                (0..=steps).map(|step| self.cell(&(ends[0] + way * (step as f64 / steps as f64)))).collect();
            cells.dedup();
            for &place in cells.iter().filter_map(|cell| self.around.get(cell)).flatten() {
                let Lowered { top, by } = self.places[place];
                let is_longer = |of: &Vector3| by.norm_squared() > of.norm_squared();
                if !ways[k..=k + 1].iter().any(is_longer) {
                    continue;
                }
                let length = by.norm();
                let lower = length * length / by.z.abs().max(LEAST_UPRIGHT * length);
                let most = top.z + BESIDE * lower;
                if left_over(self.cutter, [&ends[0], &ends[1]], &top.xy(), most) <= most {
                    ways[k..=k + 1].iter_mut().filter(|of| is_longer(of)).for_each(|of| *of = by);
                }
            }
        }
        ways
    }
}

/// The height that a cutter leaves over a place on a straight move, mm; infinite where it does not come over
/// it, or where that is surely more than `most`.
fn left_over(cutter: &Cutter, [a, b]: [&Point3; 2], place: &Point2, most: f64) -> f64 {
    let (low, high) = if a.z <= b.z { (a, b) } else { (b, a) };
    let (way, to) = ((high - low).xy(), place - low.xy());
    let length = way.norm();
    // How far along the climb the axis stands where the cutter is lowest over the place: of a convex function
    // the nearest end is the least.
    let (at, along, across) = if length > 0.0 {
        let (along, across) = (to.dot(&way) / length, to.perp(&way).abs() / length);
        // It is no lower beside the axis than abeam of it, and a convex function lies above its tangent in
        // the middle of the move.
        let abeam = cutter.height(across).map(|height| low.z + height);
        if abeam.is_none_or(|abeam| abeam.max(least_by_tangent(cutter, [low, high], place)) > most) {
            return f64::INFINITY;
        }
        let ahead = cutter.profile().ahead((high.z - low.z) / length, across).0;
        ((along - ahead).clamp(0.0, length), along, across)
    } else {
        (0.0, 0.0, to.norm())
    };
    let climbed = if length > 0.0 { (high.z - low.z) * at / length } else { 0.0 };
    cutter.height((along - at).hypot(across)).map_or(f64::INFINITY, |height| low.z + climbed + height)
}

/// A height, mm, that what a cutter leaves over a place is no less than anywhere on a move with a length in
/// the plan view.
fn least_by_tangent(cutter: &Cutter, [low, high]: [&Point3; 2], place: &Point2) -> f64 {
    let way = high - low;
    let middle = low + 0.5 * way;
    let off = middle.xy() - place;
    let rho = off.norm();
    let Some(height) = cutter.height(rho) else { return f64::NEG_INFINITY };
    let incline = cutter.profile().incline(rho);
    let rise = if rho > 0.0 { incline.sin / incline.cos * off.dot(&way.xy()) / rho } else { 0.0 };
    middle.z + height - 0.5 * (way.z + rise).abs()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Passes along x, 1 mm apart, with points 2 mm apart.
    fn passes() -> Vec<Vec<Point3>> {
        let line = |y: usize| (0..=20).map(|k| Point3::new(2.0 * f64::from(k), y as f64, 0.0)).collect();
        (0..10).map(line).collect()
    }

    /// Pass, x and depth, in last decimals, of all points that went deeper.
    fn depths(passes: &[Vec<Point3>]) -> Vec<(usize, f64, f64)> {
        let all = passes.iter().enumerate().flat_map(|(y, pass)| pass.iter().map(move |p| (y, p)));
        all.filter(|(_, p)| p.z != 0.0).map(|(y, p)| (y, p.x, (-1e4 * p.z).round())).collect()
    }

    #[test]
    fn the_moves_on_both_sides_of_a_ridge_go_deeper_and_no_others() {
        for cutter in [Cutter::ball(6.0), Cutter::bull(6.0, 1.0)].map(Result::unwrap) {
            let [half, aside] = [0.5, 0.4].map(|off| cutter.height(off + cutter.flat_radius()).unwrap());
            let place = |x: f64, y: f64, z: f64, by: f64| Lowered {
                top: Point3::new(x, y, z),
                by: Vector3::new(0.0, 0.0, -by),
            };
            let far = cutter.flat_radius();
            // Beside the last pass, and far away from all.
            let places = vec![place(7.0, 9.4 + far, aside, 1e-4), place(7.0, 80.0, half, 2e-4)];
            let lower = |rounds: &[Vec<Lowered>]| lowered(&passes(), &cutter, rounds, 5e-4);
            let of_last = |depth: f64| vec![(9, 6.0, depth), (9, 8.0, depth)];
            assert_eq!(depths(&lower(std::slice::from_ref(&places))), of_last(1.0));
            assert_eq!(depths(&lower(&[places.clone(), places.clone()])), of_last(2.0));
            // What would be too deep is left as it is.
            let deep = vec![place(7.0, 9.4 + far, aside, 4.5e-4)];
            assert_eq!(depths(&lower(&[places, deep])), of_last(1.0));
            assert_eq!(lower(&[]), passes());
            if cutter.is_ball() {
                let ridge = vec![place(21.0, 4.5, half, 3e-4)];
                let wanted = [(4, 20.0, 3.0), (4, 22.0, 3.0), (5, 20.0, 3.0), (5, 22.0, 3.0)];
                assert_eq!(depths(&lower(&[ridge])), wanted);
            }
        }
    }

    /// Against the least of many places along the move.
    #[test]
    fn what_a_move_leaves_over_a_place_is_that_of_brute_force() {
        let cutters = [Cutter::ball(6.0), Cutter::bull(6.0, 1.0), Cutter::flat(6.0)].map(Result::unwrap);
        for (k, cutter) in cutters.iter().cycle().enumerate().skip(1).take(300) {
            let [a, b, c, d] = [0.7, 1.3, 2.1, 3.7].map(|step| (step * k as f64).sin());
            let (from, to) = (Point3::new(2.0 * a, b, 0.0), Point3::new(2.0 * b, 2.0 * c, 2.0 * d));
            let place = Point2::new(1.5 * d, 1.5 * a);
            let over = |t: f64| {
                let at = from + (to - from) * t;
                cutter.height((at.xy() - place).norm()).map_or(f64::INFINITY, |height| at.z + height)
            };
            let least = (0..=100_000).map(|k| over(1e-5 * f64::from(k))).fold(f64::INFINITY, f64::min);
            let found = left_over(cutter, [&from, &to], &place, f64::INFINITY);
            assert!(found == least || (found - least).abs() < 1e-4, "{k}: {found} {least}");
            // Nothing is left out that leaves no more than is asked for.
            assert_eq!(left_over(cutter, [&from, &to], &place, least + 1e-4), found);
            assert_eq!(left_over(cutter, [&from, &to], &place, f64::NEG_INFINITY), f64::INFINITY);
        }
    }

    /// What is written is rounded; it goes as deep as asked all the same, and hardly deeper.
    #[test]
    fn what_is_written_goes_as_deep_as_asked_along_every_normal() {
        for k in 0..200 {
            let [a, b] = [0.37, 0.61].map(|step| step * f64::from(k));
            let normal = Vector3::new(a.sin() * b.cos(), a.sin() * b.sin(), a.cos());
            let (point, depth) = (Point3::new(1.234_56 + a, 0.3 * b, 7.0 - a), 2.3e-5 * f64::from(1 + k % 9));
            let way = normal * -depth;
            let by = moved(point, &way) - point.coords.map(|x| in_last_decimals(x) * 1e-4);
            let deeper = -by.coords.dot(&normal);
            assert!(deeper >= depth - 1e-12 && deeper <= depth + 1.8e-4, "{k}: {deeper} for {depth}");
        }
        assert_eq!(moved(Point3::origin(), &Vector3::zeros()), Point3::origin());
    }
}
