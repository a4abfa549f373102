use super::*;
use crate::vocabulary::Pace;
use work::monitor::Silent;

const TARGET: f64 = 0.05;
const CHORD: f64 = 1e-3;
const TOP: f64 = 9.0;

fn planned(part: &Part, cutter: &Cutter, step: Step, placing: LevelSteps) -> Result<Passes, PlanError> {
    let settings = PassSettings::upright(step, 0.5);
    let pace = Pace { duration: &|passes, _| Ok(passes.length()), link: 1.0, bend: 0.1 };
    passes(&Task { part, cutter, settings, wants_mesh: true, pace, monitor: &Silent }, placing)
}

/// Triangles of blocks without undersides whose walls lean by an angle, rad; each by its middle and half its
/// width at the top.
fn blocks(draft: f64, of: &[([f64; 2], f64)]) -> Part {
    let out = TOP * draft.tan();
    let (mut points, mut triangles) = (Vec::new(), Vec::new());
    for (n, &([x, y], half)) in of.iter().enumerate() {
        let first = 8 * n as u32;
        for (z, half) in [(0.0, half + out), (TOP, half)] {
            let around = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
            points.extend(around.map(|[i, j]| Point3::new(x + i * half, y + j * half, z)));
        }
        let wall = |k: u32| [[k, (k + 1) % 4, 4 + (k + 1) % 4], [k, 4 + (k + 1) % 4, 4 + k]];
        let all = (0..4).flat_map(wall).chain([[4, 5, 6], [4, 6, 7]]);
        triangles.extend(all.map(|corners| corners.map(|v| v + first)));
    }
    Part::from_mesh(TriangleMesh::new(points, triangles).unwrap().0)
}

fn levels(passes: &Passes) -> Vec<f64> {
    let mut levels: Vec<f64> = passes.passes.iter().map(|pass| pass[0].z).collect();
    levels.sort_by(f64::total_cmp);
    levels
}

fn cutters() -> [Cutter; 3] {
    [Cutter::ball(6.0), Cutter::bull(6.0, 1.0), Cutter::flat(6.0)].map(Result::unwrap)
}

/// On walls that lean by 0.1 to 50 degrees every pass is closed and level, touches the walls within the chord
/// tolerance, and lies one strip from the next, as a plane of that slope allows; the lowest and the highest
/// serve the wall to its ends.
#[test]
fn walls_get_a_pass_a_strip_however_steep_they_are() {
    for draft in [0.1_f64, 1.0, 10.0, 50.0].map(f64::to_radians) {
        let (sin, cos) = draft.sin_cos();
        let part = blocks(draft, &[([0.0; 2], 8.0)]);
        for cutter in cutters() {
            let planned = planned(&part, &cutter, Step::Scallop(TARGET), LevelSteps::Shortest).unwrap();
            let (radius, corner) = (cutter.radius(), cutter.corner_radius());
            let [along, normal] = [Vector3::y(), Vector3::new(cos, 0.0, sin)];
            let across = normal.cross(&along);
            let plane = FeedCurvature::default();
            let step = strip_width_at(&cutter, &normal, &across, &plane, TARGET).0 * cos;
            let levels = levels(&planned);
            assert!(levels.windows(2).all(|w| w[1] - w[0] <= step * 1.003), "{draft} {step} {levels:?}");
            assert!(levels.len() as f64 <= TOP / step + 2.0, "{draft} {step} {levels:?}");
            // The centre of the tool's arc is so far above the tip, the tip so far below what is touched.
            let below = corner * (1.0 - sin);
            let (lowest, highest) = (levels[0] + below, levels[levels.len() - 1] + below);
            // The bottom of a flat comes down to the foot of the wall.
            let lowest_of_flat = levels[0] / step;
            assert!(!cutter.is_flat() || (-0.2..2e-3).contains(&lowest_of_flat), "{draft} {step} {levels:?}");
            assert!(lowest < 0.502 * step && highest > TOP - 0.502 * step, "{draft} {step} {levels:?}");
            for pass in &planned.passes {
                assert_eq!(pass[0], pass[pass.len() - 1], "{draft}");
                for tip in pass {
                    assert_eq!(tip.z, pass[0].z);
                    // From the wall at its side, whichever is nearest.
                    let wall = tip.x.abs().max(tip.y.abs());
                    let centre = wall - (radius - corner);
                    let off = (centre - 8.0) * cos + (tip.z + corner - TOP) * sin - corner;
                    let on_side = tip.x.abs().min(tip.y.abs()) < 8.0;
                    assert!(!on_side || off.abs() < CHORD, "{draft} {tip:?} {off}");
                }
            }
        }
    }
}

/// Where three strips are asked for, as many are there: a step along the surface is one of the height times
/// the slope.
#[test]
fn a_stepover_is_measured_along_the_wall() {
    let part = blocks(30_f64.to_radians(), &[([0.0; 2], 8.0)]);
    let slant = TOP / 30_f64.to_radians().cos();
    let cutter = Cutter::ball(6.0).unwrap();
    let found = planned(&part, &cutter, Step::Stepover(slant / 3.0), LevelSteps::Constant).unwrap();
    let levels = levels(&found);
    assert_eq!(levels.len(), 3, "{levels:?}");
    assert!(levels.windows(2).all(|w| (w[1] - w[0] - TOP / 3.0).abs() < 1e-6), "{levels:?}");
    assert!(found.notes.iter().any(|note| note.contains("so level")), "{:?}", found.notes);
}

/// Between two blocks the cutter goes where it is narrower than the gap, to its bottom, and else no lower
/// than it comes.
#[test]
fn a_gap_is_entered_by_a_cutter_that_is_narrower() {
    let cutter = Cutter::ball(6.0).unwrap();
    for (gap, enters) in [(6.2, true), (5.8, false)] {
        let part = blocks(1e-3, &[([-5.0, 0.0], 5.0 - 0.5 * gap), ([5.0, 0.0], 5.0 - 0.5 * gap)]);
        let found = planned(&part, &cutter, Step::Stepover(0.5), LevelSteps::Constant).unwrap();
        let low = levels(&found)[0];
        let between = |tip: &Point3| tip.z == low && tip.x.abs() < 0.5 && tip.y.abs() < 2.5;
        assert_eq!(found.passes.iter().flatten().any(between), enters, "{gap}");
        let curves = found.passes.iter().filter(|pass| pass[0].z == low).count();
        assert_eq!(curves, if enters { 2 } else { 1 }, "{gap}");
    }
}

#[test]
fn a_plate_has_no_contours() {
    let part = blocks(1e-6, &[([0.0; 2], 8.0)]);
    let refused = planned(&part, &cutters()[0], Step::Stepover(0.5), LevelSteps::Shortest);
    let Err(PlanError::NotApplicable { strategy: "waterline", reason }) = refused else {
        panic!("{refused:?}")
    };
    assert!(reason.starts_with("what the cutter reaches of it is level or upright"), "{reason}");
}

/// A block that widens towards its foot has contours, but none on faces that are steeper.
#[test]
fn a_plate_may_have_contours_on_other_slopes() {
    let part = blocks(30_f64.to_radians(), &[([0.0; 2], 8.0)]);
    let faces = Faces::of_slopes([70_f64, 90.0].map(f64::to_radians));
    let settings = PassSettings { faces, ..PassSettings::upright(Step::Stepover(0.5), 0.5) };
    let pace = Pace { duration: &|passes, _| Ok(passes.length()), link: 1.0, bend: 0.1 };
    let cutter = &cutters()[0];
    let task = Task { part: &part, cutter, settings, wants_mesh: true, pace, monitor: &Silent };
    let Err(PlanError::NotApplicable { reason, .. }) = passes(&task, LevelSteps::Constant) else { panic!() };
    let told = "what the cutter reaches of the faces with the slopes asked for is level or upright";
    assert!(reason.starts_with(told), "{reason}");
}
