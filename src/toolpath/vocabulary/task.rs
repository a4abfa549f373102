//! What a strategy is asked to cover, with what, and how.

use super::{LevelFunction, Levelled, PassSettings, Passes, PlanError, PlanSettings};
use crate::surface::mesh_surface::fills_its_rectangle;
use cutter::Cutter;
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

/// How quick the machine is.
#[derive(Clone, Copy)]
pub struct Pace<'a> {
    /// The time, s, that it takes for passes once they are joined by links of a chord tolerance, mm.
    pub duration: &'a (dyn Fn(&Passes, f64) -> Result<f64, PlanError> + Sync),
    /// What a link to a neighbouring pass takes, in mm of pass at the feed.
    pub link: f64,
    /// The least radius of a bend that it runs at the feed, mm.
    pub bend: f64,
}

impl Pace<'_> {
    /// How many mm of pass at the feed a mm along a surface of some curvature takes more than one, where the
    /// cutter's centre, `radius` mm off the surface, follows a tighter bend than the machine runs at the
    /// feed: its speed falls as the root of the bend's radius.
    pub fn slowed(&self, curvature: f64, radius: f64) -> f64 {
        let bend = self.bend * curvature.abs() / (1.0 - curvature * radius).abs().max(f64::MIN_POSITIVE);
        (bend.sqrt() - 1.0).max(0.0)
    }
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
    /// Whether no smooth surface follows the part (steps, holes, several patches), so that its mesh has to
    /// serve.
    pub wants_mesh: bool,
    /// How quick the machine is.
    pub pace: Pace<'a>,
    /// Is told how far planning has come, and may cancel it.
    pub monitor: &'a dyn Monitor,
}

impl<'a> Task<'a> {
    /// The cutter that is dropped: the one that cuts, or a ball in its stead.
    pub fn dropped(&self) -> &'a Cutter {
        self.settings.dropped(self.cutter)
    }

    /// Whether a tilted cutter follows the level curves of a coordinate on patches by its contacts, instead
    /// of being dropped.
    pub fn follows_contacts(&self) -> bool {
        self.settings.axis.is_some() && !self.part.patches().is_empty()
    }

    /// What an earlier plan left of one of so many charts or pieces.
    fn earlier(&self, k: usize, of: usize) -> Option<&'a Levelled> {
        self.settings
            .earlier
            .filter(|earlier| earlier.kept.functions.len() == of)
            .map(|earlier| &earlier.kept.functions[k])
    }

    /// The function of an earlier plan on one of so many charts.
    pub fn earlier_on_chart(&self, k: usize, of: usize) -> Option<&'a Levelled> {
        self.earlier(k, of).filter(|levelled| matches!(levelled.function, LevelFunction::Chart(_)))
    }

    /// The function of an earlier plan on one of so many pieces of mesh.
    pub fn earlier_on_mesh(&self, k: usize, of: usize) -> Option<&'a Levelled> {
        self.earlier(k, of).filter(|levelled| matches!(levelled.function, LevelFunction::Mesh(_)))
    }

    /// Whether streamlines are those of the part's mesh, unless they are asked for otherwise.
    pub fn plans_on_mesh(&self) -> bool {
        (self.wants_mesh && self.mesh_serves()) || self.leaves_its_rectangle()
    }

    /// Whether the part is a mesh beside which lies a part of its chart, so that passes keep to its triangles.
    pub fn leaves_its_rectangle(&self) -> bool {
        self.mesh_serves() && !fills_its_rectangle(self.part)
    }

    /// Whether the cutter that is planned for can follow levels on a mesh.
    fn mesh_serves(&self) -> bool {
        !self.follows_contacts() && self.settings.probe.is_none()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Along an arc of radius ρ a machine of acceleration a runs at √(a ρ) mm/s.
    #[test]
    fn a_tight_bend_takes_as_much_longer_as_the_machine_is_slower_there() {
        let (feed, acceleration, cutter): (f64, f64, f64) = (50.0, 1000.0, 0.05);
        let pace = Pace { duration: &|_, _| Ok(0.0), link: 0.0, bend: feed * feed / acceleration };
        for radius in [0.1, 0.7, 2.0] {
            // Of surfaces, convex and concave, over which the centre's way has this radius.
            for curvature in [-1.0 / (radius - cutter), 1.0 / (radius + cutter)] {
                let slower = feed / (acceleration * radius).sqrt() - 1.0;
                assert!((pace.slowed(curvature, cutter) - slower).abs() < 1e-12, "{radius} {curvature}");
            }
        }
        assert_eq!(pace.slowed(1.0 / (2.6 + cutter), cutter), 0.0);
        assert_eq!(pace.slowed(0.0, cutter), 0.0);
    }
}
