//! DXF, the text form: pairs of a group code and a value (Autodesk DXF reference, AC1009 to AC1032).
//!
//! Read are LINE, ARC, CIRCLE, ELLIPSE, LWPOLYLINE and POLYLINE with bulges, and SPLINE by control points, of
//! model space, in the plane z = const seen from above or below. Other entities are named in a note, and so
//! are those that are left out because they are invisible or on a layer that is frozen or off; inserted
//! blocks that show something on the layers that are read are refused, and so are entities whose z varies.

mod blocks;

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use blocks::{Blocks, Layers};

use super::curve::Spline;
use super::{Chords, Drawn, OutlineError, OutlineFormat, OutlineOptions};
use geometry::{Point2, Vector2};

/// AutoCAD DXF as text.
pub const FORMAT: OutlineFormat = OutlineFormat { extension: "dxf", parse };

/// Most vertices of one entity.
const MAX_VERTICES: usize = 1_000_000;

/// Heights of an outline that differ by no more are level, units of the drawing: decimals of the file.
const LEVEL: f64 = 1.0e-6;

/// `$INSUNITS` in mm.
const UNITS: [(i64, f64); 8] =
    [(1, 25.4), (2, 304.8), (4, 1.0), (5, 10.0), (6, 1000.0), (8, 25.4e-6), (9, 0.0254), (13, 0.001)];

#[derive(Debug, Clone)]
struct CodePair<'a> {
    code: i32,
    value: &'a str,
    line: usize,
}

/// One entity with its groups.
struct Entity<'a> {
    name: &'a str,
    line: usize,
    pairs: &'a [CodePair<'a>],
}

impl Entity<'_> {
    fn text(&self, code: i32) -> Option<&str> {
        self.pairs.iter().find(|p| p.code == code).map(|p| p.value)
    }

    fn fault(&self, what: impl std::fmt::Display) -> OutlineError {
        OutlineError::at(self.line, format!("{}: {what}", self.name))
    }

    fn parse(&self, pair: &CodePair<'_>) -> Result<f64, OutlineError> {
        let value: f64 = pair.value.parse().map_err(|_| {
            OutlineError::at(pair.line, format!("{}: \"{}\" is not a number", self.name, pair.value))
        })?;
        if value.is_finite() {
            return Ok(value);
        }
        Err(OutlineError::at(pair.line, format!("{}: {value} is not a finite number", self.name)))
    }

    fn number(&self, code: i32) -> Result<Option<f64>, OutlineError> {
        self.pairs.iter().find(|p| p.code == code).map(|p| self.parse(p)).transpose()
    }

    fn needed(&self, code: i32) -> Result<f64, OutlineError> {
        self.number(code)?.ok_or_else(|| self.fault(format!("group {code} is missing")))
    }

    fn all(&self, code: i32) -> Result<Vec<f64>, OutlineError> {
        self.pairs.iter().filter(|p| p.code == code).map(|p| self.parse(p)).collect()
    }

    fn point(&self, code: i32) -> Result<Point2, OutlineError> {
        Ok(Point2::new(self.needed(code)?, self.needed(code + 10)?))
    }

    fn layer(&self) -> &str {
        self.text(8).unwrap_or("0")
    }

    fn flags(&self) -> i64 {
        self.text(70).and_then(|t| t.parse().ok()).unwrap_or(0)
    }

    fn is_invisible(&self) -> bool {
        self.text(60).and_then(|t| t.parse().ok()).unwrap_or(0i64) == 1
    }

    /// The height at which it lies, seen from above, in units of the drawing.
    ///
    /// # Errors
    /// Where it does not lie at one height: all that counts is its plan view, which is not what was drawn.
    fn height(&self) -> Result<f64, OutlineError> {
        // Where an entity lies in a plane of its own, heights count along its normal.
        let (codes, sign): (&[i32], f64) = match self.name {
            "LINE" => (&[30, 31], 1.0),
            "SPLINE" | "ELLIPSE" | "VERTEX" => (&[30], 1.0),
            "LWPOLYLINE" => (&[38], self.mirror()?),
            _ => (&[30], self.mirror()?),
        };
        let mut heights = Vec::new();
        for code in codes {
            let of = self.all(*code)?;
            // What is not stated lies at zero.
            heights.extend(if of.is_empty() { vec![0.0] } else { of });
        }
        let [least, most] =
            heights.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], z| [a.min(*z), b.max(*z)]);
        let rise = if self.name == "ELLIPSE" { self.number(31)?.unwrap_or(0.0).abs() } else { 0.0 };
        if most - least > LEVEL || rise > LEVEL {
            return Err(self.fault(format!(
                "its z varies from {least} to {}; draw outlines at one height",
                most.max(least + rise)
            )));
        }
        Ok(sign * least)
    }

    /// −1 where the entity's own plane is seen from below, so that its x runs the other way.
    fn mirror(&self) -> Result<f64, OutlineError> {
        let normal = [
            self.number(210)?.unwrap_or(0.0),
            self.number(220)?.unwrap_or(0.0),
            self.number(230)?.unwrap_or(1.0),
        ];
        if normal[0].abs() > 1e-6 || normal[1].abs() > 1e-6 || normal[2] == 0.0 {
            return Err(self.fault("it does not lie in a plane of constant z; draw outlines in the xy plane"));
        }
        Ok(normal[2].signum())
    }
}

fn pairs(text: &str) -> Result<Vec<CodePair<'_>>, OutlineError> {
    let mut lines = text.lines().enumerate();
    let mut all = Vec::new();
    while let Some((k, code)) = lines.next() {
        if code.trim().is_empty() && lines.clone().all(|(_, l)| l.trim().is_empty()) {
            break;
        }
        let code = code.trim().parse().map_err(|_| {
            OutlineError::at(
                k + 1,
                format!(
                    "\"{}\" is no group code; is this a DXF file?",
                    code.trim().chars().take(40).collect::<String>()
                ),
            )
        })?;
        let Some((_, value)) = lines.next() else {
            return Err(OutlineError::at(k + 1, "the file ends in the middle of a group"));
        };
        all.push(CodePair { code, value: value.trim(), line: k + 1 });
    }
    Ok(all)
}

/// What lies between the name of a section and its end.
fn section<'a>(pairs: &'a [CodePair<'a>], name: &str) -> Option<&'a [CodePair<'a>]> {
    let is = |p: &CodePair<'_>, code: i32, value: &str| p.code == code && p.value == value;
    let from = pairs.windows(2).position(|w| is(&w[0], 0, "SECTION") && is(&w[1], 2, name))?;
    let body = &pairs[from + 2..];
    Some(&body[..body.iter().position(|p| is(p, 0, "ENDSEC")).unwrap_or(body.len())])
}

/// The entities, or entries of tables, of a section.
fn items<'a>(body: &'a [CodePair<'a>]) -> impl Iterator<Item = Entity<'a>> {
    let starts: Vec<usize> = (0..body.len()).filter(|&k| body[k].code == 0).collect();
    (0..starts.len()).map(move |n| {
        let (from, end) = (starts[n], starts.get(n + 1).copied().unwrap_or(body.len()));
        Entity { name: body[from].value, line: body[from].line, pairs: &body[from + 1..end] }
    })
}

/// Why an entity is left out, if it is.
///
/// # Errors
/// For an inserted block that shows something on the layers that are read.
fn why_left_out(
    entity: &Entity<'_>,
    read: &Layers<'_>,
    blocks: &Blocks<'_>,
) -> Result<Option<&'static str>, OutlineError> {
    if entity.name == "INSERT"
        && !entity.is_invisible()
        && let Some(what) = blocks.shown(entity, read)
    {
        let cure = "inserted blocks are not read; explode them before exporting";
        return Err(entity.fault(format!("{what}; {cure}")));
    }
    let layer = entity.layer();
    Ok(if !read.is_wanted(layer) {
        Some("entities of other layers")
    } else if entity.is_invisible() {
        Some("invisible entities")
    } else if read.is_hidden(layer) {
        Some("entities on layers that are frozen or off")
    } else {
        (entity.name == "INSERT").then_some("inserted blocks that show nothing on the layers that are read")
    })
}

/// The drawn entities, mm.
fn parse(
    bytes: &[u8],
    options: &OutlineOptions,
    notes: &mut Vec<String>,
) -> Result<Vec<Drawn>, OutlineError> {
    if bytes.starts_with(b"AutoCAD Binary DXF") {
        return Err(OutlineError::new("it is a binary DXF file; export it as text (ASCII)"));
    }
    // Old files have names in other code pages; those words are compared with nothing.
    let text = String::from_utf8_lossy(bytes);
    let pairs = pairs(text.trim_start_matches('\u{feff}'))?;
    let unit = header_unit(&pairs)?;
    if unit.is_none() && options.scale.is_none() {
        notes.push("the drawing does not say its unit; mm is assumed".into());
    }
    let scale = options.scale.or(unit).unwrap_or(1.0);
    let body = section(&pairs, "ENTITIES").ok_or_else(|| OutlineError::new("it has no section ENTITIES"))?;
    let entities: Vec<Entity<'_>> = items(body).collect();
    let tolerance = options.chord_tolerance / scale;
    let mut drawn = Vec::new();
    let mut ignored: BTreeMap<&str, usize> = BTreeMap::new();
    let mut left_out: BTreeMap<&str, usize> = BTreeMap::new();
    let (read, blocks) = (Layers::of(&pairs, options.layer.as_deref()), Blocks::of(&pairs));
    let mut heights: Option<[f64; 2]> = None;
    if let Some(layer) = read.wanted.filter(|layer| read.is_hidden(layer)) {
        return Err(OutlineError::new(format!(
            "the layer \"{layer}\" is frozen or off in the drawing; turn it on there, or name another `layer`"
        )));
    }
    let mut layers: Vec<&str> = Vec::new();
    let mut k = 0;
    while k < entities.len() {
        let entity = &entities[k];
        k += 1;
        let mut vertices: &[Entity<'_>] = &[];
        if entity.name == "POLYLINE" {
            let count = entities[k..].iter().take_while(|e| e.name == "VERTEX").count();
            vertices = &entities[k..k + count];
            k += count;
            if entities.get(k).is_some_and(|e| e.name == "SEQEND") {
                k += 1;
            }
        }
        let layer = entity.layer();
        if !layers.iter().any(|other| other.to_lowercase() == layer.to_lowercase()) {
            layers.push(layer);
        }
        // Paper space is a sheet, not the part.
        if entity.text(67) == Some("1") {
            continue;
        }
        if let Some(reason) = why_left_out(entity, &read, &blocks)? {
            *left_out.entry(reason).or_default() += 1;
            continue;
        }
        match draw(entity, vertices, tolerance)? {
            Some(mut chords) => {
                let z = scale * entity.height()?;
                heights = Some(heights.map_or([z; 2], |[least, most]| [z.min(least), z.max(most)]));
                chords.points.iter_mut().for_each(|p| *p *= scale);
                chords.off_curve *= scale;
                drawn.push(Drawn { chords, line: entity.line, entity: entity.name.to_owned() });
            }
            None => *ignored.entry(entity.name).or_default() += 1,
        }
    }
    if let (true, Some(layer)) = (drawn.is_empty(), &options.layer) {
        return Err(OutlineError::new(format!(
            "nothing is drawn on the layer \"{layer}\"; the drawing has \"{}\"",
            layers.join("\", \"")
        )));
    }
    notes.extend(left_out.iter().map(|(reason, count)| format!("{reason}, left out: {count}")));
    if let Some([least, most]) = heights.filter(|[least, most]| most - least > LEVEL * scale) {
        notes.push(format!(
            "its outlines lie at heights from z {least} to {most}; all are taken to the floor of the pocket"
        ));
    }
    for (name, count) in ignored {
        notes.push(format!("{count} {name} left out: not a kind of outline"));
    }
    Ok(drawn)
}

fn header_unit(pairs: &[CodePair<'_>]) -> Result<Option<f64>, OutlineError> {
    let Some(k) = pairs.iter().position(|p| p.code == 9 && p.value == "$INSUNITS") else { return Ok(None) };
    let Some(pair) = pairs.get(k + 1) else { return Ok(None) };
    let code: i64 =
        pair.value.parse().map_err(|_| OutlineError::at(pair.line, "$INSUNITS is not a whole number"))?;
    if code == 0 {
        return Ok(None);
    }
    let found = UNITS.iter().find(|(c, _)| *c == code).map(|(_, mm)| *mm);
    found.map(Some).ok_or_else(|| {
        OutlineError::at(
            pair.line,
            format!("$INSUNITS is {code}, a unit that is not known here; write `unit` in the scene"),
        )
    })
}

/// The chord points of an entity and whether it is closed; `None` for kinds that are no outlines.
fn draw(
    entity: &Entity<'_>,
    vertices: &[Entity<'_>],
    tolerance: f64,
) -> Result<Option<Chords>, OutlineError> {
    let drawn = match entity.name {
        "LINE" => Chords::open(vec![entity.point(10)?, entity.point(11)?]),
        "CIRCLE" | "ARC" => {
            let (mirror, centre, radius) = (entity.mirror()?, entity.point(10)?, entity.needed(40)?);
            if radius <= 0.0 {
                return Err(entity.fault(format!("its radius is {radius}")));
            }
            let full = entity.name == "CIRCLE";
            let (from, to) = if full { (0.0, 360.0) } else { (entity.needed(50)?, entity.needed(51)?) };
            let from = from.to_radians();
            let mut sweep = (to.to_radians() - from).rem_euclid(TAU);
            if sweep == 0.0 {
                sweep = TAU;
            }
            let axes = [Vector2::new(mirror * radius, 0.0), Vector2::new(0.0, radius)];
            arc_points(Point2::new(mirror * centre.x, centre.y), axes, from, from + sweep, tolerance, full)
        }
        "ELLIPSE" => {
            // Centre and axis are in world coordinates; seen from below the sense is the other one.
            let (mirror, centre) = (entity.mirror()?, entity.point(10)?);
            let major = Vector2::new(entity.needed(11)?, entity.needed(21)?);
            let ratio = entity.needed(40)?;
            if ratio <= 0.0 || major.norm() == 0.0 {
                return Err(entity.fault("an axis has no length"));
            }
            let minor = Vector2::new(-major.y, major.x) * (ratio * mirror);
            let (from, to) = (entity.number(41)?.unwrap_or(0.0), entity.number(42)?.unwrap_or(TAU));
            let mut sweep = (to - from).rem_euclid(TAU);
            let full = sweep < 1e-9 || TAU - sweep < 1e-9;
            if full {
                sweep = TAU;
            }
            arc_points(centre, [major, minor], from, from + sweep, tolerance, full)
        }
        "LWPOLYLINE" => {
            let mirror = entity.mirror()?;
            let mut corners: Vec<(Point2, f64)> = Vec::new();
            for pair in entity.pairs {
                match pair.code {
                    10 => corners.push((Point2::new(entity.parse(pair)?, f64::NAN), 0.0)),
                    20 => {
                        corners.last_mut().ok_or_else(|| entity.fault("a y comes before its x"))?.0.y =
                            entity.parse(pair)?
                    }
                    42 => {
                        if let Some(last) = corners.last_mut() {
                            last.1 = entity.parse(pair)?;
                        }
                    }
                    _ => {}
                }
            }
            bulged(entity, corners, entity.flags() & 1 == 1, mirror, tolerance)?
        }
        "POLYLINE" => {
            if entity.flags() & (8 | 16 | 64) != 0 {
                return Err(entity.fault("it is a polyline in space or a mesh; draw outlines flat"));
            }
            let mirror = entity.mirror()?;
            let corner = |v: &Entity<'_>| Ok((v.point(10)?, v.number(42)?.unwrap_or(0.0)));
            // The frame's control points are for editing; the curve itself stands beside them.
            let on_curve = vertices.iter().filter(|v| v.flags() & 16 == 0);
            let heights = on_curve.clone().map(Entity::height).collect::<Result<Vec<f64>, _>>()?;
            if heights.windows(2).any(|ends| (ends[1] - ends[0]).abs() > LEVEL) {
                return Err(entity.fault("z varies along it; draw outlines at one height"));
            }
            let corners = on_curve.map(corner).collect::<Result<_, OutlineError>>()?;
            bulged(entity, corners, entity.flags() & 1 == 1, mirror, tolerance)?
        }
        "SPLINE" => {
            let (x, y) = (entity.all(10)?, entity.all(20)?);
            if x.is_empty() {
                return Err(entity.fault("it has no control points (fit points alone do not say its shape)"));
            }
            if x.len() != y.len() {
                return Err(entity.fault("its control points are incomplete"));
            }
            let weights = entity.all(41)?;
            let weight = |k: usize| weights.get(k).copied().unwrap_or(1.0);
            let control =
                x.iter().zip(&y).enumerate().map(|(k, (x, y))| (Point2::new(*x, *y), weight(k))).collect();
            let degree = entity.text(71).and_then(|t| t.parse().ok()).unwrap_or(3);
            let spline = Spline { degree, knots: entity.all(40)?, control };
            if let Some(fault) = spline.fault() {
                return Err(entity.fault(fault));
            }
            // Whether it is closed shows at its ends.
            spline.chords(tolerance)
        }
        _ => return Ok(None),
    };
    if drawn.points.len() > MAX_VERTICES {
        return Err(entity.fault(format!("it has {} points", drawn.points.len())));
    }
    Ok(Some(drawn))
}

fn arc_points(centre: Point2, axes: [Vector2; 2], from: f64, to: f64, tolerance: f64, full: bool) -> Chords {
    let mut chords = Chords::open(vec![centre + axes[0] * from.cos() + axes[1] * from.sin()]);
    chords.ellipse(centre, axes, from, to, tolerance);
    if full {
        chords.points.pop();
        chords.closed = true;
    }
    chords
}

/// Corners joined by lines or, where the bulge (a quarter of the angle's tangent) is not zero, by arcs.
fn bulged(
    entity: &Entity<'_>,
    corners: Vec<(Point2, f64)>,
    closed: bool,
    mirror: f64,
    tolerance: f64,
) -> Result<Chords, OutlineError> {
    if corners.iter().any(|(p, _)| p.y.is_nan()) {
        return Err(entity.fault("a corner has no y"));
    }
    let mut chords = Chords { closed, ..Chords::open(corners.first().map(|c| c.0).into_iter().collect()) };
    let sides = if closed { corners.len() } else { corners.len().saturating_sub(1) };
    for k in 0..sides {
        let ((a, bulge), (b, _)) = (corners[k], corners[(k + 1) % corners.len()]);
        if bulge == 0.0 || a == b {
            chords.points.push(b);
            continue;
        }
        let (chord, angle) = (b - a, 4.0 * bulge.atan());
        // From the middle of the chord to the centre, on the left for arcs of less than a half turn.
        let off = (1.0 - bulge * bulge) / (4.0 * bulge);
        let centre = a + chord * 0.5 + Vector2::new(-chord.y, chord.x) * off;
        let spoke = a - centre;
        if spoke.norm() >= 1e9 {
            return Err(entity.fault(format!("the bulge {bulge} is too large")));
        }
        chords.ellipse(centre, [spoke, Vector2::new(-spoke.y, spoke.x)], 0.0, angle, tolerance);
        if let Some(last) = chords.points.last_mut() {
            *last = b;
        }
    }
    if closed && chords.points.len() > 1 {
        chords.points.pop();
    }
    chords.points.iter_mut().for_each(|p| p.x *= mirror);
    Ok(chords)
}
