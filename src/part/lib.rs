//! What is to be made: one view over patches and meshes.
//!
//! Enters: NURBS patches, surfaces by formula, or a mesh. Leaves: bounds, closest points, heights
//! and curvature, in the part's frame (mm, z up). Parametric patches keep a tessellation to search
//! in; every answer is then refined on the exact surface, so tessellation bounds the search, not
//! the result.
//!
//! Outward is the side that the tool comes from. Parts are milled from above (+z), so a patch
//! whose normal points down on the whole is turned over; a mesh brings its own orientation.

mod border_walls;
mod construct;
mod patch;
mod refine;
mod sample;
mod seams;

pub use construct::{PartError, default_tessellation_tolerance};
pub use patch::Patch;
pub use sample::{GridSample, OFF_PART, SurfaceGrid};

use std::sync::OnceLock;

use border_walls::BorderWalls;
use geometry::{Aabb, Bvh, MeshFoot, Point3, PrincipalCurvatures, RepairNotes, TriangleMesh, Vector3};
use seams::OnPatch;

/// Which point of which patch: patch index and parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PatchPoint {
    /// Index into [`Part::patches`].
    pub patch: u32,
    /// First parameter.
    pub u: f64,
    /// Second parameter.
    pub v: f64,
}

impl PatchPoint {
    /// Parameters between these and others of the same patch.
    #[must_use]
    pub fn toward(&self, other: &Self, share: f64) -> Self {
        let [u, v] = [[self.u, other.u], [self.v, other.v]].map(|[a, b]| a + share * (b - a));
        Self { patch: self.patch, u, v }
    }
}

/// A point of the part's surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint {
    /// Position, mm.
    pub point: Point3,
    /// Outward unit normal (the side that the tool comes from).
    pub normal: Vector3,
    /// Where on which patch; `None` on a mesh.
    pub at: Option<PatchPoint>,
    /// Triangle of [`Part::mesh`] in which the search ended.
    pub triangle: u32,
}

/// What is to be made.
#[derive(Debug)]
pub struct Part {
    patches: Vec<Patch>,
    /// +1 where the outward normal is on the side of `du × dv`, −1 where on the other.
    signs: Vec<f64>,
    /// Where each patch's triangles begin in the mesh.
    first_triangle: Vec<u32>,
    /// Parameters of the triangles' corners; empty for a mesh part.
    corners: Vec<[[f64; 2]; 3]>,
    mesh: TriangleMesh,
    bvh: Bvh,
    bounds: Aabb,
    deviation: f64,
    /// For each triangle, whether a line through it may meet another patch; empty for parts of one patch and
    /// meshes.
    beside_others: Vec<bool>,
    repairs: RepairNotes,
    /// Made when it is first asked for.
    border_walls: OnceLock<Option<BorderWalls>>,
}

/// A parameter within this share of its range from an end is at the end: a thousand times f64's rounding, a
/// millionth of a cutter.
const PATCH_END: f64 = 1e-10;

/// Points nearer than this, mm, are the same point of a closed seam.
const SEAM: f64 = 1.0e-9;

/// What rounding may add to a distance, mm, before it counts as greater.
const ROUNDING: f64 = 1.0e-9;

/// Surfaces that stand steeper than this, by their normals' vertical part, are not followed sideways.
const LEAST_UPRIGHT: f64 = 0.01;

impl Part {
    /// The patches; empty for a mesh part.
    pub fn patches(&self) -> &[Patch] {
        &self.patches
    }

    /// The mesh itself, or the tessellation of the patches.
    pub fn mesh(&self) -> &TriangleMesh {
        &self.mesh
    }

    /// The search tree over [`Part::mesh`].
    pub fn bvh(&self) -> &Bvh {
        &self.bvh
    }

    /// Bounds of the exact surface up to the tessellation's deviation; in the plan those of the borders of
    /// patches themselves.
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// Bound of the distance between [`Part::mesh`] and the exact surface, mm; for a mesh part what welding moved it
    /// by, mostly 0.
    pub fn mesh_deviation(&self) -> f64 {
        self.deviation
    }

    /// What was mended when the tessellation was made into a mesh; nothing for a mesh part, whose
    /// mesh was made before.
    pub fn repairs(&self) -> &RepairNotes {
        &self.repairs
    }

    /// Patch and parameters of the corners of triangle `t` of [`Part::mesh`]; `None` on a mesh part.
    pub fn corner_parameters(&self, t: usize) -> Option<[PatchPoint; 3]> {
        let patch = self.patch_of(t as u32)? as u32;
        Some(self.corners[t].map(|[u, v]| PatchPoint { patch, u, v }))
    }

    /// Point and outward unit normal at parameters of a patch.
    ///
    /// # Panics
    /// When there is no such patch.
    pub fn point_and_normal(&self, at: PatchPoint) -> (Point3, Vector3) {
        let patch = &self.patches[at.patch as usize];
        let jet = patch.jet(at.u, at.v);
        (jet.p, patch.normal_of(&jet, at.u, at.v) * self.signs[at.patch as usize])
    }

    /// +1 where the outward normal of a patch is on the side of `du × dv`, −1 where on the other.
    ///
    /// # Panics
    /// When there is no such patch.
    pub fn outward_sign(&self, patch: usize) -> f64 {
        self.signs[patch]
    }

    /// True where a patch ends: within 1e-10 of its parameter range from the end of one.
    ///
    /// # Panics
    /// When there is no such patch.
    pub fn is_at_patch_end(&self, at: PatchPoint) -> bool {
        let domain = self.patches[at.patch as usize].domain();
        let ends = |x: f64, [lo, hi]: [f64; 2]| {
            let near = PATCH_END * (hi - lo);
            x <= lo + near || x >= hi - near
        };
        ends(at.u, domain[0]) || ends(at.v, domain[1])
    }

    /// True where the part ends with a patch: where one does, and no other comes near. Always false on a mesh
    /// part.
    pub fn ends_with_patch_at(&self, place: &SurfacePoint) -> bool {
        place.at.is_some_and(|at| {
            let goes_on =
                || self.nearest_of_others(&place.point, self.across(), at.patch as usize, &[]).is_some();
            self.is_at_patch_end(at) && (self.patches.len() == 1 || !goes_on())
        })
    }

    /// Principal curvatures, positive where the part is concave toward its outward normal; `None`
    /// at a pole.
    ///
    /// # Panics
    /// When there is no such patch.
    pub fn curvature(&self, at: PatchPoint) -> Option<PrincipalCurvatures> {
        let k = self.patches[at.patch as usize].jet(at.u, at.v).principal_curvatures()?;
        if self.signs[at.patch as usize] > 0.0 {
            return Some(k);
        }
        Some(PrincipalCurvatures {
            min: -k.max,
            max: -k.min,
            min_direction: k.max_direction,
            max_direction: k.min_direction,
        })
    }

    /// The surface point nearest to `q` and the signed distance of `q` from it, mm (positive
    /// outside).
    ///
    /// # Tolerance
    /// On a mesh exact. On patches the point is a foot of the perpendicular, to 1e-12 mm, found from
    /// the mesh's nearest point; its distance is never more than the mesh's plus
    /// [`Part::mesh_deviation`] ε, and so never more than 2ε above the least one. Only where two feet
    /// on one patch are that nearly equal (on the medial axis) the other one may be returned.
    pub fn closest_point(&self, q: &Point3) -> (SurfacePoint, f64) {
        let near = self.bvh.closest_point(&self.mesh, q);
        let Some(index) = self.patch_of(near.triangle) else {
            return mesh_point(&near);
        };
        let (mut index, mut triangle) = (index, near.triangle);
        let mut foot = self.refine_foot(&self.patches[index], q, &near);
        // Where patches meet, another one may come nearer than its mesh tells.
        let (first, mut others) = (index, Vec::new());
        while others.len() + 1 < self.patches.len()
            && let Some(near) = self.nearest_of_others(q, foot.distance + self.deviation, first, &others)
            && let Some(other) = self.patch_of(near.triangle)
        {
            others.push(other);
            let found = self.refine_foot(&self.patches[other], q, &near);
            if found.distance < foot.distance {
                (foot, index, triangle) = (found, other, near.triangle);
            }
        }
        let (patch, [u, v]) = (&self.patches[index], foot.at);
        let normal = patch.normal_of(&foot.jet, u, v) * self.signs[index];
        let at = Some(PatchPoint { patch: index as u32, u, v });
        let side = if (q - foot.jet.p).dot(&normal) < 0.0 { -1.0 } else { 1.0 };
        (SurfacePoint { point: foot.jet.p, normal, at, triangle }, side * foot.distance)
    }

    /// The nearest point of the mesh of all patches but the `first` and those that were `asked` since, nearer
    /// than a distance, mm.
    fn nearest_of_others(&self, q: &Point3, within: f64, first: usize, asked: &[usize]) -> Option<MeshFoot> {
        let is_new = |patch: usize| patch != first && !asked.contains(&patch);
        let is_other = |t: usize| self.patch_of(t as u32).is_some_and(is_new);
        self.bvh.closest_point_of(&self.mesh, q, within, is_other)
    }

    /// The foot on the exact patch that belongs to a foot on the mesh.
    fn refine_foot(&self, patch: &Patch, q: &Point3, near: &MeshFoot) -> refine::Foot {
        let mut best = refine::foot(patch, q, self.interpolate(near.triangle, &near.barycentric));
        let try_from = |best: &mut refine::Foot, start: [f64; 2]| {
            let other = refine::foot(patch, q, start);
            if other.distance < best.distance {
                *best = other;
            }
        };
        // Across a closed seam the parameters jump, and the descent is held back at the border.
        for k in 0..2 {
            if best.held[k] {
                let [lo, hi] = patch.domain()[k];
                let mut opposite = best.at;
                opposite[k] = if best.at[k] == lo { hi } else { lo };
                if (patch.point(opposite[0], opposite[1]) - best.jet.p).norm() <= SEAM {
                    try_from(&mut best, opposite);
                }
            }
        }
        // At a pole all meridians end; only one of them leads on to the foot.
        if best.jet.normal().is_none() {
            for start in patch.around(best.at) {
                try_from(&mut best, start);
            }
        }
        // The surface comes within the deviation of the mesh's foot: a descent that ended farther
        // away went astray. Its triangle's parameters are then searched on a lattice.
        const LATTICE: u32 = 6;
        let enough = near.signed_distance.abs() + self.deviation + ROUNDING;
        for i in 0..=LATTICE {
            for j in 0..=LATTICE - i {
                if best.distance <= enough {
                    return best;
                }
                let share = |k: u32| f64::from(k) / f64::from(LATTICE);
                let start = self.interpolate(near.triangle, &[share(LATTICE - i - j), share(i), share(j)]);
                try_from(&mut best, start);
            }
        }
        best
    }

    /// The highest surface point above or below `(x, y)`; `None` off the part. Within
    /// [`Part::mesh_deviation`] of the part's border either answer may come.
    ///
    /// # Tolerance
    /// The point lies on the exact surface to 1e-12 mm (where `(x, y)` is beside the part's border by less
    /// than the deviation, on the tangent plane there). Which of two sheets of one patch is the higher one is
    /// decided on the mesh.
    pub fn highest_at(&self, x: f64, y: f64) -> Option<SurfacePoint> {
        let hit = self.bvh.highest_at(&self.mesh, x, y);
        if self.patches.is_empty() {
            return hit.map(|hit| SurfacePoint {
                point: Point3::new(x, y, hit.z),
                normal: self.mesh.normal(hit.triangle as usize),
                at: None,
                triangle: hit.triangle,
            });
        }
        let on_own = hit.and_then(|hit| {
            let patch = self.patch_of(hit.triangle)?;
            let start = || self.interpolate(hit.triangle, &hit.barycentric);
            Some(OnPatch {
                patch,
                triangle: hit.triangle,
                meeting: self.refine_vertical(patch, x, y, start)?,
            })
        });
        match self.across_seams(on_own, x, y) {
            Some(found) => Some(self.on_vertical(&found, x, y)),
            None if hit.is_none() => self.highest_graph_at(x, y),
            None => None,
        }
    }

    /// The place of the patch of triangle `t` over or below `(x, y)`, and 0; where that patch has ended
    /// there, its place nearest in the plan, as far as a descent from the triangle finds it, and how far
    /// aside that lies, mm. `None` on a mesh part.
    pub fn on_patch_of(&self, t: usize, x: f64, y: f64) -> Option<(SurfacePoint, f64)> {
        let index = self.patch_of(t as u32)?;
        let patch = &self.patches[index];
        let found = match patch {
            Patch::Analytic(graph) => refine::vertical_on_graph(graph, x, y),
            Patch::Nurbs(surface) => refine::vertical(surface, x, y, self.nearest_in_plan(t as u32, x, y)),
        };
        let ended = found.miss > ROUNDING;
        let [u, v] = if ended { refine::clamp(&patch.domain(), found.at) } else { found.at };
        let point = if ended { patch.point(u, v) } else { Point3::new(x, y, found.z) };
        let at = Some(PatchPoint { patch: index as u32, u, v });
        let place = SurfacePoint { point, normal: found.normal * self.signs[index], at, triangle: t as u32 };
        Some((place, if ended { found.miss } else { 0.0 }))
    }

    /// For points on the very border of a graph, which its triangles may miss by rounding.
    fn highest_graph_at(&self, x: f64, y: f64) -> Option<SurfacePoint> {
        let graphs = self.patches.iter().enumerate().filter_map(|(index, patch)| match patch {
            Patch::Analytic(graph) if graph.covers(x, y) => {
                Some((index, refine::vertical_on_graph(graph, x, y)))
            }
            _ => None,
        });
        let (index, meeting) = graphs.reduce(|a, b| if b.1.z > a.1.z { b } else { a })?;
        let triangle = self.bvh.closest_point(&self.mesh, &Point3::new(x, y, meeting.z)).triangle;
        Some(self.on_vertical(&OnPatch { patch: index, triangle, meeting }, x, y))
    }

    fn on_vertical(&self, found: &OnPatch, x: f64, y: f64) -> SurfacePoint {
        let OnPatch { patch, triangle, meeting } = found;
        let [u, v] = meeting.at;
        SurfacePoint {
            point: Point3::new(x, y, meeting.z),
            normal: meeting.normal * self.signs[*patch],
            at: Some(PatchPoint { patch: *patch as u32, u, v }),
            triangle: *triangle,
        }
    }

    /// Where the vertical line meets an exact patch, searched from the parameters `start` (which graphs
    /// do not need); `None` when it passes beside by more than the deviation.
    fn refine_vertical(
        &self,
        index: usize,
        x: f64,
        y: f64,
        start: impl Fn() -> [f64; 2],
    ) -> Option<refine::VerticalMeeting> {
        let meeting = match &self.patches[index] {
            Patch::Analytic(graph) => refine::vertical_on_graph(graph, x, y),
            Patch::Nurbs(surface) => refine::vertical(surface, x, y, start()),
        };
        (meeting.miss <= self.deviation + ROUNDING).then_some(meeting)
    }

    /// The patch that triangle `t` belongs to; `None` on a mesh part.
    fn patch_of(&self, t: u32) -> Option<usize> {
        self.first_triangle.partition_point(|&first| first <= t).checked_sub(1)
    }

    /// Parameters at barycentric coordinates of triangle `t`.
    fn interpolate(&self, t: u32, barycentric: &[f64; 3]) -> [f64; 2] {
        let c = &self.corners[t as usize];
        [0, 1].map(|k| c[0][k] * barycentric[0] + c[1][k] * barycentric[1] + c[2][k] * barycentric[2])
    }
}

fn mesh_point(foot: &MeshFoot) -> (SurfacePoint, f64) {
    let point = SurfacePoint { point: foot.point, normal: foot.normal, at: None, triangle: foot.triangle };
    (point, foot.signed_distance)
}

#[cfg(test)]
mod tests;
