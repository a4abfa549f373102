//! A control at work: block after block, what each makes of the state, and the motions that leave.
//!
//! The order within a block is that of LinuxCNC and ISO 6983: feed mode, F, S, T, M6, spindle, then the codes that set
//! something, then the motion, then stops.

use crate::block::{self, Block, CodeWord};
use crate::compensation::{Compensation, Way};
use crate::control::{Code, Codes, Control, FeedMode, Length, Motion, Plane, RadiusSide, spelled};
use crate::error::{Fault, ProgramError, Stop};
use crate::expression::{Scope, Value};
use crate::flow::{Flow, Next};
use crate::frame::{Place, Rotation, fed_length};
use crate::lines::Lines;
use crate::parameters::{Parameters, Target};
use crate::program::{Arc, Note, Program, Setting, Spindle, Step, StepKind, ToolRemark};
use crate::state::{MORE_OFFSETS, Setup, State, Sticky};

/// Letters of the axes.
pub(crate) const AXES: [u8; 6] = *b"XYZABC";

/// The same as bits of a block's letters.
const AXIS_BITS: u32 = 1 << (b'X' - b'A') | 1 << (b'Y' - b'A') | 1 << (b'Z' - b'A') | 0b111;

/// Notes that a report lists; more tell nothing new.
const MOST_NOTES: usize = 200;

/// Millimetres of an inch.
const INCH: f64 = 25.4;

/// Reads a program of G-code. `name` is what messages call it.
///
/// # Errors
/// [`ProgramError`] at the first thing that cannot be followed.
pub fn read_gcode(
    name: &str,
    bytes: &[u8],
    control: &'static Control,
    setup: &Setup,
) -> Result<Program, ProgramError> {
    let lines = Lines::new(bytes).map_err(|(line, stop)| stop.in_line(name, line))?;
    let mut reader = Interpreter::new(lines, control, setup);
    reader.out.name = name.to_owned();
    match reader.run() {
        Ok(()) => {
            reader.out.unit = reader.state.modal.unit;
            Ok(reader.out)
        }
        Err(stop) => Err(stop.in_line(name, reader.line)),
    }
}

/// What codes of a block ask for beside setting something.
#[derive(Debug, Default, Clone, Copy)]
struct Asked {
    motion: Option<(Motion, CodeWord)>,
    /// A code that takes the axis words and moves at most by itself.
    single: Option<(Code, CodeWord)>,
    /// G53.
    machine: bool,
    length: Option<(Length, CodeWord)>,
    radius: Option<(RadiusSide, CodeWord)>,
    quiet: bool,
    /// The machine comes to rest behind the block.
    stop: bool,
}

/// A control that reads a program.
pub(crate) struct Interpreter<'a> {
    pub lines: Lines<'a>,
    /// The line at hand, from 0.
    pub line: usize,
    pub control: &'static Control,
    codes: Codes,
    delete: bool,
    pub state: State,
    pub parameters: Parameters,
    pub block: Block,
    pub flow: Flow,
    pub out: Program,
    /// The setting changed since the last step.
    changed: bool,
    /// The program has moved.
    moved: bool,
    /// It has fed.
    fed: bool,
    /// The axes that have been led to a place, and whether this block is the first one that does so with one of them.
    placed: [bool; 6],
    places: bool,
    most_repeats: u64,
    /// The cutter's radius, while it is compensated.
    pub compensation: Option<Compensation>,
    /// Where the block's text begins within its line.
    pub shift: usize,
    /// A number without a point was noted.
    noted_increments: bool,
    /// The unit of the first G20 or G21, mm.
    unit_said: Option<f64>,
    /// The work offset in which the program first moved, and the lines that had set it by then.
    zero_set: Option<(usize, [Option<u32>; 6])>,
    /// Work offsets have their places on the machine, set or not.
    offsets_known: bool,
}

impl<'a> Interpreter<'a> {
    pub fn new(lines: Lines<'a>, control: &'static Control, setup: &Setup) -> Self {
        let state = State::new(setup);
        let out = Program { start: state.place, lines: lines.len(), ..Program::default() };
        Self {
            lines,
            line: 0,
            control,
            codes: Codes::of(control),
            delete: setup.delete_blocks,
            state,
            parameters: Parameters::new(control.variables.locals),
            block: Block::default(),
            flow: Flow::default(),
            out,
            changed: true,
            moved: false,
            fed: false,
            placed: [false; 6],
            places: false,
            most_repeats: setup.most_repeats,
            compensation: None,
            shift: 0,
            noted_increments: false,
            unit_said: None,
            zero_set: None,
            offsets_known: setup.offsets_known,
        }
    }

    fn run(&mut self) -> Result<(), Stop> {
        self.run_blocks()?;
        self.end_compensation()
    }

    fn run_blocks(&mut self) -> Result<(), Stop> {
        let most = self.lines.len() as u64 + self.most_repeats;
        let mut blocks = 0;
        let mut marks = 0;
        while self.line < self.lines.len() {
            blocks += 1;
            if blocks > most {
                return Err(Stop::new(0, Fault::Endless(blocks)));
            }
            let line = self.lines.get(self.line);
            if line.iter().find(|b| !b.is_ascii_whitespace()) == Some(&b'%') {
                marks += 1;
                // What follows the closing mark is no program.
                if marks == 2 || marks == 1 && !self.out.steps.is_empty() {
                    self.out.ended = true;
                    return self.behind_the_mark();
                }
                self.line += 1;
                continue;
            }
            match self.step(line, 0)? {
                Next::Line => self.line += 1,
                Next::At(line) => self.line = line,
                Next::End => {
                    self.out.ended = true;
                    return Ok(());
                }
            }
        }
        // What is still open is told at the last line.
        self.line = self.lines.len().saturating_sub(1);
        self.flow.check_closed()
    }

    /// No control reads what stands behind the closing mark: motion there was meant to run.
    fn behind_the_mark(&mut self) -> Result<(), Stop> {
        let rest = self.line + 1..self.lines.len();
        if let Some(line) = rest.clone().find(|line| block::has_axis_words(self.lines.get(*line))) {
            self.line = line;
            return Err(Stop::new(0, Fault::BehindTheEnd("%")));
        }
        let is_text =
            |line: &usize| self.lines.get(*line).iter().any(|b| !b.is_ascii_whitespace() && *b != b'%');
        if let Some(line) = rest.into_iter().find(is_text) {
            self.line = line;
            self.note("what stands behind the closing % is passed over");
        }
        Ok(())
    }

    /// Runs the text of a line from byte `from` on.
    pub fn step(&mut self, line: &'a [u8], from: usize) -> Result<Next, Stop> {
        let Self { block, parameters, state, control, compensation, .. } = self;
        let (variables, compensated) = (&control.variables, compensation.is_some());
        let system = |number| state.system(number, variables, compensated);
        let scope = Scope { parameters, system: &system, logic: control.logic };
        let text = &line[from.min(line.len())..];
        state.unset_was_read.set(false);
        block.read(text, control, self.delete, scope).map_err(|stop| shifted(stop, from))?;
        if self.block.deleted {
            return Ok(Next::Line);
        }
        self.shift = from;
        if let Some((from, to)) = self.block.comment {
            self.remark(&text[from..to]);
        }
        let next = self.execute().map_err(|stop| shifted(stop, from))?;
        match self.block.flow {
            Some(at) => self.control_flow(line, from + at),
            None => Ok(next),
        }
    }

    /// Keeps comments that may describe a tool.
    fn remark(&mut self, text: &[u8]) {
        let text = String::from_utf8_lossy(text);
        if crate::tools::may_describe_a_tool(&text) && self.out.tools.len() < MOST_NOTES {
            let tool = self.block.peek(b'T').map_or(0, |t| t.max(0.0) as u32);
            self.out.tools.push(ToolRemark { tool, line: self.line_number(), text: text.trim().to_owned() });
        }
    }

    pub fn line_number(&self) -> u32 {
        self.line as u32 + 1
    }

    pub fn note(&mut self, text: impl Into<String>) {
        let note = Note { line: self.line_number(), text: text.into() };
        if self.out.notes.len() < MOST_NOTES && !self.out.notes.iter().any(|other| other.text == note.text) {
            self.out.notes.push(note);
        }
    }

    fn execute(&mut self) -> Result<Next, Stop> {
        if self.block.is_empty() {
            return Ok(Next::Line);
        }
        self.block.take(b'N');
        self.places = false;
        let mut asked = Asked::default();
        let unit_before = self.state.modal.unit;
        if !self.block.g.as_slice().is_empty() {
            self.settings(&mut asked)?;
        }
        if self.control.may_count_increments && !self.noted_increments {
            self.note_increments();
        }
        if let Some((Code::Macro, _)) = asked.single {
            if let Some((motion, word)) = asked.motion {
                self.begin(motion, word);
            }
            return self.call_macro();
        }
        self.words(unit_before)?;
        let next = if self.block.m.as_slice().is_empty() { Next::Line } else { self.switches()? };
        self.lengths(&asked)?;
        if let Some((side, word)) = asked.radius {
            self.compensate(side, word)?;
        }
        if asked.quiet {
            self.block.ignore(b"PQREL");
        }
        if let Some((code, word)) = asked.single {
            self.single(code, word)?;
        }
        match (asked.single, asked.motion) {
            (Some((code, _)), motion) if code.takes_axes(self.control) => {
                if let Some((motion, word)) = motion {
                    self.begin(motion, word);
                }
            }
            _ => self.motion(&asked)?,
        }
        if asked.stop || self.state.modal.exact_stop || self.block.m.as_slice().iter().any(stops) {
            self.out.dwell(0.0);
        }
        if let Some(letter) = self.block.unused() {
            return Err(Stop::new(self.block.column(letter), Fault::Unused(char::from(letter))));
        }
        for (target, value) in std::mem::take(&mut self.block.assignments) {
            self.assign(&target, value)?;
        }
        Ok(next)
    }

    /// Sets a variable of the program or of the control.
    fn assign(&mut self, target: &Target, value: Value) -> Result<(), Stop> {
        let Target::Number(number) = *target else {
            self.parameters.set(target, value);
            return Ok(());
        };
        let variables = &self.control.variables;
        if variables.is_free(number) {
            self.parameters.set(target, value);
            return Ok(());
        }
        let value = value.unwrap_or(0.0);
        if let Some((set, axis)) = variables.offset(number) {
            if self.compensation.is_some() {
                return Err(Stop::new(0, Fault::Meanwhile(format!("#{number}"))));
            }
            self.state.frame.work[set].0[axis] = value * self.unit_of(axis);
            // What is reckoned from a value that nobody said is as little known.
            let known = !self.state.unset_was_read.get();
            self.state.frame.set[set][axis] = known.then(|| self.line_number());
            self.state.reframe();
        }
        if number == 3000 { Err(Stop::new(0, Fault::Alarm(value))) } else { Ok(()) }
    }

    /// Some controls take a number without a point for least increments, by a parameter of the machine.
    fn note_increments(&mut self) {
        if let Some(letter) = self.block.pointless(b"XYZABCUVWIJRQ") {
            let (letter, value) = (char::from(letter), self.block.peek(letter).unwrap_or(0.0));
            self.noted_increments = true;
            self.note(format!(
                "{letter}{value} has no point, and a machine may take it for least increments; here it counts units, as \
                 {letter}{value}. does"
            ));
        }
    }

    /// The codes that set something, and what the others ask for.
    fn settings(&mut self, asked: &mut Asked) -> Result<(), Stop> {
        let words = self.block.g;
        let mut exact_path = false;
        for word in words.as_slice() {
            let column = usize::from(word.column);
            let Some(code) = self.codes.get(word.tenths) else {
                let code = spelled(word.tenths);
                return Err(Stop::new(column, Fault::UnknownCode { code, control: self.control.word }));
            };
            let conflict = |first: CodeWord| {
                let [first, second] = [first.tenths, word.tenths].map(spelled);
                Stop::new(column, Fault::Conflict { first, second })
            };
            if self.moves_frame(code) {
                self.needs_no_compensation(*word)?;
            }
            let modal = &mut self.state.modal;
            match code {
                Code::Motion(motion) => match asked.motion {
                    // G80 may stand before another motion.
                    Some((other, first)) if other != Motion::None && motion != Motion::None => {
                        return Err(conflict(first));
                    }
                    Some((other, _)) if other != Motion::None => {}
                    _ => asked.motion = Some((motion, *word)),
                },
                Code::Plane(plane) => modal.plane = plane,
                Code::Units { inch } => {
                    modal.unit = if inch { INCH } else { 1.0 };
                    let said = *self.unit_said.get_or_insert(modal.unit);
                    self.out.both_units |= said != modal.unit;
                }
                Code::Absolute(absolute) => modal.absolute = absolute,
                Code::ArcAbsolute(absolute) => modal.arc_absolute = absolute,
                Code::Feed(mode) => {
                    // A feed of one kind is none of another.
                    if modal.feed_mode != mode {
                        (modal.feed_mode, modal.feed) = (mode, 0.0);
                    }
                }
                Code::Retract { initial } => modal.initial = initial,
                Code::Work(number) => self.select_work(usize::from(number) - 1),
                Code::MoreWork => self.more_work(*word)?,
                Code::Length(length) => asked.length = Some((length, *word)),
                Code::Radius(side) => asked.radius = Some((side, *word)),
                Code::Machine => asked.machine = true,
                Code::Quiet => asked.quiet = true,
                Code::StopOnce => asked.stop = true,
                Code::ExactStop(stop) => (modal.exact_stop, asked.quiet) = (stop, true),
                Code::ExactPath => {
                    modal.exact_stop = false;
                    exact_path = true;
                }
                Code::Unsupported(why) => {
                    let code = spelled(word.tenths);
                    return Err(Stop::new(column, Fault::Unsupported { code, why }));
                }
                Code::Rotation(false) => {
                    self.state.frame.rotation = None;
                    self.state.reframe();
                }
                _ => match asked.single {
                    Some((_, first)) => return Err(conflict(first)),
                    None => asked.single = Some((code, *word)),
                },
            }
        }
        if exact_path {
            self.note("G61 is timed as G64: corners are rounded by no more than the junction deviation");
        }
        self.check_together(asked)
    }

    /// Refuses a motion beside a code that wants its words.
    fn check_together(&self, asked: &Asked) -> Result<(), Stop> {
        let (Some((motion, first)), Some((code, second))) = (asked.motion, asked.single) else {
            return Ok(());
        };
        let axes = self.control.axis_words_once && motion != Motion::None && code.takes_axes(self.control);
        // P would be both a time and a number of turns.
        let dwell = code == Code::Dwell && matches!(motion, Motion::Arc { .. });
        if !axes && !dwell {
            return Ok(());
        }
        let column = usize::from(second.column.max(first.column));
        let [first, second] = [first.tenths, second.tenths].map(spelled);
        Err(Stop::new(column, Fault::Conflict { first, second }))
    }

    fn select_work(&mut self, index: usize) {
        if self.state.frame.active != index {
            self.state.frame.active = index;
            self.state.reframe();
            self.changed = true;
        }
    }

    fn more_work(&mut self, word: CodeWord) -> Result<(), Stop> {
        let Some(number) = self.block.take(b'P') else { return Err(self.missing(word, "P")) };
        let index = self.whole(b'P', number, 1.0..=MORE_OFFSETS as f64, "the number of a work offset")?;
        self.select_work(crate::frame::WORK_OFFSETS + index as usize - 1);
        Ok(())
    }

    /// F, S, T.
    fn words(&mut self, unit_before: f64) -> Result<(), Stop> {
        if let Some(feed) = self.block.take(b'F') {
            let modal = &mut self.state.modal;
            let unit = if self.control.feed_before_units { unit_before } else { modal.unit };
            if !(0.0..1e9).contains(&feed) {
                return Err(self.value(b'F', feed, "a feed"));
            }
            modal.feed = if modal.feed_mode == FeedMode::InverseTime { feed } else { feed * unit };
        }
        if let Some(speed) = self.block.take(b'S') {
            if !(0.0..1e7).contains(&speed) {
                return Err(self.value(b'S', speed, "a speed"));
            }
            self.changed |= self.state.speed != speed;
            self.state.speed = speed;
        }
        if let Some(tool) = self.block.take(b'T') {
            self.state.selected = Some(self.whole(b'T', tool, 0.0..=99_999_999.0, "the number of a tool")?);
        }
        Ok(())
    }

    /// Codes of M. Those that end the program come last.
    fn switches(&mut self) -> Result<Next, Stop> {
        let (words, mut next) = (self.block.m, Next::Line);
        for word in words.as_slice() {
            match word.tenths {
                20 | 300 => next = Next::End,
                30 => self.turn(Spindle::Clockwise),
                40 => self.turn(Spindle::Anticlockwise),
                50 => self.turn(Spindle::Off),
                60 => self.change_tool(*word)?,
                610 => {
                    let Some(tool) = self.block.take(b'Q') else { return Err(self.missing_m(*word, "Q")) };
                    self.load(self.whole(b'Q', tool, 0.0..=99_999_999.0, "the number of a tool")?);
                }
                970 | 980 => next = self.call_by_number(*word)?,
                990 => next = self.return_from_call()?,
                // Coolant, stops, pallets, overrides: they move no axis.
                0 | 10 | 70 | 80 | 90 | 480 | 490 | 500 | 510 | 520 | 530 | 600 => {
                    self.block.ignore(b"P");
                }
                700 | 710 | 720 | 730 => {
                    let (code, why) =
                        (format!("M{}", word.tenths / 10), "it brings back codes of an earlier place");
                    return Err(Stop::new(usize::from(word.column), Fault::Unsupported { code, why }));
                }
                code if self.control.outside_call == Some(code) => {
                    let number = self.block.peek(b'P').map_or(String::new(), |p| format!(" O{p}"));
                    let found = format!("subprogram{number}, which M{} calls from another device", code / 10);
                    return Err(Stop::new(usize::from(word.column), Fault::NoTarget(found)));
                }
                code if self.control.tcp_switch.is_some_and(|both| both.contains(&code)) => {
                    self.state.modal.tip_kept = self.control.tcp_switch.is_some_and(|[on, _]| code == on);
                    self.changed = true;
                }
                other => {
                    self.block.ignore(b"PQRELD");
                    self.note(format!("M{} is taken to move no axis", f64::from(other) / 10.0));
                }
            }
        }
        Ok(next)
    }

    fn turn(&mut self, spindle: Spindle) {
        self.changed |= self.state.spindle != spindle;
        self.state.spindle = spindle;
    }

    fn change_tool(&mut self, word: CodeWord) -> Result<(), Stop> {
        let Some(tool) = self.state.selected else {
            return Err(self.missing_m(word, "T with the number of a tool"));
        };
        if self.compensation.is_some() {
            return Err(Stop::new(usize::from(word.column), Fault::Meanwhile("M6".to_owned())));
        }
        self.turn(Spindle::Off);
        self.out.dwell(0.0);
        self.load(tool);
        Ok(())
    }

    fn load(&mut self, tool: u32) {
        self.state.tool = tool;
        self.changed = true;
    }

    /// G43 and the like, and an H that changes the register in force.
    fn lengths(&mut self, asked: &Asked) -> Result<(), Stop> {
        // The offsets of G43.1 stand in the block.
        let given = matches!(asked.length, Some((Length::Given, _)));
        let register = if given { None } else { self.block.take(b'H') };
        let (length, word) = match asked.length {
            Some(asked) => asked,
            None if register.is_none() || self.state.modal.length == Length::Off => return Ok(()),
            None => (self.state.modal.length, CodeWord::default()),
        };
        let number = match register {
            Some(h) => Some(self.whole(b'H', h, 0.0..=99_999_999.0, "the number of a register")?),
            None => None,
        };
        let of = |number: u32| self.state.length_of(number);
        let sum = |a: [f64; 3], b: [f64; 3], sign: f64| [0, 1, 2].map(|k| a[k] + sign * b[k]);
        let before = self.state.frame.length;
        let new = match length {
            Length::Off => [0.0; 3],
            Length::Plus | Length::Tcp => of(number.unwrap_or(self.state.tool)),
            Length::Minus => sum([0.0; 3], of(number.unwrap_or(self.state.tool)), -1.0),
            Length::More => match number {
                Some(number) => sum(before, of(number), 1.0),
                None => {
                    let words = [b'X', b'Y', b'Z'].map(|k| self.block.take(k).unwrap_or(0.0));
                    sum(before, words.map(|x| x * self.state.modal.unit), 1.0)
                }
            },
            Length::Given => {
                let words = [b'X', b'Y', b'Z'].map(|letter| self.block.take(letter));
                let old = [b'I', b'J', b'K'].map(|letter| self.block.take(letter));
                if words.iter().chain(&old).all(Option::is_none) {
                    return Err(self.missing(word, "X Y or Z"));
                }
                [0, 1, 2].map(|k| words[k].or(old[k]).map_or(before[k], |x| x * self.state.modal.unit))
            }
        };
        self.state.modal.length = length;
        self.state.register = match length {
            Length::Off => 0,
            Length::Given | Length::More => number.unwrap_or(self.state.register),
            _ => number.unwrap_or(self.state.tool),
        };
        self.changed = true;
        if new != before {
            self.state.take_length(new);
            self.push(StepKind::Set, 0.0)?;
        }
        Ok(())
    }

    /// A code that takes the block's axis words for itself.
    fn single(&mut self, code: Code, word: CodeWord) -> Result<(), Stop> {
        match code {
            Code::Dwell => self.dwell_of_block(word)?,
            Code::Data => self.data(word)?,
            Code::Home(which) => self.home(usize::from(which))?,
            Code::SetHome(which) => self.state.homes[usize::from(which)] = self.nose(),
            Code::Local => self.local()?,
            Code::Shift => self.shift(word)?,
            Code::ShiftState(kind) => {
                match kind {
                    1 => self.state.frame.shift = [0.0; 6],
                    other => self.state.frame.shifted = other == 3,
                }
                self.state.frame.shifted |= kind == 1;
                self.state.reframe();
            }
            Code::Rotation(_) => self.rotate(word)?,
            _ => {}
        }
        Ok(())
    }

    /// Machine coordinates of the spindle nose.
    fn nose(&self) -> Place {
        let mut place = self.state.place;
        (0..3).for_each(|k| place[k] += self.state.frame.length[k]);
        place
    }

    /// G10: offsets and lengths.
    fn data(&mut self, word: CodeWord) -> Result<(), Stop> {
        let Some(kind) = self.block.take(b'L') else { return Err(self.missing(word, "L")) };
        let kind = self.whole(b'L', kind, 0.0..=99.0, "a kind of data")?;
        let number = self.block.take(b'P');
        match kind {
            2 | 20 => self.work_data(kind == 20, number)?,
            1 | 10..=13 => self.tool_data(kind, number, word)?,
            _ => {
                let (code, why) = (format!("G10 L{kind}"), "it sets data that the reader does not know");
                return Err(Stop::new(usize::from(word.column), Fault::Unsupported { code, why }));
            }
        }
        Ok(())
    }

    /// G10 L1 of LinuxCNC: length and radius of a tool. G10 L10 to L13 of Fanuc: length, its wear, radius, its wear.
    fn tool_data(&mut self, kind: u32, number: Option<f64>, word: CodeWord) -> Result<(), Stop> {
        let number = self.whole(b'P', number.unwrap_or(0.0), 0.0..=99_999_999.0, "the number of a tool")?;
        let unit = self.state.modal.unit;
        if kind == 1 {
            if let Some(radius) = self.block.take(b'R') {
                self.state.radii.insert(number, radius * unit);
            }
            if let Some(z) = self.block.take(b'Z') {
                self.state.lengths.entry(number).or_default()[2] = z * unit;
            }
            return Ok(());
        }
        if !self.control.variables.of_fanuc || self.block.peek(b'Z').is_some() {
            let why = "it measures the tool by where the machine stands; G10 L1 P Z sets its length";
            let code = format!("G10 L{kind}");
            return Err(Stop::new(usize::from(word.column), Fault::Unsupported { code, why }));
        }
        let Some(value) = self.block.take(b'R').map(|value| value * unit) else {
            return Err(self.missing(word, "R"));
        };
        let state = &mut self.state;
        let (any_radius, incremental) = (state.any_radius.unwrap_or(0.0), !state.modal.absolute);
        let entry = match kind {
            10 => &mut state.lengths.entry(number).or_default()[2],
            11 => state.length_wear.entry(number).or_default(),
            12 => state.radii.entry(number).or_insert(any_radius),
            _ => state.radius_wear.entry(number).or_default(),
        };
        *entry = value + if incremental { *entry } else { 0.0 };
        Ok(())
    }

    /// G10 L2 and L20: work offsets, by their values or by what the place here is to be called.
    fn work_data(&mut self, here: bool, number: Option<f64>) -> Result<(), Stop> {
        let number = number.unwrap_or(0.0);
        let most = crate::frame::WORK_OFFSETS as f64;
        let number = self.whole(b'P', number, 0.0..=most, "the number of a work offset")?;
        let index = if number == 0 { self.state.frame.active } else { number as usize - 1 };
        let turn = self.block.take(b'R');
        if let Some(turn) = turn.filter(|_| !here) {
            self.state.frame.work[index].1 = turn;
        }
        let named = AXES.map(|letter| self.block.take(letter));
        let mut offset = self.state.frame.work[index].0;
        if here {
            // The offset under which the place here has the coordinates that are given.
            let mut frame = self.state.frame.clone();
            frame.active = index;
            let mut at = frame.program_place(&self.state.place);
            for k in 0..6 {
                at[k] = named[k].map_or(at[k], |x| x * self.unit_of(k));
            }
            let shown = frame.machine_place(&at);
            (0..6).for_each(|k| offset[k] += self.state.place[k] - shown[k]);
            // The place here is known as far as the part's zero is.
            let line = self.line_number();
            for k in (0..6).filter(|k| named[*k].is_some()) {
                self.state.frame.set[index][k] = self.zero_set.and_then(|(_, set)| set[k]).map(|_| line);
            }
        } else {
            let counts_from_zero = self.state.modal.absolute || self.control.one_shift;
            for k in 0..6 {
                if let Some(x) = named[k] {
                    let old = if counts_from_zero { 0.0 } else { offset[k] };
                    offset[k] = old + x * self.unit_of(k);
                    if counts_from_zero {
                        self.state.frame.set[index][k] = Some(self.line_number());
                    }
                }
            }
        }
        self.state.frame.work[index].0 = offset;
        self.state.reframe();
        Ok(())
    }

    fn unit_of(&self, axis: usize) -> f64 {
        if axis < 3 { self.state.modal.unit } else { 1.0 }
    }

    /// G28 and G30: over a point to a fixed place.
    fn home(&mut self, which: usize) -> Result<(), Stop> {
        let named = self.block.has_any(AXIS_BITS);
        let letters = AXES.map(|letter| !named || self.block.peek(letter).is_some());
        self.block.ignore(b"P");
        if named {
            let over = self.target()?;
            self.go(StepKind::Rapid, over)?;
            self.places = false;
        }
        (0..6).filter(|k| letters[*k]).for_each(|k| self.place_axis(k));
        let mut to = self.nose();
        (0..6).filter(|k| letters[*k]).for_each(|k| to[k] = self.state.homes[which][k]);
        self.go_to_machine(to)
    }

    fn go_to_machine(&mut self, mut nose: Place) -> Result<(), Stop> {
        (0..3).for_each(|k| nose[k] -= self.state.frame.length[k]);
        let still = nose == self.state.place;
        self.state.place = nose;
        self.state.reframe();
        if still { Ok(()) } else { self.push(StepKind::Rapid, 0.0) }
    }

    /// G52: a zero within the work offset.
    fn local(&mut self) -> Result<(), Stop> {
        for (k, letter) in AXES.into_iter().enumerate() {
            if let Some(x) = self.block.take(letter) {
                let x = x * self.unit_of(k);
                let frame = &mut self.state.frame;
                if self.control.one_shift { frame.shift[k] = x } else { frame.local[k] = x }
            }
        }
        self.state.frame.shifted = true;
        self.state.reframe();
        Ok(())
    }

    /// G92: the place here has these coordinates.
    fn shift(&mut self, word: CodeWord) -> Result<(), Stop> {
        if !self.block.has_any(AXIS_BITS) {
            return Err(self.missing(word, "X Y Z A B or C"));
        }
        let mut named = [None; 6];
        for (k, letter) in AXES.into_iter().enumerate() {
            named[k] = self.block.take(letter).map(|x| x * self.unit_of(k));
        }
        let at = self.state.at;
        let frame = &mut self.state.frame;
        frame.shifted = true;
        for k in 0..6 {
            if let Some(x) = named[k] {
                frame.shift[k] += at[k] - x;
            }
        }
        self.state.reframe();
        Ok(())
    }

    /// G68: turns what follows in the plane.
    fn rotate(&mut self, word: CodeWord) -> Result<(), Stop> {
        let Some(angle) = self.block.take(b'R') else { return Err(self.missing(word, "R")) };
        let [u, v, w] = self.state.modal.plane.axes();
        if self.block.peek(AXES[w]).is_some() {
            let (code, why) = (spelled(word.tenths), "coordinate systems turned in space are not followed");
            return Err(Stop::new(usize::from(word.column), Fault::Unsupported { code, why }));
        }
        self.state.frame.rotation = None;
        self.state.reframe();
        let unit = self.state.modal.unit;
        let centre = [u, v].map(|k| self.block.take(AXES[k]).map_or(self.state.at[k], |x| x * unit));
        self.state.frame.rotation = Some(Rotation { axes: [u, v], centre, angle });
        self.state.reframe();
        Ok(())
    }

    /// Where the block's axis words lead, in the program's coordinates.
    #[inline]
    pub fn target(&mut self) -> Result<Place, Stop> {
        let mut to = self.state.at;
        let (unit, absolute) = (self.state.modal.unit, self.state.modal.absolute);
        for (k, letter) in AXES.into_iter().enumerate() {
            if let Some(value) = self.block.take(letter) {
                if absolute {
                    self.place_axis(k);
                    self.check_offset(k)?;
                }
                let value = if k < 3 { value * unit } else { value };
                to[k] = if absolute { value } else { to[k] + value };
                if to[k].is_nan() || to[k].abs() > geometry::MAX_COORDINATE {
                    let (letter, column) = (char::from(letter), self.block.column(letter));
                    return Err(Stop::new(column, Fault::Range { letter, value }));
                }
            }
        }
        Ok(to)
    }

    /// Refuses a place along an axis where it is not known how far the work offset in force is from that of the part's zero: one of
    /// them is set to machine coordinates, the other stands where nobody said.
    pub fn check_offset(&self, axis: usize) -> Result<(), Stop> {
        let Some((first, at_first)) = self.zero_set.filter(|_| !self.offsets_known) else { return Ok(()) };
        let frame = &self.state.frame;
        let (active, now) = (frame.active, frame.set[frame.active]);
        let known_alike = |k: usize| now[k].is_some() == at_first[k].is_some();
        // A turn leads X and Y together.
        let alike = known_alike(axis) && (axis > 1 || !frame.turns() || known_alike(0) && known_alike(1));
        if alike {
            return Ok(());
        }
        let line = now.iter().chain(&at_first).flatten().next().copied().unwrap_or_default();
        let [first, active] = [first, active].map(offset_name);
        let fault = match now.iter().any(Option::is_some) {
            true if first == active => {
                format!("line {line} sets {active}, and where {first} was in the moves before is not known")
            }
            true => format!(
                "line {line} sets {active}, and where {first} is, in which the program moves first, is not known"
            ),
            false => format!(
                "line {line} sets {first}, in which the program moves first, and where {active} is is not known"
            ),
        };
        Err(Stop::new(self.block.column(AXES[axis]), Fault::Offset(fault)))
    }

    /// An axis is led to a place.
    fn place_axis(&mut self, axis: usize) {
        self.places |= !self.placed[axis];
        self.placed[axis] = true;
    }

    fn motion(&mut self, asked: &Asked) -> Result<(), Stop> {
        let axes = self.block.has_any(AXIS_BITS);
        if let Some((motion, word)) = asked.motion {
            self.begin(motion, word);
        }
        if asked.machine {
            return self.in_machine(axes);
        }
        let offsets = || b"IJK".iter().any(|letter| self.block.peek(*letter).is_some());
        match self.state.modal.motion {
            Motion::Arc { clockwise } if axes || offsets() => self.arc(clockwise),
            _ if !axes => Ok(()),
            Motion::Rapid => {
                let to = self.target()?;
                self.straight(StepKind::Rapid, to, 0.0)
            }
            Motion::Line => {
                let to = self.target()?;
                let feed = self.feed(self.length_to(&to))?;
                self.straight(StepKind::Feed, to, feed)
            }
            Motion::Cycle(cycle) => {
                let code = self.state.modal.code;
                self.needs_no_compensation(CodeWord { tenths: code, ..CodeWord::default() })?;
                self.cycle(cycle)
            }
            Motion::Arc { .. } => Ok(()),
            Motion::None => {
                let letter = self.block.unused().unwrap_or(b'X');
                let code = format!("the word {}", char::from(letter));
                let words = "a motion such as G0 or G1, in this block or before";
                Err(Stop::new(self.block.column(letter), Fault::Missing { code, words }))
            }
        }
    }

    /// A straight move, compensated where the cutter's radius is.
    fn straight(&mut self, kind: StepKind, to: Place, feed: f64) -> Result<(), Stop> {
        if self.compensation.is_some() {
            self.beside(Way::Straight(kind), to, feed)
        } else {
            self.fed(kind, to, feed)
        }
    }

    /// Whether a code changes what the compensated moves are placed in.
    fn moves_frame(&self, code: Code) -> bool {
        let modal = &self.state.modal;
        match code {
            Code::Plane(plane) => plane != modal.plane,
            Code::Work(number) => usize::from(number) - 1 != self.state.frame.active,
            Code::Length(_)
            | Code::MoreWork
            | Code::Machine
            | Code::Data
            | Code::Home(_)
            | Code::SetHome(_) => true,
            Code::Local | Code::Shift | Code::ShiftState(_) | Code::Rotation(true) => true,
            Code::Rotation(false) => self.state.frame.rotation.is_some(),
            _ => false,
        }
    }

    /// A motion code takes force.
    fn begin(&mut self, motion: Motion, word: CodeWord) {
        match (self.state.modal.motion, motion) {
            // LinuxCNC wants the words of another cycle anew.
            (Motion::Cycle(before), Motion::Cycle(cycle))
                if self.control.cycle_words_stay && before != cycle =>
            {
                self.state.sticky = Sticky { level: self.state.sticky.level, ..Sticky::default() };
            }
            (Motion::Cycle(_), Motion::Cycle(_)) => {}
            _ => self.state.sticky = Sticky::default(),
        }
        (self.state.modal.motion, self.state.modal.code) = (motion, word.tenths);
    }

    /// G53: the axis words are machine coordinates.
    fn in_machine(&mut self, axes: bool) -> Result<(), Stop> {
        if !axes {
            return Ok(());
        }
        let mut to = self.nose();
        for (k, letter) in AXES.into_iter().enumerate() {
            if let Some(value) = self.block.take(letter) {
                to[k] = value * self.unit_of(k);
                self.place_axis(k);
            }
        }
        if self.state.modal.motion == Motion::Line {
            let mut tip = to;
            (0..3).for_each(|k| tip[k] -= self.state.frame.length[k]);
            let at = self.state.frame.program_place(&tip);
            let feed = self.feed(self.length_to(&at))?;
            return self.fed(StepKind::Feed, at, feed);
        }
        self.go_to_machine(to)
    }

    fn length_to(&self, to: &Place) -> f64 {
        fed_length(&self.state.at, to)
    }

    /// The feed of a move of this length, mm/min; 0 where the program gives none.
    pub fn feed(&self, length: f64) -> Result<f64, Stop> {
        let modal = &self.state.modal;
        match modal.feed_mode {
            FeedMode::PerMinute => Ok(modal.feed),
            FeedMode::PerRevolution => Ok(modal.feed * self.state.speed),
            // The word was taken: its presence counts, not its value of before.
            FeedMode::InverseTime if self.block.peek(b'F').is_some() => Ok(modal.feed * length),
            FeedMode::InverseTime => {
                let code = "a move under G93".to_owned();
                Err(Stop::new(0, Fault::Missing { code, words: "F in its own block" }))
            }
        }
    }

    /// A rapid, in the program's coordinates.
    pub fn go(&mut self, kind: StepKind, to: Place) -> Result<(), Stop> {
        self.fed(kind, to, 0.0)
    }

    /// A move, in the program's coordinates.
    #[inline]
    pub fn fed(&mut self, kind: StepKind, to: Place, feed: f64) -> Result<(), Stop> {
        let place = self.state.frame.machine_place(&to);
        let still = place == self.state.place && !matches!(kind, StepKind::Arc(_));
        (self.state.at, self.state.place) = (to, place);
        if still { Ok(()) } else { self.push(kind, feed) }
    }

    /// An exact arc to here.
    pub fn arc_to(&mut self, arc: Arc, to: Place, feed: f64) -> Result<(), Stop> {
        let index = self.out.arcs.len() as u32;
        self.out.arcs.push(arc);
        self.fed(StepKind::Arc(index), to, feed)
    }

    fn push(&mut self, kind: StepKind, feed: f64) -> Result<(), Stop> {
        let setting = self.setting_index();
        self.push_as(kind, feed, self.line_number(), setting)
    }

    /// The setting in force, as an index.
    pub fn setting_index(&mut self) -> u32 {
        if self.changed {
            self.changed = false;
            self.out.settings.push(self.setting());
        }
        self.out.settings.len() as u32 - 1
    }

    /// A step of a line under a setting.
    pub fn push_as(&mut self, kind: StepKind, feed: f64, line: u32, setting: u32) -> Result<(), Stop> {
        if !self.moved && kind != StepKind::Set {
            self.moved = true;
            self.out.zero = self.zero();
            let frame = &self.state.frame;
            self.zero_set = Some((frame.active, frame.set[frame.active]));
        }
        if let Some(k) =
            self.state.place.iter().position(|x| x.is_nan() || x.abs() > geometry::MAX_COORDINATE)
        {
            let (letter, value) = (char::from(AXES[k]), self.state.place[k]);
            return Err(Stop::new(0, Fault::Range { letter, value }));
        }
        if self.out.steps.len() as u64 > self.lines.len() as u64 + self.most_repeats {
            return Err(Stop::new(0, Fault::Endless(self.out.steps.len() as u64)));
        }
        self.fed |= matches!(kind, StepKind::Feed | StepKind::Arc(_));
        self.out.steps.push(Step { kind, to: self.state.place, feed, line, setting });
        if self.places && !self.fed {
            self.out.approach = self.out.steps.len();
        }
        if kind != StepKind::Set {
            let last = self.out.steps.len() - 1;
            let placed = self.out.first.iter_mut().zip(self.placed).filter(|(_, placed)| *placed);
            placed.for_each(|(first, _)| *first = first.or(Some(last)));
        }
        Ok(())
    }

    /// The origin of the program now, a local one left aside.
    fn zero(&self) -> Place {
        let mut frame = self.state.frame.clone();
        (frame.local, frame.rotation) = ([0.0; 6], None);
        frame.machine_place(&[0.0; 6])
    }

    fn setting(&self) -> Setting {
        let State { modal, frame, register, tool, spindle, speed, .. } = &self.state;
        Setting {
            tool: *tool,
            spindle: *spindle,
            speed: *speed,
            register: *register,
            length: frame.length,
            tip_kept: modal.tip_kept || modal.length == Length::Tcp,
            work: frame.active as u32 + 1,
        }
    }

    pub fn plane_axes(&self) -> [usize; 3] {
        Plane::axes(self.state.modal.plane)
    }

    pub fn missing(&self, word: CodeWord, words: &'static str) -> Stop {
        Stop::new(usize::from(word.column), Fault::Missing { code: spelled(word.tenths), words })
    }

    pub fn missing_m(&self, word: CodeWord, words: &'static str) -> Stop {
        let code = format!("M{}", word.tenths / 10);
        Stop::new(usize::from(word.column), Fault::Missing { code, words })
    }

    pub fn value(&self, letter: u8, value: f64, expected: &'static str) -> Stop {
        Stop::new(self.block.column(letter), Fault::Value { letter: char::from(letter), value, expected })
    }

    /// A word as a whole number.
    pub fn whole(
        &self,
        letter: u8,
        value: f64,
        range: std::ops::RangeInclusive<f64>,
        expected: &'static str,
    ) -> Result<u32, Stop> {
        let whole = value.round();
        if (value - whole).abs() < 1e-4 && range.contains(&whole) {
            Ok(whole as u32)
        } else {
            Err(self.value(letter, value, expected))
        }
    }
}

/// How programs call a work offset, counted from 0.
fn offset_name(index: usize) -> String {
    match index {
        0..=5 => format!("G{}", 54 + index),
        6..=8 => format!("G59.{}", index - 5),
        _ => format!("G54.1 P{}", index + 1 - crate::frame::WORK_OFFSETS),
    }
}

/// M0 M1 M60: the machine waits.
fn stops(word: &CodeWord) -> bool {
    matches!(word.tenths, 0 | 10 | 600)
}

fn shifted(stop: Stop, by: usize) -> Stop {
    Stop { column: stop.column + by, ..stop }
}
