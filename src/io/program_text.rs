//! What the two program writers share: the header's data and the way numbers and names are written.

use cutter::{Cutter, CutterKey};
use motion::{DECIMALS, Toolpath, in_last_decimals};

/// Longest name that is written; longer ones are cut. Controls refuse lines far beyond it.
const NAME_LENGTH: usize = 60;

/// What a program says about itself besides its moves.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ProgramHeader {
    /// The program's name; characters other than ASCII letters, digits, blanks and `._+-` are
    /// written as `_`.
    pub name: String,
    /// Spindle speed, 1/min, clockwise; `None` leaves the spindle alone.
    pub spindle_speed: Option<f64>,
    /// Programs of three axes begin and end no lower than this, mm: over what stands beside the path. `None`
    /// asks for nothing more than the highest tip.
    pub rise_to: Option<f64>,
}

impl ProgramHeader {
    /// The speed of the spindle for a path; none where nothing moves.
    pub(super) fn speed_for(&self, path: &Toolpath) -> Option<f64> {
        self.spindle_speed.filter(|_| !path.is_empty())
    }

    /// The name as every control can read it.
    pub(super) fn plain_name(&self) -> String {
        let plain = |c: char| if c.is_ascii_alphanumeric() || " ._+-".contains(c) { c } else { '_' };
        self.name.chars().take(NAME_LENGTH).map(plain).collect()
    }
}

/// What a program says that has no moves: its spindle stands.
pub(super) const NO_MOVES: &str = "NO MOVES";

/// A number with four decimals, trailing zeros left out but for one: a control may read a number
/// without a decimal point as micrometres.
pub(super) fn number(value: f64) -> String {
    shortened(format!("{:.DECIMALS$}", in_last_decimals(value) / 10f64.powi(DECIMALS as i32)))
}

/// [`number`] rounded down, for feeds that reach a limit.
pub(super) fn number_below(value: f64) -> String {
    let power = 10f64.powi(DECIMALS as i32);
    number((value * power).floor().max(1.0) / power)
}

/// [`number`] with other decimals.
pub(super) fn number_to(value: f64, decimals: usize) -> String {
    let power = 10f64.powi(decimals as i32);
    // Adding zero turns a negative one round.
    shortened(format!("{:.decimals$}", (value * power).round() / power + 0.0))
}

fn shortened(mut text: String) -> String {
    while text.ends_with('0') && !text.ends_with(".0") {
        text.pop();
    }
    text
}

/// The cutter in the words of the family that it was made as.
pub(super) fn describe(cutter: &Cutter) -> String {
    let family = cutter.family();
    let dimension = |key: &CutterKey| format!("{}={}", key.label, number(key.of(cutter)));
    let dimensions: Vec<String> = family.keys.iter().map(dimension).collect();
    format!("{} {}", family.title, dimensions.join(" "))
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use geometry::Point3;
    use motion::{ClPoint, Move, MoveKind, Toolpath};

    /// Over, down, along (and once to where it is already), up, up at rapid rate.
    pub fn example() -> Toolpath {
        let at = |x, y, z| ClPoint::upright(Point3::new(x, y, z));
        let step = |to, kind, feed_rate| Move { to, kind, feed_rate, pass: 0 };
        let moves = vec![
            step(at(1.0, 2.5, 10.0), MoveKind::Rapid, 0.0),
            step(at(1.0, 2.5, -0.12345), MoveKind::Plunge, 300.0),
            step(at(4.0, 2.5, -0.12345), MoveKind::Cut, 1200.0),
            step(at(4.000001, 2.5, -0.12345), MoveKind::Cut, 1200.0),
            step(at(4.0, 2.5, 2.0), MoveKind::Retract, 1200.0),
            step(at(4.0, 2.5, 10.0), MoveKind::Rapid, 0.0),
        ];
        Toolpath::new(at(0.0, 0.0, 10.0), moves)
    }

    /// Moves of all kinds and feeds; one axis, two, three or none of them changes.
    pub fn random(moves: usize) -> Toolpath {
        let mut rng = sim::scenes::Rng::new(5);
        let mut tip = Point3::new(1.0, 2.0, 50.0);
        let start = ClPoint::upright(tip);
        let kinds = [MoveKind::Rapid, MoveKind::Plunge, MoveKind::Cut, MoveKind::Retract];
        let moves = (0..moves).map(|_| {
            for axis in 0..3 {
                if rng.below(2) == 0 {
                    tip[axis] = rng.within(-200.0, 200.0);
                }
            }
            let feed_rate = if rng.below(2) == 0 { 1200.0 } else { rng.within(1.0, 5000.0) };
            Move { to: ClPoint::upright(tip), kind: kinds[rng.below(4)], feed_rate, pass: 0 }
        });
        Toolpath::new(start, moves.collect())
    }

    #[test]
    fn numbers_are_short_and_keep_their_point() {
        let cases = [
            (0.0, "0.0"),
            (-0.00001, "0.0"),
            (10.0, "10.0"),
            (-7.65432, "-7.6543"),
            (0.5, "0.5"),
            (999999.99996, "1000000.0"),
            (100.0501, "100.0501"),
        ];
        for (value, text) in cases {
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn names_cannot_end_a_comment() {
        let header = ProgramHeader { name: "wave (2)\nM30 é".into(), spindle_speed: None, rise_to: None };
        assert_eq!(header.plain_name(), "wave _2__M30 _");
        let long = ProgramHeader { name: "x".repeat(100), spindle_speed: None, rise_to: None };
        assert_eq!(long.plain_name().len(), 60);
    }
}
