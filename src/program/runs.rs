//! From a program to straight moves of tips and axes, one run for each stretch of one tool.
//!
//! Enters: a [`Program`] in machine coordinates. Leaves: paths in the coordinates of the part, whose zero is
//! the program's. Arcs become chords, far nearer than the chord tolerance, and [`motion::Origin::strays`] has
//! how far they are off. Where rotary axes turn, the way of the tip that follows from the machine is divided
//! so that straight pieces keep the same tolerance.

use geometry::{Point3, Vector3};
use machine::kinematics::{Joints, Kinematics, Pace, Side, Way, Waypoint};
use motion::{ClPoint, Move, MoveKind, Origin, Toolpath};

use crate::corners::Corners;
use crate::error::{Fault, ProgramError};
use crate::frame::{Place, fed_length};
use crate::program::{Arc, Program, Setting, Spindle, Step, StepKind};

/// Feed of moves for which the program gives none, mm/min. They are violations; the time needs a number.
pub const FEED_WHERE_NONE: f64 = 100.0;

/// Moves stray from arcs and turns by no more than this share of the chord tolerance: what is measured has to
/// be known so much better.
const STRAY_SHARE: f64 = 0.1;

/// Length of a tool over which what its axis strays counts as what the tip does, mm.
const WEIGHED_OVER: f64 = 100.0;

/// A piece of a turning move is halved so many times at most: a thousandth of any turn.
const MOST_HALVINGS: u32 = 12;

/// No piece turns the tool by more than this, rad.
const MOST_TURN: f64 = 0.5;

/// Tips that are nearer to each other, mm, are one place.
const NO_WAY: f64 = 1e-9;

/// A feed that leans less than this share from the tool axis goes straight down or up.
const STRAIGHT: f64 = 1e-6;

/// How a program is laid to the part.
pub struct Placing<'a> {
    /// The chord tolerance, mm: pieces of turning moves may be as far off, chords of arcs a tenth as far.
    pub chord: f64,
    /// The machine, where it has rotary axes. Its gauge length is that of tools whose length is not known.
    pub kinematics: Option<&'a Kinematics>,
    /// The true length of a tool, mm, where it is known. Else a tool is taken to be as long as the control
    /// takes it to be where it first feeds after its change: its one length under all that it does.
    pub lengths: &'a dyn Fn(u32) -> Option<f64>,
}

/// A stretch of a program with one tool.
#[derive(Debug, Clone, PartialEq)]
pub struct ToolRun {
    /// Number of the tool; 0 before the first change.
    pub tool: u32,
    /// Its moves; each knows its line.
    pub path: Toolpath,
    /// The joints that it goes through on a machine with rotary axes; none of cutter locations, and on other
    /// machines.
    pub joints: Vec<Waypoint>,
    /// How far the control may round corners, mm, which [`motion::Origin::strays`] has as well.
    pub rounded: f64,
    /// The line behind the first corner that the control rounds without a bound.
    pub rounded_freely: Option<u32>,
}

impl Program {
    /// The runs of all tools, in order. A tool that comes again has another run.
    ///
    /// # Errors
    /// [`ProgramError`] where a rotary axis turns that the machine does not have, and for a chord tolerance that is
    /// not above 0.
    ///
    /// # Tolerance
    /// The motion is off the moves by no more than [`motion::Origin::strays`], mm.
    pub fn runs(&self, placing: &Placing<'_>) -> Result<Vec<ToolRun>, ProgramError> {
        if !(placing.chord > 0.0 && placing.chord.is_finite()) {
            let fault = Fault::Chord(placing.chord);
            return Err(ProgramError { name: self.name.clone(), line: 0, column: 0, fault });
        }
        let mut runs: Vec<Run> = Vec::new();
        let mut own = None;
        let mut dwells = self.dwells.iter().peekable();
        for (k, step) in self.steps.iter().enumerate() {
            if step.kind == StepKind::Set {
                continue;
            }
            let setting = self.setting(step);
            let same = runs.last().is_some_and(|run| run.tool == setting.tool);
            if !same {
                own = self.length_of_stretch(k, placing);
            }
            let layer = Layer { program: self, placing, setting, own };
            let fault = |fault| ProgramError { name: self.name.clone(), line: step.line, column: 1, fault };
            if !same {
                let start = layer.location(self.start_of(k), self.axes.get(k)).map_err(fault)?;
                let joints = layer.joints(self.start_of(k)).ok().filter(|_| self.axes.is_empty());
                runs.push(Run::new(setting.tool, start, joints));
            }
            let Some(run) = runs.last_mut() else { continue };
            let mut rests = false;
            while let Some((_, seconds)) = dwells.next_if(|(step, _)| *step <= k) {
                run.standing_s += seconds;
                rests = true;
            }
            run.pace = Pace { rests: run.pace.rests || rests, goes_on: false, ..Pace::default() };
            run.pace.from_unknown = k < self.approach;
            match run.last.replace(k).filter(|_| !rests).map(|last| self.corner(last, k)) {
                Some(Corners::Within(by)) => run.rounded = run.rounded.max(by),
                Some(Corners::Free) => run.rounded_freely = run.rounded_freely.or(Some(step.line)),
                _ => {}
            }
            let first = run.path.len() as u32;
            run.spins(first, setting);
            layer.follow(k, step, run).map_err(fault)?;
            run.line(first, rests);
        }
        if let Some(run) = runs.last_mut() {
            run.standing_s += dwells.map(|(_, seconds)| seconds).sum::<f64>();
        }
        Ok(runs.into_iter().map(|run| run.finished(&self.name)).collect())
    }

    /// The length of the tool that step `k` moves, mm; `None` where it never feeds before the next change and
    /// no table knows it.
    fn length_of_stretch(&self, k: usize, placing: &Placing<'_>) -> Option<f64> {
        let tool = self.setting(&self.steps[k]).tool;
        let moves = self.steps[k..].iter().filter(|step| step.kind != StepKind::Set);
        let fed = || moves.take_while(|step| self.setting(step).tool == tool).find(|step| step.feeds());
        (placing.lengths)(tool).or_else(|| fed().map(|step| self.setting(step).length[2]))
    }
}

/// A run in the making.
struct Run {
    tool: u32,
    at: ClPoint,
    path: Toolpath,
    joints: Vec<Waypoint>,
    pass: u32,
    cutting: bool,
    /// How far arcs are off their chords, and turning moves off their pieces, mm.
    chords_stray: f64,
    turns_stray: f64,
    /// How far corners are rounded, mm, and the line behind the first one for which no bound is known.
    rounded: f64,
    rounded_freely: Option<u32>,
    /// The last step.
    last: Option<usize>,
    /// Time for which the machine dwells, s.
    standing_s: f64,
    /// Of the next place.
    pace: Pace,
}

impl Run {
    fn new(tool: u32, start: ClPoint, joints: Option<Joints>) -> Self {
        let begin =
            joints.map(|joints| Waypoint { joints, step: 0, way: Way::Approach, pace: Pace::default() });
        let joints = begin.into_iter().collect();
        let path = Toolpath::new(start, Vec::new());
        Self {
            tool,
            at: start,
            path,
            joints,
            pass: 0,
            cutting: false,
            chords_stray: 0.0,
            turns_stray: 0.0,
            rounded: 0.0,
            rounded_freely: None,
            last: None,
            standing_s: 0.0,
            pace: Pace::default(),
        }
    }

    /// What the spindle does from move `first` on.
    fn spins(&mut self, first: u32, setting: &Setting) {
        let speed = match setting.spindle {
            Spindle::Off => 0.0,
            Spindle::Clockwise => setting.speed,
            Spindle::Anticlockwise => -setting.speed,
        };
        let spindle = &mut self.path.origin.spindle;
        if spindle.last().is_none_or(|(_, before)| *before != speed) {
            spindle.retain(|(from, _)| *from < first);
            spindle.push((first, speed));
        }
    }

    /// The moves from `first` on are one line of the program, before which the machine may rest.
    fn line(&mut self, first: u32, rests: bool) {
        let (moves, origin) = (first..self.path.len() as u32, &mut self.path.origin);
        if rests {
            origin.stops.push(first);
        }
        if moves.len() > 1 {
            origin.pieces.push(moves.clone());
        }
        if self.pace.from_unknown && !moves.is_empty() {
            origin.approaches.push(moves);
        }
    }

    /// The joints at the end of a line or of a piece of one.
    fn push_joints(&mut self, joints: Joints, way: Way, asked_s: f64) {
        let step = self.path.len().saturating_sub(1);
        self.joints.push(Waypoint { joints, step, way, pace: Pace { asked_s, ..self.pace } });
        self.pace = Pace { goes_on: true, rests: false, ..self.pace };
    }

    fn finished(self, program: &str) -> ToolRun {
        let strays = self.chords_stray + self.turns_stray + self.rounded;
        let leans = self.turns_stray / WEIGHED_OVER;
        let (tools, program) = (vec![(0, self.tool)], program.to_owned());
        let origin =
            Origin { tools, program, strays, leans, standing_s: self.standing_s, ..self.path.origin };
        let Self { tool, joints, rounded, rounded_freely, .. } = self;
        ToolRun { tool, path: Toolpath { origin, ..self.path }, joints, rounded, rounded_freely }
    }

    /// A piece of a step in which axes turn; it takes so many minutes, where that is known.
    fn push_turning(&mut self, to: ClPoint, step: &Step, minutes: Option<f64>) {
        let length = (to.tip - self.at.tip).norm();
        let feed = match minutes {
            Some(minutes) if length > NO_WAY => length / minutes,
            _ => step.feed,
        };
        if to != self.at {
            self.push(to, step.kind == StepKind::Rapid, feed, step.line);
        }
    }

    /// A straight move to a location. Passes are what lies between rapids.
    fn push(&mut self, to: ClPoint, rapid: bool, feed: f64, line: u32) {
        if rapid && self.cutting {
            self.pass += 1;
        }
        self.cutting = !rapid;
        let kind = if rapid { MoveKind::Rapid } else { kind(&self.at, &to) };
        let feed_rate = if feed > 0.0 { feed } else { FEED_WHERE_NONE };
        self.path.moves.push(Move { to, kind, feed_rate, pass: self.pass });
        self.path.origin.lines.push(line);
        self.at = to;
    }
}

/// What a feed is for, from its direction.
fn kind(from: &ClPoint, to: &ClPoint) -> MoveKind {
    let by = to.tip - from.tip;
    let along = by.dot(&to.axis);
    let across = (by - to.axis * along).norm();
    if across > STRAIGHT * along.abs() || from.axis != to.axis {
        MoveKind::Cut
    } else if along < 0.0 {
        MoveKind::Plunge
    } else {
        MoveKind::Retract
    }
}

fn tip(place: &Place) -> [f64; 3] {
    [place[0], place[1], place[2]]
}

/// A straight way of all axes, some of which turn.
struct Turn<'a> {
    from: &'a Place,
    to: &'a Place,
    step: &'a Step,
    /// How long it takes, where that is known: all axes move evenly.
    minutes: Option<f64>,
}

/// One setting of a program, laid to the part.
struct Layer<'a> {
    program: &'a Program,
    placing: &'a Placing<'a>,
    setting: &'a Setting,
    /// The tool's own length, mm, as far as it is known.
    own: Option<f64>,
}

impl Layer<'_> {
    /// How far the true tip is from where the control takes it to be, along the tool.
    fn error_of_length(&self) -> f64 {
        self.own.map_or(0.0, |length| self.setting.length[2] - length)
    }

    /// From the spindle nose to the tip, mm: as the control takes it, and in truth. Where no table knows the
    /// tool's, it is the machine's.
    fn lengths(&self, kinematics: &Kinematics) -> [f64; 2] {
        match (self.placing.lengths)(self.setting.tool) {
            Some(own) => [self.setting.length[2], own],
            None => [kinematics.gauge_length() + self.error_of_length(), kinematics.gauge_length()],
        }
    }

    /// Tip and axis in the part, of a place in machine coordinates.
    fn location(&self, at: &Place, axis: Option<&[f64; 3]>) -> Result<ClPoint, Fault> {
        let zero = &self.program.zero;
        let tip = Point3::new(at[0] - zero[0], at[1] - zero[1], at[2] - zero[2]);
        let off = self.error_of_length();
        let shifted = |tip: Point3, axis: Vector3| ClPoint { tip: tip + axis * off, axis };
        if let Some(axis) = axis {
            return Ok(shifted(tip, Vector3::from(*axis)));
        }
        let turned = self.turned(at);
        let Some(kinematics) = self.placing.kinematics else {
            return match turned.iter().position(|angle| *angle != 0.0) {
                Some(k) => Err(Fault::Rotary(['A', 'B', 'C'][k])),
                None => Ok(shifted(tip, Vector3::z())),
            };
        };
        let joints = self.joints_of(kinematics, tip, turned)?;
        // A control that keeps the tip says where it is.
        if self.setting.tip_kept {
            return Ok(shifted(tip, kinematics.tool_axis(joints.rotary)));
        }
        let [_, own] = self.lengths(kinematics);
        Ok(kinematics.with_gauge_length(own).forward(&joints))
    }

    /// The joints at a place in machine coordinates, of a machine with rotary axes.
    fn joints(&self, at: &Place) -> Result<Joints, Fault> {
        let zero = &self.program.zero;
        let kinematics = self.placing.kinematics.ok_or(Fault::Rotary('A'))?;
        let tip = Point3::new(at[0] - zero[0], at[1] - zero[1], at[2] - zero[2]);
        self.joints_of(kinematics, tip, self.turned(at))
    }

    /// A B C at a place in machine coordinates, degrees: of a table from the part's zero, of a head from the
    /// machine's.
    fn turned(&self, at: &Place) -> [f64; 3] {
        let in_head = |letter: char| {
            let axes = self.placing.kinematics.map_or(&[][..], |kinematics| kinematics.axes());
            axes.iter().any(|axis| axis.letter == letter && axis.side == Side::Head)
        };
        let zero = |k: usize| if in_head(['A', 'B', 'C'][k]) { 0.0 } else { self.program.zero[k + 3] };
        [0, 1, 2].map(|k| at[k + 3] - zero(k))
    }

    fn joints_of(&self, kinematics: &Kinematics, tip: Point3, turned: [f64; 3]) -> Result<Joints, Fault> {
        let letters = kinematics.axes().map(|axis| axis.letter);
        if let Some(k) = (0..3).find(|k| turned[*k] != 0.0 && !letters.contains(&['A', 'B', 'C'][*k])) {
            return Err(Fault::Rotary(['A', 'B', 'C'][k]));
        }
        let rotary = letters.map(|letter| turned[usize::from(letter as u8 - b'A').min(2)].to_radians());
        let [taken, _] = self.lengths(kinematics);
        if self.setting.tip_kept {
            return Ok(kinematics.with_gauge_length(taken).place(tip, rotary));
        }
        let nose = Vector3::new(0.0, 0.0, taken);
        Ok(Joints { linear: tip.coords + kinematics.workpiece_zero().coords + nose, rotary })
    }

    fn follow(&self, k: usize, step: &Step, run: &mut Run) -> Result<(), Fault> {
        let from = self.program.start_of(k);
        let to = &step.to;
        if let Some(axis) = self.program.axes.get(k + 1) {
            return self.follow_axis(k, step, axis, run);
        }
        let turns = from[3..] != to[3..];
        if let StepKind::Arc(index) = step.kind {
            let arc = &self.program.arcs[index as usize];
            let (start, end) = (tip(from), tip(to));
            let chords = self.chords(arc, &start, &end, run);
            let mut last = *from;
            for n in 1..=chords {
                let t = n as f64 / chords as f64;
                let [x, y, z] = arc.at(&start, &end, t);
                let [a, b, c] = [3, 4, 5].map(|k| from[k] + (to[k] - from[k]) * t);
                let next = if n == chords { *to } else { [x, y, z, a, b, c] };
                self.straight(&last, &next, step, turns, run)?;
                last = next;
            }
            return Ok(());
        }
        self.straight(from, to, step, turns, run)
    }

    /// Chords of an arc; the run knows how far they are off.
    fn chords(&self, arc: &Arc, start: &[f64; 3], end: &[f64; 3], run: &mut Run) -> usize {
        let chords = arc.chords(start, STRAY_SHARE * self.placing.chord);
        run.chords_stray = run.chords_stray.max(arc.strays(start, end, chords));
        chords
    }

    /// A step whose tool axis the program gives. Places between are not known: the axis turns evenly on the
    /// way of the tip.
    fn follow_axis(&self, k: usize, step: &Step, axis: &[f64; 3], run: &mut Run) -> Result<(), Fault> {
        let (from, to) = (self.program.start_of(k), &step.to);
        if let StepKind::Arc(index) = step.kind {
            let arc = &self.program.arcs[index as usize];
            let (start, end) = (tip(from), tip(to));
            let (before, after) = (Vector3::from(self.program.axes[k]), Vector3::from(*axis));
            let chords = self.chords(arc, &start, &end, run);
            for n in 1..chords {
                let t = n as f64 / chords as f64;
                let [x, y, z] = arc.at(&start, &end, t);
                let turned = if before == after { after } else { before.lerp(&after, t).normalize() };
                let at = self.location(&[x, y, z, 0.0, 0.0, 0.0], Some(&turned.into()))?;
                run.push(at, false, step.feed, step.line);
            }
        }
        let at = self.location(to, Some(axis))?;
        run.push(at, step.kind == StepKind::Rapid, step.feed, step.line);
        Ok(())
    }

    fn straight(
        &self,
        from: &Place,
        to: &Place,
        step: &Step,
        turns: bool,
        run: &mut Run,
    ) -> Result<(), Fault> {
        if turns {
            let minutes = self.minutes(from, to, step)?;
            self.halve(&Turn { from, to, step, minutes }, [0.0, 1.0], run, 0)?;
        } else {
            run.push(self.location(to, None)?, step.kind == StepKind::Rapid, step.feed, step.line);
        }
        if !run.joints.is_empty() {
            let way = if self.setting.tip_kept { Way::Tip } else { Way::Axes };
            let feed = if step.feed > 0.0 { step.feed } else { FEED_WHERE_NONE };
            let asked_s = if step.kind == StepKind::Rapid { 0.0 } else { 60.0 * fed_length(from, to) / feed };
            run.push_joints(self.joints(to)?, way, asked_s);
        }
        Ok(())
    }

    /// How long a feed takes in which axes turn: by its feed, or longer where an axis cannot go so fast.
    /// `None` without a feed.
    fn minutes(&self, from: &Place, to: &Place, step: &Step) -> Result<Option<f64>, Fault> {
        if step.kind == StepKind::Rapid || step.feed <= 0.0 {
            return Ok(None);
        }
        let minutes = fed_length(from, to) / step.feed;
        let Some(kinematics) = self.placing.kinematics else { return Ok(Some(minutes)) };
        let [before, after] = [self.joints(from)?, self.joints(to)?];
        let moved = (after.linear - before.linear).iter().copied().collect::<Vec<f64>>();
        let turned = [0, 1].map(|k| after.rotary[k] - before.rotary[k]);
        let of_axes = moved.iter().chain(&turned).zip(kinematics.rates());
        let seconds = of_axes.map(|(by, rate)| by.abs() / rate).fold(0.0, f64::max);
        Ok(Some(minutes.max(seconds / 60.0)))
    }

    /// Divides a move in which the tool turns until its pieces are straight within the tolerance.
    fn halve(&self, turn: &Turn<'_>, [a, b]: [f64; 2], run: &mut Run, depth: u32) -> Result<(), Fault> {
        let Turn { from, to, step, minutes } = *turn;
        let between = |t: f64| -> Place { std::array::from_fn(|k| from[k] + (to[k] - from[k]) * t) };
        let [start, end] = [self.location(&between(a), None)?, self.location(&between(b), None)?];
        let off = |t: f64| {
            let truly = self.location(&between(a + (b - a) * t), None)?;
            let straight = start.towards(&end, t);
            Ok::<f64, Fault>(
                (truly.tip - straight.tip).norm() + WEIGHED_OVER * (truly.axis - straight.axis).norm(),
            )
        };
        // Between these places it is off by no more than twice as far.
        let strays = 2.0 * off(0.25)?.max(off(0.5)?).max(off(0.75)?);
        let small = start.axis.dot(&end.axis) > MOST_TURN.cos();
        if depth >= MOST_HALVINGS || small && strays <= STRAY_SHARE * self.placing.chord {
            if start.axis.dot(&end.axis) < -1.0 + 1e-9 {
                return Err(Fault::HalfTurn);
            }
            if step.kind != StepKind::Rapid {
                run.turns_stray = run.turns_stray.max(strays);
            }
            // What comes last ends exactly where the step does.
            let end = if b < 1.0 { end } else { self.location(to, None)? };
            run.push_turning(end, step, minutes.map(|minutes| (b - a) * minutes));
            return Ok(());
        }
        let middle = 0.5 * (a + b);
        self.halve(turn, [a, middle], run, depth + 1)?;
        self.halve(turn, [middle, b], run, depth + 1)
    }
}
