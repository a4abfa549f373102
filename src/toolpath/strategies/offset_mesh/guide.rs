//! Level curves on one piece of the offset surface, as passes of the ball's centre.

use super::{MeshRider, runs};
use crate::levels::halving::{Allowed, LevelSource, Track};
use crate::levels::on_triangles::OnTriangles;
use crate::levels::spacing::AllowedStep;
use crate::moves::touch::Touch;
use crate::vocabulary::{Contact, Passes, PlanError};
use field::mesh::{MeshCurve, MeshPoint};
use geometry::{CubicSpline, Point3, Vector3};
use work::monitor::Cancelled;

/// A triangle of which a corner's mean normal is farther off its own than this cosine lies beside a valley.
const VALLEY_BESIDE: f64 = 0.995;

/// A place of a pass: the ball's centre, and the direction away from the part, evened out over valleys.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Spot {
    at: MeshPoint,
    away: Vector3,
    allowed: Option<Allowed>,
}

/// Level curves on one piece of the offset surface.
pub(crate) struct OffsetGuide<'a> {
    pub rider: &'a MeshRider<'a>,
    pub on: OnTriangles<'a>,
    /// Of the stream function, on each triangle.
    pub gradients: Vec<Vector3>,
    /// Intervals at the vertices, mm.
    pub widths: Vec<f64>,
    /// Whether the ball comes to each vertex.
    pub reached: Vec<bool>,
}

impl OffsetGuide<'_> {
    /// What the places of the mesh allow.
    pub fn places(&self) -> Vec<AllowedStep> {
        let mesh = self.on.mesh;
        let allowed = |p: &MeshPoint| {
            let is_reached = mesh.triangles()[p.triangle as usize].iter().any(|&v| self.reached[v as usize]);
            self.allowed_at(p).filter(|_| is_reached).map(|allowed| (allowed, false))
        };
        self.on.places(mesh.triangles().len(), allowed)
    }

    fn allowed_at(&self, p: &MeshPoint) -> Option<Allowed> {
        let corners = self.on.mesh.triangles()[p.triangle as usize];
        let normal = self.on.mesh.area_vector(p.triangle as usize).try_normalize(0.0)?;
        // Beside a valley a gradient recovered from both sides is that of neither.
        let beside = corners.iter().any(|&v| self.on.mesh.normals()[v as usize].dot(&normal) < VALLEY_BESIDE);
        let gradient = if beside {
            self.gradients[p.triangle as usize]
        } else {
            let mixed = self.on.gradient(p);
            mixed - normal * normal.dot(&mixed)
        };
        let width: f64 = (0..3).map(|k| self.widths[corners[k] as usize] * p.weights[k]).sum();
        let step = gradient.norm() * width;
        (step > 0.0).then_some(Allowed { step, width })
    }

    fn spot(&self, at: MeshPoint) -> Spot {
        let (corners, normals) = (self.on.mesh.triangles()[at.triangle as usize], self.on.mesh.normals());
        let away: Vector3 = (0..3).map(|k| normals[corners[k] as usize] * at.weights[k]).sum();
        let away = away.try_normalize(1e-9);
        let away = away.unwrap_or_else(|| self.on.mesh.area_vector(at.triangle as usize).normalize());
        Spot { at, away, allowed: self.allowed_at(&at) }
    }

    /// A curve at even distances, in the stretches that the ball comes to.
    fn tracks(&self, curve: &MeshCurve) -> Vec<Track<Spot>> {
        let mut knots = curve.points.clone();
        if curve.closed {
            knots.push(knots[0]);
        }
        let positions: Vec<Point3> = knots.iter().map(|knot| knot.position).collect();
        let s = CubicSpline::chord_lengths(&positions, false);
        let total = s.last().copied().unwrap_or(0.0);
        if total <= 0.0 {
            return Vec::new();
        }
        let count = (total / self.rider.settings.sampling).ceil().max(1.0) as usize;
        let mut k = 0;
        let spots: Vec<Spot> = (0..=count)
            .map(|n| {
                let at = total * n as f64 / count as f64;
                while k + 2 < knots.len() && s[k + 1] < at {
                    k += 1;
                }
                let t = if s[k + 1] > s[k] { ((at - s[k]) / (s[k + 1] - s[k])).clamp(0.0, 1.0) } else { 0.0 };
                let position = knots[k].position + (knots[k + 1].position - knots[k].position) * t;
                self.spot(self.on.in_triangle(knots[k].triangle, position))
            })
            .collect();
        let near = |spot: &Spot| {
            let corners = self.on.mesh.triangles()[spot.at.triangle as usize];
            let all = corners.map(|v| self.reached[v as usize]);
            all == [true; 3] || (all != [false; 3] && self.rider.is_reached(&spot.at.position))
        };
        let kept = runs(spots.len(), |k| near(&spots[k]));
        // A closed curve is cut where it begins: its last point is its first one again.
        kept.iter().map(|&[a, b]| Track { points: spots[a..=b].to_vec(), closed: false }).collect()
    }

    /// Appends nothing where a run is too short.
    fn along(&self, curve: &Track<Spot>, run: Option<[usize; 2]>) -> Result<Passes, PlanError> {
        let [first, last] = run.unwrap_or([0, curve.points.len().saturating_sub(1)]);
        let mut passes = Passes::default();
        if last <= first {
            return Ok(passes);
        }
        let place = |s: f64| {
            let k = (s as usize).min(curve.points.len() - 2);
            let (a, b, t) = (&curve.points[k], &curve.points[k + 1], s - k as f64);
            let near = a.at.position + (b.at.position - a.at.position) * t;
            let away = (a.away * (1.0 - t) + b.away * t).try_normalize(1e-9)?;
            Some((self.rider.centre(&near, &away)?, away))
        };
        self.rider.add(&place, [first as f64, last as f64], &mut passes)?;
        Ok(passes)
    }
}

impl LevelSource for OffsetGuide<'_> {
    type Place = Spot;

    fn curves(&self, level: f64) -> Vec<Track<Spot>> {
        self.on.curves(level).iter().flat_map(|curve| self.tracks(curve)).collect()
    }

    fn allowed(&self, spot: &Spot) -> Option<Allowed> {
        spot.allowed
    }

    fn pass(
        &self,
        curve: &Track<Spot>,
        _: f64,
        run: Option<[usize; 2]>,
    ) -> Result<Vec<Vec<Point3>>, Cancelled> {
        match self.along(curve, run) {
            Ok(found) => Ok(found.passes),
            Err(_) => Err(Cancelled),
        }
    }

    fn touches(
        &self,
        curve: &Track<Spot>,
        _: f64,
        run: Option<[usize; 2]>,
    ) -> Result<Option<Vec<Vec<Touch>>>, PlanError> {
        if self.rider.settings.axis.is_none() {
            return Ok(None);
        }
        Ok(Some(self.along(curve, run)?.touches))
    }

    fn contacts(&self, curve: &Track<Spot>, run: Option<[usize; 2]>) -> Vec<Contact> {
        let contact = |spot: &Spot| {
            let gradient = self.on.gradient(&spot.at);
            let across = (gradient - spot.away * spot.away.dot(&gradient)).try_normalize(1e-300)?;
            let at = spot.at.position - spot.away * self.rider.level.distance();
            Some(Contact {
                at,
                across,
                normal: spot.away,
                allowed: spot.allowed?.width,
                inside: true,
                parameters: None,
                asked: None,
            })
        };
        curve.along(run).filter_map(contact).collect()
    }
}
