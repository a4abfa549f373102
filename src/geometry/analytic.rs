//! Surfaces by formula: graphs z = f(x, y) over a rectangle, with exact derivatives.
//!
//! Enters: a shape and a rectangle, mm and rad, all checked once. Leaves: heights and jets. The
//! parameters of the surface ARE the plan view: u = x and v = y, in mm. Shapes stand relative to
//! the origin of the part's frame; the rectangle may lie anywhere. They are what every engine is
//! tested on, since their normals and curvatures are known in closed form.

use super::{Jet2, MAX_COORDINATE, Point3, Vector3};
use std::f64::consts::{PI, TAU};

/// Steepest slope that a shape may reach, rad from horizontal. Steeper needs more than three axes,
/// and derivatives of a graph grow without bound toward a vertical wall.
pub const MAX_SLOPE: f64 = 85.0 * PI / 180.0;

/// Greatest radius of curvature, mm: beyond it a plane is meant.
const MAX_RADIUS: f64 = 1.0e9;

/// Least length in a shape, mm (radius, wavelength, side of the rectangle). Less than a micrometre
/// is no shape that anyone mills, and squares of its inverse would swamp everything else.
const LEAST_LENGTH: f64 = 1.0e-3;

/// Shape of a surface by formula. Lengths in mm, angles in rad.
///
/// All variants: [`Plane`](Self::Plane), [`Inclined`](Self::Inclined),
/// [`Cylinder`](Self::Cylinder), [`Sphere`](Self::Sphere), [`Saddle`](Self::Saddle),
/// [`Wave`](Self::Wave), [`PitAndCrest`](Self::PitAndCrest).
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum AnalyticShape {
    /// z = height.
    Plane {
        /// Height.
        height: f64,
    },
    /// A plane through (0, 0, height) that rises by `angle` toward `azimuth`.
    Inclined {
        /// Height over the origin.
        height: f64,
        /// Slope from horizontal, 0 to [`MAX_SLOPE`].
        angle: f64,
        /// Direction of steepest rise, from the x axis in the plan view.
        azimuth: f64,
    },
    /// A lying cylinder whose top line (convex) or bottom line (concave) runs through
    /// (0, 0, height) at `azimuth`.
    Cylinder {
        /// Height of the top or bottom line.
        height: f64,
        /// Radius.
        radius: f64,
        /// Direction of the axis, from the x axis in the plan view (π/2: along y).
        azimuth: f64,
        /// A channel instead of a ridge.
        concave: bool,
    },
    /// A cap of a sphere with its top (convex) or bottom (concave) at (0, 0, height).
    Sphere {
        /// Height of the top or bottom.
        height: f64,
        /// Radius.
        radius: f64,
        /// A bowl instead of a dome.
        concave: bool,
    },
    /// z = x²/(2·radius_concave) − y²/(2·radius_convex).
    Saddle {
        /// Radius of curvature at the origin along x, where it is a valley.
        radius_concave: f64,
        /// Radius of curvature at the origin along y, where it is a hill.
        radius_convex: f64,
    },
    /// z = amplitude · sin(2πx/wavelength_x) · cos(2πy/wavelength_y); without a wavelength along y
    /// the cosine is 1.
    Wave {
        /// Height of the crests over z = 0.
        amplitude: f64,
        /// Wavelength along x.
        wavelength_x: f64,
        /// Wavelength along y.
        wavelength_y: Option<f64>,
    },
    /// One pit and one crest, a quartic over ±50 mm at scale 1: x = 100u − 50, y = 100v − 50,
    /// z = −80 v(v − 1)(3.55u − 14.8u² + 21.15u³ − 9.9u⁴) − 28, all lengths times `scale`.
    PitAndCrest {
        /// Factor of all lengths.
        scale: f64,
    },
}

/// Why a surface by formula was refused.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum AnalyticError {
    /// A number of the shape is out of range.
    #[error("{name} is {value}; it must be {expected}")]
    Parameter {
        /// Name of the field.
        name: &'static str,
        /// What was given.
        value: f64,
        /// What is allowed.
        expected: &'static str,
    },
    /// The rectangle is empty, too small, or not finite.
    #[error(
        "the range of {axis} is {from} to {to} mm; it must grow by at least 0.001 mm and stay within ±1 km"
    )]
    Range {
        /// `x` or `y`.
        axis: char,
        /// Start.
        from: f64,
        /// End.
        to: f64,
    },
    /// The rectangle reaches where the shape is too steep or ends.
    #[error(
        "the rectangle reaches {reach} mm from the middle of a shape of radius {radius} mm, where it is steeper than \
         85 degrees or ends; stay within {allowed} mm"
    )]
    TooSteep {
        /// Greatest distance from the middle, mm.
        reach: f64,
        /// Radius, mm.
        radius: f64,
        /// Greatest distance allowed, mm.
        allowed: f64,
    },
    /// The surface leaves the range of coordinates.
    #[error("the surface reaches heights of {0} mm; coordinates must stay within ±1 km")]
    TooHigh(f64),
}

/// A surface by formula over a rectangle of the plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AnalyticSurface {
    shape: AnalyticShape,
    domain: [[f64; 2]; 2],
}

/// Height of a graph with its derivatives to second order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeightJet {
    /// Height, mm.
    pub z: f64,
    /// ∂z/∂x.
    pub zx: f64,
    /// ∂z/∂y.
    pub zy: f64,
    /// ∂²z/∂x², 1/mm.
    pub zxx: f64,
    /// ∂²z/∂x∂y, 1/mm.
    pub zxy: f64,
    /// ∂²z/∂y², 1/mm.
    pub zyy: f64,
}

impl HeightJet {
    /// Unit normal, up.
    pub fn normal(&self) -> Vector3 {
        Vector3::new(-self.zx, -self.zy, 1.0) / (1.0 + self.zx * self.zx + self.zy * self.zy).sqrt()
    }
}

impl AnalyticSurface {
    /// Checks a shape over the rectangle `[[x0, x1], [y0, y1]]`, mm.
    ///
    /// # Errors
    /// See [`AnalyticError`].
    pub fn new(shape: AnalyticShape, domain: [[f64; 2]; 2]) -> Result<Self, AnalyticError> {
        for (axis, [from, to]) in ['x', 'y'].into_iter().zip(domain) {
            let inside = from.abs() <= MAX_COORDINATE && to.abs() <= MAX_COORDINATE;
            if !(inside && to - from >= LEAST_LENGTH) {
                return Err(AnalyticError::Range { axis, from, to });
            }
        }
        check_shape(&shape)?;
        check_reach(&shape, domain)?;
        let highest = greatest_height(&shape, domain);
        if highest.is_nan() || highest > MAX_COORDINATE {
            return Err(AnalyticError::TooHigh(highest));
        }
        Ok(Self { shape, domain })
    }

    /// The shape.
    pub fn shape(&self) -> &AnalyticShape {
        &self.shape
    }

    /// The rectangle `[[x0, x1], [y0, y1]]`, mm, which is also the parameter range.
    pub fn domain(&self) -> [[f64; 2]; 2] {
        self.domain
    }

    /// True where `(x, y)` lies over the rectangle, border included.
    pub fn covers(&self, x: f64, y: f64) -> bool {
        let [[x0, x1], [y0, y1]] = self.domain;
        (x0..=x1).contains(&x) && (y0..=y1).contains(&y)
    }

    /// Height, mm, at `(x, y)` clamped to the rectangle.
    pub fn height(&self, x: f64, y: f64) -> f64 {
        self.height_jet(x, y).z
    }

    /// Height and derivatives at `(x, y)` clamped to the rectangle.
    pub fn height_jet(&self, x: f64, y: f64) -> HeightJet {
        let [x, y] = self.clamp(x, y);
        height_jet(&self.shape, x, y)
    }

    /// Position and derivatives at u = x, v = y, clamped to the rectangle.
    pub fn jet(&self, u: f64, v: f64) -> Jet2 {
        let [x, y] = self.clamp(u, v);
        let h = height_jet(&self.shape, x, y);
        Jet2 {
            p: Point3::new(x, y, h.z),
            du: Vector3::new(1.0, 0.0, h.zx),
            dv: Vector3::new(0.0, 1.0, h.zy),
            duu: Vector3::new(0.0, 0.0, h.zxx),
            duv: Vector3::new(0.0, 0.0, h.zxy),
            dvv: Vector3::new(0.0, 0.0, h.zyy),
        }
    }

    /// The borders of the rectangle in x and y, and between them every quarter wave, so that no line
    /// of samples can miss a wave by falling in step with it. Waves shorter than the range's
    /// thousandth part add no lines: they cannot be triangulated anyway.
    pub fn quarter_waves(&self) -> [Vec<f64>; 2] {
        let (x, y) = match self.shape {
            AnalyticShape::Wave { wavelength_x, wavelength_y, .. } => (Some(wavelength_x), wavelength_y),
            _ => (None, None),
        };
        [quarter_waves(self.domain[0], x), quarter_waves(self.domain[1], y)]
    }

    /// `max` and `min` instead of `clamp`, so that NaN becomes a border.
    fn clamp(&self, x: f64, y: f64) -> [f64; 2] {
        let [[x0, x1], [y0, y1]] = self.domain;
        [x.max(x0).min(x1), y.max(y0).min(y1)]
    }
}

/// Most waves over a side of the rectangle that are marked line by line. More would fill any
/// tessellation with lines alone.
const MOST_WAVES: f64 = 1000.0;

fn quarter_waves([from, to]: [f64; 2], wavelength: Option<f64>) -> Vec<f64> {
    let mut lines = vec![from];
    if let Some(quarter) = wavelength.map(|l| 0.25 * l).filter(|q| to - from <= 4.0 * MOST_WAVES * q) {
        let (first, last) = ((from / quarter).floor() as i64, (to / quarter).ceil() as i64);
        // A line closer to the border than this would cut off slivers.
        let margin = 0.01 * quarter;
        lines.extend(
            (first..=last).map(|k| k as f64 * quarter).filter(|&l| l > from + margin && l < to - margin),
        );
    }
    lines.push(to);
    lines
}

/// The formulas.
fn height_jet(shape: &AnalyticShape, x: f64, y: f64) -> HeightJet {
    match *shape {
        AnalyticShape::Plane { height } => {
            HeightJet { z: height, zx: 0.0, zy: 0.0, zxx: 0.0, zxy: 0.0, zyy: 0.0 }
        }
        AnalyticShape::Inclined { height, angle, azimuth } => {
            let (zx, zy) = (angle.tan() * azimuth.cos(), angle.tan() * azimuth.sin());
            HeightJet { z: height + zx * x + zy * y, zx, zy, zxx: 0.0, zxy: 0.0, zyy: 0.0 }
        }
        AnalyticShape::Cylinder { height, radius, azimuth, concave } => {
            // t: distance from the axis in the plan view.
            let (tx, ty) = (-azimuth.sin(), azimuth.cos());
            let t = tx * x + ty * y;
            let w = (radius * radius - t * t).sqrt();
            let sign = if concave { 1.0 } else { -1.0 };
            let (first, second) = (sign * t / w, sign * radius * radius / (w * w * w));
            HeightJet {
                // r − w without the loss of digits at small t.
                z: height + sign * t * t / (radius + w),
                zx: first * tx,
                zy: first * ty,
                zxx: second * tx * tx,
                zxy: second * tx * ty,
                zyy: second * ty * ty,
            }
        }
        AnalyticShape::Sphere { height, radius, concave } => {
            let square = x * x + y * y;
            let w = (radius * radius - square).sqrt();
            let sign = if concave { 1.0 } else { -1.0 };
            let cube = sign / (w * w * w);
            HeightJet {
                z: height + sign * square / (radius + w),
                zx: sign * x / w,
                zy: sign * y / w,
                zxx: (w * w + x * x) * cube,
                zxy: x * y * cube,
                zyy: (w * w + y * y) * cube,
            }
        }
        AnalyticShape::Saddle { radius_concave: a, radius_convex: b } => HeightJet {
            z: 0.5 * x * x / a - 0.5 * y * y / b,
            zx: x / a,
            zy: -y / b,
            zxx: 1.0 / a,
            zxy: 0.0,
            zyy: -1.0 / b,
        },
        AnalyticShape::Wave { amplitude, wavelength_x, wavelength_y } => {
            let kx = TAU / wavelength_x;
            let ky = wavelength_y.map_or(0.0, |l| TAU / l);
            let ((sx, cx), (sy, cy)) = ((kx * x).sin_cos(), (ky * y).sin_cos());
            let z = amplitude * sx * cy;
            HeightJet {
                z,
                zx: amplitude * kx * cx * cy,
                zy: -amplitude * ky * sx * sy,
                zxx: -kx * kx * z,
                zxy: -amplitude * kx * ky * cx * sy,
                zyy: -ky * ky * z,
            }
        }
        AnalyticShape::PitAndCrest { scale } => {
            let (u, v) = (x / (100.0 * scale) + 0.5, y / (100.0 * scale) + 0.5);
            let f = u * (3.55 + u * (-14.8 + u * (21.15 - 9.9 * u)));
            let fu = 3.55 + u * (-29.6 + u * (63.45 - 39.6 * u));
            let fuu = -29.6 + u * (126.9 - 118.8 * u);
            let (g, gv, gvv) = (-80.0 * v * (v - 1.0), -80.0 * (2.0 * v - 1.0), -160.0);
            HeightJet {
                z: scale * (g * f - 28.0),
                zx: g * fu / 100.0,
                zy: gv * f / 100.0,
                zxx: g * fuu / (1.0e4 * scale),
                zxy: gv * fu / (1.0e4 * scale),
                zyy: gvv * f / (1.0e4 * scale),
            }
        }
    }
}

fn check_shape(shape: &AnalyticShape) -> Result<(), AnalyticError> {
    match *shape {
        AnalyticShape::Plane { height } => finite("height", height),
        AnalyticShape::Inclined { height, angle, azimuth } => {
            finite("height", height)?;
            finite("azimuth", azimuth)?;
            let expected = "0 to 85 degrees (steeper needs more than three axes)";
            in_range("angle", angle, 0.0, MAX_SLOPE, expected)
        }
        AnalyticShape::Cylinder { height, radius, azimuth, concave: _ } => {
            finite("height", height)?;
            finite("azimuth", azimuth)?;
            length("radius", radius)
        }
        AnalyticShape::Sphere { height, radius, concave: _ } => {
            finite("height", height)?;
            length("radius", radius)
        }
        AnalyticShape::Saddle { radius_concave, radius_convex } => {
            length("radius_concave", radius_concave)?;
            length("radius_convex", radius_convex)
        }
        AnalyticShape::Wave { amplitude, wavelength_x, wavelength_y } => {
            finite("amplitude", amplitude)?;
            length("wavelength_x", wavelength_x)?;
            wavelength_y.map_or(Ok(()), |l| length("wavelength_y", l))
        }
        AnalyticShape::PitAndCrest { scale } => {
            in_range("scale", scale, 1.0e-3, 1.0e3, "a number from 0.001 to 1000")
        }
    }
}

fn in_range(
    name: &'static str,
    value: f64,
    lo: f64,
    hi: f64,
    expected: &'static str,
) -> Result<(), AnalyticError> {
    let allowed = (lo..=hi).contains(&value);
    if allowed { Ok(()) } else { Err(AnalyticError::Parameter { name, value, expected }) }
}

fn finite(name: &'static str, value: f64) -> Result<(), AnalyticError> {
    in_range(name, value, -MAX_COORDINATE, MAX_COORDINATE, "a number of at most 1e6 in size")
}

fn length(name: &'static str, value: f64) -> Result<(), AnalyticError> {
    in_range(name, value, LEAST_LENGTH, MAX_RADIUS, "a length of 0.001 mm to 1e9 mm")
}

fn corners([[x0, x1], [y0, y1]]: [[f64; 2]; 2]) -> [[f64; 2]; 4] {
    [[x0, y0], [x1, y0], [x0, y1], [x1, y1]]
}

/// Round shapes end: the rectangle's farthest corner must stay where they are not too steep.
fn check_reach(shape: &AnalyticShape, domain: [[f64; 2]; 2]) -> Result<(), AnalyticError> {
    let farthest =
        |distance: &dyn Fn([f64; 2]) -> f64| corners(domain).map(distance).into_iter().fold(0.0, f64::max);
    let (reach, radius) = match *shape {
        AnalyticShape::Cylinder { radius, azimuth, .. } => {
            (farthest(&|[x, y]| (y * azimuth.cos() - x * azimuth.sin()).abs()), radius)
        }
        AnalyticShape::Sphere { radius, .. } => (farthest(&|[x, y]| x.hypot(y)), radius),
        _ => return Ok(()),
    };
    let allowed = radius * MAX_SLOPE.sin();
    if reach <= allowed { Ok(()) } else { Err(AnalyticError::TooSteep { reach, radius, allowed }) }
}

/// A bound of |z| over the rectangle.
fn greatest_height(shape: &AnalyticShape, domain: [[f64; 2]; 2]) -> f64 {
    let at_corners =
        || corners(domain).map(|[x, y]| height_jet(shape, x, y).z.abs()).into_iter().fold(0.0, f64::max);
    let [[x0, x1], [y0, y1]] = domain;
    let (x, y) = (x0.abs().max(x1.abs()), y0.abs().max(y1.abs()));
    match *shape {
        AnalyticShape::Plane { height } => height.abs(),
        AnalyticShape::Inclined { .. } => at_corners(),
        AnalyticShape::Cylinder { height, radius, .. } | AnalyticShape::Sphere { height, radius, .. } => {
            // A cap is never higher than its radius, nor than its farthest corner.
            height.abs() + radius.min(0.5 * (x * x + y * y))
        }
        AnalyticShape::Saddle { radius_concave, radius_convex } => {
            0.5 * (x * x / radius_concave + y * y / radius_convex)
        }
        AnalyticShape::Wave { amplitude, .. } => amplitude.abs(),
        AnalyticShape::PitAndCrest { scale } => {
            let (u, v) = (x / (100.0 * scale) + 0.5, y / (100.0 * scale) + 0.5);
            scale * (80.0 * v * (v + 1.0) * u * (3.55 + u * (14.8 + u * (21.15 + 9.9 * u))) + 28.0)
        }
    }
}

#[cfg(test)]
mod tests;
