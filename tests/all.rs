//! All integration tests, in one binary: whole flows from a part to figures.

#[path = "all/analytic.rs"]
mod analytic;
#[path = "all/cli.rs"]
mod cli;
#[path = "all/command.rs"]
mod command;
#[path = "all/defects.rs"]
mod defects;
#[path = "all/scenes.rs"]
mod scenes;
#[path = "all/support.rs"]
mod support;
