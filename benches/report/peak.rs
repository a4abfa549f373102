//! Memory of a cut: the peak of a process of its own that does nothing else, where the system tells it
//! (Linux).

use super::table::{Column, Table};
use super::wave::{block, cutter, wave};
use super::{Plan, Section};
use millstream::monitor::Silent;
use millstream::motion::{Move, Toolpath};
use millstream::sim::cut;
use std::hint::black_box;

/// Makes this program a process that only cuts; a number of cells a side follows.
pub const ARGUMENT: &str = "--cut-only";

/// Both sides of the part, mm.
const PART: [f64; 2] = [0.0, 100.0];

fn path() -> Toolpath {
    wave(PART, 0.3, 0.2)
}

/// Cuts the wave on a grid of `side` × `side` cells with one thread, and prints its peak, KiB.
pub fn cut_only(side: usize) {
    let stock = block(PART, (PART[1] - PART[0]) / side as f64);
    black_box(cut(stock, &cutter("ball"), &path(), &Silent).expect("never cancelled"));
    if let Some(peak) = peak() {
        println!("{peak}");
    }
}

/// Peak resident memory of this process, KiB.
fn peak() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    line.split_whitespace().nth(1)?.parse().ok()
}

/// Peak of a process that cuts so many cells, bytes.
fn peak_of(side: usize) -> Option<f64> {
    let child = std::process::Command::new(std::env::current_exe().ok()?)
        .args([ARGUMENT, &side.to_string()])
        .output()
        .ok()?;
    let kib: u64 = String::from_utf8(child.stdout).ok()?.trim().parse().ok()?;
    Some(1024.0 * kib as f64)
}

/// Bytes a cell, in all and by the cell that is added.
pub fn section(plan: &Plan) -> Section {
    let moves = path().len();
    let mut table = Table::new(
        "memory",
        "Peak memory of cut",
        format!(
            "A process of its own that lays out a block over 100 x 100 mm and cuts it along {moves} moves \
             with one thread, and nothing else. `added` is the difference to the smallest grid: what a \
             further cell takes. The map alone takes 8 bytes a cell, the path {:.1} MiB.",
            (moves * size_of::<Move>()) as f64 / 1048576.0
        ),
        &[
            Column("cells", "million"),
            Column("peak", "MiB"),
            Column("all told", "bytes a cell"),
            Column("added", "bytes a cell"),
        ],
    );
    let sides: &[usize] = if plan.quick { &[100, 1000, 2000] } else { &[100, 1000, 2000, 5000, 10_000] };
    let Some(least) = peak_of(sides[0]) else {
        return Section { title: "Memory", tables: Vec::new(), plots: Vec::new() };
    };
    for &side in sides {
        let (cells, peak) = ((side * side) as f64, peak_of(side).unwrap_or(f64::NAN));
        let beyond = cells - (sides[0] * sides[0]) as f64;
        let added = if beyond > 0.0 { (peak - least) / beyond } else { f64::NAN };
        table.row(format!("{side} x {side}"), [1e-6 * cells, peak / 1048576.0, peak / cells, added]);
    }
    Section { title: "Memory", tables: vec![table], plots: Vec::new() }
}
