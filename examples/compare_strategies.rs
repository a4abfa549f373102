//! Two strategies on one surface: plan, cut, measure, compare.
//!
//! `cargo run --release --example compare_strategies`

use millstream::monitor::Silent;
use millstream::{JobError, Scene, Session};

const SCENE: &str = r#"
title = "Saddle, zigzag against iso-scallop"
[part]
surface = "saddle"
radius_concave = 40
radius_convex = 40
x = [-10, 10]
y = [-10, 10]
[cutter]
shape = "ball"
diameter = 6
[[toolpath]]
strategy = "zigzag"
[[toolpath]]
strategy = "iso-scallop"
"#;

fn main() -> Result<(), JobError> {
    let session = Session::new(Scene::parse("saddle.toml", SCENE)?)?;
    let report = session.run(&Silent)?;
    for toolpath in report.measured() {
        println!(
            "{:12} {:7.1} mm in {:5.1} s, highest scallop {:.4} mm: {}",
            toolpath.name,
            toolpath.path.cutting_length_mm,
            toolpath.path.machining_time_s,
            toolpath.scallop.max_mm.unwrap_or(f64::NAN),
            toolpath.verdict.word(),
        );
    }
    Ok(())
}
