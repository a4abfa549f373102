//! A place in a line of bytes: blanks, numbers, letters.

use crate::error::{Fault, Stop};

/// A line and how far it was read.
#[derive(Debug, Clone)]
pub(crate) struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
}

/// Powers of ten that f64 holds exactly.
const TEN: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18,
    1e19, 1e20, 1e21, 1e22,
];

/// Whole numbers below this are exact in f64, so that one division by a power of ten rounds once (W. D.
/// Clinger, 1990).
const EXACT: u64 = 1 << 53;

/// Digits of which a u64 holds every number.
const MOST_DIGITS: usize = 19;

impl<'a> Cursor<'a> {
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    /// Bytes that were read.
    #[inline]
    pub fn at(&self) -> usize {
        self.at
    }

    pub fn advance(&mut self, bytes: usize) {
        self.at = (self.at + bytes).min(self.bytes.len());
    }

    #[inline]
    pub fn peek(&self) -> Option<u8> {
        self.bytes.get(self.at).copied()
    }

    #[inline]
    pub fn next(&mut self) -> Option<u8> {
        let byte = self.peek()?;
        self.at += 1;
        Some(byte)
    }

    /// What was not read.
    pub fn rest(&self) -> &'a [u8] {
        &self.bytes[self.at..]
    }

    /// The bytes from `from` to here.
    pub fn since(&self, from: usize) -> &'a [u8] {
        &self.bytes[from..self.at]
    }

    /// A fault at this place.
    pub fn stop(&self, fault: Fault) -> Stop {
        Stop::new(self.at, fault)
    }

    #[inline]
    pub fn skip_blanks(&mut self) {
        while matches!(self.peek(), Some(b' ' | b'\t' | b'\r' | 0x0b | 0x0c | 0x1a)) {
            self.at += 1;
        }
    }

    /// Whether the rest begins with a word in capitals.
    pub fn starts_with(&self, word: &[u8]) -> bool {
        self.rest().get(..word.len()).is_some_and(|start| start.eq_ignore_ascii_case(word))
    }

    pub fn expect(&mut self, byte: u8, what: &'static str) -> Result<(), Stop> {
        self.skip_blanks();
        if self.peek() == Some(byte) {
            self.at += 1;
            Ok(())
        } else {
            Err(self.stop(Fault::Expected(what)))
        }
    }

    /// Letters from here on, in capitals.
    pub fn letters(&mut self) -> String {
        let from = self.at;
        while self.peek().is_some_and(|b| b.is_ascii_alphabetic()) {
            self.at += 1;
        }
        String::from_utf8_lossy(self.since(from)).to_ascii_uppercase()
    }

    /// A decimal number with a sign or without, rounded once.
    #[inline]
    pub fn number(&mut self) -> Result<f64, Stop> {
        let from = self.at;
        let negative = match self.peek() {
            Some(b'-') => {
                self.at += 1;
                true
            }
            Some(b'+') => {
                self.at += 1;
                false
            }
            _ => false,
        };
        let (mut mantissa, mut digits, mut decimals, mut point) = (0u64, 0usize, 0usize, false);
        while let Some(byte) = self.peek() {
            match byte {
                b'0'..=b'9' => {
                    if digits < MOST_DIGITS {
                        mantissa = 10 * mantissa + u64::from(byte - b'0');
                    }
                    digits += 1;
                    decimals += usize::from(point);
                }
                b'.' if !point => point = true,
                _ => break,
            }
            self.at += 1;
        }
        if digits == 0 {
            self.at = from;
            return Err(self.stop(Fault::Expected("a number")));
        }
        let size = if mantissa < EXACT && digits <= MOST_DIGITS && decimals < TEN.len() {
            mantissa as f64 / TEN[decimals]
        } else {
            self.slow_number(from)?
        };
        Ok(if negative { -size } else { size })
    }

    /// The size of a number with many digits.
    fn slow_number(&self, from: usize) -> Result<f64, Stop> {
        let text = String::from_utf8_lossy(self.since(from)).into_owned();
        let malformed = || Stop::new(from, Fault::Malformed(text.clone()));
        text.trim_start_matches(['-', '+']).parse::<f64>().map_err(|_| malformed())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn numbers_of_all_forms() {
        for (text, value) in [
            ("1", 1.0),
            ("-.5", -0.5),
            ("+3.", 3.0),
            ("007.250", 7.25),
            ("123456789012345678901234567890", 1.234_567_890_123_456_8e29),
            ("0.1000000000000000055511151231257827", 0.1),
        ] {
            assert_eq!(Cursor::new(text.as_bytes()).number().unwrap(), value, "{text}");
        }
        for bad in ["", "-", ".", "x"] {
            assert!(Cursor::new(bad.as_bytes()).number().is_err(), "{bad}");
        }
    }

    proptest! {
        #[test]
        fn every_decimal_is_read_as_the_standard_library_does(text in "-?[0-9]{1,12}(\\.[0-9]{0,14})?") {
            let expected: f64 = text.parse().unwrap();
            prop_assert_eq!(Cursor::new(text.as_bytes()).number().unwrap(), expected);
        }
    }
}
