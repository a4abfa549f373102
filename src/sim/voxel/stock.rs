//! What there is before the first cut: boxes, round bars, closed meshes, and blocks roughed to some distance from a part.

use geometry::{Aabb, Bvh, Point3, TriangleMesh, Vector3};

/// An axis of coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BarAxis {
    /// Along x.
    X,
    /// Along y.
    Y,
    /// Along z.
    Z,
}

/// Stock as a solid, mm.
#[derive(Debug)]
pub enum VoxelStock {
    /// A block.
    Box(Aabb),
    /// A round bar.
    Cylinder {
        /// Middle of one end.
        base: Point3,
        /// Which way it runs from there.
        axis: BarAxis,
        /// Radius, mm.
        radius: f64,
        /// Length, mm.
        length: f64,
    },
    /// A casting or forging: see [`VoxelStock::from_mesh`].
    Mesh(Box<StockMesh>),
    /// What an earlier cutter left of a block: see [`VoxelStock::roughed`].
    Roughed {
        /// The block.
        block: Aabb,
        /// The surface that was roughed.
        part: Box<StockMesh>,
        /// How much stands over it, mm.
        over: f64,
    },
}

/// A mesh with its search tree.
#[derive(Debug)]
pub struct StockMesh {
    mesh: TriangleMesh,
    tree: Bvh,
}

impl VoxelStock {
    /// Of a closed mesh; `None` where it has borders, since nobody can tell its inside then.
    pub fn from_mesh(mesh: TriangleMesh) -> Option<Self> {
        let closed = mesh.is_closed();
        closed.then(|| Self::Mesh(Box::new(StockMesh { tree: Bvh::new(&mesh), mesh })))
    }

    /// A block that was roughed to `over` mm from the outer side of a part's surface. Beside an open surface its borders'
    /// planes go on.
    pub fn roughed(block: Aabb, part: TriangleMesh, over: f64) -> Self {
        Self::Roughed { block, part: Box::new(StockMesh { tree: Bvh::new(&part), mesh: part }), over }
    }

    /// The box around it.
    pub fn bounds(&self) -> Aabb {
        match self {
            Self::Box(bounds) => *bounds,
            Self::Cylinder { base, axis, radius, length } => {
                let mut around = Vector3::from_element(*radius);
                let mut end = *base;
                around[*axis as usize] = 0.0;
                end[*axis as usize] += length;
                Aabb { min: base - around, max: end + around }
            }
            Self::Mesh(stock) => stock.mesh.bounds(),
            Self::Roughed { block, .. } => *block,
        }
    }

    /// Whether its sizes are positive and all its numbers finite.
    pub(super) fn is_valid(&self) -> bool {
        let Aabb { min, max } = self.bounds();
        (0..3).all(|i| min[i] < max[i] && min[i].is_finite() && max[i].is_finite())
    }

    /// Volume, mm³; `None` of a roughed block, which no closed form tells.
    pub fn volume(&self) -> Option<f64> {
        Some(match self {
            Self::Roughed { .. } => return None,
            Self::Box(bounds) => bounds.size().product(),
            Self::Cylinder { radius, length, .. } => std::f64::consts::PI * radius * radius * length,
            Self::Mesh(stock) => {
                // From a place nearby, so that far from the origin no digits are lost.
                let near = stock.mesh.bounds().min;
                let corners = (0..stock.mesh.triangles().len()).map(|t| stock.mesh.corners(t));
                corners.map(|[a, b, c]| (a - near).dot(&(b - near).cross(&(c - near))) / 6.0).sum()
            }
        })
    }

    /// Signed distance, mm, below zero inside, and its unit gradient: exact; of a roughed block the greater of those of the
    /// block and of the surface, no greater than the true one.
    pub fn foot(&self, q: &Point3) -> (f64, Vector3) {
        match self {
            Self::Roughed { block, part, over } => {
                let (of_block, of_part) = (Self::Box(*block).foot(q), part.foot(q));
                let of_part = (of_part.0 - over, of_part.1);
                if of_block.0 > of_part.0 { of_block } else { of_part }
            }
            Self::Box(bounds) => {
                let middle = bounds.min + bounds.size() * 0.5;
                let away = q - middle;
                let sign = away.map(|x| if x < 0.0 { -1.0 } else { 1.0 });
                let beyond = away.abs() - bounds.size() * 0.5;
                let outside = beyond.sup(&Vector3::zeros());
                let distance = outside.norm();
                if distance > 0.0 {
                    return (distance, outside.component_mul(&sign) / distance);
                }
                let face = beyond.imax();
                let mut gradient = Vector3::zeros();
                gradient[face] = sign[face];
                (beyond[face], gradient)
            }
            Self::Cylinder { base, axis, radius, length } => {
                let mut along = Vector3::zeros();
                along[*axis as usize] = 1.0;
                let away = q - base;
                let z = away[*axis as usize];
                let outward = away - along * z;
                let rho = outward.norm();
                let side = rho - radius;
                let (end, up) = if z > 0.5 * length { (z - length, along) } else { (-z, -along) };
                let away = Vector3::ith((*axis as usize + 1) % 3, 1.0);
                let radial = if rho > 0.0 { outward / rho } else { away };
                match (side > 0.0, end > 0.0) {
                    (true, true) => {
                        let distance = side.hypot(end);
                        (distance, (radial * side + up * end) / distance)
                    }
                    _ if side > end => (side, radial),
                    _ => (end, up),
                }
            }
            Self::Mesh(stock) => stock.foot(q),
        }
    }
}

impl StockMesh {
    fn foot(&self, q: &Point3) -> (f64, Vector3) {
        let foot = self.tree.closest_point(&self.mesh, q);
        let distance = foot.signed_distance;
        let gradient = (q - foot.point) / distance;
        (distance, if distance.abs() > 1e-9 { gradient } else { foot.normal })
    }
}
