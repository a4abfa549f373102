//! Zigzag: passes in parallel vertical planes, the cutter dropped on the part along each.
//!
//! Two neighbouring passes are as far apart as the tightest place between them allows; with one step for all,
//! as the tightest place of the part does. Passes a plan-view distance Δ apart lie `Δ/√(1 − (n·e)²)` apart on
//! the surface of the cutter's centres, `e` the plan direction across the feed; that surface is the part's
//! offset, where lengths across the feed are `1 − κ r` times those on the part.
//!
//! Of meshes with creases the facets tell the stepover: a smooth surface over a crease bends as no face of
//! the part does. What is left at creases is measured, and corrected there.

use std::fmt::{self, Write as _};

use crate::levels::level_passes::along_levels;
use crate::levels::planes::AllowedGaps;
use crate::levels::spacing::LevelSteps;
use crate::strategies::mesh_passes::bends_across;
use crate::surface::border::Border;
use crate::surface::chart::{Chart, ChartPoint, dropped_offset};
use crate::surface::mesh_surface::{ConnectedPiece, fills_its_rectangle, reachable, wants_mesh};
use crate::surface::plan_curve::PlanCurves;
use crate::vocabulary::{Definition, Lines, PartKind, Passes, PlanError, Reading, Step, Strategy, Task};
use cutter::Cutter;
use drop_cutter::DropCutter;
use field::ScalarField;
use field::mesh::Bend;
use geometry::{Point3, Vector2, Vector3};
use keys::{SceneError, toml_number, word_of};
use scallop::strip_width_fed;
use work::monitor;

/// The stepover is never planned below this share of that on a horizontal plane: a steep wall
/// would otherwise ask for endless passes. What is left there is measured.
const LEAST_OVER_PLANE: f64 = 0.1;

/// Cells a side of each chart at whose corners the stepover is computed.
const NET_CELLS: usize = 160;

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
    /// How planes step: all alike, or each by what lies between it and the one before. Under a cutter that
    /// leans over patches, as levels do.
    pub steps: LevelSteps,
}

/// Words for `step`.
const STEPS: [(&str, LevelSteps); 2] =
    [("adaptive", LevelSteps::Shortest), ("constant", LevelSteps::Constant)];

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
        Self { angle: ZigzagAngle::Given(angle), one_way: false, steps: LevelSteps::Shortest }
    }
}

/// How scenes speak of it.
pub(crate) static DEFINITION: Definition = Definition {
    word: "zigzag",
    help: "parallel vertical planes at an angle, or at the angle with the shortest path",
    part: PartKind::Surface,
    keys: &["angle", "one_way", "step"],
    read,
};

fn read(from: &mut Reading<'_>) -> Result<Box<dyn Strategy>, SceneError> {
    let one_way = from.section.flag("one_way")?.unwrap_or(false);
    let steps = from.section.choice("step", &STEPS)?;
    if from.section.is_text("angle") {
        from.section.word("angle", &["best"])?;
        return Ok(Box::new(Zigzag { angle: ZigzagAngle::Best, one_way, steps }));
    }
    let angle = from.section.number("angle", -360.0..=360.0, " degrees")?;
    let angle = ZigzagAngle::Given(angle.map_or(0.0, |v| v.value.to_radians()));
    Ok(Box::new(Zigzag { angle, one_way, steps }))
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
        writeln!(out, "one_way = {}", self.one_way)?;
        writeln!(out, "step = \"{}\"", word_of(&STEPS, &self.steps))
    }

    fn passes(&self, task: &Task<'_>) -> Result<Passes, PlanError> {
        match self.angle {
            // Patches under a tilted cutter: it follows the levels of a coordinate, and is not dropped.
            ZigzagAngle::Given(angle) if task.follows_contacts() => on_levels(task, angle, self.steps),
            ZigzagAngle::Given(angle) => passes(task, angle, self.steps),
            ZigzagAngle::Best => best(task, self.steps),
        }
    }

    fn both_ways(&self) -> bool {
        !self.one_way
    }

    fn is_spaced_in_plan(&self) -> bool {
        true
    }
}

/// Plans passes in the direction `angle` (rad from x).
fn passes(task: &Task<'_>, angle: f64, steps: LevelSteps) -> Result<Passes, PlanError> {
    let Task { part, cutter, ref settings, monitor, .. } = *task;
    let charts = Chart::all(part, cutter, settings.guide())?;
    let mut notes = Vec::new();
    let dropped = task.dropped();
    let (along, across) = (Vector2::new(angle.cos(), angle.sin()), Vector2::new(-angle.sin(), angle.cos()));
    let extent = |e: &Vector2| Chart::extent_of_axes(&charts, part, dropped, settings.chord_tolerance, e);
    let (from_to, sides) = (extent(&along), extent(&across));
    let planes = match settings.step {
        Step::Stepover(stepover) => in_the_middle(sides, stepover),
        Step::Scallop(h) => {
            let allowed = Ground::of(task, &charts).allowed(task, angle, h, sides);
            notes.extend(steepest_note(allowed.least(), cutter, h));
            placed(allowed, cutter, h, steps)
        }
    };
    let (drop, border) = (DropCutter::watched(part, dropped, monitor)?, Border::of(part));
    monitor.start("planning zigzag", planes.len() as u64);
    let lines = work::parallel::try_map(planes.len(), |k| {
        monitor::check(monitor)?;
        let overrun = match settings.step {
            Step::Stepover(stepover) => stepover,
            Step::Scallop(_) => gaps_beside(&planes, k, sides).into_iter().fold(0.0, f64::max),
        };
        let curves = PlanCurves { drop: &drop, border: &border, cutter: dropped, overrun, settings, monitor };
        let line = |s: f64| along * s + across * planes[k];
        let pieces = curves.pieces(&line, [from_to[0] - overrun, from_to[1] + overrun])?;
        monitor.advance(1);
        Ok::<_, PlanError>(pieces)
    })?;
    Ok(Passes { passes: lines.into_iter().flatten().collect(), notes, ..Passes::default() })
}

/// Planes a stepover apart that the user asked for: it is kept exactly, and they stand in the middle.
fn in_the_middle([low, high]: [f64; 2], stepover: f64) -> Vec<f64> {
    let count = ((high - low) / stepover - 1e-9).ceil().max(1.0);
    let middle = 0.5 * (low + high);
    (0..count as usize).map(|k| middle + (k as f64 - 0.5 * (count - 1.0)) * stepover).collect()
}

/// The planes of passes, by what lies between them, or all as far apart as the tightest place allows.
fn placed(allowed: AllowedGaps, cutter: &Cutter, h: f64, steps: LevelSteps) -> Vec<f64> {
    let allowed = allowed.filled(least_over_plane(cutter, h));
    if steps == LevelSteps::Constant { allowed.even().planes() } else { allowed.planes() }
}

/// How far the planes on both sides of one of them stand from it; beside the first and the last, twice as far
/// as the end of the range.
fn gaps_beside(planes: &[f64], k: usize, [low, high]: [f64; 2]) -> [f64; 2] {
    let at = planes[k];
    let before = if k == 0 { 2.0 * (at - low) } else { at - planes[k - 1] };
    [before, planes.get(k + 1).map_or(2.0 * (high - at), |next| next - at)]
}

/// Plans passes of a tilted cutter: its contacts stand in parallel vertical planes.
fn on_levels(task: &Task<'_>, angle: f64, steps: LevelSteps) -> Result<Passes, PlanError> {
    let Task { part, cutter, ref settings, .. } = *task;
    let across = Vector2::new(-angle.sin(), angle.cos());
    let mut all = Passes::default();
    let charts = Chart::all(part, cutter, settings.guide())?;
    for (k, chart) in charts.iter().enumerate() {
        let field = chart.sampled(CELLS, "zigzag", |u, v| chart.jet(u, v).p.coords.xy().dot(&across))?;
        let field = ScalarField::Grid(field);
        all.append_patch([k, charts.len()], along_levels(task, chart, &field, steps, Lines::Levels)?);
    }
    Ok(all)
}

/// Plans passes in the direction with the shortest path. Angles over half a turn are compared by the
/// predicted length (surface along the feed over the distance of planes), and the best are planned.
fn best(task: &Task<'_>, steps: LevelSteps) -> Result<Passes, PlanError> {
    let Task { part, cutter, ref settings, monitor, .. } = *task;
    let charts = Chart::all(part, cutter, settings.guide())?;
    let nets: Vec<Net<'_>> = charts.iter().map(|chart| Net::of(chart, task)).collect();
    let angle = |k: usize| std::f64::consts::PI * k as f64 / ANGLES as f64;
    let dropped = task.dropped();
    let (given, ground) = match settings.step {
        Step::Stepover(s) => (s, None),
        Step::Scallop(h) => (0.0, Some((Ground::of(task, &charts), h))),
    };
    let mut predicted: Vec<(f64, usize)> = work::parallel::map(ANGLES, |k| {
        let e = Vector2::new(-angle(k).sin(), angle(k).cos());
        let across = |p: &ChartPoint| axis_over(task, &p.jet.p, &p.normal).dot(&e);
        let places = || nets.iter().flat_map(Net::places);
        let sides = places().map(|(p, _)| across(p)).fold([f64::INFINITY, f64::NEG_INFINITY], widened);
        let planes = ground
            .as_ref()
            .map(|(ground, h)| placed(ground.allowed(task, angle(k), *h, sides), cutter, *h, steps));
        let stepover =
            |p: &ChartPoint| planes.as_ref().map_or(given, |planes| gap_over(planes, across(p), sides));
        let covered = places().filter_map(|(p, area)| {
            // The way of the corner's centre over one place: its length along the feed, and its width in the
            // plan view.
            let t = p.tangent_at(angle(k))?;
            let b = p.normal.cross(&t);
            let (along, across) = (p.offset_ratio(dropped, &t), p.offset_ratio(dropped, &b));
            Some(area * along * across * b.xy().dot(&e).abs() / stepover(p))
        });
        (covered.sum::<f64>(), k)
    });
    predicted.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut planned = Vec::new();
    for &(_, k) in &predicted[..PLANNED] {
        monitor::check(monitor)?;
        planned.push((passes(task, angle(k), steps)?, k));
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

/// Where the axis of what is dropped stands, in the plan view, that touches a place of a surface with the unit
/// normal `n`.
fn axis_over(task: &Task<'_>, at: &Point3, n: &Vector3) -> Vector2 {
    at.coords.xy() + dropped_offset(n, task.dropped(), task.settings.chord_tolerance)
}

/// The distance of the planes on both sides of a coordinate.
fn gap_over(planes: &[f64], at: f64, sides: [f64; 2]) -> f64 {
    match planes.partition_point(|plane| *plane < at) {
        0 => gaps_beside(planes, 0, sides)[0],
        k => gaps_beside(planes, k - 1, sides)[1],
    }
}

/// A range with one more value.
fn widened([low, high]: [f64; 2], value: f64) -> [f64; 2] {
    [low.min(value), high.max(value)]
}

/// A chart's points on faces of the part that are asked for, at the nodes of a grid over all of it.
struct Net<'a> {
    nodes: Vec<Option<(ChartPoint<'a>, f64)>>,
}

impl<'a> Net<'a> {
    /// Each with the area that it stands for, mm².
    fn of(chart: &Chart<'a>, task: &Task<'_>) -> Self {
        let Task { part, ref settings, .. } = *task;
        let all_is_part = fills_its_rectangle(part);
        let on_part = |[u, v]: [f64; 2]| all_is_part || part.highest_at(u, v).is_some();
        let ([[u0, u1], [v0, v1]], n) = (chart.domain, NET_CELLS);
        let at = |low: f64, high: f64, k: usize| low + (high - low) * k as f64 / n as f64;
        let share = |k: usize| if k == 0 || k == n { 0.5 } else { 1.0 };
        let node = |k: usize| {
            let (i, j) = (k % (n + 1), k / (n + 1));
            let uv = [at(u0, u1, i), at(v0, v1, j)];
            let p = chart.at(uv[0], uv[1]).filter(|p| settings.faces.hold(&p.normal) && on_part(uv))?;
            let (e, f, g) = p.jet.first_form();
            let cell = (u1 - u0) * (v1 - v0) / (n * n) as f64;
            Some((p, share(i) * share(j) * cell * (e * g - f * f).max(0.0).sqrt()))
        };
        Self { nodes: (0..(n + 1) * (n + 1)).map(node).collect() }
    }

    fn places(&self) -> impl Iterator<Item = &(ChartPoint<'a>, f64)> {
        self.nodes.iter().flatten()
    }

    /// Limits what lies between the corners of each cell by the tightest of them: where the plane of a corner
    /// stands, and how far from it the next one may.
    fn limit(&self, allowed: &mut AllowedGaps, of_place: impl Fn(&ChartPoint<'a>) -> Option<(f64, f64)>) {
        let side = NET_CELLS + 1;
        let found: Vec<Option<(f64, f64)>> =
            self.nodes.iter().map(|node| of_place(&node.as_ref()?.0)).collect();
        for k in (0..side * (side - 1)).filter(|k| k % side + 1 < side) {
            let corners = || [k, k + 1, k + side, k + side + 1].into_iter().filter_map(|k| found[k]);
            if corners().next().is_some() {
                let range = corners().map(|(at, _)| at).fold([f64::INFINITY, f64::NEG_INFINITY], widened);
                allowed.limit(range, corners().map(|(_, gap)| gap).fold(f64::INFINITY, f64::min));
            }
        }
    }
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
    let strip = p.strip_width_fed(cutter, &t, h);
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
    Charts(Vec<Net<'a>>),
    /// Facets of a mesh.
    Facets(Vec<Facet>),
}

/// A facet of a mesh with creases.
struct Facet {
    corners: [Point3; 3],
    /// Normals at the corners, of its own side of any crease.
    normals: [Vector3; 3],
    normal: Vector3,
    bend: Bend,
    /// What was measured of widths there.
    factor: f64,
}

impl<'a> Ground<'a> {
    /// The facets of a mesh with creases; the places of charts otherwise.
    fn of(task: &Task<'_>, charts: &[Chart<'a>]) -> Self {
        let Task { part, cutter, ref settings, .. } = *task;
        let has_creases = part.patches().is_empty() && wants_mesh(part, cutter);
        // What is no surface still has heights for charts.
        let Some(reached) = has_creases.then(|| reachable(part, cutter).ok()).flatten() else {
            return Self::Charts(charts.iter().map(|chart| Net::of(chart, task)).collect());
        };
        let correction = settings.guide().correction;
        let facet = |piece: &ConnectedPiece, t: usize| {
            let (normal, bend) = piece.facet(t)?;
            let corners = piece.mesh.triangles()[t].map(|v| piece.mesh.points()[v as usize]);
            let factors = corners.iter().filter_map(|corner| Some(correction?.at(corner)));
            let factor = factors.reduce(f64::min).unwrap_or(1.0);
            Some(Facet { corners, normals: piece.corner_normals[t], normal, bend, factor })
        };
        let facets = reached
            .pieces
            .iter()
            .flat_map(|piece| (0..piece.mesh.triangles().len()).filter_map(move |t| facet(piece, t)));
        let asked = |facet: &Facet| facet.normal.z > 0.0 && settings.faces.hold(&facet.normal);
        Self::Facets(facets.filter(asked).collect())
    }

    /// How far apart planes may stand within a range across the direction `angle`.
    fn allowed(&self, task: &Task<'_>, angle: f64, h: f64, sides: [f64; 2]) -> AllowedGaps {
        let cutters = [task.cutter, task.dropped()];
        let mut allowed = AllowedGaps::over(sides);
        let e = Vector2::new(-angle.sin(), angle.cos());
        let axis = |at: &Point3, n: &Vector3| axis_over(task, at, n).dot(&e);
        match self {
            Self::Charts(nets) => nets.iter().for_each(|net| {
                net.limit(&mut allowed, |p| {
                    Some((axis(&p.jet.p, &p.normal), stepover_at(p, cutters, angle, h)?))
                });
            }),
            Self::Facets(facets) => facets.iter().for_each(|facet| {
                let Facet { corners, normals, normal, bend, factor } = facet;
                let flat = Vector3::new(angle.cos(), angle.sin(), 0.0);
                let t = (flat - Vector3::z() * (normal.dot(&flat) / normal.z)).normalize();
                let b = normal.cross(&t);
                let bends = bends_across(normal, &b, bend);
                let (width, too_concave) = strip_width_fed(cutters[0], normal, &b, &bends, h);
                let strip = (factor * width, too_concave);
                let ends = [0, 1, 2].map(|k| axis(&corners[k], &normals[k]));
                if let Some(gap) = in_plan(strip, bend.along(&b), normal, cutters[1], angle) {
                    allowed.limit(ends.into_iter().fold([f64::INFINITY, f64::NEG_INFINITY], widened), gap);
                }
            }),
        }
        allowed
    }
}

/// What is told where the steepest places ask for closer passes than are ever planned.
fn steepest_note(least: f64, cutter: &Cutter, h: f64) -> Option<String> {
    let floor = least_over_plane(cutter, h);
    (!least.is_finite() || least < floor).then(|| format!(
        "the steepest places would need a stepover of {:.4} mm; {floor:.4} mm is used, and scallops there may exceed the \
         target (another angle or a streamline path helps, or `slope` with another toolpath for what is steeper)",
        if least.is_finite() { least } else { 0.0 },
    ))
}
