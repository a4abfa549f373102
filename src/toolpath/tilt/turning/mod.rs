//! Axes that turn no faster than asked, along passes and from pass to pass.
//!
//! Enters: passes as touches of the cutter, and the greatest turn, rad a mm of contact. Leaves: the same
//! contacts with axes that hold it, near to those that came; where nothing turns too fast they stay as they
//! are.
//!
//! Limits are held first, without a look at what the tool must keep clear of ([`draw`]). Where it is not
//! clear then, axes are held at the nearest one that is, and their neighbours come to them. Where limits
//! cannot be held so, all lean towards one, as little as it takes; axes all around are tried for that. A
//! constant axis that is clear everywhere is always found, unless all such axes lie within [`SPHERE`] of each
//! other. Where nothing is clear, what turns too fast is noted.

mod draw;
mod graph;

use super::repair::{Room, nearest_clear};
use super::tilted::ABOVE_SURFACE;
use crate::moves::touch::Touch;
use cutter::Cutter;
use draw::{drawn, leant};
use geometry::{Point3, Vector3};
use graph::{Graph, Pair};
use std::f64::consts::PI;
use work::monitor::{self, Cancelled, Monitor};

pub(crate) use graph::{LOST, TurningRates};

/// Rounds in which axes that are not clear are held. Each holds more; what the last one leaves stays where it
/// was.
const ROUNDS: usize = 6;

/// A pair turns too fast when it does by more than this share: below are rounding and what moves take up.
const SLACK: f64 = 1e-3;

/// Shares of the way to one axis for all.
const LEANS: usize = 8;

/// Axes that all may lean to are so far apart, rad: a clear cone of half that times √2, 4 degrees, holds one.
/// Where only smaller ranges are clear none may be found.
const SPHERE: f64 = 0.1;

/// Steps towards the middle of all normals, which is off by the inverse of that, rad.
const MIDDLES: usize = 100;

/// Pairs that still turn too fast.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct TooFast {
    /// How many.
    pub count: usize,
    /// The fastest, times what is allowed, and where.
    pub worst: f64,
    pub place: Point3,
}

impl TooFast {
    /// In words.
    pub fn note(&self) -> String {
        let Self { count, worst, place: p } = self;
        format!(
            "At {count} contacts the axis turns faster than asked, by up to {worst:.2} times at ({:.3}, {:.3}, {:.3}): no \
             slower axes that keep the tool clear were found. Allow more `turning` or `turning_across`, or lean the tool otherwise",
            p.x, p.y, p.z
        )
    }

    /// Of two lots.
    pub fn and(self, other: Self) -> Self {
        let worse = if other.worst > self.worst { other } else { self };
        Self { count: self.count + other.count, ..worse }
    }
}

/// Evens out the axes of passes. What the tool must keep away from may leave some that turn too fast
/// ([`too_fast`]).
///
/// # Errors
/// [`Cancelled`] when the monitor says so.
pub(crate) fn even_out(
    passes: &mut [Vec<Touch>],
    cutter: &Cutter,
    rates: TurningRates,
    room: Option<Room<'_>>,
    monitor: &dyn Monitor,
) -> Result<(), Cancelled> {
    // Without limits from pass to pass each pass is evened out alone.
    let lot = if rates.across.is_some() { passes.len() } else { 1 };
    let lots: Vec<&[Vec<Touch>]> = passes.chunks(lot.max(1)).collect();
    let found = work::parallel::try_map(lots.len(), |k| {
        let touches = with_passes(lots[k]);
        let graph = Graph::of(&touches, rates, 2.0 * cutter.radius());
        Evening::new(touches, graph, cutter, room).run(monitor)
    })?;
    let all = passes.iter_mut().flatten().zip(found.into_iter().flatten());
    all.for_each(|(touch, evened)| *touch = evened);
    Ok(())
}

/// What turns too fast in passes.
pub(crate) fn too_fast(passes: &[Vec<Touch>], cutter: &Cutter, rates: TurningRates) -> Option<TooFast> {
    let touches = with_passes(passes);
    let graph = Graph::of(&touches, rates, 2.0 * cutter.radius());
    let axes: Vec<Vector3> = graph.touches.iter().map(|its| touches[its.start].1.at.axis).collect();
    among(&graph.pairs(0), &axes, &graph, &touches)
}

fn with_passes(passes: &[Vec<Touch>]) -> Vec<(usize, Touch)> {
    passes.iter().enumerate().flat_map(|(k, pass)| pass.iter().map(move |touch| (k, *touch))).collect()
}

/// The direction whose greatest angle to all normals is about the least (M. Badoiu and K. L. Clarkson,
/// "Smaller core-sets for balls", 2003).
fn above_all(normals: &[Vector3]) -> Option<Vector3> {
    let mut middle = *normals.first()?;
    for k in 1..MIDDLES {
        let farthest = normals.iter().min_by(|a, b| a.dot(&middle).total_cmp(&b.dot(&middle)))?;
        middle = (middle + (farthest - middle) / (k + 1) as f64).try_normalize(1e-6)?;
    }
    Some(middle)
}

/// Directions all around, about [`SPHERE`] rad apart, on a spiral of the golden angle.
fn sphere() -> impl Iterator<Item = Vector3> {
    let count = (4.0 * PI / (SPHERE * SPHERE)).ceil() as usize;
    let golden = PI * (3.0 - 5f64.sqrt());
    (0..count).map(move |k| {
        let z = 1.0 - (2 * k + 1) as f64 / count as f64;
        let (sin, cos) = (golden * k as f64).sin_cos();
        let level = (1.0 - z * z).sqrt();
        Vector3::new(level * cos, level * sin, z)
    })
}

/// Many that may refuse what is tried. Those that did last are asked first: most tries are refused by few of
/// them.
struct Refusals(Vec<u32>);

impl Refusals {
    fn of(count: usize) -> Self {
        Self((0..count as u32).collect())
    }

    fn any(&mut self, refuses: impl Fn(usize) -> bool) -> bool {
        let found = self.0.iter().position(|&k| refuses(k as usize));
        found.is_some_and(|at| {
            self.0[..=at].rotate_right(1);
            true
        })
    }
}

/// The pairs that turn too fast.
fn among(pairs: &[Pair], axes: &[Vector3], graph: &Graph, touches: &[(usize, Touch)]) -> Option<TooFast> {
    let one = |pair: &Pair| {
        let (angle, most) = (pair.angle(axes), pair.most * (1.0 + SLACK) + draw::EXACT);
        let place = touches[graph.touches[pair.node as usize].start].1.contact.point;
        (angle > most).then(|| TooFast { count: 1, worst: angle / pair.most.max(draw::EXACT), place })
    };
    pairs.iter().filter_map(one).reduce(TooFast::and)
}

struct Evening<'a> {
    /// With their passes.
    touches: Vec<(usize, Touch)>,
    graph: Graph,
    cutter: &'a Cutter,
    room: Option<Room<'a>>,
    /// Touches at which the tool has nothing to spare as they came, and need have none.
    tight: Vec<bool>,
}

impl<'a> Evening<'a> {
    fn new(touches: Vec<(usize, Touch)>, graph: Graph, cutter: &'a Cutter, room: Option<Room<'a>>) -> Self {
        let is_tight = |k: usize| room.is_some_and(|room| !room.holds_as_it_is(&touches[k].1));
        let tight = work::parallel::map(touches.len(), is_tight);
        Self { touches, graph, cutter, room, tight }
    }

    fn run(&self, monitor: &dyn Monitor) -> Result<Vec<Touch>, Cancelled> {
        let start: Vec<Vector3> =
            self.graph.touches.iter().map(|its| self.touches[its.start].1.at.axis).collect();
        let mut axes = self.clear_axes(&start, monitor)?;
        let pairs = self.graph.pairs(0);
        if let Some(left) = self.too_fast(&pairs, &axes) {
            if let Some(one) = self.towards_one(&pairs, &axes, monitor)? {
                axes = one;
            } else if self.too_fast(&pairs, &start).is_some_and(|before| before.worst < left.worst) {
                axes = start;
            }
        }
        let mut touches: Vec<Touch> = self.touches.iter().map(|(_, touch)| *touch).collect();
        for (its, axis) in self.graph.touches.iter().zip(&axes) {
            for touch in &mut touches[its.clone()] {
                if touch.at.axis != *axis {
                    *touch = self.turned(touch, *axis);
                }
            }
        }
        Ok(touches)
    }

    fn turned(&self, touch: &Touch, axis: Vector3) -> Touch {
        Touch::along(axis, self.cutter, touch.contact, touch.feed)
    }

    /// Whether the tool is clear at all touches of a node, with something to spare for the moves between
    /// them.
    fn is_clear(&self, node: usize, axis: Vector3) -> bool {
        self.graph.touches[node].clone().all(|k| {
            let touch = &self.touches[k].1;
            axis == touch.at.axis
                || self.room.map_or(axis.dot(&touch.contact.normal) > ABOVE_SURFACE, |room| {
                    let room = if self.tight[k] { Room { firm: false, ..room } } else { room };
                    room.holds(&touch.contact, &axis, !self.tight[k])
                })
        })
    }

    /// Clear axes that hold the limits as far as those do that had to be held.
    fn clear_axes(&self, start: &[Vector3], monitor: &dyn Monitor) -> Result<Vec<Vector3>, Cancelled> {
        let (mut wanted, mut held) = (start.to_vec(), vec![false; start.len()]);
        for _ in 1..ROUNDS {
            let axes = drawn(&self.graph, &wanted, &held, monitor)?;
            let instead = work::parallel::try_map(axes.len(), |k| {
                monitor::check(monitor)?;
                let clear = held[k] || self.is_clear(k, axes[k]);
                Ok::<_, Cancelled>((!clear).then(|| self.nearest(k, axes[k], start[k])))
            })?;
            if instead.iter().all(Option::is_none) {
                return Ok(axes);
            }
            for (k, axis) in instead.into_iter().enumerate().filter_map(|(k, axis)| Some((k, axis?))) {
                (wanted[k], held[k]) = (axis, true);
            }
        }
        let mut axes = drawn(&self.graph, &wanted, &held, monitor)?;
        let clear = work::parallel::map(axes.len(), |k| held[k] || self.is_clear(k, axes[k]));
        for k in (0..axes.len()).filter(|&k| !clear[k]) {
            axes[k] = start[k];
        }
        Ok(axes)
    }

    /// The clear axis nearest to a wanted one, or that at the start.
    fn nearest(&self, node: usize, wanted: Vector3, start: Vector3) -> Vector3 {
        let touch = self.turned(&self.touches[self.graph.touches[node].start].1, wanted);
        let found = self.room.and_then(|room| nearest_clear(&touch, room));
        let nearer = |axis: &Vector3| axis.dot(&wanted) > start.dot(&wanted) && self.is_clear(node, *axis);
        found.filter(nearer).unwrap_or(start)
    }

    /// Axes that lean towards one and the same, as little as it takes to hold the limits, where the tool is
    /// clear so. Leaning all the way is the constant axis. They lean from what was found, or from the
    /// normals, whose turns are those of the part.
    fn towards_one(
        &self,
        pairs: &[Pair],
        axes: &[Vector3],
        monitor: &dyn Monitor,
    ) -> Result<Option<Vec<Vector3>>, Cancelled> {
        let normals: Vec<Vector3> =
            self.graph.touches.iter().map(|its| self.touches[its.start].1.contact.normal).collect();
        let all = self.touches.iter().map(|(_, touch)| touch.contact.normal).collect::<Vec<_>>();
        let (Some(middle), Some(mean)) = (above_all(&all), axes.iter().sum::<Vector3>().try_normalize(1e-6))
        else {
            return Ok(None);
        };
        let mut ones: Vec<Vector3> = sphere().filter(|one| one.dot(&middle) > ABOVE_SURFACE).collect();
        ones.extend([mean, middle]);
        ones.sort_by(|a, b| b.dot(&mean).total_cmp(&a.dot(&mean)));
        let (mut fast, mut near) = (Refusals::of(pairs.len()), Refusals::of(axes.len()));
        for lean in 1..=LEANS {
            let share = lean as f64 / LEANS as f64;
            for one in &ones {
                monitor::check(monitor)?;
                for base in [axes, &normals] {
                    let leaning = |k: usize| leant(base[k], *one, share);
                    let turns = |pair: &Pair| pair.angle_of(leaning) > pair.most;
                    let refused =
                        fast.any(|k| turns(&pairs[k])) || near.any(|k| !self.is_clear(k, leaning(k)));
                    if !refused {
                        return Ok(Some((0..base.len()).map(leaning).collect()));
                    }
                }
            }
        }
        Ok(None)
    }

    fn too_fast(&self, pairs: &[Pair], axes: &[Vector3]) -> Option<TooFast> {
        among(pairs, axes, &self.graph, &self.touches)
    }
}

#[cfg(test)]
mod tests;
