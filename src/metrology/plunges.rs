//! Whether moves come down into stock or into ground that is cleared.
//!
//! Enters: the moves in order, what stood before, what the cutter may sweep. Leaves: of a move, whether stock
//! stands where it comes down to. What earlier moves swept no higher is a union of stadiums, each convex: a
//! square whose corners lie in one is cleared whole. Squares are divided until they are, or one shows stock.
//! Films up to [`UNCOUNTED_LAYER`](super::UNCOUNTED_LAYER) of the radius, as the engagement leaves them out,
//! are no stock; mm.

use geometry::{Aabb, CurveSegment, Point2, Region, RegionIndex, SegmentGrid, Vector2, foot};
use motion::Toolpath;
use sim::Stock;

use super::UNCOUNTED_LAYER;

/// Squares are divided until their half side is this share of the radius: what is smaller is a film.
const FINEST: f64 = 0.25 * UNCOUNTED_LAYER;

/// Heights that differ by less are the same, mm.
const ROUNDING: f64 = 1.0e-6;

/// What stands before each move of a path.
#[derive(Debug)]
pub struct StockBefore<'a> {
    path: &'a Toolpath,
    radius: f64,
    ways: SegmentGrid,
    block: Aabb,
    /// Where nothing stood above a level before the path, and that level, mm.
    cleared: Option<(&'a RegionIndex, f64)>,
    free: RegionIndex,
}

impl<'a> StockBefore<'a> {
    /// For a path of a cutter of a radius that may sweep `free`; what it cuts elsewhere is told by others.
    pub fn new(path: &'a Toolpath, radius: f64, stock: &'a Stock, free: &Region) -> Self {
        let way = |(k, (a, b, _)): (usize, (geometry::Point3, geometry::Point3, _))| CurveSegment {
            ends: [a.xy(), b.xy()],
            curve: 0,
            index: k as u32,
        };
        let ways = path.segments().map(|(a, b, m)| (a, b, m.kind)).enumerate().map(way).collect();
        let free = RegionIndex::new(free.clone());
        Self {
            path,
            radius,
            ways: SegmentGrid::new(ways),
            block: stock.bounds(),
            cleared: stock.cleared(),
            free,
        }
    }

    /// Whether stock stands above the lower end of a move under the cutter there.
    pub fn stands_under(&self, move_index: usize) -> bool {
        let (a, b) = (self.path.start_of(move_index), self.path.moves[move_index].to.tip);
        let lower = if b.z <= a.z { b } else { a };
        // Films lie at the rim and between stadiums.
        let film = 0.5 * UNCOUNTED_LAYER * self.radius;
        let disc = Disc { centre: lower.xy(), radius: self.radius - film };
        let reach = Vector2::repeat(2.0 * self.radius);
        let mut near = Vec::new();
        self.ways.near(&[disc.centre - reach, disc.centre + reach], |k| near.push(k));
        near.sort_unstable();
        near.dedup();
        let low = |k: u32| {
            let k = k as usize;
            k < move_index && self.path.start_of(k).z.max(self.path.moves[k].to.tip.z) <= lower.z + ROUNDING
        };
        let ways: Vec<[Point2; 2]> =
            near.into_iter().filter(|k| low(*k)).map(|k| self.ways.segments()[k as usize].ends).collect();
        let before = self.cleared.filter(|(_, floor)| *floor <= lower.z + ROUNDING).map(|(region, _)| region);
        let search = Search { disc, swept: self.radius + film, before, stock: self };
        search.stands(&disc.centre, self.radius, &ways.iter().collect::<Vec<_>>())
    }
}

#[derive(Clone, Copy)]
struct Disc {
    centre: Point2,
    radius: f64,
}

struct Search<'a> {
    disc: Disc,
    /// How far from its way a move clears, mm.
    swept: f64,
    before: Option<&'a RegionIndex>,
    stock: &'a StockBefore<'a>,
}

impl Search<'_> {
    /// Whether stock stands in a square; `near` are the ways that may clear some of it.
    fn stands(&self, centre: &Point2, half: f64, near: &[&[Point2; 2]]) -> bool {
        let corner = half * std::f64::consts::SQRT_2;
        let Aabb { min, max } = &self.stock.block;
        let away = (centre - self.disc.centre).norm() - self.disc.radius;
        let beside_block = (0..2).any(|k| centre[k] + half <= min[k] || centre[k] - half >= max[k]);
        if away >= corner || beside_block {
            return false;
        }
        let mut nearest = f64::INFINITY;
        let mut left = Vec::new();
        for ends in near {
            let distance = foot(centre, ends).1;
            if distance + corner <= self.swept {
                return false;
            }
            if distance - corner < self.swept {
                left.push(*ends);
            }
            nearest = nearest.min(distance);
        }
        if self.before.is_some_and(|before| before.holds_square(centre, half)) {
            return false;
        }
        let in_block = (0..2).all(|k| centre[k] > min[k] && centre[k] < max[k]);
        let stands = away <= 0.0
            && in_block
            && nearest > self.swept
            && self.stock.free.contains(centre)
            && !self.before.is_some_and(|before| before.contains(centre));
        if stands || half <= FINEST * self.stock.radius {
            return stands;
        }
        let quarter = 0.5 * half;
        [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)]
            .iter()
            .any(|(i, j)| self.stands(&(centre + Vector2::new(i * quarter, j * quarter)), quarter, &left))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::Point3;
    use motion::{ClPoint, Move, MoveKind};

    fn rectangle(x: [f64; 2], y: [f64; 2]) -> Region {
        let corners = [(x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1])];
        Region::nested(vec![corners.map(|(x, y)| Point2::new(x, y)).to_vec()]).unwrap().0
    }

    /// Two passes side by side clear the ground between them; a third beside them comes down on it, on its
    /// border, or into stock.
    #[test]
    fn ground_that_was_cleared_is_known() {
        let at = |x: f64, y: f64, z: f64| ClPoint::upright(Point3::new(x, y, z));
        let passes = |y: f64, z: f64, last: Point2| {
            let to = |to| Move { to, kind: MoveKind::Cut, feed_rate: 1.0, pass: 0 };
            let ways = [at(0.0, 10.0, z), at(20.0, 10.0, z), at(20.0, y, z), at(0.0, y, z), at(0.0, y, 9.0)];
            let down = [at(last.x, last.y, 9.0), at(last.x, last.y, -2.0)];
            Toolpath::new(at(0.0, 10.0, 9.0), ways.into_iter().chain(down).map(to).collect())
        };
        let free = rectangle([-10.0, 40.0], [0.0, 40.0]);
        let block = Aabb { min: Point3::new(-4.0, -5.0, -9.0), max: Point3::new(45.0, 45.0, 0.0) };
        let stands = |path: &Toolpath, stock: &Stock| {
            StockBefore::new(path, 3.0, stock, &free).stands_under(path.len() - 1)
        };
        let solid = Stock::Box(block);
        let of = |y: f64, z: f64, (x, at_y): (f64, f64)| stands(&passes(y, z, Point2::new(x, at_y)), &solid);
        assert!(
            !of(14.0, -2.0, (10.0, 12.0)) && !of(14.0, -2.0, (10.0, 14.0)) && !of(15.99, -2.0, (10.0, 13.0))
        );
        assert!(of(14.0, -2.0, (10.0, 14.1)) && of(16.2, -2.0, (10.0, 13.0)) && of(14.0, -1.9, (10.0, 12.0)));
        // Beside the block nothing stands, nor where it was cleared before.
        assert!(!of(14.0, -2.0, (-7.0, 20.0)) && of(14.0, -2.0, (-6.9, 20.0)));
        let milled = |floor| Stock::milled(block, &rectangle([10.0, 40.0], [20.0, 40.0]), floor);
        let beside = passes(14.0, -2.0, Point2::new(30.0, 23.0));
        assert!(!stands(&beside, &milled(-5.0)) && stands(&beside, &milled(-1.0)) && stands(&beside, &solid));
    }
}
