//! Waterline passes: curves on which the cutter keeps its height.
//!
//! The height of the tip while the cutter touches the chart is a scalar function of the parameters; its level curves are
//! the contours of the part's offset surface. Heights are placed either a constant step apart or by the slope; where the
//! part is flatter than the steps serve, further passes follow contours halfway between. The cutter is dropped on the part
//! along each, so that other places of the part hold it off.
//!
//! Limits: level ground has no contours; how much of the part is too level for the passes is said in a note.

use std::fmt::{self, Write as _};

use crate::levels::level_passes::along_levels_placed;
use crate::levels::spacing::{LevelSteps, level_tangent};
use crate::surface::chart::Chart;
use crate::surface::mesh_surface::STEEPEST_COSINE;
use crate::vocabulary::{Definition, PartKind, PassSettings, Passes, PlanError, Strategy, Task};
use cutter::Cutter;
use field::{GridField, ScalarField, surface_gradient_length};
use geometry::TriangleMesh;
use keys::word_of;
use part::Part;

/// Cells a side on which heights are sampled. The contours between nodes err with the third power of a cell.
const CELLS: usize = 240;

/// A part whose cutter heights span less than this, mm, has no contours worth following.
const LEAST_SPAN: f64 = 1e-3;

/// Least vertical part of the normal of a wall that faces up; less is upright, or rounding of the file.
const LEAST_FACING: f64 = 1e-4;

/// Places a side at which the slope is compared with the passes.
const SLOPE_SAMPLES: usize = 120;

/// Contours closer together than this share of what the mean slope asks for are not reached by halving: the place counts
/// as level.
const LEVEL_SHARE: f64 = 1.0 / 64.0;

/// Curves of constant height of the cutter. Where the part is nearly level they lie far apart: further passes fill in as far
/// as six halvings reach.
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

impl Strategy for Waterline {
    fn definition(&self) -> &'static Definition {
        &DEFINITION
    }

    fn write(&self, out: &mut String) -> fmt::Result {
        writeln!(out, "step = \"{}\"", word_of(&STEPS, &self.steps))
    }

    fn passes(&self, task: &Task<'_>) -> Result<Passes, PlanError> {
        let Task { part, cutter, ref settings, .. } = *task;
        let mut all = Passes::default();
        for chart in Chart::all(part, cutter, settings.guide())? {
            let field = ScalarField::Grid(heights(&chart, part, cutter)?);
            let level = level_share(&chart, cutter, &field, settings);
            all.append(along_levels_placed(task, &chart, &field, self.steps)?);
            if level > 0.0 {
                all.notes.push(format!(
                    "{:.1} % of the surface are so level that contours hardly cover them; another strategy suits them better",
                    100.0 * level
                ));
            }
        }
        Ok(all)
    }
}

/// Height of the tip over the chart.
fn heights(chart: &Chart, part: &Part, cutter: &Cutter) -> Result<GridField, PlanError> {
    let field = chart.sampled(CELLS, "waterline", |u, v| {
        // Where the parametrisation is degenerate the surface's own height serves.
        let Some(p) = chart.at(u, v) else { return chart.jet(u, v).p.z };
        let reach = cutter.axis_offset(&p.normal).norm();
        p.jet.p.z - cutter.height(reach.min(cutter.radius())).unwrap_or(0.0)
    })?;
    let nodes = (0..=CELLS).flat_map(|j| (0..=CELLS).map(move |i| (i, j))).map(|(i, j)| field.node(i, j));
    let [low, high] = nodes.fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], z| [lo.min(z), hi.max(z)]);
    if high - low < LEAST_SPAN {
        let level =
            "what is seen of it from above is level, so that there are no contours; zigzag suits that";
        let walls = if part.patches().is_empty() { steep_area(part.mesh()) } else { 0.0 };
        let reason = if walls > 0.0 {
            format!(
                "{level}. {walls:.0} mm² of walls steeper than 80 degrees have contours; they are followed where each wall is a \
                 NURBS patch (`surface = \"nurbs\"`), not on a mesh"
            )
        } else {
            level.to_owned()
        };
        return Err(PlanError::NotApplicable { strategy: "waterline", reason });
    }
    Ok(field)
}

/// Area of a mesh that faces up and is steeper than passes along the surface can follow, mm².
fn steep_area(mesh: &TriangleMesh) -> f64 {
    let is_steep = |t: &usize| (LEAST_FACING..STEEPEST_COSINE).contains(&mesh.normal(*t).z);
    let area = |t: usize| {
        let [a, b, c] = mesh.corners(t);
        0.5 * (b - a).cross(&(c - a)).norm()
    };
    (0..mesh.triangles().len()).filter(is_steep).map(area).sum()
}

/// Share of the chart's area on which the step of height that a strip allows is less than [`LEVEL_SHARE`] of the mean one.
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
