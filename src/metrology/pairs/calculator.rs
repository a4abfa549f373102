//! What a ridge should be by the finished path and the design alone.

use super::RidgeCrossing;
use cutter::Cutter;
use geometry::{Point3, Vector3};
use motion::{ClPoint, MoveKind, Toolpath};
use part::Part;
use scallop::{BallSection, SurfaceCurvature, ridge_between};

/// Tracks are parallel where their directions differ by no more than this, as a sine (1°): a section across
/// one of them then sees the other as a circle to 0.02 % of the height.
const PARALLEL: f64 = 0.017_45;

/// Rounds of Newton's method in which the ridge is found; parallel tracks need two. Where a corner of a track
/// keeps it from settling, no height is calculated.
const ROUNDS: usize = 16;

/// The ridge is found when it moves by less than this, mm.
const SETTLED: f64 = 1e-10;

/// Balls that meet at a smaller angle than this, as a sine, do not tell where.
const LEAST_SINE: f64 = 1e-4;

/// Rounds in which the nearest ball on a bowed way is found, the share of a move below which it is, and how
/// far beside a share the slope and bend of the way are taken.
const BOWED_ROUNDS: usize = 12;
const BOWED_SETTLED: f64 = 1e-9;
const BESIDE: f64 = 1e-4;

/// Moves that turn by more than this, as a cosine (30°), make a corner, not a bend.
const CORNER: f64 = 0.866;

/// A ball's centre stands over its contact within this share of the distance; beside a border it does not.
const UPRIGHT: f64 = 1e-4;

/// A height calculated at a place.
#[derive(Debug, Clone, Copy)]
pub(super) struct Calculated {
    /// Where the two balls meet, over the design, mm.
    pub height: f64,
    /// On a circular section, mm.
    pub section: Option<f64>,
    /// Whether the tracks are parallel there.
    pub parallel: bool,
    /// How far the ridge moved in the last round, mm.
    pub unsettled: f64,
}

/// Calculates for the balls of one path.
pub(super) struct Calculator<'a> {
    part: &'a Part,
    path: &'a Toolpath,
    radius: f64,
    /// Height of the ball's centre over the tip, mm.
    centre: f64,
    /// Of patches: that of a mesh would be fitted.
    curvature: Option<SurfaceCurvature<'a>>,
}

/// The place of a track's ball that is nearest to something.
struct Nearest {
    centre: Point3,
    /// Direction of the track there, of any length; zero for a ball that stands.
    along: Vector3,
}

impl<'a> Calculator<'a> {
    pub fn new(part: &'a Part, cutter: &Cutter, path: &'a Toolpath) -> Self {
        let (radius, centre) = (cutter.radius(), cutter.profile().centre_z);
        let of_patches = || SurfaceCurvature::of(part, radius).ok();
        let curvature = if part.patches().is_empty() { None } else { of_patches() };
        Self { part, path, radius, centre, curvature }
    }

    /// The height of the ridge in the section across both tracks through the place of the design below a
    /// crossing: where the balls of both tracks come as near as their radius. `None` where they do not meet,
    /// where the ridge runs across that section, where they meet in another ridge than was crossed, or a move
    /// meets that is not of a pass: a link, a plunge, a lift.
    pub fn at(&self, crossing: &RidgeCrossing) -> Option<Calculated> {
        if crossing.moves.iter().any(|k| self.path.moves[*k as usize].kind != MoveKind::Cut) {
            return None;
        }
        let foot = self.part.closest_point(&crossing.at).0;
        let mut balls = crossing.moves.map(|k| self.nearest(k, &foot.point));
        let [a, b] = [balls[0].along, balls[1].along];
        let parallel = a.cross(&b).norm() <= PARALLEL * a.norm() * b.norm();
        // The section across both tracks; passes may be fed either way.
        let feed = (a + b * a.dot(&b).signum()).try_normalize(1e-9)?;
        let up = (foot.normal - feed * feed.dot(&foot.normal)).try_normalize(1e-9)?;
        let across = feed.cross(&up);
        let first = ridge_between(balls.each_ref().map(|ball| ball.centre), self.radius, &up)?;
        let mut at = first - feed * feed.dot(&(first - foot.point));
        for _ in 0..ROUNDS {
            balls = crossing.moves.map(|k| self.nearest(k, &at));
            let [p, q] = balls.each_ref().map(|ball| at - ball.centre);
            let off = [p.norm() - self.radius, q.norm() - self.radius];
            let [p, q] = [p, q].map(|d| [d.dot(&across) / d.norm(), d.dot(&up) / d.norm()]);
            let determinant = p[0] * q[1] - p[1] * q[0];
            if determinant.abs() < LEAST_SINE {
                return None;
            }
            let x = (off[1] * p[1] - off[0] * q[1]) / determinant;
            let y = (off[0] * q[0] - off[1] * p[0]) / determinant;
            at += across * x + up * y;
            let unsettled = x.hypot(y);
            if unsettled < SETTLED {
                // Tracks that cross meet in ridges along both of their bisectors. A section sees that alone
                // which it is across.
                let ridge = (at - balls[0].centre).cross(&(at - balls[1].centre));
                if ridge.dot(&feed).abs() <= ridge.dot(&across).abs() {
                    return None;
                }
                // Balls that all but stand in one place meet in a ridge that ends elsewhere.
                let apart = (balls[1].centre - balls[0].centre).norm();
                if (at - crossing.at).norm() > apart {
                    return None;
                }
                let (height, section) = (self.part.closest_point(&at).1, self.on_section(&balls));
                return Some(Calculated { height, section, parallel, unsettled });
            }
        }
        None
    }

    /// The height on a circular section through the two contacts.
    fn on_section(&self, balls: &[Nearest; 2]) -> Option<f64> {
        let curvature = self.curvature.as_ref()?;
        let contacts = balls.each_ref().map(|ball| self.part.closest_point(&ball.centre).0);
        let over = |k: usize| {
            let up = balls[k].centre - contacts[k].point;
            up.dot(&contacts[k].normal) >= (1.0 - UPRIGHT) * up.norm()
        };
        if !(over(0) && over(1)) {
            return None;
        }
        let chord = contacts[1].point - contacts[0].point;
        let bend = |k: usize| {
            let normal = contacts[k].normal;
            let across = (chord - normal * normal.dot(&chord)).try_normalize(1e-12)?;
            curvature.along(&contacts[k], &across)
        };
        let section = BallSection::new(self.radius, 0.5 * (bend(0)? + bend(1)?)).ok()?;
        section.height_of_chord(chord.norm()).ok()
    }

    /// The ball nearest to `q` on the track of a move, looked for from that move on.
    fn nearest(&self, k: u32, q: &Point3) -> Nearest {
        let mut k = k as usize;
        let (mut here, mut share) = self.on_move(k, q);
        // Each step comes nearer, so that it ends. On the hollow side of a bent track both chords of a corner
        // have a nearest place of their own.
        let nearer = |k: usize, here: &Point3| {
            let around = [self.beyond(k, true), self.beyond(k, false)].into_iter().flatten();
            let found = around.map(|next| (next, self.on_move(next, q)));
            let nearest = found.min_by(|a, b| (a.1.0 - q).norm().total_cmp(&(b.1.0 - q).norm()));
            nearest.filter(|(_, (centre, _))| (centre - q).norm() < (here - q).norm())
        };
        while let Some((next, (centre, t))) = nearer(k, &here) {
            (k, here, share) = (next, centre, t);
        }
        Nearest { centre: here, along: self.along(k, share) }
    }

    /// The move of the same track after a move or before it, past those that do not move the ball.
    fn beyond(&self, k: usize, after: bool) -> Option<usize> {
        let mut next = k;
        loop {
            let onward = if after { next + 1 } else { next.checked_sub(1)? };
            if !self.goes_on(next, onward) {
                return None;
            }
            if self.way(onward) != Vector3::zeros() {
                return Some(onward);
            }
            next = onward;
        }
    }

    /// True when move `next` feeds along the surface in the pass of move `k`.
    fn goes_on(&self, k: usize, next: usize) -> bool {
        let pass = self.path.moves[k].pass;
        self.path.moves.get(next).is_some_and(|m| m.pass == pass && m.kind.is_on_surface())
    }

    /// Centre of the ball at a location.
    fn ball(&self, at: &ClPoint) -> Point3 {
        at.tip + at.axis * self.centre
    }

    /// The way of the ball on a move.
    fn way(&self, k: usize) -> Vector3 {
        self.ball(&self.path.moves[k].to) - self.ball(&self.path.location_before(k))
    }

    /// Direction of the track at a share of a move. Chords of a bent track turn at their ends, where the
    /// track itself has the mean direction of both.
    fn along(&self, k: usize, share: f64) -> Vector3 {
        let unit = |k: usize| self.way(k).try_normalize(0.0).unwrap_or_else(Vector3::zeros);
        let own = unit(k);
        let mean = |next: Option<usize>| {
            let other = next.filter(|next| self.goes_on(k, *next)).map_or(own, unit);
            // A corner of the track is none of its bends.
            if other.dot(&own) > CORNER { own + other } else { own * 2.0 }
        };
        mean(k.checked_sub(1)) * (1.0 - share) + mean(Some(k + 1)) * share
    }

    /// The ball nearest to `q` on a move, and its share of the move. Where the axis turns the way bows; the
    /// share is then found by Newton's method, begun on the chord.
    fn on_move(&self, k: usize, q: &Point3) -> (Point3, f64) {
        let (from, to) = (self.path.location_before(k), self.path.moves[k].to);
        let (a, way) = (self.ball(&from), self.way(k));
        let length = way.norm_squared();
        if length == 0.0 {
            return (a, 0.0);
        }
        let mut share = ((q - a).dot(&way) / length).clamp(0.0, 1.0);
        if from.axis == to.axis {
            return (a + way * share, share);
        }
        let ball = |t: f64| self.ball(&from.towards(&to, t));
        for _ in 0..BOWED_ROUNDS {
            let [before, here, after] = [-BESIDE, 0.0, BESIDE].map(|d| ball(share + d));
            let slope = (after - before) / (2.0 * BESIDE);
            let bend = ((after - here) - (here - before)) / BESIDE.powi(2);
            let curving = slope.norm_squared() - (q - here).dot(&bend);
            // Beyond the middle of the bow's circle Newton's method would go away from the nearest place.
            let step = (q - here).dot(&slope) / if curving > 0.0 { curving } else { length };
            let next = (share + step).clamp(0.0, 1.0);
            let done = (next - share).abs() < BOWED_SETTLED;
            share = next;
            if done {
                break;
            }
        }
        (ball(share), share)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::{AnalyticShape, AnalyticSurface};
    use motion::Move;
    use part::Patch;

    /// A ball that rolls around an edge, its axis turning by `turn` rad a move: the nearest ball is that of
    /// the finest look at all moves, from whichever move near it the search begins, inside the bow and
    /// outside of it.
    #[test]
    fn the_nearest_ball_of_turning_moves_is_found() {
        let surface = AnalyticSurface::new(AnalyticShape::Plane { height: 0.0 }, [[-9.0, 9.0]; 2]).unwrap();
        let part = Part::from_patches(vec![Patch::Analytic(surface)], 0.01).unwrap();
        for turn in [0.03f64, 0.1, 0.3] {
            let at = |k: i32| {
                let angle = turn * f64::from(k);
                let axis = Vector3::new(angle.sin(), 0.02 * f64::from(k), angle.cos()).normalize();
                // The tip stays close, so that the centre's way is nearly a circle.
                ClPoint { tip: Point3::new(0.01 * f64::from(k), 0.05 * f64::from(k), 0.0), axis }
            };
            let move_to = |k| Move { to: at(k), kind: MoveKind::Cut, feed_rate: 1000.0, pass: 0 };
            let path = Toolpath::new(at(-4), (-3..=4).map(move_to).collect());
            let calculator = Calculator::new(&part, &Cutter::ball(6.0).unwrap(), &path);
            let ball =
                |k: usize, t: f64| calculator.ball(&path.location_before(k).towards(&path.moves[k].to, t));
            for k in 3..5 {
                for (along, out) in [(0.1, -2.9), (0.5, -3.0), (0.8, -3.1), (0.4, 2.0), (0.97, -1.0)] {
                    let centre = ball(k, along);
                    let q = centre + at(k as i32 - 4).axis * out;
                    let looks =
                        (0..path.len()).flat_map(|k| (0..=20_000).map(move |t| (k, f64::from(t) / 20_000.0)));
                    let least = looks.map(|(k, t)| (ball(k, t) - q).norm()).fold(f64::INFINITY, f64::min);
                    for from in k - 1..=k + 1 {
                        let found = (calculator.nearest(from as u32, &q).centre - q).norm();
                        assert!((found - least).abs() < 1e-9, "{turn} {k} {along} {out}: {found} {least}");
                    }
                }
            }
        }
    }
}
