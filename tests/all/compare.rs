//! The comparison on eight surfaces (`scenes/compare`): the shortest streamlines against the best zigzag and
//! iso-scallop passes, by what the simulated cut measures.

use std::path::{Path, PathBuf};

use millstream::geometry::{Point3, TriangleMesh};
use serde_json::Value;

use crate::support::{height_mesh, number, patch, run_scene, write_stl};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/compare")
}

const SURFACES: [&str; 8] =
    ["pit_and_crest", "wave", "saddle", "bumps", "twisted", "blade_side", "relief", "joined"];

/// Bumps and hollows as Gaussians: middle, width, height, mm.
fn gaussians(bumps: &[[f64; 4]]) -> impl Fn(f64, f64) -> f64 {
    move |x, y| {
        let bump = |[cx, cy, width, height]: &[f64; 4]| {
            height * (-((x - cx).powi(2) + (y - cy).powi(2)) / (width * width)).exp()
        };
        bumps.iter().map(bump).sum()
    }
}

fn bumps() -> Value {
    let height = gaussians(&[
        [14.0, 14.0, 8.0, 3.2],
        [44.0, 12.0, 7.0, 2.4],
        [30.0, 30.0, 9.0, 3.6],
        [12.0, 44.0, 7.5, -2.2],
        [46.0, 46.0, 8.5, 3.0],
        [47.0, 30.0, 6.0, -1.4],
        [30.0, 50.0, 6.5, 1.6],
        [28.0, 9.0, 6.0, -1.5],
    ]);
    patch([23, 23], |u, v| [60.0 * u, 60.0 * v, height(60.0 * u, 60.0 * v)])
}

/// A saddle between skewed borders, bent along x.
fn twisted() -> Value {
    patch([12, 12], |u, v| {
        let (x, y) = (50.0 * u - 25.0, 50.0 * v - 25.0);
        let z = 0.03 * x * y + 0.01 * x * x - 0.005 * y * y + 0.0002 * x * x * x;
        [x + 2.5 * (0.12 * y).sin(), y + 1.5 * (0.1 * x).cos(), z]
    })
}

/// The upper side of a section, 40 mm long at the root and 30 at the tip, that turns by 25 degrees over a
/// span of 60 mm, from just behind the leading edge.
fn blade_side() -> Value {
    patch([14, 9], |u, v| {
        let chord = 40.0 - 10.0 * v;
        let turn = (-12.0 + 25.0 * v).to_radians();
        let s = 0.04 + 0.96 * u;
        // A section of four digits, thickness and camber both.
        let thickness = 1.48 * s.sqrt() - 0.63 * s - 1.76 * s * s + 1.42 * s * s * s - 0.51 * s.powi(4);
        let z = chord * (0.3 * (1.0 - 0.25 * v) * thickness + 0.22 * s * (1.0 - s));
        let x = chord * (s - 0.4);
        [x * turn.cos(), 60.0 * v, 0.35 * x * turn.sin() + z]
    })
}

/// Wide bumps and hollows, 50 × 50 mm, as an STL mesh with edges of 0.4 mm.
fn relief() -> TriangleMesh {
    height_mesh(
        125,
        [50.0, 50.0],
        gaussians(&[
            [12.0, 14.0, 10.5, 2.1],
            [36.0, 11.0, 9.0, 1.5],
            [39.0, 38.0, 12.0, 2.5],
            [13.0, 38.0, 9.8, -1.5],
            [25.0, 25.0, 9.0, 1.0],
            [46.0, 24.0, 9.0, -0.85],
        ]),
    )
}

/// Each part of a scene is what its generator makes; `MILLSTREAM_BLESS=1` writes them anew.
#[test]
fn parts_are_those_of_their_generators() {
    let bless = std::env::var_os("MILLSTREAM_BLESS").is_some();
    for (name, part) in [("bumps", bumps()), ("twisted", twisted()), ("blade_side", blade_side())] {
        let path = folder().join(name).with_extension("json");
        if bless {
            std::fs::write(&path, part.to_string() + "\n").unwrap();
        }
        let shipped: Value = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
        assert_eq!(shipped, part, "{name}");
    }
    let (path, mesh) = (folder().join("relief.stl"), relief());
    if bless {
        let triangles: Vec<_> = (0..mesh.triangles().len()).map(|t| mesh.corners(t)).collect();
        write_stl(&path, &triangles);
    }
    let (shipped, _) = millstream::io::stl::read(&path).unwrap();
    for t in 0..mesh.triangles().len() {
        let apart = |(a, b): (&millstream::geometry::Point3, &millstream::geometry::Point3)| (a - b).norm();
        assert!(shipped.corners(t).iter().zip(&mesh.corners(t)).map(apart).all(|d| d < 1e-5));
    }
}

/// Whether nothing is left uncut or gouged, at most 1 % of the ridges are over the target and none is above
/// 1.1 times it, no zigzag or iso-scallop path takes less time, all joined alike, and the passes are levels
/// of a stream function, or of a front that is named so and takes no more time than iso-scallop. With a line
/// of the table, and the share of its time that no path like it can do without.
fn quickest_of_all(name: &str, scene: &Path) -> (String, [bool; 6], f64) {
    let (_, report) = run_scene(scene);
    let of = |k: usize, what: &str| number(&report, &format!("/toolpaths/{k}/{what}"));
    let [zigzag, iso_scallop, streamline] = [0, 1, 2].map(|k| of(k, "path/machining_time_s"));
    let over = of(2, "scallop/over_target_fraction");
    let highest = of(2, "scallop/max_mm") / of(2, "scallop/target_mm");
    let planned_as = report.pointer("/toolpaths/2/field/planned_as").unwrap();
    let reached = of(2, "shortest/joined_efficiency");
    let line = format!(
        "{name:<16}{zigzag:7.1}{iso_scallop:13.1}{streamline:12.1}{:9.1}{:8.1} %{:8.1} %{:10.1} %{:8.1} %{highest:9.3}  {planned_as}\n",
        of(2, "shortest/least_time_s"),
        100.0 * of(2, "shortest/time_efficiency"),
        100.0 * reached,
        100.0 * of(2, "shortest/efficiency"),
        100.0 * over,
    );
    let functions = planned_as.as_array().unwrap();
    let is_front = !functions.iter().all(|function| function.as_str().unwrap().starts_with(STREAM_FUNCTION));
    let notes = report.pointer("/toolpaths/2/notes").unwrap().to_string();
    let good = [
        !is_front || notes.contains("the same path as that of iso-scallop"),
        over <= 0.01,
        highest <= 1.1,
        of(2, "uncut/area_mm2") == 0.0,
        of(2, "gouge/max_depth_mm") <= 0.001,
        streamline <= zigzag.min(iso_scallop) + ROUNDED,
    ];
    (line, good, reached)
}

/// What passes are planned as that are levels of a function of their own, and not of a rival's front.
const STREAM_FUNCTION: &str = "stream function";

/// The share of the machining time that is the shortest length at the feed, with the least links of the
/// passes: on all of the eight surfaces, and on some of them, and on how many.
const REACHED: (f64, f64, usize) = (0.92, 0.95, 3);

/// Surfaces of the eight on which no front is as quick as the best stream function.
const LED_BY_STREAM_FUNCTIONS: usize = 6;

/// What the decimals of a program change of a time, s.
const ROUNDED: f64 = 0.02;

/// The path of a temporary file with a scene.
fn written(scene: &str) -> tempfile::TempPath {
    let file = tempfile::Builder::new().suffix(".toml").tempfile().unwrap();
    std::fs::write(file.path(), scene).unwrap();
    file.into_temp_path()
}

/// The text of a scene that can be run from any folder.
fn scene(name: &str) -> String {
    let text = std::fs::read_to_string(folder().join(name).with_extension("toml")).unwrap();
    text.replace("file = \"", &format!("file = \"{}/", folder().display()))
}

/// The middle of the saddle, `half` mm to each side, in coarser cells and as first planned: a correction
/// costs streamlines what their border asks for.
fn small_saddle(half: u32) -> String {
    let scene = scene("saddle").replace("[-20.0, 20.0]", &format!("[-{half}.0, {half}.0]"));
    let scene = scene.replace("cell = 0.1", "cell = 0.2");
    scene.replace("[tolerance]", "[tolerance]\ncorrect = false")
}

#[test]
fn streamlines_are_the_quickest_of_all_on_a_saddle() {
    let (line, good, _) = quickest_of_all("saddle", &written(&small_saddle(10)));
    assert_eq!(good, [true; 6], "{line}");
    assert!(line.contains(STREAM_FUNCTION), "{line}");
}

#[test]
#[ignore = "minutes: eight surfaces, each cut three times"]
fn streamlines_are_the_quickest_of_all_on_eight_surfaces() {
    let mut table = String::from(
        "\ntime, s          zigzag  iso-scallop  streamline    least  reached  joined  of length    over  highest  planned as\n",
    );
    let (mut failed, mut led, mut reached) = (Vec::new(), 0, Vec::new());
    for name in SURFACES {
        let (line, good, share) = quickest_of_all(name, &folder().join(name).with_extension("toml"));
        reached.push(share);
        table += &line;
        led += usize::from(line.contains(STREAM_FUNCTION));
        if good.contains(&false) {
            failed.push(format!("{name}: {good:?}"));
        }
    }
    println!("{table}");
    assert!(failed.is_empty() && led >= LED_BY_STREAM_FUNCTIONS, "{table}\n{}", failed.join("\n"));
    let (everywhere, on_some, count) = REACHED;
    let far = reached.iter().filter(|share| **share >= on_some).count();
    assert!(reached.iter().all(|share| *share >= everywhere) && far >= count, "{table}");
}

/// The scene with zigzag and the shortest streamlines only, their passes joined on the surface and with cells
/// Along a border to which passes are nearly parallel, levels lie beside the part all along, and serve what
/// no level on it reaches.
#[test]
fn borders_of_joined_patches_hold_the_target_as_first_planned() {
    let scene = scene("joined").replace("[tolerance]", "[tolerance]\ncorrect = false");
    let scene = scene.replace("cell = 0.1", "cell = 0.5\nerror_bound = 1.0");
    let (head, _) = scene.split_once("[[toolpath]]").unwrap();
    let (_, report) = run_scene(&written(&format!("{head}[[toolpath]]\nstrategy = \"streamline\"\n")));
    let highest = number(&report, "/toolpaths/0/excess/max_mm");
    assert!(highest <= 1.05 * 0.01, "{highest}");
}

/// that are coarse: turns are those of the moves.
fn joined_on_the_surface(scene: &str) -> String {
    let (head, _) = scene.split_once("[[toolpath]]").unwrap();
    let coarse = |head: String, cell: &str| head.replace(cell, "cell = 0.5\nerror_bound = 1.0");
    let head = ["cell = 0.1", "cell = 0.2"].into_iter().fold(head.to_owned(), coarse);
    let toolpath = |keys: &str| format!("[[toolpath]]\n{keys}\nlinks = \"surface\"\n");
    let zigzag = toolpath("strategy = \"zigzag\"\nangle = \"best\"\nstep = \"constant\"");
    head + &zigzag + &toolpath("strategy = \"streamline\"\nobjective = \"length\"")
}

/// All turning of passes and of the links between them against that of the best zigzag with one stepover, which
/// has about as many passes: with fewer, it would turn less for its links alone. Turns by more than 30
/// degrees are told besides: where passes meet a border at a few degrees, the way back along it begins with
/// one, and times hold what it costs.
fn turn_less_than_zigzag(scenes: &[(&str, String)]) {
    let mut table = String::from(
        "\nsurface          turning, rad: zigzag  streamline  sharp turns: zigzag  streamline\n",
    );
    let mut failed = Vec::new();
    for (name, scene) in scenes {
        let (_, report) = run_scene(&written(&joined_on_the_surface(scene)));
        let of = |what: &str| [0, 1].map(|k| number(&report, &format!("/toolpaths/{k}/path/{what}")));
        let ([zigzag, streamline], sharp) = (of("total_turning_rad"), of("sharp_turns"));
        table += &format!("{name:<16}{zigzag:21.0}{streamline:12.0}{:21}{:12}\n", sharp[0], sharp[1]);
        if streamline > zigzag {
            failed.push(name);
        }
    }
    println!("{table}");
    assert!(failed.is_empty(), "{table}\n{failed:?}");
}

#[test]
fn streamlines_turn_less_than_zigzag_on_a_saddle() {
    turn_less_than_zigzag(&[("saddle", small_saddle(10))]);
}

#[test]
#[ignore = "minutes: seven surfaces, each cut twice"]
fn streamlines_turn_less_than_zigzag_on_seven_surfaces() {
    let as_planned = |name| scene(name).replace("[tolerance]", "[tolerance]\ncorrect = false");
    // Over joined patches a zigzag finds a direction that suits all of them, and turns a little less.
    let all = SURFACES.into_iter().filter(|name| *name != "joined");
    turn_less_than_zigzag(&all.map(|name| (name, as_planned(name))).collect::<Vec<_>>());
}

/// On a twisted patch the quickest path is another than the shortest one with a price of turning, which the
/// machine does not ask for.
#[test]
fn the_quickest_streamlines_take_less_time_than_the_shortest() {
    let head = scene("twisted").replace("[tolerance]", "[tolerance]\ncorrect = false");
    let (head, _) = head.split_once("[[toolpath]]").unwrap();
    let toolpath = |objective: &str| {
        format!(
            "[[toolpath]]\nname = \"{objective}\"\nstrategy = \"streamline\"\nobjective = \"{objective}\"\nlinks = \"surface\"\n"
        )
    };
    let (_, report) = run_scene(&written(&(head.to_owned() + &toolpath("time") + &toolpath("length"))));
    let [time, length] = [0, 1].map(|k| number(&report, &format!("/toolpaths/{k}/path/machining_time_s")));
    assert!(time < 0.98 * length, "{time} {length}");
}

/// Smoothed passes have fewer points, and their ridges hold the target as well.
#[test]
fn smoothed_streamlines_hold_the_target() {
    let scene = small_saddle(14);
    let (head, _) = scene.split_once("[[toolpath]]").unwrap();
    let toolpath = |smoothing: bool| {
        format!(
            "[[toolpath]]\nname = \"{smoothing}\"\nstrategy = \"streamline\"\nlinks = \"retract\"\nsmoothing = {smoothing}\n"
        )
    };
    let (_, report) = run_scene(&written(&(head.to_owned() + &toolpath(false) + &toolpath(true))));
    let of = |what: &str| [0, 1].map(|k| number(&report, &format!("/toolpaths/{k}/{what}")));
    let (over, highest) = (of("scallop/over_target_fraction"), of("scallop/max_mm"));
    assert!(over[1] <= 0.01 && highest[1] <= 0.011, "{over:?} {highest:?}");
    let (moves, length) = (of("simulation/moves"), of("path/cutting_length_mm"));
    assert!(moves[1] < 0.7 * moves[0] && length[1] < 1.03 * length[0], "{moves:?} {length:?}");
}

/// A plate between sides at these places, mm, with a notch in its upper side between every second pair.
fn with_notches(x: &[f64], y: [f64; 3]) -> Vec<[Point3; 3]> {
    let columns = 0..x.len() - 1;
    let cells = columns.clone().map(|i| [i, 0]).chain(columns.step_by(2).map(|i| [i, 1]));
    let halves = |[i, j]: [usize; 2]| {
        let [a, b, c, d] =
            [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[k, l]| Point3::new(x[i + k], y[j + l], 0.0));
        [[a, b, c], [a, c, d]]
    };
    cells.flat_map(halves).collect()
}

/// A plate of 22 × 10 mm with a notch in its upper side.
fn notched_plate() -> Vec<[Point3; 3]> {
    with_notches(&[0.0, 8.0, 14.0, 22.0], [0.0, 5.1, 10.0])
}

/// A comb of 18 × 10 mm with five teeth of 2 mm.
fn comb() -> Vec<[Point3; 3]> {
    with_notches(&[0.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0, 16.0, 18.0], [0.0, 2.8, 10.0])
}

/// A round disk with a radius of 10 mm.
fn disk() -> Vec<[Point3; 3]> {
    let at = |k: usize| {
        let (sin, cos) = (std::f64::consts::TAU * (k % 90) as f64 / 90.0).sin_cos();
        Point3::new(10.0 * cos, 10.0 * sin, 0.0)
    };
    (0..90).map(|k| [Point3::origin(), at(k), at(k + 1)]).collect()
}

/// Runs a scene whose part is `part.stl`, these triangles.
fn run_on(triangles: &[[Point3; 3]], scene: &str) -> (i32, serde_json::Value) {
    let home = tempfile::tempdir().unwrap();
    write_stl(&home.path().join("part.stl"), triangles);
    let file = home.path().join("scene.toml");
    std::fs::write(&file, scene).unwrap();
    run_scene(&file)
}

/// Passes are planned for the part and not for the rectangle around it, nor for the walls that go down from its rim:
/// all of it is cut, in no more time (within 2 %) than by straight passes at their best angle over the top alone.
#[test]
fn streamlines_are_quick_on_parts_that_are_no_rectangle() {
    let scene = "[part]\nfile = \"part.stl\"\n[cutter]\nshape = \"ball\"\ndiameter = 4\n[tolerance]\nscallop = 0.02\n\
                 [[toolpath]]\nstrategy = \"streamline\"\n\
                 [[toolpath]]\nstrategy = \"zigzag\"\nangle = \"best\"\nlinks = \"surface\"\n";
    let mut straight = 0.0;
    let parts = [("notched plate", notched_plate()), ("disk", disk()), ("solid disk", solid_disk())];
    for (name, triangles) in parts {
        let (code, report) = run_on(&triangles, scene);
        assert_eq!(code, 0, "{name}");
        let time = |k: usize| number(&report, &format!("/toolpaths/{k}/path/machining_time_s"));
        // The walls of a solid are of no matter, to straight passes either.
        if name == "solid disk" {
            assert!(time(1) <= 1.02 * straight, "{} {straight}", time(1));
        } else {
            straight = time(1);
        }
        assert!(time(0) <= 1.02 * straight, "{name}: {} {straight}", time(0));
    }
}

/// Along the teeth of a comb a pass that leaves the back of it between two of them runs on beside the next one: no
/// band stands there in the plan as it is first made.
#[test]
fn a_pass_around_a_corner_serves_the_side_behind_it() {
    let scene = "[part]\nfile = \"part.stl\"\n[cutter]\nshape = \"ball\"\ndiameter = 4\n[tolerance]\nscallop = 0.02\n\
                 correct = false\n[[toolpath]]\nstrategy = \"streamline\"\n";
    let (_, report) = run_on(&comb(), scene);
    let highest = number(&report, "/toolpaths/0/excess/max_mm");
    assert!(highest < 0.024, "{highest}");
}

/// Over sharp edges passes are as far apart as on each side of them alone, and an edge has a pass of its own where they
/// run along it: the top of a block with chamfers takes no longer than by straight passes, and the first plan leaves no
/// band along an edge.
#[test]
fn chamfered_blocks_are_planned_as_their_faces() {
    let head = "[part]\nfile = \"part.stl\"\n[cutter]\nshape = \"ball\"\ndiameter = 6\n[tolerance]\nscallop = 0.02\n";
    let streamline = "[[toolpath]]\nstrategy = \"streamline\"\n";
    let zigzag = "[[toolpath]]\nstrategy = \"zigzag\"\nangle = \"best\"\nlinks = \"surface\"\n";
    let (code, report) = run_on(&chamfered(), &format!("{head}{streamline}{zigzag}"));
    assert_eq!(code, 0);
    let [time, straight] = [0, 1].map(|k| number(&report, &format!("/toolpaths/{k}/path/machining_time_s")));
    assert!(time <= straight, "{time} {straight}");
    // All faces are planes: the least is their area over one interval.
    let least = number(&report, "/toolpaths/0/shortest/cutting_length_mm");
    let area: f64 = chamfered().iter().map(|[a, b, c]| 0.5 * (b - a).cross(&(c - a)).norm()).sum();
    let interval = 2.0 * f64::sqrt(2.0 * 3.0 * 0.02 - 0.02 * 0.02);
    assert!((least * interval / area - 1.0).abs() < 1e-3, "{least} {area} {interval}");
    let (_, report) = run_on(&chamfered(), &format!("{head}correct = false\n{streamline}"));
    let highest = number(&report, "/toolpaths/0/excess/max_mm");
    assert!(highest < 0.03, "{highest}");
}

/// The top of a block of 24 × 16 mm and its chamfers of 1 mm.
fn chamfered() -> Vec<[Point3; 3]> {
    let ring = |inside: f64, z: f64| {
        let (x, y) = (24.0 - inside, 16.0 - inside);
        [[inside, inside], [x, inside], [x, y], [inside, y]].map(|[x, y]| Point3::new(x, y, z))
    };
    let (top, foot) = (ring(1.0, 0.0), ring(0.0, -1.0));
    let side = |k: usize| {
        let l = (k + 1) % 4;
        [[top[k], foot[k], top[l]], [top[l], foot[k], foot[l]]]
    };
    let level = [[top[0], top[1], top[2]], [top[0], top[2], top[3]]];
    (0..4).flat_map(side).chain(level).collect()
}

/// The disk with walls that go down from it and a floor.
fn solid_disk() -> Vec<[Point3; 3]> {
    let down = |p: Point3| Point3::new(p.x, p.y, p.z - 5.0);
    let sector = |[middle, a, b]: [Point3; 3]| {
        [[middle, a, b], [a, down(a), b], [b, down(a), down(b)], [down(middle), down(b), down(a)]]
    };
    disk().into_iter().flat_map(sector).collect()
}

/// Two square plates of 10 mm.
fn two_plates() -> Vec<[Point3; 3]> {
    let plate = |x: f64| {
        let [a, b, c, d] = [[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]]
            .map(|[u, v]: [f64; 2]| Point3::new(x + u, v, 0.0));
        [[a, b, c], [a, c, d]]
    };
    [0.0, 12.0].into_iter().flat_map(plate).collect()
}

/// Fronts move over the rectangle around a part, passes and what is predicted of them are those of the part: all of
/// it is cut in no more time (within 2 %) than by straight passes, and the prediction is that of its area.
#[test]
fn fronts_are_cut_on_the_part_alone() {
    let scene = "[part]\nfile = \"part.stl\"\n[cutter]\nshape = \"ball\"\ndiameter = 4\n[tolerance]\nscallop = 0.02\n\
                 [[toolpath]]\nstrategy = \"iso-scallop\"\nlinks = \"surface\"\n\
                 [[toolpath]]\nname = \"rings\"\nstrategy = \"iso-scallop\"\nstart = \"all\"\nlinks = \"surface\"\n\
                 [[toolpath]]\nstrategy = \"zigzag\"\nangle = \"best\"\nlinks = \"surface\"\n";
    let strip = 2.0 * (0.02f64 * (4.0 - 0.02)).sqrt();
    let parts = [
        ("disk", disk()),
        ("solid disk", solid_disk()),
        ("notched plate", notched_plate()),
        ("plates", two_plates()),
    ];
    for (name, triangles) in parts {
        let (code, report) = run_on(&triangles, scene);
        assert_eq!(code, 0, "{name}");
        let time = |k: usize| number(&report, &format!("/toolpaths/{k}/path/machining_time_s"));
        assert!(time(0) <= 1.02 * time(2), "{name}: {} {}", time(0), time(2));
        if name == "disk" {
            // Rings from its own border, not those of the square around it.
            assert!(time(1) <= 1.02 * time(2), "{} {}", time(1), time(2));
        }
        let area: f64 = triangles.iter().map(|[a, b, c]| 0.5 * (b - a).cross(&(c - a)).z.max(0.0)).sum();
        for k in [0, 2] {
            let notes = report.pointer(&format!("/toolpaths/{k}/notes")).and_then(|notes| notes.as_array());
            let notes = notes.into_iter().flatten().filter_map(|note| note.as_str());
            let predicted = |note: &str| {
                let before = note.split(" mm predicted").next()?.split(" predicted;").next()?;
                before.rsplit([' ', '(']).next()?.parse::<f64>().ok()
            };
            let predicted: f64 = notes.filter(|note| note.contains("predicted")).filter_map(predicted).sum();
            let exact = area / strip;
            assert!((predicted / exact - 1.0).abs() < 0.04, "{name}: {predicted} {exact}");
        }
    }
}
