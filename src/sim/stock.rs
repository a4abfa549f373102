//! What there is before the first cut: boxes, round bars, closed meshes, blocks roughed to some distance from
//! a part, and blocks in which a pocket was begun. Engines on heights see it from above.

use std::sync::Arc;

use geometry::{Aabb, Bvh, HalfSpace, Point2, Point3, Region, RegionIndex, TriangleMesh, Vector3, clipped};

/// Heights of curved stock are found to this, mm. Less takes more looks.
const TRACED: f64 = 0.01;

/// An axis of coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BarAxis {
    /// Along x.
    X,
    /// Along y.
    Y,
    /// Along z.
    Z,
}

/// Stock as a solid, mm.
#[derive(Debug, Clone)]
pub enum Stock {
    /// A block.
    Box(Aabb),
    /// A round bar.
    Cylinder {
        /// Middle of one end.
        base: Point3,
        /// Which way it runs from there.
        axis: BarAxis,
        /// Radius, mm.
        radius: f64,
        /// Length, mm.
        length: f64,
    },
    /// A casting or forging: see [`Stock::from_mesh`].
    Mesh(Arc<StockMesh>),
    /// What an earlier cutter left of a block: see [`Stock::roughed`].
    Roughed {
        /// The block.
        block: Aabb,
        /// The surface that was roughed.
        part: Arc<StockMesh>,
        /// How much stands over it, mm.
        over: f64,
    },
    /// A block without what lies over a region above a level: see [`Stock::milled`].
    Milled {
        /// The block.
        block: Aabb,
        /// The region; it may lie beyond the block in part.
        cleared: Arc<RegionIndex>,
        /// Down to here, mm.
        floor: f64,
    },
}

/// A mesh with its search tree.
#[derive(Debug)]
pub struct StockMesh {
    mesh: TriangleMesh,
    tree: Bvh,
}

/// A stock in a cube, between two convex solids, which half spaces around the cube's middle bound.
#[derive(Debug, PartialEq)]
pub(crate) struct StockSides {
    /// All of the stock lies in these.
    pub(crate) outer: Vec<HalfSpace>,
    /// What lies in these is stock; where there are none, none need be.
    pub(crate) inner: Option<Vec<HalfSpace>>,
}

impl Default for StockSides {
    /// Of a cube inside of the stock.
    fn default() -> Self {
        Self { outer: Vec::new(), inner: Some(Vec::new()) }
    }
}

impl StockSides {
    /// Whether nothing lies between the two.
    pub(crate) fn is_exact(&self) -> bool {
        self.inner.as_ref() == Some(&self.outer)
    }
}

impl Stock {
    /// Of a closed mesh; `None` where it has borders, since nobody can tell its inside then.
    pub fn from_mesh(mesh: TriangleMesh) -> Option<Self> {
        let closed = mesh.is_closed();
        closed.then(|| Self::Mesh(Arc::new(StockMesh { tree: Bvh::new(&mesh), mesh })))
    }

    /// A block that was roughed to `over` mm from the outer side of a part's surface. Beside an open surface
    /// its borders' planes go on.
    pub fn roughed(block: Aabb, part: TriangleMesh, over: f64) -> Self {
        Self::Roughed { block, part: Arc::new(StockMesh { tree: Bvh::new(&part), mesh: part }), over }
    }

    /// A block from which an end mill took all that lies over `cleared` and above `floor`.
    pub fn milled(block: Aabb, cleared: &Region, floor: f64) -> Self {
        Self::Milled { block, cleared: Arc::new(RegionIndex::new(cleared.clone())), floor }
    }

    /// Where no stock stands above a level, mm, and the level, if that is known as a region of the plan view.
    pub fn cleared(&self) -> Option<(&RegionIndex, f64)> {
        match self {
            Self::Milled { cleared, floor, .. } => Some((cleared, *floor)),
            _ => None,
        }
    }

    /// Its mesh, where it is one.
    pub fn mesh(&self) -> Option<&TriangleMesh> {
        match self {
            Self::Mesh(stock) => Some(&stock.mesh),
            _ => None,
        }
    }

    /// The corners of its mesh; none of other shapes.
    pub fn corners(&self) -> &[Point3] {
        self.mesh().map_or(&[], TriangleMesh::vertices)
    }

    /// The triangles of its mesh; none of other shapes.
    pub fn triangles(&self) -> usize {
        self.mesh().map_or(0, |mesh| mesh.triangles().len())
    }

    /// The box around it.
    pub fn bounds(&self) -> Aabb {
        match self {
            Self::Box(bounds) => *bounds,
            Self::Cylinder { base, axis, radius, length } => {
                let mut around = Vector3::from_element(*radius);
                let mut end = *base;
                around[*axis as usize] = 0.0;
                end[*axis as usize] += length;
                Aabb { min: base - around, max: end + around }
            }
            Self::Mesh(stock) => stock.mesh.bounds(),
            Self::Roughed { block, .. } | Self::Milled { block, .. } => *block,
        }
    }

    /// Whether its sizes are positive and all its numbers finite.
    pub(crate) fn is_valid(&self) -> bool {
        let Aabb { min, max } = self.bounds();
        (0..3).all(|i| min[i] < max[i] && min[i].is_finite() && max[i].is_finite())
    }

    /// Volume, mm³; `None` of a roughed block, which no closed form tells.
    pub fn volume(&self) -> Option<f64> {
        Some(match self {
            Self::Roughed { .. } => return None,
            Self::Box(bounds) => bounds.size().product(),
            Self::Milled { block, cleared, floor } => {
                let Aabb { min, max } = block;
                let corners = [(min.x, min.y), (max.x, min.y), (max.x, max.y), (min.x, max.y)];
                let outer = corners.map(|(x, y)| Point2::new(x, y)).to_vec();
                let rectangle = Region { pieces: vec![geometry::Piece { outer, islands: Vec::new() }] };
                let within = cleared.region().intersection(&rectangle).area();
                block.size().product() - within * (block.max.z - floor)
            }
            Self::Cylinder { radius, length, .. } => std::f64::consts::PI * radius * radius * length,
            Self::Mesh(stock) => {
                // From a place nearby, so that far from the origin no digits are lost.
                let near = stock.mesh.bounds().min;
                let corners = (0..stock.mesh.triangles().len()).map(|t| stock.mesh.corners(t));
                corners.map(|[a, b, c]| (a - near).dot(&(b - near).cross(&(c - near))) / 6.0).sum()
            }
        })
    }

    /// What of it lies in the cube of half side `half` around `centre`.
    pub(crate) fn sides(&self, centre: &Point3, half: f64) -> StockSides {
        // From one place to another along an axis.
        let between = |axis: usize, low: f64, high: f64| {
            let along = Vector3::ith(axis, 1.0);
            let faces = [(along, centre[axis] - low), (-along, high - centre[axis])];
            faces.map(|(gradient, offset)| HalfSpace { gradient, offset })
        };
        match self {
            Self::Box(Aabb { min, max }) => {
                let outer: Vec<_> = (0..3).flat_map(|i| between(i, min[i], max[i])).collect();
                StockSides { inner: Some(outer.clone()), outer }
            }
            Self::Cylinder { base, axis, radius, length } => {
                let axis = *axis as usize;
                let ends = between(axis, base[axis], base[axis] + length);
                // Away from the bar's axis, how far the side lies: a concave function.
                let outward = |place: &Point3| {
                    let mut away = place - base;
                    away[axis] = 0.0;
                    away
                };
                let (at, rho) = (outward(centre), outward(centre).norm());
                let gradient = if rho > 0.0 { -at / rho } else { Vector3::zeros() };
                let lowest = |k: usize| {
                    let way = corner(k) * half;
                    radius - outward(&(centre + way)).norm() - gradient.dot(&way)
                };
                let below = (0..8).map(lowest).fold(radius - rho, f64::min);
                let with = |offset: f64| ends.into_iter().chain([HalfSpace { gradient, offset }]).collect();
                StockSides { outer: with(radius - rho), inner: Some(with(below)) }
            }
            Self::Mesh(_) | Self::Roughed { .. } | Self::Milled { .. } => {
                StockSides { outer: Vec::new(), inner: None }
            }
        }
    }

    /// Above this height nothing stands over the square of `half` mm to each side of `(x, y)`; minus infinity
    /// where nothing stands at all.
    ///
    /// # Tolerance
    /// Exact; of a roughed block too high by up to 0.01 mm and what the surface rises within the square.
    pub fn highest_within(&self, x: f64, y: f64, half: f64) -> f64 {
        match self {
            Self::Box(Aabb { min, max }) => {
                let meets = x + half >= min.x && x - half <= max.x && y + half >= min.y && y - half <= max.y;
                if meets { max.z } else { f64::NEG_INFINITY }
            }
            Self::Cylinder { base, axis, radius, length } => {
                let beside = |i: usize, middle: f64| ([x, y][i] - middle).abs() - half;
                let across = |i: usize| beside(i, base[i]).max(0.0);
                // Along the axis: how far the square ends before the bar begins.
                let beyond = |i: usize| beside(i, base[i] + 0.5 * length) - 0.5 * length;
                let (rho, beyond, top) = match axis {
                    BarAxis::Z => (across(0).hypot(across(1)), 0.0, base.z + length),
                    BarAxis::X => (across(1), beyond(0), base.z),
                    BarAxis::Y => (across(0), beyond(1), base.z),
                };
                if rho > *radius || beyond > 0.0 {
                    f64::NEG_INFINITY
                } else if *axis == BarAxis::Z {
                    top
                } else {
                    top + (radius * radius - rho * rho).sqrt()
                }
            }
            Self::Mesh(stock) => stock.highest_within(x, y, half),
            Self::Roughed { .. } => self.traced_within(x, y, half),
            Self::Milled { block, cleared, floor } => {
                let top = Self::Box(*block).highest_within(x, y, half);
                if cleared.holds_square(&Point2::new(x, y), half) { top.min(*floor) } else { top }
            }
        }
    }

    fn traced_within(&self, x: f64, y: f64, half: f64) -> f64 {
        // A ball that touches nothing keeps the column free as far down as it covers it.
        let (reach, bounds) = (half * std::f64::consts::SQRT_2, self.bounds());
        let mut z = bounds.max.z;
        while z >= bounds.min.z - reach {
            let free = self.foot(&Point3::new(x, y, z)).0;
            let step = (free * free - reach * reach).max(0.0).sqrt();
            if free <= reach || step < TRACED {
                return z;
            }
            z -= step;
        }
        f64::NEG_INFINITY
    }

    /// A height at `(x, y)` at which stock stands, the highest or a little below; minus infinity where there
    /// is none.
    ///
    /// # Tolerance
    /// Exact; of a roughed block too low by 0.01 mm at most where the stock is thicker than that.
    pub fn height_at(&self, x: f64, y: f64) -> f64 {
        if !matches!(self, Self::Roughed { .. }) {
            return self.highest_within(x, y, 0.0);
        }
        let bounds = self.bounds();
        let mut z = bounds.max.z;
        while z >= bounds.min.z {
            let free = self.foot(&Point3::new(x, y, z)).0;
            if free <= 0.0 {
                return z;
            }
            z -= free.max(TRACED);
        }
        f64::NEG_INFINITY
    }

    /// Upward unit normal of what is seen from above at `(x, y)`.
    pub fn normal_at(&self, x: f64, y: f64) -> Vector3 {
        let z = self.height_at(x, y);
        let seen = match self {
            Self::Cylinder { base, axis: BarAxis::X, .. } => Vector3::new(0.0, y - base.y, z - base.z),
            Self::Cylinder { base, axis: BarAxis::Y, .. } => Vector3::new(x - base.x, 0.0, z - base.z),
            Self::Mesh(stock) => {
                let hit = stock.tree.highest_at(&stock.mesh, x, y);
                hit.map_or(Vector3::z(), |hit| stock.mesh.normal(hit.triangle as usize))
            }
            _ => Vector3::z(),
        };
        if z.is_finite() { seen.try_normalize(0.0).unwrap_or_else(Vector3::z) } else { Vector3::z() }
    }

    /// Signed distance, mm, below zero inside, and its unit gradient: exact; of a roughed block the greater
    /// of those of the block and of the surface, of a milled one that of the block: no greater than the true
    /// one.
    pub fn foot(&self, q: &Point3) -> (f64, Vector3) {
        match self {
            Self::Roughed { block, part, over } => {
                let (of_block, of_part) = (Self::Box(*block).foot(q), part.foot(q));
                let of_part = (of_part.0 - over, of_part.1);
                if of_block.0 > of_part.0 { of_block } else { of_part }
            }
            Self::Milled { block, .. } => Self::Box(*block).foot(q),
            Self::Box(bounds) => {
                let middle = bounds.min + bounds.size() * 0.5;
                let away = q - middle;
                let sign = away.map(|x| if x < 0.0 { -1.0 } else { 1.0 });
                let beyond = away.abs() - bounds.size() * 0.5;
                let outside = beyond.sup(&Vector3::zeros());
                let distance = outside.norm();
                if distance > 0.0 {
                    return (distance, outside.component_mul(&sign) / distance);
                }
                let face = beyond.imax();
                let mut gradient = Vector3::zeros();
                gradient[face] = sign[face];
                (beyond[face], gradient)
            }
            Self::Cylinder { base, axis, radius, length } => {
                let mut along = Vector3::zeros();
                along[*axis as usize] = 1.0;
                let away = q - base;
                let z = away[*axis as usize];
                let outward = away - along * z;
                let rho = outward.norm();
                let side = rho - radius;
                let (end, up) = if z > 0.5 * length { (z - length, along) } else { (-z, -along) };
                let away = Vector3::ith((*axis as usize + 1) % 3, 1.0);
                let radial = if rho > 0.0 { outward / rho } else { away };
                match (side > 0.0, end > 0.0) {
                    (true, true) => {
                        let distance = side.hypot(end);
                        (distance, (radial * side + up * end) / distance)
                    }
                    _ if side > end => (side, radial),
                    _ => (end, up),
                }
            }
            Self::Mesh(stock) => stock.foot(q),
        }
    }
}

/// Corner `k` of a cube of half side 1.
pub(crate) fn corner(k: usize) -> Vector3 {
    let side = |bit: usize| if k >> bit & 1 == 1 { 1.0 } else { -1.0 };
    Vector3::new(side(0), side(1), side(2))
}

impl StockMesh {
    fn highest_within(&self, x: f64, y: f64, half: f64) -> f64 {
        if half == 0.0 {
            return self.tree.highest_at(&self.mesh, x, y).map_or(f64::NEG_INFINITY, |hit| hit.z);
        }
        let (low, high) = ([x - half, y - half], [x + half, y + half]);
        let mut highest = f64::NEG_INFINITY;
        self.tree.tree().search(
            highest,
            |_, node, _| if node.meets(low, high) { node.top() } else { f64::NEG_INFINITY },
            |slot, _| {
                let corners = self.mesh.corners(self.tree.triangle_in(slot));
                highest = highest.max(highest_in(&corners, low, high));
                highest
            },
        );
        highest
    }

    fn foot(&self, q: &Point3) -> (f64, Vector3) {
        let foot = self.tree.closest_point(&self.mesh, q);
        let distance = foot.signed_distance;
        let gradient = (q - foot.point) / distance;
        (distance, if distance.abs() > 1e-9 { gradient } else { foot.normal })
    }
}

/// The highest place of a triangle over a rectangle of the plan view; minus infinity where it lies beside it.
fn highest_in(corners: &[Point3; 3], low: [f64; 2], high: [f64; 2]) -> f64 {
    let mut polygon = corners.to_vec();
    for (axis, sign, end) in [(0, 1.0, low[0]), (1, 1.0, low[1]), (0, -1.0, high[0]), (1, -1.0, high[1])] {
        let inside = |p: &Point3| sign * (p[axis] - end);
        polygon = clipped(&polygon, inside);
    }
    polygon.iter().map(|p| p.z).fold(f64::NEG_INFINITY, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A pyramid over a square: what is seen from above, and the greatest height over squares, against many
    /// places in them.
    #[test]
    fn heights_of_a_mesh_are_those_of_its_triangles() {
        let at = Point3::new;
        let vertices = vec![
            at(0.0, 0.0, -3.0),
            at(10.0, 0.0, -3.0),
            at(10.0, 10.0, -3.0),
            at(0.0, 10.0, -3.0),
            at(5.0, 5.0, 2.0),
        ];
        let triangles = vec![[0, 2, 1], [0, 3, 2], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]];
        let pyramid = Stock::from_mesh(TriangleMesh::new(vertices, triangles).unwrap().0).unwrap();
        let height = |x: f64, y: f64| {
            let beside = (x - 5.0).abs().max((y - 5.0).abs());
            if beside > 5.0 { f64::NEG_INFINITY } else { 2.0 - beside }
        };
        for (x, y) in [(5.0, 5.0), (1.0, 2.0), (9.9, 4.0), (10.2, 5.0), (3.3, 8.7)] {
            let (got, true_one) = (pyramid.height_at(x, y), height(x, y));
            assert!(got == true_one || (got - true_one).abs() < 1e-9, "{x} {y}: {got} {true_one}");
            for half in [0.05, 0.4, 3.0] {
                let places = (0..=200).flat_map(|i| (0..=200).map(move |j| (f64::from(i), f64::from(j))));
                let near =
                    places.map(|(i, j)| height(x + half * (0.01 * i - 1.0), y + half * (0.01 * j - 1.0)));
                let (greatest, bound) =
                    (near.fold(f64::NEG_INFINITY, f64::max), pyramid.highest_within(x, y, half));
                assert!(
                    bound >= greatest - 1e-9 && bound <= greatest + 0.02 * half,
                    "{x} {y} {half}: {bound} {greatest}"
                );
            }
        }
        let normal = pyramid.normal_at(2.0, 5.0);
        assert!((normal - Vector3::new(-1.0, 0.0, 1.0).normalize()).norm() < 1e-9, "{normal:?}");
    }

    /// A block with a square pocket that runs out of one side: heights, greatest heights over squares,
    /// volume.
    #[test]
    fn a_milled_block_stands_beside_what_was_cleared() {
        let at = Point3::new;
        let block = Aabb { min: at(0.0, 0.0, -20.0), max: at(20.0, 20.0, 0.0) };
        let square = [(15.0, 5.0), (30.0, 5.0), (30.0, 12.0), (15.0, 12.0)];
        let cleared = Region::nested(vec![square.map(|(x, y)| Point2::new(x, y)).to_vec()]).unwrap().0;
        let stock = Stock::milled(block, &cleared, -6.0);
        for (x, y, height) in [(16.0, 6.0, -6.0), (14.9, 6.0, 0.0), (20.1, 6.0, f64::NEG_INFINITY)] {
            assert_eq!(stock.height_at(x, y), height);
        }
        assert_eq!((stock.highest_within(17.0, 8.0, 1.9), stock.highest_within(17.0, 8.0, 2.1)), (-6.0, 0.0));
        assert!((stock.volume().unwrap() - (8000.0 - 5.0 * 7.0 * 6.0)).abs() < 1e-4);
        assert!(stock.foot(&at(17.0, 8.0, -3.0)).0 < 0.0 && stock.bounds() == block);
    }

    #[test]
    fn heights_of_a_bar_and_of_a_roughed_block_have_closed_forms() {
        let bar = Stock::Cylinder { base: Point3::origin(), axis: BarAxis::X, radius: 10.0, length: 40.0 };
        for y in [0.0f64, 3.0, 9.0] {
            let top = (100.0 - y * y).sqrt();
            let at = bar.height_at(20.0, y);
            assert!((at - top).abs() < 1e-12, "{y} {at} {top}");
            let near = (100.0 - (y - 0.5f64).max(0.0).powi(2)).sqrt();
            let bound = bar.highest_within(20.0, y, 0.5);
            assert!((bound - near).abs() < 1e-12, "{y} {bound} {near}");
        }
        assert_eq!(bar.height_at(20.0, 10.1), f64::NEG_INFINITY);
        assert_eq!(bar.highest_within(20.0, 12.0, 0.5), f64::NEG_INFINITY);
        let at = Point3::new;
        let floor = TriangleMesh::new(
            vec![at(0.0, 0.0, -8.0), at(20.0, 0.0, -8.0), at(0.0, 20.0, -8.0)],
            vec![[0, 1, 2]],
        );
        let block = Aabb { min: at(0.0, 0.0, -20.0), max: at(20.0, 20.0, 0.0) };
        let roughed = Stock::roughed(block, floor.unwrap().0, 0.5);
        for half in [0.0, 0.25] {
            let bound = roughed.highest_within(4.0, 5.0, half);
            assert!((-7.5..-7.0).contains(&bound), "{half} {bound}");
        }
        assert!((roughed.height_at(4.0, 5.0) + 7.5).abs() < 0.011);
        let whole = Stock::Box(block);
        assert_eq!((whole.height_at(1.0, 1.0), whole.highest_within(-0.2, 1.0, 0.25)), (0.0, 0.0));
        assert_eq!(whole.height_at(-0.2, 1.0), f64::NEG_INFINITY);
    }
}
