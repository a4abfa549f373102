//! The engines against each other and against plain loops, on a wave of 100 × 100 mm.

use super::plot::{Mark, dots};
use super::table::{Column, Table};
use super::timing::{fastest, square_roots, timed, timed_with, write_fresh, write_in_place};
use super::wave::{RADIUS, block, cutter, wave};
use super::{Plan, Section};
use millstream::cutter::Cutter;
use millstream::monitor::Silent;
use millstream::motion::Toolpath;
use millstream::sim::{Envelope, MoveBins, Work, ZMap};
use millstream::sim::{
    cut, cut_all_candidates, cut_counted, cut_in_order, cut_in_order_plain, cut_reference,
};

/// Distance between passes, mm.
const STEPOVER: f64 = 0.3;

/// The plain loops are slow, so they cut a square of this side in the middle of such a part, mm...
const PATCH: [f64; 2] = [40.0, 60.0];
/// ... with all moves that reach it.
const AROUND: [f64; 2] = [PATCH[0] - RADIUS - 1.0, PATCH[1] + RADIUS + 1.0];

/// Cutter, cell and chord, mm.
const SCENES: [(&str, f64, f64); 8] = [
    ("ball", 0.05, 0.2),
    ("ball", 0.05, 1.0),
    ("ball", 0.02, 0.2),
    ("ball", 0.02, 1.0),
    ("flat", 0.05, 0.2),
    ("flat", 0.02, 0.2),
    ("bull", 0.05, 0.2),
    ("taper", 0.05, 0.2),
];

fn name((cutter, cell, chord): (&str, f64, f64)) -> String {
    format!("{cutter}, cell {cell}, chord {chord}")
}

/// Seconds, and the stock that is left.
type Engine = fn(&ZMap, &Cutter, &Toolpath) -> (f64, ZMap);

fn by_cut(stock: &ZMap, cutter: &Cutter, path: &Toolpath) -> (f64, ZMap) {
    let stock = stock.clone();
    timed_with(|| cut(stock, cutter, path, &Silent).expect("never cancelled"))
}

fn by_reference(stock: &ZMap, cutter: &Cutter, path: &Toolpath) -> (f64, ZMap) {
    timed_with(|| cut_reference(stock, cutter, path, &Silent).expect("never cancelled"))
}

fn by_all_candidates(stock: &ZMap, cutter: &Cutter, path: &Toolpath) -> (f64, ZMap) {
    let stock = stock.clone();
    timed_with(|| cut_all_candidates(stock, cutter, path, &Silent).expect("never cancelled").0)
}

/// Farthest difference of heights, mm.
fn farthest(a: &ZMap, b: &ZMap) -> f64 {
    a.height.iter().zip(&b.height).map(|(a, b)| f64::from((a - b).abs())).fold(0.0, f64::max)
}

/// Every move of a tile at every cell of its bounding rectangle, in f64 and without any bound: what a
/// z-map simulator does that only sorts moves into tiles.
fn cut_plainly(mut map: ZMap, cutter: &Cutter, path: &Toolpath) -> ZMap {
    /// Cells along the side of a tile.
    const SIDE: usize = 64;
    let grid = map.grid;
    let (bins, envelope) = (MoveBins::new(&grid, SIDE, RADIUS, path), Envelope::new(cutter, path));
    // Cells of one axis between two places.
    let between = |first: f64, range: std::ops::Range<usize>, a: f64, b: f64| {
        let cell = |x: f64| (x - first) / grid.cell;
        let (low, high) = (cell(a.min(b) - RADIUS).ceil(), cell(a.max(b) + RADIUS).floor() + 1.0);
        range.start.max(low.max(0.0) as usize)..range.end.min(high.max(0.0) as usize)
    };
    for j0 in (0..grid.ny).step_by(SIDE) {
        for i0 in (0..grid.nx).step_by(SIDE) {
            for &index in bins.of_bin(i0 / SIDE, j0 / SIDE) {
                let (from, to) = (path.start_of(index as usize), path.moves[index as usize].to.tip);
                let columns = between(grid.origin.x, i0..(i0 + SIDE).min(grid.nx), from.x, to.x);
                for j in between(grid.origin.y, j0..(j0 + SIDE).min(grid.ny), from.y, to.y) {
                    for i in columns.clone() {
                        let (p, k) = (grid.centre(i, j), grid.index(i, j));
                        let height = envelope.height(index, p.x, p.y).map_or(f32::INFINITY, |h| h as f32);
                        if height < map.height[k] {
                            (map.height[k], map.cut_by[k]) = (height, index);
                        }
                    }
                }
            }
        }
    }
    map
}

/// `cut` against `cut_reference`, memory, plain loops and two threads.
pub fn wave_part(plan: &Plan) -> Section {
    let plain = against_plain(plan);
    let plots = vec![dots("Cost of a cell, one thread", "ns a cell", &plain_marks(&plain))];
    let tables = vec![against_reference(plan), plain, two_threads(plan)];
    Section { title: "Cutting a wave", tables, plots }
}

fn against_reference(plan: &Plan) -> Table {
    let [low, high] = plan.part;
    let mut table = Table::new(
        "wave",
        "cut against cut_reference",
        format!(
            "Wave of {0} x {0} mm, cutters of radius {RADIUS} mm, passes {STEPOVER} mm apart. One thread, \
             least of several rounds in turns. The last columns tell how many times as long a cut takes \
             as writing its map once, fresh and in place; the map that cut works in was written before.",
            high - low
        ),
        &[
            Column("cells", "million"),
            Column("moves", "thousand"),
            Column("cut", "s"),
            Column("reference", "s"),
            Column("ratio", "reference/cut"),
            Column("tests", "a cell"),
            Column("evaluations", "a cell"),
            Column("second looks", "% of cells"),
            Column("farthest", "nm"),
            Column("over fresh", "times"),
            Column("over in place", "times"),
        ],
    );
    for scene @ (kind, cell, chord) in SCENES {
        let (tool, path, stock) = (cutter(kind), wave(plan.part, STEPOVER, chord), block(plan.part, cell));
        let cells = stock.grid.len() as f64;
        let (_, expected) = by_reference(&stock, &tool, &path);
        let (got, work): (ZMap, Work) =
            cut_counted(stock.clone(), &tool, &path, &Silent).expect("never cancelled");
        let off = farthest(&got, &expected);
        drop((got, expected));
        let mut map = stock.clone();
        let [by_cut, by_reference, fresh, in_place] = fastest(
            plan,
            [
                &mut || by_cut(&stock, &tool, &path).0,
                &mut || by_reference(&stock, &tool, &path).0,
                &mut || write_fresh(plan.part, cell),
                &mut || write_in_place(&mut map),
            ],
        );
        table.row(
            name(scene),
            [
                1e-6 * cells,
                1e-3 * path.len() as f64,
                by_cut,
                by_reference,
                by_reference / by_cut,
                work.tests as f64 / cells,
                work.evaluations as f64 / cells,
                100.0 * work.second_looks as f64 / cells,
                1e6 * off,
                by_cut / fresh,
                by_cut / in_place,
            ],
        );
    }
    table
}

fn against_plain(plan: &Plan) -> Table {
    let mut table = Table::new(
        "plain",
        "cut and cut_reference against engines without bounds",
        format!(
            "cut_reference has bounds itself. All candidates: every move of a tile of 64 x 64 cells at each \
             of its cells, by the closed forms in f32 and the vectors of cut. The plain loop: every such move \
             at all cells of its bounding rectangle, in f64. Both are slow: all four cut only {0} x {0} mm in \
             the middle of the wave, with all moves that reach it. On the part of 100 x 100 mm the plain loop \
             would take {1:.0} times as long (last column, not measured). One thread.",
            PATCH[1] - PATCH[0],
            scale()
        ),
        &[
            Column("plain", "ns a cell"),
            Column("all candidates", "ns a cell"),
            Column("reference", "ns a cell"),
            Column("cut", "ns a cell"),
            Column("write fresh", "ns a cell"),
            Column("plain/cut", "times"),
            Column("all candidates/cut", "times"),
            Column("plain/reference", "times"),
            Column("farthest", "nm"),
            Column("plain on the part", "s, scaled"),
        ],
    );
    for scene @ (kind, cell, chord) in SCENES {
        if plan.quick && cell < 0.05 {
            continue;
        }
        let (tool, path, stock) = (cutter(kind), wave(AROUND, STEPOVER, chord), block(PATCH, cell));
        let off = farthest(&by_cut(&stock, &tool, &path).1, &cut_plainly(stock.clone(), &tool, &path));
        let [plain, all_candidates, by_reference, by_cut, fresh] = fastest(
            plan,
            [
                &mut || {
                    let stock = stock.clone();
                    timed(|| cut_plainly(stock, &tool, &path))
                },
                &mut || by_all_candidates(&stock, &tool, &path).0,
                &mut || by_reference(&stock, &tool, &path).0,
                &mut || by_cut(&stock, &tool, &path).0,
                &mut || write_fresh(PATCH, cell),
            ],
        );
        let each = 1e9 / stock.grid.len() as f64;
        table.row(
            name(scene),
            [
                each * plain,
                each * all_candidates,
                each * by_reference,
                each * by_cut,
                each * fresh,
                plain / by_cut,
                all_candidates / by_cut,
                plain / by_reference,
                1e6 * off,
                scale() * plain,
            ],
        );
    }
    table
}

/// Parts of 100 × 100 mm over the patch.
fn scale() -> f64 {
    (100.0 / (PATCH[1] - PATCH[0])).powi(2)
}

/// The first five columns of the table of engines without bounds as dots.
fn plain_marks(table: &Table) -> Vec<(String, Vec<Mark>)> {
    let marks = |row: &[f64]| table.columns.iter().zip(row).take(5).map(|(c, v)| Mark(c.0, *v)).collect();
    table.rows.iter().map(|(name, row)| (name.clone(), marks(row))).collect()
}

fn two_threads(plan: &Plan) -> Table {
    let mut table = Table::new(
        "threads",
        "Two threads against one",
        format!(
            "The same wave with a ball, by the same engines in pools of one and two threads, in turns. {} \
             threads are there at once. Square roots need no memory: no engine can be expected to gain more \
             than they do, on threads that share a core or with others at work.",
            std::thread::available_parallelism().map_or(0, |n| n.get())
        ),
        &[Column("one", "s"), Column("two", "s"), Column("ratio", "one/two")],
    );
    let [one, two] =
        [1, 2].map(|n| rayon::ThreadPoolBuilder::new().num_threads(n).build().expect("few threads"));
    let (tool, path, stock) = (cutter("ball"), wave(plan.part, STEPOVER, 0.2), block(plan.part, 0.05));
    for (name, engine) in [("cut", by_cut as Engine), ("cut_reference", by_reference)] {
        let [alone, together] = fastest(
            plan,
            [&mut || one.install(|| engine(&stock, &tool, &path)).0, &mut || {
                two.install(|| engine(&stock, &tool, &path)).0
            }],
        );
        table.row(name, [alone, together, alone / together]);
    }
    let [alone, together] =
        fastest(plan, [&mut || one.install(square_roots), &mut || two.install(square_roots)]);
    table.row("square roots", [alone, together, alone / together]);
    table
}

/// The engine that keeps the order of the program against its plain loop.
pub fn in_order(plan: &Plan) -> Section {
    let mut table = Table::new(
        "in_order",
        "cut_in_order against cut_in_order_plain",
        format!(
            "{0} x {0} mm in the middle of the wave only, with all moves that reach it: on the whole part \
             the plain loop would take {1:.0} times as long. Passes {STEPOVER} mm apart; one thread.",
            PATCH[1] - PATCH[0],
            scale()
        ),
        &[
            Column("in order", "s"),
            Column("plain", "s"),
            Column("ratio", "plain/in order"),
            Column("cut", "s"),
            Column("price of order", "in order/cut"),
            Column("farthest", "nm"),
        ],
    );
    let scenes = [("ball", 0.05, 0.2), ("ball", 0.05, 1.0), ("flat", 0.05, 0.2), ("bull", 0.05, 0.2)];
    for scene @ (kind, cell, chord) in scenes {
        let (tool, path, stock) = (cutter(kind), wave(AROUND, STEPOVER, chord), block(PATCH, cell));
        let fast = || {
            let stock = stock.clone();
            timed_with(|| cut_in_order(stock, &tool, &path, &Silent).expect("never cancelled"))
        };
        let plain = || {
            let stock = stock.clone();
            timed_with(|| cut_in_order_plain(stock, &tool, &path, &Silent).expect("never cancelled"))
        };
        let off = farthest(&fast().1.stock, &plain().1.stock);
        let [by_order, plainly, by_cut] =
            fastest(plan, [&mut || fast().0, &mut || plain().0, &mut || by_cut(&stock, &tool, &path).0]);
        table.row(name(scene), [by_order, plainly, plainly / by_order, by_cut, by_order / by_cut, 1e6 * off]);
    }
    Section { title: "Cutting in the order of the program", tables: vec![table], plots: Vec::new() }
}
