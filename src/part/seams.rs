//! Where patches meet, for vertical lines. The mesh of each patch leaves its border by up to the deviation,
//! so that a line there may pass between the triangles of two patches, or through those of a patch that has
//! ended.

use super::{LEAST_UPRIGHT, Part, ROUNDING, refine};
use geometry::{Point2, Vector2};
use work::parallel;

/// Where a vertical line meets a patch, and a triangle nearby.
#[derive(Debug, Clone, Copy)]
pub(super) struct OnPatch {
    pub patch: usize,
    pub triangle: u32,
    pub meeting: refine::VerticalMeeting,
}

impl Part {
    /// Where the vertical line through `(x, y)` meets a patch other than the `known` one that is higher, or
    /// goes on where that has ended; else the known meeting. With none known, that of a patch whose triangles
    /// end before it does.
    pub(super) fn across_seams(&self, known: Option<OnPatch>, x: f64, y: f64) -> Option<OnPatch> {
        let lies_within = |found: &OnPatch| !self.beside_others[found.triangle as usize];
        if known.as_ref().is_some_and(|found| self.patches.len() < 2 || lies_within(found)) {
            return known;
        }
        let within = self.across();
        let is_exact = |found: &OnPatch| found.meeting.miss <= ROUNDING;
        // Where a patch has ended, the next one goes on as high as its tangent plane, but for the crease
        // between them.
        let floor = known.as_ref().map_or(f64::NEG_INFINITY, |found| {
            let crease = within / found.meeting.normal.z.abs().max(LEAST_UPRIGHT);
            found.meeting.z - if is_exact(found) { 0.0 } else { crease }
        });
        let (mut best, mut asked) = (known, None);
        // The nearest end of a patch beside the line, and the way there in the plan.
        let mut beside: Option<(OnPatch, Vector2)> = None;
        let mut is_between = false;
        self.bvh.tree().search(
            floor,
            |_, node, _| {
                let is_near = node.plan_distance_squared(x, y) <= within * within;
                if is_near { node.top() + self.deviation } else { f64::NEG_INFINITY }
            },
            |slot, floor| {
                let triangle = self.bvh.triangle_in(slot) as u32;
                let Some(patch) = self.patch_of(triangle) else { return floor };
                if asked == Some(patch) || known.as_ref().is_some_and(|known| known.patch == patch) {
                    return floor;
                }
                let meeting = self.refine_vertical(patch, x, y, || self.nearest_in_plan(triangle, x, y));
                let Some(meeting) = meeting else { return floor };
                let found = OnPatch { patch, triangle, meeting };
                if !is_exact(&found) {
                    let [u, v] = meeting.at;
                    let way = self.patches[patch].point(u, v).xy() - Point2::new(x, y);
                    is_between |= beside.is_some_and(|(_, other)| way.dot(&other) < 0.0);
                    if beside.is_none_or(|(nearest, _)| meeting.miss < nearest.meeting.miss) {
                        beside = Some((found, way));
                    }
                    return floor;
                }
                asked = Some(patch);
                if found.meeting.z > floor {
                    best = Some(found);
                }
                floor.max(found.meeting.z)
            },
        );
        // Patches of a file may end a little before each other. Where all ends lie on one side, the part
        // ends.
        best.or(beside.filter(|_| is_between).map(|(nearest, _)| nearest))
    }

    /// Triangles of two patches that meet lie up to so far apart, mm.
    pub(super) fn across(&self) -> f64 {
        2.0 * self.deviation + ROUNDING
    }

    /// For each triangle, whether those of another patch come so near in the plan that a line may meet
    /// either, and are no lower.
    pub(super) fn find_those_beside_others(&self) -> Vec<bool> {
        if self.patches.len() < 2 {
            return Vec::new();
        }
        let within = self.across();
        parallel::map(self.mesh.triangles().len(), |t| {
            let corners = self.mesh.corners(t);
            let ends = |axis: usize| {
                let along = corners.map(|corner| corner[axis]);
                let low = along.into_iter().fold(f64::INFINITY, f64::min);
                [low, along.into_iter().fold(low, f64::max)]
            };
            let [[x0, x1], [y0, y1]] = [ends(0), ends(1)].map(|[low, high]| [low - within, high + within]);
            let lowest = ends(2)[0] - within / LEAST_UPRIGHT - self.deviation;
            let own = self.patch_of(t as u32);
            let mut found = false;
            self.bvh.tree().search(
                lowest,
                |_, node, _| if node.meets([x0, y0], [x1, y1]) { node.top() } else { f64::NEG_INFINITY },
                |slot, lowest| {
                    found |= self.patch_of(self.bvh.triangle_in(slot) as u32) != own;
                    if found { f64::INFINITY } else { lowest }
                },
            );
            found
        })
    }
}
