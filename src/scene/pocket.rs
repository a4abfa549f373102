//! The strategies that mill a pocket.

use std::fmt::Write as _;

use super::write::number;
use keys::SceneError;
use keys::{LENGTH, Section};
use toolpath::{Flow, Pattern, PocketStrategy, Step};

/// The strategies.
pub(super) const STRATEGIES: [&str; 3] = ["pocket-flow", "pocket-offset", "pocket-zigzag"];
/// Keys of all of them.
const KEYS: [&str; 7] =
    ["stepover", "stepdown", "floor_allowance", "wall_allowance", "ramp_angle", "helix_radius", "engagement"];
/// Keys of some of them.
pub(super) const ALL_KEYS: [&str; 9] = [
    "stepdown",
    "floor_allowance",
    "wall_allowance",
    "ramp_angle",
    "helix_radius",
    "engagement",
    "spiral",
    "smoothing",
    "angle",
];
/// Stepover over the cutter's diameter by default: 78 degrees of engagement.
const STEPOVER_OVER_DIAMETER: f64 = 0.4;
/// Stepdown over the cutter's diameter by default.
const STEPDOWN_OVER_DIAMETER: f64 = 0.5;
/// Ramp angle by default, degrees: what most end mills take in steel and all in aluminium.
const RAMP_ANGLE: f64 = 3.0;

/// Reads a strategy for pockets and its stepover.
pub(super) fn read_strategy(
    section: &Section<'_>,
    word: &str,
    radius: f64,
) -> Result<(PocketStrategy, Step), SceneError> {
    let own: &[&str] = match word {
        "pocket-flow" => &["spiral", "smoothing"],
        "pocket-offset" => &["spiral"],
        _ => &["angle"],
    };
    let keys: Vec<&str> = ["name", "strategy"].iter().chain(&KEYS).chain(own).copied().collect();
    let mut all = ALL_KEYS.to_vec();
    all.extend(["scallop", "one_way", "along", "direction", "control_points"]);
    section.only(&keys, &all, &format!("strategy = \"{word}\""))?;
    let spiral = section.flag("spiral")?.unwrap_or(false);
    let length = |key| Ok::<Option<f64>, SceneError>(section.length(key)?.map(|v| v.value));
    let allowance = |key| {
        Ok::<f64, SceneError>(section.number(key, 0.0..=*LENGTH.end(), " mm")?.map_or(0.0, |v| v.value))
    };
    let pattern = match word {
        "pocket-flow" => Pattern::Flow(Flow { smoothing: length("smoothing")?, spiral }),
        "pocket-offset" => Pattern::Offset { spiral },
        _ => Pattern::Zigzag {
            angle: section.number("angle", -360.0..=360.0, " degrees")?.map_or(0.0, |v| v.value.to_radians()),
        },
    };
    let strategy = PocketStrategy {
        pattern,
        stepdown: Some(length("stepdown")?.unwrap_or(2.0 * STEPDOWN_OVER_DIAMETER * radius)),
        floor_allowance: allowance("floor_allowance")?,
        wall_allowance: allowance("wall_allowance")?,
        ramp_angle: section
            .number("ramp_angle", 0.1..=45.0, " degrees")?
            .map_or(RAMP_ANGLE, |v| v.value)
            .to_radians(),
        helix_radius: length("helix_radius")?,
        engagement: section.number("engagement", 10.0..=180.0, " degrees")?.map(|v| v.value.to_radians()),
    };
    let step = match section.length("stepover")? {
        Some(step) if step.value > 1.9 * radius => {
            let message = format!(
                "`stepover` is {} mm, more than 0.95 of the cutter's diameter of {} mm",
                step.value,
                2.0 * radius
            );
            return Err(section.error(&step.span, message, "write less, or material stays between passes"));
        }
        Some(step) => step.value,
        // Rounded, so that it reads back as it was written.
        None => (2.0 * STEPOVER_OVER_DIAMETER * radius * 1e6).round() / 1e6,
    };
    Ok((strategy, Step::Stepover(step)))
}

/// What a toolpath says of its strategy.
pub(super) fn write_strategy(out: &mut String, s: &PocketStrategy) -> std::fmt::Result {
    match s.pattern {
        Pattern::Flow(flow) => {
            writeln!(out, "spiral = {}", flow.spiral)?;
            if let Some(smoothing) = flow.smoothing {
                writeln!(out, "smoothing = {}  # mm", number(smoothing))?;
            }
        }
        Pattern::Offset { spiral } => writeln!(out, "spiral = {spiral}")?,
        Pattern::Zigzag { angle } => {
            writeln!(out, "angle = {}  # degrees from the x axis", number(angle.to_degrees()))?
        }
    }
    if let Some(stepdown) = s.stepdown {
        writeln!(out, "stepdown = {}  # mm", number(stepdown))?;
    }
    writeln!(out, "floor_allowance = {}  # mm, left for a last step", number(s.floor_allowance))?;
    writeln!(out, "wall_allowance = {}  # mm, left for a last pass", number(s.wall_allowance))?;
    writeln!(out, "ramp_angle = {}  # degrees", number(s.ramp_angle.to_degrees()))?;
    if let Some(radius) = s.helix_radius {
        writeln!(out, "helix_radius = {}  # mm", number(radius))?;
    }
    if let Some(angle) = s.engagement {
        writeln!(out, "engagement = {}  # degrees", number(angle.to_degrees()))?;
    }
    Ok(())
}
