//! The offset surface that a path's ball rides on: what it is off the part, as figures and in words.

use super::Job;
use metrology::{OffsetFigures, offset_figures};
use report::{ToolpathResult, place};
use toolpath::{OffsetAlong, OffsetDrive, OffsetSurface, Strategy};
use work::monitor::Monitor as _;

/// Distances that are off by less than this, mm, are as asked.
const AS_ASKED: f64 = 1.0e-6;

impl Job<'_> {
    /// Adds the offset surface of a path along one to its result. A mesh has none: there passes are put on the level set
    /// of its distance, place by place.
    pub(super) fn add_offset(&self, strategy: &dyn Strategy, result: &mut ToolpathResult) {
        let Some(OffsetSurface { along, drive }) = strategy.downcast_ref() else { return };
        if matches!(along, OffsetAlong::Angle(_)) {
            return;
        }
        self.progress.start("measuring the offset surface", 0);
        let given = match drive {
            OffsetDrive::Given(surfaces) => Some(surfaces.as_slice()),
            OffsetDrive::Exact | OffsetDrive::InPlane => None,
        };
        result.offset = offset_figures(&self.part, self.scene.cutter.radius(), given);
        result.notes.extend(result.offset.iter().flat_map(notes));
    }
}

/// An offset surface in words.
fn notes(figures: &OffsetFigures) -> Vec<String> {
    let radius = figures.asked_mm;
    let mut notes = Vec::new();
    if let Some(d) = &figures.distance {
        let how = if figures.made == "normal" { "" } else { ", made of sections offset in their planes," };
        let off = [d.least_mm, d.greatest_mm].map(|distance| (distance - radius).abs());
        let bound = 1e3 * d.error_bound_mm;
        notes.push(if off[0].max(off[1]) + d.error_bound_mm <= AS_ASKED {
            format!("the offset surface{how} is {radius} mm off the part everywhere, within {AS_ASKED:e} mm")
        } else {
            format!(
                "the offset surface{how} is {:.4} to {:.4} mm off the part (± {bound:.1} µm) instead of {radius} mm: nearest \
                 at {}, farthest at {}",
                d.least_mm,
                d.greatest_mm,
                place(d.least_at_mm),
                place(d.greatest_at_mm)
            )
        });
    }
    if let Some(worst) = figures.singular_places.first() {
        let count = figures.singular_place_count;
        let places = if count == 1 { "in one place".to_owned() } else { format!("in {count} places") };
        let what = worst.curvature_per_mm.map_or_else(
            || "a crease".to_owned(),
            |k| format!("a radius of {:.4} mm (curvature {k:.4} /mm)", worst.radius_mm),
        );
        notes.push(format!(
            "the part is at least as hollow as the ball of {radius} mm {places}, where the offset surface is singular; most at {} \
             (patch {}, u {:.4} v {:.4}), {what}: take a smaller ball there",
            place(worst.at_mm),
            worst.patch,
            worst.u,
            worst.v
        ));
    }
    notes
}

#[cfg(test)]
mod tests {
    use super::super::run;
    use crate::args::RunOptions;
    use crate::progress::Progress;

    /// Runs a suction side that leans by 20 degrees out of its sections' planes, straight or hollow; its `offset` and notes.
    fn offset_of(side: &dyn Fn(f64) -> f64, offset: &str, diameter: f64) -> (serde_json::Value, String) {
        let home = tempfile::tempdir().unwrap();
        let mut table = String::from("unit mm\n");
        for height in [0.0, 4.0, 8.0, 12.0_f64] {
            let lean = height * 20_f64.to_radians().tan();
            table += &format!("section {height}\n");
            for (name, y) in [("pressure", &(|_| -9.0) as &dyn Fn(f64) -> f64), ("suction", side)] {
                table += &format!("{name}\n");
                for k in 0..=24 {
                    let x = 0.5 * f64::from(k);
                    let inside = if k == 0 || k == 24 { 0.0 } else { y(x) };
                    table += &format!("{x} {}\n", lean + inside);
                }
            }
        }
        std::fs::write(home.path().join("side.txt"), table).unwrap();
        let scene = home.path().join("side.toml");
        let text = format!(
            "[part]\nsections = \"side.txt\"\nside = \"suction\"\nrotate = [90, 0, 0]\n[cutter]\nshape = \"ball\"\n\
             diameter = {diameter}\n[tolerance]\nscallop = 0.05\n[simulation]\ncell = 0.2\n[[toolpath]]\nname = \"a\"\nstrategy = \"offset-surface\"\n\
             offset = \"{offset}\"\n"
        );
        std::fs::write(&scene, text).unwrap();
        let out = Some(home.path().join("out"));
        let options = RunOptions { scene, out, threads: Some(2), cell: None, memory: None, engine: None };
        run(&options, &Progress::quiet()).unwrap();
        let json = std::fs::read_to_string(home.path().join("out/report.json")).unwrap();
        let report: serde_json::Value = serde_json::from_str(&json).unwrap();
        let path = &report["toolpaths"][0];
        (path["offset"].clone(), path["notes"].to_string())
    }

    #[test]
    fn a_run_tells_what_its_offset_surface_is_off_the_part() {
        let flat = |_| 0.0;
        let (planar, notes) = offset_of(&flat, "in-plane", 4.0);
        let distance = &planar["distance"];
        let of = |key: &str| distance[key].as_f64().unwrap();
        // d cos φ, φ the lean.
        assert!(
            (of("least_mm") - 1.8794).abs() < 1e-4 && (of("greatest_mm") - 1.8794).abs() < 1e-4,
            "{planar}"
        );
        assert!(of("error_bound_mm") < 1e-4 && (of("rms_error_mm") - 0.1206).abs() < 1e-4);
        assert!(planar["made"] == "in-plane" && planar["singular_place_count"] == 0);
        assert!(notes.contains("in their planes, is 1.8794 to 1.8794 mm off the part"), "{notes}");
        let (exact, notes) = offset_of(&flat, "normal", 4.0);
        assert!((exact["distance"]["greatest_mm"].as_f64().unwrap() - 2.0).abs() < 1e-9, "{exact}");
        assert!(notes.contains("is 2 mm off the part everywhere"), "{notes}");
    }

    #[test]
    fn a_run_tells_where_its_ball_does_not_fit() {
        // At its bottom x = 6 the hollow bends with y'' = 2 (0.2 + 7.2 · 0.05) = 1.12 in the section, times the cosine of the
        // lean in the surface.
        let hollow = |x: f64| 0.2 * ((x - 6.0).powi(2) - 36.0) / (1.0 + 0.05 * (x - 6.0).powi(2));
        let (offset, notes) = offset_of(&hollow, "normal", 6.0);
        let worst = &offset["singular_places"][0];
        assert!(offset["singular_place_count"].as_u64().unwrap() >= 1, "{offset}");
        assert!((worst["at_mm"][0].as_f64().unwrap() - 6.0).abs() < 0.05, "{worst}");
        // A loft that follows its sections to 0.1 µm waves by some per cent of their curvature.
        let curvature = worst["curvature_per_mm"].as_f64().unwrap() / (1.12 * 20_f64.to_radians().cos());
        assert!((curvature - 1.0).abs() < 0.15, "{worst}");
        assert!(notes.contains("at least as hollow as the ball of 3 mm"), "{notes}");
        let small = offset_of(&hollow, "normal", 1.0).0;
        assert_eq!(small["singular_place_count"], 0);
    }
}
