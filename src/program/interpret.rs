//! A control at work: block after block, what each makes of the state, and the motions that leave.
//!
//! The order within a block is that of LinuxCNC and ISO 6983: feed mode, F, S, T, M6, spindle, then the codes
//! that set something, then the motion, then stops.

mod motion;
mod offsets;

use crate::block::{self, Block, CodeWord};
use crate::compensation::Compensation;
use crate::control::{Code, Codes, Control, FeedMode, GROUPS, Length, Motion, Plane, RadiusSide, spelled};
use crate::error::{Fault, ProgramError, Stop};
use crate::expression::{Scope, Value};
use crate::flow::{Flow, Next};
use crate::lines::Lines;
use crate::parameters::{Parameters, Target};
use crate::program::{Note, Program, Spindle, ToolRemark};
use crate::state::{Setup, State};

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
    pub changed: bool,
    /// The program has moved.
    moved: bool,
    /// It has fed.
    fed: bool,
    /// The axes that have been led to a place, and those with which this block is the first one that does so.
    placed: [bool; 6],
    places: [bool; 6],
    /// The feed at hand leads to the first place of all.
    feeds_in: bool,
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
        let state = State::new(setup, control);
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
            places: [false; 6],
            feeds_in: false,
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
        self.places = [false; 6];
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
        let mut at_corners = None;
        let mut groups: [Option<CodeWord>; GROUPS] = [None; GROUPS];
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
            if let Some(group) = code.group() {
                match groups[group].replace(*word) {
                    Some(first) if first.tenths != word.tenths => return Err(conflict(first)),
                    _ => {}
                }
            }
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
                Code::ExactStop(stop) => {
                    (modal.exact_stop, asked.quiet) = (stop, true);
                    at_corners = Some(code);
                }
                Code::ExactPath => {
                    modal.exact_stop = false;
                    at_corners = Some(code);
                }
                Code::Smoothness => {
                    asked.quiet = true;
                    at_corners = Some(code);
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
        if let Some(code) = at_corners {
            self.corners(code)?;
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
        let mut of_spindle: Option<u16> = None;
        for word in words.as_slice() {
            if matches!(word.tenths, 30 | 40 | 50)
                && let Some(first) = of_spindle.replace(word.tenths).filter(|first| *first != word.tenths)
            {
                let [first, second] = [first, word.tenths].map(|tenths| format!("M{}", tenths / 10));
                return Err(Stop::new(usize::from(word.column), Fault::Conflict { first, second }));
            }
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

/// M0 M1 M60: the machine waits.
fn stops(word: &CodeWord) -> bool {
    matches!(word.tenths, 0 | 10 | 600)
}

fn shifted(stop: Stop, by: usize) -> Stop {
    Stop { column: stop.column + by, ..stop }
}
