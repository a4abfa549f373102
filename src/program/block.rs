//! A block: the words of one line. Enters: a line of bytes. Leaves: values by letter, the codes of G and M,
//! assignments.

use crate::control::Control;
use crate::cursor::Cursor;
use crate::error::{Fault, Stop};
use crate::expression::{Scope, Value, angled, open, operand};
use crate::parameters::{Target, index, name};

/// Codes of one kind in a block: more than any control takes.
const MOST_CODES: usize = 20;

/// A code of G or M in tenths, and where it stands.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct CodeWord {
    pub tenths: u16,
    pub column: u16,
}

/// Codes of one kind, in order.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct CodeWords {
    list: [CodeWord; MOST_CODES],
    count: usize,
}

impl CodeWords {
    fn push(&mut self, code: CodeWord) -> bool {
        let room = self.count < MOST_CODES;
        if room {
            self.list[self.count] = code;
            self.count += 1;
        }
        room
    }

    pub fn as_slice(&self) -> &[CodeWord] {
        &self.list[..self.count]
    }
}

/// The words of a line.
#[derive(Debug, Clone, Default)]
pub(crate) struct Block {
    /// Values by letter, A first.
    values: [f64; 26],
    columns: [u16; 26],
    /// Bits of the letters that are there.
    present: u32,
    /// Bits of the letters that something took.
    taken: u32,
    /// Bits of the letters whose number is not zero and has no point.
    pointless: u32,
    pub g: CodeWords,
    pub m: CodeWords,
    /// What the line sets once all of it is read.
    pub assignments: Vec<(Target, Value)>,
    /// The text of the first comment.
    pub comment: Option<(usize, usize)>,
    /// Where a word of control flow begins.
    pub flow: Option<usize>,
    /// Whether the line was deleted by a slash.
    pub deleted: bool,
}

fn bit(letter: u8) -> u32 {
    1 << (letter - b'A')
}

impl Block {
    fn clear(&mut self) {
        (self.present, self.taken, self.pointless) = (0, 0, 0);
        (self.g.count, self.m.count) = (0, 0);
        self.assignments.clear();
        (self.comment, self.flow, self.deleted) = (None, None, false);
    }

    /// A word's value, which is not taken by that.
    #[inline]
    pub fn peek(&self, letter: u8) -> Option<f64> {
        (self.present & bit(letter) != 0).then(|| self.values[usize::from(letter - b'A')])
    }

    /// A word's value, which is taken.
    #[inline]
    pub fn take(&mut self, letter: u8) -> Option<f64> {
        self.taken |= bit(letter);
        self.peek(letter)
    }

    /// The first of these letters whose number is not zero and has no point.
    pub fn pointless(&self, letters: &[u8]) -> Option<u8> {
        letters.iter().copied().find(|letter| self.pointless & self.present & bit(*letter) != 0)
    }

    /// Takes words that move nothing.
    pub fn ignore(&mut self, letters: &[u8]) {
        self.taken |= letters.iter().fold(0, |bits, letter| bits | bit(*letter));
    }

    /// Whether any of these letters is there and not taken.
    #[inline]
    pub fn has_any(&self, letters: u32) -> bool {
        self.present & !self.taken & letters != 0
    }

    /// Where a letter's word stands.
    pub fn column(&self, letter: u8) -> usize {
        usize::from(self.columns[usize::from(letter - b'A')])
    }

    /// The first word that nothing took.
    #[inline]
    pub fn unused(&self) -> Option<u8> {
        match self.present & !self.taken {
            0 => None,
            rest => (b'A'..=b'Z')
                .filter(|letter| rest & bit(*letter) != 0)
                .min_by_key(|letter| self.columns[usize::from(letter - b'A')]),
        }
    }

    /// All words but G, M, N and O, for calls with arguments.
    pub fn arguments(&mut self) -> Vec<(u8, f64)> {
        let words = (b'A'..=b'Z').filter_map(|letter| Some((letter, self.peek(letter)?))).collect();
        self.taken = self.present;
        words
    }

    /// Whether it has no words.
    pub fn is_empty(&self) -> bool {
        self.present == 0 && self.g.count == 0 && self.m.count == 0 && self.assignments.is_empty()
    }

    /// Reads a line. Stops before a word of control flow (`O`, `IF`, `WHILE`, `GOTO`, `DO`, `END`) and leaves
    /// its place.
    pub fn read(
        &mut self,
        line: &[u8],
        control: &Control,
        delete: bool,
        scope: Scope<'_>,
    ) -> Result<(), Stop> {
        self.clear();
        let mut text = Cursor::new(line);
        text.skip_blanks();
        if text.peek() == Some(b'/') {
            text.next();
            if text.peek().is_some_and(|b| b.is_ascii_digit()) {
                text.next();
            }
            if delete {
                self.deleted = true;
                return Ok(());
            }
        }
        loop {
            text.skip_blanks();
            let Some(byte) = text.peek() else { return Ok(()) };
            match byte {
                b'a'..=b'z' | b'A'..=b'Z' => {
                    if !self.word(&mut text, control, scope)? {
                        return Ok(());
                    }
                }
                b'(' => self.comment(&mut text)?,
                b';' => {
                    self.comment.get_or_insert((text.at() + 1, line.len()));
                    return Ok(());
                }
                b'#' => self.assignment(&mut text, control, scope)?,
                b'%' => return Ok(()),
                b':' => {
                    self.flow = Some(text.at());
                    return Ok(());
                }
                _ => return Err(text.stop(Fault::Character(shown(text.rest())))),
            }
        }
    }

    fn comment(&mut self, text: &mut Cursor<'_>) -> Result<(), Stop> {
        let Some(length) = text.rest().iter().position(|b| *b == b')') else {
            return Err(text.stop(Fault::OpenComment));
        };
        self.comment.get_or_insert((text.at() + 1, text.at() + length));
        text.advance(length + 1);
        Ok(())
    }

    /// Reads a word; false where control flow begins.
    #[inline]
    fn word(&mut self, text: &mut Cursor<'_>, control: &Control, scope: Scope<'_>) -> Result<bool, Stop> {
        let column = text.at();
        let letter = text.next().unwrap_or(b'X').to_ascii_uppercase();
        if letter == b'O' || text.peek().is_some_and(|b| b.is_ascii_alphabetic()) && is_flow(text, letter) {
            self.flow = Some(column);
            return Ok(false);
        }
        text.skip_blanks();
        let value = match text.peek() {
            Some(b'0'..=b'9' | b'.' | b'-' | b'+') if !signed_expression(text.rest()) => {
                let from = text.at();
                let value = text.number()?;
                if value != 0.0 && !text.since(from).contains(&b'.') {
                    self.pointless |= bit(letter);
                }
                Some(value)
            }
            Some(b'#' | b'[' | b'-' | b'+') => operand(text, scope, 0)?,
            Some(b) if b.is_ascii_alphabetic() => {
                return self.function_value(text, letter, column, scope);
            }
            _ => return Err(Stop::new(column, Fault::Number(char::from(letter).to_string()))),
        };
        self.set(letter, value, column, control)?;
        Ok(true)
    }

    /// A letter before a function: `XSIN[30]`. A word of several letters is no such thing.
    fn function_value(
        &mut self,
        text: &mut Cursor<'_>,
        letter: u8,
        column: usize,
        scope: Scope<'_>,
    ) -> Result<bool, Stop> {
        let mut ahead = text.clone();
        let letters = ahead.letters();
        ahead.skip_blanks();
        if ahead.peek() != Some(b'[') {
            let word = format!("{}{letters}", char::from(letter));
            return Err(Stop::new(column, Fault::Malformed(word)));
        }
        let value = operand(text, scope, 0)?;
        self.store(letter, value.unwrap_or(0.0), column)?;
        Ok(true)
    }

    #[inline]
    fn set(&mut self, letter: u8, value: Value, column: usize, control: &Control) -> Result<(), Stop> {
        match value {
            Some(value) => self.store(letter, value, column),
            None if control.empty_words => Ok(()),
            None => self.store(letter, 0.0, column),
        }
    }

    #[inline]
    fn store(&mut self, letter: u8, value: f64, column: usize) -> Result<(), Stop> {
        match letter {
            b'G' | b'M' => {
                let tenths = (value * 10.0).round();
                let fault = || Fault::Value { letter: char::from(letter), value, expected: "a code" };
                if !(0.0..10_000.0).contains(&tenths) || (value * 10.0 - tenths).abs() > 1e-3 {
                    return Err(Stop::new(column, fault()));
                }
                let word =
                    CodeWord { tenths: tenths as u16, column: column.min(usize::from(u16::MAX)) as u16 };
                let list = if letter == b'G' { &mut self.g } else { &mut self.m };
                if list.push(word) { Ok(()) } else { Err(Stop::new(column, fault())) }
            }
            _ if self.present & bit(letter) != 0 => Err(Stop::new(column, Fault::Twice(char::from(letter)))),
            _ => {
                let k = usize::from(letter - b'A');
                self.values[k] = value;
                self.columns[k] = column.min(usize::from(u16::MAX)) as u16;
                self.present |= bit(letter);
                Ok(())
            }
        }
    }

    fn assignment(&mut self, text: &mut Cursor<'_>, control: &Control, scope: Scope<'_>) -> Result<(), Stop> {
        let column = text.at();
        text.next();
        text.skip_blanks();
        let target = if text.peek() == Some(b'<') {
            Target::Name(angled(text)?)
        } else {
            Target::Number(index(operand(text, scope, 0)?.unwrap_or(0.0), column)?)
        };
        text.expect(b'=', "=")?;
        if let Target::Number(number) = target
            && !control.variables.is_settable(number)
        {
            return Err(Stop::new(column, Fault::ReadOnly(number)));
        }
        let value = if control.open_expressions { open(text, scope)? } else { operand(text, scope, 0)? };
        text.skip_blanks();
        if let Some(sign @ (b'+' | b'-' | b'*' | b'/')) = text.peek() {
            return Err(text.stop(Fault::Unbracketed(char::from(sign))));
        }
        self.assignments.push((target, value));
        Ok(())
    }
}

/// Whether a sign stands before something else than digits.
fn signed_expression(rest: &[u8]) -> bool {
    matches!(rest, [b'-' | b'+', next, ..] if !next.is_ascii_digit() && *next != b'.')
}

/// Whether a letter begins a word of control flow.
fn is_flow(text: &Cursor<'_>, letter: u8) -> bool {
    let is = |word: &[u8]| text.starts_with(word);
    match letter {
        b'I' => is(b"F[") || is(b"F ["),
        b'W' => is(b"HILE"),
        b'G' => is(b"OTO"),
        b'D' => is(b"O"),
        b'E' => is(b"ND"),
        b'T' => is(b"HEN"),
        _ => false,
    }
}

/// The character that a message shows for bytes.
fn shown(bytes: &[u8]) -> char {
    String::from_utf8_lossy(&bytes[..bytes.len().min(4)]).chars().next().unwrap_or('\u{fffd}')
}

/// The number of an N or O word at a line's start, for labels.
pub(crate) fn label(line: &[u8], letter: u8) -> Option<u32> {
    let mut text = Cursor::new(line);
    text.skip_blanks();
    if text.next()?.to_ascii_uppercase() != letter {
        return None;
    }
    text.skip_blanks();
    let digits = text.rest().iter().take_while(|b| b.is_ascii_digit()).count();
    std::str::from_utf8(&text.rest()[..digits]).ok()?.parse().ok()
}

/// A name between angle brackets, as parameters and O-words have it.
pub(crate) fn plain_name(text: &[u8]) -> String {
    name(text)
}

/// Whether a line is words of a block, one of which moves an axis; remarks left aside. No expression is
/// computed.
pub(crate) fn has_axis_words(line: &[u8]) -> bool {
    let (mut depth, mut code) = (0, Vec::new());
    for byte in line.split(|b| *b == b';').next().unwrap_or_default() {
        match byte {
            b'(' => depth += 1,
            b')' => depth -= i32::from(depth > 0),
            b if depth == 0 && !b.is_ascii_whitespace() => code.push(b.to_ascii_uppercase()),
            _ => {}
        }
    }
    let mut rest = code.strip_prefix(b"/").unwrap_or(&code);
    let (mut moves, mut words) = (false, true);
    while let [letter, behind @ ..] = rest {
        let value = |b: &u8| b.is_ascii_digit() || b"+-.#[]*".contains(b);
        let length = behind.iter().take_while(|b| value(b)).count();
        words &= letter.is_ascii_uppercase() && length > 0;
        moves |= b"XYZABCUVW".contains(letter);
        rest = &behind[length..];
    }
    words && moves
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::{GENERAL, LINUXCNC};
    use crate::expression::System;
    use crate::parameters::Parameters;

    fn read(text: &str) -> Result<Block, Stop> {
        let mut parameters = Parameters::new(33);
        parameters.set(&Target::Number(2), Some(4.0));
        let scope = Scope { parameters: &parameters, system: &|_| System::Free, logic: GENERAL.logic };
        let mut block = Block::default();
        block.read(text.as_bytes(), &GENERAL, true, scope)?;
        Ok(block)
    }

    #[test]
    fn words_stand_with_and_without_blanks() {
        for text in ["N10G1X1.5Y-2F100", "n10 g01 x 1.5 y-2. (a note) f1", "N10 G 1 X[1+.5] Y-[2] F#2"] {
            let block = read(text).unwrap();
            assert_eq!(block.g.as_slice()[0].tenths, 10);
            assert_eq!([block.peek(b'X'), block.peek(b'Y'), block.peek(b'Z')], [Some(1.5), Some(-2.0), None]);
        }
    }

    #[test]
    fn comments_deleted_lines_and_assignments() {
        let block = read("G0 (one) X1 ; two").unwrap();
        assert_eq!((block.comment, block.peek(b'X')), (Some((4, 7)), Some(1.0)));
        assert!(read("/ G0 X1").unwrap().deleted && read("/2 G0").unwrap().deleted);
        let block = read("#1=[2*3] #<a b> = -#2 + 1").unwrap();
        let expected = [(Target::Number(1), Some(6.0)), (Target::Name("ab".into()), Some(-3.0))];
        assert_eq!(block.assignments, expected);
        assert!(read("X#5 Y1").unwrap().peek(b'X').is_none(), "an empty parameter leaves its word out");
        let mut block = Block::default();
        let scope =
            Scope { parameters: &Parameters::new(33), system: &|_| System::Free, logic: LINUXCNC.logic };
        block.read(b"X#5", &LINUXCNC, true, scope).unwrap();
        assert_eq!(block.peek(b'X'), Some(0.0));
    }

    #[test]
    fn control_flow_ends_the_words() {
        for (text, at) in
            [("o100 sub", 0), ("N5 IF [#1 GT 2] GOTO 7", 3), ("WHILE[1]DO1", 0), ("END1", 0), (":12", 0)]
        {
            assert_eq!(read(text).unwrap().flow, Some(at), "{text}");
        }
        assert_eq!(read("I5 D2 W3 E4").unwrap().flow, None);
    }

    #[test]
    fn faults_have_a_column() {
        for (text, column, fault) in [
            ("G1 X1 X2", 6, Fault::Twice('X')),
            ("G1 X", 3, Fault::Number("X".into())),
            ("G1 X1 ?", 6, Fault::Character('?')),
            ("(open", 0, Fault::OpenComment),
            ("G1 HELLO", 3, Fault::Malformed("HELLO".into())),
            ("#0=1", 0, Fault::ReadOnly(0)),
            ("X--", 1, Fault::Expected("a number, #, [ or a function")),
        ] {
            let stop = read(text).unwrap_err();
            assert_eq!(*stop.fault, fault, "{text}");
            assert!(stop.column == column || text == "X--", "{text}: {}", stop.column);
        }
    }
}
