//! Scallops by polynomial sections, beside the measured ones.

use metrology::polynomial_figures;
use report::{Figure, micrometres};
use work::monitor::Monitor;

use super::words::{share, value};
use crate::JobError;
use crate::run::{Finding, Run};

/// What the word means.
const MEANING: (&str, &str) = (
    "polynomial section",
    "The scallop between passes along a parameter as a patent of 2021 calculates it: a polynomial through neighbouring contacts, \
     projected into the plane across the feed, and two circles of the ball. It is off where passes spread or the part bends along \
     them.",
);

pub(super) fn find(run: &Run<'_>, monitor: &dyn Monitor) -> Result<Finding, JobError> {
    if run.cutters().are_several() {
        return Ok(Finding::default());
    }
    let (cutter, pairs) = (&run.tooling().cutter, &run.measurement().pairs);
    let found = polynomial_figures(run.part(), cutter, &run.whole.path, pairs, monitor)?;
    let Some(found) = found else { return Ok(Finding::default()) };
    let [mean, max] = [found.mean_mm, found.max_mm].map(|height| micrometres(Some(height)));
    let figure = Figure {
        key: "section_polynomial",
        value: value(&found)?,
        rows: vec![(
            "scallop by a polynomial section: mean, greatest",
            format!("{mean}, {max} µm ({} of the mean measured)", share(found.over_measured)),
        )],
        meaning: Some(MEANING),
        ..Figure::default()
    };
    Ok(Finding { figure: Some(figure), ..Finding::default() })
}

#[cfg(test)]
mod tests {
    use crate::Session;
    use scene::Scene;
    use serde_json::Value;
    use work::monitor::Silent;

    struct Found {
        /// Null where there is none.
        figure: Value,
        passes: usize,
        /// The mean height on circular sections, and the greatest measured, mm.
        section: f64,
        highest: f64,
    }

    fn of(surface: &str, toolpath: &str) -> Found {
        let text = format!(
            "[part]\n{surface}\n[cutter]\nshape = \"ball\"\ndiameter = 6\n[tolerance]\nscallop = 0.03\nchord = 0.0002\n\
             correct = false\n[[toolpath]]\n{toolpath}\n"
        );
        let session = Session::new(Scene::parse("part.toml", text).unwrap()).unwrap();
        let result = session.toolpath(&session.scene.toolpaths[0], &Silent).unwrap().result;
        let figure = |key| result.figures.iter().find(|figure| figure.key == key).map(|figure| &figure.value);
        let pairs = figure("scallop_pairs").unwrap()["pairs"].as_array().unwrap();
        let sections: Vec<f64> = pairs.iter().filter_map(|pair| pair["section_mean_mm"].as_f64()).collect();
        Found {
            figure: figure("section_polynomial").cloned().unwrap_or_default(),
            passes: result.path.passes,
            section: sections.iter().sum::<f64>() / sections.len() as f64,
            highest: result.scallop.max_mm.unwrap(),
        }
    }

    fn number(value: &Value, key: &str) -> f64 {
        value[key].as_f64().unwrap_or_else(|| panic!("{key} of {value}"))
    }

    /// Of circular sections the closed form is known: `scallop_pairs` has it.
    #[test]
    fn on_a_cylinder_it_is_the_height_on_a_circle() {
        let cylinder = "surface = \"cylinder\"\nradius = 20\nx = [-4, 4]\ny = [0, 6]";
        for along in ["u", "v"] {
            let toolpath = format!("strategy = \"iso-parametric\"\nalong = \"{along}\"\nstepover = 0.6");
            let Found { figure, section, .. } = of(cylinder, &toolpath);
            assert!((number(&figure, "mean_mm") / section - 1.0).abs() < 1e-4, "{along}: {figure} {section}");
            assert!((number(&figure, "over_measured") - 1.0).abs() < 0.005, "{along}: {figure}");
        }
    }

    /// Waves across the passes and along them.
    #[test]
    fn on_a_wave_it_agrees_with_what_is_measured_where_passes_are_parallel() {
        let wave = "surface = \"wave\"\namplitude = 0.5\nwavelength_x = 12\nx = [-4, 4]\ny = [-3, 3]";
        for along in ["u", "v"] {
            let toolpath = format!("strategy = \"iso-parametric\"\nalong = \"{along}\"");
            let Found { figure, passes, highest, .. } = of(wave, &toolpath);
            assert!((number(&figure, "over_measured") - 1.0).abs() < 0.01, "{along}: {figure}");
            assert!(number(&figure, "max_mm") < 1.05 * highest, "{along}: {figure} {highest}");
            assert_eq!(figure["pair_count"], passes - 1, "{along}: {figure}");
        }
    }

    #[test]
    fn passes_off_the_parameters_have_none() {
        let plane = "surface = \"plane\"\nx = [0, 8]\ny = [0, 6]";
        assert_eq!(of(plane, "strategy = \"zigzag\"\nangle = 30").figure, Value::Null);
    }
}
