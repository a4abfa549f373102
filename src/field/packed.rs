//! Stream functions whose level curves, one apart, lie nowhere farther from each other than they may and are
//! shortest in all: spacing and direction as one problem.
//!
//! Enters: at sites all over a surface the slowness `s` (1/mm) that a direction across the passes asks for
//! (one over the greatest distance of passes), and what a mm of pass costs in that direction. Leaves: the
//! coefficients of ψ that minimise
//!
//! ```text
//! ∫ c(θ) |∇ψ| dA    with    |∇ψ| >= s(θ),    θ the direction of ∇ψ.
//! ```
//!
//! plus, along borders, half a mm for each mm that passes run parallel to (a pass that meets a border aslant
//! runs on until its strip is cut): `½ |cos φ|`, φ the angle between both.
//!
//! Passes are packed where `|∇ψ| = s`. A front has that everywhere (see [`super::eikonal`]) and pays for it
//! by kinks and by the directions that its start leaves; here a little of the distance is given up where
//! better directions are worth more.
//!
//! The cost `c` is the way of the cutter's centre and not that of the contact, since the machine follows the
//! cutter. On a surface of curvatures ±κ the two prefer opposite directions.
//!
//! Functions that may bend sharply from place to place take a [`Roughness`] as well; ends of passes at
//! borders may have a price ([`minimise`]), and `c` may hold one of turning.
//!
//! Method: a shortfall `x = (s/|∇ψ| − 1)₊` counts as `c |∇ψ| (1 + x + ρ x²)` (as if the passes were as dense
//! as they must be, and a penalty); ρ grows in rounds, each minimised by L-BFGS (Nocedal 1980),
//! preconditioned by the equations of `∫ |∇ψ|²`, so that the number of steps hardly depends on the grid. ψ
//! may be any function that is linear in its coefficients: [`Gradients`] says how its gradient follows from
//! them.
//!
//! # Limits
//! A local minimum: [`minimise`] is called from several starts. Sites see what lies between them by their
//! area only.

use super::eikonal::{Front, Window};
use super::sparse::{Entry, Factor, Scratch};
use work::monitor::{self, Cancelled, Monitor};
use work::parallel;

/// ρ of each round. The last leaves shortfalls of about a thousandth.
const PENALTIES: [f64; 4] = [3.0, 30.0, 300.0, 3000.0];

/// Steps of a round at most. It ends earlier after so many steps in turn that gain less than this share.
const MOST_STEPS: usize = 150;
const SETTLED: f64 = 1e-6;
const SETTLED_STEPS: usize = 5;

/// Steps that L-BFGS remembers.
const MEMORY: usize = 12;

/// A step must gain this share of what its slope promises (Armijo's rule).
const LEAST_GAIN: f64 = 1e-4;

/// Halvings of a step before a round ends.
const MOST_HALVINGS: usize = 30;

/// No pass costs less than this share of the mean, what leaving a direction costs aside: where the cutter
/// hardly moves, ψ would else be without direction.
const LEAST_COST: f64 = 0.02;

/// A shortfall above this doubles the passes: they are put between others.
const DOUBLED: f64 = 0.02;

/// The angle, as a cosine, below which meeting a border aslant is not told from meeting it squarely.
const SQUARE: f64 = 0.1;

/// What passes may do at one place, and what they cost there.
#[derive(Debug, Clone)]
pub struct Site {
    /// Its surface area, mm².
    pub area: f64,
    /// The area, mm², that it stands for in the preconditioner, on which no minimum depends: 0 where other
    /// sites tell as much by fewer coefficients.
    pub stiff_area: f64,
    /// The slowness by direction across the passes.
    pub front: Front,
    /// Cost of a mm of pass, `[m, c, s]` of `m + c cos 2θ + s sin 2θ`, θ the direction across it in the frame
    /// of `front`.
    pub cost: [f64; 3],
    /// What of that is no length, but a price of turning.
    pub turning: [f64; 3],
    /// What of its mean is a price of leaving a direction.
    pub leaving: f64,
    /// On a border: the vector along it that the place stands for, mm, in the frame of `front`.
    pub border: Option<[f64; 2]>,
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

    /// Adds a site: coefficients, each below the number given, with their shares of the derivatives by the
    /// two parameters.
    pub fn push(&mut self, site: &Site, terms: impl Iterator<Item = (u32, [f64; 2])>) {
        self.terms.extend(terms.map(|(k, derivatives)| (k, site.front.covector(derivatives))));
        self.starts.push(self.terms.len() as u32);
    }

    /// Those of functions whose coefficients are tied, by the unknowns; to them comes what is `given` at each
    /// site, by components in its frame.
    pub fn tied(&self, tied: &Tied, given: &[[f64; 2]]) -> Self {
        let mut gradients = Self { coefficients: tied.count, ..Self::new(0) };
        for (site, &given) in given.iter().enumerate() {
            let mut fixed = given;
            for &(k, share) in self.of(site) {
                let offset = tied.offsets[k as usize];
                fixed = [fixed[0] + offset * share[0], fixed[1] + offset * share[1]];
                gradients.terms.extend(tied.unknowns[k as usize].map(|unknown| (unknown, share)));
            }
            gradients.terms.push((0, fixed));
            gradients.starts.push(gradients.terms.len() as u32);
        }
        gradients
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

/// A quadratic form, small where a function is smooth: the sum of `weight · (Σ terms)²`.
#[derive(Debug, Clone, Default)]
pub struct Roughness {
    /// The weight of each row, and where its terms end.
    rows: Vec<(f64, u32)>,
    terms: Vec<(u32, f64)>,
}

impl Roughness {
    /// Adds a row of coefficients with what they are multiplied by.
    pub fn push(&mut self, weight: f64, terms: impl IntoIterator<Item = (u32, f64)>) {
        self.terms.extend(terms);
        self.rows.push((weight, self.terms.len() as u32));
    }

    /// The weight and the terms of each row.
    fn rows(&self) -> impl Iterator<Item = (f64, &[(u32, f64)])> {
        let mut first = 0;
        self.rows.iter().map(move |&(weight, end)| {
            let from = std::mem::replace(&mut first, end as usize);
            (weight, &self.terms[from..end as usize])
        })
    }

    /// That of functions whose coefficients are tied, by the unknowns.
    pub fn tied(&self, tied: &Tied) -> Self {
        let mut roughness = Self::default();
        for (weight, terms) in self.rows() {
            let fixed: f64 = terms.iter().map(|&(k, share)| tied.offsets[k as usize] * share).sum();
            let free = terms.iter().filter_map(|&(k, share)| Some((tied.unknowns[k as usize]?, share)));
            roughness.push(weight, free.chain([(0, fixed)]));
        }
        roughness
    }
}

/// How coefficients follow from fewer unknowns. The first unknown is 1: it stands for what is given, and a
/// minimum holds it.
#[derive(Debug, Clone, PartialEq)]
pub struct Tied {
    /// What is given of each coefficient.
    pub offsets: Vec<f64>,
    /// The unknown that comes to it, from 1 on; `None` for a coefficient that is given.
    pub unknowns: Vec<Option<u32>>,
    /// Number of unknowns, the first included.
    pub count: usize,
}

impl Tied {
    /// The unknowns of no more than what is given.
    pub fn given(&self) -> Vec<f64> {
        let mut unknowns = vec![0.0; self.count];
        unknowns[0] = 1.0;
        unknowns
    }

    /// The coefficients.
    pub fn coefficients(&self, unknowns: &[f64]) -> Vec<f64> {
        let free = |unknown: &Option<u32>| unknown.map_or(0.0, |k| unknowns[k as usize]);
        self.offsets.iter().zip(&self.unknowns).map(|(offset, unknown)| offset + free(unknown)).collect()
    }
}

/// A minimum.
#[derive(Debug, Clone, PartialEq)]
pub struct Packed {
    /// Coefficients of ψ; the first one is that of the start.
    pub coefficients: Vec<f64>,
    /// Cost of all passes one apart (`∫ c |∇ψ| dA`), twice where they would be too far apart.
    pub cost: f64,
    /// That of their ends at borders.
    pub ends: f64,
    /// What of the cost is the price of turning.
    pub turning: f64,
    /// Passes, each by its two ends at borders.
    pub passes: f64,
    /// Share of the cost where they would.
    pub short: f64,
}

impl Packed {
    /// All that it costs where each end of a pass costs `end`, mm.
    pub fn priced(&self, end: f64) -> f64 {
        self.cost + self.ends + 2.0 * end * self.passes
    }
}

/// Which rounds are gone through.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rounds {
    /// All but the last two: enough to compare starts.
    First,
    /// The last two, from a minimum of the first, or of a coarser function.
    Last,
}

/// Minimises from `start`, where each end of a pass at a border costs `end` more, mm.
///
/// # Errors
/// [`Cancelled`] when the monitor says so; `Ok(None)` where sites do not determine the function.
pub fn minimise(
    sites: &[Site],
    gradients: &Gradients,
    roughness: &Roughness,
    end: f64,
    start: Vec<f64>,
    rounds: Rounds,
    monitor: &dyn Monitor,
) -> Result<Option<Packed>, Cancelled> {
    let minimiser = Minimiser::new(sites, gradients, roughness);
    minimiser.map_or(Ok(None), |minimiser| minimiser.run(end, start, rounds, monitor))
}

/// [`minimise`] from any number of starts, which share one preconditioner: that depends on neither
/// start nor price.
pub struct Minimiser<'a> {
    sites: &'a [Site],
    gradients: &'a Gradients,
    roughness: &'a Roughness,
    factor: Factor<f64>,
}

impl<'a> Minimiser<'a> {
    /// `None` where sites do not determine the function.
    pub fn new(sites: &'a [Site], gradients: &'a Gradients, roughness: &'a Roughness) -> Option<Self> {
        let factor = Problem { sites, gradients, roughness, end: 0.0 }.stiffness()?;
        Some(Self { sites, gradients, roughness, factor })
    }

    /// As [`minimise`].
    ///
    /// # Errors
    /// As [`minimise`].
    pub fn run(
        &self,
        end: f64,
        start: Vec<f64>,
        rounds: Rounds,
        monitor: &dyn Monitor,
    ) -> Result<Option<Packed>, Cancelled> {
        let Self { sites, gradients, roughness, ref factor } = *self;
        let Some(mut scratch) = factor.scratch().filter(|_| start.len() == gradients.coefficients) else {
            return Ok(None);
        };
        let problem = Problem { sites, gradients, roughness, end };
        let mut x = start;
        let (first, last) = PENALTIES.split_at(PENALTIES.len() - 2);
        for &penalty in if rounds == Rounds::First { first } else { last } {
            problem.descend((factor, &mut scratch), penalty, &mut x, monitor)?;
        }
        Ok(problem.packed(x))
    }
}

impl Site {
    /// The cost from what a mm of pass costs when the direction across it is 0, 60 and 120 degrees in the
    /// frame.
    pub fn harmonic([a, b, c]: [f64; 3]) -> [f64; 3] {
        let mean = (a + b + c) / 3.0;
        [mean, a - mean, (b - c) / 3f64.sqrt()]
    }

    /// The mean over all directions of a price that is `dearer` square to one and falls to 0 along it as a
    /// sine's square.
    pub fn mean_of_leaving(dearer: f64) -> f64 {
        0.5 * dearer
    }

    /// Cost for each unit of length in the direction of `q`, and its derivative by the angle.
    fn cost_at(&self, q: [f64; 2], norm2: f64) -> (f64, f64) {
        let (cost, turn) = Self::by_direction(self.cost, q, norm2);
        let least = LEAST_COST * (self.cost[0] - self.leaving).abs();
        if cost > least { (cost, turn) } else { (least, 0.0) }
    }

    /// The value of `[m, c, s]` in the direction of a gradient, and its derivative by the angle.
    fn by_direction([mean, cosine, sine]: [f64; 3], [q1, q2]: [f64; 2], norm2: f64) -> (f64, f64) {
        let (cos, sin) = ((q1 * q1 - q2 * q2) / norm2, 2.0 * q1 * q2 / norm2);
        (mean + cosine * cos + sine * sin, 2.0 * (sine * cos - cosine * sin))
    }

    fn length_and_shortfall(&self, q: [f64; 2]) -> (f64, f64) {
        let norm2 = (q[0] * q[0] + q[1] * q[1]).max(f64::MIN_POSITIVE);
        let (cost, _) = self.cost_at(q, norm2);
        let (square, _) = self.front.square(q);
        (self.area * cost * norm2.sqrt(), (square.max(0.0) / norm2).sqrt() - 1.0)
    }

    /// What the ends of passes cost at a border, and the derivative of that by the angle; `unit` is the
    /// direction across the passes.
    fn ends(&self, unit: [f64; 2]) -> (f64, f64) {
        let Some([along, across]) = self.border else { return (0.0, 0.0) };
        let length = along.hypot(across);
        // The cosine between pass and border, times the length, and its derivative.
        let parallel = along * unit[1] - across * unit[0];
        let turn = along * unit[0] + across * unit[1];
        let smooth = parallel.hypot(SQUARE * length);
        (0.5 * (smooth - SQUARE * length), if smooth > 0.0 { 0.5 * parallel * turn / smooth } else { 0.0 })
    }

    /// How many passes end at a border for each 1/mm of a gradient in the direction of `unit`, and the
    /// derivative of that by the angle.
    fn count(&self, unit: [f64; 2]) -> (f64, f64) {
        let Some([along, across]) = self.border else { return (0.0, 0.0) };
        let length = along.hypot(across);
        let parallel = along * unit[1] - across * unit[0];
        let met = along * unit[0] + across * unit[1];
        let smooth = met.hypot(SQUARE * length);
        (smooth - SQUARE * length, if smooth > 0.0 { -met * parallel / smooth } else { 0.0 })
    }

    /// What a gradient costs with the penalty and a price of each end at a border, and the derivatives of
    /// that by its components.
    fn charge(&self, q: [f64; 2], penalty: f64, end: f64, window: &mut Window) -> (f64, [f64; 2]) {
        let norm2 = (q[0] * q[0] + q[1] * q[1]).max(f64::MIN_POSITIVE);
        let norm = norm2.sqrt();
        let (cost, cost_turn) = self.cost_at(q, norm2);
        let (square, square_turn) = self.front.square_near(q, window);
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
        let (ends, ends_turn) = self.ends(unit);
        let (count, count_turn) = self.count(unit);
        let (ends, ends_turn) = (ends + end * norm * count, ends_turn + end * norm * count_turn);
        let (by_norm, turn) = (self.area * by_norm + end * count, (self.area * by_angle + ends_turn) / norm);
        let by = [by_norm * unit[0] - turn * unit[1], by_norm * unit[1] + turn * unit[0]];
        (self.area * value + ends, by)
    }
}

struct Problem<'a> {
    sites: &'a [Site],
    gradients: &'a Gradients,
    roughness: &'a Roughness,
    end: f64,
}

/// What the last look at a site found.
#[derive(Debug, Clone, Copy, Default)]
struct Look {
    window: Window,
    value: f64,
    slope: [f64; 2],
}

/// Sites that one worker looks at.
const SITES_A_PIECE: usize = 2048;

impl Problem<'_> {
    /// What ψ costs, and the derivatives of that by its coefficients; `looks` are those at the sites.
    fn charge(&self, x: &[f64], penalty: f64, by: &mut [f64], looks: &mut [Look]) -> f64 {
        parallel::for_each_chunk(looks, SITES_A_PIECE, |piece, looks| {
            for (k, look) in looks.iter_mut().enumerate() {
                let k = piece * SITES_A_PIECE + k;
                let q = self.gradients.at(k, x);
                (look.value, look.slope) = self.sites[k].charge(q, penalty, self.end, &mut look.window);
            }
        });
        by.fill(0.0);
        let mut sum = 0.0;
        for (site, Look { value, slope, .. }) in looks.iter().enumerate() {
            sum += value;
            for &(k, share) in self.gradients.of(site) {
                by[k as usize] += slope[0] * share[0] + slope[1] * share[1];
            }
        }
        for (weight, terms) in self.roughness.rows() {
            let row: f64 = terms.iter().map(|&(k, share)| share * x[k as usize]).sum();
            sum += weight * row * row;
            terms.iter().for_each(|&(k, share)| by[k as usize] += 2.0 * weight * row * share);
        }
        sum
    }

    /// What the passes of ψ cost; `None` where that is no number.
    fn packed(&self, x: Vec<f64>) -> Option<Packed> {
        let (mut cost, mut ends, mut turning, mut passes, mut short) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for (k, site) in self.sites.iter().enumerate() {
            let q = self.gradients.at(k, &x);
            let (length, shortfall) = site.length_and_shortfall(q);
            let norm = q[0].hypot(q[1]).max(f64::MIN_POSITIVE);
            ends += site.ends([q[0] / norm, q[1] / norm]).0;
            passes += site.border.map_or(0.0, |along| 0.5 * (along[0] * q[0] + along[1] * q[1]).abs());
            turning += site.area * Site::by_direction(site.turning, q, norm * norm).0 * norm;
            let doubled = shortfall > DOUBLED;
            cost += if doubled { 2.0 * length } else { length };
            short += if doubled { length } else { 0.0 };
        }
        let sound = cost.is_finite() && x.iter().all(|x| x.is_finite());
        sound.then(|| Packed { coefficients: x, cost, ends, turning, passes, short: short / cost })
    }

    /// The factor of the equations of `∫ (c/s) |∇ψ|²` and the roughness, the first coefficient held: about
    /// the second derivatives of the cost.
    fn stiffness(&self) -> Option<Factor<f64>> {
        let n = self.gradients.coefficients;
        let mut entries: Vec<Entry<f64>> = Vec::new();
        for (k, site) in self.sites.iter().enumerate() {
            if site.stiff_area == 0.0 {
                continue;
            }
            let weight = site.stiff_area * site.cost[0].abs() / site.front.mean_slowness();
            for &(a, ga) in self.gradients.of(k) {
                for &(b, gb) in self.gradients.of(k) {
                    if a >= b && b > 0 {
                        entries.push(Entry::new(a - 1, b - 1, weight * (ga[0] * gb[0] + ga[1] * gb[1])));
                    }
                }
            }
        }
        for (weight, terms) in self.roughness.rows() {
            for &(a, ga) in terms {
                for &(b, gb) in terms {
                    if a >= b && b > 0 {
                        entries.push(Entry::new(a - 1, b - 1, 2.0 * weight * ga * gb));
                    }
                }
            }
        }
        Factor::new(n.checked_sub(1)?, &entries)
    }

    /// Lowers the cost until nothing is left to gain.
    fn descend(
        &self,
        (factor, scratch): (&Factor<f64>, &mut Scratch),
        penalty: f64,
        x: &mut Vec<f64>,
        monitor: &dyn Monitor,
    ) -> Result<(), Cancelled> {
        let n = x.len();
        let mut slope = vec![0.0; n];
        let mut looks = vec![Look::default(); self.sites.len()];
        let mut value = self.charge(x, penalty, &mut slope, &mut looks);
        // The slope as the preconditioner sees it: all that is solved for follows from these.
        let preconditioned = |slope: &[f64], scratch: &mut Scratch| {
            let mut seen = slope.to_vec();
            factor.solve(scratch, &mut seen[1..]);
            seen[0] = 0.0;
            seen
        };
        let mut seen = preconditioned(&slope, scratch);
        // Steps, changes of the slope, and these as the preconditioner sees them.
        let mut memory: std::collections::VecDeque<[Vec<f64>; 3]> = std::collections::VecDeque::new();
        let mut settled = 0;
        for _ in 0..MOST_STEPS {
            monitor::check(monitor)?;
            let mut ahead: Vec<f64> = slope.iter().map(|g| -g).collect();
            let mut direction: Vec<f64> = seen.iter().map(|g| -g).collect();
            let mut shares = Vec::with_capacity(memory.len());
            for [step, change, seen] in memory.iter().rev() {
                let share = dot(step, &ahead) / dot(step, change);
                add(&mut ahead, change, -share);
                add(&mut direction, seen, -share);
                shares.push(share);
            }
            if let Some([step, change, seen]) = memory.back() {
                // The length of the last step along its change, as the preconditioner sees it.
                let scale = dot(step, change) / dot(change, seen);
                direction.iter_mut().for_each(|d| *d *= scale);
            }
            for ([step, change, _], share) in memory.iter().zip(shares.iter().rev()) {
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
                let there = self.charge(&to, penalty, &mut by, &mut looks);
                if there <= value + LEAST_GAIN * size * promised {
                    found = Some((to, there));
                    break;
                }
                size *= 0.5;
            }
            let Some((to, there)) = found else { return Ok(()) };
            let step: Vec<f64> = to.iter().zip(&*x).map(|(a, b)| a - b).collect();
            let change: Vec<f64> = by.iter().zip(&slope).map(|(a, b)| a - b).collect();
            let now = preconditioned(&by, scratch);
            if dot(&step, &change) > 1e-12 * dot(&step, &step).sqrt() * dot(&change, &change).sqrt() {
                let seen = now.iter().zip(&seen).map(|(a, b)| a - b).collect();
                memory.push_back([step, change, seen]);
                if memory.len() > MEMORY {
                    memory.pop_front();
                }
            }
            settled = if value - there <= SETTLED * value { settled + 1 } else { 0 };
            (*x, slope, seen, value) = (to, by, now, there);
            if settled == SETTLED_STEPS {
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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use work::monitor::Silent;

    /// Cells a side of the unit square.
    const CELLS: usize = 12;

    /// Bilinear functions on the unit square, the speed at a place by the direction across, the cost
    /// likewise.
    fn square(
        speed: impl Fn(f64, f64, [f64; 2]) -> f64,
        cost: [f64; 3],
        borders: bool,
    ) -> (Vec<Site>, Gradients) {
        let h = 1.0 / CELLS as f64;
        let gauss = [0.5 - 0.5 / 3f64.sqrt(), 0.5 + 0.5 / 3f64.sqrt()];
        let (mut sites, mut gradients) = (Vec::new(), Gradients::new((CELLS + 1) * (CELLS + 1)));
        let mut push = |i: usize, j: usize, s: f64, t: f64, area: f64, border: Option<[f64; 2]>| {
            let (x, y) = ((i as f64 + s) * h, (j as f64 + t) * h);
            let front = Front::new((1.0, 0.0, 1.0), |b| speed(x, y, b)).unwrap();
            let site = Site { area, stiff_area: area, front, cost, turning: [0.0; 3], leaving: 0.0, border };
            let corner = (j * (CELLS + 1) + i) as u32;
            let above = corner + CELLS as u32 + 1;
            let slopes = [
                (corner, [t - 1.0, s - 1.0]),
                (corner + 1, [1.0 - t, -s]),
                (above, [-t, 1.0 - s]),
                (above + 1, [t, s]),
            ];
            gradients.push(&site, slopes.into_iter().map(|(k, d)| (k, d.map(|d| d / h))));
            sites.push(site);
        };
        for k in 0..CELLS * CELLS {
            for q in 0..4 {
                push(k % CELLS, k / CELLS, gauss[q % 2], gauss[q / 2], 0.25 * h * h, None);
            }
        }
        for k in (0..CELLS).filter(|_| borders) {
            push(k, 0, 0.5, 0.0, 0.0, Some([h, 0.0]));
            push(k, CELLS - 1, 0.5, 1.0, 0.0, Some([h, 0.0]));
            push(0, k, 0.0, 0.5, 0.0, Some([0.0, h]));
            push(CELLS - 1, k, 1.0, 0.5, 0.0, Some([0.0, h]));
        }
        (sites, gradients)
    }

    fn straight(angle: f64, density: f64) -> Vec<f64> {
        let at = |k: usize| k as f64 / CELLS as f64;
        let side = CELLS + 1;
        (0..side * side)
            .map(|k| density * (angle.cos() * at(k % side) + angle.sin() * at(k / side)))
            .collect()
    }

    fn run((sites, gradients): &(Vec<Site>, Gradients), start: Vec<f64>) -> Packed {
        let first = minimise(sites, gradients, &Roughness::default(), 0.0, start, Rounds::First, &Silent)
            .unwrap()
            .unwrap();
        minimise(sites, gradients, &Roughness::default(), 0.0, first.coefficients, Rounds::Last, &Silent)
            .unwrap()
            .unwrap()
    }

    /// The widest interval over the allowed one.
    fn widest((sites, gradients): &(Vec<Site>, Gradients), found: &Packed) -> f64 {
        let short = |k: usize| sites[k].length_and_shortfall(gradients.at(k, &found.coefficients)).1;
        (0..sites.len()).map(short).fold(0.0, f64::max)
    }

    #[test]
    fn even_ground_is_covered_by_its_area_over_the_interval() {
        let problem = square(|_, _, _| 0.05, [1.0, 0.0, 0.0], false);
        let mut start = straight(0.7, 9.0);
        start.iter_mut().enumerate().for_each(|(k, x)| *x += 0.1 * (k as f64 * 1.7).sin());
        let found = run(&problem, start);
        assert!((found.cost / 20.0 - 1.0).abs() < 2e-3 && found.short == 0.0, "{}", found.cost);
        assert!(widest(&problem, &found) < 5e-3);
    }

    /// Where the widest strip has one direction everywhere, passes turn to it.
    #[test]
    fn passes_turn_to_the_widest_strip_and_to_the_shorter_way() {
        let slow = |b: [f64; 2]| (500.0 + 300.0 * (b[0] * b[0] - b[1] * b[1])).sqrt();
        let problem = square(|_, _, b| 1.0 / slow(b), [1.0, 0.0, 0.0], false);
        let least = 200f64.sqrt();
        for angle in [0.3, 1.0, 2.2] {
            let found = run(&problem, straight(angle, 20.0));
            assert!((found.cost / least - 1.0).abs() < 5e-3, "{angle}: {} {least}", found.cost);
        }
        let problem = square(|_, _, _| 0.1, [1.0, 0.3, 0.0], false);
        let found = run(&problem, straight(1.0, 10.0));
        assert!((found.cost / 7.0 - 1.0).abs() < 5e-3, "{}", found.cost);
    }

    /// An interval that grows along x alone is served exactly by passes along y.
    #[test]
    fn an_uneven_interval_is_served_exactly() {
        let problem = square(|x, _, _| 0.05 * (1.0 + x), [1.0, 0.0, 0.0], false);
        let found = run(&problem, straight(0.5, 15.0));
        let least = 20.0 * 2f64.ln();
        assert!(found.cost > 0.999 * least && found.cost < 1.02 * least, "{} {least}", found.cost);
        assert!(widest(&problem, &found) < 0.01);
    }

    /// Aslant a pass is a little cheaper, but there are more of them: ends that cost much leave no more than
    /// there are along a side, or fewer, since passes bend to close.
    #[test]
    fn a_price_for_each_end_leaves_fewer_passes() {
        let (sites, gradients) = square(|_, _, _| 0.05, [1.0, 0.0, -0.1], true);
        let passes = |end: f64| {
            let rough = Roughness::default();
            let start = straight(0.7, 20.0);
            let found = minimise(&sites, &gradients, &rough, end, start, Rounds::First, &Silent);
            found.unwrap().unwrap().passes
        };
        let [free, dear] = [passes(0.0), passes(0.3)];
        assert!(free > 26.0 && free < 28.5 && dear < 22.0, "{free} {dear}");
    }

    /// Of coefficients that are tied, with something given besides, gradients and roughness are those of the
    /// coefficients themselves.
    #[test]
    fn tied_coefficients_have_the_gradients_of_their_function() {
        let (sites, gradients) = square(|_, _, _| 0.05, [1.0, 0.0, 0.0], true);
        let count = (CELLS + 1) * (CELLS + 1);
        let wave = |k: usize, pitch: f64| (k as f64 * pitch).sin();
        // One row is given, one has a single unknown, all others have one each.
        let unknowns = (0..count).map(|k| match k / (CELLS + 1) {
            0 => None,
            1 => Some(1),
            _ => Some((k - 2 * (CELLS + 1)) as u32 + 2),
        });
        let offsets: Vec<f64> = (0..count).map(|k| wave(k, 0.7)).collect();
        let tied = Tied { offsets, unknowns: unknowns.collect(), count: count - 2 * (CELLS + 1) + 2 };
        let given: Vec<[f64; 2]> = (0..sites.len()).map(|k| [wave(k, 1.3), wave(k, 2.9)]).collect();
        let mut x: Vec<f64> = (0..tied.count).map(|k| wave(k, 1.9)).collect();
        x[0] = tied.given()[0];
        let (whole, reduced) = (tied.coefficients(&x), gradients.tied(&tied, &given));
        for (k, given) in given.iter().enumerate() {
            let (a, b) = (gradients.at(k, &whole), reduced.at(k, &x));
            assert!((0..2).all(|c| (a[c] + given[c] - b[c]).abs() < 1e-9), "{k}: {a:?} {given:?} {b:?}");
        }
        let mut roughness = Roughness::default();
        (2..count).for_each(|k| {
            roughness.push(1.0 + k as f64, [(k as u32, 1.0), (k as u32 - 1, -2.0), (k as u32 - 2, 1.0)])
        });
        let form = |roughness: &Roughness, x: &[f64]| -> f64 {
            let row = |(weight, terms): (f64, &[(u32, f64)])| {
                weight * terms.iter().map(|&(k, share)| share * x[k as usize]).sum::<f64>().powi(2)
            };
            roughness.rows().map(row).sum()
        };
        let (a, b) = (form(&roughness, &whole), form(&roughness.tied(&tied), &x));
        assert!((a - b).abs() < 1e-9 * a, "{a} {b}");
    }

    /// Of directions that are equally good inside, passes that meet the borders squarely are shorter: they
    /// end at two of four sides, and the other two see them parallel.
    #[test]
    fn ends_at_borders_count() {
        let problem = square(|_, _, _| 0.05, [1.0, 0.0, 0.0], true);
        let aslant: f64 = problem.0.iter().map(|site| site.ends([0.5f64.sqrt(); 2]).0).sum();
        // Four sides of 1 mm at 45 degrees, half of the cosine each; less what is not told from a square
        // meeting.
        assert!((aslant - 2.0 * (0.5f64.sqrt() - SQUARE)).abs() < 0.03, "{aslant}");
        let along: f64 = problem.0.iter().map(|site| site.ends([1.0, 0.0]).0).sum();
        assert!((along - 1.0).abs() < 0.11, "{along}");
    }

    /// What starts share is the same to the bit as what each makes for itself.
    #[test]
    fn starts_that_share_a_preconditioner_end_where_each_ends_alone() {
        let (sites, gradients) = square(|x, _, _| 0.05 * (1.0 + x), [1.0, 0.2, -0.1], true);
        let rough = Roughness::default();
        let shared = Minimiser::new(&sites, &gradients, &rough).unwrap();
        for (angle, end) in [(0.2, 0.0), (1.1, 0.3), (2.3, 0.1)] {
            let start = straight(angle, 15.0);
            let alone = minimise(&sites, &gradients, &rough, end, start.clone(), Rounds::First, &Silent);
            assert_eq!(shared.run(end, start, Rounds::First, &Silent), alone);
        }
    }

    #[test]
    fn what_determines_nothing_is_refused() {
        let (sites, gradients) = square(|_, _, _| 0.05, [1.0, 0.0, 0.0], false);
        assert_eq!(
            minimise(&sites, &gradients, &Roughness::default(), 0.0, vec![0.0; 3], Rounds::First, &Silent),
            Ok(None)
        );
        assert_eq!(
            minimise(
                &[],
                &Gradients::new(4),
                &Roughness::default(),
                0.0,
                vec![0.0; 4],
                Rounds::First,
                &Silent
            ),
            Ok(None)
        );
    }

    proptest! {
        /// The derivatives are those of the charge, also where the front is a table and costs depend on
        /// direction.
        #[test]
        fn derivatives_are_those_of_the_charge(
            angle in 0.0..6.3f64, norm in 0.3..3.0f64, swing in -0.6..0.6f64, sine in -0.4..0.4f64,
            table in any::<bool>(), border in any::<bool>(),
        ) {
            let speed = |b: [f64; 2]| {
                let second = 1.0 + swing * (b[0] * b[0] - b[1] * b[1]);
                1.0 / (second + if table { 0.05 * (b[0] * b[1]).powi(2) } else { 0.0 }).sqrt()
            };
            let site = Site {
                area: 2.0,
                stiff_area: 2.0,
                front: Front::new((1.3, 0.2, 0.9), speed).unwrap(),
                cost: [1.0, swing * 0.5, sine],
                turning: [0.0; 3],
                leaving: 0.0,
                border: border.then_some([0.4, -0.7]),
            };
            let q = [norm * angle.cos(), norm * angle.sin()];
            // The second derivative jumps where the interval is the allowed one.
            let (_, short) = site.length_and_shortfall(q);
            prop_assume!(short.abs() > 1e-3);
            let charge = |q: [f64; 2]| site.charge(q, 30.0, 0.7, &mut Window::default());
            let (_, by) = charge(q);
            for c in 0..2 {
                let h = 1e-6;
                let at = |s: f64| {
                    let mut moved = q;
                    moved[c] += s * h;
                    charge(moved).0
                };
                let numeric = (at(1.0) - at(-1.0)) / (2.0 * h);
                prop_assert!((numeric - by[c]).abs() < 1e-4 * (1.0 + by[c].abs()), "{numeric} {}", by[c]);
            }
        }
    }
}
