//! The file of the history: appended to, never rewritten.

use std::fs;
use std::io::{ErrorKind, Read as _, Write as _};
use std::path::Path;

use ::nightly::{History, Night};

use crate::error::CliError;

/// Whether nights can be added to the history, before any scene has run.
///
/// # Errors
/// As [`append`].
pub fn check(path: &Path) -> Result<(), CliError> {
    match fs::metadata(path) {
        Ok(known) if known.is_file() => {
            let mut file =
                fs::OpenOptions::new().read(true).append(true).open(path).map_err(CliError::output(path))?;
            read(&mut file, path).map(drop)
        }
        Ok(_) => Err(in_the_way(path, "the history is a regular file")),
        Err(e) if e.kind() == ErrorKind::NotFound => {
            let folder = path.parent().filter(|folder| *folder != Path::new("")).unwrap_or(Path::new("."));
            fs::metadata(folder).map(drop).map_err(CliError::output(path))
        }
        Err(e) => Err(CliError::output(path)(e)),
    }
}

fn in_the_way(path: &Path, reason: &str) -> CliError {
    CliError::InTheWay { path: path.to_owned(), reason: reason.to_owned() }
}

/// The history in a file, and whether its last line is whole.
fn read(file: &mut fs::File, path: &Path) -> Result<(History, bool), CliError> {
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes).map_err(CliError::output(path))?;
    let text = String::from_utf8_lossy(&bytes);
    let history = History::parse(&text);
    if history.nights.is_empty() && history.skipped > 0 {
        return Err(in_the_way(path, "it has no line of a history"));
    }
    Ok((history, text.is_empty() || text.ends_with('\n')))
}

/// Adds a night to the history, unless it is there; leaves the whole history.
///
/// The file is locked meanwhile, so that two nightlies take turns. Where the file system knows no locks, a
/// line is still written at once and at the end. A line that a kill cut short is left as it is.
///
/// # Errors
/// [`CliError::Output`], and [`CliError::InTheWay`] where the file is something else.
pub fn append(path: &Path, night: &Night) -> Result<History, CliError> {
    let failed = CliError::output(path);
    let mut file = fs::OpenOptions::new().read(true).append(true).create(true).open(path).map_err(&failed)?;
    if !file.metadata().map_err(&failed)?.is_file() {
        return Err(in_the_way(path, "the history is a regular file"));
    }
    let _ = file.lock();
    let (mut history, is_whole) = read(&mut file, path)?;
    if !history.has(&night.id) {
        let line = night.line().ok_or_else(|| failed(std::io::Error::other("a figure is not finite")))?;
        let line = if is_whole { line } else { format!("\n{line}") };
        file.write_all(line.as_bytes()).and_then(|()| file.sync_all()).map_err(&failed)?;
        history.nights.push(night.clone());
    }
    Ok(history)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ::nightly::Results;

    fn night(id: &str) -> Night {
        Night::of(&Results::new("0.1.0", "2026-11-23T04:30:00Z".into(), None, Vec::new()), id.into())
    }

    #[test]
    fn writers_take_turns_and_no_night_is_lost() {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("history.jsonl");
        // A line that a kill cut short.
        std::fs::write(&path, night("first").line().unwrap() + "{\"id\": \"cut").unwrap();
        std::thread::scope(|scope| {
            for writer in 0..8 {
                let path = &path;
                scope.spawn(move || {
                    for k in 0..20 {
                        // Each night twice, the second time in vain.
                        append(path, &night(&format!("{writer} {}", k / 2))).unwrap();
                    }
                });
            }
        });
        let all = append(&path, &night("first")).unwrap();
        assert_eq!((all.nights.len(), all.skipped), (1 + 8 * 10, 1));
    }

    #[test]
    fn another_file_is_kept() {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("notes.txt");
        std::fs::write(&path, "mine\n").unwrap();
        assert!(matches!(append(&path, &night("a")), Err(CliError::InTheWay { .. })));
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "mine\n");
        assert!(append(home.path(), &night("a")).is_err());
        // All of it is told before hours of scenes, and nothing is made then.
        assert!(matches!(check(&path), Err(CliError::InTheWay { .. })));
        assert!(check(home.path()).is_err() && check(&home.path().join("none/history.jsonl")).is_err());
        let new = home.path().join("new.jsonl");
        assert!(check(&new).is_ok() && !new.exists());
    }
}
