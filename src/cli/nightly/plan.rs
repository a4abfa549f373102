//! Which scenes are to be run, and how: from folders, files and the rules' checks to a list of cases.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use ::nightly::{Case, ClosedForm, Published, Results, Rules, further};
use io::{digest, regular};
use keys::{SceneText, Section, printable};
use scene::{DEFAULT_MEMORY_MIB, Scene};

use super::NightlyOptions;
use crate::error::CliError;

/// A scene is a page of text; a larger file is none. Bytes.
const MAX_SCENE_BYTES: u64 = 1 << 20;

/// One run of a scene.
#[derive(Debug)]
pub struct Planned {
    /// Which scene, and how.
    pub case: Case,
    /// The scene's file.
    pub path: PathBuf,
    /// Names its folder and its record.
    pub key: String,
    /// SHA-256 of all that its figures follow from.
    pub digest: String,
    /// What it may take, MiB.
    pub memory_mib: u64,
    /// Closed forms of its figures, by their keys.
    pub exact: BTreeMap<String, ClosedForm>,
    /// What it took on an earlier night, s; the longest are started first.
    pub expected_s: f64,
}

/// All runs of a nightly, or of a shard of it.
#[derive(Debug, Default)]
pub struct Plan {
    /// In the order in which they start.
    pub cases: Vec<Planned>,
    /// Places in the toolpath of report.json that the pages need beside the figures.
    pub further: Vec<String>,
}

impl Plan {
    /// Finds the scenes and what the rules check.
    ///
    /// # Errors
    /// [`CliError`] where there is no scene, a name is not unique, or rules or published figures name a scene
    /// that is not there.
    pub fn new(
        options: &NightlyOptions,
        rules: &Rules,
        published: &[Published],
        baseline: Option<&Results>,
    ) -> Result<Self, CliError> {
        let scenes = find(&options.paths)?;
        let ours = published.iter().filter_map(|p| Some(&p.ours.as_ref()?.scene));
        let exact = rules.exact.iter().map(|e| &e.scene);
        let mut wanted = rules.checks.iter().map(|c| &c.scene).chain(exact).chain(ours);
        if let Some(missing) = wanted.find(|name| !scenes.contains_key(*name)) {
            let what =
                format!("rules or published figures name the scene {missing}, and no scene has that name");
            return Err(CliError::nightly(what, format!("the scenes are {}", listed(scenes.keys()))));
        }
        let mut cases: Vec<Case> = scenes.keys().map(|name| Case::plain(name)).collect();
        cases.extend(rules.checks.iter().cloned());
        cases.sort_by_key(Case::name);
        cases.dedup();
        unique_keys(&cases)?;
        let mine = cases.into_iter().enumerate();
        let mine = mine.filter(|(number, _)| options.shard.is_none_or(|shard| shard.takes(*number)));
        let program = program_digest()?;
        let mut cases: Vec<Planned> =
            mine.map(|(_, case)| planned(case, &scenes, rules, baseline, &program)).collect();
        cases.sort_by(|a, b| b.expected_s.total_cmp(&a.expected_s));
        let further = further(published).into_iter().map(str::to_owned).collect();
        Ok(Self { cases, further })
    }
}

fn planned(
    case: Case,
    scenes: &BTreeMap<String, PathBuf>,
    rules: &Rules,
    baseline: Option<&Results>,
    program: &str,
) -> Planned {
    let path = scenes.get(&case.scene).cloned().unwrap_or_default();
    let closed = rules.exact.iter().filter(|exact| exact.scene == case.scene && case.is_plain());
    let exact = closed.map(|exact| ("scallop_max_mm".to_owned(), exact.scallop)).collect();
    // What is wrong with a scene is found out by its own run.
    let scene = Scene::read(&path).ok();
    let memory_mib = scene.as_ref().map_or(DEFAULT_MEMORY_MIB, |scene| scene.simulation.memory_mib);
    let before = baseline.and_then(|baseline| baseline.scene(&case.name()));
    Planned {
        key: key(&case.name()),
        digest: case_digest(&case, &path, scene.as_ref(), program),
        memory_mib: u64::from(memory_mib),
        // New scenes first: nobody knows how long they take.
        expected_s: before.map_or(f64::INFINITY, |before| before.cost.wall_s),
        case,
        path,
        exact,
    }
}

/// The scenes below the folders and the files that were named, by their names.
fn find(paths: &[PathBuf]) -> Result<BTreeMap<String, PathBuf>, CliError> {
    let mut found = Vec::new();
    for path in paths {
        if path.is_dir() {
            search(path, "", &mut found)?;
        } else {
            let stem = path.file_stem().unwrap_or_default().to_string_lossy();
            found.push((printable(&stem), path.clone()));
        }
    }
    let (mut scenes, mut places) = (BTreeMap::new(), BTreeSet::new());
    for (name, path) in found {
        // The same file is one scene, however often it is named.
        if !places.insert(place(&path)) {
            continue;
        }
        if let Some(other) = scenes.insert(name.clone(), path.clone()) {
            let what = format!("{} and {} are both named {name}", other.display(), path.display());
            return Err(CliError::nightly(what, "name a folder that both are in"));
        }
    }
    if scenes.is_empty() {
        let places = listed(paths.iter().map(|path| path.to_string_lossy()));
        let what = format!("no scene is in {places}");
        return Err(CliError::nightly(
            what,
            "a scene is a .toml file with a table [part], [cutter] or [[toolpath]]",
        ));
    }
    Ok(scenes)
}

/// The same for every way to name a file. A link is a file of its own.
fn place(path: &Path) -> PathBuf {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let folder = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    path.file_name().map_or_else(|| path.to_owned(), |name| folder.join(name))
}

/// Adds the scenes of a folder. Hidden files and links to folders are left out.
fn search(folder: &Path, prefix: &str, found: &mut Vec<(String, PathBuf)>) -> Result<(), CliError> {
    let unreadable = |error: std::io::Error| {
        let what = format!("cannot read {}: {error}", folder.display());
        CliError::nightly(what, "name a folder that can be read")
    };
    let entries: Vec<fs::DirEntry> = fs::read_dir(folder).and_then(Iterator::collect).map_err(unreadable)?;
    for entry in entries {
        let (path, name) = (entry.path(), entry.file_name().to_string_lossy().into_owned());
        if name.starts_with('.') {
            continue;
        }
        if entry.file_type().map_err(unreadable)?.is_dir() {
            search(&path, &format!("{prefix}{}/", printable(&name)), found)?;
        } else if let Some(stem) = name.strip_suffix(".toml").filter(|_| is_scene(&path)) {
            found.push((prefix.to_owned() + &printable(stem), path));
        }
    }
    Ok(())
}

/// Whether a TOML file is a scene: rules and tables of blade sections are none. What cannot be read is one,
/// and so is what holds nothing, or no more than a title: its run says what is wrong.
fn is_scene(path: &Path) -> bool {
    let text = regular::read(path, MAX_SCENE_BYTES).ok().and_then(|bytes| String::from_utf8(bytes).ok());
    let Some(text) = text else { return true };
    let source = SceneText::new(path.to_string_lossy(), text);
    let Ok(table) = source.table() else { return true };
    let root = Section::root(&source, table.get_ref());
    table.get_ref().is_empty() || ["title", "part", "cutter", "toolpath"].iter().any(|key| root.has(key))
}

fn listed(names: impl Iterator<Item = impl AsRef<str>>) -> String {
    names.map(|name| name.as_ref().to_owned()).collect::<Vec<_>>().join(", ")
}

/// The name of a folder for a case: every file system has these letters.
fn key(name: &str) -> String {
    let plain = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c.to_string() } else { "_".into() };
    let text: String = name.replace('/', "--").chars().map(plain).collect();
    if text.starts_with('.') { format!("_{text}") } else { text }
}

fn unique_keys(cases: &[Case]) -> Result<(), CliError> {
    let mut keys = BTreeSet::new();
    match cases.iter().find(|case| !keys.insert(key(&case.name()))) {
        Some(case) => {
            let what = format!("two scenes would write to the folder scenes/{}", key(&case.name()));
            Err(CliError::nightly(what, "rename one of them"))
        }
        None => Ok(()),
    }
}

/// Another build of the program may have other figures, whatever its version.
fn program_digest() -> Result<String, CliError> {
    let path = super::program()?;
    Ok(digest::of_file(&path).map_err(CliError::output(&path))?.sha256)
}

fn case_digest(case: &Case, path: &Path, scene: Option<&Scene>, program: &str) -> String {
    let mut text = format!("{program}\n{}\n", case.name());
    let files =
        scene.into_iter().flat_map(Scene::files).map(|file| (file.path.as_path(), file.written.as_str()));
    for (path, name) in std::iter::once((path, "scene")).chain(files) {
        // A file that cannot be read has no figures, and what failed is run again.
        let sha256 = digest::of_file(path).map(|fingerprint| fingerprint.sha256).unwrap_or_default();
        text += &format!("{sha256}  {name}\n");
    }
    digest::of_bytes(text.as_bytes()).sha256
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A scene that was cut off to nothing, or to its title, fails instead of being left out.
    #[test]
    fn files_that_are_named_twice_are_one_scene_and_broken_ones_are_found() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::create_dir(at("more")).unwrap();
        let part = "[part]\nsurface = \"plane\"\n";
        let files = [
            ("good.toml", part),
            ("empty.toml", ""),
            ("spaces.toml", "\n# nothing\n"),
            ("title.toml", "title = \"a\"\n"),
            ("rules.toml", "[[check]]\nscene = \"good\"\n"),
            ("more/good.toml", part),
        ];
        files.iter().for_each(|(name, text)| fs::write(at(name), text).unwrap());
        let all = ["empty", "good", "more/good", "spaces", "title"];
        let again = [folder.path().to_owned(), at("good.toml"), at("more/../good.toml"), at("more")];
        let found = find(&again).unwrap();
        assert!(found.keys().eq(all), "{found:?}");
        let refused = find(&[at("good.toml"), at("more/good.toml")]).unwrap_err().to_string();
        assert!(refused.contains("both named good"), "{refused}");
    }

    /// Without running them: every row of the shipped file names a toolpath of a shipped scene, and every
    /// scene has a row.
    #[test]
    fn the_shipped_figures_of_the_sources_name_their_scenes() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/sources");
        let text = fs::read_to_string(folder.join("published.toml")).unwrap();
        let published = Published::parse("published.toml", &text).unwrap();
        let scenes = find(&[folder]).unwrap();
        let ours = || published.iter().filter_map(|one| one.ours.as_ref());
        for one in ours() {
            let scene = Scene::read(&scenes[&one.scene]).unwrap();
            for name in std::iter::once(&one.toolpath).chain(&one.over) {
                let is_there = scene.toolpaths.iter().any(|request| request.name == *name);
                assert!(is_there, "{}: {name}", one.scene);
            }
        }
        for name in scenes.keys() {
            assert!(ours().any(|one| one.scene == *name), "{name} has no row");
        }
    }
}
