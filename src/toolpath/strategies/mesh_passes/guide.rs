//! How a line of a function on a mesh becomes a pass.
//!
//! Enters: a line, as it crosses one triangle after the other. Leaves: places of the cutter's axis at even
//! distances, evened out, with what neighbouring passes may do there; the contacts and moves along them.

use super::width_at;
use crate::levels::halving::{Allowed, LevelSource, Track, whole_pass};
use crate::levels::on_triangles::OnTriangles;
use crate::strategies::mesh_front::{along_surface, put_on_level};
use crate::surface::border::useful_overrun;
use crate::surface::chart::axis_offset_over;
use crate::surface::mesh_surface::MeshSurface;
use crate::vocabulary::{Contact, PassSettings};
use cutter::Cutter;
use drop_cutter::DropCutter;
use field::ScalarField;
use field::mesh::{Bend, MeshCurve, MeshPoint};
use geometry::{Point2, Point3, Vector2, Vector3};
use part::Part;
use work::monitor::{Cancelled, Monitor};

/// Two places of the axis nearer than this, mm, are one: rounding.
const SAME_AXIS: f64 = 1e-9;

/// Evening out moves a pass by at most this share of its interval; the scallop grows by twice that
/// share twice over where two neighbours move apart.
const MOST_MOVED: f64 = 0.02;

/// Where the axis is farther from its place over the level than this many times that, the cutter rolls over
/// an edge.
const ROLLING: f64 = 3.0;

/// A length over which the normal is differentiated, mm.
const DIFFERENCE: f64 = 1e-4;

/// Times that a curve is evened out.
const EVENINGS: usize = 2;

/// Weights of five neighbours that keep every parabola (Savitzky and Golay 1964).
const EVEN: [f64; 5] = [-3.0 / 35.0, 12.0 / 35.0, 17.0 / 35.0, 12.0 / 35.0, -3.0 / 35.0];

/// A place of a level curve.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spot {
    /// On the mesh.
    pub at: MeshPoint,
    /// Plan view of the cutter's axis.
    pub axis: Point2,
    /// What neighbouring passes may do here.
    pub allowed: Allowed,
    /// Whether the axis turns sharply here: the cutter begins or ends to roll over an edge.
    pub turns: bool,
}

/// A point of a level curve before it is evened out.
#[derive(Debug, Clone, Copy)]
struct Knot {
    /// On the mesh.
    contact: Point3,
    axis: Point2,
    /// Distance along the curve, mm: of the contact or of the axis, whichever moves farther.
    s: f64,
    /// In which triangle the stretch after it lies.
    triangle: u32,
}

impl Knot {
    /// The knot after this one, at the next place of contact and axis.
    fn next(&self, contact: Point3, axis: Point2, triangle: u32) -> Self {
        let s = self.s + (contact - self.contact).norm().max((axis - self.axis).norm());
        Self { contact, axis, s, triangle }
    }
}

/// Turns lines of a function on a mesh into passes.
pub(super) struct MeshGuide<'a> {
    pub part: &'a Part,
    pub surface: &'a MeshSurface,
    pub on: OnTriangles<'a>,
    /// The function of the plan view that the values at the vertices are those of. It has sharper kinks than
    /// triangles.
    pub front: Option<&'a ScalarField>,
    /// Contacts from one point of a curve to before the next.
    pub parts: usize,
    pub cutter: &'a Cutter,
    pub drop: DropCutter<'a>,
    pub settings: &'a PassSettings<'a>,
    pub monitor: &'a dyn Monitor,
}

impl MeshGuide<'_> {
    /// The unit normal of the side of any crease that the triangle is on.
    pub fn normal(&self, p: &MeshPoint) -> Vector3 {
        let corners = &self.surface.corner_normals[p.triangle as usize];
        let mixed: Vector3 = (0..3).map(|k| corners[k] * p.weights[k]).sum();
        mixed.try_normalize(1e-9).unwrap_or_else(Vector3::z)
    }

    /// How the surface bends.
    pub fn bend(&self, p: &MeshPoint) -> Bend {
        let corners = self.surface.mesh.triangles()[p.triangle as usize];
        let mut bend = Bend::default();
        (0..3).for_each(|k| bend.add(&self.surface.bends[corners[k] as usize], p.weights[k]));
        bend
    }

    /// From a contact to the axis, in the plan view.
    pub fn axis_offset(&self, p: &MeshPoint) -> Vector2 {
        let n = self.normal(p);
        let bends = || {
            let e1 = n
                .cross(&Vector3::x())
                .try_normalize(1e-3)
                .or_else(|| n.cross(&Vector3::y()).try_normalize(1e-3))?;
            let (least, most, _) = self.bend(p).principal([e1, n.cross(&e1)]);
            Some([least, most])
        };
        axis_offset_over(&n, bends, self.cutter, self.settings.chord_tolerance)
    }

    /// The place of its weights.
    fn place(&self, p: &MeshPoint) -> Point3 {
        let corners = self.surface.mesh.corners(p.triangle as usize);
        Point3::from((0..3).map(|k| corners[k].coords * p.weights[k]).sum::<Vector3>())
    }

    /// The contact of a cutter whose axis is at a place, moving `toward` another, near that of the level
    /// between two points of its curve.
    fn touch(&self, from: &Spot, to: &Spot, t: f64, axis: Point2, toward: Vector2) -> Option<Contact> {
        let triangle = from.at.triangle;
        let level = from.at.position + (to.at.position - from.at.position) * t;
        let [a, b, _] = self.surface.mesh.corners(triangle as usize);
        let e1 = (b - a).try_normalize(1e-300)?;
        let e2 = self.surface.mesh.area_vector(triangle as usize).try_normalize(1e-300)?.cross(&e1);
        let axis_at = |p: Point3| {
            let at = MeshPoint { triangle, weights: self.on.weights(triangle, &p), position: p };
            p.coords.xy() + self.axis_offset(&at)
        };
        // How the axis moves with the contact, and so the contact with the axis.
        let here = axis_at(level);
        let [m1, m2] = [e1, e2].map(|e| (axis_at(level + e * DIFFERENCE) - here) / DIFFERENCE);
        let determinant = m1.perp(&m2);
        let moved = |by: Vector2| (e1 * by.perp(&m2) + e2 * m1.perp(&by)) / determinant;
        let allowed = from.allowed.width + t * (to.allowed.width - from.allowed.width);
        let off = axis.coords - here;
        let is_rolling = off.norm() > ROLLING * MOST_MOVED * allowed || determinant <= 0.0;
        let position = if is_rolling { level } else { level + moved(off) };
        let at = self.on.in_triangle(triangle, position);
        let normal = self.normal(&at);
        let along = if is_rolling { to.at.position - from.at.position } else { moved(toward) };
        // Points of traced lines, and steps to them, may end beside the part.
        let own = (triangle as usize) < self.surface.own_triangles;
        let on_part = || self.part.bvh().highest_at(self.part.mesh(), position.x, position.y).is_some();
        Some(Contact {
            at: position,
            across: normal.cross(&along).try_normalize(1e-300)?,
            normal,
            allowed,
            inside: own && on_part() && self.settings.faces.hold(&normal),
            parameters: None,
            asked: if is_rolling { None } else { self.on.asked_at(&at, &normal) },
        })
    }

    /// The gradient along the surface at a point.
    fn gradient(&self, p: &MeshPoint, normal: &Vector3) -> Vector3 {
        let own = (p.triangle as usize) < self.surface.own_triangles;
        if let Some(front) = self.front.filter(|_| own) {
            let at = self.place(p);
            let [_, x, y] = front.value_and_gradient(at.x, at.y);
            return along_surface([x, y], normal);
        }
        let gradient = self.on.gradient(p);
        gradient - normal * normal.dot(&gradient)
    }

    /// Step and width at a point, and whether the surface is too concave there.
    pub fn allowed_at(&self, p: &MeshPoint) -> Option<(Allowed, bool)> {
        let normal = self.normal(p);
        let gradient = self.gradient(p, &normal);
        let across = gradient.try_normalize(1e-300)?;
        let bend = self.bend(p);
        let step = self.settings.step;
        let (width, too_concave) = width_at(self.cutter, &normal, &across, &bend, step);
        let width = self.settings.guide().corrected(width, &self.place(p), step);
        Some((Allowed { step: gradient.norm() * width, width }, too_concave))
    }

    /// The knots of a curve, less what runs beyond the border without use. What lies beyond it all along may
    /// serve the border beside it, where ψ has its greatest value elsewhere.
    fn knots(&self, curve: &MeshCurve) -> Vec<Knot> {
        let mut knots: Vec<Knot> = Vec::with_capacity(curve.points.len() + 1);
        // Index of each point's last knot.
        let mut knot_of = Vec::with_capacity(curve.points.len() + 1);
        let closing = curve.closed.then(|| curve.points[0]);
        for p in curve.points.iter().copied().chain(closing) {
            let axis = |p: &MeshPoint| Point2::from(p.position.coords.xy() + self.axis_offset(p));
            // Where the stretch before it ends; at a crease the cutter then rolls over the edge.
            if let Some(&last) = knots.last() {
                let end = axis(&self.on.in_triangle(last.triangle, p.position));
                knots.push(last.next(p.position, end, last.triangle));
            }
            let here = axis(&p);
            let knot = Knot { contact: p.position, axis: here, s: 0.0, triangle: p.triangle };
            let knot = knots.last().map_or(knot, |last| last.next(p.position, here, p.triangle));
            if let Some(last) = knots
                .last_mut()
                .filter(|last| (last.axis - here).norm() < SAME_AXIS && last.contact == p.position)
            {
                *last = Knot { s: last.s, ..knot };
            } else {
                knots.push(knot);
            }
            knot_of.push(knots.len() - 1);
        }
        // A stretch belongs to the point before it; the last point of an open curve has none.
        let stretches = &curve.points[..curve.points.len() - usize::from(!curve.closed)];
        let own = |p: &MeshPoint| (p.triangle as usize) < self.surface.own_triangles;
        let (Some(first), Some(last)) = (stretches.iter().position(own), stretches.iter().rposition(own))
        else {
            let serves = |p: &MeshPoint| self.serves(p);
            if curve.closed {
                return if curve.points.iter().all(serves) { knots } else { Vec::new() };
            }
            let (first, last) = (curve.points.iter().position(serves), curve.points.iter().rposition(serves));
            let served = first.zip(last).filter(|(first, last)| first < last);
            return served.map_or_else(Vec::new, |(k, l)| knots[knot_of[k]..=knot_of[l]].to_vec());
        };
        if curve.closed {
            return knots;
        }
        let (before, after) = (first.checked_sub(1).map(|k| stretches[k]), stretches.get(last + 1));
        let [start, end] = [
            knots[knot_of[first]].s - self.overrun(&curve.points[first], before.as_ref()),
            knots[knot_of[last + 1]].s + self.overrun(&curve.points[last + 1], after),
        ];
        // Around a corner of the border the next side may be served from beyond it.
        let along = |p: &MeshPoint| self.runs_along_border(p);
        let [before, after] = [
            curve.points[..first].iter().position(along),
            curve.points[last + 1..].iter().rposition(along).map(|k| last + 1 + k),
        ];
        let start = before.map_or(start, |k| start.min(knots[knot_of[k]].s));
        let end = after.map_or(end, |k| end.max(knots[knot_of[k]].s));
        let at = |s: f64| {
            let k = knots.partition_point(|k| k.s <= s).clamp(1, knots.len() - 1);
            let (a, b) = (&knots[k - 1], &knots[k]);
            let t = if b.s > a.s { ((s - a.s) / (b.s - a.s)).clamp(0.0, 1.0) } else { 0.0 };
            let axis = a.axis + (b.axis - a.axis) * t;
            Knot { contact: a.contact + (b.contact - a.contact) * t, axis, s: s.clamp(a.s, b.s), ..*a }
        };
        let mut trimmed = vec![at(start)];
        trimmed.extend(knots.iter().filter(|k| k.s > start && k.s < end));
        trimmed.push(at(end));
        trimmed
    }

    /// Whether the strip of a pass at a place beyond the border reaches the part.
    fn serves(&self, p: &MeshPoint) -> bool {
        let beyond = (p.triangle as usize).checked_sub(self.surface.own_triangles);
        let (Some(border), Some((allowed, _))) =
            (beyond.and_then(|t| self.surface.border.get(t)), self.allowed_at(p))
        else {
            return false;
        };
        // The first corner of such a triangle lies on the border.
        let [on_border, ..] = self.surface.mesh.corners(p.triangle as usize);
        let out = p.position - on_border;
        (out - border * out.dot(border)).norm() <= 0.5 * allowed.width
    }

    /// Whether a pass at a place beyond the border serves it and runs nearly along it.
    fn runs_along_border(&self, p: &MeshPoint) -> bool {
        let beyond = (p.triangle as usize).checked_sub(self.surface.own_triangles);
        let border = beyond.and_then(|t| self.surface.border.get(t));
        border.zip(self.on.gradient(p).try_normalize(1e-300)).is_some_and(|(border, across)| {
            let cotangent = across.cross(border).norm() / across.dot(border).abs().max(1e-9);
            useful_overrun(cotangent).is_infinite() && self.serves(p)
        })
    }

    /// How far a pass that crosses the border at `p` is worth running on, mm; `beyond` is the point
    /// that begins the stretch beyond the border, if there is one.
    fn overrun(&self, p: &MeshPoint, beyond: Option<&MeshPoint>) -> f64 {
        let strip = beyond.and_then(|b| (b.triangle as usize).checked_sub(self.surface.own_triangles));
        let (Some(border), Some((allowed, _))) =
            (strip.and_then(|t| self.surface.border.get(t)), self.allowed_at(p))
        else {
            return 0.0;
        };
        let Some(across) = self.on.gradient(p).try_normalize(1e-300) else { return 0.0 };
        // The feed is square to the gradient, so the angles to the border trade places.
        let (along, square) = (across.cross(border).norm(), across.dot(border).abs());
        useful_overrun(along / square.max(1e-9)) * allowed.width
    }

    /// The place at `s` between two knots.
    fn spot(&self, a: &Knot, b: &Knot, s: f64, turns: bool) -> Spot {
        let t = if b.s > a.s { ((s - a.s) / (b.s - a.s)).clamp(0.0, 1.0) } else { 0.0 };
        let at = self.on.in_triangle(a.triangle, a.contact + (b.contact - a.contact) * t);
        let nowhere = Allowed { step: f64::INFINITY, width: self.settings.sampling };
        let allowed = self.allowed_at(&at).map_or(nowhere, |(allowed, _)| allowed);
        Spot { at, axis: a.axis + (b.axis - a.axis) * t, allowed, turns }
    }

    /// The curve at even distances from each sharp turn to the next, evened out.
    fn track(&self, curve: &MeshCurve) -> Option<Track<Spot>> {
        let knots = self.knots(curve);
        let (from, to) = (knots.first()?.s, knots.last()?.s);
        if to <= from {
            return None;
        }
        let rolls = |w: &[Knot]| w[0].contact == w[1].contact && (w[1].axis - w[0].axis).norm() > SAME_AXIS;
        let turns = knots.windows(2).filter(|w| rolls(w)).flat_map(|w| [w[0].s, w[1].s]);
        let mut ends = vec![from];
        for s in turns.chain([to]) {
            if s - ends[ends.len() - 1] > SAME_AXIS {
                ends.push(s);
            }
        }
        let least = if curve.closed { 5.0 } else { 1.0 };
        let mut k = 0;
        let mut spots = Vec::new();
        for (piece, w) in ends.windows(2).enumerate() {
            let count = ((w[1] - w[0]) / self.settings.sampling).ceil().max(least) as usize;
            for n in 0..count {
                let s = w[0] + (w[1] - w[0]) * n as f64 / count as f64;
                while k + 2 < knots.len() && knots[k + 1].s < s {
                    k += 1;
                }
                spots.push(self.spot(&knots[k], &knots[k + 1], s, n == 0 && piece > 0));
            }
        }
        if !curve.closed {
            let [a, b] = [&knots[knots.len() - 2], &knots[knots.len() - 1]];
            spots.push(self.spot(a, b, to, false));
        }
        even_out(&mut spots, curve.closed);
        Some(Track { points: spots, closed: curve.closed })
    }
}

/// A curve through the places of the axis, a unit from each to the next (Catmull and Rom 1974), smooth but
/// where these turn sharply.
struct Smooth {
    axes: Vec<Point2>,
    turns: Vec<bool>,
    closed: bool,
}

impl Smooth {
    fn through(spots: &[Spot], closed: bool) -> Self {
        let axes = spots.iter().map(|spot| spot.axis).collect();
        Self { axes, turns: spots.iter().map(|spot| spot.turns).collect(), closed }
    }

    fn before(&self, k: usize) -> Point2 {
        let (axes, last) = (&self.axes, self.axes.len() - 1);
        match k {
            0 if self.closed => axes[last - 1],
            k if k == 0 || self.turns[k] => axes[k] + (axes[k] - axes[k + 1]),
            k => axes[k - 1],
        }
    }

    fn after(&self, k: usize) -> Point2 {
        let (axes, last) = (&self.axes, self.axes.len() - 1);
        match k {
            k if k < last && !self.turns[k] => axes[k + 1],
            k if k == last && self.closed => axes[1],
            k => axes[k] + (axes[k] - axes[k - 1]),
        }
    }

    /// Its place at `s`, and its derivative.
    fn at(&self, s: f64) -> (Point2, Vector2) {
        let k = (s as usize).min(self.axes.len() - 2);
        let t = s - k as f64;
        let (p, q) = (self.axes[k], self.axes[k + 1]);
        let (m, l) = ((q - self.before(k)) * 0.5, (self.after(k + 1) - p) * 0.5);
        let d = q - p;
        let [second, third] = [d * 3.0 - m * 2.0 - l, m + l - d * 2.0];
        (p + (m + (second + third * t) * t) * t, m + (second * 2.0 + third * (3.0 * t)) * t)
    }
}

/// Takes the wiggle of linear elements out of a curve, within bounds; the ends of open ones and sharp turns
/// stay.
fn even_out(spots: &mut [Spot], closed: bool) {
    let n = spots.len();
    if n < 5 {
        return;
    }
    let before: Vec<Point2> = spots.iter().map(|s| s.axis).collect();
    for _ in 0..EVENINGS {
        let old: Vec<Point2> = spots.iter().map(|s| s.axis).collect();
        let inner = if closed { 0..n } else { 2..n - 2 };
        for k in inner {
            if (0..3).any(|j| spots[(k + n + j - 1) % n].turns) {
                continue;
            }
            let mean: Vector2 = (0..5).map(|j| old[(k + n + j - 2) % n].coords * EVEN[j]).sum();
            let off = Point2::from(mean) - before[k];
            let most = MOST_MOVED * spots[k].allowed.width;
            spots[k].axis = before[k] + off * (most / off.norm().max(most));
        }
    }
}

impl LevelSource for MeshGuide<'_> {
    type Place = Spot;

    fn curves(&self, level: f64) -> Vec<Track<Spot>> {
        let mut curves = self.on.curves(level);
        if let Some(front) = self.front {
            let own = |p: &&mut MeshPoint| (p.triangle as usize) < self.surface.own_triangles;
            let points = curves.iter_mut().flat_map(|curve| &mut curve.points).filter(own);
            points.for_each(|point| put_on_level(front, &self.surface.mesh, point, level));
        }
        curves.iter().filter_map(|curve| self.track(curve)).collect()
    }

    fn allowed(&self, spot: &Spot) -> Option<Allowed> {
        Some(spot.allowed)
    }

    fn contacts(&self, curve: &Track<Spot>, run: Option<[usize; 2]>) -> Vec<Contact> {
        let Some((spots, [first, end])) = curve.opened(run) else { return Vec::new() };
        let smooth = Smooth::through(&spots, curve.closed);
        let contact = |n: usize| {
            let s = first as f64 + n as f64 / self.parts as f64;
            let k = (s as usize).min(spots.len() - 2);
            let (axis, toward) = smooth.at(s);
            self.touch(&spots[k], &spots[k + 1], s - k as f64, axis, toward)
        };
        (0..=(end - first) * self.parts).filter_map(contact).collect()
    }

    fn pass(
        &self,
        curve: &Track<Spot>,
        _: f64,
        run: Option<[usize; 2]>,
    ) -> Result<Vec<Vec<Point3>>, Cancelled> {
        let Some((spots, [first, end])) = curve.opened(run) else { return Ok(Vec::new()) };
        // Beyond the border nothing is asked for but by whole curves that serve it.
        let own = |spot: &Spot| (spot.at.triangle as usize) < self.surface.own_triangles;
        if run.is_some() && !spots[first..=end].iter().any(own) {
            return Ok(Vec::new());
        }
        let smooth = Smooth::through(&spots, curve.closed);
        let mut tip = |s: f64| {
            let at = smooth.at(s).0;
            self.drop.at(at.x, at.y).map(|drop| Point3::new(at.x, at.y, drop.tip_z))
        };
        let settings = PassSettings { sampling: 1.0, ..*self.settings };
        // On its way it may come off the part, and no ramp leads from one side of that to the other.
        let ends = [first as f64, end as f64];
        let moves = settings.moves_by_contacts(ends, &mut tip, &self.drop, self.monitor)?;
        Ok(whole_pass(moves, curve.closed && run.is_none()))
    }
}
