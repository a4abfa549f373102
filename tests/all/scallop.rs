//! Scallops calculated beside measured ones, roughness, and `millstream scallop`.

use crate::command::millstream;
use crate::support::{number, run_scene};

/// The report of a scene's toolpaths on a part of 12 by 9 mm, 10 µm, ball of 6 mm.
fn run(part: &str, toolpath: &str) -> serde_json::Value {
    let home = tempfile::tempdir().unwrap();
    let scene = home.path().join("scene.toml");
    let text = format!(
        "[part]\n{part}\nx = [-6, 6]\ny = [-4.5, 4.5]\n[cutter]\nshape = \"ball\"\ndiameter = 6\n\
         [simulation]\nremoval = false\n[[toolpath]]\n{toolpath}\n"
    );
    std::fs::write(&scene, text).unwrap();
    run_scene(&scene).1["toolpaths"][0].clone()
}

#[test]
fn where_passes_are_parallel_calculated_and_measured_scallops_agree() {
    let cylinder = "surface = \"cylinder\"\nradius = 15\nazimuth = 90";
    for (part, toolpath) in [
        ("surface = \"plane\"", "strategy = \"zigzag\"\nangle = 0"),
        (cylinder, "strategy = \"zigzag\"\nangle = 90"),
        (cylinder, "strategy = \"zigzag\"\nangle = 90\naxis = { lead = 15 }"),
        (&format!("{cylinder}\nconcave = true"), "strategy = \"iso-parametric\""),
    ] {
        let path = run(part, toolpath);
        let pairs = &path["scallop_pairs"];
        assert!(number(pairs, "/parallel_count") > 5.0, "{pairs:#}");
        assert!(number(pairs, "/parallel_greatest_mean_difference") < 0.01, "{part} {toolpath}: {pairs:#}");
        assert!(
            (number(pairs, "/parallel_section_over_measured") - 1.0).abs() < 0.01,
            "{part} {toolpath}: {pairs:#}"
        );
        // Straight rulings: Rz is the scallop, and Ra nearly that of a parabola.
        let (rz, ra) = (number(&path, "/roughness/rz_mm"), number(&path, "/roughness/ra_mm"));
        let mean = number(&path, "/scallop/mean_mm");
        assert!((rz / mean - 1.0).abs() < 0.03, "{part} {toolpath}: {rz} {mean}");
        assert!((ra / (4.0 * rz / (9.0 * 3f64.sqrt())) - 1.0).abs() < 0.03, "{ra} {rz}");
        assert!(number(&path, "/roughness/error_bound_mm") < 0.01 * rz, "{:#}", path["roughness"]);
    }
}

#[test]
fn scallop_answers_and_refuses() {
    let home = tempfile::tempdir().unwrap();
    let asked = |line: &str| {
        let arguments: Vec<&str> = std::iter::once("scallop").chain(line.split(' ')).collect();
        millstream(home.path(), &arguments)
    };
    let answer = asked("--cutter ball:6 --scallop 0.01 --concave 50");
    assert_eq!((answer.code, answer.stderr.as_str()), (Some(0), ""));
    assert!(answer.stdout.contains("concave section of radius 50 mm"), "{}", answer.stdout);
    let table = asked("--cutter ball:6 --table");
    assert!(table.code == Some(0) && table.stdout.contains("second order"), "{table:?}");
    for wrong in
        ["--cutter ball:6 --step 0.5 --concave 2", "--cutter ball:6 --step 70", "--cutter oval:6 --step 1"]
    {
        let answer = asked(wrong);
        assert_eq!((answer.code, answer.stdout.as_str()), (Some(2), ""), "{wrong}");
        assert!(!answer.stderr.is_empty());
    }
}
