//! A run as junit.xml, which services for continuous integration read: a case for each limit of each
//! toolpath.

use std::fmt::Write as _;

use crate::result::{RunReport, ToolpathReport};
use crate::verdict::{Claim, Verdict};

/// The whole run. What fails or is undecided is a failure, what could not be planned an error.
pub fn junit(report: &RunReport) -> String {
    let (mut cases, mut tests, mut failures, mut errors) = (String::new(), 0, 0, 0);
    for row in &report.toolpaths {
        match row {
            ToolpathReport::Measured(toolpath) => {
                for claim in &toolpath.claims {
                    tests += 1;
                    failures += usize::from(claim.verdict() != Verdict::Pass);
                    case(&mut cases, &toolpath.name, claim.what, &inside(claim));
                }
            }
            ToolpathReport::NotPlanned(missing) => {
                (tests, errors) = (tests + 1, errors + 1);
                let error = format!("<error message=\"{}\"/>", xml_escaped(&missing.reason));
                case(&mut cases, &missing.name, "plan", &error);
            }
        }
    }
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites>\n<testsuite name=\"millstream {}\" tests=\"{tests}\" \
         failures=\"{failures}\" errors=\"{errors}\">\n{cases}</testsuite>\n</testsuites>\n",
        xml_escaped(&report.title)
    )
}

fn case(out: &mut String, class: &str, name: &str, inside: &str) {
    let [class, name] = [class, name].map(xml_escaped);
    // Writing into a string cannot fail.
    let _ = writeln!(out, "<testcase classname=\"{class}\" name=\"{name}\">{inside}</testcase>");
}

fn inside(claim: &Claim) -> String {
    let text = xml_escaped(&claim.sentence());
    match claim.verdict() {
        Verdict::Pass => format!("<system-out>{text}</system-out>"),
        verdict => format!("<failure type=\"{}\" message=\"{text}\"/>", verdict.word()),
    }
}

/// A text within XML 1.0, which has no control characters but three.
pub fn xml_escaped(text: &str) -> String {
    let mut out = String::new();
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\n' | '\t' => out.push(c),
            '\u{fffe}' | '\u{ffff}' => out.push('\u{fffd}'),
            c if c.is_control() => out.push('\u{fffd}'),
            c => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture;

    #[test]
    fn limits_that_do_not_hold_are_failures() {
        let report = fixture::report();
        let text = junit(&report);
        let measured = report.toolpaths.iter().filter_map(ToolpathReport::measured);
        let (all, held) = measured.fold((0, 0), |(all, held), t| {
            (all + t.claims.len(), held + t.claims_that(Verdict::Pass).count())
        });
        assert_eq!(text.matches("<testcase").count(), all);
        assert_eq!(text.matches("<failure").count(), all - held);
        assert!(all > held && text.contains("toolpath.nc line 1240"), "{text}");
    }

    #[test]
    fn texts_stay_within_xml() {
        assert_eq!(xml_escaped("a<b & \"c\"\u{7}"), "a&lt;b &amp; &quot;c&quot;\u{fffd}");
    }
}
