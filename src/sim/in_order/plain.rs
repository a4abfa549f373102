//! The same engine without any bound: every move evaluates every cell that its bounding rectangle
//! meets. What the fast one is tested and timed against.

use super::leaf::Tally;
use super::{OrderedCut, Removal, TileCells, TileRecord, cut_by_tiles};
use crate::swept::swept_height;
use crate::{CutError, ZMap};
use cutter::Cutter;
use motion::Toolpath;
use work::monitor::Monitor;

/// As [`cut_in_order`](super::cut_in_order), by a plain loop over cells and without
/// [`Removal::rapid_contacts`].
///
/// # Errors
/// [`CutError::Path`] where the path is no path of upright tools; [`CutError::Cancelled`] when the monitor
/// says so.
#[doc(hidden)]
pub fn cut_in_order_plain(
    stock: ZMap,
    cutter: &Cutter,
    path: &Toolpath,
    monitor: &dyn Monitor,
) -> Result<Removal, CutError> {
    cut_by_tiles(stock, cutter, path, monitor, super::SIDE, |job, cells, moves| Ok(cut(job, cells, moves)))
}

fn cut(job: &OrderedCut, cells: &mut TileCells, moves: &[u32]) -> TileRecord {
    let mut found = TileRecord::default();
    for &index in moves {
        let (k, track) = (index as usize, job.track(index));
        let (from, to) = (job.path.start_of(k), job.path.moves[k].to.tip);
        let range = |centres: &[f64], a: f64, b: f64| {
            let (low, high) = (a.min(b) - job.form.radius, a.max(b) + job.form.radius);
            centres.partition_point(|c| *c < low)..centres.partition_point(|c| *c <= high)
        };
        let (columns, rows) = (range(&cells.x, from.x, to.x), range(&cells.y, from.y, to.y));
        let mut tally = Tally::NOTHING;
        for j in rows {
            let (heights, cut_by) = &mut cells.rows[j];
            for i in columns.clone() {
                let (x, y) = (cells.x[i], cells.y[j]);
                let stored = swept_height(&job.form, &track, x, y) as f32;
                if stored < heights[i] {
                    let now = f64::from(heights[i]);
                    let (along, across) = track.along_across(x, y);
                    let share = job.share(0, x) * job.share(1, y);
                    tally.add_cell(now - f64::from(stored), share, now, &track, along, across);
                    (heights[i], cut_by[i]) = (stored, index);
                }
            }
        }
        if tally.sum > 0.0 {
            found.tallies.push((index, tally));
        }
    }
    found
}
