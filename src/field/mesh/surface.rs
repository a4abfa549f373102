//! Triangle meshes that carry fields: vertices with normals and tangent frames, neighbours, borders.
//!
//! Enters: points (mm) and triangles that are counter-clockwise seen from outside. Leaves: the mesh
//! with all that fields ask it, or why it cannot carry one.

use geometry::{Point3, TriangleMesh, Vector3, angle_between};

/// Stands for "no triangle" in neighbour lists.
const NONE: u32 = u32::MAX;

/// A triangle that is thinner than this share of its longest side carries no gradient: its hat
/// functions would grow beyond what f64 can balance.
const LEAST_HEIGHT: f64 = 1e-9;

/// Why a mesh or a field on it cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MeshFieldError {
    /// The triangles do not make a surface with borders.
    #[error("{0}")]
    Mesh(String),
    /// A direction, density or value cannot be used.
    #[error("{0}")]
    Invalid(String),
    /// The conditions do not determine the field.
    #[error(
        "the field on the mesh of {vertices} vertices is not determined (residual {residual:.1e}): {cure}"
    )]
    Undetermined {
        /// Vertices of the mesh.
        vertices: usize,
        /// Relative residual of the system.
        residual: f64,
        /// What would help.
        cure: &'static str,
    },
}

/// A triangle mesh that carries fields: an oriented surface, with or without borders, in which every
/// vertex belongs to a triangle and every triangle has an area.
#[derive(Debug, Clone)]
pub struct FieldMesh {
    points: Vec<Point3>,
    triangles: Vec<[u32; 3]>,
    neighbours: Vec<[u32; 3]>,
    normals: Vec<Vector3>,
    frames: Vec<[Vector3; 2]>,
    /// Where each vertex's triangles begin in `around`, and the end.
    starts: Vec<u32>,
    /// The triangles at each vertex, ascending.
    around: Vec<u32>,
    loops: Vec<Vec<u32>>,
    on_border: Vec<bool>,
}

impl FieldMesh {
    /// A plane region: points `[x, y]`, mm, and counter-clockwise triangles. All normals are +z.
    ///
    /// # Errors
    /// [`MeshFieldError::Mesh`] when the triangles do not make a surface.
    pub fn planar(points: &[[f64; 2]], triangles: Vec<[u32; 3]>) -> Result<Self, MeshFieldError> {
        let lifted: Vec<Point3> = points.iter().map(|p| Point3::new(p[0], p[1], 0.0)).collect();
        let up = vec![Vector3::z(); lifted.len()];
        let mesh = Self::new(lifted, triangles, Some(up))?;
        match (0..mesh.triangles.len()).find(|&t| mesh.area_vector(t).z <= 0.0) {
            Some(t) => Err(MeshFieldError::Mesh(format!("triangle {t} is clockwise"))),
            None => Ok(mesh),
        }
    }

    /// All triangles of a mesh.
    ///
    /// # Errors
    /// As [`FieldMesh::new`].
    pub fn of_mesh(mesh: &TriangleMesh) -> Result<Self, MeshFieldError> {
        Self::new(mesh.vertices().to_vec(), mesh.triangles().to_vec(), None)
    }

    /// From points, triangles and unit normals at the points; without normals they are the means of
    /// the faces around, weighted by their angles.
    ///
    /// # Errors
    /// [`MeshFieldError::Mesh`] when an index is out of range, a point is not finite or belongs to no
    /// triangle, a triangle has no area, or an edge has two triangles on the same side.
    pub fn new(
        points: Vec<Point3>,
        triangles: Vec<[u32; 3]>,
        normals: Option<Vec<Vector3>>,
    ) -> Result<Self, MeshFieldError> {
        let wrong = |reason: String| Err(MeshFieldError::Mesh(reason));
        if triangles.is_empty() || triangles.len() > (u32::MAX / 4) as usize {
            return wrong(format!("a field cannot stand on {} triangles", triangles.len()));
        }
        if let Some(k) = points.iter().position(|p| p.iter().any(|c| !c.is_finite())) {
            return wrong(format!("vertex {k} is not finite"));
        }
        for (t, corners) in triangles.iter().enumerate() {
            let [a, b, c] = *corners;
            if corners.iter().any(|&i| i as usize >= points.len()) || a == b || b == c || c == a {
                return wrong(format!("triangle {t} has the corners {a}, {b}, {c}"));
            }
            let [p, q, r] = corners.map(|i| points[i as usize]);
            let longest2 = (q - p).norm_squared().max((r - q).norm_squared()).max((p - r).norm_squared());
            if (q - p).cross(&(r - p)).norm() <= LEAST_HEIGHT * longest2 {
                return wrong(format!("triangle {t} has no area"));
            }
        }
        let neighbours = neighbours_of(&points, &triangles)?;
        let (starts, around) = around_vertices(points.len(), &triangles);
        if let Some(v) = starts.windows(2).position(|s| s[0] == s[1]) {
            return wrong(format!("vertex {v} belongs to no triangle"));
        }
        let normals = normals.unwrap_or_else(|| mean_normals(&points, &triangles));
        if normals.len() != points.len() {
            return wrong(format!("{} normals were given for {} vertices", normals.len(), points.len()));
        }
        let frames = normals.iter().map(frame).collect();
        let mut mesh = Self {
            on_border: vec![false; points.len()],
            points,
            triangles,
            neighbours,
            normals,
            frames,
            starts,
            around,
            loops: Vec::new(),
        };
        mesh.loops = mesh.border_loops();
        for &v in mesh.loops.iter().flatten() {
            mesh.on_border[v as usize] = true;
        }
        Ok(mesh)
    }

    /// Vertices, mm.
    pub fn points(&self) -> &[Point3] {
        &self.points
    }

    /// Vertex indices, counter-clockwise seen from outside.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Outward unit normals at the vertices.
    pub fn normals(&self) -> &[Vector3] {
        &self.normals
    }

    /// Two unit tangents at vertex `v`, square to each other; with the normal they are right-handed.
    pub fn frame(&self, v: usize) -> [Vector3; 2] {
        self.frames[v]
    }

    /// The triangle across side `k` (from corner `k` to corner `k + 1`) of triangle `t`.
    pub fn neighbour(&self, t: usize, k: usize) -> Option<usize> {
        let n = self.neighbours[t][k];
        (n != NONE).then_some(n as usize)
    }

    /// The triangles at vertex `v`, ascending.
    pub fn triangles_at(&self, v: usize) -> &[u32] {
        &self.around[self.starts[v] as usize..self.starts[v + 1] as usize]
    }

    /// Closed loops of border vertices, each with the surface on its left.
    pub fn loops(&self) -> &[Vec<u32>] {
        &self.loops
    }

    /// The corners of triangle `t`.
    pub fn corners(&self, t: usize) -> [Point3; 3] {
        self.triangles[t].map(|i| self.points[i as usize])
    }

    /// The normal of triangle `t`, as long as twice its area, mm².
    pub fn area_vector(&self, t: usize) -> Vector3 {
        let [a, b, c] = self.corners(t);
        (b - a).cross(&(c - a))
    }

    /// Area of triangle `t`, mm².
    pub fn area(&self, t: usize) -> f64 {
        0.5 * self.area_vector(t).norm()
    }

    /// Gradients of the three hat functions of triangle `t`, 1/mm, in its plane.
    pub fn hat_gradients(&self, t: usize) -> [Vector3; 3] {
        let [a, b, c] = self.corners(t);
        let double = (b - a).cross(&(c - a));
        let n = double / double.norm_squared();
        [n.cross(&(c - b)), n.cross(&(a - c)), n.cross(&(b - a))]
    }

    /// Every edge once, as `[v, w]` with `v < w`, in ascending order.
    pub fn edges(&self) -> Vec<[u32; 2]> {
        let mut edges = Vec::with_capacity(self.triangles.len() * 3 / 2 + 3);
        for (t, corners) in self.triangles.iter().enumerate() {
            for k in 0..3 {
                let n = self.neighbours[t][k];
                if n == NONE || (t as u32) < n {
                    let (a, b) = (corners[k], corners[(k + 1) % 3]);
                    edges.push([a.min(b), a.max(b)]);
                }
            }
        }
        edges.sort_unstable();
        edges
    }

    /// The vertices joined to `v` by an edge, ascending.
    pub fn ring(&self, v: usize) -> Vec<u32> {
        let corners = self.triangles_at(v).iter().flat_map(|&t| self.triangles[t as usize]);
        let mut ring: Vec<u32> = corners.filter(|&i| i as usize != v).collect();
        ring.sort_unstable();
        ring.dedup();
        ring
    }

    /// Number of the connected piece that each vertex belongs to, counted from 0, and how many there
    /// are. Pieces hang together by vertices.
    pub fn pieces(&self) -> (Vec<u32>, usize) {
        let mut piece = vec![NONE; self.points.len()];
        let mut count = 0;
        let mut open = Vec::new();
        for seed in 0..piece.len() {
            if piece[seed] != NONE {
                continue;
            }
            piece[seed] = count;
            open.push(seed);
            while let Some(v) = open.pop() {
                for &t in self.triangles_at(v) {
                    for w in self.triangles[t as usize] {
                        if piece[w as usize] == NONE {
                            piece[w as usize] = count;
                            open.push(w as usize);
                        }
                    }
                }
            }
            count += 1;
        }
        (piece, count as usize)
    }

    /// `vector` at vertex `from` carried to the tangent plane of vertex `to`, by the least turn from
    /// one normal to the other.
    pub fn transport(&self, from: usize, to: usize, vector: &Vector3) -> Vector3 {
        turned(&self.normals[from], &self.normals[to], vector)
    }

    fn border_loops(&self) -> Vec<Vec<u32>> {
        let mut seen = vec![[false; 3]; self.triangles.len()];
        let mut loops = Vec::new();
        for start in 0..self.triangles.len() {
            for side in 0..3 {
                if self.neighbours[start][side] != NONE || seen[start][side] {
                    continue;
                }
                let mut ring = Vec::new();
                let (mut t, mut k) = (start, side);
                while !seen[t][k] {
                    seen[t][k] = true;
                    ring.push(self.triangles[t][k]);
                    let hinge = self.triangles[t][(k + 1) % 3];
                    // Around the vertex at the end of the side, to the next side without neighbour.
                    k = (k + 1) % 3;
                    while let Some(n) = self.neighbour(t, k) {
                        t = n;
                        k = self.triangles[t].iter().position(|&i| i == hinge).unwrap_or(0);
                    }
                }
                loops.push(ring);
            }
        }
        loops
    }
}

/// `vector` turned by the least turn that takes the unit normal `from` to `to`.
pub(super) fn turned(from: &Vector3, to: &Vector3, vector: &Vector3) -> Vector3 {
    let axis = from.cross(to);
    let cosine = from.dot(to);
    // Opposite normals have no least turn; the sheet folds over there and any will do.
    if cosine < -0.999_999 {
        return *vector - *to * (2.0 * to.dot(vector));
    }
    *vector * cosine + axis.cross(vector) + axis * (axis.dot(vector) / (1.0 + cosine))
}

/// Two unit vectors square to `normal` and to each other.
fn frame(normal: &Vector3) -> [Vector3; 2] {
    let helper = if normal.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
    let first = (helper - normal * normal.dot(&helper)).normalize();
    [first, normal.cross(&first)]
}

fn neighbours_of(points: &[Point3], triangles: &[[u32; 3]]) -> Result<Vec<[u32; 3]>, MeshFieldError> {
    let mut sides: Vec<(u32, u32, u32)> = Vec::with_capacity(3 * triangles.len());
    for (t, corners) in triangles.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            sides.push((a.min(b), a.max(b), (3 * t + k) as u32));
        }
    }
    sides.sort_unstable();
    let mut neighbours = vec![[NONE; 3]; triangles.len()];
    let mut first = 0;
    while first < sides.len() {
        let same =
            sides[first..].iter().take_while(|s| (s.0, s.1) == (sides[first].0, sides[first].1)).count();
        if same > 1 {
            let at = |n: usize| (sides[first + n].2 as usize / 3, sides[first + n].2 as usize % 3);
            let ((t, k), (u, l)) = (at(0), at(1));
            if same > 2 || triangles[t][k] == triangles[u][l] {
                let reason = if same > 2 { "more than two triangles" } else { "two triangles on one side" };
                let place = |v: u32| {
                    let p = points[v as usize];
                    format!("x {:.3} y {:.3} z {:.3}", p.x, p.y, p.z)
                };
                return Err(MeshFieldError::Mesh(format!(
                    "the edge from {} to {} has {reason}: no field goes on across it",
                    place(sides[first].0),
                    place(sides[first].1)
                )));
            }
            neighbours[t][k] = u as u32;
            neighbours[u][l] = t as u32;
        }
        first += same;
    }
    Ok(neighbours)
}

fn around_vertices(count: usize, triangles: &[[u32; 3]]) -> (Vec<u32>, Vec<u32>) {
    let mut starts = vec![0u32; count + 1];
    for i in triangles.iter().flatten() {
        starts[*i as usize + 1] += 1;
    }
    for v in 0..count {
        starts[v + 1] += starts[v];
    }
    let mut next = starts.clone();
    let mut around = vec![0; 3 * triangles.len()];
    for (t, corners) in triangles.iter().enumerate() {
        for &i in corners {
            around[next[i as usize] as usize] = t as u32;
            next[i as usize] += 1;
        }
    }
    (starts, around)
}

/// Means of the normals of the faces at each vertex, weighted by their angles there: the answer does
/// not depend on how a flat face is cut into triangles.
fn mean_normals(points: &[Point3], triangles: &[[u32; 3]]) -> Vec<Vector3> {
    let mut sums = vec![Vector3::zeros(); points.len()];
    let mut any = vec![Vector3::z(); points.len()];
    for corners in triangles {
        let p = corners.map(|i| points[i as usize]);
        let normal = (p[1] - p[0]).cross(&(p[2] - p[0])).normalize();
        for k in 0..3 {
            let (a, b) = (p[(k + 1) % 3] - p[k], p[(k + 2) % 3] - p[k]);
            sums[corners[k] as usize] += normal * angle_between(&a, &b);
            any[corners[k] as usize] = normal;
        }
    }
    let mean = |(v, sum): (usize, &Vector3)| {
        // Faces that turn their backs on each other leave no mean: any of them will do.
        sum.try_normalize(1e-9).unwrap_or(any[v])
    };
    sums.iter().enumerate().map(mean).collect()
}
