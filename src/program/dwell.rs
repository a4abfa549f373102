//! Dwells (G4, P of cycles): the time for which the tip stands.

use crate::block::CodeWord;
use crate::error::Stop;
use crate::interpret::Interpreter;
use crate::program::Program;

/// Longest dwell, s: a day.
const LONGEST: f64 = 86_400.0;

impl Interpreter<'_> {
    /// G4: P as the control counts it, else X or U in seconds where it takes these.
    pub fn dwell_of_block(&mut self, word: CodeWord) -> Result<(), Stop> {
        let seconds = match self.dwell_word()? {
            Some(seconds) => seconds,
            None if self.control.dwell_takes_x => self.dwell_of_axis_word()?,
            None => return Err(self.missing(word, "P, its time")),
        };
        self.block.ignore(b"SF");
        self.out.dwell(seconds);
        Ok(())
    }

    fn dwell_of_axis_word(&mut self) -> Result<f64, Stop> {
        let Some(letter) = [b'X', b'U'].into_iter().find(|letter| self.block.peek(*letter).is_some()) else {
            self.note("a dwell without P, X or U is taken to last no time");
            return Ok(0.0);
        };
        let seconds = self.seconds(letter, 1.0)?;
        self.block.ignore(b"XU");
        Ok(seconds)
    }

    /// P of a dwell, s: milliseconds on some controls where it has no decimal point.
    pub fn dwell_word(&mut self) -> Result<Option<f64>, Stop> {
        if self.block.take(b'P').is_none() {
            return Ok(None);
        }
        let unit = if self.control.dwell_in_ms && !self.has_point(b'P') { 1e-3 } else { 1.0 };
        self.seconds(b'P', unit).map(Some)
    }

    fn seconds(&self, letter: u8, unit: f64) -> Result<f64, Stop> {
        let value = self.block.peek(letter).unwrap_or_default();
        let seconds = value * unit;
        if (0.0..=LONGEST).contains(&seconds) {
            Ok(seconds)
        } else {
            Err(self.value(letter, value, "a dwell"))
        }
    }

    /// Whether the number of a word is written with a decimal point.
    fn has_point(&self, letter: u8) -> bool {
        let text = self.lines.get(self.line).get(self.shift + self.block.column(letter) + 1..);
        let number = |byte: &&u8| byte.is_ascii_digit() || matches!(**byte, b'.' | b'+' | b'-' | b' ');
        text.unwrap_or_default().iter().take_while(number).any(|byte| *byte == b'.')
    }
}

impl Program {
    /// The machine comes to rest, and stands for so many seconds, before the next step.
    pub(crate) fn dwell(&mut self, seconds: f64) {
        let next = self.steps.len();
        match self.dwells.last_mut() {
            Some((step, all)) if *step == next => *all += seconds,
            _ => self.dwells.push((next, seconds)),
        }
    }
}
