//! The cut stock as a closed triangle mesh, fine where the surface bends and coarse where it is
//! flat.
//!
//! The top is a right-triangulated irregular network (Evans, Kirkpatrick and Townsend 2001): right
//! triangles over the grid of cell centres, halved at the middle of their longest side. A side is
//! halved exactly when the bound stored at its middle exceeds the tolerance. Both triangles at a
//! side read the same bound, and a bound is never less than those of the halves (Lindstrom and
//! others 1996), so that no crack can open.
//!
//! The bound of a middle is its own distance from the side plus the greatest bound of the four
//! middles below it. Since the linear interpolants of two following levels differ by at most the
//! distances of the middles between them, no cell is farther from the mesh than the tolerance,
//! measured vertically.

use crate::sim::ZMap;

/// More triangles than this and the tolerance is grown: programs that view STL files grow slow, and a
/// file takes 50 bytes a triangle. On a map of 2000 × 2000 cells with ridges of 10 µm, 500 000 only
/// hold 11 µm, a million hold 7 µm, and a quarter of the ridges would take 2.1 million (105 MB);
/// height.exr has every cell.
pub const MAX_TRIANGLES: usize = 1_000_000;

/// Side of the squares from which halving starts, cells (a power of two). Greater squares allow
/// greater triangles on flat ground, but more of the last row of squares hangs over the border.
const MAX_SQUARE: usize = 256;

/// Least tolerance, mm: below a nanometre heights are rounding noise.
const LEAST_TOLERANCE: f64 = 1e-6;

/// Factor by which the tolerance grows while there are too many triangles, and how often the last
/// such step is then halved: 2^(1/8) is 9 % more than the least tolerance at most.
const GROWTH: f64 = 2.0;
const HALVINGS: usize = 3;

/// A closed triangle mesh, counter-clockwise seen from outside.
#[derive(Debug, Clone, PartialEq)]
pub struct SurfaceMesh {
    /// Vertices, mm.
    pub vertices: Vec<[f32; 3]>,
    /// Vertex indices.
    pub triangles: Vec<[u32; 3]>,
    /// No cell lies farther above or below the top than this, mm.
    pub tolerance: f64,
}

/// A node of the grid, in cells; nodes beyond the grid's last row and column hold no height.
type Node = (usize, usize);

/// The solid between the cut surface and a flat bottom at height `bottom` (mm, below every cell).
/// Its walls stand at the centres of the outermost cells.
///
/// `None` for a grid of a single row or column, which spans no surface.
///
/// # Tolerance
/// The top stays within `tolerance` (mm, vertically) of every cell, or within the
/// [`SurfaceMesh::tolerance`] that `max_triangles` allows, if that is greater.
pub fn surface_mesh(cut: &ZMap, bottom: f64, tolerance: f64, max_triangles: usize) -> Option<SurfaceMesh> {
    if cut.grid.nx < 2 || cut.grid.ny < 2 {
        return None;
    }
    let network = Network::new(cut);
    let tolerance = network.least_tolerance(tolerance.max(LEAST_TOLERANCE), max_triangles);
    let index = vec![NO_VERTEX; cut.grid.len()];
    let mut solid = Solid { cut, vertices: Vec::new(), triangles: Vec::new(), index };
    network.visit(tolerance, &mut |corners| {
        let triangle = corners.map(|node| solid.vertex(node));
        solid.triangles.push(triangle);
        true
    });
    solid.close(bottom);
    Some(SurfaceMesh { vertices: solid.vertices, triangles: solid.triangles, tolerance })
}

/// The bounds at all middles, over whole squares that cover the grid.
struct Network<'a> {
    cut: &'a ZMap,
    /// Side of a square, cells.
    square: usize,
    /// Nodes along x and y: whole squares, and one.
    width: usize,
    height: usize,
    bound: Vec<f32>,
    /// Greatest finite bound.
    coarsest: f64,
}

impl<'a> Network<'a> {
    fn new(cut: &'a ZMap) -> Self {
        let longest = cut.grid.nx.max(cut.grid.ny) - 1;
        let square = longest.next_power_of_two().min(MAX_SQUARE);
        let whole = |nodes: usize| (nodes - 1).div_ceil(square) * square + 1;
        let (width, height) = (whole(cut.grid.nx), whole(cut.grid.ny));
        let mut network =
            Self { cut, square, width, height, bound: vec![0.0; width * height], coarsest: 0.0 };
        // From the smallest triangles up, since a bound holds those below it.
        let mut size = 2;
        while size <= square {
            network.bound_sides(size);
            network.bound_squares(size);
            size *= 2;
        }
        let finite = network.bound.iter().copied().filter(|b| b.is_finite());
        network.coarsest = f64::from(finite.fold(0.0, f32::max));
        network
    }

    /// Bounds at the middles of the sides of all squares of this size.
    fn bound_sides(&mut self, size: usize) {
        let half = size / 2;
        for y in (0..self.height).step_by(half) {
            let lying = y % size == 0;
            for x in (if lying { half } else { 0 }..self.width).step_by(size) {
                let (a, b) =
                    if lying { ((x - half, y), (x + half, y)) } else { ((x, y - half), (x, y + half)) };
                // The side's two triangles reach half a square to either hand.
                let across = if lying { (0, half) } else { (half, 0) };
                let behind = (a.0.saturating_sub(across.0), a.1.saturating_sub(across.1));
                let ahead = (b.0 + across.0, b.1 + across.1);
                let over = self.hangs_over(a, ahead) || self.hangs_over(behind, b);
                let quarter = (size / 4) as i64;
                let below =
                    [(-quarter, -quarter), (quarter, -quarter), (-quarter, quarter), (quarter, quarter)];
                self.bound_middle((x, y), a, b, over, if quarter > 0 { &below } else { &[] });
            }
        }
    }

    /// Bounds at the middles of all squares of this size.
    fn bound_squares(&mut self, size: usize) {
        let half = size / 2;
        let step = half as i64;
        for y in (half..self.height).step_by(size) {
            for x in (half..self.width).step_by(size) {
                let corner = (x - half, y - half);
                let (a, b) = diagonal(corner, size);
                let over = self.hangs_over(corner, (x + half, y + half));
                self.bound_middle((x, y), a, b, over, &[(-step, 0), (step, 0), (0, -step), (0, step)]);
            }
        }
    }

    /// The bound at `middle` of the side from `a` to `b`, from those `below` it (relative nodes).
    fn bound_middle(&mut self, middle: Node, a: Node, b: Node, hangs_over: bool, below: &[(i64, i64)]) {
        let own = match (self.node_height(middle), self.node_height(a), self.node_height(b)) {
            (Some(z), Some(za), Some(zb)) => (z - 0.5 * (za + zb)).abs(),
            _ => 0.0,
        };
        let mut bound = 0.0f32;
        for (dx, dy) in below {
            let (x, y) = (middle.0 as i64 + dx, middle.1 as i64 + dy);
            if (0..self.width as i64).contains(&x) && (0..self.height as i64).contains(&y) {
                bound = bound.max(self.bound[y as usize * self.width + x as usize]);
            }
        }
        // Triangles across the grid's border must be halved down to the border.
        let whole = if hangs_over { f32::INFINITY } else { own as f32 + bound };
        self.bound[middle.1 * self.width + middle.0] = whole;
    }

    fn node_height(&self, (x, y): Node) -> Option<f64> {
        let grid = &self.cut.grid;
        (x < grid.nx && y < grid.ny).then(|| f64::from(self.cut.height[grid.index(x, y)]))
    }

    /// True when the rectangle lies partly on the grid and partly beyond it.
    fn hangs_over(&self, least: Node, greatest: Node) -> bool {
        let (right, top) = (self.cut.grid.nx - 1, self.cut.grid.ny - 1);
        least.0 < right && least.1 < top && (greatest.0 > right || greatest.1 > top)
    }

    /// Hands every triangle to `emit` until that returns false.
    fn visit(&self, tolerance: f64, emit: &mut dyn FnMut([Node; 3]) -> bool) {
        for y in (0..self.height - 1).step_by(self.square) {
            for x in (0..self.width - 1).step_by(self.square) {
                let far = (x + self.square, y + self.square);
                let (south_west, south_east, north_west, north_east) = ((x, y), (far.0, y), (x, far.1), far);
                let two = if diagonal((x, y), self.square).0 == south_west {
                    [[south_east, north_east, south_west], [north_west, south_west, north_east]]
                } else {
                    [[north_east, north_west, south_east], [south_west, south_east, north_west]]
                };
                if !two.into_iter().all(|corners| self.halve(corners, tolerance, emit)) {
                    return;
                }
            }
        }
    }

    /// `corners` begin at the right angle and run counter-clockwise.
    fn halve(&self, corners: [Node; 3], tolerance: f64, emit: &mut dyn FnMut([Node; 3]) -> bool) -> bool {
        let [apex, a, b] = corners;
        let least = (apex.0.min(a.0).min(b.0), apex.1.min(a.1).min(b.1));
        if least.0 >= self.cut.grid.nx - 1 || least.1 >= self.cut.grid.ny - 1 {
            return true;
        }
        let unit = (a.0 + b.0) % 2 == 1;
        let middle = ((a.0 + b.0) / 2, (a.1 + b.1) / 2);
        if unit || f64::from(self.bound[middle.1 * self.width + middle.0]) <= tolerance {
            return emit(corners);
        }
        self.halve([middle, apex, a], tolerance, emit) && self.halve([middle, b, apex], tolerance, emit)
    }

    /// The least tolerance from `tolerance` up (about) that needs no more than `max_triangles`.
    fn least_tolerance(&self, mut tolerance: f64, max_triangles: usize) -> f64 {
        let mut factor = 1.0;
        while self.exceeds(tolerance, max_triangles) && tolerance < self.coarsest {
            factor = GROWTH;
            tolerance *= factor;
        }
        for _ in 0..if factor > 1.0 { HALVINGS } else { 0 } {
            factor = factor.sqrt();
            if !self.exceeds(tolerance / factor, max_triangles) {
                tolerance /= factor;
            }
        }
        tolerance
    }

    fn exceeds(&self, tolerance: f64, max_triangles: usize) -> bool {
        let mut count = 0;
        self.visit(tolerance, &mut |_| {
            count += 1;
            count <= max_triangles
        });
        count > max_triangles
    }
}

/// Ends of the diagonal along which a square is cut in two, the left one first. Squares alternate
/// like a chessboard, so that the diagonals of the four quarters of a square meet in its middle.
fn diagonal((x, y): Node, size: usize) -> (Node, Node) {
    if (x / size + y / size).is_multiple_of(2) {
        ((x, y), (x + size, y + size))
    } else {
        ((x, y + size), (x + size, y))
    }
}

/// In [`Solid::index`]: a node that is no vertex.
const NO_VERTEX: u32 = u32::MAX;

/// The mesh while it grows.
struct Solid<'a> {
    cut: &'a ZMap,
    vertices: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    /// Vertex at each cell's centre.
    index: Vec<u32>,
}

impl Solid<'_> {
    fn push(&mut self, vertex: [f32; 3]) -> u32 {
        self.vertices.push(vertex);
        (self.vertices.len() - 1) as u32
    }

    fn vertex(&mut self, node: Node) -> u32 {
        let cell = self.cut.grid.index(node.0, node.1);
        if self.index[cell] == NO_VERTEX {
            let centre = self.cut.grid.centre(node.0, node.1);
            self.index[cell] = self.push([centre.x as f32, centre.y as f32, self.cut.height[cell]]);
        }
        self.index[cell]
    }

    /// Adds walls and bottom.
    fn close(&mut self, bottom: f64) {
        let (right, back) = (self.cut.grid.nx - 1, self.cut.grid.ny - 1);
        // Once round, counter-clockwise seen from above.
        let front = (0..right).map(|x| (x, 0));
        let east = (0..back).map(|y| (right, y));
        let rear = (1..=right).rev().map(|x| (x, back));
        let west = (1..=back).rev().map(|y| (0, y));
        let rim: Vec<u32> = front
            .chain(east)
            .chain(rear)
            .chain(west)
            .map(|(x, y)| self.index[self.cut.grid.index(x, y)])
            .filter(|vertex| *vertex != NO_VERTEX)
            .collect();
        let bottom = bottom as f32;
        let feet: Vec<u32> = rim
            .iter()
            .map(|k| {
                let [x, y, _] = self.vertices[*k as usize];
                self.push([x, y, bottom])
            })
            .collect();
        let (low, high) = (self.cut.grid.centre(0, 0), self.cut.grid.centre(right, back));
        let hub = self.push([(0.5 * (low.x + high.x)) as f32, (0.5 * (low.y + high.y)) as f32, bottom]);
        for k in 0..rim.len() {
            let next = (k + 1) % rim.len();
            self.triangles.push([feet[k], feet[next], rim[next]]);
            self.triangles.push([feet[k], rim[next], rim[k]]);
            self.triangles.push([hub, feet[next], feet[k]]);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use super::*;
    use crate::geometry::Point2;
    use crate::sim::Grid;

    fn map(nx: usize, ny: usize, height: impl Fn(f64, f64) -> f64) -> ZMap {
        let grid = Grid { origin: Point2::new(-3.0, 2.0), cell: 0.1, nx, ny };
        let mut map = ZMap::block(grid, 0.0);
        for (j, i) in (0..ny).flat_map(|j| (0..nx).map(move |i| (j, i))) {
            let centre = grid.centre(i, j);
            map.height[grid.index(i, j)] = height(centre.x, centre.y) as f32;
        }
        map
    }

    fn wavy(x: f64, y: f64) -> f64 {
        (0.8 * x).sin() * (1.3 * y).cos() + 0.05 * (9.0 * x).sin().abs()
    }

    /// Greatest vertical distance of a cell from the top, and the number of cells found under it.
    fn distance(map: &ZMap, mesh: &SurfaceMesh) -> (f64, usize) {
        let grid = map.grid;
        let mut found = vec![false; grid.len()];
        let mut worst = 0f64;
        for t in &mesh.triangles {
            let corners = t.map(|k| mesh.vertices[k as usize].map(f64::from));
            let node = |p: [f64; 3]| ((p[0] - grid.origin.x) / grid.cell, (p[1] - grid.origin.y) / grid.cell);
            let [(ax, ay), (bx, by), (cx, cy)] = corners.map(node);
            let area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay);
            if area < 0.5 {
                continue; // walls and bottom
            }
            let range =
                |a: f64, b: f64, c: f64| a.min(b).min(c).round() as usize..=a.max(b).max(c).round() as usize;
            for j in range(ay, by, cy) {
                for i in range(ax, bx, cx) {
                    let (x, y) = (i as f64, j as f64);
                    let wa = ((bx - x) * (cy - y) - (cx - x) * (by - y)) / area;
                    let wb = ((cx - x) * (ay - y) - (ax - x) * (cy - y)) / area;
                    let wc = 1.0 - wa - wb;
                    if wa > -1e-4 && wb > -1e-4 && wc > -1e-4 {
                        let z = wa * corners[0][2] + wb * corners[1][2] + wc * corners[2][2];
                        worst = worst.max((z - f64::from(map.height[grid.index(i, j)])).abs());
                        found[grid.index(i, j)] = true;
                    }
                }
            }
        }
        (worst, found.iter().filter(|f| **f).count())
    }

    fn volume(mesh: &SurfaceMesh) -> f64 {
        let corner = |k: u32| nalgebra::Vector3::from(mesh.vertices[k as usize].map(f64::from));
        mesh.triangles.iter().map(|t| corner(t[0]).cross(&corner(t[1])).dot(&corner(t[2])) / 6.0).sum()
    }

    fn assert_closed(mesh: &SurfaceMesh) {
        let mut edges = HashMap::new();
        for t in &mesh.triangles {
            for k in 0..3 {
                *edges.entry((t[k], t[(k + 1) % 3])).or_insert(0) += 1;
            }
        }
        for ((a, b), count) in &edges {
            assert_eq!((*count, edges.get(&(*b, *a))), (1, Some(&1)), "edge {a} {b}");
        }
    }

    #[test]
    fn every_cell_is_within_the_tolerance_and_the_solid_is_closed() {
        for (nx, ny) in [(2, 2), (3, 2), (65, 65), (70, 33), (300, 130), (5, 600), (258, 257)] {
            let map = map(nx, ny, wavy);
            for tolerance in [1e-6, 0.002, 0.05, 10.0] {
                let mesh = surface_mesh(&map, -5.0, tolerance, usize::MAX).unwrap();
                let (worst, found) = distance(&map, &mesh);
                assert!(worst <= tolerance + 1e-6, "{nx} x {ny}: {worst} at {tolerance}");
                assert_eq!(found, map.grid.len(), "{nx} x {ny}: the top has holes");
                assert_closed(&mesh);
            }
        }
    }

    #[test]
    fn a_plane_needs_few_triangles_and_has_its_volume() {
        let map = map(257, 257, |x, y| 1.0 + 0.1 * x - 0.2 * y);
        let mesh = surface_mesh(&map, -10.0, 1e-3, MAX_TRIANGLES).unwrap();
        // Two on top, and a wall and a bottom triangle or three a rim edge.
        assert_eq!(mesh.triangles.len(), 2 + 4 * 3);
        let side = 25.6;
        let middle = 1.0 + 0.1 * (-3.0 + 12.8) - 0.2 * (2.0 + 12.8);
        assert!((volume(&mesh) / (side * side * (middle + 10.0)) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn the_tolerance_grows_until_the_triangles_fit() {
        let map = map(257, 257, wavy);
        let fine = surface_mesh(&map, -5.0, 1e-4, usize::MAX).unwrap();
        let coarse = surface_mesh(&map, -5.0, 1e-4, 5000).unwrap();
        assert!(fine.triangles.len() > 20_000 && coarse.triangles.len() < 10_000);
        assert!(coarse.tolerance > 1e-4);
        let finer = surface_mesh(&map, -5.0, coarse.tolerance / 1.1, usize::MAX).unwrap();
        assert!(finer.triangles.len() > 5000, "no finer one would have fitted");
        assert!(distance(&map, &coarse).0 <= coarse.tolerance);
    }

    #[test]
    fn a_single_row_spans_no_surface() {
        assert_eq!(surface_mesh(&map(5, 1, wavy), -5.0, 0.01, 100), None);
    }
}
