//! Any bytes as a section table, or as a generated blade where they begin like one: a message or sections
//! that are the same when they are written and read again, and of which a blade can be made, or a message
//! that says why not.

use millstream::blade::sections::Sections;
use millstream::blade::{Blade, BladeSettings, BladeSide, FairingMethod};
use millstream::geometry::Isometry3;
use millstream::io::section_table::{parse_blade, parse_table, write_table};
use millstream::scene::SceneText;

/// Sections and points beyond these are not made into blades, so that the fuzzer spends its time on readers.
const MADE_SECTIONS: usize = 4;
const MADE_POINTS: usize = 120;

pub fn check(bytes: &[u8]) {
    if let Ok(sections) = parse_table(bytes) {
        let text = write_table(&sections, "again", None);
        let again = parse_table(text.as_bytes()).expect("what was written is read back");
        assert_eq!(again, sections);
        make_blade(&sections);
    }
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let Ok(blade) = parse_blade(&SceneText::new("blade.toml", text)) else { return };
    if blade.sections * blade.points <= MADE_POINTS
        && let Ok(sections) = blade.generate()
    {
        make_blade(&sections);
    }
}

fn make_blade(sections: &Sections) {
    let points: usize =
        sections.sections().iter().flat_map(|s| s.outline.curves()).map(|(_, p)| p.len()).sum();
    if sections.sections().len() > MADE_SECTIONS || points > MADE_POINTS {
        return;
    }
    for side in [BladeSide::Both, BladeSide::Around] {
        let size = sections.sections()[0].outline.size();
        let fairing = Some((FairingMethod::ControlPoints, 1e-3 * size)).filter(|_| side == BladeSide::Both);
        let settings = BladeSettings { side, pitch: None, placed: Isometry3::identity(), fairing };
        let Ok(blade) = Blade::new(sections, &settings) else { continue };
        for surface in &blade.surfaces {
            let jet = surface.jet(0.3, 0.7);
            assert!(jet.p.iter().chain(jet.du.iter()).all(|x| x.is_finite()), "{jet:?}");
        }
        for surface in blade.offset_in_planes(0.05 * size).into_iter().flatten() {
            assert!(surface.point(0.5, 0.5).iter().all(|x| x.is_finite()));
        }
    }
}
