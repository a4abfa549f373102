//! How a part comes into being: a mesh as it is, or patches with their search mesh.

use std::sync::OnceLock;

use super::{Part, Patch};
use geometry::{
    Aabb, Bvh, MAX_TRIANGLES, MeshError, Outside, Point3, RepairNotes, TessellateError, Tessellation,
    TriangleMesh, Vector3, tessellate,
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
            bounds: mesh.bounds(),
            deviation: mesh.moved(),
            mesh,
            border_walls: OnceLock::new(),
            beside_others: Vec::new(),
            repairs: RepairNotes::default(),
        }
    }

    /// A part that is made of patches. `tessellation_tolerance`, mm, bounds the distance between the
    /// search mesh and the patches; [`default_tessellation_tolerance`] suits unless the mesh itself is
    /// used. A patch whose area-weighted mean normal points down is turned over (its outward
    /// normal is then `dv × du`), and patches that share their border points agree on the side.
    ///
    /// # Errors
    /// See [`PartError`].
    pub fn from_patches(patches: Vec<Patch>, tessellation_tolerance: f64) -> Result<Self, PartError> {
        Self::of_patches(patches, tessellation_tolerance, Outside::Found)
    }

    /// As [`Part::from_patches`] for patches whose `du × dv` points outward, wherever that is.
    ///
    /// # Errors
    /// See [`PartError`].
    pub fn from_oriented_patches(
        patches: Vec<Patch>,
        tessellation_tolerance: f64,
    ) -> Result<Self, PartError> {
        Self::of_patches(patches, tessellation_tolerance, Outside::Given)
    }

    fn of_patches(
        patches: Vec<Patch>,
        tessellation_tolerance: f64,
        outside: Outside,
    ) -> Result<Self, PartError> {
        if patches.is_empty() {
            return Err(PartError::NoPatches);
        }
        let mut all = Gathered::default();
        for (patch, p) in patches.iter().enumerate() {
            let [us, vs] = p.kept_lines();
            let t = tessellate(&|u, v| p.jet(u, v), [&us, &vs], tessellation_tolerance)
                .map_err(|source| PartError::Patch { patch, source })?;
            all.add(t, outside);
            if all.triangles.len() > MAX_TRIANGLES {
                return Err(PartError::TooManyTriangles(all.triangles.len()));
            }
        }
        let (mesh, repairs, sources) = TriangleMesh::with_sources(all.vertices, all.triangles, outside)?;
        let corners: Vec<[[f64; 2]; 3]> =
            sources.iter().map(|c| c.map(|i| all.parameters[i as usize])).collect();
        let patch_of = |c: &[u32; 3]| all.first_vertex.partition_point(|&first| first <= c[0]) - 1;
        // The mesh keeps the order of its triangles, so those of a patch follow each other.
        let first_triangle: Vec<u32> =
            (0..patches.len()).map(|p| sources.partition_point(|c| patch_of(c) < p) as u32).collect();
        // The mesh has the last word on what is outside: it also knows how patches are joined.
        let mut turned = vec![0.0; patches.len()];
        for (source, [p, q, r]) in sources.iter().zip(&corners) {
            turned[patch_of(source)] += (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
        }
        let mut part = Self {
            patches,
            signs: turned.into_iter().map(|area| if area < 0.0 { -1.0 } else { 1.0 }).collect(),
            first_triangle,
            corners,
            bvh: Bvh::new(&mesh),
            bounds: mesh.bounds(),
            mesh,
            deviation: all.deviation,
            border_walls: OnceLock::new(),
            beside_others: Vec::new(),
            repairs,
        };
        part.beside_others = part.find_those_beside_others();
        part.bounds = part.bounds_with_borders();
        Ok(part)
    }

    /// The bounds of the mesh and of the borders of the patches, which bulge out between its corners.
    fn bounds_with_borders(&self) -> Aabb {
        /// Stretches between two corners whose ends are looked at: at most a sixteenth of the bulge is
        /// missed.
        const LOOKS: usize = 4;
        let mut bounds = self.mesh.bounds();
        for t in 0..self.mesh.triangles().len() {
            let Some(corners) = self.corner_parameters(t) else { break };
            for [a, b] in [0, 1, 2].map(|k| [corners[k], corners[(k + 1) % 3]]) {
                if self.is_at_patch_end(a.toward(&b, 0.5)) {
                    let at = |k: usize| a.toward(&b, k as f64 / LOOKS as f64);
                    (1..LOOKS).for_each(|k| bounds.grow(&self.point_and_normal(at(k)).0));
                }
            }
        }
        bounds
    }
}

/// The tessellations of all patches, one after the other, each facing up where its outside is not given.
#[derive(Default)]
struct Gathered {
    vertices: Vec<Point3>,
    /// Parameters of each vertex.
    parameters: Vec<[f64; 2]>,
    triangles: Vec<[u32; 3]>,
    /// Where each patch's vertices begin.
    first_vertex: Vec<u32>,
    deviation: f64,
}

impl Gathered {
    fn add(&mut self, t: Tessellation, outside: Outside) {
        let first = self.vertices.len() as u32;
        let doubled_area: Vector3 = t
            .triangles
            .iter()
            .map(|corners| {
                let [a, b, c] = corners.map(|i| t.vertices[i as usize]);
                (b - a).cross(&(c - a))
            })
            .sum();
        let up = outside == Outside::Given || doubled_area.z >= 0.0;
        let turn = |[a, b, c]: [u32; 3]| if up { [a, b, c] } else { [a, c, b] };
        self.first_vertex.push(first);
        self.triangles.extend(t.triangles.into_iter().map(|c| turn(c).map(|i| i + first)));
        self.vertices.extend(t.vertices);
        self.parameters.extend(t.parameters);
        self.deviation = self.deviation.max(t.deviation);
    }
}
