//! The rule by which a toolpath passes or is violated, and the words for it.
//!
//! A tolerance is violated when the MEASURED figure exceeds the limit; the bound of the figure's
//! error stands beside it and decides nothing, so that the verdict never depends on how cautious a
//! bound is. The limits:
//!
//! - scallop: 95 % of the ridge length stay below the scallop tolerance, and the highest ridge
//!   below [`HIGHEST_RIDGE`] times that. A planner steps for the tolerance itself and meets it up
//!   to its own discretisation, so that the highest ridge would otherwise fail by a hair in the
//!   best of plans.
//! - gouge: the greatest depth stays within the gouge tolerance.
//! - uncut: no place stands higher than the uncut tolerance.

use serde::Serialize;

use crate::metrology::{Limits, Measurement};

/// The highest ridge may exceed the scallop tolerance by this factor. Less fails plans for single
/// points of a few per cent; more lets visible ridges pass.
pub const HIGHEST_RIDGE: f64 = 1.25;

/// Whether all tolerances hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// Every tolerance holds.
    Pass,
    /// At least one does not.
    Fail,
}

impl Verdict {
    /// `pass` or `fail`.
    pub fn word(self) -> &'static str {
        match self {
            Self::Pass => "pass",
            Self::Fail => "fail",
        }
    }
}

/// One tolerance that does not hold.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Violation {
    /// `scallop`, `gouge` or `uncut`.
    pub what: &'static str,
    /// The limit that was exceeded.
    pub limit_mm: f64,
    /// What was measured.
    pub measured_mm: f64,
    /// The finding in a sentence, with its place.
    pub text: String,
}

/// A place as reports write it.
pub fn place(at: [f64; 3]) -> String {
    format!("x {:.3} y {:.3} z {:.3}", at[0], at[1], at[2])
}

/// All violations of `limits`, gravest kind first.
pub fn violations(measured: &Measurement, limits: &Limits) -> Vec<Violation> {
    [gouge(measured, limits), uncut(measured, limits)]
        .into_iter()
        .flatten()
        .chain(scallop(measured, limits))
        .collect()
}

fn gouge(measured: &Measurement, limits: &Limits) -> Option<Violation> {
    let figures = &measured.gouge;
    if figures.max_depth_mm <= limits.gouge {
        return None;
    }
    let mut text = format!(
        "gouge {:.4} mm deep (limit {:.4}, error within {:.4})",
        figures.max_depth_mm, limits.gouge, figures.error_bound_mm
    );
    if let Some(worst) = figures.regions.first() {
        text += &format!(
            " at {}, move {}, toolpath.nc line {}",
            place(worst.at_mm),
            worst.move_index,
            worst.line
        );
        text += &others(figures.region_count);
    }
    Some(Violation { what: "gouge", limit_mm: limits.gouge, measured_mm: figures.max_depth_mm, text })
}

fn uncut(measured: &Measurement, limits: &Limits) -> Option<Violation> {
    let figures = &measured.uncut;
    let worst = figures.regions.first()?;
    let text = format!(
        "uncut material {:.4} mm high (limit {:.4}, error within {:.4}) over {:.3} mm² at {}{}",
        figures.max_height_mm,
        limits.uncut,
        figures.error_bound_mm,
        figures.area_mm2,
        place(worst.at_mm),
        others(figures.region_count)
    );
    Some(Violation { what: "uncut", limit_mm: limits.uncut, measured_mm: figures.max_height_mm, text })
}

fn scallop(measured: &Measurement, limits: &Limits) -> Vec<Violation> {
    let figures = &measured.scallop;
    let violation = |limit: f64, value: Option<f64>, what: &str, place: String| {
        let value = value.filter(|value| *value > limit)?;
        let bound =
            figures.error_bound_mm.map_or(String::new(), |bound| format!(", error within {bound:.4}"));
        let text = format!("{what} is {value:.4} mm (limit {limit:.4}{bound}){place}");
        Some(Violation { what: "scallop", limit_mm: limit, measured_mm: value, text })
    };
    let at = figures.max_at_mm.map_or(String::new(), |at| format!(" at {}", place(at)));
    let highest = violation(HIGHEST_RIDGE * limits.scallop, figures.max_mm, "the highest scallop", at);
    let most = violation(
        limits.scallop,
        figures.p95_mm,
        "the scallop height that 95 % of the ridges stay below",
        String::new(),
    );
    highest.into_iter().chain(most).collect()
}

fn others(region_count: usize) -> String {
    match region_count {
        0 | 1 => String::new(),
        2 => ", and one more place".to_owned(),
        n => format!(", and {} more places", n - 1),
    }
}
