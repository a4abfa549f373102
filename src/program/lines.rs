//! The lines of a program's text. Enters: bytes. Leaves: lines without their ends, counted from 0.

use crate::error::{Fault, Stop};

/// Longest line, bytes. Controls take 80 to 1000; a greater one hides that a file is no program.
const LONGEST: usize = 1 << 16;

/// Most lines: beyond, the steps of a program would not fit into any memory.
const MOST: usize = 1 << 28;

/// A program's lines.
#[derive(Debug)]
pub(crate) struct Lines<'a> {
    bytes: &'a [u8],
    /// Where each line begins, and a last end.
    starts: Vec<u32>,
}

impl<'a> Lines<'a> {
    /// Divides a text at `\n`; the first fault with its line, from 0.
    pub fn new(bytes: &'a [u8]) -> Result<Self, (usize, Stop)> {
        if bytes.len() >= u32::MAX as usize {
            return Err((0, Stop::new(0, Fault::TooManyLines(MOST))));
        }
        let mut starts = Vec::with_capacity(bytes.len() / 24 + 2);
        starts.push(0);
        starts.extend(bytes.iter().enumerate().filter(|(_, b)| **b == b'\n').map(|(k, _)| k as u32 + 1));
        if starts.last() != Some(&(bytes.len() as u32)) {
            starts.push(bytes.len() as u32);
        }
        let lines = Self { bytes, starts };
        if lines.len() > MOST {
            return Err((MOST, Stop::new(0, Fault::TooManyLines(MOST))));
        }
        lines.check()?;
        Ok(lines)
    }

    /// Refuses what is no text: a byte of control, and a line that is too long.
    fn check(&self) -> Result<(), (usize, Stop)> {
        let binary = |b: &u8| *b < b' ' && !matches!(*b, b'\t' | b'\n' | b'\r' | 0x0b | 0x0c | 0x1a);
        let text = self.bytes.iter().position(binary);
        let long = (0..self.len()).find(|k| self.get(*k).len() > LONGEST);
        let line_of = |byte: usize| self.starts.partition_point(|start| *start as usize <= byte) - 1;
        match (text, long) {
            (Some(byte), long) if long.is_none_or(|long| line_of(byte) <= long) => {
                let line = line_of(byte);
                let column = byte - self.starts[line] as usize;
                Err((line, Stop::new(column, Fault::Binary(self.bytes[byte]))))
            }
            (_, Some(long)) => Err((long, Stop::new(LONGEST, Fault::LongLine(LONGEST)))),
            _ => Ok(()),
        }
    }

    /// Number of lines.
    pub fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// A line without its end; nothing beyond the last.
    #[inline]
    pub fn get(&self, line: usize) -> &'a [u8] {
        let (Some(&from), Some(&to)) = (self.starts.get(line), self.starts.get(line + 1)) else { return &[] };
        let mut text = &self.bytes[from as usize..to as usize];
        while let [rest @ .., b'\n' | b'\r'] = text {
            text = rest;
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_end_in_every_usual_way() {
        let lines = Lines::new(b"G0\r\nX1\n\nY2").unwrap();
        let all: Vec<&[u8]> = (0..lines.len()).map(|k| lines.get(k)).collect();
        assert_eq!(all, [&b"G0"[..], b"X1", b"", b"Y2"]);
        assert_eq!(Lines::new(b"").unwrap().len(), 0);
        assert_eq!(Lines::new(b"a\n").unwrap().len(), 1);
    }

    #[test]
    fn what_is_no_text_is_refused_at_its_place() {
        let (line, stop) = Lines::new(b"G0\nX\x001").unwrap_err();
        assert_eq!((line, stop.column, *stop.fault), (1, 1, Fault::Binary(0)));
        let long = vec![b'('; 10 << 20];
        let (line, stop) = Lines::new(&long).unwrap_err();
        assert_eq!((line, stop.column), (0, LONGEST));
    }
}
