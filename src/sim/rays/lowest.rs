//! The lowest place of one ray that one part of a move reaches.
//!
//! The distance D(s, t) from the tool is a function of the place along the ray and of the time. A look at
//! one (s, t) bounds it everywhere else, by the supporting plane of the tool as it stands then; how the
//! tool turns meanwhile loosens the bound. Wherever a look at the limit falls inside of the tool, the limit
//! goes down to where the ray enters it at that time (Newton's method on a convex function), and the search
//! over time goes on from there: it ends when no stretch of time may reach below the limit.
//!
//! That takes squares all along a ray that grazes the tool: a pass a radius aside touches the plane of a wall's
//! normals along a line across s and t. While the axis stands still, D is a convex function of both together,
//! and every look supports it everywhere. So where a search is long, the rest is sought in the polygon that
//! such supports leave.

use super::support_area::SupportArea;
use crate::solid::{Look, Motion, MovePart, Moving, SHORTEST, Sample, Stretch, SweptMoves};
use cutter::Solid;
use geometry::{Point3, Vector3};

/// How far inside of the tool a lower place may be missed, mm. Less costs looks.
const TOLERANCE: f64 = 1e-11;

/// The entry into the tool is found to this distance from it, mm: some units of rounding.
const TOUCHING: f64 = 1e-13;

/// Up to this coordinate, mm, that holds; what lies farther off is rounded in proportion, and all of these
/// distances grow as much.
const NEAR_ORIGIN: f64 = 1e3;

/// Steps of Newton's method, which needs three to eight; corners and grazing rays more.
const MAX_STEPS: usize = 60;

/// Ranges of the ray shorter than this, mm, are not divided.
const SHORTEST_RANGE: f64 = 1e-10;

/// A search is long when it has looked at more stretches, with a few looks each: a polygon takes some dozens of
/// looks, so that both together take no more than about twice as long as the quicker one.
const LONG: usize = 16;

/// Stretches that wait at once, but for odd moves.
const USUALLY: usize = 16;

/// A ray and the range that is looked at, mm.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ray {
    pub(super) point: Point3,
    pub(super) normal: Vector3,
    pub(super) low: f64,
    pub(super) high: f64,
}

/// A lower bound on the distance along a ray: `value + rise (s' − s) − lean |s' − s|`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Support {
    pub(super) s: f64,
    pub(super) value: f64,
    pub(super) rise: f64,
    pub(super) lean: f64,
}

impl Support {
    /// The lowest place in the range at which the bound is zero or less; infinite if there is none.
    #[inline]
    pub(super) fn reach(&self, [low, high]: [f64; 2]) -> f64 {
        // By how much the bound grows for each mm downward, and upward.
        let (down, up) = (-self.rise - self.lean, self.rise - self.lean);
        if self.value > 0.0 {
            if self.value + down * (self.s - low) <= 0.0 {
                return low;
            }
            let above = if up < 0.0 { self.s - self.value / up } else { f64::INFINITY };
            return if above <= high { above } else { f64::INFINITY };
        }
        if down > 0.0 { (self.s + self.value / down).max(low) } else { low }
    }
}

/// A look at the tool from a place of the ray.
#[derive(Clone, Copy)]
struct Seen {
    s: f64,
    look: Look,
    rise: f64,
}

/// A stretch of time and the lower end of the range of the ray that is open in it; `top` is the upper end,
/// unless the limit is lower by now.
#[derive(Clone, Copy)]
struct Open {
    a: Seen,
    b: Seen,
    low: f64,
    top: f64,
    quick: bool,
}

impl Ray {
    #[inline(always)]
    pub(super) fn at(&self, s: f64) -> Point3 {
        self.point + self.normal * s
    }

    /// Where to look first: at the surface itself.
    #[inline(always)]
    pub(super) fn first(&self) -> f64 {
        0f64.clamp(self.low, self.high)
    }

    /// The lowest place up to `limit` that is reached in a part of a move, and when; `None` if there is
    /// none.
    pub(super) fn lowest_of(&self, moves: &SweptMoves, part: &MovePart, limit: f64) -> Option<(f64, f64)> {
        if limit < self.low {
            return None;
        }
        let (solid, motion) = (moves.solid(), moves.motion(part));
        let mut best = None;
        let mut now = limit;
        for piece in 0..solid.pieces() {
            if let Some(found) = self.lowest_of_piece(solid, motion, piece, part.range, now) {
                now = found.0;
                best = Some(found);
            }
        }
        best
    }

    fn lowest_of_piece(
        &self,
        solid: &Solid,
        motion: &Motion,
        piece: usize,
        range: [f64; 2],
        limit: f64,
    ) -> Option<(f64, f64)> {
        match motion.ball(solid, &[self.at(self.low), self.at(limit)], range) {
            Some(ball) => Search::new(self, ball, range, limit).run(),
            None => Search::new(self, motion.piece(solid, piece), range, limit).run(),
        }
    }
}

/// The search over time.
struct Search<'a, M> {
    ray: &'a Ray,
    moving: M,
    range: [f64; 2],
    /// Bounds on the bend and its change, at any place of the ray.
    bends: [f64; 2],
    limit: f64,
    /// When the limit is reached; no number unless a move reaches it.
    at: f64,
    /// How many times as far from the origin the ray begins as [`NEAR_ORIGIN`]; no less than 1.
    far: f64,
    /// Whether the distance is convex in place and time together.
    convex: bool,
}

impl<'a, M: Moving> Search<'a, M> {
    fn new(ray: &'a Ray, moving: M, range: [f64; 2], limit: f64) -> Self {
        let ends = [ray.low, limit].map(|s| moving.bends(&ray.at(s), range));
        let bends = [0, 1].map(|k| ends[0][k].max(ends[1][k]));
        let far = (ray.point.coords.amax() / NEAR_ORIGIN).max(1.0);
        let convex = moving.turn() == 0.0 && bends == [0.0; 2];
        Self { ray, moving, range, bends, limit, at: f64::NAN, far, convex }
    }

    #[inline(always)]
    fn look(&self, s: f64, t: f64) -> Seen {
        let look = self.moving.look(&self.ray.at(s), t);
        Seen { s, look, rise: look.gradient.dot(&self.ray.normal) }
    }

    fn run(mut self) -> Option<(f64, f64)> {
        let [from, to] = self.range;
        let half = 0.5 * (to - from);
        let first = if self.limit < self.ray.high { self.limit } else { self.ray.first() };
        let middle = self.look(first, from + half);
        let sample = &middle.look.sample;
        let bend = self.bends[0].min((-sample.bend).max(0.0) + self.bends[1] * half / 3.0);
        let support = Support {
            s: first,
            value: sample.value - half * (sample.slope.abs() + 0.5 * half * bend),
            rise: middle.rise,
            lean: self.moving.turn() * half,
        };
        let reach = support.reach([self.ray.low, self.limit]);
        if reach > self.limit - self.far * TOLERANCE || support.value.is_nan() {
            return None;
        }
        let middle = self.enter(middle);
        let a = self.look(self.limit, from);
        let a = self.enter(a);
        let b = self.look(self.limit, to);
        let b = self.enter(b);
        let (low, top) = (self.ray.low, self.limit);
        let mut open = Vec::with_capacity(USUALLY);
        open.push(Open { a, b: middle, low, top, quick: true });
        open.push(Open { a: middle, b, low, top, quick: true });
        let mut divided = 0;
        while let Some(stretch) = open.pop() {
            divided += 1;
            if self.convex && divided > LONG {
                self.by_area();
                break;
            }
            self.divide(&stretch, &mut open);
        }
        (!self.at.is_nan()).then_some((self.limit, self.at))
    }

    /// Leaves out a stretch that cannot reach below the limit, or divides it in two.
    fn divide(&mut self, open: &Open, waiting: &mut Vec<Open>) {
        let top = self.limit.min(open.top);
        if top <= open.low {
            return;
        }
        let width = open.b.look.sample.t - open.a.look.sample.t;
        let turn = self.moving.turn();
        let stretch = Stretch {
            a: open.a.from(top, turn, 1.0).look.sample,
            b: open.b.from(top, turn, -1.0).look.sample,
            quick: open.quick,
        };
        let (bound, crossing) = stretch.bound(self.bends);
        // By how much the distance may be less further down, where the tool's side faces downward.
        let fall = (open.a.rise.max(open.b.rise) + turn * width).max(0.0) * (top - open.low);
        // No number comes of places that are none.
        let tolerance = self.far * TOLERANCE;
        if bound - fall > -tolerance || width < SHORTEST || bound.is_nan() {
            return;
        }
        if bound > -tolerance && top - open.low > self.far * SHORTEST_RANGE {
            let middle = 0.5 * (top + open.low);
            let mut again = |t: f64| {
                let seen = self.look(middle, t);
                self.enter(seen)
            };
            let (a, b) = (again(open.a.look.sample.t), again(open.b.look.sample.t));
            waiting.push(Open { low: middle, top, ..*open });
            waiting.push(Open { a, b, top: middle, ..*open });
            return;
        }
        if bound > -tolerance {
            return;
        }
        let seen = self.look(top, stretch.next(crossing));
        let between = self.enter(seen);
        let sample = &between.look.sample;
        let quick = |now: f64| now < 0.5 * width || !open.quick;
        let left = Open { b: between, quick: quick(sample.t - stretch.a.t), ..*open };
        let right = Open { a: between, quick: quick(stretch.b.t - sample.t), ..*open };
        waiting.extend(if sample.slope > 0.0 { [right, left] } else { [left, right] });
    }

    /// Leaves no place below the limit that is deeper in the tool than the tolerance, where the distance is
    /// convex. Each look from the middle of what is left takes a third of it or more; one from its lowest corner
    /// ends the search where the tool begins there. What lies deeper makes a circle, or a quarter of one, so that
    /// a hundred looks or so see it or prove that there is none.
    fn by_area(&mut self) {
        // One half of what may be missed is left to the looks, the other to the rest of the area. With this
        // scale of time the distance grows by no more than √2 times the way, and a quarter of a circle holds
        // one with 0.41 times its radius.
        let tolerance = 0.5 * self.far * TOLERANCE;
        let mut area = SupportArea::new([self.ray.low, self.limit], self.range, self.moving.pace().max(1.0));
        while let Some(middle) = area.middle(0.25 * tolerance) {
            for [s, t] in [Some(middle), area.lowest()].into_iter().flatten() {
                let mut seen = self.look(s, t);
                if seen.look.sample.value <= -tolerance {
                    seen = self.enter(seen);
                    area.keep([self.limit, t], 0.0, [1.0, 0.0]);
                }
                let Sample { t, value, slope, .. } = seen.look.sample;
                area.keep([seen.s, t], value + tolerance, [seen.rise, slope]);
            }
        }
    }

    /// From a look that falls inside of the tool down the ray to where that begins, which is the limit from
    /// then on; other looks stay as they are.
    ///
    /// Along the ray the distance is convex. From the inside a tangent leads beyond the entry, from where
    /// Newton's steps lead up to it without passing.
    fn enter(&mut self, seen: Seen) -> Seen {
        let t = seen.look.sample.t;
        if seen.look.sample.value > 0.0 || seen.s > self.limit {
            return seen;
        }
        let (low, touching) = (self.ray.low, self.far * TOUCHING);
        let beyond = if seen.rise < 0.0 { seen.s - seen.look.sample.value / seen.rise } else { low };
        let (mut now, mut inside) = (self.look(beyond.max(low), t), seen);
        for _ in 0..MAX_STEPS {
            let value = now.look.sample.value;
            if value <= touching {
                break;
            }
            let newton = now.s - value / now.rise;
            if newton > now.s && newton < inside.s {
                now = self.look(newton, t);
                continue;
            }
            // Only rounding leads here: halve what lies between inside and outside.
            let between = self.look(0.5 * (now.s + inside.s), t);
            if between.s <= now.s || between.s >= inside.s {
                now = inside;
                break;
            }
            *(if between.look.sample.value > touching { &mut now } else { &mut inside }) = between;
        }
        (self.limit, self.at) = (now.s, t);
        now
    }
}

impl Seen {
    /// As it bounds what would be seen from another place of the ray, at times after (`side` = 1) or before
    /// (−1).
    fn from(&self, s: f64, turn: f64, side: f64) -> Self {
        let (by, mut seen) = (s - self.s, *self);
        let sample = &mut seen.look.sample;
        sample.value += self.rise * by;
        sample.slope -= side * turn * by.abs();
        seen.s = s;
        seen
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cutter::Cutter;
    use motion::ClPoint;
    use std::cell::Cell;

    /// Counts the looks at a solid on its way.
    struct Counted<'a, M>(M, &'a Cell<usize>);

    impl<M: Moving> Moving for Counted<'_, M> {
        fn look(&self, q: &Point3, t: f64) -> Look {
            self.1.set(self.1.get() + 1);
            self.0.look(q, t)
        }

        fn bends(&self, q: &Point3, range: [f64; 2]) -> [f64; 2] {
            self.0.bends(q, range)
        }

        fn turn(&self) -> f64 {
            self.0.turn()
        }

        fn pace(&self) -> f64 {
            self.0.pace()
        }
    }

    /// A pass that runs `aside` mm beside a level ray, up to its height or higher: a ball of 6 mm with its
    /// shank. What the ray meets, and how many looks that takes.
    fn beside(aside: f64, rise: f64, high: f64) -> (Option<f64>, usize) {
        let solid = Solid::of_cutter(&Cutter::ball(6.0).unwrap(), None);
        let at = |x: f64, z: f64| ClPoint::upright(Point3::new(x, aside, z));
        let motion = Motion::new(&at(-4.0, 0.0), &at(-7.0, rise)).unwrap();
        let ray = Ray { point: Point3::new(0.0, 0.0, 4.0), normal: -Vector3::x(), low: -0.1, high };
        let looks = Cell::new(0);
        let search = Search::new(&ray, Counted(motion.piece(&solid, 0), &looks), [0.0, 1.0], high);
        let found = search.run().map(|(s, _)| s);
        (found, looks.get())
    }

    /// A pass a radius aside touches the ray wherever it stands, and no look tells one place of the other.
    #[test]
    fn a_ray_that_grazes_a_pass_is_answered_in_few_looks() {
        const MANY: usize = 1_000;
        for rise in [0.0, 0.5] {
            for high in [3.0, 24.0] {
                for aside in [3.0, 3.0 - 1e-9, 3.0 + 1e-9, 3.0 - 1e-6, 2.999, 3.001, 1.0] {
                    let (found, looks) = beside(aside, rise, high);
                    let far = 4.0 - (9.0f64 - aside * aside).max(0.0).sqrt();
                    let name = format!("{aside} {rise} {high}: {found:?} {far} {looks}");
                    assert!(looks < MANY, "{name}");
                    if (aside - 3.0).abs() > 1e-10 {
                        assert_eq!(found.is_some(), aside < 3.0 && far < high, "{name}");
                    }
                    // Right to 1e-9 mm over the sine.
                    let sine = (9.0 - aside * aside).max(1e-18).sqrt() / 3.0;
                    assert!(found.is_none_or(|s| (s - far).abs() < 1e-9 / sine), "{name}");
                }
            }
        }
    }
}
