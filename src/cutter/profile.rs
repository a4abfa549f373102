//! The cutter's profile: height of the cutting surface above the tip as a function of the distance
//! from the axis. mm; angles as their sines and cosines.
//!
//! One profile serves all milling cutters of this crate, the seven words of an APT cutter
//! (ISO 4343): a cone at the bottom, an arc, and a cone at the side, any of which may be missing.
//!
//! ```text
//!            │        ╱   side: a cone, angle β from the axis (β = 0: a cylinder)
//!            │       ╱
//!            │      ⌒   arc of radius r around (e, f)
//!   axis ────┼──────     bottom: a cone, angle α from the tip's plane (α = 0: a disc)
//! ```
//!
//! The profile is convex and never falls with the distance from the axis. All that drops a cutter
//! or sweeps it relies on that. Bottom and arc, and arc and side, are tangent or meet in an edge.

/// Steps of the iteration on the arc. Bisection alone needs 52; a smaller number would leave the
/// slowest cases (a point almost a radius beside a steep track) short of full precision.
const MAX_STEPS: usize = 80;

/// Two places closer than this part of the radius count as one. The height is at its minimum there, so
/// its error is of the order of the square; a larger value would show on tracks steeper than a million
/// to one, a smaller one is below the rounding of the function.
const RESOLUTION: f64 = 1.0e-14;

/// An angle above the plane of the tip, 0 to 90 degrees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Incline {
    /// Its sine.
    pub sin: f64,
    /// Its cosine.
    pub cos: f64,
}

impl Incline {
    /// The level.
    pub const LEVEL: Self = Self { sin: 0.0, cos: 1.0 };
    /// The vertical.
    pub const UPRIGHT: Self = Self { sin: 1.0, cos: 0.0 };

    /// The angle `from_plane`, rad.
    pub fn from_plane(angle: f64) -> Self {
        let (sin, cos) = angle.sin_cos();
        Self { sin, cos }
    }

    /// The angle whose complement, from the axis, is given, rad.
    pub fn from_axis(angle: f64) -> Self {
        let (cos, sin) = angle.sin_cos();
        Self { sin, cos }
    }

    /// Rise over run; infinite where upright.
    pub fn slope(&self) -> f64 {
        self.sin / self.cos
    }
}

/// The three pieces from the axis outward: heights are of the surface above the tip.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Profile {
    /// Rise of the bottom.
    pub bottom: Incline,
    /// Where the bottom ends and the arc begins, mm from the axis.
    pub bottom_end: f64,
    /// Distance of the arc's centre from the axis, mm; below zero for a barrel.
    pub centre_x: f64,
    /// Height of the arc's centre above the tip, mm.
    pub centre_z: f64,
    /// Radius of the arc, mm; 0 for a sharp edge.
    pub corner: f64,
    /// Where the arc ends and the side begins, mm from the axis.
    pub arc_end: f64,
    /// Height there, mm.
    pub arc_end_height: f64,
    /// Rise of the side.
    pub side: Incline,
    /// Largest radius, mm; above it stands a cylinder.
    pub radius: f64,
    /// Height at the axis, mm: zero, or below where the profile was grown.
    pub tip: f64,
    /// An edge between bottom and arc.
    pub bottom_edge: bool,
    /// An edge between arc and side.
    pub side_edge: bool,
}

impl Profile {
    /// Bottom and side touch the arc around `(e, f)` without edges.
    pub(super) fn tangent(bottom: Incline, [e, f]: [f64; 2], r: f64, side: Incline, radius: f64) -> Self {
        Self {
            bottom,
            bottom_end: e + r * bottom.sin,
            centre_x: e,
            centre_z: f,
            corner: r,
            arc_end: if side.cos == 0.0 { radius } else { (e + r * side.sin).min(radius) },
            arc_end_height: f - r * side.cos,
            side,
            radius,
            tip: 0.0,
            bottom_edge: false,
            side_edge: false,
        }
    }

    /// Moves the ends of the arc to where it crosses bottom and side, as far as it has edges there.
    /// `foot` is the distance from the axis at which the side, carried on, meets height 0.
    pub(super) fn meet(&mut self, foot: f64) {
        let (e, f, r) = (self.centre_x, self.centre_z, self.corner);
        if self.bottom_edge {
            let Incline { sin, cos } = self.bottom;
            let away = (f - self.tip) * cos - e * sin;
            let along = e * cos + (f - self.tip) * sin + ((r - away) * (r + away)).max(0.0).sqrt();
            self.bottom_end = along * cos;
        }
        if self.side_edge {
            let Incline { sin, cos } = self.side;
            let away = (foot - e) * sin + f * cos;
            let along = (e - foot) * cos + f * sin - ((r - away) * (r + away)).max(0.0).sqrt();
            self.arc_end = foot + along * cos;
            self.arc_end_height = along * sin;
        }
    }

    /// Distance from the axis at which the side, carried on, meets height 0.
    pub(super) fn foot(&self) -> f64 {
        self.arc_end - self.arc_end_height * self.side.cos / self.side.sin
    }

    /// The profile pushed outward by `growth` on all sides, mm. Edges stay edges, so that it holds a
    /// little more than a ball of that radius rolled around the cutter would cover.
    pub fn grown(&self, growth: f64) -> Self {
        if growth == 0.0 {
            return *self;
        }
        let (corner, radius) = (self.corner + growth, self.radius + growth);
        let mut grown = Self {
            corner,
            bottom_end: self.centre_x + corner * self.bottom.sin,
            arc_end: if self.side.cos == 0.0 { radius } else { self.centre_x + corner * self.side.sin },
            arc_end_height: self.centre_z - corner * self.side.cos,
            radius,
            tip: self.tip - growth / self.bottom.cos,
            ..*self
        };
        grown.meet(self.foot() + growth / self.side.sin);
        grown.arc_end = grown.arc_end.min(grown.radius);
        grown
    }

    /// True for a hemisphere under a cylinder: the arc runs from the axis to the largest radius.
    pub fn is_ball(&self) -> bool {
        self.centre_x == 0.0
            && self.bottom_end == 0.0
            && self.radius == self.corner
            && self.arc_end == self.radius
            && !self.bottom_edge
    }

    /// True without arc and cones.
    pub fn is_flat(&self) -> bool {
        self.corner == 0.0 && self.bottom.sin == 0.0 && self.arc_end == self.radius
    }

    /// Height of the arc at distance `rho` from the axis. The square root is taken of a product of
    /// differences, so that near the side it loses no more than the rounding of `rho` itself costs.
    #[inline(always)]
    fn arc(&self, rho: f64) -> f64 {
        let x = rho - self.centre_x;
        let square = (self.corner - x) * (self.corner + x);
        self.centre_z - if square > 0.0 { square } else { 0.0 }.sqrt()
    }

    /// Height for `0 <= rho <= radius`.
    #[inline]
    pub fn height(&self, rho: f64) -> f64 {
        if rho <= self.bottom_end {
            // Without the division for a disc, where this is asked most.
            return if self.bottom.sin == 0.0 { self.tip } else { self.tip + rho * self.bottom.slope() };
        }
        // Beside an upright side a distance may lie beyond the radius by rounding.
        if rho <= self.arc_end || self.side.cos == 0.0 {
            return self.arc(rho);
        }
        self.arc_end_height + (rho - self.arc_end) * self.side.sin / self.side.cos
    }

    /// Rise at distance `rho` from the axis; at an edge, that of the inner side.
    #[inline]
    pub fn incline(&self, rho: f64) -> Incline {
        if rho <= self.bottom_end {
            self.bottom
        } else if rho <= self.arc_end {
            self.on_arc(rho)
        } else {
            self.side
        }
    }

    fn on_arc(&self, rho: f64) -> Incline {
        let x = rho - self.centre_x;
        let sin = if x < self.corner { x / self.corner } else { 1.0 };
        Incline { sin, cos: ((1.0 - sin) * (1.0 + sin)).sqrt() }
    }

    /// Rise at the axis itself: above the level for a pointed tip.
    pub fn point(&self) -> Incline {
        if self.bottom_end == 0.0 && self.bottom_edge { self.on_arc(0.0) } else { self.bottom }
    }

    /// True for a disc that runs smoothly into an arc around its rim, and that into a side (any of
    /// which may be missing): no point, no barrel, and no edge but where there is no arc at all.
    pub fn is_plain(&self) -> bool {
        self.bottom.sin == 0.0 && self.centre_x >= 0.0 && !self.bottom_edge && !self.side_edge
    }

    /// True for a level bottom under a cylinder, with an arc between them that touches both or without one:
    /// a ball, a flat end, a bull nose.
    pub fn is_end_mill(&self) -> bool {
        self.is_plain() && self.arc_end == self.radius
    }

    /// How far from the axis the profile touches a plane that rises by the angle of that sine: the
    /// axis on planes flatter than the bottom, the largest radius on planes steeper than the side.
    pub fn reach(&self, sine: f64) -> f64 {
        if sine <= self.bottom.sin && (self.bottom.sin > 0.0 || sine <= 0.0) {
            0.0
        } else if sine > self.side.sin {
            self.radius
        } else {
            (self.centre_x + self.corner * sine).min(self.arc_end).max(self.bottom_end)
        }
    }

    /// Least and greatest distance from the axis at which the profile touches a plane that rises by the
    /// angle of that sine; they differ where a whole cone or disc does.
    pub fn reaches(&self, sine: f64) -> [f64; 2] {
        if sine < self.bottom.sin {
            return [0.0; 2];
        }
        let on_arc = (self.centre_x + self.corner * sine).min(self.arc_end).max(self.bottom_end);
        let least = if sine == self.bottom.sin { 0.0 } else { on_arc };
        if sine < self.side.sin || self.side.cos == 0.0 {
            [least, on_arc]
        } else {
            [if sine == self.side.sin { self.arc_end } else { self.radius }, self.radius]
        }
    }

    /// The place on a straight track that a cutter climbs along with `slope >= 0` at which it touches
    /// a point `w` across the track: how far ahead of the axis the point then is, and the radius of
    /// the edge that touches it, if an edge does. There `f′(ρ)·a/ρ` passes the slope, with a ahead
    /// and ρ² = a² + w².
    pub fn ahead(&self, slope: f64, w: f64) -> (f64, Option<f64>) {
        let ahead_at = |rho: f64| larger((rho - w) * (rho + w), 0.0).sqrt();
        let edge = |rho: f64| (ahead_at(rho), Some(rho));
        if self.arc_end < self.radius {
            // On a cone f′ = sin/cos: a = m·w/√(f′² − m²), from the axis at ρ = f′·w/√(f′² − m²).
            let climb = slope * self.side.cos;
            let root = larger((self.side.sin - climb) * (self.side.sin + climb), 0.0).sqrt();
            let rho = self.side.sin * w / root;
            if climb >= self.side.sin || rho >= self.radius {
                return edge(self.radius);
            }
            if rho >= self.arc_end {
                return (climb * w / root, None);
            }
        }
        if self.side_edge && w < self.arc_end {
            let Incline { sin, cos } = self.on_arc(self.arc_end);
            if sin * ahead_at(self.arc_end) <= slope * self.arc_end * cos {
                return edge(self.arc_end);
            }
        }
        if self.corner == 0.0 || self.touches_inside_arc(slope, w) {
            let climb = slope * self.bottom.cos;
            if climb >= self.bottom.sin {
                return edge(self.bottom_end);
            }
            let root = ((self.bottom.sin - climb) * (self.bottom.sin + climb)).sqrt();
            let rho = self.bottom.sin * w / root;
            return if rho >= self.bottom_end { edge(self.bottom_end) } else { (climb * w / root, None) };
        }
        (self.arc_ahead(slope, w), None)
    }

    /// True when the arc is too steep already where it begins. A disc without an edge never is.
    fn touches_inside_arc(&self, slope: f64, w: f64) -> bool {
        if w >= self.bottom_end || !(self.bottom_edge || self.bottom.sin > 0.0) {
            return false;
        }
        let begin = self.on_arc(self.bottom_end);
        let ahead = larger((self.bottom_end - w) * (self.bottom_end + w), 0.0).sqrt();
        begin.sin * ahead >= slope * self.bottom_end * begin.cos
    }

    /// The a at which G(a) = x·a − m·ρ·√(r² − x²) vanishes, x = ρ − e the place on the arc of radius r
    /// around e: that is f′(ρ)·a/ρ = m without its poles, with one sign change between the inner end of
    /// the arc (or the point abeam) and its outer end. Newton steps, and bisection wherever they would
    /// leave the bracket or converge slowly; two to five steps in practice.
    fn arc_ahead(&self, slope: f64, w: f64) -> f64 {
        let (e, r) = (self.centre_x, self.corner);
        let ahead_at = |rho: f64| larger((rho - w) * (rho + w), 0.0).sqrt();
        let (mut low, mut high) = (ahead_at(self.bottom_end), ahead_at(self.arc_end));
        // As if ρ were w: close where the place is nearly abeam.
        let abeam = w - e;
        let mut a = if abeam > 0.0 {
            slope * w * larger((r - abeam) * (r + abeam), 0.0).sqrt() / abeam
        } else {
            f64::INFINITY
        };
        if a * a >= 2.0 * w * abeam {
            // As if ρ were that of the arc's outer end: exact for w = 0, close for w small.
            let tangent = slope * self.arc_end / larger(high, f64::MIN_POSITIVE);
            a = ahead_at(e + r * tangent / (1.0 + tangent * tangent).sqrt());
        }
        let resolved = RESOLUTION * self.radius;
        let mut last_step = high - low;
        for k in 0..MAX_STEPS {
            if a <= low || a >= high {
                a = 0.5 * (low + high);
            }
            let rho = (a * a + w * w).sqrt();
            let x = rho - e;
            let level = larger((r - x) * (r + x), 0.0).sqrt();
            let value = x * a - slope * rho * level;
            if value < 0.0 {
                low = a;
            } else {
                high = a;
            }
            let share = a / rho;
            let step = value / (share * a + x - slope * (share * level - a * x / level));
            let newton = a - step;
            if step.abs() <= resolved || high - low <= resolved {
                break;
            }
            let useful = newton > low && newton < high && step.abs() < 0.5 * last_step;
            // Steps shrink by squares: the next one would be too small to matter.
            if useful && k > 0 && step.abs().powi(3) < resolved * last_step * last_step {
                return newton;
            }
            let next = if useful { newton } else { 0.5 * (low + high) };
            last_step = (next - a).abs();
            a = next;
        }
        a
    }
}

/// `a` or `b`, whichever is larger; [`f64::max`] takes longer, because it also orders NaN.
#[inline(always)]
fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}
