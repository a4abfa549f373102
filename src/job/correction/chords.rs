//! By how much chords of passes may have raised what stands between them.
//!
//! Enters: passes as tips of the cutter, and places. Leaves: for each place the most that a chord near it stands above the
//! curve that it is a chord of, along the part's normal there. Chords over a crest cut deeper than the curve, and raise nothing.

use std::collections::HashMap;

use geometry::{Point3, Vector3};

use super::widths::HighPlace;

/// The sagitta of an arc is this share of its chord times the turn between chords of equal length.
const SAGITTA: f64 = 0.125;

/// The most, mm, that chords within `reach` mm in the plan view may raise each place; 0 where none does.
pub(super) fn most_raised(passes: &[Vec<Point3>], places: &[HighPlace], reach: f64) -> Vec<f64> {
    let cell = |p: &Point3| [p.x, p.y].map(|x| (x / reach).floor() as i64);
    let mut near: HashMap<[i64; 2], Vec<usize>> = HashMap::new();
    for (k, place) in places.iter().enumerate() {
        let [x, y] = cell(&place.tip);
        for (dx, dy) in (-1..=1).flat_map(|dx| (-1..=1).map(move |dy| (dx, dy))) {
            near.entry([x + dx, y + dy]).or_default().push(k);
        }
    }
    let mut most = vec![0.0; places.len()];
    for pass in passes {
        let chords: Vec<Vector3> = pass.windows(2).map(|ends| ends[1] - ends[0]).collect();
        let turns: Vec<Vector3> = chords.windows(2).map(|pair| unit(&pair[1]) - unit(&pair[0])).collect();
        for (k, chord) in chords.iter().enumerate() {
            // At an end of the pass there is one turn only.
            let ends = [k.checked_sub(1), Some(k)].map(|at| turns.get(at?));
            let sag = ends.into_iter().flatten().map(|turn| turn * (SAGITTA * chord.norm()));
            let count = (chord.xy().norm() / reach).ceil().max(1.0) as usize;
            for step in 0..=count {
                let at = pass[k] + chord * (step as f64 / count as f64);
                for &place in near.get(&cell(&at)).into_iter().flatten() {
                    let above = sag.clone().map(|sag| sag.dot(&places[place].normal));
                    most[place] = above.fold(most[place], f64::max);
                }
            }
        }
    }
    most
}

fn unit(v: &Vector3) -> Vector3 {
    v.try_normalize(f64::MIN_POSITIVE).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chords_in_a_valley_raise_by_their_sagitta_and_over_a_crest_not_at_all() {
        // Along a circle of 50 mm with chords of 1 mm.
        let (radius, chord) = (50.0f64, 1.0);
        let pass = |up: f64| -> Vec<Point3> {
            let at = |k: i32| (f64::from(k) * chord / radius).sin_cos();
            (-10..=10).map(at).map(|(s, c)| Point3::new(radius * s, 0.0, -up * radius * c)).collect()
        };
        let place = |x: f64, y: f64| {
            let at = Point3::new(x, y, 0.0);
            HighPlace { at, normal: Vector3::z(), tip: at, over: 0.0, factor: 1.0 }
        };
        let places = [place(0.2, 0.3), place(4.0, -0.4), place(0.0, 2.5)];
        let valley = most_raised(&[pass(1.0)], &places, 0.6);
        let sagitta = chord * chord / (8.0 * radius);
        assert!((valley[0] / sagitta - 1.0).abs() < 1e-3, "{valley:?} {sagitta}");
        // Where the normal leans off the chord's, by its cosine.
        assert!(valley[1] < sagitta && valley[1] > 0.9 * sagitta);
        assert_eq!(valley[2], 0.0);
        assert_eq!(most_raised(&[pass(-1.0)], &places, 0.6), [0.0; 3]);
        assert_eq!(most_raised(&[], &places, 0.6), [0.0; 3]);
    }
}
