//! Any text as a NURBS file: reading ends in a message or in patches whose jets are finite.

#![no_main]

use libfuzzer_sys::fuzz_target;
use millstream::io::nurbs_json;

fuzz_target!(|text: &str| {
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
});
