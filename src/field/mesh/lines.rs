//! Line fields: a feed direction and its opposite are the same pass. At each vertex a line is the complex
//! number exp(2iθ) in the vertex's tangent frame, which both have in common.
//!
//! Enters: wanted lines with weights, lines that must hold. Leaves: the smooth field that minimises
//!
//! ```text
//! ℓ² ∫ |∇z|² dA + ∫ c |z − exp(2iθ)|² dA,
//! ```
//!
//! neighbours compared by parallel transport (Knöppel, Crane, Pinkall and Schröder, "Globally optimal
//! direction fields", 2013); oriented like arrows as far as that is possible, and the singular points at
//! which it is not.
//!
//! A singular point of index 1 costs more than two of index ½. So smoothing parts a centre or a source into
//! two.

use faer::c64;

use super::surface::turned;
use super::{FieldMesh, Flow, MeshFieldError};
use crate::direction::orient_along;
use crate::sparse::{Entry, solve};
use geometry::{Point3, Vector3};

/// An edge couples its ends at least as if the angles opposite to it had this cotangent. Obtuse pairs
/// have less, or negative ones, with which the field may turn more sharply between them than anywhere.
const LEAST_COTANGENT: f64 = 0.05;

/// Blended lines cancel where their sum is less than this share of the sum of their weights: what rounding
/// leaves.
const CANCELLED: f64 = 1e-9;

/// What is wanted at one vertex: a tangent of any length > 0 and how much it matters (≥ 0). Nothing
/// where the field is to follow its neighbours.
pub type Wanted = Option<(Vector3, f64)>;

/// The line at one vertex.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    /// Unit tangent.
    pub direction: Vector3,
    /// How far the surroundings agree on it: 1 where they do, 0 at singular points.
    pub agreement: f64,
}

/// A point around which the line field turns.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SingularPoint {
    /// Where, mm.
    pub position: Point3,
    /// Twice the index: 1 for half a turn (the end of a fold), 2 for a whole one (a centre or a
    /// source), −1 for a three-way junction, −2 for a saddle.
    pub half_turns: i32,
}

/// The tangent `direction` at vertex `v` as exp(2iθ).
fn doubled(mesh: &FieldMesh, v: usize, direction: &Vector3) -> Option<c64> {
    let [e1, e2] = mesh.frame(v);
    let z = c64::new(direction.dot(&e1), direction.dot(&e2));
    let square = z * z;
    let length = square.re.hypot(square.im);
    (length > 0.0 && length.is_finite()).then(|| square / length)
}

/// The unit tangent of a doubled line.
fn halved(mesh: &FieldMesh, v: usize, z: c64) -> Vector3 {
    let [e1, e2] = mesh.frame(v);
    let (sin, cos) = (0.5 * z.im.atan2(z.re)).sin_cos();
    e1 * cos + e2 * sin
}

/// The angle by which the frame of `from`, carried to `to`, is turned from the frame there, rad.
fn turn(mesh: &FieldMesh, from: usize, to: usize) -> f64 {
    let carried = mesh.transport(from, to, &mesh.frame(from)[0]);
    let [e1, e2] = mesh.frame(to);
    carried.dot(&e2).atan2(carried.dot(&e1))
}

/// The mean of lines in the tangent plane of a frame, as the mean of their doubled angles by weights ≥ 0: its
/// direction, and the length of the sum. `None` where the lines cancel.
pub fn blend_lines(
    [e1, e2]: &[Vector3; 2],
    lines: impl IntoIterator<Item = (Vector3, f64)>,
) -> Option<(Vector3, f64)> {
    let (mut sum, mut total) = (c64::new(0.0, 0.0), 0.0);
    for (direction, weight) in lines {
        let z = c64::new(direction.dot(e1), direction.dot(e2));
        let square = z * z;
        let length = square.re.hypot(square.im);
        if length > 0.0 && length.is_finite() {
            sum += square / length * weight;
            total += weight;
        }
    }
    let length = sum.re.hypot(sum.im);
    let (sin, cos) = (0.5 * sum.im.atan2(sum.re)).sin_cos();
    (length > CANCELLED * total).then(|| (e1 * cos + e2 * sin, length))
}

/// Blends wanted lines by their weights times the given ones ([`blend_lines`]); opposite wishes of equal
/// weight cancel.
///
/// # Errors
/// [`MeshFieldError::Invalid`] when a list has not one entry for each vertex.
pub fn blend(mesh: &FieldMesh, parts: &[(&[Wanted], f64)]) -> Result<Vec<Wanted>, MeshFieldError> {
    let count = mesh.points().len();
    if parts.iter().any(|(wanted, _)| wanted.len() != count) {
        return Err(MeshFieldError::Invalid(format!("{count} vertices need as many wanted directions")));
    }
    let at = |v: usize| {
        let wishes = parts.iter().filter_map(|(wanted, weight)| wanted[v].map(|(d, own)| (d, own * weight)));
        blend_lines(&mesh.frame(v), wishes)
    };
    Ok((0..count).map(at).collect())
}

/// The smooth line field. `length` (mm) is the length ℓ over which a wanted line of weight 1 gives way
/// to its neighbours; 0 keeps every wanted line and fills in between only if all are wanted. Lines in
/// `hard` hold whatever their neighbours want.
///
/// # Errors
/// [`MeshFieldError`] when a wish is not finite, or a piece of the mesh has none.
pub fn smooth_lines(
    mesh: &FieldMesh,
    wanted: &[Wanted],
    hard: &[(u32, Vector3)],
    length: f64,
) -> Result<Vec<Line>, MeshFieldError> {
    let count = mesh.points().len();
    let invalid = |reason: String| Err(MeshFieldError::Invalid(reason));
    if wanted.len() != count || !(length >= 0.0 && length.is_finite()) {
        return invalid(format!(
            "{count} vertices need as many wanted directions and a length of at least 0"
        ));
    }
    let mut fixed: Vec<Option<c64>> = vec![None; count];
    for &(v, direction) in hard {
        let Some(z) = (v as usize).lt(&count).then(|| doubled(mesh, v as usize, &direction)).flatten() else {
            return invalid(format!("the direction held at vertex {v} cannot be used"));
        };
        fixed[v as usize] = Some(z);
    }
    let mut number = vec![u32::MAX; count];
    let mut unknowns = 0u32;
    for v in (0..count).filter(|&v| fixed[v].is_none()) {
        number[v] = unknowns;
        unknowns += 1;
    }
    let real = |x: f64| c64::new(x, 0.0);
    let mut rhs = vec![real(0.0); unknowns as usize];
    let mut diagonal = vec![0.0; unknowns as usize];
    for v in (0..count).filter(|&v| fixed[v].is_none()) {
        let Some((direction, weight)) = wanted[v] else { continue };
        if !(weight >= 0.0 && weight.is_finite()) {
            return invalid(format!("the weight {weight} of the direction at vertex {v} cannot be used"));
        }
        if let Some(z) = doubled(mesh, v, &direction) {
            let area = mesh.triangles_at(v).iter().map(|&t| mesh.area(t as usize)).sum::<f64>() / 3.0;
            diagonal[number[v] as usize] += weight * area;
            rhs[number[v] as usize] += z * (weight * area);
        }
    }
    let mut entries: Vec<Entry<c64>> = Vec::with_capacity(4 * count);
    for ([a, b], weight) in edge_weights(mesh) {
        let (v, w) = (a as usize, b as usize);
        let weight = weight * length * length;
        // z_w should be z_v carried over.
        let angle = 2.0 * turn(mesh, v, w);
        let carry = c64::new(angle.cos(), angle.sin());
        for (x, y, carry) in [(v, w, carry.conj()), (w, v, carry)] {
            if fixed[x].is_none() {
                diagonal[number[x] as usize] += weight;
                match fixed[y] {
                    Some(z) => rhs[number[x] as usize] += carry * z * weight,
                    None if number[y] < number[x] => {
                        entries.push(Entry::new(number[x], number[y], carry * -weight));
                    }
                    None => {}
                }
            }
        }
    }
    entries.extend(diagonal.iter().enumerate().map(|(k, &d)| Entry::new(k as u32, k as u32, real(d))));
    let undetermined = MeshFieldError::Undetermined {
        vertices: count,
        residual: f64::INFINITY,
        cure: "give at least one place of every piece a direction",
    };
    solve(&entries, &mut rhs).ok_or_else(|| undetermined.clone())?;
    if rhs.iter().any(|z| !(z.re.is_finite() && z.im.is_finite())) {
        return Err(undetermined);
    }
    let line = |v: usize| {
        let z = fixed[v].unwrap_or_else(|| rhs[number[v] as usize]);
        Line { direction: halved(mesh, v, z), agreement: z.re.hypot(z.im).min(1.0) }
    };
    Ok((0..count).map(line).collect())
}

/// Half the sum of the cotangents opposite to each edge, held above zero.
fn edge_weights(mesh: &FieldMesh) -> Vec<([u32; 2], f64)> {
    let mut halves: Vec<([u32; 2], f64)> = Vec::with_capacity(3 * mesh.triangles().len());
    for (t, corners) in mesh.triangles().iter().enumerate() {
        let p = mesh.corners(t);
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            let (x, y) = (p[k] - p[(k + 2) % 3], p[(k + 1) % 3] - p[(k + 2) % 3]);
            let cotangent = x.dot(&y) / x.cross(&y).norm();
            halves.push(([a.min(b), a.max(b)], 0.5 * cotangent));
        }
    }
    halves.sort_by_key(|h| h.0);
    let mut edges: Vec<([u32; 2], f64)> = Vec::with_capacity(halves.len() / 2 + 1);
    for (edge, half) in halves {
        match edges.last_mut() {
            Some(last) if last.0 == edge => last.1 += half,
            _ => edges.push((edge, half)),
        }
    }
    edges.iter_mut().for_each(|e| e.1 = e.1.max(LEAST_COTANGENT));
    edges
}

/// Turns the lines round so that neighbours point the same way, surest pairs first, and returns the
/// edges whose ends still disagree, ascending: the cut along which the field cannot be oriented.
pub fn orient_lines(mesh: &FieldMesh, lines: &mut [Line]) -> Vec<[u32; 2]> {
    let mut arrows: Vec<Option<(Vector3, f64)>> =
        lines.iter().map(|l| Some((l.direction, l.agreement))).collect();
    orient_along(
        &mut arrows,
        |v| mesh.ring(v).into_iter().map(|w| w as usize),
        |from, to, line| mesh.transport(from, to, line),
    );
    for (line, arrow) in lines.iter_mut().zip(arrows) {
        line.direction = arrow.map_or(line.direction, |a| a.0);
    }
    let against = |&[a, b]: &[u32; 2]| {
        let (a, b) = (a as usize, b as usize);
        mesh.transport(a, b, &lines[a].direction).dot(&lines[b].direction) < 0.0
    };
    mesh.edges().into_iter().filter(against).collect()
}

/// The singular points of a line field inside the mesh. Those nearer to each other than `merge` (mm)
/// count as one, and vanish where their turns cancel.
pub fn singular_points(mesh: &FieldMesh, lines: &[Line], merge: f64) -> Vec<SingularPoint> {
    use std::f64::consts::TAU;
    let wrap = |x: f64| x - TAU * (x / TAU).round();
    let angle = |v: usize| {
        let [e1, e2] = mesh.frame(v);
        2.0 * lines[v].direction.dot(&e2).atan2(lines[v].direction.dot(&e1))
    };
    let mut found: Vec<SingularPoint> = Vec::new();
    for (t, corners) in mesh.triangles().iter().enumerate() {
        let (mut turning, mut carried) = (0.0, 0.0);
        for k in 0..3 {
            let (v, w) = (corners[k] as usize, corners[(k + 1) % 3] as usize);
            let carry = turn(mesh, v, w);
            carried += carry;
            turning += wrap(angle(w) - angle(v) - 2.0 * carry);
        }
        // What the frames themselves turn by when carried round is no turn of the field.
        let half_turns = ((turning + 2.0 * wrap(carried)) / TAU).round() as i32;
        if half_turns != 0 {
            let [a, b, c] = mesh.corners(t);
            found.push(SingularPoint {
                position: Point3::from((a.coords + b.coords + c.coords) / 3.0),
                half_turns,
            });
        }
    }
    merge_singular_points(&found, merge)
}

/// Counts singular points nearer than `merge` (mm) to the first one of them as one; they vanish where their
/// turns cancel.
pub fn merge_singular_points(found: &[SingularPoint], merge: f64) -> Vec<SingularPoint> {
    let mut merged: Vec<SingularPoint> = Vec::new();
    let mut left = found.to_vec();
    while let Some(first) = left.first().cloned() {
        let is_near = |point: &SingularPoint| (point.position - first.position).norm() < merge;
        let (near, far): (Vec<_>, Vec<_>) =
            left.into_iter().enumerate().partition(|(k, point)| *k == 0 || is_near(point));
        let half_turns = near.iter().map(|(_, point)| point.half_turns).sum();
        let centre = near.iter().map(|(_, point)| point.position.coords).sum::<Vector3>() / near.len() as f64;
        if half_turns != 0 {
            merged.push(SingularPoint { position: Point3::from(centre), half_turns });
        }
        left = far.into_iter().map(|(_, point)| point).collect();
    }
    merged
}

/// What the stream function should do on each triangle, from oriented lines, densities (1/mm) and
/// weights at the vertices. Where the corners of a triangle disagree, at a cut, the surest one decides.
pub fn flows(mesh: &FieldMesh, lines: &[Line], density: &[f64], weight: &[f64]) -> Vec<Flow> {
    let at = |t: usize| {
        let n = mesh.area_vector(t).normalize();
        let corners = mesh.triangles()[t].map(|v| v as usize);
        let arrows = corners.map(|v| turned(&mesh.normals()[v], &n, &lines[v].direction));
        let sure = corners.map(|v| lines[v].agreement);
        let lead = (1..3).fold(0, |best, k| if sure[k] > sure[best] { k } else { best });
        let along = (0..3).map(|k| arrows[k] * arrows[k].dot(&arrows[lead]).signum()).sum::<Vector3>();
        let mean = |of: &[f64]| corners.iter().map(|&v| of[v]).sum::<f64>() / 3.0;
        Flow { along, density: mean(density), weight: mean(weight) }
    };
    (0..mesh.triangles().len()).map(at).collect()
}
