//! A program as motion: what a control makes of the text.

use crate::control::Plane;
use crate::corners::Corners;
use crate::frame::Place;

/// How a step moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum StepKind {
    /// Nothing moves: the control takes another tool length, so that the tip counts as elsewhere.
    Set,
    /// At rapid speed.
    Rapid,
    /// Straight, at feed.
    Feed,
    /// Along an arc or helix, at feed: an index into [`Program::arcs`].
    Arc(u32),
}

/// One motion of a program.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// How it moves.
    pub kind: StepKind,
    /// Where it ends: X Y Z of the tip and A B C, machine coordinates less the tool's length, mm and degrees.
    pub to: Place,
    /// Feed along X Y Z, mm/min (degrees/min where only rotary axes move); 0 where the program gives none.
    pub feed: f64,
    /// Line, from 1.
    pub line: u32,
    /// What holds meanwhile: an index into [`Program::settings`].
    pub setting: u32,
}

impl Step {
    /// Whether the tool moves at feed.
    pub fn feeds(&self) -> bool {
        matches!(self.kind, StepKind::Feed | StepKind::Arc(_))
    }
}

/// An exact arc, in machine coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arc {
    /// Centre, level with the start along the normal, mm.
    pub centre: [f64; 3],
    /// Unit vector about which the arc runs anticlockwise.
    pub normal: [f64; 3],
    /// Angle that it runs through, rad; whole turns included.
    pub sweep: f64,
    /// The plane that was in force.
    pub plane: Plane,
}

/// What the spindle does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Spindle {
    /// M5.
    #[default]
    Off,
    /// M3.
    Clockwise,
    /// M4.
    Anticlockwise,
}

/// What of a tool's length nobody knows: it is in a register that neither the program nor a table sets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Unset {
    /// All of it is known.
    #[default]
    Nothing,
    /// The register's value.
    Plus(u32),
    /// The same, the other way (G44).
    Minus(u32),
    /// A sum of registers, taken in this line (G43.2).
    Sum(u32),
}

/// What holds during some steps.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Setting {
    /// Number of the tool; 0 before the first change.
    pub tool: u32,
    /// The spindle.
    pub spindle: Spindle,
    /// Its speed, rev/min.
    pub speed: f64,
    /// The register of the tool's length; 0 without one.
    pub register: u32,
    /// What the control takes the length for, mm, less what is `unset`.
    pub length: [f64; 3],
    /// What comes to that from a register whose value is not known.
    pub unset: Unset,
    /// Whether the control keeps the tip on its way while rotary axes turn.
    pub tip_kept: bool,
    /// Work offset, from 1 for G54.
    pub work: u32,
    /// What it does at corners.
    pub corners: Corners,
}

/// A remark of the reader on a line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Note {
    /// Line, from 1.
    pub line: u32,
    /// In a sentence.
    pub text: String,
}

/// A cutter that the program itself describes.
#[derive(Debug, Clone, PartialEq)]
pub struct ToolRemark {
    /// Number of the tool; 0 where none is named.
    pub tool: u32,
    /// Line, from 1.
    pub line: u32,
    /// The remark.
    pub text: String,
}

/// A program as motion.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Program {
    /// What messages call it.
    pub name: String,
    /// Where the tip is before the first step, machine coordinates.
    pub start: Place,
    /// The motions, in the order in which they run.
    pub steps: Vec<Step>,
    /// How long the machine dwells, s, each before the step of an index; 0 where it only comes to rest.
    pub dwells: Vec<(usize, f64)>,
    /// So many steps come from where nobody knows: the first rapids, up to the last one that leads an axis to
    /// its first place, which may be a straight feed.
    pub approach: usize,
    /// The steps that lead X, Y and Z to their first places.
    pub first: [Option<usize>; 3],
    /// The arcs among them.
    pub arcs: Vec<Arc>,
    /// What holds meanwhile.
    pub settings: Vec<Setting>,
    /// The part's zero in machine coordinates: the origin of the program where it first moves. Rotary axes of
    /// a head do not count from it.
    pub zero: Place,
    /// What was read and moves nothing, and what is doubtful.
    pub notes: Vec<Note>,
    /// Comments that describe tools.
    pub tools: Vec<ToolRemark>,
    /// Millimetres of its unit of length, where it ends.
    pub unit: f64,
    /// Whether it counts in mm and in inches.
    pub both_units: bool,
    /// Lines of the text.
    pub lines: usize,
    /// Whether it says where it ends.
    pub ended: bool,
    /// Tool axes of the steps, and of the start before them, where the program gives them itself (APT); empty
    /// else.
    pub axes: Vec<[f64; 3]>,
}

impl Program {
    /// Where step `k` begins.
    pub fn start_of(&self, k: usize) -> &Place {
        k.checked_sub(1).map_or(&self.start, |before| &self.steps[before].to)
    }

    /// Nobody knows where the tool stands before X, Y and Z are led to their first places: until then it is
    /// as high as the program ever feeds, and where Z is led first, it comes down at the first place of X and
    /// Y. So no way from an assumed place cuts anything.
    #[must_use]
    pub fn from_above(mut self) -> Self {
        let Self { start, steps, approach, first, .. } = &mut self;
        let [Some(x), Some(y), Some(z)] = *first else { return self };
        let last = x.max(y).max(z);
        if last >= *approach {
            return self;
        }
        let (led, behind) = steps.split_at(last + 1);
        let seen = led.iter().chain(behind.iter().filter(|step| step.feeds()));
        let height = seen.map(|step| step.to[2]).fold(start[2], f64::max);
        let over = [steps[x].to[0], steps[y].to[1], height];
        start[2] = height;
        steps[..last].iter_mut().for_each(|step| step.to[2] = height);
        if z >= x.max(y) {
            // X and Y are led above everything, or with Z.
            if z == x.max(y) {
                start[..2].copy_from_slice(&over[..2]);
            }
            return self;
        }
        steps[z..last].iter_mut().for_each(|step| step.to[..3].copy_from_slice(&over));
        self
    }

    /// The highest place of the tip over the part's zero, mm.
    pub fn highest(&self) -> f64 {
        self.steps.iter().map(|step| step.to[2] - self.zero[2]).fold(0.0, f64::max)
    }

    /// What holds during a step.
    pub fn setting(&self, step: &Step) -> &Setting {
        &self.settings[step.setting as usize]
    }

    /// The tools in the order of their first motion.
    pub fn tools_in_use(&self) -> Vec<u32> {
        self.tools_of(|kind| kind != StepKind::Set)
    }

    /// The tools in the order of their first feed.
    pub fn tools_that_feed(&self) -> Vec<u32> {
        self.tools_of(|kind| matches!(kind, StepKind::Feed | StepKind::Arc(_)))
    }

    /// The highest feed of some tools on ways in which no rotary axis turns, mm/min, and its line. Where one
    /// turns, the feed is that of no single axis.
    pub fn highest_feed(&self, of_tool: impl Fn(u32) -> bool) -> Option<(f64, u32)> {
        let fed = |(k, step): (usize, &Step)| {
            let turns = self.start_of(k)[3..] != step.to[3..];
            (step.feeds() && !turns && of_tool(self.setting(step).tool)).then_some((step.feed, step.line))
        };
        self.steps.iter().enumerate().filter_map(fed).max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)))
    }

    fn tools_of(&self, counts: impl Fn(StepKind) -> bool) -> Vec<u32> {
        let mut tools = Vec::new();
        for step in self.steps.iter().filter(|step| counts(step.kind)) {
            let tool = self.setting(step).tool;
            if tools.last() != Some(&tool) && !tools.contains(&tool) {
                tools.push(tool);
            }
        }
        tools
    }
}
