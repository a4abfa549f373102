//! What the fuzz targets do with bytes, each in a module of its own. They are run by libFuzzer
//! (`fuzz_targets/`), and by the ordinary tests (`tests/all/fuzz.rs`) on seeds and on all that once failed.

pub mod apt;
pub mod directions;
pub mod dxf;
pub mod gcode;
mod mesh;
pub mod nurbs;
pub mod obj;
mod outline;
mod program;
pub mod run;
pub mod scene;
pub mod sections;
pub mod stl;
pub mod svg;

/// A target: the name of its folders, and what it does.
pub type Target = (&'static str, fn(&[u8]));

/// All targets.
pub const TARGETS: [Target; 11] = [
    ("apt", apt::check),
    ("directions", directions::check),
    ("dxf", dxf::check),
    ("gcode", gcode::check),
    ("nurbs", nurbs::check),
    ("obj", obj::check),
    ("run", run::check),
    ("scene", scene::check),
    ("sections", sections::check),
    ("stl", stl::check),
    ("svg", svg::check),
];
