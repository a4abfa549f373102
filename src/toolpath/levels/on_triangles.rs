//! A stream function on triangles, on the mesh of a surface or over the plane of a pocket, and its lines.
//!
//! Enters: ψ at the vertices and the directions asked for there. Leaves: level curves, or streamlines traced
//! by Runge–Kutta steps through one seed on each piece of a level; and what the function has at any point of
//! a triangle. A traced line that ends before its level does, or does not close where that does, is left for
//! the level.

use super::halving::Allowed;
use super::spacing::AllowedStep;
use crate::surface::feed::SMOOTHING_OVER_RADIUS;
use crate::surface::mesh_surface::not_applicable;
use crate::vocabulary::{Lines, PlanError};
use cutter::Cutter;
use field::mesh::{
    FieldMesh, Held, Line, MeshCurve, MeshFieldError, MeshLevels, MeshPoint, MeshStream, MeshTracer, Wanted,
    flows, orient_lines, smooth_lines, solve_stream,
};
use geometry::{Point3, Vector3};

/// Part of a direction's weight that does not depend on how much the direction matters.
const LEAST_WEIGHT: f64 = 0.02;

/// A traced line as long as this many times its level, or as short as its inverse, has left it.
const LENGTH_RATIO: f64 = 1.1;

/// What a mesh cannot do, as a reason that no passes are planned.
pub(crate) fn refused(e: MeshFieldError) -> PlanError {
    not_applicable(&e.to_string())
}

/// The directions asked for, smooth over the mesh and oriented alike.
pub(crate) fn smooth_directions(
    mesh: &FieldMesh,
    wanted: &[Wanted],
    cutter: &Cutter,
) -> Result<Vec<Line>, PlanError> {
    let smoothing = SMOOTHING_OVER_RADIUS * cutter.radius();
    let mut lines = smooth_lines(mesh, wanted, &[], smoothing).map_err(refused)?;
    orient_lines(mesh, &mut lines);
    Ok(lines)
}

/// The function whose levels follow directions, one pass for each 1/`density` mm; `matters` says how much
/// each direction counts.
pub(crate) fn along_directions(
    mesh: &FieldMesh,
    lines: &[Line],
    density: &[f64],
    matters: impl Fn(usize) -> f64,
    direction_weight: f64,
    held: &Held<'_>,
) -> Result<MeshStream, PlanError> {
    let weight: Vec<f64> = (0..lines.len()).map(|v| matters(v) + LEAST_WEIGHT).collect();
    solve_stream(mesh, &flows(mesh, lines, density, &weight), direction_weight, held).map_err(refused)
}

/// A stream function with the lines that passes follow.
pub(crate) struct OnTriangles<'a> {
    pub mesh: &'a FieldMesh,
    pub levels: MeshLevels<'a>,
    psi: &'a [f64],
    /// The unit tangents asked for at the vertices; empty where none are, or in rows.
    asked: &'a [Option<Vector3>],
    /// The flow at the vertices and the length of a step, mm, where streamlines are traced.
    traced: Option<(Vec<Vector3>, f64)>,
}

impl<'a> OnTriangles<'a> {
    /// Of a function with values `psi` at the vertices; lines are traced in steps of `step` mm.
    pub fn new(
        mesh: &'a FieldMesh,
        psi: &'a [f64],
        asked: &'a [Option<Vector3>],
        lines: Lines,
        step: f64,
    ) -> Result<Self, PlanError> {
        let levels = MeshLevels::new(mesh, psi).map_err(refused)?;
        let flow = || mesh.normals().iter().zip(levels.gradients()).map(|(n, g)| g.cross(n)).collect();
        let traced = (lines == Lines::RungeKutta).then(|| (flow(), step));
        Ok(Self { mesh, levels, psi, asked, traced })
    }

    /// The lines of a level.
    pub fn curves(&self, level: f64) -> Vec<MeshCurve> {
        let mut curves = self.levels.curves(level);
        if let Some((flow, step)) = &self.traced
            && let Ok(tracer) = MeshTracer::new(self.mesh, flow)
        {
            for curve in &mut curves {
                let (seed, length) = (curve.points[curve.points.len() / 2], curve.length());
                let line = tracer.through(seed, *step, LENGTH_RATIO * length + step);
                let line = MeshCurve { points: tracer.over_triangles(&line), closed: line.closed };
                let alike = length <= LENGTH_RATIO * line.length() + step;
                if line.closed == curve.closed && alike {
                    *curve = line;
                }
            }
        }
        curves
    }

    /// Directions of the levels at the vertices.
    pub fn level_lines(&self) -> Vec<Line> {
        let line = |(v, gradient): (usize, &Vector3)| {
            let along = gradient.cross(&self.mesh.normals()[v]).try_normalize(1e-300);
            Line { direction: along.unwrap_or(self.mesh.frame(v)[0]), agreement: f64::from(along.is_some()) }
        };
        self.levels.gradients().iter().enumerate().map(line).collect()
    }

    /// The gradient of ψ at a point, by those of the corners.
    pub fn gradient(&self, p: &MeshPoint) -> Vector3 {
        self.levels.gradient_at(p)
    }

    /// The weights of the corners of a triangle at a place of its plane; some are negative beside it.
    pub fn weights(&self, t: u32, position: &Point3) -> [f64; 3] {
        let (corners, hats) = (self.mesh.corners(t as usize), self.mesh.hat_gradients(t as usize));
        [0, 1, 2].map(|k| 1.0 + hats[k].dot(&(position - corners[k])))
    }

    /// A place as a point of a triangle, which it may lie beside.
    pub fn in_triangle(&self, t: u32, position: Point3) -> MeshPoint {
        let weights = self.weights(t, &position).map(|weight| weight.clamp(0.0, 1.0));
        MeshPoint { triangle: t, weights, position }
    }

    /// The unit tangent asked for at a point: the mean of the corners', as lines.
    pub fn asked_at(&self, p: &MeshPoint, normal: &Vector3) -> Option<Vector3> {
        let corners = self.mesh.triangles()[p.triangle as usize];
        let mut sum = Vector3::zeros();
        for k in 0..3 {
            if let Some(Some(line)) = self.asked.get(corners[k] as usize) {
                sum += line * (p.weights[k] * if line.dot(&sum) < 0.0 { -1.0 } else { 1.0 });
            }
        }
        (sum - normal * normal.dot(&sum)).try_normalize(1e-9)
    }

    /// What each of the first `count` triangles allows in its middle, by what a point is told to allow, and
    /// whether the surface is too concave there.
    pub fn places(
        &self,
        count: usize,
        allowed: impl Fn(&MeshPoint) -> Option<(Allowed, bool)>,
    ) -> Vec<AllowedStep> {
        let place = |t: usize| {
            let third = MeshPoint { triangle: t as u32, weights: [1.0 / 3.0; 3], position: Point3::origin() };
            let (Allowed { step, width }, too_concave) = allowed(&third)?;
            let psi = self.mesh.triangles()[t].iter().map(|&v| self.psi[v as usize]).sum::<f64>() / 3.0;
            Some(AllowedStep { psi, step, length: self.mesh.area(t) * step / width, too_concave })
        };
        (0..count).filter_map(place).collect()
    }
}
