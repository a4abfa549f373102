//! What several tests need: a part cut by a strategy and measured.

use millstream::cutter::Cutter;
use millstream::geometry::{AnalyticShape, AnalyticSurface, Point3, TriangleMesh};
use millstream::metrology::{Asked, Limits, Measurement, measure};
use millstream::monitor::Silent;
use millstream::part::{Part, Patch};
use millstream::sim::{Grid, ZMap, cut_reference};
use millstream::toolpath::{Joining, PlanSettings, Step, Strategy, Toolpath, plan};

pub const LIMITS: Limits = Limits { scallop: 0.010, gouge: 0.005, uncut: 0.050, chord: 0.001 };

/// Error bound asked of every figure, mm.
pub const ASKED: f64 = 0.0005;

/// Stock over a part's highest point, mm.
const ALLOWANCE: f64 = 1.0;

pub fn formula(shape: AnalyticShape, x: [f64; 2], y: [f64; 2]) -> Part {
    let surface = AnalyticSurface::new(shape, [x, y]).unwrap();
    Part::from_patches(vec![Patch::Analytic(surface)], 0.002).unwrap()
}

pub fn mesh(vertices: Vec<Point3>, triangles: Vec<[u32; 3]>) -> Part {
    Part::from_mesh(TriangleMesh::new(vertices, triangles).unwrap().0)
}

pub fn settings(part: &Part, step: Step) -> PlanSettings {
    PlanSettings {
        step,
        chord_tolerance: LIMITS.chord,
        clearance: 2.0,
        stock_top: part.bounds().max.z + ALLOWANCE,
        feed_rate: 1000.0,
        plunge_rate: 300.0,
        rapid_rate: 15_000.0,
        joining: Joining::default(),
    }
}

/// Cuts a path out of a block around the part and measures.
pub fn cut_and_measure(
    part: &Part,
    cutter: &Cutter,
    path: &Toolpath,
    cell: f64,
    limits: &Limits,
) -> Measurement {
    let bounds = part.bounds();
    let grid = Grid::covering(&bounds, cell, 64, 1 << 32).unwrap();
    let stock = ZMap::block(grid, bounds.max.z + ALLOWANCE);
    let cut = cut_reference(&stock, cutter, path, &Silent).unwrap();
    let asked = Asked { error_bound: ASKED, stock_top: bounds.max.z + ALLOWANCE, most_cells: 1 << 20 };
    measure(part, cutter, path, &cut, limits, &asked, &Silent).unwrap()
}

pub fn plan_and_measure(
    part: &Part,
    cutter: &Cutter,
    strategy: Strategy,
    step: Step,
    cell: f64,
) -> Measurement {
    let plan = plan(part, cutter, &strategy, &settings(part, step), &Silent).unwrap();
    cut_and_measure(part, cutter, &plan.path, cell, &LIMITS)
}

/// |a / b − 1|.
pub fn off(a: f64, b: f64) -> f64 {
    (a / b - 1.0).abs()
}
