use super::*;
use proptest::prelude::*;
use std::f64::consts::PI;

fn options() -> OutlineOptions {
    OutlineOptions { chord_tolerance: 1e-3, scale: None, layer: None }
}

fn dxf(entities: &str) -> String {
    let text = format!(
        "0 SECTION 2 HEADER 9 $INSUNITS 70 4 0 ENDSEC 0 SECTION 2 ENTITIES {entities} 0 ENDSEC 0 EOF"
    );
    text.split_whitespace().collect::<Vec<_>>().join("\n")
}

fn from_dxf(entities: &str) -> Result<Outlines, OutlineError> {
    parse(dxf(entities).as_bytes(), dxf::FORMAT, &options())
}

fn svg(body: &str) -> Result<Outlines, OutlineError> {
    let text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"100mm\" height=\"50mm\" viewBox=\"0 0 200 100\">{body}</svg>"
    );
    parse(text.as_bytes(), svg::FORMAT, &options())
}

fn near(outlines: Result<Outlines, OutlineError>, area: f64) {
    let found = outlines.unwrap().region.area();
    // Chords within a micrometre of curves of at most some 400 mm in length.
    assert!((found - area).abs() < 0.4, "{found} {area}");
}

#[test]
fn every_kind_of_dxf_entity_has_the_area_of_its_closed_form() {
    near(from_dxf("0 CIRCLE 8 0 10 5 20 6 40 10"), 100.0 * PI);
    near(from_dxf("0 ELLIPSE 8 0 10 0 20 0 11 20 21 0 40 0.5"), 200.0 * PI);
    // A stadium: lines and half circles by bulges, and by lines and arcs in any order and sense.
    let stadium = 400.0 + 100.0 * PI;
    near(
        from_dxf("0 LWPOLYLINE 8 0 90 4 70 1 10 0 20 0 10 20 20 0 42 1 10 20 20 20 10 0 20 20 42 1"),
        stadium,
    );
    near(
        from_dxf(
            "0 POLYLINE 8 0 70 1 0 VERTEX 10 0 20 0 0 VERTEX 10 20 20 0 42 1 0 VERTEX 10 20 20 20 0 VERTEX 10 0 20 20 42 1 0 SEQEND",
        ),
        stadium,
    );
    near(
        from_dxf(
            "0 LINE 8 0 10 0 20 0 11 20 21 0 0 ARC 8 0 10 0 20 10 40 10 50 90 51 270 0 LINE 8 0 10 0 20 20 11 20 21 20.004 0 ARC 8 0 10 20 20 10 40 10 50 270 51 90",
        ),
        stadium,
    );
    // A half circle seen from below lies on the other side of the y axis.
    let below =
        from_dxf("0 ARC 8 0 10 10 20 0 40 5 50 0 51 180 230 -1 0 LINE 8 0 10 -5 20 0 11 -15 21 0").unwrap();
    assert!((below.region.area() - 12.5 * PI).abs() < 0.05);
    assert!(below.region.bounds().unwrap()[1].x <= -5.0 + 1e-9);
    // A full circle as a rational quadratic spline of nine control points.
    let w = 0.5f64.sqrt();
    let corners = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0)];
    let control: String = corners
        .iter()
        .enumerate()
        .map(|(k, (x, y))| format!(" 41 {} 10 {} 20 {}", if k % 2 == 0 { 1.0 } else { w }, 10 * x, 10 * y))
        .collect();
    let knots: String = [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4].iter().map(|k| format!(" 40 {k}")).collect();
    near(from_dxf(&format!("0 SPLINE 8 0 70 1 71 2{knots}{control}")), 100.0 * PI);
}

#[test]
fn every_kind_of_svg_element_has_the_area_of_its_closed_form() {
    // One unit is half a millimetre.
    near(svg("<circle cx='50' cy='50' r='20'/>"), 100.0 * PI);
    near(svg("<ellipse cx='50' cy='50' rx='20' ry='10' transform='rotate(30) scale(1 -1)'/>"), 50.0 * PI);
    near(svg("<rect x='5' y='5' width='80' height='40' rx='10'/>"), 800.0 - (4.0 - PI) * 25.0);
    near(svg("<polygon points='0,0 80,0 80,40'/>"), 400.0);
    near(
        svg(
            "<g transform='translate(3 4)'><path d='m 0 0 h 40 a 20 20 0 0 1 0 40 h -40 A 20 20 0 0 1 0 0 z'/></g>",
        ),
        400.0 + 100.0 * PI,
    );
    // A cubic whose area follows from its control polygon: 3/20 of it and so on; here 0.6 of the square.
    for hidden in [
        "display='none'",
        "visibility='hidden'",
        "style='display : none'",
        "style='fill:red;visibility:hidden'",
    ] {
        near(svg(&format!("<rect width='40' height='20'/><circle cx='20' cy='10' r='3' {hidden}/>")), 200.0);
    }
    let pens = "<style>/* pens { */ .a{fill:none;stroke:#000;stroke-width:.5px;display:inline}</style>";
    near(
        svg(&format!("{pens}<rect class='a' width='40' height='20' style='opacity:1;display:inline'/>")),
        200.0,
    );
    near(svg("<path d='M0 0 C 0 40 40 40 40 0 Z'/>"), 0.6 * 400.0);
    near(svg("<path d='M0 0 Q 20 40 40 0 Z'/>"), 400.0 / 3.0);
    near(svg("<path d='M0 0 H80 V60 H0 Z M20 20 v20 h20 v-20 z'/>"), 1100.0);
    let flipped = svg("<rect width='10' height='20'/>").unwrap().region.bounds().unwrap();
    assert_eq!(flipped, [Point2::new(0.0, 40.0), Point2::new(5.0, 50.0)], "y runs up from the lower edge");
}

/// Corners of a rect follow SVG 2: a radius of 0 squares them whatever the other one is, and one that is
/// negative or `auto` is the other one.
#[test]
fn corners_of_a_rect_have_the_radii_that_svg_says() {
    let square = |also: &str, area: f64| near(svg(&format!("<rect width='80' height='60' {also}/>")), area);
    for also in ["rx='0' ry='20'", "rx='20' ry='0'", "rx='-4' ry='-4'", "rx='auto' ry='-1'"] {
        square(also, 1200.0);
    }
    for also in ["rx='-4' ry='20'", "rx=' auto ' ry='20'", "rx='20' ry='-4'", "ry='20'"] {
        square(also, 1200.0 - (4.0 - PI) * 100.0);
    }
    square("rx='60' ry='20'", 1200.0 - (4.0 - PI) * 200.0);
}

/// Where width and height scale the viewBox differently, its `preserveAspectRatio` says what holds: one unit
/// is a millimetre in x and more, or less, in y.
#[test]
fn the_aspect_ratio_of_a_page_is_kept_as_svg_says() {
    let read = |size: [&str; 2], also: &str| {
        let text = format!(
            "<svg width='{}mm' height='{}mm' viewBox='10 0 100 50' {also}><rect x='10' width='100' height='50'/></svg>",
            size[0], size[1]
        );
        parse(text.as_bytes(), svg::FORMAT, &options())
    };
    let is = |size: [&str; 2], also: &str, lo: [f64; 2], hi: [f64; 2], noted: bool| {
        let found = read(size, also).unwrap();
        let bounds = found.region.bounds().unwrap();
        for (found, wanted) in bounds.iter().zip([lo, hi]) {
            assert!((found - Point2::from(wanted)).norm() < 1e-9, "{size:?} {also}: {bounds:?}");
        }
        assert_eq!(found.notes.join("").contains("preserveAspectRatio"), noted, "{also}: {:?}", found.notes);
    };
    is(["100", "50"], "preserveAspectRatio='xMidYMid slice'", [0.0, 0.0], [100.0, 50.0], false);
    is(["100.09", "50"], "", [0.045, 0.0], [100.045, 50.0], true);
    is(["100", "60"], "preserveAspectRatio='xMidYMid meet'", [0.0, 5.0], [100.0, 55.0], true);
    // y runs up: the upper edges meet with YMin, the lower ones with YMax.
    is(["100", "60"], "preserveAspectRatio='xMaxYMin'", [0.0, 10.0], [100.0, 60.0], true);
    is(["100", "60"], "preserveAspectRatio='xMinYMax'", [0.0, 0.0], [100.0, 50.0], true);
    is(["120", "50"], "preserveAspectRatio='xMaxYMid'", [20.0, 0.0], [120.0, 50.0], true);
    is(["100", "60"], "preserveAspectRatio='none'", [0.0, 0.0], [100.0, 60.0], true);
    // Rounded to the last decimal that is written: less than a micrometre over the page.
    is(["100.0000004", "50"], "", [0.0000002, 0.0], [100.0000002, 50.0], false);
    for (also, word) in [("preserveAspectRatio='xMidYMid slice'", "slice"), ("preserveAspectRatio='?'", "?")]
    {
        let refused = read(["100", "60"], also).unwrap_err().to_string();
        assert!(refused.contains("preserveAspectRatio") && refused.contains(word), "{refused}");
    }
}

/// Points that are the same but for rounding are one: those of relative coordinates, where an outline comes
/// back to its beginning, and repeated vertices. The bound holds what they are apart.
#[test]
fn points_that_only_rounding_parts_are_one() {
    let kite = svg("<path d='m80.012 50.0 -30.012 35.436 -38.288 -35.436 38.288 -29.263 30.012 29.263z'/>");
    let area = 0.25 * 0.5 * (80.012 - 11.712) * (35.436 + 29.263);
    assert!((kite.unwrap().region.area() - area).abs() < 1e-9);
    for (last, off) in [("0 20 -1e-9", 1e-9), ("1e-9 20 0", 1e-9), ("-3e-9 20 -4e-9", 5e-9), ("0 20 0", 0.0)]
    {
        let outline = format!("0 LWPOLYLINE 8 0 70 1 10 0 20 0 10 40 20 0 10 40 20 30 10 0 20 30 10 {last}");
        let found = from_dxf(&outline).unwrap();
        assert_eq!((found.region.area(), found.region.curves().next().unwrap().len()), (1200.0, 4), "{last}");
        assert!((found.off_curves - off).abs() < 1e-15, "{last}: {}", found.off_curves);
    }
    let within = from_dxf(
        "0 LWPOLYLINE 8 0 70 1 10 0 20 0 10 40 20 0 10 40.000000001 20 -1e-9 10 40 20 30 10 0 20 30",
    );
    assert_eq!(within.unwrap().region.area(), 1200.0);
    // Corners a tenth of a micrometre apart are drawn so.
    let short =
        from_dxf("0 LWPOLYLINE 8 0 70 1 10 0 20 0 10 40 20 0 10 40 20 30 10 0 20 30 10 0 20 1e-4").unwrap();
    assert_eq!((short.region.curves().next().unwrap().len(), short.off_curves), (5, 0.0));
}

/// A last point that misses the first one by less than what open ends are joined over is one with it where
/// the outline would cross itself, and the bound holds what they are apart.
#[test]
fn closed_outlines_that_miss_their_beginning_are_closed_at_it() {
    let outline =
        |last: &str| format!("0 LWPOLYLINE 8 0 70 1 10 0 20 0 10 40 20 0 10 40 20 30 10 0 20 30 10 {last}");
    for (last, off) in [("0.00003 20 -0.00004", 5e-5), ("0.003 20 -0.004", 5e-3)] {
        let found = from_dxf(&outline(last)).unwrap();
        assert_eq!((found.region.area(), found.region.curves().next().unwrap().len()), (1200.0, 4), "{last}");
        assert!((found.off_curves - off).abs() < 1e-12, "{last}: {}", found.off_curves);
        assert!(found.notes.join("\n").contains("closed at that: 1"), "{:?}", found.notes);
    }
    // One that crosses nothing is drawn so, and one farther off was meant.
    let drawn = from_dxf(&outline("0 20 0.004")).unwrap();
    assert_eq!((drawn.region.curves().next().unwrap().len(), drawn.off_curves), (5, 0.0));
    let refused = from_dxf(&outline("0.03 20 -0.04")).unwrap_err().to_string();
    assert!(refused.contains("crosses itself at x 0.03"), "{refused}");
}

/// Of the subpaths of one path those bound what is filled that have it on one side only: by the rule of its
/// fill. Here the outer one is 80 by 60, and what lies in it 40 by 40 and 20 by 20; half a millimetre a unit.
#[test]
fn outlines_within_a_fill_are_left_out_by_its_rule() {
    let path = |also: &str, inner: &str| format!("<path d='M0 0 H80 V60 H0 Z {inner}' {also}/>");
    let (with, against) = ("M20 10 h40 v40 h-40 z", "M20 10 v40 h40 v-40 z");
    let within = "M30 20 h20 v20 h-20 z";
    let is = |body: String, area: f64, left_out: usize| {
        let found = svg(&body).unwrap();
        assert_eq!(found.region.area().round(), area, "{body}");
        let note = format!("left out: {left_out}");
        let told = found.notes.iter().find(|note| note.contains("on both sides"));
        assert_eq!(told.is_some_and(|n| n.contains(&note)), left_out > 0, "{body}: {:?}", found.notes);
    };
    is(path("", with), 1200.0, 1);
    is(path("", against), 800.0, 0);
    is(path("", &format!("{with} {within}")), 1200.0, 2);
    is(path("", &format!("{against} {within}")), 900.0, 0);
    is(path("", "M20 10 h40 v40 h-40 v-40"), 1200.0, 1);
    for also in [
        "fill-rule='evenodd'",
        "style='fill-rule: evenodd'",
        "fill-rule='nonzero' style='fill-rule:evenodd'",
        "fill='none' stroke='black'",
    ] {
        is(path(also, with), 800.0, 0);
        is(format!("<g {also}>{}</g>", path("", with)), 800.0, 0);
    }
    is(format!("<g fill-rule='evenodd'>{}</g>", path("fill-rule='nonzero'", with)), 1200.0, 1);
    is(format!("<g fill-rule='evenodd'>{}</g>", path("fill-rule='inherit'", with)), 800.0, 0);
    is(format!("<g transform='scale(-1 1)'>{}</g>", path("", with)), 1200.0, 1);
    // Shapes of their own are outlines and islands as they lie, and what crosses is refused as ever.
    is(path("", with) + "<circle cx='40' cy='30' r='10'/>", (1200.0 - 25.0 * PI).round(), 1);
    assert!(svg(&path("", "M60 10 h40 v40 h-40 z")).unwrap_err().to_string().contains("meet at"));
    let sheet = |rule: &str, body: &str| svg(&format!("<style>.a{{{rule}}}</style>{body}"));
    for rule in ["fill-rule:evenodd", "fill:none;stroke:red"] {
        let refused = sheet(rule, &path("class='a'", with)).unwrap_err().to_string();
        assert!(refused.contains("path") && refused.contains("`fill-rule`"), "{refused}");
        assert_eq!(sheet(rule, &path("class='a'", against)).unwrap().region.area().round(), 800.0, "{rule}");
    }
    let told = sheet("fill:red", &path("fill-rule='evenodd'", with)).unwrap();
    assert_eq!(told.region.area().round(), 800.0);
    let refused = svg(&path("fill-rule='var(--a)'", with)).unwrap_err().to_string();
    assert!(refused.contains("`fill-rule`"), "{refused}");
}

#[test]
fn units_and_layers_are_those_of_the_file_or_of_the_scene() {
    let square = "0 LWPOLYLINE 8 cut 90 4 70 1 10 0 20 0 10 2 20 0 10 2 20 2 10 0 20 2 0 CIRCLE 8 marks 10 9 20 9 40 1";
    let inches = dxf(square).replace("$INSUNITS\n70\n4", "$INSUNITS\n70\n1");
    let wanted = OutlineOptions { layer: Some("cut".into()), ..options() };
    let area =
        |options: &OutlineOptions| parse(inches.as_bytes(), dxf::FORMAT, options).unwrap().region.area();
    assert!((area(&wanted) - 4.0 * 25.4 * 25.4).abs() < 1e-9);
    assert_eq!(area(&OutlineOptions { scale: Some(1.0), ..wanted }), 4.0);
    let missing = OutlineOptions { layer: Some("cuts".into()), ..options() };
    let error = parse(inches.as_bytes(), dxf::FORMAT, &missing).unwrap_err().to_string();
    assert!(error.contains("\"cut\", \"marks\""), "{error}");
    // To a DXF names that differ in case are one layer.
    for layer in ["CUT", "Cut"] {
        let other = OutlineOptions { layer: Some(layer.into()), ..options() };
        assert!((area(&other) - 4.0 * 25.4 * 25.4).abs() < 1e-9, "{layer}");
    }
}

#[test]
fn what_is_wrong_is_told_with_its_place() {
    let says = |r: Result<Outlines, OutlineError>, words: &[&str]| {
        let text = r.unwrap_err().to_string();
        assert!(words.iter().all(|w| text.contains(w)), "{text}");
    };
    says(
        from_dxf("0 LINE 8 0 10 0 20 0 11 20 21 0 0 LINE 8 0 10 20 20 0 11 20 21 20"),
        &["line 15", "LINE", "open at x 20", "28.2843 mm"],
    );
    says(
        from_dxf("0 LWPOLYLINE 8 0 70 1 10 0 20 0 10 9 20 9 10 9 20 0 10 0 20 8"),
        &["LWPOLYLINE (line 15)", "crosses itself at x 4.2353 y 4.2353"],
    );
    says(
        from_dxf("0 CIRCLE 8 0 10 0 20 0 40 5 0 CIRCLE 8 0 10 6 20 0 40 5"),
        &["CIRCLE (line 15) and CIRCLE (line 25) meet at x 2.99"],
    );
    says(from_dxf("0 CIRCLE 8 0 10 0 20 0 40 5 0 CIRCLE 8 0 10 0 20 0 40 5"), &["same outline"]);
    says(from_dxf("0 CIRCLE 8 0 10 nan 20 0 40 5"), &["line 19", "not a finite number"]);
    says(from_dxf("0 CIRCLE 8 0 10 1e300 20 0 40 5"), &["CIRCLE (line 15)", "1e6"]);
    says(from_dxf("0 CIRCLE 8 0 10 0 20 0 40 -5"), &["radius is -5"]);
    says(from_dxf("0 INSERT 8 0 2 block"), &["explode"]);
    says(from_dxf("0 TEXT 8 0 1 hello"), &["no outlines"]);
    says(from_dxf("0 SPLINE 8 0 71 3 40 0 10 0 20 0"), &["SPLINE", "degree 3 needs more than 1"]);
    says(parse(b"solid cube", dxf::FORMAT, &options()), &["line 1", "no group code"]);
    says(svg("<path d='M0 0 L10 0 L10 10'/>"), &["line 1", "open at x 5.0000 y 45.0000"]);
    says(svg("<path id='p' d='M0 0 L10 zz'/>"), &["path \"p\""]);
    says(svg("<use href='#a'/>"), &["convert them to paths"]);
    says(
        svg("<style>.h{display:none}</style><circle class='h' r='2'/>"),
        &["style", "`display`", "presentation"],
    );
    says(svg("<defs><style>/* r:1 */ .a{fill:red;r:4px}</style></defs>"), &["`r`"]);
    says(svg("<style>@import url(a.css);</style>"), &["other files"]);
    says(svg("<rect width='9' height='9' style='transform:translate(3px,0)'/>"), &["rect", "`transform`"]);
    let again = "<g visibility='hidden'><path id='p' d='M0 0 H9 V9 Z' style='visibility: visible'/></g>";
    says(svg(again), &["path \"p\"", "hidden"]);
    let sheet = b"<?xml-stylesheet href='a.css'?><svg><rect width='9' height='9'/></svg>";
    says(parse(sheet, svg::FORMAT, &options()), &["other files"]);
    says(parse(b"<svg><g></svg>", svg::FORMAT, &options()), &["not valid XML"]);
    says(svg("<text>hello</text>"), &["no outlines"]);
}

fn square(x: f64, also: &str) -> String {
    format!("<rect x='{x}' y='10' width='20' height='20' {also}/>")
}

#[test]
fn a_drawing_without_a_unit_tells_how_many_make_an_inch() {
    for (page, inch) in
        [("viewBox='0 0 100 50'", "96"), ("width='400' height='200' viewBox='0 0 100 50'", "24")]
    {
        let text = format!("<svg {page}>{}</svg>", square(10.0, ""));
        let notes = parse(text.as_bytes(), svg::FORMAT, &options()).unwrap().notes;
        assert!(notes[0].contains(&format!("no unit; {inch} of its units")), "{notes:?}");
    }
}

/// Outlines that an SVG hides are left out, and the notes say so.
#[test]
fn what_an_svg_hides_is_left_out() {
    for (also, note) in [
        ("opacity='0'", "hidden elements, left out: 1"),
        ("style='opacity:0%'", "hidden elements, left out: 1"),
        ("style='/* : */ DISPLAY : NONE !important'", "hidden elements, left out: 1"),
        ("fill-opacity='0'", "neither fill nor stroke"),
        ("fill='none'", "neither fill nor stroke"),
        ("fill='#fff0' stroke='red' stroke-opacity='0'", "neither fill nor stroke"),
        ("style='fill:transparent;stroke:red;stroke-width:0'", "neither fill nor stroke"),
        ("requiredExtensions='a'", "hidden elements, left out: 1"),
    ] {
        for body in [square(50.0, also), format!("<g {also}>{}</g>", square(50.0, ""))] {
            let found = svg(&(square(10.0, "") + &body)).unwrap();
            assert_eq!(found.region.area().round(), 100.0, "{body}");
            assert!(found.notes.join("").contains(note), "{body}: {:?}", found.notes);
        }
    }
    for also in [
        "opacity='0.1'",
        "fill='none' stroke='black'",
        "fill='url(#a)'",
        "style='display:inline' display='none'",
    ] {
        assert_eq!(svg(&square(10.0, also)).unwrap().region.area().round(), 100.0, "{also}");
    }
    // Elements of others, and all of a <switch> but the first that applies.
    let drawn = square(10.0, "");
    let other = format!("<o:g xmlns:o='urn:other'>{}</o:g>", square(50.0, ""));
    let switch =
        format!("<switch><foreignObject requiredExtensions='a'/><g>{drawn}</g>{}</switch>", square(50.0, ""));
    for body in [format!("{drawn}{other}"), switch] {
        assert_eq!(svg(&body).unwrap().region.area().round(), 100.0, "{body}");
    }
}

#[test]
fn a_transform_is_about_its_origin() {
    // One unit is half a millimetre, and the page is 50 mm high.
    let about = |also: &str| svg(&square(50.0, also)).unwrap().region.bounds().unwrap();
    let half = 10.0 * 0.5f64.sqrt();
    for also in [
        "transform='rotate(45)' transform-origin='60 20'",
        "transform='rotate(45)' style='transform-origin: 60px 20px'",
        "transform='translate(60 20) rotate(45) translate(-60 -20)'",
    ] {
        let [lo, hi] = about(also);
        assert!((lo - Point2::new(30.0 - half, 40.0 - half)).norm() < 1e-9, "{also}: {lo}");
        assert!((hi - Point2::new(30.0 + half, 40.0 + half)).norm() < 1e-9, "{also}: {hi}");
    }
    assert_eq!(about("transform-origin='center'"), about(""));
}

/// Shapes that are seen otherwise than they are written are refused with element, line and cure.
#[test]
fn what_changes_an_svg_and_is_not_read_is_refused() {
    let says = |body: &str, words: &[&str]| {
        let text = svg(&format!("{}\n{body}", square(10.0, ""))).unwrap_err().to_string();
        assert!(words.iter().all(|w| text.contains(w)), "{body}: {text}");
    };
    for (also, word) in [
        ("clip-path='url(#c)'", "`clip-path`"),
        ("style='clip-path:inset(0 5px 0 0)'", "`clip-path`"),
        ("mask='url(#c)'", "`mask`"),
        ("style='filter: drop-shadow(1px 2px 3px red)'", "`filter`"),
        ("systemLanguage='de'", "`systemLanguage`"),
    ] {
        says(&square(50.0, also), &["line 2", "rect", word]);
        says(&format!("<g id='a' {also}>{}</g>", square(50.0, "")), &["line 2", "g \"a\"", word]);
    }
    for (also, word) in [
        ("style='translate:9px'", "`translate`"),
        ("style='offset-path:ray(0deg)'", "`offset-path`"),
        ("style='animation:a 2s'", "`animation`"),
        ("transform='rotate(9)' transform-origin='center'", "two numbers"),
        ("transform='rotate(9)' transform-box='fill-box'", "`transform-box`"),
        ("opacity='var(--a)'", "not a number"),
        ("display='var(--a)'", "write a word"),
    ] {
        says(&square(50.0, also), &["line 2", "rect", word]);
    }
    says(&format!("<switch><g systemLanguage='xx'>{}</g></switch>", square(50.0, "")), &["`systemLanguage`"]);
    says("<rect width='9' height='9'><animate attributeName='x' to='70'/></rect>", &["rect", "<animate>"]);
    says("<g><set attributeName='display' to='none'/><rect width='9' height='9'/></g>", &["<set>"]);
    says("<set href='#a' attributeName='display' to='none'/>", &["another element"]);
    for rule in [
        "opacity:0",
        "clip-path:none;mask:url(#a)",
        "filter:blur(9px)",
        "fill:none;stroke:none",
        "transform-origin:5px 5px",
    ] {
        says(&format!("<g display='none'><style>.a{{{rule}}}</style></g>"), &["style", "presentation"]);
    }
    let page = |also: &str, scale| {
        let text = format!("<svg width='100mm' viewBox='0 0 200 100' {also}>{}</svg>", square(10.0, ""));
        parse(text.as_bytes(), svg::FORMAT, &OutlineOptions { scale, ..options() })
    };
    for (also, word) in [
        ("transform='rotate(9)'", "`transform`"),
        ("style='width:50mm'", "`width`"),
        ("clip-path='url(#c)'", "`clip-path`"),
        ("display='none'", "hidden"),
    ] {
        assert!(page(also, None).unwrap_err().to_string().contains(word), "{also}");
    }
    assert!(page("style='width:50mm'", Some(0.5)).is_ok() && page("style='width:100%'", None).is_ok());
    let wanted = OutlineOptions { layer: Some("cut".into()), ..options() };
    let hidden = format!("<svg><g opacity='0'><g id='cut'>{}</g></g></svg>", square(10.0, ""));
    let error = parse(hidden.as_bytes(), svg::FORMAT, &wanted).unwrap_err().to_string();
    assert!(error.contains("g \"cut\": it is hidden"), "{error}");
    // What is not of the wanted layer may be clipped.
    let other = format!("<svg><g id='cut'>{0}</g><g clip-path='url(#c)'>{0}</g></svg>", square(10.0, ""));
    assert!(parse(other.as_bytes(), svg::FORMAT, &wanted).is_ok());
}

#[test]
fn markers_are_named() {
    let notes = svg(&square(10.0, "style='marker-mid:url(#m)'")).unwrap().notes;
    assert!(notes.iter().any(|note| note.contains("1 <marker> left out")), "{notes:?}");
}

const SQUARE: &str = "90 4 70 1 10 0 20 0 10 10 20 0 10 10 20 10 10 0 20 10";

fn with_layers(entities: &str) -> String {
    let layers = "0 TABLE 2 LAYER 70 3 0 LAYER 2 0 70 0 62 7 0 LAYER 2 Frozen 70 1 62 7 0 LAYER 2 off 70 4 62 -7 0 ENDTAB";
    let text = format!("0 SECTION 2 TABLES {layers} 0 ENDSEC 0 SECTION 2 ENTITIES {entities} 0 ENDSEC 0 EOF");
    text.split_whitespace().collect::<Vec<_>>().join("\n")
}

/// What a DXF does not show is left out, inserted blocks among it, and the notes say how much.
#[test]
fn what_a_dxf_hides_is_left_out() {
    let hidden = "0 CIRCLE 8 0 60 1 10 40 20 0 40 5 0 CIRCLE 8 FROZEN 10 40 20 0 40 5 0 INSERT 8 off 2 a 0 CIRCLE 8 off 10 4 20 0 40 5";
    let text = with_layers(&format!("0 LWPOLYLINE 8 0 {SQUARE} {hidden}"));
    let read = |text: &str, layer: Option<&str>| {
        parse(text.as_bytes(), dxf::FORMAT, &OutlineOptions { layer: layer.map(str::to_owned), ..options() })
    };
    let found = read(&text, None).unwrap();
    assert_eq!(found.region.area(), 100.0);
    let notes = found.notes.join("\n");
    assert!(
        notes.contains("invisible entities, left out: 1") && notes.contains("off, left out: 3"),
        "{notes}"
    );
    let refused = read(&text, Some("Off")).unwrap_err().to_string();
    assert!(refused.contains("\"Off\" is frozen or off"), "{refused}");
    let none = read(&with_layers("0 CIRCLE 8 0 60 1 10 40 20 0 40 5"), None).unwrap_err().to_string();
    assert!(none.contains("no outlines; invisible entities, left out: 1"), "{none}");
}

/// What a block holds is on its own layers, and on layer 0 it is on that of the INSERT: an INSERT of any
/// layer is refused where its block shows something on the wanted one, and left out where not.
#[test]
fn blocks_are_refused_by_what_they_hold_on_the_wanted_layer() {
    let circle = |layer: &str| format!("0 CIRCLE 8 {layer} 10 0 20 0 40 3");
    let block = |name: &str, holds: &str| format!("0 BLOCK 8 0 2 {name} 70 0 {holds} 0 ENDBLK 8 0");
    let blocks = [
        block("boss", &circle("cut")),
        block("plain", &circle("0")),
        block("other", &circle("marks")),
        block("outer", "0 INSERT 8 0 2 BOSS 0 INSERT 8 marks 2 Outer"),
        block("carrier", "0 INSERT 8 0 2 plain"),
        block("unseen", "0 CIRCLE 8 cut 60 1 10 0 20 0 40 3"),
    ];
    let read = |insert: &str| {
        let entities = format!("0 LWPOLYLINE 8 cut {SQUARE} {insert}");
        let text = with_layers(&entities);
        let blocks = format!("0\nSECTION\n2\nBLOCKS\n{}\n0\nENDSEC\n", blocks.join(" ").replace(' ', "\n"));
        parse(
            (blocks + &text).as_bytes(),
            dxf::FORMAT,
            &OutlineOptions { layer: Some("cut".into()), ..options() },
        )
    };
    for insert in [
        "8 0 2 boss",
        "8 marks 2 BOSS",
        "8 off 2 boss",
        "8 0 2 outer",
        "8 cut 2 plain",
        "8 cut 2 carrier",
        "8 cut 2 missing",
    ] {
        let refused = read(&format!("0 INSERT {insert}")).unwrap_err().to_string();
        assert!(refused.contains("INSERT") && refused.contains("explode"), "{insert}: {refused}");
    }
    for insert in [
        "8 0 2 plain",
        "8 cut 2 other",
        "8 marks 2 carrier",
        "8 0 2 unseen",
        "8 Frozen 2 boss",
        "8 0 60 1 2 boss",
        "8 0 67 1 2 boss",
        "8 0 2 missing",
    ] {
        assert_eq!(read(&format!("0 INSERT {insert}")).unwrap().region.area(), 100.0, "{insert}");
    }
    let refused = read("0 INSERT 8 0 2 outer").unwrap_err().to_string();
    assert!(refused.contains("has CIRCLE (line 13) on the layer \"cut\""), "{refused}");
}

#[test]
fn outlines_that_are_not_level_are_refused_or_told() {
    for entity in [
        "0 LINE 8 0 10 0 20 0 30 0 11 10 21 0 31 3",
        "0 LINE 8 0 10 0 20 0 30 3 11 10 21 0",
        "0 SPLINE 8 0 71 1 40 0 40 0 40 1 40 1 10 0 20 0 30 0 10 8 20 5 30 2",
        "0 ELLIPSE 8 0 10 0 20 0 11 20 21 0 31 1 40 0.5",
        "0 POLYLINE 8 0 70 1 0 VERTEX 10 0 20 0 30 0 0 VERTEX 10 9 20 0 30 1 0 VERTEX 10 9 20 9 30 0 0 SEQEND",
    ] {
        let refused = from_dxf(entity).unwrap_err().to_string();
        assert!(refused.contains("line 15") && refused.contains("one height"), "{entity}: {refused}");
    }
    let level = |z: f64| format!("0 LWPOLYLINE 8 0 38 {z} {SQUARE} 0 CIRCLE 8 0 10 5 20 5 30 -5 230 -1 40 1");
    assert!(from_dxf(&level(5.0)).is_ok());
    let notes = from_dxf(&level(2.0).replace("230 -1 ", "")).unwrap().notes;
    assert!(notes.join("").contains("from z -5 to 2"), "{notes:?}");
}

/// The bound of an outline holds what its chords are off the curves, in mm whatever the unit, and the gaps
/// that were closed.
#[test]
fn outlines_have_a_bound_of_what_they_are_off_the_drawing() {
    let of = |outlines: Result<Outlines, OutlineError>| outlines.unwrap().off_curves;
    assert_eq!(of(svg(&square(10.0, ""))), 0.0);
    let island = svg("<rect width='100' height='90'/><circle cx='50' cy='50' r='40'/>").unwrap();
    let sagitta = |region: &Region| {
        let chords = region.curves().find(|curve| curve.len() > 4).unwrap();
        20.0 - (nalgebra::center(&chords[0], &chords[1]) - Point2::new(25.0, 25.0)).norm()
    };
    assert!((sagitta(&island.region) - island.off_curves).abs() < 1e-12 && island.off_curves > 5e-4);
    let inches = dxf("0 CIRCLE 8 0 10 0 20 0 40 2").replace("$INSUNITS\n70\n4", "$INSUNITS\n70\n1");
    let off = of(parse(inches.as_bytes(), dxf::FORMAT, &options()));
    assert!(off > 5e-4 && off <= 1e-3, "{off}");
    let gap = "0 LINE 8 0 10 0 20 0 11 20 21 0 0 LINE 8 0 10 20 20 0.004 11 20 21 9 0 LINE 8 0 10 20 20 9 11 0 21 0.003";
    assert!((of(from_dxf(gap)) - 0.004).abs() < 1e-12);
}

proptest! {
    /// Mutated drawings are read or refused, never a panic.
    #[test]
    fn mutated_drawings_never_panic(at in 0..4000usize, byte: u8, cut in 0..4000usize, which in 0..2usize) {
        let drawing = [
            dxf("0 LWPOLYLINE 8 0 90 4 70 1 10 0 20 0 10 20 20 0 42 1 10 20 20 20 10 0 20 20 42 1 0 SPLINE 8 0 71 1 40 0 40 0 40 1 40 2 40 2 10 5 20 5 10 8 20 5 10 8 20 8 0 LINE 10 8 20 8 11 5 21 5"),
            "<svg width='9mm' viewBox='0 0 9 9'><g transform='scale(2)'><path d='M1 1 C 2 3 4 5 6 7 A 1 2 3 0 1 4 5 Q 1 2 3 4 T 5 6 z'/><rect width='3' height='4' rx='1'/></g></svg>".to_owned(),
        ];
        let format = [dxf::FORMAT, svg::FORMAT][which];
        let mut bytes = drawing[which].clone().into_bytes();
        let n = bytes.len();
        bytes[at % n] = byte;
        let _ = parse(&bytes, format, &options());
        bytes.truncate(cut % n);
        let _ = parse(&bytes, format, &options());
    }
}
