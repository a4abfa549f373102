//! The history: one line of JSON a nightly, only ever appended to.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::results::Results;

/// One nightly of the history.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Night {
    /// What tells it from all others. The same results are appended once.
    pub id: String,
    /// When it ended, UTC.
    pub date: String,
    /// Version of the program.
    pub millstream: String,
    /// By the scenes' names.
    pub scenes: BTreeMap<String, NightScene>,
}

/// One scene of a night.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NightScene {
    /// The verdict in a word, or "failed".
    pub verdict: String,
    /// Cost over that of the reference work.
    pub cost: Option<f64>,
    /// By the toolpaths' names: figures by their keys.
    pub toolpaths: BTreeMap<String, BTreeMap<String, f64>>,
}

impl Night {
    /// The night of these results.
    pub fn of(results: &Results, id: String) -> Self {
        let scenes = results.scenes.iter().map(|scene| {
            let toolpaths = scene.toolpaths().iter().map(|t| (t.name.clone(), t.figures.clone())).collect();
            let night = NightScene { verdict: scene.word().to_owned(), cost: scene.cost_ratio(), toolpaths };
            (scene.name.clone(), night)
        });
        Self {
            id,
            date: results.date.clone(),
            millstream: results.millstream.clone(),
            scenes: scenes.collect(),
        }
    }

    /// Its line, with the line break; `None` never happens with finite numbers.
    pub fn line(&self) -> Option<String> {
        serde_json::to_string(self).ok().map(|line| line + "\n")
    }
}

/// All nights, oldest first.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct History {
    /// In the order of the file.
    pub nights: Vec<Night>,
    /// Lines that could not be read, such as one that a full disk cut short.
    pub skipped: usize,
}

impl History {
    /// Reads a history. Lines that are none are counted and left where they are.
    pub fn parse(text: &str) -> Self {
        let mut history = Self::default();
        for line in text.lines().filter(|line| !line.trim().is_empty()) {
            match serde_json::from_str(line) {
                Ok(night) => history.nights.push(night),
                Err(_) => history.skipped += 1,
            }
        }
        history
    }

    /// Whether it has this night.
    pub fn has(&self, id: &str) -> bool {
        self.nights.iter().any(|night| night.id == id)
    }

    /// A figure over the last nights, oldest first, of those that measured it.
    pub fn trend(&self, scene: &str, toolpath: &str, key: &str) -> Vec<f64> {
        self.last(|night| night.scenes.get(scene)?.toolpaths.get(toolpath)?.get(key).copied())
    }

    /// A scene's cost over the last nights, oldest first.
    pub fn cost_trend(&self, scene: &str) -> Vec<f64> {
        self.last(|night| night.scenes.get(scene)?.cost)
    }

    fn last(&self, value: impl Fn(&Night) -> Option<f64>) -> Vec<f64> {
        /// Nights that a trend line has room for.
        const MOST: usize = 60;
        let nights = &self.nights[self.nights.len().saturating_sub(MOST)..];
        nights.iter().filter_map(value).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixture::{failed, results, scene};
    use super::*;

    #[test]
    fn trends_come_from_the_lines() {
        let night =
            |value: f64| Night::of(&results(vec![scene("a", value), failed("b", "x")]), format!("{value}"));
        let lines: String = [0.01, 0.02].map(|value| night(value).line().unwrap()).concat();
        // A line that a kill cut short does no harm to the others.
        let history =
            History::parse(&format!("{lines}{{\"id\": \"x\", \"da\n{}", night(0.03).line().unwrap()));
        assert_eq!((history.nights.len(), history.skipped), (3, 1));
        assert_eq!(history.trend("a", "zigzag", "gouge_mm"), [0.01, 0.02, 0.03]);
        assert_eq!(history.cost_trend("a"), [2000.0; 3]);
        assert!(history.trend("b", "zigzag", "gouge_mm").is_empty());
        assert!(history.has("0.02") && !history.has("0.04"));
        assert_eq!(history.nights[0], night(0.01));
    }
}
