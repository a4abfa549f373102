//! One move of a tool, and how a place looks from it.

use super::search::{Look, Moving, Sample};
use cutter::Solid;
use geometry::{Point3, Vector3};
use motion::ClPoint;

/// Axes are opposite when this close to it, rad: their common plane is then that of rounding.
const OPPOSITE: f64 = 1e-6;

/// A move made ready: `tip + way t`, `axis cos(turn t) + side sin(turn t)` for t from 0 to 1.
#[derive(Debug, Clone, Copy)]
pub struct Motion {
    pub(super) tip: Point3,
    pub(super) way: Vector3,
    pub(super) axis: Vector3,
    side: Vector3,
    /// Angle between the axes at both ends, rad.
    pub(super) turn: f64,
}

impl Motion {
    /// `None` where the two axes are opposite.
    pub fn new(from: &ClPoint, to: &ClPoint) -> Option<Self> {
        let still = Self {
            tip: from.tip,
            way: to.tip - from.tip,
            axis: from.axis,
            side: Vector3::zeros(),
            turn: 0.0,
        };
        let across = from.axis.cross(&to.axis);
        let (sin, cos) = (across.norm(), from.axis.dot(&to.axis));
        if sin < OPPOSITE && cos < 0.0 {
            return None;
        }
        if sin == 0.0 {
            return Some(still);
        }
        Some(Self { side: (across / sin).cross(&from.axis), turn: sin.atan2(cos), ..still })
    }

    /// Where the tool stands at time `t`.
    #[inline]
    pub fn at(&self, t: f64) -> ClPoint {
        ClPoint { tip: self.tip + self.way * t, axis: self.axis_at(t) }
    }

    #[inline(always)]
    fn axis_at(&self, t: f64) -> Vector3 {
        if self.turn == 0.0 {
            return self.axis;
        }
        let (sin, cos) = (self.turn * t).sin_cos();
        self.axis * cos + self.side * sin
    }

    /// Angular velocity: rad for the whole move.
    pub(super) fn spin(&self) -> Vector3 {
        self.axis.cross(&self.side) * self.turn
    }

    /// Greatest second and third derivative by time of the place `q` as seen from the tool, while t is in
    /// `range`. From the tool it is `Rᵀw` with w = q − tip: its derivatives are `Rᵀ(−v − Ω×w)`,
    /// `Rᵀ(2Ω×v + Ω×(Ω×w))` and `−Rᵀ(3Ω×(Ω×v) + Ω×(Ω×(Ω×w)))`.
    fn bends(&self, q: &Point3, range: [f64; 2]) -> [f64; 2] {
        if self.turn == 0.0 {
            return [0.0; 2];
        }
        let spin = self.spin();
        let arm = range.map(|t| spin.cross(&(q - self.tip - self.way * t)).norm());
        let (arm, pace) = (arm[0].max(arm[1]), spin.cross(&self.way).norm());
        [self.turn * arm + 2.0 * pace, self.turn * (self.turn * arm + 3.0 * pace)]
    }

    /// The distance from one convex piece of the tool.
    pub fn piece<'a>(&'a self, solid: &'a Solid, piece: usize) -> MovingPiece<'a> {
        MovingPiece { motion: self, spin: self.spin(), solid, piece }
    }

    /// The distance from the ball of a ball end, where in all of `range` nothing else of it is nearer to
    /// any of the places: where they stay below its middle.
    pub fn ball<'a>(&'a self, solid: &Solid, places: &[Point3], range: [f64; 2]) -> Option<MovingBall<'a>> {
        let radius = solid.ball()?;
        let duration = range[1] - range[0];
        let axes = range.map(|t| self.axis_at(t));
        let below = |q: &Point3| {
            let height = |k: usize| (q - self.tip - self.way * range[k]).dot(&axes[k]);
            let bulge = 0.125 * self.bends(q, range)[0] * duration * duration;
            height(0).max(height(1)) + bulge < radius
        };
        places.iter().all(below).then_some(MovingBall { motion: self, radius })
    }
}

/// A convex piece of a tool on its way.
#[derive(Clone, Copy)]
pub struct MovingPiece<'a> {
    motion: &'a Motion,
    spin: Vector3,
    solid: &'a Solid,
    piece: usize,
}

impl Moving for MovingPiece<'_> {
    #[inline]
    fn look(&self, q: &Point3, t: f64) -> Look {
        let motion = self.motion;
        let axis = motion.axis_at(t);
        let away = q - motion.tip - motion.way * t;
        let z = away.dot(&axis);
        let outward = away - axis * z;
        let rho = outward.norm();
        let foot = self.solid.piece_foot(self.piece, rho, z);
        // On the axis the mean of both gradients supports the distance as well as either.
        let radial = if rho > 0.0 { foot.gradient[0] / rho } else { 0.0 };
        let gradient = outward * radial + axis * foot.gradient[1];
        let (velocity, bend) = if motion.turn == 0.0 {
            (motion.way, 0.0)
        } else {
            let turning = self.spin.cross(&away);
            (motion.way + turning, gradient.dot(&self.spin.cross(&(motion.way * 2.0 + turning))))
        };
        Look { sample: Sample { t, value: foot.distance, slope: -gradient.dot(&velocity), bend }, gradient }
    }

    fn bends(&self, q: &Point3, range: [f64; 2]) -> [f64; 2] {
        self.motion.bends(q, range)
    }

    fn turn(&self) -> f64 {
        self.motion.turn
    }

    fn pace(&self) -> f64 {
        self.motion.way.norm()
    }
}

/// A ball whose middle runs along with the tool: `tip + r·axis`. How its axis turns is of no account.
#[derive(Clone, Copy)]
pub struct MovingBall<'a> {
    motion: &'a Motion,
    radius: f64,
}

impl Moving for MovingBall<'_> {
    #[inline]
    fn look(&self, q: &Point3, t: f64) -> Look {
        let (m, r) = (self.motion, self.radius);
        let (sin, cos) = if m.turn == 0.0 { (0.0, 1.0) } else { (m.turn * t).sin_cos() };
        let axis = m.axis * cos + m.side * sin;
        let away = q - m.tip - m.way * t - axis * r;
        let size = away.norm();
        let velocity = m.way + (m.side * cos - m.axis * sin) * (r * m.turn);
        // At the middle itself zero supports the distance.
        let gradient = if size > 0.0 { away / size } else { Vector3::zeros() };
        let bend = gradient.dot(&axis) * r * m.turn * m.turn;
        Look { sample: Sample { t, value: size - r, slope: -gradient.dot(&velocity), bend }, gradient }
    }

    fn bends(&self, _: &Point3, _: [f64; 2]) -> [f64; 2] {
        let bend = self.radius * self.motion.turn * self.motion.turn;
        [bend, bend * self.motion.turn]
    }

    fn turn(&self) -> f64 {
        0.0
    }

    fn pace(&self) -> f64 {
        self.motion.way.norm()
    }
}
