//! What a triangle of the part covers of a square of the plan.
//!
//! Where a patch ends, its triangles end at chords of its border. What they stand for there ends at the
//! border itself: at a chord of the stretch within the square, moved out by what the border leaves that chord
//! by, which falls with the square's size.

use geometry::{Point2, Point3, Vector2};
use part::{Part, PatchPoint};

/// Corners of a triangle clipped by a square and by the lines before some walls.
pub(super) const MOST_CORNERS: usize = 12;

/// A convex polygon of the plan.
pub(super) struct Outline {
    pub corners: [Point2; MOST_CORNERS],
    /// How many they are.
    pub len: usize,
    /// Whether a patch may end in it.
    pub is_at_end: bool,
}

/// A border may leave its chord by so many times as much as at the places looked at.
const BETWEEN_PLACES: f64 = 1.25;

/// Polygons that cover what triangle `t` stands for within a square.
pub(super) fn outlines(part: &Part, t: usize, centre: Point2, half: f64) -> [Option<Outline>; 3] {
    let plan = part.mesh().corners(t).map(|corner| corner.xy());
    let all = || [clipped(&plan, centre, half), None, None];
    let Some(at) = part.corner_parameters(t) else { return all() };
    let sides = [0, 1, 2].map(|k| [k, (k + 1) % 3]);
    let is_end = |[a, b]: [usize; 2]| part.is_at_patch_end(at[a].toward(&at[b], 0.5));
    match sides.map(is_end) {
        [false, false, false] => all(),
        ends if ends.iter().filter(|is_end| **is_end).count() == 1 => {
            let k = ends.iter().position(|is_end| *is_end).unwrap_or(0);
            let [a, b] = sides[k];
            let rim = Rim { part, apex: plan[(b + 1) % 3], chord: [plan[a], plan[b]], at: [at[a], at[b]] };
            [rim.outline(centre, half), None, None]
        }
        ends => {
            let apex = middle(&plan);
            [0, 1, 2].map(|k| {
                let [a, b] = sides[k];
                let rim = Rim { part, apex, chord: [plan[a], plan[b]], at: [at[a], at[b]] };
                if ends[k] {
                    rim.outline(centre, half)
                } else {
                    clipped(&[apex, plan[a], plan[b]], centre, half)
                }
            })
        }
    }
}

/// What lies between a corner of a triangle and the border of a patch opposite to it.
struct Rim<'a> {
    part: &'a Part,
    apex: Point2,
    chord: [Point2; 2],
    /// Of the chord's ends.
    at: [PatchPoint; 2],
}

impl Rim<'_> {
    fn outline(&self, centre: Point2, half: f64) -> Option<Outline> {
        let all = clipped(&self.wedge(self.chord, self.part.mesh_deviation()), centre, half)?;
        let stretch = self.stretch(&all.corners[..all.len])?;
        let [from, to] = stretch.map(|share| self.border(share));
        let out = outward(&self.apex, [from, to]);
        let off = |share: f64| out.dot(&(self.border(stretch[0] + share * (stretch[1] - stretch[0])) - from));
        let most = [0.25, 0.5, 0.75].map(off).into_iter().fold(0.0, f64::max);
        let its = clipped(&self.wedge([from, to], BETWEEN_PLACES * most), centre, half)?;
        Some(Outline { is_at_end: true, ..its })
    }

    /// The place of the border at a share of the chord's parameters.
    fn border(&self, share: f64) -> Point2 {
        self.part.point_and_normal(self.at[0].toward(&self.at[1], share)).0.xy()
    }

    /// The triangle from the apex to a chord that is moved away from it.
    fn wedge(&self, [a, b]: [Point2; 2], by: f64) -> [Point2; 3] {
        let height = outward(&self.apex, [a, b]).dot(&(a - self.apex));
        let scale = if height > 0.0 { 1.0 + by / height } else { 1.0 };
        [self.apex, self.apex + (a - self.apex) * scale, self.apex + (b - self.apex) * scale]
    }

    /// The shares of the border that lie behind some places, as seen from the apex; `None` where the triangle
    /// stands upright.
    fn stretch(&self, places: &[Point2]) -> Option<[f64; 2]> {
        let [a, b] = self.chord.map(|end| end - self.apex);
        let length = (b - a).norm();
        let doubled_area = a.perp(&b);
        if length <= 0.0 || doubled_area == 0.0 {
            return None;
        }
        let share = |place: &Point2| {
            let q = place - self.apex;
            let [of_a, of_b] = [q.perp(&b) / doubled_area, a.perp(&q) / doubled_area];
            (of_a + of_b > 1e-9).then(|| of_b / (of_a + of_b))
        };
        let [low, high] = places.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], place| {
            share(place).map_or([0.0, 1.0], |share| [low.min(share), high.max(share)])
        });
        // Parameters run along the border nearly as along the chord.
        let margin = self.part.mesh_deviation() / length;
        Some([(low - margin).clamp(0.0, 1.0), (high + margin).clamp(0.0, 1.0)])
    }
}

/// The unit vector square to a chord, away from a place; zero where the chord has no length.
fn outward(from: &Point2, [a, b]: [Point2; 2]) -> Vector2 {
    let along = b - a;
    let across = Vector2::new(along.y, -along.x);
    let across = if across.dot(&(a - from)) < 0.0 { -across } else { across };
    across.try_normalize(0.0).unwrap_or_default()
}

/// Whether a triangle reaches into a square of the plan: no side of either has all of the other beyond it.
/// Boxes of long triangles askew hold many squares that these do not meet.
pub(super) fn overlaps(triangle: &[Point3; 3], centre: Point2, half: f64) -> bool {
    let [a, b, c] = triangle.map(|p| p.xy() - centre);
    let within = |x: [f64; 3]| x.iter().any(|x| *x <= half) && x.iter().any(|x| *x >= -half);
    let inside = |p: Vector2, q: Vector2, third: Vector2| {
        let across = Vector2::new(p.y - q.y, q.x - p.x);
        let sense = across.dot(&(third - p)).signum();
        sense * across.dot(&-p) + half * (across.x.abs() + across.y.abs()) >= 0.0
    };
    within([a.x, b.x, c.x])
        && within([a.y, b.y, c.y])
        && inside(a, b, c)
        && inside(b, c, a)
        && inside(c, a, b)
}

/// The part of a triangle within a square of the plan; `None` where there is none.
fn clipped(triangle: &[Point2; 3], centre: Point2, half: f64) -> Option<Outline> {
    let mut corners = [Point2::origin(); MOST_CORNERS];
    corners[..3].copy_from_slice(triangle);
    let mut len = 3;
    for (axis, sign) in [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0)] {
        cut_off(&mut corners, &mut len, |p| sign * (p[axis] - centre[axis]) - half);
        if len == 0 {
            return None;
        }
    }
    has_area(&corners[..len]).then_some(Outline { corners, len, is_at_end: false })
}

/// Leaves the part of a convex polygon that is not `beyond` a line (Sutherland and Hodgman 1974).
pub(super) fn cut_off(
    corners: &mut [Point2; MOST_CORNERS],
    len: &mut usize,
    beyond: impl Fn(&Point2) -> f64,
) {
    let (before, n) = (*corners, *len);
    *len = 0;
    for k in 0..n {
        let (p, q) = (before[k], before[(k + 1) % n]);
        let (bp, bq) = (beyond(&p), beyond(&q));
        if bp <= 0.0 {
            (corners[*len], *len) = (p, *len + 1);
        }
        if (bp < 0.0 && bq > 0.0) || (bp > 0.0 && bq < 0.0) {
            (corners[*len], *len) = (p + (q - p) * (bp / (bp - bq)), *len + 1);
        }
    }
}

pub(super) fn has_area(corners: &[Point2]) -> bool {
    let area = |k: usize| {
        let (a, b) = (corners[k] - corners[0], corners[(k + 1) % corners.len()] - corners[0]);
        a.x * b.y - a.y * b.x
    };
    (0..corners.len()).map(area).sum::<f64>().abs() > 0.0
}

pub(super) fn middle(corners: &[Point2]) -> Point2 {
    corners.iter().fold(Point2::origin(), |sum, c| sum + c.coords / corners.len() as f64)
}
