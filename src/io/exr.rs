//! OpenEXR files of maps over a grid, full precision.
//!
//! Channels: `Z` height, mm, and `deviation`, mm (NaN off the part), 32-bit float; `move` the index of the
//! move of the toolpath that cut a cell last, 32-bit whole number, 4294967295 where none of its moves did.
//! Row 0 of the picture holds the greatest y, as pictures are looked at. One text attribute, `millstream`,
//! holds JSON: `cell_mm`, `origin_mm` (centre of the cell at the lower left), `unit`.
//!
//! Lines are compressed on the calling thread, because the crate's own threads ignore the thread number that
//! the user asks for.

use std::io::{self, Cursor};

use exr::image::write::layers::WritableLayers;
use exr::prelude::{
    AttributeValue, Blocks, Compression, Encoding, Image, ImageAttributes, Layer, LayerAttributes, LineOrder,
    SpecificChannels, Text, Vec2, WritableImage,
};

use metrology::{NormalMap, PatchGrid};
use sim::{Grid, NOT_CUT, ZMap};

/// ZIP by lines. On the maps of the shipped scenes ZIP over 16 lines took half as long again for files
/// 7 to 24 % smaller, PIZ took as long as that for files no smaller, and run lengths saved nothing.
const ENCODING: Encoding =
    Encoding { compression: Compression::ZIP1, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };

/// The bytes of an EXR file. `deviation` is over the grid of `cut`, whose moves before the `first` are those
/// of other toolpaths.
///
/// # Errors
/// What the encoder says; [`io::ErrorKind::InvalidInput`] when the maps differ in size.
pub fn encode(cut: &ZMap, deviation: &[f32], first: u32) -> io::Result<Vec<u8>> {
    let grid = &cut.grid;
    if [cut.height.len(), cut.cut_by.len(), deviation.len()] != [grid.len(); 3] {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "the maps differ in size"));
    }
    let pixel = |Vec2(column, row): Vec2<usize>| {
        let cell = grid.index(column, grid.ny - 1 - row);
        let by = Some(cut.cut_by[cell]).filter(|by| *by != NOT_CUT);
        let own = by.and_then(|by| by.checked_sub(first)).unwrap_or(NOT_CUT);
        (cut.height[cell], deviation[cell], own)
    };
    let channels = SpecificChannels::build()
        .with_channel("Z")
        .with_channel("deviation")
        .with_channel("move")
        .with_pixel_fn(pixel);
    let layer = Layer::new((grid.nx, grid.ny), LayerAttributes::default(), ENCODING, channels);
    let mut image = Image::from_layer(layer);
    describe(&mut image.attributes, &description(grid));
    bytes_of(&image)
}

/// The bytes of an EXR file over the parameters of a patch: channels `X`, `Y`, `Z`, the design point, mm,
/// `deviation`, mm (NaN where nothing was cut near), and `move`. Row 0 holds the greatest v, columns run with
/// u; the text attribute `millstream` holds the parameters' ranges.
///
/// # Errors
/// What the encoder says.
pub fn encode_patch(map: &NormalMap, patch: &PatchGrid) -> io::Result<Vec<u8>> {
    let [nu, nv] = patch.counts;
    let pixel = |Vec2(column, row): Vec2<usize>| {
        let k = patch.first + (nv - 1 - row) * nu + column;
        let [x, y, z] = map.points[k].coords.map(|c| c as f32).into();
        (x, y, z, map.deviations[k], map.cut_by[k])
    };
    let channels = SpecificChannels::build()
        .with_channel("X")
        .with_channel("Y")
        .with_channel("Z")
        .with_channel("deviation")
        .with_channel("move")
        .with_pixel_fn(pixel);
    let [[u0, u1], [v0, v1]] = patch.domain;
    let description = format!(
        r#"{{"unit":"mm","u":[{u0:?},{u1:?}],"v":[{v0:?},{v1:?}],"rows":"greatest v first","move_none":{}}}"#,
        u32::MAX
    );
    let mut image = Image::from_layer(Layer::new((nu, nv), LayerAttributes::default(), ENCODING, channels));
    describe(&mut image.attributes, &description);
    bytes_of(&image)
}

/// A single attribute: the crate keeps them in a hash map, and with two the bytes would vary.
fn describe(attributes: &mut ImageAttributes, description: &str) {
    attributes.other.insert(Text::from("millstream"), AttributeValue::Text(Text::from(description)));
}

/// On this thread: the crate's own threads would ignore how many the user allows.
fn bytes_of<'i, L: WritableLayers<'i>>(image: &'i Image<L>) -> io::Result<Vec<u8>> {
    let mut bytes = Cursor::new(Vec::new());
    image.write().non_parallel().to_buffered(&mut bytes).map_err(io::Error::other)?;
    Ok(bytes.into_inner())
}

/// What the pixels are, as JSON.
fn description(grid: &Grid) -> String {
    format!(
        r#"{{"unit":"mm","cell_mm":{:?},"origin_mm":[{:?},{:?}],"rows":"greatest y first","move_none":{}}}"#,
        grid.cell, grid.origin.x, grid.origin.y, NOT_CUT
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use exr::prelude::{FlatSamples, ReadChannels, ReadLayers};
    use geometry::Point2;

    #[test]
    fn maps_come_back_bit_for_bit_with_cell_and_origin() {
        let grid = Grid { origin: Point2::new(-1.5, 0.25), cell: 0.05, nx: 3, ny: 2 };
        let height = vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.5];
        let cut_by = vec![0, 1, 2, 3, u32::MAX, 16_777_217];
        let cut = ZMap { height, cut_by, ..ZMap::block(grid, 0.0) };
        let deviation = [0.0, -0.25, f32::NAN, 1e-9, 0.5, 7.0];
        let bytes = encode(&cut, &deviation, 0).unwrap();
        assert_eq!(bytes, encode(&cut, &deviation, 0).unwrap(), "the same bytes every time");
        let read = |bytes: Vec<u8>| {
            let layers = exr::prelude::read().no_deep_data().largest_resolution_level().all_channels();
            layers.first_valid_layer().all_attributes().from_buffered(Cursor::new(bytes)).unwrap()
        };
        // Moves before the first are those of other toolpaths.
        let behind = read(encode(&cut, &deviation, 2).unwrap());
        let moves = &behind.layer_data.channel_data.list[2].sample_data;
        let none = u32::MAX;
        assert_eq!(*moves, FlatSamples::U32(vec![1, none, 16_777_215, none, none, 0]));
        let image = read(bytes);
        let channels = &image.layer_data.channel_data.list;
        let names: Vec<String> = channels.iter().map(|c| c.name.to_string()).collect();
        assert_eq!(names, ["Z", "deviation", "move"]);
        assert_eq!(channels[0].sample_data, FlatSamples::F32(vec![4.0, 5.0, 6.5, 1.0, 2.0, 3.0]));
        assert_eq!(channels[2].sample_data, FlatSamples::U32(vec![3, u32::MAX, 16_777_217, 0, 1, 2]));
        let FlatSamples::F32(read) = &channels[1].sample_data else { panic!() };
        assert_eq!((read[0], read[4]), (1e-9, -0.25));
        assert!(read[5].is_nan());
        let Some(AttributeValue::Text(text)) =
            image.layer_data.attributes.other.get(&Text::from("millstream"))
        else {
            panic!()
        };
        let json: serde_json::Value = serde_json::from_str(&text.to_string()).unwrap();
        assert_eq!(json["cell_mm"], 0.05);
        assert_eq!(json["origin_mm"][0], -1.5);
    }
}
