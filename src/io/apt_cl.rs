//! Writes a toolpath as cutter locations in APT text (ISO 3592, ISO 4343). mm, mm/min, degrees.

use super::program_text::{NO_MOVES, ProgramHeader, describe, number, number_to};
use cutter::Cutter;
use motion::{ClPoint, Cutters, MoveKind, Toolpath};
use std::io::{self, Write};

/// Decimals of the tool axis. With seven the axis is off by 8.7e-8 at most (√3/2 of the last one), which
/// moves the end of a cutter of 100 mm by 0.009 µm, less than the tip is rounded by; with six it would be
/// 0.09 µm.
const AXIS_DECIMALS: usize = 7;

/// Writes `PARTNO`, the cutter (another one, with `LOADTL`, where its moves begin), `FROM` the start of the
/// path and one `GOTO` a move, each rapid after its own `RAPID` (which holds for one motion only), and
/// `FEDRAT` wherever the feed changes. What a program says of the spindle is written where it says so, instead
/// of the header's speed. Numbers have four decimals, so each coordinate stands within 0.05 µm
/// of the path. Where the tool axis is not z throughout, `MULTAX/ON` is written and every location is
/// `x,y,z,i,j,k`. Where there is no move the spindle stands, and the tool stays where it is.
///
/// # Errors
/// Whatever the writer returns.
pub fn write(
    writer: &mut dyn Write,
    path: &Toolpath,
    cutters: &Cutters,
    header: &ProgramHeader,
) -> io::Result<()> {
    writeln!(writer, "PARTNO {}", header.plain_name())?;
    writeln!(writer, "PPRINT {}", describe(cutters.first()))?;
    writeln!(writer, "UNITS/MM")?;
    let mut others = cutters.each().skip(1).peekable();
    load(writer, path.named_tool_of(0))?;
    writeln!(writer, "CUTTER/{}", cutter_words(cutters.first()))?;
    let from_header: Vec<(u32, f64)> =
        header.speed_for(path).map(|speed| (0, speed.round())).into_iter().collect();
    let said = if path.origin.spindle.is_empty() { &from_header } else { &path.origin.spindle };
    let mut spindle = said.iter().peekable();
    // A spindle that nobody turned on stands.
    let mut speed = 0.0;
    if let Some((_, begins)) = spindle.next_if(|(first, _)| *first == 0).filter(|(_, begins)| *begins != 0.0)
    {
        speed = *begins;
        writeln!(writer, "{}", spindle_words(speed))?;
    }
    let upright = path.is_upright();
    if !upright {
        writeln!(writer, "MULTAX/ON")?;
    }
    writeln!(writer, "FROM/{}", location(&path.start, upright))?;
    if path.is_empty() {
        // What has no motion at all is no program to readers.
        writeln!(writer, "PPRINT {NO_MOVES}\nRAPID\nGOTO/{}", location(&path.start, upright))?;
    }
    let mut feed = None;
    for (k, step) in path.moves.iter().enumerate() {
        while let Some((_, cutter)) = others.next_if(|(first, _)| *first as usize <= k) {
            writeln!(writer, "PPRINT {}", describe(cutter))?;
            load(writer, path.named_tool_of(k))?;
            writeln!(writer, "CUTTER/{}", cutter_words(cutter))?;
            // The change stops the spindle.
            if speed != 0.0 && spindle.peek().is_none_or(|(first, _)| *first as usize > k) {
                writeln!(writer, "{}", spindle_words(speed))?;
            }
        }
        if let Some((_, changed)) = spindle.next_if(|(first, _)| *first as usize <= k) {
            speed = *changed;
            writeln!(writer, "{}", spindle_words(speed))?;
        }
        if step.kind == MoveKind::Rapid {
            writeln!(writer, "RAPID")?;
        } else if feed != Some(number(step.feed_rate)) {
            writeln!(writer, "FEDRAT/{},MMPM", number(step.feed_rate))?;
            feed = Some(number(step.feed_rate));
        }
        writeln!(writer, "GOTO/{}", location(&step.to, upright))?;
    }
    if speed != 0.0 {
        writeln!(writer, "{}", spindle_words(0.0))?;
    }
    writeln!(writer, "FINI")
}

/// A speed, rev/min, anticlockwise below 0 and off at 0.
fn spindle_words(speed: f64) -> String {
    match speed {
        0.0 => "SPINDL/OFF".to_owned(),
        _ => format!("SPINDL/{},RPM,{}", number(speed.abs()), if speed < 0.0 { "CCLW" } else { "CLW" }),
    }
}

/// The change to a tool that has a number.
fn load(writer: &mut dyn Write, tool: Option<u32>) -> io::Result<()> {
    tool.map_or(Ok(()), |tool| writeln!(writer, "LOADTL/{tool}"))
}

/// The tip, and the tool axis as well unless all are upright.
fn location(at: &ClPoint, upright: bool) -> String {
    let tip = [at.tip.x, at.tip.y, at.tip.z].map(number);
    let axis = at.axis.iter().map(|c| number_to(*c, AXIS_DECIMALS));
    let words: Vec<String> = tip.into_iter().chain(axis.take(if upright { 0 } else { 3 })).collect();
    words.join(",")
}

/// `d,r` for ball, flat and bull nose, else all seven words: d, r, e, f, α, β, h. There d is twice the
/// distance from the axis at which bottom and side, carried on, cross, (e, f) the centre of the corner's
/// circle, α the angle of the bottom, β that between side and axis, h the height of the cutter.
fn cutter_words(cutter: &Cutter) -> String {
    let w = cutter.words();
    // A length that was stated has its place only among all seven.
    if cutter.is_end_mill() && cutter.stated_length().is_none() {
        return format!("{},{}", number(w.diameter), number(w.corner_radius));
    }
    let (tip, side) = (w.tip_angle.to_degrees(), w.side_angle.to_degrees());
    let words = [w.diameter, w.corner_radius, w.corner_x, w.corner_z, tip, side, w.length];
    words.map(number).join(",")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::program_text::tests::{example, random};
    use cutter::AptWords;
    use geometry::Vector3;

    fn text(path: &Toolpath, cutter: &Cutter, header: &ProgramHeader) -> String {
        let mut bytes = Vec::new();
        write(&mut bytes, path, &cutter.into(), header).unwrap();
        String::from_utf8(bytes).unwrap()
    }

    #[test]
    fn a_short_program() {
        let header =
            ProgramHeader { name: "wave zigzag".into(), spindle_speed: Some(12_000.0), rise_to: None };
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
    fn a_tilted_tool_has_six_words() {
        let mut path = example();
        path.moves[2].to.axis = Vector3::new(0.6, 0.0, 0.8);
        path.moves[3].to.axis = Vector3::new(-1.0, 2.0, 3.0).normalize();
        let text = text(&path, &Cutter::ball(6.0).unwrap(), &ProgramHeader::default());
        assert!(text.contains("CUTTER/6.0,3.0\nMULTAX/ON\nFROM/0.0,0.0,10.0,0.0,0.0,1.0\nRAPID\n"), "{text}");
        assert!(text.contains("\nGOTO/4.0,2.5,-0.1235,0.6,0.0,0.8\n"), "{text}");
        assert!(text.contains("\nGOTO/4.0,2.5,-0.1235,-0.2672612,0.5345225,0.8017837\n"), "{text}");
    }

    /// The upper end of a cutter of 100 mm stands within 0.1 µm of where it was planned.
    #[test]
    fn reading_back_gives_the_axes() {
        let mut path = random(300);
        let mut rng = sim::scenes::Rng::new(8);
        for step in &mut path.moves {
            step.to.axis = Vector3::from_fn(|_, _| rng.within(-1.0, 1.0)).normalize();
        }
        let text = text(&path, &Cutter::flat(6.0).unwrap(), &ProgramHeader::default());
        let gotos: Vec<&str> = text.lines().filter_map(|line| line.strip_prefix("GOTO/")).collect();
        assert_eq!(gotos.len(), path.len());
        for (line, step) in gotos.iter().zip(&path.moves) {
            let words: Vec<f64> = line.split(',').map(|word| word.parse().unwrap()).collect();
            let (tip, axis) =
                (Vector3::from_column_slice(&words[..3]), Vector3::from_column_slice(&words[3..]));
            let (end, planned) = (tip + 100.0 * axis, step.to.tip.coords + 100.0 * step.to.axis);
            assert!((100.0 * (axis - step.to.axis)).norm() < 1e-5, "{line}");
            assert!((end - planned).norm() < 1e-4, "{line}");
        }
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
    fn a_path_without_moves_turns_no_spindle() {
        let mut path = example();
        path.moves.clear();
        let header = ProgramHeader { spindle_speed: Some(12_000.0), ..ProgramHeader::default() };
        let text = text(&path, &Cutter::ball(6.0).unwrap(), &header);
        assert!(text.contains("PPRINT NO MOVES\nRAPID\nGOTO/") && !text.contains("SPINDL"), "{text}");
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
