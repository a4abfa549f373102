//! A cutter dropped on a mesh: where its tip comes to rest, and where it touches.
//!
//! `cargo run --release --example drop_cutter -- scenes/relief.stl`

use std::error::Error;
use std::path::PathBuf;

use millstream::cutter::Cutter;
use millstream::drop_cutter::DropCutter;
use millstream::io::stl;
use millstream::part::Part;

fn main() -> Result<(), Box<dyn Error>> {
    let file = std::env::args().nth(1).map_or_else(|| PathBuf::from("scenes/relief.stl"), PathBuf::from);
    let (mesh, _) = stl::read(&file)?;
    let part = Part::from_mesh(mesh);
    let ball = Cutter::ball(6.0)?;
    let drop = DropCutter::new(&part, &ball);
    let (low, size) = (part.bounds().min, part.bounds().size());
    for k in 0..=10 {
        let share = f64::from(k) / 10.0;
        let (x, y) = (low.x + share * size.x, low.y + share * size.y);
        match drop.at(x, y) {
            Some(rest) => {
                println!("x {x:7.3} y {y:7.3}: tip at z {:.4}, contact {}", rest.tip_z, rest.contact.point)
            }
            None => println!("x {x:7.3} y {y:7.3}: the cutter misses the part"),
        }
    }
    Ok(())
}
