//! Feed directions of streamlines in a scene: a word, a table in place, or a blend of several.

use std::fmt::{self, Write as _};
use std::path::Path;
use std::sync::Arc;

use super::NamedFile;
use super::write::{number, text};
use field::mesh::Sense;
use field::{LineField, LineSample, SamplePlane};
use io::direction_table;
use keys::Section;
use keys::{SceneError, SceneText};
use toolpath::{Along, FeedDirection};

/// The keys of a direction, where it is the value of the first of them.
pub(super) const KEYS: [&str; 4] = ["direction", "directions", "guides", "across"];

/// Words of directions that can be blended.
const WORDS: [&str; 8] = ["widest-strip", "steepest", "contour", "u", "v", "guide", "border", "file"];

/// The word of a strategy of its own.
const SHORTEST: &str = "shortest";

/// Weights of a blend that make sense: below, a direction has no part in it.
const WEIGHT: std::ops::RangeInclusive<f64> = 1e-6..=1e6;

/// Reads a direction and the files that it names, in order; until [`load`] samples of a file are those of
/// [`unread`]. `None` for the shortest path.
pub(super) fn read(
    section: &Section<'_>,
    folder: &Path,
    files: &mut Vec<NamedFile>,
) -> Result<Option<FeedDirection>, SceneError> {
    let words: Vec<&str> = WORDS.into_iter().chain([SHORTEST]).collect();
    read_one(section, &words, folder, files)
}

fn read_one(
    section: &Section<'_>,
    words: &[&'static str],
    folder: &Path,
    files: &mut Vec<NamedFile>,
) -> Result<Option<FeedDirection>, SceneError> {
    let (word, direction) = match section.inline("direction") {
        Some(table) if table.has("blend") => ("", Some(read_blend(&table, folder, files)?)),
        Some(table) => {
            table.only(&["angle", "blend"], &[], "a direction")?;
            let angle = table.required_number("angle", -360.0..=360.0, " degrees", 30.0)?;
            ("", Some(FeedDirection::Angle(angle.value.to_radians())))
        }
        None => {
            let word = section.word("direction", words)?.map_or(WORDS[0], |word| word.value);
            (word, read_word(word, section, folder, files)?)
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
            return Err(section.error(&section.key_span(key), format!("`{key}` names {what}"), cure));
        }
    }
    Ok(direction)
}

/// The direction of a word with the keys that belong to it; `None` for the shortest path.
fn read_word(
    word: &str,
    section: &Section<'_>,
    folder: &Path,
    files: &mut Vec<NamedFile>,
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
                return Err(section.error(&section.key_span("direction"), "no `guides` to follow", cure));
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
            files.push(NamedFile::beside(folder, file.value, file.span));
            FeedDirection::Samples(unread())
        }
        _ => FeedDirection::WidestStrip,
    }))
}

/// `{ blend = [{ direction = "steepest", weight = 2.0 }, ...] }`.
fn read_blend(
    table: &Section<'_>,
    folder: &Path,
    files: &mut Vec<NamedFile>,
) -> Result<FeedDirection, SceneError> {
    table.only(&["blend"], &["angle"], "a blend of directions")?;
    let keys: Vec<&str> = KEYS.into_iter().chain(["weight"]).collect();
    let parts = table.sections("blend")?;
    if parts.len() < 2 {
        return Err(table.error(
            &table.key_span("blend"),
            "a blend takes two directions or more",
            "write `blend = [{ direction = \"widest-strip\", weight = 2 }, { direction = \"steepest\" }]`",
        ));
    }
    let read_part = |part: &Section<'_>| {
        part.only(&keys, &[], "a direction of a blend")?;
        if !part.has("direction") {
            return part.required_word("direction", &WORDS).map(|_| (FeedDirection::WidestStrip, 0.0));
        }
        if part.inline("direction").is_some_and(|inner| inner.has("blend")) {
            let cure = "give all directions and their weights in one blend";
            return Err(part.error(&part.key_span("direction"), "a blend cannot be blended again", cure));
        }
        // The words leave the shortest path out, so that there is always a direction.
        let direction = read_one(part, &WORDS, folder, files)?.unwrap_or(FeedDirection::WidestStrip);
        Ok((direction, part.number("weight", WEIGHT, "")?.map_or(1.0, |weight| weight.value)))
    };
    Ok(FeedDirection::Blend(parts.iter().map(read_part).collect::<Result<_, SceneError>>()?))
}

/// Stands for the samples of a file that is not read yet.
fn unread() -> Arc<LineField> {
    let one = LineSample { at: [0.0; 2], line: [1.0, 0.0], weight: 1.0 };
    Arc::new(
        LineField::new(SamplePlane::Plan, &[one]).expect("a sample with length and weight makes a field"),
    )
}

/// Reads the files of a direction, in the order in which [`read`] found them.
pub(super) fn load(
    direction: &mut FeedDirection,
    files: &mut std::slice::Iter<'_, NamedFile>,
    source: &SceneText,
) -> Result<(), SceneError> {
    match direction {
        FeedDirection::Samples(samples) => {
            let Some(file) = files.next() else { return Ok(()) };
            let table = direction_table::read(&file.path).map_err(|e| {
                let message = format!("the file of directions cannot be used: {e}");
                source.error(file.span.clone(), message, "mend that file or name another one")
            })?;
            *samples = Arc::new(table);
            Ok(())
        }
        FeedDirection::Blend(parts) => parts.iter_mut().try_for_each(|(part, _)| load(part, files, source)),
        _ => Ok(()),
    }
}

/// `direction = ...` and the keys that belong to it, joined by `separator`: lines of a toolpath, or entries of a table.
pub(super) fn write(
    out: &mut String,
    direction: &FeedDirection,
    files: &mut std::slice::Iter<'_, NamedFile>,
    separator: &str,
) -> fmt::Result {
    let across = |sense: Sense| format!("across = {}", sense == Sense::Across);
    let word = |out: &mut String, word: &str| write!(out, "direction = \"{word}\"");
    match direction {
        FeedDirection::Parameter(Along::U) => word(out, "u"),
        FeedDirection::Parameter(Along::V) => word(out, "v"),
        FeedDirection::Angle(angle) => {
            write!(out, "direction = {{ angle = {} }}", number(angle.to_degrees()))
        }
        FeedDirection::WidestStrip => word(out, "widest-strip"),
        FeedDirection::Steepest => word(out, "steepest"),
        FeedDirection::Contour => word(out, "contour"),
        FeedDirection::Samples(_) => {
            let file = files.next().map_or_else(|| "directions.txt".to_owned(), |file| file.written.clone());
            write!(out, "direction = \"file\"{separator}directions = {}", text(&file))
        }
        FeedDirection::Guides { curves, sense } => {
            let points = curves.iter().map(|curve| {
                let points = curve.iter().map(|p| format!("[{}, {}]", number(p.x), number(p.y)));
                format!("[{}]", points.collect::<Vec<_>>().join(", "))
            });
            let curves = points.collect::<Vec<_>>().join(", ");
            write!(out, "direction = \"guide\"{separator}guides = [{curves}]{separator}{}", across(*sense))
        }
        FeedDirection::Border(sense) => write!(out, "direction = \"border\"{separator}{}", across(*sense)),
        FeedDirection::Blend(parts) => {
            write!(out, "direction = {{ blend = [")?;
            for (k, (part, weight)) in parts.iter().enumerate() {
                write!(out, "{}{{ ", if k > 0 { ", " } else { "" })?;
                write(out, part, files, ", ")?;
                write!(out, ", weight = {} }}", number(*weight))?;
            }
            write!(out, "] }}")
        }
    }
}
