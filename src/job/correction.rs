//! The loop: plan, cut, measure the ridges, and plan again with passes nearer to each other where ridges stand above the
//! target, or all farther apart where none comes near it.
//!
//! Enters: a toolpath that is planned by a scallop height. Leaves: the best of a few plans with its measurement, and what each
//! round found.
//!
//! The functions whose levels are passes are kept from round to round: only levels are placed anew, narrower around the
//! places that stood too high. Places that stand above it by no more than chords may have raised them get shorter chords
//! first, which costs points and no length, and leaves all levels where they are. Few others get short passes of their own,
//! which leave all others where they are. Where an engine tells ridges apart, the first rounds measure no more than those,
//! on cells as coarse as show every pass. Then all is measured as the verdict is; what still stands above the target then is
//! corrected as well. Where narrowing does not help, the widths of the whole plan are scaled, which leaves its passes in shape.

use std::sync::Arc;

use serde::Serialize;

use geometry::Point3;
use metrology::{Engine, Measured, Measurement, RidgeMap, ScallopRule, Simulation, path_figures};
use scene::ToolpathRequest;
use toolpath::{Correction, Earlier, Step, plane_interval};
use work::monitor::{self, Monitor};

use super::figures::LeastLeftFigures;
use super::judge::highest_reached;
use super::measuring::Closeness;
use super::planned::Planned;
use super::tool::Around;
use super::{JobError, Session};

/// Most plans that are made while only ridges are measured.
const MOST_ROUNDS: usize = 6;

/// A plan whose highest ridge is within this share above the target is near to holding it.
const NEAR: f64 = 0.05;

/// Most plans that are made again after all was measured: each costs as much as the whole run without correction.
const MOST_MEASURED: usize = 3;

/// The same while the best plan stands above the target by no more than [`NEAR`]: what is left is little, and each plan has to
/// take [`LEAST_GAIN`] of it.
const MOST_MEASURED_NEAR: usize = 8;

/// A plan whose highest ridge is within this share below the target is as wide as it should be. What is corrected is aimed
/// at the middle of it, since points and chords of a new plan lie elsewhere.
const SLACK: f64 = 0.02;

/// As [`SLACK`] where all has to be measured to see whether a wider plan holds. With less, whole measurements are spent on a few
/// per cent of length.
const MEASURED_SLACK: f64 = 0.2;

/// Chords of two passes raise a ridge by no more than this share of their tolerance.
const RAISED_BY_CHORDS: f64 = 0.5;

/// Ridges are about equally high where half of their length stands no lower than this share of the highest.
const EVENLY_HIGH: f64 = 0.95;

/// The factor of the chord tolerance where a ridge was raised by chords; where it still is, passes get nearer to each other.
const SHORTER_CHORDS: f64 = 0.25;

/// No width is corrected by more than this factor in a round.
const MOST_NARROWED: f64 = 0.5;

/// What stands more times as high as the target is no matter of widths. Two rounds take an interval to a quarter by
/// [`MOST_NARROWED`], and ridges to a sixteenth: what is higher was never cut, and plans by other widths do not cut it either.
const NEVER_CUT: f64 = 16.0;

/// A place whose factor is less than one by more than this was narrowed before.
const STILL_WIDE: f64 = 1e-6;

/// A plan that does not hold the target is in vain unless it takes this share of what the best one leaves above it.
const LEAST_GAIN: f64 = 0.1;

/// Plans in vain whose high places are narrowed in the next one.
const MOST_FOLLOWED: usize = 1;

/// Plans in vain after which no other is made. Behind those that are followed, all is narrowed in proportion.
const MOST_IN_VAIN: usize = MOST_FOLLOWED + 3;

/// A place takes at most so many intervals of a pass of its own.
const TOUCH_UP_LENGTH: f64 = 3.0;

/// Passes of their own and the ways to them are no longer in all than this share of the path.
const MOST_TOUCH_UP: f64 = 0.04;

/// Cells from pass to pass while only ridges are measured.
const CELLS_A_PASS: f64 = 4.0;

/// What a round of the loop found.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct CorrectionRound {
    /// The highest ridge, mm.
    pub highest_mm: f64,
    /// The highest remnant along a border, mm; `None` where only what is highest of all was sought, and that is a ridge.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub border_mm: Option<f64>,
    /// Bound of the error of the higher one of both; `None` where it is a border that was looked at in places only.
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
    /// Whether all was measured as the verdict is, and not ridges alone on cells that just show them.
    pub measured: bool,
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

/// What a plan leaves above the design.
struct Standing {
    /// As a round tells it, its length and factors aside.
    round: CorrectionRound,
    /// Places near the target and above it with their heights, mm.
    above: Vec<(Point3, f64)>,
}

impl Standing {
    /// `None` without ridges: there is nothing to correct.
    fn of_ridges(map: &RidgeMap, planned: &Planned, factors: [f64; 2]) -> Option<Self> {
        let highest_ridge = map.scallop.max_mm?;
        let round = CorrectionRound {
            highest_mm: highest_ridge,
            border_mm: Some(map.border),
            error_bound_mm: map.scallop.error_bound_mm.filter(|_| highest_ridge >= map.border),
            median_mm: map.scallop.p50_mm,
            over_target_fraction: map.scallop.over_target_fraction,
            cutting_length_mm: path_figures(&planned.plan.path, 0.0).cutting_length_mm,
            factors,
            too_near_between_mm: too_near(planned),
            measured: false,
        };
        let places = map.above.iter().map(|place| (place.at, place.height));
        // The highest place stands between those that cells show.
        let highest = map.scallop.max_at_mm.map(|at| (at.into(), round.highest_mm));
        Some(Self { round, above: places.chain(highest).collect() })
    }

    /// `None` without ridges.
    fn of_all(measured: &Measurement, planned: &Planned, factors: [f64; 2]) -> Option<Self> {
        let (scallop, reached) = (&measured.scallop, &measured.excess.reached);
        let on_border = scallop.max_mm.is_some_and(|ridge| reached.max_mm > ridge);
        let round = CorrectionRound {
            highest_mm: scallop.max_mm?,
            border_mm: on_border.then_some(reached.max_mm),
            error_bound_mm: Some(highest_reached(measured).error_bound_mm),
            median_mm: scallop.p50_mm,
            over_target_fraction: scallop.over_target_fraction,
            cutting_length_mm: path_figures(&planned.plan.path, 0.0).cutting_length_mm,
            factors,
            too_near_between_mm: too_near(planned),
            measured: true,
        };
        let places = measured.above.iter().map(|place| (place.at, place.height));
        let highest = scallop.max_at_mm.map(|at| (at.into(), round.highest_mm));
        let reached = reached.at_mm.map(|at| (at.into(), reached.max_mm));
        Some(Self { round, above: places.chain(highest).chain(reached).collect() })
    }
}

impl CorrectionRound {
    /// What is highest, mm.
    pub fn highest(&self) -> f64 {
        self.border_mm.map_or(self.highest_mm, |border| border.max(self.highest_mm))
    }

    /// Whether a remnant along a border is higher than every ridge.
    pub fn is_on_border(&self) -> bool {
        self.border_mm.is_some_and(|border| border > self.highest_mm)
    }

    /// Whether ridges exceed the target no more than they may.
    fn holds(&self, goal: &Goal) -> bool {
        self.highest() + self.margin(goal.target) <= goal.rule.highest * goal.target
            && (goal.rule.share >= 1.0
                || self.over_target_fraction.is_some_and(|over| over <= 1.0 - goal.rule.share))
    }

    /// The bound of the highest, mm, where keeping clear of it costs little: a wider one is to be refined instead, as it is
    /// when all is measured.
    fn margin(&self, target: f64) -> f64 {
        let bound = self.error_bound_mm.filter(|bound| self.measured && *bound <= SLACK * target);
        bound.unwrap_or(0.0)
    }

    /// Whether this round is to be kept instead of another: first what keeps clear between passes, then what holds the target,
    /// then what is shorter; where neither holds it, the one with the lower ridge.
    fn is_better(&self, other: &Self, goal: &Goal) -> bool {
        let clear = [self, other].map(|round| round.too_near_between_mm.is_none());
        if clear[0] != clear[1] {
            return clear[0];
        }
        match (self.holds(goal), other.holds(goal)) {
            (true, true) => self.cutting_length_mm < other.cutting_length_mm,
            (false, false) => self.highest() < other.highest(),
            (holds, _) => holds,
        }
    }

    /// What a plan gains over the best one before it.
    fn gain_over(&self, best: &Self, goal: &Goal) -> Gain {
        let above = |round: &Self| round.highest() + round.margin(goal.target) - goal.target;
        if !self.is_better(best, goal) {
            Gain::None
        } else if self.holds(goal) || above(self) <= (1.0 - LEAST_GAIN) * above(best) {
            Gain::Enough
        } else {
            Gain::Little
        }
    }
}

/// What a plan gains over the best one before it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Gain {
    /// The one before is kept.
    None,
    /// The new one is kept, but another of its kind would be in vain.
    Little,
    /// The new one is kept, and another of its kind may gain as well.
    Enough,
}

/// What the loop is after.
#[derive(Debug, Clone, Copy)]
struct Goal {
    /// The scallop height of the plan, mm.
    target: f64,
    /// Which ridges may exceed it.
    rule: ScallopRule,
}

/// The loop over one toolpath.
struct Corrected<'a> {
    session: &'a Session,
    request: &'a ToolpathRequest,
    around: Around<'a>,
    engine: &'a dyn Engine,
    goal: Goal,
    /// How closely plans are measured which may be planned better.
    closeness: Closeness,
    /// The best plan, by what widths, and what it leaves.
    best: Planned,
    widths: Widths,
    standing: Standing,
    /// The widths of the last plan and what it leaves, where that is not the best one.
    latest: Option<(Widths, Standing)>,
    rounds: Vec<CorrectionRound>,
    /// The round of the best plan.
    kept: usize,
}

impl Session {
    /// Plans, cuts and measures one toolpath, in rounds where what it leaves is to be corrected.
    pub(crate) fn plan_and_measure(
        &self,
        request: &ToolpathRequest,
        around: Around<'_>,
        engine: &dyn Engine,
        monitor: &dyn Monitor,
    ) -> Result<(Planned, Measured), JobError> {
        let target = match request.step {
            Step::Scallop(target) if request.correct => Some(target),
            _ => None,
        };
        let first = self.plan(request, around, None, monitor)?;
        let map = match target {
            Some(_) => self.ridges(request, engine, &first, monitor)?,
            None => None,
        };
        // Where each round measures all, narrower passes cost less time than a closer look, and little length.
        let closeness = target.filter(|_| map.is_none()).map_or(Closeness::Verdict, |target| {
            Closeness::Plan { within: SLACK * target, limit: self.scene.scallop_rule.highest * target }
        });
        let measure =
            |planned: &Planned| self.measure(request, engine, &planned.plan.path, closeness, monitor);
        let (measured, standing) = match &map {
            Some(map) => (None, Standing::of_ridges(map, &first, [1.0; 2])),
            None => {
                let measured = measure(&first)?;
                let standing = target.and_then(|_| Standing::of_all(&measured.measurement, &first, [1.0; 2]));
                (Some(measured), standing)
            }
        };
        let (Some(target), Some(standing)) = (target, standing) else {
            let measured = match measured {
                Some(measured) if closeness == Closeness::Verdict || !self.is_open(&measured) => measured,
                _ => self.measure(request, engine, &first.plan.path, Closeness::Verdict, monitor)?,
            };
            return Ok((first, measured));
        };
        let interval = plane_interval(&self.scene.cutter, request.step);
        let widths =
            Widths { places: Vec::new(), everywhere: 1.0, finer: Vec::new(), touch_up: Vec::new(), interval };
        let rounds = vec![standing.round];
        let mut corrected = Corrected {
            session: self,
            request,
            around,
            engine,
            goal: Goal { target, rule: self.scene.scallop_rule },
            closeness,
            best: first,
            widths,
            standing,
            latest: None,
            rounds,
            kept: 0,
        };
        let measured = match measured {
            Some(measured) => measured,
            None => {
                corrected.by_ridges(monitor)?;
                corrected.measure_best(monitor)?
            }
        };
        let measured = corrected.by_measurements(measured, monitor)?;
        let Corrected { mut best, rounds, kept, .. } = corrected;
        best.correction = Some(CorrectionFigures { target_mm: target, rounds, kept: kept + 1 });
        Ok((best, measured))
    }

    /// The ridges that a plan leaves; `None` where finding them takes as long as measuring all, or coarse cells cannot tell.
    fn ridges(
        &self,
        request: &ToolpathRequest,
        engine: &dyn Engine,
        planned: &Planned,
        monitor: &dyn Monitor,
    ) -> Result<Option<RidgeMap>, JobError> {
        let scene = &self.scene;
        monitor.start("measuring the ridges of a plan", 0);
        let cell = scene.simulation.cell.max(plane_interval(&scene.cutter, request.step) / CELLS_A_PASS);
        let simulation = Simulation { cell, cell_is_auto: true, ..scene.simulation };
        let cells =
            self.budget().grid_before_planning(&self.area(), &simulation).map_err(JobError::grid(scene))?;
        let task = self.task(&planned.plan.path, &simulation, &cells);
        engine.ridges(&task, monitor).map_err(|reason| JobError::engine(scene, &request.name, reason))
    }
}

impl Corrected<'_> {
    /// Plans anew while ridges on coarse cells stand above the target, or all below it.
    fn by_ridges(&mut self, monitor: &dyn Monitor) -> Result<(), JobError> {
        let mut in_vain = 0;
        while self.rounds.len() < MOST_ROUNDS
            && let Some(next) = self.next(in_vain, SLACK)
        {
            let (planned, factors) = self.plan(&next, monitor)?;
            let map = self.session.ridges(self.request, self.engine, &planned, monitor)?;
            let found = map.and_then(|map| Standing::of_ridges(&map, &planned, factors));
            let Some(found) = found else { break };
            let gain = self.keep_if_better(planned, next, found);
            in_vain = if gain == Gain::Enough { 0 } else { in_vain + 1 };
        }
        Ok(())
    }

    /// Plans anew while what the verdict is made of stands above the target.
    fn by_measurements(&mut self, measured: Measured, monitor: &dyn Monitor) -> Result<Measured, JobError> {
        if self.is_unavoidable(&measured.measurement, monitor)? {
            return Ok(measured);
        }
        let (mut measured, mut in_vain) = (Some(measured), 0);
        for round in 0..MOST_MEASURED_NEAR {
            if round >= MOST_MEASURED && !self.is_near() {
                break;
            }
            let Some(next) = self.next(in_vain, MEASURED_SLACK) else { break };
            let (planned, factors) = self.plan(&next, monitor)?;
            // Two at a time might be more than the memory that the run may take.
            drop(measured.take());
            let path = &planned.plan.path;
            let again = self.session.measure(self.request, self.engine, path, self.closeness, monitor)?;
            let Some(found) = Standing::of_all(&again.measurement, &planned, factors) else { break };
            let gain = self.keep_if_better(planned, next, found);
            if gain != Gain::None {
                measured = Some(again);
            }
            in_vain = if gain == Gain::Enough { 0 } else { in_vain + 1 };
        }
        match measured {
            Some(measured) if self.closeness == Closeness::Verdict || !self.session.is_open(&measured) => {
                Ok(measured)
            }
            other => {
                drop(other);
                self.measure_best(monitor)
            }
        }
    }

    /// Whether the best plan leaves what every path of the cutter leaves.
    fn is_unavoidable(&self, measured: &Measurement, monitor: &dyn Monitor) -> Result<bool, JobError> {
        if self.standing.round.holds(&self.goal) {
            return Ok(false);
        }
        let (session, path) = (self.session, &self.best.plan.path);
        let cutter = &session.scene.cutter;
        Ok(LeastLeftFigures::above_limit(session, cutter, path, measured, monitor)?.is_some())
    }

    /// Whether the best plan stands above the target, but little.
    fn is_near(&self) -> bool {
        let round = &self.standing.round;
        !round.holds(&self.goal) && round.highest() <= (1.0 + NEAR) * self.goal.target
    }

    /// The widths to try next. A plan that stands too high gets shorter chords where that may be enough, and narrower widths
    /// elsewhere; one that is too low gets wider ones. Levels are placed anew in each plan, so that other places may stand
    /// too high then: these are narrowed as well, from the last plan on. Last of all everything is narrowed in proportion, to
    /// which remnants along borders do not give way. `None` where the best plan holds the target and comes within `slack` of
    /// it, where it leaves what was never cut, or where what there is was tried `in_vain`.
    fn next(&self, in_vain: usize, slack: f64) -> Option<Widths> {
        let (target, round) = (self.goal.target, &self.standing.round);
        if round.highest() > NEVER_CUT * target {
            return None;
        }
        let scaled =
            |widths: &Widths, height: f64| widths.scaled((aim(target) / height).sqrt().max(MOST_NARROWED));
        let (latest_widths, latest) =
            self.latest.as_ref().map_or((&self.widths, &self.standing), |latest| (&latest.0, &latest.1));
        let in_proportion = || {
            let round = &latest.round;
            (round.highest_mm + round.margin(target) > target)
                .then(|| scaled(latest_widths, round.highest_mm))
        };
        let followed = || self.corrected(latest_widths, latest);
        match (round.holds(&self.goal), in_vain) {
            (true, 0) => (round.highest() < (1.0 - slack) * target && self.may_lie_wider())
                .then(|| scaled(&self.widths, round.highest())),
            (true, 1) => self.latest.as_ref().and_then(|_| followed()),
            (false, 0) => self.corrected(&self.widths, &self.standing).or_else(in_proportion),
            (false, ..=MOST_FOLLOWED) => followed().or_else(in_proportion),
            (false, ..=MOST_IN_VAIN) => in_proportion(),
            _ => None,
        }
    }

    /// Whether the best plan would hold the target with one pass less: where ridges are about equally high, passes are spread
    /// evenly, and each interval then grows by as much as all of them.
    fn may_lie_wider(&self) -> bool {
        let round = &self.standing.round;
        let is_even = round.median_mm.is_some_and(|median| median >= EVENLY_HIGH * round.highest());
        let intervals = path_figures(&self.best.plan.path, 0.0).passes as f64 - 1.0;
        !is_even || round.highest() * (intervals / (intervals - 1.0)).powi(2) <= self.goal.target
    }

    /// The widths of a plan corrected by the places where it leaves too much. Those that chords may have raised get shorter
    /// chords. Of the others few get passes of their own, once; many, or where that was no help, narrower widths. `None` without
    /// such places.
    fn corrected(&self, widths: &Widths, standing: &Standing) -> Option<Widths> {
        let high = self.standing_high(standing);
        if high.is_empty() {
            return None;
        }
        let is_raised = self.raised_by_chords(widths);
        let (raised, others): (Vec<_>, Vec<_>) = high.into_iter().partition(is_raised);
        let finer = widths.finer(&raised);
        if self.are_few(&others) && !others.iter().any(|place| widths.is_touched_up(place)) {
            return Some(finer.touched_up(&others));
        }
        Some(finer.narrowed(&others))
    }

    /// Whether places take so little that passes of their own are shorter than any narrower widths.
    fn are_few(&self, places: &[HighPlace]) -> bool {
        let interval = self.widths.interval;
        let cell = |at: &Point3| at.coords.map(|x| (x / interval).floor() as i64);
        let mut cells: Vec<[i64; 3]> = places.iter().map(|place| cell(&place.at).into()).collect();
        cells.sort_unstable();
        cells.dedup();
        // What a pass takes beside its length, as those of the plan do on average.
        let figures = path_figures(&self.best.plan.path, 0.0);
        let off_pass = (figures.link_length_mm + figures.air_length_mm) / figures.passes.max(1) as f64;
        let length = (TOUCH_UP_LENGTH * interval + off_pass) * cells.len() as f64;
        let whole = figures.cutting_length_mm + figures.link_length_mm + figures.air_length_mm;
        self.request.axis.is_none() && length <= MOST_TOUCH_UP * whole
    }

    /// The places of a plan that may stand above the target.
    fn standing_high(&self, standing: &Standing) -> Vec<HighPlace> {
        let cutter = &self.session.scene.cutter;
        let target = self.goal.target;
        let margin = standing.round.margin(target);
        let places = standing.above.iter().map(|&(at, height)| {
            let tip = at + cutter.contact_to_tip(&self.session.part.closest_point(&at).0.normal);
            HighPlace { at, tip, over: height + margin - target, factor: aim(target) / height }
        });
        places.filter(|place| place.over > 0.0).collect()
    }

    /// Whether it may be that chords alone have raised a place above the target, and shorter ones would not.
    fn raised_by_chords(&self, widths: &Widths) -> impl Fn(&HighPlace) -> bool {
        let most = RAISED_BY_CHORDS * self.session.scene.tolerance.chord;
        let can_be_shorter = self.request.axis.is_none() && !self.request.joining.smoothing;
        let chords = widths.chords();
        move |place| can_be_shorter && place.over <= most && chords.at(&place.tip) == 1.0
    }

    /// The plan by given widths, and their least and greatest factors.
    fn plan(&self, widths: &Widths, monitor: &dyn Monitor) -> Result<(Planned, [f64; 2]), JobError> {
        monitor::check(monitor)?;
        let correction = widths.correction();
        let factors = correction.range();
        let earlier = Earlier {
            correction,
            chords: widths.chords(),
            touch_up: widths.touch_up.clone(),
            functions: self.best.plan.functions.clone(),
        };
        Ok((self.session.plan(self.request, self.around, Some(Arc::new(earlier)), monitor)?, factors))
    }

    /// Measures all of the best plan.
    fn measure_best(&mut self, monitor: &dyn Monitor) -> Result<Measured, JobError> {
        let measured = self.session.measure(
            self.request,
            self.engine,
            &self.best.plan.path,
            Closeness::Verdict,
            monitor,
        )?;
        let factors = self.standing.round.factors;
        if let Some(standing) = Standing::of_all(&measured.measurement, &self.best, factors) {
            self.rounds[self.kept] = standing.round;
            self.standing = standing;
        }
        Ok(measured)
    }

    fn keep_if_better(&mut self, planned: Planned, widths: Widths, found: Standing) -> Gain {
        let gain = found.round.gain_over(&self.standing.round, &self.goal);
        self.rounds.push(found.round);
        self.latest = None;
        if gain == Gain::None {
            self.latest = Some((widths, found));
        } else {
            (self.best, self.widths, self.standing, self.kept) =
                (planned, widths, found, self.rounds.len() - 1);
        }
        gain
    }
}

/// [`CorrectionRound::too_near_between_mm`] of a plan.
fn too_near(planned: &Planned) -> Option<f64> {
    Some(planned.plan.too_near_between).filter(|missing| *missing > 0.0)
}

/// The height that corrected ridges are to have, mm.
fn aim(target: f64) -> f64 {
    (1.0 - 0.5 * SLACK) * target
}

/// A place that may stand above the target.
#[derive(Debug, Clone, Copy, PartialEq)]
struct HighPlace {
    at: Point3,
    /// The tip of an upright cutter that touches the part there.
    tip: Point3,
    /// By how much it may stand above the target, mm.
    over: f64,
    /// The height that it is to have as a share of the one it has.
    factor: f64,
}

/// How much narrower or wider than by calculation passes are planned, and where their chords are shorter.
#[derive(Debug, Clone, PartialEq)]
struct Widths {
    /// Places where ridges stood above the target, with their factors.
    places: Vec<(Point3, f64)>,
    /// The factor of all places.
    everywhere: f64,
    /// Tips of the cutter around which chords are shorter, with the factor of their tolerance.
    finer: Vec<(Point3, f64)>,
    /// Places that get passes of their own, while all others stay where they are.
    touch_up: Vec<Point3>,
    /// How far around a place its factor holds, mm: the interval of passes on a plane.
    interval: f64,
}

impl Widths {
    fn correction(&self) -> Correction {
        Correction::new(&self.places, self.interval).scaled(self.everywhere)
    }

    fn scaled(&self, factor: f64) -> Self {
        Self { everywhere: factor * self.everywhere, touch_up: Vec::new(), ..self.clone() }
    }

    /// Whether a pass of its own was to serve a place.
    fn is_touched_up(&self, place: &HighPlace) -> bool {
        self.touch_up.iter().any(|at| (at - place.at).norm() <= 0.5 * self.interval)
    }

    /// With passes of their own over places, the highest first.
    fn touched_up(&self, places: &[HighPlace]) -> Self {
        let mut places = places.to_vec();
        places.sort_by(|a, b| b.over.total_cmp(&a.over));
        let touch_up = self.touch_up.iter().copied().chain(places.iter().map(|place| place.at)).collect();
        Self { touch_up, ..self.clone() }
    }

    /// The factor of the chord tolerance around tips of the cutter.
    fn chords(&self) -> Correction {
        Correction::new(&self.finer, self.interval)
    }

    /// With shorter chords around places.
    fn finer(&self, places: &[HighPlace]) -> Self {
        let shorter = places.iter().map(|place| (place.tip, SHORTER_CHORDS));
        let finer = self.finer.iter().copied().chain(shorter).collect();
        Self { finer, ..self.clone() }
    }

    /// Narrower where ridges and borders stand above the target, so that they come to the middle of the slack: height goes
    /// with the square of width. A place that was narrowed already and did not give way enough is narrowed by twice as much:
    /// there passes may lie nearer than they have to, or less than all of the height goes with their width.
    fn narrowed(&self, places: &[HighPlace]) -> Self {
        if places.is_empty() {
            return self.clone();
        }
        let now = Correction::new(&self.places, self.interval);
        let narrower = places.iter().map(|place| {
            let before = now.at(&place.at);
            let power = if before < 1.0 - STILL_WIDE { 1.0 } else { 0.5 };
            (place.at, before * place.factor.powf(power).max(MOST_NARROWED))
        });
        let places = self.places.iter().copied().chain(narrower).collect();
        Self { places, touch_up: Vec::new(), ..self.clone() }
    }
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
            measured: true,
        };
        let strict = Goal { target: 1.0, rule: ScallopRule::default() };
        let better = |a: CorrectionRound, b: CorrectionRound| a.is_better(&b, &strict);
        assert!(better(round(0.8, 20.0), round(1.05, 10.0)) && !better(round(1.05, 10.0), round(0.8, 20.0)));
        assert!(better(round(0.8, 9.0), round(0.7, 10.0)) && better(round(1.1, 20.0), round(1.2, 10.0)));
        // No ridge is a reason to keep what collides.
        let colliding = |round| CorrectionRound { too_near_between_mm: Some(3.0), ..round };
        assert!(better(round(1.2, 20.0), colliding(round(0.8, 10.0))));
        assert!(!better(colliding(round(0.8, 10.0)), round(1.2, 20.0)));
        assert!(better(colliding(round(0.8, 9.0)), colliding(round(0.7, 10.0))));
        // A tenth of what stands above the target is worth another plan of its kind; less is kept, but no reason to go on.
        let gain = |a: CorrectionRound, b: CorrectionRound| a.gain_over(&b, &strict);
        assert_eq!(gain(round(1.2, 10.0), round(1.2, 10.0)), Gain::None);
        assert_eq!(gain(round(1.199, 10.0), round(1.2, 10.0)), Gain::Little);
        assert_eq!(gain(round(1.17, 10.0), round(1.2, 10.0)), Gain::Enough);
        assert_eq!(gain(round(0.99, 20.0), round(1.001, 10.0)), Gain::Enough);
        // What the scene lets stand above the target is no reason for another plan.
        let lenient = |share: f64, highest: f64| Goal { rule: ScallopRule { share, highest }, ..strict };
        assert!(round(1.2, 10.0).holds(&lenient(0.95, 1.5)) && !round(1.2, 10.0).holds(&strict));
        assert!(
            !round(1.2, 10.0).holds(&lenient(0.99, 1.5)) && !round(1.2, 10.0).holds(&lenient(0.95, 1.15))
        );
    }

    #[test]
    fn widths_go_with_the_root_of_heights_above_the_target() {
        let above = |x: f64, height: f64| {
            let at = Point3::new(x, 0.0, 0.0);
            HighPlace { at, tip: at, over: height - 1.0, factor: 0.99 / height }
        };
        let places = [above(0.0, 1.2), above(40.0, 1.1)];
        let by_calculation = Widths {
            places: Vec::new(),
            everywhere: 1.0,
            finer: Vec::new(),
            touch_up: Vec::new(),
            interval: 1.0,
        };
        let once = by_calculation.narrowed(&places);
        let found = [0.0, 10.0, 20.0, 40.0].map(|x| once.correction().at(&Point3::new(x, 0.0, 0.0)));
        let wanted = [(0.99f64 / 1.2).sqrt(), 1.0, 1.0, (0.99f64 / 1.1).sqrt()];
        assert!(found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}");
        // What was narrowed stays so, and is narrowed further where that was not enough.
        let twice = once.narrowed(&[above(0.0, 1.1)]).correction();
        assert!((twice.at(&places[0].at) - wanted[0] * 0.99 / 1.1).abs() < 1e-12);
        assert!((twice.at(&places[1].at) - wanted[3]).abs() < 1e-12);
        // Shorter chords leave all widths as they are.
        let finer = once.finer(&places[..1]);
        assert_eq!(finer.correction(), once.correction());
        assert!(
            finer.chords().at(&places[0].tip) == SHORTER_CHORDS && finer.chords().at(&places[1].tip) == 1.0
        );
    }
}
