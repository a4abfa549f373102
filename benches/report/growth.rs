//! How the time of a cut grows over four decades of cells, of moves, and of both at once. The third tells
//! a law of sums from one of products: there the one grows by four decades and the other by eight.

use super::plot::{Curve, log_log};
use super::table::{Column, Table};
use super::timing::{fastest, timed_with};
use super::wave::{block, cutter, wave};
use super::{Plan, Section};
use millstream::monitor::Silent;
use millstream::sim::{Work, cut_counted};
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
    work: Work,
}

/// A law `seconds = Σ coefficient · term`, and how far it is off.
struct Fit {
    law: Law,
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

/// As [`sum`], and with the borders between moves: what lies along them is divided further, down to the
/// leaves. Twice as many cells and moves still take twice as long.
fn sum_and_borders(cells: f64, moves: f64) -> Vec<f64> {
    vec![1.0, cells, moves, (cells * moves).sqrt()]
}

/// What engines without bounds follow.
fn product(cells: f64, moves: f64) -> Vec<f64> {
    vec![1.0, cells * moves]
}

impl Fit {
    /// Least squares of relative residuals, so that each decade counts alike, with no coefficient below 0:
    /// of all choices of terms the best one that has none.
    fn to(points: &[Point], law: Law) -> Self {
        let relative = |p: &Point| law(p.cells, p.moves).iter().map(|term| term / p.seconds).collect();
        let rows: Vec<Vec<f64>> = points.iter().map(relative).collect();
        let terms = rows[0].len();
        let mut best = Self { law, coefficients: vec![0.0; terms], residual: 1.0 };
        for chosen in 1..1usize << terms {
            let columns: Vec<usize> = (0..terms).filter(|k| chosen & (1 << k) != 0).collect();
            // Terms differ by many decades: each is taken in parts of its greatest value.
            let greatest: Vec<f64> =
                columns.iter().map(|&k| rows.iter().map(|row| row[k]).fold(0.0, f64::max)).collect();
            let matrix =
                DMatrix::from_fn(rows.len(), columns.len(), |i, j| rows[i][columns[j]] / greatest[j]);
            let ones = DVector::from_element(rows.len(), 1.0);
            let Ok(solution) = matrix.clone().svd(true, true).solve(&ones, 1e-14) else { continue };
            let residual = ((&matrix * &solution - ones).norm_squared() / rows.len() as f64).sqrt();
            if residual < best.residual && solution.iter().all(|c| *c >= 0.0) {
                best.residual = residual;
                best.coefficients.fill(0.0);
                columns
                    .iter()
                    .enumerate()
                    .for_each(|(j, &k)| best.coefficients[k] = solution[j] / greatest[j]);
            }
        }
        best
    }

    fn seconds(&self, p: &Point) -> f64 {
        (self.law)(p.cells, p.moves).iter().zip(&self.coefficients).map(|(term, c)| term * c).sum()
    }
}

fn measured(plan: &Plan, side: usize, chord: f64) -> Point {
    let (tool, path) = (cutter("ball"), wave(PART, STEPOVER, chord));
    let mut work = Work::default();
    let [seconds] = fastest(
        plan,
        [&mut || {
            let stock = block(PART, (PART[1] - PART[0]) / side as f64);
            let (seconds, (_, done)) =
                timed_with(|| cut_counted(stock, &tool, &path, &Silent).expect("never cancelled"));
            work = done;
            seconds
        }],
    );
    Point { cells: (side * side) as f64, moves: path.len() as f64, seconds, work }
}

/// All series, the laws fitted to all of their points, and plots.
pub fn section(plan: &Plan) -> Section {
    let plan = &Plan { budget: 0.5 * plan.budget, ..*plan };
    let decades = if plan.quick { 4 } else { 5 };
    let sides = &[100, 316, 1000, 3162, 10_000][..decades];
    let chords = &[50.0, 4.0, 0.4, 0.04, 0.004][..decades];
    let series = [
        Series {
            name: "cells grow",
            x_name: "cells",
            x: |p| p.cells,
            points: sides.iter().map(|&side| measured(plan, side, CHORD)).collect(),
        },
        Series {
            name: "moves grow",
            x_name: "moves",
            x: |p| p.moves,
            points: chords.iter().map(|&chord| measured(plan, SIDE, chord)).collect(),
        },
        Series {
            name: "both grow",
            x_name: "cells + moves",
            x: |p| p.cells + p.moves,
            points: sides.iter().zip(chords).map(|(&side, &chord)| measured(plan, side, chord)).collect(),
        },
    ];
    let all: Vec<Point> = series.iter().flat_map(|s| &s.points).copied().collect();
    let [as_sum, with_borders, as_product] =
        [sum as Law, sum_and_borders, product].map(|law| Fit::to(&all, law));
    let plots = series.iter().map(|s| s.plot(&as_sum, &with_borders)).collect();
    let tables = vec![
        points_table(&series, &as_sum, &with_borders),
        laws_table([&as_sum, &with_borders, &as_product]),
    ];
    Section { title: "Growth with cells and moves", tables, plots }
}

fn points_table(series: &[Series], as_sum: &Fit, with_borders: &Fit) -> Table {
    let mut table = Table::new(
        "growth",
        "Time of cut",
        format!(
            "A ball on the wave of 100 x 100 mm, passes {STEPOVER} mm apart; one thread. First the cells \
             grow at chords of {CHORD} mm, then the moves (by shorter chords) at {SIDE} x {SIDE} cells, \
             then both. The laws are those below. The exponent is that of a power of what grows: where \
             both grow, a product would have 2, and a sum 1."
        ),
        &[
            Column("cells", "million"),
            Column("moves", "thousand"),
            Column("time", "s"),
            Column("exponent", "to the row above"),
            Column("tests", "a move"),
            Column("evaluations", "a cell"),
            Column("sum", "s"),
            Column("sum off", "%"),
            Column("borders off", "%"),
        ],
    );
    for s in series {
        let mut before: Option<&Point> = None;
        for p in &s.points {
            let off = |fit: &Fit| 100.0 * (fit.seconds(p) / p.seconds - 1.0);
            let exponent =
                before.map_or(f64::NAN, |b| (p.seconds / b.seconds).ln() / ((s.x)(p) / (s.x)(b)).ln());
            let (tests, evaluations) = (p.work.tests as f64 / p.moves, p.work.evaluations as f64 / p.cells);
            let [cells, moves] = [1e-6 * p.cells, 1e-3 * p.moves];
            table.row(
                s.name,
                [
                    cells,
                    moves,
                    p.seconds,
                    exponent,
                    tests,
                    evaluations,
                    as_sum.seconds(p),
                    off(as_sum),
                    off(with_borders),
                ],
            );
            before = Some(p);
        }
    }
    table
}

fn laws_table([as_sum, with_borders, as_product]: [&Fit; 3]) -> Table {
    let mut table = Table::new(
        "laws",
        "Laws fitted to these times",
        "Least squares of relative residuals over all three series, no coefficient below zero. The \
         residual is the root of their mean square; a law that tells nothing has 100 %. Only the last one \
         is a product.",
        &[
            Column("fixed", "ms"),
            Column("cell", "ns"),
            Column("move", "ns"),
            Column("sqrt(cells x moves)", "ns"),
            Column("cell x move", "ns"),
            Column("residual", "%"),
        ],
    );
    let row = |fit: &Fit, coefficients: [f64; 4]| {
        let [cell, each_move, root, both] = coefficients.map(|c| 1e9 * c);
        [1e3 * fit.coefficients[0], cell, each_move, root, both, 100.0 * fit.residual]
    };
    let (c, d, e) = (&as_sum.coefficients, &with_borders.coefficients, &as_product.coefficients);
    let none = f64::NAN;
    table.row("a + b cells + c moves", row(as_sum, [c[1], c[2], none, none]));
    table.row("a + b cells + c moves + d sqrt(cells x moves)", row(with_borders, [d[1], d[2], d[3], none]));
    table.row("a + b cells x moves", row(as_product, [none, none, none, e[1]]));
    table
}

/// Points of which something grows.
struct Series {
    name: &'static str,
    x_name: &'static str,
    x: fn(&Point) -> f64,
    points: Vec<Point>,
}

impl Series {
    fn plot(&self, as_sum: &Fit, with_borders: &Fit) -> String {
        /// Places at which a law is drawn: it bends between the points.
        const PLACES: usize = 60;
        let between = |k: usize| {
            let t = k as f64 / PLACES as f64 * (self.points.len() - 1) as f64;
            let first = (t as usize).min(self.points.len() - 2);
            let (a, b, share) = (&self.points[first], &self.points[first + 1], t - first as f64);
            let mean = |f: fn(&Point) -> f64| f(a).powf(1.0 - share) * f(b).powf(share);
            Point { cells: mean(|p| p.cells), moves: mean(|p| p.moves), ..*a }
        };
        let law = |name, seconds: &dyn Fn(&Point) -> f64| Curve {
            name,
            points: (0..=PLACES).map(between).map(|p| ((self.x)(&p), seconds(&p))).collect(),
            line: true,
        };
        let first = &self.points[0];
        let measured = self.points.iter().map(|p| ((self.x)(p), p.seconds)).collect();
        let curves = [
            Curve { name: "measured", points: measured, line: false },
            law("a + b cells + c moves", &|p| as_sum.seconds(p)),
            law("with the borders", &|p| with_borders.seconds(p)),
            law("as cells x moves", &|p| first.seconds * (p.cells * p.moves) / (first.cells * first.moves)),
        ];
        log_log(self.name, self.x_name, "s", &curves)
    }
}
