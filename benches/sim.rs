//! What cutting costs: the reference engine on a wave of 100 x 100 mm with a ball of radius 3 mm,
//! and single evaluations of a swept move for each cutter. `DIVAN_…` and `RAYON_NUM_THREADS` apply;
//! divan prints the rates (items are cells, or evaluations).

use divan::Bencher;
use divan::counter::ItemsCount;
use millstream::cutter::Cutter;
use millstream::geometry::{Point2, Point3};
use millstream::monitor::Silent;
use millstream::sim::{Grid, MoveBins, SweptMove, ZMap, cut_in_order, cut_in_order_plain, cut_reference};
use millstream::toolpath::{ClPoint, Move, MoveKind, Toolpath};

const SIZE: f64 = 100.0;
const RADIUS: f64 = 3.0;

fn main() {
    divan::main();
}

/// Passes along x of a ball that touches z = 2 sin(x/8) cos(y/10).
fn wave(stepover: f64, chord: f64) -> Toolpath {
    let (rows, steps) = ((SIZE / stepover) as usize + 1, (SIZE / chord) as usize);
    let tip = |i: usize, j: usize| {
        let (x, y) = (i as f64 * chord, j as f64 * stepover);
        let slope_x = 0.25 * (x / 8.0).cos() * (y / 10.0).cos();
        let slope_y = -0.2 * (x / 8.0).sin() * (y / 10.0).sin();
        let shift = RADIUS / (1.0 + slope_x * slope_x + slope_y * slope_y).sqrt();
        let z = 2.0 * (x / 8.0).sin() * (y / 10.0).cos() + shift - RADIUS;
        ClPoint { tip: Point3::new(x - shift * slope_x, y - shift * slope_y, z) }
    };
    let pass = |j: usize| (0..=steps).map(move |k| tip(if j.is_multiple_of(2) { k } else { steps - k }, j));
    let mut moves =
        (0..rows).flat_map(pass).map(|to| Move { to, kind: MoveKind::Cut, feed_rate: 1000.0, pass: 0 });
    let start = moves.next().expect("a pass has places").to;
    Toolpath { start, moves: moves.collect() }
}

fn block(cell: f64) -> ZMap {
    let n = (SIZE / cell).round() as usize;
    let grid = Grid { origin: Point2::new(0.5 * cell, 0.5 * cell), cell, nx: n, ny: n };
    ZMap::block(grid, 5.0)
}

fn cut(bencher: Bencher, cutter: &Cutter, cell: f64, chord: f64) {
    let (path, stock) = (wave(0.5, chord), block(cell));
    bencher
        .counter(ItemsCount::new(stock.grid.len()))
        .bench(|| cut_reference(&stock, cutter, &path, &Silent).expect("never cancelled"));
}

#[divan::bench(sample_count = 3, args = [(0.1, 0.4), (0.1, 1.0), (0.05, 0.4), (0.05, 1.0)])]
fn ball_cell_chord(bencher: Bencher, (cell, chord): (f64, f64)) {
    cut(bencher, &Cutter::ball(2.0 * RADIUS).expect("valid"), cell, chord);
}

#[divan::bench(sample_count = 3, args = [(0.1, 0.4), (0.1, 1.0)])]
fn bull_cell_chord(bencher: Bencher, (cell, chord): (f64, f64)) {
    cut(bencher, &Cutter::bull(2.0 * RADIUS, 1.0).expect("valid"), cell, chord);
}

#[divan::bench(sample_count = 3)]
fn bins(bencher: Bencher) {
    let (path, stock) = (wave(0.5, 0.4), block(0.05));
    bencher.counter(ItemsCount::new(path.len())).bench(|| MoveBins::new(&stock.grid, 64, RADIUS, &path));
}

/// One evaluation each at places all around a move, of a rising move of 0.4 mm.
#[divan::bench(args = ["ball", "flat", "bull", "taper"])]
fn swept_move(bencher: Bencher, name: &str) {
    let cutter = match name {
        "ball" => Cutter::ball(6.0),
        "flat" => Cutter::flat(6.0),
        "bull" => Cutter::bull(6.0, 1.0),
        _ => Cutter::taper(2.0, 1.0, 10f64.to_radians(), 6.0),
    };
    let swept = SweptMove::new(&cutter.expect("valid"), Point3::origin(), Point3::new(0.37, 0.12, 0.15));
    bencher.counter(ItemsCount::new(100usize * 100)).bench(|| {
        let at = |k: usize| -3.0 + 0.0637 * k as f64;
        let heights = (0..100).flat_map(|j| (0..100).map(move |i| (i, j)));
        heights.filter_map(|(i, j)| swept.height(at(i), at(j))).sum::<f64>()
    });
}

/// The engine that keeps the order of the program, with passes 0.3 mm apart (args: cell and chord), and
/// the plain loop that it is measured against.
mod in_order {
    use super::*;

    #[divan::bench(sample_count = 3, args = [(0.05, 0.2), (0.05, 1.0), (0.02, 0.2)])]
    fn ball(bencher: Bencher, (cell, chord): (f64, f64)) {
        cut(bencher, &Cutter::ball(2.0 * RADIUS).expect("valid"), cell, chord);
    }

    #[divan::bench(sample_count = 3, args = [(0.05, 0.2)])]
    fn flat(bencher: Bencher, (cell, chord): (f64, f64)) {
        cut(bencher, &Cutter::flat(2.0 * RADIUS).expect("valid"), cell, chord);
    }

    #[divan::bench(sample_count = 3, args = [(0.05, 0.2)])]
    fn bull(bencher: Bencher, (cell, chord): (f64, f64)) {
        cut(bencher, &Cutter::bull(2.0 * RADIUS, 1.0).expect("valid"), cell, chord);
    }

    fn cut(bencher: Bencher, cutter: &Cutter, cell: f64, chord: f64) {
        let path = wave(0.3, chord);
        bencher
            .with_inputs(|| block(cell))
            .bench_values(|stock| cut_in_order(stock, cutter, &path, &Silent).expect("never cancelled"));
    }

    #[divan::bench(sample_count = 1, args = [(0.05, 0.2), (0.05, 1.0), (0.02, 0.2)])]
    fn plain_ball(bencher: Bencher, (cell, chord): (f64, f64)) {
        plain(bencher, &Cutter::ball(2.0 * RADIUS).expect("valid"), cell, chord);
    }

    #[divan::bench(sample_count = 1, args = [(0.05, 0.2)])]
    fn plain_flat(bencher: Bencher, (cell, chord): (f64, f64)) {
        plain(bencher, &Cutter::flat(2.0 * RADIUS).expect("valid"), cell, chord);
    }

    #[divan::bench(sample_count = 1, args = [(0.05, 0.2)])]
    fn plain_bull(bencher: Bencher, (cell, chord): (f64, f64)) {
        plain(bencher, &Cutter::bull(2.0 * RADIUS, 1.0).expect("valid"), cell, chord);
    }

    fn plain(bencher: Bencher, cutter: &Cutter, cell: f64, chord: f64) {
        let path = wave(0.3, chord);
        bencher.with_inputs(|| block(cell)).bench_values(|stock| {
            cut_in_order_plain(stock, cutter, &path, &Silent).expect("never cancelled")
        });
    }
}
