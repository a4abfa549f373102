//! This nightly against a baseline: what got worse, what got better, what is new.

use keys::printable;
use report::{Verdict, capital};

use super::checks::contradictions;
use super::figures::{FIGURES, Figure};
use super::results::{Cost, Outcome, Results, SceneResult, ToolpathResult};
use super::rules::{Missing, Rules};
use super::words::{change, first_line, number};

/// One thing that changed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Finding {
    /// The scene's name.
    pub scene: String,
    /// The toolpath's name; `None` where the whole scene is meant.
    pub toolpath: Option<String>,
    /// What changed, in a sentence.
    pub text: String,
}

impl Finding {
    /// The scene and, if one is meant, the toolpath.
    pub fn place(&self) -> String {
        let toolpath = self.toolpath.iter().map(|name| format!(", {name}"));
        printable(&(self.scene.clone() + &toolpath.collect::<String>()))
    }
}

/// What changed since the baseline.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Comparison {
    /// When the baseline ended; `None` without one.
    pub baseline: Option<String>,
    /// What got worse, by the rules: failures, verdicts and things missing first.
    pub worse: Vec<Finding>,
    /// What got better by as much.
    pub better: Vec<Finding>,
    /// What is neither: new scenes, known failures.
    pub notes: Vec<Finding>,
}

impl Comparison {
    /// What got worse of a toolpath, or with `None` of a scene as a whole.
    pub fn worse_of<'a>(
        &'a self,
        scene: &'a str,
        toolpath: Option<&'a str>,
    ) -> impl Iterator<Item = &'a Finding> {
        self.worse.iter().filter(move |f| f.scene == scene && f.toolpath.as_deref() == toolpath)
    }

    /// Whether anything is said about the scene.
    pub fn concerns(&self, scene: &str) -> bool {
        [&self.worse, &self.better, &self.notes].into_iter().flatten().any(|finding| finding.scene == scene)
    }

    /// Whether the scene failed in the baseline as well, and so is no news.
    pub fn is_known_failure(&self, scene: &str) -> bool {
        self.worse_of(scene, None).next().is_none()
    }
}

/// Compares a nightly with a baseline. Without one, only scenes that failed and figures that contradict each
/// other are worse. A shard is compared on its own scenes alone.
pub fn compare(now: &Results, baseline: Option<&Results>, rules: &Rules) -> Comparison {
    let mut found = Comparing { rules, all: Comparison::default(), figures: Vec::new() };
    found.all.baseline = baseline.map(|baseline| baseline.date.clone());
    let known = baseline.map(contradictions).unwrap_or_default();
    for wrong in contradictions(now) {
        let is_known = known.iter().any(|old| (&old.scene, &old.toolpath) == (&wrong.scene, &wrong.toolpath));
        let list = if is_known { &mut found.all.notes } else { &mut found.all.worse };
        list.push(wrong);
    }
    for scene in &now.scenes {
        let before = baseline.and_then(|baseline| baseline.scene(&scene.name));
        found.scene(scene, before, baseline.is_some());
    }
    let gone = baseline.filter(|_| now.shard.is_none()).map_or(&[][..], |baseline| &baseline.scenes);
    for scene in gone.iter().filter(|scene| now.scene(&scene.name).is_none()) {
        found.gone(
            &scene.name,
            None,
            "The scene is in the baseline, and this nightly has none of that name.",
        );
    }
    let Comparing { mut all, mut figures, .. } = found;
    // The greatest relative growth first; what grew from nothing before it.
    figures.sort_by(|a, b| b.0.total_cmp(&a.0));
    all.worse.extend(figures.into_iter().map(|(_, finding)| finding));
    all
}

struct Comparing<'a> {
    rules: &'a Rules,
    all: Comparison,
    /// Figures that got worse, with their relative growth.
    figures: Vec<(f64, Finding)>,
}

pub(crate) fn finding(scene: &str, toolpath: Option<&str>, text: impl Into<String>) -> Finding {
    Finding { scene: scene.to_owned(), toolpath: toolpath.map(str::to_owned), text: text.into() }
}

impl Comparing<'_> {
    fn scene(&mut self, now: &SceneResult, before: Option<&SceneResult>, has_baseline: bool) {
        let name = now.name.as_str();
        let failed_before = before.is_some_and(|before| matches!(before.outcome, Outcome::Failed { .. }));
        match (&now.outcome, before) {
            (Outcome::Failed { reason }, _) if failed_before => {
                let text = format!("Failed, as in the baseline: {}", first_line(reason));
                self.all.notes.push(finding(name, None, text));
            }
            (Outcome::Failed { reason }, _) => {
                self.all.worse.push(finding(name, None, format!("Failed: {}", first_line(reason))));
            }
            (Outcome::Done { .. }, Some(_)) if failed_before => {
                self.all.better.push(finding(name, None, "It runs; in the baseline it failed."));
            }
            (Outcome::Done { .. }, Some(before)) => self.toolpaths(now, before),
            (Outcome::Done { .. }, None) if has_baseline => {
                self.all.notes.push(finding(name, None, "New: the baseline does not have it."));
            }
            (Outcome::Done { .. }, None) => {}
        }
    }

    fn toolpaths(&mut self, now: &SceneResult, before: &SceneResult) {
        for toolpath in now.toolpaths() {
            match before.toolpaths().iter().find(|old| old.name == toolpath.name) {
                Some(old) => self.toolpath(&now.name, toolpath, old),
                None => {
                    let text = "New: the baseline does not have it.";
                    self.all.notes.push(finding(&now.name, Some(&toolpath.name), text));
                }
            }
        }
        for old in before.toolpaths() {
            if !now.toolpaths().iter().any(|toolpath| toolpath.name == old.name) {
                let text = "The toolpath is in the baseline, and the scene no longer has it.";
                self.gone(&now.name, Some(&old.name), text);
            }
        }
        self.cost(&now.name, &now.cost, &before.cost);
    }

    fn gone(&mut self, scene: &str, toolpath: Option<&str>, text: &str) {
        let list = match self.rules.missing {
            Missing::Worse => &mut self.all.worse,
            Missing::Allow => &mut self.all.notes,
        };
        list.push(finding(scene, toolpath, text));
    }

    fn toolpath(&mut self, scene: &str, now: &ToolpathResult, before: &ToolpathResult) {
        let text = format!("Verdict {}; it was {}.", now.verdict.word(), before.verdict.word());
        let verdict = finding(scene, Some(&now.name), text);
        match now.verdict.cmp(&before.verdict) {
            std::cmp::Ordering::Greater => self.all.worse.push(verdict),
            std::cmp::Ordering::Less => self.all.better.push(verdict),
            std::cmp::Ordering::Equal => {}
        }
        // Without a path there are no figures, and the verdict says so.
        if now.verdict != Verdict::NotPlanned {
            FIGURES.iter().for_each(|figure| self.figure(scene, figure, now, before));
        }
    }

    fn figure(&mut self, scene: &str, figure: &Figure, now: &ToolpathResult, before: &ToolpathResult) {
        let Some(&old) = before.figures.get(figure.key) else { return };
        let Some(&new) = now.figures.get(figure.key) else {
            let text = format!("No {} was measured; it was {}.", figure.name, shown(figure, old));
            self.all.worse.push(finding(scene, Some(&now.name), text));
            return;
        };
        let limit = self.rules.limit(figure.group);
        let by = change(old, new).map(|change| format!(" ({change})")).unwrap_or_default();
        let text = format!("{}: {} → {}{by}.", capital(figure.name), shown(figure, old), shown(figure, new));
        let changed = finding(scene, Some(&now.name), text);
        if limit.is_exceeded(old, new) {
            self.figures.push(((new - old) / old.abs(), changed));
        } else if limit.is_exceeded(new, old) {
            self.all.better.push(changed);
        }
    }

    fn cost(&mut self, scene: &str, now: &Cost, before: &Cost) {
        // CPU time and time from start to end are not to be mixed.
        let (Some(new), Some(old)) = (now.ratio(), before.ratio()) else { return };
        if now.cpu_s.is_some() != before.cpu_s.is_some() {
            return;
        }
        // In seconds of this nightly's machine.
        let [old_s, new_s] = [old, new].map(|ratio| ratio * now.reference_s);
        let by = change(old, new).unwrap_or_default();
        let text = format!("Cost: {} → {} reference units ({by}).", number(old), number(new));
        if self.rules.cost.is_exceeded(old_s, new_s) {
            self.figures.push(((new - old) / old, finding(scene, None, text)));
        } else if self.rules.cost.is_exceeded(new_s, old_s) {
            self.all.better.push(finding(scene, None, text));
        }
    }
}

fn shown(figure: &Figure, value: f64) -> String {
    format!("{} {}", number(figure.shown(value)), figure.unit())
}

#[cfg(test)]
mod tests {
    use super::super::fixture::{failed, results, scene};
    use super::*;

    fn worse(now: Vec<SceneResult>, before: Vec<SceneResult>) -> Vec<String> {
        let all = compare(&results(now), Some(&results(before)), &Rules::default());
        all.worse.into_iter().map(|finding| finding.text).collect()
    }

    fn with(key: &str, value: f64) -> SceneResult {
        let mut changed = scene("a", 0.010);
        if let Outcome::Done { toolpaths, .. } = &mut changed.outcome {
            toolpaths[0].figures.insert(key.into(), value);
        }
        changed
    }

    fn judged(verdict: Verdict) -> SceneResult {
        let mut changed = scene("a", 0.010);
        if let Outcome::Done { toolpaths, .. } = &mut changed.outcome {
            toolpaths[0].verdict = verdict;
        }
        changed
    }

    #[test]
    fn two_per_cent_in_any_figure_are_caught() {
        let before = || vec![scene("a", 0.010)];
        assert_eq!(worse(before(), before()), [""; 0]);
        for figure in &FIGURES {
            let found = worse(vec![with(figure.key, 0.0102)], before());
            assert_eq!(found.len(), 1, "{}", figure.key);
            assert!(found[0].contains("+2.00 %"), "{found:?}");
            assert!(worse(vec![with(figure.key, 0.0098)], before()).is_empty());
        }
    }

    #[test]
    fn noise_in_time_is_not_reported_and_twice_the_cost_is() {
        let costing = |cpu_s: f64, reference_s: f64| {
            let mut changed = scene("a", 0.01);
            changed.cost = Cost { cpu_s: Some(cpu_s), reference_s, ..changed.cost };
            vec![changed]
        };
        for (cpu, reference) in [(24.0, 0.010), (16.0, 0.010), (20.0, 0.0083), (24.0, 0.012), (40.0, 0.02)] {
            assert!(worse(costing(cpu, reference), costing(20.0, 0.01)).is_empty(), "{cpu} {reference}");
        }
        assert_eq!(worse(costing(40.0, 0.01), costing(20.0, 0.01)).len(), 1);
        // Shorter than the clock can tell.
        assert!(worse(costing(0.9, 0.01), costing(0.1, 0.01)).is_empty());
        assert!(worse(costing(1.0, 0.0), costing(0.1, 0.0)).is_empty());
    }

    #[test]
    fn a_worse_verdict_and_a_lost_figure_are_worse() {
        let before = || vec![judged(Verdict::Undecided)];
        assert_eq!(worse(vec![judged(Verdict::Fail)], before()), ["Verdict fail; it was undecided."]);
        assert!(worse(vec![judged(Verdict::Pass)], before()).is_empty());
        let mut lost = scene("a", 0.01);
        if let Outcome::Done { toolpaths, .. } = &mut lost.outcome {
            toolpaths[0].figures.remove("gouge_mm");
        }
        assert_eq!(worse(vec![lost], vec![scene("a", 0.01)]).len(), 1);
        assert!(worse(vec![judged(Verdict::Fail)], vec![judged(Verdict::Fail)]).is_empty());
    }

    #[test]
    fn a_failure_is_worse_unless_the_baseline_failed_too() {
        let fails = || vec![failed("a", "no file\nlong")];
        assert_eq!(worse(fails(), vec![scene("a", 0.01)]), ["Failed: no file"]);
        assert_eq!(worse(fails(), vec![]).len(), 1);
        assert!(worse(fails(), fails()).is_empty());
        assert!(worse(vec![scene("a", 0.01)], fails()).is_empty());
        let alone = compare(&results(fails()), None, &Rules::default());
        assert_eq!(alone.worse.len(), 1);
    }

    #[test]
    fn what_is_gone_is_worse_unless_allowed_or_another_shards() {
        let (now, before) = (results(vec![]), results(vec![scene("a", 0.01)]));
        assert_eq!(compare(&now, Some(&before), &Rules::default()).worse.len(), 1);
        let allow = Rules { missing: Missing::Allow, ..Rules::default() };
        let noted = compare(&now, Some(&before), &allow);
        assert_eq!((noted.worse.len(), noted.notes.len()), (0, 1));
        let shard = Results { shard: "1/2".parse().ok(), ..now };
        assert!(compare(&shard, Some(&before), &Rules::default()).worse.is_empty());
    }

    #[test]
    fn what_grew_most_comes_first() {
        let mut now = with("gouge_mm", 0.0102);
        if let Outcome::Done { toolpaths, .. } = &mut now.outcome {
            toolpaths[0].figures.insert("machining_time_s".into(), 0.02);
        }
        let found = worse(vec![now], vec![scene("a", 0.01)]);
        assert!(found[0].starts_with("Machining time") && found[1].starts_with("Gouge"), "{found:?}");
    }
}
