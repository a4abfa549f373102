//! What the cutter has cleared in the plan view, and how much of its circumference stands in stock.
//!
//! Enters: places of the cutter's centre, one after the other. Leaves: at any further place and heading the
//! angle of the front half of the circumference that meets stock. The ground cleared is the union of the
//! discs about those places, in closed form; mm, rad.
//!
//! The heading is that of the straight side that the cutter runs. In a small loop it differs from the
//! circle's by half the angle between two sides. So thinning keeps the headings.

use std::cell::{Cell, RefCell};
use std::f64::consts::PI;
use std::ops::Range;

use super::front::{Arc, Front, PART, RIM, Rim};
use geometry::{Point2, Vector2};

/// Stock thinner than this share of the radius counts as none: where the cutter passes along ground that
/// it has cut before, chords and rounding leave films that load nothing. More would hide real stock: beside
/// a straight pass an angle `a` is seen smaller by up to `FILM / sin a`.
pub(super) const FILM: f64 = 0.003;

/// Between two places the angle may exceed the limit by so much, rad, which limits of plans have to spare;
/// and so many parts of a move are looked at where that is not sure.
pub(super) const BETWEEN: f64 = 0.012;
const BETWEEN_PLACES: usize = 8;

/// No more buckets than this along a side.
const MAX_SIDE: f64 = 1024.0;

/// Queries so near to each other, over the radius, share one list of discs.
const NEIGHBOURS: f64 = 0.2;

/// Parts of the circumference for which such a list is made.
const SECTORS: usize = 32;

/// Places around which passes are planned for a lower limit of the engagement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gentle {
    /// Around here.
    pub at: Point2,
    /// So far from there, mm.
    pub within: f64,
    /// By so much, rad.
    pub by: f64,
}

/// A disc: its index in the order in which they were cleared, and its centre.
type Disc = (u32, Point2);

/// Ground cleared by a disc.
#[derive(Clone)]
pub(super) struct Cleared {
    radius: f64,
    origin: Point2,
    bucket: f64,
    side: [usize; 2],
    /// The discs by place, each bucket in their order, but those that others cover.
    buckets: Vec<Vec<Disc>>,
    /// All of them, in the order in which they were cleared.
    discs: Vec<Point2>,
    /// The disc that cleared most of the last front, and how many of its parts.
    best: Cell<Option<(usize, u32)>>,
    near: RefCell<Near>,
    /// So many of the first discs were looked at when the ground was thinned.
    thinned: usize,
    /// A part of the rim of each of them that no other covered then.
    bare: Vec<u32>,
    /// Buckets to which discs were added since the ground was thinned.
    fresh: Vec<bool>,
    /// Where angles count as greater.
    pub gentle: Vec<Gentle>,
}

/// The discs that decide about every place near to one.
#[derive(Clone, Default)]
struct Near {
    anchor: Point2,
    /// How far from the anchor the list holds, mm; 0 when it does not hold.
    reach: f64,
    /// How many discs there were. Later ones are asked, too.
    count: usize,
    discs: Vec<Disc>,
    /// Those that clear some of the circumference whole.
    keepers: Vec<Disc>,
}

impl Cleared {
    /// Nothing cleared; places will lie between `bounds` (beyond them only the speed suffers).
    pub fn new([lo, hi]: [Point2; 2], radius: f64) -> Self {
        let size = hi - lo;
        let bucket = radius.max(size.x.max(size.y) / MAX_SIDE);
        let side = [size.x, size.y].map(|s| (s / bucket).floor() as usize + 1);
        let buckets = vec![Vec::new(); side[0] * side[1]];
        let fresh = vec![false; buckets.len()];
        let (best, near) = (Cell::new(None), RefCell::new(Near::default()));
        Self {
            radius,
            origin: lo,
            bucket,
            side,
            buckets,
            discs: Vec::new(),
            best,
            near,
            thinned: 0,
            bare: Vec::new(),
            fresh,
            gentle: Vec::new(),
        }
    }

    /// How many places there are.
    pub fn len(&self) -> usize {
        self.discs.len()
    }

    fn column(&self, axis: usize, at: f64) -> usize {
        ((at / self.bucket) as usize).min(self.side[axis] - 1)
    }

    fn bucket_of(&self, p: &Point2) -> usize {
        let at = p - self.origin;
        self.column(1, at.y) * self.side[0] + self.column(0, at.x)
    }

    /// Clears the disc about a place.
    pub fn add(&mut self, p: Point2) {
        let bucket = self.bucket_of(&p);
        self.buckets[bucket].push((self.discs.len() as u32, p));
        self.fresh[bucket] = true;
        self.discs.push(p);
    }

    /// Takes back all but the first `count` places, which it leaves.
    pub fn split_off(&mut self, count: usize) -> Vec<Point2> {
        let later = self.discs[count.min(self.discs.len())..].to_vec();
        self.truncate(count);
        later
    }

    /// Takes back all but the first `count` places.
    pub fn truncate(&mut self, count: usize) {
        let near = self.near.get_mut();
        if near.count > count {
            near.reach = 0.0;
        }
        self.thinned = self.thinned.min(count);
        self.bare.truncate(count);
        near.keepers.retain(|(k, _)| (*k as usize) < count);
        for k in (count..self.discs.len()).rev() {
            let bucket = self.bucket_of(&self.discs[k]);
            self.buckets[bucket].pop_if(|(last, _)| *last as usize == k);
        }
        self.discs.truncate(count);
    }

    /// Leaves out discs among the first `count` that others of them cover whole: every angle stays the same.
    /// They still count as places, and none of the first `count` may be taken back from here on.
    ///
    /// A disc is covered where those that hold its middle cover its circumference: each is convex, so with a
    /// place of the circumference it covers the straight line from the middle to there. With all radii a film
    /// greater it still is: that its circumference is covered means that it lies beyond its Voronoi cell.
    pub fn thin(&mut self, count: usize) {
        let count = count.min(self.discs.len());
        let changed = self.changed();
        let in_changed = self.buckets.iter().zip(&changed).filter(|(_, changed)| **changed);
        let mut asked: Vec<Disc> = in_changed.flat_map(|(bucket, _)| bucket).copied().collect();
        asked.retain(|(k, _)| (*k as usize) < count);
        asked.sort_unstable_by_key(|(k, _)| *k);
        self.bare.resize(count, 0);
        for (k, centre) in asked {
            let k = k as usize;
            // What was not covered before is only where something was added.
            if k < self.thinned {
                let bare = self.bare[k];
                if !self.any_beside(k, &centre, self.thinned..count, |to| Rim::part_is_within(bare, to)) {
                    continue;
                }
            }
            let mut rim = Rim::default();
            let covered = self.any_beside(k, &centre, 0..count, |to| {
                rim.cover(to);
                rim.is_covered()
            });
            if covered {
                let bucket = self.bucket_of(&centre);
                self.buckets[bucket].retain(|(other, _)| *other as usize != k);
            } else {
                self.bare[k] = rim.first_bare();
            }
        }
        self.thinned = count;
        self.near.get_mut().reach = 0.0;
        // Those that could not be left out yet are looked at again.
        self.fresh.fill(false);
        for k in count..self.discs.len() {
            let bucket = self.bucket_of(&self.discs[k]);
            self.fresh[bucket] = true;
        }
    }

    /// Whether anything is `found` among the `others` that hold the middle of a disc, which are told where
    /// they lie from there, over the radius.
    fn any_beside(
        &self,
        disc: usize,
        centre: &Point2,
        others: Range<usize>,
        mut found: impl FnMut(&Vector2) -> bool,
    ) -> bool {
        let reach = Vector2::new(self.radius, self.radius);
        !self.each_within(&[centre - reach, centre + reach], others.start, |(other, at)| {
            let to = (at - centre) / self.radius;
            let other = *other as usize;
            !(other < others.end && other != disc && to.norm_squared() <= 1.0 && found(&to))
        })
    }

    /// Buckets whose discs may be covered since the ground was thinned: discs were added within a radius.
    fn changed(&self) -> Vec<bool> {
        let [width, height] = self.side;
        let mut changed = vec![false; self.buckets.len()];
        for at in (0..self.fresh.len()).filter(|at| self.fresh[*at]) {
            let (i, j) = (at % width, at / width);
            for j in j.saturating_sub(1)..=(j + 1).min(height - 1) {
                changed[j * width + i.saturating_sub(1)..=j * width + (i + 1).min(width - 1)].fill(true);
            }
        }
        changed
    }

    /// The discs from `first` on whose centres may be within a box, by bucket, the last first, as long as
    /// `tell` wants more; whether it still did in the end.
    fn each_within(&self, [lo, hi]: &[Point2; 2], first: usize, mut tell: impl FnMut(&Disc) -> bool) -> bool {
        let (lo, hi) = (lo - self.origin, hi - self.origin);
        let mut rows = self.column(1, lo.y)..=self.column(1, hi.y);
        rows.all(|j| {
            let row = j * self.side[0];
            let buckets = &self.buckets[row + self.column(0, lo.x)..=row + self.column(0, hi.x)];
            buckets.iter().all(|bucket| {
                let bucket = bucket.iter().rev();
                bucket.take_while(|(k, _)| *k as usize >= first).all(&mut tell)
            })
        })
    }

    /// Angle of the front half of the circumference in stock at `centre` with the unit vector `heading`,
    /// rad. Films are left out but beside the places from `fresh` on: the chip of the move itself begins as
    /// thin as one.
    pub fn arc(&self, centre: &Point2, heading: &Vector2, fresh: usize) -> f64 {
        self.counted(centre, self.front(centre, heading, 0.0, fresh, 0.0).angle())
    }

    /// An angle at a place with what it counts more there.
    fn counted(&self, place: &Point2, angle: f64) -> f64 {
        if angle > 0.0 { angle + self.more_at(place) } else { angle }
    }

    fn more_at(&self, place: &Point2) -> f64 {
        let near = self.gentle.iter().filter(|gentle| (gentle.at - place).norm() < gentle.within);
        near.map(|gentle| gentle.by).sum()
    }

    /// As [`Cleared::arc`], with what is clear to the right of the stock counted as well: the angle that
    /// there is once the cutter has turned along the stock on its right.
    pub fn arc_from_right(&self, centre: &Point2, heading: &Vector2, fresh: usize) -> f64 {
        let angle =
            self.front(centre, heading, 0.0, fresh, 0.0).ends().map_or(0.0, |[_, to]| PART * to as f64);
        self.counted(centre, angle)
    }

    /// Whether a straight move keeps to a limit all along but for [`BETWEEN`]: tips of stock may be passed
    /// between its ends. A disc is convex: what it clears from both ends, it clears from everywhere between.
    /// Where that is not enough, places close to each other are asked.
    pub fn keeps(&self, from: &Point2, to: &Point2, limit: f64, fresh: usize) -> bool {
        let (along, length) = (to - from, (to - from).norm());
        if length == 0.0 {
            return true;
        }
        let (heading, most) = (along / length, limit + BETWEEN);
        let at = |k: usize| from + along * (k as f64 / BETWEEN_PLACES as f64);
        let middle = at(BETWEEN_PLACES / 2);
        let enough = most - self.more_at(&middle);
        self.front(&middle, &heading, 0.5 * length, fresh, enough).angle() <= enough.max(0.0)
            || (0..BETWEEN_PLACES).all(|k| self.arc(&at(k), &heading, fresh) <= most)
    }

    /// The front of a straight move of the length `2 half` about `centre`. Where no more than `enough`
    /// stands, rad, no more is looked for that clears it.
    fn front(&self, centre: &Point2, heading: &Vector2, half: f64, fresh: usize, enough: f64) -> Arc {
        let enough = (enough.max(0.0) / PART) as u32;
        let mut front = Front::new(self.radius, heading, half);
        let grown = |k: usize| self.radius * if k < fresh { 1.0 + FILM } else { 1.0 };
        // What cleared most of the last front clears most of one beside it, and leaves less to look at.
        let mut best = self.best.get();
        let known = best.map(|(k, _)| k).filter(|k| *k < self.discs.len());
        if let Some(k) = known {
            front.clear(self.discs[k] - centre, grown(k));
        }
        best = known.map(|k| (k, 0));
        let mut near = self.near.borrow_mut();
        if near.reach == 0.0 || (centre - near.anchor).norm() + half > near.reach {
            self.list(&mut near, centre);
        }
        let mut look = |k: usize, disc: &Point2| {
            let to = disc - centre;
            if (to - front.middle).norm_squared() >= front.reach {
                return true;
            }
            let cleared = front.clear(to, grown(k));
            if cleared > 0 && best.is_none_or(|(_, most)| cleared > most) {
                best = Some((k, cleared));
            }
            front.left > enough
        };
        // The last ground leaves so little standing that most of the older is passed over.
        let _ = (near.count..self.discs.len()).rev().all(|k| look(k, &self.discs[k]))
            && near.discs.iter().all(|(k, centre)| look(*k as usize, centre));
        self.best.set(best);
        front.standing
    }

    /// Lists the discs that decide about all places near to one, the last first: those that may clear a
    /// sector of the circumference which no disc clears whole wherever the place is, and for each other
    /// sector one that does.
    fn list(&self, near: &mut Near, anchor: &Point2) {
        let reach = NEIGHBOURS * self.radius;
        let off = reach + self.radius * PI / SECTORS as f64;
        let (whole, touched) = ((self.radius - off).powi(2), self.radius * (1.0 + FILM) + off);
        let mut open: Vec<Vector2> =
            RIM.iter().step_by(64 / SECTORS).take(SECTORS).map(|at| at * self.radius).collect();
        let closes = |open: &mut Vec<Vector2>, to: &Vector2| {
            let before = open.len();
            open.retain(|sector| (sector - to).norm_squared() >= whole);
            open.len() < before
        };
        near.keepers.retain(|(_, centre)| closes(&mut open, &(centre - anchor)));
        near.discs.clear();
        near.discs.extend(&near.keepers);
        if let Some(first) = open.first() {
            // Others matter only where the known ones leave something open.
            let (lo, hi) =
                open.iter().fold((*first, *first), |(lo, hi), sector| (lo.inf(sector), hi.sup(sector)));
            let beyond = Vector2::new(touched, touched);
            self.each_within(&[anchor + lo - beyond, anchor + hi + beyond], 0, |disc| {
                let to = disc.1 - anchor;
                let outside = to - to.sup(&lo).inf(&hi);
                if outside.norm_squared() < touched * touched {
                    let away = |sector: &Vector2| (sector - to).norm_squared();
                    let nearest = open.iter().map(away).fold(f64::INFINITY, f64::min);
                    if nearest < touched * touched {
                        near.discs.push(*disc);
                    }
                    if nearest < whole {
                        closes(&mut open, &to);
                        near.keepers.push(*disc);
                    }
                }
                true
            });
        }
        (near.anchor, near.reach, near.count) = (*anchor, reach, self.discs.len());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn cleared(places: impl IntoIterator<Item = Point2>) -> Cleared {
        let mut cleared = Cleared::new([Point2::new(-20.0, -20.0), Point2::new(20.0, 20.0)], 3.0);
        places.into_iter().for_each(|p| cleared.add(p));
        cleared
    }

    fn line(from: Point2, to: Point2) -> Vec<Point2> {
        (0..=400).map(|k| from + (to - from) * (f64::from(k) / 400.0)).collect()
    }

    /// A slot, a stepover beside a straight pass, a loop around a loop, and the foot of a corner.
    #[test]
    fn angles_are_those_of_closed_forms() {
        let x = Vector2::new(1.0, 0.0);
        // A film is as much stock as the angle turns by it: `by` times that beside a straight pass.
        let near = |found: f64, exact: f64, by: f64| {
            let film = by * FILM / exact.sin().max(0.3);
            assert!(found <= exact + PART && found > exact - film - PART, "{found} {exact}");
        };
        let slot = cleared(line(Point2::new(-15.0, 0.0), Point2::new(0.0, 0.0)));
        assert!(slot.arc(&Point2::new(0.05, 0.0), &x, 0) > PI - 0.04);
        for width in [0.5f64, 1.5, 3.0, 4.5] {
            let beside = cleared(line(Point2::new(-15.0, width), Point2::new(15.0, width)));
            near(beside.arc(&Point2::new(0.0, 0.0), &x, usize::MAX), (1.0 - width / 3.0).acos(), 1.0);
        }
        // The cleared disc of radius 3 + 2, and a place at 2.3 from its middle, going around it.
        let ring = (0..600).map(|k| TAU * f64::from(k) / 600.0);
        let ring = cleared(ring.map(|a| Point2::new(a.cos(), a.sin()) * 2.0));
        let (rho, width) = (2.3f64, 0.3f64);
        let exact = (1.0 - (width * (rho + 3.0) - 0.5 * width * width) / (rho * 3.0)).acos();
        near(ring.arc(&Point2::new(0.0, -2.3), &x, usize::MAX), exact, (rho + 3.0 - width) / rho);
        // A place that is cleared already, and one that is not.
        assert_eq!(ring.arc(&Point2::new(0.5, 0.5), &x, usize::MAX), 0.0);
        assert_eq!(ring.arc(&Point2::new(12.0, 0.5), &x, usize::MAX), PI);
    }

    /// Passes beside each other: the ground stays as it was, without most of its places.
    #[test]
    fn what_others_cover_is_left_out() {
        let pass = |k: u32| {
            let y = -6.0 + 0.3 * f64::from(k);
            line(Point2::new(-12.0, y), Point2::new(12.0, y))
        };
        let mut ground = cleared((0..40).flat_map(pass));
        let places = (0..4000).map(|k| {
            let (a, b) = (0.618_034 * f64::from(k), 0.754_878 * f64::from(k));
            Point2::new(40.0 * a.fract() - 20.0, 30.0 * b.fract() - 15.0)
        });
        let heading = |k: usize| Vector2::new((k as f64).cos(), (k as f64).sin());
        let places: Vec<Point2> = places.collect();
        let fresh = ground.len() - 500;
        let arcs = |ground: &Cleared, fresh: usize| -> Vec<f64> {
            places.iter().enumerate().map(|(k, p)| ground.arc(p, &heading(k), fresh)).collect()
        };
        let before = arcs(&ground, fresh);
        ground.thin(fresh);
        let left: usize = ground.buckets.iter().map(Vec::len).sum();
        assert!(left < 4_000 && ground.len() == 40 * 401, "{left}");
        assert_eq!(arcs(&ground, fresh), before);
        assert!(before.iter().any(|arc| *arc > 0.0 && *arc < PI));
    }

    /// A straight pass keeps to its angle all along. A post of stock is passed between two places that do not
    /// see it.
    #[test]
    fn what_stands_between_two_places_is_seen() {
        let (x, exact) = (Vector2::new(1.0, 0.0), 0.5f64.acos());
        let beside = cleared(line(Point2::new(-15.0, 1.5), Point2::new(15.0, 1.5)));
        let (a, b) = (Point2::new(-0.12, 0.0), Point2::new(0.12, 0.0));
        assert!(beside.keeps(&a, &b, exact, usize::MAX) && !beside.keeps(&a, &b, exact - 0.1, usize::MAX));
        // On the circle of a cutter at the origin, ten degrees ahead of its right.
        let (sin, cos) = 80f64.to_radians().sin_cos();
        let post = Point2::new(3.0 * cos, -3.0 * sin);
        let around = (0..2000).map(|k| TAU * f64::from(k) / 2000.0);
        let ground = cleared(around.map(|a| post + Vector2::new(a.cos(), a.sin()) * 3.07));
        let (a, b) = (Point2::new(-0.5, 0.0), Point2::new(0.8, 0.0));
        assert_eq!([a, b].map(|p| ground.arc(&p, &x, usize::MAX)), [0.0; 2]);
        assert!(!ground.keeps(&a, &b, 0.0, usize::MAX) && ground.keeps(&a, &b, 0.05, usize::MAX));
    }

    #[test]
    fn places_are_taken_back() {
        let mut ground = cleared(line(Point2::new(-15.0, 1.0), Point2::new(15.0, 1.0)));
        let (at, x) = (Point2::new(0.0, 0.0), Vector2::new(1.0, 0.0));
        let (count, before) = (ground.len(), ground.arc(&at, &x, usize::MAX));
        ground.add(Point2::new(1.0, -0.5));
        assert!(ground.arc(&at, &x, usize::MAX) < before);
        ground.truncate(count);
        assert_eq!(ground.arc(&at, &x, usize::MAX), before);
    }

    /// Angles are the same whether queries share a list of discs or each has its own.
    #[test]
    fn lists_of_discs_change_no_angle() {
        let mut ground = cleared((0..30).flat_map(|k| {
            let y = -6.0 + 0.3 * f64::from(k);
            line(Point2::new(-12.0, y), Point2::new(12.0 - 0.2 * f64::from(k), y))
        }));
        let mut at = Point2::new(9.0, 4.0);
        let mut angles = 0;
        for k in 0..600 {
            let turn = 0.1 * f64::from(k);
            at += Vector2::new(turn.cos(), (0.37 * turn).sin()) * 0.2;
            if k % 7 == 0 {
                ground.add(at);
            }
            if k % 50 == 0 {
                let count = ground.len();
                ground.thin(count);
            }
            let heading = Vector2::new((3.0 * turn).cos(), (3.0 * turn).sin());
            let fresh = ground.len().saturating_sub(20);
            for (to, half) in [(at, 0.0), (at + heading * 0.2, 0.1)] {
                let found = ground.front(&to, &heading, half, fresh, 0.0).angle();
                let mut all = Front::new(ground.radius, &heading, half);
                for (k, disc) in ground.discs.iter().enumerate() {
                    all.clear(disc - to, ground.radius * if k < fresh { 1.0 + FILM } else { 1.0 });
                }
                assert_eq!(found, all.standing.angle(), "{k}");
                angles += usize::from(found > 0.0 && found < PI);
            }
        }
        assert!(angles > 300, "{angles}");
    }
}
