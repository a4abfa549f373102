//! What supporting planes of a convex function of two variables leave open.
//!
//! Enters: a rectangle of places s along a ray, mm, and times t, and supports of the function there. Leaves: the
//! convex polygon in which the function may be zero or less, and its centroid. A cut through the centroid leaves
//! at most 1 − 1/e of an area (Grünbaum, "Partitions of mass-distributions and of convex bodies by hyperplanes",
//! 1960).

/// Corners at once, but for odd ones.
const USUALLY: usize = 16;

/// A convex polygon over place and time.
pub(super) struct SupportArea {
    /// Counter-clockwise; time in units of `1 / scale`.
    corners: Vec<[f64; 2]>,
    cut: Vec<[f64; 2]>,
    scale: f64,
}

impl SupportArea {
    /// The whole of two ranges; a unit of time is as long as `scale` mm.
    pub fn new([low, high]: [f64; 2], [from, to]: [f64; 2], scale: f64) -> Self {
        let [from, to] = [from * scale, to * scale];
        let mut corners = Vec::with_capacity(USUALLY);
        corners.extend([[low, from], [high, from], [high, to], [low, to]]);
        Self { corners, cut: Vec::with_capacity(USUALLY), scale }
    }

    /// Leaves where the plane with this value and these slopes by s and t at a place `[s, t]` is zero or less.
    pub fn keep(&mut self, [s, t]: [f64; 2], value: f64, [by_s, by_t]: [f64; 2]) {
        let height = |p: &[f64; 2]| value + by_s * (p[0] - s) + by_t * (p[1] / self.scale - t);
        self.cut.clear();
        let Some(mut last) = self.corners.last().map(|p| (*p, height(p))) else { return };
        for corner in &self.corners {
            let here = (*corner, height(corner));
            if (last.1 > 0.0) != (here.1 > 0.0) {
                let share = last.1 / (last.1 - here.1);
                self.cut.push([0, 1].map(|k| last.0[k] + (here.0[k] - last.0[k]) * share));
            }
            if here.1 <= 0.0 {
                self.cut.push(here.0);
            }
            last = here;
        }
        std::mem::swap(&mut self.corners, &mut self.cut);
    }

    /// The corner `[s, t]` with the least s.
    pub fn lowest(&self) -> Option<[f64; 2]> {
        let lowest = self.corners.iter().min_by(|p, q| p[0].total_cmp(&q[0]))?;
        Some([lowest[0], lowest[1] / self.scale])
    }

    /// The centroid `[s, t]`; `None` where the polygon holds no circle with this radius, mm.
    pub fn middle(&self, radius: f64) -> Option<[f64; 2]> {
        let (first, others) = self.corners.split_first()?;
        let away = |p: &[f64; 2]| [p[0] - first[0], p[1] - first[1]];
        let (mut area, mut moment, mut far) = (0.0, [0.0; 2], 0.0f64);
        for pair in others.windows(2) {
            let [p, q] = [away(&pair[0]), away(&pair[1])];
            let twice = p[0] * q[1] - p[1] * q[0];
            area += twice;
            moment = [0, 1].map(|k| moment[k] + twice * (p[k] + q[k]));
            far = [p, q].iter().map(|p| p[0].hypot(p[1])).fold(far, f64::max);
        }
        // With one, and a corner so far away, the triangle between them would be as large.
        if area <= radius * far || area.is_nan() {
            return None;
        }
        let [s, t] = [0, 1].map(|k| first[k] + moment[k] / (3.0 * area));
        Some([s, t / self.scale])
    }
}
