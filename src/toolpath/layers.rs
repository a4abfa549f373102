//! Roughing by levels: the passes of a strategy, held up at one level after the other, from the top of the
//! stock down.
//!
//! Enters: passes of an upright cutter on the part. Leaves: for each level the stretches of them that lie
//! below the level above, no lower than this one. So each level cuts no deeper than it lies below the one
//! above, but for what passes left between them, and the last one leaves what the passes do.

use std::mem;

use geometry::{Point3, distance_to_segment};
use work::monitor::{self, Cancelled, Monitor};

/// Passes that are cut before any of the next layer.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Layer {
    /// No move on the surface goes lower than this, mm.
    pub floor: f64,
    /// Runs of tips, mm.
    pub passes: Vec<Vec<Point3>>,
}

impl Layer {
    /// All passes in one step down.
    pub fn whole(passes: Vec<Vec<Point3>>) -> Self {
        Self { floor: f64::NEG_INFINITY, passes }
    }
}

/// Tips along a level that lie no farther from the straight way past them, mm, are left out: more would add up.
const STRAIGHT: f64 = 1e-9;

/// Most levels: more are a mistake of the unit.
pub(crate) const MOST_LEVELS: f64 = 1e4;

/// Heights at which passes are held up, evenly apart.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Levels {
    top: f64,
    lowest: f64,
    count: f64,
}

impl Levels {
    /// From the top of the stock to the lowest place at which a pass meets it, none more than `stepdown` below
    /// the one above, mm; `meets` tells how high a tip cuts stock at the lowest, `None` where it is in the air:
    /// beside the stock a tool may dip far.
    pub fn new(
        passes: &[Vec<Point3>],
        top: f64,
        stepdown: f64,
        meets: impl Fn(&Point3) -> Option<f64>,
    ) -> Self {
        let lowest = passes.iter().flatten().filter_map(meets).fold(top, f64::min);
        Self { top, lowest, count: ((top - lowest) / stepdown).ceil().max(1.0) }
    }

    /// How many there are.
    pub fn count(&self) -> f64 {
        self.count
    }

    /// The layers of passes, from the top of the stock down; the last one leaves what the passes do.
    ///
    /// # Errors
    /// When cancelled.
    pub fn layers(&self, passes: &[Vec<Point3>], monitor: &dyn Monitor) -> Result<Vec<Layer>, Cancelled> {
        let count = self.count as usize;
        let level = |k: usize| match k {
            0 => f64::INFINITY,
            _ if k == count => f64::NEG_INFINITY,
            _ => self.top + (self.lowest - self.top) * k as f64 / self.count,
        };
        let layer = |k: usize| {
            monitor::check(monitor)?;
            let (floor, ceiling) = (level(k + 1), level(k));
            let passes = passes.iter().flat_map(|pass| stretches(pass, floor, ceiling)).collect();
            Ok(Layer { floor, passes })
        };
        (0..count).map(layer).collect()
    }
}

/// The stretches of a pass below the `ceiling`, none of their tips below the `floor`.
fn stretches(pass: &[Point3], floor: f64, ceiling: f64) -> Vec<Vec<Point3>> {
    let (mut found, mut open): (Vec<Vec<Point3>>, Vec<Point3>) = (Vec::new(), Vec::new());
    for ends in pass.windows(2) {
        let (from, way) = (ends[0], ends[1] - ends[0]);
        let crossing = |z: f64| Some((z - from.z) / way.z).filter(|t| *t > 0.0 && *t < 1.0);
        let mut places = vec![0.0, 1.0];
        places.extend(crossing(floor).into_iter().chain(crossing(ceiling)));
        places.sort_by(f64::total_cmp);
        for piece in places.windows(2) {
            let [a, b] = [from + way * piece[0], from + way * piece[1]];
            if nalgebra::center(&a, &b).z >= ceiling {
                found.push(mem::take(&mut open));
                continue;
            }
            let held = |tip: Point3| Point3::new(tip.x, tip.y, tip.z.max(floor));
            if open.is_empty() {
                open.push(held(a));
            }
            let next = held(b);
            if let [.., before, last] = open[..]
                && before.z == floor
                && next.z == floor
                && distance_to_segment(&last, &before, &next) <= STRAIGHT
            {
                open.pop();
            }
            open.push(next);
        }
    }
    found.push(open);
    found.retain_mut(|stretch| {
        stretch.dedup();
        stretch.len() > 1
    });
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use work::monitor::Silent;

    /// Over a ridge of 10 mm from the ground up to 9: three levels of 4, 4 and 4 mm below a top of 12.
    #[test]
    fn passes_over_a_ridge_are_held_up_and_cut_off() {
        let tip = Point3::new;
        let pass = vec![tip(0.0, 0.0, 0.0), tip(10.0, 0.0, 9.0), tip(20.0, 0.0, 0.0)];
        let passes = [pass];
        let found = Levels::new(&passes, 12.0, 5.0, |tip| Some(tip.z)).layers(&passes, &Silent).unwrap();
        let floors: Vec<f64> = found.iter().map(|layer| layer.floor).collect();
        assert_eq!(floors, [8.0, 4.0, f64::NEG_INFINITY]);
        // Above the level: on the ridge itself.
        let near = |a: &[Point3], b: &[[f64; 2]]| {
            assert_eq!(a.len(), b.len(), "{a:?}");
            for (a, [x, z]) in a.iter().zip(b) {
                assert!((a.x - x).abs() < 1e-9 && (a.z - z).abs() < 1e-9, "{a:?}");
            }
        };
        let foot = |z: f64| z / 0.9;
        let [first, second, third] = [0, 1, 2].map(|k| &found[k].passes);
        assert_eq!([first.len(), second.len(), third.len()], [1, 2, 2]);
        near(&first[0], &[[0.0, 8.0], [foot(8.0), 8.0], [10.0, 9.0], [20.0 - foot(8.0), 8.0], [20.0, 8.0]]);
        near(&second[0], &[[0.0, 4.0], [foot(4.0), 4.0], [foot(8.0), 8.0]]);
        near(&third[1], &[[20.0 - foot(4.0), 4.0], [20.0, 0.0]]);
    }

    /// Beyond the stock, at x = 5, the tool dips to -4: levels do not lead there.
    #[test]
    fn levels_end_where_stock_is_met() {
        let passes =
            [vec![Point3::new(0.0, 0.0, -2.0), Point3::new(5.0, 0.0, -2.0), Point3::new(6.0, 0.0, -4.0)]];
        let levels = Levels::new(&passes, 0.0, 1.0, |tip| (tip.x <= 5.0).then_some(tip.z));
        let heights = |layer: &Layer| layer.passes[0].iter().map(|tip| tip.z).fold(0.0, f64::min);
        let lowest: Vec<f64> = levels.layers(&passes, &Silent).unwrap().iter().map(heights).collect();
        assert_eq!(lowest, [-1.0, -4.0]);
    }

    #[test]
    fn a_level_pass_is_repeated_on_every_level() {
        let pass = vec![Point3::new(0.0, 0.0, -3.0), Point3::new(9.0, 0.0, -3.0)];
        let passes = [pass];
        let found = Levels::new(&passes, 0.0, 1.0, |tip| Some(tip.z)).layers(&passes, &Silent).unwrap();
        let heights: Vec<f64> = found.iter().map(|layer| layer.passes[0][0].z).collect();
        assert_eq!(heights, [-1.0, -2.0, -3.0]);
    }
}
