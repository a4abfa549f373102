//! From coordinates of a drawing to mm: its page, its lengths and the transforms of its elements.

use roxmltree::Node;
use svgtypes::{Align, AspectRatio, Length, LengthUnit, Transform, ViewBox};

use super::style::{is_usual, property_of};
use super::{OutlineError, OutlineOptions, fault};
use geometry::{Point2, Vector2};

/// mm of one CSS pixel.
const PIXEL: f64 = 25.4 / 96.0;

/// Scales that differ by less over the page, mm, are rounded in the last decimal, and not worth a note.
const ROUNDED: f64 = 1.0e-3;

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
pub(super) fn user(node: &Node<'_, '_>, name: &str) -> Result<Option<f64>, OutlineError> {
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

/// A radius of the corners of a rect; `None` where it is that of the other axis: not stated, `auto`, or
/// negative, which does not count (SVG 2, 7.4).
pub(super) fn radius(node: &Node<'_, '_>, name: &str) -> Result<Option<f64>, OutlineError> {
    if node.attribute(name).is_some_and(|text| text.trim() == "auto") {
        return Ok(None);
    }
    Ok(user(node, name)?.filter(|radius| *radius >= 0.0))
}

/// From the drawing's own coordinates to mm, y up.
#[derive(Debug, Clone, Copy)]
pub(super) struct Map {
    pub x: Vector2,
    pub y: Vector2,
    origin: Point2,
}

impl Map {
    pub fn at(&self, x: f64, y: f64) -> Point2 {
        self.origin + self.x * x + self.y * y
    }

    fn then(&self, t: &Transform) -> Self {
        Self { x: self.x * t.a + self.y * t.b, y: self.x * t.c + self.y * t.d, origin: self.at(t.e, t.f) }
    }
}

/// From the coordinates within an element to mm.
pub(super) fn transformed(node: &Node<'_, '_>, map: Map) -> Result<Map, OutlineError> {
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

/// From the page's coordinates to mm; notes tell what was taken where nothing says.
pub(super) fn map_of(
    root: &Node<'_, '_>,
    options: &OutlineOptions,
    notes: &mut Vec<String>,
) -> Result<Map, OutlineError> {
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
    let (scales, margins) = match (options.scale, scales, view) {
        (Some(scale), ..) => ([scale; 2], [0.0; 2]),
        (None, [Some(x), Some(y)], Some(view)) => fitted(root, [x, y], view, notes)?,
        (None, [Some(scale), _] | [None, Some(scale)], _) => ([scale; 2], [0.0; 2]),
        (None, [None, None], _) => ([PIXEL; 2], [0.0; 2]),
    };
    let named = |l: Option<Length>| l.is_some_and(|l| !matches!(l.unit, LengthUnit::None | LengthUnit::Px));
    if options.scale.is_none() && !named(width) && !named(height) {
        let inch = (25.4 / scales[0] * 1e4).round() / 1e4;
        notes.push(format!("the drawing has no unit; {inch} of its units make an inch"));
    }
    if let Some(scale) = scales.into_iter().find(|scale| !(*scale > 0.0 && scale.is_finite())) {
        return Err(fault(root, format!("one unit of the drawing is {scale} mm")));
    }
    let bottom = h.or_else(|| size(height).map(|mm| mm / scales[1])).unwrap_or(0.0);
    Ok(Map {
        x: Vector2::new(scales[0], 0.0),
        y: Vector2::new(0.0, -scales[1]),
        origin: Point2::new(margins[0] - x0 * scales[0], margins[1] + (y0 + bottom) * scales[1]),
    })
}

/// The mm of one unit along x and y, and the margins that are left beside and below a viewBox, where width and
/// height alone would scale it by `scales`: as `preserveAspectRatio` says (SVG 2, 8.7).
fn fitted(
    root: &Node<'_, '_>,
    scales: [f64; 2],
    view: ViewBox,
    notes: &mut Vec<String>,
) -> Result<([f64; 2], [f64; 2]), OutlineError> {
    let text = root.attribute("preserveAspectRatio").unwrap_or("xMidYMid");
    let AspectRatio { align, slice, .. } =
        text.parse().map_err(|e| fault(root, format!("preserveAspectRatio = \"{text}\": {e}")))?;
    let [x, y] = scales;
    let scale = if slice { x.max(y) } else { x.min(y) };
    let is_told = (x - y).abs() * view.w.max(view.h) > ROUNDED;
    let differ = format!("width and height scale the viewBox by {x:.7} and {y:.7} mm a unit");
    // Shares of what is left that lie on the left and below.
    let [left, below] = match align {
        Align::None => {
            if is_told {
                notes.push(format!("{differ}; as its preserveAspectRatio says, it is stretched so"));
            }
            return Ok((scales, [0.0; 2]));
        }
        Align::XMinYMin => [0.0, 1.0],
        Align::XMidYMin => [0.5, 1.0],
        Align::XMaxYMin => [1.0, 1.0],
        Align::XMinYMid => [0.0, 0.5],
        Align::XMidYMid => [0.5, 0.5],
        Align::XMaxYMid => [1.0, 0.5],
        Align::XMinYMax => [0.0, 0.0],
        Align::XMidYMax => [0.5, 0.0],
        Align::XMaxYMax => [1.0, 0.0],
    };
    if slice && is_told {
        let what = "preserveAspectRatio cuts it by a slice, which is not read";
        return Err(fault(root, format!("{differ}, and its {what}; write a height that fits the width")));
    }
    if is_told {
        notes.push(format!("{differ}; the smaller one holds, by its preserveAspectRatio"));
    }
    Ok(([scale; 2], [left * view.w * (x - scale), below * view.h * (y - scale)]))
}
