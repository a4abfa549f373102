//! A cutter in one word, as the command line takes it: `ball:6`, `flat:6`, `bull:10:2`, `taper:2:1:5:6`.

use super::body::{Cutter, CutterError};
use super::families::{FAMILIES, short_forms};

/// Why a word names no cutter.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CutterWordError {
    /// The shape is none.
    #[error("\"{0}\" is no shape of a cutter; write {forms}", forms = short_forms())]
    Shape(String),
    /// Too few or too many numbers.
    #[error("{word} takes {wanted} number{}, and {given} given; write {usage}", if *wanted == 1 { "" } else { "s" })]
    Count {
        /// The shape.
        word: &'static str,
        /// Numbers that it takes.
        wanted: usize,
        /// Numbers that stand there.
        given: usize,
        /// How it is written.
        usage: String,
    },
    /// Something between colons is no number.
    #[error("\"{text}\" is not a number; write {usage}")]
    Number {
        /// What stands there.
        text: String,
        /// How the cutter is written.
        usage: String,
    },
    /// The numbers make no cutter.
    #[error(transparent)]
    Cutter(#[from] CutterError),
}

impl std::str::FromStr for Cutter {
    type Err = CutterWordError;

    /// A cutter from the short form of its family ([`short_forms`]): a word and a number for each key, mm
    /// and degrees.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let mut parts = text.trim().split(':');
        let shape = parts.next().unwrap_or_default();
        let known = FAMILIES.iter().filter_map(|family| Some((family, family.usage()?)));
        let (family, usage) = known
            .into_iter()
            .find(|(family, _)| family.word == shape)
            .ok_or_else(|| CutterWordError::Shape(shape.to_owned()))?;
        let number = |text: &str| {
            let refused = |_| CutterWordError::Number { text: text.to_owned(), usage: usage.clone() };
            text.trim().parse::<f64>().map(Some).map_err(refused)
        };
        let values: Vec<Option<f64>> = parts.map(number).collect::<Result<_, _>>()?;
        let (wanted, given) = (family.keys.len(), values.len());
        if given != wanted {
            return Err(CutterWordError::Count { word: family.word, wanted, given, usage });
        }
        Ok(family.cutter(&values)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(text: &str) -> String {
        text.parse::<Cutter>().unwrap_err().to_string()
    }

    #[test]
    fn a_short_name_is_read_back() {
        for word in ["ball:6", "flat:31.75", "bull:10:2", "taper:2:1:5:6"] {
            assert_eq!(word.parse::<Cutter>().unwrap().short_name(), word);
        }
    }

    #[test]
    fn words_name_cutters() {
        assert_eq!("ball:6".parse(), Cutter::ball(6.0).map_err(Into::into));
        assert_eq!("flat:0.5".parse(), Cutter::flat(0.5).map_err(Into::into));
        assert_eq!("bull:10:2".parse(), Cutter::bull(10.0, 2.0).map_err(Into::into));
        let taper: Cutter = "taper:2:1:5:6".parse().unwrap();
        assert!((taper.half_angle().to_degrees() - 5.0).abs() < 1e-12 && taper.radius() == 3.0);
    }

    #[test]
    fn other_words_are_refused_with_what_is_expected() {
        assert!(refused("bal:6").contains("\"bal\" is no shape"));
        assert!(refused("").contains("no shape"));
        assert!(refused("ball").contains("takes 1 number, and 0 given"));
        assert!(refused("ball:6:3").contains("ball:DIAMETER"));
        assert!(refused("bull:10").contains("takes 2 numbers"));
        assert!(refused("ball:six").contains("\"six\" is not a number"));
        for bad in ["ball:0", "ball:-6", "ball:nan", "ball:inf", "flat:1e9", "bull:6:4", "taper:2:1:90:6"] {
            assert!(bad.parse::<Cutter>().is_err(), "{bad}");
        }
    }
}
