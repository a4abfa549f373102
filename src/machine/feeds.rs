//! Feeds in the program where the machine cannot hold the programmed one: sharp corners, tight bends, sudden
//! curvature.
//!
//! Enters: a path and the machine's limits. Leaves: the same path with lower feeds on some moves, for
//! controls that look ahead too little and for people who read programs. The speeds are the limits by which
//! machining time is told ([`super::time`]), rounded up to a series of feeds, so that the words are few and
//! slow the model down nowhere but at sharp corners. There the last and the first piece of the way, as long
//! as braking takes, are moves of their own at the corner's speed. Where the tool turns back on its way that
//! speed is zero, which no word can ask for: none is below [`Machine::creep_feed`], but for feeds that are
//! lower from the start.

use super::Machine;
use super::time::{Block, profile};
use motion::{ClPoint, Move, MoveKind, Toolpath};

/// Each feed of the series over the next lower one. Closer feeds make more F words, wider ones leave more
/// of the braking to the control.
const SERIES: f64 = 1.1;

/// A corner that turns by more than this, rad, is sharp: it is run at its own feed from a little before
/// until a little after.
const SHARP: f64 = std::f64::consts::PI / 6.0;

/// A corner that can be run at this share of the feed needs no moves of its own.
const HARDLY_SLOWER: f64 = 0.9;

/// Lines a second that no path asks for.
pub(super) const ANY_RATE: f64 = 1e12;

const SECONDS_PER_MINUTE: f64 = 60.0;

/// The path with feeds that the machine can hold. Rapids, plunges and lifts stay as they are; the tool's
/// way does as well, but for points put in on straight moves. A path for which no time can be told comes
/// back unchanged.
pub fn slow_corners(path: &Toolpath, machine: &Machine) -> Toolpath {
    // Words that slow down what is short anyway would only be more lines to run.
    let machine = &Machine { block_rate: ANY_RATE, ..*machine };
    let Some(blocks) = profile(path, machine) else { return path.clone() };
    let mut moves = Vec::with_capacity(path.len());
    let mut next = blocks.iter().enumerate().peekable();
    for (k, step) in path.moves.iter().enumerate() {
        let Some((at, block)) = next.next_if(|(_, block)| block.step == k) else {
            moves.push(*step);
            continue;
        };
        if !step.kind.is_on_surface() {
            moves.push(*step);
            continue;
        }
        let sharp = |corner: Option<&Block>, other: Option<MoveKind>| {
            let corner = corner.filter(|_| other.is_some_and(MoveKind::is_on_surface))?;
            let slow = HARDLY_SLOWER * block.feed;
            (corner.turn > SHARP && corner.corner < slow * slow).then_some(corner.corner)
        };
        let kind = |block: &Block| path.moves[block.step].kind;
        // Starting and braking to a stop is left to the control: words for it would change with each move.
        let free = block.feed * block.feed;
        let limits =
            [if at > 0 { block.corner } else { free }, blocks.get(at + 1).map_or(free, |next| next.corner)];
        let peak = block.peak(limits, machine.acceleration).sqrt();
        let before = at.checked_sub(1).map(|k| kind(&blocks[k]));
        let after = blocks.get(at + 1);
        let ends = [sharp(Some(block), before), sharp(after, after.map(kind))];
        slowed(&mut moves, path.location_before(k), step, block, peak, ends, machine);
    }
    Toolpath::new(path.start, moves)
}

/// Appends a move that reaches the speed `peak`, with the squared speeds of its sharp ends.
fn slowed(
    moves: &mut Vec<Move>,
    from: ClPoint,
    step: &Move,
    block: &Block,
    peak: f64,
    ends: [Option<f64>; 2],
    machine: &Machine,
) {
    let word = |speed: f64| {
        let least = (machine.creep_feed() / SECONDS_PER_MINUTE).min(block.feed);
        in_series(speed.max(least), block.feed) * SECONDS_PER_MINUTE
    };
    let feed = word(peak);
    let feed = if feed < step.feed_rate { feed } else { step.feed_rate };
    // As far as braking from the feed to the corner takes.
    let zone = |corner: f64| (block.feed * block.feed - corner).max(0.0) / (2.0 * machine.acceleration);
    let zones = ends.map(|corner| corner.map_or(0.0, zone));
    let mut push = |at: f64, feed_rate: f64| {
        let to = if at < block.length { from.towards(&step.to, at / block.length) } else { step.to };
        moves.push(Move { to, feed_rate, ..*step });
    };
    if zones[0] + zones[1] >= block.length {
        return push(block.length, feed);
    }
    if let Some(corner) = ends[0] {
        push(zones[0], word(corner.sqrt()).min(feed));
    }
    push(block.length - zones[1], feed);
    if let Some(corner) = ends[1] {
        push(block.length, word(corner.sqrt()).min(feed));
    }
}

/// The least feed of the series that goes down from `feed` which is no lower than `speed`, mm/s.
pub(super) fn in_series(speed: f64, feed: f64) -> f64 {
    if speed >= feed {
        return feed;
    }
    // A hair more steps down than rounding could take off.
    let steps = ((feed / speed).ln() / SERIES.ln() - 1e-9).floor().max(0.0);
    feed / SERIES.powf(steps)
}

#[cfg(test)]
mod tests {
    use super::super::fixture::{machine, path, seconds};
    use super::*;
    use geometry::Point3;
    use proptest::prelude::*;

    const MACHINE: Machine = machine(50_000.0);

    #[test]
    fn a_right_angle_is_run_at_its_own_feed() {
        let square = path([[0.0; 3], [50.0, 0.0, 0.0], [50.0, 50.0, 0.0]]);
        let slow = slow_corners(&square, &MACHINE);
        let c = 0.5f64.sqrt();
        let corner: f64 = 10.0 * c / (1.0 - c);
        // From 100 mm/s: (v² − corner)/2a before and after.
        let zone = (1e4 - corner) / 2000.0;
        let tips: Vec<Point3> = slow.moves.iter().map(|m| m.to.tip).collect();
        let expected = [[50.0 - zone, 0.0], [50.0, 0.0], [50.0, zone], [50.0, 50.0]];
        for (tip, [x, y]) in tips.iter().zip(expected) {
            assert!((tip - Point3::new(x, y, 0.0)).norm() < 1e-12, "{tip}");
        }
        let feeds: Vec<f64> = slow.moves.iter().map(|m| m.feed_rate).collect();
        assert_eq!((feeds[0], feeds[3]), (6000.0, 6000.0));
        assert_eq!(feeds[1], feeds[2]);
        let exact = 60.0 * corner.sqrt();
        assert!(feeds[1] >= exact && feeds[1] < exact * SERIES * (1.0 + 1e-9), "{} {exact}", feeds[1]);
    }

    #[test]
    fn an_arc_gets_the_feed_of_its_radius_and_a_line_its_own() {
        let angle = |k: u32| f64::from(k) * 1e-3;
        let arc = (0..=6000).map(|k| [2.0 * angle(k).cos(), 2.0 * angle(k).sin(), 0.0]);
        let slow = slow_corners(&path(arc), &MACHINE);
        let exact = 60.0 * (1000.0f64 * 2.0).sqrt();
        let feed = slow.moves[3000].feed_rate;
        assert!(feed >= exact && feed < exact * SERIES * 1.001, "{feed} {exact}");
        let line = path([[0.0; 3], [100.0, 0.0, 0.0]]);
        assert_eq!(slow_corners(&line, &MACHINE), line);
        let mut words: Vec<f64> = slow.moves.iter().map(|m| m.feed_rate).collect();
        words.dedup();
        assert!(words.len() < 20, "{words:?}");
    }

    #[test]
    fn a_way_back_is_run_no_slower_than_the_machine_creeps() {
        let speck = 3.6e-15;
        let ways: [&[[f64; 3]]; 3] = [
            &[[0.0; 3], [30.0, 0.0, 0.0], [0.0; 3]],
            // What rounding leaves of a move, across the way.
            &[[0.0; 3], [30.0, 0.0, 0.0], [30.0, speck, 0.0], [60.0, 0.0, 0.0]],
            &[[0.0; 3], [2e-6, 0.0, 0.0], [0.0; 3], [2e-6, 0.0, 0.0], [9.0, 0.0, 0.0]],
        ];
        for way in ways {
            let path = path(way.iter().copied());
            let slow = slow_corners(&path, &MACHINE);
            let least = slow.moves.iter().map(|m| m.feed_rate).fold(f64::INFINITY, f64::min);
            assert!(least >= MACHINE.creep_feed() * (1.0 - 1e-9), "{least} in {way:?}");
            // A zone is as long as braking takes: at its word it lasts no longer than that of the sharpest
            // corner by far.
            let (before, after) = (seconds(&path, &MACHINE), seconds(&slow, &MACHINE));
            assert!(after < before + 10.0 && after >= before * (1.0 - 1e-9), "{before} {after}");
        }
    }

    proptest! {
        /// Without sharp corners the words follow what the machine does by itself.
        #[test]
        fn words_change_no_time_but_at_sharp_corners(
            turns in prop::collection::vec((-0.5..0.5f64, 0.01..3.0f64), 1..60),
            rate in 100.0..20_000.0f64,
        ) {
            let (mut heading, mut at) = (0.0f64, [0.0; 3]);
            let mut tips = vec![at];
            for (turn, length) in turns {
                heading += turn;
                at = [at[0] + length * heading.cos(), at[1] + length * heading.sin(), 0.0];
                tips.push(at);
            }
            let mut path = path(tips);
            path.moves.iter_mut().for_each(|m| m.feed_rate = rate);
            let slow = slow_corners(&path, &MACHINE);
            prop_assert_eq!(slow.len(), path.len());
            prop_assert!(slow.moves.iter().all(|m| m.feed_rate <= rate && m.feed_rate > 0.0));
            let (before, after) = (seconds(&path, &MACHINE), seconds(&slow, &MACHINE));
            prop_assert!((before / after - 1.0).abs() < 1e-9, "{} {}", before, after);
        }
    }
}
