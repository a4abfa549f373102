//! How much of the cutter's circumference stands in stock along a path, in the plan view.
//!
//! Enters: path, cutter, the stock's flat top. Leaves: for every move the greatest angle of the front half
//! of the circumference in contact with stock. The path is gone through once more, in its order, on cells
//! that know the lowest height to which the cutter's cylinder has come, and when. Corners of bull cutters
//! and balls count as cylinders of the same radius; mm, rad. Nothing here knows how a path was planned.
//!
//! The angle is measured along the circumference. The extent of a move's cells across its direction is no angle in corners, where
//! the stock is ahead of the cutter and not beside it.

use std::f64::consts::{FRAC_PI_2, PI};

use cutter::Cutter;
use geometry::{Point2, Vector2};
use motion::{MoveKind, Toolpath};
use sim::ENGAGED;
use work::monitor::{self, Cancelled, Monitor};

/// Cells a radius. More see thinner layers, and cost memory as their square.
const CELLS_A_RADIUS: f64 = 60.0;

/// Most cells; larger pockets have larger ones, and a larger bound.
const MAX_CELLS: f64 = 4.0e7;

/// Fewest cells, however little memory there is.
const MIN_CELLS: f64 = 1.0e4;

/// Lowest height and when it was reached.
const BYTES_PER_CELL: u64 = 8;

/// The circumference is looked at this many cells inside of itself: more than half a diagonal, so that a
/// wall beside it is never seen.
const INSIDE: f64 = 1.0;

/// Places on the front half circle; so many times more of them where cells are so many times finer.
const PLACES: usize = 256;

/// The path is gone along by steps of this share of the radius at most.
const STEP: f64 = 0.1;

/// Angles of the circumference in stock.
#[derive(Debug, Clone, PartialEq)]
pub struct ContactArcs {
    /// The greatest of each move, rad; 0 of rapid moves.
    pub of_moves: Vec<f64>,
    /// Layers of stock up to this thickness may not be seen, over the cutter's radius.
    pub unseen_layer: f64,
    /// Places on the front half of the circumference that were looked at.
    pub places: usize,
}

impl ContactArcs {
    /// By how much a measured `angle` beside a straight wall may be off, rad.
    pub fn bound(&self, angle: f64) -> f64 {
        (angle.cos() - self.unseen_layer).max(-1.0).acos() - angle + PI / self.places as f64
    }
}

/// Cells with the lowest height of the cylinder and the way gone when it came there.
struct Ground {
    origin: Point2,
    cell: f64,
    nx: usize,
    ny: usize,
    lowest: Vec<f32>,
    when: Vec<f32>,
    /// Looked at on the front half circle.
    places: usize,
}

/// The angles along `path` in a stock whose flat top is at `top`, mm. The cells take no more than `memory` bytes; fewer of
/// them are larger, and the bound says so.
///
/// # Errors
/// [`Cancelled`] when the monitor says so.
///
/// # Tolerance
/// Beside straight walls the angle is within [`ContactArcs::bound`] of the true one, below it up to a right
/// angle: layers thinner than two cells may not be seen.
pub fn contact_arcs(
    path: &Toolpath,
    cutter: &Cutter,
    top: f64,
    memory: u64,
    monitor: &dyn Monitor,
) -> Result<ContactArcs, Cancelled> {
    finer_contact_arcs(path, cutter, top, 1, memory, monitor)
}

/// As [`contact_arcs`] on cells `finer` times smaller, as far as memory allows: the bound shrinks about as much.
///
/// # Errors
/// [`Cancelled`] when the monitor says so.
pub fn finer_contact_arcs(
    path: &Toolpath,
    cutter: &Cutter,
    top: f64,
    finer: usize,
    memory: u64,
    monitor: &dyn Monitor,
) -> Result<ContactArcs, Cancelled> {
    /// Moves between two questions to the monitor.
    const MOVES: usize = 4096;
    let radius = cutter.radius();
    let mut ground = Ground::around(path, radius, top, finer, memory);
    let unseen_layer = (INSIDE + std::f64::consts::FRAC_1_SQRT_2) * ground.cell / radius;
    // The own chip is as thin as one likes beside the cutter: what was cut so shortly before counts.
    let fresh = radius * (2.5 * INSIDE * ground.cell / radius).sqrt();
    let mut of_moves = vec![0.0; path.len()];
    let mut gone = 0.0f64;
    for (k, (a, b, m)) in path.segments().enumerate() {
        if k % MOVES == 0 {
            monitor::check(monitor)?;
        }
        let length = (b.xy() - a.xy()).norm();
        let steps = (length / (STEP * radius)).ceil().max(1.0);
        for step in 0..steps as usize {
            let (from, to) = (a + (b - a) * (step as f64 / steps), a + (b - a) * ((step + 1) as f64 / steps));
            gone += length / steps;
            if let Some(heading) = (b.xy() - a.xy()).try_normalize(0.0)
                && m.kind != MoveKind::Rapid
            {
                let arc = ground.arc(&to.xy(), &heading, radius, to.z.max(from.z), gone - fresh);
                of_moves[k] = arc.max(of_moves[k]);
            }
            ground.lower([from.xy(), to.xy()], radius, from.z.max(to.z), gone);
        }
        ground.lower([b.xy(), b.xy()], radius, b.z, gone);
    }
    Ok(ContactArcs { of_moves, unseen_layer, places: ground.places })
}

impl Ground {
    fn around(path: &Toolpath, radius: f64, top: f64, finer: usize, memory: u64) -> Self {
        let first = path.start.tip.xy();
        let (lo, hi) = path
            .moves
            .iter()
            .fold((first, first), |(lo, hi), m| (lo.inf(&m.to.tip.xy()), hi.sup(&m.to.tip.xy())));
        let reach = Vector2::new(radius, radius) * 1.05;
        let (lo, hi) = (lo - reach, hi + reach);
        let size = hi - lo;
        let most = ((memory / BYTES_PER_CELL) as f64).clamp(MIN_CELLS, MAX_CELLS);
        let cell = (radius / (CELLS_A_RADIUS * finer as f64)).max((size.x * size.y / most).sqrt());
        let (nx, ny) = ((size.x / cell).ceil() as usize + 1, (size.y / cell).ceil() as usize + 1);
        let lowest = vec![top as f32; nx * ny];
        Self {
            origin: lo,
            cell,
            nx,
            ny,
            lowest,
            when: vec![f32::NEG_INFINITY; nx * ny],
            places: PLACES * finer,
        }
    }

    /// Angle in stock above `z` at `centre`; what was cut after `since` still counts.
    fn arc(&self, centre: &Point2, heading: &Vector2, radius: f64, z: f64, since: f64) -> f64 {
        let left = Vector2::new(-heading.y, heading.x);
        let reach = radius - INSIDE * self.cell;
        let standing = |angle: f64| {
            let (sin, cos) = angle.sin_cos();
            let at = (centre + (heading * cos + left * sin) * reach - self.origin) / self.cell;
            let (i, j) = (at.x as usize, at.y as usize);
            let k = j.min(self.ny - 1) * self.nx + i.min(self.nx - 1);
            f64::from(self.lowest[k]) > z + ENGAGED || f64::from(self.when[k]) > since
        };
        let part = PI / self.places as f64;
        let count = (0..self.places).filter(|k| standing((*k as f64 + 0.5) * part - FRAC_PI_2)).count();
        count as f64 * part
    }

    /// Brings the cells within `radius` of a segment down to `z`.
    fn lower(&mut self, ends: [Point2; 2], radius: f64, z: f64, gone: f64) {
        let (lo, hi) = (ends[0].inf(&ends[1]), ends[0].sup(&ends[1]));
        let row = |y: f64| ((y - self.origin.y) / self.cell - 0.5).max(0.0);
        let (first, last) = (row(lo.y - radius).ceil() as usize, row(hi.y + radius).floor() as usize);
        for j in first..=last.min(self.ny - 1) {
            let y = self.origin.y + (j as f64 + 0.5) * self.cell;
            let Some([from, to]) = chord(&ends, radius, y) else { continue };
            let column = |x: f64| ((x - self.origin.x) / self.cell - 0.5).max(0.0);
            let (from, to) = (column(from).ceil() as usize, column(to).floor() as usize);
            let cells = j * self.nx + from..(j * self.nx + (to + 1).min(self.nx)).max(j * self.nx + from);
            for (lowest, when) in self.lowest[cells.clone()].iter_mut().zip(&mut self.when[cells]) {
                if f64::from(*lowest) > z + ENGAGED {
                    (*lowest, *when) = (z as f32, gone as f32);
                }
            }
        }
    }
}

/// The stretch of the row `y` within `radius` of a segment.
fn chord(ends: &[Point2; 2], radius: f64, y: f64) -> Option<[f64; 2]> {
    let mut found: Option<[f64; 2]> = None;
    let mut join = |a: f64, b: f64| {
        found = Some(found.map_or([a.min(b), a.max(b)], |f| [f[0].min(a).min(b), f[1].max(a).max(b)]));
    };
    for end in ends {
        let half = radius * radius - (y - end.y).powi(2);
        if half >= 0.0 {
            join(end.x - half.sqrt(), end.x + half.sqrt());
        }
    }
    // The two sides: where the row crosses them.
    if let Some(along) = (ends[1] - ends[0]).try_normalize(0.0) {
        for side in [Vector2::new(-along.y, along.x) * radius, Vector2::new(along.y, -along.x) * radius] {
            let (a, b) = (ends[0] + side, ends[1] + side);
            if (a.y - y) * (b.y - y) < 0.0 {
                let x = a.x + (b.x - a.x) * ((y - a.y) / (b.y - a.y));
                join(x, x);
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::Point3;
    use motion::{ClPoint, Move};
    use work::monitor::Silent;

    /// The path through `places` at z = -2 in stock up to 0, after a plunge to the first of them.
    fn through(places: &[(f64, f64)]) -> Toolpath {
        let to = |&(x, y): &(f64, f64), kind| Move {
            to: ClPoint::upright(Point3::new(x, y, -2.0)),
            kind,
            feed_rate: 600.0,
            pass: 0,
        };
        let mut moves = vec![to(&places[0], MoveKind::Plunge)];
        moves.extend(places[1..].iter().map(|p| to(p, MoveKind::Cut)));
        Toolpath::new(ClPoint::upright(Point3::new(places[0].0, places[0].1, 5.0)), moves)
    }

    fn arcs(places: &[(f64, f64)]) -> ContactArcs {
        contact_arcs(&through(places), &Cutter::flat(6.0).unwrap(), 0.0, u64::MAX, &Silent).unwrap()
    }

    fn check(found: &ContactArcs, k: usize, exact: f64) {
        let angle = found.of_moves[k];
        let part = PI / found.places as f64;
        let bound = found.bound(exact.min(angle)) + part;
        assert!((angle - exact).abs() <= bound, "move {k}: {angle} of {exact}, bound {bound}");
    }

    /// A slot is half a turn; beside it passes of the stepover w stand in stock by acos(1 − w/r), in either
    /// direction; what is cleared is none, also along its walls.
    #[test]
    fn straight_passes_have_the_angles_of_closed_forms() {
        for turn in [0.0f64, 0.3, 1.0] {
            let at = |x: f64, y: f64| (x * turn.cos() - y * turn.sin(), x * turn.sin() + y * turn.cos());
            for width in [0.4f64, 1.5, 3.0, 4.5] {
                let y = width;
                let found = arcs(&[
                    at(0.0, 0.0),
                    at(20.0, 0.0),
                    at(0.0, 0.0),
                    at(-10.0, 0.0),
                    at(-10.0, y),
                    at(20.0, y),
                    at(20.0, 2.0 * y),
                    at(-20.0, 2.0 * y),
                    at(20.0, 2.0 * y),
                ]);
                check(&found, 1, PI);
                assert_eq!(found.of_moves[2], 0.0);
                check(&found, 3, PI);
                // The middle of the long passes; their ends turn into the corner beside.
                let middle = arcs(&[at(-10.0, 0.0), at(30.0, 0.0), at(29.0, y), at(10.0, y)]);
                check(&middle, 3, (1.0 - width / 3.0).acos());
                assert_eq!(found.of_moves[8], 0.0);
            }
        }
    }

    /// Along both walls of a corner up to `d` before its end, then into it by the bisector: in stock is the
    /// quarter between the walls' feet and on either side what the disc there left, asin(d / 2r).
    #[test]
    fn into_a_square_corner_the_arc_is_a_quarter_and_what_was_left() {
        let d = 2.5f64;
        let to_the_end =
            [(-20.0, 0.0), (-d, 0.0), (-d, -d), (0.0, -d), (0.0, -20.0), (0.0, -d), (-d, -d), (0.0, 0.0)];
        let found = arcs(&to_the_end);
        let exact = FRAC_PI_2 + 2.0 * (d / 6.0).asin();
        // Both ends of the arc meet ground whose border crosses the circumference at this angle.
        let bound = 2.0 * found.unseen_layer / (2.0 * (d / 6.0).asin()).sin() + 2.0 * PI / PLACES as f64;
        assert!((found.of_moves[7] - exact).abs() <= bound, "{} {exact} {bound}", found.of_moves[7]);
    }

    /// Circles of the centre, each a little greater than the one before.
    #[test]
    fn rings_follow_the_law_of_cosines() {
        let ring = |rho: f64| {
            (0..=400)
                .map(move |k| 2.0 * PI * f64::from(k) / 400.0)
                .map(move |a| (rho * a.cos(), rho * a.sin()))
        };
        let (first, width) = (2.0f64, 0.6f64);
        let places: Vec<(f64, f64)> = ring(first).chain(ring(first + width)).collect();
        let found = arcs(&places);
        let rho = first + width;
        let exact = (1.0 - (width * (rho + 3.0) - 0.5 * width * width) / (rho * 3.0)).acos();
        (500..700).for_each(|k| check(&found, k, exact));
    }

    #[test]
    fn less_memory_is_told_by_the_bound() {
        let path = through(&[(-10.0, 0.0), (40.0, 0.0), (39.0, 1.5), (10.0, 1.5)]);
        let arcs = |memory| contact_arcs(&path, &Cutter::flat(6.0).unwrap(), 0.0, memory, &Silent).unwrap();
        let (fine, coarse) = (arcs(u64::MAX), arcs(0));
        assert!(coarse.unseen_layer > 3.0 * fine.unseen_layer);
        let exact = 0.5f64.acos();
        for found in [&fine, &coarse] {
            let (angle, bound) = (found.of_moves[3], found.bound(exact));
            assert!((angle - exact).abs() <= bound + PI / PLACES as f64, "{angle} of {exact}, {bound}");
        }
    }

    #[test]
    fn finer_cells_bound_the_angle_closer() {
        let path = through(&[(-10.0, 0.0), (40.0, 0.0), (39.0, 1.5), (10.0, 1.5)]);
        let arcs = |finer| {
            finer_contact_arcs(&path, &Cutter::flat(6.0).unwrap(), 0.0, finer, u64::MAX, &Silent).unwrap()
        };
        let exact = 0.5f64.acos();
        let [plain, fine] = [1, 4].map(arcs);
        assert!(fine.bound(exact) < 0.3 * plain.bound(exact));
        for found in [&plain, &fine] {
            let part = PI / found.places as f64;
            assert!((found.of_moves[3] - exact).abs() <= found.bound(exact) + part, "{}", found.of_moves[3]);
        }
    }

    /// What the cells say of the ground is what the engine's stock says.
    #[test]
    fn cells_are_lowered_as_by_the_engine() {
        let path = through(&[(0.0, 0.0), (7.0, 2.0), (3.0, 9.0), (3.0, 4.0)]);
        let mut ground = Ground::around(&path, 3.0, 0.0, 1, u64::MAX);
        for (a, b, _) in path.segments() {
            ground.lower([a.xy(), b.xy()], 3.0, a.z.max(b.z), 0.0);
            ground.lower([b.xy(), b.xy()], 3.0, b.z, 0.0);
        }
        let centre = ground.origin + Vector2::new(0.5, 0.5) * ground.cell;
        let grid = sim::Grid { origin: centre, cell: ground.cell, nx: ground.nx, ny: ground.ny };
        let stock = sim::ZMap::block(grid, 0.0);
        let cut = sim::cut(stock, &Cutter::flat(6.0).unwrap(), &path, &Silent).unwrap();
        let differ = ground.lowest.iter().zip(&cut.height).filter(|(a, b)| (*a - *b).abs() > 1e-6).count();
        assert!(differ <= 2, "{differ} cells differ: only those on the rim to the last bits may");
    }
}
