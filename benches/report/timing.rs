//! Seconds, by repetition, and what the machine itself takes for simple things.

use super::table::{Column, Table};
use super::wave::block;
use super::{Plan, Section};
use millstream::sim::{NOT_CUT, ZMap};
use std::hint::black_box;
use std::time::Instant;

/// No more rounds than this, however short each is.
const MOST_ROUNDS: usize = 50;

/// Seconds that a piece of work takes. What it gives is dropped outside of them.
pub fn timed<T>(work: impl FnOnce() -> T) -> f64 {
    timed_with(work).0
}

/// Seconds, and what the work gives.
pub fn timed_with<T>(work: impl FnOnce() -> T) -> (f64, T) {
    let began = Instant::now();
    let result = black_box(work());
    (began.elapsed().as_secs_f64(), result)
}

/// The least seconds of several pieces of work, each of which tells its own. They take turns.
pub fn fastest<const N: usize>(plan: &Plan, mut works: [&mut dyn FnMut() -> f64; N]) -> [f64; N] {
    let began = Instant::now();
    let mut least = [f64::INFINITY; N];
    for round in 0..MOST_ROUNDS {
        if round >= plan.rounds && began.elapsed().as_secs_f64() > plan.budget {
            break;
        }
        for (least, work) in least.iter_mut().zip(&mut works) {
            *least = least.min(work());
        }
    }
    least
}

/// A map as it is before a cut, allocated and written.
pub fn write_fresh(part: [f64; 2], cell: f64) -> f64 {
    timed(|| block(part, cell))
}

/// Every height and every name of a map, written over.
pub fn write_in_place(map: &mut ZMap) -> f64 {
    timed(|| {
        map.height.fill(black_box(5.0));
        map.cut_by.fill(black_box(NOT_CUT));
        black_box(&mut *map);
    })
}

/// How many square roots are taken in a row.
const ROOTS: usize = 1 << 24;

/// Square roots in a loop that the compiler makes vectors of, on all threads of the pool.
pub fn square_roots() -> f64 {
    /// Numbers that stay in the nearest cache.
    const NUMBERS: usize = 1024;
    /// Pieces that threads share among each other.
    const PIECES: usize = 64;
    timed(|| {
        millstream::parallel::map(PIECES, |_| {
            let mut numbers: Vec<f64> = (0..NUMBERS).map(|k| 1.0 + k as f64).collect();
            for _ in 0..ROOTS / NUMBERS / PIECES {
                black_box(&mut numbers).iter_mut().for_each(|x| *x = (*x + 1.0).sqrt());
            }
        })
    })
}

/// What memory and square roots cost here, to compare machines by.
pub fn calibration(plan: &Plan) -> Section {
    let cell = if plan.quick { 0.02 } else { 0.04 };
    let mut map = block(plan.part, cell);
    let cells = map.grid.len() as f64;
    let [fresh, in_place, roots] = fastest(
        plan,
        [&mut || write_fresh(plan.part, cell), &mut || write_in_place(&mut map), &mut || square_roots()],
    );
    let mut table = Table::new(
        "calibration",
        "The machine",
        "One thread. A cell of a map is 8 bytes: its height and the move that cut it.",
        &[Column("time", "ns")],
    );
    table.row(format!("write a cell of a fresh map of {:.1} million", 1e-6 * cells), [1e9 * fresh / cells]);
    table.row("write a cell in place", [1e9 * in_place / cells]);
    table.row("a square root of f64, in a loop over vectors", [1e9 * roots / ROOTS as f64]);
    Section { title: "Calibration", tables: vec![table], plots: Vec::new() }
}
