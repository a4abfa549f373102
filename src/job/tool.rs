//! The tool as a solid, what it must keep away from, and the moves of each tool of a path.

use std::borrow::Cow;
use std::sync::Arc;

use collision::{Check, Interference, Obstacle};
use cutter::{Cutter, Holder, Solid};
use geometry::{Bvh, TriangleMesh};
use motion::{Cutters, ROUNDING, Toolpath};
use part::Part;
use scene::{Scene, Tooling};
use toolpath::Rest;

use super::planned::may_stray;

/// How far writing a program may move the tool, mm, with room to spare.
const WRITTEN: f64 = 2.0 * ROUNDING;

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
    /// Of a cutter and what holds it.
    pub fn of(Tooling { cutter, holder, .. }: &Tooling) -> Self {
        Self::new(cutter, holder.as_ref())
    }

    /// As [`Tool::of`].
    pub fn new(cutter: &Cutter, holder: Option<&Holder>) -> Self {
        Self { cutter: Solid::of_cutter(cutter, holder), holder: holder.map(Solid::of_holder) }
    }

    /// How far shank and holder reach from the tip at most, mm.
    pub fn reach(&self) -> f64 {
        self.holder.iter().map(Solid::reach).fold(self.cutter.reach(), f64::max)
    }

    /// What the planner keeps the tool away from: shank and holder from all, the cutter from fixtures, and
    /// from cutting deeper into the part than half the gouge tolerance and what the part's triangles are off
    /// its surface. Joints may lead all of it astray.
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
        let off = keep.clearance + part.mesh_deviation() + may_stray(scene, self) + WRITTEN;
        checks.extend(self.holder.as_ref().map(|solid| Check { solid, obstacle, needed: off }));
        checks.extend(self.keep_off_fixtures(scene, fixtures).checks);
        Interference { checks, greatest_tilt: keep.greatest_tilt, greatest_lift: keep.greatest_lift }
    }

    /// What the planner of an upright tool keeps it away from.
    pub fn keep_off_fixtures<'a>(&'a self, scene: &Scene, fixtures: &'a [FixtureMesh]) -> Interference<'a> {
        let solids = || std::iter::once(&self.cutter).chain(&self.holder);
        let of_one = |(mesh, bvh): &'a FixtureMesh| {
            let obstacle = Obstacle::new(mesh, bvh);
            let needed = scene.keep_clear.clearance + mesh.moved() + may_stray(scene, self) + WRITTEN;
            solids().map(move |solid| Check { solid, obstacle, needed })
        };
        Interference { checks: fixtures.iter().flat_map(of_one).collect(), ..Interference::default() }
    }
}

/// The moves of one tool, for figures that look at one tool after the other.
#[derive(Debug, Clone)]
pub(crate) struct ToolMoves<'a> {
    /// What cuts.
    pub cutter: &'a Cutter,
    /// What holds it.
    pub holder: Option<&'a Holder>,
    /// Index of its first move in the whole path.
    pub first: u32,
    /// Its moves.
    pub path: Cow<'a, Toolpath>,
}

impl<'a> ToolMoves<'a> {
    /// Those of all tools of a path, in the order of the program.
    pub fn of(cutters: &'a Cutters, holders: &'a [Option<Holder>], path: &'a Toolpath) -> Vec<Self> {
        let stretches = cutters.stretches(path).into_iter();
        let of_one = |(stretch, holder): (motion::Stretch<'a>, &'a Option<Holder>)| Self {
            cutter: stretch.cutter,
            holder: holder.as_ref(),
            first: stretch.first,
            path: stretch.path,
        };
        stretches.zip(holders).map(of_one).collect()
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
    /// What the toolpaths before left, where it is for that.
    pub rest: Option<&'a Arc<Rest>>,
}
