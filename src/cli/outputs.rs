//! Results come into being in a folder of their own beside the target, and are moved into place
//! when all of them are there, so that nothing is ever half-written.

use std::fs;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use super::error::CliError;

/// A folder that fills up, unseen until [`Outputs::publish`].
#[derive(Debug)]
pub struct Outputs {
    target: PathBuf,
    /// Held as long as the run lives; by it later runs know that the scratch folder is in use. Closed
    /// before that folder is removed.
    _lock: fs::File,
    /// Removed with all that is left in it when the run ends, one way or the other.
    scratch: tempfile::TempDir,
    fresh: PathBuf,
    /// Dropped, and so removed, after the scratch folder in them.
    _parents: MadeFolders,
}

/// Folders that were made for the results, outermost first. Those still empty at the end go away.
#[derive(Debug)]
struct MadeFolders(Vec<PathBuf>);

impl MadeFolders {
    /// Makes a folder and its parents, as far as they are missing.
    fn make(folder: &Path) -> Result<Self, CliError> {
        let missing = folder.ancestors().take_while(|f| !f.as_os_str().is_empty() && !f.exists());
        let mut made = Self(missing.map(Path::to_owned).collect());
        made.0.reverse();
        fs::create_dir_all(folder).map_err(CliError::output(folder))?;
        Ok(made)
    }
}

impl Drop for MadeFolders {
    fn drop(&mut self) {
        for folder in self.0.iter().rev() {
            // Fails, as it should, where results are in it.
            let _ = fs::remove_dir(folder);
        }
    }
}

/// What the names of scratch folders begin with.
const SCRATCH_PREFIX: &str = ".millstream-";

/// The file in a scratch folder that its run holds locked.
const LOCK: &str = "lock";

/// Locks a scratch folder. The file gets its name once it is locked, so that none is ever found
/// unlocked while its run lives. Where the file system knows no locks it gets none, and the folder is
/// never taken for abandoned.
fn lock(scratch: &Path) -> std::io::Result<fs::File> {
    let unnamed = scratch.join("unlocked");
    let file = fs::File::create(&unnamed)?;
    if file.try_lock().is_ok() {
        fs::rename(&unnamed, scratch.join(LOCK))?;
    }
    Ok(file)
}

/// Removes scratch folders whose run was killed: the system has released their locks. What cannot be
/// opened, locked or removed stays, as does all that is not ours.
fn remove_abandoned(parent: &Path) {
    let Ok(entries) = fs::read_dir(parent) else { return };
    for entry in entries.flatten() {
        let ours = entry.file_name().to_str().is_some_and(|name| name.starts_with(SCRATCH_PREFIX));
        // The type of a link is a link: nothing is followed out of the folder.
        if !ours || !entry.file_type().is_ok_and(|kind| kind.is_dir()) {
            continue;
        }
        let Ok(lock) = fs::File::open(entry.path().join(LOCK)) else { continue };
        if lock.try_lock().is_ok() {
            drop(lock);
            let _ = fs::remove_dir_all(entry.path());
        }
    }
}

impl Outputs {
    /// Makes the scratch folder beside `target`, whose parents are made if need be.
    ///
    /// # Errors
    /// [`CliError::Output`] when that is not possible or `target` is a file.
    pub fn begin(target: &Path) -> Result<Self, CliError> {
        if target.exists() && !target.is_dir() {
            return Err(CliError::Output {
                path: target.to_owned(),
                reason: "it is a file, and a folder is needed".into(),
            });
        }
        let parent = match target.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        let parents = MadeFolders::make(parent)?;
        remove_abandoned(parent);
        let scratch = tempfile::Builder::new()
            .prefix(SCRATCH_PREFIX)
            .tempdir_in(parent)
            .map_err(CliError::output(parent))?;
        let lock = lock(scratch.path()).map_err(CliError::output(scratch.path()))?;
        // Scratch folders are closed to others; what is published must have usual permissions.
        let fresh = scratch.path().join("fresh");
        fs::create_dir(&fresh).map_err(CliError::output(&fresh))?;
        Ok(Self { target: target.to_owned(), _lock: lock, scratch, fresh, _parents: parents })
    }

    /// Makes a folder within the results.
    ///
    /// # Errors
    /// [`CliError::Output`].
    pub fn folder(&self, name: &str) -> Result<(), CliError> {
        let path = self.fresh.join(name);
        fs::create_dir_all(&path).map_err(CliError::output(&path))
    }

    /// Writes one file; `name` is relative to the results.
    ///
    /// # Errors
    /// [`CliError::Output`], also for what `body` returns.
    pub fn file<T>(
        &self,
        name: &str,
        body: impl FnOnce(&mut dyn Write) -> std::io::Result<T>,
    ) -> Result<T, CliError> {
        let path = self.target.join(name);
        let write = || {
            let mut out = BufWriter::new(fs::File::create(self.fresh.join(name))?);
            let value = body(&mut out)?;
            out.flush()?;
            Ok(value)
        };
        write().map_err(CliError::output(&path))
    }

    /// Moves everything into place: the whole folder at once when there was none, else one entry
    /// after the other, replacing those of an earlier run, `report.json` last.
    ///
    /// # Errors
    /// [`CliError::Output`].
    pub fn publish(self) -> Result<(), CliError> {
        if !self.target.exists() {
            return fs::rename(&self.fresh, &self.target).map_err(CliError::output(&self.target));
        }
        let listed: Result<Vec<fs::DirEntry>, _> = fs::read_dir(&self.fresh).and_then(Iterator::collect);
        let mut names: Vec<_> =
            listed.map_err(CliError::output(&self.fresh))?.iter().map(fs::DirEntry::file_name).collect();
        names.sort_by_key(|name| (name == "report.json", name.clone()));
        for name in names {
            let (from, to) = (self.fresh.join(&name), self.target.join(&name));
            let mut old = std::ffi::OsString::from("old-");
            old.push(&name);
            // A folder can only take the place of an empty one: move the old one out of the way.
            if to.is_dir() || (to.exists() && from.is_dir()) {
                fs::rename(&to, self.scratch.path().join(old)).map_err(CliError::output(&to))?;
            }
            fs::rename(&from, &to).map_err(CliError::output(&to))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entries(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> =
            fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    fn fill(target: &Path, text: &str) -> Outputs {
        let outputs = Outputs::begin(target).unwrap();
        outputs.folder("zigzag").unwrap();
        outputs.file("zigzag/a.txt", |out| out.write_all(text.as_bytes())).unwrap();
        outputs.file("report.json", |out| out.write_all(text.as_bytes())).unwrap();
        outputs
    }

    #[test]
    fn results_appear_all_at_once_and_replace_earlier_ones() {
        let home = tempfile::tempdir().unwrap();
        let target = home.path().join("out/wave");
        fill(&target, "first").publish().unwrap();
        assert_eq!(entries(&target), ["report.json", "zigzag"]);
        fs::write(target.join("mine.txt"), "kept").unwrap();
        fs::write(target.join("zigzag/stale.txt"), "gone").unwrap();
        fill(&target, "second").publish().unwrap();
        assert_eq!(entries(&target), ["mine.txt", "report.json", "zigzag"]);
        assert_eq!(entries(&target.join("zigzag")), ["a.txt"]);
        assert_eq!(fs::read_to_string(target.join("zigzag/a.txt")).unwrap(), "second");
        assert_eq!(entries(&home.path().join("out")), ["wave"], "no scratch is left");
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
    fn scratch_of_killed_runs_goes_and_that_of_living_ones_stays() {
        let home = tempfile::tempdir().unwrap();
        let living = fill(&home.path().join("living"), "text");
        let killed = home.path().join(".millstream-killed");
        fs::create_dir_all(killed.join("fresh/zigzag")).unwrap();
        fs::write(killed.join(LOCK), "").unwrap();
        fs::create_dir(home.path().join(".millstream-foreign")).unwrap();
        let at_work = entries(home.path()).len();
        fill(&home.path().join("next"), "text").publish().unwrap();
        assert!(!killed.exists());
        // The killed one went, the next results came.
        assert_eq!(entries(home.path()).len(), at_work);
        living.publish().unwrap();
        assert_eq!(entries(home.path()), [".millstream-foreign", "living", "next"]);
    }

    #[test]
    fn a_file_in_the_place_of_the_folder_is_refused() {
        let home = tempfile::tempdir().unwrap();
        let target = home.path().join("out");
        fs::write(&target, "").unwrap();
        assert!(matches!(Outputs::begin(&target), Err(CliError::Output { .. })));
    }
}
