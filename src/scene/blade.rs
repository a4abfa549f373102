//! A blade as the part of a scene: its section table, and what is made of it.

use std::fmt::{self, Write as _};

use super::{NamedFile, PartSource};
use blade::{BladeSide, FairingMethod, JUMP_REMOVING_STEP};
use geometry::Vector3;
use keys::SceneError;
use keys::{LENGTH, Located, Section};
use keys::{toml_number as number, toml_string as text};

/// The key of a section table.
pub(super) const KEY: &str = "sections";

/// Keys of a part from sections besides its table.
pub(super) const KEYS: [&str; 4] = ["side", "rotate", "pitch", "fairing"];

/// Words for `side`.
const SIDES: [(&str, BladeSide); 5] = [
    ("both", BladeSide::Both),
    ("pressure", BladeSide::Pressure),
    ("suction", BladeSide::Suction),
    ("around", BladeSide::Around),
    ("passage", BladeSide::Passage),
];

/// Words for the method of fairing.
const METHODS: [(&str, FairingMethod); 3] = [
    ("kjellander", FairingMethod::Kjellander { step: JUMP_REMOVING_STEP }),
    ("control-points", FairingMethod::ControlPoints),
    ("energy", FairingMethod::Energy),
];

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

/// Reads a part from sections.
pub(super) fn read(
    part: &Section<'_>,
    named: impl Fn(Located<&str>) -> NamedFile,
) -> Result<PartSource, SceneError> {
    let file = named(part.required_text(KEY, "blade.txt")?);
    let words = SIDES.map(|(word, _)| word);
    let word = part.word("side", &words)?;
    let side = word.as_ref().and_then(|word| SIDES.iter().find(|(name, _)| *name == word.value));
    let side = side.map_or(BladeSide::Both, |(_, side)| *side);
    let rotate = part.vector("rotate")?.map_or([0.0; 3], |v| v.value.map(f64::to_radians));
    let pitch = part.vector("pitch")?;
    if pitch.is_none() && side == BladeSide::Passage {
        return Err(part.error(
            &part.key_span("side"),
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
        part.word("fairing", &["none"])?;
    }
    let pitch = pitch.map(|v| Vector3::from(v.value));
    Ok(PartSource::Blade(BladeRequest { file, side, rotate, pitch, fairing }))
}

fn read_fairing(table: &Section<'_>) -> Result<(FairingMethod, f64), SceneError> {
    table.only(&["method", "tolerance"], &[], "`fairing`")?;
    let method = table.required_word("method", &METHODS.map(|(word, _)| word))?;
    let method = METHODS.iter().find(|(word, _)| *word == method.value).unwrap_or(&METHODS[0]).1;
    let tolerance = table.required_number("tolerance", LENGTH, " mm", 0.05)?.value;
    Ok((method, tolerance))
}

/// Writes a part from sections as scenes spell it.
pub(super) fn write(out: &mut String, blade: &BladeRequest) -> fmt::Result {
    writeln!(out, "{KEY} = {}", text(&blade.file.written))?;
    let side = SIDES.iter().find(|(_, side)| *side == blade.side).map_or("both", |(word, _)| word);
    writeln!(out, "side = \"{side}\"")?;
    let list = |v: [f64; 3]| format!("[{}]", v.map(number).join(", "));
    writeln!(out, "rotate = {}  # degrees about x, y, z", list(blade.rotate.map(f64::to_degrees)))?;
    if let Some(pitch) = blade.pitch {
        writeln!(out, "pitch = {}  # mm to the second blade", list(pitch.into()))?;
    }
    match blade.fairing {
        Some((method, tolerance)) => writeln!(
            out,
            "fairing = {{ method = \"{}\", tolerance = {} }}  # mm that a point may move",
            METHODS.iter().find(|(_, m)| *m == method).map_or("kjellander", |(word, _)| word),
            number(tolerance)
        ),
        None => writeln!(out, "fairing = \"none\""),
    }
}
