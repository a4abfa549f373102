//! Any bytes as an STL file: a message or a mesh that can be searched, never a panic.

use super::mesh;
use millstream::io::stl;

pub fn check(bytes: &[u8]) {
    if let Ok((found, _)) = stl::parse(bytes) {
        mesh::holds(found);
    }
}
