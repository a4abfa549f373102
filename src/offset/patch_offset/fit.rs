//! A cubic B-spline surface for an offset, by interpolation at places that are made denser until the error
//! that is measured between them is within tolerance.
//!
//! Where the patch is k times differentiable across a knot line its offset is k − 1 times, and so is the fit:
//! the knot stands as often as that takes. Between knots the error then falls with the fourth power of their
//! distance. The fit has the parameters of the patch. At creases, which tear the offset, the fit is parted.

use super::crease::{continuity, creases};
use super::{OffsetSurface, PatchOffsetError};
use geometry::{InterpolationAxis, KnotVector, NurbsSurface, Point3, interpolate};
use work::parallel;

/// Pieces into which each span of the patch is divided at first.
const FIRST_PIECES: usize = 2;
/// Pieces into which one is divided at most in a round. More would trust the fourth order too early.
const MOST_PIECES: f64 = 4.0;
/// Most knots along one parameter, and shortest piece as a share of the range: a fit that asks for more does
/// not converge.
const MAX_PIECES: usize = 4000;
const SHORTEST: f64 = 1.0e-7;
/// Most control points in all.
const MAX_CONTROLS: usize = 4_000_000;
/// Shares of a piece at which the error is looked at: of the peaks of an error of fourth order, which lie
/// between sites at ends or thirds of pieces, none is farther than an eighth.
const LOOKS: [f64; 5] = [0.0, 0.125, 0.375, 0.625, 0.875];
/// What the greatest error may lie above the greatest seen: along a piece an error like `t²(1 − t)²` loses
/// one eighth over an eighth of the piece, and that along u and along v.
const SAFETY: f64 = 1.3;
/// Share of the tolerance that the error along one parameter is brought down to.
const SHARE: f64 = 0.36;
/// What a crease may tear without being one, as a share of the tolerance.
const TEAR: f64 = 0.1;
const MAX_ROUNDS: usize = 24;
/// Rounds without a gain of a tenth after which the error is taken not to fall any more.
const IDLE_ROUNDS: usize = 3;
/// Least tolerance as a share of coordinates: less is rounding.
const LEAST_TOLERANCE: f64 = 1.0e-12;

/// A B-spline surface that stands for an offset.
#[derive(Debug, Clone, PartialEq)]
pub struct FittedOffset {
    /// Cubic along both parameters, which are those of the patch.
    pub surface: NurbsSurface,
    /// Bound of the distance, mm, from its point at `(u, v)` to the offset's: 1.3 times the greatest found at
    /// 25 places in each piece, which holds where the error is of its fourth order. Its points keep the
    /// offset's distance from the patch within that.
    pub error_mm: f64,
    /// Places at which the error was looked at.
    pub samples: usize,
}

/// Knots of one direction: where, and how often.
type Nodes = Vec<(f64, usize)>;

/// A rectangle of parameters without creases inside.
struct Window<'a> {
    offset: &'a OffsetSurface<'a>,
    range: [[f64; 2]; 2],
}

/// The greatest of some distances, and where.
#[derive(Clone, Copy)]
struct Worst {
    error: f64,
    at: [f64; 2],
}

impl Worst {
    const NONE: Self = Self { error: 0.0, at: [0.0; 2] };

    fn or(self, other: Self) -> Self {
        if other.error > self.error { other } else { self }
    }
}

impl OffsetSurface<'_> {
    /// Cubic B-spline surfaces within `tolerance`, mm, of this offset: one, or where the patch has creases
    /// one for each rectangle between them, u slowest. Places where the offset is singular are fitted as they
    /// are; see [`OffsetSurface::singular_places`].
    ///
    /// # Errors
    /// A tolerance of 0 or less, or below rounding, a patch without normals, a tolerance that some 4000 knots
    /// do not reach.
    ///
    /// # Tolerance
    /// See [`FittedOffset::error_mm`].
    pub fn fit(&self, tolerance: f64) -> Result<Vec<FittedOffset>, PatchOffsetError> {
        let size = self.surface.control_bounds().diagonal() + self.distance.abs();
        if tolerance.is_nan() || tolerance < LEAST_TOLERANCE * size || tolerance <= 0.0 {
            return Err(PatchOffsetError::Tolerance(tolerance));
        }
        let [us, vs] = [0, 1].map(|k| {
            let [lo, hi] = self.surface.domain()[k];
            let inner = creases(self, k, TEAR * tolerance).into_iter().map(|c| c.at);
            std::iter::once(lo).chain(inner).chain([hi]).collect::<Vec<f64>>()
        });
        let window = |u: &[f64], v: &[f64]| Window { offset: self, range: [[u[0], u[1]], [v[0], v[1]]] };
        let windows = us.windows(2).flat_map(|u| vs.windows(2).map(move |v| window(u, v)));
        windows.map(|w| w.fit(tolerance)).collect()
    }
}

impl Window<'_> {
    fn fit(&self, tolerance: f64) -> Result<FittedOffset, PatchOffsetError> {
        let mut nodes = [0, 1].map(|k| self.first_nodes(k));
        let mut target = SHARE * tolerance;
        let mut reached = Worst { error: f64::INFINITY, at: self.range.map(|r| r[0]) };
        let (mut least, mut idle) = (f64::INFINITY, 0);
        for _ in 0..MAX_ROUNDS {
            let axes = nodes.each_ref().map(axis);
            let [Some(u), Some(v)] = axes else { break };
            if u.sites().len() * v.sites().len() > MAX_CONTROLS {
                break;
            }
            let surface = interpolate(&u, &v, &self.points(u.sites(), v.sites())?)?;
            // At the sites of v the fit is the interpolation along u alone, and the other way round.
            let along_u = self.errors(&surface, &halfway(&nodes[0]), &[v.sites().to_vec()])?;
            let along_v = self.errors(&surface, &[u.sites().to_vec()], &halfway(&nodes[1]))?;
            let errors = [along_u, along_v];
            let worst = errors.iter().flatten().fold(Worst::NONE, |a, b| a.or(*b));
            if worst.error <= target {
                let [us, vs] = [0, 1].map(|k| halfway(&nodes[k]));
                let all = self.errors(&surface, &us, &[vs.concat()])?;
                let worst = all.into_iter().fold(Worst::NONE, Worst::or);
                let error_mm = SAFETY * worst.error;
                if error_mm <= tolerance {
                    let samples = us.len() * vs.len() * LOOKS.len() * LOOKS.len();
                    return Ok(FittedOffset { surface, error_mm, samples });
                }
                reached = Worst { error: error_mm, at: worst.at };
                target *= 0.5;
            } else {
                reached = Worst { error: 2.0 * SAFETY * worst.error, at: worst.at };
            }
            idle = if worst.error > 0.9 * least { idle + 1 } else { 0 };
            if idle == IDLE_ROUNDS {
                break;
            }
            least = least.min(worst.error);
            for (k, errors) in errors.iter().enumerate() {
                let range = self.range[k][1] - self.range[k][0];
                nodes[k] = refined(&nodes[k], errors, target, SHORTEST * range);
            }
            if nodes.iter().any(|n| n.len() > MAX_PIECES) {
                break;
            }
        }
        let [u, v] = reached.at;
        Err(PatchOffsetError::NotReached { tolerance, reached: reached.error, u, v })
    }

    /// The patch's own knots, as often as the smoothness of the offset asks, and more between them.
    fn first_nodes(&self, k: usize) -> Nodes {
        let surface = self.offset.surface();
        let knots = [surface.knots_u(), surface.knots_v()][k];
        let [lo, hi] = self.range[k];
        let breaks: Vec<f64> = knots.breaks().into_iter().filter(|t| (lo..=hi).contains(t)).collect();
        let mut nodes = Vec::new();
        for span in breaks.windows(2) {
            let smooth = continuity(knots, span[0]);
            nodes.push((span[0], 4_usize.saturating_sub(smooth).clamp(1, 3)));
            let step = (span[1] - span[0]) / FIRST_PIECES as f64;
            nodes.extend((1..FIRST_PIECES).map(|i| (span[0] + step * i as f64, 1)));
        }
        if let Some(first) = nodes.first_mut() {
            first.1 = 4;
        }
        nodes.push((hi, 4));
        nodes
    }

    /// A point of the offset; at the end of the window that of its inner side.
    fn point(&self, u: f64, v: f64) -> Result<Point3, PatchOffsetError> {
        let inner = |t: f64, k: usize| if t >= self.range[k][1] { self.range[k][1].next_down() } else { t };
        let domain = self.offset.surface().domain();
        let of = |t: f64, k: usize| if self.range[k][1] < domain[k][1] { inner(t, k) } else { t };
        self.offset.point(of(u, 0), of(v, 1))
    }

    fn points(&self, us: &[f64], vs: &[f64]) -> Result<Vec<Vec<Point3>>, PatchOffsetError> {
        parallel::try_map(us.len(), |i| vs.iter().map(|&v| self.point(us[i], v)).collect())
    }

    /// The greatest error in each group of u with each group of v.
    fn errors(
        &self,
        surface: &NurbsSurface,
        us: &[Vec<f64>],
        vs: &[Vec<f64>],
    ) -> Result<Vec<Worst>, PatchOffsetError> {
        parallel::try_map(us.len() * vs.len(), |k| {
            let (us, vs) = (&us[k / vs.len()], &vs[k % vs.len()]);
            let mut worst = Worst::NONE;
            for (&u, &v) in us.iter().flat_map(|u| vs.iter().map(move |v| (u, v))) {
                let error = (surface.point(u, v) - self.point(u, v)?).norm();
                worst = worst.or(Worst { error, at: [u, v] });
            }
            Ok(worst)
        })
    }
}

fn axis(nodes: &Nodes) -> Option<InterpolationAxis> {
    let knots: Vec<f64> = nodes.iter().flat_map(|&(t, times)| std::iter::repeat_n(t, times)).collect();
    let controls = knots.len().checked_sub(4)?;
    InterpolationAxis::at_averages(KnotVector::new(3, knots, controls).ok()?)
}

/// The places of each piece at which errors are looked at.
fn halfway(nodes: &Nodes) -> Vec<Vec<f64>> {
    let places = |w: &[(f64, usize)]| LOOKS.iter().map(|t| w[0].0 + t * (w[1].0 - w[0].0)).collect();
    nodes.windows(2).map(places).collect()
}

/// Pieces whose error is above the target are divided as its fourth order tells.
fn refined(nodes: &Nodes, errors: &[Worst], target: f64, shortest: f64) -> Nodes {
    let mut out = Vec::with_capacity(2 * nodes.len());
    for (w, worst) in nodes.windows(2).zip(errors) {
        out.push(w[0]);
        if worst.error > target && w[1].0 - w[0].0 > shortest {
            let pieces = (worst.error / target).powf(0.25).ceil().clamp(2.0, MOST_PIECES) as usize;
            let step = (w[1].0 - w[0].0) / pieces as f64;
            out.extend((1..pieces).map(|i| (w[0].0 + step * i as f64, 1)));
        }
    }
    out.extend(nodes.last());
    out
}
