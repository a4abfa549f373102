//! Surfaces by formula in a scene: which words and keys each shape has, and how they are read and
//! written. Angles are degrees here and rad in [`AnalyticShape`].

use geometry::AnalyticShape;
use keys::SceneError;
use keys::{COORDINATE, LENGTH, Section};

/// Each surface with the keys of its own (besides `surface`, `x` and `y`).
const SURFACES: [(&str, &[&str]); 7] = [
    ("plane", &["height"]),
    ("inclined_plane", &["height", "angle", "azimuth"]),
    ("cylinder", &["height", "radius", "azimuth", "concave"]),
    ("sphere", &["height", "radius", "concave"]),
    ("saddle", &["radius_concave", "radius_convex"]),
    ("wave", &["amplitude", "wavelength_x", "wavelength_y"]),
    ("pit_and_crest", &["scale"]),
];

/// Words for `surface`.
pub(super) fn names() -> impl Iterator<Item = &'static str> {
    SURFACES.iter().map(|(name, _)| *name)
}

/// Keys of one surface.
pub(super) fn keys(surface: &str) -> impl Iterator<Item = &'static str> {
    SURFACES.iter().filter(move |(name, _)| *name == surface).flat_map(|(_, keys)| keys.iter().copied())
}

/// Keys of all surfaces.
pub(super) fn all_keys() -> impl Iterator<Item = &'static str> {
    SURFACES.iter().flat_map(|(_, keys)| keys.iter().copied())
}

/// Radii that a formula may have, mm. Beyond a kilometre a plane is meant.
const RADIUS: std::ops::RangeInclusive<f64> = 1e-3..=1e6;

/// Reads the shape called `surface`, one of [`names`].
pub(super) fn read(part: &Section<'_>, surface: &str) -> Result<AnalyticShape, SceneError> {
    let height = || Ok::<f64, SceneError>(part.number("height", COORDINATE, " mm")?.map_or(0.0, |v| v.value));
    let azimuth = || {
        let azimuth = part.number("azimuth", -360.0..=360.0, " degrees")?;
        Ok::<f64, SceneError>(azimuth.map_or(0.0, |v| v.value.to_radians()))
    };
    let concave = || Ok::<bool, SceneError>(part.flag("concave")?.unwrap_or(false));
    let radius = |key| Ok::<f64, SceneError>(part.required_number(key, RADIUS, " mm", 50.0)?.value);
    Ok(match surface {
        "plane" => AnalyticShape::Plane { height: height()? },
        "inclined_plane" => {
            let angle = part.required_number("angle", 0.0..=85.0, " degrees", 15.0)?.value.to_radians();
            AnalyticShape::Inclined { height: height()?, angle, azimuth: azimuth()? }
        }
        "cylinder" => AnalyticShape::Cylinder {
            height: height()?,
            radius: radius("radius")?,
            azimuth: azimuth()?,
            concave: concave()?,
        },
        "sphere" => {
            AnalyticShape::Sphere { height: height()?, radius: radius("radius")?, concave: concave()? }
        }
        "saddle" => AnalyticShape::Saddle {
            radius_concave: radius("radius_concave")?,
            radius_convex: radius("radius_convex")?,
        },
        "wave" => AnalyticShape::Wave {
            amplitude: part.required_length("amplitude", 2.0)?.value,
            wavelength_x: part.required_length("wavelength_x", 40.0)?.value,
            wavelength_y: part.length("wavelength_y")?.map(|v| v.value),
        },
        _ => AnalyticShape::PitAndCrest {
            scale: part.number("scale", 1e-3..=*LENGTH.end(), "")?.map_or(1.0, |v| v.value),
        },
    })
}

/// A parameter's value in a scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Value {
    /// A length, an angle in degrees, a factor.
    Number(f64),
    /// `true` or `false`.
    Flag(bool),
}

/// The word for a shape and its parameters as a scene has them.
pub(super) fn describe(shape: &AnalyticShape) -> (&'static str, Vec<(&'static str, Value)>) {
    use Value::{Flag, Number};
    let degrees = |angle: f64| Number(angle.to_degrees());
    match *shape {
        AnalyticShape::Plane { height } => ("plane", vec![("height", Number(height))]),
        AnalyticShape::Inclined { height, angle, azimuth } => (
            "inclined_plane",
            vec![("height", Number(height)), ("angle", degrees(angle)), ("azimuth", degrees(azimuth))],
        ),
        AnalyticShape::Cylinder { height, radius, azimuth, concave } => (
            "cylinder",
            vec![
                ("height", Number(height)),
                ("radius", Number(radius)),
                ("azimuth", degrees(azimuth)),
                ("concave", Flag(concave)),
            ],
        ),
        AnalyticShape::Sphere { height, radius, concave } => (
            "sphere",
            vec![("height", Number(height)), ("radius", Number(radius)), ("concave", Flag(concave))],
        ),
        AnalyticShape::Saddle { radius_concave, radius_convex } => (
            "saddle",
            vec![("radius_concave", Number(radius_concave)), ("radius_convex", Number(radius_convex))],
        ),
        AnalyticShape::Wave { amplitude, wavelength_x, wavelength_y } => {
            let mut keys = vec![("amplitude", Number(amplitude)), ("wavelength_x", Number(wavelength_x))];
            keys.extend(wavelength_y.map(|length| ("wavelength_y", Number(length))));
            ("wave", keys)
        }
        AnalyticShape::PitAndCrest { scale } => ("pit_and_crest", vec![("scale", Number(scale))]),
    }
}
