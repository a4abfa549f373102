//! `[compare]`: every toolpath planned for the same machining times.
//!
//! ```toml
//! [compare]
//! minutes = 2.5           # or several: [2, 2.5, 3]
//! ```

use std::fmt::{self, Write as _};

use keys::{SceneError, Section, toml_numbers};
use toolpath::PartKind;

use super::ToolpathRequest;
use super::read::folder_name;

/// Times that a machine may take, minutes.
const MINUTES: std::ops::RangeInclusive<f64> = 1e-3..=1e5;

/// Most times: each is a whole run of all toolpaths.
const MOST_TIMES: usize = 20;

/// A machining time that a toolpath is planned for, by the scallop height that takes it.
#[derive(Debug, Clone, PartialEq)]
pub struct EqualTime {
    /// The time, minutes.
    pub minutes: f64,
    /// The toolpath's name without the time.
    pub of: String,
}

/// The times, minutes; none where the scene compares at no time.
pub(super) fn read(root: &Section<'_>) -> Result<Vec<f64>, SceneError> {
    if !root.has("compare") {
        return Ok(Vec::new());
    }
    let section = root.section("compare")?;
    section.only(&["minutes"], &[], "[compare]")?;
    let minutes = if section.is_list("minutes") {
        section.numbers("minutes", &MINUTES, " minutes")?
    } else {
        vec![section.required_number("minutes", MINUTES, " minutes", 2.5)?.value]
    };
    let refuse = |what: String, cure: &str| Err(section.key_error("minutes", what, cure.to_owned()));
    let twice = minutes.iter().enumerate().find(|(k, time)| minutes[..*k].contains(time));
    match (minutes.len(), twice) {
        (_, Some((_, time))) => refuse(format!("`minutes` has {time} twice"), "delete one of them"),
        (1..=MOST_TIMES, None) => Ok(minutes),
        (count, None) => refuse(
            format!("`minutes` has {count} times; expected 1 to {MOST_TIMES}"),
            "write `minutes = 2.5` or a short list of times",
        ),
    }
}

/// A toolpath for each of the times; the toolpath itself where there are none.
pub(super) fn at_times(
    request: ToolpathRequest,
    section: &Section<'_>,
    minutes: &[f64],
) -> Result<Vec<ToolpathRequest>, SceneError> {
    if minutes.is_empty() {
        return Ok(vec![request]);
    }
    let refused = |key: &str, what: String, cure: &str| {
        section.key_error(key, what, format!("{cure}, or delete [compare]"))
    };
    if request.strategy.definition().part != PartKind::Surface {
        let what = format!(
            "[compare] plans for a time by the scallop height, and \"{}\" is not planned by one",
            request.strategy_name()
        );
        return Err(refused("strategy", what, "delete this toolpath"));
    }
    if let Some(key) = ["stepover", "scallop", "correct", "stock"].into_iter().find(|key| section.has(key)) {
        let what = format!("`{key}` does not apply where [compare] plans for a machining time");
        return Err(refused(key, what, "delete it"));
    }
    let at = |time: &f64| {
        let equal_time = Some(EqualTime { minutes: *time, of: request.name.clone() });
        if minutes.len() == 1 {
            return Ok(ToolpathRequest { equal_time, correct: false, ..request.clone() });
        }
        let name = format!("{}, {time} min", request.name);
        let folder = folder_name(&name).ok_or_else(|| {
            let what = format!("\"{name}\" is too long to name a toolpath");
            refused("name", what, "write a shorter `name`")
        })?;
        Ok(ToolpathRequest { name, folder, equal_time, correct: false, ..request.clone() })
    };
    minutes.iter().map(at).collect()
}

/// The table, if the toolpaths are planned for times.
pub(super) fn write(out: &mut String, toolpaths: &[ToolpathRequest]) -> fmt::Result {
    let times = || toolpaths.iter().filter_map(|request| request.equal_time.as_ref());
    let Some(first) = times().next() else { return Ok(()) };
    let minutes: Vec<f64> = times().filter(|time| time.of == first.of).map(|time| time.minutes).collect();
    writeln!(out, "\n[compare]")?;
    writeln!(out, "minutes = {}  # machining times that each toolpath is planned for", toml_numbers(&minutes))
}

/// Whether a toolpath is the first of those that one table of the scene made.
pub(super) fn is_first(request: &ToolpathRequest, toolpaths: &[ToolpathRequest]) -> bool {
    let Some(time) = &request.equal_time else { return true };
    let same = |other: &&ToolpathRequest| other.equal_time.as_ref().is_some_and(|its| its.of == time.of);
    toolpaths.iter().find(same).is_some_and(|first| first.name == request.name)
}
