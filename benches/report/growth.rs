//! How the time of a cut grows over four decades of cells and four of moves.

use super::plot::{Curve, log_log};
use super::table::{Column, Table};
use super::timing::{fastest, timed};
use super::wave::{block, cutter, wave};
use super::{Plan, Section};
use millstream::monitor::Silent;
use millstream::sim::cut;
use nalgebra::{DMatrix, DVector};

/// Both sides of the part, mm, whatever the plan: cells and moves alone change.
const PART: [f64; 2] = [0.0, 100.0];
/// Distance between passes, mm.
const STEPOVER: f64 = 0.3;
/// The chord while the cells change, mm.
const CHORD: f64 = 1.0;
/// Cells a side while the moves change.
const SIDE: usize = 1000;

/// One measured cut.
#[derive(Debug, Clone, Copy)]
struct Point {
    cells: f64,
    moves: f64,
    seconds: f64,
}

/// A law `seconds = Σ coefficient · term`, and how far it is off.
struct Fit {
    coefficients: Vec<f64>,
    /// Root of the mean square of the relative residuals.
    residual: f64,
}

/// The terms of a law at given cells and moves.
type Law = fn(f64, f64) -> Vec<f64>;

/// What the engine should follow.
fn sum(cells: f64, moves: f64) -> Vec<f64> {
    vec![1.0, cells, moves]
}

/// What engines without bounds follow.
fn product(cells: f64, moves: f64) -> Vec<f64> {
    vec![1.0, cells * moves]
}

/// Least squares of relative residuals, so that each decade counts alike, with no coefficient below 0:
/// of all choices of terms the best one that has none.
fn fit(points: &[Point], law: Law) -> Fit {
    let rows: Vec<Vec<f64>> =
        points.iter().map(|p| law(p.cells, p.moves).iter().map(|term| term / p.seconds).collect()).collect();
    let terms = rows[0].len();
    let mut best = Fit { coefficients: vec![0.0; terms], residual: 1.0 };
    for chosen in 1..1usize << terms {
        let columns: Vec<usize> = (0..terms).filter(|k| chosen >> k & 1 == 1).collect();
        let greatest: Vec<f64> =
            columns.iter().map(|&k| rows.iter().map(|row| row[k]).fold(0.0, f64::max)).collect();
        // Terms differ by many decades: each is taken in parts of its greatest value.
        let matrix = DMatrix::from_fn(rows.len(), columns.len(), |i, j| rows[i][columns[j]] / greatest[j]);
        let ones = DVector::from_element(rows.len(), 1.0);
        let Ok(solution) = matrix.clone().svd(true, true).solve(&ones, 1e-14) else { continue };
        let residual = ((&matrix * &solution - ones).norm_squared() / rows.len() as f64).sqrt();
        if residual < best.residual && solution.iter().all(|c| *c >= 0.0) {
            let mut coefficients = vec![0.0; terms];
            columns.iter().enumerate().for_each(|(j, &k)| coefficients[k] = solution[j] / greatest[j]);
            best = Fit { coefficients, residual };
        }
    }
    best
}

impl Fit {
    fn seconds(&self, law: Law, cells: f64, moves: f64) -> f64 {
        law(cells, moves).iter().zip(&self.coefficients).map(|(term, c)| term * c).sum()
    }
}

fn measured(plan: &Plan, side: usize, chord: f64) -> Point {
    let (tool, path) = (cutter("ball"), wave(PART, STEPOVER, chord));
    let stock = block(PART, (PART[1] - PART[0]) / side as f64);
    let cells = stock.grid.len() as f64;
    // One map, cut again and again, would hold no stock the second time: each round has a fresh one.
    drop(stock);
    let [seconds] = fastest(
        plan,
        [&mut || {
            let stock = block(PART, (PART[1] - PART[0]) / side as f64);
            timed(|| cut(stock, &tool, &path, &Silent).expect("never cancelled"))
        }],
    );
    Point { cells, moves: path.len() as f64, seconds }
}

/// Both series, the law fitted to all of their points, and plots of both.
pub fn section(plan: &Plan) -> Section {
    let plan = &Plan { budget: 0.5 * plan.budget, ..*plan };
    let sides: &[usize] = if plan.quick { &[100, 316, 1000, 3162] } else { &[100, 316, 1000, 3162, 10_000] };
    let chords: &[f64] = if plan.quick { &[50.0, 4.0, 0.4, 0.04] } else { &[50.0, 4.0, 0.4, 0.04, 0.003] };
    let by_cells: Vec<Point> = sides.iter().map(|&side| measured(plan, side, CHORD)).collect();
    let by_moves: Vec<Point> = chords.iter().map(|&chord| measured(plan, SIDE, chord)).collect();
    let all: Vec<Point> = by_cells.iter().chain(&by_moves).copied().collect();
    let (as_sum, as_product) = (fit(&all, sum), fit(&all, product));

    let mut points = Table::new(
        "growth",
        "Time of cut",
        format!(
            "A ball on the wave of 100 x 100 mm, passes {STEPOVER} mm apart; one thread. First the cells change at \
             chords of {CHORD} mm, then the chords at {SIDE} x {SIDE} cells. `fitted` is the law below."
        ),
        &[
            Column("cells", "million"),
            Column("moves", "thousand"),
            Column("time", "s"),
            Column("fitted", "s"),
            Column("off", "%"),
            Column("by product", "s"),
        ],
    );
    let series = [("cells", &by_cells), ("moves", &by_moves)];
    for (name, p) in series.iter().flat_map(|(name, points)| points.iter().map(move |p| (name, p))) {
        let [fitted, by_product] =
            [(&as_sum, sum as Law), (&as_product, product)].map(|(f, law)| f.seconds(law, p.cells, p.moves));
        points.row(
            format!("growing {name}"),
            [
                1e-6 * p.cells,
                1e-3 * p.moves,
                p.seconds,
                fitted,
                100.0 * (fitted / p.seconds - 1.0),
                by_product,
            ],
        );
    }
    let mut laws = Table::new(
        "laws",
        "Laws fitted to these times",
        "Least squares of relative residuals, no coefficient below zero. The residual is the root of their mean \
         square; a law that tells nothing has 100 %.",
        &[
            Column("fixed", "ms"),
            Column("cell", "ns"),
            Column("move", "ns"),
            Column("cell x move", "ns"),
            Column("residual", "%"),
        ],
    );
    let [fixed, cell, each_move] = [0, 1, 2].map(|k| as_sum.coefficients[k]);
    laws.row(
        "a + b cells + c moves",
        [1e3 * fixed, 1e9 * cell, 1e9 * each_move, f64::NAN, 100.0 * as_sum.residual],
    );
    let [fixed, both] = [0, 1].map(|k| as_product.coefficients[k]);
    laws.row(
        "a + b cells x moves",
        [1e3 * fixed, f64::NAN, f64::NAN, 1e9 * both, 100.0 * as_product.residual],
    );

    let plot = |title: &str, x_name: &str, points: &[Point], x: fn(&Point) -> f64| {
        // Between the points the law is drawn too: it bends.
        let between = |k: usize| {
            let t = k as f64 / 60.0 * (points.len() - 1) as f64;
            let (i, share) =
                ((t as usize).min(points.len() - 2), t - (t as usize).min(points.len() - 2) as f64);
            let mean = |f: fn(&Point) -> f64| f(&points[i]).powf(1.0 - share) * f(&points[i + 1]).powf(share);
            Point { cells: mean(|p| p.cells), moves: mean(|p| p.moves), seconds: 0.0 }
        };
        let law = |seconds: &dyn Fn(&Point) -> f64| {
            (0..=60).map(between).map(|p| (x(&p), seconds(&p))).collect::<Vec<_>>()
        };
        // Through the first point, as if each cell saw each move.
        let first = points[0];
        let curves = [
            Curve {
                name: "measured",
                points: points.iter().map(|p| (x(p), p.seconds)).collect(),
                line: false,
            },
            Curve {
                name: "a + b cells + c moves",
                points: law(&|p| as_sum.seconds(sum, p.cells, p.moves)),
                line: true,
            },
            Curve {
                name: "proportional",
                points: law(&|p| first.seconds * (p.cells * p.moves) / (first.cells * first.moves)),
                line: true,
            },
        ];
        log_log(title, x_name, "s", &curves)
    };
    let plots = vec![
        plot("Cells grow, moves stay", "cells", &by_cells, |p| p.cells),
        plot("Moves grow, cells stay", "moves", &by_moves, |p| p.moves),
    ];
    Section { title: "Growth with cells and moves", tables: vec![points, laws], plots }
}
