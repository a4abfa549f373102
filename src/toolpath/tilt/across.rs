//! Axes that turn little from pass to pass: the turn between a contact and the nearest place of a pass beside it, bounded.
//!
//! Enters: passes as touches of the cutter, and the greatest turn, rad a mm from contact to place. Leaves: the same
//! contacts with axes that meet half way wherever a pair turned faster, as far as the tool stays clear there: an axis that
//! would not be is held where it was, and its neighbours come to it.
//!
//! Each pair is drawn together in turn until all hold (the projections of position based dynamics, M. Müller et al. 2007,
//! on the unit sphere): axes where nothing turns too fast stay as they are.

use super::tilted::ABOVE_SURFACE;
use crate::moves::touch::Touch;
use collision::Interference;
use cutter::Cutter;
use geometry::{Point3, Vector3};
use motion::PassStretches;
use work::monitor::{self, Cancelled, Monitor};

/// Sweeps over all pairs. What a sweep leaves shrinks the slower the more passes lie between.
const MOST_SWEEPS: usize = 1000;

/// Rounds in which axes that are not clear are held. Each holds more; what the last one leaves stays where it was.
const ROUNDS: usize = 6;

/// Pairs are drawn together by this share more than they must, so that sweeps come to an end, and hold within the other.
const SPARE: f64 = 0.01;
const SLACK: f64 = 1e-3;

/// mm that contacts in the same place count as apart.
const LEAST_WAY: f64 = 1e-9;

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

/// A touch and a place on a move between two others, and how far apart their axes may be (chord).
struct Pair {
    touch: u32,
    /// The touches before and after the place, and how far it lies from the first to the second.
    between: [u32; 2],
    at: f64,
    most: f64,
}

/// Evens out the axes of passes; tells what turns too fast still.
///
/// # Errors
/// [`Cancelled`] when the monitor says so.
pub(crate) fn even_out(
    passes: &mut [Vec<Touch>],
    cutter: &Cutter,
    rates: TurningRates,
    keep: Option<&Interference>,
    monitor: &dyn Monitor,
) -> Result<Option<TooFast>, Cancelled> {
    let touches: Vec<(usize, Touch)> =
        passes.iter().enumerate().flat_map(|(k, pass)| pass.iter().map(move |touch| (k, *touch))).collect();
    let across = beside(&touches, 2.0 * cutter.radius(), rates.across);
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
    /// From the touch's axis to the other.
    fn apart(&self, axes: &[Vector3]) -> Vector3 {
        let [a, b] = self.between.map(|k| axes[k as usize]);
        a + (b - a) * self.at - axes[self.touch as usize]
    }

    /// Turns the axes towards each other by what is too much, each by its share in it; those that are held stay.
    fn draw_together(&self, axes: &mut [Vector3], held: &[bool]) -> bool {
        let apart = self.apart(axes);
        let distance = apart.norm();
        if distance <= self.most {
            return false;
        }
        let too_much = apart * (1.0 - (1.0 - SPARE) * self.most / distance);
        let shares = [(self.touch, 1.0), (self.between[0], self.at - 1.0), (self.between[1], -self.at)];
        let free = shares.map(|(k, share)| (k as usize, if held[k as usize] { 0.0 } else { share }));
        let sum: f64 = free.iter().map(|(_, share)| share * share).sum();
        if sum < 1e-9 {
            return false;
        }
        for (k, share) in free {
            if let Some(turned) = (axes[k] + too_much * (share / sum)).try_normalize(1e-6) {
                axes[k] = turned;
            }
        }
        true
    }
}

fn too_fast(pairs: &[Pair], touches: &[(usize, Touch)], axes: &[Vector3], rate: f64) -> Option<TooFast> {
    let share = |pair: &Pair| pair.apart(axes).norm() / pair.most.max(f64::MIN_POSITIVE);
    let found = pairs.iter().filter(|pair| share(pair) > 1.0 + SLACK);
    found.fold(None, |worst: Option<TooFast>, pair| {
        let (turn, place) = (share(pair) * rate, touches[pair.touch as usize].1.contact.point);
        Some(match worst {
            Some(so_far) if so_far.worst >= turn => TooFast { count: so_far.count + 1, ..so_far },
            so_far => TooFast { count: so_far.map_or(1, |s| s.count + 1), worst: turn, place },
        })
    })
}

/// Touches that follow each other on a pass.
fn in_passes(touches: &[(usize, Touch)], rate: f64) -> Vec<Pair> {
    let same = (1..touches.len()).filter(|&k| touches[k].0 == touches[k - 1].0);
    let pairs = same.map(|k| {
        let way = (touches[k].1.contact.point - touches[k - 1].1.contact.point).norm();
        Pair { touch: k as u32, between: [k as u32 - 1; 2], at: 0.0, most: rate * way.max(LEAST_WAY) }
    });
    pairs.collect()
}

/// Each touch with the nearest place of every pass beside it within so many mm.
fn beside(touches: &[(usize, Touch)], within: f64, rate: f64) -> Vec<Pair> {
    // The second touch of each stretch.
    let ends: Vec<usize> = (1..touches.len()).filter(|&k| touches[k].0 == touches[k - 1].0).collect();
    let stretch = |&k: &usize| ([k - 1, k].map(|k| touches[k].1.contact.point), touches[k].0 as u32);
    let stretches = PassStretches::new(ends.iter().map(stretch).collect());
    let found = work::parallel::map(touches.len(), |k| {
        let (own, touch) = &touches[k];
        let near = stretches.beside(&touch.contact.point, *own as u32, within);
        let pair = |one: motion::Beside| {
            let end = ends[one.stretch as usize] as u32;
            Pair {
                touch: k as u32,
                between: [end - 1, end],
                at: one.at,
                most: rate * one.distance.max(LEAST_WAY),
            }
        };
        near.into_iter().map(pair).collect::<Vec<_>>()
    });
    found.into_iter().flatten().collect()
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
        let left = even_out(&mut got, &cutter, rates(0.1), None, &Silent).unwrap();
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
        assert_eq!(even_out(&mut got, &cutter, rates(0.021), None, &Silent).unwrap(), None);
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
        let left = even_out(&mut got, &cutter, rates(0.02), Some(&one), &Silent).unwrap();
        assert!(is_clear(&one, &start) && is_clear(&one, &got));
        assert_eq!(left, None);
        assert_eq!(got[23], start[23], "held");
        assert!(got[0][0].at.axis.y < -0.1, "and the first comes to the last");
        // Both cannot be had between two walls.
        let start = passes(&cutter, |y| 0.45 * (11.5 - f64::from(y)) / 11.5);
        let mut got = start.clone();
        let left = even_out(&mut got, &cutter, rates(1e-3), Some(&both), &Silent).unwrap();
        assert!(is_clear(&both, &start) && is_clear(&both, &got));
        assert!(left.is_some_and(|left| left.worst > 1e-3 && left.count > 0), "{left:?}");
    }
}
