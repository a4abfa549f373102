//! Passes of a pocket as a tree of nested closed curves, from the wall inwards.
//!
//! Enters: the piece where the cutter's centre may be, the stepover. Leaves: [`Nest`]: the curves of one
//! level, and within them the nests of the next. Cut from the innermost to the wall, each pass has the
//! stepover to cut at most: every place of a curve is within it of the next curve inwards.

use super::strategy::Flow;
use super::turning::{Turning, curvatures};
use field::{PlanarError, PlanarMesh};
use geometry::{CurveSegment, Piece, Point2, Region, SegmentGrid};
use std::sync::Arc;
use work::aside;
use work::monitor::{self, Cancelled, Monitor};

/// Side of the triangles over the stepover. Finer ones place levels better and cost time as their square.
const EDGE_OVER_STEP: f64 = 0.35;

/// The smoothing length is at least this many sides of triangles: u falls by e over it, and a straight line
/// follows that no farther. With less, level curves along ridges of ψ are ragged.
const EDGES_A_SIGMA: f64 = 2.0;

/// Halvings of the interval in which the next level is sought: to a millionth of the range of ψ.
const HALVINGS: u32 = 20;

/// Levels rise by this share of what is left at least, wherever the next should be.
const LEAST_RISE: f64 = 1.0e-3;

/// Deepest nest: depth is bounded so that the stack is.
const MAX_DEPTH: usize = 2000;

/// Walls of a mesh are thinned to this share of the stepover: round corners have chords so short that
/// triangles beside them would be.
const WALL_SHARE: f64 = 0.004;

/// Curves shorter than this many stepovers are points: what they go around is cut from outside. Less
/// makes passes of ripples along ridges of ψ.
const POINT_SHARE: f64 = 1.5;

/// How far apart curves of a flow may lie.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spacing {
    /// The stepover, mm: from most of each curve the next one inwards is within it.
    pub step: f64,
    /// In corners, and at the ends of long nests, it may be this far, mm. Where it would be farther,
    /// stretches of curves between are inserted.
    pub farthest: f64,
    /// What bounds the engagement, if anything does: passes that turn toward the stock cut less.
    pub turning: Option<Turning>,
}

impl Spacing {
    /// By the engagement everywhere: more passes, and none has more to cut but in corners.
    pub fn bounded(step: f64, reach: f64, turning: Turning) -> Self {
        Self { turning: Some(turning), ..Self::lenient(step, reach) }
    }

    /// The stepover everywhere.
    #[cfg(test)]
    pub fn strict(step: f64) -> Self {
        Self { step, farthest: step, turning: None }
    }

    /// Up to twice the stepover, as long as discs of the radius `reach` along both curves leave nothing
    /// between.
    pub fn lenient(step: f64, reach: f64) -> Self {
        Self { step, farthest: (2.0 * step).min(2.0 * REACH_SHARE * reach).max(step), turning: None }
    }
}

/// Share of offsets whose turns are left to loops, and the least distance of offsets over the stepover.
const SHARP_SHARE: f64 = 0.5;
const LEAST_STEP: f64 = 0.4;

/// Inner offsets turn with this radius over the cutter's at least where the engagement is bounded.
const ROUND_CORNERS: f64 = 0.5;

impl Spacing {
    /// How far the next offset may be from curves: the stepover of all but their sharpest turns, mm.
    fn next(&self, curves: &[Piece]) -> f64 {
        if self.turning.is_none() {
            return self.step;
        }
        let mut steps: Vec<f64> = curves.iter().flat_map(|piece| self.steps(piece)).collect();
        steps.sort_by(f64::total_cmp);
        let most = (SHARP_SHARE * steps.len() as f64) as usize;
        steps.get(most).map_or(self.step, |s| s.max(LEAST_STEP * self.step))
    }

    /// What each place of the subdivided curves may have to the next one inwards, mm.
    fn steps(&self, curves: &Piece) -> Vec<f64> {
        let spacing = SUBDIVISION * self.step;
        let Some(turning) = self.turning else { return vec![self.step; subdivided(curves, spacing).len()] };
        let of_curve = |curve: &[Point2]| {
            let single = Piece { outer: curve.to_vec(), islands: Vec::new() };
            let points = subdivided(&single, spacing);
            let steps =
                curvatures(&points, 0.5 * turning.radius).into_iter().map(|k| turning.step(k).min(self.step));
            steps.collect::<Vec<f64>>()
        };
        curves.curves().flat_map(of_curve).collect()
    }
}

/// Of two discs that should meet, how much nearer their centres stand than they could.
const REACH_SHARE: f64 = 0.9;

/// Share of a curve from which the next one may be farther than the stepover. More makes fewer closed
/// curves and more inserted stretches, each of which costs a link.
const FAR_SHARE: f64 = 0.2;

/// The same where the engagement is bounded: each such place costs loops.
const FAR_SHARE_BOUNDED: f64 = 0.1;

/// No place of a curve is farther from the next than this many stepovers, whatever is inserted: side arms
/// of a pocket have closed curves of their own.
const FARTHEST_STEPS: f64 = 4.0;

/// Inserted stretches end where the next curve inwards is this share of the stepover away.
const MERGE_SHARE: f64 = 0.3;

/// Curves are looked at in places this share of the stepover apart.
const SUBDIVISION: f64 = 0.3;

/// Most stretches one inside the other between two closed curves.
const MOST_INSERTED: usize = 64;

/// Closed curves of one level and what lies within.
#[derive(Debug, Clone, PartialEq)]
pub struct Nest {
    /// The outline (counter-clockwise) and the curves around islands (clockwise): with the higher ψ, and
    /// the stock that is cut first, on the left, so that a right-handed cutter climbs.
    pub curves: Piece,
    /// The nests of the next level inwards.
    pub inner: Vec<Nest>,
    /// Open stretches of levels between, where those are too far away; in the order of cutting.
    pub between: Vec<Vec<Point2>>,
    /// The place farthest from the curves, where there is no inner nest.
    pub seed: Point2,
}

impl Nest {
    /// Length of all curves, mm.
    pub fn length(&self) -> f64 {
        let own: f64 = self.curves.curves().map(closed_length).sum();
        let open: f64 = self.between.iter().flat_map(|c| c.windows(2)).map(|w| (w[1] - w[0]).norm()).sum();
        own + open + self.inner.iter().map(Self::length).sum::<f64>()
    }
}

/// Why there are no nests.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum NestError {
    /// Stopped by the user.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// No flow on the piece.
    #[error(transparent)]
    Flow(#[from] PlanarError),
    /// Passes without end.
    #[error("more than {MAX_DEPTH} passes would lie within each other; use a greater stepover")]
    TooDeep,
}

/// Length of a closed curve, mm.
pub fn closed_length(curve: &[Point2]) -> f64 {
    (0..curve.len()).map(|k| (curve[(k + 1) % curve.len()] - curve[k]).norm()).sum()
}

/// Offsets of the walls, the stepover apart. Where the engagement is bounded, inner ones have round corners and turning ones lie closer.
pub fn offsets(piece: &Piece, spacing: &Spacing, monitor: &dyn Monitor) -> Result<Nest, NestError> {
    let step = spacing.step;
    let mut levels = vec![vec![piece.clone()]];
    let whole = Region { pieces: vec![piece.clone()] };
    let mut distance = 0.0;
    loop {
        monitor::check(monitor)?;
        distance += levels.last().map_or(step, |level| spacing.next(level));
        let round = spacing.turning.map_or(0.0, |t| ROUND_CORNERS * t.radius);
        let inner = whole.watched_inset(distance + round, monitor)?.watched_grown(round, monitor)?.pieces;
        let inner = if inner.is_empty() { whole.watched_inset(distance, monitor)?.pieces } else { inner };
        if inner.is_empty() {
            break;
        }
        if levels.len() == MAX_DEPTH {
            return Err(NestError::TooDeep);
        }
        levels.push(inner);
    }
    let mut inner: Vec<Nest> = Vec::new();
    while let Some(level) = levels.pop() {
        let mut outer: Vec<Nest> = level
            .into_iter()
            .map(|curves| Nest { curves, inner: Vec::new(), between: Vec::new(), seed: Point2::origin() })
            .collect();
        for nest in inner {
            let at = nest.curves.outer[0];
            // Curves do not cross: any point tells. Rounding could only matter for curves that touch.
            let k = outer.iter().position(|o| o.curves.contains(&at)).unwrap_or(0);
            outer[k].inner.push(nest);
        }
        for nest in outer.iter_mut().filter(|nest| nest.inner.is_empty()) {
            let region = Region { pieces: vec![nest.curves.clone()] };
            let (seed, _) = region.largest_disc(0.02 * step, monitor)?.unwrap_or((nest.curves.outer[0], 0.0));
            nest.seed = seed;
        }
        inner = outer;
    }
    Ok(inner.into_iter().next().unwrap_or(Nest {
        curves: piece.clone(),
        inner: vec![],
        between: vec![],
        seed: piece.outer[0],
    }))
}

/// Triangles of sides of some `edge` mm that fill a piece, its walls thinned for a stepover, mm.
///
/// # Errors
/// [`NestError`].
pub fn planar_mesh(
    piece: &Piece,
    step: f64,
    edge: f64,
    monitor: &dyn Monitor,
) -> Result<PlanarMesh, NestError> {
    let thin = |c: &[Point2]| thinned(c, WALL_SHARE * step);
    let curves: Vec<Vec<Point2>> = piece.curves().map(thin).collect();
    let plain = Piece { outer: curves[0].clone(), islands: curves[1..].to_vec() };
    // Thinning may make walls touch that nearly do; the exact ones do not.
    let exact = piece.clone();
    let mesh = aside::run(monitor, move || {
        let filled = if Region::nested(curves).is_ok() { plain } else { exact };
        PlanarMesh::new(&filled, edge)
    })??;
    Ok(mesh)
}

/// A flow on a piece and its mesh.
pub struct FlowField {
    mesh: Arc<PlanarMesh>,
    deepest: f64,
}

impl FlowField {
    /// The mesh for a stepover, mm.
    ///
    /// # Errors
    /// [`NestError`].
    pub fn new(piece: &Piece, step: f64, monitor: &dyn Monitor) -> Result<Self, NestError> {
        let mesh = planar_mesh(piece, step, EDGE_OVER_STEP * step, monitor)?;
        let region = Region { pieces: vec![piece.clone()] };
        let deepest = region.largest_disc(0.05 * step, monitor)?.map_or(0.0, |d| d.1);
        Ok(Self { mesh: Arc::new(mesh), deepest })
    }

    /// Radius of the largest disc in the piece, mm.
    pub fn deepest(&self) -> f64 {
        self.deepest
    }

    /// Level curves of the flow of smoothing length `sigma`, mm.
    ///
    /// # Errors
    /// [`NestError`].
    pub fn nest(
        &self,
        piece: &Piece,
        sigma: f64,
        spacing: Spacing,
        reach: f64,
        monitor: &dyn Monitor,
    ) -> Result<Nest, NestError> {
        let (mesh, deepest) = (Arc::clone(&self.mesh), self.deepest);
        let sigma = sigma.max(EDGES_A_SIGMA * EDGE_OVER_STEP * spacing.step);
        let psi = aside::run(monitor, move || mesh.flow(sigma, deepest))??;
        let all = (0..self.mesh.triangles().len() as u32).collect();
        let nesting = Nesting { mesh: &self.mesh, psi: &psi, spacing, reach, monitor };
        nesting.within(piece.clone(), 0.0, all, 0)
    }
}

struct Nesting<'a> {
    mesh: &'a PlanarMesh,
    psi: &'a [f64],
    spacing: Spacing,
    reach: f64,
    monitor: &'a dyn Monitor,
}

impl Nesting<'_> {
    /// The nest of `curves`, which are at `level`; `triangles` are those that reach above it inside.
    fn within(
        &self,
        curves: Piece,
        level: f64,
        triangles: Vec<u32>,
        depth: usize,
    ) -> Result<Nest, NestError> {
        monitor::check(self.monitor)?;
        if depth == MAX_DEPTH {
            return Err(NestError::TooDeep);
        }
        let walls = SegmentGrid::of_curves(curves.curves());
        let mut corners: Vec<u32> =
            triangles.iter().flat_map(|t| self.mesh.triangles()[*t as usize]).collect();
        corners.sort_unstable();
        corners.dedup();
        let (mut seed, mut farthest, mut top) = (curves.outer[0], -1.0, level);
        for v in corners.into_iter().map(|v| v as usize).filter(|v| self.psi[*v] > level) {
            let p = self.mesh.points()[v];
            let d = walls.distance(&p);
            if d > farthest {
                (seed, farthest) = (p, d);
            }
            top = top.max(self.psi[v]);
        }
        let mut nest = Nest { curves, inner: Vec::new(), between: Vec::new(), seed };
        if farthest <= self.reach {
            return Ok(nest);
        }
        let probes = subdivided(&nest.curves, SUBDIVISION * self.spacing.step);
        let steps = self.spacing.steps(&nest.curves);
        let far_share = if self.spacing.turning.is_some() { FAR_SHARE_BOUNDED } else { FAR_SHARE };
        let near_enough = |level: f64| {
            let inner = self.curves_at(level, &triangles);
            let grid = SegmentGrid::of_curves(inner.iter().map(Vec::as_slice));
            let (mut far, mut farthest) = (0usize, 0.0f64);
            for (d, step) in probes.iter().map(|p| grid.distance(p)).zip(&steps) {
                far += usize::from(d > *step);
                farthest = farthest.max(d);
            }
            far as f64 <= far_share * probes.len() as f64 && farthest <= FARTHEST_STEPS * self.spacing.step
        };
        let (mut lo, mut hi) = (level, top);
        for _ in 0..HALVINGS {
            monitor::check(self.monitor)?;
            let middle = 0.5 * (lo + hi);
            if near_enough(middle) { lo = middle } else { hi = middle }
        }
        // Where not even the next curve is near enough (a wall's sharp corner on a coarse mesh) go on by a
        // little rather than not at all.
        let next = lo.max(level + LEAST_RISE * (top - level));
        nest.between = self.between(&probes, level, next, &triangles)?;
        for set in self.mesh.above(self.psi, next, &triangles) {
            let loops = self.mesh.level_curves(self.psi, next, &set);
            let Some(curves) = piece_of(loops, POINT_SHARE * self.spacing.step) else { continue };
            nest.inner.push(self.within(curves, next, set, depth + 1)?);
        }
        Ok(nest)
    }

    /// Level curves that are more than points.
    fn curves_at(&self, level: f64, triangles: &[u32]) -> Vec<Vec<Point2>> {
        let mut curves = self.mesh.level_curves(self.psi, level, triangles);
        curves.retain(|c| closed_length(c) > POINT_SHARE * self.spacing.step);
        curves
    }

    /// Stretches of levels between `outer` and `inner` where the curves at `inner` are too far from the
    /// places `probes` at `outer`; the innermost first.
    fn between(
        &self,
        probes: &[Point2],
        outer: f64,
        inner: f64,
        triangles: &[u32],
    ) -> Result<Vec<Vec<Point2>>, Cancelled> {
        let Spacing { step, farthest, .. } = self.spacing;
        let inside = self.curves_at(inner, triangles);
        let inside = SegmentGrid::of_curves(inside.iter().map(Vec::as_slice));
        let mut far: Vec<Point2> = probes.iter().filter(|p| inside.distance(p) > farthest).copied().collect();
        let mut level = outer;
        let mut layers: Vec<Vec<Vec<Point2>>> = Vec::new();
        while !far.is_empty() && layers.len() < MOST_INSERTED {
            let (mut lo, mut hi) = (level, inner);
            for _ in 0..HALVINGS {
                monitor::check(self.monitor)?;
                let middle = 0.5 * (lo + hi);
                let curves = self.curves_at(middle, triangles);
                let grid = SegmentGrid::of_curves(curves.iter().map(Vec::as_slice));
                if far.iter().all(|p| grid.distance(p) <= farthest) { lo = middle } else { hi = middle }
            }
            level = lo.max(level + LEAST_RISE * (inner - level));
            let near = SegmentGrid::new(
                far.iter().map(|p| CurveSegment { ends: [*p, *p], curve: 0, index: 0 }).collect(),
            );
            let mut layer = Vec::new();
            for curve in self.curves_at(level, triangles) {
                let curve = Piece { outer: curve, islands: Vec::new() };
                // What serves far places, and on to where the curve inwards is near.
                let serves = |p: &Point2| near.distance(p) <= farthest + SUBDIVISION * step;
                let wanted = |p: &Point2| inside.distance(p) > MERGE_SHARE * step || serves(p);
                let all = stretches(&subdivided(&curve, SUBDIVISION * step), wanted);
                layer.extend(all.into_iter().filter(|s| s.iter().any(serves)));
            }
            far = layer.iter().flatten().filter(|p| inside.distance(p) > farthest).copied().collect();
            layers.push(layer);
        }
        Ok(layers.into_iter().rev().flatten().collect())
    }
}

/// The stretches of a closed curve whose points are `wanted`; a curve that is wanted as a whole ends where
/// it begins.
fn stretches(curve: &[Point2], wanted: impl Fn(&Point2) -> bool) -> Vec<Vec<Point2>> {
    let keep: Vec<bool> = curve.iter().map(wanted).collect();
    let n = curve.len();
    let Some(gap) = keep.iter().position(|k| !k) else {
        let mut whole = curve.to_vec();
        whole.extend(curve.first());
        return vec![whole];
    };
    let mut all = Vec::new();
    let mut stretch = Vec::new();
    for k in (1..=n).map(|i| (gap + i) % n) {
        if keep[k] {
            stretch.push(curve[k]);
        } else if !stretch.is_empty() {
            all.push(std::mem::take(&mut stretch));
        }
    }
    all.retain(|s: &Vec<Point2>| s.len() > 1);
    all
}

/// The piece that closed curves bound, those shorter than `least` left out.
fn piece_of(loops: Vec<Vec<Point2>>, least: f64) -> Option<Piece> {
    let mut piece = Piece::default();
    let mut greatest = 0.0;
    for curve in loops.into_iter().filter(|c| closed_length(c) > least) {
        let area = geometry::signed_area(&curve);
        if area > greatest {
            greatest = area;
            piece.outer = curve;
        } else if area < 0.0 {
            piece.islands.push(curve);
        }
    }
    (!piece.outer.is_empty()).then_some(piece)
}

/// Points along all curves, no farther apart than `spacing`.
fn subdivided(piece: &Piece, spacing: f64) -> Vec<Point2> {
    let mut points = Vec::new();
    for curve in piece.curves() {
        for (k, a) in curve.iter().enumerate() {
            let side = curve[(k + 1) % curve.len()] - a;
            let n = (side.norm() / spacing).ceil().max(1.0);
            points.extend((0..n as usize).map(|i| a + side * (i as f64 / n)));
        }
    }
    points
}

/// A closed curve with fewer points, none farther than `tolerance` from the new sides.
pub fn thinned(curve: &[Point2], tolerance: f64) -> Vec<Point2> {
    const MAX_SKIP: usize = 200;
    let n = curve.len();
    let mut kept = vec![0];
    let mut from = 0;
    while from < n {
        let fits = |to: usize| {
            let ends = [curve[from], curve[to % n]];
            (from + 1..to).all(|k| geometry::foot(&curve[k], &ends).1 <= tolerance)
        };
        let mut to = from + 1;
        while to < n && to - from < MAX_SKIP && fits(to + 1) {
            to += 1;
        }
        if to < n {
            kept.push(to);
        }
        from = to;
    }
    let points: Vec<Point2> = kept.into_iter().map(|k| curve[k]).collect();
    if points.len() < 3 { curve.to_vec() } else { points }
}

/// The nests of a flow, each with its smoothing length, mm: of a given one, or of four.
///
/// # Errors
/// [`NestError`].
pub fn flows(
    piece: &Piece,
    flow: &Flow,
    spacing: Spacing,
    reach: f64,
    monitor: &dyn Monitor,
) -> Result<Vec<(Nest, f64)>, NestError> {
    /// Smoothing lengths that are tried, over the radius of the largest disc.
    const SHARES: [f64; 4] = [0.08, 0.16, 0.32, 0.64];
    let field = FlowField::new(piece, spacing.step, monitor)?;
    let lengths = flow
        .smoothing
        .map_or_else(|| SHARES.map(|share| share * field.deepest()).to_vec(), |sigma| vec![sigma]);
    lengths.into_iter().map(|sigma| Ok((field.nest(piece, sigma, spacing, reach, monitor)?, sigma))).collect()
}
