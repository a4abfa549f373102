//! Writes tables that [`parse_table`](super::parse_table) reads.

use std::fmt::Write as _;

use super::table::LEADING;
use blade::sections::{SectionCurve, Sections};

/// A table of these sections, mm. `title` becomes a comment. With `decimals` points are rounded to as many
/// (heights never); without, every number is written so that it is read back bit for bit.
pub fn write_table(sections: &Sections, title: &str, decimals: Option<usize>) -> String {
    let mut text = String::new();
    let shown = |value: f64| match decimals {
        // Adding zero turns a negative zero round.
        Some(decimals) => {
            let rounded: f64 = format!("{value:.decimals$}").parse().unwrap_or(value);
            format!("{:.decimals$}", rounded + 0.0)
        }
        None => format!("{value:?}"),
    };
    // Writing to a text cannot fail.
    for line in title.lines() {
        let _ = writeln!(text, "# {line}");
    }
    let _ = writeln!(text, "unit mm");
    if let Some((word, _)) = LEADING.iter().find(|(_, end)| Some(*end) == sections.leading()) {
        let _ = writeln!(text, "leading {word}");
    }
    for section in sections.sections() {
        let _ = writeln!(text, "\nsection {:?}", section.height);
        for (curve, points) in section.outline.curves() {
            let word = match curve {
                SectionCurve::Outline => "closed",
                SectionCurve::Pressure => "pressure",
                SectionCurve::Suction => "suction",
            };
            let _ = writeln!(text, "{word}");
            for p in points {
                let _ = writeln!(text, "{} {}", shown(p.x), shown(p.y));
            }
        }
    }
    text
}
