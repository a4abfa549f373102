//! The result in words and one table, 100 columns wide, for terminals and logs.

use std::fmt::Write as _;

use super::canvas::shortened;
use super::result::{NotPlanned, RunReport, ToolpathReport, ToolpathResult, time_of};
use super::scale::plain;
use super::verdict::Verdict;

/// Letters of a toolpath's name in the table; longer ones are cut.
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

/// Share as per cent, `-` for none.
pub fn per_cent(share: Option<f64>) -> String {
    share.map_or("-".to_owned(), |share| plain(100.0 * share, 0.1))
}

fn row(out: &mut String, cells: [&str; 11]) -> std::fmt::Result {
    let [name, passes, length, time, max, p95, p50, over, uncut, gouge, verdict] = cells;
    let line = format!(
        "{name:<NAME_WIDTH$} {passes:>6} {length:>7} {time:>7} {max:>12} {p95:>5} {p50:>5} {over:>5} {uncut:>6} {gouge:>11}  {verdict}"
    );
    writeln!(out, "{}", line.trim_end())
}

fn toolpath_row(out: &mut String, t: &ToolpathResult) -> std::fmt::Result {
    let scallop = &t.scallop;
    let [depth, bound] = t.deepest_cut();
    row(
        out,
        [
            &shortened(&t.name, NAME_WIDTH),
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
fn missing_row(out: &mut String, t: &NotPlanned) -> std::fmt::Result {
    let name = shortened(&t.name, NAME_WIDTH);
    row(out, [&name, "-", "-", "-", "-", "-", "-", "-", "-", "-", t.verdict.word()])
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
    row(
        out,
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
    row(out, ["", "", "mm", "", "µm", "µm", "µm", "%", "mm²", "µm", ""])?;
    writeln!(out, "{}", "-".repeat(WIDTH))?;
    for toolpath in &report.toolpaths {
        match toolpath {
            ToolpathReport::Measured(t) => toolpath_row(out, t)?,
            ToolpathReport::NotPlanned(t) => missing_row(out, t)?,
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
            let hold = format!("{passing} of {all} toolpaths hold every tolerance.");
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
