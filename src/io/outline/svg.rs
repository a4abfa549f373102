//! SVG: path, rect, circle, ellipse, polygon, polyline and line, with their transforms (W3C SVG 1.1, 2).
//!
//! Lengths in mm come from `width`, `height` and `viewBox`; without units 96 make an inch, as CSS has it. y,
//! which runs down in SVG, is turned up, with the lower edge of the page at 0. What is hidden, by any of the
//! ways that a drawing has for that, and what is not drawn in place (`defs`, symbols) is left out, with
//! notes. Refused is what would change the outlines and is not followed: clips, masks, filters, `use`,
//! animations, shapes for some readers only, and style sheets that show, hide, place or size shapes. Sheets
//! of colours and pens are passed over; texts and images are named.

mod fill;
mod page;
mod style;

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use roxmltree::{Document, Node};
use svgtypes::{PathParser, PathSegment, PointsParser};

use page::{Map, map_of, radius, transformed, user};
use style::{
    MARKERS, Pens, Sheets, check_sheet, check_style, is_any, is_displayed, is_usual, keyword, property_of,
};

use super::{Chords, Drawn, OutlineError, OutlineFormat, OutlineOptions};
use geometry::Point2;

/// Scalable Vector Graphics.
pub const FORMAT: OutlineFormat = OutlineFormat { extension: "svg", parse };

/// Deepest nesting of elements that is followed.
const MAX_DEPTH: usize = 64;

/// Elements by which a drawing moves or changes.
const ANIMATIONS: [&str; 6] =
    ["animate", "animateColor", "animateMotion", "animateTransform", "discard", "set"];

const NAMESPACE: &str = "http://www.w3.org/2000/svg";

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
    sheets: Sheets,
    hidden: usize,
    without_pen: usize,
    /// Subpaths with the fill of their path on both sides.
    within_fill: usize,
}

fn line_of(node: &Node<'_, '_>) -> usize {
    node.document().text_pos_at(node.range().start).row as usize
}

fn fault(node: &Node<'_, '_>, what: impl std::fmt::Display) -> OutlineError {
    let id = node.attribute("id").map_or_else(String::new, |id| format!(" \"{id}\""));
    OutlineError::at(line_of(node), format!("{}{id}: {what}", node.tag_name().name()))
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
    let map = map_of(&root, options, notes)?;
    let mut sheets = Sheets::default();
    for node in root.descendants() {
        if node.tag_name().name() == "style" {
            check_sheet(&node, &mut sheets)?;
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
        sheets,
        hidden: 0,
        without_pen: 0,
        within_fill: 0,
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
    if reader.within_fill > 0 {
        notes.push(format!(
            "outlines with the fill of their path on both sides, by its `fill-rule`, left out: {}",
            reader.within_fill
        ));
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
        // A page is placed by what shows it. Its size does not count where it is a share of that, or the
        // scene has the unit.
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
        // Where a style sheet says which pens draw, each shape counts as drawn.
        if !self.sheets.pens && !place.pens.draw(name) {
            self.without_pen += 1;
            return Ok(());
        }
        let curves = self.bounding_the_fill(node, place.pens, curves)?;
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

    /// Of the curves of a shape those that are seen where it is filled.
    fn bounding_the_fill(
        &mut self,
        node: &Node<'_, '_>,
        pens: Pens,
        mut curves: Vec<Chords>,
    ) -> Result<Vec<Chords>, OutlineError> {
        let Sheets { fill, fill_rule, .. } = self.sheets;
        if curves.len() < 2 || !(fill || pens.fill()) || !(fill_rule || pens.fill_is_nonzero) {
            return Ok(curves);
        }
        curves.iter_mut().for_each(Chords::tidy);
        let within = fill::within(&curves);
        if !within.is_empty() && (fill || fill_rule) {
            let what = "what it fills depends on its `fill-rule`, and a style sheet sets how shapes are filled, \
                        which is not read; save the drawing with presentation attributes instead";
            return Err(fault(node, what));
        }
        self.within_fill += within.len();
        let seen = curves.into_iter().enumerate().filter(|(k, _)| !within.contains(k));
        Ok(seen.map(|(_, curve)| curve).collect())
    }

    /// Of a <switch>, the first element that is for all readers is drawn. One before it that is for some
    /// readers only is refused.
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
                let (rx, ry) = (radius(node, "rx")?, radius(node, "ry")?);
                let radii = [rx.or(ry).unwrap_or(0.0).min(0.5 * w), ry.or(rx).unwrap_or(0.0).min(0.5 * h)];
                // Without one of the two a corner is square.
                let [rx0, ry0] = if radii.contains(&0.0) { [0.0; 2] } else { radii };
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
                    if rx0 > 0.0 {
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
