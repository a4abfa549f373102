//! What a family of cutters is: its word, its keys, and the cutter that they make.

use std::ops::RangeInclusive;

use keys::LENGTH;

use super::body::{Cutter, CutterError};

/// The unit of angles, as messages write it after a number.
const DEGREES: &str = " degrees";

/// A dimension of a family: a key of `[cutter]`, and a number of the short form, `bull:10:2`.
#[derive(Debug, Clone)]
pub struct CutterKey {
    /// The key.
    pub name: &'static str,
    /// The label in comments of programs.
    pub label: &'static str,
    /// Values that are read, mm or degrees.
    pub range: RangeInclusive<f64>,
    /// The unit after a number, with the space before it.
    pub unit: &'static str,
    /// An example, for a key that must be there; `None` for one that may be left away.
    pub example: Option<f64>,
    /// The comment behind the value in a complete scene; empty for none.
    pub note: &'static str,
    /// The dimension of a cutter, mm or rad.
    of: fn(&Cutter) -> f64,
}

impl CutterKey {
    /// A number of mm within `range` that may be left away.
    pub(super) const fn number(
        name: &'static str,
        label: &'static str,
        range: RangeInclusive<f64>,
        of: fn(&Cutter) -> f64,
    ) -> Self {
        Self { name, label, range, unit: " mm", example: None, note: "", of }
    }

    /// A positive length that must be there.
    pub(super) const fn length(
        name: &'static str,
        label: &'static str,
        example: f64,
        of: fn(&Cutter) -> f64,
    ) -> Self {
        Self { example: Some(example), ..Self::number(name, label, LENGTH, of) }
    }

    /// An angle within `range` of degrees that may be left away; `of` gives it in rad.
    pub(super) const fn angle(
        name: &'static str,
        label: &'static str,
        range: RangeInclusive<f64>,
        of: fn(&Cutter) -> f64,
    ) -> Self {
        Self { unit: DEGREES, ..Self::number(name, label, range, of) }
    }

    /// The same, which must be there.
    pub(super) const fn needed(self, example: f64) -> Self {
        Self { example: Some(example), ..self }
    }

    /// The same with a comment behind its value in a complete scene.
    pub(super) const fn noted(self, note: &'static str) -> Self {
        Self { note, ..self }
    }

    /// True for an angle, which is in degrees.
    pub fn is_angle(&self) -> bool {
        self.unit == DEGREES
    }

    /// The dimension of a cutter of this family, mm or degrees.
    pub fn of(&self, cutter: &Cutter) -> f64 {
        let value = (self.of)(cutter);
        if self.is_angle() { value.to_degrees() } else { value }
    }
}

/// The numbers that were given for the keys of a family.
pub(super) struct Given<'a> {
    keys: &'a [CutterKey],
    /// As many as keys, mm or degrees.
    values: &'a [Option<f64>],
}

impl<'a> Given<'a> {
    pub fn new(keys: &'a [CutterKey], values: &'a [Option<f64>]) -> Self {
        Self { keys, values }
    }

    /// The value of a key that may be left away, mm or rad.
    pub fn optional(&self, name: &str) -> Option<f64> {
        let (key, value) = self.keys.iter().zip(self.values).find(|(key, _)| key.name == name)?;
        value.map(|value| if key.is_angle() { value.to_radians() } else { value })
    }

    /// The value of a key that must be there, mm or rad. Without it NaN, which every constructor refuses.
    pub fn value(&self, name: &str) -> f64 {
        self.optional(name).unwrap_or(f64::NAN)
    }
}

/// A family of cutters.
#[derive(Debug, Clone)]
pub struct Family {
    /// The word for `shape` in scenes, and that before the colons of the short form.
    pub word: &'static str,
    /// The words before the dimensions in comments of programs.
    pub title: &'static str,
    /// Its dimensions, in the order of the short form.
    pub keys: &'static [CutterKey],
    /// An example of the short form; `None` for a family that has none.
    pub example: Option<&'static str>,
    pub(super) make: fn(&Given<'_>) -> Result<Cutter, CutterError>,
    /// The key to which an error belongs.
    pub(super) blame: fn(&CutterError) -> &'static str,
}

impl Family {
    /// The short form with its keys in capitals, `bull:DIAMETER:CORNER_RADIUS`.
    pub fn short_form(&self) -> Option<String> {
        self.example.map(|_| {
            self.keys.iter().fold(self.word.to_owned(), |form, key| form + ":" + &key.name.to_uppercase())
        })
    }

    /// The short form with its units and an example.
    pub(super) fn usage(&self) -> Option<String> {
        let units = if self.keys.iter().any(CutterKey::is_angle) { ", mm and degrees" } else { "" };
        Some(format!("{}{units}, such as {}", self.short_form()?, self.example?))
    }

    /// The cutter of as many numbers as the family has keys, mm and degrees.
    pub(super) fn cutter(&self, values: &[Option<f64>]) -> Result<Cutter, CutterError> {
        (self.make)(&Given::new(self.keys, values))
    }
}
