//! Millstream plans milling paths as the streamlines of a field, cuts the part in a simulator, measures the
//! cut surface, and says with numbers and error bounds whether the plan is good, before metal is cut.
//!
//! A scene in, a report out:
//!
//! ```
//! use millstream::{Session, monitor::Silent};
//!
//! let report = Session::open("scenes/plate.toml")?.run(&Silent)?;
//! for toolpath in report.measured() {
//!     println!("{}: {} ({:?} mm)", toolpath.name, toolpath.verdict.word(), toolpath.scallop.max_mm);
//! }
//! # assert_eq!(report.verdict, millstream::Verdict::Pass);
//! # Ok::<(), millstream::JobError>(())
//! ```
//!
//! [`Session`] keeps the part; [`Session::toolpath`] leaves path, maps and meshes of one toolpath too. Each
//! stage can be used alone. They are the modules of this crate, each on top of those before it:
//!
//! | stage | from | to |
//! |---|---|---|
//! | [`geometry`], [`offset`], [`blade`] | points, sections, files' contents | curves, surfaces, meshes, their search trees |
//! | [`cutter`], [`motion`], [`part`] | dimensions, places, surfaces | profiles and solids, paths, one view of what is made |
//! | [`field`], [`scallop`] | feed directions, curvature | stream functions and their levels; strips by calculation |
//! | [`toolpath`] | a part, a cutter, a strategy | a path |
//! | [`sim`] | stock, cutter, path | what is left |
//! | [`metrology`] | what is left, the part | figures with bounds |
//! | [`collision`], [`machine`] | tool, path, meshes, axes | clearances, times, joints |
//! | [`program`] | G-code or APT text | motion with lines, tools, feeds; paths |
//! | [`io`], [`scene`], [`job`], [`report`] | files | a report and its pictures |
//!
//! A [`Measurement`](metrology::Measurement) of a path of your own is judged by [`judge_surface`].
//!
//! `examples/` has one program for each of: two strategies compared, a path of your own measured and judged, a
//! cutter dropped on a mesh, a table of scallops.
//!
//! Units: mm, rad in code (degrees in files), mm/min for feed, s for time. Right-handed, z up; the tool axis
//! points from the tip to the holder. Errors are one enum a stage; a violated tolerance is a finding in the
//! report and no error. Long work takes a [`monitor::Monitor`], which hears its progress and may cancel it.
//! Results do not depend on the number of threads.

pub use job::{JobError, Outcome, Session, judge_surface};
pub use report::{Claim, RunReport, ToolpathReport, ToolpathResult, Verdict};
pub use scene::Scene;
pub use work::{monitor, parallel};
pub use {
    blade, collision, cutter, drop_cutter, field, geometry, io, job, keys, machine, metrology, motion,
    offset, part, program, report, scallop, scene, sim, toolpath,
};
