//! The least distance between a tool or another body and a mesh on a whole path.
//!
//! Enters: a solid, a path, an obstacle. Leaves: the move and the place where they come nearest, with a
//! bound, mm. A bound on the whole is known from a few locations before the search begins, so that most moves
//! are settled by one look.

use cutter::Solid;
use motion::{Move, Toolpath};
use work::monitor::{Cancelled, Monitor, check};
use work::parallel;

use super::piece::Convex;
use super::sweep::{Moving, RESOLUTION, ToolMove};
use super::{Clearance, Obstacle};

/// Locations of the path at which the tool is looked at first. More cost a full search each, fewer leave more
/// moves to look at closely.
const FIRST_LOOKS: usize = 64;

/// Moves that one worker looks at on its own. Each worker begins with what the first looks found.
const CHUNK_MOVES: usize = 1024;

/// Looks at one move at most. Each leaves a hundredth of what it found to be missing.
const MOST_LOOKS: usize = 20;

/// A tool that is in the mesh is followed to where it is deeper by this share, and by this length, mm, and no
/// further: the program is refused anyway, and many places of a tool that ploughs are about as deep.
const DEEPER_SHARE: f64 = 0.1;
const DEEPER: f64 = 0.001;

/// Where a tool comes nearest to an obstacle, or is deepest in it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeastClearance {
    /// Index of the move.
    pub move_index: usize,
    /// When on the move, from 0 to 1.
    pub t: f64,
    /// How near, and where on the mesh.
    pub nearest: Clearance,
    /// No other time of the path is nearer by more than this, mm. Of a tool in the mesh it is a tenth of the
    /// depth and more, and infinite where even that is left open.
    pub error_bound: f64,
}

impl Obstacle<'_> {
    /// The least signed distance between `solid` and the mesh on the moves of `path` that `chosen` picks;
    /// `None` without such moves.
    ///
    /// A tool that begins wholly inside a closed mesh is as deep in it as its tip.
    ///
    /// # Errors
    /// [`Cancelled`] when the monitor says so.
    ///
    /// # Tolerance
    /// See [`LeastClearance::error_bound`]; 1e-5 mm unless the tool ploughs through the mesh.
    pub fn least_clearance(
        &self,
        solid: &Solid,
        path: &Toolpath,
        chosen: &(dyn Fn(&Move) -> bool + Sync),
        monitor: &dyn Monitor,
    ) -> Result<Option<LeastClearance>, Cancelled> {
        let moves: Vec<usize> = (0..path.len()).filter(|&k| chosen(&path.moves[k])).collect();
        let moving =
            |k: usize| ToolMove { solid, ends: [path.location_before(moves[k]), path.moves[moves[k]].to] };
        let least = self.least(moves.len(), &moving, monitor)?;
        Ok(least.map(|least| LeastClearance { move_index: moves[least.move_index], ..least }))
    }

    /// As [`Obstacle::least_clearance`], of any body on so many moves.
    pub(crate) fn least<M: Moving>(
        &self,
        moves: usize,
        moving: &(impl Fn(usize) -> M + Sync),
        monitor: &dyn Monitor,
    ) -> Result<Option<LeastClearance>, Cancelled> {
        if moves == 0 {
            return Ok(None);
        }
        if let Some(nearest) = self.swallowed(&moving(0).piece(0, 0.0).origin()) {
            let error_bound = f64::INFINITY;
            return Ok(Some(LeastClearance { move_index: 0, t: 0.0, nearest, error_bound }));
        }
        let looks = (0..moves).step_by(moves.div_ceil(FIRST_LOOKS)).map(|k| (k, moving(k)));
        let found = looks.filter_map(|(move_index, moving)| {
            let mut nearest = None;
            for index in 0..moving.pieces() {
                Obstacle::nearest(self, &moving.piece(index, 0.0), f64::INFINITY, &mut nearest);
            }
            let nearest = nearest?;
            let error_bound = RESOLUTION + left_open(nearest.distance);
            Some(LeastClearance { move_index, t: 0.0, nearest, error_bound })
        });
        let Some(seed) = found.reduce(nearer) else { return Ok(None) };
        let of_chunks = parallel::try_map(moves.div_ceil(CHUNK_MOVES), |chunk| {
            let mut least = seed;
            for k in chunk * CHUNK_MOVES..((chunk + 1) * CHUNK_MOVES).min(moves) {
                check(monitor)?;
                self.lower(&moving(k), k, &mut least);
            }
            Ok::<_, Cancelled>(least)
        })?;
        // What a worker left open of a depth is open for all only where no other found it deeper.
        let reached = |least: &LeastClearance| least.nearest.distance - least.error_bound;
        let lowest = of_chunks.iter().map(reached).fold(f64::INFINITY, f64::min);
        let least = of_chunks.into_iter().reduce(nearer);
        Ok(least.map(|least| LeastClearance { error_bound: least.nearest.distance - lowest, ..least }))
    }

    /// Lowers `least` to the nearest of one move.
    fn lower<M: Moving>(&self, moving: &M, k: usize, least: &mut LeastClearance) {
        for _ in 0..MOST_LOOKS {
            let margin = left_open(least.nearest.distance);
            let Some(hit) = self.swept(moving, least.nearest.distance - margin) else { return };
            let error_bound = RESOLUTION + left_open(hit.nearest.distance);
            *least = LeastClearance { move_index: k, t: hit.t, nearest: hit.nearest, error_bound };
            if !hit.nearest.distance.is_finite() {
                return;
            }
        }
        least.error_bound = f64::INFINITY;
    }

    /// The surface nearest to a place inside a closed mesh.
    fn swallowed(&self, place: &geometry::Point3) -> Option<Clearance> {
        if !self.mesh.is_closed() {
            return None;
        }
        let foot = self.bvh.closest_point(self.mesh, place);
        let distance = foot.signed_distance;
        (distance < 0.0).then_some(Clearance { distance, place: foot.point, triangle: foot.triangle })
    }
}

/// How much deeper a tool may be than found, mm.
fn left_open(distance: f64) -> f64 {
    if distance < 0.0 { DEEPER - DEEPER_SHARE * distance } else { 0.0 }
}

/// The nearer of two; of two as near the earlier.
fn nearer(a: LeastClearance, b: LeastClearance) -> LeastClearance {
    if b.nearest.distance < a.nearest.distance { b } else { a }
}

#[cfg(test)]
mod tests {
    use super::super::samples::*;
    use super::*;
    use cutter::{Cutter, Holder, HolderSection};
    use geometry::{Point3, Vector3};
    use motion::{ClPoint, MoveKind};
    use work::monitor::Silent;

    fn path(tips: impl IntoIterator<Item = [f64; 3]>) -> Toolpath {
        let mut places = tips.into_iter().map(|tip| ClPoint::upright(Point3::from(tip)));
        let start = places.next().unwrap();
        let cut = |to| Move { to, kind: MoveKind::Cut, feed_rate: 1000.0, pass: 0 };
        Toolpath::new(start, places.map(cut).collect())
    }

    fn least(obstacle: &Obstacle<'_>, solid: &Solid, path: &Toolpath) -> LeastClearance {
        obstacle.least_clearance(solid, path, &|_| true, &Silent).unwrap().unwrap()
    }

    /// A zigzag beside a post: the pass beside it comes nearest, by what was planned.
    #[test]
    fn the_nearest_move_of_many_has_its_closed_form() {
        let (post, tree) = block([12.05, 9.0, -50.0], [14.0, 11.0, 50.0]);
        let post = Obstacle::new(&post, &tree);
        let holder = Solid::of_holder(
            &Holder::new(30.0, vec![HolderSection { diameter: 24.0, top_diameter: 24.0, length: 30.0 }])
                .unwrap(),
        );
        let passes = (0..3000).map(|k| {
            let (pass, end) = (k / 2, (k / 2 + k) % 2);
            [-f64::from(pass) * 0.01, 30.0 * f64::from(end), 0.0]
        });
        let found = least(&post, &holder, &path(passes));
        assert_eq!(found.move_index, 0);
        assert!((found.nearest.distance - 0.05).abs() <= found.error_bound, "{found:?}");
        assert!(found.error_bound <= 1.001e-5 && (found.nearest.place.x - 12.05).abs() < 1e-9, "{found:?}");
        let into = least(&post, &holder, &path([[0.1, 0.0, 0.0], [0.1, 30.0, 0.0]]));
        assert!((into.nearest.distance + 0.05).abs() <= 0.01 * 0.05, "{into:?}");
    }

    #[test]
    fn a_tool_that_begins_inside_a_closed_mesh_collides() {
        let (vise, tree) = block([-90.0; 3], [90.0; 3]);
        let ball = Solid::of_cutter(&Cutter::ball(6.0).unwrap(), None);
        let inside = path([[0.0, 0.0, 70.0], [1.0, 0.0, 70.0]]);
        let found = least(&Obstacle::new(&vise, &tree), &ball, &inside);
        assert_eq!((found.move_index, found.nearest.distance), (0, -20.0));
    }

    /// Against the least of every move alone, which is tested against samples of the time.
    #[test]
    fn the_least_of_a_path_is_that_of_its_moves() {
        let (field, tree) = sheet(40.0, 24, |x, y| 3.0 * (0.3 * x).sin() * (0.2 * y).cos());
        let wave = Obstacle::new(&field, &tree);
        let mut numbers = Numbers(21);
        for solid in solids().iter().step_by(3) {
            let mut at = || ClPoint {
                tip: numbers.point(12.0) + Vector3::z() * 9.0,
                axis: (numbers.direction() + Vector3::z() * 1.5).normalize(),
            };
            let start = at();
            let moves = (0..20).map(|_| Move { to: at(), kind: MoveKind::Cut, feed_rate: 1.0, pass: 0 });
            let path = Toolpath::new(start, moves.collect());
            let found = least(&wave, solid, &path);
            let of_moves = (0..path.len()).filter_map(|k| {
                wave.swept_clearance(solid, &path.location_before(k), &path.moves[k].to, 30.0)
            });
            let least = of_moves.map(|hit| hit.nearest.distance).fold(30.0, f64::min);
            let reached =
                path.location_before(found.move_index).towards(&path.moves[found.move_index].to, found.t);
            let there = wave.clearance(solid, &reached, 30.0).unwrap().distance;
            assert!(found.nearest.distance <= least + found.error_bound, "{found:?} {least}");
            assert!((there - found.nearest.distance).abs() < 1e-9, "{found:?} {there}");
            if found.nearest.distance > 0.0 {
                assert!(found.error_bound <= 1.001 * RESOLUTION, "{found:?}");
            }
        }
    }

    #[test]
    fn a_path_without_chosen_moves_has_none_and_a_search_can_be_stopped() {
        struct Stop;
        impl Monitor for Stop {
            fn cancelled(&self) -> bool {
                true
            }
        }
        let (cube, tree) = block([-5.0; 3], [5.0; 3]);
        let (cube, ball) = (Obstacle::new(&cube, &tree), Solid::of_cutter(&Cutter::ball(6.0).unwrap(), None));
        let way = path([[9.0, 0.0, 0.0], [9.0, 1.0, 0.0]]);
        assert_eq!(cube.least_clearance(&ball, &way, &|_| false, &Silent), Ok(None));
        assert_eq!(cube.least_clearance(&ball, &way, &|_| true, &Stop), Err(Cancelled));
    }
}
