//! What styles and style sheets say of outlines: whether they are shown, and by which pens.

use roxmltree::Node;
use svgtypes::Length;

use super::{OutlineError, fault};

/// Properties that hide, clip or place outlines and are read from styles of single elements, and as
/// attributes.
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

/// Properties by which shapes of a drawing are drawn at the corners of others.
pub(super) const MARKERS: [&str; 4] = ["marker", "marker-start", "marker-mid", "marker-end"];

/// Which pens draw a shape: those of the elements around it, where it has none of its own.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pens {
    fill: bool,
    fill_shows: bool,
    stroke: bool,
    stroke_shows: bool,
    stroke_is_wide: bool,
    /// Whether the fill is by `nonzero`, not `evenodd`.
    pub fill_is_nonzero: bool,
}

impl Pens {
    /// Those of a drawing that names none.
    pub const USUAL: Self = Self {
        fill: true,
        fill_shows: true,
        stroke: false,
        stroke_shows: true,
        stroke_is_wide: true,
        fill_is_nonzero: true,
    };

    pub fn within(self, node: &Node<'_, '_>) -> Result<Self, OutlineError> {
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
        let fill_is_nonzero = match property_of(node, "fill-rule").as_deref() {
            None | Some("inherit" | "unset") => self.fill_is_nonzero,
            Some("nonzero" | "initial") => true,
            Some("evenodd") => false,
            Some(_) => return Err(fault(node, "its `fill-rule` is not read; write nonzero or evenodd")),
        };
        Ok(Self {
            fill: paints("fill", self.fill),
            fill_shows: shows("fill-opacity", self.fill_shows)?,
            stroke: paints("stroke", self.stroke),
            stroke_shows: shows("stroke-opacity", self.stroke_shows)?,
            stroke_is_wide: is_wide,
            fill_is_nonzero,
        })
    }

    pub fn fill(self) -> bool {
        self.fill && self.fill_shows
    }

    pub fn draw(self, shape: &str) -> bool {
        (self.fill() && shape != "line") || (self.stroke && self.stroke_shows && self.stroke_is_wide)
    }
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

/// What style sheets set: it is not applied, so that it is not known of shapes.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Sheets {
    /// Which pens draw.
    pub pens: bool,
    /// What is filled.
    pub fill: bool,
    /// By which rule.
    pub fill_rule: bool,
}

/// Refuses rules of a style sheet that shape or hide outlines: they are not applied. Adds what they set.
pub(super) fn check_sheet(node: &Node<'_, '_>, sheets: &mut Sheets) -> Result<(), OutlineError> {
    let text: String = node.descendants().filter_map(|n| n.text().filter(|_| n.is_text())).collect();
    let bare = without_comments(&text);
    if bare.contains("@import") {
        return Err(fault(node, "rules of other files are not read; save the drawing without them"));
    }
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
        let sets = |of: &[&str]| declarations(block).any(|(property, _)| is_any(property, of));
        sheets.pens |= sets(&["fill", "stroke", "stroke-width"]);
        sheets.fill |= sets(&["fill"]);
        sheets.fill_rule |= sets(&["fill-rule"]);
    }
    Ok(())
}

/// Properties and values of a list of declarations.
fn declarations(text: &str) -> impl Iterator<Item = (&str, &str)> {
    let pairs = text.split(';').filter_map(|declaration| declaration.split_once(':'));
    pairs.map(|(property, value)| (property.trim(), value.trim()))
}

pub(super) fn is_any(property: &str, of: &[&str]) -> bool {
    of.iter().any(|one| property.eq_ignore_ascii_case(one))
}

/// A value as it is compared.
pub(super) fn keyword(value: &str) -> String {
    let value = value.trim().to_ascii_lowercase();
    value.strip_suffix("!important").unwrap_or(&value).trim_end().to_owned()
}

/// The value of a property of an element itself: its style goes before its attribute.
pub(super) fn property_of(node: &Node<'_, '_>, property: &str) -> Option<String> {
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
pub(super) fn is_usual(property: &str, value: &str) -> bool {
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
pub(super) fn is_displayed(node: &Node<'_, '_>) -> Result<bool, OutlineError> {
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
pub(super) fn check_style(
    node: &Node<'_, '_>,
    is_passed_over: impl Fn(&str, &str) -> bool,
) -> Result<(), OutlineError> {
    let style = node.attribute("style").map(without_comments).unwrap_or_default();
    let mut shaping = declarations(&style).filter(|(property, _)| is_any(property, &SHAPING));
    match shaping.find(|(property, value)| !is_usual(property, value) && !is_passed_over(property, value)) {
        Some((property, _)) => {
            Err(fault(node, format!("its style sets `{property}`; write that as an attribute of its own")))
        }
        None => Ok(()),
    }
}
