//! What a strategy is asked for, and the one entrance to all strategies.

use std::mem;
use std::sync::Arc;

use crate::facets::facet_charge;
use crate::keep::{check_faces, keep_asked};
use crate::layers::{Layer, Levels, MOST_LEVELS};
use crate::levels::{obedience, planned_field};
use crate::link::{join, join_tilted, time_to_neighbour};
use crate::lowering::lowered;
use crate::strategies::words_for;
use crate::surface::mesh_surface;
use crate::tilt::tilted::{self, TiltedPasses, Tilting};
use crate::touch_up;
use crate::vocabulary::{
    Kept, Pace, PartKind, PassSettings, Passes, PlanError, PlanSettings, SAMPLING_OVER_RADIUS, Setup, Step,
    Strategy, Task, unused_tolerance,
};
use cutter::Cutter;
use field::PlannedField;
use geometry::{Aabb, Point3, Vector3};
use machine::{Machine, machining_time, slow_corners};
use motion::{ROUNDING, ToolAxis, Toolpath};
use part::Part;
use scallop::strip_width;
use work::monitor::Monitor;

/// A planned path and what the planner has to say about it.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// The path.
    pub path: Toolpath,
    /// Things the user should know (a singular field, a step that was limited), in plain words.
    pub notes: Vec<String>,
    /// What a streamline path was planned by.
    pub field: Option<Arc<PlannedField>>,
    /// What another plan of the same toolpath may go on from.
    pub kept: Arc<Kept>,
    /// How much nearer than asked a tool that leans comes to anything between its passes, mm; 0 where it
    /// keeps clear.
    pub too_near_between: f64,
}

impl Plan {
    /// A path and nothing else to tell of it.
    pub fn of_path(path: Toolpath, notes: Vec<String>) -> Self {
        Self { path, notes, field: None, kept: Arc::default(), too_near_between: 0.0 }
    }

    /// A path of what its strategy planned.
    pub(crate) fn new(path: Toolpath, kept: Kept) -> Self {
        Self::again(path, Arc::new(kept), Vec::new(), "")
    }

    /// With remarks besides, and words for where alone passes were asked for.
    fn again(path: Toolpath, kept: Arc<Kept>, further: Vec<String>, within: &str) -> Self {
        let mut notes = kept.notes.clone();
        let further_says = !further.is_empty();
        notes.extend(further);
        if path.is_empty() {
            let why = format!("no pass reaches the part{within}: ");
            notes.push(format!("{}the program is empty", if further_says { "" } else { &why }));
        }
        Self { path, notes, field: kept.field.clone(), kept, too_near_between: 0.0 }
    }
}

impl Kept {
    pub(crate) fn new(planned: Passes, strategy: &dyn Strategy) -> Self {
        let Passes { passes, mut notes, mut field, contacts, obedience, functions, faces, .. } = planned;
        let field = strategy.shows_field().then(|| {
            planned_field::measure(&mut field, &contacts);
            field.direction_error = obedience.error();
            notes.extend(field.direction_error.as_ref().and_then(obedience::note));
            Arc::new(field)
        });
        Self { passes, notes, field, functions, faces }
    }
}

/// A scallop target is planned for less this share of the chord tolerance, unless moves go deeper where that
/// is needed. A chord may raise a ridge by half of it, but ridges stand between chords of two passes, whose
/// greatest deviations seldom meet.
const CHORD_SHARE: f64 = 0.26;

/// The same of smoothed passes, whose points and chords stray farther.
const SMOOTHED_CHORD_SHARE: f64 = 0.5;

/// But it is not planned for less than this share of itself.
const LEAST_SHARE_OF_TARGET: f64 = 0.5;

/// Most passes that are planned: ten times what a part of ten metres takes at 0.1 mm. More of them
/// take up memory without end.
const MAX_PASSES: f64 = 1e6;

/// Most samples of passes that are planned; at a million a second they take a quarter of an hour.
const MAX_SAMPLES: f64 = 1e9;

/// Refuses what would never end. Counts no pass too many: steps are taken as great as any strategy
/// plans them.
fn check_extent(task: &Task<'_>) -> Result<(), PlanError> {
    let step = match task.settings.step {
        // As wide as the strip may be where cutter and surface fit each other.
        Step::Scallop(h) => strip_width(0.0, 0.0, h, task.cutter.radius()).0,
        Step::Stepover(s) => s,
    };
    let size = task.part.bounds().size();
    let samples = size.x / step * (size.y / task.settings.sampling);
    if size.x.max(size.y) > MAX_PASSES * step || samples > MAX_SAMPLES {
        return Err(PlanError::TooMany { step, x: size.x, y: size.y });
    }
    Ok(())
}

/// Plans one path of an upright cutter.
///
/// An allowance is left by the path of a cutter that is larger by it on all sides.
///
/// # Errors
/// See [`PlanError`].
pub fn plan(
    part: &Part,
    cutter: &Cutter,
    strategy: &dyn Strategy,
    settings: &PlanSettings,
    monitor: &dyn Monitor,
) -> Result<Plan, PlanError> {
    settings.check()?;
    if settings.allowance == 0.0 {
        return plan_on(part, cutter, strategy, settings, monitor);
    }
    let (grown, below) = cutter.grown(settings.allowance).map_err(|error| PlanError::NotApplicable {
        strategy: strategy.definition().word,
        reason: format!("with the allowance, {error}"),
    })?;
    // Its tip lies so much lower than that of the cutter, and all heights with it.
    let down = Vector3::new(0.0, 0.0, -below);
    let lower = |block: Aabb| Aabb { min: block.min + down, max: block.max + down };
    let settings = PlanSettings {
        stock_top: settings.stock_top - below,
        stock: settings.stock.map(lower),
        ..settings.clone()
    };
    let mut plan = plan_on(part, &grown, strategy, &settings, monitor)?;
    plan.path = plan.path.moved(-down);
    Ok(plan)
}

/// As [`plan`] where nothing is left on the part.
fn plan_on(
    part: &Part,
    cutter: &Cutter,
    strategy: &dyn Strategy,
    settings: &PlanSettings,
    monitor: &dyn Monitor,
) -> Result<Plan, PlanError> {
    let setup = Setup { part, cutter, settings, monitor };
    let (kept, added) = with_task(&setup, strategy, None, |task| {
        let again = settings.earlier.iter().find(|earlier| earlier.again);
        let kept = match again {
            Some(earlier) => earlier.kept.clone(),
            None => {
                check_faces(task)?;
                let mut passes = strategy.passes(task)?;
                keep_asked(task, &settings.places, &mut passes)?;
                Arc::new(Kept::new(passes, strategy))
            }
        };
        let added = touch_up::passes(task, &kept.passes)?;
        Ok((kept, added))
    })?;
    let of_rest = settings.places.rest.as_ref().and_then(|rest| rest.note());
    let further = touch_up::note(&added).into_iter().chain(of_rest).collect();
    let all = kept.passes.iter().cloned().chain(added).collect();
    let all = deeper(all, cutter, settings);
    let path = join(by_levels(all, &setup)?, strategy.both_ways(), &setup)?;
    let within = settings.places.boundary.as_ref().map_or("", |_| " within `boundary`");
    Ok(Plan::again(path, kept, further, within))
}

/// Passes as they are cut one layer after the other.
fn by_levels(passes: Vec<Vec<Point3>>, setup: &Setup<'_>) -> Result<Vec<Layer>, PlanError> {
    let Setup { part, cutter, settings, monitor } = *setup;
    let Some(stepdown) = settings.stepdown else { return Ok(vec![Layer::whole(passes)]) };
    let stock = settings.stock.unwrap_or_else(|| part.bounds());
    let meets = |tip: &Point3| {
        let nearest = tip.xy().sup(&stock.min.xy()).inf(&stock.max.xy());
        cutter.height((tip.xy() - nearest).norm()).map(|rise| tip.z + rise)
    };
    let levels = Levels::new(&passes, settings.stock_top, stepdown, meets);
    if levels.count() > MOST_LEVELS {
        return Err(PlanError::TooManyLevels { stepdown, levels: levels.count() });
    }
    Ok(levels.layers(&passes, monitor)?)
}

/// Passes of an upright cutter, deeper beside places where an earlier plan left a little too much.
fn deeper(passes: Vec<Vec<Point3>>, cutter: &Cutter, settings: &PlanSettings) -> Vec<Vec<Point3>> {
    let most = unused_tolerance(settings.chord_tolerance, settings.joining.smoothing);
    match &settings.earlier {
        Some(earlier) if earlier.again => lowered(&passes, cutter, &earlier.lowered, most),
        _ => passes,
    }
}

/// Plans one path of a cutter that tilts.
///
/// On patches the cutter is located by its contact, on level curves of the strategy's function. A ball
/// cutter's centre stands where it does upright, so that on meshes, and with strategies that drop the cutter,
/// the upright path is tilted around it. Other cutters are located there by the contacts of a ball that is
/// dropped in their stead.
///
/// # Errors
/// See [`PlanError`].
pub fn plan_tilted(
    part: &Part,
    cutter: &Cutter,
    strategy: &dyn Strategy,
    tilting: &Tilting,
    settings: &PlanSettings,
    monitor: &dyn Monitor,
) -> Result<Plan, PlanError> {
    settings.check()?;
    part.mesh().surface().map_err(|e| PlanError::NotApplicable {
        strategy: strategy.definition().word,
        reason: format!("a cutter that tilts needs a surface with two sides. {e}"),
    })?;
    let setup = Setup { part, cutter, settings, monitor };
    let (mut planned, added) = with_task(&setup, strategy, Some(tilting.axis), |task| {
        let planned = strategy.passes(task)?;
        let added = touch_up::passes(task, &planned.passes)?;
        Ok((planned, added))
    })?;
    planned.notes.extend(touch_up::note(&added));
    let (passes, touches) = (mem::take(&mut planned.passes), mem::take(&mut planned.touches));
    let ball = tilted::probe(cutter).unwrap_or(*cutter);
    let tilt = |passes: &[Vec<Point3>]| {
        tilted::around_centres(&tilted::Dropped { passes, ball: &ball }, tilting.axis, &setup)
    };
    let mut touches = if touches.is_empty() && !passes.is_empty() {
        tilt(&passes)?
    } else {
        TiltedPasses::located(touches, settings.chord_tolerance)
    };
    if !added.is_empty() {
        touches.append(tilt(&added)?);
    }
    touches.smoothing = settings.joining.smoothing.then_some(SAMPLING_OVER_RADIUS * cutter.radius());
    let (path, too_near_between) =
        join_tilted(touches, strategy.both_ways(), tilting, &setup, &mut planned.notes)?;
    Ok(Plan { too_near_between, ..Plan::new(path, Kept::new(planned, strategy)) })
}

/// What is made of the task that a strategy is given.
fn with_task<T>(
    setup: &Setup<'_>,
    strategy: &dyn Strategy,
    axis: Option<&ToolAxis>,
    make: impl FnOnce(&Task<'_>) -> Result<T, PlanError>,
) -> Result<T, PlanError> {
    let Setup { part, cutter, settings, monitor } = *setup;
    let definition = strategy.definition();
    if !definition.part.suits(PartKind::Surface) {
        let reason = format!("it mills pockets; use one of {}", words_for(PartKind::Surface));
        return Err(PlanError::NotApplicable { strategy: definition.word, reason });
    }
    // Passes over a part far smaller than the cutter would begin and end between two samples.
    let size = part.bounds().size();
    let narrowest = [size.x, size.y].into_iter().filter(|width| *width > 0.0).fold(f64::INFINITY, f64::min);
    let sampling = (SAMPLING_OVER_RADIUS * cutter.radius()).min(0.5 * narrowest);
    let probe = axis.and_then(|_| tilted::probe(cutter));
    let pass = PassSettings {
        step: settings.step,
        sampling,
        chord_tolerance: settings.chord_tolerance,
        // A tilted cutter's passes are smoothed once they are tilted.
        smoothing: (settings.joining.smoothing && axis.is_none()).then_some(sampling),
        axis,
        faces: settings.faces,
        memory: settings.memory,
        earlier: settings.earlier.as_deref(),
        probe: probe.as_ref(),
    };
    let wants_mesh = mesh_surface::wants_mesh(part, cutter);
    let duration = |passes: &Passes, chords: f64| duration(passes, chords, strategy.both_ways(), setup);
    let feed = settings.feed_rate / 60.0;
    let bend = feed * feed / settings.machine.acceleration;
    let pace = Pace { duration: &duration, link: feed * time_to_neighbour(setup), bend };
    let mut task = Task { part, cutter, settings: pass, wants_mesh, pace, monitor };
    task.settings.step = charged_step(&task, strategy, settings);
    check_extent(&task)?;
    make(&task)
}

/// The time, s, that the machine takes for passes once they are joined. Jerks of its axes are left out: they
/// take seconds to search for, and slow all plans of a part alike.
fn duration(
    passes: &Passes,
    chord_tolerance: f64,
    both_ways: bool,
    setup: &Setup<'_>,
) -> Result<f64, PlanError> {
    let machine = Machine { jerks: [f64::INFINITY; 3], ..setup.settings.machine };
    let settings = &PlanSettings { chord_tolerance, machine, ..setup.settings.clone() };
    let passes = vec![Layer::whole(passes.passes.clone())];
    let mut path = join(passes, both_ways, &Setup { settings, ..*setup })?;
    if machine.slow_corners {
        path = slow_corners(&path, &machine);
    }
    Ok(machining_time(&path, &machine, setup.monitor)?)
}

/// The distance of passes less what chords, facets and the program's decimals take of a scallop target.
fn charged_step(task: &Task<'_>, strategy: &dyn Strategy, settings: &PlanSettings) -> Step {
    let Step::Scallop(h) = settings.step else { return settings.step };
    let fitted = !strategy.on_facets(task) && !task.wants_mesh;
    let smooth = !task.part.patches().is_empty();
    let facets = if smooth { 0.0 } else { facet_charge(task.part.mesh(), fitted, h) };
    let chords = match (settings.joining.smoothing, settings.is_lowered_later) {
        // More than smoothing leaves of the tolerance.
        (true, _) => SMOOTHED_CHORD_SHARE,
        (false, true) => 0.0,
        (false, false) => CHORD_SHARE,
    };
    let less = chords * settings.chord_tolerance + facets + ROUNDING;
    Step::Scallop((h - less).max(LEAST_SHARE_OF_TARGET * h))
}
