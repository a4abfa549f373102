//! How a part bends at a place, across the feed: exact on patches, fitted on meshes.

use field::mesh::{FieldMesh, MeshFieldError, Sheets};
use geometry::Vector3;
use part::{Part, SurfacePoint};

/// Curvature on a mesh is that of the vertices within this share of the cutter's radius, as for planners.
const FIT_OVER_RADIUS: f64 = 0.5;

/// The curvature of a part, wherever it is asked.
pub struct SurfaceCurvature<'a> {
    part: &'a Part,
    /// Of a mesh.
    sheets: Option<Sheets>,
}

impl<'a> SurfaceCurvature<'a> {
    /// Of a part, felt with a cutter of radius `radius`, mm.
    ///
    /// # Errors
    /// [`MeshFieldError`] when the triangles of a mesh make no surface.
    ///
    /// # Tolerance
    /// Exact on patches. On a mesh a quadratic is fitted to the vertices of the smooth sheet around: of first
    /// order in the length of its edges, better on regular ones; a face with too few vertices around counts
    /// as flat.
    pub fn of(part: &'a Part, radius: f64) -> Result<Self, MeshFieldError> {
        let fitted = || Ok(Sheets::of(&FieldMesh::of_mesh(part.mesh())?, FIT_OVER_RADIUS * radius));
        let sheets = part.patches().is_empty().then(fitted).transpose()?;
        Ok(Self { part, sheets })
    }

    /// True where it is fitted to a mesh.
    pub fn is_fitted(&self) -> bool {
        self.sheets.is_some()
    }

    /// Normal curvature at a surface point in the tangent direction `along` (unit), 1/mm, positive concave;
    /// `None` at a pole.
    pub fn along(&self, at: &SurfacePoint, along: &Vector3) -> Option<f64> {
        match (&self.sheets, at.at) {
            (Some(sheets), _) => {
                let t = at.triangle as usize;
                let [a, b, c] = self.part.mesh().corners(t);
                let whole = (b - a).cross(&(c - a));
                let share = |p: &Vector3, q: &Vector3| p.cross(q).dot(&whole) / whole.norm_squared();
                let [pa, pb, pc] = [a, b, c].map(|corner| corner - at.point);
                let weights = [share(&pb, &pc), share(&pc, &pa), share(&pa, &pb)];
                let corners = sheets.corners.get(t)?;
                Some((0..3).map(|k| weights[k] * sheets.bends[corners[k] as usize].along(along)).sum())
            }
            (None, Some(place)) => {
                let k = self.part.curvature(place)?;
                let (x, y) = (along.dot(&k.min_direction), along.dot(&k.max_direction));
                let length = x * x + y * y;
                (length > 0.25).then(|| (k.min * x * x + k.max * y * y) / length)
            }
            (None, None) => None,
        }
    }
}
