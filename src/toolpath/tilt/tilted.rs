//! Passes of a cutter whose axis tilts: sampled where it touches, located, smoothed and thinned.
//!
//! Enters: contacts along a curve with the feed there, and a rule for the axis. Leaves: cutter locations
//! between which the cutter strays from the exact path by no more than the chord tolerance, mm.
//! Between two locations the tip runs straight and the axis turns evenly. What cuts is the cutter's arc,
//! so its strays count: that of the arc's centre height on the axis, and the turn of the axis times the
//! distance of the arc from it, which is none for a ball.
//!
//! Contacts are kept until the passes are ordered: a lead leans the other way on a pass that is cut backwards.
//!
//! Where cutters are dropped, a ball is tilted around its centre, so that every strategy serves five axes. For other
//! cutters a ball as large as their corner is dropped and gives contact and normal; its normal turns over an edge as the ball
//! rolls. Beside the border of a mesh its plane goes on, because a flat rolled over an edge would lean out.

use crate::moves::chord::{Side, Watch, moved_aside, reduced_indices, sample_within_chord};
use crate::moves::smooth::smooth_and_spread_tilted;
use crate::moves::touch::Touch;
use crate::surface::border::Border;
use crate::vocabulary::{PlanError, Setup};
use collision::Interference;
use cutter::Cutter;
use geometry::{Point3, Vector3};
use motion::{AxisError, CcPoint, ClPoint, ToolAxis};
use part::Part;
use work::monitor::{Cancelled, Monitor};

/// Share of the chord tolerance that samples may stray, and that leaving samples out may add to that. A pass around the
/// centres of upright moves has half of the tolerance behind it.
const SAMPLING_SHARE: f64 = 0.1;
const LOCATED_SHARE: f64 = 0.7;
const AROUND_CENTRES_SHARE: f64 = 0.3;

/// An axis that was turned away from its rule stays this far above the surface, as a sine.
pub(crate) const ABOVE_SURFACE: f64 = 0.02;

/// How far samples of a located pass may stray, mm.
pub(crate) fn located_sampling(chord_tolerance: f64) -> f64 {
    SAMPLING_SHARE * chord_tolerance
}

/// How a cutter is tilted.
#[derive(Debug, Clone, Copy)]
pub struct Tilting<'a> {
    /// The rule for the axis.
    pub axis: &'a ToolAxis,
    /// The axis turns by no more than this along a pass, rad a mm of contact; `None` leaves the rule alone.
    pub most_turning: Option<f64>,
    /// From pass to pass it turns by no more than this, rad a mm between neighbouring contacts.
    pub most_turning_across: Option<f64>,
    /// What the tool must keep away from; passes are repaired where it does not.
    pub interference: Option<&'a Interference<'a>>,
}

/// Passes of a tilted cutter, not yet joined.
pub(crate) struct TiltedPasses {
    /// Where the cutter touches along each.
    pub passes: Vec<Vec<Touch>>,
    /// How far moves may stray from the touches, mm.
    pub tolerance: f64,
    /// The sampling distance, mm, by which passes are smoothed; `None` leaves them as they are.
    pub smoothing: Option<f64>,
}

impl TiltedPasses {
    /// Passes that were located by their contacts.
    pub fn located(passes: Vec<Vec<Touch>>, chord_tolerance: f64) -> Self {
        Self { passes, tolerance: LOCATED_SHARE * chord_tolerance, smoothing: None }
    }
}

/// Touches along a curve over `[s0, s1]` so close that moves between them stray by a share of the chord
/// tolerance. `contact(s)` gives contact and tangent, of either sense.
///
/// # Errors
/// [`PlanError::Axis`] where the rule gives no axis, or [`Cancelled`].
pub(crate) fn along(
    contact: &dyn Fn(f64) -> Option<(CcPoint, Vector3)>,
    [s0, s1]: [f64; 2],
    cutter: &Cutter,
    rule: &ToolAxis,
    chord_tolerance: f64,
    monitor: &dyn Monitor,
) -> Result<Vec<Touch>, PlanError> {
    // The tangent keeps its sense along a curve; the first stretch tells which it is.
    let ahead = s0 + 1e-3 * (s1 - s0).min(1.0);
    let backwards = match (contact(s0), contact(ahead)) {
        (Some((a, t)), Some((b, _))) => (b.point - a.point).dot(&t) < 0.0,
        _ => false,
    };
    let mut refused = None;
    let mut locate = |s: f64| {
        let (contact, t) = contact(s)?;
        match Touch::by(rule, cutter, contact, if backwards { -t } else { t }) {
            Ok(touch) => Some(touch),
            Err(error) => {
                refused.get_or_insert(error);
                None
            }
        }
    };
    let fine = located_sampling(chord_tolerance);
    let touches = sample_within_chord(s0, s1, 1.0, fine, &mut locate, &mut Watch::new(monitor))?;
    refused.map_or(Ok(touches), |error| Err(PlanError::Axis(error)))
}

/// The radius of a probe is that of the cutter's corner, but no less than this share of its own: where facets meet, the
/// normal turns over an arc of that radius; what is more hollow it does not reach into.
const PROBE_OVER_RADIUS: f64 = 0.25;

/// The ball that is dropped to find where a cutter touches; `None` for a ball.
pub(crate) fn probe(cutter: &Cutter) -> Option<Cutter> {
    let radius = cutter.corner_radius().max(PROBE_OVER_RADIUS * cutter.radius());
    let other = !cutter.is_ball();
    other.then(|| Cutter::ball(2.0 * radius).ok()).flatten()
}

/// Passes of a ball that was dropped upright: its tips along each.
pub(crate) struct Dropped<'a> {
    pub passes: &'a [Vec<Point3>],
    pub ball: &'a Cutter,
}

impl Dropped<'_> {
    /// Where the ball touches while its centre is there. Beside the part's border the plane goes on on which the border lies,
    /// for all but a ball that cuts itself.
    fn contact(&self, part: &Part, border: Option<&Border<'_>>, centre: &Point3) -> Option<CcPoint> {
        let foot = part.closest_point(centre).0;
        let normal = (centre - foot.point).try_normalize(1e-9)?;
        match border.filter(|border| border.holds(&foot)) {
            Some(_) => {
                let off = (centre - foot.point).dot(&foot.normal);
                Some(CcPoint { point: centre - foot.normal * off, normal: foot.normal })
            }
            None => Some(CcPoint { point: centre - normal * self.ball.radius(), normal }),
        }
    }
}

/// A cutter tilted where a ball that was dropped upright touches: around its centre, if it is that ball itself.
///
/// # Errors
/// [`PlanError::Axis`] where the rule gives no axis, or [`Cancelled`].
pub(crate) fn around_centres(
    dropped: &Dropped<'_>,
    rule: &ToolAxis,
    setup: &Setup<'_>,
) -> Result<TiltedPasses, PlanError> {
    let Setup { part, cutter, monitor, .. } = *setup;
    let chord_tolerance = setup.settings.chord_tolerance;
    let passes = dropped.passes;
    monitor.start("tilting the cutter", passes.len() as u64);
    let up = Vector3::z() * dropped.ball.radius();
    let border = (!cutter.is_ball()).then(|| Border::of(part));
    let passes = work::parallel::try_map(passes.len(), |k| {
        let tips = &passes[k];
        let last = tips.len() - 1;
        // Feeds turn evenly from point to point.
        let way = |a: usize, b: usize| (tips[b] - tips[a]).try_normalize(1e-12);
        let closed = last > 2 && tips[0] == tips[last];
        let feed_at = |k: usize| {
            let before = if k > 0 {
                way(k - 1, k)
            } else if closed {
                way(last - 1, last)
            } else {
                None
            };
            let after = if k < last {
                way(k, k + 1)
            } else if closed {
                way(0, 1)
            } else {
                None
            };
            (before.unwrap_or_default() + after.unwrap_or_default()).try_normalize(1e-12)
        };
        let contact = |s: f64| {
            let k = (s as usize).min(last.checked_sub(1)?);
            let t = s - k as f64;
            let centre = tips[k] + (tips[k + 1] - tips[k]) * t + up;
            let contact = dropped.contact(part, border.as_ref(), &centre)?;
            let (a, b) = (feed_at(k)?, feed_at(k + 1)?);
            Some((contact, (a * (1.0 - t) + b * t).try_normalize(1e-12)?))
        };
        let touches = along(&contact, [0.0, last as f64], cutter, rule, chord_tolerance, monitor)?;
        monitor.advance(1);
        Ok::<_, PlanError>(touches)
    })?;
    Ok(TiltedPasses { passes, tolerance: AROUND_CENTRES_SHARE * chord_tolerance, smoothing: None })
}

/// The pass fed the other way round: the axis follows the feed where the rule says so.
pub(crate) fn reversed(pass: &[Touch], cutter: &Cutter, rule: &ToolAxis) -> Result<Vec<Touch>, AxisError> {
    pass.iter().rev().map(|touch| Touch::by(rule, cutter, touch.contact, -touch.feed)).collect()
}

/// Rounds of evening out before a pass is given up on; each halves the sharpest turns at least.
const MOST_ROUNDS: usize = 2000;

/// Evens out the axes of a pass until none turns by more than `rate`, rad a mm of contact, along it; contacts stay.
/// Returns whether that was reached.
pub(crate) fn limit_turning(pass: &mut [Touch], cutter: &Cutter, rate: f64) -> bool {
    let n = pass.len();
    let way: Vec<f64> =
        pass.windows(2).map(|w| (w[1].contact.point - w[0].contact.point).norm().max(1e-9)).collect();
    let mut axes: Vec<Vector3> = pass.iter().map(|touch| touch.at.axis).collect();
    let turns_too_fast =
        |axes: &[Vector3]| (1..n).any(|k| (axes[k] - axes[k - 1]).norm() > rate * way[k - 1] * (1.0 + 1e-9));
    let mut changed = false;
    for _ in 0..MOST_ROUNDS {
        if !turns_too_fast(&axes) {
            break;
        }
        changed = true;
        // Pairs that turn too fast meet half way, forth and back.
        let mut meet = |k: usize| {
            let (a, b) = (axes[k - 1], axes[k]);
            let (apart, most) = ((b - a).norm(), rate * way[k - 1]);
            if apart > most {
                let by = 0.5 * (1.0 - most / apart);
                let (a, b) = (a + (b - a) * by, b + (a - b) * by);
                (axes[k - 1], axes[k]) = (a.normalize(), b.normalize());
            }
        };
        (1..n).for_each(&mut meet);
        (1..n).rev().for_each(&mut meet);
    }
    if changed {
        for (touch, axis) in pass.iter_mut().zip(&axes) {
            *touch = Touch::along(*axis, cutter, touch.contact, touch.feed);
        }
    }
    !turns_too_fast(&axes)
}

/// The locations that a pass needs to stay within `tolerance` of it, mm, and clear of what is to be kept away from, as far as
/// its own moves are; smoothed and spread by `smoothing`, mm, where that is asked for and clear too.
pub(crate) fn located(
    pass: &[Touch],
    tolerance: f64,
    smoothing: Option<f64>,
    keep: Option<&Interference>,
    monitor: &dyn Monitor,
) -> Result<Vec<ClPoint>, Cancelled> {
    let clear = |a: &Touch, b: &Touch| keep.is_none_or(|keep| keep.on_move(&a.at, &b.at).is_none());
    if let Some(sampling) = smoothing
        && let Some(spread) =
            smooth_and_spread_tilted(pass, sampling, tolerance, &clear, &mut Watch::new(monitor))?
    {
        return Ok(spread.into_iter().map(|touch| touch.at).collect());
    }
    thinned(pass, tolerance, keep, monitor)
}

/// The locations that a pass needs to stay within `tolerance` of it, mm, and clear of what is to be kept away from, as far as
/// its own moves are. The pass runs on both sides of the moves where they are clear so, too.
pub(crate) fn thinned(
    pass: &[Touch],
    tolerance: f64,
    keep: Option<&Interference>,
    monitor: &dyn Monitor,
) -> Result<Vec<ClPoint>, Cancelled> {
    let clear = |a: &ClPoint, b: &ClPoint| keep.is_none_or(|keep| keep.on_move(a, b).is_none());
    let mut watch = Watch::new(monitor);
    let mut waiting = reduced_indices(pass, &|_| tolerance, &mut watch)?;
    waiting.reverse();
    let mut kept: Vec<usize> = waiting.pop().into_iter().collect();
    while let (Some(&from), Some(&to)) = (kept.last(), waiting.last()) {
        watch.step()?;
        if to - from < 2 || clear(&pass[from].at, &pass[to].at) {
            kept.push(to);
            waiting.pop();
        } else {
            waiting.push((from + to) / 2);
        }
    }
    let centres: Vec<Point3> = pass.iter().map(Touch::centre).collect();
    let aside = moved_aside(&centres, &kept, Side::Lesser, tolerance);
    let beside: Vec<ClPoint> = kept.iter().zip(aside).map(|(&k, p)| pass[k].around(p).at).collect();
    if beside.windows(2).all(|ends| clear(&ends[0], &ends[1])) {
        return Ok(beside);
    }
    Ok(kept.into_iter().map(|k| pass[k].at).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::moves::chord::Waypoint;
    use work::monitor::Silent;

    /// Around a cylinder of radius 10 along y.
    fn arc(s: f64) -> Option<(CcPoint, Vector3)> {
        let normal = Vector3::new(s.sin(), 0.0, s.cos());
        Some((CcPoint { point: Point3::from(normal * 10.0), normal }, Vector3::new(s.cos(), 0.0, -s.sin())))
    }

    #[test]
    fn moves_around_a_cylinder_stay_within_the_tolerance_and_no_more() {
        for (cutter, lead) in [(Cutter::ball(6.0).unwrap(), 0.2), (Cutter::bull(6.0, 1.0).unwrap(), 0.1)] {
            let rule = ToolAxis::LeadTilt { lead, tilt: 0.05 };
            let touches = along(&arc, [0.0, 1.5], &cutter, &rule, 1e-3, &Silent).unwrap();
            let kept = thinned(&touches, 6e-4, None, &Silent).unwrap();
            assert!(kept.len() < 90 && kept.len() * 2 < touches.len(), "{} of {}", kept.len(), touches.len());
            // The circle of the arc's centres comes as near to the cylinder as the arc's radius.
            let profile = *cutter.profile();
            for w in kept.windows(2) {
                for k in 0..=10 {
                    let at = w[0].towards(&w[1], f64::from(k) / 10.0);
                    let e = at.axis.cross(&Vector3::y()).normalize();
                    let radial = |turn: f64| {
                        let aside = (e * turn.cos() + at.axis.cross(&e) * turn.sin()) * profile.centre_x;
                        let centre = at.tip + at.axis * profile.centre_z + aside;
                        centre.x.hypot(centre.z)
                    };
                    let turns = (0..1000).map(|n| radial(f64::from(n) * std::f64::consts::TAU / 1000.0));
                    let lowest = turns.fold(f64::INFINITY, f64::min) - profile.corner;
                    assert!((lowest - 10.0).abs() < 1.1e-3, "{lowest}");
                }
            }
        }
    }

    #[test]
    fn the_sense_of_the_tangent_does_not_matter_and_reversing_leans_the_other_way() {
        let (cutter, rule) = (Cutter::ball(6.0).unwrap(), ToolAxis::LeadTilt { lead: 0.2, tilt: 0.0 });
        let back = |s: f64| arc(s).map(|(contact, t)| (contact, -t));
        let one = along(&arc, [0.0, 1.0], &cutter, &rule, 1e-2, &Silent).unwrap();
        let other = along(&back, [0.0, 1.0], &cutter, &rule, 1e-2, &Silent).unwrap();
        assert_eq!(one, other);
        let reversed = reversed(&one, &cutter, &rule).unwrap();
        let (n, first) = (one.last().unwrap().contact.normal, reversed[0]);
        assert!((first.at.axis.dot(&n) - 0.2f64.cos()).abs() < 1e-12);
        assert!(
            first.at.axis.dot(&first.feed) > 0.19 && one.last().unwrap().at.axis.dot(&first.feed) < -0.19
        );
    }

    #[test]
    fn sudden_turns_are_spread() {
        let cutter = Cutter::ball(6.0).unwrap();
        let touch = |k: i32| {
            let axis = Vector3::new(if k < 50 { 0.3 } else { -0.3 }, 0.0, 1.0).normalize();
            let contact = CcPoint { point: Point3::new(0.1 * f64::from(k), 0.0, 0.0), normal: Vector3::z() };
            Touch::along(axis, &cutter, contact, Vector3::x())
        };
        let mut pass: Vec<Touch> = (0..100).map(touch).collect();
        assert!(limit_turning(&mut pass, &cutter, 0.2));
        for w in pass.windows(2) {
            assert!((w[1].at.axis - w[0].at.axis).norm() <= 0.2 * 0.1 * 1.001);
        }
        assert_eq!(pass[0], touch(0), "far from the turn nothing changes");
        assert!(
            pass.iter()
                .all(|t| (t.at.tip + t.at.axis * 3.0 - t.contact.point - Vector3::z() * 3.0).norm() < 1e-12)
        );
    }

    #[test]
    fn smoothed_passes_need_fewer_moves_and_hold_the_tolerance() {
        for (cutter, tilt) in [(Cutter::ball(6.0).unwrap(), 0.0), (Cutter::bull(6.0, 1.0).unwrap(), 0.05)] {
            let rule = ToolAxis::LeadTilt { lead: 0.2, tilt };
            let touches = along(&arc, [0.0, 1.5], &cutter, &rule, 1e-3, &Silent).unwrap();
            let plain = located(&touches, 6e-4, None, None, &Silent).unwrap();
            let spread = located(&touches, 6e-4, Some(0.45), None, &Silent).unwrap();
            assert!(spread.len() * 5 < plain.len() * 4, "{} of {}", spread.len(), plain.len());
            assert_eq!((spread.first(), spread.last()), (plain.first(), plain.last()));
            let ends: Vec<Touch> = spread.iter().map(|at| touches[0].located(*at)).collect();
            for touch in &touches {
                let stray = ends.windows(2).map(|w| touch.stray(&w[0], &w[1])).fold(f64::INFINITY, f64::min);
                assert!(stray <= 6e-4 * (1.0 + 1e-9), "{stray}");
            }
        }
    }
}
