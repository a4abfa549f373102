//! The bench report: ratios of the engines in one run, as tables on standard output, a page and JSON.
//!
//! `cargo bench --bench report` takes about five minutes, `-- --quick` one, on a smaller part. Leaves
//! `report.html` and `report.json` in `target/bench-report/`. Everything runs on one thread unless a
//! table says otherwise. What is compared runs in turns, and the least time of all rounds counts: a
//! machine that others use slows all of them alike, and only ever adds time. Nothing is asserted.

mod drops;
mod engines;
mod growth;
#[path = "../common/mesh.rs"]
mod mesh;
mod page;
mod peak;
mod plot;
mod table;
mod timing;
#[path = "../common/wave.rs"]
mod wave;

use std::error::Error;
use std::path::Path;
use table::Table;

/// How much is measured.
#[derive(Debug, Clone, Copy)]
pub struct Plan {
    /// For people with little time.
    quick: bool,
    /// Both sides of the part, mm.
    part: [f64; 2],
    /// What is compared is repeated for so long, s.
    budget: f64,
    /// But so many times at least.
    rounds: usize,
}

/// Tables that belong together, and their plots as SVG.
pub struct Section {
    title: &'static str,
    tables: Vec<Table>,
    plots: Vec<String>,
}

const FULL: Plan = Plan { quick: false, part: [0.0, 100.0], budget: 4.0, rounds: 2 };
const QUICK: Plan = Plan { quick: true, part: [0.0, 30.0], budget: 0.3, rounds: 1 };

/// Goes from thread to thread.
type AnyError = Box<dyn Error + Send + Sync>;

fn main() -> Result<(), AnyError> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    match arguments[..] {
        // `cargo bench` says so; `cargo test --benches` says nothing, and wants to know only that it runs.
        ["--bench"] => one_thread.install(|| measure(FULL)),
        [] | ["--quick"] | ["--quick", "--bench"] | ["--bench", "--quick"] => {
            one_thread.install(|| measure(QUICK))
        }
        [peak::ARGUMENT, side] => {
            let side = side.parse()?;
            one_thread.install(|| peak::cut_only(side));
            Ok(())
        }
        _ => Err("usage: cargo bench --bench report [-- --quick]".into()),
    }
}

fn measure(plan: Plan) -> Result<(), AnyError> {
    let began = std::time::Instant::now();
    let mut sections = Vec::new();
    let stages: [fn(&Plan) -> Section; 6] = [
        timing::calibration,
        engines::wave_part,
        engines::in_order,
        growth::section,
        drops::section,
        peak::section,
    ];
    for stage in stages {
        let section = stage(&plan);
        println!("\n== {} ==", section.title);
        section.tables.iter().for_each(|table| println!("\n{}", table.text()));
        sections.push(section);
    }
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/bench-report");
    std::fs::create_dir_all(&folder)?;
    let minutes = began.elapsed().as_secs_f64() / 60.0;
    let (html, json) = (folder.join("report.html"), folder.join("report.json"));
    std::fs::write(&html, page::html(&sections, plan.quick, minutes))?;
    std::fs::write(&json, serde_json::to_string_pretty(&page::json(&sections, plan.quick))?)?;
    println!("\n{minutes:.1} min; written: {} and {}", html.display(), json.display());
    Ok(())
}
