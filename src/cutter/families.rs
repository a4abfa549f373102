//! The list of the families of cutters, and what reads and writes all of them: a new family is a file of
//! its own and a line of the list.

use std::fmt::{self, Write as _};

use keys::{SceneError, Section, toml_number};

use super::body::{Cutter, CutterError};
use super::family::{CutterKey, Family};
use super::{apt, ball, bull, flat, taper};

/// The families, in the order in which messages list them.
pub static FAMILIES: [Family; 5] = [ball::FAMILY, flat::FAMILY, bull::FAMILY, taper::FAMILY, apt::FAMILY];

/// The key of the family's word.
const SHAPE: &str = "shape";

/// The words of all families.
fn words() -> Vec<&'static str> {
    FAMILIES.iter().map(|family| family.word).collect()
}

/// The keys of all families, each once.
fn all_keys() -> Vec<&'static str> {
    let mut names = Vec::new();
    for key in FAMILIES.iter().flat_map(|family| family.keys) {
        if !names.contains(&key.name) {
            names.push(key.name);
        }
    }
    names
}

/// The short forms of all families that have one, `ball:DIAMETER, … or …`.
pub fn short_forms() -> String {
    let forms: Vec<String> = FAMILIES.iter().filter_map(Family::short_form).collect();
    match forms.split_last() {
        Some((last, rest)) if !rest.is_empty() => format!("{} or {last}", rest.join(", ")),
        _ => forms.concat(),
    }
}

impl Cutter {
    /// The family that the cutter was made as. Only what names it to its user asks for it: how it cuts is
    /// a matter of its profile.
    pub fn family(&self) -> &'static Family {
        // Any cutter can be written by its seven words.
        FAMILIES
            .iter()
            .find(|family| family.word == self.family_word())
            .unwrap_or(&FAMILIES[FAMILIES.len() - 1])
    }

    /// How far the cutting edges reach up from the tip, mm, where the family has a key for it.
    pub fn stated_length(&self) -> Option<f64> {
        let key = self.family().keys.iter().find(|key| key.name == "length")?;
        Some(key.of(self))
    }

    /// Its word and dimensions in one word, `ball:6`: as the command line takes it, rounded to four decimals,
    /// mm and degrees.
    pub fn short_name(&self) -> String {
        let family = self.family();
        let rounded = |key: &CutterKey| (key.of(self) * 1e4).round() / 1e4;
        family.keys.iter().fold(family.word.to_owned(), |name, key| format!("{name}:{}", rounded(key)))
    }

    /// Reads a cutter from the table `[cutter]`, which may have the keys `besides` too.
    ///
    /// # Errors
    /// [`SceneError::Invalid`] for the first thing that is wrong, at its place.
    pub fn read(table: &Section<'_>, besides: &[&'static str]) -> Result<Self, SceneError> {
        let all: Vec<&str> = [SHAPE].into_iter().chain(all_keys()).chain(besides.iter().copied()).collect();
        if !table.has(SHAPE) {
            table.only(&all, &[], "a cutter")?;
        }
        let word = table.required_word(SHAPE, &words())?.value;
        let family = FAMILIES.iter().find(|family| family.word == word).unwrap_or(&FAMILIES[0]);
        let own = family.keys.iter().map(|key| key.name);
        let keys: Vec<&str> = [SHAPE].into_iter().chain(own).chain(besides.iter().copied()).collect();
        table.only(&keys, &all, &format!("{SHAPE} = \"{word}\""))?;
        let values = family.keys.iter().map(|key| read(table, key)).collect::<Result<Vec<_>, _>>()?;
        family.cutter(&values).map_err(|error| refusal(table, family, &error))
    }

    /// Writes the word and the dimensions as `[cutter]` has them.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn write(&self, out: &mut String) -> fmt::Result {
        let family = self.family();
        writeln!(out, "{SHAPE} = \"{}\"", family.word)?;
        family.keys.iter().try_for_each(|key| {
            let comment = if key.note.is_empty() { "" } else { "  # " };
            writeln!(out, "{} = {}{comment}{}", key.name, toml_number(key.of(self)), key.note)
        })
    }
}

fn read(table: &Section<'_>, key: &CutterKey) -> Result<Option<f64>, SceneError> {
    let number = match key.example {
        Some(example) => Some(table.required_number(key.name, key.range.clone(), key.unit, example)?),
        None => table.number(key.name, key.range.clone(), key.unit)?,
    };
    Ok(number.map(|number| number.value))
}

/// The refusal at the key to which the error belongs. Errors of cutters speak of whole dimensions.
fn refusal(table: &Section<'_>, family: &Family, error: &CutterError) -> SceneError {
    let key = (family.blame)(error);
    let cure = match error {
        CutterError::Apt(refusal) => refusal.cure.clone(),
        _ => format!("change `{key}`"),
    };
    let span = table.key_span(if table.has(key) { key } else { SHAPE });
    table.error(&span, error.to_string(), format!("`{key}`: {cure}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use keys::SceneText;

    fn read_back(text: &str) -> Result<Cutter, SceneError> {
        let source = SceneText::new("cutter.toml", text);
        let table = source.table()?;
        Cutter::read(&Section::root(&source, table.get_ref()).section("cutter")?, &["feed_rate"])
    }

    #[test]
    fn each_family_is_written_as_it_is_read() {
        let words = crate::AptWords::examples().into_iter().map(|words| Cutter::apt(&words).unwrap());
        let named = FAMILIES.iter().filter_map(|family| family.example).map(|text| text.parse().unwrap());
        for cutter in words.chain(named) {
            let cutter: Cutter = cutter;
            let mut text = "[cutter]\n".to_owned();
            cutter.write(&mut text).unwrap();
            let again = read_back(&text).unwrap_or_else(|e| panic!("{text}: {e}"));
            assert_eq!(again.family().word, cutter.family().word);
            assert!((again.radius() - cutter.radius()).abs() < 1e-9, "{text}");
            let mut twice = "[cutter]\n".to_owned();
            again.write(&mut twice).unwrap();
            assert_eq!(twice, text);
        }
    }

    #[test]
    fn errors_belong_to_a_key_of_their_family() {
        for (text, key) in [
            ("shape = \"bull\"\ndiameter = 6\ncorner_radius = 4", "corner_radius"),
            ("shape = \"bull\"\ndiameter = 10000\ncorner_radius = 4", "diameter"),
            ("shape = \"taper\"\ntip_diameter = 2\nhalf_angle = 5\nshank_diameter = 1", "shank_diameter"),
            (
                "shape = \"taper\"\ntip_diameter = 2\ncorner_radius = 3\nhalf_angle = 5\nshank_diameter = 6",
                "corner_radius",
            ),
            ("shape = \"apt\"\ndiameter = 6\ntip_angle = -3\nlength = 20", "tip_angle"),
        ] {
            let Err(SceneError::Invalid(finding)) = read_back(&format!("[cutter]\n{text}\n")) else {
                panic!("{text}")
            };
            assert!(finding.cure.starts_with(&format!("`{key}`: ")), "{text}: {}", finding.cure);
        }
    }
}
