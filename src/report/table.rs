//! The result in words and one table, 100 columns wide, for terminals and logs.

use std::collections::HashSet;
use std::fmt::Write as _;

use super::result::{NotPlanned, RunReport, ToolpathReport, ToolpathResult, time_of};
use super::scale::plain;
use super::verdict::Verdict;

/// Letters of a toolpath's name in the table; of longer ones the middle is left out.
const NAME_WIDTH: usize = 16;

/// A time as people read it: `1:02:03` or `2:03` or `12.3 s`.
pub fn duration(seconds: f64) -> String {
    if seconds < 60.0 {
        return format!("{seconds:.1} s");
    }
    let whole = seconds.round() as u64;
    let (hours, minutes, seconds) = (whole / 3600, whole / 60 % 60, whole % 60);
    if hours > 0 { format!("{hours}:{minutes:02}:{seconds:02}") } else { format!("{minutes}:{seconds:02}") }
}

/// A length in mm as micrometres with the digits that matter, `-` for none.
pub fn micrometres(length: Option<f64>) -> String {
    match length.map(|mm| mm * 1000.0) {
        None => "-".to_owned(),
        Some(um) if um.abs() >= 100.0 => format!("{um:.0}"),
        Some(um) if um.abs() >= 10.0 => format!("{um:.1}"),
        Some(um) => format!("{um:.2}"),
    }
}

/// A bound of an error in micrometres, rounded up: a bound that is not zero never reads as zero.
pub fn bound(length_mm: f64) -> String {
    let um = length_mm * 1000.0;
    let digits = if um >= 100.0 {
        1.0
    } else if um >= 10.0 {
        10.0
    } else {
        100.0
    };
    // The hair keeps 0.25 from becoming 0.26 by rounding noise.
    micrometres(Some((um * digits - 1e-9).ceil().max(0.0) / digits / 1000.0 + 0.0))
}

/// `value ± bound` in micrometres.
pub fn with_bound(value: Option<f64>, error_bound: Option<f64>) -> String {
    match (value, error_bound) {
        (Some(_), Some(error)) => format!("{} ± {}", micrometres(value), bound(error)),
        _ => micrometres(value),
    }
}

/// The same of lengths in mm beside a limit: with the digits that show them to lie above it, where they do for
/// certain.
pub fn beside_limit(value: f64, error_bound: f64, limit: f64) -> String {
    let um = [value, error_bound, limit].map(|length| length * 1000.0);
    let shown = |[value, bound]: [&str; 2]| {
        let number = |text: &str| text.parse::<f64>().unwrap_or(f64::NAN);
        number(value) - number(bound) > um[2]
    };
    let usual = [micrometres(Some(value)), bound(error_bound)];
    let finer = (1..MOST_DIGITS).map(|digits| {
        let scale = 10f64.powi(digits as i32);
        let up = (um[1] * scale - 1e-9).ceil().max(0.0) / scale;
        [format!("{:.digits$}", um[0]), format!("{up:.digits$}")]
    });
    let above = um[0] - um[1] > um[2];
    let [value, bound] = std::iter::once(usual.clone())
        .chain(finer.filter(|_| above))
        .find(|[value, bound]| !above || shown([value, bound]))
        .unwrap_or(usual);
    format!("{value} ± {bound}")
}

/// Digits behind the point of a micrometre, beyond which lengths are rounding.
const MOST_DIGITS: usize = 7;

/// A text with a capital letter at its beginning.
pub fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// Share as per cent, `-` for none.
pub fn per_cent(share: Option<f64>) -> String {
    share.map_or("-".to_owned(), |share| plain(100.0 * share, 0.1))
}

/// `text` with no more letters than that; an ellipsis stands for its middle.
fn without_middle(text: &str, letters: usize) -> String {
    let all = text.chars().count();
    if all <= letters {
        return text.to_owned();
    }
    let behind = letters / 2;
    let before = text.chars().take(letters - 1 - behind);
    before.chain(['…']).chain(text.chars().skip(all - behind)).collect()
}

/// Letters that names need so that no two read alike: [`NAME_WIDTH`], or as many as the longest has.
fn name_width(report: &RunReport) -> usize {
    let names: Vec<&str> = report.toolpaths.iter().map(ToolpathReport::name).collect();
    let shown: HashSet<String> = names.iter().map(|name| without_middle(name, NAME_WIDTH)).collect();
    if shown.len() == names.iter().collect::<HashSet<_>>().len() {
        return NAME_WIDTH;
    }
    names.iter().map(|name| name.chars().count()).fold(NAME_WIDTH, usize::max)
}

fn row(out: &mut String, width: usize, cells: [&str; 11]) -> std::fmt::Result {
    let [name, passes, length, time, max, p95, p50, over, uncut, gouge, verdict] = cells;
    let name = without_middle(name, width);
    let line = format!(
        "{name:<width$} {passes:>6} {length:>7} {time:>7} {max:>12} {p95:>5} {p50:>5} {over:>5} {uncut:>6} {gouge:>11}  {verdict}"
    );
    writeln!(out, "{}", line.trim_end())
}

fn toolpath_row(out: &mut String, width: usize, t: &ToolpathResult) -> std::fmt::Result {
    let scallop = &t.scallop;
    let [depth, bound] = t.deepest_cut();
    row(
        out,
        width,
        [
            &t.name,
            &t.path.passes.to_string(),
            &format!("{:.0}", t.path.cutting_length_mm),
            &duration(t.path.machining_time_s),
            &with_bound(scallop.max_mm, scallop.error_bound_mm),
            &micrometres(scallop.p95_mm),
            &micrometres(scallop.p50_mm),
            &per_cent(scallop.over_target_fraction),
            &format!("{:.2}", t.uncut.area_mm2),
            &with_bound(Some(depth), Some(bound)),
            t.verdict.word(),
        ],
    )
}

/// What was not planned has a name and a verdict.
fn missing_row(out: &mut String, width: usize, t: &NotPlanned) -> std::fmt::Result {
    row(out, width, [&t.name, "-", "-", "-", "-", "-", "-", "-", "-", "-", t.verdict.word()])
}

/// Widest line, letters.
const WIDTH: usize = 100;

/// A sentence of a list, indented and broken between words.
fn sentence(out: &mut String, text: &str) -> std::fmt::Result {
    let mut line = String::from(" ");
    for word in text.split_whitespace() {
        if line.chars().count() + 1 + word.chars().count() > WIDTH {
            writeln!(out, "{line}")?;
            line = String::from("   ");
        }
        line.push(' ');
        line.push_str(word);
    }
    writeln!(out, "{line}")
}

/// One row a toolpath, then what is wrong and what planners had to say, then which one is best.
pub fn result_table(report: &RunReport) -> String {
    let mut out = String::new();
    write_table(&mut out, report).expect("writing into a string cannot fail");
    out
}

fn write_table(out: &mut String, report: &RunReport) -> std::fmt::Result {
    writeln!(out, "{}", report.title)?;
    let width = name_width(report);
    row(
        out,
        width,
        [
            "toolpath",
            "passes",
            "cutting",
            "time",
            "scallop max",
            "p95",
            "p50",
            "over",
            "uncut",
            "gouge",
            "verdict",
        ],
    )?;
    row(out, width, ["", "", "mm", "", "µm", "µm", "µm", "%", "mm²", "µm", ""])?;
    writeln!(out, "{}", "-".repeat(WIDTH - NAME_WIDTH + width))?;
    for toolpath in &report.toolpaths {
        match toolpath {
            ToolpathReport::Measured(t) => toolpath_row(out, width, t)?,
            ToolpathReport::NotPlanned(t) => missing_row(out, width, t)?,
        }
    }
    write_sentences(out, report)?;
    for toolpath in &report.toolpaths {
        if let ToolpathReport::NotPlanned(t) = toolpath {
            writeln!(out, "\n{} could not be planned:", t.name)?;
            sentence(out, &t.reason)?;
        }
    }
    for (verdict, heading) in [(Verdict::Fail, "violates"), (Verdict::Undecided, "leaves undecided")] {
        for t in report.measured().filter(|t| t.claims_that(verdict).next().is_some()) {
            writeln!(out, "\n{} {heading}:", t.name)?;
            t.claims_that(verdict).try_for_each(|claim| sentence(out, &claim.sentence()))?;
        }
    }
    if !report.notes.is_empty() {
        writeln!(out, "\nNotes:")?;
        report.notes.iter().try_for_each(|note| sentence(out, note))?;
    }
    for t in report.measured() {
        let which = if t.scallop.max_mm.is_none() { "no scallop height" } else { "no other scallop heights" };
        let reason = t.scallop.reason.iter().map(|reason| format!("{which}: {reason}"));
        let notes: Vec<String> = t.notes.iter().cloned().chain(reason).collect();
        if !notes.is_empty() {
            writeln!(out, "\nNotes on {}:", t.name)?;
            notes.iter().try_for_each(|note| sentence(out, note))?;
        }
    }
    writeln!(out, "\n{}", conclusion(report))
}

/// The sentences of all figures, under their headings.
fn write_sentences(out: &mut String, report: &RunReport) -> std::fmt::Result {
    let sentences = || report.measured().flat_map(|t| &t.figures).filter_map(|f| f.sentence.as_ref());
    let mut headings: Vec<&str> = Vec::new();
    for (heading, _) in sentences() {
        if !headings.contains(heading) {
            headings.push(heading);
        }
    }
    headings.into_iter().try_for_each(|heading| {
        writeln!(out, "\n{heading}")?;
        sentences().filter(|(other, _)| *other == heading).try_for_each(|(_, text)| sentence(out, text))
    })
}

/// The outcome in a sentence.
pub fn conclusion(report: &RunReport) -> String {
    let count = |verdict| report.toolpaths.iter().filter(|t| t.verdict() == verdict).count();
    let (passing, undecided, all) = (count(Verdict::Pass), count(Verdict::Undecided), report.toolpaths.len());
    let best = report.measured().find(|t| Some(&t.name) == report.best.as_ref());
    match (best, all) {
        (None, 1) if undecided == 1 => {
            "Undecided: the error bound of a figure reaches across its limit.".to_owned()
        }
        (None, 1) => "The toolpath violates a tolerance.".to_owned(),
        (None, _) if undecided > 0 => {
            format!("No toolpath is proven to hold every tolerance; {undecided} of {all} are undecided.")
        }
        (None, _) => "No toolpath holds every tolerance.".to_owned(),
        (Some(best), 1) => match best.scope() {
            "" => "Every tolerance holds.".to_owned(),
            scope => format!("Every tolerance holds {scope}."),
        },
        (Some(best), all) => {
            let hold = format!("{passing} of {all} toolpaths hold every tolerance{}.", least_scope(report));
            let is_best = |t: &ToolpathReport| t.measured().is_some_and(|t| t.name == best.name);
            match report.chains().find(|chain| chain.last().is_some_and(is_best)) {
                Some(chain) if chain.len() < all => {
                    let names = chain.iter().filter_map(ToolpathReport::measured).map(|t| t.name.as_str());
                    let names = names.collect::<Vec<_>>().join(" and ");
                    format!("{hold} Fastest: {names}, {}.", duration(time_of(chain)))
                }
                _ => hold,
            }
        }
    }
}

/// ` on 18 % of the surface or more`, where the verdict on one that passes does not cover all.
fn least_scope(report: &RunReport) -> String {
    let passing: Vec<_> = report.measured().filter(|t| t.verdict == Verdict::Pass).collect();
    let Some(least) = passing.iter().min_by(|a, b| a.share().total_cmp(&b.share())) else {
        return String::new();
    };
    let or_more = if passing.iter().any(|t| t.share() > least.share()) { " or more" } else { "" };
    match least.scope().split(';').next().unwrap_or_default() {
        "" => String::new(),
        scope => format!(" {scope}{or_more}"),
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixture;
    use super::super::result::WALL;
    use super::super::verdict::{Claim, Gravity};
    use super::*;

    #[test]
    fn numbers_are_written_as_people_read_them() {
        assert_eq!(duration(12.34), "12.3 s");
        assert_eq!(duration(3723.4), "1:02:03");
        assert_eq!(duration(59.96), "60.0 s");
        assert_eq!(micrometres(Some(0.0098765)), "9.88");
        assert_eq!(per_cent(Some(-1e-17)), "0.0");
        assert_eq!(with_bound(Some(0.25), None), "250");
        assert_eq!(with_bound(Some(0.0194), Some(1e-9)), "19.4 ± 0.01");
        assert_eq!(with_bound(Some(0.0194), Some(0.01234)), "19.4 ± 12.4");
        assert_eq!(with_bound(Some(0.0), Some(0.0)), "0.00 ± 0.00");
    }

    /// Where rounding would hide that a limit is exceeded, more digits are shown.
    #[test]
    fn what_exceeds_a_limit_is_seen_to() {
        assert_eq!(beside_limit(0.010_003_1, 0.000_001, 0.01), "10.003 ± 0.001");
        assert_eq!(beside_limit(0.010_000_31, 0.000_000_1, 0.01), "10.0003 ± 0.0001");
        assert_eq!(beside_limit(0.010_03, 0.000_01, 0.01), "10.03 ± 0.01");
        assert_eq!(beside_limit(0.0194, 0.000_01, 0.01), "19.4 ± 0.01");
        // Nothing is shown that is not known.
        assert_eq!(beside_limit(0.010_03, 0.000_04, 0.01), "10.0 ± 0.04");
        assert_eq!(beside_limit(0.0099, 0.000_01, 0.01), "9.90 ± 0.01");
        assert_eq!(beside_limit(0.01, f64::INFINITY, 0.01), with_bound(Some(0.01), Some(f64::INFINITY)));
    }

    /// Names of a comparison differ in what stands last.
    #[test]
    fn rows_can_be_told_apart_by_their_names() {
        assert_eq!(without_middle("iso-scallop, 0.25 min", 16), "iso-sca…0.25 min");
        assert_eq!(without_middle("sixteen letters.", 16), "sixteen letters.");
        let names = |[a, b]: [&str; 2]| {
            let mut report = fixture::report();
            for (row, name) in report.toolpaths.iter_mut().zip([a, b]) {
                if let super::super::result::ToolpathReport::Measured(result) = row {
                    name.clone_into(&mut result.name);
                }
            }
            result_table(&report)
        };
        let table = names(["iso-scallop, 0.25 min", "iso-scallop, 0.3 min"]);
        assert!(table.contains("\niso-sca…0.25 min ") && table.contains("\niso-sca… 0.3 min "), "{table}");
        // Where the middle alone differs, names are shown in full.
        let table = names(["finish with step A on the left", "finish with step B on the left"]);
        assert!(table.contains("\nfinish with step A on the left "), "{table}");
    }

    /// Walls of pockets count as the surface does, with the bound of what their chords are off.
    #[test]
    fn cuts_beyond_walls_count_in_the_table() {
        let mut report = fixture::report();
        let Some(super::super::result::ToolpathReport::Measured(first)) = report.toolpaths.first_mut() else {
            panic!("it was measured")
        };
        let [depth, bound] = [first.gouge.max_depth_mm, first.gouge.error_bound_mm];
        assert_eq!(first.deepest_cut(), [depth, bound]);
        let claim = |measured, bound| Claim::length(WALL, Gravity::Scrap, 0.5, measured, bound);
        first.claims.push(claim(0.25, 0.125));
        assert_eq!(first.deepest_cut(), [0.25, 0.125]);
        first.claims.push(claim(0.0, 0.5));
        assert_eq!(first.deepest_cut(), [0.25, 0.25]);
        assert!(result_table(&report).contains("250 ± 250"));
    }

    #[test]
    fn the_table_fits_into_a_hundred_columns() {
        let table = result_table(&fixture::report());
        insta::assert_snapshot!(table);
        assert!(table.lines().all(|line| line.chars().count() <= WIDTH), "{table}");
    }
}
