//! Any bytes as a DXF drawing: a message, or a region that can be offset.

use super::outline;
use millstream::io::outline::dxf;

pub fn check(bytes: &[u8]) {
    outline::check(bytes, dxf::FORMAT);
}
