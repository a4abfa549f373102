//! A path of one's own, cut, measured and judged without a scene and without a planner.
//!
//! Two straight passes of a ball, 1 mm apart, on a level plate: the ridge between them is `r - √(r² - s²/4)`
//! high.
//!
//! `cargo run --release --example measure_own_path`

use std::error::Error;

use millstream::cutter::Cutter;
use millstream::geometry::{AnalyticShape, AnalyticSurface, Point3};
use millstream::metrology::{Asked, Limits, ScallopRule, measure};
use millstream::monitor::Silent;
use millstream::motion::{ClPoint, Move, MoveKind, Toolpath};
use millstream::part::{Part, Patch};
use millstream::sim::{Grid, ZMap, cut};
use millstream::{Verdict, judge_surface};

fn main() -> Result<(), Box<dyn Error>> {
    let plane = AnalyticSurface::new(AnalyticShape::Plane { height: 0.0 }, [[0.0, 20.0], [0.0, 1.0]])?;
    let part = Part::from_patches(vec![Patch::Analytic(plane)], 0.01)?;
    let cutter = Cutter::ball(6.0)?;

    let tip = |x: f64, y: f64, z: f64| ClPoint::upright(Point3::new(x, y, z));
    let to = |x, y, z, kind, pass| Move { to: tip(x, y, z), kind, feed_rate: 1000.0, pass };
    let path = Toolpath::new(
        tip(-4.0, 0.0, 5.0),
        vec![
            to(-4.0, 0.0, 0.0, MoveKind::Plunge, 0),
            to(24.0, 0.0, 0.0, MoveKind::Cut, 0),
            to(24.0, 1.0, 0.0, MoveKind::Link, 1),
            to(-4.0, 1.0, 0.0, MoveKind::Cut, 1),
        ],
    );

    let (cell, memory) = (0.05, 64 << 20);
    let grid = Grid::covering(&part.bounds(), cell, 80, memory)?;
    let stock = cut(ZMap::block(grid, 1.0), &cutter, &path, &Silent)?;
    let limits = Limits { scallop: 0.05, gouge: 0.005, uncut: 0.1, chord: 0.001 };
    let asked = Asked {
        allowed_depth: 0.0,
        error_bound: 1e-5,
        most_cells: 1_000_000,
        most_squares: 1_000_000,
        is_first_look: false,
        border_cuts: true,
        steep_elsewhere: false,
    };
    let found = measure(&part, &cutter, &path, &stock, &limits, &asked, &Silent)?;

    let exact = 3.0 - (9.0f64 - 0.25).sqrt();
    println!("measured {:.6} mm", found.scallop.max_mm.ok_or("no ridge was found")?);
    println!("exact    {exact:.6} mm");

    let claims = judge_surface(&found, &limits, &ScallopRule::default());
    for claim in &claims {
        println!("{}: {}", claim.verdict().word(), claim.sentence());
    }
    println!("verdict  {}", Verdict::by(&claims).word());
    Ok(())
}
