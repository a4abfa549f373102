//! The feeds of the program and the time that it takes, within what the scene and its machine allow.

use machine::{Machine, at_most};
use motion::{Move, MoveKind, Toolpath};
use report::{Claim, Gravity, duration};
use scene::CuttingData;
use toolpath::LEAST_SHARE;
use work::monitor::Monitor;

use crate::JobError;
use crate::run::{Finding, Run};

/// Rounding of a feed over the feed.
const ROUNDING: f64 = 1e-9;

/// Of every toolpath.
pub(super) fn find(run: &Run<'_>, _: &dyn Monitor) -> Result<Finding, JobError> {
    let (scene, path, cutting) = (run.scene(), run.path(), &run.tooling().cutting);
    // The feeds of a program from elsewhere are its own, as far as the machine can run them.
    if let Some(read) = run.request.foreign() {
        let place = |line: u32| format!("in line {line} of {}", path.program_name());
        let highest = read.highest_feed.map(|(feed, line)| (feed, place(line)));
        let claim = no_faster_than_rapids(highest, scene.machine.rapid_rate);
        return Ok(Finding { claims: vec![claim], ..Finding::default() });
    }
    let line = |k: usize| format!("at move {k}{}", run.program_line(k as u32));
    let mut claims = vec![
        fast_enough(path, cutting, &scene.machine, &line),
        no_faster(path, cutting, &scene.machine, &line),
        down_no_faster(path, cutting.plunge_rate, &line),
    ];
    let longest = longest(path, cutting, &scene.machine) + run.planned.joint_time(scene);
    claims.push(in_time(run.machining_time_s, longest));
    Ok(Finding { claims, ..Finding::default() })
}

/// No sane program feeds slower than this, mm/min: the lowest of the scene's feeds and of what the machine
/// creeps at around corners, reduced as far as load reduces any.
fn least(cutting: &CuttingData, machine: &Machine) -> f64 {
    LEAST_SHARE * cutting.feed_rate.min(cutting.plunge_rate).min(machine.creep_feed())
}

/// Feeds of the moves that have one, mm/min; no number is none.
fn feeds(path: &Toolpath) -> impl Iterator<Item = (usize, f64)> {
    let fed = |m: &&Move| m.kind != MoveKind::Rapid;
    let of = |m: &Move| if m.feed_rate.is_nan() { 0.0 } else { m.feed_rate };
    path.moves.iter().enumerate().filter(move |(_, m)| fed(m)).map(move |(k, m)| (k, of(m)))
}

fn feed(limit: f64, measured: f64, text: String) -> Claim {
    Claim { unit: "mm_min", ..Claim::length("feed", Gravity::Crash, limit, measured, 0.0) }.told(text)
}

/// That no move stands still or rubs: how far the lowest feed lies below a sane one.
fn fast_enough(
    path: &Toolpath,
    cutting: &CuttingData,
    machine: &Machine,
    line: &dyn Fn(usize) -> String,
) -> Claim {
    let least = least(cutting, machine);
    let Some((k, slowest)) = feeds(path).min_by(|a, b| a.1.total_cmp(&b.1)) else {
        return feed(0.0, 0.0, "no move has a feed".into());
    };
    let text = format!(
        "the lowest feed is {slowest:.4} mm/min {} (no less than {least:.1}: a control stops there, or the cutter rubs)",
        line(k)
    );
    feed(0.0, least * (1.0 - ROUNDING) - slowest, text)
}

/// That no move is fed faster than the scene asks for, or than the machine can go.
fn no_faster(
    path: &Toolpath,
    cutting: &CuttingData,
    machine: &Machine,
    line: &dyn Fn(usize) -> String,
) -> Claim {
    let limit = cutting.feed_rate.max(cutting.plunge_rate).min(machine.rapid_rate);
    let Some((k, fastest)) = feeds(path).max_by(|a, b| a.1.total_cmp(&b.1)) else {
        return feed(limit, 0.0, "no move has a feed".into());
    };
    let text = format!("the highest feed is {fastest:.1} mm/min {} (limit {limit:.1})", line(k));
    feed(limit, rounded(fastest, limit), text)
}

/// That a program from elsewhere, whose highest feed, mm/min, and its place are given, feeds no faster than
/// the machine goes at rapid.
fn no_faster_than_rapids(highest: Option<(f64, String)>, limit: f64) -> Claim {
    let Some((fastest, place)) = highest else { return feed(limit, 0.0, "no move has a feed".into()) };
    let text = format!(
        "the highest feed is {fastest:.1} mm/min {place} (limit {limit:.1}, the machine's rapid rate, at which it is held)"
    );
    Claim { gravity: Gravity::Finish, ..feed(limit, rounded(fastest, limit), text) }
}

/// That moves between passes, those on the surface aside, go down along the tool axis no faster than the
/// plunge rate.
fn down_no_faster(path: &Toolpath, limit: f64, line: &dyn Fn(usize) -> String) -> Claim {
    let down = |(k, (a, b, m)): (usize, (geometry::Point3, geometry::Point3, &Move))| {
        let way = b - a;
        let share = (-way.dot(&m.to.axis) / way.norm().max(f64::MIN_POSITIVE)).max(0.0);
        (matches!(m.kind, MoveKind::Plunge | MoveKind::Retract) && share > 0.0)
            .then_some((k, share * m.feed_rate))
    };
    let fastest = path.segments().enumerate().filter_map(down).max_by(|a, b| a.1.total_cmp(&b.1));
    let (measured, text) = match fastest {
        Some((k, fastest)) => (
            rounded(fastest, limit),
            format!("the cutter plunges at up to {fastest:.1} mm/min {} (limit {limit:.1})", line(k)),
        ),
        None => (0.0, "the cutter never plunges".to_owned()),
    };
    feed(limit, measured, text)
}

/// A feed that exceeds its limit by rounding only is the limit.
fn rounded(feed: f64, limit: f64) -> f64 {
    if feed <= limit * (1.0 + ROUNDING) { feed.min(limit) } else { feed }
}

/// Time, s, for the path at the lowest sane feeds, stopping after each move.
fn longest(path: &Toolpath, cutting: &CuttingData, machine: &Machine) -> f64 {
    let least = least(cutting, machine);
    let fastest = cutting.feed_rate.max(cutting.plunge_rate).max(machine.rapid_rate);
    at_most(path, machine, [least, fastest])
}

/// That the machining time is a finite one which feeds and lengths explain.
fn in_time(time: f64, longest: f64) -> Claim {
    let text = if time.is_finite() {
        format!(
            "the machining time is {} (no more than {} at the lowest sane feeds)",
            duration(time),
            duration(longest)
        )
    } else {
        "the machining time is not finite".to_owned()
    };
    let claim = Claim::length("time", Gravity::Finish, longest, time, 0.0);
    Claim { unit: "s", ..claim }.told(text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::Point3;
    use motion::ClPoint;
    use report::Verdict;
    use work::monitor::Silent;

    const CUTTING: CuttingData = CuttingData { spindle_speed: 12e3, feed_rate: 1000.0, plunge_rate: 300.0 };

    fn path(feeds: &[(MoveKind, f64)]) -> Toolpath {
        let to = |k: usize| ClPoint::upright(Point3::new(k as f64, 0.0, -(k as f64)));
        let moves = feeds.iter().enumerate();
        let moves = moves.map(|(k, &(kind, feed_rate))| Move { to: to(k + 1), kind, feed_rate, pass: 0 });
        Toolpath::new(to(0), moves.collect())
    }

    fn verdicts(moves: &[(MoveKind, f64)], machine: &Machine) -> [Verdict; 4] {
        let path = path(moves);
        let line = |k: usize| format!("at move {k}");
        let time = machine::machining_time(&path, machine, &Silent).unwrap();
        [
            fast_enough(&path, &CUTTING, machine, &line),
            no_faster(&path, &CUTTING, machine, &line),
            down_no_faster(&path, CUTTING.plunge_rate, &line),
            in_time(time, longest(&path, &CUTTING, machine)),
        ]
        .map(|claim| claim.verdict())
    }

    #[test]
    fn programs_from_elsewhere_feed_no_faster_than_the_machine() {
        let verdict = |feed: f64| no_faster_than_rapids(Some((feed, "in line 4 of a.nc".into())), 2000.0);
        assert_eq!([2000.0, 12e3].map(|feed| verdict(feed).verdict()), [Verdict::Pass, Verdict::Fail]);
        assert!(
            verdict(12e3)
                .text
                .starts_with("the highest feed is 12000.0 mm/min in line 4 of a.nc (limit 2000.0,")
        );
        assert_eq!(no_faster_than_rapids(None, 2000.0).verdict(), Verdict::Pass);
    }

    #[test]
    fn feeds_are_held_against_scene_and_machine() {
        use MoveKind::{Cut, Plunge, Rapid, Retract};
        use Verdict::{Fail, Pass};
        let machine = Machine::default();
        let down = 300.0 * 2f64.sqrt();
        let sane = [(Rapid, 0.0), (Plunge, down), (Cut, 1000.0), (Cut, 300.0)];
        assert_eq!(verdicts(&sane, &machine), [Pass; 4]);
        assert_eq!(verdicts(&[(Cut, 1000.0), (Cut, 1e-9)], &machine), [Fail, Pass, Pass, Fail]);
        assert_eq!(verdicts(&[(Cut, 0.0)], &machine), [Fail, Pass, Pass, Fail]);
        assert_eq!(verdicts(&[(Cut, f64::NAN)], &machine), [Fail, Pass, Pass, Fail]);
        assert_eq!(verdicts(&[(Cut, 1001.0)], &machine), [Pass, Fail, Pass, Pass]);
        assert_eq!(verdicts(&[(Plunge, 1.01 * down)], &machine), [Pass, Pass, Fail, Pass]);
        assert_eq!(verdicts(&[(Retract, 1.01 * down)], &machine), [Pass, Pass, Fail, Pass]);
        // The scene's feed is faster than the machine.
        let slow = Machine { rapid_rate: 500.0, ..machine };
        assert_eq!(verdicts(&sane, &slow)[1], Fail);
        assert_eq!(verdicts(&[], &machine), [Pass; 4]);
    }
}
