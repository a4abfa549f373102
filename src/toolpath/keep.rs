//! Passes where they are asked for alone: on faces of some slopes, within a boundary, and where toolpaths before
//! left too much. Of a part with level ground and walls each strategy takes what suits it, and a small cutter
//! what a larger one could not reach.
//!
//! Enters: the passes of an upright cutter over all that its strategy covers. Leaves: their stretches on which
//! the cutter touches such places, or would from an interval beside: there the passes end, and others begin.

use std::f64::consts::TAU;
use std::mem;

use crate::link::plane_interval;
use crate::vocabulary::{Faces, Passes, Places, PlanError, Rest, Task};
use cutter::Cutter;
use drop_cutter::{Drop, DropCutter};
use geometry::{Point2, Point3, Region, Vector2};
use part::Part;
use work::monitor::{self, Cancelled};

/// Directions in which an interval beside a pass is looked at.
const AROUND: usize = 8;

/// The end of a stretch is placed this closely, mm.
const END_PRECISION: f64 = 1e-6;

/// Refuses slopes that no face has.
pub(crate) fn check_faces(task: &Task<'_>) -> Result<(), PlanError> {
    let (faces, mesh) = (task.settings.faces, task.part.mesh());
    let has_any = faces == Faces::ALL || (0..mesh.triangles().len()).any(|t| faces.hold(&mesh.normal(t)));
    if has_any { Ok(()) } else { Err(PlanError::NoSuchSlope) }
}

/// Leaves of passes what serves the places that are asked for.
///
/// # Errors
/// When cancelled.
pub(crate) fn keep_asked(task: &Task<'_>, places: &Places, passes: &mut Passes) -> Result<(), PlanError> {
    let Task { part, monitor, ref settings, .. } = *task;
    let faces = settings.faces;
    if faces == Faces::ALL && *places == Places::default() {
        return Ok(());
    }
    let dropped = task.dropped();
    let interval = plane_interval(dropped, settings.step);
    let served = Served {
        part,
        drop: DropCutter::watched(part, dropped, monitor)?,
        cutter: dropped,
        faces,
        boundary: places.boundary.as_deref(),
        rest: places.rest.as_deref().map(|rest| rest.grown(interval)),
        chord_tolerance: settings.chord_tolerance,
        interval,
    };
    let all = mem::take(&mut passes.passes);
    let kept = work::parallel::try_map(all.len(), |k| {
        monitor::check(monitor)?;
        Ok::<_, Cancelled>(served.stretches(&all[k], settings.sampling))
    })?;
    passes.passes = kept.into_iter().flatten().collect();
    passes.faces = passes.faces.and(&faces);
    Ok(())
}

/// Where passes serve what is asked for.
struct Served<'a> {
    part: &'a Part,
    drop: DropCutter<'a>,
    cutter: &'a Cutter,
    faces: Faces,
    boundary: Option<&'a Region>,
    /// What is left, and an interval beside.
    rest: Option<Rest>,
    /// Of the passes, mm: beside the foot of a wall they may touch nothing.
    chord_tolerance: f64,
    /// Between passes, mm.
    interval: f64,
}

impl Served<'_> {
    /// The stretches of a pass that serve, as far as more than a point is left of them.
    fn stretches(&self, pass: &[Point3], sampling: f64) -> Vec<Vec<Point3>> {
        let (mut found, mut open) = (Vec::new(), Vec::new());
        for ends in pass.windows(2) {
            let (from, way) = (ends[0], ends[1] - ends[0]);
            let at = |t: f64| from + way * t;
            let serves = |t: f64| self.serves(at(t).xy());
            let count = (way.norm() / sampling).ceil().max(1.0) as usize;
            let mut before = (0.0, serves(0.0));
            // At a corner rounding may tell otherwise than at the end of the move before.
            if !before.1 && !open.is_empty() {
                found.push(mem::take(&mut open));
            }
            for t in (1..=count).map(|k| k as f64 / count as f64) {
                let now = (t, serves(t));
                if before.1 && open.is_empty() {
                    open.push(at(before.0));
                }
                if before.1 != now.1 {
                    let end =
                        at(change([before.0, t], END_PRECISION / way.norm(), |t| serves(t) == before.1));
                    open.push(end);
                    if before.1 {
                        found.push(mem::take(&mut open));
                    }
                }
                before = now;
            }
            if before.1 {
                open.push(ends[1]);
            }
        }
        found.push(open);
        found.retain_mut(|stretch| {
            stretch.dedup();
            stretch.len() > 1
        });
        found
    }

    /// Whether the cutter with its axis there is within the boundary and touches such a place, or would an
    /// interval beside.
    fn serves(&self, axis: Point2) -> bool {
        self.boundary.is_none_or(|boundary| boundary.contains(&axis))
            && self.rest.as_ref().is_none_or(|rest| self.touches_rest(axis, rest))
            && (self.faces == Faces::ALL || self.serves_faces(axis))
    }

    /// Of a cutter that touches at several places one tells for all: between them something is left as well.
    fn touches_rest(&self, axis: Point2, rest: &Rest) -> bool {
        self.drop.at(axis.x, axis.y).is_some_and(|rests| rest.stands(&rests.contact.point.xy()))
    }

    fn serves_faces(&self, axis: Point2) -> bool {
        let touches = |axis: Point2| {
            self.drop.at(axis.x, axis.y).is_some_and(|rests| self.faces.contain(self.upright(axis, &rests)))
        };
        let around = |far: f64| {
            (0..AROUND).any(|k| {
                let (sin, cos) = (TAU * k as f64 / AROUND as f64).sin_cos();
                touches(axis + Vector2::new(cos, sin) * far)
            })
        };
        touches(axis) || around(self.chord_tolerance) || around(self.interval)
    }

    /// The vertical part of the unit normal by which the cutter touches: on an edge its own, between those of
    /// both faces.
    fn upright(&self, axis: Point2, rests: &Drop) -> f64 {
        let (contact, mesh) = (&rests.contact, self.part.mesh());
        let around = mesh.triangles_at(contact.triangle as usize, &contact.point);
        if around.len() < 2 {
            return contact.normal.z;
        }
        let normals = around.into_iter().map(|t| mesh.normal(t).z);
        let [least, most] =
            normals.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], z| [low.min(z), high.max(z)]);
        let arm = (contact.point.xy() - axis).norm();
        self.cutter.profile().incline(arm).cos.clamp(least, most)
    }
}

/// The last place of a range, nearly, that is as its beginning.
fn change([mut same, mut other]: [f64; 2], precision: f64, is_same: impl Fn(f64) -> bool) -> f64 {
    while other - same > precision {
        let middle = 0.5 * (same + other);
        if middle <= same || middle >= other {
            break;
        }
        *(if is_same(middle) { &mut same } else { &mut other }) = middle;
    }
    same
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan;
    use crate::vocabulary::{PlanSettings, Step, Strategy};
    use crate::{LevelSteps, Objective, Plan, ShortestStreamline, Waterline, Zigzag};
    use geometry::TriangleMesh;
    use motion::MoveKind;
    use std::f64::consts::FRAC_PI_4;
    use std::sync::Arc;
    use work::monitor::Silent;

    const HALF: f64 = 4.0;
    const TOP: f64 = 8.0;

    /// A block without an underside whose walls lean by 7 degrees.
    fn block() -> Part {
        leaning(7.0)
    }

    /// A block without an underside whose walls lean by so many degrees.
    fn leaning(degrees: f64) -> Part {
        let out = TOP * degrees.to_radians().tan();
        let ring = |half: f64, z: f64| {
            [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
                .map(|[x, y]| Point3::new(x * half, y * half, z))
        };
        let points = [ring(HALF + out, 0.0), ring(HALF, TOP)].concat();
        let wall = |k: u32| [[k, (k + 1) % 4, 4 + (k + 1) % 4], [k, 4 + (k + 1) % 4, 4 + k]];
        let triangles = (0..4).flat_map(wall).chain([[4, 5, 6], [4, 6, 7]]).collect();
        Part::from_mesh(TriangleMesh::new(points, triangles).unwrap().0)
    }

    fn planned(cutter: &Cutter, strategy: &dyn Strategy, slope: [f64; 2]) -> Result<Plan, PlanError> {
        let faces = Faces::of_slopes(slope.map(f64::to_radians));
        let step = Step::Scallop(0.02);
        let settings = PlanSettings { step, stock_top: TOP + 1.0, faces, ..PlanSettings::default() };
        plan(&block(), cutter, strategy, &settings, &Silent)
    }

    fn cut_ends(plan: &Plan) -> Vec<Point3> {
        let moves = plan.path.segments().filter(|(.., m)| m.kind == MoveKind::Cut);
        moves.flat_map(|(from, to, _)| [from, to]).collect()
    }

    /// Passes for the top lie as far apart as on a plane, though the walls are steep; each ends an interval
    /// beyond the place where a ball, or a bull nose, has rolled over the edge by the steepest slope that is
    /// asked for. The plan is told of no steep places.
    #[test]
    fn passes_for_the_top_end_where_the_tool_has_rolled_over_its_edge() {
        for (cutter, corner) in [(Cutter::ball(4.0).unwrap(), 2.0), (Cutter::bull(4.0, 0.5).unwrap(), 0.5)] {
            let plan = planned(&cutter, &Zigzag::at(0.0), [0.0, 45.0]).unwrap();
            let interval = plane_interval(&cutter, Step::Scallop(0.02));
            let end = HALF + cutter.radius() - corner + corner * FRAC_PI_4.sin() + interval;
            let ends = cut_ends(&plan);
            for axis in 0..2 {
                let farthest = ends.iter().map(|p| p[axis].abs()).fold(0.0, f64::max);
                // The target is planned for less what chords may add. Planes stand half a step from the end, which
                // on the level top is wider by the flat.
                let off = if axis == 0 { 0.01 } else { interval + cutter.radius() - corner };
                assert!(farthest <= end + 1e-3 && farthest >= end - off, "{axis}: {farthest} {end}");
            }
            let mut lines: Vec<i64> = ends.iter().map(|p| (p.y * 1e3).round() as i64).collect();
            lines.sort_unstable();
            lines.dedup();
            let most = (2.0 * end / interval).ceil() as usize + 3;
            assert!(lines.len() <= most, "{} {most}", lines.len());
            assert!(plan.notes.iter().all(|note| !note.contains("steepest")), "{:?}", plan.notes);
            let all = planned(&cutter, &Zigzag::at(0.0), [0.0, 90.0]).unwrap();
            let more = cut_ends(&all).len() as f64 / ends.len() as f64;
            assert!(more > 1.0, "{more}");
        }
    }

    /// A streamline over a top whose walls are not asked for is that of the top alone, to an interval beyond its
    /// rim.
    #[test]
    fn streamlines_are_planned_for_the_faces_that_are_asked_for() {
        let cutter = Cutter::ball(4.0).unwrap();
        let strategy = ShortestStreamline { toward: None, objective: Objective::Length };
        let length = |degrees: f64| {
            let faces = Faces::of_slopes([0.0, 0.5]);
            let step = Step::Scallop(0.02);
            let settings = PlanSettings { step, stock_top: TOP + 1.0, faces, ..PlanSettings::default() };
            let plan = plan(&leaning(degrees), &cutter, &strategy, &settings, &Silent).unwrap();
            plan.kept.passes.iter().flat_map(|p| p.windows(2)).map(|w| (w[1] - w[0]).norm()).sum::<f64>()
        };
        // Walls that lean by 7 degrees are no matter to streamlines, others are faces as any.
        let [top, leaning] = [7.0, 45.0].map(length);
        println!("{top} {leaning}");
        assert!(leaning < 1.05 * top, "{leaning} {top}");
    }

    /// Contours follow the walls alone whatever is asked for: asked for those they stay as they are, beside
    /// the foot as well, where a pass that is off by its tolerance touches nothing. Asked for the top nothing
    /// is left of them.
    #[test]
    fn contours_of_walls_stay_whole() {
        for cutter in [Cutter::ball(4.0), Cutter::bull(4.0, 0.5), Cutter::flat(4.0)].map(Result::unwrap) {
            let all = planned(&cutter, &Waterline { steps: LevelSteps::Shortest }, [0.0, 90.0]).unwrap();
            let walls = planned(&cutter, &Waterline { steps: LevelSteps::Shortest }, [45.0, 90.0]).unwrap();
            assert_eq!(walls.path, all.path);
            assert!(planned(&cutter, &Waterline { steps: LevelSteps::Shortest }, [0.0, 45.0]).is_err());
        }
    }

    /// Two tops apart from each other: each is told of with its own place.
    #[test]
    fn remarks_on_pieces_of_a_mesh_name_them() {
        let mut points = Vec::new();
        for x in [0.0, 40.0] {
            points.extend(
                [[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]].map(|[u, v]| Point3::new(x + u, v, 0.0)),
            );
        }
        let mesh = TriangleMesh::new(points, vec![[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]]).unwrap().0;
        let strategy = ShortestStreamline { toward: None, objective: Objective::Length };
        let settings = PlanSettings { step: Step::Scallop(0.05), ..PlanSettings::default() };
        let part = Part::from_mesh(mesh);
        let found = plan(&part, &Cutter::ball(6.0).unwrap(), &strategy, &settings, &Silent).unwrap();
        for place in ["x 0.0 to 10.0 y 0.0 to 10.0", "x 40.0 to 50.0 y 0.0 to 10.0"] {
            let told = format!(
                "on the surface at {place}: passes follow the stream function of the shortest path: "
            );
            let of_it = found.notes.iter().filter(|note| note.starts_with(&told));
            assert_eq!(of_it.count(), 1, "{:?}", found.notes);
        }
    }

    /// A boundary beside the part.
    #[test]
    fn an_empty_program_is_told_by_its_boundary() {
        let corners = [[50.0, 50.0], [60.0, 50.0], [60.0, 60.0]].map(|[x, y]| Point2::new(x, y));
        let (boundary, _) = Region::nested(vec![corners.to_vec()]).unwrap();
        let places = Places { boundary: Some(Arc::new(boundary)), rest: None };
        let settings = PlanSettings {
            step: Step::Scallop(0.02),
            stock_top: TOP + 1.0,
            places,
            ..PlanSettings::default()
        };
        let found =
            plan(&block(), &Cutter::ball(4.0).unwrap(), &Zigzag::at(0.0), &settings, &Silent).unwrap();
        let told = "no pass reaches the part within `boundary`: the program is empty";
        assert!(found.path.is_empty() && found.notes.iter().any(|note| note == told), "{:?}", found.notes);
    }

    #[test]
    fn slopes_that_no_face_has_are_refused() {
        let refused = planned(&Cutter::ball(4.0).unwrap(), &Zigzag::at(0.0), [20.0, 80.0]);
        assert_eq!(refused.unwrap_err(), PlanError::NoSuchSlope);
    }
}
