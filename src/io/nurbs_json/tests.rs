use super::*;
use approx::assert_relative_eq;
use geometry::samples;
use proptest::prelude::*;

const PATCH: &str = r#""degree_u": 1, "degree_v": 1, "knots_u": [0, 0, 1, 1], "knots_v": [0, 0, 2, 2],
 "control_points": [[[0, 0, 0], [0, 20, 0]], [[30, 0, 5], [30, 20, 5e0]]]"#;

fn message(text: &str) -> String {
    parse(text).unwrap_err().to_string()
}

#[test]
fn the_documented_example_is_read() {
    let example: String = include_str!("../nurbs_json.rs")
        .lines()
        .skip_while(|l| !l.contains("```json"))
        .skip(1)
        .take_while(|l| !l.contains("```"))
        .map(|l| l.trim_start_matches("//!"))
        .collect::<Vec<_>>()
        .join("\n");
    let patches = parse(&example).unwrap();
    assert_eq!(patches.len(), 1);
    assert_relative_eq!(patches[0].point(0.5, 0.25), Point3::new(15.0, 5.0, 2.5), epsilon = 1e-14);
}

#[test]
fn short_form_without_weights() {
    let patches = parse(&format!("\u{feff}{{\"unit\": \"mm\", {PATCH}}}")).unwrap();
    assert_eq!(patches[0].domain(), [[0.0, 1.0], [0.0, 2.0]]);
    assert_eq!(patches[0].control_point(1, 1), (Point3::new(30.0, 20.0, 5.0), 1.0));
}

#[test]
fn written_text_reads_back() {
    let written = [samples::bicubic(&[1.0]), samples::hemisphere(Point3::new(1.0, 2.0, 3.0), 7.0)];
    let read = parse(&to_text(&written)).unwrap();
    assert_eq!(read[0], written[0]);
    for (a, b) in [(0.1, 0.2), (3.3, 0.9)] {
        assert_relative_eq!(read[1].point(a, b), written[1].point(a, b), epsilon = 1e-13);
    }
    assert!(!to_text(&written[..1]).contains("weights"));
}

#[test]
fn messages_name_place_and_cure() {
    assert_eq!(
        message("{\"unit\": \"mm\",\n \"knot_u\": [0]}"),
        "line 2, column 9: unknown key \"knot_u\"; did you mean \"knots_u\"?"
    );
    assert!(message(r#"{"unit": "mm", "colour": 1}"#).contains("the keys are unit, patches, degree_u"));
    assert!(message(&format!("{{\"unit\": \"inch\", {PATCH}}}")).contains("multiply inches by 25.4"));
    assert!(message(&format!("{{{PATCH}}}")).contains("the key \"unit\" is missing"));
    assert!(message(r#"{"unit": "mm"}"#).contains("there is no patch"));
    assert!(message(r#"{"unit": "mm", "patches": []}"#).contains("there is no patch"));
    assert!(message(r#"{"unit": "mm", "degree_u": 2}"#).contains("\"degree_v\" is missing"));
    assert!(
        message(&format!("{{\"unit\": \"mm\", \"patches\": [{{{PATCH}}}], \"weights\": []}}"))
            .contains("beside")
    );
    assert!(message(&format!("{{\"unit\": \"mm\", {PATCH}")).contains("is the file complete?"));
    assert!(message("").starts_with("line 1, column 1: the text ends too early"));
    let huge = format!("{{\"unit\": \"mm\",\n{}}}", PATCH.replace("5e0", "1e999"));
    assert!(message(&huge).starts_with("line 3, ") && message(&huge).contains("number out of range"));
    let far = format!("{{\"unit\": \"mm\", \"patches\": [\n{{{}}}]}}", PATCH.replace("5e0", "1e9"));
    let expected =
        "line 3, column 75: this patch cannot be used: control point [1][1] is (30, 20, 1000000000)";
    assert!(message(&far).starts_with(expected), "{}", message(&far));
    let flat = format!("{{\"unit\": \"mm\", {}}}", PATCH.replace("[30, 0, 5]", "[30, 0]"));
    assert!(message(&flat).contains("array of length 3"), "{}", message(&flat));
    assert!(
        message(&format!("{{\"unit\": \"mm\", {}}}", PATCH.replace("20, 5e0", "null, 5"))).contains("null")
    );
    assert!(
        message(&format!("{{\"unit\": \"mm\", {}}}", PATCH.replace("2, 2]", "2]")))
            .contains("along v: there are 3 knots")
    );
}

#[test]
fn files_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("part.json");
    assert!(read(&path).unwrap_err().to_string().starts_with("cannot read "));
    std::fs::write(&path, b"{\"unit\": \"mm\",\n \"\xff\"").unwrap();
    let text = read(&path).unwrap_err().to_string();
    assert!(text.ends_with("part.json, line 2, column 3: not UTF-8 text; save the file as UTF-8"), "{text}");
    std::fs::write(&path, format!("{{\"unit\": \"mm\", {PATCH}}}")).unwrap();
    assert_eq!(read(&path).unwrap().len(), 1);
    assert!(matches!(read(folder.path()), Err(NurbsFileError::Io { .. })));
}

/// scenes/joined.json is made by `samples::joined`. Its patches share border points and tangent planes,
/// and are parametrised differently.
#[test]
fn the_joined_scene_is_what_its_generator_makes() {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes/joined.json"));
    let made = samples::joined();
    if std::env::var_os("MILLSTREAM_BLESS").is_some() {
        std::fs::write(path, to_text(&made)).unwrap();
    }
    assert_eq!(read(path).unwrap(), made);
    for pair in made.windows(2) {
        for k in 0..=50 {
            let v = f64::from(k) / 50.0;
            let (left, right) = (pair[0].jet(1.0, v), pair[1].jet(0.0, v));
            assert!((left.p - right.p).norm() < 1e-12);
            assert!((left.normal().unwrap() - right.normal().unwrap()).norm() < 1e-12);
        }
    }
    let jump = |pair: &[NurbsSurface]| (pair[0].jet(1.0, 0.5).du - pair[1].jet(0.0, 0.5).du).norm();
    assert!(made.windows(2).any(|pair| jump(pair) > 1.0), "the speed along u changes somewhere");
}

/// scenes/ridge.json is made by `samples::ridge`. After a change there, write it anew with
/// `MILLSTREAM_BLESS=1 cargo test --release --lib ridge`.
#[test]
fn the_ridge_scene_is_what_its_generator_makes() {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes/ridge.json"));
    let made = [samples::ridge()];
    if std::env::var_os("MILLSTREAM_BLESS").is_some() {
        std::fs::write(path, to_text(&made)).unwrap();
    }
    assert_eq!(read(path).unwrap(), made);
    // Suited to a ball of 3 mm radius: no valley is tighter than 5 mm, no slope above 50 degrees, and
    // curved enough, in and out, to tell strategies apart.
    let (mut concave, mut convex, mut upright): (f64, f64, f64) = (0.0, 0.0, 1.0);
    for k in 0..=300 * 302 {
        let jet = made[0].jet((k % 301) as f64 / 300.0, (k / 301) as f64 / 300.0);
        let curvature = jet.principal_curvatures().unwrap();
        (concave, convex) = (concave.max(curvature.max), convex.min(curvature.min));
        upright = upright.min(jet.normal().unwrap().z);
    }
    let (valley, hill, slope) = (1.0 / concave, -1.0 / convex, upright.acos().to_degrees());
    println!(
        "least concave radius {valley:.3} mm, least convex radius {hill:.3} mm, steepest slope {slope:.2} degrees"
    );
    assert!((5.0..7.0).contains(&valley) && (5.0..7.0).contains(&hill), "{valley} {hill}");
    assert!((30.0..50.0).contains(&slope), "{slope}");
}

proptest! {
    /// Whatever happens to a good file, reading it ends in patches with finite points or in a message.
    #[test]
    fn damaged_files_never_panic(edits in proptest::collection::vec((0.0f64..1.0, "[-0-9eE.,:{}\\[\\]\"a-z ]{0,3}", 0usize..4), 1..4)) {
        let mut text = format!("{{\"unit\": \"mm\", {PATCH}, \"weights\": [[1, 2], [3, 0.5]]}}");
        for (at, insert, remove) in edits {
            let at = (at * text.len() as f64) as usize;
            let end = (at + remove).min(text.len());
            text.replace_range(at..end, &insert);
        }
        match parse(&text) {
            Ok(patches) => {
                for p in &patches {
                    let [[u0, u1], [v0, v1]] = p.domain();
                    let j = p.jet(0.3 * u0 + 0.7 * u1, 0.9 * v0 + 0.1 * v1);
                    for d in [j.p.coords, j.du, j.dv, j.duu, j.duv, j.dvv] {
                        prop_assert!(d.iter().all(|c| c.is_finite()));
                    }
                }
            }
            Err(e) => prop_assert!(e.line >= 1 && e.column >= 1 && !e.message.is_empty()),
        }
    }

    #[test]
    fn any_text_is_answered(text in ".{0,80}") {
        let _ = parse(&text);
    }
}
