//! SVG: path, rect, circle, ellipse, polygon, polyline and line, with their transforms (W3C SVG 1.1, 2).
//!
//! Lengths in mm come from `width`, `height` and `viewBox`; without units 96 make an inch, as CSS has it.
//! y, which runs down in SVG, is turned up, with the lower edge of the page at 0. What is hidden, by any of the ways that a
//! drawing has for that, and what is not drawn in place (`defs`, symbols) is left out, with notes. Refused is what would change
//! the outlines and is not followed: clips, masks, filters, `use`, animations, shapes for some readers only, and style sheets
//! that show, hide, place or size shapes. Sheets of colours and pens are passed over; texts and images are named.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use roxmltree::{Document, Node};
use svgtypes::{Length, LengthUnit, PathParser, PathSegment, PointsParser, Transform, ViewBox};

use super::{Chords, Drawn, OutlineError, OutlineFormat, OutlineOptions};
use geometry::{Point2, Vector2};

/// Scalable Vector Graphics.
pub const FORMAT: OutlineFormat = OutlineFormat { extension: "svg", parse };

/// Deepest nesting of elements that is followed.
const MAX_DEPTH: usize = 64;

/// Properties that hide, clip or place outlines and are read from styles of single elements, and as attributes.
const READ: [&str; 9] = [
    "display",
    "visibility",
    "opacity",
    "fill-opacity",
    "stroke-opacity",
    "clip-path",
    "mask",
    "filter",
    "transform-origin",
];

/// Properties of a style that hide, place or size outlines and are not read from there.
const SHAPING: [&str; 29] = [
    "transform",
    "-webkit-transform",
    "translate",
    "rotate",
    "scale",
    "zoom",
    "offset",
    "offset-path",
    "animation",
    "animation-name",
    "mask-image",
    "-webkit-mask",
    "-webkit-mask-image",
    "-webkit-clip-path",
    "-webkit-filter",
    "transform-box",
    "content-visibility",
    "all",
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
    "vector-effect",
];

/// Elements by which a drawing moves or changes.
const ANIMATIONS: [&str; 6] =
    ["animate", "animateColor", "animateMotion", "animateTransform", "discard", "set"];

/// Properties by which shapes of a drawing are drawn at the corners of others.
const MARKERS: [&str; 4] = ["marker", "marker-start", "marker-mid", "marker-end"];

const NAMESPACE: &str = "http://www.w3.org/2000/svg";

/// mm of one CSS pixel.
const PIXEL: f64 = 25.4 / 96.0;

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

/// Which pens draw a shape: those of the elements around it, where it has none of its own.
#[derive(Debug, Clone, Copy)]
struct Pens {
    fill: bool,
    fill_shows: bool,
    stroke: bool,
    stroke_shows: bool,
    stroke_is_wide: bool,
}

impl Pens {
    /// Those of a drawing that names none.
    const USUAL: Self =
        Self { fill: true, fill_shows: true, stroke: false, stroke_shows: true, stroke_is_wide: true };

    fn within(self, node: &Node<'_, '_>) -> Result<Self, OutlineError> {
        let paints = |property: &str, usual: bool| match property_of(node, property).as_deref() {
            None | Some("inherit") => usual,
            Some(paint) => has_colour(paint),
        };
        let shows = |property: &str, usual: bool| -> Result<bool, OutlineError> {
            Ok(match property_of(node, property).as_deref() {
                None | Some("inherit") => usual,
                Some(value) => shows(node, property, value)?,
            })
        };
        let is_wide = match property_of(node, "stroke-width").as_deref() {
            None | Some("inherit") => self.stroke_is_wide,
            Some(width) => !width.parse::<Length>().is_ok_and(|width| width.number == 0.0),
        };
        Ok(Self {
            fill: paints("fill", self.fill),
            fill_shows: shows("fill-opacity", self.fill_shows)?,
            stroke: paints("stroke", self.stroke),
            stroke_shows: shows("stroke-opacity", self.stroke_shows)?,
            stroke_is_wide: is_wide,
        })
    }

    fn draw(self, shape: &str) -> bool {
        let fills = self.fill && self.fill_shows && shape != "line";
        fills || (self.stroke && self.stroke_shows && self.stroke_is_wide)
    }
}

/// Where an element stands: what it has from those around it.
#[derive(Clone, Copy)]
struct Place<'p> {
    map: Map,
    wanted: bool,
    depth: usize,
    pens: Pens,
    /// Why shapes here are refused, if they are.
    refused: Option<&'p OutlineError>,
}

struct Reader<'a> {
    tolerance: f64,
    layer: Option<&'a str>,
    drawn: Vec<Drawn>,
    ignored: BTreeMap<String, usize>,
    seen_layer: bool,
    /// Whether a style sheet says which pens draw: then each shape counts as drawn.
    sheet_has_pens: bool,
    hidden: usize,
    without_pen: usize,
}

fn line_of(node: &Node<'_, '_>) -> usize {
    node.document().text_pos_at(node.range().start).row as usize
}

fn fault(node: &Node<'_, '_>, what: impl std::fmt::Display) -> OutlineError {
    let id = node.attribute("id").map_or_else(String::new, |id| format!(" \"{id}\""));
    OutlineError::at(line_of(node), format!("{}{id}: {what}", node.tag_name().name()))
}

/// Without comments of style sheets.
fn without_comments(text: &str) -> String {
    let mut rest = text;
    let mut bare = String::new();
    while let Some((before, after)) = rest.split_once("/*") {
        bare.push_str(before);
        rest = after.split_once("*/").map_or("", |(_, after)| after);
    }
    bare.push_str(rest);
    bare
}

/// Refuses rules of a style sheet that shape or hide outlines: they are not applied. Says whether its rules set pens.
fn check_sheet(node: &Node<'_, '_>) -> Result<bool, OutlineError> {
    let text: String = node.descendants().filter_map(|n| n.text().filter(|_| n.is_text())).collect();
    let bare = without_comments(&text);
    if bare.contains("@import") {
        return Err(fault(node, "rules of other files are not read; save the drawing without them"));
    }
    let mut has_pens = false;
    for block in bare.split('{').skip(1).filter_map(|block| block.split('}').next()) {
        let shaping = declarations(block).find(|(property, value)| {
            (is_any(property, &SHAPING) || is_any(property, &READ)) && !is_usual(property, value)
        });
        // A rule that takes away both pens hides what it is for.
        let is_without = |pen: &str| {
            let of = declarations(block).filter(|(property, _)| property.eq_ignore_ascii_case(pen));
            of.last().is_some_and(|(_, value)| !has_colour(&keyword(value)))
        };
        let both = (is_without("fill") && is_without("stroke")).then_some("stroke");
        if let Some(property) = shaping.map(|s| s.0).or(both) {
            return Err(fault(
                node,
                format!(
                    "its rules set `{property}`, which is not read from there; save the drawing with presentation attributes \
                     instead of a style sheet"
                ),
            ));
        }
        has_pens |=
            declarations(block).any(|(property, _)| is_any(property, &["fill", "stroke", "stroke-width"]));
    }
    Ok(has_pens)
}

/// Properties and values of a list of declarations.
fn declarations(text: &str) -> impl Iterator<Item = (&str, &str)> {
    let pairs = text.split(';').filter_map(|declaration| declaration.split_once(':'));
    pairs.map(|(property, value)| (property.trim(), value.trim()))
}

fn is_any(property: &str, of: &[&str]) -> bool {
    of.iter().any(|one| property.eq_ignore_ascii_case(one))
}

/// A value as it is compared.
fn keyword(value: &str) -> String {
    let value = value.trim().to_ascii_lowercase();
    value.strip_suffix("!important").unwrap_or(&value).trim_end().to_owned()
}

/// The value of a property of an element itself: its style goes before its attribute.
fn property_of(node: &Node<'_, '_>, property: &str) -> Option<String> {
    let style = node.attribute("style").map(without_comments).unwrap_or_default();
    let of = declarations(&style).filter(|(name, _)| name.eq_ignore_ascii_case(property));
    let stated = of.map(|(_, value)| value).max_by_key(|value| value.ends_with("!important"));
    stated.or_else(|| node.attribute(property)).map(keyword)
}

/// Whether a paint is one.
fn has_colour(paint: &str) -> bool {
    match svgtypes::Paint::from_str(paint) {
        Ok(svgtypes::Paint::None) => false,
        Ok(svgtypes::Paint::Color(colour)) => colour.alpha > 0,
        _ => paint != "transparent",
    }
}

/// Whether something of an opacity is seen.
fn shows(node: &Node<'_, '_>, property: &str, opacity: &str) -> Result<bool, OutlineError> {
    if ["initial", "unset", "revert"].contains(&opacity) {
        return Ok(true);
    }
    let number = opacity.strip_suffix('%').unwrap_or(opacity).trim_end().parse::<f64>();
    let number = number.map_err(|_| fault(node, format!("{property} = \"{opacity}\" is not a number")))?;
    Ok(number > 0.0)
}

/// Whether a value is the usual one, by which shapes are drawn where they stand.
fn is_usual(property: &str, value: &str) -> bool {
    let value = keyword(value);
    let usual: &[&str] = match property.to_ascii_lowercase().as_str() {
        "display" => &["inline", "block", "initial", "inherit"],
        "visibility" => &["visible", "initial", "inherit"],
        "opacity" | "fill-opacity" | "stroke-opacity" => {
            let number = value.strip_suffix('%').unwrap_or(&value).trim_end().parse::<f64>();
            return number.map_or_else(|_| ["initial", "inherit"].contains(&value.as_str()), |x| x > 0.0);
        }
        "transform-origin" => &["0 0", "0px 0px", "0% 0%", "initial"],
        "transform-box" => &["view-box", "initial"],
        "content-visibility" => &["visible", "initial"],
        "vector-effect" => &["none", "non-scaling-stroke", "initial"],
        "transform" | "-webkit-transform" | "translate" | "rotate" | "scale" | "clip-path"
        | "-webkit-clip-path" | "mask" | "mask-image" | "-webkit-mask" | "-webkit-mask-image" | "filter"
        | "-webkit-filter" | "offset-path" | "offset" | "animation" | "animation-name" => {
            &["none", "initial"]
        }
        _ => &["auto"],
    };
    usual.contains(&value.as_str())
}

/// Whether an element and what it holds is displayed.
///
/// # Errors
/// Where its style shapes it in another way, and where something within what is hidden is shown again.
fn is_displayed(node: &Node<'_, '_>) -> Result<bool, OutlineError> {
    let of = |property: &str| property_of(node, property);
    for property in ["display", "visibility"] {
        if let Some(value) = of(property).filter(|value| value.contains('(')) {
            return Err(fault(node, format!("{property} = \"{value}\" is not read; write a word")));
        }
    }
    if of("display").as_deref() == Some("none") {
        return Ok(false);
    }
    if let Some(opacity) = of("opacity").filter(|opacity| opacity != "inherit")
        && !shows(node, "opacity", &opacity)?
    {
        return Ok(false);
    }
    // Nobody here is one of those who have an extension.
    if node.attribute("requiredExtensions").is_some() {
        return Ok(false);
    }
    if of("visibility").is_some_and(|value| ["hidden", "collapse"].contains(&value.as_str())) {
        let is_again = |n: &Node<'_, '_>| property_of(n, "visibility").as_deref() == Some("visible");
        return match node.descendants().skip(1).find(is_again) {
            Some(again) => {
                Err(fault(&again, "it is visible within what is hidden; show or delete the whole"))
            }
            None => Ok(false),
        };
    }
    Ok(true)
}

/// Refuses a style that shapes outlines in a way that is not read, but for what `is_passed_over`.
fn check_style(node: &Node<'_, '_>, is_passed_over: impl Fn(&str, &str) -> bool) -> Result<(), OutlineError> {
    let style = node.attribute("style").map(without_comments).unwrap_or_default();
    let mut shaping = declarations(&style).filter(|(property, _)| is_any(property, &SHAPING));
    match shaping.find(|(property, value)| !is_usual(property, value) && !is_passed_over(property, value)) {
        Some((property, _)) => {
            Err(fault(node, format!("its style sets `{property}`; write that as an attribute of its own")))
        }
        None => Ok(()),
    }
}

fn is_animation(node: &Node<'_, '_>) -> bool {
    ANIMATIONS.contains(&node.tag_name().name())
}

fn has_link(node: &Node<'_, '_>) -> bool {
    node.attributes().any(|a| a.name() == "href")
}

/// Why shapes of this element, or within it, are not those that are seen.
fn unread(node: &Node<'_, '_>) -> Option<OutlineError> {
    for (property, cure) in [
        ("clip-path", "release the clip, and cut the shapes themselves"),
        ("mask", "release the mask, and cut the shapes themselves"),
        ("filter", "remove the filter"),
    ] {
        if property_of(node, property).is_some_and(|value| !is_usual(property, &value)) {
            let what = format!("its `{property}` changes what is seen of it and is not read; {cure}");
            return Some(fault(node, what));
        }
    }
    for condition in ["systemLanguage", "requiredFeatures"] {
        if node.attribute(condition).is_some() {
            let what =
                format!("`{condition}` shows it to some readers only; delete that attribute or the element");
            return Some(fault(node, what));
        }
    }
    let moving = node.children().find(|n| is_animation(n) && !has_link(n))?;
    let name = moving.tag_name().name();
    Some(fault(node, format!("<{name}> changes it; draw it where it is wanted, and delete <{name}>")))
}

/// Whether an element is one of SVG: those of others are not drawn.
fn is_svg(node: &Node<'_, '_>) -> bool {
    let of_page = node.document().root_element().tag_name().namespace();
    let namespace = node.tag_name().namespace();
    node.is_element() && (namespace == of_page || namespace == Some(NAMESPACE))
}

/// Whether an element has a name as id or label.
fn is_named(node: &Node<'_, '_>, name: &str) -> bool {
    node.attributes().any(|a| ["id", "label"].contains(&a.name()) && a.value() == name)
}

/// From the coordinates within an element to mm.
fn transformed(node: &Node<'_, '_>, map: Map) -> Result<Map, OutlineError> {
    let Some(text) = node.attribute("transform") else { return Ok(map) };
    let transform = text.parse().map_err(|e| fault(node, format!("transform = \"{text}\": {e}")))?;
    if property_of(node, "transform-box").is_some_and(|value| !is_usual("transform-box", &value)) {
        return Err(fault(node, "its `transform-box` is not read; write a matrix as its `transform`"));
    }
    let Some(origin) = property_of(node, "transform-origin") else { return Ok(map.then(&transform)) };
    let about = |[x, y]: [f64; 2]| {
        let shift = |x: f64, y: f64| Transform::new(1.0, 0.0, 0.0, 1.0, x, y);
        map.then(&shift(x, y)).then(&transform).then(&shift(-x, -y))
    };
    let mut lengths =
        origin.split([' ', ',', '\t', '\n', '\r']).filter(|part| !part.is_empty()).map(in_units);
    match [lengths.next().flatten(), lengths.next().flatten()] {
        [Some(x), Some(y)] => Ok(about([x, y])),
        _ if is_usual("transform-origin", &origin) => Ok(map.then(&transform)),
        _ => {
            let what = format!(
                "transform-origin = \"{origin}\" depends on the page or the shape; write two numbers"
            );
            Err(fault(node, what))
        }
    }
}

/// A length in units of the drawing, where it does not depend on the page.
fn in_units(text: &str) -> Option<f64> {
    let length: Length = text.parse().ok()?;
    let units = match length.unit {
        LengthUnit::None => Some(length.number),
        LengthUnit::Percent => (length.number == 0.0).then_some(0.0),
        _ => millimetres(length).map(|mm| mm / PIXEL),
    };
    units.filter(|units| units.is_finite())
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
    let mut sheet_has_pens = false;
    for node in root.descendants() {
        if node.tag_name().name() == "style" {
            sheet_has_pens |= check_sheet(&node)?;
        } else if is_animation(&node) && has_link(&node) {
            return Err(fault(
                &node,
                "it changes another element; draw that where it is wanted, and delete this",
            ));
        }
    }
    let mut reader = Reader {
        tolerance: options.chord_tolerance,
        layer: options.layer.as_deref(),
        drawn: Vec::new(),
        ignored: BTreeMap::new(),
        seen_layer: options.layer.is_none(),
        sheet_has_pens,
        hidden: 0,
        without_pen: 0,
    };
    reader.root(&root, map, options)?;
    if !reader.seen_layer {
        let layer = options.layer.as_deref().unwrap_or_default();
        return Err(OutlineError::new(format!("no element has the id or label \"{layer}\"")));
    }
    if reader.hidden > 0 {
        notes.push(format!("hidden elements, left out: {}", reader.hidden));
    }
    if reader.without_pen > 0 {
        notes.push(format!("shapes that neither fill nor stroke draws, left out: {}", reader.without_pen));
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
    fn root(&mut self, root: &Node<'_, '_>, map: Map, options: &OutlineOptions) -> Result<(), OutlineError> {
        // A page is placed by what shows it. Its size does not count where it is a share of that, or the scene has the unit.
        check_style(root, |property, value| {
            let sizes = is_any(property, &["width", "height"]);
            is_any(property, &["x", "y"])
                || (sizes && (options.scale.is_some() || keyword(value).ends_with('%')))
        })?;
        if root.attribute("transform").is_some_and(|transform| !is_usual("transform", transform)) {
            return Err(fault(
                root,
                "a `transform` of the page is not read; put its elements in a <g> that has it",
            ));
        }
        if !is_displayed(root)? {
            return Err(fault(root, "the page is hidden"));
        }
        let refused = unread(root);
        let pens = Pens::USUAL.within(root)?;
        let wanted = options.layer.is_none();
        self.children(root, Place { map, wanted, depth: 0, pens, refused: refused.as_ref() })
    }

    fn children(&mut self, node: &Node<'_, '_>, place: Place<'_>) -> Result<(), OutlineError> {
        if place.depth > MAX_DEPTH {
            return Err(fault(node, "elements are nested too deeply"));
        }
        node.children().filter(is_svg).try_for_each(|child| self.element(&child, place))
    }

    fn element(&mut self, node: &Node<'_, '_>, around: Place<'_>) -> Result<(), OutlineError> {
        let name = node.tag_name().name();
        if is_animation(node) {
            return Ok(());
        }
        let here = self.layer.is_some_and(|layer| is_named(node, layer));
        self.seen_layer |= here;
        let wanted = around.wanted || here;
        if !is_displayed(node)? {
            let layer = self.layer.filter(|_| !around.wanted);
            let within = layer.and_then(|layer| node.descendants().find(|n| is_named(n, layer)));
            if let Some(within) = within {
                let what = "it is hidden in the drawing; show it there, or name another `layer`";
                return Err(fault(&within, what));
            }
            self.hidden += usize::from(wanted);
            return Ok(());
        }
        check_style(node, |_, _| false)?;
        let own = unread(node);
        let place = Place {
            map: transformed(node, around.map)?,
            wanted,
            depth: around.depth + 1,
            pens: around.pens.within(node)?,
            refused: around.refused.or(own.as_ref()),
        };
        match name {
            "g" | "a" => return self.children(node, place),
            "switch" => return self.first_that_applies(node, place),
            "defs" | "style" | "clipPath" | "mask" | "marker" | "pattern" | "symbol" | "metadata"
            | "title" | "desc" | "namedview" | "linearGradient" | "radialGradient" | "filter" | "script" => {
                return Ok(());
            }
            _ if !wanted => return Ok(()),
            "use" | "svg" => {
                return Err(fault(node, "copies and pages within pages are not read; convert them to paths"));
            }
            _ => {}
        }
        let map = place.map;
        let curves = self.shape(node, name, &map)?;
        let Some(curves) = curves else {
            *self.ignored.entry(name.to_owned()).or_default() += 1;
            return Ok(());
        };
        if let Some(refused) = place.refused {
            return Err(refused.clone());
        }
        if !self.sheet_has_pens && !place.pens.draw(name) {
            self.without_pen += 1;
            return Ok(());
        }
        let has_markers = |n: Node<'_, '_>| {
            MARKERS.iter().any(|marker| property_of(&n, marker).is_some_and(|value| value != "none"))
        };
        if node.ancestors().filter(Node::is_element).any(has_markers) {
            *self.ignored.entry("marker".to_owned()).or_default() += 1;
        }
        let id = node.attribute("id").map_or_else(|| name.to_owned(), |id| format!("{name} \"{id}\""));
        for chords in curves {
            if chords.points.iter().any(|p| !p.coords.iter().all(|c| c.is_finite())) {
                return Err(fault(node, "a coordinate is not a finite number"));
            }
            self.drawn.push(Drawn { chords, line: line_of(node), entity: id.clone() });
        }
        Ok(())
    }

    /// Of a <switch>, the first element that is for all readers is drawn. One before it that is for some readers only is refused.
    fn first_that_applies(&mut self, node: &Node<'_, '_>, place: Place<'_>) -> Result<(), OutlineError> {
        let is_drawn =
            |n: &Node<'_, '_>| !["style", "defs", "title", "desc", "metadata"].contains(&n.tag_name().name());
        let first = node
            .children()
            .filter(is_svg)
            .find(|n| is_drawn(n) && n.attribute("requiredExtensions").is_none());
        let Some(first) = first else { return Ok(()) };
        match unread(&first).filter(|_| first.attribute("systemLanguage").is_some()) {
            Some(refused) if place.wanted => Err(refused),
            _ => self.element(&first, place),
        }
    }

    /// The curves of an element; `None` for kinds that are no outlines.
    fn shape(&self, node: &Node<'_, '_>, name: &str, map: &Map) -> Result<Option<Vec<Chords>>, OutlineError> {
        let or = |key: &str, default: f64| Ok::<f64, OutlineError>(user(node, key)?.unwrap_or(default));
        let needed = |key: &str| user(node, key)?.ok_or_else(|| fault(node, format!("{key} is missing")));
        let positive = |key: &str| match needed(key)? {
            length if length > 0.0 => Ok(length),
            length => Err(fault(node, format!("{key} is {length}"))),
        };
        let round = |cx: f64, cy: f64, rx: f64, ry: f64| {
            let axes = [map.x * rx, map.y * ry];
            let mut chords = Chords::closed(Vec::new());
            chords.ellipse(map.at(cx, cy), axes, 0.0, TAU, self.tolerance);
            vec![chords]
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
                let mut chords = Chords::closed(Vec::new());
                let corners = [
                    (x + w - rx0, y + ry0, -0.25),
                    (x + w - rx0, y + h - ry0, 0.0),
                    (x + rx0, y + h - ry0, 0.25),
                    (x + rx0, y + ry0, 0.5),
                ];
                for (cx, cy, from) in corners {
                    let (from, to) = (from * TAU, (from + 0.25) * TAU);
                    let axes = [map.x * rx0, map.y * ry0];
                    chords.points.push(map.at(cx, cy) + axes[0] * from.cos() + axes[1] * from.sin());
                    if rx0 > 0.0 && ry0 > 0.0 {
                        chords.ellipse(map.at(cx, cy), axes, from, to, self.tolerance);
                    }
                }
                vec![chords]
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
                vec![if name == "polygon" { Chords::closed(points) } else { Chords::open(points) }]
            }
            "line" => vec![Chords::open(vec![
                map.at(or("x1", 0.0)?, or("y1", 0.0)?),
                map.at(or("x2", 0.0)?, or("y2", 0.0)?),
            ])],
            _ => return Ok(None),
        };
        Ok(Some(curves))
    }

    fn path(&self, node: &Node<'_, '_>, map: &Map) -> Result<Vec<Chords>, OutlineError> {
        let mut curves: Vec<Chords> = Vec::new();
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
                    curve.closed = true;
                }
                (at, open) = (start, false);
                (cubic, quadratic) = (None, None);
                continue;
            }
            if !open {
                curves.push(Chords::open(vec![map.at(at[0], at[1])]));
                open = true;
            }
            let Some(chords) = curves.last_mut() else { continue };
            match segment {
                PathSegment::LineTo { x, y, .. } => at = to(x, y),
                PathSegment::HorizontalLineTo { x, .. } => at = [base[0] + x, from[1]],
                PathSegment::VerticalLineTo { y, .. } => at = [from[0], base[1] + y],
                PathSegment::CurveTo { x1, y1, x2, y2, x, y, .. } => {
                    at = to(x, y);
                    next_cubic = Some(to(x2, y2));
                    self.bezier(map, &[from, to(x1, y1), to(x2, y2), at], chords);
                }
                PathSegment::SmoothCurveTo { x2, y2, x, y, .. } => {
                    at = to(x, y);
                    next_cubic = Some(to(x2, y2));
                    self.bezier(map, &[from, mirrored(cubic), to(x2, y2), at], chords);
                }
                PathSegment::Quadratic { x1, y1, x, y, .. } => {
                    at = to(x, y);
                    next_quadratic = Some(to(x1, y1));
                    self.bezier(map, &[from, to(x1, y1), at], chords);
                }
                PathSegment::SmoothQuadratic { x, y, .. } => {
                    at = to(x, y);
                    let control = mirrored(quadratic);
                    next_quadratic = Some(control);
                    self.bezier(map, &[from, control, at], chords);
                }
                PathSegment::EllipticalArc { rx, ry, x_axis_rotation, large_arc, sweep, x, y, .. } => {
                    at = to(x, y);
                    let rotation = x_axis_rotation.to_radians();
                    self.arc(map, from, at, [rx.abs(), ry.abs()], rotation, large_arc, sweep, chords);
                }
                PathSegment::MoveTo { .. } | PathSegment::ClosePath { .. } => {}
            }
            (cubic, quadratic) = (next_cubic, next_quadratic);
            let end = map.at(at[0], at[1]);
            match chords.points.last_mut() {
                // Curves end there already, but for rounding.
                Some(last) if (*last - end).norm() <= 1e-9 => *last = end,
                _ => chords.points.push(end),
            }
        }
        Ok(curves)
    }

    fn bezier(&self, map: &Map, control: &[[f64; 2]], out: &mut Chords) {
        let control = control.iter().map(|c| map.at(c[0], c[1])).map(|p| [p.x, p.y, 1.0]).collect();
        out.bezier(control, self.tolerance);
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
        out: &mut Chords,
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
        out.ellipse(map.at(centre[0], centre[1]), axes, a0, a0 + turn, self.tolerance);
        if let Some(last) = out.points.last_mut() {
            *last = map.at(to[0], to[1]);
        }
    }
}
