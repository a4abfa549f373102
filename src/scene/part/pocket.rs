//! A pocket as the part of a scene: its region from a drawing or from points, its open sides, what was
//! cleared before, and the floor that is measured.

use std::fmt::{self, Write as _};
use std::path::Path;

use field::fill;
use geometry::{Point2, Point3, Region, RegionError, TriangleMesh};
use io::outline::{self, OutlineFormat, OutlineOptions};
use keys::{SceneError, Section, toml_number, toml_points, toml_string};
use part::Part;
use toolpath::Pocket;
use work::monitor::Silent;

use super::mesh::UNITS;
use super::source::{LoadError, Loaded, Loading, PartTable, Source};
use crate::named_file::NamedFile;

/// The word for `surface`.
const SURFACE: &str = "pocket";

/// Share of the chord tolerance that drawings are flattened to: passes have the rest ...
const OF_CHORD: f64 = 0.5;

/// ... and no more than this share of the gouge tolerance: the bounds of walls have what chords are off the
/// curves.
const OF_GOUGE: f64 = 0.1;

/// The distance within which the chords of drawings lie off their curves, mm.
pub(crate) fn flattening(tolerance: &metrology::Limits) -> f64 {
    (OF_CHORD * tolerance.chord).min(OF_GOUGE * tolerance.gouge)
}

/// The floor is measured up to this many chord tolerances from its walls, where chords of the last pass
/// leave as much ...
const CHORDS_FROM_WALLS: f64 = 2.0;

/// ... and to this share of the cutter's radius, by which offsets keep to the safe side.
const RADIUS_FROM_WALLS: f64 = 5.0e-4;

/// Beyond open sides nothing stands as far as this over the radius behind the edge of the block.
const BEYOND_EDGE: f64 = 0.05;

/// The largest cutter that would fit is told to this, mm.
const PRECISION: f64 = 0.005;

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
        /// Place of the outline in the scene.
        span: Place,
    },
}

/// Where something stands in a scene: no part of what it is, so that all places are equal.
#[derive(Debug, Clone)]
pub struct Place(pub std::ops::Range<usize>);

impl PartialEq for Place {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// A plane region with islands, cut down to a level floor.
#[derive(Debug, Clone, PartialEq)]
pub struct PocketSource {
    /// Its outlines.
    pub outline: OutlineSource,
    /// How far its floor lies below z = 0, mm.
    pub depth: f64,
    /// Lines along its outline beyond which there is no stock, mm.
    pub open: Vec<OpenLine>,
    /// What cleared it before, if anything did.
    pub cleared: Option<EarlierCutter>,
}

/// Points of a line along open sides, mm, and where the scene has them.
#[derive(Debug, Clone, PartialEq)]
pub struct OpenLine {
    /// The points.
    pub points: Vec<Point2>,
    /// Place in the scene.
    pub span: std::ops::Range<usize>,
}

/// A larger flat end mill that went everywhere in a pocket that it fits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EarlierCutter {
    /// Its diameter, mm.
    pub diameter: f64,
    /// What it left at the walls, mm.
    pub allowance: f64,
}

/// The keys beside those of the outline.
const OTHERS: [&str; 4] = ["depth", "open", "cleared_by", "cleared_allowance"];

impl Source for PocketSource {
    const EXTENSIONS: &'static [&'static str] = &outline::EXTENSIONS;

    fn surfaces() -> Vec<&'static str> {
        vec![SURFACE]
    }

    fn keys() -> Vec<&'static str> {
        ["file", "unit", "layer", "outline", "islands"].into_iter().chain(OTHERS).collect()
    }

    fn read(table: &PartTable<'_>) -> Result<Self, SceneError> {
        let part = table.table;
        let from_points = part.has("outline") && !part.has("file");
        let (keys, what): (&[&str], _) = if from_points {
            (&["surface", "outline", "islands"], "a pocket from points")
        } else {
            (&["surface", "file", "unit", "layer"], "a pocket from a drawing")
        };
        table.only(&[keys, &OTHERS].concat(), what)?;
        let depth = part.required_length("depth", 6.0)?.value;
        let outline = if from_points { read_points(part)? } else { read_drawing(table)? };
        Ok(Self { outline, depth, open: read_open(part)?, cleared: read_cleared(part)? })
    }

    fn write(&self, out: &mut String) -> fmt::Result {
        writeln!(out, "surface = \"{SURFACE}\"")?;
        match &self.outline {
            OutlineSource::File { file, unit, layer, .. } => {
                writeln!(out, "file = {}", toml_string(&file.written))?;
                if let Some((unit, _)) = unit {
                    writeln!(out, "unit = {}", toml_string(unit))?;
                }
                if let Some(layer) = layer {
                    writeln!(out, "layer = {}", toml_string(layer))?;
                }
            }
            OutlineSource::Points { curves, .. } => {
                writeln!(out, "outline = {}  # mm", toml_points(&curves[0]))?;
                let islands: Vec<String> = curves[1..].iter().map(|curve| toml_points(curve)).collect();
                writeln!(out, "islands = [{}]", islands.join(", "))?;
            }
        }
        writeln!(out, "depth = {}  # mm below z = 0", toml_number(self.depth))?;
        if !self.open.is_empty() {
            let lines: Vec<String> = self.open.iter().map(|line| toml_points(&line.points)).collect();
            writeln!(out, "open = [{}]  # mm, along sides without a wall", lines.join(", "))?;
        }
        if let Some(EarlierCutter { diameter, allowance }) = self.cleared {
            writeln!(
                out,
                "cleared_by = {}  # mm, diameter of an earlier flat end mill",
                toml_number(diameter)
            )?;
            writeln!(out, "cleared_allowance = {}  # mm that it left at the walls", toml_number(allowance))?;
        }
        Ok(())
    }

    fn file(&self) -> Option<&NamedFile> {
        match &self.outline {
            OutlineSource::File { file, .. } => Some(file),
            OutlineSource::Points { .. } => None,
        }
    }

    /// The floor that the cutter can reach, as far as its passes come.
    fn load(&self, job: &Loading<'_>) -> Result<Loaded, LoadError> {
        let (pocket, notes) = self.pocket(job)?;
        let part = self.floor(&pocket, job)?;
        Ok(Loaded { pocket: Some(pocket), notes, ..Loaded::from(part) })
    }
}

fn read_open(part: &Section<'_>) -> Result<Vec<OpenLine>, SceneError> {
    let line = |line: keys::Located<Vec<Point2>>| {
        let valid = |p: &Point2| p.coords.iter().all(|x| x.abs() <= geometry::MAX_COORDINATE);
        if line.value.len() < 2 || !line.value.iter().all(valid) {
            let message = "a line along open sides needs two points or more";
            return Err(part.error(&line.span, message, "write its ends: `open = [[[60, 0], [60, 40]]]`"));
        }
        Ok(OpenLine { points: line.value, span: line.span })
    };
    part.curves("open")?.into_iter().map(line).collect()
}

fn read_cleared(part: &Section<'_>) -> Result<Option<EarlierCutter>, SceneError> {
    let allowance = part.number("cleared_allowance", 0.0..=*keys::LENGTH.end(), " mm")?;
    match (part.length("cleared_by")?, allowance) {
        (Some(by), left) => {
            let allowance = left.map_or(0.0, |left| left.value);
            Ok(Some(EarlierCutter { diameter: by.value, allowance }))
        }
        (None, Some(left)) => Err(part.error(
            &left.span,
            "`cleared_allowance` needs `cleared_by`",
            "add the diameter of the flat end mill that cleared the pocket: `cleared_by = 12`",
        )),
        (None, None) => Ok(None),
    }
}

fn read_points(part: &Section<'_>) -> Result<OutlineSource, SceneError> {
    let outline = part.points("outline")?;
    let mut spans = vec![outline.span];
    let mut curves = vec![without_repeats(outline.value)];
    for island in part.curves("islands")? {
        spans.push(island.span);
        curves.push(without_repeats(island.value));
    }
    check(part, &curves, &spans)?;
    Ok(OutlineSource::Points { curves, span: Place(spans.swap_remove(0)) })
}

fn read_drawing(table: &PartTable<'_>) -> Result<OutlineSource, SceneError> {
    let part = table.table;
    let file = part.required_text("file", "pocket.dxf")?;
    let unsupported = || {
        let known: Vec<String> =
            outline::EXTENSIONS.iter().map(|extension| format!(".{extension}")).collect();
        part.error(
            &file.span,
            format!("Unsupported drawing format: \"{}\". Supported: {}", file.value, known.join(", ")),
            format!("name a file that ends in {}, or write `outline = [[x, y], ...]`", known.join(" or ")),
        )
    };
    let format = OutlineFormat::of(Path::new(file.value)).ok_or_else(unsupported)?;
    let words: Vec<&'static str> = UNITS.iter().map(|u| u.0).collect();
    let unit = part.word("unit", &words)?.and_then(|word| UNITS.iter().find(|u| u.0 == word.value).copied());
    let layer = part.text("layer")?.map(|l| l.value.to_owned());
    Ok(OutlineSource::File { file: table.named(file), format, unit, layer })
}

/// Without points that repeat the one before, the first after the last, but for rounding.
fn without_repeats(mut points: Vec<Point2>) -> Vec<Point2> {
    let is_repeated = |a: &Point2, b: &Point2| (a - b).norm() <= outline::ROUNDING;
    points.dedup_by(|next, kept| is_repeated(next, kept));
    while points.len() > 3 && is_repeated(&points[0], &points[points.len() - 1]) {
        points.pop();
    }
    points
}

/// What mends a curve that crosses itself: often two of its points are meant as one, or it comes to one
/// corner twice.
fn cure_of_crossing(curve: &[Point2], at: &Point2) -> Option<String> {
    if curve.iter().filter(|p| (*p - at).norm() <= outline::ROUNDING).count() > 1 {
        return Some(format!(
            "it comes to [{}, {}] twice: what touches at a corner are pockets of their own, or islands of one curve",
            at.x, at.y
        ));
    }
    let next = |k: usize| (k + 1) % curve.len();
    let apart = |k: usize| (curve[k] - curve[next(k)]).norm();
    let near = |k: &usize| apart(*k) <= outline::JOIN_TOLERANCE;
    let beside = |k: &usize| (curve[*k] - at).norm().min((curve[next(*k)] - at).norm());
    let nearest = (0..curve.len()).filter(near).min_by(|a, b| beside(a).total_cmp(&beside(b)));
    let k = nearest.filter(|k| beside(k) <= outline::JOIN_TOLERANCE)?;
    let [a, b] = [curve[k], curve[next(k)]];
    Some(format!(
        "its points [{}, {}] and [{}, {}] lie {:.4} mm apart: delete one of them; an outline closes by itself",
        a.x,
        a.y,
        b.x,
        b.y,
        apart(k)
    ))
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
            let cure = match &e {
                RegionError::SelfCrossing { curve, at } => cure_of_crossing(&curves[*curve], at),
                RegionError::Crossing { curves: [0, _], .. } => Some(
                    "an island at the outline is a part of it: leave the island out, and lead the outline around it".into(),
                ),
                RegionError::Crossing { .. } => {
                    Some("write both islands as one: the curve around what they cover together".into())
                }
                RegionError::Duplicate { .. } => Some("delete one of them".into()),
                _ => None,
            };
            let in_order =
                || "write the corners in order, each once: `[[0, 0], [60, 0], [60, 40]]`".to_owned();
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
            Err(part.error(&spans[k], message, cure.unwrap_or_else(in_order)))
        }
    }
}

/// How wide the strip of floor beside walls is that is not measured, mm: what stands there is told by the
/// walls.
pub fn unmeasured_beside_walls(chord_tolerance: f64, radius: f64) -> f64 {
    CHORDS_FROM_WALLS * chord_tolerance + RADIUS_FROM_WALLS * radius
}

impl PocketSource {
    /// The pocket, and what is to be said about its drawing.
    ///
    /// # Errors
    /// [`SceneError::Invalid`] when the drawing is refused, at its name in the scene.
    fn pocket(&self, job: &Loading<'_>) -> Result<(Pocket, Vec<String>), SceneError> {
        let (region, mut notes, off_drawing) = match &self.outline {
            OutlineSource::File { file, format, unit, layer } => {
                let options = OutlineOptions {
                    chord_tolerance: job.flattening,
                    scale: unit.map(|u| u.1),
                    layer: layer.clone(),
                };
                let read = outline::read(&file.path, *format, &options).map_err(|e| {
                    let message = format!("the pocket's drawing cannot be used: {}: {e}", file.written);
                    job.source.error(file.span.clone(), message, "mend that file or name another one")
                })?;
                let notes = read.notes.iter().map(|note| format!("{}: {note}", file.written)).collect();
                (read.region, notes, read.off_curves)
            }
            OutlineSource::Points { curves, .. } => {
                let region = Region::nested(curves.clone()).map_err(|e| self.refused(job, &e.to_string()))?.0;
                (region, Vec::new(), 0.0)
            }
        };
        let mut pocket = Pocket::new(region, self.depth);
        pocket.off_drawing = off_drawing;
        let radius = job.cutter.radius();
        let mut lines: Vec<Vec<Point2>> = self.open.iter().map(|line| line.points.clone()).collect();
        let at_edge = at_stock_edge(&pocket.region, job);
        if !at_edge.is_empty() {
            let sides = if at_edge.len() == 1 { "side" } else { "sides" };
            notes.push(format!("open at the edge of the stock: {} {sides} of the outline", at_edge.len()));
        }
        lines.extend(at_edge);
        if !lines.is_empty() {
            pocket = pocket.opened(&lines, job.chord_tolerance, radius).map_err(|e| {
                let span = self.open.get(e.line).map_or(0..0, |line| line.span.clone());
                let cure = "write places of the outline, corners or others, in its order";
                job.source.error(span, format!("this line along open sides is none: {e}"), cure)
            })?;
        }
        // Up to the edge of the block.
        let edge = job.margin.unwrap_or_default() + radius - job.cutter.flat_radius();
        let pocket = pocket.without_stock_beyond(edge + BEYOND_EDGE * radius, radius);
        let Some(EarlierCutter { diameter, allowance }) = self.cleared else { return Ok((pocket, notes)) };
        if diameter <= 2.0 * radius {
            let message = format!(
                "an earlier cutter of {diameter} mm leaves no corners to this one of {} mm",
                2.0 * radius
            );
            return Err(self.refused(job, &message));
        }
        Ok((pocket.cleared_by(0.5 * diameter, allowance), notes))
    }

    fn floor(&self, pocket: &Pocket, job: &Loading<'_>) -> Result<Part, SceneError> {
        let radius = job.cutter.radius();
        let clear = unmeasured_beside_walls(job.chord_tolerance, radius);
        let floor = pocket.reachable_floor(job.cutter, clear);
        if floor.is_empty() {
            let largest =
                pocket.free().largest_disc(PRECISION, &Silent).ok().flatten().map_or(0.0, |d| 2.0 * d.1);
            let rounded = (100.0 * largest).floor() / 100.0;
            if pocket.reachable_floor(job.cutter, 0.0).is_empty() {
                let message = format!(
                    "the cutter of {} mm fits nowhere in the pocket; the largest that would has {rounded:.2} mm",
                    2.0 * radius
                );
                return Err(self.refused(job, &message));
            }
            let message = format!(
                "the cutter of {} mm fits, but the floor that its bottom comes to is less than {:.4} mm wide, and so much beside its border \
                 is not measured",
                2.0 * radius,
                2.0 * clear
            );
            let cure = "use a cutter with a flat bottom or a smaller one, or lower `chord` in [tolerance]";
            return Err(job.source.error(self.span(), message, cure));
        }
        let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
        for piece in &floor.pieces {
            let (points, corners) = fill(piece).map_err(|e| self.refused(job, &e.to_string()))?;
            let first = vertices.len() as u32;
            vertices.extend(points.iter().map(|p| Point3::new(p.x, p.y, -pocket.depth)));
            triangles.extend(corners.iter().map(|t| t.map(|v| first + v)));
        }
        let (mesh, _) =
            TriangleMesh::new(vertices, triangles).map_err(|e| self.refused(job, &e.to_string()))?;
        Ok(Part::from_mesh(mesh))
    }

    /// Where the scene names its drawing, or has its outline.
    fn span(&self) -> std::ops::Range<usize> {
        match &self.outline {
            OutlineSource::File { file, .. } => file.span.clone(),
            OutlineSource::Points { span: Place(span), .. } => span.clone(),
        }
    }

    fn refused(&self, job: &Loading<'_>, what: &str) -> SceneError {
        job.source.error(self.span(), what.to_owned(), "change the pocket's outline or the cutter")
    }
}

/// Sides of outlines that lie on an edge of the stock's block: there is no wall.
fn at_stock_edge(region: &Region, job: &Loading<'_>) -> Vec<Vec<Point2>> {
    let near = job.chord_tolerance;
    let Some([lo, hi]) = region.bounds().filter(|_| job.margin.is_some_and(|margin| margin <= near)) else {
        return Vec::new();
    };
    let at = |p: &Point2| [p.x <= lo.x + near, p.y <= lo.y + near, p.x >= hi.x - near, p.y >= hi.y - near];
    let outlines = region.pieces.iter().map(|piece| &piece.outer);
    let all =
        outlines.flat_map(|outer| (0..outer.len()).map(|k| vec![outer[k], outer[(k + 1) % outer.len()]]));
    all.filter(|side| at(&side[0]).iter().zip(at(&side[1])).any(|(a, b)| *a && b)).collect()
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
        assert_eq!(scene.stock, crate::StockRequest::Around { allowance: 0.0, margin: 3.0, roughed: None });
        let text = complete_toml(&scene);
        let again = Scene::parse("tray.toml", text.clone()).unwrap();
        assert_eq!((&again.part, &again.toolpaths), (&scene.part, &scene.toolpaths), "{text}");
        assert_eq!(complete_toml(&again), text);
    }

    #[test]
    fn open_sides_and_an_earlier_cutter_are_read_and_written_again() {
        let text = TRAY.replace(
            "depth = 5",
            "depth = 5\nopen = [[[60, 0], [60, 40]]]\ncleared_by = 12\ncleared_allowance = 0.2",
        );
        let finish = "engagement = 80\nwall_allowance = 0.2\nwall_finish = \"depth\"";
        let text = format!("{}[machine]\narcs = 0.0005\n", text.replace("engagement = 80", finish));
        let scene = Scene::parse("tray.toml", text).unwrap();
        let text = complete_toml(&scene);
        assert!(text.contains("open = [[[60.0, 0.0], [60.0, 40.0]]]"), "{text}");
        let again = Scene::parse("tray.toml", text.clone()).unwrap();
        assert_eq!((complete_toml(&again), again.arcs), (text, Some(0.0005)));
        assert_eq!(again.toolpaths, scene.toolpaths);
        assert!(crate::load_part(&again).unwrap().pocket.unwrap().air().area() > 1000.0);
    }

    /// Where the stock ends at the outline, sides on its edges have no wall.
    #[test]
    fn sides_at_the_edge_of_the_stock_are_open() {
        let walls = |stock: &str| {
            let text = TRAY.replace("islands = [[[20, 10], [30, 10], [30, 20]]]\n", "");
            let text = text.replace("[60, 40], [0, 40]]", "[60, 20], [30, 20], [30, 40], [0, 40]]");
            let scene = Scene::parse("tray.toml", format!("{text}{stock}")).unwrap();
            let loaded = crate::load_part(&scene).unwrap();
            (loaded.pocket.unwrap().wall_length(), loaded.notes)
        };
        assert_eq!((walls("").0, walls("[stock]\nmargin = 0.5\n").0), (200.0, 200.0));
        let (length, notes) = walls("[stock]\nmargin = 0\n");
        assert_eq!(
            (length, notes.join("")),
            (50.0, "open at the edge of the stock: 4 sides of the outline".into())
        );
    }

    #[test]
    fn streamlines_take_the_directions_of_level_ground() {
        let keys = "strategy = \"pocket-streamline\"\ndirection = \"guide\"\nguides = [[[0, 5], [60, 9]]]\nacross = true\n\
                    direction_weight = 2\nalong_walls = true";
        let text = TRAY.replace("strategy = \"pocket-flow\"\nspiral = true\nengagement = 80", keys);
        let scene = Scene::parse("tray.toml", text.clone()).unwrap();
        let written = complete_toml(&scene);
        let again = Scene::parse("tray.toml", written.clone()).unwrap();
        assert_eq!((&again.toolpaths, complete_toml(&again)), (&scene.toolpaths, written));
        let border = text.replace("direction = \"guide\"\nguides = [[[0, 5], [60, 9]]]\nacross = true\n", "");
        let border =
            complete_toml(&Scene::parse("tray.toml", border.replace("along_walls = true", "")).unwrap());
        assert!(
            border.contains("direction = \"border\"") && border.contains("along_walls = true"),
            "{border}"
        );
        for (to, words) in [
            ("direction = \"steepest\"", "cannot be \"steepest\""),
            (
                "direction = { blend = [{ direction = \"u\" }, { direction = \"contour\" }] }",
                "cannot be \"contour\"",
            ),
            ("direction = \"u\"\nengagement = 70", "`engagement`"),
            ("direction = \"u\"\nfollow = 2", "`follow`"),
            ("direction = \"u\"\nguides = [[[0, 5], [60, 9]]]", "curves that nothing follows"),
            ("direction = \"file\"", "directions"),
        ] {
            let from = "direction = \"guide\"\nguides = [[[0, 5], [60, 9]]]\nacross = true";
            let refused = Scene::parse("tray.toml", text.replace(from, to)).unwrap_err().to_string();
            assert!(refused.contains(words), "{to}: {refused}");
        }
    }

    #[test]
    fn open_sides_off_the_outline_and_smaller_earlier_cutters_are_refused() {
        for (key, words) in [
            ("open = [[[60, 0], [61, 40]]]", "its point at x 61.0000 y 40.0000 does not lie on the outline"),
            ("open = [[[60, 0], [0, 40]]]", "its point at x 30.0000 y 20.0000 does not lie on the outline"),
            ("cleared_by = 6", "leaves no corners"),
        ] {
            let text = TRAY.replace("depth = 5", &format!("depth = 5\n{key}"));
            let scene = Scene::parse("tray.toml", text).unwrap();
            let refused = crate::load_part(&scene).unwrap_err().to_string();
            assert!(refused.contains(words), "{refused}");
        }
    }

    /// A ball that fits a slot by two hundredths fits, though no floor is left to be measured; in a narrower
    /// one it does not.
    #[test]
    fn a_cutter_that_fits_is_not_said_to_fit_nowhere() {
        let refused = |width: f64| {
            let text = format!(
                "[part]\nsurface = \"pocket\"\noutline = [[0, 0], [12, 0], [12, {width}], [0, {width}]]\ndepth = 2\n[cutter]\nshape = \"ball\"\n\
                 diameter = 3\n[tolerance]\nchord = 0.005\n[[toolpath]]\nstrategy = \"pocket-offset\"\n"
            );
            crate::load_part(&Scene::parse("slot.toml", text).unwrap()).unwrap_err().to_string()
        };
        assert!(refused(3.02).contains("fits, but the floor"), "{}", refused(3.02));
        assert!(refused(2.98).contains("fits nowhere"), "{}", refused(2.98));
    }

    /// A point that is written twice changes nothing; two points that are nearly one and cross are named.
    #[test]
    fn repeated_points_are_one_or_named() {
        let part = |points: &str| {
            let text = format!(
                "[part]\nsurface = \"pocket\"\noutline = [{points}]\ndepth = 2\n[cutter]\nshape = \"flat\"\ndiameter = 6\n\
                 [[toolpath]]\nstrategy = \"pocket-offset\"\n"
            );
            Scene::parse("pocket.toml", text).map(|scene| scene.part)
        };
        let plain = part("[0, 0], [30, 0], [30, 20], [0, 20]").unwrap();
        for points in [
            "[0, 0], [30, 0], [30, 0], [30, 20], [0, 20], [0, 0]",
            "[0, 0], [30, 0], [30, 1e-9], [30, 20], [0, 20]",
            "[0, 0], [30, 0], [30, 20], [0, 20], [1e-9, -1e-9], [0, -1e-9]",
        ] {
            assert_eq!(part(points).unwrap(), plain, "{points}");
        }
        for (points, named) in [
            (
                "[0, 0], [30, 0], [30, 20], [0, 20], [0.004, -0.003]",
                "[0.004, -0.003] and [0, 0] lie 0.0050 mm apart",
            ),
            (
                "[0, 0], [30, 0], [29.995, 0], [30, 20], [0, 20]",
                "[30, 0] and [29.995, 0] lie 0.0050 mm apart",
            ),
        ] {
            let refused = part(points).unwrap_err();
            let cure = miette::Diagnostic::help(&refused).unwrap().to_string();
            assert!(refused.to_string().contains("crosses itself at x"), "{refused}");
            assert!(cure.contains(named) && cure.contains("delete one"), "{cure}");
        }
    }

    /// What touches is named with what to do about it: no order of corners mends it.
    #[test]
    fn curves_that_touch_are_told_how_to_be_drawn() {
        let outline = "outline = [[0, 0], [40, 0], [40, 30], [0, 30]]\nislands = ";
        for (curves, words) in [
            (format!("{outline}[[[0, 10], [10, 10], [10, 16], [0, 16]]]"), "lead the outline around it"),
            (format!("{outline}[[[0, 15], [8, 10], [16, 15], [8, 20]]]"), "lead the outline around it"),
            (format!("{outline}[[[30, 10], [50, 10], [50, 20], [30, 20]]]"), "lead the outline around it"),
            (
                format!(
                    "{outline}[[[10, 10], [20, 10], [20, 20], [10, 20]], [[20, 10], [30, 10], [30, 20]]]"
                ),
                "both islands as one",
            ),
            (
                format!(
                    "{outline}[[[10, 10], [22, 10], [22, 20], [10, 20]], [[20, 12], [30, 12], [30, 22]]]"
                ),
                "both islands as one",
            ),
            (
                "outline = [[0, 0], [20, 10], [40, 0], [40, 30], [20, 10], [0, 30]]".into(),
                "comes to [20, 10] twice",
            ),
            ("outline = [[0, 0], [40, 30], [40, 0], [0, 30]]".into(), "in order, each once"),
        ] {
            let scene = format!(
                "[part]\nsurface = \"pocket\"\n{curves}\ndepth = 4\n[cutter]\nshape = \"flat\"\ndiameter = 5\n\
                 [[toolpath]]\nstrategy = \"pocket-offset\"\n"
            );
            let refused = Scene::parse("pocket.toml", scene).unwrap_err();
            let cure = miette::Diagnostic::help(&refused).unwrap().to_string();
            assert!(cure.contains(words), "{curves}: {cure}");
        }
        // A cutter that does not fit is told at the outline.
        let text = "[part]\nsurface = \"pocket\"\noutline = [[0, 0], [30, 0], [30, 5], [0, 5]]\ndepth = 4\n[cutter]\n\
                    shape = \"flat\"\ndiameter = 6\n[[toolpath]]\nstrategy = \"pocket-offset\"\n";
        let scene = Scene::parse("pocket.toml", text.to_owned()).unwrap();
        let refused = crate::load_part(&scene).err().unwrap();
        let label = miette::Diagnostic::labels(&refused).unwrap().next().unwrap();
        assert_eq!(label.offset(), text.find("[[0, 0]").unwrap(), "{refused}");
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
            ("spiral = true", "wall_finish = \"depth\"", "does not apply without a `wall_allowance`"),
            ("spiral = true", "wall_allowance = 0.2\nwall_finish = \"deep\"", "cannot be \"deep\""),
            (
                "[[toolpath]]\nstrategy = \"pocket-flow\"",
                "[machine]\narcs = 0.1\n[[toolpath]]\nstrategy = \"pocket-flow\"",
                "more than the chord tolerance",
            ),
            ("depth = 5", "depth = 5\nopen = [[[60, 0]]]", "needs two points"),
            ("depth = 5", "depth = 5\nopen = [[60, 0], [60, 40]]", "points of two numbers"),
            ("depth = 5", "depth = 5\ncleared_allowance = 0.2", "needs `cleared_by`"),
        ] {
            let text = refusal(from, to);
            assert!(text.contains(words), "{to}: {text}");
        }
    }
}
