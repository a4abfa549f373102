//! Cell against error: the part of the page that says how figures converge, and how engines agree.

use maud::{Markup, PreEscaped, html};
use plotters::coord::Shift;
use plotters::prelude::*;

use super::checks::{Measured, Study, studies};
use super::figures::Figure;
use super::results::Results;
use super::words::{number, tick};

/// Errors below this, mm, are drawn at it: a logarithm has no zero. A tenth of a nanometre is rounding.
const LEAST_MM: f64 = 1e-7;

/// The section of all studies; nothing where there are none.
pub fn section(results: &Results) -> Markup {
    let studies = studies(results);
    html! {
        @if !studies.is_empty() {
            section id="convergence" {
                h2 { "Closed forms, engines and cells" }
                p.faint {
                    "Each figure against its closed form, or against the scene as written where there is none. The error must \
                     be within the bounds of both. Lines: error against cell; dashed: the bound."
                }
                @for study in &studies { (one(study)) }
            }
        }
    }
}

fn one(study: &Study<'_>) -> Markup {
    let wrong = study.rows.iter().filter(|row| study.contradicts(row)).count();
    let worst = study.rows.iter().map(|row| study.error(row).abs()).fold(0.0, f64::max);
    let shown = |value: f64| number(study.figure.shown(value));
    let (unit, exact) = (study.figure.unit(), study.is_exact);
    html! {
        details open[wrong > 0 || exact] {
            summary {
                b { (study.scene) ", " (study.toolpath) ": " (study.figure.name) } " "
                (shown(study.truth)) " " (unit) @if exact { " by its closed form" } ", largest error " (error(study.figure, worst)) " " (unit) " "
                @if wrong == 0 { span.pass { "agrees" } } @else { span.fail { (wrong) " of " (study.rows.len()) " contradict" } }
            }
            div.study {
                table {
                    thead { tr { th { "engine" } th { "cell" small { "mm" } } th { (study.figure.name) small { (unit) } } th { "error" small { (unit) } } th { "bound" small { (unit) } } } }
                    tbody { @for row in &study.rows {
                        tr {
                            th { (engine(row)) }
                            td { (row.scene.case.cell_mm.map_or_else(|| "as written".into(), tick)) }
                            td { (shown(row.value)) }
                            td.worse[study.contradicts(row)] { (error(study.figure, study.error(row))) }
                            td { (shown(row.bound)) }
                        }
                    } }
                }
                // A picture that cannot be drawn leaves its table.
                @if let Some(svg) = picture(study) { (PreEscaped(svg)) }
            }
        }
    }
}

/// An error as the page shows it; what is rounding is not shown in digits.
fn error(figure: &Figure, value: f64) -> String {
    if value.abs() < LEAST_MM {
        format!("< {}", tick(figure.shown(LEAST_MM)))
    } else {
        number(figure.shown(value))
    }
}

fn engine<'a>(row: &Measured<'a>) -> &'a str {
    row.scene.case.engine.as_deref().unwrap_or("of the scene")
}

/// A line of a picture: cells, mm, with errors and bounds, mm.
struct Line<'a> {
    engine: &'a str,
    /// By growing cell.
    points: Vec<[f64; 3]>,
}

/// A line for each engine that was run with two cells or more.
fn lines<'a>(study: &Study<'a>) -> Vec<Line<'a>> {
    let mut lines: Vec<Line<'a>> = Vec::new();
    for row in &study.rows {
        let Some(cell) = row.scene.case.cell_mm else { continue };
        let point = [cell, study.error(row).abs(), row.bound];
        match lines.iter_mut().find(|line| line.engine == engine(row)) {
            Some(line) => line.points.push(point),
            None => lines.push(Line { engine: engine(row), points: vec![point] }),
        }
    }
    lines.retain(|line| line.points.len() > 1);
    lines.iter_mut().for_each(|line| line.points.sort_by(|a, b| a[0].total_cmp(&b[0])));
    lines
}

fn picture(study: &Study<'_>) -> Option<String> {
    let lines = lines(study);
    if lines.is_empty() {
        return None;
    }
    let mut svg = String::new();
    draw(&SVGBackend::with_string(&mut svg, (520, 300)).into_drawing_area(), &lines).ok()?;
    Some(svg)
}

fn draw(
    area: &DrawingArea<SVGBackend<'_>, Shift>,
    lines: &[Line<'_>],
) -> Result<(), Box<dyn std::error::Error>> {
    /// Distinct in print and for most colour-blind readers (Okabe and Ito, 2008).
    const COLOURS: [RGBColor; 5] = [
        RGBColor(0, 114, 178),
        RGBColor(213, 94, 0),
        RGBColor(0, 158, 115),
        RGBColor(204, 121, 167),
        RGBColor(0, 0, 0),
    ];
    let all = || lines.iter().flat_map(|line| &line.points);
    let range = |values: &mut dyn Iterator<Item = f64>| {
        let (low, high) = values.fold((f64::INFINITY, 0.0f64), |(l, h), v| (l.min(v), h.max(v)));
        low / 1.5..high * 1.5
    };
    let cells = range(&mut all().map(|[cell, ..]| *cell));
    // The names of the engines stand on the right of the lines.
    let cells = cells.start..3.0 * cells.end;
    let errors = range(&mut all().flat_map(|[_, e, b]| [e.max(LEAST_MM), b.max(LEAST_MM)]));
    let mut chart = ChartBuilder::on(area)
        .margin(8)
        .x_label_area_size(36)
        .y_label_area_size(64)
        .build_cartesian_2d(cells.log_scale(), errors.log_scale())?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .y_labels(6)
        .x_desc("cell, mm")
        .y_desc("error, µm")
        .x_label_formatter(&|x| tick(*x))
        .y_label_formatter(&|y| tick(1e3 * y))
        .draw()?;
    for (line, colour) in lines.iter().zip(COLOURS.iter().cycle()) {
        let through = |k: usize| line.points.iter().map(move |point| (point[0], point[k].max(LEAST_MM)));
        chart.draw_series(DashedLineSeries::new(through(2), 4, 4, colour.stroke_width(1)))?;
        let series = LineSeries::new(through(1), colour.stroke_width(2)).point_size(3);
        chart
            .draw_series(series)?
            .label(line.engine)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], colour.stroke_width(2)));
    }
    chart.configure_series_labels().background_style(WHITE.mix(0.8)).border_style(TRANSPARENT).draw()?;
    area.present()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::fixture::{results, scene};
    use super::super::results::{Case, Outcome, SceneResult};
    use super::*;

    fn run(engine: Option<&str>, cell_mm: Option<f64>, value: f64) -> SceneResult {
        let case = Case { engine: engine.map(str::to_owned), cell_mm, ..Case::plain("a") };
        let mut one = SceneResult { name: case.name(), case, ..scene("a", 0.01) };
        if let Outcome::Done { toolpaths, .. } = &mut one.outcome {
            toolpaths[0].figures.insert("gouge_mm".into(), value);
            toolpaths[0].bounds.insert("gouge_mm".into(), 1e-4);
        }
        one
    }

    #[test]
    fn each_engine_has_a_line_and_no_error_breaks_the_picture() {
        let cells = [0.4, 0.2, 0.1].map(|cell| run(Some("voxel"), Some(cell), 0.01 + 1e-4 * cell));
        let exact = [0.2, 0.1].map(|cell| run(Some("rays"), Some(cell), 0.01));
        let alone = run(Some("reference"), None, 0.02);
        let scenes = cells.into_iter().chain(exact).chain([run(None, None, 0.01), alone]).collect();
        let page = section(&results(scenes)).into_string();
        assert_eq!(page.matches("<svg").count(), 1);
        assert!(page.contains("voxel</text>") || page.contains("voxel\n</text>"), "{page}");
        assert!(page.contains("1 of 7 contradict") && page.matches("class=\"worse\"").count() == 1, "{page}");
        assert!(section(&results(vec![scene("a", 0.01)])).into_string().is_empty());
    }
}
