//! Figures of what a program removes on its way: volume, rate, engagement, rapid moves in stock.
//!
//! Enters: the path and what an engine that keeps the order of the program found for each of its moves: the
//! z-map of upright tools, or voxels. Leaves: the figures of report.json, in mm, mm³ and mm³/min. Rates are
//! at the programmed feed; where the machine is slower than that, at corners and in short moves, they are
//! lower.

use serde::Serialize;

use geometry::Vector3;
use motion::{MoveKind, Toolpath};
use sim::{ENGAGED, MoveRemoval, RapidContact, Removal, VoxelRemoval};

/// Rates are means over consecutive feed moves of at least so many cells of travel. Fewer let the
/// cells show that a steep cutter clears at a time; more smooth true peaks away.
const STRETCH_CELLS: f64 = 4.0;

/// Moves longer than so many stretches are held against the greatest section of what they cut: the mean over
/// them may hide a peak.
const LONG: f64 = 4.0;

/// Rapid moves that are listed, the first ones of the program.
const LISTED_CONTACTS: usize = 100;

/// A rapid move that touched stock.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RapidContactFigures {
    /// The move, counted from 0.
    #[serde(rename = "move")]
    pub move_index: u32,
    /// Its line in toolpath.nc, counted from 1.
    pub line: u32,
    /// Its tool, where the program has several.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tool: Option<u32>,
    /// The cell that the cutter touched first, and the height of stock there; by voxels the voxel.
    pub at_mm: [f64; 3],
    /// Greatest height that the move removed at a cell; by voxels at least how far below the surface that
    /// stood it cut.
    pub depth_mm: f64,
}

/// What a program removes. Rates and engagement are those of feed moves.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct RemovalFigures {
    /// Pitch of the cells or voxels.
    pub cell_mm: f64,
    /// Volume of stock removed by all moves.
    pub volume_mm3: f64,
    /// Bound of its error.
    pub volume_error_bound_mm3: f64,
    /// Volume over the time of the feed moves that removed anything.
    pub mean_material_removal_rate_mm3_min: f64,
    /// 95 % of the time in material the rate is lower.
    pub p95_material_removal_rate_mm3_min: f64,
    /// Greatest rate over a few cells of travel; of a long move over what it cuts.
    pub max_material_removal_rate_mm3_min: f64,
    /// Bound of its error.
    pub max_material_removal_rate_error_bound_mm3_min: f64,
    /// As far as cells see, the rate is nowhere greater, also in a part of a long move: held against the
    /// greatest width times the greatest depth of what the move cuts, which may be much more than its
    /// section. Not by voxels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub material_removal_rate_at_most_mm3_min: Option<f64>,
    /// The move that ends the stretch with the greatest rate, counted from 0.
    pub max_material_removal_rate_move: u32,
    /// Greatest height above the tip, along the tool axis, at which the cutter met stock, at the centres of
    /// cells or voxels. By cells never too great: what stands between centres is not seen, and may be as high
    /// as the stock before the first cut.
    pub max_axial_engagement_mm: f64,
    /// Bound of its error. By voxels slivers thinner than one are left out. By cells nothing is left out: no
    /// move meets stock higher than from the lowest tip to the top of the stock before the first cut. Work in
    /// layers has a wide bound for that.
    pub max_axial_engagement_error_bound_mm: f64,
    /// Greatest extent of what one move cut, across its direction; moves along the axis left out.
    pub max_radial_engagement_mm: f64,
    /// Bound of its error, lips thinner than a cell left out.
    pub max_radial_engagement_error_bound_mm: f64,
    /// Greatest difference at a cell between the heights of the two engines, which work apart; not by voxels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub engine_difference_mm: Option<f64>,
    /// Rapid moves that touched stock, the first ones.
    pub rapid_contacts: Vec<RapidContactFigures>,
    /// Number of rapid moves that touched stock, listed or not.
    pub rapid_contact_count: usize,
}

/// Consecutive feed moves.
#[derive(Debug, Clone, Copy, Default)]
struct Stretch {
    length: f64,
    minutes: f64,
    volume: f64,
    bound: f64,
    last: u32,
    /// The rate exceeds this nowhere on its long moves.
    peak: f64,
}

impl Stretch {
    fn rate(&self) -> f64 {
        self.volume / self.minutes
    }
}

/// What an engine found, by cells or voxels of a pitch, mm.
struct RemovalRecord<'a> {
    moves: &'a [MoveRemoval],
    contacts: &'a [RapidContact],
    volume_bound: f64,
    pitch: f64,
    axial: AxialBound,
}

impl RemovalRecord<'_> {
    /// How much of a move cuts, mm: as far as what it cut reaches along it, and never less than a stretch; of
    /// a plunge what it is deep.
    fn in_material(&self, removed: &MoveRemoval, way: Vector3, least: f64) -> f64 {
        let (length, in_plan) = (way.norm(), way.xy().norm());
        let reaches = match self.axial {
            AxialBound::Of(_) => length,
            AxialBound::Top(_) if in_plan > 1e-9 * length => (removed.along * length / in_plan).max(least),
            AxialBound::Top(_) => removed.depth,
        };
        if removed.depth > ENGAGED { reaches.min(length) } else { length }
    }

    /// By cells: no more is cut for a mm of the way, mm². Ahead it is a section, and below a cutter that goes
    /// down what it stands on.
    fn greatest_section(&self, removed: &MoveRemoval, way: Vector3) -> f64 {
        let wide = removed.radial + removed.radial_bound;
        let down = (-way.z / way.norm()).max(0.0);
        let stands_on = wide * if removed.along > 0.0 { removed.along } else { wide };
        wide * removed.depth + stands_on * down
    }
}

/// What bounds the greatest axial engagement.
enum AxialBound {
    /// Itself, mm.
    Of(f64),
    /// The height over which nothing stood before the first cut, mm.
    Top(f64),
}

/// The figures of a removal along `path`; `final_height` is what the other engine left, mm, cell by
/// cell. Nothing stood over `top`, mm, before the first cut.
pub fn removal_figures(path: &Toolpath, removal: &Removal, final_height: &[f32], top: f64) -> RemovalFigures {
    let Removal { stock, moves, rapid_contacts, volume_bound } = removal;
    let pitch = stock.grid.cell;
    let (contacts, volume_bound) = (&rapid_contacts[..], *volume_bound);
    let found = RemovalRecord { moves, contacts, volume_bound, pitch, axial: AxialBound::Top(top) };
    let apart = |(a, b): (&f32, &f32)| f64::from((a - b).abs());
    let difference = stock.height.iter().zip(final_height).map(apart).fold(0.0, f64::max);
    RemovalFigures { engine_difference_mm: Some(difference), ..figures(path, &found) }
}

/// The figures of a removal along `path` by voxels of `voxel` mm, whatever the tool axis.
pub fn voxel_removal_figures(path: &Toolpath, removal: &VoxelRemoval, voxel: f64) -> RemovalFigures {
    let VoxelRemoval { moves, rapid_contacts, volume_bound } = removal;
    let (contacts, volume_bound) = (&rapid_contacts[..], *volume_bound);
    // What is cut of a voxel lies no farther from its middle than its corners.
    let axial = AxialBound::Of(0.5 * 3f64.sqrt() * voxel);
    figures(path, &RemovalRecord { moves, contacts, volume_bound, pitch: voxel, axial })
}

fn figures(path: &Toolpath, found: &RemovalRecord<'_>) -> RemovalFigures {
    let mut figures = RemovalFigures {
        cell_mm: found.pitch,
        volume_mm3: found.moves.iter().map(|m| m.volume).sum(),
        volume_error_bound_mm3: found.volume_bound,
        rapid_contact_count: found.contacts.len(),
        ..RemovalFigures::default()
    };
    let listed = found.contacts.iter().take(LISTED_CONTACTS);
    figures.rapid_contacts = listed
        .map(|c| RapidContactFigures {
            move_index: c.move_index,
            line: 0,
            tool: None,
            at_mm: c.at.into(),
            depth_mm: c.depth,
        })
        .collect();
    engagement(&mut figures, path, found.moves);
    figures.max_axial_engagement_error_bound_mm = match found.axial {
        AxialBound::Of(bound) => bound,
        AxialBound::Top(top) => below(path, top, figures.max_axial_engagement_mm),
    };
    rates(&mut figures, path, found);
    figures
}

fn engagement(figures: &mut RemovalFigures, path: &Toolpath, moves: &[MoveRemoval]) {
    for ((k, (from, to, m)), removed) in path.segments().enumerate().zip(moves) {
        if m.kind == MoveKind::Rapid {
            continue;
        }
        figures.max_axial_engagement_mm = figures.max_axial_engagement_mm.max(removed.axial);
        let across = (to - from).cross(&path.location_before(k).axis);
        if across != Vector3::zeros() && removed.radial > figures.max_radial_engagement_mm {
            figures.max_radial_engagement_mm = removed.radial;
            figures.max_radial_engagement_error_bound_mm = removed.radial_bound;
        }
    }
}

/// How much higher than `found` stock can stand over the tip of a feed move, where it ends at `top`, mm.
fn below(path: &Toolpath, top: f64, found: f64) -> f64 {
    let feeds = path.segments().filter(|(_, _, m)| m.kind != MoveKind::Rapid);
    let lowest = feeds.map(|(from, to, _)| from.z.min(to.z)).fold(top, f64::min);
    // Heights are stored as f32.
    let rounding = f64::from(f32::EPSILON) * top.abs().max(lowest.abs());
    (top - lowest - found).max(0.0) + rounding
}

fn rates(figures: &mut RemovalFigures, path: &Toolpath, found: &RemovalRecord<'_>) {
    // A hair less, so that moves of just the length do not go in pairs.
    let least = STRETCH_CELLS * found.pitch * (1.0 - 1e-9);
    let (mut volume, mut minutes) = (0.0, 0.0);
    let mut stretches: Vec<Stretch> = Vec::new();
    // Whether the last of the stretches ends where the open one begins.
    let mut goes_on = false;
    let mut stretch = Stretch::default();
    for ((k, (from, to, m)), removed) in path.segments().enumerate().zip(found.moves) {
        if m.kind == MoveKind::Rapid || m.feed_rate.is_nan() || m.feed_rate <= 0.0 {
            rest(&mut stretches, std::mem::take(&mut stretch), goes_on);
            goes_on = false;
            continue;
        }
        let length = (to - from).norm();
        if removed.volume > 0.0 {
            volume += removed.volume;
            minutes += length / m.feed_rate;
        }
        stretch.length += length;
        stretch.minutes += found.in_material(removed, to - from, least) / m.feed_rate;
        stretch.volume += removed.volume;
        stretch.bound += removed.volume_bound;
        stretch.last = k as u32;
        if length > LONG * least {
            stretch.peak = stretch.peak.max(found.greatest_section(removed, to - from) * m.feed_rate);
        }
        if stretch.length >= least {
            goes_on = stretch.volume > 0.0;
            stretches.extend(Some(std::mem::take(&mut stretch)).filter(|s| s.volume > 0.0));
        }
    }
    rest(&mut stretches, stretch, goes_on);
    if minutes > 0.0 {
        figures.mean_material_removal_rate_mm3_min = volume / minutes;
    }
    let upper = stretches.iter().map(|s| s.peak.max((s.volume + s.bound) / s.minutes)).fold(0.0, f64::max);
    stretches.sort_by(|a, b| a.rate().total_cmp(&b.rate()));
    let Some(greatest) = stretches.last() else { return };
    figures.max_material_removal_rate_mm3_min = greatest.rate();
    figures.max_material_removal_rate_error_bound_mm3_min = greatest.bound / greatest.minutes;
    figures.material_removal_rate_at_most_mm3_min =
        matches!(found.axial, AxialBound::Top(_)).then_some(upper);
    figures.max_material_removal_rate_move = greatest.last;
    let in_material: f64 = stretches.iter().map(|s| s.minutes).sum();
    let mut below = 0.0;
    for s in &stretches {
        below += s.minutes;
        if below >= 0.95 * in_material {
            figures.p95_material_removal_rate_mm3_min = s.rate();
            break;
        }
    }
}

/// What is left before a rapid move or the end belongs to the stretch that it goes on from, or is one of its
/// own.
fn rest(stretches: &mut Vec<Stretch>, rest: Stretch, goes_on: bool) {
    match stretches.last_mut().filter(|_| goes_on) {
        _ if rest.volume <= 0.0 => {}
        None => stretches.push(rest),
        Some(last) => {
            last.length += rest.length;
            last.minutes += rest.minutes;
            last.volume += rest.volume;
            last.bound += rest.bound;
            last.last = rest.last;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cutter::Cutter;
    use geometry::{Aabb, Point2, Point3};
    use motion::{ClPoint, Move};
    use sim::{Grid, ZMap, cut_in_order};
    use work::monitor::Silent;

    const TOP: f64 = 0.0;

    fn to(x: f64, y: f64, z: f64, kind: MoveKind) -> Move {
        Move { to: ClPoint::upright(Point3::new(x, y, z)), kind, feed_rate: 600.0, pass: 0 }
    }

    /// A block of 40 × 20 mm whose top is [`TOP`]; no centre of a cell lies within 0.025 mm of a multiple of
    /// 0.05 mm.
    fn cut_from_block(cutter: &Cutter, path: &Toolpath) -> RemovalFigures {
        let grid = Grid { origin: Point2::new(0.025, 0.025), cell: 0.05, nx: 800, ny: 400 };
        let removal = cut_in_order(ZMap::block(grid, TOP), cutter, path, &Silent).unwrap();
        removal_figures(path, &removal, &removal.stock.height, TOP)
    }

    /// A flat end of 6 mm in a slot 2 mm deep at 600 mm/min, in moves of 1 mm, with rapids about it.
    fn slot(rapid_height: f64) -> (Toolpath, RemovalFigures) {
        let to = |x: f64, z: f64, kind| to(x, 10.0, z, kind);
        let mut moves = vec![to(-5.0, -2.0, MoveKind::Plunge)];
        moves.extend((0..30).map(|k| to(f64::from(k - 4), -2.0, MoveKind::Cut)));
        moves.push(to(25.0, rapid_height, MoveKind::Retract));
        moves.push(to(35.0, rapid_height, MoveKind::Rapid));
        let path = Toolpath::new(ClPoint::upright(Point3::new(-5.0, 10.0, 5.0)), moves);
        let figures = cut_from_block(&Cutter::flat(6.0).unwrap(), &path);
        (path, figures)
    }

    #[test]
    fn a_slot_has_the_rate_of_its_cross_section() {
        let (_, figures) = slot(5.0);
        // Cross section times feed: 6 · 2 · 600.
        let off = (figures.max_material_removal_rate_mm3_min - 7200.0).abs();
        assert!(off <= figures.max_material_removal_rate_error_bound_mm3_min, "{figures:?}");
        assert!((figures.p95_material_removal_rate_mm3_min / 7200.0 - 1.0).abs() < 0.02, "{figures:?}");
        let half_disc = 0.5 * std::f64::consts::PI * 9.0;
        let off = (figures.volume_mm3 - 2.0 * (25.0 * 6.0 + half_disc)).abs();
        assert!(off <= figures.volume_error_bound_mm3 && off < 0.5, "{figures:?}");
        assert!(figures.max_axial_engagement_mm == 2.0 && figures.max_axial_engagement_error_bound_mm < 1e-6);
        let off = (figures.max_radial_engagement_mm - 6.0).abs();
        assert!(off <= figures.max_radial_engagement_error_bound_mm, "{figures:?}");
        assert_eq!((figures.rapid_contact_count, figures.engine_difference_mm), (0, Some(0.0)));
    }

    /// Told from long moves that begin in the air, and from short ones before a rapid move.
    #[test]
    fn no_move_is_too_long_or_too_short_for_a_rate() {
        let cutter = Cutter::flat(6.0).unwrap();
        let greatest = |start: [f64; 3], moves: Vec<Move>| {
            let path = Toolpath::new(ClPoint::upright(Point3::from(start)), moves);
            let figures = cut_from_block(&cutter, &path);
            [
                figures.max_material_removal_rate_mm3_min,
                figures.max_material_removal_rate_error_bound_mm3_min,
                figures.material_removal_rate_at_most_mm3_min.unwrap(),
            ]
        };
        // A slot of 6 by 2 mm with a round end, half of whose move is in the air.
        let [rate, bound, most] = greatest([-24.0, 10.0, -2.0], vec![to(20.0, 10.0, -2.0, MoveKind::Cut)]);
        let mean = 2.0 * (20.0 * 6.0 + 4.5 * std::f64::consts::PI) / 23.0 * 600.0;
        assert!((rate - mean).abs() <= bound && bound < 100.0, "{rate} ± {bound}: {mean}");
        assert!((7200.0..7300.0).contains(&most), "{most}");
        // A ramp takes twice the mean where it is deepest.
        let [rate, _, most] = greatest([0.0, 10.0, 0.0], vec![to(36.0, 10.0, -2.0, MoveKind::Cut)]);
        assert!(rate < 5000.0 && most >= 7200.0, "{rate}, {most}");
        // Down a steep ramp the bottom cuts all at once.
        let [_, _, most] = greatest([20.0, 10.0, 0.0], vec![to(21.0, 10.0, -1.0, MoveKind::Cut)]);
        assert!(most >= 9.0 * std::f64::consts::PI * 600.0 * 0.5f64.sqrt(), "{most}");
        // A plunge of three cells' length, the first of them in the air, and a rapid move.
        let plunge = vec![to(20.0, 10.0, -0.1, MoveKind::Plunge), to(20.0, 10.0, 5.0, MoveKind::Rapid)];
        let [rate, bound, most] = greatest([20.0, 10.0, 0.05], plunge);
        let truth = 9.0 * std::f64::consts::PI * 600.0;
        assert!(rate > 0.0 && (rate - truth).abs() <= bound && most >= truth, "{rate} ± {bound}: {truth}");
    }

    /// Whatever the cells, stock is as large as it is.
    #[test]
    fn volumes_end_where_the_stock_does() {
        let area = Aabb { min: Point3::new(0.0, 0.0, -8.0), max: Point3::new(40.0, 30.0, 1.0) };
        for cell in [0.33, 0.7, 7.0, 60.0] {
            let grid = Grid::covering(&area, cell, 1, 1 << 30).unwrap();
            let passes = (0..9).flat_map(|k| {
                let (y, x) = (4.0 * f64::from(k), if k % 2 == 0 { 45.0 } else { -5.0 });
                [to(40.0 - x, y, 0.0, MoveKind::Cut), to(x, y, 0.0, MoveKind::Cut)]
            });
            let path = Toolpath::new(ClPoint::upright(Point3::new(-5.0, 0.0, 0.0)), passes.collect());
            let stock = ZMap::block(grid, 1.0).within(&area);
            let removal = cut_in_order(stock, &Cutter::flat(6.0).unwrap(), &path, &Silent).unwrap();
            let figures = removal_figures(&path, &removal, &removal.stock.height, 1.0);
            let off = (figures.volume_mm3 - 1200.0).abs();
            assert!(off <= figures.volume_error_bound_mm3 + 1e-6, "{cell}: {figures:?}");
        }
    }

    #[test]
    fn a_rapid_below_the_top_is_found_where_it_enters() {
        let (path, figures) = slot(-0.5);
        let contact = figures.rapid_contacts[0];
        assert_eq!((figures.rapid_contact_count, contact.move_index), (1, path.len() as u32 - 1));
        // Somewhere along the slot's round end, which the whole front of the cutter leaves at once.
        let from_end = (contact.at_mm[0] - 25.0).hypot(contact.at_mm[1] - 10.0);
        assert!((3.0..3.05).contains(&from_end) && contact.at_mm[0] > 25.0, "{contact:?}");
        assert_eq!(contact.at_mm[2], 0.0);
        assert!((contact.depth_mm - 0.5).abs() < 1e-6, "{contact:?}");
    }

    /// Passes of a flat end of 6 mm along x at these y and z.
    fn passes(at: &[[f64; 2]]) -> RemovalFigures {
        let pass = |&[y, z]: &[f64; 2]| {
            [
                to(-5.0, y, 5.0, MoveKind::Rapid),
                to(-5.0, y, z, MoveKind::Plunge),
                to(45.0, y, z, MoveKind::Cut),
                to(45.0, y, 5.0, MoveKind::Retract),
            ]
        };
        let path =
            Toolpath::new(ClPoint::upright(Point3::new(-5.0, 5.0, 5.0)), at.iter().flat_map(pass).collect());
        cut_from_block(&Cutter::flat(6.0).unwrap(), &path)
    }

    /// Where the true height lies, by the closed form, and how far it may be from what centres see.
    fn lies_within(figures: &RemovalFigures, seen: f64, truth: f64) {
        let RemovalFigures {
            max_axial_engagement_mm: found, max_axial_engagement_error_bound_mm: bound, ..
        } = *figures;
        assert!((found - seen).abs() < 1e-6, "{found} {seen}");
        assert!(found <= truth + 1e-6 && truth <= found + bound, "{found} ± {bound}: {truth}");
    }

    /// What stands between the centres of cells is not seen, however high, and lies within the bound.
    #[test]
    fn axial_engagement_between_the_centres_is_within_its_bound() {
        // A rib of 0.02 mm between two slots, which the third pass takes.
        lies_within(&passes(&[[6.99, -4.0], [13.01, -4.0], [10.0, -6.0]]), 4.0, 6.0);
        // A step: the wall of the first slot is cut back by 0.02 mm in its full height.
        lies_within(&passes(&[[10.0, -3.0], [10.02, -5.0]]), 3.0, 5.0);
        // As wide as a cell, both are seen.
        lies_within(&passes(&[[6.97, -4.0], [13.03, -4.0], [10.0, -6.0]]), 6.0, 6.0);
        lies_within(&passes(&[[10.0, -3.0], [10.06, -5.0]]), 5.0, 5.0);
        // In layers nothing stands over the second but what the first left: the bound is true, and wide.
        let layers = passes(&[[10.0, -2.0], [10.0, -4.0]]);
        lies_within(&layers, 2.0, 2.0);
        assert!((layers.max_axial_engagement_error_bound_mm - 2.0).abs() < 1e-6, "{layers:?}");
    }

    /// The lowest tip in the full block is met up to its top; centres beside it miss what the wave rises
    /// until there.
    #[test]
    fn axial_engagement_of_a_ball_in_a_wave() {
        let wave = |x: f64| -1.0 - 0.4 * (x / 2.0).sin();
        let moves = (0..=900)
            .map(|k| to(0.05 * f64::from(k) - 3.0, 10.0, wave(0.05 * f64::from(k) - 3.0), MoveKind::Cut));
        let moves: Vec<Move> = moves.collect();
        let lowest = moves.iter().map(|m| m.to.tip.z).fold(TOP, f64::min);
        let path = Toolpath::new(ClPoint::upright(Point3::new(-3.0, 10.0, wave(-3.0))), moves);
        let figures = cut_from_block(&Cutter::ball(6.0).unwrap(), &path);
        let (found, bound) = (figures.max_axial_engagement_mm, figures.max_axial_engagement_error_bound_mm);
        let truth = TOP - lowest;
        assert!(found <= truth + 1e-6 && truth <= found + bound, "{found} ± {bound}: {truth}");
        // A centre is half a cell from the place at most, where the wave rises by its curvature.
        assert!(bound <= 0.5 * 0.1 * 0.05f64.powi(2) + 1e-6, "{bound}");
    }
}
