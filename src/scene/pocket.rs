//! The pocket's part of a scene: its outline, and the strategies that mill it.

use std::fmt::Write as _;
use std::path::Path;

use super::write::{number, text};
use super::{NamedFile, PartSource};
use geometry::{Point2, Region, RegionError};
use io::outline::OutlineFormat;
use keys::SceneError;
use keys::{LENGTH, Section};
use toolpath::{Flow, Pattern, PocketStrategy, Step};

/// The word for `surface`.
pub(super) const SURFACE: &str = "pocket";
/// Keys of a pocket in `[part]`.
pub(super) const PART_KEYS: [&str; 7] = ["surface", "file", "unit", "layer", "outline", "islands", "depth"];
/// The strategies.
pub(super) const STRATEGIES: [&str; 3] = ["pocket-flow", "pocket-offset", "pocket-zigzag"];
/// Keys of all of them.
const KEYS: [&str; 7] =
    ["stepover", "stepdown", "floor_allowance", "wall_allowance", "ramp_angle", "helix_radius", "engagement"];
/// Keys of some of them.
pub(super) const ALL_KEYS: [&str; 9] = [
    "stepdown",
    "floor_allowance",
    "wall_allowance",
    "ramp_angle",
    "helix_radius",
    "engagement",
    "spiral",
    "smoothing",
    "angle",
];
/// Stepover over the cutter's diameter by default: 78 degrees of engagement.
const STEPOVER_OVER_DIAMETER: f64 = 0.4;
/// Stepdown over the cutter's diameter by default.
const STEPDOWN_OVER_DIAMETER: f64 = 0.5;
/// Ramp angle by default, degrees: what most end mills take in steel and all in aluminium.
const RAMP_ANGLE: f64 = 3.0;

/// Where the outlines of a pocket come from.
#[derive(Debug, Clone, PartialEq)]
pub enum OutlineSource {
    /// A drawing.
    File {
        /// The file.
        file: NamedFile,
        /// Its kind, from its extension.
        format: OutlineFormat,
        /// Name of the unit of its coordinates and that in mm; `None`: as the file says.
        unit: Option<(&'static str, f64)>,
        /// The layer, id or label that is wanted.
        layer: Option<String>,
    },
    /// Points in the scene, mm: the outline first, then the islands. Checked.
    Points {
        /// The curves.
        curves: Vec<Vec<Point2>>,
    },
}

/// Reads a pocket from `[part]`. `units` are names and their mm.
pub(super) fn read_source(
    part: &Section<'_>,
    units: &[(&'static str, f64)],
    named: impl Fn(keys::Located<&str>) -> NamedFile,
) -> Result<PartSource, SceneError> {
    let from_points = part.has("outline") && !part.has("file");
    let keys: &[&str] = if from_points {
        &["surface", "outline", "islands", "depth"]
    } else {
        &["surface", "file", "unit", "layer", "depth"]
    };
    part.only(
        keys,
        &PART_KEYS,
        if from_points { "a pocket from points" } else { "a pocket from a drawing" },
    )?;
    let depth = part.required_length("depth", 6.0)?.value;
    let outline = if from_points {
        let outline = part.points("outline")?;
        let mut spans = vec![outline.span];
        let mut curves = vec![outline.value];
        for island in part.curves("islands")? {
            spans.push(island.span);
            curves.push(island.value);
        }
        check(part, &curves, &spans)?;
        OutlineSource::Points { curves }
    } else {
        let file = part.required_text("file", "pocket.dxf")?;
        let extension = Path::new(file.value).extension().map(|e| e.to_string_lossy().to_lowercase());
        let format = match extension.as_deref() {
            Some("dxf") => OutlineFormat::Dxf,
            Some("svg") => OutlineFormat::Svg,
            _ => {
                return Err(part.error(
                    &file.span,
                    format!("\"{}\" is no kind of drawing that can be read", file.value),
                    "name a file that ends in .dxf or .svg, or write `outline = [[x, y], ...]`",
                ));
            }
        };
        let words: Vec<&'static str> = units.iter().map(|u| u.0).collect();
        let unit =
            part.word("unit", &words)?.and_then(|word| units.iter().find(|u| u.0 == word.value).copied());
        let layer = part.text("layer")?.map(|l| l.value.to_owned());
        OutlineSource::File { file: named(file), format, unit, layer }
    };
    Ok(PartSource::Pocket { outline, depth })
}

/// Refuses points that bound no region, at the list that is wrong.
fn check(
    part: &Section<'_>,
    curves: &[Vec<Point2>],
    spans: &[std::ops::Range<usize>],
) -> Result<(), SceneError> {
    let name = |k: usize| if k == 0 { "the outline".to_owned() } else { format!("island {k}") };
    match Region::nested(curves.to_vec()) {
        Ok((_, depths)) => {
            let wrong = depths.iter().enumerate().position(|(k, d)| *d != usize::from(k > 0));
            let Some(k) = wrong else { return Ok(()) };
            let message = match depths[k] {
                0 => format!("{} lies outside of the outline", name(k)),
                _ if k == 0 => "the outline lies inside of an island".to_owned(),
                _ => format!("{} lies inside of another island", name(k)),
            };
            Err(part.error(&spans[k], message, "islands lie inside of the outline and apart from each other"))
        }
        Err(e) => {
            let (k, message) = match e {
                RegionError::Crossing { curves: [a, b], at } => {
                    (b, format!("{} and {} meet at x {:.4} y {:.4}", name(a), name(b), at.x, at.y))
                }
                RegionError::Duplicate { curves: [a, b] } => {
                    (b, format!("{} and {} are the same", name(a), name(b)))
                }
                RegionError::Coordinate { curve, .. }
                | RegionError::NoArea { curve }
                | RegionError::SelfCrossing { curve, .. } => (curve, format!("{}: {e}", name(curve))),
                RegionError::Empty | RegionError::TooManyPoints(_) => (0, e.to_string()),
            };
            Err(part.error(
                &spans[k],
                message,
                "write the corners in order, each once: `[[0, 0], [60, 0], [60, 40]]`",
            ))
        }
    }
}

/// Reads a strategy for pockets and its stepover.
pub(super) fn read_strategy(
    section: &Section<'_>,
    word: &str,
    radius: f64,
) -> Result<(PocketStrategy, Step), SceneError> {
    let own: &[&str] = match word {
        "pocket-flow" => &["spiral", "smoothing"],
        "pocket-offset" => &["spiral"],
        _ => &["angle"],
    };
    let keys: Vec<&str> = ["name", "strategy"].iter().chain(&KEYS).chain(own).copied().collect();
    let mut all = ALL_KEYS.to_vec();
    all.extend(["scallop", "one_way", "along", "direction", "control_points"]);
    section.only(&keys, &all, &format!("strategy = \"{word}\""))?;
    let spiral = section.flag("spiral")?.unwrap_or(false);
    let length = |key| Ok::<Option<f64>, SceneError>(section.length(key)?.map(|v| v.value));
    let allowance = |key| {
        Ok::<f64, SceneError>(section.number(key, 0.0..=*LENGTH.end(), " mm")?.map_or(0.0, |v| v.value))
    };
    let pattern = match word {
        "pocket-flow" => Pattern::Flow(Flow { smoothing: length("smoothing")?, spiral }),
        "pocket-offset" => Pattern::Offset { spiral },
        _ => Pattern::Zigzag {
            angle: section.number("angle", -360.0..=360.0, " degrees")?.map_or(0.0, |v| v.value.to_radians()),
        },
    };
    let strategy = PocketStrategy {
        pattern,
        stepdown: Some(length("stepdown")?.unwrap_or(2.0 * STEPDOWN_OVER_DIAMETER * radius)),
        floor_allowance: allowance("floor_allowance")?,
        wall_allowance: allowance("wall_allowance")?,
        ramp_angle: section
            .number("ramp_angle", 0.1..=45.0, " degrees")?
            .map_or(RAMP_ANGLE, |v| v.value)
            .to_radians(),
        helix_radius: length("helix_radius")?,
        engagement: section.number("engagement", 10.0..=180.0, " degrees")?.map(|v| v.value.to_radians()),
    };
    let step = match section.length("stepover")? {
        Some(step) if step.value > 1.9 * radius => {
            let message = format!(
                "`stepover` is {} mm, more than 0.95 of the cutter's diameter of {} mm",
                step.value,
                2.0 * radius
            );
            return Err(section.error(&step.span, message, "write less, or material stays between passes"));
        }
        Some(step) => step.value,
        // Rounded, so that it reads back as it was written.
        None => (2.0 * STEPOVER_OVER_DIAMETER * radius * 1e6).round() / 1e6,
    };
    Ok((strategy, Step::Stepover(step)))
}

/// `[part]` of a pocket.
pub(super) fn write_source(out: &mut String, outline: &OutlineSource, depth: f64) -> std::fmt::Result {
    writeln!(out, "surface = \"{SURFACE}\"")?;
    match outline {
        OutlineSource::File { file, unit, layer, .. } => {
            writeln!(out, "file = {}", text(&file.written))?;
            if let Some((unit, _)) = unit {
                writeln!(out, "unit = {}", text(unit))?;
            }
            if let Some(layer) = layer {
                writeln!(out, "layer = {}", text(layer))?;
            }
        }
        OutlineSource::Points { curves } => {
            let point = |p: &Point2| format!("[{}, {}]", number(p.x), number(p.y));
            let list = |c: &Vec<Point2>| format!("[{}]", c.iter().map(point).collect::<Vec<_>>().join(", "));
            writeln!(out, "outline = {}  # mm", list(&curves[0]))?;
            let islands: Vec<String> = curves[1..].iter().map(list).collect();
            writeln!(out, "islands = [{}]", islands.join(", "))?;
        }
    }
    writeln!(out, "depth = {}  # mm below z = 0", number(depth))
}

/// What a toolpath says of its strategy.
pub(super) fn write_strategy(out: &mut String, s: &PocketStrategy) -> std::fmt::Result {
    match s.pattern {
        Pattern::Flow(flow) => {
            writeln!(out, "spiral = {}", flow.spiral)?;
            if let Some(smoothing) = flow.smoothing {
                writeln!(out, "smoothing = {}  # mm", number(smoothing))?;
            }
        }
        Pattern::Offset { spiral } => writeln!(out, "spiral = {spiral}")?,
        Pattern::Zigzag { angle } => {
            writeln!(out, "angle = {}  # degrees from the x axis", number(angle.to_degrees()))?
        }
    }
    if let Some(stepdown) = s.stepdown {
        writeln!(out, "stepdown = {}  # mm", number(stepdown))?;
    }
    writeln!(out, "floor_allowance = {}  # mm, left for a last step", number(s.floor_allowance))?;
    writeln!(out, "wall_allowance = {}  # mm, left for a last pass", number(s.wall_allowance))?;
    writeln!(out, "ramp_angle = {}  # degrees", number(s.ramp_angle.to_degrees()))?;
    if let Some(radius) = s.helix_radius {
        writeln!(out, "helix_radius = {}  # mm", number(radius))?;
    }
    if let Some(angle) = s.engagement {
        writeln!(out, "engagement = {}  # degrees", number(angle.to_degrees()))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use crate::{Scene, complete_toml};

    const TRAY: &str = "[part]\nsurface = \"pocket\"\noutline = [[0, 0], [60, 0], [60, 40], [0, 40]]\n\
        islands = [[[20, 10], [30, 10], [30, 20]]]\ndepth = 5\n[cutter]\nshape = \"flat\"\ndiameter = 6\n\
        [[toolpath]]\nstrategy = \"pocket-flow\"\nspiral = true\nengagement = 80\n[[toolpath]]\nstrategy = \"pocket-zigzag\"\nangle = 20\n";

    fn refusal(from: &str, to: &str) -> String {
        assert!(TRAY.contains(from));
        Scene::parse("tray.toml", TRAY.replace(from, to)).unwrap_err().to_string()
    }

    #[test]
    fn a_pocket_is_read_and_written_again() {
        let scene = Scene::parse("tray.toml", TRAY).unwrap();
        assert_eq!((scene.stock.allowance, scene.stock.margin), (0.0, 3.0));
        let text = complete_toml(&scene);
        let again = Scene::parse("tray.toml", text.clone()).unwrap();
        assert_eq!((&again.part, &again.toolpaths), (&scene.part, &scene.toolpaths), "{text}");
        assert_eq!(complete_toml(&again), text);
    }

    #[test]
    fn wrong_pockets_are_refused_with_the_reason() {
        for (from, to, words) in [
            ("[60, 40], [0, 40]", "[0, 40], [60, 40]", "the outline: it crosses itself at x 30"),
            ("[30, 20]", "[80, 20]", "meet at"),
            (
                "[[20, 10], [30, 10], [30, 20]]",
                "[[80, 10], [90, 10], [90, 20]]",
                "island 1 lies outside of the outline",
            ),
            ("[[20, 10], [30, 10], [30, 20]]", "[[20, 10], [30, 10]]", "island 1: it encloses no area"),
            ("[[20, 10], [30, 10], [30, 20]]", "[[0, 0], [60, 0], [60, 40], [0, 40]]", "are the same"),
            ("[30, 20]", "[30, nan]", "NaN"),
            ("[30, 20]", "[30, 1e9]", "1000000000"),
            ("[30, 20]", "[30, 20, 5]", "points of two numbers"),
            ("outline = [[0, 0], [60, 0], [60, 40], [0, 40]]", "file = \"a.png\"", "islands"),
            ("pocket-zigzag\"\nangle = 20", "zigzag\"", "does not mill a pocket"),
            ("angle = 20", "spiral = true", "does not apply"),
            ("spiral = true", "stepover = 6", "more than 0.95"),
        ] {
            let text = refusal(from, to);
            assert!(text.contains(words), "{to}: {text}");
        }
    }
}
