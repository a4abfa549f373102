//! Dropping a cutter onto a part: the highest tip position over a place in the plan view at which
//! the cutter touches without cutting in.
//!
//! Enters: a part, a cutter, places `(x, y)` in mm. Leaves: the height of the tip and the contact.
//! On a mesh the answer is exact up to f64 rounding: closed forms at each triangle (`touch`), found
//! with a tree of the places from which each triangle can carry the cutter (`domain`), for one place
//! or for a grid of them (`grid`). On patches the tessellation only finds where to look, by branch
//! and bound over its own tree with bounds that tilt with the surface (`roof`); the contact is then
//! the maximum on the exact surface (`refine`).
//!
//! The cutter touches from above only: above its largest radius it is a cylinder, and a vertical
//! wall carries it with its edges, not with its side.

mod domain;
mod grid;
mod least_left;
mod refine;
mod roof;
#[cfg(test)]
mod tests;
mod touch;

use cutter::Cutter;
use geometry::{BoxTree, Bvh, Extent, Feature, Jet2, Node, Paired, TriangleMesh};
use grid::Parts;
pub use grid::{GridDrop, PlanGrid};
pub use least_left::LeastLeft;
use part::{Part, PatchPoint, SurfacePoint};
use refine::{Hill, Peak};
use roof::Roof;
use touch::{Carries, Facet, Profile, Touch};
use work::monitor::{self, Cancelled, Monitor, Silent};

/// Where a cutter dropped along -z comes to rest on a part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drop {
    /// Height of the tip, mm.
    pub tip_z: f64,
    /// Where it touches. The normal is the part's: of the exact surface on patches; on a mesh that
    /// of the face, on edges and at vertices the mean of the faces there.
    pub contact: SurfacePoint,
}

/// Drops one cutter onto one part. Holds about 270 bytes a triangle; serves any number of threads.
#[derive(Debug, Clone)]
pub struct DropCutter<'a> {
    mesh: &'a TriangleMesh,
    bvh: &'a Bvh,
    exact: Option<&'a dyn ExactSurface>,
    /// How far the part may be off the mesh, mm.
    deviation: f64,
    /// The cutter's own profile.
    profile: Profile,
    /// The profile that is dropped onto the mesh: the cutter's own on a mesh part, a grown one
    /// above a tessellation.
    search: Profile,
    /// The triangles in the order of the tree's slots, prepared for `search`.
    facets: Vec<Facet>,
    cull: Cull,
}

/// What leaves triangles out of a search.
#[derive(Debug, Clone)]
enum Cull {
    /// On a mesh: boxes around the places of the tip while the cutter rests on a triangle, as a tree,
    /// and around those for each of its parts.
    Domains { tree: BoxTree, parts: Parts },
    /// Above a tessellation, where every triangle that the grown cutter would touch alone counts:
    /// one for each box of the mesh's tree.
    Roofs(Paired<Roof>),
}

/// The surface behind a tessellation.
pub(crate) trait ExactSurface: Sync + std::fmt::Debug {
    /// Patch and parameters of the corners of triangle `t`.
    fn corner_parameters(&self, t: usize) -> Option<[PatchPoint; 3]>;
    /// Parameter range of a patch.
    fn domain(&self, patch: u32) -> [[f64; 2]; 2];
    /// Position and derivatives on a patch.
    fn jet(&self, patch: u32, u: f64, v: f64) -> Jet2;
}

impl ExactSurface for Part {
    fn corner_parameters(&self, t: usize) -> Option<[PatchPoint; 3]> {
        self.corner_parameters(t)
    }
    fn domain(&self, patch: u32) -> [[f64; 2]; 2] {
        self.patches()[patch as usize].domain()
    }
    fn jet(&self, patch: u32, u: f64, v: f64) -> Jet2 {
        self.patches()[patch as usize].jet(u, v)
    }
}

/// The tessellation's deviation is measured at samples; the true one is taken to be at most this
/// many times as large. Less may miss a contact, more refines more candidates in vain.
const DEVIATION_MARGIN: f64 = 2.0;

/// Maxima remembered during one drop to recognise starts that lead to them again. Beyond it they
/// are refined again, which costs time only.
const REMEMBERED: usize = 8;

/// A search begins this far, mm, below the height that the last drop's triangle promises, so that it ends
/// at the same triangle as without. Less than rounding might leave that triangle out; more saves less.
const BESIDE_SLACK: f64 = 1e-6;

/// Where the last of a row of drops came to rest.
#[derive(Debug, Clone, Copy, Default)]
pub struct Beside(Option<usize>);

impl<'a> DropCutter<'a> {
    /// Prepares: takes seconds for a million triangles, as long as a hundred thousand drops.
    pub fn new(part: &'a Part, cutter: &Cutter) -> Self {
        match Self::watched(part, cutter, &Silent) {
            Ok(drop) => drop,
            Err(Cancelled) => unreachable!("nobody asked to stop"),
        }
    }

    /// As [`DropCutter::new`], and the monitor is asked while it lasts.
    ///
    /// # Errors
    /// [`Cancelled`] when the monitor says so.
    pub fn watched(part: &'a Part, cutter: &Cutter, monitor: &dyn Monitor) -> Result<Self, Cancelled> {
        let exact = (!part.patches().is_empty()).then(|| (part as _, part.mesh_deviation()));
        Self::over(part.mesh(), part.bvh(), cutter, exact, monitor)
    }

    /// Prepares for a mesh, or for the surface that it approximates within a deviation.
    fn over(
        mesh: &'a TriangleMesh,
        bvh: &'a Bvh,
        cutter: &Cutter,
        exact: Option<(&'a dyn ExactSurface, f64)>,
        monitor: &dyn Monitor,
    ) -> Result<Self, Cancelled> {
        let profile = Profile::of(cutter, 0.0);
        let deviation = exact.map_or(0.0, |(_, deviation)| DEVIATION_MARGIN * deviation);
        let search = if exact.is_some() { Profile::of(cutter, deviation) } else { profile };
        let domains = if exact.is_none() { domain::domains(mesh, &search, monitor)? } else { Vec::new() };
        let facets = work::parallel::try_map(bvh.slots(), |slot| {
            monitor::check(monitor)?;
            let t = bvh.triangle_in(slot);
            let carries = domains.get(t).map_or(Carries::ALL, domain::Domain::carries);
            Ok(Facet::new(mesh.corners(t), &mesh.normal(t), carries, &search))
        })?;
        let cull = if exact.is_none() {
            let in_slot = |slot: usize| &domains[bvh.triangle_in(slot)];
            let around = |slot| in_slot(slot).parts().fold(Extent::NOTHING, |all, part| all.with(&part.1));
            let extents: Vec<Extent> = (0..bvh.slots()).map(around).collect();
            monitor::check(monitor)?;
            let mut slot_of = vec![0u32; bvh.slots()];
            (0..bvh.slots()).for_each(|slot| slot_of[bvh.triangle_in(slot)] = slot as u32);
            let slot_of = &slot_of;
            let parts = Parts::new(bvh.slots(), |slot| {
                let t = bvh.triangle_in(slot);
                let facet = &facets[slot];
                in_slot(slot).parts().map(move |(part, extent)| {
                    let across = if let Feature::Side(k) = part { mesh.neighbour(t, k) } else { None };
                    (facet.part(part), extent, slot_of[across.unwrap_or(t)])
                })
            });
            Cull::Domains { tree: bvh.tree().refitted(&extents), parts }
        } else {
            Cull::Roofs(Paired::from_values(&roofs(mesh, bvh, &search, monitor)?))
        };
        monitor::check(monitor)?;
        Ok(Self {
            mesh,
            bvh,
            exact: exact.map(|(surface, _)| surface),
            deviation,
            profile,
            search,
            facets,
            cull,
        })
    }

    /// Highest tip position over `(x, y)` at which the cutter touches the part without cutting into
    /// it; `None` where the cutter does not reach the part at all.
    pub fn at(&self, x: f64, y: f64) -> Option<Drop> {
        self.at_beside(x, y, &mut Beside::default())
    }

    /// As [`DropCutter::at`], quicker where the last drop was nearby: the triangle that the cutter rested
    /// on then tells how high it stands at the least.
    pub fn at_beside(&self, x: f64, y: f64, beside: &mut Beside) -> Option<Drop> {
        if !(x.is_finite() && y.is_finite()) {
            return None;
        }
        let again = beside.0.and_then(|slot| self.facets[slot].touch(&self.search, x, y, f64::NEG_INFINITY));
        let least = again.map_or(f64::NEG_INFINITY, |touch| touch.tip_z - BESIDE_SLACK);
        // On a mesh a triangle counts in its domain only, and what it does beyond may be found nowhere.
        let landing =
            self.land(least, x, y).or_else(|| again.and_then(|_| self.land(f64::NEG_INFINITY, x, y)));
        beside.0 = landing.as_ref().map(|landing| landing.slot);
        let landing = landing?;
        match self.exact {
            None => Some(self.on_mesh(&landing)),
            Some(surface) => self.on_surface(surface, &landing),
        }
    }

    /// The triangle on which the grown cutter rests at `(x, y)`, if that is higher than `least`.
    fn land(&self, least: f64, x: f64, y: f64) -> Option<Landing> {
        let mut best: Option<(usize, Touch)> = None;
        self.search(least, x, y, |slot, floor| match self.facets[slot].touch(&self.search, x, y, floor) {
            Some(touch) => {
                best = Some((slot, touch));
                touch.tip_z
            }
            None => floor,
        });
        best.map(|(slot, touch)| Landing { x, y, slot, touch })
    }

    /// Visits the triangles that may lift the tip at `(x, y)` above `best`, as [`BoxTree::search`] does.
    fn search(&self, best: f64, x: f64, y: f64, visit: impl FnMut(usize, f64) -> f64) {
        match &self.cull {
            Cull::Domains { tree, .. } => {
                let bound = |_, node: &Node, _| if node.holds(x, y) { node.top() } else { f64::NEG_INFINITY };
                tree.search(best, bound, visit);
            }
            Cull::Roofs(roofs) => {
                let bound = |index, node: &Node, floor| self.bound(roofs.at(index), node, floor, x, y);
                self.bvh.tree().search(best, bound, visit);
            }
        }
    }

    /// No triangle in the box lifts the tip higher than this, unless this is below `floor`: then
    /// none lifts it above `floor`.
    fn bound(&self, roof: &Roof, node: &Node, floor: f64, x: f64, y: f64) -> f64 {
        let distance2 = node.plan_distance_squared(x, y);
        if distance2 > self.search.radius * self.search.radius {
            return f64::NEG_INFINITY;
        }
        let level = node.top() - self.search.height_squared(distance2);
        if level <= floor { level } else { level.min(roof.bound(node, &self.search, x, y)) }
    }

    fn on_mesh(&self, landing: &Landing) -> Drop {
        let Landing { x, y, slot, touch } = landing;
        let triangle = self.bvh.triangle_in(*slot);
        let contact = self.facets[*slot].contact(touch, *x, *y);
        let contact = SurfacePoint {
            point: contact.point,
            normal: self.bvh.normal_at(self.mesh, triangle, contact.feature),
            at: None,
            triangle: triangle as u32,
        };
        Drop { tip_z: touch.tip_z, contact }
    }

    /// The drop onto the exact surface `S`, given where the grown cutter rests on the mesh `M`.
    ///
    /// Let the cutter rest on `S` at tip height `z*`. Its contact lies within the deviation of some
    /// point `q` of `M`, so the cutter grown by the deviation, moved along with it, holds `q`: alone
    /// on `q`'s triangle it would come to rest at `z*` or above. So the contact lies behind one of
    /// the triangles on which the grown cutter rests at `z*` or above, and any point of `S` that is
    /// found gives a lower bound of `z*`.
    fn on_surface(&self, surface: &dyn ExactSurface, first: &Landing) -> Option<Drop> {
        let mut found = Refinement { best: None, known: [((0, 0), [0.0; 2]); REMEMBERED], len: 0 };
        self.refine(surface, first, &mut found);
        let (x, y) = (first.x, first.y);
        self.search(found.height(), x, y, |slot, floor| {
            // The first triangle was refined already.
            if slot != first.slot
                && let Some(touch) = self.facets[slot].touch(&self.search, x, y, floor)
            {
                self.refine(surface, &Landing { x, y, slot, touch }, &mut found);
            }
            found.height()
        });
        let (triangle, patch, peak) = found.best?;
        let facing = self.mesh.normal(triangle);
        let normal = match peak.jet.normal() {
            Some(n) if n.dot(&facing) < 0.0 => -n,
            Some(n) => n,
            None => facing,
        };
        let contact = SurfacePoint {
            point: peak.jet.p,
            normal,
            at: Some(PatchPoint { patch, u: peak.at[0], v: peak.at[1] }),
            triangle: triangle as u32,
        };
        Some(Drop { tip_z: peak.tip_z, contact })
    }

    /// Climbs to the maximum on the exact surface that is reached from the contact on a triangle.
    fn refine(&self, surface: &dyn ExactSurface, landing: &Landing, found: &mut Refinement) {
        let Landing { x, y, slot, touch } = landing;
        let triangle = self.bvh.triangle_in(*slot);
        let Some(corners) = surface.corner_parameters(triangle) else {
            return;
        };
        let weights = self.facets[*slot].contact(touch, *x, *y).barycentric;
        let mean = |of: fn(&PatchPoint) -> f64| (0..3).map(|k| weights[k] * of(&corners[k])).sum::<f64>();
        let (patch, start) = (corners[0].patch, [mean(|p| p.u), mean(|p| p.v)]);
        let jet = |u: f64, v: f64| surface.jet(patch, u, v);
        for (number, law) in self.profile.laws().enumerate() {
            let hill = Hill::new(&jet, surface.domain(patch), law, self.profile.radius, [*x, *y]);
            let key = (patch, number);
            let known = found.known[..found.len].iter().filter(|k| k.0 == key).map(|k| k.1);
            if let Some(peak) = hill.climb(start, known) {
                found.add(triangle, key, peak);
            }
        }
    }
}

/// A roof for each box of the tree.
fn roofs(
    mesh: &TriangleMesh,
    bvh: &Bvh,
    profile: &Profile,
    monitor: &dyn Monitor,
) -> Result<Vec<Roof>, Cancelled> {
    work::parallel::try_map(bvh.boxes(), |index| {
        monitor::check(monitor)?;
        Ok(bvh.few_slots_in(index, roof::MOST_BELOW).map_or(Roof::NONE, |(node, slots)| {
            let below: Vec<_> = slots.iter().map(|&s| mesh.corners(bvh.triangle_in(s))).collect();
            Roof::over(node, &below, profile)
        }))
    })
}

/// A cutter with its axis at `(x, y)` resting on the triangle in a slot.
#[derive(Debug, Clone, Copy)]
struct Landing {
    x: f64,
    y: f64,
    slot: usize,
    touch: Touch,
}

/// What the refinement has found so far in one drop.
struct Refinement {
    /// Triangle, patch and contact.
    best: Option<(usize, u32, Peak)>,
    /// Patch, number of the profile's piece, and parameters of maxima.
    known: [((u32, usize), [f64; 2]); REMEMBERED],
    len: usize,
}

impl Refinement {
    fn height(&self) -> f64 {
        self.best.as_ref().map_or(f64::NEG_INFINITY, |b| b.2.tip_z)
    }

    fn add(&mut self, triangle: usize, key: (u32, usize), peak: Peak) {
        if self.len < REMEMBERED {
            self.known[self.len] = (key, peak.at);
            self.len += 1;
        }
        if peak.tip_z > self.height() {
            self.best = Some((triangle, key.0, peak));
        }
    }
}
