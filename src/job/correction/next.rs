//! What is tried after a plan: deeper moves, short passes, narrower or wider intervals.

use std::collections::BTreeSet;

use geometry::Point3;
use metrology::path_figures;
use motion::ROUNDING;
use toolpath::short_passes;

use super::widths::{HighPlace, MOST_NARROWED, Widths, aim};
use super::{Corrected, NEVER_CUT, Tried};

/// Moves go deeper until what is known of the ridges stands no higher than this share of the target: between
/// the places that are known they rise by about as much as that leaves.
const LOWERED_TO: f64 = 0.985;

/// Where moves go deeper later, widths leave this share of what they can: ridges of a new plan stand at other
/// heights.
const LOWERED_LATER: f64 = 0.4;

/// Ridges are about equally high where half of their length stands no lower than this share of the highest.
pub(super) const EVENLY_HIGH: f64 = 0.95;

/// A plan that was widened in vain is corrected where it stands above the target by no more than this share.
const WORTH_FOLLOWING: f64 = 0.2;

/// Plans in vain whose high places are narrowed in the next one.
const MOST_FOLLOWED: usize = 1;

/// Plans in vain after which no other is made. Behind those that are followed, all is narrowed in proportion.
const MOST_IN_VAIN: usize = MOST_FOLLOWED + 3;

/// A plan is as it was where its length changed by no more than this share of what its widths did.
const AS_BEFORE: f64 = 0.01;

/// A cube with the edge of an interval takes at most so many intervals of a pass of its own under a cutter
/// that leans.
const TOUCH_UP_LENGTH: f64 = 3.0;

/// Passes of their own and the ways to them are no longer in all than this share of the path.
const MOST_TOUCH_UP: f64 = 0.04;

/// The same where narrower passes were in vain.
const MOST_TOUCH_UP_IN_VAIN: f64 = 0.1;

impl Corrected<'_> {
    /// The widths to try next. A plan that stands too high gets deeper moves where that is enough, and
    /// narrower widths elsewhere; one that is too low gets wider ones. Levels are placed anew in each plan,
    /// so that other places may stand too high then: these are narrowed as well, from the last plan on. Last
    /// of all everything is narrowed in proportion, where once may be enough, to which remnants along borders
    /// give way only by another pass. `None` where the best plan holds the target and comes within `slack` of
    /// it, where it is far off in many places, or where what there is was tried `in_vain`.
    pub(super) fn next(&self, in_vain: usize, slack: f64) -> Option<Widths> {
        let (target, round) = (self.goal.target, &self.tried.standing.round);
        if self.is_far_off() {
            return self.far_off_served(in_vain);
        }
        if self.session.rest_follows(self.request) {
            let near = self.standing_near(&self.tried);
            let may_help = in_vain == 0 && !round.holds(&self.goal);
            return may_help.then(|| self.lowered(&self.tried.widths, &near)).flatten();
        }
        let last = self.latest.as_ref().unwrap_or(&self.tried);
        let in_proportion = || {
            let round = &last.standing.round;
            // Few remnants along borders take passes of their own once the ridges hold.
            let ridges_fail = round.ridge() + round.margin(target) > target;
            let height = if ridges_fail { round.ridge() } else { round.highest() };
            let may_help = height * MOST_NARROWED.powi(2) <= target && (ridges_fail || self.is_as_before());
            may_help.then(|| self.scaled(&last.widths, height))
        };
        match (round.holds(&self.goal), in_vain) {
            (true, 0) => (round.highest() < (1.0 - slack) * target && self.may_lie_wider())
                .then(|| self.scaled(&self.tried.widths, round.highest()))
                .filter(|wider| !self.was_too_wide(wider)),
            (true, 1) => {
                let worth =
                    |latest: &&Tried| latest.standing.round.highest() <= (1.0 + WORTH_FOLLOWING) * target;
                self.latest.as_ref().filter(worth).and_then(|latest| self.corrected(latest, in_vain))
            }
            (false, 0) => self.corrected(&self.tried, in_vain).or_else(in_proportion),
            (false, ..=MOST_FOLLOWED) => self.corrected(last, in_vain).or_else(in_proportion),
            // Where all ridges hold, few places along borders are left.
            (false, ..=MOST_IN_VAIN) => in_proportion()
                .or_else(|| self.corrected(last, in_vain).filter(|_| self.may_reach_best(in_vain))),
            _ => None,
        }
    }

    /// Whether the plans that are left may come as low as the best one. Not where each takes as much as the last
    /// one took of the one before, both in vain, and where that is not enough.
    fn may_reach_best(&self, in_vain: usize) -> bool {
        let left = (MOST_IN_VAIN + 1).saturating_sub(in_vain) as f64;
        let best = self.tried.standing.round.highest();
        let last = self.rounds.last_chunk::<2>().filter(|both| both.iter().all(|round| round.measured));
        last.is_none_or(|[before, last]| falls_to(best, [before.highest(), last.highest()], left))
    }

    /// Few places that stand too high get passes of their own, once, or else those that were never cut.
    /// `None` where these are many, which nearer passes do not cut either, or where the plan cuts far too
    /// deep.
    fn far_off_served(&self, in_vain: usize) -> Option<Widths> {
        let Tried { widths, standing, .. } = &self.tried;
        if in_vain > 0 || !standing.round.measured || self.is_far_too_deep() {
            return None;
        }
        let high = above_target(&self.standing_near(&self.tried));
        let never_cut = |place: &&HighPlace| place.over > (NEVER_CUT - 1.0) * self.goal.target;
        let never_cut = high.iter().filter(never_cut).copied().collect();
        [high, never_cut].into_iter().find_map(|places: Vec<HighPlace>| {
            let is_new = !places.is_empty() && !places.iter().any(|place| widths.is_touched_up(place));
            (is_new && self.are_few(&places, &self.tried, true)).then(|| widths.touched_up(&places))
        })
    }

    /// Whether the best plan may hold the target with wider intervals, by one pass less at least: where
    /// ridges are about equally high, passes are spread evenly, and each interval then grows by as much as
    /// all of them.
    fn may_lie_wider(&self) -> bool {
        let round = &self.tried.standing.round;
        // What others cut before tells nothing of its own passes; where they leave ground to others, walls
        // are not looked at. Without ridges there is nothing to tell by.
        let tells_nothing = self.request.stock_is_previous || round.highest_mm == 0.0;
        if tells_nothing || self.best.plan.kept.faces.most < 1.0 {
            return false;
        }
        let is_even = round.median_mm.is_some_and(|median| median >= EVENLY_HIGH * round.highest());
        let intervals = path_figures(&self.best.plan.path, 0.0).passes as f64 - 1.0;
        !is_even || round.highest() * (intervals / (intervals - 1.0)).powi(2) <= self.goal.target
    }

    /// Whether a plan with widths nowhere greater stood above the target.
    fn was_too_wide(&self, widths: &Widths) -> bool {
        let [least, _] = widths.correction().range();
        self.rounds.iter().any(|round| !round.holds(&self.goal) && round.factors[1] <= least)
    }

    /// Widths that bring a height to the one that is aimed at, all by the same factor: where the last ones
    /// left the plan as it was, by half of what surely adds a pass.
    fn scaled(&self, widths: &Widths, height: f64) -> Widths {
        let factor = (self.brought_to(widths, height) / height).sqrt();
        let passes = path_figures(&self.best.plan.path, 0.0).passes as f64;
        let one_more = if self.is_as_before() { ((passes - 1.0) / passes).sqrt() } else { 1.0 };
        widths.scaled(if factor < 1.0 { factor.min(one_more).max(MOST_NARROWED) } else { factor })
    }

    /// The height, mm, that widths are to bring another to: deeper moves take what is left then, unless they
    /// did already.
    fn brought_to(&self, widths: &Widths, height: f64) -> f64 {
        let aim = aim(self.goal.target);
        let is_left = self.session.may_lower(self.request) && widths.lowered.is_empty();
        let left = if is_left { LOWERED_LATER * self.room().max(0.0) } else { 0.0 };
        if height > aim + left { aim + left } else { aim }
    }

    /// Whether other widths changed no more than the ends of passes: few are spread over a part.
    fn is_as_before(&self) -> bool {
        self.rounds.last_chunk::<2>().is_some_and(|[a, b]| {
            let [least, most] = changes(b.factors, a.factors);
            are_ends_alone(least.max(most), b.cutting_length_mm / a.cutting_length_mm)
        })
    }

    /// The widths of a plan corrected by the places where it leaves too much: by deeper moves, and by passes
    /// of their own for few that stand too high for that, once. Many get narrower widths, all of the plan
    /// where they stand little above the target. `None` without such places.
    fn corrected(&self, tried: &Tried, in_vain: usize) -> Option<Widths> {
        let Tried { widths, .. } = tried;
        let near = self.standing_near(tried);
        let high = above_target(&near);
        if high.is_empty() {
            return None;
        }
        let deep: Vec<HighPlace> =
            high.iter().filter(|place| !self.may_lower(widths, place)).copied().collect();
        let lowered = self.lowered(widths, &near);
        if deep.is_empty() {
            return lowered;
        }
        let lowered = lowered.unwrap_or_else(|| widths.clone());
        // Where a measurement finds others beside those that were served, there are more to come.
        let measured = self.rounds.iter().filter(|round| round.measured).count();
        let was_served = measured > 1
            && !self.is_near(tried)
            && tried.standing.round.measured
            && !widths.touch_up.is_empty();
        let is_served =
            |places: &[HighPlace]| was_served || places.iter().any(|place| widths.is_touched_up(place));
        // Along borders narrower widths may change nothing.
        let is_left = tried.standing.round.is_on_border() && self.is_as_before();
        let is_worth = self.are_few(&deep, tried, in_vain > 0) || is_left && tried.standing.round.measured;
        if is_worth && !is_served(&deep) {
            return Some(lowered.touched_up(&deep));
        }
        let round = &tried.standing.round;
        if self.is_near(tried) && !round.is_on_border() {
            return Some(self.scaled(widths, round.ridge()));
        }
        Some(widths.narrowed(&high))
    }

    /// How much deeper moves may go, mm.
    fn room(&self) -> f64 {
        self.session.room(self.request)
    }

    /// Widths with deeper moves beside the places where that is enough; `None` without such places.
    fn lowered(&self, widths: &Widths, near: &[HighPlace]) -> Option<Widths> {
        let may_lower = |place: &&HighPlace| self.may_lower(widths, place);
        let shallow: Vec<HighPlace> = near.iter().filter(may_lower).copied().collect();
        (!shallow.is_empty()).then(|| widths.lowered(&shallow, self.room()))
    }

    /// Whether moves beside a place can go as much deeper as it stands too high.
    fn may_lower(&self, widths: &Widths, place: &HighPlace) -> bool {
        self.session.may_lower(self.request)
            && widths.depth_at(place) + place.over.max(0.0) + 2.0 * ROUNDING <= self.room()
    }

    /// Whether places take so little that passes of their own are shorter than a plan with all passes nearer
    /// to each other, or than may be where such plans were in vain.
    fn are_few(&self, places: &[HighPlace], tried: &Tried, is_in_vain: bool) -> bool {
        let Widths { interval, .. } = tried.widths;
        let planned = &tried.kept.passes;
        // What a pass takes beside its length, as those of the plan do on average.
        let figures = path_figures(&self.best.plan.path, 0.0);
        // One pass, as a spiral's, is left for others only where narrower ones were in vain.
        if figures.passes == 1 && !is_in_vain {
            return false;
        }
        let off_pass = (figures.link_length_mm + figures.air_length_mm) / figures.passes.max(1) as f64;
        let whole = figures.cutting_length_mm + figures.link_length_mm + figures.air_length_mm;
        let round = &tried.standing.round;
        let nearer = (round.highest() / aim(self.goal.target)).sqrt() - 1.0;
        let share = if is_in_vain { MOST_TOUCH_UP_IN_VAIN } else { nearer.min(MOST_TOUCH_UP) };
        let mut left = share * whole;
        let mut fits = |length: f64| {
            left -= length + off_pass;
            left >= 0.0
        };
        if planned.is_empty() {
            let cell = |at: &Point3| at.coords.map(|x| (x / interval).floor() as i64);
            let cells: BTreeSet<[i64; 3]> = places.iter().map(|place| cell(&place.at).into()).collect();
            cells.iter().all(|_| fits(TOUCH_UP_LENGTH * interval))
        } else {
            // Many places would take long to be served: the first of them are enough to tell.
            let axes = places.iter().map(|place| place.tip.xy()).collect();
            short_passes(planned, axes, interval).all(fits)
        }
    }

    /// The places of a plan that come near the target.
    fn standing_near(&self, Tried { standing, widths, .. }: &Tried) -> Vec<HighPlace> {
        let cutter = &self.request.tooling.cutter;
        let target = self.goal.target;
        let margin = standing.round.margin(target);
        let places = standing.above.iter().map(|&(at, height)| {
            let normal = self.session.part.closest_point(&at).0.normal;
            HighPlace {
                at,
                normal,
                top: at + normal * height,
                tip: at + cutter.contact_to_tip(&normal),
                over: height + margin - target,
                deeper: height + margin - LOWERED_TO * target,
                factor: self.brought_to(widths, height) / height,
            }
        });
        places.filter(|place| place.deeper > 0.0).collect()
    }
}

/// Whether a height that fell from one plan to the next comes down to another in so many more, falling by as
/// much in each. Where it rose that tells nothing: what stands there was not looked at before.
fn falls_to(height: f64, [before, last]: [f64; 2], plans: f64) -> bool {
    last >= before || last - plans * (before - last) <= height
}

/// The places that may stand above the target.
fn above_target(near: &[HighPlace]) -> Vec<HighPlace> {
    near.iter().filter(|place| place.over > 0.0).copied().collect()
}
/// By which share the least and the greatest width of a plan differ from those of another.
pub(super) fn changes(factors: [f64; 2], others: [f64; 2]) -> [f64; 2] {
    [0, 1].map(|k| (factors[k] / others[k] - 1.0).abs())
}

/// Whether widths that differ by this share, on a path this many times as long, changed no more than the ends
/// of passes.
pub(super) fn are_ends_alone(widths: f64, length: f64) -> bool {
    widths > 0.0 && (length - 1.0).abs() <= AS_BEFORE * widths
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plans_in_vain_go_on_while_they_may_come_down_to_the_best() {
        // Narrower passes took a tenth of a wall in a round: two more do not take the rest.
        assert!(!falls_to(0.94, [2.62, 2.40], 2.0));
        assert!(falls_to(0.94, [2.62, 1.70], 2.0) && falls_to(0.94, [2.62, 2.05], 2.0));
        // No plan tells the trend yet.
        assert!(falls_to(0.94, [0.95, 2.62], 3.0) && falls_to(0.94, [2.40, 2.40], 1.0));
    }
}
