//! Several cutters on one stock, one after the other: each begins with what those before it left.

use super::in_order::{Removal, cut_in_order};
use super::{CutError, NOT_CUT, ZMap};
use cutter::Cutter;
use motion::{Cutters, Toolpath};
use work::monitor::Monitor;

/// How one cutter cuts heights along a path, as [`cut`](super::cut()) does.
pub type CutHeights = fn(ZMap, &Cutter, &Toolpath, &dyn Monitor) -> Result<ZMap, CutError>;

/// Cuts `stock` along every move of `path`, each by its own cutter. Moves are counted through the whole path;
/// of equal cuts that of the first cutter counts.
///
/// # Errors
/// [`CutError::Path`] where the path is no path of upright tools; [`CutError::Cancelled`] when the monitor
/// says so.
///
/// # Tolerance
/// That of `cut`.
pub fn cut_in_turn(
    cut: CutHeights,
    mut stock: ZMap,
    cutters: &Cutters,
    path: &Toolpath,
    monitor: &dyn Monitor,
) -> Result<ZMap, CutError> {
    if !cutters.are_several() {
        return cut(stock, cutters.first(), path, monitor);
    }
    let mut winners = vec![NOT_CUT; stock.grid.len()];
    for stretch in cutters.stretches(path) {
        stock = cut(stock, stretch.cutter, &stretch.path, monitor)?;
        take(&mut winners, &stock, stretch.first);
    }
    stock.cut_by = winners;
    Ok(stock)
}

/// As [`cut_in_order`], each move by its own cutter.
///
/// # Errors
/// [`CutError::Path`] where the path is no path of upright tools; [`CutError::Cancelled`] when the monitor
/// says so.
pub fn cut_in_order_in_turn(
    stock: ZMap,
    cutters: &Cutters,
    path: &Toolpath,
    monitor: &dyn Monitor,
) -> Result<Removal, CutError> {
    let mut winners = vec![NOT_CUT; stock.grid.len()];
    let mut all = Removal { stock, moves: Vec::new(), rapid_contacts: Vec::new(), volume_bound: 0.0 };
    for stretch in cutters.stretches(path) {
        let Removal { stock, moves, rapid_contacts, volume_bound } =
            cut_in_order(all.stock, stretch.cutter, &stretch.path, monitor)?;
        take(&mut winners, &stock, stretch.first);
        all.stock = stock;
        all.moves.extend(moves);
        all.rapid_contacts.extend(rapid_contacts.into_iter().map(|mut contact| {
            contact.move_index += stretch.first;
            contact
        }));
        all.volume_bound += volume_bound;
    }
    all.stock.cut_by = winners;
    Ok(all)
}

/// Takes over the moves that cut, which begin with the move `first` of the whole path.
fn take(winners: &mut [u32], stock: &ZMap, first: u32) {
    for (winner, by) in winners.iter_mut().zip(&stock.cut_by) {
        if *by != NOT_CUT {
            *winner = by + first;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenes::{Rng, cutters, random_path};
    use crate::{Envelope, Grid, cut, cut_reference};
    use geometry::Point2;
    use work::monitor::Silent;

    const REFERENCE: CutHeights = |stock, cutter, path, monitor| cut_reference(&stock, cutter, path, monitor);

    /// Every cell stands at the lowest of all moves, each evaluated by itself, or at the stock.
    #[test]
    fn what_is_left_is_the_lowest_of_all_cutters() {
        let (mut rng, all) = (Rng::new(23), cutters());
        let grid = Grid { origin: Point2::new(0.1, 0.1), cell: 0.25, nx: 32, ny: 32 };
        for _ in 0..12 {
            let mut pick = || all[rng.below(all.len())];
            let cutters = Cutters::from(pick()).then(17, pick()).then(31, pick());
            let path = random_path(&mut rng, 45, 8.0);
            let envelope = Envelope::new(&cutters, &path);
            let moves: Vec<u32> = (0..45).collect();
            for engine in [cut as CutHeights, REFERENCE] {
                let left = cut_in_turn(engine, ZMap::block(grid, 5.0), &cutters, &path, &Silent).unwrap();
                for (k, (height, by)) in left.height.iter().zip(&left.cut_by).enumerate() {
                    let p = grid.centre(k % grid.nx, k / grid.nx);
                    let lowest = envelope.lowest(p.x, p.y, &moves).map_or(f64::INFINITY, |(z, _)| z);
                    assert!((f64::from(*height) - lowest.min(5.0)).abs() < 2e-5, "{p:?} {height} {lowest}");
                    match *by {
                        NOT_CUT => assert_eq!(*height, 5.0),
                        by => {
                            let its = envelope.height(by, p.x, p.y).unwrap();
                            assert!((its - lowest).abs() < 2e-5, "{p:?} {by} {its} {lowest}");
                        }
                    }
                }
            }
        }
    }

    /// What the cutters remove adds up to what is gone, each move at its place in the whole path.
    #[test]
    fn removal_in_turn_adds_up() {
        let (mut rng, all) = (Rng::new(5), cutters());
        let grid = Grid { origin: Point2::new(0.1, 0.1), cell: 0.25, nx: 32, ny: 32 };
        let cutters = Cutters::from(all[1]).then(20, all[0]);
        let path = random_path(&mut rng, 40, 8.0);
        let removed = cut_in_order_in_turn(ZMap::block(grid, 5.0), &cutters, &path, &Silent).unwrap();
        let left = cut_in_turn(cut, ZMap::block(grid, 5.0), &cutters, &path, &Silent).unwrap();
        let gone: f64 = left.height.iter().map(|h| 5.0 - f64::from(*h)).sum::<f64>() * grid.cell * grid.cell;
        assert!((removed.volume() - gone).abs() < 1e-3, "{} {gone}", removed.volume());
        assert_eq!(removed.moves.len(), 40);
        let one = cut_in_order(ZMap::block(grid, 5.0), &all[1], &path.part(0..20), &Silent).unwrap();
        assert_eq!(removed.moves[..20], one.moves[..]);
    }
}
