//! Tool axes in a scene: a word, or a table in place.

use std::fmt::{self, Write as _};

use geometry::{Point3, Vector3};
use keys::{Located, SceneError, Section};
use keys::{toml_number as number, toml_numbers as list};
use motion::ToolAxis;

/// The key of the axis of a toolpath.
pub(super) const KEY: &str = "axis";

/// Angles of lead and tilt, degrees: beyond, the shank would cut.
const LEAN: std::ops::RangeInclusive<f64> = -80.0..=80.0;

/// How fast an axis may be asked to turn, degrees a mm.
const TURNING: std::ops::RangeInclusive<f64> = 1e-3..=360.0;

/// Along the normal of the surface.
const NORMAL: ToolAxis = ToolAxis::LeadTilt { lead: 0.0, tilt: 0.0 };

/// How the axis of a toolpath is chosen.
#[derive(Debug, Clone, PartialEq)]
pub struct AxisRequest {
    /// The rule.
    pub rule: ToolAxis,
    /// The axis turns by no more than this along a pass, rad a mm of contact.
    pub most_turning: Option<f64>,
    /// From pass to pass it turns by no more than this, rad a mm between neighbouring contacts.
    pub most_turning_across: Option<f64>,
}

/// Reads the axis of a toolpath; `None` for an upright one.
pub(super) fn read(section: &Section<'_>) -> Result<Option<AxisRequest>, SceneError> {
    let Some(table) = section.inline(KEY) else {
        let word = section.word(KEY, &["upright", "normal"])?;
        let leaning = word.filter(|word| word.value == "normal");
        return Ok(leaning.map(|_| AxisRequest {
            rule: NORMAL,
            most_turning: None,
            most_turning_across: None,
        }));
    };
    table.only(
        &["lead", "tilt", "fixed", "toward", "away", "between", "turning", "turning_across"],
        &[],
        "`axis`",
    )?;
    let [lead, tilt] = ["lead", "tilt"].map(|key| table.number(key, LEAN, " degrees"));
    let (lead, tilt) = (lead?, tilt?);
    let rules = [
        (lead.is_some() || tilt.is_some()).then(|| {
            let angle =
                |angle: &Option<Located<f64>>| angle.as_ref().map_or(0.0, |angle| angle.value.to_radians());
            ToolAxis::LeadTilt { lead: angle(&lead), tilt: angle(&tilt) }
        }),
        table.vector("fixed")?.map(|v| Ok(ToolAxis::Fixed(unit(&table, v.value, &v)?))).transpose()?,
        curve(&table, "toward")?.map(ToolAxis::Toward),
        curve(&table, "away")?.map(ToolAxis::Away),
        guides(&table)?.map(ToolAxis::Between),
    ];
    let rate = |key: &str| {
        let rate = table.number(key, TURNING, " degrees a mm")?;
        Ok::<_, SceneError>(rate.map(|rate| rate.value.to_radians()))
    };
    let (most_turning, most_turning_across) = (rate("turning")?, rate("turning_across")?);
    let mut rules = rules.into_iter().flatten();
    // Limits alone are for axes along the normal.
    let limited = most_turning.or(most_turning_across).map(|_| NORMAL);
    let (Some(rule), None) = (rules.next().or(limited), rules.next()) else {
        let message = "`axis` needs one rule for the tool axis, and only one";
        let cure = "write `{ lead = 15, tilt = 0 }`, `{ fixed = [0, 0.5, 1] }`, `{ toward = [[0, 0, 80]] }`, \
                    `{ away = [[0, 0, -80]] }` or `{ between = [[0, 0, 0, 0, 0, 1], [50, 0, 0, 0.3, 0, 1]] }`";
        return Err(section.key_error(KEY, message, cure));
    };
    Ok(Some(AxisRequest { rule, most_turning, most_turning_across }))
}

/// The unit vector of three numbers.
fn unit<T>(table: &Section<'_>, [x, y, z]: [f64; 3], at: &Located<T>) -> Result<Vector3, SceneError> {
    let unit = Vector3::new(x, y, z).try_normalize(1e-9);
    let message = "a tool axis of no length has no direction";
    unit.ok_or_else(|| {
        table.error(&at.span, message, "write a vector from the tip to the holder: `[0, 0, 1]`")
    })
}

fn curve(table: &Section<'_>, key: &str) -> Result<Option<Vec<Point3>>, SceneError> {
    let Some(rows) = table.rows::<3>(
        key,
        "points of three numbers",
        "write one point, or the points of a curve, as `[[x, y, z], ...]`",
    )?
    else {
        return Ok(None);
    };
    if rows.value.is_empty() {
        let message = format!("`{key}` has no point");
        return Err(table.error(&rows.span, message, "write `[[0, 0, 80]]`, or several points for a curve"));
    }
    Ok(Some(rows.value.into_iter().map(Point3::from).collect()))
}

fn guides(table: &Section<'_>) -> Result<Option<Vec<(Point3, Vector3)>>, SceneError> {
    let Some(rows) = table.rows::<6>(
        "between",
        "rows of six numbers",
        "write places with their axes as `[[x, y, z, i, j, k], ...]`",
    )?
    else {
        return Ok(None);
    };
    if rows.value.is_empty() {
        let cure = "write at least one place with its axis: `[[0, 0, 0, 0, 0, 1]]`";
        return Err(table.error(&rows.span, "`between` has no place", cure));
    }
    let one = |&[x, y, z, i, j, k]: &[f64; 6]| Ok((Point3::new(x, y, z), unit(table, [i, j, k], &rows)?));
    rows.value.iter().map(one).collect::<Result<_, SceneError>>().map(Some)
}

/// Writes the axis as scenes spell it.
pub(super) fn write(out: &mut String, request: Option<&AxisRequest>) -> fmt::Result {
    let Some(AxisRequest { rule, most_turning, most_turning_across }) = request else {
        return writeln!(out, "axis = \"upright\"");
    };
    let lists = |rows: Vec<String>| format!("[{}]", rows.join(", "));
    let curve = |points: &[Point3]| lists(points.iter().map(|p| list(p.coords.as_slice())).collect());
    let rule = match rule {
        ToolAxis::LeadTilt { lead, tilt } => {
            format!("lead = {}, tilt = {}", number(lead.to_degrees()), number(tilt.to_degrees()))
        }
        ToolAxis::Fixed(axis) => format!("fixed = {}", list(axis.as_slice())),
        ToolAxis::Toward(points) => format!("toward = {}", curve(points)),
        ToolAxis::Away(points) => format!("away = {}", curve(points)),
        ToolAxis::Between(guides) => {
            let row = |(p, a): &(Point3, Vector3)| list(&[p.x, p.y, p.z, a.x, a.y, a.z]);
            format!("between = {}", lists(guides.iter().map(row).collect()))
        }
    };
    let turning = |key: &str, rate: &Option<f64>| {
        rate.map_or_else(String::new, |rate| format!(", {key} = {}", number(rate.to_degrees())))
    };
    let (along, across) = (turning("turning", most_turning), turning("turning_across", most_turning_across));
    writeln!(out, "axis = {{ {rule}{along}{across} }}  # degrees, mm")
}

#[cfg(test)]
mod tests {
    use crate::{Scene, complete_toml};
    use motion::ToolAxis;

    fn scene(axis: &str) -> String {
        format!(
            "[part]\nsurface = \"plane\"\nx = [0, 8]\ny = [0, 6]\n[cutter]\nshape = \"ball\"\ndiameter = 6\n\
             [[toolpath]]\nstrategy = \"zigzag\"\naxis = {axis}\n"
        )
    }

    #[test]
    fn axes_are_read_and_written_back() {
        for axis in [
            "\"normal\"",
            "\"upright\"",
            "{ lead = 15 }",
            "{ tilt = -5, turning = 2 }",
            "{ away = [[0, 0, -80]], turning = 2, turning_across = 4.5 }",
            "{ fixed = [0, 3, 4] }",
            "{ toward = [[0, 0, 80]] }",
            "{ away = [[0, 0, -80], [0, 10, -80]] }",
            "{ between = [[0, 0, 0, 0, 0, 1], [50, 0, 0, 0.6, 0, 0.8]] }",
        ] {
            let read = Scene::parse("a.toml", scene(axis)).unwrap();
            let again = Scene::parse("a.toml", complete_toml(&read)).unwrap();
            let [a, b] = [&read, &again].map(|scene| scene.toolpaths[0].axis.clone());
            let text = |axis| format!("{axis:.9?}");
            assert_eq!(text(&a), text(&b), "{axis}");
        }
        let fixed = Scene::parse("a.toml", scene("{ fixed = [0, 3, 4] }")).unwrap();
        let rule = &fixed.toolpaths[0].axis.as_ref().unwrap().rule;
        assert!(matches!(rule, ToolAxis::Fixed(axis) if (axis.y - 0.6).abs() < 1e-15));
    }

    #[test]
    fn axes_that_say_nothing_are_refused_with_a_cure() {
        for (axis, word) in [
            ("\"tilted\"", "cannot be"),
            ("{}", "one rule"),
            ("{ lead = 10, fixed = [0, 0, 1] }", "only one"),
            ("{ lead = 85 }", "(-80 to 80)"),
            ("{ lead = nan }", "NaN"),
            ("{ lead = 3, turning_across = 0 }", "degrees a mm"),
            ("{ fixed = [0, 0, 0] }", "no length"),
            ("{ fixed = [0, 0] }", "three numbers"),
            ("{ toward = [] }", "no point"),
            ("{ away = [[0, 0]] }", "three numbers"),
            ("{ between = [[0, 0, 0, 0, 0, 0]] }", "no length"),
            ("{ between = [] }", "no place"),
            ("{ leed = 3 }", "unknown key `leed`"),
        ] {
            let error = Scene::parse("a.toml", scene(axis)).unwrap_err().to_string();
            assert!(error.contains(word), "{axis}: {error}");
        }
    }
}
