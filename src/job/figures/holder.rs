//! Shank and holder against the stock.

use metrology::View;
use report::{Claim, Gravity, place};
use sim::{HolderClearance, StandingHits, VoxelEngine, holder_collisions};
use work::monitor::Monitor;

use super::more_moves;
use super::removal::voxel_in_order;
use crate::JobError;
use crate::run::{Finding, Run};

/// Upright tools are held against the finished stock; tools that lean against what still stands when they come, where the
/// scene asks for what each move removes.
pub(super) fn find(run: &Run<'_>, monitor: &dyn Monitor) -> Result<Finding, JobError> {
    let Some(holder) = &run.scene().holder else { return Ok(Finding::default()) };
    match run.view() {
        View::Heights(cut) => {
            let held = holder_collisions(cut, holder, run.path(), monitor)?;
            let claims = vec![clear_of_stock(&held, &|k| run.program_line(k))];
            Ok(Finding { notes: vec![note(&held)], claims, ..Finding::default() })
        }
        View::Normals(_) if run.scene().simulation.removal => {
            let stock = run.session.voxel_stock();
            let voxel = voxel_in_order(run, &stock);
            let engine =
                VoxelEngine::new(&stock, &run.around.tool.cutter, run.path()).map_err(run.voxels())?;
            let hits = engine.holder_in_stock(holder, run.path(), voxel, monitor).map_err(run.voxels())?;
            let claims = vec![clear_of_standing(&hits, voxel, &|k| run.program_line(k))];
            Ok(Finding { notes: vec![standing_note(&hits, voxel)], claims, ..Finding::default() })
        }
        View::Normals(_) => Ok(Finding::default()),
    }
}

fn collision(depth: f64, error_bound: f64) -> Claim {
    Claim::length("collision", Gravity::Crash, 0.0, depth, error_bound)
}

/// That shank and holder do not meet the finished stock.
fn clear_of_stock(holder: &HolderClearance, line: &dyn Fn(u32) -> String) -> Claim {
    let Some(worst) = holder.collisions.iter().reduce(|a, b| if b.depth > a.depth { b } else { a }) else {
        let (lowest, bound) =
            if holder.lowest.is_finite() { (holder.lowest, holder.error_bound) } else { (0.0, 0.0) };
        return collision(-lowest, bound).told(note(holder));
    };
    let text = format!(
        "section {} of the holder stands {:.3} ± {:.3} mm deep in the stock at {}, move {}{}{}",
        worst.section + 1,
        worst.depth,
        worst.error_bound,
        place([worst.at.x, worst.at.y, worst.at.z]),
        worst.move_index,
        line(worst.move_index),
        more_moves(holder.collisions.len())
    );
    collision(worst.depth, worst.error_bound).told(text)
}

/// That shank and holder do not run into stock that still stands, by voxels of `voxel` mm.
fn clear_of_standing(hits: &StandingHits, voxel: f64, line: &dyn Fn(u32) -> String) -> Claim {
    let Some(worst) = hits.worst.as_ref() else {
        return collision(0.0, 0.0).told(standing_note(hits, voxel));
    };
    let text = format!(
        "section {} of the holder runs at least {:.3} mm into stock that still stands at {}, move {}{}{} (voxels of {:.3} mm)",
        worst.section + 1,
        worst.depth,
        place(worst.at.into()),
        worst.move_index,
        line(worst.move_index),
        more_moves(hits.moves.len()),
        voxel
    );
    collision(worst.depth, 0.0).told(text)
}

/// What else is to be said about a holder that was held against standing stock.
fn standing_note(hits: &StandingHits, voxel: f64) -> String {
    if hits.worst.is_some() {
        return "shank and holder meet stock that still stands; rough the block first, or take a longer cutter or a \
                slimmer holder"
            .to_owned();
    }
    format!(
        "shank and holder stay clear of what still stands when they come; less than {:.3} mm across would not be seen",
        3f64.sqrt() * voxel
    )
}

/// What else is to be said about a holder that was checked.
fn note(holder: &HolderClearance) -> String {
    let clearance = if holder.lowest == f64::INFINITY {
        "shank and holder are never above the stock".to_owned()
    } else if holder.lowest < 0.0 {
        "shank and holder meet the stock; a longer cutter or a slimmer holder may clear it".to_owned()
    } else {
        format!(
            "shank and holder stay {:.3} ± {:.3} mm above the finished stock",
            holder.lowest, holder.error_bound
        )
    };
    match holder.uncertain {
        0 => clearance,
        n => format!("{clearance}; on {n} moves only a finer cell can tell whether they touch it"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use report::Verdict;
    use sim::Collision;

    #[test]
    fn a_collision_names_section_move_and_line() {
        let at = geometry::Point3::new(1.0, 2.0, 3.0);
        let one = Collision { move_index: 4, section: 1, at, depth: 0.5, error_bound: 0.1 };
        let collisions = vec![one, Collision { move_index: 6, depth: 2.25, ..one }];
        let mut holder = HolderClearance {
            lowest: -2.25,
            error_bound: 0.1,
            at: Some((6, 1, at)),
            collisions,
            uncertain: 3,
        };
        let found = clear_of_stock(&holder, &|k| format!(", toolpath.nc line {}", k + 10));
        assert_eq!((found.what, found.measured, found.verdict()), ("collision", Some(2.25), Verdict::Fail));
        let expected = "section 2 of the holder stands 2.250 ± 0.100 mm deep in the stock at x 1.000 y 2.000 z 3.000, \
                        move 6, toolpath.nc line 16, and on one more move";
        assert_eq!(found.text, expected);
        assert!(note(&holder).contains("on 3 moves only a finer cell"));
        (holder.collisions, holder.lowest, holder.uncertain) = (vec![], 1.5, 0);
        assert_eq!(clear_of_stock(&holder, &|_| String::new()).verdict(), Verdict::Pass);
        let near = HolderClearance { lowest: 0.05, ..holder.clone() };
        assert_eq!(clear_of_stock(&near, &|_| String::new()).verdict(), Verdict::Undecided);
        assert_eq!(note(&holder), "shank and holder stay 1.500 ± 0.100 mm above the finished stock");
    }

    #[test]
    fn a_holder_in_standing_stock_is_told_with_its_place_and_line() {
        let at = geometry::Point3::new(1.0, 2.0, 3.0);
        let worst = sim::HolderHit { move_index: 2, section: 1, at, depth: 0.75 };
        let hits = StandingHits { moves: vec![2, 5, 9], worst: Some(worst) };
        let found = clear_of_standing(&hits, 0.3, &|k| format!(", toolpath.nc line {}", k + 4));
        assert_eq!((found.what, found.measured, found.verdict()), ("collision", Some(0.75), Verdict::Fail));
        let expected = "section 2 of the holder runs at least 0.750 mm into stock that still stands at x 1.000 y 2.000 z \
                        3.000, move 2, toolpath.nc line 6, and on 2 more moves (voxels of 0.300 mm)";
        assert_eq!(found.text, expected);
        assert!(standing_note(&hits, 0.3).contains("rough the block first"));
        let clear = StandingHits::default();
        assert_eq!(clear_of_standing(&clear, 0.3, &|_| String::new()).verdict(), Verdict::Pass);
        assert!(standing_note(&clear, 0.3).contains("less than 0.520 mm across"));
    }
}
