//! The strategies, one file each: its parameters, its keys in a scene, its planner. Enters: part, cutter and
//! pass settings. Leaves: passes, not yet joined.
//!
//! A new strategy is a new file and a line in [`STRATEGIES`]; its words, keys, defaults and help come from
//! there.

mod contour_spiral;
pub(crate) mod direction_keys;
pub(crate) mod iso_parametric;
pub(crate) mod iso_scallop;
mod mesh_contours;
mod mesh_front;
mod mesh_passes;
mod mesh_shortest;
mod offset_mesh;
pub(crate) mod offset_surface;
pub(crate) mod program;
pub(crate) mod shortest;
pub(crate) mod spiral;
mod stream_search;
pub(crate) mod streamline;
pub(crate) mod waterline;
pub(crate) mod zigzag;

use crate::pocket::strategy as pocket;
use crate::vocabulary::{Definition, PartKind, Reading, Strategy};
use keys::{Located, SceneError, Section};

/// All strategies, in the order in which they are named to users.
pub const STRATEGIES: &[&Definition] = &[
    &zigzag::DEFINITION,
    &iso_parametric::DEFINITION,
    &iso_scallop::DEFINITION,
    &waterline::DEFINITION,
    &spiral::DEFINITION,
    &offset_surface::DEFINITION,
    &streamline::DEFINITION,
    &pocket::FLOW,
    &pocket::OFFSET,
    &pocket::ZIGZAG,
    &pocket::STREAMLINE,
    &program::DEFINITION,
];

/// The words of all strategies for a kind of part, with commas between them.
pub fn words_for(part: PartKind) -> String {
    let words = STRATEGIES.iter().filter(|strategy| strategy.part.suits(part)).map(|strategy| strategy.word);
    words.collect::<Vec<_>>().join(", ")
}

/// A strategy as a toolpath's table asks for it.
#[derive(Debug)]
pub struct StrategyRead {
    /// Its word, and where it stands.
    pub word: Located<&'static str>,
    /// The strategy.
    pub strategy: Box<dyn Strategy>,
    /// Files of feed directions that are still to be read into it, in order.
    pub tables: Vec<Located<String>>,
}

/// Reads the strategy of a toolpath's table; `cutter_radius` is the scene's, mm. Refuses keys that the
/// strategy does not take.
///
/// # Errors
/// [`SceneError`] at the first word, key or value that is wrong.
pub fn read_strategy(section: &Section<'_>, cutter_radius: f64) -> Result<StrategyRead, SceneError> {
    let mut all: Vec<&str> = Vec::new();
    for key in STRATEGIES.iter().flat_map(|strategy| strategy.all_keys()) {
        if !all.contains(&key) {
            all.push(key);
        }
    }
    if !section.has("strategy") {
        section.only(&all, &[], "a toolpath")?;
    }
    let words: Vec<&'static str> = STRATEGIES.iter().map(|strategy| strategy.word).collect();
    let word = section.required_word("strategy", &words)?;
    let definition = STRATEGIES.iter().find(|strategy| strategy.word == word.value).unwrap_or(&STRATEGIES[0]);
    section.only(&definition.all_keys(), &all, &format!("strategy = \"{}\"", word.value))?;
    let mut reading = Reading { section, cutter_radius, tables: Vec::new() };
    let strategy = (definition.read)(&mut reading)?;
    Ok(StrategyRead { word, strategy, tables: reading.tables })
}
