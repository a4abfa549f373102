//! What the cutter leaves at the highest place wherever it stands: the reason where no path can hold the
//! limit.

use serde::Serialize;

use cutter::Cutter;
use drop_cutter::DropCutter;
use geometry::{Point3, Vector3};
use metrology::{Bounded, Measurement};
use motion::{ROUNDING, Toolpath};
use part::Part;
use report::{Figure, micrometres, place, with_bound};
use sim::Stock;
use work::monitor::{self, Cancelled, Monitor};

use super::words::value;
use crate::covered::Unseen;
use crate::judge::highest_reached;
use crate::run::{Finding, Run};
use crate::{JobError, Session};

/// The least that upright cutters leave at the highest place without cutting into the part.
#[derive(Debug, Clone, Copy, Serialize)]
pub(crate) struct LeastLeftFigures {
    /// Along the normal.
    pub height_mm: f64,
    error_bound_mm: f64,
    at_mm: [f64; 3],
    limit_mm: f64,
}

/// Places of the part's plan along x and along y that are looked at beside the highest ones.
const PLACES: usize = 12;

/// From so many of them, those that leave most of all places around them, so many steps lead uphill; one that
/// does not is tried again half as long.
const CLIMBS: usize = 8;
const STEPS: usize = 12;

/// Places where the cutter leaves less than this share of what is looked for are no start.
const LEAST_START: f64 = 0.1;

/// A height with a bound above this share of it is told by what is proven of it alone.
const CLOSE: f64 = 0.1;

/// This share of what stands above a limit is asked for first.
const NEARLY_ALL: f64 = 0.9;

/// Of the normal's z. Where the part is steeper, it is a wall.
const LEAST_LEVEL: f64 = 0.2;

impl LeastLeftFigures {
    /// Of what is `violated` by the cut of a `path`, the first that tells. `None` where that may hold its limit after
    /// another path of these cutters. Where others cut `before` them, only what stands is told: elsewhere those may
    /// have left less.
    pub fn above_limit(
        session: &Session,
        (cutters, before): (&[Cutter], bool),
        path: &Toolpath,
        violated: Vec<Violated>,
        monitor: &dyn Monitor,
    ) -> Result<Option<Self>, JobError> {
        if violated.is_empty() || !path.is_upright() {
            return Ok(None);
        }
        if !before {
            return Self::at_or_elsewhere(session, cutters, &violated, monitor);
        }
        let drops = drops(session, cutters, monitor)?;
        for place in violated {
            if let Some(found) = Self::of(session, &drops, &place, monitor)? {
                // Those before left no less there than what stands.
                let stands = place.stands;
                let proven = found.proven_mm().min(stands);
                let height_mm = found.height_mm.min(stands);
                return Ok(Some(Self { height_mm, error_bound_mm: height_mm - proven, ..found }));
            }
        }
        Ok(None)
    }

    /// Of the first of some places that each cutter leaves more at than the place's limit, or else of one where
    /// it leaves more than any limit allows: beside a border it may come lower than elsewhere in a hollow.
    /// `None` where a path may hold the limits, as far as these places tell.
    pub fn at_or_elsewhere(
        session: &Session,
        cutters: &[Cutter],
        places: &[Violated],
        monitor: &dyn Monitor,
    ) -> Result<Option<Self>, JobError> {
        let drops = drops(session, cutters, monitor)?;
        for place in places {
            if let Some(found) = Self::of(session, &drops, place, monitor)? {
                return Ok(Some(found));
            }
        }
        let any_limit = ridge_limit(session).max(session.scene.tolerance.uncut);
        for place in most_left(session, &drops, LEAST_START * any_limit, monitor)? {
            if place.left > any_limit
                && let Some(found) = Self::at(session, &drops, place.line, any_limit, monitor)?
            {
                return Ok(Some(found));
            }
        }
        Ok(None)
    }

    /// What no path of these cutters takes away, mm.
    fn proven_mm(&self) -> f64 {
        self.height_mm - self.error_bound_mm
    }

    /// At a violated place: of nearly all that stands there above its limit, which tells more, or of the limit alone.
    fn of(
        session: &Session,
        drops: &[(Cutter, DropCutter<'_>)],
        &Violated { line, stands, limit }: &Violated,
        monitor: &dyn Monitor,
    ) -> Result<Option<Self>, JobError> {
        let nearly = limit + NEARLY_ALL * (stands - limit).max(0.0);
        let least = |more_than| Self::at(session, drops, line, more_than, monitor);
        let found = if nearly.is_finite() { least(nearly)? } else { None };
        let found = if found.is_some() { found } else { least(limit)? };
        Ok(found.map(|found| Self { limit_mm: limit, ..found }))
    }

    /// At a place of the part, where each cutter leaves more than a limit, mm.
    fn at(
        session: &Session,
        drops: &[(Cutter, DropCutter<'_>)],
        line: Line,
        limit: f64,
        monitor: &dyn Monitor,
    ) -> Result<Option<Self>, JobError> {
        let Line { at, normal } = line;
        let stock = line.way_in(&session.stock);
        // What one cutter takes away does not stand: the least of all, and no less than the lowest bound.
        let (mut height, mut proven) = (f64::INFINITY, f64::INFINITY);
        for (cutter, drop) in drops {
            let left = drop.least_left(cutter, &at, &normal, limit, monitor)?;
            let Some(left) = left.filter(|left| left.height <= stock) else { return Ok(None) };
            (height, proven) = (height.min(left.height), proven.min(left.height - left.bound));
        }
        Ok(height.is_finite().then(|| Self {
            height_mm: height,
            error_bound_mm: height - proven,
            at_mm: at.into(),
            limit_mm: limit,
        }))
    }
}

/// The line up from a place of the part along its outward unit normal, mm.
#[derive(Debug, Clone, Copy)]
struct Line {
    at: Point3,
    normal: Vector3,
}

impl Line {
    /// How far it runs in a stock that nothing cut, mm, as far as that is known: nothing stands beyond a side of
    /// the block. Of stock that is none, as high as it is over the place of a part that is no wall.
    fn way_in(&self, stock: &Stock) -> f64 {
        let Self { at, normal } = self;
        match stock {
            _ if normal.z < 0.0 => f64::NEG_INFINITY,
            Stock::Box(block) => {
                let way = |c: usize| {
                    let side = if normal[c] > 0.0 { block.max[c] } else { block.min[c] };
                    if normal[c] == 0.0 { f64::INFINITY } else { (side - at[c]) / normal[c] }
                };
                way(0).min(way(1)).min(way(2))
            }
            _ if normal.z < LEAST_LEVEL => f64::NEG_INFINITY,
            _ => (stock.height_at(at.x, at.y) - at.z) / normal.z,
        }
    }
}

/// Material above its limit.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Violated {
    /// Where it stands.
    line: Line,
    /// So much of it for certain, mm.
    stands: f64,
    /// What may stand there, mm.
    limit: f64,
}

impl Violated {
    /// At the place of the part nearest to another, in mm.
    pub fn near(part: &Part, at: &Point3, [stands, limit]: [f64; 2]) -> Self {
        let foot = part.closest_point(at).0;
        Self { line: Line { at: foot.point, normal: foot.normal }, stands, limit }
    }

    /// Material that exceeds its limit, mm, at the place of the part nearest to it.
    fn by(session: &Session, material: &Bounded, limit: f64) -> Option<Self> {
        let (at, stands) = (material.at_mm?, material.stands_mm());
        (stands > limit).then(|| Self::near(&session.part, &at.into(), [stands, limit]))
    }

    /// The highest ridge or remnant along a border, and the highest uncut material.
    pub fn of(session: &Session, measured: &Measurement) -> Vec<Self> {
        let ridge = Self::by(session, &highest_reached(measured), ridge_limit(session));
        let uncut = Self::by(session, &measured.excess.unreached, session.scene.tolerance.uncut);
        ridge.into_iter().chain(uncut).collect()
    }

    /// Where no cell sees, a place that is about as high as any, as far inside of the part's box as may be: over a
    /// border the cutter comes lower. Not what is nearest to the highest ridge: in a hollow that may be another face.
    /// Up to the uncut limit all answers to that of ridges there, and what is above both violates one of them.
    pub fn unseen(session: &Session, unseen: &Unseen) -> Vec<Self> {
        let (limit, bounds) = (ridge_limit(session), session.part.bounds());
        let places = unseen.above.iter().map(|(place, normal)| {
            let line = Line { at: place.at, normal: *normal };
            Self { line, stands: place.height - ROUNDING, limit }
        });
        let places: Vec<Self> = places.filter(|place| place.stands > limit).collect();
        let highest = places.iter().map(|place| place.stands).fold(limit, f64::max);
        let high = places.into_iter().filter(|place| place.stands >= limit + NEARLY_ALL * (highest - limit));
        let inside = |Self { line: Line { at, .. }, .. }: &Self| {
            let ways = [0, 1].map(|c| (at[c] - bounds.min[c]).min(bounds.max[c] - at[c]));
            ways[0].min(ways[1])
        };
        let inmost = high.max_by(|a, b| inside(a).total_cmp(&inside(b)));
        let unreached = &unseen.measurement.excess.unreached;
        let uncut = Self::by(session, unreached, session.scene.tolerance.uncut);
        inmost.into_iter().chain(uncut).collect()
    }
}

/// What the highest ridge may stand above the design, mm.
fn ridge_limit(session: &Session) -> f64 {
    session.scene.scallop_rule.highest * session.scene.tolerance.scallop
}

/// What tells how low each cutter comes over the part.
fn drops<'a>(
    session: &'a Session,
    cutters: &[Cutter],
    monitor: &dyn Monitor,
) -> Result<Vec<(Cutter, DropCutter<'a>)>, Cancelled> {
    let drop = |cutter: &Cutter| Ok((*cutter, DropCutter::watched(&session.part, cutter, monitor)?));
    cutters.iter().map(drop).collect()
}

/// A place of the part, and what the best position of a cutter that was found leaves there along its normal,
/// mm.
#[derive(Clone, Copy)]
struct Place {
    left: f64,
    at: [f64; 2],
    line: Line,
}

/// Places where the cutters leave most of all nearby, most first: those of a raster that leave more than
/// `least`, mm, and from there uphill.
fn most_left(
    session: &Session,
    drops: &[(Cutter, DropCutter<'_>)],
    least: f64,
    monitor: &dyn Monitor,
) -> Result<Vec<Place>, Cancelled> {
    let (bounds, size) = (session.part.bounds(), session.part.bounds().size());
    let at = |low: f64, size: f64, k: usize| low + size * (k as f64 + 0.5) / PLACES as f64;
    let place = |at: [f64; 2]| {
        let design = session.part.highest_at(at[0], at[1]).filter(|design| design.normal.z >= LEAST_LEVEL)?;
        let by = |(cutter, drop): &(Cutter, DropCutter<'_>)| {
            drop.left_by_search(cutter, &design.point, &design.normal, least)
        };
        let left = drops.iter().map(by).fold(f64::INFINITY, f64::min) * design.normal.z;
        Some(Place { left, at, line: Line { at: design.point, normal: design.normal } })
    };
    let raster = work::parallel::try_map(PLACES * PLACES, |k| {
        monitor::check(monitor)?;
        let at = [at(bounds.min.x, size.x, k % PLACES), at(bounds.min.y, size.y, k / PLACES)];
        Ok::<_, Cancelled>(place(at))
    })?;
    let by_height = |a: &Place, b: &Place| b.left.total_cmp(&a.left);
    let is_top = |k: usize| {
        let near = |k: usize| k.saturating_sub(1)..(k + 2).min(PLACES);
        let left = |k: usize| raster[k].as_ref().map_or(f64::NEG_INFINITY, |place| place.left);
        let all_around = |is_lower: &dyn Fn(usize) -> bool| {
            near(k / PLACES).all(|row| near(k % PLACES).all(|column| is_lower(row * PLACES + column)))
        };
        left(k) > least && all_around(&|other| left(other) <= left(k))
    };
    let tops: Vec<bool> = (0..raster.len()).map(is_top).collect();
    let mut starts: Vec<Place> =
        raster.into_iter().zip(tops).filter_map(|(place, is_top)| place.filter(|_| is_top)).collect();
    starts.sort_by(by_height);
    starts.truncate(CLIMBS);
    let mut tops = work::parallel::try_map(starts.len(), |k| {
        let mut top = starts[k];
        let mut step = [size.x, size.y].map(|size| 0.5 * size / PLACES as f64);
        for _ in 0..STEPS {
            monitor::check(monitor)?;
            let beside = (-1..=1).flat_map(|x| (-1..=1).map(move |y| [f64::from(x), f64::from(y)]));
            let beside = beside.map(|[x, y]| [top.at[0] + x * step[0], top.at[1] + y * step[1]]);
            let higher = beside.filter_map(place).max_by(|a, b| a.left.total_cmp(&b.left));
            match higher.filter(|higher| higher.left > top.left) {
                Some(higher) => top = higher,
                None => step = step.map(|step| 0.5 * step),
            }
        }
        Ok::<_, Cancelled>(top)
    })?;
    tops.sort_by(by_height);
    Ok(tops)
}

pub(super) fn find(run: &Run<'_>, monitor: &dyn Monitor) -> Result<Finding, JobError> {
    if run.session.leaves_the_rest(run.request) {
        return Ok(Finding::default());
    }
    let mut cutters: Vec<Cutter> = Vec::new();
    for (_, cutter) in run.own_cutters.each() {
        if !cutters.contains(cutter) {
            cutters.push(*cutter);
        }
    }
    let before = !run.before().is_empty();
    let with = (&cutters[..], before);
    let unseen = run.covered.unseen.iter().flat_map(|unseen| Violated::unseen(run.session, unseen));
    let violated = unseen.chain(Violated::of(run.session, run.measurement())).collect();
    let left = LeastLeftFigures::above_limit(run.session, with, &run.whole.path, violated, monitor)?;
    let Some(left) = left else { return Ok(Finding::default()) };
    let (height, bound) = (left.height_mm, left.error_bound_mm);
    let height = if bound <= CLOSE * height {
        format!("{} µm", with_bound(Some(height), Some(bound)))
    } else {
        format!("at least {} µm", micrometres(Some(height - bound)))
    };
    let [of, leaves, stands] = match cutters.len() {
        1 => ["this cutter", "it leaves", "it stands"],
        _ => ["these cutters", "they leave", "they stand"],
    };
    let behind = if before { " and behind what cut before it" } else { "" };
    let note = format!(
        "no path of {of}, upright{behind}, holds {} µm: at {} {leaves} {height} wherever {stands}. The \
         part is too hollow there; take a smaller cutter, one with a smaller flat, or tilt it (`axis`)",
        micrometres(Some(left.limit_mm)),
        place(left.at_mm),
    );
    let figure = Figure { key: "least_left", value: value(&left)?, ..Figure::default() };
    Ok(Finding { figure: Some(figure), notes: vec![note], ..Finding::default() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use scene::Scene;
    use work::monitor::Silent;

    /// A bull nose in a hollow cylinder: its flat stands on its corner at the height that the section gives
    /// in closed form. A ball of the same size says nothing.
    #[test]
    fn what_a_flat_leaves_in_a_hollow_is_told_and_not_corrected() {
        let result = |cutter: &str| {
            let text = format!(
                "[part]\nsurface = \"cylinder\"\nradius = 30\nconcave = true\nx = [-4, 4]\ny = [-4, 4]\n[cutter]\n\
                 {cutter}\ndiameter = 6\n[tolerance]\nscallop = 0.03\nuncut = 0.03\n[[toolpath]]\nstrategy = \"iso-parametric\"\n"
            );
            let session = Session::new(Scene::parse("hollow.toml", text).unwrap()).unwrap();
            session.toolpath(&session.scene.toolpaths[0], &Silent).unwrap().result
        };
        let value = |result: &report::ToolpathResult, key: &str| {
            result.figures.iter().find(|figure| figure.key == key).map(|figure| figure.value.clone())
        };
        let bull = result("shape = \"bull\"\ncorner_radius = 1.5");
        let left = value(&bull, "least_left").unwrap();
        let [height, bound] = ["height_mm", "error_bound_mm"].map(|key| left[key].as_f64().unwrap());
        let stands = 28.5 - (28.5f64.powi(2) - 1.5f64.powi(2)).sqrt();
        // Beside the middle the part is higher, so that less stands.
        assert!(height > 0.03 && height - bound <= stands, "{height} {bound} {stands}");
        assert!(bull.notes.iter().any(|note| note.contains("wherever it stands")), "{:?}", bull.notes);
        let rounds = value(&bull, "correction").unwrap()["rounds"].as_array().unwrap().len();
        assert!(rounds <= 6, "{rounds} rounds");
        assert!(value(&result("shape = \"ball\""), "least_left").is_none());
    }

    /// Behind another toolpath with a cutter of its own what stands for certain, and what its own cutter leaves
    /// wherever it stands, tell what no path of it takes away; where the one before came lower nothing stands.
    #[test]
    fn what_a_cutter_leaves_behind_others_is_told() {
        let left = |radius: f64| {
            let text = format!(
                "[part]\nsurface = \"cylinder\"\nradius = 30\nconcave = true\nx = [-4, 4]\ny = [-4, 4]\n[cutter]\n\
                 shape = \"bull\"\ncorner_radius = 1.5\ndiameter = 6\n[tolerance]\nscallop = 0.03\nuncut = 0.03\n\
                 [[toolpath]]\nname = \"rough\"\nstrategy = \"zigzag\"\nstepover = 1\n\
                 cutter = {{ shape = \"bull\", diameter = 7, corner_radius = {radius} }}\n\
                 [[toolpath]]\nstrategy = \"iso-parametric\"\nstock = \"previous\"\n"
            );
            let session = Session::new(Scene::parse("hollow.toml", text).unwrap()).unwrap();
            let result = session.toolpath(&session.scene.toolpaths[1], &Silent).unwrap().result;
            let figure = result.figures.iter().find(|figure| figure.key == "least_left");
            (figure.map(|figure| figure.value.clone()), result.notes)
        };
        // The flat of 4 mm before leaves more than that of 3 mm; one of 0.4 mm leaves less than the limit.
        let (found, notes) = left(1.5);
        let found = found.unwrap_or_else(|| panic!("{notes:?}"));
        let [height, bound] = ["height_mm", "error_bound_mm"].map(|key| found[key].as_f64().unwrap());
        let stands = 28.5 - (28.5f64.powi(2) - 1.5f64.powi(2)).sqrt();
        assert!(height > 0.03 && height - bound <= stands, "{height} {bound} {stands}");
        assert!(notes.iter().any(|note| note.contains("behind what cut before it, holds")), "{notes:?}");
        assert!(left(3.3).0.is_none());
    }

    /// Two planes that meet in a hollow crease under a ball that touches both: along the normal of one, what
    /// stands over the crease is `r (1 − √(1 − tan² β))`.
    #[test]
    fn passes_are_not_narrowed_for_a_crease_that_no_ball_reaches() {
        let (slope, wide) = (10f64.to_radians().tan(), 6.0);
        let corner = |x: f64, y: f64| format!("vertex {x} {y} {}\n", slope * x.abs());
        let facet = |[a, b, c]: [(f64, f64); 3]| {
            let corners: String = [a, b, c].map(|(x, y)| corner(x, y)).concat();
            format!("facet normal 0 0 0\nouter loop\n{corners}endloop\nendfacet\n")
        };
        let side = |x: f64| [[(0.0, 0.0), (x, 0.0), (x, wide)], [(0.0, 0.0), (x, wide), (0.0, wide)]];
        let facets: String = [wide, -wide].into_iter().flat_map(side).map(facet).collect();
        let file = std::env::temp_dir().join(format!("crease_{}.stl", std::process::id()));
        std::fs::write(&file, format!("solid crease\n{facets}endsolid crease\n")).unwrap();
        let text = format!(
            "[part]\nfile = {:?}\n[cutter]\nshape = \"ball\"\ndiameter = 6\n[tolerance]\nscallop = 0.02\nuncut = 0.02\n\
             [[toolpath]]\nstrategy = \"zigzag\"\nangle = 90\n",
            file.to_str().unwrap()
        );
        let session = Session::new(Scene::parse("crease.toml", text).unwrap()).unwrap();
        let result = session.toolpath(&session.scene.toolpaths[0], &Silent).unwrap().result;
        std::fs::remove_file(file).unwrap();
        let value = |key: &str| {
            let found = result.figures.iter().find(|figure| figure.key == key);
            found.map(|figure| figure.value.clone()).unwrap_or_else(|| panic!("{key}: {:?}", result.notes))
        };
        let stands = 3.0 * (1.0 - (1.0 - slope * slope).sqrt());
        let left = value("least_left");
        let [height, bound] = ["height_mm", "error_bound_mm"].map(|key| left[key].as_f64().unwrap());
        assert!(height > 0.02 && height - bound <= stands + 1e-6, "{height} ± {bound} {stands}");
        let correction = value("correction");
        let rounds = correction["rounds"].as_array().unwrap();
        let is_narrowed = |round: &serde_json::Value| round["factors"][0].as_f64().unwrap() < 1.0;
        assert!(rounds.len() <= 3 && !rounds.iter().any(is_narrowed), "{rounds:?}");
    }

    /// Between the places of the raster, too, and beside places that stand higher for other reasons.
    #[test]
    fn the_hollow_that_leaves_most_is_found_from_anywhere() {
        let text = "[part]\nsurface = \"wave\"\namplitude = 0.4\nwavelength_x = 6\nwavelength_y = 6\nx = [0, 6]\ny = [0, 6]\n\
                    [cutter]\nshape = \"ball\"\ndiameter = 6\n[tolerance]\nscallop = 0.027\nuncut = 0.027\n\
                    [[toolpath]]\nstrategy = \"zigzag\"\n";
        let session = Session::new(Scene::parse("hollows.toml", text).unwrap()).unwrap();
        let left = |at: [f64; 3]| {
            let cutter = &session.scene.tooling.cutter;
            let place = Violated::near(&session.part, &at.into(), [0.027; 2]);
            let left = LeastLeftFigures::at_or_elsewhere(&session, &[*cutter], &[place], &Silent);
            left.unwrap().unwrap_or_else(|| panic!("nothing is left at {at:?}"))
        };
        // Beside the trough at x 1.5, y 3 the ball touches along x and y.
        let (r, k): (f64, f64) = (3.0, std::f64::consts::TAU / 6.0);
        let lift = |s: f64| 0.4 * (1.0 - (k * s).cos()) - (r - (r * r - s * s).sqrt());
        let stands = (0..=2000).map(|n| lift(f64::from(n) * 1e-3)).fold(0.0, f64::max);
        for at in [[1.5, 3.0, -0.4], [4.5, 3.0, 0.4]] {
            let found = left(at);
            assert!(found.height_mm - found.error_bound_mm <= stands + 1e-6, "{found:?} {stands}");
            assert!(found.height_mm > 0.027, "{found:?} {stands}");
        }
    }
}
