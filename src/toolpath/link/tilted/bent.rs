//! Links of a tilted cutter on the surface: from the end of a pass to the start of the next over contacts in
//! between.
//!
//! In the tangent plane half way a link is a bend of upright passes ([`curves`]); its places are carried to
//! the nearest contact of the part, beyond the border to the plane that continues it. The axis turns evenly
//! over the length of the link; where it follows the feed, and the cutter is no ball, it keeps its lead and
//! tilt and so leads the contact around the cutter, which would leap from one side to the other of a flat end
//! if the axis went through the normal.

use crate::link::bend::{Cubic, End, MOST_ROLL, SAMPLING, TANGENT, curves};
use crate::moves::chord::{Watch, sample_within_chord};
use crate::moves::touch::Touch;
use crate::tilt::tilted::{ABOVE_SURFACE, MoveRules, Tilting, located_sampling, thinned};
use collision::Interference;
use cutter::Cutter;
use geometry::{Point2, Point3, Vector3};
use motion::{CcPoint, ClPoint};
use part::Part;
use work::monitor::{Cancelled, Monitor};

/// Chords by which the length along a bend is told; the axis turns as evenly as they do.
const CHORDS: usize = 32;

/// What links on the surface are made from.
pub struct Bent<'a> {
    /// The part.
    pub part: &'a Part,
    /// The cutter.
    pub cutter: &'a Cutter,
    /// How it is tilted.
    pub tilting: &'a Tilting<'a>,
    /// What a cutter keeps away from while it touches.
    pub touching: &'a Interference<'a>,
    /// Interval between passes, mm.
    pub interval: f64,
    /// No link is longer, mm of contact.
    pub longest: f64,
    /// Largest distance of the moves from the exact link, mm.
    pub chord_tolerance: f64,
    /// Share of it that thinning may use, mm.
    pub thinning: f64,
}

impl Bent<'_> {
    /// The locations after `from` up to and with `to`; `None` where a link would be too long, roll too far
    /// over the border, turn the axis too fast, or not be clear.
    ///
    /// # Errors
    /// [`Cancelled`] when the monitor says so.
    pub fn link(
        &self,
        from: &Touch,
        to: &Touch,
        monitor: &dyn Monitor,
    ) -> Result<Option<Vec<ClPoint>>, Cancelled> {
        let Some(plane) = Plane::between(from, to) else { return Ok(None) };
        let [a, b] = [from, to].map(|touch| plane.end(touch));
        let apart = (b.tip - a.tip).norm();
        // A mesh has facets instead of normals that turn.
        if self.part.patches().is_empty() || apart > self.longest || (b.tip - a.tip).xy().norm() == 0.0 {
            return Ok(None);
        }
        for curve in curves(self.interval, TANGENT, &a, &b) {
            if curve.iter().map(Cubic::length).sum::<f64>() > self.longest {
                continue;
            }
            if let Some(touches) =
                self.follow(&Way::new(&curve, &plane, [a.tip.z, b.tip.z]), from, to, monitor)?
            {
                let rules = MoveRules { keep: Some(self.touching), ..MoveRules::default() };
                let moves = thinned(&touches, self.thinning, rules, monitor)?;
                let clear = |w: &[ClPoint]| self.touching.on_move(&w[0], &w[1]).is_none();
                if moves.windows(2).all(clear) {
                    return Ok(Some(moves[1..].to_vec()));
                }
            }
        }
        Ok(None)
    }

    /// The touches along a way, both ends included.
    fn follow(
        &self,
        way: &Way,
        from: &Touch,
        to: &Touch,
        monitor: &dyn Monitor,
    ) -> Result<Option<Vec<Touch>>, Cancelled> {
        let turning = self.turning(from, to);
        let mut stays = true;
        let mut locate = |t: f64| {
            let touch = self.touch(way, t, &turning);
            stays &= touch.is_some();
            touch
        };
        let end = way.curve.len() as f64;
        let step = (SAMPLING * self.interval * end / way.length()).min(0.25);
        let fine = located_sampling(self.chord_tolerance);
        let mut touches = sample_within_chord(0.0, end, step, fine, &mut locate, &mut Watch::new(monitor))?;
        let near = |a: Option<&Touch>, b: &Touch| {
            a.is_some_and(|a| (a.at.tip - b.at.tip).norm() <= self.chord_tolerance)
        };
        if !stays || touches.len() < 2 || !near(touches.first(), from) || !near(touches.last(), to) {
            return Ok(None);
        }
        let last = touches.len() - 1;
        (touches[0], touches[last]) = (*from, *to);
        let way = |w: &[Touch]| (w[1].contact.point - w[0].contact.point).norm();
        if touches.windows(2).map(way).sum::<f64>() > self.longest {
            return Ok(None);
        }
        let even =
            |rate: f64| touches.windows(2).all(|w| (w[1].at.axis - w[0].at.axis).norm() <= rate * way(w));
        Ok(self.tilting.most_turning.is_none_or(|rate| even(rate * SLACK)).then_some(touches))
    }

    fn turning(&self, from: &Touch, to: &Touch) -> Turning {
        if !self.cutter.is_ball()
            && self.tilting.axis.follows_feed()
            && let (Some(a), Some(b)) = (Lean::of(from), Lean::of(to))
        {
            return Turning::WithFeed(a, b);
        }
        Turning::Evenly(from.at, to.at)
    }

    fn touch(&self, way: &Way, t: f64, turning: &Turning) -> Option<Touch> {
        let (guess, along) = way.at(t);
        let foot = self.part.closest_point(&guess).0;
        let off = guess - foot.point;
        // Nothing but rounding, except beyond the border.
        let beyond = off - foot.normal * off.dot(&foot.normal);
        if beyond.norm() > MOST_ROLL * self.interval {
            return None;
        }
        let contact = CcPoint { point: foot.point + beyond, normal: foot.normal };
        let feed = (along - contact.normal * along.dot(&contact.normal)).try_normalize(1e-9)?;
        let share = way.share(t);
        let axis = match turning {
            Turning::Evenly(a, b) => a.towards(b, share).axis,
            Turning::WithFeed(a, b) => a.towards(b, share).axis(&contact.normal, &feed)?,
        };
        (axis.dot(&contact.normal) > ABOVE_SURFACE).then(|| Touch::along(axis, self.cutter, contact, feed))
    }
}

/// Rounding of the way between touches, and chords of the axis for its turn.
const SLACK: f64 = 1.01;

/// How the axis goes from one end of a link to the other.
enum Turning {
    /// In the plane of both.
    Evenly(ClPoint, ClPoint),
    /// As it stands to the normal and the feed.
    WithFeed(Lean, Lean),
}

/// An axis along the feed, to the left of it, and along the normal.
struct Lean([f64; 3]);

impl Lean {
    fn of(touch: &Touch) -> Option<Self> {
        let (n, axis) = (touch.contact.normal, touch.at.axis);
        let feed = (touch.feed - n * touch.feed.dot(&n)).try_normalize(1e-9)?;
        Some(Self([axis.dot(&feed), axis.dot(&n.cross(&feed)), axis.dot(&n)]))
    }

    fn towards(&self, to: &Self, share: f64) -> Self {
        Self([0, 1, 2].map(|k| self.0[k] + (to.0[k] - self.0[k]) * share))
    }

    fn axis(&self, normal: &Vector3, feed: &Vector3) -> Option<Vector3> {
        let [ahead, left, up] = self.0;
        (feed * ahead + normal.cross(feed) * left + normal * up).try_normalize(1e-9)
    }
}

/// The plane in which a link is drawn: in the middle of its ends, square to the mean of their normals.
struct Plane {
    origin: Point3,
    axes: [Vector3; 3],
}

impl Plane {
    fn between(from: &Touch, to: &Touch) -> Option<Self> {
        let normal = (from.contact.normal + to.contact.normal).try_normalize(1e-3)?;
        let across = if normal.x.abs() < 0.6 { Vector3::x() } else { Vector3::y() };
        let x = normal.cross(&across).normalize();
        let origin = nalgebra::center(&from.contact.point, &to.contact.point);
        Some(Self { origin, axes: [x, normal.cross(&x), normal] })
    }

    fn end(&self, touch: &Touch) -> End {
        let off = touch.contact.point - self.origin;
        let [x, y, z] = self.axes.map(|axis| axis.dot(&off));
        let feed = nalgebra::Vector2::new(self.axes[0].dot(&touch.feed), self.axes[1].dot(&touch.feed));
        End { tip: Point3::new(x, y, z), feed: feed.try_normalize(1e-9).unwrap_or_default() }
    }
}

/// A bend over a plane, by its cubics one after the other.
struct Way<'a> {
    curve: &'a [Cubic],
    plane: &'a Plane,
    /// Heights over the plane at both ends.
    heights: [f64; 2],
    /// Length up to each chord.
    lengths: Vec<f64>,
}

impl<'a> Way<'a> {
    fn new(curve: &'a [Cubic], plane: &'a Plane, heights: [f64; 2]) -> Self {
        let mut way = Self { curve, plane, heights, lengths: vec![0.0] };
        let count = CHORDS * curve.len();
        let place = |k: usize| way.flat(k as f64 / CHORDS as f64);
        let chords: Vec<f64> = (0..count).map(|k| (place(k + 1) - place(k)).norm()).collect();
        for chord in chords {
            way.lengths.push(way.length() + chord);
        }
        way
    }

    fn length(&self) -> f64 {
        self.lengths[self.lengths.len() - 1]
    }

    fn piece(&self, t: f64) -> (&Cubic, f64) {
        let k = (t as usize).min(self.curve.len() - 1);
        (&self.curve[k], t - k as f64)
    }

    fn flat(&self, t: f64) -> Point2 {
        let (cubic, t) = self.piece(t);
        cubic.at(t)
    }

    /// Share of the length up to `t`.
    fn share(&self, t: f64) -> f64 {
        let place = (t * CHORDS as f64).clamp(0.0, (self.lengths.len() - 1) as f64);
        let k = (place as usize).min(self.lengths.len() - 2);
        let length = self.lengths[k] + (self.lengths[k + 1] - self.lengths[k]) * (place - k as f64);
        length / self.length().max(f64::MIN_POSITIVE)
    }

    /// The place over the plane, and along the bend.
    fn at(&self, t: f64) -> (Point3, Vector3) {
        let (cubic, s) = self.piece(t);
        let (flat, along, [x, y, normal]) = (cubic.at(s), cubic.along(s), self.plane.axes);
        let height = self.heights[0] + (self.heights[1] - self.heights[0]) * self.share(t);
        let place = self.plane.origin + x * flat.x + y * flat.y + normal * height;
        (place, x * along.x + y * along.y)
    }
}
