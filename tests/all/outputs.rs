//! What a run does to the files that it finds: it replaces those of an earlier run and nothing else, and a
//! kill leaves the old or the new results.

use std::collections::BTreeSet;
use std::path::Path;

use millstream::Session;
use millstream::io::digest;
use serde_json::Value;

use crate::command::{Answer, PLATE, entries, millstream};

const OBJ: &str = "v 0 0 0\nv 8 0 0\nv 8 6 1\nv 0 6 1\nf 1 2 3 4\n";
const PLANE: &str = "surface = \"plane\"\nx = [0, 8]\ny = [0, 6]";

/// The plate's scene with a mesh in the plate's place.
fn of_mesh(file: &str) -> String {
    PLATE.replace(PLANE, &format!("file = \"{file}\""))
}

/// A folder with these files.
fn home_with(files: &[(&str, &str)]) -> tempfile::TempDir {
    let home = tempfile::tempdir().unwrap();
    for (name, text) in files {
        let path = home.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    }
    home
}

/// All files below a folder, by their paths with slashes; links that lead nowhere are none.
fn files(folder: &Path) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    for name in entries(folder) {
        let path = folder.join(&name);
        if path.is_dir() {
            found.extend(files(&path).into_iter().map(|below| format!("{name}/{below}")));
        } else if path.exists() {
            found.insert(name);
        }
    }
    found
}

/// The run must be refused because `path` is in the way, and leave all files as they are.
fn keeps(home: &Path, arguments: &[&str], path: &str) {
    let content = |home: &Path| -> Vec<(String, Vec<u8>)> {
        let read = |name: String| (name.clone(), std::fs::read(home.join(name)).unwrap());
        files(home).into_iter().map(read).collect()
    };
    let before = content(home);
    let answer = millstream(home, arguments);
    let said = said(&answer);
    assert_eq!((answer.code, answer.stdout.as_str()), (Some(2), ""), "{said}");
    for words in [&format!("{path} is in the way"), "nothing was written", "help: ", "--out"] {
        assert!(said.contains(words), "{words}: {said}");
    }
    assert!(content(home) == before, "{said}");
    assert!(!home.join(".millstream").exists());
}

/// What was said, without the frame around it and without line breaks.
fn said(answer: &Answer) -> String {
    answer.stderr.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ")
}

fn runs(home: &Path, arguments: &[&str]) {
    let answer = millstream(home, arguments);
    assert!(matches!(answer.code, Some(0 | 1)), "{answer:?}");
}

#[test]
fn a_folder_of_the_user_is_kept() {
    let home = home_with(&[("plate.toml", PLATE), ("thesis/zigzag/chapter.txt", "years of work")]);
    let file = Path::new("thesis").join("zigzag/chapter.txt");
    keeps(home.path(), &["run", "plate.toml", "--out", "thesis"], file.to_str().unwrap());
}

#[test]
fn a_mesh_in_the_folder_of_a_toolpath_is_kept() {
    let home = home_with(&[("plate.toml", &of_mesh("zigzag/part.obj")), ("zigzag/part.obj", OBJ)]);
    keeps(home.path(), &["run", "plate.toml", "--out", "."], "./zigzag/part.obj");
}

#[test]
fn a_scene_that_is_named_as_a_result_is_kept() {
    let home = home_with(&[("report.json", PLATE)]);
    keeps(home.path(), &["run", "report.json", "--out", "."], "./report.json");
}

/// The first run's results are its own, and yet the second may not replace what it reads.
#[test]
fn a_result_that_is_read_again_is_kept() {
    let home = home_with(&[("plate.toml", PLATE), ("again.toml", &of_mesh("out/zigzag/machined.stl"))]);
    runs(home.path(), &["run", "plate.toml", "--out", "out"]);
    keeps(home.path(), &["run", "again.toml", "--out", "out"], "out/zigzag/machined.stl");
    runs(home.path(), &["run", "again.toml", "--out", "other"]);
}

#[test]
fn a_program_that_was_edited_is_kept() {
    let home = home_with(&[("plate.toml", PLATE)]);
    runs(home.path(), &["run", "plate.toml", "--out", "out"]);
    let program = home.path().join("out/zigzag/toolpath.nc");
    let edited = std::fs::read_to_string(&program).unwrap().replacen("G21", "G21 (checked)", 1);
    std::fs::write(&program, &edited).unwrap();
    keeps(home.path(), &["run", "plate.toml", "--out", "out"], "out/zigzag/toolpath.nc");
    std::fs::remove_file(&program).unwrap();
    runs(home.path(), &["run", "plate.toml", "--out", "out"]);
}

/// Results of a version that left no list.
#[test]
fn results_without_a_list_are_kept() {
    let home = home_with(&[("plate.toml", PLATE)]);
    runs(home.path(), &["run", "plate.toml", "--out", "out"]);
    std::fs::remove_file(home.path().join("out/millstream.sha256")).unwrap();
    keeps(home.path(), &["run", "plate.toml", "--out", "out"], "out/report.html");
}

#[test]
fn the_root_is_no_place_for_results() {
    let home = home_with(&[("plate.toml", PLATE)]);
    let answer = millstream(home.path(), &["run", "plate.toml", "--out", "/"]);
    assert_eq!(answer.code, Some(2), "{answer:?}");
    assert!(said(&answer).contains("it is the root of the file system"), "{answer:?}");
}

/// The list names every file but itself, with its digest.
#[test]
fn the_list_of_a_run_is_complete() {
    let home = home_with(&[("plate.toml", PLATE)]);
    runs(home.path(), &["run", "plate.toml", "--out", "out"]);
    whole(&home.path().join("out"), "Plate");
}

/// Results are whole: those that the list names, and no others, are there with their digests, and the report
/// has this title.
fn whole(out: &Path, title: &str) {
    let list = std::fs::read_to_string(out.join("millstream.sha256")).unwrap();
    let mut listed = BTreeSet::from(["millstream.sha256".to_owned()]);
    for line in list.lines().filter(|line| !line.starts_with('#')) {
        let (sha256, name) = line.split_once("  ").unwrap();
        assert_eq!(digest::of_file(&out.join(name)).unwrap().sha256, sha256, "{name}");
        listed.insert(name.to_owned());
    }
    let there = files(out).into_iter().filter(|name| !name.starts_with(".millstream/"));
    assert_eq!(there.collect::<BTreeSet<_>>(), listed);
    assert_eq!(title_of(out), title);
}

fn title_of(out: &Path) -> String {
    let report: Value = serde_json::from_slice(&std::fs::read(out.join("report.json")).unwrap()).unwrap();
    report["title"].as_str().unwrap().to_owned()
}

/// Kills runs at moments all over their publishing. The old or the new results are there, whole, at once and
/// after the next run.
#[cfg(unix)]
#[test]
fn a_killed_run_leaves_old_or_new_results() {
    use crate::command::command;
    use std::time::{Duration, Instant};

    let home = home_with(&[("first.toml", &PLATE.replace("\"Plate\"", "\"first\""))]);
    let second =
        PLATE.replace("\"Plate\"", "\"second\"").replace("strategy =", "name = \"other\"\nstrategy =");
    std::fs::write(home.path().join("second.toml"), second).unwrap();
    let out = home.path().join("out");
    let mut killed = 0;
    for attempt in 0..12 {
        runs(home.path(), &["run", "first.toml", "--out", "out"]);
        let mut child = command(home.path(), &["run", "second.toml", "--out", "out"]).spawn().unwrap();
        // The old results have second names now.
        while !out.join(".millstream/old").exists() && child.try_wait().unwrap().is_none() {}
        let moment = Instant::now();
        while moment.elapsed() < Duration::from_micros(300 * attempt) {}
        child.kill().unwrap();
        killed += usize::from(!child.wait().unwrap().success());
        let title = title_of(&out);
        assert!(title == "first" || title == "second", "{title}");
        whole(&out, &title);
    }
    assert!(killed > 0, "no run was killed");
    runs(home.path(), &["run", "second.toml", "--out", "out"]);
    whole(&out, "second");
    assert_eq!(entries(&out), ["millstream.sha256", "other", "report.html", "report.json"]);
}

/// The results may be on another file system than the folder that they are named in.
#[cfg(target_os = "linux")]
#[test]
fn results_may_be_on_another_file_system() {
    let Ok(elsewhere) = tempfile::tempdir_in("/dev/shm") else { return };
    let home = home_with(&[("plate.toml", PLATE)]);
    std::os::unix::fs::symlink(elsewhere.path(), home.path().join("out")).unwrap();
    for _ in 0..2 {
        runs(home.path(), &["run", "plate.toml", "--out", "out"]);
        whole(elsewhere.path(), "Plate");
    }
    assert!(std::fs::symlink_metadata(home.path().join("out")).unwrap().is_symlink());
}

fn report(out: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(out.join("report.json")).unwrap()).unwrap()
}

#[test]
fn every_file_that_was_read_is_in_the_report() {
    let scene = format!("{}[[fixture]]\nfile = \"side/vise.obj\"\n", of_mesh("./part.obj"));
    let vise = OBJ.replace("v 8", "v 9");
    let home = home_with(&[("plate.toml", &scene), ("part.obj", OBJ), ("side/vise.obj", &vise)]);
    runs(home.path(), &["run", "plate.toml", "--out", "out"]);
    let input = |file: &str, text: &str| {
        let fingerprint = digest::of_bytes(text.as_bytes());
        serde_json::json!({ "file": file, "bytes": fingerprint.bytes, "sha256": fingerprint.sha256 })
    };
    let expected = [input("./part.obj", OBJ), input("side/vise.obj", &vise)];
    assert_eq!(report(&home.path().join("out"))["inputs"], Value::from(expected.to_vec()));
}

#[test]
fn a_part_in_metres_is_doubted_once() {
    let metres = OBJ.replace('8', "0.008").replace('6', "0.006").replace(" 1\n", " 0.001\n");
    let home = home_with(&[("plate.toml", &of_mesh("part.obj")), ("part.obj", &metres)]);
    let answer = millstream(home.path(), &["run", "plate.toml", "--out", "out", "--cell", "auto"]);
    let report = report(&home.path().join("out"));
    let notes = report["notes"].as_array().unwrap();
    assert_eq!(notes.len(), 1, "{notes:?}");
    for words in ["0.008 mm", "6 mm", "part.obj", "metres", "`unit`"] {
        assert!(notes[0].as_str().unwrap().contains(words), "{words}: {notes:?}");
    }
    assert_eq!(answer.stdout.matches("metres").count(), 1, "{}", answer.stdout);
    let page = std::fs::read_to_string(home.path().join("out/report.html")).unwrap();
    assert_eq!(page.matches("in metres").count(), 1);
    let checked = millstream(home.path(), &["check", "plate.toml"]);
    assert!(checked.stdout.contains("in metres"), "{}", checked.stdout);
}

#[test]
fn no_shipped_scene_is_doubted() {
    let mut folders = vec![Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes")];
    let mut count = 0;
    while let Some(folder) = folders.pop() {
        for name in entries(&folder) {
            let path = folder.join(&name);
            if path.is_dir() {
                folders.push(path);
            } else if std::fs::read_to_string(&path).is_ok_and(|text| text.contains("[[toolpath]]")) {
                assert_eq!(Session::open(&path).unwrap().doubt, None, "{name}");
                count += 1;
            }
        }
    }
    assert!(count > 20, "{count}");
}
