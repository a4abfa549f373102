//! How far passes are off the feed directions that were asked for.
//!
//! Enters: the contacts of all passes in order, each with the direction asked for there, or rows at places of
//! their own ([`Row`]: of tables, along guides and borders). Leaves: the mean and the greatest angle.
//!
//! Passes are followed from contact to contact, by their tangents at the contacts and by the chords between.
//! Where the angle rises to its greatest and falls again, both more and more steeply toward and from it (it
//! is concave there), it is nowhere greater by more than it changes from one of these to the next. Moves of
//! the cutter keep to the pass within the chord tolerance.
//!
//! At a row two passes tell the angle, one on each side, by their nearness (at a border the two nearest): it
//! changes evenly from pass to pass, to second order. It is known no better than that of the nearest one is
//! off it.

use std::f64::consts::{FRAC_PI_2, PI};

use field::DirectionError;
use geometry::{CurveSegment, Point2, Point3, SegmentGrid, Vector2, Vector3, share_on};

use crate::levels::planned_field::in_plan;
use crate::surface::asked::{self, Row};
use crate::surface::chart::Chart;
use crate::vocabulary::{Contact, FeedDirection, Obedience, Task};

/// Passes that are off by more, rad, are said to be: within a degree they do what was asked.
const OFF: f64 = PI / 180.0;

/// Contacts nearer than this, mm, have no direction between them.
const SAME_PLACE: f64 = 1e-6;

/// The other pass beside a row lies within an angle of this cosine straight beyond it, or behind the nearest
/// one.
const STRAIGHT: f64 = 0.5;

/// An angle at a place.
#[derive(Debug, Clone, Copy)]
struct Off {
    /// From the direction to the pass, between right angles, rad.
    angle: f64,
    at: Point3,
    /// mm, or rows.
    weight: f64,
    /// The angle is known within so much, rad.
    within: f64,
    /// Asked tangent and normal, where the direction may jump to the next place.
    asked: Option<(Vector3, Vector3)>,
}

impl Obedience {
    /// With those of another piece of the part.
    pub fn append(&mut self, other: Self) {
        self.squares += other.squares;
        self.weights += other.weights;
        self.at_most = self.at_most.max(other.at_most);
        if let Some((angle, at)) = other.greatest {
            self.greater(angle, at);
        }
    }

    fn greater(&mut self, angle: f64, at: Point3) {
        if self.greatest.is_none_or(|(found, _)| angle > found) {
            self.greatest = Some((angle, at));
        }
    }

    /// With the angles along a pass or a curve; `None` where there is none.
    fn add(&mut self, along: &[Option<Off>]) {
        for (k, off) in along.iter().enumerate() {
            let Some(off) = off else { continue };
            let beside = [k.checked_sub(1).and_then(|k| along[k]), along.get(k + 1).copied().flatten()];
            let changes = beside.into_iter().flatten().map(|other| {
                let change = wrapped(other.angle - off.angle);
                // Where the direction jumps, at a bend of a polygon, the pass turns by the rest.
                let jump = off.asked.zip(other.asked);
                let jump = jump.map_or(0.0, |((from, normal), (to, _))| self::off(&to, &normal, &from));
                change.abs().min(wrapped(change + jump).abs())
            });
            let angle = off.angle.abs();
            self.squares += off.weight * angle.powi(2);
            self.weights += off.weight;
            self.at_most = self.at_most.max(angle + off.within + changes.fold(0.0, f64::max));
            self.greater(angle, off.at);
        }
    }

    /// The angles of all passes together; `None` where no direction was asked for.
    pub fn error(&self) -> Option<DirectionError> {
        let (max, at) = self.greatest?;
        let rms = (self.squares / self.weights.max(f64::MIN_POSITIVE)).sqrt();
        let error_bound = self.at_most.min(FRAC_PI_2) - max;
        Some(DirectionError { rms, max, error_bound, at })
    }
}

/// The angle from an asked tangent to a pass `along` a tangent, as lines, on a surface of unit `normal`: rad,
/// between right angles.
pub(crate) fn off(along: &Vector3, normal: &Vector3, asked: &Vector3) -> f64 {
    let (across, along) = (asked.cross(along).dot(normal), asked.dot(along));
    (across * if along < 0.0 { -1.0 } else { 1.0 }).atan2(along.abs())
}

/// The sum of two lines by weights, as if they pointed the same way.
fn mean_line([a, b]: [Vector3; 2], [of_a, of_b]: [f64; 2]) -> Vector3 {
    a * of_a + b * (of_b * if a.dot(&b) < 0.0 { -1.0 } else { 1.0 })
}

/// The angles of passes over a chart from a direction; `spread` is the same with its curves as samples.
pub(crate) fn on_chart(
    task: &Task<'_>,
    chart: &Chart<'_>,
    contacts: &mut [Vec<Contact>],
    [direction, spread]: [&FeedDirection; 2],
) -> Obedience {
    for contact in contacts.iter_mut().flatten() {
        let place = contact.parameters.and_then(|[u, v]| chart.at(u, v));
        contact.asked = place.and_then(|p| asked::everywhere(direction, &p.feed(spread, task.cutter)));
    }
    measure(contacts, &asked::on_chart(direction, task.part, chart, task.settings.sampling))
}

/// The angles of passes from what is asked for at their contacts and in rows.
pub(crate) fn measure(passes: &[Vec<Contact>], rows: &[Vec<Row>]) -> Obedience {
    let mut all = Obedience::default();
    passes.iter().for_each(|pass| all.add(&along_pass(pass)));
    if !rows.is_empty() {
        let beside = Beside::new(passes);
        let found = work::parallel::map(rows.len(), |k| {
            rows[k].iter().map(|row| beside.off(row)).collect::<Vec<_>>()
        });
        found.iter().for_each(|along| all.add(along));
    }
    all
}

/// The angles of a pass at its contacts on the part, and of the chords between them as far as they lie on it.
fn along_pass(pass: &[Contact]) -> Vec<Option<Off>> {
    let chord = |k: usize| pass.get(k + 1).map_or(0.0, |next| (next.at - pass[k].at).norm());
    let at_contact = |k: usize| {
        let contact = &pass[k];
        let angle = off(&contact.along(), &contact.normal, &contact.asked.filter(|_| contact.inside)?);
        let weight = 0.25 * (k.checked_sub(1).map_or(0.0, chord) + chord(k));
        Some(Off { angle, at: contact.at, weight, within: 0.0, asked: None })
    };
    let between = |k: usize| {
        let ends = [&pass[k], pass.get(k + 1)?];
        // At the border the place is the end on the part.
        let at = match ends.map(|end| end.inside) {
            [true, true] => nalgebra::center(&ends[0].at, &ends[1].at),
            [true, false] => ends[0].at,
            [false, true] => ends[1].at,
            [false, false] => return None,
        };
        let asked = match ends.map(|end| end.asked) {
            [Some(a), Some(b)] => mean_line([a, b], [0.5, 0.5]),
            [a, b] => a.or(b)?,
        };
        let normal = (ends[0].normal + ends[1].normal).try_normalize(1e-9)?;
        let along = (ends[1].at - ends[0].at).try_normalize(SAME_PLACE)?;
        Some(Off {
            angle: off(&along, &normal, &asked),
            at,
            weight: 0.5 * chord(k),
            within: 0.0,
            asked: None,
        })
    };
    (0..pass.len()).flat_map(|k| [at_contact(k), between(k)]).collect()
}

/// Finds the passes on both sides of a place.
struct Beside<'a> {
    passes: &'a [Vec<Contact>],
    grid: SegmentGrid,
}

/// The place of a pass that is near to another place.
struct Near<'a> {
    curve: u32,
    ends: [&'a Contact; 2],
    share: f64,
    /// From the other place.
    way: Vector3,
    distance: f64,
}

impl Near<'_> {
    /// As much of the ends' as each is near.
    fn mixed(&self, of: impl Fn(&Contact) -> Vector3) -> Vector3 {
        mean_line(self.ends.map(of), [1.0 - self.share, self.share])
    }

    fn allowed(&self) -> f64 {
        self.ends[0].allowed + self.share * (self.ends[1].allowed - self.ends[0].allowed)
    }

    fn is_inside(&self) -> bool {
        self.ends.iter().any(|end| end.inside)
    }
}

impl<'a> Beside<'a> {
    fn new(passes: &'a [Vec<Contact>]) -> Self {
        Self { passes, grid: in_plan(passes) }
    }

    /// The place of a side of a pass that is nearest to a row, in the plan view where the row is of that.
    fn near(&self, row: &Row, side: u32) -> Near<'a> {
        let CurveSegment { curve, index, .. } = self.grid.segments()[side as usize];
        let pass = &self.passes[curve as usize][index as usize..];
        let flat = |p: &Point3| if row.is_plan { Point3::new(p.x, p.y, 0.0) } else { *p };
        let ([a, b], p) = ([flat(&pass[0].at), flat(&pass[1].at)], flat(&row.at));
        let share = share_on(&p, &a, &b);
        let way = a + (b - a) * share - p;
        Near { curve, ends: [&pass[0], &pass[1]], share, way, distance: way.norm() }
    }

    /// Whether a pass closes around a row, everywhere within a reach of it, mm.
    fn turns_around(&self, curve: u32, row: &Row, reach: f64) -> bool {
        let pass = &self.passes[curve as usize];
        let closes = (pass[0].at - pass[pass.len() - 1].at).norm() < SAME_PLACE;
        let plan: Vec<Vector2> = pass.iter().map(|contact| contact.at.xy() - row.at.xy()).collect();
        if !closes || plan.iter().any(|way| way.norm() > reach) {
            return false;
        }
        let turn: f64 = plan.windows(2).map(|w| w[0].perp(&w[1]).atan2(w[0].dot(&w[1]))).sum();
        turn.abs() > PI
    }

    /// How far the passes beside a row are off what it asks for; `None` where none is within an interval, in
    /// the middle of the innermost one that closes, and near corners of a curve.
    fn off(&self, row: &Row) -> Option<Off> {
        let p = row.at.xy();
        let reach = 2.0 * self.near(row, self.grid.nearest(&p)?.segment).allowed();
        let corner = |side: f64| Point2::new(p.x + side * reach, p.y + side * reach);
        let mut sides = Vec::new();
        self.grid.near(&[corner(-1.0), corner(1.0)], |side| sides.push(side));
        // Buckets hand out a side several times; of equals the first counts, whatever their order.
        sides.sort_unstable();
        sides.dedup();
        let near: Vec<Near<'_>> = sides.into_iter().map(|side| self.near(row, side)).collect();
        let within = |reach: f64| near.iter().filter(move |near| near.distance <= reach * near.allowed());
        let nearer = |a: &&Near<'_>, b: &&Near<'_>| a.distance.total_cmp(&b.distance);
        let first = within(1.0).min_by(nearer)?;
        // How far another place lies in the way of the first, of its own distance.
        let toward =
            |n: &Near<'_>| n.way.dot(&first.way) / (n.distance * first.distance).max(SAME_PLACE.powi(2));
        let turns_around = |n: &Near<'_>| self.turns_around(n.curve, row, first.allowed());
        if row.to_corner < 0.5 * first.allowed() || within(1.0).any(turns_around) {
            return None;
        }
        let beyond = within(1.0).filter(|n| toward(n) < -STRAIGHT).min_by(nearer);
        let behind = || within(2.0).filter(|n| n.curve != first.curve && toward(n) > STRAIGHT).min_by(nearer);
        if !first.is_inside() && !beyond.is_some_and(Near::is_inside) {
            return None;
        }
        let angle_at = |near: &Near<'_>| {
            let normal = near.mixed(|end| end.normal).try_normalize(1e-9)?;
            let (along, asked) = (near.mixed(Contact::along), row.asked(&normal)?);
            Some((off(&along, &normal, &asked), normal, asked))
        };
        let (own, normal, asked) = angle_at(first)?;
        // The share of the way from the nearest pass to the other at which the row lies.
        let other = match beyond {
            Some(n) => Some((n, first.distance / (first.distance + n.distance).max(SAME_PLACE))),
            None => behind().map(|n| (n, -first.distance / (n.distance - first.distance).max(SAME_PLACE))),
        };
        let other = other.and_then(|(n, share)| Some((angle_at(n)?.0, share.max(-1.0))));
        let angle = other.map_or(own, |(other, share)| wrapped(own + share * wrapped(other - own)));
        let at = first.ends[0].at + (first.ends[1].at - first.ends[0].at) * first.share;
        let at = if row.is_plan { Point3::new(row.at.x, row.at.y, at.z) } else { row.at };
        let within = wrapped(angle - own).abs();
        Some(Off { angle, at, weight: row.weight, within, asked: Some((asked, normal)) })
    }
}

/// An angle between lines, between right angles, rad.
fn wrapped(angle: f64) -> f64 {
    angle - PI * (angle / PI).round()
}

/// What is to be said of passes that do not keep to their direction; nothing where they do.
pub(crate) fn note(error: &DirectionError) -> Option<String> {
    let DirectionError { rms, max, at, .. } = *error;
    (rms > OFF).then(|| {
        format!(
            "passes are {:.1} degrees (root mean square; up to {:.0} at x {:.1} y {:.1}) off the directions that were asked for: \
             a greater `follow` or `direction_weight` keeps closer to them, and on smooth surfaces more `control_points` may",
            rms.to_degrees(),
            max.to_degrees(),
            at.x,
            at.y
        )
    })
}

#[cfg(test)]
mod plans;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::asked::Ground;
    use field::{LineField, LineSample, SamplePlane};
    use std::sync::Arc;

    fn contact(at: Point3, along: Vector3) -> Contact {
        Contact {
            at,
            across: Vector3::z().cross(&along),
            normal: Vector3::z(),
            allowed: 1.0,
            inside: true,
            parameters: None,
            asked: None,
        }
    }

    /// Contacts 1 mm apart along x, the fifth and later ones beyond the border, where directions off by given
    /// degrees are asked for.
    fn pass(off: &[Option<f64>]) -> Vec<Contact> {
        let contact = |(k, angle): (usize, &Option<f64>)| Contact {
            asked: angle.map(|a| Vector3::new(a.to_radians().cos(), -a.to_radians().sin(), 0.0)),
            inside: k < 4,
            ..contact(Point3::new(k as f64, 0.0, 0.0), Vector3::x())
        };
        off.iter().enumerate().map(contact).collect()
    }

    fn degrees(found: &Obedience) -> [f64; 3] {
        let error = found.error().unwrap();
        [error.rms, error.max, error.error_bound].map(f64::to_degrees)
    }

    #[test]
    fn every_place_counts_by_its_length_alone() {
        let found = measure(&[pass(&[10.0, 12.0, 177.0].map(Some))], &[]);
        let [_, max, bound] = degrees(&found);
        assert!((max - 12.0).abs() < 1e-9, "a direction and its opposite are the same: {max}");
        // By half of what it changes by to the contact, on the chord between: from 12 to 4.5.
        assert!((bound - 7.5).abs() < 1e-9, "{bound}");
        assert!(note(&found.error().unwrap()).unwrap().contains("up to 12 at x 1.0 y 0.0"));
        // The third place is not asked for, the chords beside it go by their other end, and beyond the border
        // nothing counts.
        let found = measure(&[pass(&[Some(0.3), Some(-0.4), None, Some(0.5), Some(70.0)])], &[]);
        let squares = 0.25 * 0.3f64.powi(2)
            + 0.5 * 0.05f64.powi(2)
            + 0.5 * 0.4f64.powi(2)
            + 0.5 * 0.4f64.powi(2)
            + 0.5 * 0.5f64.powi(2)
            + 0.5 * 0.5f64.powi(2)
            + 0.5 * 35.25f64.powi(2);
        let weights = 0.25 + 0.5 + 0.5 + 0.5 + 0.5 + 0.5 + 0.5;
        let [rms, max, bound] = degrees(&found);
        assert!((rms - (squares / weights).sqrt()).abs() < 1e-9, "{rms}");
        assert!((max - 35.25).abs() < 1e-9 && found.error().unwrap().at.x == 3.0, "{found:?}");
        assert!((bound - 34.75).abs() < 1e-9, "{bound}");
        assert!(measure(&[Vec::new()], &[]).error().is_none());
    }

    /// A pass that wags between its contacts is off by what its chords are, whatever its tangents there.
    #[test]
    fn chords_between_contacts_count() {
        let wagging: Vec<Contact> = (0..9)
            .map(|k| Contact {
                asked: Some(Vector3::x()),
                ..contact(Point3::new(f64::from(k), if k % 2 == 0 { 0.0 } else { 0.1 }, 0.0), Vector3::x())
            })
            .collect();
        let [rms, max, _] = degrees(&measure(&[wagging], &[]));
        let chord = 0.1f64.atan().to_degrees();
        assert!((max - chord).abs() < 1e-9 && (rms - chord / 2f64.sqrt()).abs() < 0.01, "{rms} {max}");
    }

    /// Concentric passes half a millimetre apart, from radius 1 to 9.
    fn circles() -> Vec<Vec<Contact>> {
        let circle = |n: usize| {
            let radius = 1.0 + 0.5 * n as f64;
            let sides = (radius * 40.0) as usize;
            let at = |k: usize| {
                let (sin, cos) = (std::f64::consts::TAU * k as f64 / sides as f64).sin_cos();
                contact(Point3::new(radius * cos, radius * sin, 3.0), Vector3::new(-sin, cos, 0.0))
            };
            (0..=sides).map(at).collect()
        };
        (0..17).map(circle).collect()
    }

    /// The rows of a table over a square of 16 mm, lines by their places.
    fn table(line: impl Fn([f64; 2]) -> [f64; 2], weight: impl Fn([f64; 2]) -> f64) -> Vec<Vec<Row>> {
        let sample = |k: usize| {
            let at = [(k % 17) as f64 - 8.03, (k / 17) as f64 - 8.01];
            LineSample { at, line: line(at), weight: weight(at) }
        };
        let samples: Vec<_> = (0..289).map(sample).collect();
        let field = Arc::new(LineField::new(SamplePlane::Plan, &samples).unwrap());
        let covers = |p: &Point2| (1.0..9.0).contains(&p.coords.norm());
        Ground { borders: &Vec::new, on_patches: None, covers: &covers, spacing: 1.0 }
            .rows(&FeedDirection::Samples(field))
    }

    /// Rows are compared with passes themselves, near the middle of a turn as well, and all alike whatever
    /// their weights.
    #[test]
    fn rows_of_a_table_are_the_measure() {
        let around = |[x, y]: [f64; 2]| [-y, x];
        let [rms, max, bound] = degrees(&measure(&circles(), &table(around, |_| 1.0)));
        assert!(rms < 0.05 && max < 0.3 && bound < 0.5, "{rms} {max} {bound}");
        let square = |at: [f64; 2]| if at[0] < 0.0 { around(at) } else { at };
        // On the other side stand eight columns of seventeen.
        let found = measure(&circles(), &table(square, |[x, _]| if x < 0.0 { 1.0 } else { 0.01 }));
        let [rms, max, _] = degrees(&found);
        assert!((rms - 90.0 * (8.0f64 / 17.0).sqrt()).abs() < 1.5 && max > 89.0, "{rms} {max}");
        assert!(found.error().unwrap().at.x > 0.0);
    }

    /// Spirals turn away from circles by a constant angle: rows between them find it.
    #[test]
    fn between_two_passes_the_direction_is_their_mean() {
        let fan = |k: usize| {
            let angle = 0.05 * k as f64;
            let along = Vector3::new(angle.cos(), angle.sin(), 0.0);
            (3..30).map(|n| contact(Point3::origin() + along * (0.4 * f64::from(n)), along)).collect()
        };
        let passes: Vec<Vec<Contact>> = (0..14).map(fan).collect();
        let sample = |k: usize| {
            let (radius, angle) = (3.0 + 0.1 * k as f64, 0.08 + 0.0071 * k as f64);
            let line = [angle.cos(), angle.sin()];
            LineSample { at: line.map(|x| radius * x), line, weight: 1.0 }
        };
        let samples: Vec<_> = (0..60).map(sample).collect();
        let field = Arc::new(LineField::new(SamplePlane::Plan, &samples).unwrap());
        let rows = Ground { borders: &Vec::new, on_patches: None, covers: &|_| true, spacing: 1.0 }
            .rows(&FeedDirection::Samples(field));
        let [rms, max, bound] = degrees(&measure(&passes, &rows));
        // A row is known as well as the nearer pass of two 2.9 degrees apart tells it.
        assert!(rms < 1e-3 && max < 2e-3 && bound < 1.45, "{rms} {max} {bound}");
    }

    /// On straight passes a guide circle is off by its own angle, all angles equally: π²/12 in the mean
    /// square.
    #[test]
    fn a_guide_is_the_measure_of_passes_near_it() {
        let line = |k: i32| {
            let y = 0.5 * f64::from(k);
            (0..60).map(|n| contact(Point3::new(0.2 * f64::from(n) - 6.0, y, 0.0), Vector3::x())).collect()
        };
        let passes: Vec<Vec<Contact>> = (-12..=12).map(line).collect();
        let at = |k: i32| {
            let (sin, cos) = (f64::from(k) * PI / 180.0).sin_cos();
            Point2::new(0.8 * cos, 0.8 * sin)
        };
        for sense in [field::mesh::Sense::Along, field::mesh::Sense::Across] {
            let curves = Arc::new(vec![(0..=360).map(at).collect()]);
            let direction = FeedDirection::Guides { curves, sense };
            let rows = Ground { borders: &Vec::new, on_patches: None, covers: &|_| true, spacing: 0.1 }
                .rows(&direction);
            let [rms, max, bound] = degrees(&measure(&passes, &rows));
            assert!((rms - 90.0 / 3f64.sqrt()).abs() < 0.1, "{rms}");
            assert!(max >= 89.4 && max + bound <= 90.0 + 1e-9 && bound < 1.5, "{max} {bound}");
        }
    }
}
