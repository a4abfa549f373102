//! Writes a toolpath as a plain ISO 6983 program for three axes: G0, G1, F and the axis words that
//! changed, and G2 and G3 where arcs are asked for. mm, mm/min, absolute; middles of arcs from their start.
//!
//! There is no O-number, because controls disagree about what an O-word is, no tool change and no length
//! offset: the tip is taken to be where the program says. Rapids are simulated as straight lines; a
//! control whose G0 runs each axis at its own speed strays from them.
//!
//! [`write_five_axis`] writes programs for machines with two rotary axes.

mod arcs;
mod five_axis;

#[cfg(test)]
pub(crate) use five_axis::tests as five_axis_tests;
pub use five_axis::{FiveAxisPost, Style, TCP_WORDS, write_five_axis};

use super::program_text::{NO_MOVES, ProgramHeader, describe, number};
use arcs::Arc;
pub use arcs::ArcRule;
use cutter::Cutter;
use geometry::Point3;
use motion::{Move, MoveKind, Toolpath, in_last_decimals};
use std::fmt::Write as _;
use std::io::{self, Write};

/// For each move of the path the line of the program, counted from 1, on which it is reached.
pub type MoveLines = Vec<u32>;

/// Writes the program of a path whose tool axis is z throughout ([`Toolpath::is_upright`]; any other needs
/// [`write_five_axis`], and where no machine is given, cutter locations only) and tells the line of each
/// move. A move that rounds to where the tip already is has no line of its own: it gets the line that brought
/// the tip there.
///
/// Coordinates and feeds are rounded to four decimals, so each stands within 0.05 µm of the path. Before the
/// first move the tip rises to the highest tip of the path, or to what the header asks for, moves over its
/// start and comes down there; after the last one it rises again. Where there is no move the spindle stands.
///
/// With a rule for `arcs`, moves of one feed become one arc where it stays near to them. It is the line of
/// them all.
///
/// # Errors
/// Whatever the writer returns; a path with a tilted tool.
pub fn write(
    writer: &mut dyn Write,
    path: &Toolpath,
    cutter: &Cutter,
    header: &ProgramHeader,
    arcs: Option<ArcRule>,
) -> io::Result<MoveLines> {
    if !path.is_upright() {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "three axes cannot tilt the tool"));
    }
    let mut program = ThreeAxisProgram { writer, lines: 0, tip: [None; 3], code: None, feed: None };
    let start = path.start.tip;
    let top = path.moves.iter().map(|m| m.to.tip.z).fold(start.z, f64::max);
    let top = header.rise_to.map_or(top, |least| top.max(least));
    program.line("%")?;
    program.line(&format!("({})", header.plain_name()))?;
    program.line(&format!("({})", describe(cutter)))?;
    program.line("(MM, TIP OF THE CUTTER)")?;
    program.line("G17 G21 G40 G80 G90 G94")?;
    let speed = header.speed_for(path);
    if let Some(speed) = speed {
        program.line(&format!("S{} M3", speed.round()))?;
    }
    if path.is_empty() {
        program.line(&format!("({NO_MOVES})"))?;
    }
    program.rise(top)?;
    program.go(Point3::new(start.x, start.y, top), None)?;
    program.go(start, None)?;
    let mut lines = Vec::with_capacity(path.len());
    while let Some(step) = path.moves.get(lines.len()) {
        let feed = (step.kind != MoveKind::Rapid).then_some(step.feed_rate);
        let arc = feed.zip(arcs).and_then(|(_, rule)| arc_from(path, lines.len(), &rule));
        match arc.zip(feed) {
            Some((arc, feed)) => {
                program.arc(&arc, path.moves[lines.len() + arc.moves - 1].to.tip, feed)?;
                lines.extend(std::iter::repeat_n(program.lines, arc.moves));
            }
            None => {
                program.go(step.to.tip, feed)?;
                lines.push(program.lines);
            }
        }
    }
    program.rise(top)?;
    if speed.is_some() {
        program.line("M5")?;
    }
    program.line("M30")?;
    program.line("%")?;
    Ok(lines)
}

/// The arc that begins with a move.
fn arc_from(path: &Toolpath, first: usize, rule: &ArcRule) -> Option<Arc> {
    /// Longer arcs go on as another one.
    const MOST_MOVES: usize = 1000;
    let feed = path.moves[first].feed_rate;
    let same =
        |m: &&Move| m.kind != MoveKind::Rapid && in_last_decimals(m.feed_rate) == in_last_decimals(feed);
    let tips = path.moves[first..].iter().take(MOST_MOVES).take_while(same).map(|m| m.to.tip);
    let mut places: Vec<Point3> = Vec::new();
    for tip in std::iter::once(path.start_of(first)).chain(tips) {
        places.push(arcs::written(&tip));
        // Most moves are no arcs, and their first ones tell.
        if places.len() == arcs::LEAST_MOVES + 1 && arcs::longest(&places, feed, rule).is_none() {
            return None;
        }
    }
    arcs::longest(&places, feed, rule)
}

/// A program in the making, and what its last lines have left in force.
struct ThreeAxisProgram<'a> {
    writer: &'a mut dyn Write,
    lines: u32,
    /// In the units of [`in_last_decimals`].
    tip: [Option<f64>; 3],
    /// The number of the G word: 0 to 3.
    code: Option<u8>,
    feed: Option<f64>,
}

impl ThreeAxisProgram<'_> {
    fn line(&mut self, text: &str) -> io::Result<()> {
        self.lines += 1;
        writeln!(self.writer, "{text}")
    }

    /// A rapid to height `z` alone.
    fn rise(&mut self, z: f64) -> io::Result<()> {
        self.step([None, None, Some(z)], None)
    }

    fn go(&mut self, to: Point3, feed: Option<f64>) -> io::Result<()> {
        self.step([Some(to.x), Some(to.y), Some(to.z)], feed)
    }

    fn arc(&mut self, arc: &Arc, to: Point3, feed: f64) -> io::Result<()> {
        let words = self.axis_words([Some(to.x), Some(to.y), Some(to.z)]);
        let middle = format!(" I{} J{}", number(arc.middle.x), number(arc.middle.y));
        self.motion(if arc.clockwise { 2 } else { 3 }, &(words + &middle), Some(feed))
    }

    /// A line with the words that change; none when no axis does.
    fn step(&mut self, to: [Option<f64>; 3], feed: Option<f64>) -> io::Result<()> {
        let words = self.axis_words(to);
        if words.is_empty() {
            return Ok(());
        }
        self.motion(u8::from(feed.is_some()), &words, feed)
    }

    /// The words of the axes that change.
    fn axis_words(&mut self, to: [Option<f64>; 3]) -> String {
        let mut words = String::new();
        for ((axis, value), tip) in ["X", "Y", "Z"].into_iter().zip(to).zip(&mut self.tip) {
            let Some(value) = value else { continue };
            if *tip != Some(in_last_decimals(value)) {
                *tip = Some(in_last_decimals(value));
                let _ = write!(words, " {axis}{}", number(value));
            }
        }
        words
    }

    fn motion(&mut self, code: u8, words: &str, feed: Option<f64>) -> io::Result<()> {
        let mut text = String::new();
        if self.code != Some(code) {
            self.code = Some(code);
            let _ = write!(text, "G{code}");
        }
        text.push_str(words);
        if let Some(feed) = feed
            && self.feed != Some(in_last_decimals(feed))
        {
            self.feed = Some(in_last_decimals(feed));
            let _ = write!(text, " F{}", number(feed));
        }
        self.line(text.trim_start())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::program_text::tests::{example, random};

    fn text(path: &Toolpath, header: &ProgramHeader) -> (String, MoveLines) {
        let mut bytes = Vec::new();
        let lines = write(&mut bytes, path, &Cutter::bull(6.0, 0.5).unwrap(), header, None).unwrap();
        (String::from_utf8(bytes).unwrap(), lines)
    }

    #[test]
    fn a_short_program() {
        let header =
            ProgramHeader { name: "wave, zigzag".into(), spindle_speed: Some(12_000.0), rise_to: None };
        let (text, lines) = text(&example(), &header);
        let expected = "\
%
(wave_ zigzag)
(BULL NOSE D=6.0 R=0.5)
(MM, TIP OF THE CUTTER)
G17 G21 G40 G80 G90 G94
S12000 M3
G0 Z10.0
X0.0 Y0.0
X1.0 Y2.5
G1 Z-0.1235 F300.0
X4.0 F1200.0
Z2.0
G0 Z10.0
M5
M30
%
";
        assert_eq!(text, expected);
        assert_eq!(lines, [9, 10, 11, 11, 12, 13]);
    }

    /// Follows the modal words, as a control would: tip, rapid and feed after each line.
    fn follow(text: &str) -> Vec<([f64; 3], bool, f64)> {
        let (mut tip, mut rapid, mut feed) = ([f64::NAN; 3], false, f64::NAN);
        let mut states = Vec::new();
        for line in text.lines() {
            for word in line.split_whitespace().filter(|_| !line.starts_with('(')) {
                let value = || word[1..].parse::<f64>().unwrap();
                match word.as_bytes()[0] {
                    b'X' => tip[0] = value(),
                    b'Y' => tip[1] = value(),
                    b'Z' => tip[2] = value(),
                    b'F' => feed = value(),
                    b'G' if value() < 2.0 => rapid = value() == 0.0,
                    _ => {}
                }
            }
            states.push((tip, rapid, feed));
        }
        states
    }

    #[test]
    fn reading_back_gives_the_moves() {
        let path = random(300);
        let (text, lines) = text(&path, &ProgramHeader::default());
        assert_eq!(lines.len(), path.len());
        let states = follow(&text);
        for (k, step) in path.moves.iter().enumerate() {
            let (tip, rapid, feed) = states[lines[k] as usize - 1];
            for axis in 0..3 {
                assert!((tip[axis] - step.to.tip[axis]).abs() <= 0.5001e-4, "move {k}");
            }
            let stands = path.start_of(k) == step.to.tip;
            assert!(stands || rapid == (step.kind == MoveKind::Rapid), "move {k}");
            assert!(stands || rapid || (feed - step.feed_rate).abs() <= 0.5001e-4, "move {k}");
        }
    }

    #[test]
    fn a_path_without_moves_is_a_program_too() {
        let mut path = example();
        path.moves.clear();
        let (text, lines) = text(&path, &ProgramHeader::default());
        assert!(lines.is_empty() && text.ends_with("M30\n%\n") && !text.contains("M3\n"), "{text}");
        // Nothing is cut, so that no spindle turns.
        let header = ProgramHeader { spindle_speed: Some(12_000.0), ..ProgramHeader::default() };
        let (text, _) = self::text(&path, &header);
        assert!(text.contains("(NO MOVES)\n") && !text.contains("M3\n") && !text.contains("M5"), "{text}");
    }
}
