//! What a control remembers between blocks.

use std::cell::Cell;
use std::collections::{BTreeMap, BTreeSet};

use crate::control::{Control, FeedMode, Length, Motion, Plane, Variables};
use crate::corners::Corners;
use crate::expression::System;
use crate::frame::{Frame, Place, WORK_OFFSETS};
use crate::program::{Spindle, Unset};

/// More work offsets: G54.1 P1 to P300.
pub(crate) const MORE_OFFSETS: usize = 300;

/// What a program finds when it starts. mm and degrees.
#[derive(Debug, Clone, PartialEq)]
pub struct Setup {
    /// Work offsets G54 to G59.3: the program's zero in machine coordinates.
    pub work: [Place; WORK_OFFSETS],
    /// Whether these are their places on the machine; else they are the part's zero, wherever that is.
    pub offsets_known: bool,
    /// Where G28 and G30 go, machine coordinates of the spindle nose.
    pub homes: [Place; 2],
    /// Where the machine stands, machine coordinates.
    pub start: Place,
    /// Lengths by their registers.
    pub lengths: BTreeMap<u32, [f64; 3]>,
    /// Radii of cutters by the numbers of D, mm.
    pub radii: BTreeMap<u32, f64>,
    /// That of all others, where it is known, mm.
    pub any_radius: Option<f64>,
    /// Whether lines with a slash are left out.
    pub delete_blocks: bool,
    /// Blocks and motions that loops may add to those of the file. A program that adds more has no end.
    pub most_repeats: u64,
}

impl Default for Setup {
    /// All zero, and lines with a slash run, as on a machine whose switch is off.
    fn default() -> Self {
        Self {
            work: [[0.0; 6]; WORK_OFFSETS],
            offsets_known: true,
            homes: [[0.0; 6]; 2],
            start: [0.0; 6],
            lengths: BTreeMap::new(),
            radii: BTreeMap::new(),
            any_radius: None,
            delete_blocks: false,
            most_repeats: 10_000_000,
        }
    }
}

impl Setup {
    /// A machine of which nothing is known: its zero is taken to stand `above` the program's zero, mm, and
    /// its tool starts there.
    pub fn from_above(above: f64) -> Self {
        let work = [[0.0, 0.0, -above, 0.0, 0.0, 0.0]; WORK_OFFSETS];
        Self { work, offsets_known: false, ..Self::default() }
    }

    /// A machine in whose coordinates the program's zero is `zero`, mm, and whose tool starts `above` that.
    pub fn from_zero(zero: [f64; 3], above: f64) -> Self {
        let [x, y, z] = zero;
        let start = [x, y, z + above, 0.0, 0.0, 0.0];
        Self { work: [[x, y, z, 0.0, 0.0, 0.0]; WORK_OFFSETS], start, ..Self::default() }
    }
}

/// The codes in force.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Modal {
    pub motion: Motion,
    /// Its code in tenths.
    pub code: u16,
    pub plane: Plane,
    /// mm of a unit of length.
    pub unit: f64,
    pub absolute: bool,
    pub arc_absolute: bool,
    pub feed_mode: FeedMode,
    /// As it was written, times the unit unless times are inverse.
    pub feed: f64,
    /// Cycles retract to the level before them.
    pub initial: bool,
    pub length: Length,
    /// An M word made the control move the linear axes along with the rotary ones.
    pub tip_kept: bool,
    /// The machine comes to rest behind every block.
    pub exact_stop: bool,
    pub corners: Corners,
    /// E of G187, mm.
    pub smoothness: Option<f64>,
}

/// What stays from one cycle to the next, in units of the program's coordinates (mm).
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Sticky {
    pub bottom: Option<f64>,
    pub retract: Option<f64>,
    pub peck: Option<f64>,
    /// How long the tool stands at the bottom, s.
    pub dwell: f64,
    /// I J of G76 and G87, or Q: how far the spindle is moved aside.
    pub aside: [f64; 3],
    /// The level before the first cycle.
    pub level: Option<f64>,
}

/// All that a control remembers.
#[derive(Debug)]
pub(crate) struct State {
    pub modal: Modal,
    pub frame: Frame,
    /// Where the tip is in the program's coordinates.
    pub at: Place,
    /// Where the tip is in the machine's, less the tool's length.
    pub place: Place,
    pub homes: [Place; 2],
    pub lengths: BTreeMap<u32, [f64; 3]>,
    /// The registers of lengths whose values are known.
    pub lengths_set: BTreeSet<u32>,
    pub radii: BTreeMap<u32, f64>,
    pub any_radius: Option<f64>,
    /// Wear of lengths and radii by their registers, mm: it adds to them.
    pub length_wear: BTreeMap<u32, f64>,
    pub radius_wear: BTreeMap<u32, f64>,
    pub register: u32,
    /// What of the length in force is not known.
    pub unset: Unset,
    pub selected: Option<u32>,
    pub tool: u32,
    pub spindle: Spindle,
    pub speed: f64,
    pub sticky: Sticky,
    /// The block has read a work offset that no line set.
    pub unset_was_read: Cell<bool>,
}

impl State {
    pub fn new(setup: &Setup, control: &Control) -> Self {
        let mut frame = Frame::new(setup.work);
        let more = frame.work[0];
        frame.work.extend(std::iter::repeat_n(more, MORE_OFFSETS));
        frame.set.extend(std::iter::repeat_n([None; 6], MORE_OFFSETS));
        let modal = Modal {
            motion: Motion::None,
            code: 800,
            plane: Plane::Xy,
            unit: 1.0,
            absolute: true,
            arc_absolute: false,
            feed_mode: FeedMode::PerMinute,
            feed: 0.0,
            initial: true,
            length: Length::Off,
            tip_kept: false,
            exact_stop: false,
            corners: if control.rounds_at_start { Corners::Free } else { Corners::Unsaid },
            smoothness: None,
        };
        Self {
            modal,
            at: frame.program_place(&setup.start),
            frame,
            place: setup.start,
            homes: setup.homes,
            lengths: setup.lengths.clone(),
            lengths_set: setup.lengths.keys().copied().collect(),
            radii: setup.radii.clone(),
            any_radius: setup.any_radius,
            length_wear: BTreeMap::new(),
            radius_wear: BTreeMap::new(),
            register: 0,
            unset: Unset::Nothing,
            selected: None,
            tool: 0,
            spindle: Spindle::Off,
            speed: 0.0,
            sticky: Sticky::default(),
            unset_was_read: Cell::new(false),
        }
    }

    /// The length of a register, with its wear.
    pub fn length_of(&self, number: u32) -> [f64; 3] {
        let [x, y, z] = self.lengths.get(&number).copied().unwrap_or([0.0; 3]);
        [x, y, z + self.length_wear.get(&number).unwrap_or(&0.0)]
    }

    /// Whether the length of a register is known; H0 is none.
    pub fn knows_length(&self, number: u32) -> bool {
        number == 0 || self.lengths_set.contains(&number)
    }

    /// The radius of a cutter by the number of D, with its wear, where it is known.
    pub fn radius_of(&self, number: u32) -> Option<f64> {
        let radius = self.radii.get(&number).copied().or(self.any_radius)?;
        Some(radius + self.radius_wear.get(&number).unwrap_or(&0.0))
    }

    /// After the frame has changed: the tip stays where it is.
    pub fn reframe(&mut self) {
        self.at = self.frame.program_place(&self.place);
    }

    /// Where the tip is in the program's coordinates, which differs from `at` while the radius is
    /// compensated.
    pub fn tip(&self) -> Place {
        self.frame.program_place(&self.place)
    }

    /// Takes another length for the tool's; the spindle stays where it is.
    pub fn take_length(&mut self, length: [f64; 3]) {
        for k in 0..3 {
            self.place[k] += self.frame.length[k] - length[k];
        }
        self.frame.length = length;
        self.reframe();
    }

    /// What programs can ask for by a number. Positions that the control knows with the cutter's radius or
    /// the tool's length in them are not known.
    pub fn system(&self, number: u32, variables: &Variables, compensated: bool) -> System {
        if variables.is_free(number) {
            return System::Free;
        }
        let of_fanuc = || if variables.of_fanuc { self.of_fanuc(number, compensated) } else { None };
        let of_linuxcnc = || if variables.of_linuxcnc { self.of_linuxcnc(number) } else { None };
        let offset = || {
            let (set, axis) = variables.offset(number)?;
            // LinuxCNC keeps them in units of the machine.
            let known = variables.of_fanuc || self.modal.unit == 1.0;
            if self.frame.set[set][axis].is_none() {
                self.unset_was_read.set(true);
            }
            known.then(|| self.in_units(axis, self.frame.work[set].0[axis]))
        };
        of_fanuc().or_else(of_linuxcnc).or_else(offset).map_or(System::Unknown, System::Value)
    }

    /// A coordinate in units of the program.
    fn in_units(&self, axis: usize, value: f64) -> f64 {
        if axis < 3 { value / self.modal.unit } else { value }
    }

    fn of_linuxcnc(&self, number: u32) -> Option<f64> {
        match number {
            5400 => Some(f64::from(self.tool)),
            5220 => Some(self.frame.active as f64 + 1.0),
            5420..=5425 => {
                let axis = number as usize - 5420;
                Some(self.in_units(axis, self.at[axis]))
            }
            _ => None,
        }
    }

    fn of_fanuc(&self, number: u32, compensated: bool) -> Option<f64> {
        let modal = &self.modal;
        let axis = (number as usize % 10).wrapping_sub(1);
        match number {
            4001 if !matches!(modal.motion, Motion::Cycle(_) | Motion::None) => {
                Some(f64::from(modal.code) / 10.0)
            }
            4002 => Some([17.0, 18.0, 19.0][modal.plane as usize]),
            4003 => Some(if modal.absolute { 90.0 } else { 91.0 }),
            4006 => Some(if modal.unit > 1.0 { 20.0 } else { 21.0 }),
            4109 if modal.feed_mode != FeedMode::InverseTime => Some(modal.feed / modal.unit),
            4119 => Some(self.speed),
            4120 => self.selected.map(f64::from),
            5001..=5006 => Some(self.in_units(axis, self.at[axis])),
            5021..=5026 if !compensated => {
                let length = self.frame.length.get(axis).unwrap_or(&0.0);
                Some(self.in_units(axis, self.place[axis] + length))
            }
            5041..=5046
                if !compensated && self.frame.length.get(axis).is_none_or(|length| *length == 0.0) =>
            {
                Some(self.in_units(axis, self.at[axis]))
            }
            _ => None,
        }
    }
}
