//! Figures of a path, from its moves alone.

use super::figures::PathFigures;
use crate::toolpath::{MoveKind, Toolpath};

/// A turn sharper than this inside a pass makes the machine brake, rad.
const SHARP_TURN: f64 = std::f64::consts::PI / 6.0;

/// Lengths, counts and turns of a path; `machining_time_s` comes from the machine's limits.
pub fn path_figures(path: &Toolpath, machining_time_s: f64) -> PathFigures {
    let mut figures = PathFigures {
        passes: path.passes(),
        cl_points: path.len(),
        machining_time_s,
        ..PathFigures::default()
    };
    let mut before = None;
    for (from, to, m) in path.segments() {
        let direction = to - from;
        let cutting = m.kind == MoveKind::Cut;
        *(if cutting { &mut figures.cutting_length_mm } else { &mut figures.air_length_mm }) +=
            direction.norm();
        if let (true, Some((pass, last))) = (cutting, before) {
            let turn = direction.angle(&last);
            figures.sharp_turns += usize::from(pass == m.pass && turn > SHARP_TURN);
        }
        before = cutting.then_some((m.pass, direction));
    }
    figures
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Point3;
    use crate::toolpath::{ClPoint, Move};

    #[test]
    fn lengths_and_turns_of_a_square_pass() {
        let to = |x: f64, y: f64, z: f64, kind, pass| Move {
            to: ClPoint { tip: Point3::new(x, y, z) },
            kind,
            feed_rate: 1000.0,
            pass,
        };
        let path = Toolpath {
            start: ClPoint { tip: Point3::new(0.0, 0.0, 5.0) },
            moves: vec![
                to(0.0, 0.0, 0.0, MoveKind::Plunge, 0),
                to(10.0, 0.0, 0.0, MoveKind::Cut, 0),
                to(20.0, 1.0, 0.0, MoveKind::Cut, 0),
                to(20.0, 10.0, 0.0, MoveKind::Cut, 0),
                to(20.0, 10.0, 5.0, MoveKind::Retract, 0),
            ],
        };
        let figures = path_figures(&path, 7.0);
        assert!((figures.cutting_length_mm - (10.0 + 101f64.sqrt() + 9.0)).abs() < 1e-12);
        assert_eq!(figures.air_length_mm, 10.0);
        assert_eq!((figures.passes, figures.cl_points, figures.sharp_turns), (1, 5, 1));
        assert_eq!(figures.machining_time_s, 7.0);
    }
}
