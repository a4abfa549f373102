//! Planned passes, not yet joined.

use crate::moves::touch::Touch;
use field::PlannedField;
use geometry::{Point3, Vector3};

/// Planned passes, not yet joined, and remarks for the user.
#[derive(Debug, Clone, Default)]
pub struct Passes {
    /// Tip positions of each pass.
    pub passes: Vec<Vec<Point3>>,
    /// Where a tilted cutter touches along each pass, whose tips then count for nothing; empty for an upright one.
    pub touches: Vec<Vec<Touch>>,
    /// Remarks.
    pub notes: Vec<String>,
    /// What they were planned by, where they are levels of a function.
    pub field: PlannedField,
    /// Where the cutter touches along each pass, in no order, where they are levels of a function.
    pub contacts: Vec<Vec<Contact>>,
}

impl Passes {
    /// Length of all passes, mm.
    pub fn length(&self) -> f64 {
        self.passes.iter().flat_map(|pass| pass.windows(2)).map(|w| (w[1] - w[0]).norm()).sum()
    }

    /// Appends the passes and remarks of another piece of the part.
    pub fn append(&mut self, other: Self) {
        self.passes.extend(other.passes);
        self.touches.extend(other.touches);
        self.notes.extend(other.notes);
        self.field.append(other.field);
        self.contacts.extend(other.contacts);
    }
}

/// A place of a pass as the planner has it.
#[derive(Debug, Clone, Copy)]
pub struct Contact {
    pub at: Point3,
    /// Unit tangent across the feed.
    pub across: Vector3,
    /// Allowed interval, mm.
    pub allowed: f64,
    pub inside: bool,
    /// Its parameters on a chart.
    pub parameters: Option<[f64; 2]>,
}
