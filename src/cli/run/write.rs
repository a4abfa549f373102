//! The folder of one toolpath: programs, meshes, maps, pictures, tables.

use blade::Blade;
use io::{apt_cl, ply_write, stl_write};
use job::{Machined, Outcome, Session};
use report::{FigureFile, FileContent, ToolpathPage, comb_picture, deviation_colours};
use work::monitor::{self, Monitor as _};
use work::parallel;

use super::maps;
use crate::error::CliError;
use crate::outputs::Outputs;
use crate::progress::Progress;

/// Writes all files of a toolpath; leaves what the page shows.
///
/// # Errors
/// [`CliError::Output`] and [`CliError::Interrupted`].
pub fn toolpath(
    session: &Session,
    outcome: &Outcome,
    outputs: &Outputs,
    progress: &Progress,
) -> Result<ToolpathPage, CliError> {
    monitor::check(progress)?;
    progress.start("writing results", 0);
    outputs.folder(&outcome.result.folder)?;
    let texts = || {
        programs(session, outcome, outputs)?;
        outcome.files.iter().try_for_each(|file| further(outcome, file, outputs))
    };
    let mesh = || machined(session, outcome, outputs);
    let (mesh, (page, texts)) =
        parallel::join(mesh, || parallel::join(|| maps::maps(session, outcome, outputs), texts));
    mesh?;
    texts?;
    page
}

/// Writes toolpath.cls, and toolpath.nc where there is a program.
fn programs(session: &Session, outcome: &Outcome, outputs: &Outputs) -> Result<(), CliError> {
    let Outcome { cutters, header, .. } = outcome;
    let folder = &outcome.result.folder;
    outputs
        .file(&format!("{folder}/toolpath.cls"), |out| apt_cl::write(out, &outcome.path, cutters, header))?;
    if session.has_program(outcome) {
        outputs.file(&format!("{folder}/toolpath.nc"), |out| session.write_program(out, outcome))?;
    }
    Ok(())
}

/// Writes machined.stl and machined.ply.
fn machined(session: &Session, outcome: &Outcome, outputs: &Outputs) -> Result<(), CliError> {
    let (folder, Machined { vertices, triangles, deviations, .. }) =
        (&outcome.result.folder, &outcome.machined);
    outputs.file(&format!("{folder}/machined.stl"), |out| stl_write::write(out, vertices, triangles))?;
    let colours = deviation_colours(deviations, &session.scene.tolerance);
    outputs.file(&format!("{folder}/machined.ply"), |out| {
        let vertices = ply_write::Vertices { places: vertices, colours: &colours, deviations };
        ply_write::write(out, &vertices, triangles)
    })
}

/// Writes a file that a figure has.
fn further(outcome: &Outcome, file: &FigureFile, outputs: &Outputs) -> Result<(), CliError> {
    outputs.file(&format!("{}/{}", outcome.result.folder, file.name), |out| match &file.content {
        FileContent::Text(text) => out.write_all(text.as_bytes()),
        FileContent::Mesh { vertices, triangles } => stl_write::write(out, vertices, triangles),
    })
}

/// The folder of the curvature combs.
pub const SECTIONS: &str = "sections";

/// Writes the curvature combs of a blade's sections into the folder [`SECTIONS`].
///
/// # Errors
/// [`CliError::Output`].
pub fn combs(blade: &Blade, outputs: &Outputs) -> Result<(), CliError> {
    outputs.folder(SECTIONS)?;
    let mut number = 0;
    for (k, section) in blade.sections.iter().enumerate() {
        let above = k.checked_sub(1).is_none_or(|k| blade.sections[k].height < section.height);
        number += usize::from(above);
        let title = format!("Section {number}, {}, height {} mm", section.curve, section.height);
        let picture =
            comb_picture(&title, &section.spline, section.faired.as_ref().map(|faired| &faired.spline));
        let name = format!("{SECTIONS}/{number:02}-{}.svg", section.curve.to_string().replace(' ', "-"));
        outputs.file(&name, |out| out.write_all(picture.as_bytes()))?;
    }
    Ok(())
}
