//! Scalar functions on a parameter rectangle: tensor-product B-splines, grids and
//! coordinates.

use super::grid::GridField;
use geometry::KnotVector;

/// A tensor-product B-spline function `Σ c_ij N_i(u) N_j(v)`.
#[derive(Debug, Clone, PartialEq)]
pub struct ScalarSpline {
    knots_u: KnotVector,
    knots_v: KnotVector,
    /// `[nv][nu]`, row-major.
    coefficients: Vec<f64>,
}

impl ScalarSpline {
    /// From coefficients `[nv][nu]`; `None` unless there are as many as the knots call for.
    pub fn new(knots_u: KnotVector, knots_v: KnotVector, coefficients: Vec<f64>) -> Option<Self> {
        let fits = coefficients.len() == knots_u.control_count() * knots_v.control_count();
        fits.then_some(Self { knots_u, knots_v, coefficients })
    }

    /// Coefficients, `[nv][nu]`.
    pub fn coefficients(&self) -> &[f64] {
        &self.coefficients
    }

    /// Knots of u and v.
    pub fn knots(&self) -> (&KnotVector, &KnotVector) {
        (&self.knots_u, &self.knots_v)
    }

    /// Value and first derivatives `[f, f_u, f_v]`; parameters are clamped to the domain.
    pub fn value_and_gradient(&self, u: f64, v: f64) -> [f64; 3] {
        match (self.knots_u.degree(), self.knots_v.degree()) {
            // Stream functions are cubic.
            (3, 3) => {
                self.combine(self.knots_u.basis_and_slopes::<4>(u), self.knots_v.basis_and_slopes::<4>(v))
            }
            _ => self.combine(self.knots_u.basis_derivatives(u, 1), self.knots_v.basis_derivatives(v, 1)),
        }
    }

    /// From the first basis function along u and v with their values, `[0]`, and slopes, `[1]`.
    #[inline(always)]
    fn combine<const N: usize, const ROWS: usize>(
        &self,
        (first_u, bu): (usize, [[f64; N]; ROWS]),
        (first_v, bv): (usize, [[f64; N]; ROWS]),
    ) -> [f64; 3] {
        let nu = self.knots_u.control_count();
        let (pu, pv) = (self.knots_u.degree().min(N - 1), self.knots_v.degree().min(N - 1));
        let mut out = [0.0; 3];
        for j in 0..=pv {
            let row = (first_v + j) * nu + first_u;
            let coefficients = &self.coefficients[row..=row + pu];
            let (mut value, mut slope) = (0.0, 0.0);
            for (i, c) in coefficients.iter().enumerate() {
                value += c * bu[0][i];
                slope += c * bu[1][i];
            }
            out[0] += value * bv[0][j];
            out[1] += slope * bv[0][j];
            out[2] += value * bv[1][j];
        }
        out
    }
}

/// A coordinate of the domain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Axis {
    /// First parameter.
    U,
    /// Second parameter.
    V,
}

/// A function whose level curves are passes.
#[derive(Debug, Clone, PartialEq)]
pub enum ScalarField {
    /// A fitted stream function.
    Spline(ScalarSpline),
    /// A function on a grid.
    Grid(GridField),
    /// A function on a grid and what a spline puts to it.
    Corrected(GridField, ScalarSpline),
    /// A parameter itself: its level curves are the isoparametric lines of the other one.
    Coordinate(Axis),
}

impl ScalarField {
    /// `[ψ, ψ_u, ψ_v]`.
    pub fn value_and_gradient(&self, u: f64, v: f64) -> [f64; 3] {
        match self {
            Self::Spline(spline) => spline.value_and_gradient(u, v),
            Self::Grid(grid) => grid.value_and_gradient(u, v),
            Self::Corrected(grid, spline) => {
                let (a, b) = (grid.value_and_gradient(u, v), spline.value_and_gradient(u, v));
                [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
            }
            Self::Coordinate(Axis::U) => [u, 1.0, 0.0],
            Self::Coordinate(Axis::V) => [v, 0.0, 1.0],
        }
    }
}

/// Length of the surface gradient of ψ, `√((G ψ_u² − 2F ψ_u ψ_v + E ψ_v²)/(EG − F²))`, from its
/// parameter derivatives and the first fundamental form; 0 where the metric is degenerate.
pub fn surface_gradient_length((e, f, g): (f64, f64, f64), psi_u: f64, psi_v: f64) -> f64 {
    let determinant = e * g - f * f;
    if determinant <= 0.0 {
        return 0.0;
    }
    ((g * psi_u * psi_u - 2.0 * f * psi_u * psi_v + e * psi_v * psi_v).max(0.0) / determinant).sqrt()
}
