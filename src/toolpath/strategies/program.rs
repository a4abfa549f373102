//! A program from elsewhere: G-code or cutter locations of another system. It plans nothing; its path is read from a file and
//! cut and measured like any other.

use std::fmt::{self, Write as _};
use std::sync::Arc;

use crate::vocabulary::{Definition, PartKind, Passes, PlanError, Strategy, Task};
use cutter::Cutter;
use keys::{Located, toml_string};
use motion::Toolpath;
use program::{Control, Finding};

/// Greatest number of a tool.
const MOST_TOOLS: u32 = 99_999_999;

/// A program from elsewhere.
#[derive(Debug, Clone)]
pub struct ForeignProgram {
    /// The file as a scene names it.
    pub file: String,
    /// The control that it is written for.
    pub control: &'static str,
    /// The tool whose moves are meant; `None` where the program has one only.
    pub tool: Option<u32>,
    /// A table of tools as a scene names it: their lengths, which the control's registers are taken to hold.
    pub tools: Option<String>,
    /// What was read from the file; `None` until it is.
    pub read: Option<Arc<ReadProgram>>,
}

/// What was read from the file of a program.
#[derive(Debug, Clone, PartialEq)]
pub struct ReadProgram {
    /// The moves of the tool.
    pub path: Toolpath,
    /// What other tools of the program cut before, where the table of tools has their cutters.
    pub before: Vec<(Cutter, Toolpath)>,
    /// Whether other tools feed before this one whose cutters are not known.
    pub unknown_before: bool,
    /// Whether other tools feed at all.
    pub others: bool,
    /// What is wrong with it before it is cut.
    pub findings: Vec<Finding>,
    /// What is to be said of it.
    pub notes: Vec<String>,
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
        let tool = from.section.count("tool", 0..=MOST_TOOLS)?;
        let tools = from.section.text("tools")?;
        let named = |text: &Located<&str>| Located { value: text.value.to_owned(), span: text.span.clone() };
        from.tables.extend(std::iter::once(&file).chain(&tools).map(named));
        let tools = tools.map(|tools| tools.value.to_owned());
        let program = ForeignProgram { file: file.value.to_owned(), control, tool, tools, read: None };
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
        if let Some(tool) = self.tool {
            writeln!(out, "tool = {tool}")?;
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
