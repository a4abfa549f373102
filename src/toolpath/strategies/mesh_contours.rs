//! Waterline passes on a mesh: contours of the dropped cutter's height, however steep the walls are.
//!
//! Enters: a part that is a mesh, and how heights step. Leaves: passes on which the tip keeps its height.
//! Where the part is flatter than whole passes serve, further ones follow contours halfway between
//! (`levels::halving`).
//!
//! Where a wall ends at an edge the cutter rolls over it. From there a pass serves about half an interval of
//! the wall, so that it is left out where the cutter has rolled farther. On walls that are upright and on
//! ground that is nearly level no contour is of use.

#[cfg(test)]
mod tests;

use crate::levels::halving::{Allowed, LevelSource, Track, along_and_between, whole_pass};
use crate::levels::spacing::{AllowedStep, LevelSteps, place_levels};
use crate::surface::border::LEAST_FACING;
use crate::surface::height_contours::HeightContours;
use crate::vocabulary::{Contact, Faces, PassSettings, Passes, PlanError, Step, Task};
use cutter::Cutter;
use drop_cutter::DropCutter;
use geometry::{CubicSpline, Point2, Point3, TriangleMesh, Vector2, Vector3};
use motion::{CcPoint, in_tool_frame};
use part::{Part, SurfacePoint};
use scallop::{FeedCurvature, SurfaceCurvature, strip_width_at};
use std::f64::consts::FRAC_PI_2;
use work::monitor::{self, Cancelled, Monitor};

/// Faces that contours serve. Those of a wall lie as close on it as it is steep, and halving an interval six
/// times comes to a 64th of it: the sine of the least slope.
const SERVED: Faces = Faces { least: LEAST_FACING, most: 0.999_878 };

/// Where the cutter would come to rest lower than a contour's level by more than this, mm, its side touches,
/// not its end.
const JUMP: f64 = 1e-3;

/// Angles between faces and cutter below this, rad, are rounding.
const ROUNDING: f64 = 1e-6;

/// A place counts as reached by the cutter unless that comes to rest higher by this, mm.
const HELD_OFF: f64 = 1e-3;

/// How far, in intervals, the cutter may have rolled over the upper edge of a wall for a pass to be of use.
/// The pass beside it is then so near to the edge that hardly more stands over that than what passes leave on
/// the face beyond.
const ROLLED_OVER: f64 = 0.8;

/// The same of the lower edge: a pass serves half an interval.
const ROLLED_UNDER: f64 = 0.5;

/// The step of heights is never less than this share of what a plane allows, however much the surface hugs
/// the cutter.
const LEAST_FREE: f64 = 0.05;

/// Places along a side of a triangle that are asked for what they allow, at most.
const MOST_PLACES: usize = 24;

/// Least length of a contour, mm.
const LEAST_LENGTH: f64 = 1e-3;

/// Level ground of a lesser share of the surface is not told of.
const LEAST_TOLD: f64 = 1e-3;

/// Passes along contours of a mesh.
pub(super) fn passes(task: &Task<'_>, placing: LevelSteps) -> Result<Passes, PlanError> {
    let Task { part, cutter, ref settings, monitor, .. } = *task;
    let dropped = task.dropped();
    let drop = DropCutter::watched(part, dropped, monitor)?;
    // Where more than two triangles meet at an edge, faces count as flat.
    let bend = SurfaceCurvature::of(part, cutter.radius()).ok();
    let contours = HeightContours::new(drop, &part.bounds(), dropped.radius(), settings.memory, monitor)?;
    let guide = ContourGuide { part, mesh: part.mesh(), contours, bend, cutter, dropped, settings, monitor };
    let Reached { places, range, level, served } = guide.reached()?;
    let level = level / (level + served).max(f64::MIN_POSITIVE);
    if places.is_empty() {
        let all = settings.faces == Faces::ALL;
        let of = if all { "it" } else { "the faces with the slopes asked for" };
        return Err(refused(&format!(
            "what the cutter reaches of {of} is level or upright, so that there are no contours; zigzag suits level ground, \
             and upright walls can be cut as those of a pocket"
        )));
    }
    let mut notes = Vec::new();
    let levels = place_levels(&places, range, placing, &mut notes);
    let mut passes = along_and_between(&guide, &levels, range, settings.sampling, monitor)?;
    passes.notes.splice(0..0, notes);
    passes.faces = SERVED;
    if level > LEAST_TOLD {
        passes.notes.push(format!(
            "{:.1} % of the surface that the cutter reaches are so level that contours do not cover them; another strategy \
             suits them better",
            100.0 * level
        ));
    }
    Ok(passes)
}

fn refused(reason: &str) -> PlanError {
    PlanError::NotApplicable { strategy: super::waterline::DEFINITION.word, reason: reason.to_owned() }
}

/// A place of a contour.
#[derive(Debug, Clone, Copy)]
struct Spot {
    /// Of the cutter's axis.
    axis: Point2,
    /// What neighbouring passes may do here; `None` where a pass is of no use.
    allowed: Option<Allowed>,
}

/// What the cutter reaches of faces that face up.
#[derive(Debug)]
struct Reached {
    /// What places allow that contours serve.
    places: Vec<AllowedStep>,
    /// Least and greatest height of the tip there, mm.
    range: [f64; 2],
    /// Area that is too level, mm².
    level: f64,
    /// Area that contours serve, mm².
    served: f64,
}

impl Default for Reached {
    fn default() -> Self {
        Self { places: Vec::new(), range: [f64::INFINITY, f64::NEG_INFINITY], level: 0.0, served: 0.0 }
    }
}

/// What the cutter does to the part at one height.
struct ContourGuide<'a> {
    part: &'a Part,
    mesh: &'a TriangleMesh,
    contours: HeightContours<'a>,
    bend: Option<SurfaceCurvature<'a>>,
    cutter: &'a Cutter,
    /// What is dropped in its stead.
    dropped: &'a Cutter,
    settings: &'a PassSettings<'a>,
    monitor: &'a dyn Monitor,
}

impl ContourGuide<'_> {
    /// The interval across a contour at a place of a face, mm, and the step of heights that it is.
    fn allowed_at(&self, at: &SurfacePoint) -> Option<(Allowed, bool)> {
        let normal = at.normal;
        let slope = normal.xy().norm();
        let along = Vector3::new(-normal.y, normal.x, 0.0) / slope;
        let across = normal.cross(&along);
        let curvature = |d: &Vector3| self.bend.as_ref().and_then(|bend| bend.along(at, d)).unwrap_or(0.0);
        let step = self.settings.step;
        let (width, too_concave) = match step {
            Step::Stepover(width) => (width, false),
            Step::Scallop(h) => {
                let contact = CcPoint { point: at.point, normal };
                let rule = self.settings.axis.filter(|_| !self.cutter.is_ball());
                let axis = rule.and_then(|rule| rule.at(&contact, &along).ok());
                let [n, b] = [normal, across].map(|v| axis.map_or(v, |axis| in_tool_frame(&axis, &v)));
                let bends = FeedCurvature::of(&along, &across, curvature);
                strip_width_at(self.cutter, &n, &b, &bends, h)
            }
        };
        let width = self.settings.guide().corrected(width, &at.point, step);
        // The arc's centre goes a longer or a shorter way than the contact.
        let longer = (1.0 - curvature(&across) * self.dropped.corner_radius()).max(LEAST_FREE);
        (width > 0.0).then_some((Allowed { step: width * slope * longer, width }, too_concave))
    }

    /// What the cutter reaches of all faces.
    fn reached(&self) -> Result<Reached, PlanError> {
        let found = work::parallel::try_map(self.mesh.triangles().len(), |t| {
            monitor::check(self.monitor)?;
            Ok::<_, PlanError>(self.reached_of(t))
        })?;
        let mut all = Reached::default();
        for of_face in found {
            all.range = [all.range[0].min(of_face.range[0]), all.range[1].max(of_face.range[1])];
            all.level += of_face.level;
            all.served += of_face.served;
            all.places.extend(of_face.places);
        }
        Ok(all)
    }

    /// What the cutter reaches of a face.
    fn reached_of(&self, t: usize) -> Reached {
        let mut reached = Reached::default();
        let normal = self.mesh.normal(t);
        if normal.z < LEAST_FACING {
            return reached;
        }
        let [a, b, c] = self.mesh.corners(t);
        let to_tip = self.dropped.contact_to_tip(&normal);
        let tips = [a, b, c].map(|corner| corner.z + to_tip.z);
        let [low, high] =
            tips.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], z| [l.min(*z), h.max(*z)]);
        let heights = self.mesh.bounds().size().z.max(f64::MIN_POSITIVE);
        let parts = ((MOST_PLACES as f64 * (high - low) / heights).ceil() as usize).clamp(1, MOST_PLACES);
        let area = 0.5 * (b - a).cross(&(c - a)).norm() / (parts * parts) as f64;
        // From the middle of a part to its farthest corner.
        let half = (high - low) / parts as f64 * 2.0 / 3.0;
        for_each_part(parts, |weights| {
            let point = a + (b - a) * weights[0] + (c - a) * weights[1];
            let tip = point + to_tip;
            let rests = self.contours.drop().at(tip.x, tip.y);
            if rests.is_some_and(|rests| rests.tip_z > tip.z + HELD_OFF) {
                return;
            }
            if !self.settings.faces.hold(&normal) {
                return;
            }
            if !SERVED.hold(&normal) {
                reached.level += area;
                return;
            }
            reached.served += area;
            let at = SurfacePoint { point, normal, at: None, triangle: t as u32 };
            if let Some((Allowed { step, width }, too_concave)) = self.allowed_at(&at) {
                let [lowest, highest] = [(tip.z - half).max(low), (tip.z + half).min(high)];
                // The outer levels are half an interval inside of the ends of the range. What of an end lies
                // below its contact may reach less far down: a flat's nothing at all.
                let by_scallop = matches!(self.settings.step, Step::Scallop(_));
                let over = if by_scallop { (ROLLED_OVER - 0.5) * step } else { 0.0 };
                let reach = self.dropped.corner_radius() * normal.xy().norm().min(1.0).asin();
                let under = (0.5 - reach / width).max(0.0) * step;
                reached.range = [reached.range[0].min(lowest - under), reached.range[1].max(highest + over)];
                reached.places.push(AllowedStep {
                    psi: tip.z,
                    step,
                    length: area * step / width,
                    too_concave,
                });
            }
        });
        reached
    }

    /// What the cutter touches with its axis at a place of a contour; the range of slopes (angle from the
    /// vertical) that it has there; and how far its side begins below what it touches, mm.
    fn contact(&self, axis: &Point2, level: f64) -> (SurfacePoint, [f64; 2], f64) {
        let rests = self.contours.drop().at(axis.x, axis.y).filter(|rests| rests.tip_z > level - JUMP);
        let Some(rests) = rests else {
            // Its side holds it off.
            let low = level + self.dropped.side_height();
            let (foot, _) = self.part.closest_point(&Point3::new(axis.x, axis.y, low));
            return (foot, [0.0; 2], (foot.point.z - low).max(0.0));
        };
        let arm = (rests.contact.point.xy() - axis).norm();
        let profile = self.dropped.profile();
        let steep = |arm: f64| if arm >= profile.radius { 1.0 } else { profile.incline(arm).sin };
        let [most, least] = [arm - TriangleMesh::ON_EDGE, arm + TriangleMesh::ON_EDGE]
            .map(|arm| FRAC_PI_2 - steep(arm).min(1.0).asin());
        (rests.contact, [least, most], 0.0)
    }

    /// What a place of a contour allows; `None` where a pass is of no use.
    fn allowed_on(&self, axis: &Point2, level: f64) -> Option<Allowed> {
        let (contact, [least, most], below) = self.contact(axis, level);
        let rolled = |t: usize| {
            let normal = self.mesh.normal(t);
            let slope = normal.z.clamp(-1.0, 1.0).asin();
            SERVED.hold(&normal).then_some((
                [least - slope, slope - most].map(|angle| angle.max(0.0)),
                t,
                normal,
            ))
        };
        let faces = self.mesh.triangles_at(contact.triangle as usize, &contact.point);
        let farther = |a: &[f64; 2], b: &[f64; 2]| a[0].max(a[1]).total_cmp(&b[0].max(b[1]));
        let nearest = faces.into_iter().filter_map(rolled).min_by(|a, b| farther(&a.0, &b.0));
        let (angles, triangle, normal) = nearest?;
        let at = SurfacePoint { normal, triangle: triangle as u32, ..contact };
        let (allowed, _) = self.allowed_at(&at)?;
        let [over, under] =
            angles.map(|angle| if angle > ROUNDING { angle * self.dropped.corner_radius() } else { 0.0 });
        let is_near = over <= ROLLED_OVER * allowed.width && under + below <= ROLLED_UNDER * allowed.width;
        is_near.then_some(allowed)
    }

    /// A contour at even distances, in the stretches where passes are of use.
    fn tracks(&self, points: &[Point2], level: f64) -> Vec<Track<Spot>> {
        let n = points.len();
        let s = CubicSpline::chord_lengths(points, true);
        if n == 0 || s[n] < LEAST_LENGTH {
            return Vec::new();
        }
        let count = (s[n] / self.settings.sampling).ceil().max(5.0) as usize;
        // By the length along it, which goes round.
        let at = |along: f64| {
            let along = along.rem_euclid(s[n]);
            let k = s.partition_point(|s| *s <= along).clamp(1, n) - 1;
            let share = (along - s[k]) / (s[k + 1] - s[k]).max(f64::MIN_POSITIVE);
            points[k] + (points[(k + 1) % n] - points[k]) * share.clamp(0.0, 1.0)
        };
        let cell = self.contours.cell();
        let spot = |m: usize| {
            let along = s[n] * m as f64 / count as f64;
            let (near, way) = (at(along), at(along + cell) - at(along - cell));
            let found = self.beside(near, way, 2.0 * cell, level);
            let nowhere = Spot { axis: near, allowed: None };
            found.map_or(nowhere, |axis| Spot { axis, allowed: self.allowed_on(&axis, level) })
        };
        let spots: Vec<Spot> = (0..count).map(spot).collect();
        // A pass goes on over stretches of no use that are shorter than the cutter is wide.
        let bridged = (2.0 * self.dropped.radius() / self.settings.sampling) as usize;
        stretches(&spots, bridged)
    }

    /// The place of a contour beside one near it, where it runs along `way`.
    fn beside(&self, near: Point2, way: Vector2, reach: f64, level: f64) -> Option<Point2> {
        // The part is to the left.
        let out = Vector2::new(way.y, -way.x).try_normalize(1e-12)?;
        self.contours.beside(near, &out, reach, level)
    }
}

/// Calls with the weights of the second and the third corner at the middles of `parts`² equal parts of a
/// triangle.
fn for_each_part(parts: usize, mut call: impl FnMut([f64; 2])) {
    for i in 0..parts {
        for j in 0..parts - i {
            let upright = [i, j].map(|k| (k as f64 + 1.0 / 3.0) / parts as f64);
            call(upright);
            if i + j + 1 < parts {
                call(upright.map(|weight| weight + 1.0 / 3.0 / parts as f64));
            }
        }
    }
}

/// The stretches of a closed curve where passes are of use; those that less than so many points part are one.
fn stretches(spots: &[Spot], bridged: usize) -> Vec<Track<Spot>> {
    let n = spots.len();
    let useful = |k: usize| spots[k % n].allowed.is_some();
    // The first point of use after a gap that is too long.
    let gap_before = |k: usize| (1..=n).take_while(|back| !useful(k + n - back)).count();
    let begins = |k: usize| useful(k) && gap_before(k) > bridged;
    let Some(first) = (0..n).find(|&k| begins(k)) else {
        let all = (0..n).any(useful);
        return if all { vec![Track { points: spots.to_vec(), closed: true }] } else { Vec::new() };
    };
    let mut tracks: Vec<Track<Spot>> = Vec::new();
    for k in first..first + n {
        if begins(k) {
            tracks.push(Track { points: Vec::new(), closed: false });
        }
        if let Some(track) = tracks.last_mut() {
            track.points.push(spots[k % n]);
        }
    }
    for track in &mut tracks {
        let kept = track.points.iter().rposition(|spot| spot.allowed.is_some()).map_or(0, |k| k + 1);
        track.points.truncate(kept);
    }
    tracks.retain(|track| track.points.len() > 1);
    tracks
}

impl LevelSource for ContourGuide<'_> {
    type Place = Spot;

    fn curves(&self, level: f64) -> Vec<Track<Spot>> {
        self.contours.curves(level).iter().flat_map(|points| self.tracks(points, level)).collect()
    }

    fn allowed(&self, spot: &Spot) -> Option<Allowed> {
        spot.allowed
    }

    fn contacts(&self, _: &Track<Spot>, _: Option<[usize; 2]>) -> Vec<Contact> {
        Vec::new()
    }

    fn pass(
        &self,
        curve: &Track<Spot>,
        level: f64,
        run: Option<[usize; 2]>,
    ) -> Result<Vec<Vec<Point3>>, Cancelled> {
        let Some((spots, [first, end])) = curve.opened(run) else { return Ok(Vec::new()) };
        let mut tip = |s: f64| {
            let k = (s as usize).min(spots.len() - 2);
            let (from, t) = (spots[k].axis, s - k as f64);
            let way = spots[k + 1].axis - from;
            let near = from + way * t;
            if let Some(axis) = self.beside(near, way, way.norm(), level) {
                return Some(Point3::new(axis.x, axis.y, level));
            }
            // Around a corner too sharp to be found across its chord.
            let rests = self.contours.drop().at(near.x, near.y).map_or(level, |rests| rests.tip_z.max(level));
            Some(Point3::new(near.x, near.y, rests))
        };
        let settings = PassSettings { sampling: 1.0, ..*self.settings };
        let moves = settings.moves(first as f64, end as f64, &mut tip, self.monitor)?;
        Ok(whole_pass(moves, curve.closed && run.is_none()))
    }
}
