//! Plots as SVG elements.

use plotters::coord::Shift;
use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint, Ranged};
use plotters::drawing::DrawingAreaErrorKind;
use plotters::prelude::*;
use std::ops::Range;

/// Size of the drawing; the page shows it smaller, since the backend rounds to whole units.
const SIZE: (u32, u32) = (1040, 640);

const INK: RGBColor = RGBColor(0x20, 0x24, 0x2a);
const FAINT: RGBColor = RGBColor(0x60, 0x66, 0x6e);
const GRID: RGBColor = RGBColor(0xd5, 0xd9, 0xde);
/// One for each curve or kind of mark; they differ for the colour-blind too.
const COLOURS: [RGBColor; 4] = [
    RGBColor(0x1f, 0x4e, 0x79),
    RGBColor(0xd9, 0x7a, 0x1f),
    RGBColor(0x1b, 0x7f, 0x4b),
    RGBColor(0x8a, 0x8f, 0x96),
];

type Page<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Drawn<'a> = Result<(), DrawingAreaErrorKind<<SVGBackend<'a> as DrawingBackend>::ErrorType>>;

/// Points to be drawn as dots, or as a line.
pub struct Curve {
    pub name: &'static str,
    pub points: Vec<(f64, f64)>,
    pub line: bool,
}

/// A figure by its kind.
pub struct Mark(pub &'static str, pub f64);

/// Exponents of the whole decades around all values above 0.
fn decades(values: impl Iterator<Item = f64>) -> Range<f64> {
    let (low, high) = values
        .filter(|v| v.is_finite() && *v > 0.0)
        .map(f64::log10)
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
    if low > high { 0.0..1.0 } else { low.floor()..high.ceil().max(low.floor() + 1.0) }
}

/// An axis with a mark at each whole number: the exponent of a decade, or a case.
struct Wholes(Range<f64>);

impl Ranged for Wholes {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        let share = (value - self.0.start) / (self.0.end - self.0.start);
        limit.0 + (share * f64::from(limit.1 - limit.0)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, _: Hint) -> Vec<f64> {
        (self.0.start.ceil() as i32..=self.0.end.floor() as i32).map(f64::from).collect()
    }

    fn range(&self) -> Range<f64> {
        self.0.clone()
    }
}

/// A power of ten.
fn power(exponent: f64) -> String {
    match exponent.round() as i32 {
        k @ 0..=3 => format!("{}", 10i32.pow(k as u32)),
        k @ -3..0 => format!("{:.*}", k.unsigned_abs() as usize, 10f64.powi(k)),
        k => format!("1e{k}"),
    }
}

/// Curves over two axes of decades.
pub fn log_log(title: &str, x_name: &str, y_name: &str, curves: &[Curve]) -> String {
    let all = || curves.iter().flat_map(|c| &c.points);
    let x = decades(all().map(|p| p.0));
    // A curve that leaves the decades of the dots is cut off.
    let y = decades(curves.iter().filter(|c| !c.line).flat_map(|c| &c.points).map(|p| p.1));
    svg(|page| {
        let mut chart = ChartBuilder::on(page)
            .caption(title, letters())
            .margin(14)
            .x_label_area_size(76)
            .y_label_area_size(110)
            .build_cartesian_2d(Wholes(x.clone()), Wholes(y.clone()))?;
        chart
            .configure_mesh()
            .bold_line_style(GRID)
            .axis_style(FAINT)
            .label_style(letters())
            .x_label_formatter(&|k| power(*k))
            .y_label_formatter(&|k| power(*k))
            .x_desc(x_name)
            .y_desc(y_name)
            .draw()?;
        for (curve, colour) in curves.iter().zip(COLOURS) {
            let points = curve.points.iter().map(|p| (p.0.log10(), p.1.log10()));
            let shown = points.filter(|p| y.contains(&p.1));
            let series = if curve.line {
                chart.draw_series(LineSeries::new(shown, colour.stroke_width(3)))?
            } else {
                chart.draw_series(shown.map(|p| Circle::new(p, 8, colour.filled())))?
            };
            let line = curve.line;
            series.label(curve.name).legend(move |(x, y)| legend(x, y, colour, line));
        }
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::LowerRight)
            .label_font(letters())
            .background_style(WHITE)
            .border_style(GRID)
            .margin(12)
            .draw()?;
        page.present()
    })
}

/// Figures of several kinds, a line for each case, over an axis of decades.
pub fn dots(title: &str, x_name: &str, cases: &[(String, Vec<Mark>)]) -> String {
    let x = decades(cases.iter().flat_map(|(_, marks)| marks).map(|m| m.1));
    // Room above the cases for what the colours mean.
    let y = -0.6..cases.len() as f64 + 1.4;
    svg(|page| {
        let mut chart = ChartBuilder::on(page)
            .caption(title, letters())
            .margin(14)
            .margin_right(30)
            .x_label_area_size(76)
            .y_label_area_size(300)
            .build_cartesian_2d(Wholes(x.clone()), Wholes(y.clone()))?;
        chart
            .configure_mesh()
            .bold_line_style(GRID)
            .axis_style(FAINT)
            .label_style(letters())
            .x_label_formatter(&|k| power(*k))
            // The first case stands on top.
            .y_label_formatter(&|k| {
                cases.iter().rev().nth(*k as usize).map_or(String::new(), |c| c.0.clone())
            })
            .x_desc(x_name)
            .draw()?;
        for (kind, colour) in (0..cases.iter().map(|c| c.1.len()).max().unwrap_or(0)).zip(COLOURS) {
            let found = cases.iter().rev().enumerate().filter_map(|(k, (_, marks))| {
                marks.get(kind).map(|mark| (k as f64, mark)).filter(|(_, mark)| mark.1 > 0.0)
            });
            let name = cases.iter().find_map(|c| c.1.get(kind)).map_or("", |mark| mark.0);
            chart
                .draw_series(found.map(|(k, mark)| Circle::new((mark.1.log10(), k), 9, colour.filled())))?
                .label(name)
                .legend(move |(x, y)| legend(x, y, colour, false));
        }
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperRight)
            .label_font(letters())
            .background_style(WHITE)
            .border_style(GRID)
            .margin(12)
            .draw()?;
        page.present()
    })
}

/// The sign of a curve in the legend: a stroke or a blot.
fn legend(x: i32, y: i32, colour: RGBColor, line: bool) -> Rectangle<(i32, i32)> {
    let corners = if line { [(x, y - 2), (x + 22, y + 1)] } else { [(x + 4, y - 7), (x + 18, y + 7)] };
    Rectangle::new(corners, colour.filled())
}

/// Letters as high as the page's small ones; the page names the face.
fn letters() -> TextStyle<'static> {
    ("sans-serif", 24).into_font().color(&INK)
}

fn svg(draw: impl for<'a> Fn(&Page<'a>) -> Drawn<'a>) -> String {
    let mut svg = String::new();
    draw(&SVGBackend::with_string(&mut svg, SIZE).into_drawing_area())
        .expect("drawing into a string cannot fail");
    // Within a page the namespace is known, and its address would be the only one in it.
    svg.replacen(" xmlns=\"http://www.w3.org/2000/svg\"", " role=\"img\"", 1)
}
