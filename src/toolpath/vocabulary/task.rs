//! What a strategy is asked to cover, with what, and how.

use super::{LevelFunction, Levelled, PassSettings, PlanSettings};
use cutter::Cutter;
use field::ScalarField;
use part::Part;
use work::monitor::Monitor;

/// Everything that a path is planned by, whatever the strategy.
#[derive(Clone, Copy)]
pub(crate) struct Setup<'a> {
    /// What is to be covered.
    pub part: &'a Part,
    /// With what.
    pub cutter: &'a Cutter,
    /// How.
    pub settings: &'a PlanSettings,
    /// Is told how far planning has come, and may cancel it.
    pub monitor: &'a dyn Monitor,
}

/// Everything that planning passes takes: part, cutter, settings, and whom to tell how far it has come.
#[derive(Clone, Copy)]
pub struct Task<'a> {
    /// What is to be covered.
    pub part: &'a Part,
    /// With what.
    pub cutter: &'a Cutter,
    /// How.
    pub settings: PassSettings<'a>,
    /// Whether no smooth surface follows the part (steps, holes, several patches), so that its mesh has to serve.
    pub wants_mesh: bool,
    /// Is told how far planning has come, and may cancel it.
    pub monitor: &'a dyn Monitor,
}

impl<'a> Task<'a> {
    /// The cutter that is dropped: the one that cuts, or a ball in its stead.
    pub fn dropped(&self) -> &'a Cutter {
        self.settings.dropped(self.cutter)
    }

    /// Whether a tilted cutter follows the level curves of a coordinate on patches by its contacts, instead of being dropped.
    pub fn follows_contacts(&self) -> bool {
        self.settings.axis.is_some() && !self.part.patches().is_empty()
    }

    /// What an earlier plan left of one of so many charts or pieces.
    fn earlier(&self, k: usize, of: usize) -> Option<&'a Levelled> {
        self.settings
            .earlier
            .filter(|earlier| earlier.functions.len() == of)
            .map(|earlier| &earlier.functions[k])
    }

    /// The function of an earlier plan on one of so many charts.
    pub fn earlier_on_chart(&self, k: usize, of: usize) -> Option<(&'a ScalarField, &'a Levelled)> {
        let levelled = self.earlier(k, of)?;
        let LevelFunction::Chart(field) = &levelled.function else { return None };
        Some((field, levelled))
    }

    /// The function of an earlier plan on one of so many pieces of mesh.
    pub fn earlier_on_mesh(&self, k: usize, of: usize) -> Option<(&'a [f64], &'a Levelled)> {
        let levelled = self.earlier(k, of)?;
        let LevelFunction::Mesh(values) = &levelled.function else { return None };
        Some((values, levelled))
    }

    /// Whether streamlines are those of the part's mesh, unless they are asked for otherwise.
    pub fn plans_on_mesh(&self) -> bool {
        !self.follows_contacts() && self.settings.probe.is_none() && self.wants_mesh
    }
}
