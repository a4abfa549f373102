//! Any bytes as a scene that is run, while that takes little time and memory: a report or a message, never a
//! panic.

use std::time::{Duration, Instant};

use millstream::monitor::Monitor;
use millstream::{Scene, Session};

/// Runs that take longer are cancelled, which they have to answer as well.
const LONGEST: Duration = Duration::from_millis(100);

/// MiB. Estimates refuse what takes more.
const MEMORY: u32 = 16;

struct Until(Instant);

impl Monitor for Until {
    fn cancelled(&self) -> bool {
        Instant::now() > self.0
    }
}

pub fn check(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let Ok(mut scene) = Scene::parse("scene.toml", text) else { return };
    scene.simulation.memory_mib = MEMORY;
    let until = Until(Instant::now() + LONGEST);
    let Ok(session) = Session::load(scene, &until) else { return };
    let Ok(report) = session.run(&until) else { return };
    for toolpath in report.measured() {
        assert!(toolpath.scallop.max_mm.is_none_or(f64::is_finite), "{:?}", toolpath.scallop);
        assert!(toolpath.gouge.max_depth_mm.is_finite(), "{:?}", toolpath.gouge);
    }
}
