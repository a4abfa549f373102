//! The pocket itself: its region, over which sides the cutter may leave, what a larger cutter took before; mm.

use super::{Cutter, Region};
use geometry::{CurveSegment, Piece, Point2, SegmentGrid, Vector2, distance_of_segments, foot};
use work::monitor::{Cancelled, Monitor};

/// How far beyond an open side there is room, over the cutter's radius: it leaves the stock whole, and turns there.
const BEYOND: f64 = 2.6;

/// What is no farther from a wall than this, mm, is on it: far above rounding, far below any tolerance.
const ON_WALL: f64 = 1.0e-5;

/// Sides of the rounds between strips beyond open sides, rad.
const ROUND: f64 = 0.2;

/// Places along a wall that are asked whether the cutter fits there are no farther apart than this share of its radius, and where that
/// changes it is found by so many halvings.
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
}

/// A line of open sides that does not lie on the outline.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("its point at x {:.4} y {:.4} does not lie on the outline", at.x, at.y)]
pub struct NotOnOutline {
    /// Which line, counted from 0.
    pub line: usize,
    /// The point.
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
        }
    }

    /// With those sides open that lie along `lines`, within `tolerance` mm, for a cutter of a radius. Sides are divided where
    /// a line ends.
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
        let sides = |line: &Vec<Point2>| line.windows(2).map(|w| [w[0], w[1]]).collect::<Vec<_>>();
        let drawn: Vec<[Point2; 2]> = lines.iter().flat_map(sides).collect();
        let along = |p: &Point2| drawn.iter().any(|side| foot(p, side).1 <= tolerance);
        let is_open = |[a, b]: &[Point2; 2]| along(a) && along(b) && along(&nalgebra::center(a, b));
        let (mut open, mut walls, mut closed) = (Vec::new(), Vec::new(), Vec::new());
        for curve in self.region.curves() {
            let sides: Vec<[Point2; 2]> =
                (0..curve.len()).map(|k| [curve[k], curve[(k + 1) % curve.len()]]).collect();
            self.open.extend(sides.iter().filter(|side| is_open(side)));
            strips(&sides, is_open, BEYOND * radius, 0.0, &mut open);
            walls.extend(sides.into_iter().filter(|side| !is_open(side)));
        }
        // Behind a wall that stands beyond an open side, no farther: around the end of a thin one there is room. What lies behind others
        // is parted from there by stock, or by the pocket itself.
        for wall in walls.iter().filter(|wall| open.iter().any(|strip| meets(strip, wall))) {
            strips(&[*wall], |_| true, BEYOND * radius, 0.0, &mut closed);
        }
        let beyond = Region { pieces: open }.without(&Region { pieces: closed }).without(&self.region);
        self.free = self.region.union(&beyond);
        self.air = self.air.union(&beyond);
        Ok(self)
    }

    /// After a flat end mill of a radius went everywhere in it that it fits, `allowance` mm off the walls.
    pub fn cleared_by(mut self, radius: f64, allowance: f64) -> Self {
        // Straight sides where they belong, and chords of round ones inside.
        let straight = |distance: f64| distance - Region::offset_excess(distance);
        let reached = self.free.inset(straight(radius + allowance)).grown(straight(radius));
        self.air = self.air.union(&reached.intersection(&self.region));
        self
    }

    /// What the cutter may sweep: the region and the room beyond its open sides.
    pub fn free(&self) -> &Region {
        &self.free
    }

    /// Where no stock stands above the floor before the first cut.
    pub fn air(&self) -> &Region {
        &self.air
    }

    /// The sides of the air beside which stock stands: those that lie on no wall.
    pub(super) fn borders_of_air(&self) -> SegmentGrid {
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
        let around = |curve: &[Point2]| -> f64 {
            (0..curve.len()).map(|k| (curve[(k + 1) % curve.len()] - curve[k]).norm()).sum()
        };
        let open: f64 = self.open.iter().map(|[a, b]| (b - a).norm()).sum();
        self.region.curves().map(around).sum::<f64>() - open
    }

    /// Length of its walls that a cutter of a radius touches from some place where it fits, mm, but for what their chords are off the
    /// curves: beside sharp corners it does not come to them.
    pub fn reached_wall_length(&self, radius: f64) -> f64 {
        let centres = self.free.inset(radius);
        if centres.pieces.is_empty() {
            return 0.0;
        }
        let centres = SegmentGrid::of_curves(centres.curves());
        let reach = radius + 2.0 * Region::offset_excess(radius) + self.off_drawing + ON_WALL;
        let of_side = |[a, b]: [Point2; 2]| {
            let along = b - a;
            let fits = |share: f64| centres.distance(&(a + along * share)) <= reach;
            let places = (along.norm() / (WALL_STEP * radius)).ceil().max(1.0);
            let of_step = |k: usize| {
                let ends = [k as f64 / places, (k + 1) as f64 / places];
                match ends.map(fits) {
                    [true, true] => ends[1] - ends[0],
                    [false, false] => 0.0,
                    [from, _] => {
                        let (mut yes, mut no) = if from { (ends[0], ends[1]) } else { (ends[1], ends[0]) };
                        for _ in 0..HALVINGS {
                            let middle = 0.5 * (yes + no);
                            *(if fits(middle) { &mut yes } else { &mut no }) = middle;
                        }
                        (yes - if from { ends[0] } else { ends[1] }).abs()
                    }
                }
            };
            along.norm() * (0..places as usize).map(of_step).sum::<f64>()
        };
        let sides = |curve: &[Point2]| -> f64 {
            let side = |k: usize| [curve[k], curve[(k + 1) % curve.len()]];
            (0..curve.len()).map(side).filter(|side| !self.open.contains(side)).map(of_side).sum()
        };
        self.region.curves().map(sides).sum()
    }

    /// Ground beyond the open sides that a cutter of a radius may meet, also beyond the walls at their ends: planning asks for
    /// it only where walls let the cutter come.
    pub(super) fn ground_beyond(&self, radius: f64) -> Region {
        let mut pieces = Vec::new();
        for side in &self.open {
            strips(&[*side], |_| true, (BEYOND + 1.0) * radius, radius, &mut pieces);
        }
        Region { pieces }.without(&self.region)
    }

    /// The floor that a cutter can reach, what the flat of its bottom sweeps of the region, but for what is nearer than `clear`
    /// mm to its walls.
    pub fn reachable_floor(&self, cutter: &Cutter, clear: f64) -> Region {
        let (centres, by) = (self.free.inset(cutter.radius()), cutter.flat_radius() - clear);
        self.within(if by < 0.0 { centres.inset(-by) } else { centres.grown(by) })
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

/// Strips of a width to the right of those sides of a closed curve that are wanted, and the rounds between two of them; each
/// reaches `longer` mm beyond its side's ends.
fn strips(
    sides: &[[Point2; 2]],
    wanted: impl Fn(&[Point2; 2]) -> bool,
    width: f64,
    longer: f64,
    into: &mut Vec<Piece>,
) {
    let right = |[a, b]: &[Point2; 2]| {
        let along = (b - a).try_normalize(0.0)?;
        Some((along, Vector2::new(along.y, -along.x)))
    };
    for (k, side) in sides.iter().enumerate().filter(|(_, side)| wanted(side)) {
        let Some((along, out)) = right(side) else { continue };
        let [a, b] = [side[0] - along * longer, side[1] + along * longer];
        into.push(Piece { outer: vec![b, a, a + out * width, b + out * width], islands: Vec::new() });
        let next = &sides[(k + 1) % sides.len()];
        let Some((_, to)) = right(next).filter(|_| wanted(next) && sides.len() > 1) else { continue };
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

    /// Beside a square corner it does not come to the last `r` mm of each wall; it comes to all of a round hole and around an island.
    #[test]
    fn the_cutter_comes_to_walls_where_it_fits() {
        let reached = square().reached_wall_length(3.0);
        let e = Region::offset_excess(3.0);
        let [short, long] = [3.0_f64 + e, 3.0 + 2.0 * e + ON_WALL];
        let beside_corner = short - (long * long - short * short).sqrt();
        assert!((reached - (80.0 - 8.0 * beside_corner)).abs() < 1e-4, "{reached}");
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
        assert_eq!(slot.reached_wall_length(5.1), 0.0);
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

    /// A thin wall that is not square to the open side beside its end: its far side leads no way into the room beyond.
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
