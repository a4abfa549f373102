//! The tool table of LinuxCNC: a line for each tool, `T1 P1 Z50.0 D6.0 ;remark`.

use std::collections::BTreeMap;

use crate::cursor::Cursor;
use crate::error::{Fault, ProgramError, Stop};
use crate::lines::Lines;

/// What the table knows of a tool; lengths in mm.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TableTool {
    /// Offsets along X, Y and Z.
    pub length: [f64; 3],
    /// Diameter.
    pub diameter: f64,
    /// The remark behind the semicolon.
    pub remark: String,
}

/// Reads a table; `unit` is that of the machine, mm. `name` is what messages call it.
///
/// # Errors
/// [`ProgramError`] at the first word that is wrong.
pub fn read_tool_table(
    name: &str,
    bytes: &[u8],
    unit: f64,
) -> Result<BTreeMap<u32, TableTool>, ProgramError> {
    let lines = Lines::new(bytes).map_err(|(line, stop)| stop.in_line(name, line))?;
    let mut tools = BTreeMap::new();
    for line in 0..lines.len() {
        if let Some((number, tool)) =
            read_line(lines.get(line), unit).map_err(|stop| stop.in_line(name, line))?
        {
            tools.insert(number, tool);
        }
    }
    Ok(tools)
}

fn read_line(line: &[u8], unit: f64) -> Result<Option<(u32, TableTool)>, Stop> {
    let mut text = Cursor::new(line);
    let (mut number, mut tool) = (None, TableTool::default());
    loop {
        text.skip_blanks();
        let column = text.at();
        let Some(letter) = text.next().filter(|b| *b != b';') else { break };
        if !letter.is_ascii_alphabetic() {
            return Err(Stop::new(column, Fault::Character(char::from(letter))));
        }
        let value = text.number()?;
        match letter.to_ascii_uppercase() {
            b'T' if (0.0..1e9).contains(&value) => number = Some(value as u32),
            b'X' => tool.length[0] = value * unit,
            b'Y' => tool.length[1] = value * unit,
            b'Z' => tool.length[2] = value * unit,
            b'D' => tool.diameter = value * unit,
            b'P' | b'A' | b'B' | b'C' | b'U' | b'V' | b'W' | b'I' | b'J' | b'Q' => {}
            other => return Err(Stop::new(column, Fault::Unused(char::from(other)))),
        }
    }
    tool.remark = String::from_utf8_lossy(text.rest()).trim().to_owned();
    Ok(number.map(|number| (number, tool)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tools_are_read_and_faults_have_a_place() {
        let text = b"; a remark\nT1 P1 Z2.0 D0.25 ;ball\n\nt2 p2 x-1 z+3\n";
        let tools = read_tool_table("tool.tbl", text, 25.4).unwrap();
        let remark = "ball".to_owned();
        assert_eq!(tools[&1], TableTool { length: [0.0, 0.0, 50.8], diameter: 6.35, remark });
        assert_eq!(tools[&2].length, [-25.4, 0.0, 3.0 * 25.4]);
        let error = read_tool_table("tool.tbl", b"T1 Z2\nT2 Zx\n", 1.0).unwrap_err();
        assert_eq!((error.line, error.column), (2, 5));
    }
}
