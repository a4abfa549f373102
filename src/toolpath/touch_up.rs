//! Short passes over places where an earlier plan left too much, while all other passes stay where they are.
//!
//! Enters: the passes of an upright cutter, or the contacts of one that leans, and places on the design.
//! Leaves: further passes of what is dropped in its stead, each beside a stretch of its nearest pass and
//! through the places there, so that it runs along their ridge. What is cut once more can only sink; passes
//! that are placed anew leave ridges at other places.

use std::collections::VecDeque;

use crate::link::plane_interval;
use crate::vocabulary::{PlanError, Task};
use drop_cutter::{Beside, DropCutter};
use geometry::{CubicSpline, Point2, Point3, Vector2, share_on};
use work::monitor;

/// A pass serves what lies within this share of an interval beside it: on a plane, what stands there sinks to
/// a quarter.
const SERVED: f64 = 0.25;

/// It goes on to the next place along the ridge that is no farther than so many intervals,
const NEXT: f64 = 2.0;

/// reaches so many beyond the last one, where the ridge is low again,
const BEYOND: f64 = 1.0;

/// and follows its neighbour no farther than so many to either side: what lies beyond takes another pass.
const FARTHEST: f64 = 16.0;

/// What the user is told of further passes.
pub(crate) fn note(added: &[Vec<Point3>]) -> Option<String> {
    let count = added.len();
    let passes = if count == 1 { "short pass goes" } else { "short passes go" };
    (count > 0).then(|| format!("{count} {passes} once more over places where others left too much"))
}

/// Passes along creases, and over the places that an earlier plan left too high, beside those that are `planned`;
/// the first places are served first. Places that a cutter from above does not touch are left out.
///
/// # Errors
/// When cancelled.
pub(crate) fn passes(task: &Task<'_>, planned: &[Vec<Point3>]) -> Result<Vec<Vec<Point3>>, PlanError> {
    let Task { part, ref settings, monitor, .. } = *task;
    let Some(earlier) = settings.earlier else { return Ok(Vec::new()) };
    let (places, creases) = (&earlier.touch_up, &earlier.creases);
    let dropped = task.dropped();
    let interval = plane_interval(dropped, settings.step);
    let mut added = Vec::new();
    if places.is_empty() && creases.is_empty() || planned.is_empty() {
        return Ok(added);
    }
    let drop = DropCutter::watched(part, dropped, monitor)?;
    let axis_over = |place: &Point3| {
        let foot = part.closest_point(place).0;
        let touching_axis = foot.point.xy() + dropped.axis_offset(&foot.normal);
        let axis = drop.lowest_over(dropped, &foot.point, touching_axis, 0.5 * interval);
        let touching = foot.point + dropped.contact_to_tip(&foot.normal);
        let is_under = |tip_z: f64| settings.axis.is_none() || (tip_z - touching.z).abs() <= interval;
        drop.at(axis.x, axis.y).is_some_and(|drop| is_under(drop.tip_z)).then_some(axis)
    };
    let (alone, mut lines): (VecDeque<_>, VecDeque<_>) =
        creases.iter().cloned().partition(|line| line.len() == 1);
    let alone = alone.into_iter().flatten();
    let mut waiting: Vec<Point2> = places.iter().filter_map(axis_over).chain(alone).collect();
    let mut next = || {
        let along = lines.pop_front().map(|line| Copied::of(line).whole());
        along.or_else(|| next_run(planned, &mut waiting, interval))
    };
    while let Some((copy, [from, to])) = next() {
        monitor::check(monitor)?;
        let mut last = Beside::default();
        let mut tip = |s: f64| {
            let q = copy.at(s);
            drop.at_beside(q.x, q.y, &mut last).map(|drop| Point3::new(q.x, q.y, drop.tip_z))
        };
        let pass = settings.moves(from, to, &mut tip, monitor)?;
        if pass.len() > 1 {
            added.push(pass);
        }
    }
    Ok(added)
}

/// The passes of their own that places take whose cutter stands at the `axes`: the length of each, mm. They
/// are found one by one, so that who has seen enough may stop.
pub fn short_passes(
    planned: &[Vec<Point3>],
    mut axes: Vec<Point2>,
    interval: f64,
) -> impl Iterator<Item = f64> {
    let runs = std::iter::from_fn(move || next_run(planned, &mut axes, interval));
    runs.map(|(_, [from, to])| to - from)
}

/// The pass beside which the first of the waiting places is served, and the run of it that serves those along
/// it, mm; these wait no longer. `None` without places or passes.
fn next_run(planned: &[Vec<Point3>], waiting: &mut Vec<Point2>, interval: f64) -> Option<(Copied, [f64; 2])> {
    let copy = Copied::beside(planned, *waiting.first()?, FARTHEST * interval)?;
    let run = copy.serve(waiting, interval);
    Some((copy, run))
}

/// A stretch of a pass in the plan view, shifted so that it runs through a place.
struct Copied {
    corners: Vec<Point2>,
    /// Length up to each corner, mm.
    lengths: Vec<f64>,
}

impl Copied {
    /// Of the pass that is nearest to a place, up to `farthest` mm to either side of it; `None` without
    /// passes.
    fn beside(passes: &[Vec<Point3>], place: Point2, farthest: f64) -> Option<Self> {
        let stretches = passes.iter().flat_map(|pass| (1..pass.len()).map(move |k| (pass, k)));
        let near = stretches.map(|(pass, k)| {
            let (a, b) = (pass[k - 1].xy(), pass[k].xy());
            let on = nearest_on(place, a, b).0;
            ((on - place).norm_squared(), pass, k, on)
        });
        let (_, pass, k, on) = near.min_by(|a, b| a.0.total_cmp(&b.0))?;
        let shift = place - on;
        let walk = |corners: &mut dyn Iterator<Item = &Point3>| {
            let (mut found, mut far, mut before) = (Vec::new(), 0.0, on);
            for corner in corners.map(|corner| corner.xy()) {
                if far >= farthest {
                    break;
                }
                far += (corner - before).norm();
                before = corner;
                found.push(corner + shift);
            }
            found
        };
        let mut corners = walk(&mut pass[..k].iter().rev());
        corners.reverse();
        corners.push(place);
        corners.extend(walk(&mut pass[k..].iter()));
        Some(Self::of(corners))
    }

    fn of(corners: Vec<Point2>) -> Self {
        let lengths = CubicSpline::chord_lengths(&corners, false);
        Self { corners, lengths }
    }

    /// All of it, as a run.
    fn whole(self) -> (Self, [f64; 2]) {
        let end = self.lengths[self.lengths.len() - 1];
        (self, [0.0, end])
    }

    /// The place so many mm from the beginning.
    fn at(&self, s: f64) -> Point2 {
        let k = self.lengths.partition_point(|length| *length <= s).clamp(1, self.corners.len() - 1);
        let step: Vector2 = self.corners[k] - self.corners[k - 1];
        let length = self.lengths[k] - self.lengths[k - 1];
        self.corners[k - 1] + step * if length > 0.0 { (s - self.lengths[k - 1]) / length } else { 0.0 }
    }

    /// How far along the stretch and how far beside it a place lies, mm.
    fn along_and_aside(&self, place: Point2) -> [f64; 2] {
        let of_piece = |k: usize| {
            let (on, share) = nearest_on(place, self.corners[k - 1], self.corners[k]);
            [self.lengths[k - 1] + share * (self.lengths[k] - self.lengths[k - 1]), (on - place).norm()]
        };
        let pieces = (1..self.corners.len()).map(of_piece);
        pieces.min_by(|a, b| a[1].total_cmp(&b[1])).unwrap_or([0.0, f64::INFINITY])
    }

    /// Takes the first of the waiting places, and those that follow it along the stretch; leaves the run that
    /// serves them.
    fn serve(&self, waiting: &mut Vec<Point2>, interval: f64) -> [f64; 2] {
        let found: Vec<[f64; 2]> = waiting.iter().map(|place| self.along_and_aside(*place)).collect();
        let mut beside: Vec<f64> = found.iter().filter(|f| f[1] <= SERVED * interval).map(|f| f[0]).collect();
        beside.sort_by(f64::total_cmp);
        let own = found[0][0];
        let up = |far: f64, s: &f64| if *s - far <= NEXT * interval { far.max(*s) } else { far };
        let down = |far: f64, s: &f64| if far - *s <= NEXT * interval { far.min(*s) } else { far };
        let [from, to] = [beside.iter().rev().fold(own, down), beside.iter().fold(own, up)];
        let mut served = found.iter().map(|f| f[1] <= SERVED * interval && (from..=to).contains(&f[0]));
        // The first one lies on the stretch but for rounding.
        let mut first = true;
        waiting.retain(|_| {
            let is_served = served.next().is_some_and(|served| served);
            !(std::mem::take(&mut first) || is_served)
        });
        let end = self.lengths[self.lengths.len() - 1];
        [(from - BEYOND * interval).max(0.0), (to + BEYOND * interval).min(end)]
    }
}

/// The place of a straight piece nearest to another, and its share of the way.
fn nearest_on(place: Point2, a: Point2, b: Point2) -> (Point2, f64) {
    let share = share_on(&place, &a, &b);
    (a + (b - a) * share, share)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::{
        Along, Earlier, FrontStart, IsoScallop, Plan, PlanSettings, Step, Strategy, Tilting, Zigzag,
        plan_tilted,
    };
    use cutter::Cutter;
    use geometry::{AnalyticShape, AnalyticSurface};
    use motion::{MoveKind, ToolAxis};
    use part::{Part, Patch};
    use work::monitor::Silent;

    #[test]
    fn one_pass_serves_the_places_along_a_ridge() {
        // Passes along x, 1 mm apart.
        let line = |y: f64| (0..=100).map(|k| Point3::new(f64::from(k), y, 0.0)).collect::<Vec<_>>();
        let passes = [line(0.0), line(1.0), line(2.0)];
        let copy = Copied::beside(&passes, Point2::new(50.0, 0.45), 16.0).unwrap();
        let mut waiting = vec![
            Point2::new(50.0, 0.45),
            Point2::new(51.5, 0.5),
            Point2::new(48.7, 0.4),
            // Too far along, and on another ridge.
            Point2::new(55.0, 0.45),
            Point2::new(50.0, 1.5),
        ];
        let run = copy.serve(&mut waiting, 1.0);
        assert_eq!(waiting, [Point2::new(55.0, 0.45), Point2::new(50.0, 1.5)]);
        let ends = run.map(|s| copy.at(s));
        assert!((ends[0] - Point2::new(47.7, 0.45)).norm() < 1e-12, "{ends:?}");
        assert!((ends[1] - Point2::new(52.5, 0.45)).norm() < 1e-12, "{ends:?}");
        // Three passes serve them all.
        let axes = [[50.0, 0.45], [51.5, 0.5], [48.7, 0.4], [55.0, 0.45], [50.0, 1.5]].map(Point2::from);
        let lengths: Vec<f64> = short_passes(&passes, axes.to_vec(), 1.0).collect();
        let wanted = [4.8, 2.0, 2.0];
        assert!(
            lengths.len() == 3 && lengths.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-12),
            "{lengths:?}"
        );
        assert_eq!(short_passes(&[], axes.to_vec(), 1.0).count(), 0);
        // Beside the end of a pass there is no more of it.
        let copy = Copied::beside(&passes, Point2::new(99.5, 0.45), 16.0).unwrap();
        let run = copy.serve(&mut vec![Point2::new(99.5, 0.45)], 1.0);
        assert!((copy.at(run[1]) - Point2::new(100.0, 0.45)).norm() < 1e-12);
        assert!(Copied::beside(&[], Point2::origin(), 1.0).is_none());
    }

    /// Whether passes are tilted around a ball that was dropped (zigzag) or located by their contacts (the
    /// front): the ball's centre is led over the place.
    #[test]
    fn a_tool_that_leans_gets_passes_of_its_own_as_well() {
        let shape = AnalyticShape::Plane { height: 0.0 };
        let surface = AnalyticSurface::new(shape, [[0.0, 20.0], [0.0, 20.0]]).unwrap();
        let part = Part::from_patches(vec![Patch::Analytic(surface)], 0.002).unwrap();
        let (cutter, place) = (Cutter::ball(6.0).unwrap(), Point3::new(10.0, 7.3, 0.0));
        let rule = ToolAxis::LeadTilt { lead: 0.2, tilt: 0.0 };
        let tilting =
            Tilting { axis: &rule, most_turning: None, most_turning_across: None, interference: None };
        let planned = |strategy: &dyn Strategy, places: &[Point3]| {
            let earlier = Earlier { touch_up: places.to_vec(), ..Earlier::default() };
            let settings = PlanSettings {
                step: Step::Stepover(4.0),
                earlier: Some(Arc::new(earlier)),
                ..PlanSettings::default()
            };
            plan_tilted(&part, &cutter, strategy, &tilting, &settings, &Silent).unwrap()
        };
        // How far beside the place the nearest cut leads the ball's centre.
        let beside = |plan: &Plan| {
            let cuts = plan.path.moves.windows(2).filter(|ends| ends[1].kind == MoveKind::Cut);
            let centres =
                cuts.map(|ends| [0, 1].map(|k: usize| (ends[k].to.tip + ends[k].to.axis * 3.0).xy()));
            centres.map(|[a, b]| (nearest_on(place.xy(), a, b).0 - place.xy()).norm()).fold(9.0, f64::min)
        };
        let front = IsoScallop { start: FrontStart::Border { constant: Along::V, greatest: false } };
        for strategy in [&Zigzag::at(0.0) as &dyn Strategy, &front] {
            let [before, after] = [&[][..], &[place]].map(|places| planned(strategy, places));
            assert!(beside(&before) > 0.2, "{}", beside(&before));
            assert!(beside(&after) < 1e-6, "{}", beside(&after));
            assert!(after.notes.iter().any(|note| note.starts_with("1 short pass ")), "{:?}", after.notes);
        }
    }
}
