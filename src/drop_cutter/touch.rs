//! One triangle under a falling cutter, in closed form.
//!
//! The tip comes to rest at the maximum over the triangle of `F(q) = q.z − f(|q.xy − c|)`, with `f`
//! the cutter's profile and `c` the axis. `f` is convex and never falls, so `F` is concave: first
//! look for its maximum on the triangle's plane; where that lies outside, the maximum over the
//! triangle lies on a side that separates the two. (The contacts known as facet, edge and vertex
//! contact since Bobrow 1985.)

use cutter::Cutter;
use geometry::{Feature, Point3, Vector3};

/// The profile of [`Cutter`] with its constants worked out, since a drop evaluates it some hundred
/// times; optionally grown on all sides.
#[derive(Debug, Clone, Copy)]
pub(super) struct Profile {
    /// The profile itself, from which the rest comes.
    pub(super) shape: cutter::Profile,
    /// Distance from the axis to the centre of the arc.
    pub(super) flat: f64,
    /// Corner radius.
    pub(super) corner: f64,
    /// Where the arc ends and the cone begins.
    pub(super) arc_end: f64,
    /// Slope of the cone; infinite where a cylinder follows the arc.
    pub(super) cone: f64,
    /// Largest radius.
    pub(super) radius: f64,
    /// See [`cutter::Profile::is_plain`].
    plain: bool,
    /// An arc around the axis, up to here: its height needs no other root.
    round_to: f64,
    ball: bool,
}

impl Profile {
    /// The profile of `cutter`, grown by `growth` in every direction (0: as it is). Growing adds
    /// to the corner radius and to the radius: a flat end becomes a bull nose.
    pub(super) fn of(cutter: &Cutter, growth: f64) -> Self {
        let shape = cutter.profile().grown(growth);
        let upright = shape.side.cos == 0.0;
        let round = shape.centre_x == 0.0 && shape.bottom_end == 0.0;
        Self {
            shape,
            flat: shape.centre_x,
            corner: shape.corner,
            arc_end: shape.arc_end,
            cone: if upright { f64::INFINITY } else { shape.side.slope() },
            radius: shape.radius,
            plain: shape.is_plain(),
            round_to: if round { shape.arc_end } else { -1.0 },
            ball: shape.is_ball(),
        }
    }

    /// Height above the (ungrown) tip at distance `rho` from the axis, for `rho` up to the radius.
    pub(super) fn height(&self, rho: f64) -> f64 {
        self.height_squared(rho * rho)
    }

    /// As [`Profile::height`], of the squared distance: a ball needs no other root.
    pub(super) fn height_squared(&self, rho2: f64) -> f64 {
        if self.round_to >= 0.0 && rho2 <= self.round_to * self.round_to {
            return self.shape.centre_z - (self.corner * self.corner - rho2).max(0.0).sqrt();
        }
        self.shape.height(rho2.sqrt())
    }

    /// Whether the profile has no corner, up to the largest radius where it is vertical.
    pub(super) fn is_smooth(&self) -> bool {
        self.plain && self.corner > 0.0 && self.cone.is_infinite()
    }

    /// Whether a plane with that sine of its slope is as steep as the cone or steeper.
    fn on_cone(&self, sine: f64) -> bool {
        self.cone.is_finite() && sine >= self.cone / self.cone.hypot(1.0)
    }

    /// Whether planes up to that sine of their slope touch disc and arc only, where the contact's offset
    /// is the sum of the disc's rim and of the lean.
    pub(super) fn is_sum(&self, sine: f64) -> bool {
        self.plain && !self.on_cone(sine)
    }

    /// Least distance from the axis at which the profile touches a plane with that sine `> 0` of its
    /// slope.
    pub(super) fn least_reach(&self, sine: f64) -> f64 {
        match (self.plain, self.on_cone(sine)) {
            (false, _) => self.shape.reaches(sine)[0],
            (true, true) => self.arc_end,
            (true, false) => self.flat + self.corner * sine,
        }
    }

    /// Greatest distance from the axis at which the profile touches a plane with that sine of its
    /// slope.
    pub(super) fn greatest_reach(&self, sine: f64) -> f64 {
        match (self.plain, self.on_cone(sine)) {
            (false, _) => self.shape.reaches(sine)[1],
            (true, true) => self.radius,
            (true, false) => self.flat + self.corner * sine,
        }
    }

    /// How far from the axis the profile is as steep as `slope >= 0`: where a plane of that slope
    /// touches it.
    fn reach(&self, slope: f64, sine: f64) -> f64 {
        if slope <= LEVEL {
            0.0
        } else if slope > self.cone {
            self.radius
        } else {
            self.shape.reach(sine)
        }
    }

    /// How strictly the profile bends where it touches a plane of that slope: `(κ, s)` such that
    /// within `s` of that place it rises above the plane by at least `κ d² / 2` at distance `d`.
    fn bend(&self, slope: f64, reach: f64) -> (f64, f64) {
        let below_arc = slope < self.shape.bottom.slope() || reach < self.shape.bottom_end;
        if self.corner == 0.0 || slope > self.cone || below_arc {
            return (0.0, 0.0);
        }
        let upright = self.cone.is_infinite() && !self.shape.side_edge;
        let to_cone = if upright { f64::INFINITY } else { self.arc_end - reach };
        if self.flat <= 0.0 {
            // Around the axis it bends by f'/ρ, no less than across the arc.
            let to_bottom = if self.plain { f64::INFINITY } else { reach - self.shape.bottom_end };
            return (1.0 / self.corner, to_cone.min(to_bottom));
        }
        // Across the arc it bends by 1/corner or more; around the axis by f'/ρ, which dies out
        // toward the disc: stay on the outer half of the way from there.
        let half = (0.5 * (reach - self.flat)).min(reach - self.shape.bottom_end).max(0.0);
        let around = half / (self.corner * (reach + half));
        (around.min(1.0 / self.corner), half.min(to_cone))
    }

    /// Where on a line the cutter touches: the line passes the axis at distance `h` and climbs by
    /// `dz` over the plan length `length`; answers the place along it, counted from the point next
    /// to the axis, or `None` where the line passes by the cutter.
    fn along_line(&self, h: f64, dz: f64, length: f64) -> Option<f64> {
        let width = self.radius * self.radius - h * h;
        if width < 0.0 {
            return None;
        }
        if dz == 0.0 {
            return Some(0.0);
        }
        let sine = dz.abs() / (dz * dz + length * length).sqrt();
        let place = if self.ball {
            // A ball: the line sees a circle.
            width.sqrt() * sine
        } else {
            let rise = dz.abs() / length;
            let place =
                if self.plain { self.along_line_general(h, rise, sine) } else { self.shape.ahead(rise, h).0 };
            place.min(width.sqrt())
        };
        Some(place.copysign(dz))
    }

    fn along_line_general(&self, h: f64, rise: f64, sine: f64) -> f64 {
        let arc_width = (self.arc_end * self.arc_end - h * h).max(0.0).sqrt();
        // Beyond the end of the arc while the line still outruns the cone there?
        if h >= self.arc_end || rise * self.arc_end > self.cone * arc_width {
            let share = rise / self.cone;
            return if share < 1.0 {
                (h * share / (1.0 - share * share).sqrt()).max(arc_width)
            } else {
                f64::INFINITY
            };
        }
        if self.corner == 0.0 {
            return (self.flat * self.flat - h * h).max(0.0).sqrt();
        }
        torus_along_line(self.flat, self.corner, h, sine).min(arc_width)
    }
}

/// Most Newton steps for the torus; from the bounds below it takes two to six.
const MAX_STEPS: usize = 60;

/// Where a torus (ring radius `e`, tube radius `r`) touches a line that passes its axis at
/// distance `h < e + r` and climbs at an angle with the sine `s > 0`.
///
/// The contact normal is perpendicular to the line: `C` (0..1) its part across the line in the
/// plan view, `√(1 − C²)` the rest, of which the share `s` lies along the line.
/// Then `h = r C + e C / √(C² + (1 − C²) s²) = H(C)`. `H` is concave and grows, so Newton's method
/// from below never overshoots.
fn torus_along_line(e: f64, r: f64, h: f64, s: f64) -> f64 {
    let s2 = s * s;
    // H(C) <= r C + e and H(C) <= (r + e / s) C bound C from below.
    let mut c = (h / (r + e / s)).max((h - e) / r).clamp(0.0, 1.0);
    for _ in 0..MAX_STEPS {
        let q2 = s2 + (1.0 - s2) * c * c;
        let q = q2.sqrt();
        let step = (h - r * c - e * c / q) / (r + e * s2 / (q2 * q));
        c = (c + step).clamp(0.0, 1.0);
        if step <= f64::EPSILON * c {
            break;
        }
    }
    let rest2 = 1.0 - c * c;
    let sine2 = c * c + rest2 * s2;
    if sine2 == 0.0 {
        return 0.0;
    }
    // Along the line: the ring's centre line and the tube, both toward the normal's plan part.
    let along = rest2.max(0.0).sqrt() * s;
    r * along + e * along / sine2.sqrt()
}

/// A profile resting on a plane, and how fast it leaves the plane from there.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rest {
    /// ∂z/∂x and ∂z/∂y of the plane.
    pub(super) gradient: [f64; 2],
    /// From the axis to where the profile touches the plane, as a multiple of `gradient`.
    pub(super) uphill: f64,
    /// Tip height, less the plane's height at the axis.
    pub(super) lift: f64,
    /// See [`Profile::bend`].
    pub(super) bend: f64,
    /// Up to where `bend` holds.
    pub(super) bend_within: f64,
}

impl Rest {
    /// From the axis to where the profile touches the plane.
    pub(super) fn shift(&self) -> [f64; 2] {
        self.gradient.map(|g| g * self.uphill)
    }

    /// Rests the profile on the plane that climbs by `gradient`.
    pub(super) fn on_plane(gradient: [f64; 2], profile: &Profile) -> Self {
        let slope = gradient[0].hypot(gradient[1]);
        let reach = profile.reach(slope, slope / slope.hypot(1.0));
        let uphill = if reach > 0.0 { reach / slope } else { 0.0 };
        let (bend, bend_within) = profile.bend(slope, reach);
        Self { gradient, uphill, lift: slope * reach - profile.height(reach), bend, bend_within }
    }
}

/// How far a profile has risen above a plane it rests on, at least, at distance `d` from the
/// contact. It is convex: beyond the place up to where it bends it goes straight on, at worst.
pub(super) fn gap(bend: f64, bend_within: f64, d: f64) -> f64 {
    let within = d.min(bend_within);
    bend * within * (d - 0.5 * within)
}

/// A triangle prepared for one profile: two cache lines, of which the first decides whether the
/// second is needed.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
pub(super) struct Facet {
    /// First corner.
    a: Point3,
    gradient: [f64; 2],
    /// From the axis to where the profile touches the plane, as a multiple of `gradient`.
    uphill: f64,
    carries: Carries,
    /// Whether the last two corners are the other way round than in the mesh.
    turned: bool,
    /// As in [`Rest`]; infinite where the triangle is vertical.
    lift: f64,
    /// Second corner: counter-clockwise in the plan view, unlike the mesh's where `turned`.
    b: Point3,
    /// Third corner.
    c: Point3,
    bend: f64,
    bend_within: f64,
}

/// Sides and corners of a triangle on which the cutter is to be rested. A side that two triangles
/// share and a corner that many share need to be looked at with one of them only.
#[derive(Debug, Clone, Copy)]
pub(super) struct Carries {
    /// Side `k` runs from corner `k` to corner `k + 1`; with its ends.
    pub(super) sides: [bool; 3],
    pub(super) corners: [bool; 3],
}

impl Carries {
    pub(super) const ALL: Self = Self { sides: [true; 3], corners: [true; 3] };

    /// For the last two corners the other way round.
    fn turned(&self) -> Self {
        let ([p, q, r], [a, b, c]) = (self.sides, self.corners);
        Self { sides: [r, q, p], corners: [a, c, b] }
    }
}

/// Where a cutter rests on one triangle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Touch {
    /// Height of the tip.
    pub(super) tip_z: f64,
    /// Which part of the triangle, by its corners in the facet's order.
    feature: Feature,
    /// Place along the side, 0 to 1.
    along: f64,
}

/// A slope up to this counts as level: a flat end touches it below its axis, rather than at a place on
/// its rim which rounding has chosen. Greater would lower the tip by more than rounding.
pub(super) const LEVEL: f64 = 1e-13;

/// A triangle counts as vertical where its plan view is less than this share of its area: then its
/// slope is rounding. Its sides still carry the cutter.
const VERTICAL: f64 = 1e-14;

/// A part of a triangle in the other order of corners: a facet's in the mesh's, and the reverse.
fn turned_feature(feature: Feature) -> Feature {
    match feature {
        Feature::Face => Feature::Face,
        Feature::Side(k) => Feature::Side(2 - k),
        Feature::Corner(k) => Feature::Corner((3 - k) % 3),
    }
}

impl Facet {
    /// Prepares a triangle, given by its corners and its unit normal, and which of its sides and
    /// corners [`Facet::touch`] is to look at.
    pub(super) fn new(
        [a, mut b, mut c]: [Point3; 3],
        normal: &Vector3,
        mut carries: Carries,
        profile: &Profile,
    ) -> Self {
        let turned = normal.z <= -VERTICAL;
        if turned {
            std::mem::swap(&mut b, &mut c);
            carries = carries.turned();
        }
        let level = normal.z.abs() >= VERTICAL;
        let gradient = if level { [-normal.x / normal.z, -normal.y / normal.z] } else { [0.0; 2] };
        let Rest { gradient, uphill, lift, bend, bend_within } = Rest::on_plane(gradient, profile);
        let lift = if level { lift } else { f64::INFINITY };
        Self { a, gradient, uphill, carries, turned, lift, b, c, bend, bend_within }
    }

    fn corners(&self) -> [&Point3; 3] {
        [&self.a, &self.b, &self.c]
    }

    /// Where the cutter touches the triangle's plane.
    fn place(&self, x: f64, y: f64) -> [f64; 2] {
        [x + self.gradient[0] * self.uphill, y + self.gradient[1] * self.uphill]
    }

    /// Rests the cutter on this triangle alone, on its face, the sides and the corners that are to be
    /// looked at; `None` where it passes by or where the tip would
    /// not come above `floor`.
    #[inline]
    pub(super) fn touch(&self, profile: &Profile, x: f64, y: f64, floor: f64) -> Option<Touch> {
        let climb = self.gradient[0] * (x - self.a.x) + self.gradient[1] * (y - self.a.y);
        let peak = self.a.z + self.lift + climb;
        // Nothing on the triangle lifts the tip higher than its whole plane does.
        if peak <= floor { None } else { self.touch_below(peak, profile, x, y, floor) }
    }

    /// As [`Facet::touch`], knowing the tip height `peak` when resting on the whole plane.
    fn touch_below(&self, peak: f64, profile: &Profile, x: f64, y: f64, floor: f64) -> Option<Touch> {
        if self.lift == f64::INFINITY {
            return self.touch_sides([true; 3], profile, x, y, floor);
        }
        let at = self.place(x, y);
        let beyond = [0, 1, 2].map(|k| Side::of(self.corners(), k).area_beyond(at));
        let outside = beyond.map(|area| area > 0.0);
        if outside == [false; 3] {
            return Some(Touch { tip_z: peak, feature: Feature::Face, along: 0.0 });
        }
        // Nor does any point of it, if all lie that far from where the cutter touches the plane.
        for k in (0..3).filter(|&k| outside[k]) {
            let away = beyond[k] / Side::of(self.corners(), k).length();
            if peak - gap(self.bend, self.bend_within, away) <= floor {
                return None;
            }
        }
        self.touch_sides(outside, profile, x, y, floor)
    }

    /// Rests the cutter on some of the sides, one of which is known to hold the best place of the
    /// triangle, and on their corners.
    fn touch_sides(&self, sides: [bool; 3], profile: &Profile, x: f64, y: f64, floor: f64) -> Option<Touch> {
        let mut best: Option<Touch> = None;
        for k in 0..3 {
            let least = best.map_or(floor, |b| b.tip_z);
            let looked_at = sides[k] && self.carries.sides[k];
            if looked_at {
                best = Side::of(self.corners(), k).touch(k, profile, x, y, least).or(best);
            }
            // The corner between this side and the last, unless it was looked at as an end.
            let last = (k + 2) % 3;
            if self.carries.corners[k]
                && (sides[k] || sides[last])
                && !looked_at
                && !(sides[last] && self.carries.sides[last])
            {
                best = self.touch_corner(k, profile, x, y, least).or(best);
            }
        }
        best
    }

    /// The part of the facet which is that part of its triangle in the mesh.
    pub(super) fn part(&self, feature: Feature) -> Feature {
        if self.turned { turned_feature(feature) } else { feature }
    }

    /// Rests the cutter on one side or corner alone, whichever place of the triangle is best; answers
    /// the height of the tip if that comes above `floor`.
    pub(super) fn touch_part(
        &self,
        part: Feature,
        profile: &Profile,
        x: f64,
        y: f64,
        floor: f64,
    ) -> Option<f64> {
        let touch = match part {
            Feature::Side(k) => Side::of(self.corners(), k).touch(k, profile, x, y, floor),
            Feature::Corner(k) => self.touch_corner(k, profile, x, y, floor),
            Feature::Face => None,
        };
        touch.map(|t| t.tip_z)
    }

    /// The height of the tip at `(x[i], y)` while resting on the whole plane of the face: nothing in
    /// that plane lifts it higher.
    #[inline(always)]
    pub(super) fn peaks<const N: usize>(&self, x: &[f64; N], y: f64) -> [f64; N] {
        let (height, climb) = (self.a.z + self.lift, self.gradient[1] * (y - self.a.y));
        x.map(|x| height + (self.gradient[0] * (x - self.a.x) + climb))
    }

    /// Rests the cutter on the face alone at the places `(x[i], y)`: where that lifts the tip above
    /// `tips[i]`, it becomes that, and `slots[i]` becomes `slot`.
    #[inline(always)]
    pub(super) fn raise_by_face<const N: usize>(
        &self,
        x: &[f64; N],
        y: f64,
        slot: u32,
        tips: &mut [f64; N],
        slots: &mut [u32; N],
    ) -> bool {
        let sides = [0, 1, 2].map(|k| Side::of(self.corners(), k));
        let shift = self.gradient.map(|g| g * self.uphill);
        let peaks = self.peaks(x, y);
        let beyond = [0, 1, 2].map(|k| sides[k].along[0] * (y + shift[1] - sides[k].from.y));
        let mut raised = false;
        // Without branches, so that several places are worked out at once.
        for i in 0..N {
            let (peak, at) = (peaks[i], x[i] + shift[0]);
            let area = |k: usize| sides[k].along[1] * (at - sides[k].from.x) - beyond[k];
            let better = (area(0) <= 0.0) & (area(1) <= 0.0) & (area(2) <= 0.0) & (peak > tips[i]);
            tips[i] = if better { peak } else { tips[i] };
            slots[i] = if better { slot } else { slots[i] };
            raised |= better;
        }
        raised
    }

    /// Rests the cutter on one corner.
    fn touch_corner(&self, k: usize, profile: &Profile, x: f64, y: f64, floor: f64) -> Option<Touch> {
        let p = self.corners()[k];
        let rho2 = (p.x - x) * (p.x - x) + (p.y - y) * (p.y - y);
        if rho2 > profile.radius * profile.radius || p.z - profile.height(0.0) <= floor {
            return None;
        }
        let tip_z = p.z - profile.height_squared(rho2);
        (tip_z > floor).then_some(Touch { tip_z, feature: Feature::Corner(k), along: 0.0 })
    }

    /// Barycentric coordinates of the place of contact of a cutter at `(x, y)`, in the facet's
    /// order of corners.
    fn weights(&self, touch: &Touch, x: f64, y: f64) -> [f64; 3] {
        let mut weights = [0.0; 3];
        match touch.feature {
            Feature::Corner(k) => weights[k] = 1.0,
            Feature::Side(k) => {
                (weights[k], weights[(k + 1) % 3]) = (1.0 - touch.along, touch.along);
            }
            Feature::Face => {
                let at = self.place(x, y);
                let areas = [1, 2, 0].map(|k| -Side::of(self.corners(), k).area_beyond(at));
                let sum: f64 = areas.iter().sum();
                weights = areas.map(|w| w / sum);
            }
        }
        weights
    }

    /// The place of contact: the point, its barycentric coordinates and its feature, these in the
    /// mesh's order of corners.
    pub(super) fn contact(&self, touch: &Touch, x: f64, y: f64) -> Contact {
        let mut barycentric = self.weights(touch, x, y);
        let corners = self.corners();
        let point = Point3::from((0..3).map(|k| corners[k].coords * barycentric[k]).sum::<Vector3>());
        let mut feature = touch.feature;
        if self.turned {
            barycentric.swap(1, 2);
            feature = turned_feature(feature);
        }
        Contact { point, barycentric, feature }
    }
}

/// See [`Facet::contact`].
pub(super) struct Contact {
    pub(super) point: Point3,
    pub(super) barycentric: [f64; 3],
    pub(super) feature: Feature,
}

/// A side of a facet.
struct Side<'f> {
    from: &'f Point3,
    to: &'f Point3,
    /// In the plan view.
    along: [f64; 2],
}

impl<'f> Side<'f> {
    fn of(corners: [&'f Point3; 3], k: usize) -> Self {
        let (from, to) = (corners[k], corners[(k + 1) % 3]);
        Self { from, to, along: [to.x - from.x, to.y - from.y] }
    }

    /// In the plan view.
    fn length(&self) -> f64 {
        (self.along[0] * self.along[0] + self.along[1] * self.along[1]).sqrt()
    }

    /// Twice the area between the side and `p`, positive where `p` lies outside the facet.
    fn area_beyond(&self, p: [f64; 2]) -> f64 {
        self.along[1] * (p[0] - self.from.x) - self.along[0] * (p[1] - self.from.y)
    }

    /// Rests the cutter on this side alone, the `k`-th of its triangle, if that comes above `floor`.
    fn touch(&self, k: usize, profile: &Profile, x: f64, y: f64, floor: f64) -> Option<Touch> {
        let (a, b) = (self.from, self.to);
        let (dz, length) = (b.z - a.z, self.length());
        let (ax, ay) = (a.x - x, a.y - y);
        let reach2 = profile.radius * profile.radius;
        let (along, rho2) = if length == 0.0 {
            (if dz > 0.0 { 1.0 } else { 0.0 }, ax * ax + ay * ay)
        } else {
            let unit = self.along.map(|d| d / length);
            let h = ax * unit[1] - ay * unit[0];
            let start = ax * unit[0] + ay * unit[1];
            let end = start + length;
            // The side's top end at its place next to the axis would be the best of all.
            let next = 0f64.clamp(start, end);
            if a.z.max(b.z) - profile.height_squared((h * h + next * next).min(reach2)) <= floor {
                return None;
            }
            let place = profile.along_line(h.abs(), dz, length)?;
            let on_side = place.clamp(start, end);
            let along = if on_side == start {
                0.0
            } else if on_side == end {
                1.0
            } else {
                (on_side - start) / length
            };
            // A place on the line within reach may lie beyond the radius by rounding.
            let limit = if on_side == place { reach2 } else { f64::INFINITY };
            (along, (h * h + on_side * on_side).min(limit))
        };
        if rho2 > reach2 {
            return None;
        }
        let z = if along == 1.0 { b.z } else { a.z + dz * along };
        let tip_z = z - profile.height_squared(rho2);
        let feature = match along {
            0.0 => Feature::Corner(k),
            1.0 => Feature::Corner((k + 1) % 3),
            _ => Feature::Side(k),
        };
        (tip_z > floor).then_some(Touch { tip_z, feature, along })
    }
}
