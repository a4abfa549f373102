//! Many samples at once: the distance from the track of a ball, in f32 lanes.
//!
//! All lengths are local to a small cube, so that rounding stays below 2e-7 of the ball's radius.

use super::moves::{MotionPart, MotionParts};
use geometry::{Point3, Vector3};

/// Samples at once: 4 × 4 × 4.
pub(super) const LANES: usize = 64;

/// Tracks may rise this steeply above the level for the strip above them in f32; steeper ones lose digits.
const STEEPEST: f64 = 16.0;

/// Ends of a track farther off than this, mm, need no exactness.
const FAR: f64 = 1e6;

type Triple = [f32; 3];

/// A track of the ball's middle, and the strip above it, as they look from the middle of a small cube.
pub(super) struct Kernel {
    part: u32,
    /// From the foot on the line of the track to the middle, and along the line.
    from_line: Triple,
    along: Triple,
    ends: [f32; 2],
    strip: Option<Strip>,
}

struct Strip {
    /// Across the plane of the strip, from it to the middle.
    from_plane: Triple,
    axis: Triple,
    across: Triple,
    ends: [f32; 2],
    /// Height of the track under the middle, and its slope.
    height: f32,
    slope: f32,
}

/// The nearest track for each sample.
pub(super) struct Lanes {
    pub(super) squared: [f32; LANES],
    pub(super) part: [u32; LANES],
}

fn narrow(v: Vector3) -> Triple {
    v.map(|x| x as f32).into()
}

/// A direction and a length; no direction for none.
fn unit(v: Vector3) -> (Vector3, f64) {
    let length = v.norm();
    (if length > 0.0 { v / length } else { Vector3::zeros() }, length)
}

impl Kernel {
    /// `None` where within `reach` of `centre` more than the ball and its shank counts.
    pub(super) fn new(
        parts: &MotionParts,
        part: &MotionPart,
        index: u32,
        centre: &Point3,
        reach: f64,
    ) -> Option<Self> {
        parts.solid.ball()?;
        let below = parts.is_below(part, centre, reach);
        if !below && !parts.is_strip(part, centre, reach) {
            return None;
        }
        let (start, way, axis) = parts.track(part);
        let away = centre - start;
        let ends = |at: f64, length: f64| [-at, length - at].map(|x| x.clamp(-FAR, FAR) as f32);
        let (along, length) = unit(way);
        let at = away.dot(&along);
        let (from_line, ends_of_line) = (narrow(away - along * at), ends(at, length));
        let rise = way.dot(&axis);
        let strip = if below {
            None
        } else {
            let (across, width) = unit(way - axis * rise);
            if rise.abs() > STEEPEST * width && width > 0.0 {
                return None;
            }
            let slope = if width > 0.0 { rise / width } else { 0.0 };
            let lowest = if width > 0.0 { 0.0 } else { rise.min(0.0) };
            let (x, y) = (away.dot(&across), away.dot(&axis));
            Some(Strip {
                from_plane: narrow(away - across * x - axis * y),
                axis: narrow(axis),
                across: narrow(across),
                ends: ends(x, width),
                height: (slope * x + lowest - y) as f32,
                slope: slope as f32,
            })
        };
        Some(Self { part: index, from_line, along: narrow(along), ends: ends_of_line, strip })
    }
}

#[inline(always)]
fn dot(a: &Triple, b: &Triple) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn clamp(x: f32, [low, high]: [f32; 2]) -> f32 {
    let x = if x > low { x } else { low };
    if x < high { x } else { high }
}

impl Lanes {
    /// The nearest of at least one track for each sample, the first of equals; samples `pitch` mm apart.
    #[inline(always)]
    pub(super) fn of(kernels: &[Kernel], pitch: f32) -> Self {
        let place: [[f32; LANES]; 3] =
            [0, 1, 2].map(|axis| std::array::from_fn(|lane| ((lane >> (2 * axis) & 3) as f32 - 1.5) * pitch));
        let mut found = Self { squared: [f32::INFINITY; LANES], part: [0; LANES] };
        for kernel in kernels {
            match &kernel.strip {
                None => {
                    for i in 0..LANES {
                        let q = [place[0][i], place[1][i], place[2][i]];
                        found.take(i, kernel.line(&q), kernel.part);
                    }
                }
                Some(strip) => {
                    for i in 0..LANES {
                        let q = [place[0][i], place[1][i], place[2][i]];
                        let (line, (plane, above)) = (kernel.line(&q), strip.plane(&q));
                        found.take(i, if above { plane } else { line }, kernel.part);
                    }
                }
            }
        }
        found
    }

    #[inline(always)]
    fn take(&mut self, lane: usize, squared: f32, part: u32) {
        let nearer = squared < self.squared[lane];
        self.part[lane] = if nearer { part } else { self.part[lane] };
        self.squared[lane] = if nearer { squared } else { self.squared[lane] };
    }
}

impl Kernel {
    /// Squared distance from the track.
    #[inline(always)]
    fn line(&self, q: &Triple) -> f32 {
        let t = clamp(dot(q, &self.along), self.ends);
        let v = [0, 1, 2].map(|i| self.from_line[i] + q[i] - self.along[i] * t);
        dot(&v, &v)
    }
}

impl Strip {
    /// Squared distance from the strip, as long as it runs down without end, and whether the place lies
    /// above the track.
    #[inline(always)]
    fn plane(&self, q: &Triple) -> (f32, bool) {
        let (x, y) = (dot(q, &self.across), dot(q, &self.axis));
        let t = clamp(x, self.ends);
        let above = y - self.slope * t - self.height > 0.0;
        let v = [0, 1, 2].map(|i| self.from_plane[i] + q[i] - self.across[i] * t - self.axis[i] * y);
        (dot(&v, &v), above)
    }
}
