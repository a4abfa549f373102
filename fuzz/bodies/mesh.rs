//! What the targets for mesh files share: a mesh that was accepted can be searched.

use millstream::geometry::{Point3, TriangleMesh};
use millstream::part::Part;

/// Meshes beyond this are not searched, so that the fuzzer spends its time on readers.
const SEARCHED_TRIANGLES: usize = 256;

/// Corners are finite and in use, normals are unit vectors, and searches answer with finite numbers.
pub fn holds(mesh: TriangleMesh) {
    assert!(!mesh.triangles().is_empty());
    assert!(mesh.vertices().iter().all(|p| p.iter().all(|x| x.is_finite())));
    for (t, corners) in mesh.triangles().iter().enumerate() {
        assert!(corners.iter().all(|&c| (c as usize) < mesh.vertices().len()));
        assert!((mesh.normal(t).norm() - 1.0).abs() < 1e-9);
    }
    if mesh.triangles().len() > SEARCHED_TRIANGLES {
        return;
    }
    let part = Part::from_mesh(mesh);
    let (bounds, size) = (part.bounds(), part.bounds().size());
    for [s, t, r] in [[0.0, 0.0, 0.0], [0.5, 0.5, 2.0], [0.3, 0.8, -1.0]] {
        let q = Point3::new(
            bounds.min.x + s * size.x,
            bounds.min.y + t * size.y,
            bounds.min.z + r * size.z.max(1.0),
        );
        let (foot, _) = part.closest_point(&q);
        assert!(foot.point.iter().chain(foot.normal.iter()).all(|x| x.is_finite()), "{foot:?}");
        if let Some(top) = part.highest_at(q.x, q.y) {
            assert!(top.point.z.is_finite(), "{top:?}");
        }
    }
}
