//! The memory that bricks may take while a stock is divided.
//!
//! Every brick counts before it is kept, and goes on counting beyond the limit. So the voxel that is said to
//! fit follows from the true number.

use super::bricks::{BRICK, Brick};
use std::sync::atomic::{AtomicU64, Ordering};

/// Bytes that bricks may take, and have taken.
pub(super) struct Budget {
    allowed: u64,
    pub taken: AtomicU64,
}

impl Budget {
    pub fn new(allowed: u64) -> Self {
        Self { allowed, taken: AtomicU64::new(0) }
    }

    /// Whether so many more bytes are allowed. They count in any case: the sum says what would be needed.
    pub fn take(&self, bytes: u64) -> bool {
        self.taken.fetch_add(bytes, Ordering::Relaxed) + bytes <= self.allowed
    }

    /// Whether so many cubes of `n` samples that the surface may pass are far too many.
    pub fn is_hopeless(&self, cubes: usize, n: u32) -> bool {
        /// Cubes that the surface may pass, for one that it does.
        const LOOSE: f64 = 3.0;
        /// How many times too many: below that the true number is counted.
        const FAR_TOO_MANY: f64 = 4.0;
        let side = f64::from(n / BRICK);
        let about = cubes as f64 * side * side / LOOSE * size_of::<Brick>() as f64;
        about > FAR_TOO_MANY * self.allowed as f64
    }
}
