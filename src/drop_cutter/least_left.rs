//! What a cutter leaves at a place of the part, wherever it stands.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use super::{Beside, DropCutter};
use cutter::Cutter;
use geometry::{Point2, Point3, Vector2, Vector3};
use work::monitor::{self, Cancelled, Monitor};

/// The least height, mm along the normal, that an upright cutter leaves above a place without cutting into
/// the part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeastLeft {
    /// What the best position that was found leaves.
    pub height: f64,
    /// By how much another position may leave less.
    pub bound: f64,
}

/// Positions that are tried. Where they do not tell, nothing is said.
const MOST: usize = 20_000;

/// The bound that the search ends at, as a share of the height.
const CLOSE: f64 = 0.01;

/// How often [`DropCutter::lowest_over`] halves its step.
const HALVED: usize = 8;

/// It steps on where the cutter leaves less by this share of the step; the sum over all steps is then finite.
const LEAST_LOWERED: f64 = 1e-4;

/// Positions of the tip over a square of the plan.
struct Square {
    middle: [f64; 2],
    half: f64,
    /// No position in it leaves less, mm.
    least: f64,
}

/// Steps of the search for where a line meets the cutter: the last is a billionth of its radius.
const SEARCHED: usize = 60;

/// A line that misses the cutter by so little, mm, counts as meeting it.
const GRAZED: f64 = 1e-9;

/// Positions that meet the line above a place no further up than so many times what is to be proven are
/// looked at.
const AS_FAR: f64 = 2.0;

/// Eight places at so many mm along the axes and the diagonals: a cutter that stands on the part at two
/// places comes lower only between the ways on which it leaves one of them.
fn around(at: Point2, step: f64) -> impl Iterator<Item = Point2> {
    let offsets = (-1..=1).flat_map(|x| (-1..=1).map(move |y| Vector2::new(f64::from(x), f64::from(y))));
    offsets.filter(|offset| *offset != Vector2::zeros()).map(move |offset| at + offset * step)
}

/// Rings of positions around a place, and positions on each, that are tried without a proof.
const RINGS: usize = 3;
const ON_RING: usize = 8;

impl DropCutter<'_> {
    /// What the best position of `cutter`, which this was made for, that a search from a few finds leaves
    /// above the place `at` of the part, with its unit normal, mm along z: no less than [`Self::least_left`]
    /// finds. Infinite where none of them touches the part. The search ends where no more than `enough` is
    /// left.
    pub fn left_by_search(&self, cutter: &Cutter, at: &Point3, normal: &Vector3, enough: f64) -> f64 {
        let leaves = |axis: Point2| self.left_from(cutter, at, axis).unwrap_or(f64::INFINITY);
        let touching = at.xy() + cutter.axis_offset(normal);
        let first = leaves(touching);
        if first <= enough {
            return first;
        }
        let spacing = cutter.radius() / RINGS as f64;
        let ring = |k: usize| {
            let (sin, cos) = (std::f64::consts::TAU * (k % ON_RING) as f64 / ON_RING as f64).sin_cos();
            at.xy() + Vector2::new(cos, sin) * (spacing * (k / ON_RING + 1) as f64)
        };
        let others = std::iter::once(at.xy()).chain((0..RINGS * ON_RING).map(ring));
        let all = others.map(|axis| (leaves(axis), axis)).chain([(first, touching)]);
        let best = all.min_by(|a, b| a.0.total_cmp(&b.0));
        best.map_or(f64::INFINITY, |(_, axis)| leaves(self.lowest_over(cutter, at, axis, 0.5 * spacing)))
    }

    /// What `cutter`, which this was made for, leaves above the place `at` from an axis, mm along z; `None`
    /// where it does not cover the place or touches no part.
    pub fn left_from(&self, cutter: &Cutter, at: &Point3, axis: Point2) -> Option<f64> {
        let height = cutter.height((axis - at.xy()).norm())?;
        Some(self.at(axis.x, axis.y)?.tip_z + height - at.z)
    }

    /// The axis, mm, near `first` from which `cutter`, which this was made for, leaves least above the place
    /// `at` of the part: a search by ever smaller steps, the first of them `step` mm. Where the cutter cannot
    /// touch the place, since it stands on the part elsewhere, another position near the one that would touch
    /// it leaves less.
    pub fn lowest_over(&self, cutter: &Cutter, at: &Point3, first: Point2, step: f64) -> Point2 {
        let leaves = |axis: &Point2| self.left_from(cutter, at, *axis).unwrap_or(f64::INFINITY);
        let (mut best, mut step) = ((leaves(&first), first), step);
        for _ in 0..HALVED {
            while let Some(lower) = around(best.1, step)
                .map(|axis| (leaves(&axis), axis))
                .filter(|(left, _)| *left < best.0 - LEAST_LOWERED * step)
                .min_by(|a, b| a.0.total_cmp(&b.0))
            {
                best = lower;
            }
            step *= 0.5;
        }
        best.1
    }

    /// What `cutter`, which this was made for, leaves at least above the place `at` of the part along its
    /// unit normal, which looks up; `None` where that is not proven to be more than `more_than`, mm.
    ///
    /// A branch and bound over all positions that cover the place, or the line above it as far as
    /// `more_than`. A cutter that touches the part at a contact comes no lower than this contact from any
    /// position nearby, either; that bounds a whole square.
    ///
    /// # Errors
    /// [`Cancelled`] when the monitor says so.
    pub fn least_left(
        &self,
        cutter: &Cutter,
        at: &Point3,
        normal: &Vector3,
        more_than: f64,
        monitor: &dyn Monitor,
    ) -> Result<Option<LeastLeft>, Cancelled> {
        let radius = cutter.radius();
        let line = Line { cutter, at: *at, normal: *normal };
        // Positions farther aside meet the line above that.
        let lean = normal.xy().norm();
        let as_far = if lean > 0.0 { AS_FAR * more_than } else { f64::INFINITY };
        let reach = radius + if lean > 0.0 { as_far * lean } else { 0.0 };
        let height = |rho: f64| cutter.height(rho).unwrap_or(f64::INFINITY);
        let mut found = f64::INFINITY;
        let mut beside = Beside::default();
        let mut square = |middle: [f64; 2], half: f64, found: &mut f64| {
            let away = |x: f64, y: f64| (middle[0] - x).hypot(middle[1] - y);
            let (off, corner) = (away(at.x, at.y), std::f64::consts::SQRT_2 * half);
            if off - corner > reach {
                return None;
            }
            let mut least = f64::NEG_INFINITY;
            if let Some(drop) = self.at_beside(middle[0], middle[1], &mut beside) {
                *found = found.min(line.left(drop.tip_z, middle, 0.0));
                let contact = drop.contact.point;
                let carried = |z: f64, rho: f64| z - height(rho + corner);
                let rho = away(contact.x, contact.y);
                let mut tip = carried(contact.z, rho);
                // The rim of a flat leaves the contact at once; a place of the part a little further in stays
                // below it.
                let inner = (radius - corner).min(rho);
                if rho + corner > radius && inner > 0.0 {
                    let along = |from: f64, to: f64| from + (to - from) * inner / rho;
                    let (x, y) = (along(middle[0], contact.x), along(middle[1], contact.y));
                    if let Some(hit) = self.bvh.highest_at(self.mesh, x, y) {
                        let level = self.mesh.normal(hit.triangle as usize).z;
                        tip = tip.max(carried(hit.z - self.deviation / level.max(f64::MIN_POSITIVE), inner));
                    }
                }
                least = line.left(tip, middle, corner);
            }
            Some(Square { middle, half, least })
        };
        let mut open: BinaryHeap<Square> = square([at.x, at.y], reach, &mut found).into_iter().collect();
        for tried in 0.. {
            let Some(lowest) = open.pop() else { break };
            if found <= more_than || tried >= MOST && lowest.least <= more_than {
                return Ok(None);
            }
            if lowest.least >= found - CLOSE * found || lowest.least >= as_far || tried >= MOST {
                let least = lowest.least.min(as_far);
                return Ok(Some(LeastLeft { height: found, bound: (found - least).max(0.0) }));
            }
            if tried % 64 == 0 {
                monitor::check(monitor)?;
            }
            let (half, [x, y]) = (0.5 * lowest.half, lowest.middle);
            for [right, up] in [[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]] {
                open.extend(square([x + right * half, y + up * half], half, &mut found));
            }
        }
        Ok(None)
    }
}

/// The line along the normal of a place, mm.
struct Line<'a> {
    cutter: &'a Cutter,
    at: Point3,
    normal: Vector3,
}

impl Line<'_> {
    /// How far along the line it meets a cutter whose tip is at that height, or one nearer to the line by up
    /// to `aside`; infinite where it does not, or beyond the radius from the place. Never more than that by
    /// more than rounding.
    fn left(&self, tip: f64, [x, y]: [f64; 2], aside: f64) -> f64 {
        let gap = |t: f64| {
            let q = self.at + self.normal * t;
            let off = ((q.x - x).hypot(q.y - y) - aside).max(0.0);
            tip + self.cutter.height(off).unwrap_or(f64::INFINITY) - q.z
        };
        // Where the line passes beneath the cutter or through it.
        let (way, lean) = (Vector2::new(self.at.x - x, self.at.y - y), self.normal.xy());
        let (a, b, c) = (
            lean.norm_squared(),
            way.dot(&lean),
            way.norm_squared() - (self.cutter.radius() + aside).powi(2),
        );
        if a < 1e-18 {
            return if c <= 0.0 { gap(0.0) / self.normal.z } else { f64::INFINITY };
        }
        let root = b * b - a * c;
        if root < 0.0 {
            return f64::INFINITY;
        }
        let (first, last) = ((-b - root.sqrt()) / a, (-b + root.sqrt()) / a);
        // Just within, for beyond its radius a cutter has no height.
        let inset = 1e-12 * (last - first);
        let (first, last) = ((first + inset).max(-self.cutter.radius()), last - inset);
        if last <= first {
            return f64::INFINITY;
        }
        if gap(first) <= 0.0 {
            return first;
        }
        // A convex function: it falls until the meeting, if there is one.
        let (mut low, mut high, mut is_met) = (first, last, false);
        for _ in 0..SEARCHED {
            if is_met {
                let middle = 0.5 * (low + high);
                *(if gap(middle) <= 0.0 { &mut high } else { &mut low }) = middle;
                continue;
            }
            let third = (high - low) / 3.0;
            let [left, right] = [gap(low + third), gap(high - third)];
            if left <= 0.0 {
                (high, is_met) = (low + third, true);
            } else if left <= right {
                high -= third;
            } else {
                low += third;
                is_met = right <= 0.0;
                high -= if is_met { third } else { 0.0 };
            }
        }
        if is_met || gap(high) <= GRAZED { low } else { f64::INFINITY }
    }
}

impl Ord for Square {
    /// The one that may leave least is the greatest: a heap hands it out first.
    fn cmp(&self, other: &Self) -> Ordering {
        other.least.total_cmp(&self.least)
    }
}

impl PartialOrd for Square {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Square {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Square {}

#[cfg(test)]
mod tests {
    use super::super::tests::{cutters, height_field};
    use super::*;
    use geometry::Bvh;
    use work::monitor::Silent;

    fn left(cutter: &Cutter, at: [f64; 2], more_than: f64, z: impl Fn(f64, f64) -> f64) -> Option<LeastLeft> {
        let mesh = height_field(120, 12.0, 0.0, &z);
        let bvh = Bvh::new(&mesh);
        let drop = DropCutter::over(&mesh, &bvh, cutter, None, &Silent).unwrap();
        let place = bvh.highest_at(&mesh, at[0], at[1]).unwrap();
        drop.least_left(cutter, &Point3::new(at[0], at[1], place.z), &Vector3::z(), more_than, &Silent)
            .unwrap()
    }

    /// In the middle of a hollow cylinder of 30 mm a flat of 1.5 mm in radius rests on its corner: the closed
    /// form of the section. A ball and a short flat reach the ground.
    #[test]
    fn a_flat_stands_above_the_ground_of_a_hollow() {
        let hollow = |x: f64, _: f64| 30.0 - (900.0 - (x - 6.0).powi(2)).sqrt();
        let bull = Cutter::bull(6.0, 1.5).unwrap();
        let stands = 30.0 - 1.5 - (28.5f64.powi(2) - 1.5f64.powi(2)).sqrt();
        // A chord of the mesh lies this far above the arc.
        let chord = 0.1f64.powi(2) / 8.0 / 30.0;
        let found = left(&bull, [6.0, 6.0], 0.01, hollow).unwrap();
        assert!(found.bound <= 0.01 * found.height, "{found:?}");
        assert!(found.height >= stands - chord, "{found:?} {stands}");
        assert!(found.height - found.bound <= stands + chord, "{found:?} {stands}");
        // Of an end mill the edge rests where it is.
        let flat = Cutter::flat(6.0).unwrap();
        let stands = 30.0 - (900.0f64 - 9.0).sqrt();
        let found = left(&flat, [6.0, 6.0], 0.01, hollow).unwrap();
        assert!(found.height - found.bound <= stands + chord && found.height >= stands - chord, "{found:?}");
        assert_eq!(left(&Cutter::ball(6.0).unwrap(), [6.0, 6.0], 1e-3, hollow), None);
        assert_eq!(left(&bull, [6.0, 6.0], 1.01 * (stands + chord), hollow), None);
    }

    /// At the foot of a steep wall on a slope of 40 degrees a ball stands on both. What it leaves is steeper
    /// than the slope there: along the normal it is less than along z times the normal's z.
    #[test]
    fn heights_are_those_along_the_normal() {
        let [slope, wall] = [40f64, 65.0].map(f64::to_radians);
        let foot = |x: f64, _: f64| (x - 6.0).min(0.0) * slope.tan() + (x - 6.0).max(0.0) * wall.tan();
        let aside = 3.0 * (0.5 * (wall - slope)).tan();
        let stands = 3.0 - (9.0 - aside * aside).sqrt();
        let mesh = height_field(120, 12.0, 0.0, &foot);
        let bvh = Bvh::new(&mesh);
        let ball = Cutter::ball(6.0).unwrap();
        let drop = DropCutter::over(&mesh, &bvh, &ball, None, &Silent).unwrap();
        let normal = Vector3::new(-slope.sin(), 0.0, slope.cos());
        let least = |more_than: f64| {
            drop.least_left(&ball, &Point3::new(6.0, 6.0, 0.0), &normal, more_than, &Silent).unwrap()
        };
        let found = least(0.9 * stands).unwrap();
        assert!(found.height >= stands - 1e-6 && found.height <= 1.01 * stands, "{found:?} {stands}");
        assert!(found.height - found.bound <= stands, "{found:?} {stands}");
        assert_eq!(least(1.02 * stands), None);
        let upright = drop.least_left(&ball, &Point3::new(6.0, 6.0, 0.0), &Vector3::z(), 0.0, &Silent);
        let upright = upright.unwrap().unwrap();
        assert!((upright.height - upright.bound) * normal.z > 1.2 * stands, "{upright:?} {stands}");
    }

    /// The same along the normals of steep walls on level ground.
    #[test]
    fn a_wall_is_left_at_its_foot_as_the_ground_is() {
        for degrees in [85f64, 88.0, 89.5] {
            let angle = degrees.to_radians();
            let mesh = height_field(120, 12.0, 0.0, |x, _| (x - 6.0).max(0.0) * angle.tan());
            let bvh = Bvh::new(&mesh);
            let ball = Cutter::ball(6.0).unwrap();
            let drop = DropCutter::over(&mesh, &bvh, &ball, None, &Silent).unwrap();
            let stands = 3.0 * (1.0 - (1.0 - (0.5 * angle).tan().powi(2)).sqrt());
            let (foot, normal) = (Point3::new(6.0, 6.0, 0.0), Vector3::new(-angle.sin(), 0.0, angle.cos()));
            let least = |more_than: f64| drop.least_left(&ball, &foot, &normal, more_than, &Silent).unwrap();
            for share in [0.2, 0.9] {
                let found = least(share * stands).unwrap();
                let proven = found.height - found.bound;
                assert!(proven > share * stands && proven <= stands + 1e-6, "{found:?} {stands}");
                assert!(found.height >= stands - 1e-6 && found.height <= 1.02 * stands, "{found:?} {stands}");
            }
            assert_eq!(least(1.02 * stands), None);
        }
    }

    /// From beside the best position the search comes to it: in a hollow a cutter that rests on its corner
    /// leaves least over its middle.
    #[test]
    fn the_best_position_is_found_from_beside() {
        let hollow = |x: f64, y: f64| 2e-3 * ((x - 6.0).powi(2) + 0.5 * (y - 6.0).powi(2));
        let mesh = height_field(120, 12.0, 0.0, &hollow);
        let bvh = Bvh::new(&mesh);
        for cutter in [Cutter::bull(6.0, 1.5).unwrap(), Cutter::flat(6.0).unwrap()] {
            let drop = DropCutter::over(&mesh, &bvh, &cutter, None, &Silent).unwrap();
            let at = Point3::new(6.0, 6.0, 0.0);
            let leaves = |axis: Point2| {
                drop.at(axis.x, axis.y).unwrap().tip_z + cutter.height((axis - at.xy()).norm()).unwrap()
            };
            let first = Point2::new(6.7, 5.6);
            let found = leaves(drop.lowest_over(&cutter, &at, first, 0.3));
            let least = drop.least_left(&cutter, &at, &Vector3::z(), 0.0, &Silent).unwrap().unwrap();
            assert!(found < 0.9 * leaves(first), "{found} {}", leaves(first));
            assert!(found <= 1.02 * least.height && found >= least.height - least.bound, "{found} {least:?}");
        }
    }

    /// No position on a dense raster leaves less than what is told, at any place, of any cutter.
    #[test]
    fn no_position_leaves_less() {
        let rough = |x: f64, y: f64| 0.8 * (1.3 * x).sin() * (1.1 * y).cos() + 0.3 * (2.9 * x + y).sin();
        let mesh = height_field(60, 12.0, 0.2, rough);
        let bvh = Bvh::new(&mesh);
        let mut told = 0;
        for cutter in cutters() {
            let drop = DropCutter::over(&mesh, &bvh, &cutter, None, &Silent).unwrap();
            for at in [[4.1, 5.2], [7.3, 6.9], [6.0, 3.3]] {
                let z = bvh.highest_at(&mesh, at[0], at[1]).unwrap().z;
                let place = Point3::new(at[0], at[1], z);
                for normal in [Vector3::z(), Vector3::new(0.5, -0.3, 0.9).normalize()] {
                    let Some(least) = drop.least_left(&cutter, &place, &normal, 0.005, &Silent).unwrap()
                    else {
                        continue;
                    };
                    told += 1;
                    if normal.z == 1.0 {
                        let searched = drop.left_by_search(&cutter, &place, &normal, 0.0);
                        assert!(searched >= least.height - least.bound - 1e-9);
                    }
                    let n = 60;
                    for k in 0..n * n {
                        let of =
                            |k: usize| (2.0 * (k as f64 + 0.5) / f64::from(n as u32) - 1.0) * cutter.radius();
                        let axis = place.xy() + Vector2::new(of(k % n), of(k / n));
                        let tip = drop.at(axis.x, axis.y).unwrap().tip_z;
                        // Up the line, step by step.
                        let is_within = |t: f64| {
                            let q = place + normal * t;
                            cutter.height((q.xy() - axis).norm()).is_some_and(|up| tip + up <= q.z)
                        };
                        let proven = least.height - least.bound - 1e-7;
                        let mut steps = (0..=200).map(|k| proven * f64::from(k) / 200.0);
                        assert!(!steps.any(is_within), "{cutter:?} {normal:?} {least:?}");
                    }
                }
            }
        }
        assert!(told >= 6, "{told} places were told");
    }
}
