//! The stream function with the best path on a mesh: as `shortest`, by linear elements.
//!
//! The gradient of linear elements jumps from triangle to triangle, so ψ is judged by recovered gradients. A
//! little stiffness keeps it from kinks. Starts are followed to their minima on a mesh of fewer vertices, where a
//! step takes a quarter of the time; only the few best of these are gone on with on the whole mesh.

use std::f64::consts::PI;

use super::mesh_passes::width_at;
use super::shortest::Objective;
use super::stream_search::{Prices, keep_promising, turning};
use crate::surface::mesh_surface::MeshSurface;
use crate::vocabulary::{Guide, Step, Task};
use cutter::Cutter;
use field::mesh::{Bend, Coarser, gradient_terms};
use field::{Front, Gradients, Minimiser, Packed, Roughness, Rounds, Site};
use geometry::Vector3;
use work::monitor::{Cancelled, Monitor};
use work::parallel;

/// Straight passes to start from, over half a turn.
const STARTS: usize = 6;

/// Functions that are gone on with, and planned, for the least time: what they promise is not what their
/// levels give.
const MOST_PLANNED: usize = 3;

/// Two starts led to the same minimum where the levels of both are no farther apart than this, in passes (root
/// mean square).
const SAME_LEVELS: f64 = 0.1;

/// Intervals are judged by the gradients at vertices, as passes see them; those of triangles count by this
/// share, for the unevenness that vertices do not see.
const DAMPING: f64 = 0.2;

/// Where a pass bends by the radius of the cutter, it counts as longer by this share. Less leaves bends,
/// which linear elements do not mind; on three patches a tenth of it makes passes 1 % shorter that turn by a
/// third more.
const BEND: f64 = 0.3;

/// The strip beyond borders counts this share of its area: in the end ψ goes on in it as it comes to them.
const STRIP_SHARE: f64 = 0.02;

/// ψ at the vertices, and what its passes cost: of the shortest passes, or the few that promise the least
/// time, the most promising first. `toward` has at each vertex a direction and how much dearer passes square
/// to it are; `further` is a start besides straight passes. Starts are gone on with on the `coarser` surface.
///
/// # Errors
/// [`Cancelled`] when the monitor says so.
pub(crate) fn shortest_streams(
    surface: &MeshSurface,
    coarser: Option<&(MeshSurface, Coarser)>,
    task: &Task<'_>,
    toward: Option<&[(Vector3, f64)]>,
    further: Option<Vec<f64>>,
    objective: Objective,
) -> Result<Vec<Packed>, Cancelled> {
    let monitor = task.monitor;
    let slowed = |curvature: f64| task.pace.slowed(curvature, task.cutter.corner_radius());
    let prices = prices(task, if toward.is_none() { objective } else { Objective::Length }, &slowed);
    let most = if prices.end > 0.0 { MOST_PLANNED } else { 1 };
    let gone_on_with = if coarser.is_some() { 2 * most } else { most };
    let all = STARTS + usize::from(further.is_some()) + gone_on_with;
    monitor.start("searching directions", all as u64);
    let starts = match coarser {
        Some((coarse, carry)) => {
            let own = |v: usize| carry.kept[coarse.origin[v] as usize] as usize;
            let count = coarse.mesh.points().len();
            let toward = toward.map(|toward| (0..count).map(|v| toward[own(v)]).collect::<Vec<_>>());
            let further = further.as_ref();
            let further =
                further.map(|values| coarse.continued((0..count).map(|v| values[own(v)]).collect()));
            let search = Search::new(coarse, task, toward.as_deref(), prices);
            let found = search.minima_of_starts(coarse, (further, most), monitor)?;
            let on_finer = |packed: Packed| {
                let mut values = carry.on_finer(&packed.coefficients[..carry.kept.len()]);
                values.resize(surface.mesh.points().len(), 0.0);
                surface.continued(values)
            };
            found.into_iter().map(on_finer).collect()
        }
        None => Vec::new(),
    };
    let search = Search::new(surface, task, toward, prices);
    let mut found = if starts.is_empty() {
        search.minima_of_starts(surface, (further, most), monitor)?
    } else {
        let Some(minimiser) = search.minimiser() else { return Ok(Vec::new()) };
        search.minima(&minimiser, starts, Rounds::Last, monitor)?
    };
    for packed in &mut found {
        packed.coefficients = surface.continued(std::mem::take(&mut packed.coefficients));
    }
    Ok(found)
}

/// The function with the best path near one of an earlier plan, where intervals are those that were measured
/// since; `None` where the surface does not determine one.
///
/// # Errors
/// [`Cancelled`] when the monitor says so.
pub(crate) fn gone_on(
    surface: &MeshSurface,
    task: &Task<'_>,
    from: &[f64],
    objective: Objective,
) -> Result<Option<Vec<f64>>, Cancelled> {
    task.monitor.start("searching directions", 1);
    let slowed = |curvature: f64| task.pace.slowed(curvature, task.cutter.corner_radius());
    let search = Search::new(surface, task, None, prices(task, objective, &slowed));
    let Some(minimiser) = search.minimiser() else { return Ok(None) };
    let found = search.minima(&minimiser, vec![from.to_vec()], Rounds::Last, task.monitor)?;
    Ok(found.into_iter().next().map(|packed| surface.continued(packed.coefficients)))
}

/// What ends and turns cost.
fn prices<'a>(task: &Task<'_>, objective: Objective, slowed: &'a (dyn Fn(f64) -> f64 + Sync)) -> Prices<'a> {
    match objective {
        Objective::Time => Prices { end: 0.5 * task.pace.link, turning: slowed },
        Objective::Length => Prices { end: 0.0, turning: &|_| 0.0 },
    }
}

/// A surface as the minimiser sees it.
struct Search {
    sites: Vec<Site>,
    gradients: Gradients,
    roughness: Roughness,
    /// Passes to a mm across them, in the mean.
    density: f64,
    /// Price of an end of a pass, mm.
    end: f64,
}

impl Search {
    fn new(
        surface: &MeshSurface,
        task: &Task<'_>,
        toward: Option<&[(Vector3, f64)]>,
        prices: Prices<'_>,
    ) -> Self {
        let Task { cutter, ref settings, .. } = *task;
        let mesh = &surface.mesh;
        let (own, count) = (surface.own_triangles, mesh.points().len());
        let share = |t: usize| if t < own { mesh.area(t) } else { STRIP_SHARE * mesh.area(t) };
        let mut around = vec![0.0; count];
        for (t, corners) in mesh.triangles().iter().enumerate() {
            corners.iter().for_each(|&v| around[v as usize] += share(t) / 3.0);
        }
        let pricing =
            Pricing { surface, cutter, step: settings.step, guide: settings.guide(), toward, prices };
        let found = parallel::map(count + mesh.triangles().len(), |k| match k.checked_sub(count) {
            None => pricing.at_vertex(k, (1.0 - DAMPING) * around[k]),
            Some(t) => pricing.on_triangle(t, DAMPING * share(t)),
        });
        let recovered = gradient_terms(mesh);
        let mut gradients = Gradients::new(count);
        let mut sites = Vec::with_capacity(found.len());
        for (k, site) in found.into_iter().enumerate() {
            let Some((mut site, [e1, e2])) = site else { continue };
            let flat = |(v, gradient): (u32, Vector3)| (v, [gradient.dot(&e1), gradient.dot(&e2)]);
            match k.checked_sub(count) {
                None => gradients.push(&site, recovered[k].iter().copied().map(flat)),
                Some(t) => {
                    site.stiff_area = share(t);
                    let hats = mesh.triangles()[t].into_iter().zip(mesh.hat_gradients(t));
                    gradients.push(&site, hats.map(flat));
                }
            }
            sites.push(site);
        }
        if prices.end > 0.0 {
            for [t, k] in border_sides(surface) {
                let Some((mut site, [e1, e2])) = pricing.on_triangle(t, 0.0) else { continue };
                let corners = mesh.corners(t);
                let side = corners[(k + 1) % 3] - corners[k];
                site.border = Some([side.dot(&e1), side.dot(&e2)]);
                let hats = mesh.triangles()[t].into_iter().zip(mesh.hat_gradients(t));
                gradients.push(&site, hats.map(|(v, gradient)| (v, [gradient.dot(&e1), gradient.dot(&e2)])));
                sites.push(site);
            }
        }
        let area: f64 = sites.iter().map(|site| site.area).sum();
        let density = sites.iter().map(|site| site.area * site.front.mean_slowness()).sum::<f64>() / area;
        let roughness = roughness(surface, cutter, density);
        Self { sites, gradients, roughness, density, end: prices.end }
    }

    /// To where straight passes and a further start lead: at most so many functions, the shortest passes or
    /// what promises the least time.
    fn minima_of_starts(
        &self,
        surface: &MeshSurface,
        (further, most): (Option<Vec<f64>>, usize),
        monitor: &dyn Monitor,
    ) -> Result<Vec<Packed>, Cancelled> {
        let Some(minimiser) = self.minimiser() else { return Ok(Vec::new()) };
        let straight = |k: usize| -> Vec<f64> {
            let (sin, cos) = (PI * k as f64 / STARTS as f64).sin_cos();
            surface.mesh.points().iter().map(|p| self.density * (cos * p.x + sin * p.y)).collect()
        };
        let starts = (0..STARTS).map(straight).chain(further).collect();
        let found = self.minima(&minimiser, starts, Rounds::First, monitor)?;
        let promising = different(found.into_iter().map(|packed| packed.coefficients), most);
        let mut found = self.minima(&minimiser, promising, Rounds::Last, monitor)?;
        keep_promising(&mut found, self.end, |found| found, |_, _| true);
        Ok(found)
    }

    /// `None` where the surface does not determine a function.
    fn minimiser(&self) -> Option<Minimiser<'_>> {
        Minimiser::new(&self.sites, &self.gradients, &self.roughness)
    }

    /// The minima to which functions lead, what promises most first.
    fn minima(
        &self,
        minimiser: &Minimiser<'_>,
        starts: Vec<Vec<f64>>,
        rounds: Rounds,
        monitor: &dyn Monitor,
    ) -> Result<Vec<Packed>, Cancelled> {
        let found = parallel::try_map(starts.len(), |k| {
            let found = minimiser.run(self.end, starts[k].clone(), rounds, monitor);
            monitor.advance(1);
            found
        })?;
        let mut found: Vec<Packed> = found.into_iter().flatten().collect();
        found.sort_by(|a, b| a.priced(self.end).total_cmp(&b.priced(self.end)));
        Ok(found)
    }
}

/// The first of some functions whose levels are not those of one before, at most so many.
fn different(functions: impl Iterator<Item = Vec<f64>>, most: usize) -> Vec<Vec<f64>> {
    let mut kept: Vec<Vec<f64>> = Vec::new();
    for function in functions {
        if kept.len() < most && !kept.iter().any(|other| have_same_levels(other, &function)) {
            kept.push(function);
        }
    }
    kept
}

/// Whether two functions differ by a constant alone, within [`SAME_LEVELS`], whichever way they rise.
fn have_same_levels(a: &[f64], b: &[f64]) -> bool {
    let count = a.len() as f64;
    [1.0, -1.0].into_iter().any(|sense| {
        let apart = || a.iter().zip(b).map(|(a, b)| a - sense * b);
        let mean = apart().sum::<f64>() / count;
        apart().map(|d| (d - mean).powi(2)).sum::<f64>() <= count * SAME_LEVELS * SAME_LEVELS
    })
}

/// The sides of the part's own triangles along its borders: triangle and side.
fn border_sides(surface: &MeshSurface) -> impl Iterator<Item = [usize; 2]> {
    let sides = (0..surface.own_triangles).flat_map(|t| (0..3).map(move |k| [t, k]));
    sides.filter(|&[t, k]| surface.mesh.neighbour(t, k).is_none_or(|n| n >= surface.own_triangles))
}

/// About `BEND ∫ r² |∇∇ψ|² dA/|∇ψ|`, from the jumps of the gradient at edges.
fn roughness(surface: &MeshSurface, cutter: &Cutter, density: f64) -> Roughness {
    let mesh = &surface.mesh;
    let mut roughness = Roughness::default();
    for t in 0..mesh.triangles().len() {
        for k in 0..3 {
            let Some(n) = mesh.neighbour(t, k).filter(|&n| n > t) else { continue };
            let corners = mesh.corners(t);
            let edge = corners[(k + 1) % 3] - corners[k];
            let mut terms: Vec<(u32, f64)> = Vec::with_capacity(6);
            for (t, edge) in [(t, edge), (n, -edge)] {
                let Some(outward) = edge.cross(&mesh.area_vector(t)).try_normalize(1e-300) else { continue };
                let hats = mesh.triangles()[t].into_iter().zip(mesh.hat_gradients(t));
                terms.extend(hats.map(|(v, gradient)| (v, gradient.dot(&outward))));
            }
            // A jump over the edge's share of both triangles, whose thirds are about as wide as the edge's
            // distance from their middles.
            let area = (mesh.area(t) + mesh.area(n)) / 3.0;
            let weight = BEND * cutter.radius().powi(2) / density * edge.norm_squared() / area;
            roughness.push(weight, terms);
        }
    }
    roughness
}

/// What passes may do and cost at places of a surface.
struct Pricing<'a> {
    surface: &'a MeshSurface,
    cutter: &'a Cutter,
    step: Step,
    guide: Guide<'a>,
    toward: Option<&'a [(Vector3, f64)]>,
    prices: Prices<'a>,
}

impl Pricing<'_> {
    fn at_vertex(&self, v: usize, area: f64) -> Option<(Site, [Vector3; 2])> {
        let surface = self.surface;
        let bend = &surface.bends[surface.origin[v] as usize];
        self.site(&surface.mesh.normals()[v], surface.mesh.frame(v), bend, v, area)
    }

    fn on_triangle(&self, t: usize, area: f64) -> Option<(Site, [Vector3; 2])> {
        let mesh = &self.surface.mesh;
        let normal = mesh.area_vector(t).try_normalize(1e-300)?;
        let [a, b, _] = mesh.corners(t);
        let e1 = (b - a).try_normalize(1e-300)?;
        let mut bend = Bend::default();
        for v in mesh.triangles()[t] {
            bend.add(&self.surface.bends[self.surface.origin[v as usize] as usize], 1.0 / 3.0);
        }
        self.site(&normal, [e1, normal.cross(&e1)], &bend, mesh.triangles()[t][0] as usize, area)
    }

    /// With the direction wanted at a vertex; and the two tangents that its components are of.
    fn site(
        &self,
        normal: &Vector3,
        [e1, e2]: [Vector3; 2],
        bend: &Bend,
        vertex: usize,
        area: f64,
    ) -> Option<(Site, [Vector3; 2])> {
        let factor = self.guide.corrected(1.0, &self.surface.mesh.points()[vertex], self.step);
        let width =
            |[x, y]: [f64; 2]| factor * width_at(self.cutter, normal, &(e1 * x + e2 * y), bend, self.step).0;
        let front = Front::new((1.0, 0.0, 1.0), width)?;
        // Across the passes at three angles; the feed is square to them.
        let costs = [0, 1, 2].map(|k| {
            let (sin, cos) = (PI * f64::from(k) / 3.0).sin_cos();
            let feed = e2 * cos - e1 * sin;
            let away = self.toward.map_or(0.0, |toward| {
                let (direction, dearer) = toward[vertex];
                dearer * (1.0 - feed.dot(&direction).powi(2))
            });
            1.0 - bend.along(&feed) * self.cutter.corner_radius() + away
        });
        let turning = turning(&self.prices, |angle| {
            let (sin, cos) = angle.sin_cos();
            bend.along(&(e2 * cos - e1 * sin))
        });
        let mut cost = Site::harmonic(costs);
        (0..3).for_each(|k| cost[k] += turning[k]);
        let leaving = self.toward.map_or(0.0, |toward| Site::mean_of_leaving(toward[vertex].1));
        Some((Site { area, stiff_area: 0.0, front, cost, turning, leaving, border: None }, [e1, e2]))
    }
}

#[cfg(test)]
mod tests {
    use super::super::mesh_passes::level_interval;
    use super::*;
    use crate::surface::mesh_surface::reachable;
    use crate::vocabulary::{Pace, PassSettings};
    use geometry::{Point3, TriangleMesh};
    use part::Part;
    use work::monitor::Silent;

    /// A surface of hills and hollows as facets.
    fn hills() -> Part {
        let (nx, ny) = (36, 30);
        let at = |k: usize| (k % nx, k / nx);
        let point = |k: usize| {
            let (x, y) = (at(k).0 as f64, at(k).1 as f64);
            Point3::new(x, y, 1.5 * (x / 5.0 + 0.4 * (y / 4.0).sin()).sin() * (y / 6.0).cos())
        };
        let cells = (0..nx * (ny - 1)).filter(|&k| at(k).0 + 1 < nx);
        let corners = |k: usize| [k, k + 1, k + nx + 1, k + nx].map(|k| k as u32);
        let triangles = cells.flat_map(|k| {
            let [a, b, c, d] = corners(k);
            [[a, b, c], [a, c, d]]
        });
        Part::from_mesh(TriangleMesh::new((0..nx * ny).map(point).collect(), triangles.collect()).unwrap().0)
    }

    /// Where starts are compared on few vertices, the minimum is the same as where all of them are asked.
    #[test]
    fn starts_compared_on_a_coarser_mesh_lead_to_as_good_a_function() {
        let (part, cutter) = (hills(), Cutter::ball(6.0).unwrap());
        let step = Step::Scallop(0.02);
        let flat = level_interval(&cutter, 0.02);
        let piece = &reachable(&part, &cutter).unwrap().pieces[0];
        let surface = MeshSurface::with_margin(piece, flat).unwrap();
        let coarser = surface.coarser(piece, &cutter).unwrap();
        assert!(3 * coarser.0.mesh.points().len() < surface.mesh.points().len());
        let settings = PassSettings::upright(step, 0.5);
        let pace = Pace { duration: &|passes, _| Ok(passes.length()), link: 2.0, bend: 0.1 };
        let task = Task { part: &part, cutter: &cutter, settings, wants_mesh: true, pace, monitor: &Silent };
        for (objective, end) in [(Objective::Length, 0.0), (Objective::Time, 0.5 * pace.link)] {
            let priced = |coarser| {
                let found = shortest_streams(&surface, coarser, &task, None, None, objective).unwrap();
                assert!(found[0].short < 0.01);
                found[0].priced(end)
            };
            let [whole, coarse] = [priced(None), priced(Some(&coarser))];
            assert!(coarse <= 1.001 * whole, "{coarse} {whole}");
        }
    }

    #[test]
    fn starts_that_led_to_the_same_levels_are_gone_on_with_once() {
        let along =
            |x: f64, y: f64| (0..400).map(|k| x * f64::from(k % 20) + y * f64::from(k / 20)).collect();
        let first: Vec<f64> = along(0.5, 0.0);
        let turned: Vec<f64> = first.iter().map(|psi| 7.0 - psi + 0.02 * (97.0 * psi).sin()).collect();
        let square: Vec<f64> = along(0.0, 0.5);
        let found = [first.clone(), turned, square.clone(), along(0.3, 0.3)];
        assert_eq!(different(found.clone().into_iter(), 2), [first.clone(), square.clone()]);
        assert_eq!(different(found.into_iter(), 9).len(), 3);
    }
}
