//! Planes that bound: one above all heights of a node, one below the cut of a move
//! ([`Sweep::plane`]). mm.

use crate::form::Form;
use crate::sweep::{LocalMove, Sweep};
use crate::track::{Track, larger, smaller};

/// Children of a node, four by four.
pub(super) const CHILDREN: usize = 16;

/// Slack of every bound, mm, against rounding. It costs nothing up to a micrometre; below 1e-12 a
/// move could be left out that is lower than its bound by rounding.
const SLACK: f64 = 1.0e-9;

/// Steepest track along which a cutter is swept by the formulas for vectors. Their error grows with the
/// slope: 1e-12 mm at this one for a ball of 10 mm, and hundreds of times the tolerance on the steepest
/// tracks there are.
const GENTLE: f64 = 100.0;

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

/// A move, as bounds and leaves need it.
pub(super) struct Bound<'a, W> {
    pub form: &'a Form,
    pub track: &'a Track,
    pub sweep: W,
    /// The track, for `sweep`; if it is steep, a level one at its lower end, which cuts nowhere above it.
    pub local: LocalMove<f64>,
    pub steep: bool,
    /// The move ends at the upper end of its track.
    pub rises: bool,
    /// Whether the move before has left nothing to cut where the cutter cuts lowest while it stands at
    /// the lower end of its track, and where it does at the upper end: that at which the move begins.
    done: [bool; 2],
}

impl<'a, W: Sweep<f64>> Bound<'a, W> {
    /// A move that begins at the lower end of its track (`rises`) or at the upper; `first` if no move
    /// brought the cutter there.
    #[inline(always)]
    pub fn new(sweep: W, form: &'a Form, track: &'a Track, rises: bool, first: bool) -> Self {
        let steep = track.slope > GENTLE;
        let local = LocalMove::of(&if steep { Track { slope: 0.0, cos: 1.0, ..*track } } else { *track });
        // A plunge has no start but its upper end, from where it comes.
        let any = !first && !steep && track.length > 0.0;
        Self { form, track, sweep, local, steep, rises, done: [any && rises, any && !rises] }
    }

    /// By how much the cut stays above the ceiling of each of four by four children, at the least:
    /// positive where the move cuts nothing. Their middles are `pitch` apart, the first at `(x, y)`,
    /// and their cells reach `half` from them.
    #[inline(always)]
    pub fn gaps(&self, [x, y]: [f64; 2], pitch: f64, half: f64, ceilings: &Ceilings) -> [f64; CHILDREN] {
        let (m, Track { ux, uy, length, .. }) = (&self.local, *self.track);
        // Also across: a square turned by a right angle is the same.
        let half_along = half * (ux.abs() + uy.abs());
        let reach = self.form.radius + half * std::f64::consts::SQRT_2 + SLACK;
        let mut gaps = [0.0; CHILDREN];
        for k in 0..CHILDREN {
            let (x, y) = (x + (k % 4) as f64 * pitch, y + (k / 4) as f64 * pitch);
            let (along, across) = m.along_across(x, y);
            let beside = along - smaller(larger(along, 0.0), length);
            let nearest = larger(across.abs() - half_along, 0.0);
            let extent = ([along - half_along, along + half_along], [nearest, across.abs() + half_along]);
            let (at_low, at_high) = self.sweep.beyond(m, extent.0, extent.1);
            let missed = (beside * beside + across * across > reach * reach)
                | (at_low & self.done[0])
                | (at_high & self.done[1]);
            let plane = self.sweep.plane(m, along, across);
            let slope_x = plane.along * ux - plane.across * uy - ceilings.slope_x[k];
            let slope_y = plane.along * uy + plane.across * ux - ceilings.slope_y[k];
            let gap = plane.z - ceilings.value[k] - half * (slope_x.abs() + slope_y.abs()) - SLACK;
            gaps[k] = if missed { 1.0 } else { gap };
        }
        gaps
    }
}
