//! Any profile of a bottom cone, an arc and a side cone, from the seven words of APT ([`AptWords`]), and
//! which words make none. mm, rad.
//!
//! What lies inside bottom, corner and side is the cutter, so the profile is convex by the way it is
//! made; words are refused where one of the three would have no part in it.

use keys::{COORDINATE, LENGTH};

use super::apt_words::{AptError, AptWord, AptWords, refused, shown};
use super::body::{Cutter, CutterError};
use super::family::{CutterKey, Family, Given};
use super::profile::{Incline, Profile};

/// Circle and line whose distance is off by no more than this, mm, are taken to touch: programs have
/// four decimals. More turns shallow edges into smooth corners; less refuses cutters that were read
/// from programs.
const TOUCH: f64 = 2.0e-4;

/// Two ends of the arc may be out of order by this angle, rad, of rounding.
const SAME_ANGLE: f64 = 1.0e-9;

/// The seven words. A corner whose place is left away touches bottom and side.
pub(super) const FAMILY: Family = Family {
    word: "apt",
    title: "APT",
    keys: &[
        CutterKey::length("diameter", "D", 6.0, |c| c.words().diameter).noted("where bottom and side cross"),
        CutterKey::number("corner_radius", "R", 0.0..=*LENGTH.end(), |c| c.corner_radius()),
        CutterKey::number("corner_x", "E", COORDINATE, |c| c.words().corner_x)
            .noted("centre of the corner from the axis"),
        CutterKey::number("corner_z", "F", COORDINATE, |c| c.words().corner_z).noted("and above the tip"),
        // Angles below zero are read, so that the refusal can say what they would mean.
        CutterKey::angle("tip_angle", "A", -80.0..=79.99, |c| c.words().tip_angle)
            .noted("of the bottom from level"),
        CutterKey::angle("side_angle", "B", -80.0..=79.99, |c| c.words().side_angle)
            .noted("of the side from the axis"),
        CutterKey::length("length", "H", 20.0, |c| c.words().length),
    ],
    example: None,
    make,
    blame,
};

fn make(given: &Given<'_>) -> Result<Cutter, CutterError> {
    let words = AptWords {
        diameter: given.value("diameter"),
        corner_radius: given.optional("corner_radius").unwrap_or(0.0),
        corner_x: 0.0,
        corner_z: 0.0,
        tip_angle: given.optional("tip_angle").unwrap_or(0.0),
        side_angle: given.optional("side_angle").unwrap_or(0.0),
        length: given.value("length"),
    };
    let words = words.with_centre(given.optional("corner_x"), given.optional("corner_z"));
    Ok(Cutter::apt(&words)?)
}

/// The key that stands for the word to change.
fn blame(error: &CutterError) -> &'static str {
    let CutterError::Apt(refusal) = error else { return "shape" };
    match refusal.word {
        AptWord::Diameter => "diameter",
        AptWord::CornerRadius => "corner_radius",
        AptWord::CornerX => "corner_x",
        AptWord::CornerZ => "corner_z",
        AptWord::TipAngle => "tip_angle",
        AptWord::SideAngle => "side_angle",
        AptWord::Length => "length",
    }
}

impl Cutter {
    /// The cutter of seven words. The corner's circle touches bottom and side or crosses them in an
    /// edge; with a radius greater than half of the diameter and a centre beyond the axis (e < 0) it is
    /// a barrel or a lens.
    ///
    /// # Errors
    /// [`AptError`] where a word is out of range, the bottom is hollow or the side undercut, the pieces
    /// do not meet, one of them has no part in the profile, or the length ends below the corner.
    ///
    /// # Tolerance
    /// A circle within 0.2 µm of touching a line is moved until it does.
    pub fn apt(words: &AptWords) -> Result<Self, AptError> {
        words.check_ranges()?;
        let mut words = *words;
        let r = words.corner_radius;
        let (bottom, side) = (Incline::from_plane(words.tip_angle), Incline::from_axis(words.side_angle));
        let foot = words.foot();
        let (e, f) = (words.corner_x, words.corner_z);
        let from_bottom = f * bottom.cos - e * bottom.sin;
        let from_side = (foot - e) * side.sin + f * side.cos;
        let [tangent_e, tangent_f] = words.tangent_centre();
        if from_bottom > r + TOUCH {
            let reason = format!(
                "the corner's circle hangs {} mm above the bottom and does not meet it",
                shown(from_bottom - r)
            );
            return refused(AptWord::CornerZ, reason, touching(AptWord::CornerZ, [tangent_e, tangent_f]));
        }
        if from_side > r + TOUCH {
            let reason = format!(
                "the corner's circle stands {} mm inside of the side and does not meet it",
                shown(from_side - r)
            );
            return refused(AptWord::CornerX, reason, touching(AptWord::CornerX, [tangent_e, tangent_f]));
        }
        let (bottom_edge, side_edge) = (from_bottom < r - TOUCH, from_side < r - TOUCH);
        [words.corner_x, words.corner_z] = match (bottom_edge, side_edge) {
            (false, false) => [tangent_e, tangent_f],
            (false, true) => [e, (r + e * bottom.sin) / bottom.cos],
            (true, false) => [foot + (f * side.cos - r) / side.sin, f],
            (true, true) => [e, f],
        };
        let begins = words.tip_angle + (from_bottom / r).clamp(-1.0, 1.0).acos();
        let ends = 90f64.to_radians() - words.side_angle - (from_side / r).clamp(-1.0, 1.0).acos();
        // Without a radius the corner is where bottom and side cross, or the words contradict themselves.
        let apart = r > 0.0 && (bottom_edge || side_edge) && begins > ends + SAME_ANGLE;
        if apart || (r == 0.0 && (bottom_edge || side_edge)) {
            let reason =
                "the corner's circle lies beyond bottom and side, and cuts nothing off where they cross";
            return refused(AptWord::CornerX, reason, touching(AptWord::CornerX, [tangent_e, tangent_f]));
        }
        let radius = if side.cos == 0.0 { foot } else { foot + words.length * side.cos / side.sin };
        let centre = [words.corner_x, words.corner_z];
        let mut profile = Profile::tangent(bottom, centre, r, side, f64::INFINITY);
        profile.arc_end = words.corner_x + r * side.sin;
        (profile.bottom_edge, profile.side_edge) = (bottom_edge, side_edge);
        profile.meet(foot);
        if profile.bottom_end < -TOUCH {
            let reason = "the corner's circle crosses the axis above the tip";
            return refused(
                AptWord::CornerZ,
                reason,
                "move the centre down until the circle passes through the tip",
            );
        }
        profile.bottom_end = profile.bottom_end.max(0.0);
        if words.length < profile.arc_end_height - TOUCH {
            let reason =
                format!("the length of {} mm ends below the side, inside of the corner", shown(words.length));
            let cure = format!("write at least {} mm", (profile.arc_end_height * 1e4).ceil() / 1e4);
            return refused(AptWord::Length, reason, cure);
        }
        if side.cos == 0.0 {
            profile.arc_end = radius;
        }
        profile.radius = radius.max(profile.arc_end);
        Ok(Self::new(FAMILY.word, words, profile))
    }
}

impl Cutter {
    /// The cutter pushed outward by a distance on all sides, mm, and how far its tip lies below that of this
    /// one: along the path on which it touches a part this one keeps so far away everywhere. Edges stay edges,
    /// so that a pointed one keeps a little farther.
    ///
    /// # Errors
    /// [`AptError`] where it grows beyond the size of cutters.
    pub fn grown(&self, distance: f64) -> Result<(Self, f64), AptError> {
        let words = *self.words();
        let (bottom, side) = (Incline::from_plane(words.tip_angle), Incline::from_axis(words.side_angle));
        let below = distance / bottom.cos;
        // The side moves out, and is measured at the level of the lower tip.
        let foot = words.foot() + (distance - below * side.cos) / side.sin;
        let share = 1.0 - words.tip_angle.tan() * words.side_angle.tan();
        let grown = AptWords {
            diameter: 2.0 * foot / share,
            corner_radius: words.corner_radius + distance,
            corner_z: words.corner_z + below,
            length: words.length + below,
            ..words
        };
        Ok((Self::apt(&grown)?, below))
    }
}

/// The cure for a corner that is out of place.
fn touching(word: AptWord, [e, f]: [f64; 2]) -> String {
    let value = if word == AptWord::CornerX { e } else { f };
    format!("leave it away, or write {}, for a corner that touches bottom and side", shown(value))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What lies inside bottom, circle and side, asked of the three one by one: the least height of
    /// any point at distance ρ, by bisection.
    fn height_by_definition(w: &AptWords, rho: f64) -> f64 {
        let foot = w.foot();
        let inside = |z: f64| {
            let above_bottom = z >= rho * w.tip_angle.tan();
            let within_side = rho <= foot + z * w.side_angle.tan() + 1e-12;
            // Where the corner stands out of the circle around (e, f), between the two normals.
            let (x, y) = (rho - w.corner_x, z - w.corner_z);
            let beside = x * w.tip_angle.cos() + y * w.tip_angle.sin() > 0.0;
            let below = x * w.side_angle.sin() + y * w.side_angle.cos() < 0.0;
            above_bottom && within_side && (!(beside && below) || x.hypot(y) <= w.corner_radius)
        };
        let (mut low, mut high) = (-1.0, w.length);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            *(if inside(middle) { &mut high } else { &mut low }) = middle;
        }
        high
    }

    #[test]
    fn profiles_are_what_lies_inside_bottom_circle_and_side() {
        for words in AptWords::examples() {
            let cutter = Cutter::apt(&words).unwrap();
            let radius = cutter.radius();
            for k in 0..=400 {
                let rho = radius * f64::from(k) / 400.0 * (1.0 - 1e-9);
                let (got, expected) = (cutter.height(rho).unwrap(), height_by_definition(&words, rho));
                assert!((got - expected).abs() < 1e-7, "{words:?} at {rho}: {got} {expected}");
            }
        }
    }

    #[test]
    fn profiles_are_convex_and_never_fall_and_grow_on_all_sides() {
        for words in AptWords::examples() {
            let cutter = Cutter::apt(&words).unwrap();
            for growth in [0.0, 0.003, 0.5] {
                let profile = cutter.profile().grown(growth);
                let heights: Vec<f64> =
                    (0..=900).map(|k| profile.height(profile.radius * f64::from(k) / 900.0)).collect();
                for h in heights.windows(3) {
                    assert!(h[1] >= h[0] && h[0] - 2.0 * h[1] + h[2] > -1e-12, "{words:?} {growth} {h:?}");
                }
                // It holds a ball of that radius rolled around the cutter, from below.
                for k in 0..=90 {
                    let rho = cutter.radius() * (f64::from(k) / 90.0).min(1.0 - 1e-15);
                    for angle in 0..=30 {
                        let (sin, cos) = (f64::from(angle) * 3f64.to_radians()).sin_cos();
                        let (x, z) = (rho + growth * sin, cutter.height(rho).unwrap() - growth * cos);
                        assert!(profile.height(x.min(profile.radius)) <= z + 1e-9, "{words:?} {growth} {x}");
                    }
                }
            }
        }
    }

    /// Rolled around the cutter, a ball of the distance lies in the grown one and reaches its surface, except
    /// around edges and points.
    #[test]
    fn a_grown_cutter_is_this_one_with_a_ball_around_it() {
        let named = [Cutter::ball(6.0).unwrap(), Cutter::flat(6.0).unwrap(), Cutter::bull(6.0, 1.3).unwrap()];
        let taper = Cutter::taper(2.0, 0.4, 20f64.to_radians(), 6.0).unwrap();
        let words = AptWords::examples().into_iter().map(|words| Cutter::apt(&words).unwrap());
        for (k, cutter) in named.into_iter().chain([taper]).chain(words).enumerate() {
            let (grown, below) = cutter.grown(0.4).unwrap();
            let profile = cutter.profile().grown(0.4);
            assert!(grown.radius() >= profile.radius - 1e-9);
            for j in 0..=500 {
                let rho = profile.radius * f64::from(j) / 500.0 * (1.0 - 1e-9);
                let (got, expected) = (grown.height(rho).unwrap() - below, profile.height(rho));
                assert!((got - expected).abs() < 1e-7, "{k} {cutter:?} at {rho}: {got} {expected}");
            }
        }
        let (ball, below) = Cutter::ball(6.0).unwrap().grown(0.3).unwrap();
        assert!(ball.is_ball() && below == 0.3 && (ball.radius() - 3.3).abs() < 1e-12);
    }

    #[test]
    fn named_cutters_are_made_by_their_words() {
        let taper = Cutter::taper(2.0, 0.4, 20f64.to_radians(), 6.0).unwrap();
        let named =
            [Cutter::ball(6.0).unwrap(), Cutter::flat(6.0).unwrap(), Cutter::bull(6.0, 1.3).unwrap(), taper];
        for cutter in named {
            let again = Cutter::apt(cutter.words()).unwrap();
            assert!((again.radius() - cutter.radius()).abs() < 1e-12);
            for k in 0..=300 {
                let rho = 2.999 * f64::from(k) / 300.0;
                let (a, b) = (again.height(rho).unwrap(), cutter.height(rho).unwrap());
                assert!((a - b).abs() < 1e-12, "{cutter:?} at {rho}: {a} {b}");
            }
        }
    }

    #[test]
    fn words_that_make_no_cutter_name_the_one_to_change() {
        use AptWord::{CornerRadius, CornerX, CornerZ, Diameter, Length, SideAngle, TipAngle};
        type Edit = fn(&mut AptWords);
        let good = AptWords::examples()[0];
        assert!(Cutter::apt(&good).is_ok());
        let change = |f: Edit| {
            let mut words = good;
            f(&mut words);
            Cutter::apt(&words).unwrap_err()
        };
        let cases: [(Edit, AptWord, &str); 12] = [
            (|w| w.diameter = 0.0, Diameter, "diameter is 0"),
            (|w| w.diameter = f64::NAN, Diameter, "NaN"),
            (|w| w.corner_radius = -1.0, CornerRadius, "-1"),
            (|w| w.tip_angle = -0.1, TipAngle, "hollow"),
            (|w| w.tip_angle = f64::INFINITY, TipAngle, "inf"),
            (|w| w.side_angle = -0.1, SideAngle, "undercut"),
            (|w| w.side_angle = 79f64.to_radians(), TipAngle, "steeper than the side"),
            (|w| w.corner_z += 0.3, CornerZ, "above the bottom"),
            (|w| w.corner_x -= 0.3, CornerZ, "above the bottom"),
            (
                |w| (w.corner_x, w.corner_z) = (w.corner_x - 0.3, w.corner_z - 0.1),
                CornerX,
                "inside of the side",
            ),
            (
                |w| (w.corner_x, w.corner_z) = (w.corner_x + 0.4, w.corner_z - 0.3),
                CornerX,
                "beyond bottom and side",
            ),
            (|w| w.length = 0.2, Length, "ends below the side"),
        ];
        for (edit, word, expected) in cases {
            let error = change(edit);
            assert_eq!(error.word, word, "{error}");
            assert!(error.reason.contains(expected) && !error.cure.is_empty(), "{error}");
        }
        // A pointed barrel: its circle crosses the axis above the tip.
        let pointed = AptWords {
            diameter: 6.0,
            corner_radius: 10.0,
            corner_x: -7.0,
            corner_z: 9.0,
            tip_angle: 0.0,
            side_angle: 0.0,
            length: 12.0,
        };
        let error = Cutter::apt(&pointed).unwrap_err();
        assert_eq!(error.word, CornerZ, "{error}");
        let through_tip = AptWords { corner_z: 51f64.sqrt(), ..pointed };
        assert!(Cutter::apt(&through_tip).unwrap().height(0.0).unwrap().abs() < 1e-12);
    }
}
