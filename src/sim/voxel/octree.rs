//! From one cube around the stock down to small ones, for whatever is asked of them: a cube is divided as
//! long as something in it is open.

use super::bricks::BLOCK;
use super::cube::Cube;
use work::monitor::{Cancelled, Monitor, check};
use work::parallel;

/// Samples along the side of the least cube.
pub(super) const SIDE: u32 = 4;

/// What is asked.
pub(super) trait Descent: Sync {
    /// A cube with what may matter in it.
    type Node: Send + Sync;
    /// What is known so far.
    type Tally: Send + Default;

    /// Its cube.
    fn cube(piece: &Self::Node) -> Cube;
    /// The parts of a cube in which something is open; what is known of the others is put down.
    fn children(&self, parent: &Self::Node, found: &mut Self::Tally) -> Vec<Self::Node>;
    /// Puts down all samples of a cube of [`SIDE`].
    fn leaf(&self, piece: &Self::Node, found: &mut Self::Tally);
    /// Adds what was found elsewhere.
    fn add(total: &mut Self::Tally, found: Self::Tally);
}

/// Walks down from `whole`; the same result for any number of threads.
///
/// # Errors
/// [`Cancelled`].
pub(super) fn descend<D: Descent>(
    descent: &D,
    whole: D::Node,
    name: &str,
    monitor: &dyn Monitor,
) -> Result<D::Tally, Cancelled> {
    let mut level = vec![whole];
    let mut total = D::Tally::default();
    while level.first().is_some_and(|piece| D::cube(piece).n > BLOCK) {
        check(monitor)?;
        let divided = parallel::map(level.len(), |k| {
            let mut found = D::Tally::default();
            (descent.children(&level[k], &mut found), found)
        });
        level.clear();
        for (children, found) in divided {
            level.extend(children);
            D::add(&mut total, found);
        }
    }
    monitor.start(name, level.len() as u64);
    let blocks = parallel::try_map(level.len(), |k| {
        check(monitor)?;
        let mut found = D::Tally::default();
        divide(descent, &level[k], &mut found);
        monitor.advance(1);
        Ok(found)
    })?;
    blocks.into_iter().for_each(|found| D::add(&mut total, found));
    Ok(total)
}

fn divide<D: Descent>(descent: &D, piece: &D::Node, found: &mut D::Tally) {
    for child in descent.children(piece, found) {
        if D::cube(&child).n == SIDE {
            descent.leaf(&child, found);
        } else {
            divide(descent, &child, found);
        }
    }
}
