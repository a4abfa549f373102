//! Open polylines joined to closed ones where their ends meet within [`JOIN_TOLERANCE`].

use super::{Chords, Drawn, JOIN_TOLERANCE, OutlineError, ROUNDING};
use geometry::{Point2, Region, RegionError};

fn gap(a: &Point2, b: &Point2) -> f64 {
    (a - b).norm()
}

impl Chords {
    /// Without points that repeat the one before, and closed where its ends meet. What that moves is in the
    /// bound.
    pub fn tidy(&mut self) {
        let mut moved = 0.0f64;
        self.points.dedup_by(|next, kept| {
            let between = gap(next, kept);
            moved = if between <= ROUNDING { moved.max(between) } else { moved };
            between <= ROUNDING
        });
        let is_repeated = |chords: &Self| {
            let within = if chords.closed { ROUNDING } else { JOIN_TOLERANCE };
            let between = gap(&chords.points[0], &chords.points[chords.points.len() - 1]);
            Some(between).filter(|between| *between <= within)
        };
        while self.points.len() > 3
            && let Some(between) = is_repeated(self)
        {
            self.points.pop();
            self.closed = true;
            moved = moved.max(between);
        }
        self.off_curve += moved;
    }

    /// Closes at its first point what is drawn as closed, and whose last point, near the first one, makes it
    /// cross itself. How far that was off, mm, which is in the bound; `None` where nothing is wrong.
    pub fn close_at_first(&mut self) -> Option<f64> {
        let gap_of = |points: &[Point2]| gap(&points[0], &points[points.len() - 1]);
        let mut moved = None;
        while self.closed && self.points.len() > 3 && gap_of(&self.points) <= JOIN_TOLERANCE {
            let crossing = Region::nested(vec![self.points.clone()]);
            let Err(RegionError::SelfCrossing { .. }) = crossing else { break };
            moved = Some(gap_of(&self.points).max(moved.unwrap_or(0.0)));
            self.points.pop();
        }
        self.off_curve += moved.unwrap_or(0.0);
        moved
    }
}

/// All as closed outlines.
///
/// # Errors
/// [`OutlineError`] where an end meets no other, with its place and the nearest other end.
pub fn join(drawn: Vec<Drawn>, notes: &mut Vec<String>) -> Result<Vec<Drawn>, OutlineError> {
    let mut closed = Vec::new();
    let mut open: Vec<Drawn> = Vec::new();
    let (mut crossing, mut farthest) = (0usize, 0.0f64);
    for mut d in drawn {
        d.chords.tidy();
        if let Some(off) = d.chords.close_at_first() {
            (crossing, farthest) = (crossing + 1, farthest.max(off));
        }
        match (d.chords.closed, d.chords.points.len()) {
            (true, _) => closed.push(d),
            (false, 0 | 1) => notes.push(format!("{} has no length and is left out", d.name())),
            (false, _) => open.push(d),
        }
    }
    if crossing > 0 {
        notes.push(format!(
            "closed outlines whose last point crosses beside the first one, closed at that: {crossing}, by up to {farthest:.4} mm"
        ));
    }
    let (mut joined, mut widest) = (0usize, 0.0f64);
    while let Some(mut chain) = (!open.is_empty()).then(|| open.remove(0)) {
        let first = chain.chords.points[0];
        // The end of one piece moves to that of the other, and its chord with it.
        let mut moved = 0.0f64;
        loop {
            let end = chain.chords.points[chain.chords.points.len() - 1];
            // Of all ends within the tolerance the nearest; its own beginning closes the chain.
            let ends = open.iter().enumerate().flat_map(|(k, d)| {
                [
                    (gap(&end, &d.chords.points[0]), k, false),
                    (gap(&end, &d.chords.points[d.chords.points.len() - 1]), k, true),
                ]
            });
            let next = ends.fold(None, |best: Option<(f64, usize, bool)>, e| match best {
                Some(b) if b.0 <= e.0 => Some(b),
                _ => Some(e),
            });
            let to_first = gap(&end, &first);
            let near = next.filter(|n| n.0 <= JOIN_TOLERANCE);
            if chain.chords.points.len() > 2
                && to_first <= JOIN_TOLERANCE
                && near.is_none_or(|n| to_first <= n.0)
            {
                widest = widest.max(to_first);
                moved = moved.max(to_first);
                chain.chords.points.pop();
                chain.chords.closed = true;
                break;
            }
            let Some((distance, k, backwards)) = near else {
                let nearest = next.map_or_else(
                    || format!("its other end is {to_first:.4} mm away"),
                    |n| {
                        let at = if n.2 {
                            open[n.1].chords.points[open[n.1].chords.points.len() - 1]
                        } else {
                            open[n.1].chords.points[0]
                        };
                        if n.0 < to_first {
                            format!(
                                "the nearest other end, of {} at x {:.4} y {:.4}, is {:.4} mm away",
                                open[n.1].name(),
                                at.x,
                                at.y,
                                n.0
                            )
                        } else {
                            format!(
                                "its other end, at x {:.4} y {:.4}, is {to_first:.4} mm away",
                                first.x, first.y
                            )
                        }
                    },
                );
                return Err(OutlineError::at(
                    chain.line,
                    format!(
                        "{}: the outline is open at x {:.4} y {:.4}; {nearest}, and ends within {JOIN_TOLERANCE} mm are joined",
                        chain.entity, end.x, end.y
                    ),
                ));
            };
            let mut piece = open.remove(k).chords;
            if backwards {
                piece.points.reverse();
            }
            (joined, widest, moved) = (joined + 1, widest.max(distance), moved.max(distance));
            chain.chords.off_curve = chain.chords.off_curve.max(piece.off_curve);
            chain.chords.points.extend(piece.points.into_iter().skip(1));
        }
        chain.chords.off_curve += moved;
        closed.push(chain);
    }
    if widest > ROUNDING {
        notes.push(format!("{joined} open pieces of outlines were joined over gaps of up to {widest:.4} mm"));
    }
    Ok(closed)
}
