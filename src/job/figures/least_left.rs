//! What the cutter leaves at the highest place wherever it stands: the reason where no path can hold the
//! limit.

use serde::Serialize;

use cutter::Cutter;
use drop_cutter::DropCutter;
use geometry::Point3;
use metrology::{Bounded, Limits, Measurement};
use motion::Toolpath;
use part::SurfacePoint;
use report::{Figure, micrometres, place, with_bound};
use work::monitor::{self, Cancelled, Monitor};

use super::words::value;
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

/// Of the normal's z. Where the part is steeper, it is a wall.
const LEAST_LEVEL: f64 = 0.2;

impl LeastLeftFigures {
    /// `None` where the highest material holds its limit, or may hold it after another path of these cutters.
    /// Where others cut `before` them, only what stands is told: elsewhere those may have left less.
    pub fn above_limit(
        session: &Session,
        (cutters, before): (&[Cutter], bool),
        path: &Toolpath,
        measurements: &[&Measurement],
        monitor: &dyn Monitor,
    ) -> Result<Option<Self>, JobError> {
        let scene = &session.scene;
        let Limits { scallop, uncut, .. } = scene.tolerance;
        let limited = |measured: &&Measurement| {
            let ridge = (highest_reached(measured), scene.scallop_rule.highest * scallop);
            [ridge, (measured.excess.unreached, uncut)]
        };
        let violated: Vec<(Bounded, f64)> = measurements
            .iter()
            .flat_map(limited)
            .filter(|(material, limit)| material.stands_mm() > *limit && material.at_mm.is_some())
            .collect();
        if violated.is_empty() || !path.is_upright() {
            return Ok(None);
        }
        let places = violated.iter().filter_map(|(material, limit)| Some((material.at_mm?.into(), *limit)));
        let places: Vec<(Point3, f64)> = places.collect();
        if !before {
            return Self::at_or_elsewhere(session, cutters, &places, monitor);
        }
        let drops = drops(session, cutters, monitor)?;
        for ((place, limit), (material, _)) in places.iter().zip(&violated) {
            if let Some(found) =
                Self::at(session, &drops, session.part.closest_point(place).0, *limit, monitor)?
            {
                // Those before left no less there than what stands.
                let stands = material.stands_mm();
                let proven = (found.height_mm - found.error_bound_mm).min(stands);
                let height_mm = found.height_mm.min(stands);
                return Ok(Some(Self { height_mm, error_bound_mm: height_mm - proven, ..found }));
            }
        }
        Ok(None)
    }

    /// Of the first of some places that each cutter leaves more at than the place's limit, both mm, or else
    /// of one where it leaves more than any limit allows: beside a border it may come lower than elsewhere in
    /// a hollow. `None` where a path may hold the limits, as far as these places tell.
    pub fn at_or_elsewhere(
        session: &Session,
        cutters: &[Cutter],
        places: &[(Point3, f64)],
        monitor: &dyn Monitor,
    ) -> Result<Option<Self>, JobError> {
        let scene = &session.scene;
        let drops = drops(session, cutters, monitor)?;
        let least = |design, limit| Self::at(session, &drops, design, limit, monitor);
        for (place, limit) in places {
            if let Some(found) = least(session.part.closest_point(place).0, *limit)? {
                return Ok(Some(found));
            }
        }
        let any_limit = (scene.scallop_rule.highest * scene.tolerance.scallop).max(scene.tolerance.uncut);
        for place in most_left(session, &drops, LEAST_START * any_limit, monitor)? {
            if place.left > any_limit
                && let Some(found) = least(place.design, any_limit)?
            {
                return Ok(Some(found));
            }
        }
        Ok(None)
    }

    /// At a place of the part, where each cutter leaves more than a limit, mm.
    fn at(
        session: &Session,
        drops: &[(Cutter, DropCutter<'_>)],
        design: SurfacePoint,
        limit: f64,
        monitor: &dyn Monitor,
    ) -> Result<Option<Self>, JobError> {
        if design.normal.z < LEAST_LEVEL {
            return Ok(None);
        }
        let stock = session.stock.height_at(design.point.x, design.point.y) - design.point.z;
        let stock = stock / design.normal.z;
        // What one cutter takes away does not stand: the least of all, and no less than the lowest bound.
        let (mut height, mut proven) = (f64::INFINITY, f64::INFINITY);
        for (cutter, drop) in drops {
            let left = drop.least_left(cutter, &design.point, &design.normal, limit, monitor)?;
            let Some(left) = left.filter(|left| left.height <= stock) else { return Ok(None) };
            (height, proven) = (height.min(left.height), proven.min(left.height - left.bound));
        }
        Ok(height.is_finite().then(|| Self {
            height_mm: height,
            error_bound_mm: height - proven,
            at_mm: design.point.into(),
            limit_mm: limit,
        }))
    }
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
    design: SurfacePoint,
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
        Some(Place { left, at, design })
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
    let unseen = run.covered.unseen.iter().map(|unseen| &unseen.measurement);
    let measured: Vec<&Measurement> = std::iter::once(run.measurement()).chain(unseen).collect();
    let before = !run.before().is_empty();
    let with = (&cutters[..], before);
    let left = LeastLeftFigures::above_limit(run.session, with, &run.whole.path, &measured, monitor)?;
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
            let left =
                LeastLeftFigures::at_or_elsewhere(&session, &[*cutter], &[(at.into(), 0.027)], &Silent);
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
