//! What a run really takes against what `memory_mib` allows it. Linux tells the peak.

use std::process::Child;
use std::time::Duration;

use super::command::command;

/// Memory that the scenes here allow, MiB.
const ALLOWED: u64 = 64;

/// What may come on top, MiB: the program itself, and what its allocator keeps. A run whose cells took twice what is
/// counted for them would exceed it by far.
const BESIDES: u64 = 40;

/// Peak resident memory of a process so far, MiB; `None` once it has ended.
fn peak(process: &Child) -> Option<u64> {
    let status = std::fs::read_to_string(format!("/proc/{}/status", process.id())).ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    Some(line.split_whitespace().nth(1)?.parse::<u64>().ok()? / 1024)
}

/// Runs a scene in a folder of its own. With one thread, for the allocator keeps memory for each.
fn start(scene: &str) -> (tempfile::TempDir, Child) {
    let home = tempfile::tempdir().unwrap();
    std::fs::write(home.path().join("plate.toml"), scene).unwrap();
    let arguments = ["run", "plate.toml", "--threads", "1", "--out", "out"];
    let process = command(home.path(), &arguments).spawn().unwrap();
    (home, process)
}

/// A plate with a pass on every row of cells: nowhere are there more ridges.
fn plate(cell: f64) -> String {
    format!(
        "[part]\nsurface = \"plane\"\nx = [0, 80]\ny = [0, 50]\n[cutter]\nshape = \"ball\"\ndiameter = 6\n\
         [tolerance]\nscallop = 0.010\n[simulation]\ncell = {cell}\nmemory_mib = {ALLOWED}\n\
         [[toolpath]]\nstrategy = \"zigzag\"\nstepover = {cell}\n"
    )
}

/// The message of a grid that does not fit names the finest cell that does. A run with it takes all that is allowed,
/// and no more.
#[test]
fn a_run_stays_within_the_memory_that_was_allowed() {
    let (home, process) = start(&plate(0.02));
    let output = process.wait_with_output().unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(!home.path().join("out").exists());
    // The message is broken into lines at will.
    let words: Vec<&str> = message.split_whitespace().collect();
    let said = words.windows(3).find(|w| w[..2] == ["fits", "is"]);
    let cell: Option<f64> = said.and_then(|w| w[2].parse().ok());
    let cell = cell.unwrap_or_else(|| panic!("no cell is named: {message}"));

    let (home, mut process) = start(&plate(cell));
    let mut highest = 0;
    while let Some(now) = peak(&process) {
        highest = highest.max(now);
        std::thread::sleep(Duration::from_millis(2));
    }
    assert!(process.wait().unwrap().success(), "{cell} mm fits");
    assert!(home.path().join("out/report.json").exists());
    assert!(highest > 0, "no peak was seen");
    assert!(highest <= ALLOWED + BESIDES, "{highest} MiB with cells of {cell} mm");
}
