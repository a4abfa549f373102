//! A convex solid with flat faces, as cubes and the planes that cut them leave it, and its volume.
//!
//! Enters: a cube, then half spaces one after the other. Leaves: the volume of what lies in all of them.

use super::coordinates::Vector3;

/// Places where `gradient · x + offset` is not negative.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HalfSpace {
    /// Of any length; where it is zero the half space is all of space or, below an offset of zero, nothing.
    pub gradient: Vector3,
    /// Value at the origin.
    pub offset: f64,
}

/// A value at a place of a plane is off by less than this share of its terms.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

/// A convex solid, by the rings of its faces. Its memory serves one solid after the other.
#[derive(Debug, Clone, Default)]
pub struct Polytope {
    points: Vec<Vector3>,
    /// Where the points of each face end.
    ends: Vec<usize>,
    /// The solid that is being made, and what it gets where it is cut.
    next: (Vec<Vector3>, Vec<usize>),
    cap: Vec<Vector3>,
    /// The corners of the cap by their coordinates in its plane.
    flat: Vec<([f64; 2], Vector3)>,
}

impl HalfSpace {
    /// The value at a place.
    #[inline]
    pub fn at(&self, place: &Vector3) -> f64 {
        self.gradient.dot(place) + self.offset
    }

    /// The value at a place; zero where it may be.
    fn rounded_at(&self, place: &Vector3) -> f64 {
        let size = self.gradient.zip_map(place, |g, x| (g * x).abs()).sum() + self.offset.abs();
        let value = self.at(place);
        if value.abs() <= ROUNDING * size { 0.0 } else { value }
    }

    /// The least value in the cube of half side `half` around the origin.
    #[inline]
    pub fn least(&self, half: f64) -> f64 {
        self.offset - half * self.gradient.map(f64::abs).sum()
    }

    /// Whether its value is nowhere above that of another one in the cube of half side `half` around the
    /// origin.
    pub fn is_below(&self, other: &Self, half: f64) -> bool {
        let (gradient, offset) = (other.gradient - self.gradient, other.offset - self.offset);
        Self { gradient, offset }.least(half) >= 0.0
    }
}

impl Polytope {
    /// Becomes the cube of half side `half` around the origin.
    pub fn set_cube(&mut self, half: f64) {
        self.points.clear();
        self.ends.clear();
        for axis in 0..3 {
            for side in [-half, half] {
                for [a, b] in [[-half, -half], [half, -half], [half, half], [-half, half]] {
                    let mut point = Vector3::zeros();
                    (point[axis], point[(axis + 1) % 3], point[(axis + 2) % 3]) = (side, a, b);
                    self.points.push(point);
                }
                self.ends.push(self.points.len());
            }
        }
    }

    /// Becomes the same as another one.
    pub fn set(&mut self, other: &Self) {
        self.points.clone_from(&other.points);
        self.ends.clone_from(&other.ends);
    }

    /// Loses what does not lie in a half space.
    pub fn clip(&mut self, half_space: &HalfSpace) {
        let value = |point: &Vector3| half_space.rounded_at(point);
        if self.points.iter().all(|point| value(point) >= 0.0) {
            return;
        }
        let (points, ends) = &mut self.next;
        points.clear();
        ends.clear();
        self.cap.clear();
        if self.points.iter().any(|point| value(point) > 0.0) {
            let mut begin = 0;
            for &end in &self.ends {
                let ring = &self.points[begin..end];
                let first = points.len();
                for (k, a) in ring.iter().enumerate() {
                    let b = &ring[(k + 1) % ring.len()];
                    let (at, then) = (value(a), value(b));
                    if at >= 0.0 {
                        points.push(*a);
                    }
                    if at == 0.0 {
                        self.cap.push(*a);
                    }
                    // From inside to outside in both faces that share the edge, so that both get the same
                    // point.
                    let crossing = match (at > 0.0, then > 0.0) {
                        (true, false) if then < 0.0 => a + (b - a) * (at / (at - then)),
                        (false, true) if at < 0.0 => b + (a - b) * (then / (then - at)),
                        _ => continue,
                    };
                    points.push(crossing);
                    self.cap.push(crossing);
                }
                if points.len() < first + 3 {
                    points.truncate(first);
                } else {
                    ends.push(points.len());
                }
                begin = end;
            }
            if put_around(&mut self.cap, &mut self.flat, &half_space.gradient) {
                points.extend_from_slice(&self.cap);
                ends.push(points.len());
            }
        }
        std::mem::swap(&mut self.points, &mut self.next.0);
        std::mem::swap(&mut self.ends, &mut self.next.1);
    }

    /// Volume, to rounding.
    pub fn volume(&self) -> f64 {
        let Some(apex) = self.points.first() else { return 0.0 };
        let (mut sum, mut begin) = (0.0, 0);
        for &end in &self.ends {
            let ring = &self.points[begin..end];
            let area =
                ring[1..].windows(2).map(|w| (w[0] - ring[0]).cross(&(w[1] - ring[0]))).sum::<Vector3>();
            // The pyramids from a corner to all faces fill a convex solid.
            sum += area.dot(&(ring[0] - apex)).abs();
            begin = end;
        }
        sum / 6.0
    }
}

/// Leaves the corners of a convex face in order around it (Andrew's monotone chain); false where they are too
/// few for a face. Corners that only rounding tells from their neighbours, or from the line between those,
/// are none: they would be more with every cut.
fn put_around(cap: &mut Vec<Vector3>, flat: &mut Vec<([f64; 2], Vector3)>, normal: &Vector3) -> bool {
    let across = normal.cross(&Vector3::ith(normal.iamin(), 1.0)).normalize();
    let along = normal.normalize().cross(&across);
    flat.clear();
    flat.extend(cap.iter().map(|point| ([point.dot(&across), point.dot(&along)], *point)));
    flat.sort_by(|(a, _), (b, _)| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    cap.clear();
    let turn = |a: &Vector3, b: &Vector3, c: &Vector3| (b - a).cross(&(c - a)).dot(normal);
    // Forth below, and back above.
    let mut chain = |points: &mut dyn Iterator<Item = &([f64; 2], Vector3)>| {
        let first = cap.len();
        for (_, point) in points {
            while cap.len() > first + 1 && turn(&cap[cap.len() - 2], &cap[cap.len() - 1], point) <= 0.0 {
                cap.pop();
            }
            cap.push(*point);
        }
        cap.pop();
    };
    chain(&mut flat.iter());
    chain(&mut flat.iter().rev());
    cap.len() >= 3
}

#[cfg(test)]
mod tests {
    use super::*;

    fn half_space(gradient: [f64; 3], offset: f64) -> HalfSpace {
        HalfSpace { gradient: gradient.into(), offset }
    }

    fn left(half: f64, half_spaces: &[HalfSpace]) -> f64 {
        let mut polytope = Polytope::default();
        polytope.set_cube(half);
        half_spaces.iter().for_each(|h| polytope.clip(h));
        polytope.volume()
    }

    #[test]
    fn cut_cubes_have_their_closed_forms() {
        let near = |got: f64, exact: f64| assert!((got - exact).abs() < 1e-14, "{got} {exact}");
        near(left(0.5, &[]), 1.0);
        for k in 0..=10 {
            let d = 0.1 * f64::from(k) - 0.5;
            near(left(0.5, &[half_space([0.0, 3.0, 0.0], 3.0 * d)]), d + 0.5);
            // A corner: a tetrahedron of legs 1 + d; a wedge along an edge.
            near(left(0.5, &[half_space([1.0; 3], -1.0 + d)]), (0.5 + d).powi(3) / 6.0);
            near(left(0.5, &[half_space([1.0, 0.0, -1.0], -0.5 + d)]), (0.5 + d).powi(2) / 2.0);
        }
        // Planes through faces, edges and corners, twice the same one, all and nothing.
        near(left(1.0, &[half_space([1.0, 0.0, 0.0], 1.0), half_space([-1.0, 0.0, 0.0], 1.0)]), 8.0);
        near(left(1.0, &[half_space([1.0, 1.0, 0.0], 0.0); 3]), 4.0);
        near(left(1.0, &[half_space([1.0, 1.0, 0.0], 0.0), half_space([-1.0, -1.0, 0.0], 0.0)]), 0.0);
        near(left(1.0, &[half_space([1.0, -1.0, 0.0], 0.0), half_space([0.0, 1.0, -1.0], 0.0)]), 4.0 / 3.0);
        near(left(1.0, &[half_space([0.0; 3], 0.1)]), 8.0);
        near(left(1.0, &[half_space([0.0; 3], -0.1), half_space([1.0; 3], 0.0)]), 0.0);
        near(left(1.0, &[half_space([1.0; 3], 3.0)]), 8.0);
        near(left(1.0, &[half_space([1.0; 3], -3.0)]), 0.0);
    }

    #[test]
    fn both_sides_of_any_planes_fill_the_cube() {
        let mut state = 12345u64;
        let mut random = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
        };
        for _ in 0..500 {
            let planes: [HalfSpace; 4] =
                std::array::from_fn(|_| half_space([random(), random(), random()], 0.3 * random()));
            let sides = |bits: usize| -> Vec<HalfSpace> {
                let side = |(k, p): (usize, &HalfSpace)| {
                    if bits >> k & 1 == 1 { *p } else { half_space((-p.gradient).into(), -p.offset) }
                };
                planes.iter().enumerate().map(side).collect()
            };
            let sum: f64 = (0..16).map(|bits| left(0.5, &sides(bits))).sum();
            assert!((sum - 1.0).abs() < 1e-12, "{planes:?} {sum}");
            // Against places on a grid.
            let (some, n) = (sides(15), 40);
            let at = |k: usize| (k as f64 + 0.5) / n as f64 - 0.5;
            let places = (0..n * n * n).map(|k| Vector3::new(at(k % n), at(k / n % n), at(k / n / n)));
            let count = places.filter(|q| some.iter().all(|h| h.at(q) >= 0.0)).count();
            let share = count as f64 / (n * n * n) as f64;
            assert!((share - left(0.5, &some)).abs() < 5e-3, "{planes:?} {share}");
        }
    }

    /// Many planes that lie in one another but for rounding, as of moves of equal height: a face has no more
    /// corners than cuts, and the volume is that of one cut.
    #[test]
    fn cuts_that_only_rounding_tells_apart_do_not_multiply_corners() {
        let mut state = 99u64;
        let mut random = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
        };
        for scale in [1e-16, 1e-14, 1e-12, 1e-9] {
            let mut polytope = Polytope::default();
            polytope.set_cube(0.5);
            for _ in 0..40 {
                let tilted = [scale * random(), scale * random(), 1.0 + scale * random()];
                polytope.clip(&half_space(tilted, 0.1 + scale * random()));
                polytope.clip(&half_space([0.6, 0.8 + scale * random(), scale * random()], 0.3));
            }
            assert!(polytope.points.len() < 2000, "{scale}: {}", polytope.points.len());
            let mut once = Polytope::default();
            once.set_cube(0.5);
            once.clip(&half_space([0.0, 0.0, 1.0], 0.1));
            once.clip(&half_space([0.6, 0.8, 0.0], 0.3));
            let off = (polytope.volume() - once.volume()).abs();
            assert!(off < 4.0 * scale + 1e-14, "{scale}: {off}");
        }
    }
}
