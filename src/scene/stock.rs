//! `[stock]`: what there is before the first cut. A block around the part by default; or a block between two
//! corners, a round bar, or a mesh.

use std::fmt::{self, Write as _};
use std::path::Path;

use cutter::Cutter;
use geometry::{Aabb, Point3};
use keys::{LENGTH, SceneError, Section, toml_number as number, toml_numbers};
use sim::BarAxis;

use super::part::{MeshFile, PartSource};
use super::{DEFAULT_ALLOWANCE, DEFAULT_MARGIN};

/// The words for the axis of a bar.
const AXES: [(&str, BarAxis); 3] = [("z", BarAxis::Z), ("x", BarAxis::X), ("y", BarAxis::Y)];

/// Keys of a block around the part, and those of other shapes; the first one of each shape names it.
const AROUND: [&str; 3] = ["allowance", "margin", "roughed"];
const BLOCK: [&str; 1] = ["corners"];
const BAR: [&str; 4] = ["diameter", "length", "from", "axis"];
const MESH: [&str; 2] = ["file", "unit"];

/// What there is before the first cut.
#[derive(Debug, Clone, PartialEq)]
pub enum StockRequest {
    /// A block around the part.
    Around {
        /// Height of the flat top above the part's highest point, mm.
        allowance: f64,
        /// Growth of the part's rectangle on all four sides, mm.
        margin: f64,
        /// How much stands over the part's surface where the block was roughed before, mm; for voxels.
        roughed: Option<f64>,
    },
    /// A block, mm.
    Block(Aabb),
    /// A round bar.
    Bar {
        /// Middle of one end.
        from: Point3,
        /// Which way it runs from there.
        axis: BarAxis,
        /// Diameter, mm.
        diameter: f64,
        /// Length, mm.
        length: f64,
    },
    /// A casting, a forging, or what an earlier setup left.
    Mesh(MeshFile),
}

impl StockRequest {
    /// How much stands over the part where the block was roughed before, mm.
    pub fn roughed(&self) -> Option<f64> {
        match self {
            Self::Around { roughed, .. } => *roughed,
            _ => None,
        }
    }

    /// Its file, if it has one.
    pub fn file(&self) -> Option<&MeshFile> {
        match self {
            Self::Mesh(file) => Some(file),
            _ => None,
        }
    }

    /// Whether it is a block around the part.
    pub fn is_around(&self) -> bool {
        matches!(self, Self::Around { .. })
    }
}

/// Reads `[stock]`.
pub(super) fn read(
    stock: &Section<'_>,
    folder: &Path,
    part: &PartSource,
    cutter: &Cutter,
) -> Result<StockRequest, SceneError> {
    let shapes = [&BLOCK[..], &BAR, &MESH];
    let all: Vec<&str> = shapes.iter().flat_map(|keys| keys.iter().copied()).collect();
    let Some(own) = shapes.into_iter().find(|keys| stock.has(keys[0])) else {
        stock.only(&AROUND, &all, "a block around the part")?;
        return around(stock, part, cutter);
    };
    if matches!(part, PartSource::Pocket { .. }) {
        let (place, cure) =
            (stock.key_span(own[0]), "delete the keys of [stock], or name the pocket's floor as a mesh");
        return Err(stock.error(&place, "a pocket is milled into a block around it", cure));
    }
    let others: Vec<&str> = AROUND.iter().copied().chain(all).filter(|key| !own.contains(key)).collect();
    stock.only(own, &others, &format!("stock with `{}`", own[0]))?;
    match own[0] {
        "corners" => block(stock),
        "diameter" => bar(stock),
        _ => Ok(StockRequest::Mesh(MeshFile::of_table(stock, folder, "casting.stl")?)),
    }
}

fn around(stock: &Section<'_>, part: &PartSource, cutter: &Cutter) -> Result<StockRequest, SceneError> {
    // Zero is meant in both: stock may end at the part's top and at its rim.
    let length = |key, default| stock.number_or(key, 0.0..=*LENGTH.end(), " mm", default);
    // A pocket is milled into a finished face, and what is cut beside it has to be seen.
    let pocket = matches!(part, PartSource::Pocket { .. });
    let (top, around) = if pocket { (0.0, cutter.radius()) } else { (DEFAULT_ALLOWANCE, DEFAULT_MARGIN) };
    Ok(StockRequest::Around {
        allowance: length("allowance", top)?,
        margin: length("margin", around)?,
        roughed: stock.number("roughed", 0.0..=*LENGTH.end(), " mm")?.map(|v| v.value),
    })
}

fn block(stock: &Section<'_>) -> Result<StockRequest, SceneError> {
    let place = stock.key_span("corners");
    let cure = "write two opposite corners: `corners = [[0, 0, -10], [60, 40, 2]]`";
    let corners = stock.rows::<3>("corners", "two corners", cure)?.map_or_else(Vec::new, |rows| rows.value);
    let [a, b] = corners[..] else {
        return Err(stock.error(&place, format!("{} corners are given", corners.len()), cure));
    };
    let (a, b) = (Point3::from(a), Point3::from(b));
    let (min, max) = (a.inf(&b), a.sup(&b));
    if (0..3).any(|axis| max[axis] - min[axis] < *LENGTH.start()) {
        return Err(stock.error(&place, "the block has no volume", cure));
    }
    Ok(StockRequest::Block(Aabb { min, max }))
}

fn bar(stock: &Section<'_>) -> Result<StockRequest, SceneError> {
    let from = stock.vector("from")?.ok_or_else(|| {
        let message = "the bar begins nowhere";
        stock.key_error("diameter", message, "add `from = [0, 0, 0]`: the middle of one of its ends")
    })?;
    Ok(StockRequest::Bar {
        from: from.value.into(),
        axis: stock.choice("axis", &AXES)?,
        diameter: stock.required_length("diameter", 40.0)?.value,
        length: stock.required_length("length", 60.0)?.value,
    })
}

/// Writes `[stock]` as scenes spell it. A margin that nobody stated stays one.
pub(super) fn write(out: &mut String, stock: &StockRequest, is_stated: bool) -> fmt::Result {
    let list = |p: &Point3| toml_numbers(p.coords.as_slice());
    writeln!(out, "\n[stock]")?;
    match stock {
        StockRequest::Around { allowance, margin, roughed } => {
            writeln!(out, "allowance = {}  # mm above the part's highest point", number(*allowance))?;
            let (mark, about) =
                if is_stated { ("", "") } else { ("# ", "; written so, tools may come down beside it") };
            let margin = number(*margin);
            writeln!(out, "{mark}margin = {margin}  # mm around the part in the plan view{about}")?;
            if let Some(over) = roughed {
                let over = number(*over);
                writeln!(
                    out,
                    "roughed = {over}  # mm that stand over the part, for tilted tools and voxels"
                )?;
            }
            Ok(())
        }
        StockRequest::Block(Aabb { min, max }) => {
            writeln!(out, "corners = [{}, {}]  # mm", list(min), list(max))
        }
        StockRequest::Bar { from, axis, diameter, length } => {
            let word = AXES.iter().find(|(_, other)| other == axis).map_or("z", |(word, _)| word);
            writeln!(out, "diameter = {}  # mm", number(*diameter))?;
            writeln!(out, "length = {}  # mm", number(*length))?;
            writeln!(out, "from = {}  # middle of one end, mm", list(from))?;
            writeln!(out, "axis = \"{word}\"")
        }
        StockRequest::Mesh(file) => file.write_keys(out),
    }
}
