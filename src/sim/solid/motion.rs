//! One move of a tool, and how a place looks from it.

use super::search::{Curve, Sample};
use crate::cutter::Solid;
use crate::geometry::{Point3, Vector3};
use crate::toolpath::ClPoint;

/// Axes are opposite when this close to it, rad: their common plane is then that of rounding.
const OPPOSITE: f64 = 1e-6;

/// A move made ready: `tip + way t`, `axis cos(turn t) + side sin(turn t)` for t from 0 to 1.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Motion {
    pub(super) tip: Point3,
    pub(super) way: Vector3,
    pub(super) axis: Vector3,
    side: Vector3,
    /// Angle between the axes at both ends, rad.
    pub(super) turn: f64,
}

impl Motion {
    /// `None` where the two axes are opposite.
    pub(crate) fn new(from: &ClPoint, to: &ClPoint) -> Option<Self> {
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
    pub(crate) fn at(&self, t: f64) -> ClPoint {
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

    /// The distance of `q` from one convex piece of the tool.
    pub(super) fn seen<'a>(&'a self, solid: &'a Solid, piece: usize, q: &'a Point3) -> Seen<'a> {
        Seen { motion: self, spin: self.spin(), solid, piece, q }
    }

    /// The distance of `q` from the ball of a ball end, where in all of `range` nothing else of it is
    /// nearer: below its middle.
    pub(super) fn ball_track<'a>(
        &'a self,
        solid: &Solid,
        q: &'a Point3,
        range: [f64; 2],
    ) -> Option<BallTrack<'a>> {
        let radius = solid.ball()?;
        let heights = range.map(|t| (q - self.tip - self.way * t).dot(&self.axis_at(t)));
        let duration = range[1] - range[0];
        let bulge = 0.125 * self.bends(q, range)[0] * duration * duration;
        let below = heights[0].max(heights[1]) + bulge < radius;
        below.then_some(BallTrack { motion: self, radius, q })
    }
}

/// A place seen from a tool that stands still, by its distance from a convex piece.
pub(super) struct Seen<'a> {
    motion: &'a Motion,
    spin: Vector3,
    solid: &'a Solid,
    piece: usize,
    q: &'a Point3,
}

impl Curve for Seen<'_> {
    #[inline]
    fn sample(&self, t: f64) -> Sample {
        let axis = self.motion.axis_at(t);
        let away = self.q - self.motion.tip - self.motion.way * t;
        let z = away.dot(&axis);
        let outward = away - axis * z;
        let rho = outward.norm();
        let foot = self.solid.piece_foot(self.piece, rho, z);
        // On the axis the mean of both gradients supports the distance as well as either.
        let radial = if rho > 0.0 { foot.gradient[0] / rho } else { 0.0 };
        let gradient = outward * radial + axis * foot.gradient[1];
        let turning = self.spin.cross(&away);
        let bend = self.spin.cross(&(self.motion.way * 2.0 + turning));
        Sample {
            t,
            value: foot.distance,
            slope: -gradient.dot(&(self.motion.way + turning)),
            bend: gradient.dot(&bend),
        }
    }

    fn bends(&self, range: [f64; 2]) -> [f64; 2] {
        self.motion.bends(self.q, range)
    }
}

/// The distance from a ball whose middle runs along with the tool: `tip + r·axis`.
pub(super) struct BallTrack<'a> {
    motion: &'a Motion,
    radius: f64,
    q: &'a Point3,
}

impl Curve for BallTrack<'_> {
    #[inline]
    fn sample(&self, t: f64) -> Sample {
        let (m, r) = (self.motion, self.radius);
        let (sin, cos) = (m.turn * t).sin_cos();
        let axis = m.axis * cos + m.side * sin;
        let away = self.q - m.tip - m.way * t - axis * r;
        let size = away.norm();
        let velocity = m.way + (m.side * cos - m.axis * sin) * (r * m.turn);
        // At the middle itself zero supports the distance.
        let toward = if size > 0.0 { away / size } else { Vector3::zeros() };
        Sample {
            t,
            value: size - r,
            slope: -toward.dot(&velocity),
            bend: toward.dot(&axis) * r * m.turn * m.turn,
        }
    }

    fn bends(&self, _: [f64; 2]) -> [f64; 2] {
        let bend = self.radius * self.motion.turn * self.motion.turn;
        [bend, bend * self.motion.turn]
    }
}
