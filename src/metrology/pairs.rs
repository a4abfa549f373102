//! The scallop of every pair of neighbouring passes: calculated from the path beside measured on the cut
//! surface.
//!
//! Enters: the crossings of the measured ridges, the part and the finished path. Leaves: for each pair of
//! passes that meet in a ridge its measured height, and what the path alone says it should be, mm.
//!
//! At a place of the design below a crossing stands the section across both tracks. There the place is found
//! from which the nearest ball centres of both tracks on the finished path are a radius away, begun where the
//! two nearest balls meet ([`scallop::ridge_between`]); its distance from the design is the calculated
//! height. No planner's prediction enters, and nothing of the cut surface but which two moves meet near which
//! place. Beside it stands the height on a circular section: the chord between the contacts, and the design's
//! curvature across the feed. It takes the balls to touch the design, so that it knows nothing of chords, and
//! takes the passes to be parallel.
//!
//! Newton's method searches both tracks at once. Letting the ridge and the nearest centres find each other in
//! turn does not converge: where the design's normal is not square to the tracks, both wander along them.
//!
//! Turns of a spiral are one pass: all their ridges are those of a pass with itself.

mod calculator;

use std::collections::BTreeMap;

use serde::Serialize;

use calculator::{Calculated, Calculator};
use cutter::Cutter;
use geometry::Point3;
use motion::{Cutters, Toolpath};
use part::Part;
use work::monitor::{self, Cancelled, Monitor};

/// Calculated places along a ridge are this share of the ball's radius apart. More cost time, fewer miss how
/// a ridge changes.
const PLACES_OVER_RADIUS: f64 = 1.0 / 6.0;

/// At least so many crossings for one that is calculated: more of them cost memory where passes are a cell
/// apart.
const LEAST_ONE_IN: usize = 8;

/// A pair is parallel when it is so at this share of its places; a few stand at ends, corners and links.
/// Figures of parallel pairs leave those out.
const MOSTLY: f64 = 0.9;

/// Numerical floor of a calculated height, mm: the foot on the design, and the ridge's own evaluation.
const FLOOR: f64 = 1e-9;

/// A place where a ridge was measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct RidgeCrossing {
    /// Top of the ridge, mm.
    pub at: Point3,
    /// Height over the design surface, mm.
    pub height: f64,
    /// Length of ridge that it stands for, mm.
    pub length: f64,
    /// The moves that meet.
    pub moves: [u32; 2],
}

/// The crossings of one pair.
#[derive(Debug, Clone, Copy, Default)]
struct Measured {
    count: usize,
    length: f64,
    /// Of height times length, mm².
    sum: f64,
    highest: Option<RidgeCrossing>,
}

/// What was measured of every pair, and some of its places.
#[derive(Debug, Default)]
pub(super) struct PairTally {
    pairs: BTreeMap<[u32; 2], Measured>,
    /// Where heights will be calculated.
    chosen: Vec<Chosen>,
}

/// A crossing as it is kept: where passes are one cell apart, every cell has one. Rounding moves the place by
/// 0.1 µm at most on parts of a metre, and the height by a ten-millionth.
#[derive(Debug, Clone, Copy)]
struct Chosen {
    at: [f32; 3],
    height: f32,
    length: f32,
    moves: [u32; 2],
}

impl From<RidgeCrossing> for Chosen {
    fn from(c: RidgeCrossing) -> Self {
        Self {
            at: c.at.coords.map(|x| x as f32).into(),
            height: c.height as f32,
            length: c.length as f32,
            moves: c.moves,
        }
    }
}

impl From<Chosen> for RidgeCrossing {
    fn from(c: Chosen) -> Self {
        let [x, y, z] = c.at.map(f64::from);
        Self { at: Point3::new(x, y, z), height: c.height.into(), length: c.length.into(), moves: c.moves }
    }
}

impl PairTally {
    /// How many crossings, `spacing` mm apart along a ridge, there are for one that is calculated.
    pub fn one_in(cutter: &Cutter, spacing: f64) -> usize {
        ((PLACES_OVER_RADIUS * cutter.radius() / spacing).round() as usize).max(LEAST_ONE_IN)
    }

    /// Number of crossings of a pair so far.
    pub fn count(&self, passes: [u32; 2]) -> usize {
        self.pairs.get(&passes).map_or(0, |pair| pair.count)
    }

    /// Adds a crossing, `chosen` if its height is to be calculated too.
    pub fn add(&mut self, passes: [u32; 2], crossing: RidgeCrossing, chosen: bool) {
        let one = Measured {
            count: 1,
            length: crossing.length,
            sum: crossing.length * crossing.height,
            highest: Some(crossing),
        };
        self.pairs.entry(passes).or_default().join(&one);
        if chosen {
            self.chosen.push(crossing.into());
        }
    }

    /// Adds what was found elsewhere.
    pub fn append(&mut self, other: Self) {
        for (passes, measured) in &other.pairs {
            self.pairs.entry(*passes).or_default().join(measured);
        }
        self.chosen.extend(other.chosen);
    }
}

impl Measured {
    fn join(&mut self, other: &Self) {
        self.count += other.count;
        self.length += other.length;
        self.sum += other.sum;
        let higher = |a: &RidgeCrossing| other.highest.filter(|b| b.height > a.height).unwrap_or(*a);
        self.highest = self.highest.as_ref().map(higher).or(other.highest);
    }
}

/// The scallop between two neighbouring passes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ScallopPair {
    /// The passes, counted from 0 in program order; turns of one spiral are a pass with itself.
    pub passes: [u32; 2],
    /// Places where their ridge was measured.
    pub crossings: usize,
    /// Length of their ridge.
    pub ridge_length_mm: f64,
    /// Mean height measured, over the ridge length.
    pub measured_mean_mm: f64,
    /// Greatest height measured.
    pub measured_max_mm: f64,
    /// Places at which the height was calculated as well.
    pub calculated_places: usize,
    /// Whether the two passes are parallel there.
    pub parallel: bool,
    /// Mean calculated height at those places: where the two balls meet, over the design.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub calculated_mean_mm: Option<f64>,
    /// Greatest calculated height.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub calculated_max_mm: Option<f64>,
    /// Mean height on a circular section of the design's curvature across the feed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub section_mean_mm: Option<f64>,
    /// Mean calculated over mean measured height, at the same places.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub calculated_over_measured: Option<f64>,
    /// Greatest difference between calculated and measured height at one place.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub greatest_difference_mm: Option<f64>,
}

/// All pairs of passes that meet in a ridge.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct PairFigures {
    /// Number of pairs.
    pub pair_count: usize,
    /// Those that are parallel.
    pub parallel_count: usize,
    /// Mean calculated over mean measured height, at all places of all pairs.
    pub calculated_over_measured: Option<f64>,
    /// The same at parallel pairs.
    pub parallel_calculated_over_measured: Option<f64>,
    /// Of parallel pairs, the greatest difference of the two means from each other, as a share.
    pub parallel_greatest_mean_difference: Option<f64>,
    /// Of parallel pairs, the greatest difference at one place.
    pub parallel_greatest_difference_mm: Option<f64>,
    /// Mean height on circular sections over the mean measured, at the same places of parallel pairs.
    pub parallel_section_over_measured: Option<f64>,
    /// Bound of the numerical error of calculated heights.
    pub error_bound_mm: Option<f64>,
    /// Why a figure is missing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// The pairs, in order of passes; report.json holds the first [`MOST_PAIRS`], scallop_pairs.csv all.
    #[serde(serialize_with = "first_pairs")]
    pub pairs: Vec<ScallopPair>,
}

/// Most pairs in report.json: halved passes make thousands.
pub const MOST_PAIRS: usize = 200;

fn first_pairs<S: serde::Serializer>(pairs: &[ScallopPair], to: S) -> Result<S::Ok, S::Error> {
    to.collect_seq(pairs.iter().take(MOST_PAIRS))
}

/// Puts calculated heights beside those of a tally.
///
/// # Errors
/// [`Cancelled`] when the monitor says so.
pub(super) fn pair_figures(
    part: &Part,
    cutters: &Cutters,
    path: &Toolpath,
    mut tally: PairTally,
    monitor: &dyn Monitor,
) -> Result<PairFigures, Cancelled> {
    let cutter = cutters.first();
    let ball = cutter.profile().is_ball() && !cutters.are_several();
    let mut places = if ball { std::mem::take(&mut tally.chosen) } else { Vec::new() };
    if ball {
        places.extend(tally.pairs.values().filter_map(|pair| Some(Chosen::from(pair.highest?))));
    }
    let calculator = Calculator::new(part, cutter, path);
    monitor.start("calculating scallops", places.len() as u64);
    let found = work::parallel::try_map(places.len().div_ceil(CHUNK), |k| {
        monitor::check(monitor)?;
        let run = &places[k * CHUNK..((k + 1) * CHUNK).min(places.len())];
        monitor.advance(run.len() as u64);
        Ok(run.iter().map(|chosen| calculator.at(&(*chosen).into())).collect::<Vec<_>>())
    })?;
    let mut of_pair: BTreeMap<[u32; 2], [Sums; 2]> = BTreeMap::new();
    let mut bound = FLOOR;
    for (chosen, calculated) in places.into_iter().zip(found.into_iter().flatten()) {
        if let Some(calculated) = calculated {
            bound = bound.max(calculated.unsettled + FLOOR);
            let [a, b] = chosen.moves.map(|k| path.moves[k as usize].pass);
            let [all, parallel] = of_pair.entry([a.min(b), a.max(b)]).or_default();
            let crossing = chosen.into();
            all.add(&crossing, &calculated);
            if calculated.parallel {
                parallel.add(&crossing, &calculated);
            }
        }
    }
    let none = [Sums::default(); 2];
    let sums: Vec<&[Sums; 2]> =
        tally.pairs.keys().map(|passes| of_pair.get(passes).unwrap_or(&none)).collect();
    let of_one =
        |((passes, measured), sums): ((&[u32; 2], &Measured), &&[Sums; 2])| sums[0].pair(*passes, measured);
    let pairs: Vec<ScallopPair> = tally.pairs.iter().zip(&sums).map(of_one).collect();
    let (mut all, mut parallel, mut off) = (Sums::default(), Sums::default(), None);
    for (pair, sums) in pairs.iter().zip(&sums) {
        all.join(&sums[0]);
        if pair.parallel {
            parallel.join(&sums[1]);
            off = sums[1].ratio().map(|r| (r - 1.0).abs()).into_iter().chain(off).reduce(f64::max);
        }
    }
    let calculated = all.places > 0;
    let missing = if cutters.are_several() {
        Some("heights are calculated for paths of one cutter only")
    } else if !ball {
        Some(
            "heights are calculated for ball cutters only: others show no circle of their own across the feed",
        )
    } else if !calculated {
        Some("no ridge stands between passes on the part")
    } else if parallel.places == 0 {
        Some("no two passes are parallel")
    } else if parallel.section_over_measured().is_none() {
        Some("a mesh has no curvature of its own for sections, and poles have none")
    } else {
        None
    };
    Ok(PairFigures {
        pair_count: pairs.len(),
        parallel_count: pairs.iter().filter(|pair| pair.parallel).count(),
        calculated_over_measured: all.ratio(),
        parallel_calculated_over_measured: parallel.ratio(),
        parallel_greatest_mean_difference: off,
        parallel_greatest_difference_mm: (parallel.places > 0).then_some(parallel.difference),
        parallel_section_over_measured: parallel.section_over_measured(),
        error_bound_mm: calculated.then_some(bound),
        reason: missing.map(str::to_owned),
        pairs,
    })
}

/// Places that one worker takes at a time.
const CHUNK: usize = 256;

/// Sums over the calculated places of a pair.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    places: usize,
    parallel: usize,
    length: f64,
    /// Of height times length: calculated, and measured at the same places.
    calculated: f64,
    measured: f64,
    highest: f64,
    difference: f64,
    /// The same where a section has a height: length, calculated, measured.
    section: [f64; 3],
}

impl Sums {
    fn add(&mut self, crossing: &RidgeCrossing, calculated: &Calculated) {
        // A ridge that runs along the lines of the grid has next to no length at a crossing.
        let length = crossing.length.max(f64::MIN_POSITIVE);
        let section = calculated.section.map_or([0.0; 3], |h| [length, length * h, length * crossing.height]);
        self.join(&Self {
            places: 1,
            parallel: usize::from(calculated.parallel),
            length,
            calculated: length * calculated.height,
            measured: length * crossing.height,
            highest: calculated.height,
            difference: (calculated.height - crossing.height).abs(),
            section,
        });
    }

    fn join(&mut self, other: &Self) {
        self.places += other.places;
        self.parallel += other.parallel;
        self.length += other.length;
        self.calculated += other.calculated;
        self.measured += other.measured;
        self.highest = self.highest.max(other.highest);
        self.difference = self.difference.max(other.difference);
        (0..3).for_each(|k| self.section[k] += other.section[k]);
    }

    fn ratio(&self) -> Option<f64> {
        (self.measured > 0.0).then(|| self.calculated / self.measured)
    }

    fn section_over_measured(&self) -> Option<f64> {
        (self.section[2] > 0.0).then(|| self.section[1] / self.section[2])
    }

    fn pair(&self, passes: [u32; 2], measured: &Measured) -> ScallopPair {
        let any = self.places > 0;
        let length = measured.length.max(f64::MIN_POSITIVE);
        ScallopPair {
            passes,
            crossings: measured.count,
            ridge_length_mm: measured.length,
            measured_mean_mm: measured.sum / length,
            measured_max_mm: measured.highest.map_or(0.0, |highest| highest.height),
            calculated_places: self.places,
            parallel: any && self.parallel as f64 >= MOSTLY * self.places as f64,
            calculated_mean_mm: any.then(|| self.calculated / self.length),
            calculated_max_mm: any.then_some(self.highest),
            section_mean_mm: (self.section[0] > 0.0).then(|| self.section[1] / self.section[0]),
            calculated_over_measured: self.ratio(),
            greatest_difference_mm: any.then_some(self.difference),
        }
    }
}

/// The columns of scallop_pairs.csv.
pub const PAIRS_HEADER: &str = "pass_a,pass_b,crossings,ridge_length_mm,measured_mean_mm,measured_max_mm,calculated_places,parallel,\
     calculated_mean_mm,calculated_max_mm,section_mean_mm,calculated_over_measured,greatest_difference_mm";

impl ScallopPair {
    /// Its line of scallop_pairs.csv; what is missing is empty.
    pub fn csv(&self) -> String {
        let or_empty = |value: Option<f64>| value.map_or_else(String::new, |v| format!("{v:.9}"));
        format!(
            "{},{},{},{:.6},{:.9},{:.9},{},{},{},{},{},{},{}",
            self.passes[0],
            self.passes[1],
            self.crossings,
            self.ridge_length_mm,
            self.measured_mean_mm,
            self.measured_max_mm,
            self.calculated_places,
            self.parallel,
            or_empty(self.calculated_mean_mm),
            or_empty(self.calculated_max_mm),
            or_empty(self.section_mean_mm),
            or_empty(self.calculated_over_measured),
            or_empty(self.greatest_difference_mm),
        )
    }
}

#[cfg(test)]
mod tests;
