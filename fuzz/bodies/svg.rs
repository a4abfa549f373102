//! Any bytes as an SVG drawing: a message, or a region that can be offset.

use super::outline;
use millstream::io::outline::svg;

pub fn check(bytes: &[u8]) {
    outline::check(bytes, svg::FORMAT);
}
