//! The finished path against part and fixtures, whatever its planner thought of it.

use collision::{Check, Interference, Obstacle, Shortfall};
use cutter::Solid;
use metrology::View;
use motion::{Move, MoveKind};
use report::{Claim, Gravity, place};
use work::monitor::Monitor;

use super::more_moves;
use crate::JobError;
use crate::run::{Finding, Run};

/// That shank and holder touch neither part nor fixture, the cutter no fixture, nor the part while it is not cutting. How
/// upright tools meet the part, gouges and holder are measured by.
pub(super) fn find(run: &Run<'_>, monitor: &dyn Monitor) -> Result<Finding, JobError> {
    let leans = matches!(run.view(), View::Normals(_));
    if !leans && run.around.fixtures.is_empty() {
        return Ok(Finding::default());
    }
    monitor.start("looking for collisions", 0);
    let mut found = contacts(run, of_fixtures(run), &|_| true);
    if !leans {
        return Ok(Finding { claims: vec![clear(&found, run, "fixture")], ..Finding::default() });
    }
    let (tool, mesh_deviation) = (run.around.tool, run.around.near.mesh_deviation());
    let part = Obstacle::new(run.around.near.mesh(), run.around.near.bvh());
    let slack = -(run.scene().tolerance.gouge + mesh_deviation);
    let check = |solid, needed| Check { solid, obstacle: part, needed };
    let holder = tool.holder.iter().map(|solid| check(solid, -mesh_deviation)).collect();
    found.extend(contacts(run, holder, &|_| true));
    found.extend(contacts(run, vec![check(&tool.cutter, slack)], &|to| to.kind == MoveKind::Rapid));
    let mut claims = vec![clear(&found, run, "part or fixture")];
    claims.extend(tool.holder.as_ref().map(|holder| kept_away(run, holder)));
    Ok(Finding { claims, ..Finding::default() })
}

/// Cutter and holder against all fixtures.
fn of_fixtures<'a>(run: &Run<'a>) -> Vec<Check<'a>> {
    let solids = || std::iter::once(&run.around.tool.cutter).chain(&run.around.tool.holder);
    let of_one = |(mesh, bvh)| {
        let obstacle = Obstacle::new(mesh, bvh);
        solids().map(move |solid| Check { solid, obstacle, needed: 0.0 })
    };
    run.around.fixtures.iter().map(|(mesh, bvh)| (mesh, bvh)).flat_map(of_one).collect()
}

/// Differences of distances that the search along moves leaves open, mm.
const RESOLUTION: f64 = 2e-5;

/// That shank and holder stay as far from part and fixtures as the scene asks for.
fn kept_away(run: &Run<'_>, holder: &Solid) -> Claim {
    let (asked, off) = (run.scene().keep_clear.clearance, run.around.near.mesh_deviation());
    let part = Obstacle::new(run.around.near.mesh(), run.around.near.bvh());
    // The part itself may stand off its triangles by so much.
    let mut checks = vec![Check { solid: holder, obstacle: part, needed: asked + off }];
    let of_fixture = |(mesh, bvh)| Check { solid: holder, obstacle: Obstacle::new(mesh, bvh), needed: asked };
    checks.extend(run.around.fixtures.iter().map(|(mesh, bvh)| (mesh, bvh)).map(of_fixture));
    let found = contacts(run, checks, &|_| true);
    let missing = |hit: &Shortfall| hit.depth - if hit.check == 0 { off } else { 0.0 };
    let worst = found.iter().reduce(|a, b| if missing(&b.1) > missing(&a.1) { b } else { a });
    let claim = |missing, bound| Claim::length("clearance", Gravity::Crash, RESOLUTION, missing, bound);
    let Some((index, hit, _)) = worst else {
        return claim(0.0, 0.0).told(format!("shank and holder stay {asked:.3} mm off part and fixtures"));
    };
    let (missing, bound) = (missing(hit), if hit.check == 0 { off } else { 0.0 });
    let text = format!(
        "shank and holder miss {missing:.4} ± {bound:.4} mm of their clearance of {asked:.3} mm at {}, move {index}{}{}",
        place(hit.nearest.place.into()),
        run.program_line(*index as u32),
        more_moves(found.len())
    );
    claim(missing, bound).told(text)
}

/// What the chosen moves touch: the move, what is missing there, and what of the tool it is.
fn contacts<'a>(
    run: &Run<'_>,
    checks: Vec<Check<'a>>,
    chosen: &(dyn Fn(&Move) -> bool + Sync),
) -> Vec<(usize, Shortfall, &'static str)> {
    let name = |check: &Check| {
        if std::ptr::eq(check.solid, &run.around.tool.cutter) { "the cutter" } else { "the holder" }
    };
    let whose: Vec<&str> = checks.iter().map(name).collect();
    let keep = Interference { checks, greatest_tilt: 0.0, greatest_lift: 0.0 };
    let found = keep.on_path(run.path(), chosen);
    found.into_iter().map(|(k, hit)| (k, hit, whose[hit.check])).collect()
}

fn clear(found: &[(usize, Shortfall, &str)], run: &Run<'_>, what_not: &str) -> Claim {
    let claim = |depth| Claim::length("collision", Gravity::Crash, 0.0, depth, 0.0);
    let deepest = found.iter().reduce(|a, b| if b.1.depth > a.1.depth { b } else { a });
    let Some((index, worst, what)) = deepest else {
        return claim(0.0).told(format!("no part of the tool that does not cut touches a {what_not}"));
    };
    let at = worst.nearest.place;
    let text = format!(
        "{what} runs at least {:.3} mm into {what_not} at {}, move {index}{}{}",
        worst.depth,
        place(at.into()),
        run.program_line(*index as u32),
        more_moves(found.len())
    );
    claim(worst.depth).told(text)
}

#[cfg(test)]
mod tests {
    use crate::Session;
    use report::Verdict;
    use scene::Scene;
    use work::monitor::Silent;

    /// A clamp, as an upright wall across the plate, in its middle or beyond its end.
    #[test]
    fn an_upright_cutter_must_not_touch_a_clamp() {
        let folder = std::env::temp_dir().join(format!("millstream-clamp-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let verdict = |x: f64| {
            let facet = |corners: [[f64; 3]; 3]| {
                let vertices = corners.map(|[x, y, z]| format!("vertex {x} {y} {z}\n")).concat();
                format!("facet normal 0 0 0\nouter loop\n{vertices}endloop\nendfacet\n")
            };
            let [a, b, c, d] = [[x, -1.0, -2.0], [x, 7.0, -2.0], [x, 7.0, 0.4], [x, -1.0, 0.4]];
            let clamp = format!("solid clamp\n{}{}endsolid clamp\n", facet([a, b, c]), facet([a, c, d]));
            std::fs::write(folder.join("clamp.stl"), clamp).unwrap();
            let text = "[part]\nsurface = \"plane\"\nx = [0, 8]\ny = [0, 6]\n[cutter]\nshape = \"ball\"\ndiameter = 6\n\
                        [[fixture]]\nfile = \"clamp.stl\"\n[[toolpath]]\nstrategy = \"zigzag\"\nstepover = 0.5\n";
            let name = folder.join("plate.toml");
            let session = Session::new(Scene::parse(&name.to_string_lossy(), text).unwrap()).unwrap();
            let claims = session.toolpath(&session.scene.toolpaths[0], &Silent).unwrap().result.claims;
            claims.iter().find(|claim| claim.what == "collision").unwrap().verdict()
        };
        let verdicts = [4.0, 40.0].map(verdict);
        std::fs::remove_dir_all(&folder).unwrap();
        assert_eq!(verdicts, [Verdict::Fail, Verdict::Pass]);
    }
}
