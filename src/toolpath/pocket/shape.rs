//! The pocket itself: its region, over which sides the cutter may leave, what a larger cutter took before;
//! mm.

use super::{Cutter, Region};
use geometry::{
    CurveSegment, Piece, Point2, RegionIndex, SegmentGrid, Vector2, WallStretch, distance_of_segments, foot,
};
use work::monitor::{Cancelled, Monitor};

/// How far beyond an open side there is room, over the cutter's radius: it leaves the stock whole, and turns
/// there.
const BEYOND: f64 = 2.6;

/// What is no farther from a wall than this, mm, is on it: far above rounding, far below any tolerance.
const ON_WALL: f64 = 1.0e-5;

/// What lies beyond open sides laps over the region, and one strip over the next, by so much over the
/// cutter's radius or over the length of the side where that is short. Borders that only touch come apart by
/// the rounding of booleans, and no cutter passes a crack.
const LAP: f64 = 0.01;
const LAP_OF_SIDE: f64 = 0.02;

/// Laps end this share of a side before a wall begins, so that they stay inside of acute corners as well.
const TAPER: f64 = 0.25;

/// Sides of the rounds between strips beyond open sides, rad.
const ROUND: f64 = 0.2;

/// Places along a wall that are asked whether the cutter fits there are no farther apart than this share of
/// its radius, and where that changes it is found by so many halvings.
const WALL_STEP: f64 = 0.01;
const HALVINGS: usize = 30;

/// A pocket to mill.
#[derive(Debug, Clone, PartialEq)]
pub struct Pocket {
    /// Its region in the plan view.
    pub region: Region,
    /// How far the floor lies below z = 0, mm.
    pub depth: f64,
    /// How far the chords of its outlines may lie off the curves that they were drawn as, mm.
    pub off_drawing: f64,
    /// The sides of the region beyond which there is no stock, with the region on their left.
    open: Vec<[Point2; 2]>,
    /// The region and the room beyond its open sides: what the cutter may sweep.
    free: Region,
    /// Where no stock stands above the floor before the first cut.
    air: Region,
    /// The room beyond open sides as far as nothing stands, where that is farther than plans go.
    farther: Region,
}

/// A line of open sides that does not run along the outline.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("its point at x {:.4} y {:.4} does not lie on the outline", at.x, at.y)]
pub struct NotOnOutline {
    /// Which line, counted from 0.
    pub line: usize,
    /// The point, of the line.
    pub at: Point2,
}

impl Pocket {
    /// A pocket with walls all around, in stock that nobody has cut.
    pub fn new(region: Region, depth: f64) -> Self {
        Self {
            free: region.clone(),
            region,
            depth,
            off_drawing: 0.0,
            open: Vec::new(),
            air: Region::default(),
            farther: Region::default(),
        }
    }

    /// With those sides open that lie along `lines`, within `tolerance` mm, for a cutter of a radius. Sides
    /// are divided where a line ends.
    ///
    /// # Errors
    /// [`NotOnOutline`]
    pub fn opened(
        mut self,
        lines: &[Vec<Point2>],
        tolerance: f64,
        radius: f64,
    ) -> Result<Self, NotOnOutline> {
        for (line, points) in lines.iter().enumerate() {
            for at in points {
                divide(&mut self.region, at, tolerance).ok_or(NotOnOutline { line, at: *at })?;
            }
        }
        for (line, points) in lines.iter().enumerate() {
            let off = points.windows(2).find_map(|w| off_outline(&self.region, [w[0], w[1]], tolerance));
            off.map_or(Ok(()), |at| Err(NotOnOutline { line, at }))?;
        }
        let sides = |line: &Vec<Point2>| line.windows(2).map(|w| [w[0], w[1]]).collect::<Vec<_>>();
        let drawn: Vec<[Point2; 2]> = lines.iter().flat_map(sides).collect();
        let along = |p: &Point2| drawn.iter().any(|side| foot(p, side).1 <= tolerance);
        let is_open = |[a, b]: &[Point2; 2]| along(a) && along(b) && along(&nalgebra::center(a, b));
        let sides = self.region.curves().flat_map(|curve| {
            (0..curve.len()).map(|k| [curve[k], curve[(k + 1) % curve.len()]]).collect::<Vec<_>>()
        });
        let open = sides.filter(is_open).collect::<Vec<_>>();
        self.open.extend(open);
        let beyond = self.beyond(BEYOND * radius, radius);
        self.free = self.region.union(&beyond);
        self.air = self.air.union(&beyond.without(&self.region));
        Ok(self)
    }

    /// With no stock beyond its open sides as far as `width` mm either, if that is farther than a cutter of a
    /// radius goes by itself.
    #[must_use]
    pub fn without_stock_beyond(mut self, width: f64, radius: f64) -> Self {
        if !self.open.is_empty() && width > BEYOND * radius {
            self.farther = self.beyond(width, radius);
        }
        self
    }

    /// The room beyond open sides as far as `width` mm; it laps over the region.
    fn beyond(&self, width: f64, radius: f64) -> Region {
        let is_open = |side: &[Point2; 2]| self.open.contains(side);
        let (mut open, mut walls, mut closed) = (Vec::new(), Vec::new(), Vec::new());
        for curve in self.region.curves() {
            let sides: Vec<[Point2; 2]> =
                (0..curve.len()).map(|k| [curve[k], curve[(k + 1) % curve.len()]]).collect();
            strips(&sides, is_open, &Strip { width, longer: 0.0, lap: LAP * radius }, &mut open);
            walls.extend(sides.into_iter().filter(|side| !is_open(side)));
        }
        // Behind a wall that stands beyond an open side, no farther: around the end of a thin one there is
        // room. What lies behind others is parted from there by stock, or by the pocket itself.
        for wall in walls.iter().filter(|wall| open.iter().any(|strip| meets(strip, wall))) {
            // Where a wall ends at an open side nothing is taken from the lap.
            let behind = Strip { width, longer: -2.0 * LAP * radius, lap: 0.0 };
            strips(&[*wall], |_| true, &behind, &mut closed);
        }
        Region { pieces: open }.without(&Region { pieces: closed })
    }

    /// After a flat end mill of a radius went everywhere in it that it fits, `allowance` mm off the walls.
    pub fn cleared_by(mut self, radius: f64, allowance: f64) -> Self {
        // Straight sides where they belong, and chords of round ones inside.
        let straight = |distance: f64| distance - Region::offset_excess(distance);
        let reached = self.free.inset(straight(radius + allowance)).grown(straight(radius));
        self.air = self.air.union(&reached.intersection(&self.free));
        self
    }

    /// What the cutter may sweep: the region and the room beyond its open sides.
    pub fn free(&self) -> &Region {
        &self.free
    }

    /// What may be swept without a cut into walls, also by moves that come from farther away than planned
    /// ones.
    pub fn room(&self) -> Region {
        if self.farther.is_empty() { self.free.clone() } else { self.free.union(&self.farther) }
    }

    /// The [air](Self::air) as far as the room goes.
    pub fn clear_of_stock(&self) -> Region {
        if self.farther.is_empty() {
            return self.air.clone();
        }
        self.air.union(&self.farther.without(&self.region))
    }

    /// Where no stock stands above the floor before the first cut.
    pub fn air(&self) -> &Region {
        &self.air
    }

    /// The sides of the air beside which stock stands: those that lie on no wall.
    pub fn borders_of_air(&self) -> SegmentGrid {
        let walls = SegmentGrid::of_curves(self.free.curves());
        let on_wall = |side: &CurveSegment| {
            let [a, b] = side.ends;
            [a, nalgebra::center(&a, &b), b].iter().all(|p| walls.distance(p) < ON_WALL)
        };
        let sides = SegmentGrid::of_curves(self.air.curves());
        SegmentGrid::new(sides.segments().iter().copied().filter(|side| !on_wall(side)).collect())
    }

    /// Length of its walls in the plan view: of the sides that are not open, mm.
    pub fn wall_length(&self) -> f64 {
        let open: f64 = self.open.iter().map(|[a, b]| (b - a).norm()).sum();
        self.region.curves().map(around).sum::<f64>() - open
    }

    /// Length of its walls that a cutter of a radius touches from some place where it fits, mm, but for what
    /// their chords are off the curves: beside sharp corners it does not come to them.
    pub fn reached_wall_length(&self, radius: f64) -> f64 {
        self.reached_walls(radius).iter().map(WallStretch::length).sum()
    }

    /// How much longer or shorter the walls may be that a cutter of a radius comes to, mm: what touches is told
    /// with the tolerance of `reached_walls`, and beside the end of a stretch the cutter parts from the wall
    /// with the second order of the way.
    pub fn reached_wall_length_bound(&self, radius: f64) -> f64 {
        let off = self.off_wall(radius);
        let beside_end = (off * (2.0 * radius + off)).sqrt();
        let reached = self.reached_walls(radius);
        let joins = |end: &Point2, begin: &Point2| (end - begin).norm() < ON_WALL;
        let goes_on = |k: usize| {
            let end = &reached[k].ends[1];
            let next = reached.get(k + 1).is_some_and(|next| joins(end, &next.ends[0]));
            next || reached.iter().any(|other| joins(end, &other.ends[0]))
        };
        let open = (0..reached.len()).filter(|k| !goes_on(*k)).count();
        // A stretch that ends somewhere begins somewhere.
        2.0 * open as f64 * beside_end
    }

    /// Bound of the areas of its region and of its floor, mm²: chords of outlines and of offsets beside them.
    pub fn floor_area_bound(&self, radius: f64) -> f64 {
        self.off_wall(radius) * self.region.curves().map(around).sum::<f64>()
    }

    /// How far a cutter of a radius may stand off a wall that it touches, mm.
    fn off_wall(&self, radius: f64) -> f64 {
        2.0 * Region::offset_excess(radius) + self.off_drawing + ON_WALL
    }

    /// The walls that a cutter of a radius touches from some place where it fits, as
    /// [`Self::reached_wall_length`] counts them, and the edges that it goes around.
    pub fn reached_walls(&self, radius: f64) -> Vec<WallStretch> {
        let centres = RegionIndex::new(self.free.inset(radius));
        if centres.region().is_empty() {
            return Vec::new();
        }
        let off = self.off_wall(radius);
        let left = |[a, b]: &[Point2; 2]| (b - a).try_normalize(0.0).map(|d| Vector2::new(-d.y, d.x));
        let mut found = Vec::new();
        for curve in self.region.curves() {
            let side = |k: usize| [curve[k % curve.len()], curve[(k + 1) % curve.len()]];
            for k in 0..curve.len() {
                let [a, b] = side(k);
                let Some(inward) = left(&[a, b]).filter(|_| !self.open.contains(&[a, b])) else { continue };
                let at = |share: f64| a + (b - a) * share;
                let places = ((b - a).norm() / (WALL_STEP * radius)).ceil();
                // A cutter that touches no more than the end of a side, from beyond it, does not come to the
                // side.
                let touches = |place: &Point2| {
                    let sides = centres.sides();
                    let nearest = sides.nearest(place).filter(|near| near.distance <= radius + off);
                    nearest.is_some_and(|near| {
                        let [from, to] = sides.segments()[near.segment as usize].ends;
                        let way = from + (to - from) * near.share - place;
                        let (front, aside) = (way.dot(&inward), way.perp(&inward));
                        front > 0.0
                            && front - ((radius - aside) * (radius + aside)).max(0.0).sqrt() <= 2.0 * off
                    })
                };
                let reached = fitting(places, |share| touches(&at(share)));
                found.extend(
                    reached.iter().map(|ends| WallStretch { ends: ends.map(at), inward: [inward; 2] }),
                );
                // Around an edge the cutter turns from one side to the next.
                let next = left(&side(k + 1)).filter(|_| !self.open.contains(&side(k + 1)));
                let Some(turn) = next.map(|next| inward.perp(&next).atan2(inward.dot(&next))) else {
                    continue;
                };
                let toward = |share: f64| {
                    let (sin, cos) = (share * turn).sin_cos();
                    Vector2::new(inward.x * cos - inward.y * sin, inward.x * sin + inward.y * cos)
                };
                let fits = |share: f64| centres.depth(&(b + toward(share) * radius)) >= -off;
                let reached = if turn < 0.0 { fitting((-turn / WALL_STEP).ceil(), fits) } else { Vec::new() };
                found.extend(
                    reached.iter().map(|ends| WallStretch { ends: [b; 2], inward: ends.map(toward) }),
                );
            }
        }
        found
    }

    /// Ground beyond the open sides that a cutter of a radius may meet, also beyond the walls at their ends:
    /// planning asks for it only where walls let the cutter come.
    pub(super) fn ground_beyond(&self, radius: f64) -> Region {
        let mut pieces = Vec::new();
        for side in &self.open {
            let ground = Strip { width: (BEYOND + 1.0) * radius, longer: radius, lap: 0.0 };
            strips(&[*side], |_| true, &ground, &mut pieces);
        }
        Region { pieces }.without(&self.region)
    }

    /// The floor that a cutter can reach, what the flat of its bottom sweeps of the region, but for what is
    /// nearer than `clear` mm to its walls.
    pub fn reachable_floor(&self, cutter: &Cutter, clear: f64) -> Region {
        let (centres, by) = (self.free.inset(cutter.radius()), cutter.flat_radius() - clear);
        self.within(if by < 0.0 { centres.inset(-by) } else { centres.grown(by) })
    }

    /// Where stock stands above the floor that a cutter cannot reach: all of the region but its
    /// [reachable floor](Self::reachable_floor), and what is nearer than `strip` mm to its walls, which is no
    /// less than `clear`. The flat of a bottom reaches corners, necks and the foot of walls no farther.
    pub fn out_of_reach(&self, cutter: &Cutter, [clear, strip]: [f64; 2]) -> Region {
        let reached = self.reachable_floor(cutter, clear).union(&self.air);
        self.free.inset(strip).intersection(&self.region).without(&reached)
    }

    /// Area of the region that no position of the cutter sweeps, mm²: what stays in sharp corners. Over a
    /// square corner it is `r² (1 − π/4)`.
    ///
    /// # Errors
    /// [`Cancelled`] when the monitor says so.
    pub fn rest_area(&self, cutter: &Cutter, monitor: &dyn Monitor) -> Result<f64, Cancelled> {
        let r = cutter.radius();
        let swept = self.within(self.free.watched_inset(r, monitor)?.watched_grown(r, monitor)?);
        Ok((self.region.area() - swept.area()).max(0.0))
    }

    /// What a disc that keeps to the free region sweeps of the region.
    fn within(&self, swept: Region) -> Region {
        if self.open.is_empty() { swept } else { swept.intersection(&self.region) }
    }
}

/// Length around a closed curve, mm.
fn around(curve: &[Point2]) -> f64 {
    (0..curve.len()).map(|k| (curve[(k + 1) % curve.len()] - curve[k]).norm()).sum()
}

/// Makes a place on a side a corner; `None` where it lies on none.
fn divide(region: &mut Region, at: &Point2, tolerance: f64) -> Option<()> {
    let grid = SegmentGrid::of_curves(region.curves());
    let near = grid.nearest(at).filter(|near| near.distance <= tolerance)?;
    let CurveSegment { ends, curve, index } = grid.segments()[near.segment as usize];
    if ends.iter().all(|end| (end - at).norm() > tolerance) {
        let curves =
            region.pieces.iter_mut().flat_map(|p| std::iter::once(&mut p.outer).chain(&mut p.islands));
        let place = ends[0] + (ends[1] - ends[0]) * near.share;
        curves.skip(curve as usize).take(1).for_each(|c| c.insert(index as usize + 1, place));
    }
    Some(())
}

/// Whether a side comes onto a piece.
fn meets(piece: &Piece, side: &[Point2; 2]) -> bool {
    let outer = &piece.outer;
    let near = |k: usize| distance_of_segments(side, &[outer[k], outer[(k + 1) % outer.len()]]) < ON_WALL;
    piece.contains(&side[0]) || (0..outer.len()).any(near)
}

/// The stretches of a way from 0 to 1 on which something fits. It is asked at so many places, and where that
/// changes between two of them it is found by halving.
fn fitting(places: f64, fits: impl Fn(f64) -> bool) -> Vec<[f64; 2]> {
    let places = places.max(1.0);
    let mut found: Vec<[f64; 2]> = Vec::new();
    let (mut from, mut fits_from) = (0.0, fits(0.0));
    for k in 1..=places as usize {
        let to = k as f64 / places;
        let fits_to = fits(to);
        let edge = || {
            let (mut yes, mut no) = if fits_from { (from, to) } else { (to, from) };
            for _ in 0..HALVINGS {
                let middle = 0.5 * (yes + no);
                *(if fits(middle) { &mut yes } else { &mut no }) = middle;
            }
            yes
        };
        let stretch = match [fits_from, fits_to] {
            [true, true] => Some([from, to]),
            [true, false] => Some([from, edge()]),
            [false, true] => Some([edge(), to]),
            [false, false] => None,
        };
        match (found.last_mut(), stretch) {
            (Some(last), Some(stretch)) if last[1] == stretch[0] => last[1] = stretch[1],
            (_, stretch) => found.extend(stretch),
        }
        (from, fits_from) = (to, fits_to);
    }
    found
}

/// The first place of a drawn line that does not lie within `tolerance` of the sides along it, if there is
/// one. Sides end where it does.
fn off_outline(region: &Region, line: [Point2; 2], tolerance: f64) -> Option<Point2> {
    let length = (line[1] - line[0]).norm();
    let along = |side: [Point2; 2]| {
        let feet = side.map(|end| foot(&end, &line));
        let from = feet[0].0.min(feet[1].0) * length;
        feet.iter().all(|foot| foot.1 <= tolerance).then(|| [from, feet[0].0.max(feet[1].0) * length])
    };
    let of_curve = |curve: &[Point2]| -> Vec<[f64; 2]> {
        (0..curve.len()).filter_map(|k| along([curve[k], curve[(k + 1) % curve.len()]])).collect()
    };
    let mut covered: Vec<[f64; 2]> = region.curves().flat_map(of_curve).collect();
    covered.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut reached = 0.0f64;
    for [from, to] in covered.into_iter().chain([[length; 2]]) {
        if from > reached + 2.0 * tolerance {
            return Some(line[0] + (line[1] - line[0]) * (0.5 * (reached + from) / length));
        }
        reached = reached.max(to);
    }
    None
}

/// The strips beside sides of a curve, mm.
struct Strip {
    /// How wide they are.
    width: f64,
    /// How far they reach beyond the ends of their sides; below zero they end before.
    longer: f64,
    /// How far they lap over what is left of their sides, and over each other, at most.
    lap: f64,
}

/// Strips to the right of those sides of a closed curve that are wanted, and the rounds between two of them.
fn strips(
    sides: &[[Point2; 2]],
    wanted: impl Fn(&[Point2; 2]) -> bool,
    strip: &Strip,
    into: &mut Vec<Piece>,
) {
    let right = |[a, b]: &[Point2; 2]| {
        let along = (b - a).try_normalize(0.0)?;
        Some((along, Vector2::new(along.y, -along.x)))
    };
    let width = strip.width;
    let length = |side: &[Point2; 2]| (side[1] - side[0]).norm();
    let count = sides.len();
    for (k, side) in sides.iter().enumerate().filter(|(_, side)| wanted(side)) {
        let Some((along, out)) = right(side) else { continue };
        let longer = strip.longer.max(-TAPER * length(side));
        let beyond = |other: &[Point2; 2]| {
            let goes_on = strip.lap > 0.0 && count > 1 && wanted(other);
            if goes_on { strip.lap.min(TAPER * length(other)) } else { longer }
        };
        let (before, next) = (&sides[(k + count - 1) % count], &sides[(k + 1) % count]);
        let (a, b) = (side[0] - along * beyond(before), side[1] + along * beyond(next));
        let mut outer = vec![b];
        if strip.lap > 0.0 {
            let (taper, lap) =
                (along * (TAPER * length(side)), out * strip.lap.min(LAP_OF_SIDE * length(side)));
            outer.extend([side[1] - taper - lap, side[0] + taper - lap]);
        }
        outer.extend([a, a + out * width, b + out * width]);
        into.push(Piece { outer, islands: Vec::new() });
        let Some((_, to)) = right(next).filter(|_| wanted(next) && count > 1) else { continue };
        let turn = out.perp(&to).atan2(out.dot(&to));
        if turn > 0.0 {
            let count = (turn / ROUND).ceil();
            let rim = (0..=count as usize).map(|i| {
                let (sin, cos) = (turn * i as f64 / count).sin_cos();
                side[1] + Vector2::new(out.x * cos - out.y * sin, out.x * sin + out.y * cos) * width
            });
            into.push(Piece { outer: std::iter::once(side[1]).chain(rim).collect(), islands: Vec::new() });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(c: &[(f64, f64)]) -> Vec<Point2> {
        c.iter().map(|&(x, y)| Point2::new(x, y)).collect()
    }

    /// Beside a square corner it does not come to the last `r` mm of each wall; it comes to all of a round
    /// hole and around an island.
    #[test]
    fn the_cutter_comes_to_walls_where_it_fits() {
        let reached = square().reached_wall_length(3.0);
        let e = Region::offset_excess(3.0);
        let [short, long] = [3.0_f64 + e, 3.0 + 2.0 * e + ON_WALL];
        let beside_corner = short - (long * long - short * short).sqrt();
        assert!((reached - (80.0 - 8.0 * beside_corner)).abs() < 1e-4, "{reached}");
        let bound = square().reached_wall_length_bound(3.0);
        assert!((reached - (80.0 - 8.0 * 3.0)).abs() <= bound && bound < 0.6, "{reached} {bound}");
        let circle = |r: f64, n: usize| -> Vec<Point2> {
            let at = |k: usize| std::f64::consts::TAU * k as f64 / n as f64;
            (0..n).map(|k| Point2::new(r * at(k).cos(), r * at(k).sin())).collect()
        };
        let (n, r) = (60, 5.0);
        let off_drawing = r * (1.0 - (std::f64::consts::PI / n as f64).cos());
        let ring = Region::nested(vec![circle(r, n), circle(1.0, n)]).unwrap().0;
        let ring = Pocket { off_drawing, ..Pocket::new(ring, 1.0) };
        assert!((ring.reached_wall_length(1.5) - ring.wall_length()).abs() < 1e-9);
        let slot = Pocket { off_drawing, ..Pocket::new(Region::nested(vec![circle(r, n)]).unwrap().0, 1.0) };
        assert!((slot.reached_wall_length(4.9) - slot.wall_length()).abs() < 1e-9);
        assert_eq!(slot.reached_wall_length_bound(4.9), 0.0);
        assert_eq!(slot.reached_wall_length(5.1), 0.0);
    }

    /// Beside an island is no room for it, and it turns above the corner: of that side it touches no more
    /// than the end.
    #[test]
    fn a_side_that_it_touches_at_its_end_alone_is_not_reached() {
        let outline =
            points(&[(0., 0.), (14., 0.), (14., 4.2557), (4.2557, 4.2557), (4.2557, 12.), (0., 12.)]);
        let island = points(&[(1.4956, 7.4956), (2.7601, 7.4956), (2.7601, 8.7601), (1.4956, 8.7601)]);
        let pocket = Pocket::new(Region::nested(vec![outline, island]).unwrap().0, 2.5);
        let reached = pocket.reached_walls(1.5);
        let beside = |wall: &WallStretch| {
            let normal = wall.inward[0] + wall.inward[1];
            let on_side = |x: f64| wall.ends.iter().all(|end| (end.x - x).abs() < 1e-9);
            on_side(2.7601) && normal.x > 1.9 || on_side(1.4956) && normal.x < -1.9
        };
        assert!(!reached.iter().any(beside), "{reached:?}");
        let above =
            |wall: &&WallStretch| wall.inward[0].y == 1.0 && wall.ends.iter().all(|end| end.y == 8.7601);
        let length: f64 = reached.iter().filter(above).map(WallStretch::length).sum();
        assert!((length - 1.2645).abs() < 0.01, "{length}");
    }

    fn square() -> Pocket {
        Pocket::new(
            Region::nested(vec![points(&[(0., 0.), (20., 0.), (20., 20.), (0., 20.)])]).unwrap().0,
            5.0,
        )
    }

    /// One side, part of a side, and two sides with the corner between them.
    #[test]
    fn beyond_open_sides_there_is_room() {
        let width = BEYOND * 2.0;
        for (line, length, corner) in [
            (points(&[(20., 0.), (20., 20.)]), 20.0, 0.0),
            (points(&[(20., 5.), (20., 17.)]), 12.0, 0.0),
            (points(&[(20., 0.), (20., 20.), (0., 20.)]), 40.0, 1.0),
        ] {
            let pocket = square().opened(std::slice::from_ref(&line), 1e-3, 2.0).unwrap();
            assert!((pocket.wall_length() - (80.0 - length)).abs() < 1e-9, "{}", pocket.wall_length());
            let round = corner * 0.25 * std::f64::consts::PI * width * width;
            let area = pocket.free().area() - 400.0;
            assert!((area - (length * width + round)).abs() < 0.01 * (round + 1e-3), "{area} {line:?}");
            assert!((pocket.air().area() - area).abs() < 1e-4);
            // The cutter comes into every corner that is open, and into the others as far as it fits.
            let closed = if corner > 0.0 {
                1.0
            } else if length == 20.0 {
                2.0
            } else {
                4.0
            };
            let rest = pocket.rest_area(&Cutter::flat(4.0).unwrap(), &work::monitor::Silent).unwrap();
            assert!((rest - closed * 4.0 * (1.0 - std::f64::consts::FRAC_PI_4)).abs() < 5e-3, "{rest}");
        }
        let beside = square().opened(&[points(&[(20., 0.), (21., 20.)])], 1e-3, 2.0).unwrap_err();
        assert_eq!(beside.at, Point2::new(21.0, 20.0));
        // From one place of the outline to another one, across the pocket.
        let across = square().opened(&[points(&[(20., 0.), (20., 5.), (0., 20.)])], 1e-3, 2.0).unwrap_err();
        assert_eq!((across.line, across.at), (0, Point2::new(10.0, 12.5)));
    }

    /// A neck that is narrower than the cutter and corners are out of its reach; in a round hole, drawn with
    /// chords, nothing is, nor in what a larger cutter cleared before.
    #[test]
    fn necks_and_corners_are_out_of_reach() {
        let cutter = Cutter::flat(6.0).unwrap();
        let strip = [0.01, 0.02];
        let sides =
            [(0., 0.), (20., 0.), (20., 10.), (40., 10.), (40., 0.), (60., 0.), (60., 20.), (40., 20.)];
        let dumbbell = points(&[&sides[..], &[(40., 14.), (20., 14.), (20., 20.), (0., 20.)]].concat());
        let pocket = Pocket::new(Region::nested(vec![dumbbell]).unwrap().0, 5.0);
        let out = pocket.out_of_reach(&cutter, strip);
        assert!(out.contains(&Point2::new(30.0, 12.0)) && !out.contains(&Point2::new(10.0, 10.0)));
        let corner = 9.0 * (1.0 - std::f64::consts::FRAC_PI_4);
        // Where the neck begins, the cutter leans in by the height of its arc.
        let lens = 9.0 * (2.0 / 3.0_f64).asin() - 2.0 * 5f64.sqrt();
        let area = 80.0 + 8.0 * corner - 2.0 * lens;
        assert!((out.area() - area).abs() < 0.02 * area, "{} {area}", out.area());
        let round: Vec<Point2> = (0..180)
            .map(|k| std::f64::consts::TAU * f64::from(k) / 180.0)
            .map(|a| Point2::new(9.0 * a.cos(), 9.0 * a.sin()))
            .collect();
        let round = Pocket::new(Region::nested(vec![round]).unwrap().0, 5.0);
        assert!(round.out_of_reach(&cutter, strip).is_empty());
        let left = square().cleared_by(4.0, 0.0).out_of_reach(&Cutter::bull(6.0, 1.0).unwrap(), strip);
        let [bull, flat] = [6.0, 8.0].map(|d: f64| d * d * (1.0 - std::f64::consts::FRAC_PI_4));
        assert!(left.area() < bull.max(flat) && !left.contains(&Point2::new(10.0, 0.5)), "{}", left.area());
    }

    /// Two open sides with the corner between them, turned to any angle, with and without a place of a line
    /// amid a side, and the open half of a round: the room beyond has no cracks, so that the cutter comes
    /// into all that is open.
    #[test]
    fn open_sides_stay_open_at_any_angle() {
        let r = 6.0;
        let rest = |pocket: &Pocket| {
            pocket.rest_area(&Cutter::flat(2.0 * r).unwrap(), &work::monitor::Silent).unwrap()
        };
        let corner = r * r * (1.0 - std::f64::consts::FRAC_PI_4);
        for k in 0..60 {
            let (sin, cos) = (0.37 + 0.1047 * f64::from(k)).sin_cos();
            let (w, h) = (25.0 + 0.331 * f64::from(k), 50.0 - 0.217 * f64::from(k));
            // As scenes write them.
            let turned = |x: f64, y: f64| {
                let [x, y] = [x * cos - y * sin, x * sin + y * cos].map(|c| (c * 1e4).round() / 1e4);
                Point2::new(x, y)
            };
            let outline = [(0., 0.), (w, 0.), (w, h), (0., h)].map(|(x, y)| turned(x, y)).to_vec();
            let between = nalgebra::center(&outline[1], &outline[2]);
            let divided = [outline[0], outline[1], between, outline[2]].to_vec();
            for line in [outline[..3].to_vec(), divided] {
                let region = Region::nested(vec![outline.clone()]).unwrap().0;
                let pocket = Pocket::new(region, 5.0).opened(&[line], 5e-3, r).unwrap();
                let width = BEYOND * r;
                let beyond = (w + h) * width + 0.25 * std::f64::consts::PI * width * width;
                let found = pocket.air().area();
                assert!((found - beyond).abs() < 0.003 * beyond, "{k}: {found} {beyond}");
                assert!((rest(&pocket) - corner).abs() < 0.03, "{k}: {} {corner}", rest(&pocket));
                assert_eq!((pocket.free().pieces.len(), pocket.free().curves().count()), (1, 1), "{k}");
                let farther = pocket.clone().without_stock_beyond(5.0 * r, r);
                let wide = (w + h) * 5.0 * r + 0.25 * std::f64::consts::PI * 25.0 * r * r;
                let found = farther.clear_of_stock().area();
                assert!(
                    (found - wide).abs() < 0.003 * wide && farther.free() == pocket.free(),
                    "{k}: {found}"
                );
                // A larger cutter that went everywhere leaves a corner and nothing else.
                let borders = pocket.cleared_by(1.5 * r, 0.0).borders_of_air();
                let length: f64 = borders.segments().iter().map(|s| (s.ends[1] - s.ends[0]).norm()).sum();
                assert!((length - 0.75 * r * std::f64::consts::PI).abs() < 0.1, "{k}: {length}");
            }
            let n = 12;
            let of_round = |i: usize| std::f64::consts::PI * i as f64 / n as f64;
            let round: Vec<Point2> =
                (0..=n).map(|i| turned(w * of_round(i).cos(), w * of_round(i).sin())).collect();
            let region = Region::nested(vec![round.clone()]).unwrap().0;
            let pocket = Pocket::new(region, 5.0).opened(&[round], 5e-3, r).unwrap();
            assert!(rest(&pocket) < 0.02, "{k}: {}", rest(&pocket));
        }
    }

    /// Walls beside an open side are no way out: behind them is no room.
    #[test]
    fn no_room_lies_behind_a_wall() {
        // A slot beside a thin wall; its end is open.
        let outline =
            points(&[(0., 0.), (30., 0.), (30., 8.), (10., 8.), (10., 9.), (30., 9.), (30., 20.), (0., 20.)]);
        let pocket = Pocket::new(Region::nested(vec![outline]).unwrap().0, 5.0);
        let pocket = pocket.opened(&[points(&[(30., 0.), (30., 8.)])], 1e-3, 3.0).unwrap();
        assert!(
            !pocket.free().contains(&Point2::new(20.0, 8.5))
                && !pocket.free().contains(&Point2::new(31.0, 10.0))
        );
        assert!(pocket.free().contains(&Point2::new(31.0, 7.9)));
    }

    /// A thin wall that is not square to the open side beside its end: its far side leads no way into the
    /// room beyond.
    #[test]
    fn walls_askew_leave_the_room_beyond_an_open_side() {
        let outline = points(&[
            (0., 0.),
            (60., 0.),
            (60., 40.),
            (31., 40.),
            (30.5, 12.),
            (29.5, 12.),
            (29., 40.),
            (0., 40.),
        ]);
        let pocket = Pocket::new(Region::nested(vec![outline]).unwrap().0, 5.0);
        let pocket = pocket.opened(&[points(&[(60., 0.), (60., 40.), (31., 40.)])], 1e-3, 4.0).unwrap();
        // The room beyond has both strips whole, and the round between them.
        let width = BEYOND * 4.0;
        let beyond = (29.0 + 40.0) * width + 0.25 * std::f64::consts::PI * width * width;
        let found = pocket.free().area() - pocket.region.area();
        assert!((found - beyond).abs() < 0.01 * width * width, "{found} {beyond}");
        // Corners keep stock at the two ends of the left bay, and at its foot.
        let rest = pocket.rest_area(&Cutter::flat(8.0).unwrap(), &work::monitor::Silent).unwrap();
        let square = 16.0 * (1.0 - std::f64::consts::FRAC_PI_4);
        assert!((rest - 3.0 * square).abs() < 0.3, "{rest} {square}");
    }

    /// What a larger cutter leaves of a square are its corners, and a frame where it left an allowance.
    #[test]
    fn a_larger_cutter_leaves_corners() {
        for allowance in [0.0f64, 0.3] {
            let pocket = square().cleared_by(4.0, allowance);
            let inner = 20.0 - 2.0 * allowance;
            let closed = inner * inner - 16.0 * (4.0 - std::f64::consts::PI);
            // Chords of the corners lie inside.
            let area = pocket.air().area();
            assert!(area < closed + 1e-6 && area > closed - 0.02, "{area} {closed}");
        }
    }
}
