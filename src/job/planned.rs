//! Planning one toolpath: strategy, tilts, feeds, joints, program.

use std::sync::Arc;

use cutter::Cutter;
use io::ProgramHeader;
use io::gcode::{self, ArcRule, FiveAxisPost, MoveLines};
use machine::kinematics::{Following, JointPath, Kinematics, Waypoint, follow};
use machine::{
    Straying, axes_at_most, machining_time, machining_time_of_axes, machining_time_of_program,
    merge_short_moves, slow_axes, slow_corners,
};
use metrology::{
    ContactArcs, FastestTurn, PathFigures, THIN_LAYER, UNCOUNTED_LAYER, contact_arcs, fastest_turn,
    fastest_turn_across, path_figures,
};
use motion::{Move, MoveKind, Toolpath};
use scene::{AxisRequest, FiveAxis, Scene, Tooling, ToolpathRequest};
use toolpath::{
    Detour, Earlier, Engagement, Exceeding, ForeignProgram, Gentle, OffsetDrive, OffsetSurface, Places, Plan,
    PlanError, PlanSettings, PocketStrategy, ReadProgram, Step, Strategy, Tilting, around_fixtures,
    engagement, plan, plan_pocket, plan_tilted,
};
use work::monitor::{Cancelled, Monitor};

use super::correction::CorrectionFigures;
use super::equal_time::EqualTimeFigures;
use super::pocket::limit_feed_by;
use super::tool::{Around, Tool};
use super::{JobError, Session};

/// One part in so many of the memory that the part leaves is for the tables of a plan.
const PLAN_SHARE: u64 = 2;

/// Share of the turning that was asked for which axes are planned by: moves take the chord of the contact's
/// way, which is shorter than the way.
const TURNING_SHARE: f64 = 0.99;

/// A planned toolpath as the machine runs it.
#[derive(Debug)]
pub(crate) struct Planned {
    /// The path and what its planner says.
    pub plan: Plan,
    /// The strategy, with the surfaces that it rides on.
    pub strategy: Box<dyn Strategy>,
    /// The path in the joints of a five-axis machine.
    pub joints: Option<JointPath>,
    /// What its programs say before the first move.
    pub header: ProgramHeader,
    /// Engagement in a pocket, and the bound of its greatest angle, rad.
    pub engaged: Option<(Engagement, f64)>,
    /// The same with thinner layers counted, where an engagement was asked for.
    pub engaged_thinly: Option<(Engagement, f64)>,
    /// The rounds in which its ridges were measured and corrected.
    pub correction: Option<CorrectionFigures>,
    /// The search for the machining time that was asked for.
    pub equal_time: Option<EqualTimeFigures>,
}

impl Planned {
    fn new(plan: Plan, strategy: Box<dyn Strategy>, header: ProgramHeader) -> Self {
        Self {
            plan,
            strategy,
            joints: None,
            header,
            engaged: None,
            engaged_thinly: None,
            correction: None,
            equal_time: None,
        }
    }

    /// Time that the scene's machine takes, s.
    pub fn time(&self, scene: &Scene, monitor: &dyn Monitor) -> Result<f64, Cancelled> {
        let (path, machine) = (&self.plan.path, &scene.machine);
        let moving = match (self.on_axes(scene), self.read_on_axes(scene)) {
            (Some((kinematics, joints)), _) => {
                machining_time_of_axes(path, machine, kinematics, joints, monitor)?
            }
            (None, Some((kinematics, read))) => {
                let of_tool = |(tool, program): &(u32, Vec<Waypoint>)| {
                    let kinematics = read.with_tool(kinematics, *tool);
                    machining_time_of_program(program, machine, &kinematics, monitor)
                };
                read.joints.iter().map(of_tool).sum::<Result<f64, Cancelled>>()?
            }
            (None, None) => machining_time(path, machine, monitor)?,
        };
        Ok(moving + path.origin.standing_s)
    }

    /// Figures of the path. Its approaches, which are rapids, are no way in the air.
    pub fn path_figures(&self, scene: &Scene, monitor: &dyn Monitor) -> Result<PathFigures, Cancelled> {
        let path = &self.plan.path;
        let mut figures = path_figures(path, self.time(scene, monitor)?);
        let approaches = path.segments().zip(path.counts()).filter(|(_, counts)| !counts);
        let length: f64 = approaches.map(|((from, to, _), _)| (to - from).norm()).sum();
        figures.air_length_mm = (figures.air_length_mm - length).max(0.0);
        Ok(figures)
    }

    /// Time that its axes take at most from location to location, s; 0 on machines of three axes.
    pub fn joint_time(&self, scene: &Scene) -> f64 {
        self.on_axes(scene).map_or(0.0, |(kinematics, joints)| axes_at_most(kinematics, joints))
    }

    /// A program from elsewhere that names the axes of a machine with rotary ones.
    fn read_on_axes<'a>(&'a self, scene: &'a Scene) -> Option<(&'a Kinematics, &'a ReadProgram)> {
        let read = self.strategy.downcast_ref::<ForeignProgram>()?.read.as_deref()?;
        let kinematics = &scene.five_axis.as_ref()?.kinematics;
        (!read.joints.is_empty()).then_some((kinematics, read))
    }

    fn on_axes<'a>(&'a self, scene: &'a Scene) -> Option<(&'a Kinematics, &'a JointPath)> {
        Some((&scene.five_axis.as_ref()?.kinematics, self.joints.as_ref()?))
    }
}

impl Session {
    /// Plans one toolpath.
    pub(crate) fn plan(
        &self,
        request: &ToolpathRequest,
        around: Around<'_>,
        monitor: &dyn Monitor,
    ) -> Result<Planned, JobError> {
        let planned = self.plan_way(request, around, None, monitor)?;
        self.with_feeds(request, planned, monitor)
    }

    /// The way of one toolpath, from what an earlier plan left if there is one: its feeds are those that were asked
    /// for, and it stands in no program yet. What it cuts is that of the finished plan.
    pub(crate) fn plan_way(
        &self,
        request: &ToolpathRequest,
        around: Around<'_>,
        earlier: Option<Arc<Earlier>>,
        monitor: &dyn Monitor,
    ) -> Result<Planned, JobError> {
        let scene = &self.scene;
        let strategy = self.strategy(request)?;
        if let Some(read) = request.foreign() {
            let plan = Plan::of_path(read.path.clone(), read.notes.clone());
            return Ok(Planned::new(plan, strategy, self.header(request, None)));
        }
        let places = Places { boundary: request.boundary.clone(), rest: around.rest.cloned() };
        let settings = PlanSettings { earlier, places, ..self.settings(request) };
        let planned = |strategy: &dyn Strategy| {
            let found = self.path(request, strategy, &settings, around, monitor);
            let mut plan = found.map_err(|e| self.refused(request, e))?;
            let pocket = strategy.downcast_ref::<PocketStrategy>();
            let bounded = pocket.is_some_and(|strategy| strategy.engagement.is_some());
            let (path, left_out) =
                self.as_written(request, &plan.path, if bounded { BOUNDED_STRAYING } else { 1.0 });
            plan.path = path;
            if left_out > 0 {
                let moves = if left_out == 1 { "move" } else { "moves" };
                let are = if left_out == 1 { "is" } else { "are" };
                plan.notes.push(format!(
                    "{left_out} {moves} shorter than the control takes for a line {are} merged within the chord tolerance"
                ));
            }
            let engaged = self.limit_feed(request, &mut plan.path, monitor)?;
            Ok::<_, JobError>((plan, engaged))
        };
        let (mut plan, engaged) =
            within_engagement(planned(&*strategy)?, &*strategy, request.tooling.cutter.radius(), &planned)?;
        let engaged_thinly = self.engaged_thinly(request, &plan.path, monitor)?;
        let joints = joints(scene, request, around.tool, &plan.path)?;
        let tops = around.fixtures.iter().map(|(mesh, _)| mesh.bounds().max.z + scene.clearance);
        let rise_to = tops.reduce(f64::max);
        let header = self.header(request, rise_to);
        plan.path.origin.strays = scene.arcs.unwrap_or(0.0);
        if let Some(JointPath { strays: [tip, axis], .. }) = joints {
            plan.path.origin.strays += tip + axis * around.tool.cutter.reach();
            plan.path.origin.leans = axis;
        }
        Ok(Planned { joints, engaged, engaged_thinly, ..Planned::new(plan, strategy, header) })
    }

    /// A planned way with feeds that all axes follow, and its lines in the program.
    pub(crate) fn with_feeds(
        &self,
        request: &ToolpathRequest,
        mut planned: Planned,
        monitor: &dyn Monitor,
    ) -> Result<Planned, JobError> {
        // Programs from elsewhere have their own.
        if request.foreign().is_some() {
            return Ok(planned);
        }
        let (scene, Planned { plan, joints, header, .. }) = (&self.scene, &mut planned);
        if scene.machine.slow_corners {
            let kinematics = scene.five_axis.as_ref().map(|five_axis| &five_axis.kinematics);
            plan.path = slow_axes(&plan.path, &scene.machine, kinematics.zip(joints.as_ref()), monitor)?;
        }
        plan.path.origin.lines =
            lines(scene, (&plan.path, &request.tooling.cutter), joints.as_ref(), header)?;
        Ok(planned)
    }

    fn path(
        &self,
        request: &ToolpathRequest,
        strategy: &dyn Strategy,
        settings: &PlanSettings,
        around: Around<'_>,
        monitor: &dyn Monitor,
    ) -> Result<Plan, PlanError> {
        let cutter = &request.tooling.cutter;
        let pocket = self.pocket.as_ref().zip(strategy.downcast_ref::<PocketStrategy>());
        let plan = match (pocket, &request.axis) {
            (Some((pocket, strategy)), _) => plan_pocket(pocket, cutter, strategy, settings, monitor)?,
            (None, None) => plan(&self.part, cutter, strategy, settings, monitor)?,
            (None, Some(axis)) => {
                let keep = around.tool.keep_clear(&self.scene, around.near, around.fixtures);
                let planned = |share: f64| {
                    let tilting = Tilting {
                        axis: &axis.rule,
                        most_turning: axis.most_turning.map(|rate| share * rate),
                        most_turning_across: axis.most_turning_across.map(|rate| share * rate),
                        interference: Some(&keep),
                    };
                    plan_tilted(&self.part, cutter, strategy, &tilting, settings, monitor)
                };
                let turns = |plan: &Plan| self.turning(request, axis, plan, monitor);
                return within_turning(&planned, &turns);
            }
        };
        let keep = around.tool.keep_off_fixtures(&self.scene, around.fixtures);
        let Detour { path, note, .. } = around_fixtures(plan.path, &keep, settings, monitor)?;
        let notes = plan.notes.into_iter().chain(note).collect();
        Ok(Plan { path, notes, ..plan })
    }

    /// A path as programs say it, which is what is cut and measured: without moves shorter than the control
    /// takes (merged within a share of the chord tolerance), slowed in corners, rounded; and how many moves
    /// are left out.
    fn as_written(&self, request: &ToolpathRequest, path: &Toolpath, share: f64) -> (Toolpath, usize) {
        let Scene { tolerance, machine, .. } = &self.scene;
        let straying =
            Straying { tolerance: tolerance.chord * share, length: cutting_length(&request.tooling) };
        let (merged, left_out) = merge_short_moves(path, machine, &straying);
        let slowed = if machine.slow_corners { slow_corners(&merged, machine) } else { merged };
        (slowed.as_written(), left_out)
    }

    /// The fastest turns of a plan as programs have it, times what is allowed.
    fn turning(
        &self,
        request: &ToolpathRequest,
        axis: &AxisRequest,
        plan: &Plan,
        monitor: &dyn Monitor,
    ) -> Result<f64, PlanError> {
        let (part, cutter) = (&self.part, &request.tooling.cutter);
        let path = self.as_written(request, &plan.path, 1.0).0;
        let share = |found: Option<FastestTurn>, limit: f64| found.map_or(0.0, |turn| turn.rate / limit);
        let along = axis.most_turning.map_or(Ok(0.0), |limit| {
            fastest_turn(part, cutter, &path, monitor).map(|found| share(found, limit))
        })?;
        let across = axis.most_turning_across.map_or(Ok(0.0), |limit| {
            fastest_turn_across(part, cutter, &path, monitor).map(|found| share(found, limit))
        })?;
        Ok(along.max(across))
    }

    fn settings(&self, request: &ToolpathRequest) -> PlanSettings {
        PlanSettings {
            step: self.aimed_at(request),
            chord_tolerance: self.scene.tolerance.chord,
            clearance: self.scene.clearance,
            stock_top: self.top(),
            stock: Some(self.area()),
            may_enter_beside: self.scene.stock_is_stated && self.scene.keep_clear.fixtures.is_empty(),
            feed_rate: request.tooling.cutting.feed_rate,
            plunge_rate: request.tooling.cutting.plunge_rate,
            stepdown: request.stepdown,
            allowance: request.allowance,
            places: Places::default(),
            machine: self.scene.machine,
            joining: request.joining,
            faces: request.faces(),
            is_lowered_later: self.is_lowered_later(request),
            memory: self.budget().left(0) / PLAN_SHARE,
            earlier: None,
        }
    }

    /// The step of a toolpath, by a scallop height that is lower by what joints may lead a leaning tool
    /// astray, or arcs an upright one, and by what meshes are off their files.
    pub(crate) fn aimed_at(&self, request: &ToolpathRequest) -> Step {
        let strays = if request.tilts() {
            may_stray(&self.scene, &Tool::of(&request.tooling))
        } else {
            self.scene.arcs.unwrap_or(0.0)
        };
        match request.step {
            Step::Scallop(height) => Step::Scallop((height - strays - self.moved()).max(LEAST_AIM * height)),
            step => step,
        }
    }

    /// The strategy of a toolpath, with the offset surfaces that it rides on where these come from sections.
    fn strategy(&self, request: &ToolpathRequest) -> Result<Box<dyn Strategy>, JobError> {
        let asked = request.strategy.downcast_ref::<OffsetSurface>();
        let (Some(OffsetSurface { along, drive }), Some(blade)) = (asked, &self.blade) else {
            return Ok(request.strategy.clone());
        };
        let radius = request.tooling.cutter.radius();
        let surfaces = match drive {
            OffsetDrive::InPlane => blade.offset_in_planes(radius),
            OffsetDrive::Published => blade.offset_as_published(radius, self.scene.tolerance.chord),
            OffsetDrive::Exact | OffsetDrive::Given(_) => return Ok(request.strategy.clone()),
        };
        let surfaces = surfaces.map_err(|e| {
            self.refused(
                request,
                PlanError::NotApplicable { strategy: "offset-surface", reason: e.to_string() },
            )
        })?;
        Ok(Box::new(OffsetSurface { along: *along, drive: OffsetDrive::on(surfaces) }))
    }

    /// The header of a toolpath's programs, which begin and end no lower than `rise_to`, mm.
    fn header(&self, request: &ToolpathRequest, rise_to: Option<f64>) -> ProgramHeader {
        ProgramHeader {
            name: format!("{} - {}", self.scene.title, request.name),
            spindle_speed: Some(request.tooling.cutting.spindle_speed),
            rise_to,
        }
    }

    /// Measures the engagement of a pocket's passes and lowers the feed where it is above the strategy's
    /// limit.
    fn limit_feed(
        &self,
        request: &ToolpathRequest,
        path: &mut Toolpath,
        monitor: &dyn Monitor,
    ) -> Result<Option<(Engagement, f64)>, JobError> {
        let (Some(_), Some(strategy)) = (&self.pocket, request.strategy.downcast_ref::<PocketStrategy>())
        else {
            return Ok(None);
        };
        let arcs = self.contact_arcs(request, path, UNCOUNTED_LAYER, monitor)?;
        Ok(Some(limit_feed_by(path, &arcs, strategy, request.step, request.tooling.cutter.radius())))
    }

    /// The engagement of a pocket's passes with all layers counted that may be chips, where one was asked
    /// for.
    fn engaged_thinly(
        &self,
        request: &ToolpathRequest,
        path: &Toolpath,
        monitor: &dyn Monitor,
    ) -> Result<Option<(Engagement, f64)>, JobError> {
        let strategy = request.strategy.downcast_ref::<PocketStrategy>();
        let Some(limit) = strategy.and_then(|strategy| strategy.engagement) else { return Ok(None) };
        let arcs = self.contact_arcs(request, path, THIN_LAYER, monitor)?;
        Ok(Some((engagement(path, &arcs.of_moves, limit), arcs.bound())))
    }

    fn contact_arcs(
        &self,
        request: &ToolpathRequest,
        path: &Toolpath,
        film: f64,
        monitor: &dyn Monitor,
    ) -> Result<ContactArcs, Cancelled> {
        let of_passes = |step: &Move| step.kind == MoveKind::Cut;
        contact_arcs(path, &request.tooling.cutter, &self.stock, film, &of_passes, monitor)
    }
}

/// Times that a toolpath is planned again whose axis turns too fast, and how much slower than it takes. Where
/// it turns by more than so many times what is allowed the tool stays clear only so, and no plan helps.
const TURNING_ROUNDS: usize = 3;
const TURNING_SPARE: f64 = 0.97;
const TURNING_MOST: f64 = 10.0;

/// The plan whose axes turn as slowly as asked. A bull nose end mill in a hollow may touch beside the contact
/// that was planned, so that the finished path has other rates; it is then planned for lower ones.
fn within_turning(
    planned: &dyn Fn(f64) -> Result<Plan, PlanError>,
    turns: &dyn Fn(&Plan) -> Result<f64, PlanError>,
) -> Result<Plan, PlanError> {
    let mut share = TURNING_SHARE;
    let mut best = planned(share)?;
    let mut fastest = turns(&best)?;
    for _ in 0..TURNING_ROUNDS {
        if fastest <= 1.0 || fastest > TURNING_MOST {
            break;
        }
        share *= TURNING_SPARE / fastest;
        let next = planned(share)?;
        let its = turns(&next)?;
        if its < fastest {
            (best, fastest) = (next, its);
        }
    }
    Ok(best)
}

/// Share of the chord tolerance within which short moves are merged where the engagement is bounded: in acute
/// tips some micrometres turn the chip by degrees.
const BOUNDED_STRAYING: f64 = 0.2;

/// A plan of a pocket with the engagement that was measured, and the bound of its greatest angle, rad.
type Engaged = (Plan, Option<(Engagement, f64)>);

/// Times that a pocket is planned again for less where the engagement was exceeded; once more it is for a
/// lower limit everywhere.
const GENTLE_ROUNDS: usize = 5;

/// The share of the limit by which it is lowered at least. Less may change no pass at all.
const LEAST_LOWERING: f64 = 0.01;

/// No limit below this share of the one asked for, in all rounds together, around places or everywhere: the
/// path would grow without end.
const LEAST_SHARE_OF_LIMIT: f64 = 0.25;

/// Beyond a stretch that exceeded the limit, passes are planned for less this far, over the radius: there it
/// is decided how they come to it.
const AROUND_EXCEEDING: f64 = 1.0;

/// Adds lower limits around stretches that exceed the `limit`, rad, `over` by so much, for a cutter of some
/// radius, mm.
fn lower_around(
    gentle: &mut Vec<Gentle>,
    exceeding: &[Exceeding],
    over: impl Fn(&Exceeding) -> f64,
    [limit, radius]: [f64; 2],
) {
    let before = gentle.len();
    for one in exceeding {
        let (at, within) = (one.from.xy(), one.length + AROUND_EXCEEDING * radius);
        // What was lowered around here before counts, too.
        let lowered = gentle[..before].iter().filter(|gentle| (gentle.at - at).norm() < gentle.within);
        let left = (1.0 - LEAST_SHARE_OF_LIMIT) * limit - lowered.map(|gentle| gentle.by).sum::<f64>();
        let by = over(one).max(LEAST_LOWERING * limit).min(left.max(0.0));
        // Every step down exceeds it at the same places.
        let same = |gentle: &&mut Gentle| (gentle.at - at).norm() < 0.5 * radius;
        match gentle[before..].iter_mut().find(same) {
            Some(known) => (known.within, known.by) = (known.within.max(within), known.by.max(by)),
            None => gentle.push(Gentle { at, within, by }),
        }
    }
}

/// The plan, or where its engagement is not proven to keep to the limit of the strategy, one for less around
/// the places where it does not, by as much as it was above there; at last one for a lower limit. It is taken
/// if that helps; in slots without room it does not.
fn within_engagement(
    first: Engaged,
    strategy: &dyn Strategy,
    radius: f64,
    planned: &dyn Fn(&dyn Strategy) -> Result<Engaged, JobError>,
) -> Result<Engaged, JobError> {
    let asked = strategy.downcast_ref::<PocketStrategy>();
    let Some((limit, asked)) = asked.and_then(|asked| Some((asked.engagement?, asked))) else {
        return Ok(first);
    };
    let over =
        |(_, engaged): &Engaged| engaged.as_ref().map_or(0.0, |(found, bound)| found.max + bound - limit);
    let (mut best, mut last) = (first, None);
    let mut gentle: Vec<Gentle> = Vec::new();
    for round in 0..=GENTLE_ROUNDS {
        let by = over(&best);
        if by <= 0.0 || limit - by < LEAST_SHARE_OF_LIMIT * limit {
            break;
        }
        let (_, engaged) = last.as_ref().unwrap_or(&best);
        let before = gentle.len();
        if let Some((found, bound)) = engaged {
            lower_around(&mut gentle, &found.exceeding, |one| one.max + bound - limit, [limit, radius]);
        }
        // Nothing to be mended in places, or that did not help.
        let everywhere = gentle.len() == before || round == GENTLE_ROUNDS;
        // Both at once would make passes ever closer.
        let (target, gentle) = match everywhere {
            true => (limit - by.max(LEAST_LOWERING * limit), Vec::new()),
            false => (limit, gentle.clone()),
        };
        let lowered = PocketStrategy { engagement: Some(target), gentle, ..asked.clone() };
        let next = planned(&lowered)?;
        // Corners are reached by chance at another angle, so that a lower limit may stand higher for once.
        if over(&next) < by {
            (best, last) = (next, None);
        } else {
            last = Some(next);
        }
    }
    Ok(best)
}

/// From the tip to the cutter's upper end, mm.
fn cutting_length(Tooling { cutter, holder, .. }: &Tooling) -> f64 {
    let length = holder.as_ref().map_or(cutter.words().length, |holder| holder.cutting_length());
    length.max(cutter.radius())
}

/// Joints follow a path within this share of the chord tolerance, by which all that is measured may be off.
const FOLLOWED: f64 = 0.1;

/// No plan aims at a lower scallop than this share of what is asked for. Where joints stray by more, no plan
/// is known to hold it.
const LEAST_AIM: f64 = 0.5;

/// How joints follow a path: the whole tool stays near the motion between locations that is measured.
fn following(scene: &Scene, tool: &Tool, five_axis: &FiveAxis) -> Following {
    five_axis.post.following(FOLLOWED * scene.tolerance.chord, tool.reach())
}

/// How far the joints of the scene's five-axis machine may lead any place of a leaning tool astray, mm.
pub(crate) fn may_stray(scene: &Scene, tool: &Tool) -> f64 {
    let of = |five_axis| {
        let tip = following(scene, tool, five_axis).tip;
        FOLLOWED * scene.tolerance.chord + if tip.is_finite() { tip } else { 0.0 }
    };
    scene.five_axis.as_ref().map_or(0.0, of)
}

/// The path in the joints of the scene's five-axis machine, as its programs need it; `None` without one.
fn joints(
    scene: &Scene,
    request: &ToolpathRequest,
    tool: &Tool,
    path: &Toolpath,
) -> Result<Option<JointPath>, JobError> {
    let Some(five_axis) = &scene.five_axis else { return Ok(None) };
    let following = following(scene, tool, five_axis);
    let refused =
        |reason| JobError::Machine { scene: scene.source.name.clone(), name: request.name.clone(), reason };
    let joints = follow(&five_axis.kinematics, path, &following).map_err(|e| refused(e.to_string()))?;
    match joints.report.obstacle() {
        Some(obstacle) => Err(refused(obstacle.to_string())),
        None => Ok(Some(joints)),
    }
}

/// The line of each move in its program. A path that tilts the tool has no program where the scene names no
/// machine.
fn lines(
    scene: &Scene,
    path: (&Toolpath, &Cutter),
    joints: Option<&JointPath>,
    header: &ProgramHeader,
) -> Result<MoveLines, JobError> {
    let written = write_program(&mut std::io::sink(), scene, path, joints, header);
    written.map_err(|error| JobError::Program(error.to_string()))
}

/// Writes a path as G-code; tells the line of each move. A path that tilts the tool has no program, and no
/// lines, where the scene names no machine for it.
pub(crate) fn write_program(
    out: &mut dyn std::io::Write,
    scene: &Scene,
    (path, cutter): (&Toolpath, &Cutter),
    joints: Option<&JointPath>,
    header: &ProgramHeader,
) -> std::io::Result<MoveLines> {
    let Some((five_axis, joints)) = scene.five_axis.as_ref().zip(joints) else {
        return if path.is_upright() {
            let acceleration = scene.machine.acceleration;
            let arcs = scene.arcs.map(|tolerance| ArcRule { tolerance, acceleration });
            gcode::write(out, path, cutter, header, arcs)
        } else {
            Ok(MoveLines::new())
        };
    };
    let post = FiveAxisPost {
        kinematics: &five_axis.kinematics,
        joints,
        style: five_axis.post,
        tcp_words: five_axis.tcp_words.each_ref().map(String::as_str),
        rapid_rate: scene.machine.rapid_rate,
    };
    gcode::write_five_axis(out, path, &post, cutter, header)
}
