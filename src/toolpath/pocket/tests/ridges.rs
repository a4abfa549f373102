//! What passes of cutters without a level bottom leave between them.

use super::*;
use geometry::CurveSegment;

/// A corner every some degrees, at random distances, and an island in the middle of every other one.
fn outline(seed: u32) -> Pocket {
    let mut state = seed.wrapping_mul(2_654_435_761).wrapping_add(12_345);
    let mut random = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 8) / f64::from(1 << 24)
    };
    let corners = 4 + (random() * 6.0) as u32;
    let outer = (0..corners)
        .map(|k| (2.0 * PI * (f64::from(k) + 0.5 * random()) / f64::from(corners), 9.0 + 8.0 * random()))
        .map(|(angle, far)| Point2::new(far * angle.cos(), far * angle.sin()))
        .collect();
    let island = (seed % 2 == 1).then(|| rectangle(-1.0, -1.0, 1.5, 0.5));
    pocket(std::iter::once(outer).chain(island).collect())
}

/// The greatest distance of a place where the cutter's centre has room from the passes at depth, over the
/// stepover. Chords take a little.
fn farthest(pocket: &Pocket, cutter: &Cutter, pattern: &Pattern, step: f64) -> f64 {
    let settings = PlanSettings { step: Step::Stepover(step), ..settings() };
    let strategy = PocketStrategy { stepdown: None, ..strategy(pattern.clone()) };
    let plan = plan_pocket(pocket, cutter, &strategy, &settings, &Silent).unwrap();
    let at_depth = plan.path.segments().filter(|(a, b, _)| a.z.max(b.z) < -6.0 + 1e-9);
    let sides = at_depth.map(|(a, b, _)| CurveSegment { ends: [a.xy(), b.xy()], curve: 0, index: 0 });
    let passes = SegmentGrid::new(sides.collect());
    let room = pocket.region.inset(cutter.radius());
    let [lo, hi] = room.bounds().unwrap();
    let mut greatest = 0.0f64;
    for k in 0..500 * 500 {
        let at = |axis: usize, k: i32| lo[axis] + (hi[axis] - lo[axis]) * (f64::from(k) + 0.5) / 500.0;
        let p = Point2::new(at(0, k % 500), at(1, k / 500));
        if room.contains(&p) {
            greatest = greatest.max(passes.distance(&p));
        }
    }
    (greatest - settings.chord_tolerance) / step
}

/// No place is farther from a pass than half an interval: on bisectors of corners, on the medial line, at the
/// saddles of a flow.
#[test]
fn no_place_is_farther_than_half_an_interval() {
    let (ball, bull) = (Cutter::ball(4.0).unwrap(), Cutter::bull(4.0, 1.8).unwrap());
    let patterns = [
        Pattern::Offset { spiral: false },
        Pattern::Offset { spiral: true },
        Pattern::Flow(Flow { smoothing: Some(1.0), spiral: false }),
        Pattern::Flow(Flow { smoothing: Some(2.0), spiral: true }),
        Pattern::Zigzag { angle: 0.3 },
    ];
    let rectangles = [pocket(vec![rectangle(0.0, 0.0, 15.0, 12.0)]), with_island()];
    let step = 0.8;
    for (k, pocket) in rectangles.into_iter().chain((0..8).map(outline)).enumerate() {
        for pattern in &patterns {
            let cutter = if k % 3 == 2 { &bull } else { &ball };
            let far = farthest(&pocket, cutter, pattern, step);
            assert!(far <= 0.5, "{k}, {pattern:?}: {far} of the stepover");
        }
    }
}

/// Of the smoothing lengths of a flow the quickest is taken, ways over ridges and entries included, and not the
/// one with the shortest curves.
#[test]
fn the_quickest_flow_is_taken() {
    let corners = [(0.0, 0.0), (35.0, 0.0), (35.0, 11.0), (17.0, 11.0), (17.0, 25.0), (0.0, 25.0)];
    let around = pocket(vec![corners.map(|(x, y)| Point2::new(x, y)).to_vec()]);
    let (cutter, settings) =
        (Cutter::ball(4.0).unwrap(), PlanSettings { step: Step::Stepover(0.3), ..settings() });
    let time = |smoothing: Option<f64>| {
        let strategy = strategy(Pattern::Flow(Flow { smoothing, spiral: true }));
        let plan = plan_pocket(&around, &cutter, &strategy, &settings, &Silent).unwrap();
        machine::machining_time(&plan.path, &settings.machine, &Silent).unwrap()
    };
    let deepest = around.region.inset(2.0).largest_disc(0.01, &Silent).unwrap().unwrap().1;
    let each = [0.08, 0.16, 0.32, 0.64].map(|share| time(Some(share * deepest)));
    let least = each.into_iter().fold(f64::INFINITY, f64::min);
    let taken = time(None);
    assert!(taken <= 1.02 * least, "{taken} of {each:?}");
}
