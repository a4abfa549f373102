//! Feed directions as scenes spell them: a word, a table in place, or a blend of several.

use std::fmt::{self, Write as _};
use std::sync::Arc;

use crate::vocabulary::{Along, FeedDirection};
use field::DIRECTION_WEIGHT;
use field::mesh::Sense;
use keys::{Located, SceneError, Section, toml_number, toml_points, toml_string};

/// The keys of a direction, where it is the value of the first of them.
pub(crate) const KEYS: [&str; 4] = ["direction", "directions", "guides", "across"];

/// Words of directions that can be blended.
const WORDS: [&str; 8] = ["widest-strip", "steepest", "contour", "u", "v", "guide", "border", "file"];

/// Words of directions that level ground has, too.
const LEVEL_WORDS: [&str; 5] = ["u", "v", "guide", "border", "file"];

/// The word of a strategy of its own.
const SHORTEST: &str = "shortest";

/// Weights of a blend that make sense: below, a direction has no part in it.
const WEIGHT: std::ops::RangeInclusive<f64> = 1e-6..=1e6;

/// Weights of directions over distances: below, passes leave them; above, distances count for nothing.
const DIRECTION_WEIGHTS: std::ops::RangeInclusive<f64> = 1e-3..=1e3;

/// How much following a direction counts over the distances of passes.
pub(crate) fn read_weight(section: &Section<'_>) -> Result<f64, SceneError> {
    section.number_or("direction_weight", DIRECTION_WEIGHTS, "", DIRECTION_WEIGHT)
}

/// Reads a direction and the files that it names, in order; what these hold is read later. `None` for the
/// shortest path, which is asked for where nothing is said of directions, and no other key needs one
/// (`needed`).
pub(crate) fn read(
    section: &Section<'_>,
    files: &mut Vec<Located<String>>,
    needed: bool,
) -> Result<Option<FeedDirection>, SceneError> {
    let words: Vec<&str> = WORDS.into_iter().chain([SHORTEST]).collect();
    read_one(section, &words, if needed { WORDS[0] } else { SHORTEST }, files)
}

/// Reads a direction on level ground; along the border where nothing is said.
pub(crate) fn read_level(
    section: &Section<'_>,
    files: &mut Vec<Located<String>>,
) -> Result<FeedDirection, SceneError> {
    let direction = read_one(section, &LEVEL_WORDS, "border", files)?;
    Ok(direction.unwrap_or(FeedDirection::Border(Sense::Along)))
}

/// Reads a direction by one of some words, by the `usual` one where none is written.
fn read_one(
    section: &Section<'_>,
    words: &[&'static str],
    usual: &'static str,
    files: &mut Vec<Located<String>>,
) -> Result<Option<FeedDirection>, SceneError> {
    let (word, direction) = match section.inline("direction") {
        Some(table) if table.has("blend") => ("", Some(read_blend(&table, words, files)?)),
        Some(table) => {
            table.only(&["angle", "blend"], &[], "a direction")?;
            let angle = table.required_number("angle", -360.0..=360.0, " degrees", 30.0)?;
            ("", Some(FeedDirection::Angle(angle.value.to_radians())))
        }
        None => {
            let word = section.word("direction", words)?.map_or(usual, |word| word.value);
            (word, read_word(word, section, files)?)
        }
    };
    for (key, wanted, what, cure) in [
        (
            "directions",
            &["file"][..],
            "a file that nothing reads",
            "add `direction = \"file\"`, or delete it",
        ),
        ("guides", &["guide"], "curves that nothing follows", "add `direction = \"guide\"`, or delete it"),
        (
            "across",
            &["guide", "border"],
            "a sense of no curve",
            "write `direction = \"guide\"` or \"border\", or delete it",
        ),
    ] {
        if section.has(key) && !wanted.contains(&word) {
            return Err(section.key_error(key, format!("`{key}` names {what}"), cure));
        }
    }
    Ok(direction)
}

/// The direction of a word with the keys that belong to it; `None` for the shortest path.
fn read_word(
    word: &str,
    section: &Section<'_>,
    files: &mut Vec<Located<String>>,
) -> Result<Option<FeedDirection>, SceneError> {
    let sense = || Ok(if section.flag("across")?.unwrap_or(false) { Sense::Across } else { Sense::Along });
    Ok(Some(match word {
        SHORTEST => return Ok(None),
        "steepest" => FeedDirection::Steepest,
        "contour" => FeedDirection::Contour,
        "u" => FeedDirection::Parameter(Along::U),
        "v" => FeedDirection::Parameter(Along::V),
        "guide" => {
            let cure = "write two or more different points for each curve: \
                        `guides = [[[0, 0], [50, 10]], [[0, 40], [50, 45]]]`";
            let curves = section.curves("guides")?;
            if curves.is_empty() {
                return Err(section.key_error("direction", "no `guides` to follow", cure));
            }
            if let Some(point) = curves.iter().find(|curve| curve.value.windows(2).all(|w| w[0] == w[1])) {
                return Err(section.error(&point.span, "this guide curve has no length", cure));
            }
            let curves = Arc::new(curves.into_iter().map(|curve| curve.value).collect());
            FeedDirection::Guides { curves, sense: sense()? }
        }
        "border" => FeedDirection::Border(sense()?),
        "file" => {
            let file = section.required_text("directions", "directions.txt")?;
            let name = file.value.to_owned();
            files.push(Located { value: name.clone(), span: file.span });
            FeedDirection::File { name, samples: None }
        }
        _ => FeedDirection::WidestStrip,
    }))
}

/// `{ blend = [{ direction = "steepest", weight = 2.0 }, ...] }`.
fn read_blend(
    table: &Section<'_>,
    words: &[&'static str],
    files: &mut Vec<Located<String>>,
) -> Result<FeedDirection, SceneError> {
    // The shortest path is no direction.
    let words: Vec<&'static str> = words.iter().copied().filter(|word| *word != SHORTEST).collect();
    table.only(&["blend"], &["angle"], "a blend of directions")?;
    let keys: Vec<&str> = KEYS.into_iter().chain(["weight"]).collect();
    let parts = table.sections("blend")?;
    if parts.len() < 2 {
        return Err(table.key_error(
            "blend",
            "a blend takes two directions or more",
            "write `blend = [{ direction = \"widest-strip\", weight = 2 }, { direction = \"steepest\" }]`",
        ));
    }
    let read_part = |part: &Section<'_>| {
        part.only(&keys, &[], "a direction of a blend")?;
        if !part.has("direction") {
            return part.required_word("direction", &words).map(|_| (FeedDirection::WidestStrip, 0.0));
        }
        if part.inline("direction").is_some_and(|inner| inner.has("blend")) {
            let cure = "give all directions and their weights in one blend";
            return Err(part.key_error("direction", "a blend cannot be blended again", cure));
        }
        // The words leave the shortest path out, so that there is always a direction.
        let direction = read_one(part, &words, words[0], files)?.unwrap_or(FeedDirection::WidestStrip);
        Ok((direction, part.number_or("weight", WEIGHT, "", 1.0)?))
    };
    Ok(FeedDirection::Blend(parts.iter().map(read_part).collect::<Result<_, SceneError>>()?))
}

/// `direction = ...` and the keys that belong to it, joined by `separator`: lines of a toolpath, or entries
/// of a table.
pub(crate) fn write(out: &mut String, direction: &FeedDirection, separator: &str) -> fmt::Result {
    let across = |sense: Sense| format!("across = {}", sense == Sense::Across);
    let word = |out: &mut String, word: &str| write!(out, "direction = \"{word}\"");
    match direction {
        FeedDirection::Parameter(Along::U) => word(out, "u"),
        FeedDirection::Parameter(Along::V) => word(out, "v"),
        FeedDirection::Angle(angle) => {
            write!(out, "direction = {{ angle = {} }}", toml_number(angle.to_degrees()))
        }
        FeedDirection::WidestStrip => word(out, "widest-strip"),
        FeedDirection::Steepest => word(out, "steepest"),
        FeedDirection::Contour => word(out, "contour"),
        FeedDirection::File { name, .. } => {
            write!(out, "direction = \"file\"{separator}directions = {}", toml_string(name))
        }
        // No scene spells samples that no file holds.
        FeedDirection::Samples(_) => word(out, "file"),
        FeedDirection::Guides { curves, sense } => {
            let curves = curves.iter().map(|curve| toml_points(curve)).collect::<Vec<_>>().join(", ");
            write!(out, "direction = \"guide\"{separator}guides = [{curves}]{separator}{}", across(*sense))
        }
        FeedDirection::Border(sense) => write!(out, "direction = \"border\"{separator}{}", across(*sense)),
        FeedDirection::Blend(parts) => {
            write!(out, "direction = {{ blend = [")?;
            for (k, (part, weight)) in parts.iter().enumerate() {
                write!(out, "{}{{ ", if k > 0 { ", " } else { "" })?;
                write(out, part, ", ")?;
                write!(out, ", weight = {} }}", toml_number(*weight))?;
            }
            write!(out, "] }}")
        }
    }
}
