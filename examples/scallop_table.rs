//! Scallop heights of a ball by calculation: flat, convex and concave sections.
//!
//! `cargo run --release --example scallop_table`

use millstream::scallop::{BallSection, ScallopError};

fn main() -> Result<(), ScallopError> {
    let radius = 3.0;
    let sections =
        [("flat", 0.0), ("convex, radius 20 mm", -1.0 / 20.0), ("concave, radius 20 mm", 1.0 / 20.0)];
    println!("A ball of {radius} mm radius; height of the ridge in µm");
    println!("{:>11}  {}", "step in mm", sections.map(|(name, _)| format!("{name:>22}")).join(""));
    for step in [0.1, 0.2, 0.3, 0.5, 0.8, 1.2] {
        let heights = sections.map(|(_, curvature)| {
            let section = BallSection::new(radius, curvature)?;
            Ok::<_, ScallopError>(format!("{:>22.3}", 1000.0 * section.height(step)?))
        });
        let heights = heights.into_iter().collect::<Result<Vec<_>, _>>()?;
        println!("{step:>11.1}  {}", heights.join(""));
    }
    Ok(())
}
