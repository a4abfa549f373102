//! What an engine is given, and what it leaves.

use cutter::{Holder, Solid};
use geometry::Aabb;
use motion::{Cutters, Toolpath};
use part::Part;
use sim::{Grid, Rays, Stock, ZMap};
use work::monitor::{Cancelled, Monitor};

use super::{Budget, EngineChoice, LaidOut};
use crate::{Facing, Judged, Limits, Measurement, NormalMap};

/// How the stock is simulated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Simulation {
    /// Pitch of the cells, mm.
    pub cell: f64,
    /// True when the scene leaves the cell to the program (`"auto"`, or no word about it), which may
    /// then make it coarser to fit into the memory.
    pub cell_is_auto: bool,
    /// Memory that one simulation may take, MiB.
    pub memory_mib: u32,
    /// Which engine cuts.
    pub engine: EngineChoice,
    /// Whether the stock is also cut in the order of the program, for what each move removes.
    pub removal: bool,
    /// Error bound that is asked of the highest scallop, the deepest gouge and the highest uncut place, mm.
    pub error_bound: f64,
    /// Voxel of the solid that is left, mm, where it is asked for.
    pub voxel: Option<f64>,
}

/// A path to cut and a part to measure against.
#[derive(Debug, Clone, Copy)]
pub struct Task<'a> {
    /// What is to be made.
    pub part: &'a Part,
    /// What cuts; paths that lean have one.
    pub cutters: &'a Cutters,
    /// What holds the cutter of a path that leans; it ends the cutter's edges.
    pub holder: Option<&'a Holder>,
    /// How it moves.
    pub path: &'a Toolpath,
    /// What there is before the first cut.
    pub stock: &'a Stock,
    /// The cells over the stock that were laid out before there was a path.
    pub cells: &'a LaidOut,
    /// What is tolerated.
    pub limits: &'a Limits,
    /// How it is simulated.
    pub simulation: &'a Simulation,
    /// Whether the part is the floor of a pocket, which ends where the cutter's bottom does.
    pub pocket: bool,
    /// What it may take.
    pub budget: Budget,
    /// What of the part is judged.
    pub judged: Judged,
    /// Whether finer cells follow where this measurement leaves a limit open.
    pub is_first_look: bool,
    /// A gouge that is shown to be no deeper than this, mm, need not be known as closely as the simulation is
    /// asked for; 0 where all are to be.
    pub allowed_depth: f64,
}

impl<'a> Task<'a> {
    /// The block around the stock, mm. It ends at the part's lowest place.
    pub fn block(&self) -> Aabb {
        let Aabb { mut min, max } = self.stock.bounds();
        min.z = self.part.bounds().min.z;
        Aabb { min, max }
    }

    /// The stock on cells, before the first cut.
    ///
    /// # Errors
    /// When cancelled.
    pub fn uncut(&self, grid: Grid, monitor: &dyn Monitor) -> Result<ZMap, Cancelled> {
        /// Cells without stock are this much lower than any tip, mm.
        const BELOW: f64 = 1.0;
        let lowest = self.path.moves.iter().map(|step| step.to.tip.z).fold(self.block().min.z, f64::min);
        ZMap::of_stock(grid, self.stock, lowest - BELOW, monitor)
    }

    /// Whether cells measure vertical walls as well: those of a mesh, against the moves.
    pub fn measures_walls(&self) -> bool {
        self.judged == Judged::Walls
            && !self.pocket
            && self.path.is_upright()
            && self.part.patches().is_empty()
    }

    /// The moves that memory is reckoned for: those of several tools are held again, each tool's as a path of
    /// its own.
    pub fn moves_held(&self) -> usize {
        if self.cutters.are_several() { 2 * self.path.len() } else { self.path.len() }
    }

    /// What of the part the path's tool can face.
    pub fn facing(&self) -> Facing<'a> {
        Facing::new(self.part, self.path, self.block())
    }
}

/// What figures and pictures are drawn from.
#[derive(Debug)]
pub enum View {
    /// Heights over the plan view.
    Heights(Box<ZMap>),
    /// Places of the design and the deviation along their normals.
    Normals(Box<NormalView>),
}

/// The design's places, measured along their normals.
#[derive(Debug)]
pub struct NormalView {
    /// The places.
    pub map: NormalMap,
    /// Their distance, mm.
    pub spacing: f64,
    /// The swept volume of the path.
    pub rays: Rays,
    /// The cutter that swept it.
    pub solid: Solid,
}

/// What an engine leaves.
#[derive(Debug)]
pub struct Measured {
    /// The figures.
    pub measurement: Measurement,
    /// What they were found in.
    pub view: View,
    /// Pitch of the cells, or distance of the places, mm.
    pub cell: f64,
    /// Number of cells or places.
    pub cells: usize,
    /// Rectangles that were cut and measured anew on finer cells.
    pub refined_rectangles: usize,
    /// Pitch of the finest cells, mm.
    pub finest_cell: f64,
    /// Time that cutting and measuring took, s.
    pub wall_s: f64,
    /// What is to be said about the cells.
    pub note: Option<String>,
}
