//! Vertical walls under upright cutters, measured along their normals against the moves themselves.
//!
//! Enters: the vertical facets of a mesh, and the moves. Leaves: the deepest cut and the highest material of
//! each strip of a wall, as regions and figures, and what of tops and floors belongs to a wall. mm.
//!
//! Cells look down. Where a cutter goes a few µm too far into a wall, or leaves as much, they see a place
//! beside it that lies the whole wall too deep or too high. Such a place is no farther off the design than
//! the wall's own cut is deep, and counts so:
//!
//! - on a top, up to the depth that moves cut into the wall below it;
//! - on a floor, up to the material that stands before the wall above it.
//!
//! The other way round, what a move takes off the edge of a top is no deeper in the wall than it is below the
//! top, and what stands on a floor up to the uncut tolerance is the floor's.

mod piece;
mod reach;
mod search;
#[cfg(test)]
mod tests;

use std::collections::HashMap;

use geometry::{Aabb, Point2, Point3, Vector2, Vector3};
use motion::{Cutters, Toolpath};
use part::Part;
use sim::{Envelope, Grid, MoveBins};
use work::monitor::{self, Cancelled, Monitor};

use super::along_normals::{Net, NetPlace, Site, connected};
use super::facing::{Facing, PlaceKind};
use super::figures::{Bounded, ExcessKind, GougeRegion, Limits, Measurement, NUMERICAL_FLOOR, UncutRegion};
use piece::{QUARTERS, SHORTEST, WallPiece};
use reach::Moves;
use search::{Deepest, Highest, Standing};

/// Length of a strip over the cell. Longer ones make more of a floor belong to a wall where something stands;
/// shorter ones take more time.
const STRIP_OVER_CELL: f64 = 8.0;

/// Cells along the side of a bin of moves.
const CELLS_PER_BIN: usize = 16;

/// Strips that one worker measures before it asks whether to stop.
const RUN: usize = 64;

/// A floor ends at a wall where it is no farther than this from its lower edge, mm, and its slope times the
/// distance.
const TOUCHING: f64 = 1e-3;
const STEEPEST: f64 = 5.0;

/// Strips whose middles are no farther apart than so many lengths of the longest are neighbours.
const NEIGHBOURS: f64 = 1.5;

/// Regions listed one by one in the figures; the rest is counted.
const LISTED_REGIONS: usize = 20;

/// What walls are measured with.
pub(super) struct WallTask<'a> {
    pub part: &'a Part,
    pub cutters: &'a Cutters,
    pub path: &'a Toolpath,
    pub envelope: &'a Envelope,
    pub grid: Grid,
    pub facing: &'a Facing<'a>,
    pub limits: &'a Limits,
    /// Material is looked for so far before walls, mm.
    pub reach: f64,
    /// Error bound that is asked for, mm.
    pub asked: f64,
}

/// The walls of a part, as they were cut.
pub(super) struct Walls {
    strips: Vec<Strip>,
    /// The strips whose material or cut may reach a square of the plan.
    near: HashMap<[i64; 2], Vec<u32>>,
    side: f64,
    /// How near what stands was looked for, mm.
    slack: f64,
}

struct Strip {
    piece: WallPiece,
    /// Where the wall comes to below it, at both ends: its floor where other strips lead down there without a
    /// gap, else its lower edge.
    foot: [f64; 2],
    cut: Deepest,
    stands: Highest,
}

impl Walls {
    /// Measures the walls of a part; `None` where it has none that an upright tool may cut.
    ///
    /// # Errors
    /// [`Cancelled`] when the monitor says so.
    pub fn measure(task: &WallTask<'_>, monitor: &dyn Monitor) -> Result<Option<Self>, Cancelled> {
        let WallTask { part, cutters, path, grid, facing, limits, .. } = *task;
        let longest = STRIP_OVER_CELL * grid.cell;
        let mut pieces = piece::pieces(part, longest, facing.block().min.z);
        let kinds = facing.kinds(pieces.len(), |k| pieces[k].middle());
        let mut kinds = kinds.into_iter();
        pieces.retain(|piece| {
            let (middle, normal) = piece.middle();
            kinds.next() == Some(PlaceKind::Wall) && !facing.is_hidden_wall(&middle, &normal)
        });
        if pieces.is_empty() {
            return Ok(None);
        }
        monitor.start("measuring walls", pieces.len() as u64);
        let widest = cutters.greatest_radius();
        let bins = MoveBins::new(&grid, CELLS_PER_BIN, widest + task.reach + longest, path);
        let moves = Moves { envelope: task.envelope, path, cutters };
        let way_out = |q: Point2, n: Vector2| way_out(facing.block(), q, n);
        let standing = Standing {
            moves: &moves,
            reach: task.reach,
            way_out: &way_out,
            of_floor: limits.uncut,
            asked: task.asked,
            counted: limits.uncut,
        };
        let runs = work::parallel::try_map(pieces.len().div_ceil(RUN), |run| {
            monitor::check(monitor)?;
            let some = &pieces[run * RUN..((run + 1) * RUN).min(pieces.len())];
            monitor.advance(some.len() as u64);
            let of_one = |piece: &WallPiece| {
                let near = passing(piece, &moves, moves_near(&bins, &grid, piece), task.reach);
                Strip {
                    piece: *piece,
                    foot: piece.low,
                    cut: search::deepest(piece, &moves, &near),
                    stands: standing.highest(piece, &near),
                }
            };
            Ok(some.iter().map(of_one).collect::<Vec<_>>())
        })?;
        let strips: Vec<Strip> = runs.into_iter().flatten().collect();
        Ok(Some(Self::of(strips, longest, task.asked, grid.cell)))
    }

    fn of(strips: Vec<Strip>, side: f64, slack: f64, cell: f64) -> Self {
        let mut near: HashMap<[i64; 2], Vec<u32>> = HashMap::new();
        for (k, strip) in strips.iter().enumerate() {
            let WallPiece { start, along, length, .. } = strip.piece;
            // Asked by the middle of squares no larger than a cell.
            let grown = strip.cut.depth.max(strip.stands.possible) + slack + length + cell;
            let ends = [start, start + along * length];
            let [low, high] = [0, 1].map(|c| {
                let [a, b] = ends.map(|end| end[c]);
                [((a.min(b) - grown) / side).floor() as i64, ((a.max(b) + grown) / side).floor() as i64]
            });
            for (i, j) in (low[0]..=low[1]).flat_map(|i| (high[0]..=high[1]).map(move |j| (i, j))) {
                near.entry([i, j]).or_default().push(k as u32);
            }
        }
        let mut walls = Self { strips, near, side, slack };
        let feet = work::parallel::map(walls.strips.len(), |k| walls.foot(&walls.strips[k].piece));
        walls.strips.iter_mut().zip(feet).for_each(|(strip, foot)| strip.foot = foot);
        walls
    }

    /// Where the wall below a strip comes to, at both ends: facets that meet aslant are one wall.
    fn foot(&self, piece: &WallPiece) -> [f64; 2] {
        let feet = QUARTERS.map(|share| {
            let u = share * piece.length;
            let (mut level, floor) = (piece.low_at(u), piece.floor_at(u));
            while level > floor + TOUCHING {
                let place = piece.place(u, level);
                let below = |other: &Strip| other.leads_down(&place, &piece.normal);
                level = self.near(place.xy()).filter_map(below).reduce(f64::min)?;
            }
            Some(floor.min(level))
        });
        match feet {
            [Some(a), Some(b)] => piece.extended([a, b], f64::max),
            _ => piece.low,
        }
    }

    fn near(&self, q: Point2) -> impl Iterator<Item = &Strip> {
        let square = [q.x, q.y].map(|x| (x / self.side).floor() as i64);
        self.near.get(&square).into_iter().flatten().map(|&k| &self.strips[k as usize])
    }

    /// A deviation at a place of a top or floor, as far as no wall beside it accounts for it, mm.
    pub fn beside(&self, p: &Point3, deviation: f64) -> f64 {
        let q = p.xy();
        if deviation > 0.0 {
            let of = |strip: &Strip| {
                let most = strip.stands.possible + self.slack;
                let front = strip.in_front(p, most).filter(|_| strip.stands_on(p))?;
                (front <= most).then_some(strip.stands.possible.max(front))
            };
            return self.near(q).filter_map(of).fold(deviation, f64::min);
        }
        let of = |strip: &Strip| {
            let behind = -strip.in_front(p, strip.cut.depth + NUMERICAL_FLOOR)?;
            let is_its = behind >= -NUMERICAL_FLOOR && behind <= strip.cut.depth + NUMERICAL_FLOOR;
            (is_its && strip.ends_at(p)).then_some(strip.cut.depth)
        };
        -self.near(q).filter_map(of).fold(-deviation, f64::min)
    }

    /// The lines before walls, in the plan, that floor at a place around which all of `corners` lie begins
    /// at: a point of each and the unit vector toward the floor.
    pub fn lines<'b>(
        &'b self,
        p: &'b Point3,
        corners: &'b [Point2],
    ) -> impl Iterator<Item = (Point2, Vector2)> + 'b {
        self.near(p.xy()).filter_map(move |strip| {
            let WallPiece { normal, length, beyond, .. } = strip.piece;
            let most = strip.stands.possible + self.slack;
            let [before, after] = beyond.map(|beyond| if beyond > 0.0 { beyond.min(length) } else { most });
            let beside = |q: &Point2| {
                let [u, _] = strip.piece.seen_from(&Point3::new(q.x, q.y, p.z));
                (-before..=length + after).contains(&u)
            };
            let its = corners.iter().all(beside) && strip.stands_on(p);
            let foot = strip.piece.place(0.0, p.z).xy();
            its.then(|| (foot + normal * most, normal))
        })
    }

    /// Adds the figures of the walls to those of the cells.
    pub fn add_to(&self, measured: &mut Measurement, limits: &Limits) {
        self.add_cuts(measured, limits);
        self.add_material(measured, limits);
        let deepest = self.strips.iter().map(|strip| strip.cut.depth).fold(0.0, f64::max);
        let highest = self.strips.iter().map(|strip| strip.stands.height).fold(0.0, f64::max);
        let deviation = &mut measured.deviation;
        deviation.min_mm = deviation.min_mm.map(|least| least.min(-deepest));
        deviation.max_mm = deviation.max_mm.map(|most| most.max(highest));
    }

    fn add_cuts(&self, measured: &mut Measurement, limits: &Limits) {
        let gouge = &mut measured.gouge;
        let depth = |k: u32| self.strips[k as usize].cut.depth;
        let possible = gouge.max_depth_mm + gouge.error_bound_mm;
        for region in self.connected(&|k| depth(k) > limits.gouge) {
            let Some(&deepest) = region.iter().max_by(|a, b| depth(**a).total_cmp(&depth(**b))) else {
                continue;
            };
            let strip = &self.strips[deepest as usize];
            let area_mm2 = region.iter().map(|&k| self.strips[k as usize].piece.area()).sum();
            gouge.area_mm2 += area_mm2;
            gouge.region_count += 1;
            gouge.regions.push(GougeRegion {
                depth_mm: strip.cut.depth,
                area_mm2,
                at_mm: strip.piece.place(strip.cut.at[0], strip.cut.at[1]).into(),
                move_index: strip.cut.by,
                ..GougeRegion::default()
            });
        }
        gouge.regions.sort_by(|a, b| b.depth_mm.total_cmp(&a.depth_mm));
        gouge.regions.truncate(LISTED_REGIONS);
        let deepest = self.strips.iter().map(|strip| strip.cut.depth).fold(0.0, f64::max);
        gouge.max_depth_mm = gouge.max_depth_mm.max(deepest);
        gouge.error_bound_mm = possible.max(deepest + NUMERICAL_FLOOR) - gouge.max_depth_mm;
    }

    fn add_material(&self, measured: &mut Measurement, limits: &Limits) {
        let height = |k: u32| self.strips[k as usize].stands.height;
        let uncut = &mut measured.uncut;
        for region in self.connected(&|k| height(k) > limits.uncut) {
            let Some(&highest) = region.iter().max_by(|a, b| height(**a).total_cmp(&height(**b))) else {
                continue;
            };
            let strips = || region.iter().map(|&k| &self.strips[k as usize]);
            let area_mm2: f64 = strips().map(|strip| strip.piece.area() * strip.stands.share).sum();
            let volume_mm3: f64 = strips().map(|strip| strip.piece.area() * strip.stands.mean).sum();
            uncut.area_mm2 += area_mm2;
            uncut.volume_mm3 += volume_mm3;
            uncut.region_count += 1;
            let at_mm = self.strips[highest as usize].highest_at().into();
            uncut.regions.push(UncutRegion { height_mm: height(highest), area_mm2, volume_mm3, at_mm });
        }
        uncut.regions.sort_by(|a, b| b.height_mm.total_cmp(&a.height_mm));
        uncut.regions.truncate(LISTED_REGIONS);
        let (reached, unreached) = (self.highest(|h| h <= limits.uncut), self.highest(|h| h > limits.uncut));
        if unreached.max_mm > 0.0 {
            let both = Bounded::new(uncut.max_height_mm, uncut.error_bound_mm).or(&unreached);
            (uncut.max_height_mm, uncut.error_bound_mm) = (both.max_mm, both.error_bound_mm);
        }
        let excess = &mut measured.excess;
        let before = excess.highest.max_mm;
        excess.reached = excess.reached.or(&reached);
        excess.unreached = excess.unreached.or(&unreached);
        excess.highest = excess.highest.or(&reached).or(&unreached);
        if excess.highest.max_mm > before {
            let of_reached = ExcessKind::of_reached(excess.highest.max_mm, 0.0);
            excess.kind = if unreached.max_mm > 0.0 { ExcessKind::Uncut } else { of_reached };
        }
    }

    /// The highest material before the strips whose height is `chosen`.
    fn highest(&self, chosen: impl Fn(f64) -> bool) -> Bounded {
        let of = |strip: &Strip| Bounded {
            at_mm: Some(strip.highest_at().into()),
            ..Bounded::new(strip.stands.height, strip.stands.possible - strip.stands.height)
        };
        let all = self.strips.iter().filter(|strip| chosen(strip.stands.height)).map(of);
        let found = all.fold(Bounded::default(), |highest, one| highest.or(&one));
        // Floors up to this far before a wall were taken for the wall's.
        let slack = if found.at_mm.is_some() { self.slack } else { 0.0 };
        Bounded { error_bound_mm: found.error_bound_mm + slack + NUMERICAL_FLOOR, ..found }
    }

    /// Strips for which `inside` holds, by neighbours that face about the same way.
    fn connected(&self, inside: &dyn Fn(u32) -> bool) -> Vec<Vec<u32>> {
        let place = |strip: &Strip| {
            let (mut point, normal): (Point3, Vector3) = strip.piece.middle();
            // Strips one above the other are one place of the wall.
            point.z = 0.0;
            NetPlace { site: Site::Facet { triangle: 0, point }, point, normal }
        };
        let net = Net { places: self.strips.iter().map(place).collect(), ..Net::default() };
        connected(&net, NEIGHBOURS * self.side, inside)
    }
}

impl Strip {
    /// How far a place lies in front of the strip, mm; `None` if it lies beyond its ends by more than `more`.
    fn in_front(&self, p: &Point3, more: f64) -> Option<f64> {
        let [u, front] = self.piece.seen_from(p);
        (-more..=self.piece.length + more).contains(&u).then_some(front).filter(|front| *front >= -more)
    }

    /// Whether a floor at a place in front comes to the lower edge.
    fn stands_on(&self, p: &Point3) -> bool {
        let [u, front] = self.piece.seen_from(p);
        let near = TOUCHING + STEEPEST * front.abs();
        front >= -NUMERICAL_FLOOR
            && self.piece.between(self.foot, u) <= p.z + near
            && self.piece.high_at(u) > p.z + TOUCHING
    }

    /// How far down the strip leads at a place of a wall with a normal; `None` where it does not go on there.
    fn leads_down(&self, p: &Point3, normal: &Vector2) -> Option<f64> {
        let [u, front] = self.piece.seen_from(p);
        let is_its = (-SHORTEST..=self.piece.length + SHORTEST).contains(&u)
            && front.abs() <= TOUCHING
            && self.piece.normal.dot(normal) > 0.0;
        let goes_on = self.piece.low_at(u) < p.z && self.piece.high_at(u) >= p.z - TOUCHING;
        (is_its && goes_on).then(|| self.piece.low_at(u))
    }

    /// Whether a top at a place behind comes to the upper edge.
    fn ends_at(&self, p: &Point3) -> bool {
        let [u, front] = self.piece.seen_from(p);
        let near = TOUCHING + STEEPEST * front.abs();
        self.piece.high_at(u) >= p.z - near && self.piece.low_at(u) < p.z - TOUCHING
    }

    fn highest_at(&self) -> Point3 {
        self.piece.place(self.stands.at[0], self.stands.at[1])
    }
}

/// The moves of the bin under a strip's middle: bins are grown by more than its length.
fn moves_near<'b>(bins: &'b MoveBins, grid: &Grid, piece: &WallPiece) -> &'b [u32] {
    let (middle, _) = piece.middle();
    let bin = |x: f64, origin: f64, n: usize| {
        let cell = ((x - origin) / grid.cell + 0.5).max(0.0) as usize;
        (cell / CELLS_PER_BIN).min(n.saturating_sub(1))
    };
    bins.of_bin(bin(middle.x, grid.origin.x, bins.nx()), bin(middle.y, grid.origin.y, bins.ny()))
}

/// Those moves that may cut a strip, or material up to `reach` before it.
fn passing(piece: &WallPiece, moves: &Moves<'_>, near: &[u32], reach: f64) -> Vec<u32> {
    let highest = piece.high[0].max(piece.high[1]);
    let passes = |k: &&u32| {
        let ends = moves.ends(**k);
        if ends[0].z.min(ends[1].z) > highest {
            return false;
        }
        let seen = ends.map(|end| piece.seen_from(&Point3::new(end.x, end.y, piece.level)));
        let radius = moves.radius(**k);
        let span = |c: usize| [seen[0][c].min(seen[1][c]) - radius, seen[0][c].max(seen[1][c]) + radius];
        let ([u0, u1], [s0, s1]) = (span(0), span(1));
        u0 <= piece.length && u1 >= 0.0 && s0 <= reach && s1 >= -reach
    };
    near.iter().filter(passes).copied().collect()
}

/// How far the block goes on from a place along a level normal, in x and in y, mm.
fn way_out(block: &Aabb, q: Point2, n: Vector2) -> [f64; 2] {
    [0, 1].map(|c| {
        let side = if n[c] > 0.0 { block.max[c] } else { block.min[c] };
        if n[c] == 0.0 { f64::INFINITY } else { ((side - q[c]) / n[c]).max(0.0) }
    })
}
