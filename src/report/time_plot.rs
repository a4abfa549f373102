//! Ridges over machining time, where toolpaths were planned for equal times: a table, and its plot as SVG.
//! Whoever is lower at the same time is smoother; whoever is farther to the left at the same height is
//! faster.

use maud::{Markup, PreEscaped, html};
use plotters::element::DynElement;
use plotters::prelude::*;
use serde_json::Value;

use super::plot::{Drawn, FAINT, GRID, LETTERS, Page, letters, svg};
use super::result::{RunReport, ToolpathResult};
use super::scale::{Unit, plain, round_up};
use super::table::{duration, micrometres};

/// Size of the drawing; the page shows it at half of that, since the backend rounds to whole units.
const SIZE: (u32, u32) = (1440, 640);

/// Marks along an axis, at most.
const TICKS: usize = 10;

/// How large a mark is.
const MARK: i32 = 8;

/// Room on both sides of the times, as a share of the longest.
const ROOM: f64 = 0.06;

/// Colours of toolpaths in turn, told apart by those who see few colours as well.
const COLOURS: [RGBColor; 7] = [
    RGBColor(0x1f, 0x4e, 0x79),
    RGBColor(0xd5, 0x5e, 0x00),
    RGBColor(0x00, 0x8e, 0x6b),
    RGBColor(0xa6, 0x3d, 0x84),
    RGBColor(0x7a, 0x5c, 0x00),
    RGBColor(0x30, 0x9a, 0xd6),
    RGBColor(0x60, 0x60, 0x60),
];

/// What is drawn of each toolpath.
const HEIGHTS: [&str; 3] = ["highest", "p95", "Ra"];

/// A toolpath that was planned for a time.
#[derive(Debug, Clone, PartialEq)]
struct Timed<'a> {
    name: &'a str,
    /// Its name without the time.
    of: &'a str,
    minutes: f64,
    /// [`HEIGHTS`], mm; `None` where one was not measured.
    heights: [Option<f64>; 3],
}

impl<'a> Timed<'a> {
    /// `None` where it was planned for no time.
    fn of(t: &'a ToolpathResult) -> Option<Self> {
        let figure =
            |key: &str| t.figures.iter().find(|figure| figure.key == key).map(|figure| &figure.value);
        let of = figure("equal_time")?.get("of")?.as_str()?;
        let ra = figure("roughness").and_then(|value| value.get("ra_mm")).and_then(Value::as_f64);
        let minutes = t.path.machining_time_s / 60.0;
        Some(Self { name: &t.name, of, minutes, heights: [t.scallop.max_mm, t.scallop.p95_mm, ra] })
    }
}

/// Table and plot of the toolpaths that were planned for a time; nothing where none was.
pub(super) fn section(report: &RunReport) -> Markup {
    let timed: Vec<Timed<'_>> = report.measured().filter_map(Timed::of).collect();
    html! {
        @if !timed.is_empty() {
            h3 { "Ridges at equal machining times" }
            table.figures {
                thead {
                    tr { th { "toolpath" } th { "time" } @for height in HEIGHTS { th { (height) } } }
                    tr.unit { th { } th { "h:min:s" } @for _ in HEIGHTS { th { "µm" } } }
                }
                tbody { @for t in &timed { tr {
                    th { (t.name) }
                    td { (duration(60.0 * t.minutes)) }
                    @for height in t.heights { td { (micrometres(height)) } }
                } } }
            }
            figure {
                (PreEscaped(svg(SIZE, |page| draw(&timed, page))))
                figcaption { "Measured heights over the machining time: highest ridge (rings), p95 of the ridges (dots) and roughness Ra across the feed (crosses). Lower is smoother, farther left is faster." }
            }
        }
    }
}

fn draw(timed: &[Timed<'_>], page: &Page<'_>) -> Drawn {
    let times = || timed.iter().map(|t| t.minutes);
    let longest = times().fold(f64::MIN_POSITIVE, f64::max);
    let shortest = times().fold(longest, f64::min);
    let tallest = timed.iter().flat_map(|t| t.heights).flatten().fold(0.0, f64::max);
    let top = if tallest > 0.0 { tallest * (1.0 + ROOM) } else { 1.0 };
    let (from, to) = (shortest - ROOM * longest, longest * (1.0 + ROOM));
    let unit = Unit::for_range(top);
    let steps = [(to - from) / TICKS as f64, top / TICKS as f64].map(round_up);
    let mut chart = ChartBuilder::on(page)
        .margin(16)
        .x_label_area_size(76)
        .y_label_area_size(110)
        .build_cartesian_2d(from..to, 0.0..top)?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(GRID)
        .axis_style(FAINT)
        .label_style(letters(LETTERS))
        .x_labels(TICKS)
        .y_labels(TICKS)
        .x_label_formatter(&|minutes| plain(*minutes, steps[0]))
        .y_label_formatter(&|mm| unit.text(*mm, steps[1]))
        .x_desc("machining time, min")
        .y_desc(format!("height, {}", unit.name))
        .draw()?;
    let mut names: Vec<&str> = Vec::new();
    timed.iter().for_each(|t| {
        if !names.contains(&t.of) {
            names.push(t.of)
        }
    });
    for (k, name) in names.iter().enumerate() {
        let colour = COLOURS[k % COLOURS.len()];
        for (which, _) in HEIGHTS.iter().enumerate() {
            let its = timed.iter().filter(|t| t.of == *name);
            let mut places: Vec<(f64, f64)> =
                its.filter_map(|t| Some((t.minutes, t.heights[which]?))).collect();
            places.sort_by(|a, b| a.0.total_cmp(&b.0));
            chart.draw_series(LineSeries::new(places.iter().copied(), colour.stroke_width(2)))?;
            let marks = places.iter().map(|place| mark(which, *place, colour));
            let series = chart.draw_series(marks)?;
            if which == 0 {
                series.label(*name).legend(move |at| Circle::new(at, MARK, colour.filled()));
            }
        }
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .label_font(letters(LETTERS))
        .background_style(WHITE.mix(0.85))
        .border_style(GRID)
        .draw()?;
    page.present()
}

/// A mark for one of [`HEIGHTS`].
fn mark<'a>(
    which: usize,
    at: (f64, f64),
    colour: RGBColor,
) -> DynElement<'static, SVGBackend<'a>, (f64, f64)> {
    match which {
        // A ring, since p95 is often next to it.
        0 => Circle::new(at, 2 * MARK, colour.stroke_width(3)).into_dyn(),
        1 => Circle::new(at, MARK, colour.filled()).into_dyn(),
        _ => Cross::new(at, MARK, colour.stroke_width(4)).into_dyn(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::figure::Figure;
    use super::super::result::ToolpathReport;
    use super::super::{RunReport, fixture};
    use super::*;

    fn timed(name: &str, of: &str, seconds: f64, ra: Option<f64>) -> ToolpathReport {
        let mut toolpath = fixture::toolpath(name, seconds, 0.0);
        let figure = |key, value| Figure { key, value, ..Figure::default() };
        toolpath.figures.push(figure("equal_time", serde_json::json!({ "of": of })));
        toolpath.figures.push(figure("roughness", serde_json::json!({ "ra_mm": ra })));
        ToolpathReport::Measured(Box::new(toolpath))
    }

    fn report(toolpaths: Vec<ToolpathReport>) -> RunReport {
        RunReport::new("a".into(), "b".into(), "c".into(), fixture::tolerance(), toolpaths)
    }

    #[test]
    fn toolpaths_that_were_planned_for_a_time_are_told_and_drawn() {
        let rows = vec![
            timed("zigzag, 2 min", "zigzag", 120.0, Some(0.0021)),
            timed("zigzag, 3 min", "zigzag", 180.5, None),
            timed("iso", "iso", 119.0, Some(0.0024)),
        ];
        let page = section(&report(rows)).into_string();
        for words in ["zigzag, 3 min", "<td>2.10</td>", "<td>-</td>", "machining time, min", "height, µm"] {
            assert!(page.contains(words), "{words}\n{page}");
        }
        // A ring and a dot for each, and a dot for each name in the key.
        assert_eq!(page.matches("<circle").count(), 3 + 3 + 2, "{page}");
        assert!(!page.contains("http"));
    }

    #[test]
    fn one_time_alone_is_drawn_and_none_leaves_nothing() {
        let page = section(&report(vec![timed("zigzag", "zigzag", 120.0, None)])).into_string();
        assert!(page.contains("<svg") && !page.contains("NaN"));
        assert!(section(&fixture::report()).into_string().is_empty());
    }
}
