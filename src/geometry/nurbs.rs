//! NURBS patches: points and exact rational derivatives to second order.
//!
//! Enters: degrees, knots, a net of control points (mm) and weights, checked once. Leaves: points
//! and jets at parameters clamped to the domain. Control points are kept in homogeneous form
//! `(w x, w y, w z, w)`; derivatives follow Piegl & Tiller, *The NURBS Book* (1997), A3.6 and
//! eq. 4.20. Where an inner knot stands `degree` times the patch may have a crease; a jet there is
//! that of the side toward greater parameters.
//!
//! The core is our own, because evaluations must not allocate.

use super::bspline::{KnotError, KnotVector};
use super::{Aabb, Isometry3, Jet2, MAX_COORDINATE, Point3, Vector3};

/// Weights must lie between the inverse of this and this. Beyond, a control point is either
/// without influence or swallows its neighbours to the last digit, and products overflow.
pub const MAX_WEIGHT: f64 = 1.0e6;

/// Why a patch was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NurbsError {
    /// The knots of one direction cannot be used.
    #[error("along {axis}: {source}")]
    Knots {
        /// `u` or `v`.
        axis: char,
        /// What is wrong with them.
        source: KnotError,
    },
    /// A row of the net has another length than the first.
    #[error(
        "row {row} of the {what} has {found} entries; {expected} are needed (row 0 of the control points sets it)"
    )]
    Row {
        /// `control points` or `weights`.
        what: &'static str,
        /// Which row, counted from 0 along u.
        row: usize,
        /// Its length.
        found: usize,
        /// The length it should have.
        expected: usize,
    },
    /// There are more or fewer rows of weights than of control points.
    #[error(
        "there are {found} rows of weights and {expected} rows of control points; each point needs one weight"
    )]
    WeightRows {
        /// Rows of weights.
        found: usize,
        /// Rows of control points.
        expected: usize,
    },
    /// A control point is not finite or too far out.
    #[error("control point [{row}][{column}] is ({x}, {y}, {z}); coordinates must be numbers within ±1e6 mm")]
    Point {
        /// Index along u, from 0.
        row: usize,
        /// Index along v, from 0.
        column: usize,
        /// Its x.
        x: f64,
        /// Its y.
        y: f64,
        /// Its z.
        z: f64,
    },
    /// A weight is not positive or out of range.
    #[error("weight [{row}][{column}] is {weight}; weights must lie between 1e-6 and 1e6")]
    Weight {
        /// Index along u, from 0.
        row: usize,
        /// Index along v, from 0.
        column: usize,
        /// What stands there.
        weight: f64,
    },
}

/// A NURBS patch.
#[derive(Debug, Clone, PartialEq)]
pub struct NurbsSurface {
    u: KnotVector,
    v: KnotVector,
    /// `(w x, w y, w z, w)`, `[along u][along v]`, row-major.
    net: Vec<[f64; 4]>,
}

impl NurbsSurface {
    /// Checks a patch. `control_points[i][j]` (mm) belongs to the `i`-th basis function of u and
    /// the `j`-th of v; `weights` has the same shape, `None` stands for 1 everywhere.
    ///
    /// # Errors
    /// See [`NurbsError`].
    pub fn new(
        degree_u: usize,
        degree_v: usize,
        knots_u: Vec<f64>,
        knots_v: Vec<f64>,
        control_points: &[Vec<Point3>],
        weights: Option<&[Vec<f64>]>,
    ) -> Result<Self, NurbsError> {
        let columns = control_points.first().map_or(0, Vec::len);
        let u = KnotVector::new(degree_u, knots_u, control_points.len())
            .map_err(|source| NurbsError::Knots { axis: 'u', source })?;
        let v = KnotVector::new(degree_v, knots_v, columns)
            .map_err(|source| NurbsError::Knots { axis: 'v', source })?;
        check_rows("control points", control_points, columns)?;
        if let Some(weights) = weights {
            if weights.len() != control_points.len() {
                return Err(NurbsError::WeightRows { found: weights.len(), expected: control_points.len() });
            }
            check_rows("weights", weights, columns)?;
        }
        let mut net = Vec::with_capacity(control_points.len() * columns);
        for (row, points) in control_points.iter().enumerate() {
            for (column, p) in points.iter().enumerate() {
                let weight = weights.map_or(1.0, |w| w[row][column]);
                net.push(homogeneous(row, column, p, weight)?);
            }
        }
        Ok(Self { u, v, net })
    }

    /// The surface put elsewhere.
    #[must_use]
    pub fn moved(&self, to: &Isometry3) -> Self {
        let moved = |&[x, y, z, w]: &[f64; 4]| {
            let p = to.rotation * Vector3::new(x, y, z) + to.translation.vector * w;
            [p.x, p.y, p.z, w]
        };
        Self { u: self.u.clone(), v: self.v.clone(), net: self.net.iter().map(moved).collect() }
    }

    /// Parameter range `[[u0, u1], [v0, v1]]`.
    pub fn domain(&self) -> [[f64; 2]; 2] {
        [self.u.domain(), self.v.domain()]
    }

    /// Knots along u.
    pub fn knots_u(&self) -> &KnotVector {
        &self.u
    }

    /// Knots along v.
    pub fn knots_v(&self) -> &KnotVector {
        &self.v
    }

    /// Control point `(i, j)`, mm, and its weight.
    ///
    /// # Panics
    /// Out of the net.
    pub fn control_point(&self, i: usize, j: usize) -> (Point3, f64) {
        let [x, y, z, w] = self.net[i * self.v.control_count() + j];
        // Multiplied and divided, a coordinate at the limit may come back beyond it.
        let inside = |c: f64| (c / w).clamp(-MAX_COORDINATE, MAX_COORDINATE);
        (Point3::new(inside(x), inside(y), inside(z)), w)
    }

    /// Box around all control points, which holds the whole patch (convex hull property).
    pub fn control_bounds(&self) -> Aabb {
        let mut bounds = Aabb::EMPTY;
        for [x, y, z, w] in &self.net {
            bounds.grow(&(Point3::new(*x, *y, *z) / *w));
        }
        bounds
    }

    /// The point at `(u, v)`, clamped to the domain.
    pub fn point(&self, u: f64, v: f64) -> Point3 {
        let (first_u, bu) = self.u.basis(u);
        let (first_v, bv) = self.v.basis(v);
        let mut sum = [0.0; 4];
        for (r, &nu) in bu[..=self.u.degree()].iter().enumerate() {
            accumulate(&mut sum, nu, &combine(self.row(first_u + r, first_v), &bv));
        }
        let [x, y, z, w] = sum;
        Point3::new(x / w, y / w, z / w)
    }

    /// Position and derivatives at `(u, v)`, clamped to the domain.
    pub fn jet(&self, u: f64, v: f64) -> Jet2 {
        match [self.u.degree(), self.v.degree()] {
            [3, 3] => self.combined(self.u.basis_and_bends::<4>(u), self.v.basis_and_bends::<4>(v)),
            _ => self.combined(self.u.basis_derivatives(u, 2), self.v.basis_derivatives(v, 2)),
        }
    }

    /// By the basis functions along both parameters with their derivatives; each first entry is the first
    /// control point that matters.
    #[inline(always)]
    fn combined<const N: usize>(
        &self,
        (first_u, bu): (usize, [[f64; N]; 3]),
        (first_v, bv): (usize, [[f64; N]; 3]),
    ) -> Jet2 {
        let mut a = HomogeneousJet::default();
        for r in 0..=self.u.degree().min(N - 1) {
            let row = self.row(first_u + r, first_v);
            let [n, nu, nuu] = [bu[0][r], bu[1][r], bu[2][r]];
            let value = combine(row, &bv[0]);
            let dv = combine(row, &bv[1]);
            accumulate(&mut a.p, n, &value);
            accumulate(&mut a.du, nu, &value);
            accumulate(&mut a.duu, nuu, &value);
            accumulate(&mut a.dv, n, &dv);
            accumulate(&mut a.duv, nu, &dv);
            accumulate(&mut a.dvv, n, &combine(row, &bv[2]));
        }
        a.divide()
    }

    /// The control points of row `i` that matter from column `first` on.
    fn row(&self, i: usize, first: usize) -> &[[f64; 4]] {
        let start = i * self.v.control_count() + first;
        &self.net[start..=start + self.v.degree()]
    }
}

fn check_rows<T>(what: &'static str, rows: &[Vec<T>], expected: usize) -> Result<(), NurbsError> {
    match rows.iter().position(|r| r.len() != expected) {
        Some(row) => Err(NurbsError::Row { what, row, found: rows[row].len(), expected }),
        None => Ok(()),
    }
}

fn homogeneous(row: usize, column: usize, p: &Point3, weight: f64) -> Result<[f64; 4], NurbsError> {
    if p.iter().any(|c| c.is_nan() || c.abs() > MAX_COORDINATE) {
        return Err(NurbsError::Point { row, column, x: p.x, y: p.y, z: p.z });
    }
    if !(MAX_WEIGHT.recip()..=MAX_WEIGHT).contains(&weight) {
        return Err(NurbsError::Weight { row, column, weight });
    }
    Ok([p.x * weight, p.y * weight, p.z * weight, weight])
}

fn accumulate(sum: &mut [f64; 4], factor: f64, term: &[f64; 4]) {
    for c in 0..4 {
        sum[c] += factor * term[c];
    }
}

#[inline(always)]
fn combine(row: &[[f64; 4]], basis: &[f64]) -> [f64; 4] {
    let mut sum = [0.0; 4];
    for (point, &n) in row.iter().zip(basis) {
        accumulate(&mut sum, n, point);
    }
    sum
}

/// A jet of the homogeneous surface `(w S, w)`.
#[derive(Default)]
struct HomogeneousJet {
    p: [f64; 4],
    du: [f64; 4],
    dv: [f64; 4],
    duu: [f64; 4],
    duv: [f64; 4],
    dvv: [f64; 4],
}

impl HomogeneousJet {
    /// Quotient rule (Piegl & Tiller eq. 4.20 to second order).
    fn divide(&self) -> Jet2 {
        let split = |a: &[f64; 4]| (Vector3::new(a[0], a[1], a[2]), a[3]);
        let (p, w) = split(&self.p);
        let (du, wu) = split(&self.du);
        let (dv, wv) = split(&self.dv);
        let (duu, wuu) = split(&self.duu);
        let (duv, wuv) = split(&self.duv);
        let (dvv, wvv) = split(&self.dvv);
        let inverse = 1.0 / w;
        let p = p * inverse;
        let du = (du - p * wu) * inverse;
        let dv = (dv - p * wv) * inverse;
        Jet2 {
            p: p.into(),
            du,
            dv,
            duu: (duu - du * (2.0 * wu) - p * wuu) * inverse,
            duv: (duv - dv * wu - du * wv - p * wuv) * inverse,
            dvv: (dvv - dv * (2.0 * wv) - p * wvv) * inverse,
        }
    }
}

#[cfg(test)]
mod tests;
