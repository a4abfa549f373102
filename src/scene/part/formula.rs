//! Surfaces by formula in a scene: which words and keys each shape has, and how they are read and
//! written. Angles are degrees here and rad in [`AnalyticShape`].

use std::fmt::{self, Write as _};

use geometry::{AnalyticShape, AnalyticSurface};
use keys::{COORDINATE, LENGTH, SceneError, Section, toml_number, toml_string};
use part::Patch;

use super::source::{LoadError, Loaded, Loading, PartTable, Source, of_patches};

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

/// A surface by formula.
#[derive(Debug, Clone, PartialEq)]
pub struct FormulaSource {
    /// The formula with its parameters and its rectangle.
    pub surface: AnalyticSurface,
}

/// Radii that a formula may have, mm. Beyond a kilometre a plane is meant.
const RADIUS: std::ops::RangeInclusive<f64> = 1e-3..=1e6;

/// Reads the shape called `surface`, one of [`SURFACES`].
fn read_shape(part: &Section<'_>, surface: &str) -> Result<AnalyticShape, SceneError> {
    let height = || part.number_or("height", COORDINATE, " mm", 0.0);
    let azimuth = || part.number_or("azimuth", -360.0..=360.0, " degrees", 0.0).map(f64::to_radians);
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
        _ => AnalyticShape::PitAndCrest { scale: part.number_or("scale", 1e-3..=*LENGTH.end(), "", 1.0)? },
    })
}

/// A parameter's value in a scene.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Parameter {
    /// A length, an angle in degrees, a factor.
    Number(f64),
    /// `true` or `false`.
    Flag(bool),
}

/// The word for a shape and its parameters as a scene has them.
fn describe(shape: &AnalyticShape) -> (&'static str, Vec<(&'static str, Parameter)>) {
    use Parameter::{Flag, Number};
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

impl Source for FormulaSource {
    const EXAMPLE: Option<&'static str> = Some("surface = \"wave\"");

    fn surfaces() -> Vec<&'static str> {
        SURFACES.iter().map(|(name, _)| *name).collect()
    }

    fn keys() -> Vec<&'static str> {
        ["x", "y"].into_iter().chain(SURFACES.iter().flat_map(|(_, keys)| keys.iter().copied())).collect()
    }

    fn read(table: &PartTable<'_>) -> Result<Self, SceneError> {
        let (part, word) = (table.table, table.surface()?);
        let own = SURFACES.iter().filter(|(name, _)| *name == word.value).flat_map(|(_, keys)| keys.iter());
        let keys: Vec<&str> = ["surface", "x", "y"].iter().chain(own).copied().collect();
        table.only(&keys, &format!("surface = \"{}\"", word.value))?;
        let (x, y) = (part.required_interval("x")?, part.required_interval("y")?);
        let shape = read_shape(part, word.value)?;
        let surface = AnalyticSurface::new(shape, [x, y]).map_err(|e| {
            part.error(&word.span, e.to_string(), "change the shape's parameters, or `x` and `y`")
        })?;
        Ok(Self { surface })
    }

    fn write(&self, out: &mut String) -> fmt::Result {
        let ([x, y], (name, parameters)) = (self.surface.domain(), describe(self.surface.shape()));
        writeln!(out, "surface = {}", toml_string(name))?;
        for (key, value) in parameters {
            match value {
                Parameter::Number(value) => writeln!(out, "{key} = {}", toml_number(value))?,
                Parameter::Flag(value) => writeln!(out, "{key} = {value}")?,
            }
        }
        writeln!(out, "x = [{}, {}]  # mm", toml_number(x[0]), toml_number(x[1]))?;
        writeln!(out, "y = [{}, {}]  # mm", toml_number(y[0]), toml_number(y[1]))
    }

    fn load(&self, job: &Loading<'_>) -> Result<Loaded, LoadError> {
        let part = of_patches(vec![Patch::Analytic(self.surface)])
            .map_err(|reason| LoadError::Part { scene: job.source.name.clone(), reason })?;
        Ok(part.into())
    }
}
