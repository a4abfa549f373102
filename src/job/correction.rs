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

mod round;
mod widths;

use std::collections::BTreeSet;
use std::sync::Arc;

use geometry::Point3;
use metrology::{
    Bounded, Engine, EngineError, Measured, Measurement, RidgeMap, Simulation, Task, path_figures,
};
use motion::{ROUNDING, Toolpath};
use part::Part;
use report::Verdict;
use scene::ToolpathRequest;
use toolpath::{Earlier, Faces, Kept, Step, plane_interval, short_passes, unused_tolerance};
use work::monitor::{self, Monitor};

use super::covered::Covered;
use super::earlier::{EarlierPath, WholePath};
use super::figures::LeastLeftFigures;
use super::judge::{self, highest_reached};
use super::measuring::{Closeness, MeasuredClosely};
use super::planned::Planned;
use super::tool::{Around, ToolMoves};
use super::{JobError, Session};
pub(crate) use round::{CorrectionFigures, CorrectionRound};
use round::{Gain, Goal};
use widths::{HighPlace, MOST_NARROWED, Widths, aim};

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

/// Moves go deeper until what is known of the ridges stands no higher than this share of the target: between
/// the places that are known they rise by about as much as that leaves.
const LOWERED_TO: f64 = 0.985;

/// Where moves go deeper later, widths leave this share of what they can: ridges of a new plan stand at other
/// heights.
const LOWERED_LATER: f64 = 0.4;

/// Ridges are about equally high where half of their length stands no lower than this share of the highest.
const EVENLY_HIGH: f64 = 0.95;

/// What stands more times as high as the target is no matter of widths. Two rounds take an interval to a
/// quarter by [`MOST_NARROWED`], and ridges to a sixteenth: what is higher was never cut, and plans by other
/// widths do not cut it either. They cut no less deep either where a plan cuts deeper by as many times than
/// it may.
const NEVER_CUT: f64 = 16.0;

/// A plan that leaves no more than so many times what every path leaves is not made better.
const NEAR_LEAST: f64 = 2.0;

/// Plans in vain whose high places are narrowed in the next one.
const MOST_FOLLOWED: usize = 1;

/// A plan that was widened in vain is corrected where it stands above the target by no more than this share.
const WORTH_FOLLOWING: f64 = 0.2;

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

/// Cells from pass to pass while only ridges are measured.
const CELLS_A_PASS: f64 = 4.0;

/// What a plan leaves above the design.
struct Standing {
    /// As a round tells it, its length and factors aside.
    round: CorrectionRound,
    /// Places near the target and above it with their heights, mm.
    above: Vec<(Point3, f64)>,
    /// How deep it cuts below the design for certain, mm; 0 while only ridges are measured.
    depth: f64,
    /// How high stands for certain what it does not reach, mm; 0 while only ridges are measured.
    unreached: f64,
}

impl Standing {
    /// `None` without ridges: there is nothing to correct.
    fn of_ridges(map: &RidgeMap, planned: &Planned, factors: [f64; 2], wanted: Wanted<'_>) -> Option<Self> {
        let highest_ridge = map.scallop.max_mm?;
        let round = CorrectionRound {
            highest_mm: highest_ridge,
            border_mm: Some(map.border),
            error_bound_mm: map.scallop.error_bound_mm.filter(|_| highest_ridge >= map.border),
            median_mm: map.scallop.p50_mm,
            over_target_fraction: map.scallop.over_target_fraction,
            cutting_length_mm: cutting_length(planned),
            factors,
            too_near_between_mm: too_near(planned),
            measured: false,
        };
        let places = map.above.iter().map(|place| (place.at, place.height));
        // The highest place stands between those that cells show.
        let highest = map.scallop.max_at_mm.map(|at| (at.into(), round.highest_mm));
        let standing = Self { round, above: places.chain(highest).collect(), depth: 0.0, unreached: 0.0 };
        Some(standing.served(&planned.plan.kept.faces, wanted))
    }

    /// Where cells see no ridge, of what stands along borders alone.
    fn of_all(looked: &Looked, planned: &Planned, factors: [f64; 2], wanted: Wanted<'_>) -> Self {
        let measured = &looked.measured.measurement;
        let scallop = &measured.scallop;
        let (seen, reached) = (highest_reached(measured), measured.excess.reached);
        let unseen = looked.unseen();
        let of_unseen = unseen.map_or(Bounded::default(), |unseen| unseen.excess.highest);
        let highest = scallop.max_mm.unwrap_or_default();
        let on_border = reached.max_mm.max(of_unseen.max_mm) > highest;
        let round = CorrectionRound {
            highest_mm: highest,
            border_mm: on_border.then_some(reached.max_mm.max(of_unseen.max_mm)),
            error_bound_mm: Some(seen.or(&of_unseen).error_bound_mm),
            median_mm: scallop.p50_mm,
            over_target_fraction: scallop.over_target_fraction,
            cutting_length_mm: cutting_length(planned),
            factors,
            too_near_between_mm: too_near(planned),
            measured: true,
        };
        let places = measured.above.iter().chain(unseen.iter().flat_map(|unseen| &unseen.above));
        let places = places.map(|place| (place.at, place.height));
        let ridge = scallop.max_at_mm.map(|at| (at.into(), highest));
        let others = [reached, of_unseen].map(|place| place.at_mm.map(|at| (at.into(), place.max_mm)));
        let above = places.chain(ridge).chain(others.into_iter().flatten()).collect();
        let depth = measured.gouge.max_depth_mm - measured.gouge.error_bound_mm;
        let unreached = measured.excess.unreached.at_least_mm;
        Self { round, above, depth, unreached }.served(&planned.plan.kept.faces, wanted)
    }

    /// Of the faces alone that passes are made for: no widths help others. Edges between both are theirs once
    /// those are cut. What stands high is left to a toolpath behind that is for the rest.
    fn served(mut self, faces: &Faces, wanted: Wanted<'_>) -> Self {
        if *faces == Faces::ALL && wanted.highest == f64::INFINITY {
            return self;
        }
        let mesh = wanted.part.mesh();
        self.above.retain(|(at, height)| {
            if *height > wanted.highest {
                return false;
            }
            if *faces == Faces::ALL {
                return true;
            }
            let foot = wanted.part.closest_point(at).0;
            let around = mesh.triangles_at(foot.triangle as usize, &foot.point);
            let mut held = around.into_iter().map(|t| faces.hold(&mesh.normal(t)));
            if wanted.behind_others { held.any(|held| held) } else { held.all(|held| held) }
        });
        let highest = self.above.iter().map(|(_, height)| *height);
        // What is not among the places stays below the target.
        let highest = highest.fold((1.0 - SLACK) * wanted.target, f64::max);
        let round = &mut self.round;
        if round.highest() > highest {
            round.error_bound_mm = None;
        }
        round.highest_mm = round.highest_mm.min(highest);
        round.border_mm = round.border_mm.map(|border| border.min(highest));
        self
    }
}

/// What a plan is to leave, and on what.
#[derive(Clone, Copy)]
struct Wanted<'a> {
    part: &'a Part,
    /// What no ridge may exceed, mm.
    target: f64,
    /// What stands higher is a matter of another toolpath, mm.
    highest: f64,
    /// Whether what others left is all that is cut.
    behind_others: bool,
}

/// A path whose whole surface was measured.
pub(crate) struct Looked {
    pub measured: Measured,
    /// Whether a closer look would change no verdict.
    is_as_verdict: bool,
    /// What that covers, where [`Session::look`] asks for it.
    pub covered: Option<Covered>,
}

impl Looked {
    /// What stands where no cell sees, as far as it was cut.
    fn unseen(&self) -> Option<&Measurement> {
        let unseen = self.covered.as_ref()?.unseen.as_ref()?;
        (!unseen.never_cut).then_some(&unseen.measurement)
    }
}

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

    /// How much deeper moves may go, mm: chords leave that of their tolerance, and the gouge tolerance has to
    /// leave it as well, with what arcs may lead the tool astray.
    fn room(&self, request: &ToolpathRequest) -> f64 {
        let (tolerance, strays) = (&self.scene.tolerance, self.scene.arcs.unwrap_or(0.0));
        let (chord, is_smoothed) = (tolerance.chord, request.joining.smoothing);
        let unused = unused_tolerance(chord, is_smoothed);
        unused.min(tolerance.gouge - (chord - unused) - strays)
    }

    fn wanted(&self, request: &ToolpathRequest, target: f64, behind_others: bool) -> Wanted<'_> {
        // A toolpath for the rest takes what deeper moves do not: what no path of this cutter reaches most of all.
        let highest = if self.rest_follows(request) { target + self.room(request) } else { f64::INFINITY };
        Wanted { part: &self.part, target, highest, behind_others }
    }

    /// Measures the whole surface that a path leaves behind `earlier` ones, where no cell sees as well unless
    /// the rest fails for certain.
    pub(crate) fn look(
        &self,
        request: &ToolpathRequest,
        earlier: &[EarlierPath],
        engine: &dyn Engine,
        path: &Toolpath,
        closeness: Closeness,
        monitor: &dyn Monitor,
    ) -> Result<Looked, JobError> {
        let (cutters, holders) = self.tools(request);
        let whole = WholePath::new(earlier, path, &cutters, self.scene.machine.rapid_rate);
        let all = (&*whole.path, &whole.cutters);
        let MeasuredClosely { measured, is_as_verdict } =
            self.measure_closely(request, engine, all, closeness, monitor)?;
        let covered = match self.pocket {
            None if self.verdict_on(&measured) != Verdict::Fail => {
                let own = ToolMoves::of(&cutters, &holders, path);
                Some(self.covered(request, &measured, all, &whole.tools(earlier, &own), monitor)?)
            }
            _ => None,
        };
        Ok(Looked { measured, is_as_verdict, covered })
    }

    /// The ridges that a plan leaves; `None` where finding them takes as long as measuring all, or coarse
    /// cells cannot tell.
    fn ridges(
        &self,
        request: &ToolpathRequest,
        engine: &dyn Engine,
        planned: &Planned,
        monitor: &dyn Monitor,
    ) -> Result<Option<RidgeMap>, JobError> {
        monitor.start("measuring the ridges of a plan", 0);
        self.on_coarse_cells(request, planned, |task| engine.ridges(task, monitor))
    }

    /// Cells that are just fine enough to show every pass of a plan.
    fn on_coarse_cells<T>(
        &self,
        request: &ToolpathRequest,
        planned: &Planned,
        of_task: impl FnOnce(&Task<'_>) -> Result<T, EngineError>,
    ) -> Result<T, JobError> {
        let scene = &self.scene;
        let cell = plane_interval(&request.tooling.cutter, request.step) / CELLS_A_PASS;
        let simulation = Simulation { cell, cell_is_auto: true, ..scene.simulation };
        let cells =
            self.budget().grid_before_planning(&self.area(), &simulation).map_err(JobError::grid(scene))?;
        let (cutters, _) = self.tools(request);
        let task = self.task(request, (&planned.plan.path, &cutters), &simulation, &cells);
        of_task(&task).map_err(|reason| JobError::engine(scene, &request.name, reason))
    }

    /// Whether moves of a toolpath can go deeper beside places that stand a little too high. Those of a tool
    /// that leans cannot, and where a toolpath is for some places others may have left what stands.
    fn may_lower(&self, request: &ToolpathRequest) -> bool {
        request.correct && request.axis.is_none() && self.pocket.is_none() && !request.is_for_places()
    }

    /// Whether a toolpath is planned as if chords raised nothing. The gouge tolerance has to leave moves the
    /// room for it; and where all has to be measured to find such places, passes that leave none take less
    /// time.
    pub(crate) fn is_lowered_later(&self, request: &ToolpathRequest) -> bool {
        let tolerance = &self.scene.tolerance;
        self.may_lower(request)
            && tolerance.gouge >= tolerance.chord
            && self.scene.simulation.engine.for_path(request.tilts()).finds_ridges()
    }

    /// Whether all of the surface that was measured passes, where no cell sees as well.
    fn passes(&self, looked: &Looked) -> bool {
        let (limits, rule) = (&self.scene.tolerance, &self.scene.scallop_rule);
        let unseen = looked.covered.as_ref().and_then(|covered| covered.unseen.as_ref());
        self.verdict_on(&looked.measured) == Verdict::Pass
            && unseen
                .is_none_or(|unseen| judge::of_surface(&unseen.measurement, limits, rule) == Verdict::Pass)
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
        let left = LeastLeftFigures::at_or_elsewhere(self.session, cutter, &[(*at, limit)], monitor)?;
        Ok(self.leaves_nearly(left))
    }

    /// Whether the best plan leaves what every path of the cutter leaves.
    fn is_unavoidable(&mut self, measured: &Measurement, monitor: &dyn Monitor) -> Result<bool, JobError> {
        if self.tried.standing.round.holds(&self.goal) || self.request.stock_is_previous {
            return Ok(false);
        }
        let (session, path) = (self.session, &self.best.plan.path);
        let cutter = &self.request.tooling.cutter;
        let left = LeastLeftFigures::above_limit(session, cutter, path, measured, monitor)?;
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

    /// The widths to try next. A plan that stands too high gets deeper moves where that is enough, and
    /// narrower widths elsewhere; one that is too low gets wider ones. Levels are placed anew in each plan,
    /// so that other places may stand too high then: these are narrowed as well, from the last plan on. Last
    /// of all everything is narrowed in proportion, where once may be enough, to which remnants along borders
    /// give way only by another pass. `None` where the best plan holds the target and comes within `slack` of
    /// it, where it is far off in many places, or where what there is was tried `in_vain`.
    fn next(&self, in_vain: usize, slack: f64) -> Option<Widths> {
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
            let ridges_fail = round.highest_mm + round.margin(target) > target;
            let height = if ridges_fail { round.highest_mm } else { round.highest() };
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
            (false, ..=MOST_IN_VAIN) => in_proportion().or_else(|| self.corrected(last, in_vain)),
            _ => None,
        }
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
        let was_served = measured > 1 && tried.standing.round.measured && !widths.touch_up.is_empty();
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
            return Some(self.scaled(widths, round.highest_mm));
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

/// The places that may stand above the target.
fn above_target(near: &[HighPlace]) -> Vec<HighPlace> {
    near.iter().filter(|place| place.over > 0.0).copied().collect()
}

/// How far below the target ridges are let stand, by how closely they are known.
fn slack_of(map: &RidgeMap) -> f64 {
    if map.is_close { SLACK } else { MEASURED_SLACK }
}

/// By which share the least and the greatest width of a plan differ from those of another.
fn changes(factors: [f64; 2], others: [f64; 2]) -> [f64; 2] {
    [0, 1].map(|k| (factors[k] / others[k] - 1.0).abs())
}

/// Whether widths that differ by this share, on a path this many times as long, changed no more than the ends
/// of passes.
fn are_ends_alone(widths: f64, length: f64) -> bool {
    widths > 0.0 && (length - 1.0).abs() <= AS_BEFORE * widths
}

/// [`CorrectionRound::cutting_length_mm`] of a plan.
fn cutting_length(planned: &Planned) -> f64 {
    path_figures(&planned.plan.path, 0.0).cutting_length_mm
}

/// [`CorrectionRound::too_near_between_mm`] of a plan.
fn too_near(planned: &Planned) -> Option<f64> {
    Some(planned.plan.too_near_between).filter(|missing| *missing > 0.0)
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

    /// A spiral leaves a corner of the part by a turn that stands 18 times as high as the target there: no
    /// width matters, and a short pass of its own cuts it.
    #[test]
    fn a_corner_that_was_never_cut_gets_a_pass_of_its_own() {
        let text = "[part]\nsurface = \"wave\"\namplitude = 0.5\nwavelength_x = 12\nx = [-4, 4]\ny = [-3, 3]\n[cutter]\nshape = \"ball\"\ndiameter = 6\n\
                    [tolerance]\nscallop = 0.0003\nchord = 3e-5\n[[toolpath]]\nstrategy = \"spiral\"\n";
        let session = Session::new(Scene::parse("corner.toml", text.to_owned()).unwrap()).unwrap();
        let result = session.toolpath(&session.scene.toolpaths[0], &Silent).unwrap().result;
        let rounds = figure(&result).unwrap()["rounds"].as_array().unwrap();
        let highest = |round: &serde_json::Value| round["border_mm"].as_f64().unwrap();
        assert!(highest(&rounds[0]) > NEVER_CUT * 0.0003, "{rounds:?}");
        assert_eq!(result.verdict, report::Verdict::Pass, "{rounds:?}");
    }
}
