//! Gaps between passes on a chart that halving intervals of ψ does not find.
//!
//! Enters: the contacts of planned passes. Leaves: further short passes along levels of ψ, until no place
//! lies farther from every contact than half the interval that is allowed there. Halving looks at one level
//! between two others and takes ψ to rise evenly; around a fold, an extremum or a kink of ψ, and over the tip
//! of a finger of levels, it does not.
//!
//! Distances are straight ones in space, mm; of strips that are narrow against the part's radii they are
//! those on the surface. Only what lies beside a pass is looked at, across it: a part without any pass nearby
//! has no gaps.

use super::halving::{LevelSource, along_needed};
use super::stretches::{Stretches, nearest_on};
use crate::surface::chart::{Chart, ChartPoint};
use crate::vocabulary::{Contact, Passes, PlanError, Step};
use cutter::Cutter;
use field::ScalarField;
use geometry::Point3;
use work::monitor::{self, Monitor};

/// A place is open where the nearest contact is farther away than half the allowed interval by this share:
/// 3 % are 6 % of the scallop height. Halving has closed what is more than 2 % too wide where ψ is even.
const SLACK: f64 = 0.03;

/// A gap is worth passes where it opens by this share: 6 % are 12 % of the scallop height. Where less is open
/// straight distances and the field's own error tell as much.
const WORTH: f64 = 0.06;

/// Where a measured ridge asked for narrower passes, a place is open, and worth passes, by this share: there
/// calculation and measurement are known to differ.
const MEASURED: f64 = 0.01;

/// From a contact, places are looked at across the feed, this share of the interval apart, until one is
/// served.
const MARCH: f64 = 0.0625;
const MOST_MARCHES: usize = 32;

/// Contacts are looked for up to this share of the widest interval away: whoever is farther serves no place.
const FARTHEST: f64 = 0.6;

/// New passes may leave gaps of their own; so often they are looked for.
const ROUNDS: usize = 4;

/// Appends passes of `source` along levels of `field` where the others leave gaps, and tells how many.
///
/// # Errors
/// When cancelled, or where a pass cannot be located.
pub(crate) fn close<S: LevelSource<Place = [f64; 2]>>(
    source: &S,
    chart: &Chart,
    cutter: &Cutter,
    field: &ScalarField,
    [height, sampling]: [f64; 2],
    passes: &mut Passes,
    monitor: &dyn Monitor,
) -> Result<usize, PlanError> {
    let allowed = passes.contacts.iter().flatten().map(|contact| contact.allowed);
    let reach = FARTHEST * allowed.fold(0.0, f64::max);
    if reach <= 0.0 {
        return Ok(0);
    }
    let mut gaps = Gaps { chart, cutter, height, stretches: Stretches::new(reach) };
    let (planned, mut looked_at) = (passes.contacts.len(), 0);
    for _ in 0..ROUNDS {
        let fresh = &passes.contacts[looked_at..];
        looked_at = passes.contacts.len();
        fresh.iter().for_each(|pass| gaps.stretches.insert(pass));
        let found = work::parallel::try_map(fresh.len(), |k| {
            monitor::check(monitor)?;
            Ok::<_, PlanError>(fresh[k].iter().flat_map(|contact| gaps.beside(contact)).collect::<Vec<_>>())
        })?;
        let mut places: Vec<Gap> = found.into_iter().flatten().collect();
        places.sort_by(|a, b| b.openness.total_cmp(&a.openness));
        for gap in places {
            monitor::check(monitor)?;
            if gaps.open_beyond(gap.at, WORTH).is_none() {
                continue;
            }
            let level = field.value_and_gradient(gap.at[0], gap.at[1])[0];
            let before = passes.contacts.len();
            let needed = |place: &[f64; 2]| gaps.open_beyond(*place, SLACK).is_some();
            // What is open may be shorter than points of a level are apart.
            let open = chart.jet(gap.at[0], gap.at[1]).p;
            let from_gap = |place: &[f64; 2]| (chart.jet(place[0], place[1]).p - open).norm();
            along_needed(source, level, &needed, &from_gap, sampling, passes, monitor)?;
            for k in before..passes.contacts.len() {
                gaps.stretches.insert(&passes.contacts[k]);
            }
        }
        if passes.contacts.len() == looked_at {
            break;
        }
    }
    Ok(passes.contacts.len() - planned)
}

/// A place that no pass serves.
struct Gap {
    /// Its parameters.
    at: [f64; 2],
    /// Distance of the nearest contact over half the allowed interval.
    openness: f64,
}

/// Places that no pass serves, beside stretches of those that there are.
struct Gaps<'a, 'b> {
    chart: &'a Chart<'b>,
    cutter: &'a Cutter,
    /// The scallop height, mm.
    height: f64,
    stretches: Stretches,
}

impl Gaps<'_, '_> {
    /// The place of a pass nearest to a point, within reach.
    fn nearest(&self, p: &Point3) -> Option<Point3> {
        let on = self.stretches.around(p).map(|ends| nearest_on(ends, p));
        on.min_by(|a, b| (a - p).norm_squared().total_cmp(&(b - p).norm_squared()))
    }

    /// Distance of the nearest contact over half the interval that is allowed toward it; `None` where the
    /// chart has no normal.
    fn openness(&self, p: &ChartPoint) -> Option<f64> {
        let Some(nearest) = self.nearest(&p.jet.p) else { return Some(f64::INFINITY) };
        let toward = nearest - p.jet.p;
        let Some(feed) = p.normal.cross(&toward).try_normalize(1e-12) else { return Some(0.0) };
        let (interval, _) = self.chart.interval(p, self.cutter, &feed, Step::Scallop(self.height));
        Some(2.0 * toward.norm() / interval)
    }

    /// The openness of a place where that is more than one by a share.
    fn open_beyond(&self, at: [f64; 2], share: f64) -> Option<f64> {
        let p = self.chart.at(at[0], at[1])?;
        let share = if p.was_narrowed() { MEASURED } else { share };
        self.openness(&p).filter(|openness| *openness > 1.0 + share)
    }

    /// The widest places on both sides of a contact that no pass serves.
    fn beside(&self, contact: &Contact) -> Vec<Gap> {
        let Some(at) = contact.parameters.filter(|_| contact.inside) else { return Vec::new() };
        let Some(p) = self.chart.at(at[0], at[1]) else { return Vec::new() };
        let Some((du, dv)) = p.jet.pull_back(&contact.across) else { return Vec::new() };
        let first = 0.5 + if p.was_narrowed() { MEASURED } else { SLACK };
        let widest = |side: f64| {
            let place = |k: usize| {
                let s = side * contact.allowed * (first + MARCH * k as f64);
                [at[0] + s * du, at[1] + s * dv]
            };
            let open = (0..MOST_MARCHES).map(place).take_while(|&at| self.chart.holds(at));
            let open = open.map_while(|at| Some(Gap { at, openness: self.open_beyond(at, SLACK)? }));
            open.max_by(|a, b| a.openness.total_cmp(&b.openness))
        };
        [1.0, -1.0].into_iter().filter_map(widest).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::levels::halving::{Allowed, Track};
    use crate::vocabulary::{Correction, Guide};
    use field::Axis;
    use geometry::{NurbsSurface, Vector3};
    use work::monitor::{Cancelled, Silent};

    /// Length of a plate along its passes, mm.
    const LENGTH: f64 = 12.0;
    const HEIGHT: f64 = 0.01;

    /// Lines along x on the plate.
    struct Lines<'a> {
        chart: &'a Chart<'a>,
        interval: f64,
        sampling: f64,
    }

    impl LevelSource for Lines<'_> {
        type Place = [f64; 2];

        fn curves(&self, level: f64) -> Vec<Track<[f64; 2]>> {
            let points =
                (0..=(LENGTH / self.sampling) as usize).map(|k| [k as f64 * self.sampling / LENGTH, level]);
            vec![Track { points: points.collect(), closed: false }]
        }

        fn allowed(&self, _: &[f64; 2]) -> Option<Allowed> {
            Some(Allowed { step: self.interval / self.chart.jet(0.0, 1.0).p.y, width: self.interval })
        }

        fn pass(
            &self,
            curve: &Track<[f64; 2]>,
            _: f64,
            run: Option<[usize; 2]>,
        ) -> Result<Vec<Vec<Point3>>, Cancelled> {
            Ok(vec![curve.along(run).map(|&[u, v]| self.chart.jet(u, v).p).collect()])
        }

        fn contacts(&self, curve: &Track<[f64; 2]>, run: Option<[usize; 2]>) -> Vec<Contact> {
            let contact = |&at: &[f64; 2]| Contact {
                at: self.chart.jet(at[0], at[1]).p,
                across: Vector3::y(),
                normal: Vector3::z(),
                allowed: self.interval,
                inside: true,
                parameters: Some(at),
                asked: None,
            };
            curve.along(run).map(contact).collect()
        }
    }

    /// Where on x passes were added between two that are `wider` times the allowed interval apart, after a
    /// measurement that asks for another factor at the middle.
    fn added(wider: f64, factor: f64, sampling: f64) -> Vec<[f64; 2]> {
        let cutter = Cutter::ball(6.0).unwrap();
        let interval = crate::plane_interval(&cutter, Step::Scallop(HEIGHT));
        // Beyond the passes lies what they serve.
        let width = (wider + 0.9) * interval;
        let corner = |x: f64, y: f64| Point3::new(x, y, 0.0);
        let net: Vec<Vec<Point3>> =
            [0.0, LENGTH].map(|x| [0.0, width].map(|y| corner(x, y)).to_vec()).to_vec();
        let ends = || vec![0.0, 0.0, 1.0, 1.0];
        let surface = NurbsSurface::new(1, 1, ends(), ends(), &net, None).unwrap();
        let middle = corner(0.5 * LENGTH, 0.5 * width);
        let correction = Correction::new(&[(middle, factor)], interval);
        let guide = Guide { axis: None, correction: Some(&correction) };
        let chart = Chart::of_surface(&surface, guide);
        let source = |sampling: f64| Lines { chart: &chart, interval, sampling };
        let mut passes = Passes::default();
        for side in [-0.5, 0.5] {
            let fine = source(0.1);
            let curves = fine.curves(0.5 + side * wider * interval / width);
            passes.contacts.push(fine.contacts(&curves[0], None));
            passes.passes.push(Vec::new());
        }
        let lengths = [HEIGHT, sampling];
        let field = ScalarField::Coordinate(Axis::V);
        close(&source(sampling), &chart, &cutter, &field, lengths, &mut passes, &Silent).unwrap();
        let ends = |pass: &Vec<Contact>| [pass[0].at.x, pass[pass.len() - 1].at.x];
        passes.contacts[2..].iter().map(ends).collect()
    }

    /// Two per cent are no gap by calculation. Where a ridge was measured too high they are one, there alone,
    /// be the points of levels as far apart as they may.
    #[test]
    fn where_ridges_were_measured_too_high_less_is_a_gap() {
        assert_eq!(added(1.02, 1.0, 0.1), Vec::<[f64; 2]>::new());
        assert_eq!(added(1.15, 1.0, 0.1).len(), 1);
        let near = added(1.02, 0.98, 0.1);
        let [[from, to]] = near[..] else { panic!("{near:?}") };
        assert!(from > 3.0 && from < 5.8 && to > 6.2 && to < 9.0, "{near:?}");
        // No point of the levels lies where it is open.
        let coarse = added(1.02, 0.98, 4.0);
        assert!(!coarse.is_empty(), "{coarse:?}");
    }
}
