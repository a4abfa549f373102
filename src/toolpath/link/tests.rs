use proptest::prelude::*;

use super::*;
use geometry::{AnalyticShape, AnalyticSurface, TriangleMesh};
use part::{Part, Patch};
use sim::{Grid, ZMap, cut_in_order};
use work::monitor::Silent;

const TOP: f64 = 7.0;

fn settings(links: Links) -> PlanSettings {
    PlanSettings {
        step: Step::Stepover(0.5),
        chord_tolerance: 1e-3,
        clearance: 2.0,
        stock_top: TOP,
        feed_rate: 1000.0,
        plunge_rate: 300.0,
        joining: Joining { links, ..Joining::default() },
        ..PlanSettings::default()
    }
}

/// A level plate of 20 × 20 mm at height 0.
fn plate() -> Part {
    let surface =
        AnalyticSurface::new(AnalyticShape::Plane { height: 0.0 }, [[0.0, 20.0], [0.0, 20.0]]).unwrap();
    Part::from_patches(vec![Patch::Analytic(surface)], 0.002).unwrap()
}

/// The plate with a wall 1 mm thick and 5 mm high along x = 10.
fn walled() -> Part {
    let profile = [(0.0, 0.0), (9.5, 0.0), (9.5001, 5.0), (10.4999, 5.0), (10.5, 0.0), (20.0, 0.0)];
    let vertices =
        profile.iter().flat_map(|&(x, z)| [Point3::new(x, 0.0, z), Point3::new(x, 20.0, z)]).collect();
    let triangles =
        (0..5u32).flat_map(|k| [[2 * k, 2 * k + 2, 2 * k + 1], [2 * k + 1, 2 * k + 2, 2 * k + 3]]).collect();
    Part::from_mesh(TriangleMesh::new(vertices, triangles).unwrap().0)
}

fn line(a: [f64; 2], b: [f64; 2]) -> Vec<Point3> {
    vec![Point3::new(a[0], a[1], 0.0), Point3::new(b[0], b[1], 0.0)]
}

fn join_with(passes: &[Vec<Point3>], both_ways: bool, part: &Part, settings: &PlanSettings) -> Toolpath {
    let cutter = Cutter::ball(6.0).unwrap();
    let setup = Setup { part, cutter: &cutter, settings, monitor: &Silent };
    join(vec![Layer::whole(passes.to_vec())], both_ways, &setup).unwrap()
}

fn joined(part: &Part, passes: &[Vec<Point3>], both_ways: bool, links: Links) -> Toolpath {
    join_with(passes, both_ways, part, &settings(links))
}

fn count(path: &Toolpath, kind: MoveKind) -> usize {
    path.moves.iter().filter(|m| m.kind == kind).count()
}

/// Every pass stands in the program whole, in one direction or the other; closed ones round about.
fn assert_all_visited(path: &Toolpath, passes: &[Vec<Point3>], both_ways: bool) {
    assert_eq!(path.passes(), passes.iter().filter(|p| p.len() >= 2).count());
    let mut cut = vec![Vec::new(); path.passes()];
    for (from, to, m) in path.segments().filter(|(.., m)| m.kind == MoveKind::Cut) {
        let points = &mut cut[m.pass as usize];
        if points.is_empty() {
            points.push(from);
        }
        points.push(to);
    }
    for pass in passes.iter().filter(|p| p.len() >= 2) {
        let back: Vec<Point3> = pass.iter().rev().copied().collect();
        let open = cut.iter().any(|c| c == pass || both_ways && *c == back);
        let round = || cut.iter().any(|c| is_closed(c) && pass.iter().all(|p| c.contains(p)));
        assert!(open || is_closed(pass) && round(), "{pass:?} is missing");
    }
}

/// What the tool touches in rapid moves, cut in the order of the program out of a block.
fn rapids_in_stock(path: &Toolpath) -> usize {
    let cell = 0.1;
    let grid = Grid { origin: Point2::new(-4.0, -4.0), cell, nx: 280, ny: 280 };
    let removal = cut_in_order(ZMap::block(grid, TOP), &Cutter::ball(6.0).unwrap(), path, &Silent).unwrap();
    removal.rapid_contacts.len()
}

/// Retracts between passes.
fn retracts(path: &Toolpath) -> usize {
    let last = path.moves.iter().rposition(|m| m.kind == MoveKind::Cut).unwrap_or_default();
    path.moves[..last].iter().filter(|m| m.kind == MoveKind::Retract).count()
}

/// The path with a half circle in fine chords instead of each link between passes along x.
fn with_half_circles(path: &Toolpath) -> Toolpath {
    let links = |m: &Move| m.kind == MoveKind::Link;
    let mut moves: Vec<Move> = Vec::new();
    for run in path.moves.chunk_by(|a, b| links(a) == links(b)) {
        if !links(&run[0]) {
            moves.extend(run);
            continue;
        }
        let (a, b) = (moves[moves.len() - 1].to.tip, run[run.len() - 1].to.tip);
        let (middle, radius) = (nalgebra::center(&a, &b), 0.5 * (b - a).norm());
        let out = if a.x > 10.0 { radius } else { -radius };
        let place = |k: usize| {
            let (sin, cos) = (std::f64::consts::PI * k as f64 / 32.0).sin_cos();
            middle + (a - middle) * cos + Vector3::x() * (out * sin)
        };
        moves.extend((1..=32).map(|k| Move { to: ClPoint::upright(place(k)), ..run[0] }));
    }
    Toolpath::new(path.start, moves)
}

/// On a machine that turns at the feed in no time links are hardly longer than the straight way, and on
/// slower ones they take no more than half circles.
#[test]
fn neighbouring_passes_are_joined_by_the_quickest_bend() {
    let passes: Vec<_> =
        (0..8).map(|k| 5.0 + 0.5 * f64::from(k)).map(|y| line([5.0, y], [15.0, y])).collect();
    for (acceleration, most) in [(1e6, 0.6), (3000.0, 0.8), (100.0, 0.9)] {
        let mut settings = settings(Links::Surface);
        settings.machine = Machine { acceleration, jerk: 20.0 * acceleration, ..Machine::default() };
        let path = join_with(&passes, true, &plate(), &settings);
        assert_all_visited(&path, &passes, true);
        assert_eq!(retracts(&path), 0);
        let links = || path.segments().filter(|(.., m)| m.kind == MoveKind::Link);
        for (from, to, _) in links() {
            assert_eq!((from.z, to.z), (0.0, 0.0));
            // Within a twentieth of a half circle of 0.25 mm around the middle between two passes.
            let x = if to.x < 10.0 { 5.0 - to.x } else { to.x - 15.0 };
            assert!((-1e-9..0.2625).contains(&x), "{to}");
        }
        let length = links().map(|(a, b, _)| (b - a).norm()).sum::<f64>() / 7.0;
        assert!((0.5..most).contains(&length), "{acceleration}: {length} mm");
        let [ours, circles] = [&path, &with_half_circles(&path)]
            .map(|path| machine::machining_time(path, &settings.machine, &Silent).unwrap());
        assert!(ours <= 1.001 * circles, "{acceleration}: {ours} {circles} s");
    }
}

#[test]
fn ends_close_beside_each_other_are_joined_by_a_loop() {
    for shift in [0.0, 0.3, -0.3] {
        let passes = [line([5.0, 10.0], [15.0, 10.0]), line([15.0 + shift, 10.05], [5.0, 10.05])];
        let path = joined(&plate(), &passes, false, Links::Surface);
        assert!(count(&path, MoveKind::Link) > 0 && retracts(&path) == 0);
        let on_surface = path.segments().filter(|(.., m)| m.kind.is_on_surface());
        let steps: Vec<_> = on_surface.map(|(a, b, _)| b - a).collect();
        let sharpest = steps.windows(2).map(|w| w[0].angle(&w[1])).fold(0.0, f64::max);
        assert!(sharpest < 0.4, "{sharpest}");
    }
}

#[test]
fn links_do_not_leave_the_part() {
    // Passes up to the very border, at an angle to it, and across a gap in it.
    let passes: Vec<_> = (0..30)
        .map(|k| 2.0 + 0.5 * f64::from(k))
        .map(|y| line([0.25 * (y - 2.0), y], [20.0 - 0.1 * y, y]))
        .collect();
    let path = joined(&plate(), &passes, true, Links::Surface);
    assert_all_visited(&path, &passes, true);
    assert!(count(&path, MoveKind::Link) > 0);
    let roll = MOST_ROLL_OF_TESTS * 0.5;
    for m in path.moves.iter().filter(|m| m.kind.is_on_surface()) {
        let p = m.to.tip;
        let outside = (-p.x).max(p.x - 20.0).max(-p.y).max(p.y - 20.0);
        // A ball of 3 mm that hangs over by d has turned by d/3 and rolled by as much of its rim.
        assert!(outside <= roll * 1.01, "{p}");
        let hang = outside.max(0.0);
        assert!((p.z - ((9.0 - hang * hang).sqrt() - 3.0)).abs() < 1.1e-3, "{p}");
    }
}

/// Intervals that [`bend`] lets a link roll over the border.
const MOST_ROLL_OF_TESTS: f64 = 2.0;

#[test]
fn a_wall_between_two_ends_forces_a_retract() {
    let part = walled();
    // The ball stands 3 mm off the wall on either side, at most 7.1 mm from end to end.
    let passes = [line([2.0, 10.0], [6.45, 10.0]), line([13.55, 10.0], [18.0, 10.0])];
    let mut longer = settings(Links::Surface);
    longer.joining.longest_link = Some(8.0);
    let path = join_with(&passes, true, &part, &longer);
    assert_eq!(count(&path, MoveKind::Link), 0, "over the wall it is longer than 8 mm");
    let over = path.segments().filter(|(.., m)| m.kind == MoveKind::Rapid).map(|(_, to, _)| to.z);
    assert!(over.fold(0.0, f64::max) >= 7.0);
    assert_eq!(rapids_in_stock(&path), 0);
    // Without the wall the same passes are linked.
    let path = join_with(&passes, true, &plate(), &longer);
    assert!(count(&path, MoveKind::Link) > 0 && retracts(&path) == 0);
}

#[test]
fn retracts_stay_low_where_all_around_is_cut() {
    let cutter = Cutter::ball(6.0).unwrap();
    let mut ceiling = Ceiling::new(&cutter, [Point2::new(0.0, 0.0), Point2::new(20.0, 20.0)], TOP, u64::MAX);
    let free = |ceiling: &Ceiling| ceiling.free_height(&Point2::new(4.5, 10.2), &Point2::new(14.5, 10.2));
    assert_eq!(free(&ceiling), TOP);
    for pass in (0..41).map(|k| 0.5 * f64::from(k)).map(|y| line([0.0, y], [20.0, y])) {
        ceiling.lower(&pass[0], &pass[1]);
    }
    // Cut to 0 by passes that stand at most 0.3 mm away; squares are 0.375 mm wide.
    assert!((0.0..0.15).contains(&free(&ceiling)), "{}", free(&ceiling));
    // At the border uncut stock stands beside the tool, which may stay below its top by what its
    // profile rises.
    let at_border = ceiling.free_height(&Point2::new(0.0, 10.0), &Point2::new(0.0, 10.0));
    assert!((4.0..TOP - 1.0).contains(&at_border), "{at_border}");
    let outside = Point2::new(-0.1, 10.0);
    assert_eq!(ceiling.free_height(&outside, &outside), TOP);
}

/// Sloped moves at random: a tool at the free height touches nothing of what they left.
#[test]
fn nothing_stands_above_the_free_height() {
    let mut rng = sim::scenes::Rng::new(3);
    for cutter in
        [Cutter::ball(6.0), Cutter::flat(5.0), Cutter::bull(6.0, 1.0), Cutter::taper(2.0, 1.0, 0.3, 6.0)]
    {
        let cutter = cutter.unwrap();
        let corners = [Point2::new(0.0, 0.0), Point2::new(20.0, 20.0)];
        let mut ceiling = Ceiling::new(&cutter, corners, TOP, u64::MAX);
        let mut place = || Point3::new(rng.within(0.0, 20.0), rng.within(0.0, 20.0), rng.within(0.0, 5.0));
        let mut moves = Vec::new();
        let start = place();
        let mut at = start;
        for k in 0..600 {
            let to = place();
            let kind = if k < 400 { MoveKind::Cut } else { MoveKind::Rapid };
            if kind == MoveKind::Cut {
                ceiling.lower(&at, &to);
                moves.push(Move { to: ClPoint::upright(to), kind, feed_rate: 1.0, pass: 0 });
                at = to;
                continue;
            }
            let free = ceiling.free_height(&at.xy(), &to.xy()) + 1e-5;
            // Up at feed, since it is the way over that is tested.
            let up = Point3::new(at.x, at.y, free);
            moves.push(Move { to: ClPoint::upright(up), kind: MoveKind::Retract, feed_rate: 1.0, pass: 0 });
            let over = Point3::new(to.x, to.y, free);
            moves.push(Move { to: ClPoint::upright(over), kind, feed_rate: 0.0, pass: 0 });
            at = over;
        }
        let path = Toolpath::new(ClPoint::upright(start), moves);
        let grid = Grid { origin: Point2::new(-4.0, -4.0), cell: 0.1, nx: 280, ny: 280 };
        let removal = cut_in_order(ZMap::block(grid, TOP), &cutter, &path, &Silent).unwrap();
        assert_eq!(removal.rapid_contacts.first(), None);
    }
}

#[test]
fn closed_passes_are_entered_where_they_are_near_and_in_the_same_sense() {
    let circle = |r: f64| -> Vec<Point3> {
        let mut points: Vec<Point3> = (0..200)
            .map(|k| std::f64::consts::TAU * f64::from(k) / 200.0)
            .map(|t| Point3::new(10.0 + r * t.cos(), 10.0 + r * t.sin(), 0.0))
            .collect();
        points.push(points[0]);
        points
    };
    let mut passes: Vec<_> = (1..12).map(|k| circle(0.5 * f64::from(k))).collect();
    passes.iter_mut().step_by(2).for_each(|p| p.reverse());
    let path = joined(&plate(), &passes, true, Links::Surface);
    assert_all_visited(&path, &passes, true);
    assert_eq!(retracts(&path), 0, "one spiral");
    let steps: Vec<_> =
        path.segments().filter(|(.., m)| m.kind.is_on_surface()).map(|(a, b, _)| b - a).collect();
    let sharpest = steps.windows(2).map(|w| w[0].angle(&w[1])).fold(0.0, f64::max);
    assert!(sharpest < 0.5 * std::f64::consts::PI, "{sharpest}");
}

/// The cheapest of all orders and directions, by trying them all.
fn brute_force(passes: &[Vec<Point3>], costs: Costs<'_>) -> f64 {
    fn go(passes: &[Vec<Point3>], costs: Costs<'_>, used: u32, at: Option<Point3>) -> f64 {
        let mut best = f64::INFINITY;
        for (k, p) in passes.iter().enumerate().filter(|(k, _)| used & (1 << k) == 0) {
            for (a, b) in [(p[0], p[1]), (p[1], p[0])] {
                let way = at.map_or_else(|| (costs.start)(&a), |at| (costs.between)(&at, &a));
                best = best.min(way + go(passes, costs, used | (1 << k), Some(b)));
            }
        }
        if best.is_infinite() { at.map_or(0.0, |at| (costs.finish)(&at)) } else { best }
    }
    go(passes, costs, 0, None)
}

fn air(passes: &[Vec<Point3>], costs: Costs<'_>, visits: &[Visit]) -> f64 {
    let ends = |v: &Visit| {
        let p = &passes[v.pass];
        if v.reversed { (p[p.len() - 1], p[0]) } else { (p[0], p[p.len() - 1]) }
    };
    let between = visits.windows(2).map(|w| (costs.between)(&ends(&w[0]).1, &ends(&w[1]).0));
    let [first, last] = [visits[0], visits[visits.len() - 1]].map(|visit| ends(&visit));
    between.sum::<f64>() + (costs.start)(&first.0) + (costs.finish)(&last.1)
}

/// Costs that are distances.
fn along_distance() -> Costs<'static> {
    Costs { between: &|a, b| (b - a).norm(), start: &|_| 0.0, finish: &|_| 0.0 }
}

fn random_passes(n: usize, seed: u64) -> Vec<Vec<Point3>> {
    let mut rng = sim::scenes::Rng::new(seed);
    (0..n)
        .map(|_| {
            let (x, y) = (rng.within(0.0, 100.0), rng.within(0.0, 100.0));
            line([x, y], [x + rng.within(-9.0, 9.0), y + rng.within(-9.0, 9.0)])
        })
        .collect()
}

/// With ways to the first place and from the last one as well, which are dear at one side of the part.
#[test]
fn orders_are_nearly_the_shortest() {
    let dear = Costs { start: &|place| 2.0 * place.x, finish: &|place| 0.5 * place.x, ..along_distance() };
    for costs in [along_distance(), dear] {
        let (mut found, mut best) = (0.0, 0.0);
        for seed in 1..40 {
            let passes = random_passes(6, seed);
            let got = air(&passes, costs, &order(&passes, true, costs));
            let least = brute_force(&passes, costs);
            assert!(got >= least - 1e-9 && got < 1.5 * least, "{seed}: {got} {least}");
            (found, best) = (found + got, best + least);
        }
        assert!(found < 1.04 * best, "{found} {best}");
    }
}

#[test]
fn ten_thousand_passes_are_ordered_better_than_by_nearest_ends() {
    let passes = random_passes(10_000, 7);
    let visits = order(&passes, true, along_distance());
    let mut seen: Vec<usize> = visits.iter().map(|v| v.pass).collect();
    seen.sort_unstable();
    assert!(seen.iter().enumerate().all(|(k, &p)| k == p) && seen.len() == 10_000);
    let greedy = order::nearest_ends(&passes, &vec![false; passes.len()], true);
    let [greedy, got] = [&greedy, &visits].map(|visits| air(&passes, along_distance(), visits));
    assert!(got < 0.85 * greedy, "{got} {greedy}");
    assert_eq!(visits, order(&passes, true, along_distance()));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn whatever_the_passes_all_are_cut_and_no_rapid_touches_stock(
        ends in prop::collection::vec((0.0..20.0f64, 0.0..20.0f64, -6.0..6.0f64, -6.0..6.0f64), 1..25),
        both_ways in any::<bool>(),
        surface in any::<bool>(),
    ) {
        // Away from the border where a pass would lead over it, so that each has a length.
        let end = |from: f64, by: f64| if (0.0..=20.0).contains(&(from + by)) { from + by } else { from - by };
        let passes: Vec<_> = ends.iter().map(|&(x, y, dx, dy)| line([x, y], [end(x, dx), end(y, dy)])).collect();
        let links = if surface { Links::Surface } else { Links::Retract };
        let path = joined(&plate(), &passes, both_ways, links);
        assert_all_visited(&path, &passes, both_ways);
        prop_assert_eq!(rapids_in_stock(&path), 0);
        // Never below the plate by more than the chords, and never over more than the safe height.
        prop_assert!(path.moves.iter().all(|m| m.to.tip.z <= TOP + 2.0));
    }
}

/// Of two ways through the same passes that one is taken whose first descent, which is fed slowly, is the
/// shorter.
#[test]
fn passes_begin_at_the_higher_end() {
    let passes: Vec<Vec<Point3>> = (0..4)
        .map(|k| {
            let (x, z) = (5.0 + f64::from(k), -f64::from(k));
            vec![Point3::new(x, 5.0, z), Point3::new(x, 15.0, z)]
        })
        .collect();
    let fed_down = |passes: &[Vec<Point3>]| {
        let path = joined(&plate(), passes, true, Links::Retract);
        assert_eq!(path.start.tip.x, 5.0);
        path.start.tip.z - path.moves[0].to.tip.z
    };
    let low_first: Vec<Vec<Point3>> = passes.iter().rev().cloned().collect();
    assert_eq!(fed_down(&passes), fed_down(&low_first));
}

/// The tool rises by the clearance at the feed, where it may still touch what it cut, and on at rapid rate.
#[test]
fn a_retract_is_rapid_beyond_the_clearance() {
    let path = joined(&plate(), &[line([5.0, 5.0], [15.0, 5.0])], true, Links::Retract);
    let ups = path.segments().skip(2).map(|(from, to, m)| (m.kind, from.z, to.z)).collect::<Vec<_>>();
    assert_eq!(ups, [(MoveKind::Retract, 0.0, 2.0), (MoveKind::Rapid, 2.0, TOP + 2.0)]);
}

/// The first pass is entered from beside the stock where that is quicker than a plunge: down where nothing
/// stands, in at the feed, over what of the part stands higher and from there down no faster than a plunge,
/// and no rapid touches the block.
#[test]
fn the_first_pass_is_entered_from_beside_the_stock() {
    let pass = [line([1.0, 10.0], [19.0, 10.0])];
    // A wall of 5 mm along x = 0, from which the ball of 3 mm stands off.
    let wall = [(0.0, 5.0), (0.5, 5.0), (0.5001, 0.0), (20.0, 0.0)];
    let vertices =
        wall.iter().flat_map(|&(x, z)| [Point3::new(x, 0.0, z), Point3::new(x, 20.0, z)]).collect();
    let triangles =
        (0..3u32).flat_map(|k| [[2 * k, 2 * k + 2, 2 * k + 1], [2 * k + 1, 2 * k + 2, 2 * k + 3]]).collect();
    let behind_wall = Part::from_mesh(TriangleMesh::new(vertices, triangles).unwrap().0);
    let off_wall = [line([3.6, 10.0], [19.0, 10.0])];
    for (part, passes, both_ways, side, gain) in [
        (&plate(), &pass, true, "least x", 1.2),
        (&behind_wall, &off_wall, true, "greatest x", 1.2),
        (&behind_wall, &off_wall, false, "least x", 0.05),
    ] {
        let mut settings = settings(Links::Surface);
        settings.stock =
            Some(geometry::Aabb { min: Point3::new(0.0, 0.0, -1.0), max: Point3::new(20.0, 20.0, TOP) });
        let plunged = join_with(passes, both_ways, part, &settings);
        settings.may_enter_beside = true;
        assert_eq!(plunged.moves[0].kind, MoveKind::Plunge);
        let path = join_with(passes, both_ways, part, &settings);
        assert_all_visited(&path, passes, both_ways);
        let start = path.start.tip;
        let away = if side == "least x" { -start.x } else { start.x - 20.0 };
        assert!((away - 5.0).abs() < 1e-9 && (start.z - (TOP + 2.0)).abs() < 1e-9, "{side}: {start}");
        assert_eq!(path.moves[0].kind, MoveKind::Rapid);
        let [quick, slow] =
            [&path, &plunged].map(|path| machine::machining_time(path, &settings.machine, &Silent).unwrap());
        // 9 mm down at 5 mm/s against 6 mm at 16.7 mm/s.
        assert!(slow - quick > gain, "{side}: {quick} {slow}");
        let grid = Grid { origin: Point2::new(0.0, 0.0), cell: 0.1, nx: 200, ny: 200 };
        let cutter = Cutter::ball(6.0).unwrap();
        let removal = cut_in_order(ZMap::block(grid, TOP), &cutter, &path, &Silent).unwrap();
        for (a, b, m) in path.segments().filter(|(.., m)| m.kind == MoveKind::Plunge) {
            let down = m.feed_rate * (a.z - b.z) / (b - a).norm();
            assert!(m.feed_rate <= settings.feed_rate && down <= settings.plunge_rate * (1.0 + 1e-9));
        }
        // Walls that the cutter itself has left may touch it.
        assert!(removal.rapid_contacts.iter().all(|contact| contact.depth < 1e-6 && contact.travel < 1e-6));
        let drop = DropCutter::new(part, &cutter);
        for (a, b, _) in path.segments().filter(|(.., m)| m.kind != MoveKind::Rapid) {
            for k in 0..=20 {
                let p = a + (b - a) * (f64::from(k) / 20.0);
                // Over the steep rim of the ball a tolerance to the side is more than one in height.
                let least = |x: f64| drop.at(x, p.y).map_or(f64::NEG_INFINITY, |drop| drop.tip_z);
                let least = [-1.0, 0.0, 1.0].map(|side| least(p.x + side * settings.chord_tolerance));
                let least = least.into_iter().fold(f64::INFINITY, f64::min);
                assert!(p.z >= least - settings.chord_tolerance, "{side}: {p} {least}");
            }
        }
    }
    // Between walls on all sides, with stock far beyond them, it stays a plunge.
    let mut wide = settings(Links::Surface);
    wide.stock =
        Some(geometry::Aabb { min: Point3::new(-90.0, -90.0, -1.0), max: Point3::new(90.0, 90.0, TOP) });
    let path = join_with(&pass, true, &plate(), &wide);
    assert_eq!(path.moves[0].kind, MoveKind::Plunge);
}
