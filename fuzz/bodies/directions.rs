//! Any bytes as a table of directions: a message, or a field that has a finite direction wherever it is
//! asked.

use millstream::io::direction_table::parse;

pub fn check(bytes: &[u8]) {
    let Ok(field) = parse(bytes) else { return };
    let [[x0, x1], [y0, y1]] = field.bounds();
    assert!([x0, x1, y0, y1].iter().all(|x| x.is_finite()), "{:?}", field.bounds());
    for t in [-1.0, 0.0, 0.4, 1.0, 3.0] {
        if let Some((direction, confidence)) = field.at([x0 + t * (x1 - x0), y0 + t * t * (y1 - y0)]) {
            assert!(direction.iter().all(|x| x.is_finite()), "{direction:?}");
            assert!(confidence.is_finite() && confidence >= 0.0, "{confidence}");
        }
    }
}
