//! Moves that go a little deeper beside places where an earlier plan left a little too much.
//!
//! What is cut deeper can only sink: no pass has to be placed anew, and no ridge rises elsewhere, as it may when chords or levels
//! change. Chords leave a share of their tolerance unused ([`unused`](crate::vocabulary::unused_tolerance)); no point goes deeper by more.
//!
//! Enters: passes as tips of the cutter, and places, each with the way that the moves beside it are to go. Leaves: the passes with
//! the same points, some of them lower. A ridge sinks by as much as the moves on both its sides.

use std::collections::HashMap;

use geometry::{Point3, Vector3, distance_to_segment};
use motion::{ROUNDING, in_last_decimals};

/// Moves serve a place that are no farther from it than so many times the nearest one: a ridge is left by moves equally far away.
const BESIDE: f64 = 1.5;

/// Two moves that meet are as near where their distances differ by less than this factor.
const ALIKE: f64 = 1.001;

/// How often the distance is doubled within which moves are sought.
const DOUBLINGS: usize = 5;

/// A place beside which moves are to go deeper.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lowered {
    /// The tip of an upright cutter that touches the part there.
    pub tip: Point3,
    /// Which way the moves beside it go, mm: against the part's normal.
    pub by: Vector3,
}

/// The passes after rounds of places, one after the other. Moves beside a place are about `reach` mm away; no point goes farther
/// than `most` mm in all.
pub(crate) fn lowered(
    passes: &[Vec<Point3>],
    rounds: &[Vec<Lowered>],
    reach: f64,
    most: f64,
) -> Vec<Vec<Point3>> {
    let mut now = passes.to_vec();
    for places in rounds {
        let deeper = ways(&now, places, reach);
        for ((pass, before), ways) in now.iter_mut().zip(passes).zip(&deeper) {
            for ((point, before), way) in pass.iter_mut().zip(before).zip(ways) {
                let deeper = moved(*point, way);
                if (deeper - before).norm() <= most {
                    *point = deeper;
                }
            }
        }
    }
    now
}

/// A point as a program writes it, moved by a way and a little on, to the nearest place that a program can write.
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

/// For each point of each pass the longest way that a place asks of the moves at it.
fn ways(passes: &[Vec<Point3>], places: &[Lowered], reach: f64) -> Vec<Vec<Vector3>> {
    let mut ways: Vec<Vec<Vector3>> = passes.iter().map(|pass| vec![Vector3::zeros(); pass.len()]).collect();
    let mut waiting = places.to_vec();
    let mut reach = reach;
    for _ in 0..=DOUBLINGS {
        let near = moves_near(passes, &waiting, reach);
        let mut left = Vec::new();
        for (place, moves) in waiting.into_iter().zip(near) {
            let nearest = moves.iter().map(|(distance, ..)| *distance).fold(f64::INFINITY, f64::min);
            // Farther moves were not sought.
            if BESIDE * nearest > reach {
                left.push(place);
                continue;
            }
            let beside: Vec<_> = moves.into_iter().filter(|near| near.0 <= BESIDE * nearest).collect();
            // Of moves one after the other the nearest one cuts the place.
            for run in beside.chunk_by(|a, b| (a.1, a.2 + 1) == (b.1, b.2)) {
                let nearest = run.iter().map(|(distance, ..)| *distance).fold(f64::INFINITY, f64::min);
                for &(_, pass, k) in run.iter().filter(|near| near.0 <= ALIKE * nearest) {
                    for way in &mut ways[pass][k..=k + 1] {
                        if place.by.norm_squared() > way.norm_squared() {
                            *way = place.by;
                        }
                    }
                }
            }
        }
        waiting = left;
        reach *= 2.0;
    }
    ways
}

/// For each place the distance, the pass and the first point of all moves within `reach` mm, at least; in the order of passes.
fn moves_near(passes: &[Vec<Point3>], places: &[Lowered], reach: f64) -> Vec<Vec<(f64, usize, usize)>> {
    let cell = |p: &Point3| [p.x, p.y].map(|x| (x / reach).floor() as i64);
    let mut around: HashMap<[i64; 2], Vec<usize>> = HashMap::new();
    for (k, place) in places.iter().enumerate() {
        let [x, y] = cell(&place.tip);
        for (dx, dy) in (-2..=2).flat_map(|dx| (-2..=2).map(move |dy| (dx, dy))) {
            around.entry([x + dx, y + dy]).or_default().push(k);
        }
    }
    let mut near = vec![Vec::new(); places.len()];
    for (of, pass) in passes.iter().enumerate() {
        for (k, ends) in pass.windows(2).enumerate() {
            let way = ends[1] - ends[0];
            let steps = (way.xy().norm() / reach).ceil().max(1.0) as usize;
            let mut asked: Vec<usize> = (0..=steps)
                .filter_map(|step| around.get(&cell(&(ends[0] + way * (step as f64 / steps as f64)))))
                .flatten()
                .copied()
                .collect();
            asked.sort_unstable();
            asked.dedup();
            for place in asked {
                near[place].push((distance_to_segment(&places[place].tip, &ends[0], &ends[1]), of, k));
            }
        }
    }
    near
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Passes along x, 1 mm apart, with points 2 mm apart.
    fn passes() -> Vec<Vec<Point3>> {
        let line = |y: usize| (0..=20).map(|k| Point3::new(2.0 * f64::from(k), y as f64, 0.0)).collect();
        (0..10).map(line).collect()
    }

    fn place(x: f64, y: f64, by: f64) -> Lowered {
        Lowered { tip: Point3::new(x, y, 0.0), by: Vector3::new(0.0, 0.0, -by) }
    }

    /// Pass, x and depth, in last decimals, of all points that went deeper.
    fn depths(passes: &[Vec<Point3>]) -> Vec<(usize, f64, f64)> {
        let all = passes.iter().enumerate().flat_map(|(y, pass)| pass.iter().map(move |p| (y, p)));
        all.filter(|(_, p)| p.z != 0.0).map(|(y, p)| (y, p.x, (-1e4 * p.z).round())).collect()
    }

    #[test]
    fn the_moves_on_both_sides_of_a_ridge_go_deeper_and_no_others() {
        // Between two passes, beside the last one, and far away from all.
        let places = vec![place(20.5, 4.5, 3e-4), place(7.0, 9.4, 1e-4), place(7.0, 80.0, 2e-4)];
        let lower = |rounds: &[Vec<Lowered>]| lowered(&passes(), rounds, 0.6, 5e-4);
        let of_ridge = |depth: f64| [(4, 20.0), (4, 22.0), (5, 20.0), (5, 22.0)].map(|(y, x)| (y, x, depth));
        let of_last = |depth: f64| [(9, 6.0, depth), (9, 8.0, depth)];
        let once = lower(std::slice::from_ref(&places));
        assert_eq!(depths(&once), [&of_ridge(3.0)[..], &of_last(1.0)].concat());
        // Once more beside the last pass; beside the ridge that would be too deep.
        let twice = lower(&[places.clone(), places]);
        assert_eq!(depths(&twice), [&of_ridge(3.0)[..], &of_last(2.0)].concat());
        assert_eq!(lower(&[]), passes());
        assert!(lowered(&[], &[vec![place(0.0, 0.0, 1e-4)]], 0.6, 1.0).is_empty());
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
