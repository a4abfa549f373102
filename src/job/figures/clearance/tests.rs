//! Clamps, vises and holders planted at known distances.

use crate::{JobError, Outcome, Session};
use report::{Claim, ToolpathResult, Verdict};
use scene::Scene;
use std::path::{Path, PathBuf};
use work::monitor::Silent;

/// A plate of 8 × 6 mm whose top is z = 0, in strips of 0.5 mm.
pub(super) const PLATE: &str =
    "[part]\nsurface = \"plane\"\nx = [0, 8]\ny = [0, 6]\n[cutter]\nshape = \"ball\"\ndiameter = 6\n";
pub(super) const ZIGZAG: &str = "[[toolpath]]\nstrategy = \"zigzag\"\nstepover = 0.5\n";

/// A folder of its own that goes away.
pub(super) struct Home(PathBuf);

impl Home {
    pub(super) fn new(name: &str) -> Self {
        let home = std::env::temp_dir().join(format!("millstream-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&home).unwrap();
        Self(home)
    }

    pub(super) fn planned(&self, text: &str) -> (Session, Outcome) {
        let name = self.0.join("plate.toml");
        let session = Session::new(Scene::parse(&name.to_string_lossy(), text).unwrap()).unwrap();
        let outcome = session.toolpath(&session.scene.toolpaths[0], &Silent).unwrap();
        (session, outcome)
    }

    pub(super) fn tried(&self, text: &str) -> Result<Outcome, JobError> {
        let name = self.0.join("plate.toml");
        let session = Session::new(Scene::parse(&name.to_string_lossy(), text).unwrap())?;
        session.toolpath(&session.scene.toolpaths[0], &Silent)
    }

    pub(super) fn outcome(&self, text: &str) -> Outcome {
        self.planned(text).1
    }

    /// With the files that the scene names.
    pub(super) fn opened(&self, text: &str) -> ToolpathResult {
        self.write("plate.toml", text);
        let session = Session::open(self.0.join("plate.toml")).unwrap();
        session.toolpath(&session.scene.toolpaths[0], &Silent).unwrap().result
    }

    pub(super) fn write(&self, file: &str, text: &str) {
        write(&self.0.join(file), text);
    }

    pub(super) fn run(&self, text: &str) -> ToolpathResult {
        self.outcome(text).result
    }

    /// A box as an STL file.
    pub(super) fn solid(&self, file: &str, low: [f64; 3], high: [f64; 3]) {
        let corner = |i: usize| [0, 1, 2].map(|axis| if i >> axis & 1 == 1 { high[axis] } else { low[axis] });
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let vertex = |i: usize| {
            let [x, y, z] = corner(i);
            format!("vertex {x} {y} {z}\n")
        };
        let facet = |corners: [usize; 3]| {
            format!("facet normal 0 0 0\nouter loop\n{}endloop\nendfacet\n", corners.map(vertex).concat())
        };
        let facets: String =
            quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).map(facet).collect();
        write(&self.0.join(file), &format!("solid x\n{facets}endsolid x\n"));
    }
}

impl Drop for Home {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn write(path: &Path, text: &str) {
    std::fs::write(path, text).unwrap();
}

/// The claim on a pair.
pub(super) fn claim<'a>(result: &'a ToolpathResult, other: &str) -> &'a Claim {
    let of_pair = |claim: &&Claim| claim.what == "collision" && claim.text.contains(other);
    result.claims.iter().find(of_pair).unwrap_or_else(|| panic!("{:#?}", result.claims))
}

/// Passes that run aslant toward a clamp end where its clearance begins, and the last decimals of the program
/// stay outside.
#[test]
fn what_the_planner_keeps_off_stays_off_as_written() {
    let home = Home::new("aslant");
    // The fifth decimal of the last places is rounded up.
    home.solid("clamp.stl", [7.00006, -9.0, -2.0], [9.0, 19.0, 14.0]);
    for angle in [7, 20, 33] {
        let result = home.run(&format!(
            "{PLATE}[holder]\ncutting_length = 7\n[[holder.section]]\ndiameter = 9\nlength = 10\n[interference]\nclearance = 0.3\n\
             [[fixture]]\nfile = \"clamp.stl\"\n{ZIGZAG}angle = {angle}\n"
        ));
        let claim = result.claims.iter().find(|claim| claim.what == "clearance").unwrap();
        assert_eq!(claim.verdict(), Verdict::Pass, "{angle}: {claim:?}");
        // It comes as near as that.
        assert!(claim.measured.unwrap() > -0.001, "{angle}: {claim:?}");
    }
}

/// A clamp as a wall across the plate, in its middle or beside the ends of the passes.
#[test]
fn an_upright_cutter_keeps_off_a_clamp_and_its_distance_is_told() {
    let home = Home::new("clamp");
    let text = |clearance: f64| {
        format!("{PLATE}[interference]\nclearance = {clearance}\n[[fixture]]\nfile = \"clamp.stl\"\n{ZIGZAG}")
    };
    let path = home.outcome(&format!("{PLATE}{ZIGZAG}")).path;
    let reached = path.moves.iter().map(|m| m.to.tip.x).fold(0.0, f64::max) + 3.0;
    let run = |x: f64, clearance: f64| {
        home.solid("clamp.stl", [x, -9.0, -2.0], [x + 4.0, 19.0, 14.0]);
        let result = home.run(&text(clearance));
        let claim = claim(&result, "clamp.stl").clone();
        assert_eq!(claim.verdict(), Verdict::Pass, "{claim:?}");
        (result, -claim.measured.unwrap(), claim.error_bound)
    };
    for clearance in [0.05, 29.0] {
        let (_, measured, bound) = run(reached + clearance, 0.0);
        assert!((measured - clearance).abs() <= bound + 1e-9 && bound < 1e-4, "{measured} ± {bound}");
    }
    // In the middle no pass reaches what is nearer than 3.5 mm, and the plate stays uncut there.
    let (result, measured, bound) = run(4.0, 0.5);
    assert!((measured - 0.5).abs() <= bound + 1e-4, "{measured} ± {bound}");
    assert!(
        result.notes.iter().any(|note| note.contains("of passes beside fixtures are skipped")),
        "{:?}",
        result.notes
    );
    assert!(result.verdict == Verdict::Fail && result.uncut.area_mm2 > 20.0, "{:?}", result.uncut);
}

/// A post that stands beside the path, taller than it: from wherever the tool comes, it comes over the post.
#[test]
fn a_program_begins_and_ends_over_all_fixtures() {
    let home = Home::new("post-beside");
    home.solid("post.stl", [60.0, 60.0, -2.0], [64.0, 64.0, 90.0]);
    let text = format!("{PLATE}[[fixture]]\nfile = \"post.stl\"\n{ZIGZAG}");
    let name = home.0.join("plate.toml");
    let session = Session::new(Scene::parse(&name.to_string_lossy(), text).unwrap()).unwrap();
    let outcome = session.toolpath(&session.scene.toolpaths[0], &Silent).unwrap();
    let mut program = Vec::new();
    session.write_program(&mut program, &outcome).unwrap();
    let program = String::from_utf8(program).unwrap();
    let highest = outcome.path.moves.iter().map(|m| m.to.tip.z).fold(f64::MIN, f64::max);
    assert!(highest < 90.0);
    let rises: Vec<usize> =
        (1..).zip(program.lines()).filter(|(_, l)| l.contains("Z92.0")).map(|l| l.0).collect();
    let [first, last] = rises[..] else { panic!("{program}") };
    let lines = outcome.path.origin.lines.clone();
    assert!(first < lines[0] as usize && last as u32 > *lines.last().unwrap(), "{program}");
}

#[test]
fn a_tool_inside_a_closed_vise_collides_with_it() {
    let home = Home::new("vise");
    home.solid("vise.stl", [-90.0; 3], [90.0; 3]);
    let result = home.run(&format!("{PLATE}[[fixture]]\nfile = \"vise.stl\"\n{ZIGZAG}"));
    let found = claim(&result, "vise.stl");
    assert_eq!(found.verdict(), Verdict::Fail, "{found:?}");
    assert!(found.text.starts_with("Cutter collides with vise.stl, at least"), "{}", found.text);
}

/// A holder of 20 mm that begins `length` above the tip, and a block that stands 4 mm over the plate.
fn held(length: f64) -> String {
    format!(
        "{PLATE}[stock]\nallowance = 4\n[holder]\ncutting_length = {length}\n[[holder.section]]\ndiameter = 20\nlength = 30\n\
         {ZIGZAG}"
    )
}

/// The first pass runs 4 mm below the top of the block, and the holder over stock that no pass has cut yet.
/// On the finished plate the same holder would stand as high as it is long.
#[test]
fn an_upright_holder_is_held_against_the_stock_that_stands_when_it_comes() {
    let home = Home::new("standing");
    for (length, verdict) in [(3.95, Verdict::Fail), (4.05, Verdict::Pass), (9.0, Verdict::Pass)] {
        let result = home.run(&held(length));
        let found = claim(&result, "standing stock");
        assert_eq!(found.verdict(), verdict, "{found:?}");
        let clearance = -found.measured.unwrap();
        // Passes lie within the chord tolerance of their place.
        assert!((clearance - (length - 4.0)).abs() <= found.error_bound + 1e-3, "{found:?}");
    }
    let figure = home.run(&held(4.05)).figures.into_iter().find(|figure| figure.key == "clearance").unwrap();
    let nearest = &figure.value["pairs"][0];
    assert_eq!((&nearest["tool"], &nearest["other"]), (&"holder".into(), &"standing stock".into()));
    assert!(nearest["line"].as_u64().is_some_and(|line| line > 5), "{nearest}");
    let sentence = figure.sentence.unwrap().1;
    assert!(
        sentence.starts_with("0.050 ± 0.0") && sentence.ends_with("mm, holder to standing stock: zigzag"),
        "{sentence}"
    );
}

/// A collision never reads as none.
#[test]
fn small_collisions_are_told_with_digits_that_show_them() {
    let shown = |clearance, bound| {
        let pair = super::PairClearance::new(("cutter", "post.stl".into()));
        super::PairClearance { clearance_mm: Some(clearance), error_bound_mm: bound, ..pair }.shown()
    };
    assert_eq!(shown(-0.0002, Some(0.00103)), "-0.0002 ± 0.0011");
    assert_eq!(shown(-0.00004, None), "-0.00004, or less");
    assert_eq!(shown(-0.002, Some(0.00103)), "-0.002 ± 0.002");
    assert_eq!(shown(0.0002, Some(0.00103)), "0.000 ± 0.002");
    assert_eq!(shown(-1.25, None), "-1.250, or less");
}
