//! What holds the cutter and must not touch the part: the shank above the cutting length and the
//! stacked sections of the holder. mm, heights above the tip.

use keys::{SceneError, Section};

/// Lengths and diameters from this on are no holder's, mm.
const GREATEST: f64 = 1.0e4;

/// One cylinder or truncated cone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HolderSection {
    /// Diameter at its lower end.
    pub diameter: f64,
    /// Diameter at its upper end.
    pub top_diameter: f64,
    /// Its height.
    pub length: f64,
}

impl HolderSection {
    /// Reads the table of one.
    ///
    /// # Errors
    /// [`SceneError`] where a key is missing, unknown or out of range.
    pub fn read(table: &Section<'_>) -> Result<Self, SceneError> {
        table.only(&["diameter", "top_diameter", "length"], &[], "a section of the holder")?;
        let diameter = table.required_length("diameter", 32.0)?.value;
        Ok(Self {
            diameter,
            top_diameter: table.length_or("top_diameter", diameter)?,
            length: table.required_length("length", 40.0)?.value,
        })
    }
}

/// Shank and holder, section on section upward from the end of the cutting length.
#[derive(Debug, Clone, PartialEq)]
pub struct Holder {
    cutting_length: f64,
    sections: Vec<HolderSection>,
}

/// Why no holder could be made.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum HolderError {
    /// There is nothing to hold the cutter.
    #[error("the holder has no section")]
    Empty,
    /// A dimension is not positive, or no number.
    #[error("{what} of section {section} is {value} mm; it must be a positive number below {GREATEST}")]
    Dimension {
        /// Section, counted from 1 at the bottom; 0 is the cutting length.
        section: usize,
        /// Which dimension.
        what: &'static str,
        /// What was given.
        value: f64,
    },
}

impl Holder {
    /// The sections from the bottom upward; the first stands `cutting_length` (APMX) above the tip.
    ///
    /// # Errors
    /// When there is no section or a dimension is not a positive number below 10 m.
    pub fn new(cutting_length: f64, sections: Vec<HolderSection>) -> Result<Self, HolderError> {
        let check = |section, what, value: f64| {
            let sound = value > 0.0 && value < GREATEST;
            if sound { Ok(()) } else { Err(HolderError::Dimension { section, what, value }) }
        };
        if sections.is_empty() {
            return Err(HolderError::Empty);
        }
        check(0, "the cutting length", cutting_length)?;
        for (k, section) in sections.iter().enumerate() {
            check(k + 1, "the diameter", section.diameter)?;
            check(k + 1, "the upper diameter", section.top_diameter)?;
            check(k + 1, "the length", section.length)?;
        }
        Ok(Self { cutting_length, sections })
    }

    /// Height above the tip at which the first section begins, mm.
    pub fn cutting_length(&self) -> f64 {
        self.cutting_length
    }

    /// The sections, from the bottom upward.
    pub fn sections(&self) -> &[HolderSection] {
        &self.sections
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECTIONS: [HolderSection; 3] = [
        HolderSection { diameter: 6.0, top_diameter: 6.0, length: 20.0 },
        HolderSection { diameter: 20.0, top_diameter: 30.0, length: 15.0 },
        HolderSection { diameter: 50.0, top_diameter: 40.0, length: 30.0 },
    ];

    #[test]
    fn impossible_holders_are_refused() {
        assert_eq!(Holder::new(10.0, vec![]), Err(HolderError::Empty));
        assert!(Holder::new(0.0, SECTIONS.to_vec()).is_err());
        for value in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e4] {
            for edit in 0..3 {
                let mut section = SECTIONS[0];
                *[&mut section.diameter, &mut section.top_diameter, &mut section.length][edit] = value;
                let error = Holder::new(10.0, vec![SECTIONS[1], section]).unwrap_err();
                assert!(matches!(error, HolderError::Dimension { section: 2, .. }), "{error}");
            }
        }
    }
}
