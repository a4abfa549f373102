//! Cubes of samples, divided like an octree.

/// A cube with `n` samples a side, the least of them at `low`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cube {
    pub(super) low: [u32; 3],
    pub(super) n: u32,
}

impl Cube {
    pub(super) fn children(self) -> impl Iterator<Item = Self> {
        let n = self.n / 2;
        (0..8).map(move |k| Self {
            low: std::array::from_fn(|i| self.low[i] + if k >> i & 1 == 1 { n } else { 0 }),
            n,
        })
    }
}
