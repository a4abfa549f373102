//! The shortest way beside fixtures at one height.
//!
//! Enters: two places of an upright tool, and what it must keep away from, mm. Leaves: a way of straight
//! moves at that height, if one is shorter than a limit. A move that meets a fixture is led around the box of
//! that fixture, to its left or to its right, and what meets the next one likewise. All moves of the way are
//! proven clear.

use collision::Interference;
use geometry::Point3;
use motion::ClPoint;

/// Fixtures that a way may lead around. Each doubles the ways to look at.
const MOST_FIXTURES: usize = 4;

/// Beyond what is needed the way keeps away by this, mm: boxes are exact, and moves count as clear to 1e-5
/// mm.
const SPARE: f64 = 1e-3;

/// The places between `from` and `to`, and the length of the way, if it is shorter than `limit`.
pub fn beside(keep: &Interference<'_>, [from, to]: [ClPoint; 2], limit: f64) -> Option<(Vec<ClPoint>, f64)> {
    let (mut way, length) = around(keep, vec![from, to], limit, MOST_FIXTURES)?;
    way.pop();
    way.remove(0);
    Some((way, length))
}

fn length(way: &[ClPoint]) -> f64 {
    way.windows(2).map(|pair| (pair[1].tip - pair[0].tip).norm()).sum()
}

/// The shortest of the ways through these places and around what they meet.
fn around(
    keep: &Interference<'_>,
    way: Vec<ClPoint>,
    limit: f64,
    fixtures: usize,
) -> Option<(Vec<ClPoint>, f64)> {
    let long = length(&way);
    if long >= limit {
        return None;
    }
    let met = way.windows(2).enumerate().find_map(|(k, pair)| Some((k, keep.on_move(&pair[0], &pair[1])?)));
    let Some((k, met)) = met else { return Some((way, long)) };
    let fixtures = fixtures.checked_sub(1)?;
    let mut best: Option<(Vec<ClPoint>, f64)> = None;
    for side in [1.0, -1.0] {
        let corners = corners(keep, met.check, [&way[k], &way[k + 1]], side);
        if corners.is_empty() {
            continue;
        }
        let longer = way[..=k].iter().chain(&corners).chain(&way[k + 1..]).copied().collect();
        let limit = best.as_ref().map_or(limit, |(_, length)| *length);
        best = around(keep, longer, limit, fixtures).or(best);
    }
    best
}

/// Corners of the box of an obstacle, so far out that the tool is clear there, on one side of a move and in
/// its order.
fn corners(keep: &Interference<'_>, check: usize, [from, to]: [&ClPoint; 2], side: f64) -> Vec<ClPoint> {
    let bounds = keep.checks[check].obstacle.bounds();
    // All parts of the tool go around it.
    let far = keep.checks.iter().map(|check| check.solid.radius() + check.needed).fold(0.0, f64::max) + SPARE;
    let way = to.tip - from.tip;
    let xs = [bounds.min.x - far, bounds.max.x + far];
    let ys = [bounds.min.y - far, bounds.max.y + far];
    let all = xs.into_iter().flat_map(|x| ys.map(|y| Point3::new(x, y, from.tip.z)));
    let across = |place: &Point3| way.x * (place.y - from.tip.y) - way.y * (place.x - from.tip.x);
    let mut corners: Vec<Point3> = all.filter(|place| side * across(place) > 0.0).collect();
    corners.sort_by(|a, b| way.dot(&a.coords).total_cmp(&way.dot(&b.coords)));
    corners.into_iter().map(ClPoint::upright).collect()
}
