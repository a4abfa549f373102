//! The file of the history: appended to, never rewritten.

use std::fs;
use std::io::{Read as _, Write as _};
use std::path::Path;

use ::nightly::{History, Night};

use crate::error::CliError;

/// Adds a night to the history, unless it is there; leaves the whole history.
///
/// The file is locked meanwhile, so that two nightlies take turns. Where the file system knows no locks, a line is still
/// written at once and at the end. A line that a kill cut short is left as it is.
///
/// # Errors
/// [`CliError::Output`], and [`CliError::InTheWay`] where the file is something else.
pub fn append(path: &Path, night: &Night) -> Result<History, CliError> {
    let failed = CliError::output(path);
    let mut file = fs::OpenOptions::new().read(true).append(true).create(true).open(path).map_err(&failed)?;
    let in_the_way = |reason: &str| CliError::InTheWay { path: path.to_owned(), reason: reason.to_owned() };
    if !file.metadata().map_err(&failed)?.is_file() {
        return Err(in_the_way("the history is a regular file"));
    }
    let _ = file.lock();
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes).map_err(&failed)?;
    let text = String::from_utf8_lossy(&bytes);
    let mut history = History::parse(&text);
    if history.nights.is_empty() && history.skipped > 0 {
        return Err(in_the_way("it has no line of a history"));
    }
    if !history.has(&night.id) {
        let line = night.line().ok_or_else(|| failed(std::io::Error::other("a figure is not finite")))?;
        let line = if text.is_empty() || text.ends_with('\n') { line } else { format!("\n{line}") };
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
    }
}
