//! Stream functions whose level curves, one apart, lie nowhere farther from each other than they may and are shortest
//! in all: spacing and direction as one problem.
//!
//! Enters: at sites all over a surface the slowness `s` (1/mm) that a direction across the passes asks for (one over the
//! greatest distance of passes), and what a mm of pass costs in that direction. Leaves: the coefficients of ψ that
//! minimise
//!
//! ```text
//! ∫ c(θ) |∇ψ| dA    with    |∇ψ| >= s(θ),    θ the direction of ∇ψ.
//! ```
//!
//! Passes are packed where `|∇ψ| = s`. A front has that everywhere (see [`super::eikonal`]) and pays for it by kinks and by
//! the directions that its start leaves; here a little of the distance is given up where better directions are worth more.
//!
//! Method: a shortfall `x = (s/|∇ψ| − 1)₊` counts as `c |∇ψ| (1 + x + ρ x²)` (as if the passes were as dense as they must be,
//! and a penalty); ρ grows in rounds, each minimised by L-BFGS (Nocedal 1980), preconditioned by the equations of
//! `∫ |∇ψ|²`, so that the number of steps hardly depends on the grid. ψ may be any function that is linear in its
//! coefficients: [`Gradients`] says how its gradient follows from them.
//!
//! # Limits
//! A local minimum: [`minimise`] is called from several starts. Sites see what lies between them by their area only.

use super::eikonal::Front;
use super::solve::{Columns, Factor};
use crate::monitor::{self, Cancelled, Monitor};
use crate::parallel;

/// ρ of each round. The last leaves shortfalls of about a thousandth.
const PENALTIES: [f64; 4] = [3.0, 30.0, 300.0, 3000.0];

/// Steps of a round at most, and the relative gain below which it ends.
const MOST_STEPS: usize = 150;
const SETTLED: f64 = 1e-7;

/// Steps that L-BFGS remembers.
const MEMORY: usize = 12;

/// A step must gain this share of what its slope promises (Armijo's rule).
const LEAST_GAIN: f64 = 1e-4;

/// Halvings of a step before a round ends.
const MOST_HALVINGS: usize = 30;

/// No pass costs less than this share of the mean: where the cutter hardly moves, ψ would else be without direction.
const LEAST_COST: f64 = 0.02;

/// A shortfall above this doubles the passes: they are put between others.
const DOUBLED: f64 = 0.02;

/// What passes may do at one place, and what they cost there.
#[derive(Debug, Clone)]
pub struct Site {
    /// Its surface area, mm².
    pub area: f64,
    /// The slowness by direction across the passes.
    pub front: Front,
    /// Cost of a mm of pass, `[m, c, s]` of `m + c cos 2θ + s sin 2θ`, θ the direction across it in the frame of `front`.
    pub cost: [f64; 3],
}

/// How the gradients of a function at sites follow from its coefficients.
#[derive(Debug, Clone)]
pub struct Gradients {
    starts: Vec<u32>,
    /// Coefficient, and its share of both components in the site's orthonormal frame.
    terms: Vec<(u32, [f64; 2])>,
    coefficients: usize,
}

impl Gradients {
    /// For functions of so many coefficients; no sites yet.
    pub fn new(coefficients: usize) -> Self {
        Self { starts: vec![0], terms: Vec::new(), coefficients }
    }

    /// Adds a site: coefficients, each below the number given, with their shares of the derivatives by the two
    /// parameters.
    pub fn push(&mut self, site: &Site, terms: impl Iterator<Item = (u32, [f64; 2])>) {
        self.terms.extend(terms.map(|(k, derivatives)| (k, site.front.covector(derivatives))));
        self.starts.push(self.terms.len() as u32);
    }

    fn of(&self, site: usize) -> &[(u32, [f64; 2])] {
        &self.terms[self.starts[site] as usize..self.starts[site + 1] as usize]
    }

    fn at(&self, site: usize, x: &[f64]) -> [f64; 2] {
        let mut q = [0.0; 2];
        for &(k, share) in self.of(site) {
            q[0] += share[0] * x[k as usize];
            q[1] += share[1] * x[k as usize];
        }
        q
    }
}

/// A minimum.
#[derive(Debug, Clone, PartialEq)]
pub struct Packed {
    /// Coefficients of ψ; the first one is that of the start.
    pub coefficients: Vec<f64>,
    /// Cost of all passes one apart (`∫ c |∇ψ| dA`), twice where they would be too far apart.
    pub cost: f64,
    /// Share of the cost where they would.
    pub short: f64,
}

/// Minimises from `start`. With `refined`, the start is a minimum of a coarser function already, and the first rounds are
/// left out.
///
/// # Errors
/// [`Cancelled`] when the monitor says so; `Ok(None)` where sites do not determine the function.
pub fn minimise(
    sites: &[Site],
    gradients: &Gradients,
    start: Vec<f64>,
    refined: bool,
    monitor: &dyn Monitor,
) -> Result<Option<Packed>, Cancelled> {
    let problem = Problem { sites, gradients };
    let Some(factor) = problem.stiffness().filter(|_| start.len() == gradients.coefficients) else { return Ok(None) };
    let mut x = start;
    for &penalty in &PENALTIES[if refined { PENALTIES.len() - 2 } else { 0 }..] {
        problem.descend(&factor, penalty, &mut x, monitor)?;
    }
    let (mut cost, mut short) = (0.0, 0.0);
    for (k, site) in sites.iter().enumerate() {
        let q = gradients.at(k, &x);
        let (length, shortfall) = site.length_and_shortfall(q);
        let doubled = shortfall > DOUBLED;
        cost += if doubled { 2.0 * length } else { length };
        short += if doubled { length } else { 0.0 };
    }
    let sound = cost.is_finite() && x.iter().all(|x| x.is_finite());
    Ok(sound.then(|| Packed { coefficients: x, cost, short: short / cost }))
}

impl Site {
    /// Cost for each unit of length in the direction of `q`, and its derivative by the angle.
    fn cost_at(&self, [q1, q2]: [f64; 2], norm2: f64) -> (f64, f64) {
        let [mean, cosine, sine] = self.cost;
        let (cos, sin) = ((q1 * q1 - q2 * q2) / norm2, 2.0 * q1 * q2 / norm2);
        let cost = mean + cosine * cos + sine * sin;
        let least = LEAST_COST * mean.abs();
        if cost > least { (cost, 2.0 * (sine * cos - cosine * sin)) } else { (least, 0.0) }
    }

    fn length_and_shortfall(&self, q: [f64; 2]) -> (f64, f64) {
        let norm2 = (q[0] * q[0] + q[1] * q[1]).max(f64::MIN_POSITIVE);
        let (cost, _) = self.cost_at(q, norm2);
        let (square, _) = self.front.square(q);
        (self.area * cost * norm2.sqrt(), (square.max(0.0) / norm2).sqrt() - 1.0)
    }

    /// What a gradient costs with the penalty, and the derivatives of that by its components.
    fn charge(&self, q: [f64; 2], penalty: f64) -> (f64, [f64; 2]) {
        let norm2 = (q[0] * q[0] + q[1] * q[1]).max(f64::MIN_POSITIVE);
        let norm = norm2.sqrt();
        let (cost, cost_turn) = self.cost_at(q, norm2);
        let (square, square_turn) = self.front.square(q);
        let slow = square.max(f64::MIN_POSITIVE).sqrt();
        let short = slow / norm - 1.0;
        // By the length of q and by its angle.
        let (value, by_norm, by_angle) = if short <= 0.0 {
            (cost * norm, cost, cost_turn * norm)
        } else {
            let slow_turn = 0.5 * square_turn / slow;
            let dear = slow + penalty * norm * short * short;
            let by_norm = cost * penalty * short * (short - 2.0 * slow / norm);
            (cost * dear, by_norm, cost_turn * dear + cost * slow_turn * (1.0 + 2.0 * penalty * short))
        };
        let unit = [q[0] / norm, q[1] / norm];
        let turn = by_angle / norm;
        let by = [by_norm * unit[0] - turn * unit[1], by_norm * unit[1] + turn * unit[0]];
        (self.area * value, by.map(|b| self.area * b))
    }
}

struct Problem<'a> {
    sites: &'a [Site],
    gradients: &'a Gradients,
}

/// Sites that one worker looks at.
const SITES_A_PIECE: usize = 2048;

impl Problem<'_> {
    /// What ψ costs, and the derivatives of that by its coefficients.
    fn charge(&self, x: &[f64], penalty: f64, by: &mut [f64]) -> f64 {
        let pieces = parallel::map(self.sites.len().div_ceil(SITES_A_PIECE), |piece| {
            let first = piece * SITES_A_PIECE;
            let sites = &self.sites[first..(first + SITES_A_PIECE).min(self.sites.len())];
            let charge = |(k, site): (usize, &Site)| site.charge(self.gradients.at(first + k, x), penalty);
            sites.iter().enumerate().map(charge).collect::<Vec<_>>()
        });
        by.fill(0.0);
        let mut sum = 0.0;
        for (site, (value, slope)) in pieces.into_iter().flatten().enumerate() {
            sum += value;
            for &(k, share) in self.gradients.of(site) {
                by[k as usize] += slope[0] * share[0] + slope[1] * share[1];
            }
        }
        sum
    }

    /// The factor of the equations of `∫ s²-weighted |∇ψ|²`, the first coefficient held: about the second derivatives
    /// of the cost.
    fn stiffness(&self) -> Option<Factor> {
        let n = self.gradients.coefficients;
        let mut entries: Vec<(u32, u32, f64)> = Vec::new();
        for (k, site) in self.sites.iter().enumerate() {
            let weight = site.area * site.cost[0].abs() / site.front.mean_slowness();
            for &(a, ga) in self.gradients.of(k) {
                for &(b, gb) in self.gradients.of(k) {
                    if a >= b && b > 0 {
                        entries.push((b - 1, a - 1, weight * (ga[0] * gb[0] + ga[1] * gb[1])));
                    }
                }
            }
        }
        Factor::new(Columns::summed(n.checked_sub(1)?, entries), n - 1)
    }

    /// Lowers the cost until nothing is left to gain.
    fn descend(
        &self,
        factor: &Factor,
        penalty: f64,
        x: &mut Vec<f64>,
        monitor: &dyn Monitor,
    ) -> Result<(), Cancelled> {
        let n = x.len();
        let mut slope = vec![0.0; n];
        let mut value = self.charge(x, penalty, &mut slope);
        // Steps and changes of the slope.
        let mut memory: std::collections::VecDeque<[Vec<f64>; 2]> = std::collections::VecDeque::new();
        for _ in 0..MOST_STEPS {
            monitor::check(monitor)?;
            let mut direction: Vec<f64> = slope.iter().map(|g| -g).collect();
            let mut shares = Vec::with_capacity(memory.len());
            for [step, change] in memory.iter().rev() {
                let share = dot(step, &direction) / dot(step, change);
                add(&mut direction, change, -share);
                shares.push(share);
            }
            factor.solve(&mut direction[1..]);
            direction[0] = 0.0;
            if let Some([step, change]) = memory.back() {
                // The length of the last step along its change, as the preconditioner sees it.
                let mut seen = change.clone();
                factor.solve(&mut seen[1..]);
                seen[0] = 0.0;
                let scale = dot(step, change) / dot(change, &seen);
                direction.iter_mut().for_each(|d| *d *= scale);
            }
            for ([step, change], share) in memory.iter().zip(shares.iter().rev()) {
                let back = dot(change, &direction) / dot(step, change);
                add(&mut direction, step, share - back);
            }
            let promised = dot(&direction, &slope);
            if promised.is_nan() || promised >= 0.0 {
                if memory.is_empty() {
                    return Ok(());
                }
                memory.clear();
                continue;
            }
            let mut by = vec![0.0; n];
            let mut size = 1.0;
            let mut found = None;
            for _ in 0..MOST_HALVINGS {
                let mut to = x.clone();
                add(&mut to, &direction, size);
                let there = self.charge(&to, penalty, &mut by);
                if there <= value + LEAST_GAIN * size * promised {
                    found = Some((to, there));
                    break;
                }
                size *= 0.5;
            }
            let Some((to, there)) = found else { return Ok(()) };
            let step: Vec<f64> = to.iter().zip(&*x).map(|(a, b)| a - b).collect();
            let change: Vec<f64> = by.iter().zip(&slope).map(|(a, b)| a - b).collect();
            if dot(&step, &change) > 1e-12 * dot(&step, &step).sqrt() * dot(&change, &change).sqrt() {
                memory.push_back([step, change]);
                if memory.len() > MEMORY {
                    memory.pop_front();
                }
            }
            let gain = value - there;
            (*x, slope, value) = (to, by, there);
            if gain <= SETTLED * value {
                return Ok(());
            }
        }
        Ok(())
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn add(to: &mut [f64], what: &[f64], times: f64) {
    for (to, what) in to.iter_mut().zip(what) {
        *to += times * what;
    }
}
