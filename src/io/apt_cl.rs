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

/// `d,r`, and for a taper all seven: d, r, e, f, α, β, h. There d is twice the distance from the axis at
/// which the side, carried on, meets the plane of the tip, (e, f) the centre of the corner's circle, α the
/// angle of the bottom, β that between side and axis, h the height of the cutter.
fn cutter_words(cutter: &Cutter) -> String {
    let (e, r) = (cutter.flat_radius(), cutter.corner_radius());
    if cutter.shape() != CutterShape::Taper {
        return format!("{},{}", number(2.0 * cutter.radius()), number(r));
    }
    let side = cutter.half_angle();
    let foot = e + r * (1.0 / side.cos() - side.tan());
    let words = [2.0 * foot, r, e, r, 0.0, side.to_degrees(), cutter.side_height()];
    words.map(number).join(",")
}

#[cfg(test)]
mod tests {
    use super::*;
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
