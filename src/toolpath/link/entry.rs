//! The way to the first pass from beside the stock, where nothing stands: down at rapid rate, and in at the
//! feed. A plunge from above is slower where the stock ends nearby.
//!
//! Enters: the block of the stock, and where the pass begins, mm. Leaves: tips from outside up to there. The
//! tool comes in at the height of that place, and over what of the part stands higher; it stays as far from
//! the stock as rapid moves stay above it.

use crate::moves::chord::{Watch, reduce, sample_within_chord};
use crate::vocabulary::Setup;
use cutter::Solid;
use drop_cutter::DropCutter;
use geometry::{Aabb, Point2, Point3};
use work::monitor::Cancelled;

/// Share of the chord tolerance that sampling may use; thinning uses the rest.
const SAMPLING_SHARE: f64 = 0.4;

/// First sampling distance over the cutter's radius.
const SAMPLING: f64 = 0.1;

/// Halvings of the distance from the stock at which a tool comes down: fewer than its rounding allows.
const HALVINGS: usize = 40;

/// Where a tool may come down beside the stock.
#[derive(Debug, Clone)]
pub struct Sides {
    block: Aabb,
    cutter: Solid,
    clearance: f64,
    longest_link: f64,
}

impl Sides {
    /// Beside the block of the stock; `None` where it may be wider, or something else may stand beside it. On
    /// the stock a way in is no longer than a link.
    pub fn of(setup: &Setup<'_>, longest_link: f64) -> Option<Self> {
        let block = setup.settings.stock.filter(|_| setup.settings.may_enter_beside)?;
        let cutter = Solid::of_cutter(setup.cutter, None);
        Some(Self { block, cutter, clearance: setup.settings.clearance, longest_link })
    }

    /// How far from the block the axis of a cutter stays whose tip goes down to a height: the block's upper
    /// edge is as near as any of it, since cutters widen upward.
    fn away(&self, tip_z: f64) -> f64 {
        let edge = self.block.max.z - tip_z;
        let (mut near, mut clear) = (0.0, self.cutter.radius() + self.clearance);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (near + clear);
            let is_clear = self.cutter.outline_foot(middle, edge).distance >= self.clearance;
            *(if is_clear { &mut clear } else { &mut near }) = middle;
        }
        clear
    }

    /// The nearest place beside the stock; `None` where it is too far away.
    pub fn nearest(&self, to: &Point3) -> Option<Point2> {
        let away = self.away(to.z);
        let [low, high] = [self.block.min.xy().map(|x| x - away), self.block.max.xy().map(|x| x + away)];
        let places = [
            Point2::new(low.x, to.y),
            Point2::new(high.x, to.y),
            Point2::new(to.x, low.y),
            Point2::new(to.x, high.y),
        ];
        let distances = places.map(|place| ((place - to.xy()).norm(), place));
        let nearest = distances.into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
        nearest.filter(|(distance, _)| *distance <= self.longest_link + away).map(|(_, place)| place)
    }

    /// The tips from beside the stock up to and with the beginning of a pass.
    ///
    /// # Errors
    /// [`Cancelled`] when the monitor says so.
    pub fn way(
        &self,
        to: Point3,
        drop: &DropCutter<'_>,
        setup: &Setup<'_>,
    ) -> Result<Option<Vec<Point3>>, Cancelled> {
        let Some(from) = self.nearest(&to) else { return Ok(None) };
        let (span, tolerance) = (to.xy() - from, setup.settings.chord_tolerance);
        let mut locate = |t: f64| {
            let p = from + span * t;
            let z = drop.at(p.x, p.y).map_or(to.z, |drop| drop.tip_z.max(to.z));
            Some(Point3::new(p.x, p.y, z))
        };
        let mut watch = Watch::new(setup.monitor);
        let (fine, step) = (SAMPLING_SHARE * tolerance, SAMPLING * setup.cutter.radius() / span.norm());
        let mut tips = sample_within_chord(0.0, 1.0, step, fine, &mut locate, &mut watch)?;
        let last = tips.len() - 1;
        // What stands higher than where the pass begins, up to there, is the part itself; the pass keeps
        // within its tolerance of it.
        if (tips[last].z - to.z).abs() > tolerance {
            return Ok(None);
        }
        tips[last] = to;
        Ok(Some(reduce(&tips, tolerance - fine, &mut watch)?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cutter::Cutter;

    #[test]
    fn a_tool_comes_down_as_far_from_the_edge_of_the_block_as_rapids_stay_above_it() {
        let block = Aabb { min: Point3::new(0.0, 0.0, -9.0), max: Point3::new(20.0, 20.0, 1.0) };
        let sides = |cutter: &Cutter| Sides {
            block,
            cutter: Solid::of_cutter(cutter, None),
            clearance: 2.0,
            longest_link: 1.0,
        };
        let ball = sides(&Cutter::ball(6.0).unwrap());
        // Its centre passes the edge 2 mm above it, level with it, and 3 mm below.
        for (tip, away) in [(0.0, 21f64.sqrt()), (-2.0, 5.0), (-5.0, 5.0)] {
            assert!((ball.away(tip) - away).abs() < 1e-9, "{tip}: {}", ball.away(tip));
        }
        let place = ball.nearest(&Point3::new(1.0, 10.0, 0.0)).unwrap();
        assert!((place - Point2::new(-21f64.sqrt(), 10.0)).norm() < 1e-9, "{place}");
        let flat = sides(&Cutter::flat(6.0).unwrap());
        assert!((flat.away(0.0) - 5.0).abs() < 1e-9 && flat.nearest(&Point3::new(3.1, 10.0, 0.0)).is_none());
    }
}
