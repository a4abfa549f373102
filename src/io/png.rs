//! PNG files of pictures: a palette where 256 colours suffice, else 8-bit RGB.
//!
//! Colour keys have so few shades that a picture with its letters keeps within a palette. Such a file is much
//! smaller than RGB.

use std::collections::BTreeSet;

use image::RgbImage;

use report::Picture;

/// Most colours of a palette.
const PALETTE: usize = 256;

/// The bytes of a PNG file. `notes` are keyword and text of its text chunks (keywords: 1 to 79
/// letters of Latin-1; texts may hold any character).
///
/// # Errors
/// What the encoder says (such as an impossible keyword).
pub fn encode(picture: &Picture, notes: &[(&str, &str)]) -> std::io::Result<Vec<u8>> {
    let rgb = &picture.pixels;
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, rgb.width(), rgb.height());
    encoder.set_depth(png::BitDepth::Eight);
    // Noisy maps gain nothing from filters: measured on the shipped scenes, they took twice the time
    // for files of the same size.
    encoder.set_filter(png::Filter::NoFilter);
    for (keyword, text) in notes {
        encoder.add_itxt_chunk((*keyword).to_owned(), (*text).to_owned())?;
    }
    let indexed = indexed(rgb);
    match &indexed {
        Some((palette, _)) => {
            encoder.set_color(png::ColorType::Indexed);
            encoder.set_palette(palette.concat());
        }
        None => encoder.set_color(png::ColorType::Rgb),
    }
    let mut writer = encoder.write_header()?;
    writer.write_image_data(indexed.as_ref().map_or(rgb.as_raw(), |(_, indices)| indices))?;
    writer.finish()?;
    Ok(bytes)
}

/// The colours of a picture, sorted, and which of them each pixel has. `None` when they are too
/// many.
fn indexed(rgb: &RgbImage) -> Option<(Vec<[u8; 3]>, Vec<u8>)> {
    // As one number a colour is compared in one step.
    let colours = || rgb.pixels().map(|pixel| u32::from_be_bytes([0, pixel[0], pixel[1], pixel[2]]));
    let mut palette = BTreeSet::new();
    // Neighbours are often alike: do not look the same colour up again.
    let mut last = None;
    for colour in colours().filter(|colour| last.replace(*colour) != Some(*colour)) {
        palette.insert(colour);
        if palette.len() > PALETTE {
            return None;
        }
    }
    let palette: Vec<u32> = palette.into_iter().collect();
    let mut known = (*palette.first()?, 0);
    let index = |colour: u32| {
        if known.0 != colour {
            known = (colour, palette.partition_point(|other| *other < colour) as u8);
        }
        known.1
    };
    let indices = colours().map(index).collect();
    let rgb = |colour: &u32| {
        let [_, red, green, blue] = colour.to_be_bytes();
        [red, green, blue]
    };
    Some((palette.iter().map(rgb).collect(), indices))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(bytes: Vec<u8>) -> (RgbImage, png::ColorType, Vec<(String, String)>) {
        let mut decoder = png::Decoder::new(std::io::Cursor::new(bytes));
        decoder.set_transformations(png::Transformations::EXPAND);
        let mut reader = decoder.read_info().unwrap();
        let mut rgb = vec![0; reader.output_buffer_size().unwrap()];
        let frame = reader.next_frame(&mut rgb).unwrap();
        let info = reader.info();
        let texts = info.utf8_text.iter().map(|t| (t.keyword.clone(), t.get_text().unwrap())).collect();
        (RgbImage::from_raw(frame.width, frame.height, rgb).unwrap(), info.color_type, texts)
    }

    #[test]
    fn a_picture_comes_back_with_its_notes() {
        let mut picture = Picture::blank(3, 2);
        picture.set(1, 0, [10, 20, 30]);
        let bytes = encode(&picture, &[("Scene", "wave.toml"), ("Cell", "0.05 mm, µ")]).unwrap();
        let (pixels, colours, texts) = read(bytes);
        assert_eq!((pixels, colours), (picture.pixels, png::ColorType::Indexed));
        assert_eq!(texts[1], ("Cell".to_owned(), "0.05 mm, µ".to_owned()));
    }

    #[test]
    fn a_palette_is_used_while_it_holds_every_colour() {
        for (colours, expected) in [(PALETTE, png::ColorType::Indexed), (PALETTE + 1, png::ColorType::Rgb)] {
            let mut picture = Picture::blank(colours, 1);
            (0..colours).for_each(|k| picture.set(k as i64, 0, [k as u8, (k >> 8) as u8, 7]));
            let (pixels, found, _) = read(encode(&picture, &[]).unwrap());
            assert_eq!(pixels, picture.pixels);
            assert_eq!(found, expected, "{colours}");
        }
    }
}
