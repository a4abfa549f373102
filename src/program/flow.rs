//! Loops, branches and subprograms: the O-words of LinuxCNC, and IF GOTO WHILE M98 M97 G65 of Fanuc and Haas.

use std::collections::HashMap;

use crate::block::{CodeWord, label, plain_name};
use crate::cursor::Cursor;
use crate::error::{Fault, Stop};
use crate::expression::{Scope, System, angled, bracket};
use crate::interpret::Interpreter;
use crate::parameters::Target;

/// Subprograms that call each other.
const DEEPEST: usize = 100;

/// What comes after a block.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Next {
    /// The next line.
    Line,
    /// This line, from 0.
    At(usize),
    /// Nothing: the program is over.
    End,
}

/// What an O-word does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Word {
    Sub,
    EndSub,
    Return,
    Call,
    If,
    ElseIf,
    Else,
    EndIf,
    While,
    EndWhile,
    Do,
    Repeat,
    EndRepeat,
    Break,
    Continue,
}

const WORDS: [(&str, Word); 15] = [
    ("SUB", Word::Sub),
    ("ENDSUB", Word::EndSub),
    ("RETURN", Word::Return),
    ("CALL", Word::Call),
    ("IF", Word::If),
    ("ELSEIF", Word::ElseIf),
    ("ELSE", Word::Else),
    ("ENDIF", Word::EndIf),
    ("WHILE", Word::While),
    ("ENDWHILE", Word::EndWhile),
    ("DO", Word::Do),
    ("REPEAT", Word::Repeat),
    ("ENDREPEAT", Word::EndRepeat),
    ("BREAK", Word::Break),
    ("CONTINUE", Word::Continue),
];

/// An O-word of a line.
#[derive(Debug, Clone, PartialEq)]
struct Mark {
    line: usize,
    label: String,
    word: Word,
}

/// A subprogram at work.
#[derive(Debug)]
struct Call {
    /// Where to go on after it.
    resume: usize,
    /// Its first line.
    begin: usize,
    /// Times that it is still to run.
    left: u32,
    /// The O-word's label; empty for M98.
    label: String,
    /// Whether it has locals of its own.
    locals: bool,
    repeats: Vec<(usize, u64)>,
}

/// What runs at the moment, and where labels are.
#[derive(Debug, Default)]
pub(crate) struct Flow {
    calls: Vec<Call>,
    repeats: Vec<(usize, u64)>,
    marks: Option<Vec<Mark>>,
    /// Lines by their N and O numbers, made when first asked for.
    numbers: Option<HashMap<(u8, u32), Vec<usize>>>,
}

impl Flow {
    /// At the end of the text nothing may be open.
    pub fn check_closed(&self) -> Result<(), Stop> {
        match self.calls.last() {
            Some(call) if !call.label.is_empty() => Err(unmatched(&format!("O{} sub", call.label), "endsub")),
            Some(_) => Err(unmatched("the subprogram", "M99")),
            None => Ok(()),
        }
    }

    fn repeats(&mut self) -> &mut Vec<(usize, u64)> {
        match self.calls.last_mut() {
            Some(call) => &mut call.repeats,
            None => &mut self.repeats,
        }
    }
}

fn unmatched(found: &str, wanted: &'static str) -> Stop {
    Stop::new(0, Fault::Unmatched { found: found.to_owned(), wanted })
}

/// Reads the label and the word of an O-word; `None` for a program's number.
fn o_word(line: &[u8]) -> Option<(String, Word)> {
    let mut text = Cursor::new(line);
    text.skip_blanks();
    if matches!(text.peek(), Some(b'N' | b'n')) {
        text.next();
        text.skip_blanks();
        text.number().ok()?;
        text.skip_blanks();
    }
    if !matches!(text.next(), Some(b'O' | b'o')) {
        return None;
    }
    text.skip_blanks();
    let label = match text.peek()? {
        b'<' => angled(&mut text).ok()?,
        b'0'..=b'9' => {
            let from = text.at();
            text.number().ok()?;
            plain_name(text.since(from)).trim_start_matches('0').to_owned()
        }
        _ => return None,
    };
    text.skip_blanks();
    let word = text.letters();
    WORDS.iter().find(|(known, _)| *known == word).map(|(_, word)| (label, *word))
}

impl<'a> Interpreter<'a> {
    /// Follows the word of control flow that begins at a byte of a line.
    pub fn control_flow(&mut self, line: &'a [u8], at: usize) -> Result<Next, Stop> {
        let mut text = Cursor::new(line);
        text.advance(at);
        match text.peek().map(|b| b.to_ascii_uppercase()) {
            Some(b'O' | b':') => self.o_line(line, text),
            Some(b'I') => self.fanuc_if(line, text),
            Some(b'W') => self.fanuc_while(text),
            Some(b'G') => {
                text.advance(4);
                let target = self.operand(&mut text)?;
                self.go_to_number(target, at)
            }
            Some(b'E') => self.fanuc_end(text),
            _ => Err(text.stop(Fault::Statement(String::from_utf8_lossy(text.rest()).into_owned()))),
        }
    }

    fn system(&self, number: u32) -> System {
        self.state.system(number, &self.control.variables, self.compensation.is_some())
    }

    fn operand(&self, text: &mut Cursor<'_>) -> Result<f64, Stop> {
        let system = |number| self.system(number);
        let scope = Scope { parameters: &self.parameters, system: &system, logic: self.control.logic };
        Ok(crate::expression::operand(text, scope, 0)?.unwrap_or(0.0))
    }

    fn bracket(&self, text: &mut Cursor<'_>) -> Result<f64, Stop> {
        let system = |number| self.system(number);
        let scope = Scope { parameters: &self.parameters, system: &system, logic: self.control.logic };
        text.skip_blanks();
        Ok(bracket(text, scope, 0)?.unwrap_or(0.0))
    }

    /// `O100 …`: a word of LinuxCNC, or the number of a program.
    fn o_line(&mut self, line: &'a [u8], mut text: Cursor<'a>) -> Result<Next, Stop> {
        let column = text.at();
        let Some((label, word)) = o_word(&line[column..]) else { return self.program_number(line, text) };
        text.next();
        // Past the label and the word.
        while text.peek().is_some_and(|b| !b.is_ascii_alphabetic() && b != b'<') {
            text.next();
        }
        if text.peek() == Some(b'<') {
            angled(&mut text)?;
            text.skip_blanks();
        }
        text.letters();
        self.o_follow(&label, word, text)
    }

    /// `O1234` or `:1234` names what follows; `O[#1] CALL` is one of the words.
    fn program_number(&mut self, line: &'a [u8], mut text: Cursor<'a>) -> Result<Next, Stop> {
        let column = text.at();
        text.next();
        text.skip_blanks();
        if text.peek() == Some(b'[') || text.peek() == Some(b'#') {
            let number = self.operand(&mut text)?;
            text.skip_blanks();
            return match text.letters().as_str() {
                "CALL" => self.o_follow(&format!("{}", number.round()), Word::Call, text),
                _ => Err(Stop::new(column, Fault::Expected("call"))),
            };
        }
        if text.peek() == Some(b'<') {
            return Err(Stop::new(column, Fault::Expected("sub, call, if, while, repeat or another O-word")));
        }
        text.number()?;
        text.skip_blanks();
        match text.peek() {
            None => Ok(Next::Line),
            Some(b)
                if matches!(b, b'(' | b';')
                    || b.is_ascii_alphabetic()
                        && !text.rest().get(1).is_some_and(u8::is_ascii_alphabetic) =>
            {
                let from = text.at();
                self.step(line, from)
            }
            _ => Err(text.stop(Fault::Expected("sub, call, if, while, repeat or another O-word"))),
        }
    }

    fn o_follow(&mut self, label: &str, word: Word, mut text: Cursor<'a>) -> Result<Next, Stop> {
        let here = self.line;
        match word {
            Word::Sub => {
                let end = self.ahead(here, label, &[Word::EndSub]);
                end.map(|mark| Next::At(mark.line + 1))
                    .ok_or_else(|| unmatched(&format!("O{label} sub"), "endsub"))
            }
            Word::Call => self.o_call(label, text),
            Word::EndSub | Word::Return => {
                text.skip_blanks();
                let value = if text.peek() == Some(b'[') { Some(self.bracket(&mut text)?) } else { None };
                self.end_call(value)
            }
            Word::If | Word::ElseIf if word == Word::If => {
                let holds = self.bracket(&mut text)? != 0.0;
                if holds { Ok(Next::Line) } else { self.branch(label, here) }
            }
            // Reached from above: the branch before it is done.
            Word::ElseIf | Word::Else => {
                let end = self.ahead(here, label, &[Word::EndIf]);
                end.map(|mark| Next::At(mark.line + 1))
                    .ok_or_else(|| unmatched(&format!("O{label} else"), "endif"))
            }
            Word::EndIf | Word::Do | Word::If => Ok(Next::Line),
            Word::While => {
                let holds = self.bracket(&mut text)? != 0.0;
                match (self.opens_do(label, here), holds) {
                    (Some(begin), true) => Ok(Next::At(begin + 1)),
                    (Some(_), false) | (None, true) => Ok(Next::Line),
                    (None, false) => self.past_loop(label, here),
                }
            }
            Word::EndWhile => {
                let begin = self.behind(here, label, &[Word::While]);
                begin
                    .map(|mark| Next::At(mark.line))
                    .ok_or_else(|| unmatched(&format!("O{label} endwhile"), "while"))
            }
            Word::Repeat => {
                let times = self.bracket(&mut text)?;
                if times < 0.5 {
                    return self.past_loop(label, here);
                }
                self.flow.repeats().push((here, (times + 0.5) as u64));
                Ok(Next::Line)
            }
            Word::EndRepeat => self.end_repeat(label, here),
            Word::Break => {
                let after = self.past_loop(label, here)?;
                self.drop_repeat(label, here);
                Ok(after)
            }
            Word::Continue => {
                let ends = [Word::EndWhile, Word::EndRepeat, Word::While];
                let end = self.ahead(here, label, &ends);
                end.map(|mark| Next::At(mark.line))
                    .ok_or_else(|| unmatched(&format!("O{label} continue"), "loop"))
            }
        }
    }

    /// Past a condition that does not hold: to the next branch that does, or past the end.
    fn branch(&mut self, label: &str, from: usize) -> Result<Next, Stop> {
        let mut at = from;
        loop {
            let next = self.ahead(at, label, &[Word::ElseIf, Word::Else, Word::EndIf]);
            let Some(Mark { line, word, .. }) = next else {
                return Err(unmatched(&format!("O{label} if"), "endif"));
            };
            if word != Word::ElseIf {
                return Ok(Next::At(line + 1));
            }
            let bytes = self.lines.get(line);
            let mut text = Cursor::new(bytes);
            let begin = bytes.iter().position(|b| *b == b'[').unwrap_or(bytes.len());
            text.advance(begin);
            if self.bracket(&mut text)? != 0.0 {
                return Ok(Next::At(line + 1));
            }
            at = line;
        }
    }

    fn past_loop(&mut self, label: &str, from: usize) -> Result<Next, Stop> {
        let end = self.ahead(from, label, &[Word::EndWhile, Word::EndRepeat, Word::While]);
        end.map(|mark| Next::At(mark.line + 1))
            .ok_or_else(|| unmatched(&format!("the loop O{label}"), "endwhile or endrepeat"))
    }

    fn end_repeat(&mut self, label: &str, here: usize) -> Result<Next, Stop> {
        let Some((begin, left)) = self.flow.repeats().pop() else {
            return Err(unmatched(&format!("O{label} endrepeat"), "repeat"));
        };
        if left <= 1 {
            return Ok(Next::Line);
        }
        let opened = self.behind(here, label, &[Word::Repeat]);
        if opened.is_none_or(|mark| mark.line != begin) {
            return Err(unmatched(&format!("O{label} endrepeat"), "repeat"));
        }
        self.flow.repeats().push((begin, left - 1));
        Ok(Next::At(begin + 1))
    }

    /// Where a repeat is left, it counts no more.
    fn drop_repeat(&mut self, label: &str, here: usize) {
        let opened = self.behind(here, label, &[Word::Repeat]).map(|mark| mark.line);
        let repeats = self.flow.repeats();
        if let Some((begin, _)) = repeats.last()
            && opened == Some(*begin)
        {
            repeats.pop();
        }
    }

    /// The line of the `do` that a `while` closes.
    fn opens_do(&mut self, label: &str, here: usize) -> Option<usize> {
        let before = self.behind(here, label, &[Word::Do, Word::While, Word::EndWhile])?;
        (before.word == Word::Do).then_some(before.line)
    }

    fn marks(&mut self) -> &[Mark] {
        let lines = &self.lines;
        self.flow.marks.get_or_insert_with(|| {
            let mark = |line: usize| {
                let (label, word) = o_word(lines.get(line))?;
                Some(Mark { line, label, word })
            };
            (0..lines.len()).filter_map(mark).collect()
        })
    }

    /// The next of some words with this label after a line.
    fn ahead(&mut self, line: usize, label: &str, words: &[Word]) -> Option<Mark> {
        let marks = self.marks();
        let from = marks.partition_point(|mark| mark.line <= line);
        marks[from..].iter().find(|mark| mark.label == label && words.contains(&mark.word)).cloned()
    }

    /// The last of some words with this label before a line.
    fn behind(&mut self, line: usize, label: &str, words: &[Word]) -> Option<Mark> {
        let marks = self.marks();
        let to = marks.partition_point(|mark| mark.line < line);
        marks[..to].iter().rev().find(|mark| mark.label == label && words.contains(&mark.word)).cloned()
    }

    fn o_call(&mut self, label: &str, mut text: Cursor<'a>) -> Result<Next, Stop> {
        let mut arguments = Vec::new();
        loop {
            text.skip_blanks();
            if text.peek() != Some(b'[') || arguments.len() >= self.control.variables.locals {
                break;
            }
            arguments.push((arguments.len() + 1, self.bracket(&mut text)?));
        }
        let sub = self.marks().iter().find(|mark| mark.label == label && mark.word == Word::Sub);
        let Some(begin) = sub.map(|mark| mark.line + 1) else {
            // LinuxCNC also calls Fanuc's programs by number.
            return Err(Stop::new(0, Fault::NoTarget(format!("subprogram O{label}"))));
        };
        self.enter(begin, 1, label.to_owned(), Some(&arguments))
    }

    fn enter(
        &mut self,
        begin: usize,
        left: u32,
        label: String,
        arguments: Option<&[(usize, f64)]>,
    ) -> Result<Next, Stop> {
        if self.flow.calls.len() >= DEEPEST {
            return Err(Stop::new(0, Fault::Recursion(DEEPEST)));
        }
        if let Some(arguments) = arguments {
            self.parameters.enter(arguments);
        }
        let locals = arguments.is_some();
        self.flow.calls.push(Call { resume: self.line + 1, begin, left, label, locals, repeats: Vec::new() });
        Ok(Next::At(begin))
    }

    fn end_call(&mut self, value: Option<f64>) -> Result<Next, Stop> {
        let Some(call) = self.flow.calls.last_mut() else {
            return Err(unmatched("endsub", "call"));
        };
        call.left -= 1;
        if call.left > 0 {
            call.repeats.clear();
            return Ok(Next::At(call.begin));
        }
        let resume = call.resume;
        if call.locals {
            self.parameters.leave();
        }
        self.flow.calls.pop();
        if let Some(value) = value {
            self.parameters.set(&Target::Name("_value".to_owned()), Some(value));
        }
        Ok(Next::At(resume))
    }

    /// M98 P, M97 P, and G65 P with arguments.
    pub fn call_by_number(&mut self, word: CodeWord) -> Result<Next, Stop> {
        let Some(number) = self.block.take(b'P') else { return Err(self.missing_m(word, "P")) };
        let number = self.whole(b'P', number, 0.0..=99_999_999.0, "the number of a subprogram")?;
        let repeats = match self.block.take(b'L') {
            Some(l) => self.whole(b'L', l, 0.0..=1e6, "a number of repeats")?,
            None => 1,
        };
        let (letter, what) = if word.tenths == 970 { (b'N', "block N") } else { (b'O', "subprogram O") };
        let mut found = self.line_of(letter, number).map(|line| (line, repeats));
        // P21234 runs O1234 two times.
        if found.is_none() && letter == b'O' && self.control.repeats_in_p && number > 9999 {
            found = self.line_of(letter, number % 10_000).map(|line| (line, number / 10_000));
        }
        let Some((line, repeats)) = found else {
            let column = self.block.column(b'P');
            return Err(Stop::new(column, Fault::NoTarget(format!("{what}{number}"))));
        };
        if repeats == 0 {
            return Ok(Next::Line);
        }
        self.enter(line, repeats, String::new(), None)
    }

    /// G65 P: a subprogram with arguments by letters.
    pub fn call_macro(&mut self) -> Result<Next, Stop> {
        /// The local that each letter sets.
        const LETTERS: [(u8, usize); 21] = [
            (b'A', 1),
            (b'B', 2),
            (b'C', 3),
            (b'I', 4),
            (b'J', 5),
            (b'K', 6),
            (b'D', 7),
            (b'E', 8),
            (b'F', 9),
            (b'H', 11),
            (b'M', 13),
            (b'Q', 17),
            (b'R', 18),
            (b'S', 19),
            (b'T', 20),
            (b'U', 21),
            (b'V', 22),
            (b'W', 23),
            (b'X', 24),
            (b'Y', 25),
            (b'Z', 26),
        ];
        let Some(number) = self.block.take(b'P') else {
            return Err(Stop::new(0, Fault::Missing { code: "G65".into(), words: "P" }));
        };
        let number = self.whole(b'P', number, 0.0..=99_999_999.0, "the number of a subprogram")?;
        let repeats = self.block.take(b'L').unwrap_or(1.0);
        let repeats = self.whole(b'L', repeats, 1.0..=1e6, "a number of repeats")?;
        let words = self.block.arguments();
        let local = |letter: u8| LETTERS.iter().find(|(known, _)| *known == letter).map(|(_, k)| *k);
        let arguments: Vec<_> = words.into_iter().filter_map(|(l, x)| Some((local(l)?, x))).collect();
        let Some(line) = self.line_of(b'O', number) else {
            return Err(Stop::new(0, Fault::NoTarget(format!("subprogram O{number}"))));
        };
        self.enter(line, repeats, String::new(), Some(&arguments))
    }

    /// M99: back, or the end of the main program.
    pub fn return_from_call(&mut self) -> Result<Next, Stop> {
        if self.flow.calls.is_empty() {
            self.block.ignore(b"P");
            self.note("M99 runs the program again; one run is verified");
            return Ok(Next::End);
        }
        match self.block.take(b'P') {
            Some(number) => {
                self.end_call(None)?;
                self.go_to_number(number, self.block.column(b'P'))
            }
            None => self.end_call(None),
        }
    }

    /// The line with an N or O number: the first one after this, or else the first one.
    fn line_of(&mut self, letter: u8, number: u32) -> Option<usize> {
        let lines = &self.lines;
        let numbers = self.flow.numbers.get_or_insert_with(|| {
            let mut all: HashMap<(u8, u32), Vec<usize>> = HashMap::new();
            for line in 0..lines.len() {
                let text = lines.get(line);
                for (letter, written) in [(b'N', b'N'), (b'O', b'O'), (b'O', b':')] {
                    if let Some(number) = label(text, written) {
                        all.entry((letter, number)).or_default().push(line);
                    }
                }
            }
            all
        });
        let found = numbers.get(&(letter, number))?;
        found.iter().find(|line| **line > self.line).or(found.first()).copied()
    }

    fn go_to_number(&mut self, number: f64, column: usize) -> Result<Next, Stop> {
        let whole = number.round();
        let line =
            if (0.0..=99_999_999.0).contains(&whole) { self.line_of(b'N', whole as u32) } else { None };
        line.map(Next::At).ok_or_else(|| Stop::new(column, Fault::NoTarget(format!("block N{whole}"))))
    }

    /// `IF […] GOTO n` and `IF […] THEN …`.
    fn fanuc_if(&mut self, line: &'a [u8], mut text: Cursor<'a>) -> Result<Next, Stop> {
        text.advance(2);
        let holds = self.bracket(&mut text)? != 0.0;
        text.skip_blanks();
        if text.starts_with(b"GOTO") {
            let column = text.at();
            text.advance(4);
            let number = self.operand(&mut text)?;
            return if holds { self.go_to_number(number, column) } else { Ok(Next::Line) };
        }
        if !text.starts_with(b"THEN") {
            return Err(text.stop(Fault::Expected("GOTO or THEN")));
        }
        text.advance(4);
        if holds { self.step(line, text.at()) } else { Ok(Next::Line) }
    }

    /// `WHILE […] DO1`; without a condition it has no end.
    fn fanuc_while(&mut self, mut text: Cursor<'a>) -> Result<Next, Stop> {
        text.advance(5);
        let holds = self.bracket(&mut text)? != 0.0;
        text.skip_blanks();
        if !text.starts_with(b"DO") {
            return Err(text.stop(Fault::Expected("DO")));
        }
        text.advance(2);
        let number = self.operand(&mut text)?;
        if holds {
            return Ok(Next::Line);
        }
        let mut depth = 0;
        for line in self.line + 1..self.lines.len() {
            depth += usize::from(self.does(line, "DO", number));
            if self.does(line, "END", number) {
                if depth == 0 {
                    return Ok(Next::At(line + 1));
                }
                depth -= 1;
            }
        }
        Err(unmatched("WHILE", "END"))
    }

    fn fanuc_end(&mut self, mut text: Cursor<'a>) -> Result<Next, Stop> {
        text.advance(3);
        let number = self.operand(&mut text)?;
        let mut depth = 0;
        for line in (0..self.line).rev() {
            depth += usize::from(self.does(line, "END", number));
            if self.does(line, "DO", number) {
                if depth == 0 {
                    return Ok(Next::At(line));
                }
                depth -= 1;
            }
        }
        Err(unmatched("END", "WHILE"))
    }

    /// Whether a line begins or ends the loop of this number: `WHILE […] DO1`, `END1`.
    fn does(&self, line: usize, word: &str, number: f64) -> bool {
        let bytes = self.lines.get(line);
        let code = bytes.split(|b| matches!(b, b'(' | b';')).next().unwrap_or_default();
        let text = String::from_utf8_lossy(code).trim_start().to_ascii_uppercase();
        let wanted = match word {
            "DO" => text.starts_with("WHILE") || text.starts_with('N') && text.contains("WHILE"),
            _ => true,
        };
        let Some(at) = text.rfind(word).filter(|_| wanted) else { return false };
        text[at + word.len()..].trim().parse::<f64>() == Ok(number)
    }
}
