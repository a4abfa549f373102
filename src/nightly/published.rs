//! What sources have published, and where ours is: the `--published` file of a nightly, and the table that it
//! leaves.
//!
//! ```toml
//! [[published]]
//! source = "Author, year, table 1"
//! what = "Ra over that of the other path"     # name and unit
//! value = "0.67 (0.8 against 1.2 µm)"         # as published, in words
//! scene = "plate"
//! toolpath = "streamline"
//! figure = "/roughness/ra_mm"                 # where the toolpath of report.json has ours
//! bound = "/roughness/error_bound_mm"         # where it has the error bound, if anywhere
//! over = "zigzag"                             # ours is over the figure of this toolpath; not needed
//! times = 1000                                # or times this: the unit of `what`; not needed
//! why = "the part is another"                 # why ours differs
//!
//! [[published]]                               # without a scene: what cannot be run
//! source = "Author, year, table 2"
//! what = "measured on a machine, mm"
//! value = "149.98"
//! why = "the blade is not public"
//! ```

use keys::{SceneError, SceneText, Section};

use super::results::{Results, SceneResult, ToolpathResult};
use super::table::Table;
use super::words::{number, tick};

/// Factors of units lie within these.
const FACTORS: std::ops::RangeInclusive<f64> = 1e-9..=1e9;

/// What a source has published.
#[derive(Debug, Clone, PartialEq)]
pub struct Published {
    /// Who published it, and where.
    pub source: String,
    /// Name and unit.
    pub what: String,
    /// As published.
    pub value: String,
    /// Why ours differs, or why there is none.
    pub why: String,
    /// Where ours is; `None` for what cannot be run.
    pub ours: Option<Ours>,
}

/// Where a figure of ours is.
#[derive(Debug, Clone, PartialEq)]
pub struct Ours {
    /// The scene's name.
    pub scene: String,
    /// The toolpath's name.
    pub toolpath: String,
    /// Where the toolpath of report.json has it (RFC 6901).
    pub pointer: String,
    /// Where it has the error bound.
    pub bound: Option<String>,
    /// The toolpath over whose figure it is.
    pub over: Option<String>,
    /// What it is multiplied by for the page.
    pub times: f64,
}

impl Published {
    /// Reads a file; `name` is how messages call it.
    ///
    /// # Errors
    /// [`SceneError`] with the place and the cure.
    pub fn parse(name: &str, text: &str) -> Result<Vec<Self>, SceneError> {
        let source = SceneText::new(name, text);
        let table = source.table()?;
        let root = Section::whole(&source, table.get_ref(), "the published figures");
        root.only(&["published"], &[], "the published figures")?;
        root.sections("published")?.iter().map(Self::read).collect()
    }

    fn read(section: &Section<'_>) -> Result<Self, SceneError> {
        /// They say where ours is.
        const OURS: [&str; 6] = ["scene", "toolpath", "figure", "bound", "over", "times"];
        let keys = [&["source", "what", "value", "why"][..], &OURS].concat();
        section.only(&keys, &[], "a published figure")?;
        let text = |key, example| Ok::<_, SceneError>(section.required_text(key, example)?.value.to_owned());
        let ours = OURS.iter().any(|key| section.has(key)).then(|| Ours::read(section)).transpose()?;
        Ok(Self {
            source: text("source", "Author, year, table 1")?,
            what: text("what", "Ra, µm")?,
            value: text("value", "0.8")?,
            why: text("why", "the part is another")?,
            ours,
        })
    }
}

impl Ours {
    fn read(section: &Section<'_>) -> Result<Self, SceneError> {
        let text = |key, example| Ok::<_, SceneError>(section.required_text(key, example)?.value.to_owned());
        let pointer = |key: &str| {
            let Some(found) = section.text(key)? else { return Ok(None) };
            if !found.value.starts_with('/') {
                let what = format!("\"{}\" is no place in a toolpath of report.json", found.value);
                return Err(section.error(
                    &found.span,
                    what,
                    format!("write `{key} = \"/roughness/ra_mm\"`, say"),
                ));
            }
            Ok(Some(found.value.to_owned()))
        };
        // Its absence is told before its form.
        text("figure", "/roughness/ra_mm")?;
        Ok(Self {
            scene: text("scene", "plate")?,
            toolpath: text("toolpath", "zigzag")?,
            pointer: pointer("figure")?.unwrap_or_default(),
            bound: pointer("bound")?,
            over: section.text("over")?.map(|over| over.value.to_owned()),
            times: section.number_or("times", FACTORS, "", 1.0)?,
        })
    }

    /// Places in the toolpath of report.json that it needs.
    pub(crate) fn pointers(&self) -> impl Iterator<Item = &str> {
        std::iter::once(self.pointer.as_str()).chain(self.bound.as_deref())
    }

    /// The figure with its bound, as the page shows it; a dash where it was not measured.
    fn shown(&self, results: &Results) -> String {
        let toolpaths = results.scene(&self.scene).map_or(&[][..], SceneResult::toolpaths);
        let of = |name: &str| self.interval(toolpaths.iter().find(|toolpath| toolpath.name == name)?);
        let figure = match &self.over {
            None => of(&self.toolpath),
            Some(over) => of(&self.toolpath).zip(of(over)).and_then(|(own, other)| own.over(other)),
        };
        let Some(figure) = figure else { return "–".to_owned() };
        match (figure.value * self.times, figure.bound * self.times) {
            // A number of things.
            (value, 0.0) if value.fract() == 0.0 => tick(value),
            (value, 0.0) => number(value),
            (value, bound) => format!("{} ± {}", number(value), rounded_up(bound)),
        }
    }

    fn interval(&self, toolpath: &ToolpathResult) -> Option<Interval> {
        let at = |pointer: &str| toolpath.further.get(pointer).copied();
        let bound = self.bound.as_deref().map_or(Some(0.0), at)?;
        Some(Interval { value: at(&self.pointer)?, bound })
    }
}

/// Two significant digits, not less than the bound.
fn rounded_up(bound: f64) -> String {
    let unit = 10f64.powf(bound.log10().floor() - 1.0);
    tick((bound / unit).ceil() * unit)
}

/// A figure, and how far off it may be.
#[derive(Debug, Clone, Copy)]
struct Interval {
    value: f64,
    bound: f64,
}

impl Interval {
    /// The ratio of two positive figures; `None` where the divisor may be zero.
    fn over(self, other: Self) -> Option<Self> {
        let least = other.value - other.bound;
        (least > 0.0).then(|| {
            let value = self.value / other.value;
            let ends =
                [(self.value + self.bound) / least, (self.value - self.bound) / (other.value + other.bound)];
            Self { value, bound: ends.map(|end| (end - value).abs()).into_iter().fold(0.0, f64::max) }
        })
    }
}

/// The page of its own, Markdown.
pub fn published_page(results: &Results, published: &[Published]) -> String {
    let date = results.date.split('T').next().unwrap_or_default();
    format!(
        "# Published beside measured\n\nGenerated by millstream {} on {date}: `millstream nightly --published FILE`. The first column is \
         the scene with its toolpath, where one was run.\n{}",
        results.millstream,
        table(results, published).markdown()
    )
}

/// A row for each.
pub(crate) fn table(results: &Results, published: &[Published]) -> Table {
    let rows = published.iter().map(|one| {
        let place = one.ours.as_ref().map_or_else(
            || "not run".to_owned(),
            |ours| match &ours.over {
                None => format!("{}, {}", ours.scene, ours.toolpath),
                Some(over) => format!("{}, {} over {over}", ours.scene, ours.toolpath),
            },
        );
        let ours = one.ours.as_ref().map_or_else(|| "–".to_owned(), |ours| ours.shown(results));
        vec![place, one.source.clone(), one.what.clone(), one.value.clone(), ours, one.why.clone()]
    });
    Table::new(
        "Published figures",
        "What the sources of this project show and claim, and what the same measures here.",
        &["scene, toolpath", "source", "figure", "published", "here", "why they differ"],
        rows.collect(),
    )
}

#[cfg(test)]
mod tests {
    use super::super::fixture::{results, scene};
    use super::super::results::Outcome;
    use super::*;

    /// The head of this module.
    fn documented() -> String {
        let lines = include_str!("published.rs").lines().skip_while(|line| !line.contains("```toml")).skip(1);
        lines
            .take_while(|line| !line.contains("```"))
            .map(|line| line.trim_start_matches("//!").to_owned() + "\n")
            .collect()
    }

    /// A scene with a zigzag and a streamline of these roughnesses and this bound.
    fn plate(zigzag: f64, streamline: f64, bound: f64) -> SceneResult {
        let mut plate = scene("plate", 0.01);
        let Outcome::Done { toolpaths, .. } = &mut plate.outcome else { unreachable!() };
        let with = |name: &str, ra: f64| ToolpathResult {
            name: name.to_owned(),
            further: [("/roughness/ra_mm".to_owned(), ra), ("/roughness/error_bound_mm".to_owned(), bound)]
                .into(),
            ..toolpaths[0].clone()
        };
        *toolpaths = vec![with("zigzag", zigzag), with("streamline", streamline)];
        plate
    }

    #[test]
    fn a_published_figure_stands_beside_ours_with_its_bound() {
        let mut published = Published::parse("published.toml", &documented()).unwrap();
        let pointers: Vec<&str> = published[0].ours.iter().flat_map(Ours::pointers).collect();
        assert_eq!(pointers, ["/roughness/ra_mm", "/roughness/error_bound_mm"]);
        let results = results(vec![plate(0.002, 0.001, 0.0001)]);
        // 1000 · 0.5; the farthest end is (0.001 + 0.0001) / (0.002 - 0.0001).
        let page = published_page(&results, &published);
        let bound = 1000.0 * (0.0011f64 / 0.0019 - 0.5);
        assert!((78.9..79.0).contains(&bound));
        let row = "| plate, streamline over zigzag | Author, year, table 1 | Ra over that of the other path | 0.67 (0.8 against 1.2 µm) | \
                   500.0 ± 79 | the part is another |";
        assert!(page.contains(row), "{page}");
        assert!(
            page.contains("| not run | Author, year, table 2 | measured on a machine, mm | 149.98 | – |"),
            "{page}"
        );
        let ours = published[0].ours.as_mut().unwrap();
        (ours.over, ours.bound) = (None, None);
        assert_eq!(ours.shown(&results), "1");
        ours.toolpath = "spiral".to_owned();
        assert_eq!(ours.shown(&results), "–");
    }

    #[test]
    fn a_ratio_of_what_may_be_nothing_is_none() {
        let [one, doubtful] = [0.0, 1.0].map(|bound| Interval { value: 1.0, bound });
        assert!(one.over(doubtful).is_none());
        assert_eq!(doubtful.over(one).map(|ratio| ratio.bound), Some(1.0));
        assert_eq!([0.0101, 0.1, 12.01].map(rounded_up), ["0.011", "0.1", "13"]);
    }

    #[test]
    fn mistakes_are_refused() {
        let head = "[[published]]\nsource = \"S\"\nwhat = \"Ra\"\nvalue = \"1\"\nwhy = \"other\"\n";
        let run = format!("{head}scene = \"a\"\ntoolpath = \"b\"\nfigure = \"/ra\"\n");
        for good in [head, &run] {
            assert!(Published::parse("p.toml", good).is_ok(), "{good}");
        }
        for bad in [
            "[[published]]\nsource = \"S\"".to_owned(),
            "[published]".to_owned(),
            "[[check]]".to_owned(),
            format!("{head}scene = \"a\""),
            format!("{head}over = \"a\""),
            run.replace("/ra", "ra"),
            format!("{run}bound = \"ra\""),
            format!("{run}times = 0"),
            format!("{run}unit = \"mm\""),
        ] {
            assert!(Published::parse("p.toml", &bad).is_err(), "{bad}");
        }
    }
}
