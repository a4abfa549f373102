//! Puts staged results in their place so that a kill at any instant leaves the old or the new ones, whole.
//!
//! Results are many files, and no file system replaces many files at once. It does replace one link at once,
//! and so:
//!
//! 1. `.millstream/new` holds the new results, synced. The old ones get second names in `.millstream/old`.
//! 2. The link `.millstream/current` says `old`. One after the other, each old file in the target is replaced
//!    by a link to `.millstream/current/…`, which leads to the same bytes. Each name that is new gets such a
//!    link too; it leads nowhere yet.
//! 3. `current` is replaced by a link that says `new`. In this instant all names lead to the new results, and
//!    names that are gone lead nowhere.
//! 4. Each link is replaced by the file that it leads to, links to nowhere are removed, and `.millstream`
//!    goes.
//!
//! A kill leaves `.millstream` behind. The next run sees by `current` which results hold: it undoes step 2 or
//! completes step 4, both by [`ResultsPlace::settle`], which may be killed and repeated as well. Between the
//! steps everything is synced, in this order, so that the same is true when the power fails.
//!
//! Where the file system knows no links (FAT, Windows), a file `commit` takes the place of `current`. It
//! names the old files that are to go; once it is there, the new ones are moved over the old ones, and a
//! later run completes that. A kill in between leaves no report.json (of a nightly, no nightly.json): it goes
//! first and comes last.

use std::fs;
use std::io::{Error, ErrorKind, Result};
use std::path::{Path, PathBuf};

use io::regular;

use super::STAGING;
use super::disk::Disk;

/// The folder of the new results in the staging folder.
pub(super) const NEW: &str = "new";
/// The folder of the old ones.
const OLD: &str = "old";
/// The link that says which of both hold.
const CURRENT: &str = "current";
/// A link or a file before it gets its name.
const NEXT: &str = "next";
/// The names of the old results that are to go, one a line, where there are no links.
const COMMIT: &str = "commit";
/// What no reader may find before all else is there: the figures of a run, and those of a nightly.
const LAST: [&str; 2] = ["report.json", "nightly.json"];

/// What says that a staging folder is one.
const ABOUT: &str = "about.txt";
const ABOUT_TEXT: &str = "Millstream keeps results here until all of them are complete.\n\
                          A folder that a killed run left is put in order by the next run.\n";

/// A folder of results, and how it is changed.
#[derive(Debug)]
pub(super) struct ResultsPlace {
    pub(super) target: PathBuf,
    pub(super) disk: Disk,
}

impl ResultsPlace {
    pub(super) fn staging(&self) -> PathBuf {
        self.target.join(STAGING)
    }

    fn staged(&self, name: &str) -> PathBuf {
        self.staging().join(name)
    }

    /// Makes the staging folder, which must not be there.
    pub(super) fn stage(&self) -> Result<()> {
        fs::create_dir(self.staging())?;
        fs::write(self.staged(ABOUT), ABOUT_TEXT)?;
        fs::create_dir(self.staged(NEW))
    }

    /// Whether what has the name of the staging folder is ours to remove.
    pub(super) fn is_ours(&self) -> bool {
        let Ok(found) = fs::symlink_metadata(self.staging()) else { return true };
        let about = || match regular::read(&self.staged(ABOUT), ABOUT_TEXT.len() as u64) {
            // A kill may have cut it off.
            Ok(text) => ABOUT_TEXT.as_bytes().starts_with(&text),
            Err(_) => fs::read_dir(self.staging()).is_ok_and(|mut entries| entries.next().is_none()),
        };
        found.is_dir() && about()
    }

    /// Puts the staged results in the place of `old` ones.
    pub(super) fn publish(&self, old: &[&str]) -> Result<()> {
        self.sync_tree(NEW)?;
        if self.knows_links()? {
            self.commit_by_link(old)?
        } else {
            self.commit_by_file(old)?
        }
        self.settle()
    }

    /// Steps 1 to 3.
    fn commit_by_link(&self, old: &[&str]) -> Result<()> {
        self.keep_old(old)?;
        self.disk.symlink(Path::new(OLD), &self.staged(CURRENT))?;
        self.disk.sync(&self.staging())?;
        self.link_all(old)?;
        self.disk.symlink(Path::new(NEW), &self.staged(NEXT))?;
        self.disk.rename(&self.staged(NEXT), &self.staged(CURRENT))?;
        self.disk.sync(&self.staging())
    }

    /// Tries both kinds of links.
    fn knows_links(&self) -> Result<bool> {
        let next = self.staged(NEXT);
        let made = self.disk.hard_link(&self.staged(ABOUT), &next).and_then(|()| {
            self.disk.remove_file(&next)?;
            self.disk.symlink(Path::new(ABOUT), &next)
        });
        self.disk.remove_file(&next)?;
        Ok(made.is_ok())
    }

    /// Gives the old results second names.
    fn keep_old(&self, old: &[&str]) -> Result<()> {
        self.disk.make_folders(&self.staged(OLD))?;
        for name in old {
            let kept = self.staged(OLD).join(name);
            self.disk.make_folders(&parent(&kept))?;
            self.disk.hard_link(&self.target.join(name), &kept)?;
        }
        self.sync_tree(OLD)
    }

    /// Waits until all names below a staged folder are on the disk.
    fn sync_tree(&self, name: &str) -> Result<()> {
        let root = self.staged(name);
        Tree::below(&root)?.folders.iter().try_for_each(|folder| self.disk.sync(&root.join(folder)))
    }

    /// Puts a link in the place of every old and of every new file.
    fn link_all(&self, old: &[&str]) -> Result<()> {
        for name in old {
            self.disk.symlink(&link_text(Path::new(name)), &self.staged(NEXT))?;
            self.disk.rename(&self.staged(NEXT), &self.target.join(name))?;
        }
        for name in self.added(old)? {
            let path = self.target.join(&name);
            self.disk.make_folders(&parent(&path))?;
            self.disk.symlink(&link_text(&name), &path)?;
        }
        self.sync_target()
    }

    /// The new results whose names no old one has.
    fn added(&self, old: &[&str]) -> Result<Vec<PathBuf>> {
        let mut new = Tree::below(&self.staged(NEW))?.files;
        new.retain(|name| !old.iter().any(|old| Path::new(old) == name));
        Ok(new)
    }

    /// The commit where there are no links.
    fn commit_by_file(&self, old: &[&str]) -> Result<()> {
        let mut added = self.added(old)?.into_iter();
        if let Some(taken) = added.find(|name| fs::symlink_metadata(self.target.join(name)).is_ok()) {
            let reason = format!("{} was made by someone else meanwhile", taken.display());
            return Err(Error::new(ErrorKind::AlreadyExists, reason));
        }
        let new = Tree::below(&self.staged(NEW))?.files;
        let gone = old.iter().filter(|old| !new.iter().any(|new| new == Path::new(old)));
        let gone: String = gone.flat_map(|name| [name, "\n"]).collect();
        self.disk.write(&self.staged(NEXT), &gone)?;
        self.disk.rename(&self.staged(NEXT), &self.staged(COMMIT))?;
        self.disk.sync(&self.staging())
    }

    /// Completes whatever was begun, and removes the staging folder. May be killed and repeated at any step.
    pub(super) fn settle(&self) -> Result<()> {
        if fs::symlink_metadata(self.staging()).is_err() {
            return Ok(());
        }
        match fs::read_link(self.staged(CURRENT)) {
            Ok(side) if side == Path::new(NEW) => self.resolve_links(NEW, OLD)?,
            Ok(_) => self.resolve_links(OLD, NEW)?,
            Err(_) if self.staged(COMMIT).exists() => self.move_all()?,
            Err(_) => {}
        }
        self.discard()
    }

    /// Replaces every link by the file of `side` that it leads to, and removes those to nowhere.
    fn resolve_links(&self, side: &str, other: &str) -> Result<()> {
        for name in Tree::below(&self.staged(side))?.files {
            // What is no link is the file itself already.
            if self.is_link(&name) {
                self.disk.rename(&self.staged(side).join(&name), &self.target.join(&name))?;
            }
        }
        let gone = Tree::below(&self.staged(other))?;
        for name in &gone.files {
            if self.is_link(name) {
                self.disk.remove_file(&self.target.join(name))?;
            }
        }
        self.remove_empty(gone.folders)?;
        self.sync_target()
    }

    /// Whether one of our links has this name.
    fn is_link(&self, name: &Path) -> bool {
        fs::read_link(self.target.join(name)).is_ok_and(|text| text == link_text(name))
    }

    /// Moves the new results over the old ones, [`LAST`] last, and removes what is left of the old ones.
    fn move_all(&self) -> Result<()> {
        let gone: Vec<PathBuf> =
            fs::read_to_string(self.staged(COMMIT))?.lines().map(PathBuf::from).collect();
        let mut new = Tree::below(&self.staged(NEW))?.files;
        let is_last = |name: &PathBuf| LAST.iter().any(|last| Path::new(last) == name);
        new.sort_by_key(is_last);
        if !new.is_empty() {
            LAST.iter().try_for_each(|last| {
                if new.iter().any(|name| name == Path::new(last)) {
                    self.disk.remove_file(&self.target.join(last))?;
                }
                Ok::<(), Error>(())
            })?;
        }
        for name in &gone {
            self.disk.remove_file(&self.target.join(name))?;
        }
        for name in new {
            self.disk.make_folders(&parent(&self.target.join(&name)))?;
            self.disk.rename(&self.staged(NEW).join(&name), &self.target.join(&name))?;
        }
        self.remove_empty(gone.iter().map(|name| parent(name)).collect())?;
        self.sync_target()
    }

    /// Removes folders of the target, given from it with the outermost first, as far as nothing is in them.
    fn remove_empty(&self, folders: Vec<PathBuf>) -> Result<()> {
        let mut folders = folders.into_iter().rev().filter(|folder| !folder.as_os_str().is_empty());
        folders.try_for_each(|folder| self.disk.remove_empty(&self.target.join(folder)))
    }

    /// Waits until all names in the target are on the disk.
    fn sync_target(&self) -> Result<()> {
        let mut folders = Tree::below(&self.staged(NEW))?.folders;
        folders.extend(Tree::below(&self.staged(OLD))?.folders);
        folders.sort();
        folders.dedup();
        let mut folders = folders.into_iter().map(|folder| self.target.join(folder));
        folders.try_for_each(|folder| if folder.is_dir() { self.disk.sync(&folder) } else { Ok(()) })
    }

    /// Removes the staging folder. First goes what a later run would act by, last what says whose folder it
    /// is.
    fn discard(&self) -> Result<()> {
        for name in [CURRENT, COMMIT, NEXT] {
            self.disk.remove_file(&self.staged(name))?;
        }
        self.disk.sync(&self.staging())?;
        self.disk.remove_tree(&self.staged(NEW))?;
        self.disk.remove_tree(&self.staged(OLD))?;
        self.disk.remove_file(&self.staged(ABOUT))?;
        self.disk.remove_empty(&self.staging())?;
        self.disk.sync(&self.target)
    }
}

/// What the link of a result says: up to the target, and down by `current`.
fn link_text(name: &Path) -> PathBuf {
    let up = parent(name).components().map(|_| "..").collect::<PathBuf>();
    up.join(STAGING).join(CURRENT).join(name)
}

/// The folder that something is in.
fn parent(path: &Path) -> PathBuf {
    path.parent().unwrap_or(Path::new("")).to_owned()
}

/// What is below a folder, by paths from it.
#[derive(Debug, Default)]
struct Tree {
    files: Vec<PathBuf>,
    /// The folder itself, as an empty path, and those in it; outer ones before inner ones.
    folders: Vec<PathBuf>,
}

impl Tree {
    /// Nothing is below a folder that is not there.
    fn below(root: &Path) -> Result<Self> {
        let mut tree = Self::default();
        if root.is_dir() {
            tree.add(root, PathBuf::new())?;
        }
        tree.files.sort();
        Ok(tree)
    }

    fn add(&mut self, root: &Path, folder: PathBuf) -> Result<()> {
        let entries: Vec<fs::DirEntry> = fs::read_dir(root.join(&folder))?.collect::<Result<_>>()?;
        self.folders.push(folder.clone());
        for entry in entries {
            let name = folder.join(entry.file_name());
            if entry.file_type()?.is_dir() { self.add(root, name)? } else { self.files.push(name) }
        }
        Ok(())
    }
}
