//! Any bytes as an OBJ file: a message or a mesh that can be searched, never a panic.

#![no_main]

mod mesh;

use libfuzzer_sys::fuzz_target;
use millstream::io::obj;

fuzz_target!(|bytes: &[u8]| {
    if let Ok((found, _)) = obj::parse(bytes) {
        mesh::holds(found);
    }
});
