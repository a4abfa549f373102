//! Pictures of maps over a grid: title, map with axes, scale bar, colour key. y points up.
//!
//! Each picture is drawn twice, large for its file and small for the page. A picture that is shrunk has
//! blurred letters.

use image::RgbImage;
use image::imageops::{self, FilterType};

use super::canvas::{Align, FAINT_INK, INK, PAPER, Picture, Rgb, Strokes, TextSize, shortened};
use super::scale::{Unit, plain, round_down, round_up, ticks};
use geometry::{Point2, Vector2};
use metrology::Limits;
use sim::Grid;

/// Colours of a key, an odd number so that its middle is one of them. Fewer show as bands; many more,
/// and the picture with its letters no longer fits into a palette of 256, which doubles its bytes.
const SHADES: usize = 151;
/// Greatest magnification of one cell, pixels.
const MAX_MAGNIFICATION: usize = 24;
/// Colour of cells off the part; far from white, which is "no deviation".
pub(super) const OFF_PART: Rgb = [176, 180, 184];

/// A pixel of a map that shows nothing but where the part is.
pub(super) fn on_paper(value: f32) -> Rgb {
    if value.is_nan() { OFF_PART } else { PAPER }
}

/// Room around the map, pixels.
const LEFT: usize = 92;
const RIGHT: usize = 190;
const TOP: usize = 92;
const BOTTOM: usize = 96;
/// Least map area, so that title and key fit, pixels.
const MIN_WIDTH: usize = 480;
const MIN_HEIGHT: usize = 260;

/// What a picture is drawn for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MapSize {
    /// A file of its own: as much as a screen shows.
    File,
    /// A page: fits into its column without being scaled, so that letters stay sharp, and keeps the
    /// page small enough to be mailed.
    Page,
}

impl MapSize {
    /// Widest and highest map, pixels. More makes pictures that do not fit where they are shown.
    fn most(self) -> usize {
        match self {
            Self::File => 1600,
            Self::Page => 740,
        }
    }

    /// Small grids are magnified by whole numbers up to about this size, pixels.
    pub(super) fn comfortable(self) -> usize {
        match self {
            Self::File => 900,
            Self::Page => 640,
        }
    }
}

/// Words around a map.
#[derive(Debug, Clone, Copy)]
pub struct MapWords<'a> {
    /// First line.
    pub title: &'a str,
    /// Second line: scene, cell, engine.
    pub subtitle: &'a str,
    /// Places to be ringed.
    pub marks: &'a [MapMark],
    /// What runs right and up: `x` and `y`, or the parameters of a patch laid flat.
    pub axes: [&'a str; 2],
}

/// A place on a map, ringed and named.
#[derive(Debug, Clone, PartialEq)]
pub struct MapMark {
    /// Where, mm.
    pub at: [f64; 2],
    /// A few letters.
    pub name: String,
}

/// How several cells become one pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Pooling {
    /// The value that exceeds its end of the key the most (both ends are positive lengths, mm): no
    /// gouge is lost beside a scallop, and no spike beside a gouge.
    Extreme { below: f64, above: f64 },
    /// The mean.
    Mean,
}

/// A map brought to pixels: `width` × `height` values, top row first, each `magnify` pixels wide.
pub(super) struct Pooled {
    pub width: usize,
    pub height: usize,
    pub magnify: usize,
    pub values: Vec<f32>,
    /// mm that one pixel stands for.
    pub pixel: f64,
}

impl Pooled {
    /// The page's pixel at the map's upper left.
    pub const CORNER: [i64; 2] = [LEFT as i64, TOP as i64];

    /// Width and height on the page, pixels.
    pub fn size(&self) -> [usize; 2] {
        [self.width, self.height].map(|cells| cells * self.magnify)
    }

    /// No line yet over all of it.
    pub fn strokes(&self) -> Strokes {
        let [width, height] = self.size();
        Strokes::blank(width, height)
    }

    /// Where a place of the plan view is on the map, pixels from its corner, y down.
    pub fn place(&self, grid: &Grid, at: Point2) -> [f64; 2] {
        // Cells reach half a cell beyond their centres; the last row may reach beyond the grid.
        let bottom = (self.height * self.magnify) as f64;
        let from = grid.origin - Vector2::repeat(0.5 * grid.cell);
        [(at.x - from.x) / self.pixel, bottom - (at.y - from.y) / self.pixel]
    }
}

pub(super) fn pool(grid: &Grid, values: &[f32], pooling: Pooling, size: MapSize) -> Pooled {
    let longest = grid.nx.max(grid.ny).max(1);
    let block = longest.div_ceil(size.most());
    let magnify = (size.comfortable() / longest).clamp(1, MAX_MAGNIFICATION);
    let (width, height) = (grid.nx.div_ceil(block), grid.ny.div_ceil(block));
    let one = |pixel: usize| {
        // Row 0 of the picture holds the highest y.
        let (column, row) = (pixel % width, height - 1 - pixel / width);
        let rows = row * block..((row + 1) * block).min(grid.ny);
        let cells = rows.flat_map(|j| {
            (column * block..((column + 1) * block).min(grid.nx)).map(move |i| grid.index(i, j))
        });
        pooled(cells.map(|k| values[k]).filter(|v| v.is_finite()), pooling)
    };
    let values = work::parallel::map(width * height, one);
    Pooled { width, height, magnify, values, pixel: grid.cell * block as f64 / magnify as f64 }
}

/// NaN of no values.
fn pooled(values: impl Iterator<Item = f32>, pooling: Pooling) -> f32 {
    match pooling {
        Pooling::Extreme { below, above } => {
            let rank = |v: f32| f64::from(v) / if v < 0.0 { -below } else { above };
            values.fold(f32::NAN, |a, b| if rank(a) >= rank(b) { a } else { b })
        }
        Pooling::Mean => {
            let (sum, count) = values.fold((0f64, 0u32), |(s, n), v| (s + f64::from(v), n + 1));
            (sum / f64::from(count)) as f32
        }
    }
}

/// About so many round values stand beside a key.
const TICKS: f64 = 8.0;

/// Values to colours, and what the key says.
pub(super) struct Key {
    pub from: f64,
    /// Stands in the middle of the key; both halves have their own scale.
    pub middle: f64,
    pub to: f64,
    pub gradient: fn(f64) -> Rgb,
    /// Round values beside the key, with their words.
    pub ticks: Vec<(f64, String)>,
    pub unit: Unit,
    /// Above and below the key.
    pub top: &'static str,
    pub bottom: &'static str,
    /// Least and greatest value of all cells; those beyond the key wear the colours of its ends.
    pub extremes: Option<(f64, f64)>,
    /// What the extremes are those of, where the report has greater ones.
    pub of: Option<&'static str>,
}

impl Key {
    pub fn colour(&self, value: f32) -> Rgb {
        if value.is_nan() { OFF_PART } else { self.shade(self.share(f64::from(value))) }
    }

    /// From dark to light between two values, which must differ; all cells have values between the extremes.
    pub fn sequential(
        [from, to]: [f64; 2],
        extremes: Option<(f64, f64)>,
        unit: Unit,
        [top, bottom]: [&'static str; 2],
    ) -> Self {
        let (middle, ticks) = (0.5 * (from + to), labelled(from, to, TICKS, unit));
        Self { from, middle, to, gradient: sequential, ticks, unit, top, bottom, extremes, of: None }
    }

    /// Where a value stands between the lower end (0) and the upper end (1).
    fn share(&self, value: f64) -> f64 {
        let (middle, end) = (self.middle, if value < self.middle { self.from } else { self.to });
        0.5 + 0.5 * (value - middle) / (end - middle).abs()
    }

    /// Draws the key at a place of the page, beside a map of this height, pixels.
    pub fn draw(&self, page: &mut Picture, at: [i64; 2], map_height: usize) {
        draw_key(page, self, at, map_height);
    }

    /// The colour at a share of the key, from its lower end.
    fn shade(&self, share: f64) -> Rgb {
        let last = (SHADES - 1) as f64;
        (self.gradient)((share.clamp(0.0, 1.0) * last).round() / last)
    }
}

/// Ticks with as many digits as their distance needs.
pub(super) fn labelled(from: f64, to: f64, count: f64, unit: Unit) -> Vec<(f64, String)> {
    let marks = ticks(from, to, count);
    let step = marks.get(1).map_or(to - from, |second| second - marks[0]);
    marks.into_iter().map(|mark| (mark, unit.text(mark, step))).collect()
}

pub(super) fn diverging(t: f64) -> Rgb {
    let colour = colorous::RED_BLUE.eval_continuous(1.0 - t);
    [colour.r, colour.g, colour.b]
}

pub(super) fn sequential(t: f64) -> Rgb {
    let colour = colorous::VIRIDIS.eval_continuous(t);
    [colour.r, colour.g, colour.b]
}

/// Ends of the deviation's colour key below and above the design, both positive, mm: gouge and scallop
/// tolerance, rounded up. A gouge counts in micrometres where scallops may be ten times as high; on
/// one scale it would be lost. Pictures of several toolpaths of one scene can be compared.
fn deviation_ends(limits: &Limits) -> (f64, f64) {
    (round_up(limits.gouge), round_up(limits.scallop))
}

/// The deviation's key, without its words.
fn deviation_key(limits: &Limits) -> Key {
    let (below, above) = deviation_ends(limits);
    Key {
        from: -below,
        middle: 0.0,
        to: above,
        gradient: diverging,
        ticks: Vec::new(),
        unit: Unit::for_range(below.max(above)),
        top: "excess",
        bottom: "gouge",
        extremes: None,
        of: Some("at grid points:"),
    }
}

/// Red, green and blue of each deviation (mm; NaN off the part), as the deviation's picture has them.
pub fn deviation_colours(deviation: &[f32], limits: &Limits) -> Vec<[u8; 3]> {
    let key = deviation_key(limits);
    deviation.iter().map(|d| key.colour(*d)).collect()
}

/// Least and greatest of the finite values.
pub(super) fn extremes(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    let finite = values.filter(|v| v.is_finite());
    finite.fold(None, |range, v| Some(range.map_or((v, v), |(a, b): (f64, f64)| (a.min(v), b.max(v)))))
}

/// Least and greatest of the finite values of cells.
fn extremes_of_cells(values: &[f32]) -> Option<(f64, f64)> {
    extremes(values.iter().copied().map(f64::from))
}

/// Signed deviation: blue below the design (gouge), white on it, red above (excess), grey off the
/// part. Where several cells share a pixel it shows the one farthest from zero.
pub fn deviation_picture(
    grid: &Grid,
    deviation: &[f32],
    limits: &Limits,
    words: &MapWords<'_>,
    size: MapSize,
) -> Picture {
    /// Steps along half of the key: 1, 2 and 5 then all have a tick at the end.
    const HALF_TICKS: f64 = 5.0;
    let (below, above) = deviation_ends(limits);
    let mut key = deviation_key(limits);
    let mut ticks = labelled(-below, 0.0, HALF_TICKS, key.unit);
    let excess = labelled(0.0, above, HALF_TICKS, key.unit).into_iter().skip(1);
    ticks.extend(excess.map(|(mark, text)| (mark, format!("+{text}"))));
    (key.ticks, key.extremes) = (ticks, extremes_of_cells(deviation));
    draw_keyed(grid, &pool(grid, deviation, Pooling::Extreme { below, above }, size), &key, words)
}

/// Heights of the cut stock, dark to light.
pub fn height_picture(grid: &Grid, height: &[f32], words: &MapWords<'_>, size: MapSize) -> Picture {
    let pooled = pool(grid, height, Pooling::Mean, size);
    let extremes = extremes_of_cells(height);
    let (mut from, mut to) = extremes.unwrap_or((0.0, 1.0));
    // A flat surface needs a range too.
    let least = 1e-3f64.max(to.abs() * 1e-6);
    if to - from < least {
        (from, to) = (0.5 * (from + to - least), 0.5 * (from + to + least));
    }
    let unit = Unit::for_range(to - from);
    let key = Key::sequential([from, to], extremes, unit, ["high", "low"]);
    draw_keyed(grid, &pooled, &key, words)
}

fn draw_keyed(grid: &Grid, map: &Pooled, key: &Key, words: &MapWords<'_>) -> Picture {
    let (mut page, at) = draw(grid, map, &|value| key.colour(value), words, |_| ());
    key.draw(&mut page, at, map.height * map.magnify);
    page
}

/// A map with what stands around it but its key, whose place comes with it; `over` draws on the map.
pub(super) fn draw(
    grid: &Grid,
    map: &Pooled,
    colour: &dyn Fn(f32) -> Rgb,
    words: &MapWords<'_>,
    over: impl FnOnce(&mut Picture),
) -> (Picture, [i64; 2]) {
    let [width, height] = map.size();
    let mut page = Picture::blank(LEFT + width.max(MIN_WIDTH) + RIGHT, TOP + height.max(MIN_HEIGHT) + BOTTOM);
    write_title(&mut page, words);
    let pixels = RgbImage::from_fn(map.width as u32, map.height as u32, |x, y| {
        image::Rgb(colour(map.values[y as usize * map.width + x as usize]))
    });
    let pixels = imageops::resize(&pixels, width as u32, height as u32, FilterType::Nearest);
    imageops::replace(&mut page.pixels, &pixels, LEFT as i64, TOP as i64);
    over(&mut page);
    page.frame(LEFT as i64, TOP as i64, width as i64, height as i64, FAINT_INK);
    draw_axes(&mut page, grid, map, words.axes);
    draw_marks(&mut page, grid, map, words.marks);
    draw_bar(&mut page, map, height);
    (page, [(LEFT + width.max(MIN_WIDTH) + 28) as i64, TOP as i64 + 24])
}

/// Title and subtitle, as much of them as the page is wide.
pub(super) fn write_title(page: &mut Picture, words: &MapWords<'_>) {
    const LEFT: i64 = 16;
    let letters = |size: TextSize| (page.pixels.width() as usize - 2 * LEFT as usize) / size.letter_width();
    let [title, subtitle] = [(words.title, TextSize::Title), (words.subtitle, TextSize::Small)]
        .map(|(text, size)| shortened(text, letters(size)));
    page.text(LEFT, 12, &title, TextSize::Title, Align::Left, INK);
    page.text(LEFT, 36, &subtitle, TextSize::Small, Align::Left, FAINT_INK);
}

/// Radius of the rings around places, pixels.
const RING: i64 = 9;

/// Rings around places, with their names beside them.
fn draw_marks(page: &mut Picture, grid: &Grid, map: &Pooled, marks: &[MapMark]) {
    let corner = (grid.origin.x - 0.5 * grid.cell, grid.origin.y - 0.5 * grid.cell);
    let bottom = (TOP + map.height * map.magnify) as i64;
    let place = |mark: &MapMark| {
        let x = LEFT as i64 + ((mark.at[0] - corner.0) / map.pixel) as i64;
        [x, bottom - 1 - ((mark.at[1] - corner.1) / map.pixel) as i64]
    };
    let rings: Vec<[i64; 2]> = marks.iter().map(place).collect();
    for [x, y] in &rings {
        page.ring(*x, *y, RING, PAPER);
        page.ring(*x, *y, RING - 2, INK);
    }
    let width = |mark: &MapMark| (mark.name.chars().count() * TextSize::Small.letter_width()) as i64 + 4;
    let [across, up] = map.size().map(|side| side as i64);
    let within = Label { left: LEFT as i64, top: TOP as i64, width: across, height: up };
    for (mark, label) in marks.iter().zip(labels(&rings, marks.iter().map(width), within)) {
        page.fill(label.left, label.top, label.width, label.height, PAPER);
        page.text(label.left + 2, label.top, &mark.name, TextSize::Small, Align::Left, INK);
    }
}

/// Where a name stands, pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Label {
    left: i64,
    top: i64,
    width: i64,
    height: i64,
}

impl Label {
    fn meets(&self, other: &Self) -> bool {
        let apart = |a: i64, size: i64, b: i64, other: i64| a + size <= b || b + other <= a;
        !apart(self.left, self.width, other.left, other.width)
            && !apart(self.top, self.height, other.top, other.height)
    }

    fn lies_in(&self, map: &Self) -> bool {
        let inside = |a: i64, size: i64, from: i64, all: i64| a >= from && a + size <= from + all;
        inside(self.left, self.width, map.left, map.width)
            && inside(self.top, self.height, map.top, map.height)
    }
}

/// The place of each ring's name: beside it where no other name and no other ring is, as near as can be, on
/// the map where there is room.
fn labels(rings: &[[i64; 2]], widths: impl Iterator<Item = i64>, map: Label) -> Vec<Label> {
    const HEIGHT: i64 = 16;
    /// Names are tried so many times their height farther away.
    const FAR: i64 = 6;
    let around =
        |[x, y]: &[i64; 2]| Label { left: x - RING, top: y - RING, width: 2 * RING, height: 2 * RING };
    let mut placed: Vec<Label> = Vec::with_capacity(rings.len());
    for (k, (ring, width)) in rings.iter().zip(widths).enumerate() {
        let [x, y] = *ring;
        let beside = |away: i64| {
            let (right, left) = (x + RING + 2 + away, x - RING - 2 - away - width);
            let (up, down) = (y - HEIGHT - RING - 2 - away, y + RING + 2 + away);
            let [level, middle] = [y - HEIGHT / 2, x - width / 2];
            let places = [(right, level), (left, level), (middle, up), (middle, down)];
            places.into_iter().chain([(right, up), (right, down), (left, up), (left, down)])
        };
        let all = (0..=FAR).flat_map(|times| beside(times * HEIGHT));
        let all = all.map(|(left, top)| Label { left, top, width, height: HEIGHT });
        let others =
            || rings.iter().enumerate().filter(|(other, _)| *other != k).map(|(_, ring)| around(ring));
        let is_free = |label: &Label| {
            !placed.iter().any(|other| label.meets(other)) && !others().any(|other| label.meets(&other))
        };
        let on_map = all.clone().filter(|label| label.lies_in(&map)).find(is_free);
        let chosen = on_map.or_else(|| all.clone().find(is_free)).or_else(|| all.clone().next());
        placed.extend(chosen);
    }
    placed
}

/// Round positions in mm along the bottom and the left side.
fn draw_axes(page: &mut Picture, grid: &Grid, map: &Pooled, [right, up]: [&str; 2]) {
    let [width, height] = map.size().map(|side| side as i64);
    let (left, bottom) = (LEFT as i64, TOP as i64 + height);
    // Cells reach half a cell beyond their centres.
    let (x0, y0) = (grid.origin.x - 0.5 * grid.cell, grid.origin.y - 0.5 * grid.cell);
    let span = |pixels: i64| pixels as f64 * map.pixel;
    const PIXELS_A_TICK: f64 = 90.0;
    let marks = |from: f64, length: i64| {
        let marks = ticks(from, from + span(length), (length as f64 / PIXELS_A_TICK).max(1.0));
        let step = marks.get(1).map_or(span(length), |second| second - marks[0]);
        marks.into_iter().map(move |at| (((at - from) / map.pixel).round() as i64, plain(at, step)))
    };
    for (at, text) in marks(x0, width) {
        page.fill(left + at.min(width - 1), bottom + 1, 1, 6, FAINT_INK);
        page.text(left + at, bottom + 10, &text, TextSize::Small, Align::Middle, INK);
    }
    for (at, text) in marks(y0, height) {
        page.fill(left - 7, bottom - 1 - at.min(height - 1), 6, 1, FAINT_INK);
        page.text(left - 11, bottom - 9 - at, &text, TextSize::Small, Align::Right, INK);
    }
    page.text(left + width, bottom + 30, &format!("{right} mm"), TextSize::Small, Align::Right, FAINT_INK);
    page.text(left - 11, TOP as i64 - 28, &format!("{up} mm"), TextSize::Small, Align::Right, FAINT_INK);
}

/// A bar of a round length, about a fifth of the map.
fn draw_bar(page: &mut Picture, map: &Pooled, height: usize) {
    let width = map.size()[0] as f64 * map.pixel;
    let length = round_down(0.25 * width.max(0.5 * MIN_WIDTH as f64 * map.pixel));
    let pixels = (length / map.pixel).round().max(1.0) as i64;
    let (x, y) = (LEFT as i64, (TOP + height) as i64 + 52);
    page.fill(x, y, pixels, 3, INK);
    page.fill(x, y - 4, 1, 11, INK);
    page.fill(x + pixels - 1, y - 4, 1, 11, INK);
    let unit = Unit::for_range(length);
    let text = format!("{} {}", unit.text(length, length), unit.name);
    page.text(x, y + 10, &text, TextSize::Small, Align::Left, INK);
}

/// The colour key with its unit, ends and round values between.
fn draw_key(page: &mut Picture, key: &Key, [x, top]: [i64; 2], map_height: usize) {
    const WIDTH: i64 = 22;
    const MAX_HEIGHT: usize = 420;
    let height = (map_height.max(MIN_HEIGHT) - 120).clamp(120, MAX_HEIGHT) as i64;
    for row in 0..height {
        let t = 1.0 - (row as f64 + 0.5) / height as f64;
        page.fill(x, top + row, WIDTH, 1, key.shade(t));
    }
    page.frame(x, top, WIDTH, height, FAINT_INK);
    /// Words closer than this would touch, pixels.
    const APART: i64 = 18;
    // From zero outward, so that where room is short zero keeps its word.
    let mut outward: Vec<_> = key.ticks.iter().collect();
    outward.sort_by(|a, b| (a.0 - key.middle).abs().total_cmp(&(b.0 - key.middle).abs()));
    let mut written: Vec<i64> = Vec::new();
    for (mark, text) in outward {
        let y = top + ((1.0 - key.share(*mark)) * (height - 1) as f64).round() as i64;
        page.fill(x + WIDTH + 1, y, 5, 1, FAINT_INK);
        if written.iter().all(|other| (other - y).abs() >= APART) {
            page.text(x + WIDTH + 10, y - 8, text, TextSize::Small, Align::Left, INK);
            written.push(y);
        }
    }
    let unit = key.unit;
    page.text(x, top - 24, &format!("{}, {}", key.top, unit.name), TextSize::Small, Align::Left, INK);
    page.text(x, top + height + 8, key.bottom, TextSize::Small, Align::Left, INK);
    let Some((least, greatest)) = key.extremes else { return };
    /// Lines below the key are this far apart, pixels.
    const LINE: i64 = 20;
    let ends = [("max", greatest), ("min", least)].map(|(word, value)| {
        format!("{word} {} {}", unit.text(value, (key.to - key.from) / 1000.0), unit.name)
    });
    let lines = key.of.map(str::to_owned).into_iter().chain(ends);
    for (line, text) in (2..).zip(lines) {
        page.text(x, top + height + 8 + LINE * line, &text, TextSize::Small, Align::Left, FAINT_INK);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits = Limits { scallop: 0.010, gouge: 0.005, uncut: 0.050, chord: 0.001 };
    const WORDS: MapWords<'_> =
        MapWords { title: "a title", subtitle: "a subtitle", marks: &[], axes: ["x", "y"] };

    fn grid(nx: usize, ny: usize) -> Grid {
        Grid { origin: Point2::new(0.5, 0.5), cell: 1.0, nx, ny }
    }

    /// Rings at one place and in a row keep names that can be read, on the page and off other rings.
    #[test]
    fn names_of_rings_do_not_cover_each_other() {
        let page = Label { left: 0, top: 0, width: 400, height: 300 };
        let rings: Vec<[i64; 2]> =
            (0..11).map(|k| if k < 6 { [10, 10 + k / 2] } else { [395, 150 + 9 * k] }).collect();
        let found = labels(&rings, rings.iter().map(|_| 20), page);
        for (k, label) in found.iter().enumerate() {
            assert!(label.lies_in(&page), "{label:?}");
            assert!(!found[..k].iter().any(|other| label.meets(other)), "{found:?}");
        }
        // Alone it stands to the right.
        let [label] = labels(&[[100, 100]], [20].into_iter(), page)[..] else { panic!("one ring, one name") };
        assert_eq!((label.left, label.top), (111, 92));
    }

    #[test]
    fn a_single_gouged_cell_survives_any_shrinking() {
        let grid = grid(5001, 37);
        let mut deviation = vec![0.009f32; grid.len()];
        deviation[grid.index(3456, 30)] = -0.004;
        let pooling = Pooling::Extreme { below: 0.002, above: 0.010 };
        let pooled = pool(&grid, &deviation, pooling, MapSize::File);
        assert!(pooled.width <= MapSize::File.most());
        assert_eq!(pooled.values.iter().filter(|v| **v == -0.004).count(), 1);
    }

    #[test]
    fn small_grids_are_magnified_with_y_up() {
        let grid = grid(3, 2);
        let mut deviation = vec![0.0f32; 6];
        deviation[grid.index(0, 0)] = 1.0;
        deviation[grid.index(2, 1)] = f32::NAN;
        let page = deviation_picture(&grid, &deviation, &LIMITS, &WORDS, MapSize::File);
        let at = |i: usize, row: usize| {
            let middle = |base: usize, k: usize| (base + k * MAX_MAGNIFICATION + 3) as u32;
            page.pixels.get_pixel(middle(LEFT, i), middle(TOP, row)).0
        };
        assert_eq!(at(0, 1), diverging(1.0), "y = 0 is the bottom row");
        assert_eq!(at(2, 0), OFF_PART);
        assert_eq!(at(1, 0), diverging(0.5));
    }

    #[test]
    fn maps_of_any_shape_and_content_can_be_drawn() {
        for (nx, ny) in [(1, 1), (1, 3000), (3000, 1), (700, 500)] {
            let grid = grid(nx, ny);
            let sizes = [MapSize::File, MapSize::Page];
            for (value, size) in [f32::NAN, 0.0, 1e6, -7.25].into_iter().flat_map(|v| sizes.map(|s| (v, s))) {
                let values = vec![value; grid.len()];
                deviation_picture(&grid, &values, &LIMITS, &WORDS, size);
                height_picture(&grid, &values, &WORDS, size);
            }
        }
    }

    #[test]
    fn each_half_of_the_key_ends_at_a_round_number_that_holds_its_limit() {
        assert_eq!(deviation_ends(&LIMITS), (0.005, 0.01));
        assert_eq!(deviation_ends(&Limits { gouge: 0.011, ..LIMITS }), (0.02, 0.01));
    }

    #[test]
    fn a_place_is_ringed_where_it_lies() {
        let grid = grid(20, 10);
        let marks = [MapMark { at: [2.5, 7.5], name: "G1".into() }];
        let words = MapWords { marks: &marks, ..WORDS };
        let picture =
            |words| deviation_picture(&grid, &vec![0.0; grid.len()], &LIMITS, words, MapSize::File).pixels;
        let (plain, marked) = (picture(&WORDS), picture(&words));
        let changed: Vec<(u32, u32)> = plain
            .enumerate_pixels()
            .filter(|(x, y, pixel)| marked.get_pixel(*x, *y) != *pixel)
            .map(|(x, y, _)| (x, y))
            .collect();
        let middle = |low: u32, high: u32| f64::from(low + high) / 2.0;
        let (top, bottom) = (changed[0].1, changed[changed.len() - 1].1);
        let left = changed.iter().map(|c| c.0).min().unwrap();
        let side = f64::from(bottom - top);
        // Cell (2, 7): the third from the left, the third from the top.
        let expected = |base: usize| (base * 2 + 5 * MAX_MAGNIFICATION) as f64 / 2.0;
        assert!((middle(top, bottom) - expected(TOP)).abs() <= 1.0);
        assert!((f64::from(left) + side / 2.0 - expected(LEFT)).abs() <= 1.0);
    }
}
