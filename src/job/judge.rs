//! The rule by which a toolpath passes, and the words for what violates it.
//!
//! A tolerance is violated when the MEASURED figure exceeds the limit; the bound of the figure's error stands beside it. The
//! limits:
//!
//! - scallop: 95 % of the ridge length stay below the scallop tolerance, and the highest ridge below [`HIGHEST_RIDGE`] times
//!   that. A planner steps for the tolerance itself and meets it up to its own discretisation, so that the highest ridge
//!   would otherwise fail by a hair in the best of plans.
//! - gouge: the greatest depth stays within the gouge tolerance.
//! - uncut: no place stands higher than the uncut tolerance.
//! - what the figures of [`figures`](super::figures) find: rapid moves in stock, collisions, walls of pockets.

use metrology::{Limits, Measurement};
use report::{HIGHEST_RIDGE, MapMark, Verdict, Violation, micrometres, place, with_bound};

/// Kinds of violations, the gravest first.
const GRAVITY: [&str; 6] = ["collision", "wall", "rapid", "gouge", "uncut", "scallop"];

/// The rank of a kind of violation; a kind that has none comes after all that have one.
fn gravity(what: &str) -> usize {
    GRAVITY.iter().position(|kind| *kind == what).unwrap_or(GRAVITY.len())
}

/// The verdict on a measured toolpath, and what violates its limits, the gravest kind first. `found` are the violations of
/// further figures.
pub(crate) fn judge(
    measured: &Measurement,
    limits: &Limits,
    found: Vec<Violation>,
) -> (Verdict, Vec<Violation>) {
    let mut violations = found;
    violations.extend(gouge(measured, limits));
    violations.extend(uncut(measured, limits));
    violations.extend(scallop(measured, limits));
    violations.sort_by_key(|violation| gravity(violation.what));
    (if violations.is_empty() { Verdict::Pass } else { Verdict::Fail }, violations)
}

fn gouge(measured: &Measurement, limits: &Limits) -> Option<Violation> {
    let figures = &measured.gouge;
    if figures.max_depth_mm <= limits.gouge {
        return None;
    }
    let mut text = format!(
        "gouge {} µm deep (limit {})",
        with_bound(Some(figures.max_depth_mm), Some(figures.error_bound_mm)),
        micrometres(Some(limits.gouge))
    );
    if let Some(worst) = figures.regions.first() {
        text += &format!(" at {}, move {}", place(worst.at_mm), worst.move_index);
        // Paths that tilt the tool have no program where the scene names no machine for it.
        if worst.line > 0 {
            text += &format!(", toolpath.nc line {}", worst.line);
        }
        text += &others(figures.region_count);
    }
    Some(Violation { what: "gouge", limit_mm: limits.gouge, measured_mm: figures.max_depth_mm, text })
}

fn uncut(measured: &Measurement, limits: &Limits) -> Option<Violation> {
    let figures = &measured.uncut;
    let worst = figures.regions.first()?;
    let text = format!(
        "uncut material {} µm high (limit {}) over {:.3} mm² at {}{}",
        with_bound(Some(figures.max_height_mm), Some(figures.error_bound_mm)),
        micrometres(Some(limits.uncut)),
        figures.area_mm2,
        place(worst.at_mm),
        others(figures.region_count)
    );
    Some(Violation { what: "uncut", limit_mm: limits.uncut, measured_mm: figures.max_height_mm, text })
}

fn scallop(measured: &Measurement, limits: &Limits) -> Vec<Violation> {
    let figures = &measured.scallop;
    let violation = |limit: f64, value: Option<f64>, error: Option<f64>, what: &str, place: String| {
        let value = value.filter(|value| *value > limit)?;
        let text = format!(
            "{what} is {} µm (limit {}){place}",
            with_bound(Some(value), error),
            micrometres(Some(limit))
        );
        Some(Violation { what: "scallop", limit_mm: limit, measured_mm: value, text })
    };
    let at = figures.max_at_mm.map_or(String::new(), |at| format!(" at {}", place(at)));
    let highest = violation(
        HIGHEST_RIDGE * limits.scallop,
        figures.max_mm,
        figures.error_bound_mm,
        "the highest scallop",
        at,
    );
    let most = violation(
        limits.scallop,
        figures.p95_mm,
        None,
        "the scallop height that 95 % of the ridges stay below",
        String::new(),
    );
    highest.into_iter().chain(most).collect()
}

/// The gravest places of each kind of violation, named `G1`, `G2` … for gouges, `U1` … for uncut
/// material, in the order of their lists, and `S` for a scallop that is too high.
pub fn marks(measured: &Measurement, limits: &Limits) -> Vec<MapMark> {
    /// More rings of one kind hide the map.
    const MOST: usize = 5;
    let numbered = |letter: char, places: Vec<[f64; 3]>| {
        let named =
            |(k, [x, y, _]): (usize, [f64; 3])| MapMark { at: [x, y], name: format!("{letter}{}", k + 1) };
        places.into_iter().take(MOST).enumerate().map(named).collect::<Vec<_>>()
    };
    let high = measured.scallop.max_mm.is_some_and(|height| height > HIGHEST_RIDGE * limits.scallop);
    let scallop = measured.scallop.max_at_mm.filter(|_| high);
    let mut marks = numbered('G', measured.gouge.regions.iter().map(|r| r.at_mm).collect());
    marks.extend(numbered('U', measured.uncut.regions.iter().map(|r| r.at_mm).collect()));
    marks.extend(scallop.map(|[x, y, _]| MapMark { at: [x, y], name: "S".to_owned() }));
    marks
}

fn others(region_count: usize) -> String {
    match region_count {
        0 | 1 => String::new(),
        2 => ", and one more place".to_owned(),
        n => format!(", and {} more places", n - 1),
    }
}

#[cfg(test)]
mod tests;
