//! Links of leaning tools across fixtures, against distances that share nothing with the engine: from the
//! line in the middle of the tool to a box.

use super::tests::Home;
use crate::Outcome;
use geometry::{Aabb, Point3};
use motion::{ClPoint, MoveKind, Toolpath};
use report::Verdict;
use std::ops::Range;

/// A plate of 40 × 20 mm whose top is z = 0, in strips of 5 mm.
const PLATE: &str = "[part]\nsurface = \"plane\"\nx = [0, 40]\ny = [0, 20]\n[cutter]\nshape = \"ball\"\ndiameter = 6\n\
                     [tolerance]\nscallop = 1\n[simulation]\nremoval = false\n[interference]\nclearance = 0.5\n";
const RADIUS: f64 = 3.0;
const CLEARANCE: f64 = 0.5;
const AXIS: [f64; 3] = [0.28, 0.0, 0.96];
/// From the tip to the end of the shank, which is as wide as the cutter.
const LENGTH: f64 = 100.0;
const SHANK: &str = "[holder]\ncutting_length = 20\n[[holder.section]]\ndiameter = 6\nlength = 80\n";
/// Places looked at on a move lie no farther apart, mm.
const STEP: f64 = 0.05;

fn scene(fixtures: &[String], machine: &str) -> String {
    let fixtures: String = fixtures.iter().map(|file| format!("[[fixture]]\nfile = \"{file}\"\n")).collect();
    let axis = format!("axis = {{ fixed = [{}, {}, {}] }}\n", AXIS[0], AXIS[1], AXIS[2]);
    format!("{PLATE}{SHANK}{fixtures}[[toolpath]]\nstrategy = \"zigzag\"\nstepover = 5\n{axis}{machine}")
}

fn block(low: [f64; 3], high: [f64; 3]) -> Aabb {
    Aabb { min: low.into(), max: high.into() }
}

/// Home with these boxes as fixtures, and their names.
fn with(name: &str, boxes: &[Aabb]) -> (Home, Vec<String>) {
    let home = Home::new(name);
    let files: Vec<String> = (0..boxes.len()).map(|k| format!("box{k}.stl")).collect();
    for (file, bounds) in files.iter().zip(boxes) {
        home.solid(file, bounds.min.into(), bounds.max.into());
    }
    (home, files)
}

fn planned(home: &Home, files: &[String], machine: &str) -> Outcome {
    home.outcome(&scene(files, machine))
}

/// From a box to the tool, whose upper end is out of reach: convex along the middle of the tool, on which
/// thirds close in.
fn distance(at: &ClPoint, bounds: &Aabb) -> f64 {
    let off = |along: f64| {
        let p: Point3 = at.tip + at.axis * along;
        (p - p.inf(&bounds.max).sup(&bounds.min)).norm()
    };
    let (mut low, mut high) = (RADIUS, LENGTH);
    for _ in 0..60 {
        let [a, b] = [low + (high - low) / 3.0, high - (high - low) / 3.0];
        if off(a) < off(b) { high = b } else { low = a }
    }
    off(low) - RADIUS
}

/// The least on a move.
fn on_move(from: &ClPoint, to: &ClPoint, bounds: &Aabb) -> f64 {
    let count = ((to.tip - from.tip).norm() / STEP).ceil().max(1.0);
    let places = (0..=count as u32).map(|k| from.towards(to, f64::from(k) / count));
    places.map(|at| distance(&at, bounds)).fold(f64::INFINITY, f64::min)
}

/// The ways from one pass to the next: the moves of each, with the places where it begins and ends.
fn links(path: &Toolpath) -> Vec<(Range<usize>, [ClPoint; 2])> {
    let cuts = |k: &usize| path.moves[*k].kind == MoveKind::Cut;
    let after: Vec<usize> = (0..path.len()).filter(cuts).collect();
    let ways = after.windows(2).filter(|pair| pair[1] > pair[0] + 1);
    ways.map(|pair| (pair[0] + 1..pair[1], [path.moves[pair[0]].to, path.location_before(pair[1])])).collect()
}

/// Least distances of the tool from a box: as found here, and as the report has it with its bound.
fn least(outcome: &Outcome, file: &str, bounds: &Aabb) -> (f64, f64, f64) {
    let path = &outcome.path;
    let moves = (0..path.len()).map(|k| on_move(&path.location_before(k), &path.moves[k].to, bounds));
    let pairs = outcome.result.claims.iter().filter(|c| c.what == "collision" && c.text.contains(file));
    let told = pairs.map(|c| (-c.measured.unwrap(), c.error_bound));
    let (told, bound) = told.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
    (moves.fold(f64::INFINITY, f64::min), told, bound)
}

/// A wall across the plate, lower than the tool is long, and a post taller than the heights at which the tool
/// goes by.
#[test]
fn a_leaning_tool_goes_over_a_wall_and_beside_a_post() {
    let wall = block([19.0, -10.0, -2.0], [21.0, 30.0, 12.0]);
    let post = block([19.0, 9.0, -2.0], [21.0, 11.0, 60.0]);
    for (name, bounds, over) in [("wall", wall, true), ("post", post, false)] {
        let (home, files) = with(name, &[bounds]);
        let outcome = planned(&home, &files, "");
        let (found, told, bound) = least(&outcome, &files[0], &bounds);
        assert!(found >= CLEARANCE - 1e-3, "{name}: {found}");
        // Between the places looked at here the tool may be nearer by what a step turns and goes.
        assert!(told - bound <= found + 1e-6 && told >= found - 2e-3, "{name}: {found} {told} {bound}");
        let path = &outcome.path;
        let across = links(path).into_iter().filter(|(_, [from, to])| on_move(from, to, &bounds) < 0.0);
        let across: Vec<_> = across.collect();
        let sides = |[from, to]: &[ClPoint; 2]| (from.tip.x < 19.0) != (to.tip.x < 19.0);
        assert!(across.iter().any(|(_, ends)| sides(ends)), "{name}: nothing stands between passes");
        let highest = |(moves, _): &(Range<usize>, _)| {
            moves.clone().map(|k| path.moves[k].to.tip.z).fold(f64::NEG_INFINITY, f64::max)
        };
        let highest: Vec<f64> = across.iter().map(highest).collect();
        let beside = highest.iter().filter(|&&z| z < bounds.max.z).count();
        assert_eq!(beside == 0, over, "{name}: {highest:?}");
    }
}

/// A roof over the plate, little higher than the tool is long: along its axis the tool would come through it.
#[test]
fn a_leaning_tool_comes_and_goes_beside_a_roof() {
    let roof = block([-60.0, -60.0, 110.0], [100.0, 80.0, 115.0]);
    let (home, files) = with("over", &[roof]);
    let outcome = planned(&home, &files, "");
    let (found, told, bound) = least(&outcome, &files[0], &roof);
    assert!(found >= CLEARANCE - 1e-3, "{found}");
    // Its upper end is flat, where the line here has half a ball: the rim is nearest.
    let rim = found + RADIUS * (1.0 - AXIS[0]);
    assert!((told - rim).abs() <= bound + 1e-6, "{rim} {told} {bound}");
    let path = &outcome.path;
    for end in [path.start, path.moves[path.len() - 1].to] {
        assert!(
            end.tip.z < 110.0 && !(-60.0..=100.0).contains(&end.tip.x)
                || end.tip.y < -60.0
                || end.tip.y > 80.0
        );
    }
}

/// Under a roof that a wall reaches, no way leads from one side to the other.
#[test]
fn a_link_without_a_clear_way_is_a_violation() {
    let wall = block([19.0, -10.0, -2.0], [21.0, 30.0, 120.0]);
    let roof = block([-150.0, -150.0, 120.0], [190.0, 170.0, 125.0]);
    let (home, files) = with("roof", &[wall, roof]);
    let outcome = planned(&home, &files, "");
    assert_eq!(outcome.result.verdict, Verdict::Fail);
    let found = outcome.result.claims.iter().find(|c| c.what == "collision" && c.text.contains(&files[1]));
    let found = found.unwrap();
    assert_eq!(found.verdict(), Verdict::Fail, "{found:?}");
    assert!(found.text.contains(" at x ") && found.text.contains(", move "), "{}", found.text);
    let between = |note: &&String| note.contains("moves between passes come nearer to part or fixtures");
    assert!(outcome.result.notes.iter().any(|note| between(&note)), "{:?}", outcome.result.notes);
}

/// The machine's Z ends below the way over a wall, and above what the passes take.
#[test]
fn a_way_over_a_wall_beyond_the_travel_is_refused() {
    let bounds = block([19.0, -10.0, -2.0], [21.0, 30.0, 12.0]);
    let (home, files) = with("travel", &[bounds]);
    let machine = |upper: f64| {
        format!(
            "[machine.kinematics]\npreset = \"ac-table\"\npost = \"full\"\ngauge_length = 90\nz = [-800, {upper}]\n\
             workpiece_zero = [200, 150, -300]\nfirst = {{ point = [240, 120, -300] }}\n\
             second = {{ point = [240, 120, -360] }}\n"
        )
    };
    let highest = |files: &[String]| {
        let outcome = planned(&home, files, &machine(600.0));
        let figure = outcome.result.figures.iter().find(|figure| figure.key == "machine").unwrap();
        let joints = figure.value["joints"].as_array().unwrap();
        let z = joints.iter().find(|joint| joint["joint"] == "Z").unwrap();
        z["range"][1].as_f64().unwrap()
    };
    let (free, over) = (highest(&[]), highest(&files));
    assert!(over > free + 2.0, "{free} {over}");
    let upper = 0.5 * (free + over);
    planned(&home, &[], &machine(upper));
    let refused = home.tried(&scene(&files, &machine(upper))).err().unwrap().to_string();
    let reason = format!("needs Z at {over:.3}, beyond its limit {upper:.3}");
    assert!(refused.contains(&reason) && refused.contains("move "), "{refused}");
}
