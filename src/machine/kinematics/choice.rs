//! Which of the two ways, and with how many whole turns, along a whole path: the cheapest in turning.
//!
//! On each side of the triangle ([`super::angles`]) the rotary angles follow a move without jumps, and their
//! whole turns stay what they are. So a state is a side and two counts of turns, and it can change only while
//! the tool stands: for nothing but the turning where the first axis is free or the two ways meet, and as a
//! *rewind*, for which the tool must be clear of the part, anywhere else. Dynamic programming over the path
//! finds the states with the least sum of turning (rad) and of the prices below.

use super::angles::{Solved, Triangle};
use super::{Kinematics, RotaryAxis};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// A rewind in clear air, rad: rather than turn half a turn more the tool stays on its way.
const CLEAR_REWIND: f64 = PI;
/// A rewind while the tool cuts, rad: it would leave a mark, so that only limits are worse.
const CUTTING_REWIND: f64 = 1e5;
/// A joint out of its limits, rad: nothing is worse, but a path that cannot do without is told as well.
const OUT_OF_LIMITS: f64 = 1e8;
/// Weight of the angles at the start against turning on the way: the start is reached at the top.
const START: f64 = 1e-3;
/// Turns below this, rad, are none.
pub(super) const STILL: f64 = 1e-6;
/// Rounding that limits forgive, rad.
pub(super) const LIMIT_SLACK: f64 = 1e-9;

/// A side of the triangle (1 or −1) and whole turns of both axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct State {
    side: f64,
    turns: [i32; 2],
}

/// A location as the choice sees it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stop {
    pub solved: Solved,
    /// The first axis is free here.
    pub free: bool,
    /// The tool may turn here without harm.
    pub clear: bool,
    /// Azimuth without jumps, on arriving and on leaving; they differ only where the first axis is free.
    pub arriving: f64,
    pub leaving: f64,
}

impl Stop {
    pub fn angles(&self, triangle: &Triangle, state: State, leaving: bool) -> [f64; 2] {
        let azimuth = if leaving { self.leaving } else { self.arriving };
        let [first, second] = triangle.angles(azimuth, &self.solved, state.side);
        let [m, n] = state.turns.map(f64::from);
        [first + m * TAU, second + n * TAU]
    }

    /// The two ways are one here.
    fn ways_meet(&self) -> bool {
        self.solved.turn.min(PI - self.solved.turn) < STILL
    }
}

/// Gives every stop its azimuths: without jumps, and where the first axis is free first as it came, then as
/// it has to leave.
pub(super) fn unwind(stops: &mut [Stop]) {
    let first = stops.iter().find(|stop| !stop.free);
    // A quarter turn less stands for the lead: a path that is free all along has its first axis at zero.
    let mut azimuth = first.map_or(-FRAC_PI_2, |stop| stop.solved.azimuth);
    let next: Vec<Option<f64>> =
        stops.iter().skip(1).map(|stop| (!stop.free).then_some(stop.solved.azimuth)).chain([None]).collect();
    let nearest = |azimuth: f64, to: f64| azimuth + super::folded(to - azimuth);
    for (stop, next) in stops.iter_mut().zip(next) {
        if !stop.free {
            azimuth = nearest(azimuth, stop.solved.azimuth);
        }
        stop.arriving = azimuth;
        if let (true, Some(next)) = (stop.free, next) {
            azimuth = nearest(azimuth, next);
        }
        stop.leaving = azimuth;
    }
    if let Some(start) = stops.first_mut() {
        start.arriving = start.leaving;
    }
}

/// The whole turns that bring `angle` within limits; `None` if there are none.
pub(super) fn turns_within(angle: f64, limits: [f64; 2]) -> Option<std::ops::RangeInclusive<i32>> {
    let [least, greatest] = limits;
    let from = ((least - LIMIT_SLACK - angle) / TAU).ceil() as i32;
    let to = ((greatest + LIMIT_SLACK - angle) / TAU).floor() as i32;
    (from <= to).then_some(from..=to)
}

/// The whole turns among which to choose: those within limits (of many an even selection, both ends in it);
/// where there are none, those nearest to them; and without limits those nearest to `near`.
fn choices(angle: f64, axis: &RotaryAxis, near: f64) -> Vec<i32> {
    /// More would take time in proportion, and unwinding by one turn more or less is worth little.
    const MOST: i32 = 5;
    let nearest = |to: f64| ((to - angle) / TAU).round() as i32;
    let Some(limits) = axis.limits else { return vec![nearest(near)] };
    let Some(turns) = turns_within(angle, limits) else {
        return vec![nearest(0.5 * (limits[0] + limits[1]))];
    };
    let (from, span) = (*turns.start(), turns.end() - turns.start());
    if span < MOST { turns.collect() } else { (0..MOST).map(|k| from + span * k / (MOST - 1)).collect() }
}

/// States in force from a location on, each with the state before it.
struct Epoch {
    from: usize,
    states: Vec<(State, usize)>,
}

struct Search<'a> {
    kinematics: &'a Kinematics,
    stops: &'a [Stop],
    states: Vec<State>,
    costs: Vec<f64>,
    epochs: Vec<Epoch>,
}

/// The state for each move between stops; for a single stop the state there.
pub(super) fn choose(kinematics: &Kinematics, stops: &[Stop]) -> Vec<State> {
    let Some(start) = stops.first() else { return Vec::new() };
    let mut search = Search { kinematics, stops, states: Vec::new(), costs: Vec::new(), epochs: Vec::new() };
    let states = search.candidates(start, &[0.0; 2]);
    let cost = |state: &State| {
        let angles = start.angles(&kinematics.triangle, *state, true);
        START * (angles[0].abs() + angles[1].abs()) + search.beyond(angles)
    };
    let costs = states.iter().map(cost).collect();
    search.take(0, states.into_iter().map(|state| (state, 0)).collect(), costs);
    for k in 0..stops.len() - 1 {
        search.advance(k);
    }
    search.trace()
}

impl Search<'_> {
    /// The states that a location can have, with unlimited axes near to given angles.
    fn candidates(&self, stop: &Stop, near: &[f64; 2]) -> Vec<State> {
        let mut states = Vec::new();
        for side in [1.0, -1.0] {
            let plain = State { side, turns: [0; 2] };
            let angles = stop.angles(&self.kinematics.triangle, plain, false);
            let [first, second] = [0, 1].map(|k| choices(angles[k], &self.kinematics.axes[k], near[k]));
            for m in first {
                states.extend(second.iter().map(|n| State { side, turns: [m, *n] }));
            }
        }
        states
    }

    /// Price of angles beyond limits.
    fn beyond(&self, angles: [f64; 2]) -> f64 {
        let out = |k: usize| {
            self.kinematics.axes[k].limits.is_some_and(|[least, greatest]| {
                !(least - LIMIT_SLACK..=greatest + LIMIT_SLACK).contains(&angles[k])
            })
        };
        OUT_OF_LIMITS * [0, 1].into_iter().filter(|k| out(*k)).count() as f64
    }

    /// From the states at stop `k` to those at the next.
    fn advance(&mut self, k: usize) {
        let (stop, next) = (&self.stops[k], &self.stops[k + 1]);
        let triangle = &self.kinematics.triangle;
        let arrives = |state: State| next.angles(triangle, state, false);
        let stays = self.states.iter().all(|state| self.beyond(arrives(*state)) == 0.0);
        let may_change = stop.free || stop.clear || stop.ways_meet();
        if stays && !may_change {
            for (state, cost) in self.states.iter().zip(&mut self.costs) {
                *cost += apart(stop.angles(triangle, *state, true), next.angles(triangle, *state, false));
            }
            return;
        }
        let (mut states, mut costs): (Vec<(State, usize)>, Vec<f64>) = Default::default();
        for (from, (source, cost)) in self.states.iter().zip(&self.costs).enumerate() {
            let before = stop.angles(triangle, *source, false);
            let mut targets = self.candidates(next, &before);
            // Unlimited axes leave as near as they can to how they came.
            for target in &mut targets {
                let leaves = stop.angles(triangle, *target, true);
                for (axis, turns) in target.turns.iter_mut().enumerate() {
                    if self.kinematics.axes[axis].limits.is_none() {
                        *turns += ((before[axis] - leaves[axis]) / TAU).round() as i32;
                    }
                }
            }
            targets.push(*source);
            for target in targets {
                let after = stop.angles(triangle, target, true);
                let cost = cost
                    + apart(before, after)
                    + rewind_price(stop, before, after)
                    + self.beyond(after)
                    + self.beyond(arrives(target))
                    + apart(after, arrives(target));
                match states.iter().position(|(state, _)| *state == target) {
                    Some(at) if cost < costs[at] => (states[at].1, costs[at]) = (from, cost),
                    Some(_) => {}
                    None => {
                        states.push((target, from));
                        costs.push(cost);
                    }
                }
            }
        }
        self.take(k, states, costs);
    }

    /// Takes over the states that might still become the cheapest.
    fn take(&mut self, k: usize, states: Vec<(State, usize)>, costs: Vec<f64>) {
        /// More would make long paths with wide limits slow; turning in clear air restores what is left out.
        const MOST: usize = 24;
        let best = costs.iter().copied().fold(f64::INFINITY, f64::min);
        let mut order: Vec<usize> = (0..states.len()).collect();
        // A state dearer than this is reached as well from the best one, later.
        order.retain(|at| costs[*at] < best + 1.5 * CUTTING_REWIND);
        order.sort_by(|a, b| costs[*a].total_cmp(&costs[*b]));
        order.truncate(MOST);
        // In the order of their sources, so that states that stay keep their places.
        order.sort_by_key(|at| states[*at].1);
        self.costs = order.iter().map(|at| costs[*at]).collect();
        let states: Vec<(State, usize)> = order.iter().map(|at| states[*at]).collect();
        let stay =
            |(at, (state, from)): (usize, &(State, usize))| at == *from && self.states.get(at) == Some(state);
        if states.len() == self.states.len() && states.iter().enumerate().all(stay) {
            return;
        }
        self.states = states.iter().map(|(state, _)| *state).collect();
        self.epochs.push(Epoch { from: k, states });
    }

    fn trace(&self) -> Vec<State> {
        let moves = self.stops.len() - 1;
        let best = (0..self.costs.len()).min_by(|a, b| self.costs[*a].total_cmp(&self.costs[*b]));
        let mut at = best.unwrap_or(0);
        let mut chosen = vec![State { side: 1.0, turns: [0; 2] }; moves.max(1)];
        let mut end = moves.max(1);
        for epoch in self.epochs.iter().rev() {
            let (state, before) = epoch.states[at];
            if epoch.from < end {
                chosen[epoch.from..end].fill(state);
                end = epoch.from;
            }
            at = before;
        }
        chosen
    }
}

/// Sum of both turns, rad.
fn apart(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).abs() + (a[1] - b[1]).abs()
}

/// True when the tool axis leaves its direction while the joints turn at a stop.
pub(super) fn is_rewind(stop: &Stop, before: [f64; 2], after: [f64; 2]) -> bool {
    let [first, second] = [0, 1].map(|k| (before[k] - after[k]).abs() > STILL);
    second || (first && !stop.free)
}

fn rewind_price(stop: &Stop, before: [f64; 2], after: [f64; 2]) -> f64 {
    match is_rewind(stop, before, after) {
        false => 0.0,
        true if stop.clear => CLEAR_REWIND,
        true => CUTTING_REWIND,
    }
}
