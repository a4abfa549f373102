//! junit.xml, which services for continuous integration read.

use std::fmt::Write as _;

use super::compare::{Comparison, Finding};
use super::results::{Outcome, Results, SceneResult};
use super::words::first_line;
use report::xml_escaped as escaped;

/// A test case for each scene and for each toolpath. What got worse is a failure, a scene that newly failed
/// is an error, and one that failed in the baseline too is skipped.
pub fn junit(results: &Results, comparison: &Comparison) -> String {
    let mut cases = String::new();
    let mut counts = Counts::default();
    for scene in &results.scenes {
        scene_case(&mut cases, &mut counts, scene, comparison);
        for toolpath in scene.toolpaths() {
            let worse: Vec<&Finding> = comparison.worse_of(&scene.name, Some(&toolpath.name)).collect();
            counts.case(&mut cases, &scene.name, &toolpath.name, 0.0, &failures(&worse));
        }
    }
    for gone in gone(results, comparison) {
        let name = gone.toolpath.as_deref().unwrap_or("scene");
        counts.case(&mut cases, &gone.scene, name, 0.0, &failures(&[gone]));
    }
    let Counts { tests, failures, errors, skipped } = counts;
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites>\n<testsuite name=\"millstream nightly\" tests=\"{tests}\" \
         failures=\"{failures}\" errors=\"{errors}\" skipped=\"{skipped}\" timestamp=\"{}\">\n{cases}</testsuite>\n</testsuites>\n",
        escaped(&results.date)
    )
}

#[derive(Default)]
struct Counts {
    tests: usize,
    failures: usize,
    errors: usize,
    skipped: usize,
}

impl Counts {
    fn case(&mut self, out: &mut String, class: &str, name: &str, time: f64, inside: &str) {
        self.tests += 1;
        self.failures += usize::from(inside.starts_with("<failure"));
        self.errors += usize::from(inside.starts_with("<error"));
        self.skipped += usize::from(inside.starts_with("<skipped"));
        let [class, name] = [class, name].map(escaped);
        // Writing into a string cannot fail.
        let _ = writeln!(
            out,
            "<testcase classname=\"{class}\" name=\"{name}\" time=\"{time:.3}\">{inside}</testcase>"
        );
    }
}

fn scene_case(out: &mut String, counts: &mut Counts, scene: &SceneResult, comparison: &Comparison) {
    let inside = match &scene.outcome {
        Outcome::Failed { reason } if comparison.is_known_failure(&scene.name) => {
            format!("<skipped message=\"failed in the baseline too: {}\"/>", escaped(first_line(reason)))
        }
        Outcome::Failed { reason } => {
            format!("<error message=\"{}\">{}</error>", escaped(first_line(reason)), escaped(reason))
        }
        Outcome::Done { .. } => failures(&comparison.worse_of(&scene.name, None).collect::<Vec<_>>()),
    };
    counts.case(out, &scene.name, "scene", scene.cost.wall_s, &inside);
}

/// What got worse and has no row of its own: it is not there.
fn gone<'a>(results: &'a Results, comparison: &'a Comparison) -> impl Iterator<Item = &'a Finding> {
    comparison.worse.iter().filter(|finding| {
        let scene = results.scene(&finding.scene);
        let toolpath = |name: &String| scene.is_some_and(|s| s.toolpaths().iter().any(|t| t.name == *name));
        scene.is_none() || finding.toolpath.as_ref().is_some_and(|name| !toolpath(name))
    })
}

fn failures(worse: &[&Finding]) -> String {
    let texts: Vec<String> = worse.iter().map(|finding| escaped(&finding.text)).collect();
    if texts.is_empty() { String::new() } else { format!("<failure message=\"{}\"/>", texts.join(" ")) }
}

#[cfg(test)]
mod tests {
    use super::super::fixture::{failed, results, scene};
    use super::super::{Rules, compare};
    use super::*;

    #[test]
    fn each_kind_of_case_is_counted() {
        let before = results(vec![scene("a", 0.010), failed("known", "x"), scene("gone", 0.01)]);
        let now = results(vec![scene("a", 0.0102), failed("known", "x"), failed("b\u{1}", "<&\"\nmore")]);
        let text = junit(&now, &compare(&now, Some(&before), &Rules::default()));
        assert!(text.contains("tests=\"5\" failures=\"2\" errors=\"1\" skipped=\"1\""), "{text}");
        assert!(text.contains("&lt;&amp;&quot;") && !text.contains('\u{1}'), "{text}");
        assert_eq!(text.matches("<testcase").count(), text.matches("</testcase>").count());
    }
}
