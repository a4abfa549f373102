//! A surface through section curves: skinning with aligned arc lengths.
//!
//! Enters: sections, plane curves at ascending heights, all open or all closed, in one sense. Leaves: one
//! B-spline surface, u along the sections (0 to 1), v across them (0 to 1, upward). Every section gives
//! points at the same shares of its arc length; they are interpolated by common knots, cubic along u, and the
//! columns of points across sections, cubic from four sections on (Piegl & Tiller, *The NURBS Book*, 1997,
//! ch. 10.3, with points in place of compatible curves). Shares are halved where the surface strays from a
//! section or leans away from it, so that they crowd where any of the sections bends.
//!
//! A surface that only keeps its distance from the sections may still wave where an edge turns within a short
//! length. So it also keeps their tangents.
//!
//! Closed sections make one patch that is C² across its seam, with knots that are not clamped. `du × dv` lies
//! to the right of the sections' sense: outward when they run counter-clockwise.

mod offsets;
mod published;
#[cfg(test)]
mod tests;

pub use offsets::loft_of_offsets;
pub use published::loft_as_published;

use geometry::{
    ArcLength, CubicSpline, InterpolationAxis, KnotError, MAX_COORDINATE, NurbsError, NurbsSurface, Point2,
    Point3, interpolate, signed_area,
};
use offset::CurveOffsetError;
use offset::distance_from;

/// Spans along the sections at first.
const FIRST_SPANS: usize = 16;
/// Rounds of halving shares at most: down to a 1e-6th of the length.
const MAX_ROUNDS: usize = 16;
/// Points along a section at most.
const MAX_POINTS: usize = 10_000;
/// Shares between two points at which the deviation is measured, and what it may lie above the greatest seen
/// (an error like `t²(1 − t)²` loses an eighth over an eighth of a span).
const LOOKS: [f64; 3] = [0.25, 0.5, 0.75];
const SAFETY: f64 = 1.15;
/// Greatest angle, rad, between the surface and a section: where a section turns within a few hundredths of a
/// millimetre, a surface within tolerance may still wave, and its normals with it.
const MOST_ANGLE: f64 = 0.01;
/// Pieces shorter than this many tolerances are not asked for their angle.
const ASKED_FROM: f64 = 2.0;
/// Places at which the senses and starts of neighbouring sections are compared.
const COMPARED: usize = 64;

/// Why sections make no surface. Sections are counted from 0.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LoftError {
    /// Fewer than two sections.
    #[error("there are {0} sections; a surface needs at least 2")]
    TooFew(usize),
    /// The tolerance is no usual number.
    #[error("the tolerance is {0} mm; it must be a number greater than 0")]
    Tolerance(f64),
    /// A height is no usual number.
    #[error("section {section} has the height {height}; heights must be numbers of at most 1e6 mm in size")]
    Height {
        /// Which.
        section: usize,
        /// Its height, mm.
        height: f64,
    },
    /// Heights do not ascend.
    #[error(
        "section {section} has the height {height} mm, not above the {below} mm of the section before it; \
         order sections from low to high and delete repeated ones"
    )]
    Order {
        /// Which.
        section: usize,
        /// Its height, mm.
        height: f64,
        /// That of the one before, mm.
        below: f64,
    },
    /// Open and closed sections are mixed.
    #[error(
        "section {section} is {}, and section 0 is not; make all of them open, or all closed",
        if *closed { "closed" } else { "open" }
    )]
    Mixed {
        /// The first that differs from section 0.
        section: usize,
        /// Whether it is closed.
        closed: bool,
    },
    /// A section runs the other way.
    #[error("section {section} runs in the opposite sense to the section before it; reverse its points")]
    Sense {
        /// Which.
        section: usize,
    },
    /// A closed section starts elsewhere.
    #[error(
        "section {section} starts about {:.0} % of its length away from where the section before it starts; begin \
         its points at the same place, for example the trailing edge",
        100.0 * share
    )]
    Start {
        /// Which.
        section: usize,
        /// How far along its length the place lies that corresponds to the start of the section before.
        share: f64,
    },
    /// A section has next to no length.
    #[error("section {section} is {length:e} mm long, shorter than 10 times the tolerance; leave it out")]
    Short {
        /// Which.
        section: usize,
        /// Its length, mm.
        length: f64,
    },
    /// The surface does not follow a section within the tolerance.
    #[error(
        "the surface strays {reached:.2e} mm from section {section} at {:.2} % of its length, and {tolerance:.2e} mm is \
         asked for; use a greater tolerance, or smooth the section there",
        100.0 * share
    )]
    NotReached {
        /// Asked, mm.
        tolerance: f64,
        /// Reached, mm.
        reached: f64,
        /// Which section.
        section: usize,
        /// Where on it, as a share of its length.
        share: f64,
    },
    /// A section cannot be offset.
    #[error("section {section}: {source}")]
    Offset {
        /// Which.
        section: usize,
        /// Why.
        source: CurveOffsetError,
    },
    /// The offset of a section falls apart.
    #[error(
        "the offset of section {section} (height {height} mm) falls into {pieces} pieces, since the ball does not pass \
         between them; use a smaller cutter or leave that section out"
    )]
    Parted {
        /// Which.
        section: usize,
        /// Its height, mm.
        height: f64,
        /// Its pieces.
        pieces: usize,
    },
    /// Corners of offsets do not correspond to each other.
    #[error(
        "the corners at which the offset of section {section} (height {height} mm) is trimmed lie elsewhere than those of \
         the sections beside it: {found} smooth stretches where {expected} were to be joined; use a smaller cutter, put \
         sections closer together there, or leave that section out"
    )]
    Corners {
        /// The first that does not fit.
        section: usize,
        /// Its height, mm.
        height: f64,
        /// Its smooth stretches, broken where its neighbours have corners.
        found: usize,
        /// Stretches that all sections should have.
        expected: usize,
    },
    /// The knots would coincide.
    #[error("the surface's knots: {0}")]
    Knots(#[from] KnotError),
    /// The surface may not be stored.
    #[error("the surface: {0}")]
    Surface(#[from] NurbsError),
}

/// A plane curve at a height.
#[derive(Debug, Clone, Copy)]
pub struct LoftSection<'a> {
    /// The curve in x and y, mm.
    pub curve: &'a CubicSpline,
    /// Its z, mm.
    pub height: f64,
}

/// A surface through sections.
#[derive(Debug, Clone, PartialEq)]
pub struct Loft {
    /// Cubic along u; u and v from 0 to 1.
    pub surface: NurbsSurface,
    /// v of each section.
    pub section_parameters: Vec<f64>,
    /// Points along each section.
    pub points: usize,
    /// Bound of the distance between the surface and any section's curve, in its plane, mm: 1.15 times the
    /// greatest found at three places between neighbouring points.
    pub error_mm: f64,
}

/// The surface through sections of ascending heights, within `tolerance`, mm, of their curves.
///
/// # Errors
/// See [`LoftError`].
///
/// # Tolerance
/// At the sections' heights, see [`Loft::error_mm`]; there the surface also follows the sections' tangents to
/// 0.01 rad but in pieces shorter than two tolerances. Between sections the surface is what the interpolation
/// across makes of it.
pub fn loft(sections: &[LoftSection], tolerance: f64) -> Result<Loft, LoftError> {
    check(sections, tolerance)?;
    let closed = sections[0].curve.is_closed();
    let skin = Skin { sections, arcs: sections.iter().map(|s| s.curve.arc_length()).collect(), closed };
    skin.check_shapes(tolerance)?;
    let mut shares: Vec<f64> = (0..=FIRST_SPANS).map(|k| k as f64 / FIRST_SPANS as f64).collect();
    let mut worst = Stray { error: f64::INFINITY, angle: 0.0, section: 0, share: 0.0 };
    for _ in 0..MAX_ROUNDS {
        if shares.len() > MAX_POINTS {
            break;
        }
        let (surface, section_parameters) = skin.through(&shares)?;
        let strays = skin.strays(&surface, &section_parameters, &shares);
        let Some(&greatest) = strays.iter().max_by(|a, b| a.error.total_cmp(&b.error)) else { break };
        let shortest = ASKED_FROM * tolerance / skin.length();
        let halved =
            |s: &Stray, w: &[f64]| s.error > tolerance || (s.angle > MOST_ANGLE && w[1] - w[0] > shortest);
        let pieces = strays.iter().zip(shares.windows(2));
        let middles: Vec<f64> =
            pieces.filter(|(s, w)| halved(s, w)).map(|(_, w)| 0.5 * (w[0] + w[1])).collect();
        if middles.is_empty() {
            let points = shares.len() - usize::from(closed);
            return Ok(Loft { surface, section_parameters, points, error_mm: greatest.error });
        }
        worst = greatest;
        shares.extend(middles);
        shares.sort_by(f64::total_cmp);
    }
    let Stray { error: reached, section, share, .. } = worst;
    Err(LoftError::NotReached { tolerance, reached, section, share })
}

fn check(sections: &[LoftSection], tolerance: f64) -> Result<(), LoftError> {
    if sections.len() < 2 {
        return Err(LoftError::TooFew(sections.len()));
    }
    if tolerance.is_nan() || tolerance <= 0.0 {
        return Err(LoftError::Tolerance(tolerance));
    }
    for (section, s) in sections.iter().enumerate() {
        let height = s.height;
        if height.is_nan() || height.abs() > MAX_COORDINATE {
            return Err(LoftError::Height { section, height });
        }
        let below = section.checked_sub(1).map_or(f64::NEG_INFINITY, |k| sections[k].height);
        if height <= below {
            return Err(LoftError::Order { section, height, below });
        }
        let closed = s.curve.is_closed();
        if closed != sections[0].curve.is_closed() {
            return Err(LoftError::Mixed { section, closed });
        }
    }
    Ok(())
}

/// How far a surface strays from a section, and where on it.
#[derive(Clone, Copy)]
struct Stray {
    error: f64,
    /// Greatest angle between the two, rad.
    angle: f64,
    section: usize,
    share: f64,
}

/// Sections by arc length.
struct Skin<'a> {
    sections: &'a [LoftSection<'a>],
    arcs: Vec<ArcLength<'a>>,
    closed: bool,
}

impl Skin<'_> {
    /// The point of a section at a share of its length.
    fn at(&self, section: usize, share: f64) -> Point2 {
        let arc = &self.arcs[section];
        self.sections[section].curve.point(arc.parameter_at(share * arc.total()))
    }

    fn check_shapes(&self, tolerance: f64) -> Result<(), LoftError> {
        let mut before: Option<Vec<Point2>> = None;
        for (section, arc) in self.arcs.iter().enumerate() {
            let length = arc.total();
            if length < 10.0 * tolerance {
                return Err(LoftError::Short { section, length });
            }
            let of = |k: usize| (k as f64 + if self.closed { 0.0 } else { 0.5 }) / COMPARED as f64;
            let points: Vec<Point2> = (0..COMPARED).map(|k| self.at(section, of(k))).collect();
            if let Some(before) = &before {
                self.compare(before, &points, section)?;
            }
            before = Some(points);
        }
        Ok(())
    }

    /// Whether a section has the sense and the start of the one before.
    fn compare(&self, before: &[Point2], points: &[Point2], section: usize) -> Result<(), LoftError> {
        let centred = |points: &[Point2]| {
            let centre = points.iter().map(|p| p.coords).sum::<geometry::Vector2>() / points.len() as f64;
            points.iter().map(|p| p.coords - centre).collect::<Vec<_>>()
        };
        let (a, b) = (centred(before), centred(points));
        let alike = |index: &dyn Fn(usize) -> usize| -> f64 {
            a.iter().enumerate().map(|(k, p)| p.dot(&b[index(k)])).sum()
        };
        if !self.closed {
            let (same, reversed) = (alike(&|k| k), alike(&|k| COMPARED - 1 - k));
            return if reversed > same { Err(LoftError::Sense { section }) } else { Ok(()) };
        }
        if (signed_area(before) > 0.0) != (signed_area(points) > 0.0) {
            return Err(LoftError::Sense { section });
        }
        let shifted = |by: usize| (by, alike(&|k| (k + by) % COMPARED));
        let best =
            (0..COMPARED).map(shifted).fold((0, f64::NEG_INFINITY), |a, b| if b.1 > a.1 { b } else { a });
        // A quarter around: neighbouring sections are never twisted that much against each other.
        if best.0 > COMPARED / 4 && best.0 < COMPARED - COMPARED / 4 {
            return Err(LoftError::Start { section, share: best.0 as f64 / COMPARED as f64 });
        }
        Ok(())
    }

    /// The surface through the points at `shares` (0 and 1 among them), and v of each section.
    fn through(&self, shares: &[f64]) -> Result<(NurbsSurface, Vec<f64>), LoftError> {
        let u = if self.closed {
            InterpolationAxis::periodic(shares)?
        } else {
            InterpolationAxis::averaging(3, shares)?
        };
        let columns = work::parallel::map(self.sections.len(), |k| {
            let z = self.sections[k].height;
            let lift = |share: &f64| self.at(k, *share).coords.push(z).into();
            u.sites().iter().map(lift).collect::<Vec<Point3>>()
        });
        let between = |w: &[Vec<Point3>]| {
            w[0].iter().zip(&w[1]).map(|(a, b)| (b - a).norm()).sum::<f64>() / w[0].len() as f64
        };
        let mut sum = 0.0;
        let sums: Vec<f64> = std::iter::once(0.0)
            .chain(columns.windows(2).map(between).map(|d| {
                sum += d;
                sum
            }))
            .collect();
        let parameters: Vec<f64> = sums.iter().map(|s| s / sum).collect();
        let v = InterpolationAxis::averaging(3.min(parameters.len() - 1), &parameters)?;
        let points: Vec<Vec<Point3>> =
            (0..u.sites().len()).map(|i| columns.iter().map(|c| c[i]).collect()).collect();
        Ok((interpolate(&u, &v, &points)?, parameters))
    }

    /// How far the surface strays from the sections between any two shares, with what may lie above.
    fn strays(&self, surface: &NurbsSurface, parameters: &[f64], shares: &[f64]) -> Vec<Stray> {
        work::parallel::map(shares.len() - 1, |i| {
            let mut worst = Stray { error: 0.0, angle: 0.0, section: 0, share: shares[i] };
            for (section, (s, arc)) in self.sections.iter().zip(&self.arcs).enumerate() {
                for look in LOOKS {
                    let share = shares[i] + look * (shares[i + 1] - shares[i]);
                    let t = arc.parameter_at(share * arc.total());
                    let jet = surface.jet(share, parameters[section]);
                    let error = SAFETY * distance_from(s.curve, &jet.p.xy(), t);
                    worst.angle = worst.angle.max(jet.du.xy().angle(&s.curve.jet(t).1));
                    if error > worst.error {
                        worst = Stray { error, section, share, ..worst };
                    }
                }
            }
            worst
        })
    }

    /// Length of the longest section, mm.
    fn length(&self) -> f64 {
        self.arcs.iter().map(ArcLength::total).fold(0.0, f64::max)
    }
}
