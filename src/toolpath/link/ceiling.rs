//! How high stock can still stand while a program runs: an upper bound on squares of the plan view,
//! from which the height of rapid moves follows.
//!
//! A cutter whose tip is at `(p, z)` leaves nothing above `z + f(|q − p|)` at a place `q` nearer than its
//! radius, `f` the height of its profile, which never falls. A square is lowered only where the cutter
//! covers the whole of it, and to the bound at its farthest corner; so no square ever lies below the
//! stock that stands on it, whatever its size. Wherever no move has been, also beside the part, stock is
//! taken to stand up to the top: how far it reaches beyond the part is not for the planner to guess.

use cutter::Cutter;
use geometry::{Point2, Point3, Vector2};

/// Squares across a cutter's radius. The bound lies above the stock by what the profile rises over the
/// diagonal of a square: with fewer squares rapids stay higher than they have to, more cost time.
const SQUARES_A_RADIUS: f64 = 8.0;

/// Most squares, and fewest, however little memory there is; parts that would take more get larger ones.
const MOST_SQUARES: f64 = 4e6;
const LEAST_SQUARES: f64 = 1e4;

/// An upper bound of the stock's height over the plan view, mm.
pub struct Ceiling<'a> {
    cutter: &'a Cutter,
    /// Where the axis may be: lowest and highest coordinates.
    range: [Point2; 2],
    corner: Point2,
    side: f64,
    count: [usize; 2],
    height: Vec<f64>,
    top: f64,
}

impl<'a> Ceiling<'a> {
    /// Flat stock up to `top`, for a cutter whose axis stays between the points `low` and `high` of the
    /// plan view. The squares take no more than `memory` bytes; fewer are larger, and bound the stock higher.
    pub fn new(cutter: &'a Cutter, [low, high]: [Point2; 2], top: f64, memory: u64) -> Self {
        let size = (high - low).map(|s| s.max(0.0) + 2.0 * cutter.radius());
        let most = (memory as f64 / size_of::<f64>() as f64).clamp(LEAST_SQUARES, MOST_SQUARES);
        let side = (cutter.radius() / SQUARES_A_RADIUS).max((size.x * size.y / most).sqrt());
        // Two squares more all around, so that the whole rim of the cutter stays over some.
        let border = cutter.radius() + 2.0 * side;
        let count = [size.x, size.y].map(|s| (s / side).ceil() as usize + 4);
        let corner = low - Vector2::new(border, border);
        Self { cutter, range: [low, high], corner, side, count, height: vec![top; count[0] * count[1]], top }
    }

    fn half_diagonal(&self) -> f64 {
        self.side * std::f64::consts::FRAC_1_SQRT_2
    }

    /// The squares along one axis that touch `[from, to]`.
    fn squares(&self, axis: usize, from: f64, to: f64) -> std::ops::Range<usize> {
        let n = self.count[axis] as f64;
        let [a, b] = [from, to].map(|x| ((x - self.corner[axis]) / self.side).floor());
        a.clamp(0.0, n) as usize..(b + 1.0).clamp(0.0, n) as usize
    }

    /// Squares whose centres lie within `reach` of the segment between `a` and `b`, with the share of it
    /// nearest to the centre and the distance from there.
    fn near(&self, a: Point2, b: Point2, reach: f64, mut found: impl FnMut(usize, f64, f64)) {
        let along = b - a;
        let length2 = along.norm_squared();
        let columns = self.squares(0, a.x.min(b.x) - reach, a.x.max(b.x) + reach);
        for j in self.squares(1, a.y.min(b.y) - reach, a.y.max(b.y) + reach) {
            for i in columns.clone() {
                let q = self.corner + Vector2::new(i as f64 + 0.5, j as f64 + 0.5) * self.side;
                let t = if length2 > 0.0 { ((q - a).dot(&along) / length2).clamp(0.0, 1.0) } else { 0.0 };
                let distance = (q - (a + along * t)).norm();
                if distance <= reach {
                    found(j * self.count[0] + i, t, distance);
                }
            }
        }
    }

    /// The cutter feeds from `a` to `b`, places of its tip.
    pub fn lower(&mut self, a: &Point3, b: &Point3) {
        let half = self.half_diagonal();
        let mut height = std::mem::take(&mut self.height);
        // Long oblique moves go piece by piece, or their rectangle would be the whole part.
        let pieces = ((b - a).xy().norm() / self.cutter.radius()).ceil().max(1.0);
        let at = |k: f64| a + (b - a) * (k / pieces);
        for k in 0..pieces as usize {
            let (a, b) = (at(k as f64), at(k as f64 + 1.0));
            // A move straight up or down leaves what its lower end does.
            let (from, to) = if a.xy() == b.xy() { (a.z.min(b.z), a.z.min(b.z)) } else { (a.z, b.z) };
            self.near(a.xy(), b.xy(), self.cutter.radius() - half, |square, t, distance| {
                if let Some(rise) = self.cutter.height(distance + half) {
                    let bound = from + (to - from) * t + rise;
                    height[square] = height[square].min(bound);
                }
            });
        }
        self.height = height;
    }

    /// The lowest height of the tip at which the cutter touches no stock while its axis goes from `a` to
    /// `b` in the plan view.
    pub fn free_height(&self, a: &Point2, b: &Point2) -> f64 {
        let outside = |p: &Point2| (0..2).any(|c| p[c] < self.range[0][c] || p[c] > self.range[1][c]);
        if outside(a) || outside(b) {
            return self.top;
        }
        let half = self.half_diagonal();
        let mut free = f64::NEG_INFINITY;
        self.near(*a, *b, self.cutter.radius() + half, |square, _, distance| {
            let rise = self.cutter.height((distance - half).max(0.0)).unwrap_or(0.0);
            free = free.max(self.height[square] - rise);
        });
        free.min(self.top)
    }
}
