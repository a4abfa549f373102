//! Files that are either complete or not there: written beside their place, then renamed.

use std::fs::Permissions;
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// Writes a file by calling `write` with a buffered writer. The bytes go to a temporary file in the
/// same folder, which takes the name `path` only when all of them are written; on any error what
/// stood there before still stands.
///
/// # Errors
/// Any error of `write` or of the file system, with the path in front of its message.
pub fn write(path: &Path, write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    let named = |error: io::Error| io::Error::new(error.kind(), format!("{}: {error}", path.display()));
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let mut builder = tempfile::Builder::new();
    if let Some(permissions) = ordinary() {
        builder.permissions(permissions);
    }
    let file = builder.tempfile_in(folder).map_err(|error| {
        io::Error::new(error.kind(), format!("{}: cannot write into its folder: {error}", path.display()))
    })?;
    let mut writer = BufWriter::new(file);
    write(&mut writer).map_err(named)?;
    let file = writer.into_inner().map_err(|error| named(error.into_error()))?;
    file.persist(path).map_err(|error| named(error.error))?;
    Ok(())
}

/// What any other new file gets; temporary files are for their owner alone otherwise.
#[cfg(unix)]
fn ordinary() -> Option<Permissions> {
    use std::os::unix::fs::PermissionsExt;
    // Read and write for all, less the process's umask.
    Some(Permissions::from_mode(0o666))
}

/// Temporary files inherit from their folder.
#[cfg(not(unix))]
fn ordinary() -> Option<Permissions> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_written_whole_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("report.json");
        super::write(&path, |w| w.write_all(b"first")).unwrap();
        let error = super::write(&path, |w| {
            w.write_all(b"second, cut short")?;
            Err(io::Error::other("no figures"))
        });
        let message = error.unwrap_err().to_string();
        assert!(message.ends_with("report.json: no figures"), "{message}");
        assert_eq!(std::fs::read(&path).unwrap(), b"first");
        super::write(&path, |w| w.write_all(b"third")).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"third");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "nothing is left lying about");
    }

    #[test]
    fn errors_name_the_path() {
        let folder = tempfile::tempdir().unwrap();
        let nowhere = folder.path().join("missing").join("a.txt");
        let message = super::write(&nowhere, |_| Ok(())).unwrap_err().to_string();
        assert!(message.starts_with(&nowhere.display().to_string()), "{message}");
        let message = super::write(folder.path(), |_| Ok(())).unwrap_err().to_string();
        assert!(message.starts_with(&folder.path().display().to_string()), "{message}");
    }

    #[cfg(unix)]
    #[test]
    fn others_may_read_as_the_umask_allows() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let (ours, plain) = (folder.path().join("ours"), folder.path().join("plain"));
        super::write(&ours, |_| Ok(())).unwrap();
        std::fs::write(&plain, "").unwrap();
        let mode = |p: &Path| std::fs::metadata(p).unwrap().permissions().mode();
        assert_eq!(mode(&ours), mode(&plain));
    }
}
