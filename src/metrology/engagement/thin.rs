//! Ground that lies whole in other ground is left out: loops and passes over cleared ground are most of a long
//! path.
//!
//! Enters: what a path sweeps, and the move that comes next. Leaves: the same without segments whose stadium
//! others surely cover; mm. A place of the rim that none of them covers is kept of each segment that stays:
//! only what comes later may cover it.

use std::ops::Range;

use geometry::{RimSamples, Vector2};

use super::{BLOCK, SHORT, Segment, Swept, square_distance};

impl Swept<'_> {
    /// Leaves out segments that lie whole in others: those of both that no place of move `from` or later may
    /// find fresh. Every angle, and every bound of a stretch, stays the same. Looks at those in buckets with
    /// twice as many as it left there.
    pub(super) fn thin(&mut self, from: usize) {
        /// Fewer are no matter.
        const FEW: usize = 24;
        let before = self.segments[from].gone[0] - self.fresh;
        let settled =
            self.settled + self.segments[self.settled..from].partition_point(|s| s.gone[1] < before);
        self.settled = settled;
        let settled_in = |bucket: &Vec<u32>| bucket.partition_point(|&k| (k as usize) < settled);
        let full: Vec<usize> = (0..self.buckets.len())
            .filter(|&at| settled_in(&self.buckets[at]) >= 2 * self.left[at] + FEW)
            .collect();
        let mut looked_at: Vec<u32> =
            full.iter().flat_map(|&at| &self.buckets[at][..settled_in(&self.buckets[at])]).copied().collect();
        looked_at.sort_unstable();
        looked_at.dedup();
        let mut hint = None;
        for k in looked_at {
            let Segment { ends, .. } = self.segments[k as usize];
            if (ends[1] - ends[0]).norm() > SHORT * self.radius {
                continue;
            }
            let bare = self.first_bare(k, hint);
            hint = bare.or(hint);
            self.bare[k as usize] = bare.map(|bare| (settled as u32, bare));
            if bare.is_none() {
                for at in self.buckets_of(ends) {
                    self.buckets[at].retain(|&other| other != k);
                }
            }
        }
        for at in full {
            self.left[at] = settled_in(&self.buckets[at]);
        }
    }

    /// A place of the rim of a settled segment, from its middle, that no other one surely covers which went as
    /// deep. What was bare before is only covered by what was settled since. For one that was not looked at
    /// yet the place of another one beside it is the `hint`.
    fn first_bare(&self, k: u32, hint: Option<Vector2>) -> Option<Vector2> {
        let radius = (1.0 + self.film) * self.radius;
        let within = (radius * (1.0 - RimSamples::MARGIN)).powi(2);
        let Segment { ends: [a, b], z, .. } = self.segments[k as usize];
        let middle = a + 0.5 * (b - a);
        let ends = [a, b].map(|p| p - middle);
        let holds = |ends: &[Vector2; 2]| square_distance(&Vector2::zeros(), ends) <= within;
        let covers = |ends: &[Vector2; 2], p: &Vector2| square_distance(p, ends) <= within;
        let of_hint = |hint: Vector2| {
            let out = hint.try_normalize(0.0)?;
            Some((0, if out.dot(&ends[1]) > 0.0 { ends[1] } else { ends[0] } + out * radius))
        };
        let known = self.bare[k as usize].or_else(|| hint.and_then(of_hint));
        let (mut is_twice, mut is_bare) = (false, known.is_some());
        if let Some((since, place)) = known {
            self.each_near(&middle, radius, since as usize, |other| {
                if other >= self.settled {
                    return false;
                }
                let segment = &self.segments[other];
                if other != k as usize && segment.z <= z {
                    let others = segment.ends.map(|p| p - middle);
                    is_twice |= segment.ends == [a, b];
                    is_bare &= !(holds(&others) && covers(&others, &place));
                }
                is_bare && !is_twice
            });
            if is_twice {
                return None;
            }
            if is_bare {
                return Some(place);
            }
        }
        let bare_beside = |others: Range<usize>| {
            let mut near = Vec::new();
            self.each_near(&middle, radius, others.start, |other| {
                if other >= others.end {
                    return false;
                }
                let segment = &self.segments[other];
                let ends = segment.ends.map(|p| p - middle);
                if other != k as usize && segment.z <= z && holds(&ends) {
                    near.push(ends);
                }
                true
            });
            self.rim.first_bare(ends, radius, &mut near, covers)
        };
        // Mostly what comes soon after covers it.
        let soon = k as usize + 1..(k as usize + BLOCK).min(self.settled);
        bare_beside(soon).and_then(|_| bare_beside(0..self.settled))
    }
}
