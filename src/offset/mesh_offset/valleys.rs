//! The lines along which two places of the mesh are equally near: edges of the contour between vertices that
//! lie on both, chained.

use std::collections::BTreeMap;

use super::OffsetSettings;
use super::contour::Contour;
use super::level_set::LevelSet;
use geometry::{Point3, Vector3, angle_between, share_on};

/// Two faces meet in a valley where the angle between them is at least this share of the one between the
/// directions to the mesh.
const SHARE: f64 = 0.4;

/// A line along which two places of the mesh, or more, are equally near and as far away as the offset
/// surface.
#[derive(Debug, Clone, PartialEq)]
pub struct Valley {
    /// Places, mm, along the line; on both sides' level sets to 1e-9 mm.
    pub points: Vec<Point3>,
    /// The last place is joined to the first one.
    pub closed: bool,
    /// Least and greatest angle between the directions to the mesh's nearest places, rad.
    pub angles: [f64; 2],
}

impl Valley {
    /// Whether a place lies on the line, within `off` mm.
    fn holds(&self, place: &Point3, off: f64) -> bool {
        self.points.windows(2).any(|w| {
            let share = share_on(place, &w[0], &w[1]);
            (place - w[0] - (w[1] - w[0]) * share).norm_squared() <= off * off
        })
    }
}

/// All valleys of more than `least` rad.
pub(super) fn valleys(level: &LevelSet, contour: &Contour, settings: &OffsetSettings) -> Vec<Valley> {
    let least = settings.valley;
    let sides = valley_edges(contour, least);
    let mut at: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (k, ends) in sides.iter().enumerate() {
        ends.iter().for_each(|v| at.entry(*v).or_default().push(k));
    }
    let mut used = vec![false; sides.len()];
    let mut valleys: Vec<Valley> = Vec::new();
    // From ends and forks first; what is left are rings.
    let forks = at.iter().filter(|(_, sides)| sides.len() != 2).map(|(v, _)| *v);
    for start in forks.chain(at.keys().copied()) {
        for &first in &at[&start] {
            if used[first] {
                continue;
            }
            let mut line = vec![start];
            let mut side = first;
            loop {
                used[side] = true;
                let here = line[line.len() - 1];
                let next = if sides[side][0] == here { sides[side][1] } else { sides[side][0] };
                line.push(next);
                match at[&next].iter().find(|&&s| !used[s]) {
                    Some(&s) if at[&next].len() == 2 => side = s,
                    _ => break,
                }
            }
            let closed = line.len() > 3 && line[0] == line[line.len() - 1] && at[&start].len() == 2;
            if closed {
                line.pop();
            }
            let angles = line.iter().map(|&v| contour.angles[v as usize]);
            let angles = angles.fold([f64::INFINITY, 0.0], |[lo, hi], a: f64| [lo.min(a), hi.max(a)]);
            let mut points: Vec<Point3> = line.iter().map(|&v| contour.vertices[v as usize]).collect();
            // Contours may tell a valley in pieces; the first one was run on along all of it.
            let known = |p: &Point3| valleys.iter().any(|v| v.holds(p, LEAST_REACH * settings.cell));
            if points.iter().all(known) {
                continue;
            }
            for end in [start, line[line.len() - 1]] {
                points.reverse();
                if !closed && at[&end].len() == 1 {
                    extend(level, &mut points, settings);
                }
            }
            valleys.push(Valley { points, closed, angles });
        }
    }
    valleys
}

/// Runs a line on from its last place to where the valley ends, or leaves the outward side of the mesh and
/// its margin: beside borders the contour does not tell.
fn extend(level: &LevelSet, points: &mut Vec<Point3>, settings: &OffsetSettings) {
    let holds = |x: &Point3| level.rolled(&level.foot(x)).is_some_and(|rolled| rolled <= settings.margin);
    let next = |from: &Point3, along: &Vector3, step: f64| {
        let (x, angle) =
            level.valley_at(&(from + along * step), (0.5 * step).max(LEAST_REACH * settings.cell))?;
        ((x - from).dot(along) > 0.0 && angle >= settings.valley && holds(&x)).then_some(x)
    };
    let mut step = 0.5 * settings.cell;
    for _ in 0..MOST_STEPS {
        let [.., before, last] = points[..] else { return };
        let Some(along) = (last - before).try_normalize(1e-12) else { return };
        match next(&last, &along, step) {
            // Places close together tell the direction no better than the ones before.
            Some(x) if step < 0.01 * settings.cell => {
                let len = points.len();
                points[len - 1] = x;
            }
            Some(x) => points.push(x),
            None => step *= 0.5,
        }
        if step < LEAST_STEP * settings.cell {
            return;
        }
    }
}

/// Steps by which a valley is run on at most: contours lose it within a few cells of its end.
const MOST_STEPS: usize = 100;

/// A valley is looked for no nearer than this share of a cell: rounding would tell sides from each other.
const LEAST_REACH: f64 = 0.01;

/// Its end is found to this share of a cell.
const LEAST_STEP: f64 = 1e-3;

/// The edges between two vertices of valleys at which the triangles on both sides lean toward each other.
fn valley_edges(contour: &Contour, least: f64) -> Vec<[u32; 2]> {
    let normal = |t: &[u32; 3]| -> Vector3 {
        let [a, b, c] = t.map(|v| contour.vertices[v as usize]);
        (b - a).cross(&(c - a))
    };
    // Normals on both sides of each edge, by its lesser and its greater end.
    let mut edges: BTreeMap<[u32; 2], [Option<Vector3>; 2]> = BTreeMap::new();
    for t in &contour.triangles {
        for k in 0..3 {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            if [a, b].iter().all(|&v| contour.angles[v as usize] >= least) {
                let sides = edges.entry([a.min(b), a.max(b)]).or_default();
                sides[usize::from(a > b)] = normal(t).try_normalize(0.0);
            }
        }
    }
    let leans = |([a, b], sides): (&[u32; 2], &[Option<Vector3>; 2])| {
        let [p, q] = [*a, *b].map(|v| contour.vertices[v as usize]);
        let angle = [*a, *b].iter().map(|&v| contour.angles[v as usize]).fold(f64::INFINITY, f64::min);
        match sides {
            [Some(m), Some(n)] => {
                // The triangle of the first normal lies to the left of the way from a to b.
                let left = m.cross(&(q - p));
                let turn = angle_between(m, n);
                turn > SHARE * angle && n.dot(&left) > 0.0
            }
            // Along a border there is no telling from one triangle.
            _ => false,
        }
    };
    edges.iter().filter(|edge| leans(*edge)).map(|(ends, _)| *ends).collect()
}
