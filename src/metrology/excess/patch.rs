//! What stands at most above the part within one square of the plan.

use std::borrow::Cow;

use super::meets;
use super::outline::{MOST_CORNERS, Outline, cut_off, has_area, middle, outlines, overlaps};
use crate::cut_surface::CutSurface;
use crate::facing::LEAST_FACING;
use crate::inspection::Inspection;
use cutter::Cutter;
use geometry::{Point2, Point3, Vector2, Vector3};
use motion::ROUNDING;
use part::SurfacePoint;
use sim::NOT_CUT;

/// Triangles of the part that are looked at in one square. One with more of them is divided unseen.
const MOST_TRIANGLES: usize = 48;

/// Moves that are weighed, the lowest in the middle. With fewer, places where several passes meet take more
/// divisions.
const MOST_MOVES: usize = 5;

/// Moves that are followed along a path to the lowest one. Cells show one of so many short ones.
const MOST_BESIDE: usize = 16;

/// Heights that differ by less, mm, are one level.
const LEVEL: f64 = 1e-9;

/// Where more moves than this may cut, not all of them are asked in a square as large as a cell: each takes
/// some 5 ns, in hundreds of thousands of squares. In smaller ones that nothing else decides, more are, and
/// in the smallest all.
const MOST_ASKED: usize = 4096;

/// Moves that are found to have cut away what seems to stand on a place, one after the other.
const MOST_ON_THE_WAY: usize = 8;

/// Of these the lowest are asked whether they pass all of a square.
const MOST_LOW: usize = 64;

/// Heights above a wall's, in sizes of the square along the normal, that are looked at for free space beyond
/// it.
const BEYOND_WALL: [f64; 3] = [2.0, 8.0, 32.0];

/// Normals that lean less, by their part in the plan, lead over walls too late.
const LEAST_ASIDE: f64 = 1e-3;

/// What may rise by so many times the size of a square is no slope: a wall stands there, or a foil.
pub(super) const STEEPEST: f64 = 100.0;

/// Patches are measured elsewhere where they are steeper than faces of meshes that are, by this: what is
/// measured elsewhere is told by the middles of small triangles.
const STEEP_PATCH_SHARE: f64 = 0.75;

/// In squares with half sides below this share of a cell all triangles are looked at.
const CORNER_SHARE: f64 = 1.0 / 256.0;

/// How often a greater height is assumed.
const MOST_REACHES: usize = 6;

/// How often a height that is enough is lowered to what it leaves. Each time the rest shrinks by the slope of
/// the design times that of the cut.
const MOST_LOWERED: usize = 4;

/// Lowering ends where it gains less than this share of what stands over the place looked at.
const LITTLE_GAIN: f64 = 0.1;

/// Between its corners a smooth surface may leave a tangent plane, and its normals turn, by so many times as
/// much as there.
const BETWEEN_CORNERS: f64 = 1.25;

/// The rim of a cutter may end beside the end of the part by the last decimal of a program, and leave a foil
/// that is no material. Squares with half sides below this, mm, tell the foil from the rest.
pub(super) const LEAST_HALF: f64 = ROUNDING;

/// What a square holds.
pub(super) enum Held {
    /// No surface that is seen from above.
    Nothing,
    /// Too much to tell.
    Unknown,
    /// Surface.
    Some {
        /// No place in it is higher, mm.
        possible: f64,
        /// A place of the surface in it.
        place: Point2,
        /// The height there, mm.
        here: f64,
        /// The move that cut there.
        by: u32,
    },
}

/// A polygon of the plan with the plane that the design lies on there, or above.
struct Clipped {
    corners: [Point2; MOST_CORNERS],
    len: usize,
    /// Plan parts of the design's normals at the corners, moved away from the middle by what normals between
    /// them may turn more.
    leans: [Vector2; MOST_CORNERS],
    /// On the design, within the polygon.
    foot: SurfacePoint,
    /// How far the design may lie below the plane, mm.
    below: f64,
    /// Least cosine between normals in the polygon and that of the plane.
    cosine: f64,
    /// Where more moves may cut, not all of them are asked.
    most_asked: usize,
}

/// Evaluates squares.
pub(super) struct Patches<'a> {
    pub inspection: &'a Inspection<'a>,
    pub stock_top: f64,
    /// Heights up to this, mm, are of no account: what may stand is told at least that high.
    pub least: f64,
    /// Moves that no cell shows.
    pub unseen: &'a [u32],
}

impl Patches<'_> {
    /// What the square around a centre holds.
    pub fn held(&self, centre: Point2, half: f64) -> Held {
        // Around a corner where more of them meet no square is small enough.
        let small = half < CORNER_SHARE * self.inspection.grid.cell;
        let most = if small { usize::MAX } else { MOST_TRIANGLES };
        let Some(triangles) = self.triangles(centre, half, most) else { return Held::Unknown };
        let share = 0.5 * self.inspection.grid.cell / half;
        let most_asked = if small { usize::MAX } else { (MOST_ASKED as f64 * share) as usize };
        let mut held: Option<(f64, Point2, f64, u32)> = None;
        for &t in &triangles {
            for outline in outlines(self.inspection.part, t, centre, half).into_iter().flatten() {
                let Some(piece) = self.piece(t, outline, most_asked) else { continue };
                let Some((possible, here, by)) = self.above(&piece, half, small) else {
                    if half < LEAST_HALF && self.ends_beside(centre) {
                        continue;
                    }
                    return Held::Unknown;
                };
                let place = piece.foot.point.xy();
                // Where facets meet in a square, no line cuts off what a wall accounts for.
                let here = self.inspection.walls.map_or(here, |walls| walls.beside(&piece.foot.point, here));
                held = Some(match held {
                    None => (possible, place, here, by),
                    Some((most, at, highest, its)) => {
                        let (at, highest, its) =
                            if here > highest { (place, here, by) } else { (at, highest, its) };
                        (most.max(possible), at, highest, its)
                    }
                });
            }
        }
        held.map_or(Held::Nothing, |(possible, place, here, by)| Held::Some { possible, place, here, by })
    }

    /// Whether the part ends within the rounding of a program of a place.
    pub fn ends_beside(&self, place: Point2) -> bool {
        around(place, 2.0 * ROUNDING).iter().any(|q| self.inspection.part.highest_at(q.x, q.y).is_none())
    }

    /// Nothing stands higher than this above the design, mm.
    pub fn most(&self) -> f64 {
        (self.stock_top - self.inspection.part.bounds().min.z).max(0.0)
    }

    /// True where the cutter fits, and what stands is no higher than what may be uncut, or the pass that cut
    /// came down to the design nearby.
    pub fn reached(&self, at: Point2, height: f64, by: u32) -> bool {
        let Inspection { part, cutters, surface, limits, .. } = *self.inspection;
        let Some(design) = part.highest_at(at.x, at.y) else { return false };
        by != NOT_CUT && {
            let cutter = cutters.of_move(by);
            let from_contact = cutter.contact_to_tip(&design.normal);
            if !self.fits(cutter, &(design.point + from_contact)) {
                return false;
            }
            let tip = surface.nearest_tip(by, &(design.point + from_contact));
            let contact = tip - from_contact;
            let (nearest, off) = part.closest_point(&contact);
            let most = limits.scallop.min(limits.uncut);
            // A pass beyond a border serves the ground inside of it, as far as that is level with the border.
            let beyond = |point: &Point3, normal: &Vector3| (contact - point).dot(normal).abs() <= most;
            height <= limits.uncut
                || off <= most
                || beyond(&nearest.point, &nearest.normal) && beyond(&design.point, &design.normal)
        }
    }

    /// Whether a cutter with its tip there keeps out of the part, as far as some places around its axis tell.
    fn fits(&self, cutter: &Cutter, tip: &Point3) -> bool {
        const RINGS: [f64; 4] = [0.25, 0.5, 0.75, 0.97];
        const AROUND: u32 = 12;
        let Inspection { part, limits, .. } = *self.inspection;
        let clear = |radius: f64, angle: f64| {
            let q = tip.xy() + Vector2::new(angle.cos(), angle.sin()) * radius;
            let least = tip.z + cutter.profile().height(radius) + limits.scallop.min(limits.gouge);
            part.highest_at(q.x, q.y).is_none_or(|design| design.point.z <= least)
        };
        let turn = std::f64::consts::TAU / f64::from(AROUND);
        RINGS.iter().all(|share| (0..AROUND).all(|k| clear(share * cutter.radius(), turn * f64::from(k))))
    }

    /// Triangles that face up and whose boxes meet the square; `None` if there are too many.
    fn triangles(&self, centre: Point2, half: f64, most: usize) -> Option<Vec<usize>> {
        let part = self.inspection.part;
        let (mesh, bvh, steepest) = (part.mesh(), part.bvh(), self.inspection.steepest);
        // A patch ends so far beside its triangles.
        let half = half + part.mesh_deviation();
        let (mut found, mut waiting) = (Vec::new(), vec![0]);
        while let Some(index) = waiting.pop() {
            let node = bvh.tree().node(index);
            if !meets(node, centre, half) {
                continue;
            }
            let (first, slots) = node.slots_or_children();
            if slots == 0 {
                waiting.extend([first + 1, first]);
                continue;
            }
            if found.len() > most {
                return None;
            }
            for slot in first..first + slots {
                let t = bvh.triangle_in(slot);
                let normal = mesh.normal(t).z;
                // The normals of a patch differ from that of its triangle.
                let is_own = normal >= steepest || !part.patches().is_empty();
                if normal > LEAST_FACING && is_own && overlaps(&mesh.corners(t), centre, half) {
                    found.push(t);
                }
            }
        }
        (found.len() <= most).then_some(found)
    }

    /// The design within a polygon of a triangle, where it is seen from above.
    fn piece(&self, t: usize, outline: Outline, most_asked: usize) -> Option<Clipped> {
        let part = self.inspection.part;
        let (first, normal) = (part.mesh().corners(t)[0], part.mesh().normal(t));
        let height =
            |q: &Point2| first.z - (normal.x * (q.x - first.x) + normal.y * (q.y - first.y)) / normal.z;
        let Outline { corners, len, is_at_end } = self.beyond_walls(outline, &height)?;
        let middle = middle(&corners[..len]);
        let near = 2.0 * part.mesh_deviation() / normal.z.max(1e-3) + 1e-6;
        let on_facet = |q: &Point2| {
            let point = Point3::new(q.x, q.y, height(q));
            (SurfacePoint { point, normal, at: None, triangle: t as u32 }, 0.0)
        };
        let own = |q: &Point2| match part.on_patch_of(t, q.x, q.y) {
            Some((foot, aside)) if (foot.point.z - height(&foot.point.xy())).abs() <= near => (foot, aside),
            // The descent went astray, to another sheet of the patch.
            Some(_) => part.highest_at(q.x, q.y).map_or_else(|| on_facet(q), |top| (top, 0.0)),
            None => on_facet(q),
        };
        let (foot, aside) = own(&middle);
        if is_at_end && corners[..len].iter().all(|corner| (corner - middle).norm() < aside) {
            return None;
        }
        let is_seen = |foot: &SurfacePoint| {
            let top = part.highest_at(foot.point.x, foot.point.y);
            top.is_none_or(|top| top.point.z - foot.point.z <= near)
        };
        // Just inside the corners, where the next triangle does not answer.
        let inside = |corner: &Point2| own(&(corner + (middle - corner) * 1e-3)).0;
        let foot = std::iter::once(foot).chain(corners[..len].iter().map(inside)).find(is_seen)?;
        let leans = [foot.normal.xy(); MOST_CORNERS];
        let mut piece = Clipped { corners, len, leans, foot, below: 0.0, cosine: 1.0, most_asked };
        if !part.patches().is_empty() {
            piece.bend(&|corner| own(corner).0);
            let turned = (2.0 * (1.0 - piece.cosine)).sqrt();
            if piece.foot.normal.z + turned < STEEP_PATCH_SHARE * self.inspection.steepest {
                return None;
            }
        }
        Some(piece)
    }

    /// The part of a polygon of floor that no wall before it accounts for; `None` where there is none.
    fn beyond_walls(&self, outline: Outline, height: &dyn Fn(&Point2) -> f64) -> Option<Outline> {
        let Some(walls) = self.inspection.walls else { return Some(outline) };
        let Outline { mut corners, mut len, is_at_end } = outline;
        let q = middle(&corners[..len]);
        let all = corners;
        for (from, toward) in walls.lines(&Point3::new(q.x, q.y, height(&q)), &all[..len]) {
            if len == MOST_CORNERS {
                break;
            }
            cut_off(&mut corners, &mut len, |p| (from - p).dot(&toward));
            if len == 0 {
                return None;
            }
        }
        has_area(&corners[..len]).then_some(Outline { corners, len, is_at_end })
    }

    /// What stands above a piece of a square at most, and what stands on its foot, cut by which move; `None`
    /// where that cannot be told. All moves are asked where those that cells show tell nothing, or where
    /// another one cut what they leave, and in a `small` square where they leave a wall.
    fn above(&self, piece: &Clipped, half: f64, small: bool) -> Option<(f64, f64, u32)> {
        let SurfacePoint { point, normal, .. } = &piece.foot;
        let hidden = self.hidden(point, normal);
        let shown = self.above_with(piece, half, hidden.clone(), None);
        let is_wall = |possible: f64, here: f64| possible > self.wall_over(here, half);
        let stands = |here: f64| here <= self.least || self.cut_away_below(piece, here).is_none();
        if shown.is_some_and(|(possible, here, _)| stands(here) && !(small && is_wall(possible, here))) {
            return shown;
        }
        let lowest = self.lowest_of_all(piece, 0.0);
        let by_all = lowest.and_then(|lowest| self.above_with(piece, half, hidden, Some(&lowest)));
        // Each is a bound.
        let least = |shown: (f64, f64, u32), all: (f64, f64, u32)| (shown.0.min(all.0), all.1, all.2);
        [shown, by_all].into_iter().flatten().reduce(least)
    }

    /// The move that cut away what seems to stand so high, mm, over the foot of a piece; `None` also where
    /// there are too many to ask.
    fn cut_away_below(&self, piece: &Clipped, height: f64) -> Option<u32> {
        let foot = &piece.foot;
        self.asked(piece, (foot.point + foot.normal * height).xy())?;
        self.inspection.every_move?.cuts_away_over(foot, height)
    }

    /// All moves that may cut at a place by a piece; `None` where there are too many to ask.
    fn asked(&self, piece: &Clipped, q: Point2) -> Option<&[u32]> {
        let all = self.inspection.every_move?.over(q);
        (all.len() <= piece.most_asked).then_some(all)
    }

    /// What stands higher in a square than this, on a foot where so much stands, stands behind a wall.
    fn wall_over(&self, here: f64, half: f64) -> f64 {
        here.max(self.least).max(0.0) + STEEPEST * half
    }

    /// Of all moves the lowest over the foot of a piece that rose to a height, and the lowest of those that
    /// pass all of it; `None` where there are too many to ask.
    fn lowest_of_all(&self, piece: &Clipped, height: f64) -> Option<Vec<u32>> {
        let envelope = &self.inspection.surface.envelope;
        let q = piece.foot.point.xy() + piece.foot.normal.xy() * height;
        // What passes above the stock cuts nothing.
        let over = |&by: &u32| Some((envelope.height(by, q.x, q.y).filter(|z| *z < self.stock_top)?, by));
        let all = self.asked(piece, q)?;
        let mut low: Vec<(f64, u32)> = all.iter().filter_map(over).collect();
        let order = |a: &(f64, u32), b: &(f64, u32)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
        if low.len() > MOST_LOW {
            low.select_nth_unstable_by(MOST_LOW, order);
            low.truncate(MOST_LOW);
        }
        low.sort_unstable_by(order);
        let corners = piece.corners.iter().zip(&piece.leans).take(piece.len);
        let passes_all = |by: u32| {
            corners.clone().all(|(corner, lean)| {
                let q = corner + lean * height;
                envelope.height(by, q.x, q.y).is_some()
            })
        };
        let passing = low.iter().skip(1).map(|low| low.1).filter(|by| passes_all(*by)).take(MOST_MOVES);
        Some(low.first().map(|low| low.1).into_iter().chain(passing).collect())
    }

    /// As [`Self::above`], by the moves that cells show and some `hidden` ones; where the lowest of all moves
    /// over the foot are told, by all.
    fn above_with(
        &self,
        piece: &Clipped,
        half: f64,
        mut hidden: Cow<'_, [u32]>,
        lowest: Option<&[u32]>,
    ) -> Option<(f64, f64, u32)> {
        let surface = self.inspection.surface;
        let SurfacePoint { point, normal, .. } = &piece.foot;
        // Where no move passes stock stands.
        let is_stock = lowest.is_some_and(<[u32]>::is_empty) && surface.cut.shape.is_none();
        let stock = if is_stock { self.stock_top } else { f64::INFINITY };
        if let Some(lowest) = lowest {
            hidden.to_mut().extend(lowest);
        }
        let all = lowest.is_some();
        let mut here = surface.along_normal_below(stock, point, normal, &hidden)?;
        if here.distance > self.least {
            // Short moves between cells may have cut away what seems to stand so high.
            let beside = self.beside(&(point + normal * here.distance), &hidden);
            if !beside.is_empty() {
                hidden = Cow::Owned(hidden.iter().copied().chain(beside).collect());
                here = surface.along_normal_below(stock, point, normal, &hidden)?;
            }
        }
        // And so may others on the way to where the line comes out.
        for _ in 0..if all { MOST_ON_THE_WAY } else { 0 } {
            let Some(by) = self.cut_away_below(piece, here.distance) else { break };
            hidden.to_mut().push(by);
            here = surface.along_normal_below(stock, point, normal, &hidden)?;
        }
        // Lower places of the square are of no account.
        let known = here.distance.max(self.least).max(0.0);
        let mut free = self.by_moves(piece, known, here.by, &hidden, all);
        let is_wall = |free: Option<f64>| free.is_none_or(|p| p > self.wall_over(here.distance, half));
        // No known move passes all of the square, though one cut its middle.
        let stock = (self.stock_top - point.z) * normal.z;
        let is_unpassed = here.distance < stock && free.is_none_or(|possible| possible >= stock);
        if (is_unpassed || is_wall(free))
            && let Some(nearest) = self.nearest_of_lowest(piece, &(point + normal * known))
        {
            hidden.to_mut().push(nearest);
            free = self.by_moves(piece, known, here.by, &hidden, all);
        }
        let is_wall = is_wall(free);
        let wall = if is_wall { self.beside_wall(piece, half, known, &hidden, all) } else { None };
        let possible = [free, wall].into_iter().flatten().reduce(f64::min)?;
        Some((possible.max(known), here.distance, here.by))
    }

    /// What stands above a piece at most, where so much is `known` to, by the moves that cover all of it.
    fn by_moves(&self, piece: &Clipped, known: f64, first: u32, hidden: &[u32], all: bool) -> Option<f64> {
        let upright = piece.leans[..piece.len].iter().all(|lean| lean.norm() < 1e-12);
        // What stands so high stands aside of its place.
        let mut moves = self.moves(&(piece.foot.point + piece.foot.normal * known), first, hidden);
        if all {
            moves.extend(self.lowest_of_all(piece, known).into_iter().flatten());
        }
        let over = |reach: f64| self.over(piece, &moves, [known, reach]);
        let mut reach = 1.2 * known + 1e-4;
        // The cut over a place stands aside of it by its height times its lean: heights from the known one to
        // the assumed one are looked at, and the latter must be enough.
        for _ in 0..MOST_REACHES {
            let possible = over(reach);
            if upright {
                return Some(possible);
            }
            if possible <= reach {
                return Some(lowered(possible, known, &over));
            }
            reach = 1.5 * possible;
        }
        None
    }

    /// The rim of a flat leaves a wall, across which no move bounds a square: what is free just beyond it,
    /// along all normals of the square, bounds what stands below; `None` where none is found.
    fn beside_wall(&self, piece: &Clipped, half: f64, known: f64, hidden: &[u32], all: bool) -> Option<f64> {
        let SurfacePoint { point, normal, .. } = &piece.foot;
        let aside = normal.xy().norm().max(LEAST_ASIDE);
        BEYOND_WALL.iter().map(|times| known + times * half / aside).find(|&height| {
            let mut moves = self.moves(&(point + normal * height), NOT_CUT, hidden);
            if all {
                moves.extend(self.lowest_of_all(piece, height).into_iter().flatten());
            }
            self.over(piece, &moves, [height; 2]) <= height
        })
    }

    /// Moves that no cell may show: those that were found so far, and where passes are nearer to each other
    /// than cells, those that touch the design nearby.
    fn hidden(&self, point: &Point3, normal: &Vector3) -> Cow<'_, [u32]> {
        let Inspection { surface, .. } = *self.inspection;
        let (i, j) = surface.cut.grid.nearest_cell(point.x, point.y);
        let k = surface.cut.grid.index(i, j);
        if self.inspection.is_crowded(k, 1) {
            let passing = self.inspection.passing(k, point, normal);
            return Cow::Owned(self.unseen.iter().copied().chain(passing).collect());
        }
        Cow::Borrowed(self.unseen)
    }

    /// Moves that no cell may show and that are lower over a point than one that cells show: from each of
    /// these, along the path as far as it leads down.
    fn beside(&self, point: &Point3, hidden: &[u32]) -> Vec<u32> {
        let CutSurface { envelope, path, .. } = self.inspection.surface;
        let (i, j) = self.inspection.grid.nearest_cell(point.x, point.y);
        let last = (path.len() as u32).saturating_sub(1);
        let height = |by: u32| envelope.height(by, point.x, point.y).unwrap_or(f64::INFINITY);
        let mut found = Vec::new();
        let winners = self.inspection.surface.winners(i, j);
        for first in winners.moves().iter().chain(hidden).copied().filter(|&by| by != NOT_CUT) {
            for forward in [true, false] {
                let (mut by, mut lowest) = (first, height(first));
                for _ in 0..MOST_BESIDE {
                    let next = if forward { (by + 1).min(last) } else { by.saturating_sub(1) };
                    let its = height(next);
                    if next == by || its >= lowest || found.contains(&next) {
                        break;
                    }
                    found.push(next);
                    (by, lowest) = (next, its);
                }
            }
        }
        found
    }

    /// Of all moves that are lowest over a point by a piece the one whose axis is nearest in the plan; `None` where
    /// there are too many to ask. Of many short moves on one level, the first that came over the centre of a
    /// cell may end beside it.
    fn nearest_of_lowest(&self, piece: &Clipped, point: &Point3) -> Option<u32> {
        let envelope = &self.inspection.surface.envelope;
        let mut best: Option<(f64, f64, u32)> = None;
        for &by in self.asked(piece, point.xy())? {
            let Some(z) = envelope.height(by, point.x, point.y).filter(|z| *z < self.stock_top) else {
                continue;
            };
            let least = best.map_or(f64::INFINITY, |best| best.0);
            if z > least + LEVEL {
                continue;
            }
            let off = self.off(by, point);
            if z < least - LEVEL || best.is_none_or(|best| off < best.1) {
                best = Some((z, off, by));
            }
        }
        best.map(|best| best.2)
    }

    /// How far a point is from the axis of a move in the plan, mm.
    fn off(&self, by: u32, point: &Point3) -> f64 {
        let path = self.inspection.surface.path;
        let ends = [path.start_of(by as usize), path.moves[by as usize].to.tip].map(|tip| tip.xy());
        geometry::distance_to_segment(&point.xy(), &ends[0], &ends[1])
    }

    /// Moves that are low over a point: any choice gives a bound, the lowest a good one.
    fn moves(&self, point: &Point3, first: u32, hidden: &[u32]) -> Vec<u32> {
        let surface = self.inspection.surface;
        let (i, j) = surface.cut.grid.nearest_cell(point.x, point.y);
        let winners = surface.winners(i, j);
        let all = std::iter::once(first)
            .chain(winners.moves().iter().chain(hidden).copied())
            .filter(|&by| by != NOT_CUT);
        let mut low: Vec<(f64, u32)> =
            all.filter_map(|by| Some((surface.envelope.height(by, point.x, point.y)?, by))).collect();
        low.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        low.dedup_by_key(|m| m.1);
        if low.get(MOST_MOVES).is_some_and(|next| next.0 <= low[0].0 + LEVEL) {
            // Of moves on one level the nearest pass most of a square.
            let level = low.iter().take_while(|m| m.0 <= low[0].0 + LEVEL).count();
            low.truncate(level);
            let off = |m: &(f64, u32)| self.off(m.1, point);
            low.sort_by(|a, b| off(a).total_cmp(&off(b)).then(a.1.cmp(&b.1)));
        }
        low.truncate(MOST_MOVES);
        low.into_iter().map(|m| m.1).collect()
    }

    /// Height of the cut above the piece, along its normals, at most: where the polygon comes to when it
    /// rises from one height to the other, each corner along its own normal.
    fn over(&self, piece: &Clipped, moves: &[u32], heights: [f64; 2]) -> f64 {
        let SurfacePoint { point, normal, .. } = &piece.foot;
        let mut places = [Point2::origin(); 2 * MOST_CORNERS];
        let mut count = 0;
        for (corner, lean) in piece.corners.iter().zip(&piece.leans).take(piece.len) {
            for height in heights {
                (places[count], count) = (corner + lean * height, count + 1);
            }
        }
        let level = |q: &Point2, z: f64| {
            (z - point.z) * normal.z + (q.x - point.x) * normal.x + (q.y - point.y) * normal.y
        };
        let mut rows = Vec::with_capacity(moves.len() + 1);
        for &by in moves {
            let mut row = [0.0; 2 * MOST_CORNERS];
            let passes = places[..count].iter().zip(&mut row).all(|(q, value)| {
                self.inspection.surface.envelope.height(by, q.x, q.y).is_some_and(|z| {
                    *value = level(q, z);
                    true
                })
            });
            if passes {
                rows.push(row);
            }
        }
        let above = |rows: &[_]| (least_greatest(rows, count) + piece.below) / piece.cosine;
        // Stock in a shape takes longer than all moves.
        if self.inspection.surface.cut.shape.is_some() {
            let by_moves = above(&rows);
            if by_moves <= self.least {
                return by_moves;
            }
        }
        let top = self.stock_over(&places[..count]);
        rows.push(places.map(|q| level(&q, top)));
        above(&rows)
    }

    /// The stock is nowhere higher between some places, mm.
    fn stock_over(&self, places: &[Point2]) -> f64 {
        let Some(shape) = &self.inspection.surface.cut.shape else { return self.stock_top };
        let first = places[0];
        let [low, high] = places.iter().fold([first; 2], |[low, high], q| [low.inf(q), high.sup(q)]);
        let (middle, size) = (low + (high - low) * 0.5, high - low);
        shape.highest_within(middle.x, middle.y, 0.5 * size.x.max(size.y))
    }
}

/// Places all around one.
pub(super) fn around(place: Point2, radius: f64) -> [Point2; 8] {
    std::array::from_fn(|k| {
        let (sin, cos) = (std::f64::consts::FRAC_PI_4 * k as f64).sin_cos();
        place + Vector2::new(cos, sin) * radius
    })
}

impl Clipped {
    /// Measures how the design leaves its tangent plane, at the corners.
    fn bend(&mut self, own: &dyn Fn(&Point2) -> SurfacePoint) {
        let SurfacePoint { point, normal, .. } = self.foot;
        let corners = &self.corners[..self.len];
        let (middle, mut turned) = (middle(corners), 0f64);
        for (corner, lean) in corners.iter().zip(&mut self.leans) {
            let foot = own(corner);
            *lean = foot.normal.xy();
            turned = turned.max((foot.normal - normal).norm());
            self.below = self.below.max(-BETWEEN_CORNERS * (foot.point - point).dot(&normal));
        }
        let turned = BETWEEN_CORNERS * turned;
        let more = turned * (1.0 - 1.0 / BETWEEN_CORNERS);
        for (corner, lean) in corners.iter().zip(&mut self.leans) {
            *lean += (corner - middle).try_normalize(0.0).unwrap_or_default() * more;
        }
        self.cosine = (1.0 - 0.5 * turned * turned).max(0.1);
    }
}

/// What is left of a bound that is enough: nothing stands higher, so heights up to it are all that need be
/// looked at, and what stands over those is a bound, too. `known` is what stands there at least.
fn lowered(mut possible: f64, known: f64, over: &dyn Fn(f64) -> f64) -> f64 {
    for _ in 0..MOST_LOWERED {
        let before = possible;
        possible = possible.min(over(possible));
        if possible <= known || before - possible < LITTLE_GAIN * (possible - known) {
            break;
        }
    }
    possible
}

/// The least, over all weights of the rows, of the greatest of `count` columns in their mean; a little more
/// where the search stops early. Every mean of rows gives an upper bound of the least row's greatest column.
pub(super) fn least_greatest<const N: usize>(rows: &[[f64; N]], count: usize) -> f64 {
    /// Rows that are mixed in, one after the other.
    const ROUNDS: usize = 6;
    let greatest = |row: &[f64; N]| row[..count].iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let Some(mut mean) = rows.iter().min_by(|a, b| greatest(a).total_cmp(&greatest(b))).copied() else {
        return f64::INFINITY;
    };
    let mut best = greatest(&mean);
    for _ in 0..ROUNDS {
        let mixed = rows.iter().map(|row| (mix(&mean, row, count), row));
        let Some(((value, share), row)) = mixed.min_by(|a, b| a.0.0.total_cmp(&b.0.0)) else { break };
        if value >= best - 1e-9 {
            break;
        }
        best = value;
        (0..count).for_each(|k| mean[k] += share * (row[k] - mean[k]));
    }
    best
}

/// The share of `b` in a mean with `a` that makes its greatest column least, and that column: a convex
/// function of the share, made of straight lines.
fn mix<const N: usize>(a: &[f64; N], b: &[f64; N], count: usize) -> (f64, f64) {
    let line = |share: f64| {
        let at = |k: usize| a[k] + share * (b[k] - a[k]);
        (0..count)
            .map(|k| (at(k), b[k] - a[k]))
            .max_by(|x, y| x.0.total_cmp(&y.0))
            .unwrap_or((f64::INFINITY, 0.0))
    };
    let (mut low, mut high) = ((0.0, line(0.0)), (1.0, line(1.0)));
    let mut best = if low.1.0 <= high.1.0 { (low.1.0, 0.0) } else { (high.1.0, 1.0) };
    for _ in 0..12 {
        if low.1.1 >= 0.0 || high.1.1 <= 0.0 {
            break;
        }
        // Where the two straight lines meet.
        let width: f64 = high.0 - low.0;
        let share = low.0 + (high.1.0 - high.1.1 * width - low.1.0) / (low.1.1 - high.1.1);
        if !(share > low.0 && share < high.0) {
            break;
        }
        let found = line(share);
        if found.0 < best.0 {
            best = (found.0, share);
        }
        if found.1 < 0.0 {
            low = (share, found);
        } else {
            high = (share, found);
        }
    }
    best
}
