//! report.html: one page that opens offline. What got worse first, then each figure with its change and its
//! trend.

use maud::{Markup, html};
use report::html_document;

use super::accuracy::tables;
use super::compare::{Comparison, Finding};
use super::convergence;
use super::figures::{FIGURES, Figure};
use super::history::History;
use super::markdown::summary;
use super::published::{self, Published};
use super::results::{Outcome, Results, SceneResult, ToolpathResult};
use super::rules::Rules;
use super::words::{change, number};

const STYLE: &str = include_str!("style.css");

/// The whole page. Changes are shown against `baseline`; trend lines come from `history`.
pub fn html_page(
    results: &Results,
    baseline: Option<&Results>,
    comparison: &Comparison,
    history: &History,
    rules: &Rules,
    published: &[Published],
) -> String {
    let page = Page { baseline, history, rules };
    let class = if comparison.worse.is_empty() { "pass" } else { "fail" };
    let body = html! {
        header {
            h1 { "Nightly report" }
            p.verdict.(class) { (summary(results, comparison)) }
            p.faint { "millstream " (results.millstream) " · " (results.date) }
        }
        (findings("What got worse", "fail", &comparison.worse, results))
        (findings("What got better", "pass", &comparison.better, results))
        (findings("Notes", "", &comparison.notes, results))
        section {
            h2 { "All scenes" }
            p.faint {
                "Under each value: its change since the baseline, and its line over the last nights if it changed. A \
                 line spans the least to the greatest value; point at it for both. Cost is the CPU time over that of a fixed reference \
                 computation."
            }
            @if history.skipped > 0 { p.faint { "Lines of the history that could not be read: " (history.skipped) "." } }
            div.scroll { (page.table(results, comparison)) }
        }
        (convergence::section(results))
        @for table in tables(results) { (table.html()) }
        (published::table(results, published).html())
    };
    html_document("Nightly report", STYLE, &body)
}

fn findings(title: &str, class: &str, findings: &[Finding], results: &Results) -> Markup {
    let page = |scene: &str| results.scene(scene).and_then(|scene| scene.page.as_deref());
    html! {
        @if !findings.is_empty() {
            section {
                h2 { (title) " (" (findings.len()) ")" }
                ul { @for f in findings { li {
                    a href=(format!("#{}", anchor(&f.scene))) { b { (f.place()) } } ": " span.(class) { (f.text) }
                    @if let Some(page) = page(&f.scene) { " " a.faint href=(url(page)) { "its report" } }
                } } }
            }
        }
    }
}

/// The name of a scene's row within the page.
fn anchor(scene: &str) -> String {
    let plain = |c: char| {
        if c.is_ascii_alphanumeric() || c == '-' { c.to_string() } else { format!("_{:x}", c as u32) }
    };
    format!("scene-{}", scene.chars().map(plain).collect::<String>())
}

struct Page<'a> {
    baseline: Option<&'a Results>,
    history: &'a History,
    rules: &'a Rules,
}

impl Page<'_> {
    fn table(&self, results: &Results, comparison: &Comparison) -> Markup {
        // Other engines and cells have a section of their own.
        let shown = |scene: &&SceneResult| scene.case.is_plain() || comparison.concerns(&scene.name);
        html! {
            table {
                thead { tr {
                    th { "scene, toolpath" } th { "verdict" }
                    @for figure in &FIGURES { th { (figure.name) small { (figure.unit()) } } }
                    th { "cost" small { "ratio" } } th { "CPU" small { "s" } } th { "time" small { "s" } } th { "memory" small { "MiB" } }
                } }
                tbody { @for scene in results.scenes.iter().filter(shown) { (self.scene(scene)) } }
            }
        }
    }

    fn scene(&self, scene: &SceneResult) -> Markup {
        let before = self.baseline.and_then(|baseline| baseline.scene(&scene.name));
        let cost = &scene.cost;
        let ratio = scene.cost_ratio();
        let optional = |value: Option<f64>| value.map_or_else(|| "–".into(), number);
        let by = ratio.zip(before.and_then(SceneResult::cost_ratio)).and_then(|(new, old)| change(old, new));
        let words = FIGURES.len();
        html! {
            tr.scene id=(anchor(&scene.name)) {
                th { @match &scene.page { Some(page) => { a href=(url(page)) { (scene.name) } }, None => { (scene.name) } } }
                td.(class(scene.word())) { (scene.word()) }
                @match &scene.outcome {
                    Outcome::Failed { reason } => { td.reason colspan=(words) { (reason) } }
                    Outcome::Done { .. } => { td colspan=(words) { } }
                }
                td { (optional(ratio)) @if let Some(by) = by { small { (by) } } (trend(&self.history.cost_trend(&scene.name), 1.0)) }
                td { (optional(cost.cpu_s)) } td { (number(cost.wall_s)) } td { (optional(cost.peak_mib)) }
            }
            @for toolpath in scene.toolpaths() {
                @let old = before.and_then(|b| b.toolpaths().iter().find(|old| old.name == toolpath.name));
                tr {
                    th { (toolpath.name) }
                    td.(class(toolpath.verdict.word())) { (toolpath.verdict.word()) }
                    @for figure in &FIGURES { (self.figure(&scene.name, figure, toolpath, old)) }
                    td { } td { } td { } td { }
                }
            }
        }
    }

    fn figure(
        &self,
        scene: &str,
        figure: &Figure,
        now: &ToolpathResult,
        before: Option<&ToolpathResult>,
    ) -> Markup {
        let value = now.figures.get(figure.key).copied();
        let old = before.and_then(|before| before.figures.get(figure.key).copied());
        let both = value.zip(old);
        let worse = both.is_some_and(|(new, old)| self.rules.limit(figure.group).is_exceeded(old, new));
        let by = both.and_then(|(new, old)| change(old, new));
        let unit = figure.shown(1.0);
        html! {
            td.worse[worse] {
                (now.shown(figure))
                @if let Some(by) = by { small { (by) } }
                (trend(&self.history.trend(scene, &now.name, figure.key), unit))
            }
        }
    }
}

fn class(word: &str) -> &'static str {
    match word {
        "pass" => "pass",
        "undecided" => "undecided",
        _ => "fail",
    }
}

/// A relative address of a file: a name may have characters that mean something in one.
fn url(path: &str) -> String {
    let plain = |b: u8| b.is_ascii_alphanumeric() || b"-._~/".contains(&b);
    path.bytes().map(|b| if plain(b) { char::from(b).to_string() } else { format!("%{b:02X}") }).collect()
}

/// Values over the nights as a small line; none where nothing changed.
fn trend(values: &[f64], unit: f64) -> Markup {
    const SIZE: [f64; 2] = [72.0, 22.0];
    /// Around the line, so that its ends and the last point are whole.
    const MARGIN: f64 = 3.0;
    /// Least height of the range, as a share of the value: below it, what changes is rounding.
    const FLAT: f64 = 1e-3;
    let (low, high) =
        values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
    if values.len() < 2 || low == high {
        return html! {};
    }
    let span = (high - low).max(FLAT * high.abs()).max(f64::MIN_POSITIVE);
    let middle = 0.5 * (low + high);
    let at = |(k, value): (usize, &f64)| {
        let x = MARGIN + (SIZE[0] - 2.0 * MARGIN) * k as f64 / (values.len() - 1) as f64;
        let y = SIZE[1] * 0.5 - (SIZE[1] - 2.0 * MARGIN) * (value - middle) / span;
        [x, y]
    };
    let points: Vec<[f64; 2]> = values.iter().enumerate().map(at).collect();
    let line: Vec<String> = points.iter().map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
    let [x, y] = points.last().copied().unwrap_or_default();
    let title = format!("{} nights, {} to {}", values.len(), number(low * unit), number(high * unit));
    html! {
        svg width=(SIZE[0]) height=(SIZE[1]) role="img" {
            title { (title) }
            polyline points=(line.join(" ")) {}
            circle cx=(format!("{x:.1}")) cy=(format!("{y:.1}")) r="2" {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixture::{failed, results, scene};
    use super::super::{Night, compare};
    use super::*;

    #[test]
    fn the_page_shows_what_got_worse_first_and_fetches_nothing() {
        let before = results(vec![scene("a", 0.010)]);
        let now = results(vec![scene("a", 0.0102), failed("<b>", "it <broke>")]);
        let nights = vec![Night::of(&before, "1".into()), Night::of(&now, "2".into())];
        let history = History { nights, skipped: 0 };
        let rules = Rules::default();
        let page =
            html_page(&now, Some(&before), &compare(&now, Some(&before), &rules), &history, &rules, &[]);
        assert!(page.find("What got worse").unwrap() < page.find("All scenes").unwrap());
        assert!(page.contains("&lt;b&gt;") && !page.contains("<broke>"));
        assert!(page.contains("href=\"scenes/a/report.html\"") && page.contains("<td class=\"worse\">"));
        // One for each figure; the cost is the same.
        assert_eq!(page.matches("<polyline").count(), FIGURES.len());
        assert!(!page.contains("http") && !page.contains("<script"));
    }

    #[test]
    fn a_line_stays_within_its_picture() {
        for values in [vec![1.0, 2.0, 1.5], vec![1e-300, 1e300], vec![-5.0, -5.0, 5.0]] {
            let svg = trend(&values, 1.0).into_string();
            let points = svg.split("points=\"").nth(1).unwrap().split('"').next().unwrap();
            for y in points.split(' ').map(|p| p.split(',').nth(1).unwrap().parse::<f64>().unwrap()) {
                assert!((0.0..=22.0).contains(&y), "{svg}");
            }
        }
        assert!(
            trend(&[1.0], 1.0).into_string().is_empty() && trend(&[2.0, 2.0], 1.0).into_string().is_empty()
        );
    }
}
