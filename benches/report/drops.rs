//! Drops onto a wavy mesh of 100,000 triangles.

use super::mesh::{SIZE, along_passes, cutter, scattered, wavy};
use super::table::{Column, Table};
use super::timing::{fastest, timed};
use super::{Plan, Section};
use millstream::drop_cutter::{DropCutter, PlanGrid};

/// Points along each side of the grid.
const SIDE: usize = 1000;

/// Places that are dropped at one by one.
const PLACES: u64 = 20_000;

/// Grid, scattered and along passes, for each cutter.
pub fn section(plan: &Plan) -> Section {
    let part = wavy();
    let step = SIZE / SIDE as f64;
    let grid = PlanGrid::new([0.5 * step; 2], [step; 2], [SIDE; 2]).expect("a grid");
    let mut table = Table::new(
        "drops",
        "Time of a drop",
        format!(
            "Onto {} triangles over {SIZE} x {SIZE} mm: a grid of {SIDE} x {SIDE} points at once, and \
             {PLACES} places one by one, without order and along passes. The grid keeps the triangle, \
             single drops work out the contact too. One thread; `highest` is the greatest difference of \
             tips between both ways.",
            part.mesh().triangles().len()
        ),
        &[
            Column("prepare", "ms"),
            Column("grid", "ns a drop"),
            Column("scattered", "ns a drop"),
            Column("along passes", "ns a drop"),
            Column("one by one", "scattered/grid"),
            Column("passes", "scattered/along"),
            Column("highest", "nm"),
        ],
    );
    let places = [scattered(PLACES), along_passes(PLACES)];
    for kind in ["ball", "flat", "bull", "taper"] {
        let tool = cutter(kind);
        let drops = DropCutter::new(&part, &tool);
        let all = |places: &[[f64; 2]]| {
            timed(|| places.iter().filter_map(|&[x, y]| drops.at(x, y)).map(|d| d.tip_z).sum::<f64>())
        };
        let [prepare, by_grid, without_order, along] = fastest(
            plan,
            [
                &mut || timed(|| DropCutter::new(&part, &tool)),
                &mut || timed(|| drops.over_grid(&grid)),
                &mut || all(&places[0]),
                &mut || all(&places[1]),
            ],
        );
        let points = drops.over_grid(&grid);
        // Every hundredth or so, on no line of the grid.
        let off = (0..points.len()).step_by(97).map(|k| {
            let [x, y] = grid.point(k % SIDE, k / SIDE);
            drops.at(x, y).map_or(0.0, |d| (d.tip_z - points[k].tip_z).abs())
        });
        let off = off.fold(0.0, f64::max);
        let [by_grid, without_order, along] =
            [by_grid / (SIDE * SIDE) as f64, without_order / PLACES as f64, along / PLACES as f64];
        table.row(
            kind,
            [
                1e3 * prepare,
                1e9 * by_grid,
                1e9 * without_order,
                1e9 * along,
                without_order / by_grid,
                without_order / along,
                1e6 * off,
            ],
        );
    }
    Section { title: "Drops", tables: vec![table], plots: Vec::new() }
}
