//! Passes of a ball whose centre runs over the offset surface of the part's mesh: where the part has concave
//! creases, no offset of its patches does, and the ball touches both sides at once.
//!
//! Enters: the part, a ball and a direction of the plan view. Leaves: tips of an upright ball, or touches of
//! a tilted one.
//!
//! The centre runs on the level set {distance = r} (`geometry::mesh_offset`). Passes are level curves of a
//! stream function on its mesh: their plan view keeps to the direction where the surface leaves that choice,
//! and they are one interval apart on the offset surface everywhere, steep walls included. Every place of a
//! pass is put onto the level set itself (of patches: of the exact surface), so that the mesh decides where
//! passes run, not how deep.
//!
//! The interval is one of centres. Two balls with centres e apart leave a ridge `r − √(r² − e²/4)` below the
//! line of centres; where the offset surface has the curvature κ₀ across the feed (positive concave) that
//! line lies `κ₀ e²/8` above it, so that h = e²/8 (1/r + κ₀) to second order. With κ₀ = κ/(1 − κ r) and e = w
//! (1 − κ r) this is the strip's `w²/8 (1/r − κ)`. Here it is not approximated: the point in which two
//! neighbouring balls meet is asked for its distance from the part, which also tells of facets and shallow
//! creases. A crease steeper than [`PENCIL`] has a pass of its own along its valley; neighbours do not look
//! beyond it.
//!
//! Limits: an upright ball cannot come to what lies below an overhang; it is left out and its area told.

mod guide;
#[cfg(test)]
mod tests;

use crate::levels::halving::along_and_between;
use crate::levels::on_triangles::OnTriangles;
use crate::levels::spacing::{LevelSteps, place_levels};
use crate::moves::touch::Touch;
use crate::tilt::tilted;
use crate::vocabulary::{Lines, PassSettings, Passes, PlanError, Step, Task};
use cutter::Cutter;
use drop_cutter::DropCutter;
use field::DIRECTION_WEIGHT;
use field::mesh::{
    FieldMesh, Held, MeshFieldError, fixed_angle, flows, orient_lines, smooth_lines, solve_stream,
    triangle_gradients,
};
use geometry::{Point3, Vector3, share_on};
use guide::OffsetGuide;
use motion::CcPoint;
use offset::{LevelSet, MeshOffset, OffsetError, OffsetSettings, Valley};
use part::Part;
use work::monitor::Monitor;

/// Cells of the offset's lattice over the ball's radius. Passes are put onto the level set afterwards;
/// smaller cells see narrower channels.
const CELL_OVER_RADIUS: f64 = 0.1;

/// Cells are tried as often, each time less by this factor, until they make a surface.
const CELLS_TRIED: i32 = 4;
const LESS_CELL: f64 = 0.83;

/// Passes serve the strip inside of a border from this share of an interval beyond it, too.
const BORDER_SHARE: f64 = 0.6;

/// Valleys whose sides differ by more than this, rad, are cut by a pass along them. Facets of smooth hollows
/// differ by less.
const PENCIL: f64 = 0.3;

/// The interval is never less than this share of that on a plane, nor greater than this multiple of it.
const LEAST_OVER_PLANE: f64 = 0.1;
const WIDEST_OVER_PLANE: f64 = 2.5;

/// Corrections of an interval; each squares the share by which its scallop is off.
const CORRECTIONS: usize = 4;

/// A centre that is this much lower than an upright ball comes, mm, cannot be reached, and by which it is
/// moved away from walls before it is asked.
const BELOW: f64 = 1e-3;
const ASIDE: f64 = 1e-6;

/// Corrections of a centre on patches, and when it is right, mm.
const CENTRINGS: usize = 8;
const CENTRED: f64 = 1e-10;

/// How far before and after a place the feed is told by, in points of a pass; the first that tells it.
const NEAR: [f64; 4] = [0.05, 0.5, 2.0, 8.0];

/// Pieces of the offset smaller than this share of a square interval are left out.
const LEAST_PIECE: f64 = 0.5;

/// A wish for a direction gives way to its neighbours over this many radii.
const SMOOTHING_OVER_RADIUS: f64 = 0.5;

/// What stands in an error.
const NAME: &str = "offset-surface";

/// Passes over the offset surface in the direction `angle`, rad from x in the plan view.
pub(crate) fn passes(task: &Task<'_>, angle: f64) -> Result<Passes, PlanError> {
    let Task { part, cutter, ref settings, monitor, .. } = *task;
    if !cutter.is_ball() {
        return Err(refused("only a ball's centre runs on one offset surface; use a ball"));
    }
    let radius = cutter.radius();
    let flat = match settings.step {
        Step::Stepover(s) => s,
        Step::Scallop(h) => 2.0 * (2.0 * radius * h - h * h).max(0.0).sqrt(),
    };
    let (offset, meshes) = offset_pieces(task, BORDER_SHARE * flat)?;
    let level = LevelSet::new(part.mesh(), part.bvh(), radius);
    let drop = settings.axis.is_none().then(|| DropCutter::watched(part, cutter, monitor)).transpose()?;
    let rider = MeshRider { part, cutter, level, drop, settings, flat, pencils: pencils(&offset), monitor };
    let mut all = Passes::default();
    let mut missed = 0.0;
    for mesh in &meshes {
        let area: f64 = (0..mesh.triangles().len()).map(|t| mesh.area(t)).sum();
        if area > LEAST_PIECE * flat * flat {
            let (passes, out) = rider.on_piece(mesh, angle)?;
            all.append(passes);
            missed += out;
        }
    }
    if missed > LEAST_PIECE * flat * flat {
        all.notes.push(format!(
            "{missed:.1} mm2 of the offset surface lie below overhangs or face down, where the upright ball does not come: \
             they are left out (a tool axis helps)"
        ));
    }
    all.append(rider.pencil_passes(&offset)?);
    Ok(all)
}

fn refused(reason: &str) -> PlanError {
    PlanError::NotApplicable { strategy: NAME, reason: reason.to_owned() }
}

/// The offset and its connected pieces.
fn offset_pieces(task: &Task<'_>, margin: f64) -> Result<(MeshOffset, Vec<FieldMesh>), PlanError> {
    let Task { part, cutter, ref settings, monitor, .. } = *task;
    let radius = cutter.radius();
    part.mesh().surface().map_err(|e| refused(&e.to_string()))?;
    let mut last = None;
    for k in 0..CELLS_TRIED {
        let cell = CELL_OVER_RADIUS * radius * LESS_CELL.powi(k);
        let settings =
            OffsetSettings { distance: radius, cell, margin, valley: PENCIL, memory: settings.memory as f64 };
        let offset = MeshOffset::new(part.mesh(), part.bvh(), &settings, monitor).map_err(|e| match e {
            OffsetError::Cancelled(cancelled) => PlanError::Cancelled(cancelled),
            other => refused(&other.to_string()),
        })?;
        match pieces(&offset) {
            Ok(pieces) => return Ok((offset, pieces)),
            Err(error) => last = Some(error),
        }
    }
    let reason = last.map_or_else(String::new, |e| e.to_string());
    Err(refused(&format!("its offset is no surface ({reason}); use a cutter of another size")))
}

fn pieces(offset: &MeshOffset) -> Result<Vec<FieldMesh>, MeshFieldError> {
    let whole = FieldMesh::new(offset.vertices.clone(), offset.triangles.clone(), None)?;
    let (piece, count) = whole.pieces();
    let mut number = vec![u32::MAX; offset.vertices.len()];
    type Raw = (Vec<Point3>, Vec<[u32; 3]>, Vec<Vector3>);
    let mut parts: Vec<Raw> = vec![Default::default(); count];
    for corners in whole.triangles() {
        let (points, triangles, normals) = &mut parts[piece[corners[0] as usize] as usize];
        triangles.push(corners.map(|v| {
            let own = &mut number[v as usize];
            if *own == u32::MAX {
                *own = points.len() as u32;
                points.push(whole.points()[v as usize]);
                normals.push(whole.normals()[v as usize]);
            }
            *own
        }));
    }
    parts
        .into_iter()
        .map(|(points, triangles, normals)| FieldMesh::new(points, triangles, Some(normals)))
        .collect()
}

/// The valleys that have passes of their own.
fn pencils(offset: &MeshOffset) -> Vec<Valley> {
    offset.valleys.iter().filter(|valley| valley.points.len() > 1).cloned().collect()
}

/// Lets the centre of a ball run on the offset surface of a part.
struct MeshRider<'a> {
    part: &'a Part,
    cutter: &'a Cutter,
    level: LevelSet<'a>,
    /// For upright balls.
    drop: Option<DropCutter<'a>>,
    settings: &'a PassSettings<'a>,
    /// Interval on a plane, mm.
    flat: f64,
    pencils: Vec<Valley>,
    monitor: &'a dyn Monitor,
}

impl MeshRider<'_> {
    /// The centre on the line from a place near the offset surface along `away`.
    fn centre(&self, x: &Point3, away: &Vector3) -> Option<Point3> {
        let mut centre = self.level.on_line(x, away, self.level.distance())?;
        if self.part.patches().is_empty() {
            return Some(centre);
        }
        for _ in 0..CENTRINGS {
            let (foot, distance) = self.part.closest_point(&centre);
            let off = self.level.distance() - distance;
            if off.abs() < CENTRED {
                break;
            }
            let slope = (centre - foot.point).try_normalize(1e-12).map_or(1.0, |n| n.dot(away));
            centre += away * (off / slope.max(0.1));
        }
        Some(centre)
    }

    /// Whether an upright ball comes to a centre.
    fn is_reached(&self, centre: &Point3) -> bool {
        let Some(drop) = &self.drop else { return true };
        let tip = centre.z - self.level.distance();
        // A ball that touches a wall is let drop a little beside it; on which side the walls are is not
        // asked.
        (0..8).any(|k| {
            let (sin, cos) = (f64::from(k) * std::f64::consts::FRAC_PI_4).sin_cos();
            let found = drop.at(centre.x + ASIDE * cos, centre.y + ASIDE * sin);
            found.is_none_or(|found| found.tip_z <= tip + BELOW)
        })
    }

    /// The interval, mm of centres, from a place across the feed: the lesser one of both sides.
    fn interval(&self, x: &Point3, away: &Vector3, across: &Vector3) -> f64 {
        match self.settings.step {
            Step::Stepover(s) => s,
            Step::Scallop(h) => {
                let sides = [1.0, -1.0].map(|side| self.to_side(x, away, &(across * side), h));
                let contact = x - away * self.level.distance();
                self.settings.guide().corrected(sides[0].min(sides[1]), &contact, self.settings.step)
            }
        }
    }

    fn to_side(&self, x: &Point3, away: &Vector3, across: &Vector3, h: f64) -> f64 {
        let (least, most) = (LEAST_OVER_PLANE * self.flat, WIDEST_OVER_PLANE * self.flat);
        let here = self.level.foot(x);
        if here.on_border {
            return self.flat;
        }
        let (here, mut e) = (here.direction, self.flat);
        for _ in 0..CORRECTIONS {
            let Some(y) = self.level.on_line(&(x + across * e), away, self.level.distance()) else {
                return most;
            };
            let foot = self.level.foot(&y);
            if foot.on_border {
                // Beyond the border there is no part that a ridge could stand on.
                return self.flat;
            }
            let there = foot.direction;
            let bent = here.angle(&there);
            if bent > PENCIL && (there - here).dot(&(y - x)) < 0.0 && self.near_pencil(x, 1.5 * e) {
                return most;
            }
            let Some(ridge) = self.ridge(x, &y, away) else { return (0.5 * e).max(least) };
            let next = (e * (h / ridge.max(0.05 * h)).sqrt()).clamp(least, most.min(2.0 * e));
            let settled = (next / e - 1.0).abs() < 2e-3;
            e = next;
            if settled {
                break;
            }
        }
        e
    }

    /// Height above the part of the ridge between balls with these centres, mm; `None` where they do not
    /// meet.
    fn ridge(&self, a: &Point3, b: &Point3, away: &Vector3) -> Option<f64> {
        let (between, radius) = (b - a, self.level.distance());
        let along = between.try_normalize(1e-12)?;
        let inward = (along * along.dot(away) - away).try_normalize(1e-6)?;
        let depth = (radius * radius - 0.25 * between.norm_squared()).max(0.0).sqrt();
        let top = nalgebra::center(a, b) + inward * depth;
        (depth > 0.0).then(|| self.part.closest_point(&top).1)
    }

    fn near_pencil(&self, x: &Point3, reach: f64) -> bool {
        let reach2 = reach * reach;
        let near =
            |w: &[Point3]| (x - (w[0] + (w[1] - w[0]) * share_on(x, &w[0], &w[1]))).norm_squared() <= reach2;
        self.pencils.iter().any(|valley| valley.points.windows(2).any(near))
    }

    /// Passes over one piece, and the area that is left out, mm².
    fn on_piece(&self, mesh: &FieldMesh, angle: f64) -> Result<(Passes, f64), PlanError> {
        let failed = |e: MeshFieldError| refused(&e.to_string());
        let reached = work::parallel::map(mesh.points().len(), |v| self.is_reached(&mesh.points()[v]));
        let out = |t: &usize| mesh.triangles()[*t].iter().all(|&v| !reached[v as usize]);
        let missed = (0..mesh.triangles().len()).filter(out).map(|t| mesh.area(t)).sum();
        if !reached.contains(&true) {
            return Ok((Passes::default(), missed));
        }
        let wanted = fixed_angle(mesh, angle);
        if wanted.iter().all(Option::is_none) {
            return Err(refused("its offset has no direction at that angle anywhere; use another angle"));
        }
        let mut lines =
            smooth_lines(mesh, &wanted, &[], SMOOTHING_OVER_RADIUS * self.cutter.radius()).map_err(failed)?;
        orient_lines(mesh, &mut lines);
        self.monitor.start("intervals on the offset surface", 1);
        let widths = work::parallel::try_map(mesh.points().len(), |v| {
            work::monitor::check(self.monitor)?;
            let (x, away) = (&mesh.points()[v], &mesh.normals()[v]);
            Ok::<_, PlanError>(self.interval(x, away, &away.cross(&lines[v].direction)))
        })?;
        let density: Vec<f64> = widths.iter().map(|w| 1.0 / w).collect();
        let weight = vec![1.0; density.len()];
        let stream =
            solve_stream(mesh, &flows(mesh, &lines, &density, &weight), DIRECTION_WEIGHT, &Held::default())
                .map_err(failed)?;
        let on = OnTriangles::new(mesh, &stream.values, &[], Lines::Levels, 0.0)?;
        let range = on.levels.range();
        let gradients = triangle_gradients(mesh, &stream.values);
        let guide = OffsetGuide { rider: self, on, gradients, widths, reached };
        let mut passes = Passes::default();
        let placed = place_levels(&guide.places(), range, LevelSteps::Shortest, &mut passes.notes);
        passes.append(along_and_between(&guide, &placed, range, self.settings.sampling, self.monitor)?);
        Ok((passes, missed))
    }

    /// The cutter at a centre, for a tilted one.
    fn touch(&self, centre: Point3, away: Vector3, feed: Vector3) -> Option<(CcPoint, Vector3)> {
        let feed = (feed - away * away.dot(&feed)).try_normalize(1e-12)?;
        Some((CcPoint { point: centre - away * self.level.distance(), normal: away }, feed))
    }

    /// Appends the pass along `place(s)` (centre and direction away from the part), s from `s0` to `s1`.
    fn add(
        &self,
        place: &(dyn Fn(f64) -> Option<(Point3, Vector3)> + Sync),
        [s0, s1]: [f64; 2],
        passes: &mut Passes,
    ) -> Result<(), PlanError> {
        if let Some(rule) = self.settings.axis {
            let contact = |s: f64| {
                let (centre, away) = place(s)?;
                // Where valleys meet, places beside each other are all the same.
                NEAR.iter().find_map(|near| {
                    let (before, after) = (place((s - near).max(s0))?.0, place((s + near).min(s1))?.0);
                    self.touch(centre, away, after - before)
                })
            };
            let touches: Vec<Touch> = tilted::along(
                &contact,
                [s0, s1],
                self.cutter,
                rule,
                self.settings.chord_tolerance,
                self.monitor,
            )?;
            if touches.len() > 1 {
                passes.passes.push(touches.iter().map(|touch| touch.contact.point).collect());
                passes.touches.push(touches);
                passes.contacts.push(Vec::new());
            }
            return Ok(());
        }
        let down = Vector3::z() * self.level.distance();
        let settings = PassSettings { sampling: 1.0, ..*self.settings };
        let moves =
            settings.moves(s0, s1, &mut |s| place(s).map(|(centre, _)| centre - down), self.monitor)?;
        if moves.len() > 1 {
            passes.passes.push(moves);
            passes.contacts.push(Vec::new());
        }
        Ok(())
    }

    /// Passes along the valleys.
    fn pencil_passes(&self, offset: &MeshOffset) -> Result<Passes, PlanError> {
        let mut passes = Passes::default();
        let mut length = 0.0;
        for valley in &self.pencils {
            let mut points = valley.points.clone();
            if valley.closed {
                points.push(points[0]);
            }
            let place = |s: f64| {
                let k = (s as usize).min(points.len() - 2);
                let near = points[k] + (points[k + 1] - points[k]) * (s - k as f64);
                let exact = self.level.valley_at(&near, offset.cell).map_or(near, |found| found.0);
                let feed = (points[k + 1] - points[k]).try_normalize(1e-12)?;
                let away = self.away_of_valley(&exact, &feed, offset.cell)?;
                Some((self.centre(&exact, &away)?, away))
            };
            for [first, last] in runs(points.len(), |k| self.is_reached(&points[k])) {
                self.add(&place, [first as f64, last as f64], &mut passes)?;
                length += points[first..=last].windows(2).map(|w| (w[1] - w[0]).norm()).sum::<f64>();
            }
        }
        if length > 0.0 {
            passes.notes.push(format!(
                "{length:.0} mm of passes run along creases, where the ball touches both sides"
            ));
        }
        Ok(passes)
    }

    /// The direction out of a valley that runs along `feed`: the mean of those away from its two sides.
    fn away_of_valley(&self, x: &Point3, feed: &Vector3, reach: f64) -> Option<Vector3> {
        let here = self.level.foot(x).direction;
        let across = here.cross(feed).try_normalize(1e-9)?;
        let sides = [1.0, -1.0].map(|s| self.level.foot(&(x + across * (s * 0.1 * reach))).direction);
        (sides[0] + sides[1]).try_normalize(1e-9)
    }
}

/// The runs of at least two indices below `n` that are kept, first and last.
fn runs(n: usize, keep: impl Fn(usize) -> bool) -> Vec<[usize; 2]> {
    let mut runs: Vec<[usize; 2]> = Vec::new();
    for k in (0..n).filter(|&k| keep(k)) {
        match runs.last_mut() {
            Some(run) if run[1] + 1 == k => run[1] = k,
            _ => runs.push([k, k]),
        }
    }
    runs.retain(|run| run[1] > run[0]);
    runs
}
