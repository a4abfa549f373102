//! Over which places of its axis a cutter can rest on each triangle of a mesh.
//!
//! The tip of a cutter that slides over a mesh draws a surface of its own: a shifted copy of each
//! face, and along each edge and around each vertex a piece of the cutter turned upside down. Each
//! piece stands over a small domain of the plan view; the tip surface is the highest of them. Where
//! the cutter fits into every hollow they lie side by side like the tiles of a roof, so that a drop
//! has to look at one to three of them; elsewhere they overlap.
//!
//! **Why the domains hold every contact.** Let the cutter with its axis at `c` rest on the point `q`
//! of the mesh, `d = q.xy − c`, `f` the profile as a convex function of `d`, infinite beyond the
//! radius, and `z'(u)` the slope of the mesh from `q` in the plan direction `u`, over faces whose
//! plan view lies that way. As `q` is the best near itself, `z'(u) <= f'(d; u) = max { s·u : s ∈ ∂f(d) }`.
//! Let `G` be the convex hull of the gradients of the faces at `q`, plus all non-negative
//! combinations of horizontal vectors `m` that point from each edge with a face on one side only
//! into that face. Then `G` meets `∂f(d)`. If it did not, a `u` would separate the two:
//! `max over ∂f(d) of s·u < min over G of s·u`. The right side is finite, so `m·u >= 0` for all `m`,
//! which only directions over faces fulfil; there `min over G <= z'(u) <= f'(d; u)`, a
//! contradiction. So `d` is a place where the profile has a slope from `G`: the shift from the axis
//! to where the cutter touches a plane with a normal among those around `q`.
//!
//! Of several contacts of the same height the one next to the axis is meant. It is never inside a
//! level region, unless below the axis itself.
//!
//! A valley edge (the surface bends up across it) never carries a profile without a corner: its
//! gradients on both sides would have to lie on both sides of the profile's.

use super::touch::{Carries, LEVEL, Profile};
use geometry::{Aabb, Extent, Feature, Point3, TriangleMesh, Vector3};
use work::monitor::{self, Cancelled, Monitor};

/// Faces steeper than this (z of the unit normal) do not count as lying on a side of their edges:
/// on which one may be rounding. Greater makes domains larger.
const UPRIGHT: f64 = 1e-9;

/// Triangles whose height is below this share of their longest side have no normal to rely on; what
/// touches them may carry the cutter from everywhere. Less lets rounding of normals exceed
/// [`MARGIN`].
const SLIVER: f64 = 1e-5;

/// An edge is a valley if the far corner of one face lies above the plane of the other by more than
/// this share of its distance: well above rounding, so that no edge is left out by mistake.
const VALLEY: f64 = 1e-6;

/// A hull of normals wider than this (cosine from its middle) is taken to be all of them. The domain
/// of a narrower one grows by the inverse of its cosine.
const WIDEST: f64 = 0.25;

/// Normals of a hull that are kept; vertices with more faces get the largest domain.
const MOST_NORMALS: usize = 24;

/// Leans below this (sine of the slope) have no direction to rely on.
const NO_DIRECTION: f64 = 1e-4;

/// Slack of sines, for rounding of normals.
const SINE_SLACK: f64 = 1e-9;

/// Domains are grown by this share of the largest coordinate or radius, far more than rounding moves
/// a contact of triangles that are no slivers.
const MARGIN: f64 = f32::EPSILON as f64;

/// What a triangle contributes to the tip surface: for its face, and for the sides and corners that
/// are counted with it (each is with one triangle only) a box that holds the axis, and the tip's
/// height, whenever the cutter rests there. In the mesh's order of corners.
#[derive(Debug, Clone, Copy)]
pub(super) struct Domain {
    pub(super) face: Option<Extent>,
    /// With their ends.
    pub(super) sides: [Option<Extent>; 3],
    pub(super) corners: [Option<Extent>; 3],
}

impl Domain {
    /// Sides and corners that are counted with this triangle.
    pub(super) fn carries(&self) -> Carries {
        Carries { sides: self.sides.map(|e| e.is_some()), corners: self.corners.map(|e| e.is_some()) }
    }

    /// Each part with its box.
    pub(super) fn parts(&self) -> impl Iterator<Item = (Feature, Extent)> {
        let face = self.face.map(|e| (Feature::Face, e));
        let sides = (0..3).filter_map(|k| self.sides[k].map(|e| (Feature::Side(k), e)));
        let corners = (0..3).filter_map(|k| self.corners[k].map(|e| (Feature::Corner(k), e)));
        face.into_iter().chain(sides).chain(corners)
    }
}

/// A triangle's face.
#[derive(Debug, Clone, Copy)]
struct Face {
    /// Unit normal, upward.
    up: Vector3,
    /// Whether the mesh's normal points up.
    faces_up: bool,
    kind: Kind,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    /// Its plan view has an inside.
    Covering,
    /// Nearly vertical.
    Upright,
    /// Too thin to have a normal.
    Sliver,
}

impl Face {
    fn new(corners: &[Point3; 3]) -> Self {
        let [a, b, c] = corners;
        let normal = (b - a).cross(&(c - a));
        let longest = [a - b, b - c, c - a].iter().map(Vector3::norm_squared).fold(0.0, f64::max);
        let area = normal.norm();
        let unit = normal / area;
        let kind = if area < SLIVER * longest {
            Kind::Sliver
        } else if unit.z.abs() < UPRIGHT {
            Kind::Upright
        } else {
            Kind::Covering
        };
        let faces_up = unit.z > 0.0;
        Self { up: if faces_up { unit } else { -unit }, faces_up, kind }
    }
}

/// Where, seen from the axis, a contact may lie.
#[derive(Debug, Clone, Copy)]
struct Offsets {
    min: [f64; 2],
    max: [f64; 2],
    /// Least and greatest height of the profile there.
    heights: [f64; 2],
}

impl Offsets {
    /// The whole cutter.
    fn all(profile: &Profile) -> Self {
        Self {
            min: [-profile.radius; 2],
            max: [profile.radius; 2],
            heights: [profile.height(0.0), profile.height(profile.radius)],
        }
    }

    /// Where the axis and the tip may be while the contact lies in a box.
    fn domain(&self, contacts: &Aabb, margin: f64) -> Extent {
        let (low, high) = (contacts.min, contacts.max);
        let (min, max) = (
            [low.x - self.max[0], low.y - self.max[1], low.z - self.heights[1]],
            [high.x - self.min[0], high.y - self.min[1], high.z - self.heights[0]],
        );
        Extent::new(min.map(|x| x - margin), max.map(|x| x + margin))
    }
}

/// Normals between which that of a contact lies.
struct Hull {
    normals: [Vector3; MOST_NORMALS],
    len: usize,
    unbounded: bool,
}

impl Hull {
    fn new() -> Self {
        Self { normals: [Vector3::zeros(); MOST_NORMALS], len: 0, unbounded: false }
    }

    fn add(&mut self, normal: Vector3) {
        if self.len < MOST_NORMALS {
            self.normals[self.len] = normal;
            self.len += 1;
        } else {
            self.unbounded = true;
        }
    }

    fn offsets(&self, profile: &Profile) -> Offsets {
        let normals = &self.normals[..self.len];
        // Uphill parts of the normals: their length is the sine of the slope.
        let leans = || normals.iter().map(|n| [-n.x, -n.y]);
        let unbounded = self.unbounded || normals.is_empty();
        let Some((mut low, mut high)) = bounds_of_units(normals.iter().copied()).filter(|_| !unbounded)
        else {
            return Offsets::all(profile);
        };
        // From normals to uphill.
        for i in 0..2 {
            (low[i], high[i]) = (-high[i], -low[i]);
        }
        if leans().all(|w| length(w) <= LEVEL) {
            return Offsets { min: [0.0; 2], max: [0.0; 2], heights: [profile.height(0.0); 2] };
        }
        let from_zero = |i: usize| low[i].max(-high[i]).max(0.0);
        let to_end = |i: usize| low[i].abs().max(high[i].abs());
        let least = length([from_zero(0), from_zero(1)]) - SINE_SLACK;
        let most = (length([to_end(0), to_end(1)]) + SINE_SLACK).min(1.0);
        let near = if least > 0.0 { profile.least_reach(least) } else { 0.0 };
        let far = profile.greatest_reach(most);
        let directed = leans().all(|w| length(w) > NO_DIRECTION) && least > 0.0;
        let directions = leans().map(|w| Vector3::new(w[0], w[1], 0.0).normalize());
        let (from, to) =
            if directed { bounds_of_units(directions) } else { None }.unwrap_or(([-1.0; 2], [1.0; 2]));
        let mut offsets =
            Offsets { min: [0.0; 2], max: [0.0; 2], heights: [near, far].map(|rho| profile.height(rho)) };
        for i in 0..2 {
            offsets.min[i] = (near * from[i]).min(far * from[i]);
            offsets.max[i] = (near * to[i]).max(far * to[i]);
            if profile.is_sum(most) {
                // On the arc the offset is a sum: of the disc's rim and of the lean.
                offsets.min[i] = offsets.min[i].max(profile.flat * from[i] + profile.corner * low[i]);
                offsets.max[i] = offsets.max[i].min(profile.flat * to[i] + profile.corner * high[i]);
            }
        }
        offsets
    }
}

/// Of numbers of moderate size, in a fraction of the time of [`f64::hypot`].
fn length([x, y]: [f64; 2]) -> f64 {
    (x * x + y * y).sqrt()
}

/// Bounds in x and y of all unit vectors that are positive combinations of the given ones; `None`
/// where they are spread too widely.
///
/// Such a vector is a mean of the given ones, made longer by the inverse of its length; that length
/// is at least the mean's part along any axis.
fn bounds_of_units(units: impl Iterator<Item = Vector3> + Clone) -> Option<([f64; 2], [f64; 2])> {
    let axis = units.clone().sum::<Vector3>().try_normalize(f64::EPSILON)?;
    let (mut low, mut high, mut cosine, mut plan) =
        ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2], 1.0f64, 0.0f64);
    for n in units {
        for i in 0..2 {
            low[i] = low[i].min(n[i]);
            high[i] = high[i].max(n[i]);
        }
        cosine = cosine.min(n.dot(&axis));
        plan = plan.max(length([n.x, n.y]));
    }
    let bulge = plan * (1.0 / cosine - 1.0);
    (cosine >= WIDEST).then(|| (low.map(|x| (x - bulge).max(-1.0)), high.map(|x| (x + bulge).min(1.0))))
}

/// The mesh as the domains see it.
struct Survey<'m> {
    mesh: &'m TriangleMesh,
    profile: &'m Profile,
    faces: Vec<Face>,
}

impl Survey<'_> {
    /// Whether both sides of side `k` of a covering triangle are covered by its two faces.
    fn two_sided(&self, t: usize, k: usize) -> bool {
        self.mesh.neighbour(t, k).is_some_and(|n| {
            let (face, other) = (&self.faces[t], &self.faces[n]);
            other.kind == Kind::Covering && other.faces_up == face.faces_up
        })
    }

    /// Whether a side can carry the cutter.
    fn carries(&self, t: usize, k: usize) -> bool {
        let (Some(n), Kind::Covering) = (self.mesh.neighbour(t, k), self.faces[t].kind) else {
            return true;
        };
        if !self.profile.is_smooth() || !self.two_sided(t, k) {
            return true;
        }
        let start = self.mesh.triangles()[t][k];
        let corners = self.mesh.triangles()[n];
        let from = corners.iter().position(|&i| i == start).unwrap_or(0);
        // The neighbour runs along the side the other way: its far corner follows.
        let far =
            self.mesh.vertices()[corners[(from + 1) % 3] as usize] - self.mesh.vertices()[start as usize];
        far.dot(&self.faces[t].up) <= VALLEY * far.norm()
    }

    /// Adds what triangle `t` contributes to the hull at its side `k`, as one of two faces there.
    fn add(&self, hull: &mut Hull, t: usize, sides: &[usize]) {
        match self.faces[t].kind {
            Kind::Sliver => hull.unbounded = true,
            Kind::Upright => {}
            Kind::Covering => {
                hull.add(self.faces[t].up);
                for &k in sides {
                    if !self.two_sided(t, k) {
                        hull.add(self.outward(t, k));
                    }
                }
            }
        }
    }

    /// Horizontal unit vector that leads out of a covering triangle across side `k`: the normal of a
    /// wall below that side.
    fn outward(&self, t: usize, k: usize) -> Vector3 {
        let corners = self.mesh.corners(t);
        let along = (corners[(k + 1) % 3] - corners[k]).xy().normalize();
        let right = Vector3::new(along.y, -along.x, 0.0);
        if self.faces[t].faces_up { right } else { -right }
    }

    fn side(&self, t: usize, k: usize) -> Offsets {
        let mut hull = Hull::new();
        self.add(&mut hull, t, &[k]);
        if let Some(n) = self.mesh.neighbour(t, k) {
            let end = self.mesh.triangles()[t][(k + 1) % 3];
            let j = self.mesh.triangles()[n].iter().position(|&i| i == end).unwrap_or(0);
            self.add(&mut hull, n, &[j]);
        }
        hull.offsets(self.profile)
    }

    /// Where a vertex may carry the cutter, given its corners as `3 t + k`; `None` if nowhere.
    fn vertex(&self, corners: &[u32]) -> Option<Offsets> {
        let mut hull = Hull::new();
        let mut carries = false;
        for &corner in corners {
            let (t, k) = (corner as usize / 3, corner as usize % 3);
            let sides = [k, (k + 2) % 3];
            carries |= sides.iter().any(|&side| self.carries(t, side));
            self.add(&mut hull, t, &sides);
        }
        carries.then(|| hull.offsets(self.profile))
    }

    fn triangle(&self, t: usize, corners: &Corners, vertices: &[Option<Offsets>], margin: f64) -> Domain {
        let points = self.mesh.corners(t);
        let face = &self.faces[t];
        let face = match face.kind {
            Kind::Covering => {
                let mut hull = Hull::new();
                hull.add(face.up);
                Some(hull.offsets(self.profile).domain(&Aabb::of(&points), margin))
            }
            Kind::Upright => None,
            Kind::Sliver => Some(Offsets::all(self.profile).domain(&Aabb::of(&points), margin)),
        };
        let side = |k: usize| {
            let first = self.mesh.neighbour(t, k).is_none_or(|n| t < n);
            let ends = [points[k], points[(k + 1) % 3]];
            (first && self.carries(t, k)).then(|| self.side(t, k).domain(&Aabb::of(&ends), margin))
        };
        let corner = |k: usize| {
            let vertex = self.mesh.triangles()[t][k] as usize;
            let offsets = vertices[vertex].filter(|_| corners.of(vertex)[0] as usize == 3 * t + k)?;
            Some(offsets.domain(&Aabb::of(&[points[k]]), margin))
        };
        Domain { face, sides: [0, 1, 2].map(side), corners: [0, 1, 2].map(corner) }
    }
}

/// The corners of triangles at each vertex, as `3 t + k`, in ascending order.
struct Corners {
    starts: Vec<u32>,
    corners: Vec<u32>,
}

impl Corners {
    fn new(mesh: &TriangleMesh) -> Self {
        let mut starts = vec![0u32; mesh.vertices().len() + 1];
        for &v in mesh.triangles().iter().flatten() {
            starts[v as usize + 1] += 1;
        }
        for v in 1..starts.len() {
            starts[v] += starts[v - 1];
        }
        let mut next = starts.clone();
        let mut corners = vec![0u32; 3 * mesh.triangles().len()];
        for (corner, &v) in mesh.triangles().iter().flatten().enumerate() {
            corners[next[v as usize] as usize] = corner as u32;
            next[v as usize] += 1;
        }
        Self { starts, corners }
    }

    fn of(&self, vertex: usize) -> &[u32] {
        &self.corners[self.starts[vertex] as usize..self.starts[vertex + 1] as usize]
    }
}

/// The domain of every triangle.
///
/// # Errors
/// [`Cancelled`] when the monitor says so.
pub(super) fn domains(
    mesh: &TriangleMesh,
    profile: &Profile,
    monitor: &dyn Monitor,
) -> Result<Vec<Domain>, Cancelled> {
    let bounds = mesh.bounds();
    let margin = MARGIN * bounds.min.coords.amax().max(bounds.max.coords.amax()).max(profile.radius);
    let faces = work::parallel::map(mesh.triangles().len(), |t| Face::new(&mesh.corners(t)));
    let survey = Survey { mesh, profile, faces };
    monitor::check(monitor)?;
    let corners = Corners::new(mesh);
    let vertices = work::parallel::try_map(mesh.vertices().len(), |v| {
        monitor::check(monitor)?;
        Ok(survey.vertex(corners.of(v)))
    })?;
    work::parallel::try_map(mesh.triangles().len(), |t| {
        monitor::check(monitor)?;
        Ok(survey.triangle(t, &corners, &vertices, margin))
    })
}
