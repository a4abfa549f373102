//! Defects narrower than a cell, which only finer cells show.

use millstream::cutter::Cutter;
use millstream::geometry::{AnalyticShape, Point3};
use millstream::metrology::{Asked, Limits, Measurement, measure};
use millstream::monitor::Silent;
use millstream::motion::{ClPoint, Move, MoveKind, Toolpath};
use millstream::part::Part;
use millstream::sim::{Grid, ZMap, cut};

use crate::support::{LIMITS, formula};

/// Height of the stock over the plane, mm.
const ALLOWANCE: f64 = 1.0;

const ASKED: f64 = 0.0005;

/// Cells that the refinement may hold: enough for a rectangle of 10 × 10 cells halved six times.
const CELLS: usize = 1 << 20;

fn plane() -> Part {
    formula(AnalyticShape::Plane { height: 0.0 }, [0.0, 4.0], [0.0, 4.0])
}

/// Passes along x, from end to end beyond the part, each with its y; `dip` lowers the cutter in the middle
/// of the pass with that number.
fn passes(lines: &[f64], dip: Option<(usize, f64)>) -> Toolpath {
    let tip = |x, y, z| ClPoint::upright(Point3::new(x, y, z));
    let mut moves = Vec::new();
    for (k, &y) in lines.iter().enumerate() {
        let depth = dip.filter(|d| d.0 == k).map_or(0.0, |d| d.1);
        let to = |x, z, kind| Move { to: tip(x, y, z), kind, feed_rate: 1000.0, pass: k as u32 };
        moves.push(to(-5.0, 5.0, MoveKind::Rapid));
        moves.push(to(-5.0, 0.0, MoveKind::Plunge));
        moves.push(to(1.7, 0.0, MoveKind::Cut));
        moves.push(to(1.93, -depth, MoveKind::Cut));
        moves.push(to(2.2, 0.0, MoveKind::Cut));
        moves.push(to(9.0, 0.0, MoveKind::Cut));
        moves.push(to(9.0, 5.0, MoveKind::Retract));
    }
    Toolpath::new(tip(-5.0, -5.0, 5.0), moves)
}

/// Centres at the odd multiples of half a cell.
fn measured(cutter: &Cutter, path: &Toolpath, cell: f64, limits: &Limits, cells: usize) -> Measurement {
    let part = plane();
    let grid = Grid::covering(&part.bounds(), cell, 64, 1 << 32).unwrap();
    let stock = cut(ZMap::block(grid, ALLOWANCE), cutter, path, &Silent).unwrap();
    let asked = Asked {
        allowed_depth: 0.0,
        error_bound: ASKED,
        most_cells: cells,
        most_squares: 1 << 22,
        is_first_look: false,
        border_cuts: true,
        steep_elsewhere: false,
    };
    measure(&part, cutter, path, &stock, limits, &asked, &Silent).unwrap()
}

/// A flat of 2 mm leaves a lip of `width` mm at y = 2, between the centres at 1.95 and 2.05.
fn lip(width: f64, cells: usize) -> Measurement {
    let half = 1.0 + 0.5 * width;
    let path = passes(&[2.0 - half - 1.0, 2.0 - half, 2.0 + half, 2.0 + half + 1.0], None);
    measured(&Cutter::flat(2.0).unwrap(), &path, 0.1, &LIMITS, cells)
}

#[test]
fn a_lip_between_two_rows_of_cells_is_found_with_its_height() {
    for width in [0.06, 0.02, 0.004] {
        let m = lip(width, CELLS);
        println!("lip {width}: {:?} {:?}", m.uncut, m.refined);
        assert!((m.uncut.max_height_mm - ALLOWANCE).abs() <= m.uncut.error_bound_mm, "{:?}", m.uncut);
        assert!(m.uncut.error_bound_mm <= ASKED + 1e-6, "{:?}", m.uncut);
        assert_eq!((m.uncut.region_count, m.refined.note.clone()), (1, None));
        let at = m.uncut.regions[0].at_mm;
        assert!((at[1] - 2.0).abs() <= 0.5 * width && at[2] == 0.0, "{at:?}");
        assert!(m.refined.rectangles >= 1 && m.refined.finest_cell < 0.1);
    }
}

/// No move passes over the lip: that stock stands there is known without a look at it.
#[test]
fn a_lip_that_may_not_be_looked_at_is_found_all_the_same() {
    let m = lip(0.02, 0);
    assert!((m.uncut.max_height_mm - ALLOWANCE).abs() <= m.uncut.error_bound_mm, "{:?}", m.uncut);
    assert!(m.uncut.error_bound_mm <= ASKED + 1e-6, "{:?}", m.uncut);
    assert_eq!(m.refined.note, None);
    // Without a lip nothing is suspected.
    let m = lip(-0.02, CELLS);
    assert_eq!((m.uncut.max_height_mm, m.refined.rectangles, m.refined.note), (0.0, 0, None));
    assert!(m.uncut.error_bound_mm <= 1e-6);
}

/// A ball of 0.2 mm on passes 0.05 mm apart; the one at y = 2, between the centres at 1.95 and 2.05, dips.
fn dip(depth: f64, cells: usize) -> Measurement {
    measured(&Cutter::ball(0.2).unwrap(), &passes(&lines(0.05), Some((44, depth))), 0.1, &LIMITS, cells)
}

/// Lines at the multiples of a distance from -0.2 to 4.2.
fn lines(distance: f64) -> Vec<f64> {
    let [first, last] = [-0.2, 4.2f64].map(|y| (y / distance).round() as i32);
    (first..=last).map(|k| distance * f64::from(k)).collect()
}

/// With finer cells or without.
#[test]
fn a_dip_between_two_rows_of_cells_is_found_with_its_depth() {
    for (depth, cells) in [(0.0115, CELLS), (0.006, CELLS), (0.002, CELLS), (0.0115, 0), (0.002, 0)] {
        let m = dip(depth, cells);
        println!("dip {depth}: {:?} {:?}", m.gouge, m.refined);
        assert!((m.gouge.max_depth_mm - depth).abs() <= m.gouge.error_bound_mm, "{:?}", m.gouge);
        assert!(m.gouge.error_bound_mm <= ASKED + 1e-6, "{:?}", m.gouge);
        assert_eq!(m.gouge.region_count, usize::from(depth > LIMITS.gouge));
        if let Some(region) = m.gouge.regions.first() {
            assert!((region.at_mm[0] - 1.93).abs() < 0.02 && (region.at_mm[1] - 2.0).abs() < 0.01);
            assert!((44 * 7..45 * 7).contains(&region.move_index), "{region:?}");
        }
    }
}

#[test]
fn bounds_that_hold_are_left_alone() {
    let ball = Cutter::ball(0.2).unwrap();
    let m = measured(&ball, &passes(&lines(0.1), None), 0.02, &LIMITS, CELLS);
    assert_eq!((m.refined.rectangles, m.refined.finest_cell, m.refined.note), (0, 0.02, None));
    assert_eq!(m.gouge.max_depth_mm, 0.0);
    assert!((m.scallop.max_mm.unwrap() - scallop(0.1)).abs() < 1e-6, "{:?}", m.scallop);
}

/// Height of the ridge between passes of the ball, mm.
fn scallop(distance: f64) -> f64 {
    0.1 - (0.01 - 0.25 * distance * distance).sqrt()
}

/// Every second pass lies between the rows of cells, which see the others only: the ridges are those of all
/// passes.
#[test]
fn passes_between_the_cells_leave_their_ridges() {
    let m = dip(0.0, CELLS);
    let (max, bound) = (m.scallop.max_mm.unwrap(), m.scallop.error_bound_mm.unwrap());
    assert!((max - scallop(0.05)).abs() <= 1e-6 && bound <= ASKED, "{max} {bound}");
    for height in [m.scallop.p95_mm, m.scallop.p50_mm] {
        assert!((height.unwrap() - scallop(0.05)).abs() <= 1e-6, "{:?}", m.scallop);
    }
    assert_eq!(m.refined.note, None);
}

#[test]
fn threads_change_no_refined_figure() {
    let all = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let mut both = pool.install(|| [lip(0.02, CELLS), dip(0.0115, CELLS)]);
        let maps = both.each_mut().map(|m| std::mem::take(&mut m.deviation_map));
        (both, maps.map(|map| map.into_iter().map(f32::to_bits).collect::<Vec<_>>()))
    };
    let one = all(1);
    for threads in [2, 3, 8] {
        assert!(all(threads) == one, "{threads} threads");
    }
}
