//! The path over a map: cuts coloured in their order, links, moves off the surface, where it starts and ends.

use super::canvas::{Align, INK, PAPER, Picture, Rgb, TextSize};
use super::map::{MapSize, MapWords, Pooled, Pooling, draw, on_paper, pool, sequential};
use geometry::{Point2, Vector2};
use motion::MoveKind;
use sim::Grid;

/// A move as a line of a map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathLine {
    /// Its ends, mm of the map.
    pub ends: [Point2; 2],
    /// What it is for.
    pub kind: MoveKind,
}

/// Colours of cuts from the first to the last. More would not be told from each other.
const SHADES: usize = 8;

/// The gradient's light end cannot be seen on paper.
const LIGHTEST: f64 = 0.85;

/// Colours of links on the surface, and of moves off it, which are seen on the part and beside it.
const LINK: Rgb = [222, 90, 0];
const AIR: Rgb = [104, 110, 122];

/// Colours of the first and the last place.
const START: Rgb = [20, 130, 60];
const END: Rgb = [196, 32, 44];

/// Width of lines, pixels.
const CUT_WIDTH: f64 = 1.2;
const AIR_WIDTH: f64 = 1.0;

/// Radius of the discs at both ends, pixels.
const DISC: i64 = 5;

/// Passes begin and end beyond the part; the map shows as much as this share of its longer side around it.
const MOST_AROUND: f64 = 0.25;

/// Draws lines over the part and around it, as far as they go on the surface. `deviation` tells where the
/// part is.
pub fn path_picture(
    grid: &Grid,
    deviation: &[f32],
    lines: &[PathLine],
    words: &MapWords<'_>,
    size: MapSize,
) -> Picture {
    let (grid, values) = widened(grid, deviation, lines);
    let map = pool(&grid, &values, Pooling::Mean, size);
    let shades = shades(lines);
    let mut drawn = Drawn::default();
    let (mut page, legend) = draw(&grid, &map, &on_paper, words, |page| {
        let size = map.size();
        let mut ink = |colour: Rgb, width: f64, wanted: &dyn Fn(usize) -> bool| {
            let mut is_seen = false;
            let mut strokes = map.strokes();
            for (_, line) in lines.iter().enumerate().filter(|(k, _)| wanted(*k)) {
                let [a, b] = line.ends.map(|end| map.place(&grid, end));
                strokes.line(a, b, width);
                is_seen |= crosses(size, a, b);
            }
            page.ink(Pooled::CORNER, &strokes, colour);
            is_seen
        };
        drawn.air = ink(AIR, AIR_WIDTH, &|k| !lines[k].kind.is_on_surface());
        for shade in 0..SHADES {
            let cut = |k: usize| lines[k].kind == MoveKind::Cut && shades[k] == shade;
            drawn.cuts |= ink(shade_colour(shade), CUT_WIDTH, &cut);
        }
        drawn.links = ink(LINK, CUT_WIDTH, &|k| lines[k].kind == MoveKind::Link);
        let mut cuts = lines.iter().filter(|line| line.kind.is_on_surface());
        let first = cuts.next();
        let ends = [(first, 0, START), (cuts.next_back().or(first), 1, END)];
        for (line, end, colour) in ends {
            if let Some(line) = line {
                drawn.ends[end] = disc(page, &map, map.place(&grid, line.ends[end]), colour);
            }
        }
    });
    draw_legend(&mut page, legend, &drawn);
    page
}

/// What the picture shows.
#[derive(Default)]
struct Drawn {
    cuts: bool,
    links: bool,
    air: bool,
    /// The first place and the last.
    ends: [bool; 2],
}

/// Whether a line can be seen on a map of a size, pixels: moves up and down are points.
fn crosses(size: [usize; 2], a: [f64; 2], b: [f64; 2]) -> bool {
    const LEAST: f64 = 0.5;
    let is_long = (b[0] - a[0]).hypot(b[1] - a[1]) > LEAST;
    is_long && (0..2).all(|c| a[c].max(b[c]) >= 0.0 && a[c].min(b[c]) <= size[c] as f64)
}

/// The map with as many cells around it, off the part, as the lines on the surface reach beyond it.
fn widened(grid: &Grid, deviation: &[f32], lines: &[PathLine]) -> (Grid, Vec<f32>) {
    let most = (MOST_AROUND * grid.nx.max(grid.ny) as f64).ceil();
    let ends = || lines.iter().filter(|line| line.kind.is_on_surface()).flat_map(|line| line.ends);
    let beyond = |far: f64| far.ceil().clamp(0.0, most) as usize;
    let cells = |c: usize, n: usize| {
        let at = ends().map(|end| (end[c] - grid.origin[c]) / grid.cell);
        let (low, high) = at.fold((0.0f64, 0.0f64), |(low, high), x| (low.min(x), high.max(x)));
        [beyond(-low), beyond(high - (n - 1) as f64)]
    };
    let ([left, right], [below, above]) = (cells(0, grid.nx), cells(1, grid.ny));
    let origin = grid.origin - Vector2::new(left as f64, below as f64) * grid.cell;
    let wide = Grid { origin, cell: grid.cell, nx: left + grid.nx + right, ny: below + grid.ny + above };
    let mut values = vec![f32::NAN; wide.len()];
    for j in 0..grid.ny {
        let from = wide.index(left, below + j);
        values[from..from + grid.nx].copy_from_slice(&deviation[grid.index(0, j)..][..grid.nx]);
    }
    (wide, values)
}

/// The shade of each line, by the length that was cut before it.
fn shades(lines: &[PathLine]) -> Vec<usize> {
    let length = |line: &PathLine| {
        if line.kind.is_on_surface() { (line.ends[1] - line.ends[0]).norm() } else { 0.0 }
    };
    let all: f64 = lines.iter().map(length).sum();
    let mut before = 0.0;
    let shade = |line: &PathLine| {
        let share = if all > 0.0 { before / all } else { 0.0 };
        before += length(line);
        ((share * SHADES as f64) as usize).min(SHADES - 1)
    };
    lines.iter().map(shade).collect()
}

fn shade_colour(shade: usize) -> Rgb {
    sequential(LIGHTEST * shade as f64 / (SHADES - 1) as f64)
}

/// A disc on the map; one outside of it is left out. Whether it is there.
fn disc(page: &mut Picture, map: &Pooled, [x, y]: [f64; 2], colour: Rgb) -> bool {
    let [width, height] = map.size();
    let is_there = (0.0..=width as f64).contains(&x) && (0.0..=height as f64).contains(&y);
    if is_there {
        let at = [0, 1].map(|c| Pooled::CORNER[c] + [x, y][c] as i64);
        page.disc(at[0], at[1], DISC + 1, PAPER);
        page.disc(at[0], at[1], DISC, colour);
    }
    is_there
}

/// What the colours mean, of what is drawn.
fn draw_legend(page: &mut Picture, [x, y]: [i64; 2], drawn: &Drawn) {
    const LINE: i64 = 26;
    const SIGN: i64 = 26;
    let signs = [
        (drawn.cuts, shade_colour(0), "first cuts"),
        (drawn.cuts, shade_colour(SHADES - 1), "last cuts"),
        (drawn.links, LINK, "surface link"),
        (drawn.air, AIR, "off the surface"),
    ];
    let text = |page: &mut Picture, line: i64, words: &str| {
        page.text(x + SIGN + 4, y + line * LINE, words, TextSize::Small, Align::Left, INK);
    };
    let mut line = 0;
    for (_, colour, words) in signs.into_iter().filter(|sign| sign.0) {
        page.fill(x + 2, y + line * LINE + 7, SIGN - 6, 2, colour);
        text(page, line, words);
        line += 1;
    }
    let ends = [(drawn.ends[0], START, "start"), (drawn.ends[1], END, "end")];
    for (_, colour, words) in ends.into_iter().filter(|sign| sign.0) {
        page.disc(x + SIGN / 2, y + line * LINE + 8, DISC, colour);
        text(page, line, words);
        line += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::super::map::OFF_PART;
    use super::*;

    const WORDS: MapWords<'_> = MapWords { title: "t", subtitle: "s", marks: &[], axes: ["x", "y"] };

    fn line(from: [f64; 2], to: [f64; 2], kind: MoveKind) -> PathLine {
        PathLine { ends: [from, to].map(|[x, y]| Point2::new(x, y)), kind }
    }

    #[test]
    fn moves_stand_where_they_are_in_their_colours() {
        let grid = Grid { origin: Point2::new(0.25, 0.25), cell: 0.5, nx: 40, ny: 20 };
        let deviation = vec![0.0f32; grid.len()];
        let lines = [
            line([0.0, 9.0], [1.0, 1.0], MoveKind::Rapid),
            line([1.0, 1.0], [19.0, 1.0], MoveKind::Cut),
            line([19.0, 1.0], [19.0, 3.0], MoveKind::Link),
            line([19.0, 3.0], [1.0, 3.0], MoveKind::Cut),
            line([1.0, 3.0], [1.0, 9.0], MoveKind::Retract),
            line([23.0, 9.0], [19.5, 9.0], MoveKind::Cut),
        ];
        let page = path_picture(&grid, &deviation, &lines, &WORDS, MapSize::File);
        let at = |x: f64, y: f64| {
            let (grid, values) = widened(&grid, &deviation, &lines);
            let place = pool(&grid, &values, Pooling::Mean, MapSize::File).place(&grid, Point2::new(x, y));
            let [left, top] = Pooled::CORNER;
            page.pixels.get_pixel((left as f64 + place[0]) as u32, (top as f64 + place[1]) as u32).0
        };
        // Ink over paper: darker than it, and each pass in a colour of its own.
        assert_eq!(at(10.0, 2.0), PAPER);
        assert_eq!((at(1.0, 1.0), at(19.5, 9.0)), (START, END));
        let [first, last, link] = [at(10.0, 1.0), at(10.0, 3.0), at(19.0, 2.0)];
        assert!(first != PAPER && last != PAPER && first != last && link != first && link != last);
        assert!(link[0] > link[2], "orange: {link:?}");
        assert_eq!(at(22.5, 1.0), OFF_PART, "as far around the part as the last pass goes");
    }

    /// The legend has what the picture shows; moves off the surface differ from the part and from what is
    /// beside it.
    #[test]
    fn the_legend_names_what_is_drawn() {
        let grid = Grid { origin: Point2::new(0.25, 0.25), cell: 0.5, nx: 40, ny: 20 };
        let deviation = vec![0.0f32; grid.len()];
        let [cut, down] =
            [line([1.0, 1.0], [19.0, 1.0], MoveKind::Cut), line([1.0, 1.0], [1.0, 1.0], MoveKind::Plunge)];
        let links = line([19.0, 1.0], [19.0, 3.0], MoveKind::Link);
        let over = line([19.0, 3.0], [1.0, 9.0], MoveKind::Rapid);
        let shows = |lines: &[PathLine], colour: Rgb| {
            let page = path_picture(&grid, &deviation, lines, &WORDS, MapSize::File);
            let map = pool(&grid, &deviation, Pooling::Mean, MapSize::File);
            let right = Pooled::CORNER[0] as u32 + (map.width * map.magnify) as u32 + 4;
            let all = page.pixels.enumerate_pixels();
            all.filter(|(x, _, pixel)| *x > right && pixel.0 == colour).count() > 0
        };
        assert!(!shows(&[down, cut], LINK) && !shows(&[down, cut], AIR) && shows(&[down, cut], START));
        assert!(shows(&[cut, links], LINK) && !shows(&[cut, links], AIR));
        assert!(shows(&[cut, over], AIR) && !shows(&[over], START) && !shows(&[], END));
        let apart = |a: Rgb, b: Rgb| a.iter().zip(b).map(|(a, b)| a.abs_diff(b)).min().unwrap();
        assert!(apart(AIR, PAPER) > 50 && apart(AIR, OFF_PART) > 50);
    }

    #[test]
    fn any_path_can_be_drawn() {
        let grid = Grid { origin: Point2::new(0.0, 0.0), cell: 1.0, nx: 3, ny: 300 };
        let far = line([-1e6, 2.0], [1e6, 1e5], MoveKind::Cut);
        let air = line([0.0, 0.0], [0.0, 0.0], MoveKind::Retract);
        for lines in [vec![], vec![far], vec![air], vec![air, far, air]] {
            for size in [MapSize::File, MapSize::Page] {
                path_picture(&grid, &vec![f32::NAN; grid.len()], &lines, &WORDS, size);
            }
        }
    }
}
