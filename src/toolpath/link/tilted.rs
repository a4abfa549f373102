//! Joins the passes of a tilted cutter into one program.
//!
//! Enters: passes as touches of the cutter, mm. Leaves: a program that feeds along every pass from one end to
//! the other. Between two passes the cutter retreats along its own axis, which frees it whatever it leans
//! against, and goes over at rapid rate: straight where that is free, else around a sphere that holds part
//! and stock, on which every place of the cutter is outside while its axis points away from the middle.
//! Where the tool is to keep away from something, passes are repaired first, and what it comes too near to in between is
//! noted.

use super::super::interference::{Repaired, repair};
use super::super::tilted::{TiltedPasses, Tilting, Touch, limit_turning, reversed, thinned};
use super::super::{ClPoint, Interference, Move, MoveKind, PlanError, PlanSettings, RepairSummary, Toolpath};
use super::order::{Visit, is_closed, order};
use super::{Links, Rates, longest_link};
use crate::cutter::Cutter;
use crate::geometry::{Point3, Vector3};
use crate::monitor::{self, Monitor};
use crate::part::Part;

/// The way around the sphere is divided into turns of this angle, rad, and the sphere is as much larger as its chords cut
/// off: `1/cos` of half of it.
const SPHERE_STEP: f64 = 0.15;

/// Joins passes; see the module.
///
/// # Errors
/// [`PlanError::Axis`] where the rule gives no axis for a pass fed the other way round, or cancelled.
pub fn join_tilted(
    passes: TiltedPasses,
    both_ways: bool,
    part: &Part,
    cutter: &Cutter,
    tilting: &Tilting,
    settings: &PlanSettings,
    notes: &mut Vec<String>,
    monitor: &dyn Monitor,
) -> Result<Toolpath, PlanError> {
    let TiltedPasses { passes, tolerance } = passes;
    let passes: Vec<Vec<Touch>> = passes.into_iter().filter(|p| p.len() >= 2).collect();
    monitor.start("joining passes", 0);
    let contacts: Vec<Vec<Point3>> =
        passes.iter().map(|pass| pass.iter().map(|touch| touch.contact.point).collect()).collect();
    let rates = Rates::of(settings, &contacts);
    let longest = match settings.joining.links {
        Links::Surface => longest_link(&settings.joining, cutter, settings.step),
        Links::Retract => 0.0,
    };
    let visits = order(&contacts, both_ways, &|distance| rates.between(distance, longest));
    monitor::check(monitor)?;
    let turned = crate::parallel::try_map(visits.len(), |k| {
        let mut pass =
            visited(&passes[visits[k].pass], &contacts[visits[k].pass], &visits[k], cutter, tilting)?;
        let even = tilting.most_turning.is_none_or(|rate| limit_turning(&mut pass, cutter, rate));
        let keep = tilting.interference;
        let Repaired { passes, summary } = match keep {
            Some(keep) => repair(&pass, cutter, keep, tilting.most_turning, monitor)?,
            None => Repaired { passes: vec![pass], summary: RepairSummary::default() },
        };
        let long = passes.iter().filter(|pass| pass.len() >= 2);
        let thin = long.map(|pass| thinned(pass, tolerance, keep, monitor)).collect::<Result<Vec<_>, _>>()?;
        Ok::<_, PlanError>((thin, summary, even))
    })?;
    let uneven = turned.iter().filter(|(_, _, even)| !even).count();
    if uneven > 0 {
        notes.push(format!(
            "on {uneven} passes the axis turns faster than asked: they are too short for their turns"
        ));
    }
    let mut program =
        Program { settings, sphere: Sphere::around(part, settings), start: None, moves: Vec::new() };
    let mut summary = RepairSummary::default();
    turned.iter().for_each(|(_, one, _)| summary.add(one));
    notes.extend(summary.notes());
    for (k, pass) in turned.iter().flat_map(|(passes, ..)| passes).enumerate() {
        monitor::check(monitor)?;
        program.reach(k as u32, &pass[0]);
        pass[1..].iter().for_each(|to| program.push(*to, MoveKind::Cut, settings.feed_rate, k as u32));
    }
    let path = program.finish();
    notes.extend(tilting.interference.and_then(|keep| too_near_between(keep, &path)));
    Ok(path)
}

/// What the tool comes too near to between passes, in words.
fn too_near_between(keep: &Interference, path: &Toolpath) -> Option<String> {
    let found = keep.on_path(path, |to| !to.kind.is_on_surface());
    let (_, worst) = found.iter().max_by(|a, b| a.1.depth.total_cmp(&b.1.depth))?;
    let p = worst.nearest.place;
    Some(format!(
        "{} moves between passes come nearer to part or fixtures than asked; {:.3} mm are missing at ({:.3}, {:.3}, {:.3}): \
         lean the tool otherwise there, or clear the way",
        found.len(),
        worst.depth,
        p.x,
        p.y,
        p.z
    ))
}

/// A pass as it is visited.
fn visited(
    pass: &[Touch],
    contacts: &[Point3],
    visit: &Visit,
    cutter: &Cutter,
    tilting: &Tilting,
) -> Result<Vec<Touch>, PlanError> {
    if is_closed(contacts) {
        let mut pass = pass[..pass.len() - 1].to_vec();
        pass.rotate_left(visit.start);
        pass.push(pass[0]);
        return Ok(pass);
    }
    if !visit.reversed {
        return Ok(pass.to_vec());
    }
    if tilting.axis.follows_feed() {
        return Ok(reversed(pass, cutter, tilting.axis)?);
    }
    Ok(pass.iter().rev().map(Touch::fed_back).collect())
}

/// A sphere that holds part and stock.
struct Sphere {
    centre: Point3,
    radius: f64,
}

impl Sphere {
    fn around(part: &Part, settings: &PlanSettings) -> Self {
        let bounds = part.bounds();
        let top = settings.stock_top.max(bounds.max.z);
        let (low, high) = (bounds.min, Point3::new(bounds.max.x, bounds.max.y, top));
        let least = 0.5 * (high - low).norm() + settings.clearance;
        Self { centre: nalgebra::center(&low, &high), radius: least / (0.5 * SPHERE_STEP).cos() }
    }

    /// Where a cutter that retreats along its axis leaves the sphere.
    fn exit(&self, from: &ClPoint) -> ClPoint {
        let (off, axis) = (from.tip - self.centre, from.axis);
        let along = off.dot(&axis);
        let inside = along * along - off.norm_squared() + self.radius * self.radius;
        let way = if inside > 0.0 { inside.sqrt() - along } else { 0.0 };
        ClPoint { tip: from.tip + axis * way.max(0.0), axis }
    }

    /// The way from one place outside to another around the sphere, its end included.
    fn around_to(&self, from: &ClPoint, to: &ClPoint) -> Vec<ClPoint> {
        let [a, b] = [from, to].map(|at| (at.tip - self.centre).normalize());
        let angle = a.cross(&b).norm().atan2(a.dot(&b));
        // Opposite places are joined over the top.
        let side =
            [Vector3::z(), Vector3::x()].into_iter().find(|v| a.cross(v).norm() > 0.1).unwrap_or_default();
        let square = (b - a * a.dot(&b)).try_normalize(1e-6).unwrap_or((side - a * a.dot(&side)).normalize());
        let count = (angle / SPHERE_STEP).ceil().max(1.0) as usize;
        let at = |k: usize| {
            let t = k as f64 / count as f64;
            let radial = a * (t * angle).cos() + square * (t * angle).sin();
            ClPoint { tip: self.centre + radial * self.radius, axis: from.towards(to, t).axis }
        };
        (1..count).map(at).chain(std::iter::once(*to)).collect()
    }
}

/// A program in the making.
struct Program<'a> {
    settings: &'a PlanSettings,
    sphere: Sphere,
    start: Option<ClPoint>,
    moves: Vec<Move>,
}

impl Program<'_> {
    fn push(&mut self, to: ClPoint, kind: MoveKind, feed_rate: f64, pass: u32) {
        self.moves.push(Move { to, kind, feed_rate, pass });
    }

    /// Brings the cutter to where a pass begins: out along its axis, around, and in along the axis there.
    fn reach(&mut self, pass: u32, to: &ClPoint) {
        let (outside, before) = (self.sphere.exit(to), self.moves.last().map(|m| m.to));
        if let Some(from) = before {
            let exit = self.sphere.exit(&from);
            self.push(self.off(&from, &exit), MoveKind::Retract, self.settings.feed_rate, pass);
            self.push(exit, MoveKind::Rapid, 0.0, pass);
            for at in self.sphere.around_to(&exit, &outside) {
                self.push(at, MoveKind::Rapid, 0.0, pass);
            }
        } else {
            self.start = Some(outside);
        }
        let near = self.off(to, &outside);
        self.push(near, MoveKind::Rapid, 0.0, pass);
        self.push(*to, MoveKind::Plunge, self.settings.plunge_rate, pass);
    }

    /// The clearance off a place towards one outside on its axis, or that place if it is nearer.
    fn off(&self, at: &ClPoint, outside: &ClPoint) -> ClPoint {
        let way = (outside.tip - at.tip).norm().min(self.settings.clearance);
        ClPoint { tip: at.tip + at.axis * way, axis: at.axis }
    }

    fn finish(mut self) -> Toolpath {
        let origin = ClPoint::upright(self.sphere.centre + Vector3::z() * self.sphere.radius);
        if let Some(last) = self.moves.last().copied() {
            let exit = self.sphere.exit(&last.to);
            self.push(exit, MoveKind::Retract, self.settings.feed_rate, last.pass);
        }
        Toolpath { start: self.start.unwrap_or(origin), moves: self.moves }
    }
}

#[cfg(test)]
mod tests;
