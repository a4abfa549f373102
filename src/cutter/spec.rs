//! A cutter in one word, as the command line takes it: `ball:6`, `flat:6`, `bull:10:2`, `taper:2:1:5:6`.

use super::{Cutter, CutterError};

/// The words, and what stands behind each of them.
const WORDS: [(&str, &str); 4] = [
    ("ball", "ball:DIAMETER, such as ball:6"),
    ("flat", "flat:DIAMETER, such as flat:6"),
    ("bull", "bull:DIAMETER:CORNER_RADIUS, such as bull:10:2"),
    (
        "taper",
        "taper:TIP_DIAMETER:CORNER_RADIUS:HALF_ANGLE:SHANK_DIAMETER, mm and degrees, such as taper:2:1:5:6",
    ),
];

/// Why a word names no cutter.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CutterWordError {
    /// The shape is none.
    #[error(
        "\"{0}\" is no shape of a cutter; write ball:DIAMETER, flat:DIAMETER, bull:DIAMETER:CORNER_RADIUS or taper:…"
    )]
    Shape(String),
    /// Too few or too many numbers.
    #[error("{word} takes {wanted} numbers and {given} were given; write {usage}")]
    Count {
        /// The shape.
        word: &'static str,
        /// Numbers that it takes.
        wanted: usize,
        /// Numbers that stand there.
        given: usize,
        /// How it is written.
        usage: &'static str,
    },
    /// Something between colons is no number.
    #[error("\"{text}\" is not a number; write {usage}")]
    Number {
        /// What stands there.
        text: String,
        /// How the cutter is written.
        usage: &'static str,
    },
    /// The numbers make no cutter.
    #[error(transparent)]
    Cutter(#[from] CutterError),
}

impl std::str::FromStr for Cutter {
    type Err = CutterWordError;

    /// A cutter from its word: `ball:DIAMETER`, `flat:DIAMETER`, `bull:DIAMETER:CORNER_RADIUS` or
    /// `taper:TIP_DIAMETER:CORNER_RADIUS:HALF_ANGLE:SHANK_DIAMETER`; mm, and degrees for the half angle.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let mut parts = text.trim().split(':');
        let shape = parts.next().unwrap_or_default();
        let known = WORDS.into_iter().find(|(word, _)| *word == shape);
        let (word, usage) = known.ok_or_else(|| CutterWordError::Shape(shape.to_owned()))?;
        let number = |text: &str| {
            text.trim().parse::<f64>().map_err(|_| CutterWordError::Number { text: text.to_owned(), usage })
        };
        let numbers: Vec<f64> = parts.map(number).collect::<Result<_, _>>()?;
        let count = |wanted| CutterWordError::Count { word, wanted, given: numbers.len(), usage };
        Ok(match (word, &numbers[..]) {
            ("ball", [diameter]) => Self::ball(*diameter)?,
            ("flat", [diameter]) => Self::flat(*diameter)?,
            ("bull", [diameter, corner]) => Self::bull(*diameter, *corner)?,
            ("taper", [tip, corner, angle, shank]) => Self::taper(*tip, *corner, angle.to_radians(), *shank)?,
            ("taper", _) => return Err(count(4)),
            ("bull", _) => return Err(count(2)),
            _ => return Err(count(1)),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(text: &str) -> String {
        text.parse::<Cutter>().unwrap_err().to_string()
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
        assert!(refused("ball").contains("takes 1 numbers and 0 were given"));
        assert!(refused("ball:6:3").contains("ball:DIAMETER"));
        assert!(refused("bull:10").contains("takes 2 numbers"));
        assert!(refused("ball:six").contains("\"six\" is not a number"));
        for bad in ["ball:0", "ball:-6", "ball:nan", "ball:inf", "flat:1e9", "bull:6:4", "taper:2:1:90:6"] {
            assert!(bad.parse::<Cutter>().is_err(), "{bad}");
        }
    }
}
