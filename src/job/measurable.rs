//! What an engine cannot measure is refused before anything is planned.

use metrology::Engine;
use scene::ToolpathRequest;
use sim::Stock;

use super::earlier::EarlierPath;
use super::{JobError, Session};

/// How a toolpath behind others is measured where its engine, its axis or the solid asks for it.
const OWN_BLOCK: &str = "measured on a block of its own: delete `stock`, or measure on cells (`engine = \"zmap\"`, without \
                         `voxel` and `axis`)";

impl Session {
    /// Refuses a toolpath that its engine cannot measure in the stock of the scene, with its tools or behind
    /// `earlier` ones.
    pub(crate) fn refuse_unmeasured(
        &self,
        request: &ToolpathRequest,
        earlier: &[EarlierPath],
        engine: &dyn Engine,
    ) -> Result<(), JobError> {
        if !matches!(self.stock, Stock::Box(_) | Stock::Milled { .. }) {
            let block = "measured in a block: write `corners` in [stock], or nothing";
            self.seen_from_above(request, engine, block)?;
        }
        if self.tools(request).0.are_several() {
            let one = "measured with one tool at a time: write `tool = 2` (verify: --tool 2) for tool 2";
            self.on_cells(request, engine, one)?;
        }
        if !earlier.is_empty() {
            self.on_cells(request, engine, OWN_BLOCK)?;
        }
        Ok(())
    }

    /// Refuses a toolpath that cuts what another one left, where that cannot be measured: it is known before
    /// the other one is planned.
    pub(crate) fn refuse_behind_others(&self, request: &ToolpathRequest) -> Result<(), JobError> {
        match request.stock_is_previous {
            true => self.on_cells(request, self.engine(request)?, OWN_BLOCK),
            false => Ok(()),
        }
    }

    /// Refuses what is not measured on cells under upright tools; `otherwise` is how it is.
    fn on_cells(
        &self,
        request: &ToolpathRequest,
        engine: &dyn Engine,
        otherwise: &str,
    ) -> Result<(), JobError> {
        self.seen_from_above(request, engine, otherwise)?;
        if self.scene.simulation.voxel.is_none() {
            return Ok(());
        }
        let what = "the solid of `voxel` in [simulation] is";
        Err(self.not_applicable(request, format!("{what} {otherwise}")))
    }

    /// Refuses what is not measured as heights; `otherwise` is how it is.
    fn seen_from_above(
        &self,
        request: &ToolpathRequest,
        engine: &dyn Engine,
        otherwise: &str,
    ) -> Result<(), JobError> {
        let what = match () {
            () if request.tilts() => "what tools that lean leave is".to_owned(),
            () if self.pocket.is_some() => "the floor of a pocket is".to_owned(),
            () if engine.tilts() => format!("with the engine `{}` a toolpath is", engine.word()),
            () => return Ok(()),
        };
        Err(self.not_applicable(request, format!("{what} {otherwise}")))
    }
}
