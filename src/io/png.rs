//! PNG files of pictures, 8-bit RGB.

use crate::report::Picture;

/// The bytes of a PNG file. `notes` are keyword and text of its text chunks (keywords: 1 to 79
/// letters of Latin-1; texts may hold any character).
///
/// # Errors
/// What the encoder says (such as an impossible keyword).
pub fn encode(picture: &Picture, notes: &[(&str, &str)]) -> std::io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, picture.width as u32, picture.height as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    for (keyword, text) in notes {
        encoder.add_itxt_chunk((*keyword).to_owned(), (*text).to_owned())?;
    }
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&picture.rgb)?;
    writer.finish()?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_comes_back_with_its_notes() {
        let mut picture = Picture::blank(3, 2);
        picture.set(1, 0, [10, 20, 30]);
        let bytes = encode(&picture, &[("Scene", "wave.toml"), ("Cell", "0.05 mm, µ")]).unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
        let mut rgb = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut rgb).unwrap();
        assert_eq!(rgb, picture.rgb);
        let texts = &reader.info().utf8_text;
        assert_eq!(texts[1].keyword, "Cell");
        assert_eq!(texts[1].get_text().unwrap(), "0.05 mm, µ");
    }
}
