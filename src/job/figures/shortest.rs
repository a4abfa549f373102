//! What no path can be shorter than.

use serde::Serialize;

use field::ShortestPossible;
use geometry::Point3;
use metrology::path_figures;
use motion::{MoveKind, ROUNDING, Toolpath};
use report::Figure;
use toolpath::{Faces, PlanError, Step};
use work::monitor::Monitor;

use super::words::value;
use crate::JobError;
use crate::run::{Finding, Run};

const SECONDS_PER_MINUTE: f64 = 60.0;

/// The length that no path below the scallop height can go under, by the widest strips over all directions.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ShortestFigures {
    /// Of the cutter's way, as `path.cutting_length_mm` is.
    pub cutting_length_mm: f64,
    /// Of the contact's way on the part: the integral of 1/(widest strip).
    pub contact_length_mm: f64,
    /// The first of these over the path's cutting length.
    pub efficiency: f64,
    /// The first of these at the feed, s: no path below the scallop height that cuts no deeper than the part
    /// takes less, whatever its turns and links.
    pub least_time_s: f64,
    /// That over the path's machining time.
    pub time_efficiency: f64,
    /// What passes with these ends need at least to be joined, s, in whatever order ([`least_links`]).
    pub least_links_s: f64,
    /// The least time with that over the path's machining time.
    pub joined_efficiency: f64,
    /// Share of the part's area where it is about as concave as the cutter and the strip was limited.
    pub limited_fraction: f64,
}

impl ShortestFigures {
    /// Of a path with a feed, mm/min, and a machining time, s, whose links are no shorter than `links` mm in
    /// all; `None` for an empty one.
    fn new(shortest: &ShortestPossible, path: &Toolpath, feed: f64, time_s: f64, links: f64) -> Option<Self> {
        let at_feed = |length: f64| length / feed * SECONDS_PER_MINUTE;
        let cutting_length_mm = path_figures(path, 0.0).cutting_length_mm;
        let [least_time_s, least_links_s] = [shortest.cutting_mm, links].map(at_feed);
        (cutting_length_mm > 0.0).then(|| Self {
            least_time_s,
            time_efficiency: least_time_s / time_s,
            least_links_s,
            joined_efficiency: (least_time_s + least_links_s) / time_s,
            cutting_length_mm: shortest.cutting_mm,
            contact_length_mm: shortest.contact_mm,
            efficiency: shortest.cutting_mm / cutting_length_mm,
            limited_fraction: shortest.limited_fraction,
        })
    }
}

/// The length, mm, that the links between the passes of a path have at least, in whatever order and sense they
/// are cut: from each end the tool goes on to an end of another pass, on the surface, or up by the clearance
/// at the feed. Two ends are the first and the last. A pass that closes can be left anywhere: 0 where one
/// does.
fn least_links(path: &Toolpath, clearance: f64) -> f64 {
    let mut passes: Vec<[Point3; 2]> = Vec::new();
    let mut last = None;
    for (from, to, step) in path.segments() {
        let this = (step.kind == MoveKind::Cut).then_some(step.pass);
        match passes.last_mut() {
            Some(ends) if last == this && this.is_some() => ends[1] = to,
            _ if this.is_some() => passes.push([from, to]),
            _ => {}
        }
        last = this;
    }
    if passes.len() < 2 || passes.iter().any(|[from, to]| (to - from).norm() <= ROUNDING) {
        return 0.0;
    }
    let mut ends: Vec<(Point3, usize)> =
        passes.iter().enumerate().flat_map(|(k, ends)| ends.map(|end| (end, k))).collect();
    ends.sort_by(|(a, _), (b, _)| a.x.total_cmp(&b.x));
    let nearest = |k: usize| {
        let (at, pass) = ends[k];
        let within = |least: f64, (other, of): &(Point3, usize)| {
            if *of == pass { least } else { least.min((other - at).norm()) }
        };
        let (mut least, mut sides) = (clearance, [&ends[..k], &ends[k + 1..]]);
        while let Some((end, rest)) = sides[1].split_first().filter(|(end, _)| end.0.x - at.x < least) {
            (least, sides[1]) = (within(least, end), rest);
        }
        while let Some((end, rest)) = sides[0].split_last().filter(|(end, _)| at.x - end.0.x < least) {
            (least, sides[0]) = (within(least, end), rest);
        }
        least
    };
    let mut gaps: Vec<f64> = (0..ends.len()).map(nearest).collect();
    gaps.sort_by(f64::total_cmp);
    0.5 * gaps[..gaps.len() - 2].iter().sum::<f64>()
}

pub(super) fn find(run: &Run<'_>, monitor: &dyn Monitor) -> Result<Finding, JobError> {
    let scene = run.scene();
    // Tools that lean take other strips, a path for some places covers a part of the whole, one by levels covers
    // it more than once, and nobody planned a program from elsewhere for a scallop height.
    let request = run.request;
    let covers_all = request.axis.is_none()
        && request.faces() == Faces::ALL
        && !request.is_for_places()
        && request.stepdown.is_none()
        && request.foreign().is_none();
    let (true, Step::Scallop(height)) = (covers_all && run.session.pocket.is_none(), request.step) else {
        return Ok(Finding::default());
    };
    let shortest = match run.session.shortest_possible(&request.tooling.cutter, height, monitor) {
        Err(PlanError::Cancelled(cancelled)) => return Err(cancelled.into()),
        // No smooth surface can be fitted to the part: its directions are unknown.
        Err(_) => return Ok(Finding::default()),
        Ok(shortest) => shortest,
    };
    let time = run.machining_time_s;
    let (path, feed) = (run.path(), request.tooling.cutting.feed_rate);
    let links = least_links(path, scene.clearance);
    let shortest = ShortestFigures::new(&shortest, path, feed, time, links);
    let Some(s) = shortest else { return Ok(Finding::default()) };
    let per_cent = 100.0 * s.efficiency;
    let name = &run.request.name;
    let figure = Figure {
        key: "shortest",
        value: value(&s)?,
        rows: vec![
            (
                "shortest possible cutting length",
                format!("{:.1} mm ({per_cent:.1} % of this path)", s.cutting_length_mm),
            ),
            (
                "that length at the feed",
                format!("{:.1} s ({:.1} % of the machining time)", s.least_time_s, 100.0 * s.time_efficiency),
            ),
            (
                "least links between its passes",
                format!("{:.1} s (with them {:.1} %)", s.least_links_s, 100.0 * s.joined_efficiency),
            ),
        ],
        sentence: Some((
            "Shortest possible cutting length below the scallop target (widest strips)",
            format!(
                "{:.0} mm: {per_cent:.1} % of {name}; at the feed {:.1} % of its time, with least links {:.1} %",
                s.cutting_length_mm,
                100.0 * s.time_efficiency,
                100.0 * s.joined_efficiency
            ),
        )),
        ..Figure::default()
    };
    Ok(Finding { figure: Some(figure), ..Finding::default() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use motion::{ClPoint, Move};

    /// Passes along x, `gap` mm from one to the next, each cut one way with a retract behind it.
    fn passes(count: u32, gap: f64) -> Vec<[Point3; 2]> {
        let y = |k: u32| gap * f64::from(k);
        (0..count).map(|k| [Point3::new(0.0, y(k), 0.0), Point3::new(20.0, y(k), 0.0)]).collect()
    }

    fn path(passes: &[[Point3; 2]]) -> Toolpath {
        let to = |tip: Point3, kind, pass| Move { to: ClPoint::upright(tip), kind, feed_rate: 1.0, pass };
        let moves = passes.iter().zip(0..).flat_map(|([from, end], k)| {
            let middle = from + (end - from) * 0.5;
            [to(*from, MoveKind::Rapid, k), to(middle, MoveKind::Cut, k), to(*end, MoveKind::Cut, k)]
        });
        Toolpath::new(ClPoint::upright(Point3::origin()), moves.collect())
    }

    #[test]
    fn links_are_no_shorter_than_from_each_end_to_the_nearest_of_another_pass() {
        // From pass to pass one gap; or no more than a retract by the clearance.
        let length = |count, gap| least_links(&path(&passes(count, gap)), 2.0);
        let found = [length(2, 0.5), length(7, 0.5), length(7, 3.0), length(1, 0.5)];
        assert_eq!(found, [0.5, 3.0, 12.0, 0.0]);
        // Two passes end at other places: what joins them to the rest is longer, and either may be the last.
        let mut uneven = passes(5, 0.5);
        uneven[4][1].x = 21.0;
        let longer = least_links(&path(&uneven), 9.0);
        assert!((longer - 2.0).abs() < 1e-12, "{longer}");
        uneven[4] = [Point3::new(0.0, 2.5, 0.0), Point3::new(20.0, 3.0, 0.0)];
        let longer = least_links(&path(&uneven), 9.0);
        assert!((longer - 2.0).abs() < 1e-12, "{longer}");
        // One that closes can be left anywhere.
        uneven[1][1] = uneven[1][0];
        assert_eq!(least_links(&path(&uneven), 9.0), 0.0);
    }

    /// Against all orders and senses of passes at random places.
    #[test]
    fn no_order_of_passes_has_shorter_links() {
        let mut state = 7u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f64 / f64::from(1u32 << 24)
        };
        for _ in 0..50 {
            let ends: Vec<[Point3; 2]> =
                (0..4).map(|_| [0, 1].map(|_| Point3::new(random(), random(), random()))).collect();
            let bound = least_links(&path(&ends), 9.0);
            let mut shortest = f64::INFINITY;
            for order in 0..256 {
                let order: Vec<usize> = (0..4).map(|k| order >> (2 * k) & 3).collect();
                if (0..4).any(|k| !order.contains(&k)) {
                    continue;
                }
                for senses in 0..16 {
                    let end = |k: usize, last: usize| ends[order[k]][(senses >> k & 1) ^ last];
                    shortest = shortest.min((0..3).map(|k| (end(k + 1, 0) - end(k, 1)).norm()).sum());
                }
            }
            assert!(bound > 0.0 && bound <= shortest + 1e-12, "{bound} {shortest}");
        }
    }
}
