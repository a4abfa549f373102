//! A blade's surfaces from its sections.
//!
//! Enters: [`Sections`]. Leaves: one patch for each side, or one all around, u along the sections and v from
//! the lowest to the highest, `du × dv` outward, mm. A closed outline with round edges is one periodic
//! spline, of which its sides are stretches; other outlines have a spline for each side. Splines may be
//! faired before surfaces are laid through them, and offset in their planes (see [`loft_of_offsets`] for what
//! that is worth).
//!
//! A blade has no upper side, so its patches keep the outward side that the sections give. Both sides are
//! stretches of one spline, so that they meet with one tangent.

use super::loft;
use super::sections::{SectionError, SectionSides, Sections};
use crate::fairing::{Faired, Fairing, FairingError, FairingMethod, outlier};
use crate::loft::{Loft, LoftError, LoftSection};
use crate::neighbours::{Overlap, overlap};
use crate::{loft_as_published, loft_of_offsets};
use geometry::{CubicSpline, Isometry3, NurbsSurface, Point2, SplineError, Vector2, Vector3};

/// Surfaces follow the curves of the sections to this, mm: a tenth of the least chord tolerance in use.
const LOFT_TOLERANCE: f64 = 1e-4;

/// The same of surfaces through offset sections, mm.
const OFFSET_TOLERANCE: f64 = 5e-4;

/// Which surfaces of a blade are milled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BladeSide {
    /// Pressure and suction side, a patch each.
    Both,
    /// The pressure side alone.
    Pressure,
    /// The suction side alone.
    Suction,
    /// All around, one patch that closes along u.
    Around,
    /// Of two blades the sides that face each other.
    Passage,
}

/// What to make of sections.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BladeSettings {
    /// Which surfaces.
    pub side: BladeSide,
    /// Where a second, equal blade stands, mm from the first.
    pub pitch: Option<Vector3>,
    /// Where all of it is put in the end.
    pub placed: Isometry3,
    /// How section points are faired, and how far one may be moved, mm.
    pub fairing: Option<(FairingMethod, f64)>,
}

/// Why sections make no blade.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BladeError {
    /// The sections do not fit together.
    #[error(transparent)]
    Section(#[from] SectionError),
    /// No spline goes through a section's points.
    #[error("section {section} (height {height} mm): {source}")]
    Spline {
        /// Which, from 0.
        section: usize,
        /// Its height, mm.
        height: f64,
        /// Why.
        source: SplineError,
    },
    /// A section could not be faired.
    #[error("section {section} (height {height} mm) cannot be faired: {source}")]
    Fairing {
        /// Which, from 0.
        section: usize,
        /// Its height, mm.
        height: f64,
        /// Why.
        source: FairingError,
    },
    /// No surface goes through the curves.
    #[error("the {curve}: {source}")]
    Loft {
        /// Of which curves.
        curve: BladeCurve,
        /// Why.
        source: LoftError,
    },
    /// One patch all around was asked for, and the trailing edge is no smooth curve.
    #[error(
        "the trailing edge is sharp or blunt, so that no smooth patch runs around the blade; write `side = \"both\"`, or \
         round the edge in the section table"
    )]
    SharpEdge,
    /// The second blade stands in the first one.
    #[error(
        "at height {height} mm the blades run into each other near x {:.3} y {:.3} of the table (the second one is {:.3} {:.3} \
         {:.3} mm from the first)",
        at.x, at.y, pitch.x, pitch.y, pitch.z
    )]
    Neighbours {
        /// In the table, mm.
        height: f64,
        /// x and y in the table, mm.
        at: Point2,
        /// From one blade to the other, mm.
        pitch: Vector3,
    },
    /// Two blades were asked for as one passage, and there is one.
    #[error("a passage lies between two blades: say where the second one stands (`pitch`)")]
    NoSecondBlade,
}

impl BladeError {
    /// How to mend it, where that is not in the section table.
    pub fn cure(&self) -> Option<&'static str> {
        match self {
            Self::Neighbours { .. } => Some("write a longer `pitch`, or thinner sections"),
            Self::Fairing { source: FairingError::TooFewPoints { .. }, .. } => {
                Some("write fewer `neighbours`, or more points of that section")
            }
            _ => None,
        }
    }
}

/// A curve of each section.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BladeCurve {
    /// The pressure side.
    Pressure,
    /// The suction side.
    Suction,
    /// The whole outline.
    Around,
}

impl std::fmt::Display for BladeCurve {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Pressure => "pressure side",
            Self::Suction => "suction side",
            Self::Around => "outline",
        })
    }
}

/// A section curve, and what fairing made of it.
#[derive(Debug, Clone, PartialEq)]
pub struct BladeSection {
    /// Which curve.
    pub curve: BladeCurve,
    /// Height of its section, mm.
    pub height: f64,
    /// As the table has it.
    pub spline: CubicSpline,
    /// Faired.
    pub faired: Option<Faired>,
}

/// Places from one point of a section to the next at which it is compared with its drawing.
const COMPARED: usize = 8;

impl BladeSection {
    /// Where the faired curve lies from the drawn one, along the outward normal, mm: least and greatest.
    /// `None` if it was not faired.
    pub fn off_drawing(&self) -> Option<[f64; 2]> {
        let faired = &self.faired.as_ref()?.spline;
        let spans = self.spline.parameters().windows(2);
        let places = spans.flat_map(|ends| {
            (0..=COMPARED).map(|k| ends[0] + (ends[1] - ends[0]) * k as f64 / COMPARED as f64)
        });
        let off = places.filter_map(|t| {
            let (drawn, tangent, _) = self.spline.jet(t);
            // Curves run counter-clockwise about the material.
            let outward = Vector2::new(tangent.y, -tangent.x).try_normalize(0.0)?;
            Some((faired.point(t) - drawn).dot(&outward))
        });
        Some(off.fold([f64::INFINITY, f64::NEG_INFINITY], |[least, most], x| [least.min(x), most.max(x)]))
    }
}

/// One curve of all sections, counter-clockwise about the material.
#[derive(Debug, Clone, PartialEq)]
struct Curves {
    curve: BladeCurve,
    heights: Vec<f64>,
    splines: Vec<CubicSpline>,
}

impl Curves {
    fn sections(&self) -> Vec<LoftSection<'_>> {
        let of = |(curve, &height)| LoftSection { curve, height };
        self.splines.iter().zip(&self.heights).map(of).collect()
    }

    fn refused(&self, source: LoftError) -> BladeError {
        BladeError::Loft { curve: self.curve, source }
    }
}

/// A blade's surfaces.
#[derive(Debug, Clone, PartialEq)]
pub struct Blade {
    /// The milled surfaces, `du × dv` outward.
    pub surfaces: Vec<NurbsSurface>,
    /// Bound of the distance between surfaces and section curves at the heights of the sections, mm.
    pub error_mm: f64,
    /// The splines through the table's points.
    pub sections: Vec<BladeSection>,
    curves: Vec<Curves>,
    /// v of each section on the surfaces through each of the curves.
    parameters: Vec<Vec<f64>>,
    /// For each surface its curves and where it is put.
    places: Vec<(usize, Isometry3)>,
}

impl Blade {
    /// The surfaces of a blade.
    ///
    /// # Errors
    /// See [`BladeError`].
    pub fn new(sections: &Sections, settings: &BladeSettings) -> Result<Self, BladeError> {
        let mut laid = Vec::new();
        let sides = sections.sides()?;
        if let Some(pitch) = settings.pitch
            && let Some(Overlap { height, at, .. }) = overlap(&sides, &pitch)
        {
            return Err(BladeError::Neighbours { height, at, pitch });
        }
        let curves = curves(&sides, settings, &mut laid)?;
        let lofts: Vec<Loft> = curves
            .iter()
            .map(|c| loft(&c.sections(), LOFT_TOLERANCE).map_err(|e| c.refused(e)))
            .collect::<Result<_, _>>()?;
        let places = places(&curves, &lofts, settings)?;
        let surfaces = places.iter().map(|(k, place)| lofts[*k].surface.moved(place)).collect();
        let error_mm = lofts.iter().map(|loft| loft.error_mm).fold(0.0, f64::max);
        let parameters = lofts.into_iter().map(|loft| loft.section_parameters).collect();
        Ok(Self { surfaces, error_mm, sections: laid, curves, parameters, places })
    }

    /// Heights of the sections, mm.
    pub fn heights(&self) -> &[f64] {
        self.curves.first().map_or(&[], |curves| &curves.heights)
    }

    /// v of each section on each of [`Blade::surfaces`].
    pub fn section_parameters(&self) -> Vec<&[f64]> {
        self.places.iter().map(|(k, _)| self.parameters[*k].as_slice()).collect()
    }

    /// What fairing did, and a point that lies off its neighbours, in words.
    pub fn notes(&self) -> Vec<String> {
        let faired: Vec<&Faired> = self.sections.iter().filter_map(|s| s.faired.as_ref()).collect();
        let count = faired.len();
        if count == 0 {
            return self.outlier().into_iter().collect();
        }
        let most = faired.iter().map(|f| f.furthest()).fold(0.0, f64::max);
        let energy = |k: usize| faired.iter().map(|f| f.jump_energy[k]).sum::<f64>();
        let (before, after) = (energy(0), energy(1));
        let rest = if before > 0.0 { 100.0 * after / before } else { 100.0 };
        let mut notes = vec![format!(
            "{count} section curves were faired: points moved by {:.1} µm at most, {rest:.2} % is left of the squared jumps of the \
             third derivative",
            1e3 * most
        )];
        notes.extend(self.outlier());
        notes
    }

    /// A point that lies off its neighbours, in words, the farthest of its kind. Where more than half of the
    /// sections have one it is their shape.
    fn outlier(&self) -> Option<String> {
        let of_curve = |curve: BladeCurve| {
            let all: Vec<&BladeSection> =
                self.sections.iter().filter(|section| section.curve == curve).collect();
            let found: Vec<(f64, usize, &BladeSection)> = all
                .iter()
                .filter_map(|section| outlier(&section.spline).map(|(k, off)| (off, k, *section)))
                .collect();
            if 2 * found.len() > all.len() { Vec::new() } else { found }
        };
        let found =
            [BladeCurve::Pressure, BladeCurve::Suction, BladeCurve::Around].into_iter().flat_map(of_curve);
        let (off, k, section) = found.max_by(|a, b| a.0.total_cmp(&b.0))?;
        let at = section.spline.points()[k];
        let moved = |faired: &Faired| {
            faired.moved.iter().find(|(moved, _)| *moved == k).map_or(0.0, |(_, way)| way.norm())
        };
        let moved = section
            .faired
            .as_ref()
            .map_or(String::new(), |faired| format!("; fairing moved it by {:.1} µm", 1e3 * moved(faired)));
        Some(format!(
            "a point of the {} at height {} lies {:.1} µm off the curve through its neighbours: x {} y {}{moved}. Check it in the table",
            section.curve,
            section.height,
            1e3 * off,
            at.x,
            at.y
        ))
    }

    /// Surfaces through the sections offset outward by `distance`, mm, each in its plane. There may be more
    /// of them than [`Blade::surfaces`] where offsets have corners.
    ///
    /// # Errors
    /// [`BladeError::Loft`] where an offset is singular.
    pub fn offset_in_planes(&self, distance: f64) -> Result<Vec<NurbsSurface>, BladeError> {
        self.lofts(|sections| loft_of_offsets(sections, -distance, OFFSET_TOLERANCE))
    }

    /// The same as published ([`loft_as_published`]): untrimmed, one for each of [`Blade::surfaces`].
    ///
    /// # Errors
    /// [`BladeError::Loft`] where no surface goes through the offsets.
    pub fn offset_as_published(
        &self,
        distance: f64,
        chord_error: f64,
    ) -> Result<Vec<NurbsSurface>, BladeError> {
        self.lofts(|sections| Ok(vec![loft_as_published(sections, -distance, chord_error)?]))
    }

    /// Surfaces of all curves where they stand. Outward is to the right of counter-clockwise curves.
    fn lofts(
        &self,
        laid: impl Fn(&[LoftSection]) -> Result<Vec<Loft>, LoftError>,
    ) -> Result<Vec<NurbsSurface>, BladeError> {
        let of = |curves: &Curves| laid(&curves.sections()).map_err(|e| curves.refused(e));
        let lofts = self.curves.iter().map(of).collect::<Result<Vec<_>, _>>()?;
        let placed = |(k, place): &(usize, Isometry3)| {
            lofts[*k].iter().map(|loft| loft.surface.moved(place)).collect::<Vec<_>>()
        };
        Ok(self.places.iter().flat_map(placed).collect())
    }
}

/// The curves that the asked surfaces are laid through.
fn curves(
    sides: &[SectionSides],
    settings: &BladeSettings,
    laid: &mut Vec<BladeSection>,
) -> Result<Vec<Curves>, BladeError> {
    let wanted: &[BladeCurve] = match settings.side {
        BladeSide::Both | BladeSide::Passage => &[BladeCurve::Pressure, BladeCurve::Suction],
        BladeSide::Pressure => &[BladeCurve::Pressure],
        BladeSide::Suction => &[BladeCurve::Suction],
        BladeSide::Around => &[BladeCurve::Around],
    };
    let round = sides.iter().all(|s| s.around_closed);
    if !round && settings.side == BladeSide::Around {
        return Err(BladeError::SharpEdge);
    }
    let heights: Vec<f64> = sides.iter().map(|s| s.height).collect();
    let mut all: Vec<Curves> =
        wanted.iter().map(|&curve| Curves { curve, heights: heights.clone(), splines: Vec::new() }).collect();
    for (section, side) in sides.iter().enumerate() {
        let maker = SplineMaker { section, height: side.height, fairing: settings.fairing };
        let outline =
            round.then(|| maker.spline(BladeCurve::Around, &side.around, true, laid)).transpose()?;
        for curves in &mut all {
            curves.splines.push(match &outline {
                Some(outline) => stretch_of(outline, side, curves.curve),
                None => {
                    let points = counter_clockwise(side, curves.curve);
                    maker.spline(curves.curve, &points, false, laid)?
                }
            });
        }
    }
    Ok(all)
}

/// Lays splines through the points of one section.
struct SplineMaker {
    section: usize,
    height: f64,
    fairing: Option<(FairingMethod, f64)>,
}

impl SplineMaker {
    fn spline(
        &self,
        curve: BladeCurve,
        points: &[Point2],
        closed: bool,
        laid: &mut Vec<BladeSection>,
    ) -> Result<CubicSpline, BladeError> {
        let (section, height) = (self.section, self.height);
        let parameters = CubicSpline::chord_lengths(points, closed);
        let make = if closed { CubicSpline::closed } else { CubicSpline::open };
        let spline = make(parameters, points.to_vec()).map_err(|source| BladeError::Spline {
            section,
            height,
            source,
        })?;
        let fair = |&(method, most): &(FairingMethod, f64)| {
            let fairing = Fairing::of_noise(method, most, &spline);
            fairing.apply(&spline).map_err(|source| BladeError::Fairing { section, height, source })
        };
        let faired = self.fairing.as_ref().map(fair).transpose()?;
        let result = faired.as_ref().map_or(&spline, |faired| &faired.spline).clone();
        laid.push(BladeSection { curve, height, spline, faired });
        Ok(result)
    }
}

/// Whether the outline from the trailing edge, counter-clockwise, begins with the suction side.
fn suction_first(side: &SectionSides) -> bool {
    let n = side.suction.len();
    side.around.get(1).zip(n.checked_sub(2)).is_some_and(|(p, k)| side.suction.get(k) == Some(p))
}

/// A side as a stretch of the outline, which begins at the trailing edge.
fn stretch_of(outline: &CubicSpline, side: &SectionSides, curve: BladeCurve) -> CubicSpline {
    let first = if suction_first(side) { BladeCurve::Suction } else { BladeCurve::Pressure };
    let count = if first == BladeCurve::Suction { side.suction.len() } else { side.pressure.len() };
    let parameters = outline.parameters();
    let leading = parameters[(count - 1).min(parameters.len() - 1)];
    let [start, end] = outline.domain();
    match curve {
        BladeCurve::Around => outline.clone(),
        curve if curve == first => outline.stretch([start, leading]),
        _ => outline.stretch([leading, end]),
    }
}

/// The points of a side with the material on its left.
fn counter_clockwise(side: &SectionSides, curve: BladeCurve) -> Vec<Point2> {
    let mut points = if curve == BladeCurve::Suction { side.suction.clone() } else { side.pressure.clone() };
    // The side that the outline begins with runs from the trailing edge.
    if (curve == BladeCurve::Suction) == suction_first(side) {
        points.reverse();
    }
    points
}

/// Which curves make which surface, and where it is put.
fn places(
    curves: &[Curves],
    lofts: &[Loft],
    settings: &BladeSettings,
) -> Result<Vec<(usize, Isometry3)>, BladeError> {
    let second = settings.pitch.map(|pitch| settings.placed * nalgebra::Translation3::from(pitch));
    if settings.side != BladeSide::Passage {
        let blades = std::iter::once(settings.placed).chain(second);
        return Ok(blades.flat_map(|blade| (0..curves.len()).map(move |k| (k, blade))).collect());
    }
    let (Some(pitch), Some(second)) = (settings.pitch, second) else { return Err(BladeError::NoSecondBlade) };
    // Of the first blade the side that looks at the second one.
    let looks = |loft: &Loft| {
        const LOOKS: u32 = 9;
        let at = |k: u32| (f64::from(k) + 0.5) / f64::from(LOOKS);
        let normals =
            (0..LOOKS * LOOKS).filter_map(|k| loft.surface.jet(at(k % LOOKS), at(k / LOOKS)).normal());
        normals.sum::<Vector3>().dot(&pitch)
    };
    let nearer = usize::from(looks(&lofts[1]) > looks(&lofts[0]));
    Ok(vec![(nearer, settings.placed), (1 - nearer, second)])
}

#[cfg(test)]
mod tests;
