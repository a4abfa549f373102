//! Why a program cannot be read: the place, what was expected, and the cure.

use thiserror::Error;

/// A program that cannot be read.
#[derive(Debug, Clone, PartialEq, Error)]
#[error("{name}{}: {fault}", place(*line, *column))]
pub struct ProgramError {
    /// What messages call the program.
    pub name: String,
    /// Line, from 1; 0 where no line is at fault.
    pub line: u32,
    /// Column in bytes, from 1; 0 where no line is at fault.
    pub column: u32,
    /// What is wrong.
    pub fault: Fault,
}

/// The place behind the name of a program.
fn place(line: u32, column: u32) -> String {
    if line == 0 { String::new() } else { format!(":{line}:{column}") }
}

impl ProgramError {
    /// What mends it.
    pub fn cure(&self) -> &'static str {
        self.fault.cure()
    }
}

/// What is wrong at a place of a program. Lengths in mm.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum Fault {
    /// A byte that no text holds.
    #[error("expected text, found the byte {0:#04x}")]
    Binary(u8),
    /// A line without end.
    #[error("the line is longer than {0} bytes")]
    LongLine(usize),
    /// More lines than line numbers.
    #[error("the program has more than {0} lines")]
    TooManyLines(usize),
    /// A character that begins no word.
    #[error("expected a word such as X1.5, found `{0}`")]
    Character(char),
    /// A letter without a number.
    #[error("expected a number after {0}")]
    Number(String),
    /// A number with too many digits, points or signs.
    #[error("`{0}` is not a number")]
    Malformed(String),
    /// A chord tolerance by which no motion is divided, mm.
    #[error("the chord tolerance is {0} mm; it must be above 0")]
    Chord(f64),
    /// A comment that does not end.
    #[error("the comment has no closing parenthesis")]
    OpenComment,
    /// Something that was opened and not closed.
    #[error("expected `{0}`")]
    Expected(&'static str),
    /// A name that is no function.
    #[error("unknown function `{0}`")]
    Function(String),
    /// A value outside of what a function takes.
    #[error("{what} of {value} has no value")]
    Domain {
        /// The function.
        what: &'static str,
        /// Its argument.
        value: f64,
    },
    /// Division by zero.
    #[error("division by zero")]
    Zero,
    /// Brackets within brackets without end.
    #[error("more than {0} brackets stand within each other")]
    Deep(usize),
    /// A parameter's number that is none.
    #[error("#{0} is no parameter: expected a whole number from 1 to 99999")]
    Parameter(f64),
    /// A named parameter without a value.
    #[error("#<{0}> has no value yet")]
    Unset(String),
    /// A parameter that programs cannot set.
    #[error("#{0} belongs to the control, and setting it is not followed")]
    ReadOnly(u32),
    /// A variable of the control whose value is not known.
    #[error("#{0} belongs to the control, and its value is not known")]
    System(u32),
    /// The program stops itself.
    #[error("the program stops itself here by alarm {0} (#3000)")]
    Alarm(f64),
    /// An operator outside of brackets.
    #[error("the operator {0} stands outside of brackets")]
    Unbracketed(char),
    /// What controls do not agree in.
    #[error("controls do not agree in {0}")]
    Disputed(&'static str),
    /// A number that no machine can take.
    #[error("{letter} = {value} is beyond every machine")]
    Range {
        /// The word's letter.
        letter: char,
        /// Its value.
        value: f64,
    },
    /// A code that no table has.
    #[error("the control `{control}` has no {code}")]
    UnknownCode {
        /// As the program has it.
        code: String,
        /// The control.
        control: &'static str,
    },
    /// A code that is known and cannot be followed.
    #[error("{code} cannot be verified: {why}")]
    Unsupported {
        /// As the program has it.
        code: String,
        /// What it would do.
        why: &'static str,
    },
    /// Two codes of which only one can hold.
    #[error("{first} and {second} cannot stand in one block")]
    Conflict {
        /// One code.
        first: String,
        /// The other.
        second: String,
    },
    /// The same letter twice.
    #[error("the word {0} stands twice in one block")]
    Twice(char),
    /// A word that is missing.
    #[error("{code} needs {words}")]
    Missing {
        /// What needs it.
        code: String,
        /// The words, any of which would do.
        words: &'static str,
    },
    /// A word that nothing in the block takes.
    #[error("nothing in this block takes the word {0}")]
    Unused(char),
    /// A word whose value makes no sense.
    #[error("{letter}{value} is not {expected}")]
    Value {
        /// The word's letter.
        letter: char,
        /// Its value.
        value: f64,
        /// What it has to be.
        expected: &'static str,
    },
    /// An arc whose ends lie at different distances from its centre.
    #[error("the arc starts {start:.4} mm from its centre and ends {end:.4} mm from it")]
    ArcEnds {
        /// Radius at its start.
        start: f64,
        /// Radius at its end.
        end: f64,
    },
    /// An arc of no radius.
    #[error("the arc has no radius")]
    ArcPoint,
    /// An arc by radius that cannot reach.
    #[error("an arc of radius {radius:.4} mm cannot join points {apart:.4} mm apart")]
    ArcReach {
        /// The radius.
        radius: f64,
        /// Distance of its ends.
        apart: f64,
    },
    /// A cycle that would drill upwards.
    #[error("the cycle ends at {bottom:.4} mm, above its retract plane at {retract:.4} mm")]
    CycleUpward {
        /// Retract plane.
        retract: f64,
        /// Bottom.
        bottom: f64,
    },
    /// A label that is not there.
    #[error("the program has no {0}")]
    NoTarget(String),
    /// A loop or branch that is not closed, or not open.
    #[error("{found} has no matching {wanted}")]
    Unmatched {
        /// What stands there.
        found: String,
        /// What belongs to it.
        wanted: &'static str,
    },
    /// Loops without end.
    #[error("the program is still running after {0} blocks")]
    Endless(u64),
    /// Calls without end.
    #[error("more than {0} subprograms call each other")]
    Recursion(usize),
    /// A radius that is asked for and not known.
    #[error("G41 or G42 needs the radius of tool {0}, which is not known")]
    NoRadius(u32),
    /// A first move that is no straight one of some length.
    #[error(
        "the first move under G41 or G42 must be straight and longer than the cutter's radius of {radius:.4} mm"
    )]
    Entry {
        /// Radius of the cutter.
        radius: f64,
    },
    /// An inner corner that is too narrow.
    #[error("a cutter of radius {radius:.4} mm does not fit into the corner before this move")]
    Corner {
        /// Radius of the cutter.
        radius: f64,
    },
    /// An inner arc that is too narrow.
    #[error("a cutter of radius {radius:.4} mm does not fit into an arc of radius {arc:.4} mm")]
    InnerArc {
        /// Radius of the cutter.
        radius: f64,
        /// Radius of the arc.
        arc: f64,
    },
    /// A code that cannot stand while the radius is compensated.
    #[error("{0} cannot stand while the cutter's radius is compensated")]
    Meanwhile(String),
    /// Motion with rotary axes without a machine that has them.
    #[error("the word {0} turns an axis, and no machine with such an axis is given")]
    Rotary(char),
    /// The tool axis turns in a way that cannot be followed.
    #[error("the tool axis turns by half a turn in one move")]
    HalfTurn,
    /// Motion along a CIRCLE that cannot be followed.
    #[error("the motion along the CIRCLE {0}")]
    Circle(String),
    /// A statement of APT that moves the tool in a way that cannot be followed.
    #[error("`{0}` is not understood, and it may move the tool or the part")]
    Statement(String),
    /// A tool with two cutters.
    #[error("this CUTTER is another one than that of line {line}, and the tool is {tool} in both")]
    OtherCutter {
        /// The tool.
        tool: u32,
        /// The line of the other one, from 1.
        line: u32,
    },
    /// A work offset of which it is not known how far it is from that of the part's zero.
    #[error("{0}")]
    Offset(String),
    /// Motion behind what ends the program.
    #[error("motion stands behind the {0} that ends the program")]
    BehindTheEnd(&'static str),
    /// The wrong number of values.
    #[error("{what} takes {wanted} numbers, found {found}")]
    Count {
        /// The statement.
        what: &'static str,
        /// How many it takes.
        wanted: &'static str,
        /// How many there are.
        found: usize,
    },
}

impl Fault {
    /// What mends it.
    pub fn cure(&self) -> &'static str {
        match self {
            Self::Binary(_) => "name a program file (G-code or APT), not a compiled or packed one",
            Self::LongLine(_) | Self::TooManyLines(_) => "check that the file is a program",
            Self::Character(_) | Self::Number(_) | Self::Malformed(_) | Self::Expected(_) => {
                "correct the word, or put remarks in parentheses"
            }
            Self::Chord(_) => "ask for a chord tolerance above 0",
            Self::OpenComment => "close it with `)` in the same line",
            Self::Function(_) => {
                "use ABS ACOS ASIN ATAN COS EXISTS EXP FIX FUP LN ROUND SIN SQRT or TAN with brackets"
            }
            Self::Domain { .. } | Self::Zero => "check the parameters in this expression",
            Self::Deep(_) => "divide the expression",
            Self::Parameter(_) => "use another parameter",
            Self::ReadOnly(_) => {
                "set offsets by G10, or use another parameter; where it is a free one, name the control with --control"
            }
            Self::System(_) => {
                "write the value in its place; where it is a free parameter, name the control with --control"
            }
            Self::Alarm(_) => "check the condition under which it stops",
            Self::Unbracketed(_) => "put the expression in brackets: #1=[#2+1]",
            Self::Disputed(_) => "name the control that the program is made for with --control",
            Self::Unset(_) => "set the parameter before it is used",
            Self::Range { .. } => "check the number, and the units of the program",
            Self::UnknownCode { .. } => "name the control that the program is made for with --control",
            Self::Unsupported { .. } => "have the post processor write plain moves instead",
            Self::Conflict { .. } | Self::Twice(_) => "put them in separate blocks",
            Self::Missing { .. } => "add the word",
            Self::Unused(_) => "delete the word, or add the code that takes it",
            Self::Value { .. } => "correct the value",
            Self::ArcEnds { .. } | Self::ArcPoint => {
                "check I J K: whether they count from the start of the arc (G91.1) or from zero (G90.1), and the plane"
            }
            Self::ArcReach { .. } => "check R and the end point",
            Self::CycleUpward { .. } => "check Z and R of the cycle",
            Self::NoTarget(_) => "add it, or put the subprogram in the same file",
            Self::Unmatched { .. } => "close every loop and branch",
            Self::Endless(_) | Self::Recursion(_) => "check the condition under which it ends",
            Self::NoRadius(_) => {
                "give the cutter with this number in a table of tools (--tools), or the diameter with G41.1 D"
            }
            Self::Entry { .. } => "lead in by a straight move that is longer than the radius",
            Self::Corner { .. } | Self::InnerArc { .. } => {
                "check the cutter's radius, the side (G41 left, G42 right), and the contour"
            }
            Self::Meanwhile(_) => "write G40 before it",
            Self::Rotary(_) => "name a machine with rotary axes in the scene ([machine.kinematics])",
            Self::HalfTurn => "put a location in between",
            Self::Circle(_) => {
                "check CIRCLE (centre, axis, radius) and the locations around it, or write straight GOTO motion"
            }
            Self::Statement(_) => "write plain GOTO motion in the post processor's output",
            Self::OtherCutter { .. } => {
                "give each cutter a tool of its own: write LOADTL with another number before it"
            }
            Self::Offset(_) => {
                "set the work offsets before the first move, or give `workpiece_zero` and `gauge_length` of the machine"
            }
            Self::BehindTheEnd(_) => "delete what stands there, or what ends the program before it",
            Self::Count { .. } => "correct the statement",
        }
    }
}

/// A fault in the line at hand.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Stop {
    /// Byte of the line, from 0.
    pub column: usize,
    /// What is wrong.
    pub fault: Box<Fault>,
}

impl Stop {
    pub fn new(column: usize, fault: Fault) -> Self {
        Self { column, fault: Box::new(fault) }
    }

    /// The same as an error of a whole program; `line` counts from 0.
    pub fn in_line(self, name: &str, line: usize) -> ProgramError {
        ProgramError {
            name: name.to_owned(),
            line: line as u32 + 1,
            column: self.column as u32 + 1,
            fault: *self.fault,
        }
    }
}
