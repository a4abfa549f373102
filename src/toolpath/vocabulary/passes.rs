//! Planned passes, not yet joined.

use std::borrow::Cow;
use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

use crate::moves::touch::Touch;
use field::{PlannedField, ScalarField};
use geometry::{Point3, Vector3};

/// Planned passes, not yet joined, and remarks for the user.
#[derive(Debug, Clone, Default)]
pub struct Passes {
    /// Tip positions of each pass.
    pub passes: Vec<Vec<Point3>>,
    /// Where a tilted cutter touches along each pass, whose tips then count for nothing; empty for an upright
    /// one.
    pub touches: Vec<Vec<Touch>>,
    /// Remarks.
    pub notes: Vec<String>,
    /// What they were planned by, where they are levels of a function.
    pub field: PlannedField,
    /// Where the cutter touches along each pass, in order, where they are levels of a function.
    pub contacts: Vec<Vec<Contact>>,
    /// How far they are off the directions asked for.
    pub obedience: Obedience,
    /// The functions that they are levels of, one for each chart or piece that has passes.
    pub functions: Vec<Levelled>,
    /// Which faces they are made for.
    pub faces: Faces,
}

/// A face whose slope is that at the end of a range is within it: its normal is rounded.
const SLOPE_ROUNDING: f64 = 1e-9;

/// Faces of a part, by the vertical part of their unit normals.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Faces {
    /// The steepest ones.
    pub least: f64,
    /// The most level ones.
    pub most: f64,
}

impl Default for Faces {
    /// All.
    fn default() -> Self {
        Self::ALL
    }
}

impl Faces {
    /// Whatever their slope.
    pub const ALL: Self = Self { least: -1.0, most: 1.0 };

    /// Those with slopes between two angles from the level, rad; from level ground, or down to upright walls
    /// and beyond, where the range ends there.
    pub fn of_slopes([from, to]: [f64; 2]) -> Self {
        let least = if to < FRAC_PI_2 { to.cos() - SLOPE_ROUNDING } else { Self::ALL.least };
        let most = if from > 0.0 { from.cos() + SLOPE_ROUNDING } else { Self::ALL.most };
        Self { least, most }
    }

    /// Whether one with this unit normal is of them.
    pub fn hold(&self, normal: &Vector3) -> bool {
        self.contain(normal.z)
    }

    /// Whether one with this vertical part of its unit normal is of them.
    pub fn contain(&self, upright: f64) -> bool {
        (self.least..=self.most).contains(&upright.clamp(-1.0, 1.0))
    }

    /// Those that are of others, too.
    pub fn and(&self, others: &Self) -> Self {
        Self { least: self.least.max(others.least), most: self.most.min(others.most) }
    }
}

/// What the strategy of a plan made, for another plan of the same toolpath.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Kept {
    /// Tip positions of each pass of an upright cutter, not joined; empty where it tilts.
    pub passes: Vec<Vec<Point3>>,
    /// Remarks on them.
    pub notes: Vec<String>,
    /// What they were planned by, where the strategy shows it.
    pub field: Option<Arc<PlannedField>>,
    /// The functions that they are levels of, one for each chart or piece that has passes.
    pub functions: Vec<Levelled>,
    /// Which faces passes are made for: what stands on others is no matter of their widths.
    pub faces: Faces,
}

/// A function whose levels are passes, on one chart or piece of the part: kept, so that levels can be placed
/// anew without another search for it.
#[derive(Debug, Clone, PartialEq)]
pub struct Levelled {
    /// The function.
    pub function: LevelFunction,
    /// What it is, in a few words.
    pub planned_as: Cow<'static, str>,
    /// What is told of its passes, and the length that was predicted, mm.
    pub told: Option<(String, f64)>,
}

/// A function by its chart's parameters or by the vertices of its piece of mesh.
#[derive(Debug, Clone, PartialEq)]
pub enum LevelFunction {
    /// Over a chart's parameters.
    Chart(Arc<ScalarField>),
    /// At the vertices of a piece of mesh.
    Mesh(Arc<[f64]>),
}

impl Levelled {
    /// Puts itself and what is told of it with its passes.
    pub fn put_with(self, passes: &mut Passes) {
        if let Some((told, predicted)) = &self.told {
            let length = passes.length();
            passes.notes.push(format!("{told}: {length:.0} mm planned, {predicted:.0} mm predicted"));
        }
        passes.functions.push(self);
    }
}

impl Passes {
    /// Length of all passes, mm.
    pub fn length(&self) -> f64 {
        self.passes.iter().flat_map(|pass| pass.windows(2)).map(|w| (w[1] - w[0]).norm()).sum()
    }

    /// Appends the passes and remarks of patch `k`, from 0, of so many; remarks say which.
    pub fn append_patch(&mut self, [k, of]: [usize; 2], mut other: Self) {
        if of > 1 {
            other.notes.iter_mut().for_each(|note| *note = format!("on patch {} of {of}: {note}", k + 1));
        }
        self.append(other);
    }

    /// Appends the passes and remarks of another piece of the part.
    pub fn append(&mut self, other: Self) {
        self.passes.extend(other.passes);
        self.touches.extend(other.touches);
        self.notes.extend(other.notes);
        self.field.append(other.field);
        self.contacts.extend(other.contacts);
        self.obedience.append(other.obedience);
        self.functions.extend(other.functions);
    }
}

/// A place of a pass as the planner has it.
#[derive(Debug, Clone, Copy)]
pub struct Contact {
    pub at: Point3,
    /// Unit tangent across the feed.
    pub across: Vector3,
    /// Unit normal of the surface.
    pub normal: Vector3,
    /// Allowed interval, mm.
    pub allowed: f64,
    /// Whether it is on the part, on faces that are asked for.
    pub inside: bool,
    /// Its parameters on a chart.
    pub parameters: Option<[f64; 2]>,
    /// The unit tangent asked for here, where one is asked for at every place.
    pub asked: Option<Vector3>,
}

impl Contact {
    /// Unit tangent along the feed.
    pub fn along(&self) -> Vector3 {
        self.across.cross(&self.normal)
    }
}

/// Angles between passes and the directions asked for, taken together piece by piece.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Obedience {
    /// Sum of squares, rad², each times the length or the rows that it counts for.
    pub squares: f64,
    /// Sum of these, mm or rows.
    pub weights: f64,
    /// The greatest angle, rad, and where.
    pub greatest: Option<(f64, Point3)>,
    /// None is greater between the places either, rad.
    pub at_most: f64,
}
