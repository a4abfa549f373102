//! Feed directions are lines, not arrows: `t` and `−t` are the same pass. Before a stream function
//! can be fitted, neighbours must point the same way.

use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::f64::consts::TAU;

use geometry::Vector3;

/// A candidate for orientation: how surely it follows its already oriented neighbour.
struct Candidate {
    agreement: f64,
    at: usize,
    from: usize,
}

impl PartialEq for Candidate {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Candidate {}

impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Candidate {
    fn cmp(&self, other: &Self) -> Ordering {
        self.agreement
            .total_cmp(&other.agreement)
            .then(other.at.cmp(&self.at))
            .then(other.from.cmp(&self.from))
    }
}

/// Turns the line directions of a grid `[nv][nu]` so that neighbours point the same way, surest
/// pairs first (a greatest spanning tree over `|t_i · t_j|` times the lesser confidence). Returns
/// the share of neighbouring pairs that still disagree: above 0 the field has singular points of
/// half-integer index, where no orientation exists.
///
/// `lines` holds unit tangents and a confidence ≥ 0; `None` where there is no direction.
pub fn orient(lines: &mut [Option<(Vector3, f64)>], nu: usize) -> f64 {
    let nv = lines.len().checked_div(nu).unwrap_or(0);
    orient_along(lines, |k| neighbours(k, nu, nv), |_, _, line| *line);
    disagreement(lines, nu, nv)
}

/// As [`orient`], on any graph: `neighbours` of a sample, and the line of one sample carried to a
/// neighbour, where the two can be compared.
pub(super) fn orient_along<N: Iterator<Item = usize>>(
    lines: &mut [Option<(Vector3, f64)>],
    neighbours: impl Fn(usize) -> N,
    carried: impl Fn(usize, usize, &Vector3) -> Vector3,
) {
    let mut oriented = vec![false; lines.len()];
    let mut heap = BinaryHeap::new();
    // The surest sample of each connected piece keeps its direction.
    let mut seeds: Vec<usize> = (0..lines.len()).filter(|&k| lines[k].is_some()).collect();
    let confidence = |l: &Option<(Vector3, f64)>| l.map_or(0.0, |(_, c)| c);
    seeds.sort_by(|&a, &b| confidence(&lines[b]).total_cmp(&confidence(&lines[a])).then(a.cmp(&b)));
    for seed in seeds {
        if oriented[seed] {
            continue;
        }
        heap.push(Candidate { agreement: f64::INFINITY, at: seed, from: seed });
        while let Some(Candidate { at, from, .. }) = heap.pop() {
            if oriented[at] {
                continue;
            }
            oriented[at] = true;
            let (Some((reference, _)), Some((line, sure))) = (lines[from], lines[at]) else { continue };
            let turned = carried(from, at, &reference).dot(&line) < 0.0;
            let line = if turned { -line } else { line };
            lines[at] = Some((line, sure));
            for next in neighbours(at) {
                if let (false, Some((other, other_sure))) = (oriented[next], lines[next]) {
                    let agreement = carried(at, next, &line).dot(&other).abs() * sure.min(other_sure);
                    heap.push(Candidate { agreement, at: next, from: at });
                }
            }
        }
    }
}

/// The squares of a grid `[n][n]` of lines around which the field turns: their corners and the number of half
/// turns, counter-clockwise. `lines` are tangents in a frame that turns little from place to place; where one
/// is missing nothing is found. More than one half turn may be found in several squares side by side.
pub fn grid_turns(lines: &[Option<[f64; 2]>], n: usize) -> Vec<([usize; 4], i32)> {
    let double = |k: usize| lines.get(k).copied().flatten().map(|[x, y]| 2.0 * y.atan2(x));
    let turn = |corners: [usize; 4]| {
        let mut sum = 0.0;
        for k in 0..4 {
            let d = double(corners[(k + 1) % 4])? - double(corners[k])?;
            sum += d - TAU * (d / TAU).round();
        }
        let half_turns = (sum / TAU).round() as i32;
        (half_turns != 0).then_some((corners, half_turns))
    };
    let squares = (0..n.saturating_sub(1)).flat_map(|j| (0..n - 1).map(move |i| j * n + i));
    squares.filter_map(|k| turn([k, k + 1, k + 1 + n, k + n])).collect()
}

fn neighbours(k: usize, nu: usize, nv: usize) -> impl Iterator<Item = usize> {
    let (i, j) = (k % nu, k / nu);
    let left = (i > 0).then(|| k - 1);
    let right = (i + 1 < nu).then(|| k + 1);
    let below = (j > 0).then(|| k - nu);
    let above = (j + 1 < nv).then(|| k + nu);
    [left, right, below, above].into_iter().flatten()
}

fn disagreement(lines: &[Option<(Vector3, f64)>], nu: usize, nv: usize) -> f64 {
    let (mut pairs, mut against) = (0usize, 0usize);
    for (k, line) in lines.iter().enumerate() {
        for other in neighbours(k, nu, nv).filter(|&o| o > k) {
            if let (Some((a, _)), Some((b, _))) = (line, &lines[other]) {
                pairs += 1;
                against += usize::from(a.dot(b) < 0.0);
            }
        }
    }
    if pairs == 0 { 0.0 } else { against as f64 / pairs as f64 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(n: usize, angle: impl Fn(f64, f64) -> f64) -> Vec<Option<(Vector3, f64)>> {
        (0..n * n)
            .map(|k| {
                let (x, y) = ((k % n) as f64 - 0.5 * n as f64 + 0.3, (k / n) as f64 - 0.5 * n as f64 + 0.4);
                let a = angle(x, y);
                // Every other sample is turned round: the same line.
                let sign = if (k * 7919) % 3 == 0 { -1.0 } else { 1.0 };
                Some((Vector3::new(a.cos(), a.sin(), 0.0) * sign, 1.0))
            })
            .collect()
    }

    #[test]
    fn shuffled_signs_of_a_smooth_field_are_set_right() {
        let mut lines = grid(20, |x, y| 0.05 * x + 0.03 * y);
        assert!(disagreement(&lines, 20, 20) > 0.2);
        assert_eq!(orient(&mut lines, 20), 0.0);
    }

    #[test]
    fn a_half_integer_singularity_cannot_be_oriented_and_is_told() {
        let mut lines = grid(20, |x, y| 0.5 * y.atan2(x));
        let left = orient(&mut lines, 20);
        assert!(left > 0.0 && left < 0.05, "{left}");
    }

    #[test]
    fn the_index_of_a_point_is_counted_in_half_turns() {
        for half_turns in [-3, -2, -1, 1, 2, 3] {
            let lines = grid(20, |x, y| 0.5 * f64::from(half_turns) * y.atan2(x));
            let lines: Vec<_> = lines.iter().map(|l| l.map(|(t, _)| [t.x, t.y])).collect();
            let found = grid_turns(&lines, 20);
            assert_eq!(found.iter().map(|f| f.1).sum::<i32>(), half_turns, "{found:?}");
            // Places are (k − 9.7, l − 9.6). More than a half turn is more than four places can tell, and is
            // found in several squares side by side.
            let near = |k: &usize| (8..=11).contains(&(k % 20)) && (8..=11).contains(&(k / 20));
            assert!(found.iter().all(|f| f.0.iter().all(near)), "{found:?}");
        }
        assert!(grid_turns(&[], 0).is_empty() && grid_turns(&[None; 9], 3).is_empty());
    }

    #[test]
    fn holes_and_empty_grids_are_no_trouble() {
        let mut lines = grid(10, |_, _| 0.4);
        for k in 40..50 {
            lines[k] = None;
        }
        assert_eq!(orient(&mut lines, 10), 0.0);
        assert_eq!(orient(&mut [], 10), 0.0);
        assert_eq!(orient(&mut [], 0), 0.0);
    }
}
