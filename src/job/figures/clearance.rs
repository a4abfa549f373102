//! How near the tool comes to what it must not touch: shank and holder to the part, to fixtures and to the
//! stock that stands when they pass; the cutter to fixtures, and on rapid moves to the part; the bodies of
//! the machine ([`bodies`]).
//!
//! The finished path is looked at, whatever its planner thought of it. How deep a fed cutter cuts into the
//! part, gouges tell.

use collision::{LeastClearance, Obstacle};
use cutter::{Cutter, Solid};
use metrology::View;
use motion::{Move, MoveKind, Toolpath};
use report::{Claim, Figure, FigureTable, Gravity, Verdict, capital, place};
use serde::Serialize;
use sim::{ENGAGED, FAR, VoxelEngine, holder_clearance};
use work::monitor::Monitor;

use super::removal::{TOOLS_BEFORE, doubt};
use super::words::{more_moves, value};
use crate::JobError;
use crate::run::{Finding, Run};
use crate::tool::{Tool, ToolMoves};

mod bodies;
mod lifts;
mod uncut;

use lifts::{lifts, with_rapids};

/// Differences of distances that the search along moves leaves open, mm.
const RESOLUTION: f64 = 2e-5;

/// Rapid moves, but for those that lift the cutter out of what it has just cut: what it cut in, it may also
/// touch.
const RAPIDS: &str = "cutter on rapid moves";
const LIFTS: &str = "cutter lifting at rapid rate";

/// What would decide whether they touch the part.
const FARTHER: &str = "more distance there would decide it";

/// The stock that stands when a move comes.
const STANDING: &str = "standing stock";

/// Why a clearance is null.
const BEYOND: &str = "nothing is so near that it counts";

/// Why a line is null.
const NO_PROGRAM: &str = "the moves stand in no program";

/// Why a bound is null.
const AT_LEAST: &str = "they collide, at least so deep";
const LEFT_OPEN: &str = "the search left it open whether they are nearer";

/// Pairs in the table of the page.
const LISTED: usize = 5;

/// What the word means.
const MEANING: (&str, &str) = (
    "clearance",
    "The least distance between a part of the tool that must not cut and what it must not touch, anywhere along the path; \
     below zero they collide, at least so deep.",
);

/// How near two bodies come on a path.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct PairClearance {
    /// Which part of the tool, or which body of the machine.
    pub tool: String,
    /// What it must not touch.
    pub other: String,
    /// The least signed distance; below zero they collide, at least so deep. Null where nothing is near
    /// enough to count.
    pub clearance_mm: Option<f64>,
    /// It is less than that by no more than this; null where that is open.
    pub error_bound_mm: Option<f64>,
    /// Where on the other body.
    pub at_mm: Option<[f64; 3]>,
    /// Why one of these is null.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<&'static str>,
    /// The move on which it happens, counted from 0.
    #[serde(rename = "move")]
    pub move_index: Option<u32>,
    /// Its line in toolpath.nc, counted from 1.
    pub line: Option<u32>,
    /// The number of the tool, where the program has several.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tool_number: Option<u32>,
    /// They may come so near to each other, and no nearer.
    #[serde(skip)]
    needed: f64,
    /// Where they collide, they may be less deep than found by so much.
    #[serde(skip)]
    off: f64,
    /// What else is to be said where they collide.
    #[serde(skip)]
    more: String,
}

/// All pairs, the nearest first.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct ClearanceFigures {
    pairs: Vec<PairClearance>,
}

pub(super) fn find(run: &Run<'_>, monitor: &dyn Monitor) -> Result<Finding, JobError> {
    let mut pairs = Vec::new();
    for tool in run.tools {
        pairs.extend(with_meshes(run, tool, monitor)?);
    }
    let kept_away = kept_away(run, &pairs);
    let unchecked = bodies::find(run, &mut pairs, monitor)?;
    // What the tools before cut, as each comes.
    let mut before = run.before();
    for (k, tool) in run.tools.iter().enumerate() {
        pairs.extend(with_standing_stock(run, tool, &before, monitor)?);
        if run.tools[k + 1..].iter().any(|later| later.holder.is_some()) {
            before.push((*tool.cutter, tool.path.clone().into_owned()));
        }
    }
    if pairs.is_empty() {
        return Ok(Finding { claims: unchecked.into_iter().collect(), ..Finding::default() });
    }
    pairs.sort_by(|a, b| nearness(a).total_cmp(&nearness(b)));
    let mut claims: Vec<Claim> = pairs.iter().map(|pair| pair.claim(run)).collect();
    if run.request.foreign().is_some_and(|read| read.unknown_before) {
        let of_stock = pairs.iter().zip(&mut claims).filter(|(pair, _)| pair.other == STANDING);
        of_stock.for_each(|(_, claim)| doubt(std::slice::from_mut(claim), TOOLS_BEFORE));
    }
    claims.extend(kept_away);
    claims.extend(unchecked);
    let rows = pairs.iter().take(LISTED).map(|pair| pair.row()).collect();
    let table = FigureTable {
        title: "Nearest places",
        caption: "What the tool must not touch, and how near it comes.",
        columns: vec!["tool", "to", "clearance, mm", "at", "move", "line"],
        rows,
    };
    let sentence =
        pairs.first().map(|pair| ("Least clearance", format!("{}: {}", pair.sentence(), run.request.name)));
    let figure = Figure {
        key: "clearance",
        value: value(&ClearanceFigures { pairs })?,
        meaning: Some(MEANING),
        table: Some(table),
        sentence,
        ..Figure::default()
    };
    Ok(Finding { figure: Some(figure), claims, ..Finding::default() })
}

fn nearness(pair: &PairClearance) -> f64 {
    pair.clearance_mm.unwrap_or(f64::INFINITY)
}

/// Cutter and holder of a tool against fixtures and the part.
fn with_meshes(
    run: &Run<'_>,
    moves: &ToolMoves<'_>,
    monitor: &dyn Monitor,
) -> Result<Vec<PairClearance>, JobError> {
    let (tool, near) = (Tool::new(moves.cutter, moves.holder), run.around.near);
    let astray = |solid: &Solid| strays(&moves.path, &tool.cutter, solid);
    let mut pairs = Vec::new();
    let mut add = |name: (&str, String), solid: &Solid, obstacle: Obstacle<'_>, off: f64| {
        let least = obstacle.least_clearance(solid, &moves.path, &|_| true, monitor)?;
        let off = off + astray(solid);
        let of_mesh = |least| PairClearance::of_mesh(name, &least, (run, moves.first), off, 0.0);
        pairs.extend(least.map(of_mesh));
        Ok::<(), JobError>(())
    };
    monitor.start("looking for collisions", 0);
    let files = run.scene().keep_clear.fixtures.iter().map(|fixture| &fixture.file.written);
    for ((mesh, bvh), file) in run.around.fixtures.iter().zip(files) {
        let fixture = Obstacle::new(mesh, bvh);
        add(("cutter", file.clone()), &tool.cutter, fixture, mesh.moved())?;
        if let Some(holder) = &tool.holder {
            add(("holder", file.clone()), holder, fixture, mesh.moved())?;
        }
    }
    let (part, off) = (Obstacle::new(near.mesh(), near.bvh()), near.mesh_deviation());
    if let Some(holder) = &tool.holder {
        add(("holder", "part".into()), holder, part, off)?;
    }
    pairs.extend(rapids_with_part(run, moves, &tool.cutter, (part, off + astray(&tool.cutter)), monitor)?);
    Ok(pairs)
}

/// The cutter on rapid moves against the part, whose triangles and program are off by up to `off`; where one
/// may touch it, lifts out of what was cut by themselves.
fn rapids_with_part(
    run: &Run<'_>,
    moves: &ToolMoves<'_>,
    cutter: &Solid,
    (part, off): (Obstacle<'_>, f64),
    monitor: &dyn Monitor,
) -> Result<Vec<PairClearance>, JobError> {
    let of_path = |name: &str, path: &Toolpath, needed: f64| {
        let least = part.least_clearance(cutter, path, &|to: &Move| to.kind == MoveKind::Rapid, monitor)?;
        let of_mesh =
            |least| PairClearance::of_mesh((name, "part".into()), &least, (run, moves.first), off, needed);
        Ok::<_, JobError>(least.map(of_mesh))
    };
    let all = of_path(RAPIDS, &moves.path, -ENGAGED)?;
    let may_touch = |pair: &PairClearance| pair.claim(run).verdict() != Verdict::Pass;
    if !all.as_ref().is_some_and(may_touch) {
        return Ok(all.into_iter().collect());
    }
    let lifts = lifts(part, &Solid::of_end(moves.cutter), &moves.path, off);
    let others = with_rapids(&moves.path, |k| !lifts[k]);
    let lifts = with_rapids(&moves.path, |k| lifts[k]);
    let others = of_path(RAPIDS, &others, -ENGAGED)?;
    let lifts = of_path(LIFTS, &lifts, -run.scene().tolerance.gouge)?;
    Ok(others.into_iter().chain(lifts).collect())
}

/// How far the program may be off the moves at the upper end of a solid, mm.
fn strays(path: &Toolpath, cutter: &Solid, solid: &Solid) -> f64 {
    path.origin.strays + path.origin.leans * (solid.reach() - cutter.reach()).max(0.0)
}

/// Shank and holder of a tool against the stock that stands when they pass, less what others cut before.
fn with_standing_stock(
    run: &Run<'_>,
    tool: &ToolMoves<'_>,
    before: &[(Cutter, Toolpath)],
    monitor: &dyn Monitor,
) -> Result<Option<PairClearance>, JobError> {
    let Some(holder) = tool.holder else { return Ok(None) };
    let stock = run.session.roughed_stock();
    let found = match run.view() {
        View::Heights(_) => holder_clearance(&stock, before, tool.cutter, holder, &tool.path, monitor)?,
        View::Normals(_) => {
            let solid = Solid::of_cutter(tool.cutter, Some(holder));
            let engine = VoxelEngine::new(&stock, &solid, &tool.path).map_err(run.voxels())?;
            Some(
                engine
                    .holder_clearance(before, tool.cutter, holder, &tool.path, monitor)
                    .map_err(run.voxels())?,
            )
        }
    };
    // An upright section no wider than the cutter stands where it has been.
    let Some(found) = found else { return Ok(None) };
    let off = run.session.moved()
        + strays(&tool.path, &Solid::of_cutter(tool.cutter, Some(holder)), &Solid::of_holder(holder));
    let more = more_moves(found.collisions.len());
    let tool_number = run.path().named_tool_of(tool.first as usize);
    let pair = PairClearance { more, tool_number, ..PairClearance::new(("holder", STANDING.into())) };
    Ok(Some(match found.nearest {
        None => PairClearance { reason: Some(BEYOND), ..pair }.within(found.error_bound + off),
        Some(near) => {
            let pair = PairClearance { clearance_mm: Some(near.distance), off, ..pair };
            pair.at(run, near.at.into(), tool.first + near.move_index).within(found.error_bound + off)
        }
    }))
}

impl PairClearance {
    fn new((tool, other): (&str, String)) -> Self {
        Self { tool: tool.to_owned(), other, ..Self::default() }
    }

    /// From a mesh that stands off the true surface by up to `off`.
    fn of_mesh(
        name: (&str, String),
        least: &LeastClearance,
        (run, first): (&Run<'_>, u32),
        off: f64,
        needed: f64,
    ) -> Self {
        let clearance_mm = Some(least.nearest.distance);
        let pair = Self { clearance_mm, needed, off, ..Self::new(name) };
        let pair = pair.at(run, least.nearest.place.into(), first + least.move_index as u32);
        pair.within(least.error_bound + off)
    }

    /// With its bound. A collision without one, and a search that was left open, have none.
    fn within(self, bound: f64) -> Self {
        let collides = self.clearance_mm.is_some_and(|clearance| clearance < 0.0);
        match () {
            () if collides && (bound == 0.0 || !bound.is_finite()) => Self { reason: Some(AT_LEAST), ..self },
            () if !bound.is_finite() => Self { reason: Some(LEFT_OPEN), ..self },
            () => Self { error_bound_mm: Some(bound), ..self },
        }
    }

    fn at(self, run: &Run<'_>, at: [f64; 3], move_index: u32) -> Self {
        let line = run.path().line_of(move_index as usize);
        let reason = line.is_none().then_some(NO_PROGRAM);
        let tool_number = run.path().named_tool_of(move_index as usize);
        Self { at_mm: Some(at), move_index: Some(move_index), line, tool_number, reason, ..self }
    }

    /// That the two do not collide.
    fn claim(&self, run: &Run<'_>) -> Claim {
        let claim =
            |depth, bound| Claim::length("collision", Gravity::Crash, 0.0 - self.needed, depth, bound);
        let bound = self.error_bound_mm.unwrap_or(f64::INFINITY);
        let clearance = match self.clearance_mm {
            None => return claim(-FAR, bound).told(self.sentence()),
            Some(clearance) => clearance,
        };
        // Within what triangles stand off their surface it may be none.
        if clearance + self.off >= self.needed {
            let claim = claim(-clearance, bound).told(self.sentence());
            return if self.needed < 0.0 { Claim { decided_by: FARTHER, ..claim } } else { claim };
        }
        let index = self.move_index.unwrap_or_default();
        let text = format!(
            "{} collides with {}, at least {:.*} mm deep, at {}, move {index}{}{}",
            capital(&self.tool),
            self.other,
            decimals(clearance),
            -clearance,
            place(self.at_mm.unwrap_or_default()),
            run.program_line(index),
            self.more
        );
        // Of a collision the depth is a lower bound already, but for what triangles stand off their surface.
        claim(-clearance, self.off).told(text)
    }

    fn sentence(&self) -> String {
        match self.clearance_mm {
            Some(_) => format!("{} mm, {} to {}", self.shown(), self.named(), self.other),
            None => format!("{}, {} to {}", self.shown(), self.named(), self.other),
        }
    }

    /// The part of the tool, and of which, where there are several.
    fn named(&self) -> String {
        self.tool_number.map_or_else(|| self.tool.clone(), |number| format!("{} of tool {number}", self.tool))
    }

    /// The distance with its bound.
    fn shown(&self) -> String {
        match (self.clearance_mm, self.error_bound_mm) {
            // A bound that is not zero never reads as zero.
            (Some(clearance), Some(bound)) => {
                let (digits, unit) = (decimals(clearance), 10f64.powi(decimals(clearance) as i32));
                format!("{clearance:.digits$} ± {:.digits$}", (unit * bound - 1e-9).ceil() / unit)
            }
            (Some(clearance), None) => format!("{clearance:.*}, or less", decimals(clearance)),
            (None, Some(bound)) if bound < FAR => format!("over {:.3} mm", FAR - bound),
            (None, _) => "open".to_owned(),
        }
    }

    /// As the table of the page has it.
    fn row(&self) -> Vec<String> {
        let number = |n: Option<u32>| n.map_or_else(|| "-".to_owned(), |n| n.to_string());
        vec![
            self.named(),
            self.other.clone(),
            self.shown(),
            self.at_mm.map_or_else(|| "-".to_owned(), place),
            number(self.move_index),
            number(self.line),
        ]
    }
}

/// Decimals of a length in mm: three, and of a collision as many more as show that it is one.
fn decimals(clearance: f64) -> usize {
    const MOST: usize = 9;
    let shows = |digits: &usize| -clearance >= 0.5 * 0.1f64.powi(*digits as i32);
    if clearance < 0.0 { (3..MOST).find(shows).unwrap_or(MOST) } else { 3 }
}

/// That shank and holder stay as far from part and fixtures as the scene asks for.
fn kept_away(run: &Run<'_>, pairs: &[PairClearance]) -> Option<Claim> {
    let asked = run.scene().keep_clear.clearance;
    let held = pairs.iter().filter(|pair| pair.tool == "holder");
    let least = held.reduce(|a, b| if nearness(b) < nearness(a) { b } else { a })?;
    let clearance = least.clearance_mm?;
    let claim = |missing: f64, bound| Claim::length("clearance", Gravity::Crash, RESOLUTION, missing, bound);
    let bound = least.error_bound_mm.unwrap_or(f64::INFINITY);
    if clearance >= asked {
        let text = format!("shank and holder stay {asked:.3} mm off part and fixtures");
        return Some(claim(asked - clearance, bound).told(text));
    }
    let index = least.move_index.unwrap_or_default();
    let text = format!(
        "shank and holder come within {} mm of {}, {:.4} mm less than their clearance of {asked:.3} mm, at {}, move {index}{}",
        least.shown(),
        least.other,
        asked - clearance,
        place(least.at_mm.unwrap_or_default()),
        run.program_line(index)
    );
    Some(claim(asked - clearance, bound).told(text))
}

#[cfg(test)]
mod astray;
#[cfg(test)]
mod links;
#[cfg(test)]
mod planted;
#[cfg(test)]
mod tests;
