//! What is wrong with a program before anything is cut: feeds without a spindle, without a feed, without a
//! tool, with the length of another tool, and a text that breaks off.

use crate::program::{Program, Setting, Spindle, StepKind};

/// What a check found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum FindingKind {
    /// The tool feeds while the spindle stands.
    SpindleOff,
    /// The tool feeds and no feed was given.
    NoFeed,
    /// The program names tools, and feeds before the first change.
    NoTool,
    /// The length of another tool is in force.
    OtherLength,
    /// The text ends without M2, M30 or a closing mark.
    NoEnd,
}

impl FindingKind {
    /// The word of reports.
    pub fn word(self) -> &'static str {
        match self {
            Self::SpindleOff => "spindle off",
            Self::NoFeed => "no feed",
            Self::NoTool => "no tool",
            Self::OtherLength => "tool length",
            Self::NoEnd => "no end",
        }
    }

    /// Whether it spoils the part or the tool; else it is a warning.
    pub fn is_violation(self) -> bool {
        self != Self::NoEnd
    }
}

/// Lengths that differ by less, mm, are the same: tables have three or four decimals.
const SAME_LENGTH: f64 = 1e-4;

/// Something wrong, at the first line where it shows.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Finding {
    /// What.
    pub kind: FindingKind,
    /// The first line, from 1.
    pub line: u32,
    /// The tool.
    pub tool: u32,
    /// Motions that it concerns.
    pub motions: usize,
    /// In a sentence.
    pub text: String,
}

impl Program {
    /// All findings, each kind once for each tool, in the order of their lines. `lengths` are those of the
    /// tools, mm, where they are known.
    pub fn findings(&self, lengths: &dyn Fn(u32) -> Option<f64>) -> Vec<Finding> {
        let mut found: Vec<Finding> = Vec::new();
        let named = self.settings.iter().any(|setting| setting.tool > 0);
        for step in &self.steps {
            if !matches!(step.kind, StepKind::Feed | StepKind::Arc(_)) {
                continue;
            }
            let setting = self.setting(step);
            let spins = setting.spindle != Spindle::Off && setting.speed > 0.0;
            let other = setting.register > 0 && setting.tool > 0 && setting.register != setting.tool;
            let known =
                lengths(setting.tool).filter(|length| (length - setting.length[2]).abs() > SAME_LENGTH);
            for (wrong, kind) in [
                (!spins && self.spins_at_all(), FindingKind::SpindleOff),
                (step.feed <= 0.0, FindingKind::NoFeed),
                (named && setting.tool == 0, FindingKind::NoTool),
                (other || known.is_some(), FindingKind::OtherLength),
            ] {
                if wrong {
                    note(&mut found, kind, step.line, setting, known);
                }
            }
        }
        if !self.ended && self.lines > 0 {
            let text = "the text ends without M2, M30 or %; it may be cut off".to_owned();
            let line = self.lines as u32;
            found.push(Finding { kind: FindingKind::NoEnd, line, tool: 0, motions: 0, text });
        }
        found.sort_by_key(|finding| finding.line);
        found
    }

    /// Locations by APT may say nothing of a spindle; a program of G-code has to.
    fn spins_at_all(&self) -> bool {
        self.axes.is_empty() || self.settings.iter().any(|setting| setting.spindle != Spindle::Off)
    }
}

fn note(found: &mut Vec<Finding>, kind: FindingKind, line: u32, setting: &Setting, known: Option<f64>) {
    let tool = setting.tool;
    if let Some(known) = found.iter_mut().find(|known| known.kind == kind && known.tool == tool) {
        known.motions += 1;
        return;
    }
    let text = match kind {
        FindingKind::SpindleOff => format!("line {line} feeds while the spindle is off"),
        FindingKind::NoFeed => format!("line {line} feeds and no F was given"),
        FindingKind::NoTool => format!("line {line} feeds before the first tool change (M6)"),
        FindingKind::OtherLength => match known {
            Some(known) => format!(
                "line {line} feeds tool {tool} as if it were {:.4} mm long; the table of tools has {known:.4} mm",
                setting.length[2]
            ),
            None => {
                format!("line {line} feeds tool {tool} with the length of register H{}", setting.register)
            }
        },
        FindingKind::NoEnd => String::new(),
    };
    found.push(Finding { kind, line, tool, motions: 1, text });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{GENERAL_CONTROL, Setup, read_gcode};

    fn kinds(text: &str) -> Vec<(FindingKind, u32)> {
        let program = read_gcode("a.nc", text.as_bytes(), GENERAL_CONTROL, &Setup::default()).unwrap();
        program.findings(&|_| None).iter().map(|finding| (finding.kind, finding.line)).collect()
    }

    #[test]
    fn each_is_found_at_its_first_line() {
        let sound = "T1 M6\nS1000 M3\nG43 H1\nG0 X1 Y1 Z5\nG1 Z-1 F100\nX2\nM30\n";
        assert_eq!(kinds(sound), []);
        assert_eq!(kinds(&sound.replace("M3\n", "\n")), [(FindingKind::SpindleOff, 5)]);
        assert_eq!(kinds(&sound.replace(" F100", "")), [(FindingKind::NoFeed, 5)]);
        assert_eq!(kinds(&sound.replace("H1", "H2")), [(FindingKind::OtherLength, 5)]);
        assert_eq!(kinds(&sound.replace("M30\n", "")), [(FindingKind::NoEnd, 6)]);
        let late = "S1000 M3\nG1 X1 F100\nT1 M6\nM3\nG1 X2\nM30\n";
        assert_eq!(kinds(late), [(FindingKind::NoTool, 2)]);
    }
}
