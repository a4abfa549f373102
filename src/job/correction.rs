//! The loop: plan, cut, measure the ridges, and plan again with passes nearer to each other where ridges stand above the
//! target, or all farther apart where none comes near it.
//!
//! Enters: a toolpath that is planned by a scallop height. Leaves: the best of a few plans, and what each round found. A
//! round measures ridges only, on cells as coarse as show every pass. What the toolpath is judged by is measured anew.
//!
//! The second plan is narrower where ridges of the first exceed the target. A plan whose function is fitted anew has its
//! highest ridges elsewhere; so if that does not hold the target either, the third has all widths of the better one in
//! proportion, which leaves its passes in shape.

use std::sync::Arc;

use serde::Serialize;

use metrology::{Engine, RidgeMap, Simulation, path_figures};
use scene::ToolpathRequest;
use toolpath::{Correction, PartKind, Step, plane_interval};
use work::monitor::{self, Monitor};

use super::planned::Planned;
use super::tool::Around;
use super::{JobError, Session};

/// Most plans that are made. Each further one costs as much as the first, and mends less.
const MOST_ROUNDS: usize = 3;

/// A plan whose highest ridge is within this share below the target is as wide as it should be. What is corrected is aimed
/// at the middle of it, since points and chords of a new plan lie elsewhere.
const SLACK: f64 = 0.02;

/// No width is corrected by more than this factor in a round.
const MOST_NARROWED: f64 = 0.5;

/// Cells from pass to pass while only ridges are measured.
const CELLS_A_PASS: f64 = 4.0;

/// What a round of the loop found.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct CorrectionRound {
    /// The highest ridge, mm.
    pub highest_mm: f64,
    /// The highest remnant along a border, mm.
    pub border_mm: f64,
    /// Bound of its error.
    pub error_bound_mm: f64,
    /// Half of the ridge length is lower, mm.
    pub median_mm: f64,
    /// Length of all moves that feed along passes, mm.
    pub cutting_length_mm: f64,
    /// Least and greatest factor of the widths that the round was planned with.
    pub factors: [f64; 2],
}

/// The rounds of the loop.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct CorrectionFigures {
    /// What no ridge may exceed, mm.
    pub target_mm: f64,
    /// All rounds, in order.
    pub rounds: Vec<CorrectionRound>,
    /// The round whose plan was kept, counted from 1.
    pub kept: usize,
}

impl CorrectionRound {
    fn of(map: &RidgeMap, planned: &Planned, correction: &Correction) -> Option<Self> {
        Some(Self {
            highest_mm: map.scallop.max_mm?,
            border_mm: map.borders.iter().map(|place| place.height).fold(0.0, f64::max),
            error_bound_mm: map.scallop.error_bound_mm?,
            median_mm: map.scallop.p50_mm?,
            cutting_length_mm: path_figures(&planned.plan.path, 0.0).cutting_length_mm,
            factors: correction.range(),
        })
    }

    /// What is highest, mm. Its bound is that of coarse cells and decides nothing.
    fn highest(&self) -> f64 {
        self.highest_mm.max(self.border_mm)
    }

    /// Whether no ridge exceeds the target.
    fn holds(&self, target: f64) -> bool {
        self.highest() <= target
    }

    /// Whether this round is to be kept instead of another: first what holds the target, then what is shorter; where neither
    /// holds it, the one with the lower ridge.
    fn is_better(&self, other: &Self, target: f64) -> bool {
        match (self.holds(target), other.holds(target)) {
            (true, true) => self.cutting_length_mm < other.cutting_length_mm,
            (false, false) => self.highest() < other.highest(),
            (holds, _) => holds,
        }
    }
}

impl Session {
    /// Plans one toolpath, in rounds where its ridges are to be measured and corrected.
    pub(crate) fn plan_in_rounds(
        &self,
        request: &ToolpathRequest,
        around: Around<'_>,
        engine: &dyn Engine,
        monitor: &dyn Monitor,
    ) -> Result<Planned, JobError> {
        let surface = request.strategy.definition().part == PartKind::Surface;
        let (Step::Scallop(target), true) =
            (request.step, self.scene.correct && surface && engine.maps_ridges())
        else {
            return self.plan(request, around, None, monitor);
        };
        let asked = (request, around, engine);
        let mut correction = Correction::default();
        let (mut best, map) = self.round(asked, &correction, monitor)?;
        // Without ridges there is nothing to correct.
        let Some(first) = CorrectionRound::of(&map, &best, &correction) else { return Ok(best) };
        let (mut rounds, mut kept) = (vec![first], 0);
        while rounds.len() < MOST_ROUNDS {
            let round = rounds[kept];
            let next = if rounds.len() == 1 && !round.holds(target) {
                narrowed(&map, target, plane_interval(&self.scene.cutter, request.step))
            } else if round.highest_mm > target
                || rounds.len() == 1 && round.highest_mm < (1.0 - SLACK) * target
            {
                // Remnants along borders do not go with the width of all passes.
                correction.scaled((aim(target) / round.highest_mm).sqrt().max(MOST_NARROWED))
            } else {
                break;
            };
            let (planned, ridges) = self.round(asked, &next, monitor)?;
            let Some(found) = CorrectionRound::of(&ridges, &planned, &next) else { break };
            if found.is_better(&round, target) {
                (best, kept, correction) = (planned, rounds.len(), next);
            }
            rounds.push(found);
        }
        best.correction = Some(CorrectionFigures { target_mm: target, rounds, kept: kept + 1 });
        Ok(best)
    }

    /// A plan and its ridges.
    fn round(
        &self,
        (request, around, engine): (&ToolpathRequest, Around<'_>, &dyn Engine),
        correction: &Correction,
        monitor: &dyn Monitor,
    ) -> Result<(Planned, RidgeMap), JobError> {
        monitor::check(monitor)?;
        let correction = Some(Arc::new(correction.clone()));
        let planned = self.plan(request, around, correction, monitor)?;
        let map = self.ridges(request, engine, &planned, monitor)?;
        Ok((planned, map))
    }

    /// The ridges that a plan leaves.
    fn ridges(
        &self,
        request: &ToolpathRequest,
        engine: &dyn Engine,
        planned: &Planned,
        monitor: &dyn Monitor,
    ) -> Result<RidgeMap, JobError> {
        let scene = &self.scene;
        monitor.start("measuring the ridges of a plan", 0);
        let cell = scene.simulation.cell.max(plane_interval(&scene.cutter, request.step) / CELLS_A_PASS);
        let simulation = Simulation { cell, cell_is_auto: true, ..scene.simulation };
        let cells =
            self.budget().grid_before_planning(&self.area(), &simulation).map_err(JobError::grid(scene))?;
        let task = self.task(&planned.plan.path, &simulation, &cells);
        engine.ridges(&task, monitor).map_err(|reason| JobError::engine(scene, &request.name, reason))
    }
}

/// The height that corrected ridges are to have, mm.
fn aim(target: f64) -> f64 {
    (1.0 - 0.5 * SLACK) * target
}

/// The factors that bring ridges above the target to the middle of the slack: height goes with the square of width.
fn narrowed(map: &RidgeMap, target: f64, interval: f64) -> Correction {
    let factor = |height: f64| {
        if height > target { (aim(target) / height).sqrt().max(MOST_NARROWED) } else { 1.0 }
    };
    // The highest place stands between those that cells show.
    let highest =
        map.scallop.max_at_mm.zip(map.scallop.max_mm).map(|(at, height)| (at.into(), factor(height)));
    // Borders that are lower than need be say nothing of the passes further in.
    let borders = map.borders.iter().filter(|place| place.height > target);
    let places = map.places.iter().chain(borders).map(|ridge| (ridge.at, factor(ridge.height)));
    let places: Vec<_> = places.chain(highest).collect();
    Correction::new(&places, interval)
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::Point3;
    use metrology::{RidgePlace, ScallopFigures};
    use scene::Scene;
    use work::monitor::Silent;

    /// A part of a wave under a ball of 6 mm.
    const SCENE: &str = "[part]\nsurface = \"wave\"\namplitude = 0.8\nwavelength_x = 25\nwavelength_y = 30\nx = [-8, 8]\ny = [-8, 8]\n[cutter]\nshape = \"ball\"\n\
                         diameter = 6\n[tolerance]\nscallop = 0.05\nchord = 0.005\n";

    fn planned(correct: bool, toolpath: &str) -> report::ToolpathResult {
        let text = format!("{SCENE}correct = {correct}\n[[toolpath]]\n{toolpath}\n");
        let session = Session::new(Scene::parse("bump.toml", text).unwrap()).unwrap();
        session.toolpath(&session.scene.toolpaths[0], &Silent).unwrap().result
    }

    fn figure(result: &report::ToolpathResult) -> Option<&serde_json::Value> {
        result.figures.iter().find(|figure| figure.key == "correction").map(|figure| &figure.value)
    }

    #[test]
    fn rounds_bring_ridges_toward_the_target() {
        for toolpath in ["strategy = \"streamline\"", "strategy = \"iso-parametric\""] {
            let [open, closed] = [false, true].map(|correct| planned(correct, toolpath));
            assert!(figure(&open).is_none());
            let rounds = figure(&closed).unwrap()["rounds"].as_array().unwrap();
            assert!((1..=MOST_ROUNDS).contains(&rounds.len()));
            let [before, after] = [&open, &closed].map(|result| result.scallop.max_mm.unwrap());
            assert!(after <= before.max(0.05), "{toolpath}: {before} {after} {rounds:?}");
        }
        assert!(figure(&planned(true, "strategy = \"zigzag\"\nstepover = 0.5")).is_none());
    }

    #[test]
    fn what_holds_the_target_is_better_and_then_what_is_shorter() {
        let round = |highest_mm: f64, cutting_length_mm: f64| CorrectionRound {
            highest_mm,
            border_mm: 0.0,
            error_bound_mm: 0.1,
            median_mm: 0.9,
            cutting_length_mm,
            factors: [1.0; 2],
        };
        let better = |a: CorrectionRound, b: CorrectionRound| a.is_better(&b, 1.0);
        assert!(better(round(0.8, 20.0), round(1.05, 10.0)) && !better(round(1.05, 10.0), round(0.8, 20.0)));
        assert!(better(round(0.8, 9.0), round(0.7, 10.0)) && better(round(1.1, 20.0), round(1.2, 10.0)));
    }

    #[test]
    fn widths_go_with_the_root_of_heights_above_the_target() {
        let ridges = [(0.0, 1.2), (10.0, 0.99), (20.0, 0.5)];
        let places = ridges.map(|(x, height)| RidgePlace { at: Point3::new(x, 0.0, 0.0), height });
        let border = RidgePlace { at: Point3::new(40.0, 0.0, 0.0), height: 1.1 };
        let map =
            RidgeMap { places: places.to_vec(), borders: vec![border], scallop: ScallopFigures::default() };
        let found = narrowed(&map, 1.0, 1.0);
        assert!((found.at(&border.at) - (0.99f64 / 1.1).sqrt()).abs() < 1e-12);
        let found = places.map(|place| found.at(&place.at));
        let wanted = [(0.99f64 / 1.2).sqrt(), 1.0, 1.0];
        assert!(found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}");
    }
}
