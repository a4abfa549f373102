//! The ridges of a cut along the normals and the remnants along its borders, and nothing else.

use super::closer::Greatest;
use super::ridges::NEARLY;
use super::{Along, Grouped, Net, Seen};
use crate::figures::RidgePlace;
use crate::ridge_map::RidgeMap;
use crate::ridges::{Highest, scallop_figures};
use crate::tracks::Tracks;
use work::monitor::{Cancelled, Monitor};

impl Along<'_> {
    /// The ridges between the places of a net, and the remnants along its border.
    ///
    /// # Errors
    /// [`Cancelled`] when the monitor says so.
    pub(crate) fn ridges(&self, net: &Net, monitor: &dyn Monitor) -> Result<RidgeMap, Cancelled> {
        let limits = self.limits;
        let tracks = Tracks::new(self.path, self.cutters);
        let mut inspection = self.inspection(&tracks);
        inspection.finder.close = NEARLY;
        let Seen { samples, triangles, of_triangle, on_border } =
            inspection.look(net, &vec![true; net.places.len()], monitor)?;
        // Those that are too tall for scallops count as well: plans are corrected by them.
        let of_triangle = Grouped::of(of_triangle);
        let mut greatest = Greatest::default();
        of_triangle.items.iter().for_each(|crossing| greatest.look_at_ridge(crossing));
        let mut above: Vec<RidgePlace> =
            of_triangle.items.iter().map(|c| RidgePlace { at: c.at, height: c.height }).collect();
        for (t, sides) in triangles.iter().zip(&on_border) {
            for k in (0..3).filter(|&k| sides[k]) {
                let sample = &samples[t[k] as usize];
                greatest.look_at(sample, limits);
                let height = sample.hit.map_or(0.0, |hit| hit.deviation);
                above.push(RidgePlace { at: sample.place.point, height });
            }
        }
        above.retain(|place| place.height > limits.scallop && place.height <= limits.uncut);
        let ridge_samples = ridge_samples(&of_triangle);
        let of_one =
            |(k, t): (usize, &[u32; 3])| (t.map(|v| samples[v as usize]), on_border[k], of_triangle.group(k));
        let all = triangles.iter().enumerate().map(of_one);
        let left = inspection.search(all, &mut greatest, self.asked, monitor)?;
        let highest = greatest.ridge.map(|(height, at, lower)| Highest {
            height,
            at,
            possible: height + left.ridge + lower,
        });
        let border = greatest.place.map_or(0.0, |(height, _)| height);
        let scallop = scallop_figures(&ridge_samples, highest, limits);
        Ok(RidgeMap { above, border, scallop, is_close: false })
    }
}

/// Heights and lengths of ridges, mm.
pub(super) fn ridge_samples(crossings: &Grouped<super::Crossing>) -> Vec<[f32; 2]> {
    crossings.items.iter().map(|c| [c.height as f32, c.length as f32]).collect()
}
