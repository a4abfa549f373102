//! Comments in which post processors describe a tool, such as
//! `T1 D=6. CR=0.5 - ZMIN=-3. - bull nose end mill`.

use cutter::{AptWords, Cutter};

/// Words before a diameter and before a corner radius.
const DIAMETER: [&str; 3] = ["D=", "DIA=", "DIAMETER="];
const CORNER: [&str; 2] = ["CR=", "R="];

/// Tools that leave another surface than an end mill of their diameter.
const OTHER_KINDS: [&str; 21] = [
    "drill",
    "tap",
    "thread",
    "reamer",
    "chamfer",
    "spot",
    "taper",
    "lollipop",
    "dovetail",
    "t-slot",
    "tslot",
    "slot mill",
    "form mill",
    "radius mill",
    "barrel",
    "boring",
    "engrav",
    "countersink",
    "counter sink",
    "counterbore",
    "counter bore",
];

/// Words by which a comment speaks of a cutter that is not in use.
const NOT_IN_USE: [&str; 7] = ["NOT", "OLD", "WAS", "INSTEAD", "FORMER", "FORMERLY", "WRONG"];

/// Millimetres of an inch.
const INCH: f64 = 25.4;

/// Cutters whose lengths differ by less, mm, are one: comments have two to four decimals, of inches too.
const SAME_LENGTH: f64 = 0.005;

/// Corner radii of balls are half of the diameter within so many units of length: they are rounded.
const ROUNDED: f64 = 6e-4;

/// What a comment says of a cutter.
#[derive(Debug, Clone, PartialEq)]
pub enum Said {
    /// Nothing: it tells no diameter, or describes another kind of tool.
    Nothing,
    /// Something that cannot be read without a guess. The reason is a clause.
    Unclear(String),
    /// A cutter.
    Cutter(Cutter),
}

/// Whether a comment may describe a tool.
pub(crate) fn may_describe_a_tool(text: &str) -> bool {
    let text = text.trim_start();
    let mut letters = text.bytes();
    let begins_with_t = letters.next().is_some_and(|b| b.eq_ignore_ascii_case(&b'T'))
        && letters.find(|b| *b != b' ').is_some_and(|b| b.is_ascii_digit());
    begins_with_t || behind(&text.to_ascii_uppercase(), &DIAMETER).next().is_some()
}

/// What a comment says of a cutter: a diameter, a corner radius, and whether it is a ball. `unit` is that of
/// the program, mm; `None` where the program counts in both units.
pub fn cutter_of_remark(text: &str, unit: Option<f64>) -> Said {
    if let Some(words) = text.strip_prefix("CUTTER/") {
        let reason = || format!("`{text}` makes no cutter");
        return cutter_of_words(words).map_or_else(|| Said::Unclear(reason()), Said::Cutter);
    }
    let upper = text.to_ascii_uppercase();
    if behind(&upper, &DIAMETER).next().is_none() || is_another_kind(&upper) {
        return Said::Nothing;
    }
    let said = in_use(&upper).and_then(|()| length_after(&upper, &DIAMETER, unit)).and_then(|diameter| {
        diameter.ok_or_else(String::new).and_then(|diameter| end_mill_of(&upper, diameter, unit))
    });
    said.map_or_else(Said::Unclear, Said::Cutter)
}

/// The end mill of a diameter, mm, that the remark of a table in mm describes.
pub(super) fn cutter_of_table(remark: &str, diameter: f64) -> Option<Cutter> {
    let upper = remark.to_ascii_uppercase();
    if is_another_kind(&upper) { None } else { end_mill_of(&upper, diameter, Some(1.0)).ok() }
}

fn is_another_kind(upper: &str) -> bool {
    let lower = upper.to_ascii_lowercase();
    OTHER_KINDS.iter().any(|word| lower.contains(word))
}

/// Whether a comment is about the tool in use; else why that is not known.
fn in_use(upper: &str) -> Result<(), String> {
    if let Some(word) = words_of(upper).find(|word| NOT_IN_USE.contains(word)) {
        return Err(format!("it has the word {word}"));
    }
    let own = number_of_remark(upper);
    let number = |word: &str| word.strip_prefix('T')?.parse::<u32>().ok();
    match words_of(upper).filter_map(number).find(|number| Some(*number) != own) {
        Some(number) => Err(format!("it names tool {number} behind other words")),
        None => Ok(()),
    }
}

/// Words of letters and digits.
fn words_of(upper: &str) -> impl Iterator<Item = &str> {
    upper.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty())
}

/// A ball, bull or flat end of a diameter, mm, by the corner and the words of a comment; else why it is none.
fn end_mill_of(upper: &str, diameter: f64, unit: Option<f64>) -> Result<Cutter, String> {
    let corner = length_after(upper, &CORNER, unit)?;
    let (half, given) = (0.5 * diameter, corner.unwrap_or(0.0));
    let is_ball = (given - half).abs() <= ROUNDED * unit.unwrap_or(INCH);
    let corner = match ["BALL", "BULL", "FLAT"].map(|word| upper.contains(word)) {
        [true, false, false] if corner.is_none() || is_ball => half,
        [true, ..] => return Err("it calls the cutter a ball and says otherwise as well".to_owned()),
        [_, true, _] if given == 0.0 => return Err("it tells no corner radius of the bull nose".to_owned()),
        [.., true] if given > 0.0 => {
            return Err("it calls the cutter flat and tells a corner radius".to_owned());
        }
        _ if is_ball => half,
        _ => given,
    };
    end_mill(diameter, corner).ok_or_else(|| "its numbers make no cutter".to_owned())
}

/// Whether two cutters are one, as far as comments can tell.
pub fn same_cutter(a: &Cutter, b: &Cutter) -> bool {
    let lengths = |cutter: &Cutter| {
        let words = cutter.words();
        [words.diameter, words.corner_radius, words.corner_x, words.corner_z]
    };
    let angles = |cutter: &Cutter| [cutter.words().tip_angle, cutter.words().side_angle];
    let near = |a: &[f64], b: &[f64], most: f64| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= most);
    near(&lengths(a), &lengths(b), SAME_LENGTH) && near(&angles(a), &angles(b), 1e-4)
}

/// A ball, bull or flat end by its corner radius, mm.
fn end_mill(diameter: f64, corner: f64) -> Option<Cutter> {
    match corner {
        _ if corner > 0.0 && corner == 0.5 * diameter => Cutter::ball(diameter),
        _ if corner > 0.0 => Cutter::bull(diameter, corner),
        _ => Cutter::flat(diameter),
    }
    .ok()
}

/// The cutter of the words of CUTTER in APT: diameter, corner radius, and its centre, two angles and a length
/// where they are given. mm and degrees. `None` where they make no cutter.
fn cutter_of_words(words: &str) -> Option<Cutter> {
    /// Programs round to four decimals, mm.
    const TOUCH: f64 = 2e-4;
    let words: Vec<f64> = words.split(',').map(|word| word.parse().ok()).collect::<Option<_>>()?;
    let word = |k: usize| words.get(k).copied();
    let (diameter, corner) = (word(0)?, word(1).unwrap_or(0.0));
    let upright = [word(4), word(5)].iter().flatten().all(|angle| *angle == 0.0);
    let touches = |k: usize, place: f64| word(k).is_none_or(|given| (given - place).abs() <= TOUCH);
    if upright && touches(2, 0.5 * diameter - corner) && touches(3, corner) {
        return end_mill(diameter, corner);
    }
    let apt = AptWords {
        diameter,
        corner_radius: corner,
        corner_x: 0.0,
        corner_z: 0.0,
        tip_angle: word(4)?.to_radians(),
        side_angle: word(5)?.to_radians(),
        length: word(6)?,
    };
    Cutter::apt(&apt.with_centre(word(2), word(3))).ok()
}

/// The number of the tool at the beginning of a comment.
pub(crate) fn number_of_remark(text: &str) -> Option<u32> {
    let rest = text.trim_start().strip_prefix(['T', 't'])?.trim_start();
    let end = rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len());
    rest[..end].parse().ok()
}

/// Each of some words where it begins a word, and what stands behind it.
fn behind<'a>(upper: &'a str, words: &'a [&str]) -> impl Iterator<Item = (&'a str, &'a str)> {
    words.iter().flat_map(move |word| {
        let begins = |at: usize| at == 0 || !upper.as_bytes()[at - 1].is_ascii_alphanumeric();
        let places = upper.match_indices(word).map(|(at, _)| at).filter(move |at| begins(*at));
        places.map(move |at| (*word, upper[at + word.len()..].trim_start()))
    })
}

/// The length behind some words, mm; all that stand there have to agree. Else why it is not known.
fn length_after(upper: &str, words: &[&str], unit: Option<f64>) -> Result<Option<f64>, String> {
    let mut known: Option<f64> = None;
    for (word, text) in behind(upper, words) {
        let length = plain_length(text, unit).ok_or_else(|| {
            let shown: String = text.split_whitespace().next().unwrap_or_default().chars().take(20).collect();
            let why = match plain_length(text, Some(INCH)) {
                Some(_) => "has no unit, and that of the program does not settle it",
                None => "is not a plain length",
            };
            format!("`{word}{shown}` {why}")
        })?;
        if known.is_some_and(|other| (other - length).abs() > SAME_LENGTH) {
            return Err(format!("it tells several lengths behind `{}`", words.join("` and `")));
        }
        known = Some(length);
    }
    Ok(known)
}

/// A unit behind a number.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Unit {
    /// None.
    Unsaid,
    /// mm.
    Of(f64),
    /// The word IN, which may begin a remark.
    MayBeInch,
}

/// The length that a text begins with, mm: a number, or a whole number and a fraction, and its unit. `None`
/// where anything else is joined to it.
fn plain_length(text: &str, unit: Option<f64>) -> Option<f64> {
    let (number, is_fraction, rest) = number_at(text)?;
    let (said, rest) = unit_at(rest);
    let joined = !rest.is_empty() && !rest.starts_with(|c: char| c.is_whitespace() || ",;)]|".contains(c));
    if joined || goes_on(rest.trim_start()) {
        return None;
    }
    let unit = match (said, unit) {
        (Unit::Of(unit), _) => unit,
        (Unit::MayBeInch, unit) => unit.filter(|unit| *unit == INCH)?,
        // Fractions are of inches, and a program in mm does not say so.
        (Unit::Unsaid, unit) => unit.filter(|unit| !is_fraction || *unit == INCH)?,
    };
    Some(number * unit).filter(|length| length.is_finite())
}

/// Whether a text carries on the number before it: `/ 4`, `+0.02`, `- 0.5`.
fn goes_on(text: &str) -> bool {
    let number = |text: &str| text.starts_with(|c: char| c.is_ascii_digit() || c == '.');
    let Some(rest) = text.strip_prefix(['/', '*', '+', '-', '±']) else { return false };
    if !text.starts_with('-') || number(rest) {
        return number(rest.trim_start());
    }
    let rest = rest.trim_start();
    let behind = rest.trim_start_matches(|c: char| c.is_ascii_digit() || c == '.').trim_start();
    number(rest) && !behind.starts_with(|c: char| c.is_alphabetic())
}

fn digits(text: &str) -> (&str, &str) {
    text.split_at(text.find(|c: char| !c.is_ascii_digit()).unwrap_or(text.len()))
}

/// A number, whether it is a fraction, and what is behind it.
fn number_at(text: &str) -> Option<(f64, bool, &str)> {
    let (whole, rest) = digits(text);
    if let Some(behind) = rest.strip_prefix('.') {
        let (decimals, rest) = digits(behind);
        let number = format!("{whole}.{decimals}").parse().ok()?;
        return Some((number, false, rest));
    }
    let number: f64 = whole.parse().ok()?;
    if let Some((value, rest)) = fraction(text) {
        return Some((value, true, rest));
    }
    let mixed = rest.strip_prefix('-').unwrap_or_else(|| rest.trim_start());
    if mixed.len() < rest.len()
        && let Some((value, rest)) = fraction(mixed)
    {
        return (value < 1.0).then_some((number + value, true, rest));
    }
    // A comma with digits behind it is a decimal one, unless they are a word of their own.
    let Some((decimals, behind)) = rest.strip_prefix(',').map(digits) else {
        return Some((number, false, rest));
    };
    match behind.chars().next() {
        _ if decimals.is_empty() => Some((number, false, rest)),
        Some('.') => None,
        Some(c) if c.is_alphabetic() && unit_at(behind).0 == Unit::Unsaid => Some((number, false, rest)),
        _ => Some((format!("{whole}.{decimals}").parse().ok()?, false, behind)),
    }
}

/// Two whole numbers with a stroke between.
fn fraction(text: &str) -> Option<(f64, &str)> {
    let (above, rest) = digits(text);
    let (below, rest) = digits(rest.strip_prefix('/')?);
    let (above, below): (f64, f64) = (above.parse().ok()?, below.parse().ok()?);
    (below > 0.0).then_some((above / below, rest))
}

/// A unit at the beginning of a text, and what is behind it.
fn unit_at(text: &str) -> (Unit, &str) {
    let words = [
        ("MM", 1.0),
        ("INCHES", INCH),
        ("INCH", INCH),
        ("IN.", INCH),
        ("IN", INCH),
        ("\"", INCH),
        ("''", INCH),
    ];
    let apart = text.trim_start();
    let ends = |rest: &str| !rest.starts_with(|c: char| c.is_alphanumeric());
    for (word, unit) in words {
        if let Some(rest) = apart.strip_prefix(word).filter(|rest| ends(rest)) {
            let may_be_a_word = word.starts_with("IN") && word.len() <= 3 && apart.len() < text.len();
            return (if may_be_a_word { Unit::MayBeInch } else { Unit::Of(unit) }, rest);
        }
    }
    (Unit::Unsaid, text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn remarks_of_common_posts() {
        let of = |text: &str, unit: f64| match cutter_of_remark(text, Some(unit)) {
            Said::Cutter(cutter) => Some(cutter),
            _ => None,
        };
        let cutter = |text: &str| of(text, 1.0);
        assert_eq!(cutter("T1 D=6. CR=0. - ZMIN=-3. - flat end mill"), Cutter::flat(6.0).ok());
        assert_eq!(cutter("T2  D=10. CR=2. - bullnose end mill"), Cutter::bull(10.0, 2.0).ok());
        assert_eq!(cutter("T3 D=6 CR=3 - ball end mill"), Cutter::ball(6.0).ok());
        assert_eq!(cutter("BALL END D=6.0"), Cutter::ball(6.0).ok());
        assert_eq!(cutter("BULL NOSE D=6.0 R=0.5"), Cutter::bull(6.0, 0.5).ok());
        assert_eq!(cutter("T4 D=5 TAPER=118deg - drill"), None);
        assert_eq!(cutter("ZMIN=-3 AND=4"), None);
        assert_eq!(of("T1 D=0.25", 25.4), Cutter::flat(6.35).ok());
        assert_eq!(cutter("CUTTER/6"), Cutter::flat(6.0).ok());
        assert_eq!(cutter("CUTTER/6,3"), Cutter::ball(6.0).ok());
        assert_eq!(cutter("CUTTER/10,2,3,2,0,0,50"), Cutter::bull(10.0, 2.0).ok());
        assert_eq!(cutter("CUTTER/10,0,5,0,0,0,50"), Cutter::flat(10.0).ok());
        let taper = cutter("CUTTER/6,0,3,0,0,10,30").unwrap();
        assert!((taper.words().side_angle.to_degrees() - 10.0).abs() < 1e-9);
        assert_eq!(
            (cutter("CUTTER/6,4"), cutter("CUTTER/"), cutter("CUTTER/10,2,9,9,0,0,50")),
            (None, None, None)
        );
        assert_eq!(cutter("T1 D=6,35 CR=0 - flat end mill"), Cutter::flat(6.35).ok());
        assert_eq!(cutter("T1 D=10,CR=2, bullnose"), Cutter::bull(10.0, 2.0).ok());
        assert_eq!(cutter("T1 D=6,0 CR=0,5"), Cutter::bull(6.0, 0.5).ok());
        assert_eq!(cutter("T1 D=8.5,3FL"), Cutter::flat(8.5).ok());
        assert_eq!(cutter("T1 D=8,3FL"), Cutter::flat(8.0).ok());
        assert!(may_describe_a_tool("T12 something") && !may_describe_a_tool("TOP 3 = 4"));
    }

    #[test]
    fn lengths_are_numbers_or_fractions_with_their_unit() {
        for (text, unit, expected) in [
            ("1/4", INCH, Some(6.35)),
            ("1-1/4 BALL", INCH, Some(31.75)),
            ("1 1/4", INCH, Some(31.75)),
            ("3/8 IN", INCH, Some(9.525)),
            ("1/4IN", 1.0, Some(6.35)),
            (".25\"", 1.0, Some(6.35)),
            ("0.25INCH,", 1.0, Some(6.35)),
            ("6.35MM", INCH, Some(6.35)),
            ("6,35 MM", INCH, Some(6.35)),
            ("6. - 3 FLUTES", 1.0, Some(6.0)),
            ("6 - 3FL", 1.0, Some(6.0)),
            ("6 X 50", 1.0, Some(6.0)),
            // A fraction of mm, a fraction of what is no whole number, and what only begins as a number.
            ("1/4", 1.0, None),
            ("25,4/4", 1.0, None),
            ("20-0.5", 1.0, None),
            ("20 - 0.5", 1.0, None),
            ("20 -0.5", 1.0, None),
            ("20 / 2", 1.0, None),
            ("20+0.02", 1.0, None),
            ("20*2", 1.0, None),
            ("1-5/4", INCH, None),
            ("1/0", INCH, None),
            ("1/4/2", INCH, None),
            ("20CM", 1.0, None),
            ("2E1", 1.0, None),
            ("6.3.5", 1.0, None),
            ("1,000.5", 1.0, None),
            ("-6", 1.0, None),
            ("TBD", 1.0, None),
            ("", 1.0, None),
            ("6 IN STEEL", 1.0, None),
        ] {
            let found = plain_length(text, Some(unit));
            let same = match (found, expected) {
                (Some(found), Some(expected)) => (found - expected).abs() < 1e-9,
                (found, expected) => found == expected,
            };
            assert!(same, "{text}: {found:?}");
        }
        assert_eq!((plain_length("6", None), plain_length("6MM", None)), (None, Some(6.0)));
    }

    #[test]
    fn what_would_take_a_guess_is_unclear() {
        for text in [
            "T1 D=20-0.5 CR=10 - ball end mill",
            "T1 D=6 CR=1/4 - bull nose end mill",
            "NOT T1 D=20 CR=10 - ball end mill",
            "OLD: T1 D=6. CR=3. - ball end mill",
            "T1 D=20 ball, T2 later",
            "T1 D=6. - bull nose end mill",
            "T1 D=6. CR=0. - bull nose end mill",
            "T1 D=6. CR=2. - ball end mill",
            "T1 D=6. CR=2. - flat end mill",
            "T1 D=6. D=20. - flat end mill",
            "T5 H5 D=5 DIA=8",
            "T1 D=6. CR=4.",
            "T1 D=0",
            "CUTTER/6,4",
        ] {
            assert!(matches!(cutter_of_remark(text, Some(1.0)), Said::Unclear(_)), "{text}");
        }
        for text in [
            "T1 D=1/4 - drill",
            "T1 end mill",
            "ZMIN=-3",
            "T5 D=6. CR=3. - lollipop mill",
            "T6 D=12. CR=0. - Dovetail mill",
            "T7 D=20 CR=0.5 - slot mill",
            "T8 D=8 CR=2 - radius mill",
        ] {
            assert_eq!(cutter_of_remark(text, Some(1.0)), Said::Nothing, "{text}");
        }
        let rounded = cutter_of_remark("T1 D=.0625 CR=.0313 - ball end mill", Some(INCH));
        assert!(matches!(rounded, Said::Cutter(cutter) if cutter.is_ball()), "{rounded:?}");
    }
}
