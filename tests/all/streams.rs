//! What the program makes of its streams, its signals, and files that are none.
#![cfg(unix)]

use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::command::{Answer, PLATE, command, ctrl_c, entries, millstream};

/// Long after any answer that is due at once, on a machine with much else to do.
const PATIENCE: Duration = Duration::from_secs(20);

fn make_pipe(path: &Path) {
    assert!(Command::new("mkfifo").arg(path).status().unwrap().success());
}

/// What a process answered within [`PATIENCE`].
fn answer_soon(mut child: Child, what: &str) -> Answer {
    let begun = Instant::now();
    while child.try_wait().unwrap().is_none() {
        if begun.elapsed() > PATIENCE {
            child.kill().unwrap();
            panic!("{what}: it hangs");
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    child.wait_with_output().unwrap().into()
}

/// A pipe with nobody at its other end, wherever a file is read.
#[test]
fn a_pipe_is_refused_at_once() {
    let plane = "surface = \"plane\"\nx = [0, 8]\ny = [0, 6]";
    let part = |text: &str| PLATE.replace(plane, text);
    let scenes = [
        ("pipe.toml", None),
        ("pipe.stl", Some(part("file = \"pipe.stl\""))),
        ("pipe.obj", Some(part("file = \"pipe.obj\""))),
        ("pipe.json", Some(part("surface = \"nurbs\"\nfile = \"pipe.json\""))),
        ("pipe.txt", Some(part("sections = \"pipe.txt\""))),
        ("vise.stl", Some(format!("{PLATE}[[fixture]]\nfile = \"vise.stl\"\n"))),
        (
            "flow.csv",
            Some(PLATE.replace(
                "strategy = \"zigzag\"",
                "strategy = \"streamline\"\ndirection = \"file\"\ndirections = \"flow.csv\"",
            )),
        ),
        (
            "pocket.dxf",
            Some(
                part("surface = \"pocket\"\nfile = \"pocket.dxf\"\ndepth = 2")
                    .replace("\"zigzag\"\nstepover = 0.5", "\"pocket-offset\""),
            ),
        ),
    ];
    for (pipe, scene) in scenes {
        let home = tempfile::tempdir().unwrap();
        make_pipe(&home.path().join(pipe));
        let name = if scene.is_some() { "scene.toml" } else { pipe };
        if let Some(text) = &scene {
            std::fs::write(home.path().join(name), text).unwrap();
        }
        for verb in ["check", "run"] {
            let answer = answer_soon(command(home.path(), &[verb, name]).spawn().unwrap(), pipe);
            let said = answer.stderr.split_whitespace().filter(|w| *w != "│").collect::<Vec<_>>().join(" ");
            assert_eq!(answer.code, Some(2), "{pipe}: {said}");
            assert!(
                said.contains("it is a pipe, not a regular file") && said.contains(pipe),
                "{pipe}: {said}"
            );
        }
    }
}

/// The program with its streams led elsewhere by a shell.
fn by_shell(home: &Path, line: &str) -> Command {
    let mut shell = Command::new("sh");
    shell.args(["-c", line, env!("CARGO_BIN_EXE_millstream")]).current_dir(home);
    shell.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    shell
}

fn home_with(name: &str, scene: &str) -> tempfile::TempDir {
    let home = tempfile::tempdir().unwrap();
    std::fs::write(home.path().join(name), scene).unwrap();
    home
}

#[cfg(target_os = "linux")]
#[test]
fn an_answer_that_cannot_be_written_is_a_failure() {
    let home = home_with("plate.toml", PLATE);
    for arguments in ["run plate.toml", "check plate.toml", "scallop --cutter ball:6 --step 0.5", "--help"] {
        let line = format!("exec \"$0\" {arguments} > /dev/full");
        let answer = Answer::from(by_shell(home.path(), &line).output().unwrap());
        assert_eq!(answer.code, Some(2), "{arguments}: {answer:?}");
        assert!(answer.stderr.contains("cannot write to standard output: No space left"), "{answer:?}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_or_closed_stderr_changes_no_exit_status() {
    let home = home_with("plate.toml", PLATE);
    for streams in ["2> /dev/full", "2>&-", "> /dev/full 2>&1", ">&- 2>&-"] {
        for (arguments, code) in [("check none.toml", 2), ("run --nonsense", 2), ("runn", 2)] {
            let line = format!("exec \"$0\" {arguments} {streams}");
            let answer = Answer::from(by_shell(home.path(), &line).output().unwrap());
            assert_eq!(answer.code, Some(code), "{arguments} {streams}: {answer:?}");
        }
    }
    let answer =
        Answer::from(by_shell(home.path(), "exec \"$0\" check plate.toml 2> /dev/full").output().unwrap());
    assert_eq!(answer.code, Some(0), "{answer:?}");
}

#[test]
fn a_reader_that_has_read_enough_is_no_failure() {
    let home = home_with("plate.toml", PLATE);
    let mut child = command(home.path(), &["check", "plate.toml"]).spawn().unwrap();
    drop(child.stdout.take());
    let answer = answer_soon(child, "closed pipe");
    assert_eq!((answer.code, answer.stderr.as_str()), (Some(0), ""));
}

/// A name that would turn a terminal red, and clear it.
const RED: &str = "a\u{1b}[31m\u{9b}2Jb";

fn obeyed(text: &str) -> bool {
    text.contains(|c: char| c.is_control() && !matches!(c, '\n' | '\t' | '\r'))
}

#[test]
fn no_name_of_a_file_speaks_to_the_terminal_or_the_page() {
    let untitled = PLATE.replace("title = \"Plate\"\n", "");
    let scene = format!("{RED}.toml");
    let home = home_with(&scene, &untitled);
    let answers = [
        millstream(home.path(), &["check", &scene]),
        millstream(home.path(), &["run", &scene]),
        millstream(home.path(), &["run", &scene, "--out", RED]),
        // Wrong in several ways.
        millstream(home.path(), &["check", RED]),
        millstream(home.path(), &["run", &scene, RED]),
        millstream(home.path(), &["run", &scene, "--cell", RED]),
        millstream(home.path(), &["run", &scene, "--out", &scene]),
        millstream(
            home.path(),
            &["scallop", "--cutter", "ball:6", "--step", "1", "--part", RED, "--at", "0,0"],
        ),
        millstream(home.path(), &["scallop", "--cutter", RED, "--step", "1"]),
    ];
    for (k, answer) in answers.iter().enumerate() {
        assert_eq!(answer.code, Some(if k < 3 { 0 } else { 2 }), "{answer:?}");
        assert!(!obeyed(&answer.stdout) && !obeyed(&answer.stderr), "{answer:?}");
    }
    for file in ["report.html", "report.json", "zigzag/toolpath.nc", "zigzag/toolpath.cls"] {
        let text = std::fs::read_to_string(home.path().join(RED).join(file)).unwrap();
        assert!(!obeyed(&text), "{file}");
    }
    std::fs::write(home.path().join(&scene), untitled.replace("diameter", "diametr")).unwrap();
    let answer = millstream(home.path(), &["check", &scene]);
    assert!(answer.code == Some(2) && !obeyed(&answer.stderr), "{answer:?}");
}

fn send(signal: &str, child: &Child) {
    assert!(Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap().success());
}

/// A scene that takes minutes.
fn long() -> String {
    let wide = PLATE.replace("surface = \"plane\"", "surface = \"wave\"\namplitude = 0.5\nwavelength_x = 12");
    wide.replace("x = [0, 8]", "x = [0, 250]").replace("y = [0, 6]", "y = [0, 250]")
}

/// Waits until the run is at work.
fn at_work(home: &Path, child: &mut Child) {
    while !home.join("out/.millstream").exists() {
        assert!(child.try_wait().unwrap().is_none(), "the run ends before it begins");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// As under `nohup`, and as a shell starts what it puts in the background.
#[cfg(target_os = "linux")]
#[test]
fn a_signal_that_was_ignored_stays_ignored() {
    // What the tests themselves were told to ignore, under `nohup` for one, no shell can undo.
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:")).unwrap();
    let mask = u64::from_str_radix(mask.trim(), 16).unwrap();
    let is_heard = |number: u32| mask & (1 << (number - 1)) == 0;
    for (ignored, (other, number)) in [("HUP", ("TERM", 15)), ("INT", ("TERM", 15)), ("TERM", ("HUP", 1))] {
        if !is_heard(number) {
            continue;
        }
        let home = home_with("plate.toml", &long());
        let line = format!("trap '' {ignored}; exec \"$0\" run plate.toml --out out");
        let mut child = by_shell(home.path(), &line).spawn().unwrap();
        at_work(home.path(), &mut child);
        send(&format!("-{ignored}"), &child);
        std::thread::sleep(Duration::from_millis(700));
        assert!(child.try_wait().unwrap().is_none(), "{ignored} ends it");
        send(&format!("-{other}"), &child);
        let answer = answer_soon(child, other);
        assert_eq!(answer.code, Some(2), "{ignored} {other}: {answer:?}");
        assert!(answer.stderr.contains("interrupted; nothing was written"), "{answer:?}");
        assert_eq!(entries(home.path()), ["plate.toml"]);
    }
}

/// It answers no first one while nobody reads what it writes.
#[test]
fn a_second_ctrl_c_ends_it_at_once() {
    let toolpath = |k: u32| format!("[[toolpath]]\nname = \"t{k}\"\nstrategy = \"zigzag\"\n");
    let many: String = (0..2000).map(toolpath).collect();
    let home = home_with("plate.toml", &format!("{PLATE}{many}"));
    let mut child = command(home.path(), &["check", "plate.toml"]).spawn().unwrap();
    std::thread::sleep(Duration::from_millis(1500));
    send(ctrl_c(), &child);
    std::thread::sleep(Duration::from_millis(300));
    assert!(child.try_wait().unwrap().is_none(), "it is about to write");
    send(ctrl_c(), &child);
    let begun = Instant::now();
    while child.try_wait().unwrap().is_none() {
        assert!(begun.elapsed() < PATIENCE, "it does not end");
        std::thread::sleep(Duration::from_millis(5));
    }
    assert_eq!(child.wait().unwrap().code(), Some(2));
}
