//! Joins passes into one program: in the order that keeps air moves short, along the surface where the next
//! pass begins nearby, else by retracts no higher than stock asks for.
//!
//! Enters: passes as runs of tip positions, mm. Leaves: a program that feeds along every pass from one end to
//! the other. Between two passes it takes the quicker of
//! - a link on the surface ([`bend`]): a smooth bend, fed at the cutting feed, that the dropped cutter holds
//!   on the part;
//! - a retract: straight up, by the clearance at the feed, over and down at rapid rate, the last of the way
//!   down fed. No rapid runs lower than the clearance above what stock can stand there ([`ceiling`]), and
//!   none rises above the safe height over all stock.
//!
//! Times are those of length over rate; what the machine loses in corners is left out, which favours retracts
//! a little.
//!
//! With links on the surface the first pass is entered from beside the stock where that is quicker than a
//! plunge from above ([`entry`]).
//!
//! Links on the surface and smoothing are off unless a scene asks for them: bends beside the part change what
//! closed forms say about its border.

mod bend;
mod beside;
mod ceiling;
mod detour;
mod entry;
mod order;
#[cfg(test)]
mod tests;
mod tilted;

use crate::layers::Layer;
use crate::surface::border::Border;
use crate::vocabulary::{Joining, Links, PlanSettings, Setup, Step};
use bend::{Bends, End};
use ceiling::Ceiling;
use cutter::Cutter;
pub use detour::{Detour, around_fixtures};
use drop_cutter::DropCutter;
use entry::Sides;
use geometry::{Point2, Point3, Vector2, Vector3, distance_to_segment, share_on};
use machine::Machine;
use motion::{ClPoint, Move, MoveKind, ROUNDING, Toolpath};
use order::{Costs, Visit, is_closed, order};
use scallop::strip_width;
pub(crate) use tilted::join_tilted;
use work::monitor::{self, Cancelled};

/// Longest link on the surface, in intervals between passes on a plane, unless another is asked for. It
/// reaches the next pass along borders that passes meet at two degrees or more, and what is shorter is often
/// quicker than a retract; longer ones leave traces across finished surface.
pub const LONGEST_LINK: f64 = 30.0;

/// A closed pass begins this many times as far ahead as it lies beside the tool, so that the link to
/// it bends gently.
const LEAD: f64 = 2.0;

/// A descent at rapid rate shorter than this, mm, is left to the plunge.
const LEAST_DESCENT: f64 = 1e-3;

/// Longest link on the surface in effect, mm.
pub fn longest_link(joining: &Joining, cutter: &Cutter, step: Step) -> f64 {
    joining.longest_link.unwrap_or(LONGEST_LINK * plane_interval(cutter, step))
}

/// Interval between passes on a plane, mm.
pub fn plane_interval(cutter: &Cutter, step: Step) -> f64 {
    match step {
        Step::Stepover(width) => width,
        Step::Scallop(height) => strip_width(1.0 / cutter.radius(), 0.0, height, cutter.radius()).0,
    }
}

/// Joins passes, layer by layer. Each is a run of at least two tip positions without repeats; passes of fewer
/// are left out. Without `both_ways` each keeps its direction.
///
/// # Errors
/// [`Cancelled`] when the monitor says so.
pub(crate) fn join(layers: Vec<Layer>, both_ways: bool, setup: &Setup<'_>) -> Result<Toolpath, Cancelled> {
    let Setup { part, cutter, settings, monitor } = *setup;
    monitor.start("joining passes", 0);
    let rates = Speeds::of(settings);
    let longest = match settings.joining.links {
        Links::Surface => longest_link(&settings.joining, cutter, settings.step),
        Links::Retract => 0.0,
    };
    let on_surface = longest > 0.0;
    let sides = Sides::of(setup, longest).filter(|_| on_surface);
    let costs = Costs {
        between: &|a, b| rates.between(settings, a, b, longest),
        start: &|place| rates.start(settings, place, sides.as_ref()),
        finish: &|place| rates.ascent(settings, place),
    };
    // The passes in order, and the floor of each.
    let (mut passes, mut floors) = (Vec::new(), Vec::new());
    for Layer { floor, passes: mut own } in layers {
        own.retain(|pass| pass.len() >= 2);
        let visits = order(&own, both_ways, costs);
        monitor::check(monitor)?;
        passes.append(&mut in_order(own, &visits, both_ways));
        floors.resize(passes.len(), floor);
    }
    let mut links: Vec<Option<Vec<Point3>>> = Vec::new();
    let mut way_in = None;
    if on_surface && !passes.is_empty() {
        let drop = DropCutter::watched(part, cutter, monitor)?;
        let first = passes[0][0];
        if let Some(sides) = sides {
            let way = sides.way(first, &drop, setup)?;
            way_in = way.filter(|way| rates.along(settings, way) < rates.descent(settings, &first));
        }
        let bends = Bends {
            drop,
            border: Border::of(part),
            cutter,
            interval: plane_interval(cutter, settings.step),
            longest,
            chord_tolerance: settings.chord_tolerance,
            // Jerks of its axes take seconds to search for.
            machine: &Machine { jerks: [f64::INFINITY; 3], ..settings.machine },
            feed_rate: settings.feed_rate,
        };
        links = work::parallel::try_map(passes.len() - 1, |k| {
            if floors[k] != floors[k + 1] {
                return Ok(None);
            }
            bends.link(&passes[k], &passes[k + 1], floors[k], monitor)
        })?;
    }
    let mut program = Program::new(&passes, cutter, settings, rates);
    if let Some(way) = way_in {
        program.come_in(&way);
    }
    for (k, pass) in passes.iter().enumerate() {
        monitor::check(monitor)?;
        let link = k.checked_sub(1).and_then(|k| links.get_mut(k)?.take());
        if k > 0 || program.moves.is_empty() {
            program.reach(k as u32, pass[0], link);
        }
        program.feed_along(k as u32, MoveKind::Cut, &pass[1..]);
    }
    Ok(program.finish())
}

/// Speeds of moves between passes, mm/s.
#[derive(Debug, Clone, Copy)]
struct Speeds {
    feed: f64,
    plunge: f64,
    rapid: f64,
}

/// Length of a link over the distance of its ends: the quickest bend is hardly longer than the straight way.
const BEND: f64 = 1.1;

impl Speeds {
    fn of(settings: &PlanSettings) -> Self {
        let [feed, plunge, rapid] =
            [settings.feed_rate, settings.plunge_rate, settings.machine.rapid_rate].map(|rate| rate / 60.0);
        Self { feed, plunge, rapid }
    }

    /// What it takes to go on from one place to another, s, as far as it can be told before there is a
    /// program. It is the same both ways: a retract counts by the mean height of both.
    fn between(&self, settings: &PlanSettings, a: &Point3, b: &Point3, longest: f64) -> f64 {
        let (distance, middle) = ((b - a).norm(), nalgebra::center(a, b));
        let retract =
            self.ascent(settings, &middle) + self.descent(settings, &middle) + distance / self.rapid;
        if distance * BEND > longest { retract } else { retract.min(distance * BEND / self.feed) }
    }

    /// The way down to the first place, s: all of it may lead through stock.
    fn descent(&self, settings: &PlanSettings, to: &Point3) -> f64 {
        (settings.stock_top + settings.clearance - to.z) / self.plunge
    }

    /// To the first place from above, or from beside the stock, s.
    fn start(&self, settings: &PlanSettings, to: &Point3, sides: Option<&Sides>) -> f64 {
        let above = self.descent(settings, to);
        let Some(from) = sides.and_then(|sides| sides.nearest(to)) else { return above };
        let down = settings.stock_top + settings.clearance - to.z;
        above.min(down / self.rapid + (to.xy() - from).norm() / self.feed)
    }

    /// Down to the first tip of a way and along it, s.
    fn along(&self, settings: &PlanSettings, way: &[Point3]) -> f64 {
        let down = way.first().map_or(0.0, |tip| settings.stock_top + settings.clearance - tip.z);
        let moves = way.windows(2).map(|w| (w[1] - w[0]).norm() / self.entering(&w[0], &w[1], &Vector3::z()));
        down / self.rapid + moves.sum::<f64>()
    }

    /// The rate, mm/s, of a move on the way in: at the feed, and down the tool axis no faster than a plunge,
    /// also as the program rounds it.
    fn entering(&self, from: &Point3, to: &Point3, axis: &Vector3) -> f64 {
        let (down, length) = ((from - to).dot(axis) + 2.0 * ROUNDING, (to - from).norm() - 4.0 * ROUNDING);
        if down * self.feed <= self.plunge * length {
            self.feed
        } else {
            self.plunge * (length / down).max(0.5)
        }
    }

    /// The way up from the last place, s: beyond the clearance it is rapid.
    fn ascent(&self, settings: &PlanSettings, from: &Point3) -> f64 {
        settings.clearance / self.feed + (settings.stock_top - from.z) / self.rapid
    }
}

/// What it takes to go on from a pass to the next one beside it, s, as far as it can be told before there are
/// passes.
pub(crate) fn time_to_neighbour(setup: &Setup<'_>) -> f64 {
    let Setup { part, cutter, settings, .. } = *setup;
    let longest = match settings.joining.links {
        Links::Surface => longest_link(&settings.joining, cutter, settings.step),
        Links::Retract => 0.0,
    };
    let bounds = part.bounds();
    let place = nalgebra::center(&bounds.min, &bounds.max);
    let beside = place + Vector3::x() * plane_interval(cutter, settings.step);
    Speeds::of(settings).between(settings, &place, &beside, longest)
}

/// The passes as they are visited: turned round, and closed ones begun where they are to begin.
fn in_order(mut passes: Vec<Vec<Point3>>, visits: &[Visit], both_ways: bool) -> Vec<Vec<Point3>> {
    let mut all: Vec<Vec<Point3>> = Vec::with_capacity(visits.len());
    for visit in visits {
        let mut points = std::mem::take(&mut passes[visit.pass]);
        if is_closed(&points) {
            points = match all.last() {
                None => begun_at(points, visit.start),
                Some(before) => begun_ahead(points, &End::last(before), both_ways),
            };
        } else if visit.reversed {
            points.reverse();
        }
        all.push(points);
    }
    all
}

/// A closed pass that begins (and ends) at another of its points.
fn begun_at(mut points: Vec<Point3>, start: usize) -> Vec<Point3> {
    points.pop();
    points.rotate_left(start);
    points.push(points[0]);
    points
}

/// A closed pass that begins a little ahead of where it is nearest to `from`, in the sense that `from`
/// feeds, so that the tool swings over to it.
fn begun_ahead(mut points: Vec<Point3>, from: &End, both_ways: bool) -> Vec<Point3> {
    let nearest = |points: &[Point3]| {
        let gaps = points.windows(2).map(|w| distance_to_segment(&from.tip, &w[0], &w[1])).enumerate();
        gaps.fold((0, f64::INFINITY), |best, gap| if gap.1 < best.1 { gap } else { best })
    };
    let (segment, distance) = nearest(&points);
    let along = (points[segment + 1] - points[segment]).xy();
    if both_ways && along.dot(&from.feed) < 0.0 {
        points.reverse();
    }
    let (segment, _) = nearest(&points);
    let (a, b) = (points[segment], points[segment + 1]);
    let mut ahead = share_on(&from.tip, &a, &b) * (b - a).norm() + LEAD * distance;
    let mut start = begun_at(points, segment);
    // Not round and round a pass that is shorter than that.
    for _ in 1..start.len() {
        let length = (start[1] - start[0]).norm();
        if ahead < length {
            break;
        }
        ahead -= length;
        start = begun_at(start, 1);
    }
    let (a, b) = (start[0], start[1]);
    let length = (b - a).norm();
    let share = if length > 0.0 { (ahead / length).min(1.0) } else { 0.0 };
    if share > 0.0 && share < 1.0 {
        let begin = a + (b - a) * share;
        start[0] = begin;
        let last = start.len() - 1;
        start[last] = a;
        start.push(begin);
    }
    start
}

/// A program in the making.
struct Program<'a> {
    settings: &'a PlanSettings,
    rates: Speeds,
    ceiling: Ceiling<'a>,
    start: Option<Point3>,
    moves: Vec<Move>,
    /// Moves that the ceiling knows of.
    lowered: usize,
}

impl<'a> Program<'a> {
    fn new(passes: &[Vec<Point3>], cutter: &'a Cutter, settings: &'a PlanSettings, rates: Speeds) -> Self {
        let mut low = Point2::new(f64::INFINITY, f64::INFINITY);
        let mut high = -low;
        for p in passes.iter().flatten() {
            low = low.inf(&p.xy());
            high = high.sup(&p.xy());
        }
        if passes.is_empty() {
            (low, high) = (Point2::origin(), Point2::origin());
        }
        // Links swing a little beyond the passes.
        let margin = Vector2::new(cutter.radius(), cutter.radius());
        let ceiling =
            Ceiling::new(cutter, [low - margin, high + margin], settings.stock_top, settings.memory);
        Self { settings, rates, ceiling, start: None, moves: Vec::new(), lowered: 0 }
    }

    fn safe(&self) -> f64 {
        self.settings.stock_top + self.settings.clearance
    }

    fn push(&mut self, tip: Point3, kind: MoveKind, feed_rate: f64, pass: u32) {
        self.moves.push(Move { to: ClPoint::upright(tip), kind, feed_rate, pass });
    }

    fn feed_along(&mut self, pass: u32, kind: MoveKind, tips: &[Point3]) {
        tips.iter().for_each(|&tip| self.push(tip, kind, self.settings.feed_rate, pass));
    }

    /// Brings the tool to the first pass from beside the stock.
    fn come_in(&mut self, way: &[Point3]) {
        let Some((&first, rest)) = way.split_first() else { return };
        self.start = Some(Point3::new(first.x, first.y, self.safe()));
        self.push(first, MoveKind::Rapid, 0.0, 0);
        let mut from = first;
        for &tip in rest {
            let rate = 60.0 * self.rates.entering(&from, &tip, &Vector3::z());
            self.push(tip, MoveKind::Plunge, rate.min(self.settings.feed_rate), 0);
            from = tip;
        }
    }

    /// Brings the tool to where a pass begins.
    fn reach(&mut self, pass: u32, to: Point3, link: Option<Vec<Point3>>) {
        let Some(from) = self.moves.last().map(|m| m.to.tip) else {
            self.start = Some(Point3::new(to.x, to.y, self.safe()));
            return self.push(to, MoveKind::Plunge, self.settings.plunge_rate, pass);
        };
        let time = link.as_ref().map(|tips| {
            let mut at = from;
            let length: f64 = tips.iter().map(|p| (p - std::mem::replace(&mut at, *p)).norm()).sum();
            length / self.rates.feed
        });
        if let (Some(tips), Some(time)) = (link, time) {
            // No retract is quicker than its last way down, which spares looking at stock.
            if time <= self.settings.clearance / self.rates.plunge || time <= self.retract(from, to).time {
                return self.feed_along(pass, MoveKind::Link, &tips);
            }
        }
        let retract = self.retract(from, to);
        let above = |p: Point3, z: f64| Point3::new(p.x, p.y, z);
        let mut at = self.rise(from, retract.over, pass);
        for tip in [above(to, retract.over), above(to, retract.down)] {
            if tip != at {
                self.push(tip, MoveKind::Rapid, 0.0, pass);
                at = tip;
            }
        }
        if at != to {
            self.push(to, MoveKind::Plunge, self.settings.plunge_rate, pass);
        }
    }

    /// The lowest retract that keeps the clearance from what stock can stand after all moves so far.
    fn retract(&mut self, from: Point3, to: Point3) -> Retract {
        for k in self.lowered..self.moves.len() {
            if self.moves[k].kind != MoveKind::Rapid && k > 0 {
                self.ceiling.lower(&self.moves[k - 1].to.tip, &self.moves[k].to.tip);
            }
        }
        self.lowered = self.moves.len();
        let (safe, clearance) = (self.safe(), self.settings.clearance);
        let (a, b) = (from.xy(), to.xy());
        let over = self.ceiling.free_height(&a, &b).max(from.z).max(to.z) + clearance;
        let over = over.min(safe).max(from.z);
        let down = (self.ceiling.free_height(&b, &b).max(to.z) + clearance).min(over);
        let down = if over - down < LEAST_DESCENT { over } else { down };
        let rapid = (b - a).norm() + (over - down);
        let lift = clearance.min(over - from.z);
        let rapid = rapid + (over - from.z - lift);
        let fed = lift / self.rates.feed + (down - to.z) / self.rates.plunge;
        Retract { over, down, time: rapid / self.rates.rapid + fed }
    }

    /// Straight up, from the clearance on at rapid rate: nothing stands above where the tool is.
    fn rise(&mut self, from: Point3, over: f64, pass: u32) -> Point3 {
        let lift = over.min(from.z + self.settings.clearance);
        let mut at = from;
        for (z, kind, feed_rate) in
            [(lift, MoveKind::Retract, self.settings.feed_rate), (over, MoveKind::Rapid, 0.0)]
        {
            if z > at.z {
                at.z = z;
                self.push(at, kind, feed_rate, pass);
            }
        }
        at
    }

    /// Up from the last pass.
    fn finish(mut self) -> Toolpath {
        let safe = self.safe();
        if let Some(last) = self.moves.last().copied() {
            self.rise(last.to.tip, safe, last.pass);
        }
        let start = self.start.unwrap_or(Point3::new(0.0, 0.0, safe));
        Toolpath::new(ClPoint::upright(start), self.moves)
    }
}

/// A retract: up to `over`, across, down to `down`, mm.
struct Retract {
    over: f64,
    down: f64,
    /// s.
    time: f64,
}
