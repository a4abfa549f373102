//! `millstream scallop`: scallop height from step and step from scallop height, on flat, convex and concave
//! sections and at a place of a part.

use std::fmt::Write as _;
use std::path::Path;

use super::args::ScallopOptions;
use super::error::CliError;
use cutter::Cutter;
use geometry::{Point3, Vector3};
use io::{MeshFormat, nurbs_json};
use part::{Part, Patch, SurfacePoint, default_tessellation_tolerance};
use scallop::{BallSection, ScallopError, SurfaceCurvature, compare, effective_radius};

/// Curvatures of the table times the cutter's radius, positive concave.
const TABLE_BENDS: [f64; 7] = [-1.0, -1.0 / 3.0, -0.1, 0.0, 0.1, 1.0 / 3.0, 0.6];

/// Steps of the table over the cutter's radius.
const TABLE_STEPS: [f64; 4] = [0.05, 0.1, 0.2, 0.4];

/// The section that is asked about.
struct CrossSection {
    /// Radius that the cutter shows across the feed, mm.
    radius: f64,
    /// 1/mm, positive concave.
    curvature: f64,
    /// Leads from which on the cutter fits, degrees, where it does not and one helps.
    fits_from: Option<f64>,
    /// What was found out about the place.
    notes: Vec<String>,
}

/// What `scallop` prints.
///
/// # Errors
/// [`CliError::Scallop`] for numbers that make no scallop, [`CliError::ScallopPart`] for a part that cannot
/// be read.
pub fn scallop(options: &ScallopOptions) -> Result<String, CliError> {
    if options.table {
        return table(options);
    }
    let section = match &options.part {
        Some(file) => at_place(options, file)?,
        None => by_radius(options)?,
    };
    let ball = BallSection::new(section.radius, section.curvature)
        .map_err(|reason| refused(of_cutter(reason, &options.cutter, section.fits_from)))?;
    answer(options, &section, &ball).map_err(refused)
}

fn refused(reason: ScallopError) -> CliError {
    CliError::Scallop(reason)
}

/// Leads are told to this, degrees.
const LEAD_STEP: f64 = 0.1;

/// That a cutter does not fit, with what would: it is no ball of another diameter where the cutter is none.
fn of_cutter(reason: ScallopError, cutter: &Cutter, fits_from: Option<f64>) -> ScallopError {
    match reason {
        ScallopError::DoesNotFit { ball, section, .. } if !cutter.profile().is_ball() => {
            let lead = fits_from
                .map_or_else(String::new, |lead| format!("give a --lead of {lead:.1} degrees or more, or "));
            let cure =
                format!("{lead}use a smaller cutter or a ball of less than {} mm diameter", 2.0 * section);
            ScallopError::CutterDoesNotFit { radius: ball, section, cure }
        }
        other => other,
    }
}

/// The least lead, degrees, with which a cutter fits into a section where it does not: its radius across the
/// feed is `radius_at` a lead.
fn fitting_lead(curvature: f64, radius_at: impl Fn(f64) -> Result<f64, ScallopError>) -> Option<f64> {
    let fits = |lead: f64| radius_at(lead).is_ok_and(|radius| BallSection::new(radius, curvature).is_ok());
    let steps = (90.0 / LEAD_STEP) as usize;
    (1..steps).map(|k| LEAD_STEP * k as f64).find(|lead| curvature > 0.0 && fits(*lead))
}

/// Degrees of lead as an axis over a feed and a normal; without one along `upright`.
fn axis(lead: Option<f64>, feed: &Vector3, normal: &Vector3, upright: &Vector3) -> Vector3 {
    lead.map_or(*upright, |degrees| normal * degrees.to_radians().cos() + feed * degrees.to_radians().sin())
}

fn by_radius(options: &ScallopOptions) -> Result<CrossSection, CliError> {
    let radius = options.convex.or(options.concave);
    if let Some(value) = radius.filter(|r| !(*r > 0.0 && r.is_finite())) {
        let wanted = "a positive number of mm; leave it out for a plane";
        return Err(refused(ScallopError::Range { what: "the radius of the section", value, wanted }));
    }
    let curvature = match (options.convex, options.concave) {
        (Some(radius), _) => -1.0 / radius,
        (None, Some(radius)) => 1.0 / radius,
        (None, None) => 0.0,
    };
    let (feed, normal) = (Vector3::x(), Vector3::z());
    let radius_at = |lead: Option<f64>| {
        effective_radius(&options.cutter, &axis(lead, &feed, &normal, &normal), &normal, &Vector3::y())
    };
    let radius = radius_at(options.lead).map_err(refused)?;
    let fits_from = fitting_lead(curvature, |lead| radius_at(Some(lead)));
    Ok(CrossSection { radius, curvature, fits_from, notes: Vec::new() })
}

fn at_place(options: &ScallopOptions, file: &Path) -> Result<CrossSection, CliError> {
    let part = load(file)?;
    let at = found(&part, file, options.at.as_deref().unwrap_or_default())?;
    let turn = options.direction.to_radians();
    let flat = Vector3::new(turn.cos(), turn.sin(), 0.0);
    let feed = (flat - at.normal * at.normal.dot(&flat)).try_normalize(1e-9).ok_or_else(|| {
        let reason =
            format!("the direction {} degrees stands square to the surface there", options.direction);
        CliError::ScallopPart { file: file.to_owned(), reason, cure: "give another --direction".into() }
    })?;
    let across = at.normal.cross(&feed);
    let refuse = |reason: String, cure: &str| CliError::ScallopPart {
        file: file.to_owned(),
        reason,
        cure: cure.into(),
    };
    let curvatures = SurfaceCurvature::of(&part, options.cutter.radius())
        .map_err(|e| refuse(format!("its triangles make no surface: {e}"), "mend the mesh"))?;
    let curvature = curvatures.along(&at, &across).ok_or_else(|| {
        refuse("the surface has no curvature there: it is a pole".into(), "give a place beside it")
    })?;
    let radius_at = |lead: Option<f64>| {
        effective_radius(&options.cutter, &axis(lead, &feed, &at.normal, &Vector3::z()), &at.normal, &across)
    };
    let radius = radius_at(options.lead).map_err(refused)?;
    let fits_from = fitting_lead(curvature, |lead| radius_at(Some(lead)));
    let [x, y, z] = at.point.coords.into();
    let [nx, ny, nz] = at.normal.into();
    let mut notes = vec![format!("at x {x:.4} y {y:.4} z {z:.4} mm, normal {nx:.5} {ny:.5} {nz:.5}")];
    if curvatures.is_fitted() {
        notes.push(format!(
            "the curvature is fitted to the mesh within {} mm, of first order in the length of its edges",
            0.5 * options.cutter.radius()
        ));
    }
    Ok(CrossSection { radius, curvature, fits_from, notes })
}

fn load(file: &Path) -> Result<Part, CliError> {
    let refuse = |reason: String, cure: &str| CliError::ScallopPart {
        file: file.to_owned(),
        reason,
        cure: cure.into(),
    };
    let unread = |e: &dyn std::fmt::Display| {
        refuse(format!("it cannot be used: {e}"), "mend that file or name another one")
    };
    if io::extension(file).as_deref() == Some("json") {
        let patches: Vec<Patch> =
            nurbs_json::read(file).map_err(|e| unread(&e))?.into_iter().map(Patch::Nurbs).collect();
        let tolerance = default_tessellation_tolerance(&patches);
        return Part::from_patches(patches, tolerance).map_err(|e| unread(&e));
    }
    let format = MeshFormat::of(file)
        .map_err(|e| refuse(format!("{e}, .json"), "name a mesh file or NURBS patches in a .json file"))?;
    format.read(file).map(|(mesh, _)| Part::from_mesh(mesh)).map_err(|e| unread(&e))
}

/// The surface point that is meant by `x,y` or `x,y,z`.
fn found(part: &Part, file: &Path, at: &[f64]) -> Result<SurfacePoint, CliError> {
    match at {
        [x, y, z] => Ok(part.closest_point(&Point3::new(*x, *y, *z)).0),
        [x, y] => part.highest_at(*x, *y).ok_or_else(|| {
            let b = part.bounds();
            CliError::ScallopPart {
                file: file.to_owned(),
                reason: format!("nothing of it stands over x {x}, y {y}"),
                cure: format!(
                    "it spans x {:.3} to {:.3} and y {:.3} to {:.3}; give a place in there, or x,y,z for the nearest one",
                    b.min.x, b.max.x, b.min.y, b.max.y
                ),
            }
        }),
        _ => Err(CliError::ScallopPart {
            file: file.to_owned(),
            reason: "the place is missing".into(),
            cure: "add --at X,Y or --at X,Y,Z".into(),
        }),
    }
}

/// A section in words.
fn shape(curvature: f64) -> String {
    // Beyond a kilometre it is rounding.
    if curvature.abs() < 1e-6 {
        return "flat section".into();
    }
    let side = if curvature > 0.0 { "concave" } else { "convex" };
    format!("{side} section of radius {} mm", digits(1.0 / curvature.abs()))
}

/// A number with seven digits that matter, without zeros behind.
fn digits(value: f64) -> String {
    let before = value.abs().max(1e-9).log10().floor() as i32;
    let text = format!("{value:.*}", (6 - before).clamp(0, 15) as usize);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

fn per_cent(share: f64) -> String {
    format!("{:+.*} %", if share.abs() < 1e-3 { 4 } else { 2 }, 100.0 * share)
}

fn height(mm: f64) -> String {
    format!("{} mm ({:.3} µm)", digits(mm), 1e3 * mm)
}

fn answer(
    options: &ScallopOptions,
    section: &CrossSection,
    ball: &BallSection,
) -> Result<String, ScallopError> {
    let mut lines = vec![format!(
        "Cutter of diameter {} mm, radius {} mm across the feed; {}",
        digits(2.0 * options.cutter.radius()),
        digits(section.radius),
        shape(section.curvature)
    )];
    lines.extend(section.notes.iter().cloned());
    let how =
        if options.cutter.profile().is_ball() { "exact" } else { "of the circle that osculates the cutter" };
    let mut row = |name: &str, value: String| lines.push(format!("  {name:<24} {value}"));
    if let Some(step) = options.step {
        let exact = ball.height(step)?;
        let second = ball.second_order_height(step);
        row("step along the surface", format!("{} mm", digits(step)));
        row("step between contacts", format!("{} mm", digits(ball.step(exact)?.chord)));
        row("scallop height", format!("{}, {how}", height(exact)));
        row("  to second order", format!("{}, {}", height(second), per_cent(second / exact - 1.0)));
    } else if let Some(wanted) = options.scallop {
        let step = ball.step(wanted)?;
        let second = ball.second_order_step(wanted);
        row("scallop height", height(wanted));
        row("step along the surface", format!("{} mm, {how}", digits(step.arc)));
        row("step between contacts", format!("{} mm", digits(step.chord)));
        row("  to second order", format!("{} mm, {}", digits(second), per_cent(second / step.arc - 1.0)));
        if step.limited {
            lines.push(format!(
                "  Every step leaves less there: the section is nearly as concave as the cutter. The step is limited to half of \
                 its circle, which leaves {}.",
                height(ball.greatest_height())
            ));
        }
    }
    Ok(lines.join("\n") + "\n")
}

/// What the second-order formula and the polynomial section cost, over curvature and step.
fn table(options: &ScallopOptions) -> Result<String, CliError> {
    let cutter: &Cutter = &options.cutter;
    if !cutter.profile().is_ball() {
        let reason = "the table is that of a ball; give --cutter ball:DIAMETER";
        return Err(refused(ScallopError::Cutter(reason.into())));
    }
    let r = cutter.radius();
    let [curvatures, steps] =
        [&TABLE_BENDS.map(|b| b / r)[..], &TABLE_STEPS.map(|s| s * r)[..]].map(<[f64]>::to_vec);
    let rows =
        compare(r, &curvatures, &steps, options.spread.to_radians(), options.degree).map_err(refused)?;
    let mut out = format!(
        "Ball of radius {} mm. Errors as shares of the exact scallop height: of the second-order formula, and of a polynomial of\n\
         degree {} through the contacts of six passes, between parallel passes and between passes that spread by {} degrees.\n\n\
         {:<34} {:>9} {:>12} {:>14} {:>12} {:>12}\n",
        digits(r),
        options.degree,
        digits(options.spread),
        "section",
        "step mm",
        "exact µm",
        "second order",
        "parallel",
        "spreading"
    );
    for row in rows {
        let [second, parallel, spreading] = [row.second_order, row.parallel, row.spreading].map(per_cent);
        let (section, step) = (shape(row.curvature), digits(row.step));
        let exact = 1e3 * row.exact;
        // Writing into a string cannot fail.
        let _ = writeln!(
            out,
            "{section:<34} {step:>9} {exact:>12.3} {second:>14} {parallel:>12} {spreading:>12}"
        );
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::super::args::{Arguments, Command};
    use super::*;
    use clap::Parser as _;

    fn asked(line: &str) -> Result<String, String> {
        let arguments =
            Arguments::try_parse_from(line.split(' ')).map_err(|e| format!("usage {}", e.exit_code()))?;
        let Command::Scallop(options) = arguments.command else { return Err("another command".into()) };
        scallop(&options).map_err(|e| super::super::error::render(&e, false))
    }

    #[test]
    fn heights_and_steps_are_answered() {
        let text = asked("millstream scallop --cutter ball:6 --step 0.5").unwrap();
        assert!(text.contains("flat section") && text.contains("(10.435 µm), exact"), "{text}");
        assert!(text.contains("(10.417 µm), -0.17 %"), "{text}");
        let convex = asked("millstream scallop --cutter ball:10 --scallop 0.01 --convex 50").unwrap();
        assert!(
            convex.contains("0.6026618 mm, exact") && convex.contains("convex section of radius 50 mm"),
            "{convex}"
        );
        let concave = asked("millstream scallop --cutter ball:10 --scallop 0.01 --concave 50").unwrap();
        assert!(concave.contains("0.6664011 mm, exact"), "{concave}");
        let bull = asked("millstream scallop --cutter bull:10:2 --scallop 0.01 --lead 10").unwrap();
        assert!(bull.contains("radius 19.27631 mm across the feed") && bull.contains("osculates"), "{bull}");
        let hollow = asked("millstream scallop --cutter ball:10 --scallop 0.1 --concave 5.05").unwrap();
        assert!(hollow.contains("Every step leaves less there"), "{hollow}");
    }

    /// What fits is told of the cutter that was given, and a lead that is told fits.
    #[test]
    fn a_cutter_that_does_not_fit_is_told_what_does() {
        let of = |cutter: &str, lead: &str, section: &str| {
            asked(&format!("millstream scallop --cutter {cutter} --lead {lead} --step 1 --concave {section}"))
        };
        let refused = |cutter: &str, lead: &str, section: &str| {
            let text = of(cutter, lead, section).unwrap_err();
            text.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ")
        };
        let bull = refused("bull:6:1", "10", "10");
        assert!(bull.contains("12.5175 mm across the feed") && !bull.contains("a ball of radius"), "{bull}");
        let lead = bull.split("--lead of ").nth(1).and_then(|rest| rest.split(' ').next()).unwrap();
        let less = format!("{:.1}", lead.parse::<f64>().unwrap() - LEAD_STEP);
        assert!(of("bull:6:1", lead, "10").is_ok() && of("bull:6:1", &less, "10").is_err(), "{lead}");
        // No lead makes a cutter narrower than its radius.
        let flat = refused("flat:20", "5", "8");
        assert!(!flat.contains("--lead of") && flat.contains("smaller cutter"), "{flat}");
        assert!(refused("ball:30", "0", "10").contains("20 mm diameter"));
    }

    #[test]
    fn a_place_of_a_part_has_its_own_curvature() {
        let home = tempfile::tempdir().unwrap();
        let dome = geometry::samples::hemisphere(Point3::origin(), 20.0);
        let file = home.path().join("dome.json");
        std::fs::write(&file, nurbs_json::to_text(&[dome])).unwrap();
        let at = |place: &str| {
            asked(&format!(
                "millstream scallop --cutter ball:6 --step 0.5 --part {} --at {place}",
                file.display()
            ))
        };
        let exact = 1e3 * BallSection::new(3.0, -0.05).unwrap().height(0.5).unwrap();
        for place in ["3,4", "3,-4 --direction 70", "-30,0,30"] {
            let text = at(place).unwrap();
            assert!(
                text.contains("convex section of radius 20 mm") && text.contains(&format!("({exact:.3} µm)")),
                "{text}"
            );
        }
        let beside = at("30,0").unwrap_err();
        assert!(beside.contains("nothing of it stands over") && beside.contains("spans x"), "{beside}");
    }

    #[test]
    fn a_mesh_is_fitted_and_says_so() {
        let home = tempfile::tempdir().unwrap();
        let file = home.path().join("channel.obj");
        let mut text = String::new();
        // A convex cylinder along y of radius 15.
        for j in 0..40 {
            for i in 0..40 {
                let (x, y) = (-5.0 + 0.25 * f64::from(i), -5.0 + 0.25 * f64::from(j));
                let _ = writeln!(text, "v {x} {y} {}", (225.0 - x * x).sqrt());
            }
        }
        for (i, j) in (0..39).flat_map(|j| (0..39).map(move |i| (i, j))) {
            let k = |i: i32, j: i32| j * 40 + i + 1;
            let _ = writeln!(text, "f {} {} {} {}", k(i, j), k(i + 1, j), k(i + 1, j + 1), k(i, j + 1));
        }
        std::fs::write(&file, text).unwrap();
        let text = asked(&format!(
            "millstream scallop --cutter ball:6 --step 0.5 --direction 90 --part {} --at 0.1,0.2",
            file.display()
        ))
        .unwrap();
        assert!(text.contains("fitted to the mesh") && text.contains("convex section of radius 1"), "{text}");
        let radius: f64 =
            text.split("of radius ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
        assert!((radius / 15.0 - 1.0).abs() < 0.02, "{text}");
    }

    #[test]
    fn the_table_shows_what_the_short_cuts_cost() {
        let text = asked("millstream scallop --cutter ball:6 --table").unwrap();
        assert!(text.lines().count() > 20 && text.contains("flat section"), "{text}");
        assert!(text.lines().all(|line| line.chars().count() <= 125), "{text}");
        assert!(asked("millstream scallop --cutter flat:6 --table").unwrap_err().contains("ball:DIAMETER"));
    }

    #[test]
    fn what_cannot_be_answered_is_refused() {
        for usage in [
            "--step 0.5",
            "--cutter ball:6",
            "--cutter bal:6 --step 0.5",
            "--cutter ball:6 --step 0.5 --scallop 0.01",
            "--cutter ball:6 --step x",
            "--cutter ball:6 --step 0.5 --convex 5 --concave 5",
            "--cutter ball:6 --step 0.5 --part a.stl",
            "--cutter ball:6 --step 0.5 --part a.stl --at 1",
            "--cutter ball:6 --step 0.5 --part a.stl --at 1,nan",
        ] {
            assert_eq!(asked(&format!("millstream scallop {usage}")), Err("usage 2".into()), "{usage}");
        }
        let alone = Arguments::try_parse_from(["millstream", "scallop", "--cutter", "ball:6"]);
        let words = alone.err().map(|e| e.to_string()).unwrap_or_default();
        assert!(["--step", "--scallop", "--table"].iter().all(|way| words.contains(way)), "{words}");
        let refused = |line: &str| asked(&format!("millstream scallop {line}")).unwrap_err();
        let limit = refused("--cutter ball:10 --step 0.5 --concave 4");
        assert!(limit.contains("machinable limit") && limit.contains("less than 8 mm"), "{limit}");
        assert!(refused("--cutter ball:6 --step 7").contains("choose a smaller step"));
        assert!(refused("--cutter ball:6 --scallop 4").contains("ask for less"));
        assert!(refused("--cutter flat:6 --step 0.5").contains("give it a lead"));
        assert!(refused("--cutter ball:6 --step -1").contains("positive number"));
        assert!(refused("--cutter ball:6 --step 0.5 --convex 0").contains("radius of the section"));
        assert!(
            refused("--cutter ball:6 --step 0.5 --convex 0.01").contains("reaches across 0.02979 mm there")
        );
        assert!(refused("--cutter ball:6 --table --spread 400").contains("in degrees, is 400;"));
        assert!(refused("--cutter ball:6 --step 0.5 --part none.stl --at 1,2").contains("none.stl"));
        assert!(
            refused("--cutter ball:6 --step 0.5 --part none.step --at 1,2")
                .contains("NURBS patches in a .json file")
        );
    }
}
