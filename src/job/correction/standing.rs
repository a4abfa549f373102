//! What a plan leaves above the design, as the loop sees it.

use std::hash::{DefaultHasher, Hash as _, Hasher as _};

use geometry::Point3;
use metrology::{Bounded, RidgeMap, path_figures};
use motion::Toolpath;
use part::Part;
use toolpath::Faces;
use work::monitor::{Cancelled, Monitor};

use super::hollows::Hollows;
use super::looking::Looked;
use super::round::CorrectionRound;
use super::{NEVER_CUT, SLACK};
use crate::judge::highest_reached;
use crate::planned::Planned;

/// What a plan leaves above the design.
#[derive(Clone)]
pub(super) struct Standing {
    /// As a round tells it, its length and factors aside.
    pub(super) round: CorrectionRound,
    /// Places near the target and above it with their heights, mm.
    pub(super) above: Vec<(Point3, f64)>,
    /// Places above the target that nearer passes do not take lower, likewise.
    pub(super) in_hollows: Vec<(Point3, f64)>,
    /// How deep it cuts below the design for certain, mm; 0 while only ridges are measured.
    pub(super) depth: f64,
    /// How high stands for certain what it does not reach, mm; 0 while only ridges are measured.
    pub(super) unreached: f64,
    /// Whether it never cuts a place that no cell sees, whose height is left out.
    pub(super) is_never_cut: bool,
}

impl Standing {
    /// `None` without ridges: there is nothing to correct.
    pub(super) fn of_ridges(
        map: &RidgeMap,
        planned: &Planned,
        factors: [f64; 2],
        wanted: Wanted<'_>,
    ) -> Option<Self> {
        let highest_ridge = map.scallop.max_mm?;
        let round = CorrectionRound {
            highest_mm: highest_ridge,
            border_mm: Some(map.border),
            error_bound_mm: map.scallop.error_bound_mm.filter(|_| highest_ridge >= map.border),
            median_mm: map.scallop.p50_mm,
            over_target_fraction: map.scallop.over_target_fraction,
            cutting_length_mm: cutting_length(planned),
            factors,
            too_near_between_mm: too_near(planned),
            avoidable_mm: f64::INFINITY,
            measured: false,
            of_cells_alone: false,
        };
        let places = map.above.iter().map(|place| (place.at, place.height));
        // The highest place stands between those that cells show.
        let highest = map.scallop.max_at_mm.map(|at| (at.into(), round.highest_mm));
        let above = places.chain(highest).collect();
        let standing =
            Self { round, above, in_hollows: Vec::new(), depth: 0.0, unreached: 0.0, is_never_cut: false };
        Some(standing.served(&planned.plan.kept.faces, wanted))
    }

    /// Where cells see no ridge, of what stands along borders alone.
    pub(super) fn of_all(looked: &Looked, planned: &Planned, factors: [f64; 2], wanted: Wanted<'_>) -> Self {
        let measured = &looked.measured.measurement;
        let scallop = &measured.scallop;
        let (seen, reached) = (highest_reached(measured), measured.excess.reached);
        let unseen = looked.unseen();
        let of_unseen = unseen.map_or(Bounded::default(), |unseen| unseen.excess.highest);
        let highest = scallop.max_mm.unwrap_or_default();
        let on_border = reached.max_mm.max(of_unseen.max_mm) > highest;
        let round = CorrectionRound {
            highest_mm: highest,
            border_mm: on_border.then_some(reached.max_mm.max(of_unseen.max_mm)),
            error_bound_mm: Some(seen.or(&of_unseen).error_bound_mm),
            median_mm: scallop.p50_mm,
            over_target_fraction: scallop.over_target_fraction,
            cutting_length_mm: cutting_length(planned),
            factors,
            too_near_between_mm: too_near(planned),
            avoidable_mm: f64::INFINITY,
            measured: true,
            of_cells_alone: looked.of_cells_alone,
        };
        let places = measured.above.iter().chain(unseen.iter().flat_map(|unseen| &unseen.above));
        let places = places.map(|place| (place.at, place.height));
        let ridge = scallop.max_at_mm.map(|at| (at.into(), highest));
        let others = [reached, of_unseen].map(|place| place.at_mm.map(|at| (at.into(), place.max_mm)));
        let above = places.chain(ridge).chain(others.into_iter().flatten()).collect();
        let gouge = &measured.gouge;
        let depth = gouge.at_least_mm.max(gouge.max_depth_mm - gouge.error_bound_mm);
        let of_unseen = unseen.map_or(0.0, |unseen| unseen.excess.unreached.at_least_mm);
        let unreached = measured.excess.unreached.at_least_mm.max(of_unseen);
        let is_never_cut = looked.is_never_cut();
        Self { round, above, in_hollows: Vec::new(), depth, unreached, is_never_cut }
            .served(&planned.plan.kept.faces, wanted)
    }

    /// Of the faces alone that passes are made for: no widths help others. Edges between both are theirs once
    /// those are cut. What stands high is left to a toolpath behind that is for the rest.
    fn served(mut self, faces: &Faces, wanted: Wanted<'_>) -> Self {
        if *faces == Faces::ALL && wanted.highest == f64::INFINITY {
            return self;
        }
        let mesh = wanted.part.mesh();
        self.above.retain(|(at, height)| {
            if *height > wanted.highest {
                return false;
            }
            if *faces == Faces::ALL {
                return true;
            }
            let foot = wanted.part.closest_point(at).0;
            let around = mesh.triangles_at(foot.triangle as usize, &foot.point);
            let mut held = around.into_iter().map(|t| faces.hold(&mesh.normal(t)));
            if wanted.behind_others { held.any(|held| held) } else { held.all(|held| held) }
        });
        let highest = self.above.iter().map(|(_, height)| *height);
        // What is not among the places stays below the target.
        let highest = highest.fold((1.0 - SLACK) * wanted.target, f64::max);
        let round = &mut self.round;
        if round.highest() > highest {
            round.error_bound_mm = None;
        }
        round.highest_mm = round.highest_mm.min(highest);
        round.border_mm = round.border_mm.map(|border| border.min(highest));
        self
    }

    /// Leaves what another plan may leave lower. What is not among the places stays below the target.
    pub(super) fn set_aside(
        &mut self,
        hollows: &mut Hollows<'_>,
        target: f64,
        monitor: &dyn Monitor,
    ) -> Result<(), Cancelled> {
        let taken = hollows.taken_from(&mut self.above, monitor)?;
        self.in_hollows.extend(taken);
        let heights = self.above.iter().map(|(_, height)| *height);
        self.round.avoidable_mm = heights.fold((1.0 - SLACK) * target, f64::max);
        Ok(())
    }
}

/// How deep a plan cuts below the design, against how deep it may.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Cut {
    Allowed,
    TooDeep,
    /// Deeper by more times than widths change anything at.
    FarTooDeep,
}

impl Cut {
    /// Of a depth and the gouge tolerance, mm.
    pub(super) fn of(depth: f64, gouge: f64) -> Self {
        match depth {
            _ if depth > NEVER_CUT * gouge => Self::FarTooDeep,
            _ if depth > gouge => Self::TooDeep,
            _ => Self::Allowed,
        }
    }
}

/// What a plan is to leave, and on what.
#[derive(Clone, Copy)]
pub(super) struct Wanted<'a> {
    pub(super) part: &'a Part,
    /// What no ridge may exceed, mm.
    pub(super) target: f64,
    /// What stands higher is a matter of another toolpath, mm.
    pub(super) highest: f64,
    /// Whether what others left is all that is cut.
    pub(super) behind_others: bool,
}
/// [`CorrectionRound::cutting_length_mm`] of a plan.
pub(super) fn cutting_length(planned: &Planned) -> f64 {
    path_figures(&planned.plan.path, 0.0).cutting_length_mm
}

/// [`CorrectionRound::too_near_between_mm`] of a plan.
pub(super) fn too_near(planned: &Planned) -> Option<f64> {
    Some(planned.plan.too_near_between).filter(|missing| *missing > 0.0)
}

/// What tells paths apart: equal ones have equal numbers.
pub(super) fn digest(path: &Toolpath) -> u64 {
    let mut hasher = DefaultHasher::new();
    for step in &path.moves {
        let place = step.to.tip.iter().chain(step.to.axis.iter());
        place.for_each(|x| x.to_bits().hash(&mut hasher));
        (step.kind as u8).hash(&mut hasher);
    }
    hasher.finish()
}
