//! All integration tests, in one binary: whole flows from a part to figures.

#[path = "all/analytic.rs"]
mod analytic;
#[path = "all/bad_input.rs"]
mod bad_input;
#[path = "all/blades.rs"]
mod blades;
#[path = "all/classic.rs"]
mod classic;
#[path = "all/cli.rs"]
mod cli;
#[path = "all/command.rs"]
mod command;
#[path = "all/compare.rs"]
mod compare;
#[path = "all/coverage.rs"]
mod coverage;
#[path = "all/cutters.rs"]
mod cutters;
#[path = "all/defects.rs"]
mod defects;
#[path = "all/directions.rs"]
mod directions;
#[path = "all/feed_directions.rs"]
mod feed_directions;
#[path = "all/five_axes.rs"]
mod five_axes;
#[path = "all/fuzz.rs"]
mod fuzz;
#[cfg(target_os = "linux")]
#[path = "all/memory.rs"]
mod memory;
#[path = "all/nightly.rs"]
mod nightly;
#[path = "all/outputs.rs"]
mod outputs;
#[path = "all/pockets.rs"]
mod pockets;
#[path = "all/previous_stock.rs"]
mod previous_stock;
#[path = "all/programs.rs"]
mod programs;
#[path = "all/refined.rs"]
mod refined;
#[path = "all/scallop.rs"]
mod scallop;
#[path = "all/scenes.rs"]
mod scenes;
#[path = "all/soups.rs"]
mod soups;
#[path = "all/streams.rs"]
mod streams;
#[path = "all/support.rs"]
mod support;
