//! Fairing of plane curves: points move a little so that the interpolating cubic spline loses its bumps.
//!
//! Enters: a [`CubicSpline`], open or closed, and how far any point may go. Leaves: the spline through the
//! moved points at the *same parameters*, who moved where, and figures before and after. A cubic spline's
//! bumps are the jumps of its third derivative at the points. What is called *jump energy* here is the plain
//! sum of their squares over all points, `Σ |C‴(t_k⁺) − C‴(t_k⁻)|²` (derivatives by the parameter; with
//! chord-length parameters, mm⁻⁴). It weighs places where points lie close far more than others, and it says
//! nothing of the long waves that are left: the curvature comb shows those.
//!
//! Parameters stay as they are while points move, so that before and after are measured alike and the work is
//! linear; chords change by twice the cap at most. Whoever wants chord lengths again interpolates the moved
//! points anew.
//!
//! All methods move one unknown at a time, the worst first ([`FairingMethod`]); each finds the best place of
//! its unknown within the discs of all points that it moves, so that a point on its cap still slides along it
//! and back. Kjellander's step removes a jump, which is what minimises `∫ |C″|²` over one point: in the end
//! the curve is the straightest one within the caps. Lines and cubics have no jumps and stay. Ends of open
//! curves stay as well.
//!
//! Limits: noise of the length of the distance between points is not told from shape.

mod control_points;
mod energy;
mod kjellander;
mod noise;
mod published;
mod relaxation;
#[cfg(test)]
mod tests;

pub use kjellander::JUMP_REMOVING_STEP;
pub use noise::{noise, outlier};

use geometry::{CubicSpline, KnotError, SplineError, Vector2};
use relaxation::{Relaxation, State, Unknown};

/// Rounds at most. Moves grow slower and slower as waves grow longer; what is left after so many is shape.
const MOST_ROUNDS: usize = 1000;

/// No point is moved by more than this many times the noise of the points: what a curve shows besides is
/// shape.
const MOST_NOISE: f64 = 2.0;

/// Least cap, mm, of a curve without noise.
const LEAST_CAP: f64 = 1e-9;

/// Steps at which moving one point back and forth no longer settles: twice that which removes its jump.
const MOST_STEP: f64 = 2.0 * JUMP_REMOVING_STEP;

/// What moves, and where to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FairingMethod {
    /// The point of the greatest jump goes `step` times the way to the place P* that Kjellander gives it:
    /// 1 as published, [`JUMP_REMOVING_STEP`] so that its jump vanishes; above 0 and below twice that. The
    /// points next to the ends of open curves have no jump and stay too.
    Kjellander {
        /// Multiple of the way.
        step: f64,
    },
    /// The control point at the greatest jump goes to where that jump vanishes (knot removal and reinsertion,
    /// Farin and others).
    ControlPoints,
    /// The control point whose move lowers the jump energy most goes to where it is least (Eck and
    /// Hadenfeldt).
    Energy,
    /// The worst point goes to its corrected place, one a round, until the greatest distance hardly changes:
    /// as published by the second source of this project.
    Published {
        /// Points on each side between which the corrected place is sought: 1 for Kjellander's.
        neighbours: usize,
    },
}

/// How to fair a curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fairing {
    /// What moves.
    pub method: FairingMethod,
    /// How far any point may end from its first place, mm, above 0.
    pub most_displacement: f64,
    /// It ends when no point has moved further than this in a round of as many moves as there are unknowns,
    /// mm. A 250th of the cap leaves long waves only, which are shape. What is published has a rule of its
    /// own.
    pub least_movement: f64,
}

/// Why a curve was not faired.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum FairingError {
    /// A length that must be above 0.
    #[error("{what} is {value} mm; it must be a number above 0")]
    Length {
        /// What.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// Kjellander's step.
    #[error("the step is {0}; it must be above 0 and below {MOST_STEP:.3} (1 as published)")]
    Step(f64),
    /// Neighbours of the published method.
    #[error("a corrected place needs a neighbour on each side; 1 is Kjellander's")]
    NoNeighbours,
    /// No point of the curve has as many neighbours.
    #[error("with {neighbours} neighbours on each side a corrected place needs {} points, and the curve has {points}", 2 * neighbours + 1)]
    TooFewPoints {
        /// Neighbours on each side.
        neighbours: usize,
        /// Points of the curve.
        points: usize,
    },
    /// Moved points let no spline through.
    #[error("fairing brought points together ({0}); allow less displacement, or delete close points")]
    Moved(SplineError),
    /// Parameters are no knots.
    #[error("parameters cannot be the knots of a B-spline: {0}; delete points that nearly coincide")]
    Knots(#[from] KnotError),
}

impl From<SplineError> for FairingError {
    fn from(error: SplineError) -> Self {
        Self::Moved(error)
    }
}

/// A curve after fairing.
#[derive(Debug, Clone, PartialEq)]
pub struct Faired {
    /// The curve through the moved points, at the parameters of the one before.
    pub spline: CubicSpline,
    /// Points that moved: index and displacement from the first place, mm.
    pub moved: Vec<(usize, Vector2)>,
    /// Moves of one unknown each.
    pub moves: usize,
    /// Rounds of moves.
    pub rounds: usize,
    /// Whether the stop rule was met, and not the limit of rounds.
    pub settled: bool,
    /// Jump energy before and after ([`jump_energy`]).
    pub jump_energy: [f64; 2],
    /// Length before and after, mm.
    pub length: [f64; 2],
}

impl Faired {
    fn unmoved(spline: &CubicSpline) -> Self {
        Self {
            spline: spline.clone(),
            moved: Vec::new(),
            moves: 0,
            rounds: 0,
            settled: false,
            jump_energy: [jump_energy(spline); 2],
            length: [spline.arc_length().total(); 2],
        }
    }

    /// The greatest displacement, mm.
    pub fn furthest(&self) -> f64 {
        self.moved.iter().map(|(_, way)| way.norm()).fold(0.0, f64::max)
    }
}

/// Sum over all points of the squared jump of the third derivative, by the parameter.
pub fn jump_energy(spline: &CubicSpline) -> f64 {
    spline.third_jumps().iter().map(Vector2::norm_squared).sum()
}

impl Fairing {
    /// Kjellander's method with steps that remove jumps, until no point moves by more than a 250th of the cap
    /// `most_displacement`, mm, in a round.
    pub fn within(most_displacement: f64) -> Self {
        let method = FairingMethod::Kjellander { step: JUMP_REMOVING_STEP };
        Self { method, most_displacement, least_movement: 0.004 * most_displacement }
    }

    /// By a method, no point further than `most_displacement`, mm, nor than twice the noise of the curve: a
    /// smooth one stays. What is published knows nothing of noise.
    pub fn of_noise(method: FairingMethod, most_displacement: f64, spline: &CubicSpline) -> Self {
        let most = match method {
            FairingMethod::Published { .. } => most_displacement,
            _ => most_displacement.min((MOST_NOISE * noise(spline)).max(LEAST_CAP)),
        };
        Self { method, ..Self::within(most) }
    }

    /// Fairs a curve.
    ///
    /// # Errors
    /// Options out of range, and points that the displacement brought together.
    pub fn apply(&self, spline: &CubicSpline) -> Result<Faired, FairingError> {
        self.check()?;
        if let FairingMethod::Published { neighbours } = self.method {
            return published::fair(spline, neighbours, self.most_displacement);
        }
        let relaxation =
            Relaxation::new(self.unknowns(spline)?, spline.points().len(), self.most_displacement);
        let mut faired = Faired { settled: relaxation.is_empty(), ..Faired::unmoved(spline) };
        let mut displacements = vec![Vector2::zeros(); spline.points().len()];
        while !faired.settled && faired.rounds < MOST_ROUNDS {
            let mut state =
                State { displacements: displacements.clone(), jumps: faired.spline.third_jumps() };
            faired.moves += relaxation.round(&mut state);
            faired.rounds += 1;
            let ways =
                state.displacements.iter().zip(&displacements).map(|(after, before)| (after - before).norm());
            let furthest = ways.fold(0.0, f64::max);
            displacements = state.displacements;
            faired.spline = displaced(spline, &displacements)?;
            faired.settled = furthest < self.least_movement;
        }
        faired.length[1] = faired.spline.arc_length().total();
        faired.jump_energy[1] = jump_energy(&faired.spline);
        faired.moved = displacements.into_iter().enumerate().filter(|(_, way)| way.norm() > 0.0).collect();
        Ok(faired)
    }

    fn check(&self) -> Result<(), FairingError> {
        let lengths = [
            ("the greatest displacement", self.most_displacement),
            ("the movement that ends fairing", self.least_movement),
        ];
        if let Some((what, value)) =
            lengths.into_iter().find(|(_, value)| !(value.is_finite() && *value > 0.0))
        {
            return Err(FairingError::Length { what, value });
        }
        match self.method {
            FairingMethod::Kjellander { step } if !(step > 0.0 && step < MOST_STEP) => {
                Err(FairingError::Step(step))
            }
            FairingMethod::Published { neighbours: 0 } => Err(FairingError::NoNeighbours),
            _ => Ok(()),
        }
    }

    fn unknowns(&self, spline: &CubicSpline) -> Result<Vec<Unknown>, FairingError> {
        // Fewer than five points of an open curve are one cubic.
        if !spline.is_closed() && spline.points().len() < 5 {
            return Ok(Vec::new());
        }
        match self.method {
            FairingMethod::Kjellander { step } => kjellander::unknowns(spline, step),
            FairingMethod::ControlPoints => control_points::unknowns(spline),
            FairingMethod::Energy => energy::unknowns(spline),
            FairingMethod::Published { .. } => Ok(Vec::new()),
        }
    }
}

/// The spline with its points displaced, at the same parameters.
fn displaced(spline: &CubicSpline, ways: &[Vector2]) -> Result<CubicSpline, SplineError> {
    let points = spline.points().iter().zip(ways).map(|(point, way)| point + way).collect();
    let make = if spline.is_closed() { CubicSpline::closed } else { CubicSpline::open };
    make(spline.parameters().to_vec(), points)
}
