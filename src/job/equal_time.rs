//! Planning for a machining time: the scallop height whose plan takes it, links and all.
//!
//! A path is about as long as its passes are many, and they are so many as the inverse root of the scallop
//! height: the density. Time grows with the density and has a part that does not. So the search goes by the
//! secant of time over density, and between two plans that lie to both sides of the time by their chord.
//! Whole passes come and go by steps: where two neighbouring densities lie to both sides of it, no plan is
//! nearer.

use serde::Serialize;

use motion::ROUNDING;
use scene::{EqualTime, ToolpathRequest};
use toolpath::Step;
use work::monitor::Monitor;

use super::planned::Planned;
use super::tool::Around;
use super::{JobError, Session};

/// A plan whose time is off by no more than this share takes the time that was asked for.
pub(crate) const WITHIN: f64 = 0.01;

/// Most plans: each costs as much as planning the toolpath.
const MOST_PLANS: usize = 12;

/// No density is more than so many times the one before: far from it the secant tells little.
const MOST_STRETCH: f64 = 4.0;

/// Densities that differ by a smaller share have the same passes, or one more.
const CLOSEST: f64 = 1e-3;

/// The next density keeps this share of the interval away from both of its ends, so that the interval
/// shrinks.
const INSIDE: f64 = 0.1;

/// The highest scallop, as a share of the cutter's corner radius: passes that leave higher ones hardly touch
/// each other.
const HIGHEST: f64 = 0.25;

/// The lowest scallop, mm: programs write places no closer, so that passes for lower ones leave no lower ones.
const LOWEST: f64 = ROUNDING;

/// A plan of the search.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct TriedPlan {
    /// The scallop height that it was made for, mm.
    pub scallop_mm: f64,
    /// The time that it takes, s.
    pub machining_time_s: f64,
}

impl TriedPlan {
    fn density(&self) -> f64 {
        self.scallop_mm.sqrt().recip()
    }
}

/// What the search found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct EqualTimeFigures {
    /// The toolpath's name without the time.
    pub of: String,
    /// The time that was asked for, s.
    pub asked_s: f64,
    /// The time of the plan that was kept, over that.
    pub taken_over_asked: f64,
    /// The scallop height that it was planned for, mm.
    pub scallop_mm: f64,
    /// All plans, in order.
    pub plans: Vec<TriedPlan>,
}

impl EqualTimeFigures {
    /// Whether the plan takes the time that was asked for.
    pub fn is_met(&self) -> bool {
        (self.taken_over_asked - 1.0).abs() <= WITHIN
    }
}

impl Session {
    /// The plan whose machining time is nearest to the one asked for, and the request that makes it.
    pub(crate) fn plan_for_time(
        &self,
        request: &ToolpathRequest,
        time: &EqualTime,
        around: Around<'_>,
        monitor: &dyn Monitor,
    ) -> Result<(ToolpathRequest, Planned), JobError> {
        let (scene, cutter) = (&self.scene, &request.tooling.cutter);
        let at = |scallop| ToolpathRequest { step: Step::Scallop(scallop), ..request.clone() };
        let corner = cutter.corner_radius();
        let highest = HIGHEST * if corner > 0.0 { corner } else { cutter.radius() };
        let asked_s = 60.0 * time.minutes;
        let mut plan = |scallop: f64| {
            let planned = self.plan(&at(scallop), around, monitor)?;
            let time = planned.time(scene, monitor)?;
            Ok::<_, JobError>((planned, time))
        };
        let lowest = LOWEST.min(scene.tolerance.scallop);
        let (mut planned, kept, plans) =
            nearest(scene.tolerance.scallop, [lowest, highest], asked_s, &mut plan)?;
        let TriedPlan { scallop_mm, machining_time_s } = kept;
        let figures = EqualTimeFigures {
            of: time.of.clone(),
            asked_s,
            taken_over_asked: machining_time_s / asked_s,
            scallop_mm,
            plans,
        };
        // Of heights that all take as long the first one is kept.
        let tried = |is_end: &dyn Fn(f64) -> bool| figures.plans.iter().any(|tried| is_end(tried.scallop_mm));
        let (of, name) = (scene.source.name.clone(), request.name.clone());
        let (asked, minutes) = (time.minutes, machining_time_s / 60.0);
        if !figures.is_met() && machining_time_s > asked_s && tried(&|scallop| scallop >= highest) {
            let least = (100.0 * minutes).ceil() / 100.0;
            return Err(JobError::TooLittleTime { scene: of, name, least, highest, asked });
        }
        if !figures.is_met() && machining_time_s < asked_s && tried(&|scallop| scallop <= lowest) {
            let most = (100.0 * minutes).floor() / 100.0;
            return Err(JobError::TooMuchTime { scene: of, name, most, lowest, asked });
        }
        planned.equal_time = Some(figures);
        Ok((at(scallop_mm), planned))
    }
}

/// The plan that is nearest to the time asked for, s, as it was tried, and all that were: by heights from
/// `first` on, none below `lowest` or above `highest`, mm.
fn nearest<P, E>(
    first: f64,
    [lowest, highest]: [f64; 2],
    asked_s: f64,
    plan: &mut dyn FnMut(f64) -> Result<(P, f64), E>,
) -> Result<(P, TriedPlan, Vec<TriedPlan>), E> {
    let off = |tried: &TriedPlan| (tried.machining_time_s - asked_s).abs();
    let mut scallop_mm = first.min(highest);
    let [most, least] = [lowest, highest].map(|height| height.sqrt().recip());
    let (planned, machining_time_s) = plan(scallop_mm)?;
    let mut kept = TriedPlan { scallop_mm, machining_time_s };
    let (mut best, mut plans) = (planned, vec![kept]);
    while off(&kept) > WITHIN * asked_s
        && plans.len() < MOST_PLANS
        && let Some(density) = next(&plans, asked_s, [least, most])
    {
        scallop_mm = match density {
            density if density <= least => highest,
            density if density >= most => lowest,
            density => density.powi(-2),
        };
        let (planned, machining_time_s) = plan(scallop_mm)?;
        let tried = TriedPlan { scallop_mm, machining_time_s };
        plans.push(tried);
        if off(&tried) < off(&kept) {
            (best, kept) = (planned, tried);
        }
    }
    Ok((best, kept, plans))
}

/// The density to try next, not below `least` or above `most`; `None` where none is likely to be nearer.
fn next(plans: &[TriedPlan], asked_s: f64, [least, most]: [f64; 2]) -> Option<f64> {
    let by_density = |a: &&TriedPlan, b: &&TriedPlan| a.density().total_cmp(&b.density());
    let quick = plans.iter().filter(|tried| tried.machining_time_s < asked_s).max_by(by_density);
    let slow = plans.iter().filter(|tried| tried.machining_time_s >= asked_s).min_by(by_density);
    if let (Some(quick), Some(slow)) = (quick, slow) {
        let (from, to) = (quick.density(), slow.density());
        if (to / from - 1.0).abs() < CLOSEST {
            return None;
        }
        let chord = (asked_s - quick.machining_time_s) / (slow.machining_time_s - quick.machining_time_s);
        // A time that jumps keeps one end of the interval for ever; halves do not.
        let share = if plans.len().is_multiple_of(3) { 0.5 } else { chord.clamp(INSIDE, 1.0 - INSIDE) };
        return Some(from + share * (to - from));
    }
    let last = plans.last()?;
    let proportional = last.density() * asked_s / last.machining_time_s.max(f64::MIN_POSITIVE);
    let secant = plans.len().checked_sub(2).and_then(|k| {
        let before = &plans[k];
        let slope = (last.machining_time_s - before.machining_time_s) / (last.density() - before.density());
        (slope > 0.0 && slope.is_finite()).then(|| last.density() + (asked_s - last.machining_time_s) / slope)
    });
    let wanted = secant.unwrap_or(proportional);
    let bounded = wanted.clamp(last.density() / MOST_STRETCH, last.density() * MOST_STRETCH);
    let bounded = bounded.min(most).max(least);
    ((bounded / last.density() - 1.0).abs() > f64::EPSILON).then_some(bounded)
}

#[cfg(test)]
mod tests {
    use super::*;
    use scene::Scene;
    use work::monitor::Silent;

    /// The search over a time that is known for each density.
    fn search(asked: f64, time: impl Fn(f64) -> f64) -> (TriedPlan, usize) {
        let mut plan = |scallop: f64| Ok::<_, ()>((scallop, time(scallop.sqrt().recip())));
        let (best, kept, plans) = nearest(0.01, [LOWEST, 0.75], asked, &mut plan).unwrap();
        assert_eq!(best, kept.scallop_mm);
        (kept, plans.len())
    }

    #[test]
    fn times_with_a_fixed_part_are_met_in_a_few_plans() {
        for fixed in [0.0, 5.0, 40.0] {
            for asked in [60.0, 100.0, 150.0, 700.0] {
                let (kept, plans) = search(asked, |density| fixed + 10.0 * density);
                let off = (kept.machining_time_s / asked - 1.0).abs();
                assert!(off <= WITHIN && plans <= 5, "{fixed} {asked}: {off} after {plans}");
            }
        }
    }

    /// Nine passes of eleven seconds or ten.
    #[test]
    fn whole_passes_leave_the_nearest_plan() {
        let (kept, plans) = search(105.0, |density| 11.0 * density.floor());
        assert!([99.0, 110.0].contains(&kept.machining_time_s) && plans <= MOST_PLANS, "{kept:?} {plans}");
        assert_eq!(search(103.0, |density| 11.0 * density.floor()).0.machining_time_s, 99.0);
        // Times that do not rise with the density end as well.
        assert!(search(100.0, |density| 120.0 + (17.0 * density).sin()).1 <= MOST_PLANS);
    }

    #[test]
    fn passes_are_never_wider_than_the_highest_scallop_has_them() {
        let (kept, _) = search(1.0, |density| 50.0 + density);
        assert_eq!(kept.scallop_mm, 0.75);
        let (kept, plans) = search(1e7, |density| 50.0 + density);
        assert!(kept.scallop_mm == LOWEST && plans <= 4, "{kept:?} {plans}");
    }

    fn session(minutes: &str, toolpaths: &str) -> Session {
        let text = format!(
            "[part]\nsurface = \"wave\"\namplitude = 0.5\nwavelength_x = 12\nx = [0, 30]\ny = [0, 30]\n[cutter]\nshape = \"ball\"\n\
             diameter = 6\n[tolerance]\nscallop = 0.02\nchord = 0.005\n[compare]\nminutes = {minutes}\n{toolpaths}"
        );
        Session::new(Scene::parse("wave.toml", text).unwrap()).unwrap()
    }

    /// Links included: the time of the report, and heights from the measured cut.
    #[test]
    fn strategies_are_planned_for_equal_times_and_measured() {
        let strategies = "[[toolpath]]\nstrategy = \"zigzag\"\n[[toolpath]]\nstrategy = \"iso-scallop\"\n";
        let session = session("[1.2, 1.6]", strategies);
        let report = session.run(&Silent).unwrap();
        let rows: Vec<_> = report.measured().collect();
        let names: Vec<&str> = rows.iter().map(|row| row.name.as_str()).collect();
        assert_eq!(
            names,
            ["zigzag, 1.2 min", "zigzag, 1.6 min", "iso-scallop, 1.2 min", "iso-scallop, 1.6 min"]
        );
        for (row, asked) in rows.iter().zip([72.0, 96.0, 72.0, 96.0]) {
            let off = row.path.machining_time_s / asked - 1.0;
            let figure = row.figures.iter().find(|figure| figure.key == "equal_time").unwrap();
            let tried = figure.value["plans"].as_array().unwrap().iter();
            let tried: Vec<f64> =
                tried.map(|plan| plan["machining_time_s"].as_f64().unwrap() / asked - 1.0).collect();
            assert!(tried.iter().all(|other| other.abs() >= off.abs()), "{}: {off} {tried:?}", row.name);
            // Where no whole number of passes comes nearer, both of its neighbours were tried.
            let [less, more] = [-1.0, 1.0].map(|side| {
                tried.iter().map(|off| side * off).filter(|off| *off >= 0.0).fold(f64::INFINITY, f64::min)
            });
            let one_pass = 1.1 / row.path.passes as f64;
            assert!(off.abs() <= WITHIN || less + more <= one_pass, "{}: {tried:?}", row.name);
            let planned_for = figure.value["scallop_mm"].as_f64().unwrap();
            let (p95, highest) = (row.scallop.p95_mm.unwrap(), row.scallop.max_mm.unwrap());
            assert!(p95 <= highest && highest < 1.2 * planned_for, "{}: {highest} {planned_for}", row.name);
            assert!(highest > 0.5 * planned_for, "{}: {highest} {planned_for}", row.name);
        }
        // More time, lower ridges.
        for pair in rows.chunks(2) {
            assert!(pair[1].scallop.p95_mm < pair[0].scallop.p95_mm);
        }
    }

    #[test]
    fn a_time_that_no_plan_can_keep_is_a_row_with_its_reason() {
        let session = session("0.01", "[[toolpath]]\nstrategy = \"zigzag\"\n");
        let error = session.run(&Silent).map(|report| report.verdict).unwrap_err();
        let help = miette::Diagnostic::help(&error).unwrap().to_string();
        assert!(help.starts_with("write `minutes = ") && help.ends_with("or more in [compare]"), "{help}");
        assert!(error.why_not_planned().unwrap().contains("larger `minutes`"));
        let refused = error.to_string();
        assert!(refused.contains("minutes or more") && refused.contains("0.01 were asked for"), "{refused}");
    }

    /// Passes for the lowest ridges that a program can tell apart are 35 µm apart: 87 of 4 mm.
    #[test]
    fn a_time_that_no_plan_can_need_is_a_row_with_its_reason() {
        let text = "[part]\nsurface = \"plane\"\nx = [0, 4]\ny = [0, 3]\n[cutter]\nshape = \"ball\"\ndiameter = 6\n\
                    [compare]\nminutes = 1e5\n[[toolpath]]\nstrategy = \"zigzag\"\n";
        let session = Session::new(Scene::parse("plate.toml", text.to_owned()).unwrap()).unwrap();
        let error = session.run(&Silent).map(|report| report.verdict).unwrap_err();
        let JobError::TooMuchTime { most, lowest, asked, .. } = &error else { panic!("{error}") };
        assert!(*lowest == 5e-5 && *asked == 1e5 && (0.3..3.0).contains(most), "{error}");
        let help = miette::Diagnostic::help(&error).unwrap().to_string();
        assert!(help.ends_with("or less in [compare]"), "{help}");
        assert!(error.why_not_planned().unwrap().contains("smaller `minutes`"));
    }
}
