//! Zigzag: passes in parallel vertical planes, the cutter dropped on the part along each.
//!
//! One stepover serves the whole part, so it is that of the worst place. Passes a plan-view distance Δ apart
//! lie `Δ/√(1 − (n·e)²)` apart on the surface of the cutter's centres, `e` the plan direction across the
//! feed; that surface is the part's offset, where lengths across the feed are `1 − κ r` times those on the
//! part.
//!
//! Of meshes with creases the facets tell the stepover: a smooth surface over a crease bends as no face of
//! the part does. What is left at creases is measured, and corrected there.

use std::fmt::{self, Write as _};

use crate::levels::level_passes::along_levels_placed;
use crate::levels::spacing::LevelSteps;
use crate::strategies::mesh_passes::width_at;
use crate::surface::border::Border;
use crate::surface::chart::{Chart, ChartPoint};
use crate::surface::mesh_surface::{ConnectedPiece, reachable, wants_mesh};
use crate::surface::plan_curve::PlanCurves;
use crate::vocabulary::{Definition, Faces, PartKind, Passes, PlanError, Reading, Step, Strategy, Task};
use cutter::Cutter;
use drop_cutter::DropCutter;
use field::ScalarField;
use field::mesh::Bend;
use geometry::{Vector2, Vector3};
use keys::{SceneError, toml_number};
use work::monitor;

/// The stepover is never planned below this share of that on a horizontal plane: a steep wall
/// would otherwise ask for endless passes over the whole part. What is left there is measured.
const LEAST_OVER_PLANE: f64 = 0.1;

/// Places a side of each chart at which the stepover is computed.
const STEPOVER_SAMPLES: usize = 160;

/// Angles over half a turn whose length is predicted. Between two of them a length changes by a few per cent
/// at most.
const ANGLES: usize = 36;

/// Cells a side on which the plan coordinate of a patch is sampled.
const CELLS: usize = 240;

/// How many of the angles with the least predicted length are planned; the prediction errs by a few per cent.
const PLANNED: usize = 3;

/// Passes in parallel vertical planes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Zigzag {
    /// Their direction in the plan view.
    pub angle: ZigzagAngle,
    /// Cut in one direction only.
    pub one_way: bool,
}

/// In which direction zigzag passes run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ZigzagAngle {
    /// This far from the x axis, rad.
    Given(f64),
    /// The one with the shortest path: searched over half a turn by the predicted length, the best few
    /// planned.
    Best,
}

impl Zigzag {
    /// Passes `angle` from the x axis (rad), fed both ways.
    pub const fn at(angle: f64) -> Self {
        Self { angle: ZigzagAngle::Given(angle), one_way: false }
    }
}

/// How scenes speak of it.
pub(crate) static DEFINITION: Definition = Definition {
    word: "zigzag",
    help: "parallel vertical planes at an angle, or at the angle with the shortest path",
    part: PartKind::Surface,
    keys: &["angle", "one_way"],
    read,
};

fn read(from: &mut Reading<'_>) -> Result<Box<dyn Strategy>, SceneError> {
    let one_way = from.section.flag("one_way")?.unwrap_or(false);
    if from.section.is_text("angle") {
        from.section.word("angle", &["best"])?;
        return Ok(Box::new(Zigzag { angle: ZigzagAngle::Best, one_way }));
    }
    let angle = from.section.number("angle", -360.0..=360.0, " degrees")?;
    let angle = ZigzagAngle::Given(angle.map_or(0.0, |v| v.value.to_radians()));
    Ok(Box::new(Zigzag { angle, one_way }))
}

impl Strategy for Zigzag {
    fn definition(&self) -> &'static Definition {
        &DEFINITION
    }

    fn write(&self, out: &mut String) -> fmt::Result {
        match self.angle {
            ZigzagAngle::Given(angle) => {
                writeln!(out, "angle = {}  # degrees from the x axis", toml_number(angle.to_degrees()))?;
            }
            ZigzagAngle::Best => writeln!(out, "angle = \"best\"  # searched")?,
        }
        writeln!(out, "one_way = {}", self.one_way)
    }

    fn passes(&self, task: &Task<'_>) -> Result<Passes, PlanError> {
        match self.angle {
            // Patches under a tilted cutter: it follows the levels of a coordinate, and is not dropped.
            ZigzagAngle::Given(angle) if task.follows_contacts() => on_levels(task, angle),
            ZigzagAngle::Given(angle) => passes(task, angle),
            ZigzagAngle::Best => best(task),
        }
    }

    fn both_ways(&self) -> bool {
        !self.one_way
    }
}

/// Plans passes in the direction `angle` (rad from x).
fn passes(task: &Task<'_>, angle: f64) -> Result<Passes, PlanError> {
    let Task { part, cutter, ref settings, monitor, .. } = *task;
    let charts = Chart::all(part, cutter, settings.guide())?;
    let mut notes = Vec::new();
    let dropped = task.dropped();
    let stepover = match settings.step {
        Step::Stepover(s) => s,
        Step::Scallop(h) => {
            let ground = Ground::of(task, || places(&charts, &settings.faces), h);
            safe_stepover(&ground, [cutter, dropped], angle, h, &mut notes)
        }
    };
    let (along, across) = (Vector2::new(angle.cos(), angle.sin()), Vector2::new(-angle.sin(), angle.cos()));
    let extent = |e: &Vector2| Chart::extent_of_axes(&charts, part, dropped, settings.chord_tolerance, e);
    let (from_to, sides) = (extent(&along), extent(&across));
    let count = ((sides[1] - sides[0]) / stepover - 1e-9).ceil().max(1.0) as usize;
    // A stepover that the user asked for is kept exactly, and the passes stand in the middle.
    let pitch = match settings.step {
        Step::Stepover(s) => s,
        Step::Scallop(_) => (sides[1] - sides[0]) / count as f64,
    };
    let middle = 0.5 * (sides[0] + sides[1]);
    let (drop, border) = (DropCutter::watched(part, dropped, monitor)?, Border::of(part));
    let curves = PlanCurves { drop, border, cutter: dropped, overrun: pitch, settings, monitor };
    monitor.start("planning zigzag", count as u64);
    let lines = work::parallel::try_map(count, |k| {
        monitor::check(monitor)?;
        let offset = middle + (k as f64 - 0.5 * (count as f64 - 1.0)) * pitch;
        let line = |s: f64| along * s + across * offset;
        let pieces = curves.pieces(&line, [from_to[0] - pitch, from_to[1] + pitch])?;
        monitor.advance(1);
        Ok::<_, PlanError>(pieces)
    })?;
    Ok(Passes { passes: lines.into_iter().flatten().collect(), notes, ..Passes::default() })
}

/// Plans passes of a tilted cutter: its contacts stand in parallel vertical planes, one distance apart on
/// each patch.
fn on_levels(task: &Task<'_>, angle: f64) -> Result<Passes, PlanError> {
    let Task { part, cutter, ref settings, .. } = *task;
    let across = Vector2::new(-angle.sin(), angle.cos());
    let mut all = Passes::default();
    for chart in Chart::all(part, cutter, settings.guide())? {
        let field = chart.sampled(CELLS, "zigzag", |u, v| chart.jet(u, v).p.coords.xy().dot(&across))?;
        let field = ScalarField::Grid(field);
        all.append(along_levels_placed(task, &chart, &field, LevelSteps::Constant)?);
    }
    Ok(all)
}

/// Plans passes in the direction with the shortest path. Angles over half a turn are compared by the
/// predicted length (surface along the feed over the stepover), and the best are planned.
fn best(task: &Task<'_>) -> Result<Passes, PlanError> {
    let Task { part, cutter, ref settings, monitor, .. } = *task;
    let charts = Chart::all(part, cutter, settings.guide())?;
    let places = places(&charts, &settings.faces);
    let angle = |k: usize| std::f64::consts::PI * k as f64 / ANGLES as f64;
    let dropped = task.dropped();
    let ground = match settings.step {
        Step::Stepover(_) => Ground::Facets { all: Vec::new(), factor: 1.0 },
        Step::Scallop(h) => Ground::of(task, || places.clone(), h),
    };
    let mut predicted: Vec<(f64, usize)> = work::parallel::map(ANGLES, |k| {
        let stepover = match settings.step {
            Step::Stepover(s) => s,
            Step::Scallop(h) => {
                let least = ground.least_stepover([cutter, dropped], angle(k), h);
                if least.is_finite() {
                    least.max(least_over_plane(cutter, h))
                } else {
                    least_over_plane(cutter, h)
                }
            }
        };
        let covered = places.iter().filter_map(|(p, area)| {
            // The way of the corner's centre over one place: its length along the feed, and its width in the
            // plan view.
            let t = p.tangent_at(angle(k))?;
            let e = Vector2::new(-angle(k).sin(), angle(k).cos());
            let b = p.normal.cross(&t);
            let (along, across) = (p.offset_ratio(dropped, &t), p.offset_ratio(dropped, &b));
            Some(area * along * across * b.xy().dot(&e).abs())
        });
        (covered.sum::<f64>() / stepover, k)
    });
    predicted.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut planned = Vec::new();
    for &(_, k) in &predicted[..PLANNED] {
        monitor::check(monitor)?;
        planned.push((passes(task, angle(k))?, k));
    }
    let lengths: Vec<f64> = planned.iter().map(|(passes, _)| passes.length()).collect();
    let shortest = (0..lengths.len()).min_by(|&a, &b| lengths[a].total_cmp(&lengths[b])).unwrap_or(0);
    let (mut best, k) = planned.swap_remove(shortest);
    best.notes.push(format!(
        "{:.0} degrees is the best angle of {ANGLES}: {:.0} mm of passes planned ({:.0} predicted; {:.0} at the worst angle)",
        angle(k).to_degrees(),
        lengths[shortest],
        predicted.iter().find(|p| p.1 == k).map_or(0.0, |p| p.0),
        predicted[ANGLES - 1].0
    ));
    Ok(best)
}

/// Points of all charts on such faces, and the area that each stands for, mm².
fn places<'a>(charts: &[Chart<'a>], faces: &Faces) -> Vec<(ChartPoint<'a>, f64)> {
    let of = |chart: &Chart<'a>| {
        let [[u0, u1], [v0, v1]] = chart.domain;
        let cell = (u1 - u0) * (v1 - v0) / (STEPOVER_SAMPLES * STEPOVER_SAMPLES) as f64;
        let point = |[u, v]: [f64; 2]| {
            let p = chart.at(u, v).filter(|p| faces.hold(&p.normal))?;
            let (e, f, g) = p.jet.first_form();
            Some((p, cell * (e * g - f * f).max(0.0).sqrt()))
        };
        chart.grid(STEPOVER_SAMPLES).filter_map(point).collect::<Vec<_>>()
    };
    charts.iter().flat_map(of).collect()
}

/// The least stepover ever planned, mm.
pub(crate) fn least_over_plane(cutter: &Cutter, h: f64) -> f64 {
    LEAST_OVER_PLANE * (8.0 * h * cutter.radius()).sqrt()
}

/// The plan-view stepover, mm, that a place allows for passes in the direction `angle`; `None` where none is
/// asked for, since the cutter hardly fits: one pass serves the whole hollow, though the formula asks for
/// ever closer ones. Of both cutters the first one cuts, the second one is dropped.
pub(crate) fn stepover_at(
    p: &ChartPoint,
    [cutter, dropped]: [&Cutter; 2],
    angle: f64,
    h: f64,
) -> Option<f64> {
    let t = p.tangent_at(angle)?;
    let strip = p.strip_width(cutter, &t, Step::Scallop(h));
    in_plan(strip, p.curvature_along(&p.normal.cross(&t)), &p.normal, dropped, angle)
}

/// The plan-view stepover of a strip's width, limited or not, on a surface that bends by `curvature` across
/// the feed.
fn in_plan(
    (width, too_concave): (f64, bool),
    curvature: f64,
    normal: &Vector3,
    dropped: &Cutter,
    angle: f64,
) -> Option<f64> {
    let e = Vector2::new(-angle.sin(), angle.cos());
    let bend = 1.0 - curvature * dropped.corner_radius();
    // Passes lie evenly apart in the plan view: across the chord of the strip, not along it.
    let half = 0.5 * curvature * width;
    let chord = if half.abs() < 1e-4 { 1.0 - half * half / 6.0 } else { half.sin() / half };
    let lean = (1.0 - normal.xy().dot(&e).powi(2)).max(0.0).sqrt();
    (bend > 0.0 && !too_concave).then_some(width * chord * bend * lean)
}

/// Where the stepover is computed.
enum Ground<'a> {
    /// Places of charts.
    Charts(Vec<(ChartPoint<'a>, f64)>),
    /// Facets by their normals, and how the surface bends there. Widths are corrected by the least factor
    /// anywhere: one stepover serves all.
    Facets { all: Vec<(Vector3, Bend)>, factor: f64 },
}

impl<'a> Ground<'a> {
    /// The facets of a mesh with creases; the places of charts otherwise.
    fn of(task: &Task<'_>, places: impl FnOnce() -> Vec<(ChartPoint<'a>, f64)>, h: f64) -> Self {
        let Task { part, cutter, .. } = *task;
        let has_creases = part.patches().is_empty() && wants_mesh(part, cutter);
        let flat = (8.0 * h * cutter.radius()).sqrt();
        // What is no surface still has heights for charts.
        let Some(reached) = has_creases.then(|| reachable(part, cutter, flat).ok()).flatten() else {
            return Self::Charts(places());
        };
        let facets = |piece: &ConnectedPiece| -> Vec<(Vector3, Bend)> {
            let all = (0..piece.mesh.triangles().len()).filter_map(|t| piece.facet(t));
            all.filter(|(normal, _)| normal.z > 0.0 && task.settings.faces.hold(normal)).collect()
        };
        let factor = task.settings.guide().correction.map_or(1.0, |correction| correction.range()[0]);
        Self::Facets { all: reached.pieces.iter().flat_map(facets).collect(), factor }
    }

    fn least_stepover(&self, cutters: [&Cutter; 2], angle: f64, h: f64) -> f64 {
        let least = |all: &mut dyn Iterator<Item = f64>| all.fold(f64::INFINITY, f64::min);
        match self {
            Self::Charts(places) => {
                least(&mut places.iter().filter_map(|(p, _)| stepover_at(p, cutters, angle, h)))
            }
            Self::Facets { all, factor } => least(&mut all.iter().filter_map(|(normal, bend)| {
                let flat = Vector3::new(angle.cos(), angle.sin(), 0.0);
                let t = (flat - Vector3::z() * (normal.dot(&flat) / normal.z)).normalize();
                let b = normal.cross(&t);
                let (width, too_concave) = width_at(cutters[0], normal, &b, bend, Step::Scallop(h));
                in_plan((factor * width, too_concave), bend.along(&b), normal, cutters[1], angle)
            })),
        }
    }
}

/// The greatest stepover that keeps the scallop everywhere.
fn safe_stepover(
    ground: &Ground<'_>,
    cutters: [&Cutter; 2],
    angle: f64,
    h: f64,
    notes: &mut Vec<String>,
) -> f64 {
    let least = ground.least_stepover(cutters, angle, h);
    let floor = least_over_plane(cutters[0], h);
    if least.is_finite() && least >= floor {
        return least;
    }
    notes.push(format!(
        "the steepest places would need a stepover of {:.4} mm; {floor:.4} mm is used, and scallops there may exceed the \
         target (another angle or a streamline path helps, or `slope` with another toolpath for what is steeper)",
        if least.is_finite() { least } else { 0.0 },
    ));
    floor
}
