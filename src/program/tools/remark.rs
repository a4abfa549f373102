//! Comments in which post processors describe a tool, such as `T1 D=6. CR=0.5 - ZMIN=-3. - bull nose end mill`.

use cutter::{AptWords, Cutter};

/// Whether a comment may describe a tool.
pub(crate) fn may_describe_a_tool(text: &str) -> bool {
    let text = text.trim_start();
    let mut letters = text.bytes();
    let begins_with_t = letters.next().is_some_and(|b| b.eq_ignore_ascii_case(&b'T'))
        && letters.find(|b| *b != b' ').is_some_and(|b| b.is_ascii_digit());
    begins_with_t || number_after(text, &["D=", "DIA=", "DIAMETER="]).is_some()
}

/// The cutter that a comment describes: a diameter, a corner radius, and whether it is a ball. `unit` is that of the program,
/// mm. `None` where it tells no diameter, or describes another kind of tool.
pub fn cutter_of_remark(text: &str, unit: f64) -> Option<Cutter> {
    if let Some(words) = text.strip_prefix("CUTTER/") {
        return cutter_of_words(words);
    }
    let diameter = unit * number_after(text, &["D=", "DIA=", "DIAMETER="])?;
    let lower = text.to_ascii_lowercase();
    if ["drill", "tap", "thread", "reamer", "chamfer", "spot", "taper"]
        .iter()
        .any(|word| lower.contains(word))
    {
        return None;
    }
    let corner = number_after(text, &["CR=", "R="]).map_or(0.0, |r| unit * r);
    end_mill(diameter, if lower.contains("ball") { 0.5 * diameter } else { corner })
}

/// A ball, bull or flat end by its corner radius, mm.
fn end_mill(diameter: f64, corner: f64) -> Option<Cutter> {
    match corner {
        _ if corner > 0.0 && corner == 0.5 * diameter => Cutter::ball(diameter),
        _ if corner > 0.0 => Cutter::bull(diameter, corner),
        _ => Cutter::flat(diameter),
    }
    .ok()
}

/// The cutter of the words of CUTTER in APT: diameter, corner radius, and its centre, two angles and a length where they are
/// given. mm and degrees. `None` where they make no cutter.
fn cutter_of_words(words: &str) -> Option<Cutter> {
    /// Programs round to four decimals, mm.
    const TOUCH: f64 = 2e-4;
    let words: Vec<f64> = words.split(',').map(|word| word.parse().ok()).collect::<Option<_>>()?;
    let word = |k: usize| words.get(k).copied();
    let (diameter, corner) = (word(0)?, word(1).unwrap_or(0.0));
    let upright = [word(4), word(5)].iter().flatten().all(|angle| *angle == 0.0);
    let touches = |k: usize, place: f64| word(k).is_none_or(|given| (given - place).abs() <= TOUCH);
    if upright && touches(2, 0.5 * diameter - corner) && touches(3, corner) {
        return end_mill(diameter, corner);
    }
    let apt = AptWords {
        diameter,
        corner_radius: corner,
        corner_x: 0.0,
        corner_z: 0.0,
        tip_angle: word(4)?.to_radians(),
        side_angle: word(5)?.to_radians(),
        length: word(6)?,
    };
    Cutter::apt(&apt.with_centre(word(2), word(3))).ok()
}

/// The number of the tool at the beginning of a comment.
pub(crate) fn number_of_remark(text: &str) -> Option<u32> {
    let rest = text.trim_start().strip_prefix(['T', 't'])?.trim_start();
    let end = rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len());
    rest[..end].parse().ok()
}

/// The number after the first of some words that stands at the beginning of a word.
fn number_after(text: &str, words: &[&str]) -> Option<f64> {
    let upper = text.to_ascii_uppercase();
    words.iter().find_map(|word| {
        let starts = |at: usize| at == 0 || !upper.as_bytes()[at - 1].is_ascii_alphanumeric();
        let at = upper.match_indices(word).map(|(at, _)| at).find(|at| starts(*at))?;
        let rest = upper[at + word.len()..].trim_start();
        let length = |text: &str| text.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(text.len());
        let end = length(rest);
        // A comma with digits behind it is a decimal one, unless they are a number or a word of their own.
        let digits = rest[end..].strip_prefix(',').filter(|_| !rest[..end].contains('.')).map(|more| {
            let digits = more.split(|c: char| !c.is_ascii_digit()).next().unwrap_or_default();
            if more[digits.len()..].starts_with(|c: char| c.is_ascii_alphabetic() || c == '.') {
                ""
            } else {
                digits
            }
        });
        let number = match digits {
            Some(digits) if !digits.is_empty() => format!("{}.{digits}", &rest[..end]),
            _ => rest[..end].to_owned(),
        };
        number.parse().ok().filter(|value: &f64| *value >= 0.0)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn remarks_of_common_posts() {
        let cutter = |text: &str| cutter_of_remark(text, 1.0);
        assert_eq!(cutter("T1 D=6. CR=0. - ZMIN=-3. - flat end mill"), Cutter::flat(6.0).ok());
        assert_eq!(cutter("T2  D=10. CR=2. - bullnose end mill"), Cutter::bull(10.0, 2.0).ok());
        assert_eq!(cutter("T3 D=6 CR=3 - ball end mill"), Cutter::ball(6.0).ok());
        assert_eq!(cutter("BALL END D=6.0"), Cutter::ball(6.0).ok());
        assert_eq!(cutter("BULL NOSE D=6.0 R=0.5"), Cutter::bull(6.0, 0.5).ok());
        assert_eq!(cutter("T4 D=5 TAPER=118deg - drill"), None);
        assert_eq!(cutter("ZMIN=-3 AND=4"), None);
        assert_eq!(cutter_of_remark("T1 D=0.25", 25.4), Cutter::flat(6.35).ok());
        assert_eq!(cutter("CUTTER/6"), Cutter::flat(6.0).ok());
        assert_eq!(cutter("CUTTER/6,3"), Cutter::ball(6.0).ok());
        assert_eq!(cutter("CUTTER/10,2,3,2,0,0,50"), Cutter::bull(10.0, 2.0).ok());
        assert_eq!(cutter("CUTTER/10,0,5,0,0,0,50"), Cutter::flat(10.0).ok());
        let taper = cutter("CUTTER/6,0,3,0,0,10,30").unwrap();
        assert!((taper.words().side_angle.to_degrees() - 10.0).abs() < 1e-9);
        assert_eq!(
            (cutter("CUTTER/6,4"), cutter("CUTTER/"), cutter("CUTTER/10,2,9,9,0,0,50")),
            (None, None, None)
        );
        assert_eq!(cutter("T1 D=6,35 CR=0 - flat end mill"), Cutter::flat(6.35).ok());
        assert_eq!(cutter("T1 D=10,CR=2, bullnose"), Cutter::bull(10.0, 2.0).ok());
        assert_eq!(cutter("T1 D=6,0 CR=0,5"), Cutter::bull(6.0, 0.5).ok());
        assert_eq!(cutter("T1 D=8.5,3FL"), Cutter::flat(8.5).ok());
        assert_eq!(cutter("T1 D=8,3FL"), Cutter::flat(8.0).ok());
        assert!(may_describe_a_tool("T12 something") && !may_describe_a_tool("TOP 3 = 4"));
    }
}
