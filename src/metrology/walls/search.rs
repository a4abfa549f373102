//! The deepest cut into one strip of a wall, and the highest material before it.
//!
//! Over a strip the place where one move begins to cut is a convex function. So its deepest cut has one hill,
//! which a golden section climbs, and what it leaves at most stands at a corner: the least such corner over
//! all moves bounds what stands in a part of the strip. Parts are divided until that is as near to what was
//! found as was asked. mm.

use geometry::{Point2, Vector2};

use super::NUMERICAL_FLOOR;
use super::piece::{QUARTERS, WallPiece};
use super::reach::{Line, Moves, greatest, stadium};

/// Parts of a strip that are looked at, at most. With fewer, wide bounds stay where many short moves meet.
const MOST_PARTS: usize = 400;

/// A part is halved so often at most.
const MOST_DEPTH: u32 = 24;

/// Less is rounding, mm.
const FLOOR: f64 = 1e-7;

/// A cutter that comes no farther into a line along a wall than this only touches it, mm.
const TOUCH: f64 = NUMERICAL_FLOOR;

/// A strip's deepest cut.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Deepest {
    pub depth: f64,
    /// Where, along the strip and up.
    pub at: [f64; 2],
    pub by: u32,
}

/// What stands before a strip.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Highest {
    pub height: f64,
    /// No place is higher.
    pub possible: f64,
    pub at: [f64; 2],
    /// Mean over some places, and the share of these above a height; 0 where none is higher.
    pub mean: f64,
    pub share: f64,
}

/// The deepest that `moves` cut into a strip. A cut through an edge belongs to the nearer side: it is no
/// deeper than it is below the top, and than the wall beyond the end is near.
pub(super) fn deepest(piece: &WallPiece, moves: &Moves<'_>, near: &[u32]) -> Deepest {
    let mut found = Deepest::default();
    for &k in near {
        if !may_cut(piece, moves, k, found.depth.max(FLOOR)) {
            continue;
        }
        let [a, b] = moves.ends(k);
        let tip = a.z.min(b.z) + FLOOR;
        let within = |radius: f64| {
            let range = stadium(&a.xy(), &b.xy(), radius, piece.start, piece.along)?;
            Some([range[0].max(0.0), range[1].min(piece.length)]).filter(|range| range[0] <= range[1])
        };
        // A touch is no cut: beside the end of a strip it would be one of any depth.
        let comes_in = within(moves.radius(k) - TOUCH).is_some();
        let Some(range) = within(moves.radius(k)).filter(|_| comes_in) else { continue };
        let edges: [&dyn Fn(f64) -> f64; 2] = [&|u| piece.high_at(u), &|u| piece.low_at(u).max(tip)];
        // The lower edge matters to walls that are not quite vertical only.
        for edge in &edges[..if piece.lean == 0.0 { 1 } else { 2 }] {
            let depth = |u: f64| depth(piece, moves, k, u, edge(u));
            let (u, depth) = greatest(&depth, range, None);
            if depth > found.depth {
                found = Deepest { depth, at: [u, edge(u)], by: k };
            }
        }
    }
    found
}

/// Whether a move may cut deeper than `known` into a strip.
fn may_cut(piece: &WallPiece, moves: &Moves<'_>, k: u32, known: f64) -> bool {
    let [a, b] = moves.ends(k);
    if a.z.min(b.z) >= piece.high[0].max(piece.high[1]) {
        return false;
    }
    let leaning = piece.lean.abs() * (piece.high[0].max(piece.high[1]) - piece.low[0].min(piece.low[1]));
    let front = |p: Point2| (p - piece.start).dot(&piece.normal);
    moves.radius(k) - front(a.xy()).min(front(b.xy())) + leaning > known
}

/// How deep a move cuts at a place of a strip; below 0 where it does not.
fn depth(piece: &WallPiece, moves: &Moves<'_>, k: u32, u: f64, z: f64) -> f64 {
    let place = piece.place(u, z).xy();
    let cut = moves.height(k, place);
    if cut > z {
        return (z - cut).max(-1e9);
    }
    let line = Line { from: place, way: piece.normal, z };
    let below_top = piece.top_at(u) - cut;
    moves.begin(k, &line).map_or(0.0, |begin| (-begin).min(below_top).min(piece.own_depth(u)))
}

/// How what stands before strips is sought.
pub(super) struct Standing<'a> {
    pub moves: &'a Moves<'a>,
    /// No material is looked for farther off, mm.
    pub reach: f64,
    /// How far the block goes on from a place along a normal, in x and in y, mm.
    pub way_out: &'a (dyn Fn(Point2, Vector2) -> [f64; 2] + Sync),
    /// What stands up to this height over a floor is the floor's, mm.
    pub of_floor: f64,
    /// How near the bound is asked for, mm.
    pub asked: f64,
    /// Heights from which area counts, mm.
    pub counted: f64,
}

/// A part of a strip: shares of its length and height.
#[derive(Clone, Copy)]
struct Part {
    u: [f64; 2],
    v: [f64; 2],
    /// No place is higher, mm.
    possible: f64,
    /// Whether what bounds it changes more along the strip than upward.
    along: bool,
    depth: u32,
}

/// Where moves begin to cut before the corners of a part.
struct Seen {
    corners: [f64; 4],
    /// The same of the move that bounds what stands between.
    bounding: [f64; 4],
    at: [[f64; 2]; 4],
    possible: f64,
    /// Whether no move bounds it more than where the material before the strip ends anyhow.
    by_ends: bool,
}

impl Standing<'_> {
    /// The highest material before a strip, as far as it counts: not beside its floor.
    pub fn highest(&self, piece: &WallPiece, near: &[u32]) -> Highest {
        let look = |part: &Part| self.look(piece, part, near);
        let mut found = Highest::default();
        let mut open = Vec::new();
        for u in self.above_floor(piece) {
            let whole = Part { u, v: [0.0, 1.0], possible: f64::INFINITY, along: true, depth: 0 };
            let seen = look(&whole);
            found.look_at(&seen);
            open.push(Part { possible: seen.possible, along: seen.is_along(), ..whole });
        }
        let mut closed: f64 = 0.0;
        for _ in 0..MOST_PARTS {
            let next = (0..open.len()).max_by(|a, b| open[*a].possible.total_cmp(&open[*b].possible));
            let Some(part) = next.map(|k| open.swap_remove(k)) else { break };
            if part.possible <= found.height + self.asked || part.depth == MOST_DEPTH {
                closed = closed.max(part.possible);
                continue;
            }
            for half in part.halves() {
                let seen = look(&half);
                found.look_at(&seen);
                open.push(Part {
                    possible: seen.possible.min(part.possible),
                    along: seen.is_along(),
                    ..half
                });
            }
        }
        found.possible = open.iter().map(|part| part.possible).fold(closed.max(found.height), f64::max);
        if found.height > self.counted {
            // Between the ends: there other walls begin.
            for [a, b] in self.above_floor(piece) {
                let u = QUARTERS.map(|share| a + share * (b - a));
                let part = Part { u, v: QUARTERS, possible: found.possible, along: true, depth: 0 };
                let corners = look(&part).corners;
                let quarter = 0.25 * (b - a);
                found.mean += quarter * corners.iter().sum::<f64>();
                found.share += quarter * corners.iter().filter(|h| **h > self.counted).count() as f64;
            }
        }
        found
    }

    /// The lowest place at a share of the length that is not the floor's.
    fn from(&self, piece: &WallPiece, share: f64) -> f64 {
        let u = share * piece.length;
        piece.low_at(u).max(piece.floor_at(u) + self.of_floor).min(piece.high_at(u))
    }

    /// The shares of a strip where it rises above what is its floor's: up to each, both of its borders there
    /// are straight.
    fn above_floor(&self, piece: &WallPiece) -> Vec<[f64; 2]> {
        let mut ends = vec![0.0, 1.0];
        for edge in [piece.low, piece.high] {
            let [a, b] = [0, 1].map(|k| piece.floor[k] + self.of_floor - edge[k]);
            if a * b < 0.0 {
                ends.push(a / (a - b));
            }
        }
        ends.sort_by(f64::total_cmp);
        let rises = |[a, b]: &[f64; 2]| {
            let middle = 0.5 * (a + b);
            b > a && self.from(piece, middle) < piece.high_at(middle * piece.length)
        };
        ends.windows(2).map(|pair| [pair[0], pair[1]]).filter(rises).collect()
    }

    fn look(&self, piece: &WallPiece, part: &Part, near: &[u32]) -> Seen {
        let at = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(i, j)| {
            let (s, v) = (part.u[i], part.v[j]);
            let low = self.from(piece, s);
            let u = s * piece.length;
            [u, low + (piece.high_at(u) - low) * v]
        });
        let lines = at.map(|[u, z]| Line { from: piece.place(u, z).xy(), way: piece.normal, z });
        // Each of these is convex along the strip and upward. The least of them is not: material is highest
        // between two ends.
        let ends = [0, 1, 2, 3].map(|c| {
            let ([x, y], [first, last]) =
                ((self.way_out)(lines[c].from, lines[c].way), piece.own_heights(at[c][0]));
            [self.reach, x, y, first, last]
        });
        let most = ends.map(|of| of.into_iter().fold(f64::INFINITY, f64::min));
        let greatest = |corners: &[f64; 4]| corners.iter().copied().fold(0.0, f64::max);
        let lid = (0..5).map(|k| greatest(&ends.map(|of| of[k]))).fold(f64::INFINITY, f64::min);
        let mut corners = most;
        let mut bounding = [f64::INFINITY; 4];
        for &k in near {
            let begins = [0, 1, 2, 3].map(|c| {
                let begin = self.moves.begin(k, &lines[c]).map_or(f64::INFINITY, |begin| begin.max(0.0));
                corners[c] = corners[c].min(begin);
                begin
            });
            if greatest(&begins) < greatest(&bounding) {
                bounding = begins;
            }
        }
        let by_ends = greatest(&bounding) > lid;
        let possible = lid.min(greatest(&bounding));
        Seen { corners, bounding, at, possible, by_ends }
    }
}

impl Highest {
    fn look_at(&mut self, seen: &Seen) {
        for (height, at) in seen.corners.iter().zip(seen.at) {
            if *height > self.height {
                (self.height, self.at) = (*height, at);
            }
        }
    }
}

impl Part {
    /// Both halves, across the side along which most changes.
    fn halves(&self) -> [Self; 2] {
        let halved = |[a, b]: [f64; 2]| [[a, 0.5 * (a + b)], [0.5 * (a + b), b]];
        let depth = self.depth + 1;
        if self.along {
            halved(self.u).map(|u| Self { u, depth, ..*self })
        } else {
            halved(self.v).map(|v| Self { v, depth, ..*self })
        }
    }
}

impl Seen {
    fn is_along(&self) -> bool {
        let [a, b, c, d] = self.bounding;
        self.by_ends || (a - b).abs().max((d - c).abs()) >= (a - d).abs().max((b - c).abs())
    }
}
