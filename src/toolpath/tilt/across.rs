//! Axes that turn little from pass to pass: the turn between neighbouring contacts of different passes, bounded.
//!
//! Enters: passes as touches of the cutter, and the greatest turn, rad a mm from contact to contact. Leaves: the same
//! contacts with axes that meet half way wherever a pair turned faster, as far as the tool stays clear there: an axis that
//! would not be is held where it was, and its neighbours come to it.
//!
//! Each pair is drawn together in turn until all hold (the projections of position based dynamics, M. Müller et al. 2007,
//! on the unit sphere): axes where nothing turns too fast stay as they are.

use std::collections::HashMap;

use super::tilted::ABOVE_SURFACE;
use crate::moves::touch::Touch;
use collision::Interference;
use cutter::Cutter;
use geometry::{Point3, Vector3};
use work::monitor::{self, Cancelled, Monitor};

/// Sweeps over all pairs. What a sweep leaves shrinks the slower the more passes lie between.
const MOST_SWEEPS: usize = 1000;

/// Rounds in which axes that are not clear are held. Each holds more; what the last one leaves stays where it was.
const ROUNDS: usize = 6;

/// Pairs are drawn together by this share more than they must, so that sweeps come to an end, and hold within the other.
const SPARE: f64 = 0.01;
const SLACK: f64 = 1e-3;

/// Passes beside a contact are looked for in this many shells of cells at most, each as wide as passes lie apart.
const SHELLS: i64 = 8;

/// A pass counts as a neighbour up to this many times as far off as the nearest one.
const BESIDE: f64 = 2.0;

/// How fast axes may turn, rad a mm of contact.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TurningRates {
    /// From pass to pass.
    pub across: f64,
    /// Along a pass.
    pub along: Option<f64>,
}

/// Pairs that still turn too fast.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct TooFast {
    /// How many.
    pub count: usize,
    /// The fastest, rad a mm, and where.
    pub worst: f64,
    pub place: Point3,
}

impl TooFast {
    /// In words; `asked` in rad a mm.
    pub fn note(&self, asked: f64) -> String {
        let Self { count, worst, place: p } = self;
        format!(
            "{count} pairs of neighbouring contacts turn faster from pass to pass than the {:.2} degrees a mm asked, by up to \
             {:.2} at ({:.3}, {:.3}, {:.3}): the tool stays clear only so there; allow more `turning_across`, or lean it \
             otherwise",
            asked.to_degrees(),
            worst.to_degrees(),
            p.x,
            p.y,
            p.z
        )
    }
}

/// Two touches, and how far apart their axes may be (chord).
struct Pair {
    a: u32,
    b: u32,
    most: f64,
}

/// Evens out the axes of passes `interval` mm apart; tells what turns too fast still.
///
/// # Errors
/// [`Cancelled`] when the monitor says so.
pub(crate) fn even_out(
    passes: &mut [Vec<Touch>],
    cutter: &Cutter,
    rates: TurningRates,
    interval: f64,
    keep: Option<&Interference>,
    monitor: &dyn Monitor,
) -> Result<Option<TooFast>, Cancelled> {
    let touches: Vec<(usize, Touch)> =
        passes.iter().enumerate().flat_map(|(k, pass)| pass.iter().map(move |touch| (k, *touch))).collect();
    let across = beside(&touches, interval, rates.across);
    let mut pairs: Vec<&Pair> = across.iter().collect();
    let along = rates.along.map_or_else(Vec::new, |rate| in_passes(&touches, rate));
    pairs.extend(&along);
    let start: Vec<Vector3> = touches.iter().map(|(_, touch)| touch.at.axis).collect();
    let turned = |k: usize, axis| {
        let touch = &touches[k].1;
        Touch::along(axis, cutter, touch.contact, touch.feed)
    };
    let mut held = vec![false; touches.len()];
    let mut axes = start.clone();
    for round in 0..ROUNDS {
        for _ in 0..MOST_SWEEPS {
            monitor::check(monitor)?;
            let mut drawn = false;
            for pair in &pairs {
                drawn |= pair.draw_together(&mut axes, &held);
            }
            pairs.reverse();
            if !drawn {
                break;
            }
        }
        let clear = work::parallel::map(touches.len(), |k| {
            axes[k] == start[k]
                || (axes[k].dot(&touches[k].1.contact.normal) > ABOVE_SURFACE
                    && keep.is_none_or(|keep| keep.is_clear(&turned(k, axes[k]).at)))
        });
        if clear.iter().all(|clear| *clear) {
            break;
        }
        if round + 1 < ROUNDS {
            held.iter_mut().zip(&clear).for_each(|(held, clear)| *held |= !clear);
            axes.clone_from(&start);
        } else {
            let all = axes.iter_mut().zip(&start).zip(&clear);
            all.filter(|(_, clear)| !**clear).for_each(|((axis, start), _)| *axis = *start);
        }
    }
    let all = passes.iter_mut().flatten().zip(&axes).enumerate();
    for (k, (touch, axis)) in all.filter(|(k, (_, axis))| **axis != start[*k]) {
        *touch = turned(k, *axis);
    }
    Ok(too_fast(&across, &touches, &axes, rates.across))
}

impl Pair {
    /// Turns two axes towards each other by what is too much; one alone where the other is held.
    fn draw_together(&self, axes: &mut [Vector3], held: &[bool]) -> bool {
        let (i, j) = (self.a as usize, self.b as usize);
        let (a, b) = (axes[i], axes[j]);
        let apart = (b - a).norm();
        if apart <= self.most {
            return false;
        }
        let by = 1.0 - (1.0 - SPARE) * self.most / apart;
        let (to_a, to_b) = match (held[i], held[j]) {
            (true, true) => return false,
            (true, false) => (0.0, by),
            (false, true) => (by, 0.0),
            (false, false) => (0.5 * by, 0.5 * by),
        };
        let (Some(to), Some(from)) =
            ((a + (b - a) * to_a).try_normalize(1e-6), (b + (a - b) * to_b).try_normalize(1e-6))
        else {
            return false;
        };
        (axes[i], axes[j]) = (to, from);
        true
    }
}

fn too_fast(pairs: &[Pair], touches: &[(usize, Touch)], axes: &[Vector3], rate: f64) -> Option<TooFast> {
    let share = |pair: &Pair| {
        (axes[pair.b as usize] - axes[pair.a as usize]).norm() / pair.most.max(f64::MIN_POSITIVE)
    };
    let found = pairs.iter().filter(|pair| share(pair) > 1.0 + SLACK);
    found.fold(None, |worst: Option<TooFast>, pair| {
        let (turn, place) = (share(pair) * rate, touches[pair.a as usize].1.contact.point);
        Some(match worst {
            Some(so_far) if so_far.worst >= turn => TooFast { count: so_far.count + 1, ..so_far },
            so_far => TooFast { count: so_far.map_or(1, |s| s.count + 1), worst: turn, place },
        })
    })
}

/// Touches that follow each other on a pass.
fn in_passes(touches: &[(usize, Touch)], rate: f64) -> Vec<Pair> {
    let same = (1..touches.len()).filter(|&k| touches[k].0 == touches[k - 1].0);
    same.map(|k| pair(touches, k - 1, k, rate)).collect()
}

fn pair(touches: &[(usize, Touch)], a: usize, b: usize, rate: f64) -> Pair {
    let way = (touches[b].1.contact.point - touches[a].1.contact.point).norm();
    Pair { a: a as u32, b: b as u32, most: rate * way.max(1e-9) }
}

/// Each touch with the nearest touch of every pass beside it.
fn beside(touches: &[(usize, Touch)], interval: f64, rate: f64) -> Vec<Pair> {
    let cells = Cells::of(touches, interval);
    let found = work::parallel::map(touches.len(), |k| cells.beside(k));
    let pairs = found.iter().enumerate().flat_map(|(k, near)| near.iter().map(move |&other| (k, other)));
    pairs.map(|(k, other)| pair(touches, k, other, rate)).collect()
}

/// Touches in cubes.
struct Cells<'a> {
    touches: &'a [(usize, Touch)],
    side: f64,
    cubes: HashMap<[i64; 3], Vec<u32>>,
}

impl<'a> Cells<'a> {
    fn of(touches: &'a [(usize, Touch)], side: f64) -> Self {
        let mut cells = Self { touches, side, cubes: HashMap::new() };
        for (k, (_, touch)) in touches.iter().enumerate() {
            cells.cubes.entry(cells.cube(&touch.contact.point)).or_default().push(k as u32);
        }
        cells
    }

    fn cube(&self, p: &Point3) -> [i64; 3] {
        [p.x, p.y, p.z].map(|x| (x / self.side).floor() as i64)
    }

    /// The nearest touch of each pass beside the touch `k`.
    fn beside(&self, k: usize) -> Vec<usize> {
        let (own, touch) = &self.touches[k];
        let (p, home) = (touch.contact.point, self.cube(&touch.contact.point));
        // Nearest of each pass, in the order in which passes are met.
        let mut near: Vec<(usize, usize, f64)> = Vec::new();
        let mut nearest = f64::INFINITY;
        for shell in 0..=SHELLS {
            // What lies beyond this shell is at least so far away.
            if nearest * BESIDE < (shell - 1) as f64 * self.side {
                break;
            }
            for other in self.shell(home, shell) {
                let (pass, at) = &self.touches[other];
                let distance = (at.contact.point - p).norm();
                if pass == own {
                    continue;
                }
                nearest = nearest.min(distance);
                match near.iter_mut().find(|(known, ..)| known == pass) {
                    Some(known) if distance < known.2 => *known = (*pass, other, distance),
                    Some(_) => {}
                    None => near.push((*pass, other, distance)),
                }
            }
        }
        near.retain(|(.., distance)| *distance <= BESIDE * nearest);
        near.into_iter().map(|(_, other, _)| other).collect()
    }

    /// The touches in the cubes of a shell around one.
    fn shell(&self, home: [i64; 3], shell: i64) -> impl Iterator<Item = usize> + '_ {
        let range = -shell..=shell;
        let cubes = range.clone().flat_map(move |i| {
            let range = -shell..=shell;
            range.flat_map(move |j| {
                let edge = i.abs() == shell || j.abs() == shell;
                let step = if edge { 1 } else { (2 * shell).max(1) };
                (-shell..=shell).step_by(step as usize).map(move |k| [home[0] + i, home[1] + j, home[2] + k])
            })
        });
        cubes.filter_map(|cube| self.cubes.get(&cube)).flatten().map(|&k| k as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use collision::{Check, Obstacle};
    use cutter::Solid;
    use geometry::{Bvh, TriangleMesh};
    use motion::CcPoint;
    use work::monitor::Silent;

    /// Passes along x, half a millimetre apart, each with its lean toward y.
    fn passes(cutter: &Cutter, lean: impl Fn(i32) -> f64) -> Vec<Vec<Touch>> {
        let touch = |x: i32, y: i32| {
            let point = Point3::new(0.4 * f64::from(x), 0.5 * f64::from(y), 0.0);
            let (sin, cos) = lean(y).sin_cos();
            let axis = Vector3::new(0.0, sin, cos);
            Touch::along(axis, cutter, CcPoint { point, normal: Vector3::z() }, Vector3::x())
        };
        (0..24).map(|y| (0..30).map(|x| touch(x, y)).collect()).collect()
    }

    fn rates(across: f64) -> TurningRates {
        TurningRates { across, along: None }
    }

    #[test]
    fn a_step_between_two_passes_is_spread_over_those_beside() {
        let cutter = Cutter::ball(6.0).unwrap();
        let start = passes(&cutter, |y| if y < 12 { 0.1 } else { -0.1 });
        let mut got = start.clone();
        let left = even_out(&mut got, &cutter, rates(0.1), 0.4, None, &Silent).unwrap();
        assert_eq!(left, None);
        for (a, b) in got.iter().zip(&got[1..]) {
            for (a, b) in a.iter().zip(b) {
                assert!((a.at.axis - b.at.axis).norm() <= 0.1 * 0.5 * 1.003);
            }
        }
        let turned = got[11][7].at.axis.y - got[12][7].at.axis.y;
        assert!(turned > 0.03, "no more than it takes: {turned}");
        assert_eq!((&got[..4], &got[20..]), (&start[..4], &start[20..]), "far off nothing changes");
        let centre = |touch: &Touch| touch.at.tip + touch.at.axis * 3.0 - touch.contact.point;
        assert!(got.iter().flatten().all(|touch| (centre(touch) - Vector3::z() * 3.0).norm() < 1e-12));
    }

    #[test]
    fn what_holds_is_left_alone() {
        let cutter = Cutter::bull(6.0, 1.0).unwrap();
        let start = passes(&cutter, |y| 0.01 * f64::from(y));
        let mut got = start.clone();
        assert_eq!(even_out(&mut got, &cutter, rates(0.021), 0.4, None, &Silent).unwrap(), None);
        assert_eq!(got, start);
    }

    #[test]
    fn axes_that_must_lean_are_held_and_the_others_come_to_them() {
        let cutter = Cutter::ball(6.0).unwrap();
        // Beside the last pass, and beside the first, stands a wall that overhangs: the tool must lean away from it.
        let wall = |y: f64, over: f64| {
            let corner = |x: f64, z: f64| Point3::new(x, y + over * z, z);
            let vertices =
                vec![corner(-30.0, 0.0), corner(40.0, 0.0), corner(40.0, 12.0), corner(-30.0, 12.0)];
            let mesh = TriangleMesh::new(vertices, vec![[0, 1, 2], [0, 2, 3]]).unwrap().0;
            (Bvh::new(&mesh), mesh)
        };
        let (first, last) = (wall(-4.9, 0.45), wall(16.4, -0.45));
        let solid = Solid::of_cutter(&cutter, None);
        fn check<'a>(solid: &'a Solid, (tree, mesh): &'a (Bvh, TriangleMesh)) -> Check<'a> {
            Check { solid, obstacle: Obstacle::new(mesh, tree), needed: 0.1 }
        }
        let one = Interference { checks: vec![check(&solid, &last)], ..Interference::default() };
        let both = Interference {
            checks: vec![check(&solid, &first), check(&solid, &last)],
            ..Interference::default()
        };
        let is_clear = |keep: &Interference, passes: &[Vec<Touch>]| {
            passes.iter().flatten().all(|touch| keep.is_clear(&touch.at))
        };
        let start = passes(&cutter, |y| if y < 12 { 0.0 } else { -0.45 });
        let mut got = start.clone();
        let left = even_out(&mut got, &cutter, rates(0.02), 0.4, Some(&one), &Silent).unwrap();
        assert!(is_clear(&one, &start) && is_clear(&one, &got));
        assert_eq!(left, None);
        assert_eq!(got[23], start[23], "held");
        assert!(got[0][0].at.axis.y < -0.1, "and the first comes to the last");
        // Both cannot be had between two walls.
        let start = passes(&cutter, |y| 0.45 * (11.5 - f64::from(y)) / 11.5);
        let mut got = start.clone();
        let left = even_out(&mut got, &cutter, rates(1e-3), 0.4, Some(&both), &Silent).unwrap();
        assert!(is_clear(&both, &start) && is_clear(&both, &got));
        assert!(left.is_some_and(|left| left.worst > 1e-3 && left.count > 0), "{left:?}");
    }
}
