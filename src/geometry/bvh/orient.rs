//! On which side of a line a point lies, without rounding error.

/// Relative error of the plain determinant (J. R. Shewchuk, "Adaptive precision floating-point
/// arithmetic and fast robust geometric predicates", 1997, eq. for `ccwerrboundA`).
const ERROR: f64 = (3.0 + 16.0 * HALF_ULP) * HALF_ULP;
const HALF_ULP: f64 = 0.5 * f64::EPSILON;

/// `(a - p) × (b - p)`: positive where `p` lies left of the line from `a` to `b` in the plan view.
/// The sign, zero included, is exact (barring underflow); the value has a relative error of a few
/// ulps where it matters.
pub(super) fn left_of(a: [f64; 2], b: [f64; 2], p: [f64; 2]) -> f64 {
    let (l, r) = ((a[0] - p[0]) * (b[1] - p[1]), (a[1] - p[1]) * (b[0] - p[0]));
    let plain = l - r;
    if plain.abs() > ERROR * (l.abs() + r.abs()) { plain } else { exact(a, b, p) }
}

/// The determinant as a sum of six exact products (that of `p` with itself cancels), each split
/// into its rounded value and its error, summed without loss.
fn exact(a: [f64; 2], b: [f64; 2], p: [f64; 2]) -> f64 {
    let products = [(a[0], b[1]), (-a[0], p[1]), (-p[0], b[1]), (-a[1], b[0]), (a[1], p[0]), (p[1], b[0])];
    // A non-overlapping expansion, least part first (Shewchuk, GROW-EXPANSION).
    let mut parts = [0.0; 12];
    let mut len = 0;
    for (x, y) in products {
        let high = x * y;
        let low = x.mul_add(y, -high);
        for term in [low, high] {
            let mut carry = term;
            for part in &mut parts[..len] {
                let (sum, error) = two_sum(carry, *part);
                *part = error;
                carry = sum;
            }
            parts[len] = carry;
            len += 1;
        }
    }
    // The greatest non-zero part exceeds the sum of all others, so this has the right sign.
    parts.iter().sum()
}

/// The rounded sum and its error (Knuth).
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let b_there = sum - a;
    (sum, (a - (sum - b_there)) + (b - b_there))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signs_near_a_line_are_exact() {
        // Points around the middle of the line y = x, moved by multiples of one ulp (Kettner et
        // al., "Classroom examples of robustness problems", 2008).
        let (a, b) = ([12.0, 12.0], [24.0, 24.0]);
        let ulp = f64::EPSILON / 2.0;
        let mut wrong_when_plain = 0;
        for i in 0..64 {
            for j in 0..64 {
                let p = [0.5 + f64::from(i) * ulp, 0.5 + f64::from(j) * ulp];
                // Left of y = x is where y > x.
                let expected = p[1].partial_cmp(&p[0]);
                assert_eq!(left_of(a, b, p).partial_cmp(&0.0), expected, "{i} {j}");
                let plain = (a[0] - p[0]) * (b[1] - p[1]) - (a[1] - p[1]) * (b[0] - p[0]);
                wrong_when_plain += usize::from(plain.partial_cmp(&0.0) != expected);
            }
        }
        assert!(wrong_when_plain > 500, "the plain formula fails at {wrong_when_plain} points");
    }

    #[test]
    fn far_from_a_line_it_is_the_plain_determinant() {
        assert_eq!(left_of([0.0, 0.0], [2.0, 0.0], [1.0, 3.0]), 6.0);
        assert_eq!(left_of([2.0, 0.0], [0.0, 0.0], [1.0, 3.0]), -6.0);
        assert_eq!(left_of([0.1, 0.1], [0.3, 0.3], [0.2, 0.2]), 0.0);
    }
}
