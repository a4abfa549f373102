//! Strip width: how far apart neighbouring passes may lie at a point of the surface so that the ridge between
//! them stays below a scallop height.
//!
//! Cutter and surface are compared where the cutter cuts. Between them stands `½ (K − B)(x − s t)`, a
//! quadratic form of the place `x` less the contact `s t` along the feed, K and B the second fundamental
//! forms of cutter and surface. The least over all contacts is what a pass leaves at a distance y across the
//! feed:
//!
//! ```text
//! ½ gap y²,   gap = G_bb − G_tb²/G_tt,   G = K − B
//! ```
//!
//! with t along the feed and b across. A ridge of height `h` stands, to second order, between passes
//! `√(8h / gap)` apart. The term with `G_tb` is the twist: where the surface twists along the feed, the
//! cutter cuts ahead of or behind its contact, and passes of a ball may lie farther apart than the section
//! across the feed tells.
//!
//! Beyond the second order a ball and a surface that do not twist are two circles ([`BallSection`]), which is
//! exact. Other cutters show an outline along the feed, exact where the feed is straight and the tool turns
//! with the surface: on planes, and along cylinders under a lead and tilt. What the twist adds counts as
//! curvature of the surface across the feed.
//!
//! Where the curvature changes over a strip, what really stands is measured on the cut surface.

use super::BallSection;
use super::silhouette::{Over, Silhouette};
use cutter::Cutter;
use geometry::Vector3;

/// The strip is never planned wider than this multiple of the strip on a plane, of the cutter or of a ball as
/// wide. Where the surface is nearly as concave as the cutter the width grows without bound, and with it the
/// part of the surface over which its curvature would have to stay the same.
const WIDEST_OVER_PLANE: f64 = 2.5;

/// Widest share of the cutter's diameter that a strip is planned by (flat ends on flat ground).
const WIDEST_OVER_DIAMETER: f64 = 0.8;

/// A surface counts as nearly as concave as the cutter where this share of the cutter's curvature, or
/// less, is left between them.
const NEARLY_AS_CONCAVE: f64 = 0.25;

/// Where a cutter hugs the surface along the feed, the form says little about places so many times farther
/// ahead than aside.
const MOST_ASKEW: f64 = 3.0;

/// How a surface bends at a contact, 1/mm, positive where it is concave toward its normal.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FeedCurvature {
    /// Normal curvature along the feed.
    pub along: f64,
    /// Normal curvature across the feed.
    pub across: f64,
    /// The mixed term of the second fundamental form.
    pub twist: f64,
}

impl FeedCurvature {
    /// By the normal curvature along any tangent, of a feed along `t` with `b` across, both unit.
    pub fn of(t: &Vector3, b: &Vector3, curvature: impl Fn(&Vector3) -> f64) -> Self {
        let askew = (t + b) * std::f64::consts::FRAC_1_SQRT_2;
        let [along, across, between] = [t, b, &askew].map(curvature);
        Self { along, across, twist: between - 0.5 * (along + across) }
    }

    /// How far ahead of a contact a cutter cuts for each mm across, where this is the gap between both.
    fn ahead(&self) -> f64 {
        let ahead = -self.twist / self.along;
        if self.along > 0.0 && ahead.is_finite() { ahead.clamp(-MOST_ASKEW, MOST_ASKEW) } else { 0.0 }
    }

    /// Along the tangent `b + ahead t`.
    fn at(&self, ahead: f64) -> f64 {
        self.across + ahead * (2.0 * self.twist + ahead * self.along)
    }
}

/// How far ahead of its contact the cutter cuts for each mm across the feed: there it stands least above the
/// surface, of all places of the pass; arguments as of [`strip_width_at`].
pub fn cut_ahead(cutter: &Cutter, n: &Vector3, b: &Vector3, surface: &FeedCurvature) -> f64 {
    gap(&bend_of(cutter, n, b), surface).ahead()
}

/// How much more the cutter is curved than the surface there, for a mm across the feed, 1/mm.
pub fn least_gap(cutter: &Cutter, n: &Vector3, b: &Vector3, surface: &FeedCurvature) -> f64 {
    let gap = gap(&bend_of(cutter, n, b), surface);
    gap.at(gap.ahead())
}

/// How the cutter bends at its contact.
fn bend_of(cutter: &Cutter, n: &Vector3, b: &Vector3) -> FeedCurvature {
    if cutter.is_ball() {
        let bend = 1.0 / cutter.radius();
        return FeedCurvature { along: bend, across: bend, twist: 0.0 };
    }
    FeedCurvature::of(&b.cross(n), b, |d| cutter.normal_curvature(n, d))
}

fn gap(cutter: &FeedCurvature, surface: &FeedCurvature) -> FeedCurvature {
    FeedCurvature {
        along: cutter.along - surface.along,
        across: cutter.across - surface.across,
        twist: cutter.twist - surface.twist,
    }
}

/// The curvature across the feed that a surface without twist has where a cutter with this bend leaves as
/// much.
fn untwisted(cutter: &FeedCurvature, surface: &FeedCurvature) -> f64 {
    let gap = gap(cutter, surface);
    if gap.twist == 0.0 || !gap.across.is_finite() {
        return surface.across;
    }
    // What the outline along the feed has less than the section across holds for a plane.
    cutter.at(cutter.ahead()) - gap.at(gap.ahead())
}

/// Width of the strip, mm along the surface, that a cutter leaves below the scallop height `h` around a
/// contact with outward surface normal `n`, across the feed in the tangent direction `b` (both unit, in the
/// frame of the tool), where the part bends as `surface`; and whether the surface is so concave that the
/// width had to be limited.
///
/// # Tolerance
/// A few rounding errors for a ball where nothing twists; 1e-9 of the width for the outline of another
/// cutter, never more than it.
pub fn strip_width_at(
    cutter: &Cutter,
    n: &Vector3,
    b: &Vector3,
    surface: &FeedCurvature,
    h: f64,
) -> (f64, bool) {
    width_within(WIDEST_OVER_DIAMETER * 2.0 * cutter.radius(), cutter, n, b, surface, h)
}

/// As [`strip_width_at`], also where flat ends on flat ground leave nothing until their strips part: no path
/// has a wider one.
pub fn widest_strip_at(
    cutter: &Cutter,
    n: &Vector3,
    b: &Vector3,
    surface: &FeedCurvature,
    h: f64,
) -> (f64, bool) {
    width_within(2.0 * cutter.radius(), cutter, n, b, surface, h)
}

/// As [`strip_width_at`], where it is the cutter that is fed straight, not its contact: it sweeps a cylinder,
/// which touches the surface along the tangent that is conjugate to the feed on the cutter. A twist of the
/// surface then turns the contacts away from the feed, and widens no strip.
pub fn strip_width_fed(
    cutter: &Cutter,
    n: &Vector3,
    b: &Vector3,
    surface: &FeedCurvature,
    h: f64,
) -> (f64, bool) {
    let across = surface.at(bend_of(cutter, n, b).ahead());
    width_over(WIDEST_OVER_DIAMETER * 2.0 * cutter.radius(), cutter, n, b, across, h)
}

/// [`strip_width_at`], `most` mm at most.
fn width_within(
    most: f64,
    cutter: &Cutter,
    n: &Vector3,
    b: &Vector3,
    surface: &FeedCurvature,
    h: f64,
) -> (f64, bool) {
    // An edge shows no meridian to compare.
    let surface =
        if cutter.touches_with_edge(n) { surface.across } else { untwisted(&bend_of(cutter, n, b), surface) };
    width_over(most, cutter, n, b, surface, h)
}

/// The width of the strip over a surface without twist, of a curvature across the feed.
fn width_over(most: f64, cutter: &Cutter, n: &Vector3, b: &Vector3, surface: f64, h: f64) -> (f64, bool) {
    if cutter.is_ball() {
        return strip_width(1.0 / cutter.radius(), surface, h, cutter.radius());
    }
    let outline = Silhouette::new(cutter, *n, *b);
    let of_ball = widest(h, cutter.radius()).min(most);
    let widest = || {
        let on_plane = outline.width(&Over { curvature: 0.0, height: h, farthest: most });
        if on_plane.is_nan() { of_ball } else { (WIDEST_OVER_PLANE * on_plane).clamp(of_ball, most) }
    };
    // A point has no curvature to compare: it leaves grooves.
    let curvature = bend_of(cutter, n, b).across;
    let too_concave = curvature.is_finite() && too_concave(curvature, surface);
    if surface > 0.0 && curvature <= surface && !cutter.touches_with_edge(n) {
        // A flat end stands over a hollow by its sides.
        let (widest, over_hollow) = (widest(), (8.0 * h / (surface - curvature)).sqrt());
        return (widest.min(over_hollow).max(of_ball), too_concave && over_hollow < widest);
    }
    let width = outline.width(&Over { curvature: surface, height: h, farthest: most });
    if width.is_nan() || width <= 0.0 {
        // Over twisted ground the outline may turn back: the circle that osculates the cutter tells more.
        return strip_width(curvature, surface, h, cutter.radius());
    }
    if width < of_ball {
        return (width, false);
    }
    let widest = widest();
    if width < widest { (width, false) } else { (widest, too_concave) }
}

/// Width of the strip, mm along the surface, for scallop height `h` where the cutter is a circle of curvature
/// `cutter` and the surface one of curvature `surface` across the feed (1/mm, positive concave), limited for
/// a cutter of radius `radius`. The second value is true where the limit acted: the surface is as concave as
/// the cutter, or more.
pub fn strip_width(cutter: f64, surface: f64, h: f64, radius: f64) -> (f64, bool) {
    let widest = widest(h, radius);
    let circle = (cutter > 0.0).then(|| BallSection::new(1.0 / cutter, surface).ok()).flatten();
    let width = circle.map_or(f64::INFINITY, |circle| {
        // Where no step leaves so high a ridge, the widest that leaves one serves.
        circle.step(h).unwrap_or_else(|_| circle.greatest_step()).arc
    });
    if width > widest { (widest, too_concave(cutter, surface)) } else { (width, false) }
}

/// The widest strip that is ever planned, mm.
fn widest(h: f64, radius: f64) -> f64 {
    (WIDEST_OVER_PLANE * (8.0 * h * radius).sqrt()).min(WIDEST_OVER_DIAMETER * 2.0 * radius)
}

fn too_concave(cutter: f64, surface: f64) -> bool {
    surface > 0.0 && cutter - surface < NEARLY_AS_CONCAVE * cutter
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::section::ball_scallop_height;
    use cutter::AptWords;

    fn across(across: f64) -> FeedCurvature {
        FeedCurvature { across, ..FeedCurvature::default() }
    }

    /// A bull nose on a steep hollow that bends across the feed nearly as it does: its outline turns back
    /// before it is as high as asked.
    #[test]
    fn strips_have_a_width_where_the_outline_turns_back() {
        let bull = Cutter::bull(2.0, 1.0 / 3.0).unwrap();
        let n = Vector3::new(0.108_427_731_875_199_63, -0.967_080_179_726_517_9, 0.230_215_883_336_761_9);
        let b = Vector3::new(-0.255_395_001_205_999_06, 0.196_709_405_509_804_1, 0.946_614_389_887_966_9);
        let (width, _) = strip_width_at(&bull, &n, &b, &across(1.158_174_081_754_779_6), 0.009_95);
        assert!(width > 0.1 && width < 1.0, "{width}");
    }

    /// A surface `z = 0.35 x + 0.1 y + c x y`.
    #[derive(Clone, Copy)]
    struct Twisted(f64);

    impl Twisted {
        fn at(self, x: f64, y: f64) -> Vector3 {
            Vector3::new(x, y, 0.35 * x + 0.1 * y + self.0 * x * y)
        }

        fn normal(self, x: f64, y: f64) -> Vector3 {
            Vector3::new(-0.35 - self.0 * y, -0.1 - self.0 * x, 1.0).normalize()
        }

        /// The ridge over the normal at x = 0 between two passes whose contacts at x have a y each, by brute
        /// force.
        fn ridge(self, cutter: &Cutter, contacts: [&dyn Fn(f64) -> f64; 2]) -> f64 {
            let tips = |y: &dyn Fn(f64) -> f64| {
                let at = |k: i32| {
                    let x = f64::from(k) * 2e-4;
                    self.at(x, y(x)) + cutter.contact_to_tip(&self.normal(x, y(x)))
                };
                (-4000..=4000).map(at).collect::<Vec<_>>()
            };
            let passes = contacts.map(tips);
            let envelope = |pass: &[Vector3], y: f64| {
                let over =
                    |tip: &Vector3| tip.z + cutter.height(tip.x.hypot(tip.y - y)).unwrap_or(f64::INFINITY);
                pass.iter().map(over).fold(f64::INFINITY, f64::min)
            };
            // Where both leave as much: one rises and the other falls.
            let [mut low, mut high] = contacts.map(|y| y(0.0));
            for _ in 0..40 {
                let middle = 0.5 * (low + high);
                let [a, b] = [0, 1].map(|k| envelope(&passes[k], middle));
                if a < b { low = middle } else { high = middle }
            }
            (envelope(&passes[0], low).min(envelope(&passes[1], low)) - self.at(0.0, low).z)
                * self.normal(0.0, low).z
        }
    }

    /// By the section across the feed alone, ridges of the ball are lower than asked, and those of the bull
    /// nose higher.
    #[test]
    fn strips_are_as_wide_as_a_twisted_surface_lets_them_be() {
        let h = 1e-3;
        for (cutter, c) in [(Cutter::ball(10.0).unwrap(), 0.06), (Cutter::bull(10.0, 2.0).unwrap(), 0.03)] {
            let (x_tangent, y_tangent) = (Vector3::new(1.0, 0.0, 0.35), Vector3::new(0.0, 1.0, 0.1));
            let n = x_tangent.cross(&y_tangent).normalize();
            let t = x_tangent.normalize();
            let b = n.cross(&t);
            // The form has one entry, between x and y.
            let curvature = |d: &Vector3| 2.0 * c * n.z * d.x * d.y;
            let surface = FeedCurvature::of(&t, &b, curvature);
            let plain = FeedCurvature { twist: 0.0, ..surface };
            let [width, by_section] = [surface, plain].map(|s| strip_width_at(&cutter, &n, &b, &s, h).0);
            // Passes at constant y are so far apart across the feed.
            let apart = b.dot(&y_tangent);
            let [real, off] =
                [width, by_section].map(|width| Twisted(c).ridge(&cutter, [&|_| 0.0, &|_| width / apart]));
            assert!((real / h - 1.0).abs() < 0.01 && (off / h - 1.0).abs() > 0.05, "{real} {off}");
        }
    }

    /// A ball whose centre runs in planes at constant y: by strips of contacts along the feed, ridges are
    /// higher than asked.
    #[test]
    fn a_cutter_fed_straight_over_a_twist_takes_no_wider_strip() {
        let (h, c, cutter) = (1e-3, 0.06, Cutter::ball(10.0).unwrap());
        let surface = Twisted(c);
        let n = surface.normal(0.0, 0.0);
        let t = Vector3::new(1.0, 0.0, 0.35).normalize();
        let b = n.cross(&t);
        let curvature = |d: &Vector3| 2.0 * c * n.z * d.x * d.y;
        let bends = FeedCurvature::of(&t, &b, curvature);
        let centre = |x: f64, y: f64| y + cutter.axis_offset(&surface.normal(x, y)).y;
        let contacts = |plane: f64| {
            move |x: f64| {
                let (mut low, mut high) = (-3.0, 3.0);
                for _ in 0..60 {
                    let middle = 0.5 * (low + high);
                    *(if centre(x, middle) < plane { &mut low } else { &mut high }) = middle;
                }
                low
            }
        };
        let [real, off] = [strip_width_fed, strip_width_at].map(|strip| {
            // On the surface of the centres, and from there to the plan.
            let on_offset = strip(&cutter, &n, &b, &bends, h).0 * (1.0 - curvature(&b) * cutter.radius());
            let apart = on_offset * (1.0 - n.y * n.y).sqrt();
            let (first, second) = (contacts(centre(0.0, 0.0)), contacts(centre(0.0, 0.0) + apart));
            surface.ridge(&cutter, [&first, &second])
        });
        assert!((real / h - 1.0).abs() < 0.01 && off / h - 1.0 > 0.05, "{real} {off}");
    }

    #[test]
    fn strips_of_balls_have_the_exact_height() {
        let r = 3.0;
        let ball = Cutter::ball(2.0 * r).unwrap();
        for over in [1e-4, 1e-3, 1e-2, 0.05, 0.1] {
            for bend in [-1.0, -0.3, -0.01, -1e-9, 0.0, 1e-9, 0.01, 0.3, 0.6] {
                let (kappa, h) = (bend / r, over * r);
                let (width, limited) = strip_width(1.0 / r, kappa, h, r);
                let of_ball = strip_width_at(&ball, &Vector3::z(), &Vector3::x(), &across(kappa), h);
                assert!(!limited && of_ball == (width, false), "{bend} {over}");
                let real = ball_scallop_height(r, kappa, width).unwrap();
                assert!((real / h - 1.0).abs() < 1e-9, "{bend} {over}: {real}");
            }
        }
        assert!(strip_width(0.2, 0.25, 0.01, 5.0).1, "concave beyond the ball: limited, and said so");
        assert!(!strip_width(0.0, 0.0, 0.01, 5.0).1, "a flat end on a plane is limited, but not by the part");
        // On level ground flats part where their strips do; on a slope of one degree the rim is an arc of
        // r/sin 1°.
        let (flat, bull, h) = (Cutter::flat(20.0).unwrap(), Cutter::bull(20.0, 2.0).unwrap(), 0.01);
        let [level, slope] = [0.0f64, 1.0]
            .map(|degrees| Vector3::new(-degrees.to_radians().sin(), 0.0, degrees.to_radians().cos()));
        let of = |width: fn(&Cutter, &Vector3, &Vector3, &FeedCurvature, f64) -> (f64, bool), cutter, n| {
            width(cutter, n, &Vector3::y(), &across(0.0), h).0
        };
        assert_eq!([&flat, &bull].map(|cutter| of(strip_width_at, cutter, &level)), [16.0; 2]);
        assert!((of(widest_strip_at, &flat, &level) - 20.0).abs() < 1e-9);
        let on_plane = 16.0 + 2.0 * (2.0 * 2.0 * h - h * h).sqrt();
        assert!((of(widest_strip_at, &bull, &level) - on_plane).abs() < 1e-9);
        let chord = 2.0 * (100.0 - (10.0 - h / 1f64.to_radians().sin()).powi(2)).sqrt();
        assert!((of(strip_width_at, &flat, &slope) / chord - 1.0).abs() < 1e-3);
        let thin = strip_width(1.0 / 3.0, -300.0, 1.0, 3.0).0;
        assert!(thin > 0.0 && ball_scallop_height(3.0, -300.0, thin).unwrap() < 1.0, "a wire");
    }

    #[test]
    fn a_sharp_corner_leaves_stairs() {
        let flat = Cutter::flat(6.0).unwrap();
        let slope = 30f64.to_radians();
        let (n, up) =
            (Vector3::new(-slope.sin(), 0.0, slope.cos()), Vector3::new(slope.cos(), 0.0, slope.sin()));
        let (width, _) = strip_width_at(&flat, &n, &up, &across(0.0), 0.01);
        assert!((width * slope.sin() * slope.cos() - 0.01).abs() < 1e-11);
        // Fed up or down the slope it shows an ellipse of half axes R and R sin λ.
        let (along, _) = strip_width_at(&flat, &n, &Vector3::y(), &across(0.0), 0.01);
        let height = 3.0 * slope.sin() * (1.0 - (1.0 - (0.5 * along / 3.0f64).powi(2)).sqrt());
        assert!((height / 0.01 - 1.0).abs() < 1e-9, "{height}");
    }

    #[test]
    fn a_point_leaves_grooves() {
        // A drill point upright on ground that rises across the feed less than its flank.
        let cone = Cutter::apt(&AptWords::examples()[1]).unwrap();
        let (flank, rise) = (cone.profile().point().sin.asin(), 5f64.to_radians());
        let (n, b) = (Vector3::new(-rise.sin(), 0.0, rise.cos()), Vector3::new(rise.cos(), 0.0, rise.sin()));
        let width = strip_width_at(&cone, &n, &b, &across(0.0), 1e-3).0;
        let groove = 1e-3 * (1.0 / (flank + rise).tan() + 1.0 / (flank - rise).tan());
        assert!((width / groove - 1.0).abs() < 1e-9, "{width} {groove}");
    }

    /// The lower outline of a cutter seen along the feed, by brute force: the hull of many places of its
    /// surface, x across the feed and y over the contact, from left to right.
    fn outline(cutter: &Cutter, n: &Vector3, b: &Vector3) -> Vec<[f64; 2]> {
        const PARTS: usize = 1200;
        let mut places = Vec::new();
        let profile = cutter.profile();
        // The ends of the pieces, and places between; the last is the rim.
        let between = (0..=PARTS).map(|i| cutter.radius() * i as f64 / PARTS as f64);
        for rho in [profile.bottom_end, profile.arc_end].into_iter().chain(between) {
            let z = cutter.height(rho).unwrap();
            for k in 0..2 * PARTS {
                let (sin, cos) = (std::f64::consts::PI * k as f64 / PARTS as f64).sin_cos();
                let p = Vector3::new(rho * cos, rho * sin, z);
                places.push([p.dot(b), p.dot(n)]);
                if rho == cutter.radius() {
                    // The cylinder above.
                    let p = p + Vector3::z();
                    places.push([p.dot(b), p.dot(n)]);
                }
            }
        }
        let low = places.iter().copied().min_by(|a, b| a[1].total_cmp(&b[1])).unwrap();
        places.retain(|p| p[1] < low[1] + 1.0);
        places.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let mut hull: Vec<[f64; 2]> = Vec::new();
        for p in places {
            while let [.., a, c] = hull[..]
                && (c[0] - a[0]) * (p[1] - a[1]) <= (p[0] - a[0]) * (c[1] - a[1])
            {
                hull.pop();
            }
            hull.push(p);
        }
        hull.into_iter().map(|p| [p[0] - low[0], p[1] - low[1]]).collect()
    }

    /// Height of the ridge between passes `width` apart on a surface of curvature `kappa`: where the outlines
    /// cross, each turned by half of the width about the surface's middle.
    fn ridge(hull: &[[f64; 2]], width: f64, kappa: f64) -> f64 {
        // By the way along the surface and the height over it.
        let polar = |[x, y]: [f64; 2]| {
            let (dx, dy) = (x * kappa, 1.0 - y * kappa);
            let over = (2.0 * y - kappa * (x * x + y * y)) / (1.0 + dx.hypot(dy));
            [if kappa == 0.0 { x } else { dx.atan2(dy) / kappa }, over]
        };
        // Straight pieces of the outline are bent seen from a bent surface.
        const PIECES: usize = 50;
        let pieces = hull.windows(2).flat_map(|w| {
            (0..PIECES)
                .map(|k| k as f64 / PIECES as f64)
                .map(|t| [0, 1].map(|c| w[0][c] + t * (w[1][c] - w[0][c])))
        });
        let hull: Vec<[f64; 2]> = pieces.map(polar).collect();
        let over = |s: f64| {
            let k = hull.partition_point(|p| p[0] <= s).clamp(1, hull.len() - 1);
            let ([s0, h0], [s1, h1]) = (hull[k - 1], hull[k]);
            h0 + (h1 - h0) * (s - s0) / (s1 - s0)
        };
        let (mut a, mut b) = (-width, width);
        for _ in 0..60 {
            let middle = 0.5 * (a + b);
            // The first pass rises to the right of its contact, the next one to the left.
            *(if over(middle) < over(middle - width) { &mut a } else { &mut b }) = middle;
        }
        over(a)
    }

    #[test]
    fn strips_of_other_cutters_have_the_height_that_swept_cutters_leave() {
        let mut examples = vec![Cutter::bull(10.0, 2.0).unwrap(), Cutter::flat(8.0).unwrap()];
        examples.extend(AptWords::examples().iter().take(5).map(|words| Cutter::apt(words).unwrap()));
        for cutter in &examples {
            for (lead, tilt) in [(5.0f64, 0.0f64), (15.0, 10.0), (3.0, -25.0)] {
                let axis = Vector3::new(lead.to_radians().tan(), tilt.to_radians().tan(), 1.0).normalize();
                let [n, b] = [Vector3::z(), Vector3::y()].map(|v| motion::in_tool_frame(&axis, &v));
                let hull = outline(cutter, &n, &b);
                for (kappa, h) in [(0.0, 0.01), (0.0, 0.1), (-0.03, 0.05), (0.01, 0.05)] {
                    let (width, limited) = strip_width_at(cutter, &n, &b, &across(kappa), h);
                    if limited || width >= WIDEST_OVER_DIAMETER * 2.0 * cutter.radius() {
                        continue;
                    }
                    let real = ridge(&hull, width, kappa);
                    assert!(
                        (real / h - 1.0).abs() < 2e-3,
                        "{:?} {lead} {tilt} {kappa} {h}: {real} {width}",
                        cutter.words()
                    );
                }
            }
        }
    }

    /// The cone of a taper begins far above the scallops: on level and hollow ground its strips are those of
    /// the bull nose with the same end, though its side leads out of a hollow again.
    #[test]
    fn a_long_side_changes_no_strip() {
        let taper = Cutter::taper(3.0, 1.0, 5f64.to_radians(), 6.0).unwrap();
        let bull = Cutter::bull(3.0, 1.0).unwrap();
        for h in [0.03, 0.1] {
            for k in 0..441 {
                let lean = |k: i32| 0.01 * f64::from(k - 10);
                let n = Vector3::new(lean(k % 21), lean(k / 21), 1.0).normalize();
                let b = n.cross(&Vector3::new(1.0, 0.0, -n.x / n.z).normalize());
                for bend in [-0.12, 0.0, 0.05, 0.12] {
                    let [a, b] =
                        [&taper, &bull].map(|cutter| strip_width_at(cutter, &n, &b, &across(bend), h).0);
                    // In hollows the wider cutter's strips are limited later.
                    let [a, b] = [a, b].map(|width| width.min(widest(h, bull.radius())));
                    assert!((a / b - 1.0).abs() < 1e-9, "{h} {n:?} {bend}: {a} {b}");
                }
            }
        }
    }
}
