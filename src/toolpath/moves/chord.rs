//! Turns a curve of cutter locations into straight moves within a chord tolerance.
//!
//! Places are sampled more finely than the chord tolerance and then thinned. Corners move half way to where
//! the chords cut short, so that the curve runs on both sides of its moves. Where one side is straight,
//! nothing moves.

use geometry::{Point3, Vector3, distance_to_segment, share_on};
use work::monitor::{self, Cancelled, Monitor};

/// Steps of work (drops of the cutter, points thinned) between two questions whether to go on. A
/// question costs next to nothing; at ten times as many a cancelled plan would still end within
/// tenths of a second, and a rough surface takes ten times as long for each of them.
const STEPS_BETWEEN_QUESTIONS: u32 = 256;

/// Asks a monitor now and then whether to go on, from inside of a pass.
pub struct Watch<'a> {
    monitor: &'a dyn Monitor,
    steps: u32,
}

impl<'a> Watch<'a> {
    /// For the work of one pass.
    pub fn new(monitor: &'a dyn Monitor) -> Self {
        Self { monitor, steps: 0 }
    }

    /// Counts one step, and asks after every so many.
    ///
    /// # Errors
    /// [`Cancelled`] when the monitor says so.
    pub fn step(&mut self) -> Result<(), Cancelled> {
        self.steps += 1;
        if self.steps < STEPS_BETWEEN_QUESTIONS {
            return Ok(());
        }
        self.steps = 0;
        monitor::check(self.monitor)
    }
}

/// Two samples of a pass are never closer than this share of the first sampling interval: where the
/// exact path has a kink, halving would never end. At 2⁻¹² of a quarter of a millimetre the kink is
/// placed to 0.06 µm.
const MAX_HALVINGS: u32 = 12;

/// A curve jumps where the middle of an interval lies nearer to one end than by this share of the way.
const JUMP: f64 = 0.1;

/// A place of a cutter on its way.
pub trait Waypoint: Copy {
    /// How far this place lies off the move between two others, mm.
    fn stray(&self, from: &Self, to: &Self) -> f64;

    /// Whether the cutter need not move from here to another place.
    fn is_at(&self, other: &Self) -> bool;
}

impl Waypoint for Point3 {
    fn stray(&self, from: &Self, to: &Self) -> f64 {
        distance_to_segment(self, from, to)
    }

    fn is_at(&self, other: &Self) -> bool {
        self == other
    }
}

/// Samples `locate` over `[s0, s1]` so that the straight moves between samples stay within
/// `tolerance` (mm) of the exact curve.
///
/// `locate(s)` gives the cutter location at parameter `s`, `None` where there is none: samples before
/// the first location and after the next gap are left out. The first samples are `step` apart in `s`.
/// Each interval is tested at its middle and its quarters, and halved until all three hold.
///
/// # Errors
/// [`Cancelled`] when the watch says so.
///
/// # Tolerance
/// A curve whose curvature changes sign more than four times within one final interval could slip
/// between the tests; `step` should be well below the radius of the cutter.
pub fn sample_within_chord<P: Waypoint>(
    s0: f64,
    s1: f64,
    step: f64,
    tolerance: f64,
    locate: &mut dyn FnMut(f64) -> Option<P>,
    watch: &mut Watch<'_>,
) -> Result<Vec<P>, Cancelled> {
    sample_over_jumps(s0, s1, step, tolerance, locate, &mut |_, _, _| Ok(Vec::new()), watch)
}

/// As [`sample_within_chord`] of a curve that may jump: `across` gives the places between both ends of a
/// jump.
///
/// # Errors
/// [`Cancelled`] when the watch or `across` says so.
pub fn sample_over_jumps<P: Waypoint>(
    s0: f64,
    s1: f64,
    step: f64,
    tolerance: f64,
    locate: &mut dyn FnMut(f64) -> Option<P>,
    across: &mut Across<'_, P>,
    watch: &mut Watch<'_>,
) -> Result<Vec<P>, Cancelled> {
    let count = ((s1 - s0) / step).ceil().max(1.0) as usize;
    let at = |k: usize| s0 + (s1 - s0) * k as f64 / count as f64;
    let mut start = 0;
    let first = loop {
        if start > count {
            return Ok(Vec::new());
        }
        watch.step()?;
        match locate(at(start)) {
            Some(first) => break first,
            None => start += 1,
        }
    };
    let mut halving = Halving { tolerance, locate, across, watch, points: vec![first] };
    let mut a = (at(start), first);
    for k in start + 1..=count {
        let s = at(k);
        let Some(p) = (halving.locate)(s) else { break };
        halving.halve(a, (s, p), MAX_HALVINGS)?;
        a = (s, p);
    }
    Ok(halving.points)
}

/// The places between both ends of a jump, without the ends.
pub type Across<'a, P> = dyn FnMut(&P, &P, &mut Watch<'_>) -> Result<Vec<P>, Cancelled> + 'a;

/// Samples of a curve so far.
struct Halving<'a, 'b, 'c, P> {
    tolerance: f64,
    locate: &'a mut dyn FnMut(f64) -> Option<P>,
    across: &'a mut Across<'b, P>,
    watch: &'a mut Watch<'c>,
    points: Vec<P>,
}

impl<P: Waypoint> Halving<'_, '_, '_, P> {
    /// Appends the samples after `a` up to and with `b`.
    fn halve(&mut self, a: (f64, P), b: (f64, P), halvings: u32) -> Result<(), Cancelled> {
        self.watch.step()?;
        let s = |t: f64| a.0 + (b.0 - a.0) * t;
        let off = |p: Option<P>| p.is_some_and(|p| p.stray(&a.1, &b.1) > self.tolerance);
        let middle = (self.locate)(s(0.5));
        let split =
            halvings > 0 && (off(middle) || off((self.locate)(s(0.25))) || off((self.locate)(s(0.75))));
        let stray = |p: &P, q: &P| p.stray(q, q);
        let far = stray(&b.1, &a.1);
        let jumps = match middle {
            Some(middle) if split => {
                let middle = (s(0.5), middle);
                self.halve(a, middle, halvings - 1)?;
                return self.halve(middle, b, halvings - 1);
            }
            // Half of the interval leads nowhere and the other half all the way, or halving does not end.
            Some(middle) => halvings == 0 || stray(&middle, &a.1).min(stray(&middle, &b.1)) < JUMP * far,
            None => true,
        };
        if jumps && far > self.tolerance {
            self.points.extend((self.across)(&a.1, &b.1, self.watch)?);
        }
        if !b.1.is_at(&a.1) {
            self.points.push(b.1);
        }
        Ok(())
    }
}

/// No straight move skips more points than this: it bounds the cost on long straight passes, and a
/// pass of n points keeps n/400 at worst where one move would do.
const MAX_SKIP: usize = 400;

/// Drops points that the rest does without, and moves those that are left aside so that the curve runs on
/// both sides of the moves: within `tolerance`, and half of it where the curve bends evenly. The ends stay.
///
/// # Errors
/// [`Cancelled`] when the watch says so.
pub fn reduce(points: &[Point3], tolerance: f64, watch: &mut Watch<'_>) -> Result<Vec<Point3>, Cancelled> {
    let kept = reduced_indices(points, tolerance, watch)?;
    Ok(moved_aside(points, &kept, Side::Lesser, tolerance))
}

/// Indices of the points that the rest does without least: from each the longest straight move that stays
/// within the `tolerance` of each point that it skips, mm. The ends stay.
///
/// # Errors
/// [`Cancelled`] when the watch says so.
pub fn reduced_indices<P: Waypoint>(
    points: &[P],
    tolerance: f64,
    watch: &mut Watch<'_>,
) -> Result<Vec<usize>, Cancelled> {
    if points.is_empty() {
        return Ok(Vec::new());
    }
    let mut kept = vec![0];
    let mut from = 0;
    while from + 1 < points.len() {
        let fits =
            |to: usize| (from + 1..to).all(|k| points[k].stray(&points[from], &points[to]) <= tolerance);
        watch.step()?;
        let mut to = from + 1;
        while to + 1 < points.len() && to - from < MAX_SKIP && fits(to + 1) {
            to += 1;
        }
        kept.push(to);
        from = to;
    }
    Ok(kept)
}

/// By which of its two sides a point is moved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// The straighter one; where the curve bends both ways not at all. Straight moves stay where they are.
    Lesser,
    /// The more bent one, by the mean of both where the curve bends both ways. What is beside it must be
    /// checked.
    Greater,
}

/// The points at `knots`, each moved by half the sagitta of one of its sides, at most by the tolerance. The
/// ends stay.
pub fn moved_aside(curve: &[Point3], knots: &[usize], side: Side, tolerance: f64) -> Vec<Point3> {
    let half_sagitta = |k: usize| {
        let (a, b) = (curve[knots[k]], curve[knots[k + 1]]);
        let off = |p: &Point3| p - (a + (b - a) * share_on(p, &a, &b));
        let between = &curve[knots[k]..=knots[k + 1]];
        let far = |e: &Vector3| e.norm_squared();
        let most =
            between.iter().map(off).fold(Vector3::zeros(), |m, e| if far(&e) > far(&m) { e } else { m });
        if far(&most) == 0.0 {
            return most;
        }
        // A chord that the curve crosses is off on both sides already.
        let least = between.iter().map(|p| off(p).dot(&most) / far(&most)).fold(0.0, f64::min);
        most * (0.5 * (1.0 + least))
    };
    let halves: Vec<Vector3> = (0..knots.len().saturating_sub(1)).map(half_sagitta).collect();
    let aside = |k: usize| {
        let (a, b) = (halves[k - 1], halves[k]);
        let (lesser, greater) = if a.norm_squared() < b.norm_squared() { (a, b) } else { (b, a) };
        let by = match (side, a.dot(&b) > 0.0) {
            (Side::Lesser, true) => lesser,
            (Side::Lesser, false) => Vector3::zeros(),
            (Side::Greater, true) => greater,
            (Side::Greater, false) => 0.5 * (a + b),
        };
        curve[knots[k]] + by * (tolerance / by.norm().max(f64::MIN_POSITIVE)).min(1.0)
    };
    let last = knots.len().saturating_sub(1);
    (0..knots.len()).map(|k| if k == 0 || k == last { curve[knots[k]] } else { aside(k) }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicU32, Ordering};
    use work::monitor::Silent;

    /// Says stop at the given question and all that follow.
    struct StopAt(AtomicU32);

    impl Monitor for StopAt {
        fn cancelled(&self) -> bool {
            self.0.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |n| n.checked_sub(1)).is_err()
        }
    }

    fn circle(s: f64) -> Option<Point3> {
        Some(Point3::new(10.0 * s.cos(), 10.0 * s.sin(), 0.0))
    }

    /// A straight line that falls off a wall on its way: the wall is where it is, and not a ramp.
    #[test]
    fn a_wall_on_the_way_stays_upright() {
        for wall in [0.1, 0.355, 0.5, 0.77] {
            let mut way =
                |s: f64| Some(Point3::new(0.27 * s, 0.02 * s, if s < 2.0 + wall { 8.0 } else { 2.0 }));
            let points =
                sample_within_chord(0.0, 4.0, 1.0, 1e-4, &mut way, &mut Watch::new(&Silent)).unwrap();
            let moves = reduce(&points, 4e-4, &mut Watch::new(&Silent)).unwrap();
            let falls = moves.windows(2).filter(|w| w[1].z < w[0].z - 1.0).collect::<Vec<_>>();
            assert_eq!(falls.len(), 1, "{moves:?}");
            assert!((falls[0][1] - falls[0][0]).xy().norm() < 1e-3, "{wall}: {moves:?}");
        }
    }

    #[test]
    fn chords_of_a_circle_hold_the_tolerance_and_no_more() {
        let tolerance = 1e-3;
        let points =
            sample_within_chord(0.0, 3.0, 0.5, tolerance, &mut circle, &mut Watch::new(&Silent)).unwrap();
        for pair in points.windows(2) {
            let chord = (pair[1] - pair[0]).norm();
            let sagitta = 10.0 - (100.0 - 0.25 * chord * chord).sqrt();
            assert!(sagitta <= tolerance, "{sagitta}");
            assert!(sagitta >= tolerance / 8.0, "halving loses at most a factor of four: {sagitta}");
        }
        let ideal = 30.0 / (8.0 * tolerance * 10.0f64).sqrt();
        assert!((points.len() as f64) < 2.0 * ideal + 2.0);
    }

    #[test]
    fn a_kink_ends_after_finitely_many_halvings() {
        let kink = &mut |s: f64| Some(Point3::new(s, (s - 0.3).abs(), 0.0));
        let points = sample_within_chord(0.0, 1.0, 1.0, 1e-9, kink, &mut Watch::new(&Silent)).unwrap();
        assert!(points.len() < 40, "{}", points.len());
        assert!(points.iter().any(|p| (p.x - 0.3).abs() < 1e-3));
    }

    #[test]
    fn reduction_keeps_ends_and_tolerance() {
        let dense: Vec<Point3> = (0..=1000).map(|k| circle(0.003 * k as f64).unwrap()).collect();
        let kept = reduce(&dense, 1e-3, &mut Watch::new(&Silent)).unwrap();
        assert_eq!(kept.first(), dense.first());
        assert_eq!(kept.last(), dense.last());
        assert!(kept.len() < 120, "{}", kept.len());
        for p in &dense {
            let d = kept.windows(2).map(|w| distance_to_segment(p, &w[0], &w[1])).fold(f64::MAX, f64::min);
            assert!(d <= 1e-3 + 1e-12);
        }
        let line: Vec<Point3> = (0..50).map(|k| Point3::new(k as f64, 0.0, 1.0)).collect();
        assert_eq!(reduce(&line, 1e-9, &mut Watch::new(&Silent)).unwrap().len(), 2);
    }

    #[test]
    fn a_jump_is_crossed_as_asked_and_a_kink_is_none() {
        let jump = &mut |s: f64| Some(Point3::new(s, if s < 0.3 { 0.0 } else { 2.0 }, 0.0));
        let mut crossed = 0;
        let across = &mut |a: &Point3, b: &Point3, _: &mut Watch<'_>| {
            crossed += 1;
            Ok(vec![Point3::new(a.x, 1.0, 5.0), Point3::new(b.x, 1.5, 5.0)])
        };
        let watch = &mut Watch::new(&Silent);
        let points = sample_over_jumps(0.0, 1.0, 0.25, 1e-3, jump, across, watch).unwrap();
        let over: Vec<usize> = (0..points.len()).filter(|&k| points[k].z == 5.0).collect();
        let &[first, second] = &over[..] else { panic!("{points:?}") };
        assert!(second == first + 1 && points[first - 1].y == 0.0 && points[second + 1].y == 2.0);
        assert!((points[first].x - 0.3).abs() < 0.01);
        let kink = &mut |s: f64| Some(Point3::new(s, (s - 0.3).abs(), 0.0));
        let across = &mut |_: &Point3, _: &Point3, _: &mut Watch<'_>| panic!("no jump");
        sample_over_jumps(0.0, 1.0, 0.25, 1e-3, kink, across, watch).unwrap();
        assert_eq!(crossed, 1);
        // Nothing between both ends.
        let gap = &mut |s: f64| (!(0.1..=0.9).contains(&s)).then(|| Point3::new(s, 0.0, 0.0));
        let across = &mut |a: &Point3, _: &Point3, _: &mut Watch<'_>| Ok(vec![Point3::new(a.x, 1.0, 5.0)]);
        let points = sample_over_jumps(0.0, 1.0, 1.0, 1e-3, gap, across, watch).unwrap();
        assert!(points.len() == 3 && points[1].z == 5.0, "{points:?}");
    }

    /// A path so rough that it would take billions of places ends soon after the user asks for it,
    /// also where nothing is located at all, and also while points are thinned.
    #[test]
    fn a_pass_is_left_half_way_when_asked() {
        for questions in [0, 1, 7] {
            let mut located = 0u32;
            let mut rough = |s: f64| {
                located += 1;
                Some(Point3::new(s, (1e9 * s).sin(), 0.0))
            };
            let stop = StopAt(AtomicU32::new(questions));
            let got = sample_within_chord(0.0, 1e6, 1.0, 1e-9, &mut rough, &mut Watch::new(&stop));
            assert_eq!(got, Err(Cancelled));
            // Up to four places a step.
            assert!(located <= 4 * STEPS_BETWEEN_QUESTIONS * (questions + 1), "{located} for {questions}");
        }
        let mut located = 0u32;
        let mut nowhere = |_| {
            located += 1;
            None::<Point3>
        };
        let stop = StopAt(AtomicU32::new(2));
        let got = sample_within_chord(0.0, 1e9, 1.0, 1e-9, &mut nowhere, &mut Watch::new(&stop));
        assert_eq!((got, located), (Err(Cancelled), 3 * STEPS_BETWEEN_QUESTIONS - 1));
        let rough: Vec<Point3> =
            (0..10_000).map(|k| Point3::new(f64::from(k), f64::from(k % 2), 0.0)).collect();
        let stop = StopAt(AtomicU32::new(3));
        assert_eq!(reduce(&rough, 1e-3, &mut Watch::new(&stop)), Err(Cancelled));
        assert_eq!(stop.0.into_inner(), 0, "asked until it said stop");
    }
}
