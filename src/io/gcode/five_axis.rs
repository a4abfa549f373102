//! Programs for machines with two rotary axes, in two styles.
//!
//! Tool centre point control ([`Style::Tcp`], [`TCP_WORDS`] or those of another control): X Y Z are the tip
//! in the workpiece, whose frame turns with the table; the control moves the linear axes so that the tip runs
//! straight. Feeds are those of the tip (G94); where only rotary axes move, F is that of the one that turns
//! farthest, degrees/min.
//!
//! All joints ([`Style::Full`]): X Y Z are the linear axes in the work offset at the workpiece's zero (with
//! the rotary axes at zero they are the tip's), for controls that move five axes evenly and know nothing of
//! the tip. Moves are divided so that the tip stays on its line within the chord tolerance. Feeds are inverse
//! times (G93, 1/min), since no other feed has a meaning for lines and turns together.
//!
//! In both styles a feed is lowered where a joint would exceed its rate.
//!
//! A rapid move that turns the tool is a G1 at the rapid rate: with G0 each axis would go its own way.
//!
//! Begin and end. The spindle rises along the machine's z to the end of its travel (G53; its zero where no
//! travel is known), the rotary axes turn up there, X and Y move, and the tip comes down along the machine's
//! z over the start of the path, from above all of the path. With [`Style::Tcp`] the linear axes stand there
//! before the control begins to keep the tip, so that only Z is left to move. The same way round before
//! rewinds, and up again at the end.

use super::super::program_text::{NO_MOVES, ProgramHeader, describe, number, number_below, number_to};
use super::MoveLines;
use cutter::Cutter;
use geometry::{Point3, Vector3};
use machine::kinematics::{Following, JointLocation, JointPath, Joints, Kinematics, Side, Turn};
use motion::{MoveKind, Toolpath};
use std::fmt::Write as _;
use std::io::{self, Write};

/// Decimals of rotary words, degrees: rounding moves a point 300 mm from the axis by 0.03 µm.
const ROTARY_DECIMALS: usize = 5;

/// The greatest inverse time that controls take, 1/min. Shorter moves take a little longer.
const GREATEST_INVERSE_TIME: f64 = 99_999.0;

/// The words with which tool centre point control begins and ends, on Fanuc and Haas.
pub const TCP_WORDS: [&str; 2] = ["G43.4 H1", "G49"];

/// Who moves the linear axes along with the rotary ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Style {
    /// The control: X Y Z are the tip.
    Tcp,
    /// The program: X Y Z are the linear axes.
    Full,
}

impl Style {
    /// The words of scenes.
    pub const WORDS: [&'static str; 2] = ["tcp", "full"];

    /// Its word.
    pub fn name(self) -> &'static str {
        match self {
            Self::Tcp => Self::WORDS[0],
            Self::Full => Self::WORDS[1],
        }
    }

    /// The style that a word stands for.
    pub fn from_word(word: &str) -> Option<Self> {
        [Self::Tcp, Self::Full].into_iter().find(|style| style.name() == word)
    }

    /// How joints have to follow a path that is written this way: within `chord`, mm, for a cutter of
    /// `length`, mm.
    pub fn following(self, chord: f64, length: f64) -> Following {
        match self {
            Self::Tcp => Following::with_tip_kept(chord, length),
            Self::Full => Following::all_joints(chord, length),
        }
    }
}

/// For which machine a program is written, and how.
#[derive(Debug, Clone, Copy)]
pub struct FiveAxisPost<'a> {
    /// The machine.
    pub kinematics: &'a Kinematics,
    /// The path in its joints, as [`Style::following`] asks for.
    pub joints: &'a JointPath,
    /// The style.
    pub style: Style,
    /// The words with which tool centre point control begins and ends, a line each.
    pub tcp_words: [&'a str; 2],
    /// Rapid rate, mm/min.
    pub rapid_rate: f64,
}

/// Writes the program of a path on a machine with rotary axes and tells the line of each move, as
/// [`super::write`] does. Lengths have four decimals, angles five.
///
/// # Errors
/// Whatever the writer returns; joints that no program may be made of
/// ([`machine::kinematics::JointReport::obstacle`]), and joints that let the tip stray in [`Style::Full`].
pub fn write_five_axis(
    writer: &mut dyn Write,
    path: &Toolpath,
    post: &FiveAxisPost<'_>,
    cutter: &Cutter,
    header: &ProgramHeader,
) -> io::Result<MoveLines> {
    let refuse = |reason: String| Err(io::Error::new(io::ErrorKind::InvalidInput, reason));
    if let Some(obstacle) = post.joints.report.obstacle() {
        return refuse(obstacle.to_string());
    }
    if post.style == Style::Full && !post.joints.following.tip.is_finite() {
        return refuse("the joints keep no tolerance at the tip".to_owned());
    }
    let mut program = FiveAxisProgram::new(writer, post, path);
    program.head(cutter, header)?;
    let start = post.joints.start;
    program.approach(&start, path.start.tip)?;
    let mut lines = vec![program.lines; path.len()];
    let mut last = (start, path.start.tip);
    for location in &post.joints.locations {
        if location.turn == Turn::Rewind {
            program.approach(&location.joints, location.at.tip)?;
        } else {
            program.go(path, location, &last)?;
        }
        last = (location.joints, location.at.tip);
        if let Some(line) = lines.get_mut(location.step) {
            *line = program.lines;
        }
    }
    program.end(header)?;
    Ok(lines)
}

/// A program in the making, and what its last lines have left in force.
struct FiveAxisProgram<'a> {
    writer: &'a mut dyn Write,
    post: &'a FiveAxisPost<'a>,
    path: &'a Toolpath,
    lines: u32,
    /// The words X Y Z and of both rotary axes, as they were written.
    words: [Option<String>; 5],
    rapid: Option<bool>,
    feed: Option<String>,
    /// Joints and tip of the last location.
    at: Option<(Joints, Point3)>,
}

impl<'a> FiveAxisProgram<'a> {
    fn new(writer: &'a mut dyn Write, post: &'a FiveAxisPost<'a>, path: &'a Toolpath) -> Self {
        Self { writer, post, path, lines: 0, words: Default::default(), rapid: None, feed: None, at: None }
    }

    fn line(&mut self, text: &str) -> io::Result<()> {
        self.lines += 1;
        writeln!(self.writer, "{text}")
    }

    fn head(&mut self, cutter: &Cutter, header: &ProgramHeader) -> io::Result<()> {
        let kinematics = self.post.kinematics;
        let side = |side| match side {
            Side::Head => "HEAD",
            Side::Table => "TABLE",
        };
        let axes = kinematics.axes().map(|axis| format!("{} IN THE {}", axis.letter, side(axis.side)));
        self.line("%")?;
        self.line(&format!("({})", header.plain_name()))?;
        self.line(&format!("({})", describe(cutter)))?;
        self.line(&format!("(MM, DEGREES, {}, {})", axes[0], axes[1]))?;
        match self.post.style {
            Style::Tcp => {
                self.line("(TIP OF THE CUTTER IN THE WORKPIECE)")?;
                self.line("G17 G21 G40 G49 G80 G90 G94")?;
            }
            Style::Full => {
                self.line("(LINEAR AXES FROM THE WORKPIECE ZERO WITH ROTARY AXES AT ZERO)")?;
                if kinematics.has(Side::Head) {
                    self.line(&format!("(SPINDLE NOSE TO TIP {})", number(kinematics.gauge_length())))?;
                }
                if kinematics.has(Side::Table) {
                    let [x, y, z] = <[f64; 3]>::from(kinematics.workpiece_zero().coords).map(number);
                    self.line(&format!("(WORKPIECE ZERO IN MACHINE COORDINATES X{x} Y{y} Z{z})"))?;
                }
                self.line("G17 G21 G40 G49 G80 G90 G93")?;
            }
        }
        if self.path.is_empty() {
            self.line(&format!("({NO_MOVES})"))?;
        }
        match header.speed_for(self.path) {
            Some(speed) => self.line(&format!("S{} M3", speed.round())),
            None => Ok(()),
        }
    }

    /// The words of a location: X Y Z and both rotary axes.
    fn words(&self, joints: &Joints, tip: Point3) -> [String; 5] {
        let linear = match self.post.style {
            Style::Tcp => tip.coords,
            Style::Full => self.linear_axes(joints),
        };
        let rotary = joints.rotary.map(|angle| number_to(angle.to_degrees(), ROTARY_DECIMALS));
        let ([x, y, z], [first, second]) = (<[f64; 3]>::from(linear).map(number), rotary);
        [x, y, z, first, second]
    }

    /// The joints and the tip of words.
    fn read(&self, words: [Option<&String>; 5]) -> Option<(Joints, Point3)> {
        let mut values = [0.0; 5];
        for (value, word) in values.iter_mut().zip(words) {
            *value = word?.parse().ok()?;
        }
        let [x, y, z, first, second] = values;
        let (linear, rotary) = (Point3::new(x, y, z), [first.to_radians(), second.to_radians()]);
        let kinematics = self.post.kinematics;
        Some(match self.post.style {
            Style::Tcp => (kinematics.place(linear, rotary), linear),
            Style::Full => {
                let nose = Vector3::new(0.0, 0.0, kinematics.gauge_length());
                let joints =
                    Joints { linear: linear.coords + kinematics.workpiece_zero().coords + nose, rotary };
                (joints, kinematics.forward(&joints).tip)
            }
        })
    }

    /// X Y Z of the linear axes themselves, in the work offset.
    fn linear_axes(&self, joints: &Joints) -> Vector3 {
        let kinematics = self.post.kinematics;
        let nose = Vector3::new(0.0, 0.0, kinematics.gauge_length());
        joints.linear - kinematics.workpiece_zero().coords - nose
    }

    /// From anywhere to a location: up along the machine's z, turning up there, and down over the location.
    fn approach(&mut self, joints: &Joints, tip: Point3) -> io::Result<()> {
        self.rise()?;
        let over = self.post.kinematics.over(self.path, joints.rotary, tip);
        let high = self.post.kinematics.place(over, joints.rotary);
        let [x, y, z, first, second] = self.words(&high, over);
        self.step([None, None, None, Some(first), Some(second)], None)?;
        match self.post.style {
            Style::Tcp => {
                let axes = self.linear_axes(&high);
                self.step([Some(number(axes.x)), Some(number(axes.y)), None, None, None], None)?;
                self.line(self.post.tcp_words[0])?;
                // The words of the tip are others.
                self.words[..3].fill(None);
                self.step([Some(x), Some(y), Some(z), None, None], None)?;
            }
            Style::Full => {
                self.step([Some(x), Some(y), None, None, None], None)?;
                self.step([None, None, Some(z), None, None], None)?;
            }
        }
        self.step(self.words(joints, tip).map(Some), None)?;
        self.at = Some((*joints, tip));
        Ok(())
    }

    /// Up to the end of Z's travel, or to the machine's zero where that is not known.
    fn rise(&mut self) -> io::Result<()> {
        if let Some((joints, tip)) = self.at.take()
            && self.post.style == Style::Tcp
        {
            // Straight up while the control still follows the tip: what it does when it stops is its own.
            let over = self.post.kinematics.over(self.path, joints.rotary, tip);
            let words = self.words(&self.post.kinematics.place(over, joints.rotary), over);
            self.step(words.map(Some), None)?;
            self.line(self.post.tcp_words[1])?;
        }
        self.line(&format!("G53 G0 Z{}", number(self.post.kinematics.retracted_z())))?;
        self.rapid = Some(true);
        // Where that is in the words of this program is the machine's to know.
        match self.post.style {
            Style::Tcp => self.words[..3].fill(None),
            Style::Full => self.words[2] = None,
        }
        Ok(())
    }

    /// Along the path from `last` to a location.
    fn go(&mut self, path: &Toolpath, location: &JointLocation, last: &(Joints, Point3)) -> io::Result<()> {
        let Some(step) = path.moves.get(location.step) else { return Ok(()) };
        let words = self.words(&location.joints, location.at.tip);
        let turns = self.words[3..] != [Some(words[3].clone()), Some(words[4].clone())];
        let rate = if step.kind == MoveKind::Rapid { self.post.rapid_rate } else { step.feed_rate };
        // The control moves by what is written.
        let written = words.each_ref().map(Some);
        let to = self.read(written).unwrap_or((location.joints, location.at.tip));
        let from = self.read(self.words.each_ref().map(Option::as_ref)).unwrap_or(*last);
        let length = (to.1 - from.1).norm();
        let least = self.post.joints.least_time(self.post.kinematics, &from, &to) / 60.0;
        let feed = if step.kind == MoveKind::Rapid && !turns {
            None
        } else if self.post.style == Style::Full {
            let time = (length / rate).max(least);
            Some(number_below((1.0 / time).min(GREATEST_INVERSE_TIME)))
        } else if (0..3).all(|k| self.words[k].as_ref() == Some(&words[k])) && least > 0.0 {
            let turn = |k: usize| (to.0.rotary[k] - from.0.rotary[k]).abs();
            // A rate that holds as it is stays so.
            Some(number_below(turn(0).max(turn(1)).to_degrees() / least * (1.0 + 1e-12)))
        } else if length < rate * least {
            Some(number_below(length / least))
        } else {
            Some(number(rate))
        };
        self.step(words.map(Some), feed)?;
        self.at = Some((location.joints, location.at.tip));
        Ok(())
    }

    /// A line with the words that change; none when no axis does.
    fn step(&mut self, to: [Option<String>; 5], feed: Option<String>) -> io::Result<()> {
        let letters = self.post.kinematics.letters();
        // Rotary words in the order of the alphabet.
        let order = if letters[3] < letters[4] { [0, 1, 2, 3, 4] } else { [0, 1, 2, 4, 3] };
        let mut words = String::new();
        for k in order {
            if to[k].is_some() && self.words[k] != to[k] {
                self.words[k].clone_from(&to[k]);
                let _ = write!(words, " {}{}", letters[k], to[k].as_deref().unwrap_or_default());
            }
        }
        if words.is_empty() {
            return Ok(());
        }
        let mut text = String::new();
        if self.rapid != Some(feed.is_none()) {
            self.rapid = Some(feed.is_none());
            text.push_str(if feed.is_none() { "G0" } else { "G1" });
        }
        text.push_str(&words);
        // An inverse time holds for its own line only.
        if let Some(feed) = feed
            && (self.post.style == Style::Full || self.feed.as_ref() != Some(&feed))
        {
            let _ = write!(text, " F{feed}");
            self.feed = Some(feed);
        }
        self.line(text.trim_start())
    }

    fn end(&mut self, header: &ProgramHeader) -> io::Result<()> {
        self.rise()?;
        if self.post.style == Style::Full {
            self.line("G94")?;
        }
        if header.speed_for(self.path).is_some() {
            self.line("M5")?;
        }
        self.line("M30")?;
        self.line("%")
    }
}

#[cfg(test)]
pub(crate) mod tests;
