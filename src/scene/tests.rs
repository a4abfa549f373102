//! Scenes that are read, and scenes that are refused with place and cure.

use cutter::Cutter;
use proptest::prelude::*;

use std::sync::Arc;

use super::*;
use field::mesh::Sense;
use field::{KnotRule, Solver};
use geometry::Point2;
use toolpath::{
    Along, FeedDirection, FrontStart, IsoParametric, IsoScallop, LevelSteps, Lines, Objective,
    ShortestStreamline, Spiral, Strategy, StreamMethod, Streamline, Waterline, Zigzag, ZigzagAngle,
};

const VALID: &str = r#"
title = "Wave, zigzag against streamlines"
[part]
surface = "wave"
amplitude = 2.0
wavelength_x = 40
x = [0, 60.0]
y = [0.0, 40.0]
[cutter]
shape = "ball"
diameter = 6.0
[tolerance]
scallop = 0.010
gouge = 0.005
[[toolpath]]
strategy = "zigzag"
angle = 30
[[toolpath]]
strategy = "zigzag"
name = "Zigzag by stepover"
stepover = 0.3
one_way = true
[[toolpath]]
strategy = "iso-parametric"
along = "v"
scallop = 0.02
[[toolpath]]
strategy = "streamline"
direction = { angle = 12.5 }
"#;

fn refused(text: &str) -> (String, String, (usize, usize)) {
    match Scene::parse("folder/wave.toml", text) {
        Ok(scene) => panic!("accepted: {scene:?}"),
        Err(SceneError::Invalid(finding)) => {
            let source = SceneText::new("", text);
            (finding.message.clone(), finding.cure.clone(), source.line_and_column(finding.at.offset()))
        }
        Err(other) => panic!("{other}"),
    }
}

/// The valid scene with one piece of text replaced, which must be there.
fn with(old: &str, new: &str) -> String {
    assert!(VALID.contains(old), "{old}");
    VALID.replacen(old, new, 1)
}

#[test]
fn a_scene_becomes_typed_values_in_mm_and_rad() {
    let scene = Scene::parse("folder/wave.toml", VALID).unwrap();
    assert_eq!(scene.title, "Wave, zigzag against streamlines");
    assert_eq!((scene.tooling.cutter.is_ball(), scene.tooling.cutter.radius()), (true, 3.0));
    assert_eq!(scene.tolerance, Limits { scallop: 0.010, gouge: 0.005, uncut: 0.050, chord: 0.001 });
    assert_eq!((scene.simulation.cell, scene.simulation.cell_is_auto), (0.05, true));
    assert_eq!(scene.simulation.memory_mib, 2048);
    let [a, b, c, d] = &scene.toolpaths[..] else { panic!() };
    assert_eq!(a.strategy.downcast_ref(), Some(&Zigzag::at(30f64.to_radians())));
    assert_eq!((a.name.as_str(), a.step), ("zigzag", Step::Scallop(0.010)));
    assert_eq!((b.folder.as_str(), b.step), ("zigzag-by-stepover", Step::Stepover(0.3)));
    assert_eq!(c.strategy.downcast_ref(), Some(&IsoParametric::along(Along::V)));
    assert_eq!(c.step, Step::Scallop(0.02));
    let direction = FeedDirection::Angle(12.5f64.to_radians());
    assert_eq!(d.strategy.downcast_ref(), Some(&Streamline::along(direction)));
}

#[test]
fn classical_strategies_are_read_and_written_back() {
    let line = FrontStart::Line([[0.5, 0.0], [0.25, 1.0]]);
    fn boxed(strategy: impl Strategy) -> Box<dyn Strategy> {
        Box::new(strategy)
    }
    let steps = |along, steps| boxed(IsoParametric { along, steps });
    let start = |start| boxed(IsoScallop { start });
    let cases = [
        (
            "zigzag\"\nangle = \"best\"\none_way = true",
            boxed(Zigzag { angle: ZigzagAngle::Best, one_way: true, ..Zigzag::at(0.0) }),
        ),
        ("zigzag\"\nstep = \"constant\"", boxed(Zigzag { steps: LevelSteps::Constant, ..Zigzag::at(0.0) })),
        ("iso-parametric\"\nstep = \"shortest\"", steps(Some(Along::U), LevelSteps::Shortest)),
        ("iso-parametric\"\nalong = \"best\"", steps(None, LevelSteps::Shortest)),
        ("iso-parametric\"\nalong = \"v\"\nstep = \"least\"", steps(Some(Along::V), LevelSteps::Least)),
        ("iso-scallop\"", start(FrontStart::BestBorder)),
        ("iso-scallop\"\nstart = \"all\"", start(FrontStart::AllBorders)),
        (
            "iso-scallop\"\nstart = \"v-max\"",
            start(FrontStart::Border { constant: Along::V, greatest: true }),
        ),
        ("iso-scallop\"\nstart = { from_u = 0.5, from_v = 0, to_u = 0.25, to_v = 1 }", start(line)),
        ("waterline\"", boxed(Waterline { steps: LevelSteps::Shortest })),
        ("waterline\"\nstep = \"constant\"", boxed(Waterline { steps: LevelSteps::Constant })),
        ("spiral\"", boxed(Spiral::Plan)),
        (
            "streamline\"\ndirection = \"shortest\"",
            boxed(ShortestStreamline { toward: None, objective: Objective::Time }),
        ),
        (
            "streamline\"\nobjective = \"length\"",
            boxed(ShortestStreamline { toward: None, objective: Objective::Length }),
        ),
        (
            "streamline\"\ndirection = \"contour\"\nfollow = 1.5",
            boxed(ShortestStreamline {
                toward: Some((FeedDirection::Contour, 1.5)),
                objective: Objective::Length,
            }),
        ),
        ("spiral\"\nkind = \"contour\"", boxed(Spiral::Contour)),
        (
            "streamline\"\ndirection = \"steepest\"\nlines = \"rk4\"",
            boxed(Streamline { lines: Lines::RungeKutta, ..Streamline::along(FeedDirection::Steepest) }),
        ),
    ];
    let head = &VALID[..VALID.find("[[toolpath]]").unwrap()];
    for (text, strategy) in cases {
        let scene = Scene::parse("wave.toml", format!("{head}[[toolpath]]\nstrategy = \"{text}\n")).unwrap();
        assert!(*scene.toolpaths[0].strategy == *strategy, "{text}");
        let again = Scene::parse("wave.toml", complete_toml(&scene)).unwrap();
        assert_eq!(again.toolpaths, scene.toolpaths, "{text}");
    }
    let refuse = |text: &str| refused(&format!("{head}[[toolpath]]\nstrategy = \"{text}\n")).0;
    assert!(refuse("zigzag\"\nangle = \"bets\"").contains("`angle`"));
    assert!(refuse("spiral\"\nangle = 3").contains("does not apply"));
    assert!(refuse("waterline\"\nstep = \"least\"").contains("cannot be \"least\""));
    let point = "iso-scallop\"\nstart = { from_u = 0.5, from_v = 0.5, to_u = 0.5, to_v = 0.5 }";
    assert!(refuse(point).contains("same place"));
    assert!(refuse("iso-scallop\"\nstart = { from_u = 2 }").contains("from_u"));
    // Traced lines follow a function that is fitted to directions, and `follow` or an objective find another.
    for keys in ["follow = 10\ndirection = \"u\"", "objective = \"time\"\ndirection = \"u\""] {
        assert!(refuse(&format!("streamline\"\n{keys}\nlines = \"rk4\"")).contains("does not a"), "{keys}");
    }
}

#[test]
fn files_are_looked_for_beside_the_scene() {
    let text = "[part]\nfile = \"a/wave.STL\"\nunit = \"inch\"\n[cutter]\nshape=\"flat\"\ndiameter=6\n[[toolpath]]\nstrategy=\"zigzag\"";
    let scene = Scene::parse("folder/wave.toml", text).unwrap();
    let PartSource::Mesh(MeshFile { file, format, scale, .. }) = &scene.part else { panic!() };
    assert_eq!(file.path, std::path::Path::new("folder").join("a/wave.STL"));
    assert_eq!((format.word, *scale), ("STL", 25.4));
    assert_eq!(scene.title, "wave", "the file's name is the title by default");
}

#[test]
fn the_complete_scene_reads_back_as_itself() {
    let taper = with(
        "shape = \"ball\"\ndiameter = 6.0",
        "shape = \"taper\"\ntip_diameter = 2\nhalf_angle = 7.3\nshank_diameter = 6",
    );
    let surfaces = [
        "plane\"\nheight = 1",
        "inclined_plane\"\nangle = 20\nazimuth = 77",
        "cylinder\"\nradius = 900\nconcave = true",
        "sphere\"\nradius = 900",
        "saddle\"\nradius_concave = 400\nradius_convex = 500",
        "pit_and_crest\"\nscale = 2",
        "wave\"\namplitude = 2\nwavelength_x = 40\nwavelength_y = 33.3",
    ];
    let formula = "wave\"\namplitude = 2.0\nwavelength_x = 40";
    let apt = |words: &str| with("shape = \"ball\"\ndiameter = 6.0", &format!("shape = \"apt\"\n{words}"));
    let tangent = apt("diameter = 4\ncorner_radius = 0.8\ntip_angle = 12\nside_angle = 20\nlength = 3.4");
    let barrel = apt("diameter = 6\ncorner_radius = 20\ncorner_z = 6\nlength = 8");
    let drill = apt("diameter = 6\ntip_angle = 31\nlength = 30");
    let all = surfaces.iter().map(|s| with(formula, s));
    let sections = "[[holder.section]]\ndiameter = 6\nlength = 12\n[[holder.section]]\ndiameter = 27\ntop_diameter = 32\nlength = 30";
    let held = with("[tolerance]", &format!("[holder]\ncutting_length = 9.5\n{sections}\n[tolerance]"));
    let roughed =
        with("[tolerance]", "[stock]\nroughed = 0.25\n[simulation]\nengine = \"voxel\"\n[tolerance]");
    let blended = with("[tolerance]", "[machine]\nblending = \"arcs\"\n[tolerance]");
    let stock = |keys: &str| with("[tolerance]", &format!("[stock]\n{keys}\n[tolerance]"));
    let block = stock("corners = [[1, 2, 3], [-40, 20, -5]]");
    let bar = stock("diameter = 40\nlength = 60\nfrom = [-30, 0, -10]\naxis = \"x\"");
    let casting = stock("file = \"casting.stl\"\nunit = \"inch\"");
    let ground = with("stepover = 0.3", "stepover = 0.3\nslope = [0, 37.5]");
    let all = all.chain([
        VALID.to_owned(),
        ground,
        taper,
        tangent,
        barrel,
        drill,
        held,
        roughed,
        blended,
        block,
        bar,
        casting,
    ]);
    for text in all {
        let first = Scene::parse("wave.toml", text).unwrap();
        let complete = complete_toml(&first);
        let second =
            Scene::parse("wave.toml", complete.clone()).unwrap_or_else(|e| panic!("{e}\n{complete}"));
        assert_eq!(complete_toml(&second), complete);
        assert_eq!(second.tooling, first.tooling);
        // The place of a file's name in the text is another one.
        if first.stock.file().is_none() {
            assert_eq!(second.stock, first.stock);
        }
        assert_eq!(second.simulation.engine, first.simulation.engine);
        assert_eq!(second.tolerance, first.tolerance);
        assert_eq!(second.toolpaths, first.toolpaths);
        assert_eq!(second.part, first.part);
    }
}

#[test]
fn words_of_a_cutter_are_refused_where_they_stand() {
    let words = "diameter = 6\ncorner_radius = 1\nlength = 8";
    let cases = [
        ("tip_angle = -5", "hollow", "tip_angle"),
        ("side_angle = -3", "undercut", "side_angle"),
        ("tip_angle = 50\nside_angle = 60", "steeper than the side", "tip_angle"),
        ("corner_z = 1.4", "above the bottom", "corner_z"),
        ("corner_x = 1.5\ncorner_z = 0.9", "inside of the side", "corner_x"),
        ("corner_x = 3.5\ncorner_z = 0.1", "beyond bottom and side", "corner_x"),
    ];
    for (edit, reason, key) in cases {
        let text = with("shape = \"ball\"\ndiameter = 6.0", &format!("shape = \"apt\"\n{words}\n{edit}"));
        let (message, cure, (line, _)) = refused(&text);
        assert!(message.contains(reason) && cure.starts_with(&format!("`{key}`: ")), "{message} {cure}");
        assert!(text.lines().nth(line - 1).unwrap().starts_with(key), "{line}");
    }
    let text = with(
        "shape = \"ball\"\ndiameter = 6.0",
        "shape = \"apt\"\ndiameter = 6\ncorner_radius = 1\nlength = 0.5",
    );
    assert!(refused(&text).1.contains("at least 1 mm"), "{:?}", refused(&text));
}

#[test]
fn a_holder_is_read_and_refused_where_it_stands() {
    let held = |text: &str| with("[tolerance]", &format!("[holder]\n{text}\n[tolerance]"));
    let section = "[[holder.section]]\ndiameter = 27\nlength = 30";
    let scene = Scene::parse("wave.toml", held(&format!("cutting_length = 9\n{section}"))).unwrap();
    let holder = scene.tooling.holder.unwrap();
    assert_eq!((holder.cutting_length(), holder.sections().len()), (9.0, 1));
    assert_eq!(holder.sections()[0].top_diameter, 27.0);
    assert!(Scene::parse("wave.toml", VALID).unwrap().tooling.holder.is_none());
    let cases = [
        (held("cutting_length = 9"), "the holder has no section"),
        (held(section), "[holder] has no `cutting_length`"),
        (held(&format!("cutting_length = 2\n{section}")), "below the cutter's full radius"),
        (held(&format!("cutting_length = 9\n{section}\ncone = 3")), "unknown key `cone`"),
        (held("cutting_length = 9\n[[holder.section]]\ndiameter = 27"), "has no `length`"),
        (held("length = 9"), "unknown key `length`"),
    ];
    for (text, expected) in cases {
        let (message, ..) = refused(&text);
        assert!(message.contains(expected), "{message}");
    }
}

#[test]
fn misspelt_words_are_answered_with_the_nearest_valid_one() {
    let (message, cure, place) = refused(&with("diameter = 6.0", "diametr = 6.0"));
    assert_eq!(message, "unknown key `diametr` in [cutter]");
    assert!(cure.starts_with("did you mean `diameter`?"), "{cure}");
    assert_eq!(place, (11, 1));
    let (message, cure, place) = refused(&with("strategy = \"streamline\"", "strategy = \"stream-line\""));
    assert_eq!(message, "`strategy` in [[toolpath]] number 4 cannot be \"stream-line\"");
    assert!(cure.starts_with("did you mean `streamline`?"), "{cure}");
    assert_eq!(place, (28, 12));
    let (_, cure, _) = refused(&with("[tolerance]", "[tolerances]"));
    assert!(cure.starts_with("did you mean `tolerance`?"), "{cure}");
    let (message, cure, _) = refused(&with("strategy = \"zigzag\"", "stratgy = \"zigzag\""));
    assert_eq!(message, "unknown key `stratgy` in [[toolpath]] number 1");
    assert!(cure.contains("`strategy`"), "{cure}");
    let (message, cure, _) = refused(&with("[tolerance]", "[machine]\nfeed_rate = 900\n[tolerance]"));
    assert_eq!(message, "the key `feed_rate` does not apply to [machine]");
    assert_eq!(cure, "write `feed_rate` in [cutter]");
}

#[test]
fn keys_apply_to_their_own_strategy_surface_and_shape() {
    let cases = [
        (
            with("along = \"v\"", "angle = 30"),
            "the key `angle` does not apply to strategy = \"iso-parametric\"",
        ),
        (with("wavelength_x", "radius"), "the key `radius` does not apply to surface = \"wave\""),
        (
            with("diameter = 6.0", "diameter = 6.0\ncorner_radius = 1"),
            "the key `corner_radius` does not apply to shape = \"ball\"",
        ),
        (
            with("surface = \"wave\"", "file = \"wave.stl\""),
            "the key `amplitude` does not apply to a part from a mesh file (it has no `surface`)",
        ),
    ];
    for (text, expected) in cases {
        assert_eq!(refused(&text).0, expected);
    }
}

#[test]
fn numbers_out_of_range_are_refused_where_they_stand() {
    for value in ["0", "-1", "nan", "inf", "-inf", "0.0", "1e99", "-nan", "1e-9"] {
        let (message, _, place) = refused(&with("scallop = 0.010", &format!("scallop = {value}")));
        assert!(message.starts_with("`scallop` in [tolerance] is "), "{message}");
        assert_eq!(place, (13, 11), "{value}");
        refused(&with("diameter = 6.0", &format!("diameter = {value}")));
        refused(&with("stepover = 0.3", &format!("stepover = {value}")));
    }
    let (message, _, _) = refused(&with("diameter = 6.0", "diameter = \"6\""));
    assert_eq!(message, "`diameter` in [cutter]: expected a number in mm (1e-6 to 10000), found a string");
    let (message, _, _) = refused(&with("x = [0, 60.0]", "x = [60, 0]"));
    assert_eq!(message, "`x` in [part] must run from a lesser to a greater number");
    refused(&with("x = [0, 60.0]", "x = [0, nan]"));
    refused(&with("x = [0, 60.0]", "x = [0]"));
    let (message, ..) = refused(&with("direction = { angle = 12.5 }", "control_points = 4.5"));
    assert_eq!(message, "`control_points` in [[toolpath]] number 4 is 4.5; expected a whole number");
    for slope in ["[45, 45]", "[60, 30]", "[-1, 45]", "[0, 91]", "[0]", "45"] {
        let (message, cure, _) =
            refused(&with("stepover = 0.3", &format!("stepover = 0.3\nslope = {slope}")));
        assert!(message.starts_with("`slope` in "), "{message}");
        // What is told as an example is taken.
        if let Some((_, example)) = cure.split_once("such as `") {
            let text = with("stepover = 0.3", &format!("stepover = 0.3\n{}", example.trim_end_matches('`')));
            assert!(Scene::parse("folder/wave.toml", &text).is_ok(), "{cure}");
        }
    }
    let leaning = "stepover = 0.3\nslope = [0, 45]\naxis = \"normal\"";
    assert_eq!(refused(&with("stepover = 0.3", leaning)).0, "`slope` does not apply beside `axis`");
    let (message, cure, _) = refused(&with("stepover = 0.3", "stepover = 7"));
    assert!(message.contains("wider than the cutter's diameter"), "{message} {cure}");
}

#[test]
fn missing_things_are_named_with_an_example() {
    let cases = [
        (with("diameter = 6.0", ""), "[cutter] has no `diameter`", "add `diameter = 6.0`"),
        (with("shape = \"ball\"", ""), "[cutter] has no `shape`", "add `shape = \"ball\"`"),
        (with("amplitude = 2.0", ""), "[part] has no `amplitude`", "add `amplitude = 2.0`"),
        (with("x = [0, 60.0]", ""), "[part] has no `x`", "add `x = [0.0, 100.0]`"),
        (
            VALID.split("[[toolpath]]").next().unwrap().to_owned(),
            "the scene has no toolpath",
            "add a table [[toolpath]] with `strategy = \"zigzag\"`",
        ),
    ];
    for (text, message, cure) in cases {
        let found = refused(&text);
        assert_eq!((found.0.as_str(), found.1.as_str()), (message, cure));
    }
    assert_eq!(refused("").0, "the scene does not say which part to make");
    let no_cutter =
        "[part]\nsurface = \"plane\"\nx = [0, 1]\ny = [0, 1]\n[[toolpath]]\nstrategy = \"zigzag\"";
    assert_eq!(refused(no_cutter).0, "the scene has no [cutter]");
}

#[test]
fn toolpaths_need_names_of_their_own() {
    let (message, _, place) = refused(&with("name = \"Zigzag by stepover\"", ""));
    assert_eq!(message, "two toolpaths are called \"zigzag\"");
    assert_eq!(place.0, 18);
    let (message, ..) = refused(&with("Zigzag by stepover", "ZigZag!"));
    assert_eq!(message, "the toolpaths \"zigzag\" and \"ZigZag!\" would share the folder zigzag");
    let (message, ..) = refused(&with("Zigzag by stepover", "../.."));
    assert_eq!(message, "\"../..\" cannot name a toolpath");
    let (message, ..) = refused(&with("stepover = 0.3", "stepover = 0.3\nscallop = 0.1"));
    assert_eq!(message, "a toolpath has either `stepover` or `scallop`");
}

#[test]
fn a_file_that_is_not_there_is_reported_at_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.toml");
    std::fs::write(&path, "[part]\nfile = \"none.stl\"\n[cutter]\nshape=\"flat\"\ndiameter=6\n[[toolpath]]\nstrategy=\"zigzag\"").unwrap();
    let Err(SceneError::Invalid(finding)) = Scene::read(&path) else { panic!() };
    assert!(finding.message.starts_with("cannot read the part's file "), "{}", finding.message);
    assert_eq!(finding.at.offset(), 14);
    assert!(matches!(Scene::read(&folder.path().join("no.toml")), Err(SceneError::Unreadable { .. })));
    assert!(matches!(Scene::read(folder.path()), Err(SceneError::Unreadable { .. })));
    std::fs::write(&path, b"title = \"\xff\"").unwrap();
    let Err(SceneError::Unreadable { reason, .. }) = Scene::read(&path) else { panic!() };
    assert_eq!(reason, "line 1 is not UTF-8 text");
}

/// The nose of a tool of 150 mm goes to the machine's zero, 400 mm above that of the part.
#[test]
fn machine_coordinates_of_a_program_count_from_the_machine_s_zero() {
    let home = tempfile::tempdir().unwrap();
    let ends = |machine: &str, tools: &str, length: &str| {
        let path = home.path().join("scene.toml");
        let text = format!(
            "[part]\nsurface = \"plane\"\nx = [0, 9]\ny = [0, 9]\n[cutter]\nshape = \"ball\"\ndiameter = 6\n{machine}\
             [[toolpath]]\nstrategy = \"program\"\nfile = \"a.nc\"\n{tools}"
        );
        std::fs::write(&path, text).unwrap();
        std::fs::write(home.path().join("a.nc"), format!("T1 M6\nG0 X0 Y0 Z10 {length}\nG53 G0 Z0\nM30\n"))
            .unwrap();
        let tool = "[[tool]]\nnumber = 1\nshape = \"ball\"\ndiameter = 6\ngauge_length = 150\n";
        std::fs::write(home.path().join("tools.toml"), tool).unwrap();
        let scene = Scene::read(&path).unwrap();
        let path = &scene.toolpaths[0].foreign().unwrap().path;
        [path.start.tip.z, path.moves[path.len() - 1].to.tip.z]
    };
    let machine = |rest: &str| format!("[machine]\nkinematics = {{ preset = \"ac-table\"{rest} }}\n");
    let known = machine(", gauge_length = 150, workpiece_zero = [5, 0, -400]");
    assert_eq!(ends(&known, "", ""), [200.0, 250.0]);
    assert_eq!(ends(&known, "tools = \"tools.toml\"\n", "G43 H1")[1], 250.0);
    assert_eq!(ends(&machine(""), "", ""), [200.0, 200.0]);
    assert_eq!(ends("", "", ""), [200.0, 200.0]);
}

#[test]
fn the_auto_cell_is_a_round_number() {
    let of = |cutter: Cutter, step: Step| {
        let mut requests = Scene::parse("folder/wave.toml", VALID).unwrap().toolpaths;
        requests.truncate(1);
        (requests[0].step, requests[0].tooling.cutter) = (step, cutter);
        auto_cell(&requests)
    };
    let ball = |d: f64| Cutter::ball(d).unwrap();
    let cells = [0.6, 1.0, 6.0, 20.0, 400.0].map(|d| of(ball(d), Step::Scallop(0.01)));
    assert_eq!(cells, [0.01, 0.01, 0.05, 0.1, 0.5]);
    // A wide step leaves the radius to decide, a narrow one decides itself.
    let cells = [100.0, 0.31, 0.05, 1e-9].map(|width| of(ball(6.0), Step::Stepover(width)));
    assert_eq!(cells, [0.1, 0.05, 0.005, 1e-6]);
    let flat = Cutter::flat(6.0).unwrap();
    assert_eq!(of(flat, Step::Scallop(0.01)), 0.05);
    assert_eq!(of(Cutter::bull(6.0, 1.0).unwrap(), Step::Scallop(0.01)), 0.02);
}

#[test]
fn chords_are_a_tenth_of_small_scallops_unless_the_scene_says() {
    let chord = |tolerance: &str| {
        let text = format!(
            "[part]\nsurface = \"plane\"\nx = [0, 8]\ny = [0, 6]\n[cutter]\nshape = \"ball\"\ndiameter = 6\n\
             [tolerance]\n{tolerance}\n[[toolpath]]\nstrategy = \"zigzag\"\n"
        );
        Scene::parse("a.toml", text).unwrap().tolerance.chord
    };
    assert_eq!(
        [chord(""), chord("scallop = 0.1"), chord("scallop = 0.002\nchord = 0.003")],
        [0.001, 0.001, 0.003]
    );
    assert!((chord("scallop = 0.0003") - 0.000_03).abs() < 1e-12);
}

#[test]
fn the_error_bound_is_a_tenth_of_the_least_tolerance_unless_the_scene_says() {
    let text = |tolerance: &str, simulation: &str| {
        format!(
            "[part]\nsurface = \"plane\"\nx = [0, 8]\ny = [0, 6]\n[cutter]\nshape = \"ball\"\ndiameter = 6\n\
             [tolerance]\n{tolerance}\n[simulation]\n{simulation}\n[[toolpath]]\nstrategy = \"zigzag\"\n"
        )
    };
    let near = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-12;
    let bound = |tolerance: &str, simulation: &str| {
        let scene = Scene::parse("a.toml", text(tolerance, simulation)).unwrap();
        let again = Scene::parse("a.toml", complete_toml(&scene)).unwrap();
        assert!(near(scene.simulation.error_bound, again.simulation.error_bound));
        scene.simulation.error_bound
    };
    assert!(near(bound("", ""), 0.0005) && near(bound("scallop = 0.002", ""), 0.0002));
    assert!(near(bound("gouge = 0.1\nuncut = 0.003", ""), 0.0003));
    assert_eq!(bound("scallop = 0.002", "error_bound = 0.004"), 0.004);
    for bad in ["0", "-0.001", "\"small\""] {
        let refused = Scene::parse("a.toml", text("", &format!("error_bound = {bad}")));
        assert!(matches!(refused, Err(SceneError::Invalid(_))), "{bad}");
    }
}

#[test]
fn the_cell_may_be_left_to_the_program() {
    let simulation = |cell: &str| {
        let text = format!(
            "[part]\nsurface = \"plane\"\nx = [0, 8]\ny = [0, 6]\n[cutter]\nshape = \"ball\"\ndiameter = 6\n\
             [simulation]\ncell = {cell}\n[[toolpath]]\nstrategy = \"zigzag\"\n"
        );
        Scene::parse("a.toml", text).map(|scene| (scene.simulation.cell, scene.simulation.cell_is_auto))
    };
    assert_eq!(simulation("\"auto\"").unwrap(), (0.05, true));
    assert_eq!(simulation("0.2").unwrap(), (0.2, false));
    for bad in ["\"fine\"", "true", "0"] {
        assert!(matches!(simulation(bad), Err(SceneError::Invalid(_))), "{bad}");
    }
}

/// The valid scene, its last toolpath with these keys.
fn streamline(keys: &str) -> String {
    with("direction = { angle = 12.5 }", keys)
}

#[test]
fn methods_and_solvers_of_stream_functions_are_read_and_written() {
    let read = |keys: &str| {
        let scene =
            Scene::parse("folder/wave.toml", streamline(keys)).unwrap_or_else(|e| panic!("{keys}: {e}"));
        let complete = complete_toml(&scene);
        let again =
            Scene::parse("folder/wave.toml", complete.clone()).unwrap_or_else(|e| panic!("{e}\n{complete}"));
        assert!(*again.toolpaths[3].strategy == *scene.toolpaths[3].strategy, "{complete}");
        assert_eq!(complete_toml(&again), complete);
        let written = |r: &ToolpathRequest| {
            r.directions.iter().map(|f| (f.written.clone(), f.path.clone())).collect::<Vec<_>>()
        };
        assert_eq!(written(&again.toolpaths[3]), written(&scene.toolpaths[3]));
        let request = scene.toolpaths[3].clone();
        let Some(found) = request.strategy.downcast_ref::<Streamline>() else { panic!("{keys}") };
        (found.method, found.solver, request.directions.first().cloned())
    };
    let spline = |degree, knots| StreamMethod::BSpline { degree, knots };
    let (method, solver, file) = read("degree = 5\nknots = \"curvature\"\nsolver = \"gmres\"");
    assert_eq!((method, solver), (spline(5, KnotRule::Curvature), Solver::Gmres));
    assert!(file.is_none());
    // Whoever names control points asks for the method that has them.
    assert_eq!(read("control_points = 8").0, spline(3, KnotRule::default()));
    assert_eq!(read("method = \"differences\"").0, StreamMethod::Differences);
    assert_eq!(read("method = \"differences\"").1, Solver::ConjugateGradient);
    assert_eq!(read("method = \"differences\"\nsolver = \"cholesky\"").1, Solver::Cholesky);
    for solver in Solver::ALL {
        assert_eq!(read(&format!("control_points = 20\nsolver = \"{}\"", solver.name())).1, solver);
    }
    for (word, rule) in [("uniform", KnotRule::Uniform), ("averaged", KnotRule::Averaged)] {
        assert_eq!(read(&format!("method = \"bspline\"\nknots = \"{word}\"")).0, spline(3, rule));
    }
    let (_, _, file) = read("direction = \"file\"\ndirections = \"flow.txt\"");
    assert_eq!(file.unwrap().path, std::path::Path::new("folder/flow.txt"));
}

#[test]
fn feed_directions_are_read_and_written_back() {
    let guide = |sense| FeedDirection::Guides {
        curves: Arc::new(vec![vec![Point2::new(0.0, 1.0), Point2::new(50.0, 2.5)]]),
        sense,
    };
    let blend = FeedDirection::Blend(vec![
        (FeedDirection::WidestStrip, 2.0),
        (guide(Sense::Across), 1.0),
        (FeedDirection::Angle(30f64.to_radians()), 0.5),
    ]);
    for (keys, direction) in [
        ("direction = \"steepest\"", FeedDirection::Steepest),
        ("direction = \"contour\"", FeedDirection::Contour),
        ("direction = \"guide\"\nguides = [[[0, 1], [50, 2.5]]]", guide(Sense::Along)),
        ("direction = \"guide\"\nguides = [[[0, 1], [50, 2.5]]]\nacross = true", guide(Sense::Across)),
        ("direction = \"border\"", FeedDirection::Border(Sense::Along)),
        ("direction = \"border\"\nacross = true", FeedDirection::Border(Sense::Across)),
        (
            "direction = { blend = [{ direction = \"widest-strip\", weight = 2 }, { direction = \"guide\", \
             guides = [[[0, 1], [50, 2.5]]], across = true }, { direction = { angle = 30 }, weight = 0.5 }] }",
            blend,
        ),
    ] {
        let scene = Scene::parse("wave.toml", streamline(keys)).unwrap_or_else(|e| panic!("{keys}: {e}"));
        let read = scene.toolpaths[3].strategy.downcast_ref::<Streamline>().map(|found| &found.direction);
        assert_eq!(read, Some(&direction), "{keys}");
        let complete = complete_toml(&scene);
        let again = Scene::parse("wave.toml", complete.clone()).unwrap_or_else(|e| panic!("{e}\n{complete}"));
        assert!(*again.toolpaths[3].strategy == *scene.toolpaths[3].strategy, "{complete}");
    }
    let keys = "direction = { blend = [{ direction = \"file\", directions = \"a.txt\" }, { direction = \"file\", \
                directions = \"b.txt\", weight = 3 }] }";
    let scene = Scene::parse("folder/wave.toml", streamline(keys)).unwrap();
    let files: Vec<&str> = scene.toolpaths[3].directions.iter().map(|f| f.written.as_str()).collect();
    assert_eq!(files, ["a.txt", "b.txt"]);
    let again = Scene::parse("folder/wave.toml", complete_toml(&scene)).unwrap();
    let written: Vec<&str> = again.toolpaths[3].directions.iter().map(|f| f.written.as_str()).collect();
    assert_eq!(written, files);
}

#[test]
fn feed_directions_that_say_nothing_are_refused() {
    for (keys, word) in [
        ("direction = \"steepst\"", "cannot be"),
        ("direction = \"guide\"", "no `guides` to follow"),
        ("direction = \"guide\"\nguides = []", "no `guides` to follow"),
        ("direction = \"guide\"\nguides = [[[1, 2], [1, 2]]]", "has no length"),
        ("direction = \"guide\"\nguides = [[[1, 2]]]", "has no length"),
        ("direction = \"guide\"\nguides = [[1, 2]]", "points of two numbers"),
        ("direction = \"guide\"\nguides = [[[1, 2], [3, nan]]]", "a number"),
        ("direction = \"steepest\"\nguides = [[[0, 1], [50, 2]]]", "nothing follows"),
        ("direction = \"contour\"\nacross = true", "a sense of no curve"),
        ("direction = \"border\"\nacross = 1", "true or false"),
        ("direction = \"shortest\"\nacross = true", "a sense of no curve"),
        ("direction = \"shortest\"\nfollow = 1", "does not apply"),
        ("direction = \"u\"\nfollow = 1\nsolver = \"cg\"", "does not apply"),
        ("direction = \"u\"\nfollow = -1", "follow"),
        ("direction = \"shortest\"\nmethod = \"bspline\"", "does not apply"),
        ("direction = { blend = [] }", "two directions or more"),
        ("direction = { blend = [{ direction = \"u\" }] }", "two directions or more"),
        ("direction = { blend = \"u\" }", "a list of tables"),
        ("direction = { blend = [{ direction = \"u\" }, { weight = 2 }] }", "has no `direction`"),
        ("direction = { blend = [{ direction = \"u\" }, { direction = \"shortest\" }] }", "cannot be"),
        ("direction = { blend = [{ direction = \"u\" }, { direction = \"v\", weight = 0 }] }", "a number"),
        (
            "direction = { blend = [{ direction = \"u\" }, { direction = \"v\", wait = 1 }] }",
            "unknown key `wait`",
        ),
        ("direction = { blend = [{ direction = \"u\" }, { direction = \"file\" }] }", "has no `directions`"),
        (
            "direction = { blend = [{ direction = \"u\" }, { direction = { blend = [] } }] }",
            "cannot be blended again",
        ),
        ("direction = { blend = [], angle = 3 }", "does not apply"),
    ] {
        let (message, cure, place) = refused(&streamline(keys));
        assert!(message.contains(word), "{keys}: {message}");
        assert!(!cure.is_empty() && place.0 >= streamline("").lines().count(), "{keys}: {place:?} {cure}");
    }
}

#[test]
fn methods_that_do_not_go_together_are_refused() {
    for (keys, word) in [
        ("method = \"differences\"\ndegree = 3", "belongs to B-splines"),
        ("method = \"differences\"\nknots = \"uniform\"", "belongs to B-splines"),
        ("method = \"differences\"\nsolver = \"qr\"", "no rectangular system"),
        ("method = \"volumes\"", "cannot be"),
        ("method = \"elements\"\ndegree = 3", "does not apply to finite elements"),
        ("method = \"elements\"\ncontrol_points = 8", "does not apply to finite elements"),
        ("degree = 1", "(2 to 5)"),
        ("degree = 6", "(2 to 5)"),
        ("degree = 5\ncontrol_points = 5", "too few for degree 5"),
        ("solver = \"minimum-norm\"\ncontrol_points = 25", "at most 600 coefficients"),
        ("solver = \"lu\"", "cannot be"),
        ("direction = \"file\"", "has no `directions`"),
        ("directions = \"flow.txt\"", "nothing reads"),
        ("direction = \"u\"\ndirections = \"flow.txt\"", "nothing reads"),
    ] {
        let (message, ..) = refused(&streamline(keys));
        assert!(message.contains(word), "{keys}: {message}");
    }
}

/// Any outcome but a panic is right; an error must be printable.
fn survive(text: &str) {
    match Scene::parse("wave.toml", text) {
        Ok(scene) => {
            let complete = complete_toml(&scene);
            let again = Scene::parse("wave.toml", complete.clone());
            assert!(again.is_ok(), "{:?}\n{complete}", again.err());
        }
        Err(error) => {
            let handler =
                miette::GraphicalReportHandler::new_themed(miette::GraphicalTheme::unicode_nocolor());
            let mut out = String::new();
            handler.render_report(&mut out, &error).unwrap();
            assert!(out.contains("wave.toml:"), "{out}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, ..ProptestConfig::default() })]

    #[test]
    fn random_text_never_panics(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
        survive(&String::from_utf8_lossy(&bytes));
    }

    #[test]
    fn mutated_scenes_never_panic(
        cuts in proptest::collection::vec((0usize..VALID.len(), 0usize..12, "[\\PC\n]{0,6}"), 1..4)
    ) {
        let mut text = VALID.to_owned();
        for (at, length, insert) in cuts {
            let from = (0..=at.min(text.len())).rev().find(|k| text.is_char_boundary(*k)).unwrap();
            let to = (from + length..).find(|k| *k >= text.len() || text.is_char_boundary(*k)).unwrap().min(text.len());
            text.replace_range(from..to, &insert);
        }
        survive(&text);
    }
}

#[test]
fn equal_times_make_a_toolpath_for_each_and_are_written_once() {
    let text = |compare: &str, more: &str| {
        format!(
            "[part]\nsurface = \"plane\"\nx = [0, 8]\ny = [0, 6]\n[cutter]\nshape = \"ball\"\ndiameter = 6\n{compare}\n[[toolpath]]\n\
             strategy = \"zigzag\"\n{more}\n[[toolpath]]\nname = \"other\"\nstrategy = \"iso-parametric\"\n"
        )
    };
    let scene = |compare: &str| Scene::parse("a.toml", text(compare, "")).unwrap();
    let of = |scene: &Scene| -> Vec<(String, Option<f64>)> {
        let time = |r: &ToolpathRequest| r.equal_time.as_ref().map(|time| time.minutes);
        scene.toolpaths.iter().map(|r| (r.name.clone(), time(r))).collect()
    };
    let named = |names: &[(&str, Option<f64>)]| -> Vec<(String, Option<f64>)> {
        names.iter().map(|(name, time)| ((*name).to_owned(), *time)).collect()
    };
    assert_eq!(of(&scene("")), named(&[("zigzag", None), ("other", None)]));
    let one = scene("[compare]\nminutes = 2.5");
    assert_eq!(of(&one), named(&[("zigzag", Some(2.5)), ("other", Some(2.5))]));
    assert!(one.toolpaths.iter().all(|request| !request.correct));
    let two = scene("[compare]\nminutes = [2, 2.5]");
    let names = [
        ("zigzag, 2 min", Some(2.0)),
        ("zigzag, 2.5 min", Some(2.5)),
        ("other, 2 min", Some(2.0)),
        ("other, 2.5 min", Some(2.5)),
    ];
    assert_eq!(of(&two), named(&names));
    assert_eq!(two.toolpaths[1].folder, "zigzag-2-5-min");
    for scene in [one, two] {
        let complete = complete_toml(&scene);
        let again = Scene::parse("a.toml", complete.clone()).unwrap();
        assert_eq!((of(&again), complete_toml(&again)), (of(&scene), complete.clone()));
        assert_eq!(complete.matches("[[toolpath]]").count(), 2, "{complete}");
    }
    let compare = "[compare]\nminutes = 2";
    for (compare, more, words) in [
        (compare, "stepover = 0.3", "`stepover` does not apply"),
        (compare, "scallop = 0.3", "`scallop` does not apply"),
        (compare, "correct = true", "`correct` does not apply"),
        (
            compare,
            "[[toolpath]]\nstrategy = \"program\"\nfile = \"a.nc\"",
            "\"program\" is not planned by one",
        ),
        ("[tolerance]\ncorrect = false\n[compare]\nminutes = 2", "", "`correct` does not apply"),
        ("[compare]", "", "no `minutes`"),
        ("[compare]\nminutes = []", "", "0 times"),
        ("[compare]\nminutes = [2, 2]", "", "2 twice"),
        ("[compare]\nminutes = 0", "", "`minutes`"),
        ("[compare]\nminutes = [1, -1]", "", "`minutes`"),
        ("[compare]\nseconds = 2", "", "unknown key `seconds`"),
    ] {
        let refused = Scene::parse("a.toml", text(compare, more)).unwrap_err();
        let SceneError::Invalid(finding) = refused else { panic!("{compare} {more}") };
        assert!(finding.message.contains(words), "{compare} {more}: {}", finding.message);
    }
}

#[test]
fn how_corners_are_blended_is_read_where_it_acts() {
    let of = |machine: &str| {
        Scene::parse("wave.toml", with("[tolerance]", &format!("[machine]\n{machine}\n[tolerance]")))
    };
    assert_eq!(of("blending = \"arcs\"").unwrap().machine.blending, machine::Blending::Arcs);
    assert_eq!(of("kinematics = \"none\"").unwrap().machine.blending, machine::Blending::Full);
    let refused = |machine: &str| of(machine).unwrap_err().to_string();
    assert!(refused("blending = \"arc\"").contains("cannot be"), "{}", refused("blending = \"arc\""));
    let five = "blending = \"arcs\"\nkinematics = { preset = \"ac-table\", gauge_length = 9, workpiece_zero = [0, 0, 0] }";
    assert!(refused(five).contains("rotary axes"), "{}", refused(five));
}

/// A toolpath's own cutter is named by its key there, and not as that of the scene.
#[test]
fn what_is_wrong_with_a_toolpaths_own_cutter_names_it() {
    let own = |cutter: &str| {
        let toolpath = format!(
            "[[toolpath]]\nname = \"rest\"\nstrategy = \"zigzag\"\nstepover = 1\ncutter = {{ {cutter} }}\n"
        );
        let refused = Scene::parse("wave.toml", format!("{VALID}{toolpath}")).unwrap_err();
        let cure = miette::Diagnostic::help(&refused).unwrap().to_string();
        (refused.to_string(), cure)
    };
    let count = VALID.matches("[[toolpath]]").count() + 1;
    let (message, _) = own("shape = \"ball\"");
    assert_eq!(message, format!("[toolpath.cutter] of [[toolpath]] number {count} has no `diameter`"));
    let (message, _) = own("shape = \"ball\", diametr = 4");
    assert!(message.contains(&format!("[toolpath.cutter] of [[toolpath]] number {count}")), "{message}");
    let (_, cure) = own("shape = \"ball\", diameter = 4, feed_rate = 20000");
    assert!(cure.starts_with("write `feed_rate = 15000` in the `cutter` of \"rest\" or less"), "{cure}");
}

/// Where a feed stands in [cutter], it is named there; else the rate of the machine that is below the usual
/// one.
#[test]
fn feeds_beyond_the_rapid_rate_are_refused() {
    let of = |cutter: &str, machine: &str| {
        let text = with("[tolerance]", &format!("{machine}\n[tolerance]"));
        Scene::parse("wave.toml", text.replace("[cutter]", &format!("[cutter]\n{cutter}")))
    };
    for (cutter, machine, words) in [
        ("feed_rate = 20000", "", "`feed_rate` is 20000 mm/min"),
        ("feed_rate = 700\nplunge_rate = 900", "[machine]\nrapid_rate = 800", "`plunge_rate` is 900 mm/min"),
        ("", "[machine]\nrapid_rate = 400", "`rapid_rate` of 400 mm/min"),
    ] {
        let text = of(cutter, machine).unwrap_err().to_string();
        assert!(text.contains(words), "{text}");
    }
    assert!(of("feed_rate = 15000", "").is_ok());
}

#[test]
fn passes_at_an_angle_ride_on_the_offset_along_the_normals_alone() {
    let with = |keys: &str| {
        format!(
            "[part]\nfile = \"a.stl\"\n[cutter]\nshape = \"ball\"\ndiameter = 4\n[[toolpath]]\nstrategy = \"offset-surface\"\n{keys}\n"
        )
    };
    for offset in ["published", "in-plane"] {
        let (message, cure, at) = refused(&with(&format!("angle = 0\noffset = \"{offset}\"")));
        assert!(message.starts_with("passes at an angle ride on"), "{message}");
        assert!(cure.contains("`offset`") && at == (9, 1), "{cure} {at:?}");
    }
    for keys in ["angle = 0", "angle = 0\noffset = \"normal\"", "along = \"u\"\noffset = \"published\""] {
        Scene::parse("folder/wave.toml", with(keys)).unwrap();
    }
}
