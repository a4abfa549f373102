//! Scallop ridges: where the cuts of two passes meet.
//!
//! Wherever two neighbouring cells were cut by different passes, a ridge runs between them. On the line from
//! one cell centre to the other the closed-form cuts of the two are brought to intersection, so the height
//! found there is that of the ridge itself and not of the highest cell (which misses up to
//! `s·p/(4√(r² − s²/4))`). Moves that are lowest only between the centres are found on the way. Heights are
//! distances from the design surface.
//!
//! A ridge that crosses a grid line counts for the length that it runs between grid lines: for a crossing of
//! a line along x, pitch times `|n_x|`, `n` the ridge's plan normal (the sum over both families of lines
//! gives the length of any curve: `ds = |n_x||dy| + |n_y||dx|`), stretched by its rise.
//!
//! What stands aside of a border's normal, on the side where the part has ended, stands over no place of the
//! part: it is no ridge of it, though the part may lie below.

use super::cut_surface::CutSurface;
use super::every_move::EveryMove;
use super::figures::{Limits, Measurement, NEAR_LIMIT, NUMERICAL_FLOOR, RidgePlace, ScallopFigures};
use super::inspection::Inspection;
use super::meetings::{Meeting, Meetings};
use super::pairs::{PairTally, RidgeCrossing};
use geometry::{Point2, Point3, Vector2, Vector3, distance_to_segment};
use motion::{Cutters, Toolpath};
use part::{Part, SurfacePoint};
use sim::Grid;
use work::monitor::{self, Cancelled, Monitor};

/// One crossing of a ridge with a grid line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct RidgeSample {
    /// Height over the design surface, mm.
    pub height: f64,
    /// Where.
    pub at: Point3,
    /// Length of ridge that it stands for, mm.
    pub length: f64,
    /// How much higher the ridge may be before the next grid line, mm (first order).
    pub rise: f64,
    /// The moves that meet.
    moves: [u32; 2],
    /// The cell on the lower side, and whether the line to the next one runs along x.
    from: (u32, bool),
    /// Length of the ridge's plan normal along the line: near 1 where it crosses the line squarely.
    squareness: f64,
}

impl RidgeSample {
    /// True when the ridge may stand higher than `highest` before the next grid line that it crosses
    /// squarely.
    fn might_rise_above(&self, highest: f64) -> bool {
        self.squareness >= SQUARE_ENOUGH && self.height + self.rise > highest + NUMERICAL_FLOOR
    }
}

/// All ridges of a surface.
#[derive(Debug, Default)]
pub(super) struct Ridges {
    /// Height and length of every sample, mm.
    pub samples: Vec<[f32; 2]>,
    /// The highest sample of each row of cells, and those that might rise above it.
    candidates: Vec<RidgeSample>,
    /// Places between centres where more stands than the cells saw.
    pub hidden: Vec<Hidden>,
    /// The ridges of each pair of passes.
    pub pairs: PairTally,
    /// The samples near the scallop limit and above it.
    pub above: Vec<RidgePlace>,
}

/// A place between centres where more stands than the cells around saw.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Hidden {
    /// No move around passes here.
    Gap(Point2),
    /// A ridge above the uncut tolerance that is no scallop, between cells below it, and its height, mm.
    Ridge(Point2, f64),
}

impl Ridges {
    /// Of the samples of one row.
    fn of_row(samples: &[RidgeSample], hidden: Vec<Hidden>) -> Self {
        let highest = samples.iter().max_by(|a, b| a.height.total_cmp(&b.height));
        let others =
            samples.iter().filter(|s| highest.is_some_and(|highest| s.might_rise_above(highest.height)));
        Self {
            samples: samples.iter().map(|s| [s.height as f32, s.length as f32]).collect(),
            candidates: highest.into_iter().chain(others).copied().collect(),
            hidden,
            pairs: PairTally::default(),
            above: Vec::new(),
        }
    }

    /// The highest of the rows' highest samples that are no higher than this, mm, and where.
    pub fn highest_up_to(&self, most: f64) -> Option<(f64, Point3)> {
        let below = self.candidates.iter().filter(|sample| sample.height <= most);
        below.max_by(|a, b| a.height.total_cmp(&b.height)).map(|sample| (sample.height, sample.at))
    }

    /// Height of the highest sample, mm; 0 without samples.
    pub fn highest_sample(&self) -> f64 {
        self.candidates.iter().map(|s| s.height).fold(0.0, f64::max)
    }
}

/// The highest place of all ridges.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Highest {
    /// Height over the design surface, mm.
    pub height: f64,
    /// Where.
    pub at: Point3,
    /// No ridge is higher than this, mm (first order).
    pub possible: f64,
}

/// Where a ridge could rise above the highest sample between two grid lines, it is looked at on this many
/// lines between them, and on so many more between two of these where it still could, by more than the asked
/// bound, up to [`MOST_LINES`] in all. More lines at once, or at most, take longer; fewer at most leave steep
/// ridges open.
const CLOSER_LINES: i32 = 8;
const MOST_LINES: i32 = 512;

/// Ridges are looked at closer on lines that they cross with at least this plan normal; the lines of
/// the other family see the same ridge less squarely.
const SQUARE_ENOUGH: f64 = 0.7;

/// A pass serves a ridge when it touches the design within this many distances of the two passes.
/// On a plane it is half of one; in a hollow of radius 4/3 of the cutter's, two.
const FARTHEST_CONTACT: f64 = 2.0;

pub(super) struct RidgeFinder<'a> {
    pub surface: &'a CutSurface<'a>,
    pub part: &'a Part,
    pub cutters: &'a Cutters,
    pub limits: &'a Limits,
    meetings: &'a Meetings<'a>,
    path: &'a Toolpath,
    every_move: Option<&'a EveryMove<'a>>,
    /// The error bound that is asked for, mm.
    asked: f64,
}

/// A line between two neighbouring centres: from the cell `from`, along x or along y.
struct GridLine {
    a: Point2,
    b: Point2,
    from: u32,
    along_x: bool,
}

impl GridLine {
    fn new(grid: &Grid, from: u32, along_x: bool) -> Self {
        let a = grid.centre(from as usize % grid.nx, from as usize / grid.nx);
        let step = if along_x { Vector2::new(grid.cell, 0.0) } else { Vector2::new(0.0, grid.cell) };
        Self { a, b: a + step, from, along_x }
    }

    /// The same line moved sideways by a share of its length.
    fn beside(&self, share: f64) -> Self {
        let along = self.b - self.a;
        let aside = Vector2::new(-along.y, along.x) * share;
        Self { a: self.a + aside, b: self.b + aside, ..*self }
    }

    fn at(&self, t: f64) -> Point2 {
        self.a + (self.b - self.a) * t
    }
}

impl<'a> RidgeFinder<'a> {
    pub fn new(inspection: &Inspection<'a>, path: &'a Toolpath) -> Self {
        let Inspection { surface, part, cutters, limits, meetings, every_move, asked, .. } = *inspection;
        Self { surface, part, cutters, limits, meetings, path, every_move, asked }
    }

    /// All ridges, row by row. `deviation` is that of a cell, mm, NaN where it is not measured.
    pub fn find(
        &self,
        deviation: &(dyn Fn(usize) -> f32 + Sync),
        monitor: &dyn Monitor,
    ) -> Result<Ridges, Cancelled> {
        let grid = self.surface.cut.grid;
        let on_part = |k: usize| !deviation(k).is_nan();
        let low = |k: usize| f64::from(deviation(k)) <= self.limits.uncut;
        monitor.start("measuring ridges", grid.ny as u64);
        let rows = work::parallel::try_map(grid.ny, |j| {
            monitor::check(monitor)?;
            let (mut samples, mut hidden) = (Vec::new(), Vec::new());
            for i in 0..grid.nx {
                let k = grid.index(i, j);
                if !on_part(k) {
                    continue;
                }
                for (ni, nj, along_x) in [(i + 1, j, true), (i, j + 1, false)] {
                    if ni >= grid.nx || nj >= grid.ny {
                        continue;
                    }
                    let other = grid.index(ni, nj);
                    let [a, b] = [k, other].map(|k| self.surface.cut.cut_by[k]);
                    if on_part(other) && self.meetings.apart(a, b) {
                        let line = GridLine::new(&grid, k as u32, along_x);
                        let first = hidden.len();
                        self.between(&line, (0.0, a), (1.0, b), &mut samples, &mut hidden);
                        if !(low(k) && low(other)) {
                            hidden.truncate(first);
                        }
                    }
                }
            }
            monitor.advance(1);
            self.drop_cut_away(&mut samples);
            let above = samples.iter().filter(|s| s.height > NEAR_LIMIT * self.limits.scallop);
            let above = above.map(|s| RidgePlace { at: s.at, height: s.height }).collect();
            Ok(Ridges { pairs: self.pairs(&samples), above, ..Ridges::of_row(&samples, hidden) })
        })?;
        let mut ridges = Ridges {
            samples: Vec::with_capacity(rows.iter().map(|r| r.samples.len()).sum()),
            ..Ridges::default()
        };
        for row in rows {
            ridges.samples.extend(row.samples);
            ridges.above.extend(row.above);
            ridges.candidates.extend(row.candidates);
            ridges.hidden.extend(row.hidden);
            ridges.pairs.append(row.pairs);
        }
        Ok(ridges)
    }

    /// The samples by the passes that meet; those on every so many lines of either family are to be
    /// calculated too.
    fn pairs(&self, samples: &[RidgeSample]) -> PairTally {
        let grid = &self.surface.cut.grid;
        let one_in = PairTally::one_in(self.cutters.first(), grid.cell);
        let mut tally = PairTally::default();
        for sample in samples {
            let (cell, along_x) = sample.from;
            let line = if along_x { cell as usize / grid.nx } else { cell as usize % grid.nx };
            let RidgeSample { at, height, length, moves, .. } = *sample;
            let passes = moves.map(|k| self.path.moves[k as usize].pass);
            let passes = [passes[0].min(passes[1]), passes[0].max(passes[1])];
            tally.add(passes, RidgeCrossing { at, height, length, moves }, line.is_multiple_of(one_in));
        }
        tally
    }

    /// Adds the ridges on a line between `a`, lowest at its share `ta`, and `b`, lowest at `tb`, and what
    /// else stands there.
    fn between(
        &self,
        line: &GridLine,
        a: (f64, u32),
        b: (f64, u32),
        out: &mut Vec<RidgeSample>,
        hidden: &mut Vec<Hidden>,
    ) {
        let mut gaps = Vec::new();
        let mut found = |m| out.extend(self.sample(line, m, hidden));
        self.meetings.between_or_gaps(&|t| line.at(t), a, b, &mut found, &mut |q| gaps.push(Hidden::Gap(q)));
        hidden.extend(gaps);
    }

    fn sample(&self, line: &GridLine, meeting: Meeting, hidden: &mut Vec<Hidden>) -> Option<RidgeSample> {
        let Meeting { at: q, z, moves, .. } = meeting;
        let at = Point3::new(q.x, q.y, z);
        let (foot, height) = self.part.closest_point(&at);
        let aside = (at - foot.point).cross(&foot.normal).norm();
        if aside > NUMERICAL_FLOOR && self.ends_at(&foot) {
            return None;
        }
        if height > NEAR_LIMIT * self.limits.scallop && self.is_cut_away(&at) {
            return None;
        }
        if height > self.limits.uncut && self.leans_over(&foot.point, &at) {
            return None;
        }
        let [m, n] = moves.map(|by| self.surface.normal(by, q.x, q.y));
        if height > self.limits.uncut && !self.is_scallop(moves, &foot) {
            hidden.push(Hidden::Ridge(q, height));
            return None;
        }
        let tangent = m.cross(&n).try_normalize(1e-15)?;
        let plan = tangent.xy().norm();
        if plan < 1e-9 {
            return None;
        }
        let (plan_normal_x, plan_normal_y) = (tangent.y.abs() / plan, tangent.x.abs() / plan);
        let pitch = self.surface.cut.grid.cell;
        let share = if line.along_x { plan_normal_x } else { plan_normal_y };
        // A ridge meets the next grid line within a diagonal of the grid.
        let reach = pitch * std::f64::consts::SQRT_2 / plan;
        Some(RidgeSample {
            height,
            at,
            length: pitch * share / plan,
            rise: tangent.dot(&foot.normal).abs() * 0.5 * reach,
            moves,
            from: (line.from, line.along_x),
            squareness: share,
        })
    }

    /// Leaves out the highest samples of a row as long as no ridge stands there.
    fn drop_cut_away(&self, samples: &mut Vec<RidgeSample>) {
        let order = |a: &(usize, &RidgeSample), b: &(usize, &RidgeSample)| a.1.height.total_cmp(&b.1.height);
        while let Some((k, highest)) = samples.iter().enumerate().max_by(order)
            && highest.height <= NEAR_LIMIT * self.limits.scallop
            && self.is_cut_away(&highest.at)
        {
            samples.swap_remove(k);
        }
    }

    /// Whether a move that no cell shows cuts lower, by more than the figures are asked for.
    fn is_cut_away(&self, at: &Point3) -> bool {
        let below = at - Vector3::z() * self.asked;
        self.every_move.is_some_and(|every_move| every_move.cuts_away(&below).is_some())
    }

    /// Whether the cut lies between a foot and a ridge: what stands so high stands on other places of the
    /// design.
    fn leans_over(&self, foot: &Point3, ridge: &Point3) -> bool {
        let way = ridge - foot;
        let out = self.surface.along_normal(foot, &way.normalize());
        out.is_some_and(|out| out.distance < way.norm() - self.asked)
    }

    /// The highest place of all ridges, looked at closer wherever a ridge might rise above the highest
    /// sample before the next grid line, and closer still where it yet could by more than `asked` mm; `None`
    /// without samples. Places above the scallop limit that come to light are added to the ridges' own.
    ///
    /// # Errors
    /// [`Cancelled`] when the monitor says so.
    pub fn highest(
        &self,
        ridges: &mut Ridges,
        asked: f64,
        monitor: &dyn Monitor,
    ) -> Result<Option<Highest>, Cancelled> {
        let samples = &ridges.candidates;
        let Some(first) = samples.iter().max_by(|a, b| a.height.total_cmp(&b.height)) else {
            return Ok(None);
        };
        let mut highest = Highest { height: first.height, at: first.at, possible: first.height };
        // All that may be above the limit, though another place is higher.
        let known = first.height.min(self.limits.scallop);
        let mut open: Vec<(f64, RidgeSample)> =
            samples.iter().filter(|s| s.might_rise_above(known)).map(|s| (0.0, *s)).collect();
        let mut lines = CLOSER_LINES;
        while !open.is_empty() {
            monitor.start("following ridges", open.len() as u64);
            let closer = work::parallel::try_map(open.len(), |k| {
                monitor::check(monitor)?;
                let found = self.closer(&open[k], lines);
                monitor.advance(1);
                Ok::<_, Cancelled>(found)
            })?;
            for (_, top) in closer.iter().flatten() {
                if top.height > highest.height {
                    (highest.height, highest.at) = (top.height, top.at);
                }
            }
            let tops = closer.iter().filter_map(|found| {
                let heights = found.iter().map(|(_, sample)| sample);
                heights.max_by(|a, b| a.height.total_cmp(&b.height))
            });
            let above = tops.filter(|top| top.height > self.limits.scallop);
            ridges.above.extend(above.map(|top| RidgePlace { at: top.at, height: top.height }));
            let possible = |sample: &RidgeSample| sample.height + sample.rise / f64::from(lines);
            let (last, enough) = (lines >= MOST_LINES, highest.height + asked);
            open.clear();
            for (aside, sample) in closer.into_iter().flatten() {
                if last || possible(&sample) <= enough {
                    highest.possible = highest.possible.max(possible(&sample));
                } else {
                    open.push((aside, sample));
                }
            }
            lines *= CLOSER_LINES;
        }
        highest.possible = highest.possible.max(highest.height);
        Ok(Some(highest))
    }

    /// The ridge of a sample `aside` of its line, by a share of it, on lines that are such a share of it
    /// apart; up to half a cell on either side, or to where others are looked at.
    fn closer(&self, (aside, sample): &(f64, RidgeSample), lines: i32) -> Vec<(f64, RidgeSample)> {
        let line = GridLine::new(&self.surface.cut.grid, sample.from.0, sample.from.1);
        let [a, b] = sample.moves;
        let (mut found, mut hidden) = (Vec::new(), Vec::new());
        for k in -CLOSER_LINES / 2..=CLOSER_LINES / 2 {
            let aside = aside + f64::from(k) / f64::from(lines);
            // The ridge may leave the cell sideways by half of it.
            let line = line.beside(aside);
            let mut met = |m| found.extend(self.sample(&line, m, &mut hidden).map(|sample| (aside, sample)));
            self.meetings.again_between(&|t| line.at(t), (-0.5, a), (1.5, b), &mut met);
        }
        found.retain(|(_, s)| self.part.highest_at(s.at.x, s.at.y).is_some() && !self.is_cut_away(&s.at));
        found
    }
}

impl RidgeFinder<'_> {
    /// True where the part ends at `foot`. Seams between patches are no ends.
    fn ends_at(&self, foot: &SurfacePoint) -> bool {
        if foot.at.is_some() {
            return self.part.ends_with_patch_at(foot);
        }
        let mesh = self.part.mesh();
        let corners = mesh.corners(foot.triangle as usize);
        (0..3)
            .filter(|&k| mesh.neighbour(foot.triangle as usize, k).is_none())
            .any(|k| distance_to_segment(&foot.point, &corners[k], &corners[(k + 1) % 3]) <= NUMERICAL_FLOOR)
    }

    /// True when a high ridge over `foot` stands between passes that came down to the design on its
    /// sides: one of them touches it, and not much farther away than the passes lie apart. Else it
    /// stands in a hollow that the cutter does not fit, and is material that no pass reached.
    fn is_scallop(&self, moves: [u32; 2], foot: &SurfacePoint) -> bool {
        let from_contact = moves.map(|by| self.cutters.of_move(by).contact_to_tip(&foot.normal));
        let tip = |k: usize| self.surface.nearest_tip(moves[k], &(foot.point + from_contact[k]));
        let tips = [tip(0), tip(1)];
        let far = FARTHEST_CONTACT * (tips[0] - tips[1]).norm();
        tips.iter().zip(&from_contact).any(|(tip, from_contact)| {
            let contact = tip - from_contact;
            (contact - foot.point).norm() <= far && self.part.closest_point(&contact).1 <= self.limits.uncut
        })
    }
}

impl Measurement {
    /// The figures of the ridges of this surface and of another one together, which was measured by itself.
    pub fn scallops_with(&self, other: &Self, limits: &Limits) -> ScallopFigures {
        let highest = |of: &Self| {
            let ScallopFigures { max_mm, max_at_mm, error_bound_mm, .. } = of.scallop;
            let height = max_mm?;
            let possible = height + error_bound_mm? - NUMERICAL_FLOOR;
            Some(Highest { height, at: max_at_mm?.into(), possible })
        };
        let both = match [self, other].map(highest) {
            [Some(a), Some(b)] => {
                let higher = if b.height > a.height { b } else { a };
                Highest { possible: a.possible.max(b.possible), ..higher }
            }
            [None, Some(_)] => return other.scallop.clone(),
            [_, None] => return self.scallop.clone(),
        };
        let ridges = [&self.ridge_samples[..], &other.ridge_samples].concat();
        scallop_figures(&ridges, Some(both), limits)
    }
}

/// Figures of all ridge samples (height and length, mm). A height is what stands above the design: it is 0 where a
/// ridge lies below.
pub(super) fn scallop_figures(
    ridges: &[[f32; 2]],
    highest: Option<Highest>,
    limits: &Limits,
) -> ScallopFigures {
    let mut figures = ScallopFigures { target_mm: limits.scallop, ..ScallopFigures::default() };
    let samples = || ridges.iter().map(|&[height, length]| [f64::from(height).max(0.0), f64::from(length)]);
    let total: f64 = samples().map(|[_, length]| length).sum();
    let (Some(highest), true) = (highest, total > 0.0) else {
        figures.reason = Some("no ridge stands between passes on the part".into());
        return figures;
    };
    let most = highest.height.max(0.0);
    let mut by_height = ridges.to_vec();
    by_height.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let quantile = |share: f64| {
        let mut below = 0.0;
        by_height
            .iter()
            .find(|[_, length]| {
                below += f64::from(*length);
                below >= share * total
            })
            // Samples are stored rounded.
            .map_or(most, |s| f64::from(s[0]).clamp(0.0, most))
    };
    // From 0.0, since an empty sum is -0.0.
    let over =
        samples().filter(|[height, _]| *height > limits.scallop).fold(0.0, |sum, [_, length]| sum + length);
    figures.max_mm = Some(most);
    figures.max_at_mm = Some(highest.at.into());
    figures.p95_mm = Some(quantile(0.95));
    figures.p50_mm = Some(quantile(0.5));
    figures.mean_mm = Some(samples().map(|[height, length]| height * length).sum::<f64>() / total);
    figures.over_target_fraction = Some(over / total);
    figures.ridge_length_mm = total;
    figures.error_bound_mm = Some(highest.possible.max(0.0) - most + NUMERICAL_FLOOR);
    figures
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What lies below the design is a gouge: no ridge stands there.
    #[test]
    fn ridges_below_the_design_are_no_scallops() {
        let limits = Limits { scallop: 0.01, ..crate::flat_scene::LIMITS };
        let of = |ridges: &[[f32; 2]], height: f64| {
            let highest = Highest { height, at: Point3::origin(), possible: height + 1e-3 };
            let figures = scallop_figures(ridges, Some(highest), &limits);
            let known = [figures.max_mm, figures.p95_mm, figures.p50_mm, figures.mean_mm];
            (known.map(Option::unwrap), figures.error_bound_mm.unwrap())
        };
        let (below, bound) = of(&[[-0.25, 3.0], [-0.5, 1.0]], -0.25);
        assert_eq!((below, bound), ([0.0; 4], NUMERICAL_FLOOR));
        // Above and below in turn.
        let (both, bound) = of(&[[0.25, 1.0], [-0.5, 3.0]], 0.25);
        assert_eq!(both, [0.25, 0.25, 0.0, 0.0625]);
        assert!((bound - 1e-3 - NUMERICAL_FLOOR).abs() < 1e-12, "{bound}");
        // It may stand above by its bound.
        let (nearly, bound) = of(&[[-0.0005, 1.0]], -0.0005);
        assert_eq!(nearly[0], 0.0);
        assert!((bound - 5e-4 - NUMERICAL_FLOOR).abs() < 1e-12, "{bound}");
    }
}
