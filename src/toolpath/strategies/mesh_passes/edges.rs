//! Passes along sharp edges that stand out.
//!
//! What cuts one side of such an edge does not reach over it: the last contact on each side has to lie within
//! half an interval of the edge, wherever those on the other side are. Where passes run along an edge and a
//! side has none so near, a pass along the edge that touches this side serves it.
//!
//! Enters: the edges, the contacts of planned passes. Leaves: short passes along stretches of the edges.

use std::collections::HashMap;

use super::guide::{MeshGuide, Spot};
use super::width_at;
use crate::levels::halving::{Allowed, Track, along_stretches};
use crate::levels::stretches::{Stretches, nearest_on};
use crate::vocabulary::{Passes, PlanError};
use field::mesh::{FieldMesh, MeshPoint};
use geometry::{Point2, Point3, Vector3};

/// A side of an edge is open where its nearest contact is farther away than half the allowed interval by this
/// share.
const OPEN: f64 = 0.03;

/// A sharp edge, or several that go on from each other: for each the triangle to the left of it and its side
/// there.
struct Chain {
    edges: Vec<[usize; 2]>,
    closed: bool,
}

/// A place on an edge, as the end of one side of it.
struct OnEdge {
    spot: Spot,
    /// Unit tangent of this side, square to the edge.
    inward: Vector3,
    /// The same of the other side.
    outward: Vector3,
}

/// Appends passes along edges (a triangle and its side) that the others leave open, and tells how many.
///
/// # Errors
/// When cancelled.
pub(super) fn serve(
    guide: &MeshGuide<'_>,
    edges: &[[usize; 2]],
    passes: &mut Passes,
) -> Result<usize, PlanError> {
    let chains = chains(&guide.surface.mesh, edges);
    let sides = chains.iter().flat_map(|chain| [0, 1].map(|side| (places(guide, chain, side), chain.closed)));
    let sides: Vec<(Vec<OnEdge>, bool)> = sides.collect();
    let half = |place: &OnEdge| 0.5 * (1.0 + OPEN) * place.spot.allowed.width;
    let reach = sides.iter().flat_map(|(places, _)| places).map(half).fold(0.0, f64::max);
    if reach <= 0.0 {
        return Ok(0);
    }
    let mut stretches = Stretches::new(reach);
    let planned = passes.contacts.len();
    passes.contacts.iter().for_each(|pass| stretches.insert(pass));
    for (places, closed) in sides {
        let is_open = |place: &OnEdge| {
            let (at, toward) = (place.spot.at.position, place.inward - place.outward);
            let near =
                |ends: &[Point3; 2]| Some((nearest_on(&on_side(*ends, &at, &toward)?, &at) - at).norm());
            let within = stretches.around(&at).filter_map(near).fold(f64::INFINITY, f64::min);
            within > half(place)
        };
        let wanted = |k: usize| is_open(&places[k]).then_some(places[k].spot.allowed.width);
        let track = Track { points: places.iter().map(|place| place.spot).collect(), closed };
        along_stretches(guide, track, &wanted, guide.settings.sampling, passes, guide.monitor)?;
    }
    Ok(passes.contacts.len() - planned)
}

/// What of a stretch lies from `at` `toward` a side.
fn on_side([a, b]: [Point3; 2], at: &Point3, toward: &Vector3) -> Option<[Point3; 2]> {
    let [from, to] = [a, b].map(|p| (p - at).dot(toward));
    let crossing = || a + (b - a) * (from / (from - to));
    match [from >= 0.0, to >= 0.0] {
        [true, true] => Some([a, b]),
        [true, false] => Some([a, crossing()]),
        [false, true] => Some([crossing(), b]),
        [false, false] => None,
    }
}

/// The triangle across a side of another one, and its own side there.
fn across(mesh: &FieldMesh, [t, k]: [usize; 2]) -> Option<[usize; 2]> {
    let n = mesh.neighbour(t, k)?;
    let end = mesh.triangles()[t][(k + 1) % 3];
    mesh.triangles()[n].iter().position(|&v| v == end).map(|l| [n, l])
}

/// Edges one after the other, from where more or fewer than two meet, or around.
fn chains(mesh: &FieldMesh, edges: &[[usize; 2]]) -> Vec<Chain> {
    let ends = |&[t, k]: &[usize; 2]| {
        let corners = mesh.triangles()[t];
        [corners[k], corners[(k + 1) % 3]]
    };
    let mut at: HashMap<u32, Vec<usize>> = HashMap::new();
    for (n, edge) in edges.iter().enumerate() {
        ends(edge).into_iter().for_each(|v| at.entry(v).or_default().push(n));
    }
    let mut done = vec![false; edges.len()];
    let mut chains = Vec::new();
    // From ends first; what is left goes around.
    for from_end in [true, false] {
        for first in 0..edges.len() {
            let start = ends(&edges[first]).into_iter().find(|v| !from_end || at[v].len() != 2);
            let Some(start) = start.filter(|_| !done[first]) else { continue };
            let (mut chain, mut edge, mut vertex) = (Vec::new(), Some(first), start);
            while let Some(n) = edge {
                done[n] = true;
                let [a, b] = ends(&edges[n]);
                let [t, k] = edges[n];
                if a == vertex {
                    chain.push([t, k]);
                    vertex = b;
                } else {
                    chain.extend(across(mesh, [t, k]));
                    vertex = a;
                }
                let next = &at[&vertex];
                edge = if next.len() == 2 { next.iter().copied().find(|&m| !done[m]) } else { None };
            }
            chains.push(Chain { edges: chain, closed: vertex == start && at[&start].len() == 2 });
        }
    }
    chains
}

/// Places along a chain, as ends of what lies to the left of it (0) or to the right (1).
fn places(guide: &MeshGuide<'_>, chain: &Chain, side: usize) -> Vec<OnEdge> {
    let mesh = &guide.surface.mesh;
    let length = |&[t, k]: &[usize; 2]| {
        let corners = mesh.corners(t);
        (corners[(k + 1) % 3] - corners[k]).norm()
    };
    let mut whole = 0.0;
    let until: Vec<f64> = chain
        .edges
        .iter()
        .map(|edge| {
            whole += length(edge);
            whole
        })
        .collect();
    let least = if chain.closed { 5.0 } else { 1.0 };
    let count = (whole / guide.settings.sampling).ceil().max(least) as usize;
    let place = |n: usize| {
        let s = whole * n as f64 / count as f64;
        let e = until.partition_point(|end| *end < s).min(until.len() - 1);
        let share = (1.0 - (until[e] - s) / length(&chain.edges[e])).clamp(0.0, 1.0);
        on_edge(guide, chain.edges[e], share, side)
    };
    let points = if chain.closed { count } else { count + 1 };
    let places: Option<Vec<OnEdge>> = (0..points).map(place).collect();
    places.unwrap_or_default()
}

/// The place at a share of an edge.
fn on_edge(guide: &MeshGuide<'_>, [t, k]: [usize; 2], share: f64, side: usize) -> Option<OnEdge> {
    let mesh = &guide.surface.mesh;
    let [n, l] = across(mesh, [t, k])?;
    let corners = mesh.corners(t);
    let edge = corners[(k + 1) % 3] - corners[k];
    let position = corners[k] + edge * share;
    // The triangle, its corners at the beginning and at the end of the edge, the way around it.
    let sides = [(t, [k, (k + 1) % 3], edge), (n, [(l + 1) % 3, l], -edge)];
    let point = |(t, [from, to], _): (usize, [usize; 2], Vector3)| {
        let mut weights = [0.0; 3];
        (weights[from], weights[to]) = (1.0 - share, share);
        MeshPoint { triangle: t as u32, weights, position }
    };
    let inward =
        |side: (usize, [usize; 2], Vector3)| guide.normal(&point(side)).cross(&side.2).try_normalize(1e-300);
    let [own, other] = [sides[side], sides[1 - side]];
    let (at, inward, outward) = (point(own), inward(own)?, inward(other)?);
    let settings = guide.settings;
    let (width, _) = width_at(guide.cutter, &guide.normal(&at), &inward, &guide.bend(&at), settings.step);
    let width = settings.guide().corrected(width, &position, settings.step);
    let axis = Point2::from(position.coords.xy() + guide.axis_offset(&at));
    let spot = Spot { at, axis, allowed: Allowed { step: f64::INFINITY, width }, turns: false };
    Some(OnEdge { spot, inward, outward })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Edges go on from each other up to where a third one meets them, in whatever order they come; a ring of
    /// them is closed.
    #[test]
    fn edges_go_on_up_to_where_others_meet_them() {
        // A hexagon on top, six sides down from it.
        let ring = |radius: f64, z: f64| {
            (0..6).map(move |k| {
                let (sin, cos) = (std::f64::consts::TAU * f64::from(k) / 6.0).sin_cos();
                Point3::new(radius * cos, radius * sin, z)
            })
        };
        let points: Vec<Point3> =
            [Point3::origin()].into_iter().chain(ring(4.0, 0.0)).chain(ring(6.0, -2.0)).collect();
        let sector = |k: u32| {
            let (a, b) = (1 + k, 1 + (k + 1) % 6);
            [[0, a, b], [a, a + 6, b], [b, a + 6, b + 6]]
        };
        let mesh = FieldMesh::new(points, (0..6).flat_map(sector).collect(), None).unwrap();
        // Triangles 0, 3, ... have the edges of the top as their second sides; the first sides of 1, 4, ... go down.
        let top: Vec<[usize; 2]> = [0, 4, 1, 5, 3, 2].map(|k| [3 * k, 1]).to_vec();
        let found = chains(&mesh, &top);
        assert_eq!(found.len(), 1);
        assert!(found[0].closed && found[0].edges.len() == 6);
        let ends = |&[t, k]: &[usize; 2]| [mesh.triangles()[t][k], mesh.triangles()[t][(k + 1) % 3]];
        let around: Vec<[u32; 2]> = found[0].edges.iter().map(ends).collect();
        assert!((0..6).all(|k| around[k][1] == around[(k + 1) % 6][0]), "{around:?}");
        // Where two of the sides meet the top, the ring is in two pieces.
        let down = [[1, 0], [7, 0]];
        let found = chains(&mesh, &[top, down.to_vec()].concat());
        let mut lengths: Vec<(usize, bool)> =
            found.iter().map(|chain| (chain.edges.len(), chain.closed)).collect();
        lengths.sort_unstable();
        assert_eq!(lengths, [(1, false), (1, false), (2, false), (4, false)]);
    }
}
