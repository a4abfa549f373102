//! Which engine cuts: named, or chosen for the path.

use std::fmt;

use super::{ENGINES, Engine};

/// An engine, or the choice left open.
#[derive(Clone, Copy, Default)]
pub struct EngineChoice(Option<&'static dyn Engine>);

/// The word that leaves the choice open.
const AUTO: &str = "auto";

impl EngineChoice {
    /// The choice that a word stands for.
    pub fn from_word(word: &str) -> Option<Self> {
        let named = || ENGINES.into_iter().find(|engine| engine.word() == word);
        if word == AUTO { Some(Self(None)) } else { named().map(|engine| Self(Some(engine))) }
    }

    /// All words that scenes and the command line accept.
    pub fn words() -> Vec<&'static str> {
        std::iter::once(AUTO).chain(ENGINES.iter().map(|engine| engine.word())).collect()
    }

    /// Its word.
    pub fn word(self) -> &'static str {
        self.0.map_or(AUTO, |engine| engine.word())
    }

    /// The engine that cuts a path whose cutter stands upright, or leans.
    pub fn for_path(self, tilted: bool) -> &'static dyn Engine {
        let first = || ENGINES.into_iter().find(|engine| engine.tilts() || !tilted);
        self.0.or_else(first).unwrap_or(ENGINES[0])
    }
}

impl PartialEq for EngineChoice {
    fn eq(&self, other: &Self) -> bool {
        self.word() == other.word()
    }
}

impl Eq for EngineChoice {}

impl fmt::Debug for EngineChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_word_comes_back_and_an_open_choice_suits_the_path() {
        for word in EngineChoice::words() {
            assert_eq!(EngineChoice::from_word(word).unwrap().word(), word);
        }
        assert!(EngineChoice::from_word("dexel").is_none());
        let open = EngineChoice::default();
        assert_eq!([open.for_path(false).word(), open.for_path(true).word()], ["zmap", "rays"]);
        assert_eq!(EngineChoice::from_word("zmap").unwrap().for_path(true).word(), "zmap");
    }
}
