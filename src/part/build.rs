//! How a part comes into being: a mesh as it is, or patches with their search mesh.

use super::{Part, Patch};
use crate::geometry::{
    Aabb, Bvh, MAX_TRIANGLES, MeshError, Point3, RepairNotes, TessellateError, Tessellation, TriangleMesh,
    Vector3, tessellate,
};

/// The search mesh's tolerance unless another is asked for, mm: Newton's method starts well from
/// there, and a 60 mm part takes some ten thousand triangles. Greater makes more starts go astray
/// near tight curves; less costs memory and gains nothing, since results are refined anyway.
const DEFAULT_TOLERANCE: f64 = 0.005;

/// The tolerance is at most this share of the part's diagonal, so that small parts are not searched
/// in a few flat triangles.
const SHARE_OF_DIAGONAL: f64 = 1.0e-4;

/// Why a part could not be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PartError {
    /// There is no patch.
    #[error("the part has no patches; give at least one")]
    NoPatches,
    /// A patch could not be tessellated.
    #[error("patch {patch}: {source}")]
    Patch {
        /// Which, counted from 0.
        patch: usize,
        /// Why.
        source: TessellateError,
    },
    /// All patches together need too many triangles.
    #[error(
        "the patches need {0} triangles together, and {MAX_TRIANGLES} are allowed; use a greater tessellation \
         tolerance or split the part"
    )]
    TooManyTriangles(usize),
    /// The triangles do not make a mesh.
    #[error("the tessellated patches do not make a mesh: {0}")]
    Mesh(#[from] MeshError),
    /// The mesh left out triangles, so that parameters no longer belong to corners.
    #[error(
        "{0} triangles of the tessellated patches are too small to be told from points; \
         use a greater tessellation tolerance"
    )]
    TinyTriangles(usize),
}

/// The tessellation tolerance that suits patches, mm: 5 µm, less for parts below 50 mm across.
pub fn default_tessellation_tolerance(patches: &[Patch]) -> f64 {
    let bounds = patches.iter().fold(Aabb::EMPTY, |b, p| b.union(&rough_bounds(p)));
    let diagonal = bounds.diagonal();
    if diagonal > 0.0 && diagonal.is_finite() {
        DEFAULT_TOLERANCE.min(SHARE_OF_DIAGONAL * diagonal)
    } else {
        DEFAULT_TOLERANCE
    }
}

fn rough_bounds(patch: &Patch) -> Aabb {
    /// Points looked at along each parameter of a formula.
    const LOOKS: usize = 8;
    match patch {
        Patch::Nurbs(s) => s.control_bounds(),
        Patch::Analytic(s) => {
            let [[x0, x1], [y0, y1]] = s.domain();
            let at = |lo: f64, hi: f64, k: usize| lo + (hi - lo) * (k as f64 / LOOKS as f64);
            let mut bounds = Aabb::EMPTY;
            for k in 0..(LOOKS + 1) * (LOOKS + 1) {
                bounds.grow(&s.jet(at(x0, x1, k % (LOOKS + 1)), at(y0, y1, k / (LOOKS + 1))).p);
            }
            bounds
        }
    }
}

impl Part {
    /// A part that is a mesh.
    pub fn from_mesh(mesh: TriangleMesh) -> Self {
        Self {
            patches: Vec::new(),
            signs: Vec::new(),
            first_triangle: Vec::new(),
            corners: Vec::new(),
            bvh: Bvh::new(&mesh),
            mesh,
            deviation: 0.0,
            repairs: RepairNotes::default(),
        }
    }

    /// A part that is made of patches. `tessellation_tolerance`, mm, bounds the distance between the
    /// search mesh and the patches; [`default_tessellation_tolerance`] suits unless the mesh itself is
    /// used. A patch whose area-weighted mean normal points down is turned over (its outward
    /// normal is then `dv × du`).
    ///
    /// # Errors
    /// See [`PartError`].
    pub fn from_patches(patches: Vec<Patch>, tessellation_tolerance: f64) -> Result<Self, PartError> {
        if patches.is_empty() {
            return Err(PartError::NoPatches);
        }
        let mut all = Gathered::default();
        for (patch, p) in patches.iter().enumerate() {
            let [us, vs] = p.kept_lines();
            let t = tessellate(&|u, v| p.jet(u, v), [&us, &vs], tessellation_tolerance)
                .map_err(|source| PartError::Patch { patch, source })?;
            all.add(t);
            if all.triangles.len() > MAX_TRIANGLES {
                return Err(PartError::TooManyTriangles(all.triangles.len()));
            }
        }
        let given = all.triangles.len();
        let (mesh, repairs) = TriangleMesh::new(all.vertices, all.triangles)?;
        if mesh.triangles().len() != given {
            return Err(PartError::TinyTriangles(given - mesh.triangles().len()));
        }
        Ok(Self {
            patches,
            signs: all.signs,
            first_triangle: all.first_triangle,
            corners: all.corners,
            bvh: Bvh::new(&mesh),
            mesh,
            deviation: all.deviation,
            repairs,
        })
    }
}

/// The tessellations of all patches, one after the other, all facing up.
#[derive(Default)]
struct Gathered {
    vertices: Vec<Point3>,
    triangles: Vec<[u32; 3]>,
    corners: Vec<[[f64; 2]; 3]>,
    first_triangle: Vec<u32>,
    signs: Vec<f64>,
    deviation: f64,
}

impl Gathered {
    fn add(&mut self, t: Tessellation) {
        let first_vertex = self.vertices.len() as u32;
        let doubled_area: Vector3 = t
            .triangles
            .iter()
            .map(|corners| {
                let [a, b, c] = corners.map(|i| t.vertices[i as usize]);
                (b - a).cross(&(c - a))
            })
            .sum();
        let sign = if doubled_area.z < 0.0 { -1.0 } else { 1.0 };
        self.first_triangle.push(self.triangles.len() as u32);
        self.signs.push(sign);
        self.vertices.extend(t.vertices);
        for ([a, b, c], [p, q, r]) in t.triangles.into_iter().zip(t.corner_parameters) {
            let (triangle, corners) =
                if sign > 0.0 { ([a, b, c], [p, q, r]) } else { ([a, c, b], [p, r, q]) };
            self.triangles.push(triangle.map(|i| i + first_vertex));
            self.corners.push(corners);
        }
        self.deviation = self.deviation.max(t.deviation);
    }
}
