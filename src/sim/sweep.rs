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

#[cfg(test)]
mod tests;

use super::form::Form;
use super::track::Track;
use work::lanes::Real;

/// One straight move of the tip, seen from a point on the line of its track. In f32 that is the point next to
/// the middle of a tile: all numbers that matter are then no larger than the cutter and the tile.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LocalMove<T> {
    /// That point.
    pub x: T,
    pub y: T,
    pub z: T,
    /// Unit direction in the plan view, rising.
    pub ux: T,
    pub uy: T,
    /// Where the track begins and ends, from that point on: `low <= 0 <= high`.
    pub low: T,
    pub high: T,
    /// Rise over plan-view length, `>= 0`, the sine of the angle of rise, and one over its cosine.
    pub slope: T,
    pub sin: T,
    pub sec: T,
}

impl LocalMove<f64> {
    /// A track in the coordinates of the map, seen from its lower end.
    #[inline(always)]
    pub fn of(track: &Track) -> Self {
        let Track { x, y, z, ux, uy, length, slope, cos } = *track;
        Self { x, y, z, ux, uy, low: 0.0, high: length, slope, sin: slope * cos, sec: 1.0 / cos }
    }
}

impl<T: Real> LocalMove<T> {
    /// Place along the track and across it of a point.
    #[inline(always)]
    pub fn along_across(&self, x: T, y: T) -> (T, T) {
        let (dx, dy) = (x - self.x, y - self.y);
        (dx * self.ux + dy * self.uy, dy * self.ux - dx * self.uy)
    }

    /// Square of the distance from the track in the plan view.
    #[inline(always)]
    pub fn distance2(&self, along: T, across: T) -> T {
        let ahead = along - clamp(along, self.low, self.high);
        ahead * ahead + across * across
    }
}

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
    /// the track, and its least and greatest distance across.
    fn beyond(&self, m: &LocalMove<T>, along: [T; 2], across: [T; 2]) -> (bool, bool);

    /// Height of the sweep at a point, infinite or NaN where it does not pass, and whether that may be
    /// wrong by more than the rounding limit that this was made for.
    fn height(&self, m: &LocalMove<T>, along: T, across: T) -> (T, Doubt<T>);

    /// Whether [`Sweep::inner_height`] holds within a distance of a point.
    #[inline(always)]
    fn surrounds(&self, _: &LocalMove<T>, _along: T, _across: T, _within: T) -> bool {
        false
    }

    /// As [`Sweep::height`], far enough from the rim that there is no doubt.
    #[inline(always)]
    fn inner_height(&self, m: &LocalMove<T>, along: T, across: T) -> T {
        self.height(m, along, across).0
    }

    /// As [`Sweep::height`], at many points: `[blocks][N]` of each.
    #[inline(always)]
    fn heights<const N: usize>(
        &self,
        m: &LocalMove<T>,
        along: &[[T; N]],
        across: &[[T; N]],
        height: &mut [[T; N]],
        doubt: &mut [[T; N]],
    ) {
        for b in 0..along.len() {
            for k in 0..N {
                (height[b][k], doubt[b][k]) = self.height(m, along[b][k], across[b][k]);
            }
        }
    }

    /// Whether [`Sweep::at_end`] takes so much less time than [`Sweep::height`] that it pays to ask it first.
    const TRIES_END: bool = false;

    /// Height of the cutter that stands at the upper or the lower end of its track, infinite where it does
    /// not reach, and a height that the sweep is nowhere below: infinite where the first is the height of the
    /// sweep. By the convexity of F: from its value and its slope there along the track.
    #[inline(always)]
    fn at_end(&self, _: &LocalMove<T>, _upper: bool, _along: T, _across: T) -> (T, T) {
        (T::of(f64::INFINITY), T::of(f64::NEG_INFINITY))
    }
}

/// Heights from here on are in doubt: those of cells that stand higher need a second look by the closed forms
/// of the reference.
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

/// Share of the radius within which, in f64 too, it is left to the closed forms of the reference whether a
/// cutter still reaches a point: cells of round coordinates lie on the rim itself.
const RIM_SHARE: f64 = 1e-12;

/// Rounding of places as it counts at the rim.
fn rim_blur(blur: f64, radius: f64) -> f64 {
    blur.max(RIM_SHARE * radius)
}

/// Rounding of places at a distance, mm.
pub(super) fn blur(extent: f64) -> f64 {
    ROUNDING_SHARE * extent
}

impl<T: Real> Ball<T> {
    /// A ball whose heights are in doubt where the depth below its centre is less than the given
    /// share of its radius; 0 in f64.
    pub fn new(radius: f64, rim_share: f64) -> Self {
        // Depths are square roots.
        let rim = rim_share.max(RIM_SHARE.sqrt()) * radius;
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
    fn beyond(&self, m: &LocalMove<T>, along: [T; 2], across: [T; 2]) -> (bool, bool) {
        let w = across[1].smaller(self.radius);
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

    /// Where the ball stands at the lower end, its depth is at least `q cos φ`.
    #[inline(always)]
    fn surrounds(&self, m: &LocalMove<T>, along: T, across: T, within: T) -> bool {
        inner_margin(self.radius, m.distance2(along, across), within) > self.rim * m.sec * m.sec
    }

    #[inline(always)]
    fn inner_height(&self, m: &LocalMove<T>, along: T, across: T) -> T {
        let chord2 = (self.radius - across) * (self.radius + across);
        let stand = Stand::new(m, along, chord2);
        let depth2 = chord2 - stand.ahead * stand.ahead;
        (m.z + self.radius) + m.slope * stand.place - depth2.sqrt() * stand.stretch
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

/// No more than the least [`margin`] within a distance of a point of given squared distance from the track,
/// unless negative: `(d + within)² <= d² + (2 radius + within) within` where d is no more than the radius.
#[inline(always)]
fn inner_margin<T: Real>(radius: T, distance2: T, within: T) -> T {
    radius * radius - distance2 - (radius + radius + within) * within
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
    /// A flat end whose places are rounded by `blur` mm; 0 in f64.
    pub fn new(radius: f64, blur: f64) -> Self {
        Self {
            radius: T::of(radius),
            within: T::of(PLANE_SHARE * radius),
            edge: T::of(2.0 * radius * rim_blur(blur, radius)),
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
    fn beyond(&self, m: &LocalMove<T>, along: [T; 2], _: [T; 2]) -> (bool, bool) {
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

    #[inline(always)]
    fn surrounds(&self, m: &LocalMove<T>, along: T, across: T, within: T) -> bool {
        let margin = inner_margin(self.radius, m.distance2(along, across), within);
        let rim = self.rim * m.slope;
        (margin > self.edge) & (margin > rim * rim)
    }

    #[inline(always)]
    fn inner_height(&self, m: &LocalMove<T>, along: T, across: T) -> T {
        let half_chord = ((self.radius - across) * (self.radius + across)).sqrt();
        m.z + m.slope * clamp(along - half_chord, m.low, m.high)
    }
}

/// Any other profile: a cone at the bottom, an arc, a cone at the side, any of which may be missing. On the
/// arc of a barrel (its centre beyond the axis) the place is not always found: such heights are in doubt.
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
    /// One over the radius, over that of the arc, and over that of the arc with its centre's.
    inverse_radius: T,
    inverse_corner: T,
    inverse_arc_radius: T,
    /// No plane is looked for farther from the axis; height and slope there.
    within: T,
    within_z: T,
    within_slope: T,
    /// Twice what the place on the arc may cost.
    place_limit: T,
    /// Rounding of places, as one of squared distances from the axis, and the radius less it.
    blur: T,
    edge: T,
    /// Half chord of the rim, as a share of the slope of the track, below which the place where the rim cuts
    /// is rounded too badly, and what that may change it by.
    rim: T,
    shift: T,
    surely_inside: T,
    /// Slopes from which it costs too much, and the least height above the tip where that, or the
    /// radius, is near.
    steep: T,
    steep_z: T,
}

/// Radius that stands for a sharp edge, mm.
const SHARP: f64 = 1e-12;

/// What the place on the arc may cost, mm, before a height is worked out in f64.
const PLACE_LIMIT: f64 = 2.0e-6;

/// The same where places are f64: far below half a unit in the last place of a stored height.
const EXACT_PLACE_LIMIT: f64 = 1.0e-11;

/// Steepest profile at which planes are looked for. Steeper ones say less away from their point.
const STEEPEST_PLANE: f64 = 4.0;

/// Steps of Halley's method for the place that a plane touches: fewer only make it lower.
const PLANE_STEPS: usize = 1;

/// The same for heights, where the place counts: on tracks that rise by 0.01 or more, three leave 1e-15 mm
/// and two 1e-6.
const HEIGHT_STEPS: usize = 3;

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
    /// The profile of `form`, its places rounded by `blur` mm; 0 in f64.
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
            inverse_radius: T::of(1.0 / form.radius),
            inverse_corner: T::of(1.0 / profile.corner.max(SHARP)),
            inverse_arc_radius: T::of(1.0 / (profile.centre_x + profile.corner.max(SHARP))),
            within: T::of(within),
            within_z: T::of(form.height(within)),
            within_slope: T::of(profile.incline(within).slope()),
            place_limit: T::of(2.0 * if blur > 0.0 { PLACE_LIMIT } else { EXACT_PLACE_LIMIT }),
            blur: T::of(blur),
            rim: T::of(form.radius * blur / ROUNDING_LIMIT),
            shift: T::of((2.0 * form.radius * blur).sqrt()),
            edge: T::of(2.0 * form.radius * rim_blur(blur, form.radius)),
            surely_inside: T::of(form.radius - rim_blur(blur, form.radius)),
            steep: T::of(if blur > 0.0 { ROUNDING_LIMIT / blur } else { f64::INFINITY }),
            steep_z: T::of(if blur > 0.0 { lowest_steep(form, ROUNDING_LIMIT / blur) } else { 0.0 }),
        }
    }

    /// Height above the tip at a distance from the axis, up to the radius, and the slope there as rise and
    /// run.
    #[inline(always)]
    fn height_and_rise(&self, rho: T) -> (T, [T; 2]) {
        let (zero, one) = (T::of(0.0), T::of(1.0));
        let x = rho - self.centre;
        let level = ((self.corner - x) * (self.corner + x)).larger(T::of(1e-30)).sqrt();
        let arc = self.centre_z - level;
        let at_bottom = rho <= self.bottom_end;
        if !CONES {
            return (if at_bottom { zero } else { arc }, [if at_bottom { zero } else { x }, level]);
        }
        let beyond = rho - self.arc_end;
        let at_side = beyond > zero;
        let height = if at_side { self.arc_end_z + beyond * self.side } else { arc };
        let height = if at_bottom { rho * self.bottom } else { height };
        let cone = if at_bottom { self.bottom } else { self.side };
        let on_cone = at_bottom | at_side;
        (height, if on_cone { [cone, one] } else { [x, level] })
    }

    /// The same with the slope itself.
    #[inline(always)]
    fn height_and_slope(&self, rho: T) -> (T, T) {
        let (height, [rise, run]) = self.height_and_rise(rho);
        (height, rise / run)
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
        // Inside of the arc too: a place there would be off by more. Where the arc ends, the steps may have
        // stopped short of a place farther in; the side, from there on, has its place in closed form.
        let inside_end = rho < self.arc_end - self.blur;
        let at_end = rho <= self.arc_end + self.blur;
        let slope = if CONES & at_end { slope.smaller(self.arc_end_slope) } else { slope };
        // Both times ρ, the bend with the radius for the last ρ in it.
        let off = slope * ahead - m.slope * rho;
        let bend = ahead * ahead * self.inverse_corner + slope * across * across * self.inverse_radius;
        // Off the wrong way: farther on, or back, the cutter would cut lower.
        let zero = T::of(0.0);
        let could_move =
            (at_end & (off > zero) & (place < m.high)) | (inside_end & (off < zero) & (place > m.low));
        could_move & (off * off > self.place_limit * bend)
    }

    /// How far the point lies ahead of the axis when the cutter that cuts it stands on its track: there
    /// f′(ρ)·ahead/ρ is the slope of the track, or passes it. Each piece has its place; that of the first
    /// piece which is steep enough at its end counts.
    #[inline(always)]
    fn ahead<const STEPS: usize>(&self, m: &LocalMove<T>, across: T) -> T {
        let mut c = self.arc_start(m, across);
        // No loop, which would keep the one over the cells from becoming vector code. What the steps leave
        // is seen by the slope at the place found, and put in doubt where it matters.
        if STEPS > 0 {
            c = self.arc_step(m, across, c);
        }
        if STEPS > 1 {
            c = self.arc_step(m, across, c);
        }
        if STEPS > 2 {
            c = self.arc_step(m, across, c);
        }
        self.ahead_at(m, across, c)
    }

    /// The same, from what was found for the arc.
    #[inline(always)]
    fn ahead_at(&self, m: &LocalMove<T>, across: T, c: T) -> T {
        let w = across.absolute().smaller(self.radius);
        let arc = self.arc_ahead(m, c);
        if !CONES {
            return arc;
        }
        let (first, last) = (chord(self.bottom_end, w), chord(self.arc_end, w));
        let bottom = ahead_on_cone(self.bottom, m.slope, w);
        let side = ahead_on_cone(self.side, m.slope, w);
        let outer = if side > last { side.smaller(chord(self.radius, w)) } else { clamp(arc, first, last) };
        if bottom < first { bottom } else { outer }
    }

    /// Where to begin on the arc, for the sine s of the rise. C, the part of the contact's normal across
    /// the track, solves w = r C + e C/√(C² + (1 − C²) s²) =: H(C). H is concave and grows.
    #[inline(always)]
    fn arc_start(&self, m: &LocalMove<T>, across: T) -> T {
        let (zero, one, tiny) = (T::of(0.0), T::of(1.0), T::of(1e-30));
        let w = across.absolute().smaller(self.radius);
        let (r, e, s) = (self.corner, self.centre, m.sin.larger(T::of(1e-12)));
        // Three bounds from below: H(C) <= rC + e, (r + e/s) C, and (r + e) C/√(C² + (1 − C²) s²).
        let u = w * self.inverse_arc_radius;
        let u2 = (u * u).smaller(one);
        let third = u * s / (one - u2 * (one - m.sin * m.sin)).larger(tiny).sqrt();
        (w * (s / (r * s + e))).larger((w - e) * self.inverse_corner).larger(third).larger(zero).smaller(one)
    }

    /// One step of Halley's method for it.
    #[inline(always)]
    fn arc_step(&self, m: &LocalMove<T>, across: T, c: T) -> T {
        let (zero, one, s2) = (T::of(0.0), T::of(1.0), m.sin * m.sin);
        let w = across.absolute().smaller(self.radius);
        let (r, e) = (self.corner, self.centre);
        let q = one / (s2 + (one - s2) * c * c).larger(T::of(1e-30)).sqrt();
        let (eq, q2) = (e * q, q * q);
        let off = w - (r + eq) * c;
        let bend = eq * s2 * q2;
        // H′, and -H″/2.
        let slope = r + bend;
        let half_curve = T::of(1.5) * bend * q2 * (one - s2) * c;
        let step = off * slope / (slope * slope - off * half_curve);
        (c + step).larger(zero).smaller(one)
    }

    /// How far ahead the point lies where the normal at the contact has the part `c` across.
    #[inline(always)]
    fn arc_ahead(&self, m: &LocalMove<T>, c: T) -> T {
        let (zero, one, tiny) = (T::of(0.0), T::of(1.0), T::of(1e-30));
        let rest = one - c * c;
        let part = rest.larger(zero).sqrt() * m.sin;
        let norm = (c * c + rest * (m.sin * m.sin)).larger(tiny).sqrt();
        self.corner * part + self.centre * part / norm
    }

    /// The height, and from where it is in doubt, if the point lies so far ahead.
    #[inline(always)]
    fn height_ahead(&self, m: &LocalMove<T>, along: T, across: T, ahead: T) -> (T, Doubt<T>) {
        let infinite = T::of(f64::INFINITY);
        let place = clamp(along - ahead, m.low, m.high);
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

    /// The cutter stands at the lower end where f′(ρ)·ahead/ρ is no more than the slope of the track
    /// there, and at the upper end where it is no less. Both factors are bounded over the square.
    #[inline(always)]
    fn beyond(&self, m: &LocalMove<T>, along: [T; 2], [nearest, farthest]: [T; 2]) -> (bool, bool) {
        let (zero, tiny) = (T::of(0.0), T::of(1e-30));
        let root = |a: T, w: T| (a * a + w * w).larger(tiny).sqrt();
        let ahead = along[1] - m.low;
        let outer = root(ahead, farthest);
        let (_, steepest) = self.height_and_slope(outer.smaller(self.radius));
        let all_gentle = (outer <= self.surely_inside) & (steepest * ahead <= m.slope * root(ahead, nearest));
        let at_low = (ahead <= zero) | all_gentle;
        let ahead = along[0] - m.high;
        let (_, gentlest) = self.height_and_slope(root(ahead, nearest).smaller(self.radius));
        let at_high = (ahead >= zero) & (gentlest * ahead >= m.slope * root(ahead, farthest));
        (at_low, at_high)
    }

    const TRIES_END: bool = true;

    #[inline(always)]
    fn at_end(&self, m: &LocalMove<T>, upper: bool, along: T, across: T) -> (T, T) {
        let (zero, infinite) = (T::of(0.0), T::of(f64::INFINITY));
        let end = if upper { m.high } else { m.low };
        let ahead = along - end;
        let rho = (ahead * ahead + across * across).sqrt();
        let inside = rho <= self.radius;
        let gentle = rho <= self.within;
        let (f, rise) = self.height_and_rise(rho.smaller(self.radius));
        let [rise, run] = if gentle { rise } else { [self.within_slope, T::of(1.0)] };
        let by_ahead = rise * ahead / (run * rho).larger(T::of(1e-30));
        let nearest = if upper { ahead >= zero } else { ahead <= zero };
        // Steeper than assumed beyond `within`, the profile only holds the cutter at the upper end the more.
        let lowest = if upper { by_ahead >= m.slope } else { (by_ahead <= m.slope) & (gentle | nearest) };
        let right = (if inside { lowest } else { nearest }) | (m.low >= m.high);
        let under = if gentle { f } else { self.within_z + self.within_slope * (rho - self.within) };
        let wrong = (by_ahead - m.slope).absolute() * (m.high - m.low);
        let tip = m.z + m.slope * end;
        (if inside { tip + f } else { infinite }, if right { infinite } else { tip + under - wrong })
    }

    #[inline(always)]
    fn height(&self, m: &LocalMove<T>, along: T, across: T) -> (T, Doubt<T>) {
        self.height_ahead(m, along, across, self.ahead::<HEIGHT_STEPS>(m, across))
    }

    /// One step for all points after the other: the steps of one point wait for each other's roots, and
    /// machines look ahead by less than two vectors of points.
    #[inline(always)]
    fn heights<const N: usize>(
        &self,
        m: &LocalMove<T>,
        along: &[[T; N]],
        across: &[[T; N]],
        height: &mut [[T; N]],
        doubt: &mut [[T; N]],
    ) {
        for (c, w) in height.iter_mut().zip(across) {
            for k in 0..N {
                c[k] = self.arc_start(m, w[k]);
            }
        }
        for _ in 0..HEIGHT_STEPS {
            for (c, w) in height.iter_mut().zip(across) {
                for k in 0..N {
                    c[k] = self.arc_step(m, w[k], c[k]);
                }
            }
        }
        for (c, w) in height.iter_mut().zip(across) {
            for k in 0..N {
                c[k] = self.ahead_at(m, w[k], c[k]);
            }
        }
        for b in 0..along.len() {
            for k in 0..N {
                (height[b][k], doubt[b][k]) = self.height_ahead(m, along[b][k], across[b][k], height[b][k]);
            }
        }
    }
}
