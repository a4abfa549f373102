//! How deep a cut beside a border counts, for upright cutters: by one rule at the border itself and at all
//! places near it. mm.
//!
//! The part ends at a border as at a vertical wall. Where the way down along the normal leads out through it,
//! it goes on down the wall: what lies beyond belongs to no part. Where the side of a cutter reaches over a
//! border by less than the gouge tolerance, what is left is as near, and the cut counts no deeper than that.
//!
//! Enters: the part, a place of it, and the cut along its normal there. Leaves: how deep that counts, and at
//! most around the place.

use super::border_cuts::{BorderPiece, pieces};
use super::closer::Value;
use super::cut_surface::Deviation;
use super::figures::NUMERICAL_FLOOR;
use super::inspection::{Inspection, Sample};
use geometry::{CurveSegment, Point2, Point3, SegmentGrid, Vector2, Vector3, share_on};
use motion::Cutters;
use part::Part;
use sim::NOT_CUT;
use work::monitor::{self, Cancelled, Monitor};

/// Halvings by which the way out through a border is found.
const OUT_HALVINGS: usize = 40;

/// The borders of what an upright cutter can face.
pub(super) struct Borders {
    pub pieces: Vec<BorderPiece>,
    /// The same in the plan.
    in_plan: SegmentGrid,
    /// How far a piece leaves its chord at most, mm.
    bend: f64,
}

impl Borders {
    pub fn new(part: &Part, cutters: &Cutters) -> Self {
        let pieces = pieces(part, cutters);
        let segment = |(piece, curve): (&BorderPiece, u32)| {
            let ends = piece.ends.map(|end| end.xy());
            CurveSegment { ends, curve, index: 0 }
        };
        let in_plan = SegmentGrid::new(pieces.iter().zip(0..).map(segment).collect());
        let bend = pieces.iter().map(|piece| piece.bend).fold(0.0, f64::max);
        Self { pieces, in_plan, bend }
    }

    /// Whether pieces may come nearer than `far` mm to a place of the plan.
    fn come_near(&self, q: Point2, far: f64) -> bool {
        let reach = Vector2::repeat(far + self.bend);
        let [low, high] = [q - reach, q + reach];
        let mut comes_near = false;
        self.in_plan.near(&[low, high], |k| comes_near |= self.meets(k, &low, &high));
        comes_near
    }

    /// Whether the box around a piece's chord meets another one, in the plan.
    fn meets(&self, piece: u32, low: &Point2, high: &Point2) -> bool {
        let [a, b] = self.pieces[piece as usize].ends.map(|end| end.xy());
        let (from, to) = (a.inf(&b), a.sup(&b));
        (0..2).all(|c| from[c] <= high[c] && to[c] >= low[c])
    }

    /// The pieces that come nearer than `far` mm in the plan to the box around two places.
    fn near(&self, a: &Point3, b: &Point3, far: f64) -> Vec<&BorderPiece> {
        let reach = Vector2::repeat(far + self.bend);
        let [low, high] = [a.xy().inf(&b.xy()) - reach, a.xy().sup(&b.xy()) + reach];
        let mut found = Vec::new();
        self.in_plan.near(&[low, high], |k| found.push(k));
        found.retain(|k| self.meets(*k, &low, &high));
        found.sort_unstable();
        found.dedup();
        found.into_iter().map(|k| &self.pieces[k as usize]).collect()
    }
}

impl Inspection<'_> {
    /// The cells whose cut beside a border counts for less than along the normal, with their deviation as it
    /// counts, mm.
    ///
    /// # Errors
    /// [`Cancelled`] when the monitor says so.
    pub fn counted_beside_borders(
        &self,
        samples: &[Sample],
        monitor: &dyn Monitor,
    ) -> Result<Vec<(usize, f32)>, Cancelled> {
        let Some(borders) = self.borders else { return Ok(Vec::new()) };
        let of_cell = |k: usize| {
            let depth = -f64::from(samples[k].deviation);
            let centre = self.centre(k);
            // No normal leads farther aside than it is long.
            if !(depth > NUMERICAL_FLOOR && borders.come_near(centre, self.limits.gouge.max(depth))) {
                return None;
            }
            let design = self.design_at(centre)?;
            let (cut, _) = self.along_normal(&design.point, &design.normal)?;
            let counted = self.beside_border(&design.point, &design.normal, &cut, &[], 0.0)?;
            Some((k, -counted.here as f32))
        };
        let nx = self.grid.nx;
        let rows = work::parallel::try_map(self.grid.ny, |j| {
            monitor::check(monitor)?;
            Ok((j * nx..(j + 1) * nx).filter_map(of_cell).collect::<Vec<_>>())
        })?;
        Ok(rows.into_iter().flatten().collect())
    }

    /// How deep a cut counts at a place that lies beside a border, and at most as far as `aside` mm around;
    /// `None` where it is as deep as it is along the normal. `further` are moves that may be lowest between
    /// centres.
    pub fn beside_border(
        &self,
        p: &Point3,
        normal: &Vector3,
        cut: &Deviation,
        further: &[u32],
        aside: f64,
    ) -> Option<Value> {
        let (borders, depth) = (self.borders?, -cut.distance);
        if depth <= NUMERICAL_FLOOR {
            return None;
        }
        let far = self.limits.gouge;
        let pieces = borders.near(p, &(p - normal * depth), far);
        let left = pieces.iter().filter_map(|piece| self.near_value(piece, p, cut.by, aside));
        let tan = cut.slope / (1.0 - cut.slope * cut.slope).max(f64::MIN_POSITIVE).sqrt();
        let moves: Vec<u32> = further.iter().copied().chain((cut.by != NOT_CUT).then_some(cut.by)).collect();
        let wall = self
            .down_wall(&pieces, p, normal, depth, &moves)
            .map(|here| Value { here, possible: here + (tan + normal.xy().norm()) * aside });
        let least =
            |a: Value, b: Value| Value { here: a.here.min(b.here), possible: a.possible.min(b.possible) };
        left.chain(wall).reduce(least).filter(|counted| counted.here < depth)
    }

    /// How deep a cut of a move counts at a place, as deep as it is along the normal there, where the way
    /// down leads out through a border.
    pub fn counted(&self, p: &Point3, normal: &Vector3, depth: f64, by: u32) -> Option<f64> {
        let pieces = self.borders?.near(p, &(p - normal * depth), NUMERICAL_FLOOR);
        self.down_wall(&pieces, p, normal, depth, &[by])
    }

    /// How far what a move leaves is from a place beside a piece, where that is near, and at most as far as
    /// `aside` mm around.
    fn near_value(&self, piece: &BorderPiece, p: &Point3, by: u32, aside: f64) -> Option<Value> {
        if by == NOT_CUT {
            return None;
        }
        let far = self.limits.gouge;
        let [a, b] = piece.ends.map(|end| end.xy());
        let share = share_on(&p.xy(), &a, &b);
        let (foot, _) = piece.design(self.part, share);
        let way = p - foot;
        let inside = way.dot(&piece.inward);
        if inside > far || (way - piece.inward * inside).norm() > NUMERICAL_FLOOR + piece.bend {
            return None;
        }
        let within = |share: f64, far: f64| piece.design(self.part, share).0 + piece.inward_by(share, far);
        let here = self.near_left(piece, by, share, p)?;
        // Before an end, where another border may begin, what counts as near is one place.
        let (along, end) = (aside / (b - a).norm(), piece.end(far));
        let [from, to] = [share - along, share + along].map(|share| share.clamp(end, 1.0 - end));
        let around = [from, 0.5 * (from + to), to].map(|share| within(share, far));
        let holds = inside + aside <= far && self.stays_left(by, around, 3.0 * piece.bend);
        Some(Value { here, possible: if holds { here + aside } else { f64::INFINITY } })
    }

    /// The way down from a place along its normal, as deep as a cut is along it, where it leads out through
    /// one of some pieces: to the wall there and on down along that, as far as it is cut, by some moves if by
    /// none that cells know.
    fn down_wall(
        &self,
        pieces: &[&BorderPiece],
        p: &Point3,
        normal: &Vector3,
        depth: f64,
        moves: &[u32],
    ) -> Option<f64> {
        let along = |way: f64| p - normal * way;
        let is_out = |q: &Point3| {
            let top = self.part.highest_at(q.x, q.y);
            top.is_none_or(|top| top.point.z < q.z - NUMERICAL_FLOOR)
        };
        if pieces.is_empty() || !is_out(&along(depth)) {
            return None;
        }
        let (mut within, mut out) = (0.0, depth);
        for _ in 0..OUT_HALVINGS {
            let middle = 0.5 * (within + out);
            *(if is_out(&along(middle)) { &mut out } else { &mut within }) = middle;
        }
        let wall = along(within);
        let is_border = |piece: &&&BorderPiece| {
            let [a, b] = piece.ends.map(|end| end.xy());
            let nearest = a + (b - a) * share_on(&wall.xy(), &a, &b);
            piece.leads_out(normal) && (nearest - wall.xy()).norm() <= NUMERICAL_FLOOR + 2.0 * piece.bend
        };
        pieces.iter().find(is_border)?;
        // The wall may stand a little beside the grid.
        let of_moves = self.surface.envelope.lowest(wall.x, wall.y, moves).map(|(z, _)| z);
        let cut = self.surface.at(wall.x, wall.y).map(|cut| cut.z).into_iter().chain(of_moves);
        let lowest = cut.reduce(f64::min)?;
        Some(within + (wall.z - lowest).max(0.0))
    }
}

#[cfg(test)]
mod tests {
    use cutter::Cutter;
    use geometry::{Point3, TriangleMesh, Vector3};
    use part::Part;

    use crate::flat_scene::{LIMITS, gouge_of, measured_of, plane};

    const CELLS: [f64; 5] = [0.005, 0.01, 0.03, 0.1, 0.4];

    /// A ball beside a border that the part rises to a little: the way along the normal leads out through the
    /// border, and is longer than that down the wall. Cells whose places come as near to the border as they
    /// like tell the same.
    #[test]
    fn a_cut_beside_a_border_counts_as_deep_as_down_the_wall_on_cells_of_every_size() {
        let (slope, beside, deep) = (0.05, 1.2, 0.0019);
        let high = 0.4 * slope;
        let corners = [[0.0, 0.0, high], [0.4, 0.0, 0.0], [0.0, 0.3, high], [0.4, 0.3, 0.0]];
        let rising = TriangleMesh::new(corners.map(Point3::from).to_vec(), vec![[0, 1, 2], [1, 3, 2]]);
        let part = Part::from_mesh(rising.unwrap().0);
        let tip = high - (3.0 - (9.0f64 - beside * beside).sqrt()) - deep;
        let plunge = vec![Point3::new(-beside, 0.13, 10.0), Point3::new(-beside, 0.13, tip)];
        let truth = deep;
        // Along the normal it were more.
        let normal = Vector3::new(slope, 0.0, 1.0).normalize();
        let way = Point3::new(-beside, 0.13, tip + 3.0) - Point3::new(0.0, 0.13, high);
        let along = way.dot(&normal);
        assert!((along * along - way.norm_squared() + 9.0).sqrt() - along > truth + 3e-5);
        for cell in CELLS {
            let found = gouge_of(&part, &Cutter::ball(6.0).unwrap(), std::slice::from_ref(&plunge), cell);
            let off = (found.max_depth_mm - truth).abs();
            assert!(off <= found.error_bound_mm && off < 5e-6, "{cell}: {truth} {found:?}");
        }
    }

    /// The side of a flat end mill reaches over a border by less than the tolerance: as deep as what is left
    /// is near, on cells whose places lie on the border, too.
    #[test]
    fn a_vertical_side_over_a_border_counts_as_far_as_it_is_over_on_cells_of_every_size() {
        let (part, flat) = (plane([0.4, 0.3]), Cutter::flat(6.0).unwrap());
        for over in [0.001, 0.0045] {
            let plunge = [10.0, -0.05].map(|z| Point3::new(over - 3.0, 0.13, z)).to_vec();
            for cell in CELLS {
                let found = gouge_of(&part, &flat, std::slice::from_ref(&plunge), cell);
                let off = (found.max_depth_mm - over).abs();
                assert!(off <= found.error_bound_mm && off < 5e-6, "{cell}: {over} {found:?}");
                assert!(found.regions.is_empty(), "{cell}: {found:?}");
            }
        }
    }

    /// The steep flank of a ball reaches over a border by less than the tolerance, deeper than that: what is
    /// left is as near. On fine cells as on coarse ones, and at a place on a corner.
    #[test]
    fn a_flank_over_a_border_counts_as_deep_as_what_is_left_is_near_on_cells_of_every_size() {
        let (part, ball) = (plane([0.4, 0.3]), Cutter::ball(6.0).unwrap());
        let over = 0.0018;
        let down = |beside: f64| 3.0 - (9.0f64 - (beside + over) * (beside + over)).sqrt();
        let beside = 2.9;
        assert!((9.0f64 - beside * beside).sqrt() - (3.0 - down(beside)) > LIMITS.gouge);
        let plunge = |x: f64, y: f64, z: f64| vec![Point3::new(x, y, 10.0), Point3::new(x, y, z)];
        for cell in CELLS {
            let found = gouge_of(&part, &ball, &[plunge(-beside, 0.13, -down(beside))], cell);
            let off = (found.max_depth_mm - over).abs();
            assert!(off <= found.error_bound_mm && off < 5e-6, "{cell}: {over} {found:?}");
            let aside = beside / 2f64.sqrt();
            let found = gouge_of(&part, &ball, &[plunge(-aside, -aside, -down(beside))], cell);
            assert!(found.max_depth_mm + found.error_bound_mm < LIMITS.gouge, "{cell}: {found:?}");
        }
    }

    /// The least deviation of the cells is no deeper than the deepest cut, though a flank stands deep beside
    /// places that lie on the border.
    #[test]
    fn cells_beside_a_border_count_as_deep_as_the_deepest_cut_at_most() {
        let (part, flat) = (plane([0.4, 0.3]), Cutter::flat(6.0).unwrap());
        let ball = Cutter::ball(6.0).unwrap();
        for (cutter, tip) in [
            (flat, Point3::new(0.0045 - 3.0, 0.13, -0.05)),
            (flat, Point3::new(-2.9985, -0.001, -0.05)),
            (ball, Point3::new(-2.9, 0.13, (9.0f64 - 2.9018 * 2.9018).sqrt() - 3.0)),
        ] {
            let plunge = [Point3::new(tip.x, tip.y, 10.0), tip].to_vec();
            for cell in CELLS {
                let found = measured_of(&part, &cutter, std::slice::from_ref(&plunge), cell);
                let least = found.deviation_map.iter().fold(0f32, |a, b| a.min(*b));
                let deepest = found.gouge.max_depth_mm;
                assert!(f64::from(least) >= -deepest - 1e-7, "{cell}: {least} {deepest}");
                assert_eq!(found.deviation.min_mm.map(|min| min.min(0.0) as f32), Some(least));
            }
        }
    }
}
