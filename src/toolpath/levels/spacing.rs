//! Where the levels of whole passes stand.
//!
//! Neighbouring levels c and c + δ lie δ/|∇ψ| apart on the surface, so at a place with strip width w a
//! step of `w·|∇ψ|` is allowed. A pass meets places that allow much and places that allow little. A
//! step for the least of them serves all, and wastes length wherever more is allowed; a greater step
//! needs further passes, at halves and quarters of the interval, along the places that allow less.
//! For every part of the range of ψ the step is chosen that makes the sum of both shortest. (LevelSteps
//! each pass at the least step of the one before, as streamline paths were first planned, is the
//! choice of the least step throughout.)

use crate::surface::chart::{Chart, ChartPoint};
use crate::vocabulary::PassSettings;
use cutter::Cutter;
use field::{ScalarField, surface_gradient_length};
use geometry::Vector3;

/// Places a side of a chart at which the allowed step is computed.
const SAMPLES: usize = 240;

/// Parts of the range of ψ with a step of their own. More follow the surface closer; fewer places
/// then speak for each.
const WINDOWS: usize = 48;

/// Shares of the length (of level curves, not of places) whose allowed step is tried as the step.
const CANDIDATES: [f64; 12] = [0.0, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.45, 0.6, 0.8, 1.0];

/// A step this share wider than allowed is not worth a further pass: 0.2 % are 0.4 % of the scallop height.
const TOLERATED: f64 = 0.002;

/// What each halving adds to the length of the passes that it puts in: overlaps and air moves.
const HALVING_COST: f64 = 0.1;

/// No step is less than this share of the median: a critical point of ψ allows none at all.
const LEAST_OVER_MEDIAN: f64 = 1e-3;

/// Unit tangent in space of the level curve of `field` through a chart point.
pub(crate) fn level_tangent(p: &ChartPoint, field: &ScalarField, [u, v]: [f64; 2]) -> Option<Vector3> {
    let [_, psi_u, psi_v] = field.value_and_gradient(u, v);
    (p.jet.du * psi_v - p.jet.dv * psi_u).try_normalize(1e-300)
}

/// What a place allows.
#[derive(Debug, Clone, Copy)]
pub(crate) struct AllowedStep {
    pub psi: f64,
    /// The allowed step of ψ.
    pub step: f64,
    /// Length of level curves per step of ψ around the place: its area times |∇ψ|.
    pub length: f64,
    /// The surface is nearly as concave as the cutter there, or more.
    pub too_concave: bool,
}

/// How levels step from pass to pass.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LevelSteps {
    /// As wide as makes the passes, with further short ones where the step is too wide, shortest in all.
    Shortest,
    /// The same step throughout, the one with the shortest passes in all.
    Constant,
    /// Each step the least that the pass before and the next one allow at any of their places.
    Least,
}

/// What the places of a chart allow.
pub(crate) fn places_of(
    chart: &Chart,
    cutter: &Cutter,
    field: &ScalarField,
    settings: &PassSettings,
) -> Vec<AllowedStep> {
    let at = |[u, v]: [f64; 2]| {
        let p = chart.at(u, v)?;
        let t = level_tangent(&p, field, [u, v])?;
        let [psi, psi_u, psi_v] = field.value_and_gradient(u, v);
        let (e, f, g) = p.jet.first_form();
        let gradient = surface_gradient_length((e, f, g), psi_u, psi_v);
        let (width, too_concave) = chart.interval(&p, cutter, &t, settings.step);
        let area = (e * g - f * f).max(0.0).sqrt();
        Some(AllowedStep { psi, step: width * gradient, length: area * gradient, too_concave })
    };
    chart.grid(SAMPLES).filter_map(at).collect()
}

/// The levels of all whole passes, ascending.
pub(crate) fn place_levels(
    places: &[AllowedStep],
    [lo, hi]: [f64; 2],
    placing: LevelSteps,
    notes: &mut Vec<String>,
) -> Vec<f64> {
    let count_of_windows = match placing {
        LevelSteps::Shortest => WINDOWS,
        LevelSteps::Constant => 1,
        LevelSteps::Least => SAMPLES,
    };
    if hi <= lo {
        return vec![lo];
    }
    let mut windows: Vec<Vec<AllowedStep>> = vec![Vec::new(); count_of_windows];
    for place in places {
        let share = (place.psi - lo) / (hi - lo);
        let window = (share * count_of_windows as f64).clamp(0.0, count_of_windows as f64 - 1.0) as usize;
        windows[window].push(*place);
    }
    let (limited, count) = (places.iter().filter(|p| p.too_concave).count(), places.len());
    if limited > 0 {
        notes.push(format!(
            "on {:.1} % of the surface the part is nearly as concave as the cutter, or more: the strip is limited there",
            100.0 * limited as f64 / count as f64
        ));
    }
    let mut all: Vec<f64> = windows.iter().flatten().map(|p| p.step).collect();
    all.sort_by(f64::total_cmp);
    let least = LEAST_OVER_MEDIAN * all.get(all.len() / 2).copied().unwrap_or(hi - lo);
    if placing == LevelSteps::Least {
        let least_of =
            |places: &Vec<AllowedStep>| places.iter().map(|p| p.step.max(least)).min_by(f64::total_cmp);
        let steps: Vec<Option<f64>> = windows.iter().map(least_of).collect();
        return one_after_the_other(&filled(&steps, hi - lo), [lo, hi]);
    }
    let steps: Vec<Option<f64>> = windows.iter().map(|places| shortest(places, least)).collect();
    spread(&filled(&steps, hi - lo), [lo, hi])
}

/// The step with the shortest passes for places that share a window; `None` for none.
fn shortest(places: &[AllowedStep], least: f64) -> Option<f64> {
    let mut ordered = places.to_vec();
    ordered.sort_by(|a, b| a.step.total_cmp(&b.step).then(a.psi.total_cmp(&b.psi)));
    let total: f64 = ordered.iter().map(|p| p.length).sum();
    let mut below = 0.0;
    let mut candidates = CANDIDATES.iter().peekable();
    let mut tried = Vec::new();
    for place in &ordered {
        below += place.length;
        while candidates.next_if(|share| below >= **share * total).is_some() {
            tried.push(place.step.max(least));
        }
    }
    let cost = |step: f64| {
        let per_place = ordered.iter().map(|p| {
            let halvings = (step / (p.step.max(least) * (1.0 + TOLERATED))).log2().ceil().max(0.0);
            p.length * halvings.exp2() * (1.0 + HALVING_COST * halvings)
        });
        per_place.sum::<f64>() / step
    };
    tried.into_iter().map(|step| (cost(step), step)).min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, step)| step)
}

/// Gives windows without places the step of the nearest one with places, the lesser of two.
fn filled(steps: &[Option<f64>], range: f64) -> Vec<f64> {
    (0..steps.len())
        .map(|k| {
            let known = |k: Option<usize>| k.and_then(|k| steps.get(k).copied().flatten());
            (0..steps.len())
                .find_map(|d| match (known(k.checked_sub(d)), known(Some(k + d))) {
                    (Some(a), Some(b)) => Some(a.min(b)),
                    (a, b) => a.or(b),
                })
                .unwrap_or(range)
        })
        .collect()
}

/// Levels at equal shares of the running sum of 1/step, half a share from both ends.
fn spread(steps: &[f64], [lo, hi]: [f64; 2]) -> Vec<f64> {
    let width = (hi - lo) / steps.len() as f64;
    let mut sums = vec![0.0];
    for step in steps {
        sums.push(sums[sums.len() - 1] + width / step);
    }
    let total = sums[steps.len()];
    let passes = ((1.0 - TOLERATED) * total).ceil().max(1.0);
    let mut window = 0;
    (0..passes as usize)
        .map(|k| {
            let wanted = total * (k as f64 + 0.5) / passes;
            while window + 1 < steps.len() && sums[window + 1] < wanted {
                window += 1;
            }
            lo + width * (window as f64 + (wanted - sums[window]) / (sums[window + 1] - sums[window]))
        })
        .collect()
}

/// Levels from the lower end, each the least step after the one before that holds at both, half a step from
/// the ends.
fn one_after_the_other(steps: &[f64], [lo, hi]: [f64; 2]) -> Vec<f64> {
    let width = (hi - lo) / steps.len() as f64;
    let window = |level: f64| (((level - lo) / width).max(0.0) as usize).min(steps.len() - 1);
    // The least over all windows from one level to another.
    let least = |a: f64, b: f64| steps[window(a)..=window(b)].iter().copied().fold(f64::INFINITY, f64::min);
    let step = |level: f64| least(level, level + steps[window(level)]);
    let mut levels = vec![(lo + 0.5 * step(lo)).min(0.5 * (lo + hi))];
    loop {
        let last = levels[levels.len() - 1];
        let next = last + step(last);
        if hi - last <= 0.5 * step(last) {
            return levels;
        }
        levels.push(next.min(hi));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn place(step: f64, length: f64) -> AllowedStep {
        AllowedStep { psi: 0.0, step, length, too_concave: false }
    }

    #[test]
    fn few_tight_places_get_further_passes_and_many_decide_the_step() {
        let mut places = vec![place(1.0, 1.0); 98];
        places.extend([place(0.2, 1.0); 2]);
        assert_eq!(shortest(&places, 1e-3), Some(1.0));
        let half: Vec<AllowedStep> = (0..100).map(|k| place(if k < 50 { 0.9 } else { 1.0 }, 1.0)).collect();
        assert_eq!(shortest(&half, 1e-3), Some(0.9));
        assert_eq!(shortest(&[], 1e-3), None);
    }

    #[test]
    fn levels_share_the_range_evenly_and_begin_half_a_step_inside() {
        let levels = spread(&[0.5; 8], [0.0, 4.0]);
        assert_eq!(levels.len(), 8);
        assert!((levels[0] - 0.25).abs() < 1e-12 && (levels[7] - 3.75).abs() < 1e-12);
        let uneven = spread(&[1.0, 0.25], [0.0, 2.0]);
        assert_eq!(uneven.len(), 5);
        assert!(uneven.windows(2).all(|w| w[1] > w[0]));
    }

    #[test]
    fn least_steps_follow_one_another_and_hold_at_both_ends() {
        let levels = one_after_the_other(&[0.5; 8], [0.0, 4.0]);
        assert_eq!(levels, [0.25, 0.75, 1.25, 1.75, 2.25, 2.75, 3.25, 3.75]);
        let levels = one_after_the_other(&[1.0, 1.0, 0.25, 1.0], [0.0, 4.0]);
        assert!(
            levels
                .windows(2)
                .all(|w| w[1] - w[0] <= 1.0 && (w[1] <= 2.0 || w[0] >= 3.0 || w[1] - w[0] <= 0.25))
        );
        assert!(4.0 - levels[levels.len() - 1] <= 0.5);
        assert_eq!(one_after_the_other(&[9.0], [0.0, 1.0]), [0.5]);
    }

    #[test]
    fn empty_windows_take_the_nearest_step() {
        assert_eq!(filled(&[None, Some(2.0), None, None, Some(1.0)], 9.0), [2.0, 2.0, 2.0, 1.0, 1.0]);
        assert_eq!(filled(&[None, None], 9.0), [9.0, 9.0]);
    }
}
