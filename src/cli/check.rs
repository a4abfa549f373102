//! `millstream check`: reads and validates a scene and its part, and shows every default in effect.

use std::path::Path;

use super::error::{CliError, shown};
use super::progress::Progress;
use job::Session;
use scene::{Scene, complete_toml, printable};

/// What `check` prints: the complete scene, which can be run again, after what was found in
/// comments.
///
/// # Errors
/// [`CliError`] when the scene could not be run.
pub fn check(path: &Path, progress: &Progress) -> Result<String, CliError> {
    let scene = Scene::read(path)?;
    progress.watched().allow_memory(scene.simulation.memory_mib, work::parallel::threads());
    let session = Session::load(scene, progress)?;
    let beside = session.boundaries_beside_part();
    let Session { mut scene, part, cells: (grid, note), notes, doubt, .. } = session;
    scene.simulation.cell = grid.cell;
    let (bounds, size) = (part.bounds(), part.bounds().size());
    let mut found = vec![format!("{} is valid. Every default in effect:", shown(path))];
    found.push(format!(
        "The part spans {:.3} x {:.3} x {:.3} mm from x {:.3} y {:.3} z {:.3}; {} x {} cells are simulated.",
        size.x, size.y, size.z, bounds.min.x, bounds.min.y, bounds.min.z, grid.nx, grid.ny
    ));
    if scene.simulation.cell_is_auto {
        found.push(
            "Note: the cell is chosen by the program, from the cutter and the steps of the toolpaths".into(),
        );
    }
    found
        .extend(notes.into_iter().chain(note).chain(doubt).chain(beside).map(|note| format!("Note: {note}")));
    let mut text = String::new();
    for line in found {
        // A line break in a file's name would end the comment.
        text += &format!("# {}\n", printable(&line));
    }
    text.push('\n');
    text += &complete_toml(&scene);
    Ok(text)
}
