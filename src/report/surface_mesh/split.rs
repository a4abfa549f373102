//! A triangle with further points on its sides, cut into triangles.

/// A corner of a triangle, or a ridge point on one of its sides; in cells and mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Corner {
    pub x: f64,
    pub y: f64,
    pub z: f64,
    /// Which vertex of the mesh it is.
    pub vertex: usize,
    pub on_ridge: bool,
    /// The sides of the undivided triangle that it lies on, a bit each.
    pub sides: u8,
}

/// Cuts `outline` (counter-clockwise; its corners and the points on its sides in order) into
/// triangles, which are added to `pieces`. No piece lies along a side. Cuts from ridge point to ridge
/// point come first, so that ridges run along edges, and short ones before long ones.
pub(super) fn split(outline: &mut Vec<Corner>, pieces: &mut Vec<[Corner; 3]>) {
    while outline.len() > 3 {
        let n = outline.len();
        let around = |k: usize| (outline[(k + n - 1) % n], outline[(k + 1) % n]);
        let rank = |k: usize| {
            let (before, after) = around(k);
            let (dx, dy) = (after.x - before.x, after.y - before.y);
            (!(before.on_ridge && after.on_ridge), dx * dx + dy * dy)
        };
        // A cut between two points of one side would leave nothing on one hand.
        let ears = (0..n).filter(|k| {
            let (before, after) = around(*k);
            before.sides & after.sides == 0
        });
        let best = ears.min_by(|a, b| {
            let (a, b) = (rank(*a), rank(*b));
            a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
        });
        // A polygon has a cut of this kind always, since not all of its points lie on one side.
        let k = best.unwrap_or(0);
        let (before, after) = around(k);
        pieces.push([before, outline[k], after]);
        outline.remove(k);
    }
    if let [a, b, c] = outline[..] {
        pieces.push([a, b, c]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A right triangle with points at the given shares of its sides.
    fn outline(shares: &[Vec<f64>; 3]) -> Vec<Corner> {
        let corners = [(0.0, 0.0), (8.0, 0.0), (0.0, 8.0)];
        let mut points = Vec::new();
        for k in 0..3 {
            let ((ax, ay), (bx, by)) = (corners[k], corners[(k + 1) % 3]);
            let own = 1u8 << k;
            let before = 1u8 << ((k + 2) % 3);
            for (rank, t) in std::iter::once(&0.0).chain(&shares[k]).enumerate() {
                points.push(Corner {
                    x: ax + t * (bx - ax),
                    y: ay + t * (by - ay),
                    z: 0.0,
                    vertex: points.len(),
                    on_ridge: rank > 0,
                    sides: if rank == 0 { own | before } else { own },
                });
            }
        }
        points
    }

    fn area([a, b, c]: &[Corner; 3]) -> f64 {
        0.5 * ((b.x - a.x) * (c.y - a.y) - (c.x - a.x) * (b.y - a.y))
    }

    proptest! {
        #[test]
        fn pieces_fill_the_triangle_and_none_is_empty(
            counts in (0usize..4, 0usize..4, 0usize..4), wanted in prop::collection::vec(0.02..0.98f64, 12),
        ) {
            let mut next = wanted.into_iter();
            let mut shares = [counts.0, counts.1, counts.2].map(|n| next.by_ref().take(n).collect::<Vec<_>>());
            for side in &mut shares {
                side.sort_by(f64::total_cmp);
                side.dedup_by(|a, b| (*a - *b).abs() < 1e-3);
            }
            let mut points = outline(&shares);
            let n = points.len();
            let mut pieces = Vec::new();
            split(&mut points, &mut pieces);
            prop_assert_eq!(pieces.len(), n - 2);
            prop_assert!(pieces.iter().all(|p| area(p) > 1e-9));
            prop_assert!((pieces.iter().map(area).sum::<f64>() - 32.0).abs() < 1e-9);
        }
    }

    #[test]
    fn a_ridge_across_the_triangle_becomes_an_edge() {
        let mut points = outline(&[vec![0.9], vec![], vec![0.1]]);
        let ridge: Vec<usize> = points.iter().filter(|p| p.on_ridge).map(|p| p.vertex).collect();
        let mut pieces = Vec::new();
        split(&mut points, &mut pieces);
        let along = |p: &[Corner; 3]| ridge.iter().all(|v| p.iter().any(|c| c.vertex == *v));
        assert_eq!(pieces.iter().filter(|p| along(p)).count(), 2, "an edge has a triangle on either hand");
    }
}
