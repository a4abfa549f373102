//! Creases of a patch: knot lines along which its normal jumps, and the offset is torn or crosses itself.

use super::OffsetSurface;
use geometry::{KnotVector, Vector3, angle_between, unit_normal};

/// Places looked at in each span along a knot line.
const LOOKS: usize = 8;

/// A knot line across which the normal jumps.
pub(super) struct Crease {
    /// The knot.
    pub at: f64,
    /// Greatest angle between the normals on its two sides, rad.
    pub angle: f64,
    /// The other parameter, where the crease is most concave toward the side of the offset; `None` where it
    /// is convex or flat all along.
    pub most_concave: Option<f64>,
}

/// How smooth a knot line is: the derivatives that are continuous there, 0 for position alone.
pub(super) fn continuity(knots: &KnotVector, at: f64) -> usize {
    knots.degree().saturating_sub(knots.knots().iter().filter(|&&k| k == at).count())
}

/// The creases along knots of u (`along` 0) or v (1) whose angle tears the offset by more than `gap`, mm.
pub(super) fn creases(offset: &OffsetSurface, along: usize, gap: f64) -> Vec<Crease> {
    let surface = offset.surface;
    let knots = [surface.knots_u(), surface.knots_v()];
    let breaks = knots[along].breaks();
    let others = looks(&knots[1 - along].breaks());
    let torn = |&at: &f64| (continuity(knots[along], at) == 0).then(|| crease(offset, along, at, &others));
    let inner = breaks.get(1..breaks.len() - 1).unwrap_or_default();
    inner.iter().filter_map(torn).filter(|c| c.angle * offset.distance.abs() > gap).collect()
}

fn looks(breaks: &[f64]) -> Vec<f64> {
    let places = |w: &[f64]| {
        let [lo, hi] = [w[0], w[1]];
        (0..LOOKS).map(move |k| lo + (hi - lo) * (k as f64 + 0.5) / LOOKS as f64)
    };
    breaks.windows(2).flat_map(places).collect()
}

fn crease(offset: &OffsetSurface, along: usize, at: f64, others: &[f64]) -> Crease {
    let surface = offset.surface;
    let place = |across: f64, other: f64| if along == 0 { [across, other] } else { [other, across] };
    let mut found = Crease { at, angle: 0.0, most_concave: None };
    let mut deepest = 0.0;
    for &other in others {
        let [before, after] = [place(at.next_down(), other), place(at, other)];
        let normals = [before, after].map(|[u, v]| unit_normal(surface, u, v));
        let [Some(n0), Some(n1)] = normals else { continue };
        let angle = angle_between(&n0, &n1);
        let jet = surface.jet(after[0], after[1]);
        let across: Vector3 = if along == 0 { jet.du } else { jet.dv };
        // Concave toward the normal where normals lean toward each other.
        let leaning = -(n1 - n0).dot(&across) * offset.distance;
        found.angle = f64::max(found.angle, angle);
        if leaning > 0.0 && angle > deepest {
            deepest = angle;
            found.most_concave = Some(other);
        }
    }
    found
}
