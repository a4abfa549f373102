//! A program from elsewhere: G-code or cutter locations of another system. It plans nothing; its path is read
//! from a file and cut and measured like any other.

use std::collections::BTreeMap;
use std::fmt::{self, Write as _};
use std::sync::Arc;

use crate::vocabulary::{Definition, PartKind, Passes, PlanError, Strategy, Task};
use cutter::{Cutter, Holder};
use keys::{Located, toml_string};
use machine::kinematics::{Kinematics, Waypoint};
use motion::{Cutters, Toolpath};
use program::{Control, Finding};

/// Greatest number of a tool.
const MOST_TOOLS: u32 = 99_999_999;

/// Which tools of a program are measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ToolsMeant {
    /// The one that cuts; there is no other.
    TheOnly,
    /// The tool of a number, with the scene's cutter.
    Number(u32),
    /// All, one after the other on one part, each with its own cutter.
    All,
}

/// How scenes spell all tools.
pub const ALL_TOOLS: &str = "all";

/// A program from elsewhere.
#[derive(Debug, Clone)]
pub struct ForeignProgram {
    /// The file as a scene names it.
    pub file: String,
    /// The control that it is written for.
    pub control: &'static str,
    /// The tools whose moves are meant.
    pub tools_meant: ToolsMeant,
    /// A table of tools as a scene names it: their lengths, which the control's registers are taken to hold.
    pub tools: Option<String>,
    /// What was read from the file; `None` until it is.
    pub read: Option<Arc<ReadProgram>>,
}

/// What was read from the file of a program.
#[derive(Debug, Clone, PartialEq)]
pub struct ReadProgram {
    /// The moves of the tool, or of all.
    pub path: Toolpath,
    /// The joints of a machine with rotary axes, and the pace, that the program goes through, for each
    /// stretch of a tool, with its number. None of cutter locations, and on other machines.
    pub joints: Vec<(u32, Vec<Waypoint>)>,
    /// Where the rotary axes of a table stand in the joints' zero, rad, first and second axis; a head's stand
    /// at zero.
    pub table_zero: [f64; 2],
    /// Under which setting of the control rapid moves run straight, in a clause; `None` where they always do.
    pub straight_rapids: Option<&'static str>,
    /// How far the program lets the control round corners, mm, which the path's strays have as well.
    pub rounded: f64,
    /// The cutters of all tools and what holds them, where all are meant; else the scene's cutter makes all
    /// moves.
    pub tools: Option<(Cutters, Vec<Option<Holder>>)>,
    /// Lengths of tools from the spindle nose to the tip by their numbers, mm, as far as the table of tools
    /// has them.
    pub gauge_lengths: BTreeMap<u32, f64>,
    /// What other tools of the program cut before, where the table of tools has their cutters.
    pub before: Vec<(Cutter, Toolpath)>,
    /// Whether other tools feed before this one whose cutters are not known.
    pub unknown_before: bool,
    /// Whether other tools feed at all.
    pub others: bool,
    /// Its highest feed where no rotary axis turns, mm/min, and the line.
    pub highest_feed: Option<(f64, u32)>,
    /// What is wrong with it before it is cut.
    pub findings: Vec<Finding>,
    /// What is to be said of it.
    pub notes: Vec<String>,
}

impl ReadProgram {
    /// The machine with a tool, whose length is the machine's own where the table of tools has none.
    pub fn with_tool(&self, machine: &Kinematics, tool: u32) -> Kinematics {
        let own = self.gauge_lengths.get(&tool).copied();
        machine.with_gauge_length(own.unwrap_or(machine.gauge_length()))
    }
}

/// How scenes speak of it.
pub(crate) static DEFINITION: Definition = Definition {
    word: "program",
    help: "a program from elsewhere, in G-code or APT: cut, measured and judged as it is",
    part: PartKind::Any,
    keys: &["file", "control", "tool", "tools"],
    read: |from| {
        let file = from.section.required_text("file", "job.nc")?;
        let control = from.section.word("control", &Control::words())?;
        let control = control.map_or(program::GENERAL_CONTROL.word, |word| word.value);
        let tools_meant = if from.section.is_text("tool") {
            from.section.word("tool", &[ALL_TOOLS])?;
            ToolsMeant::All
        } else {
            from.section.count("tool", 0..=MOST_TOOLS)?.map_or(ToolsMeant::TheOnly, ToolsMeant::Number)
        };
        let tools = from.section.text("tools")?;
        let named = |text: &Located<&str>| Located { value: text.value.to_owned(), span: text.span.clone() };
        from.tables.extend(std::iter::once(&file).chain(&tools).map(named));
        let tools = tools.map(|tools| tools.value.to_owned());
        let program = ForeignProgram { file: file.value.to_owned(), control, tools_meant, tools, read: None };
        Ok(Box::new(program))
    },
};

impl Strategy for ForeignProgram {
    fn definition(&self) -> &'static Definition {
        &DEFINITION
    }

    fn write(&self, out: &mut String) -> fmt::Result {
        writeln!(out, "file = {}", toml_string(&self.file))?;
        writeln!(out, "control = \"{}\"", self.control)?;
        match self.tools_meant {
            ToolsMeant::TheOnly => {}
            ToolsMeant::Number(tool) => writeln!(out, "tool = {tool}")?,
            ToolsMeant::All => writeln!(out, "tool = \"{ALL_TOOLS}\"")?,
        }
        match &self.tools {
            Some(tools) => writeln!(out, "tools = {}", toml_string(tools)),
            None => Ok(()),
        }
    }

    fn passes(&self, _: &Task<'_>) -> Result<Passes, PlanError> {
        let reason = "a program is read from its file and not planned".to_owned();
        Err(PlanError::NotApplicable { strategy: DEFINITION.word, reason })
    }

    fn both_ways(&self) -> bool {
        false
    }
}
