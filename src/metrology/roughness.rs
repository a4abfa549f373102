//! Roughness of the cut surface across the feed: Ra and Rz of profiles of the deviation.
//!
//! Enters: the part, an engine that tells of the cut along normals, and the path. Leaves: Ra and Rz, mm, over
//! profiles spread over the part, with a bound of the error of their evaluation.
//!
//! A profile runs from a place of the part across the feed of the move that cut there, straight on the design
//! surface: each step goes along the tangent, back to the nearest point, and on in the same direction. Its
//! height is the deviation along the design's normal, so that the part's own shape is no roughness. Ridges,
//! where the cut changes from one track to the next, are found by halving and end the path intervals. A
//! sampling length (cut-off) is a whole number of path intervals, [`MOST_INTERVALS`] where the surface is
//! wide enough; the mean line of each is its mean height. Ra is the mean of |height − mean line| and Rz the
//! greatest less the least height, each the mean of five sampling lengths in a row, as ISO 4287 (now ISO
//! 21920-2) has it. Lengths of several intervals leave heights that differ from pass to pass in the figures.
//!
//! Profiles are read by rays along the normals, whatever engine cut. Ridges end the intervals, so that
//! sampling lengths hold whole intervals and no filter is needed.
//!
//! Closed forms: a parabola of height h has Ra = 4h/(9√3) and Rz = h.

use serde::Serialize;

use super::along_normals::{AlongNormal, NormalHit};
use super::figures::NUMERICAL_FLOOR;
use super::tracks::Tracks;
use geometry::{Point3, Vector3};
use motion::{Cutters, Toolpath};
use part::Part;
use work::monitor::{self, Cancelled, Monitor};

/// Profiles over the part. More tell more of a part whose roughness changes, and take longer.
const PROFILES: usize = 24;

/// Sampling lengths of a profile.
const SAMPLING_LENGTHS: usize = 5;

/// Path intervals of a sampling length at most, as the usual cut-offs of ground that repeats have two to six.
const MOST_INTERVALS: usize = 3;

/// Steps a mean interval while ridges are looked for. Fewer step over a narrow interval.
const STEPS: f64 = 8.0;

/// Steps that one side of a profile may take: beyond, its intervals are so wide that nothing was cut there.
const MOST_STEPS: usize = 2000;

/// Halvings of a step in which a ridge is found: what its height is off by is then far below a nanometre.
const HALVINGS: usize = 16;

/// Tracks between tracks within one step: at most this deep.
const MOST_DEPTH: usize = 4;

/// Engine's samples in an interval, and how many places a parabola through three of them stands for each.
const SAMPLES: usize = 24;
const FINER: usize = 8;

/// Neighbouring normals of one profile differ by less than this, as a cosine (30°): elsewhere is an edge of
/// the part.
const CREASE: f64 = 0.866;

/// Roughness across the feed.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct RoughnessFigures {
    /// Arithmetic mean height, mean over all profiles.
    pub ra_mm: Option<f64>,
    /// Mean height from valley to peak, mean over all profiles.
    pub rz_mm: Option<f64>,
    /// Greatest Ra of a profile.
    pub ra_max_mm: Option<f64>,
    /// Greatest Rz of a profile.
    pub rz_max_mm: Option<f64>,
    /// Where the profile with the greatest Rz was begun.
    pub rz_max_at_mm: Option<[f64; 3]>,
    /// Bound of the error with which the means were evaluated. How profiles differ over the part is not in
    /// it.
    pub error_bound_mm: Option<f64>,
    /// The same of the greatest of the profiles' figures.
    pub max_error_bound_mm: Option<f64>,
    /// Profiles evaluated.
    pub profiles: usize,
    /// Least and greatest number of path intervals in a sampling length.
    pub intervals_per_sampling_length: [usize; 2],
    /// Mean sampling length (cut-off).
    pub sampling_length_mm: Option<f64>,
    /// Places at which the cut was asked for in each path interval.
    pub samples_per_interval: usize,
    /// Why a figure is missing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
}

/// The roughness across the feed of what `engine` tells of the cut by `path`; cuts as deep as it looks, or
/// deeper, count for nothing. `interval` is about how far passes are apart, mm: the measured area over the
/// cutting length.
///
/// # Errors
/// [`Cancelled`] when the monitor says so.
pub fn roughness(
    part: &Part,
    cutters: impl Into<Cutters>,
    path: &Toolpath,
    engine: &dyn AlongNormal,
    interval: f64,
    monitor: &dyn Monitor,
) -> Result<RoughnessFigures, Cancelled> {
    let tracks = Tracks::new(path, cutters);
    let step = interval / STEPS;
    if !(step.is_finite() && step > 0.0) {
        return Ok(RoughnessFigures {
            reason: Some("nothing was cut".into()),
            ..RoughnessFigures::default()
        });
    }
    let profiler = Profiler { part, path, engine, tracks: &tracks, step };
    monitor.start("measuring roughness", PROFILES as u64);
    let places = places(part, PROFILES);
    let found = work::parallel::try_map(places.len(), |k| {
        monitor::check(monitor)?;
        let profile = profiler.profile(&places[k]);
        monitor.advance(1);
        Ok(profile)
    })?;
    Ok(figures(&found.into_iter().flatten().collect::<Vec<_>>()))
}

fn figures(profiles: &[Profile]) -> RoughnessFigures {
    let count = profiles.len();
    let mean = |of: &dyn Fn(&Profile) -> f64| {
        Some(profiles.iter().map(of).sum::<f64>() / count as f64).filter(|_| count > 0)
    };
    let most = |of: &dyn Fn(&Profile) -> f64| profiles.iter().map(of).reduce(f64::max);
    let highest = profiles.iter().max_by(|a, b| a.rz.total_cmp(&b.rz));
    RoughnessFigures {
        ra_mm: mean(&|p| p.ra),
        rz_mm: mean(&|p| p.rz),
        ra_max_mm: most(&|p| p.ra),
        rz_max_mm: most(&|p| p.rz),
        rz_max_at_mm: highest.map(|p| p.begun.into()),
        error_bound_mm: mean(&|p| p.bound),
        max_error_bound_mm: most(&|p| p.bound),
        profiles: count,
        intervals_per_sampling_length: [
            profiles.iter().map(|p| p.intervals).min().unwrap_or(0),
            profiles.iter().map(|p| p.intervals).max().unwrap_or(0),
        ],
        sampling_length_mm: mean(&|p| p.length),
        samples_per_interval: SAMPLES,
        reason: (count == 0)
            .then(|| "nowhere on the part are five path intervals in a row across the feed".to_owned()),
    }
}

/// Points of the part at even shares of its area, scattered over it; the same each time.
fn places(part: &Part, count: usize) -> Vec<Point3> {
    let mesh = part.mesh();
    let mut so_far = 0.0;
    let ends: Vec<f64> = (0..mesh.triangles().len())
        .map(|t| {
            let [a, b, c] = mesh.corners(t);
            so_far += (b - a).cross(&(c - a)).norm();
            so_far
        })
        .collect();
    // Additive recurrence of the plane (M. Roberts, 2018): its points never crowd.
    let share = |k: usize, by: f64| (0.5 + by * k as f64).fract();
    (0..count)
        .map(|k| {
            let t = ends.partition_point(|end| *end < so_far * (k as f64 + 0.5) / count as f64);
            let [a, b, c] = mesh.corners(t.min(ends.len() - 1));
            let (x, y) = (share(k, 0.754_877_666), share(k, 0.569_840_290));
            let (x, y) = if x + y > 1.0 { (1.0 - x, 1.0 - y) } else { (x, y) };
            a + (b - a) * x + (c - a) * y
        })
        .collect()
}

/// A place on a profile.
#[derive(Debug, Clone, Copy)]
struct Station {
    /// Way along the profile, mm.
    along: f64,
    point: Point3,
    normal: Vector3,
    hit: NormalHit,
}

/// The figures of one profile, mm.
#[derive(Debug, Clone, Copy)]
struct Profile {
    begun: Point3,
    ra: f64,
    rz: f64,
    bound: f64,
    /// Path intervals of a sampling length.
    intervals: usize,
    /// Mean sampling length.
    length: f64,
}

struct Profiler<'a> {
    part: &'a Part,
    path: &'a Toolpath,
    engine: &'a dyn AlongNormal,
    tracks: &'a Tracks<'a>,
    step: f64,
}

impl Profiler<'_> {
    /// The profile through a place; `None` where it leaves the part before it has enough intervals.
    fn profile(&self, place: &Point3) -> Option<Profile> {
        let begin = self.station(place, 0.0, None)?;
        let step = &self.path.moves[begin.hit.by as usize];
        if !step.kind.is_on_surface() {
            return None;
        }
        let feed = step.to.tip - self.path.location_before(begin.hit.by as usize).tip;
        let across = begin.normal.cross(&feed).try_normalize(1e-12)?;
        let line = self.line(&begin, &across);
        let mut ridges = Vec::new();
        for pair in line.windows(2) {
            self.ridges(&pair[0], &pair[1], MOST_DEPTH, &mut ridges);
        }
        let intervals = (ridges.len().checked_sub(1)? / SAMPLING_LENGTHS).min(MOST_INTERVALS);
        if intervals == 0 {
            return None;
        }
        let wanted = SAMPLING_LENGTHS * intervals + 1;
        // Those in whose middle the profile was begun.
        let middle = |first: usize| (ridges[first].along + ridges[first + wanted - 1].along).abs();
        let first = (0..=ridges.len() - wanted).min_by(|a, b| middle(*a).total_cmp(&middle(*b)))?;
        self.evaluate(&line, &ridges[first..first + wanted], intervals, begin.point)
    }

    fn station(&self, target: &Point3, along: f64, near: Option<&NormalHit>) -> Option<Station> {
        let foot = self.part.closest_point(target).0;
        let hit = self.engine.hit(&foot.point, &foot.normal, near)?;
        // What begins within the cut was cut from another side of the part.
        if hit.deviation <= -self.engine.depth() * (1.0 - 1e-9) {
            return None;
        }
        Some(Station { along, point: foot.point, normal: foot.normal, hit })
    }

    /// Stations on both sides of the first one, as far as ridges are wanted or the part goes.
    fn line(&self, begin: &Station, across: &Vector3) -> Vec<Station> {
        let wanted = SAMPLING_LENGTHS * MOST_INTERVALS + 1;
        let ahead = self.side(begin, across, wanted / 2);
        let behind = self.side(begin, &-across, wanted - self.seen(begin, &ahead));
        let missing = wanted.saturating_sub(self.seen(begin, &behind));
        let ahead = if missing > wanted / 2 { self.side(begin, across, missing) } else { ahead };
        let back = behind.into_iter().rev().map(|station| Station { along: -station.along, ..station });
        back.chain(std::iter::once(*begin)).chain(ahead).collect()
    }

    /// Changes of track that a side shows.
    fn seen(&self, begin: &Station, side: &[Station]) -> usize {
        let mut last = begin.hit.by;
        let change = |station: &&Station| {
            let changed = self.tracks.apart(last, station.hit.by);
            last = station.hit.by;
            changed
        };
        side.iter().filter(change).count()
    }

    /// Stations in one direction until `wanted` changes of track were passed, or the part or the cut ends.
    fn side(&self, begin: &Station, direction: &Vector3, mut wanted: usize) -> Vec<Station> {
        let (mut here, mut direction) = (*begin, *direction);
        let mut side = Vec::new();
        while wanted > 0 && side.len() < MOST_STEPS {
            let target = here.point + direction * self.step;
            let Some(mut next) = self.station(&target, here.along, Some(&here.hit)) else { break };
            let way = next.point - here.point;
            // At a border the nearest point stays behind.
            if (next.point - target).norm() > 0.3 * self.step || next.normal.dot(&here.normal) < CREASE {
                break;
            }
            next.along += way.norm();
            wanted -= usize::from(self.tracks.apart(here.hit.by, next.hit.by));
            let Some(onward) = (direction - next.normal * next.normal.dot(&direction)).try_normalize(1e-6)
            else {
                break;
            };
            (here, direction) = (next, onward);
            side.push(next);
        }
        side
    }

    /// The station at a share of the way between two.
    fn between(&self, a: &Station, b: &Station, share: f64) -> Option<Station> {
        let near = if share < 0.5 { &a.hit } else { &b.hit };
        self.station(
            &(a.point + (b.point - a.point) * share),
            a.along + (b.along - a.along) * share,
            Some(near),
        )
    }

    /// Where tracks change between two stations, each with the higher of both cuts.
    fn ridges(&self, a: &Station, b: &Station, depth: usize, found: &mut Vec<Station>) {
        if !self.tracks.apart(a.hit.by, b.hit.by) {
            return;
        }
        let (mut low, mut high) = (*a, *b);
        for _ in 0..HALVINGS {
            let Some(middle) = self.between(&low, &high, 0.5) else { return };
            match (
                self.tracks.apart(low.hit.by, middle.hit.by),
                self.tracks.apart(middle.hit.by, high.hit.by),
            ) {
                (false, _) => low = middle,
                (true, false) => high = middle,
                (true, true) if depth > 0 => {
                    self.ridges(&low, &middle, depth - 1, found);
                    return self.ridges(&middle, &high, depth - 1, found);
                }
                (true, true) => return,
            }
        }
        found.push(if low.hit.deviation > high.hit.deviation { low } else { high });
    }

    /// The figures between ridges, `intervals` of which make a sampling length.
    fn evaluate(
        &self,
        line: &[Station],
        ridges: &[Station],
        intervals: usize,
        begun: Point3,
    ) -> Option<Profile> {
        let (mut ra, mut rz, mut bound) = (0.0, 0.0, 0.0f64);
        for sampling in ridges.windows(intervals + 1).step_by(intervals) {
            let mut heights = Heights::default();
            for pair in sampling.windows(2) {
                heights.add(&self.samples(line, &pair[0], &pair[1])?, pair[1].along - pair[0].along);
            }
            ra += heights.mean_distance();
            rz += heights.greatest() - heights.least();
            bound = bound.max(2.0 * heights.missed);
        }
        let count = SAMPLING_LENGTHS as f64;
        let length = (ridges.last()?.along - ridges.first()?.along) / count;
        Some(Profile {
            begun,
            ra: ra / count,
            rz: rz / count,
            bound: bound + NUMERICAL_FLOOR,
            intervals,
            length,
        })
    }

    /// Heights at even steps from ridge to ridge.
    fn samples(&self, line: &[Station], from: &Station, to: &Station) -> Option<Vec<f64>> {
        let mut heights = vec![from.hit.deviation];
        for k in 1..SAMPLES {
            let along = from.along + (to.along - from.along) * k as f64 / SAMPLES as f64;
            let after = line.partition_point(|station| station.along <= along).clamp(1, line.len() - 1);
            let (a, b) = (&line[after - 1], &line[after]);
            let share = (along - a.along) / (b.along - a.along);
            heights.push(self.between(a, b, share)?.hit.deviation);
        }
        heights.push(to.hit.deviation);
        Some(heights)
    }
}

/// Heights of one sampling length at places so close that straight lines join them.
#[derive(Debug, Default)]
struct Heights {
    /// Pieces: length, and height at both ends, mm.
    pieces: Vec<[f64; 3]>,
    /// What may stand between them beside the lines, mm.
    missed: f64,
}

impl Heights {
    /// One interval: heights at even steps, and its length. Between samples runs the parabola through three
    /// of them.
    fn add(&mut self, samples: &[f64], length: f64) {
        let last = samples.len() - 1;
        let piece = length / (last * FINER) as f64;
        for k in 0..last {
            let middle = k.clamp(1, last - 1);
            let [a, b, c] = [samples[middle - 1], samples[middle], samples[middle + 1]];
            let at = |n: usize| {
                let t = (k as f64 - middle as f64) + n as f64 / FINER as f64;
                b + 0.5 * (c - a) * t + 0.5 * (a - 2.0 * b + c) * t * t
            };
            self.pieces.extend((0..FINER).map(|n| [piece, at(n), at(n + 1)]));
            let bow = (a - 2.0 * b + c).abs() / (8.0 * (FINER * FINER) as f64);
            // A parabola through three places misses a third difference by a share of 1/(9√3), or a fifth in
            // the end steps.
            let third = if k >= 1 && k + 2 <= last {
                (samples[k + 2] - 3.0 * samples[k + 1] + 3.0 * samples[k] - samples[k - 1]).abs()
            } else {
                0.0
            };
            self.missed = self.missed.max(bow + 0.2 * third);
        }
    }

    fn mean(&self) -> f64 {
        let (sum, length) = self
            .pieces
            .iter()
            .fold((0.0, 0.0), |(sum, length), [l, a, b]| (sum + l * 0.5 * (a + b), length + l));
        sum / length
    }

    /// Mean of |height − mean|, with the places where lines cross the mean.
    fn mean_distance(&self) -> f64 {
        let mean = self.mean();
        let of = |[length, a, b]: &[f64; 3]| {
            let (a, b) = (a - mean, b - mean);
            if a * b >= 0.0 {
                length * 0.5 * (a + b).abs()
            } else {
                length * 0.5 * (a * a + b * b) / (a - b).abs()
            }
        };
        self.pieces.iter().map(of).sum::<f64>() / self.pieces.iter().map(|[length, ..]| length).sum::<f64>()
    }

    fn greatest(&self) -> f64 {
        self.pieces.iter().map(|[_, a, b]| a.max(*b)).fold(f64::NEG_INFINITY, f64::max)
    }

    fn least(&self) -> f64 {
        self.pieces.iter().map(|[_, a, b]| a.min(*b)).fold(f64::INFINITY, f64::min)
    }
}

#[cfg(test)]
mod tests;
