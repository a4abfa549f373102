//! The swept cutter in the terms of branch and bound: a plane below it, its height at a point, and its
//! height at the cells of a leaf. For each family the same closed forms as in `swept.rs`, written for
//! vector loops.
//!
//! The height h(p) of one swept move at p = (x, y) is the least over the places σ of the cutter on its
//! track of F(σ, p) = z(σ) + f(|p − c(σ)|). F is convex in (σ, p) together: f is convex and never
//! falls. So for any place σ₀ and any point p₀, with F's slopes `g_σ` and `g_p` there,
//!
//! ```text
//! h(p) >= F(σ₀, p₀) + g_p·(p − p₀) + min over σ of g_σ (σ − σ₀)
//! ```
//!
//! is a plane below the whole sweep. It touches it where σ₀ is the place that cuts at p₀; another place
//! only makes it lower.

use super::local::LocalMove;
use crate::lanes::Real;
use crate::sim::form::Form;

/// Height and slopes of a plane at a point: along the track and across it.
pub(super) struct Plane<T> {
    pub z: T,
    pub along: T,
    pub across: T,
}

/// A cutter that can be swept.
pub(super) trait Sweep<T: Real>: Copy + Sync {
    /// Largest radius.
    fn radius(&self) -> T;

    /// A plane below the sweep of `m` everywhere, given at a point by its place along and across the
    /// track.
    fn plane(&self, m: &LocalMove<T>, along: T, across: T) -> Plane<T>;

    /// Whether all points of a square are cut by the cutter at the lower end of the track, and whether
    /// all are by the cutter at its upper end, if they are cut at all: given the square's extent along
    /// the track and its greatest distance across.
    fn beyond(&self, m: &LocalMove<T>, along: [T; 2], farthest_across: T) -> (bool, bool);

    /// Height of the sweep at a point, infinite or NaN where it does not pass, and whether that may be
    /// wrong by more than the rounding limit that this was made for.
    fn height(&self, m: &LocalMove<T>, along: T, across: T) -> (T, Doubt<T>);
}

/// Heights from here on are in doubt: those of cells that stand higher need a second look in f64.
/// Infinite where there is no doubt.
pub(super) type Doubt<T> = T;

/// Share of the radius to which planes are looked for in either direction. Beyond, the profile is
/// carried on linearly; a larger share makes planes at the border of the cutter steeper and squares of
/// it reach past the radius at 0.7.
const PLANE_SHARE: f64 = 0.68;

/// The least of `g·(σ − σ₀)` over the track.
#[inline(always)]
fn least<T: Real>(slope: T, m: &LocalMove<T>, place: T) -> T {
    (slope * (m.low - place)).smaller(slope * (m.high - place))
}

#[inline(always)]
fn clamp<T: Real>(x: T, low: T, high: T) -> T {
    x.larger(low).smaller(high)
}

/// A ball end.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ball<T> {
    radius: T,
    within: T,
    /// Depths below the centre, squared, at which f32 resolves the height no more, and just outside.
    rim: T,
    outside: T,
}

/// What the f32 rounding of a place may cost, mm, before a height is worked out in f64.
const ROUNDING_LIMIT: f64 = 1.0e-5;

/// Rounding of places in a tile, as a share of the distances in it: a few units in the last place.
const ROUNDING_SHARE: f64 = 8.0 * (f32::EPSILON as f64) / 2.0;

/// Share of the radius below which depths are rounded too badly to be worth trying in f32.
const DEEPEST_RIM: f64 = 0.7;

/// Depth below the centre, as a share of the radius, at which rounding of the place by `extent` reaches
/// the limit; `None` where that is most of the cutter, so that f64 is needed throughout.
pub(super) fn rim_share(extent: f64) -> Option<f64> {
    let share = blur(extent) / ROUNDING_LIMIT;
    (share < DEEPEST_RIM).then_some(share)
}

/// Rounding of places at a distance, mm.
pub(super) fn blur(extent: f64) -> f64 {
    ROUNDING_SHARE * extent
}

impl<T: Real> Ball<T> {
    /// A ball whose heights are in doubt where the depth below its centre is less than the given
    /// share of its radius.
    pub fn new(radius: f64, rim_share: f64) -> Self {
        let rim = rim_share * radius;
        Self {
            radius: T::of(radius),
            within: T::of(PLANE_SHARE * radius),
            rim: T::of(rim * rim),
            outside: T::of(-1e-3 * rim * radius),
        }
    }
}

impl<T: Real> Sweep<T> for Ball<T> {
    #[inline(always)]
    fn radius(&self) -> T {
        self.radius
    }

    #[inline(always)]
    fn plane(&self, m: &LocalMove<T>, along: T, across: T) -> Plane<T> {
        let w = clamp(across, -self.within, self.within);
        let half_chord2 = (self.radius - w) * (self.radius + w);
        let stand = Stand::new(m, along, half_chord2);
        let e = clamp(stand.ahead, -self.within, self.within);
        let depth = (half_chord2 - e * e).sqrt();
        let up = stand.stretch / depth;
        let (ga, gw) = (if stand.free { m.slope } else { e * up }, w * up);
        let touch = m.z + m.slope * stand.place + (self.radius - depth * stand.stretch);
        let z = touch + ga * (stand.ahead - e) + gw * (across - w) + least(m.slope - ga, m, stand.place);
        Plane { z, along: ga, across: gw }
    }

    /// The ball stands at s − q sin φ, q the half chord, where that is on the track.
    #[inline(always)]
    fn beyond(&self, m: &LocalMove<T>, along: [T; 2], farthest_across: T) -> (bool, bool) {
        let w = farthest_across.smaller(self.radius);
        let least_chord2 = (self.radius - w) * (self.radius + w);
        (is_behind(m, along[1] - m.low, least_chord2), along[0] - self.radius * m.sin >= m.high)
    }

    #[inline(always)]
    fn height(&self, m: &LocalMove<T>, along: T, across: T) -> (T, Doubt<T>) {
        let chord2 = (self.radius - across) * (self.radius + across);
        let stand = Stand::new(m, along, chord2);
        let depth2 = chord2 - stand.ahead * stand.ahead;
        let centre = m.z + m.slope * stand.place + self.radius;
        // Where the cylinder is cut aslant, the depth below the ball's centre is less by its cosine.
        let stretch2 = stand.stretch * stand.stretch;
        let near_rim = (depth2 < self.rim * stretch2) & (depth2 > self.outside);
        let infinite = T::of(f64::INFINITY);
        // Down to this height it may cut there.
        let lowest = centre - self.rim.sqrt() * stretch2;
        (centre - depth2.sqrt() * stand.stretch, if near_rim { lowest } else { infinite })
    }
}

/// Where on the axis of a ball's sweep a point is best looked at, so that one root gives the height.
///
/// In the plan view the ball that cuts at `along` stands at σ = along − q sin φ, q the half chord. On the
/// track the sweep is a cylinder, whose lower side lies `q / cos φ` plumb below its axis at `along` itself;
/// past an end it is the ball there, `√(q² − ahead²)` below its centre. Which of them it is, squares tell.
struct Stand<T> {
    /// Whether the ball stands between the ends.
    free: bool,
    /// The place of the axis, on the track carried on both ways, and how far ahead of it the point lies.
    place: T,
    ahead: T,
    /// What the root is multiplied by.
    stretch: T,
}

impl<T: Real> Stand<T> {
    #[inline(always)]
    fn new(m: &LocalMove<T>, along: T, chord2: T) -> Self {
        let (above_low, above_high) = (along - m.low, along - m.high);
        let at_low = is_behind(m, above_low, chord2);
        let at_high = !is_behind(m, above_high, chord2);
        let zero = T::of(0.0);
        let ahead = if at_high { above_high } else { zero };
        let ahead = if at_low { above_low } else { ahead };
        let free = !(at_low | at_high);
        Self { free, place: along - ahead, ahead, stretch: if free { m.sec } else { T::of(1.0) } }
    }
}

/// Whether `ahead <= q sin φ`, given q².
#[inline(always)]
fn is_behind<T: Real>(m: &LocalMove<T>, ahead: T, chord2: T) -> bool {
    let zero = T::of(0.0);
    (ahead <= zero) | (ahead * ahead <= m.sin * m.sin * chord2.larger(zero))
}

/// By how much the squared distance of a point from the track is less than that of the cutter's rim,
/// given the square of half the chord at that distance across.
#[inline(always)]
fn margin<T: Real>(m: &LocalMove<T>, along: T, chord2: T) -> T {
    let off = along - clamp(along, m.low, m.high);
    chord2 - off * off
}

/// A flat end.
#[derive(Debug, Clone, Copy)]
pub(super) struct Flat<T> {
    radius: T,
    within: T,
    /// Rounding of places, as one of squared distances from the axis.
    edge: T,
    /// Half chord, as a share of the slope, below which the edge is too steep, and what rounding may change
    /// the place by there.
    rim: T,
    shift: T,
}

impl<T: Real> Flat<T> {
    /// A flat end whose places are rounded by `blur` mm; 0 leaves no doubt.
    pub fn new(radius: f64, blur: f64) -> Self {
        Self {
            radius: T::of(radius),
            within: T::of(PLANE_SHARE * radius),
            edge: T::of(2.0 * radius * blur),
            rim: T::of(radius * blur / ROUNDING_LIMIT),
            shift: T::of((2.0 * radius * blur).sqrt()),
        }
    }
}

impl<T: Real> Sweep<T> for Flat<T> {
    #[inline(always)]
    fn radius(&self) -> T {
        self.radius
    }

    /// The greater of two convex functions: the lowest place of the tip, and the trace of the rear half
    /// of the edge on the track carried on both ways.
    #[inline(always)]
    fn plane(&self, m: &LocalMove<T>, along: T, across: T) -> Plane<T> {
        let w = clamp(across, -self.within, self.within);
        let half_chord = (self.radius * self.radius - w * w).sqrt();
        let place = along - half_chord;
        let behind = place <= m.low;
        let zero = T::of(0.0);
        let ga = if behind { zero } else { m.slope };
        let gw = ga * w / half_chord;
        let z = m.z + m.slope * place.larger(m.low) + gw * (across - w);
        Plane { z, along: ga, across: gw }
    }

    /// The first place that reaches a point cuts there; at the upper end that is so on its rim only.
    #[inline(always)]
    fn beyond(&self, m: &LocalMove<T>, along: [T; 2], _: T) -> (bool, bool) {
        (along[1] <= m.low, false)
    }

    #[inline(always)]
    fn height(&self, m: &LocalMove<T>, along: T, across: T) -> (T, Doubt<T>) {
        let chord2 = (self.radius - across) * (self.radius + across);
        let half_chord = chord2.larger(T::of(0.0)).sqrt();
        let place = clamp(along - half_chord, m.low, m.high);
        let infinite = T::of(f64::INFINITY);
        let tip = m.z + m.slope * place;
        let margin = margin(m, along, chord2);
        let inside = margin >= T::of(0.0);
        let at_edge = margin.absolute() < self.edge;
        let steep = inside & (half_chord < self.rim * m.slope) & (place > m.low);
        let lowest = tip - if steep { m.slope * self.shift } else { T::of(0.0) };
        (if inside { tip } else { infinite }, if at_edge | steep { lowest } else { infinite })
    }
}

/// Any other profile but barrels: a cone at the bottom, an arc, a cone at the side, any of which may be
/// missing.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rounded<T, const CONES: bool> {
    /// Slope of the bottom and where it ends.
    bottom: T,
    bottom_end: T,
    /// Centre and radius of the arc, and where it ends and how high.
    centre: T,
    centre_z: T,
    corner: T,
    arc_end: T,
    arc_end_z: T,
    /// Slope of the arc where it ends.
    arc_end_slope: T,
    /// Slope of the side.
    side: T,
    radius: T,
    /// Radius of the arc with its centre's.
    radius_of_arc: T,
    /// No plane is looked for farther from the axis.
    within: T,
    /// Rounding of places, and as one of squared distances from the axis.
    blur: T,
    edge: T,
    /// Half chord of the rim, as a share of the slope of the track, below which the place where the rim cuts
    /// is rounded too badly, and what that may change it by.
    rim: T,
    shift: T,
    /// Slopes from which it costs too much, and the least height above the tip where that, or the
    /// radius, is near.
    steep: T,
    steep_z: T,
}

/// Radius that stands for a sharp edge, mm.
const SHARP: f64 = 1e-12;

/// What the place on the arc may cost, mm, before a height is worked out in f64.
const PLACE_LIMIT: f64 = 2.0e-6;

/// Steepest profile at which planes are looked for. Steeper ones say less away from their point.
const STEEPEST_PLANE: f64 = 4.0;

/// Newton steps for the place that a plane touches: fewer only make it lower. With two of them 3 % more moves
/// are tested than with four.
const PLANE_STEPS: usize = 2;

/// The same for heights, where the place counts.
const HEIGHT_STEPS: usize = 4;

/// Slope that stands for a vertical side, where no height is looked for.
const UPRIGHT: f64 = 1e6;

/// Least height above the tip at which the profile is steeper than a slope, or ends, less the rounding.
fn lowest_steep(form: &Form, slope: f64) -> f64 {
    let sine = slope / slope.hypot(1.0);
    let (mut gentle, mut steep) = (0.0, form.radius);
    // Where it begins, by bisection: the profile never becomes gentler.
    for _ in 0..60 {
        let middle = 0.5 * (gentle + steep);
        if form.steepness(middle).0 > sine { steep = middle } else { gentle = middle }
    }
    form.height(gentle) - ROUNDING_LIMIT
}

/// Slope of the arc where it ends.
fn arc_end_slope(form: &Form) -> f64 {
    let profile = &form.profile;
    let x = profile.arc_end - profile.centre_x;
    let corner = profile.corner.max(SHARP);
    if x < corner { x / ((corner - x) * (corner + x)).sqrt() } else { f64::INFINITY }
}

impl<T: Real, const CONES: bool> Rounded<T, CONES> {
    /// The profile of `form`, its places rounded by `blur` mm; 0 leaves no doubt.
    pub fn new(form: &Form, blur: f64) -> Self {
        let profile = &form.profile;
        let side = if profile.side.cos > 0.0 { profile.side.slope() } else { UPRIGHT };
        let sine = STEEPEST_PLANE / STEEPEST_PLANE.hypot(1.0);
        let gentle = profile.centre_x + sine * profile.corner;
        let within = if side <= STEEPEST_PLANE || gentle > profile.arc_end { form.radius } else { gentle };
        Self {
            bottom: T::of(profile.bottom.slope()),
            bottom_end: T::of(profile.bottom_end),
            centre: T::of(profile.centre_x),
            centre_z: T::of(profile.centre_z),
            // A sharp edge is a very small arc.
            corner: T::of(profile.corner.max(SHARP)),
            arc_end: T::of(profile.arc_end),
            arc_end_z: T::of(profile.arc_end_height),
            arc_end_slope: T::of(arc_end_slope(form)),
            side: T::of(side),
            radius: T::of(form.radius),
            radius_of_arc: T::of(profile.centre_x + profile.corner.max(SHARP)),
            within: T::of(within),
            blur: T::of(blur),
            edge: T::of(2.0 * form.radius * blur),
            rim: T::of(form.radius * blur / ROUNDING_LIMIT),
            shift: T::of((2.0 * form.radius * blur).sqrt()),
            steep: T::of(if blur > 0.0 { ROUNDING_LIMIT / blur } else { f64::INFINITY }),
            steep_z: T::of(if blur > 0.0 { lowest_steep(form, ROUNDING_LIMIT / blur) } else { 0.0 }),
        }
    }

    /// Height above the tip and slope at a distance from the axis, up to the radius.
    #[inline(always)]
    fn height_and_slope(&self, rho: T) -> (T, T) {
        let x = rho - self.centre;
        let level = ((self.corner - x) * (self.corner + x)).larger(T::of(1e-30)).sqrt();
        let (arc, arc_slope) = (self.centre_z - level, x / level);
        if !CONES {
            let at_bottom = rho <= self.bottom_end;
            let zero = T::of(0.0);
            return (if at_bottom { zero } else { arc }, if at_bottom { zero } else { arc_slope });
        }
        let beyond = rho - self.arc_end;
        let at_side = beyond > T::of(0.0);
        let at_bottom = rho <= self.bottom_end;
        let height = if at_side { self.arc_end_z + beyond * self.side } else { arc };
        let slope = if at_side { self.side } else { arc_slope };
        (if at_bottom { rho * self.bottom } else { height }, if at_bottom { self.bottom } else { slope })
    }

    /// At an edge any slope between those of its sides gives a plane; the best is the one that keeps the
    /// cutter at its place.
    #[inline(always)]
    fn at_edge(&self, m: &LocalMove<T>, [ahead, rho, near]: [T; 3], place: T, slope: T) -> T {
        let (_, inner) = self.height_and_slope(near - self.blur);
        let (_, outer) = self.height_and_slope(near + self.blur);
        let wanted = m.slope * rho / ahead.larger(T::of(1e-30));
        let at_edge = (ahead > T::of(0.0)) & (inner < outer) & (place > m.low) & (place < m.high);
        if at_edge { clamp(wanted, inner, outer) } else { slope }
    }

    /// What the height may be too great by, where the place on the track is not quite that of the least
    /// one: with D the slope there and K the least bend, D²/2K.
    #[inline(always)]
    fn place_is_off(&self, m: &LocalMove<T>, place: T, [ahead, across, rho]: [T; 3], slope: T) -> bool {
        // Inside of the arc too: a place there would be off by more. Where the arc ends, Newton's steps may
        // have stopped short of a place farther in; the side, from there on, has its place in closed form.
        let inside_end = rho < self.arc_end - self.blur;
        let at_end = rho <= self.arc_end + self.blur;
        let slope = if CONES & at_end { slope.smaller(self.arc_end_slope) } else { slope };
        let rho2 = (rho * rho).larger(T::of(1e-30));
        let level = slope / rho.larger(T::of(1e-30));
        let off = level * ahead - m.slope;
        let bend = (ahead * ahead / self.corner + level * across * across) / rho2;
        // Off the wrong way: farther on, or back, the cutter would cut lower.
        let zero = T::of(0.0);
        let could_move =
            (at_end & (off > zero) & (place < m.high)) | (inside_end & (off < zero) & (place > m.low));
        could_move & (off * off > T::of(2.0 * PLACE_LIMIT) * bend)
    }

    /// How far the point lies ahead of the axis when the cutter that cuts it stands on its track: there
    /// f′(ρ)·ahead/ρ is the slope of the track, or passes it. Each piece has its place; that of the first
    /// piece which is steep enough at its end counts.
    #[inline(always)]
    fn ahead<const STEPS: usize>(&self, m: &LocalMove<T>, across: T) -> T {
        let w = across.absolute().smaller(self.radius);
        let arc = self.ahead_on_arc::<STEPS>(m.sin, w);
        if !CONES {
            return arc;
        }
        let (first, last) = (chord(self.bottom_end, w), chord(self.arc_end, w));
        let bottom = ahead_on_cone(self.bottom, m.slope, w);
        let side = ahead_on_cone(self.side, m.slope, w);
        let outer = if side > last { side.smaller(chord(self.radius, w)) } else { clamp(arc, first, last) };
        if bottom < first { bottom } else { outer }
    }

    /// The same on the arc alone, for the sine s of the rise. C, the part of the contact's normal across
    /// the track, solves w = r C + e C/√(C² + (1 − C²) s²) =: H(C). H is concave and grows, so that
    /// Newton's method never overshoots from below.
    #[inline(always)]
    fn ahead_on_arc<const STEPS: usize>(&self, sine: T, w: T) -> T {
        let (zero, one, tiny) = (T::of(0.0), T::of(1.0), T::of(1e-30));
        let (r, e, s) = (self.corner, self.centre, sine.larger(T::of(1e-12)));
        let s2 = sine * sine;
        // Three bounds from below: H(C) <= rC + e, (r + e/s) C, and (r + e) C/√(C² + (1 − C²) s²).
        let u = w / self.radius_of_arc;
        let u2 = (u * u).smaller(one);
        let third = u * s / (one - u2 * (one - s2)).larger(tiny).sqrt();
        let start = (w / (r + e / s)).larger((w - e) / r).larger(third).larger(zero).smaller(one);
        // No loop, which would keep the one over the cells from becoming vector code. What the steps leave
        // is seen by the slope at the place found, and put in doubt where it matters.
        let numbers = [r, e, s2, w];
        let mut c = start;
        if STEPS > 0 {
            c = arc_step(numbers, c);
        }
        if STEPS > 1 {
            c = arc_step(numbers, c);
        }
        if STEPS > 2 {
            c = arc_step(numbers, c);
        }
        if STEPS > 3 {
            c = arc_step(numbers, c);
        }
        let rest = one - c * c;
        let part = rest.larger(zero).sqrt() * sine;
        let norm = (c * c + rest * s2).larger(tiny).sqrt();
        r * part + e * part / norm
    }
}

/// One Newton step of [`Rounded::ahead_on_arc`].
#[inline(always)]
fn arc_step<T: Real>([r, e, s2, w]: [T; 4], c: T) -> T {
    let (zero, one) = (T::of(0.0), T::of(1.0));
    let q = one / (s2 + (one - s2) * c * c).larger(T::of(1e-30)).sqrt();
    let eq = e * q;
    let step = (w - (r + eq) * c) / (r + eq * s2 * (q * q));
    (c + step).larger(zero).smaller(one)
}

/// How far a circle of radius `rho` reaches ahead at distance `w` across.
#[inline(always)]
fn chord<T: Real>(rho: T, w: T) -> T {
    ((rho - w) * (rho + w)).larger(T::of(0.0)).sqrt()
}

/// Where a cone of the first slope touches a track of the second; infinite if the track is steeper.
#[inline(always)]
fn ahead_on_cone<T: Real>(cone: T, slope: T, w: T) -> T {
    let rest = (cone - slope) * (cone + slope);
    let ahead = slope * w / rest.larger(T::of(1e-30)).sqrt();
    if rest > T::of(0.0) { ahead } else { T::of(f64::INFINITY) }
}

impl<T: Real, const CONES: bool> Sweep<T> for Rounded<T, CONES> {
    #[inline(always)]
    fn radius(&self) -> T {
        self.radius
    }

    #[inline(always)]
    fn plane(&self, m: &LocalMove<T>, along: T, across: T) -> Plane<T> {
        let place = clamp(along - self.ahead::<PLANE_STEPS>(m, across), m.low, m.high);
        let ahead = along - place;
        let rho = (ahead * ahead + across * across).sqrt();
        let near = rho.smaller(self.within);
        let (height, slope) = self.height_and_slope(near);
        let slope = if CONES { self.at_edge(m, [ahead, rho, near], place, slope) } else { slope };
        let level = slope / rho.larger(T::of(1e-30));
        let (ga, gw) = (level * ahead, level * across);
        let z = m.z + m.slope * place + height + slope * (rho - near) + least(m.slope - ga, m, place);
        Plane { z, along: ga, across: gw }
    }

    /// The lower end cuts wherever it is the nearest place; the upper one too if the track is level.
    #[inline(always)]
    fn beyond(&self, m: &LocalMove<T>, along: [T; 2], _: T) -> (bool, bool) {
        (along[1] <= m.low, (along[0] >= m.high) & (m.slope == T::of(0.0)))
    }

    #[inline(always)]
    fn height(&self, m: &LocalMove<T>, along: T, across: T) -> (T, Doubt<T>) {
        let infinite = T::of(f64::INFINITY);
        let place = clamp(along - self.ahead::<HEIGHT_STEPS>(m, across), m.low, m.high);
        let ahead = along - place;
        let rho = (ahead * ahead + across * across).sqrt().smaller(self.radius);
        let (height, slope) = self.height_and_slope(rho);
        let tip = m.z + m.slope * place;
        let chord2 = (self.radius - across) * (self.radius + across);
        let margin = margin(m, along, chord2);
        let inside = margin >= T::of(0.0);
        let short = self.rim * m.slope;
        let at_rim = (rho >= self.radius - self.blur) & (place > m.low) & (chord2 < short * short);
        let steep = (margin.absolute() < self.edge) | (inside & ((slope > self.steep) | at_rim));
        let off = inside & self.place_is_off(m, place, [ahead, across, rho], slope);
        let z = if inside { tip + height } else { infinite };
        let shift = if at_rim { m.slope * self.shift } else { T::of(0.0) };
        let least = if off { m.z + m.slope * m.low } else { tip + self.steep_z - shift };
        (z, if steep | off { least } else { infinite })
    }
}
