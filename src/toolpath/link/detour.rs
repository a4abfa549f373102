//! Detours of an upright tool around fixtures.
//!
//! Enters: a finished path, what the tool must keep away from, mm. Leaves: the path without what comes too
//! near to a fixture. Passes end where the tool comes too near and go on where it is clear again. From one to
//! the other, and wherever a move between passes would meet a fixture, the tool goes over the stock and
//! beside the fixtures, or over all of them where that is shorter. The rest of the path stays as it is.
//!
//! Limits: straight up and down no other way is looked for. Where a fixture hangs over a pass, the check of
//! the finished path finds it.

use super::beside::beside;
use crate::vocabulary::PlanSettings;
use collision::Interference;
use geometry::Point3;
use motion::{ClPoint, Move, MoveKind, Toolpath};
use work::monitor::{Cancelled, Monitor, check};
use work::parallel;

/// Halvings by which the end of a pass beside a fixture is found: to a millionth of its last move.
const HALVINGS: usize = 20;

/// A path around fixtures.
#[derive(Debug, Clone, PartialEq)]
pub struct Detour {
    /// The path.
    pub path: Toolpath,
    /// Length of passes that no tool can cut for the fixtures, mm.
    pub left_out: f64,
    /// Detours between passes: over all fixtures, and beside them.
    pub detours: [usize; 2],
    /// What is to be said of them, if there are any.
    pub note: Option<String>,
}

fn note(left_out: f64, [over, beside]: [usize; 2]) -> Option<String> {
    let times = |count: usize, what: &str| match count {
        0 => None,
        1 => Some(format!("once the tool {what}")),
        n => Some(format!("{n} times the tool {what}")),
    };
    let raised = [times(over, "rises over a fixture"), times(beside, "goes around a fixture")];
    let skipped = (left_out > 0.0).then(|| format!("{left_out:.1} mm of passes beside fixtures are skipped"));
    let parts: Vec<String> = raised.into_iter().flatten().chain(skipped).collect();
    (!parts.is_empty()).then(|| parts.join("; "))
}

/// Leads an upright path around what `keep` holds.
///
/// # Errors
/// [`Cancelled`] when the monitor says so.
pub fn around_fixtures(
    path: Toolpath,
    keep: &Interference<'_>,
    settings: &PlanSettings,
    monitor: &dyn Monitor,
) -> Result<Detour, Cancelled> {
    monitor.start("looking for fixtures", 0);
    let hits = parallel::try_map(path.len(), |k| {
        check(monitor)?;
        Ok::<bool, Cancelled>(keep.on_move(&path.location_before(k), &path.moves[k].to).is_some())
    })?;
    if !hits.contains(&true) {
        return Ok(Detour { path, left_out: 0.0, detours: [0; 2], note: None });
    }
    let safe = settings.stock_top + settings.clearance;
    let top = keep.checks.iter().map(|check| check.obstacle.bounds().max.z).fold(f64::NEG_INFINITY, f64::max);
    let high = safe.max(top + settings.clearance);
    let start = if keep.is_clear(&path.start) { path.start } else { above(&path.start, high) };
    let mut leading =
        Leading { keep, settings, safe, high, at: start, moves: Vec::new(), left_out: 0.0, detours: [0; 2] };
    let mut k = 0;
    while k < path.len() {
        check(monitor)?;
        k = leading.follow(&path, &hits, k);
    }
    let Leading { moves, left_out, detours, .. } = leading;
    Ok(Detour { path: Toolpath::new(start, moves), left_out, detours, note: note(left_out, detours) })
}

fn above(at: &ClPoint, z: f64) -> ClPoint {
    ClPoint { tip: Point3::new(at.tip.x, at.tip.y, at.tip.z.max(z)), axis: at.axis }
}

/// A path in the making.
struct Leading<'a> {
    keep: &'a Interference<'a>,
    settings: &'a PlanSettings,
    /// Heights of the tip over all stock, and over all fixtures.
    safe: f64,
    high: f64,
    /// Where the tool is.
    at: ClPoint,
    moves: Vec<Move>,
    left_out: f64,
    detours: [usize; 2],
}

impl Leading<'_> {
    /// Takes move `k`, or goes around what it meets; leaves the move to go on with.
    fn follow(&mut self, path: &Toolpath, hits: &[bool], k: usize) -> usize {
        let (from, step) = (path.location_before(k), path.moves[k]);
        match (step.kind.is_on_surface(), hits[k]) {
            (_, false) if self.at == from => self.push(step.to, step),
            (true, false) => {
                self.go_over(&from, &step);
                self.push(step.to, step);
            }
            (true, true) => self.cut_off(&from, &step),
            (false, _) => {
                // The next pass finds its own way.
                let next = (k + 1..path.len()).find(|&j| path.moves[j].kind.is_on_surface());
                if next.is_none() {
                    self.rise(&step);
                }
                return next.unwrap_or(path.len());
            }
        }
        k + 1
    }

    /// As much of a move on the surface as is clear, at its begin and at its end.
    fn cut_off(&mut self, from: &ClPoint, step: &Move) {
        let length = (step.to.tip - from.tip).norm();
        // What goes on from either end keeps all that is needed; a move counts as clear a little before.
        let clear = |a: f64, b: f64| {
            let ends = [a, b].map(|share| from.towards(&step.to, share));
            ends.iter().all(|end| self.keep.is_clear(end)) && self.keep.on_move(&ends[0], &ends[1]).is_none()
        };
        let first = self.keep.is_clear(from).then(|| halved(|t| clear(0.0, t)));
        let last = self.keep.is_clear(&step.to).then(|| 1.0 - halved(|t| clear(1.0 - t, 1.0)));
        if let Some(first) = first.filter(|&t| t > 0.0) {
            self.go_over(from, step);
            self.push(from.towards(&step.to, first), *step);
        }
        let Some(last) = last else {
            self.left_out += (1.0 - first.unwrap_or_default()) * length;
            return;
        };
        self.left_out += (last - first.unwrap_or_default()).max(0.0) * length;
        self.go_over(&from.towards(&step.to, last), step);
        self.push(step.to, *step);
    }

    fn push(&mut self, to: ClPoint, step: Move) {
        if to != self.at {
            self.moves.push(Move { to, ..step });
            self.at = to;
        }
    }

    /// Up over all fixtures.
    fn rise(&mut self, step: &Move) {
        let fed = Move { kind: MoveKind::Retract, feed_rate: self.settings.feed_rate, ..*step };
        self.push(above(&self.at, self.safe), fed);
        self.push(above(&self.at, self.high), Move { kind: MoveKind::Rapid, feed_rate: 0.0, ..*step });
    }

    /// Beside the fixtures or over all of them to a place, and down to it.
    fn go_over(&mut self, to: &ClPoint, step: &Move) {
        if self.at == *to {
            return;
        }
        let rapid = Move { kind: MoveKind::Rapid, feed_rate: 0.0, ..*step };
        let ends = [above(&self.at, self.safe), above(to, self.safe)];
        let over = (ends[1].tip - ends[0].tip).norm() + 2.0 * (self.high - self.safe).max(0.0);
        // From where the tool stands higher, it is over the fixtures already.
        let level = ends.iter().all(|end| end.tip.z == self.safe);
        match beside(self.keep, ends, over).filter(|_| level) {
            Some((way, _)) => {
                self.detours[1] += 1;
                let fed = Move { kind: MoveKind::Retract, feed_rate: self.settings.feed_rate, ..*step };
                self.push(ends[0], fed);
                way.into_iter().for_each(|place| self.push(place, rapid));
            }
            None => {
                self.detours[0] += 1;
                self.rise(step);
                self.push(above(to, self.high), rapid);
            }
        }
        self.push(above(to, self.safe), rapid);
        self.push(*to, Move { kind: MoveKind::Plunge, feed_rate: self.settings.plunge_rate, ..*step });
    }
}

/// About the greatest share for which `holds` is true, and none for which it is not, if it is so up to there.
fn halved(holds: impl Fn(f64) -> bool) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if holds(middle) { low = middle } else { high = middle }
    }
    low
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vocabulary::{Joining, Step};
    use collision::{Check, Obstacle};
    use cutter::{Cutter, Solid};
    use geometry::{Aabb, Bvh, TriangleMesh};
    use work::monitor::Silent;

    fn block(low: [f64; 3], high: [f64; 3]) -> (TriangleMesh, Bvh) {
        let (vertices, triangles) = Aabb { min: low.into(), max: high.into() }.surface();
        let mesh = TriangleMesh::new(vertices, triangles).unwrap().0;
        let tree = Bvh::new(&mesh);
        (mesh, tree)
    }

    /// Two passes along x over a plate, 8 mm apart, and a retract between them 2 mm over it.
    fn passes() -> Toolpath {
        let at = |x: f64, y: f64, z: f64| ClPoint::upright(Point3::new(x, y, z));
        let step = |to, kind| Move { to, kind, feed_rate: 1000.0, pass: 0 };
        let moves = vec![
            step(at(0.0, 0.0, 0.0), MoveKind::Plunge),
            step(at(20.0, 0.0, 0.0), MoveKind::Cut),
            step(at(40.0, 0.0, 0.0), MoveKind::Cut),
            step(at(40.0, 0.0, 2.0), MoveKind::Retract),
            step(at(0.0, 8.0, 2.0), MoveKind::Rapid),
            step(at(0.0, 8.0, 0.0), MoveKind::Plunge),
            step(at(40.0, 8.0, 0.0), MoveKind::Cut),
            step(at(40.0, 8.0, 5.0), MoveKind::Retract),
        ];
        Toolpath::new(at(0.0, 0.0, 5.0), moves)
    }

    fn led(fixture: &(TriangleMesh, Bvh), clearance: f64) -> (Detour, bool) {
        let tool = Solid::of_cutter(&Cutter::flat(6.0).unwrap(), None);
        let obstacle = Obstacle::new(&fixture.0, &fixture.1);
        let of = |needed| {
            let checks = vec![Check { solid: &tool, obstacle, needed }];
            Interference { checks, ..Interference::default() }
        };
        let settings = PlanSettings {
            step: Step::Stepover(1.0),
            chord_tolerance: 0.01,
            clearance: 2.0,
            stock_top: 3.0,
            feed_rate: 1000.0,
            plunge_rate: 300.0,
            joining: Joining::default(),
            ..PlanSettings::default()
        };
        let led = around_fixtures(passes(), &of(clearance), &settings, &Silent).unwrap();
        let clear = of(clearance).on_path(&led.path, |_| true).is_empty();
        (led, clear)
    }

    #[test]
    fn a_pass_ends_before_a_post_and_goes_on_behind_it() {
        // From 19 to 21 mm, over the first pass only: 3 mm of the cutter and 0.5 mm to either side.
        let (led, clear) = led(&block([19.0, -9.0, -20.0], [21.0, -1.0, 45.0]), 0.5);
        assert!(clear, "{led:?}");
        let reach = ((3.0f64 + 0.5).powi(2) - 1.0).sqrt();
        assert!((led.left_out - 2.0 * (1.0 + reach)).abs() < 1e-3, "{} {reach}", led.left_out);
        // Around the post 3.5 mm away and 2 mm over the stock, which is shorter than 42 mm up and down.
        assert_eq!(led.detours, [0, 1]);
        let heights = led.path.moves.iter().map(|m| m.to.tip.z).fold(0.0, f64::max);
        assert_eq!(heights, 5.0);
        let aside = led.path.moves.iter().map(|m| m.to.tip.y).filter(|y| *y < 8.0).fold(0.0, f64::max);
        assert!((aside - 2.5).abs() < 2e-3, "{aside}");
        let cut = |path: &Toolpath| {
            let cuts = path.segments().filter(|s| s.2.kind == MoveKind::Cut).map(|(a, b, _)| (b - a).norm());
            cuts.sum::<f64>()
        };
        assert!((cut(&led.path) + led.left_out - cut(&passes())).abs() < 1e-9);
        assert!(led.note.unwrap().starts_with("once the tool goes around a fixture; "));
    }

    #[test]
    fn a_retract_that_meets_a_post_rises_over_it_and_loses_nothing() {
        let (led, clear) = led(&block([19.0, 3.8, -20.0], [21.0, 4.2, 45.0]), 0.5);
        assert!(clear, "{led:?}");
        assert_eq!((led.left_out, led.detours), (0.0, [0, 1]));
        assert_eq!(led.note.unwrap(), "once the tool goes around a fixture");
    }

    /// A wall across the plate is as long as it takes for the way over it to be the shorter one.
    #[test]
    fn a_wall_is_crossed_where_it_is_lower_than_long() {
        for (long, detours) in [(30.0, [0, 1]), (70.0, [1, 0])] {
            let (led, clear) = led(&block([19.0, 4.0 - long, -20.0], [21.0, 4.0 + long, 45.0]), 0.5);
            assert!(clear, "{led:?}");
            // Both passes, and the way between them.
            assert_eq!(led.detours, detours.map(|times| 3 * times), "{long} {led:?}");
        }
    }

    /// The second post stands in the way around the first.
    #[test]
    fn the_way_leads_around_one_fixture_after_the_other() {
        let posts =
            [block([19.0, -40.0, -20.0], [21.0, 2.0, 45.0]), block([6.0, 3.0, -20.0], [8.0, 20.0, 45.0])];
        let tool = Solid::of_cutter(&Cutter::flat(6.0).unwrap(), None);
        let checks = posts.iter().map(|(mesh, tree)| Check {
            solid: &tool,
            obstacle: Obstacle::new(mesh, tree),
            needed: 0.5,
        });
        let keep = Interference { checks: checks.collect(), ..Interference::default() };
        let at = |x: f64| ClPoint::upright(Point3::new(x, 0.0, 5.0));
        let (way, length) = beside(&keep, [at(0.0), at(40.0)], 1e3).unwrap();
        let places: Vec<ClPoint> = [at(0.0)].into_iter().chain(way).chain([at(40.0)]).collect();
        assert!(places.windows(2).all(|pair| keep.on_move(&pair[0], &pair[1]).is_none()), "{places:?}");
        assert!(length > 40.0 && length < 50.0, "{length}");
        assert!(beside(&keep, [at(0.0), at(40.0)], 0.99 * length).is_none());
    }

    #[test]
    fn a_path_that_meets_nothing_stays_as_it_is() {
        let (led, clear) = led(&block([19.0, 20.0, -20.0], [21.0, 24.0, 45.0]), 0.5);
        assert!(clear && led.path == passes() && led.note.is_none());
    }

    #[test]
    fn what_lies_under_a_fixture_is_left_out() {
        let (led, clear) = led(&block([25.0, -9.0, -20.0], [60.0, 20.0, 30.0]), 0.5);
        assert!(clear, "{led:?}");
        assert!((led.left_out - 2.0 * (40.0 - 21.5)).abs() < 1e-3, "{}", led.left_out);
    }
}
