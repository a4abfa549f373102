use proptest::prelude::*;

use super::*;
use blade::sections::{LeadingEnd, Outline, Stacking, TrailingEdge};
use geometry::Point2;

const TABLE: &str = "\
# a wedge
unit mm
section 0
closed
0 0
10 -1
20 0
12 2
6 1.5

section 8
closed
0 0 8
10 -1 8
20 0 8
12 2 8
6 1.5 8
";

const SIDES: &str = "\
section 0
pressure
0 0; # the leading edge
5 -1
10 -1
15 -.5
20 0
suction
0 0
5 2
10 2.5
15 2
20 1e-1
";

fn refusal(text: &str) -> String {
    parse_table(text.as_bytes()).unwrap_err().to_string()
}

fn at(text: &str, start: &str) {
    let told = refusal(text);
    assert!(told.starts_with(start), "{told}");
}

fn points(sections: &Sections) -> Vec<Point2> {
    let curves = sections.sections().iter().flat_map(|s| s.outline.curves());
    curves.flat_map(|(_, points)| points.iter().copied()).collect()
}

#[test]
fn tables_are_read_however_they_are_typed() {
    let plain = parse_table(TABLE.as_bytes()).unwrap();
    assert_eq!((plain.sections().len(), plain.are_closed(), plain.leading()), (2, true, None));
    assert_eq!(plain.sections()[1].height, 8.0);
    assert_eq!(points(&plain)[1], Point2::new(10.0, -1.0));
    let typed = format!(
        "\u{feff}{}",
        TABLE.replace('\n', " \t\r\n").replace(" -1", ",\t-1").replace("closed", "Closed # x")
    );
    assert_eq!(parse_table(typed.as_bytes()).unwrap(), plain);
    // A first point that is repeated at the end.
    let repeated = TABLE.replace("6 1.5\n", "6 1.5\n0 0\n").replace("6 1.5 8\n", "6 1.5 8\n0;0;8.000001\n");
    assert_eq!(parse_table(repeated.as_bytes()).unwrap(), plain);
    let inches = parse_table(TABLE.replace("unit mm", "leading +x\nunit Inch").as_bytes()).unwrap();
    assert_eq!(inches.leading(), Some(LeadingEnd::PlusX));
    for (a, b) in points(&inches).iter().zip(points(&plain)) {
        assert!((a - b * 25.4).norm() < 1e-12);
    }
}

#[test]
fn tables_of_sides_are_read() {
    let upper = SIDES.replace("section 0", "SECTION 6");
    let s = parse_table(format!("{SIDES}{upper}").as_bytes()).unwrap();
    assert!(!s.are_closed() && s.sections().len() == 2 && points(&s).len() == 20);
    let sides = &s.sides().unwrap()[1];
    assert_eq!(
        (sides.height, sides.pressure[1], sides.suction[4]),
        (6.0, Point2::new(5.0, -1.0), Point2::new(20.0, 0.1))
    );
    // From the upper end of the blunt edge over the suction side, the leading edge once, to the lower end.
    assert_eq!(
        (sides.around.len(), sides.around[0].y, sides.around[4].x, sides.around_closed),
        (9, 0.1, 0.0, false)
    );
    let given_late = refusal(&format!("{SIDES}{}", upper.replace("10 2.5", "5 2")));
    assert!(
        given_late
            .starts_with("line 24, column 1: section 2 (height 6 mm), suction side, point 3 repeats point 2"),
        "{given_late}"
    );
}

#[test]
fn faults_name_line_column_and_cure() {
    let with = |from: &str, to: &str| TABLE.replacen(from, to, 1);
    at("", "line 1, column 1: the table has no section; write");
    at("# nothing\n\n", "line 2, column 1: the table has no section");
    at(&with("unit mm", "unit furlong"), "line 2, column 6: \"furlong\" is no unit; valid here: `mm`");
    at(&with("unit mm", "unit"), "line 2, column 1: write `unit` and one of");
    at(&with("unit mm", "unit mm\nunit mm"), "line 3, column 1: the unit was given above (mm)");
    at(
        &with("section 8", "unit mm\nsection 8"),
        "line 11, column 1: \"unit\" must stand above the first section",
    );
    at(&with("unit mm", "leading left"), "line 2, column 9: \"left\" is no end of a section");
    at(&with("closed", "close"), "line 4, column 1: \"close\" begins nothing here; did you mean `closed`?");
    at(
        &with("section 8", "sektion 8"),
        "line 11, column 1: \"sektion\" begins nothing here; did you mean `section`?",
    );
    at(&with("section 0", "section"), "line 3, column 1: write `section` and its height");
    at(&with("section 0", "section zero"), "line 3, column 9: \"zero\" is no number");
    at(&with("closed\n", ""), "line 4, column 1: \"0\" belongs to no curve; write `section`");
    at(&with("section 0\n", ""), "line 3, column 1: `closed` belongs to a section");
    at(&with("closed", "closed 5"), "line 4, column 8: nothing may follow `closed`");
    at(&with("12 2\n", "12\n"), "line 8, column 1: 1 number stands here, and a point has 2");
    at(&with("12 2\n", "  12 2 0 7\n"), "line 8, column 3: 4 numbers stand here");
    at(&with("12 2\n", "12 2.0.1\n"), "line 8, column 4: \"2.0.1\" is no number");
    at(&with("12 2\n", "nan 2\n"), "line 8, column 1: \"nan\" is no finite number");
    at(&with("12 2\n", "12 2e300\n"), "line 8, column 1: the point (12, 2");
    at(
        &with("10 -1 8", "10 -1 8.1"),
        "line 14, column 7: z is 8.1 mm, and the section's height is 8 mm; sections must be plane",
    );
    at(&with("section 8", "section 1e9"), "line 11, column 9: the height is 1000000000 mm");
    at(&with("section 8\n", ""), "line 11, column 1: the section has a curve in line 4 already");
    at(
        &with("12 2\n", "20 0\n"),
        "line 8, column 1: section 1 (height 0 mm), outline, point 4 repeats point 3; delete",
    );
    at(&with("12 2\n", ""), "line 3, column 1: section 1 (height 0 mm): the outline has 4 points");
    at(
        &with("section 8", "section -8").replace(" 8\n", "\n"),
        "line 11, column 1: section 2 (height -8 mm) is no higher",
    );
    at("section 0\npressure\n0 0\nsection 1\n", "line 4, column 1: the section in line 1 lacks `suction`");
    at("section 0\nsuction\n0 0\n", "line 3, column 1: the section in line 1 lacks `pressure`");
    at("section 0\n", "line 1, column 1: the section in line 1 lacks `closed`");
    let told = parse_table(b"unit mm\nsec\xff").unwrap_err().to_string();
    assert!(told.starts_with("line 2, column 4: this is not text"), "{told}");
}

const BLADE: &str = "\
sections = 5
points = 30
trailing_edge = { radius = 0.3 }

[[station]]
height = 0
naca = \"6412\"
chord = 40
angle = 20

[[station]]
height = 60
naca = \"2408\"
chord = 30
angle = 50
thickness = 0.09
lean = [1, 2.5]
";

fn blade(text: &str) -> Result<GeneratedBlade, String> {
    let source = SceneText::new("blade.toml", text);
    parse_blade(&source).map_err(|e| told(&source, &e))
}

#[test]
fn blades_are_read_with_their_defaults() {
    let b = blade(BLADE).unwrap();
    assert_eq!((b.sections, b.points, b.stacking), (5, 30, Stacking::Chord(0.25)));
    assert_eq!(b.trailing_edge, TrailingEdge::Rounded { radius: 0.3 });
    let top = b.stations[1];
    assert_eq!((top.height, top.camber, top.position, top.thickness), (60.0, 0.02, 0.4, 0.09));
    assert_eq!((top.angle, top.lean.x, top.lean.y), (50f64.to_radians(), 1.0, 2.5));
    assert_eq!(b.generate().unwrap().sections().len(), 5);
    let start = BLADE.find("[[station]]").unwrap();
    let plain = blade(&BLADE[start..]).unwrap();
    assert_eq!((plain.sections, plain.points, plain.trailing_edge), (12, 60, TrailingEdge::Closed));
    let inches = blade(&format!("unit = \"inch\"\nstacking = \"centroid\"\n{BLADE}")).unwrap();
    assert_eq!((inches.stations[1].height, inches.stations[0].chord), (60.0 * 25.4, 40.0 * 25.4));
    assert_eq!(inches.stations[1].lean.y, 2.5 * 25.4);
    assert_eq!(
        (inches.trailing_edge, inches.stacking),
        (TrailingEdge::Rounded { radius: 0.3 * 25.4 }, Stacking::Centroid)
    );
}

#[test]
fn faults_of_blades_name_line_column_and_cure() {
    let at = |from: &str, to: &str, start: &str| {
        let told = blade(&BLADE.replacen(from, to, 1)).unwrap_err();
        assert!(told.starts_with(start), "{told}");
    };
    at(
        "points = 30",
        "point = 30",
        "blade.toml:2:1: unknown key `point` in the blade; did you mean `points`?",
    );
    at(
        "angle = 20",
        "angel = 20",
        "blade.toml:9:1: unknown key `angel` in [[station]] number 1; did you mean `angle`?",
    );
    at("\"6412\"", "\"6012\"", "blade.toml:7:8: \"6012\" has camber at no place");
    at("\"6412\"", "6412", "blade.toml:7:8: `naca` in [[station]] number 1: expected a string, found");
    at("chord = 40\n", "", "blade.toml:5:1: [[station]] number 1 has no `chord`; add `chord = 40.0`");
    at("chord = 40", "chord = -40", "blade.toml:8:9: `chord` in [[station]] number 1 is -40");
    at("height = 60", "height = 0", "blade.toml:12:1: the station at height 0 is no higher");
    at(
        "sections = 5",
        "stacking = 1.5",
        "blade.toml:1:12: `stacking` in the blade is 1.5; expected a number (0 to 1, a share of the chord)",
    );
    at(
        "sections = 5",
        "sections = 5.5",
        "blade.toml:1:12: `sections` in the blade is 5.5; expected a whole number",
    );
    // The cure is said once.
    let five = blade(&BLADE.replacen("\"6412\"", "\"23012\"", 1)).unwrap_err();
    assert!(five.contains("no NACA number") && five.matches("2412").count() == 1, "{five}");
    at("0.09", "0.9", "blade.toml:16:13: `thickness` in [[station]] number 2 is 0.9");
    at("[1, 2.5]", "[1]", "blade.toml:17:8: `lean` in [[station]] number 2: expected a list of two numbers");
    at("{ radius = 0.3 }", "\"sharp\"", "blade.toml:3:17: `trailing_edge` in the blade cannot be \"sharp\"");
    at("{ radius = 0.3 }", "0.3", "blade.toml:3:1: `trailing_edge` of the blade is neither");
    at("radius", "radios", "blade.toml:3:19: unknown key `radios` in `trailing_edge` of the blade");
    at("sections = 5", "sections = 1", "blade.toml:1:12: `sections` in the blade is 1");
    at("sections = 5", "sections = ", "blade.toml:1:12: not valid TOML");
    let told = blade("sections = 3\n").unwrap_err();
    assert!(told.starts_with("blade.toml:1:1: the blade has 0 of the 2 stations"), "{told}");
}

#[test]
fn files_are_read_by_their_extension() {
    let folder = std::env::temp_dir().join(format!("section_table_{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let file = |name: &str, text: &[u8]| {
        let path = folder.join(name);
        std::fs::write(&path, text).unwrap();
        path
    };
    assert_eq!(read(&file("a.txt", TABLE.as_bytes())).unwrap(), parse_table(TABLE.as_bytes()).unwrap());
    assert_eq!(read(&file("a.TOML", BLADE.as_bytes())).unwrap().sections().len(), 5);
    let told = read(&file("b.toml", b"sections = \"x\"")).unwrap_err().to_string();
    assert!(told.contains("b.toml:1:12: `sections`"), "{told}");
    let told = read(&file("c.toml", b"a\xff")).unwrap_err().to_string();
    assert!(told.contains("c.toml, line 1, column 2: this is not text"), "{told}");
    let thick = BLADE.replace("radius = 0.3", "radius = 3.0");
    let told = read(&file("d.toml", thick.as_bytes())).unwrap_err().to_string();
    assert!(told.contains("d.toml: a trailing edge of radius 3.0000 mm does not fit"), "{told}");
    let told = read(&file("e.txt", b"section 0\n")).unwrap_err().to_string();
    assert!(told.contains("e.txt, line 1, column 1: the section"), "{told}");
    assert!(read(&folder.join("none.txt")).unwrap_err().to_string().starts_with("cannot read"));
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn shipped_blades_are_read() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/blades");
    for (name, leading, trailing) in [("rotor.txt", 0.4, 0.25), ("sections.toml", 0.3, 0.4)] {
        let sections = read(&folder.join(name)).unwrap();
        assert_eq!(sections.sections().len(), 12);
        for e in sections.edges().unwrap() {
            assert!(e.leading.radius > leading && e.trailing.radius > trailing, "{name}: {e:?}");
            assert!(e.leading.point.x < e.trailing.point.x && e.pressure_first, "{name}");
            // A ball of 3 mm, and the offset by its radius, fit into every hollow.
            let places = (0..4000).map(|k| e.spline.domain()[1] * f64::from(k) / 4000.0);
            let hollow = places.map(|t| e.spline.curvature(t)).fold(0.0, f64::min);
            assert!(hollow > -0.12, "{name}: {hollow}");
        }
    }
}

#[test]
fn written_tables_are_read_back_bit_for_bit() {
    for edge in ["\"open\"", "\"closed\"", "{ radius = 0.3 }"] {
        let text = BLADE.replace("{ radius = 0.3 }", edge);
        let sections = blade(&text).unwrap().generate().unwrap().with_leading(Some(LeadingEnd::MinusX));
        let table = write_table(&sections, "a blade\nof two lines", None);
        assert!(
            table.starts_with("# a blade\n# of two lines\nunit mm\nleading -x\n\nsection 0.0\n"),
            "{table}"
        );
        assert_eq!(parse_table(table.as_bytes()).unwrap(), sections);
        let rounded = parse_table(write_table(&sections, "", Some(4)).as_bytes()).unwrap();
        for (a, b) in points(&rounded).iter().zip(points(&sections)) {
            assert!((a - b).amax() <= 0.5e-4 + 1e-12);
        }
        assert_eq!(rounded.are_closed(), matches!(sections.sections()[0].outline, Outline::Closed(_)));
    }
}

/// Never a panic: sections whose sides can be asked for, or a message that says something.
fn holds_up(bytes: &[u8]) {
    match parse_table(bytes) {
        Ok(sections) => {
            assert!(sections.sections().len() > 1);
            if let Ok(sides) = sections.sides() {
                let mut points =
                    sides.iter().flat_map(|s| s.pressure.iter().chain(&s.suction).chain(&s.around));
                assert!(points.all(|p| p.coords.iter().all(|c| c.is_finite())));
            }
        }
        Err(error) => assert!(error.message.len() > 12 && error.line > 0 && error.column > 0, "{error}"),
    }
    let source = SceneText::new("any.toml", String::from_utf8_lossy(bytes));
    if let Ok(blade) = parse_blade(&source) {
        let _ = blade.generate();
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn any_bytes_are_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        holds_up(&bytes);
    }

    #[test]
    fn any_words_are_read_or_refused(words in prop::collection::vec(prop::sample::select(vec![
        "section", "closed", "pressure", "suction", "unit", "inch", "0", "1", "-2.5", "1e6", "7", "\n", "\n", "\n",
        "nan", "[[station]]", "=", "naca", "height", "\"2412\"", "#", "\u{b5}m",
    ]), 0..80)) {
        holds_up(words.join(" ").as_bytes());
    }

    #[test]
    fn damaged_files_are_read_or_refused(
        table in any::<bool>(),
        damages in prop::collection::vec((any::<[prop::sample::Index; 2]>(), 0u8..4, any::<u8>()), 1..6),
    ) {
        let mut bytes = if table { TABLE } else { BLADE }.as_bytes().to_vec();
        for ([i, j], kind, byte) in damages {
            if bytes.is_empty() {
                break;
            }
            let (i, j) = (i.index(bytes.len()), j.index(bytes.len()));
            let range = i.min(j)..i.max(j);
            match kind {
                0 => bytes[i] = byte,
                1 => bytes[i] = b"0123456789-. \n"[usize::from(byte) % 14],
                2 => drop(bytes.drain(range)),
                _ => {
                    let piece = bytes[range.clone()].to_vec();
                    bytes.splice(range.end..range.end, piece);
                }
            }
        }
        holds_up(&bytes);
    }

    /// Outlines of any shape have sides, if they are taken at all.
    #[test]
    fn any_star_has_sides(radii in prop::collection::vec(0.3..12.0f64, 5..60), stretch in 0.05..3.0f64) {
        let n = radii.len() as f64;
        let mut text = String::new();
        for height in [0, 9] {
            text += &format!("section {height}\nclosed\n");
            for (k, r) in radii.iter().enumerate() {
                let angle = std::f64::consts::TAU * k as f64 / n;
                text += &format!("{} {}\n", r * angle.cos(), stretch * r * angle.sin());
            }
        }
        holds_up(text.as_bytes());
    }
}
