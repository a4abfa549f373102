//! Typed access to one table of a scene. Every refusal names the place and the cure.

use std::ops::{Range, RangeInclusive};

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::error::{SceneError, SceneText, suggestion};
use geometry::Point2;

/// A value and where it stands in the text.
#[derive(Debug, Clone, PartialEq)]
pub struct Located<T> {
    /// The value.
    pub value: T,
    /// Bytes of the text.
    pub span: Range<usize>,
}

/// One table of a scene, the text it stands in and what messages call it.
#[derive(Debug, Clone)]
pub struct Section<'a> {
    source: &'a SceneText,
    /// As the user would write it: `[cutter]`.
    title: String,
    /// Where its header stands; errors about missing keys point there.
    span: Range<usize>,
    table: Option<&'a DeTable<'a>>,
}

/// What a refused value is called: `a string`, `a whole number`, …
fn kind(value: &DeValue<'_>) -> &'static str {
    match value {
        DeValue::String(_) => "a string",
        DeValue::Integer(_) => "a whole number",
        DeValue::Float(_) => "a number",
        DeValue::Boolean(_) => "true or false",
        DeValue::Datetime(_) => "a date",
        DeValue::Array(_) => "a list",
        DeValue::Table(_) => "a table",
    }
}

/// A number as messages spell it: with a power of ten where it would fill the line.
fn in_few_digits(value: f64) -> String {
    let is_long = value != 0.0 && !(1e-7..1e16).contains(&value.abs());
    if is_long && value.is_finite() { format!("{value:e}") } else { value.to_string() }
}

/// `a number in mm (1e-6 to 10000)`; a unit in brackets says what it is, and stands behind the range.
fn number_in(noun: &str, range: &RangeInclusive<f64>, unit: &str) -> String {
    // Digits that can be counted at a glance, or an exponent.
    let shown = |x: f64| {
        let long = x != 0.0 && !(1e-3..1e7).contains(&x.abs());
        if long { format!("{x:e}") } else { x.to_string() }
    };
    let limits = format!("{} to {}", shown(*range.start()), shown(*range.end()));
    match unit.trim_start().strip_prefix('(').and_then(|what| what.strip_suffix(')')) {
        Some(what) => format!("{noun} ({limits}, {what})"),
        None if unit.is_empty() => format!("{noun} ({limits})"),
        None => format!("{noun} in{unit} ({limits})"),
    }
}

fn as_number(value: &DeValue<'_>) -> Option<f64> {
    match value {
        DeValue::Integer(n) => i64::from_str_radix(n.as_str(), n.radix()).ok().map(|n| n as f64),
        // TOML writes 1_000.5; the crate hands the digits over without underscores.
        DeValue::Float(x) => x.as_str().parse().ok(),
        _ => None,
    }
}

impl<'a> Section<'a> {
    /// The whole scene.
    pub fn root(source: &'a SceneText, table: &'a DeTable<'a>) -> Self {
        Self::whole(source, table, "the scene")
    }

    /// A whole text that messages call `title`.
    pub fn whole(source: &'a SceneText, table: &'a DeTable<'a>, title: &str) -> Self {
        Self { source, title: title.to_owned(), span: 0..0, table: Some(table) }
    }

    /// An error at a place of this scene.
    pub fn error(
        &self,
        span: &Range<usize>,
        message: impl Into<String>,
        cure: impl Into<String>,
    ) -> SceneError {
        self.source.error(span.clone(), message, cure)
    }

    /// An error at the name of a key (at the header if it is not there).
    pub fn key_error(&self, key: &str, message: impl Into<String>, cure: impl Into<String>) -> SceneError {
        self.error(&self.key_span(key), message, cure)
    }

    /// Where the section's header stands.
    pub fn header(&self) -> &Range<usize> {
        &self.span
    }

    fn entry(&self, key: &str) -> Option<&'a Spanned<DeValue<'a>>> {
        self.table?.get(key)
    }

    /// True when the key is there.
    pub fn has(&self, key: &str) -> bool {
        self.entry(key).is_some()
    }

    /// True when the key's value is a string.
    pub fn is_text(&self, key: &str) -> bool {
        self.entry(key).is_some_and(|entry| matches!(entry.get_ref(), DeValue::String(_)))
    }

    /// True when the key's value is a list.
    pub fn is_list(&self, key: &str) -> bool {
        self.entry(key).is_some_and(|entry| matches!(entry.get_ref(), DeValue::Array(_)))
    }

    /// Where the name of a key stands (the header if it is not there).
    pub fn key_span(&self, key: &str) -> Range<usize> {
        let found = self.table.and_then(|t| t.iter().find(|(k, _)| k.get_ref() == key));
        found.map_or(self.span.clone(), |(k, _)| k.span())
    }

    /// Refuses every key but `allowed`. `elsewhere` are keys that exist but do not apply to `what`
    /// (such as `surface = "plane"`).
    pub fn only(&self, allowed: &[&str], elsewhere: &[&str], what: &str) -> Result<(), SceneError> {
        let unknown = self.table.into_iter().flat_map(DeTable::iter).map(|(key, _)| key);
        // In the order of the text, so that the first mistake is told first.
        let first =
            unknown.filter(|key| !allowed.contains(&&**key.get_ref())).min_by_key(|key| key.span().start);
        let Some(key) = first else { return Ok(()) };
        let name: &str = key.get_ref();
        let message = if elsewhere.contains(&name) {
            format!("the key `{name}` does not apply to {what}")
        } else {
            format!("unknown key `{name}` in {}", self.title)
        };
        Err(self.error(&key.span(), message, suggestion(name, allowed)))
    }

    /// The table under `key`; an empty one when it is not there.
    pub fn section(&self, key: &str) -> Result<Section<'a>, SceneError> {
        let title = self.title_of(key);
        let (source, span) = (self.source, self.key_span(key));
        let Some(entry) = self.entry(key) else {
            return Ok(Section { source, title, span: 0..0, table: None });
        };
        match entry.get_ref() {
            DeValue::Table(table) => Ok(Section { source, title, span, table: Some(table) }),
            _ => Err(self.wrong_type(key, "a table", entry, &format!("write a header `[{key}]`"))),
        }
    }

    /// What messages call the table under `key`: `[cutter]`, `[toolpath.cutter] of [[toolpath]] number 2`.
    fn title_of(&self, key: &str) -> String {
        let list = self.title.strip_prefix("[[").and_then(|rest| rest.split_once("]]"));
        match list {
            Some((name, _)) => format!("[{name}.{key}] of {}", self.title),
            None => format!("[{key}]"),
        }
    }

    /// The tables under `[[key]]`, in order.
    pub fn sections(&self, key: &str) -> Result<Vec<Section<'a>>, SceneError> {
        let cure = format!("write `[[{key}]]` with two brackets, once for each");
        let Some(entry) = self.entry(key) else { return Ok(Vec::new()) };
        let DeValue::Array(list) = entry.get_ref() else {
            return Err(self.wrong_type(key, "a list of tables", entry, &cure));
        };
        let one = |(k, item): (usize, &'a Spanned<DeValue<'a>>)| match item.get_ref() {
            DeValue::Table(table) => Ok(Section {
                source: self.source,
                title: format!("[[{key}]] number {}", k + 1),
                span: item.span(),
                table: Some(table),
            }),
            other => {
                let message = format!("`{key}`: expected tables, found {}", kind(other));
                Err(self.error(&item.span(), message, cure.clone()))
            }
        };
        list.iter().enumerate().map(one).collect()
    }

    fn wrong_type(&self, key: &str, expected: &str, found: &Spanned<DeValue<'_>>, cure: &str) -> SceneError {
        self.error(
            &found.span(),
            format!("`{key}` in {}: expected {expected}, found {}", self.title, kind(found.get_ref())),
            cure,
        )
    }

    fn missing(&self, key: &str, example: &str) -> SceneError {
        let (message, cure) = if self.table.is_none() {
            (
                format!("the scene has no {}", self.title),
                format!("add a table {} with `{key} = {example}`", self.title),
            )
        } else {
            (format!("{} has no `{key}`", self.title), format!("add `{key} = {example}`"))
        };
        self.error(&self.span, message, cure)
    }

    /// A string that is not empty and has no control characters: it is printed, and stands in programs.
    pub fn text(&self, key: &str) -> Result<Option<Located<&'a str>>, SceneError> {
        let Some(entry) = self.entry(key) else { return Ok(None) };
        match entry.get_ref() {
            DeValue::String(text) if text.trim().is_empty() => Err(self.error(
                &entry.span(),
                format!("`{key}` is empty"),
                "write something between the quotes",
            )),
            DeValue::String(text) if text.contains(char::is_control) => Err(self.error(
                &entry.span(),
                format!("`{key}` has a line break or another control character in it"),
                "write it in one line of letters",
            )),
            DeValue::String(text) => Ok(Some(Located { value: text, span: entry.span() })),
            _ => Err(self.wrong_type(key, "a string", entry, "write it between double quotes")),
        }
    }

    /// A string that must be there.
    pub fn required_text(&self, key: &str, example: &str) -> Result<Located<&'a str>, SceneError> {
        self.text(key)?.ok_or_else(|| self.missing(key, &format!("\"{example}\"")))
    }

    /// One word of a list.
    pub fn word(
        &self,
        key: &str,
        words: &[&'static str],
    ) -> Result<Option<Located<&'static str>>, SceneError> {
        let Some(text) = self.text(key)? else { return Ok(None) };
        match words.iter().find(|word| **word == text.value) {
            Some(word) => Ok(Some(Located { value: word, span: text.span })),
            None => {
                let message = format!("`{key}` in {} cannot be \"{}\"", self.title, text.value);
                Err(self.error(&text.span, message, suggestion(text.value, words)))
            }
        }
    }

    /// One word of a list, which must be there.
    pub fn required_word(
        &self,
        key: &str,
        words: &[&'static str],
    ) -> Result<Located<&'static str>, SceneError> {
        self.word(key, words)?.ok_or_else(|| self.missing(key, &format!("\"{}\"", words[0])))
    }

    /// The value that a word stands for; the first one without the key.
    pub fn choice<T: Copy>(&self, key: &str, values: &[(&'static str, T)]) -> Result<T, SceneError> {
        let words: Vec<&'static str> = values.iter().map(|(word, _)| *word).collect();
        let word = self.word(key, &words)?.map_or(words[0], |word| word.value);
        Ok(values.iter().find(|(other, _)| *other == word).unwrap_or(&values[0]).1)
    }

    /// A length, or `None` for that word or nothing.
    pub fn length_or_word(&self, key: &str, word: &'static str) -> Result<Option<f64>, SceneError> {
        if self.is_text(key) {
            return self.word(key, &[word]).map(|_| None);
        }
        Ok(self.length(key)?.map(|length| length.value))
    }

    /// `true` or `false`.
    pub fn flag(&self, key: &str) -> Result<Option<bool>, SceneError> {
        let Some(entry) = self.entry(key) else { return Ok(None) };
        match entry.get_ref() {
            DeValue::Boolean(value) => Ok(Some(*value)),
            _ => Err(self.wrong_type(key, "true or false", entry, "write true or false without quotes")),
        }
    }

    /// A finite number within `range`; `unit` stands after a number, with the space before it: ` mm`.
    pub fn number(
        &self,
        key: &str,
        range: RangeInclusive<f64>,
        unit: &str,
    ) -> Result<Option<Located<f64>>, SceneError> {
        let Some(entry) = self.entry(key) else { return Ok(None) };
        self.in_range(key, entry, &range, ["a number", unit]).map(Some)
    }

    /// As [`Self::number`], with a value for where the key is not there.
    pub fn number_or(
        &self,
        key: &str,
        range: RangeInclusive<f64>,
        unit: &str,
        default: f64,
    ) -> Result<f64, SceneError> {
        Ok(self.number(key, range, unit)?.map_or(default, |number| number.value))
    }

    fn in_range(
        &self,
        key: &str,
        entry: &Spanned<DeValue<'a>>,
        range: &RangeInclusive<f64>,
        [noun, unit]: [&str; 2],
    ) -> Result<Located<f64>, SceneError> {
        let expected = number_in(noun, range, unit);
        let Some(value) = as_number(entry.get_ref()) else {
            return Err(self.wrong_type(key, &expected, entry, "write digits without quotes or unit"));
        };
        // NaN and infinities, which TOML can write, lie in no range.
        if !range.contains(&value) {
            let message =
                format!("`{key}` in {} is {}; expected {expected}", self.title, in_few_digits(value));
            return Err(self.error(&entry.span(), message, format!("write {expected}")));
        }
        Ok(Located { value, span: entry.span() })
    }

    /// A positive length, mm.
    pub fn length(&self, key: &str) -> Result<Option<Located<f64>>, SceneError> {
        self.number(key, LENGTH, " mm")
    }

    /// As [`Self::length`], with a value for where the key is not there.
    pub fn length_or(&self, key: &str, default: f64) -> Result<f64, SceneError> {
        self.number_or(key, LENGTH, " mm", default)
    }

    /// Positive lengths, mm, as `[0.4, 0.2]`; none when the key is not there.
    pub fn lengths(&self, key: &str) -> Result<Vec<f64>, SceneError> {
        self.numbers(key, &LENGTH, " mm")
    }

    /// Finite numbers within `range`, as `[0.4, 0.2]`; none when the key is not there. `unit` as in
    /// [`Self::number`].
    pub fn numbers(
        &self,
        key: &str,
        range: &RangeInclusive<f64>,
        unit: &str,
    ) -> Result<Vec<f64>, SceneError> {
        let Some(entry) = self.entry(key) else { return Ok(Vec::new()) };
        let DeValue::Array(list) = entry.get_ref() else {
            let cure =
                format!("write `[0.4, 0.2]`{}", if unit.is_empty() { "" } else { ", without the unit" });
            return Err(self.wrong_type(key, "a list of numbers", entry, &cure));
        };
        list.iter().map(|item| Ok(self.in_range(key, item, range, ["a number", unit])?.value)).collect()
    }

    /// A positive length, mm, that must be there.
    pub fn required_length(&self, key: &str, example: f64) -> Result<Located<f64>, SceneError> {
        self.length(key)?.ok_or_else(|| self.missing(key, &format!("{example:?}")))
    }

    /// A number that must be there.
    pub fn required_number(
        &self,
        key: &str,
        range: RangeInclusive<f64>,
        unit: &str,
        example: f64,
    ) -> Result<Located<f64>, SceneError> {
        self.number(key, range, unit)?.ok_or_else(|| self.missing(key, &format!("{example:?}")))
    }

    /// A whole number within `range`.
    pub fn count(&self, key: &str, range: RangeInclusive<u32>) -> Result<Option<u32>, SceneError> {
        let limits = f64::from(*range.start())..=f64::from(*range.end());
        let Some(entry) = self.entry(key) else { return Ok(None) };
        let number = self.in_range(key, entry, &limits, ["a whole number", ""])?;
        if number.value.fract() != 0.0 {
            let message = format!("`{key}` in {} is {}; expected a whole number", self.title, number.value);
            return Err(self.error(&number.span, message, format!("write {}", number.value.round())));
        }
        Ok(Some(number.value as u32))
    }

    /// `[from, to]` with `from < to`, which must be there.
    pub fn required_interval(&self, key: &str) -> Result<[f64; 2], SceneError> {
        self.interval(key, COORDINATE, " mm")?.ok_or_else(|| self.missing(key, &format!("{USUAL:?}")))
    }

    /// `[from, to]` with `from < to` within `range`; `None` when the key is not there.
    pub fn interval(
        &self,
        key: &str,
        range: RangeInclusive<f64>,
        unit: &str,
    ) -> Result<Option<[f64; 2]>, SceneError> {
        let Some(entry) = self.entry(key) else { return Ok(None) };
        let [from, to] = [range.start().max(USUAL[0]), range.end().min(USUAL[1])];
        let cure = format!("write two numbers, the lesser first, such as `{key} = [{from:.1}, {to:.1}]`");
        let DeValue::Array(list) = entry.get_ref() else {
            return Err(self.wrong_type(key, "a list of two numbers", entry, &cure));
        };
        let numbers: Vec<f64> = list
            .iter()
            .map(|item| Ok(self.in_range(key, item, &range, ["a number", unit])?.value))
            .collect::<Result<_, _>>()?;
        match numbers[..] {
            [from, to] if from < to => Ok(Some([from, to])),
            _ => Err(self.error(
                &entry.span(),
                format!("`{key}` in {} must run from a lesser to a greater number", self.title),
                cure,
            )),
        }
    }

    /// Points of a closed curve, `[[x, y], ...]`, mm, which must be there.
    pub fn points(&self, key: &str) -> Result<Located<Vec<Point2>>, SceneError> {
        let entry =
            self.entry(key).ok_or_else(|| self.missing(key, "[[0, 0], [60, 0], [60, 40], [0, 40]]"))?;
        self.point_list(key, entry)
    }

    /// Several curves, `[[[x, y], ...], ...]`, mm; none when the key is not there.
    pub fn curves(&self, key: &str) -> Result<Vec<Located<Vec<Point2>>>, SceneError> {
        let Some(entry) = self.entry(key) else { return Ok(Vec::new()) };
        let DeValue::Array(list) = entry.get_ref() else {
            let cure = format!("write a list of lists of points: `{key} = [[[x, y], ...], ...]`");
            return Err(self.wrong_type(key, "a list of curves", entry, &cure));
        };
        list.iter().map(|curve| self.point_list(key, curve)).collect()
    }

    fn point_list(
        &self,
        key: &str,
        entry: &Spanned<DeValue<'a>>,
    ) -> Result<Located<Vec<Point2>>, SceneError> {
        let rows = self.row_list(
            key,
            entry,
            "points of two numbers",
            "write points as `[x, y]`, between brackets and commas",
        )?;
        Ok(Located { value: rows.value.into_iter().map(Point2::from).collect(), span: rows.span })
    }

    /// Rows of as many numbers, `[[…], …]`, none of them beyond what coordinates may be; `None` when the key
    /// is not there. `what` completes the sentence "expected …".
    pub fn rows<const N: usize>(
        &self,
        key: &str,
        what: &str,
        cure: &str,
    ) -> Result<Option<Located<Vec<[f64; N]>>>, SceneError> {
        self.entry(key).map(|entry| self.row_list(key, entry, what, cure)).transpose()
    }

    fn row_list<const N: usize>(
        &self,
        key: &str,
        entry: &Spanned<DeValue<'a>>,
        what: &str,
        cure: &str,
    ) -> Result<Located<Vec<[f64; N]>>, SceneError> {
        let DeValue::Array(list) = entry.get_ref() else {
            return Err(self.wrong_type(key, &format!("a list of {what}"), entry, cure));
        };
        let value = list.iter().map(|item| self.row(key, item, what, cure)).collect::<Result<_, _>>()?;
        Ok(Located { value, span: entry.span() })
    }

    fn row<const N: usize>(
        &self,
        key: &str,
        item: &Spanned<DeValue<'a>>,
        what: &str,
        cure: &str,
    ) -> Result<[f64; N], SceneError> {
        let wrong = || self.wrong_type(key, what, item, cure);
        let DeValue::Array(numbers) = item.get_ref() else { return Err(wrong()) };
        let row: Vec<f64> = numbers
            .iter()
            .map(|number| Ok(self.in_range(key, number, &COORDINATE, ["a number", ""])?.value))
            .collect::<Result<_, SceneError>>()?;
        <[f64; N]>::try_from(row).map_err(|_| wrong())
    }

    /// A vector `[x, y, z]`; `None` when the key is not there.
    pub fn vector(&self, key: &str) -> Result<Option<Located<[f64; 3]>>, SceneError> {
        let Some(entry) = self.entry(key) else { return Ok(None) };
        let value = self.row(key, entry, "a list of three numbers", "write three numbers: `[0, 0.5, 1]`")?;
        Ok(Some(Located { value, span: entry.span() }))
    }

    /// Two numbers `[x, y]`; `None` when the key is not there.
    pub fn pair(&self, key: &str, cure: &str) -> Result<Option<[f64; 2]>, SceneError> {
        self.entry(key).map(|entry| self.row(key, entry, "a list of two numbers", cure)).transpose()
    }

    /// The table written in place as the value of `key`, if it is one.
    pub fn inline(&self, key: &str) -> Option<Section<'a>> {
        let entry = self.entry(key)?;
        let table = entry.get_ref().as_table()?;
        let title = format!("`{key}` of {}", self.title);
        Some(Section { source: self.source, title, span: entry.span(), table: Some(table) })
    }
}

/// An interval as messages show it, as far as a key allows.
const USUAL: [f64; 2] = [0.0, 100.0];

/// Lengths that make sense, mm: below a nanometre f64 geometry at a metre's distance is noise.
pub const LENGTH: RangeInclusive<f64> = 1e-6..=1e4;

/// Coordinates that make sense, mm.
pub const COORDINATE: RangeInclusive<f64> = -geometry::MAX_COORDINATE..=geometry::MAX_COORDINATE;
