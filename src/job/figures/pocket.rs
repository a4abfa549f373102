//! Walls and engagement of a pocket.

use std::collections::BTreeMap;

use metrology::{EngagementFigures, ExceedingStretch, Judged, PocketFigures, StockBefore, View};
use motion::{MoveKind, Toolpath};
use report::{Claim, Figure, FigureTable, Gravity, WALL, beside_limit, micrometres, with_bound};
use toolpath::{Pocket, PocketStrategy};
use work::monitor::Monitor;

use super::words::value;
use crate::JobError;
use crate::pocket::{OutOfReach, engagement_figures, out_of_reach, pocket_figures};
use crate::run::{Finding, Run};

pub(super) fn find(run: &Run<'_>, monitor: &dyn Monitor) -> Result<Finding, JobError> {
    let (Some(pocket), View::Heights(cut)) = (&run.session.pocket, run.view()) else {
        return Ok(Finding::default());
    };
    let path = run.path();
    let mut p = pocket_figures(run.session, pocket, path, run.tools, cut, monitor)?;
    let mut claims = vec![within_walls(run, &p), cut_to_walls(run, &p)];
    if run.scene().judged == Judged::All {
        let all = (&*run.whole.path, &run.whole.cutters);
        claims.push(cut_everywhere(run, &out_of_reach(run.session, pocket, all, cut, monitor)?));
    }
    let strategy = run.request.strategy.downcast_ref::<PocketStrategy>();
    if let (Some(strategy), Some(engaged)) = (strategy, &run.planned.engaged) {
        let (step, radius) = (run.request.step, run.tooling().cutter.radius());
        let thinly = run.planned.engaged_thinly.as_ref();
        let engagement = engagement_figures(strategy, step, path, radius, engaged, thinly);
        p.stepover_mm = Some(strategy.stepover(step, radius));
        claims.push(ramps(run, pocket, strategy));
        claims.extend(strategy.engagement.map(|limit| engaged_within(run, &engagement, limit.to_degrees())));
        claims.extend(strategy.stepdown.map(|limit| steps_down(path, run.session.top(), limit)));
        p.engagement = Some(engagement);
    }
    let figure = Figure {
        key: "pocket",
        value: value(&p)?,
        rows: rows(&p),
        table: p.engagement.as_ref().and_then(exceeding),
        ..Figure::default()
    };
    Ok(Finding { figure: Some(figure), claims, ..Finding::default() })
}

fn rows(p: &PocketFigures) -> Vec<(&'static str, String)> {
    let stepover = p.stepover_mm.map(|stepover| ("stepover", format!("{stepover:.3} mm")));
    let of_walls = [
        (
            "cut beyond the walls",
            format!("{} µm", with_bound(Some(p.wall_gouge_mm), Some(p.wall_gouge_error_bound_mm))),
        ),
        ("left on the walls", format!("{} µm", thickness(p))),
        ("out of reach of the cutter", format!("{:.3} mm²", p.unreachable_area_mm2)),
    ];
    let engaged = p.engagement.as_ref().map(|engaged| engagement_rows(engaged));
    let [engaged, thinly] = engaged.unwrap_or_default();
    stepover.into_iter().chain(engaged).chain(of_walls).chain(thinly).collect()
}

/// How thick material stands on the walls, µm.
fn thickness(p: &PocketFigures) -> String {
    let thickness = Some(p.wall_uncut_mm);
    match p.wall_uncut_error_bound_mm {
        None => format!("{} or more", micrometres(thickness)),
        bound => with_bound(thickness, bound),
    }
}

/// The rows of the engagement: those before the walls' and those behind them.
fn engagement_rows(p: &EngagementFigures) -> [Vec<(&'static str, String)>; 2] {
    let with_thin_layers = p.thin_layers.as_ref().map(|thin| {
        let place = |one: &ExceedingStretch| format!(" at {:.2}, {:.2}, {:.2}", one.x, one.y, one.z);
        let text = format!(
            "{:.0} ± {:.0} degrees{} (layers below {:.1} µm not counted); {:.1} mm of the length above {:.0} degrees",
            thin.max_engagement_deg,
            thin.max_engagement_error_bound_deg,
            thin.over_engagement_limit.first().map_or_else(String::new, place),
            1e3 * thin.counted_from_mm,
            thin.over_engagement_limit_mm,
            p.engagement_limit_deg
        );
        ("greatest with thin chips", text)
    });
    let rows = vec![
        (
            "engagement, greatest and 95 %",
            format!(
                "{:.0} ± {:.0}, {:.0} degrees (layers below {:.1} µm not counted)",
                p.max_engagement_deg,
                p.max_engagement_error_bound_deg,
                p.p95_engagement_deg,
                1e3 * p.uncounted_layer_mm
            ),
        ),
        (
            "above the limit",
            format!(
                "{:.1} % of the length above {:.0} degrees",
                100.0 * p.over_engagement_limit_fraction,
                p.engagement_limit_deg
            ),
        ),
    ];
    [rows, with_thin_layers.into_iter().collect()]
}

/// The stretches above the engagement that was asked for.
fn exceeding(p: &EngagementFigures) -> Option<FigureTable> {
    let row = |one: &ExceedingStretch| {
        vec![
            format!("{:.3}, {:.3}, {:.3}", one.x, one.y, one.z),
            format!("{:.3}", one.length_mm),
            format!("{:.2} ± {:.2}", one.max_engagement_deg, bound_of(p, one.max_engagement_deg)),
            one.first_move.to_string(),
            one.line.map_or_else(|| "-".to_owned(), |line| line.to_string()),
        ]
    };
    (!p.over_engagement_limit.is_empty()).then(|| FigureTable {
        title: "Stretches above the engagement",
        caption: "Where passes exceed the engagement that was asked for, the longest stretches first. The feed is reduced there.",
        columns: vec!["from, mm", "length, mm", "greatest, degrees", "first move", "line"],
        rows: p.over_engagement_limit.iter().map(row).collect(),
    })
}

/// Bound of the error of a measured engagement, degrees: no more of the circumference than the front half can
/// cut.
fn bound_of(pocket: &EngagementFigures, measured: f64) -> f64 {
    pocket.max_engagement_error_bound_deg.min(180.0 - measured)
}

/// That the cutter does not come beyond a pocket's outline.
fn within_walls(run: &Run<'_>, pocket: &PocketFigures) -> Claim {
    let limit = run.scene().tolerance.gouge;
    let measured = pocket.wall_gouge_mm.max(pocket.wall_gouge_of_cells_mm);
    let bound = pocket.wall_gouge_error_bound_mm;
    let index = pocket.wall_gouge_move;
    let text = format!(
        "the wall is cut {} µm beyond the outline (limit {}) by move {index}{}",
        with_bound(Some(measured), Some(bound)),
        micrometres(Some(limit)),
        run.program_line(index)
    );
    let at_least = Some(pocket.wall_gouge_mm - off(run));
    Claim { at_least, ..Claim::length(WALL, Gravity::Scrap, limit, measured, bound) }.told(text)
}

/// How far walls and moves may lie off those that were measured, mm.
fn off(run: &Run<'_>) -> f64 {
    run.session.pocket.as_ref().map_or(0.0, |pocket| pocket.off_drawing) + run.path().origin.strays
}

/// That nothing stands on the walls that the cutter comes to.
fn cut_to_walls(run: &Run<'_>, pocket: &PocketFigures) -> Claim {
    let limit = run.scene().tolerance.uncut;
    let measured = pocket.wall_uncut_mm;
    let bound = pocket.wall_uncut_error_bound_mm.unwrap_or(f64::INFINITY);
    let at = pocket.wall_uncut_at_mm.map_or_else(String::new, |[x, y]| format!(" at x {x:.3} y {y:.3}"));
    let text = format!(
        "uncut material {} µm thick on the walls (limit {}){at}",
        thickness(pocket),
        micrometres(Some(limit))
    );
    // Where no move comes near it stands as far as was looked.
    let at_least = (!bound.is_finite()).then_some(measured - off(run));
    Claim { at_least, ..Claim::length("uncut", Gravity::Finish, limit, measured, bound) }.told(text)
}

/// That nothing stands where the cutter does not reach.
fn cut_everywhere(run: &Run<'_>, found: &OutOfReach) -> Claim {
    let limit = run.scene().tolerance.uncut;
    let OutOfReach { area, height, at_least, at_most, at } = *found;
    let bound = (at_most - height).max(0.0);
    let text = match at {
        Some(at) => format!(
            "uncut material {} µm high (limit {}) at x {:.3} y {:.3}, in {area:.3} mm² that the cutter does not reach: corners, \
             or places narrower than it",
            beside_limit(height, bound, limit),
            micrometres(Some(limit)),
            at.x,
            at.y
        ),
        None => format!(
            "what the cutter does not reach is no thicker than {} µm (limit {})",
            micrometres(Some(bound)),
            micrometres(Some(limit))
        ),
    };
    Claim { at_least: Some(at_least), ..Claim::length("uncut", Gravity::Finish, limit, height, bound) }
        .told(text)
}

/// That passes keep to the engagement that the scene asks for.
fn engaged_within(run: &Run<'_>, pocket: &EngagementFigures, limit: f64) -> Claim {
    let (measured, index) = (pocket.max_engagement_deg, pocket.max_engagement_move);
    let bound = bound_of(pocket, measured);
    let (count, share) = (pocket.over_engagement_limit_count, 100.0 * pocket.over_engagement_limit_fraction);
    let longest = pocket.over_engagement_limit.first().map_or_else(String::new, |one| {
        let stretches = if count == 1 { "1 stretch".to_owned() } else { format!("{count} stretches") };
        format!(
            "; {share:.2} % of the length exceed the limit, at a reduced feed: {stretches}, the longest {:.2} mm from {:.2}, {:.2}, {:.2}. Use a smaller cutter where the pocket is too narrow, or a larger `engagement`",
            one.length_mm, one.x, one.y, one.z
        )
    });
    let text = format!(
        "the greatest engagement is {measured:.1} ± {bound:.1} degrees (limit {limit:.1}, layers below {:.1} µm not counted), at move {index}{}{longest}",
        1e3 * pocket.uncounted_layer_mm,
        run.program_line(index),
    );
    Claim { unit: "deg", ..Claim::length("engagement", Gravity::Scrap, limit, measured, bound) }.told(text)
}

/// What the coordinates of two points, as programs write them, are off their difference by at most, mm.
const LAST_DECIMAL: f64 = 2.0 * motion::ROUNDING;

/// Differences of heights, mm, and of slopes below which they are rounding.
const ROUNDING: f64 = 1e-6;

/// The levels to which a path cuts, mm, from the highest.
fn levels(path: &Toolpath) -> Vec<f64> {
    let cut = path.segments().filter(|(_, _, m)| m.kind == MoveKind::Cut);
    let mut levels: Vec<f64> = cut.flat_map(|(a, b, _)| [a.z, b.z]).collect();
    levels.sort_by(|a, b| b.total_cmp(a));
    levels.dedup_by(|next, last| *last - *next <= ROUNDING);
    levels
}

/// That no step goes deeper than the scene allows, from the top of the stock on.
fn steps_down(path: &Toolpath, top: f64, limit: f64) -> Claim {
    let mut from = top;
    let step = |level: f64| std::mem::replace(&mut from, level) - level;
    let deepest = levels(path).into_iter().map(step).fold(0.0, f64::max);
    let measured = if deepest <= limit + ROUNDING { deepest.min(limit) } else { deepest };
    let text = format!("the deepest step down is {deepest:.3} mm (limit {limit:.3})");
    Claim::length("stepdown", Gravity::Scrap, limit, measured, 0.0).told(text)
}

/// That no way down through stock is steeper than the scene allows.
fn ramps(run: &Run<'_>, pocket: &Pocket, strategy: &PocketStrategy) -> Claim {
    let limit = strategy.ramp_angle.to_degrees();
    let before =
        StockBefore::new(run.path(), run.tooling().cutter.radius(), &run.session.stock, pocket.free());
    let stands = |k: usize| before.stands_under(k);
    let (steepest, at_least, index) = steepest(run.path(), run.session.top(), limit, &stands);
    let text = match index {
        None => "no way down cuts".to_owned(),
        Some(k) => format!(
            "the steepest way down is {steepest:.2} degrees (limit {limit:.2}), at move {k}{}",
            run.program_line(k as u32)
        ),
    };
    let measured = if at_least <= limit + ROUNDING { steepest.min(limit) } else { steepest };
    Claim { unit: "deg", ..Claim::length("ramp", Gravity::Crash, limit, measured, 0.0) }.told(text)
}

/// The steepest way down below what the level above its pass has cleared, degrees from level; the same less
/// what rounding of its coordinates may have added; its move. Straight ways, and those above the limit, count
/// where stock `stands` under a move.
fn steepest(
    path: &Toolpath,
    top: f64,
    limit: f64,
    stands: &dyn Fn(usize) -> bool,
) -> (f64, f64, Option<usize>) {
    let levels = levels(path);
    let mut floors: BTreeMap<u32, f64> = BTreeMap::new();
    // A helix may be all that a pass is.
    for m in path.moves.iter().filter(|m| matches!(m.kind, MoveKind::Cut | MoveKind::Plunge)) {
        let floor = floors.entry(m.pass).or_insert(f64::INFINITY);
        *floor = floor.min(m.to.tip.z);
    }
    let cleared = |pass: u32| {
        let floor = floors.get(&pass).copied().unwrap_or(f64::INFINITY);
        let above = |level: &f64| *level > floor + ROUNDING;
        levels.iter().rev().copied().find(above).unwrap_or(top).min(top)
    };
    let mut found = (0.0, 0.0, None);
    for (k, (a, b, m)) in path.segments().enumerate() {
        let (run, drop) = ((b - a).xy().norm(), a.z - b.z);
        let slope = |drop: f64, run: f64| drop.max(0.0).atan2(run).to_degrees();
        let at_least = slope(drop - LAST_DECIMAL - ROUNDING, run + LAST_DECIMAL * std::f64::consts::SQRT_2);
        let is_asked = || a.xy() == b.xy() || at_least > limit + ROUNDING;
        let cuts = || b.z < cleared(m.pass) - ROUNDING && (!is_asked() || stands(k));
        if m.kind == MoveKind::Plunge && at_least > found.1 && cuts() {
            found = (slope(drop, run), at_least, Some(k));
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::Point3;
    use motion::{ClPoint, Move};
    use report::Verdict;

    /// Down to -1 by a ramp of 45 degrees, on to -3 through ground that is cleared to -1, and by a plunge.
    fn path() -> Toolpath {
        let to = |x: f64, z: f64, kind, pass| {
            let to = ClPoint::upright(Point3::new(x, 0.0, z));
            Move { to, kind, feed_rate: 100.0, pass }
        };
        let moves = vec![
            to(0.0, 0.0, MoveKind::Plunge, 0),
            to(1.0, -1.0, MoveKind::Plunge, 0),
            to(9.0, -1.0, MoveKind::Cut, 0),
            to(9.0, -0.5, MoveKind::Retract, 0),
            to(9.0, -1.0, MoveKind::Plunge, 1),
            to(9.0, -3.0, MoveKind::Plunge, 1),
            to(0.0, -3.0, MoveKind::Cut, 1),
        ];
        Toolpath::new(ClPoint::upright(Point3::new(0.0, 0.0, 5.0)), moves)
    }

    #[test]
    fn steps_and_ways_down_are_measured_from_the_path() {
        let path = path();
        assert_eq!(levels(&path), [-1.0, -3.0]);
        let claim = |limit| steps_down(&path, 0.0, limit);
        assert_eq!((claim(2.0).verdict(), claim(1.9).verdict()), (Verdict::Pass, Verdict::Fail));
        assert_eq!(claim(1.9).measured, Some(2.0));
        // The way through air above the stock is no way down.
        let plunge = steepest(&path, 0.0, 3.0, &|_| true);
        assert!(plunge.0 == 90.0 && plunge.1 > 89.99 && plunge.2 == Some(5), "{plunge:?}");
        assert_eq!(steepest(&path, 0.0, 3.0, &|k| k < 3).2, Some(1));
        assert_eq!(steepest(&path, 0.0, 3.0, &|_| false).2, None);
        assert_eq!(steepest(&path, 0.0, 45.0, &|_| false).2, Some(1));
        let ramped = Toolpath::new(path.start, path.moves[..3].to_vec());
        let (slope, _, index) = steepest(&ramped, 0.0, 3.0, &|_| true);
        assert!((slope - 45.0).abs() < 1e-12 && index == Some(1));
    }

    /// Two places of a ramp that fall together once written: what their last decimals may have added is no
    /// slope, but a drop of more is.
    #[test]
    fn the_last_decimals_of_a_ramp_are_no_slope() {
        for (z, along, is_steep) in [(-0.6001, 0.0, false), (-0.6001, 1e-4, false), (-0.61, 1e-4, true)] {
            let to = |x: f64, z: f64| {
                let to = ClPoint::upright(Point3::new(x, 7.1234, z));
                Move { to, kind: MoveKind::Plunge, feed_rate: 100.0, pass: 0 }
            };
            let moves = vec![to(0.0, 0.0), to(12.0, -0.6), to(12.0 + along, z), to(40.0, -2.0)];
            let path = Toolpath::new(ClPoint::upright(Point3::new(0.0, 7.1234, 5.0)), moves);
            let (_, at_least, _) = steepest(&path, 0.0, 3.0, &|_| true);
            assert_eq!(at_least > 3.0, is_steep, "{z} {along}: {at_least}");
        }
    }
}
