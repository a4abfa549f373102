//! Corners: how far a control may keep from the places where one move goes over into the next (G61, G64, G187).

use crate::control::Code;
use crate::error::Stop;
use crate::frame::Place;
use crate::interpret::Interpreter;
use crate::program::{Program, StepKind};

/// No tolerance of a path, in units of the program, is as large.
const MOST_TOLERANCE: f64 = 1e6;

/// Ways whose directions differ by less, each axis in parts of the whole, go straight on: rounding of the last
/// digit makes more of a corner, and then rounds it as little.
const STRAIGHT_ON: f64 = 1e-9;

/// How far a control keeps from the corners of its program, where one move goes over into the next.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub enum Corners {
    /// The program says nothing of it.
    #[default]
    Unsaid,
    /// It goes through them.
    Exact,
    /// It rounds them, and its path and that of the program are nowhere farther apart, mm.
    Within(f64),
    /// It rounds them as far as speed and acceleration ask for.
    Free,
}

impl Corners {
    /// Of a corner between moves of which the one is under this and the next under another.
    fn then(self, next: Self) -> Self {
        match (self, next) {
            (Self::Free, _) | (_, Self::Free) => Self::Free,
            (Self::Within(a), Self::Within(b)) => Self::Within(a.max(b)),
            (within @ Self::Within(_), _) | (_, within @ Self::Within(_)) => within,
            (_, next) => next,
        }
    }
}

impl Interpreter<'_> {
    /// What the control does at corners from here on. G64 of LinuxCNC rounds each by up to P, and leaves out
    /// places before that are off a line by up to Q, which is P where it is not written; P0 is no limit.
    pub fn corners(&mut self, code: Code) -> Result<(), Stop> {
        let tolerance = |letter: u8| match self.block.peek(letter) {
            Some(value) if !(0.0..MOST_TOLERANCE).contains(&value) => {
                Err(self.value(letter, value, "a tolerance"))
            }
            value => Ok(value.map(|value| value * self.state.modal.unit).filter(|value| *value > 0.0)),
        };
        let [p, q, e] = [tolerance(b'P')?, tolerance(b'Q')?, tolerance(b'E')?];
        let given = match code {
            Code::ExactStop(false) => p.map(|p| p + q.unwrap_or(p)),
            _ => None,
        };
        let modal = &mut self.state.modal;
        if code == Code::Smoothness {
            modal.smoothness = e;
        }
        let is_exact = match code {
            Code::Smoothness => modal.corners == Corners::Exact,
            other => other != Code::ExactStop(false),
        };
        modal.corners = match given.or(modal.smoothness) {
            _ if is_exact || self.control.corners_bounded_by.is_none() => Corners::Exact,
            Some(within) => Corners::Within(within),
            None => Corners::Free,
        };
        self.changed = true;
        if code == Code::ExactPath {
            self.note("G61 is timed as G64: corners are rounded by no more than the junction deviation");
        }
        Ok(())
    }
}

impl Program {
    /// What the control does where step `before` goes over into step `k`, between which it does not rest.
    /// Where rotary axes turn, a tolerance of lengths bounds none of them.
    pub(crate) fn corner(&self, before: usize, k: usize) -> Corners {
        let [first, second] = [before, k].map(|step| self.setting(&self.steps[step]).corners);
        // The move that ends there says whether it ends in the corner.
        if first == Corners::Exact || self.goes_straight_on(before, k) {
            return Corners::Exact;
        }
        let turns = [before, k].iter().any(|step| self.start_of(*step)[3..] != self.steps[*step].to[3..]);
        match first.then(second) {
            Corners::Within(_) if turns => Corners::Free,
            corners => corners,
        }
    }

    /// Whether two straight steps go the same way.
    fn goes_straight_on(&self, first: usize, second: usize) -> bool {
        let way = |k: usize| {
            let (from, step) = (self.start_of(k), &self.steps[k]);
            let by: Place = std::array::from_fn(|axis| step.to[axis] - from[axis]);
            let length = by.iter().map(|x| x * x).sum::<f64>().sqrt();
            (!matches!(step.kind, StepKind::Arc(_)) && length > 0.0).then(|| by.map(|x| x / length))
        };
        let (Some(first), Some(second)) = (way(first), way(second)) else { return false };
        first.iter().zip(&second).all(|(a, b)| (a - b).abs() < STRAIGHT_ON)
    }
}
