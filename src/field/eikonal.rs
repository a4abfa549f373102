//! Fronts that move over a surface: `speed(∇φ/|∇φ|) |∇_S φ| = 1`, φ = 0 on a start curve (a static
//! Hamilton–Jacobi equation, anisotropic since the speed depends on the direction across the front).
//!
//! Enters: the first fundamental form and the speed by direction at any place of a parameter rectangle; start
//! curves as polylines in parameters. Leaves: φ on an even grid. With the strip width as the speed φ counts
//! passes, and its levels 1 apart are passes that are everywhere exactly one strip apart.
//!
//! Method: fast sweeping over the four quadrants (Zhao 2005; Qian, Zhang & Zhao 2007 for anisotropic fronts),
//! where a front is taken from the two neighbours of a quadrant only if its energy comes out of that
//! quadrant; then sweeps with one-sided differences of second order, except across kinks (where fronts from
//! two sides meet), which the first solution shows. After some rounds each node keeps the quadrant that it
//! has, so that the sweeps settle. Second order where φ is smooth; first order in the circles that points and
//! ends of open start curves send out.
//!
//! # Limits
//! The front's polar diagram of slowness 1/speed must be convex for the solution to be unique: for a ball,
//! `(κ_cutter − κ_min) ≤ 2 (κ_cutter − κ_max)`. Beyond it fronts may have corners of their own; the interval
//! is still that which the speed says, except in the fans behind such corners, where it is smaller. Where
//! they break into corners without end the sweeps do not settle: most [`Front::convex`] fronts do, and all do
//! in first order.

mod front;
#[cfg(test)]
mod tests;

pub use front::Front;
pub(crate) use front::Window;

use super::GridField;
use work::monitor::{self, Cancelled, Monitor};

/// Rounds of four sweeps at most, for each of the two orders. Some ten are enough unless characteristics
/// wind.
const MOST_ROUNDS: usize = 60;

/// Sweeps end when no node changes by more than this share of the greatest φ. Rounding would keep less from
/// being reached.
const SETTLED: f64 = 1e-10;

/// A change of φ above this share of its greatest value in first order is no correction: the sweeps have gone
/// astray.
const ASTRAY: f64 = 0.5;

/// Rounds after which each node keeps its quadrant. Fewer may keep that of a poor first order, more settle
/// later.
const CHOOSING_ROUNDS: usize = 3;

/// A bend of φ over three nodes is taken for a kink above this share of its greatest change from node to
/// node. More would take differences across kinks, less those of first order where fronts are curved within
/// few nodes.
const KINK: f64 = 0.5;

/// Cells around a piece of a start curve whose nodes may have their nearest place on it. Fewer miss it where
/// parameters are skewed.
const AROUND: f64 = 2.0;

const QUADRANTS: [[f64; 2]; 4] = [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]];

/// Two sides of a signed front meet only on the start curve: elsewhere a neighbour of the other side whose φ
/// is further off than this many steps of the grid is across a cut of φ.
const ACROSS_THE_CURVE: f64 = 4.0;

/// Why no front could be moved.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum EikonalError {
    /// Stopped by the user.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// The grid is too small, or its range is empty.
    #[error("a grid of {0} x {1} nodes carries no front; at least 3 x 3 over a range that grows are needed")]
    Grid(usize, usize),
    /// No start curve comes near the domain.
    #[error("no start curve of the front lies in the domain")]
    NoStart,
    /// The surface has a metric nowhere, or the front moves nowhere.
    #[error("the surface is degenerate at every node of the grid, or no front can move there")]
    Degenerate,
}

/// Where a front starts.
#[derive(Debug, Clone, PartialEq)]
pub struct Start<'a> {
    /// Polylines in parameters; one of a single point is a point source. Points beyond the domain are
    /// allowed.
    pub curves: &'a [Vec<[f64; 2]>],
    /// φ is negative on the right of the curves (seen along them, with u to the right and v up). The curves
    /// should part the domain; where they end inside of it, φ jumps on a line from their end.
    pub signed: bool,
}

/// A front's arrival everywhere.
#[derive(Debug, Clone, PartialEq)]
pub struct Arrival {
    /// φ.
    pub field: GridField,
    /// Greatest change of φ in the last round of sweeps: what is left of the iteration's error. Infinite
    /// where the sweeps went astray.
    pub unsettled: f64,
    /// φ by differences of first order, which settles for every front.
    pub first_order: GridField,
}

/// Moves a front over a grid of `nodes = [nu, nv]` on `domain`. `front(u, v)` gives metric and speed there;
/// places where it gives none take those of the nearest node that has them.
///
/// # Errors
/// See [`EikonalError`].
///
/// # Tolerance
/// The discretisation error is of second order in the pitch, see above; that of the iteration is in the
/// answer.
pub fn eikonal(
    domain: [[f64; 2]; 2],
    nodes: [usize; 2],
    front: &(dyn Fn(f64, f64) -> Option<Front> + Sync),
    start: &Start<'_>,
    monitor: &dyn Monitor,
) -> Result<Arrival, EikonalError> {
    let [nu, nv] = nodes;
    let sound = domain.iter().all(|[lo, hi]| lo < hi && (hi - lo).is_finite());
    if nu < 3 || nv < 3 || !sound {
        return Err(EikonalError::Grid(nu, nv));
    }
    let pitch = [0, 1].map(|c| (domain[c][1] - domain[c][0]) / (nodes[c] - 1) as f64);
    let at = |i: usize, j: usize| [domain[0][0] + pitch[0] * i as f64, domain[1][0] + pitch[1] * j as f64];
    let fronts =
        work::parallel::map(nv, |j| (0..nu).map(|i| front(at(i, j)[0], at(i, j)[1])).collect::<Vec<_>>());
    let fronts = filled(fronts.into_iter().flatten().collect(), nu)?;
    let mut sweeper = Sweeper {
        origin: [domain[0][0], domain[1][0]],
        pitch,
        nodes,
        steepest: work::parallel::map(fronts.len(), |k| fronts[k].steepest()),
        fronts,
        value: vec![f64::INFINITY; nu * nv],
        first: Vec::new(),
        choice: vec![None; nu * nv],
        looked: Vec::new(),
        changed: Vec::new(),
        side: vec![0; nu * nv],
        fixed: vec![false; nu * nv],
    };
    sweeper.start(start, front);
    if !sweeper.fixed.contains(&true) {
        return Err(EikonalError::NoStart);
    }
    sweeper.settle(Order::First, monitor)?;
    sweeper.first = sweeper.value.clone();
    let unsettled = sweeper.settle(Order::Second, monitor)?;
    let on_grid = |values: &[f64]| {
        let values: Vec<f64> =
            values.iter().zip(&sweeper.side).map(|(v, &s)| v * f64::from(s.signum())).collect();
        let field = GridField::new(domain, [nu - 1, nv - 1], &values);
        field.filter(|_| values.iter().all(|v| v.is_finite())).ok_or(EikonalError::Degenerate)
    };
    Ok(Arrival { field: on_grid(&sweeper.value)?, unsettled, first_order: on_grid(&sweeper.first)? })
}

/// Gives nodes without a front that of the nearest node, by grid steps, that has one.
fn filled(mut fronts: Vec<Option<Front>>, nu: usize) -> Result<Vec<Front>, EikonalError> {
    let mut ring: Vec<usize> = (0..fronts.len()).filter(|&k| fronts[k].is_some()).collect();
    while !ring.is_empty() {
        let mut next = Vec::new();
        for k in ring {
            let (i, near) = (k % nu, [k.wrapping_sub(nu), k + nu]);
            let sides = [(i > 0).then(|| k - 1), (i + 1 < nu).then_some(k + 1)];
            for n in sides.into_iter().flatten().chain(near) {
                if n < fronts.len() && fronts[n].is_none() {
                    fronts[n] = fronts[k].clone();
                    next.push(n);
                }
            }
        }
        ring = next;
    }
    fronts.into_iter().collect::<Option<Vec<_>>>().ok_or(EikonalError::Degenerate)
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Order {
    First,
    Second,
}

/// Neighbours that a front comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum By {
    Both,
    U,
    V,
}

/// How a node is reached.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Choice {
    quadrant: u8,
    by: By,
}

struct Sweeper {
    origin: [f64; 2],
    pitch: [f64; 2],
    nodes: [usize; 2],
    fronts: Vec<Front>,
    /// [`Front::steepest`] of each.
    steepest: Vec<[f64; 2]>,
    /// |φ|.
    value: Vec<f64>,
    /// |φ| of the first order.
    first: Vec<f64>,
    /// By which neighbours a node is reached.
    choice: Vec<Option<Choice>>,
    /// Number of the sweep in which a node was last worked out, and in which it last changed.
    looked: Vec<u32>,
    changed: Vec<u32>,
    /// Sign of φ; 0 while not known.
    side: Vec<i8>,
    /// Next to a start curve.
    fixed: Vec<bool>,
}

impl Sweeper {
    /// Sets the nodes of all cells that start curves pass through.
    fn start(&mut self, start: &Start<'_>, front: &(dyn Fn(f64, f64) -> Option<Front> + Sync)) {
        // The nearest place of a curve, for each node near one.
        let mut near: std::collections::BTreeMap<usize, Nearest> = std::collections::BTreeMap::new();
        for curve in start.curves {
            let closed = curve.len() > 2 && curve.first() == curve.last();
            let last = curve.len().saturating_sub(2);
            let pieces = curve.windows(2).enumerate().map(|(k, w)| {
                let ends = [!closed && k == 0, !closed && k == last];
                (w[0], w[1], ends)
            });
            let point = curve.first().filter(|_| curve.len() == 1).map(|&p| (p, p, [true; 2]));
            for (a, b, ends) in pieces.chain(point) {
                self.near_piece(a, b, ends, front, &mut near);
            }
        }
        for (k, nearest) in near {
            if nearest.touches {
                self.value[k] = nearest.arrival;
                self.side[k] = if start.signed && nearest.right { -1 } else { 1 };
                self.fixed[k] = true;
            }
        }
    }

    /// Notes for the nodes around a piece of a curve how it reaches them.
    fn near_piece(
        &self,
        a: [f64; 2],
        b: [f64; 2],
        ends: [bool; 2],
        front: &(dyn Fn(f64, f64) -> Option<Front> + Sync),
        near: &mut std::collections::BTreeMap<usize, Nearest>,
    ) {
        if !a.iter().chain(&b).all(|x| x.is_finite()) {
            return;
        }
        let cell = |p: [f64; 2]| [0, 1].map(|c| (p[c] - self.origin[c]) / self.pitch[c]);
        let (ca, cb) = (cell(a), cell(b));
        // Parts no longer than a cell, so that the cells around each are few.
        let longest = (cb[0] - ca[0]).abs().max((cb[1] - ca[1]).abs());
        let parts = longest.ceil().clamp(1.0, 1e6) as usize;
        let part = |s: f64| [a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1])];
        for k in 0..parts {
            let [s0, s1] = [k, k + 1].map(|k| k as f64 / parts as f64);
            let (p, q) = (part(s0), part(s1));
            let (cp, cq) = (cell(p), cell(q));
            // Nodes of the cells that the part touches, also those on the two sides of a line of the grid,
            // and more around, whose nearest place it may hold.
            let range = |c: usize, more: f64| {
                let lo = (cp[c].min(cq[c]) - 1e-9).floor() - more;
                let hi = (cp[c].max(cq[c]) + 1e-9).ceil() + more;
                [lo.max(0.0), hi.min((self.nodes[c] - 1) as f64)]
            };
            let (inner, outer) = ([range(0, 0.0), range(1, 0.0)], [range(0, AROUND), range(1, AROUND)]);
            if outer.iter().any(|[lo, hi]| lo > hi) {
                continue;
            }
            for j in outer[1][0] as usize..=outer[1][1] as usize {
                for i in outer[0][0] as usize..=outer[0][1] as usize {
                    let holds = |c: usize, x: usize| inner[c][0] <= x as f64 && x as f64 <= inner[c][1];
                    let touches = holds(0, i) && holds(1, j);
                    let ends = [ends[0] && k == 0, ends[1] && k + 1 == parts];
                    let found = self.nearest(j * self.nodes[0] + i, p, q, ends, front);
                    let entry = near.entry(j * self.nodes[0] + i).or_insert(Nearest { touches, ..found });
                    let touched = entry.touches || touches;
                    if found.distance < entry.distance {
                        *entry = found;
                    }
                    entry.touches = touched;
                }
            }
        }
    }

    /// How the part from `p` to `q` reaches node `k`; `ends` says which of its ends are ends of the whole
    /// curve.
    fn nearest(
        &self,
        k: usize,
        p: [f64; 2],
        q: [f64; 2],
        ends: [bool; 2],
        front: &(dyn Fn(f64, f64) -> Option<Front> + Sync),
    ) -> Nearest {
        let node = self.place(k);
        let here = &self.fronts[k];
        let minus = |a: [f64; 2], b: [f64; 2]| [a[0] - b[0], a[1] - b[1]];
        let (d, w) = (minus(q, p), minus(node, p));
        let length2 = here.dot(d, d);
        let free = if length2 > 0.0 { here.dot(w, d) / length2 } else { 0.0 };
        let t = free.clamp(0.0, 1.0);
        let foot = [p[0] + t * d[0], p[1] + t * d[1]];
        let across = minus(node, foot);
        // Metric and speed halfway make the arrival exact to second order.
        let between = front(0.5 * (node[0] + foot[0]), 0.5 * (node[1] + foot[1]));
        let between = between.as_ref().unwrap_or(here);
        let beyond = (free < 0.0 && ends[0]) || (free > 1.0 && ends[1]) || length2 == 0.0;
        let arrival = if beyond { between.latest(across) } else { between.plane(across) };
        let distance = here.dot(across, across);
        Nearest { distance, arrival, right: d[0] * w[1] - d[1] * w[0] < 0.0, touches: false }
    }

    fn place(&self, k: usize) -> [f64; 2] {
        let at = [k % self.nodes[0], k / self.nodes[0]];
        [0, 1].map(|c| self.origin[c] + self.pitch[c] * at[c] as f64)
    }

    /// Sweeps until nothing changes; returns the greatest change of the last round. In the first order values
    /// only fall.
    fn settle(&mut self, order: Order, monitor: &dyn Monitor) -> Result<f64, Cancelled> {
        let mut change = 0.0;
        // When a node was last looked at and last changed, in sweeps: a node whose neighbours stand still is
        // passed over.
        self.looked = vec![0; self.value.len()];
        self.changed = vec![1; self.value.len()];
        let mut sweep = 1;
        let first = self.first.iter().copied().filter(|v| v.is_finite()).fold(0.0, f64::max);
        for round in 0..MOST_ROUNDS {
            change = 0.0;
            for quadrant in 0..QUADRANTS.len() {
                monitor::check(monitor)?;
                sweep += 1;
                change = self.sweep(quadrant, order, round < CHOOSING_ROUNDS, sweep).max(change);
            }
            if order == Order::Second && round + 1 == CHOOSING_ROUNDS {
                self.looked.fill(0);
            }
            let greatest = self.value.iter().copied().filter(|v| v.is_finite()).fold(0.0, f64::max);
            if order == Order::Second && change > ASTRAY * first {
                return Ok(f64::INFINITY);
            }
            if change <= SETTLED * greatest && (order == Order::First || round >= CHOOSING_ROUNDS) {
                break;
            }
        }
        Ok(change)
    }

    fn sweep(&mut self, quadrant: usize, order: Order, choosing: bool, sweep: u32) -> f64 {
        let [nu, nv] = self.nodes;
        let toward = QUADRANTS[quadrant];
        let at = |n: usize, k: usize, forward: bool| if forward { k } else { n - 1 - k };
        let mut change = 0.0f64;
        for b in 0..nv {
            let j = at(nv, b, toward[1] > 0.0);
            for a in 0..nu {
                let k = j * nu + at(nu, a, toward[0] > 0.0);
                let chosen = if choosing || order == Order::First { None } else { self.choice[k] };
                let other_way = chosen.is_some_and(|c| usize::from(c.quadrant) != quadrant);
                if self.fixed[k] || other_way || self.stands_still(k, order, toward) {
                    continue;
                }
                let old = self.value[k];
                let new = match order {
                    Order::First => {
                        let (new, side) = self.first_order(k, toward);
                        if new < old {
                            self.side[k] = side;
                        }
                        new.min(old)
                    }
                    Order::Second => {
                        self.looked[k] = sweep;
                        let (new, choice) = self.second_order(k, chosen);
                        if choosing {
                            self.choice[k] = choice;
                        }
                        new
                    }
                };
                if new.is_finite() && new != old {
                    let step = if old.is_finite() { (new - old).abs() } else { f64::INFINITY };
                    change = change.max(step);
                    self.value[k] = new;
                    self.changed[k] = sweep;
                }
            }
        }
        change
    }

    /// True when nothing that the node depends on has changed since it was looked at.
    fn stands_still(&self, k: usize, order: Order, toward: [f64; 2]) -> bool {
        let newer = |n: Option<usize>| n.is_some_and(|n| self.changed[n] >= self.looked[k]);
        match order {
            // Another quadrant is asked in each sweep, and the same one after four.
            Order::First => {
                let unknown = |n: Option<usize>| n.is_none_or(|n| !self.value[n].is_finite());
                (0..2).all(|c| unknown(self.behind(k, c, toward[c], 1)))
            }
            Order::Second => {
                !(0..2).any(|c| [-2, -1, 1, 2].iter().any(|&d| newer(self.behind(k, c, 1.0, d))))
            }
        }
    }

    /// The node `steps` behind `k` along an axis, seen by a front that moves `toward` its end.
    fn behind(&self, k: usize, axis: usize, toward: f64, steps: isize) -> Option<usize> {
        let at = if axis == 0 { k % self.nodes[0] } else { k / self.nodes[0] } as isize;
        let to = at - steps * toward as isize;
        let stride = if axis == 0 { 1 } else { self.nodes[0] as isize };
        (to >= 0 && to < self.nodes[axis] as isize).then(|| (k as isize + (to - at) * stride) as usize)
    }

    /// Arrival from the two neighbours of one quadrant, and the side it comes from.
    fn first_order(&self, k: usize, toward: [f64; 2]) -> (f64, i8) {
        let near = [0, 1].map(|c| self.behind(k, c, toward[c], 1));
        let value = near.map(|n| n.map_or(f64::INFINITY, |n| self.value[n]));
        let side = near.map(|n| n.map_or(0, |n| self.side[n]));
        let earlier = usize::from(value[1] < value[0]);
        let both = side[0] == side[1] || !(value[0].is_finite() && value[1].is_finite());
        let known = if both {
            value
        } else {
            // Fronts from two sides of the start do not add up.
            [0, 1].map(|c| if c == earlier { value[c] } else { f64::INFINITY })
        };
        (self.fronts[k].arrival(self.steepest[k], self.pitch, toward, known), side[earlier])
    }

    /// Arrival by one-sided differences of second order, and the choice (quadrant and neighbours) that it is
    /// by: the smallest of all choices, or that of the choice given.
    fn second_order(&self, k: usize, chosen: Option<Choice>) -> (f64, Option<Choice>) {
        let mut best = (f64::INFINITY, None);
        for (quadrant, toward) in QUADRANTS.into_iter().enumerate() {
            if chosen.is_some_and(|c| usize::from(c.quadrant) != quadrant) {
                continue;
            }
            let known = [0, 1].map(|c| self.one_sided(k, c, toward[c]));
            let (values, pitch) = (known.map(|(value, _)| value), known.map(|(_, pitch)| pitch));
            for by in [By::Both, By::U, By::V].into_iter().filter(|by| chosen.is_none_or(|c| c.by == *by)) {
                let value = match by {
                    By::Both => self.fronts[k].through_both(pitch, toward, values, chosen.is_none()),
                    By::U => Some(values[0] + pitch[0] * self.steepest[k][0]),
                    By::V => Some(values[1] + pitch[1] * self.steepest[k][1]),
                };
                if let Some(value) = value.filter(|value| *value < best.0) {
                    best = (value, Some(Choice { quadrant: quadrant as u8, by }));
                }
            }
        }
        best
    }

    /// The value and the distance of a neighbour whose plain difference is the one-sided difference of second
    /// order; of the neighbour itself where a kink or the border is near.
    fn one_sided(&self, k: usize, axis: usize, toward: f64) -> (f64, f64) {
        let (here, pitch) = (self.first[k], self.pitch[axis]);
        let close = pitch * self.steepest[k][axis];
        let seen = |steps: isize, values: &[f64]| {
            let n = self.behind(k, axis, toward, steps)?;
            let value = values[n];
            if self.side[n] == self.side[k] {
                Some(value).filter(|v| v.is_finite())
            } else {
                (here + self.first[n] < ACROSS_THE_CURVE * close).then_some(-value)
            }
        };
        let Some(before) = seen(1, &self.value) else { return (f64::INFINITY, pitch) };
        let bend = || Some(here - 2.0 * seen(1, &self.first)? + seen(2, &self.first)?);
        match (bend(), seen(2, &self.value)) {
            (Some(bend), Some(far)) if bend.abs() <= KINK * close => {
                ((4.0 * before - far) / 3.0, 2.0 * pitch / 3.0)
            }
            _ => (before, pitch),
        }
    }
}

/// How a start curve reaches a node.
#[derive(Debug, Clone, Copy)]
struct Nearest {
    /// Square of its distance, mm².
    distance: f64,
    arrival: f64,
    /// The node lies on the right of the curve.
    right: bool,
    /// It is a corner of a cell that the curve passes through.
    touches: bool,
}
