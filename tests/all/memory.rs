//! What a run really takes against what `memory_mib` allows it. Linux tells the peak.

use std::process::Child;
use std::time::Duration;

use super::command::command;

/// What the program itself takes, MiB; measured 12, and some for what the system counts late.
const BESIDES: u64 = 16;

/// Peak resident memory of a process so far, MiB; `None` once it has ended.
fn peak(process: &Child) -> Option<u64> {
    let status = std::fs::read_to_string(format!("/proc/{}/status", process.id())).ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    Some(line.split_whitespace().nth(1)?.parse::<u64>().ok()? / 1024)
}

/// Runs a scene in a folder of its own.
fn start(scene: &str) -> (tempfile::TempDir, Child) {
    let home = tempfile::tempdir().unwrap();
    std::fs::write(home.path().join("plate.toml"), scene).unwrap();
    let arguments = ["run", "plate.toml", "--threads", "2", "--out", "out"];
    let process = command(home.path(), &arguments).spawn().unwrap();
    (home, process)
}

/// A plate of 400 000 cells with a pass on every row of cells: nowhere are there more ridges.
fn plate(memory_mib: u32) -> String {
    format!(
        "[part]\nsurface = \"plane\"\nx = [0, 80]\ny = [0, 50]\n[cutter]\nshape = \"ball\"\ndiameter = 6\n\
         [tolerance]\nscallop = 0.010\n[simulation]\ncell = 0.1\nmemory_mib = {memory_mib}\n\
         [[toolpath]]\nstrategy = \"zigzag\"\nstepover = 0.1\n"
    )
}

#[test]
fn a_run_stays_within_the_memory_that_was_allowed() {
    let allowed = 34;
    let (_home, mut process) = start(&plate(allowed));
    let mut highest = 0;
    while let Some(now) = peak(&process) {
        highest = highest.max(now);
        std::thread::sleep(Duration::from_millis(2));
    }
    assert!(process.wait().unwrap().success());
    assert!(highest > 0, "no peak was seen");
    assert!(highest <= u64::from(allowed) + BESIDES, "{highest} MiB");
}

#[test]
fn a_grid_that_does_not_fit_is_refused_before_it_is_laid_out() {
    let (home, process) = start(&plate(20));
    let output = process.wait_with_output().unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{message}");
    // The message is broken into lines at will.
    let words: Vec<&str> = message.split_whitespace().collect();
    let said = words.windows(3).find(|w| w[..2] == ["fits", "is"]);
    let cell: Option<f64> = said.and_then(|w| w[2].parse().ok());
    let cell = cell.unwrap_or_else(|| panic!("no cell is named: {message}"));
    assert!(!home.path().join("out").exists());
    let (home, process) = start(&plate(20).replace("cell = 0.1", &format!("cell = {cell}")));
    assert!(process.wait_with_output().unwrap().status.success(), "{cell} mm fits");
    assert!(home.path().join("out/report.json").exists());
}
