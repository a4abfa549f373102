//! Spirals of closed passes that lie one inside the other: the tool moves over to the next pass while it goes
//! around, instead of by a link.
//!
//! Enters: passes. Leaves: passes, closed ones joined to spirals where that takes less time. The outermost
//! pass and the innermost one are gone around whole. On a turn between two passes every place lies on the
//! shortest way from the outer to the inner one, at the share of the turn that is done, so that turns are no
//! farther apart than passes. Heights come from dropping the cutter.

use crate::vocabulary::{COMPARED_CHORDS, Passes, PlanError, Task};
use drop_cutter::DropCutter;
use geometry::{CubicSpline, Point2, Point3, SegmentGrid, inside_curve, signed_area};

/// Fewest passes of a spiral: of two, both are gone around whole anyway.
const FEWEST: usize = 3;

/// Passes are neighbours where the ways from one to the other, both ways, are at most this many times as long
/// as they are in the mean.
const ALIKE: f64 = 1.5;

/// A turn that takes a longer step than this many times that of its outer pass has jumped.
const JUMP: f64 = 4.0;

/// Passes whose closed ones are spirals, where these take less time.
pub(crate) fn where_quicker(task: &Task<'_>, passes: Passes) -> Result<Passes, PlanError> {
    if !passes.touches.is_empty() {
        return Ok(passes);
    }
    let chains = chains(&passes.passes);
    if chains.is_empty() {
        return Ok(passes);
    }
    let drop = DropCutter::watched(task.part, task.dropped(), task.monitor)?;
    let mut joined = vec![false; passes.passes.len()];
    let mut all = Vec::new();
    let (mut count, mut turns) = (0, 0);
    for chain in &chains {
        let Some(spiral) = spiral(chain) else { continue };
        let moves = moves(task, &drop, &spiral)?;
        if moves.len() > 1 {
            chain.iter().for_each(|ring| joined[ring.pass] = true);
            all.push(moves);
            (count, turns) = (count + 1, turns + chain.len());
        }
    }
    all.extend(passes.passes.iter().zip(&joined).filter(|(_, joined)| !**joined).map(|(p, _)| p.clone()));
    let with = Passes { passes: all, ..Passes::default() };
    let duration =
        |passes: &Passes| (task.pace.duration)(passes, COMPARED_CHORDS * task.settings.chord_tolerance);
    if count == 0 || duration(&with)? >= duration(&passes)? {
        return Ok(passes);
    }
    let mut passes = Passes { passes: with.passes, ..passes };
    let plural = if count == 1 { "a spiral" } else { "spirals" };
    passes.notes.push(format!(
        "{turns} closed passes are joined to {plural}, which is quicker than ways from each to the next"
    ));
    Ok(passes)
}

/// A closed pass in the plan view, counter-clockwise.
struct Ring {
    /// Which pass it is.
    pass: usize,
    /// Its points, the first one once.
    points: Vec<Point2>,
    sides: SegmentGrid,
    area: f64,
}

impl Ring {
    fn of(pass: usize, tips: &[Point3]) -> Option<Self> {
        let mut points: Vec<Point2> = tips.iter().map(|tip| tip.xy()).collect();
        if points.len() < 4 || points.first() != points.last() {
            return None;
        }
        points.pop();
        if signed_area(&points) < 0.0 {
            points.reverse();
        }
        let (area, sides) = (signed_area(&points), SegmentGrid::of_curves([points.as_slice()]));
        (area > 0.0).then_some(Self { pass, points, sides, area })
    }

    /// The nearest place, and the point before it.
    fn nearest(&self, p: &Point2) -> Option<(usize, Point2)> {
        let near = self.sides.nearest(p)?;
        let segment = self.sides.segments()[near.segment as usize];
        let [a, b] = segment.ends;
        Some((segment.index as usize, a + (b - a) * near.share))
    }

    /// Once around from a place, which comes first and last.
    fn around_from(&self, place: &Point2) -> Option<Vec<Point2>> {
        let (before, start) = self.nearest(place)?;
        let n = self.points.len();
        let between = (1..=n).map(|k| self.points[(before + k) % n]).filter(|p| *p != start);
        Some(std::iter::once(start).chain(between).chain([start]).collect())
    }

    /// Whether another ring is beside it all along.
    fn is_beside(&self, other: &Self) -> bool {
        let ways = |from: &Self, to: &Self| -> Vec<f64> {
            from.points.iter().map(|p| to.sides.distance(p)).collect()
        };
        let mut ways_of_both = ways(self, other);
        ways_of_both.extend(ways(other, self));
        let mean = ways_of_both.iter().sum::<f64>() / ways_of_both.len() as f64;
        ways_of_both.iter().all(|way| *way <= ALIKE * mean)
    }
}

/// Chains of closed passes, each alone within the one before and beside it.
fn chains(passes: &[Vec<Point3>]) -> Vec<Vec<Ring>> {
    let mut rings: Vec<Ring> = passes.iter().enumerate().filter_map(|(k, tips)| Ring::of(k, tips)).collect();
    rings.sort_by(|a, b| b.area.total_cmp(&a.area));
    // The least ring around each.
    let around: Vec<Option<usize>> = work::parallel::map(rings.len(), |k| {
        (0..k).rev().find(|&outer| inside_curve(&rings[outer].points, &rings[k].points[0]))
    });
    let mut inner = vec![0; rings.len()];
    around.iter().flatten().for_each(|&outer| inner[outer] += 1);
    let goes_on = work::parallel::map(rings.len(), |k| {
        around[k].is_some_and(|outer| inner[outer] == 1 && rings[outer].is_beside(&rings[k]))
    });
    let mut chain_of = vec![0; rings.len()];
    let mut chains: Vec<Vec<Ring>> = Vec::new();
    for (k, ring) in rings.into_iter().enumerate() {
        match around[k].filter(|_| goes_on[k]) {
            Some(outer) => chain_of[k] = chain_of[outer],
            None => {
                chain_of[k] = chains.len();
                chains.push(Vec::new());
            }
        }
        chains[chain_of[k]].push(ring);
    }
    chains.retain(|chain| chain.len() >= FEWEST);
    chains
}

/// The way around all passes of a chain in the plan view; `None` where a turn would jump.
fn spiral(chain: &[Ring]) -> Option<Vec<Point2>> {
    let first = chain.first()?;
    let mut start = first.points[0];
    let mut way = first.around_from(&start)?;
    for pair in chain.windows(2) {
        let outer = pair[0].around_from(&start)?;
        let length: f64 = outer.windows(2).map(|w| (w[1] - w[0]).norm()).sum();
        let mut gone = 0.0;
        for w in outer.windows(2) {
            let step = (w[1] - w[0]).norm();
            gone += step;
            let (_, inner) = pair[1].nearest(&w[1])?;
            let place = w[1] + (inner - w[1]) * (gone / length).min(1.0);
            let last = way[way.len() - 1];
            // On the first steps it goes inward as well.
            if (place - last).norm() > JUMP * (step + (inner - w[1]).norm() * step / length) {
                return None;
            }
            way.push(place);
        }
        start = way[way.len() - 1];
    }
    way.extend(chain.last()?.around_from(&start)?.into_iter().skip(1));
    Some(way)
}

/// The moves along a way in the plan view.
fn moves(task: &Task<'_>, drop: &DropCutter<'_>, way: &[Point2]) -> Result<Vec<Point3>, PlanError> {
    let lengths = CubicSpline::chord_lengths(way, false);
    let mut tip = |s: f64| {
        let k = lengths.partition_point(|length| *length <= s).clamp(1, way.len() - 1);
        let side = lengths[k] - lengths[k - 1];
        let t = if side > 0.0 { ((s - lengths[k - 1]) / side).clamp(0.0, 1.0) } else { 0.0 };
        let at = way[k - 1] + (way[k] - way[k - 1]) * t;
        drop.at(at.x, at.y).map(|drop| Point3::new(at.x, at.y, drop.tip_z))
    };
    Ok(task.settings.moves(0.0, lengths[lengths.len() - 1], &mut tip, task.monitor)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vocabulary::{Pace, PassSettings, Step};
    use cutter::Cutter;
    use geometry::{AnalyticShape, AnalyticSurface, CurveSegment};
    use part::{Part, Patch};
    use std::f64::consts::TAU;
    use work::monitor::Silent;

    /// Ellipses around a place, `radii` long and two thirds as wide, in turn one way and the other.
    fn rings(x: f64, radii: &[f64]) -> Vec<Vec<Point3>> {
        let ring = |(k, r): (usize, &f64)| {
            let at = |i: usize| {
                let angle = TAU * (i % 200) as f64 / 200.0 * if k % 2 == 0 { 1.0 } else { -1.0 };
                Point3::new(x + r * angle.cos(), 2.0 * r / 3.0 * angle.sin(), 0.0)
            };
            (0..=200).map(at).collect()
        };
        radii.iter().enumerate().map(ring).collect()
    }

    const RADII: [f64; 7] = [9.0, 8.0, 7.0, 6.0, 5.0, 4.0, 3.0];

    fn planned(passes: Vec<Vec<Point3>>, link: f64) -> Passes {
        let plane = AnalyticSurface::new(AnalyticShape::Plane { height: 0.0 }, [[-12.0, 12.0]; 2]).unwrap();
        let part = Part::from_patches(vec![Patch::Analytic(plane)], 0.002).unwrap();
        let cutter = Cutter::ball(6.0).unwrap();
        let settings = PassSettings::upright(Step::Stepover(1.0), 0.3);
        // By length, and so much for each link.
        let duration = |passes: &Passes, _| Ok(passes.length() + link * (passes.passes.len() - 1) as f64);
        let pace = Pace { duration: &duration, link, bend: 0.1 };
        let task = Task { part: &part, cutter: &cutter, settings, wants_mesh: false, pace, monitor: &Silent };
        where_quicker(&task, Passes { passes, ..Passes::default() }).unwrap()
    }

    /// All is served that the rings serve: between the outermost and the innermost no place is farther from
    /// the spiral than half of what the rings are apart.
    #[test]
    fn dear_links_give_way_to_a_spiral_that_serves_as_much() {
        let of_rings = rings(0.0, &RADII);
        let found = planned(of_rings.clone(), 20.0);
        assert!(
            found.passes.len() == 1 && found.notes[0].starts_with("7 closed passes"),
            "{:?}",
            found.notes
        );
        let spiral: Vec<Point2> = found.passes[0].iter().map(|p| p.xy()).collect();
        let sides = spiral.windows(2).enumerate();
        let sides = sides.map(|(k, w)| CurveSegment { ends: [w[0], w[1]], curve: 0, index: k as u32 });
        let spiral = SegmentGrid::new(sides.collect());
        for k in 0..20_000 {
            let (r, angle) = (3.0 + 6.0 * (k / 200) as f64 / 100.0, TAU * (k % 200) as f64 / 200.0);
            let p = Point2::new(r * angle.cos(), 2.0 * r / 3.0 * angle.sin());
            assert!(spiral.distance(&p) <= 0.5 + 1e-3, "{p:?}: {}", spiral.distance(&p));
        }
        let length =
            |passes: &[Vec<Point3>]| Passes { passes: passes.to_vec(), ..Passes::default() }.length();
        let ends = 0.5 * (length(&of_rings[..1]) + length(&of_rings[6..]));
        let more = length(&found.passes) - length(&of_rings);
        assert!((more / ends - 1.0).abs() < 0.05, "{more} {ends}");
        // Links that cost less than that stay.
        let cheap = planned(of_rings.clone(), 0.8 * ends / 6.0);
        assert!(cheap.passes == of_rings && cheap.notes.is_empty());
    }

    /// Rings around two places have spirals of their own; the one around both goes into neither, and what
    /// does not lie beside the next all along is none's neighbour.
    #[test]
    fn nests_end_where_rings_part_or_leave_each_other() {
        let small = [4.0, 3.0, 2.0];
        let mut all = rings(0.0, &[11.0]);
        all.extend(rings(-5.0, &small));
        all.extend(rings(5.0, &small));
        let found = chains(&all);
        assert_eq!(found.iter().map(Vec::len).collect::<Vec<_>>(), [3, 3]);
        let apart =
            chains(&rings(0.0, &[9.0, 8.0]).into_iter().chain(rings(2.0, &[4.0, 3.0])).collect::<Vec<_>>());
        assert!(apart.is_empty());
        assert_eq!(planned(all, 20.0).passes.len(), 3);
    }
}
