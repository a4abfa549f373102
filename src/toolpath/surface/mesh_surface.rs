//! The part as planners on a mesh see it: one surface over all patches or facets, with its normals and
//! curvature, less what the cutter cannot reach from above, and a strip beyond its borders.
//!
//! Patches are sewn together along common borders and asked for their exact normals and curvature; on a
//! mesh both are fitted to the vertices of each smooth sheet. Heights of cutter locations come from
//! dropping the cutter on the part itself, as always.

use std::collections::{BinaryHeap, HashMap, HashSet};

use crate::vocabulary::{Faces, PlanError};
use cutter::Cutter;
use field::mesh::{Bend, Coarser, FieldMesh, MeshFieldError, Refined, Sheets, parted, weld};
use geometry::{Aabb, Point3, Vector3};
use part::Part;

/// Edges of the mesh that carries the fields are at most this share of the cutter's radius. Longer ones
/// smooth what the cutter feels; shorter ones cost time as their inverse square.
const EDGE_OVER_RADIUS: f64 = 0.25;

/// Edges are longer than that where a part would take more triangles than this.
const MOST_TRIANGLES: f64 = 400_000.0;

/// Curvature on a mesh is that of the vertices within this share of the cutter's radius.
const FIT_OVER_RADIUS: f64 = 0.5;

/// Borders of patches nearer than this many times the tessellation's deviation are one. Twice the
/// deviation lies between two tessellations of the same curve; models leave gaps as well.
const WELD_OVER_DEVIATION: f64 = 4.0;

/// Steeper places than this, from the level, are left out, as the cosine: passes along the surface would lie
/// nearly on top of each other in the plan view. A tenth of a degree beyond 80, so that walls drafted by 10, as
/// their file rounds them, are in.
pub(crate) const STEEPEST_COSINE: f64 = 0.171_929;

/// A mesh fills the rectangle around it where no more than this share of it lies beside: coordinates are rounded.
const BESIDE: f64 = 1e-6;

/// A place is covered where the part stands over it by more than this share of the cutter's radius.
const COVERED_OVER_RADIUS: f64 = 0.01;

/// Triangles that meet at a sharper angle than this have a crease between them, as its cosine (30°).
const CREASE_COSINE: f64 = 0.866;

/// A mesh has steps when its creases are longer together than this many radii of the cutter: fewer are
/// the slips of a tessellation.
const CREASES_OVER_RADIUS: f64 = 2.0;

/// Triangles of a tessellation lower than this many times its deviation do not tell of creases.
const LEAST_HEIGHT_OVER_DEVIATION: f64 = 10.0;

/// A strip's outer corner is at most this many widths away from the border's.
const LONGEST_MITER: f64 = 2.0;

/// A coarser mesh has edges so many times as long: about a quarter of the vertices. With fewer, minima of the
/// whole mesh that lie near each other are taken for one another.
const COARSER: f64 = 2.0;

/// The surface that fields stand on, with a strip beyond its borders.
pub(crate) struct MeshSurface {
    /// All triangles, those of the strip last.
    pub mesh: FieldMesh,
    /// Curvature at the vertices.
    pub bends: Vec<Bend>,
    /// Normals at the corners of each triangle, of its own side of any crease.
    pub corner_normals: Vec<[Vector3; 3]>,
    /// Triangles before this one are the part's own.
    pub own_triangles: usize,
    /// For every vertex of the strip the vertex of the part that it continues; itself for those of
    /// the part.
    pub origin: Vec<u32>,
    /// Direction of the border at each triangle of the strip.
    pub border: Vec<Vector3>,
    /// Width of the strip, mm.
    margin: f64,
}

/// A connected piece of a surface.
pub(crate) struct ConnectedPiece {
    /// Its triangles, with the mean normals at vertices.
    pub mesh: FieldMesh,
    /// Sharp edges that stand out between two of its triangles: one of them, and its side.
    pub sharp: Vec<[usize; 2]>,
    /// Curvature at the vertices.
    pub bends: Vec<Bend>,
    /// Normals at the corners of each triangle, of its own side of any crease.
    pub corner_normals: Vec<[Vector3; 3]>,
}

impl ConnectedPiece {
    /// The unit normal of a triangle and how the surface bends there, the mean of its corners; `None` without
    /// an area.
    pub fn facet(&self, t: usize) -> Option<(Vector3, Bend)> {
        let normal = self.mesh.area_vector(t).try_normalize(1e-300)?;
        let mut bend = Bend::default();
        self.mesh.triangles()[t].iter().for_each(|&v| bend.add(&self.bends[v as usize], 1.0 / 3.0));
        Some((normal, bend))
    }
}

/// What of a part can be planned from above, and what cannot.
pub(crate) struct Reachable {
    /// Connected pieces.
    pub pieces: Vec<ConnectedPiece>,
    /// Area that is too steep, mm².
    pub steep_area: f64,
}

/// True where a part is better planned on its mesh: several patches, which charts would plan one by one
/// with seams between them; a mesh with holes or in pieces, over which a height surface would go on in
/// the air; a mesh with sharp creases, which a height surface rounds over half a radius each way.
pub(crate) fn wants_mesh(part: &Part, cutter: &Cutter) -> bool {
    if !part.patches().is_empty() {
        return part.patches().len() > 1;
    }
    let mesh = part.mesh();
    let up: Vec<bool> = (0..mesh.triangles().len()).map(|t| mesh.normal(t).z > STEEPEST_COSINE).collect();
    let mut creases = 0.0;
    for t in (0..up.len()).filter(|&t| up[t]) {
        for k in 0..3 {
            if let Some(n) = mesh
                .neighbour(t, k)
                .filter(|&n| !up[n] || mesh.normal(t).dot(&mesh.normal(n)) < CREASE_COSINE)
            {
                let corners = mesh.corners(t);
                creases += (corners[(k + 1) % 3] - corners[k]).norm() * if up[n] { 0.5 } else { 1.0 };
            }
        }
    }
    let facing: Vec<[u32; 3]> = (0..up.len()).filter(|&t| up[t]).map(|t| mesh.triangles()[t]).collect();
    let holes = compacted(mesh.vertices(), &facing, None).is_ok_and(|(m, _)| m.loops().len() > 1);
    holes || creases > CREASES_OVER_RADIUS * cutter.radius()
}

/// True where what faces up of a mesh is, seen from above, as large as the rectangle around it. Charts are such
/// rectangles; what of them lies beside the part would be planned for as well, and a pass over a notch would
/// come apart. Patches are all of their charts.
pub(crate) fn fills_its_rectangle(part: &Part) -> bool {
    if !part.patches().is_empty() {
        return true;
    }
    let mesh = part.mesh();
    let (mut area, mut around) = (0.0, Aabb::EMPTY);
    for t in (0..mesh.triangles().len()).filter(|&t| mesh.normal(t).z > STEEPEST_COSINE) {
        area += mesh.normal(t).z * mesh.area(t);
        mesh.corners(t).iter().for_each(|corner| around.grow(corner));
    }
    let size = around.max - around.min;
    (area - size.x * size.y).abs() <= BESIDE * area
}

/// Everything of a part that passes along the surface can reach.
///
/// # Errors
/// When the part's triangles do not make a surface, or nothing of it faces up.
pub(crate) fn reachable(part: &Part, cutter: &Cutter) -> Result<Reachable, PlanError> {
    reachable_of(part, cutter, (Faces::ALL, 0.0))
}

/// As [`reachable`], of some faces, and what goes on smoothly from them within a distance, mm.
///
/// # Errors
/// As [`reachable`].
pub(crate) fn reachable_of(
    part: &Part,
    cutter: &Cutter,
    (faces, around): (Faces, f64),
) -> Result<Reachable, PlanError> {
    let refused = |e: MeshFieldError| not_applicable(&e.to_string());
    let mesh = part.mesh();
    let (points, triangles) = if part.patches().len() > 1 {
        weld(mesh.vertices(), mesh.triangles(), WELD_OVER_DEVIATION * part.mesh_deviation())
    } else {
        (mesh.vertices().to_vec(), mesh.triangles().to_vec())
    };
    // A field goes on across an edge of two triangles only.
    let (points, triangles) =
        if mesh.surface().is_err() { parted(&points, &triangles) } else { (points, triangles) };
    let whole = FieldMesh::new(points, triangles, None).map_err(refused)?;
    let area: f64 = (0..whole.triangles().len()).map(|t| whole.area(t)).sum();
    // An equilateral triangle of edge l has 0.43 l², those of a split mesh about half of it.
    let edge = (EDGE_OVER_RADIUS * cutter.radius()).max((area / (0.22 * MOST_TRIANGLES)).sqrt());
    let sheets = Sheets::of(&whole, FIT_OVER_RADIUS * cutter.radius());
    let mut refined =
        Refined { points: whole.points().to_vec(), triangles: whole.triangles().to_vec(), sheets };
    refined.refine(edge).map_err(refused)?;
    let (mut normals, mut bends) = refined.at_points();
    if !part.patches().is_empty() {
        exact(part, &refined.points, &mut normals, &mut bends);
    }
    let creases = refined.creases(LEAST_HEIGHT_OVER_DEVIATION * part.mesh_deviation());
    let corner_normals = refined.corner_normals(&normals, &creases);
    let highest_above = COVERED_OVER_RADIUS * cutter.radius() + 2.0 * part.mesh_deviation();
    let mut state = work::parallel::map(refined.triangles.len(), |t| {
        let [a, b, c] = refined.triangles[t].map(|i| refined.points[i as usize]);
        let normal = (b - a).cross(&(c - a));
        let centre = (a.coords + b.coords + c.coords) / 3.0;
        let slope = normal.z / normal.norm();
        if slope <= 0.0 {
            return State::Below;
        }
        let roof = part.bvh().highest_at(part.mesh(), centre.x, centre.y);
        match roof {
            Some(hit) if hit.z > centre.z + highest_above => State::Below,
            _ if slope < STEEPEST_COSINE => State::Steep(0.5 * normal.norm()),
            _ => State::Open,
        }
    });
    if faces != Faces::ALL {
        leave_out(&refined, &faces, around, &mut state);
    }
    own_normals(&refined, &state, &corner_normals, &mut normals);
    let sharp = between_open(&refined, &state, &creases);
    let steep_area = state.iter().map(|s| if let State::Steep(area) = s { *area } else { 0.0 }).sum();
    let kept: Vec<usize> = (0..state.len()).filter(|&t| matches!(state[t], State::Open)).collect();
    let open: Vec<[u32; 3]> = kept.iter().map(|&t| refined.triangles[t]).collect();
    let corner_normals: Vec<[Vector3; 3]> = kept.iter().map(|&t| corner_normals[t]).collect();
    if open.is_empty() {
        return Err(not_applicable("no part of it faces up at less than 80 degrees"));
    }
    let (all, kept) = compacted(&refined.points, &open, Some(&normals)).map_err(refused)?;
    let bends: Vec<Bend> = kept.iter().map(|&v| bends[v as usize]).collect();
    let is_sharp = |[a, b]: [u32; 2]| {
        let [a, b] = [a, b].map(|v| kept[v as usize]);
        sharp.contains(&[a.min(b), a.max(b)])
    };
    let (piece, count) = all.pieces();
    let mut of_piece: Vec<Vec<usize>> = vec![Vec::new(); count];
    for (t, corners) in all.triangles().iter().enumerate() {
        of_piece[piece[corners[0] as usize] as usize].push(t);
    }
    let pieces = of_piece
        .iter()
        .map(|own| {
            let triangles: Vec<[u32; 3]> = own.iter().map(|&t| all.triangles()[t]).collect();
            // One of the two triangles at an edge runs from its lesser to its greater vertex.
            let sides = (0..triangles.len()).flat_map(|t| [0, 1, 2].map(|k| [t, k]));
            let from_lesser = sides.filter(|&[t, k]| {
                let (a, b) = (triangles[t][k], triangles[t][(k + 1) % 3]);
                a < b && is_sharp([a, b])
            });
            let sharp = from_lesser.collect();
            let (mesh, kept) = compacted(all.points(), &triangles, Some(all.normals()))?;
            Ok(ConnectedPiece {
                mesh,
                sharp,
                bends: kept.iter().map(|&v| bends[v as usize]).collect(),
                corner_normals: own.iter().map(|&t| corner_normals[t]).collect(),
            })
        })
        .collect::<Result<Vec<_>, MeshFieldError>>()
        .map_err(refused)?;
    Ok(Reachable { pieces, steep_area })
}

/// Gives the points that what is left out meets the mean normals of the other triangles around them: where a
/// wall goes down from a rim, the mean over all leans out half over the edge, and so would passes.
fn own_normals(refined: &Refined, state: &[State], corner_normals: &[[Vector3; 3]], normals: &mut [Vector3]) {
    let mut meets = vec![false; normals.len()];
    let mut sums = vec![Vector3::zeros(); normals.len()];
    for ((corners, state), own) in refined.triangles.iter().zip(state).zip(corner_normals) {
        let [a, b, c] = corners.map(|i| refined.points[i as usize]);
        let area = 0.5 * (b - a).cross(&(c - a)).norm();
        for (&v, normal) in corners.iter().zip(own) {
            match state {
                State::Open => sums[v as usize] += normal * area,
                State::Steep(_) | State::Below | State::Beside => meets[v as usize] = true,
            }
        }
    }
    for v in (0..normals.len()).filter(|&v| meets[v]) {
        normals[v] = sums[v].try_normalize(1e-300).unwrap_or(normals[v]);
    }
}

/// Of the creases that stand out those between two triangles that are reached, from their lesser to their
/// greater point. At a rim passes end as at every border.
fn between_open(refined: &Refined, state: &[State], creases: &[([u32; 2], bool)]) -> HashSet<[u32; 2]> {
    let mut sides: HashMap<[u32; 2], u32> = creases.iter().filter(|c| c.1).map(|c| (c.0, 0)).collect();
    for (corners, _) in refined.triangles.iter().zip(state).filter(|(_, state)| matches!(state, State::Open))
    {
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            if let Some(count) = sides.get_mut(&[a.min(b), a.max(b)]) {
                *count += 1;
            }
        }
    }
    sides.into_iter().filter(|&(_, count)| count == 2).map(|(edge, _)| edge).collect()
}

/// What can be done about a triangle from above.
#[derive(Clone, Copy)]
enum State {
    Open,
    Steep(f64),
    Below,
    /// Beside the faces that are asked for.
    Beside,
}

/// Leaves out what is none of the faces asked for, but for what goes on from them within a distance, mm, over
/// no crease.
fn leave_out(refined: &Refined, faces: &Faces, around: f64, state: &mut [State]) {
    let corners = |t: usize| refined.triangles[t].map(|v| refined.points[v as usize]);
    let middle = |t: usize| corners(t).iter().map(|p| p.coords).sum::<Vector3>() / 3.0;
    let normal = |t: usize| {
        let [a, b, c] = corners(t);
        (b - a).cross(&(c - a)).try_normalize(0.0).unwrap_or_else(Vector3::zeros)
    };
    let is_open = |state: &State| matches!(state, State::Open);
    let mut at_edge: HashMap<[u32; 2], Vec<usize>> = HashMap::new();
    for (t, corners) in refined.triangles.iter().enumerate().filter(|&(t, _)| is_open(&state[t])) {
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            at_edge.entry([a.min(b), a.max(b)]).or_default().push(t);
        }
    }
    let mut left: Vec<f64> = vec![f64::NEG_INFINITY; state.len()];
    let mut open = BinaryHeap::new();
    for t in (0..state.len()).filter(|&t| is_open(&state[t]) && faces.hold(&normal(t))) {
        left[t] = around;
        open.push((around.to_bits(), t));
    }
    // What is left of the distance is not negative, so that its bits are in its order.
    while let Some((bits, t)) = open.pop() {
        if f64::from_bits(bits) < left[t] {
            continue;
        }
        let own = refined.triangles[t];
        for k in 0..3 {
            let (a, b) = (own[k], own[(k + 1) % 3]);
            for &n in &at_edge[&[a.min(b), a.max(b)]] {
                let remains = left[t] - (middle(n) - middle(t)).norm();
                if remains > left[n].max(0.0) && normal(t).dot(&normal(n)) >= CREASE_COSINE {
                    left[n] = remains;
                    open.push((remains.to_bits(), n));
                }
            }
        }
    }
    let beside = state.iter_mut().zip(left).filter(|(state, left)| is_open(state) && *left < 0.0);
    beside.for_each(|(state, _)| *state = State::Beside);
}

/// Exact normals and curvature from the patches.
fn exact(part: &Part, points: &[Point3], normals: &mut [Vector3], bends: &mut [Bend]) {
    let found = work::parallel::map(points.len(), |v| {
        let (foot, _) = part.closest_point(&points[v]);
        let at = foot.at?;
        let bend =
            part.curvature(at).map(|k| Bend::new(&k.min_direction, &k.max_direction, [k.min, 0.0, k.max]));
        Some((foot.normal, bend))
    });
    for (v, found) in found.into_iter().enumerate() {
        if let Some((normal, bend)) = found {
            normals[v] = normal;
            bends[v] = bend.unwrap_or(bends[v]);
        }
    }
}

/// A mesh of some of the triangles over points, and for each of its vertices the point it is.
fn compacted(
    points: &[Point3],
    triangles: &[[u32; 3]],
    normals: Option<&[Vector3]>,
) -> Result<(FieldMesh, Vec<u32>), MeshFieldError> {
    let mut number = vec![u32::MAX; points.len()];
    let mut kept: Vec<u32> = Vec::new();
    let mut own = triangles.to_vec();
    for v in own.iter_mut().flatten() {
        if number[*v as usize] == u32::MAX {
            number[*v as usize] = kept.len() as u32;
            kept.push(*v);
        }
        *v = number[*v as usize];
    }
    let places = kept.iter().map(|&v| points[v as usize]).collect();
    let normals = normals.map(|n| kept.iter().map(|&v| n[v as usize]).collect());
    Ok((FieldMesh::new(places, own, normals)?, kept))
}

impl MeshSurface {
    /// A piece and a strip of the given width (mm) beyond its borders, in the surface's tangent planes:
    /// passes outside the border serve the strip inside it.
    ///
    /// # Errors
    /// When strip and piece do not make a surface.
    pub fn with_margin(piece: &ConnectedPiece, width: f64) -> Result<Self, PlanError> {
        let ConnectedPiece { mesh: piece, bends, corner_normals, .. } = piece;
        let mut corner_normals = corner_normals.clone();
        let (mut points, mut triangles) = (piece.points().to_vec(), piece.triangles().to_vec());
        let (mut normals, mut bends) = (piece.normals().to_vec(), bends.clone());
        let mut origin: Vec<u32> = (0..points.len() as u32).collect();
        let mut border = Vec::new();
        for ring in piece.loops() {
            let n = ring.len();
            let at = |k: usize| piece.points()[ring[k % n] as usize];
            // The surface lies to the left of each border edge, so out is to the right.
            let out = |k: usize| {
                let normal = &piece.normals()[ring[k % n] as usize];
                (at(k + 1) - at(k)).cross(normal).try_normalize(0.0).unwrap_or_else(Vector3::zeros)
            };
            let outer: Vec<(Point3, Vector3)> = (0..n)
                .map(|k| {
                    let (before, after) = (out(k + n - 1), out(k));
                    let middle = (before + after).try_normalize(1e-6).unwrap_or(after);
                    let miter = (1.0 / middle.dot(&after).max(1e-6)).min(LONGEST_MITER);
                    (at(k) + middle * (width * miter), middle)
                })
                .collect();
            // Only what lies flat beside the border: where a border turns in more sharply than the strip
            // is wide, the strip is left out.
            let sound = |t: [Point3; 3], normal: &Vector3| {
                let double = (t[1] - t[0]).cross(&(t[2] - t[0]));
                let longest = (t[1] - t[0]).norm().max((t[2] - t[1]).norm()).max((t[0] - t[2]).norm());
                double.dot(normal) > 1e-3 * width.min(longest) * longest
            };
            let mut number = vec![u32::MAX; n];
            for k in 0..n {
                let l = (k + 1) % n;
                let (a, b) = (ring[k], ring[l]);
                let normal = &piece.normals()[a as usize];
                let (p, q) = (outer[k].0, outer[l].0);
                if !sound([at(l), at(k), p], normal) || !sound([at(l), p, q], normal) {
                    continue;
                }
                for m in [k, l] {
                    if number[m] == u32::MAX {
                        let v = ring[m] as usize;
                        number[m] = points.len() as u32;
                        points.push(outer[m].0);
                        normals.push(piece.normals()[v]);
                        bends.push(bends[v]);
                        origin.push(v as u32);
                    }
                }
                triangles.extend([[b, a, number[k]], [b, number[k], number[l]]]);
                let [from, to] = [a, b].map(|v| piece.normals()[v as usize]);
                corner_normals.extend([[to, from, from], [to, from, to]]);
                let along = (at(l) - at(k)).normalize();
                border.extend([along, along]);
            }
        }
        let own_triangles = piece.triangles().len();
        let mesh =
            FieldMesh::new(points, triangles, Some(normals)).map_err(|e| not_applicable(&e.to_string()))?;
        Ok(Self { mesh, bends, corner_normals, own_triangles, origin, border, margin: width })
    }

    /// The same surface by fewer vertices, and how functions come from it; `None` where they would be hardly
    /// fewer.
    pub fn coarser(&self, piece: &ConnectedPiece, cutter: &Cutter) -> Option<(Self, Coarser)> {
        let mesh = &piece.mesh;
        let length = |&[v, w]: &[u32; 2]| (mesh.points()[w as usize] - mesh.points()[v as usize]).norm();
        let longest = mesh.edges().iter().map(length).fold(EDGE_OVER_RADIUS * cutter.radius(), f64::max);
        let coarser = Coarser::new(mesh, COARSER * longest).ok()?;
        if 2 * coarser.kept.len() > mesh.points().len() {
            return None;
        }
        let corner_normals = coarser.mesh.triangles().iter();
        let corner_normals = corner_normals.map(|t| t.map(|v| coarser.mesh.normals()[v as usize])).collect();
        let piece = ConnectedPiece {
            mesh: coarser.mesh.clone(),
            bends: coarser.of_finer(&piece.bends),
            corner_normals,
            sharp: Vec::new(),
        };
        Some((Self::with_margin(&piece, self.margin).ok()?, coarser))
    }

    /// A function of the vertices that goes on beyond borders as it comes to them, in the tangent planes.
    pub fn continued(&self, mut values: Vec<f64>) -> Vec<f64> {
        let mesh = &self.mesh;
        // Gradients of the part's triangles, summed by area.
        let mut around = vec![(Vector3::zeros(), 0.0); values.len()];
        for (t, corners) in mesh.triangles()[..self.own_triangles].iter().enumerate() {
            let hats = mesh.hat_gradients(t).into_iter().zip(corners);
            let gradient: Vector3 = hats.map(|(hat, &v)| hat * values[v as usize]).sum();
            for &v in corners {
                around[v as usize].0 += gradient * mesh.area(t);
                around[v as usize].1 += mesh.area(t);
            }
        }
        for (v, &origin) in self.origin.iter().enumerate().filter(|&(v, &origin)| origin as usize != v) {
            let (gradient, area) = around[origin as usize];
            let out = mesh.points()[v] - mesh.points()[origin as usize];
            values[v] = values[origin as usize] + if area > 0.0 { gradient.dot(&out) / area } else { 0.0 };
        }
        values
    }
}

pub(crate) fn not_applicable(reason: &str) -> PlanError {
    PlanError::NotApplicable { strategy: "streamline", reason: reason.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::TriangleMesh;

    /// A block with walls drafted by 10 degrees on all sides, its coordinates rounded as a binary STL does.
    #[test]
    fn walls_drafted_by_ten_degrees_are_reached() {
        let out = 5.0 * 10f64.to_radians().tan();
        let ring = |half: f64, z: f64| {
            [[-1.0, -0.7], [1.0, -0.7], [1.0, 0.7], [-1.0, 0.7]].map(|[x, y]| {
                // Askew, so that no two walls round alike.
                let (sin, cos) = 0.3f64.sin_cos();
                let [x, y] = [half * x, half * y];
                let far = [cos * x - sin * y + 700.0, sin * x + cos * y + 400.0, z];
                Point3::from(far.map(|c| f64::from(c as f32)))
            })
        };
        let points = ring(10.0, 5.0);
        let foot: Vec<Point3> = (0..4)
            .map(|k| {
                let [before, here, after] = [3, 0, 1].map(|n| points[(k + n) % 4].xy());
                let square = |way: geometry::Vector2| geometry::Vector2::new(way.y, -way.x) * out;
                let aside = square((here - before).normalize()) + square((after - here).normalize());
                let foot = (here + aside).coords.push(0.0);
                Point3::from(foot.map(|c| f64::from(c as f32)))
            })
            .collect();
        let points = [foot, points.to_vec()].concat();
        let wall = |k: u32| [[k, (k + 1) % 4, 4 + (k + 1) % 4], [k, 4 + (k + 1) % 4, 4 + k]];
        let triangles = (0..4).flat_map(wall).chain([[4, 5, 6], [4, 6, 7]]).collect();
        let part = Part::from_mesh(TriangleMesh::new(points, triangles).unwrap().0);
        let walls = (0..8).map(|t| part.mesh().normal(t).z - 80f64.to_radians().cos());
        let off: Vec<f64> = walls.collect();
        assert!(off.iter().all(|off| off.abs() < 1e-4) && off.iter().any(|off| *off < -2e-7), "{off:?}");
        let reached = reachable(&part, &Cutter::ball(6.0).unwrap()).unwrap();
        assert!(reached.steep_area == 0.0, "{}", reached.steep_area);
    }
}
