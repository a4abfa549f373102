//! Many scenes in one go: what got worse, what a bad scene costs, kills, shards, Slurm.

use std::path::Path;

use serde_json::Value;

use crate::command::{Answer, PLATE, command, millstream};

/// A folder with scenes of these names and texts in `scenes`.
fn home_with(scenes: &[(&str, &str)]) -> tempfile::TempDir {
    let home = tempfile::tempdir().unwrap();
    for (name, text) in scenes {
        let path = home.path().join("scenes").join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    }
    home
}

fn nightly(home: &Path, arguments: &[&str]) -> Answer {
    millstream(home, &[&["nightly", "scenes"], arguments].concat())
}

fn read(home: &Path, file: &str) -> Value {
    serde_json::from_slice(&std::fs::read(home.join(file)).unwrap()).unwrap()
}

/// The figures of a nightly: all of it but its times and places.
fn figures(home: &Path, out: &str) -> Value {
    let mut results = read(home, &format!("{out}/nightly.json"));
    results.as_object_mut().unwrap().remove("date");
    for scene in results["scenes"].as_array_mut().unwrap() {
        scene.as_object_mut().unwrap().retain(|key, _| key != "cost" && key != "page");
    }
    results
}

/// Multiplies a number of nightly.json.
fn scaled(home: &Path, from: &str, to: &str, pointer: &str, factor: f64) {
    let mut results = read(home, from);
    let number = results.pointer_mut(pointer).unwrap();
    *number = (number.as_f64().unwrap() * factor).into();
    std::fs::write(home.join(to), results.to_string()).unwrap();
}

fn wide() -> String {
    PLATE.replace("[0, 8]", "[0, 12]")
}

#[test]
fn two_per_cent_are_caught_and_noise_in_time_is_not() {
    let home = home_with(&[("a.toml", PLATE), ("b/wide.toml", &wide())]);
    let home = home.path();
    let first = nightly(home, &["--out", "one", "--history", "history.jsonl"]);
    assert_eq!(first.code, Some(0), "{}", first.stderr);
    let pointer = "/scenes/1/outcome/done/toolpaths/0/figures/scallop_max_mm";
    scaled(home, "one/nightly.json", "worse.json", pointer, 1.0 / 1.02);
    scaled(home, "one/nightly.json", "quicker.json", "/scenes/1/cost/cpu_s", 1.0 / 1.2);
    let with =
        |baseline| nightly(home, &["--out", "one", "--history", "history.jsonl", "--baseline", baseline]);
    let worse = with("worse.json");
    assert_eq!(worse.code, Some(1), "{}", worse.stderr);
    assert!(
        worse.stdout.contains("b/wide, zigzag: Scallop max") && worse.stdout.contains("+2.00 %"),
        "{}",
        worse.stdout
    );
    let junit = std::fs::read_to_string(home.join("one/junit.xml")).unwrap();
    assert!(junit.contains("failures=\"1\"") && junit.contains("+2.00 %"), "{junit}");
    assert_eq!(with("quicker.json").code, Some(0));
    // Finished scenes were not run again, so it is one night.
    assert_eq!(std::fs::read_to_string(home.join("history.jsonl")).unwrap().lines().count(), 1);
    let fresh = nightly(home, &["--out", "one", "--history", "history.jsonl", "--fresh"]);
    assert_eq!(fresh.code, Some(0), "{}", fresh.stderr);
    assert_eq!(std::fs::read_to_string(home.join("history.jsonl")).unwrap().lines().count(), 2);
    assert!(std::fs::read_to_string(home.join("one/report.html")).unwrap().contains("<polyline"));
}

#[test]
#[cfg(target_os = "linux")]
fn a_scene_that_fails_or_exhausts_its_memory_costs_only_itself() {
    let large = PLATE.replace("[0, 8]", "[0, 400]").replace("[0, 6]", "[0, 400]");
    let scenes =
        [("broken.toml", "[part]\nsurface = \"wav\"\n"), ("good.toml", PLATE), ("large.toml", &large)];
    let home = home_with(&scenes);
    let home = home.path();
    let answer = nightly(home, &["--memory", "150"]);
    assert_eq!(answer.code, Some(1), "{}", answer.stderr);
    let results = read(home, "out/nightly/nightly.json");
    let outcome = |k: usize| results["scenes"][k]["outcome"].clone();
    let reason = |k: usize| outcome(k)["failed"]["reason"].as_str().unwrap_or_default().to_owned();
    assert!(reason(0).contains("wav"), "{}", reason(0));
    assert_eq!(outcome(1)["done"]["verdict"], "pass");
    assert!(reason(2).contains("more than 150 MiB"), "{}", reason(2));
    assert!(!home.join("out/nightly/scenes/large/report.json").exists());
}

#[test]
fn a_killed_nightly_continues_and_leaves_the_same_table() {
    let scenes = [("a.toml", PLATE), ("b.toml", &wide()), ("c.toml", PLATE), ("d.toml", &wide())];
    let home = home_with(&scenes);
    let home = home.path();
    assert_eq!(nightly(home, &["--out", "whole"]).code, Some(0));
    let finished = || std::fs::read_dir(home.join("parts/finished")).map_or(0, Iterator::count);
    for count in 1..scenes.len() {
        let mut killed =
            command(home, &["nightly", "scenes", "--out", "parts", "--jobs", "1"]).spawn().unwrap();
        while finished() < count && killed.try_wait().unwrap().is_none() {
            std::thread::sleep(std::time::Duration::from_millis(2));
        }
        let _ = killed.kill();
        killed.wait().unwrap();
    }
    let last = nightly(home, &["--out", "parts"]);
    assert_eq!(last.code, Some(0), "{}", last.stderr);
    assert!(last.stderr.contains("have finished already"), "{}", last.stderr);
    assert_eq!(figures(home, "parts"), figures(home, "whole"));
}

#[test]
fn shards_merged_are_as_one_machine() {
    let home = home_with(&[("a.toml", PLATE), ("b/c.toml", &wide()), ("d.toml", "[part]\n")]);
    let home = home.path();
    nightly(home, &["--out", "whole"]);
    for shard in ["1/2", "2/2"] {
        nightly(home, &["--out", &format!("far/{}", &shard[..1]), "--shard", shard]);
    }
    let merged = millstream(home, &["nightly", "--merge", "far/1", "far/2", "--out", "merged"]);
    assert_eq!(merged.code, Some(1), "{}", merged.stderr);
    assert_eq!(figures(home, "merged"), figures(home, "whole"));
    let page = read(home, "merged/nightly.json")["scenes"][0]["page"].as_str().unwrap().to_owned();
    assert!(home.join("merged").join(&page).is_file(), "{page}");
    let half = millstream(home, &["nightly", "--merge", "far/1", "--out", "half"]);
    assert_eq!(half.code, Some(2));
    assert!(half.stderr.contains("shard 2/2 is missing"), "{}", half.stderr);
}

/// A script takes sbatch's place: it runs what it is given at once.
#[test]
#[cfg(unix)]
fn slurm_runs_the_shards_and_then_their_merge() {
    use std::os::unix::fs::PermissionsExt as _;
    const SBATCH: &str = "#!/bin/sh\n\
        for last; do :; done\n\
        echo \"$*\" >>sbatch.log\n\
        case \"$*\" in\n\
          *--array=1-2*) for i in 1 2; do SLURM_ARRAY_TASK_ID=$i sh \"$last\" >&2 || exit 1; done; echo 7 ;;\n\
          *) sh \"$last\" >&2; echo '8;here' ;;\n\
        esac\n";
    let home = home_with(&[("a.toml", PLATE), ("it's b.toml", &wide()), ("bad.toml", "[part]\n")]);
    let home = home.path();
    std::fs::create_dir(home.join("bin")).unwrap();
    std::fs::write(home.join("bin/sbatch"), SBATCH).unwrap();
    std::fs::set_permissions(home.join("bin/sbatch"), std::fs::Permissions::from_mode(0o755)).unwrap();
    nightly(home, &["--out", "whole"]);
    let path = format!("{}:{}", home.join("bin").display(), std::env::var("PATH").unwrap_or_default());
    let mut submit = command(home, &["nightly", "scenes", "--out", "o ut", "--slurm", "2", "--history", "h"]);
    let answer = Answer::from(submit.env("PATH", path).output().unwrap());
    assert_eq!(answer.code, Some(0), "{}", answer.stderr);
    assert!(answer.stdout.contains("job 7 with 2 shards, and job 8"), "{}", answer.stdout);
    assert_eq!(figures(home, "o ut"), figures(home, "whole"));
    assert!(home.join("h").is_file());
    assert!(std::fs::read_to_string(home.join("sbatch.log")).unwrap().contains("--dependency=afterany:7"));
    let nowhere = command(home, &["nightly", "scenes", "--slurm", "2"]).env("PATH", "").output().unwrap();
    assert_eq!(nowhere.status.code(), Some(2));
}

#[test]
fn what_was_published_stands_beside_what_was_measured() {
    let home = home_with(&[("a.toml", PLATE)]);
    let home = home.path();
    let row =
        "[[published]]\nsource = \"Author\"\nwhat = \"passes\"\nvalue = \"20\"\nwhy = \"other plate\"\n";
    let run = format!("{row}scene = \"a\"\ntoolpath = \"zigzag\"\nfigure = \"/path/passes\"\n{row}");
    std::fs::write(home.join("published.toml"), run).unwrap();
    let answer = nightly(home, &["--out", "out", "--published", "published.toml"]);
    assert_eq!(answer.code, Some(0), "{}", answer.stderr);
    let passes = &read(home, "out/scenes/a/report.json")["toolpaths"][0]["path"]["passes"];
    let page = std::fs::read_to_string(home.join("out/published.md")).unwrap();
    assert!(
        page.contains(&format!("| a, zigzag | Author | passes | 20 | {passes} | other plate |")),
        "{page}"
    );
    assert!(page.contains("| not run | Author | passes | 20 | – | other plate |"), "{page}");
}

#[test]
fn what_a_nightly_cannot_use_is_refused_before_it_runs() {
    let home = home_with(&[("a.toml", PLATE)]);
    let home = home.path();
    std::fs::write(home.join("rules.toml"), "[[check]]\nscene = \"b\"\nengine = \"rays\"\n").unwrap();
    std::fs::write(home.join("text"), "mine\n").unwrap();
    std::fs::write(home.join("half.toml"), "[[published]]\nsource = \"Author\"\n").unwrap();
    std::fs::create_dir(home.join("others")).unwrap();
    std::fs::write(home.join("others/a.toml"), PLATE).unwrap();
    let cases: [(&[&str], &str); 6] = [
        (&["--published", "half.toml"], "`what`"),
        (&["--rules", "rules.toml"], "no scene has that name"),
        (&["--baseline", "none.json"], "cannot read none.json"),
        (&["--baseline", "text"], "no nightly.json"),
        (&["others"], "both named a"),
        (&["--merge"], "cannot read scenes/nightly.json"),
    ];
    for (arguments, words) in cases {
        let answer = nightly(home, arguments);
        assert_eq!(answer.code, Some(2), "{}", answer.stdout);
        let said = answer.stderr.replace("\n  │ ", " ");
        assert!(said.contains(words) && said.contains("help: "), "{said}");
        assert!(!home.join("out").exists());
    }
    // Files of someone else are kept.
    std::fs::create_dir_all(home.join("out/finished")).unwrap();
    std::fs::write(home.join("out/report.md"), "mine\n").unwrap();
    assert_eq!(nightly(home, &["--out", "out"]).code, Some(2));
    std::fs::remove_file(home.join("out/report.md")).unwrap();
    std::fs::write(home.join("out/finished/a.json"), "{}").unwrap();
    assert_eq!(nightly(home, &["--out", "out"]).code, Some(2));
    std::fs::remove_file(home.join("out/finished/a.json")).unwrap();
    assert_eq!(nightly(home, &["--out", "out", "--history", "text"]).code, Some(2));
    assert_eq!(std::fs::read_to_string(home.join("text")).unwrap(), "mine\n");
}
