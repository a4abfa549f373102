//! The sheets of the surface in a cell: which of the cell's edges that the surface crosses one sheet crosses.
//!
//! On a face whose opposite corners are inside the sheets run around the corners inside, seen from both cells
//! of the face. So every crossed edge of a face leads to one other, the edges of a cell form rings, and each
//! ring is one sheet.

/// The edges of a cell: two corners each. Corner `k` lies higher along axis `i` where bit `i` of `k` is set.
pub const EDGES: [[usize; 2]; 12] =
    [[0, 1], [2, 3], [4, 5], [6, 7], [0, 2], [1, 3], [4, 6], [5, 7], [0, 4], [1, 5], [2, 6], [3, 7]];

/// Which edge runs along `axis` from or to a corner.
pub fn edge_at(corner: usize, axis: usize) -> usize {
    let below = corner & ((1 << axis) - 1);
    4 * axis + (below | (corner >> (axis + 1)) << axis)
}

/// The corners around a face, in order.
fn around(axis: usize, upper: bool) -> [usize; 4] {
    let (b, c) = (1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
    [0, b, b | c, c].map(|corner| corner | usize::from(upper) << axis)
}

/// The edge between two corners.
pub fn edge_between(a: usize, b: usize) -> usize {
    edge_at(a, (a ^ b).trailing_zeros() as usize)
}

/// The sheets of all cells, by which of their corners are inside: bit `k` of a shape is that of corner `k`.
pub struct Sheets {
    of_edge: Vec<[u8; 12]>,
}

impl Sheets {
    /// Of all 256 shapes.
    pub fn table() -> Self {
        Self { of_edge: (0..=u8::MAX).map(of_shape).collect() }
    }

    /// Which sheet crosses an edge that the surface crosses.
    pub fn of(&self, shape: u8, edge: usize) -> u8 {
        self.of_edge[usize::from(shape)][edge]
    }

    /// Number of sheets.
    pub fn count(&self, shape: u8) -> u8 {
        let crossed = |&edge: &usize| is_crossed(shape, edge);
        (0..12).filter(crossed).map(|edge| self.of(shape, edge) + 1).max().unwrap_or(0)
    }

    /// The two corners inside on a face around which the same sheet runs.
    pub fn twice(&self, shape: u8, axis: usize, upper: bool) -> Option<[usize; 2]> {
        let ring = around(axis, upper);
        let inside = ring.map(|corner| shape >> corner & 1 == 1);
        if inside[0] != inside[2] || inside[1] != inside[3] || inside[0] == inside[1] {
            return None;
        }
        let first = usize::from(!inside[0]);
        let corners = [ring[first], ring[first + 2]];
        // Either of its two edges on the face.
        let [a, b] = corners.map(|corner| self.of(shape, edge_at(corner, (axis + 1) % 3)));
        (a == b).then_some(corners)
    }
}

/// Whether the surface crosses an edge.
pub fn is_crossed(shape: u8, edge: usize) -> bool {
    let [a, b] = EDGES[edge].map(|corner| shape >> corner & 1);
    a != b
}

fn of_shape(shape: u8) -> [u8; 12] {
    let mut sheets: [u8; 12] = std::array::from_fn(|edge| edge as u8);
    let mut join = |a: usize, b: usize| {
        let (from, to) = (sheets[a].max(sheets[b]), sheets[a].min(sheets[b]));
        sheets.iter_mut().filter(|sheet| **sheet == from).for_each(|sheet| *sheet = to);
    };
    for face in 0..6 {
        let ring = around(face / 2, face % 2 == 1);
        let edges: [usize; 4] = std::array::from_fn(|k| edge_between(ring[k], ring[(k + 1) % 4]));
        let crossed: Vec<usize> = edges.into_iter().filter(|&edge| is_crossed(shape, edge)).collect();
        match crossed[..] {
            [a, b] => join(a, b),
            [_, _, _, _] => {
                for k in (0..4).filter(|&k| shape >> ring[k] & 1 == 1) {
                    join(edges[k], edges[(k + 3) % 4]);
                }
            }
            _ => {}
        }
    }
    // Counted from nought.
    let mut known: Vec<u8> = (0..12).filter(|&e| is_crossed(shape, e)).map(|e| sheets[e]).collect();
    known.sort_unstable();
    known.dedup();
    sheets.map(|sheet| known.iter().position(|&k| k == sheet).unwrap_or(0) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sheets_are_rings_around_what_is_inside() {
        let sheets = Sheets::table();
        assert_eq!([0, 255].map(|shape| sheets.count(shape)), [0, 0]);
        // Two corners apart, and two holes apart, are two sheets; opposite corners of a face as well, but
        // holes there one.
        assert_eq!([0b1000_0001, 0b0111_1110, 0b1001, 0b1111_0110].map(|s| sheets.count(s)), [2, 2, 2, 1]);
        assert_eq!(sheets.count(0b0110_1001), 4);
        for (edge, ends) in EDGES.iter().enumerate() {
            let axis = (ends[0] ^ ends[1]).trailing_zeros() as usize;
            assert_eq!(ends.map(|corner| edge_at(corner, axis)), [edge; 2]);
        }
        for shape in 0..=u8::MAX {
            for sheet in 0..sheets.count(shape) {
                // Every face that a sheet meets has an even number of its edges.
                for face in 0..6 {
                    let ring = around(face / 2, face % 2 == 1);
                    let edges = (0..4).map(|k| edge_between(ring[k], ring[(k + 1) % 4]));
                    let of_it =
                        edges.filter(|&e| is_crossed(shape, e) && sheets.of(shape, e) == sheet).count();
                    assert!(of_it % 2 == 0, "{shape:b} {face}");
                }
            }
        }
    }
}
