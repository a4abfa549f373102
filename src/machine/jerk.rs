//! Speeds along a path at which every axis keeps its jerk as well.
//!
//! Enters: stages with the greatest squared speeds x at their ends, without regard to jerk. Leaves: lower
//! ones. The acceleration α of an axis in the middle of a stage is linear in x, and from middle to middle it
//! may change by no more than its jerk times the time between. The time of the path is a convex function of
//! x, and so are the limits but for that time. A barrier method finds the least: it stays inside of all
//! limits, so that whatever it leaves keeps them, and its Newton steps solve banded systems. Each section
//! from rest to rest is a problem of its own; at rest no axis accelerates, and in the stages beside it
//! accelerations rise evenly.
//!
//! A step goes no farther than the tightest of all limits allows. Speeds a few ramps apart hardly act on each
//! other: along a long section parts are solved one by one, so that a tight place slows only its own.

use super::axis_limits::{AxisLimits, Stage};
use barrier::{Limits, Section};
use std::ops::Range;
use work::monitor::{Cancelled, Monitor, check};

mod barrier;

// None of these changes what is kept: every step stays inside of all limits. They decide how near to the
// least time the search ends, and how long it takes.

/// By how much the times found may lie above the least that the barrier can reach, as a share: a tenth of
/// what times are held to. Each halving takes a round of Newton steps more.
const GAP: f64 = 2e-3;

/// The same of the convex problem, which only gives the start of the other search: near its end the barrier
/// would crowd the start against limits that are others there. No time hangs on it: with a third of it, and
/// with three times as much, all are within the same share of the closed forms.
const FIRST_GAP: f64 = 0.3;

/// Promises of steps, as a share of what the weight itself keeps away from the least time, that end the
/// search for one weight. More exact steps are lost on a weight that is left.
const CENTRED: f64 = 0.05;

/// The weight of the barrier over the one before. Smaller ones make fewer rounds of more steps each; the sum
/// hardly changes (S. Boyd and L. Vandenberghe, "Convex optimization", 2004, 11.3.2).
const WEIGHTS: f64 = 0.5;

/// Newton steps for one weight at most: a way out where rounding keeps promises from shrinking.
const MOST_STEPS: usize = 40;

/// Stages of a part. Half as many, or twice as many, take as long within a tenth.
const PART: usize = 256;

/// Shares of a step of a part or of a short section, and of all parts together, below which it is not taken.
const LEAST_SHARES: [f64; 2] = [1e-10, 0.5];

/// Squared speeds, mm²/s², below which the machine stands.
const REST: f64 = 1e-18;

/// Time, s, from rest to a speed.
pub(super) fn ramp(speed: f64, acceleration: f64, jerk: f64) -> f64 {
    if speed * jerk >= acceleration * acceleration {
        speed / acceleration + acceleration / jerk
    } else {
        2.0 * (speed / jerk).sqrt()
    }
}

/// Time, s, for a way from rest to rest: seven pieces of even jerk, or fewer.
pub(super) fn from_rest_to_rest(way: f64, rate: f64, acceleration: f64, jerk: f64) -> f64 {
    let ramps = ramp(rate, acceleration, jerk);
    if way >= rate * ramps {
        return way / rate + ramps;
    }
    // The speed at which the acceleration is just reached.
    let reached = acceleration * acceleration / jerk;
    if way * jerk >= 2.0 * acceleration * reached {
        let peak = 0.5 * ((reached * reached + 4.0 * acceleration * way).sqrt() - reached);
        2.0 * (peak / acceleration + acceleration / jerk)
    } else {
        4.0 * (0.5 * way / jerk).cbrt()
    }
}

/// The squared speeds at the ends of all stages, lowered to what the jerks of the axes allow.
pub(super) fn within(
    stages: &[Stage],
    mut speeds: Vec<f64>,
    axes: &AxisLimits,
    monitor: &dyn Monitor,
) -> Result<Vec<f64>, Cancelled> {
    if axes.jerks.iter().all(|most| most.is_infinite()) {
        return Ok(speeds);
    }
    let rests: Vec<usize> = (0..speeds.len()).filter(|&k| speeds[k] <= REST).collect();
    for ends in rests.windows(2) {
        let (from, to) = (ends[0], ends[1]);
        if to - from > 1 {
            let highest = &mut speeds[from..=to];
            let limits = Limits::new(&stages[from..to], axes, highest);
            let inner = quickest(&limits, highest, monitor)?;
            highest.copy_from_slice(&inner);
        }
    }
    Ok(speeds)
}

/// The quickest speeds. With the times between accelerations as they would be without jerk, the shortest, the
/// problem is convex; from its solution the search goes on with the times as they are.
fn quickest(limits: &Limits, highest: &[f64], monitor: &dyn Monitor) -> Result<Vec<f64>, Cancelled> {
    let convex = limits.section(true);
    let mut x = convex.inside(highest);
    convex.descend(&mut x, FIRST_GAP, monitor)?;
    // Speeds above the highest, which some bends allow, take shorter times than those.
    let section = limits.section(false);
    let mut x = section.inside(&x);
    section.descend(&mut x, GAP, monitor)?;
    Ok(x)
}

/// What came of a Newton step.
#[derive(Default)]
struct Step {
    /// By how much the whole of it would lower the barrier, were that a parabola; 0 where none helps.
    promised: f64,
    taken: bool,
}

impl Section<'_> {
    /// Goes down until no more than a share of the time can be gained.
    fn descend(&self, x: &mut [f64], gap: f64, monitor: &dyn Monitor) -> Result<(), Cancelled> {
        let limits = self.limits(x) as f64;
        let mut weight = self.time(x) / limits;
        loop {
            // What a step promises less than that is a small share of what the weight itself keeps away from
            // the least time.
            self.centre(x, weight, CENTRED * weight * limits, monitor)?;
            if weight * limits <= gap * self.time(x) {
                return Ok(());
            }
            weight *= WEIGHTS;
        }
    }

    /// Newton steps for one weight, until one of the whole section promises little.
    fn centre(
        &self,
        x: &mut [f64],
        weight: f64,
        little: f64,
        monitor: &dyn Monitor,
    ) -> Result<(), Cancelled> {
        let long = self.len() > 2 * PART;
        for round in 0..MOST_STEPS {
            check(monitor)?;
            // The parts of every other round overlap those before.
            let first = if round % 2 == 0 { PART } else { PART / 2 };
            let moved = long && self.centre_parts(x, weight, little, first, monitor)?;
            let Step { promised, taken } = self.step(x, weight, LEAST_SHARES[usize::from(long)]);
            if promised < little || !(moved || taken) {
                break;
            }
        }
        Ok(())
    }

    /// The same of parts, one after the other, of which the first has so many stages: each until it promises
    /// no more than its share of little. Says whether any speed has changed.
    fn centre_parts(
        &self,
        x: &mut [f64],
        weight: f64,
        little: f64,
        first: usize,
        monitor: &dyn Monitor,
    ) -> Result<bool, Cancelled> {
        let (n, mut begin, mut end, mut moved) = (self.len(), 0, first, false);
        while begin < n {
            check(monitor)?;
            if end + PART / 2 > n {
                end = n;
            }
            // With the stages beside it, whose limits hang on speeds of the part.
            let around = begin.saturating_sub(2)..(end + 1).min(n);
            let (part, speeds) = (self.part(around.clone()), &mut x[around.start..=around.end]);
            let little = little * (end - begin) as f64 / n as f64;
            for _ in 0..MOST_STEPS {
                let Step { promised, taken } = part.step(speeds, weight, LEAST_SHARES[0]);
                moved |= taken;
                if promised < little || !taken {
                    break;
                }
            }
            (begin, end) = (end, end + PART);
        }
        Ok(moved)
    }

    /// Speeds slow enough that all limits are kept with room.
    fn inside(&self, highest: &[f64]) -> Vec<f64> {
        let mut slower = 1.05f64;
        loop {
            let x: Vec<f64> = highest.iter().map(|x| x / (slower * slower)).collect();
            if self.is_inside(&x) || slower > 1e9 {
                return x;
            }
            slower *= 1.5;
        }
    }

    /// One Newton step, or the greatest share of it that lowers the barrier, halved from time to time, no
    /// smaller than the least.
    fn step(&self, x: &mut [f64], weight: f64, least: f64) -> Step {
        let Some(here) = self.barrier(x, weight) else { return Step::default() };
        let way = solved(here.hessian, &here.gradient, self.free());
        let promised: f64 = -way.iter().zip(&here.gradient).map(|(a, b)| a * b).sum::<f64>();
        if promised.is_nan() || promised <= 0.0 {
            return Step::default();
        }
        let (mut share, mut there) = (1.0f64, vec![0.0; x.len()]);
        while share >= least {
            for (there, (x, way)) in there.iter_mut().zip(x.iter().zip(&way)) {
                *there = x + share * way;
            }
            let value = self.value(&there, weight);
            if value.is_some_and(|value| value <= here.value - 0.1 * share * promised) {
                x.copy_from_slice(&there);
                return Step { promised, taken: true };
            }
            share *= 0.5;
        }
        Step { promised, taken: false }
    }
}

/// The Newton step of a gradient and a matrix of two diagonals beside the main one, by Cholesky, of the
/// speeds that are free.
fn solved(mut matrix: Vec<[f64; 3]>, gradient: &[f64], free: Range<usize>) -> Vec<f64> {
    let n = gradient.len();
    let mut way: Vec<f64> = gradient.iter().map(|g| -g).collect();
    for fixed in (0..free.start).chain(free.end..n) {
        matrix[fixed] = [1.0, 0.0, 0.0];
        way[fixed] = 0.0;
        for distance in 1..3 {
            if fixed + distance < n {
                matrix[fixed + distance][distance] = 0.0;
            }
        }
    }
    for row in 0..n {
        for distance in [2, 1, 0] {
            let Some(column) = row.checked_sub(distance) else { continue };
            let mut value = matrix[row][distance];
            // Those before both.
            for other in distance + 1..3 {
                if row >= other {
                    value -= matrix[row][other] * matrix[column][other - distance];
                }
            }
            matrix[row][distance] =
                if distance > 0 { value / matrix[column][0] } else { value.max(f64::MIN_POSITIVE).sqrt() };
        }
    }
    for row in 0..n {
        for distance in 1..3.min(row + 1) {
            way[row] -= matrix[row][distance] * way[row - distance];
        }
        way[row] /= matrix[row][0];
    }
    for row in (0..n).rev() {
        for distance in 1..3 {
            if row + distance < n {
                way[row] -= matrix[row + distance][distance] * way[row + distance];
            }
        }
        way[row] /= matrix[row][0];
    }
    way
}

#[cfg(test)]
mod tests;
