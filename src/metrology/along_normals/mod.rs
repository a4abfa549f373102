//! Measures a cut along the normals of the design surface: any axis count, any shape.
//!
//! Enters: the part, what an engine tells of the cut along a line, and the path. Leaves: the figures of
//! `metrology`, and the deviation at every place of a net over the part. mm.
//!
//! Deviations are exact at the places. A ridge stands between two neighbouring places that different tracks
//! cut; it is found on the line between them where both cut equally high, from the heights and slopes at the
//! places. Its length is that of the way from crossing to crossing through the triangles of the net. Where
//! more may stand or lie between the places than was found, by the slope of the cut there, triangles are
//! divided until the asked bound holds, or a closer one where a limit hangs on it, or [`MOST_DIVIDED`] of
//! them are. A track that no place saw is seen all the same: the contacts of every move are places too.
//!
//! Engines by samples may miss what cuts between them: each place has a bound on how much deeper it may be
//! cut ([`NormalHit::uncertain`]), which goes into the bounds of the figures.
//!
//! What stands above the uncut tolerance is uncut, unless it is a scallop (`reached`).

mod closer;
mod net;
mod reached;
mod regions;
mod ridge_map;
mod ridges;
mod swept_volume;
#[cfg(test)]
mod tests;

use super::contact::contact as contact_of;
use super::engines::Task;
use super::facing::{Facing, Judged};
use super::figures::{
    Bounded, CloserLook, ExcessFigures, ExcessKind, Limits, Measurement, NUMERICAL_FLOOR, RidgePlace,
    ScallopFigures, UncutFigures,
};
use super::pairs::{PairTally, RidgeCrossing, pair_figures};
use super::ridge_map::RidgeMap;
use super::ridges::{Highest, scallop_figures};
use super::tracks::Tracks;
pub(crate) use closer::Figure;
use closer::{Greatest, MOST_DIVIDED};
use cutter::Cutter;
use geometry::{Point3, Vector3};
use motion::{Cutters, Toolpath};
pub(crate) use net::{Net, NetPlace, Site};
pub use net::{PatchGrid, net_places};
use part::Part;
pub(crate) use regions::connected;
use regions::{Standing, areas, deviation_figures};
use ridges::{CLOSE, Crossing, Finder};
use sim::RayHit;
pub use swept_volume::{FirstCut, RaysCut, RaysCutInTurn, SweptVolume, VoxelCut};
use work::monitor::{self, Cancelled, Monitor};

/// Lines meet what was cut to within this over the sine of the angle between them, mm: ten times what rays
/// tell, since the angle is that of a place a little before.
const GRAZING: f64 = 1e-8;

/// What a deviation is measured along.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Way {
    /// The normal of the place.
    Normal,
    /// This unit vector out of a ridge that is thinner than the cut along the normal is deep.
    OutOfRidge(Vector3),
    /// The thickness of the part, all of which is lost.
    Thickness,
}

/// The cut surface where the normal of a design point meets it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NormalHit {
    /// Signed distance along the normal, mm: positive where material stands.
    pub deviation: f64,
    /// The move that cut there.
    pub by: u32,
    /// Unit normal of the cut surface, away from the material.
    pub normal: Vector3,
    /// What was measured along.
    pub way: Way,
    /// Where the engine may begin to look beside this place.
    pub seed: usize,
    /// How much deeper than it was found the cut may be, mm.
    pub uncertain: f64,
}

/// An engine that tells where lines along normals meet the cut surface.
pub trait AlongNormal: Sync {
    /// The lowest place that was cut on the line through `point` along the unit `normal`; `None` where
    /// nothing was within [`AlongNormal::reach`]. What was cut nearby, if anything is known, only makes it
    /// faster.
    fn hit(&self, point: &Point3, normal: &Vector3, near: Option<&NormalHit>) -> Option<NormalHit>;

    /// Where a move, and those of its pass that go on where it ends, would meet the line if no others cut;
    /// `None` also where that is too deep to be told by them alone, and of engines that cannot tell moves
    /// apart.
    fn cut_by(&self, _point: &Point3, _normal: &Vector3, _by: u32) -> Option<RayHit> {
        None
    }

    /// The unit normal of the cut surface at what [`AlongNormal::cut_by`] found.
    fn normal_of(&self, _point: &Point3, _normal: &Vector3, _hit: &RayHit) -> Option<Vector3> {
        None
    }

    /// How far outward is looked, mm.
    fn reach(&self) -> f64;

    /// How high material stands at least on the line through `point` along `normal` where nothing was cut,
    /// mm.
    fn standing(&self, _point: &Point3, _normal: &Vector3) -> f64 {
        self.reach()
    }

    /// The same at most, mm, as far as `within` mm aside.
    fn standing_at_most(&self, point: &Point3, normal: &Vector3, _within: f64) -> f64 {
        self.standing(point, normal)
    }

    /// How far inward is looked, mm.
    fn depth(&self) -> f64;

    /// How much deeper what is cut as deep as is looked may be, mm.
    fn beyond_depth(&self) -> f64 {
        0.0
    }

    /// How deep anything is cut at most along lines no farther than `aside` mm from that through `point`
    /// along `normal`, mm.
    fn depth_at_most(&self, _point: &Point3, _normal: &Vector3, _aside: f64) -> f64 {
        self.depth()
    }
}

/// Deviations at all places of a net.
#[derive(Debug, Clone, PartialEq)]
pub struct NormalMap {
    /// Design points, mm.
    pub points: Vec<Point3>,
    /// Outward unit normals there.
    pub normals: Vec<Vector3>,
    /// Triangles between them.
    pub triangles: Vec<[u32; 3]>,
    /// Deviation at each, mm; NaN where nothing was cut within reach.
    pub deviations: Vec<f32>,
    /// The move that cut each; `u32::MAX` where none did.
    pub cut_by: Vec<u32>,
    /// The places of each patch; none on meshes.
    pub grids: Vec<PatchGrid>,
}

/// A place and the cut there.
#[derive(Debug, Clone, Copy)]
struct Sample {
    place: NetPlace,
    hit: Option<NormalHit>,
}

impl Sample {
    /// How fast the deviation changes along the surface: the tangent of the angle between cut and design; on
    /// a ridge at most.
    fn slope(&self) -> f64 {
        self.hit.map_or(0.0, |hit| {
            let tan = |along: &Vector3| {
                let cos = hit.normal.dot(along);
                if cos > 0.0 { (1.0 / (cos * cos) - 1.0).max(0.0).sqrt() } else { f64::INFINITY }
            };
            match hit.way {
                Way::Normal => tan(&self.place.normal),
                Way::OutOfRidge(out) => 1.0 + tan(&out),
                // It grows no faster than the distance from where the sides meet.
                Way::Thickness => 1.0,
            }
        })
    }
}

impl Sample {
    /// What stands there at least but for rounding, which is great where the line grazes what was cut.
    fn height(&self, engine: &dyn AlongNormal) -> f64 {
        let standing = || engine.standing(&self.place.point, &self.place.normal);
        self.hit.map_or_else(standing, |hit| hit.deviation - GRAZING * self.slope())
    }
}

/// What places are measured by, and how closely.
pub(crate) struct Along<'a> {
    pub part: &'a Part,
    pub cutters: &'a Cutters,
    pub path: &'a Toolpath,
    pub engine: &'a dyn AlongNormal,
    pub limits: &'a Limits,
    /// Distance of the places, mm.
    pub spacing: f64,
    /// Error bound that is asked for, mm.
    pub asked: f64,
    /// Triangles that are divided at most in search of extremes.
    pub most_divided: usize,
    /// Of which figures extremes are sought.
    pub figures: &'static [Figure],
}

struct NormalInspection<'a> {
    part: &'a Part,
    cutters: &'a Cutters,
    path: &'a Toolpath,
    engine: &'a dyn AlongNormal,
    finder: Finder<'a>,
    limits: &'a Limits,
    spacing: f64,
    /// Radius with which the widest cutter bends, about, mm.
    radius: f64,
    most_divided: usize,
    figures: &'static [Figure],
}

/// Measures what `engine` tells of the cut by `path` at places `spacing` mm apart, looking closer until the
/// error bounds are the asked one, mm. Figures are those of the judged share of the part, the map is of all
/// of it.
///
/// # Errors
/// [`Cancelled`] when the monitor says so.
pub fn measure_along_normals(
    part: &Part,
    cutter: &Cutter,
    path: &Toolpath,
    engine: &dyn AlongNormal,
    spacing: f64,
    limits: &Limits,
    asked: f64,
    judged: Option<(&Facing<'_>, Judged)>,
    monitor: &dyn Monitor,
) -> Result<(Measurement, NormalMap), Cancelled> {
    let cutters = &Cutters::from(cutter);
    let (most_divided, figures) = (MOST_DIVIDED, Figure::ALL);
    let along = Along { part, cutters, path, engine, limits, spacing, asked, most_divided, figures };
    let keep = |places: &[NetPlace]| are_judged(places, judged);
    let net = Net::over(part, spacing);
    let kept = keep(&net.places);
    along.measure(net, &kept, &keep, &|_| true, monitor)
}

/// No more than the ridges and the remnants along borders of what [`measure_along_normals`] measures, at
/// places `spacing` mm apart: nothing is looked at closer, so that bounds are wide.
///
/// # Errors
/// [`Cancelled`] when the monitor says so.
pub(crate) fn ridges_along_normals(
    task: &Task<'_>,
    engine: &dyn AlongNormal,
    spacing: f64,
    monitor: &dyn Monitor,
) -> Result<RidgeMap, Cancelled> {
    let Task { part, cutters, path, limits, .. } = *task;
    let asked = task.simulation.error_bound;
    let (most_divided, figures) = (0, Figure::ALL);
    let along = Along { part, cutters, path, engine, limits, spacing, asked, most_divided, figures };
    let net = Net::over(part, spacing);
    let kept = are_judged(&net.places, Some((&task.facing(), task.judged)));
    let is_kept = |t: &[u32; 3]| t.iter().all(|&k| kept[k as usize]);
    let net = Net::of_triangles(&net.places, net.triangles.iter().copied().filter(is_kept));
    along.ridges(&net, monitor)
}

/// Which places are judged.
fn are_judged(places: &[NetPlace], judged: Option<(&Facing<'_>, Judged)>) -> Vec<bool> {
    match judged {
        None => vec![true; places.len()],
        Some((facing, judged)) => {
            let kinds = facing.kinds(places.len(), |k| (places[k].point, places[k].normal));
            kinds.into_iter().map(|kind| facing.is_judged(judged, kind)).collect()
        }
    }
}

/// What a first look at a net finds.
struct Seen {
    samples: Vec<Sample>,
    /// The triangles whose places are all kept.
    triangles: Vec<[u32; 3]>,
    /// The ridges that cross each of them, those in hollows with them.
    of_triangle: Vec<Vec<Crossing>>,
    /// Which sides of each are the border.
    on_border: Vec<[bool; 3]>,
}

impl Along<'_> {
    fn inspection<'a>(&'a self, tracks: &'a Tracks<'a>) -> NormalInspection<'a> {
        let Self { part, cutters, path, engine, limits, spacing, most_divided, figures, .. } = *self;
        let radius = cutters.greatest(|cutter| {
            let corner = cutter.corner_radius();
            if corner > 0.0 { corner } else { cutter.radius() }
        });
        let finder = Finder { part, engine, tracks, radius, close: CLOSE };
        NormalInspection {
            part,
            cutters,
            path,
            engine,
            finder,
            limits,
            spacing,
            radius,
            most_divided,
            figures,
        }
    }

    /// Measures the places of a net that are `kept`, and of the contacts of the moves that come `near` those
    /// to `keep`.
    ///
    /// # Errors
    /// [`Cancelled`] when the monitor says so.
    pub(crate) fn measure(
        &self,
        net: Net,
        kept: &[bool],
        keep: &dyn Fn(&[NetPlace]) -> Vec<bool>,
        near: &(dyn Fn(usize) -> bool + Sync),
        monitor: &dyn Monitor,
    ) -> Result<(Measurement, NormalMap), Cancelled> {
        let Self { part, cutters, path, limits, spacing, asked, .. } = *self;
        let tracks = Tracks::new(path, cutters);
        let inspection = self.inspection(&tracks);
        let Seen { samples, triangles, of_triangle, on_border } = inspection.look(&net, kept, monitor)?;
        let (of_triangle, hollow) = inspection.without_hollows(of_triangle);
        let contacts = in_runs("measuring contacts", path.len(), monitor, |range| {
            let contacts = |k: &usize| {
                let cutter = cutters.of_move(*k as u32);
                near(*k).then(|| contacts_of(part, cutter, path, *k, spacing))
            };
            range.filter_map(|k| contacts(&k)).flatten().collect()
        })?;
        let kept_contacts = keep(&contacts);
        let contacts = in_runs("measuring contacts", contacts.len(), monitor, |range| {
            let mut near = None;
            let of_one = |k: usize| {
                let sample = inspection.sample(contacts[k], near.as_ref());
                near = sample.hit.or(near);
                sample
            };
            range.filter(|&k| kept_contacts[k]).map(of_one).collect()
        })?;
        let mut greatest = Greatest::default();
        let judged = || samples.iter().zip(kept).filter(|(_, kept)| **kept).map(|(sample, _)| sample);
        of_triangle.items.iter().for_each(|crossing| greatest.look_at_ridge(crossing));
        for sample in contacts.iter().chain(judged()) {
            greatest.look_at(sample, limits);
            greatest.look_at_height(sample, &inspection);
        }
        let pairs =
            pair_figures(part, cutters, path, tally(&of_triangle, cutters.first(), spacing), monitor)?;
        let ridge_samples = ridge_map::ridge_samples(&of_triangle);
        let shares = areas(&net);
        let mut gouge = inspection.gouges(&net, &samples, &shares, kept);
        let deviation = deviation_figures(&samples, &shares, kept);
        let of_one =
            |(k, t): (usize, &[u32; 3])| (t.map(|v| samples[v as usize]), on_border[k], of_triangle.group(k));
        let triangles = triangles.iter().enumerate().map(of_one);
        let left = inspection.search(triangles, &mut greatest, asked, monitor)?;
        gouge.max_depth_mm = greatest.depth;
        gouge.at_least_mm = greatest.depth_at_least;
        let is_deeper = greatest.depth >= self.engine.depth();
        let beyond = if is_deeper { self.engine.beyond_depth() } else { 0.0 };
        gouge.error_bound_mm =
            left.depth + (greatest.possible_depth - greatest.depth).max(0.0) + beyond + NUMERICAL_FLOOR;
        if let Some((at, by)) = greatest.deepest.filter(|_| greatest.depth > limits.gouge) {
            gouge.deepest_at(greatest.depth, at.into(), by);
        }
        let standing = Standing { hollow, greatest: &greatest, left: left.uncut };
        let mut uncut = inspection.uncut(&net, &samples, &shares, kept, &standing);
        let most = judged().filter(|sample| sample.hit.is_none()).map(|sample| inspection.at_most(sample));
        let more = most.fold(0.0, f64::max) - uncut.max_height_mm;
        uncut.error_bound_mm = uncut.error_bound_mm.max(more);
        let highest = greatest.ridge.map(|(height, at, lower)| {
            // What is uncertain may be lower only, but a bound stands to both sides.
            Highest { height, at, possible: height + left.ridge + lower }
        });
        let most = left.greatest();
        let note = (most > asked).then(|| {
            let most = 1e3 * most;
            format!("between the places on the normals {most:.1} µm more may stand or lie than was found; a smaller cell helps")
        });
        let scallop = scallop_figures(&ridge_samples, highest, limits);
        let mut excess = excess_figures(greatest.place, &scallop, &uncut, left.border);
        let of_uncut =
            greatest.uncut.filter(|(_, sample)| inspection.is_uncut(sample, greatest.highest_ridge()));
        excess.unreached.at_least_mm = of_uncut.map_or(0.0, |(height, sample)| certain(height, &sample));
        excess.highest.at_least_mm = excess.reached.at_least_mm.max(excess.unreached.at_least_mm);
        let deviations: Vec<f32> =
            samples.iter().map(|sample| sample.hit.map_or(f32::NAN, |hit| hit.deviation as f32)).collect();
        let map = NormalMap {
            points: net.places.iter().map(|place| place.point).collect(),
            normals: net.places.iter().map(|place| place.normal).collect(),
            cut_by: samples.iter().map(|sample| sample.hit.map_or(u32::MAX, |hit| hit.by)).collect(),
            deviations: deviations.clone(),
            triangles: net.triangles,
            grids: net.grids,
        };
        let above = |height: f64| height > limits.scallop && height <= limits.uncut;
        let ridges = of_triangle.items.iter().filter(|c| above(c.height));
        let ridges = ridges.map(|c| RidgePlace { at: c.at, height: c.height });
        let places = judged().filter_map(|sample| Some((sample.hit?.deviation, sample.place.point)));
        let places =
            places.filter(|(height, _)| above(*height)).map(|(height, at)| RidgePlace { at, height });
        let above = ridges.chain(places).collect();
        let measured = Measurement {
            above,
            scallop,
            gouge,
            uncut,
            excess,
            deviation,
            deviation_map: deviations,
            ridge_samples,
            pairs,
            refined: CloserLook { note, ..CloserLook::default() },
        };
        Ok((measured, map))
    }
}

impl NormalInspection<'_> {
    /// What was cut at the places of a net, and the ridges through those of its triangles that are kept.
    fn look(&self, net: &Net, kept: &[bool], monitor: &dyn Monitor) -> Result<Seen, Cancelled> {
        let samples = in_runs("measuring along normals", net.places.len(), monitor, |range| {
            let mut near = None;
            let of_one = |place: &NetPlace| {
                let sample = self.sample(*place, near.as_ref());
                near = sample.hit.or(near);
                sample
            };
            net.places[range].iter().map(of_one).collect()
        })?;
        let triangles: Vec<[u32; 3]> =
            net.triangles.iter().filter(|t| t.iter().all(|&k| kept[k as usize])).copied().collect();
        let sides = sides(&triangles);
        let on_sides = in_runs("measuring ridges", sides.len(), monitor, |range| {
            sides[range].iter().map(|side| self.on_side(&side.map(|k| samples[k as usize]))).collect()
        })?;
        let on_sides = Grouped::of(on_sides);
        let of_triangle = in_runs("joining ridges", triangles.len(), monitor, |range| {
            let of_one = |t: &[u32; 3]| {
                let side = |k: usize| [t[k].min(t[(k + 1) % 3]), t[k].max(t[(k + 1) % 3])];
                let found = (0..3)
                    .filter_map(|k| sides.binary_search(&side(k)).ok())
                    .flat_map(|k| on_sides.group(k))
                    .copied();
                with_lengths(found.collect())
            };
            triangles[range].iter().map(of_one).collect()
        })?;
        drop(on_sides);
        let on_border = on_border(&triangles, &sides);
        Ok(Seen { samples, triangles, of_triangle, on_border })
    }

    /// How high material stands at most about a place where nothing was cut, mm.
    fn at_most(&self, sample: &Sample) -> f64 {
        self.engine.standing_at_most(&sample.place.point, &sample.place.normal, self.spacing)
    }

    fn sample(&self, place: NetPlace, near: Option<&NormalHit>) -> Sample {
        Sample { place, hit: self.engine.hit(&place.point, &place.normal, near) }
    }

    /// The ridges without those in hollows that the cutter does not fit, which are uncut; the highest of
    /// these.
    fn without_hollows(&self, of_triangle: Vec<Vec<Crossing>>) -> (Grouped<Crossing>, Option<Crossing>) {
        let mut hollow: Option<Crossing> = None;
        let scallops = of_triangle.into_iter().map(|mut crossings| {
            crossings.retain(|c| {
                let scallop = self.is_scallop(c);
                if !scallop && hollow.is_none_or(|other| c.height > other.height) {
                    hollow = Some(*c);
                }
                scallop
            });
            crossings
        });
        (Grouped::of(scallops), hollow)
    }

    /// The ridges that cross the side between two places.
    fn on_side(&self, [a, b]: &[Sample; 2]) -> Vec<Crossing> {
        let mut found = Vec::new();
        if let (Some(x), Some(y)) = (a.hit, b.hit) {
            self.finder.between((&a.place, x), (&b.place, y), &mut found);
        }
        found
    }

    /// The ridges of those that cross the sides of a triangle.
    fn crossings(&self, mut found: Vec<Crossing>) -> Vec<Crossing> {
        found.retain(|crossing| self.is_scallop(crossing));
        with_lengths(found)
    }
}

/// The highest material: of ridges, of the highest place that stands up to the uncut tolerance, where passes
/// came down to the design, and of what is uncut. `left` is how much more than that place may stand along the
/// border, mm.
fn excess_figures(
    highest: Option<(f64, Sample)>,
    scallop: &ScallopFigures,
    uncut: &UncutFigures,
    left: f64,
) -> ExcessFigures {
    let ridge = Bounded {
        at_mm: scallop.max_at_mm,
        ..Bounded::new(scallop.max_mm.unwrap_or(0.0), scallop.error_bound_mm.unwrap_or(0.0))
    };
    let place = highest.map_or_else(Bounded::default, |(height, sample)| Bounded {
        at_mm: Some(sample.place.point.into()),
        at_least_mm: certain(height, &sample),
        ..Bounded::new(height, 0.0)
    });
    let place = Bounded { error_bound_mm: left + NUMERICAL_FLOOR, ..place };
    let unreached = Bounded {
        at_mm: uncut.regions.first().map(|region| region.at_mm),
        ..Bounded::new(uncut.max_height_mm, uncut.error_bound_mm)
    };
    let reached = ridge.or(&place);
    let kind = if unreached.max_mm > reached.max_mm {
        ExcessKind::Uncut
    } else {
        ExcessKind::of_reached(reached.max_mm, ridge.max_mm)
    };
    ExcessFigures { highest: reached.or(&unreached), kind, reached, unreached }
}

/// What of a height stands for certain, mm.
fn certain(height: f64, sample: &Sample) -> f64 {
    (height - sample.hit.map_or(0.0, |hit| hit.uncertain) - NUMERICAL_FLOOR).max(0.0)
}

/// Work on runs of neighbours, so that each can begin where the one before was found; in the order of the
/// whole.
fn in_runs<T: Send>(
    what: &str,
    count: usize,
    monitor: &dyn Monitor,
    of_run: impl Fn(std::ops::Range<usize>) -> Vec<T> + Sync,
) -> Result<Vec<T>, Cancelled> {
    const RUN: usize = 256;
    monitor.start(what, count as u64);
    let runs = work::parallel::try_map(count.div_ceil(RUN), |k| {
        monitor::check(monitor)?;
        let range = k * RUN..((k + 1) * RUN).min(count);
        let done = range.len() as u64;
        let found = of_run(range);
        monitor.advance(done);
        Ok(found)
    })?;
    // A list that grows would stand in the memory twice.
    let mut all = Vec::with_capacity(runs.iter().map(Vec::len).sum());
    runs.into_iter().for_each(|run| all.extend(run));
    Ok(all)
}

/// Lists one after the other in one: most are empty, and each of its own would take more than what it holds.
struct Grouped<T> {
    items: Vec<T>,
    /// Where each list begins, and where the last one ends.
    starts: Vec<usize>,
}

impl<T> Grouped<T> {
    fn of(lists: impl IntoIterator<Item = Vec<T>>) -> Self {
        let (mut items, mut starts) = (Vec::new(), vec![0]);
        for list in lists {
            items.extend(list);
            starts.push(items.len());
        }
        Self { items, starts }
    }

    fn group(&self, k: usize) -> &[T] {
        &self.items[self.starts[k]..self.starts[k + 1]]
    }
}

/// Which sides of each triangle no other one shares.
fn on_border(triangles: &[[u32; 3]], sides: &[[u32; 2]]) -> Vec<[bool; 3]> {
    let side = |t: &[u32; 3], k: usize| {
        let [a, b] = [t[k], t[(k + 1) % 3]];
        sides.binary_search(&[a.min(b), a.max(b)]).ok()
    };
    let mut shared = vec![0u8; sides.len()];
    let all = || triangles.iter().flat_map(|t| (0..3).filter_map(|k| side(t, k)));
    all().for_each(|k| shared[k] = shared[k].saturating_add(1));
    triangles.iter().map(|t| [0, 1, 2].map(|k| side(t, k).is_some_and(|k| shared[k] == 1))).collect()
}

/// The sides of all triangles, each once and from the lesser index, in order.
fn sides(triangles: &[[u32; 3]]) -> Vec<[u32; 2]> {
    let of = |t: &[u32; 3]| [0, 1, 2].map(|k| [t[k].min(t[(k + 1) % 3]), t[k].max(t[(k + 1) % 3])]);
    let mut sides = Vec::with_capacity(3 * triangles.len());
    triangles.iter().for_each(|t| sides.extend(of(t)));
    sides.sort_unstable();
    sides.dedup();
    sides
}

/// Crossings by the passes that meet, every so many of each pair to be calculated too.
fn tally(of_triangle: &Grouped<Crossing>, cutter: &Cutter, spacing: f64) -> PairTally {
    let one_in = PairTally::one_in(cutter, spacing);
    let mut tally = PairTally::default();
    for c in of_triangle.items.iter() {
        let crossing = RidgeCrossing { at: c.at, height: c.height, length: c.length, moves: c.moves };
        let chosen = tally.count(c.passes).is_multiple_of(one_in);
        tally.add(c.passes, crossing, chosen);
    }
    tally
}

/// Crossings of one triangle with half the way to the other crossing of the same two passes; where ridges
/// meet, to the middle of all.
fn with_lengths(mut found: Vec<Crossing>) -> Vec<Crossing> {
    let middle = |chosen: &dyn Fn(&Crossing) -> bool| {
        let add = |(sum, n): (Vector3, u32), c: &Crossing| (sum + c.at.coords, n + 1);
        let (sum, count) = found.iter().filter(|c| chosen(c)).fold((Vector3::zeros(), 0), add);
        (sum / f64::from(count.max(1)), count)
    };
    let length = |c: &Crossing| {
        let (own, count) = middle(&|other| other.passes == c.passes);
        (c.at.coords - if count == 2 { own } else { middle(&|_| true).0 }).norm()
    };
    let lengths: Vec<f64> = found.iter().map(length).collect();
    found.iter_mut().zip(lengths).for_each(|(c, length)| c.length = length);
    found
}

/// Where a cutting move touches the part, at its middle and its end; nothing where it is farther off than
/// `spacing`.
fn contacts_of(part: &Part, cutter: &Cutter, path: &Toolpath, k: usize, spacing: f64) -> Vec<NetPlace> {
    let step = &path.moves[k];
    if !step.kind.is_on_surface() {
        return Vec::new();
    }
    let from = path.location_before(k);
    let contact = |t: f64| {
        let (foot, off, _) = contact_of(part, cutter, &from.towards(&step.to, t));
        (off.abs() <= spacing).then(|| NetPlace::at_foot(&foot))
    };
    [0.5, 1.0].into_iter().filter_map(contact).collect()
}
