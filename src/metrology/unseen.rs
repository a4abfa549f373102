//! Dips that no cell centre shows, because they are narrow or another move cut there: where the cutter itself
//! stands in the design.
//!
//! Enters: part, cutter, path, and the pitch of the cells. Leaves: how deep a dip between centres may be at
//! most, and the places of moves that stand deeper in the design than what the cells saw. mm.

use cutter::Cutter;
use geometry::{Point2, Point3, Vector3};
use motion::{Cutters, Toolpath};
use part::Part;
use work::monitor::{self, Cancelled, Monitor};

/// Most places looked at along one move: longer moves at a wider pitch. 3 µs each.
const MOST_ON_A_MOVE: f64 = 1e5;

/// Moves looked at one after the other.
const MOVES_AT_A_TIME: usize = 64;

/// Parts of a step that may hide a dip. More are looked at for nothing, fewer take more rounds.
const CLOSER_STEPS: usize = 8;

/// How often steps are divided at most. Four times bring a step of 0.1 mm to 25 nm.
const MOST_LOOKS: usize = 4;

/// From the design's normal below the tip to that at the contact in so many steps at most: each leaves a
/// share of the error that is the curvature of the design over that of the cutter.
const CONTACT_STEPS: usize = 12;

/// Nearer normals are the same: what the cutter stands deeper by is the radius times half the square.
const SAME_NORMAL: f64 = 1e-4;

/// A contact counts when it lies beside its foot along the normal to this share: not beyond the border.
const BESIDE: f64 = 0.1;

/// How deep the cutter may dip into a level surface between centres `cell` mm apart and none of them be in
/// the dip: w²/8r for a corner of radius r, w the diagonal of a cell. Edges and points may be as deep as half
/// of w.
fn unseen_depth(cutter: &Cutter, cell: f64) -> f64 {
    let (width, corner) = (cell * std::f64::consts::SQRT_2, cutter.corner_radius());
    let rounded = corner > 0.0 && cutter.profile().is_plain();
    let arc = if rounded { width * width / (8.0 * corner) } else { f64::INFINITY };
    arc.min(0.5 * width)
}

/// The greatest [`unseen_depth`] of some cutters.
pub(super) fn most_unseen(cutters: &Cutters, cell: f64) -> f64 {
    cutters.greatest(|cutter| unseen_depth(cutter, cell))
}

/// A place where the cutter stands in the design.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Dip {
    /// How deep, mm.
    pub depth: f64,
    /// How deep since the place looked at before, mm.
    pub possible: f64,
    /// Where.
    pub at: Point2,
    /// The move.
    pub by: u32,
}

/// The places on moves, `pitch` mm apart, where the cutter may stand deeper in the design than `known` mm,
/// the deepest of each. The moves are given by their indices, rising.
pub(super) fn dips(
    part: &Part,
    cutters: &Cutters,
    path: &Toolpath,
    moves: &[u32],
    pitch: f64,
    known: f64,
    monitor: &dyn Monitor,
) -> Result<Vec<Dip>, Cancelled> {
    let top = part.bounds().max.z;
    let runs = work::parallel::try_map(moves.len().div_ceil(MOVES_AT_A_TIME), |run| {
        monitor::check(monitor)?;
        let first = run * MOVES_AT_A_TIME;
        let mut found = Vec::new();
        // Where one move ends the next one begins.
        let mut last: Option<(u32, Option<Dip>)> = None;
        for &by in &moves[first..(first + MOVES_AT_A_TIME).min(moves.len())] {
            let (from, to) = (path.start_of(by as usize), path.moves[by as usize].to.tip);
            if from.z.min(to.z) > top {
                continue;
            }
            let cutter = cutters.of_move(by);
            let at = |share: f64| {
                let dip = dip_at(part, cutter, &(from + (to - from) * share));
                dip.map(|dip| Dip { by, ..dip })
            };
            let length = (to - from).norm();
            let steps = (length / pitch).ceil().clamp(2.0, MOST_ON_A_MOVE) as usize;
            let goes_on = |before: &u32| before + 1 == by && cutters.of_move(*before) == cutter;
            let start = last.filter(|(before, _)| goes_on(before)).map_or_else(|| at(0.0), |(_, dip)| dip);
            let ends = [start, at(1.0)];
            let stretch = Stretch { at: &at, length, shares: [0.0, 1.0], ends };
            let all = stretch.dips(steps, known, MOST_LOOKS).into_iter();
            let deeper =
                |a: &Dip, b: &Dip| a.possible.total_cmp(&b.possible).then(b.depth.total_cmp(&a.depth));
            found.extend(all.max_by(deeper));
            last = Some((by, ends[1]));
        }
        Ok(found)
    })?;
    Ok(runs.into_iter().flatten().collect())
}

/// A stretch of a move.
struct Stretch<'a> {
    /// The dip at a share of the move.
    at: &'a dyn Fn(f64) -> Option<Dip>,
    /// Of the move, mm.
    length: f64,
    /// Of the move, where the stretch begins and ends.
    shares: [f64; 2],
    /// The dips there.
    ends: [Option<Dip>; 2],
}

impl Stretch<'_> {
    /// The places that may be deeper than `known` mm, of those `steps` apart. Where the cutter may stand
    /// deeper between two of them than at either, the places between are looked at, `looks` times over.
    fn dips(&self, steps: usize, known: f64, looks: usize) -> Vec<Dip> {
        let Self { at, length, shares: [from, to], ends } = *self;
        let share = |k: usize| from + (to - from) * (k as f64 / steps as f64);
        let between = (1..steps).map(|k| at(share(k)));
        let along: Vec<Option<Dip>> = [ends[0]].into_iter().chain(between).chain([ends[1]]).collect();
        let step = (to - from) * length / steps as f64;
        let mut found = Vec::new();
        for k in 0..=steps {
            let Some(here) = along[k] else { continue };
            let possible = here.depth.max(before(&along, k, step));
            if possible <= known {
                continue;
            }
            let last = along[k.saturating_sub(1)].map_or(here.depth, |last| last.depth);
            if k == 0 || looks == 0 || here.depth.max(last) > known {
                found.push(Dip { possible, ..here });
            } else {
                let (shares, ends) = ([share(k - 1), share(k)], [along[k - 1], along[k]]);
                found.extend(Stretch { shares, ends, ..*self }.dips(CLOSER_STEPS, known, looks - 1));
            }
        }
        found
    }
}

/// How deep the cutter stands at most between a place and the one before, mm.
///
/// A kink of the depth between two places shows in the second differences around: in those at both places
/// together in full, and it rises above the chord by no more than a quarter of that. At the end of a move
/// only one of them is known, and it rises by no more than that. What bends evenly rises by less. A rigid
/// cutter rises by no more than half of its way `step`, mm, whatever it touches.
fn before(along: &[Option<Dip>], k: usize, step: f64) -> f64 {
    let depth = |k: Option<usize>| along.get(k?).copied().flatten().map(|dip| dip.depth);
    let (Some(here), Some(last)) = (depth(Some(k)), depth(k.checked_sub(1))) else {
        return f64::NEG_INFINITY;
    };
    let bend = |a: Option<f64>, b: f64, c: Option<f64>| Some((a? - 2.0 * b + c?).abs());
    let bends = [bend(depth(k.checked_sub(2)), last, Some(here)), bend(Some(last), here, depth(Some(k + 1)))];
    let rise = match bends {
        [Some(a), Some(b)] => 0.25 * (a + b),
        [Some(bend), None] | [None, Some(bend)] => bend,
        [None, None] => 0.5 * (here - last).abs(),
    };
    here.max(last) + rise.min(0.5 * step)
}

/// How deep the cutter with its tip at `tip` stands in the design where it touches; `None` off the part.
fn dip_at(part: &Part, cutter: &Cutter, tip: &Point3) -> Option<Dip> {
    let dip = |depth: f64, foot: &Point3| Dip { depth, possible: depth, at: foot.xy(), by: 0 };
    let is_beside = |aside: Vector3, height: f64| aside.norm() <= BESIDE * height.abs() + 1e-9;
    let mut normal = if cutter.is_ball() {
        let centre = tip + Vector3::z() * cutter.radius();
        let (foot, distance) = part.closest_point(&centre);
        let depth = cutter.radius() - distance;
        if is_beside(centre - foot.point - foot.normal * distance, depth) {
            return Some(dip(depth, &foot.point));
        }
        foot.normal
    } else {
        part.highest_at(tip.x, tip.y)?.normal
    };
    let mut found = None;
    for _ in 0..CONTACT_STEPS {
        let contact = tip - cutter.contact_to_tip(&normal);
        let (foot, height) = part.closest_point(&contact);
        if is_beside(contact - foot.point - foot.normal * height, height) {
            found = Some(dip(-height, &foot.point));
        }
        if (foot.normal - normal).norm() < SAME_NORMAL {
            break;
        }
        normal = foot.normal;
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::{AnalyticShape, AnalyticSurface};
    use part::Patch;
    use sim::scenes::path_through;
    use work::monitor::Silent;

    #[test]
    fn the_deepest_place_of_a_move_is_that_of_its_cutter() {
        let shape = AnalyticShape::Inclined { height: 0.0, angle: 0.5, azimuth: 0.3 };
        let surface = AnalyticSurface::new(shape, [[0.0, 20.0], [0.0, 20.0]]).unwrap();
        let part = Part::from_patches(vec![Patch::Analytic(surface)], 0.01).unwrap();
        let (foot, cutter) = (part.highest_at(9.0, 11.0).unwrap(), Cutter::bull(6.0, 1.0).unwrap());
        let touching = foot.point + cutter.contact_to_tip(&foot.normal);
        // From 2 mm above the design to 0.25 mm in it.
        let path = path_through([touching + foot.normal * 2.0, touching - foot.normal * 0.25]);
        let all: Vec<u32> = (0..path.len() as u32).collect();
        let found = dips(&part, &cutter.into(), &path, &all, 0.1, 0.1, &Silent).unwrap();
        assert!(found.len() == 1 && (found[0].depth - 0.25).abs() < 1e-9, "{found:?}");
        assert!((found[0].at - Point2::new(9.0, 11.0)).norm() < 1e-6);
        assert!(dips(&part, &cutter.into(), &path, &all, 0.1, 0.4, &Silent).unwrap().is_empty());
    }

    /// Depths along a move that plunges to just the surface, and of one that passes over a crest between two
    /// places.
    #[test]
    fn a_straight_plunge_is_no_deeper_than_its_end_and_a_kink_no_higher_than_told() {
        let dips = |depths: &dyn Fn(f64) -> f64| -> Vec<Option<Dip>> {
            let of = |k: i32| depths(0.1 * f64::from(k));
            (0..9).map(|k| Some(Dip { depth: of(k), possible: of(k), at: Point2::origin(), by: 0 })).collect()
        };
        let plunge = dips(&|s| s - 0.8);
        assert!((1..9).all(|k| (before(&plunge, k, 0.1) - plunge[k].unwrap().depth).abs() < 1e-12));
        for crest in [0.02, 0.06, 0.15, 0.37, 0.41, 0.73, 0.79] {
            let along = dips(&|s| -0.9 * (s - crest).abs());
            let told = (1..9).map(|k| before(&along, k, 0.1)).fold(f64::NEG_INFINITY, f64::max);
            assert!((0.0..0.09).contains(&told), "{crest} {told}");
        }
    }

    #[test]
    fn a_dip_of_the_unseen_depth_is_as_wide_as_a_cell() {
        let cutter = Cutter::ball(6.0).unwrap();
        let depth = unseen_depth(&cutter, 0.2);
        // Half the chord of a circle at that depth.
        let half = (9.0 - (3.0 - depth).powi(2)).sqrt();
        assert!((2.0 * half / (0.2 * 2f64.sqrt()) - 1.0).abs() < 1e-3, "{half}");
        assert!(unseen_depth(&Cutter::flat(6.0).unwrap(), 0.15) > 0.1);
    }
}
