//! What counts as worse: the rule file and its defaults.
//!
//! ```toml
//! missing = "worse"     # a scene or toolpath of the baseline that is gone: "worse" or "allow"
//!
//! [accuracy]            # highest material, scallop, gouge, uncut
//! absolute_um = 0.01    # worse when it grows by more than this …
//! relative = 0.005      # … and by more than this share of the baseline
//!
//! [length]
//! relative = 0.005
//!
//! [time]                # machining time
//! relative = 0.005
//!
//! [cost]                # CPU time of the run over that of the reference work
//! relative = 0.5
//! absolute_s = 1.0      # growth below this many CPU seconds is noise
//! ```
//!
//! Checks need no baseline. They may follow, as often as needed:
//!
//! ```toml
//! [[check]]               # run a scene again …
//! scene = "plate"
//! engine = "voxel"        # … with this engine …
//! cells = [0.4, 0.2, 0.1] # … and with each of these cells, mm; without them, with the scene's own
//!
//! [[exact]]               # a scene whose highest scallop is that of a ball on a circular section
//! scene = "plate"
//! radius = 3.0            # of the ball, mm
//! step = 0.5              # arc between passes, mm
//! concave = 50.0          # radius of the section, mm; or convex; without either it is flat
//! within_um = 0.01        # how far the steps of the program, which are rounded, may take it from there; default 0
//! ```
//!
//! A verdict that is worse, and a scene that fails where the baseline's did not, are always worse.

use keys::{SceneError, SceneText, Section};

use super::figures::Group;
use super::results::{Case, ClosedForm};

/// A growth that is not worse yet. Both limits must be exceeded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limit {
    /// In the unit of the figure (mm, s).
    pub absolute: f64,
    /// As a share of the baseline's value.
    pub relative: f64,
}

impl Limit {
    /// Whether `now` is worse than `before`.
    pub fn is_exceeded(&self, before: f64, now: f64) -> bool {
        now - before > self.absolute && now - before > self.relative * before.abs()
    }
}

/// What a scene or a toolpath means that the baseline has and this nightly has not.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Missing {
    /// It is worse.
    Worse,
    /// It is noted.
    Allow,
}

/// A scene whose highest scallop has a closed form.
#[derive(Debug, Clone, PartialEq)]
pub struct Exact {
    /// The scene's name.
    pub scene: String,
    /// The height, mm, of the highest scallop of all its toolpaths.
    pub scallop: ClosedForm,
}

/// What counts as worse.
#[derive(Debug, Clone, PartialEq)]
pub struct Rules {
    /// Runs of scenes with other engines and cells.
    pub checks: Vec<Case>,
    /// Closed forms.
    pub exact: Vec<Exact>,
    /// What is gone.
    pub missing: Missing,
    /// For [`Group::Accuracy`].
    pub accuracy: Limit,
    /// For [`Group::Length`].
    pub length: Limit,
    /// For [`Group::Time`].
    pub time: Limit,
    /// For the cost of a run; `absolute` in CPU seconds of this nightly's machine.
    pub cost: Limit,
}

impl Default for Rules {
    /// Figures are the same bits on every run, so their limits are small: they hide only what other compilers
    /// and processors round differently. Times vary by a fifth and more on shared machines.
    fn default() -> Self {
        Self {
            checks: Vec::new(),
            exact: Vec::new(),
            missing: Missing::Worse,
            accuracy: Limit { absolute: 1e-5, relative: 0.005 },
            length: Limit { absolute: 1e-6, relative: 0.005 },
            time: Limit { absolute: 1e-6, relative: 0.005 },
            cost: Limit { absolute: 1.0, relative: 0.5 },
        }
    }
}

impl Rules {
    /// Reads a rule file; what it does not name keeps its default. `name` is how messages call it, `engines`
    /// are the words of all engines.
    ///
    /// # Errors
    /// [`SceneError`] with the place and the cure.
    pub fn parse(name: &str, text: &str, engines: &[&'static str]) -> Result<Self, SceneError> {
        let source = SceneText::new(name, text);
        let table = source.table()?;
        let root = Section::whole(&source, table.get_ref(), "the rules");
        let keys = ["missing", "accuracy", "length", "time", "cost", "check", "exact"];
        root.only(&keys, &[], "the rules")?;
        let standard = Self::default();
        let checks =
            root.sections("check")?.iter().map(|s| check(s, engines)).collect::<Result<Vec<_>, _>>()?;
        Ok(Self {
            checks: checks.concat(),
            exact: root.sections("exact")?.iter().map(exact).collect::<Result<_, _>>()?,
            missing: root.choice("missing", &[("worse", Missing::Worse), ("allow", Missing::Allow)])?,
            accuracy: limit(&root, "accuracy", Some(("absolute_um", 1e-3)), standard.accuracy)?,
            length: limit(&root, "length", None, standard.length)?,
            time: limit(&root, "time", None, standard.time)?,
            cost: limit(&root, "cost", Some(("absolute_s", 1.0)), standard.cost)?,
        })
    }

    /// The limit of a kind of figure.
    pub fn limit(&self, group: Group) -> Limit {
        match group {
            Group::Accuracy => self.accuracy,
            Group::Length => self.length,
            Group::Time => self.time,
        }
    }
}

/// The limit of a section. `absolute` is the key of the absolute limit and its unit in that of the figure.
fn limit(
    root: &Section<'_>,
    title: &str,
    absolute: Option<(&str, f64)>,
    standard: Limit,
) -> Result<Limit, SceneError> {
    /// Of every limit; beyond it, nothing is ever worse.
    const RANGE: std::ops::RangeInclusive<f64> = 0.0..=1e6;
    let section = root.section(title)?;
    let allowed: Vec<&str> = ["relative"].into_iter().chain(absolute.map(|(key, _)| key)).collect();
    section.only(&allowed, &["absolute_um", "absolute_s"], &format!("[{title}]"))?;
    let wanted = match absolute {
        Some((key, unit)) => section.number(key, RANGE, "")?.map(|found| found.value * unit),
        None => None,
    };
    Ok(Limit {
        absolute: wanted.unwrap_or(standard.absolute),
        relative: section.number_or("relative", RANGE, "", standard.relative)?,
    })
}

/// The runs that a `[[check]]` asks for.
fn check(section: &Section<'_>, engines: &[&'static str]) -> Result<Vec<Case>, SceneError> {
    section.only(&["scene", "engine", "cells"], &[], "a check")?;
    let scene = section.required_text("scene", "plate")?.value;
    let engine = section.word("engine", engines)?.map(|engine| engine.value.to_owned());
    let case = |cell_mm| Case { scene: scene.to_owned(), engine: engine.clone(), cell_mm };
    let cells = section.lengths("cells")?;
    match (cells.is_empty(), &engine) {
        (false, _) => Ok(cells.into_iter().map(|cell| case(Some(cell))).collect()),
        (true, Some(_)) => Ok(vec![case(None)]),
        (true, None) => {
            let cure = "add `engine = \"reference\"` or `cells = [0.2, 0.1]`";
            Err(section.error(section.header(), "the check has neither engine nor cells", cure))
        }
    }
}

fn exact(section: &Section<'_>) -> Result<Exact, SceneError> {
    section.only(&["scene", "radius", "step", "concave", "convex", "within_um"], &[], "a closed form")?;
    let scene = section.required_text("scene", "plate")?.value.to_owned();
    let radius = section.required_length("radius", 3.0)?.value;
    let step = section.required_length("step", 0.5)?;
    let curvature = match (section.length("concave")?, section.length("convex")?) {
        (None, None) => 0.0,
        (Some(concave), None) => 1.0 / concave.value,
        (None, Some(convex)) => -1.0 / convex.value,
        (Some(_), Some(convex)) => {
            return Err(section.error(&convex.span, "`concave` is there too", "leave one of them out"));
        }
    };
    let ball = scallop::BallSection::new(radius, curvature).and_then(|ball| ball.height(step.value));
    let within = 1e-3 * section.number_or("within_um", 0.0..=1e3, " µm", 0.0)?;
    let value =
        ball.map_err(|e| section.error(&step.span, format!("no scallop follows: {e}"), "mend the numbers"))?;
    Ok(Exact { scene, scallop: ClosedForm { value, within } })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Rules, SceneError> {
        Rules::parse("rules.toml", text, &["zmap", "voxel"])
    }

    /// The head of this module.
    #[test]
    fn the_documented_file_holds_the_defaults() {
        let head: String = include_str!("rules.rs")
            .lines()
            .skip_while(|line| !line.contains("```toml"))
            .skip(1)
            .take_while(|line| !line.contains("```"))
            .map(|line| line.trim_start_matches("//!").to_owned() + "\n")
            .collect();
        assert!(head.contains("[cost]"));
        assert_eq!(parse(&head).unwrap(), Rules::default());
        assert_eq!(parse("").unwrap(), Rules::default());
    }

    /// The README's copy.
    #[test]
    fn the_readme_has_the_defaults() {
        let readme = include_str!("../../README.md");
        let start = readme.find("missing = \"worse\"").unwrap();
        let rules = readme[start..].split("```").next().unwrap();
        assert!(rules.contains("[cost]"));
        assert_eq!(parse(rules).unwrap(), Rules::default());
    }

    #[test]
    fn what_is_named_replaces_its_default() {
        let rules = parse("missing = \"allow\"\n[accuracy]\nabsolute_um = 2\n[time]\nrelative = 1").unwrap();
        assert_eq!((rules.missing, rules.time.relative), (Missing::Allow, 1.0));
        assert_eq!(rules.accuracy, Limit { absolute: 2e-3, relative: 0.005 });
    }

    #[test]
    fn mistakes_are_refused() {
        for bad in [
            "[accuracy]\nabsolut_um = 1",
            "[length]\nabsolute_um = 1",
            "[cost]\nrelative = -1",
            "[cost]\nrelative = nan",
            "[cost]\nrelative = \"1\"",
            "missing = \"no\"",
            "cost = 1",
            "[speed]",
            "[[check]]\nscene = \"a\"",
            "[[check]]\nscene = \"a\"\nengine = \"lathe\"",
            "[[check]]\nscene = \"a\"\ncells = [0]",
            "[[check]]\nscene = \"a\"\ncells = 1",
            "[[exact]]\nscene = \"a\"\nradius = 3\nstep = 7",
            "[[exact]]\nscene = \"a\"\nradius = 3\nstep = 1\nconcave = 9\nconvex = 9",
            "[exact]",
            "[",
        ] {
            assert!(parse(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn checks_name_runs_and_closed_forms() {
        let text = "[[check]]\nscene = \"a\"\nengine = \"voxel\"\ncells = [0.4, 0.2]\n[[check]]\nscene = \"b\"\n\
                    engine = \"zmap\"\n[[exact]]\nscene = \"a\"\nradius = 3\nstep = 0.5\nwithin_um = 2";
        let rules = parse(text).unwrap();
        let names: Vec<String> = rules.checks.iter().map(Case::name).collect();
        assert_eq!(names, ["a voxel 0.4 mm", "a voxel 0.2 mm", "b zmap"]);
        // r - √(r² - s²/4).
        assert!((rules.exact[0].scallop.value - (3.0 - (9.0f64 - 0.0625).sqrt())).abs() < 1e-12);
        assert_eq!(rules.exact[0].scallop.within, 2e-3);
    }

    #[test]
    fn both_limits_must_be_exceeded() {
        let limit = Limit { absolute: 1.0, relative: 0.1 };
        assert!(!limit.is_exceeded(5.0, 5.9) && !limit.is_exceeded(100.0, 105.0));
        assert!(limit.is_exceeded(5.0, 6.1) && limit.is_exceeded(100.0, 110.1));
        assert!(!limit.is_exceeded(5.0, 0.0));
    }
}
