//! Which contacts bound each other's axes, and by how much: neighbours on a pass, and a contact with the
//! nearest place of each pass beside it.

use crate::moves::touch::Touch;
use geometry::{Point3, Vector3, angle_between};
use motion::{PassStretches, ROUNDING};
use std::ops::Range;

/// Programs round both ends of a way, mm: so much of it may be lost.
pub(crate) const LOST: f64 = 2.0 * 1.7321 * ROUNDING;

/// How fast axes may turn, rad a mm of contact.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct TurningRates {
    /// Along a pass.
    pub along: Option<f64>,
    /// From pass to pass.
    pub across: Option<f64>,
}

/// A node and a place between two others of one pass, and how far apart their axes may be.
#[derive(Clone, Copy)]
pub(super) struct Pair {
    pub node: u32,
    pub between: [u32; 2],
    /// Where the place lies, from the first to the second.
    pub share: f64,
    /// The greatest angle, rad.
    pub most: f64,
}

impl Pair {
    /// Between the axes, rad.
    pub fn angle(&self, axes: &[Vector3]) -> f64 {
        self.angle_of(|k| axes[k])
    }

    /// The same for axes by their node.
    pub fn angle_of(&self, axis: impl Fn(usize) -> Vector3) -> f64 {
        let [first, second] = self.between.map(|k| k as usize);
        let a = axis(first);
        let there = if first == second {
            a
        } else {
            (a + (axis(second) - a) * self.share).try_normalize(1e-9).unwrap_or(a)
        };
        let own = axis(self.node as usize);
        angle_between(&own, &there)
    }
}

/// The contacts of passes as nodes: contacts of a pass that lie in one place share a node, because between
/// them no axis may turn.
pub(super) struct Graph {
    /// The touches of each node.
    pub touches: Vec<Range<usize>>,
    /// The nodes of each pass.
    passes: Vec<Range<usize>>,
    /// Where each node lies on its pass, mm.
    at: Vec<f64>,
    /// Contacts of neighbouring passes; the place lies between two nodes that follow each other.
    across: Vec<Pair>,
    along: Option<f64>,
}

impl Graph {
    /// Of touches with their passes, in order. `within` mm passes lie beside each other.
    pub fn of(touches: &[(usize, Touch)], rates: TurningRates, within: f64) -> Self {
        let mut graph = Self {
            touches: Vec::new(),
            passes: Vec::new(),
            at: Vec::new(),
            across: Vec::new(),
            along: rates.along,
        };
        for k in 0..touches.len() {
            graph.take(touches, k);
        }
        if let Some(rate) = rates.across {
            graph.across = graph.beside(touches, within, rate);
        }
        graph
    }

    fn take(&mut self, touches: &[(usize, Touch)], k: usize) {
        let (pass, touch) = touches[k];
        let before = k.checked_sub(1).filter(|&j| touches[j].0 == pass);
        let node = self.touches.len();
        let at = match before {
            None => {
                self.passes.push(node..node);
                0.0
            }
            Some(j) => {
                let way = (touch.contact.point - touches[j].1.contact.point).norm() - LOST;
                if let (true, Some(last)) = (way <= 0.0 && self.along.is_some(), self.touches.last_mut()) {
                    last.end = k + 1;
                    return;
                }
                self.at[node - 1] + way.max(0.0)
            }
        };
        self.touches.push(k..k + 1);
        self.at.push(at);
        if let Some(last) = self.passes.last_mut() {
            last.end = node + 1;
        }
    }

    /// Each node with the nearest place of every pass beside it.
    fn beside(&self, touches: &[(usize, Touch)], within: f64, rate: f64) -> Vec<Pair> {
        let contact = |node: usize| touches[self.touches[node].start].1.contact.point;
        let pass_of = |node: usize| touches[self.touches[node].start].0;
        // The second node of each stretch.
        let ends: Vec<usize> = (1..self.touches.len()).filter(|&k| pass_of(k) == pass_of(k - 1)).collect();
        let stretch = |&k: &usize| -> ([Point3; 2], u32) { ([k - 1, k].map(contact), pass_of(k) as u32) };
        let stretches = PassStretches::new(ends.iter().map(stretch).collect());
        let found = work::parallel::map(self.touches.len(), |k| {
            let near = stretches.beside(&contact(k), pass_of(k) as u32, within);
            let pair = |one: motion::Beside| {
                let end = ends[one.stretch as usize] as u32;
                let most = rate * (one.distance - LOST).max(0.0);
                Pair { node: k as u32, between: [end - 1, end], share: one.at, most }
            };
            near.into_iter().map(pair).collect::<Vec<_>>()
        });
        found.into_iter().flatten().collect()
    }

    /// Levels of every second node: on the last one a pass is its two ends.
    pub fn levels(&self) -> u32 {
        let longest = self.passes.iter().map(Range::len).max().unwrap_or(0);
        longest.saturating_sub(1).next_power_of_two().trailing_zeros() + 1
    }

    /// The nodes of a level, pass by pass.
    fn nodes(&self, level: u32) -> impl Iterator<Item = Vec<usize>> + '_ {
        self.passes.iter().map(move |pass| {
            let last = pass.end - 1;
            pass.clone().step_by(1 << level).filter(|k| *k < last).chain([last]).collect()
        })
    }

    /// All pairs of a level. Those along passes follow from those of finer levels.
    pub fn pairs(&self, level: u32) -> Vec<Pair> {
        let along = self.along.map(|rate| {
            let pair = move |w: &[usize]| {
                let most = rate * (self.at[w[1]] - self.at[w[0]]);
                Pair { node: w[1] as u32, between: [w[0] as u32; 2], share: 0.0, most }
            };
            self.nodes(level).flat_map(move |nodes| nodes.windows(2).map(pair).collect::<Vec<_>>())
        });
        let own = self.across.iter().filter(|pair| self.is_on(pair.node as usize, level));
        let across = own.map(|pair| {
            let [a, b] = pair.between.map(|k| k as usize);
            let place = self.at[a] + (self.at[b] - self.at[a]) * pair.share;
            let [low, high] = self.around(a, level);
            let share = (place - self.at[low]) / (self.at[high] - self.at[low]).max(f64::MIN_POSITIVE);
            Pair { between: [low as u32, high as u32], share: share.clamp(0.0, 1.0), ..*pair }
        });
        along.into_iter().flatten().chain(across).collect()
    }

    fn pass_of(&self, node: usize) -> &Range<usize> {
        &self.passes[self.passes.partition_point(|pass| pass.end <= node)]
    }

    /// Whether a level has a node.
    fn is_on(&self, node: usize, level: u32) -> bool {
        let pass = self.pass_of(node);
        (node - pass.start).is_multiple_of(1 << level) || node + 1 == pass.end
    }

    /// The nodes of a level at or before a node and after it.
    fn around(&self, node: usize, level: u32) -> [usize; 2] {
        let pass = self.pass_of(node);
        let low = pass.start + (((node - pass.start) >> level) << level);
        [low, (low + (1 << level)).min(pass.end - 1)]
    }

    /// Carries what was found at the nodes of the level above to the nodes of this one that lie between.
    pub fn carry_down(&self, level: u32, found: &mut [Vector3]) {
        let between = self.nodes(level).flatten().filter(|&k| !self.is_on(k, level + 1));
        for k in between {
            let [low, high] = self.around(k, level + 1);
            let share = (self.at[k] - self.at[low]) / (self.at[high] - self.at[low]).max(f64::MIN_POSITIVE);
            found[k] = found[low] + (found[high] - found[low]) * share;
        }
    }
}
