//! Interpolation by tensor-product B-splines: control points from points at sites.
//!
//! Enters: knots and one site for each control point, clamped or periodic. Leaves: control points, in
//! O(n) for each row: collocation matrices of B-splines are banded and totally positive, so that elimination
//! needs no pivots (de Boor & Pinkus, *Backward error analysis for totally positive linear systems*, 1977).

use super::{KnotError, KnotVector, NurbsError, NurbsSurface, Point3, Vector3};

/// A matrix that is zero farther than `half` off its diagonal, as its LU factors.
struct Banded {
    half: usize,
    /// Row by row, `2 half + 1` entries each, the diagonal in the middle.
    entries: Vec<f64>,
}

impl Banded {
    /// Factors the matrix in place; `None` where a pivot vanishes.
    fn factor(half: usize, mut entries: Vec<f64>) -> Option<Self> {
        let width = 2 * half + 1;
        let n = entries.len() / width;
        for k in 0..n {
            let pivot = entries[k * width + half];
            if pivot.is_nan() || pivot.abs() < f64::MIN_POSITIVE {
                return None;
            }
            for i in k + 1..n.min(k + half + 1) {
                let lower = i * width + half + k - i;
                let factor = entries[lower] / pivot;
                entries[lower] = factor;
                for c in 1..=half {
                    entries[lower + c] -= factor * entries[k * width + half + c];
                }
            }
        }
        Some(Self { half, entries })
    }

    /// Replaces the right-hand sides by the solution.
    fn solve(&self, b: &mut [Vector3]) {
        let (half, width) = (self.half, 2 * self.half + 1);
        for i in 0..b.len() {
            for k in i.saturating_sub(half)..i {
                b[i] -= b[k] * self.entries[i * width + half + k - i];
            }
        }
        for i in (0..b.len()).rev() {
            for k in i + 1..b.len().min(i + half + 1) {
                b[i] -= b[k] * self.entries[i * width + half + k - i];
            }
            b[i] /= self.entries[i * width + half];
        }
    }
}

/// How control points follow from points.
enum System {
    /// One site for each control point.
    Clamped(Banded),
    /// Cubic and periodic: a tridiagonal system with one unknown more around its corner.
    Periodic { inner: Banded, column: Vec<Vector3>, row: [f64; 2], corner: f64 },
}

/// One direction of a net to interpolate: knots, and the parameters of the points.
pub struct InterpolationAxis {
    knots: KnotVector,
    sites: Vec<f64>,
    system: System,
}

impl InterpolationAxis {
    /// Points at strictly ascending `sites`, knots their running averages (Piegl & Tiller eq. 9.8).
    ///
    /// # Errors
    /// See [`KnotError`]; sites that coincide make knots coincide.
    pub fn averaging(degree: usize, sites: &[f64]) -> Result<Self, KnotError> {
        let n = sites.len();
        if n <= degree {
            return Err(KnotError::TooFewControls { degree, controls: n });
        }
        let inner = sites[1..n - 1].windows(degree).map(|w| w.iter().sum::<f64>() / degree as f64);
        let knots: Vec<f64> = std::iter::repeat_n(sites[0], degree + 1)
            .chain(inner)
            .chain(std::iter::repeat_n(sites[n - 1], degree + 1))
            .collect();
        let knots = KnotVector::new(degree, knots, n)?;
        Self::clamped(knots, sites.to_vec()).ok_or(KnotError::TooFewControls { degree, controls: n })
    }

    fn clamped(knots: KnotVector, sites: Vec<f64>) -> Option<Self> {
        let half = knots.degree();
        let width = 2 * half + 1;
        let mut entries = vec![0.0; sites.len() * width];
        for (i, &site) in sites.iter().enumerate() {
            let (first, values) = knots.basis(site);
            for (k, &value) in values[..=half].iter().enumerate() {
                // Farther off the diagonal every function is zero where the sites allow a solution.
                if (first + k).abs_diff(i) <= half {
                    entries[i * width + half + first + k - i] = value;
                }
            }
        }
        let system = System::Clamped(Banded::factor(half, entries)?);
        Some(Self { knots, sites, system })
    }

    /// Cubic, C2 all around, through points at strictly ascending `sites`; the last entry is the end of the
    /// period, where the first point comes again. At least four points.
    ///
    /// # Errors
    /// See [`KnotError`].
    pub fn periodic(sites: &[f64]) -> Result<Self, KnotError> {
        let n = sites.len().saturating_sub(1);
        let few = KnotError::TooFewControls { degree: 3, controls: n };
        if n < 4 {
            return Err(few);
        }
        let period = sites[n] - sites[0];
        let knots: Vec<f64> = sites[n - 3..n]
            .iter()
            .map(|t| t - period)
            .chain(sites.iter().copied())
            .chain(sites[1..4].iter().map(|t| t + period))
            .collect();
        let knots = KnotVector::new(3, knots, n + 3)?;
        // Row k asks for control points k, k + 1 and k + 2; the unknowns are counted from the second, so
        // that the middle one stands on the diagonal.
        let rows: Vec<[f64; 3]> = sites[..n]
            .iter()
            .map(|&t| {
                let (_, values) = knots.basis(t);
                [values[0], values[1], values[2]]
            })
            .collect();
        let mut inner: Vec<f64> = rows[..n - 1].concat();
        inner[0] = 0.0;
        inner[3 * n - 4] = 0.0;
        let inner = Banded::factor(1, inner).ok_or(few)?;
        // The last unknown stands in the first and the last row of the rest.
        let mut column = vec![Vector3::zeros(); n - 1];
        column[0].x = rows[0][0];
        column[n - 2].x = rows[n - 2][2];
        inner.solve(&mut column);
        let row = [rows[n - 1][2], rows[n - 1][0]];
        let corner = rows[n - 1][1] - row[0] * column[0].x - row[1] * column[n - 2].x;
        let system = System::Periodic { inner, column, row, corner };
        Ok(Self { knots, sites: sites[..n].to_vec(), system })
    }

    /// Parameters of the points.
    pub fn sites(&self) -> &[f64] {
        &self.sites
    }

    /// From points at the sites to control points.
    fn control_points(&self, mut points: Vec<Vector3>) -> Vec<Vector3> {
        match &self.system {
            System::Clamped(banded) => banded.solve(&mut points),
            System::Periodic { inner, column, row, corner } => {
                let n = points.len();
                let (rest, last) = points.split_at_mut(n - 1);
                inner.solve(rest);
                let x = (last[0] - rest[0] * row[0] - rest[n - 2] * row[1]) / *corner;
                for (p, c) in rest.iter_mut().zip(column) {
                    *p -= x * c.x;
                }
                last[0] = x;
                points.rotate_right(1);
                points.extend_from_within(..3);
            }
        }
        points
    }
}

/// The surface through `points[i][j]` at the sites `i` of `u` and `j` of `v`.
///
/// # Errors
/// See [`NurbsError`]: a control point may lie beyond the greatest coordinate.
pub fn interpolate(
    u: &InterpolationAxis,
    v: &InterpolationAxis,
    points: &[Vec<Point3>],
) -> Result<NurbsSurface, NurbsError> {
    let columns: Vec<Vec<Vector3>> = (0..v.sites.len())
        .map(|j| u.control_points(points.iter().map(|row| row[j].coords).collect()))
        .collect();
    let net: Vec<Vec<Point3>> = (0..u.knots.control_count())
        .map(|i| {
            let row = v.control_points(columns.iter().map(|column| column[i]).collect());
            row.into_iter().map(Point3::from).collect()
        })
        .collect();
    let knots = |axis: &InterpolationAxis| axis.knots.knots().to_vec();
    NurbsSurface::new(u.knots.degree(), v.knots.degree(), knots(u), knots(v), &net, None)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn ascending(gaps: &[f64]) -> Vec<f64> {
        (0..gaps.len()).map(|k| gaps[..k].iter().sum::<f64>() - 0.7).collect()
    }

    proptest! {
        /// Whatever the spacing, the surface passes through its points; a closed one has the same jets on
        /// both sides of its seam.
        #[test]
        fn surfaces_pass_through_their_points(
            gaps_u in prop::collection::vec(0.02f64..2.0, 6..20),
            gaps_v in prop::collection::vec(0.02f64..2.0, 2..9),
            seed in prop::collection::vec(-1.0f64..1.0, 180 * 3),
        ) {
            let us = ascending(&gaps_u);
            let vs = ascending(&gaps_v);
            let point = |i: usize, j: usize| {
                let k = 3 * (i * vs.len() + j);
                Point3::new(seed[k], seed[k + 1], seed[k + 2])
            };
            let v = InterpolationAxis::averaging(3.min(vs.len() - 1), &vs).unwrap();
            for closed in [false, true] {
                let u = if closed { InterpolationAxis::periodic(&us).unwrap() } else { InterpolationAxis::averaging(3, &us).unwrap() };
                let points: Vec<Vec<Point3>> =
                    (0..u.sites().len()).map(|i| (0..vs.len()).map(|j| point(i, j)).collect()).collect();
                let s = interpolate(&u, &v, &points).unwrap();
                for (i, &a) in u.sites().iter().enumerate() {
                    for (j, &b) in v.sites().iter().enumerate() {
                        prop_assert!((s.point(a, b) - points[i][j]).norm() < 1e-9);
                    }
                }
                prop_assert_eq!(s.domain()[0], [us[0], us[us.len() - 1]]);
                if closed {
                    let mid = 0.4 * vs[0] + 0.6 * vs[vs.len() - 1];
                    let (a, b) = (s.jet(us[0], mid), s.jet(us[us.len() - 1], mid));
                    let close = |a: Vector3, b: Vector3| (a - b).norm() < 1e-8 * (1.0 + a.norm());
                    prop_assert!(close(a.p.coords, b.p.coords) && close(a.du, b.du) && close(a.duu, b.duu));
                    prop_assert!(close(a.dv, b.dv) && close(a.duv, b.duv) && close(a.dvv, b.dvv));
                }
            }
        }
    }

    #[test]
    fn too_few_or_equal_sites_are_refused() {
        assert!(InterpolationAxis::averaging(3, &[0.0, 1.0, 2.0]).is_err());
        assert!(InterpolationAxis::averaging(1, &[0.0, 1.0, 1.0, 2.0]).is_err());
        assert!(InterpolationAxis::periodic(&[0.0, 1.0, 2.0, 3.0]).is_err());
        assert!(InterpolationAxis::periodic(&[0.0, 1.0, 1.0, 1.0, 1.0, 3.0]).is_err());
        assert!(InterpolationAxis::averaging(2, &[0.0, f64::NAN, 2.0, 3.0]).is_err());
    }
}
