//! Any bytes as a scene: an answer or an error, never a panic. What is accepted is accepted again
//! when it is written out with its defaults, and then says the same.

use millstream::scene::{Scene, complete_toml};

pub fn check(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let Ok(scene) = Scene::parse("scene.toml", text) else { return };
    let complete = complete_toml(&scene);
    match Scene::parse("scene.toml", complete.as_str()) {
        Ok(again) => assert_eq!(complete_toml(&again), complete),
        Err(error) => panic!("{error:?}\n{complete}"),
    }
}
