//! The loop: plan, cut, measure the ridges, and plan again with passes nearer to each other where ridges
//! stand above the target, or all farther apart where none comes near it.
//!
//! Enters: a toolpath that is planned by a scallop height. Leaves: the best of a few plans with its
//! measurement, and what each round found.
//!
//! Moves go a little deeper beside places that stand a little too high, as far as the chord tolerance and the
//! gouge tolerance allow. All passes stay where they are then, and nothing can rise. Plans that can be
//! corrected so are made as if chords raised nothing. Few places that stand higher get short passes of their
//! own, which leave all others where they are as well. Else levels are placed anew, narrower around the
//! places that stood too high, of functions that are kept from round to round. Where many stand little above
//! the target, the widths of the whole plan are scaled, which leaves its passes in shape; so they are where
//! narrowing does not help. Nothing is narrowed for a place where every path of the cutter leaves too much, nor
//! beside it; last of all, passes along such places take down what can be.
//!
//! Where an engine tells ridges apart, the first rounds measure no more than those, on cells as coarse as
//! show every pass. Then all is measured as the verdict is; what still stands above the target then is
//! corrected as well.

mod hollows;
mod looking;
mod next;
mod round;
mod standing;
mod widths;

use std::sync::Arc;

use metrology::{Engine, Measured, RidgeMap, Task};
use scene::ToolpathRequest;
use toolpath::{Earlier, Faces, Kept, Step, plane_interval};
use work::monitor::{self, Cancelled, Monitor};

use super::covered::Covered;
use super::earlier::EarlierPath;
use super::figures::{LeastLeftFigures, Violated};
use super::measuring::Closeness;
use super::planned::Planned;
use super::tool::Around;
use super::{JobError, Session};
use hollows::Hollows;
pub(crate) use looking::Looked;
use next::{EVENLY_HIGH, are_ends_alone, changes};
pub(crate) use round::{CorrectionFigures, CorrectionRound};
use round::{Gain, Goal};
use standing::{Cut, Standing, Wanted, cutting_length, digest, too_near};
use widths::Widths;

/// Most plans that are made while only ridges are measured.
const MOST_ROUNDS: usize = 6;

/// A plan whose highest ridge is within this share above the target is near to holding it.
const NEAR: f64 = 0.06;

/// Most plans that are made again after all was measured: each costs as much as the whole run without
/// correction.
const MOST_MEASURED: usize = 3;

/// The same while the best plan stands above the target by no more than [`NEAR`], or the last one took most
/// of what the one before left.
const MOST_MEASURED_NEAR: usize = 8;

/// A plan whose highest ridge is within this share below the target is as wide as it should be. What is
/// corrected is aimed at the middle of it, since points and chords of a new plan lie elsewhere.
const SLACK: f64 = 0.02;

/// Functions are gone on with where more than this share of the ridges stands above the target: halving intervals for
/// them takes twice as many passes there.
const MANY: f64 = 0.02;

/// As [`SLACK`] where all has to be measured to see whether a wider plan holds, or where ridges are known
/// less closely. With less, whole measurements are spent on a few per cent of length.
const MEASURED_SLACK: f64 = 0.2;

/// What stands more times as high as the target is no matter of widths. Two rounds take an interval to a
/// quarter by [`MOST_NARROWED`], and ridges to a sixteenth: what is higher was never cut, and plans by other
/// widths do not cut it either. They cut no less deep either where a plan cuts deeper by as many times than
/// it may.
const NEVER_CUT: f64 = 16.0;

/// A plan that was tried.
struct Tried {
    /// What it was planned by.
    widths: Widths,
    /// What it leaves.
    standing: Standing,
    /// What its strategy made.
    kept: Arc<Kept>,
}

/// A plan that was made, as far as others by the same widths or with the same path are told by it.
struct Made {
    widths: Widths,
    /// A digest of its moves.
    path: u64,
    standing: Standing,
}

/// The loop over one toolpath.
struct Corrected<'a> {
    session: &'a Session,
    request: &'a ToolpathRequest,
    /// What cuts the stock before it.
    earlier: &'a [EarlierPath],
    around: Around<'a>,
    engine: &'a dyn Engine,
    goal: Goal,
    /// How closely plans are measured which may be planned better.
    closeness: Closeness,
    /// The best plan, and how it was tried.
    best: Planned,
    tried: Tried,
    /// How the last plan was tried, where that is not the best one.
    latest: Option<Tried>,
    /// What a plan that holds the target was planned by, as far as ridges tell, before a wider one took its
    /// place.
    narrower: Option<Widths>,
    /// What the best plan was planned by before passes of its own came to it, as far as ridges told.
    untouched: Option<Widths>,
    rounds: Vec<CorrectionRound>,
    /// The round of the best plan.
    kept: usize,
    /// The plans so far.
    made: Vec<Made>,
    /// Whether places where its passes leave too much were sought beside those that ridges on coarse cells
    /// show.
    is_complete: bool,
    /// Where every path of the cutter leaves more than the target, if that is so somewhere.
    hollows: Option<Hollows<'a>>,
}

impl Session {
    /// Plans, cuts and measures one toolpath behind `earlier` ones, in rounds where what is left is to be
    /// corrected.
    pub(crate) fn plan_and_measure(
        &self,
        request: &ToolpathRequest,
        earlier: &[EarlierPath],
        around: Around<'_>,
        engine: &dyn Engine,
        monitor: &dyn Monitor,
    ) -> Result<(Planned, Measured, Option<Covered>), JobError> {
        let target = match self.aimed_at(request) {
            Step::Scallop(target) if request.correct => Some(target),
            _ => None,
        };
        let first = self.plan_way(request, around, None, monitor)?;
        let map = match target {
            // Between its stretches stands what others left: its moves alone do not tell how high.
            Some(_) if !request.is_for_places() => self.ridges(request, engine, &first, monitor)?,
            _ => None,
        };
        let closeness = target.map_or(Closeness::Verdict, |target| Closeness::Plan {
            within: SLACK * target,
            limit: self.scene.scallop_rule.highest * target,
            allowed_depth: 0.0,
        });
        let whole = |planned: &Planned, closeness| {
            self.look(request, earlier, engine, &planned.plan.path, closeness, monitor)
        };
        let wanted = |target, behind_others| self.wanted(request, target, behind_others);
        let of_ridges = |(map, target)| Standing::of_ridges(map, &first, [1.0; 2], wanted(target, false));
        let (looked, standing) = match map.as_ref().zip(target).and_then(of_ridges) {
            Some(standing) => (None, Some(standing)),
            None => {
                let looked = whole(&first, closeness)?;
                let has_ridges = looked.measured.measurement.scallop.max_mm.is_some();
                let of_all = |target| {
                    let wanted = wanted(target, !earlier.is_empty());
                    let standing = Standing::of_all(&looked, &first, [1.0; 2], wanted);
                    (has_ridges || standing.round.highest() > target).then_some(standing)
                };
                let standing = target.and_then(of_all);
                (Some(looked), standing)
            }
        };
        let (Some(target), Some(standing)) = (target, standing) else {
            let Looked { measured, covered, .. } = match looked {
                Some(looked) if looked.is_as_verdict => looked,
                _ => whole(&first, Closeness::Verdict)?,
            };
            return Ok((self.with_feeds(request, first, monitor)?, measured, covered));
        };
        let interval = plane_interval(&request.tooling.cutter, request.step);
        let widths = Widths::by_calculation(interval);
        let rounds = vec![standing.round];
        let tried = Tried { widths, standing, kept: first.plan.kept.clone() };
        let mut corrected = Corrected {
            session: self,
            request,
            earlier,
            around,
            engine,
            goal: Goal { target, rule: self.scene.scallop_rule, is_hopeless: false },
            closeness,
            best: first,
            tried,
            latest: None,
            narrower: None,
            untouched: None,
            rounds,
            kept: 0,
            made: Vec::new(),
            is_complete: false,
            hollows: None,
        };
        corrected.remember_best();
        let looked = match looked {
            Some(looked) => looked,
            None => {
                corrected.by_ridges(map.map_or(MEASURED_SLACK, |map| slack_of(&map)), monitor)?;
                corrected.look_at_best(closeness, None, monitor)?
            }
        };
        let looked = corrected.unless_touched_up_too_deep(looked, monitor)?;
        let Looked { measured, covered, .. } = corrected.by_measurements(looked, monitor)?;
        let Corrected { mut best, rounds, kept, .. } = corrected;
        let rounds = rounds.iter().map(CorrectionRound::told).collect();
        best.correction = Some(CorrectionFigures { target_mm: target, rounds, kept: kept + 1 });
        // Plans are compared by what they leave and by their lengths: of feeds only those of the best one are told.
        let best = self.with_feeds(request, best, monitor)?;
        Ok((best, measured, covered))
    }
}

impl<'a> Corrected<'a> {
    fn wanted(&self, measured: bool) -> Wanted<'_> {
        let behind_others = measured && !self.earlier.is_empty();
        self.session.wanted(self.request, self.goal.target, behind_others)
    }

    /// Plans anew while ridges on coarse cells stand above the target, or all below it by more than the
    /// `slack`.
    fn by_ridges(&mut self, mut slack: f64, monitor: &dyn Monitor) -> Result<(), JobError> {
        self.seek_hollows_by_ridges(monitor)?;
        let mut in_vain = 0;
        while self.rounds.len() < MOST_ROUNDS
            && let Some(next) = self.next(in_vain, slack).filter(|_| !self.ends_in_vain(in_vain))
        {
            let next = if in_vain == 0 { self.completed(next, slack, monitor)? } else { next };
            if self.was_made(&next, false) {
                in_vain += 1;
                continue;
            }
            let (planned, factors) = self.plan(&next, monitor)?;
            let gain = if let Some(found) = self.as_before(&planned, factors, false) {
                self.keep_best(&planned, next, found)
            } else {
                let map = self.session.ridges(self.request, self.engine, &planned, monitor)?;
                slack = map.as_ref().map_or(slack, |map| slack.max(slack_of(map)));
                let found =
                    map.and_then(|map| Standing::of_ridges(&map, &planned, factors, self.wanted(false)));
                let Some(mut found) = found else { break };
                self.set_hollows_aside(&mut found, monitor)?;
                let gain = found.round.gain_over(&self.tried.standing.round, &self.goal);
                self.keep_if(gain, planned, next, found);
                gain
            };
            in_vain = if gain >= Gain::Enough { 0 } else { in_vain + 1 };
        }
        Ok(())
    }

    /// The `next` widths; where they leave all passes where they are, what stands too high beside the ridges
    /// that coarse cells show is served as well. Where most ridges stand near the target, finding that takes
    /// as long as measuring all.
    fn completed(&mut self, next: Widths, slack: f64, monitor: &dyn Monitor) -> Result<Widths, JobError> {
        let median = self.tried.standing.round.median_mm;
        let are_few_near = median.is_some_and(|median| median < EVENLY_HIGH * self.goal.target);
        if self.is_complete || !are_few_near || !next.is_alike(&self.tried.widths) {
            return Ok(next);
        }
        self.is_complete = true;
        let look = |task: &Task<'_>| self.engine.above(task, monitor);
        let others = self.session.on_coarse_cells(self.request, &self.best, look)?;
        let mut others: Vec<_> = others.iter().map(|place| (place.at, place.height)).collect();
        if let Some(hollows) = &mut self.hollows {
            hollows.taken_from(&mut others, monitor)?;
        }
        self.tried.standing.above.extend(others);
        // The others are no reason to place all passes anew.
        Ok(self.next(1, slack).unwrap_or(next))
    }

    /// Measures the plan before passes of its own came to it, where the best one cuts too deep: ridges alone
    /// do not tell how deep such passes cut.
    fn unless_touched_up_too_deep(
        &mut self,
        looked: Looked,
        monitor: &dyn Monitor,
    ) -> Result<Looked, JobError> {
        let is_too_deep = self.cut_of(&self.tried.standing) > Cut::Allowed;
        let Some(before) = self.untouched.take().filter(|_| is_too_deep) else { return Ok(looked) };
        // It cuts too deep. Two at a time might be more than the memory that the run may take.
        drop(looked);
        let (planned, factors) = self.plan(&before, monitor)?;
        let (again, found, gain) = self.compared(&planned, factors, false, monitor)?;
        self.keep_if(gain, planned, before, found);
        if gain == Gain::None { self.look_at_best(self.closeness, None, monitor) } else { Ok(again) }
    }

    /// Plans anew while what the verdict is made of stands above the target.
    fn by_measurements(&mut self, mut looked: Looked, monitor: &dyn Monitor) -> Result<Looked, JobError> {
        if looked.of_cells_alone && self.next(0, MEASURED_SLACK).is_some() {
            self.look_at_all_of_best(&mut looked, monitor)?;
        }
        self.seek_hollows(&looked, monitor)?;
        let (mut looked, mut in_vain, mut gain) = (Some(looked), 0, Gain::None);
        // What no cell sees of the best plan, once its cells gave way to another one's.
        let mut beside_cells = None;
        for round in 0..MOST_MEASURED_NEAR {
            if round >= MOST_MEASURED && gain < Gain::Much && !self.is_near(&self.tried) {
                break;
            }
            // Ridges alone did not show what stands far above the target.
            let fails = !self.tried.standing.round.holds(&self.goal) && !self.is_near(&self.tried);
            let narrower = self.narrower.take().filter(|_| round == 0 && fails && !self.is_far_off());
            let next = narrower.or_else(|| self.next(in_vain, MEASURED_SLACK));
            let Some(next) = next.filter(|_| !self.ends_in_vain(in_vain)) else { break };
            if self.was_made(&next, true) {
                in_vain += 1;
                continue;
            }
            let (planned, factors) = self.plan(&next, monitor)?;
            if let Some(found) = self.as_before(&planned, factors, true) {
                gain = self.keep_best(&planned, next, found);
            } else {
                let is_passing = looked.as_ref().is_some_and(|looked| self.session.passes(looked));
                // Two at a time might be more than the memory that the run may take.
                beside_cells = looked.take().and_then(Looked::beside_cells).or(beside_cells);
                let (again, found);
                (again, found, gain) = self.compared(&planned, factors, is_passing, monitor)?;
                self.keep_if(gain, planned, next, found);
                looked = (gain != Gain::None).then_some(again);
                beside_cells = beside_cells.filter(|_| gain == Gain::None);
            }
            in_vain = if gain >= Gain::Enough { 0 } else { in_vain + 1 };
        }
        if let Some(next) = self.along_creases(monitor)? {
            beside_cells = looked.take().and_then(Looked::beside_cells).or(beside_cells);
            looked = self.keep_if_something_sinks(next, monitor)?;
            beside_cells = beside_cells.filter(|_| looked.is_none());
        }
        let mut looked = match looked {
            Some(looked) if looked.is_as_verdict => looked,
            other => {
                drop(other);
                self.look_at_best(Closeness::Verdict, beside_cells, monitor)?
            }
        };
        self.look_at_all_of_best(&mut looked, monitor)?;
        Ok(looked)
    }

    /// Measures a plan, and tells what it gains over the best one. While cells fail, what they do not see is
    /// measured of a plan only that is better but for it: with it no less stands.
    fn compared(
        &mut self,
        planned: &Planned,
        factors: [f64; 2],
        is_passing: bool,
        monitor: &dyn Monitor,
    ) -> Result<(Looked, Standing, Gain), JobError> {
        let (session, path) = (self.session, &planned.plan.path);
        let closeness = self.closeness.compared(session.scene.tolerance.gouge);
        let mut looked = session.look(self.request, self.earlier, self.engine, path, closeness, monitor)?;
        let passes = [is_passing, session.passes(&looked)];
        let standing = |of: &mut Self, looked: &Looked| {
            let mut found = Standing::of_all(looked, planned, factors, of.wanted(true));
            of.set_hollows_aside(&mut found, monitor)?;
            Ok::<_, JobError>(found)
        };
        let mut found = standing(self, &looked)?;
        let mut gain = self.gain(&found, passes);
        if gain != Gain::None && looked.of_cells_alone {
            session.look_beside_cells(self.request, self.earlier, path, &mut looked, monitor)?;
            found = standing(self, &looked)?;
            gain = self.gain(&found, passes);
        }
        Ok((looked, found, gain))
    }

    /// What a plan gains over the best one, where `passes` tells of the best one and of this one whether it
    /// passes. A shorter path is no reason to give up a plan that passes, nor a lower ridge for one that cuts
    /// too deep or leaves more uncut.
    fn gain(&self, found: &Standing, passes: [bool; 2]) -> Gain {
        let (limits, best) = (&self.session.scene.tolerance, &self.tried.standing);
        let [cut, cut_before] = [found, best].map(|standing| self.cut_of(standing));
        let leaves_more = found.unreached > limits.uncut && best.unreached <= limits.uncut;
        match (passes, [best.is_never_cut, found.is_never_cut]) {
            ([false, true], _) => Gain::Much,
            ([true, false], _) | (_, [false, true]) => Gain::None,
            _ if cut > cut_before || leaves_more => Gain::None,
            (_, [true, false]) => Gain::Much,
            _ if cut < cut_before => Gain::Much,
            _ => found.round.gain_over(&best.round, &self.goal),
        }
    }

    /// Seeks places where every path of an upright cutter leaves more than the target, where a ridge tells of them.
    fn seek_hollows_by_ridges(&mut self, monitor: &dyn Monitor) -> Result<(), JobError> {
        let highest = self.tried.standing.above.iter().max_by(|a, b| a.1.total_cmp(&b.1)).copied();
        let limit = self.goal.rule.highest * self.goal.target;
        let is_alone = self.request.axis.is_none() && !self.request.stock_is_previous;
        let Some(highest) = highest.filter(|(_, height)| is_alone && *height > (1.0 + NEAR) * limit) else {
            return Ok(());
        };
        let mut hollows = self.hollows_of_part(monitor)?;
        let taken = hollows.taken_from(&mut self.tried.standing.above.clone(), monitor)?;
        // Over a border the cutter comes lower, so that the highest place may be none.
        let in_hollow = taken.into_iter().max_by(|a, b| a.1.total_cmp(&b.1));
        let near = |(at, height)| Violated::near(&self.session.part, &at, [height, limit]);
        let places: Vec<Violated> = [Some(highest), in_hollow].into_iter().flatten().map(near).collect();
        let cutter = self.request.tooling.cutter;
        if LeastLeftFigures::at_or_elsewhere(self.session, &[cutter], &places, monitor)?.is_some() {
            self.leave_hollows(hollows, monitor)?;
        }
        Ok(())
    }

    /// The same of what stands too high behind what cut before, where that was not done.
    fn seek_hollows(&mut self, looked: &Looked, monitor: &dyn Monitor) -> Result<(), JobError> {
        let (session, path) = (self.session, &self.best.plan.path);
        // What this toolpath leaves to others is no reason to leave its own faces as they are.
        let is_for_all = self.best.plan.kept.faces == Faces::ALL
            && !session.rest_follows(self.request)
            && !self.request.is_for_places();
        let is_behind = self.request.stock_is_previous;
        if self.hollows.is_some() || self.tried.standing.round.holds(&self.goal) || is_behind && !is_for_all {
            return Ok(());
        }
        let with = (&[self.request.tooling.cutter][..], is_behind);
        let least = |violated| LeastLeftFigures::above_limit(session, with, path, violated, monitor);
        let left = least(Violated::of(session, &looked.measured.measurement))?;
        let unseen = looked.covered.as_ref().and_then(|covered| covered.unseen.as_ref());
        let unseen = unseen.filter(|_| is_for_all && left.is_none());
        let left = left.or(unseen.map_or(Ok(None), |unseen| least(Violated::unseen(session, unseen)))?);
        if left.is_some() {
            let hollows = self.hollows_of_part(monitor)?;
            self.leave_hollows(hollows, monitor)?;
        }
        Ok(())
    }

    /// The widths of the best plan with passes of their own along hollows.
    fn along_creases(&mut self, monitor: &dyn Monitor) -> Result<Option<Widths>, JobError> {
        let is_for_others = self.session.rest_follows(self.request) || self.request.axis.is_some();
        let Some(hollows) = self.hollows.as_mut().filter(|_| !is_for_others) else { return Ok(None) };
        let lines = hollows.creases(&self.tried.standing.in_hollows, monitor)?;
        Ok((!lines.is_empty()).then(|| self.tried.widths.with_creases(lines)))
    }

    /// Plans the best plan with further passes, and keeps that where something stands lower: nothing can rise.
    fn keep_if_something_sinks(
        &mut self,
        next: Widths,
        monitor: &dyn Monitor,
    ) -> Result<Option<Looked>, JobError> {
        let (planned, factors) = self.plan(&next, monitor)?;
        let path = &planned.plan.path;
        let mut looked =
            self.session.look(self.request, self.earlier, self.engine, path, self.closeness, monitor)?;
        self.session.look_beside_cells(self.request, self.earlier, path, &mut looked, monitor)?;
        let found = Standing::of_all(&looked, &planned, factors, self.wanted(true));
        let best = &self.tried.standing;
        let sinks = self.cut_of(&found) <= self.cut_of(best)
            && found.round.told().takes_something(&best.round.told(), &self.goal);
        let gain = if sinks { Gain::Enough } else { Gain::None };
        self.keep_if(gain, planned, next, found);
        Ok(sinks.then_some(looked))
    }

    fn hollows_of_part(&self, monitor: &dyn Monitor) -> Result<Hollows<'a>, Cancelled> {
        Hollows::of(&self.session.part, &self.request.tooling.cutter, self.goal.target, monitor)
    }

    /// From now on, what stands in hollows is no reason for another plan.
    fn leave_hollows(&mut self, hollows: Hollows<'a>, monitor: &dyn Monitor) -> Result<(), Cancelled> {
        self.goal.is_hopeless = true;
        let hollows = self.hollows.insert(hollows);
        self.tried.standing.set_aside(hollows, self.goal.target, monitor)?;
        self.rounds[self.kept] = self.tried.standing.round;
        self.remember_best();
        Ok(())
    }

    /// Leaves of what a plan leaves what another one may leave lower.
    fn set_hollows_aside(&mut self, standing: &mut Standing, monitor: &dyn Monitor) -> Result<(), Cancelled> {
        let target = self.goal.target;
        self.hollows.as_mut().map_or(Ok(()), |hollows| standing.set_aside(hollows, target, monitor))
    }

    /// Whether no other plan is made: none holds the target, and the last one was no better, or nothing else
    /// stands too high.
    fn ends_in_vain(&self, in_vain: usize) -> bool {
        let limit = self.goal.rule.highest * self.goal.target;
        self.hollows.is_some() && (in_vain > 0 || self.tried.standing.round.highest() <= limit)
    }

    /// Whether a plan stands above the target, but little.
    fn is_near(&self, tried: &Tried) -> bool {
        let round = &tried.standing.round;
        !round.holds(&self.goal) && round.highest() <= (1.0 + NEAR) * self.goal.target
    }

    /// Whether the best plan leaves what was never cut, or cuts far too deep.
    fn is_far_off(&self) -> bool {
        self.tried.standing.round.highest() > NEVER_CUT * self.goal.target || self.is_far_too_deep()
    }

    fn is_far_too_deep(&self) -> bool {
        self.cut_of(&self.tried.standing) == Cut::FarTooDeep
    }

    fn cut_of(&self, standing: &Standing) -> Cut {
        Cut::of(standing.depth, self.session.scene.tolerance.gouge)
    }

    /// The plan by given widths, and their least and greatest factors.
    fn plan(&self, widths: &Widths, monitor: &dyn Monitor) -> Result<(Planned, [f64; 2]), JobError> {
        monitor::check(monitor)?;
        let correction = widths.correction();
        let factors = correction.range();
        let alike = self.latest.iter().chain([&self.tried]).find(|tried| tried.widths.is_alike(widths));
        let earlier = Earlier {
            correction,
            lowered: widths.lowered.clone(),
            touch_up: widths.touch_up.clone(),
            creases: widths.creases.clone(),
            kept: alike.unwrap_or(&self.tried).kept.clone(),
            anew: alike.is_none() && self.stands_high_in_many_places(),
            again: alike.is_some() && self.request.axis.is_none(),
        };
        Ok((self.session.plan_way(self.request, self.around, Some(Arc::new(earlier)), monitor)?, factors))
    }

    /// Whether each plan so far leaves many ridges above the target.
    fn stands_high_in_many_places(&self) -> bool {
        self.rounds.iter().all(|round| round.over_target_fraction.is_some_and(|over| over > MANY))
    }

    /// Measures the best plan, where no cell sees as well unless the rest fails for certain. What is `known` of that
    /// is as it was beside the same cells.
    fn look_at_best(
        &mut self,
        closeness: Closeness,
        known: Option<(Covered, f64)>,
        monitor: &dyn Monitor,
    ) -> Result<Looked, JobError> {
        let (session, path) = (self.session, &self.best.plan.path);
        let mut looked =
            session.look_at_cells(self.request, self.earlier, self.engine, path, closeness, monitor)?;
        match known.filter(|(_, cell)| looked.measured.cell == *cell) {
            Some((covered, _)) => (looked.covered, looked.of_cells_alone) = (Some(covered), false),
            None => {
                session.look_beside_unless_failed(self.request, self.earlier, path, &mut looked, monitor)?
            }
        }
        self.tell_of_best(&looked, monitor)?;
        Ok(looked)
    }

    /// Measures the best plan where no cell sees, unless that was done.
    fn look_at_all_of_best(&mut self, looked: &mut Looked, monitor: &dyn Monitor) -> Result<(), JobError> {
        if looked.of_cells_alone {
            let path = &self.best.plan.path;
            self.session.look_beside_cells(self.request, self.earlier, path, looked, monitor)?;
            self.tell_of_best(looked, monitor)?;
        }
        Ok(())
    }

    /// Puts what was measured of the best plan in place of what was known of it.
    fn tell_of_best(&mut self, looked: &Looked, monitor: &dyn Monitor) -> Result<(), JobError> {
        let factors = self.tried.standing.round.factors;
        let mut standing = Standing::of_all(looked, &self.best, factors, self.wanted(true));
        self.set_hollows_aside(&mut standing, monitor)?;
        self.rounds[self.kept] = standing.round;
        self.tried.standing = standing;
        self.remember_best();
        Ok(())
    }

    fn remember_best(&mut self) {
        let Tried { widths, standing, .. } = &self.tried;
        let (path, standing) = (digest(&self.best.plan.path), standing.clone());
        self.made.push(Made { widths: widths.clone(), path, standing });
    }

    /// Whether a plan by these very widths was looked at, and all that it leaves where that is `measured`.
    fn was_made(&self, widths: &Widths, measured: bool) -> bool {
        let is_known = |made: &Made| made.standing.round.measured || !measured;
        self.made.iter().any(|made| made.widths == *widths && is_known(made))
    }

    /// Whether all widths of a plan differ from those of the best, and no more than the ends of passes: they
    /// are spread over a part, a whole number of them, and it leaves what the best one leaves.
    fn is_left_as_before(&self, planned: &Planned, factors: [f64; 2]) -> bool {
        let before = &self.tried.standing.round;
        let [least, most] = changes(factors, before.factors);
        are_ends_alone(least.min(most), cutting_length(planned) / before.cutting_length_mm)
    }

    /// What a plan leaves that comes out as one before, all of it where that is `measured`; or but for the ends
    /// of passes as the best one.
    fn as_before(&self, planned: &Planned, factors: [f64; 2], measured: bool) -> Option<Standing> {
        let as_best = self.is_left_as_before(planned, factors).then_some(&self.tried.standing);
        let path = digest(&planned.plan.path);
        let is_alike = |made: &&Made| made.path == path && (made.standing.round.measured || !measured);
        let alike = || self.made.iter().rfind(is_alike).map(|made| &made.standing);
        let mut found = as_best.or_else(alike)?.clone();
        found.round = CorrectionRound {
            factors,
            cutting_length_mm: cutting_length(planned),
            too_near_between_mm: too_near(planned),
            ..found.round
        };
        Some(found)
    }

    /// Keeps the best plan instead of this one.
    fn keep_best(&mut self, planned: &Planned, widths: Widths, found: Standing) -> Gain {
        self.rounds.push(found.round);
        let (path, standing) = (digest(&planned.plan.path), found.clone());
        self.made.push(Made { widths: widths.clone(), path, standing });
        self.latest = Some(Tried { widths, standing: found, kept: planned.plan.kept.clone() });
        Gain::None
    }

    /// Keeps this plan if it gains anything, or else the best one.
    fn keep_if(&mut self, gain: Gain, planned: Planned, widths: Widths, found: Standing) {
        if gain == Gain::None {
            self.keep_best(&planned, widths, found);
            return;
        }
        self.rounds.push(found.round);
        let tried = Tried { widths, standing: found, kept: planned.plan.kept.clone() };
        self.narrower = self.tried.standing.round.holds(&self.goal).then(|| self.tried.widths.clone());
        self.untouched = match (tried.standing.round.measured, tried.widths.touch_up.is_empty()) {
            (false, false) => self.untouched.take().or_else(|| Some(self.tried.widths.clone())),
            _ => None,
        };
        self.is_complete &= tried.widths.is_alike(&self.tried.widths);
        (self.best, self.tried, self.latest, self.kept) = (planned, tried, None, self.rounds.len() - 1);
        self.remember_best();
    }
}

/// How far below the target ridges are let stand, by how closely they are known.
fn slack_of(map: &RidgeMap) -> f64 {
    if map.is_close { SLACK } else { MEASURED_SLACK }
}

#[cfg(test)]
mod tests;
