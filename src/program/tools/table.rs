//! A table of tools in TOML: `[[tool]]` with `number`, the keys of a cutter, and what holds it.

use super::remark::{Said, cutter_of_remark, cutter_of_table, number_of_remark, same_cutter};
use super::tbl::read_tool_table;
use crate::error::ProgramError;
use crate::program::Program;
use cutter::{Cutter, Holder, HolderSection};
use keys::{SceneError, SceneText, Section};

/// A tool.
#[derive(Debug, Clone, PartialEq)]
pub struct Tool {
    /// Its number in programs.
    pub number: u32,
    /// What cuts.
    pub cutter: Cutter,
    /// From the spindle nose to the tip, mm, where it was measured.
    pub gauge_length: Option<f64>,
    /// What holds it.
    pub holder: Option<Holder>,
}

/// All tools.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ToolTable {
    /// In the order of the table.
    pub tools: Vec<Tool>,
}

/// Keys of a tool besides those of its cutter.
const BESIDES: [&str; 4] = ["number", "gauge_length", "cutting_length", "holder"];

/// Greatest number of a tool.
const MOST: u32 = 99_999_999;

impl ToolTable {
    /// Reads a table.
    ///
    /// # Errors
    /// [`SceneError`] at the first thing that is wrong.
    pub fn read(source: &SceneText) -> Result<Self, SceneError> {
        let table = source.table()?;
        let root = Section::whole(source, table.get_ref(), "the table of tools");
        root.only(&["tool"], &[], "a table of tools")?;
        let sections = root.sections("tool")?;
        if sections.is_empty() {
            let cure = "add `[[tool]]` with `number = 1`, `shape = \"ball\"` and `diameter = 6.0`";
            return Err(root.error(root.header(), "the table has no tool", cure));
        }
        let mut tools: Vec<Tool> = Vec::new();
        for section in &sections {
            let tool = read(section)?;
            if tools.iter().any(|other| other.number == tool.number) {
                let message = format!("two tools have the number {}", tool.number);
                return Err(section.key_error("number", message, "give each its own"));
            }
            tools.push(tool);
        }
        Ok(Self { tools })
    }

    /// The tools of a table of LinuxCNC in mm, as far as their remarks do not name another kind of tool than
    /// an end mill: a ball by the word, a corner radius as `CR=1`, else flat.
    ///
    /// # Errors
    /// [`ProgramError`] at the first word that is wrong.
    pub fn of_linuxcnc(name: &str, bytes: &[u8]) -> Result<Self, ProgramError> {
        let tools = read_tool_table(name, bytes, 1.0)?.into_iter().filter_map(|(number, tool)| {
            let cutter = cutter_of_table(&tool.remark, tool.diameter)?;
            let gauge_length = Some(tool.length[2]).filter(|length| *length != 0.0);
            Some(Tool { number, cutter, gauge_length, holder: None })
        });
        Ok(Self { tools: tools.collect() })
    }

    /// The tool of a number.
    pub fn get(&self, number: u32) -> Option<&Tool> {
        self.tools.iter().find(|tool| tool.number == number)
    }
}

/// What a program says of its cutters, in comments or in CUTTER of APT.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Described {
    /// The tools whose cutters it says.
    pub table: ToolTable,
    /// Their numbers, and the lines that say them.
    lines: Vec<(u32, u32)>,
    /// What cannot be read without a guess.
    doubts: Vec<Doubt>,
}

/// A comment, or two, that leave open which cutter a tool is.
#[derive(Debug, Clone, PartialEq)]
struct Doubt {
    /// Where that is known.
    tool: Option<u32>,
    /// In a clause.
    text: String,
}

/// Most doubts that are kept; more tell nothing new.
const MOST_DOUBTS: usize = 20;

impl Described {
    /// What a program says. A comment without a number is about the only tool in use. Where two comments
    /// differ, none counts.
    pub fn of(program: &Program) -> Self {
        let used = program.tools_in_use();
        let unit = (!program.both_units).then_some(program.unit);
        let mut described = Self::default();
        let mut differ: Vec<u32> = Vec::new();
        for remark in &program.tools {
            let number = match (remark.tool, number_of_remark(&remark.text), &used[..]) {
                (0, None, [only]) => Some(*only),
                (0, None, _) => None,
                (0, Some(number), _) | (number, _, _) => Some(number),
            };
            let line = remark.line;
            match (cutter_of_remark(&remark.text, unit), number) {
                (Said::Nothing, _) | (Said::Cutter(_), None) => {}
                (Said::Unclear(reason), tool) => {
                    described.doubt(tool, format!("line {line} does not say the cutter: {reason}"));
                }
                (Said::Cutter(cutter), Some(number)) => match described.of_tool(number) {
                    None => {
                        described.table.tools.push(Tool { number, cutter, gauge_length: None, holder: None });
                        described.lines.push((number, line));
                    }
                    Some((first, before)) if !same_cutter(&first, &cutter) => {
                        let [first, second] = [&first, &cutter].map(Cutter::short_name);
                        let text = format!(
                            "lines {before} and {line} say different cutters of tool {number}, {first} and {second}"
                        );
                        described.doubt(Some(number), text);
                        differ.push(number);
                    }
                    Some(_) => {}
                },
            }
        }
        described.table.tools.retain(|tool| !differ.contains(&tool.number));
        described
    }

    fn doubt(&mut self, tool: Option<u32>, text: String) {
        if self.doubts.len() < MOST_DOUBTS {
            self.doubts.push(Doubt { tool, text });
        }
    }

    /// The cutter that a program says of a tool, and the line.
    pub fn of_tool(&self, number: u32) -> Option<(Cutter, u32)> {
        let line = self.lines.iter().find(|(tool, _)| *tool == number)?.1;
        Some((self.table.get(number)?.cutter, line))
    }

    /// Why the cutter of a tool, or of any, is open, in clauses.
    pub fn doubts(&self, number: Option<u32>) -> impl Iterator<Item = &str> {
        let about = move |doubt: &&Doubt| number.is_none() || doubt.tool.is_none() || doubt.tool == number;
        self.doubts.iter().filter(about).map(|doubt| doubt.text.as_str())
    }
}

fn read(section: &Section<'_>) -> Result<Tool, SceneError> {
    let cutter = Cutter::read(section, &BESIDES)?;
    let number = section.count("number", 0..=MOST)?.ok_or_else(|| {
        section.error(
            section.header(),
            "the tool has no `number`",
            "add `number = 1`, as T has it in programs",
        )
    })?;
    let gauge_length = section.length("gauge_length")?.map(|length| length.value);
    Ok(Tool { number, cutter, gauge_length, holder: read_holder(section, &cutter)? })
}

/// Shank and holder, the lowest section first, from the end of the cutting edges on.
fn read_holder(section: &Section<'_>, cutter: &Cutter) -> Result<Option<Holder>, SceneError> {
    let sections = section.sections("holder")?;
    let length = section.length("cutting_length")?;
    if sections.is_empty() {
        return Ok(None);
    }
    let length = match (length, cutter.stated_length()) {
        (Some(length), _) => length.value,
        (None, Some(length)) => length,
        (None, None) => section.required_length("cutting_length", 20.0)?.value,
    };
    let sections = sections.iter().map(HolderSection::read).collect::<Result<_, _>>()?;
    Holder::new(length, sections).map(Some).map_err(|e| {
        let cure =
            "add `[[tool.holder]]` with `diameter` and `length` for shank and holder, the lowest first";
        section.error(section.header(), e.to_string(), cure)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(text: &str) -> Result<ToolTable, SceneError> {
        ToolTable::read(&SceneText::new("tools.toml", text))
    }

    #[test]
    fn tools_have_cutters_lengths_and_holders() {
        let text = "[[tool]]\nnumber = 1\nshape = \"ball\"\ndiameter = 6\ngauge_length = 80\ncutting_length = 20\n\
                    [[tool.holder]]\ndiameter = 6\nlength = 30\n[[tool]]\nnumber = 7\nshape = \"flat\"\ndiameter = 10\n";
        let tools = table(text).unwrap();
        assert_eq!(tools.get(7).unwrap().cutter, Cutter::flat(10.0).unwrap());
        let first = tools.get(1).unwrap();
        assert_eq!((first.gauge_length, first.holder.as_ref().unwrap().cutting_length()), (Some(80.0), 20.0));
        assert!(tools.get(2).is_none());
    }

    #[test]
    fn tables_of_linuxcnc_and_comments_of_posts_describe_cutters() {
        let text = b"T1 P1 Z80 D6 ;ball nose\nT2 P2 D10 ;rougher CR=2\nT3 D5 ;drill\nT4 D8\n";
        let tools = ToolTable::of_linuxcnc("tool.tbl", text).unwrap();
        let cutter = |number: u32| tools.get(number).map(|tool| tool.cutter);
        assert_eq!((cutter(1), cutter(2)), (Cutter::ball(6.0).ok(), Cutter::bull(10.0, 2.0).ok()));
        assert_eq!((cutter(3), cutter(4)), (None, Cutter::flat(8.0).ok()));
        assert_eq!(tools.get(1).unwrap().gauge_length, Some(80.0));
        let read = |text: &str| {
            let program = crate::read_gcode(
                "job.nc",
                text.as_bytes(),
                crate::GENERAL_CONTROL,
                &crate::Setup::default(),
            );
            Described::of(&program.unwrap()).table
        };
        let tools = read("(T5 D=0.25 CR=0.125 - BALL)\nG20\nT5 M6\nG0 X1\n");
        assert_eq!(tools.get(5).unwrap().cutter, Cutter::ball(6.35).unwrap());
        let tools = read("G21\nT7 M6 (FLAT END MILL D=8)\nG0 X1\n(T9 D=3)\n");
        assert_eq!((tools.tools.len(), tools.get(7).unwrap().cutter), (2, Cutter::flat(8.0).unwrap()));
        for line in
            ["O1000 (T1 D=6. CR=3. - ball)", ":1000(T1 D=6. CR=3. - ball)", "O1000 ;T1 D=6. CR=3. - ball"]
        {
            let tools = read(&format!("%\n{line}\nG21\nT1 M6\nG0 X1\nM30\n%\n"));
            assert_eq!(tools.get(1).map(|tool| tool.cutter), Cutter::ball(6.0).ok(), "{line}");
        }
        for text in ["(BALL END D=6.0)\nT3 M6\nG0 X1\n", "O1000 (BALL END D=6.0) T3 M6\nG0 X1\n"] {
            assert_eq!(read(text).get(3).unwrap().cutter, Cutter::ball(6.0).unwrap());
        }
    }

    #[test]
    fn comments_that_differ_or_are_unclear_are_told_by_their_lines() {
        let described = |text: &str| {
            let read = crate::read_gcode(
                "job.nc",
                text.as_bytes(),
                crate::GENERAL_CONTROL,
                &crate::Setup::default(),
            );
            Described::of(&read.unwrap())
        };
        let twice = described("(T1 D=20. CR=10. - ball)\n(T2 D=3)\n(T1 D=6. CR=3. - ball)\nT1 M6\nG0 X1\n");
        assert!(twice.of_tool(1).is_none() && twice.of_tool(2).is_some_and(|(_, line)| line == 2));
        let doubts: Vec<&str> = twice.doubts(Some(1)).collect();
        assert_eq!(doubts, ["lines 1 and 3 say different cutters of tool 1, ball:20 and ball:6"]);
        assert_eq!(twice.doubts(Some(2)).count(), 0);
        let same = described("(T1 D=20. CR=10. - ball)\n(T1 D=20. CR=10.)\nT1 M6\nG0 X1\n");
        assert_eq!((same.of_tool(1).map(|(_, line)| line), same.doubts(None).count()), (Some(1), 0));
        // What is unclear hides nothing that is clear.
        let old = described("(OLD: T1 D=20. CR=10.)\n(T1 D=6.)\nT1 M6\nG0 X1\n");
        assert_eq!(old.of_tool(1), Some((Cutter::flat(6.0).unwrap(), 2)));
        assert!(
            old.doubts(Some(1))
                .next()
                .unwrap()
                .starts_with("line 1 does not say the cutter: it has the word OLD")
        );
        // A program that counts in both units leaves a number without one open.
        let both = described("(T1 D=1)\n(T2 D=6MM)\nG20\nT1 M6\nG0 X1\nG21\nT2 M6\nX1\n");
        assert!(both.of_tool(1).is_none() && both.of_tool(2).is_some());
    }

    #[test]
    fn faults_are_refused() {
        for text in [
            "",
            "[[tool]]\nshape = \"ball\"\ndiameter = 6\n",
            "[[tool]]\nnumber = 1\nshape = \"ball\"\ndiametr = 6\n",
            "[[tool]]\nnumber = 1\nshape = \"ball\"\ndiameter = 6\n[[tool]]\nnumber = 1\nshape = \"ball\"\ndiameter = 6\n",
            "[[tool]]\nnumber = 1\nshape = \"ball\"\ndiameter = 6\n[[tool.holder]]\ndiameter = 6\nlength = 30\n",
        ] {
            assert!(table(text).is_err(), "{text}");
        }
    }
}
