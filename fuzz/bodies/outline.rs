//! What the bodies for drawings share: outlines that were accepted bound an area, and can be offset.

use millstream::geometry::MAX_COORDINATE;
use millstream::io::outline::{OutlineFormat, OutlineOptions, parse};

/// Coarser than any scene asks for: the number of chords is no concern of the readers.
const CHORD_TOLERANCE: f64 = 0.05;

/// Regions beyond this are not offset, so that the fuzzer spends its time on readers.
const OFFSET_POINTS: usize = 300;

pub fn check(bytes: &[u8], format: OutlineFormat) {
    for scale in [None, Some(25.4)] {
        let options = OutlineOptions { chord_tolerance: CHORD_TOLERANCE, scale, layer: None };
        let Ok(found) = parse(bytes, format, &options) else { continue };
        let region = &found.region;
        let points: Vec<_> = region.curves().flatten().collect();
        assert!(points.iter().all(|p| p.iter().all(|x| x.abs() <= MAX_COORDINATE)));
        assert!(region.area() > 0.0, "{}", region.area());
        if points.len() <= OFFSET_POINTS {
            let offset = 0.01 * region.area().sqrt();
            let inset = region.inset(offset).area();
            assert!(
                inset.is_finite() && inset <= region.area() * (1.0 + 1e-6),
                "{inset} of {}",
                region.area()
            );
        }
    }
}
