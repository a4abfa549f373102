//! The program of a toolpath for the scene's machine.

use super::error::CliError;
use super::outputs::Outputs;
use crate::io::ProgramHeader;
use crate::io::gcode::{self, FiveAxisPost, MoveLines};
use crate::io::scene::{FiveAxis, Scene};
use crate::machine::kinematics::{JointPath, follow};
use crate::toolpath::Toolpath;

/// The path in the joints of a five-axis machine, as its programs need it. The cutter, up to its holder, stays
/// within the chord tolerance of its motion between locations.
///
/// # Errors
/// [`CliError::Machine`] for tool axes that the machine cannot reach.
pub fn joints(
    scene: &Scene,
    five_axis: &FiveAxis,
    name: &str,
    path: &Toolpath,
) -> Result<JointPath, CliError> {
    let length = scene.holder.as_ref().map_or(scene.cutter.words().length, |holder| holder.cutting_length());
    let following = five_axis.post.following(scene.tolerance.chord, length.max(scene.cutter.radius()));
    follow(&five_axis.kinematics, path, &following).map_err(|e| refused(scene, name, e.to_string()))
}

/// Writes a path as G-code and tells the line of each move. A path that tilts the tool has no program, and no lines,
/// where the scene names no machine for it.
///
/// # Errors
/// [`CliError::Machine`] where the machine cannot run it, [`CliError::Output`].
pub fn write_gcode(
    scene: &Scene,
    name: &str,
    path: &Toolpath,
    header: &ProgramHeader,
    outputs: &Outputs,
    file: &str,
) -> Result<MoveLines, CliError> {
    let cutter = &scene.cutter;
    let Some(five_axis) = &scene.five_axis else {
        if !path.is_upright() {
            return Ok(MoveLines::new());
        }
        return outputs.file(file, |out| gcode::write(out, path, cutter, header));
    };
    let joints = joints(scene, five_axis, name, path)?;
    if let Some(obstacle) = joints.report.obstacle() {
        return Err(refused(scene, name, obstacle.to_string()));
    }
    let post = FiveAxisPost {
        kinematics: &five_axis.kinematics,
        joints: &joints,
        style: five_axis.post,
        rapid_rate: scene.machine.rapid_rate,
    };
    outputs.file(file, |out| gcode::write_five_axis(out, path, &post, cutter, header))
}

fn refused(scene: &Scene, name: &str, reason: String) -> CliError {
    CliError::Machine { scene: scene.source.name.clone(), name: name.to_owned(), reason }
}
