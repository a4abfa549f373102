//! The pocket's part of a scene: its outline and depth.

use std::fmt::Write as _;
use std::path::Path;

use super::{NamedFile, PartSource};
use geometry::{Point2, Region, RegionError};
use io::outline::OutlineFormat;
use keys::{SceneError, Section, toml_number as number, toml_string as text};

/// The word for `surface`.
pub(super) const SURFACE: &str = "pocket";
/// Keys of a pocket in `[part]`.
pub(super) const PART_KEYS: [&str; 7] = ["surface", "file", "unit", "layer", "outline", "islands", "depth"];
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

#[cfg(test)]
mod tests {
    use crate::{Scene, SceneError, complete_toml};
    use toolpath::{PartKind, STRATEGIES};

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
    fn a_strategy_for_other_parts_is_answered_with_all_that_apply() {
        let cure = |text: String| match Scene::parse("tray.toml", text) {
            Err(SceneError::Invalid(finding)) => finding.cure.clone(),
            other => panic!("{other:?}"),
        };
        let of = |kind| STRATEGIES.iter().filter(move |strategy| strategy.part == kind);
        let text = cure(TRAY.replace("pocket-zigzag\"\nangle = 20", "zigzag\""));
        assert!(of(PartKind::Pocket).all(|strategy| text.contains(strategy.word)), "{text}");
        let plane = "[part]\nsurface = \"plane\"\nx = [0, 60]\ny = [0, 40]\n";
        let text = cure(format!("{plane}{}", &TRAY[TRAY.find("[cutter]").unwrap()..]));
        assert!(of(PartKind::Surface).all(|strategy| text.contains(strategy.word)), "{text}");
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
