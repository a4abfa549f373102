//! SVG: path, rect, circle, ellipse, polygon, polyline and line, with their transforms (W3C SVG 1.1, 2).
//!
//! Lengths in mm come from `width`, `height` and `viewBox`; without units 96 make an inch, as CSS has it.
//! y, which runs down in SVG, is turned up, with the lower edge of the page at 0. What is not displayed
//! and what is not drawn in place (`defs`, clips, masks) is left out; texts, images and `use` are refused
//! or named, since outlines may hide in them. So are style sheets that show, hide, place or size shapes; those of colours and pens
//! are passed over.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use roxmltree::{Document, Node};
use svgtypes::{Length, LengthUnit, PathParser, PathSegment, PointsParser, Transform, ViewBox};

use super::curve::{ellipse, flatten};
use super::{Drawn, OutlineError, OutlineFormat, OutlineOptions};
use geometry::{Point2, Vector2};

/// Scalable Vector Graphics.
pub const FORMAT: OutlineFormat = OutlineFormat { extension: "svg", parse };

/// Deepest nesting of elements that is followed.
const MAX_DEPTH: usize = 64;

/// Properties of a style that show, hide, place or size outlines.
const SHAPING: [&str; 17] = [
    "display",
    "visibility",
    "transform",
    "translate",
    "rotate",
    "scale",
    "zoom",
    "d",
    "x",
    "y",
    "cx",
    "cy",
    "r",
    "rx",
    "ry",
    "width",
    "height",
];

/// mm of one CSS pixel.
const PIXEL: f64 = 25.4 / 96.0;

/// Points, and whether the last is joined to the first.
type Polyline = (Vec<Point2>, bool);

/// From the drawing's own coordinates to mm, y up.
#[derive(Debug, Clone, Copy)]
struct Map {
    x: Vector2,
    y: Vector2,
    origin: Point2,
}

impl Map {
    fn at(&self, x: f64, y: f64) -> Point2 {
        self.origin + self.x * x + self.y * y
    }

    fn then(&self, t: &Transform) -> Self {
        Self { x: self.x * t.a + self.y * t.b, y: self.x * t.c + self.y * t.d, origin: self.at(t.e, t.f) }
    }
}

struct Reader<'a> {
    tolerance: f64,
    layer: Option<&'a str>,
    drawn: Vec<Drawn>,
    ignored: BTreeMap<String, usize>,
    seen_layer: bool,
}

fn line_of(node: &Node<'_, '_>) -> usize {
    node.document().text_pos_at(node.range().start).row as usize
}

fn fault(node: &Node<'_, '_>, what: impl std::fmt::Display) -> OutlineError {
    let id = node.attribute("id").map_or_else(String::new, |id| format!(" \"{id}\""));
    OutlineError::at(line_of(node), format!("{}{id}: {what}", node.tag_name().name()))
}

/// Refuses rules of a style sheet that shape outlines: they are not applied.
fn check_sheet(node: &Node<'_, '_>) -> Result<(), OutlineError> {
    let text: String = node.descendants().filter_map(|n| n.text().filter(|_| n.is_text())).collect();
    let mut rest = text.as_str();
    let mut bare = String::new();
    while let Some((before, after)) = rest.split_once("/*") {
        bare.push_str(before);
        rest = after.split_once("*/").map_or("", |(_, after)| after);
    }
    bare.push_str(rest);
    if bare.contains("@import") {
        return Err(fault(node, "rules of other files are not read; save the drawing without them"));
    }
    let blocks = bare.split('{').skip(1).filter_map(|block| block.split('}').next());
    let mut declared = blocks.flat_map(declarations);
    match declared.find(|(property, value)| shapes(property) && !is_shown(property, value)) {
        Some((property, _)) => Err(fault(
            node,
            format!(
                "its rules set `{property}`, which is not read from there; save the drawing with presentation attributes \
                 instead of a style sheet"
            ),
        )),
        None => Ok(()),
    }
}

/// Properties and values of a list of declarations.
fn declarations(text: &str) -> impl Iterator<Item = (&str, &str)> {
    let pairs = text.split(';').filter_map(|declaration| declaration.split_once(':'));
    pairs.map(|(property, value)| (property.trim(), value.trim()))
}

fn shapes(property: &str) -> bool {
    SHAPING.iter().any(|shaping| property.eq_ignore_ascii_case(shaping))
}

/// Whether a value is the usual one, by which shapes are drawn where they stand.
fn is_shown(property: &str, value: &str) -> bool {
    let usual: &[&str] = match property {
        "display" => &["inline", "block", "initial", "inherit"],
        "visibility" => &["visible", "initial", "inherit"],
        "transform" | "translate" | "rotate" | "scale" => &["none"],
        _ => &["auto"],
    };
    usual.contains(&value.trim_end_matches("!important").trim())
}

/// Whether an element and what it holds is displayed.
///
/// # Errors
/// Where its style shapes it in another way, and where something within what is hidden is shown again.
fn is_displayed(node: &Node<'_, '_>) -> Result<bool, OutlineError> {
    let style = node.attribute("style").unwrap_or_default();
    let attributes =
        ["display", "visibility"].map(|key| node.attribute(key).map(|value| (key, value.trim())));
    let hides = |(property, value): (&str, &str)| {
        let value = value.trim_end_matches("!important").trim();
        match property {
            "display" => value == "none",
            "visibility" => ["hidden", "collapse"].contains(&value),
            _ => false,
        }
    };
    if attributes.into_iter().flatten().chain(declarations(style)).any(hides) {
        let is_again = |n: &Node<'_, '_>| {
            let style = n.attribute("style").unwrap_or_default();
            let attribute = n.attribute("visibility").map(|value| ("visibility", value.trim()));
            attribute.into_iter().chain(declarations(style)).any(|pair| pair == ("visibility", "visible"))
        };
        return match node.descendants().skip(1).find(is_again) {
            Some(again) => {
                Err(fault(&again, "it is visible within what is hidden; show or delete the whole"))
            }
            None => Ok(false),
        };
    }
    let shaped = declarations(style).find(|(property, value)| shapes(property) && !is_shown(property, value));
    match shaped {
        Some((property, _)) => {
            Err(fault(node, format!("its style sets `{property}`; write that as an attribute of its own")))
        }
        None => Ok(true),
    }
}

/// A length in mm where it has a unit, else `None` with its bare number.
fn millimetres(length: Length) -> Option<f64> {
    let unit = match length.unit {
        LengthUnit::Px | LengthUnit::None => PIXEL,
        LengthUnit::Mm => 1.0,
        LengthUnit::Cm => 10.0,
        LengthUnit::In => 25.4,
        LengthUnit::Pt => 25.4 / 72.0,
        LengthUnit::Pc => 25.4 / 6.0,
        LengthUnit::Em | LengthUnit::Ex | LengthUnit::Percent => return None,
    };
    Some(length.number * unit)
}

/// A length of a shape, in units of the drawing.
fn user(node: &Node<'_, '_>, name: &str) -> Result<Option<f64>, OutlineError> {
    let Some(text) = node.attribute(name) else { return Ok(None) };
    let length: Length = text.parse().map_err(|e| fault(node, format!("{name} = \"{text}\": {e}")))?;
    let units = if length.unit == LengthUnit::None {
        Some(length.number)
    } else {
        millimetres(length).map(|mm| mm / PIXEL)
    };
    let units = units.ok_or_else(|| {
        fault(node, format!("{name} = \"{text}\" depends on the page or a letter; write a number"))
    })?;
    if units.is_finite() {
        Ok(Some(units))
    } else {
        Err(fault(node, format!("{name} is not a finite number")))
    }
}

fn page(root: &Node<'_, '_>, options: &OutlineOptions, notes: &mut Vec<String>) -> Result<Map, OutlineError> {
    let length = |name: &str| -> Result<Option<Length>, OutlineError> {
        let Some(text) = root.attribute(name) else { return Ok(None) };
        let length: Length = text.parse().map_err(|e| fault(root, format!("{name} = \"{text}\": {e}")))?;
        Ok((length.unit != LengthUnit::Percent).then_some(length))
    };
    let (width, height) = (length("width")?, length("height")?);
    let size = |l: Option<Length>| l.and_then(millimetres);
    let view: Option<ViewBox> = match root.attribute("viewBox") {
        Some(text) => Some(text.parse().map_err(|e| fault(root, format!("viewBox = \"{text}\": {e}")))?),
        None => None,
    };
    let (x0, y0, h) = view.map_or((0.0, 0.0, None), |v| (v.x, v.y, Some(v.h)));
    let by_page = |size: Option<f64>, view: Option<f64>| size.zip(view).map(|(s, v)| s / v);
    let scales = [by_page(size(width), view.map(|v| v.w)), by_page(size(height), view.map(|v| v.h))];
    let scale = match (options.scale, scales) {
        (Some(scale), _) => scale,
        (None, [Some(x), Some(y)]) if (x / y - 1.0).abs() > 1e-3 => {
            return Err(fault(
                root,
                format!(
                    "width and height stretch the viewBox by different amounts ({x:.5} and {y:.5} mm a unit)"
                ),
            ));
        }
        (None, [Some(scale), _] | [None, Some(scale)]) => scale,
        (None, [None, None]) => PIXEL,
    };
    let named = |l: Option<Length>| l.is_some_and(|l| !matches!(l.unit, LengthUnit::None | LengthUnit::Px));
    if options.scale.is_none() && !named(width) && !named(height) {
        notes.push("the drawing has no unit; 96 of its units make an inch".into());
    }
    if !(scale > 0.0 && scale.is_finite()) {
        return Err(fault(root, format!("one unit of the drawing is {scale} mm")));
    }
    let bottom = h.or_else(|| size(height).map(|mm| mm / scale)).unwrap_or(0.0);
    Ok(Map {
        x: Vector2::new(scale, 0.0),
        y: Vector2::new(0.0, -scale),
        origin: Point2::new(-x0 * scale, (y0 + bottom) * scale),
    })
}

/// The drawn elements, mm.
fn parse(
    bytes: &[u8],
    options: &OutlineOptions,
    notes: &mut Vec<String>,
) -> Result<Vec<Drawn>, OutlineError> {
    let text = std::str::from_utf8(bytes).map_err(|_| OutlineError::new("it is not UTF-8 text"))?;
    let xml = roxmltree::ParsingOptions { allow_dtd: true, nodes_limit: 2_000_000, ..Default::default() };
    let document = Document::parse_with_options(text, xml)
        .map_err(|e| OutlineError::at(e.pos().row as usize, format!("not valid XML: {e}")))?;
    if let Some(sheet) =
        document.root().children().find(|n| n.pi().is_some_and(|pi| pi.target == "xml-stylesheet"))
    {
        let reason = "style sheets of other files are not read; save the drawing without them";
        return Err(OutlineError::at(line_of(&sheet), reason));
    }
    let root = document.root_element();
    if root.tag_name().name() != "svg" {
        return Err(OutlineError::at(1, format!("its root is <{}>, not <svg>", root.tag_name().name())));
    }
    let map = page(&root, options, notes)?;
    let mut reader = Reader {
        tolerance: options.chord_tolerance,
        layer: options.layer.as_deref(),
        drawn: Vec::new(),
        ignored: BTreeMap::new(),
        seen_layer: options.layer.is_none(),
    };
    reader.children(&root, map, options.layer.is_none(), 0)?;
    if !reader.seen_layer {
        let layer = options.layer.as_deref().unwrap_or_default();
        return Err(OutlineError::new(format!("no element has the id or label \"{layer}\"")));
    }
    notes.extend(
        reader
            .ignored
            .iter()
            .map(|(name, count)| format!("{count} <{name}> left out: not a kind of outline")),
    );
    Ok(reader.drawn)
}

impl Reader<'_> {
    fn children(
        &mut self,
        node: &Node<'_, '_>,
        map: Map,
        wanted: bool,
        depth: usize,
    ) -> Result<(), OutlineError> {
        if depth > MAX_DEPTH {
            return Err(fault(node, "elements are nested too deeply"));
        }
        node.children()
            .filter(Node::is_element)
            .try_for_each(|child| self.element(&child, map, wanted, depth))
    }

    fn element(
        &mut self,
        node: &Node<'_, '_>,
        map: Map,
        wanted: bool,
        depth: usize,
    ) -> Result<(), OutlineError> {
        if node.tag_name().name() == "style" {
            return check_sheet(node);
        }
        if !is_displayed(node)? {
            return Ok(());
        }
        let label = |name: &str| node.attributes().find(|a| a.name() == name).map(|a| a.value());
        let here = self.layer.is_some_and(|l| [label("id"), label("label")].contains(&Some(l)));
        self.seen_layer |= here;
        let wanted = wanted || here;
        let map = match node.attribute("transform") {
            Some(text) => {
                map.then(&text.parse().map_err(|e| fault(node, format!("transform = \"{text}\": {e}")))?)
            }
            None => map,
        };
        let name = node.tag_name().name();
        match name {
            "g" | "a" | "switch" => return self.children(node, map, wanted, depth + 1),
            "defs" => {
                let mut sheets = node.descendants().filter(|n| n.tag_name().name() == "style");
                return sheets.try_for_each(|sheet| check_sheet(&sheet));
            }
            "clipPath" | "mask" | "marker" | "pattern" | "symbol" | "metadata" | "title" | "desc"
            | "namedview" | "linearGradient" | "radialGradient" | "filter" | "script" => {
                return Ok(());
            }
            _ if !wanted => return Ok(()),
            "use" | "svg" => {
                return Err(fault(node, "copies and pages within pages are not read; convert them to paths"));
            }
            _ => {}
        }
        let curves = self.shape(node, name, &map)?;
        let Some(curves) = curves else {
            *self.ignored.entry(name.to_owned()).or_default() += 1;
            return Ok(());
        };
        let id = node.attribute("id").map_or_else(|| name.to_owned(), |id| format!("{name} \"{id}\""));
        for (points, closed) in curves {
            if points.iter().any(|p| !p.coords.iter().all(|c| c.is_finite())) {
                return Err(fault(node, "a coordinate is not a finite number"));
            }
            self.drawn.push(Drawn { points, closed, line: line_of(node), entity: id.clone() });
        }
        Ok(())
    }

    /// The curves of an element; `None` for kinds that are no outlines.
    fn shape(
        &self,
        node: &Node<'_, '_>,
        name: &str,
        map: &Map,
    ) -> Result<Option<Vec<Polyline>>, OutlineError> {
        let or = |key: &str, default: f64| Ok::<f64, OutlineError>(user(node, key)?.unwrap_or(default));
        let needed = |key: &str| user(node, key)?.ok_or_else(|| fault(node, format!("{key} is missing")));
        let positive = |key: &str| match needed(key)? {
            length if length > 0.0 => Ok(length),
            length => Err(fault(node, format!("{key} is {length}"))),
        };
        let round = |cx: f64, cy: f64, rx: f64, ry: f64| {
            let axes = [map.x * rx, map.y * ry];
            let mut points = Vec::new();
            ellipse(map.at(cx, cy), axes, 0.0, TAU, self.tolerance, &mut points);
            vec![(points, true)]
        };
        let curves = match name {
            "path" => self.path(node, map)?,
            "circle" => {
                let r = positive("r")?;
                round(or("cx", 0.0)?, or("cy", 0.0)?, r, r)
            }
            "ellipse" => round(or("cx", 0.0)?, or("cy", 0.0)?, positive("rx")?, positive("ry")?),
            "rect" => {
                let (x, y, w, h) = (or("x", 0.0)?, or("y", 0.0)?, positive("width")?, positive("height")?);
                let (rx, ry) = (user(node, "rx")?, user(node, "ry")?);
                let rx0 = rx.or(ry).unwrap_or(0.0).clamp(0.0, 0.5 * w);
                let ry0 = ry.or(rx).unwrap_or(0.0).clamp(0.0, 0.5 * h);
                let mut points = Vec::new();
                let corners = [
                    (x + w - rx0, y + ry0, -0.25),
                    (x + w - rx0, y + h - ry0, 0.0),
                    (x + rx0, y + h - ry0, 0.25),
                    (x + rx0, y + ry0, 0.5),
                ];
                for (cx, cy, from) in corners {
                    let (from, to) = (from * TAU, (from + 0.25) * TAU);
                    let axes = [map.x * rx0, map.y * ry0];
                    points.push(map.at(cx, cy) + axes[0] * from.cos() + axes[1] * from.sin());
                    if rx0 > 0.0 && ry0 > 0.0 {
                        ellipse(map.at(cx, cy), axes, from, to, self.tolerance, &mut points);
                    }
                }
                vec![(points, true)]
            }
            "polygon" | "polyline" => {
                let text = node.attribute("points").unwrap_or_default();
                let points: Vec<Point2> = PointsParser::from(text).map(|(x, y)| map.at(x, y)).collect();
                let numbers = text.split([',', ' ', '\n', '\t', '\r']).filter(|t| !t.is_empty()).count();
                if numbers > 2 * points.len() + 1 {
                    return Err(fault(
                        node,
                        format!("its points are numbers up to the {}th only", 2 * points.len()),
                    ));
                }
                vec![(points, name == "polygon")]
            }
            "line" => vec![(
                vec![map.at(or("x1", 0.0)?, or("y1", 0.0)?), map.at(or("x2", 0.0)?, or("y2", 0.0)?)],
                false,
            )],
            _ => return Ok(None),
        };
        Ok(Some(curves))
    }

    fn path(&self, node: &Node<'_, '_>, map: &Map) -> Result<Vec<Polyline>, OutlineError> {
        let mut curves: Vec<Polyline> = Vec::new();
        let (mut at, mut start) = ([0.0; 2], [0.0; 2]);
        // The control point that a smooth curve mirrors, if the last segment had one of its kind.
        let (mut cubic, mut quadratic): (Option<[f64; 2]>, Option<[f64; 2]>) = (None, None);
        let mut open = false;
        for segment in PathParser::from(node.attribute("d").unwrap_or_default()) {
            let segment = segment.map_err(|e| fault(node, format!("its data: {e}")))?;
            let base = if segment.is_abs() { [0.0; 2] } else { at };
            let to = |x: f64, y: f64| [base[0] + x, base[1] + y];
            let from = at;
            let mirrored =
                move |c: Option<[f64; 2]>| c.map_or(from, |c| [2.0 * from[0] - c[0], 2.0 * from[1] - c[1]]);
            let (mut next_cubic, mut next_quadratic) = (None, None);
            if let PathSegment::MoveTo { x, y, .. } = segment {
                at = to(x, y);
                (start, open) = (at, false);
                (cubic, quadratic) = (None, None);
                continue;
            }
            if let PathSegment::ClosePath { .. } = segment {
                if let (true, Some(curve)) = (open, curves.last_mut()) {
                    curve.1 = true;
                }
                (at, open) = (start, false);
                (cubic, quadratic) = (None, None);
                continue;
            }
            if !open {
                curves.push((vec![map.at(at[0], at[1])], false));
                open = true;
            }
            let Some((points, _)) = curves.last_mut() else { continue };
            match segment {
                PathSegment::LineTo { x, y, .. } => at = to(x, y),
                PathSegment::HorizontalLineTo { x, .. } => at = [base[0] + x, from[1]],
                PathSegment::VerticalLineTo { y, .. } => at = [from[0], base[1] + y],
                PathSegment::CurveTo { x1, y1, x2, y2, x, y, .. } => {
                    at = to(x, y);
                    next_cubic = Some(to(x2, y2));
                    self.bezier(map, &[from, to(x1, y1), to(x2, y2), at], points);
                }
                PathSegment::SmoothCurveTo { x2, y2, x, y, .. } => {
                    at = to(x, y);
                    next_cubic = Some(to(x2, y2));
                    self.bezier(map, &[from, mirrored(cubic), to(x2, y2), at], points);
                }
                PathSegment::Quadratic { x1, y1, x, y, .. } => {
                    at = to(x, y);
                    next_quadratic = Some(to(x1, y1));
                    self.bezier(map, &[from, to(x1, y1), at], points);
                }
                PathSegment::SmoothQuadratic { x, y, .. } => {
                    at = to(x, y);
                    let control = mirrored(quadratic);
                    next_quadratic = Some(control);
                    self.bezier(map, &[from, control, at], points);
                }
                PathSegment::EllipticalArc { rx, ry, x_axis_rotation, large_arc, sweep, x, y, .. } => {
                    at = to(x, y);
                    let rotation = x_axis_rotation.to_radians();
                    self.arc(map, from, at, [rx.abs(), ry.abs()], rotation, large_arc, sweep, points);
                }
                PathSegment::MoveTo { .. } | PathSegment::ClosePath { .. } => {}
            }
            (cubic, quadratic) = (next_cubic, next_quadratic);
            let end = map.at(at[0], at[1]);
            match points.last_mut() {
                // Curves end there already, but for rounding.
                Some(last) if (*last - end).norm() <= 1e-9 => *last = end,
                _ => points.push(end),
            }
        }
        Ok(curves)
    }

    fn bezier(&self, map: &Map, control: &[[f64; 2]], out: &mut Vec<Point2>) {
        let control: Vec<Point2> = control.iter().map(|c| map.at(c[0], c[1])).collect();
        let at = |t: f64| {
            let mut p = control.clone();
            for n in (1..p.len()).rev() {
                for k in 0..n {
                    p[k] = p[k] + (p[k + 1] - p[k]) * t;
                }
            }
            p[0]
        };
        flatten(&at, 0.0, 1.0, 4, self.tolerance, out);
    }

    /// An elliptical arc by its ends (SVG 1.1, appendix F.6.5).
    fn arc(
        &self,
        map: &Map,
        from: [f64; 2],
        to: [f64; 2],
        radii: [f64; 2],
        rotation: f64,
        large: bool,
        sweep: bool,
        out: &mut Vec<Point2>,
    ) {
        let [mut rx, mut ry] = radii;
        if rx == 0.0 || ry == 0.0 || from == to {
            return;
        }
        let (sin, cos) = rotation.sin_cos();
        let half = [0.5 * (from[0] - to[0]), 0.5 * (from[1] - to[1])];
        let p = [cos * half[0] + sin * half[1], -sin * half[0] + cos * half[1]];
        let stretch = (p[0] / rx).powi(2) + (p[1] / ry).powi(2);
        if stretch > 1.0 {
            (rx, ry) = (rx * stretch.sqrt(), ry * stretch.sqrt());
        }
        let rest = (rx * ry).powi(2) - (rx * p[1]).powi(2) - (ry * p[0]).powi(2);
        let share = (rest.max(0.0) / ((rx * p[1]).powi(2) + (ry * p[0]).powi(2))).sqrt();
        let share = if large == sweep { -share } else { share };
        let c = [share * rx * p[1] / ry, -share * ry * p[0] / rx];
        let centre = [
            cos * c[0] - sin * c[1] + 0.5 * (from[0] + to[0]),
            sin * c[0] + cos * c[1] + 0.5 * (from[1] + to[1]),
        ];
        let angle = |x: f64, y: f64| (y / ry).atan2(x / rx);
        let a0 = angle(p[0] - c[0], p[1] - c[1]);
        let mut turn = (angle(-p[0] - c[0], -p[1] - c[1]) - a0).rem_euclid(TAU);
        if !sweep {
            turn -= TAU;
        }
        let axes = [map.x * (rx * cos) + map.y * (rx * sin), map.x * (-ry * sin) + map.y * (ry * cos)];
        ellipse(map.at(centre[0], centre[1]), axes, a0, a0 + turn, self.tolerance, out);
        if let Some(last) = out.last_mut() {
            *last = map.at(to[0], to[1]);
        }
    }
}
