//! Tables of points: see [`section_table`](super).

use super::UNITS;
use blade::sections::{LeadingEnd, Outline, Section, SectionCurve, SectionError, Sections};
use geometry::{MAX_COORDINATE, Point2};
use keys::{listed, nearest};

/// z of a point may differ from its section's height by this share of the height (of a mm near 0): what files
/// with seven digits leave.
const PLANE: f64 = 1e-6;

/// Ends of the leading edge, as tables write them.
pub(super) const LEADING: [(&str, LeadingEnd); 4] = [
    ("-x", LeadingEnd::MinusX),
    ("+x", LeadingEnd::PlusX),
    ("-y", LeadingEnd::MinusY),
    ("+y", LeadingEnd::PlusY),
];

/// Words that begin a line.
const WORDS: [&str; 6] = ["unit", "leading", "section", "closed", "pressure", "suction"];

/// What is wrong with a table, and where.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("line {line}, column {column}: {message}")]
pub struct SectionTableError {
    /// Line, from 1; the last one where something is missing.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
    /// What was found and what would help.
    pub message: String,
}

/// Reads the sections of a table.
///
/// # Errors
/// [`SectionTableError`].
pub fn parse_table(bytes: &[u8]) -> Result<Sections, SectionTableError> {
    let text = std::str::from_utf8(bytes).map_err(|e| not_text(bytes, e.valid_up_to()))?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut table = Table::default();
    for (k, line) in text.lines().enumerate() {
        table.line = k + 1;
        let fields = fields(line.split('#').next().unwrap_or(""));
        if let Some((first, rest)) = fields.split_first() {
            let read = if begins_a_word(first.text) { table.word(first, rest) } else { table.row(&fields) };
            read.map_err(|(column, message)| SectionTableError { line: k + 1, column, message })?;
        }
    }
    table.finish()
}

/// An error about bytes that are no text.
pub(super) fn not_text(bytes: &[u8], valid: usize) -> SectionTableError {
    let before = String::from_utf8_lossy(bytes.get(..valid).unwrap_or_default());
    let line = 1 + before.matches('\n').count();
    let column = 1 + before.rsplit('\n').next().map_or(0, |last| last.chars().count());
    SectionTableError { line, column, message: "this is not text; save the table as plain text".into() }
}

/// A word or number of a line, and its column.
#[derive(Debug, Clone, Copy)]
struct Field<'a> {
    text: &'a str,
    column: usize,
}

/// What is wrong in a line, with its column.
type InLine = (usize, String);

fn fields(content: &str) -> Vec<Field<'_>> {
    let between = |c: char| c.is_whitespace() || c == ',' || c == ';';
    let mut found = Vec::new();
    let (mut start, mut from) = (None, 1);
    for (column, (at, c)) in (1..).zip(content.char_indices()) {
        match (start, between(c)) {
            (None, false) => (start, from) = (Some(at), column),
            (Some(s), true) => {
                found.extend(content.get(s..at).map(|text| Field { text, column: from }));
                start = None;
            }
            _ => {}
        }
    }
    found.extend(start.and_then(|s| content.get(s..)).map(|text| Field { text, column: from }));
    found
}

/// Whether a field is meant as a word: it begins with a letter and is none of the numbers that do.
fn begins_a_word(text: &str) -> bool {
    text.starts_with(char::is_alphabetic) && text.parse::<f64>().is_err()
}

/// A piece of the file as messages show it.
fn quoted(text: &str) -> String {
    /// In characters.
    const LONGEST: usize = 30;
    let printable = |c: char| if c.is_control() { char::REPLACEMENT_CHARACTER } else { c };
    let mut shown: String = text.chars().take(LONGEST).map(printable).collect();
    if text.chars().nth(LONGEST).is_some() {
        shown.push('…');
    }
    format!("\"{shown}\"")
}

/// `did you mean …?` where a word is near.
fn instead(wrong: &str, words: &[&str]) -> String {
    match nearest(wrong, words) {
        Some(word) => format!("did you mean `{word}`? (valid here: {})", listed(words)),
        None => format!("valid here: {}", listed(words)),
    }
}

fn number(field: &Field<'_>) -> Result<f64, InLine> {
    let value: f64 =
        field.text.parse().map_err(|_| (field.column, format!("{} is no number", quoted(field.text))))?;
    if value.is_finite() {
        Ok(value)
    } else {
        Err((field.column, format!("{} is no finite number", quoted(field.text))))
    }
}

/// What to say of a line with neither two nor three numbers.
fn wrong_count(found: usize) -> String {
    let stand = if found == 1 { "1 number stands".to_owned() } else { format!("{found} numbers stand") };
    format!("{stand} here, and a point has 2, x and y, or 3 with z")
}

/// A curve as it was written.
#[derive(Debug)]
struct Curve {
    kind: SectionCurve,
    line: usize,
    points: Vec<Point2>,
    /// Line of each point.
    lines: Vec<usize>,
}

/// A section as it was written.
#[derive(Debug)]
struct Written {
    /// mm.
    height: f64,
    line: usize,
    curves: Vec<Curve>,
}

/// What was read so far.
#[derive(Debug, Default)]
struct Table {
    /// The line that is read, from 1.
    line: usize,
    /// Its word, and one in mm.
    unit: Option<(&'static str, f64)>,
    leading: Option<LeadingEnd>,
    sections: Vec<Written>,
}

impl Table {
    fn scale(&self) -> f64 {
        self.unit.map_or(1.0, |(_, scale)| scale)
    }

    /// A line that begins with a word.
    fn word(&mut self, first: &Field<'_>, rest: &[Field<'_>]) -> Result<(), InLine> {
        let word = first.text.to_lowercase();
        match (word.as_str(), rest) {
            ("unit", [unit]) => self.set_unit(first, unit),
            ("unit", _) => {
                Err((first.column, format!("write `unit` and one of {}", listed(&UNITS.map(|u| u.0)))))
            }
            ("leading", [end]) => self.set_leading(first, end),
            ("leading", _) => {
                Err((first.column, format!("write `leading` and one of {}", listed(&LEADING.map(|l| l.0)))))
            }
            ("section", [height]) => self.begin_section(height),
            ("section", _) => Err((first.column, "write `section` and its height, one number".into())),
            ("closed" | "pressure" | "suction", []) => self.begin_curve(first, &word),
            ("closed" | "pressure" | "suction", [after, ..]) => Err((
                after.column,
                format!("nothing may follow `{word}`; write points on the lines below, x and y on each"),
            )),
            _ => Err((
                first.column,
                format!("{} begins nothing here; {}", quoted(first.text), instead(&word, &WORDS)),
            )),
        }
    }

    /// `unit` and `leading` stand above all sections.
    fn above_sections(&self, word: &Field<'_>) -> Result<(), InLine> {
        match self.sections.first() {
            None => Ok(()),
            Some(_) => {
                let message = format!("{} must stand above the first section", quoted(word.text));
                Err((word.column, message))
            }
        }
    }

    fn set_unit(&mut self, word: &Field<'_>, unit: &Field<'_>) -> Result<(), InLine> {
        self.above_sections(word)?;
        if let Some((before, _)) = self.unit {
            return Err((word.column, format!("the unit was given above ({before}); a table has one")));
        }
        let lower = unit.text.to_lowercase();
        // What people write besides.
        let name = match lower.as_str() {
            "in" | "inches" | "\"" => "inch",
            "µm" | "μm" | "micron" => "um",
            other => other,
        };
        self.unit = UNITS.iter().find(|(known, _)| *known == name).copied();
        if self.unit.is_none() {
            let message =
                format!("{} is no unit; {}", quoted(unit.text), instead(&lower, &UNITS.map(|u| u.0)));
            return Err((unit.column, message));
        }
        Ok(())
    }

    fn set_leading(&mut self, word: &Field<'_>, end: &Field<'_>) -> Result<(), InLine> {
        self.above_sections(word)?;
        if self.leading.is_some() {
            return Err((word.column, "which end leads was given above; delete one of the lines".into()));
        }
        let lower = end.text.to_lowercase();
        self.leading = LEADING.iter().find(|(known, _)| *known == lower).map(|(_, end)| *end);
        if self.leading.is_none() {
            let message = format!(
                "{} is no end of a section; write one of {}",
                quoted(end.text),
                listed(&LEADING.map(|l| l.0))
            );
            return Err((end.column, message));
        }
        Ok(())
    }

    fn begin_section(&mut self, height: &Field<'_>) -> Result<(), InLine> {
        let value = number(height)? * self.scale();
        if value.abs() > MAX_COORDINATE {
            return Err((
                height.column,
                format!("the height is {value} mm; it must be within ±1e6 mm: check its unit"),
            ));
        }
        self.check_last()?;
        self.sections.push(Written { height: value, line: self.line, curves: Vec::new() });
        Ok(())
    }

    /// The section before the one that begins must be whole.
    fn check_last(&self) -> Result<(), InLine> {
        let Some(last) = self.sections.last() else { return Ok(()) };
        let kinds: Vec<SectionCurve> = last.curves.iter().map(|c| c.kind).collect();
        let missing = match kinds[..] {
            [] => "`closed`, or `pressure` and `suction`, and points",
            [SectionCurve::Pressure] => "`suction` and its points",
            [SectionCurve::Suction] => "`pressure` and its points",
            _ => return Ok(()),
        };
        Err((1, format!("the section in line {} lacks {missing}", last.line)))
    }

    fn begin_curve(&mut self, word: &Field<'_>, name: &str) -> Result<(), InLine> {
        let kind = match name {
            "closed" => SectionCurve::Outline,
            "pressure" => SectionCurve::Pressure,
            _ => SectionCurve::Suction,
        };
        let Some(section) = self.sections.last_mut() else {
            return Err((
                word.column,
                format!("`{name}` belongs to a section; write `section` and a height above it"),
            ));
        };
        let clash = section
            .curves
            .iter()
            .find(|c| c.kind == kind || c.kind == SectionCurve::Outline || kind == SectionCurve::Outline);
        if let Some(before) = clash {
            let message = format!(
                "the section has a curve in line {} already; a section has one `closed`, or one `pressure` and \
                 one `suction`: begin the next one with `section` and its height",
                before.line
            );
            return Err((word.column, message));
        }
        section.curves.push(Curve { kind, line: self.line, points: Vec::new(), lines: Vec::new() });
        Ok(())
    }

    /// A line of numbers.
    fn row(&mut self, fields: &[Field<'_>]) -> Result<(), InLine> {
        let (line, scale) = (self.line, self.scale());
        let column = fields.first().map_or(1, |f| f.column);
        let curve = self.sections.last_mut().and_then(|s| Some((s.height, s.curves.last_mut()?)));
        let Some((height, curve)) = curve else {
            let cure =
                "write `section` and its height, and `closed`, `pressure` or `suction`, above the points";
            let first = fields.first().map_or("", |f| f.text);
            return Err((column, format!("{} belongs to no curve; {cure}", quoted(first))));
        };
        let numbers = fields.iter().map(number).collect::<Result<Vec<f64>, _>>()?;
        let (x, y, z) = match numbers[..] {
            [x, y] => (x, y, None),
            [x, y, z] => (x, y, Some(z)),
            _ => return Err((column, wrong_count(numbers.len()))),
        };
        let (x, y) = (x * scale, y * scale);
        if x.abs().max(y.abs()) > MAX_COORDINATE {
            return Err((
                column,
                format!("the point ({x}, {y}) mm is farther than a kilometre; check its unit"),
            ));
        }
        if let Some(z) = z.map(|z| z * scale)
            && (z - height).abs() > PLANE * height.abs().max(1.0)
        {
            let message = format!(
                "z is {z} mm, and the section's height is {height} mm; sections must be plane, at one \
                 height: cut the blade by planes of constant z, or correct the height"
            );
            return Err((fields.get(2).map_or(column, |f| f.column), message));
        }
        curve.points.push(Point2::new(x, y));
        curve.lines.push(line);
        Ok(())
    }

    /// The sections, if they fit together.
    fn finish(mut self) -> Result<Sections, SectionTableError> {
        let last = self.line.max(1);
        let at = |line, message: String| SectionTableError { line, column: 1, message };
        self.check_last().map_err(|(_, message)| at(last, message))?;
        if self.sections.is_empty() {
            let message = "the table has no section; write `section` and its height, `closed`, and points";
            return Err(at(last, message.to_owned()));
        }
        let sections = self.sections.iter_mut().map(Written::section).collect();
        match Sections::new(sections) {
            Ok(sections) => Ok(sections.with_leading(self.leading)),
            Err(error) => Err(at(self.line_of(&error).unwrap_or(last), error.to_string())),
        }
    }

    /// The line that an error is about.
    fn line_of(&self, error: &SectionError) -> Option<usize> {
        let place = error.place()?;
        let section = self.sections.get(place.section)?;
        let point = place.point.and_then(|(kind, point)| {
            let curve = section.curves.iter().find(|c| c.kind == kind)?;
            curve.lines.get(point).copied()
        });
        Some(point.unwrap_or(section.line))
    }
}

impl Written {
    fn section(&mut self) -> Section {
        let mut taken = |kind| {
            let curve = self.curves.iter_mut().find(|c| c.kind == kind);
            curve.map(|c| std::mem::take(&mut c.points))
        };
        let outline = match taken(SectionCurve::Outline) {
            Some(points) => Outline::Closed(points),
            None => Outline::Sides {
                pressure: taken(SectionCurve::Pressure).unwrap_or_default(),
                suction: taken(SectionCurve::Suction).unwrap_or_default(),
            },
        };
        Section { height: self.height, outline }
    }
}
