//! A raster to draw rectangles, lines and text on. Row 0 is the top; colours are 8-bit sRGB.

use image::RgbImage;
use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};

/// A colour, red green blue.
pub type Rgb = [u8; 3];

/// Ink of text, frames and ticks.
pub const INK: Rgb = [32, 36, 42];
/// Quieter ink.
pub const FAINT_INK: Rgb = [96, 102, 110];
/// Paper.
pub const PAPER: Rgb = [255, 255, 255];

/// A raster under way or finished.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Picture {
    /// Its pixels.
    pub pixels: RgbImage,
}

/// Size of letters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TextSize {
    /// 16 pixels a line.
    Small,
    /// 20 pixels a line, bold.
    Title,
}

impl TextSize {
    fn face(self) -> (FontWeight, RasterHeight) {
        match self {
            Self::Small => (FontWeight::Regular, RasterHeight::Size16),
            Self::Title => (FontWeight::Bold, RasterHeight::Size20),
        }
    }

    /// Width of one letter (all are equally wide), pixels.
    pub fn letter_width(self) -> usize {
        let (weight, height) = self.face();
        get_raster_width(weight, height)
    }
}

/// Which end of a text stands at the given x.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Align {
    /// Its left end.
    Left,
    /// Its middle.
    Middle,
    /// Its right end.
    Right,
}

impl Picture {
    /// A white page of this size, pixels.
    pub fn blank(width: usize, height: usize) -> Self {
        Self { pixels: RgbImage::from_pixel(width as u32, height as u32, image::Rgb(PAPER)) }
    }

    /// The pixel at `(x, y)`; `None` outside of the page.
    fn at(&mut self, x: i64, y: i64) -> Option<&mut image::Rgb<u8>> {
        self.pixels.get_pixel_mut_checked(u32::try_from(x).ok()?, u32::try_from(y).ok()?)
    }

    /// Colours one pixel; outside of the page nothing happens.
    pub fn set(&mut self, x: i64, y: i64, colour: Rgb) {
        if let Some(pixel) = self.at(x, y) {
            pixel.0 = colour;
        }
    }

    /// Fills `width` × `height` pixels from `(x, y)` right and down.
    pub fn fill(&mut self, x: i64, y: i64, width: i64, height: i64, colour: Rgb) {
        for row in y..y + height {
            (x..x + width).for_each(|column| self.set(column, row, colour));
        }
    }

    /// A frame of one pixel just outside of the rectangle.
    pub fn frame(&mut self, x: i64, y: i64, width: i64, height: i64, colour: Rgb) {
        self.fill(x - 1, y - 1, width + 2, 1, colour);
        self.fill(x - 1, y + height, width + 2, 1, colour);
        self.fill(x - 1, y - 1, 1, height + 2, colour);
        self.fill(x + width, y - 1, 1, height + 2, colour);
    }

    /// A ring of two pixels around `(x, y)`.
    pub fn ring(&mut self, x: i64, y: i64, radius: i64, colour: Rgb) {
        let (inner, outer) = ((radius - 1) * (radius - 1), (radius + 1) * (radius + 1));
        for (dx, dy) in (-radius..=radius).flat_map(|dy| (-radius..=radius).map(move |dx| (dx, dy))) {
            if (inner..outer).contains(&(dx * dx + dy * dy)) {
                self.set(x + dx, y + dy, colour);
            }
        }
    }

    /// A disc around `(x, y)`.
    pub fn disc(&mut self, x: i64, y: i64, radius: i64, colour: Rgb) {
        for (dx, dy) in (-radius..=radius).flat_map(|dy| (-radius..=radius).map(move |dx| (dx, dy))) {
            if dx * dx + dy * dy <= radius * (radius + 1) {
                self.set(x + dx, y + dy, colour);
            }
        }
    }

    /// Lays lines onto the page, their corner at `(x, y)`.
    pub fn ink(&mut self, [x, y]: [i64; 2], strokes: &Strokes, colour: Rgb) {
        for (k, coverage) in strokes.coverage.iter().enumerate().filter(|(_, c)| **c > 0) {
            let (column, row) = (k % strokes.width, k / strokes.width);
            self.blend(x + column as i64, y + row as i64, colour, *coverage);
        }
    }

    /// Writes one line; `(x, y)` is its top at the end named by `align`. Letters that the built-in
    /// face lacks become `?`.
    pub fn text(&mut self, x: i64, y: i64, text: &str, size: TextSize, align: Align, colour: Rgb) {
        let (weight, height) = size.face();
        let width = (text.chars().count() * size.letter_width()) as i64;
        let mut left = match align {
            Align::Left => x,
            Align::Middle => x - width / 2,
            Align::Right => x - width,
        };
        for letter in text.chars() {
            let raster = get_raster(letter, weight, height).or_else(|| get_raster('?', weight, height));
            for (row, coverages) in raster.iter().flat_map(|r| r.rows()).enumerate() {
                for (column, coverage) in coverages.iter().enumerate() {
                    self.blend(left + column as i64, y + row as i64, colour, *coverage);
                }
            }
            left += size.letter_width() as i64;
        }
    }

    fn blend(&mut self, x: i64, y: i64, colour: Rgb, coverage: u8) {
        /// Steps from paper to ink. Fewer make letters rough; more take room in a file's palette.
        const STEPS: u32 = 15;
        let share = (u32::from(coverage) * STEPS + 127) / 255 * 255 / STEPS;
        let Some(pixel) = self.at(x, y).filter(|_| share > 0) else { return };
        for (under, ink) in pixel.0.iter_mut().zip(colour) {
            *under = ((u32::from(ink) * share + u32::from(*under) * (255 - share)) / 255) as u8;
        }
    }
}

/// Pixels whose middle is this near to a line without width are its own; a hair more than a half, so that a
/// line along the border of two rows is not lost.
const NEAREST_PIXEL: f64 = 0.500_001;

/// Lines of one colour over a rectangle of pixels, smooth at their edges: where they meet or cross nothing is
/// laid on twice.
#[derive(Debug, Clone)]
pub struct Strokes {
    width: usize,
    height: usize,
    coverage: Vec<u8>,
}

impl Strokes {
    /// None yet, over a rectangle of this size, pixels.
    pub fn blank(width: usize, height: usize) -> Self {
        Self { width, height, coverage: vec![0; width * height] }
    }

    /// A line from `a` to `b` (pixels, fractions count; y down) of this width; one of width 0 covers the
    /// nearest pixels wholly and nothing else.
    pub fn line(&mut self, a: [f64; 2], b: [f64; 2], width: f64) {
        let reach = 0.5 * width + 0.5;
        let range = |from: f64, to: f64, most: usize| {
            let lo = (from.min(to) - reach - 1.0).floor().clamp(0.0, most as f64) as usize;
            lo..(from.max(to) + reach + 1.0).ceil().clamp(0.0, most as f64) as usize
        };
        // Along the line from row to row; along all of it where it is level.
        let (rise, run) = (b[1] - a[1], b[0] - a[0]);
        let share = |y: f64| if rise == 0.0 { 0.0 } else { ((y - a[1]) / rise).clamp(0.0, 1.0) };
        for y in range(a[1], b[1], self.height) {
            let row = y as f64 + 0.5;
            let near = [row - reach - 1.0, row + reach + 1.0].map(share);
            let ends = if rise == 0.0 { [a[0], b[0]] } else { near.map(|t| a[0] + t * run) };
            for x in range(ends[0], ends[1], self.width) {
                let distance = distance_to_segment_2d([x as f64 + 0.5, row], a, b);
                let share = if width > 0.0 { reach - distance } else { f64::from(distance <= NEAREST_PIXEL) };
                let cell = &mut self.coverage[y * self.width + x];
                *cell = (*cell).max((share.clamp(0.0, 1.0) * 255.0) as u8);
            }
        }
    }
}

/// Distance of a point from a segment.
pub fn distance_to_segment_2d(p: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    let (d, q) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
    let square = d[0] * d[0] + d[1] * d[1];
    let t = if square > 0.0 { ((q[0] * d[0] + q[1] * d[1]) / square).clamp(0.0, 1.0) } else { 0.0 };
    (q[0] - t * d[0]).hypot(q[1] - t * d[1])
}

/// `text` cut to at most `letters` letters, with `...` at the end where something is missing.
pub fn shortened(text: &str, letters: usize) -> String {
    if text.chars().count() <= letters {
        return text.to_owned();
    }
    text.chars().take(letters.saturating_sub(3)).chain("...".chars()).collect()
}
