//! The machine's own bodies, and the tool on its way to the path and away from it.
//!
//! Along all joints of the program: what the head carries against part, fixtures, stock ([`uncut`]) and what
//! the table side carries; the tool against the latter; what turns on the table side against part, fixtures
//! and stock, where it does not carry them. Bodies that carry one another, or the tool, are not held against
//! each other.

use collision::{Body, LeastClearance, Obstacle};
use geometry::{Bvh, Isometry3, Point3, TriangleMesh};
use machine::kinematics::{Chain, Link, LinkMove, STRAY, Side, Waypoint, program_of_three_axes};
use report::{Claim, Gravity};
use scene::{BodyShape, MachineBody};
use work::monitor::Monitor;

use super::{PairClearance, uncut};
use crate::JobError;
use crate::run::Run;
use crate::tool::{Tool, ToolMoves};
use uncut::UncutStock;

/// What is said of a program whose joints are not known.
const UNKNOWN_JOINTS: &str = "the machine's bodies are not checked: of a program from elsewhere the joints are not known as cutter \
                              locations on a machine with rotary axes, or where it takes the tool up more than once there";

/// A body that moves, and what it is fixed to.
pub(super) struct Mover {
    name: String,
    pub link: Link,
    body: Body,
}

/// A mesh in the frame of the link that it is fixed to.
pub(super) struct Other<'a> {
    pub name: String,
    pub link: Link,
    pub obstacle: Obstacle<'a>,
    /// Its triangles stand off its true surface by up to this, mm.
    pub off: f64,
    /// The frame of the link in that of the mesh.
    pub from_link: Isometry3,
}

/// A body of the table side as a mesh.
struct BodyMesh {
    mesh: TriangleMesh,
    bvh: Bvh,
    off: f64,
}

/// The program of one tool and the links that it moves.
pub(super) struct Motion<'a> {
    pub run: &'a Run<'a>,
    /// The tool and its moves.
    tool: &'a ToolMoves<'a>,
    chain: Chain,
    program: Vec<Waypoint>,
    /// What bodies stray from what is looked at, mm.
    stray: f64,
}

/// Adds the pairs; where they cannot be looked at, what is to be said.
pub(super) fn find(
    run: &Run<'_>,
    pairs: &mut Vec<PairClearance>,
    monitor: &dyn Monitor,
) -> Result<Option<Claim>, JobError> {
    let (motions, unknown) = motions(run);
    for motion in &motions {
        with_tool(motion, pairs, monitor)?;
    }
    let unknown = unknown.filter(|_| run.scene().bodies.is_some());
    Ok(unknown.map(|text| Claim::length("collision", Gravity::Crash, 0.0, 0.0, f64::INFINITY).told(text)))
}

/// What the machine does with each tool, and of what that is not known.
fn motions<'a>(run: &'a Run<'a>) -> (Vec<Motion<'a>>, Option<String>) {
    let (scene, path) = (run.scene(), run.path());
    let motion = |tool: &'a ToolMoves<'a>, chain: Chain, program: Vec<Waypoint>| {
        let stray = if scene.five_axis.is_some() { STRAY } else { 0.0 };
        Motion { run, tool, chain, program, stray }
    };
    let read = run.request.foreign();
    let own_length = |tool: &ToolMoves<'_>| {
        let number = path.tool_of(tool.first as usize);
        number.and_then(|number| read?.gauge_lengths.get(&number).copied())
    };
    let rotary = scene.five_axis.as_ref().map(|five_axis| &five_axis.kinematics);
    match (rotary, run.planned.joints.as_ref(), run.tools, &scene.bodies) {
        (Some(kinematics), Some(joints), [tool, ..], _) => {
            let program = joints.program(kinematics, path);
            return (vec![motion(tool, Chain::of(kinematics), program)], None);
        }
        (Some(kinematics), None, [tool], Some(_)) => {
            if let Some([(_, joints)]) = read.map(|read| &read.joints[..]) {
                let own = own_length(tool).unwrap_or(kinematics.gauge_length());
                let chain = Chain::of(&kinematics.with_gauge_length(own));
                return (vec![motion(tool, chain, joints.clone())], None);
            }
        }
        (None, _, tools, Some(made)) if path.is_upright() => {
            // One tool may have the length of the machine's table instead.
            let alone = (tools.len() == 1).then(|| -made.chain.tip().z);
            let length = |tool: &ToolMoves<'_>| own_length(tool).or(alone);
            let (known, unknown): (Vec<_>, Vec<_>) = tools.iter().partition(|tool| length(tool).is_some());
            let motions = known.into_iter().filter_map(|tool| {
                let chain = Chain::three_axes(length(tool)?, made.chain.workpiece_zero());
                let program = program_of_three_axes(&tool.path, run.planned.header.rise_to, &chain);
                Some(motion(tool, chain, program))
            });
            let text = unknown.first().map(|tool| {
                format!(
                    "the machine's bodies are not checked{}: add its `gauge_length` to the table of tools",
                    run.tool_name(tool.first).replace(", ", " with ")
                )
            });
            return (motions.collect(), text);
        }
        _ => {}
    }
    (Vec::new(), Some(UNKNOWN_JOINTS.to_owned()))
}

/// Adds the pairs of one tool.
fn with_tool(
    motion: &Motion<'_>,
    pairs: &mut Vec<PairClearance>,
    monitor: &dyn Monitor,
) -> Result<(), JobError> {
    let Motion { run, chain, .. } = *motion;
    let (rotary, bodies) = (run.scene().five_axis.is_some(), run.scene().bodies.as_ref());
    let tool = Tool::new(motion.tool.cutter, motion.tool.holder);
    let solids = [("cutter", Some(tool.cutter)), ("holder", tool.holder)];
    let tools: Vec<Mover> = solids
        .into_iter()
        .filter_map(|(name, solid)| {
            let body = Body::tool(solid?, chain.tip());
            Some(Mover { name: name.to_owned(), link: chain.of_tool(), body })
        })
        .collect();
    let movers = bodies
        .into_iter()
        .flat_map(|made| &made.bodies)
        .filter_map(|body| Some(Mover { name: body.name.clone(), link: body.link, body: solid(body)? }));
    let (heads, tables): (Vec<Mover>, Vec<Mover>) =
        movers.partition(|mover| chain.side(mover.link) == Side::Head);
    let meshes: Vec<Option<BodyMesh>> = tables.iter().map(|table| body_mesh(&table.body)).collect();
    let of_table = tables.iter().zip(&meshes).filter_map(|(table, mesh)| {
        let BodyMesh { mesh, bvh, off } = mesh.as_ref()?;
        let (name, obstacle) = (table.name.clone(), Obstacle::new(mesh, bvh));
        Some(Other { name, link: table.link, obstacle, off: *off, from_link: Isometry3::identity() })
    });
    let of_table: Vec<Other<'_>> = of_table.collect();
    let of_work = on_workpiece(run, &chain);
    let stock = UncutStock::of(run);
    let of_stock = stock.iter().zip(&of_work).map(|(stock, work)| (stock, stock.beside(work))).next();
    let on_approach = |stretch: &LinkMove| stretch.approach;
    if rotary {
        for (mover, other) in tools.iter().flat_map(|mover| of_work.iter().map(move |other| (mover, other))) {
            let named = format!("{} on the approach", mover.name);
            pairs.extend(motion.pair((&named, mover), other, &on_approach, monitor)?);
        }
        for (mover, (stock, other)) in
            tools.iter().flat_map(|mover| of_stock.iter().map(move |of| (mover, of)))
        {
            let named = format!("{} on the approach", mover.name);
            pairs.extend(uncut::pair(motion, (&named, mover), (stock, other), true, monitor)?);
        }
    }
    if let Some((stock, other)) = &of_stock {
        for mover in heads.iter().chain(&tables).filter(|mover| mover.link != other.link) {
            pairs.extend(uncut::pair(motion, (&mover.name, mover), (stock, other), false, monitor)?);
        }
    }
    let against = |movers: &[Mover], others: &[Other<'_>], pairs: &mut Vec<PairClearance>| {
        for (mover, other) in movers.iter().flat_map(|mover| others.iter().map(move |other| (mover, other))) {
            if mover.link != other.link {
                pairs.extend(motion.pair((&mover.name, mover), other, &|_| true, monitor)?);
            }
        }
        Ok::<(), JobError>(())
    };
    against(&heads, &of_work, pairs)?;
    against(&heads, &of_table, pairs)?;
    against(&tools, &of_table, pairs)?;
    against(&tables, &of_work, pairs)
}

/// Part and fixtures, on the link that carries the workpiece.
fn on_workpiece<'a>(run: &Run<'a>, chain: &Chain) -> Vec<Other<'a>> {
    let link = chain.of_workpiece();
    let from_link = Isometry3::from(-chain.workpiece_zero().coords);
    let near = run.around.near;
    let part = Obstacle::new(near.mesh(), near.bvh());
    let fixtures = run.around.fixtures.iter().map(|(mesh, bvh)| (Obstacle::new(mesh, bvh), mesh.moved()));
    let files = run.session.scene.keep_clear.fixtures.iter().map(|fixture| fixture.file.written.clone());
    let named = fixtures.zip(files).map(|((obstacle, off), name)| (name, obstacle, off));
    let all = [("part".to_owned(), part, near.mesh_deviation())].into_iter().chain(named);
    all.map(|(name, obstacle, off)| Other { name, link, obstacle, off, from_link }).collect()
}

fn solid(body: &MachineBody) -> Option<Body> {
    match body.shape {
        BodyShape::Box { from, to } => Body::block(from, to),
        BodyShape::Cylinder { from, to, diameter } => Body::cylinder(from, to, diameter),
    }
}

fn body_mesh(body: &Body) -> Option<BodyMesh> {
    let (mesh, off) = body.mesh()?;
    let bvh = Bvh::new(&mesh);
    Some(BodyMesh { mesh, bvh, off })
}

impl Motion<'_> {
    /// How near a body comes to a mesh on the chosen stretches.
    fn pair(
        &self,
        (name, mover): (&str, &Mover),
        other: &Other<'_>,
        chosen: &dyn Fn(&LinkMove) -> bool,
        monitor: &dyn Monitor,
    ) -> Result<Option<PairClearance>, JobError> {
        let moves = self.moves(mover, other, chosen);
        let least = self.least(mover, other, &moves, monitor)?;
        Ok(least.map(|least| self.told(name, other, &moves, least)))
    }

    /// The chosen stretches as the other link sees them.
    pub fn moves(
        &self,
        mover: &Mover,
        other: &Other<'_>,
        chosen: &dyn Fn(&LinkMove) -> bool,
    ) -> Vec<LinkMove> {
        let (middle, reach) = (mover.body.middle(), mover.body.reach());
        let mut moves = self.chain.motion(&self.program, [mover.link, other.link], &middle, reach);
        moves.retain(chosen);
        moves
    }

    /// The least clearance on stretches; its move counts them.
    pub fn least(
        &self,
        mover: &Mover,
        other: &Other<'_>,
        moves: &[LinkMove],
        monitor: &dyn Monitor,
    ) -> Result<Option<LeastClearance>, JobError> {
        let ends = |k: usize| moves[k].ends.map(|end| other.from_link * end);
        Ok(other.obstacle.least_clearance_of_body(&mover.body, moves.len(), &ends, monitor)?)
    }

    /// Index of the tool's first move in the whole path.
    pub fn first_move(&self) -> usize {
        self.tool.first as usize
    }

    /// The pair of what was found on stretches.
    pub fn told(
        &self,
        name: &str,
        other: &Other<'_>,
        moves: &[LinkMove],
        mut least: LeastClearance,
    ) -> PairClearance {
        least.move_index = moves[least.move_index].step;
        // Places on bodies of the machine are told as the part sees them with its rotary axes at zero.
        let zero = self.chain.workpiece_zero().coords;
        if other.from_link == Isometry3::identity() {
            least.nearest.place = Point3::from(least.nearest.place.coords - zero);
        }
        let off = other.off + self.stray;
        PairClearance::of_mesh((name, other.name.clone()), &least, (self.run, self.tool.first), off, 0.0)
    }
}

#[cfg(test)]
mod tests;
