//! Which level curves become passes, and along which stretches, on a chart or on a mesh.
//!
//! Whole passes run along levels that `spacing` has placed. Where the surface or the field asks for a smaller
//! interval than the levels leave, further passes are put halfway between them, only along the stretches that
//! need one, and between those again.
//!
//! Kinks may be narrower than the points of a curve are apart. So the places between two points are checked
//! too.

use crate::moves::touch::Touch;
use crate::vocabulary::{Contact, Passes, PlanError};
use geometry::Point3;
use work::monitor::{self, Cancelled, Monitor};

/// How often the interval between two levels may be halved by further passes. Six times is a
/// sixty-fourth; only singular points of the field ask for more, and are measured.
const MOST_HALVINGS: usize = 6;

/// An interval may exceed the allowed one by this share before a further pass is put in: half a per cent is
/// one of the scallop height. What that leaves above the target is measured and corrected.
const INTERVAL_SLACK: f64 = 0.005;

/// Further passes reach beyond the stretch that needs them by this many allowed intervals, so that
/// their ends lie where the interval is wide enough without them.
const OVERLAP: f64 = 1.0;

/// A traced level curve, its points one sampling distance apart.
#[derive(Debug, Clone)]
pub(crate) struct Track<P> {
    /// Points, in order.
    pub points: Vec<P>,
    /// The last point is joined to the first one.
    pub closed: bool,
}

/// What neighbouring passes may do at a place.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Allowed {
    /// The step of ψ.
    pub step: f64,
    /// The distance on the surface, mm.
    pub width: f64,
}

/// A surface with a function whose level curves can be cut.
pub(crate) trait LevelSource: Sync {
    /// A point of a level curve.
    type Place: Copy;

    /// Every piece of a level.
    fn curves(&self, level: f64) -> Vec<Track<Self::Place>>;

    /// What a place allows; `None` where the surface or the function has no direction.
    fn allowed(&self, place: &Self::Place) -> Option<Allowed>;

    /// The least that is allowed from one point of a curve to before the next: kinks may be narrower than
    /// points are apart.
    fn least_allowed(&self, from: &Self::Place, _to: &Self::Place) -> Option<Allowed> {
        self.allowed(from)
    }

    /// The pass along a curve, or along a run of its points, in pieces between places where the cutter
    /// touches nothing.
    fn pass(
        &self,
        curve: &Track<Self::Place>,
        level: f64,
        run: Option<[usize; 2]>,
    ) -> Result<Vec<Vec<Point3>>, Cancelled>;

    /// The same of a tilted cutter; `None` where the cutter stands upright.
    fn touches(
        &self,
        _curve: &Track<Self::Place>,
        _level: f64,
        _run: Option<[usize; 2]>,
    ) -> Result<Option<Vec<Vec<Touch>>>, PlanError> {
        Ok(None)
    }

    /// Where the cutter touches along a curve, or along a run of its points.
    fn contacts(&self, curve: &Track<Self::Place>, run: Option<[usize; 2]>) -> Vec<Contact>;
}

impl<P: Copy> Track<P> {
    /// The points, the first one again at the end of a closed curve, and the run that is asked for; `None`
    /// for a run of nothing.
    pub fn opened(&self, run: Option<[usize; 2]>) -> Option<(Vec<P>, [usize; 2])> {
        let closing = self.points.first().filter(|_| self.closed);
        let points: Vec<P> = self.points.iter().chain(closing).copied().collect();
        let last = points.len().saturating_sub(1);
        let [first, end] = run.map_or([0, last], |[a, b]| [a, if self.closed { last } else { b }]);
        (end > first).then_some((points, [first, end]))
    }

    /// All points, or a run of them; the first one again at the end of a whole closed curve.
    pub fn along(&self, run: Option<[usize; 2]>) -> impl Iterator<Item = &P> {
        let [first, last] = run.unwrap_or([0, self.points.len().saturating_sub(1)]);
        let closing = self.points.first().filter(|_| self.closed && run.is_none());
        self.points.iter().take(last + 1).skip(first).chain(closing)
    }
}

/// Passes along the given levels (ascending, within `range`), and the further passes between them that
/// the allowed intervals ask for.
pub(crate) fn along_and_between<S: LevelSource>(
    source: &S,
    levels: &[f64],
    range: [f64; 2],
    sampling: f64,
    monitor: &dyn Monitor,
) -> Result<Passes, PlanError> {
    let filler = Filler { source, sampling, monitor };
    monitor.start("planning passes", levels.len() as u64);
    let work = work::parallel::try_map(levels.len() + 1, |k| {
        monitor::check(monitor)?;
        // Between two levels, or between a level and the border of the range.
        let below = k.checked_sub(1).map(|k| levels[k]);
        let gap = Gap {
            from: below.unwrap_or(range[0]),
            to: levels.get(k).copied().unwrap_or(range[1]),
            open_from: below.is_none(),
            open_to: k == levels.len(),
        };
        let mut passes = Passes::default();
        filler.fill(&gap, MOST_HALVINGS, &mut passes)?;
        let further = passes.passes.len();
        if let Some(&level) = levels.get(k) {
            for curve in source.curves(level) {
                filler.add(&curve, level, None, &mut passes)?;
            }
            monitor.advance(1);
        }
        Ok::<_, PlanError>((passes, further))
    })?;
    let further: usize = work.iter().map(|(_, further)| further).sum();
    let mut notes = Vec::new();
    if further > 0 {
        let passes = if further == 1 { "pass was" } else { "passes were" };
        notes.push(format!(
            "{further} short {passes} put between others where the interval had to be smaller"
        ));
    }
    let mut all = Passes { notes, ..Passes::default() };
    work.into_iter().for_each(|(passes, _)| all.append(passes));
    Ok(all)
}

/// Appends passes along the stretches of a level that need one, with their overlap: where points are
/// `needed`, and in any case at the point nearest to a place that is `distance` mm away, where no other point
/// of the level may lie between.
pub(crate) fn along_needed<S: LevelSource>(
    source: &S,
    level: f64,
    needed: &dyn Fn(&S::Place) -> bool,
    distance: &dyn Fn(&S::Place) -> f64,
    sampling: f64,
    passes: &mut Passes,
    monitor: &dyn Monitor,
) -> Result<(), PlanError> {
    let filler = Filler { source, sampling, monitor };
    let curves = source.curves(level);
    let places = curves.iter().enumerate().flat_map(|(c, curve)| {
        curve.points.iter().enumerate().map(move |(k, place)| ((c, k), distance(place)))
    });
    let nearest = places.min_by(|a, b| a.1.total_cmp(&b.1));
    let nearest = nearest.filter(|(_, distance)| *distance <= sampling).map(|(point, _)| point);
    for (c, curve) in curves.into_iter().enumerate() {
        filler.add_stretches(curve, level, passes, |k, points| {
            let wanted = nearest == Some((c, k)) || needed(&points[k]);
            wanted.then(|| source.allowed(&points[k]).map(|allowed| allowed.width)).flatten()
        })?;
    }
    Ok(())
}

/// Appends passes along the stretches of a curve that is no level for whose points `width` gives an interval,
/// mm, with their overlap.
pub(crate) fn along_stretches<S: LevelSource>(
    source: &S,
    curve: Track<S::Place>,
    width: &dyn Fn(usize) -> Option<f64>,
    sampling: f64,
    passes: &mut Passes,
    monitor: &dyn Monitor,
) -> Result<(), PlanError> {
    let filler = Filler { source, sampling, monitor };
    filler.add_stretches(curve, f64::NAN, passes, |k, _| width(k))
}

/// A range of ψ between two passes; at an open end stands the end of the range, not a pass.
#[derive(Debug, Clone, Copy)]
struct Gap {
    from: f64,
    to: f64,
    open_from: bool,
    open_to: bool,
}

impl Gap {
    /// Where a further pass would stand, and the interval of ψ that must hold for none to be needed:
    /// a pass serves half an interval beyond itself, so a gap with an open end is half of one.
    fn middle(&self) -> (f64, f64) {
        let width = self.to - self.from;
        match (self.open_from, self.open_to) {
            (false, false) => (self.from + 0.5 * width, width),
            (true, false) => (self.from + width / 3.0, 2.0 * width),
            (false, true) => (self.to - width / 3.0, 2.0 * width),
            // No pass at all: the first one stands in the middle.
            (true, true) => (self.from + 0.5 * width, f64::INFINITY),
        }
    }
}

/// Puts further passes into gaps.
struct Filler<'a, S> {
    source: &'a S,
    sampling: f64,
    monitor: &'a dyn Monitor,
}

impl<S: LevelSource> Filler<'_, S> {
    /// Appends the pass along a curve, or along a run of its points.
    fn add(
        &self,
        curve: &Track<S::Place>,
        level: f64,
        run: Option<[usize; 2]>,
        passes: &mut Passes,
    ) -> Result<(), PlanError> {
        // Contacts are those of the whole curve, once.
        let contacts = |k: usize| if k == 0 { self.source.contacts(curve, run) } else { Vec::new() };
        if let Some(pieces) = self.source.touches(curve, level, run)? {
            for (k, touches) in pieces.into_iter().enumerate() {
                passes.passes.push(touches.iter().map(|touch| touch.contact.point).collect());
                passes.touches.push(touches);
                passes.contacts.push(contacts(k));
            }
            return Ok(());
        }
        for (k, piece) in self.source.pass(curve, level, run)?.into_iter().enumerate() {
            passes.passes.push(piece);
            passes.contacts.push(contacts(k));
        }
        Ok(())
    }

    /// Appends the passes along the stretches of a curve for whose points `width` gives an interval, mm.
    fn add_stretches(
        &self,
        curve: Track<S::Place>,
        level: f64,
        passes: &mut Passes,
        width: impl Fn(usize, &[S::Place]) -> Option<f64>,
    ) -> Result<(), PlanError> {
        let (curve, runs) = self.stretches(curve, width);
        runs.into_iter().try_for_each(|run| self.add(&curve, level, Some(run), passes))
    }

    /// Appends the further passes that a gap needs.
    fn fill(&self, gap: &Gap, halvings: usize, passes: &mut Passes) -> Result<(), PlanError> {
        monitor::check(self.monitor)?;
        let (level, interval) = gap.middle();
        let before = passes.passes.len();
        for curve in self.source.curves(level) {
            let (curve, runs) = self.needed(curve, interval);
            for run in runs {
                self.add(&curve, level, Some(run), passes)?;
            }
        }
        if passes.passes.len() > before && halvings > 1 {
            self.fill(&Gap { to: level, open_to: false, ..*gap }, halvings - 1, passes)?;
            self.fill(&Gap { from: level, open_from: false, ..*gap }, halvings - 1, passes)?;
        }
        Ok(())
    }

    /// The runs of a curve (first and last point) on which an interval of ψ is wider on the surface
    /// than allowed, with their overlap. A closed curve is turned to begin outside of any run.
    fn needed(&self, curve: Track<S::Place>, interval: f64) -> (Track<S::Place>, Vec<[usize; 2]>) {
        let closed = curve.closed;
        self.stretches(curve, |k, points| {
            let n = points.len();
            let next = &points[if closed { (k + 1) % n } else { (k + 1).min(n - 1) }];
            let Allowed { step, width } = self.source.least_allowed(&points[k], next)?;
            (interval > step * (1.0 + INTERVAL_SLACK)).then_some(width)
        })
    }

    /// The runs of a curve (first and last point) for whose points `width` gives an interval, mm, with their
    /// overlap. A closed curve is turned to begin outside of any run.
    fn stretches(
        &self,
        mut curve: Track<S::Place>,
        width: impl Fn(usize, &[S::Place]) -> Option<f64>,
    ) -> (Track<S::Place>, Vec<[usize; 2]>) {
        let n = curve.points.len();
        let in_points = |width: f64| (OVERLAP * width / self.sampling).ceil() as usize;
        let mut reach: Vec<Option<usize>> = (0..n).map(|k| width(k, &curve.points).map(in_points)).collect();
        if curve.closed
            && let Some(calm) = reach.iter().position(Option::is_none)
        {
            curve.points.rotate_left(calm);
            reach.rotate_left(calm);
            curve.points.push(curve.points[0]);
            curve.closed = false;
        }
        let mut runs: Vec<[usize; 2]> = Vec::new();
        for (k, reach) in reach.iter().enumerate().filter_map(|(k, r)| r.map(|r| (k, r))) {
            let run = [k.saturating_sub(reach), (k + 1 + reach).min(n - 1)];
            match runs.last_mut() {
                Some(last) if run[0] <= last[1] + 1 => last[1] = last[1].max(run[1]),
                _ => runs.push(run),
            }
        }
        (curve, runs)
    }
}

/// The pass of some moves: a closed one ends where it begins, and one move alone is none.
pub(crate) fn whole_pass(mut moves: Vec<Point3>, closed: bool) -> Vec<Vec<Point3>> {
    if moves.len() < 2 {
        return Vec::new();
    }
    if closed {
        // It comes back to within rounding.
        let last = moves.len() - 1;
        moves[last] = moves[0];
    }
    vec![moves]
}
