//! The deepest cut along the borders of what an upright cutter can face: a cutter that stands beside the part
//! may cut its border between the centres of all cells. mm.
//!
//! Along a straight piece of a border, of a triangle with the normal n, the depth of one move along n (or any
//! one direction) is a concave function of the place: what the move sweeps is convex. So three places bound
//! it between them, and halving finds its greatest.
//!
//! The part ends at a border as at a vertical wall. Where the way down along the normal leads out through it,
//! the depth is no more than that along the wall: what lies beyond belongs to no part. The lesser of two
//! concave depths is concave, too.
//!
//! Limits: where the side of the cutter reaches over the border by less than the gouge tolerance, what is
//! left of the part is nearer than that, however long the way along the normal is beside a steep flank. Such
//! a place counts as deep as that is near: as far as the way inward along the design is to where it is left.

mod along_piece;

use std::collections::HashMap;

use super::cut_surface::CutSurface;
use super::facing::LEAST_FACING;
use super::figures::{GougeFigures, NUMERICAL_FLOOR};
use super::inspection::{Inspection, Sample};
use cutter::Cutter;
use geometry::{Point2, Point3, Vector3, distance_to_segment, share_on};
use motion::Cutters;
use part::{Part, PatchPoint};
use work::monitor::{self, Cancelled, Monitor};

/// Pieces of borders are no longer than this many radii of the narrowest cutter.
const LONGEST_PIECE: f64 = 2.0;

/// Halvings by which the way to what is left is found: to a ten-millionth of the farthest.
const INSIDE_HALVINGS: usize = 24;

/// Steps of Newton's method for the meeting of a normal with what a move sweeps; it converges from one side.
const STEPS: usize = 24;

/// A piece of the border that is straight, or nearly: on a patch the piece of a curve, its ends on it.
pub(super) struct BorderPiece {
    pub ends: [Point3; 2],
    /// Parameters of the ends, on a patch.
    at: Option<[PatchPoint; 2]>,
    /// How far it leaves its chord at most, mm, as its middle tells.
    pub bend: f64,
    /// Of the triangle that it bounds.
    normal: Vector3,
    /// Unit vector along the triangle, square to the piece.
    pub inward: Vector3,
}

/// The deepest cut of a move along a border.
#[derive(Debug, Clone, Copy, PartialEq)]
struct BorderCut {
    depth: f64,
    /// No place is deeper.
    possible: f64,
    at: Point3,
    by: u32,
}

/// The design at a share of the side of a triangle, whose ends have parameters on a patch, and the normal
/// there.
pub(super) fn design_along(
    part: &Part,
    ends: &[Point3; 2],
    at: Option<[PatchPoint; 2]>,
    normal: Vector3,
    share: f64,
) -> (Point3, Vector3) {
    match at {
        Some([a, b]) => part.point_and_normal(a.toward(&b, share)),
        None => (ends[0] + (ends[1] - ends[0]) * share, normal),
    }
}

impl BorderPiece {
    /// The design at a share of the piece, and its normal there.
    pub fn design(&self, part: &Part, share: f64) -> (Point3, Vector3) {
        design_along(part, &self.ends, self.at, self.normal, share)
    }

    /// Whether a way down against the normal of a place leads out over the border.
    pub fn leads_out(&self, normal: &Vector3) -> bool {
        let along = self.ends[1] - self.ends[0];
        let across = Vector3::new(-along.y, along.x, 0.0);
        normal.dot(&across) * across.dot(&self.inward) > 0.0
    }

    /// As far from the end of the piece, where another border may begin, as from the border: as a share of
    /// it.
    pub fn end(&self, far: f64) -> f64 {
        (far / (self.ends[1] - self.ends[0]).norm()).min(0.5)
    }

    /// The way from a share of the piece to a place so far within all borders, mm.
    pub fn inward_by(&self, share: f64, far: f64) -> Vector3 {
        let end = self.end(far);
        (self.ends[1] - self.ends[0]) * (share.clamp(end, 1.0 - end) - share) + self.inward * far
    }

    /// The piece is no nearer to a stretch of the plan, mm.
    fn least_distance(&self, from: Point2, to: Point2) -> f64 {
        let [a, b] = self.ends.map(|end| end.xy());
        let (middle, way) = (a + (b - a) * 0.5, to - from);
        let nearest = from + way * share_on(&middle, &from, &to);
        ((nearest - middle).norm() - 0.5 * (b - a).norm() - self.bend).max(0.0)
    }
}

/// The borders of the triangles that face up.
pub(super) fn pieces(part: &Part, cutters: &Cutters) -> Vec<BorderPiece> {
    let mesh = part.mesh();
    let longest = LONGEST_PIECE * cutters.least(Cutter::radius);
    let faces = |t: usize| mesh.normal(t).z > LEAST_FACING;
    let of_triangle = |t: usize| {
        let (normal, corners) = (mesh.normal(t), mesh.corners(t));
        let parameters = part.corner_parameters(t);
        let border = (0..3).filter(|&k| mesh.neighbour(t, k).is_none_or(|other| !faces(other)));
        let pieces = border.flat_map(|k| {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            let whole = BorderPiece {
                ends: [a, b],
                at: parameters.map(|at| [at[k], at[(k + 1) % 3]]),
                bend: 0.0,
                normal,
                inward: normal.cross(&(b - a)).try_normalize(0.0).unwrap_or_default(),
            };
            let parts = ((b - a).norm() / longest).ceil().max(1.0) as usize;
            let piece = |k: usize| {
                let [from, to] = [k, k + 1].map(|k| k as f64 / parts as f64);
                let ends = [from, to].map(|share| whole.design(part, share).0);
                let at = whole.at.map(|[a, b]| [from, to].map(|share| a.toward(&b, share)));
                let straight = BorderPiece { ends, at, ..whole };
                let middle = ends[0] + (ends[1] - ends[0]) * 0.5;
                let off = (straight.design(part, 0.5).0 - middle).norm();
                let bend = if at.is_some() { off.max(part.mesh_deviation()) } else { 0.0 };
                BorderPiece { bend, ..straight }
            };
            let has_length = whole.inward.norm_squared() > 0.0;
            (0..if has_length { parts } else { 0 }).map(piece).collect::<Vec<_>>()
        });
        pieces.collect::<Vec<_>>()
    };
    (0..mesh.triangles().len()).filter(|&t| faces(t)).flat_map(of_triangle).collect()
}

/// Which squares of the plan pieces come within a radius of.
struct Nearby {
    side: f64,
    of: HashMap<[i64; 2], Vec<u32>>,
}

impl Nearby {
    fn new(pieces: &[BorderPiece], radius: f64) -> Self {
        let (side, mut of) = (radius, HashMap::<[i64; 2], Vec<u32>>::new());
        for (k, piece) in pieces.iter().enumerate() {
            let [x, y] = [0, 1].map(|c| {
                let [a, b] = piece.ends.map(|end| end[c]);
                // A radius to both sides, and what lies between the places of a move that are asked for.
                let [low, high] = [a.min(b) - 2.0 * radius, a.max(b) + 2.0 * radius];
                (low / side).floor() as i64..=(high / side).floor() as i64
            });
            for i in x {
                for j in y.clone() {
                    of.entry([i, j]).or_default().push(k as u32);
                }
            }
        }
        Self { side, of }
    }

    /// The pieces near a stretch of the plan, each once.
    fn along(&self, from: Point2, to: Point2) -> Vec<u32> {
        let steps = ((to - from).norm() / self.side).ceil().max(1.0) as usize;
        let square = |k: usize| {
            let q = from + (to - from) * (k as f64 / steps as f64);
            [q.x, q.y].map(|x| (x / self.side).floor() as i64)
        };
        let mut found: Vec<u32> =
            (0..=steps).filter_map(|k| self.of.get(&square(k))).flatten().copied().collect();
        found.sort_unstable();
        found.dedup();
        found
    }
}

/// How deep a move cuts at a place along a direction, negative above it; infinite where it goes along the
/// cutter's flank, and `None` where the move does not pass.
fn depth(surface: &CutSurface<'_>, by: u32, place: &Point3, normal: &Vector3) -> Option<f64> {
    let mut t = 0.0;
    for _ in 0..STEPS {
        let q = place - normal * t;
        let (z, m) = surface.envelope.height_and_normal(by, q.x, q.y)?;
        let gap = q.z - z;
        let facing = m.dot(normal);
        if gap.abs() < 0.1 * NUMERICAL_FLOOR {
            break;
        }
        if facing <= 0.0 {
            return Some(if gap > 0.0 { f64::INFINITY } else { t });
        }
        t += gap * m.z / facing;
    }
    Some(t)
}

/// The share of a piece at which it comes nearest to a stretch of the plan: by turns, which converges on
/// straight lines.
fn nearest_share(piece: &BorderPiece, from: Point2, to: Point2) -> f64 {
    const TURNS: usize = 20;
    let [a, b] = piece.ends.map(|end| end.xy());
    let mut s = 0.5;
    for _ in 0..TURNS {
        let there = from + (to - from) * share_on(&(a + (b - a) * s), &from, &to);
        s = share_on(&there, &a, &b);
    }
    s
}

impl Inspection<'_> {
    /// Takes into the figures what moves cut along the borders.
    ///
    /// # Errors
    /// [`Cancelled`] when the monitor says so.
    pub fn cut_borders(
        &self,
        samples: &[Sample],
        gouge: &mut GougeFigures,
        monitor: &dyn Monitor,
    ) -> Result<(), Cancelled> {
        let Some(borders) = self.borders else { return Ok(()) };
        let pieces = &borders.pieces;
        let nearby = Nearby::new(pieces, self.cutters.greatest_radius());
        let path = self.surface.path;
        let known = gouge.max_depth_mm;
        let cuts = work::parallel::try_map(path.len(), |k| {
            monitor::check(monitor)?;
            let (from, to) = (path.start_of(k), path.moves[k].to.tip);
            let near = nearby.along(from.xy(), to.xy());
            let (lowest, cutter) = (from.z.min(to.z), self.cutters.of_move(k as u32));
            let reached = near.iter().map(|&piece| &pieces[piece as usize]).filter(|piece| {
                let least = piece.least_distance(from.xy(), to.xy());
                let height = cutter.height(least);
                height
                    .is_some_and(|height| piece.ends[0].z.max(piece.ends[1].z) + piece.bend > lowest + height)
            });
            let cuts = reached.filter_map(|piece| {
                let share = nearest_share(piece, from.xy(), to.xy());
                self.deepest_on(piece, k as u32, share, known)
            });
            Ok(cuts.reduce(deeper))
        })?;
        let Some(cut) = cuts.into_iter().flatten().reduce(deeper) else { return Ok(()) };
        let most = (gouge.max_depth_mm + gouge.error_bound_mm).max(cut.possible + NUMERICAL_FLOOR);
        if cut.depth > gouge.max_depth_mm {
            gouge.max_depth_mm = cut.depth;
            if cut.depth > self.limits.gouge {
                self.list_gouge(samples, gouge, (cut.depth, cut.at, cut.by));
            }
        }
        gouge.error_bound_mm = most - gouge.max_depth_mm;
        Ok(())
    }

    /// Whether a move cuts nothing at a place.
    pub fn is_left(&self, by: u32, place: &Point3) -> bool {
        self.surface.envelope.height(by, place.x, place.y).is_none_or(|cut| place.z <= cut)
    }

    /// Whether a move cuts nothing between two places with another half way, on a line that bends by so much,
    /// mm: how deep it cuts is a concave function there, and so is how far it comes over the line.
    pub fn stays_left(&self, by: u32, places: [Point3; 3], bend: f64) -> bool {
        let (from, to) =
            (self.surface.path.start_of(by as usize), self.surface.path.moves[by as usize].to.tip);
        let radius = self.cutters.of_move(by).radius();
        let over = places.map(|p| radius - distance_to_segment(&p.xy(), &from.xy(), &to.xy()));
        let deep = places.map(|p| p.z - self.surface.height(by, p.x, p.y));
        let is_left = |values: [f64; 3]| {
            values.iter().all(|value| value.is_finite()) && concave_most(values) + bend <= 0.0
        };
        is_left(over) || is_left(deep)
    }

    /// How far what a move leaves of the design is from a place beside a share of a piece, mm, where that is
    /// near: it leaves what lies so far within all borders. The least of the ways into the part from all borders
    /// or one of them, and away from the move.
    pub fn near_left(&self, piece: &BorderPiece, by: u32, share: f64, place: &Point3) -> Option<f64> {
        let far = self.limits.gouge;
        let (foot, normal) = piece.design(self.part, share);
        let is_left = |to: &dyn Fn(f64) -> Point3, far: f64| self.is_left(by, &to(far));
        let within = |way: f64| foot + piece.inward_by(share, way);
        if !is_left(&within, far) {
            return None;
        }
        let [from, to] =
            [self.surface.path.start_of(by as usize), self.surface.path.moves[by as usize].to.tip];
        let nearest = from.xy() + (to - from).xy() * share_on(&place.xy(), &from.xy(), &to.xy());
        let out = place.xy() - nearest;
        let out = Vector3::new(out.x, out.y, -normal.xy().dot(&out) / normal.z);
        let out = out.try_normalize(0.0).unwrap_or_default();
        let ways: [&dyn Fn(f64) -> Point3; 3] = [
            &|way| foot + piece.inward * way,
            // Along the border, where another one begins.
            &|way| within(way) - piece.inward * way,
            &|way| place + out * way,
        ];
        let lengths = ways.iter().filter(|to| is_left(to, far)).filter_map(|to| {
            let left = to(least_way(far, |way| is_left(to, way)));
            let seen = left + piece.inward * NUMERICAL_FLOOR;
            let top = self.part.highest_at(seen.x, seen.y)?;
            let length = (left - place).norm();
            ((top.point.z - seen.z).abs() <= NUMERICAL_FLOOR + piece.bend + 0.1 * length).then_some(length)
        });
        let all = (within(least_way(far, |way| is_left(&within, way))) - place).norm();
        Some(lengths.fold(all, f64::min))
    }
}

/// The greatest value of a concave function between its values at both ends and in the middle.
fn concave_most([a, m, b]: [f64; 3]) -> f64 {
    m.max(a).max(b).max(2.0 * m - a.min(b))
}

/// The least way up to `far`, nearly, from which on a place is left, as it is at `far`.
pub(super) fn least_way(far: f64, is_left: impl Fn(f64) -> bool) -> f64 {
    let (mut cut, mut left) = (0.0, far);
    for _ in 0..INSIDE_HALVINGS {
        let middle = 0.5 * (cut + left);
        *(if is_left(middle) { &mut left } else { &mut cut }) = middle;
    }
    left
}

/// The deeper of two cuts, the first of equals, with what both may be at most.
fn deeper(a: BorderCut, b: BorderCut) -> BorderCut {
    let possible = a.possible.max(b.possible);
    BorderCut { possible, ..if b.depth > a.depth { b } else { a } }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flat_scene::{LIMITS, gouge_of, plane};
    use geometry::{AnalyticShape, AnalyticSurface, NurbsSurface, TriangleMesh};
    use part::{Part, Patch};

    fn gouge(cutter: &Cutter, plunge: Point3, cell: f64) -> GougeFigures {
        let lines = (0..13).map(|k| 0.5 * f64::from(k));
        let mut passes: Vec<Vec<Point3>> =
            lines.map(|y| [-5.0, 13.0].map(|x| Point3::new(x, y, 0.0)).to_vec()).collect();
        passes.push(vec![Point3::new(plunge.x, plunge.y, 10.0), plunge]);
        gouge_of(&plane([8.0, 6.0]), cutter, &passes, cell)
    }

    /// A ball plunges beside the part: the border is cut by what its sphere reaches over it, on cells of
    /// every size.
    #[test]
    fn what_a_cutter_beside_the_part_cuts_of_its_border_is_found() {
        let ball = Cutter::ball(6.0).unwrap();
        for (x, y, z, truth) in [
            (-2.0, 3.03, -0.78, 5.0f64.sqrt() - 2.22),
            (-1.2, -1.2, -0.55, (9.0f64 - 2.88).sqrt() - 2.45),
            (-1.0, 3.0, -0.2, 8.0f64.sqrt() - 2.8),
            (-1.0, 3.05, -0.19, 8.0f64.sqrt() - 2.81),
            (-0.2, 3.05, -0.01, (9.0f64 - 0.04).sqrt() - 2.99),
        ] {
            // Coarse cells take long: one of them.
            let cells = if x == -2.0 { vec![0.1, 0.5, 5.0] } else { vec![0.1] };
            for cell in cells {
                let found = gouge(&ball, Point3::new(x, y, z), cell);
                let off = (found.max_depth_mm - truth).abs();
                assert!(off <= found.error_bound_mm && off < 1e-6, "{x} {y} {cell}: {truth} {found:?}");
                if truth > LIMITS.gouge {
                    assert_eq!(found.regions[0].move_index as usize, 27, "{found:?}");
                }
            }
        }
    }

    /// A ball beside a border that the part rises to: the normal leads out over the border, nearly along the
    /// ball's flank, and would find a depth many times that of the cut. It is no more than that along the
    /// border's wall; and where the ball reaches over the border by less than the tolerance, no more than the
    /// way along the design to where it is left.
    #[test]
    fn depths_do_not_lead_out_over_a_border() {
        let rising = TriangleMesh::new(
            [[0.0, 0.0, 3.6], [8.0, 0.0, 0.0], [0.0, 6.0, 3.6], [8.0, 6.0, 0.0]].map(Point3::from).to_vec(),
            vec![[0, 1, 2], [1, 3, 2]],
        );
        let part = Part::from_mesh(rising.unwrap().0);
        for (beside, deep) in [(2.72, 0.0004), (2.6, 0.02)] {
            let tip = 3.6 - (3.0 - (9.0f64 - beside * beside).sqrt()) - deep;
            let plunge = vec![Point3::new(-beside, 3.0, 10.0), Point3::new(-beside, 3.0, tip)];
            let is_cut = |x: f64| tip + 3.0 - (9.0 - (beside + x).powi(2)).sqrt() < 3.6 - 0.45 * x;
            let way =
                (0..100_000).map(|k| 1e-7 * f64::from(k)).find(|x| !is_cut(*x)).unwrap() * 0.45f64.hypot(1.0);
            let truth = if way < LIMITS.gouge { way.min(deep) } else { deep };
            let found = gouge_of(&part, &Cutter::ball(6.0).unwrap(), &[plunge], 0.1);
            let off = (found.max_depth_mm - truth).abs();
            assert!(off <= found.error_bound_mm + 1e-6 && off < 1e-5, "{beside} {truth}: {found:?}");
        }
        // A pass down the slope cuts evenly deep, at the border as well: along z that would be more.
        let (deep, normal) = (0.02, Vector3::new(3.6, 0.0, 8.0).normalize());
        let tip = |x: f64| {
            let centre = Point3::new(x, 3.0, 3.6 - 0.45 * x) + normal * (3.0 - deep);
            Point3::new(centre.x, centre.y, centre.z - 3.0)
        };
        let found = gouge_of(&part, &Cutter::ball(6.0).unwrap(), &[vec![tip(-6.0), tip(14.0)]], 0.1);
        assert!((found.max_depth_mm - deep).abs() < 1e-6, "{found:?}");
    }

    /// A ball that plunges beyond a corner of a bowl: it is cut deepest in the corner itself, from which the
    /// ground falls both ways.
    #[test]
    fn what_is_cut_of_the_corner_of_a_bowl_is_found() {
        let shape = AnalyticShape::Sphere { height: 0.0, radius: 20.616, concave: true };
        let bowl = AnalyticSurface::new(shape, [[-5.602, -2.495], [0.118, 6.326]]).unwrap();
        let bowl = vec![Patch::Analytic(bowl)];
        let tolerance = part::default_tessellation_tolerance(&bowl);
        let part = Part::from_patches(bowl, tolerance).unwrap();
        let (radius, centre) = (2.0, Point3::new(0.0, 0.0, 20.616));
        let corner = part.highest_at(-2.495, 0.118).unwrap().point;
        let normal = (centre - corner).normalize();
        let ball = corner + normal * (radius - 0.02) + Vector3::new(0.1, -0.1, 0.0);
        let along = (ball - corner).dot(&normal);
        let truth = (along * along - (ball - corner).norm_squared() + radius * radius).sqrt() - along;
        let tip = ball - Vector3::z() * radius;
        let plunge = vec![tip + Vector3::z() * 9.0, tip];
        for cell in [0.05, 0.2, 0.4] {
            let cutter = Cutter::ball(2.0 * radius).unwrap();
            let found = gouge_of(&part, &cutter, std::slice::from_ref(&plunge), cell);
            let off = (found.max_depth_mm - truth).abs();
            assert!(off <= found.error_bound_mm && off < 1e-4, "{cell}: {truth} {found:?}");
        }
    }

    /// A level patch whose border is an arc in the plan. The triangles end at its chords; a ball that plunges
    /// beyond cuts the arc.
    #[test]
    fn the_border_of_a_patch_is_its_curve() {
        let rows = [[[0.0, 0.0], [4.0, 0.0], [8.0, 0.0]], [[0.0, 4.0], [2.6, 8.6], [8.0, 4.4]]];
        let rows = rows.map(|row| row.map(|[x, y]| Point3::new(x, y, 0.0)));
        let net: Vec<Vec<Point3>> = (0..3).map(|i| vec![rows[0][i], rows[1][i]]).collect();
        let [in_u, in_v] = [vec![0.0, 0.0, 0.0, 1.0, 1.0, 1.0], vec![0.0, 0.0, 1.0, 1.0]];
        let surface = NurbsSurface::new(2, 1, in_u, in_v, &net, None).unwrap();
        let ball = Cutter::ball(6.0).unwrap();
        let tip = Point3::new(3.9, 7.7, -0.4);
        let nearest = (0..=1_000_000)
            .map(|k| (surface.point(1e-6 * f64::from(k), 1.0) - tip).xy().norm())
            .fold(f64::INFINITY, f64::min);
        let truth = (9.0 - nearest * nearest).sqrt() - 3.0 - tip.z;
        for tolerance in [1e-4, 0.003, 0.03] {
            let part = Part::from_patches(vec![Patch::Nurbs(surface.clone())], tolerance).unwrap();
            let found = gouge_of(&part, &ball, &[vec![Point3::new(tip.x, tip.y, 10.0), tip]], 0.1);
            let off = (found.max_depth_mm - truth).abs();
            assert!(off <= found.error_bound_mm && off < 1e-6, "{tolerance}: {truth} {found:?}");
        }
    }

    /// The side of a flat end mill reaches over the border by less than the tolerance: as deep as it is over,
    /// for what is left is as near, and no gouge as deep as it stands. By more it is one.
    #[test]
    fn the_side_of_a_cutter_is_no_gouge_as_far_as_the_tolerance_lets_it() {
        let flat = Cutter::flat(6.0).unwrap();
        let deepest = |x: f64, y: f64, z: f64| gouge(&flat, Point3::new(x, y, z), 0.1).max_depth_mm;
        for over in [0.0, 1e-4, 0.00177, 0.003, 0.0049] {
            let found = deepest(over - 3.0, 3.0, -2.0);
            assert!((found - over).abs() < 2e-6, "{over} {found}");
        }
        assert!((deepest(-2.98, 3.0, -2.0) - 2.0).abs() < 1e-6);
        // At a corner it comes over the part beside one of the borders only.
        let corner = deepest(-2.99975, 0.0027, -0.3);
        assert!((corner - 0.00025).abs() < 2e-6, "{corner}");
        // A corner from all sides: the rim of the cutter is the nearest place that is left.
        for degrees in [181.0, 200.0, 225.0, 260.0, 269.0f64] {
            for over in [0.0005, 0.0021, 0.003] {
                let (sin, cos) = degrees.to_radians().sin_cos();
                let found = deepest((3.0 - over) * cos, (3.0 - over) * sin, -0.3);
                assert!((found - over).abs() < 2e-6, "{degrees} {over} {found}");
            }
        }
    }

    /// A ball comes half a micrometre too near to the corner of a slope, its flank along the normal: what is
    /// left is as near. Forty times nearer it is a gouge.
    #[test]
    fn a_steep_flank_at_a_corner_is_as_deep_as_what_is_left_is_near() {
        let slope = TriangleMesh::new(
            [[0.0, 0.0, 0.0], [8.0, 0.0, 3.76], [0.0, 6.0, 0.0], [8.0, 6.0, 3.76]].map(Point3::from).to_vec(),
            vec![[0, 1, 2], [1, 3, 2]],
        );
        let part = Part::from_mesh(slope.unwrap().0);
        let normal = Vector3::new(-3.76, 0.0, 8.0).normalize();
        let aside = Vector3::new(-0.88, 0.2, -0.4243).normalize();
        assert!((normal.dot(&aside) + 0.01).abs() < 1e-3);
        let deepest = |near: f64| {
            let centre = Point3::new(8.0, 0.0, 3.76) - aside * (3.0 - near);
            let tip = centre - Vector3::z() * 3.0;
            let plunge = vec![Point3::new(tip.x, tip.y, 10.0), tip];
            gouge_of(&part, &Cutter::ball(6.0).unwrap(), &[plunge], 0.1).max_depth_mm
        };
        assert!(deepest(0.0005) < LIMITS.gouge);
        assert!(deepest(0.02) > 2.0 * LIMITS.gouge);
    }
}
