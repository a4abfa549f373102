//! Waterline passes: curves on which the cutter keeps its height.
//!
//! The height of the tip while the cutter touches the chart is a scalar function of the parameters; its level
//! curves are the contours of the part's offset surface. Heights are placed either a constant step apart or
//! by the slope; where the part is flatter than the steps serve, further passes follow contours halfway
//! between. The cutter is dropped on the part along each, so that other places of the part hold it off.
//!
//! Limits: level ground has no contours; how much of the part is too level for the passes is said in a note.

use std::fmt::{self, Write as _};

use super::mesh_contours;
use crate::levels::level_passes::along_levels;
use crate::levels::spacing::{LevelSteps, level_tangent};
use crate::surface::border::LEAST_FACING;
use crate::surface::chart::Chart;
use crate::surface::mesh_surface::STEEPEST_COSINE;
use crate::vocabulary::{Definition, Lines, PartKind, PassSettings, Passes, PlanError, Strategy, Task};
use cutter::Cutter;
use field::{GridField, ScalarField, surface_gradient_length};
use geometry::TriangleMesh;
use keys::word_of;

/// Cells a side on which heights are sampled. The contours between nodes err with the third power of a cell.
const CELLS: usize = 240;

/// A part whose cutter heights span less than this, mm, has no contours worth following.
const LEAST_SPAN: f64 = 1e-3;

/// A mesh has steep walls where they are more than this share of its area.
const LEAST_WALLS: f64 = 1e-3;

/// Places a side at which the slope is compared with the passes.
const SLOPE_SAMPLES: usize = 120;

/// Contours closer together than this share of what the mean slope asks for are not reached by halving: the
/// place counts as level.
const LEVEL_SHARE: f64 = 1.0 / 64.0;

/// Curves of constant height of the cutter. Where the part is nearly level they lie far apart: further passes
/// fill in as far as six halvings reach.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Waterline {
    /// How the height steps from pass to pass.
    pub steps: LevelSteps,
}

/// Words for `step`.
const STEPS: [(&str, LevelSteps); 2] =
    [("adaptive", LevelSteps::Shortest), ("constant", LevelSteps::Constant)];

/// How scenes speak of it.
pub(crate) static DEFINITION: Definition = Definition {
    word: "waterline",
    help: "curves of constant height of the cutter",
    part: PartKind::Surface,
    keys: &["step"],
    read: |from| Ok(Box::new(Waterline { steps: from.section.choice("step", &STEPS)? })),
};

/// Shares of the surface below this are not told: in tenths of a per cent they are none.
const LEAST_TOLD: f64 = 5e-4;

impl Strategy for Waterline {
    fn definition(&self) -> &'static Definition {
        &DEFINITION
    }

    fn write(&self, out: &mut String) -> fmt::Result {
        writeln!(out, "step = \"{}\"", word_of(&STEPS, &self.steps))
    }

    fn passes(&self, task: &Task<'_>) -> Result<Passes, PlanError> {
        let Task { part, cutter, ref settings, .. } = *task;
        if self.on_facets(task) {
            return mesh_contours::passes(task, self.steps);
        }
        let mut all = Passes::default();
        let charts = Chart::all(part, cutter, settings.guide())?;
        for (k, chart) in charts.iter().enumerate() {
            let field = ScalarField::Grid(heights(chart, cutter)?);
            let level = level_share(chart, cutter, &field, settings);
            let mut passes = along_levels(task, chart, &field, self.steps, Lines::Levels)?;
            if level >= LEAST_TOLD {
                passes.notes.push(format!(
                    "{:.1} % of the surface are so level that contours hardly cover them; another strategy suits them better",
                    100.0 * level
                ));
            }
            all.append_patch([k, charts.len()], passes);
        }
        Ok(all)
    }

    fn on_facets(&self, task: &Task<'_>) -> bool {
        task.part.patches().is_empty() && (task.wants_mesh || has_walls(task.part.mesh()))
    }
}

/// Height of the tip over the chart.
fn heights(chart: &Chart, cutter: &Cutter) -> Result<GridField, PlanError> {
    let field = chart.sampled(CELLS, "waterline", |u, v| {
        // Where the parametrisation is degenerate the surface's own height serves.
        let Some(p) = chart.at(u, v) else { return chart.jet(u, v).p.z };
        let reach = cutter.axis_offset(&p.normal).norm();
        p.jet.p.z - cutter.height(reach.min(cutter.radius())).unwrap_or(0.0)
    })?;
    let nodes = (0..=CELLS).flat_map(|j| (0..=CELLS).map(move |i| (i, j))).map(|(i, j)| field.node(i, j));
    let [low, high] = nodes.fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], z| [lo.min(z), hi.max(z)]);
    if high - low < LEAST_SPAN {
        let reason = "it is level, so that there are no contours; zigzag suits that".to_owned();
        return Err(PlanError::NotApplicable { strategy: "waterline", reason });
    }
    Ok(field)
}

/// Whether a mesh has walls that face up and are steeper than its plan view shows.
fn has_walls(mesh: &TriangleMesh) -> bool {
    let area = |t| mesh.area(t);
    let is_steep = |t: &usize| (LEAST_FACING..STEEPEST_COSINE).contains(&mesh.normal(*t).z);
    let (all, steep) = (0..mesh.triangles().len(), (0..mesh.triangles().len()).filter(is_steep));
    steep.map(area).sum::<f64>() > LEAST_WALLS * all.map(area).sum::<f64>()
}

/// Share of the chart's area on which the step of height that a strip allows is less than [`LEVEL_SHARE`] of
/// the mean one.
fn level_share(chart: &Chart, cutter: &Cutter, field: &ScalarField, settings: &PassSettings) -> f64 {
    let place = |[u, v]: [f64; 2]| {
        let p = chart.at(u, v)?;
        let (e, f, g) = p.jet.first_form();
        let [_, z_u, z_v] = field.value_and_gradient(u, v);
        let gradient = surface_gradient_length((e, f, g), z_u, z_v);
        let t = level_tangent(&p, field, [u, v]);
        let width = t.map_or(0.0, |t| p.strip_width(cutter, &t, settings.step).0);
        Some((width * gradient, (e * g - f * f).max(0.0).sqrt()))
    };
    let places: Vec<(f64, f64)> = chart.grid(SLOPE_SAMPLES).filter_map(place).collect();
    let area: f64 = places.iter().map(|(_, area)| area).sum();
    let mean = places.iter().map(|(step, area)| step * area).sum::<f64>() / area;
    let level: f64 = places.iter().filter(|(step, _)| *step < LEVEL_SHARE * mean).map(|(_, area)| area).sum();
    level / area
}
