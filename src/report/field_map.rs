//! Pictures of what a path was planned by: feed directions, levels of ψ and singular points; and how far
//! passes lie apart, over what is allowed.

use super::canvas::{Align, FAINT_INK, INK, PAPER, Picture, Rgb, Strokes, TextSize, distance_to_segment_2d};
use super::map::{
    Key, MapSize, MapWords, Pooled, Pooling, diverging, draw, extremes, labelled, on_paper, pool,
};
use super::scale::Unit;
use field::mesh::SingularPoint;
use field::{PassPoint, PlannedField};
use sim::Grid;

/// Colours of levels of ψ, and of singular points of positive and of negative index.
const LEVEL: Rgb = [150, 190, 226];
const POSITIVE: Rgb = [196, 32, 44];
const NEGATIVE: Rgb = [22, 82, 170];

/// Width of lines, pixels.
const LEVEL_WIDTH: f64 = 1.2;
const FEED_WIDTH: f64 = 1.6;

/// Radius of the disc of a singular point, pixels.
const DISC: i64 = 5;

/// More singular points than this have no words beside them: they would cover the field.
const MOST_NAMED: usize = 40;

/// Length of a direction's stroke over the distance of strokes. Longer ones run into each other.
const STROKE: f64 = 0.7;

/// Strokes are drawn for directions at most this far apart, pixels: longer ones show no more.
const MOST_PITCH: f64 = 40.0;

/// Ends of the key of intervals, over the allowed one. The planner leaves 2 % above; halved intervals are 0.5
/// and more.
const NARROWEST: f64 = 0.5;
const WIDEST: f64 = 1.5;

/// Passes get a line of their own where they are this far apart, pixels.
const APART: f64 = 6.0;

/// Directions as strokes over levels of ψ, and singular points with their index. `deviation` tells where the
/// part is.
pub fn field_picture(
    grid: &Grid,
    deviation: &[f32],
    field: &PlannedField,
    words: &MapWords<'_>,
    size: MapSize,
) -> Picture {
    let map = pool(grid, deviation, Pooling::Mean, size);
    let (mut page, legend) = draw(grid, &map, &on_paper, words, |page| {
        let mut levels = map.strokes();
        for line in &field.level_lines {
            line.points
                .windows(2)
                .for_each(|w| levels.line(map.place(grid, w[0]), map.place(grid, w[1]), LEVEL_WIDTH));
        }
        page.ink(Pooled::CORNER, &levels, LEVEL);
        let mut feeds = map.strokes();
        strokes(grid, &map, field, &mut feeds);
        page.ink(Pooled::CORNER, &feeds, INK);
        // The strongest last, on top.
        let mut points: Vec<&SingularPoint> = field.singular_points.iter().collect();
        points.sort_by_key(|p| p.half_turns.abs());
        points
            .iter()
            .for_each(|p| singular_point(page, grid, &map, p, field.singular_points.len() <= MOST_NAMED));
    });
    draw_legend(&mut page, legend, field.singular_points.len());
    page
}

/// One stroke for each direction.
fn strokes(grid: &Grid, map: &Pooled, field: &PlannedField, feeds: &mut Strokes) {
    let on_part = map.values.iter().filter(|v| !v.is_nan()).count() * map.magnify * map.magnify;
    let pitch = (on_part as f64 / field.directions.len().max(1) as f64).sqrt().min(MOST_PITCH);
    for sample in &field.directions {
        let at = map.place(grid, sample.at);
        // Rows count down, y counts up.
        let half = [0.5 * STROKE * pitch * sample.direction.x, -0.5 * STROKE * pitch * sample.direction.y];
        feeds.line([at[0] - half[0], at[1] - half[1]], [at[0] + half[0], at[1] + half[1]], FEED_WIDTH);
    }
}

/// `+1/2`, `-1`, ...
pub fn index_word(half_turns: i32) -> String {
    if half_turns % 2 == 0 { format!("{:+}", half_turns / 2) } else { format!("{half_turns:+}/2") }
}

fn singular_point(page: &mut Picture, grid: &Grid, map: &Pooled, point: &SingularPoint, named: bool) {
    let [x, y] = map.place(grid, point.position.xy()).map(|c| c.floor() as i64);
    let [width, height] = map.size().map(|side| side as i64);
    if x < 0 || y < 0 || x >= width || y >= height {
        return;
    }
    let [left, top] = Pooled::CORNER;
    page.disc(left + x, top + y, DISC + 1, PAPER);
    page.disc(left + x, top + y, DISC, index_colour(point.half_turns));
    if !named {
        return;
    }
    let word = index_word(point.half_turns);
    let room = (word.chars().count() * TextSize::Small.letter_width()) as i64;
    // To the left of its point where the right has no room.
    let at = if x + DISC + 6 + room < width { left + x + DISC + 4 } else { left + x - DISC - 6 - room };
    page.fill(at, top + y - 8, room + 4, 16, PAPER);
    page.text(at + 2, top + y - 8, &word, TextSize::Small, Align::Left, INK);
}

fn index_colour(half_turns: i32) -> Rgb {
    if half_turns > 0 { POSITIVE } else { NEGATIVE }
}

/// What the signs of the field's picture mean.
fn draw_legend(page: &mut Picture, [x, y]: [i64; 2], points: usize) {
    const LINE: i64 = 26;
    const SIGN: i64 = 26;
    let mut sign = Strokes::blank(SIGN as usize, 16);
    sign.line([2.0, 8.0], [SIGN as f64 - 4.0, 8.0], FEED_WIDTH);
    page.ink([x, y], &sign, INK);
    let mut sign = Strokes::blank(SIGN as usize, 16);
    sign.line([2.0, 8.0], [SIGN as f64 - 4.0, 8.0], LEVEL_WIDTH);
    page.ink([x, y + LINE], &sign, LEVEL);
    let text = |page: &mut Picture, line: i64, words: &str| {
        page.text(x + SIGN + 4, y + line * LINE, words, TextSize::Small, Align::Left, INK);
    };
    text(page, 0, "feed");
    text(page, 1, "level of psi");
    let count = match points {
        0 => "no singular point".to_owned(),
        1 => "1 singular point:".to_owned(),
        n => format!("{n} singular points:"),
    };
    page.text(x, y + 2 * LINE, &count, TextSize::Small, Align::Left, FAINT_INK);
    let signs = [(3, 1, "index above 0"), (4, -1, "index below 0")];
    for (line, half_turns, words) in signs.into_iter().filter(|_| points > 0) {
        page.disc(x + SIGN / 2, y + line * LINE + 8, DISC, index_colour(half_turns));
        text(page, line, words);
    }
}

/// Passes as wide as what they serve, coloured by the interval to the farther of their neighbours over the
/// allowed one: red too wide, white as allowed, blue narrower. Grey where no neighbour is near.
pub fn interval_picture(
    grid: &Grid,
    deviation: &[f32],
    field: &PlannedField,
    words: &MapWords<'_>,
    size: MapSize,
) -> Picture {
    const PER_CENT: Unit = Unit { name: "% of allowed", a_millimetre: 100.0 };
    let map = pool(grid, deviation, Pooling::Mean, size);
    let inside = field.passes.iter().flatten().filter(|p| p.inside);
    let extremes = extremes(inside.filter_map(PassPoint::ratio));
    let key = Key {
        from: NARROWEST,
        middle: 1.0,
        to: WIDEST,
        gradient: diverging,
        ticks: labelled(NARROWEST, WIDEST, 10.0, PER_CENT),
        unit: PER_CENT,
        top: "interval",
        bottom: "narrow",
        extremes,
        of: None,
    };
    let served = served(grid, &map, field);
    let (mut page, at) = draw(grid, &map, &on_paper, words, |page| {
        let (width, magnify) = (map.size()[0], map.magnify);
        for (k, nearest) in served.iter().enumerate() {
            let (x, y) = (k % width, k / width);
            let off = map.values[y / magnify * map.width + x / magnify].is_nan();
            if let Some(ratio) = nearest.map(|(_, ratio)| ratio).filter(|_| !off) {
                let [left, top] = Pooled::CORNER;
                let colour = if ratio.is_nan() { NO_NEIGHBOUR } else { key.colour(ratio) };
                page.set(left + x as i64, top + y as i64, colour);
            }
        }
        lines(page, grid, &map, field);
    });
    key.draw(&mut page, at, map.height * map.magnify);
    page
}

/// Colour of passes without neighbours.
const NO_NEIGHBOUR: Rgb = [216, 218, 220];

/// For each pixel of a map the pass point that serves it: squared distance (pixels) and ratio of intervals,
/// NaN if unknown. A point serves half its interval, or half the allowed one.
fn served(grid: &Grid, map: &Pooled, field: &PlannedField) -> Vec<Option<(f32, f32)>> {
    let [width, height] = map.size();
    let mut served: Vec<Option<(f32, f32)>> = vec![None; width * height];
    for pair in field.passes.iter().flat_map(|pass| pass.windows(2)) {
        let [a, b] = [map.place(grid, pair[0].at.xy()), map.place(grid, pair[1].at.xy())];
        let reach = 0.5 * pair[0].interval.unwrap_or(pair[0].allowed) / map.pixel + 1.0;
        let ratio = pair[0].ratio().map_or(f32::NAN, |ratio| ratio as f32);
        let range = |c: usize, most: usize| {
            let lo = (a[c].min(b[c]) - reach).floor().max(0.0) as usize;
            lo..((a[c].max(b[c]) + reach).ceil().max(0.0) as usize).min(most)
        };
        for y in range(1, height) {
            for x in range(0, width) {
                let distance = distance_to_segment_2d([x as f64 + 0.5, y as f64 + 0.5], a, b);
                let square = (distance * distance) as f32;
                let cell = &mut served[y * width + x];
                if distance <= reach && cell.is_none_or(|(other, _)| square < other) {
                    *cell = Some((square, ratio));
                }
            }
        }
    }
    served
}

/// The passes as thin lines where they are far enough apart to be told from each other.
fn lines(page: &mut Picture, grid: &Grid, map: &Pooled, field: &PlannedField) {
    let apart = |p: &PassPoint| p.interval.unwrap_or(p.allowed) / map.pixel >= APART;
    let mut strokes = map.strokes();
    for pair in field.passes.iter().flat_map(|pass| pass.windows(2)) {
        if apart(&pair[0]) {
            strokes.line(map.place(grid, pair[0].at.xy()), map.place(grid, pair[1].at.xy()), 0.0);
        }
    }
    page.ink(Pooled::CORNER, &strokes, INK);
}

#[cfg(test)]
mod tests {
    use super::super::map::OFF_PART;
    use super::*;
    use field::{FeedSample, LevelLine};
    use geometry::{Point2, Point3, Vector2};

    const WORDS: MapWords<'_> =
        MapWords { title: "a title", subtitle: "a subtitle", marks: &[], axes: ["x", "y"] };

    /// A pass along x at `y`, with this interval, 0.5 mm allowed.
    fn pass(y: f64, interval: Option<f64>) -> Vec<PassPoint> {
        let at = |k: i32| Point3::new(f64::from(k), y, 0.0);
        (0..=20).map(|k| PassPoint { at: at(k), allowed: 0.5, interval, inside: true }).collect()
    }

    fn level_line(points: Vec<Point2>) -> LevelLine {
        LevelLine { psi: 1.0, densities: vec![2.0; points.len()], points }
    }

    fn grid(nx: usize, ny: usize) -> Grid {
        Grid { origin: Point2::new(0.25, 0.25), cell: 0.5, nx, ny }
    }

    fn pixel(page: &Picture, grid: &Grid, deviation: &[f32], at: Point2) -> Rgb {
        let [x, y] = pool(grid, deviation, Pooling::Mean, MapSize::File).place(grid, at);
        let [left, top] = Pooled::CORNER;
        page.pixels.get_pixel((left as f64 + x) as u32, (top as f64 + y) as u32).0
    }

    #[test]
    fn passes_wear_the_colour_of_their_interval() {
        let grid = grid(40, 20);
        let mut deviation = vec![0.0f32; grid.len()];
        (0..grid.ny).for_each(|j| deviation[grid.index(39, j)] = f32::NAN);
        let passes =
            vec![pass(1.0, Some(0.75)), pass(4.0, Some(0.5)), pass(6.0, Some(0.25)), pass(8.0, None)];
        let field = PlannedField { passes, ..PlannedField::default() };
        let page = interval_picture(&grid, &deviation, &field, &WORDS, MapSize::File);
        let at = |x: f64, y: f64| pixel(&page, &grid, &deviation, Point2::new(x, y));
        // Beside the line of the pass itself.
        assert_eq!(at(10.3, 1.2), diverging(1.0), "half as wide again as allowed");
        assert_eq!(at(10.3, 4.15), diverging(0.5), "as allowed");
        assert_eq!(at(10.3, 6.09), diverging(0.0), "half of the allowed one");
        assert_eq!(at(10.3, 8.15), NO_NEIGHBOUR);
        assert_eq!(at(10.3, 2.5), PAPER, "nothing serves this place");
        assert_eq!(at(19.7, 1.2), OFF_PART);
        assert_eq!(at(10.3, 1.0), INK, "lines where passes are far apart");
    }

    #[test]
    fn strokes_levels_and_singular_points_stand_where_they_are() {
        let grid = grid(40, 20);
        let deviation = vec![0.0f32; grid.len()];
        let mut field = PlannedField {
            directions: vec![FeedSample { at: Point2::new(5.0, 5.0), direction: Vector2::new(0.6, 0.8) }],
            level_lines: vec![level_line(vec![Point2::new(0.0, 8.0), Point2::new(20.0, 8.0)])],
            ..PlannedField::default()
        };
        for half_turns in [1, -2] {
            field.singular_points.push(SingularPoint {
                position: Point3::new(12.0 + f64::from(half_turns), 3.0, 1.0),
                half_turns,
            });
        }
        let page = field_picture(&grid, &deviation, &field, &WORDS, MapSize::File);
        let at = |x: f64, y: f64| pixel(&page, &grid, &deviation, Point2::new(x, y));
        assert_eq!((at(13.0, 3.0), at(10.0, 3.0)), (POSITIVE, NEGATIVE));
        assert!(
            at(5.0, 5.0)[0] < 160 && at(5.12, 5.16)[0] < 160 && at(5.12, 4.84) == PAPER,
            "it rises with y"
        );
        assert!(at(3.0, 8.0) != PAPER && at(3.0, 8.3) == PAPER);
        assert_eq!([1, -1, 2, -2, 3].map(index_word), ["+1/2", "-1/2", "+1", "-1", "+3/2"]);
    }

    #[test]
    fn fields_of_any_grid_can_be_drawn_and_what_lies_outside_is_left_out() {
        let far = [Point3::new(-1e5, -1e5, 0.0), Point3::new(2e5, 3e5, 0.0)];
        let point = |at: &Point3| PassPoint { at: *at, allowed: 0.5, interval: Some(900.0), inside: true };
        let field = PlannedField {
            directions: vec![FeedSample { at: far[0].xy(), direction: Vector2::x() }],
            level_lines: vec![level_line(far.iter().map(|p| p.xy()).collect()), LevelLine::default()],
            singular_points: vec![SingularPoint { position: far[1], half_turns: 1 }],
            passes: vec![far.iter().map(point).collect(), Vec::new()],
            ..PlannedField::default()
        };
        let none = PlannedField::default();
        for (nx, ny) in [(1, 1), (1, 300), (300, 1), (70, 50)] {
            let grid = grid(nx, ny);
            for (value, field) in [(f32::NAN, &field), (0.0, &field), (0.0, &none)] {
                let deviation = vec![value; grid.len()];
                for size in [MapSize::File, MapSize::Page] {
                    field_picture(&grid, &deviation, field, &WORDS, size);
                    interval_picture(&grid, &deviation, field, &WORDS, size);
                }
            }
        }
    }
}
