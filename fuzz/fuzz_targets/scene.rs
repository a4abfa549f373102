//! Any bytes as a scene: an answer or an error, never a panic. What is accepted must be accepted
//! again when it is written out with its defaults.
#![no_main]

use libfuzzer_sys::fuzz_target;
use millstream::io::scene::{Scene, complete_toml};

fuzz_target!(|bytes: &[u8]| {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    if let Ok(scene) = Scene::parse("scene.toml", text) {
        let complete = complete_toml(&scene);
        let again = Scene::parse("scene.toml", complete.as_str());
        assert!(again.is_ok(), "{complete}");
    }
});
