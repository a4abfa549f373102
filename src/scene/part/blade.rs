//! A blade as the part of a scene: its section table, and what is made of it.

use std::fmt::{self, Write as _};

use blade::{Blade, BladeSettings, BladeSide, FairingMethod, JUMP_REMOVING_STEP};
use geometry::{Isometry3, Vector3};
use io::section_table;
use keys::{LENGTH, SceneError, Section, toml_number, toml_numbers, toml_string};
use nalgebra::{Translation3, UnitQuaternion};
use part::{Part, Patch, default_tessellation_tolerance};

use super::source::{LoadError, Loaded, Loading, PartTable, Source};
use crate::named_file::NamedFile;

/// The key of a section table.
const KEY: &str = "sections";

/// Words for `side`.
const SIDES: [(&str, BladeSide); 5] = [
    ("both", BladeSide::Both),
    ("pressure", BladeSide::Pressure),
    ("suction", BladeSide::Suction),
    ("around", BladeSide::Around),
    ("passage", BladeSide::Passage),
];

/// Words for the method of fairing.
const METHODS: [(&str, FairingMethod); 4] = [
    ("kjellander", FairingMethod::Kjellander { step: JUMP_REMOVING_STEP }),
    ("control-points", FairingMethod::ControlPoints),
    ("energy", FairingMethod::Energy),
    ("published", FairingMethod::Published { neighbours: 1 }),
];

/// Most neighbours on each side for a corrected place.
const MOST_NEIGHBOURS: u32 = 20;

fn word(method: FairingMethod) -> &'static str {
    let same = |m: &FairingMethod| std::mem::discriminant(m) == std::mem::discriminant(&method);
    METHODS.iter().find(|(_, m)| same(m)).map_or(METHODS[0].0, |(word, _)| word)
}

/// What is made of a section table.
#[derive(Debug, Clone, PartialEq)]
pub struct BladeRequest {
    /// The table.
    pub file: NamedFile,
    /// Which surfaces are milled.
    pub side: BladeSide,
    /// Turns of the whole part about x, then y, then z, rad.
    pub rotate: [f64; 3],
    /// Where a second, equal blade stands, mm, before the part is turned.
    pub pitch: Option<Vector3>,
    /// How section points are faired, and how far one may be moved, mm.
    pub fairing: Option<(FairingMethod, f64)>,
}

fn read_fairing(table: &Section<'_>) -> Result<(FairingMethod, f64), SceneError> {
    table.only(&["method", "tolerance", "neighbours"], &[], "`fairing`")?;
    let word = table.required_word("method", &METHODS.map(|(word, _)| word))?;
    let method = METHODS.iter().find(|(known, _)| *known == word.value).unwrap_or(&METHODS[0]).1;
    let method = match (method, table.count("neighbours", 1..=MOST_NEIGHBOURS)?) {
        (FairingMethod::Published { .. }, Some(count)) => {
            FairingMethod::Published { neighbours: count as usize }
        }
        (_, Some(_)) => {
            return Err(table.key_error(
                "neighbours",
                format!("`neighbours` says nothing to the method \"{}\"", word.value),
                "remove it, or write `method = \"published\"`",
            ));
        }
        (method, None) => method,
    };
    let tolerance = table.required_number("tolerance", LENGTH, " mm", 0.05)?.value;
    Ok((method, tolerance))
}

impl Source for BladeRequest {
    const KEY: Option<&'static str> = Some(KEY);
    const EXAMPLE: Option<&'static str> = Some("sections = \"blade.txt\"");

    fn keys() -> Vec<&'static str> {
        vec![KEY, "side", "rotate", "pitch", "fairing"]
    }

    fn read(table: &PartTable<'_>) -> Result<Self, SceneError> {
        table.only(&Self::keys(), "a part from sections")?;
        let part = table.table;
        let file = table.named(part.required_text(KEY, "blade.txt")?);
        let words = SIDES.map(|(word, _)| word);
        let word = part.word("side", &words)?;
        let side = word.as_ref().and_then(|word| SIDES.iter().find(|(name, _)| *name == word.value));
        let side = side.map_or(BladeSide::Both, |(_, side)| *side);
        let rotate = part.vector("rotate")?.map_or([0.0; 3], |v| v.value.map(f64::to_radians));
        let pitch = part.vector("pitch")?;
        if pitch.is_none() && side == BladeSide::Passage {
            return Err(part.key_error(
                "side",
                "a passage lies between two blades, and there is one",
                "add `pitch = [0, 20, 0]`: where the second blade stands, mm from the first",
            ));
        }
        if let Some(zero) = pitch.as_ref().filter(|v| v.value.iter().all(|x| *x == 0.0)) {
            return Err(part.error(
                &zero.span,
                "the second blade would stand in the first",
                "write a pitch in mm",
            ));
        }
        let fairing = part.inline("fairing").map(|table| read_fairing(&table)).transpose()?;
        if fairing.is_none() && part.has("fairing") {
            if let Some(word) = part.text("fairing")?
                && METHODS.iter().any(|(method, _)| *method == word.value)
            {
                let cure = format!("write `fairing = {{ method = \"{}\", tolerance = 0.05 }}`", word.value);
                let message = format!("`fairing` = \"{}\" does not say how far a point may move", word.value);
                return Err(part.error(&word.span, message, cure));
            }
            part.word("fairing", &["none"])?;
        }
        let pitch = pitch.map(|v| Vector3::from(v.value));
        Ok(Self { file, side, rotate, pitch, fairing })
    }

    fn write(&self, out: &mut String) -> fmt::Result {
        writeln!(out, "{KEY} = {}", toml_string(&self.file.written))?;
        let side = SIDES.iter().find(|(_, side)| *side == self.side).map_or("both", |(word, _)| word);
        writeln!(out, "side = \"{side}\"")?;
        writeln!(
            out,
            "rotate = {}  # degrees about x, y, z",
            toml_numbers(&self.rotate.map(f64::to_degrees))
        )?;
        if let Some(pitch) = self.pitch {
            writeln!(out, "pitch = {}  # mm to the second blade", toml_numbers(pitch.as_slice()))?;
        }
        match self.fairing {
            Some((method, tolerance)) => {
                let neighbours = match method {
                    FairingMethod::Published { neighbours } => format!(", neighbours = {neighbours}"),
                    _ => String::new(),
                };
                let (word, tolerance) = (word(method), toml_number(tolerance));
                writeln!(
                    out,
                    "fairing = {{ method = \"{word}\", tolerance = {tolerance}{neighbours} }}  # mm that a point may move"
                )
            }
            None => writeln!(out, "fairing = \"none\""),
        }
    }

    fn file(&self) -> Option<&NamedFile> {
        Some(&self.file)
    }

    fn load(&self, job: &Loading<'_>) -> Result<Loaded, LoadError> {
        let file = &self.file;
        let sections = section_table::read(&file.path).map_err(|e| job.refused(file, e))?;
        let [x, y, z] = self.rotate;
        let settings = BladeSettings {
            side: self.side,
            pitch: self.pitch,
            placed: Isometry3::from_parts(
                Translation3::identity(),
                UnitQuaternion::from_euler_angles(x, y, z),
            ),
            fairing: self.fairing,
        };
        let blade = Blade::new(&sections, &settings).map_err(|e| match e.cure() {
            Some(cure) => job.source.error(file.span.clone(), e.to_string(), cure),
            None => job.refused(file, e),
        })?;
        let patches: Vec<Patch> = blade.surfaces.iter().cloned().map(Patch::Nurbs).collect();
        let tolerance = default_tessellation_tolerance(&patches);
        let part = Part::from_oriented_patches(patches, tolerance).map_err(|e| job.refused(file, e))?;
        let notes = blade.notes();
        Ok(Loaded { blade: Some(blade), notes, ..Loaded::from(part) })
    }
}

#[cfg(test)]
mod tests {
    use crate::Scene;

    fn scene(fairing: &str) -> Result<Scene, keys::SceneError> {
        let part = format!("[part]\nsections = \"rotor.txt\"\nfairing = {fairing}\n");
        let rest = "[cutter]\nshape = \"ball\"\ndiameter = 4\n[tolerance]\nscallop = 0.01\n[[toolpath]]\nstrategy = \"zigzag\"\n";
        Scene::parse("rotor.toml", part + rest)
    }

    #[test]
    fn the_published_loop_takes_neighbours_and_no_other_method_does() {
        let read = scene("{ method = \"published\", tolerance = 0.02, neighbours = 3 }").unwrap();
        let written = crate::complete_toml(&read);
        assert!(written.contains("method = \"published\", tolerance = 0.02, neighbours = 3"), "{written}");
        let refused = scene("{ method = \"energy\", tolerance = 0.02, neighbours = 3 }").unwrap_err();
        assert!(
            refused.to_string().contains("`neighbours` says nothing to the method \"energy\""),
            "{refused}"
        );
        for neighbours in ["0", "20.5"] {
            let key = format!("{{ method = \"published\", tolerance = 0.02, neighbours = {neighbours} }}");
            let refused = scene(&key).unwrap_err().to_string();
            assert!(refused.contains("expected a whole number (1 to 20)"), "{refused}");
        }
        let bare = scene("\"kjellander\"").unwrap_err();
        assert!(bare.to_string().contains("how far a point may move"), "{bare}");
    }
}
