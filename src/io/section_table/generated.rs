//! Generated blades in TOML: see [`section_table`](super).

use super::UNITS;
use blade::sections::{
    GeneratedBlade, MAX_GENERATED_POINTS, MAX_GENERATED_SECTIONS, NacaDigits, Stacking, Station, TrailingEdge,
};
use geometry::{MAX_COORDINATE, Vector2};
use keys::{LENGTH, Section};
use keys::{SceneError, SceneText};

/// Sections that are generated where none are asked for.
const DEFAULT_SECTIONS: usize = 12;
/// Points a side where none are asked for.
const DEFAULT_POINTS: usize = 60;
/// Share of the chord that is stacked where none is asked for.
const DEFAULT_STACKING: f64 = 0.25;

/// Reads a generated blade.
///
/// # Errors
/// [`SceneError::Invalid`] for the first thing that is wrong in the text. What cannot be known from the text
/// alone (a trailing edge that does not fit) is told by [`GeneratedBlade::generate`].
pub fn parse_blade(source: &SceneText) -> Result<GeneratedBlade, SceneError> {
    let table = source.table()?;
    let root = Section::whole(source, table.get_ref(), "the blade");
    root.only(&["unit", "sections", "points", "trailing_edge", "stacking", "station"], &[], "a blade")?;
    let unit = root.word("unit", &UNITS.map(|u| u.0))?.map_or("mm", |u| u.value);
    let scale = UNITS.iter().find(|(word, _)| *word == unit).map_or(1.0, |(_, scale)| *scale);
    let count = |key, least: u32, most: usize, default: usize| {
        let found = root.count(key, least..=u32::try_from(most).unwrap_or(u32::MAX))?;
        Ok::<usize, SceneError>(found.map_or(default, |n| n as usize))
    };
    let sections = count("sections", 2, MAX_GENERATED_SECTIONS, DEFAULT_SECTIONS)?;
    let points = count("points", 12, MAX_GENERATED_POINTS, DEFAULT_POINTS)?;
    let trailing_edge = trailing_edge(&root, scale)?;
    let stacking = if root.is_text("stacking") {
        root.word("stacking", &["centroid"])?;
        Stacking::Centroid
    } else {
        Stacking::Chord(root.number_or("stacking", 0.0..=1.0, " (a share of the chord)", DEFAULT_STACKING)?)
    };
    let tables = root.sections("station")?;
    if tables.len() < 2 {
        let place = tables.first().map_or_else(|| root.header().clone(), |t| t.header().clone());
        let message = format!("the blade has {} of the 2 stations that it needs at least", tables.len());
        return Err(root.error(
            &place,
            message,
            "add tables `[[station]]` with `height`, `naca`, `chord` and `angle`",
        ));
    }
    let mut stations: Vec<Station> = Vec::with_capacity(tables.len());
    for table in &tables {
        let station = station(table, scale)?;
        if let Some(before) = stations.last().filter(|before| station.height <= before.height) {
            let message = format!(
                "the station at height {} is no higher than the one before, at {}",
                station.height / scale,
                before.height / scale
            );
            return Err(table.key_error("height", message, "give stations in rising order of height"));
        }
        stations.push(station);
    }
    Ok(GeneratedBlade { stations, sections, points, trailing_edge, stacking })
}

fn trailing_edge(root: &Section<'_>, scale: f64) -> Result<TrailingEdge, SceneError> {
    const KEY: &str = "trailing_edge";
    if let Some(table) = root.inline(KEY) {
        table.only(&["radius"], &[], "a trailing edge")?;
        let radius = table.required_number("radius", LENGTH, "", 0.3)?.value;
        return Ok(TrailingEdge::Rounded { radius: radius * scale });
    }
    if root.has(KEY) && !root.is_text(KEY) {
        let cure = "write \"closed\", \"open\" or { radius = 0.3 }";
        let message = "`trailing_edge` of the blade is neither a word nor a table";
        return Err(root.key_error(KEY, message, cure));
    }
    Ok(match root.word(KEY, &["closed", "open"])?.map(|word| word.value) {
        Some("open") => TrailingEdge::Open,
        _ => TrailingEdge::Closed,
    })
}

fn station(table: &Section<'_>, scale: f64) -> Result<Station, SceneError> {
    table.only(&["height", "naca", "chord", "angle", "lean", "thickness"], &[], "a station")?;
    let far = MAX_COORDINATE / scale;
    let height = table.required_number("height", -far..=far, "", 0.0)?.value;
    let text = table.required_text("naca", "2412")?;
    let digits = NacaDigits::parse(text.value).map_err(|e| {
        table.error(&text.span, e.to_string(), "write four digits between quotes, such as \"2412\"")
    })?;
    let chord = table.required_number("chord", LENGTH, "", 40.0)?.value;
    let angle = table.number_or("angle", -360.0..=360.0, " degrees", 0.0)?;
    let thickness = table.number_or("thickness", 0.005..=0.5, " (a share of the chord)", digits.thickness)?;
    let [x, y] =
        table.pair("lean", "write where the stacking point lies: `lean = [0, 2.5]`")?.unwrap_or([0.0; 2]);
    Ok(Station {
        height: height * scale,
        camber: digits.camber,
        position: digits.position,
        thickness,
        chord: chord * scale,
        angle: angle.to_radians(),
        lean: Vector2::new(x, y) * scale,
    })
}
