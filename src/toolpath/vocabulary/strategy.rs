//! What a strategy is: its name and keys in a scene, and its passes.
//!
//! Each strategy is one file under `strategies` (those of pockets: `pocket/strategy.rs`), which holds its
//! parameters, its [`Definition`] with the reader, the writer and the planner, and one line in the list
//! [`STRATEGIES`](crate::STRATEGIES).

use std::any::Any;
use std::fmt::{self, Debug};

use super::{FeedDirection, Links, Passes, PlanError, Task};
use keys::{Located, SceneError, Section};

/// Which parts a strategy is made for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PartKind {
    /// Surfaces and meshes.
    Surface,
    /// Pockets: a plane region cut down to a level floor.
    Pocket,
    /// Any part.
    Any,
}

impl PartKind {
    /// Keys that every toolpath over such a part takes, whatever its strategy.
    pub fn common_keys(self) -> &'static [&'static str] {
        match self {
            Self::Surface => &[
                "name",
                "strategy",
                "stepover",
                "scallop",
                "correct",
                "links",
                "longest_link",
                "smoothing",
                "axis",
                "slope",
                "stock",
                "stepdown",
                "allowance",
                "boundary",
                "rest",
                "cutter",
                "holder",
            ],
            Self::Pocket => &[
                "name",
                "strategy",
                "stepover",
                "stepdown",
                "floor_allowance",
                "wall_allowance",
                "wall_finish",
                "ramp_angle",
            ],
            Self::Any => &["name", "strategy", "stock"],
        }
    }

    /// Whether a strategy for such parts mills a part of another kind.
    pub fn suits(self, part: Self) -> bool {
        self == Self::Any || self == part
    }
}

/// How scenes speak of a strategy.
#[derive(Debug)]
pub struct Definition {
    /// Its word.
    pub word: &'static str,
    /// What it does, in a line.
    pub help: &'static str,
    /// Which parts it is made for.
    pub part: PartKind,
    /// Its own keys, besides those of all toolpaths over such parts.
    pub keys: &'static [&'static str],
    /// Reads it from a toolpath's table, in which no other keys are left.
    pub read: fn(&mut Reading<'_>) -> Result<Box<dyn Strategy>, SceneError>,
}

impl Definition {
    /// All keys of a toolpath with this strategy.
    pub fn all_keys(&self) -> Vec<&'static str> {
        self.part.common_keys().iter().chain(self.keys).copied().collect()
    }
}

/// A toolpath's table that is read.
#[derive(Debug)]
pub struct Reading<'a> {
    /// The table.
    pub section: &'a Section<'a>,
    /// Radius of the scene's cutter, mm, which some defaults follow.
    pub cutter_radius: f64,
    /// Files of feed directions that the table names, in order.
    pub tables: Vec<Located<String>>,
}

/// A way to cover a part with passes.
pub trait Strategy: Any + Debug + Send + Sync + BoxedClone {
    /// How scenes speak of it.
    fn definition(&self) -> &'static Definition;

    /// Writes its keys as scenes spell them, a line each, with every default in effect.
    ///
    /// # Errors
    /// Those of `out`.
    fn write(&self, out: &mut String) -> fmt::Result;

    /// Plans its passes over a surface.
    ///
    /// # Errors
    /// See [`PlanError`].
    fn passes(&self, task: &Task<'_>) -> Result<Passes, PlanError>;

    /// Whether its passes may be fed from either end.
    fn both_ways(&self) -> bool {
        true
    }

    /// Whether its passes follow the mesh of the part, and no smooth surface that is fitted to it.
    fn on_facets(&self, _task: &Task<'_>) -> bool {
        false
    }

    /// Whether feed directions and the function whose levels are passes are of interest to the user.
    fn shows_field(&self) -> bool {
        false
    }

    /// Whether its passes are spaced by the axis of the cutter, so that they leave nothing between them where
    /// they are held up at a level. Others lie so that contacts are near each other: on a crest the axes of
    /// two of them may stand farther apart than the cutter is wide.
    fn is_spaced_in_plan(&self) -> bool {
        false
    }

    /// How its passes are joined where nothing is said of it.
    fn usual_links(&self) -> Links {
        Links::Retract
    }

    /// Its feed direction, if it follows one: files of directions are read into it.
    fn direction_mut(&mut self) -> Option<&mut FeedDirection> {
        None
    }
}

/// Copies behind a box.
pub trait BoxedClone {
    /// The same strategy once more.
    fn boxed_clone(&self) -> Box<dyn Strategy>;
}

impl<S: Strategy + Clone> BoxedClone for S {
    fn boxed_clone(&self) -> Box<dyn Strategy> {
        Box::new(self.clone())
    }
}

impl dyn Strategy {
    /// Its name as scenes spell it.
    pub fn word(&self) -> &'static str {
        self.definition().word
    }

    /// The strategy as one of a kind, if it is of that kind.
    pub fn downcast_ref<S: Strategy>(&self) -> Option<&S> {
        (self as &dyn Any).downcast_ref()
    }

    /// Its keys as scenes spell them, a line each.
    fn written(&self) -> String {
        let mut out = String::new();
        // Writing into a string cannot fail.
        let _ = self.write(&mut out);
        out
    }
}

impl Clone for Box<dyn Strategy> {
    fn clone(&self) -> Self {
        (**self).boxed_clone()
    }
}

/// Two strategies are the same where a scene spells them alike.
impl PartialEq for dyn Strategy {
    fn eq(&self, other: &Self) -> bool {
        self.word() == other.word() && self.written() == other.written()
    }
}

/// Lets requests derive equality: of boxes the compiler would move the strategy out (rust-lang/rust#31740).
impl PartialEq<&Self> for Box<dyn Strategy> {
    fn eq(&self, other: &&Self) -> bool {
        **self == ***other
    }
}
