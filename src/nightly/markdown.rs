//! report.md: what got worse, then a table.

use std::fmt::Write as _;

use keys::printable;

use super::compare::{Comparison, Finding};
use super::figures::FIGURES;
use super::results::{Outcome, Results, SceneResult};
use super::words::{change, first_line, number};

/// The report as Markdown. `baseline` is what changes are shown against.
pub fn markdown(results: &Results, baseline: Option<&Results>, comparison: &Comparison) -> String {
    let mut out = format!("# Nightly report\n\n{}\n\n", summary(results, comparison));
    list(&mut out, "What got worse", &comparison.worse);
    list(&mut out, "What got better", &comparison.better);
    list(&mut out, "Notes", &comparison.notes);
    table(&mut out, results, baseline, comparison);
    // Writing into a string cannot fail.
    let _ = writeln!(out, "\nmillstream {} · {}", results.millstream, results.date);
    out
}

/// One sentence on the whole nightly.
pub fn summary(results: &Results, comparison: &Comparison) -> String {
    let count = |n: usize, thing: &str| format!("{n} {thing}{}", if n == 1 { "" } else { "s" });
    let failed = results.scenes.iter().filter(|s| matches!(s.outcome, Outcome::Failed { .. })).count();
    let shard = results.shard.map(|shard| format!(" (shard {shard})")).unwrap_or_default();
    let against = match &comparison.baseline {
        Some(date) => format!("baseline of {date}"),
        None => "no baseline".into(),
    };
    let worse = match comparison.worse.len() {
        0 => "Nothing got worse".into(),
        n => format!("{} worse", count(n, "thing")),
    };
    format!("{worse}. {}{shard}, {failed} failed, {against}.", count(results.scenes.len(), "scene"))
}

fn list(out: &mut String, title: &str, findings: &[Finding]) {
    if findings.is_empty() {
        return;
    }
    let _ = writeln!(out, "## {title}\n");
    for finding in findings {
        let _ = writeln!(out, "- **{}**: {}", escaped(&finding.place()), escaped(&finding.text));
    }
    out.push('\n');
}

/// A text that Markdown shows as it is, in one line.
pub(super) fn escaped(text: &str) -> String {
    let special = |c: char| matches!(c, '\\' | '|' | '*' | '_' | '`' | '<' | '>' | '[' | ']' | '#');
    let mut out = String::new();
    for c in printable(text).chars() {
        if special(c) {
            out.push('\\');
        }
        out.push(c);
    }
    out
}

fn table(out: &mut String, results: &Results, baseline: Option<&Results>, comparison: &Comparison) {
    let shown = |scene: &&SceneResult| scene.case.is_plain() || comparison.concerns(&scene.name);
    out.push_str("## All scenes\n\n| scene | toolpath | verdict |");
    for figure in &FIGURES {
        let _ = write!(out, " {}, {} |", figure.name, figure.unit());
    }
    let _ = writeln!(out, " CPU, s |\n|---|---|---|{}---:|", "---:|".repeat(FIGURES.len()));
    for scene in results.scenes.iter().filter(shown) {
        let name = match &scene.page {
            Some(page) => format!("[{}](<{}>)", escaped(&scene.name), page.replace(['<', '>', '\n'], "_")),
            None => escaped(&scene.name),
        };
        let cpu = scene.cost.cpu_s.map(number).unwrap_or_default();
        if let Outcome::Failed { reason } = &scene.outcome {
            let empty = " |".repeat(FIGURES.len());
            let _ = writeln!(out, "| {name} | {} | failed |{empty} {cpu} |", escaped(first_line(reason)));
        }
        let before = baseline.and_then(|b| b.scene(&scene.name)).map_or(&[][..], |s| s.toolpaths());
        for t in scene.toolpaths() {
            let old = before.iter().find(|old| old.name == t.name);
            let _ = write!(out, "| {name} | {} | {} |", escaped(&t.name), t.verdict.word());
            for figure in &FIGURES {
                let by = t.figures.get(figure.key).zip(old.and_then(|old| old.figures.get(figure.key)));
                let by = by.and_then(|(new, old)| change(*old, *new)).map(|by| format!(" ({by})"));
                let _ = write!(out, " {}{} |", t.shown(figure), by.unwrap_or_default());
            }
            let _ = writeln!(out, " {cpu} |");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixture::{failed, results, scene};
    use super::super::{Rules, compare};
    use super::*;

    #[test]
    fn the_worst_comes_first_and_nothing_breaks_the_table() {
        let before = results(vec![scene("a", 0.010)]);
        let now = results(vec![scene("a", 0.0102), failed("b|\n<x>", "it | broke\nmore")]);
        let comparison = compare(&now, Some(&before), &Rules::default());
        let text = markdown(&now, Some(&before), &comparison);
        assert!(text.find("What got worse") < text.find("All scenes"), "{text}");
        assert!(text.contains("10.20 (+2.00 %)") && text.contains("it \\| broke"), "{text}");
        let rows: Vec<&str> = text.lines().filter(|line| line.starts_with("| ")).collect();
        let columns = |row: &str| row.replace("\\|", "").matches('|').count();
        assert_eq!(rows.len(), 3);
        assert!(rows.iter().all(|row| columns(row) == columns(rows[0])), "{rows:?}");
    }
}
