//! Creases of the part: where two of its faces meet, each may be cut deepest along the crease itself, and the
//! centres of the cells around may all lie on the other face. mm.
//!
//! Enters: the part. Leaves: the stretches of creases in squares of the plan, with the normals of both faces.

use super::border_cuts::design_along;
use super::facing::LEAST_FACING;
use geometry::{CurveSegment, Point2, Point3, SegmentGrid, TriangleMesh, Vector2, Vector3};
use part::{Part, PatchPoint};
use sim::Grid;

/// Faces meet at a crease where the cosine between their normals is less: 5 degrees. At flatter ones both are
/// cut about as deep.
const CREASED: f64 = 0.9962;

/// So far within a triangle, as a share of it, its side is on its own face and not on the other one.
const WITHIN: f64 = 1e-6;

/// What lies so near to the side of a square is on it, mm: rounding.
const ON_SIDE: f64 = 1e-10;

/// A crease this far below the highest surface is hidden under that, mm.
const HIDDEN: f64 = 1e-6;

/// One side of a crease.
struct Side {
    ends: [Point3; 2],
    /// Parameters of the ends, on a patch.
    at: Option<[PatchPoint; 2]>,
    /// Of its triangle.
    normal: Vector3,
}

/// The creases that an upright cutter can face.
pub(super) struct Creases {
    sides: Vec<Side>,
    /// The same in the plan.
    in_plan: SegmentGrid,
    /// How far triangles are off the part, mm.
    off: f64,
}

impl Creases {
    pub fn new(part: &Part) -> Self {
        let mesh = part.mesh();
        let sides: Vec<Side> = (0..mesh.triangles().len())
            .flat_map(|t| (0..3).filter_map(move |k| side_of(part, t, k)))
            .collect();
        let in_plan = sides.iter().zip(0..).map(|(side, curve)| {
            let ends = side.ends.map(|end| end.xy());
            CurveSegment { ends, curve, index: 0 }
        });
        let in_plan = SegmentGrid::new(in_plan.collect());
        Self { sides, in_plan, off: part.mesh_deviation() }
    }

    /// The cells of a grid with a crease, in their order.
    pub fn cells(&self, grid: &Grid) -> Vec<usize> {
        let mut found: Vec<usize> = self.sides.iter().flat_map(|side| cells_along(side, grid)).collect();
        found.sort_unstable();
        found.dedup();
        found
    }

    /// The middles of the stretches of creases in a square of the plan, also on its sides, each with the
    /// normal of one of its faces.
    pub fn within(&self, part: &Part, centre: Point2, half: f64) -> Vec<(Point3, Vector3)> {
        let half = half + ON_SIDE;
        let corner = |reach: f64| Point2::new(centre.x + reach, centre.y + reach);
        let mut near = Vec::new();
        self.in_plan.near(&[corner(-half), corner(half)], |side| near.push(side));
        near.sort_unstable();
        near.dedup();
        let place = |k: u32| {
            let side = &self.sides[k as usize];
            let [from, to] = clipped(side, centre, half)?;
            let (point, normal) = side.design(part, 0.5 * (from + to));
            let top = part.highest_at(point.x, point.y);
            let is_hidden = top.is_some_and(|top| top.point.z > point.z + HIDDEN + 2.0 * self.off);
            (!is_hidden && normal.z > LEAST_FACING).then_some((point, normal))
        };
        near.into_iter().filter_map(place).collect()
    }
}

impl Side {
    /// The design at a share of the crease, and the normal of the face there.
    fn design(&self, part: &Part, share: f64) -> (Point3, Vector3) {
        design_along(part, &self.ends, self.at, self.normal, share)
    }
}

/// The side `k` of triangle `t`, where a crease runs along it.
fn side_of(part: &Part, t: usize, k: usize) -> Option<Side> {
    let mesh: &TriangleMesh = part.mesh();
    let other = mesh.neighbour(t, k)?;
    let faces = |t: usize| mesh.normal(t).z > LEAST_FACING;
    let meet = |a: &Vector3, b: &Vector3| a.dot(b) < CREASED;
    if !faces(t) || !faces(other) || !meet(&mesh.normal(t), &mesh.normal(other)) {
        return None;
    }
    let own = on_side(part, t, k);
    // Triangles of a smooth face meet at angles as well.
    if own.at.is_some() {
        let back = (0..3).find(|&k| mesh.neighbour(other, k) == Some(t))?;
        let beside = on_side(part, other, back);
        if !meet(&own.design(part, 0.5).1, &beside.design(part, 0.5).1) {
            return None;
        }
    }
    Some(own)
}

/// The side `k` of triangle `t`; on a patch a little within the triangle, whose normals are those of its own
/// face.
fn on_side(part: &Part, t: usize, k: usize) -> Side {
    let [a, b, c] = [0, 1, 2].map(|n| (k + n) % 3);
    let (corners, at) = (part.mesh().corners(t), part.corner_parameters(t));
    let at = at.map(|at| [at[a].toward(&at[c], WITHIN), at[b].toward(&at[c], WITHIN)]);
    Side { ends: [corners[a], corners[b]], at, normal: part.mesh().normal(t) }
}

/// The shares between which a side lies in a square of the plan.
fn clipped(side: &Side, centre: Point2, half: f64) -> Option<[f64; 2]> {
    let (a, way) = (side.ends[0], side.ends[1] - side.ends[0]);
    (0..2).try_fold([0.0f64, 1.0f64], |[from, to], c| {
        let [low, high] = [-half, half].map(|reach| centre[c] + reach - a[c]);
        let [from, to] = if way[c] == 0.0 {
            if low > 0.0 || high < 0.0 { [1.0, 0.0] } else { [from, to] }
        } else {
            let [enters, leaves] = [low / way[c], high / way[c]];
            [from.max(enters.min(leaves)), to.min(enters.max(leaves))]
        };
        (from <= to).then_some([from, to])
    })
}

/// The cells of a grid that a side runs through.
fn cells_along(side: &Side, grid: &Grid) -> Vec<usize> {
    let ends = side.ends.map(|end| (end.xy() - grid.origin) / grid.cell + Vector2::new(0.5, 0.5));
    let squares = squares_along(ends, [grid.nx, grid.ny].map(|n| n as f64)).into_iter();
    let cell = |[i, j]: [i64; 2]| Some((usize::try_from(i).ok()?, usize::try_from(j).ok()?));
    let within = squares.filter_map(cell).filter(|&(i, j)| i < grid.nx && j < grid.ny);
    within.map(|(i, j)| grid.index(i, j)).collect()
}

/// The squares of side 1 that a line runs through, by the whole numbers at their lower corners: all from 0 to
/// what is `most` along both, and some others.
fn squares_along([a, b]: [Vector2; 2], most: [f64; 2]) -> Vec<[i64; 2]> {
    let mut cuts = vec![0.0, 1.0];
    for (c, most) in most.into_iter().enumerate() {
        let (first, last) = (a[c].min(b[c]).ceil().max(0.0), a[c].max(b[c]).floor().min(most));
        let lines = (0..).map(|k| first + f64::from(k)).take_while(|line| *line <= last);
        cuts.extend(lines.map(|line| (line - a[c]) / (b[c] - a[c])).filter(|share| share.is_finite()));
    }
    cuts.sort_by(f64::total_cmp);
    let square = |w: &[f64]| {
        let middle = a + (b - a) * (0.5 * (w[0] + w[1]));
        [middle.x.floor() as i64, middle.y.floor() as i64]
    };
    let mut squares: Vec<[i64; 2]> = cuts.windows(2).map(square).collect();
    squares.dedup();
    squares
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flat_scene::gouge_of;
    use cutter::Cutter;

    #[test]
    fn lines_run_through_the_squares_that_they_cross() {
        let along = |a: [f64; 2], b: [f64; 2]| squares_along([a, b].map(Vector2::from), [4.0, 4.0]);
        assert_eq!(along([0.2, 0.1], [0.7, 0.9]), [[0, 0]]);
        assert_eq!(along([0.5, 0.25], [3.5, 1.5]), [[0, 0], [1, 0], [2, 0], [2, 1], [3, 1]]);
        assert_eq!(along([1.0, 0.5], [1.0, 3.5]), [[1, 0], [1, 1], [1, 2], [1, 3]]);
        assert_eq!(along([0.3, 0.3], [0.3, 0.3]), [[0, 0]]);
        // Every place of a line within the range lies in one of them.
        let (a, b, most) = (Vector2::new(-3.31, 7.92), Vector2::new(11.4, -2.77), [9.0, 6.0]);
        let squares = squares_along([a, b], most);
        for k in 0..=10_000 {
            let place = a + (b - a) * (f64::from(k) * 1e-4);
            let is_within = (0..2).all(|c| (0.0..most[c]).contains(&place[c]));
            let square = [place.x.floor() as i64, place.y.floor() as i64];
            assert!(!is_within || squares.contains(&square), "{place}");
        }
    }

    /// A roof of 60 and 10 degrees: the crest is cut where the centres of no cell lie.
    #[test]
    fn a_crest_is_cut_as_deep_on_cells_of_every_size() {
        let (steep, flat) = (60f64.to_radians(), 10f64.to_radians());
        let corners =
            |y: f64| [[-1.0, y, -steep.tan()], [0.0, y, 0.0], [3.0, y, -3.0 * flat.tan()]].map(Point3::from);
        let points = [corners(0.0), corners(2.4)].concat();
        let triangles = vec![[0, 1, 3], [1, 4, 3], [1, 2, 4], [2, 5, 4]];
        let roof = Part::from_mesh(TriangleMesh::new(points, triangles).unwrap().0);
        let cutter = Cutter::ball(6.0).unwrap();
        // Over the crest by chords that the crest stands above.
        let (radius, deep) = (3.0, 0.006);
        let over = |x: f64| Point3::new(x, 1.2, (radius * radius - x * x).sqrt() - radius - deep);
        let pass = [0.5, 0.25, 0.0, -0.25, -0.5].map(over).to_vec();
        // Along the normal of the flatter face, from the crest in.
        let truth = {
            let direction = Vector3::new(flat.sin(), 0.0, flat.cos());
            let centre = Vector3::new(0.0, 0.0, radius - deep);
            let along = centre.dot(&direction);
            (along * along - centre.norm_squared() + radius * radius).sqrt() - along
        };
        let mut all = Vec::new();
        for cell in [0.03, 0.07, 0.1, 0.13, 0.31] {
            let found = gouge_of(&roof, &cutter, std::slice::from_ref(&pass), cell);
            let most = found.max_depth_mm + found.error_bound_mm;
            assert!(found.max_depth_mm >= truth - 1e-6, "{cell}: {} {truth}", found.max_depth_mm);
            all.push([found.max_depth_mm, most]);
        }
        // Every one of them is within the bounds of all others.
        let deepest = all.iter().map(|[found, _]| *found).fold(0.0, f64::max);
        assert!(all.iter().all(|[_, most]| deepest <= *most), "{all:?}");
    }

    /// Faces that meet at a fifteenth of a degree, and a flat end that runs level over their crest: the cut
    /// is deepest there, and falls off evenly on both sides.
    #[test]
    fn a_flat_crest_is_cut_as_deep_on_cells_of_every_size() {
        let (slope, deep) = (6e-4, 4e-4);
        let corners =
            |y: f64| [[-5.0, y, -5.0 * slope], [0.0, y, 0.0], [5.0, y, -5.0 * slope]].map(Point3::from);
        let points = [corners(0.0), corners(2.4)].concat();
        let triangles = vec![[0, 1, 3], [1, 4, 3], [1, 2, 4], [2, 5, 4]];
        let roof = Part::from_mesh(TriangleMesh::new(points, triangles).unwrap().0);
        let pass = [-9.0, 9.0].map(|x| Point3::new(x, 1.2, -deep)).to_vec();
        for cell in [0.03, 0.07, 0.13, 0.31, 0.5] {
            let found = gouge_of(&roof, &Cutter::flat(6.0).unwrap(), std::slice::from_ref(&pass), cell);
            let off = (found.max_depth_mm - deep).abs();
            assert!(off <= found.error_bound_mm, "{cell}: {off} {}", found.error_bound_mm);
        }
    }
}
