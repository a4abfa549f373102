//! Where the axis words of a block lead, and the steps that leave.

use super::{AXES, AXIS_BITS, Asked, Interpreter};
use crate::block::CodeWord;
use crate::compensation::Way;
use crate::control::{Code, FeedMode, Length, Motion};
use crate::error::{Fault, Stop};
use crate::frame::{Place, fed_length};
use crate::program::{Arc, Setting, Step, StepKind};
use crate::state::{State, Sticky};

impl Interpreter<'_> {
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

    /// Whether an axis has been led to a place.
    pub fn is_placed(&self, axis: usize) -> bool {
        self.placed[axis]
    }

    /// An axis is led to a place.
    pub(super) fn place_axis(&mut self, axis: usize) {
        self.places[axis] |= !self.placed[axis];
        self.placed[axis] = true;
    }

    pub(super) fn motion(&mut self, asked: &Asked) -> Result<(), Stop> {
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
                self.feeds_in = self.leads_in();
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

    /// Whether a straight feed comes from where nobody knows: Z, or X and Y, have their first places here, and
    /// no axis is without one from here on.
    fn leads_in(&mut self) -> bool {
        let [x, y, z, ..] = self.places;
        let leads =
            (z || x && y) && self.placed[..3] == [true; 3] && !self.fed && self.compensation.is_none();
        if leads {
            self.note("it feeds from where nobody knows; its way there counts neither as time nor as air");
        }
        leads
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
    pub(super) fn moves_frame(&self, code: Code) -> bool {
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
    pub(super) fn begin(&mut self, motion: Motion, word: CodeWord) {
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

    pub(super) fn push(&mut self, kind: StepKind, feed: f64) -> Result<(), Stop> {
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
        let feeds_in = std::mem::take(&mut self.feeds_in);
        self.fed |= matches!(kind, StepKind::Feed | StepKind::Arc(_)) && !feeds_in;
        self.out.steps.push(Step { kind, to: self.state.place, feed, line, setting });
        if self.places.contains(&true) && !self.fed {
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
    pub(super) fn zero(&self) -> Place {
        let mut frame = self.state.frame.clone();
        (frame.local, frame.rotation) = ([0.0; 6], None);
        frame.machine_place(&[0.0; 6])
    }

    pub(super) fn setting(&self) -> Setting {
        let State { modal, frame, register, unset, tool, spindle, speed, .. } = &self.state;
        Setting {
            tool: *tool,
            spindle: *spindle,
            speed: *speed,
            register: *register,
            length: frame.length,
            unset: *unset,
            tip_kept: modal.tip_kept || modal.length == Length::Tcp,
            work: frame.active as u32 + 1,
            corners: modal.corners,
        }
    }
}
