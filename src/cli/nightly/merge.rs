//! Puts the results of shards together.

use std::fs;
use std::path::{Component, Path, PathBuf};

use ::nightly::{Results, SceneResult};

use super::{FIGURES, read_results, with_slashes};
use crate::error::CliError;

/// The results of the shards in these folders.
///
/// # Errors
/// [`CliError::Nightly`] for a folder without them.
pub fn read(folders: &[PathBuf]) -> Result<Vec<(PathBuf, Results)>, CliError> {
    folders.iter().map(|folder| Ok((folder.clone(), read_results(&folder.join(FIGURES))?))).collect()
}

/// The results of all shards, with links from `out` to their scenes' pages.
///
/// # Errors
/// [`CliError::Nightly`] where they are not all the shards of one nightly.
pub fn merge(shards: Vec<(PathBuf, Results)>, out: &Path) -> Result<Results, CliError> {
    let moved = |(folder, mut results): (PathBuf, Results)| {
        let from_out = relative(out, &folder).map_err(CliError::output(&folder))?;
        results.scenes.iter_mut().for_each(|scene| move_page(scene, &from_out));
        Ok(results)
    };
    let shards = shards.into_iter().map(moved).collect::<Result<_, CliError>>()?;
    ::nightly::merge(shards)
        .map_err(|e| CliError::nightly(e.to_string(), "name the results of each shard of one nightly once"))
}

fn move_page(scene: &mut SceneResult, from_out: &Path) {
    if let Some(page) = &mut scene.page {
        *page = with_slashes(&from_out.join(&page));
    }
}

/// The way from one folder to another; both must be there.
fn relative(from: &Path, to: &Path) -> std::io::Result<PathBuf> {
    let (from, to) = (fs::canonicalize(from)?, fs::canonicalize(to)?);
    let common = from.components().zip(to.components()).take_while(|(a, b)| a == b).count();
    let up = from.components().skip(common).map(|_| Component::ParentDir);
    Ok(up.chain(to.components().skip(common)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_way_to_a_folder_leads_there() {
        let home = tempfile::tempdir().unwrap();
        let [from, to] = ["a/b", "a/c/d"].map(|name| home.path().join(name));
        for folder in [&from, &to] {
            fs::create_dir_all(folder).unwrap();
        }
        assert_eq!(relative(&from, &to).unwrap(), Path::new("../c/d"));
        assert_eq!(relative(&from, &from).unwrap(), Path::new(""));
        assert!(relative(&from, &home.path().join("none")).is_err());
    }
}
