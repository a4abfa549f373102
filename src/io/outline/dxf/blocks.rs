//! Blocks of a DXF and the layers on which they show something where they are inserted.

use std::collections::{HashMap, HashSet};

use super::{CodePair, Entity, items, section};

/// Which layers are read. Names of layers are compared as DXF has it, whatever their case.
pub struct Layers<'a> {
    /// The only one whose entities are wanted.
    pub wanted: Option<&'a str>,
    /// Lower case.
    frozen: HashSet<String>,
    off: HashSet<String>,
}

impl<'a> Layers<'a> {
    pub fn of(pairs: &[CodePair<'_>], wanted: Option<&'a str>) -> Self {
        let entries = || items(section(pairs, "TABLES").unwrap_or_default());
        let names = |is: &dyn Fn(&Entity<'_>) -> bool| {
            let found = entries().filter(|e| e.name == "LAYER" && is(e));
            found.filter_map(|e| Some(e.text(2)?.to_lowercase())).collect()
        };
        // The first bit freezes a layer, and a colour below zero turns it off.
        let colour = |e: &Entity<'_>| e.text(62).and_then(|t| t.parse().ok()).unwrap_or(0i64);
        Self { wanted, frozen: names(&|e| e.flags() & 1 == 1), off: names(&|e| colour(e) < 0) }
    }

    pub fn is_hidden(&self, layer: &str) -> bool {
        self.is_frozen(layer) || self.off.contains(&layer.to_lowercase())
    }

    fn is_frozen(&self, layer: &str) -> bool {
        self.frozen.contains(&layer.to_lowercase())
    }

    pub fn is_wanted(&self, layer: &str) -> bool {
        self.wanted.is_none_or(|wanted| wanted.to_lowercase() == layer.to_lowercase())
    }

    fn shows(&self, layer: &str) -> bool {
        self.is_wanted(layer) && !self.is_hidden(layer)
    }
}

/// The entities of each block of a drawing, by names in lower case.
pub struct Blocks<'a>(HashMap<String, Vec<Entity<'a>>>);

impl<'a> Blocks<'a> {
    pub fn of(pairs: &'a [CodePair<'a>]) -> Self {
        let mut blocks = HashMap::new();
        let mut entities = items(section(pairs, "BLOCKS").unwrap_or_default());
        while let Some(block) = entities.next() {
            let name = block.text(2).filter(|_| block.name == "BLOCK" && !is_elsewhere(&block));
            if let Some(name) = name {
                let held = entities.by_ref().take_while(|e| e.name != "ENDBLK").collect();
                blocks.insert(name.to_lowercase(), held);
            }
        }
        Self(blocks)
    }

    /// What an inserted block shows on a layer that is read, in words. An off layer hides what is on it and a
    /// frozen one the whole block; what is on layer 0 of a block is on the layer of its INSERT. So is all of a
    /// block that is not in the file.
    pub fn shown(&self, insert: &Entity<'_>, layers: &Layers<'_>) -> Option<String> {
        let mut open = vec![(insert.text(2).unwrap_or_default(), insert.layer())];
        let mut seen = HashSet::new();
        while let Some((name, layer)) = open.pop() {
            if layers.is_frozen(layer) || !seen.insert((name.to_lowercase(), layer)) {
                continue;
            }
            let Some(held) = self.0.get(&name.to_lowercase()) else {
                if layers.shows(layer) {
                    return Some(format!("its block \"{name}\" is not in the file"));
                }
                continue;
            };
            for entity in held.iter().filter(|e| !e.is_invisible()) {
                let on = if entity.layer() == "0" { layer } else { entity.layer() };
                if entity.name == "INSERT" {
                    open.push((entity.text(2).unwrap_or_default(), on));
                } else if !["VERTEX", "SEQEND"].contains(&entity.name) && layers.shows(on) {
                    let Entity { name: kind, line, .. } = entity;
                    return Some(format!(
                        "its block \"{name}\" has {kind} (line {line}) on the layer \"{on}\""
                    ));
                }
            }
        }
        None
    }
}

/// Whether a block is that of another drawing.
fn is_elsewhere(block: &Entity<'_>) -> bool {
    block.flags() & (4 | 8) != 0
}
