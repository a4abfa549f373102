//! Stream functions on a mesh, by linear finite elements.
//!
//! Minimises the functional of the fit on parameter rectangles,
//!
//! ```text
//! ∫ q · [ α (t·∇ψ)² + (b·∇ψ − g)² ] dA,    b = n × t,
//! ```
//!
//! with ψ linear on each triangle: follow the feed direction `t`, with density `g` (passes per mm)
//! across it; `q` is how much the place matters, `α` how much direction counts over density. Where
//! nothing is asked of ψ on a border its condition is the natural one. ψ may be held at given
//! vertices, and groups of vertices may be tied to one common, unknown value (a wall that is a
//! streamline); a piece without a held vertex has its first vertex, or its group, held at 0. The
//! answer is checked by its true residual. Values converge with the square of the edges' length.

use super::weld::root;
use super::{FieldMesh, MeshFieldError};
use crate::sparse::{Entry, solve};
use geometry::Vector3;

/// Greatest residual, relative to the terms of the equations, that counts as solved.
const RESIDUAL_LIMIT: f64 = 1e-8;

/// What ψ should do on one triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Flow {
    /// Feed direction; its part in the triangle's plane counts, whatever its length.
    pub along: Vector3,
    /// Density of passes wanted across the feed, 1/mm: ψ grows by it to the left of the feed, seen
    /// from outside.
    pub density: f64,
    /// How much direction and density matter here, > 0.
    pub weight: f64,
}

/// What is asked of ψ at vertices.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Held<'a> {
    /// Vertices with given values.
    pub fixed: &'a [(u32, f64)],
    /// Groups of vertices that share one value, which is found. A group with a fixed vertex has its
    /// value throughout. No vertex may be in two groups.
    pub tied: &'a [Vec<u32>],
}

/// A stream function on a mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshStream {
    /// ψ at the vertices.
    pub values: Vec<f64>,
    /// Root mean square of the angle between level curves and feed directions, rad, weighted.
    pub angle_rms: f64,
    /// Relative residual of the equations.
    pub residual: f64,
}

/// Where the value of a vertex comes from.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Source {
    Unknown(u32),
    Known(f64),
}

/// Solves for ψ; `flows` has one entry for each triangle, `direction_weight` is α.
///
/// # Errors
/// [`MeshFieldError`] where a flow is not finite, a weight is not positive, or ψ is not determined.
pub fn solve_stream(
    mesh: &FieldMesh,
    flows: &[Flow],
    direction_weight: f64,
    held: &Held,
) -> Result<MeshStream, MeshFieldError> {
    if flows.len() != mesh.triangles().len() {
        let (given, wanted) = (flows.len(), mesh.triangles().len());
        return Err(MeshFieldError::Invalid(format!("{given} flows were given for {wanted} triangles")));
    }
    let (sources, unknowns) = sources(mesh, held)?;
    let mut entries: Vec<Entry<f64>> = Vec::with_capacity(6 * flows.len());
    let mut rhs = vec![0.0; unknowns];
    let mut scale = vec![0.0; unknowns];
    for (t, flow) in flows.iter().enumerate() {
        let Element { along, across, weight } = Element::new(mesh, t, flow)?;
        let corners = mesh.triangles()[t].map(|v| sources[v as usize]);
        for k in 0..3 {
            let Source::Unknown(row) = corners[k] else { continue };
            let pull = weight * flow.density * across[k];
            rhs[row as usize] += pull;
            scale[row as usize] += pull.abs();
            for l in 0..3 {
                let coupling = weight * (direction_weight * along[k] * along[l] + across[k] * across[l]);
                match corners[l] {
                    Source::Known(value) => {
                        rhs[row as usize] -= coupling * value;
                        scale[row as usize] += (coupling * value).abs();
                    }
                    // Tied corners meet in one row; both of their couplings count.
                    Source::Unknown(column) if column <= row => {
                        entries.push(Entry::new(row, column, coupling));
                    }
                    Source::Unknown(_) => {}
                }
            }
        }
    }
    let undetermined = |residual| MeshFieldError::Undetermined {
        vertices: mesh.points().len(),
        residual,
        cure: "give every place a direction and a weight above 0",
    };
    let mut x = rhs.clone();
    solve(&entries, &mut x).ok_or_else(|| undetermined(f64::INFINITY))?;
    let residual = relative_residual(&entries, &x, &rhs, &mut scale);
    if residual.is_nan() || residual > RESIDUAL_LIMIT {
        return Err(undetermined(residual));
    }
    let value = |source: &Source| match *source {
        Source::Unknown(k) => x[k as usize],
        Source::Known(value) => value,
    };
    let values: Vec<f64> = sources.iter().map(value).collect();
    let angle_rms = angle_rms(mesh, flows, &values);
    Ok(MeshStream { values, angle_rms, residual })
}

/// Derivatives of the three hat functions along and across the feed, and the weight times the area.
struct Element {
    along: [f64; 3],
    across: [f64; 3],
    weight: f64,
}

impl Element {
    fn new(mesh: &FieldMesh, t: usize, flow: &Flow) -> Result<Self, MeshFieldError> {
        let double = mesh.area_vector(t);
        let area = 0.5 * double.norm();
        let n = double / (2.0 * area);
        let along = (flow.along - n * n.dot(&flow.along)).try_normalize(1e-12 * flow.along.norm());
        let sound = flow.density.is_finite() && flow.weight > 0.0 && flow.weight.is_finite();
        let (Some(along), true) = (along, sound) else {
            let [x, y, z]: [f64; 3] = mesh.corners(t)[0].coords.into();
            return Err(MeshFieldError::Invalid(format!(
                "the feed direction at ({x:.3}, {y:.3}, {z:.3}) cannot be used: direction {:?}, density {}, weight {}",
                <[f64; 3]>::from(flow.along),
                flow.density,
                flow.weight
            )));
        };
        let across = n.cross(&along);
        let hats = mesh.hat_gradients(t);
        Ok(Self {
            along: hats.map(|g| g.dot(&along)),
            across: hats.map(|g| g.dot(&across)),
            weight: flow.weight * area,
        })
    }
}

/// Numbers the unknown values: one for each free vertex and each tied group.
fn sources(mesh: &FieldMesh, held: &Held) -> Result<(Vec<Source>, usize), MeshFieldError> {
    let count = mesh.points().len();
    let out_of_range = held.fixed.iter().map(|f| f.0).chain(held.tied.iter().flatten().copied());
    if let Some(v) = out_of_range.into_iter().find(|&v| v as usize >= count) {
        return Err(MeshFieldError::Invalid(format!("vertex {v} is held, but there are only {count}")));
    }
    // Each vertex's group: its own, or the first vertex of the tied ones.
    let mut head: Vec<u32> = (0..count as u32).collect();
    for group in held.tied {
        for &v in group {
            if head[v as usize] != v || group.iter().filter(|&&w| w == v).count() > 1 {
                return Err(MeshFieldError::Invalid(format!("vertex {v} is tied twice")));
            }
            head[v as usize] = group[0];
        }
    }
    let mut known: Vec<Option<f64>> = vec![None; count];
    for &(v, value) in held.fixed {
        let slot = &mut known[head[v as usize] as usize];
        if !value.is_finite() || slot.is_some_and(|other| other != value) {
            return Err(MeshFieldError::Invalid(format!(
                "vertex {v} is held at {value}, which another value contradicts or which is not finite"
            )));
        }
        *slot = Some(value);
    }
    // Tied groups may join pieces: what hangs together shares one constant.
    let (piece, pieces) = mesh.pieces();
    let mut joined: Vec<u32> = (0..pieces as u32).collect();
    for v in 0..count {
        let (a, b) = (root(&joined, piece[v]), root(&joined, piece[head[v] as usize]));
        joined[a.max(b) as usize] = a.min(b);
    }
    let mut has_value = vec![false; pieces];
    for v in 0..count {
        if known[head[v] as usize].is_some() {
            has_value[root(&joined, piece[v]) as usize] = true;
        }
    }
    for v in 0..count {
        let piece = root(&joined, piece[v]) as usize;
        if !has_value[piece] {
            known[head[v] as usize] = Some(0.0);
            has_value[piece] = true;
        }
    }
    let mut number = vec![u32::MAX; count];
    let mut unknowns = 0;
    let sources = (0..count)
        .map(|v| {
            let head = head[v] as usize;
            if let Some(value) = known[head] {
                return Source::Known(value);
            }
            if number[head] == u32::MAX {
                number[head] = unknowns;
                unknowns += 1;
            }
            Source::Unknown(number[head])
        })
        .collect();
    Ok((sources, unknowns as usize))
}

/// `max |Ax − b|` over `max (|A||x| + |b|)`; `scale` holds |b| with all its terms.
fn relative_residual(entries: &[Entry<f64>], x: &[f64], b: &[f64], scale: &mut [f64]) -> f64 {
    let mut residual: Vec<f64> = b.iter().map(|b| -b).collect();
    let mut add = |row: u32, column: u32, value: f64| {
        let term = value * x[column as usize];
        residual[row as usize] += term;
        scale[row as usize] += term.abs();
    };
    for entry in entries {
        add(entry.row, entry.col, entry.val);
        if entry.row != entry.col {
            add(entry.col, entry.row, entry.val);
        }
    }
    let greatest = |v: &[f64]| v.iter().fold(0.0, |m: f64, r| if r.is_nan() { *r } else { m.max(r.abs()) });
    let scale = greatest(scale);
    if scale > 0.0 { greatest(&residual) / scale } else { 0.0 }
}

fn angle_rms(mesh: &FieldMesh, flows: &[Flow], values: &[f64]) -> f64 {
    let (mut sum, mut weights) = (0.0, 0.0);
    for (t, flow) in flows.iter().enumerate() {
        let Ok(element) = Element::new(mesh, t, flow) else { continue };
        let psi = mesh.triangles()[t].map(|v| values[v as usize]);
        let slope = |d: &[f64; 3]| (0..3).map(|k| d[k] * psi[k]).sum::<f64>();
        sum += element.weight * slope(&element.along).atan2(slope(&element.across).abs()).powi(2);
        weights += element.weight;
    }
    if weights > 0.0 { (sum / weights).sqrt() } else { 0.0 }
}

/// Gradient of ψ on each triangle, in its plane.
pub fn triangle_gradients(mesh: &FieldMesh, values: &[f64]) -> Vec<Vector3> {
    (0..mesh.triangles().len())
        .map(|t| {
            let hats = mesh.hat_gradients(t);
            (0..3).map(|k| hats[k] * values[mesh.triangles()[t][k] as usize]).sum()
        })
        .collect()
}
