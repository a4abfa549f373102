//! What coordinates are counted from: work offsets, lengths of tools, local zeros, turned coordinates, places
//! of the machine.

use super::{AXES, AXIS_BITS, Asked, Interpreter};
use crate::block::CodeWord;
use crate::control::{Length, spelled};
use crate::error::{Fault, Stop};
use crate::frame::{Place, Rotation};
use crate::program::{StepKind, Unset};
use crate::state::MORE_OFFSETS;

impl Interpreter<'_> {
    pub(super) fn select_work(&mut self, index: usize) {
        if self.state.frame.active != index {
            self.state.frame.active = index;
            self.state.reframe();
            self.changed = true;
        }
    }

    pub(super) fn more_work(&mut self, word: CodeWord) -> Result<(), Stop> {
        let Some(number) = self.block.take(b'P') else { return Err(self.missing(word, "P")) };
        let index = self.whole(b'P', number, 1.0..=MORE_OFFSETS as f64, "the number of a work offset")?;
        self.select_work(crate::frame::WORK_OFFSETS + index as usize - 1);
        Ok(())
    }

    /// G43 and the like, and an H that changes the register in force.
    pub(super) fn lengths(&mut self, asked: &Asked) -> Result<(), Stop> {
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
        self.state.unset = self.unset_part(length, number);
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

    /// What of a length that takes force nobody knows. `number` is its register.
    fn unset_part(&self, length: Length, number: Option<u32>) -> Unset {
        let state = &self.state;
        let register = number.unwrap_or(state.tool);
        match length {
            Length::Plus | Length::Tcp if !state.knows_length(register) => Unset::Plus(register),
            Length::Minus if !state.knows_length(register) => Unset::Minus(register),
            Length::More => match number.filter(|number| !state.knows_length(*number)) {
                Some(_) => Unset::Sum(self.line_number()),
                None => state.unset,
            },
            Length::Given if [b'Z', b'K'].iter().all(|word| self.block.peek(*word).is_none()) => state.unset,
            _ => Unset::Nothing,
        }
    }

    /// Machine coordinates of the spindle nose.
    pub(super) fn nose(&self) -> Place {
        let mut place = self.state.place;
        (0..3).for_each(|k| place[k] += self.state.frame.length[k]);
        place
    }

    /// G10: offsets and lengths.
    pub(super) fn data(&mut self, word: CodeWord) -> Result<(), Stop> {
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

    /// G10 L1 of LinuxCNC: length and radius of a tool. G10 L10 to L13 of Fanuc: length, its wear, radius,
    /// its wear.
    fn tool_data(&mut self, kind: u32, number: Option<f64>, word: CodeWord) -> Result<(), Stop> {
        let number = self.whole(b'P', number.unwrap_or(0.0), 0.0..=99_999_999.0, "the number of a tool")?;
        let unit = self.state.modal.unit;
        if kind == 1 {
            if let Some(radius) = self.block.take(b'R') {
                self.state.radii.insert(number, radius * unit);
            }
            if let Some(z) = self.block.take(b'Z') {
                self.state.lengths.entry(number).or_default()[2] = z * unit;
                self.state.lengths_set.insert(number);
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
        if kind == 10 && !incremental {
            state.lengths_set.insert(number);
        }
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

    pub(super) fn unit_of(&self, axis: usize) -> f64 {
        if axis < 3 { self.state.modal.unit } else { 1.0 }
    }

    /// G28 and G30: over a point to a fixed place.
    pub(super) fn home(&mut self, which: usize) -> Result<(), Stop> {
        let named = self.block.has_any(AXIS_BITS);
        let letters = AXES.map(|letter| !named || self.block.peek(letter).is_some());
        self.block.ignore(b"P");
        if named {
            let over = self.target()?;
            self.go(StepKind::Rapid, over)?;
            self.places = [false; 6];
        }
        (0..6).filter(|k| letters[*k]).for_each(|k| self.place_axis(k));
        let mut to = self.nose();
        (0..6).filter(|k| letters[*k]).for_each(|k| to[k] = self.state.homes[which][k]);
        self.go_to_machine(to)
    }

    pub(super) fn go_to_machine(&mut self, mut nose: Place) -> Result<(), Stop> {
        (0..3).for_each(|k| nose[k] -= self.state.frame.length[k]);
        let still = nose == self.state.place;
        self.state.place = nose;
        self.state.reframe();
        if still { Ok(()) } else { self.push(StepKind::Rapid, 0.0) }
    }

    /// G52: a zero within the work offset.
    pub(super) fn local(&mut self) -> Result<(), Stop> {
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
    pub(super) fn shift(&mut self, word: CodeWord) -> Result<(), Stop> {
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
    pub(super) fn rotate(&mut self, word: CodeWord) -> Result<(), Stop> {
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

    /// Refuses a place along an axis where it is not known how far the work offset in force is from that of
    /// the part's zero: one of them is set to machine coordinates, the other stands where nobody said.
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
}

/// How programs call a work offset, counted from 0.
fn offset_name(index: usize) -> String {
    match index {
        0..=5 => format!("G{}", 54 + index),
        6..=8 => format!("G59.{}", index - 5),
        _ => format!("G54.1 P{}", index + 1 - crate::frame::WORK_OFFSETS),
    }
}
