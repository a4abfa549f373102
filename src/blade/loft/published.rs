//! The offset surface of sections as it was published for blades (second source of `scenes/sources`): points
//! of each section by chord error, each moved along the section's normal in its plane, splines through them,
//! and a loft at equal shares of their lengths.
//!
//! Enters: sections, a distance and a chord error, mm. Leaves: one surface. Nothing is trimmed: where a
//! section is as hollow as the distance, its offset turns back and crosses itself, and so does the surface.
//! The number of shares is that of the longest list of points; how far the surface strays from the splines
//! between them is told, and nothing is done about it. As [`super::loft_of_offsets`], which mends both, it
//! lies `d cos φ` off the surface of the sections instead of `d`.

use geometry::{CubicSpline, Point2, Vector2};
use offset::CurveOffsetError;

use super::{FIRST_SPANS, Loft, LoftError, LoftSection, Skin, check};

/// Points nearer to each other than this, mm, are one: around a centre of curvature many are.
const SAME: f64 = 1e-9;

/// Offsets each section in its own plane by `distance`, mm, positive to the left of its sense, untrimmed, and
/// lofts what comes out.
///
/// # Errors
/// See [`LoftError`].
///
/// # Tolerance
/// Points of the sections lie within `chord_error`, mm, of their curves; nothing else is bounded.
pub fn loft_as_published(
    sections: &[LoftSection],
    distance: f64,
    chord_error: f64,
) -> Result<Loft, LoftError> {
    check(sections, chord_error)?;
    let offset = |section: usize| {
        let failed = |e| LoftError::Offset { section, source: CurveOffsetError::Spline(e) };
        untrimmed(sections[section].curve, distance, chord_error).map_err(failed)
    };
    let curves = (0..sections.len()).map(offset).collect::<Result<Vec<_>, _>>()?;
    let moved: Vec<LoftSection> =
        curves.iter().zip(sections).map(|(curve, s)| LoftSection { curve, height: s.height }).collect();
    let closed = sections[0].curve.is_closed();
    let skin = Skin { sections: &moved, arcs: moved.iter().map(|s| s.curve.arc_length()).collect(), closed };
    let spans = curves.iter().map(|curve| curve.points().len()).fold(FIRST_SPANS, usize::max);
    let shares: Vec<f64> = (0..=spans).map(|k| k as f64 / spans as f64).collect();
    let (surface, section_parameters) = skin.through(&shares)?;
    let strays = skin.strays(&surface, &section_parameters, &shares);
    let error_mm = strays.iter().map(|stray| stray.error).fold(0.0, f64::max);
    Ok(Loft { surface, section_parameters, points: shares.len() - usize::from(closed), error_mm })
}

/// A spline through the points of a curve, each moved along the normal.
fn untrimmed(
    curve: &CubicSpline,
    distance: f64,
    chord_error: f64,
) -> Result<CubicSpline, geometry::SplineError> {
    let mut places = curve.within_chord(chord_error);
    if curve.is_closed() {
        places.pop();
    }
    let mut points: Vec<Point2> = Vec::with_capacity(places.len());
    for t in places {
        let (p, tangent, _) = curve.jet(t);
        let left = Vector2::new(-tangent.y, tangent.x).try_normalize(0.0).unwrap_or_else(Vector2::zeros);
        let moved = p + left * distance;
        if points.last().is_none_or(|last| (moved - last).norm() > SAME) {
            points.push(moved);
        }
    }
    let parameters = CubicSpline::chord_lengths(&points, curve.is_closed());
    if curve.is_closed() {
        CubicSpline::closed(parameters, points)
    } else {
        CubicSpline::open(parameters, points)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::loft_of_offsets;

    /// Parabolas y = bend x²/2 from x = −2 to 2 at three heights; the left side of their sense is above them.
    fn parabola(bend: f64) -> CubicSpline {
        let points: Vec<Point2> = (0..=80)
            .map(|k| {
                let x = -2.0 + 0.05 * f64::from(k);
                Point2::new(x, 0.5 * bend * x * x)
            })
            .collect();
        CubicSpline::open(CubicSpline::chord_lengths(&points, false), points).unwrap()
    }

    /// The parallel curve in closed form, at many places.
    fn parallel(bend: f64, distance: f64) -> Vec<Point2> {
        let at = |k: i32| {
            let x = -2.0 + 4.0 * f64::from(k) / 40_000.0;
            let (slope, length) = (bend * x, (1.0 + (bend * x).powi(2)).sqrt());
            Point2::new(x - distance * slope / length, 0.5 * bend * x * x + distance / length)
        };
        (0..=40_000).map(at).collect()
    }

    fn both(bend: f64, distance: f64) -> (Loft, Result<Vec<Loft>, LoftError>) {
        let curve = parabola(bend);
        let sections = [0.0, 3.0, 6.0].map(|height| LoftSection { curve: &curve, height });
        (loft_as_published(&sections, distance, 1e-3).unwrap(), loft_of_offsets(&sections, distance, 1e-3))
    }

    /// x of the surface along a section.
    fn turns_back(loft: &Loft) -> bool {
        let x = |k: i32| loft.surface.point(f64::from(k) / 1000.0, 0.0).x;
        (0..1000).any(|k| x(k + 1) < x(k))
    }

    #[test]
    fn offsets_follow_the_parallel_curve_even_where_it_crosses_itself() {
        // A radius of 1 at the bottom: the first offset is round there, the second turns back.
        for (distance, back) in [(0.5, false), (1.6, true)] {
            let (published, _) = both(1.0, distance);
            assert_eq!(turns_back(&published), back, "{distance}");
            let truth = parallel(1.0, distance);
            for k in 0..=200 {
                let p = published.surface.point(f64::from(k) / 200.0, 0.5).xy();
                let off = truth.iter().map(|q| (q - p).norm()).fold(f64::INFINITY, f64::min);
                // Cusps are rounded by the splines.
                assert!(off < if back { 0.02 } else { 2e-3 }, "{distance} {k}: {off}");
            }
        }
    }

    #[test]
    fn what_crosses_itself_is_cut_off_by_the_other_loft_alone() {
        let (published, trimmed) = both(1.0, 1.6);
        let trimmed = trimmed.unwrap();
        assert!(turns_back(&published) && trimmed.iter().all(|loft| !turns_back(loft)));
        // Trimmed sides meet above the middle.
        let lowest = |loft: &Loft| {
            (0..=1000).map(|k| loft.surface.point(f64::from(k) / 1000.0, 0.0).y).fold(f64::INFINITY, f64::min)
        };
        let meeting = trimmed.iter().map(lowest).fold(f64::INFINITY, f64::min);
        // x (1 − d/√(1 + x²)) = 0 gives 1 + x² = d², so y = (d² − 1)/2 + 1.
        assert!((meeting - ((1.6f64.powi(2) - 1.0) / 2.0 + 1.0)).abs() < 5e-3, "{meeting}");
        // Its cusps, where 1 + x² is d to the power of two thirds; splines round them.
        let square = 1.6f64.powf(2.0 / 3.0);
        let cusp = 0.5 * (square - 1.0) + 1.6 / square.sqrt();
        assert!((lowest(&published) - cusp).abs() < 0.02, "{} {cusp}", lowest(&published));
        let (round, same) = both(0.2, 1.6);
        let same = same.unwrap();
        for k in 0..=50 {
            let u = f64::from(k) / 50.0;
            let apart = (round.surface.point(u, 0.4) - same[0].surface.point(u, 0.4)).norm();
            assert!(apart < 5e-3, "{apart}");
        }
    }
}
