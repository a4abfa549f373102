//! Curvature combs of plane curves as SVG: bumps that no eye sees in the outline stand out in its curvature.
//!
//! Enters: a spline and perhaps the one that came of it. Leaves: an SVG element with a panel for each, at one
//! scale, of equal aspect, with axes in mm. Teeth stand square on the curve, on the outer side of its bend,
//! and are as long as it is curved.

use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint, Ranged};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::ops::Range;

use super::plot::{Drawn, FAINT, GRID, INK, LETTERS, Page, letters, svg};
use super::scale::{plain, round_up, ticks};
use geometry::{CubicSpline, Point2, Vector2};

/// Width of the drawing; the page shows it at half of that, since the backend rounds to whole units.
const WIDTH: f64 = 1440.0;
/// Room for the title, for the words below, and about each panel: its name above, margins, marks and names of
/// the axes.
const TITLE: f64 = 56.0;
const WORDS: f64 = 44.0;
const NAME: f64 = 40.0;
const X_MARKS: f64 = 70.0;
const LEFT: f64 = 10.0;
const Y_MARKS: f64 = 110.0;
const RIGHT: f64 = 16.0;
/// Where texts start.
const START: i32 = (LEFT + Y_MARKS) as i32;
/// Least and greatest height of what is drawn in all panels above one another.
const LEAST_HEIGHT: f64 = 160.0;
const MOST_HEIGHT: f64 = 900.0;
/// Marks of the axes stand at least this far apart: their figures need it.
const MARKS_APART: f64 = 130.0;
/// Teeth of one curve, at least and at most, about: fewer miss bumps, more run into each other.
const LEAST_TEETH: usize = 300;
const MOST_TEETH: usize = 1200;
/// Along this share of the curves teeth are shorter than [`USUAL`] of the extent, and none is drawn longer
/// than [`LONGEST`]: leading edges would hide all else.
const SHORTER: f64 = 0.9;
const USUAL: f64 = 0.12;
const LONGEST: f64 = 0.2;
/// Chords of the drawn curve stray by this share of its extent. Their ends carry teeth, which stand closer
/// where it bends.
const CHORDS: f64 = 1.0e-5;

const TOOTH: RGBColor = RGBColor(0x8f, 0xb3, 0xd9);
const TIPS: RGBColor = RGBColor(0x1f, 0x4e, 0x79);

/// A tooth: its foot on the curve, the outward normal there for a left turn, and the curvature, 1/mm.
struct Tooth {
    foot: Point2,
    out: Vector2,
    curvature: f64,
}

impl Tooth {
    /// Its tip, where 1 mm stands for `a_millimetre` of curvature and none is longer than `longest`, mm.
    fn tip(&self, a_millimetre: f64, longest: f64) -> Point2 {
        self.foot + self.out * (self.curvature / a_millimetre).clamp(-longest, longest)
    }
}

/// A curve as it is drawn: chords, teeth and their tips.
struct Comb {
    curve: Vec<Point2>,
    teeth: Vec<Tooth>,
    tips: Vec<Point2>,
}

/// Combs of `before` and, if there is one, of `after`, as an SVG element: side by side, or above one another
/// where that shows more. A title fits on its line if it has no more than 90 letters.
pub fn comb_picture(title: &str, before: &CubicSpline, after: Option<&CubicSpline>) -> String {
    let mut combs: Vec<Comb> = std::iter::once(before).chain(after).map(comb).collect();
    let extent = Bounds::of(combs.iter().flat_map(|c| &c.curve)).extent();
    let longest = LONGEST * extent;
    let a_millimetre = round_up(usual_curvature(&combs) / (USUAL * extent));
    for comb in &mut combs {
        comb.tips = comb.teeth.iter().map(|tooth| tooth.tip(a_millimetre, longest)).collect();
    }
    let layout = Layout::new(&combs, after.is_some());
    let cut = combs.iter().flat_map(|c| &c.teeth).any(|tooth| tooth.curvature.abs() > longest * a_millimetre);
    let words = words(a_millimetre, longest, cut);
    let size = (WIDTH as u32, layout.height() as u32);
    svg(size, |page| layout.draw(page, title, &words, &combs))
}

/// What a tooth's length says.
fn words(a_millimetre: f64, longest: f64, cut: bool) -> String {
    let most = longest * a_millimetre;
    let cut = if cut {
        format!("; teeth above {} 1/mm are cut off", plain(most, 0.1 * most))
    } else {
        String::new()
    };
    format!("A tooth is 1 mm long for each {} 1/mm of curvature{cut}.", plain(a_millimetre, a_millimetre))
}

fn comb(spline: &CubicSpline) -> Comb {
    let ends = spline.within_chord(CHORDS * Bounds::of(spline.points()).extent());
    let each = LEAST_TEETH.div_ceil(ends.len());
    let within = |pair: &[f64]| {
        let [from, to] = [pair[0], pair[1]];
        (0..each).map(move |k| from + (to - from) * k as f64 / each as f64)
    };
    let places = ends.windows(2).flat_map(within).step_by((ends.len() * each).div_ceil(MOST_TEETH));
    let teeth = places.chain(ends.last().copied()).filter_map(|t| {
        let (foot, along, _) = spline.jet(t);
        let along = along.try_normalize(0.0)?;
        let curvature = Some(spline.curvature(t)).filter(|curvature| !curvature.is_nan())?;
        Some(Tooth { foot, out: Vector2::new(along.y, -along.x), curvature })
    });
    let teeth = teeth.collect();
    Comb { curve: ends.into_iter().map(|t| spline.point(t)).collect(), teeth, tips: Vec::new() }
}

/// The curvature that [`SHORTER`] of the curves' length stays below, 1/mm.
fn usual_curvature(combs: &[Comb]) -> f64 {
    let pairs = combs.iter().flat_map(|c| c.teeth.windows(2));
    let mut stretches: Vec<(f64, f64)> =
        pairs.map(|pair| (pair[0].curvature.abs(), (pair[1].foot - pair[0].foot).norm())).collect();
    stretches.sort_by(|a, b| a.0.total_cmp(&b.0));
    let share = SHORTER * stretches.iter().map(|(_, length)| length).sum::<f64>();
    let mut sum = 0.0;
    let usual = stretches.iter().find(|(_, length)| {
        sum += length;
        sum >= share
    });
    usual.map_or(0.0, |(curvature, _)| *curvature)
}

/// A rectangle, mm.
#[derive(Clone, Copy)]
struct Bounds {
    low: Point2,
    high: Point2,
}

impl Bounds {
    fn of<'a>(points: impl IntoIterator<Item = &'a Point2>) -> Self {
        let none = Self { low: Point2::new(f64::MAX, f64::MAX), high: Point2::new(f64::MIN, f64::MIN) };
        points.into_iter().fold(none, |b, p| Self { low: b.low.inf(p), high: b.high.sup(p) })
    }

    fn size(&self) -> Vector2 {
        self.high - self.low
    }

    /// The longer side.
    fn extent(&self) -> f64 {
        self.size().max()
    }
}

/// Where panels stand, and what they show.
struct Layout {
    /// Panels beside and above one another.
    columns: usize,
    rows: usize,
    /// Height of what a panel draws, in units of the drawing, without marks and names.
    height: f64,
    /// The range of both axes, mm, and the step of their marks.
    x: Range<f64>,
    y: Range<f64>,
    step: f64,
}

impl Layout {
    fn new(combs: &[Comb], two: bool) -> Self {
        let bounds = Bounds::of(combs.iter().flat_map(|c| c.curve.iter().chain(&c.tips)));
        // A little air, so that nothing is drawn on the frame.
        let size = bounds.size() * 1.04;
        let arranged = |columns: usize, rows: usize| {
            let width = WIDTH / columns as f64 - LEFT - Y_MARKS - RIGHT;
            let most = MOST_HEIGHT / rows as f64;
            // Units for 1 mm.
            let scale = (width / size.x).min(most / size.y);
            (scale, columns, rows, width, (scale * size.y).clamp(LEAST_HEIGHT, most).ceil())
        };
        let beside = if two { arranged(2, 1) } else { arranged(1, 1) };
        let above = if two { arranged(1, 2) } else { beside };
        let (scale, columns, rows, width, height) = if above.0 > beside.0 { above } else { beside };
        let middle = nalgebra::center(&bounds.low, &bounds.high);
        let range = |middle: f64, length: f64| middle - 0.5 * length / scale..middle + 0.5 * length / scale;
        let step = round_up(MARKS_APART / scale);
        Self { columns, rows, height, x: range(middle.x, width), y: range(middle.y, height), step }
    }

    fn height(&self) -> f64 {
        TITLE + self.rows as f64 * (NAME + self.height + X_MARKS) + WORDS
    }

    fn draw(&self, page: &Page<'_>, title: &str, words: &str, combs: &[Comb]) -> Drawn {
        let below = self.height() as i32 - WORDS as i32 / 2;
        page.draw(&Text::new(title.to_owned(), (START, TITLE as i32 / 2), letters(26).pos(middle())))?;
        page.draw(&Text::new(
            words.to_owned(),
            (START, below),
            letters(LETTERS).color(&FAINT).pos(middle()),
        ))?;
        let (_, panels) = page.split_vertically(TITLE as u32);
        let (panels, _) = panels.split_vertically((self.height() - TITLE - WORDS) as u32);
        let panels = panels.split_evenly((self.rows, self.columns));
        let names = if combs.len() > 1 { ["before", "after"] } else { ["", ""] };
        for ((panel, comb), name) in panels.iter().zip(combs).zip(names) {
            self.panel(panel, comb, name)?;
        }
        page.present()
    }

    fn panel(&self, page: &Page<'_>, comb: &Comb, name: &str) -> Drawn {
        page.draw(&Text::new(name.to_owned(), (START, NAME as i32 / 2), letters(LETTERS).pos(middle())))?;
        let mut chart = ChartBuilder::on(page)
            .margin_top(NAME as u32)
            .margin_left(LEFT as u32)
            .margin_right(RIGHT as u32)
            .x_label_area_size(X_MARKS as u32)
            .y_label_area_size(Y_MARKS as u32)
            .build_cartesian_2d(
                Axis { range: self.x.clone(), step: self.step },
                Axis { range: self.y.clone(), step: self.step },
            )?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(GRID)
            .axis_style(FAINT)
            .label_style(letters(LETTERS))
            .x_label_formatter(&|mm| plain(*mm, self.step))
            .y_label_formatter(&|mm| plain(*mm, self.step))
            .x_desc("x, mm")
            .y_desc("y, mm")
            .draw()?;
        // All teeth in one line: from foot to tip, back, and on along the curve.
        let pairs = comb.teeth.iter().zip(&comb.tips);
        let teeth = pairs.flat_map(|(tooth, tip)| [tooth.foot, *tip, tooth.foot]);
        chart.draw_series(LineSeries::new(teeth.map(xy), TOOTH.stroke_width(1)))?;
        chart.draw_series(LineSeries::new(comb.tips.iter().copied().map(xy), TIPS.stroke_width(2)))?;
        chart.draw_series(LineSeries::new(comb.curve.iter().copied().map(xy), INK.stroke_width(3)))?;
        Ok(())
    }
}

fn xy(p: Point2) -> (f64, f64) {
    (p.x, p.y)
}

/// An axis with marks at multiples of a step.
struct Axis {
    range: Range<f64>,
    step: f64,
}

impl Ranged for Axis {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        let share = (value - self.range.start) / (self.range.end - self.range.start);
        limit.0 + (share * f64::from(limit.1 - limit.0)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, _: Hint) -> Vec<f64> {
        ticks(self.range.start, self.range.end, (self.range.end - self.range.start) / self.step)
    }

    fn range(&self) -> Range<f64> {
        self.range.clone()
    }
}

/// Left of a place, in the middle of its height.
fn middle() -> Pos {
    Pos::new(HPos::Left, VPos::Center)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn closed(points: Vec<Point2>) -> CubicSpline {
        CubicSpline::closed(CubicSpline::chord_lengths(&points, true), points).unwrap()
    }

    /// An ellipse with wiggles.
    fn wavy(half_axes: [f64; 2], wiggle: f64) -> CubicSpline {
        let at = |k: usize| {
            let (sin, cos) = (TAU * k as f64 / 80.0).sin_cos();
            let off = if k.is_multiple_of(2) { wiggle } else { -wiggle };
            Point2::new((half_axes[0] + off) * cos + 50.0, (half_axes[1] + off) * sin - 20.0)
        };
        closed((0..80).map(at).collect())
    }

    /// Every place of the drawing: of lines, and where texts start.
    fn places(svg: &str) -> Vec<[f64; 2]> {
        let attribute = |text: &str, name: &str| -> Option<String> {
            let from = text.find(&format!(" {name}=\""))? + name.len() + 3;
            Some(text[from..].split('"').next()?.to_owned())
        };
        let mut found = Vec::new();
        for element in svg.split('<') {
            let points = attribute(element, "points").unwrap_or_default();
            for pair in points.split_whitespace() {
                let (x, y) = pair.split_once(',').unwrap();
                found.push([x.parse().unwrap(), y.parse().unwrap()]);
            }
            for (x, y) in [("x", "y"), ("x1", "y1"), ("x2", "y2")] {
                if let (Some(x), Some(y)) = (attribute(element, x), attribute(element, y)) {
                    found.push([x.parse().unwrap(), y.parse().unwrap()]);
                }
            }
        }
        found
    }

    #[test]
    fn teeth_of_a_circle_end_on_a_circle_outside() {
        let points = |turn: f64| (0..60).map(move |k| turn * TAU * f64::from(k) / 60.0);
        for turn in [1.0, -1.0] {
            let circle = closed(points(turn).map(|a| Point2::new(5.0 * a.cos(), 5.0 * a.sin())).collect());
            let drawn = comb(&circle);
            assert!((LEAST_TEETH..=MOST_TEETH).contains(&drawn.teeth.len()), "{}", drawn.teeth.len());
            for tooth in &drawn.teeth {
                assert!((tooth.tip(0.1, 9.0).coords.norm() - 7.0).abs() < 1e-2);
                assert!((tooth.tip(0.1, 1.5).coords.norm() - 6.5).abs() < 1e-3);
            }
        }
    }

    #[test]
    fn both_axes_have_one_scale_and_nothing_leaves_the_picture() {
        for axes in [[30.0, 4.0], [4.0, 30.0], [10.0, 10.0], [3e5, 2e4]] {
            let wiggle = 1e-3 * axes[0];
            let (before, after) = (wavy(axes, wiggle), wavy(axes, 0.0));
            for after in [None, Some(&after)] {
                let mut combs: Vec<Comb> = std::iter::once(&before).chain(after).map(comb).collect();
                combs
                    .iter_mut()
                    .for_each(|c| c.tips = c.teeth.iter().map(|t| t.tip(1.0, 0.1 * axes[0])).collect());
                let layout = Layout::new(&combs, after.is_some());
                let width = WIDTH / layout.columns as f64 - LEFT - Y_MARKS - RIGHT;
                let across = (layout.x.end - layout.x.start) / width;
                let upward = (layout.y.end - layout.y.start) / layout.height;
                assert!((across / upward - 1.0).abs() < 1e-9);
                let flat = axes[0] > 4.0 * axes[1];
                assert!(
                    after.is_none() || [layout.rows, layout.columns] == if flat { [2, 1] } else { [1, 2] }
                );

                let svg = comb_picture("A <blade> & more", &before, after);
                assert!(svg.contains("A &lt;blade&gt; &amp; more") && svg.contains("A tooth is 1 mm long"));
                assert_eq!(svg.contains(">\nafter") || svg.contains(">after"), after.is_some());
                let height: f64 =
                    svg.split("height=\"").nth(1).unwrap().split('"').next().unwrap().parse().unwrap();
                let places = places(&svg);
                assert!(places.len() > 1000);
                for [x, y] in places {
                    assert!((0.0..=WIDTH).contains(&x) && (0.0..=height).contains(&y), "{x} {y} {axes:?}");
                }
            }
        }
    }

    #[test]
    fn straight_lines_have_no_teeth_to_show() {
        let points = vec![Point2::new(0.0, 0.0), Point2::new(0.0, 1.0), Point2::new(0.0, 3.0)];
        let line = CubicSpline::open(vec![0.0, 1.0, 3.0], points).unwrap();
        let svg = comb_picture("Line", &line, None);
        assert!(!svg.contains("NaN") && !svg.contains("cut off"));
        assert!(places(&svg).iter().all(|[x, _]| (0.0..=WIDTH).contains(x)));
    }
}
