//! Moves one unknown at a time, the worst first; points stay within their caps.
//!
//! An unknown is a point or a control point. All that is asked about the curve are the jumps of its third
//! derivative, which are linear in the points (parameters stay), so that a move changes those near it by
//! known amounts.

use geometry::{CubicSpline, Point2, SplineError, Vector2};

/// Points to each side of a moved one within which it is felt: jumps further away change by (2 − √3)²⁰ of it
/// where points lie evenly, and 2⁻²⁰ at most. The interpolation after each round brings back what is left
/// out.
const REACH: usize = 20;

/// Changes smaller than this share of the greatest are left out likewise.
const LEAST_CHANGE: f64 = 1e-8;

/// Rounding of a cap, as a share.
const ROUNDING: f64 = 1e-12;

/// What can move, and what its move by 1 mm does.
pub(super) struct Unknown {
    /// Points that it moves, and by what share.
    pub points: Vec<(usize, f64)>,
    /// Points whose jumps it changes, and by how much.
    pub jumps: Vec<(usize, f64)>,
    /// The move that it wants is minus the sum of these points' jumps, each times its factor.
    pub wish: Vec<(usize, f64)>,
    /// What a mm of its move is worth; the greatest worth moves first.
    pub worth: f64,
}

/// Unknowns with the caps of the points.
pub(super) struct Relaxation {
    unknowns: Vec<Unknown>,
    /// For each unknown those whose wishes or whose room change with its move.
    listeners: Vec<Vec<usize>>,
    cap: f64,
}

/// Displacements of points from their first places, and the jumps there.
pub(super) struct State {
    pub displacements: Vec<Vector2>,
    pub jumps: Vec<Vector2>,
}

impl Relaxation {
    /// Of a spline with `count` points, each of which may go `cap`, mm.
    pub fn new(unknowns: Vec<Unknown>, count: usize, cap: f64) -> Self {
        let (mut by_jump, mut by_point) = (vec![Vec::new(); count], vec![Vec::new(); count]);
        for (k, unknown) in unknowns.iter().enumerate() {
            unknown.wish.iter().for_each(|(point, _)| by_jump[*point].push(k));
            unknown.points.iter().for_each(|(point, _)| by_point[*point].push(k));
        }
        let heard = |unknown: &Unknown| {
            let jumps = unknown.jumps.iter().flat_map(|(point, _)| &by_jump[*point]);
            let points = unknown.points.iter().flat_map(|(point, _)| &by_point[*point]);
            let mut heard: Vec<usize> = jumps.chain(points).copied().collect();
            heard.sort_unstable();
            heard.dedup();
            heard
        };
        let listeners = unknowns.iter().map(heard).collect();
        // Half a rounding less, so that no displacement is ever above the cap itself.
        Self { unknowns, listeners, cap: cap * (1.0 - 2.0 * ROUNDING) }
    }

    pub fn is_empty(&self) -> bool {
        self.unknowns.is_empty()
    }

    /// As many moves of the worst unknown as there are unknowns; returns how many there were until none could
    /// move.
    pub fn round(&self, state: &mut State) -> usize {
        let mut ranking = Ranking::new((0..self.unknowns.len()).map(|k| self.wish(state, k).1));
        for done in 0..self.unknowns.len() {
            let worst = ranking.first();
            let (step, worth) = self.wish(state, worst);
            if worth <= 0.0 {
                return done;
            }
            let unknown = &self.unknowns[worst];
            unknown.points.iter().for_each(|(point, share)| state.displacements[*point] += step * *share);
            unknown.jumps.iter().for_each(|(point, change)| state.jumps[*point] += step * *change);
            for k in &self.listeners[worst] {
                ranking.set(*k, self.wish(state, *k).1);
            }
        }
        self.unknowns.len()
    }

    /// The move that an unknown wants and its caps allow, and its worth.
    fn wish(&self, state: &State, k: usize) -> (Vector2, f64) {
        let unknown = &self.unknowns[k];
        let wish = unknown
            .wish
            .iter()
            .fold(Vector2::zeros(), |sum, (point, factor)| sum - state.jumps[*point] * *factor);
        // A point is off by d + share · move: the moves that it allows lie in a disc around −d / share.
        let disc = |(point, share): &(usize, f64)| (state.displacements[*point] / -*share, self.cap / *share);
        let step = nearest_in_discs(wish, unknown.points.iter().map(disc));
        (step, unknown.worth * step.norm())
    }
}

/// Which of many values is greatest, in a time that hardly grows with their number: a tree of maxima, node
/// `i` over nodes `2 i` and `2 i + 1`, the values as its leaves.
struct Ranking {
    tree: Vec<f64>,
}

impl Ranking {
    /// Of values of at least 0.
    fn new(values: impl ExactSizeIterator<Item = f64>) -> Self {
        let leaves = values.len().next_power_of_two();
        let mut tree = vec![0.0; leaves];
        tree.extend(values);
        tree.resize(2 * leaves, 0.0);
        for node in (1..leaves).rev() {
            tree[node] = tree[2 * node].max(tree[2 * node + 1]);
        }
        Self { tree }
    }

    /// The first of the greatest.
    fn first(&self) -> usize {
        let leaves = self.tree.len() / 2;
        let mut node = 1;
        while node < leaves {
            node = if self.tree[2 * node] >= self.tree[2 * node + 1] { 2 * node } else { 2 * node + 1 };
        }
        node - leaves
    }

    fn set(&mut self, k: usize, value: f64) {
        let mut node = self.tree.len() / 2 + k;
        self.tree[node] = value;
        while node > 1 {
            node /= 2;
            let greatest = self.tree[2 * node].max(self.tree[2 * node + 1]);
            if self.tree[node] == greatest {
                return;
            }
            self.tree[node] = greatest;
        }
    }
}

/// The place nearest to `wish` that lies in all discs (centre and radius), of which 0 is in all: the wish
/// itself, the nearest place of one circle, or where two circles cross.
fn nearest_in_discs(wish: Vector2, discs: impl Iterator<Item = (Vector2, f64)> + Clone) -> Vector2 {
    let allowed =
        |p: &Vector2| discs.clone().all(|(centre, radius)| (p - centre).norm() <= radius * (1.0 + ROUNDING));
    if allowed(&wish) {
        return wish;
    }
    let mut best = Vector2::zeros();
    let mut consider = |p: Vector2| {
        if (p - wish).norm() < (best - wish).norm() && allowed(&p) {
            best = p;
        }
    };
    for (k, (centre, radius)) in discs.clone().enumerate() {
        let out = wish - centre;
        if out.norm() > radius {
            consider(centre + out * (radius / out.norm()));
        }
        for (other, other_radius) in discs.clone().skip(k + 1) {
            let apart = other - centre;
            let square = apart.norm_squared();
            let along = 0.5 * (1.0 + (radius * radius - other_radius * other_radius) / square);
            let across = (radius * radius / square - along * along).sqrt();
            if across.is_finite() {
                let left = Vector2::new(-apart.y, apart.x) * across;
                consider(centre + apart * along + left);
                consider(centre + apart * along - left);
            }
        }
    }
    best
}

/// How the jumps change when points move by the given shares of 1 mm: (point, change). What moves lies around
/// point `middle`.
pub(super) fn jump_changes(
    spline: &CubicSpline,
    moved: &[(usize, f64)],
    middle: usize,
) -> Result<Vec<(usize, f64)>, SplineError> {
    let (n, t) = (spline.points().len(), spline.parameters());
    let whole = n <= 2 * REACH + 1;
    let closed = whole && spline.is_closed();
    let near: Vec<usize> = if whole {
        (0..n).collect()
    } else if spline.is_closed() {
        (0..=2 * REACH).map(|k| (middle + n - REACH + k) % n).collect()
    } else {
        (middle.saturating_sub(REACH)..(middle + REACH + 1).min(n)).collect()
    };
    // The shares as the heights of a spline of their own; places along x only keep its points apart.
    let share = |k: usize| moved.iter().find(|(point, _)| *point == k).map_or(0.0, |(_, share)| *share);
    let heights = near.iter().enumerate().map(|(x, k)| Point2::new(x as f64, share(*k))).collect();
    let mut at = 0.0;
    let mut parameters = vec![at];
    for k in near.iter().take(near.len() - usize::from(!closed)) {
        at += t[k + 1] - t[*k];
        parameters.push(at);
    }
    let make = if closed { CubicSpline::closed } else { CubicSpline::open };
    let jumps = make(parameters, heights)?.third_jumps();
    let greatest = jumps.iter().map(|jump| jump.y.abs()).fold(0.0, f64::max);
    let changes = near.into_iter().zip(jumps.iter().map(|jump| jump.y));
    Ok(changes.filter(|(_, change)| change.abs() > LEAST_CHANGE * greatest).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_first_of_a_ranking_is_the_greatest(
            mut values in prop::collection::vec(0.0f64..1.0, 1..40),
            changes in prop::collection::vec((0usize..40, 0.0f64..1.0), 0..40),
        ) {
            let mut ranking = Ranking::new(values.iter().copied());
            for (k, value) in changes {
                let k = k % values.len();
                values[k] = value;
                ranking.set(k, value);
                let greatest = values.iter().copied().fold(0.0, f64::max);
                prop_assert_eq!(values.iter().position(|v| *v == greatest), Some(ranking.first()));
            }
        }

        #[test]
        fn the_nearest_place_in_discs_is_that_of_a_search(
            wish in prop::array::uniform2(-3.0f64..3.0),
            discs in prop::collection::vec((prop::array::uniform2(-0.7f64..0.7), 1.0f64..2.0), 1..5),
        ) {
            let discs: Vec<(Vector2, f64)> = discs.into_iter().map(|(c, r)| (Vector2::from(c), r)).collect();
            let wish = Vector2::from(wish);
            let found = nearest_in_discs(wish, discs.iter().copied());
            let most_out = |p: Vector2| discs.iter().map(|(c, r)| (p - c).norm() - r).fold(f64::MIN, f64::max);
            prop_assert!(most_out(found) <= 1e-11);
            let mut least = f64::INFINITY;
            for i in -120..=120 {
                for j in -120..=120 {
                    let p = Vector2::new(f64::from(i), f64::from(j)) * 0.025;
                    if most_out(p) <= 0.0 {
                        least = least.min((p - wish).norm());
                    }
                }
            }
            prop_assert!((found - wish).norm() <= least + 1e-12, "{found} {least}");
        }
    }
}
