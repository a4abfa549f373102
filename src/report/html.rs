//! report.html: one page that opens offline and prints well. Pictures stand in it as data.

use base64::Engine as _;
use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::histogram::Histogram;
use super::result::{ExcessReport, RunReport, ToolpathReport, ToolpathResult};
use super::table::{bound, conclusion, duration, micrometres, per_cent, with_bound};
use super::time_plot;
use super::verdict::{Claim, Verdict, place};
use metrology::ExcessKind;

/// What the page shows of one toolpath besides its figures.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ToolpathPage {
    /// deviation.png.
    pub deviation_png: Vec<u8>,
    /// path.png.
    pub path_png: Vec<u8>,
    /// height.png; `None` where the part is measured along its normals.
    pub height_png: Option<Vec<u8>>,
    /// field.png, interval.png and psi.png, for a streamline.
    pub field_pngs: Option<[Vec<u8>; 3]>,
    /// Scallop heights; `None` without ridges.
    pub histogram: Option<Histogram>,
}

const STYLE: &str = include_str!("style.css");

/// The whole page. `pages` has one entry for each toolpath of `report` that was measured; `scene` is the
/// scene's text.
pub fn html_page(report: &RunReport, pages: &[ToolpathPage], scene: &str) -> String {
    let body = html! {
        header {
            h1 { (report.title) }
            p.verdict.(class(report.verdict)) { (verdict_word(report.verdict)) span { (conclusion(report)) } }
            (findings(report))
            @if !report.notes.is_empty() { ul { @for note in &report.notes { li { (note) } } } }
            p.faint { "scene " (report.scene) " · millstream " (report.millstream) }
        }
        section { h2 { "Comparison" } (comparison(report)) (tolerances(report)) (time_plot::section(report)) }
        @for (toolpath, page) in report.measured().zip(pages) { (toolpath_section(toolpath, page)) }
        section id="figures" { h2 { "What the figures mean" } (meanings(report)) }
        section {
            h2 { "Scene" }
            p.faint { "SHA-256 " code { (report.scene_sha256) } }
            @for input in &report.inputs { p.faint { (input.file) ", SHA-256 " code { (input.sha256) } } }
            pre { (scene) }
        }
    };
    html_document(&report.title, STYLE, &body)
}

/// A page of its own, called `title`.
pub fn html_document(title: &str, style: &str, body: &Markup) -> String {
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { (title) " - millstream" }
                style { (PreEscaped(style)) }
            }
            body { (body) }
        }
    };
    page.into_string()
}

fn verdict_word(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Pass => "PASS",
        Verdict::Undecided => "UNDECIDED",
        Verdict::Fail => "FAIL",
        Verdict::NotPlanned => "NOT PLANNED",
    }
}

/// How a verdict is coloured.
fn class(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Pass => "pass",
        Verdict::Undecided => "undecided",
        Verdict::Fail | Verdict::NotPlanned => "fail",
    }
}

/// What is wrong, of all toolpaths.
fn findings(report: &RunReport) -> Markup {
    html! {
        @if report.verdict != Verdict::Pass {
            ul.violations {
                @for toolpath in &report.toolpaths {
                    @match toolpath {
                        ToolpathReport::Measured(t) => {
                            @for claim in not_held(t) {
                                li.(class(claim.verdict())) { a href=(format!("#{}", t.folder)) { (t.name) } ": " (claim.sentence()) }
                            }
                        }
                        ToolpathReport::NotPlanned(t) => { li.fail { (t.name) " could not be planned: " (t.reason) } }
                    }
                }
            }
        }
    }
}

/// The limits that do not hold, and those of which it is not known.
fn not_held(t: &ToolpathResult) -> impl Iterator<Item = &Claim> {
    t.claims_that(Verdict::Fail).chain(t.claims_that(Verdict::Undecided))
}

fn badge(verdict: Verdict) -> Markup {
    html! { span.badge.(class(verdict)) { (verdict.word()) } }
}

fn comparison(report: &RunReport) -> Markup {
    html! {
        table.figures {
            thead {
                tr {
                    th { "toolpath" } th { "passes" } th { "cutting" } th { "time" } th { "scallop max" } th { "p95" } th { "p50" }
                    th { "over target" } th { "uncut" } th { "gouge" } th { "verdict" }
                }
                tr.unit {
                    th { } th { } th { "mm" } th { "h:min:s" } th { "µm" } th { "µm" } th { "µm" } th { "% of ridges" } th { "mm²" } th { "µm" } th { }
                }
            }
            tbody {
                @for t in report.measured() {
                    tr.best[report.best.as_ref() == Some(&t.name)] {
                        th { a href=(format!("#{}", t.folder)) { (t.name) } }
                        td { (t.path.passes) }
                        td { (format!("{:.0}", t.path.cutting_length_mm)) }
                        td { (duration(t.path.machining_time_s)) }
                        td { (with_bound(t.scallop.max_mm, t.scallop.error_bound_mm)) }
                        td { (micrometres(t.scallop.p95_mm)) }
                        td { (micrometres(t.scallop.p50_mm)) }
                        td { (per_cent(t.scallop.over_target_fraction)) }
                        td { (format!("{:.2}", t.uncut.area_mm2)) }
                        td { (of_deepest_cut(t)) }
                        td { (badge(t.verdict)) }
                    }
                }
                @for toolpath in &report.toolpaths {
                    @if let ToolpathReport::NotPlanned(t) = toolpath {
                        tr { th { (t.name) } td colspan="9" { (t.reason) } td { (badge(t.verdict)) } }
                    }
                }
            }
        }
    }
}

fn tolerances(report: &RunReport) -> Markup {
    let t = &report.tolerance;
    html! {
        p.faint {
            "Limits: the highest ridge stays within " (micrometres(Some(t.scallop_highest_mm))) " µm"
            @if t.scallop_share < 1.0 { ", " (per_cent(Some(t.scallop_share))) " % of the ridge length within " (micrometres(Some(t.scallop_mm))) " µm" }
            "; gouges stay within "
            (micrometres(Some(t.gouge_mm))) " µm, material left standing within " (micrometres(Some(t.uncut_mm)))
            " µm. The path's chords keep " (micrometres(Some(t.chord_mm))) " µm. " a href="#figures" { "What the figures and each ± mean" } "."
        }
    }
}

/// What each figure is and what the ± behind it bounds: whoever reads the page may never have seen the
/// program.
fn meanings(report: &RunReport) -> Markup {
    let mut rows = vec![
        (
            "±",
            "Bound of the figure's own error: the true value differs by no more. A limit holds where figure plus \
             bound lie within it, and is violated where figure less bound exceeds it. Anything else is undecided.",
        ),
        (
            "scallop",
            "Height of the ridges between neighbouring passes, along the normal of the design surface, \
             found where the cuts of both passes meet. p95 and p50: 95 % and half of the ridge length are \
             lower. Over target: share of the ridge length above the target. Its ± is how much higher a ridge \
             may rise between two grid lines.",
        ),
        (
            "highest material",
            "The highest place above the design anywhere on what is judged, up to its borders. It is a scallop or \
             part of one, a remnant along a border beyond the last pass, or uncut. Its ± is how much higher any place may \
             stand.",
        ),
        (
            "gouge",
            "How deep the cut goes below the design. Its ± is how much deeper it may go between two \
             measured places.",
        ),
        (
            "uncut",
            "Material above its limit that is no ridge between passes: places that the cutter does not fit \
             into or that no pass reached. Its ± is how much higher it may stand between two measured places.",
        ),
        (
            "deviation",
            "Distance from the design to the cut surface at every cell, positive where material stands. Its upper end is \
             the highest material anywhere, which mostly peaks between cells.",
        ),
        (
            "time",
            "All moves at their feeds, as far as the limits in [machine] allow: acceleration, cornering, jerk, lines a second.",
        ),
    ];
    for meaning in report.measured().flat_map(|t| &t.figures).filter_map(|figure| figure.meaning) {
        if !rows.contains(&meaning) {
            rows.push(meaning);
        }
    }
    html! { dl.words { @for (word, meaning) in rows { dt { (word) } dd { (meaning) } } } }
}

fn toolpath_section(t: &ToolpathResult, page: &ToolpathPage) -> Markup {
    html! {
        section.toolpath id=(t.folder) {
            h2 { (t.name) " " (badge(t.verdict)) }
            @if !t.scope().is_empty() { p.faint { (verdict_word(t.verdict)) " " (t.scope()) } }
            p.faint { "strategy " (t.strategy) " · files in " code { (t.folder) "/" } }
            @if not_held(t).next().is_some() {
                ul.violations { @for claim in not_held(t) { li.(class(claim.verdict())) { (claim.sentence()) } } }
            }
            @if !t.notes.is_empty() {
                h3 { "Notes" }
                ul { @for note in &t.notes { li { (note) } } }
            }
            (figures(t))
            figure {
                img src=(data_url(&page.deviation_png)) alt=(format!("Deviation of {}", t.name));
                figcaption { "Deviation of the cut surface along the design normal. Red stands above the design, blue below; each side of the key has its own scale and ends at its limit, rounded up. Grey is off the part. Where several cells share a pixel, the worst of them shows. " (ringed(t)) }
            }
            (regions(t))
            (tables(t))
            figure {
                @if let Some(histogram) = &page.histogram {
                    (PreEscaped(histogram.svg()))
                    figcaption { "Scallop heights: share of the ridge length in each bar (left axis), and share that is lower (line, right axis). The last bar holds all that is higher." }
                } @else {
                    figcaption { "No scallop heights: " (t.scallop.reason.as_deref().unwrap_or("no ridge was found")) }
                }
            }
            figure {
                img src=(data_url(&page.path_png)) alt=(format!("Path of {}", t.name));
                figcaption { "The path: passes from the first (dark) to the last (light), links on the surface, and moves off the surface." }
            }
            @if let Some(height_png) = &page.height_png {
                figure {
                    img src=(data_url(height_png)) alt=(format!("Height of {}", t.name));
                    figcaption { "Height of the cut stock." }
                }
            }
            @if let Some(pictures) = &page.field_pngs { (planned(t, pictures)) }
            (method(t, page.field_pngs.is_some()))
        }
    }
}

/// What a streamline was planned by.
fn planned(t: &ToolpathResult, [field, interval, psi]: &[Vec<u8>; 3]) -> Markup {
    html! {
        h3 { "How it was planned" }
        figure {
            img src=(data_url(field)) alt=(format!("Feed directions of {}", t.name));
            figcaption { "Feed directions (strokes), levels of the stream function psi that passes follow (lines, at even steps), and singular points with their index: passes end or turn around them." }
        }
        figure {
            img src=(data_url(interval)) alt=(format!("Intervals of {}", t.name));
            figcaption { "Passes, each as wide as what it serves, coloured by the distance of the farther neighbour over the distance that the scallop height (or the stepover) allows there. White is as allowed, blue narrower, red wider; light grey has no neighbour. Planned, not measured." }
        }
        figure {
            img src=(data_url(psi)) alt=(format!("Stream function of {}", t.name));
            figcaption { "The stream function psi as a surface, seen aslant: each level stands as high as its value, and is coloured by how dense passes are there." }
        }
    }
}

/// Explains the rings on the map, if there are any.
fn ringed(t: &ToolpathResult) -> &'static str {
    if not_held(t).next().is_none() {
        ""
    } else {
        "Rings mark the worst places: G gouges and U uncut material as numbered below, S the highest scallop if it is too high."
    }
}

fn data_url(png: &[u8]) -> String {
    format!("data:image/png;base64,{}", base64::engine::general_purpose::STANDARD.encode(png))
}

/// The highest material and what it is.
fn highest_material(excess: &ExcessReport) -> String {
    let what = match excess.kind {
        ExcessKind::None => "none found",
        ExcessKind::Scallop => "a scallop",
        ExcessKind::Border => "along a border",
        ExcessKind::Uncut => "uncut",
    };
    let highest = &excess.highest;
    format!("{} µm, {what}", with_bound(Some(highest.max_mm), Some(highest.error_bound_mm)))
}

fn of_deepest_cut(t: &ToolpathResult) -> String {
    let [depth, bound] = t.deepest_cut();
    with_bound(Some(depth), Some(bound))
}

fn figures(t: &ToolpathResult) -> Markup {
    let (path, deviation) = (&t.path, &t.deviation);
    let mut rows = vec![
        ("machining time", duration(path.machining_time_s)),
        ("cutting length", format!("{:.1} mm", path.cutting_length_mm)),
        (
            "length of links, air length",
            format!("{:.1} mm, {:.1} mm", path.link_length_mm, path.air_length_mm),
        ),
        ("passes, cutter locations", format!("{}, {}", path.passes, path.cl_points)),
        ("links on the surface, retracts", format!("{}, {}", path.surface_links, path.retracts)),
        (
            "total turning, turns above 30°",
            format!("{:.0} rad, {}", path.total_turning_rad, path.sharp_turns),
        ),
        ("highest material", highest_material(&t.excess)),
        ("highest scallop", format!("{} µm", with_bound(t.scallop.max_mm, t.scallop.error_bound_mm))),
        ("mean scallop height", format!("{} µm", micrometres(t.scallop.mean_mm))),
        ("ridge length", format!("{:.1} mm", t.scallop.ridge_length_mm)),
        (
            "deepest gouge",
            format!("{} µm", with_bound(Some(t.gouge.max_depth_mm), Some(t.gouge.error_bound_mm))),
        ),
        ("uncut area, volume", format!("{:.3} mm², {:.4} mm³", t.uncut.area_mm2, t.uncut.volume_mm3)),
        (
            "deviation from, to",
            format!("{} to {} µm", micrometres(deviation.min_mm), micrometres(deviation.max_mm)),
        ),
        ("deviation, root mean square", format!("{} µm", micrometres(deviation.rms_mm))),
    ];
    rows.extend(t.figures.iter().flat_map(|figure| figure.rows.iter().cloned()));
    html! { dl.grid { @for (name, value) in &rows { div { dt { (name) } dd { (value) } } } } }
}

fn regions(t: &ToolpathResult) -> Markup {
    html! {
        @if !t.gouge.regions.is_empty() {
            h3 { "Gouges" }
            p.faint { (shown(t.gouge.regions.len(), t.gouge.region_count)) }
            table.figures {
                thead { tr { th { "ring" } th { "depth µm" } th { "area mm²" } th { "at mm" } th { "move" } th { "line of the program" } } }
                tbody { @for (k, r) in (1..).zip(&t.gouge.regions) {
                    tr { th { "G" (k) } td { (micrometres(Some(r.depth_mm))) } td { @if r.area_mm2 > 0.0 { (format!("{:.4}", r.area_mm2)) } @else { "–" } } td { (place(r.at_mm)) } td { @if r.move_index == sim::NOT_CUT { "–" } @else { (r.move_index) } } td { @if r.line > 0 { (r.line) } @if let Some(tool) = r.tool { ", tool " (tool) } @if let Some(name) = &r.toolpath { ", " (name) } } }
                } }
            }
        }
        @if !t.uncut.regions.is_empty() {
            h3 { "Uncut material" }
            p.faint { (shown(t.uncut.regions.len(), t.uncut.region_count)) }
            table.figures {
                thead { tr { th { "ring" } th { "height µm" } th { "area mm²" } th { "volume mm³" } th { "at mm" } } }
                tbody { @for (k, r) in (1..).zip(&t.uncut.regions) {
                    tr { th { "U" (k) } td { (micrometres(Some(r.height_mm))) } td { (format!("{:.4}", r.area_mm2)) } td { (format!("{:.4}", r.volume_mm3)) } td { (place(r.at_mm)) } }
                } }
            }
        }
    }
}

/// The tables of further figures.
fn tables(t: &ToolpathResult) -> Markup {
    html! {
        @for table in t.figures.iter().filter_map(|figure| figure.table.as_ref()) {
            h3 { (table.title) }
            p.faint { (table.caption) }
            table.figures {
                thead { tr { @for name in &table.columns { th { (name) } } } }
                tbody { @for row in &table.rows { tr { @for text in row { td { (text) } } } } }
            }
        }
    }
}

fn shown(listed: usize, found: usize) -> String {
    if listed == found {
        format!("{found} found")
    } else {
        format!("{found} found, the {listed} worst listed")
    }
}

fn method(t: &ToolpathResult, field: bool) -> Markup {
    let s = &t.simulation;
    html! {
        h3 { "How it was measured" }
        p {
            "The stock was cut by " (s.moves) " moves on " (s.cells) " cells of " (s.cell_mm) " mm (engine " em { (s.engine) }
            "), then compared with the design part at " (t.deviation.samples) " places over "
            (format!("{:.1}", t.deviation.area_mm2)) " mm². The planner's own predictions were not used. "
            @if let Some(error) = t.scallop.error_bound_mm { "The true highest scallop lies within " (bound(error)) " µm of the figure, " }
            "the true deepest gouge within " (bound(t.gouge.error_bound_mm)) " µm, the true height of uncut material within "
            (bound(t.uncut.error_bound_mm)) " µm. Cutting and measuring took " (format!("{:.2}", s.wall_s)) " s on " (s.threads)
            @if s.threads == 1 { " thread." } @else { " threads." }
        }
        p.faint {
            "Files: toolpath.nc (the program, where it was planned here), toolpath.cls (cutter locations), height.exr (height, deviation and move of every cell), machined.stl and machined.ply (the part as cut, the latter coloured by deviation; "
            (t.surface_mesh.triangles) " triangles within " (bound(t.surface_mesh.tolerance_mm)) " µm of the cells"
            @if t.surface_mesh.tolerance_mm > t.scallop.target_mm { ": too coarse for ridges of the target's height; height.exr has them" }
            "), scallop_pairs.csv (calculated and measured scallops of each pair of passes), deviation.png, height.png and path.png" @if field { ", field.png, interval.png and psi.png" } " (larger than here)."
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixture;
    use super::*;

    #[test]
    fn the_page_needs_nothing_from_outside_and_escapes_what_it_quotes() {
        let report = fixture::report();
        let png = vec![1u8, 2, 3];
        let page = ToolpathPage {
            deviation_png: png.clone(),
            path_png: png.clone(),
            height_png: Some(png.clone()),
            field_pngs: None,
            histogram: Histogram::new(&[[0.004, 1.0]], 0.01, 0.0125),
        };
        let streamline = ToolpathPage { field_pngs: Some([png.clone(), png.clone(), png]), ..page.clone() };
        let html = html_page(&report, &[page, streamline], "title = \"<script>\" # a & b");
        assert!(html.contains("&lt;script&gt;") && !html.contains("<script"));
        assert!(!html.contains("http://") && !html.contains("https://"), "nothing is fetched");
        assert_eq!(html.matches("data:image/png;base64,AQID").count(), 9);
        assert_eq!(html.matches("toolpath.nc line 1240").count(), 2, "in the head and in its toolpath");
        assert!(html.contains("Rings mark") && html.contains("<th>G1</th>") && !html.contains("<th>G2</th>"));
        assert!(html.contains("1 of 2 toolpaths hold every tolerance"));
        assert!(html.contains("0.00 ± 0.00 µm, none found"), "there is no ridge to call a scallop");
    }
}
