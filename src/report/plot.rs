//! What the plots of the page share: colours, letters, and what is drawn as an SVG element.

use plotters::coord::Shift;
use plotters::drawing::DrawingAreaErrorKind;
use plotters::prelude::*;

/// As dark as the page's words, its faint ones, and its lines.
pub const INK: RGBColor = RGBColor(0x20, 0x24, 0x2a);
pub const FAINT: RGBColor = RGBColor(0x60, 0x66, 0x6e);
pub const GRID: RGBColor = RGBColor(0xd5, 0xd9, 0xde);

/// What is drawn on, and how that went.
pub type Page<'a> = DrawingArea<SVGBackend<'a>, Shift>;
pub type Drawn = Result<(), DrawingAreaErrorKind<std::io::Error>>;

/// The element that is drawn on a page of this size.
pub fn svg(size: (u32, u32), draw: impl FnOnce(&Page<'_>) -> Drawn) -> String {
    let mut svg = String::new();
    draw(&SVGBackend::with_string(&mut svg, size).into_drawing_area())
        .expect("drawing into a string cannot fail");
    // Within a page the namespace is known, and its address would be the only one in it.
    svg.replacen(" xmlns=\"http://www.w3.org/2000/svg\"", " role=\"img\"", 1)
}

/// As high as the page's small letters.
pub const LETTERS: i32 = 22;

/// Letters so high; the page names the face.
pub fn letters(size: i32) -> TextStyle<'static> {
    ("sans-serif", size).into_font().color(&INK)
}
