//! The lower envelope of chosen moves at single points, for those who measure between cells.

use super::form::{Family, Form};
use super::swept::{ball_height, swept_height, swept_height_and_normal};
use super::track::Track;
use geometry::Vector3;
use motion::{Cutters, Toolpath};
use work::parallel;

/// All moves of a path, ready to be evaluated one by one: 64 bytes a move. mm.
///
/// # Tolerance
/// Ball and flat end: closed form. Bull nose and taper: closed form on disc and cone; on the arc
/// (a torus) a safeguarded Newton iteration to the last bits of f64. The result is that of a
/// distance from the axis that is wrong by a few units in the last place: below 1e-12 mm where the
/// profile is gentle, up to 1e-7 mm at the very rim, where any profile with a corner radius is
/// vertical and the distance itself is not known better.
#[derive(Debug, Clone)]
pub struct Envelope {
    /// The first moves of the cutters, and their profiles.
    forms: Vec<(u32, Form)>,
    tracks: Vec<Track>,
}

impl Envelope {
    /// Prepares every move of `path`.
    pub fn new(cutters: impl Into<Cutters>, path: &Toolpath) -> Self {
        let tracks = parallel::map(path.len(), |k| Track::new(path.start_of(k), path.moves[k].to.tip));
        let cutters: Cutters = cutters.into();
        let forms = cutters.each().map(|(first, cutter)| (first, Form::new(cutter))).collect();
        Self { forms, tracks }
    }

    /// The profile that makes a move.
    #[inline]
    fn form(&self, index: u32) -> &Form {
        match &self.forms[..] {
            [(_, only)] => only,
            forms => &forms[forms.partition_point(|(first, _)| *first <= index).max(1) - 1].1,
        }
    }

    /// The lowest cut at `(x, y)` among the moves `candidates` (indices into the path's moves) and
    /// the move that makes it, the least index of equals; `None` where none of them passes. The
    /// order of the candidates is of no account.
    pub fn lowest(&self, x: f64, y: f64, candidates: &[u32]) -> Option<(f64, u32)> {
        match &self.forms[..] {
            [(_, form)] if form.family == Family::Ball => self.lowest_by(candidates, |_, track| {
                let (along, across) = track.along_across(x, y);
                ball_height(track, form.radius, along, across)
            }),
            [(_, form)] => self.lowest_by(candidates, |_, track| swept_height(form, track, x, y)),
            _ => self.lowest_by(candidates, |k, track| swept_height(self.form(k), track, x, y)),
        }
    }

    #[inline(always)]
    fn lowest_by(&self, candidates: &[u32], height: impl Fn(u32, &Track) -> f64) -> Option<(f64, u32)> {
        let mut best = (f64::INFINITY, u32::MAX);
        for &k in candidates {
            let h = height(k, &self.tracks[k as usize]);
            if h < best.0 || (h == best.0 && k < best.1) {
                best = (h, k);
            }
        }
        (best.0 < f64::INFINITY).then_some(best)
    }

    /// Height of the cut of move `index` at `(x, y)`; `None` where it does not pass.
    pub fn height(&self, index: u32, x: f64, y: f64) -> Option<f64> {
        let height = swept_height(self.form(index), &self.tracks[index as usize], x, y);
        (height < f64::INFINITY).then_some(height)
    }

    /// As [`Envelope::height`], with the unit normal (up) of the cut.
    pub fn height_and_normal(&self, index: u32, x: f64, y: f64) -> Option<(f64, Vector3)> {
        swept_height_and_normal(self.form(index), &self.tracks[index as usize], x, y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenes::{Rng, cutters, random_path};
    use crate::swept::tests::SweptMove;
    use cutter::Cutter;
    use geometry::Point3;

    #[test]
    fn the_envelope_is_the_lowest_of_the_swept_moves() {
        let mut rng = Rng::new(7);
        for cutter in cutters() {
            let path = random_path(&mut rng, 60, 8.0);
            let envelope = Envelope::new(cutter, &path);
            let moves: Vec<SweptMove> =
                path.segments().map(|(a, b, _)| SweptMove::new(&cutter, a, b)).collect();
            let backwards: Vec<u32> = (0..60).rev().collect();
            for _ in 0..300 {
                let (x, y) = (rng.within(-2.0, 10.0), rng.within(-2.0, 10.0));
                let mut expected: Option<(f64, u32)> = None;
                for (k, m) in moves.iter().enumerate() {
                    assert_eq!(m.height(x, y), envelope.height(k as u32, x, y));
                    assert_eq!(m.height_and_normal(x, y), envelope.height_and_normal(k as u32, x, y));
                    if let Some(h) = m.height(x, y).filter(|h| expected.is_none_or(|e| *h < e.0)) {
                        expected = Some((h, k as u32));
                    }
                }
                assert_eq!(envelope.lowest(x, y, &backwards), expected);
            }
            assert_eq!(envelope.lowest(0.0, 0.0, &[]), None);
        }
    }

    #[test]
    fn of_equal_moves_the_first_wins() {
        let cutter = Cutter::flat(6.0).unwrap();
        let path = crate::scenes::path_through([0.0, 1.0, 2.0].map(|x| Point3::new(x, 0.0, 0.0)));
        assert_eq!(Envelope::new(cutter, &path).lowest(1.0, 0.5, &[1, 0]), Some((0.0, 0)));
    }
}
