//! The variables of a program: `#1` to `#99999` and `#<names>`. Each call of a subprogram has locals of its
//! own.

use std::collections::HashMap;

use crate::error::{Fault, Stop};

/// Most locals of a call, `#1` to `#33`. LinuxCNC has 30 of them, Fanuc 33.
const LOCALS: usize = 33;

/// The greatest number of a parameter.
const GREATEST: f64 = 99_999.0;

/// The variables that one call sees alone.
#[derive(Debug, Clone)]
pub(crate) struct Locals {
    numbered: [Option<f64>; LOCALS + 1],
    named: HashMap<String, f64>,
}

impl Default for Locals {
    fn default() -> Self {
        Self { numbered: [None; LOCALS + 1], named: HashMap::new() }
    }
}

/// All variables.
#[derive(Debug)]
pub(crate) struct Parameters {
    /// How many belong to each call alone.
    count: usize,
    globals: HashMap<u32, f64>,
    named: HashMap<String, f64>,
    calls: Vec<Locals>,
    main: Locals,
}

/// What an assignment sets.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Target {
    Number(u32),
    Name(String),
}

/// A number as that of a parameter.
pub(crate) fn index(value: f64, column: usize) -> Result<u32, Stop> {
    let whole = value.round();
    if (value - whole).abs() < 1e-4 && (0.0..=GREATEST).contains(&whole) {
        Ok(whole as u32)
    } else {
        Err(Stop::new(column, Fault::Parameter(value)))
    }
}

/// Names are read without blanks and in lower case, as LinuxCNC does.
pub(crate) fn name(text: &[u8]) -> String {
    let letters = text.iter().filter(|b| !b.is_ascii_whitespace()).map(u8::to_ascii_lowercase);
    String::from_utf8_lossy(&letters.collect::<Vec<u8>>()).into_owned()
}

impl Parameters {
    /// None set; `count` of them, at most 33, belong to each call alone.
    pub fn new(count: usize) -> Self {
        let count = count.min(LOCALS);
        Self {
            count,
            globals: HashMap::new(),
            named: HashMap::new(),
            calls: Vec::new(),
            main: Locals::default(),
        }
    }

    fn locals(&self) -> &Locals {
        self.calls.last().unwrap_or(&self.main)
    }

    fn locals_mut(&mut self) -> &mut Locals {
        self.calls.last_mut().unwrap_or(&mut self.main)
    }

    /// A numbered parameter; `None` where it is empty.
    pub fn get(&self, number: u32) -> Option<f64> {
        match number {
            0 => None,
            n if n as usize <= self.count => self.locals().numbered[n as usize],
            n => self.globals.get(&n).copied(),
        }
    }

    /// A named one: names with a leading `_` belong to the whole program.
    pub fn named(&self, name: &str) -> Option<f64> {
        let of = if name.starts_with('_') { &self.named } else { &self.locals().named };
        of.get(name).copied()
    }

    /// Sets one; an empty value empties it.
    pub fn set(&mut self, target: &Target, value: Option<f64>) {
        match target {
            Target::Number(n) if *n as usize <= self.count => {
                self.locals_mut().numbered[*n as usize] = value.filter(|_| *n > 0);
            }
            Target::Number(n) => match value {
                Some(value) => drop(self.globals.insert(*n, value)),
                None => drop(self.globals.remove(n)),
            },
            Target::Name(name) => {
                let all = if name.starts_with('_') { &mut self.named } else { &mut self.locals_mut().named };
                all.insert(name.clone(), value.unwrap_or(0.0));
            }
        }
    }

    /// Begins a call with these locals, from `#1` on.
    pub fn enter(&mut self, arguments: &[(usize, f64)]) {
        let mut locals = Locals::default();
        for (k, value) in arguments {
            if (1..=self.count).contains(k) {
                locals.numbered[*k] = Some(*value);
            }
        }
        self.calls.push(locals);
    }

    /// Ends it.
    pub fn leave(&mut self) {
        self.calls.pop();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_call_has_locals_of_its_own() {
        let mut all = Parameters::new(33);
        let [one, hundred] = [1, 100].map(Target::Number);
        all.set(&one, Some(7.0));
        all.set(&hundred, Some(8.0));
        all.enter(&[(2, 3.0)]);
        assert_eq!([all.get(1), all.get(2), all.get(100)], [None, Some(3.0), Some(8.0)]);
        all.set(&Target::Name("_deep".into()), Some(1.0));
        all.set(&Target::Name("deep".into()), Some(2.0));
        all.leave();
        assert_eq!((all.get(1), all.named("_deep"), all.named("deep")), (Some(7.0), Some(1.0), None));
        let mut few = Parameters::new(30);
        few.set(&Target::Number(31), Some(5.0));
        few.enter(&[(31, 9.0)]);
        assert_eq!(few.get(31), Some(5.0), "#31 belongs to all calls of LinuxCNC");
        assert!(index(2.5, 0).is_err() && index(-1.0, 0).is_err() && index(1e5, 0).is_err());
    }
}
