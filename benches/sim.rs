//! What cutting costs: the reference engine on a wave of 100 x 100 mm with a ball of radius 3 mm,
//! and single evaluations of a swept move for each cutter. `DIVAN_…` and `RAYON_NUM_THREADS` apply;
//! divan prints the rates (items are cells, or evaluations).

use divan::Bencher;
use divan::counter::ItemsCount;
use millstream::cutter::Cutter;
use millstream::geometry::Point3;
use millstream::monitor::Silent;
use millstream::motion::{ClPoint, Move, MoveKind, Toolpath};
use millstream::sim::{Envelope, MoveBins, cut_in_order, cut_in_order_plain, cut_reference};

#[path = "common/wave.rs"]
mod wave;
use wave::{RADIUS, block, cutter, wave};

/// Both sides of the part.
const PART: [f64; 2] = [0.0, 100.0];

fn main() {
    divan::main();
}

fn cut(bencher: Bencher, cutter: &Cutter, cell: f64, chord: f64) {
    let (path, stock) = (wave(PART, 0.5, chord), block(PART, cell));
    bencher
        .counter(ItemsCount::new(stock.grid.len()))
        .bench(|| cut_reference(&stock, cutter, &path, &Silent).expect("never cancelled"));
}

#[divan::bench(sample_count = 3, args = [(0.1, 0.4), (0.1, 1.0), (0.05, 0.4), (0.05, 1.0)])]
fn ball_cell_chord(bencher: Bencher, (cell, chord): (f64, f64)) {
    cut(bencher, &cutter("ball"), cell, chord);
}

#[divan::bench(sample_count = 3, args = [(0.1, 0.4), (0.1, 1.0)])]
fn bull_cell_chord(bencher: Bencher, (cell, chord): (f64, f64)) {
    cut(bencher, &cutter("bull"), cell, chord);
}

#[divan::bench(sample_count = 3)]
fn bins(bencher: Bencher) {
    let (path, stock) = (wave(PART, 0.5, 0.4), block(PART, 0.05));
    bencher.counter(ItemsCount::new(path.len())).bench(|| MoveBins::new(&stock.grid, 64, RADIUS, &path));
}

/// One evaluation each at places all around a move, of a rising move of 0.4 mm.
#[divan::bench(args = ["ball", "flat", "bull", "taper"])]
fn swept_move(bencher: Bencher, name: &str) {
    let to = ClPoint::upright(Point3::new(0.37, 0.12, 0.15));
    let only = Move { to, kind: MoveKind::Cut, feed_rate: 1000.0, pass: 0 };
    let path = Toolpath::new(ClPoint::upright(Point3::origin()), vec![only]);
    let swept = Envelope::new(cutter(name), &path);
    bencher.counter(ItemsCount::new(100usize * 100)).bench(|| {
        let at = |k: usize| -3.0 + 0.0637 * k as f64;
        let heights = (0..100).flat_map(|j| (0..100).map(move |i| (i, j)));
        heights.filter_map(|(i, j)| swept.height(0, at(i), at(j))).sum::<f64>()
    });
}

/// The engine that keeps the order of the program, with passes 0.3 mm apart (args: cell and chord), and
/// the plain loop that it is measured against.
mod in_order {
    use super::*;

    #[divan::bench(sample_count = 3, args = [(0.05, 0.2), (0.05, 1.0), (0.02, 0.2)])]
    fn ball(bencher: Bencher, (cell, chord): (f64, f64)) {
        cut(bencher, &cutter("ball"), cell, chord);
    }

    #[divan::bench(sample_count = 3, args = [(0.05, 0.2)])]
    fn flat(bencher: Bencher, (cell, chord): (f64, f64)) {
        cut(bencher, &cutter("flat"), cell, chord);
    }

    #[divan::bench(sample_count = 3, args = [(0.05, 0.2)])]
    fn bull(bencher: Bencher, (cell, chord): (f64, f64)) {
        cut(bencher, &cutter("bull"), cell, chord);
    }

    #[divan::bench(sample_count = 3, args = [(0.05, 0.2)])]
    fn taper(bencher: Bencher, (cell, chord): (f64, f64)) {
        cut(bencher, &cutter("taper"), cell, chord);
    }

    fn cut(bencher: Bencher, cutter: &Cutter, cell: f64, chord: f64) {
        let path = wave(PART, 0.3, chord);
        bencher
            .with_inputs(|| block(PART, cell))
            .bench_values(|stock| cut_in_order(stock, cutter, &path, &Silent).expect("never cancelled"));
    }

    #[divan::bench(sample_count = 1, args = [(0.05, 0.2), (0.05, 1.0), (0.02, 0.2)])]
    fn plain_ball(bencher: Bencher, (cell, chord): (f64, f64)) {
        plain(bencher, &cutter("ball"), cell, chord);
    }

    #[divan::bench(sample_count = 1, args = [(0.05, 0.2)])]
    fn plain_flat(bencher: Bencher, (cell, chord): (f64, f64)) {
        plain(bencher, &cutter("flat"), cell, chord);
    }

    #[divan::bench(sample_count = 1, args = [(0.05, 0.2)])]
    fn plain_bull(bencher: Bencher, (cell, chord): (f64, f64)) {
        plain(bencher, &cutter("bull"), cell, chord);
    }

    #[divan::bench(sample_count = 1, args = [(0.05, 0.2)])]
    fn plain_taper(bencher: Bencher, (cell, chord): (f64, f64)) {
        plain(bencher, &cutter("taper"), cell, chord);
    }

    fn plain(bencher: Bencher, cutter: &Cutter, cell: f64, chord: f64) {
        let path = wave(PART, 0.3, chord);
        bencher.with_inputs(|| block(PART, cell)).bench_values(|stock| {
            cut_in_order_plain(stock, cutter, &path, &Silent).expect("never cancelled")
        });
    }
}
