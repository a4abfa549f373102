//! What the rounds of the loop found, and which plan is better.

use metrology::ScallopRule;
use serde::Serialize;

use super::SLACK;

/// A plan that does not hold the target is in vain unless it takes this share of what the best one leaves
/// above it.
const LEAST_GAIN: f64 = 0.1;

/// A plan that takes this share of it gains much: a few more of its kind take all that can be seen.
const MUCH: f64 = 0.5;

/// What a round of the loop found.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct CorrectionRound {
    /// The highest ridge, mm.
    pub highest_mm: f64,
    /// The highest remnant along a border, mm; `None` where only what is highest of all was sought, and that
    /// is a ridge.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub border_mm: Option<f64>,
    /// Bound of the error of the higher one of both; `None` where it is a border that was looked at in places
    /// only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error_bound_mm: Option<f64>,
    /// Half of the ridge length is lower, mm; `None` where cells are too coarse for it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub median_mm: Option<f64>,
    /// Share of the ridge length above the target; `None` likewise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub over_target_fraction: Option<f64>,
    /// Length of all moves that feed along passes, mm.
    pub cutting_length_mm: f64,
    /// Least and greatest factor of the widths that the round was planned with.
    pub factors: [f64; 2],
    /// How much nearer than asked the tool comes to anything between passes, mm; `None` where it keeps clear.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub too_near_between_mm: Option<f64>,
    /// The highest place that another plan may leave lower, mm. What is higher is left by every path.
    #[serde(skip)]
    pub avoidable_mm: f64,
    /// Whether all was measured as the verdict is, and not ridges alone on cells that just show them. A plan
    /// that differs from the best one before by the ends of its passes only has the figures of that one, and so
    /// has one that comes out as an earlier one.
    pub measured: bool,
    /// Whether what no cell sees was left out: no less stands with it, and the plan before was better already.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub of_cells_alone: bool,
}

/// The rounds of the loop.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct CorrectionFigures {
    /// What no ridge may exceed, mm.
    pub target_mm: f64,
    /// All rounds, in order.
    pub rounds: Vec<CorrectionRound>,
    /// The round whose plan was kept, counted from 1.
    pub kept: usize,
}

/// What the loop is after.
#[derive(Debug, Clone, Copy)]
pub(super) struct Goal {
    /// The scallop height of the plan, mm.
    pub target: f64,
    /// Which ridges may exceed it.
    pub rule: ScallopRule,
    /// Whether every path of the cutter leaves more than the target somewhere.
    pub is_hopeless: bool,
}

impl CorrectionRound {
    /// What is highest of all that another plan may leave lower, mm.
    pub fn highest(&self) -> f64 {
        self.border_mm.map_or(self.ridge(), |border| border.min(self.avoidable_mm).max(self.ridge()))
    }

    /// The highest ridge likewise, mm.
    pub(super) fn ridge(&self) -> f64 {
        self.highest_mm.min(self.avoidable_mm)
    }

    /// Whether a remnant along a border is higher than every ridge.
    pub fn is_on_border(&self) -> bool {
        self.highest() > self.ridge()
    }

    /// As it is told: with what every path leaves.
    pub(super) fn told(&self) -> Self {
        Self { avoidable_mm: f64::INFINITY, ..*self }
    }

    /// The bound of the highest, mm, where that is the highest of all.
    fn bound(&self) -> Option<f64> {
        self.error_bound_mm.filter(|_| self.highest() == self.told().highest())
    }

    /// Whether ridges exceed the target no more than they may.
    pub(super) fn holds(&self, goal: &Goal) -> bool {
        self.highest() + self.margin(goal.target) <= goal.rule.highest * goal.target
            && (goal.rule.share >= 1.0
                || self.over_target_fraction.is_some_and(|over| over <= 1.0 - goal.rule.share))
    }

    /// The bound of the highest, mm, where keeping clear of it costs little: a wider one is to be refined
    /// instead, as it is when all is measured.
    pub fn margin(&self, target: f64) -> f64 {
        let bound = self.bound().filter(|bound| self.measured && *bound <= SLACK * target);
        bound.unwrap_or(0.0)
    }

    /// Whether this round is to be kept instead of another: first what keeps clear between passes, then what
    /// holds the target, then what is shorter; where neither holds it, the one with the lower ridge, unless that
    /// takes little off and the other's is as high within its bound: then what is shorter as well. Where no path
    /// holds it, the one that leaves fewer ridges above it.
    pub(super) fn is_better(&self, other: &Self, goal: &Goal) -> bool {
        let clear = [self, other].map(|round| round.too_near_between_mm.is_none());
        if clear[0] != clear[1] {
            return clear[0];
        }
        match (self.holds(goal), other.holds(goal)) {
            (true, true) => self.cutting_length_mm < other.cutting_length_mm,
            (false, false) if goal.is_hopeless && self.over_target_fraction != other.over_target_fraction => {
                self.over_target_fraction < other.over_target_fraction
            }
            (false, false)
                if self.cutting_length_mm != other.cutting_length_mm && self.is_as_high(other, goal) =>
            {
                self.cutting_length_mm < other.cutting_length_mm
            }
            (false, false) => self.highest() < other.highest(),
            (holds, _) => holds,
        }
    }

    /// Whether this round and another, which do not hold the target, leave as much: the higher one within the bound
    /// of the lower one, which takes no more off than a plan in vain.
    fn is_as_high(&self, other: &Self, goal: &Goal) -> bool {
        let (low, high) = if self.highest() < other.highest() { (self, other) } else { (other, self) };
        let bound = low.bound().filter(|_| low.measured && high.measured);
        bound.is_some_and(|bound| high.highest() - low.highest() <= bound)
            && !low.takes(LEAST_GAIN, high, goal)
    }

    /// Whether this round takes a share of what another one leaves above the target.
    fn takes(&self, share: f64, other: &Self, goal: &Goal) -> bool {
        let above = |round: &Self| match round.over_target_fraction.filter(|_| goal.is_hopeless) {
            Some(over) => over,
            None => round.highest() + round.margin(goal.target) - goal.target,
        };
        self.holds(goal) || above(self) <= (1.0 - share) * above(other)
    }

    /// Whether this round takes a share worth another plan of what another one leaves highest above the target, or
    /// of the ridges that it leaves there.
    pub(super) fn takes_something(&self, other: &Self, goal: &Goal) -> bool {
        let takes = |is_hopeless: bool| self.takes(LEAST_GAIN, other, &Goal { is_hopeless, ..*goal });
        takes(false) || takes(true) && other.over_target_fraction.is_some_and(|over| over > 0.0)
    }

    /// What a plan gains over the best one before it.
    pub(super) fn gain_over(&self, best: &Self, goal: &Goal) -> Gain {
        match self.is_better(best, goal) {
            false => Gain::None,
            true if self.takes(MUCH, best, goal) => Gain::Much,
            true if self.takes(LEAST_GAIN, best, goal) => Gain::Enough,
            true => Gain::Little,
        }
    }
}

/// What a plan gains over the best one before it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Gain {
    /// The one before is kept.
    None,
    /// The new one is kept, but another of its kind would be in vain.
    Little,
    /// The new one is kept, and another of its kind may gain as well.
    Enough,
    /// The same, and it took most of what the one before left.
    Much,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_holds_the_target_is_better_and_then_what_is_shorter() {
        let round = |highest_mm: f64, cutting_length_mm: f64| CorrectionRound {
            highest_mm,
            border_mm: None,
            error_bound_mm: Some(0.1),
            median_mm: Some(0.9),
            over_target_fraction: Some(if highest_mm > 1.0 { 0.02 } else { 0.0 }),
            cutting_length_mm,
            factors: [1.0; 2],
            too_near_between_mm: None,
            avoidable_mm: f64::INFINITY,
            measured: true,
            of_cells_alone: false,
        };
        let strict = Goal { target: 1.0, rule: ScallopRule::default(), is_hopeless: false };
        let better = |a: CorrectionRound, b: CorrectionRound| a.is_better(&b, &strict);
        assert!(better(round(0.8, 20.0), round(1.05, 10.0)) && !better(round(1.05, 10.0), round(0.8, 20.0)));
        assert!(better(round(0.8, 9.0), round(0.7, 10.0)) && better(round(1.1, 20.0), round(1.2, 10.0)));
        // No ridge is a reason to keep what collides.
        let colliding = |round| CorrectionRound { too_near_between_mm: Some(3.0), ..round };
        assert!(better(round(1.2, 20.0), colliding(round(0.8, 10.0))));
        assert!(!better(colliding(round(0.8, 10.0)), round(1.2, 20.0)));
        assert!(better(colliding(round(0.8, 9.0)), colliding(round(0.7, 10.0))));
        // Where neither holds the target and one is as high as the other within its bound, what is shorter.
        assert!(better(round(1.2, 10.0), round(1.19, 20.0)) && !better(round(1.19, 20.0), round(1.2, 10.0)));
        let close = |round| CorrectionRound { error_bound_mm: Some(0.005), ..round };
        assert!(better(close(round(1.19, 20.0)), close(round(1.2, 10.0))));
        let by_ridges = |round| CorrectionRound { measured: false, ..round };
        assert!(better(by_ridges(round(1.19, 20.0)), by_ridges(round(1.2, 10.0))));
        // A tenth of what stands above the target is worth another plan of its kind; less is kept, but no
        // reason to go on.
        let gain = |a: CorrectionRound, b: CorrectionRound| a.gain_over(&b, &strict);
        assert_eq!(gain(round(1.2, 10.0), round(1.2, 10.0)), Gain::None);
        assert_eq!(gain(round(1.199, 10.0), round(1.2, 10.0)), Gain::Little);
        assert_eq!(gain(round(1.17, 10.0), round(1.2, 10.0)), Gain::Enough);
        assert_eq!(gain(round(1.09, 10.0), round(1.2, 10.0)), Gain::Much);
        assert_eq!(gain(round(0.99, 20.0), round(1.001, 10.0)), Gain::Much);
        // What the scene lets stand above the target is no reason for another plan.
        let lenient = |share: f64, highest: f64| Goal { rule: ScallopRule { share, highest }, ..strict };
        assert!(round(1.2, 10.0).holds(&lenient(0.95, 1.5)) && !round(1.2, 10.0).holds(&strict));
        assert!(
            !round(1.2, 10.0).holds(&lenient(0.99, 1.5)) && !round(1.2, 10.0).holds(&lenient(0.95, 1.15))
        );
    }
}
