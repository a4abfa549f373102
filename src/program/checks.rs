//! What is wrong with a program before anything is cut: feeds without a spindle, without a feed, without a
//! tool, with the length of another tool or with several lengths, and a text that breaks off.

use crate::program::{Program, Setting, Spindle, Step, StepKind, Unset};

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
    /// A tool feeds under several lengths, and which of them is its own is not known.
    SeveralLengths,
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
            Self::SeveralLengths => "tool lengths",
            Self::NoEnd => "no end",
        }
    }

    /// Whether it spoils the part or the tool, or may do so; else it is a warning.
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
        for step in self.steps.iter().filter(|step| step.feeds()) {
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
        self.several_lengths(lengths, &mut found);
        if !self.ended && self.lines > 0 {
            let text = "the text ends without M2, M30 or %; it may be cut off".to_owned();
            let line = self.lines as u32;
            found.push(Finding { kind: FindingKind::NoEnd, line, tool: 0, motions: 0, text });
        }
        found.sort_by_key(|finding| finding.line);
        found
    }

    /// A tool has one length from its change to the next: where it feeds under two, the tip is not where the
    /// control takes it to be under one of them. A known length is compared with each.
    fn several_lengths(&self, lengths: &dyn Fn(u32) -> Option<f64>, found: &mut Vec<Finding>) {
        let mut first: Option<(&Step, &Setting)> = None;
        for step in self.steps.iter().filter(|step| step.kind != StepKind::Set) {
            let setting = self.setting(step);
            first = first.filter(|(_, first)| first.tool == setting.tool);
            if !step.feeds() || lengths(setting.tool).is_some() {
                continue;
            }
            let (before, taken) = *first.get_or_insert((step, setting));
            let apart = (0..3).any(|k| (taken.length[k] - setting.length[k]).abs() > SAME_LENGTH);
            if apart || taken.unset != setting.unset {
                let (line, tool, other) = (step.line, setting.tool, before.line);
                let text = || {
                    let [now, then] = [setting, taken].map(by_length);
                    format!("line {line} feeds tool {tool} {now}, and line {other} {then}")
                };
                push(found, FindingKind::SeveralLengths, line, tool, text);
            }
        }
    }

    /// Locations by APT may say nothing of a spindle; a program of G-code has to.
    fn spins_at_all(&self) -> bool {
        self.axes.is_empty() || self.settings.iter().any(|setting| setting.spindle != Spindle::Off)
    }
}

/// What a feed takes the tool's length for.
fn by_length(setting: &Setting) -> String {
    let [x, y, z] = setting.length;
    let aside = if x == 0.0 && y == 0.0 { String::new() } else { format!(" and X{x:.4} Y{y:.4} aside") };
    let more = if z == 0.0 { String::new() } else { format!(" and {z:.4} mm") };
    match setting.unset {
        Unset::Nothing => format!("as if it were {z:.4} mm long{aside}"),
        Unset::Plus(register) => format!("by the length in H{register}, which nothing sets{more}{aside}"),
        Unset::Minus(register) => {
            format!("by the length in H{register} taken off, which nothing sets{more}{aside}")
        }
        Unset::Sum(line) => format!("by the sum of lengths in line {line}, which nothing sets{aside}"),
    }
}

/// Counts a motion for a finding, or notes it as the first one.
fn push(found: &mut Vec<Finding>, kind: FindingKind, line: u32, tool: u32, text: impl FnOnce() -> String) {
    match found.iter_mut().find(|known| known.kind == kind && known.tool == tool) {
        Some(known) => known.motions += 1,
        None => found.push(Finding { kind, line, tool, motions: 1, text: text() }),
    }
}

fn note(found: &mut Vec<Finding>, kind: FindingKind, line: u32, setting: &Setting, known: Option<f64>) {
    let tool = setting.tool;
    let text = || match kind {
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
        FindingKind::SeveralLengths | FindingKind::NoEnd => String::new(),
    };
    push(found, kind, line, tool, text);
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
        assert_eq!(kinds(&sound.replace("X2", "G49 X2")), [(FindingKind::SeveralLengths, 6)]);
        let late = "S1000 M3\nG1 X1 F100\nT1 M6\nM3\nG1 X2\nM30\n";
        assert_eq!(kinds(late), [(FindingKind::NoTool, 2)]);
    }

    /// What a control reads of a program whose tool feeds under H1, and then does `then`.
    fn texts(then: &str, control: &'static crate::Control, known: Option<f64>) -> Vec<String> {
        let text = format!("T1 M6\nS1000 M3\nG43 H1\nG0 X1 Y1 Z50\nG1 Z-1 F100\n{then}\nM30\n");
        let program = read_gcode("a.nc", text.as_bytes(), control, &Setup::default()).unwrap();
        program.findings(&|_| known).into_iter().map(|found| found.text).collect()
    }

    #[test]
    fn a_tool_that_feeds_under_two_lengths_is_found() {
        let set = "G10 L10 P1 R20.\nG43 H1\nG1 X3\n";
        let fanuc = |then: &str| {
            texts(
                &format!("T2 M6\nM3\n{set}{then}").replace("H1", "H2").replace("P1", "P2"),
                control("fanuc"),
                None,
            )
        };
        let first = "line 10 as if it were 20.0000 mm long";
        for (then, now) in [
            ("G49\nG1 Z15.", "line 12 feeds tool 2 as if it were 0.0000 mm long"),
            ("G49\nG2 X4 I.5", "line 12 feeds tool 2 as if it were 0.0000 mm long"),
            ("G49\nG81 Z-1. R2.", "line 12 feeds tool 2 as if it were 0.0000 mm long"),
            ("G43 H0\nG1 Z15.", "line 12 feeds tool 2 as if it were 0.0000 mm long"),
            ("G44 H1\nG1 Z15.", "line 12 feeds tool 2 as if it were -20.0000 mm long"),
            ("G10 L11 P1 R-.02\nG43 H1\nG1 Z15.", "line 13 feeds tool 2 as if it were 19.9800 mm long"),
            ("G10 L10 P1 R15.\nG43 H1\nG1 Z15.", "line 13 feeds tool 2 as if it were 15.0000 mm long"),
            ("G49\nM98 P9\nM30\nO9\nG1 Z15.\nM99", "line 15 feeds tool 2 as if it were 0.0000 mm long"),
        ] {
            assert_eq!(fanuc(then), [format!("{now}, and {first}")], "{then}");
        }
        let linuxcnc = |then: &str| texts(then, control("linuxcnc"), None);
        let unset = "line 5 by the length in H1, which nothing sets";
        for (then, now) in [
            ("G49\nG1 Z15", "line 7 feeds tool 1 as if it were 0.0000 mm long"),
            ("G43.1 Z-5\nG1 Z1", "line 7 feeds tool 1 as if it were -5.0000 mm long"),
            ("G10 L1 P1 Z20\nG43 H1\nG1 Z1", "line 8 feeds tool 1 as if it were 20.0000 mm long"),
            ("G43.2 H1\nG1 Z1", "line 7 feeds tool 1 by the sum of lengths in line 6, which nothing sets"),
        ] {
            assert_eq!(linuxcnc(then), [format!("{now}, and {unset}")], "{then}");
        }
    }

    #[test]
    fn one_length_and_what_does_not_feed_under_another_is_no_finding() {
        for then in [
            "G43 H1\nG1 X2",
            "H1\nG1 X2",
            "G49\nG0 Z90\nG91 G28 Z0\nG90 G43 H1\nG0 Z5\nG1 Z0",
            "G49\nT2 M6\nM3\nG1 X2",
            "G10 L10 P2 R15.\nG1 X2",
        ] {
            assert_eq!(texts(then, control("fanuc"), None), Vec::<String>::new(), "{then}");
        }
        assert_eq!(kinds("T1 M6\nS1 M3\nG0 X1 Y1 Z5\nG1 Z-1 F100\nG49 X2\nM30\n"), []);
        // A length that is known is compared with each.
        let known = texts("G10 L10 P1 R20.\nG43 H1\nG1 X2\nG49\nG1 X3", control("fanuc"), Some(20.0));
        assert_eq!(known.len(), 1);
        assert!(known[0].contains("the table of tools has 20.0000 mm"), "{known:?}");
    }

    fn control(word: &str) -> &'static crate::Control {
        crate::Control::from_word(word).unwrap()
    }
}
