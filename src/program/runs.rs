//! From a program to straight moves of tips and axes, one run for each stretch of one tool.
//!
//! Enters: a [`Program`] in machine coordinates. Leaves: paths in the coordinates of the part, whose zero is the program's.
//! Arcs become chords within the chord tolerance. Where rotary axes turn, the way of the tip that follows from the machine is
//! divided so that straight pieces keep the same tolerance.

use geometry::{Point3, Vector3};
use machine::kinematics::{Joints, Kinematics, Side, Way, Waypoint};
use motion::{ClPoint, Move, MoveKind, Origin, Toolpath};

use crate::error::{Fault, ProgramError};
use crate::frame::Place;
use crate::program::{Program, Setting, Step, StepKind};

/// Feed of moves for which the program gives none, mm/min. They are violations; the time needs a number.
pub const FEED_WHERE_NONE: f64 = 100.0;

/// A piece of a turning move is halved so many times at most: a thousandth of any turn.
const MOST_HALVINGS: u32 = 12;

/// No piece turns the tool by more than this, rad.
const MOST_TURN: f64 = 0.5;

/// A feed that leans less than this share from the tool axis goes straight down or up.
const STRAIGHT: f64 = 1e-6;

/// How a program is laid to the part.
pub struct Placing<'a> {
    /// How far chords may stray, mm.
    pub chord: f64,
    /// The machine, where it has rotary axes. Its gauge length is that of tools whose length is not known.
    pub kinematics: Option<&'a Kinematics>,
    /// The true length of a tool, mm, where it is known.
    pub lengths: &'a dyn Fn(u32) -> Option<f64>,
}

/// A stretch of a program with one tool.
#[derive(Debug, Clone, PartialEq)]
pub struct ToolRun {
    /// Number of the tool; 0 before the first change.
    pub tool: u32,
    /// Its moves; each knows its line.
    pub path: Toolpath,
    /// The joints that it goes through on a machine with rotary axes; none of cutter locations, and on other machines.
    pub joints: Vec<Waypoint>,
}

impl Program {
    /// The runs of all tools, in order. A tool that comes again has another run.
    ///
    /// # Errors
    /// [`ProgramError`] where a rotary axis turns that the machine does not have.
    ///
    /// # Tolerance
    /// Chords of arcs stray by no more than [`Placing::chord`] (those of a helix, of its circle).
    pub fn runs(&self, placing: &Placing<'_>) -> Result<Vec<ToolRun>, ProgramError> {
        let mut runs: Vec<Run> = Vec::new();
        for (k, step) in self.steps.iter().enumerate() {
            if step.kind == StepKind::Set {
                continue;
            }
            let setting = self.setting(step);
            let layer = Layer { program: self, placing, setting };
            let fault = |fault| ProgramError { name: self.name.clone(), line: step.line, column: 1, fault };
            let same = runs.last().is_some_and(|run| run.tool == setting.tool);
            if !same {
                let start = layer.location(self.start_of(k), self.axes.get(k)).map_err(fault)?;
                let joints = layer.joints(self.start_of(k)).ok().filter(|_| self.axes.is_empty());
                runs.push(Run::new(setting.tool, start, joints));
            }
            let Some(run) = runs.last_mut() else { continue };
            layer.follow(k, step, run).map_err(fault)?;
        }
        Ok(runs.into_iter().map(|run| run.finished(&self.name)).collect())
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
}

impl Run {
    fn new(tool: u32, start: ClPoint, joints: Option<Joints>) -> Self {
        let begin = joints.map(|joints| Waypoint { joints, step: 0, way: Way::Approach });
        let joints = begin.into_iter().collect();
        Self { tool, at: start, path: Toolpath::new(start, Vec::new()), joints, pass: 0, cutting: false }
    }

    fn finished(self, program: &str) -> ToolRun {
        let origin = Origin { tools: vec![(0, self.tool)], program: program.to_owned(), ..self.path.origin };
        ToolRun { tool: self.tool, path: Toolpath { origin, ..self.path }, joints: self.joints }
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

/// One setting of a program, laid to the part.
struct Layer<'a> {
    program: &'a Program,
    placing: &'a Placing<'a>,
    setting: &'a Setting,
}

impl Layer<'_> {
    /// How far the true tip is from where the control takes it to be, along the tool.
    fn error_of_length(&self) -> f64 {
        (self.placing.lengths)(self.setting.tool).map_or(0.0, |length| self.setting.length[2] - length)
    }

    /// From the spindle nose to the tip, mm: as the control takes it, and in truth. Where the tool's is not known, both are the machine's.
    fn lengths(&self, kinematics: &Kinematics) -> [f64; 2] {
        match (self.placing.lengths)(self.setting.tool) {
            Some(own) => [self.setting.length[2], own],
            None => [kinematics.gauge_length(); 2],
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

    /// A B C at a place in machine coordinates, degrees: of a table from the part's zero, of a head from the machine's.
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
        let rapid = step.kind == StepKind::Rapid;
        if let Some(axis) = self.program.axes.get(k + 1) {
            // Places between are not known; the tip runs straight while the axis turns evenly.
            let at = self.location(to, Some(axis))?;
            run.push(at, rapid, step.feed, step.line);
            return Ok(());
        }
        let turns = from[3..] != to[3..];
        if let StepKind::Arc(index) = step.kind {
            let arc = &self.program.arcs[index as usize];
            let start = [from[0], from[1], from[2]];
            let end = [to[0], to[1], to[2]];
            let radius = (0..3).map(|k| (start[k] - arc.centre[k]).powi(2)).sum::<f64>().sqrt();
            let chords = arc.chords(radius, self.placing.chord);
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

    fn straight(
        &self,
        from: &Place,
        to: &Place,
        step: &Step,
        turns: bool,
        run: &mut Run,
    ) -> Result<(), Fault> {
        if turns {
            self.halve(from, to, [0.0, 1.0], step, run, 0)?;
        }
        let at = self.location(to, None)?;
        // Where nothing is left to do after a turn, no move is left.
        if at != run.at || !turns {
            run.push(at, step.kind == StepKind::Rapid, step.feed, step.line);
        }
        if !run.joints.is_empty() {
            let way = if self.setting.tip_kept { Way::Tip } else { Way::Axes };
            let (joints, step) = (self.joints(to)?, run.path.len().saturating_sub(1));
            run.joints.push(Waypoint { joints, step, way });
        }
        Ok(())
    }

    /// Divides a move in which the tool turns until its pieces are straight within the tolerance.
    fn halve(
        &self,
        from: &Place,
        to: &Place,
        [a, b]: [f64; 2],
        step: &Step,
        run: &mut Run,
        depth: u32,
    ) -> Result<(), Fault> {
        let between = |t: f64| -> Place { std::array::from_fn(|k| from[k] + (to[k] - from[k]) * t) };
        let [start, end] = [self.location(&between(a), None)?, self.location(&between(b), None)?];
        let near = |t: f64| {
            let truly = self.location(&between(a + (b - a) * t), None)?;
            let straight = start.towards(&end, t);
            // The axis is weighed over a cutting length of a hundred mm.
            let off = (truly.tip - straight.tip).norm() + 100.0 * (truly.axis - straight.axis).norm();
            Ok::<bool, Fault>(off <= 0.5 * self.placing.chord)
        };
        let small = start.axis.dot(&end.axis) > MOST_TURN.cos();
        if depth >= MOST_HALVINGS || small && near(0.25)? && near(0.5)? && near(0.75)? {
            if start.axis.dot(&end.axis) < -1.0 + 1e-9 {
                return Err(Fault::HalfTurn);
            }
            if b < 1.0 {
                run.push(end, step.kind == StepKind::Rapid, step.feed, step.line);
            }
            return Ok(());
        }
        let middle = 0.5 * (a + b);
        self.halve(from, to, [a, middle], step, run, depth + 1)?;
        self.halve(from, to, [middle, b], step, run, depth + 1)
    }
}
