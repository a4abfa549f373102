//! From a checked scene back to TOML with every default written out.

use std::fmt::{self, Write as _};

use super::read::{ALLOWANCE, BLENDINGS, BOUNDARY, PREVIOUS_STOCK, REST, SLOPE, STEPDOWN};
use super::{
    Scene, Simulation, ToolpathRequest, axis, bodies, compare, interference, kinematics, part, stock,
};
use keys::{toml_number as number, toml_points, toml_string as text, word_of};
use toolpath::{Links, PartKind, Step, longest_link};

/// The whole scene as TOML, every default in effect included. Reading it gives the same scene
/// again; relative paths still start from the scene's folder.
pub fn complete_toml(scene: &Scene) -> String {
    let mut out = String::new();
    write_all(&mut out, scene).expect("writing into a string cannot fail");
    out
}

fn write_all(out: &mut String, scene: &Scene) -> fmt::Result {
    writeln!(out, "title = {}\n", text(&scene.title))?;
    part::write(out, &scene.part, scene.judged)?;
    stock::write(out, &scene.stock, scene.stock_is_stated)?;
    scene.tooling.write(out, "")?;
    write_tolerance(out, scene)?;
    write_simulation(out, &scene.simulation)?;
    write_machine(out, scene)?;
    if !scene.keep_clear.fixtures.is_empty() || scene.toolpaths.iter().any(|request| request.axis.is_some()) {
        interference::write(out, &scene.keep_clear)?;
    }
    compare::write(out, &scene.toolpaths)?;
    let mut written = scene.toolpaths.iter().filter(|request| compare::is_first(request, &scene.toolpaths));
    written.try_for_each(|request| write_toolpath(out, request, scene))
}

fn write_tolerance(out: &mut String, scene: &Scene) -> fmt::Result {
    let (limits, rule) = (&scene.tolerance, &scene.scallop_rule);
    writeln!(out, "\n[tolerance]  # mm")?;
    writeln!(out, "scallop = {}  # planned for, and the limit of ridges", number(limits.scallop))?;
    writeln!(out, "scallop_share = {}  # of the ridge length, must not exceed it", number(rule.share))?;
    writeln!(out, "scallop_highest = {}  # times it, no ridge may exceed", number(rule.highest))?;
    writeln!(out, "gouge = {}", number(limits.gouge))?;
    writeln!(out, "uncut = {}", number(limits.uncut))?;
    writeln!(out, "chord = {}", number(limits.chord))?;
    if let Some(angle) = scene.off_direction {
        writeln!(out, "direction = {}  # degrees off the feed directions", number(angle.to_degrees()))?;
    }
    Ok(())
}

fn write_simulation(out: &mut String, simulation: &Simulation) -> fmt::Result {
    writeln!(out, "\n[simulation]")?;
    writeln!(out, "cell = {}  # mm", number(simulation.cell))?;
    writeln!(out, "memory_mib = {}", simulation.memory_mib)?;
    writeln!(out, "engine = {}", text(simulation.engine.word()))?;
    writeln!(out, "removal = {}  # what each move removes, and rapids in stock", simulation.removal)?;
    let bound = number(simulation.error_bound);
    writeln!(
        out,
        "error_bound = {bound}  # mm, asked of the highest scallop, deepest gouge and highest uncut place"
    )?;
    if let Some(voxel) = simulation.voxel {
        writeln!(out, "voxel = {}  # mm, of the solid that is left, in solid.stl", number(voxel))?;
    }
    Ok(())
}

fn write_machine(out: &mut String, scene: &Scene) -> fmt::Result {
    let machine = &scene.machine;
    writeln!(out, "\n[machine]")?;
    writeln!(out, "rapid_rate = {}  # mm/min", number(machine.rapid_rate))?;
    writeln!(out, "acceleration = {}  # mm/s2", number(machine.acceleration))?;
    let deviation = number(machine.junction_deviation);
    writeln!(out, "junction_deviation = {deviation}  # mm by which the control rounds corners")?;
    writeln!(out, "jerk = {}  # mm/s3", number(machine.jerk))?;
    writeln!(out, "block_rate = {}  # lines of a program a second", number(machine.block_rate))?;
    let own = [
        ("rates", machine.rates, "mm/min"),
        ("accelerations", machine.accelerations, "mm/s2"),
        ("jerks", machine.jerks, "mm/s3"),
    ];
    for (key, limits, unit) in own {
        if limits.iter().all(|limit| limit.is_finite()) {
            let [x, y, z] = limits.map(number);
            writeln!(out, "{key} = [{x}, {y}, {z}]  # {unit} of X, Y and Z")?;
        }
    }
    if scene.five_axis.is_none() {
        let blending = text(word_of(&BLENDINGS, &machine.blending));
        writeln!(out, "blending = {blending}  # how acceleration is shared where corners are rounded")?;
    }
    writeln!(out, "slow_corners = {}  # feeds of sharp bends in the program", machine.slow_corners)?;
    writeln!(out, "clearance = {}  # mm of rapid moves above stock", number(scene.clearance))?;
    if let Some(arcs) = scene.arcs {
        writeln!(out, "arcs = {}  # mm, G2 and G3 where they stay so near to the moves", number(arcs))?;
    }
    bodies::write_places(out, scene)?;
    kinematics::write(out, scene.five_axis.as_ref())?;
    bodies::write(out, scene)
}

fn write_toolpath(out: &mut String, request: &ToolpathRequest, scene: &Scene) -> fmt::Result {
    let part = request.strategy.definition().part;
    writeln!(out, "\n[[toolpath]]")?;
    let name = request.equal_time.as_ref().map_or(&request.name, |time| &time.of);
    writeln!(out, "name = {}", text(name))?;
    writeln!(out, "strategy = {}", text(request.strategy_name()))?;
    request.strategy.write(out)?;
    if request.stock_is_previous {
        writeln!(out, "stock = {}  # what the toolpath before left", text(PREVIOUS_STOCK))?;
    }
    if part == PartKind::Any {
        return Ok(());
    }
    match request.step {
        Step::Scallop(_) if request.equal_time.is_some() => {}
        Step::Scallop(height) => {
            writeln!(out, "scallop = {}  # mm, steps are planned for it", number(height))?;
        }
        Step::Stepover(width) => writeln!(out, "stepover = {}  # mm", number(width))?,
    }
    if request.axis.is_none() && part == PartKind::Surface {
        let [from, to] = request.slope.map(number);
        writeln!(
            out,
            "{SLOPE} = [{from}, {to}]  # degrees from the level, of the faces that it is made for"
        )?;
    }
    if let Some(stepdown) = request.stepdown {
        writeln!(out, "{STEPDOWN} = {}  # mm from level to level at most", number(stepdown))?;
    }
    if request.allowance > 0.0 {
        writeln!(out, "{ALLOWANCE} = {}  # mm left on the part", number(request.allowance))?;
    }
    if let Some(boundary) = &request.boundary {
        let curves: Vec<String> = boundary.curves().map(toml_points).collect();
        writeln!(out, "{BOUNDARY} = [{}]  # mm, of the tool axis", curves.join(", "))?;
    }
    if request.rest {
        writeln!(out, "{REST} = true  # where the toolpaths before it left too much")?;
    }
    write_joining(out, request)?;
    if request.tooling == scene.tooling { Ok(()) } else { request.tooling.write(out, "toolpath.") }
}

fn write_joining(out: &mut String, request: &ToolpathRequest) -> fmt::Result {
    if request.strategy.definition().part == PartKind::Pocket {
        return Ok(());
    }
    if request.equal_time.is_none() {
        writeln!(out, "correct = {}  # by what is measured of a plan", request.correct)?;
    }
    let joining = &request.joining;
    match joining.links {
        Links::Surface => {
            writeln!(out, "links = \"surface\"  # where that is quicker than \"retract\"")?;
            let longest = number(longest_link(joining, &request.tooling.cutter, request.step));
            match joining.longest_link {
                Some(_) => writeln!(out, "longest_link = {longest}  # mm")?,
                None => writeln!(out, "longest_link = \"auto\"  # {longest} mm")?,
            }
        }
        Links::Retract => writeln!(out, "links = \"retract\"")?,
    }
    writeln!(
        out,
        "smoothing = {}  # of the points of a pass, within the chord tolerance",
        joining.smoothing
    )?;
    axis::write(out, request.axis.as_ref())
}
