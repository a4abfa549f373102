//! Directions measured or computed at scattered places, as a smooth line field.
//!
//! Enters: places of a plane with a direction each, where t and −t are the same. Leaves: the direction
//! and its confidence anywhere, by moving least squares of `(cos 2θ, sin 2θ)`, which is the same for t
//! and −t, so that nothing has to be oriented: a plane is fitted to the [`NEAREST`] samples, weighted
//! by a smooth kernel that ends at the next one, and half the angle of its value is taken. Its length
//! is below 1 where the samples disagree and 0 at singular points; it is the confidence.
//!
//! Where no sample is near (farther than [`REACH`] times the usual distance of samples) their weighted
//! mean continues the field, with a confidence that falls with the square of the distance.
//!
//! Limits: linear fields of `2θ` are reproduced; the error is of second order in the distance of samples.

/// Samples whose coordinates differ by no more than this, mm or of a parameter, stand on a line: less is lost
/// in a division.
const NARROWEST: f64 = 1e-12;

/// A direction at a place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LineSample {
    /// Where.
    pub at: [f64; 2],
    /// The direction, of any length but 0.
    pub line: [f64; 2],
    /// How much it counts, ≥ 0.
    pub weight: f64,
}

/// The plane in which scattered directions are given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SamplePlane {
    /// The plan view, x and y in mm.
    Plan,
    /// The parameters u and v of a patch.
    Parameters,
}

/// A field of directions between scattered samples.
#[derive(Debug, Clone, PartialEq)]
pub struct LineField {
    plane: SamplePlane,
    /// By bucket; places and lines in units of `scale`.
    samples: Vec<LineSample>,
    scale: [f64; 2],
    origin: [f64; 2],
    buckets: [usize; 2],
    bucket_size: [f64; 2],
    /// Where each bucket's samples begin.
    starts: Vec<usize>,
    /// Lengths of the lines as given, in units of `scale`.
    lengths: Vec<f64>,
    /// Usual distance of samples, in units of `scale`.
    pitch: f64,
}

/// Samples that a place listens to: three unknowns of a plane, and as many again against noise. More
/// smooth finer changes away.
const NEAREST: usize = 9;

/// Usual distances of samples to the nearest one within which a plane is fitted.
const REACH: f64 = 1.5;

/// A plane is fitted where the second moments of places leave at least this much of the smaller one;
/// on a line of samples the mean serves.
const LEAST_SPREAD: f64 = 1e-3;

impl LineField {
    /// From samples; those that are not finite, of length 0 or of no weight are left out. `None` when
    /// none are left.
    pub fn new(plane: SamplePlane, samples: &[LineSample]) -> Option<Self> {
        let kept: Vec<LineSample> = samples.iter().copied().filter(usable).collect();
        let first = *kept.first()?;
        let (mut lo, mut hi) = (first.at, first.at);
        for s in &kept {
            for c in 0..2 {
                (lo[c], hi[c]) = (lo[c].min(s.at[c]), hi[c].max(s.at[c]));
            }
        }
        // Parameters have no common unit: each counts by its range.
        let extent = [0, 1].map(|c| if hi[c] - lo[c] > NARROWEST { hi[c] - lo[c] } else { 1.0 });
        let scale = match plane {
            SamplePlane::Plan => [extent[0].max(extent[1]); 2],
            SamplePlane::Parameters => extent,
        };
        let scaled = |mut s: LineSample| {
            for c in 0..2 {
                s.at[c] = (s.at[c] - lo[c]) / scale[c];
                s.line[c] /= scale[c];
            }
            let length = s.line[0].hypot(s.line[1]);
            s.line = s.line.map(|x| x / length);
            (s, length)
        };
        let mut kept: Vec<(LineSample, f64)> = kept.into_iter().map(scaled).collect();
        let size = [0, 1].map(|c| (hi[c] - lo[c]) / scale[c]);
        // About two samples a bucket, by area, or by length where they stand on a line.
        let wanted = (0.5 * kept.len() as f64).max(1.0);
        let (long, short) = (size[0].max(size[1]), size[0].min(size[1]));
        let side =
            if short * wanted > long { (long * short / wanted).sqrt() } else { long / wanted }.max(1e-6);
        let buckets = size.map(|s| ((s / side).ceil() as usize).clamp(1, 4096));
        let bucket_size = [0, 1].map(|c| (size[c] / buckets[c] as f64).max(1e-9));
        let mut field = Self {
            plane,
            samples: Vec::new(),
            scale,
            origin: lo,
            buckets,
            bucket_size,
            starts: vec![0; buckets[0] * buckets[1] + 1],
            lengths: Vec::new(),
            pitch: 0.0,
        };
        kept.sort_by_key(|(s, _)| field.bucket(s.at));
        for (s, _) in &kept {
            let bucket = field.bucket(s.at);
            field.starts[bucket + 1] += 1;
        }
        for k in 1..field.starts.len() {
            field.starts[k] += field.starts[k - 1];
        }
        (field.samples, field.lengths) = kept.into_iter().unzip();
        field.pitch = field.usual_distance();
        Some(field)
    }

    /// The plane of the samples.
    pub fn plane(&self) -> SamplePlane {
        self.plane
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.samples.len()
    }

    /// The samples as they were given, lengths too, in no order.
    pub fn given(&self) -> impl Iterator<Item = LineSample> {
        self.samples.iter().zip(&self.lengths).map(|(s, length)| LineSample {
            at: [0, 1].map(|c| self.origin[c] + s.at[c] * self.scale[c]),
            line: [0, 1].map(|c| s.line[c] * length * self.scale[c]),
            weight: s.weight,
        })
    }

    /// Never: a field has at least one sample.
    pub fn is_empty(&self) -> bool {
        self.samples.is_empty()
    }

    /// Least and greatest coordinates of the samples, `[[from, to]; 2]`.
    pub fn bounds(&self) -> [[f64; 2]; 2] {
        [0, 1].map(|c| {
            let at = self.samples.iter().map(|s| self.origin[c] + s.at[c] * self.scale[c]);
            at.fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], x| [lo.min(x), hi.max(x)])
        })
    }

    /// How many samples lie in a rectangle, borders included.
    pub fn count_inside(&self, [[u0, u1], [v0, v1]]: [[f64; 2]; 2]) -> usize {
        let place = |s: &LineSample| [0, 1].map(|c| self.origin[c] + s.at[c] * self.scale[c]);
        // A sample on the border comes back from its unit within rounding.
        let (du, dv) = (1e-9 * (u1 - u0), 1e-9 * (v1 - v0));
        let inside = |[u, v]: [f64; 2]| u >= u0 - du && u <= u1 + du && v >= v0 - dv && v <= v1 + dv;
        self.samples.iter().filter(|s| inside(place(s))).count()
    }

    /// The direction at a place (not of unit length in parameters) and its confidence, 0 to the
    /// greatest weight of samples; `None` at singular points.
    pub fn at(&self, place: [f64; 2]) -> Option<([f64; 2], f64)> {
        let p = [0, 1].map(|c| (place[c] - self.origin[c]) / self.scale[c]);
        let near = self.nearest(p, NEAREST + 1);
        let (last, _) = *near.last()?;
        // The kernel ends at the last one, or beyond the last where all are needed.
        let reach = if near.len() > NEAREST { last.sqrt() } else { 2.0 * last.sqrt() + self.pitch };
        let distance = near[0].0.sqrt();
        // Moments of the weighted samples about the place, and those of cos 2θ and sin 2θ.
        let mut m = [0.0; 6];
        let mut sides = [[0.0; 3]; 2];
        let mut counted = 0.0;
        for &(square, k) in &near {
            let s = &self.samples[k];
            let kernel = kernel(square.sqrt() / reach.max(1e-300));
            let w = s.weight * kernel;
            counted += kernel;
            let (x, y) = (s.at[0] - p[0], s.at[1] - p[1]);
            for (m, term) in m.iter_mut().zip([1.0, x, y, x * x, x * y, y * y]) {
                *m += w * term;
            }
            let double = [s.line[0].powi(2) - s.line[1].powi(2), 2.0 * s.line[0] * s.line[1]];
            for (side, d) in sides.iter_mut().zip(double) {
                for (side, term) in side.iter_mut().zip([1.0, x, y]) {
                    *side += w * d * term;
                }
            }
        }
        if m[0] <= 0.0 {
            return None;
        }
        let mean = sides.map(|side| side[0] / m[0]);
        let far = REACH * self.pitch;
        let double = if distance <= far { plane_value(&m, &sides).unwrap_or(mean) } else { mean };
        let length = double[0].hypot(double[1]);
        if length < 1e-9 {
            return None;
        }
        let half = 0.5 * double[1].atan2(double[0]);
        let line = [half.cos() * self.scale[0], half.sin() * self.scale[1]];
        let nearness = if distance > far { (far / distance).powi(2) } else { 1.0 };
        Some((line, length.min(1.0) * nearness * m[0] / counted))
    }

    fn bucket(&self, p: [f64; 2]) -> usize {
        let [i, j] = self.bucket_of(p);
        j * self.buckets[0] + i
    }

    fn bucket_of(&self, p: [f64; 2]) -> [usize; 2] {
        [0, 1].map(|c| ((p[c] / self.bucket_size[c]).max(0.0) as usize).min(self.buckets[c] - 1))
    }

    /// The `count` nearest samples, nearest first: squared distance and index. Rings of buckets are
    /// looked through until the next one is farther than the last found.
    fn nearest(&self, p: [f64; 2], count: usize) -> Vec<(f64, usize)> {
        let [ci, cj] = self.bucket_of(p).map(|k| k as isize);
        let mut found: Vec<(f64, usize)> = Vec::with_capacity(count + 1);
        let rings = self.buckets[0].max(self.buckets[1]) as isize;
        let side = self.bucket_size[0].min(self.bucket_size[1]);
        // From outside the buckets' rectangle every ring is nearer than its number tells; never farther.
        for ring in 0..=rings {
            if found.len() == count && found[count - 1].0 <= ((ring - 1) as f64 * side).max(0.0).powi(2) {
                break;
            }
            for j in (cj - ring).max(0)..=(cj + ring).min(self.buckets[1] as isize - 1) {
                let whole = (j - cj).abs() == ring;
                let step = if whole { 1 } else { (2 * ring).max(1) };
                let mut i = ci - ring;
                while i <= ci + ring {
                    if i >= 0 && i < self.buckets[0] as isize {
                        let bucket = j as usize * self.buckets[0] + i as usize;
                        for k in self.starts[bucket]..self.starts[bucket + 1] {
                            let at = self.samples[k].at;
                            let square = (at[0] - p[0]).powi(2) + (at[1] - p[1]).powi(2);
                            let place = found.partition_point(|f| (f.0, f.1) < (square, k));
                            if place < count {
                                found.insert(place, (square, k));
                                found.truncate(count);
                            }
                        }
                    }
                    i += step;
                }
            }
        }
        found
    }

    /// Median distance of a sample to its nearest neighbour, over a thousand of them.
    fn usual_distance(&self) -> f64 {
        const TAKEN: usize = 1000;
        let step = self.samples.len().div_ceil(TAKEN).max(1);
        let mut distances: Vec<f64> = (0..self.samples.len())
            .step_by(step)
            .filter_map(|k| self.nearest(self.samples[k].at, 2).get(1).map(|n| n.0.sqrt()))
            .collect();
        distances.sort_by(f64::total_cmp);
        // A single sample speaks for its unit.
        distances.get(distances.len() / 2).copied().filter(|d| *d > 0.0).unwrap_or(1.0)
    }
}

fn usable(s: &LineSample) -> bool {
    let finite = s.at.iter().chain(&s.line).all(|x| x.is_finite()) && s.weight.is_finite();
    finite && s.weight > 0.0 && s.line[0].hypot(s.line[1]) > 0.0
}

/// Wendland's C² kernel of the distance over its reach.
fn kernel(t: f64) -> f64 {
    if t < 1.0 { (1.0 - t).powi(4) * (4.0 * t + 1.0) } else { 0.0 }
}

/// Values at the origin of the planes fitted by moments `[1, x, y, xx, xy, yy]`; `None` where the
/// places are too nearly on a line.
fn plane_value(m: &[f64; 6], sides: &[[f64; 3]; 2]) -> Option<[f64; 2]> {
    let centre = [m[1] / m[0], m[2] / m[0]];
    let xx = m[3] / m[0] - centre[0] * centre[0];
    let xy = m[4] / m[0] - centre[0] * centre[1];
    let yy = m[5] / m[0] - centre[1] * centre[1];
    let determinant = xx * yy - xy * xy;
    if determinant <= LEAST_SPREAD * (0.5 * (xx + yy)).powi(2) {
        return None;
    }
    Some(sides.map(|side| {
        let mean = side[0] / m[0];
        let gx = side[1] / m[0] - mean * centre[0];
        let gy = side[2] / m[0] - mean * centre[1];
        let (sx, sy) = ((yy * gx - xy * gy) / determinant, (xx * gy - xy * gx) / determinant);
        mean - sx * centre[0] - sy * centre[1]
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `n` × `n` places of [0, 4] × [0, 2], shaken by up to `shake` of their distance, every third line
    /// turned round.
    fn samples(n: usize, shake: f64, angle: impl Fn(f64, f64) -> f64) -> Vec<LineSample> {
        (0..n * n)
            .map(|k| {
                let noise = |salt: usize| ((k * 7919 + salt * 104_729) % 1009) as f64 / 1009.0 - 0.5;
                let x = 4.0 * ((k % n) as f64 + 0.5 + shake * noise(1)) / n as f64;
                let y = 2.0 * ((k / n) as f64 + 0.5 + shake * noise(2)) / n as f64;
                let sign = if k % 3 == 0 { -2.0 } else { 1.0 };
                let a = angle(x, y);
                LineSample { at: [x, y], line: [sign * a.cos(), sign * a.sin()], weight: 1.0 }
            })
            .collect()
    }

    fn error(field: &LineField, angle: impl Fn(f64, f64) -> f64) -> f64 {
        let mut worst = 0.0f64;
        for k in 0..900 {
            let (x, y) = (4.0 * (k % 30) as f64 / 29.0, 2.0 * (k / 30) as f64 / 29.0);
            let (line, _) = field.at([x, y]).unwrap();
            let a = angle(x, y);
            worst = worst.max((line[0] * a.sin() - line[1] * a.cos()).abs() / line[0].hypot(line[1]));
        }
        worst
    }

    #[test]
    fn a_smooth_field_comes_back_with_second_order() {
        let angle = |x: f64, y: f64| 0.7 * x + (1.5 * y).sin();
        let fine: Vec<f64> = [16, 32, 64]
            .iter()
            .map(|&n| error(&LineField::new(SamplePlane::Plan, &samples(n, 0.6, angle)).unwrap(), angle))
            .collect();
        assert!(fine[2] < 0.01 && fine[0] / fine[2] > 8.0, "{fine:?}");
    }

    #[test]
    fn lines_turned_round_and_a_half_integer_point_are_no_trouble() {
        let angle = |x: f64, y: f64| 0.5 * (y - 1.0).atan2(x - 2.0);
        let field = LineField::new(SamplePlane::Parameters, &samples(41, 0.0, angle)).unwrap();
        let (line, sure) = field.at([3.5, 1.7]).unwrap();
        let a = angle(3.5, 1.7);
        assert!((line[0] * a.sin() - line[1] * a.cos()).abs() < 1e-2 * line[0].hypot(line[1]));
        assert!(sure > 0.95, "{sure}");
        let doubt = field.at([2.0, 1.0]).map_or(0.0, |(_, sure)| sure);
        assert!(doubt < 0.5, "{doubt}");
    }

    #[test]
    fn far_places_follow_the_nearest_samples_with_little_confidence() {
        let field = LineField::new(SamplePlane::Plan, &samples(20, 0.3, |_, _| 0.4)).unwrap();
        let (line, sure) = field.at([14.0, 1.0]).unwrap();
        assert!((line[1] / line[0] - 0.4f64.tan()).abs() < 1e-9 && sure < 0.01, "{sure}");
        let single = LineField::new(
            SamplePlane::Plan,
            &[LineSample { at: [5.0, 5.0], line: [0.0, -3.0], weight: 2.0 }],
        )
        .unwrap();
        let (line, sure) = single.at([5.0, 5.0]).unwrap();
        assert!(line[0].abs() < 1e-9 && line[1].abs() > 0.5 && (sure - 2.0).abs() < 1e-9);
        // All on a line: no plane, the mean serves.
        let row: Vec<LineSample> =
            (0..30).map(|k| LineSample { at: [k as f64, 0.0], line: [1.0, 1.0], weight: 1.0 }).collect();
        let (line, _) = LineField::new(SamplePlane::Plan, &row).unwrap().at([3.3, 0.5]).unwrap();
        assert!((line[0] - line[1]).abs() < 1e-9 * line[0].abs());
    }

    #[test]
    fn the_nearest_are_those_of_brute_force() {
        let all = samples(17, 0.9, |x, y| x + y);
        let field = LineField::new(SamplePlane::Plan, &all).unwrap();
        for p in [[0.1, 0.2], [0.5, 0.25], [-1.0, 0.9], [2.0, 0.0], [0.99, 0.51]] {
            let mut every: Vec<(f64, usize)> = (0..field.len())
                .map(|k| {
                    let at = field.samples[k].at;
                    ((at[0] - p[0]).powi(2) + (at[1] - p[1]).powi(2), k)
                })
                .collect();
            every.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            assert_eq!(field.nearest(p, 10), every[..10]);
        }
        assert_eq!(field.count_inside([[0.0, 4.0], [0.0, 2.0]]), 289);
        assert_eq!(field.count_inside([[5.0, 6.0], [0.0, 2.0]]), 0);
        assert!(LineField::new(SamplePlane::Plan, &[]).is_none());
    }
}
