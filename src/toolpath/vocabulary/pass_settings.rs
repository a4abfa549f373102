//! What every pass needs to know besides part and cutter.

use super::{Correction, Earlier, Faces, Step};
use crate::moves::chord::{Watch, reduce, sample_over_jumps, sample_within_chord};
use crate::moves::smooth::smooth_and_spread;
use cutter::Cutter;
use drop_cutter::DropCutter;
use geometry::Point3;
use motion::ToolAxis;
use work::monitor::{Cancelled, Monitor};

/// First sampling distance along a pass as a share of the cutter's radius: features narrower than
/// that could hide between two samples of a pass.
pub(crate) const SAMPLING_OVER_RADIUS: f64 = 0.15;

/// First samples over a jump, as a share of it: none is longer than the cutter is wide.
const STEP_OF_JUMP: f64 = 0.5 * SAMPLING_OVER_RADIUS;

/// Of plans that are compared, one with the other, chords are this many times as far off as may be: they take
/// as long, nearly, and are made sooner.
pub(crate) const COMPARED_CHORDS: f64 = 4.0;

/// Shares of the chord tolerance that sampling and point reduction may use. Together they leave a part of it:
/// ridges stand between chords of two passes, and passes lie the closer the more chords may raise them.
const SAMPLING_SHARE: f64 = 0.1;
const REDUCTION_SHARE: f64 = 0.4;

/// Where passes are spaced for a scallop, smoothing takes this share of the chord tolerance. With all of it
/// there are 15 % fewer points, but 2 % of the ridges of a saddle stand over the target.
const SMOOTHED_SHARE: f64 = 0.78;

/// What a chord tolerance has left after sampling and point reduction, or smoothing, mm: by so much may
/// points go deeper.
pub fn unused_tolerance(chord_tolerance: f64, is_smoothed: bool) -> f64 {
    let share = if is_smoothed { SMOOTHED_SHARE * (1.0 - SAMPLING_SHARE) } else { REDUCTION_SHARE };
    (1.0 - SAMPLING_SHARE - share) * chord_tolerance
}

/// What the width of a strip goes by besides cutter and surface.
#[derive(Debug, Clone, Copy, Default)]
pub struct Guide<'a> {
    /// How the cutter is tilted; upright without it.
    pub axis: Option<&'a ToolAxis>,
    /// The factor of every width that is planned by a scallop height; 1 without it.
    pub correction: Option<&'a Correction>,
}

impl Guide<'_> {
    /// A width planned by calculation, with the correction of the place.
    pub fn corrected(&self, width: f64, at: &Point3, step: Step) -> f64 {
        match (step, self.correction) {
            (Step::Scallop(_), Some(correction)) => width * correction.at(at),
            _ => width,
        }
    }
}

/// What every pass needs.
#[derive(Debug, Clone, Copy)]
pub struct PassSettings<'a> {
    /// Distance of passes, already less what the chords may add.
    pub step: Step,
    /// First sampling distance along a pass, mm.
    pub sampling: f64,
    /// Chord tolerance, mm.
    pub chord_tolerance: f64,
    /// The sampling distance, mm, by which passes are smoothed; `None` leaves them as they are.
    pub smoothing: Option<f64>,
    /// How the cutter is tilted; upright without it.
    pub axis: Option<&'a ToolAxis>,
    /// Which faces are to have passes: steps are what these allow.
    pub faces: Faces,
    /// What tables may take, bytes.
    pub memory: u64,
    /// What an earlier plan left.
    pub earlier: Option<&'a Earlier>,
    /// The ball that is dropped in its stead where a tilted cutter, no ball itself, is located by the
    /// contacts of that.
    pub probe: Option<&'a Cutter>,
}

impl<'a> PassSettings<'a> {
    /// Those of most tests: an upright cutter on all faces, chords of a micrometre.
    #[cfg(test)]
    pub const fn upright(step: Step, sampling: f64) -> Self {
        Self {
            step,
            sampling,
            chord_tolerance: 1e-3,
            smoothing: None,
            axis: None,
            faces: Faces::ALL,
            memory: 1 << 30,
            earlier: None,
            probe: None,
        }
    }

    /// What widths of strips go by.
    pub fn guide(&self) -> Guide<'a> {
        Guide { axis: self.axis, correction: self.earlier.map(|earlier| &earlier.correction) }
    }

    /// The cutter that is dropped.
    pub fn dropped<'b>(&self, cutter: &'b Cutter) -> &'b Cutter
    where
        'a: 'b,
    {
        self.probe.unwrap_or(cutter)
    }

    /// Straight moves along `locate` over `[s0, s1]` within the chord tolerance.
    ///
    /// # Errors
    /// [`Cancelled`] when the monitor says so, which is asked every few hundred places.
    pub fn moves(
        &self,
        s0: f64,
        s1: f64,
        locate: &mut dyn FnMut(f64) -> Option<Point3>,
        monitor: &dyn Monitor,
    ) -> Result<Vec<Point3>, Cancelled> {
        let fine = SAMPLING_SHARE * self.chord_tolerance;
        let mut watch = Watch::new(monitor);
        let points = sample_within_chord(s0, s1, self.sampling, fine, locate, &mut watch)?;
        self.reduced(&points, &mut watch)
    }

    /// As [`Self::moves`] of a cutter that is located by where it touches: at a kink of the surface its tip
    /// jumps, and is carried from one side to the other by being dropped along the way.
    ///
    /// # Errors
    /// As [`Self::moves`].
    pub fn moves_by_contacts(
        &self,
        [s0, s1]: [f64; 2],
        locate: &mut dyn FnMut(f64) -> Option<Point3>,
        drop: &DropCutter<'_>,
        monitor: &dyn Monitor,
    ) -> Result<Vec<Point3>, Cancelled> {
        let fine = SAMPLING_SHARE * self.chord_tolerance;
        let mut watch = Watch::new(monitor);
        let mut across = |a: &Point3, b: &Point3, watch: &mut Watch<'_>| {
            let mut dropped = |t: f64| {
                let at = a + (b - a) * t;
                // Beside the part nothing is in the way.
                Some(drop.at(at.x, at.y).map_or(at, |drop| Point3::new(at.x, at.y, drop.tip_z)))
            };
            let mut way = sample_within_chord(0.0, 1.0, STEP_OF_JUMP, fine, &mut dropped, watch)?;
            way.pop();
            Ok(way.into_iter().skip(1).collect())
        };
        let points = sample_over_jumps(s0, s1, self.sampling, fine, locate, &mut across, &mut watch)?;
        self.reduced(&points, &mut watch)
    }

    /// The points that moves within the chord tolerance need of samples.
    fn reduced(&self, points: &[Point3], watch: &mut Watch<'_>) -> Result<Vec<Point3>, Cancelled> {
        let fine = SAMPLING_SHARE * self.chord_tolerance;
        let mut moves = match self.smoothing {
            Some(sampling) => {
                let share = if let Step::Scallop(_) = self.step { SMOOTHED_SHARE } else { 1.0 };
                smooth_and_spread(points, sampling, share * (self.chord_tolerance - fine), watch)
            }
            None => reduce(points, REDUCTION_SHARE * self.chord_tolerance, watch),
        }?;
        // Thousands of passes are kept, each of far fewer places than were sampled.
        moves.shrink_to_fit();
        Ok(moves)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cutter::Cutter;
    use geometry::TriangleMesh;
    use part::Part;
    use work::monitor::Silent;

    /// A flat end goes around the corner of a block, for a while over nothing, and down to a floor beside it:
    /// it leaves the corner before it goes down, however far the floor is.
    #[test]
    fn no_ramp_leads_past_a_corner() {
        let quad = |[x0, x1]: [f64; 2], z: f64| {
            [[x0, -5.0], [x1, -5.0], [x1, 0.0], [x0, 0.0]].map(|[x, y]| Point3::new(x, y, z))
        };
        let corners: Vec<Point3> = [quad([-5.0, 0.0], 8.0), quad([0.5, 5.0], 2.0)].concat();
        let triangles = vec![[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]];
        let part = Part::from_mesh(TriangleMesh::new(corners, triangles).unwrap().0);
        let cutter = Cutter::flat(4.0).unwrap();
        let drop = DropCutter::new(&part, &cutter);
        // The corner is two millimetres from the axis until x = 0.2, the floor's from x = 0.3 on.
        let y = (4.0f64 - 0.04).sqrt();
        let mut tip = |s: f64| {
            let x = 0.27 * s - 0.1;
            drop.at(x, y).map(|drop| Point3::new(x, y, drop.tip_z))
        };
        assert!(tip(1.2).is_none() && tip(1.0).is_some() && tip(2.0).is_some());
        let settings = PassSettings::upright(Step::Stepover(0.5), 1.0);
        let moves = settings.moves_by_contacts([0.0, 3.0], &mut tip, &drop, &Silent).unwrap();
        let lowest_at_corner = moves
            .windows(2)
            .filter(|w| (w[1].x.min(w[0].x)) < 0.2 - 1e-3)
            .map(|w| {
                // Where the move leaves the corner.
                let t = ((0.2 - w[0].x) / (w[1].x - w[0].x)).clamp(0.0, 1.0);
                w[0].z + (w[1].z - w[0].z) * t
            })
            .fold(f64::INFINITY, f64::min);
        assert!(lowest_at_corner > 8.0 - 1e-3, "{lowest_at_corner} {moves:?}");
    }
}
