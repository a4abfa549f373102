//! The classical strategies of a scene: zigzag, iso-parametric, iso-scallop, waterline, spiral, offset
//! surfaces.

use std::fmt::{self, Write as _};

use super::write::number;
use keys::SceneError;
use keys::Section;
use toolpath::{Along, FrontStart, LevelSteps, OffsetAlong, OffsetDrive, Strategy};

/// Their words.
pub(super) const WORDS: [&str; 6] =
    ["zigzag", "iso-parametric", "iso-scallop", "waterline", "spiral", "offset-surface"];

/// All keys that one of them has.
pub(super) const KEYS: [&str; 7] = ["angle", "one_way", "along", "step", "start", "kind", "offset"];

/// Words for `step` where levels are parameters, and where they are heights.
const STEPS: [(&str, LevelSteps); 3] =
    [("shortest", LevelSteps::Shortest), ("constant", LevelSteps::Constant), ("least", LevelSteps::Least)];
const HEIGHT_STEPS: [(&str, LevelSteps); 2] =
    [("adaptive", LevelSteps::Shortest), ("constant", LevelSteps::Constant)];

/// Words for `start`.
const STARTS: [(&str, FrontStart); 6] = [
    ("best", FrontStart::BestBorder),
    ("u-min", FrontStart::Border { constant: Along::U, greatest: false }),
    ("u-max", FrontStart::Border { constant: Along::U, greatest: true }),
    ("v-min", FrontStart::Border { constant: Along::V, greatest: false }),
    ("v-max", FrontStart::Border { constant: Along::V, greatest: true }),
    ("all", FrontStart::AllBorders),
];

/// Keys of the line that a front starts on, in shares of the parameters' ranges.
const LINE: [&str; 4] = ["from_u", "from_v", "to_u", "to_v"];

/// Ends of a line closer than this share of the parameters' ranges give it no direction.
const LEAST_LINE: f64 = 1e-6;

/// The keys of one of the strategies; `None` for any other word.
pub(super) fn keys(word: &str) -> Option<&'static [&'static str]> {
    Some(match word {
        "zigzag" => &["angle", "one_way"],
        "iso-parametric" => &["along", "step"],
        "iso-scallop" => &["start"],
        "waterline" => &["step"],
        "spiral" => &["kind"],
        "offset-surface" => &["along", "angle", "offset"],
        _ => return None,
    })
}

/// The strategy that a word stands for with the section's keys; `None` for any other word.
pub(super) fn read(word: &str, section: &Section<'_>) -> Result<Option<Strategy>, SceneError> {
    Ok(Some(match word {
        "zigzag" => read_zigzag(section)?,
        "iso-parametric" => {
            let along = match section.word("along", &["u", "v", "best"])?.map_or("u", |word| word.value) {
                "best" => None,
                "v" => Some(Along::V),
                _ => Some(Along::U),
            };
            match (along, one_of(section, "step", &STEPS)?) {
                (Some(along), LevelSteps::Shortest) => Strategy::IsoParametric { along },
                (along, steps) => Strategy::IsoParametricSteps { along, steps },
            }
        }
        "iso-scallop" => Strategy::IsoScallop { start: read_start(section)? },
        "waterline" => Strategy::Waterline { steps: one_of(section, "step", &HEIGHT_STEPS)? },
        "spiral" => match section.word("kind", &["plan", "contour"])?.map(|word| word.value) {
            Some("contour") => Strategy::ContourSpiral,
            _ => Strategy::Spiral,
        },
        "offset-surface" => read_offset_surface(section)?,
        _ => return Ok(None),
    }))
}

/// The value of a word; the first one without the key.
fn one_of<T: Copy>(section: &Section<'_>, key: &str, values: &[(&'static str, T)]) -> Result<T, SceneError> {
    let words: Vec<&'static str> = values.iter().map(|(word, _)| *word).collect();
    let word = section.word(key, &words)?.map_or(words[0], |word| word.value);
    Ok(values.iter().find(|(other, _)| *other == word).unwrap_or(&values[0]).1)
}

fn read_zigzag(section: &Section<'_>) -> Result<Strategy, SceneError> {
    let one_way = section.flag("one_way")?.unwrap_or(false);
    if section.is_text("angle") {
        section.word("angle", &["best"])?;
        return Ok(Strategy::BestZigzag { one_way });
    }
    let angle = section.number("angle", -360.0..=360.0, " degrees")?;
    Ok(Strategy::Zigzag { angle: angle.map_or(0.0, |v| v.value.to_radians()), one_way })
}

fn read_offset_surface(section: &Section<'_>) -> Result<Strategy, SceneError> {
    let drive = match section.word("offset", &["normal", "in-plane"])?.map(|word| word.value) {
        Some("in-plane") => OffsetDrive::InPlane,
        _ => OffsetDrive::Exact,
    };
    let angle = section.number("angle", -360.0..=360.0, " degrees")?;
    let along = match section.word("along", &["u", "v", "spiral"])?.map(|word| word.value) {
        Some(_) if angle.is_some() => {
            return Err(section.error(
                &section.key_span("angle"),
                "passes run along a parameter or at an angle, not both",
                "delete `angle` on patches and blades, `along` on meshes",
            ));
        }
        Some("v") => OffsetAlong::V,
        Some("spiral") => OffsetAlong::Spiral,
        _ => angle.map_or(OffsetAlong::U, |angle| OffsetAlong::Angle(angle.value.to_radians())),
    };
    Ok(Strategy::OffsetSurface { along, drive })
}

fn read_start(section: &Section<'_>) -> Result<FrontStart, SceneError> {
    let Some(table) = section.inline("start") else { return one_of(section, "start", &STARTS) };
    table.only(&LINE, &[], "a line to start from")?;
    let mut line = [0.0; 4];
    for (x, (key, example)) in line.iter_mut().zip(LINE.into_iter().zip([0.5, 0.0, 0.5, 1.0])) {
        *x = table.required_number(key, 0.0..=1.0, " (share of the parameter's range)", example)?.value;
    }
    let [a, b, c, d] = line;
    if (c - a).hypot(d - b) < LEAST_LINE {
        return Err(section.error(
            table.header(),
            "the line to start from begins and ends at the same place",
            "give it two places, such as `start = { from_u = 0.5, from_v = 0.0, to_u = 0.5, to_v = 1.0 }`",
        ));
    }
    Ok(FrontStart::Line([[a, b], [c, d]]))
}

/// The word of a strategy; `None` when it is none of these.
pub(super) fn name(strategy: &Strategy) -> Option<&'static str> {
    Some(match strategy {
        Strategy::Zigzag { .. } | Strategy::BestZigzag { .. } => "zigzag",
        Strategy::IsoParametric { .. } | Strategy::IsoParametricSteps { .. } => "iso-parametric",
        Strategy::IsoScallop { .. } => "iso-scallop",
        Strategy::Waterline { .. } => "waterline",
        Strategy::Spiral | Strategy::ContourSpiral => "spiral",
        Strategy::OffsetSurface { .. } => "offset-surface",
        Strategy::Pocket(_) | Strategy::ShortestStreamline { .. } | Strategy::Streamline { .. } => {
            return None;
        }
    })
}

/// Writes the keys of one of the strategies; of any other nothing.
pub(super) fn write(out: &mut String, strategy: &Strategy) -> fmt::Result {
    let word = |values: &[(&'static str, LevelSteps)], steps: LevelSteps| {
        values.iter().find(|(_, s)| *s == steps).map_or("shortest", |(word, _)| word)
    };
    let along = |along: Along| if along == Along::U { "u" } else { "v" };
    match *strategy {
        Strategy::Zigzag { angle, one_way } => {
            writeln!(out, "angle = {}  # degrees from the x axis", number(angle.to_degrees()))?;
            writeln!(out, "one_way = {one_way}")
        }
        Strategy::BestZigzag { one_way } => {
            writeln!(out, "angle = \"best\"  # searched")?;
            writeln!(out, "one_way = {one_way}")
        }
        Strategy::IsoParametric { along: a } => {
            writeln!(out, "along = \"{}\"\nstep = \"shortest\"", along(a))
        }
        Strategy::IsoParametricSteps { along: a, steps } => {
            writeln!(out, "along = \"{}\"", a.map_or("best", along))?;
            writeln!(out, "step = \"{}\"", word(&STEPS, steps))
        }
        Strategy::IsoScallop { start: FrontStart::Line(line) } => {
            let places = LINE.iter().zip(line.concat()).map(|(key, x)| format!("{key} = {}", number(x)));
            writeln!(out, "start = {{ {} }}", places.collect::<Vec<_>>().join(", "))
        }
        Strategy::IsoScallop { start } => {
            let word = STARTS.iter().find(|(_, s)| *s == start).map_or("best", |(word, _)| word);
            writeln!(out, "start = \"{word}\"")
        }
        Strategy::Waterline { steps } => writeln!(out, "step = \"{}\"", word(&HEIGHT_STEPS, steps)),
        Strategy::Spiral => writeln!(out, "kind = \"plan\""),
        Strategy::ContourSpiral => writeln!(out, "kind = \"contour\""),
        Strategy::OffsetSurface { along, ref drive } => {
            match along {
                OffsetAlong::U => writeln!(out, "along = \"u\"")?,
                OffsetAlong::V => writeln!(out, "along = \"v\"")?,
                OffsetAlong::Spiral => writeln!(out, "along = \"spiral\"")?,
                OffsetAlong::Angle(angle) => {
                    writeln!(out, "angle = {}  # degrees from the x axis", number(angle.to_degrees()))?;
                }
            }
            let exact = *drive == OffsetDrive::Exact;
            writeln!(out, "offset = \"{}\"", if exact { "normal" } else { "in-plane" })
        }
        Strategy::Pocket(_) | Strategy::ShortestStreamline { .. } | Strategy::Streamline { .. } => Ok(()),
    }
}
