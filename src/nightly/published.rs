//! Figures that a source has published, beside which a page shows ours: the `[[published]]` of a rule file.

use keys::{SceneError, Section};

/// Figures of any kind lie within these.
const RANGE: std::ops::RangeInclusive<f64> = -1e9..=1e9;

/// A published figure, and where ours is.
#[derive(Debug, Clone, PartialEq)]
pub struct Published {
    /// The scene's name.
    pub scene: String,
    /// The toolpath's name.
    pub toolpath: String,
    /// Where the toolpath of report.json has it (RFC 6901).
    pub pointer: String,
    /// Name and unit.
    pub what: String,
    /// As published.
    pub value: f64,
    /// Who published it, and where.
    pub source: String,
    /// Why ours differs, if it does.
    pub why: String,
}

impl Published {
    /// Reads one.
    ///
    /// # Errors
    /// [`SceneError`] with the place and the cure.
    pub(crate) fn read(section: &Section<'_>) -> Result<Self, SceneError> {
        let keys = ["scene", "toolpath", "figure", "what", "value", "source", "why"];
        section.only(&keys, &[], "a published figure")?;
        let text = |key, example| Ok::<_, SceneError>(section.required_text(key, example)?.value.to_owned());
        let figure = section.required_text("figure", "/roughness/ra_mm")?;
        if !figure.value.starts_with('/') {
            let what = format!("\"{}\" is no place in a toolpath of report.json", figure.value);
            return Err(section.error(&figure.span, what, "write `figure = \"/roughness/ra_mm\"`, say"));
        }
        Ok(Self {
            scene: text("scene", "plate")?,
            toolpath: text("toolpath", "zigzag")?,
            pointer: figure.value.to_owned(),
            what: text("what", "Ra, mm")?,
            value: section.required_number("value", RANGE, "", 0.8)?.value,
            source: text("source", "Author, year, table 1")?,
            why: section.text("why")?.map_or_else(String::new, |why| why.value.to_owned()),
        })
    }
}
