//! How much of a part's surface a verdict covers, and what of it cells cannot see.
//!
//! Enters: the part, what its tool can face, and the cells that were measured. Leaves: the area of each kind
//! of surface, a partition of the whole, and the figures along the normals of what is judged and no cell
//! measures. mm, mm².
//!
//! A cell measures a place where the surface is not steeper than [`STEEP`] and where the centre of one of the
//! nine cells around sees the same sheet of it. All other judged surface is measured along its normals: steep
//! faces, narrow ledges, and, where the whole surface is judged, walls, undersides, and floors below other
//! surface. What was never cut stands there as far as the block reaches; the tool's reach is a lower bound of
//! it.
//!
//! Areas are sums over small triangles, each of the kind of its middle. The area of all those whose corners
//! are of another kind is the bound of the error.

mod figures;
mod near;
mod pieces;
mod unseen_cut;

use std::collections::{HashMap, HashSet};

use geometry::{Point2, Point3, Vector3};
use sim::Grid;
use work::monitor::{Cancelled, Monitor};

use super::along_normals::{Along, AlongNormal as _, Figure, Net, NetPlace, Site, SweptVolume};
use super::facing::{Facing, Judged, PlaceKind};
use super::figures::{Limits, Measurement, RidgePlace};
pub use figures::CoverageFigures;
use motion::{Cutters, Toolpath};
use near::{Near, cube};
use part::{Part, Patch, SurfacePoint};
use pieces::{Pieces, divided, join};
use unseen_cut::{UnseenCut, lowest_of_tools};

/// Where the vertical part of the normal is less, cells lie more than five times as far apart on the surface
/// as in the plan: too far to see what one pass leaves.
pub(crate) const STEEP: f64 = 0.2;

/// A cell's centre sees the sheet of a place where it lies within this slope from the place's tangent plane.
const SAME_SHEET: f64 = 0.25;

/// Normals are the same where one less their product is less than this: rounding.
const SAME_NORMAL: f64 = 1e-9;

/// Triangles in a square of the longest side that is allowed, about: they are halved until no side is longer.
const TRIANGLES_A_SQUARE: f64 = 3.0;

/// Triangles that a part without small facets is divided into. Fewer leave wide bounds of the areas; each
/// takes some µs.
const PIECES: f64 = 6_000.0;

/// Triangles along normals for each hundred cells, and at least so many: rays cost far more than cells, and
/// must not cost a run more than a third.
const TRIANGLES_A_HUNDRED_CELLS: f64 = 3.0;
const LEAST_TRIANGLES: f64 = 4_000.0;

/// Contacts of moves are looked at once in cubes of this share of the triangles' sides. A smaller share asks
/// the same place for every chord of a pass; a greater one misses passes between passes.
const CONTACT_SHARE: f64 = 0.25;

/// What cells measured.
#[derive(Debug, Clone, Copy)]
pub struct CellsSeen<'a> {
    /// The cells.
    pub grid: &'a Grid,
    /// Deviation at each, `[ny][nx]`, mm; NaN where none was measured.
    pub deviations: &'a [f32],
    /// Whether walls were measured beside them, against the moves.
    pub walls: bool,
}

/// How a path is measured along normals.
#[derive(Clone, Copy)]
pub struct AlongTask<'a> {
    /// What cuts.
    pub cutters: &'a Cutters,
    /// How it moves.
    pub path: &'a Toolpath,
    /// What tells where a normal meets the cut.
    pub cut: &'a SweptVolume<'a>,
    /// What is tolerated.
    pub limits: &'a Limits,
    /// Error bound that is asked for, mm.
    pub asked: f64,
    /// No places closer than this, mm.
    pub finest: f64,
    /// How often the distance of places that suits the cells is halved.
    pub halvings: i32,
    /// Whether another toolpath cuts off what stands: extremes are sought of gouges alone, and the bounds of
    /// heights are wide.
    pub leaves_the_rest: bool,
}

/// What stands on judged surface that no cell measures.
#[derive(Debug, Clone, PartialEq)]
pub struct UnseenSurface {
    /// The figures.
    pub measurement: Measurement,
    /// Distance of the places, mm.
    pub spacing: f64,
    /// The places over which more stands than the scallop tolerance, with how much at least, and their outward
    /// unit normals.
    pub above: Vec<(RidgePlace, Vector3)>,
}

/// The surface of a part by what is judged and what measures it.
pub struct Coverage<'a> {
    part: &'a Part,
    facing: &'a Facing<'a>,
    judged: Judged,
    /// Areas by kind, and by what measures them, mm².
    areas: HashMap<(PlaceKind, By), f64>,
    /// Bound of the error of each area, mm².
    area_error: f64,
    /// What is judged and no cell measures.
    unseen: Net,
    cells: Option<CellsSeen<'a>>,
}

/// What measures a place.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum By {
    Cells,
    Moves,
    Normals,
}

impl<'a> Coverage<'a> {
    /// Of a part; without cells all that is judged is measured along normals.
    pub fn new(part: &'a Part, facing: &'a Facing<'a>, judged: Judged, cells: Option<CellsSeen<'a>>) -> Self {
        let area: f64 = (0..part.mesh().triangles().len()).map(|t| area(&part.mesh().corners(t))).sum();
        let spacing = (TRIANGLES_A_SQUARE * area / PIECES).sqrt().max(f64::MIN_POSITIVE);
        let (areas, area_error) = (HashMap::new(), 0.0);
        let mut coverage = Self { part, facing, judged, areas, area_error, unseen: Net::default(), cells };
        Pieces::of(part, spacing).for_each(|pieces| coverage.add(pieces));
        coverage
    }

    fn add(&mut self, pieces: Pieces) {
        let middles = &pieces.middles;
        let mut kinds = self.facing.kinds(middles.len(), |t| (middles[t].point, middles[t].normal));
        if self.cells.is_some_and(|cells| cells.walls) {
            let hidden = |t: usize| self.facing.is_hidden_wall(&middles[t].point, &middles[t].normal);
            let hidden = work::parallel::map(kinds.len(), |t| kinds[t] == PlaceKind::Wall && hidden(t));
            let walls = kinds.iter_mut().zip(hidden).filter(|(_, hidden)| *hidden);
            walls.for_each(|(kind, _)| *kind = PlaceKind::Hidden);
        }
        let by = work::parallel::map(kinds.len(), |t| self.measured_by(kinds[t], &middles[t]));
        self.area_error += pieces.area_error + mixed(self.facing, &pieces, &kinds);
        for (t, area) in pieces.areas.iter().enumerate() {
            *self.areas.entry((kinds[t], by[t])).or_insert(0.0) += area;
        }
        let unseen = |t: usize| self.facing.is_judged(self.judged, kinds[t]) && by[t] == By::Normals;
        join(&mut self.unseen, pieces.chosen(unseen));
    }

    /// What measures a place of a kind.
    fn measured_by(&self, kind: PlaceKind, place: &NetPlace) -> By {
        match (kind, &self.cells) {
            (PlaceKind::Facing, Some(cells)) if cells.see(self.part, place) => By::Cells,
            (PlaceKind::Wall, Some(cells)) if cells.walls => By::Moves,
            _ => By::Normals,
        }
    }

    /// Area of what `chosen` picks by its kind and what measures it, mm².
    fn area(&self, chosen: impl Fn(PlaceKind, By) -> bool) -> f64 {
        // One after the other, so that the sum has the same bits in every run.
        let kinds = PlaceKind::ALL.into_iter();
        let kinds = kinds.flat_map(|kind| [By::Normals, By::Moves, By::Cells].map(|by| (kind, by)));
        let of = |(kind, by)| self.areas.get(&(kind, by)).filter(|_| chosen(kind, by));
        kinds.filter_map(of).fold(0.0, |sum, area| sum + area)
    }

    /// The areas.
    pub fn figures(&self) -> CoverageFigures {
        let is_judged = |kind| self.facing.is_judged(self.judged, kind);
        let not_judged = |kind| self.area(|k, _| k == kind && !is_judged(k));
        CoverageFigures {
            judge: self.judged,
            by_cells_mm2: self.area(|_, by| by == By::Cells),
            along_normals_mm2: self.area(|kind, by| is_judged(kind) && by == By::Normals),
            by_moves_mm2: self.area(|kind, by| is_judged(kind) && by == By::Moves),
            walls_mm2: not_judged(PlaceKind::Wall),
            facing_away_mm2: not_judged(PlaceKind::FacingAway),
            hidden_mm2: not_judged(PlaceKind::Hidden),
            outside_stock_mm2: not_judged(PlaceKind::OutsideStock),
            error_bound_mm2: self.area_error,
            ..CoverageFigures::default()
        }
        .summed()
    }

    /// Measures what is judged and no cell measures; `None` where there is no such surface.
    ///
    /// # Errors
    /// [`Cancelled`] when the monitor says so.
    pub fn measure_unseen(
        &self,
        task: &AlongTask<'_>,
        monitor: &dyn Monitor,
    ) -> Result<Option<UnseenSurface>, Cancelled> {
        let area = self.area(|kind, by| self.facing.is_judged(self.judged, kind) && by == By::Normals);
        if area == 0.0 {
            return Ok(None);
        }
        let triangles = (TRIANGLES_A_HUNDRED_CELLS * self.cells.map_or(0, |cells| cells.grid.len()) as f64
            / 100.0)
            .max(LEAST_TRIANGLES);
        let suits = (TRIANGLES_A_SQUARE * area / triangles).sqrt();
        let spacing = (0.5f64.powi(task.halvings) * suits).max(task.finest);
        let net = divided(self.part, self.unseen.clone(), spacing);
        let lowest = lowest_of_tools(task.path, task.cutters.greatest_radius());
        let cut = UnseenCut { cut: task.cut, facing: self.facing, lowest };
        let along = Along {
            part: self.part,
            cutters: task.cutters,
            path: task.path,
            engine: &cut,
            limits: task.limits,
            spacing,
            asked: task.asked,
            most_divided: net.triangles.len(),
            figures: if task.leaves_the_rest { Figure::GOUGES } else { Figure::ALL },
        };
        let near = Near::new(&net.places, spacing + task.cutters.greatest_radius());
        let comes_near = |k: usize| near.is_passed(task.path, k, task.cutters.of_move(k as u32));
        let all = vec![true; net.places.len()];
        let contacts =
            |places: &[NetPlace]| thinned(places, self.are_unseen(places), CONTACT_SHARE * spacing);
        let (measurement, map) = along.measure(net, &all, &contacts, &comes_near, monitor)?;
        let stands = |k: usize| {
            let deviation = f64::from(map.deviations[k]);
            if deviation.is_nan() { cut.standing(&map.points[k], &map.normals[k]) } else { deviation }
        };
        let place = |k: usize| (RidgePlace { at: map.points[k], height: stands(k) }, map.normals[k]);
        let above = (0..map.points.len()).map(place);
        let above = above.filter(|(place, _)| place.height > task.limits.scallop).collect();
        Ok(Some(UnseenSurface { measurement, spacing, above }))
    }

    /// Which places are judged and not measured by cells.
    fn are_unseen(&self, places: &[NetPlace]) -> Vec<bool> {
        let kinds = self.facing.kinds(places.len(), |k| (places[k].point, places[k].normal));
        let seen = |k: usize| self.measured_by(kinds[k], &places[k]) != By::Normals;
        // A contact on an edge of a mesh has a normal between those of its facets, which are measured beside
        // it.
        let on_facet = |k: usize| match places[k].site {
            Site::Facet { triangle, .. } => {
                self.part.mesh().normal(triangle as usize).dot(&places[k].normal) > 1.0 - SAME_NORMAL
            }
            Site::Patch(_) => true,
        };
        let unseen = |k| self.facing.is_judged(self.judged, kinds[k]) && on_facet(k) && !seen(k);
        work::parallel::map(places.len(), unseen)
    }
}

impl CellsSeen<'_> {
    /// Whether the centre of a cell around a place sees the sheet that it is on.
    fn see(&self, part: &Part, place: &NetPlace) -> bool {
        let Some((i, j)) = self.grid.cell_at(place.point.x, place.point.y) else { return false };
        if place.normal.z < STEEP {
            return false;
        }
        let sees = |i: usize, j: usize| {
            !self.deviations[self.grid.index(i, j)].is_nan() && on_sheet(part, place, &self.grid.centre(i, j))
        };
        let around = |k: usize, n: usize| k.saturating_sub(1)..(k + 2).min(n);
        sees(i, j) || around(j, self.grid.ny).any(|j| around(i, self.grid.nx).any(|i| sees(i, j)))
    }
}

/// Whether cells may see a place of the part's surface: an upright tool faces it.
fn sees_level(facing: &Facing<'_>, place: &SurfacePoint) -> bool {
    facing.kinds(1, |_| (place.point, place.normal)) == [PlaceKind::Facing]
}

/// Whether the topmost surface at a place of the plan is the sheet of `place`.
fn on_sheet(part: &Part, place: &NetPlace, q: &Point2) -> bool {
    if let [Patch::Analytic(_)] = part.patches() {
        return true;
    }
    let Some(hit) = part.bvh().highest_at(part.mesh(), q.x, q.y) else { return false };
    let way = Point3::new(q.x, q.y, hit.z) - place.point;
    way.dot(&place.normal).abs()
        <= SAME_SHEET * way.norm() / (1.0 + SAME_SHEET * SAME_SHEET).sqrt() + part.mesh_deviation()
}

/// Those of the kept places that are the first of their facet or patch in a cube of a side, mm.
fn thinned(places: &[NetPlace], kept: Vec<bool>, side: f64) -> Vec<bool> {
    let mut taken = HashSet::new();
    let owner = |place: &NetPlace| match place.site {
        Site::Facet { triangle, .. } => triangle,
        Site::Patch(at) => at.patch,
    };
    let first =
        |(place, kept): (&NetPlace, bool)| kept && taken.insert((cube(&place.point, side), owner(place)));
    places.iter().zip(kept).map(first).collect()
}

/// Area of the pieces whose corners are not all of their kind, mm².
fn mixed(facing: &Facing<'_>, pieces: &Pieces, kinds: &[PlaceKind]) -> f64 {
    if kinds.iter().all(|kind| *kind == kinds[0]) {
        return 0.0;
    }
    let places = &pieces.net.places;
    let of_corners = facing.kinds(places.len(), |k| (places[k].point, places[k].normal));
    let other = |t: usize| pieces.net.triangles[t].iter().any(|&k| of_corners[k as usize] != kinds[t]);
    (0..kinds.len()).filter(|t| other(*t)).map(|t| pieces.areas[t]).sum()
}

pub(crate) fn area(corners: &[Point3; 3]) -> f64 {
    let [a, b, c] = corners;
    0.5 * (b - a).cross(&(c - a)).norm()
}

#[cfg(test)]
mod tests;
