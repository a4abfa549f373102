//! The barrier of the limits of a section, its gradient and its Hessian.
//!
//! Limits are made ready once: each as a sum of the squared speeds at the ends of a stage that must stay
//! between −1 and 1, and the accelerations of the axes over their jerks, s. From the middle of one stage to
//! that of the next these may change by no more than the time.

use super::super::axis_limits::{AxisLimits, Stage};
use std::ops::Range;

/// Limits of some stages in a row, made ready.
pub(super) struct Limits {
    stages: Vec<Ready>,
    /// Of all stages, one after the other.
    within: Vec<[f64; 2]>,
    /// Accelerations over jerks: of each stage one for each limited axis, s per mm²/s².
    paces: Vec<[f64; 2]>,
    axes: usize,
}

struct Ready {
    /// Its length, mm, and half as much again beside a rest, where acceleration rises evenly.
    way: f64,
    /// One over the greatest squared speed at its beginning; 0 where that stays as it is.
    slowness: f64,
    /// Where its limits end in `within`.
    end: usize,
    /// The time by which its jerk is told where that is not its own, s.
    time: f64,
}

impl Limits {
    /// Of stages from rest to rest. Times that are fixed are those of the squared speeds `highest`.
    pub fn new(stages: &[Stage], axes: &AxisLimits, highest: &[f64]) -> Self {
        let AxisLimits { accelerations, jerks, .. } = axes;
        let limited: Vec<usize> = (0..5).filter(|&axis| jerks[axis].is_finite()).collect();
        let mut all = Self {
            stages: Vec::with_capacity(stages.len()),
            within: Vec::with_capacity(7 * stages.len()),
            paces: Vec::with_capacity(limited.len() * stages.len()),
            axes: limited.len(),
        };
        for (k, stage) in stages.iter().enumerate() {
            let steep = 0.5 / stage.length;
            all.within.push([-steep / stage.along, steep / stage.along]);
            // Beside a rest the acceleration at the other end counts, two thirds of the squared speed over
            // the length.
            let (steep, shares) = match () {
                () if k == 0 => (4.0 / 3.0 * steep, [0.0, 1.0]),
                () if k + 1 == stages.len() => (4.0 / 3.0 * steep, [1.0, 0.0]),
                () => (steep, [0.5; 2]),
            };
            let by = |axis: usize| (stage.slope[axis] * steep, stage.bends.map(|bend| bend[axis]));
            for axis in (0..5).filter(|&axis| accelerations[axis].is_finite()) {
                let (along, [from, to]) = by(axis);
                let (bends, over) = (from != 0.0 || to != 0.0, 1.0 / accelerations[axis]);
                if along != 0.0 || bends {
                    all.within.push([(from - along) * over, along * over]);
                }
                if bends {
                    all.within.push([-along * over, (to + along) * over]);
                }
            }
            for &axis in &limited {
                let (along, [from, to]) = by(axis);
                let pace = [shares[0] * from - along, along + shares[1] * to];
                all.paces.push(pace.map(|pace| pace / jerks[axis]));
            }
            let ends = [highest[k], highest[k + 1]];
            let way = if ends.contains(&0.0) { 1.5 * stage.length } else { stage.length };
            let slowness = if k > 0 { 1.0 / stage.most } else { 0.0 };
            all.stages.push(Ready { way, slowness, end: all.within.len(), time: stage.time(ends) });
        }
        all
    }

    /// All stages; with times that are fixed, if so.
    pub fn section(&self, fixed: bool) -> Section<'_> {
        let Self { stages, within, paces, axes } = self;
        Section { stages, within, begin: 0, paces, axes: *axes, fixed, rests: [true; 2] }
    }
}

/// Stages in a row.
#[derive(Clone, Copy)]
pub(super) struct Section<'a> {
    stages: &'a [Ready],
    /// Of the whole.
    within: &'a [[f64; 2]],
    /// Where its limits begin there.
    begin: usize,
    paces: &'a [[f64; 2]],
    axes: usize,
    /// Jerk is told by fixed times of the stages, instead of their own.
    fixed: bool,
    /// Whether the machine rests at the beginning and at the end. Otherwise two squared speeds there stay as
    /// they are.
    rests: [bool; 2],
}

/// Takes limits, each with the number of the first squared speed that it hangs on and its derivatives by that
/// and the next ones. Says whether to go on.
trait Take {
    /// `share` of a limit above.
    fn below(&mut self, at: usize, share: f64, slope: f64) -> bool;
    /// `share` of a limit on both sides.
    fn within(&mut self, at: usize, share: f64, slope: [f64; 2]) -> bool;
    /// An acceleration over its jerk that may change by no more than `time`.
    fn change(&mut self, at: usize, time: (f64, [f64; 3]), change: (f64, [f64; 3])) -> bool;
}

/// How many sides there are.
struct Count(usize);

impl Take for Count {
    fn below(&mut self, _: usize, _: f64, _: f64) -> bool {
        self.0 += 1;
        true
    }

    fn within(&mut self, _: usize, _: f64, _: [f64; 2]) -> bool {
        self.0 += 2;
        true
    }

    fn change(&mut self, _: usize, _: (f64, [f64; 3]), _: (f64, [f64; 3])) -> bool {
        self.0 += 2;
        true
    }
}

/// The sum of the logarithms of what is left of all limits.
struct Logarithms {
    sum: f64,
    product: f64,
}

impl Logarithms {
    /// No sum where nothing is left.
    #[inline(always)]
    fn add(&mut self, [one, other]: [f64; 2]) -> bool {
        self.product *= one * other;
        if !(1e-200..1e200).contains(&self.product) {
            self.sum += self.product.ln();
            self.product = 1.0;
        }
        one > 0.0 && other > 0.0
    }
}

impl Take for Logarithms {
    #[inline(always)]
    fn below(&mut self, _: usize, share: f64, _: f64) -> bool {
        self.add([1.0 - share, 1.0])
    }

    #[inline(always)]
    fn within(&mut self, _: usize, share: f64, _: [f64; 2]) -> bool {
        self.add([1.0 - share, 1.0 + share])
    }

    #[inline(always)]
    fn change(&mut self, _: usize, (time, _): (f64, [f64; 3]), (change, _): (f64, [f64; 3])) -> bool {
        self.add([time - change, time + change])
    }
}

/// A barrier with its gradient and the lower half of its Hessian, by diagonals.
pub(super) struct Barrier {
    pub value: f64,
    pub gradient: Vec<f64>,
    pub hessian: Vec<[f64; 3]>,
}

struct Derivatives {
    logarithms: Logarithms,
    gradient: Vec<f64>,
    hessian: Vec<[f64; 3]>,
    weight: f64,
}

impl Take for Derivatives {
    #[inline(always)]
    fn below(&mut self, at: usize, share: f64, slope: f64) -> bool {
        let over = slope / (1.0 - share);
        self.gradient[at] += self.weight * over;
        self.hessian[at][0] += self.weight * over * over;
        self.logarithms.below(at, share, slope)
    }

    #[inline(always)]
    fn within(&mut self, at: usize, share: f64, slope: [f64; 2]) -> bool {
        let [above, below] = [1.0 / (1.0 - share), 1.0 / (1.0 + share)];
        let first = self.weight * (above - below);
        let second = self.weight * (above * above + below * below);
        let by = slope.map(|slope| second * slope);
        self.gradient[at] += first * slope[0];
        self.gradient[at + 1] += first * slope[1];
        self.hessian[at][0] += by[0] * slope[0];
        self.hessian[at + 1][1] += by[0] * slope[1];
        self.hessian[at + 1][0] += by[1] * slope[1];
        self.logarithms.within(at, share, slope)
    }

    #[inline(always)]
    fn change(&mut self, at: usize, time: (f64, [f64; 3]), change: (f64, [f64; 3])) -> bool {
        for side in [-1.0, 1.0] {
            let by: [f64; 3] = std::array::from_fn(|i| time.1[i] + side * change.1[i]);
            let over = 1.0 / (time.0 + side * change.0);
            let first = self.weight * over;
            let second = first * over;
            for i in 0..3 {
                // At a rest there is nothing beyond, and nothing hangs on it.
                let Some(row) = self.hessian.get_mut(at + i) else { continue };
                self.gradient[at + i] -= first * by[i];
                let scaled = second * by[i];
                for j in 0..=i {
                    row[i - j] += scaled * by[j];
                }
            }
        }
        self.logarithms.change(at, time, change)
    }
}

/// The time of a stage by the speeds at its ends, and its derivatives by their squares, none by those that
/// are zero.
#[inline(always)]
fn time(way: f64, [begin, end]: [f64; 2]) -> [f64; 3] {
    let over = 1.0 / (begin + end);
    let by = |root: f64| if root > 0.0 { -way * over * over / root } else { 0.0 };
    [2.0 * way * over, by(begin), by(end)]
}

impl<'a> Section<'a> {
    /// How many stages.
    pub fn len(&self) -> usize {
        self.stages.len()
    }

    /// Some of them. At ends that are inside of the section two squared speeds stay as they are.
    pub fn part(&self, range: Range<usize>) -> Self {
        let rests = [self.rests[0] && range.start == 0, self.rests[1] && range.end == self.len()];
        let begin = range.start.checked_sub(1).map_or(self.begin, |k| self.stages[k].end);
        let paces = &self.paces[self.axes * range.start..self.axes * range.end];
        Self { stages: &self.stages[range], begin, paces, rests, ..*self }
    }

    /// Numbers of the squared speeds that may change.
    pub fn free(&self) -> Range<usize> {
        let [begin, end] = self.rests.map(|rests| if rests { 1 } else { 2 });
        begin..(self.len() + 1).saturating_sub(end).max(begin)
    }

    /// s.
    pub fn time(&self, x: &[f64]) -> f64 {
        let one = |(stage, ends): (&Ready, &[f64])| 2.0 * stage.way / (ends[0].sqrt() + ends[1].sqrt());
        self.stages.iter().zip(x.windows(2)).map(one).sum()
    }

    /// How many limits there are.
    pub fn limits(&self, x: &[f64]) -> usize {
        let mut count = Count(0);
        self.take(x, &mut count);
        count.0
    }

    /// Whether all limits are kept with room.
    pub fn is_inside(&self, x: &[f64]) -> bool {
        self.take(x, &mut Logarithms { sum: 0.0, product: 1.0 }).is_some()
    }

    /// The barrier of a weight. `None` outside of the limits.
    pub fn value(&self, x: &[f64], weight: f64) -> Option<f64> {
        let mut logarithms = Logarithms { sum: 0.0, product: 1.0 };
        let time = self.take(x, &mut logarithms)?;
        Some(time - weight * (logarithms.sum + logarithms.product.ln()))
    }

    /// The barrier of a weight, with derivatives.
    pub fn barrier(&self, x: &[f64], weight: f64) -> Option<Barrier> {
        let mut all = Derivatives {
            logarithms: Logarithms { sum: 0.0, product: 1.0 },
            gradient: vec![0.0; x.len()],
            hessian: vec![[0.0; 3]; x.len()],
            weight,
        };
        let time = self.take(x, &mut all)?;
        let Derivatives { logarithms, mut gradient, mut hessian, .. } = all;
        let mut begin = x[0].sqrt();
        for (k, stage) in self.stages.iter().enumerate() {
            let end = x[k + 1].sqrt();
            let over = 1.0 / (begin + end);
            let [by_begin, by_end] = [begin, end].map(|root| if root > 0.0 { 1.0 / root } else { 0.0 });
            let square = stage.way * over * over;
            gradient[k] -= square * by_begin;
            gradient[k + 1] -= square * by_end;
            let own = |by: f64| square * by * by * (over + 0.5 * by);
            hessian[k][0] += own(by_begin);
            hessian[k + 1][0] += own(by_end);
            hessian[k + 1][1] += square * over * by_begin * by_end;
            begin = end;
        }
        let value = time - weight * (logarithms.sum + logarithms.product.ln());
        Some(Barrier { value, gradient, hessian })
    }

    /// All limits, and the time of all stages, s; `None` where one was not to be taken.
    #[inline(always)]
    fn take(&self, x: &[f64], take: &mut impl Take) -> Option<f64> {
        let n = self.len();
        let (mut sum, mut begin, mut root) = (0.0, self.begin, x[0].sqrt());
        // Accelerations over jerks in the middle of the stage before, and the time since then.
        let (mut before, mut since) = ([0.0; 5], [0.0; 3]);
        for (k, stage) in self.stages.iter().enumerate() {
            let ends = [x[k], x[k + 1]];
            let at_rest = [self.rests[0] && k == 0, self.rests[1] && k + 1 == n];
            if !at_rest[1] && (ends[1].is_nan() || ends[1] <= 0.0) {
                return None;
            }
            if !take.below(k, stage.slowness * ends[0], stage.slowness) {
                return None;
            }
            for slope in &self.within[begin..stage.end] {
                if !take.within(k, slope[0] * ends[0] + slope[1] * ends[1], *slope) {
                    return None;
                }
            }
            begin = stage.end;
            let next = ends[1].sqrt();
            let own = time(stage.way, [root, next]);
            sum += own[0];
            let whole = if self.fixed { [stage.time, 0.0, 0.0] } else { own };
            // From where one acceleration counts to where the next one does.
            let half = whole.map(|time| 0.5 * time);
            let until = match at_rest {
                [true, _] => whole,
                [_, true] => [0.0; 3],
                _ => half,
            };
            let paces = &self.paces[self.axes * k..self.axes * (k + 1)];
            for (axis, pace) in paces.iter().enumerate() {
                let now = pace[0] * ends[0] + pace[1] * ends[1];
                if at_rest[0] {
                    let time = (until[0], [until[1], until[2], 0.0]);
                    if *pace != [0.0; 2] && !take.change(0, time, (now, [pace[0], pace[1], 0.0])) {
                        return None;
                    }
                } else if k > 0 {
                    let last = self.paces[self.axes * (k - 1) + axis];
                    let time = (since[0] + until[0], [since[1], since[2] + until[1], until[2]]);
                    let change = (now - before[axis], [-last[0], pace[0] - last[1], pace[1]]);
                    if [last, *pace] != [[0.0; 2]; 2] && !take.change(k - 1, time, change) {
                        return None;
                    }
                }
                if at_rest[1] {
                    let time = (whole[0], [whole[1], whole[2], 0.0]);
                    if *pace != [0.0; 2] && !take.change(k, time, (-now, [-pace[0], -pace[1], 0.0])) {
                        return None;
                    }
                }
                before[axis] = now;
            }
            (since, root) = (if at_rest[0] { [0.0; 3] } else { half }, next);
        }
        Some(sum)
    }
}
