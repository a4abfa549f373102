//! Scallops between passes of constant parameter by a polynomial section, as patented in 2021 (fourth source
//! of `scenes/sources`): a second opinion that knows the design by the contacts of its passes alone.
//!
//! Enters: a part of patches, a ball, a finished path. Leaves: heights, mm, by its steps. S1: the part is a
//! patch F(u, v). S2: a line across the passes is sampled where these cross it. S3: the plane across the feed
//! stands at the first contact, and the neighbours are projected into it. S4, S5: in that plane a polynomial
//! goes through them by least squares. S6: two circles stand around the centres of the ball, their meeting's
//! distance from the polynomial is the height; and so on along all passes.
//!
//! Mended: the centre is the contact plus the radius times the normal, which the patent takes along the axis
//! of the tool. As published it is exact where passes are parallel and the part bends across them only. Where
//! they spread, or the part bends along them too, neighbours lie before or behind the plane, and heights are
//! off by that ([`crate::PairFigures`] are not).
//!
//! Which passes lie on lines of constant parameter is found from their contacts, so that any path is asked.

use std::collections::BTreeMap;

use serde::Serialize;

use cutter::Cutter;
use motion::{CcPoint, ClPoint, MoveKind, Toolpath};
use part::{Part, PatchPoint};
use scallop::{DEFAULT_DEGREE, SectionFrame, fit_section};
use work::monitor::{self, Cancelled, Monitor};

use crate::PairFigures;

/// Contacts by which the line of a pass is found, evenly along it.
const CONTACTS: usize = 64;

/// A contact is off its line by no more than this share of the distance to the next line: between the
/// locations of a pass the ball leaves it a little. A height grows with the square of the interval, so that
/// both passes together change it by a fifth at most. Passes that lie on no such line leave it by as much as
/// they are apart.
const OFF_LINE: f64 = 0.05;

/// A ball's centre stands over its contact within this share of the distance; beside a border it does not.
const UPRIGHT: f64 = 1e-4;

/// Places along the passes of a patch.
const STATIONS: usize = 24;

/// Contacts on either side of a pair that the polynomial goes through.
const BESIDE: usize = 2;

/// Share of the passes that must lie on lines of constant parameter; the rest are short ones along borders.
const MOSTLY: f64 = 0.9;

/// A pair counts where at least this share of its ridge was measured: others have cut away most of the rest,
/// if not all of it.
const LEFT: f64 = 0.5;

/// Heights by polynomial sections.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PolynomialFigures {
    /// Pairs of neighbouring passes whose ridge is left for the most part.
    pub pair_count: usize,
    /// Places at which a height was calculated.
    pub places: usize,
    /// Degree of the polynomial where there are contacts enough.
    pub degree: usize,
    /// Mean height, over the length of the passes.
    pub mean_mm: f64,
    /// Greatest height.
    pub max_mm: f64,
    /// Mean height over the mean measured, of the same pairs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub over_measured: Option<f64>,
}

/// A pass on a line of constant parameter.
#[derive(Debug, Clone, Copy)]
struct Line {
    pass: u32,
    patch: u32,
    /// Which parameter is constant: 0 for u.
    constant: usize,
    level: f64,
    /// Where it surely goes along the other parameter.
    ends: [f64; 2],
    /// How much farther it may go at either end, in that parameter.
    beyond: f64,
    /// A contact is off it by this at most, in the parameter that is constant.
    off: f64,
}

impl Line {
    /// Whether its contacts are near it, measured by the distance of the next one beside it; a line that is
    /// gone along twice is one.
    fn is_apart(&self, all: &[Self]) -> bool {
        let is_beside = |other: &&Self| {
            (other.patch, other.constant) == (self.patch, self.constant)
                && other.ends[0] < self.ends[1]
                && self.ends[0] < other.ends[1]
        };
        let others = all.iter().filter(is_beside);
        let apart = others.map(|other| ((other.level - self.level).abs(), other.off));
        let next = apart.filter(|(apart, off)| *apart > self.off + off).map(|(apart, _)| apart);
        next.min_by(f64::total_cmp).is_some_and(|next| self.off <= OFF_LINE * next)
    }

    /// Whether it goes through a place of the other parameter; `None` where that is not known.
    fn passes(&self, along: f64) -> Option<bool> {
        let off = (self.ends[0] - along).max(along - self.ends[1]);
        if off <= 0.0 {
            Some(true)
        } else if off > self.beyond {
            Some(false)
        } else {
            None
        }
    }
}

/// Sums over the places of a pair.
#[derive(Debug, Clone, Copy, Default)]
struct Sum {
    places: usize,
    length: f64,
    height: f64,
    max: f64,
}

/// Heights between the passes of a path, where a ridge of theirs was measured, beside those measured; `None`
/// where passes are no lines of constant parameter, the cutter is no ball, or no two passes lie beside each
/// other.
///
/// # Errors
/// [`Cancelled`] when the monitor says so.
pub fn polynomial_figures(
    part: &Part,
    cutter: &Cutter,
    path: &Toolpath,
    measured: &PairFigures,
    monitor: &dyn Monitor,
) -> Result<Option<PolynomialFigures>, Cancelled> {
    if part.patches().is_empty() || !cutter.profile().is_ball() {
        return Ok(None);
    }
    let Some(lines) = lines(part, cutter, path, monitor)? else { return Ok(None) };
    let mut pairs: BTreeMap<[u32; 2], Sum> = BTreeMap::new();
    for patch in 0..part.patches().len() as u32 {
        for constant in [0, 1] {
            let of = |line: &&Line| (line.patch, line.constant) == (patch, constant);
            let mut own: Vec<Line> = lines.iter().filter(of).copied().collect();
            own.sort_by(|a, b| a.level.total_cmp(&b.level));
            for station in 0..STATIONS {
                monitor::check(monitor)?;
                across(part, cutter.radius(), &own, station, &mut pairs);
            }
        }
    }
    // Later passes across them take the ridges of a coarse path away.
    let ridges: BTreeMap<[u32; 2], f64> =
        measured.pairs.iter().map(|pair| (pair.passes, pair.ridge_length_mm)).collect();
    pairs.retain(|passes, sum| ridges.get(passes).is_some_and(|length| *length >= LEFT * sum.length));
    let all = pairs.values().fold(Sum::default(), |a, b| Sum {
        places: a.places + b.places,
        length: a.length + b.length,
        height: a.height + b.height,
        max: a.max.max(b.max),
    });
    if all.length <= 0.0 {
        return Ok(None);
    }
    let both = measured.pairs.iter().filter_map(|pair| {
        let sum = pairs.get(&pair.passes).filter(|sum| sum.length > 0.0)?;
        Some([pair.ridge_length_mm * sum.height / sum.length, pair.ridge_length_mm * pair.measured_mean_mm])
    });
    let [ours, theirs] = both.fold([0.0; 2], |a, b| [a[0] + b[0], a[1] + b[1]]);
    Ok(Some(PolynomialFigures {
        pair_count: pairs.len(),
        places: all.places,
        degree: DEFAULT_DEGREE,
        mean_mm: all.height / all.length,
        max_mm: all.max,
        over_measured: (theirs > 0.0).then(|| ours / theirs),
    }))
}

/// The lines of all passes; `None` where they lie on none.
fn lines(
    part: &Part,
    cutter: &Cutter,
    path: &Toolpath,
    monitor: &dyn Monitor,
) -> Result<Option<Vec<Line>>, Cancelled> {
    let mut passes: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (k, step) in path.moves.iter().enumerate() {
        if step.kind == MoveKind::Cut {
            passes.entry(step.pass).or_default().push(k);
        }
    }
    let passes: Vec<(u32, Vec<usize>)> = passes.into_iter().collect();
    let found = work::parallel::try_map(passes.len(), |k| {
        monitor::check(monitor)?;
        let (pass, moves) = &passes[k];
        let on_part = |at: &ClPoint| contact(part, cutter, at);
        let contacts: Vec<PatchPoint> = places(path, moves).iter().filter_map(on_part).collect();
        Ok::<_, Cancelled>(candidates(*pass, &contacts))
    })?;
    let all: Vec<Line> = found.into_iter().flatten().flatten().collect();
    let lines: Vec<Line> = all.iter().filter(|line| line.is_apart(&all)).copied().collect();
    Ok((!lines.is_empty() && lines.len() as f64 >= MOSTLY * passes.len() as f64).then_some(lines))
}

/// Places evenly along the moves of a pass.
fn places(path: &Toolpath, moves: &[usize]) -> Vec<ClPoint> {
    let length = |k: usize| (path.moves[k].to.tip - path.location_before(k).tip).norm();
    let step = moves.iter().map(|k| length(*k)).sum::<f64>() / (CONTACTS - 1) as f64;
    let (mut places, mut done) = (Vec::with_capacity(CONTACTS), 0.0);
    for &k in moves {
        let (from, to, length) = (path.location_before(k), path.moves[k].to, length(k));
        while places.len() < CONTACTS && length > 0.0 {
            let share = (places.len() as f64 * step - done) / length;
            // Rounding must not lose the last one.
            if share > 1.0 + 1e-9 {
                break;
            }
            places.push(from.towards(&to, share.clamp(0.0, 1.0)));
        }
        done += length;
    }
    places
}

/// Where the ball touches the part.
fn contact(part: &Part, cutter: &Cutter, at: &ClPoint) -> Option<PatchPoint> {
    let centre = at.tip + at.axis * cutter.profile().centre_z;
    let foot = part.closest_point(&centre).0;
    let up = centre - foot.point;
    foot.at.filter(|_| up.dot(&foot.normal) >= (1.0 - UPRIGHT) * up.norm())
}

/// The two lines of constant parameter that the contacts of a pass may lie on, near or far; `None` where they
/// are on several patches.
fn candidates(pass: u32, contacts: &[PatchPoint]) -> Option<[Line; 2]> {
    let first = contacts.first()?;
    if contacts.len() < 2 || contacts.iter().any(|at| at.patch != first.patch) {
        return None;
    }
    let sorted = |which: usize| {
        let mut all: Vec<f64> = contacts.iter().map(|at| if which == 0 { at.u } else { at.v }).collect();
        all.sort_by(f64::total_cmp);
        all
    };
    Some([0, 1].map(|constant| {
        let (levels, along) = (sorted(constant), sorted(1 - constant));
        let (level, last) = (levels[levels.len() / 2], levels.len() - 1);
        let off = (level - levels[0]).max(levels[last] - level);
        let beyond = along.windows(2).map(|w| w[1] - w[0]).fold(0.0, f64::max);
        Line { pass, patch: first.patch, constant, level, ends: [along[0], along[last]], beyond, off }
    }))
}

/// Adds the heights between the lines of a patch, sorted by level, on one line across them.
fn across(part: &Part, radius: f64, lines: &[Line], station: usize, pairs: &mut BTreeMap<[u32; 2], Sum>) {
    let Some(first) = lines.first() else { return };
    let patch = &part.patches()[first.patch as usize];
    let [from, to] = patch.domain()[1 - first.constant];
    let step = (to - from) / STATIONS as f64;
    let along = from + (station as f64 + 0.5) * step;
    // Where a line may end, its neighbours are not known.
    let mut here: Vec<&Line> = lines.iter().filter(|line| line.passes(along) != Some(false)).collect();
    here.dedup_by(|a, b| a.level == b.level);
    let contacts: Vec<(CcPoint, geometry::Vector3)> = here
        .iter()
        .map(|line| {
            let [u, v] = if line.constant == 0 { [line.level, along] } else { [along, line.level] };
            let (point, normal) = part.point_and_normal(PatchPoint { patch: line.patch, u, v });
            let jet = patch.jet(u, v);
            (CcPoint { point, normal }, if line.constant == 0 { jet.dv } else { jet.du })
        })
        .collect();
    for k in 1..here.len() {
        if here[k - 1..=k].iter().any(|line| line.passes(along).is_none()) {
            continue;
        }
        let (origin, way) = &contacts[k - 1];
        let Some(feed) = way.try_normalize(1e-300) else { continue };
        let frame =
            SectionFrame { origin: origin.point, across: origin.normal.cross(&feed), up: origin.normal };
        let near = &contacts[(k - 1).saturating_sub(BESIDE)..(k + 1 + BESIDE).min(contacts.len())];
        let near: Vec<CcPoint> = near.iter().map(|(contact, _)| *contact).collect();
        let degree = DEFAULT_DEGREE.min(near.len() - 1);
        let pair = [contacts[k - 1].0, contacts[k].0];
        let Ok(height) = fit_section(frame, &near, degree).and_then(|fit| fit.scallop(&pair, radius)) else {
            continue;
        };
        let [a, b] = [here[k - 1].pass, here[k].pass];
        let sum = pairs.entry([a.min(b), a.max(b)]).or_default();
        let length = way.norm() * step;
        sum.places += 1;
        sum.length += length;
        sum.height += length * height;
        sum.max = sum.max.max(height);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ScallopPair;
    use geometry::{AnalyticShape, AnalyticSurface, Point2, Point3};
    use motion::Move;
    use part::Patch;
    use work::monitor::Silent;

    /// Straight passes of a ball of 6 mm over a plane of 20 × 20 mm.
    fn figures(passes: &[[Point2; 2]]) -> Option<PolynomialFigures> {
        let all = 0..passes.len() as u32;
        let pairs: Vec<[u32; 2]> = all.clone().flat_map(|a| all.clone().map(move |b| [a, b])).collect();
        figures_where(passes, &pairs)
    }

    /// The same where ridges were measured between some pairs alone.
    fn figures_where(passes: &[[Point2; 2]], left: &[[u32; 2]]) -> Option<PolynomialFigures> {
        let shape = AnalyticShape::Plane { height: 0.0 };
        let patch = Patch::Analytic(AnalyticSurface::new(shape, [[0.0, 20.0]; 2]).unwrap());
        let part = Part::from_patches(vec![patch], 0.002).unwrap();
        let mut moves = Vec::new();
        for (ends, pass) in passes.iter().zip(0..) {
            let to = |p: &Point2, z: f64, kind| {
                let to = ClPoint::upright(Point3::new(p.x, p.y, z));
                Move { to, kind, feed_rate: 1000.0, pass }
            };
            moves.push(to(&ends[0], 5.0, MoveKind::Rapid));
            moves.push(to(&ends[0], 0.0, MoveKind::Plunge));
            moves.push(to(&ends[1], 0.0, MoveKind::Cut));
            moves.push(to(&ends[1], 5.0, MoveKind::Retract));
        }
        let path = Toolpath::new(ClPoint::upright(Point3::new(0.0, 0.0, 5.0)), moves);
        let cutter = Cutter::ball(6.0).unwrap();
        let pairs = left.iter().map(|passes| measured(*passes)).collect();
        let measured = PairFigures { pairs, ..PairFigures::default() };
        polynomial_figures(&part, &cutter, &path, &measured, &Silent).unwrap()
    }

    fn measured(passes: [u32; 2]) -> ScallopPair {
        ScallopPair {
            passes,
            crossings: 100,
            ridge_length_mm: 20.0,
            measured_mean_mm: 0.01,
            measured_max_mm: 0.01,
            calculated_places: 0,
            parallel: true,
            calculated_mean_mm: None,
            calculated_max_mm: None,
            section_mean_mm: None,
            calculated_over_measured: None,
            greatest_difference_mm: None,
        }
    }

    /// Coarse passes, and finer ones across them: what stood between the coarse ones was cut away.
    #[test]
    fn ridges_that_were_cut_away_do_not_count() {
        let across: Vec<[Point2; 2]> = (0..5)
            .map(|k| 2.0 + 4.0 * f64::from(k))
            .map(|x| [Point2::new(x, 0.5), Point2::new(x, 19.5)])
            .collect();
        let along =
            (0..39).map(|k| 0.5 + 0.5 * f64::from(k)).map(|y| [Point2::new(0.5, y), Point2::new(19.5, y)]);
        let all: Vec<[Point2; 2]> = across.into_iter().chain(along).collect();
        let left: Vec<[u32; 2]> = (5..43).map(|k| [k, k + 1]).collect();
        let found = figures_where(&all, &left).unwrap();
        let exact = 3.0 - (9.0 - 0.0625f64).sqrt();
        assert_eq!(found.pair_count, 38);
        for height in [found.mean_mm, found.max_mm] {
            assert!((height / exact - 1.0).abs() < 1e-3, "{height} {exact}");
        }
        assert_eq!(figures_where(&all, &[]), None);
    }

    /// Passes `step` mm apart in two pieces each, which turn by a slope.
    fn passes(step: f64, slope: f64) -> Vec<[Point2; 2]> {
        let at = |x: f64, y: f64| Point2::new(x, y + slope * (x - 10.0));
        let pieces = |y: f64| [[at(0.5, y), at(9.0, y)], [at(9.5, y), at(19.5, y)]];
        (0..12).flat_map(|k| pieces(4.0 + step * f64::from(k))).collect()
    }

    /// Heights on a plane have a closed form, whatever the distance of passes; passes askew lie on no lines
    /// of the patch.
    #[test]
    fn lines_are_told_by_their_distance_from_each_other() {
        for step in [0.02, 0.2, 0.8] {
            let found = figures(&passes(step, 0.0)).unwrap();
            let exact = 3.0 - (9.0 - 0.25 * step * step).sqrt();
            assert!((found.mean_mm / exact - 1.0).abs() < 1e-3, "{step}: {} {exact}", found.mean_mm);
            // As far as they stray by a hundredth of their distance they are still lines; by half of it no
            // longer.
            assert!(figures(&passes(step, 0.001 * step)).is_some(), "{step}");
            assert!(figures(&passes(step, 0.05 * step)).is_none(), "{step}");
        }
        assert!(figures(&passes(0.5, 0.5)).is_none());
    }
}
