//! Any bytes as an OBJ file: a mesh of finite numbers or a message, never a panic.

#![no_main]

use libfuzzer_sys::fuzz_target;
use millstream::io::obj;

fuzz_target!(|bytes: &[u8]| {
    match obj::parse(bytes) {
        Ok((mesh, _)) => {
            assert!(mesh.vertices().iter().all(|p| p.coords.iter().all(|x| x.is_finite())));
            assert!((0..mesh.triangles().len()).all(|t| mesh.normal(t).norm().is_normal()));
        }
        Err(error) => assert!(!error.to_string().is_empty()),
    }
});
