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
//! narrowing does not help. Nothing is narrowed for a place where every path of the cutter leaves too much.
//!
//! Where an engine tells ridges apart, the first rounds measure no more than those, on cells as coarse as
//! show every pass. Then all is measured as the verdict is; what still stands above the target then is
//! corrected as well.

mod looking;
mod next;
mod round;
mod standing;
mod widths;

use std::sync::Arc;

use metrology::{Engine, Measured, Measurement, RidgeMap, Task};
use scene::ToolpathRequest;
use toolpath::{Earlier, Kept, Step, plane_interval};
use work::monitor::{self, Monitor};

use super::covered::Covered;
use super::earlier::EarlierPath;
use super::figures::LeastLeftFigures;
use super::measuring::Closeness;
use super::planned::Planned;
use super::tool::Around;
use super::{JobError, Session};
pub(crate) use looking::Looked;
use next::{EVENLY_HIGH, are_ends_alone, changes};
pub(crate) use round::{CorrectionFigures, CorrectionRound};
use round::{Gain, Goal};
use standing::{Standing, Wanted, cutting_length, too_near};
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

/// As [`SLACK`] where all has to be measured to see whether a wider plan holds, or where ridges are known
/// less closely. With less, whole measurements are spent on a few per cent of length.
const MEASURED_SLACK: f64 = 0.2;

/// What stands more times as high as the target is no matter of widths. Two rounds take an interval to a
/// quarter by [`MOST_NARROWED`], and ridges to a sixteenth: what is higher was never cut, and plans by other
/// widths do not cut it either. They cut no less deep either where a plan cuts deeper by as many times than
/// it may.
const NEVER_CUT: f64 = 16.0;

/// A plan that leaves no more than so many times what every path leaves is not made better.
const NEAR_LEAST: f64 = 2.0;

/// A plan that was tried.
struct Tried {
    /// What it was planned by.
    widths: Widths,
    /// What it leaves.
    standing: Standing,
    /// What its strategy made.
    kept: Arc<Kept>,
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
    rounds: Vec<CorrectionRound>,
    /// The round of the best plan.
    kept: usize,
    /// Whether places where its passes leave too much were sought beside those that ridges on coarse cells
    /// show.
    is_complete: bool,
    /// Whether every path of the cutter leaves more than the target somewhere.
    is_hopeless: bool,
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
        let first = self.plan(request, around, None, monitor)?;
        let map = match target {
            // Between its stretches stands what others left: its moves alone do not tell how high.
            Some(_) if !request.is_for_places() => self.ridges(request, engine, &first, monitor)?,
            _ => None,
        };
        let closeness = target.map_or(Closeness::Verdict, |target| Closeness::Plan {
            within: SLACK * target,
            limit: self.scene.scallop_rule.highest * target,
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
            return Ok((first, measured, covered));
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
            goal: Goal { target, rule: self.scene.scallop_rule },
            closeness,
            best: first,
            tried,
            latest: None,
            narrower: None,
            rounds,
            kept: 0,
            is_complete: false,
            is_hopeless: false,
        };
        let looked = match looked {
            Some(looked) => looked,
            None => {
                corrected.by_ridges(map.map_or(MEASURED_SLACK, |map| slack_of(&map)), monitor)?;
                corrected.look_at_best(closeness, monitor)?
            }
        };
        let Looked { measured, covered, .. } = corrected.by_measurements(looked, monitor)?;
        let Corrected { mut best, rounds, kept, .. } = corrected;
        best.correction = Some(CorrectionFigures { target_mm: target, rounds, kept: kept + 1 });
        Ok((best, measured, covered))
    }
}

impl Corrected<'_> {
    fn wanted(&self, measured: bool) -> Wanted<'_> {
        let behind_others = measured && !self.earlier.is_empty();
        self.session.wanted(self.request, self.goal.target, behind_others)
    }

    /// Plans anew while ridges on coarse cells stand above the target, or all below it by more than the
    /// `slack`.
    fn by_ridges(&mut self, mut slack: f64, monitor: &dyn Monitor) -> Result<(), JobError> {
        if self.is_too_hollow(monitor)? {
            return Ok(());
        }
        let mut in_vain = 0;
        while self.rounds.len() < MOST_ROUNDS
            && let Some(next) = self.next(in_vain, slack).filter(|_| !self.ends_in_vain(in_vain))
        {
            let next = if in_vain == 0 { self.completed(next, slack, monitor)? } else { next };
            let (planned, factors) = self.plan(&next, monitor)?;
            let gain = if self.is_left_as_before(&planned, factors) {
                let found = self.as_before(&planned, factors);
                self.keep_best(&planned, next, found)
            } else {
                let map = self.session.ridges(self.request, self.engine, &planned, monitor)?;
                slack = map.as_ref().map_or(slack, |map| slack.max(slack_of(map)));
                let found =
                    map.and_then(|map| Standing::of_ridges(&map, &planned, factors, self.wanted(false)));
                let Some(found) = found else { break };
                self.keep_if_better(planned, next, found)
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
        self.tried.standing.above.extend(others.iter().map(|place| (place.at, place.height)));
        // The others are no reason to place all passes anew.
        Ok(self.next(1, slack).unwrap_or(next))
    }

    /// Plans anew while what the verdict is made of stands above the target.
    fn by_measurements(&mut self, looked: Looked, monitor: &dyn Monitor) -> Result<Looked, JobError> {
        if self.is_unavoidable(&looked.measured.measurement, monitor)? {
            return Ok(looked);
        }
        let (mut looked, mut in_vain, mut gain) = (Some(looked), 0, Gain::None);
        for round in 0..MOST_MEASURED_NEAR {
            if round >= MOST_MEASURED && gain < Gain::Much && !self.is_near(&self.tried) {
                break;
            }
            // Ridges alone did not show what stands far above the target.
            let fails = !self.tried.standing.round.holds(&self.goal) && !self.is_near(&self.tried);
            let narrower = self.narrower.take().filter(|_| round == 0 && fails && !self.is_far_off());
            let next = narrower.or_else(|| self.next(in_vain, MEASURED_SLACK));
            let Some(next) = next.filter(|_| !self.ends_in_vain(in_vain)) else { break };
            let (planned, factors) = self.plan(&next, monitor)?;
            if self.is_left_as_before(&planned, factors) {
                let found = self.as_before(&planned, factors);
                gain = self.keep_best(&planned, next, found);
            } else {
                let is_passing = looked.as_ref().is_some_and(|looked| self.session.passes(looked));
                // Two at a time might be more than the memory that the run may take.
                drop(looked.take());
                let path = &planned.plan.path;
                let again = self.session.look(
                    self.request,
                    self.earlier,
                    self.engine,
                    path,
                    self.closeness,
                    monitor,
                )?;
                let found = Standing::of_all(&again, &planned, factors, self.wanted(true));
                // A shorter path is no reason to give up a plan that passes, nor a lower ridge for one that
                // cuts too deep or leaves more uncut.
                let (limits, best) = (&self.session.scene.tolerance, &self.tried.standing);
                let is_deeper = found.depth > limits.gouge && best.depth <= limits.gouge;
                let leaves_more = found.unreached > limits.uncut && best.unreached <= limits.uncut;
                gain = match (is_passing, self.session.passes(&again)) {
                    (false, true) => self.keep(planned, next, found),
                    (true, false) => self.keep_best(&planned, next, found),
                    _ if is_deeper || leaves_more => self.keep_best(&planned, next, found),
                    _ => self.keep_if_better(planned, next, found),
                };
                if gain != Gain::None {
                    looked = Some(again);
                }
            }
            in_vain = if gain >= Gain::Enough { 0 } else { in_vain + 1 };
        }
        match looked {
            Some(looked) if looked.is_as_verdict => Ok(looked),
            other => {
                drop(other);
                self.look_at_best(Closeness::Verdict, monitor)
            }
        }
    }

    /// Whether every path of an upright cutter leaves more than the target somewhere, and the best plan not
    /// much more: nearer passes would make the path longer without end.
    fn is_too_hollow(&mut self, monitor: &dyn Monitor) -> Result<bool, JobError> {
        let highest = self.tried.standing.above.iter().max_by(|a, b| a.1.total_cmp(&b.1));
        let limit = self.goal.rule.highest * self.goal.target;
        let is_alone = self.request.axis.is_none() && !self.request.stock_is_previous;
        let Some((at, _)) = highest.filter(|(_, height)| is_alone && *height > (1.0 + NEAR) * limit) else {
            return Ok(false);
        };
        let cutter = &self.request.tooling.cutter;
        let left = LeastLeftFigures::at_or_elsewhere(self.session, &[*cutter], &[(*at, limit)], monitor)?;
        Ok(self.leaves_nearly(left))
    }

    /// Whether the best plan leaves what every path of the cutter leaves.
    fn is_unavoidable(&mut self, measured: &Measurement, monitor: &dyn Monitor) -> Result<bool, JobError> {
        if self.tried.standing.round.holds(&self.goal) || self.request.stock_is_previous {
            return Ok(false);
        }
        let (session, path) = (self.session, &self.best.plan.path);
        let cutter = &self.request.tooling.cutter;
        let left = LeastLeftFigures::above_limit(session, (&[*cutter], false), path, &[measured], monitor)?;
        Ok(self.leaves_nearly(left))
    }

    /// Whether the best plan leaves little more than what every path does, if these leave too much.
    fn leaves_nearly(&mut self, left: Option<LeastLeftFigures>) -> bool {
        self.is_hopeless |= left.is_some();
        left.is_some_and(|left| self.tried.standing.round.highest() <= NEAR_LEAST * left.height_mm)
    }

    /// Whether no other plan is made: none holds the target, and the last one was no better.
    fn ends_in_vain(&self, in_vain: usize) -> bool {
        self.is_hopeless && in_vain > 0
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
        self.tried.standing.depth > NEVER_CUT * self.session.scene.tolerance.gouge
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
            kept: alike.unwrap_or(&self.tried).kept.clone(),
            again: alike.is_some() && self.request.axis.is_none(),
        };
        Ok((self.session.plan(self.request, self.around, Some(Arc::new(earlier)), monitor)?, factors))
    }

    /// Measures all of the best plan.
    fn look_at_best(&mut self, closeness: Closeness, monitor: &dyn Monitor) -> Result<Looked, JobError> {
        let path = &self.best.plan.path;
        let looked = self.session.look(self.request, self.earlier, self.engine, path, closeness, monitor)?;
        let factors = self.tried.standing.round.factors;
        let standing = Standing::of_all(&looked, &self.best, factors, self.wanted(true));
        self.rounds[self.kept] = standing.round;
        self.tried.standing = standing;
        Ok(looked)
    }

    /// Whether all widths of a plan differ from those of the best, and no more than the ends of passes: they
    /// are spread over a part, a whole number of them, and it leaves what the best one leaves.
    fn is_left_as_before(&self, planned: &Planned, factors: [f64; 2]) -> bool {
        let before = &self.tried.standing.round;
        let [least, most] = changes(factors, before.factors);
        are_ends_alone(least.min(most), cutting_length(planned) / before.cutting_length_mm)
    }

    /// What the best plan leaves, as that of another with other ends of passes.
    fn as_before(&self, planned: &Planned, factors: [f64; 2]) -> Standing {
        let Standing { round, above, depth, unreached } = &self.tried.standing;
        let round = CorrectionRound {
            factors,
            cutting_length_mm: cutting_length(planned),
            too_near_between_mm: too_near(planned),
            ..*round
        };
        Standing { round, above: above.clone(), depth: *depth, unreached: *unreached }
    }

    /// Keeps the best plan instead of this one.
    fn keep_best(&mut self, planned: &Planned, widths: Widths, found: Standing) -> Gain {
        self.rounds.push(found.round);
        self.latest = Some(Tried { widths, standing: found, kept: planned.plan.kept.clone() });
        Gain::None
    }

    fn keep_if_better(&mut self, planned: Planned, widths: Widths, found: Standing) -> Gain {
        match found.round.gain_over(&self.tried.standing.round, &self.goal) {
            Gain::None => self.keep_best(&planned, widths, found),
            gain => {
                self.keep(planned, widths, found);
                gain
            }
        }
    }

    /// Keeps this plan.
    fn keep(&mut self, planned: Planned, widths: Widths, found: Standing) -> Gain {
        self.rounds.push(found.round);
        let tried = Tried { widths, standing: found, kept: planned.plan.kept.clone() };
        self.narrower = self.tried.standing.round.holds(&self.goal).then(|| self.tried.widths.clone());
        self.is_complete &= tried.widths.is_alike(&self.tried.widths);
        (self.best, self.tried, self.latest, self.kept) = (planned, tried, None, self.rounds.len() - 1);
        Gain::Much
    }
}

/// How far below the target ridges are let stand, by how closely they are known.
fn slack_of(map: &RidgeMap) -> f64 {
    if map.is_close { SLACK } else { MEASURED_SLACK }
}

#[cfg(test)]
mod tests {
    use super::*;
    use scene::Scene;
    use work::monitor::Silent;

    /// A part of a wave under a ball of 6 mm.
    const SCENE: &str = "[part]\nsurface = \"wave\"\namplitude = 0.8\nwavelength_x = 25\nwavelength_y = 30\nx = [-8, 8]\ny = [-8, 8]\n[cutter]\nshape = \"ball\"\n\
                         diameter = 6\n[tolerance]\nscallop = 0.05\nchord = 0.005\n";

    fn planned(correct: bool, toolpath: &str) -> report::ToolpathResult {
        let text = format!("{SCENE}correct = {correct}\n[[toolpath]]\n{toolpath}\n");
        let session = Session::new(Scene::parse("bump.toml", text).unwrap()).unwrap();
        session.toolpath(&session.scene.toolpaths[0], &Silent).unwrap().result
    }

    fn figure(result: &report::ToolpathResult) -> Option<&serde_json::Value> {
        result.figures.iter().find(|figure| figure.key == "correction").map(|figure| &figure.value)
    }

    /// Cells that show no pass tell nothing about a plan: it is made as by finer ones, and judged on these.
    #[test]
    fn coarse_cells_change_no_plan() {
        let [fine, coarse] = [0.1, 4.0].map(|cell| {
            let scene = format!("strategy = \"streamline\"\n[simulation]\ncell = {cell}");
            planned(true, &scene)
        });
        let lengths = |result: &report::ToolpathResult| -> Vec<f64> {
            let rounds = figure(result).unwrap()["rounds"].as_array().unwrap().clone();
            rounds.iter().map(|round| round["cutting_length_mm"].as_f64().unwrap()).collect()
        };
        assert_eq!(lengths(&fine), lengths(&coarse));
        assert_eq!([fine.verdict, coarse.verdict], [report::Verdict::Pass; 2]);
    }

    #[test]
    fn rounds_bring_ridges_toward_the_target() {
        for toolpath in ["strategy = \"streamline\"", "strategy = \"iso-parametric\""] {
            let [open, closed] = [false, true].map(|correct| planned(correct, toolpath));
            assert!(figure(&open).is_none());
            let rounds = figure(&closed).unwrap()["rounds"].as_array().unwrap();
            assert!((1..=MOST_ROUNDS + MOST_MEASURED_NEAR).contains(&rounds.len()));
            let [before, after] = [&open, &closed].map(|result| result.scallop.max_mm.unwrap());
            assert!(after <= before.max(0.05), "{toolpath}: {before} {after} {rounds:?}");
        }
        assert!(figure(&planned(true, "strategy = \"zigzag\"\nstepover = 0.5")).is_none());
    }

    /// On a slope of one degree the rim of a flat is an arc of r/sin 1° across the feed along the slope:
    /// strips of 6.8 mm, and the low edge is cut by passes that run on until the rim has left it.
    #[test]
    fn a_flat_end_takes_the_strips_that_it_has() {
        for toolpath in ["iso-scallop", "streamline", "iso-parametric"] {
            let text = format!(
                "[part]\nsurface = \"inclined_plane\"\nangle = 1\nx = [0, 40]\ny = [0, 40]\n[cutter]\nshape = \"flat\"\n\
                 diameter = 20\n[[toolpath]]\nstrategy = \"{toolpath}\"\n"
            );
            let session = Session::new(Scene::parse("slope.toml", text).unwrap()).unwrap();
            let result = session.toolpath(&session.scene.toolpaths[0], &Silent).unwrap().result;
            assert_eq!(result.verdict, report::Verdict::Pass, "{toolpath}: {:?}", result.claims);
            assert!(result.path.cutting_length_mm < 260.0, "{toolpath}: {}", result.path.cutting_length_mm);
        }
    }

    /// A spiral leaves a corner of the part by a turn that stands 39 times as high as the target there: no
    /// width matters, and a short pass of its own cuts it.
    #[test]
    fn a_corner_that_was_never_cut_gets_a_pass_of_its_own() {
        let text = "[part]\nsurface = \"wave\"\namplitude = 0.5\nwavelength_x = 12\nx = [-4, 3.3]\ny = [-3, 3]\n[cutter]\nshape = \"ball\"\ndiameter = 6\n\
                    [tolerance]\nscallop = 0.0001\nchord = 1e-5\n[[toolpath]]\nstrategy = \"spiral\"\n";
        let session = Session::new(Scene::parse("corner.toml", text.to_owned()).unwrap()).unwrap();
        let result = session.toolpath(&session.scene.toolpaths[0], &Silent).unwrap().result;
        let rounds = figure(&result).unwrap()["rounds"].as_array().unwrap();
        let highest = |round: &serde_json::Value| round["border_mm"].as_f64().unwrap();
        assert!(highest(&rounds[0]) > NEVER_CUT * 0.0001, "{rounds:?}");
        assert_eq!(result.verdict, report::Verdict::Pass, "{rounds:?}");
    }
}
