//! Axes drawn together until no pair turns too fast.
//!
//! Pairs that turn too fast meet, one after the other (the projections of position based dynamics, M. Müller
//! et al. 2007, on the unit sphere), first those far apart on a pass, then nearer ones. What sweeps leave is
//! taken up by leaning all axes towards their mean: a constant axis turns nowhere, so that there is always a
//! share of it that holds.

use super::graph::{Graph, Pair};
use geometry::Vector3;
use motion::ClPoint;
use work::monitor::{self, Cancelled, Monitor};

/// Sweeps over all pairs of a level. What a sweep leaves shrinks the slower the more passes lie between.
const MOST_SWEEPS: usize = 300;

/// Pairs are drawn together by this share more than they must, so that sweeps come to an end.
const SPARE: f64 = 0.01;

/// Halvings of the share that leans towards the mean.
const HALVINGS: usize = 30;

/// Rounding of angles, rad.
pub(super) const EXACT: f64 = 1e-10;

impl Pair {
    pub fn holds(&self, axes: &[Vector3]) -> bool {
        self.angle(axes) <= self.most + EXACT
    }

    /// Turns the axes towards each other by what is too much, each by its share in it; those that are held
    /// stay.
    fn draw_together(&self, axes: &mut [Vector3], held: &[bool]) -> bool {
        if self.holds(axes) {
            return false;
        }
        let [a, b] = self.between.map(|k| axes[k as usize]);
        let apart = a + (b - a) * self.share - axes[self.node as usize];
        let most = 2.0 * (0.5 * (1.0 - SPARE) * self.most).min(1.0).sin();
        let too_much = apart * (1.0 - most / apart.norm().max(f64::MIN_POSITIVE)).max(0.0);
        let shares = [(self.node, 1.0), (self.between[0], self.share - 1.0), (self.between[1], -self.share)];
        let free = shares.map(|(k, share)| (k as usize, if held[k as usize] { 0.0 } else { share }));
        let sum: f64 = free.iter().map(|(_, share)| share * share).sum();
        if sum < 1e-9 {
            return false;
        }
        for (k, share) in free {
            if let Some(turned) = (axes[k] + too_much * (share / sum)).try_normalize(1e-6) {
                axes[k] = turned;
            }
        }
        true
    }
}

/// Axes that turn no faster than the graph says, as near as may be to those that are wanted. Those that are
/// held stay; where they are in the way of others, pairs with them may turn faster.
///
/// # Errors
/// [`Cancelled`] when the monitor says so.
pub(super) fn drawn(
    graph: &Graph,
    wanted: &[Vector3],
    held: &[bool],
    monitor: &dyn Monitor,
) -> Result<Vec<Vector3>, Cancelled> {
    let finest = graph.pairs(0);
    let mut axes = wanted.to_vec();
    if finest.iter().all(|pair| pair.holds(&axes)) {
        return Ok(axes);
    }
    let mut moved = vec![Vector3::zeros(); axes.len()];
    for level in (0..graph.levels()).rev() {
        graph.carry_down(level, &mut moved);
        for (k, axis) in axes.iter_mut().enumerate() {
            if moved[k] != Vector3::zeros() && !held[k] {
                *axis = (wanted[k] + moved[k]).try_normalize(1e-6).unwrap_or(wanted[k]);
            }
        }
        sweep(&mut graph.pairs(level), &mut axes, held, monitor)?;
        for ((moved, axis), wanted) in moved.iter_mut().zip(&axes).zip(wanted) {
            *moved = axis - wanted;
        }
    }
    lean_to_the_mean(&finest, &mut axes, held);
    Ok(axes)
}

fn sweep(
    pairs: &mut [Pair],
    axes: &mut [Vector3],
    held: &[bool],
    monitor: &dyn Monitor,
) -> Result<(), Cancelled> {
    for _ in 0..MOST_SWEEPS {
        monitor::check(monitor)?;
        let mut drawn = false;
        for pair in pairs.iter() {
            drawn |= pair.draw_together(axes, held);
        }
        pairs.reverse();
        if !drawn {
            break;
        }
    }
    Ok(())
}

/// Leans all that is free towards the mean of what is held, or of all, by the least share at which pairs
/// hold. Pairs that do not even hold at the mean itself do not count.
fn lean_to_the_mean(pairs: &[Pair], axes: &mut Vec<Vector3>, held: &[bool]) {
    if pairs.iter().all(|pair| pair.holds(axes)) {
        return;
    }
    let some_held = held.contains(&true);
    let counts = axes.iter().zip(held).filter(|(_, held)| !some_held || **held);
    let Some(mean) = counts.map(|(axis, _)| axis).sum::<Vector3>().try_normalize(1e-6) else { return };
    let leaning = |share: f64| {
        let lean = |(axis, held): (&Vector3, &bool)| if *held { *axis } else { leant(*axis, mean, share) };
        axes.iter().zip(held).map(lean).collect::<Vec<_>>()
    };
    let all = leaning(1.0);
    let counting: Vec<&Pair> = pairs.iter().filter(|pair| pair.holds(&all)).collect();
    let (mut low, mut high) = (0.0, 1.0);
    if counting.iter().all(|pair| pair.holds(axes)) {
        return;
    }
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        let there = leaning(middle);
        *(if counting.iter().all(|pair| pair.holds(&there)) { &mut high } else { &mut low }) = middle;
    }
    *axes = leaning(high);
}

/// An axis part of the way to another one.
pub(super) fn leant(axis: Vector3, to: Vector3, share: f64) -> Vector3 {
    let at = |axis| ClPoint { tip: geometry::Point3::origin(), axis };
    at(axis).towards(&at(to), share).axis
}
