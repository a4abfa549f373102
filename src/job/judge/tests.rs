//! Made-up measurements at and beyond their limits.

use super::*;
use metrology::{
    CloserLook, DeviationFigures, ExcessFigures, GougeFigures, GougeRegion, PairFigures, ScallopFigures,
    UncutFigures, UncutRegion,
};

const STRICT: ScallopRule = ScallopRule { share: 1.0, highest: 1.0 };

fn judged(measured: &Measurement, rule: &ScallopRule) -> (Verdict, Vec<Claim>) {
    let claims = judge(measured, &LIMITS, rule, Vec::new(), "toolpath.nc");
    (Verdict::by(&claims), claims)
}

/// Kinds of limits with their verdicts, those that hold left out.
fn not_held(measured: &Measurement, rule: &ScallopRule) -> Vec<(&'static str, Verdict)> {
    let all = judged(measured, rule).1;
    all.iter().map(|c| (c.what, c.verdict())).filter(|(_, verdict)| *verdict != Verdict::Pass).collect()
}

const LIMITS: Limits = Limits { scallop: 0.010, gouge: 0.005, uncut: 0.050, chord: 0.001 };

/// A clean surface but for one gouge of the given depth, mm.
fn measurement(gouge: f64) -> Measurement {
    let at_mm = [12.5, 7.25, -1.0 - gouge];
    let region = GougeRegion {
        depth_mm: gouge,
        area_mm2: 0.25,
        at_mm,
        move_index: 1234,
        line: 1240,
        ..GougeRegion::default()
    };
    let regions = if gouge > LIMITS.gouge { vec![region] } else { Vec::new() };
    Measurement {
        scallop: ScallopFigures {
            target_mm: LIMITS.scallop,
            max_mm: Some(0.0095),
            p95_mm: Some(0.0093),
            p50_mm: Some(0.0071),
            mean_mm: Some(0.0069),
            over_target_fraction: Some(0.0),
            ridge_length_mm: 2345.5,
            max_at_mm: Some([3.0, 4.0, 0.5]),
            error_bound_mm: Some(0.00025),
            reason: None,
        },
        gouge: GougeFigures {
            max_depth_mm: gouge,
            area_mm2: 0.25 * regions.len() as f64,
            error_bound_mm: 0.0005,
            region_count: regions.len(),
            regions,
            ..GougeFigures::default()
        },
        uncut: UncutFigures { error_bound_mm: 0.0005, ..UncutFigures::default() },
        excess: ExcessFigures { reached: Bounded::new(0.0095, 0.00025), ..ExcessFigures::default() },
        deviation: DeviationFigures {
            samples: 4800,
            min_mm: Some(-gouge),
            max_mm: Some(0.0095),
            rms_mm: Some(0.005),
            area_mm2: 1200.0,
            reason: None,
        },
        deviation_map: Vec::new(),
        ridge_samples: vec![[0.0095, 1.0], [0.007, 99.0]],
        above: Vec::new(),
        pairs: PairFigures {
            reason: Some("no ridge stands between passes on the part".into()),
            ..PairFigures::default()
        },
        refined: CloserLook::default(),
    }
}

#[test]
fn a_limit_holds_at_itself_and_is_undecided_within_the_bound() {
    use Verdict::{Fail, Undecided};
    let mut measured = measurement(LIMITS.gouge - 0.000_500_001);
    measured.scallop.max_mm = Some(LIMITS.scallop - 0.000_250_001);
    assert_eq!(not_held(&measured, &STRICT), []);
    measured.gouge.max_depth_mm = LIMITS.gouge + 0.0004;
    measured.scallop.max_mm = Some(LIMITS.scallop - 0.0002);
    assert_eq!(not_held(&measured, &STRICT), [("gouge", Undecided), ("scallop", Undecided)]);
    measured.gouge.max_depth_mm = LIMITS.gouge + 0.0006;
    measured.scallop.max_mm = Some(LIMITS.scallop + 0.0003);
    assert_eq!(not_held(&measured, &STRICT), [("gouge", Fail), ("scallop", Fail)]);
    assert_eq!(judged(&measured, &STRICT).0, Fail);
}

#[test]
fn a_surface_without_ridges_holds_where_nothing_stands_on_it() {
    let mut measured = measurement(0.0);
    measured.scallop = ScallopFigures::default();
    measured.ridge_samples.clear();
    measured.excess.reached = Bounded::new(0.0, 1e-6);
    assert_eq!(not_held(&measured, &STRICT), []);
    let some = ScallopRule { share: 0.95, highest: 1.25 };
    assert_eq!(not_held(&measured, &some), []);
    measured.excess.reached = Bounded::new(0.0, 0.5);
    assert_eq!(not_held(&measured, &STRICT), [("scallop", Verdict::Undecided)]);
    assert_eq!(not_held(&measured, &some).len(), 2);
}

#[test]
fn a_surface_that_was_not_measured_is_undecided() {
    let mut measured = measurement(0.0);
    measured.deviation = DeviationFigures::default();
    let (verdict, claims) = judged(&measured, &STRICT);
    assert_eq!(verdict, Verdict::Undecided);
    assert!(claims.iter().all(|claim| claim.measured.is_none()), "{claims:?}");
}

#[test]
fn a_scene_may_let_some_ridges_be_higher() {
    let rule = ScallopRule { share: 0.95, highest: 1.25 };
    let mut measured = measurement(0.0);
    measured.scallop.max_mm = Some(0.012);
    measured.ridge_samples = vec![[0.012, 4.0], [0.009, 96.0]];
    assert_eq!(not_held(&measured, &rule), []);
    assert_eq!(not_held(&measured, &STRICT), [("scallop", Verdict::Fail)]);
    measured.ridge_samples = vec![[0.012, 6.0], [0.009, 94.0]];
    assert_eq!(not_held(&measured, &rule), [("scallop", Verdict::Fail)]);
    // A tenth of the ridges stands above the target by less than the bound.
    measured.ridge_samples = vec![[0.0102, 10.0], [0.009, 90.0]];
    assert_eq!(not_held(&measured, &rule), [("scallop", Verdict::Undecided)]);
}

#[test]
fn a_remnant_beside_a_border_answers_to_the_scallop_limit() {
    let mut measured = measurement(0.0);
    measured.excess.reached = Bounded { at_mm: Some([1.0, 2.0, 3.0]), ..Bounded::new(0.0138, 1e-6) };
    let all = judged(&measured, &STRICT).1;
    let found = all.iter().find(|c| c.verdict() == Verdict::Fail).unwrap();
    assert!(
        found.text.contains("remnant beside a border is 13.8") && found.text.contains("x 1.000"),
        "{found:?}"
    );
    // What no pass came down to answers to the uncut limit.
    measured.excess.reached = Bounded::default();
    measured.excess.unreached = Bounded::new(0.049, 0.0005);
    assert_eq!(not_held(&measured, &STRICT), []);
    measured.excess.unreached = Bounded::new(0.051, 0.0005);
    assert_eq!(not_held(&measured, &STRICT), [("uncut", Verdict::Fail)]);
}

/// A scallop above both limits is one violation, unless uncut material has a place of its own or stands higher.
#[test]
fn a_flank_of_a_scallop_is_no_violation_of_its_own() {
    let mut measured = measurement(0.0);
    measured.scallop.max_mm = Some(0.2);
    measured.uncut.max_height_mm = 0.199;
    measured.excess.unreached = Bounded::new(0.199, 1e-6);
    assert_eq!(not_held(&measured, &STRICT), [("scallop", Verdict::Fail)]);
    measured.excess.unreached.at_mm = Some([1.0, 2.0, 3.0]);
    let both = [("uncut", Verdict::Fail), ("scallop", Verdict::Fail)];
    assert_eq!(not_held(&measured, &STRICT), both);
    measured.excess.unreached = Bounded::new(0.201, 1e-6);
    assert_eq!(not_held(&measured, &STRICT), both);
}

/// A place that no move cuts away decides by itself, however much more may stand elsewhere; cells alone do
/// not.
#[test]
fn what_stands_for_certain_fails_under_an_open_bound() {
    let mut measured = measurement(0.0);
    let [low, high] = [0.009, 0.02];
    measured.excess.reached = Bounded { at_least_mm: high, ..Bounded::new(high, 3.0) };
    measured.excess.unreached = Bounded { at_least_mm: low, ..Bounded::new(low, 3.0) };
    let all = judged(&measured, &STRICT).1;
    let of = |what: &str| all.iter().find(|claim| claim.what == what).unwrap();
    assert_eq!([of("scallop").verdict(), of("uncut").verdict()], [Verdict::Fail, Verdict::Undecided]);
    assert!(of("scallop").text.ends_with("; 20.0 µm stand for certain"), "{:?}", of("scallop"));
    assert_eq!(serde_json::to_value(of("scallop")).unwrap()["at_least_mm"], high);
    measured.excess.reached.at_least_mm = 0.0;
    assert_eq!(
        not_held(&measured, &STRICT),
        [("uncut", Verdict::Undecided), ("scallop", Verdict::Undecided)]
    );
}

/// Beside material that was never cut a bound as wide as the stock says nothing of what passes left.
#[test]
fn a_bound_that_says_nothing_is_left_out_with_its_reason() {
    let mut measured = measurement(0.0);
    measured.scallop = ScallopFigures::default();
    measured.uncut.regions =
        vec![UncutRegion { height_mm: 8.2, area_mm2: 1.0, volume_mm3: 0.1, at_mm: [1.0, 2.0, 3.0] }];
    measured.uncut.max_height_mm = 8.2;
    for height in [0.0, 0.0098] {
        measured.excess.reached = Bounded::new(height, 7.269);
        let both = [("uncut", Verdict::Fail), ("scallop", Verdict::Undecided)];
        assert_eq!(not_held(&measured, &STRICT), both);
        let claims = judged(&measured, &STRICT).1;
        let json =
            serde_json::to_value(claims.iter().find(|claim| claim.what == "scallop").unwrap()).unwrap();
        assert!(json["measured_mm"].is_null() && json["error_bound_mm"].is_null(), "{json}");
        assert!(json["reason"].is_string() && !json["text"].as_str().unwrap().contains('±'), "{json}");
    }
    // In report.json beside the highest material, too.
    let of_excess = |height: f64, bound: f64, uncut: f64| {
        let (reached, unreached) = (Bounded::new(height, bound), Bounded::new(uncut, 0.001));
        let excess = ExcessFigures { reached, unreached, ..ExcessFigures::default() };
        hides_reached(&excess, &LIMITS, &STRICT)
    };
    assert!(of_excess(0.0, 7.269, 8.2));
    assert!(!of_excess(0.0, 7.269, 0.0) && !of_excess(0.0098, 0.0005, 8.2) && !of_excess(0.3, 0.01, 8.2));
    // What is near its limit, or where a finer cell alone decides, keeps its figure.
    measured.excess.reached = Bounded::new(0.0098, 0.0005);
    assert_eq!(judged(&measured, &STRICT).1.last().unwrap().measured, Some(0.0098));
    measured.uncut = UncutFigures { error_bound_mm: 0.0005, ..UncutFigures::default() };
    measured.excess.reached = Bounded::new(0.0, 7.269);
    assert_eq!(judged(&measured, &STRICT).1.last().unwrap().measured, Some(0.0));
}

/// A ridge that turns into uncut material is as high as its own bound says, in the table and in the sentence.
#[test]
fn a_ridge_that_violates_its_limit_has_its_own_bound() {
    let mut measured = measurement(0.0);
    measured.scallop.max_mm = Some(0.337);
    measured.scallop.error_bound_mm = Some(0.00032);
    measured.excess.reached = Bounded { at_least_mm: 0.337, ..Bounded::new(0.337, 2.987) };
    let claims = judged(&measured, &STRICT).1;
    let scallop = claims.iter().find(|claim| claim.what == "scallop").unwrap();
    assert_eq!((scallop.verdict(), scallop.error_bound), (Verdict::Fail, 0.00032));
    assert!(scallop.sentence().contains("337 ± 0.32 µm"), "{}", scallop.sentence());
    // A lower one leaves the limit to all that passes reached.
    measured.scallop.max_mm = Some(0.009);
    measured.excess.reached = Bounded::new(0.009, 2.987);
    let claims = judged(&measured, &STRICT).1;
    let scallop = claims.iter().find(|claim| claim.what == "scallop").unwrap();
    assert_eq!(scallop.verdict(), Verdict::Undecided);
}

#[test]
fn what_is_cut_for_certain_fails_under_an_open_bound() {
    let mut measured = measurement(0.02);
    measured.gouge.error_bound_mm = 3.0;
    let of_gouge = |measured: &Measurement| judged(measured, &STRICT).1.remove(0);
    assert_eq!(of_gouge(&measured).verdict(), Verdict::Undecided);
    measured.gouge.at_least_mm = 0.0195;
    let found = of_gouge(&measured);
    assert_eq!((found.what, found.verdict()), ("gouge", Verdict::Fail));
    assert!(found.text.ends_with("; 19.5 µm are cut for certain"), "{found:?}");
    // A path that was written with other decimals cuts a little less deep.
    measured.widen(0.015);
    assert_eq!(of_gouge(&measured).verdict(), Verdict::Undecided);
}

#[test]
fn uncut_material_is_told_with_its_place() {
    let mut measured = measurement(0.0);
    let at_mm = [1.0, 2.0, 3.0];
    measured.uncut.regions = vec![UncutRegion { height_mm: 0.2, area_mm2: 1.0, volume_mm3: 0.1, at_mm }];
    measured.uncut.max_height_mm = 0.2;
    measured.uncut.region_count = 3;
    let all = judged(&measured, &STRICT).1;
    let found = all.iter().find(|c| c.verdict() == Verdict::Fail).unwrap();
    assert_eq!(found.what, "uncut");
    assert!(found.text.ends_with("at x 1.000 y 2.000 z 3.000, and 2 more places"), "{}", found.text);
}

#[test]
fn the_gravest_places_are_marked_and_those_within_limits_are_not() {
    assert_eq!(marks(&measurement(0.001), &LIMITS, &STRICT), []);
    let mut measured = measurement(0.032);
    let region = measured.gouge.regions[0].clone();
    measured.gouge.regions.resize(7, region);
    measured.scallop.max_mm = Some(1.01 * LIMITS.scallop);
    let found = marks(&measured, &LIMITS, &STRICT);
    let names: Vec<&str> = found.iter().map(|m| m.name.as_str()).collect();
    assert_eq!(names, ["G1", "G2", "G3", "G4", "G5", "S"]);
    assert_eq!((found[0].at, found[5].at), ([12.5, 7.25], [3.0, 4.0]));
}

#[test]
fn a_gouge_names_move_and_line() {
    let text = judged(&measurement(0.032), &STRICT).1[0].text.clone();
    assert!(text.contains("gouge 32.0 ± 0.50 µm deep (limit 5.00)"), "{text}");
    assert!(text.contains("at x 12.500 y 7.250 z -1.032, move 1234, toolpath.nc line 1240"), "{text}");
    let mut measured = measurement(0.032);
    measured.gouge.regions[0] =
        GougeRegion { move_index: NOT_CUT, line: 0, ..measured.gouge.regions[0].clone() };
    let text = judged(&measured, &STRICT).1[0].text.clone();
    assert!(text.ends_with("at x 12.500 y 7.250 z -1.032"), "{text}");
}

#[test]
fn what_figures_found_comes_by_its_gravity_and_fails() {
    let found = |what, gravity| Claim::length(what, gravity, 0.0, 1.0, 0.0);
    let all = vec![found("wall", Gravity::Scrap), found("collision", Gravity::Crash)];
    let claims = judge(&measurement(0.0), &LIMITS, &STRICT, all, "toolpath.nc");
    let verdict = Verdict::by(&claims);
    let kinds: Vec<&str> = claims.iter().map(|c| c.what).collect();
    assert_eq!((verdict, kinds), (Verdict::Fail, vec!["collision", "wall", "gouge", "uncut", "scallop"]));
    assert_eq!(judged(&measurement(0.0), &STRICT).0, Verdict::Pass);
}

/// What cells and normals both find violated is one violation, with the greater figure and the other one beside it.
#[test]
fn a_violation_that_two_find_is_listed_once() {
    let of = |depth: f64, suffix: &str| {
        let mut claims = judged(&measurement(depth), &STRICT).1;
        claims.iter_mut().for_each(|claim| claim.text += suffix);
        claims
    };
    let gouges = |cells: f64, normals: f64| {
        let both = [of(normals, UNSEEN), of(cells, "")].concat();
        let (before, once) = (Verdict::by(&both), each_violation_once(both));
        assert_eq!(before, Verdict::by(&once));
        let is_gouge = |claim: &Claim| claim.what == "gouge" && claim.verdict() == Verdict::Fail;
        once.into_iter().filter(is_gouge).map(|claim| claim.text).collect::<Vec<_>>()
    };
    let [deeper, less] = [gouges(0.05, 0.02), gouges(0.02, 0.05)];
    assert!(deeper.len() == 1 && deeper[0].starts_with("gouge 50.0"), "{deeper:?}");
    assert!(deeper[0].ends_with("; 20.0 ± 0.50 µm measured along normals where no cell sees"), "{deeper:?}");
    assert!(less.len() == 1 && less[0].ends_with("; 20.0 ± 0.50 µm on the cells"), "{less:?}");
    // What one of them finds stays as it is, as on the floor and on the walls of a pocket, and so does what holds.
    let both = [of(0.05, ""), of(0.02, " on the walls")].concat();
    assert_eq!(each_violation_once(both.clone()), both);
    assert_eq!(gouges(0.02, 0.001).len(), 1);
    let held = [of(0.001, UNSEEN), of(0.001, "")].concat();
    assert_eq!(each_violation_once(held.clone()), held);
}
