//! Any text as a NURBS file: reading ends in a message or in patches whose jets are finite, and of
//! which a part can be made, or a message that says why not.

use millstream::geometry::NurbsSurface;
use millstream::io::nurbs_json;
use millstream::part::{Part, Patch, default_tessellation_tolerance};

/// A search mesh this coarse is quick to make; what can go wrong in making it does not depend on it.
const COARSENESS: f64 = 100.0;

pub fn check(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let Ok(patches) = nurbs_json::parse(text) else { return };
    for patch in &patches {
        let [[u0, u1], [v0, v1]] = patch.domain();
        for (s, t) in [(0.0, 0.0), (0.3, 0.8), (1.0, 1.0)] {
            let jet = patch.jet(u0 + s * (u1 - u0), v0 + t * (v1 - v0));
            for d in [jet.p.coords, jet.du, jet.dv, jet.duu, jet.duv, jet.dvv] {
                assert!(d.iter().all(|c| c.is_finite()), "{jet:?}");
            }
        }
    }
    let again = nurbs_json::parse(&nurbs_json::to_text(&patches)).expect("what was written is read back");
    assert_eq!(again.len(), patches.len());
    make_part(patches);
}

fn make_part(patches: Vec<NurbsSurface>) {
    let patches: Vec<Patch> = patches.into_iter().map(Patch::Nurbs).collect();
    let tolerance = COARSENESS * default_tessellation_tolerance(&patches);
    let Ok(part) = Part::from_patches(patches, tolerance) else { return };
    let (bounds, size) = (part.bounds(), part.bounds().size());
    let q = bounds.min + 0.4 * size;
    let (foot, _) = part.closest_point(&q);
    assert!(foot.point.iter().chain(foot.normal.iter()).all(|x| x.is_finite()), "{foot:?}");
    if let Some(top) = part.highest_at(q.x, q.y) {
        assert!(top.point.z.is_finite(), "{top:?}");
    }
}
