//! What a run really takes against what `memory_mib` allows it. Linux tells the peak.

use std::path::Path;
use std::process::{Child, Stdio};
use std::time::Duration;

use super::command::command;
use super::support::{height_mesh, write_stl};

/// Memory that the scenes here allow, MiB.
const ALLOWED: u64 = 64;

/// What may come on top, MiB: stacks, tables, and what the allocator keeps. A run whose cells took twice what
/// is counted for them would exceed it by far.
const BESIDES: u64 = 12;

/// What a run may take between two looks at its memory, MiB.
const SLACK: u64 = 12;

/// Memory that a process has written to and holds, MiB; `None` once it has ended. Pages of the program's own
/// file are no demand, because the system takes them back.
fn held(process: &Child) -> Option<u64> {
    let status = std::fs::read_to_string(format!("/proc/{}/status", process.id())).ok()?;
    let line = status.lines().find(|line| line.starts_with("RssAnon:"))?;
    Some(line.split_whitespace().nth(1)?.parse::<u64>().ok()? / 1024)
}

/// The most that a process holds until it ends, looked at every other millisecond, MiB.
fn peak(process: &Child) -> u64 {
    let mut highest = 0;
    while let Some(now) = held(process) {
        highest = highest.max(now);
        std::thread::sleep(Duration::from_millis(2));
    }
    assert!(highest > 0, "no peak was seen");
    highest
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

/// The message of a grid that does not fit names the finest cell that does. A run with it takes all that is
/// allowed, and no more.
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
    let highest = peak(&process);
    assert!(process.wait().unwrap().success(), "{cell} mm fits");
    assert!(home.path().join("out/report.json").exists());
    assert!(highest <= ALLOWED + BESIDES, "{highest} MiB with cells of {cell} mm");
}

/// A plate under a memory that its plan exceeds: no estimate knows of that before it is made.
#[test]
fn a_plan_that_takes_more_than_was_allowed_ends_the_run() {
    let scene = "[part]\nsurface = \"plane\"\nx = [0, 200]\ny = [0, 200]\n[cutter]\nshape = \"ball\"\ndiameter = 6\n\
                 [simulation]\nmemory_mib = 1\n[[toolpath]]\nstrategy = \"zigzag\"\n";
    let (home, process) = start(scene);
    let highest = peak(&process);
    let output = process.wait_with_output().unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(message.contains("memory_mib"), "{message}");
    assert!(!home.path().join("out").exists());
    assert!(highest <= 1 + BESIDES + SLACK, "{highest} MiB");
}

/// The tables of a plan are made to fit; a large part under next to no memory is refused for its cells.
#[test]
fn the_plan_of_a_large_part_takes_no_more_than_was_allowed() {
    let scene = "[part]\nsurface = \"plane\"\nx = [0, 1000]\ny = [0, 1000]\n[cutter]\nshape = \"ball\"\ndiameter = 6\n\
                 [simulation]\nmemory_mib = 1\n[[toolpath]]\nstrategy = \"zigzag\"\nstepover = 2\n";
    let (home, process) = start(scene);
    let highest = peak(&process);
    let output = process.wait_with_output().unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.code() == Some(2) && message.contains("memory_mib"), "{message}");
    assert!(!home.path().join("out").exists());
    assert!(highest <= 1 + BESIDES, "{highest} MiB");
}

/// Figures that nothing is judged by are left out where they do not fit, with the reason.
#[test]
fn a_roughness_that_does_not_fit_is_left_out() {
    let scene = "[part]\nsurface = \"plane\"\nx = [0, 1000]\ny = [0, 1000]\n[cutter]\nshape = \"ball\"\ndiameter = 6\n\
                 [simulation]\nmemory_mib = 1\n[[toolpath]]\nstrategy = \"zigzag\"\nstepover = 5\n";
    let (home, process) = start(scene);
    let highest = peak(&process);
    let output = process.wait_with_output().unwrap();
    assert!(matches!(output.status.code(), Some(0 | 1)), "{output:?}");
    let report = std::fs::read_to_string(home.path().join("out/report.json")).unwrap();
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    let roughness = &report["toolpaths"][0]["roughness"];
    assert!(roughness["ra_mm"].is_null(), "{roughness}");
    assert!(roughness["reason"].as_str().unwrap().contains("to be met by rays"), "{roughness}");
    assert!(highest <= 1 + BESIDES, "{highest} MiB");
}

/// A mesh is refused by the size that its file states, before its triangles are made.
#[test]
fn a_mesh_beyond_the_memory_is_refused_unread() {
    let (home, process) = {
        let home = tempfile::tempdir().unwrap();
        let triangles = 720_000u32;
        let mut bytes = vec![0u8; 84 + 50 * triangles as usize];
        bytes[80..84].copy_from_slice(&triangles.to_le_bytes());
        std::fs::write(home.path().join("part.stl"), bytes).unwrap();
        let scene = "[part]\nfile = \"part.stl\"\n[cutter]\nshape = \"ball\"\ndiameter = 6\n\
                     [simulation]\nmemory_mib = 100\n[[toolpath]]\nstrategy = \"zigzag\"\n";
        std::fs::write(home.path().join("plate.toml"), scene).unwrap();
        let process = command(home.path(), &["run", "plate.toml", "--out", "out"]).spawn().unwrap();
        (home, process)
    };
    let highest = peak(&process);
    let output = process.wait_with_output().unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.code() == Some(2) && message.contains("the mesh needs about"), "{message}");
    assert!(!home.path().join("out").exists());
    assert!(highest <= 100 + BESIDES, "{highest} MiB");
}

/// A part of so many triangles that little else counts: they take no more than they are counted as.
#[test]
fn a_large_mesh_runs_within_the_memory_that_its_triangles_count() {
    const ALLOWED: u64 = 140;
    let home = tempfile::tempdir().unwrap();
    let mesh = height_mesh(290, [60.0, 60.0], |x, y| 2.0 * (x / 8.0).sin() * (y / 8.0).cos());
    let corners: Vec<_> = (0..mesh.triangles().len()).map(|t| mesh.corners(t)).collect();
    write_stl(&home.path().join("part.stl"), &corners);
    let scene = "[part]\nfile = \"part.stl\"\n[cutter]\nshape = \"ball\"\ndiameter = 6\n\
                 [tolerance]\ncorrect = false\n[simulation]\ncell = 0.5\n[[toolpath]]\nstrategy = \"zigzag\"\n";
    std::fs::write(home.path().join("plate.toml"), scene).unwrap();
    let allowed = ALLOWED.to_string();
    let arguments = ["run", "plate.toml", "--memory", &allowed, "--threads", "1", "--out", "out"];
    let process = command(home.path(), &arguments).stdout(Stdio::null()).spawn().unwrap();
    let highest = peak(&process);
    let output = process.wait_with_output().unwrap();
    assert!(matches!(output.status.code(), Some(0 | 1)), "{output:?}");
    assert!(highest <= ALLOWED + BESIDES, "{highest} MiB");
    // Nor is it counted as much more than it takes.
    assert!(highest > ALLOWED / 2, "{highest} MiB");
}

/// Runs shipped scenes with the memory that each allows.
fn shipped_scenes_stay_within(scenes: &[&str]) {
    for scene in scenes {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(scene);
        let allowed = u64::from(millstream::Scene::read(&path).unwrap().simulation.memory_mib);
        let home = tempfile::tempdir().unwrap();
        let arguments = ["run", path.to_str().unwrap(), "--threads", "1", "--out", "out"];
        let process = command(home.path(), &arguments).stdout(Stdio::null()).spawn().unwrap();
        let highest = peak(&process);
        let output = process.wait_with_output().unwrap();
        assert!(matches!(output.status.code(), Some(0 | 1)), "{scene}: {output:?}");
        println!("{scene}: {highest} MiB of {allowed}");
        assert!(highest <= allowed + BESIDES, "{scene}: {highest} MiB of {allowed}");
    }
}

#[test]
fn quick_shipped_scenes_run_within_their_memory() {
    shipped_scenes_stay_within(&["coarse_chords.toml", "groove.toml"]);
}

#[test]
#[ignore = "minutes: every night"]
fn all_shipped_scenes_run_within_their_memory() {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let mut found = Vec::new();
    for folder in ["", "blades", "compare", "five_axes"] {
        for file in std::fs::read_dir(scenes.join(folder)).unwrap() {
            let path = Path::new(folder).join(file.unwrap().file_name());
            // A blade's own description is a table of the scenes beside it.
            let text = std::fs::read_to_string(scenes.join(&path)).unwrap_or_default();
            if path.extension().is_some_and(|e| e == "toml") && text.contains("[[toolpath]]") {
                found.push(path.to_str().unwrap().to_owned());
            }
        }
    }
    found.sort();
    assert!(found.len() > 20, "{found:?}");
    shipped_scenes_stay_within(&found.iter().map(String::as_str).collect::<Vec<_>>());
}
