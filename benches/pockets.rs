//! Planning of pockets with a bounded engagement: time, lengths and verdict on many shapes, as a table.
//!
//! `cargo bench --bench pockets -- [SHAPE ...] [DEGREES ...]`; without words every shape at 60, 40 and 20
//! degrees. Leaves the scenes in `target/pockets/`, for `millstream run` and `benches/freecad_adaptive.py`.
//! "plan" is planning alone, in all rounds; "angles" is the measured engagement, which decides about another
//! round; both s of wall time and (on Linux) of processor time. Nothing is asserted.

use std::error::Error;
use std::f64::consts::{PI, TAU};
use std::fs;
use std::path::Path;
use std::sync::Mutex;
use std::time::Instant;

use millstream::monitor::Monitor;
use millstream::{Scene, Session};

type Curve = Vec<[f64; 2]>;

struct Shape {
    name: &'static str,
    outline: Curve,
    islands: Vec<Curve>,
    diameter: f64,
}

fn shape(name: &'static str, diameter: f64, outline: Curve) -> Shape {
    Shape { name, outline, islands: Vec::new(), diameter }
}

fn turned(radius: f64, angle: f64) -> [f64; 2] {
    [radius * angle.cos(), radius * angle.sin()]
}

fn star() -> Curve {
    (0..10).map(|k| turned(if k % 2 == 0 { 20.0 } else { 9.0 }, PI * (0.2 * f64::from(k) + 0.5))).collect()
}

/// A slot of the width 9 along two turns of a spiral.
fn spiral() -> Curve {
    let side = |by: f64| {
        (0..=200).map(move |k| TAU * f64::from(k) / 100.0).map(move |t| turned(6.0 + 1.9 * t + by, t))
    };
    side(4.5).chain(side(-4.5).rev()).collect()
}

/// Four teeth of the width 8 on a strip.
fn comb() -> Curve {
    let tooth = |k: i32| 56.0 - 14.0 * f64::from(k);
    let mut outline = vec![[0.0, 0.0], [56.0, 0.0], [56.0, 34.0]];
    for k in 0..4 {
        let x = tooth(k);
        outline.extend([[x, 34.0], [x - 8.0, 34.0], [x - 8.0, 12.0], [x - 14.0, 12.0]]);
    }
    outline.dedup();
    outline
}

/// Two rooms with a neck between them.
fn neck(name: &'static str, width: f64) -> Shape {
    let (a, b) = (15.0 - 0.5 * width, 15.0 + 0.5 * width);
    let low = [[0.0, 0.0], [25.0, 0.0], [25.0, a], [40.0, a], [40.0, 0.0], [65.0, 0.0]];
    let high = [[65.0, 30.0], [40.0, 30.0], [40.0, b], [25.0, b], [25.0, 30.0], [0.0, 30.0]];
    shape(name, 8.0, [low, high].concat())
}

fn shapes() -> Vec<Shape> {
    let l = vec![[0.0, 0.0], [80.0, 0.0], [80.0, 25.0], [35.0, 25.0], [35.0, 60.0], [0.0, 60.0]];
    let islands = vec![
        vec![[12.0, 10.0], [20.0, 10.0], [20.0, 18.0], [12.0, 18.0]],
        vec![[55.0, 8.0], [63.0, 8.0], [60.0, 15.0]],
    ];
    let tray = vec![[0.0, 0.0], [50.0, 0.0], [60.0, 20.0], [50.0, 40.0], [0.0, 40.0], [-10.0, 20.0]];
    let cross =
        [[20., 0.], [40., 0.], [40., 20.], [60., 20.], [60., 40.], [40., 40.], [40., 60.], [20., 60.]];
    let cross = [cross.as_slice(), &[[20., 40.], [0., 40.], [0., 20.], [20., 20.]]].concat();
    let circle =
        |r: f64, n: i32| (0..n).map(|k| turned(r, TAU * f64::from(k) / f64::from(n))).collect::<Curve>();
    let ring = circle(8.0, 90).into_iter().map(|p| [p[0] + 3.0, p[1]]).collect();
    vec![
        Shape { islands, ..shape("L", 6.0, l) },
        shape("star", 4.0, star()),
        shape("tray", 8.0, tray),
        neck("neck7.98", 7.98),
        neck("neck8.02", 8.02),
        neck("neck9", 9.0),
        shape("circle", 6.0, circle(20.0, 180)),
        shape("spiral", 6.0, spiral()),
        shape("rectangle", 6.0, vec![[0.0, 0.0], [30.0, 0.0], [30.0, 20.0], [0.0, 20.0]]),
        shape("comb", 5.0, comb()),
        shape("cross", 6.0, cross),
        Shape { islands: vec![ring], ..shape("ring", 6.0, circle(20.0, 180)) },
    ]
}

fn scene(part: &str, name: &str, diameter: f64, engagement: f64) -> String {
    format!(
        "title = \"{name} at {engagement} degrees\"\n[part]\nsurface = \"pocket\"\n{part}\ndepth = 3\n[cutter]\nshape = \"flat\"\n\
         diameter = {diameter}\n[tolerance]\nchord = 0.005\n[[toolpath]]\nstrategy = \"pocket-offset\"\n\
         engagement = {engagement}\nstepdown = 3\n"
    )
}

/// Times of stages.
struct Stages(Mutex<Vec<(String, [f64; 2])>>, Instant);

impl Monitor for Stages {
    fn start(&self, stage: &str, _steps: u64) {
        if let Ok(mut all) = self.0.lock() {
            all.push((stage.to_owned(), [self.1.elapsed().as_secs_f64(), processor_time()]));
        }
    }
}

impl Stages {
    /// What stages of a name took, s.
    fn of(&self, stage: &str) -> [f64; 2] {
        let all = self.0.lock().map(|all| all.clone()).unwrap_or_default();
        let each = all.windows(2).filter(|w| w[0].0 == stage);
        each.fold([0.0; 2], |sum, w| [0, 1].map(|k| sum[k] + w[1].1[k] - w[0].1[k]))
    }
}

/// Of this process, s; 0 where the system does not tell.
fn processor_time() -> f64 {
    let stat = fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let words: Vec<&str> = stat.rsplit(')').next().unwrap_or_default().split_whitespace().collect();
    let ticks = |k: usize| words.get(k).and_then(|word| word.parse::<f64>().ok()).unwrap_or(0.0);
    0.01 * (ticks(11) + ticks(12))
}

fn main() -> Result<(), Box<dyn Error + Send + Sync>> {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with("--")).collect();
    let mut degrees: Vec<f64> = words.iter().filter_map(|word| word.parse().ok()).collect();
    if degrees.is_empty() {
        degrees = vec![60.0, 40.0, 20.0];
    }
    let named: Vec<&String> = words.iter().filter(|word| word.parse::<f64>().is_err()).collect();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = root.join("target/pockets");
    fs::create_dir_all(&folder)?;
    let points = |curve: &Curve| {
        let points = curve.iter().map(|p| format!("[{:.5}, {:.5}]", p[0], p[1]));
        format!("[{}]", points.collect::<Vec<_>>().join(", "))
    };
    let mut parts: Vec<(&str, f64, String)> = shapes()
        .iter()
        .map(|shape| {
            let islands: Vec<String> = shape.islands.iter().map(points).collect();
            let part = format!("outline = {}\nislands = [{}]", points(&shape.outline), islands.join(", "));
            (shape.name, shape.diameter, part)
        })
        .collect();
    let drawing = root.join("scenes/bracket.svg");
    parts.push(("bracket", 6.0, format!("file = \"{}\"\nlayer = \"pocket\"", drawing.display())));
    println!(
        "shape       degrees  plan: wall  processor  angles: wall  processor   cut mm   air mm  greatest   95 %  verdict"
    );
    for (name, diameter, part) in &parts {
        if !named.is_empty() && !named.iter().any(|word| word == name) {
            continue;
        }
        for engagement in &degrees {
            let text = scene(part, name, *diameter, *engagement);
            let file = folder.join(format!("{name}_{engagement}.toml"));
            fs::write(&file, &text)?;
            let session = Session::new(Scene::parse(&file.display().to_string(), &text)?)?;
            let stages = Stages(Mutex::new(Vec::new()), Instant::now());
            let report = session.run(&stages)?;
            let (plan, angles) = (stages.of("planning pocket"), stages.of("measuring engagement"));
            for path in report.measured() {
                let pocket = path.figures.iter().find(|figure| figure.key == "pocket");
                let degrees = |key: &str| {
                    pocket.and_then(|p| p.value.get(key)).and_then(|v| v.as_f64()).unwrap_or(f64::NAN)
                };
                println!(
                    "{name:11} {engagement:7} {:11.2} {:10.2} {:13.2} {:10.2} {:8.0} {:8.0} {:9.2} {:6.1}  {}",
                    plan[0],
                    plan[1],
                    angles[0],
                    angles[1],
                    path.path.cutting_length_mm,
                    path.path.air_length_mm,
                    degrees("max_engagement_deg"),
                    degrees("p95_engagement_deg"),
                    path.verdict.word(),
                );
            }
        }
    }
    Ok(())
}
