//! What of the design surface the tool of a path can face.
//!
//! Enters: the part, the path, and the block that it is cut from. Leaves: the kind of each place of the
//! surface, by its outward unit normal and by what of the part lies over it. mm.
//!
//! A tool with the axis `a` (from tip to holder) faces a place with the normal `n` where `n·a > 0`. Upright
//! tools also need that no other surface of the part lies over the place. Tools that lean come in from the
//! side; for them nothing is hidden.

use std::collections::HashSet;

use geometry::{Aabb, Point3, Vector3};
use motion::Toolpath;
use part::Part;
use serde::Serialize;
use work::parallel;

/// Where the vertical part of the design's normal is no greater, no upright cutter faces the surface, and a
/// cell says nothing of it. A greater one leaves drafts of walls unmeasured; below rounding of mesh files,
/// walls pass for slopes.
pub(crate) const LEAST_FACING: f64 = 1e-3;

/// Axes that differ by less than this in each coordinate are one. Coarser ones call places walls that a tool
/// faces by less than that; finer ones cost time on long paths.
const SAME_AXIS: f64 = 1e-2;

/// What lies this far over a place, mm, beside what the part's triangles are off its surface, is another
/// surface.
const ABOVE: f64 = 1e-6;

/// So far before a wall it is looked whether other surface lies over it, mm: more than rounding of mesh
/// files.
const BEFORE: f64 = 1e-3;

/// What of a part is judged.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Judged {
    /// What some tool axis of the path faces.
    #[default]
    Facing,
    /// That, and what stands along it and is open above.
    Walls,
    /// All of it.
    All,
}

impl Judged {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Facing, Self::Walls, Self::All];

    /// As scenes spell it.
    pub fn word(self) -> &'static str {
        match self {
            Self::Facing => "facing",
            Self::Walls => "walls",
            Self::All => "all",
        }
    }

    /// That which is spelt so.
    pub fn from_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|judged| judged.word() == word)
    }

    /// What it means, in a few words.
    pub fn meaning(self) -> &'static str {
        match self {
            Self::Facing => "the surface that the tool can face",
            Self::Walls => "that, and walls along the tool axis",
            Self::All => "the whole surface",
        }
    }
}

/// What a place of the surface is to the tool.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum PlaceKind {
    /// The tool can face it.
    Facing,
    /// It stands along the axis that comes nearest to facing it.
    Wall,
    /// It faces away from every axis.
    FacingAway,
    /// It faces up, or is a wall that is judged, and other surface of the part lies over it.
    Hidden,
    /// It lies outside of the block.
    OutsideStock,
}

impl PlaceKind {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Facing, Self::Wall, Self::FacingAway, Self::Hidden, Self::OutsideStock];
}

/// Tells what places of a part are to the tool of a path.
#[derive(Debug)]
pub struct Facing<'a> {
    part: &'a Part,
    /// Different axes of the moves on the surface; none for an upright path.
    axes: Vec<Vector3>,
    block: Aabb,
    /// Whether surface may lie over surface.
    overlaps: bool,
    /// Whether the triangles make no surface: then their sides mean little.
    soup: bool,
}

impl<'a> Facing<'a> {
    /// Of a part and a path in a block, mm.
    pub fn new(part: &'a Part, path: &Toolpath, block: Aabb) -> Self {
        let axes = if path.is_upright() { Vec::new() } else { axes(path) };
        // A single surface over a rectangle lies over itself nowhere.
        let overlaps = !matches!(part.patches(), [part::Patch::Analytic(_)]);
        Self { part, axes, block, overlaps, soup: part.mesh().surface().is_err() }
    }

    /// The block.
    pub fn block(&self) -> &Aabb {
        &self.block
    }

    /// Whether a place of this kind is judged.
    pub fn is_judged(&self, judged: Judged, kind: PlaceKind) -> bool {
        match judged {
            Judged::Facing => kind == PlaceKind::Facing,
            Judged::Walls => matches!(kind, PlaceKind::Facing | PlaceKind::Wall),
            Judged::All => kind != PlaceKind::OutsideStock,
        }
    }

    /// The kind of each of many places with their outward unit normals, in their order.
    pub fn kinds(&self, count: usize, place: impl Fn(usize) -> (Point3, Vector3) + Sync) -> Vec<PlaceKind> {
        const RUN: usize = 256;
        let runs = parallel::map(count.div_ceil(RUN), |run| {
            // Neighbours are mostly faced by the same axis.
            let mut last = 0;
            (run * RUN..((run + 1) * RUN).min(count))
                .map(|k| {
                    let (point, normal) = place(k);
                    self.kind(&point, &normal, &mut last)
                })
                .collect::<Vec<_>>()
        });
        runs.into_iter().flatten().collect()
    }

    /// Which of many places with their outward unit normals an upright tool comes to, in their order.
    pub fn meets(&self, count: usize, place: impl Fn(usize) -> (Point3, Vector3) + Sync) -> Vec<bool> {
        let kinds = self.kinds(count, &place);
        let is_open = |k: usize| match kinds[k] {
            PlaceKind::Facing => true,
            PlaceKind::Wall => !self.is_hidden_wall(&place(k).0, &place(k).1),
            PlaceKind::FacingAway | PlaceKind::Hidden | PlaceKind::OutsideStock => false,
        };
        parallel::map(count, is_open)
    }

    /// The kind of one place; `last` is the axis that is looked at first, and that which faced the place.
    fn kind(&self, point: &Point3, normal: &Vector3, last: &mut usize) -> PlaceKind {
        let near = self.part.mesh_deviation() + ABOVE;
        let Aabb { min, max } = self.block;
        if (0..3).any(|c| point[c] < min[c] - near || point[c] > max[c] + near) {
            return PlaceKind::OutsideStock;
        }
        if self.axes.is_empty() {
            return match normal.z {
                // The tool meets the back of it. No cell measures that, and to leave it out would pass what
                // nobody saw.
                z if z < -LEAST_FACING && self.soup && !self.is_covered(point, -near / z) => {
                    PlaceKind::Facing
                }
                z if z < -LEAST_FACING => PlaceKind::FacingAway,
                z if z <= LEAST_FACING => PlaceKind::Wall,
                z if self.is_covered(point, near / z) => PlaceKind::Hidden,
                _ => PlaceKind::Facing,
            };
        }
        if self.axes.get(*last).is_some_and(|axis| axis.dot(normal) > LEAST_FACING) {
            return PlaceKind::Facing;
        }
        let mut most = f64::NEG_INFINITY;
        for (k, axis) in self.axes.iter().enumerate() {
            most = most.max(axis.dot(normal));
            if most > LEAST_FACING {
                *last = k;
                return PlaceKind::Facing;
            }
        }
        if most < -LEAST_FACING { PlaceKind::FacingAway } else { PlaceKind::Wall }
    }

    /// Whether other surface of the part lies over an upright tool at a wall.
    pub(crate) fn is_hidden_wall(&self, point: &Point3, normal: &Vector3) -> bool {
        self.is_covered(&(point + normal * BEFORE), self.part.mesh_deviation() + ABOVE)
    }

    /// Whether other surface of the part lies over a place.
    fn is_covered(&self, point: &Point3, near: f64) -> bool {
        let top = || self.part.bvh().highest_at(self.part.mesh(), point.x, point.y);
        self.overlaps && top().is_some_and(|hit| hit.z > point.z + 2.0 * near)
    }
}

/// The different axes of the moves on the surface.
fn axes(path: &Toolpath) -> Vec<Vector3> {
    let mut seen: HashSet<[i32; 3]> = HashSet::new();
    let mut order = Vec::new();
    for (k, step) in path.moves.iter().enumerate().filter(|(_, step)| step.kind.is_on_surface()) {
        for axis in [path.location_before(k).axis, step.to.axis] {
            let cell: [i32; 3] = axis.map(|c| (c / SAME_AXIS).round() as i32).into();
            if seen.insert(cell) {
                order.push(axis);
            }
        }
    }
    order
}
