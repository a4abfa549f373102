//! Cycles over holes (G73, G74, G76, G81 to G89) as the moves that a control makes of them.
//!
//! A cycle moves over the hole, down to the retract plane R, down at feed as its kind has it, and up to the
//! plane that G98 or G99 names. Bottom, R and Q stay for the holes that follow. In G91, R counts from the
//! level before the first cycle and the bottom from R.

use crate::control::{Cycle, Down};
use crate::error::{Fault, Stop};
use crate::frame::Place;
use crate::interpret::{AXES, Interpreter};
use crate::program::StepKind;

/// Most repeats of a cycle.
const MOST_REPEATS: f64 = 1e6;

/// Cycles that do not stand at the bottom, whatever P is from the cycle before.
const WITHOUT_DWELL: [u16; 2] = [81, 85];

/// Most pecks of a hole; more are a mistake of units.
const MOST_PECKS: f64 = 1e5;

/// The levels of a hole, in the program's coordinates.
#[derive(Clone, Copy)]
struct Levels {
    /// The axis across the plane.
    w: usize,
    retract: f64,
    bottom: f64,
    /// Where the tool goes when the hole is done.
    clear: f64,
    peck: Option<f64>,
    feed: f64,
}

impl Interpreter<'_> {
    /// Runs the cycle in force at the places of a block.
    pub fn cycle(&mut self, cycle: Cycle) -> Result<(), Stop> {
        let [u, v, w] = self.plane_axes();
        let absolute = self.state.modal.absolute;
        let mut level = self.state.at[w];
        let initial = *self.state.sticky.level.get_or_insert(level);
        let column = self.block.column(AXES[w]);
        let repeats = self.repeats()?;
        let levels = self.levels(cycle, w, initial)?;
        // G87 goes down to R first, and feeds up to Z.
        let back = cycle.down == Down::Back;
        if (levels.bottom > levels.retract) != back {
            let Levels { bottom, retract, .. } = levels;
            return Err(Stop::new(column, Fault::CycleUpward { retract, bottom }));
        }
        let mut hole = self.state.at;
        let rotary = self.target_of(&[3, 4, 5])?;
        hole[3..].copy_from_slice(&rotary[3..]);
        let to = self.target_of(&[u, v])?;
        let by = [to[u] - hole[u], to[v] - hole[v]];
        if repeats == 0 {
            return Ok(());
        }
        let clear =
            if self.state.modal.initial || back { initial.max(levels.retract) } else { levels.retract };
        let by_level = self.control.cycles_by_level;
        let before = if by_level { initial } else { level };
        if before < levels.retract && !back {
            self.go_to_level(StepKind::Rapid, w, levels.retract, 0.0)?;
            level = levels.retract;
        }
        if by_level && level <= levels.retract {
            level = clear;
        }
        for round in 0..repeats {
            let count = f64::from(if absolute { 1 } else { round + 1 });
            let mut over: Place = hole;
            (over[u], over[v], over[w]) = (hole[u] + count * by[0], hole[v] + count * by[1], level);
            self.go(StepKind::Rapid, over)?;
            if !back {
                self.go_to_level(StepKind::Rapid, w, levels.retract, 0.0)?;
            }
            self.hole(cycle, &Levels { clear, ..levels })?;
            level = clear;
        }
        Ok(())
    }

    /// The block's words, and what stayed from the cycle before.
    fn levels(&mut self, cycle: Cycle, w: usize, initial: f64) -> Result<Levels, Stop> {
        let modal = self.state.modal;
        let above = |level: f64| if modal.absolute { 0.0 } else { level };
        let words_stay = self.control.cycle_words_stay;
        let mut taken = |letter: u8| self.block.take(letter).map(|x| x * modal.unit);
        let (z, r, q) = (taken(AXES[w]), taken(b'R'), taken(b'Q'));
        if modal.absolute && (z.is_some() || r.is_some()) {
            self.check_offset(w)?;
        }
        let shifts = matches!(cycle.down, Down::Back) || cycle.code == 76;
        let mut taken = |letter: u8| self.block.take(letter).map(|x| x * modal.unit);
        let aside = if shifts { [taken(b'I'), taken(b'J')] } else { [None; 2] };
        self.state.sticky.dwell = self.dwell_word()?.unwrap_or(self.state.sticky.dwell);
        let sticky = &mut self.state.sticky;
        let code = format!("G{}", cycle.code);
        let missing = |words| Stop::new(0, Fault::Missing { code: code.clone(), words });
        sticky.retract = r.map(|r| if words_stay { r } else { r + above(initial) }).or(sticky.retract);
        let retract = sticky.retract.ok_or_else(|| missing("R, the retract plane"))?;
        let retract = if words_stay { retract + above(initial) } else { retract };
        sticky.bottom = z.map(|z| if words_stay { z } else { z + above(retract) }).or(sticky.bottom);
        let bottom = sticky.bottom.ok_or_else(|| missing("the depth of the hole (Z under G17)"))?;
        let bottom = if words_stay { bottom + above(retract) } else { bottom };
        if let Some(q) = q {
            if q == 0.0 && cycle.down != Down::Once || !q.is_finite() {
                return Err(self.value(b'Q', q, "a depth"));
            }
            self.state.sticky.peck = Some(q.abs());
        }
        let sticky = &mut self.state.sticky;
        if shifts {
            let by_q = if aside.iter().all(Option::is_none) { sticky.peck } else { None };
            sticky.aside = [aside[0].or(by_q).unwrap_or(sticky.aside[0]), aside[1].unwrap_or(0.0), 0.0];
        }
        let peck = sticky.peck;
        if matches!(cycle.down, Down::Pecks | Down::Breaks) && peck.is_none() {
            return Err(missing("Q, the depth of a peck"));
        }
        let feed = self.feed((retract - bottom).abs())?;
        Ok(Levels { w, retract, bottom, clear: retract, peck, feed })
    }

    /// How often the cycle runs, by the letter that the control has for it.
    fn repeats(&mut self) -> Result<u32, Stop> {
        let (letters, fewest) = self.control.cycle_repeats;
        let Some(letter) = letters.iter().copied().find(|letter| self.block.peek(*letter).is_some()) else {
            return Ok(1);
        };
        let value = self.block.take(letter).unwrap_or(1.0);
        self.whole(letter, value, f64::from(fewest)..=MOST_REPEATS, "a number of repeats")
    }

    /// Where the block leads along some axes only.
    fn target_of(&mut self, axes: &[usize]) -> Result<Place, Stop> {
        let all = self.target()?;
        let mut to = self.state.at;
        axes.iter().for_each(|k| to[*k] = all[*k]);
        Ok(to)
    }

    fn go_to_level(&mut self, kind: StepKind, w: usize, level: f64, feed: f64) -> Result<(), Stop> {
        let mut to = self.state.at;
        to[w] = level;
        self.fed(kind, to, feed)
    }

    /// From the retract plane down and up again.
    fn hole(&mut self, cycle: Cycle, levels: &Levels) -> Result<(), Stop> {
        let Levels { w, retract, bottom, clear, feed, .. } = *levels;
        if cycle.down == Down::Back {
            return self.back(levels);
        }
        if let (Down::Pecks | Down::Breaks, Some(peck)) = (cycle.down, levels.peck) {
            self.pecks(cycle.down, levels, peck)?;
        }
        self.go_to_level(StepKind::Feed, w, bottom, feed)?;
        if !WITHOUT_DWELL.contains(&cycle.code) {
            self.out.dwell(self.state.sticky.dwell);
        }
        if cycle.code == 76 {
            self.aside(1.0)?;
        }
        if cycle.feeds_up {
            let to = if self.control.cycles_by_level && cycle.code == 89 { clear } else { retract };
            self.go_to_level(StepKind::Feed, w, to, feed)?;
        }
        self.go_to_level(StepKind::Rapid, w, clear, 0.0)?;
        if cycle.code == 76 {
            self.aside(-1.0)?;
        }
        Ok(())
    }

    fn pecks(&mut self, down: Down, levels: &Levels, peck: f64) -> Result<(), Stop> {
        let Levels { w, retract, bottom, feed, .. } = *levels;
        if (retract - bottom) / peck > MOST_PECKS {
            return Err(self.value(b'Q', peck, "a depth of a peck that gets to the bottom"));
        }
        let clearance = self.control.peck_clearance;
        let mut depth = retract - peck;
        while depth > bottom {
            self.go_to_level(StepKind::Feed, w, depth, feed)?;
            if down == Down::Pecks {
                self.go_to_level(StepKind::Rapid, w, retract, 0.0)?;
            }
            self.go_to_level(StepKind::Rapid, w, depth + clearance, 0.0)?;
            depth -= peck;
        }
        Ok(())
    }

    /// G87: aside, down past the hole, back, and up at feed.
    fn back(&mut self, levels: &Levels) -> Result<(), Stop> {
        let Levels { w, retract, bottom, clear, feed, .. } = *levels;
        self.aside(1.0)?;
        self.go_to_level(StepKind::Rapid, w, retract, 0.0)?;
        self.aside(-1.0)?;
        self.go_to_level(StepKind::Feed, w, bottom, feed)?;
        self.aside(1.0)?;
        self.go_to_level(StepKind::Rapid, w, clear, 0.0)?;
        self.aside(-1.0)
    }

    /// Moves away from the wall of the hole, or back.
    fn aside(&mut self, sense: f64) -> Result<(), Stop> {
        let [u, v, _] = self.plane_axes();
        let by = self.state.sticky.aside;
        let mut to = self.state.at;
        to[u] += sense * by[0];
        to[v] += sense * by[1];
        self.go(StepKind::Rapid, to)
    }
}
