//! Feed directions as a table: what measurements and other programs give.
//!
//! ```text
//! # x   y    tx    ty   weight
//! x y tx ty weight
//! 0.0  0.0  1.0   0.0   1
//! 10   0.0  0.98  0.17  1
//! ```
//!
//! A line holds a place and a direction, and may add a weight (1 otherwise): `x y tx ty [weight]` in the plan
//! view (mm), or `u v tu tv [weight]` in the parameters of the part's patches. A first line of words says
//! which; without it they are x and y. Numbers stand apart by blanks, tabs, commas or semicolons; `#` begins
//! a comment; empty lines are passed over. Directions are lines: `1 0` and `-1 0` are the same, and their
//! length matters to a fit of velocities only, but 0 is refused. Places may be scattered.

use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use field::{LineField, LineSample, SamplePlane};

use crate::regular;

/// Greatest file that is read, bytes: a million samples.
pub const MAX_BYTES: u64 = 64 << 20;

/// Lengths and weights, where they are not 0: beyond these, sums of them and of their squares are lost.
const BELIEVABLE: RangeInclusive<f64> = 1e-30..=1e30;

/// What is wrong with a table, and where.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {message}")]
pub struct DirectionTableError {
    /// Line, from 1; the last one where something is missing.
    pub line: usize,
    /// What was found and what would help.
    pub message: String,
}

/// Why a file was not read.
#[derive(Debug, thiserror::Error)]
pub enum DirectionFileError {
    /// The file system refused.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The file is too large.
    #[error("{} is greater than {} MiB; thin out its samples", path.display(), MAX_BYTES >> 20)]
    TooLarge {
        /// The file.
        path: PathBuf,
    },
    /// The text cannot be used.
    #[error("{}, {source}", path.display())]
    Text {
        /// The file.
        path: PathBuf,
        /// What is wrong, and where.
        source: DirectionTableError,
    },
}

/// Reads a table of directions from a file.
///
/// # Errors
/// See [`DirectionFileError`].
pub fn read(path: &Path) -> Result<LineField, DirectionFileError> {
    let io = |source| DirectionFileError::Io { path: path.to_owned(), source };
    let bytes = regular::read(path, MAX_BYTES).map_err(io)?;
    if bytes.len() as u64 > MAX_BYTES {
        return Err(DirectionFileError::TooLarge { path: path.to_owned() });
    }
    parse(&bytes).map_err(|source| DirectionFileError::Text { path: path.to_owned(), source })
}

/// Reads a table of directions.
///
/// # Errors
/// See [`DirectionTableError`].
pub fn parse(bytes: &[u8]) -> Result<LineField, DirectionTableError> {
    let text = std::str::from_utf8(bytes).map_err(|e| DirectionTableError {
        line: 1 + bytes[..e.valid_up_to()].iter().filter(|b| **b == b'\n').count(),
        message: "this is not text; save the table as plain text".into(),
    })?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut plane = SamplePlane::Plan;
    let (mut samples, mut lines, mut headed) = (Vec::new(), 0, false);
    for (k, line) in text.lines().enumerate() {
        lines = k + 1;
        let content = line.split('#').next().unwrap_or("");
        let fields: Vec<&str> =
            content.split([' ', '\t', ',', ';', '\r']).filter(|field| !field.is_empty()).collect();
        let at_line = |message: String| DirectionTableError { line: k + 1, message };
        let Some(first) = fields.first() else { continue };
        if samples.is_empty() && !headed && first.parse::<f64>().is_err() {
            plane = header(&fields).map_err(at_line)?;
            headed = true;
            continue;
        }
        samples.push(sample(&fields).map_err(at_line)?);
    }
    if samples.is_empty() {
        let message = "the table has no direction; write `x y tx ty` on each line".to_owned();
        return Err(DirectionTableError { line: lines.max(1), message });
    }
    LineField::new(plane, &samples).ok_or_else(|| DirectionTableError {
        line: lines,
        message: "no direction has a weight above 0".into(),
    })
}

/// The plane that a line of words names.
fn header(words: &[&str]) -> Result<SamplePlane, String> {
    let lower: Vec<String> = words.iter().map(|word| word.to_lowercase()).collect();
    let named: Vec<&str> = lower.iter().map(String::as_str).collect();
    match named[..] {
        ["x", "y", "tx", "ty"] | ["x", "y", "tx", "ty", "weight"] => Ok(SamplePlane::Plan),
        ["u", "v", "tu", "tv"] | ["u", "v", "tu", "tv", "weight"] => Ok(SamplePlane::Parameters),
        _ => Err(format!(
            "\"{}\" names no columns; write `x y tx ty`, `u v tu tv`, or either with `weight`",
            words.join(" ").chars().take(60).collect::<String>()
        )),
    }
}

fn sample(fields: &[&str]) -> Result<LineSample, String> {
    if !(4..=5).contains(&fields.len()) {
        return Err(format!("{} numbers, and a direction takes 4, or 5 with a weight", fields.len()));
    }
    let mut numbers: [f64; 5] = [0.0, 0.0, 0.0, 0.0, 1.0];
    for (number, field) in numbers.iter_mut().zip(fields) {
        let shown: String = field.chars().take(30).collect();
        *number = field.parse().map_err(|_| format!("\"{shown}\" is no number"))?;
        if !number.is_finite() {
            return Err(format!("\"{shown}\" is no finite number"));
        }
    }
    let [x, y, tx, ty, weight] = numbers;
    if x.abs().max(y.abs()) > geometry::MAX_COORDINATE {
        return Err(format!("the place ({x}, {y}) is farther than a kilometre; check its unit"));
    }
    let length = tx.hypot(ty);
    if length == 0.0 {
        return Err("the direction has no length; delete the line where there is none".into());
    }
    if weight < 0.0 {
        return Err(format!("the weight is {weight}; write 0 or more"));
    }
    for (what, number) in [("the direction's length", length), ("the weight", weight)] {
        if number != 0.0 && !BELIEVABLE.contains(&number) {
            let [least, most] = [BELIEVABLE.start(), BELIEVABLE.end()];
            return Err(format!("{what} is {number:e}; write one between {least:e} and {most:e}"));
        }
    }
    Ok(LineSample { at: [x, y], line: [tx, ty], weight })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn refusal(text: &str) -> String {
        parse(text.as_bytes()).unwrap_err().to_string()
    }

    #[test]
    fn tables_with_any_separator_comment_and_header_are_read() {
        let plain = parse(b"# a comment\n0 0 1 0\n\n10, 0; 0.5\t0.5 # another\r\n").unwrap();
        assert_eq!((plain.plane(), plain.len()), (SamplePlane::Plan, 2));
        assert_eq!(plain.bounds()[0], [0.0, 10.0]);
        let named = parse("\u{feff}U,V,TU,TV,Weight\n0.5,0.5,0,-2,3\n".as_bytes()).unwrap();
        assert_eq!((named.plane(), named.len()), (SamplePlane::Parameters, 1));
        let (line, sure) = named.at([0.5, 0.5]).unwrap();
        assert!(line[0].abs() < 1e-12 && (sure - 3.0).abs() < 1e-12);
    }

    #[test]
    fn faults_name_their_line() {
        assert!(refusal("0 0 1 0\n1 0 0 0\n").starts_with("line 2: the direction has no length"));
        assert!(refusal("0 0 1 nan\n").starts_with("line 1: \"nan\" is no finite number"));
        assert!(refusal("x y tx ty\n0 0 1\n").starts_with("line 2: 3 numbers"));
        assert!(refusal("0 0 1 0\n\n0 0 1 0 1 1").starts_with("line 3: 6 numbers"));
        assert!(refusal("0 0 1 0\n0 zero 1 0").starts_with("line 2: \"zero\" is no number"));
        assert!(refusal("x y z\n").starts_with("line 1: \"x y z\" names no columns"));
        assert!(refusal("# nothing\n\n").starts_with("line 2: the table has no direction"));
        assert!(refusal("").starts_with("line 1: the table has no direction"));
        assert!(refusal("0 0 1 0 0\n").starts_with("line 1: no direction has a weight"));
        assert!(refusal("0 0 1 0 -1\n").starts_with("line 1: the weight is -1"));
        assert!(
            refusal("0 0 1e308 0\n")
                .starts_with("line 1: the direction's length is 1e308; write one between")
        );
        assert!(refusal("0 0 1e-200 0\n").starts_with("line 1: the direction's length is 1e-200"));
        assert!(refusal("0 0 1 0 1e40\n").starts_with("line 1: the weight is 1e40"));
        assert!(refusal("2e6 0 1 0\n").contains("farther than a kilometre"));
        assert!(parse(b"0 0 1 0\n\xff").unwrap_err().to_string().starts_with("line 2: this is not text"));
    }

    proptest! {
        #[test]
        fn any_bytes_are_read_or_refused(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
            let _ = parse(&bytes);
        }

        #[test]
        fn any_numbers_are_read_or_refused(rows in proptest::collection::vec(
            (-1e7f64..1e7, any::<f64>(), any::<f64>(), -1.0f64..1.0), 1..20)) {
            let text: String = rows.iter().map(|(a, b, c, d)| format!("{a} {b} {c} {d}\n")).collect();
            let found = parse(text.as_bytes()).ok().and_then(|field| field.at([rows[0].0, rows[0].1]));
            if let Some((line, sure)) = found {
                prop_assert!(line[0].is_finite() && line[1].is_finite() && sure >= 0.0);
            }
        }
    }
}
