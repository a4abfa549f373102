//! Pockets: a plane region with islands, cut down to a level floor in steps.
//!
//! Enters: the region, its depth, the cutter. Leaves: a program. The cutter's centre stays in the region
//! drawn in by the cutter's radius. Passes there are level curves of a flow that follows walls and islands
//! (or offsets of them, or parallel lines, or levels of a stream function that follows directions), cut from
//! the inside outwards, so that only the first pass of each nest is a slot; each nest is entered by a helix
//! where there is room, else by a ramp along its first pass. Where an engagement is asked for, passes go
//! along the border of the stock instead, which they turn into as far as the limit allows (`peel`,
//! `clearing`), and what they leave is found and cleared by loops (`rest`, `bounded`). What passes without a
//! limit leave gets short ones of its own (`rest`, `ridges`). Every finished move keeps to the exact region
//! (`walls`).
//! The design's frame: z = 0 is the upper face, the floor lies at minus the depth; mm.

mod air;
mod beginnings;
mod bounded;
mod chambers;
mod cleared;
mod clearing;
mod descend;
mod feed;
mod finish;
mod front;
mod lines;
mod link;
mod loops;
mod nest;
mod peel;
mod rest;
mod ridges;
mod route;
mod shape;
pub(crate) mod strategy;
mod stream;
#[cfg(test)]
mod tests;
mod turning;
mod walls;
mod way;

use air::Air;
use bounded::Rules;
use cleared::Cleared;
pub use cleared::Gentle;
pub use feed::{Engagement, Exceeding, LEAST_SHARE, engagement, engagement_angle, limit_feed};
use nest::NestError;
use route::Run;
pub use shape::{NotOnOutline, Pocket};
pub use strategy::{Flow, Pattern, PocketStrategy, WallFinish, read_pocket_step};
pub use stream::Vectors;
use turning::Turning;

use crate::plan::Plan;
use crate::surface::feed::check as feed_check;
use crate::vocabulary::{Kept, Passes, PlanError, PlanSettings, Strategy};
use cutter::Cutter;
use geometry::{Aabb, Piece, Point2, Point3, Region, SegmentGrid};
use machine::machining_time;
use motion::ROUNDING;
use work::monitor::{self, Cancelled, Monitor};

/// Share of the flat bottom's radius that innermost passes may lie from what they have to clear.
const REACH: f64 = 0.95;

/// Flats that are narrower than this over the stepover leave ridges between all passes.
const HALF_STEP: f64 = 0.51;

/// Longest move over the cutter's radius: feeds and engagement belong to moves.
const MOVE_OVER_RADIUS: f64 = 0.5;

/// Sides that are left out turn from the one instead by this much at most where the engagement is bounded,
/// rad: it adds to the angle ahead. With what the angle may have more between two places it is what plans
/// have to spare.
const MOST_TURN: f64 = strategy::SPARE - cleared::BETWEEN;

/// Sides of spirals and links over the stepover.
const SPACING: f64 = 0.25;

/// Share of the chord tolerance that straight moves may be off the curves that they stand for.
const CHORDS_SHARE: f64 = 0.5;

/// What is left on walls for the decimals of the program, mm. Rounding cuts in by less than their last
/// decimal, and no layer as thin as that stays along walls whose places have no more decimals.
const WRITTEN: f64 = 0.5 * ROUNDING;

/// Precision of the largest cutter that an error names, mm.
const DISC_PRECISION: f64 = 0.005;

/// Plans one pocket.
///
/// # Errors
/// [`PlanError`]: no position for the cutter (with the largest diameter that would do), a cutter whose
/// sides are not vertical, passes without end.
pub fn plan_pocket(
    pocket: &Pocket,
    cutter: &Cutter,
    strategy: &PocketStrategy,
    settings: &PlanSettings,
    monitor: &dyn Monitor,
) -> Result<Plan, PlanError> {
    settings.check()?;
    let refuse = |reason: String| PlanError::NotApplicable { strategy: strategy.definition().word, reason };
    if !cutter.is_end_mill() {
        return Err(refuse("its walls are vertical; use a flat, bull or ball cutter".into()));
    }
    monitor.start("planning pocket", 0);
    let radius = cutter.radius();
    // Straight sides of an inset stand off farther than they are asked to.
    let off = radius + WRITTEN;
    let inset = pocket.free().watched_inset(off - Region::offset_excess(off), monitor)?;
    let walls_at = walls::tangent(inset, pocket.free(), off);
    let Some(around) = pocket.free().bounds().filter(|_| !walls_at.is_empty()) else {
        let largest = pocket.free().largest_disc(DISC_PRECISION, monitor)?.map_or(0.0, |d| 2.0 * d.1);
        return Err(refuse(format!(
            "a cutter of {} mm fits nowhere in the outline; the largest that would is {:.2} mm",
            2.0 * radius,
            (largest * 100.0).floor() / 100.0
        )));
    };
    let rough = if strategy.wall_allowance > 0.0 {
        pocket.free().watched_inset(off + strategy.wall_allowance, monitor)?
    } else {
        walls_at.clone()
    };
    let mut planned = Passes::default();
    if rough.is_empty() {
        planned.notes.push(
            "no room for passes within the wall allowance: only the pass along the walls is cut".into(),
        );
    }
    if let Pattern::Streamline(vectors) = &strategy.pattern {
        let [low, high] = around.map(|p| Point3::new(p.x, p.y, 0.0));
        let domain = [[low.x, high.x], [low.y, high.y]];
        planned.notes.extend(feed_check(&vectors.direction, &Aabb { min: low, max: high }, &[domain])?);
    }
    let air = Air::of(pocket, radius);
    let step = strategy.stepover(settings.step, radius);
    let mut ground = Cleared::new(around, radius);
    ground.gentle.clone_from(&strategy.gentle);
    air.iter().flat_map(|air| &air.discs).for_each(|p| ground.add(*p));
    let mut planner = Planner {
        cutter,
        strategy,
        step,
        rules: strategy.rules(step, cutter, pocket.depth),
        air,
        ground,
        bounding: bounded::Bounding::default(),
        planned,
        settings,
        depth: pocket.depth,
        monitor,
    };
    let (mut clearing, groups) = planner.clear(&rough)?;
    let along_walls = match strategy.wall_allowance > 0.0 {
        true => finish::along_walls(&walls_at, &rough, radius),
        false => Vec::new(),
    };
    let apart = walls_at.pieces.len();
    if apart > 1 {
        planner
            .planned
            .notes
            .push(format!("the cutter's centre has room in {apart} places apart from each other"));
    }
    let rest = pocket.rest_area(cutter, monitor)?;
    planner.planned.notes.push(format!(
        "{rest:.3} mm² of {:.1} mm² are out of the cutter's reach: corners, or places narrower than it",
        pocket.region.area()
    ));
    clearing.extend(planner.kept(groups)?);
    let along_walls = planner.kept(along_walls)?;
    let mut runs =
        descend::Runs { clearing: planner.trimmed(clearing), along_walls: planner.trimmed(along_walls) };
    let turn = strategy.bounded().map_or(std::f64::consts::PI, |_| MOST_TURN);
    let walls = walls::Walls::new(pocket.free(), off - walls::ROUNDING);
    let chords = CHORDS_SHARE * settings.chord_tolerance;
    for run in runs.clearing.iter_mut().chain(&mut runs.along_walls) {
        monitor::check(monitor)?;
        let holds = |a: &Point2, b: &Point2| walls.hold(a, b);
        run.points = descend::shortened(&run.points, chords, MOVE_OVER_RADIUS * radius, turn, holds);
    }
    let path = descend::program(&runs, [pocket.depth, radius], strategy, settings);
    let Planner { mut planned, bounding, rules, .. } = planner;
    if rules.is_some() {
        tell_bounding(&bounding, &mut planned.notes);
    }
    planned.contacts.iter_mut().flatten().for_each(|contact| contact.at.z = -pocket.depth);
    Ok(Plan::new(path, Kept::new(planned, strategy)))
}

/// Runs of pieces of the region in which the cutter's centre has room.
type Groups<'p> = Vec<(&'p Piece, Vec<Run>)>;

/// Clears one pocket.
struct Planner<'a> {
    cutter: &'a Cutter,
    strategy: &'a PocketStrategy,
    /// Stepover, mm.
    step: f64,
    /// Of an engagement that is asked for.
    rules: Option<Rules>,
    /// What lies open beside the pocket.
    air: Option<Air>,
    ground: Cleared,
    /// What kept the engagement to the limit.
    bounding: bounded::Bounding,
    planned: Passes,
    settings: &'a PlanSettings,
    /// Depth of the floor, mm.
    depth: f64,
    monitor: &'a dyn Monitor,
}

/// Runs of a piece, and what is to be told of them.
struct Planned {
    runs: Vec<Run>,
    note: Option<String>,
}

impl From<Vec<Run>> for Planned {
    fn from(runs: Vec<Run>) -> Self {
        Self { runs, note: None }
    }
}

impl Planner<'_> {
    /// Runs that are as they will be cut, and others by piece.
    fn clear<'p>(&mut self, rough: &'p Region) -> Result<(Vec<Run>, Groups<'p>), PlanError> {
        let (mut peeled, mut left, mut groups) = (Vec::new(), Vec::new(), Vec::new());
        for piece in &rough.pieces {
            monitor::check(self.monitor)?;
            if let (Some(rules), true) = (&self.rules, self.strategy.pattern.peels())
                && let Some(clearing) =
                    clearing::clear(piece, self.air.as_ref(), &mut self.ground, rules, self.monitor)?
            {
                peeled.extend(clearing.peeled);
                left.extend(clearing.rest);
                self.bounding.add(clearing.bounding);
                continue;
            }
            groups.push((piece, self.runs_of(piece)?));
        }
        peeled.extend(left);
        Ok((peeled, groups))
    }

    fn runs_of(&mut self, piece: &Piece) -> Result<Vec<Run>, PlanError> {
        let Self { cutter, strategy, step: interval, monitor, .. } = *self;
        let helix = self.air.is_none();
        let flat = cutter.flat_radius();
        // Passes under which the bottom is level for half an interval leave no ridges.
        let ridges = self.rules.is_none() && flat < HALF_STEP * interval;
        let step = if ridges { ridges::INTERVAL_SHARE * interval } else { interval };
        let plans = piece_runs(piece, cutter, strategy, step, helix, &mut self.planned, monitor)?;
        // Loops that bound the engagement lean to one side of lines, and may find no room beside a way from
        // elsewhere.
        let finished = |mut runs: Vec<Run>| -> Result<Vec<Run>, PlanError> {
            if self.rules.is_some() {
                return Ok(runs);
            }
            if ridges {
                ridges::cut(piece, &mut runs, 0.5 * interval, monitor)?;
            } else {
                // Passes far from each other may leave something at sharp turns of inner ones.
                runs.extend(rest::runs_to_rest(piece, &runs, flat, monitor)?);
            }
            let Some(air) = &self.air else { return Ok(runs) };
            let room = walls::Room::new(piece);
            Ok(runs.into_iter().map(|run| air.entered(run, &room)).collect())
        };
        let single = plans.len() == 1;
        let mut best: Option<(f64, Planned)> = None;
        for plan in plans {
            let plan = Planned { runs: finished(plan.runs)?, ..plan };
            let time = if single { 0.0 } else { self.time(&plan.runs)? };
            if best.as_ref().is_none_or(|best| time < best.0) {
                best = Some((time, plan));
            }
        }
        let Some((_, Planned { runs, note })) = best else { return Ok(Vec::new()) };
        self.planned.notes.extend(note);
        Ok(runs)
    }

    /// Machining time of runs, about as they will be cut, s.
    fn time(&self, runs: &[Run]) -> Result<f64, Cancelled> {
        let (settings, radius) = (self.settings, self.cutter.radius());
        let mut clearing = self.trimmed(runs.to_vec());
        let chords = CHORDS_SHARE * settings.chord_tolerance;
        for run in &mut clearing {
            let (longest, turn) = (MOVE_OVER_RADIUS * radius, std::f64::consts::PI);
            run.points = descend::shortened(&run.points, chords, longest, turn, |_, _| true);
        }
        let runs = descend::Runs { clearing, along_walls: Vec::new() };
        let path = descend::program(&runs, [self.depth, radius], self.strategy, settings);
        machining_time(&path, &settings.machine, self.monitor)
    }

    /// All runs, within the room that their pieces have and the engagement that is asked for.
    fn kept(&mut self, groups: Groups<'_>) -> Result<Vec<Run>, PlanError> {
        let mut kept = Vec::new();
        for (piece, mut runs) in groups {
            let room = walls::Room::new(piece);
            match &self.rules {
                Some(rules) => {
                    let did = bounded::bound_all(&mut runs, &room, &mut self.ground, rules, self.monitor)?;
                    self.bounding.add(did);
                }
                None => room.keep_all(&mut runs, self.monitor)?,
            }
            kept.extend(runs);
        }
        Ok(kept)
    }

    /// What is left of runs where nothing lies open.
    fn trimmed(&self, runs: Vec<Run>) -> Vec<Run> {
        let Some(air) = &self.air else { return runs };
        runs.into_iter().flat_map(|run| air.trimmed(run)).collect()
    }
}

/// Notes what kept the engagement to the limit, and where nothing did.
fn tell_bounding(bounded::Bounding { loops, above }: &bounded::Bounding, notes: &mut Vec<String>) {
    if *loops > 0 {
        notes.push(format!("{loops} loops in each step down bound the engagement"));
    }
    if let Some((place, longest)) = above.iter().max_by(|a, b| a.1.total_cmp(&b.1)) {
        let all: f64 = above.iter().map(|stretch| stretch.1).sum();
        notes.push(format!(
            "{all:.2} mm of each step down are above the engagement, where no loop could be put in (the longest stretch, {longest:.2} mm, begins at {:.2}, {:.2}); the feed falls there",
            place.x, place.y
        ));
    }
}

/// The runs of a piece, of flows by each of their smoothing lengths where none is asked for.
fn piece_runs(
    piece: &Piece,
    cutter: &Cutter,
    strategy: &PocketStrategy,
    step: f64,
    helix: bool,
    planned: &mut Passes,
    monitor: &dyn Monitor,
) -> Result<Vec<Planned>, PlanError> {
    let failed = |e: NestError| match e {
        NestError::Cancelled(c) => PlanError::Cancelled(c),
        e => PlanError::NotApplicable { strategy: strategy.definition().word, reason: e.to_string() },
    };
    let radius = cutter.radius();
    let flat = cutter.flat_radius();
    let turning = strategy.bounded().map(|limit| Turning { limit, radius });
    // Corners of curves that lie far apart leave ridges under a round bottom, and those get ways of their own.
    let round = turning.is_none() && flat < HALF_STEP * step;
    let reach = if flat > 0.0 && !round { REACH * flat } else { step };
    let spacing = match turning {
        Some(turning) => nest::Spacing::bounded(step, reach, turning),
        None => nest::Spacing::lenient(step, reach),
    };
    let (nests, spiral) = match &strategy.pattern {
        Pattern::Streamline(vectors) => {
            return Ok(vec![stream::runs(piece, vectors, cutter, step, planned, monitor)?.into()]);
        }
        Pattern::Zigzag { angle } => {
            let step = turning.map_or(step, |turning| step.min(turning.step(0.0)));
            return Ok(vec![lines::runs(piece, *angle, step).into()]);
        }
        Pattern::Offset { spiral } => {
            (vec![(nest::offsets(piece, &spacing, monitor).map_err(failed)?, None)], *spiral)
        }
        Pattern::Flow(flow) => {
            let mut nests = nest::flows(piece, flow, spacing, reach, monitor).map_err(failed)?;
            if turning.is_some() {
                // What loops add is known only once all is planned.
                nests.sort_by(|a, b| a.0.length().total_cmp(&b.0.length()));
                nests.truncate(1);
            }
            let plain = nest::offsets(piece, &spacing, monitor).map_err(failed)?.length();
            let note = |nest: &nest::Nest, sigma: f64| {
                format!(
                    "the flow is smoothed over {sigma:.2} mm; its passes are {:.1} mm long, offsets of the walls would be {plain:.1} mm",
                    nest.length()
                )
            };
            let noted = |(nest, sigma)| {
                let note = note(&nest, sigma);
                (nest, Some(note))
            };
            (nests.into_iter().map(noted).collect(), flow.spiral)
        }
    };
    let walls = SegmentGrid::of_curves(piece.curves());
    let leads = if turning.is_some() { route::LONG_LEADS } else { route::LEADS };
    let [wanted, least] = strategy.helix(radius);
    // A way from outside needs none.
    let helix = [wanted, if helix { least } else { f64::INFINITY }];
    let settings = route::RouteSettings { helix, spiral, spacing: SPACING * step, leads };
    let planned = |(nest, note)| Planned { runs: route::runs(&nest, &walls, &settings), note };
    Ok(nests.into_iter().map(planned).collect())
}
