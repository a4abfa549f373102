//! Vertical facets in strips: short in the plan, as high as the facet.
//!
//! Enters: the facets of a mesh that stand along the tool axis. Leaves: strips between two straight edges,
//! with the design's surface in front of and behind each. mm.

use geometry::{Point2, Point3, Vector2, Vector3};
use part::Part;

use crate::facing::LEAST_FACING;

/// How far in front of a wall its floor is looked for, and behind it the top, mm. Less than rounding of mesh
/// files finds the wall itself; more misses what is narrower.
const ASIDE: f64 = 1e-3;

/// Strips shorter than this are of no account, mm.
pub(super) const SHORTEST: f64 = 1e-9;

/// Where along a strip its surroundings are looked at, over its length.
pub(super) const QUARTERS: [f64; 2] = [0.25, 0.75];

/// Floors and tops that rise by more than this from end to end are steps within the strip.
const STEEPEST: f64 = 5.0;

/// How far around the end of a facet the wall's turn is looked for, mm.
const AROUND: f64 = 1e-2;
const HALVINGS: usize = 32;

/// A turn is told to so much, rad. It counts as greater by that, so that of walls that are cut equally deep
/// the one that is cut along its normal comes first.
const TURN_ROUNDING: f64 = 1e-8;

/// Turns by less than this angle are none, rad.
const STRAIGHT: f64 = 1e-3;

/// A strip of a wall. `u` runs along it from 0 to its length, z up.
#[derive(Debug, Clone, Copy)]
pub(super) struct WallPiece {
    /// Where `u` is 0 and z is `level`, in the plan.
    pub start: Point2,
    /// Unit vector along it.
    pub along: Vector2,
    /// Unit vector away from the material.
    pub normal: Vector2,
    pub length: f64,
    /// How far the wall moves along `normal` on each mm upward.
    pub lean: f64,
    pub level: f64,
    /// Lower and upper edge at both ends.
    pub low: [f64; 2],
    pub high: [f64; 2],
    /// Highest floor in front, and the top behind, at both ends.
    pub floor: [f64; 2],
    pub top: [f64; 2],
    /// How far the facet goes on beyond both ends.
    pub beyond: [f64; 2],
    /// What lies on the other side of the medial axis to the wall beyond an end is that wall's: how fast the
    /// axis leaves this wall behind a convex edge, and before a concave one; infinite where there is none.
    pub behind: [f64; 2],
    pub before: [f64; 2],
}

fn between([a, b]: [f64; 2], share: f64) -> f64 {
    a + (b - a) * share
}

impl WallPiece {
    /// Share of the length at `u`, from 0 to 1.
    fn share(&self, u: f64) -> f64 {
        (u / self.length).clamp(0.0, 1.0)
    }

    pub fn low_at(&self, u: f64) -> f64 {
        self.between(self.low, u)
    }

    pub fn high_at(&self, u: f64) -> f64 {
        self.between(self.high, u)
    }

    pub fn floor_at(&self, u: f64) -> f64 {
        self.between(self.floor, u)
    }

    pub fn top_at(&self, u: f64) -> f64 {
        self.between(self.top, u)
    }

    /// The place at `u` and `z`.
    pub fn place(&self, u: f64, z: f64) -> Point3 {
        let q = self.start + self.along * u + self.normal * (self.lean * (z - self.level));
        Point3::new(q.x, q.y, z)
    }

    /// Where a place is: along the strip, and how far in front of it.
    pub fn seen_from(&self, p: &Point3) -> [f64; 2] {
        let way = p.xy() - self.start;
        [way.dot(&self.along), way.dot(&self.normal) - self.lean * (p.z - self.level)]
    }

    /// How deep a cut at `u` may be and belong to this wall, mm.
    pub fn own_depth(&self, u: f64) -> f64 {
        let [first, last] = self.own(u, &self.behind);
        first.min(last)
    }

    /// How far material at `u` may stand out and belong to this wall, by the turn at either end, mm.
    pub fn own_heights(&self, u: f64) -> [f64; 2] {
        self.own(u, &self.before)
    }

    fn own(&self, u: f64, slopes: &[f64; 2]) -> [f64; 2] {
        let from_ends = [u + self.beyond[0], self.length - u + self.beyond[1]];
        [0, 1].map(|k| if slopes[k].is_finite() { slopes[k] * from_ends[k].max(0.0) } else { f64::INFINITY })
    }

    /// The middle, with the wall's normal.
    pub fn middle(&self) -> (Point3, Vector3) {
        let u = 0.5 * self.length;
        let z = 0.5 * (self.low_at(u) + self.high_at(u));
        (self.place(u, z), Vector3::new(self.normal.x, self.normal.y, 0.0))
    }

    /// Its area, mm².
    pub fn area(&self) -> f64 {
        0.5 * self.length * (self.high[0] - self.low[0] + self.high[1] - self.low[1])
    }

    /// With floor and top, as the design has them a quarter of the length from both ends. `bottom` is the
    /// floor where nothing lies in front.
    fn with_surroundings(mut self, part: &Part, bottom: f64) -> Self {
        let quarters = QUARTERS.map(|share| share * self.length);
        let floor = quarters.map(|u| height_at(part, &self, u, ASIDE).unwrap_or(bottom));
        let top = |u: f64| height_at(part, &self, u, -ASIDE).unwrap_or(self.high_at(u)).max(self.high_at(u));
        let top = quarters.map(top);
        self.floor = self.extended(floor, f64::min);
        self.top = self.extended(top, f64::max);
        // No farther than a neighbour of the same length goes: what lies beyond that one turns more.
        let around = AROUND.min(self.beyond[0] + self.length + self.beyond[1]);
        let sides = [(0, -self.beyond[0], -1.0), (1, self.length + self.beyond[1], 1.0)];
        let level = self.middle().0.z;
        for (side, end, out) in sides {
            let rise = (self.top[1] - self.top[0]) / self.length;
            let top = self.top[side] + rise * (end - [0.0, self.length][side]);
            // A cut from the top leads out over a lower one beyond the end; tops that fall no more than a
            // slope does are the same one.
            let behind = level.max(top - STEEPEST * around);
            let is_solid = |turn: f64, aside: f64, level: f64| {
                let (sin, cos) = turn.sin_cos();
                let (u, aside) = (end + out * around * cos, aside * around * sin);
                height_at(part, &self, u, aside).is_some_and(|z| z >= level)
            };
            // Behind a convex edge material begins aside, before a concave one it ends there.
            let slopes =
                [medial(&|turn| !is_solid(turn, -1.0, behind)), medial(&|turn| is_solid(turn, 1.0, level))];
            [self.behind[side], self.before[side]] = slopes;
        }
        self
    }

    /// A value at `u` by those at both ends.
    pub fn between(&self, ends: [f64; 2], u: f64) -> f64 {
        between(ends, self.share(u))
    }

    /// Heights at the ends by those at the quarters; `choose` of both where a step lies between.
    pub fn extended(&self, [a, b]: [f64; 2], choose: fn(f64, f64) -> f64) -> [f64; 2] {
        if (b - a).abs() > STEEPEST * self.length {
            return [choose(a, b); 2];
        }
        [a - 0.5 * (b - a), b + 0.5 * (b - a)]
    }
}

/// Height of the design at `u`, so far in front of a strip, mm.
fn height_at(part: &Part, piece: &WallPiece, u: f64, aside: f64) -> Option<f64> {
    let q = piece.place(u, piece.high_at(u)).xy() + piece.normal * aside;
    part.highest_at(q.x, q.y).map(|design| design.point.z)
}

/// How fast the medial axis at the end of a wall leaves it, where the wall turns by the angle up to which
/// `holds`: the axis halves the angle between both walls.
fn medial(holds: &dyn Fn(f64) -> bool) -> f64 {
    if !holds(STRAIGHT) {
        return f64::INFINITY;
    }
    let (mut within, mut out) = (STRAIGHT, std::f64::consts::PI);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (within + out);
        *(if holds(middle) { &mut within } else { &mut out }) = middle;
    }
    1.0 / (0.5 * (out + TURN_ROUNDING)).min(std::f64::consts::FRAC_PI_2).tan()
}

/// The vertical facets of a mesh in strips no longer than `longest` mm.
pub(super) fn pieces(part: &Part, longest: f64, bottom: f64) -> Vec<WallPiece> {
    let mesh = part.mesh();
    let of_facet = |t: usize| {
        let normal = mesh.normal(t);
        if normal.z.abs() > LEAST_FACING {
            return Vec::new();
        }
        let strips = of_facet(&mesh.corners(t), &normal);
        let cut = strips.into_iter().flatten().flat_map(|strip| shortened(&strip, longest));
        cut.map(|piece| piece.with_surroundings(part, bottom)).collect()
    };
    work::parallel::map(mesh.triangles().len(), of_facet).into_iter().flatten().collect()
}

/// The two strips of a facet, on either side of its middle corner.
fn of_facet(corners: &[Point3; 3], normal: &Vector3) -> [Option<WallPiece>; 2] {
    let across = normal.xy();
    let (n, lean) = (across / across.norm(), -normal.z / across.norm());
    let along = Vector2::new(-n.y, n.x);
    let first = corners[0];
    let mut by_u = corners.map(|c| [(c.xy() - first.xy()).dot(&along), c.z]);
    by_u.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let [a, b, c] = by_u;
    let share = if c[0] > a[0] { (b[0] - a[0]) / (c[0] - a[0]) } else { 0.0 };
    let opposite = between([a[1], c[1]], share);
    let strip = |from: [f64; 2], to: [f64; 2], ends: [[f64; 2]; 2]| {
        let length = to[0] - from[0];
        let ordered = ends.map(|[x, y]| [x.min(y), x.max(y)]);
        (length > SHORTEST).then(|| WallPiece {
            start: first.xy() + along * from[0],
            along,
            normal: n,
            length,
            lean,
            level: first.z,
            low: [ordered[0][0], ordered[1][0]],
            high: [ordered[0][1], ordered[1][1]],
            floor: [0.0; 2],
            top: [0.0; 2],
            beyond: [0.0; 2],
            behind: [f64::INFINITY; 2],
            before: [f64::INFINITY; 2],
        })
    };
    [strip(a, b, [[a[1]; 2], [b[1], opposite]]), strip(b, c, [[b[1], opposite], [c[1]; 2]])]
}

/// A strip in parts of equal length.
fn shortened(strip: &WallPiece, longest: f64) -> Vec<WallPiece> {
    let parts = (strip.length / longest).ceil().max(1.0) as usize;
    let at = |k: usize| strip.length * k as f64 / parts as f64;
    let part = |k: usize| {
        let (from, to) = (at(k), at(k + 1));
        WallPiece {
            start: strip.start + strip.along * from,
            length: to - from,
            low: [strip.low_at(from), strip.low_at(to)],
            high: [strip.high_at(from), strip.high_at(to)],
            beyond: [from, strip.length - to],
            ..*strip
        }
    };
    (0..parts).map(part).collect()
}
