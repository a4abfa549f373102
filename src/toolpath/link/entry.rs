//! The way to the first pass from beside the stock, where nothing stands: down at rapid rate, and in at the
//! feed. A plunge from above is slower where the stock ends nearby.
//!
//! Enters: the block of the stock, and where the pass begins, mm. Leaves: tips from outside up to there. The
//! tool comes in at the height of that place, and over what of the part stands higher; it stays as far from
//! the stock as rapid moves stay above it.

use crate::moves::chord::{Watch, reduce, sample_within_chord};
use crate::vocabulary::Setup;
use drop_cutter::DropCutter;
use geometry::{Point2, Point3};
use work::monitor::Cancelled;

/// Share of the chord tolerance that sampling may use; thinning uses the rest.
const SAMPLING_SHARE: f64 = 0.4;

/// First sampling distance over the cutter's radius.
const SAMPLING: f64 = 0.1;

/// Where a tool may come down beside the stock.
#[derive(Debug, Clone, Copy)]
pub struct Sides {
    /// Outside of these places of the plan view the tool is clear.
    corners: [Point2; 2],
    /// No way in is longer, mm.
    longest: f64,
}

impl Sides {
    /// Beside the block of the stock; `None` where it may be wider, or something else may stand beside it. On
    /// the stock a way in is no longer than a link.
    pub fn of(setup: &Setup<'_>, longest_link: f64) -> Option<Self> {
        let block = setup.settings.stock.filter(|_| setup.settings.may_enter_beside)?;
        let away = setup.cutter.radius() + setup.settings.clearance;
        let corners = [block.min.xy().map(|x| x - away), block.max.xy().map(|x| x + away)];
        Some(Self { corners, longest: longest_link + away })
    }

    /// The nearest place beside the stock; `None` where it is too far away.
    pub fn nearest(&self, to: &Point3) -> Option<Point2> {
        let [low, high] = self.corners;
        let places = [
            Point2::new(low.x, to.y),
            Point2::new(high.x, to.y),
            Point2::new(to.x, low.y),
            Point2::new(to.x, high.y),
        ];
        let distances = places.map(|place| ((place - to.xy()).norm(), place));
        let nearest = distances.into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
        nearest.filter(|(distance, _)| *distance <= self.longest).map(|(_, place)| place)
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
