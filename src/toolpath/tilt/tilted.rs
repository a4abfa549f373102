//! Passes of a cutter whose axis tilts: sampled where it touches, located, smoothed and thinned.
//!
//! Enters: contacts along a curve with the feed there, and a rule for the axis. Leaves: cutter locations
//! between which the cutter strays from the exact path by no more than the chord tolerance, mm. Between two
//! locations the tip runs straight and the axis turns evenly. What cuts is the cutter's arc, so its strays
//! count: that of the arc's centre height on the axis, and the turn of the axis times the distance of the arc
//! from it, which is none for a ball.
//!
//! Contacts are kept until the passes are ordered: a lead leans the other way on a pass that is cut
//! backwards.
//!
//! Where cutters are dropped, a ball is tilted around its centre, so that every strategy serves five axes.
//! For other cutters a ball as large as their corner is dropped and gives contact and normal; its normal
//! turns over an edge as the ball rolls. Beside the border of a mesh its plane goes on, because a flat rolled
//! over an edge would lean out.

use super::turning::LOST;
use crate::moves::chord::{Side, Watch, moved_aside, reduced_indices, sample_within_chord};
use crate::moves::smooth::smooth_and_spread_tilted;
use crate::moves::touch::Touch;
use crate::surface::border::Border;
use crate::vocabulary::{PlanError, Setup};
use collision::Interference;
use cutter::Cutter;
use geometry::{Point3, Vector3, angle_between};
use motion::{AxisError, CcPoint, ClPoint, ToolAxis};
use part::Part;
use std::ops::Range;
use work::monitor::{Cancelled, Monitor};

/// Share of the chord tolerance that samples may stray, and that leaving samples out may add to that. A pass
/// around the centres of upright moves has half of the tolerance behind it.
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

    /// Adds others; the lesser tolerance holds.
    pub fn append(&mut self, other: Self) {
        self.passes.extend(other.passes);
        self.tolerance = self.tolerance.min(other.tolerance);
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

/// The radius of a probe is that of the cutter's corner, but no less than this share of its own: where facets
/// meet, the normal turns over an arc of that radius; what is more hollow it does not reach into.
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
    /// Where the ball touches while its centre is there. Beside the part's border the plane goes on on which
    /// the border lies, for all but a ball that cuts itself.
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

/// A cutter tilted where a ball that was dropped upright touches: around its centre, if it is that ball
/// itself.
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

/// What the moves of a pass must hold besides its tolerance.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct MoveRules<'a> {
    /// What the tool keeps away from.
    pub keep: Option<&'a Interference<'a>>,
    /// The axis turns by no more than this, rad a mm of contact.
    pub turning: Option<f64>,
    /// On the way it is no farther off the axes of the pass than this, rad.
    pub straying: Option<f64>,
}

impl MoveRules<'_> {
    /// Whether the move from one touch of a pass to another holds; `passed` are those from the first to the
    /// second.
    fn hold(&self, passed: &[Touch], a: &Touch, b: &Touch) -> bool {
        let way = b.contact.point - a.contact.point;
        let slow = |rate: f64| angle_between(&a.at.axis, &b.at.axis) <= rate * (way.norm() - LOST).max(0.0);
        let near = |most: f64| {
            passed.iter().all(|touch| {
                let t = (touch.contact.point - a.contact.point).dot(&way)
                    / way.norm_squared().max(f64::MIN_POSITIVE);
                angle_between(&touch.at.axis, &a.at.towards(&b.at, t.clamp(0.0, 1.0)).axis) <= most
            })
        };
        self.turning.is_none_or(slow) && self.straying.is_none_or(near) && self.clear(a, b)
    }

    fn clear(&self, a: &Touch, b: &Touch) -> bool {
        self.keep.is_none_or(|keep| keep.on_move(&a.at, &b.at).is_none())
    }
}

/// The locations that a pass needs to stay within `tolerance` of it, mm, and to hold the rules, as far as its
/// own moves do; smoothed and spread by `smoothing`, mm, where that is asked for and holds them too.
pub(crate) fn located(
    pass: &[Touch],
    tolerance: f64,
    smoothing: Option<f64>,
    rules: MoveRules<'_>,
    monitor: &dyn Monitor,
) -> Result<Vec<ClPoint>, Cancelled> {
    let hold = |passed: Range<usize>, a: &Touch, b: &Touch| rules.hold(&pass[passed], a, b);
    if let Some(sampling) = smoothing
        && let Some(spread) =
            smooth_and_spread_tilted(pass, sampling, tolerance, &hold, &mut Watch::new(monitor))?
    {
        return Ok(spread.into_iter().map(|touch| touch.at).collect());
    }
    thinned(pass, tolerance, rules, monitor)
}

/// The locations that a pass needs to stay within `tolerance` of it, mm, and to hold the rules, as far as its
/// own moves do. The pass runs on both sides of the moves where they are clear so, too.
pub(crate) fn thinned(
    pass: &[Touch],
    tolerance: f64,
    rules: MoveRules<'_>,
    monitor: &dyn Monitor,
) -> Result<Vec<ClPoint>, Cancelled> {
    let mut watch = Watch::new(monitor);
    let mut waiting = reduced_indices(pass, tolerance, &mut watch)?;
    waiting.reverse();
    let mut kept: Vec<usize> = waiting.pop().into_iter().collect();
    while let (Some(&from), Some(&to)) = (kept.last(), waiting.last()) {
        watch.step()?;
        if to - from < 2 || rules.hold(&pass[from..=to], &pass[from], &pass[to]) {
            kept.push(to);
            waiting.pop();
        } else {
            waiting.push((from + to) / 2);
        }
    }
    let centres: Vec<Point3> = pass.iter().map(Touch::centre).collect();
    let aside = moved_aside(&centres, &kept, Side::Lesser, tolerance);
    let beside: Vec<Touch> = kept.iter().zip(aside).map(|(&k, p)| pass[k].around(p)).collect();
    if beside.windows(2).all(|ends| rules.clear(&ends[0], &ends[1])) {
        return Ok(beside.iter().map(|touch| touch.at).collect());
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
            let kept = thinned(&touches, 6e-4, MoveRules::default(), &Silent).unwrap();
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
    fn smoothed_passes_need_fewer_moves_and_hold_the_tolerance() {
        for (cutter, tilt) in [(Cutter::ball(6.0).unwrap(), 0.0), (Cutter::bull(6.0, 1.0).unwrap(), 0.05)] {
            let rule = ToolAxis::LeadTilt { lead: 0.2, tilt };
            let touches = along(&arc, [0.0, 1.5], &cutter, &rule, 1e-3, &Silent).unwrap();
            let plain = located(&touches, 6e-4, None, MoveRules::default(), &Silent).unwrap();
            let spread = located(&touches, 6e-4, Some(0.45), MoveRules::default(), &Silent).unwrap();
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
