//! Rapid moves on controls that may lead each axis at its own rate: what is assumed of them, and whether a
//! bent way would meet stock.
//!
//! Such a control starts all axes together, and each stops where it arrives. With one rate for all of them
//! the way goes at 45 degrees first. That way is held against the stock as the straight one is. Rates that
//! differ bend it otherwise, which a note leaves to the user.

use metrology::View;
use motion::{Cutters, Move, MoveKind, Toolpath};
use sim::{InStock, KeptOut};
use work::monitor::Monitor;

use super::removal::whole_stock;
use crate::JobError;
use crate::run::Run;

/// Travels that differ by less, mm, end together, and shorter ones are none.
const SAME_TRAVEL: f64 = 1e-6;

/// The rapid moves of a program that may run on a bent way and come as low as stock stands; none on a control
/// that leads them straight.
fn bending(run: &Run<'_>) -> Vec<usize> {
    if run.request.foreign().is_none_or(|read| read.straight_rapids.is_none()) {
        return Vec::new();
    }
    let (path, stock) = (run.path(), run.session.roughed_stock().bounds());
    let reach = run.own_cutters.greatest_radius();
    let low = |k: usize| {
        let (from, to) = (path.start_of(k), path.moves[k].to.tip);
        let beside =
            |i: usize| from[i].min(to[i]) - reach < stock.max[i] && from[i].max(to[i]) + reach > stock.min[i];
        from.z.min(to.z) < stock.max.z && beside(0) && beside(1)
    };
    // Where axes turn, a line of the program is several moves, and its way is no straight one.
    let pieces = &path.origin.pieces;
    let in_pieces = |k: usize| {
        let behind = pieces.partition_point(|moves| moves.end as usize <= k);
        pieces.get(behind).is_some_and(|moves| moves.contains(&(k as u32)))
    };
    let rapid = |k: &usize| path.moves[*k].kind == MoveKind::Rapid;
    let bends = |k: usize| travels(path, k).len() > 1;
    let counted: Vec<usize> =
        path.counts().enumerate().filter(|(_, counts)| *counts).map(|(k, _)| k).filter(rapid).collect();
    counted.into_iter().filter(|&k| bends(k) && low(k) && !in_pieces(k)).collect()
}

/// The different travels of the axes on a move, mm, the shortest first.
fn travels(path: &Toolpath, k: usize) -> Vec<f64> {
    let by = path.moves[k].to.tip - path.start_of(k);
    let mut travels: Vec<f64> = by.iter().map(|by| by.abs()).filter(|by| *by > SAME_TRAVEL).collect();
    travels.sort_by(f64::total_cmp);
    travels.dedup_by(|a, b| (*a - *b).abs() < SAME_TRAVEL);
    travels
}

/// What is assumed of rapid moves, where that matters.
pub(super) fn note(run: &Run<'_>) -> Option<String> {
    let straight = run.request.foreign()?.straight_rapids?;
    let bending = bending(run);
    let line = run.line(*bending.first()? as u32);
    let (program, number) = (run.path().program_name(), bending.len());
    let how_many =
        if number == 1 { "one of them moves".to_owned() } else { format!("{number} of them move") };
    Some(format!(
        "{program}: rapid moves are taken to run straight. {straight}; else each axis stops where it arrives, and the way is bent. \
         Below the top of the stock {how_many} several axes by different lengths, first in line {line}"
    ))
}

/// The first rapid move that meets stock on its bent way, or may do so.
pub(super) fn first_in_stock(run: &Run<'_>, monitor: &dyn Monitor) -> Result<Option<InStock>, JobError> {
    let path = run.path();
    let bending = bending(run);
    if bending.is_empty() || !matches!(run.view(), View::Heights(_)) {
        return Ok(None);
    }
    let bent = Bent::new(path, run.own_cutters, &bending);
    let asked = |k: usize| bent.is_bent[k].then_some(KeptOut::Cutter);
    let (strays, before) = (path.origin.strays, run.before());
    let found =
        sim::first_in_stock(&whole_stock(run), &before, &bent.cutters, &bent.path, strays, asked, monitor)?;
    Ok(found.map(|found| InStock { move_index: bent.of[found.move_index as usize], ..found }))
}

/// A path whose rapid moves run at one rate of all axes.
struct Bent {
    path: Toolpath,
    cutters: Cutters,
    /// The move of the program that each of its moves is a part of.
    of: Vec<u32>,
    is_bent: Vec<bool>,
}

impl Bent {
    fn new(path: &Toolpath, cutters: &Cutters, bending: &[usize]) -> Self {
        let (mut moves, mut of, mut is_bent): (Vec<Move>, Vec<u32>, Vec<bool>) = Default::default();
        let mut begins = Vec::with_capacity(path.len());
        let mut waiting = bending.iter().copied().peekable();
        for (k, step) in path.moves.iter().enumerate() {
            begins.push(moves.len() as u32);
            let bends = waiting.next_if_eq(&k).is_some();
            let (from, to) = (path.start_of(k), step.to.tip);
            let mut travels = if bends { travels(path, k) } else { Vec::new() };
            // The longest one ends where the move does.
            travels.pop();
            for travel in travels {
                let mut corner = *step;
                for i in 0..3 {
                    corner.to.tip[i] = from[i] + (to[i] - from[i]).clamp(-travel, travel);
                }
                moves.push(corner);
            }
            moves.push(*step);
            of.resize(moves.len(), k as u32);
            is_bent.resize(moves.len(), bends);
        }
        let begin = |first: u32| begins.get(first as usize).copied().unwrap_or(first);
        let others = cutters.each().skip(1);
        let cutters = others
            .fold(Cutters::from(*cutters.first()), |all, (first, cutter)| all.then(begin(first), *cutter));
        Self { path: Toolpath::new(path.start, moves), cutters, of, is_bent }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cutter::Cutter;
    use geometry::Point3;
    use motion::ClPoint;

    #[test]
    fn axes_stop_one_after_the_other() {
        let step = |x: f64, y: f64, z: f64, kind| {
            let to = ClPoint::upright(Point3::new(x, y, z));
            Move { to, kind, feed_rate: 100.0, pass: 0 }
        };
        let moves = vec![
            step(10.0, 0.0, 0.0, MoveKind::Cut),
            step(4.0, 1.0, -3.0, MoveKind::Rapid),
            step(6.0, 3.0, -3.0, MoveKind::Rapid),
        ];
        let path = Toolpath::new(ClPoint::upright(Point3::origin()), moves);
        let (flat, ball) = (Cutter::flat(2.0).unwrap(), Cutter::ball(3.0).unwrap());
        let cutters = Cutters::from(flat).then(2, ball);
        let bending: Vec<usize> = (1..3).filter(|k| travels(&path, *k).len() > 1).collect();
        assert_eq!(bending, [1], "equal travels end together");
        let bent = Bent::new(&path, &cutters, &bending);
        let tips: Vec<[f64; 3]> = bent.path.moves.iter().map(|step| step.to.tip.into()).collect();
        let expected =
            [[10.0, 0.0, 0.0], [9.0, 1.0, -1.0], [7.0, 1.0, -3.0], [4.0, 1.0, -3.0], [6.0, 3.0, -3.0]];
        assert_eq!(tips, expected);
        assert_eq!((bent.of, bent.is_bent), (vec![0, 1, 1, 1, 2], vec![false, true, true, true, false]));
        assert_eq!(bent.cutters, Cutters::from(flat).then(4, ball));
    }
}
