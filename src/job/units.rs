//! Whether part and cutter can belong together. A file in another unit than the scene says is wrong by a
//! factor of 25 or 1000; every figure of such a run would hold, and mean nothing.

use part::Part;
use scene::{PartSource, Scene};

/// A part below this share of the cutter's diameter is beyond belief. Greater, small pads are doubted;
/// smaller, parts in metres go unnoticed.
const SMALLEST: f64 = 0.25;

/// A part above so many diameters of the cutter is beyond belief. Less, long parts are doubted; more, parts
/// in micrometres go unnoticed.
const LARGEST: f64 = 1e4;

/// What is to be said of sizes beyond belief.
pub(crate) fn doubt(scene: &Scene, part: &Part) -> Option<String> {
    let size = part.bounds().size();
    let (length, diameter) = (size.x.max(size.y).max(size.z), 2.0 * scene.tooling.cutter.radius());
    let guess = match length / diameter {
        share if share < SMALLEST => "metres or inches",
        share if share > LARGEST => "micrometres",
        _ => return None,
    };
    let question = match (&scene.part, scene.part_file()) {
        (PartSource::Mesh(mesh), _) => format!(
            "Is {} in {guess}, and not in {}? The key `unit` of [part] says so.",
            mesh.file.written, mesh.unit
        ),
        (_, Some(file)) => format!("Is {} in {guess}?", file.written),
        (_, None) => "Check both.".to_owned(),
    };
    Some(format!(
        "The longest side of the part is {} mm, the diameter of the cutter {} mm. {question}",
        four_digits(length),
        four_digits(diameter)
    ))
}

/// A length with four significant digits.
fn four_digits(length: f64) -> f64 {
    format!("{length:.3e}").parse().unwrap_or(length)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Session;

    /// The doubt about a plane of this length under a cutter of 6 mm.
    fn doubt_at(length: f64) -> Option<String> {
        let text = format!(
            "[part]\nsurface = \"plane\"\nx = [0, {length}]\ny = [0, {}]\n[cutter]\nshape = \"ball\"\ndiameter = 6\n\
             [[toolpath]]\nstrategy = \"zigzag\"\n",
            0.5 * length
        );
        Session::new(Scene::parse("plate.toml", text).unwrap()).unwrap().doubt
    }

    #[test]
    fn sizes_beyond_belief_are_doubted() {
        assert_eq!(
            doubt_at(0.02).unwrap(),
            "The longest side of the part is 0.02 mm, the diameter of the cutter 6 mm. Check both."
        );
        assert!(doubt_at(1.4).is_some() && doubt_at(1.6).is_none() && doubt_at(600.0).is_none());
    }
}
