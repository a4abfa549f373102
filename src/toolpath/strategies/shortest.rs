//! Streamlines along the feed directions that make the whole path quickest, or shortest.
//!
//! A pass costs `1 − κ_f r` mm of the cutter's way for each mm along the surface (κ_f its curvature along the
//! feed, r the cutter's corner radius) and serves a strip of width w(direction). No path that holds the
//! scallop and cuts no deeper than the part is shorter than the integral of the least `(1 − κ_f r)/w` over
//! all directions: [`shortest_possible`]. (Chords cut deeper by shares of their tolerance, and what is cut
//! around the ends of passes is left out: about half a square strip at each.) Directions that reach it
//! everywhere seldom belong to passes that also lie one strip apart. The stream function that costs least in
//! all ([`super::stream_search`]) settles between both.
//!
//! A machine takes time for links from pass to pass and in bends that it cannot run at the feed. By machining
//! time, both have the price that they have on the machine, in mm of pass at the feed, and of the few best
//! functions that one is taken whose passes, joined, take the least time. By length, both have a small price
//! of their own, and the shortest passes are taken.
//!
//! The fronts of iso-scallop passes are among the starts. Where their own passes are still better than those
//! of all functions found, they are taken, and named so. Closed passes one inside the other are joined to
//! spirals where that is quicker than links ([`spirals`]).
//!
//! Enters: a part and the scallop height. Leaves: passes. Lengths in mm.

use std::borrow::Cow;
use std::f64::consts::PI;
use std::fmt::{self, Write as _};
use std::sync::Arc;

use super::direction_keys;
use super::iso_scallop::{border_name, fronts, places};
use super::mesh_passes::{self, Aim, widest_at};
use super::stream_search::{Found, Prices, Search};
use crate::levels::level_passes::along_levelled;
use crate::levels::{obedience, planned_field, spirals};
use crate::strategies::iso_scallop::FrontStart;
use crate::surface::chart::Chart;
use crate::surface::feed;
use crate::surface::mesh_surface::{reachable, wants_mesh};
use crate::vocabulary::{
    COMPARED_CHORDS, Definition, FeedDirection, LevelFunction, Levelled, Links, PassSettings, Passes,
    PlanError, Strategy, Task,
};
use cutter::Cutter;
use field::ShortestPossible;
use geometry::Vector3;
use keys::{toml_number, word_of};
use part::Part;
use work::monitor::{self, Cancelled, Monitor};
use work::parallel;

/// By length alone: what a rad counts for that passes turn by since the surface is bent along them, in radii
/// of the cutter.
const TURN: f64 = 0.78;

/// By length alone: what an end of a pass counts, in radii of the cutter: half of the link to the next pass
/// and its turn.
const END: f64 = 0.28;

/// Places a side, and directions over half a turn, of the shortest possible length. With twice as many it
/// changes by less than 0.1 % on the shipped parts.
const PLACES: usize = 150;
const DIRECTIONS: usize = 36;

/// Plans within this share of the best one are compared once more by their own chords: longer ones change
/// what they take by about as much.
const AS_GOOD: f64 = 5e-4;

/// The shortest possible path below the scallop height `h`, mm, by the widest strip over all directions at
/// each place: of patches and of smooth surfaces that are fitted to meshes, as far as the part lies below, or
/// of the facets of meshes with holes and steps.
///
/// # Errors
/// When no smooth surface can be fitted to a mesh, and when cancelled.
pub fn shortest_possible(
    part: &Part,
    cutter: &Cutter,
    h: f64,
    monitor: &dyn Monitor,
) -> Result<ShortestPossible, PlanError> {
    let mut all: Vec<Least> = Vec::new();
    if part.patches().is_empty() && wants_mesh(part, cutter) {
        for piece in reachable(part, cutter)?.pieces {
            let mesh = &piece.mesh;
            let of_facet = |t: usize| {
                monitor::check(monitor)?;
                let Some((normal, bend)) = piece.facet(t) else { return Ok(None) };
                let ratio = |t: &Vector3| (1.0 - bend.along(t) * cutter.corner_radius()).max(0.0);
                let width = |t: &Vector3| widest_at(cutter, &normal, &normal.cross(t), &bend, h);
                let [a, b, _] = mesh.corners(t);
                Ok::<_, Cancelled>(Least::of(mesh.area(t), &(b - a), &normal, ratio, width))
            };
            all.extend(parallel::try_map(mesh.triangles().len(), of_facet)?.into_iter().flatten());
        }
    } else {
        for chart in Chart::all(part, cutter, crate::vocabulary::Guide::default())? {
            let (places, cell) = places(&chart, PLACES);
            let at = |k: usize| {
                monitor::check(monitor)?;
                let (_, p) = &places[k];
                // A surface that is fitted to a mesh goes on beyond its border.
                if part.patches().is_empty() && part.highest_at(p.jet.p.x, p.jet.p.y).is_none() {
                    return Ok(None);
                }
                let (e, f, g) = p.jet.first_form();
                let area = cell * (e * g - f * f).max(0.0).sqrt();
                let ratio = |t: &Vector3| p.offset_ratio(cutter, t);
                let width = |t: &Vector3| p.widest_strip(cutter, t, h);
                Ok::<_, Cancelled>(Least::of(area, &p.jet.du, &p.normal, ratio, width))
            };
            all.extend(parallel::try_map(places.len(), at)?.into_iter().flatten());
        }
    }
    let sum = |of: &dyn Fn(&Least) -> f64| all.iter().map(|least| least.area * of(least)).sum::<f64>();
    let limited = sum(&|least| if least.limited { 1.0 } else { 0.0 });
    Ok(ShortestPossible {
        cutting_mm: sum(&|least| least.cutting),
        contact_mm: sum(&|least| least.contact),
        limited_fraction: limited / sum(&|_| 1.0).max(f64::MIN_POSITIVE),
    })
}

/// The least over all directions at a place that stands for an area, mm².
struct Least {
    area: f64,
    /// Of the cutter's way for each mm² of the surface, and of that of the contact, 1/mm.
    cutting: f64,
    contact: f64,
    /// Whether the surface is as concave as the cutter in one of them.
    limited: bool,
}

impl Least {
    /// By how much longer than the contact's the cutter's way is along a unit tangent, and by the strip's
    /// width there.
    fn of(
        area: f64,
        tangent: &Vector3,
        normal: &Vector3,
        ratio: impl Fn(&Vector3) -> f64,
        width: impl Fn(&Vector3) -> (f64, bool),
    ) -> Option<Self> {
        let t0 = tangent.try_normalize(1e-300)?;
        let b0 = normal.cross(&t0);
        let mut least = Self { area, cutting: f64::INFINITY, contact: f64::INFINITY, limited: false };
        for k in 0..DIRECTIONS {
            let (sin, cos) = (PI * k as f64 / DIRECTIONS as f64).sin_cos();
            let t: Vector3 = t0 * cos + b0 * sin;
            let (width, too_concave) = width(&t);
            least.cutting = least.cutting.min(ratio(&t) / width);
            least.contact = least.contact.min(1.0 / width);
            least.limited |= too_concave;
        }
        Some(least)
    }
}

/// What the best path has the least of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Objective {
    /// Machining time: passes at the feed, the bends that the machine slows down in, links.
    #[default]
    Time,
    /// Length of all passes.
    Length,
}

impl Objective {
    /// Its words in scenes.
    pub(super) const WORDS: [(&str, Self); 2] = [("time", Self::Time), ("length", Self::Length)];

    /// What passes have of it.
    pub(super) fn worth(self, task: &Task<'_>, passes: &Passes) -> Result<f64, PlanError> {
        match self {
            Self::Time => (task.pace.duration)(passes, task.settings.chord_tolerance),
            Self::Length => Ok(passes.length()),
        }
    }

    /// What the user is told of passes along the best function.
    pub(super) fn told(self) -> &'static str {
        match self {
            Self::Time => "passes follow the stream function of least machining time",
            Self::Length => "passes follow the stream function of the shortest path",
        }
    }
}

/// Streamlines of the feed directions with the quickest or shortest path: each one strip from the next, their
/// first curve searched.
#[derive(Debug, Clone, PartialEq)]
pub struct ShortestStreamline {
    /// A direction to keep to, and how much dearer a mm of pass square to it is, in mm: 0 leaves all freedom,
    /// a great number none.
    pub toward: Option<(FeedDirection, f64)>,
    /// What the best path has the least of; with a direction, closeness to it comes first.
    pub objective: Objective,
}

impl Strategy for ShortestStreamline {
    fn definition(&self) -> &'static Definition {
        &super::streamline::DEFINITION
    }

    fn write(&self, out: &mut String) -> fmt::Result {
        let Some((toward, dearer)) = &self.toward else {
            let objective = word_of(&Objective::WORDS, &self.objective);
            return writeln!(out, "direction = \"shortest\"\nobjective = \"{objective}\"");
        };
        direction_keys::write(out, toward, "\n")?;
        writeln!(out, "\nfollow = {}  # mm more for each mm of pass square to it", toml_number(*dearer))
    }

    fn passes(&self, task: &Task<'_>) -> Result<Passes, PlanError> {
        let toward = self.toward.as_ref().map(|(direction, dearer)| (direction, *dearer));
        if self.on_facets(task) {
            mesh_passes::on_mesh(task, Aim::Shortest(toward, self.objective))
        } else {
            passes(task, toward, self.objective)
        }
    }

    fn on_facets(&self, task: &Task<'_>) -> bool {
        task.plans_on_mesh()
    }

    fn shows_field(&self) -> bool {
        true
    }

    fn usual_links(&self) -> Links {
        // What takes the least time is joined so.
        match (&self.toward, self.objective) {
            (None, Objective::Time) => Links::Surface,
            _ => Links::Retract,
        }
    }

    fn direction_mut(&mut self) -> Option<&mut FeedDirection> {
        self.toward.as_mut().map(|(direction, _)| direction)
    }
}

/// Plans passes along the stream function with the shortest path.
fn passes(
    task: &Task<'_>,
    toward: Option<(&FeedDirection, f64)>,
    objective: Objective,
) -> Result<Passes, PlanError> {
    let Task { part, cutter, ref settings, .. } = *task;
    let charts = Chart::all(part, cutter, settings.guide())?;
    let mut all = Passes::default();
    if let Some((direction, _)) = toward {
        let parameters: Vec<_> = charts.iter().map(|chart| chart.domain).collect();
        all.notes.extend(feed::check(direction, &part.bounds(), &parameters)?);
    }
    for (k, chart) in charts.iter().enumerate() {
        let spread = match toward {
            Some((direction, dearer)) => Some((feed::on_chart(direction, chart, cutter)?, dearer)),
            None => None,
        };
        let spread = spread.as_ref().map(|(direction, dearer)| (&**direction, *dearer));
        let mut planned = on_chart(task, chart, [k, charts.len()], spread, objective)?;
        if let (Some((direction, _)), Some((spread, _))) = (toward, spread) {
            planned_field::set_directions(&mut planned.field, part, chart, |[u, v]| {
                chart.at(u, v)?.feed(spread, cutter)
            });
            planned.obedience = obedience::on_chart(task, chart, &mut planned.contacts, [direction, spread]);
        }
        all.append_patch([k, charts.len()], planned);
    }
    Ok(all)
}

/// Passes along the best function of one of so many charts, which is searched, or that of an earlier plan.
pub(super) fn on_chart(
    task: &Task<'_>,
    chart: &Chart,
    [k, of]: [usize; 2],
    toward: Option<(&FeedDirection, f64)>,
    objective: Objective,
) -> Result<Passes, PlanError> {
    let passes = match task.earlier_on_chart(k, of) {
        Some(levelled) => along_levelled(task, chart, levelled)?,
        None => searched(task, chart, toward, objective)?,
    };
    if toward.is_none() && objective == Objective::Time {
        spirals::where_quicker(task, passes)
    } else {
        Ok(passes)
    }
}

/// Passes along the best function of one chart, which is searched.
fn searched(
    task: &Task<'_>,
    chart: &Chart,
    toward: Option<(&FeedDirection, f64)>,
    objective: Objective,
) -> Result<Passes, PlanError> {
    let Task { cutter, ref settings, ref pace, monitor, .. } = *task;
    let turns = |curvature: f64| TURN * cutter.radius() * curvature.abs();
    let slowed = |curvature: f64| pace.slowed(curvature, cutter.corner_radius());
    let prices = match objective {
        Objective::Time => Prices { end: 0.5 * pace.link, turning: &slowed },
        Objective::Length => Prices { end: END * cutter.radius(), turning: &turns },
    };
    // With a direction to keep to, fronts lead elsewhere; and not every surface carries one.
    let fronts = match toward.is_none().then(|| fronts(task, chart, FrontStart::BestBorder)) {
        Some(Ok(fronts)) => fronts,
        Some(Err(PlanError::Cancelled(cancelled))) => return Err(cancelled.into()),
        _ => Vec::new(),
    };
    let search = Search { chart, cutter, step: settings.step, prices, toward, fronts: &fronts, monitor };
    let mut found = search.run()?;
    // With a direction to keep to, the best comes first: a shorter path may be one that leaves the direction.
    found.truncate(if toward.is_some() { 1 } else { found.len() });
    let levelled = |Found { function, length, along }: Found| {
        let planned_as = along.map_or(Cow::Borrowed(SEARCHED), |border| {
            format!("{SEARCHED} from the front that starts {}", border_name(border)).into()
        });
        let told = toward.is_none().then(|| (objective.told().to_owned(), length));
        Levelled { function: LevelFunction::Chart(Arc::new(function)), planned_as, told }
    };
    let mut candidates: Vec<Levelled> = found.into_iter().map(levelled).collect();
    // A front, whose passes are packed without any slack, may still be better.
    let tried = fronts.len();
    candidates.extend(fronts.into_iter().next().map(|front| front.levelled(tried)));
    let mut near: Vec<usize> = (0..candidates.len()).collect();
    if near.len() > 1 {
        near =
            compared(task, chart, &candidates, &near, COMPARED_CHORDS, objective)?.map(|(k, _)| k).collect();
    }
    match near[..] {
        [] => Ok(Passes::default()),
        [k] => along_levelled(task, chart, &candidates[k]),
        _ => Ok(compared(task, chart, &candidates, &near, 1.0, objective)?
            .next()
            .map(|(_, passes)| passes)
            .unwrap_or_default()),
    }
}

/// Which of some functions have the best passes, by chords so many times `longer` than asked for, the best
/// one first, and all that are nearly as good.
fn compared(
    task: &Task<'_>,
    chart: &Chart,
    candidates: &[Levelled],
    tried: &[usize],
    longer: f64,
    objective: Objective,
) -> Result<impl Iterator<Item = (usize, Passes)> + use<>, PlanError> {
    let settings = PassSettings { chord_tolerance: longer * task.settings.chord_tolerance, ..task.settings };
    let task = &Task { settings, ..*task };
    let mut found: Vec<(f64, usize, Passes)> = Vec::with_capacity(tried.len());
    for &k in tried {
        let passes = along_levelled(task, chart, &candidates[k])?;
        if !passes.passes.is_empty() {
            found.push((objective.worth(task, &passes)?, k, passes));
        }
    }
    // Of those that are as good the first stays first.
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let most = found.first().map_or(0.0, |(least, ..)| least * (1.0 + AS_GOOD));
    Ok(found.into_iter().take_while(move |(its, ..)| *its <= most).map(|(_, k, passes)| (k, passes)))
}

/// What such a function is.
pub(crate) const SEARCHED: &str = "stream function, searched";
