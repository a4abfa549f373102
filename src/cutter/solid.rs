//! The cutter and what holds it as a solid of revolution: how far a place is from it, and in which
//! direction. mm.
//!
//! Enters: a cutter, a holder, or both. Leaves: the signed distance (Euclidean, below zero inside), its
//! unit gradient and the nearest point of the surface, in the half plane of ρ (distance from the axis)
//! and z (height above the tip) or in space for a tool that stands somewhere.
//!
//! The nearest point of a solid of revolution lies in the half plane of the place itself, so that all is
//! asked of its outline: lines and an arc from the tip outward, up, and back to the axis. The side of a
//! place is that of the mean normal at its nearest point, also where that is a corner.

use super::body::Cutter;
use super::holder::{Holder, HolderSection};
use super::profile::Profile;
use geometry::{Point3, Vector3};

/// A cutter without a holder is this many diameters long above its cutting profile. More makes tools
/// hit what no tool would reach; less lets walls stand in the air above the tool.
const DIAMETERS_ABOVE: f64 = 5.0;

/// Edges shorter than this, mm, are left out: their direction is rounding.
const SHORTEST: f64 = 1e-12;

/// Place or direction in the half plane: ρ and z.
type RhoZ = [f64; 2];

fn dot(a: RhoZ, b: RhoZ) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

fn cross(a: RhoZ, b: RhoZ) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

fn less(a: RhoZ, b: RhoZ) -> RhoZ {
    [a[0] - b[0], a[1] - b[1]]
}

fn unit(a: RhoZ) -> RhoZ {
    let size = a[0].hypot(a[1]);
    [a[0] / size, a[1] / size]
}

/// A line or an arc of an outline, with the inside on its left.
#[derive(Debug, Clone, Copy, PartialEq)]
struct OutlineEdge {
    from: RhoZ,
    to: RhoZ,
    /// From its begin to its end, of unit length.
    along: RhoZ,
    length: f64,
    /// Outward normals where it begins and ends; a line has two equal ones.
    normals: [RhoZ; 2],
    /// Sums of the normals of the edges that meet where it begins and ends.
    corners: [RhoZ; 2],
    /// Centre and radius of an arc that bulges outward by less than half a circle; radius 0: a line.
    centre: RhoZ,
    radius: f64,
}

/// Signed distance in the half plane, and its unit gradient along ρ and z.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OutlineFoot {
    /// Distance, mm; negative inside.
    pub distance: f64,
    /// Unit gradient, along ρ and along z. The nearest point lies `distance` against it.
    pub gradient: [f64; 2],
}

/// Signed distance in space, its gradient, and the nearest point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SolidFoot {
    /// Distance, mm; negative inside.
    pub distance: f64,
    /// Unit gradient: outward normal of the solid at the nearest point.
    pub gradient: Vector3,
    /// The nearest point of the surface.
    pub point: Point3,
}

impl OutlineEdge {
    fn line(from: RhoZ, to: RhoZ) -> Self {
        let along = less(to, from);
        let length = along[0].hypot(along[1]);
        let along = [along[0] / length, along[1] / length];
        let normals = [[along[1], -along[0]]; 2];
        Self { from, to, along, length, normals, corners: normals, centre: from, radius: 0.0 }
    }

    fn arc(from: RhoZ, to: RhoZ, centre: RhoZ, radius: f64) -> Self {
        let normals = [unit(less(from, centre)), unit(less(to, centre))];
        Self { normals, corners: normals, centre, radius, ..Self::line(from, to) }
    }

    /// Distance to the nearest point of this edge, with its sign if that point is none of the ends, and
    /// which end it is otherwise.
    #[inline(always)]
    fn nearest(&self, p: RhoZ) -> (f64, Option<usize>) {
        let a = less(p, self.from);
        if self.radius > 0.0 {
            let d = less(p, self.centre);
            if cross(self.normals[0], d) >= 0.0 && cross(d, self.normals[1]) >= 0.0 {
                return (dot(d, d).sqrt() - self.radius, None);
            }
            let b = less(p, self.to);
            let (near, far) = (dot(a, a), dot(b, b));
            return if near <= far { (near.sqrt(), Some(0)) } else { (far.sqrt(), Some(1)) };
        }
        let s = dot(a, self.along);
        if s <= 0.0 {
            return (dot(a, a).sqrt(), Some(0));
        }
        if s >= self.length {
            let b = less(p, self.to);
            return (dot(b, b).sqrt(), Some(1));
        }
        (dot(a, self.normals[0]), None)
    }

    fn foot(&self, p: RhoZ, distance: f64, end: Option<usize>) -> OutlineFoot {
        let Some(end) = end else {
            if self.radius == 0.0 {
                return OutlineFoot { distance, gradient: self.normals[0] };
            }
            let d = less(p, self.centre);
            let size = distance + self.radius;
            // At the centre itself every direction is as good.
            let gradient = if size > 0.0 { [d[0] / size, d[1] / size] } else { self.normals[0] };
            return OutlineFoot { distance, gradient };
        };
        let corner = self.corners[end];
        if distance == 0.0 {
            return OutlineFoot { distance, gradient: unit(corner) };
        }
        let d = less(p, if end == 0 { self.from } else { self.to });
        let distance = if dot(d, corner) < 0.0 { -distance } else { distance };
        OutlineFoot { distance, gradient: [d[0] / distance, d[1] / distance] }
    }
}

/// A closed outline from the axis back to the axis.
#[derive(Debug, Clone, PartialEq)]
struct Outline {
    edges: Vec<OutlineEdge>,
}

impl Outline {
    /// Leaves out edges without length, and tells the others which normals meet at their ends. At the
    /// axis an edge meets its own mirror image.
    fn new(edges: impl IntoIterator<Item = OutlineEdge>) -> Self {
        let mut edges: Vec<OutlineEdge> = edges.into_iter().filter(|e| e.length > SHORTEST).collect();
        let count = edges.len();
        for k in 0..count {
            let [begin, end] = edges[k].normals;
            let before = if k == 0 { [-begin[0], begin[1]] } else { edges[k - 1].normals[1] };
            let after = if k + 1 == count { [-end[0], end[1]] } else { edges[k + 1].normals[0] };
            edges[k].corners =
                [[begin[0] + before[0], begin[1] + before[1]], [end[0] + after[0], end[1] + after[1]]];
        }
        Self { edges }
    }

    #[inline]
    fn foot(&self, rho: f64, z: f64) -> OutlineFoot {
        let p = [rho, z];
        let (mut best, mut by) = ((f64::INFINITY, None), 0);
        for (k, edge) in self.edges.iter().enumerate() {
            let near = edge.nearest(p);
            if near.0.abs() < best.0.abs() {
                (best, by) = (near, k);
            }
        }
        self.edges[by].foot(p, best.0, best.1)
    }

    /// How far it reaches in a direction.
    fn support(&self, u: RhoZ) -> f64 {
        let reach = |edge: &OutlineEdge| {
            let bulges =
                edge.radius > 0.0 && cross(edge.normals[0], u) >= 0.0 && cross(u, edge.normals[1]) >= 0.0;
            if bulges {
                dot(edge.centre, u) + edge.radius * u[0].hypot(u[1])
            } else {
                dot(edge.from, u).max(dot(edge.to, u))
            }
        };
        self.edges.iter().map(reach).fold(f64::NEG_INFINITY, f64::max)
    }
}

/// A cutter, a holder, or both: convex pieces stacked along the axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Solid {
    /// Of the whole.
    outline: Outline,
    /// Of each piece, where there are several.
    pieces: Vec<Outline>,
    ball: Option<f64>,
    pivot: f64,
    bottom: f64,
    length: f64,
    radius: f64,
}

/// The cutter's edges from the tip to the given height.
fn cutter_edges(profile: &Profile, length: f64) -> Vec<OutlineEdge> {
    let tip = [0.0, profile.tip];
    let centre = [profile.centre_x, profile.centre_z];
    let at = |rho: f64| [rho, profile.height(rho)];
    let (inner, outer, rim) = (at(profile.bottom_end), at(profile.arc_end), at(profile.radius));
    let rounded = profile.corner > 0.0 && less(outer, inner) != [0.0; 2];
    let mut edges = Vec::with_capacity(5);
    let mut last = tip;
    for (to, arc) in [(inner, false), (outer, rounded), (rim, false), ([rim[0], f64::INFINITY], false)] {
        // The profile never falls, so that the first edge that passes the length is the last.
        let cut = to[1] > length;
        let to = if !cut {
            to
        } else if arc {
            let up = length - centre[1];
            [centre[0] + ((profile.corner - up) * (profile.corner + up)).max(0.0).sqrt(), length]
        } else if to[1] == f64::INFINITY {
            [last[0], length]
        } else {
            [last[0] + (to[0] - last[0]) * (length - last[1]) / (to[1] - last[1]), length]
        };
        if less(to, last) != [0.0; 2] {
            edges.push(if arc {
                OutlineEdge::arc(last, to, centre, profile.corner)
            } else {
                OutlineEdge::line(last, to)
            });
        }
        last = to;
        if cut {
            break;
        }
    }
    edges
}

/// Lines through the given places.
fn lines(places: &[RhoZ]) -> impl Iterator<Item = OutlineEdge> + '_ {
    places.windows(2).filter(|w| w[0] != w[1]).map(|w| OutlineEdge::line(w[0], w[1]))
}

impl Solid {
    /// The cutter alone: its profile and the cylinder above, up to the holder's cutting length (APMX);
    /// without a holder five diameters above the cutting profile.
    pub fn of_cutter(cutter: &Cutter, holder: Option<&Holder>) -> Self {
        let free = cutter.side_height() + DIAMETERS_ABOVE * 2.0 * cutter.radius();
        Self::stacked(Some(cutter), holder.map_or(free, Holder::cutting_length), &[])
    }

    /// What of the cutter leads when it goes back along its axis: its profile, and of the cylinder above no more
    /// than a flat end takes to be as high as it is wide.
    pub fn of_end(cutter: &Cutter) -> Self {
        Self::stacked(Some(cutter), cutter.side_height().max(cutter.radius()), &[])
    }

    /// Shank and holder alone, without the cutter.
    pub fn of_holder(holder: &Holder) -> Self {
        Self::stacked(None, holder.cutting_length(), &slants(holder))
    }

    /// The sections of shank and holder, each by itself and convex, the lowest first.
    pub fn of_sections(holder: &Holder) -> Vec<Self> {
        slants(holder).into_iter().map(|slant| Self::stacked(None, slant[0][1], &[slant])).collect()
    }

    /// A cylinder from the tip up.
    pub fn cylinder(radius: f64, length: f64) -> Self {
        Self::stacked(None, 0.0, &[[[radius, 0.0], [radius, length]]])
    }

    /// Cutter, shank and holder in one.
    pub fn of_tool(cutter: &Cutter, holder: &Holder) -> Self {
        Self::stacked(Some(cutter), holder.cutting_length(), &slants(holder))
    }

    fn stacked(cutter: Option<&Cutter>, cutting_length: f64, sections: &[[RhoZ; 2]]) -> Self {
        let mut whole = cutter.map_or(vec![], |c| cutter_edges(c.profile(), cutting_length));
        let mut pieces = Vec::new();
        let mut last = whole.last().map_or([0.0, cutting_length], |edge| edge.to);
        if cutter.is_some() {
            let top = lines(&[last, [0.0, last[1]]]).collect::<Vec<_>>();
            pieces.push(Outline::new(whole.iter().copied().chain(top)));
        }
        for &[low, top] in sections {
            whole.extend(lines(&[last, low, top]));
            pieces.push(Outline::new(lines(&[[0.0, low[1]], low, top, [0.0, top[1]]])));
            last = top;
        }
        whole.extend(lines(&[last, [0.0, last[1]]]));
        if pieces.len() == 1 {
            pieces.clear();
        }
        let outline = Outline::new(whole);
        let radius = outline.edges.iter().map(|e| e.to[0]).fold(0.0, f64::max);
        let profile = cutter.map(Cutter::profile);
        let ball = profile
            .filter(|p| p.is_ball() && p.corner <= 0.5 * cutting_length && sections.is_empty())
            .map(|p| p.corner);
        let pivot = match cutter {
            Some(c) => c.profile().centre_z.min(c.side_height()).min(cutting_length),
            None => cutting_length,
        };
        let bottom = outline.edges.first().map_or(0.0, |e| e.from[1]);
        Self { outline, pieces, ball, pivot, bottom, length: last[1], radius }
    }

    /// True when it is one convex piece. Its signed distance is then a convex function of the place.
    pub fn is_convex(&self) -> bool {
        self.pieces.is_empty()
    }

    /// Number of convex pieces.
    pub fn pieces(&self) -> usize {
        self.pieces.len().max(1)
    }

    /// Radius of the ball around `(0, radius)` to which all places below that height are nearest: that of a
    /// ball end at least two radii long, without a holder.
    pub fn ball(&self) -> Option<f64> {
        self.ball
    }

    /// Height above the tip of the point that a turning axis moves least against the cutting edges: that
    /// of the corner's centre. A holder alone has its lower end there.
    pub fn pivot(&self) -> f64 {
        self.pivot
    }

    /// Heights above the tip at which it begins and ends, mm.
    pub fn heights(&self) -> [f64; 2] {
        [self.bottom, self.length]
    }

    /// Largest distance from the axis, mm.
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// No place of it lies farther from the tip, mm.
    pub fn reach(&self) -> f64 {
        self.length.hypot(self.radius)
    }

    /// The least radius with which it is bent outward below its top, mm; 0 with a sharp edge or a point.
    pub fn sharpest(&self) -> f64 {
        let edges = &self.outline.edges;
        let apart = |a: RhoZ, b: RhoZ| cross(a, b).abs() > 1e-9 || dot(a, b) < 0.0;
        let point = edges.first().is_some_and(|edge| apart(edge.normals[0], [0.0, -1.0]));
        // The last edge is the top.
        let below = &edges[..edges.len().saturating_sub(1)];
        let sharp = below.windows(2).any(|w| apart(w[0].normals[1], w[1].normals[0]));
        if point || sharp {
            return 0.0;
        }
        // A side that leans is bent by no less than its distance from the axis.
        let radius = |edge: &OutlineEdge| match edge.radius {
            r if r > 0.0 => r,
            _ if edge.normals[0][0] > 0.0 => edge.from[0],
            _ => f64::INFINITY,
        };
        below.iter().map(radius).fold(f64::INFINITY, f64::min)
    }

    /// Signed distance at distance `rho >= 0` from the axis and height `z` above the tip, with its
    /// gradient. Exact, inside too. On the axis the gradient is one of two mirror images; in the middle
    /// between two places of the surface it is that of either.
    #[inline]
    pub fn outline_foot(&self, rho: f64, z: f64) -> OutlineFoot {
        self.outline.foot(rho, z)
    }

    /// As [`Solid::outline_foot`], for one of its convex pieces, counted from the tip.
    #[inline]
    pub fn piece_foot(&self, piece: usize, rho: f64, z: f64) -> OutlineFoot {
        self.pieces.get(piece).unwrap_or(&self.outline).foot(rho, z)
    }

    /// How far one of its convex pieces reaches from the tip along a unit vector with the parts `across >= 0`
    /// square to the axis and `along` it, mm: its support function.
    #[inline]
    pub fn piece_support(&self, piece: usize, across: f64, along: f64) -> f64 {
        self.pieces.get(piece).unwrap_or(&self.outline).support([across, along])
    }

    /// Signed distance, mm, of `q` from the solid with its tip at `tip` and its unit axis, from the tip to
    /// the holder, along `axis`.
    pub fn distance(&self, tip: &Point3, axis: &Vector3, q: &Point3) -> f64 {
        let (rho, z, _) = cylindrical(tip, axis, q);
        self.outline_foot(rho, z).distance
    }

    /// As [`Solid::distance`], with gradient and nearest point.
    pub fn foot(&self, tip: &Point3, axis: &Vector3, q: &Point3) -> SolidFoot {
        let (rho, z, outward) = cylindrical(tip, axis, q);
        let foot = self.outline_foot(rho, z);
        // On the axis any direction is as good as the others.
        let outward = outward.try_normalize(0.0).unwrap_or_else(|| {
            let away = if axis.x.abs() < 0.6 { Vector3::x() } else { Vector3::y() };
            axis.cross(&away).normalize()
        });
        let gradient = outward * foot.gradient[0] + axis * foot.gradient[1];
        SolidFoot { distance: foot.distance, gradient, point: q - gradient * foot.distance }
    }
}

/// Begin and end of the side of each section.
fn slants(holder: &Holder) -> Vec<[RhoZ; 2]> {
    let mut at = holder.cutting_length();
    let slant = |s: &HolderSection| {
        let low = [0.5 * s.diameter, at];
        at += s.length;
        [low, [0.5 * s.top_diameter, at]]
    };
    holder.sections().iter().map(slant).collect()
}

/// Distance from the axis, height above the tip, and the way from the axis to `q`.
fn cylindrical(tip: &Point3, axis: &Vector3, q: &Point3) -> (f64, f64, Vector3) {
    let from_tip = q - tip;
    let z = from_tip.dot(axis);
    let outward = from_tip - axis * z;
    (outward.norm(), z, outward)
}

#[cfg(test)]
mod tests;
