//! A piece cleared by passes of constant engagement, and what they leave.
//!
//! Enters: the piece of the cutter's centre, the ground. Leaves: runs of such passes, each of which begins
//! with a helix, or in the air where there is some, and runs that keep to the limit by loops: to places where
//! stock may still stand, and along the walls; mm.

use super::air::Air;
use super::bounded::{Bounding, Rules, STEP, bound_all};
use super::chambers::Chambers;
use super::cleared::Cleared;
use super::peel::Peeler;
use super::rest::Cells;
use super::route::{Entry, Run, begun_near, circle};
use super::walls::Room;
use geometry::{Piece, Point2, Region};
use work::monitor::{Cancelled, Monitor};
use work::parallel;

/// Precision of the place with most room, over the radius.
const DISC_PRECISION: f64 = 0.05;

/// Runs that clear a piece.
#[derive(Default)]
pub(super) struct Clearing {
    /// Passes of constant engagement.
    pub peeled: Vec<Run>,
    /// What has to follow, bounded by loops.
    pub rest: Vec<Run>,
    /// What bounding that did.
    pub bounding: Bounding,
}

impl Clearing {
    /// Length of all ways, those down included, mm.
    fn length(&self, down: f64) -> f64 {
        let along = |run: &Run| down + run.points.windows(2).map(|w| (w[1] - w[0]).norm()).sum::<f64>();
        self.peeled.iter().chain(&self.rest).map(along).sum()
    }
}

/// Clears a piece; `None` where it has neither air nor room for a helix.
///
/// Passes go through necks, or each chamber gets a helix of its own before they do, whichever makes the
/// shorter path.
///
/// # Errors
/// [`Cancelled`] when the monitor says so.
pub(super) fn clear(
    piece: &Piece,
    air: Option<&Air>,
    ground: &mut Cleared,
    rules: &Rules,
    monitor: &dyn Monitor,
) -> Result<Option<Clearing>, Cancelled> {
    let room = Room::new(piece);
    let ways = air.map_or_else(Vec::new, |air| air.ways_in(|p| piece.contains(p)));
    let chambers = match ways.first() {
        Some(_) => None,
        None => Chambers::of(piece, &room, rules.bounds.radius, rules.helix[1], monitor)?,
    };
    let mut plans = vec![(None, ground.clone())];
    plans.extend(chambers.map(|chambers| (Some(chambers), ground.clone())));
    let cleared = parallel::try_map_mut(&mut plans, |_, (chambers, ground)| {
        let Some(cells) = Cells::new(piece, rules.bounds.radius) else { return Ok(None) };
        Clearer {
            piece,
            air,
            ways: &ways,
            room: &room,
            rules,
            monitor,
            cells,
            ground,
            chambers: chambers.as_mut(),
        }
        .clear()
    })?;
    let found = cleared.into_iter().zip(plans).filter_map(|(clearing, plan)| Some((clearing?, plan.1)));
    let best = found.min_by(|(a, _), (b, _)| {
        let exceeds = |clearing: &Clearing| !clearing.bounding.above.is_empty();
        exceeds(a).cmp(&exceeds(b)).then(a.length(rules.down).total_cmp(&b.length(rules.down)))
    });
    Ok(best.map(|(clearing, its)| {
        *ground = its;
        clearing
    }))
}

/// Clears a piece in one way.
struct Clearer<'a> {
    piece: &'a Piece,
    air: Option<&'a Air>,
    ways: &'a [Vec<Point2>],
    room: &'a Room<'a>,
    rules: &'a Rules,
    monitor: &'a dyn Monitor,
    cells: Cells,
    ground: &'a mut Cleared,
    /// What passes may not go to before a helix is there.
    chambers: Option<&'a mut Chambers>,
}

impl Clearer<'_> {
    fn clear(mut self) -> Result<Option<Clearing>, Cancelled> {
        let (radius, [wanted, least]) = (self.rules.bounds.radius, self.rules.helix);
        let mut clearing = Clearing::default();
        self.air.iter().flat_map(|air| &air.discs).for_each(|p| self.cells.clear_at(p));
        for way in self.ways {
            let run = self.peeled(way, Entry::Air)?;
            if run.points.len() > 1 {
                clearing.peeled.extend(self.room.kept_runs(run));
            }
        }
        let whole = Region { pieces: vec![self.piece.clone()] };
        let mut next = match self.ways.first() {
            Some(_) => self.deep_in_stock()?,
            None => whole
                .largest_disc(DISC_PRECISION * radius, self.monitor)?
                .filter(|disc| disc.1 >= least)
                .map(|disc| disc.0),
        };
        while let Some(centre) = next {
            let helix = wanted.min(self.room.distance(&centre));
            let mut turn = circle(&centre, helix, 0.0, STEP * radius);
            turn.push(turn[0]);
            turn.iter().for_each(|p| self.ground.add(*p));
            self.chambers.iter_mut().for_each(|chambers| chambers.enter(&centre));
            self.cells.clear_along(&turn);
            let run = self.peeled(&turn, Entry::Helix { centre, radius: helix, begin: 0.0 })?;
            // A step past an inner corner follows the wall around it.
            clearing.peeled.extend(self.room.kept_runs(run));
            next = self.deep_in_stock()?;
        }
        if clearing.peeled.is_empty() || self.chambers.is_some_and(|chambers| !chambers.all_entered()) {
            return Ok(None);
        }
        for wall in self.piece.curves() {
            self.cells.clear_along(wall);
            self.cells.clear_along(&[wall[wall.len() - 1], wall[0]]);
        }
        clearing.rest =
            self.cells.runs_to_standing(&clearing.peeled, self.ways, &|p| Some(*p), self.monitor)?;
        clearing.rest.extend(around_walls(self.piece, &clearing));
        clearing.bounding = bound_all(&mut clearing.rest, self.room, self.ground, self.rules, self.monitor)?;
        Ok(Some(clearing))
    }

    /// The passes that go on from the end of a way over ground that is cleared. Before another helix has to
    /// go down, places from which none came through are tried again, which stays where it comes to the place
    /// of that helix.
    fn peeled(&mut self, way: &[Point2], entry: Entry) -> Result<Run, Cancelled> {
        let bounds = self.rules.bounds;
        let chambers = self.chambers.as_deref();
        let mut peeler = Peeler::new(self.room, chambers, self.ground, [bounds.limit, bounds.radius], way);
        peeler.peel(self.monitor)?;
        let deep = |cells: &Cells, ground: &Cleared| {
            cells.deep_in_stock(self.room, ground, self.rules.helix[1], self.monitor)
        };
        let mut next = deep(&self.cells, peeler.ground())?;
        let (mut done, mut ground) = (peeler.way().len(), None);
        while next.is_some() && peeler.take_back() {
            ground = Some(peeler.ground().clone());
            peeler.peel(self.monitor)?;
            let left = deep(&self.cells, peeler.ground())?;
            if left == next {
                break;
            }
            (next, done, ground) = (left, peeler.way().len(), None);
        }
        let mut points = peeler.into_way();
        points.truncate(done);
        if let Some(ground) = ground {
            *self.ground = ground;
        }
        let mut points = points.split_off(way.len() - 1);
        self.cells.clear_along(&points);
        if let Entry::Helix { centre, radius, .. } = entry {
            let rings = rings_within(&centre, radius, self.rules);
            points.splice(0..0, rings);
        }
        Ok(Run { entry, points })
    }

    fn deep_in_stock(&self) -> Result<Option<Point2>, Cancelled> {
        self.cells.deep_in_stock(self.room, self.ground, self.rules.helix[1], self.monitor)
    }
}

/// From the beginning of a helix over the core that a round bottom leaves within it, and back.
fn rings_within(centre: &Point2, radius: f64, rules: &Rules) -> Vec<Point2> {
    let begin = centre + geometry::Vector2::new(radius, 0.0);
    let mut ring = radius;
    let mut way = Vec::new();
    while ring > rules.core {
        ring = (ring - rules.step).max(0.0);
        let first = circle(centre, ring, 0.0, STEP * rules.bounds.radius);
        way.extend(first.iter().chain(first.first()).copied());
    }
    if way.is_empty() { way } else { std::iter::once(begin).chain(way).collect() }
}

/// Once around each wall.
fn around_walls(piece: &Piece, clearing: &Clearing) -> Vec<Run> {
    let last = clearing.rest.last().or(clearing.peeled.last());
    let mut end = last.and_then(|run| run.points.last()).copied().unwrap_or(piece.outer[0]);
    let around = |wall: &[Point2]| {
        let mut points = begun_near(wall, &end, 0.0);
        points.push(points[0]);
        end = points[0];
        Run { entry: Entry::Ramp(points.clone()), points }
    };
    piece.curves().map(around).collect()
}

#[cfg(test)]
mod tests {
    use super::super::loops::Sides;
    use super::super::turning::Turning;
    use super::*;
    use std::f64::consts::{PI, TAU};
    use work::monitor::Silent;

    fn rules(limit: f64, radius: f64) -> Rules {
        let bounds = Turning { limit, radius };
        Rules {
            bounds,
            sides: Sides::Left,
            helix: [0.8 * radius, 0.2 * radius],
            down: 40.0,
            step: radius,
            core: radius,
        }
    }

    /// Two circles joined by a corridor: from a helix each they are cleared by a much shorter path than
    /// through the corridor.
    #[test]
    fn chambers_get_helices_of_their_own_where_that_is_shorter() {
        let (radius, half) = (9.0f64, 3.5f64);
        let open = (half / radius).asin();
        let arc = |x: f64, begin: f64| {
            let turn = TAU - 2.0 * open;
            let at = move |k: u32| begin + turn * f64::from(k) / 100.0;
            (0..=100).map(move |k| Point2::new(x + radius * at(k).cos(), radius * at(k).sin()))
        };
        let outer = arc(0.0, open).chain(arc(40.0, PI + open)).collect();
        let piece = Piece { outer, islands: Vec::new() };
        let room = Room::new(&piece);
        let ground = Cleared::new([Point2::new(-13.0, -13.0), Point2::new(53.0, 13.0)], 4.0);
        for degrees in [25.0f64, 40.0] {
            let rules = rules(degrees.to_radians(), 4.0);
            let found = clear(&piece, None, &mut ground.clone(), &rules, &Silent).unwrap().unwrap();
            let through = Clearer {
                piece: &piece,
                air: None,
                ways: &[],
                room: &room,
                rules: &rules,
                monitor: &Silent,
                cells: Cells::new(&piece, 4.0).unwrap(),
                ground: &mut ground.clone(),
                chambers: None,
            };
            let through = through.clear().unwrap().unwrap();
            let [shorter, longer] = [&found, &through].map(|clearing| clearing.length(rules.down));
            assert!(shorter < 0.8 * longer, "{degrees}: {shorter} {longer}");
        }
    }

    /// What the turn of a helix clears needs no run of its own: one to its middle would come straight down.
    #[test]
    fn the_middle_of_a_helix_is_cleared() {
        let square = [(0., 0.), (12., 0.), (12., 12.), (0., 12.)].map(|(x, y)| Point2::new(x, y)).to_vec();
        let piece = Piece { outer: square, islands: Vec::new() };
        let around = [Point2::new(-2.0, -2.0), Point2::new(14.0, 14.0)];
        let mut ground = Cleared::new(around, 2.0);
        let found = clear(&piece, None, &mut ground, &rules(1.2, 2.0), &Silent).unwrap().unwrap();
        let Entry::Helix { centre, .. } = found.peeled[0].entry else { panic!("a helix") };
        let ends = found.rest.iter().map(|run| (run.points[run.points.len() - 1] - centre).norm());
        assert!(ends.fold(f64::INFINITY, f64::min) > 2.0);
    }
}
