//! Toolpaths that cut the same block one after the other: `stock = "previous"`.
//!
//! The surface that is judged is what all of them leave. So what is measured are their moves as one path;
//! lengths, times, removal and clearance are those of the last toolpath's own moves, in the stock that those
//! before it left.

use std::borrow::Cow;
use std::sync::Arc;

use cutter::{Cutter, Holder};
use geometry::Point2;
use metrology::{RidgePlace, View, cells_above};
use motion::{Cutters, PathsInTurn, Toolpath};
use toolpath::Rest;
use work::monitor::Monitor;

use super::judge::highest_reached;
use super::run::Run;
use super::tool::ToolMoves;
use super::{JobError, Outcome};

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
    /// Where it and those before it left more than ridges may be, if the next one is for that.
    pub left: Option<Arc<Rest>>,
}

impl EarlierPath {
    /// What a toolpath left.
    pub fn of(outcome: &Outcome) -> Self {
        let Outcome { result, path, cutters, holders, rest, .. } = outcome;
        Self {
            name: result.name.clone(),
            path: path.clone(),
            cutters: cutters.clone(),
            holders: holders.clone(),
            left: rest.clone(),
        }
    }

    /// Its moves by cutter.
    pub fn stretches(&self) -> impl Iterator<Item = (Cutter, Toolpath)> + '_ {
        let stretches = self.cutters.stretches(&self.path).into_iter();
        stretches.map(|stretch| (*stretch.cutter, stretch.path.into_owned()))
    }
}

/// Where a toolpath and those before it left more than ridges may be, between the centres of cells and where
/// none sees as well.
///
/// # Errors
/// [`JobError`] when cancelled.
pub(crate) fn left_over(run: &Run<'_>, monitor: &dyn Monitor) -> Result<Rest, JobError> {
    let View::Heights(cut) = run.view() else {
        // No toolpath goes on behind these.
        return Ok(Rest::new(Point2::origin(), 1.0, [0; 2], Vec::new()));
    };
    let Run { session, request, whole, .. } = *run;
    let task = session.task(request, (&whole.path, &whole.cutters), &run.scene().simulation, &session.cells);
    // Programs may be as far off the moves, and the files' surfaces off the meshes.
    let limit = run.scene().tolerance.scallop - whole.path.origin.strays - session.moved();
    let between = cells_above(&task, cut, limit, monitor).map_err(run.heights())?;
    let stands = run.measurement().deviation_map.iter().map(|height| f64::from(*height) > limit).collect();
    let grid = cut.grid;
    let rest = Rest::new(grid.origin, grid.cell, [grid.nx, grid.ny], stands).and_between(between);
    let Some(unseen) = &run.covered.unseen else { return Ok(rest) };
    let found = &unseen.measurement;
    let highest = highest_reached(found);
    let may_be_higher = highest.at_most() > limit;
    let highest = highest.at_mm.map(|at| RidgePlace { at: at.into(), height: highest.max_mm });
    let places = found.above.iter().filter(|place| place.height > limit);
    let places: Vec<RidgePlace> = places.chain(highest.iter().filter(|_| may_be_higher)).copied().collect();
    let foot = |k: usize| {
        let foot = run.part().closest_point(&places[k].at).0;
        (places[k], foot.point, foot.normal)
    };
    let mut all: Vec<_> = unseen.above.iter().map(|(place, normal)| (*place, place.at, *normal)).collect();
    all.extend(work::parallel::map(places.len(), foot));
    let is_met = task.facing().meets(all.len(), |k| (all[k].1, all[k].2));
    let (open, closed): (Vec<_>, Vec<_>) =
        all.into_iter().map(|(place, ..)| place).zip(is_met).partition(|(_, is_met)| *is_met);
    let closed = closed.into_iter().map(|(place, _)| (place.at, place.height));
    let highest = closed.filter(|(_, height)| *height > limit).max_by(|a, b| a.1.total_cmp(&b.1));
    Ok(rest.and(open.into_iter().map(|(place, _)| place.at.xy())).and_out_of_reach(highest))
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

    /// Index of the first move of the last toolpath.
    pub fn own_first(&self) -> u32 {
        self.firsts.last().copied().unwrap_or_default()
    }

    /// Which toolpath makes a move, and which of its moves it is.
    pub fn own_move(&self, move_index: u32) -> (usize, u32) {
        // The two rapids before it lead to a toolpath.
        let toolpath = self.firsts.partition_point(|first| first.saturating_sub(2) <= move_index).max(1) - 1;
        (toolpath, move_index.saturating_sub(self.firsts[toolpath]))
    }
}
