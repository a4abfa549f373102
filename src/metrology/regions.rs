//! Connected regions of cells.

use sim::Grid;

/// The 8-connected regions of cells for which `inside` holds, each a list of cell indices in the
/// order in which they were reached; regions in the order of their first cell.
pub(super) fn connected(grid: &Grid, inside: &dyn Fn(usize) -> bool) -> Vec<Vec<u32>> {
    let mut seen = vec![false; grid.len()];
    let mut regions = Vec::new();
    for start in 0..grid.len() {
        if seen[start] || !inside(start) {
            continue;
        }
        seen[start] = true;
        let mut region = vec![start as u32];
        let mut next = 0;
        while next < region.len() {
            let k = region[next] as usize;
            next += 1;
            let (i, j) = (k % grid.nx, k / grid.nx);
            for nj in j.saturating_sub(1)..=(j + 1).min(grid.ny - 1) {
                for ni in i.saturating_sub(1)..=(i + 1).min(grid.nx - 1) {
                    let other = grid.index(ni, nj);
                    if !seen[other] && inside(other) {
                        seen[other] = true;
                        region.push(other as u32);
                    }
                }
            }
        }
        regions.push(region);
    }
    regions
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::Point2;

    #[test]
    fn regions_join_over_corners_and_stay_apart_over_gaps() {
        let picture = ["##..#", ".....", "..#..", ".#.##"];
        let grid = Grid { origin: Point2::origin(), cell: 1.0, nx: 5, ny: 4 };
        let inside = |k: usize| picture[k / 5].as_bytes()[k % 5] == b'#';
        let sizes: Vec<usize> = connected(&grid, &inside).iter().map(Vec::len).collect();
        assert_eq!(sizes, [2, 1, 4]);
        assert!(connected(&grid, &|_| false).is_empty());
    }
}
