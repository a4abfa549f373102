//! What the moves take from the stock in the order of the program, and rapid moves in stock.

use cutter::Solid;
use metrology::{RapidContactFigures, RemovalFigures, View, removal_figures, voxel_removal_figures};
use motion::MoveKind;
use report::{Claim, Figure, Gravity, Verdict, place};
use sim::{ENGAGED, InStock, KeptOut, MoveRemoval, Stock, VoxelEngine, ZMap, cut_in_order_in_turn};
use work::monitor::Monitor;

use super::words::value;
use super::{bent_rapids, entries};
use crate::JobError;
use crate::run::{Finding, Run};

/// What the word means.
const MEANING: (&str, &str) = (
    "removal",
    "What the moves take from the stock in the order of the program, at the programmed feed. The rate \
     is the mean over a few cells of travel, and of a long move over what it cuts; engagement is how high the cutter meets stock and how \
     wide a move cuts. No rapid move may touch stock.",
);

/// What decides whether stock stands that tools with unknown cutters may have taken.
pub(super) const TOOLS_BEFORE: &str = "a table of tools with the cutters of the tools before would decide it";

/// Voxels in the block where the program chooses: more take longer than planning and measuring do, fewer
/// leave engagement and rates rough.
const VOXELS: f64 = 1e6;

/// Where the scene asks for it.
pub(super) fn find(run: &Run<'_>, monitor: &dyn Monitor) -> Result<Finding, JobError> {
    if !run.scene().simulation.removal {
        return Ok(Finding::default());
    }
    let mut unseen = None;
    let (mut r, moves) = match run.view() {
        View::Heights(cut) => {
            let stock = stock(run, cut, monitor)?;
            let removed =
                cut_in_order_in_turn(stock, run.own_cutters, run.path(), monitor).map_err(run.heights())?;
            let mut figures = removal_figures(run.path(), &removed, &cut.height, run.session.top());
            if figures.rapid_contacts.is_empty() {
                let rapid =
                    |k: usize| (run.path().moves[k].kind == MoveKind::Rapid).then_some(KeptOut::Cutter);
                unseen = first_in_stock(run, rapid, monitor)?.and_then(|found| listed(found, &mut figures));
            }
            (figures, removed.moves)
        }
        View::Normals(_) => by_voxels(run, &mut unseen, monitor)?,
    };
    for contact in &mut r.rapid_contacts {
        contact.line = run.line(contact.move_index);
        contact.tool = run.path().named_tool_of(contact.move_index as usize);
    }
    let is_clear = unseen.is_none() && r.rapid_contacts.is_empty();
    let on_bent_way = if is_clear { bent_rapids::first_in_stock(run, monitor)? } else { None };
    let mut claims = vec![match (unseen, on_bent_way) {
        (Some(open), _) => rapid_open(run, &open),
        (None, Some(met)) => rapid_bent(run, &met),
        (None, None) => no_rapid_in_stock(&r, run.path().program_name()),
    }];
    if run.request.foreign().is_some_and(|read| read.unknown_before) {
        doubt(&mut claims, TOOLS_BEFORE);
    }
    let (greatest, bound) =
        (r.max_material_removal_rate_mm3_min, r.max_material_removal_rate_error_bound_mm3_min);
    let at_most = r.material_removal_rate_at_most_mm3_min;
    let at_most = at_most.map_or_else(String::new, |rate| format!(", nowhere over {:.0}", rate.ceil()));
    let (most, mean) = (r.p95_material_removal_rate_mm3_min, r.mean_material_removal_rate_mm3_min);
    let (axial, axial_bound) = (r.max_axial_engagement_mm, r.max_axial_engagement_error_bound_mm);
    // A bound beyond the figure is that of what was there before the first cut.
    let axial = if axial_bound < axial {
        format!("{axial:.2} ± {axial_bound:.2}")
    } else {
        format!("{axial:.2} at the centres of cells and {:.2} at most", axial + axial_bound)
    };
    let rows = vec![
        ("volume removed", format!("{:.0} ± {:.0} mm³", r.volume_mm3, r.volume_error_bound_mm3)),
        ("removal rate, greatest", format!("{greatest:.0} ± {bound:.0} mm³/min{at_most}")),
        ("removal rate, 95 % and mean", format!("{most:.0}, {mean:.0} mm³/min")),
        ("engagement, axial and radial", format!("{axial}, {:.2} mm", r.max_radial_engagement_mm)),
    ];
    let figure =
        Figure { key: "removal", value: value(&r)?, rows, meaning: Some(MEANING), ..Figure::default() };
    let entries = entries::of(run, &moves, r.max_axial_engagement_error_bound_mm, monitor)?;
    claims.extend(entries.claims);
    Ok(Finding { figure: Some(figure), claims, notes: entries.notes })
}

/// What seems violated may not be: other tools may have cut there.
pub(crate) fn doubt(claims: &mut [Claim], decided_by: &'static str) {
    for claim in claims.iter_mut().filter(|claim| claim.verdict() == Verdict::Fail) {
        (claim.error_bound, claim.at_least, claim.decided_by) = (f64::INFINITY, None, decided_by);
    }
}

/// The stock, less what other toolpaths and other tools of a program from elsewhere cut before.
fn stock(run: &Run<'_>, cut: &ZMap, monitor: &dyn Monitor) -> Result<ZMap, JobError> {
    let mut stock = cut.uncut(cut.grid, monitor)?.within(&run.session.area());
    for (cutter, path) in run.before() {
        stock = sim::cut(stock, &cutter, &path, monitor).map_err(run.heights())?;
        stock.cut_by.fill(sim::NOT_CUT);
    }
    Ok(stock)
}

/// The first move that is not shown to keep out of what stands when it comes, as cells see the stock: a
/// roughed block is whole.
pub(super) fn first_in_stock(
    run: &Run<'_>,
    asked: impl Fn(usize) -> Option<KeptOut> + Sync + Send,
    monitor: &dyn Monitor,
) -> Result<Option<InStock>, JobError> {
    let (path, cutters) = (run.path(), run.own_cutters);
    let strays = path.origin.strays;
    Ok(sim::first_in_stock(&whole_stock(run), &run.before(), cutters, path, strays, asked, monitor)?)
}

/// The stock, of a roughed block the whole.
pub(super) fn whole_stock(run: &Run<'_>) -> Stock {
    match run.session.roughed_stock() {
        Stock::Roughed { block, .. } => Stock::Box(block),
        stock => stock,
    }
}

/// Lists a rapid move in stock that the centres of cells do not show, where it is certain; else hands it
/// back.
fn listed(found: InStock, figures: &mut RemovalFigures) -> Option<InStock> {
    let Some(depth_mm) = found.depth else { return Some(found) };
    let (move_index, at_mm) = (found.move_index, found.at.into());
    figures.rapid_contacts = vec![RapidContactFigures { move_index, line: 0, tool: None, at_mm, depth_mm }];
    figures.rapid_contact_count = 1;
    None
}

/// That a rapid move may touch stock.
fn rapid_open(run: &Run<'_>, open: &InStock) -> Claim {
    let text = format!(
        "whether a rapid move touches stock at {}, move {}{}, is open",
        place(open.at.into()),
        open.move_index,
        run.program_line(open.move_index)
    );
    let claim = Claim::length("rapid", Gravity::Crash, ENGAGED, 0.0, f64::INFINITY).told(text);
    Claim { decided_by: "a rapid move farther from what stands would decide it", ..claim }
}

/// That a rapid move is clear of stock on its straight way and not on its bent one.
fn rapid_bent(run: &Run<'_>, met: &InStock) -> Claim {
    let text = format!(
        "whether a rapid move touches stock is open: with one rate of all axes move {}{} comes to stock at {}, and straight it does not",
        met.move_index,
        run.program_line(met.move_index),
        place(met.at.into())
    );
    let claim = Claim::length("rapid", Gravity::Crash, ENGAGED, 0.0, f64::INFINITY).told(text);
    let decided_by = "rapid moves of one axis at a time, or a control that leads them straight (see the note), would decide it";
    Claim { decided_by, ..claim }
}

/// The voxel of removal in order, mm.
fn voxel_in_order(run: &Run<'_>, stock: &Stock) -> f64 {
    let about = || (stock.bounds().size().product() / VOXELS).cbrt();
    run.scene().simulation.voxel.unwrap_or_else(about)
}

/// By voxels; `unseen` is a rapid move that they do not show and that may be in stock.
fn by_voxels(
    run: &Run<'_>,
    unseen: &mut Option<InStock>,
    monitor: &dyn Monitor,
) -> Result<(RemovalFigures, Vec<MoveRemoval>), JobError> {
    let stock = run.session.roughed_stock();
    let voxel = voxel_in_order(run, &stock);
    let cutter = Solid::of_cutter(&run.tooling().cutter, run.tooling().holder.as_ref());
    let engine = VoxelEngine::new(&stock, &cutter, run.path()).map_err(run.voxels())?;
    let removed = engine.removal(voxel, monitor).map_err(run.voxels())?;
    let mut figures = voxel_removal_figures(run.path(), &removed, voxel);
    if figures.rapid_contacts.is_empty() {
        let strays = run.path().origin.strays;
        *unseen = engine.first_rapid_in_stock(strays, monitor)?.and_then(|found| listed(found, &mut figures));
    }
    Ok((figures, removed.moves))
}

/// That no rapid move touches stock; told of the first one that does: on a machine it is the one that breaks
/// the cutter.
fn no_rapid_in_stock(removal: &RemovalFigures, program: &str) -> Claim {
    // Less is a touch.
    let claim = |depth, bound| Claim::length("rapid", Gravity::Crash, ENGAGED, depth, bound);
    let Some(first) = removal.rapid_contacts.first() else {
        return claim(0.0, ENGAGED).told("no rapid move touches stock".into());
    };
    let deepest = removal.rapid_contacts.iter().map(|c| c.depth_mm).fold(0.0, f64::max);
    let mut text = format!(
        "a rapid move touches stock, {:.3} mm deep, at {}, move {}",
        first.depth_mm,
        place(first.at_mm),
        first.move_index
    );
    // Paths that tilt the tool have no program where the scene names no machine for it.
    if first.line > 0 {
        text += &format!(", {program} line {}", first.line);
    }
    text += &first.tool.map_or_else(String::new, |tool| format!(", tool {tool}"));
    match removal.rapid_contact_count {
        0 | 1 => {}
        2 => text += ", and one more rapid move does",
        n => text += &format!(", and {} more rapid moves do", n - 1),
    }
    claim(deepest, 0.0).told(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_rapid_in_stock_is_told_with_its_line() {
        assert_eq!(no_rapid_in_stock(&RemovalFigures::default(), "").verdict(), report::Verdict::Pass);
        let contact = |depth_mm| RapidContactFigures {
            move_index: 7,
            line: 12,
            tool: None,
            at_mm: [1.0, 2.0, 3.0],
            depth_mm,
        };
        let rapid_contacts = vec![contact(0.25), contact(1.5)];
        let removal = RemovalFigures { rapid_contacts, rapid_contact_count: 3, ..Default::default() };
        let found = no_rapid_in_stock(&removal, "toolpath.nc");
        assert_eq!((found.what, found.measured), ("rapid", Some(1.5)));
        assert_eq!(found.verdict(), report::Verdict::Fail);
        let place =
            "0.250 mm deep, at x 1.000 y 2.000 z 3.000, move 7, toolpath.nc line 12, and 2 more rapid";
        assert!(found.text.contains(place), "{}", found.text);
    }
}
