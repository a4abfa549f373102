//! The order of passes that keeps moves between them short.
//!
//! Enters: passes as runs of tip positions, mm, what it costs to go a distance between two of them, and to
//! begin and end at a place. Leaves: which pass comes when, from which end, and where closed passes begin.
//! Nothing has to come before anything else: the passes are those of one finishing path.
//!
//! A path by nearest ends is improved by turning runs of it round (2-opt) and by moving short runs elsewhere
//! (Or-opt), both between near ends only (G. A. Croes 1958; I. Or 1976; the neighbour lists of J. L. Bentley,
//! "Fast algorithms for geometric traveling salesman problems", 1992). The steps and their order depend on
//! nothing but the passes, so the result is the same every time.

use geometry::{Point2, Point3};

/// A visit of a pass.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Visit {
    /// Index of the pass.
    pub pass: usize,
    /// From its last point to its first.
    pub reversed: bool,
    /// The point at which a closed pass begins (and ends); 0 for others.
    pub start: usize,
}

/// Ends looked at around each end while a path is improved. With fewer, detours remain; ten cost
/// twice the time of five and shorten by less than one in a hundred.
const NEIGHBOURS: usize = 8;

/// Longest run of passes that is moved elsewhere in one piece.
const LONGEST_RUN: usize = 3;

/// Points of a closed pass at which it may begin while the order is sought; the nearest of all its
/// points is taken afterwards.
const STARTS: usize = 32;

/// Sweeps over all passes. Random places are settled after some six; the bound keeps a freak from
/// taking for ever.
const MOST_SWEEPS: usize = 40;

/// A step must save this share of the whole, so that rounding cannot run in circles.
const LEAST_GAIN: f64 = 1e-9;

/// What ways cost.
#[derive(Clone, Copy)]
pub struct Costs<'a> {
    /// To go from one place to another, the same both ways; it must grow with their distance.
    pub between: &'a (dyn Fn(&Point3, &Point3) -> f64 + Sync),
    /// To come to a place at the beginning.
    pub start: &'a (dyn Fn(&Point3) -> f64 + Sync),
    /// To leave a place at the end.
    pub finish: &'a (dyn Fn(&Point3) -> f64 + Sync),
}

/// Orders passes of one point or more each. Without `both_ways` every pass keeps its direction. The first
/// pass given stays where a path by nearest ends begins, though improvement may put others before it.
pub fn order(passes: &[Vec<Point3>], both_ways: bool, costs: Costs<'_>) -> Vec<Visit> {
    if passes.is_empty() {
        return Vec::new();
    }
    let closed: Vec<bool> = passes.iter().map(|p| is_closed(p)).collect();
    let visits = nearest_ends(passes, &closed, both_ways);
    let mut tour = Tour::new(passes, closed, visits, costs);
    let near = tour.near_ends();
    let least = LEAST_GAIN * tour.total().max(f64::MIN_POSITIVE);
    for _ in 0..MOST_SWEEPS {
        let mut gained = false;
        for pass in 0..passes.len() {
            gained |= both_ways && tour.turn_round(pass, &near, least);
            gained |= tour.move_elsewhere(pass, &near, both_ways, least);
        }
        gained |= tour.choose_starts(least);
        if !gained {
            break;
        }
    }
    tour.visits
}

/// A pass that ends where it begins.
pub fn is_closed(pass: &[Point3]) -> bool {
    pass.len() > 3 && pass.first() == pass.last()
}

/// From end to nearest end.
pub(crate) fn nearest_ends(passes: &[Vec<Point3>], closed: &[bool], both_ways: bool) -> Vec<Visit> {
    let mut doors = Vec::new();
    for (pass, points) in passes.iter().enumerate() {
        let last = points.len() - 1;
        if closed[pass] {
            let step = last.div_ceil(STARTS);
            doors
                .extend((0..last).step_by(step).map(|start| (Visit { pass, reversed: false, start }, start)));
        } else {
            doors.push((Visit { pass, reversed: false, start: 0 }, 0));
            if both_ways {
                doors.push((Visit { pass, reversed: true, start: 0 }, last));
            }
        }
    }
    let places: Vec<Point3> = doors.iter().map(|(visit, point)| passes[visit.pass][*point]).collect();
    let mut of_pass = vec![Vec::new(); passes.len()];
    doors.iter().enumerate().for_each(|(door, (visit, _))| of_pass[visit.pass].push(door));
    let mut open = Buckets::of(&places);
    let mut visits = Vec::with_capacity(passes.len());
    let mut next = doors[0].0;
    loop {
        of_pass[next.pass].iter().for_each(|&door| open.remove(door));
        visits.push(next);
        let points = &passes[next.pass];
        let at = match (closed[next.pass], next.reversed) {
            (true, _) => points[next.start],
            (false, true) => points[0],
            (false, false) => points[points.len() - 1],
        };
        match open.nearest(&at, 1).first() {
            Some(&door) => next = doors[door].0,
            None => return visits,
        }
    }
}

/// Places in squares of the plan view.
struct Buckets<'a> {
    places: &'a [Point3],
    squares: Vec<Vec<u32>>,
    corner: Point2,
    side: f64,
    count: [usize; 2],
    left: usize,
}

/// Places a square on average; more make each look longer, fewer make more looks.
const PLACES_A_SQUARE: f64 = 2.0;

impl<'a> Buckets<'a> {
    fn of(places: &'a [Point3]) -> Self {
        let mut low = Point2::new(f64::INFINITY, f64::INFINITY);
        let mut high = -low;
        for p in places {
            low = low.inf(&p.xy());
            high = high.sup(&p.xy());
        }
        let size = high - low;
        // As if all stood on a line where the other side is short.
        let area = size.x.max(1e-3 * size.y) * size.y.max(1e-3 * size.x);
        let side = (area * PLACES_A_SQUARE / places.len().max(1) as f64).sqrt().max(f64::MIN_POSITIVE);
        let most = 4.0 * places.len() as f64 + 1.0;
        let count = [size.x, size.y].map(|s| (s / side).floor().clamp(0.0, most) as usize + 1);
        let mut buckets = Self {
            places,
            squares: vec![Vec::new(); count[0] * count[1]],
            corner: low,
            side,
            count,
            left: places.len(),
        };
        for (k, p) in places.iter().enumerate() {
            let square = buckets.square(p);
            buckets.squares[square[1] * count[0] + square[0]].push(k as u32);
        }
        buckets
    }

    fn square(&self, p: &Point3) -> [usize; 2] {
        let along = |c: usize| ((p[c] - self.corner[c]) / self.side).max(0.0) as usize;
        [along(0).min(self.count[0] - 1), along(1).min(self.count[1] - 1)]
    }

    fn remove(&mut self, place: usize) {
        let square = self.square(&self.places[place]);
        let list = &mut self.squares[square[1] * self.count[0] + square[0]];
        if let Some(k) = list.iter().position(|&other| other as usize == place) {
            list.remove(k);
            self.left -= 1;
        }
    }

    /// The `n` places nearest to `p`, nearest first, the one with the lower number first where two are
    /// equally near.
    fn nearest(&self, p: &Point3, n: usize) -> Vec<usize> {
        let mut found: Vec<(f64, usize)> = Vec::with_capacity(n + 1);
        let home = self.square(p).map(|c| c as i64);
        let [nx, ny] = self.count.map(|c| c as i64);
        let (mut ring, mut seen) = (0, 0);
        while seen < self.left {
            // What lies beyond this ring is at least so far away.
            let safe = ((ring - 1).max(0)) as f64 * self.side;
            if found.len() == n && found[n - 1].0 < safe * safe {
                break;
            }
            for j in (home[1] - ring).max(0)..=(home[1] + ring).min(ny - 1) {
                let edge = (j - home[1]).abs() == ring;
                let step = if edge { 1 } else { (2 * ring).max(1) };
                for i in (home[0] - ring..=home[0] + ring).step_by(step as usize) {
                    if i < 0 || i >= nx {
                        continue;
                    }
                    for &k in &self.squares[(j * nx + i) as usize] {
                        seen += 1;
                        let candidate = ((self.places[k as usize] - p).norm_squared(), k as usize);
                        let at = found.partition_point(|f| (f.0, f.1) < candidate);
                        if at < n {
                            found.insert(at, candidate);
                            found.truncate(n);
                        }
                    }
                }
            }
            ring += 1;
        }
        found.into_iter().map(|(_, k)| k).collect()
    }
}

/// A path through all passes while it is improved.
struct Tour<'a> {
    passes: &'a [Vec<Point3>],
    closed: Vec<bool>,
    visits: Vec<Visit>,
    /// Where each pass stands in `visits`.
    place: Vec<usize>,
    costs: Costs<'a>,
}

impl<'a> Tour<'a> {
    fn new(passes: &'a [Vec<Point3>], closed: Vec<bool>, visits: Vec<Visit>, costs: Costs<'a>) -> Self {
        let mut place = vec![0; visits.len()];
        visits.iter().enumerate().for_each(|(k, v)| place[v.pass] = k);
        Self { passes, closed, visits, place, costs }
    }

    /// Where a visit begins, and where it ends.
    fn ends(&self, visit: &Visit) -> [Point3; 2] {
        let points = &self.passes[visit.pass];
        if self.closed[visit.pass] {
            return [points[visit.start]; 2];
        }
        let ends = [points[0], points[points.len() - 1]];
        if visit.reversed { [ends[1], ends[0]] } else { ends }
    }

    fn begin(&self, k: usize) -> Point3 {
        self.ends(&self.visits[k])[0]
    }

    fn end(&self, k: usize) -> Point3 {
        self.ends(&self.visits[k])[1]
    }

    fn way(&self, a: &Point3, b: &Point3) -> f64 {
        (self.costs.between)(a, b)
    }

    /// From the visit before `k` to a place, or from the start where there is none.
    fn way_to(&self, k: usize, place: &Point3) -> f64 {
        match k.checked_sub(1) {
            Some(before) => self.way(&self.end(before), place),
            None => (self.costs.start)(place),
        }
    }

    /// From a place to the visit `k`, or to the end where there is none.
    fn way_from(&self, place: &Point3, k: usize) -> f64 {
        if k < self.visits.len() { self.way(place, &self.begin(k)) } else { (self.costs.finish)(place) }
    }

    /// Cost between the visits before and at `k`, to the first and from the last.
    fn edge(&self, k: usize) -> f64 {
        match k.checked_sub(1) {
            Some(before) => self.way_from(&self.end(before), k),
            None => self.way_to(0, &self.begin(0)),
        }
    }

    fn total(&self) -> f64 {
        (0..=self.visits.len()).map(|k| self.edge(k)).sum()
    }

    /// For each pass the passes with an end near one of its own, in fixed order.
    fn near_ends(&self) -> Vec<Vec<usize>> {
        let ends = |pass: usize| self.ends(&self.visits[self.place[pass]]);
        let places: Vec<Point3> = (0..self.passes.len()).flat_map(ends).collect();
        let buckets = Buckets::of(&places);
        let near = |pass: usize| {
            let mut list = Vec::with_capacity(2 * NEIGHBOURS);
            for end in ends(pass) {
                // Its own two ends are found as well.
                let found = buckets.nearest(&end, NEIGHBOURS + 2).into_iter().map(|door| door / 2);
                for other in found.filter(|&other| other != pass) {
                    if !list.contains(&other) {
                        list.push(other);
                    }
                }
            }
            list
        };
        work::parallel::map(self.passes.len(), near)
    }

    fn reverse(&mut self, from: usize, to: usize) {
        self.visits[from..=to].reverse();
        for k in from..=to {
            self.visits[k].reversed ^= true;
            self.place[self.visits[k].pass] = k;
        }
    }

    /// Turns a run that begins or ends at `pass` round where that saves more than `least`.
    fn turn_round(&mut self, pass: usize, near: &[Vec<usize>], least: f64) -> bool {
        let n = self.visits.len();
        let k = self.place[pass];
        // The whole run before, or after, may be turned without a partner.
        let mut best = (least, None);
        let candidates = near[pass].iter().map(|&other| self.place[other]).chain([0, n - 1]);
        for j in candidates {
            let (low, high) = (k.min(j), k.max(j));
            // With the lower one outside of the run, with the upper one outside, with both inside.
            for (from, to) in [(low + 1, high), (low, high.wrapping_sub(1)), (low, high)] {
                if from > to || to >= n {
                    continue;
                }
                let before = self.edge(from) + self.edge(to + 1);
                let after = self.way_to(from, &self.end(to)) + self.way_from(&self.begin(from), to + 1);
                if before - after > best.0 {
                    best = (before - after, Some((from, to)));
                }
            }
        }
        if let Some((from, to)) = best.1 {
            self.reverse(from, to);
        }
        best.1.is_some()
    }

    /// Moves a short run that begins at `pass` to where it saves more than `least`.
    fn move_elsewhere(&mut self, pass: usize, near: &[Vec<usize>], both_ways: bool, least: f64) -> bool {
        let n = self.visits.len();
        let from = self.place[pass];
        let mut best = (least, None);
        for to in from..(from + LONGEST_RUN).min(n) {
            let left = if from > 0 {
                self.way_from(&self.end(from - 1), to + 1)
            } else if to + 1 < n {
                self.way_to(0, &self.begin(to + 1))
            } else {
                continue;
            };
            let freed = self.edge(from) + self.edge(to + 1) - left;
            let (begin, end) = (self.begin(from), self.end(to));
            let partners = near[pass].iter().chain(&near[self.visits[to].pass]).map(|&p| self.place[p]);
            // Before or after each partner: the run comes before visit `at`.
            for at in partners.flat_map(|j| [j, j + 1]).chain([0, n]) {
                if (from..=to + 1).contains(&at) {
                    continue;
                }
                for turned in [false, true] {
                    if turned && !both_ways {
                        continue;
                    }
                    let (first, last) = if turned { (end, begin) } else { (begin, end) };
                    let paid = self.way_to(at, &first) + self.way_from(&last, at) - self.edge(at);
                    if freed - paid > best.0 {
                        best = (freed - paid, Some((to, at, turned)));
                    }
                }
            }
        }
        let Some((to, at, turned)) = best.1 else { return false };
        if turned {
            self.reverse(from, to);
        }
        let changed = if at > to {
            self.visits[from..at].rotate_left(to + 1 - from);
            from..at
        } else {
            self.visits[at..=to].rotate_right(to + 1 - from);
            at..to + 1
        };
        changed.for_each(|k| self.place[self.visits[k].pass] = k);
        true
    }

    /// Lets each closed pass begin where the ways to and from it are shortest.
    fn choose_starts(&mut self, least: f64) -> bool {
        let mut gained = false;
        for k in 0..self.visits.len() {
            if !self.closed[self.visits[k].pass] {
                continue;
            }
            let way = |p: &Point3| self.way_to(k, p) + self.way_from(p, k + 1);
            let points = &self.passes[self.visits[k].pass];
            let all = points[..points.len() - 1].iter().enumerate().map(|(k, p)| (way(p), k));
            let best = all.fold((f64::INFINITY, 0), |a, b| if b.0 < a.0 { b } else { a });
            if way(&points[self.visits[k].start]) - best.0 > least {
                self.visits[k].start = best.1;
                gained = true;
            }
        }
        gained
    }
}
