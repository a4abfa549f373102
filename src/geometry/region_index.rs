//! A region with its sides in buckets: how deep places lie in it, and which discs it holds; mm.

use super::{Point2, Region, SegmentGrid, Vector2};

/// A region that is asked about many places.
#[derive(Debug, Clone)]
pub struct RegionIndex {
    region: Region,
    sides: SegmentGrid,
    right: f64,
    /// Of buckets without sides, whether they lie inside: all of one does, or nothing.
    inside: Vec<Option<bool>>,
}

impl RegionIndex {
    /// Of a region.
    pub fn new(region: Region) -> Self {
        let sides = SegmentGrid::of_curves(region.curves());
        let right = region.bounds().map_or(0.0, |[_, hi]| hi.x);
        let mut index = Self { region, sides, right, inside: Vec::new() };
        index.inside = index.sides.empty_buckets().map(|at| at.map(|at| index.crosses_odd(&at))).collect();
        index
    }

    /// The region.
    pub fn region(&self) -> &Region {
        &self.region
    }

    /// Its sides.
    pub fn sides(&self) -> &SegmentGrid {
        &self.sides
    }

    /// As [`Region::contains`].
    pub fn contains(&self, p: &Point2) -> bool {
        self.inside[self.sides.bucket_at(p)].unwrap_or_else(|| self.crosses_odd(p))
    }

    /// Whether a level ray from a place to the right crosses an odd number of sides.
    fn crosses_odd(&self, p: &Point2) -> bool {
        let mut crossed: Vec<u32> = Vec::new();
        if p.x <= self.right {
            self.sides.near(&[*p, Point2::new(self.right, p.y)], |k| {
                let [a, b] = self.sides.segments()[k as usize].ends;
                if (a.y > p.y) != (b.y > p.y) && p.x < a.x + (p.y - a.y) / (b.y - a.y) * (b.x - a.x) {
                    crossed.push(k);
                }
            });
        }
        crossed.sort_unstable();
        crossed.dedup();
        crossed.len() % 2 == 1
    }

    /// How deep a place lies inside, mm; below zero outside. Minus infinity without pieces.
    pub fn depth(&self, p: &Point2) -> f64 {
        let away = self.sides.distance(p);
        if self.contains(p) { away } else { -away }
    }

    /// Whether the square of `half` mm to each side of a place lies inside.
    pub fn holds_square(&self, centre: &Point2, half: f64) -> bool {
        let reach = Vector2::new(half, half);
        let (low, high) = (centre - reach, centre + reach);
        let mut met = false;
        self.sides.near(&[low, high], |k| {
            met = met || meets_box(&self.sides.segments()[k as usize].ends, &low, &high);
        });
        !met && self.contains(centre)
    }
}

/// Whether a segment comes into an upright rectangle.
fn meets_box([a, b]: &[Point2; 2], low: &Point2, high: &Point2) -> bool {
    let (mut from, mut to) = (0.0f64, 1.0f64);
    for axis in 0..2 {
        let along = b[axis] - a[axis];
        let ends = [low[axis] - a[axis], high[axis] - a[axis]];
        if along == 0.0 {
            if ends[0] > 0.0 || ends[1] < 0.0 {
                return false;
            }
            continue;
        }
        let shares = ends.map(|end| end / along);
        from = from.max(shares[0].min(shares[1]));
        to = to.min(shares[0].max(shares[1]));
    }
    from <= to
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rectangle(x0: f64, y0: f64, x1: f64, y1: f64) -> Vec<Point2> {
        [(x0, y0), (x1, y0), (x1, y1), (x0, y1)].map(|(x, y)| Point2::new(x, y)).to_vec()
    }

    fn region(curves: Vec<Vec<Point2>>) -> Region {
        Region::nested(curves).unwrap().0
    }

    /// A square with a square island, against the distance from both borders and against many places in
    /// squares.
    #[test]
    fn depths_and_squares_are_those_of_the_region() {
        let index =
            RegionIndex::new(region(vec![rectangle(0.0, 0.0, 10.0, 10.0), rectangle(4.0, 4.0, 6.0, 6.0)]));
        for i in -3..=24 {
            for j in -3..=24 {
                let p = Point2::new(0.5 * f64::from(i) + 0.013, 0.5 * f64::from(j) + 0.007);
                assert_eq!(index.contains(&p), index.region().contains(&p), "{p}");
                let depth = index.depth(&p);
                assert_eq!(depth > 0.0, index.contains(&p));
                assert_eq!(depth.abs(), index.sides().distance(&p));
                for half in [0.1, 0.6, 2.2] {
                    let at = |k: usize| half * (k as f64 / 10.0 - 1.0);
                    let all = (0..=20).flat_map(|a| (0..=20).map(move |b| (a, b)));
                    let mut places = all.map(|(a, b)| p + Vector2::new(at(a), at(b)));
                    let held = index.holds_square(&p, half);
                    assert!(!held || places.clone().all(|q| index.contains(&q)), "{p} {half}");
                    assert!(held || !places.all(|q| index.depth(&q) > 0.11 * half), "{p} {half}");
                }
            }
        }
    }

    /// Places in buckets without sides, beside them and beyond all, against all sides of a ring of many.
    #[test]
    fn buckets_without_sides_lie_inside_or_outside() {
        let circle = |r: f64| {
            let turn = |k: u32| f64::from(k) / 400.0 * std::f64::consts::TAU;
            (0..400).map(|k| Point2::new(r * turn(k).cos(), r * turn(k).sin())).collect::<Vec<_>>()
        };
        let index = RegionIndex::new(region(vec![circle(10.0), circle(4.0)]));
        assert!(index.inside.contains(&Some(true)) && index.inside.contains(&Some(false)));
        for k in 0..250 * 250 {
            let p = Point2::new(0.1 * f64::from(k % 250) - 12.47, 0.1 * f64::from(k / 250) - 12.43);
            assert_eq!(index.contains(&p), index.region().contains(&p), "{p}");
        }
        assert!(!RegionIndex::new(Region::default()).contains(&Point2::origin()));
    }

    /// Areas of two rectangles that overlap, and of two that share a side.
    #[test]
    fn regions_are_combined() {
        let (a, b) = (region(vec![rectangle(0., 0., 6., 4.)]), region(vec![rectangle(4., 1., 9., 3.)]));
        assert!((a.union(&b).area() - 30.0).abs() < 1e-6);
        assert!((a.intersection(&b).area() - 4.0).abs() < 1e-6);
        assert!((a.without(&b).area() - 20.0).abs() < 1e-6);
        let beside = region(vec![rectangle(6., 0., 7., 4.)]);
        let both = a.union(&beside);
        assert!((both.area() - 28.0).abs() < 1e-6 && both.pieces.len() == 1);
        assert_eq!(a.union(&Region::default()).area(), 24.0);
        assert!(a.without(&a).is_empty() && Region::default().without(&a).is_empty());
    }
}
