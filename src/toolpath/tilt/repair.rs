//! Passes on which the tool stays clear: tilted, else lifted, else left out.
//!
//! Enters: the touches of a pass, what the tool must keep away from, mm, rad. Leaves: the touches, changed no
//! more than it takes, in one pass or in several where a stretch cannot be reached, and what was changed.
//! Moves between the touches that leave are clear.
//!
//! Axes are tried on rings around the rule's axis, the smallest tilt first, and follow the touch before. Each
//! has a little to spare, so that the moves between them touch nothing. Stock is not considered: between
//! passes the tool feeds beside the part, or goes outside the block.
//!
//! Curvature tells the lead that frees the rear of a flat near the contact only. On the far side of a trough
//! the distance from the part finds the gouge.

use super::tilted::ABOVE_SURFACE;
use crate::moves::touch::Touch;
use collision::{Interference, LastRefusal, Shortfall};
use cutter::Cutter;
use geometry::{Point3, Vector3, angle_between};
use motion::{CcPoint, ClPoint, location};
use std::f64::consts::TAU;
use work::monitor::{self, Cancelled, Monitor};

/// Rings of tilted axes are this far apart, rad. A gap through which the tool fits may lie between two wider
/// ones.
const RING: f64 = 0.05;

/// Axes tried on each ring: 10 degrees apart, as far as rings are where the axis is tilted by 0.29 rad.
/// Narrower rings, which come first, are denser.
const AROUND: usize = 36;

/// The share of its lean at which a tool must be clear as well, where its contact must be known well: a flat
/// bottom then fills no more than about this share of the hollow's curvature, so that its contact moves by no
/// more than 1/(1 − share), four times, of what it would on a plane. Nearer to 1 contacts spread; less leans
/// more than it must.
const LESS_LEAN: f64 = 0.75;

/// Halvings of what lies between two rings: to a hundredth of a degree.
const HALVINGS: u32 = 8;

/// Weight of the angle to the axis before, against that of the tilt.
const CONTINUITY: f64 = 0.2;

/// Neighbours of tilted contacts lead over by no more than this, rad a mm, where nothing else is asked for.
const RAMP: f64 = 0.05;

/// Least step of a lift, mm.
const LEAST_LIFT: f64 = 1e-3;

/// Moves that are not clear are halved at most so many times before the pass is left there.
const MOST_HALVINGS: u32 = 6;

/// A place that the tool cannot reach.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unreachable {
    /// The contact, mm.
    pub place: Point3,
    /// How much is missing there with the axis of the rule, mm.
    pub depth: f64,
}

/// What was changed so that the tool stays clear.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RepairSummary {
    /// Contacts whose axis was tilted.
    pub tilted: usize,
    /// By how much at most, rad.
    pub greatest_tilt: f64,
    /// Contacts from which the tool was lifted.
    pub lifted: usize,
    /// By how much at most, mm, and where.
    pub greatest_lift: Option<(f64, Point3)>,
    /// Points put in between contacts.
    pub added: usize,
    /// Places left out.
    pub unreachable: Vec<Unreachable>,
}

/// A pass in the pieces that are left of it, and what was changed.
pub struct Repaired {
    pub passes: Vec<Vec<Touch>>,
    pub summary: RepairSummary,
}

/// A touch with the axis of its rule.
#[derive(Clone, Copy)]
struct Placed {
    touch: Touch,
    rule: Vector3,
}

/// Where a tool may stand: clear of what it must keep away from.
#[derive(Clone, Copy)]
pub struct Room<'a> {
    /// The cutter.
    pub cutter: &'a Cutter,
    /// What it keeps away from.
    pub keep: &'a Interference<'a>,
    /// Whether the tool must be clear at [`LESS_LEAN`] of its lean from the normal, too. A flat bottom that
    /// only just fits into a hollow touches all around, and where it touches is then known badly: so is how
    /// fast the axis turns there.
    pub firm: bool,
}

impl Room<'_> {
    /// Whether it may stand at a contact with an axis, with something to spare if asked for.
    pub fn holds(&self, contact: &CcPoint, axis: &Vector3, spare: bool) -> bool {
        self.holds_after(&LastRefusal::default(), contact, axis, spare)
    }

    /// The same for one of many axes that are tried.
    fn holds_after(&self, last: &LastRefusal, contact: &CcPoint, axis: &Vector3, spare: bool) -> bool {
        let at = location(self.cutter, contact, axis);
        axis.dot(&contact.normal) > ABOVE_SURFACE
            && self.keep.holds_after(last, &at, spare)
            && (!self.firm || self.keep.holds_after(last, &self.leaning_less(contact, &at), false))
    }

    /// The same for a touch with its own axis and something to spare.
    pub fn holds_as_it_is(&self, touch: &Touch) -> bool {
        self.holds(&touch.contact, &touch.at.axis, true)
    }

    /// The check that fails by most where a touch is.
    fn shortfall(&self, touch: &Touch) -> Option<Shortfall> {
        let less = || self.keep.shortfall(&self.leaning_less(&touch.contact, &touch.at));
        self.keep.shortfall(&touch.at).or_else(|| self.firm.then(less).flatten())
    }

    fn leaning_less(&self, contact: &CcPoint, at: &ClPoint) -> ClPoint {
        let along = ClPoint { axis: contact.normal, ..*at };
        location(self.cutter, contact, &along.towards(at, LESS_LEAN).axis)
    }
}

/// Repairs a pass. Beside tilted contacts the axis turns by no more than `turning`, rad a mm of contact,
/// where that is clear.
///
/// # Errors
/// [`Cancelled`].
pub fn repair(
    pass: &[Touch],
    room: Room<'_>,
    turning: Option<f64>,
    monitor: &dyn Monitor,
) -> Result<Repaired, Cancelled> {
    let mut repairing = Repairing::new(room);
    let mut run = Vec::new();
    for touch in pass {
        monitor::check(monitor)?;
        match repairing.place(touch) {
            Ok(placed) => run.push(placed),
            Err(missing) => {
                repairing.summary.leave_out(touch.contact.point, missing.depth);
                repairing.finish(std::mem::take(&mut run), turning, monitor)?;
            }
        }
    }
    repairing.finish(run, turning, monitor)?;
    Ok(Repaired { passes: repairing.passes, summary: repairing.summary })
}

/// The axis nearest to that of a touch at which the tool is clear there.
pub(super) fn nearest_clear(touch: &Touch, room: Room<'_>) -> Option<Vector3> {
    Repairing::new(room).tilted(touch)
}

struct Repairing<'a> {
    room: Room<'a>,
    /// The axis of the touch before, if that was tilted.
    before: Option<Vector3>,
    refused: LastRefusal,
    summary: RepairSummary,
    passes: Vec<Vec<Touch>>,
}

impl<'a> Repairing<'a> {
    fn new(room: Room<'a>) -> Self {
        let refused = LastRefusal::default();
        Self { room, before: None, refused, summary: RepairSummary::default(), passes: Vec::new() }
    }

    /// The touch where it is clear, or what is missing.
    fn place(&mut self, touch: &Touch) -> Result<Placed, Shortfall> {
        let rule = touch.at.axis;
        let Some(missing) = self.room.shortfall(touch) else {
            self.before = None;
            return Ok(Placed { touch: *touch, rule });
        };
        let tilted = self.tilted(touch);
        self.before = tilted;
        if let Some(axis) = tilted {
            return Ok(Placed { touch: self.along(axis, touch), rule });
        }
        if self.room.keep.is_clear(&touch.at) {
            return Ok(Placed { touch: *touch, rule });
        }
        let lift = self.lift(touch).ok_or(missing)?;
        self.summary.lift(lift, touch.contact.point);
        let contact = CcPoint { point: touch.contact.point + touch.contact.normal * lift, ..touch.contact };
        Ok(Placed { touch: Touch::along(rule, self.room.cutter, contact, touch.feed), rule })
    }

    fn along(&self, axis: Vector3, touch: &Touch) -> Touch {
        Touch::along(axis, self.room.cutter, touch.contact, touch.feed)
    }

    /// A tilted axis, with more to spare if there is one.
    fn tilted(&self, touch: &Touch) -> Option<Vector3> {
        let loose = Room { firm: false, ..self.room };
        let clear = self.room.firm && self.room.keep.is_clear(&touch.at);
        let firm = self.room.firm.then(|| self.tilt(touch, self.room, true)).flatten();
        // What is clear as it is needs no other axis than a firm one.
        firm.or_else(|| {
            [true, false].iter().filter(|_| !clear).find_map(|&spare| self.tilt(touch, loose, spare))
        })
    }

    /// The axis nearest to the rule's at which the tool is clear, near to that before where there is a
    /// choice.
    fn tilt(&self, touch: &Touch, room: Room<'_>, spare: bool) -> Option<Vector3> {
        let (rule, contact) = (touch.at.axis, touch.contact);
        let across = if rule.x.abs() < 0.6 { Vector3::x() } else { Vector3::y() };
        let x = rule.cross(&across).normalize();
        let y = rule.cross(&x);
        let axis =
            |tilt: f64, around: f64| rule * tilt.cos() + (x * around.cos() + y * around.sin()) * tilt.sin();
        let clear =
            |tilt: f64, around: f64| room.holds_after(&self.refused, &contact, &axis(tilt, around), spare);
        let least = |mut low: f64, mut high: f64, around: f64| {
            for _ in 0..HALVINGS {
                let middle = 0.5 * (low + high);
                *(if clear(middle, around) { &mut high } else { &mut low }) = middle;
            }
            high
        };
        let greatest = self.room.keep.greatest_tilt;
        let mut first = 0.0;
        if let Some(before) = self.before {
            let tilt = angle_between(&rule, &before);
            let around = before.dot(&y).atan2(before.dot(&x));
            first = around;
            let step = TAU / AROUND as f64;
            let follow = |around: f64| {
                let rings = (0..=(0.5 * tilt / RING).ceil() as u32 + 1)
                    .map(|k| (tilt + RING * f64::from(k)).min(greatest));
                let found = rings.into_iter().find(|&tilt| clear(tilt, around))?;
                Some((least(if found > tilt { found - RING } else { 0.0 }, found, around), around))
            };
            let beside = [0.0, 0.5 * step, -0.5 * step].into_iter().filter_map(|by| follow(around + by));
            if let Some((tilt, around)) = beside.min_by(|a, b| a.0.total_cmp(&b.0)) {
                return Some(axis(tilt, around));
            }
        }
        let rings = (greatest / RING).ceil() as u32;
        for ring in 1..=rings {
            let tilt = (RING * f64::from(ring)).min(greatest);
            let rank = |around: f64| {
                let tilt = least(RING * f64::from(ring - 1), tilt, around);
                let axis = axis(tilt, around);
                (tilt + CONTINUITY * self.before.map_or(0.0, |before| (axis - before).norm()), axis)
            };
            let arounds = (0..AROUND).map(|k| first + TAU * k as f64 / AROUND as f64);
            let ranked = arounds.filter(|&around| clear(tilt, around)).map(rank);
            if let Some((_, axis)) = ranked.min_by(|a, b| a.0.total_cmp(&b.0)) {
                return Some(axis);
            }
        }
        None
    }

    /// How far the tool must go along the normal. What is missing shrinks no faster than the tool goes, so
    /// that it steps by that without passing by a place that is clear.
    fn lift(&self, touch: &Touch) -> Option<f64> {
        let mut lift = 0.0;
        while lift <= self.room.keep.greatest_lift {
            let tip = touch.at.tip + touch.contact.normal * lift;
            let Some(missing) = self.room.keep.missing(&ClPoint { tip, ..touch.at }, true) else {
                return Some(lift);
            };
            lift += missing.depth.max(LEAST_LIFT);
        }
        None
    }

    /// Leads the axis over beside tilted contacts, and joins what is left of a pass by moves that are clear.
    fn finish(
        &mut self,
        mut run: Vec<Placed>,
        turning: Option<f64>,
        monitor: &dyn Monitor,
    ) -> Result<(), Cancelled> {
        self.before = None;
        let rate = turning.unwrap_or(RAMP);
        for k in 1..run.len() {
            run[k] = self.led_over(&run[k - 1], &run[k], rate);
        }
        for k in (1..run.len()).rev() {
            run[k - 1] = self.led_over(&run[k], &run[k - 1], rate);
        }
        for placed in &run {
            self.summary.tilt(placed.tilt());
        }
        let mut piece: Vec<Touch> = run.iter().take(1).map(|placed| placed.touch).collect();
        for pair in run.windows(2) {
            monitor::check(monitor)?;
            let mut between = Vec::new();
            match self.join(&pair[0], &pair[1], MOST_HALVINGS, &mut between) {
                Ok(()) => {
                    self.summary.added += between.len() - 1;
                    piece.append(&mut between);
                }
                Err(unreachable) => {
                    self.summary.unreachable.push(unreachable);
                    self.passes.push(std::mem::replace(&mut piece, vec![pair[1].touch]));
                }
            }
        }
        if !piece.is_empty() {
            self.passes.push(piece);
        }
        Ok(())
    }

    /// `to`, with its axis turned towards that of `from` where that is tilted no less, within a ring, and too
    /// far off.
    fn led_over(&self, from: &Placed, to: &Placed, rate: f64) -> Placed {
        let (a, b) = (from.touch.at, to.touch.at);
        let turn = angle_between(&a.axis, &b.axis);
        let most = rate * (to.touch.contact.point - from.touch.contact.point).norm();
        if from.tilt() + RING < to.tilt() || from.tilt() == 0.0 || turn <= most {
            return *to;
        }
        let axis = a.towards(&b, most / turn).axis;
        let led = Placed { touch: self.along(axis, &to.touch), ..*to };
        // The rule may turn faster than the axis.
        let within = led.tilt() <= self.room.keep.greatest_tilt;
        if within && self.room.holds(&to.touch.contact, &axis, false) { led } else { *to }
    }

    /// The touches after `a` up to and with `b`, with clear moves between them.
    fn join(
        &mut self,
        a: &Placed,
        b: &Placed,
        halvings: u32,
        out: &mut Vec<Touch>,
    ) -> Result<(), Unreachable> {
        let Some(missing) = self.room.keep.on_move(&a.touch.at, &b.touch.at) else {
            out.push(b.touch);
            return Ok(());
        };
        let there = Unreachable {
            place: nalgebra::center(&a.touch.contact.point, &b.touch.contact.point),
            depth: missing.depth,
        };
        let (Some(between), 1..) = (between(&a.touch, &b.touch, self.room.cutter), halvings) else {
            return Err(there);
        };
        self.before = Some(a.touch.at.axis);
        let middle = self.place(&between).map_err(|_| there)?;
        self.join(a, &middle, halvings - 1, out)?;
        self.join(&middle, b, halvings - 1, out)
    }
}

/// A touch half way.
fn between(a: &Touch, b: &Touch, cutter: &Cutter) -> Option<Touch> {
    let normal = (a.contact.normal + b.contact.normal).try_normalize(1e-9)?;
    let feed = (a.feed + b.feed).try_normalize(1e-9).unwrap_or(a.feed);
    let axis = a.at.towards(&b.at, 0.5).axis;
    let contact = CcPoint { point: nalgebra::center(&a.contact.point, &b.contact.point), normal };
    (axis.dot(&normal) > ABOVE_SURFACE).then(|| Touch::along(axis, cutter, contact, feed))
}

impl Placed {
    /// Angle from the rule, rad.
    fn tilt(&self) -> f64 {
        let axis = self.touch.at.axis;
        angle_between(&self.rule, &axis)
    }
}

impl RepairSummary {
    fn tilt(&mut self, by: f64) {
        self.tilted += usize::from(by > 0.0);
        self.greatest_tilt = self.greatest_tilt.max(by);
    }

    fn lift(&mut self, by: f64, place: Point3) {
        self.lifted += 1;
        if self.greatest_lift.is_none_or(|(most, _)| by > most) {
            self.greatest_lift = Some((by, place));
        }
    }

    fn leave_out(&mut self, place: Point3, depth: f64) {
        self.unreachable.push(Unreachable { place, depth });
    }

    /// Takes in what was changed on another pass.
    pub fn add(&mut self, other: &Self) {
        self.tilted += other.tilted;
        self.greatest_tilt = self.greatest_tilt.max(other.greatest_tilt);
        self.lifted += other.lifted;
        if other.greatest_lift.map(|l| l.0) > self.greatest_lift.map(|l| l.0) {
            self.greatest_lift = other.greatest_lift;
        }
        self.added += other.added;
        self.unreachable.extend(&other.unreachable);
    }

    /// In words, for whoever reads the report; nothing where nothing was changed.
    pub fn notes(&self) -> Vec<String> {
        let at = |p: &Point3| format!("({:.3}, {:.3}, {:.3})", p.x, p.y, p.z);
        let mut notes = Vec::new();
        if self.tilted > 0 {
            notes.push(format!(
                "at {} contacts the axis is tilted by up to {:.1} degrees so that the tool stays clear",
                self.tilted,
                self.greatest_tilt.to_degrees()
            ));
        }
        if let Some((by, place)) = &self.greatest_lift {
            notes.push(format!(
                "at {} contacts no tilt keeps the tool clear: it is lifted by up to {by:.3} mm, most at {}, and leaves \
                 that much standing",
                self.lifted,
                at(place)
            ));
        }
        if let Some(worst) = self.unreachable.iter().max_by(|a, b| a.depth.total_cmp(&b.depth)) {
            notes.push(format!(
                "{} places cannot be reached without a collision and are left out; {:.3} mm are missing at {}: take a \
                 longer or thinner tool, or allow more tilt",
                self.unreachable.len(),
                worst.depth,
                at(&worst.place)
            ));
        }
        notes
    }
}

#[cfg(test)]
mod tests;
