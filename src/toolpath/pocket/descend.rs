//! Runs in the plane made into a program: step by step down, with helices and ramps.

use super::route::circle;
use super::route::{Entry, Run};
use super::strategy::{PocketStrategy, WallFinish};
use crate::vocabulary::PlanSettings;
use geometry::{Point2, Point3, foot};
use motion::{ClPoint, DECIMALS, Move, MoveKind, Toolpath, in_last_decimals};

/// Share of the chord tolerance that the chords of a helix may use, when the rest is left to what is done
/// with the moves afterwards. Greater shares make fewer moves.
const ARC_SHARE: f64 = 0.5;

/// A way down begins this far above the stock that is left, mm: rapids end there.
const ABOVE: f64 = 0.5;

/// A ramp shorter than this over the cutter's radius, and than this, mm, goes on along its run, and is a
/// plunge where that is no longer.
const RAMP_OVER_RADIUS: f64 = 1.0 / 6.0;
const LEAST_RAMP: f64 = 0.5;

/// Sides of ways down are no shorter in the plan than so many last decimals of the program: the slope of
/// shorter ones is that of their rounding.
const LEAST_SIDE: f64 = 10.0;

/// Depths and ways below which a difference is rounding, mm.
const ROUNDING: f64 = 1.0e-9;

/// The floors of the steps from the top of the stock down, mm, from the first to the last.
pub(super) fn floors([top, depth]: [f64; 2], strategy: &PocketStrategy) -> Vec<f64> {
    let finish = if strategy.floor_allowance < depth { strategy.floor_allowance } else { 0.0 };
    let rough = top + depth - finish;
    let count = strategy.stepdown.map_or(1.0, |s| (rough / s - ROUNDING).ceil().max(1.0));
    let mut floors: Vec<f64> = (1..=count as usize).map(|k| top - rough * k as f64 / count).collect();
    if finish > 0.0 {
        floors.push(-depth);
    }
    if let Some(last) = floors.last_mut() {
        *last = -depth;
    }
    floors
}

/// A polyline with fewer points (within `tolerance`), none farther apart than `longest`, none of whose
/// sides turns from one that it stands for by more than `turn`, rad: what is ahead of the cutter stays so.
/// Sides that stand for several keep to the walls as `holds` says.
pub(super) fn shortened(
    points: &[Point2],
    tolerance: f64,
    longest: f64,
    turn: f64,
    holds: impl Fn(&Point2, &Point2) -> bool,
) -> Vec<Point2> {
    const MAX_SKIP: usize = 200;
    let least = turn.cos() - ROUNDING;
    let mut points = points.to_vec();
    // Where loops and helices are joined, rounding leaves sides of no length and any direction.
    points.dedup_by(|next, last| (*next - *last).norm() <= ROUNDING);
    let Some(&first) = points.first() else { return Vec::new() };
    let mut out = vec![first];
    let mut from = 0;
    while from + 1 < points.len() {
        let fits = |to: usize| {
            let side = points[to] - points[from];
            let along = |k: usize| {
                let old = points[k + 1] - points[k];
                old.dot(&side) >= least * old.norm() * side.norm()
            };
            (from + 1..to).all(|k| foot(&points[k], &[points[from], points[to]]).1 <= tolerance)
                && (from..to).all(along)
                && holds(&points[from], &points[to])
        };
        let mut to = from + 1;
        while to + 1 < points.len() && to - from < MAX_SKIP && fits(to + 1) {
            to += 1;
        }
        let side = points[to] - points[from];
        let n = (side.norm() / longest).ceil().max(1.0);
        if side.norm() > 0.0 {
            out.extend((1..n as usize).map(|k| points[from] + side * (k as f64 / n)));
            out.push(points[to]);
        }
        from = to;
    }
    out
}

struct Writer<'a> {
    settings: &'a PlanSettings,
    /// Height of ways between runs, mm.
    safe: f64,
    moves: Vec<Move>,
    at: Option<Point3>,
    start: Option<Point3>,
    pass: u32,
    /// Radius of the cutter, mm.
    radius: f64,
}

impl Writer<'_> {
    fn to(&mut self, tip: Point3, kind: MoveKind, feed_rate: f64) {
        if self.start.is_none() {
            self.start = Some(tip);
            self.at = Some(tip);
        } else if self.at.is_none_or(|at| (tip - at).norm() > ROUNDING) {
            self.moves.push(Move { to: ClPoint::upright(tip), kind, feed_rate, pass: self.pass });
            self.at = Some(tip);
        }
    }

    /// Runs from one height down to a floor, mm.
    fn runs(&mut self, runs: &[Run], [above, floor]: [f64; 2], strategy: &PocketStrategy) {
        let (settings, safe) = (self.settings, self.safe);
        for run in runs.iter().filter(|run| !run.points.is_empty()) {
            let way = way_down(run, [above, floor], strategy, self.radius, settings.chord_tolerance);
            let first = way[0];
            let (over, near) = (Point3::new(first.x, first.y, safe), (first.z + ABOVE).min(safe));
            self.to(over, MoveKind::Rapid, 0.0);
            self.to(Point3::new(first.x, first.y, near), MoveKind::Rapid, 0.0);
            for tip in way {
                // A short side is steeper than planned once its ends are rounded.
                let [from, to] =
                    [self.at.unwrap_or(over), tip].map(|p| Point3::from(p.coords.map(in_last_decimals)));
                let (run_length, drop) = ((to.xy() - from.xy()).norm(), from.z - to.z);
                // The plunge rate bounds the speed downwards, whatever the slope.
                let steep = if drop > 0.0 { run_length.hypot(drop) / drop } else { f64::INFINITY };
                let feed = (settings.plunge_rate * steep).min(settings.feed_rate);
                self.to(tip, MoveKind::Plunge, feed);
            }
            for p in &run.points {
                self.to(Point3::new(p.x, p.y, floor), MoveKind::Cut, settings.feed_rate);
            }
            if let Some(at) = self.at {
                self.to(Point3::new(at.x, at.y, safe), MoveKind::Retract, settings.feed_rate);
            }
            self.pass += 1;
        }
    }
}

/// The runs of a floor.
pub(super) struct Runs {
    /// Those that clear it, to the walls or to what is left there.
    pub clearing: Vec<Run>,
    /// The last passes along walls.
    pub along_walls: Vec<Run>,
}

/// Every run of a cutter of a radius at every floor; where walls have one pass of all the depth, that comes
/// last.
pub(super) fn program(
    runs: &Runs,
    [depth, radius]: [f64; 2],
    strategy: &PocketStrategy,
    settings: &PlanSettings,
) -> Toolpath {
    let safe = settings.stock_top + settings.clearance;
    let mut writer = Writer { settings, safe, moves: Vec::new(), at: None, start: None, pass: 0, radius };
    let mut above = settings.stock_top;
    for floor in floors([settings.stock_top, depth], strategy) {
        writer.runs(&runs.clearing, [above, floor], strategy);
        if strategy.wall_finish == WallFinish::Steps {
            writer.runs(&runs.along_walls, [above, floor], strategy);
        }
        above = floor;
    }
    if strategy.wall_finish == WallFinish::Depth {
        writer.runs(&runs.along_walls, [settings.stock_top, -depth], strategy);
    }
    let start = writer.start.unwrap_or(Point3::new(0.0, 0.0, safe));
    Toolpath::new(ClPoint::upright(start), writer.moves)
}

fn length(way: &[Point2]) -> f64 {
    way.windows(2).map(|w| (w[1] - w[0]).norm()).sum()
}

/// From the beginning of a way along as much of it as is `far`, mm, and back.
fn back_and_forth(way: &[Point2], far: f64) -> Vec<Point2> {
    let mut gone = 0.0;
    let sides = way.windows(2).take_while(|w| {
        let before = gone;
        gone += (w[1] - w[0]).norm();
        before < far
    });
    let forth: Vec<Point2> = way.iter().take(1).copied().chain(sides.map(|w| w[1])).collect();
    forth.iter().chain(forth.iter().rev().skip(1)).copied().collect()
}

/// The way without the points that are nearer than [`LEAST_SIDE`] to the one before them; its ends stay.
fn without_short_sides(way: &[Point2]) -> Vec<Point2> {
    let [first, .., last] = way else { return way.to_vec() };
    let least = LEAST_SIDE / 10f64.powi(DECIMALS as i32);
    let mut kept = vec![*first];
    for p in &way[1..] {
        if kept.last().is_none_or(|before| (p - before).norm() >= least) {
            kept.push(*p);
        }
    }
    while kept.len() > 1 && kept.last().is_some_and(|before| (last - before).norm() < least) {
        kept.pop();
    }
    kept.push(*last);
    kept
}

/// Tips of a cutter of a radius from `above` down to where a run begins.
fn way_down(
    run: &Run,
    [above, floor]: [f64; 2],
    strategy: &PocketStrategy,
    radius: f64,
    chord_tolerance: f64,
) -> Vec<Point3> {
    let drop = above - floor;
    let begin = run.points[0];
    let plunge = vec![Point3::new(begin.x, begin.y, above), Point3::new(begin.x, begin.y, floor)];
    let least = LEAST_RAMP.min(RAMP_OVER_RADIUS * radius);
    let once: Vec<Point2> = match &run.entry {
        Entry::Helix { centre, radius, begin } => {
            let spacing = (8.0 * radius * ARC_SHARE * chord_tolerance).sqrt();
            let mut turn = circle(centre, *radius, *begin, spacing);
            turn.push(turn[0]);
            turn
        }
        Entry::Ramp(way) if length(way) < least => {
            back_and_forth(&run.points, 0.5 * drop / strategy.ramp_angle.tan())
        }
        Entry::Ramp(way) => way.clone(),
        Entry::Air => return plunge,
    };
    let once = without_short_sides(&once);
    let length = length(&once);
    if length < least || drop <= ROUNDING {
        return plunge;
    }
    let times = (drop / (length * strategy.ramp_angle.tan()) - ROUNDING).ceil().max(1.0);
    let mut tips = vec![Point3::new(once[0].x, once[0].y, above)];
    let mut gone = 0.0;
    for _ in 0..times as usize {
        for w in once.windows(2) {
            gone += (w[1] - w[0]).norm();
            let z = above - drop * (gone / (times * length)).min(1.0);
            tips.push(Point3::new(w[1].x, w[1].y, z));
        }
    }
    if matches!(run.entry, Entry::Helix { .. }) {
        // What the slope left.
        tips.extend(once.iter().map(|p| Point3::new(p.x, p.y, floor)));
    }
    tips.push(Point3::new(begin.x, begin.y, floor));
    tips.dedup();
    tips
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Pattern, Step};

    /// A short line between islands, from which the run goes on: the way down keeps to the slope of ramps
    /// along all of the run.
    #[test]
    fn ramps_on_short_lines_go_on_along_the_run() {
        let points: Vec<Point2> =
            [(0.0, 0.0), (0.06, 0.0), (0.06, 4.0), (3.0, 4.0)].map(|(x, y)| Point2::new(x, y)).to_vec();
        let short = vec![points[0], points[1], points[0]];
        let strategy = PocketStrategy {
            pattern: Pattern::Zigzag { angle: 0.0 },
            stepdown: None,
            floor_allowance: 0.0,
            wall_allowance: 0.0,
            wall_finish: WallFinish::Steps,
            ramp_angle: 3f64.to_radians(),
            helix_radius: None,
            engagement: None,
            gentle: Vec::new(),
        };
        let run = Run { entry: Entry::Ramp(short.clone()), points: points.clone() };
        let tips = way_down(&run, [0.0, -2.0], &strategy, 3.0, 1e-3);
        assert_eq!((tips[0], tips[tips.len() - 1]), (Point3::origin(), Point3::new(0.0, 0.0, -2.0)));
        for w in tips.windows(2) {
            let slope = (w[0].z - w[1].z).atan2((w[1] - w[0]).xy().norm());
            assert!(slope <= 3f64.to_radians() + 1e-9, "{} {}", w[0], w[1]);
        }
        // No farther than one way of the slope needs, and straight down where the run is as short.
        let shallow = way_down(&run, [0.0, -0.1], &strategy, 3.0, 1e-3);
        assert!(shallow.iter().all(|tip| tip.x <= 0.06), "{shallow:?}");
        let run = Run { entry: Entry::Ramp(short), points: points[..2].to_vec() };
        assert_eq!(way_down(&run, [0.0, -2.0], &strategy, 3.0, 1e-3).len(), 2);
        // For a tiny cutter it is long enough.
        assert!(way_down(&run, [0.0, -0.1], &strategy, 0.05, 1e-3).len() > 10);
    }

    /// Ways down with sides from micrometres to millimetres, steep and flat, around a helix as well: as the
    /// program is written, its coordinates rounded, no move goes down faster than the plunge rate, and flat
    /// ones are fed as fast as passes.
    #[test]
    fn written_ways_down_keep_the_plunge_rate() {
        let strategy = |ramp_angle: f64| PocketStrategy {
            pattern: Pattern::Zigzag { angle: 0.0 },
            stepdown: Some(1.3),
            floor_allowance: 0.0,
            wall_allowance: 0.0,
            wall_finish: WallFinish::Steps,
            ramp_angle: ramp_angle.to_radians(),
            helix_radius: None,
            engagement: None,
            gentle: Vec::new(),
        };
        let settings = PlanSettings {
            step: Step::Stepover(1.0),
            chord_tolerance: 1e-4,
            clearance: 2.0,
            feed_rate: 1000.0,
            plunge_rate: 300.0,
            ..PlanSettings::default()
        };
        let sides = [0.0013, 0.0171, 0.0007, 0.31, 0.0049, 2.3, 0.00022];
        let mut at = Point2::new(0.123_456, -3.214_159);
        let mut way = vec![at];
        for k in 0..400 {
            let turn = 0.7 * f64::from(k);
            at += geometry::Vector2::new(turn.cos(), turn.sin()) * sides[k as usize % sides.len()];
            way.push(at);
        }
        let back: Vec<Point2> = way.iter().chain(way.iter().rev().skip(1)).copied().collect();
        let helix = Entry::Helix { centre: Point2::new(0.3, 0.7), radius: 0.913, begin: 0.4 };
        let begin = Point2::new(0.3 + 0.913 * 0.4f64.cos(), 0.7 + 0.913 * 0.4f64.sin());
        for ramp_angle in [0.4, 3.0, 20.0, 45.0] {
            for (entry, points) in [(Entry::Ramp(back.clone()), way.clone()), (helix.clone(), vec![begin])] {
                let runs = Runs { clearing: vec![Run { entry, points }], along_walls: Vec::new() };
                let path = program(&runs, [2.6, 3.0], &strategy(ramp_angle), &settings).as_written();
                let mut fastest = 0.0f64;
                for (a, b, m) in path.segments().filter(|(a, b, m)| m.kind == MoveKind::Plunge && a != b) {
                    let down = m.feed_rate * (a.z - b.z) / (b - a).norm();
                    assert!(down <= 300.0 * (1.0 + 1e-9), "{ramp_angle}: {down} from {a} to {b}");
                    assert!(m.feed_rate <= 1000.0 && m.feed_rate > 0.0);
                    fastest = fastest.max(down);
                }
                assert!(ramp_angle < 20.0 || fastest > 299.9, "{ramp_angle}: {fastest}");
            }
        }
    }
}
