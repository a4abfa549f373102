//! Toolpaths that cut the same block one after the other: `stock = "previous"`.
//!
//! The surface that is judged is what all of them leave. So what is measured are their moves as one path;
//! lengths, times, removal and clearance are those of the last toolpath's own moves, in the stock that those
//! before it left.

use std::borrow::Cow;
use std::sync::Arc;

use cutter::{Cutter, Holder};
use geometry::{Point2, Point3};
use metrology::View;
use motion::{Cutters, PathsInTurn, ROUNDING, Toolpath};
use scene::Scene;
use sim::ZMap;
use toolpath::Rest;

use super::Outcome;
use super::judge::highest_reached;
use super::tool::ToolMoves;

/// A toolpath that cut before another one.
#[derive(Debug, Clone)]
pub(crate) struct EarlierPath {
    /// What the user calls it.
    pub name: String,
    /// Its own moves.
    pub path: Toolpath,
    /// What cut.
    pub cutters: Cutters,
    /// What held each of them.
    pub holders: Vec<Option<Holder>>,
    /// Where it and those before it left more than ridges may be.
    pub left: Arc<Rest>,
}

impl EarlierPath {
    /// What a toolpath left.
    pub fn of(outcome: &Outcome, scene: &Scene) -> Self {
        let Outcome { result, path, cutters, holders, measurement, view, .. } = outcome;
        let left = match view {
            View::Heights(ZMap { grid, .. }) => {
                let limit = scene.tolerance.scallop;
                let above = |deviation: &f32| f64::from(*deviation) > limit;
                let stands = measurement.deviation_map.iter().map(above).collect();
                let rest = Rest::new(grid.origin, grid.cell, [grid.nx, grid.ny], stands);
                // Between the centres of cells, and along borders.
                let highest = highest_reached(measurement);
                let highest = highest.at_mm.map(|at| (Point3::from(at), highest.at_most()));
                let places = measurement.above.iter().map(|place| (place.at, place.height)).chain(highest);
                rest.and(places.filter(|(_, height)| *height > limit - 2.0 * ROUNDING).map(|(at, _)| at.xy()))
            }
            // No toolpath goes on behind these.
            View::Normals(_) => Rest::new(Point2::origin(), 1.0, [0; 2], Vec::new()),
        };
        Self {
            name: result.name.clone(),
            path: path.clone(),
            cutters: cutters.clone(),
            holders: holders.clone(),
            left: Arc::new(left),
        }
    }

    /// Its moves by cutter.
    pub fn stretches(&self) -> impl Iterator<Item = (Cutter, Toolpath)> + '_ {
        let stretches = self.cutters.stretches(&self.path).into_iter();
        stretches.map(|stretch| (*stretch.cutter, stretch.path.into_owned()))
    }
}

/// The moves of a toolpath behind those of the toolpaths before it.
#[derive(Debug)]
pub(crate) struct WholePath<'a> {
    /// All moves.
    pub path: Cow<'a, Toolpath>,
    /// What makes them.
    pub cutters: Cutters,
    /// Index of the first move of each toolpath.
    firsts: Vec<u32>,
}

impl<'a> WholePath<'a> {
    /// Of a toolpath and those before it.
    pub fn new(earlier: &[EarlierPath], own: &'a Toolpath, cutters: &Cutters, rapid_rate: f64) -> Self {
        let Some((begin, others)) = earlier.split_first() else {
            return Self { path: Cow::Borrowed(own), cutters: cutters.clone(), firsts: vec![0] };
        };
        let mut whole = PathsInTurn::new(begin.path.clone());
        let (mut all, mut firsts) = (begin.cutters.clone(), vec![0]);
        let others = others.iter().map(|earlier| (&earlier.path, &earlier.cutters));
        for (path, cutters) in others.chain([(own, cutters)]) {
            let first = whole.push(path.clone(), rapid_rate);
            firsts.push(first);
            all = all.and_then(first - 2, first, cutters);
        }
        Self { path: Cow::Owned(whole.finish()), cutters: all, firsts }
    }

    /// The moves of each tool of each toolpath; the rapids between them are left out. `own` are those of the
    /// last one.
    pub fn tools<'b>(&self, earlier: &'b [EarlierPath], own: &'b [ToolMoves<'b>]) -> Vec<ToolMoves<'b>> {
        let of_one = |before: &'b EarlierPath| ToolMoves::of(&before.cutters, &before.holders, &before.path);
        let all = earlier.iter().map(of_one).chain([own.to_vec()]);
        let behind = |(first, tools): (&u32, Vec<ToolMoves<'b>>)| {
            let first = *first;
            tools.into_iter().map(move |tool| ToolMoves { first: tool.first + first, ..tool })
        };
        self.firsts.iter().zip(all).flat_map(behind).collect()
    }

    /// Which toolpath makes a move, and which of its moves it is.
    pub fn own_move(&self, move_index: u32) -> (usize, u32) {
        // The two rapids before it lead to a toolpath.
        let toolpath = self.firsts.partition_point(|first| first.saturating_sub(2) <= move_index).max(1) - 1;
        (toolpath, move_index.saturating_sub(self.firsts[toolpath]))
    }
}
