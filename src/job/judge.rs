//! The rule by which a toolpath passes: every figure, with the bound of its error, within its limit.
//!
//! Each limit is a [`Claim`]. It holds where figure and bound lie within it, is violated where the figure
//! less its bound exceeds it, or what is there for certain does, and is undecided otherwise; coarser cells
//! widen bounds, so they may turn an answer into no answer and never into the other one. The limits of the
//! measured surface:
//!
//! - scallop: no ridge and no remnant along a border exceeds the scallop tolerance times the factor that the
//!   scene allows, and the share of the ridge length that the scene names does not exceed the tolerance
//!   itself;
//! - gouge: no place lies deeper than the gouge tolerance;
//! - uncut: no other material stands higher than the uncut tolerance.
//!
//! What else is limited is claimed by the figures of [`figures`](super::figures).

use metrology::{Bounded, ExcessFigures, Limits, Measurement, ScallopRule};
use report::{Claim, Gravity, MapMark, Verdict, beside_limit, micrometres, per_cent, place};
use sim::NOT_CUT;

/// The limits of a measured surface, each with its figure, its bound and a sentence: gouges, uncut material,
/// scallops; mm, the gravest first. [`Verdict::by`] all of them is the verdict on the surface. What else a
/// scene limits, as clearances, feeds or removal, is judged where a [`Session`](crate::Session) runs it.
pub fn judge_surface(measured: &Measurement, limits: &Limits, rule: &ScallopRule) -> Vec<Claim> {
    judge(measured, limits, rule, Vec::new(), "the program")
}

/// The limits of a measured toolpath, the gravest first. `found` are the claims of further figures; lines are
/// of `program`.
pub(crate) fn judge(
    measured: &Measurement,
    limits: &Limits,
    rule: &ScallopRule,
    found: Vec<Claim>,
    program: &str,
) -> Vec<Claim> {
    let mut claims = found;
    let (uncut, highest) = (uncut(measured, limits), highest(measured, limits, rule));
    let highest = if is_hidden(&highest, &uncut) { hidden(highest) } else { highest };
    // A scallop that is too high is one violation, not two.
    let both = [&uncut, &highest].iter().all(|claim| claim.verdict() == Verdict::Fail);
    let is_scallop = both && is_below_scallop(measured);
    claims.push(gouge(measured, limits, program));
    claims.extend(Some(uncut).filter(|_| !is_scallop));
    claims.push(highest);
    claims.extend(most(measured, limits, rule));
    claims.sort_by_key(|claim| std::cmp::Reverse(claim.gravity));
    claims
}

/// Of each limit that cells and normals both find violated the graver claim, with what the other one found.
pub(crate) fn each_violation_once(claims: Vec<Claim>) -> Vec<Claim> {
    let mut once: Vec<Claim> = Vec::with_capacity(claims.len());
    let is_surface =
        |claim: &Claim| ["gouge", "uncut", "scallop"].contains(&claim.what) && claim.unit == "mm";
    for claim in claims {
        let fails = |claim: &Claim| is_surface(claim) && claim.verdict() == Verdict::Fail;
        let is_unseen = |claim: &Claim| claim.text.ends_with(UNSEEN);
        let same = |other: &&mut Claim| {
            fails(other)
                && fails(&claim)
                && (other.what, other.limit) == (claim.what, claim.limit)
                && is_unseen(other) != is_unseen(&claim)
        };
        match once.iter_mut().find(same) {
            Some(other) => {
                let is_graver = claim.measured.unwrap_or(0.0) > other.measured.unwrap_or(0.0);
                let less = if is_graver { std::mem::replace(other, claim) } else { claim };
                let (height, limit) = (less.measured.unwrap_or(0.0), less.limit);
                let height = beside_limit(height, less.error_bound, limit);
                let place = if less.text.ends_with(UNSEEN) { UNSEEN } else { " on the cells" };
                other.text += &format!("; {height} µm{}", place.strip_prefix(',').unwrap_or(place));
            }
            None => once.push(claim),
        }
    }
    once
}

/// What the sentence of a claim ends with that is not of cells.
pub(crate) const UNSEEN: &str = ", measured along normals where no cell sees";

/// What decides claims that cells cannot: of plans with arcs, of plans whose axes turn, and of programs.
pub(crate) const LESS_STRAYING: [&str; 3] = [
    "the tool strays by as much between the lines of the program: a lesser `arcs` in [machine] would decide it",
    "the tool strays by as much between the lines of the program: a lesser `chord` in [tolerance] would decide it",
    "the tool strays by as much between the lines of the program: lines for arcs, and shorter ones where axes turn, would \
     decide it",
];

/// The same of programs that let the control round corners.
const ROUNDED: &str = "the program lets the control round corners by as much (G64 P, G187 E): a lesser tolerance, or G61, would decide it";

/// Says of undecided lengths that the bound would decide, did the motion not stray so far, mm, from the moves
/// that are measured, for the reason that goes with it; `rounded` of that, mm, is what a program from elsewhere
/// lets the control round corners by.
pub(crate) fn name_strays(claims: &mut [Claim], (strays, less): (f64, &'static str), rounded: f64) {
    let hangs_on = |claim: &Claim, by: f64| {
        let nearer = Claim { error_bound: claim.error_bound - by, ..claim.clone() };
        by > 0.0 && nearer.verdict() != Verdict::Undecided
    };
    for claim in claims.iter_mut().filter(|claim| claim.unit == "mm" && claim.verdict() == Verdict::Undecided)
    {
        if hangs_on(claim, rounded) {
            claim.decided_by = ROUNDED;
        } else if hangs_on(claim, strays) {
            claim.decided_by = less;
        }
    }
}

/// The verdict on the measured surface alone.
pub(crate) fn of_surface(measured: &Measurement, limits: &Limits, rule: &ScallopRule) -> Verdict {
    Verdict::by(&judge_surface(measured, limits, rule))
}

fn gouge(measured: &Measurement, limits: &Limits, program: &str) -> Claim {
    let figures = &measured.gouge;
    let mut text = format!(
        "gouge {} µm deep (limit {})",
        beside_limit(figures.max_depth_mm, figures.error_bound_mm, limits.gouge),
        micrometres(Some(limits.gouge))
    );
    if let Some(worst) = figures.regions.first() {
        text += &format!(" at {}", place(worst.at_mm));
        if worst.move_index != NOT_CUT {
            text += &format!(", move {}", worst.move_index);
        }
        // Paths that tilt the tool have no program where the scene names no machine for it.
        text += &match &worst.toolpath {
            Some(name) => {
                let program = worst.program.as_deref().unwrap_or_default();
                format!(" of the toolpath {name} before this one, {program} line {}", worst.line)
            }
            None if worst.line > 0 => format!(", {program} line {}", worst.line),
            None => String::new(),
        };
        text += &worst.tool.map_or_else(String::new, |tool| format!(", tool {tool}"));
        text += &others(figures.region_count);
    }
    let (depth, bound, least) = (figures.max_depth_mm, figures.error_bound_mm, figures.at_least_mm);
    let at_least = Some(least).filter(|least| *least > 0.0);
    if depth - bound <= limits.gouge && least > limits.gouge {
        text += &format!("; {} µm are cut for certain", micrometres(at_least));
    }
    let claim = length("gouge", Gravity::Scrap, limits.gouge, depth, bound);
    Claim { measured: known(measured, depth), at_least, ..claim }.told(text)
}

fn uncut(measured: &Measurement, limits: &Limits) -> Claim {
    let figures = &measured.uncut;
    let regions = Bounded::new(figures.max_height_mm, figures.error_bound_mm);
    // Of equals the one with a place.
    let all = measured.excess.unreached.or(&regions);
    let Bounded { max_mm: height, error_bound_mm: bound, .. } = all;
    let limit = micrometres(Some(limits.uncut));
    let mut text = if height > 0.0 {
        format!("uncut material {} µm high (limit {limit})", beside_limit(height, bound, limits.uncut))
    } else {
        format!("no uncut material stands higher than {} µm (limit {limit})", micrometres(Some(bound)))
    };
    if let Some(worst) = figures.regions.first() {
        let others = others(figures.region_count);
        text += &format!(" over {:.3} mm² at {}{others}", figures.area_mm2, place(worst.at_mm));
    } else if let Some(at) = all.at_mm.filter(|_| height > limits.uncut) {
        text += &format!(" at {}", place(at));
    }
    text += &for_certain(&all, limits.uncut);
    Claim { measured: known(measured, height), ..claim("uncut", limits.uncut, &all) }.told(text)
}

/// Whether the highest uncut material is no more than a flank of the highest scallop: it has no place and no
/// area of its own, and stands no higher.
fn is_below_scallop(measured: &Measurement) -> bool {
    let Measurement { uncut, excess, scallop, .. } = measured;
    let height = uncut.max_height_mm.max(excess.unreached.max_mm);
    let has_place = !uncut.regions.is_empty() || excess.unreached.at_mm.is_some();
    height > 0.0 && !has_place && scallop.max_mm.is_some_and(|ridge| height <= ridge)
}

/// What of the cut surface answers to the scallop limit: the highest ridge, and the highest remnant along a
/// border.
pub(crate) fn highest_reached(measured: &Measurement) -> Bounded {
    let reached = measured.excess.reached;
    highest_ridge(measured).map_or(reached, |ridge| ridge.or(&reached))
}

/// The highest ridge with its own bound; `None` without ridges.
fn highest_ridge(measured: &Measurement) -> Option<Bounded> {
    let figures = &measured.scallop;
    figures.max_mm.map(|height| Bounded {
        at_mm: figures.max_at_mm,
        ..Bounded::new(height, figures.error_bound_mm.unwrap_or(f64::INFINITY))
    })
}

/// The highest ridge or remnant along a border.
fn highest(measured: &Measurement, limits: &Limits, rule: &ScallopRule) -> Claim {
    let (all, limit) = (highest_reached(measured), rule.highest * limits.scallop);
    // A ridge that violates the limit by itself has its own bound: where it turns into uncut material, nothing tells
    // how high what passes left stands elsewhere.
    let ridge = highest_ridge(measured);
    let violates = |ridge: &Bounded| ridge.max_mm == all.max_mm && ridge.stands_mm() > limit;
    let all = ridge.filter(violates).unwrap_or(all);
    let what = match measured.scallop.max_mm {
        Some(ridge) if ridge >= measured.excess.reached.max_mm => "the highest scallop",
        _ => "the highest scallop or remnant beside a border",
    };
    let text = format!(
        "{what} is {} µm (limit {}){}{}",
        beside_limit(all.max_mm, all.error_bound_mm, limit),
        micrometres(Some(limit)),
        all.at_mm.map_or(String::new(), |at| format!(" at {}", place(at))),
        for_certain(&all, limit)
    );
    Claim { measured: known(measured, all.max_mm), ..claim("scallop", limit, &all) }.told(text)
}

/// That what stands on the surface holds a limit, mm.
fn claim(what: &'static str, limit: f64, highest: &Bounded) -> Claim {
    let at_least = Some(highest.at_least_mm).filter(|least| *least > 0.0);
    Claim { at_least, ..length(what, Gravity::Finish, limit, highest.max_mm, highest.error_bound_mm) }
}

/// What stands above a limit for certain, where figure and bound do not say so.
fn for_certain(highest: &Bounded, limit: f64) -> String {
    if highest.max_mm - highest.error_bound_mm > limit || highest.at_least_mm <= limit {
        return String::new();
    }
    format!("; {} µm stand for certain", micrometres(Some(highest.at_least_mm)))
}

/// The share of the ridge length above the target, where the scene lets some of it be.
fn most(measured: &Measurement, limits: &Limits, rule: &ScallopRule) -> Option<Claim> {
    if rule.share >= 1.0 {
        return None;
    }
    let limit = 1.0 - rule.share;
    let over = measured.share_above(limits.scallop);
    let bound = measured.scallop.error_bound_mm.unwrap_or(f64::INFINITY);
    let [more, less] = [-bound, bound].map(|by| measured.share_above(limits.scallop + by));
    let error_bound = match (over, more, less) {
        (Some(over), Some(more), Some(less)) => (more - over).max(over - less),
        _ => f64::INFINITY,
    };
    let text = format!(
        "{} ± {} % of the ridge length stand above {} µm (limit {} %)",
        per_cent(over),
        per_cent(Some(error_bound).filter(|bound| bound.is_finite())),
        micrometres(Some(limits.scallop)),
        per_cent(Some(limit))
    );
    // Without a ridge none stands above.
    let (measured, error_bound) = if over.is_none() && measured.excess.reached.at_most() <= limits.scallop {
        (Some(0.0), 0.0)
    } else {
        (over, error_bound)
    };
    let share = Claim::length("scallop", Gravity::Finish, limit, 0.0, error_bound).told(text);
    Some(Claim { unit: "", measured, ..share })
}

/// Whether nothing is known of what passes left, beside uncut material that violates its limit: the bound is
/// wider than the figure and than the limit.
fn is_hidden(highest: &Claim, uncut: &Claim) -> bool {
    let wider = highest.measured.is_some_and(|height| highest.error_bound > height.max(highest.limit));
    wider && highest.verdict() == Verdict::Undecided && uncut.verdict() == Verdict::Fail
}

/// Whether uncut material [hides](is_hidden) what passes left.
pub(crate) fn hides_scallops(measured: &Measurement, limits: &Limits, rule: &ScallopRule) -> bool {
    is_hidden(&highest(measured, limits, rule), &uncut(measured, limits))
}

/// Whether uncut material [hides](is_hidden) the highest place that passes reached.
pub(crate) fn hides_reached(excess: &ExcessFigures, limits: &Limits, rule: &ScallopRule) -> bool {
    let reached = claim("scallop", rule.highest * limits.scallop, &excess.reached);
    is_hidden(&reached, &claim("uncut", limits.uncut, &excess.unreached))
}

/// The claim without its figure, which says nothing.
fn hidden(claim: Claim) -> Claim {
    let limit = micrometres(Some(claim.limit));
    let text = format!("the highest scallop or remnant beside a border is not known (limit {limit})");
    let decided_by = "uncut material stands as high as it may; cut that first";
    Claim { measured: None, decided_by, ..claim }.told(text)
}

/// A figure of a surface that was measured at all.
fn known(measured: &Measurement, figure: f64) -> Option<f64> {
    (measured.deviation.samples > 0).then_some(figure)
}

fn length(what: &'static str, gravity: Gravity, limit: f64, measured: f64, bound: f64) -> Claim {
    Claim::length(what, gravity, limit, measured, bound)
}

/// The gravest places of each kind of violation, named `G1`, `G2` … for gouges, `U1` … for uncut
/// material, in the order of their lists, and `S` for a scallop that is too high.
pub fn marks(measured: &Measurement, limits: &Limits, rule: &ScallopRule) -> Vec<MapMark> {
    /// More rings of one kind hide the map.
    const MOST: usize = 5;
    let numbered = |letter: char, places: Vec<[f64; 3]>| {
        let named =
            |(k, [x, y, _]): (usize, [f64; 3])| MapMark { at: [x, y], name: format!("{letter}{}", k + 1) };
        places.into_iter().take(MOST).enumerate().map(named).collect::<Vec<_>>()
    };
    let high = measured.scallop.max_mm.is_some_and(|height| height > rule.highest * limits.scallop);
    let scallop = measured.scallop.max_at_mm.filter(|_| high);
    let mut marks = numbered('G', measured.gouge.regions.iter().map(|r| r.at_mm).collect());
    marks.extend(numbered('U', measured.uncut.regions.iter().map(|r| r.at_mm).collect()));
    marks.extend(scallop.map(|[x, y, _]| MapMark { at: [x, y], name: "S".to_owned() }));
    marks
}

fn others(region_count: usize) -> String {
    match region_count {
        0 | 1 => String::new(),
        2 => ", and one more place".to_owned(),
        n => format!(", and {} more places", n - 1),
    }
}

#[cfg(test)]
mod tests;
