//! Compensation of the cutter's radius (G41, G42), as LinuxCNC does it, in the plane G17.
//!
//! Enters: the programmed moves. Leaves: moves of the cutter's axis, the radius to the left or right of them.
//!
//! - The first move is straight, longer than the radius, and ends beside its programmed end, at right angles
//!   to it.
//! - Round an outer corner the axis runs on an arc about the corner, straight before a rapid move. Before an
//!   inner corner it turns where both ways meet. Corners that turn by less than [`STRAIGHT`] are none.
//! - G40 ends it: the next move goes straight from where the axis is.
//!
//! A move leaves once the next one has told where it ends. mm, in the program's coordinates.

use std::f64::consts::TAU;

use crate::block::CodeWord;
use crate::control::{Plane, RadiusSide, spelled};
use crate::error::{Fault, Stop};
use crate::frame::Place;
use crate::interpret::Interpreter;
use crate::program::{Arc, StepKind};

/// Corners that turn by less, rad, are passed as if they were straight: LinuxCNC's TOLERANCE_CONCAVE_CORNER.
const STRAIGHT: f64 = 0.05;

/// Ways that miss each other by less, mm, touch.
const TOUCHING: f64 = 1e-9;

type Spot = [f64; 2];

/// How a programmed move runs in the plane.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Way {
    Straight(StepKind),
    /// About a centre, by an angle in rad.
    Round {
        centre: Spot,
        clockwise: bool,
        sweep: f64,
    },
}

/// The curve of the axis on a move.
#[derive(Debug, Clone, Copy)]
enum Curve {
    /// Through a spot, along a unit vector.
    Line {
        through: Spot,
        along: Spot,
    },
    Circle {
        centre: Spot,
        radius: f64,
        clockwise: bool,
    },
}

/// A move that waits for its end.
#[derive(Debug, Clone, Copy)]
struct Waiting {
    way: Way,
    to: Place,
    feed: f64,
    line: u32,
    setting: u32,
}

/// The compensation in force.
#[derive(Debug)]
pub(crate) struct Compensation {
    /// 1 to the left of the way, −1 to the right.
    side: f64,
    radius: f64,
    /// The curve of the last move; none before the first.
    last: Option<Curve>,
    /// Where the axis will be after what waits, and where the last move begins.
    at: Spot,
    begun: Spot,
    waiting: Vec<Waiting>,
}

fn minus(a: Spot, b: Spot) -> Spot {
    [a[0] - b[0], a[1] - b[1]]
}

fn dot(a: Spot, b: Spot) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

fn cross(a: Spot, b: Spot) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

fn along(from: Spot, way: Spot, by: f64) -> Spot {
    [from[0] + way[0] * by, from[1] + way[1] * by]
}

fn unit(a: Spot) -> Spot {
    let length = a[0].hypot(a[1]);
    a.map(|x| x / length)
}

impl Way {
    /// Unit vectors along it at both ends.
    fn directions(&self, from: Spot, to: Spot) -> [Spot; 2] {
        match *self {
            Self::Straight(_) => [unit(minus(to, from)); 2],
            Self::Round { centre, clockwise, .. } => {
                let sense = if clockwise { -1.0 } else { 1.0 };
                [from, to].map(|end| unit(minus(end, centre))).map(|[x, y]| [-sense * y, sense * x])
            }
        }
    }
}

impl Compensation {
    /// The unit vector to the cutter's side of a way.
    fn aside(&self, [x, y]: Spot) -> Spot {
        [-self.side * y, self.side * x]
    }

    /// The curve of the axis beside a move.
    fn curve(&self, way: &Way, from: Spot, to: Spot) -> Result<Curve, Fault> {
        let Way::Round { centre, clockwise, .. } = *way else {
            let [direction, _] = way.directions(from, to);
            let through = along(from, self.aside(direction), self.radius);
            return Ok(Curve::Line { through, along: direction });
        };
        let programmed = minus(from, centre);
        let programmed = programmed[0].hypot(programmed[1]);
        let inside = (self.side > 0.0) != clockwise;
        let radius = programmed + if inside { -self.radius } else { self.radius };
        if radius <= TOUCHING {
            return Err(Fault::InnerArc { radius: self.radius, arc: programmed });
        }
        Ok(Curve::Circle { centre, radius, clockwise })
    }

    /// Where two curves meet, nearest to a spot.
    fn meeting(&self, a: &Curve, b: &Curve, near: Spot) -> Option<Spot> {
        let spots = match (*a, *b) {
            (Curve::Line { through: p, along: d }, Curve::Line { through: q, along: e }) => {
                let turn = cross(d, e);
                let by = cross(minus(q, p), e) / turn;
                (turn != 0.0).then(|| [along(p, d, by); 2])
            }
            (Curve::Line { through, along: d }, Curve::Circle { centre, radius, .. })
            | (Curve::Circle { centre, radius, .. }, Curve::Line { through, along: d }) => {
                let middle = dot(minus(centre, through), d);
                let off = cross(d, minus(centre, through));
                half_chord(radius, off)
                    .map(|half| [along(through, d, middle - half), along(through, d, middle + half)])
            }
            (Curve::Circle { centre: p, radius: r, .. }, Curve::Circle { centre: q, radius: s, .. }) => {
                let apart = minus(q, p);
                let distance = apart[0].hypot(apart[1]);
                let way = apart.map(|x| x / distance);
                let middle = 0.5 * (distance + (r - s) * (r + s) / distance);
                let foot = along(p, way, middle);
                let across = [-way[1], way[0]];
                half_chord(r, middle)
                    .filter(|_| distance > 0.0)
                    .map(|half| [along(foot, across, half), along(foot, across, -half)])
            }
        }?;
        let off = |spot: &Spot| minus(*spot, near)[0].hypot(minus(*spot, near)[1]);
        spots.into_iter().min_by(|a, b| off(a).total_cmp(&off(b)))
    }
}

/// The angle from `a` to `b` about a centre in the sense of an arc, rad: within half a turn on both sides.
fn ahead(a: Spot, b: Spot, centre: Spot, clockwise: bool) -> f64 {
    let (a, b) = (minus(a, centre), minus(b, centre));
    let angle = cross(a, b).atan2(dot(a, b));
    if clockwise { -angle } else { angle }
}

/// Takes an angle off an arc; something of it must be left, or its end would lie behind its start.
fn shorten(way: &mut Way, by: f64, radius: f64) -> Result<(), Fault> {
    if let Way::Round { sweep, .. } = way {
        *sweep -= by;
        if *sweep <= TOUCHING {
            return Err(Fault::Corner { radius });
        }
    }
    Ok(())
}

/// Half the chord of a circle at a distance from its centre.
fn half_chord(radius: f64, off: f64) -> Option<f64> {
    let square = (radius - off) * (radius + off);
    (square >= -TOUCHING * radius).then(|| square.max(0.0).sqrt())
}

impl Interpreter<'_> {
    /// G40 to G42.1.
    pub fn compensate(&mut self, side: RadiusSide, word: CodeWord) -> Result<(), Stop> {
        let side = match side {
            RadiusSide::Off => return self.end_compensation(),
            RadiusSide::Left => 1.0,
            RadiusSide::Right => -1.0,
        };
        let column = usize::from(word.column);
        if self.compensation.is_some() {
            return Err(Stop::new(column, Fault::Meanwhile(spelled(word.tenths))));
        }
        if self.state.modal.plane != Plane::Xy {
            let (code, why) =
                (spelled(word.tenths), "the cutter's radius is compensated in the plane G17 only");
            return Err(Stop::new(column, Fault::Unsupported { code, why }));
        }
        let radius = self.compensated_radius(word)?;
        if radius == 0.0 {
            return Ok(());
        }
        let at = [self.state.at[0], self.state.at[1]];
        let (side, radius) = (side * radius.signum(), radius.abs());
        self.compensation =
            Some(Compensation { side, radius, last: None, at, begun: at, waiting: Vec::new() });
        Ok(())
    }

    /// The radius by the word D: a number of a tool, or under G41.1 a diameter; else that of the tool in the
    /// spindle.
    fn compensated_radius(&mut self, word: CodeWord) -> Result<f64, Stop> {
        let column =
            if self.block.peek(b'D').is_some() { self.block.column(b'D') } else { usize::from(word.column) };
        let d = self.block.take(b'D');
        if word.tenths % 10 == 1 {
            let Some(diameter) = d else { return Err(self.missing(word, "D with the cutter's diameter")) };
            return Ok(0.5 * diameter * self.state.modal.unit);
        }
        let number = match d {
            Some(d) => self.whole(b'D', d, 0.0..=99_999_999.0, "the number of a tool")?,
            None => 0,
        };
        let number = if number == 0 { self.state.tool } else { number };
        self.state.radius_of(number).ok_or_else(|| Stop::new(column, Fault::NoRadius(number)))
    }

    /// Lets go what waits, and ends the compensation.
    pub fn end_compensation(&mut self) -> Result<(), Stop> {
        self.let_go()?;
        self.compensation = None;
        Ok(())
    }

    /// A code that cannot stand while the radius is compensated.
    pub fn needs_no_compensation(&self, word: CodeWord) -> Result<(), Stop> {
        if self.compensation.is_none() {
            return Ok(());
        }
        Err(Stop::new(usize::from(word.column), Fault::Meanwhile(spelled(word.tenths))))
    }

    /// A programmed move, compensated.
    pub fn beside(&mut self, mut way: Way, to: Place, feed: f64) -> Result<(), Stop> {
        let (from, end) = ([self.state.at[0], self.state.at[1]], [to[0], to[1]]);
        let Some(compensation) = &self.compensation else { return Ok(()) };
        let axis = match (compensation.last, &way) {
            (None, _) => self.lead_in(&way, from, end)?,
            (Some(_), Way::Straight(_)) if from == end => compensation.at,
            (Some(last), _) => self.turn_corner(&last, &mut way, from, end, feed)?,
        };
        let setting = self.setting_index();
        let line = self.line_number();
        let mut place = to;
        (place[0], place[1]) = (axis[0], axis[1]);
        if let Some(compensation) = &mut self.compensation {
            compensation.at = axis;
            compensation.waiting.push(Waiting { way, to: place, feed, line, setting });
        }
        self.state.at = to;
        Ok(())
    }

    /// The first move: where the axis ends.
    fn lead_in(&mut self, way: &Way, from: Spot, end: Spot) -> Result<Spot, Stop> {
        let Some(compensation) = &mut self.compensation else { return Ok(end) };
        let length = minus(end, from);
        let (length, radius) = (length[0].hypot(length[1]), compensation.radius);
        if matches!(way, Way::Round { .. }) || length <= radius {
            return Err(Stop::new(0, Fault::Entry { radius }));
        }
        let [_, direction] = way.directions(from, end);
        let axis = along(end, compensation.aside(direction), radius);
        compensation.last = Some(Curve::Line { through: axis, along: direction });
        Ok(axis)
    }

    /// The corner before a move, and where the axis ends after it.
    fn turn_corner(
        &mut self,
        last: &Curve,
        way: &mut Way,
        from: Spot,
        end: Spot,
        feed: f64,
    ) -> Result<Spot, Stop> {
        let stop = |fault: Fault| Stop::new(0, fault);
        let Some(compensation) = &mut self.compensation else { return Ok(end) };
        let [first, final_way] = way.directions(from, end);
        let curve = compensation.curve(way, from, end).map_err(stop)?;
        let (radius, side) = (compensation.radius, compensation.side);
        let before = minus(compensation.at, from);
        let after = compensation.aside(first);
        // How far the way turns toward the cutter.
        let turn = side * cross(before, after).atan2(dot(before, after));
        let outer = turn < -STRAIGHT || turn.abs() > std::f64::consts::PI - STRAIGHT;
        let axis = along(end, compensation.aside(final_way), radius);
        if turn > STRAIGHT && !outer {
            let corner =
                compensation.meeting(last, &curve, from).ok_or_else(|| stop(Fault::Corner { radius }))?;
            compensation.cut_short(corner).map_err(stop)?;
            if let Curve::Line { along: d, .. } = curve
                && dot(minus(axis, corner), d) < -TOUCHING
            {
                return Err(stop(Fault::Corner { radius }));
            }
            self.let_go()?;
        } else {
            self.let_go()?;
            if outer {
                let mut to = self.state.tip();
                let spot = along(from, after, radius);
                (to[0], to[1]) = (spot[0], spot[1]);
                let (clockwise, sweep) = (side > 0.0, (-turn).rem_euclid(TAU));
                let arc = Way::Round { centre: from, clockwise, sweep };
                let round = if matches!(way, Way::Straight(StepKind::Rapid)) { *way } else { arc };
                let (line, setting) = (self.line_number(), self.setting_index());
                self.leave(&Waiting { way: round, to, feed, line, setting })?;
            }
        }
        let tip = self.state.tip();
        if let Curve::Circle { centre, clockwise, .. } = curve {
            shorten(way, ahead(from, [tip[0], tip[1]], centre, clockwise), radius).map_err(stop)?;
        }
        if let Some(compensation) = &mut self.compensation {
            (compensation.last, compensation.begun) = (Some(curve), [tip[0], tip[1]]);
        }
        Ok(axis)
    }

    /// Lets the moves go that wait.
    fn let_go(&mut self) -> Result<(), Stop> {
        let waiting = self.compensation.as_mut().map(|c| std::mem::take(&mut c.waiting)).unwrap_or_default();
        waiting.iter().try_for_each(|step| self.leave(step))
    }

    /// A move leaves, from where the axis is.
    fn leave(&mut self, step: &Waiting) -> Result<(), Stop> {
        let programmed = self.state.at;
        let start = self.state.tip();
        let kind = match step.way {
            Way::Straight(kind) => kind,
            Way::Round { centre, clockwise, sweep } => self.add_arc(centre, &start, clockwise, sweep),
        };
        self.state.place = self.state.frame.machine_place(&step.to);
        self.push_as(kind, step.feed, step.line, step.setting)?;
        self.state.at = programmed;
        Ok(())
    }

    /// An arc about a centre from here, level with it.
    fn add_arc(&mut self, centre: Spot, start: &Place, clockwise: bool, sweep: f64) -> StepKind {
        let mut level = *start;
        (level[0], level[1]) = (centre[0], centre[1]);
        let placed = self.state.frame.machine_place(&level);
        let sense = if clockwise { -1.0 } else { 1.0 };
        let normal = self.state.frame.direction(2).map(|x| sense * x);
        self.out.arcs.push(Arc {
            centre: [placed[0], placed[1], placed[2]],
            normal,
            sweep,
            plane: Plane::Xy,
        });
        StepKind::Arc(self.out.arcs.len() as u32 - 1)
    }
}

impl Compensation {
    /// Ends the last move at a corner, which must lie on its way.
    fn cut_short(&mut self, corner: Spot) -> Result<(), Fault> {
        if let Some(Curve::Line { along: d, .. }) = self.last {
            // As far back as the corner lies, the move must have come.
            let back = dot(minus(self.at, corner), d);
            if dot(minus(self.at, self.begun), d) < back - TOUCHING {
                return Err(Fault::Corner { radius: self.radius });
            }
        }
        if let Some(Curve::Circle { centre, clockwise, .. }) = self.last {
            let back = ahead(corner, self.at, centre, clockwise);
            self.waiting.iter_mut().try_for_each(|step| shorten(&mut step.way, back, self.radius))?;
        }
        for step in &mut self.waiting {
            (step.to[0], step.to[1]) = (corner[0], corner[1]);
        }
        self.at = corner;
        Ok(())
    }
}
