//! What a tilted tool must keep away from: `[interference]` and `[[fixture]]`.

use std::fmt::{self, Write as _};
use std::path::Path;

use super::read::read_mesh_file;
use super::{MeshFormat, NamedFile};
use keys::SceneError;
use keys::{LENGTH, Section};
use keys::{toml_number as number, toml_string as text};

/// Default distance of shank and holder from part and fixtures, mm.
const DEFAULT_CLEARANCE: f64 = 0.5;

/// By default the axis may lean so far away from its rule, degrees.
const DEFAULT_TILT: f64 = 45.0;

/// A mesh that is not to be touched: a neighbouring part, a vise.
#[derive(Debug, Clone, PartialEq)]
pub struct Fixture {
    /// The file.
    pub file: NamedFile,
    /// Its kind, from its extension.
    pub format: MeshFormat,
    /// Name of the unit of its coordinates.
    pub unit: &'static str,
    /// That unit in mm.
    pub scale: f64,
}

/// How tilted tools are kept clear.
#[derive(Debug, Clone, PartialEq)]
pub struct KeepClear {
    /// Least distance of shank and holder from part and fixtures, mm.
    pub clearance: f64,
    /// The axis may lean so far away from its rule, rad; 0 leaves the rule alone.
    pub greatest_tilt: f64,
    /// A contact may be lifted so far, mm; material is left there.
    pub greatest_lift: f64,
    /// What else is not to be touched.
    pub fixtures: Vec<Fixture>,
}

/// Reads `[interference]` and `[[fixture]]`.
pub(super) fn read(root: &Section<'_>, folder: &Path) -> Result<KeepClear, SceneError> {
    let section = root.section("interference")?;
    section.only(&["clearance", "tilt", "lift"], &[], "[interference]")?;
    let number = |key, range, unit, default: f64| {
        Ok::<f64, SceneError>(section.number(key, range, unit)?.map_or(default, |v| v.value))
    };
    let length = 0.0..=*LENGTH.end();
    let fixture = |section: &Section<'_>| {
        section.only(&["file", "unit"], &[], "a fixture")?;
        let (file, format, unit, scale) = read_mesh_file(section, folder, "vise.stl")?;
        Ok(Fixture { file, format, unit, scale })
    };
    Ok(KeepClear {
        clearance: number("clearance", length.clone(), " mm", DEFAULT_CLEARANCE)?,
        greatest_tilt: number("tilt", 0.0..=80.0, " degrees", DEFAULT_TILT)?.to_radians(),
        greatest_lift: number("lift", length, " mm", 0.0)?,
        fixtures: root.sections("fixture")?.iter().map(fixture).collect::<Result<_, SceneError>>()?,
    })
}

/// Writes both as scenes spell them.
pub(super) fn write(out: &mut String, keep: &KeepClear) -> fmt::Result {
    writeln!(out, "\n[interference]  # of tilted tools")?;
    writeln!(out, "clearance = {}  # mm of shank and holder from part and fixtures", number(keep.clearance))?;
    writeln!(
        out,
        "tilt = {}  # degrees by which the axis may leave its rule",
        number(keep.greatest_tilt.to_degrees())
    )?;
    writeln!(out, "lift = {}  # mm by which contacts may be lifted", number(keep.greatest_lift))?;
    keep.fixtures.iter().try_for_each(|fixture| {
        writeln!(out, "\n[[fixture]]")?;
        writeln!(out, "file = {}", text(&fixture.file.written))?;
        writeln!(out, "unit = {}", text(fixture.unit))
    })
}
