//! What a tilted tool must keep away from: `[interference]` and `[[fixture]]`.

use std::fmt::{self, Write as _};
use std::path::Path;

use super::part::MeshFile;
use keys::toml_number as number;
use keys::{LENGTH, SceneError, Section};

/// Default distance of shank and holder from part and fixtures, mm.
const DEFAULT_CLEARANCE: f64 = 0.5;

/// By default the axis may lean so far away from its rule, degrees.
const DEFAULT_TILT: f64 = 45.0;

/// A mesh that is not to be touched: a neighbouring part, a vise.
pub type Fixture = MeshFile;

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
    let length = 0.0..=*LENGTH.end();
    let fixture = |section: &Section<'_>| {
        section.only(&["file", "unit"], &[], "a fixture")?;
        MeshFile::of_table(section, folder, "vise.stl")
    };
    Ok(KeepClear {
        clearance: section.number_or("clearance", length.clone(), " mm", DEFAULT_CLEARANCE)?,
        greatest_tilt: section.number_or("tilt", 0.0..=80.0, " degrees", DEFAULT_TILT)?.to_radians(),
        greatest_lift: section.number_or("lift", length, " mm", 0.0)?,
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
        fixture.write_keys(out)
    })
}
