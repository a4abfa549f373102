//! The function whose levels passes are, as a surface seen aslant: each level at the height of its value,
//! coloured by how dense passes are there.

use super::canvas::{Align, FAINT_INK, INK, Picture, Strokes, TextSize};
use super::map::{Key, MapSize, MapWords, Pooled, extremes, write_title};
use super::scale::{Unit, plain, ticks};
use field::{LevelLine, PlannedField};
use geometry::Point2;

/// The plan view seen aslant: how far y leads to the right and up, over its length.
const RIGHT_BY_Y: f64 = 0.35;
const UP_BY_Y: f64 = 0.5;

/// The greatest value stands this much above the least, over the longer side of the plan view.
const RISE: f64 = 0.5;

/// Room to the right of the surface, pixels: the numbers of y, and its key.
const NUMBERS: usize = 90;
const KEY: usize = 190;

/// Room below the surface, pixels: the numbers of x.
const BOTTOM: usize = 64;

/// Least height and width of the surface, pixels, so that its key and title fit.
const LEAST_SIDE: f64 = 300.0;

/// Width of lines, pixels.
const WIDTH: f64 = 1.6;

/// Colours of the key that lines wear: each takes a layer of its own.
const COLOURS: usize = 24;

/// Draws ψ of a streamline path.
pub fn stream_picture(field: &PlannedField, words: &MapWords<'_>, size: MapSize) -> Picture {
    const PER_MM: Unit = Unit { name: "passes / mm", a_millimetre: 1.0 };
    let view = View::of(&field.level_lines, size);
    let [left, top] = Pooled::CORNER;
    let [width, height] = view.size.map(|side| side.max(LEAST_SIDE).ceil() as usize);
    let mut page = Picture::blank(left as usize + width + NUMBERS + KEY, top as usize + height + BOTTOM);
    write_title(&mut page, words);
    draw_axes(&mut page, &view, words.axes);
    let extremes = extremes(field.level_lines.iter().flat_map(|line| &line.densities).copied());
    let (from, to) = extremes.unwrap_or((0.0, 1.0));
    // A flat density is no rainbow of rounding.
    let to = to.max(from + 0.01 * from.abs().max(f64::MIN_POSITIVE));
    let key = Key::sequential([from, to], extremes, PER_MM, ["dense", "wide"]);
    let share =
        |density: f64| (((density - from) / (to - from)) * COLOURS as f64).clamp(0.0, (COLOURS - 1) as f64);
    for colour in 0..COLOURS {
        let mut strokes = Strokes::blank(width, height);
        for line in &field.level_lines {
            for (ends, density) in line.points.windows(2).zip(&line.densities) {
                if share(*density) as usize == colour {
                    strokes.line(view.place(ends[0], line.psi), view.place(ends[1], line.psi), WIDTH);
                }
            }
        }
        let middle = from + (to - from) * (colour as f64 + 0.5) / COLOURS as f64;
        page.ink(Pooled::CORNER, &strokes, key.colour(middle as f32));
    }
    key.draw(&mut page, [left + (width + NUMBERS) as i64 + 28, top + 24], height);
    page
}

/// The frame of the plan view at the least ψ with round positions along x and y, and values of ψ up its left
/// corner.
fn draw_axes(page: &mut Picture, view: &View, [right, up]: [&str; 2]) {
    const PIXELS_A_TICK: f64 = 60.0;
    const TICK: f64 = 6.0;
    /// Room for what stands beside the surface, pixels.
    const AROUND: f64 = 8.0;
    let View { x, y, psi, .. } = *view;
    let place = |x: f64, y: f64, psi: f64| view.place(Point2::new(x, y), psi);
    let [width, height] = view.size.map(|side| (side.max(LEAST_SIDE) + 2.0 * AROUND).ceil() as usize);
    let mut strokes = Strokes::blank(width, height);
    let mut line = |from: [f64; 2], to: [f64; 2]| {
        strokes.line(from.map(|c| c + AROUND), to.map(|c| c + AROUND), 1.0);
    };
    let base = [[x[0], y[0]], [x[1], y[0]], [x[1], y[1]], [x[0], y[1]]].map(|[x, y]| place(x, y, psi[0]));
    (0..4).for_each(|k| line(base[k], base[(k + 1) % 4]));
    let top = place(x[0], y[0], psi[1]);
    line(base[0], top);
    let mut words = Vec::new();
    // Round values from one end of an axis to the other, with the way from their place to the number's and
    // what is its end there.
    let mut axis = |range: [f64; 2], at: &dyn Fn(f64) -> [f64; 2], aside: [f64; 2], align: Align| {
        let [from, to] = range.map(at);
        let length = (to[0] - from[0]).hypot(to[1] - from[1]);
        let marks = ticks(range[0], range[1], (length / PIXELS_A_TICK).max(1.0));
        let step = marks.get(1).map_or(range[1] - range[0], |second| second - marks[0]);
        for mark in marks {
            let [px, py] = at(mark);
            line([px, py], [px + aside[0] * TICK, py + aside[1] * TICK]);
            let number = [px + aside[0] * 2.0 * TICK, py + aside[1] * 2.0 * TICK];
            words.push((number, plain(mark, step), align, INK));
        }
    };
    axis(x, &|x| place(x, y[0], psi[0]), [0.0, 1.0], Align::Middle);
    axis(y, &|y| place(x[1], y, psi[0]), [1.0, 0.0], Align::Left);
    axis(psi, &|psi| place(x[0], y[0], psi), [-1.0, 0.0], Align::Right);
    let name = |text: String, [px, py]: [f64; 2], align| ([px, py], text, align, FAINT_INK);
    words.push(name(format!("{right} mm"), [base[1][0], base[1][1] + 38.0], Align::Right));
    words.push(name(format!("{up} mm"), [base[2][0] + 12.0, base[2][1] - 26.0], Align::Left));
    words.push(name("psi".into(), [top[0] - 12.0, top[1] - 26.0], Align::Right));
    let [left, above] = Pooled::CORNER;
    page.ink([left - AROUND as i64, above - AROUND as i64], &strokes, FAINT_INK);
    for ([px, py], text, align, colour) in words {
        // Beside a tick in the middle of its height, below one under it.
        let down = if align == Align::Middle { 0 } else { -8 };
        page.text(left + px as i64, above + py as i64 + down, &text, TextSize::Small, align, colour);
    }
}

/// The way from the plan view and ψ to pixels, y down.
struct View {
    /// What of the plan view lines are in, mm, and their values of ψ.
    x: [f64; 2],
    y: [f64; 2],
    psi: [f64; 2],
    scale: f64,
    rise: f64,
    size: [f64; 2],
}

impl View {
    fn of(lines: &[LevelLine], size: MapSize) -> Self {
        let points = || lines.iter().flat_map(|line| &line.points);
        let none = [f64::INFINITY, f64::NEG_INFINITY];
        let range = |values: &mut dyn Iterator<Item = f64>| {
            let [lo, hi] = values.fold(none, |[lo, hi], x| [lo.min(x), hi.max(x)]);
            if lo <= hi { [lo, hi] } else { [0.0, 1.0] }
        };
        let [x, y] = [range(&mut points().map(|p| p.x)), range(&mut points().map(|p| p.y))];
        let psi = range(&mut lines.iter().map(|line| line.psi));
        let longer = (x[1] - x[0]).max(y[1] - y[0]).max(f64::MIN_POSITIVE);
        let rise = if psi[1] > psi[0] { RISE * longer / (psi[1] - psi[0]) } else { 0.0 };
        let wide = x[1] - x[0] + RIGHT_BY_Y * (y[1] - y[0]);
        let high = UP_BY_Y * (y[1] - y[0]) + rise * (psi[1] - psi[0]);
        let scale = size.comfortable() as f64 / wide.max(high).max(f64::MIN_POSITIVE);
        Self { x, y, psi, scale, rise, size: [scale * wide, scale * high] }
    }

    fn place(&self, p: Point2, psi: f64) -> [f64; 2] {
        let (x, y) = (p.x - self.x[0], p.y - self.y[0]);
        let up = UP_BY_Y * y + self.rise * (psi - self.psi[0]);
        [self.scale * (x + RIGHT_BY_Y * y), self.size[1].max(LEAST_SIDE) - self.scale * up]
    }
}

#[cfg(test)]
mod tests {
    use super::super::map::sequential;
    use super::*;

    const WORDS: MapWords<'_> = MapWords { title: "psi", subtitle: "a part", marks: &[], axes: ["x", "y"] };

    /// A line along x at `y`.
    fn line(y: f64, psi: f64, density: f64) -> LevelLine {
        let points: Vec<Point2> = (0..=20).map(|k| Point2::new(f64::from(k), y)).collect();
        LevelLine { psi, densities: vec![density; points.len()], points }
    }

    #[test]
    fn levels_stand_as_high_as_their_value_in_the_colour_of_their_density() {
        let lines = vec![line(0.0, 2.0, 1.0), line(10.0, 4.0, 3.0)];
        let field = PlannedField { level_lines: lines.clone(), ..PlannedField::default() };
        let page = stream_picture(&field, &WORDS, MapSize::File);
        let view = View::of(&lines, MapSize::File);
        let [left, top] = Pooled::CORNER;
        let at = |p: Point2, psi: f64| {
            let [x, y] = view.place(p, psi);
            page.pixels.get_pixel((left as f64 + x) as u32, (top as f64 + y) as u32).0
        };
        let (low, high) = (at(Point2::new(10.0, 0.0), 2.0), at(Point2::new(10.0, 10.0), 4.0));
        let apart = |a: [u8; 3], b: [u8; 3]| (0..3).map(|k| a[k].abs_diff(b[k])).max().unwrap();
        // Lines are smooth at their edges, and colours are those of the middle of a share.
        assert!(apart(low, sequential(0.0)) < 45 && apart(high, sequential(1.0)) < 45, "{low:?} {high:?}");
        // As high above it as the rise and the slant say.
        let [a, b] = [view.place(Point2::new(0.0, 0.0), 2.0), view.place(Point2::new(0.0, 10.0), 4.0)];
        assert!((a[1] - b[1] - view.scale * (10.0 * UP_BY_Y + 20.0 * RISE)).abs() < 1e-9);
    }

    /// Each of the three axes has its line and numbers, in ink.
    #[test]
    fn axes_stand_at_the_least_value_with_numbers() {
        let lines = vec![line(0.0, 2.0, 1.0), line(10.0, 4.0, 3.0)];
        let field = PlannedField { level_lines: lines.clone(), ..PlannedField::default() };
        let page = stream_picture(&field, &WORDS, MapSize::File);
        let view = View::of(&lines, MapSize::File);
        let [left, top] = Pooled::CORNER;
        let inked = |from: [f64; 2], [dx, dy]: [[f64; 2]; 2]| {
            let range = |at: f64, [low, high]: [f64; 2]| (at + low) as i64..(at + high) as i64;
            let mut places = range(from[1], dy).flat_map(|y| range(from[0], dx).map(move |x| (x, y)));
            places.any(|(x, y)| page.pixels.get_pixel((left + x) as u32, (top + y) as u32).0 == INK)
        };
        let place = |x: f64, y: f64, psi: f64| view.place(Point2::new(x, y), psi);
        assert!(inked(place(10.0, 0.0, 2.0), [[-20.0, 20.0], [8.0, 30.0]]), "x = 10 below its place");
        assert!(inked(place(20.0, 5.0, 2.0), [[8.0, 40.0], [-10.0, 10.0]]), "y = 5 beside its place");
        assert!(inked(place(0.0, 0.0, 3.0), [[-50.0, -8.0], [-10.0, 10.0]]), "psi = 3 to the left");
        // The frame runs on behind where no level line is.
        let [x, y] = view.place(Point2::new(20.0, 2.5), 2.0);
        let near =
            (-1..=1).map(|d| page.pixels.get_pixel((left as f64 + x) as u32, (top + y as i64 + d) as u32).0);
        assert!(near.into_iter().any(|pixel| pixel != crate::canvas::PAPER));
    }

    #[test]
    fn nothing_and_one_level_can_be_drawn() {
        for lines in [Vec::new(), vec![line(1.0, 1.0, 0.5)], vec![LevelLine::default()]] {
            let field = PlannedField { level_lines: lines, ..PlannedField::default() };
            for size in [MapSize::File, MapSize::Page] {
                stream_picture(&field, &WORDS, size);
            }
        }
    }
}
