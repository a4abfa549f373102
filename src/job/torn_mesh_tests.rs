//! Meshes that rounding or T-junctions tore apart are planned and measured as whole ones are.

use std::fmt::Write as _;

use report::{ToolpathResult, Verdict};
use scene::Scene;
use work::monitor::Silent;

use crate::Session;

type Triangle = [[f64; 3]; 3];

/// An arch in strips along y, from x = `at`.
fn arch(at: f64) -> Vec<Triangle> {
    let height = |x: f64| (400.0 - (x - 5.0).powi(2)).sqrt() - 20.0;
    let strip = |k: u32| {
        let place = |x: f64, y: f64| [at + x, y, height(x)];
        let [x, next] = [f64::from(k), f64::from(k + 1)];
        let [a, b, c, d] = [place(x, 0.0), place(next, 0.0), place(next, 8.0), place(x, 8.0)];
        [[a, b, c], [a, c, d]]
    };
    (0..10).flat_map(strip).collect()
}

/// Every other triangle in two, at the middle of an edge that its neighbour has whole.
fn with_t_junctions(triangles: &[Triangle]) -> Vec<Triangle> {
    let halves = |(k, &[a, b, c]): (usize, &Triangle)| {
        let middle = [0, 1, 2].map(|axis| 0.5 * (c[axis] + a[axis]));
        if k % 4 == 0 { vec![[a, b, middle], [middle, b, c]] } else { vec![[a, b, c]] }
    };
    triangles.iter().enumerate().flat_map(halves).collect()
}

fn changed(triangles: &[Triangle], mut change: impl FnMut(usize, f64) -> f64) -> Vec<Triangle> {
    let mut k = 0;
    let mut next = |x| {
        k += 1;
        change(k, x)
    };
    triangles.iter().map(|t| t.map(|p| p.map(&mut next))).collect()
}

fn planned(name: &str, triangles: &[Triangle]) -> (Session, ToolpathResult) {
    let folder = std::env::temp_dir().join(format!("millstream-torn-{name}-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let mut text = "solid arch\n".to_owned();
    for corners in triangles {
        text += "facet normal 0 0 0\nouter loop\n";
        corners.iter().for_each(|[x, y, z]| writeln!(text, "vertex {x} {y} {z}").unwrap());
        text += "endloop\nendfacet\n";
    }
    std::fs::write(folder.join("arch.stl"), text + "endsolid arch\n").unwrap();
    let scene = "[part]\nfile = \"arch.stl\"\n[cutter]\nshape = \"ball\"\ndiameter = 6\n[tolerance]\nscallop = 0.03\n\
                 [simulation]\nremoval = false\n[[toolpath]]\nstrategy = \"streamline\"\n";
    let scene = Scene::parse(&folder.join("arch.toml").to_string_lossy(), scene).unwrap();
    let session = Session::new(scene).unwrap();
    std::fs::remove_dir_all(folder).unwrap();
    let result = session.toolpath(&session.scene.toolpaths[0], &Silent).unwrap().result;
    assert_eq!(result.verdict, Verdict::Pass, "{name}: {:?}", result.claims);
    (session, result)
}

#[test]
fn torn_meshes_are_planned_as_whole_ones() {
    let (_, whole) = planned("whole", &arch(0.0));
    assert!(whole.notes.iter().all(|note| !note.contains("weld")), "{:?}", whole.notes);
    let noisy = changed(&arch(0.0), |k, x| x + 1e-9 * (7.0 * k as f64).sin());
    for (name, triangles, note) in [
        ("noise", noisy, "welded "),
        ("junctions", with_t_junctions(&arch(0.0)), "split 5 edges at vertices on them"),
    ] {
        let (session, torn) = planned(name, &triangles);
        assert!(session.notes.iter().chain(&torn.notes).any(|n| n.contains(note)), "{:?}", session.notes);
        assert_eq!(torn.path.passes, whole.path.passes, "{name}");
        let ratio = torn.path.machining_time_s / whole.path.machining_time_s;
        assert!((ratio - 1.0).abs() < 0.01, "{name}: {ratio}");
    }
}

/// Far from the origin steps of f32 are no longer small: bounds hold what welding moved.
#[test]
fn bounds_hold_what_welding_moved() {
    let (_, whole) = planned("near", &arch(0.0));
    let round =
        |k: usize, x: f64| f64::from(if k.is_multiple_of(5) { (x as f32).next_up() } else { x as f32 });
    let (session, torn) = planned("far", &changed(&arch(1000.0), round));
    let moved = session.moved();
    assert!(moved > 5e-5 && moved < 2e-4, "{moved}");
    assert!(session.notes.iter().any(|note| note.contains("welded ")), "{:?}", session.notes);
    assert_eq!(torn.path.passes, whole.path.passes);
    let excess = &torn.excess;
    let highest = [excess.highest, excess.reached.unwrap(), excess.unreached].map(|h| h.error_bound_mm);
    let others = [torn.gouge.error_bound_mm, torn.uncut.error_bound_mm, torn.scallop.error_bound_mm.unwrap()];
    assert!(highest.iter().chain(&others).all(|bound| *bound >= moved), "{highest:?} {others:?}");
}
