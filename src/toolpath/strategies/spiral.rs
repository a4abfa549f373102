//! One spiral in the plan view, from the middle of the part outward, the cutter dropped on the part along it.
//!
//! A turn's pitch is the stepover of the tightest place that it passes, so the spiral is Archimedean where
//! all turns allow the same. Where it leaves the part it is cut into pieces.

use std::f64::consts::{FRAC_PI_2, TAU};
use std::fmt::{self, Write as _};

use super::contour_spiral;
use super::zigzag::{least_over_plane, stepover_at};
use crate::surface::border::Border;
use crate::surface::chart::Chart;
use crate::surface::plan_curve::PlanCurves;
use crate::vocabulary::{Definition, Faces, PartKind, Passes, PlanError, Step, Strategy, Task};
use cutter::Cutter;
use drop_cutter::DropCutter;
use geometry::Vector2;
use keys::word_of;
use work::monitor;

/// Places a side of each chart at which the pitch is computed.
const SAMPLES: usize = 160;

/// Rings of the plan view with a pitch of their own. More follow the surface closer; fewer places then speak
/// for each.
const RINGS: usize = 64;

/// Within this many stepovers of the middle a turn passes a place in every direction.
const MIDDLE: f64 = 4.0;

/// Directions tried there.
const MIDDLE_DIRECTIONS: usize = 8;

/// The spiral is laid out in steps of this share of a sampling distance, between which angle and radius grow
/// evenly.
const LAYOUT_SHARE: f64 = 0.5;

/// A step turns by this much at most, rad.
const MOST_TURN: f64 = 0.1;

/// One spiral.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Spiral {
    /// From the middle of the plan view outward, its pitch that of the tightest place of each turn. Where it
    /// leaves the part it is cut into pieces.
    Plan,
    /// From the border to the middle between the passes of an iso-scallop path from all borders, without a
    /// retract; further short passes where its turns have corners. For parts whose front closes in one point.
    Contour,
}

/// Words for `kind`.
const KINDS: [(&str, Spiral); 2] = [("plan", Spiral::Plan), ("contour", Spiral::Contour)];

/// How scenes speak of it.
pub(crate) static DEFINITION: Definition = Definition {
    word: "spiral",
    help: "one spiral, in the plan view or between the contours of the border",
    part: PartKind::Surface,
    keys: &["kind"],
    read: |from| Ok(Box::new(from.section.choice("kind", &KINDS)?)),
};

impl Strategy for Spiral {
    fn definition(&self) -> &'static Definition {
        &DEFINITION
    }

    fn write(&self, out: &mut String) -> fmt::Result {
        writeln!(out, "kind = \"{}\"", word_of(&KINDS, self))
    }

    fn passes(&self, task: &Task<'_>) -> Result<Passes, PlanError> {
        match self {
            Self::Plan => passes(task),
            Self::Contour => contour_spiral::passes(task),
        }
    }

    fn is_spaced_in_plan(&self) -> bool {
        *self == Self::Plan
    }
}

/// Plans the spiral.
fn passes(task: &Task<'_>) -> Result<Passes, PlanError> {
    let Task { part, cutter, ref settings, monitor, .. } = *task;
    let charts = Chart::all(part, cutter, settings.guide())?;
    let dropped = task.dropped();
    let [x, y] = [Vector2::x(), Vector2::y()]
        .map(|e| Chart::extent_of_axes(&charts, part, dropped, settings.chord_tolerance, &e));
    let middle = Vector2::new(0.5 * (x[0] + x[1]), 0.5 * (y[0] + y[1]));
    let reach = 0.5 * (x[1] - x[0]).hypot(y[1] - y[0]);
    let mut notes = Vec::new();
    let pitches = match settings.step {
        Step::Stepover(s) => vec![s; RINGS],
        Step::Scallop(h) => {
            pitches((&charts, &settings.faces), [cutter, dropped], middle, reach, h, &mut notes)
        }
    };
    let widest = pitches.iter().copied().fold(0.0, f64::max);
    let layout = layout(&pitches, reach, LAYOUT_SHARE * settings.sampling);
    let curve = |s: f64| {
        let k = layout.partition_point(|p| p.s <= s).clamp(1, layout.len() - 1);
        let (a, b) = (layout[k - 1], layout[k]);
        let t = ((s - a.s) / (b.s - a.s)).clamp(0.0, 1.0);
        let (angle, radius) = (a.angle + t * (b.angle - a.angle), a.radius + t * (b.radius - a.radius));
        middle + Vector2::new(angle.cos(), angle.sin()) * radius
    };
    let (drop, border) = (&DropCutter::watched(part, dropped, monitor)?, &Border::of(part));
    let curves = PlanCurves { drop, border, cutter: dropped, overrun: widest, settings, monitor };
    monitor.start("planning spiral", 1);
    monitor::check(monitor)?;
    let passes = curves.pieces(&curve, [0.0, layout[layout.len() - 1].s])?;
    monitor.advance(1);
    if passes.len() > 1 {
        notes.push(format!(
            "the spiral leaves the part and comes back: it is cut into {} pieces",
            passes.len()
        ));
    }
    Ok(Passes { passes, notes, ..Passes::default() })
}

/// The pitch of each ring on such faces of charts, for a cutter and what is dropped in its stead.
fn pitches(
    (charts, faces): (&[Chart], &Faces),
    [cutter, dropped]: [&Cutter; 2],
    middle: Vector2,
    reach: f64,
    h: f64,
    notes: &mut Vec<String>,
) -> Vec<f64> {
    let plane = (8.0 * h * cutter.radius()).sqrt();
    let mut least: Vec<Option<f64>> = vec![None; RINGS];
    for chart in charts {
        let points = chart.grid(SAMPLES).filter_map(|[u, v]| chart.at(u, v));
        for p in points.filter(|p| faces.hold(&p.normal)) {
            let arm = p.jet.p.coords.xy() + dropped.axis_offset(&p.normal) - middle;
            let outward = arm.y.atan2(arm.x);
            let turns = if arm.norm() < MIDDLE * plane { MIDDLE_DIRECTIONS } else { 1 };
            let feeds = (0..turns).map(|k| outward + FRAC_PI_2 + TAU * k as f64 / turns as f64);
            let ring = ((arm.norm() / reach * RINGS as f64) as usize).min(RINGS - 1);
            for stepover in feeds.filter_map(|feed| stepover_at(&p, [cutter, dropped], feed, h)) {
                least[ring] = Some(least[ring].map_or(stepover, |known| known.min(stepover)));
            }
        }
    }
    let floor = least_over_plane(cutter, h);
    if least.iter().flatten().any(|&pitch| pitch < floor) {
        notes.push(format!(
            "the steepest places would need a smaller pitch than {floor:.4} mm, the least that is planned; scallops there \
             may exceed the target"
        ));
    }
    // A turn serves half a pitch to both sides, which may lie in the rings beside its own.
    (0..RINGS)
        .map(|k| {
            let near = &least[k.saturating_sub(1)..(k + 2).min(RINGS)];
            near.iter().flatten().copied().fold(f64::INFINITY, f64::min)
        })
        .map(|pitch| if pitch.is_finite() { pitch.max(floor) } else { plane })
        .collect()
}

/// A place of the spiral.
#[derive(Debug, Clone, Copy, PartialEq)]
struct SpiralKnot {
    /// Length from the middle, mm.
    s: f64,
    angle: f64,
    radius: f64,
}

/// The spiral from the middle to one pitch beyond `reach`, in steps of about `step` mm.
fn layout(pitches: &[f64], reach: f64, step: f64) -> Vec<SpiralKnot> {
    let pitch = |radius: f64| {
        // Linear between the middles of rings.
        let x = (radius / reach * pitches.len() as f64 - 0.5).clamp(0.0, (pitches.len() - 1) as f64);
        let k = (x as usize).min(pitches.len().saturating_sub(2));
        let t = x - k as f64;
        pitches[k] * (1.0 - t) + pitches[(k + 1).min(pitches.len() - 1)] * t
    };
    let mut knots = vec![SpiralKnot { s: 0.0, angle: 0.0, radius: 0.0 }];
    loop {
        let SpiralKnot { s, angle, radius } = knots[knots.len() - 1];
        if radius > reach + pitch(reach) {
            return knots;
        }
        let turn = (step / radius.max(1e-9)).min(MOST_TURN);
        let grown = radius + pitch(radius) * turn / TAU;
        let length = (turn * 0.5 * (radius + grown)).hypot(grown - radius);
        knots.push(SpiralKnot { s: s + length, angle: angle + turn, radius: grown });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_even_pitch_gives_an_archimedean_spiral() {
        let knots = layout(&[0.5; RINGS], 20.0, 0.1);
        for knot in &knots {
            assert!((knot.radius - 0.5 * knot.angle / TAU).abs() < 1e-9);
        }
        let last = knots[knots.len() - 1];
        assert!(last.radius > 20.5 && last.radius < 20.6);
        // Its length is the area over the pitch.
        let exact = std::f64::consts::PI * last.radius * last.radius / 0.5;
        assert!((last.s / exact - 1.0).abs() < 1e-3, "{} {exact}", last.s);
    }

    #[test]
    fn the_pitch_follows_the_rings() {
        let pitches: Vec<f64> = (0..RINGS).map(|k| if k < RINGS / 2 { 0.5 } else { 0.25 }).collect();
        let knots = layout(&pitches, 20.0, 0.1);
        let turns = |from: f64, to: f64| {
            let angle = |r: f64| knots.iter().find(|k| k.radius >= r).unwrap().angle;
            (angle(to) - angle(from)) / TAU
        };
        assert!((turns(2.0, 8.0) - 12.0).abs() < 0.2);
        assert!((turns(12.0, 18.0) - 24.0).abs() < 0.4);
    }
}
