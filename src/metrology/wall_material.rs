//! What a path leaves standing on the walls of a pocket.
//!
//! Enters: stretches of walls that the cutter comes to, the moves, and where nothing stood before. Leaves:
//! how thick material stands on a wall at most, along its normal, and a bound; mm.
//!
//! In the plan view a straight move sweeps a stadium, which is convex. So what a stadium holds on the normals
//! at both ends of a stretch it holds between them, and the thickness left of both ends together bounds that
//! of the stretch. At a place itself the stadiums tell exactly. Stretches are halved until the bound is near
//! the thickest place that was found.

use geometry::{CurveSegment, Point2, RegionIndex, SegmentGrid, Vector2, WallStretch};
use motion::Toolpath;
use work::monitor::{self, Cancelled, Monitor};
use work::parallel;

/// Stretches that are looked at first are no longer than this share of the radius, and turn by no more than
/// so many rad.
const FIRST: f64 = 0.1;

/// A bound that exceeds the thickest material by no more is good enough, mm.
const PRECISE: f64 = 2.0e-5;

/// Stretches of one first stretch that are looked at, at most.
const MOST: usize = 4096;

/// Sides of a region that are this near to a normal are seen from it, mm: far above rounding.
const BESIDE: f64 = 1.0e-9;

/// Material on walls.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct WallMaterial {
    /// How thick it stands at most, mm; as far as was looked where no move comes near.
    pub thickness: f64,
    /// How much thicker it may be between the places that were looked at, mm; infinite where no move comes
    /// near.
    pub error_bound: f64,
    /// Where, if it stands anywhere.
    pub at: Option<Point2>,
}

/// What the material on walls is sought with.
#[derive(Debug)]
pub struct WallSearch<'a> {
    /// The walls that the cutter comes to.
    pub walls: &'a [WallStretch],
    /// Moves down to this height cut a wall to its foot, mm.
    pub level: f64,
    /// So far from the walls it is looked for, mm: beyond, it stands on the floor.
    pub deep: f64,
    /// Where something stands there it is followed so far, mm; no less than `deep`.
    pub farthest: f64,
    /// Where nothing stood before, and the sides of that beside which stock stood, if it lies anywhere.
    pub before: Option<(RegionIndex, SegmentGrid)>,
}

/// A normal of a wall.
#[derive(Clone, Copy)]
struct Ray {
    base: Point2,
    inward: Vector2,
}

/// The stadiums near a first stretch.
type Stadiums = Vec<([Point2; 2], f64)>;

impl WallSearch<'_> {
    /// The thickest material that `tools`, each a radius and its moves, leave.
    ///
    /// # Errors
    /// [`Cancelled`] when the monitor says so.
    pub fn run(&self, tools: &[(f64, &Toolpath)], monitor: &dyn Monitor) -> Result<WallMaterial, Cancelled> {
        let ways = tools.iter().enumerate().flat_map(|(tool, (_, path))| {
            let below = path.segments().filter_map(|(a, b, _)| {
                let (low, high) = (a.z.min(b.z), a.z.max(b.z));
                if low > self.level {
                    return None;
                }
                // Of a sloped move the lower part.
                let share = if high > self.level { (self.level - low) / (high - low) } else { 1.0 };
                let (from, to) = if a.z <= b.z { (a.xy(), b.xy()) } else { (b.xy(), a.xy()) };
                Some([from, from + (to - from) * share])
            });
            below.map(move |ends| CurveSegment { ends, curve: tool as u32, index: 0 }).collect::<Vec<_>>()
        });
        let ways = SegmentGrid::new(ways.collect());
        let radius = tools.iter().map(|tool| tool.0).fold(0.0, f64::max);
        let least = tools.iter().map(|tool| tool.0).fold(radius, f64::min);
        let first = |stretch: &WallStretch| {
            let turn = stretch.inward[0].perp(&stretch.inward[1]).abs();
            let count = (stretch.length() / (FIRST * least)).max(turn / FIRST).ceil().max(1.0) as usize;
            let mut parts = vec![*stretch];
            while parts.len() < count {
                parts = parts.iter().flat_map(WallStretch::halves).collect();
            }
            parts
        };
        let parts: Vec<WallStretch> = self.walls.iter().flat_map(first).collect();
        let stadiums = |part: &WallStretch| -> Stadiums {
            let reach = Vector2::repeat(radius + self.deep.max(self.farthest));
            let around = [part.ends[0].inf(&part.ends[1]) - reach, part.ends[0].sup(&part.ends[1]) + reach];
            let mut near = Vec::new();
            ways.near(&around, |k| near.push(k));
            near.sort_unstable();
            near.dedup();
            let of = |k: u32| &ways.segments()[k as usize];
            near.into_iter().map(of).map(|way| (way.ends, tools[way.curve as usize].0)).collect()
        };
        let looked = parallel::try_map(parts.len(), |k| {
            monitor::check(monitor)?;
            Ok(self.looked_at(&parts[k], &stadiums(&parts[k])))
        })?;
        let thicker = |best: WallMaterial, (found, at): (f64, Point2)| {
            let at = Some(at).filter(|_| found > best.thickness).or(best.at);
            WallMaterial { thickness: best.thickness.max(found), at, ..best }
        };
        let best = looked.iter().fold(WallMaterial::default(), |best, one| thicker(best, one.0));
        let open: Vec<usize> = (0..parts.len()).filter(|k| looked[*k].1 > best.thickness + PRECISE).collect();
        let closer = parallel::try_map(open.len(), |k| {
            monitor::check(monitor)?;
            let part = parts[open[k]];
            Ok(self.closer(part, looked[open[k]].1, best.thickness, &stadiums(&part)))
        })?;
        let best = closer.iter().fold(best, |best, one| thicker(best, one.0));
        let most = looked.iter().map(|one| one.1).filter(|most| *most <= best.thickness + PRECISE);
        let most = most.chain(closer.iter().map(|one| one.1)).fold(0.0, f64::max);
        Ok(WallMaterial { error_bound: (most - best.thickness).max(0.0), ..best })
    }

    /// The thickest material at the ends of a stretch and where; and the most that may stand anywhere on it.
    fn looked_at(&self, stretch: &WallStretch, near: &Stadiums) -> ((f64, Point2), f64) {
        let rays = [0, 1].map(|k| Ray { base: stretch.ends[k], inward: stretch.inward[k] });
        let found = rays.map(|ray| (self.thickness([ray, ray], near, self.farthest), ray.base));
        let found = if found[1].0 > found[0].0 { found[1] } else { found[0] };
        (found, self.thickness(rays, near, f64::INFINITY).max(found.0))
    }

    /// The same of a stretch that is halved where more than `known` may stand.
    fn closer(&self, stretch: WallStretch, most: f64, known: f64, near: &Stadiums) -> ((f64, Point2), f64) {
        let mut best = (0.0, stretch.ends[0]);
        let mut bound = 0.0f64;
        let mut open = vec![(most, stretch)];
        for look in 0.. {
            let Some((most, stretch)) = open.pop() else { break };
            let thickest = known.max(best.0);
            if most <= thickest + PRECISE || thickest >= self.farthest || look >= MOST {
                bound = bound.max(most);
                continue;
            }
            for half in stretch.halves() {
                let (found, most) = self.looked_at(&half, near);
                if found.0 > best.0 {
                    best = found;
                }
                open.push((most, half));
            }
        }
        (best, bound)
    }

    /// How thick material stands at most between two normals; `unknown` where nothing near takes it away.
    fn thickness(&self, rays: [Ray; 2], near: &Stadiums, unknown: f64) -> f64 {
        // Between normals that spread, chords lie nearer to their foot than the ends.
        let spread = (0.5 * (1.0 + rays[0].inward.dot(&rays[1].inward))).sqrt();
        let deep = self.deep / spread;
        let taken = |(ends, radius): &([Point2; 2], f64)| {
            let of = |ray: &Ray| ray.within(ends, *radius);
            let (a, b) = (of(&rays[0])?, of(&rays[1])?);
            Some([a[0].max(b[0]), a[1].min(b[1])]).filter(|both| both[0] <= both[1])
        };
        let mut taken: Vec<[f64; 2]> = near.iter().filter_map(taken).collect();
        taken.extend(self.taken_before(rays, deep));
        let mut thickness = deep;
        loop {
            let reaching = taken.iter().filter(|one| one[1] >= thickness).map(|one| one[0]);
            let next = reaching.fold(f64::INFINITY, f64::min);
            if next <= 0.0 {
                return 0.0;
            }
            if next < thickness {
                thickness = next;
            } else if next == thickness || thickness < deep {
                return thickness;
            } else {
                // It goes on beyond.
                return if next < self.farthest { next } else { unknown };
            }
        }
    }

    /// From where on up to `deep` nothing stood before between two normals.
    fn taken_before(&self, [a, b]: [Ray; 2], deep: f64) -> Option<[f64; 2]> {
        let (region, borders) = self.before.as_ref()?;
        let ends = [a, b].map(|ray| ray.base + ray.inward * deep);
        let (lo, hi) = (
            a.base.inf(&b.base).inf(&ends[0]).inf(&ends[1]),
            a.base.sup(&b.base).sup(&ends[0]).sup(&ends[1]),
        );
        let (along, length) = (Vector2::new(a.inward.y, -a.inward.x), (b.base - a.base).norm());
        let mut from = 0.0f64;
        let beside = Vector2::repeat(BESIDE);
        borders.near(&[lo - beside, hi + beside], |k| {
            let side = borders.segments()[k as usize].ends;
            let seen = if a.inward == b.inward {
                let seen = side.map(|p| Vector2::new((p - a.base).dot(&along), (p - a.base).dot(&a.inward)));
                clipped(seen, [-BESIDE, length + BESIDE]).map(|ends| ends.map(|p| p.y))
            } else {
                // Around an edge, by how far they are.
                let nearest = geometry::distance_to_segment(&a.base, &side[0], &side[1]);
                Some([nearest, side.map(|p| (p - a.base).norm()).into_iter().fold(0.0, f64::max)])
            };
            if let Some([near, far]) = seen.filter(|seen| seen[0].min(seen[1]) < deep) {
                from = from.max(near.max(far));
            }
        });
        let between = 0.5 * (from + deep);
        let at = [a, b].map(|ray| ray.base + ray.inward * between);
        let inside = || region.contains(&(at[0] + (at[1] - at[0]) * 0.5));
        (from < deep && inside()).then_some([from, deep])
    }
}

/// The part of a straight line whose x lies in a range.
fn clipped([p, q]: [Vector2; 2], [from, to]: [f64; 2]) -> Option<[Vector2; 2]> {
    if p.x.max(q.x) < from || p.x.min(q.x) > to {
        return None;
    }
    let at = |x: f64| {
        let share = if p.x == q.x { 0.0 } else { (x - p.x) / (q.x - p.x) };
        p + (q - p) * share.clamp(0.0, 1.0)
    };
    Some(if p.x == q.x { [p, q] } else { [at(p.x.clamp(from, to)), at(q.x.clamp(from, to))] })
}

impl Ray {
    /// From where to where it lies in the stadium of a radius around a straight line.
    fn within(&self, [a, b]: &[Point2; 2], radius: f64) -> Option<[f64; 2]> {
        let disc = |centre: &Point2| {
            let to = centre - self.base;
            let (middle, off) = (to.dot(&self.inward), to.perp(&self.inward));
            let half = ((radius - off) * (radius + off)).max(0.0).sqrt();
            (off.abs() <= radius).then_some([middle - half, middle + half])
        };
        let between = || {
            let along = (b - a).try_normalize(0.0)?;
            let from = self.base - a;
            let mut within = [f64::NEG_INFINITY, f64::INFINITY];
            // Along the line, and across it.
            for (at, speed, low, high) in [
                (along.dot(&from), along.dot(&self.inward), 0.0, (b - a).norm()),
                (along.perp(&from), along.perp(&self.inward), -radius, radius),
            ] {
                if speed == 0.0 {
                    if at < low || at > high {
                        return None;
                    }
                    continue;
                }
                let meets = [(low - at) / speed, (high - at) / speed];
                within = [within[0].max(meets[0].min(meets[1])), within[1].min(meets[0].max(meets[1]))];
            }
            (within[0] <= within[1]).then_some(within)
        };
        let parts = [disc(a), disc(b), between()];
        parts.into_iter().flatten().reduce(|one, other| [one[0].min(other[0]), one[1].max(other[1])])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::{Point3, Region};
    use motion::{ClPoint, Move, MoveKind};
    use work::monitor::Silent;

    fn path(tips: &[(f64, f64, f64)]) -> Toolpath {
        let at = |&(x, y, z): &(f64, f64, f64)| ClPoint::upright(Point3::new(x, y, z));
        let to = |tip| Move { to: at(tip), kind: MoveKind::Cut, feed_rate: 1.0, pass: 0 };
        Toolpath::new(at(&tips[0]), tips[1..].iter().map(to).collect())
    }

    /// A wall along y = 0 from x = 0 to 20, material below.
    fn wall() -> WallStretch {
        WallStretch {
            ends: [Point2::new(0.0, 0.0), Point2::new(20.0, 0.0)],
            inward: [Vector2::new(0.0, 1.0); 2],
        }
    }

    fn left(walls: &[WallStretch], tips: &[(f64, f64, f64)]) -> WallMaterial {
        let search = WallSearch { walls, level: -4.95, deep: 0.01, farthest: 1.0, before: None };
        search.run(&[(3.0, &path(tips))], &Silent).unwrap()
    }

    #[test]
    fn a_pass_leaves_what_it_stands_off() {
        let found = left(&[wall()], &[(-1.0, 3.0, -5.0), (21.0, 3.0, -5.0)]);
        assert!(found.thickness < 1e-12 && found.error_bound <= PRECISE, "{found:?}");
        let found = left(&[wall()], &[(-1.0, 3.4, -5.0), (21.0, 3.4, -5.0)]);
        assert!((found.thickness - 0.4).abs() < 1e-12 && found.error_bound <= PRECISE, "{found:?}");
        // Askew: at the far end.
        let found = left(&[wall()], &[(-1.0, 3.0, -5.0), (21.0, 3.22, -5.0)]);
        let (lean, slope) = ((0.22f64 / 22.0).atan(), 0.01);
        let there = 3.0 + slope * 21.0 - 3.0 / lean.cos();
        assert!(
            (found.thickness - there).abs() < 1e-9 && found.at == Some(Point2::new(20.0, 0.0)),
            "{found:?}"
        );
        // Too high to cut the foot, and the lower half of a slope.
        let found = left(&[wall()], &[(-1.0, 3.0, -4.9), (21.0, 3.0, -4.9)]);
        assert!(found.thickness == 1.0 && found.error_bound == f64::INFINITY, "{found:?}");
        let found = left(&[wall()], &[(30.0, 3.0, -4.95), (-30.0, 3.0, -4.95), (-30.0, 3.0, 5.0)]);
        assert!(found.thickness < 1e-12, "{found:?}");
    }

    /// Plunges along a wall leave cusps between their discs, `r − √(r² − s²/4)` thick.
    #[test]
    fn plunges_leave_cusps() {
        let tips: Vec<_> = (0..30)
            .flat_map(|k| [(0.8 * f64::from(k) - 1.0, 3.0, 1.0), (0.8 * f64::from(k) - 1.0, 3.0, -5.0)])
            .flat_map(|at| [at, (at.0, at.1, 1.0)])
            .collect();
        let cusp = 3.0 - (9.0f64 - 0.16).sqrt();
        let found = left(&[wall()], &tips);
        assert!(found.thickness <= cusp + 1e-12 && found.thickness + found.error_bound >= cusp, "{found:?}");
        assert!(found.error_bound <= 2.0 * PRECISE, "{found:?}");
    }

    /// Around the edge of an island chords leave a fan of material, and those that touch it leave nothing.
    #[test]
    fn edges_are_gone_around() {
        let edge = WallStretch {
            ends: [Point2::origin(); 2],
            inward: [Vector2::new(1.0, 0.0), Vector2::new(0.0, 1.0)],
        };
        let of = |k: usize, n: usize, r: f64| {
            let (sin, cos) = (std::f64::consts::FRAC_PI_2 * k as f64 / n as f64).sin_cos();
            (r * cos, r * sin, -5.0)
        };
        let round = |n: usize, r: f64| -> Vec<(f64, f64, f64)> { (0..=n).map(|k| of(k, n, r)).collect() };
        // Farthest it stands toward the ends of chords, up to the flank of the straight part beside.
        let thickest = 3.2 - 3.0 / (std::f64::consts::FRAC_PI_4 / 5.0).cos();
        let found = left(&[edge], &round(5, 3.2));
        assert!((found.thickness - thickest).abs() < 1e-9, "{found:?} {thickest}");
        assert!(found.error_bound <= 2.0 * PRECISE, "{found:?}");
        assert!(left(&[edge], &round(40, 3.0)).thickness < 1e-12);
    }

    /// What was cleared before up to a wall is not left there, and the rest has to be cut.
    #[test]
    fn what_was_cleared_before_is_not_left() {
        let curve =
            |points: &[(f64, f64)]| points.iter().map(|&(x, y)| Point2::new(x, y)).collect::<Vec<_>>();
        let before = |wall_at: f64| {
            let outline = curve(&[(-5.0, wall_at), (12.0, wall_at), (12.0, 9.0), (-5.0, 9.0)]);
            let region = RegionIndex::new(Region::nested(vec![outline]).unwrap().0);
            let on_wall = |s: &&CurveSegment| s.ends.iter().any(|p| p.y != 0.0);
            let sides = region.sides().segments().iter().filter(on_wall).copied().collect();
            Some((region, SegmentGrid::new(sides)))
        };
        for (wall_at, begin, thickness) in [(0.0, 11.0, 0.0), (0.004, 11.0, 0.004), (0.0, 16.0, 1.0)] {
            let walls = [wall()];
            let search = WallSearch {
                walls: &walls,
                level: -4.95,
                deep: 0.01,
                farthest: 1.0,
                before: before(wall_at),
            };
            let found =
                search.run(&[(3.0, &path(&[(begin, 3.0, -5.0), (21.0, 3.0, -5.0)]))], &Silent).unwrap();
            assert!((found.thickness - thickness).abs() < 1e-9, "{wall_at} {begin} {found:?}");
        }
    }
}
