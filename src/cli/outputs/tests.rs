//! Whose files are kept, and what a kill leaves.

use std::sync::atomic::Ordering;

use super::disk::Stops;
use super::*;

fn entries(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

fn claims(folders: &[&str]) -> Claims {
    Claims {
        files: &["report.html", "report.json"],
        folders: folders.iter().map(|&folder| folder.to_owned()).collect(),
        inputs: Vec::new(),
    }
}

/// Fills the folders `folders`, each with a file of this text and one named by it.
fn fill_on(disk: Disk, target: &Path, folders: &[&str], text: &str) -> Result<Outputs, CliError> {
    let outputs = Outputs::begin_on(disk, target, &claims(folders))?;
    for folder in folders {
        outputs.folder(folder).unwrap();
        for name in ["a.txt", &format!("{text}.txt")] {
            outputs.file(&format!("{folder}/{name}"), |out| out.write_all(text.as_bytes())).unwrap();
        }
    }
    outputs.file("report.json", |out| out.write_all(text.as_bytes())).unwrap();
    Ok(outputs)
}

fn fill(target: &Path, text: &str) -> Outputs {
    fill_on(Disk::default(), target, &["zigzag"], text).unwrap()
}

/// What a reader finds: the names that lead somewhere, and their bytes, without the staging folder and
/// without empty folders.
fn read(folder: &Path) -> BTreeMap<String, String> {
    let mut found = BTreeMap::new();
    for name in entries(folder).into_iter().filter(|name| name != STAGING) {
        let path = folder.join(&name);
        if path.is_dir() {
            found.extend(read(&path).into_iter().map(|(below, text)| (format!("{name}/{below}"), text)));
        } else if let Ok(text) = fs::read_to_string(&path) {
            found.insert(name, text);
        }
    }
    found
}

/// The path that was refused as being in the way.
fn in_the_way(result: Result<Outputs, CliError>) -> PathBuf {
    match result {
        Err(CliError::InTheWay { path, .. }) => path,
        other => panic!("{other:?}"),
    }
}

#[test]
fn results_appear_all_at_once_and_replace_earlier_ones() {
    let home = tempfile::tempdir().unwrap();
    let target = home.path().join("out/wave");
    fill(&target, "first").publish().unwrap();
    assert_eq!(entries(&target), ["millstream.sha256", "report.json", "zigzag"]);
    fs::write(target.join("mine.txt"), "kept").unwrap();
    fill(&target, "second").publish().unwrap();
    assert_eq!(entries(&target), ["millstream.sha256", "mine.txt", "report.json", "zigzag"]);
    assert_eq!(entries(&target.join("zigzag")), ["a.txt", "second.txt"]);
    assert_eq!(fs::read_to_string(target.join("zigzag/a.txt")).unwrap(), "second");
    assert_eq!(entries(&home.path().join("out")), ["wave"], "no scratch is left");
    let kind = fs::symlink_metadata(target.join("zigzag/a.txt")).unwrap();
    assert!(kind.is_file(), "no links are left");
}

#[test]
fn folders_that_no_toolpath_has_any_more_go_but_for_what_is_not_ours() {
    let home = tempfile::tempdir().unwrap();
    let target = home.path().join("out");
    fill_on(Disk::default(), &target, &["along", "zigzag"], "first").unwrap().publish().unwrap();
    fs::write(target.join("along/mine.txt"), "kept").unwrap();
    fs::write(target.join("along/a.txt"), "changed").unwrap();
    fill_on(Disk::default(), &target, &["spiral"], "second").unwrap().publish().unwrap();
    assert_eq!(entries(&target), ["along", "millstream.sha256", "report.json", "spiral"]);
    assert_eq!(entries(&target.join("along")), ["a.txt", "mine.txt"]);
}

#[test]
fn nothing_appears_when_a_run_stops_early() {
    let home = tempfile::tempdir().unwrap();
    let target = home.path().join("deep/out");
    drop(fill(&target, "text"));
    let outputs = fill(&target, "text");
    assert!(outputs.file("x", |_| Err::<(), _>(std::io::Error::other("full"))).is_err());
    drop(outputs);
    assert_eq!(entries(home.path()), [""; 0]);
}

#[test]
fn a_run_that_does_not_answer_leaves_nothing_either() {
    let home = tempfile::tempdir().unwrap();
    let target = home.path().join("deep/out");
    let outputs = fill(&target, "text");
    let discarding = outputs.discarding();
    assert_eq!(entries(&target), [STAGING]);
    std::thread::spawn(discarding).join().unwrap();
    assert_eq!(entries(home.path()), [""; 0]);
    // The process ends before the run can drop what it holds.
    std::mem::forget(outputs);
    // Results of an earlier run stay.
    fill(&target, "first").publish().unwrap();
    let outputs = fill(&target, "second");
    outputs.discarding()();
    assert_eq!(entries(&target), ["millstream.sha256", "report.json", "zigzag"]);
}

#[test]
fn a_second_run_waits_its_turn() {
    let home = tempfile::tempdir().unwrap();
    let living = fill(home.path(), "text");
    let error = Outputs::begin(home.path(), &claims(&["other"])).unwrap_err().to_string();
    assert!(error.contains("another run is writing to it"), "{error}");
    living.publish().unwrap();
    assert!(Outputs::begin(home.path(), &claims(&["other"])).is_ok());
}

/// A process that is just being started has a copy of every open file.
#[test]
fn a_copy_of_the_lock_does_not_hold_it() {
    let home = tempfile::tempdir().unwrap();
    let first = fill(home.path(), "text");
    let copy = first._lock.as_ref().unwrap().0.try_clone().unwrap();
    first.publish().unwrap();
    assert!(Outputs::begin(home.path(), &claims(&["other"])).is_ok());
    drop(copy);
}

#[test]
fn a_file_in_the_place_of_the_folder_and_the_root_are_refused() {
    let home = tempfile::tempdir().unwrap();
    let target = home.path().join("out");
    fs::write(&target, "").unwrap();
    assert!(matches!(Outputs::begin(&target, &claims(&[])), Err(CliError::Output { .. })));
    let error = Outputs::begin(Path::new("/"), &claims(&["zigzag"])).unwrap_err().to_string();
    assert!(error.contains("root of the file system"), "{error}");
}

#[test]
fn what_no_run_wrote_is_in_the_way() {
    for (name, blamed) in [
        ("zigzag/mine.txt", "zigzag/mine.txt"),
        ("zigzag/deep/mine.txt", "zigzag/deep/mine.txt"),
        ("report.json", "report.json"),
        ("report.html", "report.html"),
        ("millstream.sha256", "millstream.sha256"),
        ("zigzag", "zigzag"),
        (".millstream/mine.txt", ".millstream"),
    ] {
        let home = tempfile::tempdir().unwrap();
        let file = home.path().join(name);
        fs::create_dir_all(file.parent().unwrap()).unwrap();
        fs::write(&file, "mine").unwrap();
        let before = read(home.path());
        let refused = in_the_way(Outputs::begin(home.path(), &claims(&["zigzag"])));
        assert_eq!(refused, home.path().join(blamed));
        assert_eq!((read(home.path()), fs::read_to_string(&file).unwrap()), (before, "mine".to_owned()));
    }
}

#[test]
fn what_was_changed_or_added_since_is_in_the_way() {
    for (name, text) in [("zigzag/a.txt", "edited"), ("zigzag/b.txt", "added"), ("report.json", "{}")] {
        let home = tempfile::tempdir().unwrap();
        fill(home.path(), "first").publish().unwrap();
        fs::write(home.path().join(name), text).unwrap();
        let refused = in_the_way(Outputs::begin(home.path(), &claims(&["zigzag"])));
        assert_eq!(refused, home.path().join(name));
    }
}

#[test]
fn what_the_run_reads_is_in_the_way() {
    let home = tempfile::tempdir().unwrap();
    fill(home.path(), "first").publish().unwrap();
    // A result of the first run, by its name and by a way around; a file that is only read stays.
    for (input, refused) in
        [("zigzag/a.txt", true), ("zigzag/../report.json", true), ("beside.stl", false), ("zigzag", true)]
    {
        fs::write(home.path().join("beside.stl"), "").unwrap();
        let claims = Claims { inputs: vec![home.path().join(input)], ..claims(&["other"]) };
        // A folder is never an input; it stands for one that no run wrote yet.
        let refused = refused && input != "zigzag";
        assert_eq!(Outputs::begin(home.path(), &claims).is_err(), refused, "{input}");
    }
}

#[cfg(unix)]
#[test]
fn links_of_the_user_are_not_followed() {
    use std::os::unix::fs::symlink;
    let home = tempfile::tempdir().unwrap();
    let (target, elsewhere) = (home.path().join("out"), home.path().join("elsewhere"));
    fill(&target, "first").publish().unwrap();
    // The whole folder was moved, and a link leads to it.
    fs::rename(target.join("zigzag"), &elsewhere).unwrap();
    symlink(&elsewhere, target.join("zigzag")).unwrap();
    assert_eq!(
        in_the_way(Outputs::begin(&target, &claims(&["zigzag"]))),
        target.join("zigzag"),
        "a link where a folder is to be"
    );
    fill_on(Disk::default(), &target, &["spiral"], "second").unwrap().publish().unwrap();
    assert_eq!(entries(&elsewhere), ["a.txt", "first.txt"]);
    // The target may be one.
    symlink(&target, home.path().join("link")).unwrap();
    fill_on(Disk::default(), &home.path().join("link"), &["spiral"], "third").unwrap().publish().unwrap();
    assert_eq!(fs::read_to_string(target.join("report.json")).unwrap(), "third");
}

#[test]
fn what_comes_during_the_run_is_kept() {
    let home = tempfile::tempdir().unwrap();
    fill(home.path(), "first").publish().unwrap();
    let before = read(home.path());
    let outputs = fill(home.path(), "second");
    fs::write(home.path().join("zigzag/second.txt"), "mine").unwrap();
    assert!(outputs.publish().is_err());
    let mut after = read(home.path());
    assert_eq!(after.remove("zigzag/second.txt").unwrap(), "mine");
    assert_eq!(after, before);
    fs::remove_file(home.path().join("zigzag/second.txt")).unwrap();
    let outputs = fill(home.path(), "second");
    fs::write(home.path().join("report.json"), "mine, longer").unwrap();
    assert!(outputs.publish().is_err());
    assert_eq!(fs::read_to_string(home.path().join("report.json")).unwrap(), "mine, longer");
}

/// A disk that is killed after so many steps.
fn killed_after(steps: usize, without_links: bool) -> Disk {
    let test = Stops { left: steps.into(), without_links: without_links.into(), ..Stops::default() };
    Disk { test }
}

const BEFORE: [&str; 2] = ["along", "zigzag"];
const AFTER: [&str; 2] = ["spiral", "zigzag"];

/// A folder with results and a file of the user.
fn first_results() -> tempfile::TempDir {
    let home = tempfile::tempdir().unwrap();
    fill_on(Disk::default(), home.path(), &BEFORE, "first").unwrap().publish().unwrap();
    fs::write(home.path().join("mine.txt"), "kept").unwrap();
    home
}

/// The old and the new results, as a reader finds them.
fn old_and_new() -> [BTreeMap<String, String>; 2] {
    let home = first_results();
    let old = read(home.path());
    fill_on(Disk::default(), home.path(), &AFTER, "second").unwrap().publish().unwrap();
    [old, read(home.path())]
}

/// Publishes over earlier results, and is killed after so many steps; `None` if it ended before.
fn kill_publishing(steps: usize, without_links: bool) -> Option<tempfile::TempDir> {
    let home = first_results();
    let outputs = fill_on(killed_after(usize::MAX, without_links), home.path(), &AFTER, "second").unwrap();
    outputs.place.disk.test.left.store(steps, Ordering::Relaxed);
    outputs.publish().is_err().then_some(home)
}

/// Kills at every step of publishing. What a reader finds at once, and what the next run makes of it when it
/// is killed at every step in turn, is the old or the new result, and the same one.
#[cfg(unix)]
#[test]
fn a_kill_at_any_step_leaves_the_old_or_the_new_results() {
    let [old, new] = old_and_new();
    let (mut held, mut steps) = ([0, 0], 0);
    while let Some(home) = kill_publishing(steps, false) {
        let found = read(home.path());
        assert!(found == old || found == new, "step {steps}: {found:?}");
        assert!(held[1] == 0 || found == new, "the new results stay, step {steps}");
        held[usize::from(found == new)] += 1;
        kill_every_repair(home.path(), &found, steps);
        steps += 1;
    }
    assert!(held.iter().all(|&count| count > 5) && steps > 30, "{held:?} of {steps} steps");
}

/// Puts `home` in order, killed after each number of steps in turn until it is done.
fn kill_every_repair(home: &Path, expected: &BTreeMap<String, String>, step: usize) {
    for steps in 0.. {
        let place = ResultsPlace { target: home.to_owned(), disk: killed_after(steps, false) };
        let done = place.settle().is_ok();
        assert!(read(home) == *expected, "step {step}, repaired {steps} steps");
        if done {
            break;
        }
        assert!(place.is_ours());
    }
    assert!(!home.join(STAGING).exists());
    no_links(home);
    assert!(entries(&home.join("zigzag")).len() == 2, "no empty or foreign names");
    assert!(fill_on(Disk::default(), home, &AFTER, "third").is_ok(), "step {step}: all of it is ours");
}

fn no_links(folder: &Path) {
    for entry in fs::read_dir(folder).unwrap().flatten() {
        let kind = entry.file_type().unwrap();
        assert!(!kind.is_symlink(), "{:?}", entry.path());
        if kind.is_dir() {
            no_links(&entry.path());
        }
    }
}

/// Without links a reader may find neither, and sees it: there is no report.json then. The next run mends it.
#[test]
fn without_links_a_kill_leaves_what_the_next_run_completes() {
    let [old, new] = old_and_new();
    let mut steps = 0;
    while let Some(home) = kill_publishing(steps, true) {
        let found = read(home.path());
        assert!(
            found == old || found == new || !found.contains_key("report.json"),
            "step {steps}: {found:?}"
        );
        for repairing in 0.. {
            let place = ResultsPlace { target: home.path().to_owned(), disk: killed_after(repairing, true) };
            if place.settle().is_ok() {
                break;
            }
        }
        let mended = read(home.path());
        assert!(mended == old || mended == new, "step {steps}: {mended:?}");
        assert!(!home.path().join(STAGING).exists());
        steps += 1;
    }
    assert!(steps > 15, "{steps}");
    assert_eq!(old["mine.txt"], "kept");
    assert_eq!(new["mine.txt"], "kept");
}
