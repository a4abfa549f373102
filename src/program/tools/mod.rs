//! Tools that programs use: a table in TOML, the table of LinuxCNC, and remarks in programs.

mod remark;
mod table;
mod tbl;

pub use remark::same_cutter;
pub(crate) use remark::{Said, cutter_of_remark, may_describe_a_tool};
pub use table::{Described, Tool, ToolTable};
pub use tbl::{TableTool, read_tool_table};
