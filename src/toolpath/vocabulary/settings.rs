//! What every path is planned by: how far passes lie apart, tolerance, heights, rates, and how passes are
//! joined.

use std::sync::Arc;

use super::{Correction, Faces, Kept, Places, PlanError};
use crate::lowering::Lowered;
use geometry::{Aabb, Point2, Point3};
use machine::Machine;

/// How far neighbouring passes lie apart.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Step {
    /// So that the scallop stays below this height, mm.
    Scallop(f64),
    /// This stepover, mm (measured as the strategy steps: in the plan view for zigzag, on the
    /// surface for the others).
    Stepover(f64),
}

/// How the end of a pass and the start of the next are joined.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Links {
    /// Along the surface where that is quicker, else by a retract.
    Surface,
    /// By retracts only.
    Retract,
}

/// How passes become a program.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Joining {
    /// What joins them.
    pub links: Links,
    /// No link on the surface is longer, mm; `None` takes [`LONGEST_LINK`](crate::LONGEST_LINK) intervals.
    pub longest_link: Option<f64>,
    /// Whether the points of each pass are smoothed and spread within the chord tolerance.
    pub smoothing: bool,
}

impl Default for Joining {
    fn default() -> Self {
        Self { links: Links::Retract, longest_link: None, smoothing: false }
    }
}

/// What every strategy needs to know besides part and cutter.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanSettings {
    /// Distance of passes.
    pub step: Step,
    /// Largest distance between the straight moves and the exact path, mm.
    pub chord_tolerance: f64,
    /// Height of rapid moves above the highest point of part and stock, mm.
    pub clearance: f64,
    /// Highest point of the stock, mm.
    pub stock_top: f64,
    /// The stock as a block, mm: between passes a tool that leans goes around it. `None`
    /// where it is as wide as the part, and reaches from the part's lowest point to `stock_top`.
    pub stock: Option<Aabb>,
    /// Whether an upright tool may come down beside `stock`: nothing else stands there, and it is known to be
    /// no wider.
    pub may_enter_beside: bool,
    /// Feed along passes, mm/min.
    pub feed_rate: f64,
    /// Feed down to a pass, mm/min.
    pub plunge_rate: f64,
    /// The machine: its rapid rate decides between links on the surface and retracts, and machining times are
    /// its own.
    pub machine: Machine,
    /// How passes are smoothed and joined.
    pub joining: Joining,
    /// Which faces are to have passes.
    pub faces: Faces,
    /// Where else passes of an upright tool are to be.
    pub places: Places,
    /// How far levels lie apart at most, mm, where an upright tool goes down from the top of the stock by
    /// levels; `None` cuts all in one step down.
    pub stepdown: Option<f64>,
    /// What an upright tool leaves on the part everywhere, mm.
    pub allowance: f64,
    /// Whether what chords leave above the scallop height is measured and moves beside it go deeper then
    /// ([`Earlier::lowered`]): passes lie as far apart as if chords raised nothing.
    pub is_lowered_later: bool,
    /// What the tables of a plan may take beside its path, bytes; less makes them coarser.
    pub memory: u64,
    /// What an earlier plan of the same toolpath left.
    pub earlier: Option<Arc<Earlier>>,
}

impl PlanSettings {
    /// Refuses numbers by which no path can be planned.
    pub(crate) fn check(&self) -> Result<(), PlanError> {
        let check = |setting, value: f64, wanted, is_in_range| match is_in_range && value.is_finite() {
            true => Ok(()),
            false => Err(PlanError::Setting { setting, value, wanted }),
        };
        let above = |setting, value| check(setting, value, "above 0", value > 0.0);
        let from = |setting, value| check(setting, value, "0 or more", value >= 0.0);
        match self.step {
            Step::Scallop(height) => above("scallop height", height)?,
            Step::Stepover(stepover) => above("stepover", stepover)?,
        }
        above("chord tolerance", self.chord_tolerance)?;
        above("feed", self.feed_rate)?;
        above("feed down", self.plunge_rate)?;
        self.stepdown.map_or(Ok(()), |stepdown| above("stepdown", stepdown))?;
        from("clearance", self.clearance)?;
        from("allowance", self.allowance)?;
        self.joining.longest_link.map_or(Ok(()), |longest| from("longest link", longest))?;
        check("top of the stock", self.stock_top, "a finite number", true)
    }
}

/// What a plan begins from that is made for the same toolpath once more.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Earlier {
    /// By what passes spaced for a scallop lie wider or narrower than by calculation.
    pub correction: Correction,
    /// Places beside which moves of an upright cutter go a little deeper, round after round, where its passes
    /// stay as they are.
    pub lowered: Vec<Vec<Lowered>>,
    /// Places on the design over which passes of their own are added, the most needed first.
    pub touch_up: Vec<Point3>,
    /// Lines in the plan view, mm, along which the cutter stands on the part at more than one place: each gets a
    /// pass of its own; a line of one place is served as the places above are.
    pub creases: Vec<Vec<Point2>>,
    /// What its strategy planned: levels of its functions are placed anew.
    pub kept: Arc<Kept>,
    /// Whether functions that were searched may be gone on with by these factors: many places are narrower.
    pub anew: bool,
    /// Whether its passes stay as they are: they were planned by the same factors, and only passes of their
    /// own are added.
    pub again: bool,
}

/// The scallop height that passes are planned for by default, mm: what finishing of moulds and dies leaves.
const SCALLOP: f64 = 0.01;

/// The chord tolerance by default, mm: a tenth of the scallop, so that ridges are those of passes. A greater
/// one shows facets, a lesser one makes programs longer as its inverse root.
const CHORD_TOLERANCE: f64 = 0.001;

/// The clearance of rapid moves by default, mm: more than clamps and burrs bring stock out of place, and
/// little air.
const CLEARANCE: f64 = 2.0;

/// The feed along passes by default, mm/min: one that a ball of 6 mm takes in steel.
const FEED_RATE: f64 = 1000.0;

/// The feed down to a pass by default, mm/min: a third or less of the feed along it, since the tip of a
/// cutter hardly cuts.
const PLUNGE_RATE: f64 = 300.0;

/// What tables may take by default, bytes: more makes none finer.
const MEMORY: u64 = 2 << 30;

impl Default for PlanSettings {
    /// Finishing by scallop height under stock whose highest point is at z = 0: set `stock_top` where stock
    /// is higher, or rapid moves run through it.
    fn default() -> Self {
        Self {
            step: Step::Scallop(SCALLOP),
            chord_tolerance: CHORD_TOLERANCE,
            clearance: CLEARANCE,
            stock_top: 0.0,
            stock: None,
            may_enter_beside: false,
            feed_rate: FEED_RATE,
            plunge_rate: PLUNGE_RATE,
            machine: Machine::default(),
            joining: Joining::default(),
            faces: Faces::default(),
            places: Places::default(),
            stepdown: None,
            allowance: 0.0,
            is_lowered_later: false,
            memory: MEMORY,
            earlier: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Zigzag, plan};
    use cutter::Cutter;
    use geometry::{AnalyticShape, AnalyticSurface};
    use part::{Part, Patch};
    use work::monitor::Silent;

    #[test]
    fn settings_by_which_no_path_can_be_planned_are_refused() {
        let plane =
            AnalyticSurface::new(AnalyticShape::Plane { height: 0.0 }, [[0.0, 6.0], [0.0, 2.0]]).unwrap();
        let part = Part::from_patches(vec![Patch::Analytic(plane)], 0.01).unwrap();
        let planned = |change: &dyn Fn(&mut PlanSettings)| {
            let mut settings = PlanSettings { stock_top: 1.0, ..PlanSettings::default() };
            change(&mut settings);
            plan(&part, &Cutter::ball(6.0).unwrap(), &Zigzag::at(0.0), &settings, &Silent)
        };
        type Set = fn(&mut PlanSettings, f64);
        let above: [(&str, Set); 6] = [
            ("scallop height", |s, x| s.step = Step::Scallop(x)),
            ("stepover", |s, x| s.step = Step::Stepover(x)),
            ("chord tolerance", |s, x| s.chord_tolerance = x),
            ("feed", |s, x| s.feed_rate = x),
            ("feed down", |s, x| s.plunge_rate = x),
            ("stepdown", |s, x| s.stepdown = Some(x)),
        ];
        let or_none: [(&str, Set); 3] = [
            ("clearance", |s, x| s.clearance = x),
            ("allowance", |s, x| s.allowance = x),
            ("longest link", |s, x| s.joining.longest_link = Some(x)),
        ];
        let top: [(&str, Set); 1] = [("top of the stock", |s, x| s.stock_top = x)];
        let wrong = |name: &str, set: Set, value: f64| {
            let refused = planned(&|settings| set(settings, value)).err();
            let is_named = matches!(&refused, Some(PlanError::Setting { setting, .. }) if *setting == name);
            assert!(is_named, "{name} {value}: {refused:?}");
        };
        for (name, set) in above.into_iter().chain(or_none).chain(top) {
            [f64::NAN, f64::INFINITY].into_iter().for_each(|value| wrong(name, set, value));
        }
        above.into_iter().for_each(|(name, set)| wrong(name, set, 0.0));
        above.into_iter().chain(or_none).for_each(|(name, set)| wrong(name, set, -1.0));
        assert!(or_none.into_iter().all(|(_, set)| planned(&|settings| set(settings, 0.0)).is_ok()));
    }
}
