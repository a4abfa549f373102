//! Ways of a tilted cutter between two places where it touches, and the quickest of those that are clear.
//!
//! - On the surface ([`bent`](super::bent)), fed, where links on the surface are asked for.
//! - Aloft: along the axis until the tool is clear, straight over while the axis turns evenly, and down along
//!   the axis there; all fed, since stock may stand.
//! - Over the block that holds part and stock: out along the axis, straight over or over the top of the
//!   block, and in.
//! - Around a sphere that holds the block, and is larger by the tool's greatest radius: with the tip on it
//!   every place of the tool is outside of the block while its axis points away from the middle. Where an
//!   axis that turns evenly does not, it is turned away first.
//!
//! The way out along the axis, as soon as the cutter keeps off the part there as aloft, and what is outside of
//! the block are run at rapid rate. Before that the tool goes at the feed, and where stock may stand in the
//! block no faster than a plunge down its axis.
//!
//! The height aloft is the least at which the straight way stays clear of the part, on its outer side where
//! there is no surface to meet.
//!
//! - Around a greater sphere that holds the fixtures, too.
//!
//! A path begins and ends outside of all along the axis there, or where that meets a fixture, level beside
//! it.
//!
//! All but the last are proved clear, move by move, of all that the tool is to keep away from; the last is
//! taken where nothing else is clear. Over the block the tool also rises over all fixtures where it meets
//! one. Times are length over rate.

use super::bent::Bent;
use crate::link::Speeds;
use crate::moves::touch::{GREATEST_TURN, Touch};
use crate::vocabulary::PlanSettings;
use collision::{Check, Interference, Obstacle};
use cutter::{Cutter, Solid};
use geometry::{Aabb, Bvh, Point3, TriangleMesh, Vector3, angle_between};
use motion::{ClPoint, MoveKind};
use part::Part;
use std::f64::consts::TAU;
use work::monitor::{Cancelled, Monitor};

/// The way around the sphere is divided into turns of this angle, rad, and the sphere is as much larger as
/// its chords cut off: `1/cos` of half of it.
const SPHERE_STEP: f64 = 0.15;

/// Distance that a cutter keeps from the part aloft, mm. Less may scratch where machines overshoot; more
/// makes ways longer.
const ALOFT: f64 = 0.2;

/// Halvings by which the height of a way aloft is told, of the last doubling.
const HALVINGS: usize = 3;

/// Places asked for the side of the part on which a way aloft runs.
const PLACES: usize = 8;

/// Steps that the tool takes at most until it is outside of the block.
const MOST_STEPS: usize = 100;

/// Level directions that are tried from the block to where a path begins or ends, the shortest way first.
const SIDES: usize = 16;

/// Least step of these, mm.
const LEAST_STEP: f64 = 0.1;

/// A move to a place, and what it is for.
pub type Leg = (ClPoint, MoveKind);

/// Part and stock as a block, with all that lies within the clearance of it.
pub struct Block {
    bounds: Aabb,
    mesh: Option<(TriangleMesh, Bvh)>,
}

impl Block {
    /// The block of a part and its stock.
    pub fn of(part: &Part, settings: &PlanSettings) -> Self {
        let bounds = stock_bounds(part, settings);
        let around = Vector3::repeat(settings.clearance);
        let grown = Aabb { min: bounds.min - around, max: bounds.max + around };
        let (vertices, triangles) = grown.surface();
        let mesh = TriangleMesh::new(vertices, triangles).ok().map(|(mesh, _)| {
            let bvh = Bvh::new(&mesh);
            (mesh, bvh)
        });
        Self { bounds: grown, mesh }
    }

    /// How far a tip goes along a unit vector until it leaves the block.
    fn exit(&self, from: &ClPoint, toward: &Vector3) -> f64 {
        let along = |c: usize| {
            let (p, a) = (from.tip[c], toward[c]);
            let side = if a > 0.0 { self.bounds.max[c] } else { self.bounds.min[c] };
            if a == 0.0 { f64::INFINITY } else { (side - p) / a }
        };
        (0..3).map(along).fold(f64::INFINITY, f64::min).max(0.0)
    }
}

/// What the ways between passes are chosen from.
pub struct Ways<'a> {
    part: &'a Part,
    settings: &'a PlanSettings,
    pub(super) rates: Speeds,
    /// Height of the middle of what cuts over the tip, mm.
    middle: f64,
    block: &'a Block,
    sphere: Sphere,
    /// A sphere around the fixtures as well, and the height of the tip over all of them.
    widest: Sphere,
    highest: f64,
    bent: Option<Bent<'a>>,
    /// What the tool keeps away from while the cutter touches, while it goes over, and outside of the block.
    touching: &'a Interference<'a>,
    aloft: Interference<'a>,
    outside: Interference<'a>,
}

impl<'a> Ways<'a> {
    /// Ways with links on the surface by `bent`, or without.
    pub fn new(
        part: &'a Part,
        cutter: &Cutter,
        settings: &'a PlanSettings,
        rates: Speeds,
        block: &'a Block,
        touching: &'a Interference<'a>,
        bent: Option<Bent<'a>>,
    ) -> Self {
        let higher = |check: &Check<'a>| Check {
            // A cutter that may cut in does not aloft.
            needed: if check.needed < 0.0 { ALOFT } else { check.needed },
            ..*check
        };
        let aloft =
            Interference { checks: touching.checks.iter().map(higher).collect(), ..Default::default() };
        let mut outside = aloft.clone();
        if let Some((mesh, bvh)) = &block.mesh {
            let mut solids: Vec<&Solid> = Vec::new();
            for check in &touching.checks {
                if !solids.iter().any(|solid| std::ptr::eq(*solid, check.solid)) {
                    solids.push(check.solid);
                }
            }
            let obstacle = Obstacle::new(mesh, bvh);
            outside.checks.extend(solids.into_iter().map(|solid| Check { solid, obstacle, needed: 0.0 }));
        }
        let radii = touching.checks.iter().map(|check| check.solid.radius());
        let (radius, middle) = (radii.fold(cutter.radius(), f64::max), cutter.profile().centre_z);
        let stock = stock_bounds(part, settings);
        let obstacles = touching.checks.iter().map(|check| check.obstacle.bounds());
        let all = obstacles.fold(stock, |a, b| Aabb { min: a.min.inf(&b.min), max: a.max.sup(&b.max) });
        let [sphere, widest] = [stock, all].map(|bounds| Sphere::around(&bounds, settings, radius));
        let highest = all.max.z + settings.clearance;
        Self { part, settings, rates, middle, block, sphere, widest, highest, bent, touching, aloft, outside }
    }

    /// About what it takes to go on at a distance, s: no less the farther it is.
    pub fn cost(&self, distance: f64) -> f64 {
        let clearance = self.settings.clearance;
        let around = (2.0 * self.sphere.radius + distance) / self.rates.rapid
            + clearance / self.rates.feed
            + clearance / self.rates.plunge;
        let aloft = (ALOFT + distance) / self.rates.feed + ALOFT / self.rates.plunge;
        let longest = self.bent.as_ref().map_or(0.0, |bent| bent.longest);
        // A half circle.
        let bent = distance * std::f64::consts::FRAC_PI_2;
        let bent = if bent > longest { f64::INFINITY } else { bent / self.rates.feed };
        around.min(aloft).min(bent)
    }

    /// The quickest way that is clear from the end of a pass to the start of the next.
    ///
    /// # Errors
    /// [`Cancelled`] when the monitor says so.
    pub fn between(&self, from: &Touch, to: &Touch, monitor: &dyn Monitor) -> Result<Vec<Leg>, Cancelled> {
        let ways = [Sphere::around_to, Sphere::around_pointing_away];
        let mut ways = ways.iter().flat_map(|way| [&self.sphere, &self.widest].map(|sphere| (sphere, way)));
        let mut around = Vec::new();
        let clear = ways.any(|(sphere, way)| {
            let is_outside;
            (is_outside, around) = self.around(sphere, *way, &from.at, &to.at);
            is_outside && self.is_clear(&from.at, &around, self.touching)
        });
        let mut best = (clear, self.time(&from.at, &around), around);
        let mut take = |way: Option<Vec<Leg>>| {
            if let Some(way) = way {
                let time = self.time(&from.at, &way);
                if !best.0 || time < best.1 {
                    best = (true, time, way);
                }
            }
            if best.0 { best.1 } else { f64::INFINITY }
        };
        let quickest = take(self.over_block(&from.at, &to.at));
        let quickest = take(self.aloft(&from.at, &to.at, quickest));
        work::monitor::check(monitor)?;
        if let Some(bent) = &self.bent
            && (to.contact.point - from.contact.point).norm() / self.rates.feed < quickest
        {
            let link = bent.link(from, to, monitor)?;
            take(link.map(|link| link.into_iter().map(|at| (at, MoveKind::Link)).collect()));
        }
        Ok(best.2)
    }

    /// The way from a place to where the tool stands outside of all, before its first pass or after its last:
    /// along its axis, or where it meets something there, out of the block along its axis or aslant, and on
    /// level.
    pub fn away(&self, from: &ClPoint) -> Vec<ClPoint> {
        let along = [&self.sphere, &self.widest].map(|sphere| vec![sphere.exit(from, &from.axis)]);
        let to_side = |k: usize| {
            let (sin, cos) = (TAU * k as f64 / SIDES as f64).sin_cos();
            let side = Vector3::new(cos, sin, 0.0);
            // Where it leans to what stands beside it, it has to leave that as it rises.
            let block = [from.axis, (from.axis + side).normalize()].map(|toward| self.out(from, &toward));
            block.into_iter().flatten().map(move |block| vec![block, self.widest.exit(&block, &side)])
        };
        let mut level: Vec<Vec<ClPoint>> = (0..SIDES).flat_map(to_side).collect();
        level.sort_by(|a, b| (a[1].tip - a[0].tip).norm().total_cmp(&(b[1].tip - b[0].tip).norm()));
        let clear = |way: &Vec<ClPoint>| {
            let mut at = from;
            way.iter().all(|to| self.touching.on_move(std::mem::replace(&mut at, to), to).is_none())
        };
        let found = along.iter().cloned().chain(level).find(clear);
        let [near, far] = along;
        found.unwrap_or(if self.touching.is_clear(&near[0]) { near } else { far })
    }

    /// Above all, upright.
    pub fn above(&self) -> ClPoint {
        ClPoint::upright(self.sphere.centre + Vector3::z() * self.sphere.radius)
    }

    /// In to the first place by a way away from it, back from its end.
    pub fn into(&self, away: &[ClPoint], to: &ClPoint) -> Vec<Leg> {
        let last = match away {
            [outside] => self.to_block(outside, to),
            [block, ..] => Some((*block, MoveKind::Rapid)),
            [] => None,
        };
        last.into_iter().chain([(*to, MoveKind::Plunge)]).collect()
    }

    /// In along the axis, through what may stand there.
    fn down(&self, outside: &ClPoint, to: &ClPoint) -> Vec<Leg> {
        self.to_block(outside, to).into_iter().chain([(*to, MoveKind::Plunge)]).collect()
    }

    /// From outside along the axis to where the block begins, if that is any nearer.
    fn to_block(&self, outside: &ClPoint, to: &ClPoint) -> Option<Leg> {
        let nearer = |at: &ClPoint| (at.tip - to.tip).norm() < (outside.tip - to.tip).norm();
        self.out(to, &to.axis).filter(nearer).map(|at| (at, MoveKind::Rapid))
    }

    /// Length over rate, s.
    fn time(&self, from: &ClPoint, way: &[Leg]) -> f64 {
        let mut at = from.tip;
        let one = |(to, kind): &Leg| {
            let from = std::mem::replace(&mut at, to.tip);
            (to.tip - from).norm()
                / match kind {
                    MoveKind::Rapid => self.rates.rapid,
                    MoveKind::Plunge => self.rates.plunge,
                    MoveKind::Cut | MoveKind::Link => self.rates.feed,
                    MoveKind::Retract => self.rates.entering(&from, &to.tip, &to.axis),
                }
        };
        way.iter().map(one).sum()
    }

    fn is_clear(&self, from: &ClPoint, way: &[Leg], keep: &Interference) -> bool {
        let mut at = from;
        way.iter().all(|(to, _)| keep.on_move(std::mem::replace(&mut at, to), to).is_none())
    }

    /// Up by as much as the way over takes to be clear, over and down, if that is quicker than `quickest`, s.
    fn aloft(&self, from: &ClPoint, to: &ClPoint, quickest: f64) -> Option<Vec<Leg>> {
        let up = |at: &ClPoint, by: f64| ClPoint { tip: at.tip + at.axis * by, axis: at.axis };
        let way = |height: f64| {
            let (a, b) = (up(from, height), up(to, height));
            let mut moves = vec![(a, MoveKind::Retract)];
            moves.extend(evenly(&a, &b).into_iter().map(|at| (at, MoveKind::Retract)));
            moves.push((*to, MoveKind::Plunge));
            moves
        };
        let clear = |moves: &[Leg]| {
            let last = moves.len() - 1;
            self.keeps_its_side(&moves[..last])
                && self.is_clear(from, &moves[..1], self.touching)
                && self.is_clear(&moves[0].0, &moves[1..last], &self.aloft)
                && self.is_clear(&moves[last - 1].0, &moves[last..], self.touching)
        };
        // A cutter that leans keeps less off the part than it goes along its axis.
        let (mut low, mut high) = (0.0, ALOFT);
        let mut found = loop {
            let moves = way(high);
            if high > self.sphere.radius || self.time(from, &moves) >= quickest {
                return None;
            }
            if clear(&moves) {
                break moves;
            }
            (low, high) = (high, 2.0 * high);
        };
        for _ in 0..if low > 0.0 { HALVINGS } else { 0 } {
            let middle = 0.5 * (low + high);
            let moves = way(middle);
            if clear(&moves) {
                (found, high) = (moves, middle);
            } else {
                low = middle;
            }
        }
        Some(found)
    }

    /// Whether what cuts runs on the outer side of the part all along, also beside its border, where no
    /// surface is met.
    fn keeps_its_side(&self, moves: &[Leg]) -> bool {
        let outer = |at: &ClPoint| self.part.closest_point(&(at.tip + at.axis * self.middle)).1 >= 0.0;
        let (Some((a, _)), Some((b, _))) = (moves.first(), moves.last()) else { return true };
        (0..=PLACES).all(|k| outer(&a.towards(b, k as f64 / PLACES as f64)))
    }

    /// Out of the block, over, and in again.
    fn over_block(&self, from: &ClPoint, to: &ClPoint) -> Option<Vec<Leg>> {
        let (a, b) = (self.out(from, &from.axis)?, self.out(to, &to.axis)?);
        let legs = self.off(from, &a);
        let down = self.down(&b, to);
        if !self.is_clear(from, &legs, self.touching) || !self.is_clear(&b, &down, self.touching) {
            return None;
        }
        let top = a.tip.z.max(b.tip.z).max(self.block.bounds.max.z);
        let rapid = |at: ClPoint| (at, MoveKind::Rapid);
        let straight: Vec<_> = evenly(&a, &b).into_iter().map(rapid).collect();
        let over = |height: f64| {
            let raised =
                |at: &ClPoint| ClPoint { tip: Point3::new(at.tip.x, at.tip.y, height), axis: at.axis };
            let (above_a, above_b) = (raised(&a), raised(&b));
            let mut way = vec![rapid(above_a)];
            way.extend(evenly(&above_a, &above_b).into_iter().map(rapid));
            way.push(rapid(b));
            way
        };
        let ways = [straight, over(top), over(top.max(self.highest))];
        let free = ways.into_iter().find(|way| self.is_clear(&a, way, &self.outside))?;
        let moves = legs.into_iter().chain(free).chain(down);
        // Places that are raised by nothing take no move.
        let mut at = *from;
        Some(moves.filter(|(to, _)| std::mem::replace(&mut at, *to) != *to).collect())
    }

    /// Where the whole tool is outside of the block as it goes along a unit vector.
    fn out(&self, from: &ClPoint, toward: &Vector3) -> Option<ClPoint> {
        self.block.mesh.as_ref()?;
        let most = (self.sphere.exit(from, toward).tip - from.tip).norm();
        let mut way = self.block.exit(from, toward);
        for _ in 0..MOST_STEPS {
            let at = ClPoint { tip: from.tip + toward * way, axis: from.axis };
            let Some(missing) = self.outside.shortfall(&at) else { return Some(at) };
            way += missing.depth.max(LEAST_STEP);
            if way > most {
                return None;
            }
        }
        None
    }

    /// Out along the axis, around the sphere in some way, and in along the axis there; and whether the tool
    /// is outside of the block all around.
    fn around(
        &self,
        sphere: &Sphere,
        way: fn(&Sphere, &ClPoint, &ClPoint) -> Vec<ClPoint>,
        from: &ClPoint,
        to: &ClPoint,
    ) -> (bool, Vec<Leg>) {
        let (a, b) = (sphere.exit(from, &from.axis), sphere.exit(to, &to.axis));
        let over: Vec<Leg> = way(sphere, &a, &b).into_iter().map(|at| (at, MoveKind::Rapid)).collect();
        let is_outside = self.is_clear(&a, &over, &self.outside);
        let off = self.off(from, &a);
        (is_outside, off.into_iter().chain(over).chain(self.down(&b, to)).collect())
    }

    /// Along the axis to a place outside: by the clearance at the feed, or as far as it takes until the cutter
    /// keeps off the part, as aloft, on the rest of the way, which is rapid.
    fn off(&self, from: &ClPoint, outside: &ClPoint) -> Vec<Leg> {
        let whole = (outside.tip - from.tip).norm();
        let mut way = self.settings.clearance;
        while way < whole {
            let at = ClPoint { tip: from.tip + from.axis * way, axis: from.axis };
            if self.aloft.on_move(&at, outside).is_none() {
                return vec![(at, MoveKind::Retract), (*outside, MoveKind::Rapid)];
            }
            way = 2.0 * way.max(ALOFT);
        }
        vec![(*outside, MoveKind::Retract)]
    }
}

/// A straight move in pieces in which the axis turns little, its end included.
fn evenly(from: &ClPoint, to: &ClPoint) -> Vec<ClPoint> {
    let count = turns(from, to);
    let at = |k: usize| from.towards(to, k as f64 / count as f64);
    (1..count).map(at).chain(std::iter::once(*to)).collect()
}

/// Moves in which the axis turns little.
fn turns(from: &ClPoint, to: &ClPoint) -> usize {
    let turn = angle_between(&from.axis, &to.axis);
    (turn / GREATEST_TURN).ceil().max(1.0) as usize
}

/// Part and stock.
fn stock_bounds(part: &Part, settings: &PlanSettings) -> Aabb {
    let mut bounds = settings.stock.map_or(part.bounds(), |stock| part.bounds().union(&stock));
    bounds.max.z = bounds.max.z.max(settings.stock_top);
    bounds
}

/// A sphere around part and stock, or more, on which a tool that points away from its middle touches neither.
struct Sphere {
    centre: Point3,
    radius: f64,
}

impl Sphere {
    /// For a tool of this greatest radius, mm.
    fn around(bounds: &Aabb, settings: &PlanSettings, tool: f64) -> Self {
        let least = 0.5 * bounds.size().norm() + settings.clearance;
        let radius = (least + tool) / (0.5 * SPHERE_STEP).cos();
        Self { centre: nalgebra::center(&bounds.min, &bounds.max), radius }
    }

    /// Where a cutter that goes along a unit vector leaves the sphere.
    fn exit(&self, from: &ClPoint, toward: &Vector3) -> ClPoint {
        let off = from.tip - self.centre;
        let along = off.dot(toward);
        let inside = along * along - off.norm_squared() + self.radius * self.radius;
        let way = if inside > 0.0 { inside.sqrt() - along } else { 0.0 };
        ClPoint { tip: from.tip + toward * way.max(0.0), axis: from.axis }
    }

    /// As [`Self::around_to`], with the axis turned away from the middle first and back last: clear of what
    /// the sphere holds whatever the axes at both ends, which may be opposite, as on two sides of a blade.
    fn around_pointing_away(&self, from: &ClPoint, to: &ClPoint) -> Vec<ClPoint> {
        let away = |tip: Point3| ClPoint { tip, axis: (tip - self.centre).normalize() };
        let [a, b] = [away(from.tip), away(to.tip)];
        let between = self.around_to(&a, &b).into_iter().map(|at| away(at.tip));
        evenly(from, &a).into_iter().chain(between).chain(evenly(&b, to)).collect()
    }

    /// The way from one place outside to another around the sphere, its end included, while the axis turns
    /// evenly.
    fn around_to(&self, from: &ClPoint, to: &ClPoint) -> Vec<ClPoint> {
        let [a, b] = [from, to].map(|at| (at.tip - self.centre).normalize());
        let angle = angle_between(&a, &b);
        // Opposite places are joined over the top.
        let side =
            [Vector3::z(), Vector3::x()].into_iter().find(|v| a.cross(v).norm() > 0.1).unwrap_or_default();
        let square = (b - a * a.dot(&b)).try_normalize(1e-6).unwrap_or((side - a * a.dot(&side)).normalize());
        let count = ((angle / SPHERE_STEP).ceil().max(1.0) as usize).max(turns(from, to));
        let at = |k: usize| {
            let t = k as f64 / count as f64;
            let radial = a * (t * angle).cos() + square * (t * angle).sin();
            ClPoint { tip: self.centre + radial * self.radius, axis: from.towards(to, t).axis }
        };
        (1..count).map(at).chain(std::iter::once(*to)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vocabulary::{Joining, Step};
    use cutter::{Holder, HolderSection};
    use geometry::{AnalyticShape, AnalyticSurface};
    use part::Patch;

    /// A bull nose with a wide holder, its tip on the sphere and on the chords around it, its axis square to
    /// the radius at most.
    #[test]
    fn on_the_sphere_no_tool_that_points_away_touches_the_block() {
        let plane = AnalyticSurface::new(AnalyticShape::Plane { height: 0.0 }, [[-6.0, 14.0], [0.0, 9.0]]);
        let part = Part::from_patches(vec![Patch::Analytic(plane.unwrap())], 0.01).unwrap();
        let stock = Aabb { min: Point3::new(-6.0, -7.0, -5.0), max: Point3::new(14.0, 9.0, 4.0) };
        let settings = PlanSettings {
            step: Step::Stepover(1.0),
            chord_tolerance: 0.005,
            clearance: 0.5,
            stock_top: 4.0,
            // Wider than the part on one side, and deeper.
            stock: Some(stock),
            feed_rate: 1000.0,
            plunge_rate: 300.0,
            joining: Joining::default(),
            ..PlanSettings::default()
        };
        let section = HolderSection { diameter: 30.0, top_diameter: 30.0, length: 40.0 };
        let tool =
            Solid::of_tool(&Cutter::bull(10.0, 2.0).unwrap(), &Holder::new(4.0, vec![section]).unwrap());
        let sphere = Sphere::around(&stock_bounds(&part, &settings), &settings, tool.radius());
        let corners = (0..8).map(|i| {
            let pick = |c: usize| if i >> c & 1 == 1 { stock.max[c] } else { stock.min[c] };
            Point3::new(pick(0), pick(1), pick(2))
        });
        let corners: Vec<Point3> = corners.collect();
        let assert_clear = |at: &ClPoint, what: &dyn std::fmt::Debug| {
            for q in &corners {
                let distance = tool.distance(&at.tip, &at.axis, q);
                assert!(distance >= settings.clearance - 1e-9, "{what:?} {q}: {distance}");
            }
        };
        let mut places: Vec<ClPoint> = Vec::new();
        for k in 0..200 {
            let (turn, height) = (f64::from(k) * 2.4, -0.99 + 1.98 * f64::from(k) / 199.0);
            let flat = (1.0f64 - height * height).sqrt();
            let radial = Vector3::new(flat * turn.cos(), flat * turn.sin(), height);
            let across = radial.cross(&Vector3::new(0.3, 0.5, 0.8)).normalize();
            for lean in [0.0, 0.4, 0.9, 1.5] {
                let axis = radial * f64::cos(lean) + across * f64::sin(lean);
                // The middle of a chord of the way around lies deepest.
                let tip = sphere.centre + radial * (sphere.radius * (0.5 * SPHERE_STEP).cos());
                assert_clear(&ClPoint { tip, axis }, &(k, lean));
                places
                    .push(sphere.exit(&ClPoint { tip: sphere.centre + radial * sphere.radius, axis }, &axis));
            }
        }
        // From any of them to any other, also where the axes are opposite.
        for (k, from) in places.iter().enumerate() {
            let to = &places[(k * 379 + 401) % places.len()];
            let way = sphere.around_pointing_away(from, to);
            assert!((way[way.len() - 1].tip - to.tip).norm() < 1e-9);
            let mut at = from;
            for next in &way {
                (0..=8).for_each(|n| assert_clear(&at.towards(next, f64::from(n) / 8.0), &(k, n)));
                at = next;
            }
        }
    }
}
