//! Where parallel planes stand, each as far from the one before as what lies between both allows.
//!
//! Enters: how far apart planes may stand, from place to place across them. Leaves: the fewest planes of which
//! no two neighbours are farther apart than any place between them allows, half a step from both ends.
//!
//! The farthest next plane never comes nearer when the one before stands farther on, so that planes put one
//! after the other as far as they may are the fewest. What the last of them leaves is taken off all steps in
//! proportion: where all places allow the same, planes stand evenly.

/// Parts of the way across that have a step of their own: a tenth of a cell of charts, or less.
const PARTS: usize = 4096;

/// Steps are let be greater by this share, so that rounding adds no plane.
const ROUNDING: f64 = 1e-9;

/// Halvings by which the common share of all steps is found, to the last bit.
const HALVINGS: usize = 60;

/// How far apart planes may stand, by the coordinate across them, mm.
#[derive(Debug, Clone)]
pub(crate) struct AllowedGaps {
    range: [f64; 2],
    /// The least that any place of each part allows.
    parts: Vec<f64>,
}

impl AllowedGaps {
    /// Nothing is known yet of what lies in a range.
    pub fn over(range: [f64; 2]) -> Self {
        Self { range, parts: vec![f64::INFINITY; PARTS] }
    }

    /// What lies from one coordinate to another allows so much.
    pub fn limit(&mut self, [a, b]: [f64; 2], gap: f64) {
        let [first, last] = [a, b].map(|y| self.part(y));
        self.parts[first..=last].iter_mut().for_each(|part| *part = part.min(gap));
    }

    /// The least that is allowed anywhere; infinite where nothing is known.
    pub fn least(&self) -> f64 {
        self.parts.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// The same with no less than `floor` anywhere; parts without places take the lesser of what those on
    /// both sides allow, and `floor` where there are none.
    pub fn filled(mut self, floor: f64) -> Self {
        let nearest = |parts: &mut dyn Iterator<Item = &f64>| {
            let carry = |known: &mut f64, &part: &f64| {
                *known = if part.is_finite() { part } else { *known };
                Some(*known)
            };
            parts.scan(f64::INFINITY, carry).collect::<Vec<f64>>()
        };
        let (before, after) = (nearest(&mut self.parts.iter()), nearest(&mut self.parts.iter().rev()));
        for (part, (before, after)) in
            self.parts.iter_mut().zip(before.into_iter().zip(after.into_iter().rev()))
        {
            let known = if part.is_finite() { *part } else { before.min(after) };
            *part = if known.is_finite() { known.max(floor) } else { floor };
        }
        self
    }

    /// The same with the least of all everywhere.
    pub fn even(mut self) -> Self {
        let least = self.least();
        self.parts.fill(least);
        self
    }

    /// The planes, ascending. All parts must be [`Self::filled`].
    pub fn planes(&self) -> Vec<f64> {
        let (mut too_little, mut share) = (0.0, 1.0 + ROUNDING);
        let Some(mut planes) = self.covering(share, usize::MAX) else { return Vec::new() };
        for _ in 0..HALVINGS {
            let middle = 0.5 * (too_little + share);
            match self.covering(middle, planes.len()) {
                Some(nearer) => (planes, share) = (nearer, middle),
                None => too_little = middle,
            }
        }
        // Where the last steps leave a tight place they may jump past the end.
        planes.iter_mut().for_each(|plane| *plane = plane.min(self.range[1]));
        planes
    }

    /// Planes one after the other as far apart as a share of what is allowed, up to the end; `None` where that
    /// takes more than `most`.
    fn covering(&self, share: f64, most: usize) -> Option<Vec<f64>> {
        let [low, high] = self.range;
        let mut planes = vec![self.reach(low, 0.5 * share)];
        loop {
            let last = planes[planes.len() - 1];
            if self.reach(last, 0.5 * share) >= high {
                return Some(planes);
            }
            if planes.len() == most {
                return None;
            }
            planes.push(self.reach(last, share));
        }
    }

    /// The farthest coordinate from another whose distance is no more than a share of what all between them
    /// allows.
    fn reach(&self, from: f64, share: f64) -> f64 {
        let mut part = self.part(from);
        let mut most = share * self.parts[part];
        loop {
            let edge = self.edge(part + 1);
            let Some(next) = self.parts.get(part + 1).map(|next| share * next) else { return from + most };
            if from + most <= edge {
                return from + most;
            }
            if from + next <= edge {
                return edge;
            }
            (most, part) = (most.min(next), part + 1);
        }
    }

    fn edge(&self, part: usize) -> f64 {
        let [low, high] = self.range;
        low + (high - low) * part as f64 / self.parts.len() as f64
    }

    fn part(&self, y: f64) -> usize {
        let [low, high] = self.range;
        let share = (y - low) / (high - low);
        // A range without a width is all in the first part.
        ((share * self.parts.len() as f64).max(0.0) as usize).min(self.parts.len() - 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// What a profile `y → gap` allows, by parts of it.
    fn allowed(range: [f64; 2], gap: impl Fn(f64) -> f64) -> AllowedGaps {
        let mut all = AllowedGaps::over(range);
        for part in 0..PARTS {
            let [a, b] = [0.0, 1.0].map(|inside| all.edge(part) + inside * (all.edge(1) - all.edge(0)));
            all.limit([a + 1e-9, b - 1e-9], gap(a).min(gap(b)));
        }
        all
    }

    #[test]
    fn planes_stand_evenly_where_all_allows_the_same() {
        for (width, gap) in [(10.0, 0.5), (10.0, 0.3), (7.0, 9.0), (0.0, 0.5)] {
            let range = [-3.0, -3.0 + width];
            let planes = AllowedGaps::over(range).filled(gap).planes();
            let count = (width / gap - 1e-9).ceil().max(1.0);
            assert_eq!(planes.len() as f64, count);
            for (k, plane) in planes.iter().enumerate() {
                let wanted = range[0] + width * (k as f64 + 0.5) / count;
                assert!((plane - wanted).abs() < 1e-12, "{planes:?}");
            }
        }
    }

    /// Beside a groove 0.1 wide that allows a tenth of all else one plane more stands in its middle, and not
    /// ten times as many everywhere.
    #[test]
    fn a_tight_place_narrows_the_gaps_that_hold_it_alone() {
        let planes = allowed([0.0, 100.0], |y| if (y - 40.0).abs() < 0.05 { 0.1 } else { 1.0 }).planes();
        assert!((101..=104).contains(&planes.len()), "{}", planes.len());
        let tight = planes.windows(2).filter(|w| w[1] - w[0] < 0.5).count();
        assert!((1..=3).contains(&tight), "{tight}");
    }

    /// Of a step that changes little from plane to plane there are as many as its inverse has area.
    #[test]
    fn slowly_changing_steps_take_the_integral_of_their_inverse() {
        let gap = |y: f64| 0.2 + 0.15 * (y / 20.0).sin();
        let integral: f64 = (0..100_000).map(|k| 1e-3 / gap((f64::from(k) + 0.5) * 1e-3)).sum();
        let count = allowed([0.0, 100.0], gap).planes().len() as f64;
        assert!(count >= integral && count <= 1.01 * integral + 1.0, "{count} {integral}");
    }

    /// The fewest planes at multiples of a small step, by trying all: the least count that ends at each.
    fn fewest(gap: &[f64], step: f64) -> usize {
        let n = gap.len();
        let fits = |a: usize, b: usize, share: f64| {
            gap[a..b].iter().all(|gap| (b - a) as f64 * step <= share * gap + 1e-9)
        };
        let mut least = vec![usize::MAX; n + 1];
        for at in 0..=n {
            let before = (0..at).filter(|&k| least[k] < usize::MAX && fits(k, at, 1.0)).map(|k| least[k] + 1);
            let first = fits(0, at, 0.5).then_some(1);
            least[at] = before.chain(first).min().unwrap_or(usize::MAX);
        }
        (0..=n).filter(|&k| fits(k, n, 0.5)).map(|k| least[k]).min().unwrap()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        /// No gap is wider than anything in it allows, and nobody does with fewer planes.
        #[test]
        fn no_gap_is_wider_than_allowed_and_no_plane_too_many(
            gaps in prop::collection::vec(0.5..8.0_f64, 64),
        ) {
            let mut all = AllowedGaps::over([0.0, 64.0]);
            let per_place = PARTS / gaps.len();
            for (part, allowed) in all.parts.iter_mut().enumerate() {
                *allowed = gaps[part / per_place];
            }
            let planes = all.planes();
            // The part ends in the middle of a gap.
            let [before, after] = [-planes[0], 2.0 * 64.0 - planes[planes.len() - 1]];
            let with_ends: Vec<f64> = [before].into_iter().chain(planes.iter().copied()).chain([after]).collect();
            for w in with_ends.windows(2) {
                let inside = |k: usize| w[0] < k as f64 + 1.0 - 1e-9 && w[1] > k as f64 + 1e-9;
                for k in (0..gaps.len()).filter(|&k| inside(k)) {
                    prop_assert!(w[1] - w[0] <= gaps[k] * (1.0 + 2.0 * ROUNDING) + 1e-12, "{w:?} {}", gaps[k]);
                }
            }
            // In steps of an eighth there may be more, never fewer.
            let fine: Vec<f64> = gaps.iter().flat_map(|gap| [*gap; 8]).collect();
            prop_assert!(planes.len() <= fewest(&fine, 0.125));
        }
    }

    #[test]
    fn what_lies_between_known_parts_allows_the_lesser_of_both() {
        let mut all = AllowedGaps::over([0.0, 4.0]);
        all.limit([-1.0, 1.0], 3.0);
        all.limit([2.0, 3.0], 0.5);
        assert_eq!(all.least(), 0.5);
        let filled = all.filled(1.0);
        let at = [0.5, 1.5, 2.5, 3.5].map(|y| filled.parts[filled.part(y)]);
        assert_eq!(at, [3.0, 1.0, 1.0, 1.0]);
        assert!(AllowedGaps::over([0.0, 4.0]).filled(0.7).parts.iter().all(|part| *part == 0.7));
    }
}
