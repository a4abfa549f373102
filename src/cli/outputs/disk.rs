//! Changes of the file system, one step at a time. A test stops after any step, as a kill would.

use std::fs;
use std::io;
use std::path::Path;
#[cfg(test)]
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Where results are published.
#[derive(Debug, Default)]
pub(super) struct Disk {
    #[cfg(test)]
    pub(super) test: Stops,
}

/// What a test makes of a disk.
#[cfg(test)]
#[derive(Debug)]
pub(super) struct Stops {
    /// Steps until the process is killed.
    pub(super) left: AtomicUsize,
    /// Steps that were taken.
    pub(super) taken: AtomicUsize,
    /// A file system that knows no links.
    pub(super) without_links: AtomicBool,
}

#[cfg(test)]
impl Default for Stops {
    fn default() -> Self {
        Self {
            left: AtomicUsize::new(usize::MAX),
            taken: AtomicUsize::new(0),
            without_links: AtomicBool::new(false),
        }
    }
}

impl Disk {
    #[cfg(not(test))]
    fn step(&self) -> io::Result<()> {
        Ok(())
    }

    #[cfg(test)]
    fn step(&self) -> io::Result<()> {
        let less = |left: usize| left.checked_sub(1);
        self.test
            .left
            .fetch_update(Ordering::Relaxed, Ordering::Relaxed, less)
            .map_err(|_| io::Error::other("killed"))?;
        self.test.taken.fetch_add(1, Ordering::Relaxed);
        Ok(())
    }

    #[cfg(not(test))]
    fn knows_links(&self) -> io::Result<()> {
        Ok(())
    }

    #[cfg(test)]
    fn knows_links(&self) -> io::Result<()> {
        if self.test.without_links.load(Ordering::Relaxed) {
            return Err(io::ErrorKind::Unsupported.into());
        }
        Ok(())
    }

    /// Makes a folder and its parents; those that are there stay.
    pub(super) fn make_folders(&self, path: &Path) -> io::Result<()> {
        self.step()?;
        fs::create_dir_all(path)
    }

    /// Gives a file a second name, which must be free.
    pub(super) fn hard_link(&self, file: &Path, name: &Path) -> io::Result<()> {
        self.step()?;
        self.knows_links()?;
        fs::hard_link(file, name)
    }

    /// Makes a link that says `text`; its name must be free.
    pub(super) fn symlink(&self, text: &Path, name: &Path) -> io::Result<()> {
        self.step()?;
        self.knows_links()?;
        symlink(text, name)
    }

    /// Gives a file another name; whatever had that name is replaced in the same instant.
    pub(super) fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        self.step()?;
        fs::rename(from, to)
    }

    /// Writes a small file and waits until it is on the disk.
    pub(super) fn write(&self, path: &Path, text: &str) -> io::Result<()> {
        self.step()?;
        let mut file = fs::File::create(path)?;
        io::Write::write_all(&mut file, text.as_bytes())?;
        self.sync_file(&file)
    }

    /// Removes a file or a link; none is fine.
    pub(super) fn remove_file(&self, path: &Path) -> io::Result<()> {
        self.step()?;
        match fs::remove_file(path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
            other => other,
        }
    }

    /// Removes a folder if it is empty.
    pub(super) fn remove_empty(&self, path: &Path) -> io::Result<()> {
        self.step()?;
        match fs::remove_dir(path) {
            Err(error)
                if matches!(error.kind(), io::ErrorKind::NotFound | io::ErrorKind::DirectoryNotEmpty) =>
            {
                Ok(())
            }
            other => other,
        }
    }

    /// Removes a folder with all that is in it; none is fine.
    pub(super) fn remove_tree(&self, path: &Path) -> io::Result<()> {
        self.step()?;
        match fs::remove_dir_all(path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
            other => other,
        }
    }

    /// Waits until a new file is on the disk. No step: nobody sees it yet.
    pub(super) fn sync_file(&self, file: &fs::File) -> io::Result<()> {
        if cfg!(test) { Ok(()) } else { file.sync_all() }
    }

    /// Waits until the names in a folder are on the disk.
    pub(super) fn sync(&self, folder: &Path) -> io::Result<()> {
        self.step()?;
        sync(folder)
    }
}

#[cfg(unix)]
fn symlink(text: &Path, name: &Path) -> io::Result<()> {
    std::os::unix::fs::symlink(text, name)
}

/// Elsewhere links to files are for administrators.
#[cfg(not(unix))]
fn symlink(_: &Path, _: &Path) -> io::Result<()> {
    Err(io::ErrorKind::Unsupported.into())
}

/// No test here pulls the plug.
#[cfg(any(not(unix), test))]
fn sync(_: &Path) -> io::Result<()> {
    Ok(())
}

#[cfg(all(unix, not(test)))]
fn sync(folder: &Path) -> io::Result<()> {
    match fs::File::open(folder)?.sync_all() {
        // Some file systems have nothing to wait for.
        Err(error) if matches!(error.kind(), io::ErrorKind::InvalidInput | io::ErrorKind::Unsupported) => {
            Ok(())
        }
        other => other,
    }
}
