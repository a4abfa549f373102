//! The program of a toolpath for the scene's machine.

use super::error::CliError;
use super::outputs::Outputs;
use io::ProgramHeader;
use io::gcode;
use io::gcode::{FiveAxisPost, MoveLines};
use machine::kinematics::{JointPath, follow};
use machine::machining_time_turning;
use motion::Toolpath;
use scene::Scene;

/// The path in the joints of the scene's five-axis machine, as its programs need it; `None` without one. The cutter, up to
/// its holder, stays within the chord tolerance of its motion between locations.
///
/// # Errors
/// [`CliError::Machine`] for tool axes that the machine cannot reach, joints beyond their limits, and rewinds at the part.
pub fn joints(scene: &Scene, name: &str, path: &Toolpath) -> Result<Option<JointPath>, CliError> {
    let Some(five_axis) = &scene.five_axis else { return Ok(None) };
    let length = scene.holder.as_ref().map_or(scene.cutter.words().length, |holder| holder.cutting_length());
    let following = five_axis.post.following(scene.tolerance.chord, length.max(scene.cutter.radius()));
    let joints =
        follow(&five_axis.kinematics, path, &following).map_err(|e| refused(scene, name, e.to_string()))?;
    match joints.report.obstacle() {
        Some(obstacle) => Err(refused(scene, name, obstacle.to_string())),
        None => Ok(Some(joints)),
    }
}

/// Time that the scene's machine takes for a path, s.
pub fn time(scene: &Scene, path: &Toolpath, joints: Option<&JointPath>) -> f64 {
    let turning = joints.zip(scene.five_axis.as_ref());
    let turning = turning
        .map_or_else(Vec::new, |(joints, machine)| joints.turning_times(&machine.kinematics, path.len()));
    machining_time_turning(path, &scene.machine, &turning)
}

/// Writes a path as G-code and tells the line of each move. A path that tilts the tool has no program, and no lines,
/// where the scene names no machine for it.
///
/// # Errors
/// [`CliError::Output`].
pub fn write_gcode(
    scene: &Scene,
    path: &Toolpath,
    joints: Option<&JointPath>,
    header: &ProgramHeader,
    outputs: &Outputs,
    file: &str,
) -> Result<MoveLines, CliError> {
    let cutter = &scene.cutter;
    let Some((five_axis, joints)) = scene.five_axis.as_ref().zip(joints) else {
        if !path.is_upright() {
            return Ok(MoveLines::new());
        }
        return outputs.file(file, |out| gcode::write(out, path, cutter, header));
    };
    let post = FiveAxisPost {
        kinematics: &five_axis.kinematics,
        joints,
        style: five_axis.post,
        rapid_rate: scene.machine.rapid_rate,
    };
    outputs.file(file, |out| gcode::write_five_axis(out, path, &post, cutter, header))
}

fn refused(scene: &Scene, name: &str, reason: String) -> CliError {
    CliError::Machine { scene: scene.source.name.clone(), name: name.to_owned(), reason }
}
