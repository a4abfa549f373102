//! The files of a run: checked before it, gathered during it, and put in their place when all of them are
//! there.
//!
//! [`Outputs::begin`] refuses a folder in which anything stands in the way that is not ours. The results
//! gather in a staging folder within the target, so that a target on another file system is no matter.
//! [`Outputs::publish`] puts them in their place so that a kill leaves the old or the new ones. Two runs
//! never write to one folder: each locks it.

mod disk;
mod owned;
mod publish;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::fs;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use io::digest::Hashing;

use super::error::CliError;
use disk::Disk;
pub use owned::Claims;
use owned::Owned;
use publish::{NEW, ResultsPlace};

/// The staging folder's name in the target.
const STAGING: &str = ".millstream";

/// A folder that fills up, unseen until [`Outputs::publish`].
#[derive(Debug)]
pub struct Outputs {
    place: ResultsPlace,
    /// The files of an earlier run, which are to be replaced.
    old: Vec<Owned>,
    /// SHA-256 of each new file.
    digests: Mutex<BTreeMap<String, String>>,
    /// The target, locked as long as the run lives.
    _lock: Option<FolderLock>,
    /// Dropped, and so removed, after the staging folder in them.
    _made: MadeFolders,
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

    /// Waits until their names are on the disk.
    fn sync(&self, disk: &Disk) -> std::io::Result<()> {
        let parent = |folder: &PathBuf| match folder.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent.to_owned(),
            _ => PathBuf::from("."),
        };
        self.0.iter().try_for_each(|folder| disk.sync(&parent(folder)))
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

fn refused(path: &Path, reason: &str) -> CliError {
    CliError::Output { path: path.to_owned(), reason: reason.to_owned() }
}

/// A folder that no other run writes to.
#[derive(Debug)]
struct FolderLock(fs::File);

impl Drop for FolderLock {
    /// Closing the file is not enough: a process that another thread starts at this moment has a copy of it
    /// for an instant.
    fn drop(&mut self) {
        let _ = self.0.unlock();
    }
}

/// Locks a folder; `None` where the file system knows no locks. The system releases the lock of a killed run.
fn lock(target: &Path) -> Result<Option<FolderLock>, CliError> {
    let Ok(folder) = fs::File::open(target) else { return Ok(None) };
    match folder.try_lock() {
        Ok(()) => Ok(Some(FolderLock(folder))),
        Err(fs::TryLockError::WouldBlock) => Err(refused(target, "another run is writing to it")),
        Err(fs::TryLockError::Error(_)) => Ok(None),
    }
}

/// Waits until no run writes to a folder, but not for long: a run whose nightly was killed ends by itself.
pub fn wait_until_free(target: &Path) {
    const TIMES: usize = 100;
    const PAUSE: std::time::Duration = std::time::Duration::from_millis(50);
    for _ in 0..TIMES {
        if lock(target).is_ok() {
            return;
        }
        std::thread::sleep(PAUSE);
    }
}

impl Outputs {
    /// Makes `target` and its parents if need be, puts in order what a killed run left there, and makes the
    /// staging folder.
    ///
    /// # Errors
    /// [`CliError::InTheWay`] when the results would replace anything but those of an earlier run, and
    /// [`CliError::Output`] when the folder cannot be used.
    pub fn begin(target: &Path, claims: &Claims) -> Result<Self, CliError> {
        Self::begin_on(Disk::default(), target, claims)
    }

    fn begin_on(disk: Disk, target: &Path, claims: &Claims) -> Result<Self, CliError> {
        if target.exists() && !target.is_dir() {
            return Err(refused(target, "it is a file, and a folder is needed"));
        }
        let made = MadeFolders::make(target)?;
        if fs::canonicalize(target).is_ok_and(|path| path.parent().is_none()) {
            return Err(refused(target, "it is the root of the file system"));
        }
        let lock = lock(target)?;
        let place = ResultsPlace { target: target.to_owned(), disk };
        put_in_order(&place, lock.is_some())?;
        let old = owned::check(target, claims)?;
        place.stage().map_err(CliError::output(target))?;
        Ok(Self { place, old, digests: Mutex::default(), _lock: lock, _made: made })
    }

    /// Removes, from any thread, what a run would leave that ends now. What is still written meanwhile may stay for
    /// the next run.
    pub fn discarding(&self) -> impl FnOnce() + Send + use<> {
        /// Files that others write may keep a folder from being removed.
        const TIMES: usize = 3;
        let place = ResultsPlace { target: self.place.target.clone(), disk: Disk::default() };
        let made = self._made.0.clone();
        move || {
            let _ = (0..TIMES).any(|_| place.settle().is_ok());
            drop(MadeFolders(made));
        }
    }

    fn staged(&self, name: &str) -> PathBuf {
        self.place.staging().join(NEW).join(name)
    }

    /// Makes a folder within the results.
    ///
    /// # Errors
    /// [`CliError::Output`].
    pub fn folder(&self, name: &str) -> Result<(), CliError> {
        let path = self.staged(name);
        fs::create_dir_all(&path).map_err(CliError::output(&path))
    }

    /// Writes one file; `name` is relative to the results, with slashes.
    ///
    /// # Errors
    /// [`CliError::Output`], also for what `body` returns.
    pub fn file<T>(
        &self,
        name: &str,
        body: impl FnOnce(&mut dyn Write) -> std::io::Result<T>,
    ) -> Result<T, CliError> {
        let path = self.place.target.join(name);
        let write = || {
            let mut out = BufWriter::new(Hashing::new(fs::File::create(self.staged(name))?));
            let value = body(&mut out)?;
            let (file, fingerprint) = out.into_inner().map_err(std::io::IntoInnerError::into_error)?.finish();
            self.place.disk.sync_file(&file)?;
            let mut digests = self.digests.lock().unwrap_or_else(PoisonError::into_inner);
            digests.insert(name.to_owned(), fingerprint.sha256);
            Ok(value)
        };
        write().map_err(CliError::output(&path))
    }

    /// Puts everything in its place, and removes what an earlier run left.
    ///
    /// # Errors
    /// [`CliError::Output`]; the old results hold then, or the new ones do.
    pub fn publish(self) -> Result<(), CliError> {
        let target = &self.place.target;
        if let Some(touched) = self.old.iter().find(|file| !file.is_untouched(target)) {
            let path = target.join(&touched.name);
            return Err(refused(&path, "it was changed during the run"));
        }
        let list = owned::list(&self.digests.lock().unwrap_or_else(PoisonError::into_inner));
        self.file(owned::LIST, |out| out.write_all(list.as_bytes()))?;
        let old: Vec<&str> = self.old.iter().map(|file| file.name.as_str()).collect();
        let published = self._made.sync(&self.place.disk).and_then(|()| self.place.publish(&old));
        published.map_err(CliError::output(target))
    }
}

impl Drop for Outputs {
    fn drop(&mut self) {
        // What fails here is put in order by the next run.
        let _ = self.place.settle();
    }
}

/// Completes or undoes what a killed run was about to publish, and removes its staging folder.
fn put_in_order(place: &ResultsPlace, locked: bool) -> Result<(), CliError> {
    let staging = place.staging();
    if fs::symlink_metadata(&staging).is_err() {
        return Ok(());
    }
    let in_the_way = |reason: &str| CliError::InTheWay { path: staging.clone(), reason: reason.to_owned() };
    if !place.is_ours() {
        return Err(in_the_way("no run made it"));
    }
    if !locked {
        return Err(in_the_way("another run is writing to its folder, or was killed"));
    }
    place.settle().map_err(CliError::output(&staging))
}
