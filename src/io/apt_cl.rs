//! Writes a toolpath as cutter locations in APT text (ISO 3592, ISO 4343). mm, mm/min, degrees.

use super::program_text::{ProgramHeader, describe, number};
use crate::cutter::{Cutter, CutterShape};
use crate::geometry::Point3;
use crate::toolpath::{MoveKind, Toolpath};
use std::io::{self, Write};

/// Writes `PARTNO`, the cutter, `FROM` the start of the path and one `GOTO` a move, each rapid after its
/// own `RAPID` (which holds for one motion only), and `FEDRAT` wherever the feed changes. Numbers have
/// four decimals, so each coordinate stands within 0.05 µm of the path.
///
/// # Errors
/// Whatever the writer returns.
pub fn write(
    writer: &mut dyn Write,
    path: &Toolpath,
    cutter: &Cutter,
    header: &ProgramHeader,
) -> io::Result<()> {
    writeln!(writer, "PARTNO {}", header.plain_name())?;
    writeln!(writer, "PPRINT {}", describe(cutter))?;
    writeln!(writer, "UNITS/MM")?;
    writeln!(writer, "CUTTER/{}", cutter_words(cutter))?;
    if let Some(speed) = header.spindle_speed {
        writeln!(writer, "SPINDL/{},RPM,CLW", number(speed.round()))?;
    }
    writeln!(writer, "FROM/{}", location(path.start.tip))?;
    let mut feed = None;
    for step in &path.moves {
        if step.kind == MoveKind::Rapid {
            writeln!(writer, "RAPID")?;
        } else if feed != Some(number(step.feed_rate)) {
            writeln!(writer, "FEDRAT/{},MMPM", number(step.feed_rate))?;
            feed = Some(number(step.feed_rate));
        }
        writeln!(writer, "GOTO/{}", location(step.to.tip))?;
    }
    if header.spindle_speed.is_some() {
        writeln!(writer, "SPINDL/OFF")?;
    }
    writeln!(writer, "FINI")
}

fn location(tip: Point3) -> String {
    format!("{},{},{}", number(tip.x), number(tip.y), number(tip.z))
}

/// `d,r` for ball, flat and bull nose, else all seven words: d, r, e, f, α, β, h. There d is twice the
/// distance from the axis at which bottom and side, carried on, cross, (e, f) the centre of the corner's
/// circle, α the angle of the bottom, β that between side and axis, h the height of the cutter.
fn cutter_words(cutter: &Cutter) -> String {
    let w = cutter.words();
    match cutter.shape() {
        CutterShape::Ball | CutterShape::Flat | CutterShape::Bull => {
            format!("{},{}", number(w.diameter), number(w.corner_radius))
        }
        CutterShape::Taper | CutterShape::Apt => {
            let (tip, side) = (w.tip_angle.to_degrees(), w.side_angle.to_degrees());
            let words = [w.diameter, w.corner_radius, w.corner_x, w.corner_z, tip, side, w.length];
            words.map(number).join(",")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cutter::AptWords;
    use crate::io::program_text::tests::{example, random};

    fn text(path: &Toolpath, cutter: &Cutter, header: &ProgramHeader) -> String {
        let mut bytes = Vec::new();
        write(&mut bytes, path, cutter, header).unwrap();
        String::from_utf8(bytes).unwrap()
    }

    #[test]
    fn a_short_program() {
        let header = ProgramHeader { name: "wave zigzag".into(), spindle_speed: Some(12_000.0) };
        let expected = "\
PARTNO wave zigzag
PPRINT BALL END D=6.0
UNITS/MM
CUTTER/6.0,3.0
SPINDL/12000.0,RPM,CLW
FROM/0.0,0.0,10.0
RAPID
GOTO/1.0,2.5,10.0
FEDRAT/300.0,MMPM
GOTO/1.0,2.5,-0.1235
FEDRAT/1200.0,MMPM
GOTO/4.0,2.5,-0.1235
GOTO/4.0,2.5,-0.1235
GOTO/4.0,2.5,2.0
RAPID
GOTO/4.0,2.5,10.0
SPINDL/OFF
FINI
";
        assert_eq!(text(&example(), &Cutter::ball(6.0).unwrap(), &header), expected);
    }

    #[test]
    fn a_taper_has_seven_words() {
        // Tip ball of radius 1, 30 degrees: the side touches the arc at cos 30°, 1 − sin 30°, and
        // falls from there to the tip plane by tan 30° inwards.
        let cutter = Cutter::taper(2.0, 1.0, 30f64.to_radians(), 6.0).unwrap();
        let foot = 0.75f64.sqrt() - 0.5 / 3f64.sqrt();
        let height = 0.5 + (3.0 - 0.75f64.sqrt()) * 3f64.sqrt();
        let expected = format!("{},1.0,0.0,1.0,0.0,30.0,{}", number(2.0 * foot), number(height));
        assert_eq!(cutter_words(&cutter), expected);
    }

    /// What is written makes the same cutter again, within its four decimals.
    #[test]
    fn seven_words_can_be_read_back() {
        for words in AptWords::examples() {
            let cutter = Cutter::apt(&words).unwrap();
            let text = cutter_words(&cutter);
            let read: Vec<f64> = text.split(',').map(|word| word.parse().unwrap()).collect();
            let [diameter, corner_radius, corner_x, corner_z, tip, side, length] = read[..] else {
                panic!("{text}")
            };
            let (tip_angle, side_angle) = (tip.to_radians(), side.to_radians());
            let read =
                AptWords { diameter, corner_radius, corner_x, corner_z, tip_angle, side_angle, length };
            let again = Cutter::apt(&read).unwrap();
            for k in 0..100 {
                let rho = cutter.radius() * (f64::from(k) / 100.0);
                let (a, b) = (again.height(rho).unwrap(), cutter.height(rho).unwrap());
                assert!((a - b).abs() < 2e-3, "{text} at {rho}: {a} {b}");
            }
        }
    }

    #[test]
    fn reading_back_gives_the_moves() {
        let path = random(300);
        let text = text(&path, &Cutter::flat(6.0).unwrap(), &ProgramHeader::default());
        let (mut k, mut rapid, mut feed) = (0, false, f64::NAN);
        for line in text.lines() {
            let numbers = || line.split(['/', ',']).filter_map(|w| w.parse::<f64>().ok());
            if line == "RAPID" {
                rapid = true;
            } else if line.starts_with("FEDRAT/") {
                feed = numbers().next().unwrap();
            } else if line.starts_with("GOTO/") {
                let step = &path.moves[k];
                for (axis, value) in numbers().enumerate() {
                    assert!((value - step.to.tip[axis]).abs() <= 0.5001e-4, "move {k}");
                }
                assert_eq!(rapid, step.kind == MoveKind::Rapid, "move {k}");
                assert!(rapid || (feed - step.feed_rate).abs() <= 0.5001e-4, "move {k}");
                (k, rapid) = (k + 1, false);
            }
        }
        assert_eq!(k, path.len());
    }
}
