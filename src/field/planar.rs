//! A flow that follows walls: a smooth function on a plane piece with islands whose level curves are the
//! walls at its edge and grow round inside.
//!
//! Enters: a piece. Leaves: a triangulation (constrained Delaunay with Ruppert's refinement, by `spade`),
//! the function ψ at its vertices, mm, and closed level curves.
//!
//! ψ solves `|∇ψ|² − σ Δψ = 1` with ψ = 0 on all walls: the distance from the walls, made smooth over the
//! length σ. With `u = exp(−ψ/σ)` this is the linear equation `u − σ² Δu = 0`, u = 1 on the walls
//! (S. R. S. Varadhan, Comm. Pure Appl. Math. 20, 1967; K. Crane et al., ACM Trans. Graph. 32, 2013). For
//! small σ level curves are offsets of the walls, for large σ those of −Δψ = 1/σ (M. B. Bieterman and D. R.
//! Sandstrom, J. Manuf. Sci. Eng. 125, 2003). Linear finite elements with lumped mass on a Delaunay mesh
//! make an M-matrix, so that 0 < u ≤ 1 holds in the discrete solution as well.

use std::collections::HashMap;

use spade::{AngleLimit, ConstrainedDelaunayTriangulation, RefinementParameters, Triangulation as _};

use super::sparse::{Entry, solve};
use geometry::{Piece, Point2};

/// Least angle that refinement aims at, degrees. Below 20.7 it is proven to end; greater ones make more
/// triangles and no better levels.
const LEAST_ANGLE: f64 = 20.0;

/// Vertices that are added to a piece for each of its corners, at most, to fill it without slivers.
const MOST_ADDED: usize = 8;

/// Most vertices of a mesh: some 300 MiB while its equations are solved.
pub const MAX_VERTICES: usize = 400_000;

/// ψ/σ beyond this is lost to rounding of u.
const DEEPEST: f64 = 30.0;

/// Why there is no flow on a piece.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum PlanarError {
    /// The outline crosses itself or has too few corners.
    #[error("the piece could not be triangulated")]
    Triangulation,
    /// The mesh would be too large.
    #[error("the piece needs more than {MAX_VERTICES} vertices; use a greater stepover")]
    TooLarge,
    /// The equations have no solution.
    #[error("the flow's equations are singular")]
    Singular,
}

/// Triangles that fill a piece.
#[derive(Debug, Clone)]
pub struct PlanarMesh {
    points: Vec<Point2>,
    triangles: Vec<[u32; 3]>,
    wall: Vec<bool>,
    /// The sides of each triangle, from corner k to the next, as numbers of edges.
    sides: Vec<[u32; 3]>,
}

/// Corners, triangles, and which corners lie on walls.
type Triangles = (Vec<Point2>, Vec<[u32; 3]>, Vec<bool>);

/// Corners of a triangulation of a piece, counter-clockwise, and which lie on its walls. With `edge` no
/// triangle is larger than an equilateral one of that side, mm; without it as few are added as keep
/// triangles from being slivers.
fn triangulate(piece: &Piece, edge: Option<f64>) -> Result<Triangles, PlanarError> {
    let mut vertices = Vec::new();
    let mut edges = Vec::new();
    for curve in piece.curves() {
        let (first, n) = (vertices.len(), curve.len());
        vertices.extend(curve.iter().map(|p| spade::Point2::new(p.x, p.y)));
        edges.extend((0..n).map(|k| [first + k, first + (k + 1) % n]));
    }
    let corners = vertices.len();
    let mut conflicts = 0usize;
    let mut cdt: ConstrainedDelaunayTriangulation<spade::Point2<f64>> =
        ConstrainedDelaunayTriangulation::try_bulk_load_cdt(vertices, edges, |_| conflicts += 1)
            .map_err(|_| PlanarError::Triangulation)?;
    if conflicts > 0 {
        return Err(PlanarError::Triangulation);
    }
    let mut parameters = RefinementParameters::new().exclude_outer_faces(true);
    parameters = match edge {
        Some(edge) => parameters
            .with_angle_limit(AngleLimit::from_deg(LEAST_ANGLE))
            .with_max_allowed_area(0.433 * edge * edge)
            .with_max_additional_vertices(MAX_VERTICES),
        None => parameters
            .with_angle_limit(AngleLimit::from_deg(LEAST_ANGLE))
            .with_max_additional_vertices(MOST_ADDED * corners),
    };
    let refined = cdt.refine(parameters);
    if edge.is_some() && !refined.refinement_complete {
        return Err(PlanarError::TooLarge);
    }
    let mut outside = vec![false; cdt.num_all_faces()];
    refined.excluded_faces.iter().for_each(|f| outside[f.index()] = true);
    let mut on_wall = vec![false; cdt.num_vertices()];
    for e in cdt.undirected_edges().filter(|e| e.is_constraint_edge()) {
        e.vertices().iter().for_each(|v| on_wall[v.fix().index()] = true);
    }
    let mut name = vec![u32::MAX; cdt.num_vertices()];
    let (mut points, mut triangles, mut wall) = (Vec::new(), Vec::new(), Vec::new());
    for face in cdt.inner_faces().filter(|f| !outside[f.fix().index()]) {
        triangles.push(face.vertices().map(|v| {
            let k = v.fix().index();
            if name[k] == u32::MAX {
                name[k] = points.len() as u32;
                points.push(Point2::new(v.position().x, v.position().y));
                wall.push(on_wall[k]);
            }
            name[k]
        }));
    }
    if triangles.is_empty() {
        return Err(PlanarError::Triangulation);
    }
    Ok((points, triangles, wall))
}

/// The piece as few triangles, counter-clockwise, hardly any of which are slivers.
///
/// # Errors
/// [`PlanarError::Triangulation`].
pub fn fill(piece: &Piece) -> Result<(Vec<Point2>, Vec<[u32; 3]>), PlanarError> {
    triangulate(piece, None).map(|(points, triangles, _)| (points, triangles))
}

impl PlanarMesh {
    /// Triangles of sides of some `edge` mm or less.
    ///
    /// # Errors
    /// [`PlanarError`].
    pub fn new(piece: &Piece, edge: f64) -> Result<Self, PlanarError> {
        if piece.area() / (0.433 * edge * edge) > 2.0 * MAX_VERTICES as f64 {
            return Err(PlanarError::TooLarge);
        }
        let (points, triangles, wall) = triangulate(piece, Some(edge))?;
        let mut names: HashMap<[u32; 2], u32> = HashMap::with_capacity(triangles.len() * 2);
        let sides = triangles
            .iter()
            .map(|t| {
                [0, 1, 2].map(|k| {
                    let (a, b) = (t[k], t[(k + 1) % 3]);
                    let next = names.len() as u32;
                    *names.entry([a.min(b), a.max(b)]).or_insert(next)
                })
            })
            .collect();
        Ok(Self { points, triangles, wall, sides })
    }

    /// The vertices.
    pub fn points(&self) -> &[Point2] {
        &self.points
    }

    /// Corners of the triangles, counter-clockwise.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// ψ at every vertex, mm, for the smoothing length `sigma`, mm. `deepest` is a bound of the distance
    /// from the walls; σ is at least a thirtieth of it.
    ///
    /// # Errors
    /// [`PlanarError::Singular`].
    pub fn flow(&self, sigma: f64, deepest: f64) -> Result<Vec<f64>, PlanarError> {
        let sigma = sigma.max(deepest / DEEPEST);
        let mut unknown = vec![u32::MAX; self.points.len()];
        let mut count = 0;
        for (k, _) in self.wall.iter().enumerate().filter(|(_, wall)| !**wall) {
            unknown[k] = count;
            count += 1;
        }
        // For w = 1 − u: (σ² K + M) w = M 1, w = 0 on the walls; small w keep their digits.
        let mut entries = Vec::with_capacity(self.triangles.len() * 6);
        let mut b = vec![0.0; count as usize];
        for t in &self.triangles {
            let p = t.map(|v| self.points[v as usize]);
            let area = 0.5 * (p[1] - p[0]).perp(&(p[2] - p[0]));
            let side = [0, 1, 2].map(|k| p[(k + 2) % 3] - p[(k + 1) % 3]);
            for i in 0..3 {
                let row = unknown[t[i] as usize];
                if row == u32::MAX {
                    continue;
                }
                b[row as usize] += area / 3.0;
                for j in 0..3 {
                    let column = unknown[t[j] as usize];
                    if column == u32::MAX || column > row {
                        continue;
                    }
                    let stiffness = sigma * sigma * side[i].dot(&side[j]) / (4.0 * area);
                    let mass = if i == j { area / 3.0 } else { 0.0 };
                    entries.push(Entry::new(row, column, stiffness + mass));
                }
            }
        }
        solve(&entries, &mut b).ok_or(PlanarError::Singular)?;
        let psi = |k: usize| match unknown[k] {
            u32::MAX => 0.0,
            row => -sigma * (-b[row as usize].clamp(0.0, 1.0 - 1e-15)).ln_1p(),
        };
        Ok((0..self.points.len()).map(psi).collect())
    }

    /// The connected sets of those `triangles` that reach above `level`: for each its triangles.
    pub fn above(&self, values: &[f64], level: f64, triangles: &[u32]) -> Vec<Vec<u32>> {
        let mut parent: HashMap<u32, u32> = HashMap::new();
        fn root(parent: &mut HashMap<u32, u32>, mut v: u32) -> u32 {
            loop {
                let p = *parent.entry(v).or_insert(v);
                if p == v {
                    return v;
                }
                let grand = *parent.entry(p).or_insert(p);
                parent.insert(v, grand);
                v = grand;
            }
        }
        let high = |t: u32| {
            let corners = self.triangles[t as usize];
            corners.into_iter().filter(|v| values[*v as usize] > level)
        };
        for &t in triangles {
            let mut corners = high(t);
            let Some(first) = corners.next() else { continue };
            for v in corners {
                let (a, b) = (root(&mut parent, first), root(&mut parent, v));
                parent.insert(a.max(b), a.min(b));
            }
        }
        let mut place: HashMap<u32, usize> = HashMap::new();
        let mut sets: Vec<Vec<u32>> = Vec::new();
        for &t in triangles {
            let Some(v) = high(t).next() else { continue };
            let r = root(&mut parent, v);
            let k = *place.entry(r).or_insert_with(|| {
                sets.push(Vec::new());
                sets.len() - 1
            });
            sets[k].push(t);
        }
        sets
    }

    /// The level curves in `triangles`, closed, higher values on the left.
    pub fn level_curves(&self, values: &[f64], level: f64, triangles: &[u32]) -> Vec<Vec<Point2>> {
        // From the side where a curve enters a triangle to that where it leaves.
        let mut next: HashMap<u32, (u32, Point2)> = HashMap::new();
        let mut order = Vec::new();
        for &t in triangles {
            let (corners, sides) = (self.triangles[t as usize], self.sides[t as usize]);
            let high = corners.map(|v| values[v as usize] > level);
            let (mut enter, mut leave) = (None, None);
            for k in 0..3 {
                let l = (k + 1) % 3;
                if high[k] == high[l] {
                    continue;
                }
                let (a, b) = (corners[k].min(corners[l]) as usize, corners[k].max(corners[l]) as usize);
                let share = (level - values[a]) / (values[b] - values[a]);
                let at = self.points[a] + (self.points[b] - self.points[a]) * share;
                // Counter-clockwise around the triangle: going down leaves with the high side on the left.
                if high[k] { enter = Some((sides[k], at)) } else { leave = Some(sides[k]) }
            }
            if let (Some((from, at)), Some(to)) = (enter, leave) {
                next.insert(from, (to, at));
                order.push(from);
            }
        }
        let mut curves = Vec::new();
        for start in order {
            let mut curve = Vec::new();
            let mut side = start;
            let closed = loop {
                let Some((to, at)) = next.remove(&side) else { break false };
                if curve.last() != Some(&at) {
                    curve.push(at);
                }
                side = to;
                if side == start {
                    break true;
                }
            };
            if closed && curve.len() > 2 {
                curves.push(curve);
            }
        }
        curves
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::signed_area;
    use std::f64::consts::TAU;

    fn circle(r: f64, n: usize, clockwise: bool) -> Vec<Point2> {
        let sense = if clockwise { -1.0 } else { 1.0 };
        (0..n)
            .map(|k| sense * TAU * k as f64 / n as f64)
            .map(|a| Point2::new(r * a.cos(), r * a.sin()))
            .collect()
    }

    /// Modified Bessel function of order 0, by its series.
    fn bessel(x: f64) -> f64 {
        let (mut term, mut sum) = (1.0, 1.0);
        for k in 1..200 {
            term *= (0.5 * x / f64::from(k)).powi(2);
            sum += term;
        }
        sum
    }

    /// In a disc u = I₀(ρ/σ) / I₀(R/σ); the error falls with the square of the mesh.
    #[test]
    fn the_flow_in_a_disc_is_that_of_bessel() {
        let (radius, sigma) = (10.0, 2.5);
        let piece = Piece { outer: circle(radius, 400, false), islands: vec![] };
        let error = |edge: f64| {
            let mesh = PlanarMesh::new(&piece, edge).unwrap();
            let psi = mesh.flow(sigma, radius).unwrap();
            let exact = |p: &Point2| -sigma * (bessel(p.coords.norm() / sigma) / bessel(radius / sigma)).ln();
            mesh.points().iter().zip(&psi).map(|(p, v)| (v - exact(p)).abs()).fold(0.0, f64::max)
        };
        let (coarse, fine) = (error(1.6), error(0.8));
        assert!(fine < 0.03 && coarse / fine > 2.5, "{coarse} {fine}");
    }

    #[test]
    fn a_corner_that_joined_its_triangle_first_stays_joined() {
        let triangles = vec![[10, 5, 7], [5, 0, 1]];
        let mesh = PlanarMesh { points: Vec::new(), triangles, wall: Vec::new(), sides: Vec::new() };
        let values: Vec<f64> = (0..11).map(|v| if v >= 5 { 1.0 } else { 0.0 }).collect();
        assert_eq!(mesh.above(&values, 0.5, &[0, 1]), [[0, 1]]);
    }

    #[test]
    fn level_curves_close_around_walls_and_islands() {
        let piece = Piece { outer: circle(20.0, 200, false), islands: vec![circle(5.0, 60, true)] };
        let mesh = PlanarMesh::new(&piece, 1.0).unwrap();
        let area: f64 =
            mesh.triangles().iter().map(|t| signed_area(&t.map(|v| mesh.points()[v as usize]))).sum();
        assert!((area - piece.area()).abs() < 1e-9 * area);
        let psi = mesh.flow(1.0, 7.5).unwrap();
        let all: Vec<u32> = (0..mesh.triangles().len() as u32).collect();
        let curves = mesh.level_curves(&psi, 2.0, &all);
        let mut areas: Vec<f64> = curves.iter().map(|c| signed_area(c)).collect();
        areas.sort_by(f64::total_cmp);
        // Near the walls ψ is the distance but for the curvature of the walls.
        assert_eq!(areas.len(), 2);
        assert!((areas[1] / (0.5 * TAU * 18.0 * 18.0) - 1.0).abs() < 0.02, "{areas:?}");
        assert!((areas[0] / (0.5 * TAU * 49.0) + 1.0).abs() < 0.12, "{areas:?}");
        assert_eq!(mesh.above(&psi, 2.0, &all).len(), 1);
        // The same bits every time.
        let again = PlanarMesh::new(&piece, 1.0).unwrap();
        assert!(again.flow(1.0, 7.5).unwrap() == psi);
        assert!(again.level_curves(&psi, 2.0, &all) == curves);
    }
}
