//! The stock as it was at first, for bodies that cut nothing of it: what is clear of it is clear of all that
//! stands later.
//!
//! What meets it collides where no move before has come to the place; else it is open whether anything stood
//! there by then.

use collision::{Body, Obstacle};
use cutter::Solid;
use geometry::{Bvh, Point3, TriangleMesh, Vector3};
use motion::Toolpath;
use sim::Stock;
use work::monitor::Monitor;

use super::bodies::{Motion, Mover, Other};
use super::{PairClearance, STANDING};
use crate::JobError;
use crate::run::Run;

/// Size of the triangle around a place for which it is asked whether a cutter comes to it, mm.
const SPOT: f64 = 1e-3;

/// Slack of heights against rounding, mm.
const ROUNDING: f64 = 1e-9;

/// Why nothing is known.
const MAY_BE_CUT: &str = "it meets stock of the beginning that may have been cut by then";

/// The stock at first.
pub(super) struct UncutStock {
    stock: Stock,
    mesh: TriangleMesh,
    tree: Bvh,
    /// Its triangles are off its true surface by up to this, mm.
    off: f64,
}

impl UncutStock {
    pub fn of(run: &Run<'_>) -> Option<Self> {
        let stock = run.session.roughed_stock();
        let (mesh, off) = match &stock {
            Stock::Cylinder { base, axis, radius, length } => {
                let end = base + Vector3::ith(*axis as usize, *length);
                Body::cylinder(*base, end, 2.0 * radius)?.mesh()?
            }
            _ => match stock.mesh() {
                Some(mesh) => (mesh.clone(), mesh.moved()),
                None => Body::block(stock.bounds().min, stock.bounds().max)?.mesh()?,
            },
        };
        Some(Self { tree: Bvh::new(&mesh), mesh, stock, off })
    }

    /// As what a body must not touch, on the link of the workpiece.
    pub fn beside<'a>(&'a self, work: &Other<'_>) -> Other<'a> {
        let obstacle = Obstacle::new(&self.mesh, &self.tree);
        Other {
            name: STANDING.to_owned(),
            link: work.link,
            obstacle,
            off: self.off,
            from_link: work.from_link,
        }
    }

    /// Whether stock stands at a place of its surface until a move ends, for certain.
    fn stands(
        &self,
        run: &Run<'_>,
        place: &Point3,
        move_index: usize,
        monitor: &dyn Monitor,
    ) -> Result<bool, JobError> {
        // Of a roughed or milled block the mesh is that of the whole one.
        let whole = matches!(self.stock, Stock::Box(_) | Stock::Cylinder { .. } | Stock::Mesh(_));
        if !whole && self.stock.height_at(place.x, place.y) < place.z - ROUNDING {
            return Ok(false);
        }
        let corner = |x: f64, y: f64| place + Vector3::new(x, y, -x - y) * SPOT;
        let corners = vec![corner(1.0, 0.0), corner(0.0, 1.0), corner(-1.0, -1.0)];
        let Ok((spot, _)) = TriangleMesh::new(corners, vec![[0, 1, 2]]) else { return Ok(false) };
        let tree = Bvh::new(&spot);
        let spot = Obstacle::new(&spot, &tree);
        let own = run.tools.iter().filter(|tool| tool.first as usize <= move_index).map(|tool| {
            let count = tool.path.len().min(move_index + 1 - tool.first as usize);
            (*tool.cutter, Toolpath::new(tool.path.start, tool.path.moves[..count].to_vec()))
        });
        for (cutter, path) in run.before().into_iter().chain(own) {
            let least = spot.least_clearance(&Solid::of_cutter(&cutter, None), &path, &|_| true, monitor)?;
            if least.is_some_and(|least| least.nearest.distance <= least.error_bound) {
                return Ok(false);
            }
        }
        Ok(true)
    }
}

/// How near a body comes to the stock on the chosen stretches.
pub(super) fn pair(
    motion: &Motion<'_>,
    (name, mover): (&str, &Mover),
    (stock, other): (&UncutStock, &Other<'_>),
    approach_only: bool,
    monitor: &dyn Monitor,
) -> Result<Option<PairClearance>, JobError> {
    let moves = motion.moves(mover, other, &|stretch| stretch.approach || !approach_only);
    let Some(least) = motion.least(mover, other, &moves, monitor)? else { return Ok(None) };
    if least.nearest.distance >= 0.0 {
        return Ok(Some(motion.told(name, other, &moves, least)));
    }
    // The first contact: least is cut by then. Nothing before `clear` touches, something before `touching`
    // does.
    let (mut clear, mut touching, mut first) = (0, least.move_index + 1, least);
    while touching - clear > 1 {
        let middle = clear + (touching - clear) / 2;
        match motion.least(mover, other, &moves[clear..middle], monitor)? {
            Some(found) if found.nearest.distance < 0.0 => {
                touching = clear + found.move_index + 1;
                first = collision::LeastClearance { move_index: clear + found.move_index, ..found };
            }
            _ => clear = middle,
        }
    }
    let (place, step) = (first.nearest.place, motion.first_move() + moves[first.move_index].step);
    let told = motion.told(name, other, &moves, first);
    Ok(Some(match stock.stands(motion.run, &place, step, monitor)? {
        true => told,
        false => PairClearance { clearance_mm: None, error_bound_mm: None, reason: Some(MAY_BE_CUT), ..told },
    }))
}
