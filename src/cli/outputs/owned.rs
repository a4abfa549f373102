//! What of a folder is ours: the list that a run leaves of its files, and the check before the next one.
//!
//! The list is millstream.sha256, which `sha256sum -c` reads too. A file that it names is ours as long as it
//! is unchanged. Whatever else stands where results go is in the way.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::io::ErrorKind;
use std::path::{Component, Path, PathBuf};
use std::time::SystemTime;

use io::{digest, regular};

use super::STAGING;
use crate::error::CliError;

/// The list of the files of a run.
pub(super) const LIST: &str = "millstream.sha256";

/// Its first line.
const HEADER: &str = "# Millstream wrote these files. The next run replaces those that are unchanged.";

/// Longest list that is read, bytes: room for ten thousand toolpaths.
const LONGEST_LIST: u64 = 16 << 20;

/// What a run is going to write and what it reads.
#[derive(Debug, Clone, Default)]
pub struct Claims {
    /// Files in the folder of the results.
    pub files: &'static [&'static str],
    /// Folders in it that hold nothing but results.
    pub folders: Vec<String>,
    /// What the run reads.
    pub inputs: Vec<PathBuf>,
}

/// A file of an earlier run, unchanged.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Owned {
    /// From the folder of the results, with slashes.
    pub(super) name: String,
    length: u64,
    modified: Option<SystemTime>,
}

impl Owned {
    fn new(name: String, found: &fs::Metadata) -> Self {
        Self { name, length: found.len(), modified: found.modified().ok() }
    }

    /// Whether nobody touched it since it was checked.
    pub(super) fn is_untouched(&self, target: &Path) -> bool {
        fs::symlink_metadata(target.join(&self.name))
            .is_ok_and(|found| found.is_file() && Self::new(self.name.clone(), &found) == *self)
    }
}

/// The text of a list.
pub(super) fn list(files: &BTreeMap<String, String>) -> String {
    let mut text = format!("{HEADER}\n");
    for (name, sha256) in files {
        writeln!(text, "{sha256}  {name}").expect("writing into a string cannot fail");
    }
    text
}

/// The names of a list and their digests; `None` where it is none of ours.
fn parse(text: &str) -> Option<BTreeMap<&str, &str>> {
    let mut lines = text.lines();
    if lines.next() != Some(HEADER) {
        return None;
    }
    lines.map(entry).collect()
}

/// The name and the digest of a line. A name that leads out of the folder is none.
fn entry(line: &str) -> Option<(&str, &str)> {
    let (sha256, name) = line.split_once("  ")?;
    let inside = Path::new(name).components().all(|part| matches!(part, Component::Normal(_)));
    (inside && !name.is_empty() && !name.starts_with(STAGING)).then_some((name, sha256))
}

fn in_the_way(path: PathBuf, reason: impl Into<String>) -> CliError {
    CliError::InTheWay { path, reason: reason.into() }
}

/// Refuses what must not be lost; leaves what of `target` is ours.
///
/// # Errors
/// [`CliError::InTheWay`] for the first thing that no earlier run wrote, or that was changed since, or that
/// this run reads. [`CliError::Output`] for what cannot be read.
pub(super) fn check(target: &Path, claims: &Claims) -> Result<Vec<Owned>, CliError> {
    let owned = owned(target)?;
    let state = State { target, owned: &owned };
    for &file in claims.files.iter().chain([&LIST]) {
        if fs::symlink_metadata(target.join(file)).is_ok() {
            state.file(file)?;
        }
    }
    claims.folders.iter().try_for_each(|folder| state.folder(folder))?;
    no_input_is_lost(target, claims, &owned)?;
    Ok(owned.into_values().flatten().collect())
}

/// The files of the list that are there; `None` for what was changed.
fn owned(target: &Path) -> Result<BTreeMap<String, Option<Owned>>, CliError> {
    let path = target.join(LIST);
    let found = match fs::symlink_metadata(&path) {
        Ok(found) => found,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(BTreeMap::new()),
        Err(error) => return Err(CliError::output(&path)(error)),
    };
    let foreign = || in_the_way(path.clone(), "it is no list of files that an earlier run left");
    if !found.is_file() {
        return Err(foreign());
    }
    let text = regular::read(&path, LONGEST_LIST).map_err(CliError::output(&path))?;
    let text = String::from_utf8(text).map_err(|_| foreign())?;
    let listed = parse(&text).ok_or_else(foreign)?;
    let mut owned = BTreeMap::from([(LIST.to_owned(), Some(Owned::new(LIST.to_owned(), &found)))]);
    for (name, sha256) in listed {
        let path = target.join(name);
        let Ok(found) = fs::symlink_metadata(&path) else { continue };
        let unchanged = found.is_file()
            && is_below(target, name)
            && digest::of_file(&path).map_err(CliError::output(&path))?.sha256 == sha256;
        owned.insert(name.to_owned(), unchanged.then(|| Owned::new(name.to_owned(), &found)));
    }
    Ok(owned)
}

/// Whether no folder on the way to a file is a link.
fn is_below(target: &Path, name: &str) -> bool {
    let folders = Path::new(name).ancestors().skip(1).filter(|folder| !folder.as_os_str().is_empty());
    folders.map(|folder| target.join(folder)).all(|f| fs::symlink_metadata(f).is_ok_and(|f| f.is_dir()))
}

/// What is known of the folder.
struct State<'a> {
    target: &'a Path,
    owned: &'a BTreeMap<String, Option<Owned>>,
}

impl State<'_> {
    /// Refuses a file that is not ours.
    fn file(&self, name: &str) -> Result<(), CliError> {
        let reason = match self.owned.get(name) {
            Some(Some(_)) => return Ok(()),
            Some(None) => "it was changed since an earlier run wrote it",
            None => "millstream.sha256 does not list it as a result of an earlier run",
        };
        Err(in_the_way(self.target.join(name), reason))
    }

    /// Refuses a folder in which anything is not ours.
    fn folder(&self, name: &str) -> Result<(), CliError> {
        let path = self.target.join(name);
        match fs::symlink_metadata(&path) {
            Err(_) => return Ok(()),
            Ok(found) if found.is_dir() => {}
            Ok(_) => return Err(in_the_way(path, "a folder is to stand there")),
        }
        let entries: std::io::Result<Vec<fs::DirEntry>> = fs::read_dir(&path).and_then(Iterator::collect);
        let mut entries = entries.map_err(CliError::output(&path))?;
        entries.sort_by_key(fs::DirEntry::file_name);
        entries.iter().try_for_each(|entry| {
            let name = format!("{name}/{}", entry.file_name().to_string_lossy());
            match entry.file_type() {
                Ok(kind) if kind.is_dir() => self.folder(&name),
                _ => self.file(&name),
            }
        })
    }
}

/// Refuses a run that would replace or remove what it reads.
fn no_input_is_lost(
    target: &Path,
    claims: &Claims,
    owned: &BTreeMap<String, Option<Owned>>,
) -> Result<(), CliError> {
    let target = fs::canonicalize(target).map_err(CliError::output(target))?;
    for input in &claims.inputs {
        // What is not there was refused when it was read.
        let Ok(path) = fs::canonicalize(input) else { continue };
        let Ok(inside) = path.strip_prefix(&target) else { continue };
        let folders = claims.folders.iter().map(String::as_str).chain([STAGING]);
        let replaced =
            claims.files.iter().copied().chain([LIST]).chain(owned.keys().map(String::as_str)).chain(folders);
        // A path begins with itself.
        if replaced.into_iter().any(|name| inside.starts_with(name)) {
            return Err(in_the_way(input.clone(), "this run reads it, and its results would replace it"));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_comes_back_and_names_nothing_outside() {
        let files = BTreeMap::from([
            ("report.json".to_owned(), "ab".repeat(32)),
            ("zigzag/a.txt".to_owned(), "cd".repeat(32)),
        ]);
        let text = list(&files);
        let read = parse(&text).unwrap();
        assert!(
            read.iter()
                .map(|(name, sha256)| (*name, *sha256))
                .eq(files.iter().map(|(name, sha256)| (name.as_str(), sha256.as_str())))
        );
        assert!(parse("").is_none() && parse(&text.replace("# M", "# m")).is_none());
        for bad in ["../a", "/etc/passwd", "a/../../b", "", ".millstream/new/a", "./a"] {
            let text = format!("{HEADER}\n{}  {bad}\n", "ab".repeat(32));
            assert!(parse(&text).is_none(), "{bad}");
        }
        assert!(parse(&format!("{HEADER}\nno list\n")).is_none());
    }
}
