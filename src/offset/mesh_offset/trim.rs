//! What of a level set lies on the outward side of the mesh, and within a margin beyond its borders.

use std::collections::HashMap;

use super::OffsetError;
use super::contour::Contour;
use super::level_set::LevelSet;
use super::triangle::shape;
use geometry::Point3;
use work::monitor::{Monitor, check};
use work::parallel;

/// Halvings of an edge that leaves what is kept: its end is found to a 2⁻⁴⁰th of it.
const HALVINGS: usize = 40;

/// Ends nearer to the edge's kept corner than this share of it are that corner.
const AT_CORNER: f64 = 1e-3;

/// The part of a contour that is kept, with edges that leave it cut where they do.
///
/// # Errors
/// [`OffsetError::Cancelled`].
pub(super) fn trimmed(
    level: &LevelSet,
    contour: Contour,
    margin: f64,
    monitor: &dyn Monitor,
) -> Result<Contour, OffsetError> {
    let holds = |x: &Point3| level.rolled(&level.foot(x)).is_some_and(|rolled| rolled <= margin);
    monitor.start("trimming the offset surface", 1);
    let kept = parallel::map(contour.vertices.len(), |v| holds(&contour.vertices[v]));
    check(monitor)?;
    let mut leaving: Vec<[u32; 2]> = Vec::new();
    for t in &contour.triangles {
        for k in 0..3 {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            if kept[a as usize] && !kept[b as usize] {
                leaving.push([a, b]);
            }
        }
    }
    // Each edge has two triangles, one of which sees it the other way round.
    for t in &contour.triangles {
        for k in 0..3 {
            let (a, b) = (t[(k + 1) % 3], t[k]);
            if kept[a as usize] && !kept[b as usize] {
                leaving.push([a, b]);
            }
        }
    }
    leaving.sort_unstable();
    leaving.dedup();
    let ends = parallel::map(leaving.len(), |k| {
        let [a, b] = leaving[k].map(|v| contour.vertices[v as usize]);
        end_of(level, a, b, &holds)
    });
    check(monitor)?;
    let mut out =
        Kept { number: vec![u32::MAX; contour.vertices.len()], from: &contour, to: Contour::default() };
    let mut cut: HashMap<[u32; 2], u32> = HashMap::with_capacity(leaving.len());
    let mut triangles = Vec::with_capacity(contour.triangles.len());
    for t in &contour.triangles {
        // The corners of what is left of the triangle, in order.
        let mut ring: Vec<u32> = Vec::with_capacity(5);
        for k in 0..3 {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            let (in_a, in_b) = (kept[a as usize], kept[b as usize]);
            if in_a {
                ring.push(out.vertex(a));
            }
            if in_a != in_b {
                let edge = if in_a { [a, b] } else { [b, a] };
                let end = leaving.binary_search(&edge).ok().and_then(|k| ends[k]);
                ring.push(match end {
                    None => out.vertex(edge[0]),
                    Some(point) => *cut.entry(edge).or_insert_with(|| out.add(point)),
                });
            }
        }
        ring.dedup();
        if ring.len() > 1 && ring[0] == ring[ring.len() - 1] {
            ring.pop();
        }
        fan(&out.to.vertices, &ring, &mut triangles);
    }
    let mut kept = out.to;
    kept.triangles = triangles;
    Ok(compacted(kept))
}

/// Triangles over the corners of a convex ring, from the corner that makes the thinnest of them thickest.
fn fan(vertices: &[Point3], ring: &[u32], to: &mut Vec<[u32; 3]>) {
    let n = ring.len();
    let from =
        |first: usize| (2..n).map(move |k| [ring[first], ring[(first + k - 1) % n], ring[(first + k) % n]]);
    let thinnest =
        |first: &usize| from(*first).map(|t| shape(t.map(|v| vertices[v as usize]))).fold(1.0, f64::min);
    let best = (0..n).max_by(|a, b| thinnest(a).total_cmp(&thinnest(b)).then(b.cmp(a)));
    to.extend(from(best.unwrap_or(0)));
}

struct Kept<'a> {
    /// New number of each old vertex.
    number: Vec<u32>,
    from: &'a Contour,
    to: Contour,
}

impl Kept<'_> {
    fn vertex(&mut self, old: u32) -> u32 {
        let v = old as usize;
        if self.number[v] == u32::MAX {
            self.number[v] = self.to.vertices.len() as u32;
            self.to.vertices.push(self.from.vertices[v]);
            self.to.angles.push(self.from.angles[v]);
        }
        self.number[v]
    }

    /// A new vertex on an edge that is cut off; valleys run on to there by themselves.
    fn add(&mut self, point: Point3) -> u32 {
        self.to.vertices.push(point);
        self.to.angles.push(0.0);
        self.to.vertices.len() as u32 - 1
    }
}

/// The last place along the edge from `a`, which is kept, to `b`, which is not, that is kept, on the level
/// set; `None` for `a` itself.
fn end_of(level: &LevelSet, a: Point3, b: Point3, holds: &dyn Fn(&Point3) -> bool) -> Option<Point3> {
    let along = b - a;
    let reach = along.norm();
    let at = |s: f64| {
        let x = a + along * s;
        let away = level.foot(&x).direction;
        level.settled(&x, &away, reach)
    };
    let (mut inside, mut outside) = (0.0, 1.0);
    let mut best = None;
    for _ in 0..HALVINGS {
        let s = 0.5 * (inside + outside);
        match at(s).filter(|x| holds(x)) {
            Some(x) => {
                inside = s;
                best = Some(x);
            }
            None => outside = s,
        }
    }
    best.filter(|_| inside > AT_CORNER)
}

/// Sides shorter than this share of a triangle's longest one have one place for both ends; a triangle whose
/// height is a lesser share has no area.
const NO_LENGTH: f64 = 1e-6;
const NO_HEIGHT: f64 = 1e-7;

/// Without triangles that have no area and vertices that no triangle uses: where valleys meet lattice planes,
/// vertices of neighbouring cells coincide, and three may stand on one line.
fn compacted(mut contour: Contour) -> Contour {
    weld(&mut contour);
    flip(&mut contour);
    let mut number = vec![u32::MAX; contour.vertices.len()];
    let mut out = Contour::default();
    for t in contour.triangles.iter().filter(|t| height(&contour, t).is_some_and(|h| h > 0.0)) {
        let corners = t.map(|v| {
            if number[v as usize] == u32::MAX {
                number[v as usize] = out.vertices.len() as u32;
                out.vertices.push(contour.vertices[v as usize]);
                out.angles.push(contour.angles[v as usize]);
            }
            number[v as usize]
        });
        out.triangles.push(corners);
    }
    out
}

/// Height over the longest side, 0 where that is next to nothing; `None` for corners that are one vertex.
fn height(contour: &Contour, t: &[u32; 3]) -> Option<f64> {
    if t[0] == t[1] || t[1] == t[2] || t[2] == t[0] {
        return None;
    }
    let height = shape(t.map(|v| contour.vertices[v as usize]));
    Some(if height > NO_HEIGHT { height } else { 0.0 })
}

/// Makes one vertex of two at the ends of a side without length.
fn weld(contour: &mut Contour) {
    let mut same: Vec<u32> = (0..contour.vertices.len() as u32).collect();
    let root = |same: &[u32], mut v: u32| {
        while same[v as usize] != v {
            v = same[v as usize];
        }
        v
    };
    for t in &contour.triangles {
        let sides = [0, 1, 2].map(|k| {
            let ends = [t[k], t[(k + 1) % 3]];
            let [a, b] = ends.map(|v| contour.vertices[v as usize]);
            (ends, (b - a).norm())
        });
        let longest = sides.iter().map(|side| side.1).fold(0.0, f64::max);
        for (ends, _) in sides.iter().filter(|side| side.1 <= NO_LENGTH * longest) {
            let [a, b] = ends.map(|v| root(&same, v));
            // The sharper one stays.
            let sharper = contour.angles[a as usize] >= contour.angles[b as usize];
            let (kept, gone) = if sharper { (a, b) } else { (b, a) };
            same[gone as usize] = kept;
        }
    }
    contour.triangles.iter_mut().flatten().for_each(|v| *v = root(&same, *v));
    let sound = |t: &[u32; 3]| t[0] != t[1] && t[1] != t[2] && t[2] != t[0];
    contour.triangles.retain(sound);
}

/// Gives triangles without height the corner beyond their longest side, whose triangle is divided.
fn flip(contour: &mut Contour) {
    let thin: Vec<usize> = (0..contour.triangles.len())
        .filter(|&t| height(contour, &contour.triangles[t]) == Some(0.0))
        .collect();
    if thin.is_empty() {
        return;
    }
    let mut of_side: HashMap<[u32; 2], usize> = HashMap::with_capacity(3 * contour.triangles.len());
    for (t, corners) in contour.triangles.iter().enumerate() {
        for k in 0..3 {
            of_side.insert([corners[k], corners[(k + 1) % 3]], t);
        }
    }
    for t in thin {
        let corners = contour.triangles[t];
        let length = |k: &usize| {
            let [a, b] = [corners[*k], corners[(*k + 1) % 3]].map(|v| contour.vertices[v as usize]);
            (b - a).norm_squared()
        };
        let Some(k) = (0..3).max_by(|a, b| length(a).total_cmp(&length(b))) else { continue };
        let [c, a, b] = [corners[k], corners[(k + 1) % 3], corners[(k + 2) % 3]];
        let Some(&beyond) = of_side.get(&[a, c]).filter(|&&n| n != t) else { continue };
        let Some(&d) = contour.triangles[beyond].iter().find(|&&v| v != a && v != c) else { continue };
        if d == b || of_side.contains_key(&[b, d]) || of_side.contains_key(&[d, b]) {
            continue;
        }
        for (n, new) in [(t, [a, b, d]), (beyond, [b, c, d])] {
            contour.triangles[n] = new;
            for k in 0..3 {
                of_side.insert([new[k], new[(k + 1) % 3]], n);
            }
        }
        of_side.remove(&[c, a]);
        of_side.remove(&[a, c]);
    }
}
