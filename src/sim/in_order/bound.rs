//! Planes that bound: one above all heights of a node, one below the cut of a move. mm.
//!
//! A swept cutter's height is the least over σ of F(σ, p) = z(σ) + f(|p − c(σ)|), and F is convex in
//! (σ, p) together (see [`swept`](crate::sim::swept)). So the tangent of F at any σ₀ and p₀ bounds it
//! from below, and at every p
//!
//! `height(p) >= F(σ₀, p₀) + ∂F/∂p·(p − p₀) + min over σ of ∂F/∂σ·(σ − σ₀)`,
//!
//! a plane in p. It touches the cut where p₀ is the middle of the node and σ₀ the place of the cutter
//! that cuts there; other choices are looser and just as true.

use crate::sim::form::{Family, Form};
use crate::sim::track::{Track, larger, smaller};

/// Children of a node, four by four.
pub(super) const CHILDREN: usize = 16;

/// Slack of every bound, mm, against rounding. It costs nothing up to a micrometre; below 1e-12 a
/// move could be left out that is lower than its bound by rounding.
const SLACK: f64 = 1.0e-9;

/// Points p₀ are drawn towards the axis to this part of the radius, where every profile still has a
/// finite slope. Nearer to 1 the bound is tighter at the rim, and the tangent steeper than rounding of
/// positions allows.
const STEEPEST: f64 = 0.98;

/// Planes above the heights of the children of a node: value at the child's middle, slopes along x
/// and y.
#[derive(Debug, Clone)]
pub(super) struct Ceilings {
    pub value: [f64; CHILDREN],
    pub slope_x: [f64; CHILDREN],
    pub slope_y: [f64; CHILDREN],
}

/// A plane above some heights.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ceiling {
    pub value: f64,
    pub slope: [f64; 2],
}

impl Ceilings {
    /// Nothing stands there.
    pub fn nothing() -> Self {
        let zero = [0.0; CHILDREN];
        Self { value: [f64::NEG_INFINITY; CHILDREN], slope_x: zero, slope_y: zero }
    }

    #[inline(always)]
    pub fn set(&mut self, k: usize, ceiling: Ceiling) {
        self.value[k] = ceiling.value;
        [self.slope_x[k], self.slope_y[k]] = ceiling.slope;
    }

    /// A plane above those of all children, whose middles are `pitch` apart and whose cells reach
    /// `half` from them.
    #[inline(always)]
    pub fn ceiling(&self, pitch: f64, half: f64) -> Ceiling {
        let (mut right, mut up) = (0.0, 0.0);
        for k in 0..CHILDREN {
            right += if k % 4 >= 2 { self.value[k] } else { -self.value[k] };
            up += if k / 4 >= 2 { self.value[k] } else { -self.value[k] };
        }
        // Two pairs of columns, two pitches from pair to pair, eight children each.
        let slope = [right, up].map(|s| s / (16.0 * pitch));
        let slope = if slope[0].is_finite() && slope[1].is_finite() { slope } else { [0.0; 2] };
        let mut tops = [f64::NEG_INFINITY; CHILDREN];
        for k in 0..CHILDREN {
            let (x, y) = ((k % 4) as f64 - 1.5, (k / 4) as f64 - 1.5);
            let turned = (self.slope_x[k] - slope[0]).abs() + (self.slope_y[k] - slope[1]).abs();
            tops[k] = self.value[k] - pitch * (slope[0] * x + slope[1] * y) + half * turned;
        }
        Ceiling { value: tops.into_iter().fold(f64::NEG_INFINITY, larger), slope }
    }
}

/// A move, as bounds need it.
pub(super) struct Bound<'a> {
    pub form: &'a Form,
    pub track: &'a Track,
    /// Where the move before has left nothing to cut: places whose distance along the track, times
    /// the first, is at most the second.
    done: [f64; 2],
}

impl<'a> Bound<'a> {
    /// A move that begins at the upper end of its track (`from_top`) or at the lower; `first` if no
    /// move brought the cutter there.
    ///
    /// Where the cutter cuts lowest while it stands at its start, the move before has cut as low. On
    /// the lower end that is all that lies behind; on the upper all that lies ahead by more than the
    /// ball climbs past (radius times the sine of the rise), or simply ahead on a level track.
    #[inline(always)]
    pub fn new(form: &'a Form, track: &'a Track, from_top: bool, first: bool) -> Self {
        let past = match form.family {
            _ if track.slope == 0.0 => 0.0,
            Family::Ball => form.radius * track.sin(),
            _ => f64::INFINITY,
        };
        // A plunge has no start but its upper end, from where it comes.
        let done = match (first || track.length == 0.0, from_top) {
            (true, _) => [0.0, f64::NEG_INFINITY],
            (false, false) => [1.0, 0.0],
            (false, true) => [-1.0, -(track.length + past)],
        };
        Self { form, track, done }
    }

    /// By how much the cut stays above the ceiling of each of four by four children, at the least:
    /// positive where the move cuts nothing. Their middles are `pitch` apart, the first at `(x, y)`,
    /// and their cells reach `half` from them.
    #[inline(always)]
    pub fn gaps(&self, [x, y]: [f64; 2], pitch: f64, half: f64, ceilings: &Ceilings) -> [f64; CHILDREN] {
        match self.form.family {
            Family::Ball => self.gaps_by([x, y], pitch, half, ceilings, Self::ball_plane),
            Family::Flat => self.gaps_by([x, y], pitch, half, ceilings, Self::level_plane),
            Family::Rounded => self.gaps_by([x, y], pitch, half, ceilings, Self::level_plane),
        }
    }

    #[inline(always)]
    fn gaps_by(
        &self,
        [x, y]: [f64; 2],
        pitch: f64,
        half: f64,
        ceilings: &Ceilings,
        plane: impl Fn(&Self, f64, f64, f64, f64) -> [f64; 3],
    ) -> [f64; CHILDREN] {
        let Track { ux, uy, length, .. } = *self.track;
        let (half_diagonal, half_along) =
            (half * std::f64::consts::SQRT_2 + SLACK, half * (ux.abs() + uy.abs()));
        let reach = self.form.radius + half_diagonal;
        let mut gaps = [0.0; CHILDREN];
        for k in 0..CHILDREN {
            let (x, y) = (x + (k % 4) as f64 * pitch, y + (k / 4) as f64 * pitch);
            let (along, across) = self.track.along_across(x, y);
            let beside = along - smaller(larger(along, 0.0), length);
            let distance_square = beside * beside + across * across;
            let missed = (distance_square > reach * reach)
                | (along * self.done[0] + half_along * self.done[0].abs() <= self.done[1]);
            let [value, by_along, by_across] = plane(self, along, across, distance_square, half_diagonal);
            let slope_x = by_along * ux - by_across * uy - ceilings.slope_x[k];
            let slope_y = by_along * uy + by_across * ux - ceilings.slope_y[k];
            let gap = value - ceilings.value[k] - half * (slope_x.abs() + slope_y.abs()) - SLACK;
            gaps[k] = if missed { 1.0 } else { gap };
        }
        gaps
    }

    /// Value at the middle and slopes along and across the track of the tangent plane of a ball.
    #[inline(always)]
    fn ball_plane(&self, along: f64, across: f64, _: f64, _: f64) -> [f64; 3] {
        let (track, radius) = (self.track, self.form.radius);
        let rim = STEEPEST * radius;
        let w = smaller(larger(across, -rim), rim);
        let half_chord = ((radius - w) * (radius + w)).sqrt();
        let sigma = smaller(larger(along - half_chord * track.sin(), 0.0), track.length);
        let ahead = along - sigma;
        let rho = (ahead * ahead + w * w).sqrt();
        let share = smaller(rim / rho, 1.0);
        let (a, w) = (share * ahead, share * w);
        let depth = (radius * radius - a * a - w * w).sqrt();
        let (by_along, by_across) = (a / depth, w / depth);
        let climb = track.slope - by_along;
        let elsewhere = if climb > 0.0 { -climb * sigma } else { climb * (track.length - sigma) };
        let value = track.tip(sigma)
            + (radius - depth)
            + by_along * (ahead - a)
            + by_across * (across - w)
            + elsewhere;
        [value, by_along, by_across]
    }

    /// A level plane below the cut of any form: the cells lie at least as far from the track as the
    /// middle less the half diagonal, and are reached only from the part of the track that is within a
    /// radius of them, whose lower end is the lowest place of the tip.
    #[inline(always)]
    fn level_plane(&self, along: f64, _: f64, distance_square: f64, half_diagonal: f64) -> [f64; 3] {
        let near = larger(distance_square.sqrt() - half_diagonal, 0.0);
        let first = along - self.form.radius - half_diagonal;
        [self.track.tip(larger(first, 0.0)) + self.form.height(smaller(near, self.form.radius)), 0.0, 0.0]
    }
}
