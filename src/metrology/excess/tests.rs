//! The bound against brute force: every move at many places.

use super::cells_above;
use super::patch::least_greatest;
use crate::{
    Asked, Bounded, Budget, EngineChoice, ExcessFigures, ExcessKind, Judged, Limits, Measurement, Simulation,
    Task, measure,
};
use cutter::Cutter;
use geometry::{
    Aabb, AnalyticShape, AnalyticSurface, NurbsSurface, Point2, Point3, TriangleMesh, Vector2, Vector3,
};
use motion::{ClPoint, Cutters, Move, MoveKind, Toolpath};
use part::{Part, Patch};
use proptest::prelude::*;
use sim::{Envelope, Grid, Stock, ZMap, cut_reference};
use work::monitor::Silent;

const LIMITS: Limits = Limits { scallop: 0.01, gouge: 0.005, uncut: 0.05, chord: 0.001 };

/// Height of the stock over the part, mm.
const TOP: f64 = 3.0;

/// Side of the parts, from the origin, mm.
const SIDE: f64 = 4.0;

fn formula(shape: AnalyticShape) -> Part {
    let surface = AnalyticSurface::new(shape, [[0.0, SIDE]; 2]).unwrap();
    Part::from_patches(vec![Patch::Analytic(surface)], 0.001).unwrap()
}

fn part(k: usize) -> Part {
    let cylinder =
        |concave| formula(AnalyticShape::Cylinder { height: 0.0, radius: 15.0, azimuth: 0.4, concave });
    match k {
        0 => formula(AnalyticShape::Plane { height: 0.0 }),
        1 => formula(AnalyticShape::Inclined { height: 0.0, angle: 0.5, azimuth: 0.3 }),
        2 => cylinder(false),
        3 => cylinder(true),
        4 => formula(AnalyticShape::Wave { amplitude: 0.1, wavelength_x: 7.0, wavelength_y: Some(9.0) }),
        _ => roof(),
    }
}

/// Two slopes that meet in a ridge askew, and end at a border askew.
fn roof() -> Part {
    let corners = [
        [0.0, 0.0, 0.0],
        [SIDE, 0.3, 0.0],
        [0.0, 1.9, 0.35],
        [SIDE, 2.4, 0.35],
        [0.2, SIDE, 0.0],
        [SIDE, 3.7, 0.05],
    ];
    let corners = corners.map(Point3::from).to_vec();
    let triangles = vec![[0, 1, 2], [1, 3, 2], [2, 3, 4], [3, 5, 4]];
    Part::from_mesh(TriangleMesh::new(corners, triangles).unwrap().0)
}

/// Passes of a cutter that touch the part, or stay over it by `lift`, at an angle to x, from beyond the part
/// to beyond it.
fn path(part: &Part, cutter: &Cutter, angle: f64, step: f64, lift: f64) -> Toolpath {
    let (along, across) = (Vector2::new(angle.cos(), angle.sin()), Vector2::new(-angle.sin(), angle.cos()));
    let middle = Point2::new(0.5 * SIDE, 0.5 * SIDE);
    let mut moves = Vec::new();
    let count = (1.5 * SIDE / step) as i32;
    for pass in -count / 2..=count / 2 {
        let mut first = true;
        for k in -30..=30 {
            let q = middle + across * (step * f64::from(pass)) + along * (0.1 * f64::from(k));
            let Some(at) = part.highest_at(q.x, q.y) else { continue };
            let tip = at.point + cutter.contact_to_tip(&at.normal) + at.normal * lift;
            let kind = if std::mem::take(&mut first) { MoveKind::Rapid } else { MoveKind::Cut };
            if kind == MoveKind::Rapid {
                let to = ClPoint::upright(Point3::new(tip.x, tip.y, 9.0));
                moves.push(Move { to, kind, feed_rate: 1000.0, pass: (pass + count) as u32 });
            }
            let to = ClPoint::upright(tip);
            moves.push(Move { to, kind, feed_rate: 1000.0, pass: (pass + count) as u32 });
        }
    }
    Toolpath::new(ClPoint::upright(Point3::new(0.0, 0.0, 9.0)), moves)
}

fn measured(part: &Part, cutter: &Cutter, path: &Toolpath, cell: f64) -> Measurement {
    measured_holding(1 << 20, part, cutter, path, cell)
}

/// With no more than so many squares at a time.
fn measured_holding(
    most_squares: usize,
    part: &Part,
    cutter: &Cutter,
    path: &Toolpath,
    cell: f64,
) -> Measurement {
    let grid = Grid::covering(&part.bounds(), cell, 64, 1 << 30).unwrap();
    let cut = cut_reference(&ZMap::block(grid, TOP), cutter, path, &Silent).unwrap();
    let asked = Asked {
        allowed_depth: 0.0,
        error_bound: 5e-4,
        most_cells: 1 << 20,
        most_squares,
        is_first_look: false,
        border_cuts: true,
        steep_elsewhere: false,
    };
    measure(part, cutter, path, &cut, &LIMITS, &asked, &Silent).unwrap()
}

/// How high material stands along the normal of a place, every move looked at; `None` off the part.
struct Brute<'a> {
    part: &'a Part,
    envelope: Envelope,
    /// On cells all moves cut, rapid ones too.
    all: Vec<u32>,
}

impl<'a> Brute<'a> {
    fn new(part: &'a Part, cutter: &Cutter, path: &Toolpath) -> Self {
        Self { part, envelope: Envelope::new(cutter, path), all: (0..path.len() as u32).collect() }
    }

    fn at(&self, x: f64, y: f64) -> Option<f64> {
        let foot = self.part.highest_at(x, y)?;
        Some(self.along(&foot.point, &foot.normal))
    }

    /// Where a line from a place of the design comes out first.
    fn along(&self, from: &Point3, way: &Vector3) -> f64 {
        let height =
            |q: &Point3| self.envelope.lowest(q.x, q.y, &self.all).map_or(TOP, |(z, _)| z.min(TOP)) - q.z;
        if way.xy().norm() == 0.0 {
            return height(from).clamp(-0.5, 2.0 * TOP);
        }
        let stands = |t: f64| height(&(from + way * t)) > 0.0;
        let between = |mut low: f64, mut high: f64| {
            for _ in 0..40 {
                let t = 0.5 * (low + high);
                if stands(t) { low = t } else { high = t }
            }
            low
        };
        let end = between(-0.5, 2.0 * TOP);
        // Beyond it may enter what stands on other places.
        let steps = (end / 0.01) as u32;
        let out = (0..steps).map(|k| 0.01 * f64::from(k)).find(|t| !stands(*t));
        out.map_or(end, |out| between(out - 0.01, out))
    }

    /// The highest of many places.
    fn highest(&self, places: usize) -> f64 {
        let bounds = self.part.bounds();
        let at =
            |i: usize, low: f64, high: f64| low + (high - low) * (i as f64 + 1e-6) / (places as f64 + 2e-6);
        let of_row = |j: usize| {
            let y = at(j, bounds.min.y, bounds.max.y);
            (0..=places).filter_map(|i| self.at(at(i, bounds.min.x, bounds.max.x), y)).fold(0.0, f64::max)
        };
        work::parallel::map(places + 1, of_row).into_iter().fold(0.0, f64::max)
    }

    /// Whether nothing of the `truth` stands above figure and bound, and the figure is what stands at its
    /// place: on a crest along one of the normals between those beside it.
    fn confirms(&self, found: &Bounded, truth: f64) -> bool {
        let Some(at) = found.at_mm.map(Point3::from) else {
            return truth.max(found.max_mm) <= found.error_bound_mm + 1e-9;
        };
        let beside = [(-1e-6, -1e-6), (1e-6, -1e-6), (-1e-6, 1e-6), (1e-6, 1e-6)];
        let normals: Vec<Vector3> = beside
            .iter()
            .filter_map(|(x, y)| Some(self.part.highest_at(at.x + x, at.y + y)?.normal))
            .collect();
        let is_crest = normals.iter().any(|n| normals[0].dot(n) < 0.999);
        let there = self.at(at.x, at.y).unwrap_or(0.0);
        let is_there = (there - found.max_mm).abs() <= found.error_bound_mm + 1e-9;
        let is_between = || {
            let shares = || (0..=2000).map(|k| f64::from(k) / 2000.0);
            let ways = |a: Vector3, b: Vector3| shares().map(move |s| (a + (b - a) * s).normalize());
            let heights = normals[1..].iter().flat_map(|b| ways(normals[0], *b));
            heights.map(|way| self.along(&at, &way)).fold(0.0, f64::max) >= 0.99 * found.max_mm
        };
        truth <= found.at_most() + 1e-9 && (is_there || is_crest && is_between())
    }
}

/// Figure and bound of passes on a part against brute force.
fn holds(
    shape: usize,
    tool: usize,
    angle: f64,
    step: f64,
    lift: f64,
    cell: f64,
) -> Result<(), TestCaseError> {
    let part = part(shape);
    let cutter = [Cutter::ball(6.0), Cutter::bull(6.0, 1.0), Cutter::flat(3.0)][tool].clone().unwrap();
    let path = path(&part, &cutter, angle, step, lift);
    let Measurement { excess: found, scallop, .. } = measured(&part, &cutter, &path, cell);
    if let (ExcessKind::Scallop, Some(ridge)) = (found.kind, scallop.max_mm) {
        // What is highest of all and a ridge is the highest ridge.
        let bounds = scallop.error_bound_mm.unwrap() + found.highest.error_bound_mm;
        prop_assert!((ridge - found.highest.max_mm).abs() <= bounds, "{scallop:?} {found:?}");
    }
    let brute = Brute::new(&part, &cutter, &path);
    let truth = brute.highest(80);
    prop_assert!(brute.confirms(&found.highest, truth), "{truth} {found:?}");
    let all = found.reached.at_most().max(found.unreached.at_most());
    prop_assert!(all >= truth - 1e-9, "{truth} {found:?}");
    Ok(())
}

/// Every cell over which brute force finds more than a height is told, and next to none over which it does not.
#[test]
fn cells_that_hold_more_than_a_height_are_told() {
    let cases = [(1, Cutter::ball(6.0)), (4, Cutter::ball(6.0)), (5, Cutter::bull(6.0, 1.0))];
    for (shape, cutter) in cases {
        let (part, cutters) = (part(shape), Cutters::from(&cutter.unwrap()));
        let path = path(&part, cutters.first(), 0.7, 0.5, 0.0);
        let grid = Grid::covering(&part.bounds(), 0.13, 64, 1 << 30).unwrap();
        let block = Aabb { max: part.bounds().max + Vector3::z() * TOP, ..part.bounds() };
        let cut = cut_reference(&ZMap::block(grid, block.max.z), cutters.first(), &path, &Silent).unwrap();
        let simulation = Simulation {
            cell: grid.cell,
            cell_is_auto: false,
            memory_mib: 64,
            engine: EngineChoice::default(),
            removal: false,
            error_bound: 5e-4,
            voxel: None,
        };
        let task = Task {
            part: &part,
            cutters: &cutters,
            holder: None,
            path: &path,
            stock: &Stock::Box(block),
            cells: &(grid, None),
            limits: &LIMITS,
            simulation: &simulation,
            pocket: false,
            budget: Budget::new(&part, 64),
            judged: Judged::Facing,
            is_first_look: false,
            allowed_depth: 0.0,
        };
        let brute = Brute::new(&part, cutters.first(), &path);
        let over = |k: usize| {
            let (centre, share) = (grid.centre(k % grid.nx, k / grid.nx), |i: i32| f64::from(i - 4) / 8.02);
            let places = (0..81).map(|i| centre + Vector2::new(share(i % 9), share(i / 9)) * grid.cell);
            places.filter_map(|q| brute.at(q.x, q.y)).fold(0.0, f64::max)
        };
        let truth = work::parallel::map(grid.len(), over);
        for height in [0.004, 0.008, 0.0098] {
            let told = cells_above(&task, &cut, height, &Silent).unwrap();
            let missed = (0..told.len()).filter(|k| !told[*k] && truth[*k] > height + 1e-7).count();
            let spare = (0..told.len()).filter(|k| told[*k] && truth[*k] < 0.98 * height).count();
            let all = truth.iter().filter(|found| **found > height).count();
            assert_eq!(missed, 0, "{shape} {height}: {all} in all, {spare} spare");
            assert!(spare <= told.len() / 100, "{shape} {height}: {spare} of {} beside {all}", told.len());
        }
    }
}

/// Ridges that come near the limit everywhere are told from it though few squares can be held: what may stand
/// above it is looked at closer while it is collected.
#[test]
fn few_squares_are_enough_where_all_ridges_hold() {
    let (part, cutter) = (part(4), Cutter::ball(6.0).unwrap());
    let path = path(&part, &cutter, 0.0, 2.0 / 4.5, 0.0);
    let found = measured_holding(128, &part, &cutter, &path, 0.2).excess.reached;
    assert!(found.max_mm > 0.0094 && found.at_most() < LIMITS.scallop, "{found:?}");
}

/// Passes over half of a part. What stands on the other half fails for certain, and its bound holds; so does
/// that of what the passes left.
#[test]
fn what_no_pass_came_to_is_higher_than_its_limit_for_certain() {
    let cutter = Cutter::ball(6.0).unwrap();
    for shape in [2, 4, 5] {
        let part = part(shape);
        let Toolpath { start, mut moves, .. } = path(&part, &cutter, 0.0, 0.4, 0.0);
        moves.retain(|m| m.to.tip.y < 0.4 * SIDE);
        let path = Toolpath::new(start, moves);
        let found = measured(&part, &cutter, &path, 0.05).excess;
        let brute = Brute::new(&part, &cutter, &path);
        let truth = brute.highest(80);
        assert!(found.unreached.at_least_mm > LIMITS.uncut, "{shape}: {truth} {found:?}");
        let all = found.reached.at_most().max(found.unreached.at_most());
        assert!(all >= truth - 1e-9 && found.highest.at_most() >= truth - 1e-9, "{shape}: {truth} {found:?}");
    }
}

/// A ridge whose foot along the normal lies beyond the border is none of the part's.
#[test]
fn what_leans_over_the_border_from_beyond_does_not_count() {
    holds(1, 0, 1.729461721076573, 0.9134534938493454, 0.0, 0.04).unwrap();
}

/// The place that stands above a corner of a square lies aside by the normal there, not by the one in the
/// middle.
#[test]
fn normals_that_turn_within_a_square_are_bounded() {
    holds(2, 1, 2.9463434509808835, 1.0726896715766943, 0.04652898462678416, 0.5).unwrap();
}

/// Between cells a move may take off a ridge that is hardly higher than the numerical floor. Then none is
/// told.
#[test]
fn ridges_of_nanometres_that_a_move_takes_off_are_not_told() {
    holds(0, 1, 2.2443622065546873, 0.25, 0.0, 0.04).unwrap();
}

/// Normals that lean toward each other bring places above a square nearer to its middle, by no more than they
/// lean.
#[test]
fn normals_that_lean_inward_are_bounded() {
    holds(4, 0, 0.7942938731436355, 1.0453565992581253, 0.0, 0.5).unwrap();
}

/// A strip between rims is higher than what stands along the normals beside a crest that it leans over.
#[test]
fn a_strip_that_leans_over_a_crest_stands_on_no_place_of_it() {
    holds(5, 2, 2.5944269557144413, 1.1031150406637682, 0.0, 0.04).unwrap();
}

/// On slopes what stands over a place is aside of it. The bound of high ridges closes all the same.
#[test]
fn high_ridges_on_slopes_are_bounded_as_closely_as_asked() {
    let ball = Cutter::ball(6.0).unwrap();
    for shape in [1, 3] {
        let part = part(shape);
        let path = path(&part, &ball, 0.4, 2.2, 0.0);
        let found = measured(&part, &ball, &path, 0.1).excess.highest;
        let truth = Brute::new(&part, &ball, &path).highest(80);
        assert!(truth > 0.15, "{truth}");
        assert!(found.error_bound_mm <= 5e-4 + 1e-6, "{shape}: {found:?}");
        assert!(truth <= found.at_most() + 1e-9, "{shape}: {truth} {found:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(6))]

    /// Nothing stands higher than figure and bound, on any part, by any cutter, with fine cells and coarse
    /// ones.
    #[test]
    fn nothing_stands_above_the_bound(
        shape in 0usize..6,
        tool in 0usize..3,
        angle in 0.0..3.1f64,
        step in 0.25..1.2f64,
        lift in prop_oneof![Just(0.0), 0.0..0.1f64],
        cell in prop_oneof![Just(0.04), Just(0.1), Just(0.5), Just(2.0)],
    ) {
        holds(shape, tool, angle, step, lift, cell)?;
    }

    /// A mean of rows is never below the value of the game, and near it.
    #[test]
    fn the_best_mean_of_two_rows_is_found(a in prop::array::uniform4(-1.0..1.0f64), b in prop::array::uniform4(-1.0..1.0f64)) {
        let greatest = |share: f64| (0..4).map(|k| a[k] + share * (b[k] - a[k])).fold(f64::NEG_INFINITY, f64::max);
        let brute = (0..=10_000).map(|k| greatest(f64::from(k) * 1e-4)).fold(f64::INFINITY, f64::min);
        let found = least_greatest(&[a, b], 4);
        prop_assert!(found <= brute + 1e-9 && found >= brute - 1e-3, "{found} {brute}");
    }
}

#[test]
fn slopes_that_fall_away_from_a_ridge_cancel() {
    let rows = [[0.9, 1.1, 0.9, 1.1], [1.1, 0.9, 1.1, 0.9], [3.0; 4]];
    assert!((least_greatest(&rows, 4) - 1.0).abs() < 1e-12);
    // Three moves that meet in a point.
    let rows = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let found = least_greatest(&rows, 3);
    assert!((1.0 / 3.0 - 1e-12..0.45).contains(&found), "{found}");
}

/// Passes along x over the plane.
fn on_plane(lines: &[f64]) -> Toolpath {
    straight(&lines.iter().map(|y| [*y, 0.0]).collect::<Vec<_>>())
}

/// Passes along x with tips at these y and z.
fn straight(lines: &[[f64; 2]]) -> Toolpath {
    let mut moves = Vec::new();
    for (pass, &[y, low]) in (0..).zip(lines) {
        let to = |x: f64, z: f64, kind| Move {
            to: ClPoint::upright(Point3::new(x, y, z)),
            kind,
            feed_rate: 1000.0,
            pass,
        };
        moves.extend([
            to(-4.0, 9.0, MoveKind::Rapid),
            to(-4.0, low, MoveKind::Plunge),
            to(8.0, low, MoveKind::Cut),
            to(8.0, 9.0, MoveKind::Retract),
        ]);
    }
    Toolpath::new(ClPoint::upright(Point3::new(-4.0, 0.0, 9.0)), moves)
}

/// How high a ball of 6 mm leaves the plane so far from its pass.
fn sagitta(half: f64) -> f64 {
    3.0 - (9.0 - half * half).sqrt()
}

/// Thousands of short moves cut the same floor up to rims that cross each other everywhere, and one pass
/// along its border cuts the slivers that they left. Cells show none of what covers a sliver, and there are
/// too many moves to ask in every square: the smallest ones ask all, and nothing stands.
#[test]
fn slivers_between_thousands_of_moves_are_decided() {
    let (cutter, radius) = (Cutter::flat(4.0).unwrap(), 2.0);
    // Their rims end anywhere in a strip below that of the pass along the border.
    let place = |k: usize| {
        let (slow, fast) = (0.03 * k as f64, 0.0485 * k as f64);
        Point3::new(2.0 + 2.5 * slow.sin(), SIDE - radius - 0.01 - 0.6 * (1.0 - fast.cos()), 0.0)
    };
    let mut tips: Vec<Point3> = (0..6000).map(place).collect();
    for row in 0..3 {
        tips.extend([-0.5, SIDE + 0.5].map(|x| Point3::new(x, 0.5 + 0.5 * f64::from(row), 0.0)));
    }
    for whole in [true, false] {
        let end = if whole { SIDE + 0.5 } else { 0.5 * SIDE };
        tips.extend([-0.5, end].map(|x| Point3::new(x, SIDE - radius + 0.001, 0.0)));
        let to = |tip: &Point3| Move {
            to: ClPoint::upright(*tip),
            kind: MoveKind::Cut,
            feed_rate: 1000.0,
            pass: 0,
        };
        let moves: Vec<Move> = tips.iter().map(to).collect();
        let path = Toolpath::new(moves[0].to, moves);
        let found = measured(&part(0), &cutter, &path, 0.1).excess.highest;
        assert_eq!(found.max_mm > 0.5 * TOP, !whole, "{found:?}");
        assert!(found.error_bound_mm < 1e-3 || !whole, "{found:?}");
        tips.truncate(tips.len() - 2);
    }
}

/// A floor, a wall, and a level above it: a pass on the floor leaves the more the nearer a place is to the
/// wall, most of all in the strip of a cell whose centre lies beyond the wall.
#[test]
fn what_stands_at_the_foot_of_a_step_is_found_whatever_the_cells() {
    let (high, from_wall) = (0.3, 1.0);
    for wall in [1.97, 1.99, 2.01, 2.03, 2.04] {
        let at = |y: f64, z: f64| [0.0, SIDE].map(|x| Point3::new(x, y, z));
        let corners = [at(0.0, 0.0), at(wall, 0.0), at(wall, high), at(SIDE, high)].concat();
        let triangles =
            (0..3).flat_map(|k| [[2 * k, 2 * k + 1, 2 * k + 2], [2 * k + 2, 2 * k + 1, 2 * k + 3]]);
        let part = Part::from_mesh(TriangleMesh::new(corners, triangles.collect()).unwrap().0);
        let level = (0..12).map(|k| [wall + 0.2 * f64::from(k), high]);
        let floor = [1.8, from_wall].map(|from| [wall - from, 0.0]);
        let path = straight(&level.chain(floor).collect::<Vec<_>>());
        let found = measured(&part, &Cutter::ball(6.0).unwrap(), &path, 0.1).excess.highest;
        let truth = sagitta(from_wall);
        assert!((found.max_mm - truth).abs() <= found.error_bound_mm, "{wall}: {found:?}, {truth}");
        assert!(found.error_bound_mm < 1e-3, "{wall}: {found:?}");
    }
}

/// The same where the wall meets the border, and passes on the floor part from the wall toward it: the upper
/// level beside, which is cut down to the design, makes no foil of what stands in that corner.
#[test]
fn what_stands_in_the_corner_of_a_step_and_the_border_is_found() {
    let (high, wall) = (0.3, 2.0);
    let at = |y: f64, z: f64| [0.0, SIDE].map(|x| Point3::new(x, y, z));
    let corners = [at(0.0, 0.0), at(wall, 0.0), at(wall, high), at(SIDE, high)].concat();
    let triangles = (0..3).flat_map(|k| [[2 * k, 2 * k + 1, 2 * k + 2], [2 * k + 2, 2 * k + 1, 2 * k + 3]]);
    let part = Part::from_mesh(TriangleMesh::new(corners, triangles.collect()).unwrap().0);
    let mut path = straight(&(0..12).map(|k| [wall + 0.2 * f64::from(k), high]).collect::<Vec<_>>());
    let (turn, along) = (Point2::new(3.5, wall - 0.3), Vector2::new(1.0, -0.5).normalize());
    let to = |q: Point2, z: f64, kind| Move {
        to: ClPoint::upright(Point3::new(q.x, q.y, z)),
        kind,
        feed_rate: 1000.0,
        pass: 20,
    };
    for aside in [0.0, 0.5, 1.0, 1.5, 2.0] {
        let from = turn - Vector2::new(0.0, aside);
        let [first, last] = [from - Vector2::x() * 7.0, from + along * 4.0];
        path.moves.extend([
            to(first, 9.0, MoveKind::Rapid),
            to(first, 0.0, MoveKind::Plunge),
            to(from, 0.0, MoveKind::Cut),
            to(last, 0.0, MoveKind::Cut),
            to(last, 9.0, MoveKind::Retract),
        ]);
    }
    let truth = sagitta((Point2::new(SIDE, wall) - turn).perp(&along).abs());
    for cell in [0.05, 0.3] {
        let highest = measured(&part, &Cutter::ball(6.0).unwrap(), &path, cell).excess.highest;
        assert!((highest.max_mm - truth).abs() <= highest.error_bound_mm, "{cell}: {highest:?}, {truth}");
        assert!(highest.error_bound_mm < 1e-4, "{cell}: {highest:?}, {truth}");
    }
}

/// Cells wider than the intervals of the passes see some passes only. What they tell of ridges is true, or
/// not told.
#[test]
fn coarse_cells_tell_no_height_that_no_ridge_has() {
    let (part, ball) = (part(0), Cutter::ball(6.0).unwrap());
    let path = on_plane(&(0..11).map(|k| 0.4 * f64::from(k)).collect::<Vec<_>>());
    let mut told = 0;
    for cell in [0.05, 0.3, 0.5, 0.7, 1.0, 1.7, 2.5, 5.0, 20.0] {
        let Measurement { scallop, excess, .. } = measured(&part, &ball, &path, cell);
        assert!(sagitta(0.2) <= excess.highest.at_most() + 1e-9, "{cell}: {excess:?}");
        let Some((height, bound)) = scallop.max_mm.zip(scallop.error_bound_mm) else { continue };
        assert!((height - sagitta(0.2)).abs() <= bound, "{cell}: {height} ± {bound}");
        told += 1;
    }
    assert!(told >= 3);
}

/// Under a flat end mill whose passes overlap nothing stands on a plane: there is no ridge to name.
#[test]
fn what_leaves_nothing_has_no_kind() {
    let flat = Cutter::flat(6.0).unwrap();
    let even: Vec<f64> = (0..3).map(|k| 2.0 * f64::from(k)).collect();
    for cell in [0.05, 0.3] {
        let found = measured(&part(0), &flat, &on_plane(&even), cell);
        assert_eq!((found.excess.kind, found.scallop.max_mm), (ExcessKind::None, None), "{:?}", found.excess);
        assert!(found.excess.highest.at_most() < 1e-5, "{:?}", found.excess);
    }
}

/// Straight passes over a plane leave ridges of a known height, and more along the border beyond the last
/// one.
#[test]
fn a_remnant_along_the_border_is_as_high_as_its_closed_form() {
    let (part, ball) = (part(0), Cutter::ball(6.0).unwrap());
    let lines: Vec<f64> = (0..9).map(|k| 0.33 + 0.4 * f64::from(k)).collect();
    let path = on_plane(&lines);
    // The last pass is at 3.53, 0.47 from the border; ridges are 0.2 from theirs.
    for cell in [0.05, 0.3] {
        let excess = measured(&part, &ball, &path, cell).excess;
        let (truth, bound) = (sagitta(0.47), excess.highest.error_bound_mm);
        assert_eq!(excess.kind, ExcessKind::Border, "{excess:?}");
        assert!((excess.highest.max_mm - truth).abs() <= bound && bound < 6e-4, "{truth} {excess:?}");
        assert!((excess.highest.at_mm.unwrap()[1] - SIDE).abs() < 0.01, "{excess:?}");
    }
    let even: Vec<f64> = (0..11).map(|k| 0.4 * f64::from(k)).collect();
    let excess = measured(&part, &ball, &on_plane(&even), 0.05).excess;
    assert_eq!(excess.kind, ExcessKind::Scallop);
    assert!(
        (excess.highest.max_mm - sagitta(0.2)).abs() < 2e-6 && excess.highest.error_bound_mm < 1e-5,
        "{excess:?}"
    );
}

/// A level patch whose far border is an arc in the plan: triangles end at its chords. What stands on the
/// slivers between them is within the bound, with a tessellation of any fineness.
#[test]
fn what_stands_between_the_chords_of_a_bent_border_and_its_arc_is_bounded() {
    let row = |places: [[f64; 2]; 3]| places.map(|[x, y]| Point3::new(x, y, 0.0));
    let net = [row([[0.0, 0.0], [2.0, 0.0], [4.0, 0.0]]), row([[0.0, 3.0], [1.3, 4.3], [4.0, 3.2]])];
    let net: Vec<Vec<Point3>> = (0..3).map(|i| vec![net[0][i], net[1][i]]).collect();
    let knots = [vec![0.0, 0.0, 0.0, 1.0, 1.0, 1.0], vec![0.0, 0.0, 1.0, 1.0]];
    let [in_u, in_v] = knots;
    let surface = NurbsSurface::new(2, 1, in_u, in_v, &net, None).unwrap();
    let ball = Cutter::ball(6.0).unwrap();
    let lines: Vec<f64> = (0..12).map(|k| 0.35 + 0.3 * f64::from(k)).filter(|y| *y < 3.4).collect();
    let beyond = 3.0 + 2.6 * 2.6 / (4.0 * 2.4) - lines.last().unwrap();
    for tolerance in [1e-4, 0.002, 0.03] {
        let part = Part::from_patches(vec![Patch::Nurbs(surface.clone())], tolerance).unwrap();
        for cell in [0.05, 0.3] {
            let highest = measured(&part, &ball, &on_plane(&lines), cell).excess.highest;
            let (truth, bound) = (sagitta(beyond), highest.error_bound_mm);
            assert!(
                (highest.max_mm - truth).abs() <= bound && bound < 6e-4,
                "{tolerance} {cell}: {truth} {highest:?}"
            );
        }
    }
}

/// Two flanks that meet in a bent crease: triangles of both end at chords of it, and those of the one lie
/// under the other. The bound comes down there all the same.
#[test]
fn the_bound_closes_along_a_bent_crease() {
    let flank = |out: f64, bend: f64| {
        let control = |i: usize, j: usize| {
            let (i, t) = (i as f64, j as f64 / 3.0);
            let fall = 0.25 * i + bend * i * i * (3.0 * t).sin();
            Point3::new(2.0 + 0.4 * (3.0 * t).sin() + out * i, 4.0 * t, 0.8 - 0.3 * t - fall)
        };
        let net: Vec<Vec<Point3>> = (0..4).map(|i| (0..4).map(|j| control(i, j)).collect()).collect();
        let ends = || vec![0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0];
        Patch::Nurbs(NurbsSurface::new(3, 3, ends(), ends(), &net, None).unwrap())
    };
    let part = Part::from_patches(vec![flank(-0.6, 0.0), flank(0.6, 0.08)], 0.004).unwrap();
    let ball = Cutter::ball(6.0).unwrap();
    for angle in [0.3, 1.2] {
        let path = path(&part, &ball, angle, 0.4, 0.0);
        let highest = measured(&part, &ball, &path, 0.1).excess.highest;
        let brute = Brute::new(&part, &ball, &path);
        let (truth, [x, y, _]) = (brute.highest(300), highest.at_mm.unwrap());
        assert!(brute.confirms(&highest, truth), "{angle}: {truth} {:?} {highest:?}", brute.at(x, y));
        assert!(highest.error_bound_mm < 6e-4, "{angle}: {highest:?}");
    }
}

/// Moves much shorter than a cell, each of its own depth: most win no cell, and are lowest over some place of
/// a ridge. What stands there is what they left, and known as closely as elsewhere, also where no pass came
/// down to the design.
#[test]
fn short_moves_between_cells_leave_no_figure_open() {
    let (part, ball) = (part(0), Cutter::ball(6.0).unwrap());
    for lift in [0.0, 2.0 * LIMITS.uncut] {
        let pass = |k: i32| {
            let depth = move |i: i32| 2e-4 * f64::from((i * 7 + k * 3) % 5);
            let at =
                move |i: i32| Point3::new(-1.0 + 0.03 * f64::from(i), 0.4 * f64::from(k), lift - depth(i));
            std::iter::once(Point3::new(-1.0, 0.4 * f64::from(k), 9.0)).chain((0..=200).map(at))
        };
        let moves = (0..=10).flat_map(|k| {
            pass(k).enumerate().map(move |(i, tip)| {
                let kind = if i == 0 { MoveKind::Rapid } else { MoveKind::Cut };
                Move { to: ClPoint::upright(tip), kind, feed_rate: 1000.0, pass: k as u32 }
            })
        });
        let path = Toolpath::new(ClPoint::upright(Point3::new(-1.0, 0.0, 9.0)), moves.collect());
        let Measurement { excess, uncut, .. } = measured(&part, &ball, &path, 0.3);
        let highest = excess.highest;
        let brute = Brute::new(&part, &ball, &path);
        let truth = brute.highest(200);
        assert!(brute.confirms(&highest, truth), "{lift}: {truth} {highest:?}");
        assert!(highest.error_bound_mm < 6e-4, "{lift}: {truth} {highest:?}");
        assert!(uncut.error_bound_mm < 6e-4, "{lift}: {truth} {uncut:?}");
        assert_eq!(uncut.max_height_mm > 0.0, lift > 0.0, "{uncut:?}");
        if lift > 0.0 {
            assert!((uncut.max_height_mm - truth).abs() < 6e-4, "{truth} {uncut:?}");
        }
    }
}

/// Passes far nearer to each other than cells end beside what is left: some of them win no cell and take the
/// top off what seem to be ridges between others.
#[test]
fn ridges_that_passes_between_cells_take_off_are_no_figures() {
    let (part, bull) = (part(0), Cutter::bull(6.0, 1.0).unwrap());
    for lift in [0.0, 0.01] {
        let moves = (0..=80).flat_map(|k| {
            let [end, up] = [0.21, 0.37].map(|turn| (turn * f64::from(k)).sin());
            let (x, y, z) = (3.6 + 0.08 * end, 0.05 * f64::from(k), lift * up.abs());
            let to = |x: f64, z: f64, kind| {
                let to = ClPoint::upright(Point3::new(x, y, z));
                Move { to, kind, feed_rate: 1000.0, pass: k as u32 }
            };
            let down = [to(x, 9.0, MoveKind::Rapid), to(x, z, MoveKind::Plunge)];
            down.into_iter().chain([to(8.0, z, MoveKind::Cut), to(8.0, 9.0, MoveKind::Retract)])
        });
        let path = Toolpath::new(ClPoint::upright(Point3::new(8.0, 0.0, 9.0)), moves.collect());
        let scallop = measured(&part, &bull, &path, 0.3).scallop;
        let (max, bound) = (scallop.max_mm.unwrap(), scallop.error_bound_mm.unwrap());
        let [x, y, _] = scallop.max_at_mm.unwrap();
        let there = Brute::new(&part, &bull, &path).at(x, y).unwrap();
        assert!((max - there).abs() < 5e-4 && bound < 5e-4, "{lift}: {there} {scallop:?}");
    }
}

/// A flat whose rim ends beside the part's border by less than the last decimal of a program leaves a foil:
/// nothing that stands.
#[test]
fn a_foil_that_rounding_leaves_is_no_material() {
    let (part, flat) = (part(0), Cutter::flat(3.0).unwrap());
    let path = on_plane(&[0.5, 1.5, 2.49998]);
    for cell in [0.05, 0.3] {
        let excess = measured(&part, &flat, &path, cell).excess;
        assert!(excess.highest.at_most() < 1e-4, "{cell}: {excess:?}");
    }
    // What is wider stands.
    let excess = measured(&part, &flat, &on_plane(&[0.5, 1.5, 2.499]), 0.05).excess;
    assert!(excess.highest.at_most() >= TOP, "{excess:?}");
    // So does what is as small, away from the border: a needle between four passes.
    let mut moves: Vec<Move> = on_plane(&[0.5113, 3.5153, 3.9]).moves;
    for x in [0.4873, 3.4913] {
        let at = |y: f64, z: f64, kind| Move {
            to: ClPoint::upright(Point3::new(x, y, z)),
            kind,
            feed_rate: 1000.0,
            pass: 9,
        };
        moves.extend([
            at(-4.0, 9.0, MoveKind::Rapid),
            at(-4.0, 0.0, MoveKind::Plunge),
            at(8.0, 0.0, MoveKind::Cut),
        ]);
        moves.push(at(8.0, 9.0, MoveKind::Retract));
    }
    let path = Toolpath::new(ClPoint::upright(Point3::new(-4.0, 0.0, 9.0)), moves);
    let excess = measured(&part, &flat, &path, 0.05).excess;
    assert!(excess.highest.at_most() >= TOP, "{excess:?}");
}

/// Between two passes of a flat aslant on a slope stands a strip: the longest lines along normals end at its
/// upright side.
#[test]
fn what_ends_at_the_side_of_a_cut_was_not_cut_away() {
    let part = formula(AnalyticShape::Inclined { height: 0.0, angle: 0.15, azimuth: 0.3 });
    let flat = Cutter::flat(3.0).unwrap();
    let top = part.highest_at(2.0, 2.0).unwrap();
    let (along, across) = (Vector2::new(1.0, 1.0).normalize(), Vector2::new(-1.0, 1.0).normalize());
    let mut moves = Vec::new();
    // The third one crosses the strip where lines would leave the part.
    let ends = [[-6.0, 6.0].map(|a| along * a - across * 2.3), [-6.0, 6.0].map(|a| along * a + across * 0.9)];
    for (pass, ends) in (0..).zip(ends.into_iter().chain([[-6.0, 6.0].map(|a| across * a - along * 0.3)])) {
        for (kind, q) in [MoveKind::Rapid, MoveKind::Cut].into_iter().zip(ends) {
            let on = top.point + q.push(-top.normal.xy().dot(&q) / top.normal.z);
            let low = ClPoint::upright(on + flat.contact_to_tip(&top.normal));
            let high = ClPoint::upright(low.tip + Vector3::z() * 9.0);
            let turn = if kind == MoveKind::Rapid { [high, low] } else { [low, high] };
            moves.extend(turn.map(|to| Move { to, kind, feed_rate: 1000.0, pass }));
        }
    }
    let path = Toolpath::new(ClPoint::upright(Point3::new(0.0, 0.0, 9.0)), moves);
    let truth = Brute::new(&part, &flat, &path).highest(400);
    for cell in [0.05, 0.3, 1.0] {
        let ExcessFigures { highest, reached, .. } = measured(&part, &flat, &path, cell).excess;
        assert!(truth > 1.0 && truth <= highest.at_most() + 1e-9, "{cell}: {truth} {highest:?}");
        for found in [highest, reached] {
            assert!(found.error_bound_mm < 0.1 * found.max_mm, "{cell}: {found:?}");
        }
    }
}

/// The rim of a flat leaves walls on slopes, and no move covers both of their sides. Bounds close all the
/// same.
#[test]
fn bounds_close_across_the_walls_that_flats_leave_on_slopes() {
    let flat = Cutter::flat(3.0).unwrap();
    let curved = [(2, 0.0, 0.3), (2, 0.9, 0.6), (2, 1.5, 1.1), (3, 0.0, 0.3)];
    // The last leaves slivers between rims that stand as high as the stock.
    let waves = [(4, 0.4, 0.3), (4, 0.9, 0.6), (4, 2.3, 0.6), (4, 0.4, 1.1)];
    let steep = [(1, 0.9, 1.1), (1, 1.5, 0.6), (1, 2.3, 1.1)];
    for (shape, angle, step) in curved.into_iter().chain(waves).chain(steep) {
        let part = part(shape);
        let path = path(&part, &flat, angle, step, 0.0);
        let highest = measured(&part, &flat, &path, 0.1).excess.highest;
        let truth = Brute::new(&part, &flat, &path).highest(80);
        assert!(truth <= highest.at_most() + 1e-9, "{shape} {angle} {step}: {truth} {highest:?}");
        assert!(highest.error_bound_mm < 2e-3, "{shape} {angle} {step}: {truth} {highest:?}");
    }
}
