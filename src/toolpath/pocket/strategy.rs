//! The strategies of pockets: what they are asked for, and how scenes spell it.

use std::fmt::{self, Write as _};

use super::bounded::Rules;
use super::cleared::Gentle;
use super::feed::engagement_angle;
use super::loops::Sides;
use super::stream::Vectors;
use super::turning::Turning;
use crate::strategies::direction_keys;
use crate::vocabulary::{
    Definition, FeedDirection, Lines, PartKind, Passes, PlanError, Reading, Step, Strategy, Task,
};
use cutter::Cutter;
use field::mesh::Sense;
use geometry::Vector2;
use keys::{LENGTH, SceneError, Section, toml_number, word_of};
use motion::ROUNDING;

/// How a flow is made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Flow {
    /// Length over which the distance from the walls is smoothed, mm; `None`: that of four whose path is the
    /// quickest, or which has the shortest passes where the engagement is bounded.
    pub smoothing: Option<f64>,
    /// One spiral where passes are nested around one place.
    pub spiral: bool,
}

/// The passes of one step down.
#[derive(Debug, Clone, PartialEq)]
pub enum Pattern {
    /// Level curves of a flow that follows the walls.
    Flow(Flow),
    /// Offsets of the walls.
    Offset {
        /// One spiral where passes are nested around one place.
        spiral: bool,
    },
    /// Parallel lines.
    Zigzag {
        /// Their angle from the x axis, rad.
        angle: f64,
    },
    /// Levels of a stream function that follows feed directions.
    Streamline(Vectors),
}

impl Pattern {
    /// Whether a bounded engagement is kept by passes that go along the stock's border, and not by loops.
    pub(super) fn peels(&self) -> bool {
        matches!(self, Self::Flow(_) | Self::Offset { .. })
    }
}

/// Planned for less by this, rad, which is what sides of polylines, films and the parts in which angles are
/// told apart add. Loops alone, whose sides turn, need more.
pub(super) const SPARE: f64 = 0.025;
const SPARE_OF_LOOPS: f64 = 0.04;

/// Passes are planned for no less than this, rad, which is some hundredth of the radius aside: less is lost in
/// what angles have to spare.
const LEAST_OF_STEP: f64 = 0.15;

/// How deep the last passes along the walls go at once.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum WallFinish {
    /// As deep as each step down.
    #[default]
    Steps,
    /// All of the depth, after the last step, so that walls have no marks of the steps.
    Depth,
}

impl WallFinish {
    const WORDS: [(&'static str, Self); 2] = [("steps", Self::Steps), ("depth", Self::Depth)];
}

/// How a pocket is milled.
#[derive(Debug, Clone, PartialEq)]
pub struct PocketStrategy {
    /// The passes.
    pub pattern: Pattern,
    /// Largest step down, mm; `None`: all of the depth at once.
    pub stepdown: Option<f64>,
    /// Left for a last step over the floor, mm; 0 for none.
    pub floor_allowance: f64,
    /// Left at the walls for a last pass along them, mm; 0 for none.
    pub wall_allowance: f64,
    /// How deep the last passes along the walls go.
    pub wall_finish: WallFinish,
    /// Steepest way down, rad from level.
    pub ramp_angle: f64,
    /// Radius of the helix of the cutter's centre, mm; `None`: 0.8 of the cutter's radius, which leaves no
    /// core.
    pub helix_radius: Option<f64>,
    /// Most of the cutter's circumference in stock, rad. It bounds the stepover, and passes are planned
    /// within it everywhere but on ways down and in slots without room. Where more is all the same, the feed
    /// falls in proportion. `None`: passes are not bounded, and the feed falls above a quarter more than
    /// the stepover has in straight passes.
    pub engagement: Option<f64>,
    /// Where passes are planned for less, because an earlier plan was measured above the engagement there.
    pub gentle: Vec<Gentle>,
}

/// Helix radius over the cutter's radius when none is asked for. Above 1 a core would stand.
const HELIX_OVER_RADIUS: f64 = 0.8;

/// The least helix that is worth one, over the cutter's radius: a smaller one is a plunge.
const LEAST_HELIX: f64 = 0.2;

/// Greatest stepover over the cutter's diameter: a little less than what leaves nothing between straight passes.
const MOST_STEPOVER: f64 = 0.95;

/// Stepover over the cutter's diameter by default: 78 degrees of engagement.
const STEPOVER_OVER_DIAMETER: f64 = 0.4;

/// Stepover over the radius up to which the bottom lies lower than the scallop, by default: turns of passes
/// leave more between them than half of the stepover. And the least over the cutter's radius.
const STEPOVER_OVER_LOW: f64 = 1.6;
const LEAST_STEPOVER: f64 = 0.02;

/// Stepdown over the cutter's diameter by default.
const STEPDOWN_OVER_DIAMETER: f64 = 0.5;

/// Ramp angle by default, degrees: what most end mills take in steel and all in aluminium.
const RAMP_ANGLE: f64 = 3.0;

/// How scenes speak of a flow.
pub(crate) static FLOW: Definition = Definition {
    word: "pocket-flow",
    help: "a pocket along a flow that follows its walls and islands",
    part: PartKind::Pocket,
    keys: &["helix_radius", "engagement", "spiral", "smoothing"],
    read: |from| {
        let flow = Flow { smoothing: length(from.section, "smoothing")?, spiral: spiral(from.section)? };
        read(from, Pattern::Flow(flow))
    },
};

/// How scenes speak of offsets.
pub(crate) static OFFSET: Definition = Definition {
    word: "pocket-offset",
    help: "a pocket along offsets of its walls",
    part: PartKind::Pocket,
    keys: &["helix_radius", "engagement", "spiral"],
    read: |from| {
        let spiral = spiral(from.section)?;
        read(from, Pattern::Offset { spiral })
    },
};

/// How scenes speak of parallel lines.
pub(crate) static ZIGZAG: Definition = Definition {
    word: "pocket-zigzag",
    help: "a pocket in parallel lines",
    part: PartKind::Pocket,
    keys: &["helix_radius", "engagement", "angle"],
    read: |from| {
        let angle = from.section.number_or("angle", -360.0..=360.0, " degrees", 0.0)?.to_radians();
        read(from, Pattern::Zigzag { angle })
    },
};

/// How scenes speak of streamlines.
pub(crate) static STREAMLINE: Definition = Definition {
    word: "pocket-streamline",
    help: "a pocket along levels of a stream function that follows feed directions",
    part: PartKind::Pocket,
    keys: &["direction", "directions", "guides", "across", "direction_weight", "along_walls", "lines"],
    read: |from| {
        let direction = direction_keys::read_level(from.section, &mut from.tables)?;
        let direction_weight = direction_keys::read_weight(from.section)?;
        // Walls are streamlines of their own direction.
        let usual = direction == FeedDirection::Border(Sense::Along);
        let along_walls = from.section.flag("along_walls")?.unwrap_or(usual);
        let lines = from.section.choice("lines", &Lines::WORDS)?;
        read(from, Pattern::Streamline(Vectors { direction, direction_weight, along_walls, lines }))
    },
};

fn length(section: &Section<'_>, key: &str) -> Result<Option<f64>, SceneError> {
    Ok(section.length(key)?.map(|v| v.value))
}

fn spiral(section: &Section<'_>) -> Result<bool, SceneError> {
    Ok(section.flag("spiral")?.unwrap_or(false))
}

/// The keys of all of them.
fn read(from: &Reading<'_>, pattern: Pattern) -> Result<Box<dyn Strategy>, SceneError> {
    let section = from.section;
    let allowance = |key| section.number_or(key, 0.0..=*LENGTH.end(), " mm", 0.0);
    let wall_allowance = allowance("wall_allowance")?;
    if section.has("wall_finish") && wall_allowance == 0.0 {
        return Err(section.key_error(
            "wall_finish",
            "`wall_finish` does not apply without a `wall_allowance`",
            "delete it, or leave something at the walls: `wall_allowance = 0.2`",
        ));
    }
    let radians = |angle: f64| angle.to_radians();
    let stepdown = length(section, "stepdown")?;
    Ok(Box::new(PocketStrategy {
        pattern,
        stepdown: Some(stepdown.unwrap_or(2.0 * STEPDOWN_OVER_DIAMETER * from.cutter_radius)),
        floor_allowance: allowance("floor_allowance")?,
        wall_allowance,
        wall_finish: section.choice("wall_finish", &WallFinish::WORDS)?,
        ramp_angle: radians(section.number_or("ramp_angle", 0.1..=45.0, " degrees", RAMP_ANGLE)?),
        helix_radius: length(section, "helix_radius")?,
        engagement: section.number("engagement", 10.0..=180.0, " degrees")?.map(|v| radians(v.value)),
        gentle: Vec::new(),
    }))
}

/// The stepover of a pocket's toolpath. By default the ridges that the round of the corner leaves between
/// passes stay below `scallop` mm, and passes along the border of the stock are as far apart as their
/// engagement allows.
///
/// # Errors
/// A stepover that leaves material between passes.
pub fn read_pocket_step(section: &Section<'_>, cutter: &Cutter, scallop: f64) -> Result<Step, SceneError> {
    let (radius, corner) = (cutter.radius(), cutter.corner_radius());
    let low = cutter.flat_radius().max(0.0) + (scallop * (2.0 * corner - scallop)).max(0.0).sqrt();
    let step = match section.length("stepover")? {
        Some(step) if step.value > MOST_STEPOVER * 2.0 * radius + ROUNDING => {
            let message = format!(
                "`stepover` is {} mm, more than {MOST_STEPOVER} of the cutter's diameter of {} mm",
                step.value,
                2.0 * radius
            );
            return Err(section.error(&step.span, message, "write less, or material stays between passes"));
        }
        Some(step) => step.value,
        // Rounded, so that it reads back as it was written.
        None => {
            let strategy = section.text("strategy")?.map(|word| word.value);
            let peels = section.has("engagement") && [Some(FLOW.word), Some(OFFSET.word)].contains(&strategy);
            let share = if peels && corner == 0.0 { MOST_STEPOVER } else { STEPOVER_OVER_DIAMETER };
            let widest = if corner > 0.0 { STEPOVER_OVER_LOW * low } else { f64::INFINITY };
            let usual = (2.0 * share * radius).min(widest);
            (usual.max(LEAST_STEPOVER * radius) * 1e6).round() / 1e6
        }
    };
    Ok(Step::Stepover(step))
}

impl Strategy for PocketStrategy {
    fn definition(&self) -> &'static Definition {
        match &self.pattern {
            Pattern::Flow(_) => &FLOW,
            Pattern::Offset { .. } => &OFFSET,
            Pattern::Zigzag { .. } => &ZIGZAG,
            Pattern::Streamline(_) => &STREAMLINE,
        }
    }

    fn write(&self, out: &mut String) -> fmt::Result {
        match &self.pattern {
            Pattern::Flow(flow) => {
                writeln!(out, "spiral = {}", flow.spiral)?;
                if let Some(smoothing) = flow.smoothing {
                    writeln!(out, "smoothing = {}  # mm", toml_number(smoothing))?;
                }
            }
            Pattern::Offset { spiral } => writeln!(out, "spiral = {spiral}")?,
            Pattern::Zigzag { angle } => {
                writeln!(out, "angle = {}  # degrees from the x axis", toml_number(angle.to_degrees()))?
            }
            Pattern::Streamline(vectors) => {
                direction_keys::write(out, &vectors.direction, "\n")?;
                writeln!(out, "\ndirection_weight = {}", toml_number(vectors.direction_weight))?;
                writeln!(out, "along_walls = {}", vectors.along_walls)?;
                writeln!(out, "lines = \"{}\"", word_of(&Lines::WORDS, &vectors.lines))?;
            }
        }
        if let Some(stepdown) = self.stepdown {
            writeln!(out, "stepdown = {}  # mm", toml_number(stepdown))?;
        }
        writeln!(out, "floor_allowance = {}  # mm, left for a last step", toml_number(self.floor_allowance))?;
        writeln!(out, "wall_allowance = {}  # mm, left for a last pass", toml_number(self.wall_allowance))?;
        if self.wall_allowance > 0.0 {
            let word = WallFinish::WORDS.iter().find(|(_, finish)| *finish == self.wall_finish);
            let word = word.map_or("steps", |(word, _)| word);
            writeln!(out, "wall_finish = \"{word}\"  # passes along walls: each step, or all the depth")?;
        }
        writeln!(out, "ramp_angle = {}  # degrees", toml_number(self.ramp_angle.to_degrees()))?;
        if let Some(radius) = self.helix_radius {
            writeln!(out, "helix_radius = {}  # mm", toml_number(radius))?;
        }
        if let Some(angle) = self.engagement {
            writeln!(out, "engagement = {}  # degrees", toml_number(angle.to_degrees()))?;
        }
        Ok(())
    }

    fn shows_field(&self) -> bool {
        matches!(self.pattern, Pattern::Streamline(_))
    }

    fn direction_mut(&mut self) -> Option<&mut FeedDirection> {
        match &mut self.pattern {
            Pattern::Streamline(vectors) => Some(&mut vectors.direction),
            _ => None,
        }
    }

    /// There is no surface in a pocket; [`plan_pocket`](super::plan_pocket) plans one.
    fn passes(&self, _task: &Task<'_>) -> Result<Passes, PlanError> {
        let reason = "it mills pockets, and the part is none".to_owned();
        Err(PlanError::NotApplicable { strategy: self.definition().word, reason })
    }
}

impl PocketStrategy {
    /// The stepover, mm: the one asked for, or less where the engagement asks for it. Passes of bounded
    /// engagement have it where they are straight, and more where they turn toward stock, around islands.
    pub fn stepover(&self, step: Step, radius: f64) -> f64 {
        let asked = match step {
            Step::Stepover(s) => s,
            Step::Scallop(_) => 0.8 * radius,
        };
        self.engagement.map_or(asked, |angle| asked.min(radius * (1.0 - angle.cos())))
    }

    /// Angle of the cutter in stock, rad, that passes are planned within, if they are.
    pub(super) fn bounded(&self) -> Option<f64> {
        let spare = if self.pattern.peels() { SPARE } else { SPARE_OF_LOOPS };
        self.engagement.filter(|angle| *angle < std::f64::consts::PI).map(|angle| angle - spare)
    }

    /// What passes `step` mm apart at most are bounded by, if they are.
    pub(super) fn rules(&self, step: f64, cutter: &Cutter, depth: f64) -> Option<Rules> {
        let radius = cutter.radius();
        let bounded = self.bounded()?;
        // Passes along the border of the stock lie as far apart as the angle says; loops follow lines that do.
        let of_step = engagement_angle(step, radius).max(LEAST_OF_STEP);
        let limit = if self.pattern.peels() { bounded.min(of_step) } else { bounded };
        let bounds = Turning { limit, radius };
        let sides = match self.pattern {
            Pattern::Zigzag { angle } => Sides::Toward(Vector2::new(-angle.sin(), angle.cos())),
            Pattern::Flow(_) | Pattern::Offset { .. } | Pattern::Streamline(_) => Sides::Left,
        };
        let down = self.stepdown.map_or(depth, |step| step.min(depth)) / self.ramp_angle.sin();
        let core = cutter.flat_radius().max(0.5 * step);
        Some(Rules { bounds, sides, helix: self.helix(radius), down, step, core })
    }

    /// Radius that a helix should have, and the least that is worth one, mm.
    pub(super) fn helix(&self, radius: f64) -> [f64; 2] {
        [self.helix_radius.unwrap_or(HELIX_OVER_RADIUS * radius), LEAST_HELIX * radius]
    }

    /// Angle of the cutter in stock, rad, above which the feed falls.
    pub fn engagement_limit(&self, step: Step, radius: f64) -> f64 {
        /// Curved passes and links have a little more than straight ones; a feed that falls there is
        /// restless.
        const SLACK: f64 = 1.25;
        let straight = engagement_angle(self.stepover(step, radius), radius);
        self.engagement.unwrap_or(SLACK * straight).clamp(0.01, std::f64::consts::PI)
    }
}
