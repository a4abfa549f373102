//! The real program, run in a folder of its own.

use std::path::Path;
use std::process::{Command, Output, Stdio};

/// A small plate on a coarse grid, which passes within a few milliseconds.
pub const PLATE: &str = r#"title = "Plate"
[part]
surface = "plane"
x = [0, 8]
y = [0, 6]
[cutter]
shape = "ball"
diameter = 6
[tolerance]
scallop = 0.0105
[simulation]
cell = 0.1
[[toolpath]]
strategy = "zigzag"
stepover = 0.5
"#;

/// The program with these arguments, to be started in `home`, its streams in pipes.
pub fn command(home: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_millstream"));
    command.args(arguments).current_dir(home);
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// What the program answered.
#[derive(Debug)]
pub struct Answer {
    pub code: Option<i32>,
    pub stdout: String,
    pub stderr: String,
}

impl From<Output> for Answer {
    fn from(output: Output) -> Self {
        let text = |bytes| String::from_utf8(bytes).expect("the program writes UTF-8");
        Self { code: output.status.code(), stdout: text(output.stdout), stderr: text(output.stderr) }
    }
}

pub fn millstream(home: &Path, arguments: &[&str]) -> Answer {
    command(home, arguments).output().expect("the program starts").into()
}

/// Ctrl-C as `kill` spells it. A shell ignores it for what it starts in the background, tests too, and the
/// program keeps that; then it is SIGTERM, which means the same.
#[cfg(unix)]
pub fn ctrl_c() -> &'static str {
    let told = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = told.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let ignored = ignored.and_then(|digits| u64::from_str_radix(digits.trim(), 16).ok()).unwrap_or(0);
    // Signal 2 is the second bit.
    if ignored & 2 == 0 { "-INT" } else { "-TERM" }
}

/// Names in a folder, sorted.
pub fn entries(folder: &Path) -> Vec<String> {
    let list = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<String> = list.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}
