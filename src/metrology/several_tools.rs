//! Tests: several cutters that make one part, against closed forms, brute force and the other engine on
//! cells.

use crate::figures::Limits;
use crate::flat_scene::plane;
use crate::measure::measure_with_walls;
use crate::{Asked, Measurement, measure};
use cutter::Cutter;
use geometry::{Aabb, AnalyticShape, AnalyticSurface, Point3, Vector3};
use motion::{ClPoint, Cutters, Move, MoveKind, Toolpath};
use part::{Part, Patch};
use sim::{CutHeights, Envelope, Grid, ZMap, cut, cut_in_turn, cut_reference};
use work::monitor::Silent;

const LIMITS: Limits = Limits { scallop: 0.01, gouge: 0.005, uncut: 0.05, chord: 0.001 };
const TOP: f64 = 2.0;

const ASKED: Asked = Asked {
    allowed_depth: 0.0,
    error_bound: 5e-4,
    border_cuts: true,
    steep_elsewhere: false,
    most_cells: 1 << 20,
    most_squares: 1 << 20,
    is_first_look: false,
};
const SIZE: [f64; 2] = [12.0, 8.0];

/// The passes of one cutter after the other, with a rapid to each pass, and where each cutter begins.
fn in_turn(tools: &[(Cutter, Vec<Vec<Point3>>)]) -> (Cutters, Toolpath) {
    let above = |p: Point3| ClPoint::upright(Point3::new(p.x, p.y, 20.0));
    let (mut moves, mut pass, mut cutters) = (Vec::new(), 0, None::<Cutters>);
    for (cutter, passes) in tools {
        let first = moves.len() as u32;
        cutters = Some(cutters.map_or_else(|| cutter.into(), |cutters| cutters.then(first, *cutter)));
        for tips in passes {
            let mut push = |to, kind| moves.push(Move { to, kind, feed_rate: 1000.0, pass });
            push(above(tips[0]), MoveKind::Rapid);
            push(ClPoint::upright(tips[0]), MoveKind::Plunge);
            tips[1..].iter().for_each(|tip| push(ClPoint::upright(*tip), MoveKind::Cut));
            push(above(tips[tips.len() - 1]), MoveKind::Rapid);
            pass += 1;
        }
    }
    (cutters.unwrap(), Toolpath::new(above(Point3::origin()), moves))
}

/// Level passes along x at the height `z`, from one y on to another, `step` apart.
fn level(z: f64, [from, to]: [f64; 2], step: f64) -> Vec<Vec<Point3>> {
    let rows = ((to - from) / step).round() as usize;
    let row = |k: usize| {
        let y = from + step * k as f64;
        [-5.0, 5.0, SIZE[0] + 5.0].map(|x| Point3::new(x, y, z)).to_vec()
    };
    (0..=rows).map(row).collect()
}

const REFERENCE: CutHeights = |stock, cutter, path, monitor| cut_reference(&stock, cutter, path, monitor);

fn measured_by(
    engine: CutHeights,
    part: &Part,
    cutters: &Cutters,
    path: &Toolpath,
    cell: f64,
) -> Measurement {
    let grid = Grid::covering(&part.bounds(), cell, 64, 1 << 30).unwrap();
    let cut = cut_in_turn(engine, ZMap::block(grid, TOP), cutters, path, &Silent).unwrap();
    measure_with_walls(part, cutters, path, &cut, &LIMITS, &ASKED, None, &Silent).unwrap()
}

fn measured(part: &Part, tools: &[(Cutter, Vec<Vec<Point3>>)]) -> Measurement {
    let (cutters, path) = in_turn(tools);
    measured_by(cut, part, &cutters, &path, 0.1)
}

fn flat() -> Cutter {
    Cutter::flat(8.0).unwrap()
}

fn ball() -> Cutter {
    Cutter::ball(6.0).unwrap()
}

/// A flat leaves 0.03 mm everywhere, and passes of a ball that are 2 mm apart would leave more: the lower of
/// both stands.
#[test]
fn the_highest_material_is_the_lower_of_both_cutters() {
    let (part, finish) = (plane(SIZE), level(0.0, [-1.0, 9.0], 2.0));
    let cusp = 3.0 - 8f64.sqrt();
    let alone = measured(&part, &[(ball(), finish.clone())]);
    assert!((alone.excess.highest.max_mm - cusp).abs() < 1e-4, "{:?}", alone.excess);
    for left in [0.03, 0.3] {
        let found = measured(&part, &[(flat(), level(left, [-1.0, 9.0], 5.0)), (ball(), finish.clone())]);
        let highest = found.excess.highest;
        let truth = left.min(cusp);
        assert!(highest.max_mm <= truth + 1e-6 && highest.at_most() >= truth, "{left}: {highest:?}");
        assert!(
            (highest.max_mm - truth).abs() < 1e-3 && highest.error_bound_mm < 2e-3,
            "{left}: {highest:?}"
        );
        assert_eq!(found.gouge.max_depth_mm, 0.0);
    }
}

/// One half is finished by one cutter, the other by the other: neither leaves anything uncut of the whole.
#[test]
fn what_one_cutter_leaves_the_other_may_take() {
    let part = plane(SIZE);
    let (first, second) = (level(0.0, [-1.0, 2.0], 3.0), level(0.0, [4.0, 9.0], 0.25));
    let alone = measured(&part, &[(ball(), second.clone())]);
    assert!(alone.uncut.max_height_mm > 1.0, "{:?}", alone.uncut);
    let both = measured(&part, &[(flat(), first), (ball(), second)]);
    assert_eq!(both.uncut.region_count, 0, "{:?}", both.uncut);
    assert!(both.excess.highest.at_most() < LIMITS.scallop, "{:?}", both.excess);
}

/// Each cutter dips once, a fifth of a millimetre deep; both dips are told with the move that made them.
#[test]
fn a_gouge_of_each_cutter_is_found_with_its_move() {
    let part = plane(SIZE);
    let dip = |tips: &mut Vec<Point3>, after: usize, x: f64, depth: f64| {
        let Point3 { coords: from, .. } = tips[0];
        let places = [[-0.5, 0.0], [0.0, depth], [0.5, 0.0]];
        tips.splice(after..after, places.map(|[by, down]| Point3::new(x + by, from.y, from.z - down)));
    };
    let (mut rough, mut finish) = (level(0.1, [-1.0, 9.0], 5.0), level(0.0, [-1.0, 9.0], 0.25));
    dip(&mut rough[0], 1, -1.0, 0.3);
    dip(&mut finish[32], 2, 10.0, 0.1);
    let tools = [(flat(), rough), (ball(), finish)];
    let (cutters, path) = in_turn(&tools);
    let found = measured(&part, &tools).gouge;
    assert!(
        (found.max_depth_mm - 0.2).abs() <= found.error_bound_mm && found.error_bound_mm < 2e-3,
        "{found:?}"
    );
    let of: Vec<(f64, f64)> = found
        .regions
        .iter()
        .map(|region| (region.depth_mm, cutters.of_move(region.move_index).radius()))
        .collect();
    let near = |depth: f64, radius: f64| of.iter().any(|at| (at.0 - depth).abs() < 2e-3 && at.1 == radius);
    assert!(of.len() == 2 && near(0.2, 4.0) && near(0.1, 3.0), "{of:?}");
    assert!(found.regions.iter().all(|region| (region.move_index as usize) < path.len()));
}

/// The highest and the deepest of many places, every move of every cutter looked at by itself.
fn brute(part: &Part, cutters: &Cutters, path: &Toolpath) -> [f64; 2] {
    const PLACES: usize = 240;
    let (envelope, all) = (Envelope::new(cutters, path), (0..path.len() as u32).collect::<Vec<_>>());
    let Aabb { min, max } = part.bounds();
    let mut found = [0.0f64; 2];
    for k in 0..PLACES * PLACES {
        let [i, j] = [k % PLACES, k / PLACES].map(|n| (n as f64 + 0.5) / PLACES as f64);
        let (x, y) = (min.x + (max.x - min.x) * i, min.y + (max.y - min.y) * j);
        let Some(foot) = part.highest_at(x, y) else { continue };
        let over = |q: Point3| envelope.lowest(q.x, q.y, &all).map_or(TOP, |(z, _)| z.min(TOP)) - q.z;
        let (mut low, mut high) = (-0.5, 2.0 * TOP);
        for _ in 0..40 {
            let t = 0.5 * (low + high);
            if over(foot.point + foot.normal * t) > 0.0 { low = t } else { high = t }
        }
        found = [found[0].max(low), found[1].max(-low)];
    }
    found
}

/// On an inclined plane: bounds hold what brute force finds, and both engines on cells say the same.
#[test]
fn bounds_hold_what_brute_force_finds() {
    let shape = AnalyticShape::Inclined { height: 0.0, angle: 0.3, azimuth: 0.4 };
    let surface = AnalyticSurface::new(shape, [[0.0, 5.0], [0.0, 4.0]]).unwrap();
    let part = Part::from_patches(vec![Patch::Analytic(surface)], 0.001).unwrap();
    let normal = part.highest_at(2.0, 2.0).unwrap().normal;
    let on = |cutter: &Cutter, x: f64, y: f64, lift: f64| {
        let foot = part.highest_at(2.0, 2.0).unwrap().point;
        let along = Vector3::new(x - foot.x, y - foot.y, 0.0);
        let z = foot.z - normal.xy().dot(&along.xy()) / normal.z;
        Point3::new(x, y, z) + normal * lift + cutter.contact_to_tip(&normal)
    };
    let passes = |cutter: &Cutter, step: f64, turned: bool, lift: &dyn Fn(usize) -> f64| {
        let rows = (9.0 / step) as usize;
        let row = |k: usize| {
            let at = -2.0 + step * k as f64;
            let place = |t: f64| if turned { on(cutter, at, t, lift(k)) } else { on(cutter, t, at, lift(k)) };
            vec![place(-2.0), place(1.9), place(7.0)]
        };
        (0..=rows).map(row).collect::<Vec<_>>()
    };
    let bull = Cutter::bull(5.0, 0.8).unwrap();
    let rough = |k: usize| if k == 3 { -0.02 } else { 0.04 };
    for step in [0.7, 1.3] {
        let tools =
            [(bull, passes(&bull, 1.1, true, &rough)), (ball(), passes(&ball(), step, false, &|_| 0.0))];
        let (cutters, path) = in_turn(&tools);
        let [highest, deepest] = brute(&part, &cutters, &path);
        assert!(deepest > 0.01, "{deepest}");
        for engine in [cut as CutHeights, REFERENCE] {
            let found = measured_by(engine, &part, &cutters, &path, 0.05);
            let most = found.excess.highest;
            assert!(
                highest <= most.at_most() + 1e-6 && most.max_mm <= highest + 5e-3,
                "{step} {highest}: {most:?}"
            );
            let gouge = &found.gouge;
            let most = gouge.max_depth_mm + gouge.error_bound_mm;
            assert!(
                deepest <= most + 1e-6 && gouge.max_depth_mm <= deepest + 1e-3,
                "{step} {deepest}: {gouge:?}"
            );
        }
    }
}

/// One cutter under two names is one cutter.
#[test]
fn a_cutter_that_comes_again_changes_no_figure() {
    let part = plane(SIZE);
    let (rough, finish) = (level(0.0, [-1.0, 4.0], 0.5), level(0.0, [4.5, 9.0], 0.5));
    let twice = measured(&part, &[(ball(), rough.clone()), (ball(), finish.clone())]);
    let (cutters, path) = in_turn(&[(ball(), [rough, finish].concat())]);
    let once = measured_by(cut, &part, &cutters, &path, 0.1);
    assert_eq!((&twice.scallop, &twice.gouge, &twice.uncut), (&once.scallop, &once.gouge, &once.uncut));
    assert_eq!((twice.excess, twice.deviation), (once.excess, once.deviation));
    let grid = Grid::covering(&part.bounds(), 0.1, 64, 1 << 30).unwrap();
    let cut = cut(ZMap::block(grid, TOP), &ball(), &path, &Silent).unwrap();
    let alone = measure(&part, &ball(), &path, &cut, &LIMITS, &ASKED, &Silent).unwrap();
    assert_eq!((alone.scallop, alone.gouge), (once.scallop, once.gouge));
}
