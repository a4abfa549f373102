//! Statements of APT: a major word, and minor words and numbers behind it.

use crate::error::{Fault, Stop};
use crate::lines::Lines;

/// Words after which all of the line is text.
const TEXT: [&str; 5] = ["PARTNO", "PPRINT", "REMARK", "INSERT", "TPRINT"];

/// Lines that one statement may be carried over.
const MOST_LINES: usize = 1000;

/// A statement: its words, and where each begins.
pub(super) struct Statement {
    pub line: usize,
    pub major: String,
    pub words: Vec<(String, usize)>,
}

/// The statement that begins in a line, and the line after it.
pub(super) fn statement(lines: &Lines<'_>, first: usize) -> Result<(Option<Statement>, usize), Stop> {
    let mut words: Vec<(String, usize)> = Vec::new();
    let mut line = first;
    let mut major = String::new();
    loop {
        let text = String::from_utf8_lossy(lines.get(line)).into_owned();
        let code = text.split("$$").next().unwrap_or_default();
        let (code, carried) = match code.trim_end().strip_suffix('$') {
            Some(code) => (code, true),
            None => (code, false),
        };
        let mut rest = code;
        let mut at = 0;
        if line == first {
            let end = code.find(['/', ',']).unwrap_or(code.len());
            let head = code[..end].trim().to_ascii_uppercase();
            let word = head.split_whitespace().next().unwrap_or_default();
            // TOOL PATH/… of NX is one word.
            major = if head.starts_with("TOOL PATH") { "TOOLPATH".to_owned() } else { word.to_owned() };
            if TEXT.contains(&word) || word.is_empty() {
                let whole = code.trim_start().get(word.len()..).unwrap_or_default().trim();
                let said = vec![(whole.trim_start_matches('/').to_owned(), 0)];
                let statement = (!word.is_empty()).then_some(Statement { line, major, words: said });
                return Ok((statement, line + 1));
            }
            at = (end + 1).min(code.len());
            rest = &code[at..];
        }
        for word in rest.split(',') {
            let trimmed = word.trim();
            if !trimmed.is_empty() {
                let column = at + word.len() - word.trim_start().len();
                words.push((trimmed.to_ascii_uppercase(), column));
            }
            at += word.len() + 1;
        }
        line += 1;
        if !carried || line >= lines.len() {
            return Ok((Some(Statement { line: first, major, words }), line));
        }
        if line - first > MOST_LINES {
            return Err(Stop::new(0, Fault::LongLine(MOST_LINES)));
        }
    }
}

impl Statement {
    /// All its numbers.
    pub fn numbers(&self) -> Vec<f64> {
        self.words.iter().filter_map(|(word, _)| number(word)).collect()
    }

    /// All its words as numbers.
    pub fn all_numbers(
        &self,
        what: &'static str,
        wanted: &'static str,
        counts: &[usize],
    ) -> Result<Vec<f64>, Stop> {
        let values: Vec<f64> = self
            .words
            .iter()
            .map(|(word, column)| {
                number(word)
                    .filter(|value| value.abs() <= geometry::MAX_COORDINATE)
                    .ok_or_else(|| Stop::new(*column, Fault::Malformed(word.clone())))
            })
            .collect::<Result<_, _>>()?;
        if counts.contains(&values.len()) {
            Ok(values)
        } else {
            Err(Stop::new(0, Fault::Count { what, wanted, found: values.len() }))
        }
    }

    /// Its words as whole numbers of codes; `None` where one is none, or there is none.
    pub fn codes(&self) -> Option<Vec<u16>> {
        let code = |(word, _): &(String, usize)| {
            number(word)
                .filter(|code| code.fract() == 0.0 && (0.0..1000.0).contains(code))
                .map(|code| code as u16)
        };
        self.words.iter().map(code).collect::<Option<Vec<u16>>>().filter(|codes| !codes.is_empty())
    }

    /// Whether it turns by no angle, or is switched off.
    pub fn turns_nothing(&self) -> bool {
        let angles = self.numbers();
        self.has("OFF") || !angles.is_empty() && angles.iter().all(|angle| *angle == 0.0)
    }

    pub fn has(&self, word: &str) -> bool {
        self.words.iter().any(|(other, _)| other == word)
    }

    pub fn text(&self) -> String {
        let words: Vec<&str> = self.words.iter().map(|(word, _)| word.as_str()).collect();
        format!("{}/{}", self.major, words.join(","))
    }
}

pub(super) fn not_understood(statement: &Statement) -> Stop {
    Stop::new(0, Fault::Statement(statement.text()))
}

/// A number of APT; exponents are written with E or D.
fn number(word: &str) -> Option<f64> {
    let plain = word.replace('D', "E");
    let digits = plain.starts_with(|c: char| c.is_ascii_digit() || matches!(c, '-' | '+' | '.'));
    plain.parse::<f64>().ok().filter(|value| digits && value.is_finite())
}
