//! Whether two neighbouring blades run into each other.
//!
//! Enters: the outlines of the sections, and where the second blade stands. Leaves: a place where both are.
//! Outlines are polygons through points of the table, laid between sections as straight lines. So a passage
//! that is narrower than such a chord is off its curve may count as none.

use crate::sections::SectionSides;
use geometry::{Point2, Region, Vector2, Vector3};

/// Points of a side at which sections are compared, ends included.
const POINTS: usize = 129;

/// Where two blades are in each other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Overlap {
    /// Height in the table, mm.
    pub height: f64,
    /// x and y in the table, mm.
    pub at: Point2,
    /// How much of the level both have, mm².
    pub area: f64,
}

/// Where a blade and the same one `pitch` away, mm, have most of a level both; `None` where they stand free.
/// Looked at are the levels of the sections of both.
pub(crate) fn overlap(sides: &[SectionSides], pitch: &Vector3) -> Option<Overlap> {
    let levels = |by: f64| sides.iter().map(move |side| side.height + by);
    let found = levels(0.0).chain(levels(pitch.z).filter(|_| pitch.z != 0.0)).filter_map(|height| {
        let own = region(sides, height, Vector2::zeros())?;
        let common = own.intersection(&region(sides, height - pitch.z, pitch.xy())?);
        let area = common.area();
        let [low, high] = common.bounds()?;
        (area > 0.0).then(|| Overlap { height, at: nalgebra::center(&low, &high), area })
    });
    found.max_by(|a, b| a.area.total_cmp(&b.area))
}

/// The blade at a height, moved; `None` above and below it.
fn region(sides: &[SectionSides], height: f64, by: Vector2) -> Option<Region> {
    let above = sides.iter().position(|side| side.height >= height)?;
    let below = if sides[above].height > height { above.checked_sub(1)? } else { above };
    let [low, high] = [&sides[below], &sides[above]];
    let rise = high.height - low.height;
    let share = if rise > 0.0 { (height - low.height) / rise } else { 0.0 };
    let [from, to] = [outline(low), outline(high)];
    let curve = from.iter().zip(&to).map(|(a, b)| a + (b - a) * share + by).collect();
    Region::nested(vec![curve]).ok().map(|(region, _)| region)
}

/// Both sides as one polygon, anticlockwise or clockwise as the table has them.
fn outline(sides: &SectionSides) -> Vec<Point2> {
    let mut curve = spread(&sides.pressure);
    curve.extend(spread(&sides.suction).into_iter().rev());
    curve.dedup_by(|a, b| a == b);
    if curve.first() == curve.last() {
        curve.pop();
    }
    curve
}

/// Points at even shares of the length of a polygon's way.
fn spread(points: &[Point2]) -> Vec<Point2> {
    let mut way = vec![0.0];
    for ends in points.windows(2) {
        way.push(way[way.len() - 1] + (ends[1] - ends[0]).norm());
    }
    let whole = way[way.len() - 1];
    let at = |k: usize| {
        let wanted = whole * k as f64 / (POINTS - 1) as f64;
        let next = way.partition_point(|length| *length <= wanted).clamp(1, points.len() - 1);
        let step = way[next] - way[next - 1];
        let share = if step > 0.0 { ((wanted - way[next - 1]) / step).clamp(0.0, 1.0) } else { 0.0 };
        points[next - 1] + (points[next] - points[next - 1]) * share
    };
    if points.len() < 2 { points.to_vec() } else { (0..POINTS).map(at).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A lens of half axes 10 and 1 mm, its middle at x = `lean` · height.
    fn lens(height: f64, lean: f64) -> SectionSides {
        let side = |sign: f64| -> Vec<Point2> {
            let at = |k: u32| {
                let t = std::f64::consts::PI * f64::from(k) / 40.0;
                Point2::new(lean * height - 10.0 * t.cos(), sign * t.sin())
            };
            (0..=40).map(at).collect()
        };
        let (pressure, suction) = (side(-1.0), side(1.0));
        SectionSides { height, pressure, suction, around: Vec::new(), around_closed: false }
    }

    #[test]
    fn blades_nearer_than_they_are_thick_run_into_each_other() {
        let sides: Vec<SectionSides> = (0..4).map(|k| lens(f64::from(k) * 10.0, 0.0)).collect();
        let at = |x: f64, y: f64, z: f64| overlap(&sides, &Vector3::new(x, y, z));
        assert!(
            at(0.0, 2.01, 0.0).is_none() && at(20.01, 0.0, 0.0).is_none() && at(0.0, 0.0, 30.1).is_none()
        );
        // Two lenses of the same ellipse in the circle's measure: 2 acos(d/2) − d √(1 − d²/4), times 10.
        let found = at(0.0, 1.0, 0.0).unwrap();
        let area = 10.0 * (2.0 * 0.5f64.acos() - 0.75f64.sqrt());
        assert!((found.area - area).abs() < 0.03, "{} {area}", found.area);
        assert!(found.at.x.abs() < 1e-6 && (found.at.y - 0.5).abs() < 1e-3, "{found:?}");
        // Between levels of the sections, where the one leans over the other.
        let leaning: Vec<SectionSides> = (0..2).map(|k| lens(f64::from(k) * 30.0, 1.0)).collect();
        assert!(overlap(&leaning, &Vector3::new(0.0, 0.0, 15.0)).is_some());
        assert!(overlap(&leaning, &Vector3::new(-15.0, 0.0, 15.0)).is_none());
    }
}
