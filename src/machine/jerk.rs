//! Speeds along a path at which every axis keeps its jerk as well.
//!
//! Enters: stages with the greatest squared speeds x at their ends, without regard to jerk. Leaves: lower
//! ones. The acceleration α of an axis in the middle of a stage is linear in x, and from middle to middle it
//! may change by no more than its jerk times the time between. The time of the path is a convex function of
//! x, and so are the limits but for that time. A barrier method finds the least: it stays inside of all
//! limits, so that whatever it leaves keeps them, and its Newton steps solve banded systems. Each section
//! from rest to rest is a problem of its own; at rest no axis accelerates, and in the stages beside it
//! accelerations rise evenly.

use super::axis_limits::{AxisLimits, Stage};
use work::monitor::{Cancelled, Monitor, check};

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
            let section = Section { stages: &stages[from..to], axes, times: None };
            let inner = section.quickest(&speeds[from..=to], monitor)?;
            speeds[from..=to].copy_from_slice(&inner);
        }
    }
    Ok(speeds)
}

/// Stages from rest to rest. Speeds at all their ends are zero at both.
struct Section<'a> {
    stages: &'a [Stage],
    axes: &'a AxisLimits,
    /// Times of the stages by which jerk is told, instead of their own.
    times: Option<Vec<f64>>,
}

/// A limit that is kept while `left` is positive: its derivatives by the speeds from the one numbered `first`
/// on.
struct Slack {
    left: f64,
    first: usize,
    slope: [f64; 3],
}

/// What a barrier is made of: its value, its gradient and the lower half of its Hessian, by diagonals.
struct Barrier {
    value: f64,
    gradient: Vec<f64>,
    hessian: Vec<[f64; 3]>,
}

impl Section<'_> {
    /// The quickest speeds. With the times between accelerations as they would be without jerk, the shortest,
    /// the problem is convex; from its solution the search goes on with the times as they are.
    fn quickest(&self, highest: &[f64], monitor: &dyn Monitor) -> Result<Vec<f64>, Cancelled> {
        let times = self.stages.iter().zip(highest.windows(2)).map(|(stage, x)| stage.time([x[0], x[1]]));
        let convex = Self { times: Some(times.collect()), ..*self };
        let mut x = convex.inside(highest);
        convex.descend(&mut x, FIRST_GAP, monitor)?;
        // Speeds above the highest, which some bends allow, take shorter times than those.
        let mut x = self.inside(&x);
        self.descend(&mut x, GAP, monitor)?;
        Ok(x)
    }

    /// Goes down until no more than a share of the time can be gained.
    fn descend(&self, x: &mut [f64], gap: f64, monitor: &dyn Monitor) -> Result<(), Cancelled> {
        let mut limits = 0usize;
        self.slacks(x, |_| limits += 1);
        let mut weight = self.time(x) / limits as f64;
        loop {
            // What a step promises less than that is a small share of what the weight itself keeps away from
            // the least time.
            let little = CENTRED * weight * limits as f64;
            for _ in 0..MOST_STEPS {
                check(monitor)?;
                if self.step(x, weight) < little {
                    break;
                }
            }
            if weight * limits as f64 <= gap * self.time(x) {
                return Ok(());
            }
            weight *= WEIGHTS;
        }
    }

    /// Speeds slow enough that all limits are kept with room.
    fn inside(&self, highest: &[f64]) -> Vec<f64> {
        let mut slower = 1.05f64;
        loop {
            let x: Vec<f64> = highest.iter().map(|x| x / (slower * slower)).collect();
            let mut inside = true;
            self.slacks(&x, |slack| inside &= slack.left > 0.0);
            if inside || slower > 1e9 {
                return x;
            }
            slower *= 1.5;
        }
    }

    fn time(&self, x: &[f64]) -> f64 {
        self.stages.iter().zip(x.windows(2)).map(|(stage, ends)| stage.time([ends[0], ends[1]])).sum()
    }

    /// All limits: what is left of each, as a share of itself, or s of jerks.
    fn slacks(&self, x: &[f64], mut take: impl FnMut(&Slack)) {
        let AxisLimits { accelerations, jerks, .. } = self.axes;
        let limited: Vec<usize> = (0..5).filter(|&axis| jerks[axis].is_finite()).collect();
        // Acceleration in the middle of the stage before, and its derivatives by the speeds at its ends, of
        // each axis.
        let mut before = [[0.0; 3]; 5];
        let mut time_before = [0.0; 3];
        for (k, stage) in self.stages.iter().enumerate() {
            let [begin, end] = [x[k], x[k + 1]];
            if k > 0 {
                take(&Slack {
                    left: 1.0 - begin / stage.most,
                    first: k,
                    slope: [-1.0 / stage.most, 0.0, 0.0],
                });
            }
            let steep = 0.5 / stage.length;
            let mut both = |value: f64, slope: [f64; 2], most: f64| {
                for side in [1.0 / most, -1.0 / most] {
                    let slope = [-side * slope[0], -side * slope[1], 0.0];
                    take(&Slack { left: 1.0 - side * value, first: k, slope });
                }
            };
            both((end - begin) * steep, [-steep, steep], stage.along);
            let time = match &self.times {
                Some(times) => [times[k], 0.0, 0.0],
                None => stage_time(stage, begin, end),
            };
            // Beside a rest the acceleration at the other end counts, two thirds of the squared speed over
            // the length.
            let (steep, shares) = match () {
                () if k == 0 => (4.0 / 3.0 * steep, [0.0, 1.0]),
                () if k + 1 == self.stages.len() => (4.0 / 3.0 * steep, [1.0, 0.0]),
                () => (steep, [0.5; 2]),
            };
            let mut now = [[0.0; 3]; 5];
            for axis in 0..5 {
                let along = stage.slope[axis] * steep;
                let [from, to] = stage.bends.map(|bend| bend[axis]);
                let rests = along == 0.0 && from == 0.0 && to == 0.0;
                if accelerations[axis].is_finite() && !rests {
                    let most = accelerations[axis];
                    both(from * begin + along * (end - begin), [from - along, along], most);
                    if from != 0.0 || to != 0.0 {
                        both(to * end + along * (end - begin), [-along, to + along], most);
                    }
                }
                let by = [shares[0] * from - along, along + shares[1] * to];
                now[axis] = [by[0] * begin + by[1] * end, by[0], by[1]];
            }
            // From where one acceleration counts to where the next one does.
            let (first, last) = (k == 0, k + 1 == self.stages.len());
            let [half, whole] = [0.5, 1.0].map(|share| time.map(|time| share * time));
            let none = [0.0; 3];
            for &axis in &limited {
                let ([a, da, db], [b, db2, dc]) = (before[axis], now[axis]);
                let after = if first {
                    whole
                } else if last {
                    none
                } else {
                    half
                };
                if [da, db, db2, dc] != [0.0; 4] {
                    let slope = [-da, db2 - db, dc];
                    jerk_slacks(jerks[axis], b - a, slope, [time_before, after], k, &mut take);
                }
                if last && [db2, dc] != [0.0; 2] {
                    jerk_slacks(jerks[axis], -b, [-db2, -dc, 0.0], [whole, none], k + 1, &mut take);
                }
            }
            (before, time_before) = (now, if first { none } else { half });
        }
    }

    /// The barrier of a weight; only its value, where that is enough. `None` outside of the limits.
    fn barrier(&self, x: &[f64], weight: f64, derived: bool) -> Option<Barrier> {
        let size = if derived { x.len() } else { 0 };
        let mut all = Barrier { value: 0.0, gradient: vec![0.0; size], hessian: vec![[0.0; 3]; size] };
        let inner = 1..x.len() - 1;
        if x[inner].iter().any(|x| x.is_nan() || *x <= 0.0) {
            return None;
        }
        let (mut product, mut logs, mut inside) = (1.0f64, 0.0, true);
        self.slacks(x, |slack| {
            inside &= slack.left > 0.0;
            product *= slack.left;
            if !(1e-200..1e200).contains(&product) {
                logs += product.ln();
                product = 1.0;
            }
            if !derived {
                return;
            }
            let over = 1.0 / slack.left;
            let share = weight * over;
            for i in 0..3 {
                let (row, slope) = (slack.first + i, slack.slope[i]);
                if slope != 0.0 && row < size {
                    all.gradient[row] -= share * slope;
                    for j in 0..=i {
                        all.hessian[row][i - j] += share * over * slope * slack.slope[j];
                    }
                }
            }
        });
        if !inside {
            return None;
        }
        all.value = -weight * (logs + product.ln());
        for (k, stage) in self.stages.iter().enumerate() {
            let [time, by_begin, by_end] = stage_time(stage, x[k], x[k + 1]);
            all.value += time;
            if derived {
                let (a, b) = (x[k].sqrt(), x[k + 1].sqrt());
                let sum = a + b;
                all.gradient[k] += by_begin;
                all.gradient[k + 1] += by_end;
                let length = if a == 0.0 || b == 0.0 { 1.5 * stage.length } else { stage.length };
                let own = |root: f64| {
                    if root > 0.0 {
                        length * (sum.powi(-3) / (root * root) + 0.5 * sum.powi(-2) / root.powi(3))
                    } else {
                        0.0
                    }
                };
                all.hessian[k][0] += own(a);
                all.hessian[k + 1][0] += own(b);
                if a > 0.0 && b > 0.0 {
                    all.hessian[k + 1][1] += stage.length * sum.powi(-3) / (a * b);
                }
            }
        }
        Some(all)
    }

    /// One Newton step; returns by how much it promised to lower the barrier, or 0 where none helps.
    fn step(&self, x: &mut [f64], weight: f64) -> f64 {
        let Some(here) = self.barrier(x, weight, true) else { return 0.0 };
        let way = solved(here.hessian, &here.gradient);
        let promised: f64 = -way.iter().zip(&here.gradient).map(|(a, b)| a * b).sum::<f64>();
        if promised.is_nan() || promised <= 0.0 {
            return 0.0;
        }
        let mut share = 1.0f64;
        while share > 1e-10 {
            let there: Vec<f64> = x.iter().zip(&way).map(|(x, way)| x + share * way).collect();
            let value = self.barrier(&there, weight, false).map(|barrier| barrier.value);
            if value.is_some_and(|value| value <= here.value - 0.1 * share * promised) {
                x.copy_from_slice(&there);
                return promised;
            }
            share *= 0.5;
        }
        0.0
    }
}

/// The time of a stage and its derivatives by the squared speeds at its ends, none by those that are zero.
fn stage_time(stage: &Stage, begin: f64, end: f64) -> [f64; 3] {
    let time = stage.time([begin, end]);
    let sum = begin.sqrt() + end.sqrt();
    let by = |x: f64| if x > 0.0 { -0.5 * time / (sum * x.sqrt()) } else { 0.0 };
    [time, by(begin), by(end)]
}

/// That an acceleration which changes by `change` within a time, the sum of two, keeps the jerk. `slope` is
/// that of the change by the speeds before, at and behind the end numbered `at`.
fn jerk_slacks(
    jerk: f64,
    change: f64,
    slope: [f64; 3],
    [before, after]: [[f64; 3]; 2],
    at: usize,
    take: &mut impl FnMut(&Slack),
) {
    let time = before[0] + after[0];
    let of_time = [before[1], before[2] + after[1], after[2]];
    for side in [1.0 / jerk, -1.0 / jerk] {
        // The time that is spare: convex as the time is.
        let by: [f64; 3] = std::array::from_fn(|i| of_time[i] - side * slope[i]);
        let left = time - side * change;
        // At the first end there is nothing before.
        let (first, slope) = if at == 0 { (0, [by[1], by[2], 0.0]) } else { (at - 1, by) };
        take(&Slack { left, first, slope });
    }
}

/// The Newton step of a gradient and a matrix of two diagonals beside the main one, by Cholesky. Both ends
/// stay where they are.
fn solved(mut matrix: Vec<[f64; 3]>, gradient: &[f64]) -> Vec<f64> {
    let n = gradient.len();
    let mut way: Vec<f64> = gradient.iter().map(|g| -g).collect();
    for end in [0, n - 1] {
        matrix[end] = [1.0, 0.0, 0.0];
        way[end] = 0.0;
    }
    for (row, distance) in [(1, 1), (2, 2), (n - 1, 1), (n - 1, 2)] {
        if row < n {
            matrix[row][distance] = 0.0;
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
