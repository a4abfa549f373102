//! Any bytes as an OBJ file: a message or a mesh that can be searched, never a panic.

use super::mesh;
use millstream::io::obj;

pub fn check(bytes: &[u8]) {
    if let Ok((found, _)) = obj::parse(bytes) {
        mesh::holds(found);
    }
}
