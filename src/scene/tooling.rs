//! The tool: what cuts, what holds it, and how fast. A scene has one for all toolpaths, and a toolpath may have
//! its own.

use std::fmt::{self, Write as _};

use cutter::{Cutter, Holder, HolderSection};
use keys::{SceneError, Section, toml_number as number};
use machine::Machine;

use super::read::RATE;
use super::{DEFAULT_FEED_RATE, DEFAULT_PLUNGE_RATE, DEFAULT_SPINDLE_SPEED, ToolpathRequest};

/// The tables of a scene or of a toolpath.
const CUTTER: &str = "cutter";
const HOLDER: &str = "holder";

/// Keys of a cutter beside its shape.
pub(super) const SPEEDS: [&str; 3] = ["spindle_speed", "feed_rate", "plunge_rate"];

/// Speeds of the cutter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CuttingData {
    /// Spindle speed, rev/min.
    pub spindle_speed: f64,
    /// Feed along passes, mm/min.
    pub feed_rate: f64,
    /// Feed down to a pass, mm/min.
    pub plunge_rate: f64,
}

/// A tool.
#[derive(Debug, Clone, PartialEq)]
pub struct Tooling {
    /// What cuts.
    pub cutter: Cutter,
    /// What holds it; `None` leaves collisions of shank and holder unchecked.
    pub holder: Option<Holder>,
    /// How fast.
    pub cutting: CuttingData,
}

/// The tool of a scene's or a toolpath's table.
pub(super) fn read(table: &Section<'_>) -> Result<Tooling, SceneError> {
    let section = table.section(CUTTER)?;
    let cutter = Cutter::read(&section, &SPEEDS)?;
    let rate = |key, default| section.number_or(key, RATE, "", default);
    let cutting = CuttingData {
        spindle_speed: rate("spindle_speed", DEFAULT_SPINDLE_SPEED)?,
        feed_rate: rate("feed_rate", DEFAULT_FEED_RATE)?,
        plunge_rate: rate("plunge_rate", DEFAULT_PLUNGE_RATE)?,
    };
    Ok(Tooling { holder: read_holder(table, &cutter)?, cutter, cutting })
}

/// The tool of a toolpath: its own, or that of the scene.
pub(super) fn read_own(toolpath: &Section<'_>, of_scene: &Tooling) -> Result<Tooling, SceneError> {
    if !toolpath.has(CUTTER) {
        if toolpath.has(HOLDER) {
            let message = "`holder` in a toolpath without `cutter`";
            let cure =
                "write the holder of the scene's cutter as [holder], or give the toolpath its own cutter";
            return Err(toolpath.key_error(HOLDER, message, cure));
        }
        return Ok(of_scene.clone());
    }
    if of_scene.holder.is_some() && !toolpath.has(HOLDER) {
        let message = "the scene's cutter has a holder and this one has none: it would go unchecked";
        let cure = "add `[toolpath.holder]` with its `cutting_length` and `[[toolpath.holder.section]]`";
        return Err(toolpath.key_error(CUTTER, message, cure));
    }
    read(toolpath)
}

/// Refuses feeds that the machine does not reach: of the scene's cutter, or of a toolpath's own. `root` is the
/// scene.
pub(super) fn check_rates(
    root: &Section<'_>,
    of_scene: &Tooling,
    toolpaths: &[ToolpathRequest],
    machine: &Machine,
) -> Result<(), SceneError> {
    let sections = root.sections("toolpath")?;
    let own = sections.iter().filter(|section| section.has(CUTTER)).map(|section| section.section(CUTTER));
    let cutters: Vec<Section<'_>> =
        [root.section(CUTTER)].into_iter().chain(own).collect::<Result<_, _>>()?;
    let tools = toolpaths.iter().filter(|request| request.tooling != *of_scene);
    let tools = tools.map(|request| (format!("the `{CUTTER}` of \"{}\"", request.name), &request.tooling));
    for (place, tooling) in [(format!("[{CUTTER}]"), of_scene)].into_iter().chain(tools) {
        let CuttingData { feed_rate, plunge_rate, .. } = tooling.cutting;
        let too_fast = |(_, rate): &(&str, f64)| *rate > machine.rapid_rate;
        let Some((key, rate)) =
            [("feed_rate", feed_rate), ("plunge_rate", plunge_rate)].into_iter().find(too_fast)
        else {
            continue;
        };
        let states = |section: &&Section<'_>| {
            section.number(key, RATE, "").is_ok_and(|v| v.is_some_and(|v| v.value == rate))
        };
        let of_machine = root.section("machine")?;
        let (section, stated) = match cutters.iter().find(states) {
            Some(cutter) => (cutter, key),
            None => (&of_machine, "rapid_rate"),
        };
        let rapid_rate = machine.rapid_rate;
        let message =
            format!("`{key}` is {rate} mm/min, more than the machine's `rapid_rate` of {rapid_rate} mm/min");
        let cure = format!(
            "write `{key} = {rapid_rate}` in {place} or less, or a greater `rapid_rate` in [machine]"
        );
        return Err(section.key_error(stated, message, cure));
    }
    Ok(())
}

/// What holds the cutter, if the table says so.
fn read_holder(table: &Section<'_>, cutter: &Cutter) -> Result<Option<Holder>, SceneError> {
    if !table.has(HOLDER) {
        return Ok(None);
    }
    let holder = table.section(HOLDER)?;
    holder.only(&["cutting_length", "section"], &[], "[holder]")?;
    let length = match (holder.length("cutting_length")?, cutter.stated_length()) {
        (None, Some(length)) => length,
        (None, None) => holder.required_length("cutting_length", 20.0)?.value,
        // The cutter's own length is its side height within rounding, and is written as the default.
        (Some(length), stated) if length.value < cutter.side_height() && stated != Some(length.value) => {
            let message = format!(
                "the cutting length of {} mm ends below the cutter's full radius, at {:.4} mm",
                length.value,
                cutter.side_height()
            );
            return Err(holder.error(
                &length.span,
                message,
                "write how far the cutting edges reach up from the tip",
            ));
        }
        (Some(length), _) => length.value,
    };
    let sections = holder.sections("section")?.iter().map(HolderSection::read).collect::<Result<_, _>>()?;
    Holder::new(length, sections).map(Some).map_err(|e| {
        holder.error(
            holder.header(),
            e.to_string(),
            "add `[[holder.section]]` with `diameter` and `length` for shank and holder, the lowest first",
        )
    })
}

impl Tooling {
    /// Writes its tables; `of` is "" for the tool of the scene and "toolpath." for that of a toolpath.
    pub(super) fn write(&self, out: &mut String, of: &str) -> fmt::Result {
        writeln!(out, "\n[{of}{CUTTER}]  # mm, degrees")?;
        self.cutter.write(out)?;
        writeln!(out, "spindle_speed = {}  # rev/min", number(self.cutting.spindle_speed))?;
        writeln!(out, "feed_rate = {}  # mm/min", number(self.cutting.feed_rate))?;
        writeln!(out, "plunge_rate = {}  # mm/min", number(self.cutting.plunge_rate))?;
        let Some(holder) = &self.holder else { return Ok(()) };
        writeln!(out, "\n[{of}{HOLDER}]  # mm")?;
        writeln!(
            out,
            "cutting_length = {}  # the lowest section begins there",
            number(holder.cutting_length())
        )?;
        holder.sections().iter().try_for_each(|section| {
            writeln!(out, "\n[[{of}{HOLDER}.section]]")?;
            writeln!(out, "diameter = {}", number(section.diameter))?;
            writeln!(out, "top_diameter = {}", number(section.top_diameter))?;
            writeln!(out, "length = {}", number(section.length))
        })
    }
}
