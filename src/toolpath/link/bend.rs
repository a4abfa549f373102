//! Links on the surface: from the end of a pass to the start of the next along a bend that leaves and joins
//! them smoothly, the cutter dropped on the part all along it.
//!
//! In the plan view a bend is a cubic whose ends have the directions of the passes (C. Hermite's form). With
//! tangents twice as long as the ends lie apart, a turn between two parallel passes is nearly a half circle,
//! as cubics go; where the ends lie farther apart than passes do, tangents stop growing, and the way between
//! two turns becomes straight. With shorter tangents the way is shorter and the machine slower in its turns:
//! the bend that takes the least time is taken, as far as the plan view tells before the cutter is dropped
//! along it. Heights come from dropping the cutter, so that a link can never cut deeper into the part than
//! its chords, and never raises what stands beside it.

use crate::moves::chord::{Watch, reduce, sample_within_chord};
use crate::surface::border::Border;
use cutter::Cutter;
use drop_cutter::{Beside, DropCutter};
use geometry::{Point2, Point3, Vector2};
use machine::{Machine, machining_time};
use motion::{ClPoint, Move, MoveKind, Toolpath};
use work::monitor::{Cancelled, Monitor};

/// Length of the tangents at both ends over the distance of the ends: 2 makes a half circle's bulge,
/// half the distance. Less makes turns tighter, more drives them farther over the border.
pub const TANGENT: f64 = 2.0;

/// Tangents of the turns that are tried: half circles, and down to ways that are hardly longer than straight
/// ones.
const TANGENTS: [f64; 4] = [TANGENT, 1.0, 0.5, 0.25];

/// Tangents are never longer than this many times their share of the distance and the interval between
/// passes.
const LONGEST_TANGENT: f64 = 2.0;

/// A link may roll over the border of the part by this many intervals: one for the pass itself, one
/// for the bend. A greater roll would cut the edges of a solid part, a smaller one forbids turns at
/// borders that passes meet at an angle.
pub const MOST_ROLL: f64 = 2.0;

/// Ends with opposite feeds that lie beside each other by less than this many intervals are joined by a
/// loop, for a plain bend between them would be a hairpin.
const NARROW: f64 = 0.5;

/// Turns between ends of which one lies ahead are tried this share of the way beside each other: wide first,
/// and narrower where that would roll too far over the border.
const SHARES_BESIDE: [f64; 3] = [1.0, 0.5, 0.25];

/// Tangents at the ends of a loop, in intervals. Half as long, the loop is hardly wider than a hairpin.
const LOOP_TANGENT: f64 = 2.0;

/// First sampling distance along a bend, in intervals.
pub const SAMPLING: f64 = 0.25;

/// Tips of a pass that tell its curvature at its end.
const CURVATURE_TIPS: usize = 3;

/// Share of the chord tolerance that sampling may use; thinning uses the rest.
const SAMPLING_SHARE: f64 = 0.4;

/// What links on the surface are made from.
pub struct Bends<'a> {
    /// Drops the cutter.
    pub drop: DropCutter<'a>,
    /// Where the part ends.
    pub border: Border<'a>,
    /// The cutter.
    pub cutter: &'a Cutter,
    /// Interval between passes, mm.
    pub interval: f64,
    /// No link is longer, mm.
    pub longest: f64,
    /// Largest distance between the moves of a link and its exact curve, mm.
    pub chord_tolerance: f64,
    /// Which of several bends is the quickest is asked of this machine.
    pub machine: &'a Machine,
    /// Feed, mm/min.
    pub feed_rate: f64,
}

/// An end of a pass: a tip, and the direction of the feed there in the plan view (zero where the pass
/// stands still in it).
#[derive(Debug, Clone, Copy)]
pub struct End {
    /// Tip, mm.
    pub tip: Point3,
    /// Unit vector, or zero.
    pub feed: Vector2,
}

impl End {
    /// Where a pass begins.
    pub fn first(points: &[Point3]) -> Self {
        let last = Self::last_of(points.iter());
        Self { feed: -last.feed, ..last }
    }

    /// Where a pass ends.
    pub fn last(points: &[Point3]) -> Self {
        Self::last_of(points.iter().rev())
    }

    /// The end from which `inward` goes: its direction is that of the circle through three points, for
    /// the chord's own is off by half the angle that the pass turns by from chord to chord.
    fn last_of<'p>(mut inward: impl Iterator<Item = &'p Point3>) -> Self {
        let Some(tip) = inward.next() else { return Self { tip: Point3::origin(), feed: Vector2::zeros() } };
        let mut two = inward.filter(|p| p.xy() != tip.xy()).take(2);
        let (Some(a), b) = (two.next(), two.next()) else {
            return Self { tip: *tip, feed: Vector2::zeros() };
        };
        let chord = (tip - a).xy();
        let unit = chord.normalize();
        let feed = match b.map(|b| (a - b).xy()) {
            Some(before) if before.norm() > 0.0 => {
                let share = chord.norm() / (chord.norm() + before.norm());
                let turned = unit + (unit - before.normalize()) * share;
                turned.try_normalize(0.0).unwrap_or(unit)
            }
            _ => unit,
        };
        Self { tip: *tip, feed }
    }
}

/// A cubic of a plane over the parameters 0 to 1.
pub struct Cubic {
    ends: [Point2; 2],
    tangents: [Vector2; 2],
}

impl Cubic {
    fn new(ends: [Point2; 2], tangents: [Vector2; 2]) -> Self {
        Self { ends, tangents }
    }

    pub fn at(&self, t: f64) -> Point2 {
        let (t2, t3) = (t * t, t * t * t);
        let [a, b] = self.tangents;
        self.ends[0]
            + (self.ends[1] - self.ends[0]) * (3.0 * t2 - 2.0 * t3)
            + a * (t3 - 2.0 * t2 + t)
            + b * (t3 - t2)
    }

    /// Along the cubic, of no unit length.
    pub fn along(&self, t: f64) -> Vector2 {
        let [a, b] = self.tangents;
        let chord = self.ends[1] - self.ends[0];
        chord * (6.0 * t * (1.0 - t)) + a * ((1.0 - t) * (1.0 - 3.0 * t)) + b * (t * (3.0 * t - 2.0))
    }

    /// Length of sixteen chords, which is near enough to refuse what is too long.
    pub fn length(&self) -> f64 {
        let at = |k: u32| self.at(f64::from(k) / 16.0);
        (0..16).map(|k| (at(k + 1) - at(k)).norm()).sum()
    }
}

/// Places along cubics that follow each other, after the first end up to and with the second, as if the
/// ground rose evenly from one to the other.
fn lifted(curve: &[Cubic], from: &End, to: &End) -> Vec<Point3> {
    /// Places along each cubic.
    const PLACES: usize = 16;
    let count = PLACES * curve.len();
    let place = |k: usize| {
        if k == count {
            return to.tip;
        }
        let p = curve[k / PLACES].at((k % PLACES) as f64 / PLACES as f64);
        let z = from.tip.z + (to.tip.z - from.tip.z) * (k as f64 / count as f64);
        Point3::new(p.x, p.y, z)
    };
    (1..=count).map(place).collect()
}

/// A turn between ends with about opposite feeds.
struct Turn {
    /// The mean way out.
    out: Vector2,
    /// How far along it the second end lies from the first, mm, and the rest of the way there.
    ahead: f64,
    beside: Vector2,
}

impl Turn {
    fn between(from: &End, to: &End) -> Option<Self> {
        let out = (from.feed - to.feed).try_normalize(0.5)?;
        let span = (to.tip - from.tip).xy();
        let ahead = span.dot(&out);
        Some(Self { out, ahead, beside: span - out * ahead })
    }
}

/// The bends worth trying between two ends, the gentlest first, with tangents of some length over the
/// distance of the ends; passes lie an interval apart, mm.
pub fn curves(interval: f64, tangents: f64, from: &End, to: &End) -> Vec<Vec<Cubic>> {
    let span = (to.tip - from.tip).xy();
    let tangent = tangents * span.norm().min(LONGEST_TANGENT * interval);
    let plain = Cubic::new([from.tip.xy(), to.tip.xy()], [from.feed * tangent, to.feed * tangent]);
    let Some(Turn { out, ahead, beside }) = Turn::between(from, to) else { return vec![vec![plain]] };
    if beside.norm() >= NARROW * interval {
        let turns = SHARES_BESIDE.map(|share| turn_beside(interval, tangents, from, to, ahead, share));
        return turns.into_iter().chain([vec![plain]]).collect();
    }
    // Out to the far point of a loop, across it, and back.
    let across = Vector2::new(out.y, -out.x);
    let across = if across.dot(&span) < 0.0 { -across } else { across };
    let far = from.tip.xy() + beside * 0.5 + out * (ahead.max(0.0) + interval);
    let (wide, at_far) = (LOOP_TANGENT * interval, across * interval);
    let first = Cubic::new([from.tip.xy(), far], [from.feed * wide, at_far]);
    let second = Cubic::new([far, to.tip.xy()], [at_far, to.feed * wide]);
    vec![vec![first, second], vec![plain]]
}

/// A turn between ends with opposite feeds, of which the second lies `ahead` of the first: on along the feed
/// until the farther end is reached, and a bend between places this share of the way beside each other that
/// the ends are. One bend all the way would be a hairpin.
fn turn_beside(interval: f64, tangents: f64, from: &End, to: &End, ahead: f64, share: f64) -> Vec<Cubic> {
    let (start, end) = (from.tip.xy(), to.tip.xy());
    let turn = |places: [Point2; 2]| {
        let tangent = tangents * (places[1] - places[0]).norm().min(LONGEST_TANGENT * interval);
        Cubic::new(places, [from.feed * tangent, to.feed * tangent])
    };
    if ahead > 0.0 {
        let near = end + (start + from.feed * ahead - end) * share;
        vec![Cubic::new([start, near], [from.feed * ahead; 2]), turn([near, end])]
    } else {
        let near = start + (end + to.feed * ahead - start) * share;
        vec![turn([start, near]), Cubic::new([near, end], [to.feed * -ahead; 2])]
    }
}

impl Bends<'_> {
    /// The moves after the last tip of one pass up to and with the first one of the next, no lower than the
    /// `floor`, mm; `None` where a link would be too long, or leave the part.
    ///
    /// # Errors
    /// [`Cancelled`] when the monitor says so.
    ///
    /// # Tolerance
    /// Straight moves stay within the chord tolerance of where the dropped cutter would be.
    pub fn link(
        &self,
        before: &[Point3],
        after: &[Point3],
        floor: f64,
        monitor: &dyn Monitor,
    ) -> Result<Option<Vec<Point3>>, Cancelled> {
        let (from, to) = (End::last(before), End::first(after));
        let span = to.tip - from.tip;
        if span.norm() > self.longest || span.xy().norm() == 0.0 {
            return Ok(None);
        }
        let speed = self.feed_rate / 60.0;
        let ways = [self.braking(before.iter().rev()), self.braking(after.iter())];
        // Quicker than a loop would be a hairpin, in which the tool stands still.
        let needs_loop = Turn::between(&from, &to).is_some_and(|t| t.beside.norm() < NARROW * self.interval);
        let tangents = if needs_loop { &TANGENTS[..1] } else { &TANGENTS };
        let mut candidates = Vec::new();
        for curve in tangents.iter().flat_map(|&tangents| curves(self.interval, tangents, &from, &to)) {
            let length = curve.iter().map(Cubic::length).sum::<f64>();
            if length <= self.longest {
                // The loop comes before what it is to replace.
                let about =
                    if needs_loop { 0.0 } else { self.time(&ways, &lifted(&curve, &from, &to), monitor)? };
                candidates.push((about, length, curve));
            }
        }
        // To drop the cutter takes most of the time: only on what may be the quickest.
        candidates.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut best: Option<(f64, Vec<Point3>)> = None;
        for (about, length, curve) in candidates {
            let least = best.as_ref().map_or(f64::INFINITY, |(time, _)| *time);
            if about >= least || length / speed >= least {
                continue;
            }
            if let Some(moves) = self.follow((&curve, length), [&from, &to], floor, monitor)? {
                let time = self.time(&ways, &moves, monitor)?;
                if time < least {
                    best = Some((time, moves));
                }
                if needs_loop {
                    break;
                }
            }
        }
        Ok(best.map(|(_, moves)| moves))
    }

    /// The tips from an end on along which the machine comes to the feed, with those that tell the curvature
    /// there.
    fn braking<'p>(&self, tips: impl Iterator<Item = &'p Point3>) -> Vec<Point3> {
        let speed = self.feed_rate / 60.0;
        let (mut left, mut last, mut some) = (speed * speed / self.machine.acceleration, None, Vec::new());
        for tip in tips {
            left -= last.map_or(0.0, |last: Point3| (tip - last).norm());
            last = Some(*tip);
            some.push(*tip);
            if left <= 0.0 && some.len() > CURVATURE_TIPS {
                break;
            }
        }
        some
    }

    /// What the machine takes for a link, s, more than for the ways of passes to and from it, which are the
    /// same for all links.
    fn time(
        &self,
        [before, after]: &[Vec<Point3>; 2],
        moves: &[Point3],
        monitor: &dyn Monitor,
    ) -> Result<f64, Cancelled> {
        let one = |tip: &Point3| Move {
            to: ClPoint::upright(*tip),
            kind: MoveKind::Link,
            feed_rate: self.feed_rate,
            pass: 0,
        };
        let steps = before.iter().rev().chain(moves).chain(after.iter().skip(1)).skip(1).map(one).collect();
        let start = before.last().map_or(Point3::origin(), |tip| *tip);
        let path = Toolpath::new(ClPoint::upright(start), steps);
        let length = |tips: &[Point3]| tips.windows(2).map(|w| (w[1] - w[0]).norm()).sum::<f64>();
        let ways = (length(before) + length(after)) * 60.0 / self.feed_rate;
        Ok(machining_time(&path, self.machine, monitor)? - ways)
    }

    /// The moves along some cubics that follow each other.
    fn follow(
        &self,
        (curve, length): (&[Cubic], f64),
        [from, to]: [&End; 2],
        floor: f64,
        monitor: &dyn Monitor,
    ) -> Result<Option<Vec<Point3>>, Cancelled> {
        let (mut stays, mut beside) = (true, Beside::default());
        let mut locate = |t: f64| {
            let k = (t as usize).min(curve.len() - 1);
            let p = curve[k].at(t - k as f64);
            let drop = self.drop.at_beside(p.x, p.y, &mut beside);
            let drop = drop.filter(|d| {
                !self.border.holds(&d.contact)
                    || self.border.rolled(self.cutter, &p, &d.contact) <= MOST_ROLL * self.interval
            });
            stays &= drop.is_some();
            drop.map(|d| Point3::new(p.x, p.y, d.tip_z.max(floor)))
        };
        let mut watch = Watch::new(monitor);
        let fine = SAMPLING_SHARE * self.chord_tolerance;
        let end = curve.len() as f64;
        let step = (SAMPLING * self.interval * end / length).min(0.25);
        let mut points = sample_within_chord(0.0, end, step, fine, &mut locate, &mut watch)?;
        // The passes' own ends lie within their tolerance of the part, but not always on it.
        let close =
            |a: Option<&Point3>, b: &Point3| a.is_some_and(|a| (a - b).norm() <= self.chord_tolerance);
        if !stays || !close(points.first(), &from.tip) || !close(points.last(), &to.tip) {
            return Ok(None);
        }
        let last = points.len() - 1;
        (points[0], points[last]) = (from.tip, to.tip);
        let length: f64 = points.windows(2).map(|w| (w[1] - w[0]).norm()).sum();
        if length > self.longest {
            return Ok(None);
        }
        let mut moves = reduce(&points, self.chord_tolerance - fine, &mut watch)?;
        moves.remove(0);
        Ok(Some(moves))
    }
}
