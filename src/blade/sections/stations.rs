//! Generated blades: four-digit profiles at stations of height, and sections in between.
//!
//! Enters: stations with profile, chord, angle and lean, lengths in mm, angles in rad. Leaves: [`Sections`]
//! at equal steps of height from the lowest to the highest station. Between stations every quantity follows a
//! monotone cubic (Fritsch and Carlson 1980, with the slopes of Fritsch and Butland 1984): it goes through
//! the stations, never beyond them, reproduces straight lines, and has a continuous slope.

use super::naca::{NacaProfile, ProfileError, THICKNESSES};
use super::rounding::{EASING, GREATEST_RADIUS, TailArc};
use super::{LeadingEnd, Outline, Section, SectionError, Sections};
use geometry::{Point2, Vector2, signed_area};

/// Most sections that are generated.
pub const MAX_GENERATED_SECTIONS: usize = 200;

/// Most points a side.
pub const MAX_GENERATED_POINTS: usize = 400;

/// Fewest points a side: with fewer a spline through the nose strays by hundredths of the thickness.
const LEAST_GENERATED_POINTS: usize = 12;

/// A profile at a height.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Station {
    /// z, mm.
    pub height: f64,
    /// Greatest camber, share of the chord.
    pub camber: f64,
    /// Its place, share of the chord; does not matter without camber.
    pub position: f64,
    /// Thickness, share of the chord.
    pub thickness: f64,
    /// Chord, mm.
    pub chord: f64,
    /// From the x axis to the chord (from leading to trailing edge), counter-clockwise seen from above, rad.
    pub angle: f64,
    /// Where the stacking point lies, mm.
    pub lean: Vector2,
}

/// How the trailing edge ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TrailingEdge {
    /// Blunt as published: 0.0021 of the chord for a thickness of 0.1. Sections are two sides.
    Open,
    /// Sharp. Sections are two sides that share their ends.
    Closed,
    /// Round, tangent to both sides, of this radius, mm, into which the sides run with continuous curvature.
    /// Sections are closed outlines; the chord is that of the sharp profile, of which the round edge leaves a
    /// part.
    Rounded {
        /// Its radius, mm.
        radius: f64,
    },
}

/// The point of a profile that the stations place, and about which they turn it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Stacking {
    /// This share of the chord from the leading edge, on the chord.
    Chord(f64),
    /// The centre of the area (of the polygon of its points).
    Centroid,
}

/// A blade by stations.
#[derive(Debug, Clone, PartialEq)]
pub struct GeneratedBlade {
    /// Two or more, rising.
    pub stations: Vec<Station>,
    /// Sections, 2 to [`MAX_GENERATED_SECTIONS`].
    pub sections: usize,
    /// Points a side, 12 to [`MAX_GENERATED_POINTS`].
    pub points: usize,
    /// How the trailing edge ends.
    pub trailing_edge: TrailingEdge,
    /// What is stacked.
    pub stacking: Stacking,
}

/// Why a blade cannot be generated. Stations are counted from 1 in messages.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum GenerateError {
    /// Fewer than two.
    #[error("a blade needs at least 2 stations, and here is {0}")]
    TooFewStations(usize),
    /// Heights do not rise.
    #[error(
        "station {} is no higher than the one before; give stations in rising order of height",
        station + 1
    )]
    NotRising {
        /// Counted from 0.
        station: usize,
    },
    /// A number that is not finite, or a chord that is not positive.
    #[error("station {}: {what} is {value}; {cure}", station + 1)]
    Value {
        /// Counted from 0.
        station: usize,
        /// Which of its numbers.
        what: &'static str,
        /// What it is.
        value: f64,
        /// What would help.
        cure: &'static str,
    },
    /// No such profile.
    #[error("station {}: {source}", station + 1)]
    Profile {
        /// Counted from 0.
        station: usize,
        /// Why.
        source: ProfileError,
    },
    /// A number of sections or points out of range.
    #[error("{count} {what} cannot be generated; ask for {least} to {most}")]
    Count {
        /// Sections or points a side.
        what: &'static str,
        /// How many were asked.
        count: usize,
        /// Fewest.
        least: usize,
        /// Most.
        most: usize,
    },
    /// The stacking point is far off the profile.
    #[error("the stacking point lies at {0} of the chord; it must be from 0 to 1")]
    Stacking(f64),
    /// The round trailing edge does not fit.
    #[error(
        "a trailing edge of radius {radius:.4} mm does not fit into the section at height {height:.4} mm, which \
         is {thickness:.4} mm thick; the radius may be {:.0} % of half of that at most, {greatest:.4} mm",
        100.0 * GREATEST_RADIUS
    )]
    Radius {
        /// Asked, mm.
        radius: f64,
        /// The section's height, mm.
        height: f64,
        /// Its thickness, mm.
        thickness: f64,
        /// Greatest radius, mm.
        greatest: f64,
    },
    /// The sections do not fit together.
    #[error(transparent)]
    Sections(#[from] SectionError),
}

impl GeneratedBlade {
    /// The sections.
    ///
    /// # Errors
    /// [`GenerateError`].
    pub fn generate(&self) -> Result<Sections, GenerateError> {
        self.check()?;
        let (lowest, highest) = match self.stations.as_slice() {
            [first, .., last] => (first.height, last.height),
            few => return Err(GenerateError::TooFewStations(few.len())),
        };
        let course = Course::new(&self.stations);
        let last = self.sections - 1;
        let height =
            |k: usize| if k == last { highest } else { lowest + (highest - lowest) * k as f64 / last as f64 };
        let sections =
            (0..=last).map(|k| self.section(&course.at(height(k)))).collect::<Result<Vec<_>, _>>()?;
        Ok(Sections::new(sections)?.with_leading(self.leading()))
    }

    /// Where the leading edges of closed outlines are: thin tips may be blunter at the trailing edge.
    fn leading(&self) -> Option<LeadingEnd> {
        let rounded = matches!(self.trailing_edge, TrailingEdge::Rounded { .. });
        let (sine, cosine) = self.stations.first().filter(|_| rounded)?.angle.sin_cos();
        Some(match (cosine.abs() >= sine.abs(), cosine >= 0.0, sine >= 0.0) {
            (true, true, _) => LeadingEnd::MinusX,
            (true, false, _) => LeadingEnd::PlusX,
            (false, _, true) => LeadingEnd::MinusY,
            (false, _, false) => LeadingEnd::PlusY,
        })
    }

    fn check(&self) -> Result<(), GenerateError> {
        if self.stations.len() < 2 {
            return Err(GenerateError::TooFewStations(self.stations.len()));
        }
        let count = |what, count, least, most| match (least..=most).contains(&count) {
            true => Ok(()),
            false => Err(GenerateError::Count { what, count, least, most }),
        };
        count("sections", self.sections, 2, MAX_GENERATED_SECTIONS)?;
        count("points a side", self.points, LEAST_GENERATED_POINTS, MAX_GENERATED_POINTS)?;
        match self.stacking {
            Stacking::Chord(share) if !(0.0..=1.0).contains(&share) => Err(GenerateError::Stacking(share)),
            _ => self.stations.iter().enumerate().try_for_each(|(k, s)| check_station(k, s)),
        }?;
        match self.stations.windows(2).position(|w| matches!(w, [a, b] if b.height <= a.height)) {
            Some(k) => Err(GenerateError::NotRising { station: k + 1 }),
            None => Ok(()),
        }
    }

    /// The section of one station.
    fn section(&self, station: &Station) -> Result<Section, GenerateError> {
        let closed = self.trailing_edge != TrailingEdge::Open;
        let profile = NacaProfile::new(station.camber, station.position, station.thickness, closed)
            .map_err(|source| GenerateError::Profile { station: 0, source })?;
        let outline = match self.trailing_edge {
            TrailingEdge::Rounded { radius } => Outline::Closed(self.rounded(&profile, station, radius)?),
            TrailingEdge::Open | TrailingEdge::Closed => {
                let [suction, pressure] = [true, false].map(|upper| profile.side(self.points, 1.0, upper));
                Outline::Sides { pressure, suction }
            }
        };
        Ok(Section { height: station.height, outline: self.placed(outline, station) })
    }

    /// A closed outline on the unit chord, counter-clockwise from where the arc touches the upper side.
    fn rounded(
        &self,
        profile: &NacaProfile,
        station: &Station,
        radius: f64,
    ) -> Result<Vec<Point2>, GenerateError> {
        let arc = TailArc::of(profile, radius / station.chord, EASING).ok_or_else(|| {
            let thickness = station.thickness * station.chord;
            let greatest = 0.5 * GREATEST_RADIUS * thickness;
            GenerateError::Radius { radius, height: station.height, thickness, greatest }
        })?;
        let [upper, lower] = arc.touches;
        let mut points = profile.side(self.points, upper, true);
        points.reverse();
        // Both sides begin at the nose.
        points.extend(profile.side(self.points, lower, false).into_iter().skip(1));
        points.extend(arc.points());
        Ok(points)
    }

    /// From the unit chord to the station's place.
    fn placed(&self, outline: Outline, station: &Station) -> Outline {
        let pivot = match self.stacking {
            Stacking::Chord(share) => Point2::new(share, 0.0),
            Stacking::Centroid => {
                let points: Vec<Point2> = match &outline {
                    Outline::Closed(points) => points.clone(),
                    Outline::Sides { pressure, suction } => {
                        pressure.iter().chain(suction.iter().rev()).copied().collect()
                    }
                };
                centroid(&points)
            }
        };
        let turn = nalgebra::Rotation2::new(station.angle);
        let place = |p: Point2| Point2::from(station.lean + turn * ((p - pivot) * station.chord));
        let all = |points: Vec<Point2>| points.into_iter().map(place).collect();
        match outline {
            Outline::Closed(points) => Outline::Closed(all(points)),
            Outline::Sides { pressure, suction } => {
                Outline::Sides { pressure: all(pressure), suction: all(suction) }
            }
        }
    }
}

fn check_station(k: usize, s: &Station) -> Result<(), GenerateError> {
    let most = geometry::MAX_COORDINATE;
    let number = |what, value: f64| {
        let cure = "write a number within ±1e6 mm";
        let fine = value.abs() <= most;
        if fine { Ok(()) } else { Err(GenerateError::Value { station: k, what, value, cure }) }
    };
    number("the height", s.height)?;
    number("the lean in x", s.lean.x)?;
    number("the lean in y", s.lean.y)?;
    number("the angle", s.angle)?;
    if !(s.chord > 0.0 && s.chord <= most) {
        let cure = "write a length above 0, up to 1e6 mm";
        return Err(GenerateError::Value { station: k, what: "the chord", value: s.chord, cure });
    }
    NacaProfile::new(s.camber, s.position, s.thickness, true)
        .map(|_| ())
        .map_err(|source| GenerateError::Profile { station: k, source })
}

/// Centre of the area of a polygon.
fn centroid(points: &[Point2]) -> Point2 {
    let (Some(&first), area) = (points.first(), signed_area(points)) else { return Point2::origin() };
    let moment = points.windows(2).fold(Vector2::zeros(), |sum, w| match w {
        [a, b] => sum + ((a - first) + (b - first)) * (a - first).perp(&(b - first)),
        _ => sum,
    });
    first + moment / (6.0 * area)
}

/// The stations' quantities over the height.
struct Course {
    heights: Vec<f64>,
    /// Camber, its place, thickness, chord, angle, lean in x and y, each with its slopes.
    quantities: [(Vec<f64>, Vec<f64>); 7],
}

impl Course {
    fn new(stations: &[Station]) -> Self {
        let heights: Vec<f64> = stations.iter().map(|s| s.height).collect();
        let mut positions: Vec<f64> =
            stations.iter().map(|s| if s.camber > 0.0 { s.position } else { f64::NAN }).collect();
        fill_from_nearest(&heights, &mut positions);
        let of = |f: fn(&Station) -> f64| stations.iter().map(f).collect::<Vec<f64>>();
        let values = [
            of(|s| s.camber),
            positions,
            of(|s| s.thickness),
            of(|s| s.chord),
            of(|s| s.angle),
            of(|s| s.lean.x),
            of(|s| s.lean.y),
        ];
        let quantities = values.map(|values| {
            let slopes = monotone_slopes(&heights, &values);
            (values, slopes)
        });
        Self { heights, quantities }
    }

    fn at(&self, height: f64) -> Station {
        let spans = self.heights.len().saturating_sub(1).max(1);
        let k = self.heights.partition_point(|h| *h <= height).clamp(1, spans) - 1;
        let [camber, position, thickness, chord, angle, x, y] = self
            .quantities
            .each_ref()
            .map(|(values, slopes)| hermite(&self.heights, values, slopes, k, height));
        // Rounding must not carry what lies between stations out of their ranges.
        let (camber, position) = (camber.clamp(0.0, 0.1), position.clamp(0.05, 0.95));
        let thickness = thickness.clamp(*THICKNESSES.start(), *THICKNESSES.end());
        Station { height, camber, position, thickness, chord, angle, lean: Vector2::new(x, y) }
    }
}

/// Gives places without a number that of the nearest place with one (0.4 where there is none): a profile
/// without camber has no place of it, and its neighbours must not be drawn towards 0.
fn fill_from_nearest(heights: &[f64], values: &mut [f64]) {
    let known: Vec<(f64, f64)> =
        heights.iter().zip(values.iter()).filter(|(_, v)| !v.is_nan()).map(|(h, v)| (*h, *v)).collect();
    for (height, value) in heights.iter().zip(values).filter(|(_, v)| v.is_nan()) {
        let nearest = known.iter().min_by(|a, b| (a.0 - height).abs().total_cmp(&(b.0 - height).abs()));
        *value = nearest.map_or(0.4, |(_, v)| *v);
    }
}

/// Slopes of the monotone cubic through values over rising places.
fn monotone_slopes(places: &[f64], values: &[f64]) -> Vec<f64> {
    let steps: Vec<f64> = places.windows(2).map(|w| w[1] - w[0]).collect();
    let rises: Vec<f64> = values.windows(2).zip(&steps).map(|(w, h)| (w[1] - w[0]) / h).collect();
    let n = steps.len();
    if n < 2 {
        return vec![rises.first().copied().unwrap_or(0.0); n + 1];
    }
    let mut slopes = vec![end_slope([steps[0], steps[1]], [rises[0], rises[1]])];
    for k in 1..n {
        let ([a, b], [before, after]) = ([steps[k - 1], steps[k]], [rises[k - 1], rises[k]]);
        // Brodlie's weights: the harmonic mean, which three times the lesser rise bounds.
        let (u, v) = (2.0 * b + a, b + 2.0 * a);
        slopes.push(if before * after > 0.0 { (u + v) / (u / before + v / after) } else { 0.0 });
    }
    slopes.push(end_slope([steps[n - 1], steps[n - 2]], [rises[n - 1], rises[n - 2]]));
    slopes
}

/// Slope at an end from the two spans next to it, as far as that stays monotone.
fn end_slope([near, next]: [f64; 2], [rise, beyond]: [f64; 2]) -> f64 {
    let slope = ((2.0 * near + next) * rise - near * beyond) / (near + next);
    if slope * rise <= 0.0 {
        0.0
    } else if rise * beyond <= 0.0 && slope.abs() > 3.0 * rise.abs() {
        3.0 * rise
    } else {
        slope
    }
}

/// The cubic of span `k` at a place.
fn hermite(places: &[f64], values: &[f64], slopes: &[f64], k: usize, at: f64) -> f64 {
    let h = places[k + 1] - places[k];
    let t = ((at - places[k]) / h).clamp(0.0, 1.0);
    let (a, b) = (values[k], values[k + 1]);
    // Weights that sum to 1 keep a constant a constant, bit for bit.
    let blend = a + (b - a) * t * t * (3.0 - 2.0 * t);
    blend + h * t * (1.0 - t) * ((1.0 - t) * slopes[k] - t * slopes[k + 1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// The course goes through its stations, keeps between neighbours, and keeps straight lines.
        #[test]
        fn courses_are_monotone(
            steps in prop::collection::vec((0.1..20.0f64, -5.0..5.0f64), 2..9), share in 0.0..1.0f64,
        ) {
            let mut places = vec![0.0];
            places.extend(steps.iter().scan(0.0, |h, s| { *h += s.0; Some(*h) }));
            let mut values = vec![1.0];
            values.extend(steps.iter().map(|s| s.1));
            let slopes = monotone_slopes(&places, &values);
            let straight: Vec<f64> = places.iter().map(|h| 3.0 - 0.25 * h).collect();
            let straight_slopes = monotone_slopes(&places, &straight);
            for k in 0..steps.len() {
                prop_assert_eq!(hermite(&places, &values, &slopes, k, places[k]), values[k]);
                let at = places[k] + share * (places[k + 1] - places[k]);
                let (lo, hi) = (values[k].min(values[k + 1]), values[k].max(values[k + 1]));
                let v = hermite(&places, &values, &slopes, k, at);
                prop_assert!(v >= lo - 1e-12 && v <= hi + 1e-12);
                let v = hermite(&places, &straight, &straight_slopes, k, at);
                prop_assert!((v - (3.0 - 0.25 * at)).abs() < 1e-12);
            }
        }
    }
}
