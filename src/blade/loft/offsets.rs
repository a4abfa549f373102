//! Surfaces through offset sections.
//!
//! Enters: sections and a distance, mm. Leaves: one surface for each stretch between the corners at which
//! offsets are trimmed. Where only some of the sections have a corner, the others are broken at the
//! corresponding place: at the share of the section's length (of the curve that is offset) that lies between
//! those of the corners above and below, or the same as the nearest one. Neighbouring surfaces then share an
//! edge that fades into a smooth line.
//!
//! Offset sections stand `d cos φ` off the surface instead of `d`, however many sections there are; φ is the
//! angle between the surface's normal and the plane of the sections. [`offset::OffsetSurface`] is the true
//! offset.

use super::{LoftError, LoftSection, check, loft};
use crate::loft::Loft;
use geometry::ArcLength;
use offset::{CurveOffset, OffsetPiece, offset_curve};

/// Corners of neighbouring sections that lie farther apart than this share of the length are not the same
/// one.
const SAME_CORNER: f64 = 0.15;

/// Corners of one section nearer to each other than this share of the length are refused: between them would
/// be no stretch.
const APART: f64 = 1e-4;

/// Offsets each section in its own plane by `distance`, mm, positive to the left of its sense, and lofts what
/// is left: one surface for each stretch between corners that any of them has.
///
/// Its true distance from the surface of the sections is `distance · cos φ`, φ the angle between that
/// surface's normal and the sections' plane; the true offset is [`offset::OffsetSurface`].
///
/// # Errors
/// See [`LoftError`].
///
/// # Tolerance
/// Half of `tolerance` goes to the offset curves, half to the loft.
pub fn loft_of_offsets(
    sections: &[LoftSection],
    distance: f64,
    tolerance: f64,
) -> Result<Vec<Loft>, LoftError> {
    check(sections, tolerance)?;
    let half = 0.5 * tolerance;
    let offset = |section: usize, breaks: &[f64]| -> Result<OffsetPiece, LoftError> {
        let LoftSection { curve, height } = sections[section];
        let CurveOffset { mut pieces, .. } = offset_curve(curve, distance, half, breaks)
            .map_err(|source| LoftError::Offset { section, source })?;
        // A ring that is left open has lost what closed it.
        let whole = pieces.len() == 1 && pieces[0].closed == curve.is_closed();
        pieces.pop().filter(|_| whole).ok_or(LoftError::Parted { section, height, pieces: pieces.len() + 1 })
    };
    // The error of the lowest section, whatever the number of threads.
    let all = |breaks: &(dyn Fn(usize) -> Vec<f64> + Sync)| -> Result<Vec<OffsetPiece>, LoftError> {
        work::parallel::map(sections.len(), |k| offset(k, &breaks(k))).into_iter().collect()
    };
    let mut offsets = all(&|_| Vec::new())?;
    let arcs: Vec<ArcLength> = sections.iter().map(|s| s.curve.arc_length()).collect();
    let corners: Vec<Vec<f64>> =
        offsets.iter().zip(&arcs).zip(sections).map(|((o, arc), s)| corner_shares(o, arc, s)).collect();
    let columns = Columns::new(&corners, sections);
    if !columns.places.is_empty() {
        columns.in_order(sections)?;
        let parameter =
            |section: usize, share: f64| arcs[section].parameter_at(share * arcs[section].total());
        if columns.places.iter().flatten().any(|place| !place.found) {
            offsets = all(&|k| columns.missing(k).map(|share| parameter(k, share)).collect())?;
        }
        for (k, offset) in offsets.iter_mut().enumerate() {
            columns.align(offset, &corner_shares(offset, &arcs[k], &sections[k]), k, &sections[k])?;
        }
    }
    let surface = |k: usize| {
        let moved = offsets.iter().zip(sections);
        let moved: Vec<LoftSection> =
            moved.map(|(o, s)| LoftSection { curve: &o.stretches[k], height: s.height }).collect();
        loft(&moved, half)
    };
    (0..offsets[0].stretches.len()).map(surface).collect()
}

/// Where the corners after each stretch lie, as shares of the length of the section's curve; on closed ones
/// from 0 to 1.
fn corner_shares(offset: &OffsetPiece, arc: &ArcLength, section: &LoftSection) -> Vec<f64> {
    if offset.stretches.iter().any(|s| s.is_closed()) {
        return Vec::new();
    }
    let [start, end] = section.curve.domain();
    let next = offset.sources.iter().skip(1).map(|range| range[0]);
    let around = offset.sources.first().filter(|_| offset.closed).map(|range| range[0] + (end - start));
    let share = |(range, next): (&[f64; 2], f64)| {
        // The last corner of a ring may lie beyond the end of the period.
        let next = if next < range[1] { next + (end - start) } else { next };
        let middle = 0.5 * (range[1] + next);
        let within =
            if section.curve.is_closed() { start + (middle - start).rem_euclid(end - start) } else { middle };
        arc.at(within) / arc.total()
    };
    offset.sources.iter().zip(next.chain(around)).map(share).collect()
}

/// A corner, or what corresponds to it, on one section.
#[derive(Clone, Copy)]
struct CornerPlace {
    /// Share of the length; on closed sections counted on over the start.
    share: f64,
    /// Whether the offset has a corner there.
    found: bool,
}

/// Corners that correspond to each other across all sections.
struct Columns {
    /// `[column][section]`, along the sections.
    places: Vec<Vec<CornerPlace>>,
    closed: bool,
}

impl Columns {
    fn new(corners: &[Vec<f64>], sections: &[LoftSection]) -> Self {
        let closed = sections[0].curve.is_closed();
        let mut columns: Vec<Vec<Option<f64>>> = Vec::new();
        for (section, shares) in corners.iter().enumerate() {
            // The nearest pairs first.
            let mut pairs: Vec<(f64, usize, usize, f64)> = Vec::new();
            for (c, column) in columns.iter().enumerate() {
                let Some(last) = column.iter().rev().find_map(|share| *share) else { continue };
                for (k, &share) in shares.iter().enumerate() {
                    let near = if closed { share + (last - share).round() } else { share };
                    let apart = (near - last).abs();
                    if apart <= SAME_CORNER {
                        pairs.push((apart, c, k, near));
                    }
                }
            }
            pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
            let mut taken = vec![false; shares.len()];
            columns.iter_mut().for_each(|column| column.push(None));
            for (_, c, k, near) in pairs {
                if !taken[k] && columns[c][section].is_none() {
                    (taken[k], columns[c][section]) = (true, Some(near));
                }
            }
            for (&share, _) in shares.iter().zip(taken).filter(|(_, taken)| !taken) {
                let mut column = vec![None; section];
                column.push(Some(share));
                columns.push(column);
            }
        }
        let heights: Vec<f64> = sections.iter().map(|s| s.height).collect();
        let mut places: Vec<Vec<CornerPlace>> =
            columns.iter().map(|column| filled(column, &heights)).collect();
        places.sort_by(|a, b| a[0].share.total_cmp(&b[0].share));
        Self { places, closed }
    }

    /// Refuses columns that cross or come together.
    fn in_order(&self, sections: &[LoftSection]) -> Result<(), LoftError> {
        for (section, s) in sections.iter().enumerate() {
            let shares: Vec<f64> = self.places.iter().map(|column| column[section].share).collect();
            let mut gaps: Vec<f64> = shares.windows(2).map(|w| w[1] - w[0]).collect();
            let (first, last) = (shares[0], shares[shares.len() - 1]);
            if self.closed {
                gaps.push(first + 1.0 - last);
            } else {
                gaps.extend([first, 1.0 - last]);
            }
            if gaps.iter().any(|gap| *gap < APART) {
                return Err(self.refused(
                    section,
                    s,
                    self.places.iter().filter(|c| c[section].found).count(),
                ));
            }
        }
        Ok(())
    }

    fn refused(&self, section: usize, s: &LoftSection, corners: usize) -> LoftError {
        let open = usize::from(!self.closed);
        let (found, expected) = (corners + open, self.places.len() + open);
        LoftError::Corners { section, height: s.height, found, expected }
    }

    /// Shares at which a section is to be broken.
    fn missing(&self, section: usize) -> impl Iterator<Item = f64> + '_ {
        let places = self.places.iter().map(move |column| column[section]).filter(|place| !place.found);
        places.map(|place| if self.closed { place.share.rem_euclid(1.0) } else { place.share })
    }

    /// Lets the stretches of a ring begin at the first column. `corners` are those after each stretch.
    fn align(
        &self,
        offset: &mut OffsetPiece,
        corners: &[f64],
        section: usize,
        s: &LoftSection,
    ) -> Result<(), LoftError> {
        if corners.len() != self.places.len() {
            return Err(self.refused(section, s, corners.len()));
        }
        if self.closed {
            let wanted = self.places[0][section].share;
            let apart = |share: f64| (share - wanted - (share - wanted).round()).abs();
            let nearest = (0..corners.len()).min_by(|a, b| apart(corners[*a]).total_cmp(&apart(corners[*b])));
            let first = nearest.map_or(0, |k| (k + 1) % corners.len());
            offset.stretches.rotate_left(first);
            offset.sources.rotate_left(first);
        }
        Ok(())
    }
}

/// A column with a place on every section: between two corners by height, beyond them as the nearest.
fn filled(column: &[Option<f64>], heights: &[f64]) -> Vec<CornerPlace> {
    let known = |k: &usize| column[*k].map(|share| (heights[*k], share));
    let at = |section: usize| -> CornerPlace {
        if let Some(share) = column[section] {
            return CornerPlace { share, found: true };
        }
        let below = (0..section).rev().find_map(|k| known(&k));
        let above = (section + 1..column.len()).find_map(|k| known(&k));
        let share = match (below, above) {
            (Some((z0, a)), Some((z1, b))) => a + (b - a) * (heights[section] - z0) / (z1 - z0),
            (Some((_, share)), None) | (None, Some((_, share))) => share,
            (None, None) => 0.5,
        };
        CornerPlace { share, found: false }
    };
    (0..column.len()).map(at).collect()
}
