//! Cutter locations in APT (ISO 3592, ISO 4343), as NX, CATIA, Creo and this project write them.
//!
//! A statement is a major word, `/`, and minor words and numbers between commas; `$` carries it on in the
//! next line, `$$` begins a remark. What moves the tool is followed (GOTO, GODLTA, FROM, CIRCLE before GOTO,
//! RAPID, MSYS), what describes it is kept (CUTTER, LOADTL, SPINDL, FEDRAT, DELAY, UNITS, MULTAX), what moves
//! nothing is passed over, and what may move tool or part and is not understood stops the reading. Text that
//! goes into the program as it stands (INSERT, PREFUN, AUXFUN) may move both, too.

mod statement;

use geometry::{Point3, Vector3};

use crate::arc::arc_tolerance;
use crate::control::Plane;
use crate::error::{Fault, ProgramError, Stop};
use crate::lines::Lines;
use crate::program::{Arc, Note, Program, Setting, Spindle, Step, StepKind, ToolRemark, Unset};
use crate::tools::{Said, cutter_of_remark, same_cutter};
use statement::{Statement, not_understood, statement};

/// Major words that move neither tool nor part: what is printed or shown, coolant and stops, tolerances that
/// the locations keep already, levels and limits that other words act on.
const QUIET: [&str; 28] = [
    "PARTNO",
    "PPRINT",
    "REMARK",
    "MACHIN",
    "COOLNT",
    "CLEARP",
    "OPSKIP",
    "STOP",
    "OPSTOP",
    "INTOL",
    "OUTTOL",
    "TOLER",
    "LINTOL",
    "SEQNO",
    "TOOLPATH",
    "TLDATA",
    "PAINT",
    "END-OF-PATH",
    "TOOLNO",
    "OPERATION",
    "DISPLY",
    "LEADER",
    "CHECK",
    "TPRINT",
    "PROGRAM",
    "MCHTOL",
    "CATPROCESS",
    "SELCTL",
];

/// Major words that move tool or part in ways that only the machine knows, unless they are OFF.
const MOVING: [&str; 20] = [
    "GOHOME", "GOFWD", "GOLFT", "GORGT", "GOBACK", "GOUP", "GODOWN", "CYCLE", "COPY", "INDEX", "TRACUT",
    "ROTABL", "TRANS", "ORIGIN", "RETRCT", "RETRACT", "PLUNGE", "REWIND", "UNLOAD", "PIVOTZ",
];

/// Codes of G that move nothing among locations that are written in absolute coordinates and mm/min.
const QUIET_G: [u16; 9] = [8, 9, 17, 40, 61, 64, 80, 90, 94];

/// The work offsets, which place the part as long as nothing has moved.
const WORK_OFFSETS_G: std::ops::RangeInclusive<u16> = 54..=59;

/// Codes of M that move no axis: stops, coolant, clamps, overrides.
const QUIET_M: [u16; 14] = [0, 1, 7, 8, 9, 10, 11, 48, 49, 50, 51, 52, 53, 60];

/// Tool axes that differ by less, rad, are one: four decimals round as far.
const SAME_AXIS: f64 = 2e-4;

/// Ends may miss the radius of a CIRCLE by this much, mm, or by a share of the radius, as those of arcs in
/// G-code.
const RADIUS_TOLERANCE: f64 = 0.01;

/// What CIRCLE says of the motion that follows.
#[derive(Debug, Clone, Copy)]
struct Circle {
    centre: Point3,
    /// About which the motion turns anticlockwise.
    axis: Vector3,
    radius: f64,
}

/// Coordinates of an MSYS, in those of the first one.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Frame {
    origin: Point3,
    axes: [Vector3; 3],
}

impl Frame {
    /// `x,y,z` of the origin, and the directions of X and Y.
    fn of(values: &[f64], unit: f64) -> Option<Self> {
        let [x, y, z, rest @ ..] = values else { return None };
        let [a, b, c, d, e, f] = rest[..] else { return None };
        let (first, second) = (Vector3::new(a, b, c), Vector3::new(d, e, f));
        let [u, across] = [first, first.cross(&second)].map(|axis| axis.try_normalize(1e-9));
        let (u, w) = (u?, across?);
        // Programs round to a few decimals.
        let square =
            [first.norm() - 1.0, second.norm() - 1.0, first.dot(&second)].iter().all(|off| off.abs() < 1e-3);
        square.then(|| Self { origin: Point3::new(*x, *y, *z) * unit, axes: [u, w.cross(&u), w] })
    }

    fn outward(&self, way: &Vector3) -> Vector3 {
        self.axes[0] * way.x + self.axes[1] * way.y + self.axes[2] * way.z
    }

    fn inward(&self, way: &Vector3) -> Vector3 {
        Vector3::new(self.axes[0].dot(way), self.axes[1].dot(way), self.axes[2].dot(way))
    }
}

/// A reader of locations.
struct Reader {
    out: Program,
    unit: f64,
    rapid: bool,
    circle: Option<Circle>,
    /// mm/min, or mm/rev.
    feed: f64,
    per_revolution: bool,
    /// The first MSYS, in which the part stands.
    first: Option<Frame>,
    /// How many CUTTERs have their tool.
    described: usize,
    /// The head in use, where one is named.
    head: Option<String>,
    /// The line of a fault where that is another than the one at hand, from 0.
    blamed: Option<usize>,
    /// The one in force, where it is another.
    frame: Option<Frame>,
    setting: Setting,
    changed: bool,
    at: Point3,
    axis: Vector3,
    begun: bool,
}

/// Reads cutter locations. `name` is what messages call them.
///
/// # Errors
/// [`ProgramError`] at the first thing that cannot be followed.
pub fn read_apt(name: &str, bytes: &[u8]) -> Result<Program, ProgramError> {
    let lines = Lines::new(bytes).map_err(|(line, stop)| stop.in_line(name, line))?;
    let mut reader = Reader::new(name, lines.len());
    let mut line = 0;
    while line < lines.len() {
        let (statement, next) = statement(&lines, line).map_err(|stop| stop.in_line(name, line))?;
        if let Some(statement) = statement {
            let ran =
                if reader.out.ended { reader.run_behind_the_end(&statement) } else { reader.run(&statement) };
            ran.map_err(|stop| stop.in_line(name, reader.blamed.unwrap_or(statement.line)))?;
        }
        line = next;
    }
    // A CUTTER that no motion follows describes nothing.
    if reader.described > 0 {
        reader.out.tools.truncate(reader.described);
    }
    Ok(reader.out)
}

/// Whether a text is cutter locations rather than G-code.
pub fn looks_like_apt(bytes: &[u8]) -> bool {
    let head = String::from_utf8_lossy(&bytes[..bytes.len().min(20_000)]).to_ascii_uppercase();
    let major = |line: &str| {
        let line = line.trim_start();
        ["GOTO", "CUTTER", "FEDRAT", "LOADTL", "TOOL PATH", "PARTNO", "MULTAX", "UNITS", "FROM"]
            .iter()
            .any(|word| line.strip_prefix(word).is_some_and(|rest| rest.trim_start().starts_with(['/', ' '])))
    };
    head.lines().any(|line| major(line) && !line.trim_start().starts_with("GOTO "))
}

impl Reader {
    fn new(name: &str, lines: usize) -> Self {
        let setting = Setting {
            tool: 0,
            spindle: Spindle::Off,
            speed: 0.0,
            register: 0,
            length: [0.0; 3],
            unset: Unset::Nothing,
            tip_kept: true,
            work: 1,
        };
        let out = Program { name: name.to_owned(), lines, axes: vec![[0.0, 0.0, 1.0]], ..Program::default() };
        Self {
            out,
            unit: 1.0,
            rapid: false,
            circle: None,
            feed: 0.0,
            per_revolution: false,
            first: None,
            described: 0,
            head: None,
            blamed: None,
            frame: None,
            setting,
            changed: true,
            at: Point3::origin(),
            axis: Vector3::z(),
            begun: false,
        }
    }

    fn run(&mut self, statement: &Statement) -> Result<(), Stop> {
        match statement.major.as_str() {
            "GOTO" => self.go_to(statement),
            "GODLTA" => self.go_by(statement),
            "FROM" => self.from(statement),
            moving if MOVING.contains(&moving) && !statement.has("OFF") => Err(not_understood(statement)),
            moving if MOVING.contains(&moving) => Ok(()),
            "ROTHED" if statement.turns_nothing() => Ok(()),
            "INSERT" if self.inserts_nothing(statement) => Ok(()),
            "PREFUN" if self.is_quiet_g(statement) => Ok(()),
            "PREFUN" | "ROTHED" | "INSERT" => Err(not_understood(statement)),
            "AUXFUN" => self.auxiliary(statement),
            "HEAD" => self.take_head(statement),
            "RAPID" => {
                self.rapid = true;
                Ok(())
            }
            "FEDRAT" => {
                self.feed(statement);
                Ok(())
            }
            "UNITS" => {
                let before = self.unit;
                self.unit = if statement.has("INCHES") || statement.has("INCH") { 25.4 } else { 1.0 };
                // In which unit a CUTTER just before counts is not said.
                let open =
                    self.described..if before == self.unit { self.described } else { self.out.tools.len() };
                self.out.tools[open].iter_mut().for_each(|tool| tool.text += " before UNITS");
                Ok(())
            }
            "SPINDL" => {
                self.spindle(statement);
                Ok(())
            }
            "LOADTL" | "TURRET" | "LOAD" => {
                if let Some(tool) = statement.numbers().first().filter(|n| (0.0..1e9).contains(*n)) {
                    (self.setting.tool, self.changed) = (*tool as u32, true);
                    // A tool change stops the spindle.
                    self.setting.spindle = Spindle::Off;
                }
                Ok(())
            }
            "CUTTER" => {
                // All but the fifth and sixth, which are angles, are lengths.
                let mm = |(k, word): (usize, f64)| if k == 4 || k == 5 { word } else { word * self.unit };
                let words: Vec<String> =
                    statement.numbers().into_iter().enumerate().map(|word| mm(word).to_string()).collect();
                let text = format!("CUTTER/{}", words.join(","));
                let (tool, line) = (self.setting.tool, statement.line as u32 + 1);
                self.out.tools.push(ToolRemark { tool, line, text });
                Ok(())
            }
            "DELAY" => {
                let last = statement.numbers().first().map_or(0.0, |last| last.max(0.0));
                let turns = statement.has("REV") && self.setting.speed > 0.0;
                self.out.dwell(if turns { 60.0 * last / self.setting.speed } else { last });
                Ok(())
            }
            "MSYS" => self.system(statement),
            "MODE" if !statement.has("INCR") => Ok(()),
            // Where the control is to shift the path by is not said.
            "CUTCOM" if !statement.has("LEFT") && !statement.has("RIGHT") => Ok(()),
            "CIRCLE" => self.circle(statement),
            "MULTAX" => Ok(()),
            "FINI" => {
                self.out.ended = true;
                Ok(())
            }
            "TLAXIS" | "SET" => self.tool_axis(statement),
            quiet if QUIET.contains(&quiet) => Ok(()),
            _ => {
                // Macros, patterns and geometry are no cutter locations.
                let text = statement.text();
                if statement.words.is_empty() && !statement.major.starts_with("GO") {
                    self.note(statement.line, format!("`{}` is taken to move nothing", statement.major));
                    return Ok(());
                }
                Err(Stop::new(0, Fault::Statement(text)))
            }
        }
    }

    /// Behind FINI nothing may move.
    fn run_behind_the_end(&mut self, statement: &Statement) -> Result<(), Stop> {
        let major = statement.major.as_str();
        let moves = major.starts_with("GO")
            || MOVING.contains(&major)
            || matches!(major, "CIRCLE" | "INSERT" | "CALL");
        if moves {
            return Err(Stop::new(0, Fault::BehindTheEnd("FINI")));
        }
        self.note(statement.line, "what stands behind FINI is passed over".to_owned());
        Ok(())
    }

    /// Whether PREFUN names codes of G that move nothing here.
    fn is_quiet_g(&self, statement: &Statement) -> bool {
        let quiet = |code: u16| QUIET_G.contains(&code) || !self.begun && WORK_OFFSETS_G.contains(&code);
        statement.codes().is_some_and(|codes| codes.into_iter().all(quiet))
    }

    /// Whether the text of INSERT is empty, a remark, or codes that move nothing.
    fn inserts_nothing(&self, statement: &Statement) -> bool {
        let text = statement.words.first().map_or("", |(text, _)| text.as_str());
        let code = text.split('(').next().unwrap_or_default().trim();
        let is_remark =
            code.len() == text.len() || text.matches('(').count() == 1 && text.trim_end().ends_with(')');
        let quiet = |word: &str| {
            let number = word.get(1..).and_then(|digits| digits.parse::<u16>().ok());
            match word.as_bytes()[0].to_ascii_uppercase() {
                b'N' => number.is_some(),
                b'M' => number.is_some_and(|code| QUIET_M.contains(&code)),
                b'G' => number.is_some_and(|code| QUIET_G.contains(&code)),
                _ => false,
            }
        };
        is_remark && code.split_whitespace().all(quiet)
    }

    /// `AUXFUN/n`: a code of M.
    fn auxiliary(&mut self, statement: &Statement) -> Result<(), Stop> {
        let codes = statement.codes().ok_or_else(|| not_understood(statement))?;
        for code in codes {
            let spindle = match code {
                3 => Spindle::Clockwise,
                4 => Spindle::Anticlockwise,
                5 | 19 => Spindle::Off,
                2 | 30 => {
                    self.out.ended = true;
                    return Ok(());
                }
                quiet if QUIET_M.contains(&quiet) => continue,
                _ => return Err(not_understood(statement)),
            };
            (self.setting.spindle, self.changed) = (spindle, true);
        }
        Ok(())
    }

    /// `HEAD/n`: another head carries another tool.
    fn take_head(&mut self, statement: &Statement) -> Result<(), Stop> {
        let named = statement.text();
        if self.begun && self.head.as_ref() != Some(&named) {
            return Err(not_understood(statement));
        }
        self.head = Some(named);
        Ok(())
    }

    /// Lays the CUTTERs since the last motion to the tool that moves next. The last of them counts.
    fn take_cutter(&mut self) -> Result<(), Stop> {
        let Some(last) = self.out.tools.len().checked_sub(1).filter(|last| *last >= self.described) else {
            return Ok(());
        };
        let tool = self.setting.tool;
        let mut latest = self.out.tools.swap_remove(last);
        self.out.tools.truncate(self.described);
        latest.tool = tool;
        let same = |other: &ToolRemark| {
            let [a, b] = [other, &latest].map(|remark| cutter_of_remark(&remark.text, None));
            other.text == latest.text
                || matches!((a, b), (Said::Cutter(a), Said::Cutter(b)) if same_cutter(&a, &b))
        };
        if let Some(other) = self.out.tools.iter().find(|other| other.tool == tool && !same(other)) {
            self.blamed = Some(latest.line as usize - 1);
            return Err(Stop::new(0, Fault::OtherCutter { tool, line: other.line }));
        }
        self.out.tools.push(latest);
        self.described = self.out.tools.len();
        Ok(())
    }

    fn note(&mut self, line: usize, text: String) {
        if self.out.notes.len() < 200 && !self.out.notes.iter().any(|note| note.text == text) {
            self.out.notes.push(Note { line: line as u32 + 1, text });
        }
    }

    /// `MSYS/x,y,z,i,j,k,i,j,k`: what follows counts in other coordinates.
    fn system(&mut self, statement: &Statement) -> Result<(), Stop> {
        let stop = || Stop::new(0, Fault::Statement(statement.text()));
        let frame = Frame::of(&statement.numbers(), self.unit).ok_or_else(stop)?;
        let first = match self.first {
            Some(first) => first,
            None if self.begun => return Err(stop()),
            None => *self.first.insert(frame),
        };
        let axis = self.frame.map_or(self.axis, |before| before.inward(&self.axis));
        self.frame = (frame != first).then(|| Frame {
            origin: Point3::from(first.inward(&(frame.origin - first.origin))),
            axes: frame.axes.map(|axis| first.inward(&axis)),
        });
        self.axis = self.direction(axis);
        if self.frame.is_some() {
            self.note(
                statement.line,
                "another MSYS: what follows is laid to the part by the first one".to_owned(),
            );
        }
        Ok(())
    }

    /// A direction in the coordinates of the first MSYS.
    fn direction(&self, way: Vector3) -> Vector3 {
        self.frame.map_or(way, |frame| frame.outward(&way))
    }

    fn point(&self, at: Point3) -> Point3 {
        self.frame.map_or(at, |frame| frame.origin + frame.outward(&at.coords))
    }

    fn tool_axis(&mut self, statement: &Statement) -> Result<(), Stop> {
        let values = statement.numbers();
        let [i, j, k] = values[..] else { return Ok(()) };
        let axis = Vector3::new(i, j, k).try_normalize(1e-9);
        let axis = axis.ok_or_else(|| Stop::new(0, Fault::Statement(statement.text())))?;
        self.axis = self.direction(axis);
        Ok(())
    }

    fn feed(&mut self, statement: &Statement) {
        let number = statement.numbers().first().copied();
        // NX writes FEDRAT/MMPM,250 and FEDRAT/250,MMPM; CATIA FEDRAT/ 250.0000,MMPM.
        let inch = statement.has("IPM") || statement.has("IPR");
        self.per_revolution = statement.has("MMPR") || statement.has("IPR") || statement.has("PERREV");
        if let Some(feed) = number.filter(|feed| *feed >= 0.0) {
            let metric = statement.has("MMPM") || statement.has("MMPR");
            self.feed = feed
                * if inch {
                    25.4
                } else if metric {
                    1.0
                } else {
                    self.unit
                };
        }
        if statement.has("RAPID") {
            self.rapid = true;
        }
    }

    fn spindle(&mut self, statement: &Statement) {
        self.changed = true;
        if statement.has("OFF") {
            self.setting.spindle = Spindle::Off;
            return;
        }
        let anticlockwise = statement.has("CCLW");
        self.setting.spindle = if anticlockwise { Spindle::Anticlockwise } else { Spindle::Clockwise };
        if let Some(speed) = statement.numbers().first() {
            self.setting.speed = speed.abs();
        }
    }

    /// `FROM/x,y,z[,i,j,k]`: where the tool stands.
    fn from(&mut self, statement: &Statement) -> Result<(), Stop> {
        if self.circle.is_some() {
            return Err(Stop::new(0, Fault::Circle("ends in no GOTO".to_owned())));
        }
        let (at, axis) = self.location(statement, "FROM")?;
        (self.at, self.axis) = (at, axis);
        if self.out.steps.is_empty() {
            self.out.start = place(&at);
            self.out.axes[0] = axis.into();
            self.begun = true;
            return Ok(());
        }
        self.push(statement.line, StepKind::Set)
    }

    fn location(&self, statement: &Statement, what: &'static str) -> Result<(Point3, Vector3), Stop> {
        let values = statement.all_numbers(what, "3 or 6", &[3, 6])?;
        let at = self.point(Point3::new(values[0], values[1], values[2]) * self.unit);
        if let Some(k) = at.iter().position(|x| x.abs() > geometry::MAX_COORDINATE) {
            let (letter, value) = (['X', 'Y', 'Z'][k], at[k]);
            return Err(Stop::new(0, Fault::Range { letter, value }));
        }
        let axis = match values[3..] {
            [i, j, k] => {
                let axis = Vector3::new(i, j, k).try_normalize(1e-9);
                self.direction(axis.ok_or_else(|| Stop::new(0, Fault::Statement(statement.text())))?)
            }
            _ => self.axis,
        };
        Ok((at, axis))
    }

    fn go_to(&mut self, statement: &Statement) -> Result<(), Stop> {
        let (at, axis) = self.location(statement, "GOTO")?;
        self.go(statement.line, at, axis)
    }

    fn go_by(&mut self, statement: &Statement) -> Result<(), Stop> {
        let values = statement.all_numbers("GODLTA", "1 or 3", &[1, 3])?;
        let by = match values[..] {
            [x, y, z] => self.direction(Vector3::new(x, y, z) * self.unit),
            _ => self.axis * values[0] * self.unit,
        };
        self.go(statement.line, self.at + by, self.axis)
    }

    fn go(&mut self, line: usize, at: Point3, axis: Vector3) -> Result<(), Stop> {
        let from = self.at;
        let turned = (axis - self.axis).norm() > SAME_AXIS;
        (self.at, self.axis) = (at, axis);
        let circle = self.circle.take();
        if circle.is_some() && !self.begun {
            return Err(Stop::new(0, Fault::Circle("has no place where it begins".to_owned())));
        }
        if !self.begun {
            // Where the tool comes from is not said: it begins here.
            self.begun = true;
            self.out.start = place(&at);
            self.out.axes[0] = axis.into();
            self.rapid = false;
            return Ok(());
        }
        let rapid = std::mem::take(&mut self.rapid);
        let kind = match circle {
            None if rapid => StepKind::Rapid,
            None => StepKind::Feed,
            Some(_) if rapid => return Err(Stop::new(0, Fault::Circle("is a rapid".to_owned()))),
            Some(_) if turned => return Err(Stop::new(0, Fault::Circle("turns the tool axis".to_owned()))),
            Some(circle) => {
                self.out.arcs.push(arc(&circle, &from, &at)?);
                StepKind::Arc(self.out.arcs.len() as u32 - 1)
            }
        };
        self.push(line, kind)
    }

    fn push(&mut self, line: usize, kind: StepKind) -> Result<(), Stop> {
        if self.changed {
            self.changed = false;
            self.out.settings.push(self.setting);
        }
        self.take_cutter()?;
        let feed = match kind {
            StepKind::Feed | StepKind::Arc(_) if self.per_revolution => self.feed * self.setting.speed,
            StepKind::Feed | StepKind::Arc(_) => self.feed,
            _ => 0.0,
        };
        let setting = self.out.settings.len() as u32 - 1;
        self.out.steps.push(Step { kind, to: place(&self.at), feed, line: line as u32 + 1, setting });
        self.out.axes.push(self.axis.into());
        Ok(())
    }

    /// `CIRCLE/x,y,z,i,j,k,r[,…]`: the next location is reached along it.
    fn circle(&mut self, statement: &Statement) -> Result<(), Stop> {
        let values = statement.numbers();
        // Words such as TIMES add turns.
        if self.circle.is_some() || values.len() < statement.words.len() {
            return Err(Stop::new(0, Fault::Statement(statement.text())));
        }
        if values.len() < 7 {
            let (what, wanted) = ("CIRCLE", "at least 7");
            return Err(Stop::new(0, Fault::Count { what, wanted, found: values.len() }));
        }
        let axis = Vector3::new(values[3], values[4], values[5]);
        let axis =
            axis.try_normalize(1e-9).ok_or_else(|| Stop::new(0, Fault::Statement(statement.text())))?;
        let axis = self.direction(axis);
        let centre = self.point(Point3::new(values[0], values[1], values[2]) * self.unit);
        self.circle = Some(Circle { centre, axis, radius: values[6].abs() * self.unit });
        Ok(())
    }
}

fn place(at: &Point3) -> [f64; 6] {
    [at.x, at.y, at.z, 0.0, 0.0, 0.0]
}

/// The arc from one point of a circle to another about its axis.
fn arc(circle: &Circle, from: &Point3, to: &Point3) -> Result<Arc, Stop> {
    let spokes = [from, to].map(|p| {
        let spoke = p - circle.centre;
        spoke - circle.axis * spoke.dot(&circle.axis)
    });
    let radius = circle.radius;
    let allowed = arc_tolerance(RADIUS_TOLERANCE, radius);
    for (spoke, what) in spokes.iter().zip(["begins", "ends"]) {
        let far = spoke.norm();
        if far <= 0.0 || (far - radius).abs() > allowed {
            let text = format!("{what} {far:.4} mm from its axis, and its radius is {radius:.4} mm");
            return Err(Stop::new(0, Fault::Circle(text)));
        }
    }
    let [a, b] = spokes;
    let angle = a.cross(&b).dot(&circle.axis).atan2(a.dot(&b));
    let sweep = if angle <= 1e-12 { angle + std::f64::consts::TAU } else { angle };
    let centre = circle.centre + circle.axis * (from - circle.centre).dot(&circle.axis);
    Ok(Arc { centre: centre.into(), normal: circle.axis.into(), sweep, plane: Plane::Xy })
}

#[cfg(test)]
mod tests;
