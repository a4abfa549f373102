//! Figures of a path, from its moves alone.
//!
//! Turning is measured where the tool feeds along the surface, in passes and links. A polygon whose corners
//! lie on a curve turns by no more than the curve (J. W. Milnor, "On the total curvature of knots", 1950), so
//! that chords do not add to the figure; facets of a mesh part that the chord tolerance resolves do.

use super::figures::PathFigures;
use motion::{MoveKind, Toolpath};

/// A turn sharper than this makes the machine brake, rad.
const SHARP_TURN: f64 = std::f64::consts::PI / 6.0;

/// Lengths, counts and turns of a path; `machining_time_s` comes from the machine's limits.
pub fn path_figures(path: &Toolpath, machining_time_s: f64) -> PathFigures {
    let mut figures = PathFigures {
        passes: path.passes(),
        cl_points: path.len(),
        machining_time_s,
        ..PathFigures::default()
    };
    // The last direction on the surface, and what the last move was for.
    let (mut along, mut last) = (None, None);
    let mut cut_before = false;
    for (from, to, m) in path.segments() {
        let direction = to - from;
        let length = direction.norm();
        *(match m.kind {
            MoveKind::Cut => &mut figures.cutting_length_mm,
            MoveKind::Link => &mut figures.link_length_mm,
            MoveKind::Rapid | MoveKind::Plunge | MoveKind::Retract => &mut figures.air_length_mm,
        }) += length;
        if m.kind.is_on_surface() {
            figures.retracts += usize::from(cut_before && along.is_none() && length > 0.0);
            if let (Some(before), true) = (along, length > 0.0) {
                let turn = direction.angle(&before);
                figures.total_turning_rad += turn;
                figures.sharp_turns += usize::from(turn > SHARP_TURN);
            }
            figures.surface_links += usize::from(m.kind == MoveKind::Link && last != Some((m.kind, m.pass)));
            if length > 0.0 {
                (along, cut_before) = (Some(direction), true);
            }
        } else if length > 0.0 {
            along = None;
        }
        last = Some((m.kind, m.pass));
    }
    figures
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::Point3;
    use motion::{ClPoint, Move};
    use std::f64::consts::{FRAC_PI_2, PI};

    fn to(x: f64, y: f64, z: f64, kind: MoveKind, pass: u32) -> Move {
        Move { to: ClPoint::upright(Point3::new(x, y, z)), kind, feed_rate: 1000.0, pass }
    }

    #[test]
    fn lengths_and_turns_of_a_square_pass() {
        let path = Toolpath::new(
            ClPoint::upright(Point3::new(0.0, 0.0, 5.0)),
            vec![
                to(0.0, 0.0, 0.0, MoveKind::Plunge, 0),
                to(10.0, 0.0, 0.0, MoveKind::Cut, 0),
                to(20.0, 1.0, 0.0, MoveKind::Cut, 0),
                to(20.0, 10.0, 0.0, MoveKind::Cut, 0),
                to(20.0, 10.0, 5.0, MoveKind::Retract, 0),
            ],
        );
        let figures = path_figures(&path, 7.0);
        assert!((figures.cutting_length_mm - (10.0 + 101f64.sqrt() + 9.0)).abs() < 1e-12);
        assert_eq!(figures.air_length_mm, 10.0);
        assert_eq!((figures.passes, figures.cl_points, figures.sharp_turns), (1, 5, 1));
        assert_eq!((figures.surface_links, figures.retracts), (0, 0));
        assert!((figures.total_turning_rad - FRAC_PI_2).abs() < 1e-12);
        assert_eq!(figures.machining_time_s, 7.0);
    }

    #[test]
    fn links_turn_and_retracts_do_not() {
        // Along x, a half circle of 200 chords with radius 1 to the next pass, back, up, over, along x again.
        let angle = |k: u32| f64::from(k) * PI / 200.0;
        let arc = (1..=200).map(|k| to(10.0 + angle(k).sin(), 1.0 - angle(k).cos(), 0.0, MoveKind::Link, 1));
        let mut moves = vec![to(0.0, 0.0, 0.0, MoveKind::Plunge, 0), to(10.0, 0.0, 0.0, MoveKind::Cut, 0)];
        moves.extend(arc);
        moves.extend([
            to(0.0, 2.0, 0.0, MoveKind::Cut, 1),
            to(0.0, 2.0, 5.0, MoveKind::Rapid, 2),
            to(0.0, 4.0, 5.0, MoveKind::Rapid, 2),
            to(0.0, 4.0, 0.0, MoveKind::Plunge, 2),
            to(10.0, 4.0, 0.0, MoveKind::Cut, 2),
            to(10.0, 4.0, 5.0, MoveKind::Rapid, 2),
        ]);
        let path = Toolpath::new(ClPoint::upright(Point3::new(0.0, 0.0, 5.0)), moves);
        let figures = path_figures(&path, 0.0);
        assert_eq!((figures.surface_links, figures.retracts, figures.sharp_turns), (1, 1, 0));
        assert!((figures.total_turning_rad - PI).abs() < 1e-9, "{}", figures.total_turning_rad);
        assert!((figures.link_length_mm - PI).abs() < 1e-3);
        assert_eq!((figures.cutting_length_mm, figures.air_length_mm), (30.0, 22.0));
    }
}
