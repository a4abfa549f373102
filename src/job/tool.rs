//! The tool as a solid, and what it must keep away from.

use collision::{Check, Interference, Obstacle};
use cutter::Solid;
use geometry::{Bvh, TriangleMesh};
use part::Part;
use scene::Scene;

/// A mesh that is not to be touched, with its search tree.
pub(crate) type FixtureMesh = (TriangleMesh, Bvh);

/// The solids of a tool.
pub(crate) struct Tool {
    /// The cutter up to its holder.
    pub cutter: Solid,
    /// Shank and holder.
    pub holder: Option<Solid>,
}

impl Tool {
    /// The tool of a scene.
    pub fn of(scene: &Scene) -> Self {
        let cutter = Solid::of_cutter(&scene.cutter, scene.holder.as_ref());
        Self { cutter, holder: scene.holder.as_ref().map(Solid::of_holder) }
    }

    /// What the planner keeps the tool away from: shank and holder from all, the cutter from fixtures, and from cutting
    /// deeper into the part than half the gouge tolerance and what the part's triangles are off its surface.
    pub fn keep_clear<'a>(
        &'a self,
        scene: &Scene,
        part: &'a Part,
        fixtures: &'a [FixtureMesh],
    ) -> Interference<'a> {
        let keep = &scene.keep_clear;
        let obstacle = Obstacle::new(part.mesh(), part.bvh());
        let depth = 0.5 * scene.tolerance.gouge + part.mesh_deviation();
        let mut checks = vec![Check { solid: &self.cutter, obstacle, needed: -depth }];
        let off = keep.clearance + part.mesh_deviation();
        checks.extend(self.holder.as_ref().map(|solid| Check { solid, obstacle, needed: off }));
        checks.extend(self.keep_off_fixtures(scene, fixtures).checks);
        Interference { checks, greatest_tilt: keep.greatest_tilt, greatest_lift: keep.greatest_lift }
    }

    /// What the planner of an upright tool keeps it away from.
    pub fn keep_off_fixtures<'a>(&'a self, scene: &Scene, fixtures: &'a [FixtureMesh]) -> Interference<'a> {
        let solids = || std::iter::once(&self.cutter).chain(&self.holder);
        let of_one = |(mesh, bvh): &'a FixtureMesh| {
            let obstacle = Obstacle::new(mesh, bvh);
            solids().map(move |solid| Check { solid, obstacle, needed: scene.keep_clear.clearance })
        };
        Interference { checks: fixtures.iter().flat_map(of_one).collect(), ..Interference::default() }
    }
}

/// A tool and what it must not touch.
#[derive(Clone, Copy)]
pub(crate) struct Around<'a> {
    /// The tool.
    pub tool: &'a Tool,
    /// The part with triangles near enough to its surface for the tool to be kept off them.
    pub near: &'a Part,
    /// Clamps and the like.
    pub fixtures: &'a [FixtureMesh],
}
