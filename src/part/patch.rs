//! One parametric patch of a part, whatever it is made of.

use geometry::{AnalyticSurface, Jet2, NurbsSurface, Point3, Vector3, normal_at};

/// A parametric patch.
#[derive(Debug, Clone, PartialEq)]
pub enum Patch {
    /// A NURBS patch.
    Nurbs(NurbsSurface),
    /// A surface by formula.
    Analytic(AnalyticSurface),
}

impl Patch {
    /// Parameter range `[[u0, u1], [v0, v1]]`.
    pub fn domain(&self) -> [[f64; 2]; 2] {
        match self {
            Self::Nurbs(s) => s.domain(),
            Self::Analytic(s) => s.domain(),
        }
    }

    /// Position and derivatives to second order; parameters are clamped to the domain.
    pub fn jet(&self, u: f64, v: f64) -> Jet2 {
        match self {
            Self::Nurbs(s) => s.jet(u, v),
            Self::Analytic(s) => s.jet(u, v),
        }
    }

    /// Position alone, cheaper than a jet.
    pub fn point(&self, u: f64, v: f64) -> Point3 {
        match self {
            Self::Nurbs(s) => s.point(u, v),
            Self::Analytic(s) => s.jet(u, v).p,
        }
    }

    /// Unit normal on the side of `du × dv`. At a pole that of the surface close by; up where the
    /// patch has no normal at all.
    pub fn normal(&self, u: f64, v: f64) -> Vector3 {
        self.normal_of(&self.jet(u, v), u, v)
    }

    /// As [`Patch::normal`] for a jet that is already there.
    pub(super) fn normal_of(&self, jet: &Jet2, u: f64, v: f64) -> Vector3 {
        match self {
            Self::Nurbs(s) => normal_of(s, jet, [u, v]),
            // Graphs have a normal everywhere.
            Self::Analytic(_) => jet.normal().unwrap_or_else(Vector3::z),
        }
    }

    /// Parameters a little inside of a degenerate border (a pole) at `at`, spread along it.
    pub(super) fn around(&self, at: [f64; 2]) -> Vec<[f64; 2]> {
        /// Meridians tried.
        const MERIDIANS: usize = 16;
        /// Share of the range by which the starts lie inside. Nearer, their derivatives drown in
        /// rounding; farther, the descent begins at another place.
        const INSIDE: f64 = 1.0e-4;
        let domain = self.domain();
        let inside = |k: usize| at[k] + INSIDE * (0.5 * (domain[k][0] + domain[k][1]) - at[k]);
        let spread = |k: usize, m: usize| {
            let [lo, hi] = domain[k];
            lo + (hi - lo) * ((m as f64 + 0.5) / MERIDIANS as f64)
        };
        // Which of the two parameters runs along the border is told by the derivative that vanishes.
        let jet = self.jet(at[0], at[1]);
        let along_u = jet.du.norm_squared() < jet.dv.norm_squared();
        (0..MERIDIANS)
            .map(|m| if along_u { [spread(0, m), inside(1)] } else { [inside(0), spread(1, m)] })
            .collect()
    }

    /// Parameter lines that no triangle may cross: ends, creases, and where a wave turns.
    pub(super) fn kept_lines(&self) -> [Vec<f64>; 2] {
        match self {
            Self::Nurbs(s) => [s.knots_u().breaks(), s.knots_v().breaks()],
            Self::Analytic(s) => s.quarter_waves(),
        }
    }
}

/// Normal of a jet at parameters; at a pole its limit, or that of the surface close by; up where there is
/// none.
pub(super) fn normal_of(surface: &NurbsSurface, jet: &Jet2, at: [f64; 2]) -> Vector3 {
    normal_at(surface, jet, at).unwrap_or_else(Vector3::z)
}
