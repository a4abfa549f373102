//! Which of many moves may be lowest somewhere in a square of cells (see the bound in `cut.rs`).
//!
//! Enters: a list of moves and up to four squares. Leaves: one bit for each move and square. Squares are
//! worked on side by side, because each step of one waits for the step before it.

use super::local::{Chunk, MoveList};
use crate::sweep::{LocalMove, Sweep};
use work::lanes::{LANES, Real, bits};

/// Most squares that choose together.
pub(super) const SQUARES: usize = 4;

/// A square of cells: its middle in the tile's frame, and the distance from there to its outermost
/// cell centres.
#[derive(Clone, Copy)]
pub(super) struct Square<T> {
    pub x: T,
    pub y: T,
    pub half_x: T,
    pub half_y: T,
}

/// Planes below the moves of a chunk, at the middle of a square.
#[derive(Clone, Copy)]
struct Planes<T> {
    z: [T; LANES],
    x: [T; LANES],
    y: [T; LANES],
    /// Squared distance from the track.
    away: [T; LANES],
}

impl<T: Real> Planes<T> {
    fn none() -> Self {
        let zero = [T::of(0.0); LANES];
        Self { z: zero, x: zero, y: zero, away: zero }
    }

    /// Heights at the corners of a square, raised by a margin.
    #[inline(always)]
    fn corners(&self, lane: usize, square: &Square<T>, margin: T) -> [T; 4] {
        let (dx, dy) = (self.x[lane] * square.half_x, self.y[lane] * square.half_y);
        let z = self.z[lane] + margin;
        [z - dx - dy, z + dx - dy, z - dx + dy, z + dx + dy]
    }
}

/// So few moves go down to the leaves without further tests.
pub(super) const FEW: usize = 4;

/// Room to choose in, kept from one call to the next.
pub(super) struct Chooser<T> {
    planes: Vec<[Planes<T>; SQUARES]>,
    neighbours: Vec<[Neighbours; SQUARES]>,
}

impl<T: Real> Chooser<T> {
    pub fn new() -> Self {
        Self { planes: Vec::new(), neighbours: Vec::new() }
    }

    /// Marks for each square those of `all` that may be lowest somewhere in it and below its stock, and
    /// counts them. `margin` is added to every bound; `judging` compares the marked moves of a short list
    /// each with each.
    #[inline(always)]
    pub fn choose<S: Sweep<T>, const Q: usize>(
        &mut self,
        sweep: &S,
        all: &MoveList<T>,
        squares: &[Square<T>; Q],
        stocks: &[T; Q],
        margin: T,
        judging: bool,
        chosen: &mut Vec<[u32; SQUARES]>,
    ) -> [usize; SQUARES] {
        let chunks = all.chunks();
        if self.planes.len() < chunks.len() {
            self.planes.resize(chunks.len(), [Planes::none(); SQUARES]);
            self.neighbours.resize(chunks.len(), [Neighbours::default(); SQUARES]);
        }
        let infinite = T::of(f64::INFINITY);
        let (mut within, mut reach2) = ([T::of(0.0); Q], [T::of(0.0); Q]);
        for q in 0..Q {
            let half = half_diagonal(&squares[q]);
            let (inner, outer) = (sweep.radius() - half, sweep.radius() + half);
            within[q] = if inner > T::of(0.0) { inner * inner } else { T::of(-1.0) };
            reach2[q] = outer * outer;
        }
        let mut best = [Best { least: [infinite; LANES], chunk: [0; LANES] }; Q];
        for (k, (chunk, (planes, neighbours))) in
            chunks.iter().zip(self.planes.iter_mut().zip(&mut self.neighbours)).enumerate()
        {
            let followed = followed(chunk, chunks.get(k + 1));
            for q in 0..Q {
                (planes[q], neighbours[q]) =
                    planes_of(sweep, chunk, &squares[q], within[q], followed, k, &mut best[q]);
            }
        }
        let mut places = [None; Q];
        for q in 0..Q {
            places[q] = best[q].place();
        }
        let ceilings = ceilings(sweep, all, &places, squares);
        chosen.clear();
        let mut kept = [0; SQUARES];
        let mut before = [Neighbours::default(); Q];
        for (k, (planes, neighbours)) in
            self.planes.iter().zip(&self.neighbours).take(chunks.len()).enumerate()
        {
            let mut marks = [0; SQUARES];
            for q in 0..Q {
                let mut keep = [false; LANES];
                for lane in 0..LANES {
                    let corners = planes[q].corners(lane, &squares[q], margin);
                    let above = at_or_above(corners, ceilings[q]);
                    let lowest = corners[0].smaller(corners[1]).smaller(corners[2].smaller(corners[3]));
                    keep[lane] = !above & (lowest < stocks[q]) & (planes[q].away[lane] <= reach2[q]);
                }
                let own = neighbours[q];
                let of_best = places[q].filter(|[chunk, _]| *chunk == k).map_or(0, |[_, lane]| 1 << lane);
                marks[q] = (bits(&keep) & !own.covered(&before[q]) | of_best) & all.lanes_in_use(k);
                kept[q] += marks[q].count_ones() as usize;
                before[q] = own;
            }
            chosen.push(marks);
        }
        // More of them cost more than they save.
        if let (true, [chunk], [planes, ..], [chosen]) = (judging, chunks, &self.planes[..], &mut chosen[..])
        {
            for q in 0..Q {
                if kept[q] > FEW {
                    kept[q] = judge(sweep, chunk, &planes[q], &mut chosen[q], &squares[q], margin);
                }
            }
        }
        kept
    }
}

#[inline(always)]
fn half_diagonal<T: Real>(square: &Square<T>) -> T {
    (square.half_x * square.half_x + square.half_y * square.half_y).sqrt()
}

/// The lowest of the moves that pass all of a square, lane by lane.
#[derive(Clone, Copy)]
struct Best<T> {
    least: [T; LANES],
    chunk: [u32; LANES],
}

impl<T: Real> Best<T> {
    /// Chunk and lane of the lowest one.
    #[inline(always)]
    fn place(&self) -> Option<[usize; 2]> {
        let (least, lane) = least_of(&self.least);
        (least < T::of(f64::INFINITY)).then(|| [self.chunk[lane] as usize, lane])
    }
}

/// Heights at the corners of each square of its best move; infinite where they are not known for sure.
#[inline(always)]
fn ceilings<T: Real, S: Sweep<T>, const Q: usize>(
    sweep: &S,
    all: &MoveList<T>,
    best: &[Option<[usize; 2]>; Q],
    squares: &[Square<T>; Q],
) -> [[T; 4]; Q] {
    let infinite = T::of(f64::INFINITY);
    // All corners of all squares side by side.
    let mut moves = Chunk::empty();
    let (mut x, mut y) = ([T::of(0.0); LANES], [T::of(0.0); LANES]);
    for q in 0..Q {
        let Some([chunk, lane]) = best[q] else { continue };
        let (m, name) = all.get(chunk * LANES + lane);
        let square = &squares[q];
        for c in 0..4 {
            moves.set(4 * q + c, &m, name);
            x[4 * q + c] = if c % 2 == 0 { square.x - square.half_x } else { square.x + square.half_x };
            y[4 * q + c] = if c / 2 == 0 { square.y - square.half_y } else { square.y + square.half_y };
        }
    }
    let mut heights = [infinite; LANES];
    for lane in 0..LANES {
        heights[lane] = sure_height(sweep, &moves.lane(lane), x[lane], y[lane]);
    }
    let mut ceilings = [[infinite; 4]; Q];
    for q in 0..Q {
        if best[q].is_some() {
            ceilings[q].copy_from_slice(&heights[4 * q..4 * q + 4]);
        }
    }
    ceilings
}

/// What the moves of a chunk have to do with their neighbours in the program: one bit for each lane.
#[derive(Clone, Copy, Default)]
struct Neighbours {
    /// Only the end, only the start of the move cuts.
    at_end: u32,
    at_start: u32,
    /// The next move of the list is the next one of the program.
    followed: u32,
}

impl Neighbours {
    /// The moves that their neighbours in the program cover, which are in the list too: where only the
    /// end of a move cuts, the next one, which begins there, cuts as low; and where only its start cuts,
    /// the one before does. Of two that would cover each other the later one stays.
    #[inline(always)]
    fn covered(&self, before: &Self) -> u32 {
        let last = 1 << (LANES - 1);
        let covers_next = self.followed & !self.at_end;
        let first = u32::from(before.followed & !before.at_end & last != 0);
        (self.at_end & self.followed) | (self.at_start & (covers_next << 1 | first))
    }
}

/// Which moves of a chunk are followed in the list by the next one of the program.
#[inline(always)]
fn followed<T: Real>(chunk: &Chunk<T>, next: Option<&Chunk<T>>) -> u32 {
    let mut following = [u32::MAX; LANES];
    for lane in 0..LANES - 1 {
        following[lane] = chunk.name(lane + 1).index();
    }
    following[LANES - 1] = next.map_or(u32::MAX, |next| next.name(0).index());
    let mut followed = [false; LANES];
    for lane in 0..LANES {
        followed[lane] = following[lane] == chunk.name(lane).index() + 1;
    }
    bits(&followed)
}

/// The places of the ones in a number, least first.
#[inline(always)]
pub(super) fn ones(mut number: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let place = number.trailing_zeros() as usize;
        number &= number.wrapping_sub(1);
        (place < LANES).then_some(place)
    })
}

#[inline(always)]
fn at_or_above<T: Real>(a: [T; 4], b: [T; 4]) -> bool {
    (a[0] >= b[0]) & (a[1] >= b[1]) & (a[2] >= b[2]) & (a[3] >= b[3])
}

/// Compares the chosen moves of one chunk each with each, leaves those that none of the others makes useless,
/// and counts them.
#[inline(always)]
fn judge<T: Real, S: Sweep<T>>(
    sweep: &S,
    chunk: &Chunk<T>,
    planes: &Planes<T>,
    chosen: &mut u32,
    square: &Square<T>,
    margin: T,
) -> usize {
    let (mut floor, mut height) = ([[T::of(0.0); LANES]; 4], [[T::of(0.0); LANES]; 4]);
    for lane in 0..LANES {
        let floors = planes.corners(lane, square, margin);
        let heights = corners(sweep, &chunk.lane(lane), square);
        let unsure = chunk.name(lane).bound_only();
        for c in 0..4 {
            floor[c][lane] = floors[c];
            height[c][lane] = if unsure { T::of(f64::INFINITY) } else { heights[c] };
        }
    }
    for judge in ones(*chosen) {
        // One that is useless itself lies above another that judges as strictly.
        if *chosen & (1 << judge) == 0 {
            continue;
        }
        let ceiling = [height[0][judge], height[1][judge], height[2][judge], height[3][judge]];
        let mut above = [false; LANES];
        for lane in 0..LANES {
            above[lane] =
                at_or_above([floor[0][lane], floor[1][lane], floor[2][lane], floor[3][lane]], ceiling);
        }
        *chosen &= !bits(&above) | 1 << judge;
    }
    chosen.count_ones() as usize
}

/// The least number and its lane. By halves of fixed length, which stay in registers.
#[inline(always)]
fn least_of<T: Real>(numbers: &[T; LANES]) -> (T, usize) {
    let (mut eight, mut four, mut two) = ([numbers[0]; 8], [numbers[0]; 4], [numbers[0]; 2]);
    for k in 0..8 {
        eight[k] = numbers[k].smaller(numbers[k + 8]);
    }
    for k in 0..4 {
        four[k] = eight[k].smaller(eight[k + 4]);
    }
    for k in 0..2 {
        two[k] = four[k].smaller(four[k + 2]);
    }
    let least = two[0].smaller(two[1]);
    let mut lanes = [false; LANES];
    for lane in 0..LANES {
        lanes[lane] = numbers[lane] <= least;
    }
    (least, bits(&lanes).trailing_zeros() as usize % LANES)
}

/// The planes of chunk `k`, and what its moves have to do with their neighbours; the lowest that pass all of
/// the square, the distance from their track being no more than the root of `within`, enter `best`. All in
/// one loop: short ones do not become vector code.
#[inline(always)]
fn planes_of<T: Real, S: Sweep<T>>(
    sweep: &S,
    chunk: &Chunk<T>,
    square: &Square<T>,
    within: T,
    followed: u32,
    k: usize,
    best: &mut Best<T>,
) -> (Planes<T>, Neighbours) {
    let mut planes = Planes::none();
    let (mut at_start, mut at_end) = ([false; LANES], [false; LANES]);
    for lane in 0..LANES {
        let m = chunk.lane(lane);
        let (along, across) = m.along_across(square.x, square.y);
        let plane = sweep.plane(&m, along, across);
        planes.z[lane] = plane.z;
        planes.x[lane] = plane.along * m.ux - plane.across * m.uy;
        planes.y[lane] = plane.along * m.uy + plane.across * m.ux;
        let ahead = along - along.larger(m.low).smaller(m.high);
        let away = ahead * ahead + across * across;
        planes.away[lane] = away;
        let half_along = square.half_x * m.ux.absolute() + square.half_y * m.uy.absolute();
        let half_across = square.half_x * m.uy.absolute() + square.half_y * m.ux.absolute();
        let nearest = (across.absolute() - half_across).larger(T::of(0.0));
        let (lower, upper) = sweep.beyond(
            &m,
            [along - half_along, along + half_along],
            [nearest, across.absolute() + half_across],
        );
        let name = chunk.name(lane);
        let lowest = !name.bound_only() & (away <= within) & (plane.z < best.least[lane]);
        best.least[lane] = if lowest { plane.z } else { best.least[lane] };
        best.chunk[lane] = if lowest { k as u32 } else { best.chunk[lane] };
        // A plunge has both ends in one place, and only the lower one cuts.
        let counts = !name.bound_only() & (m.low < m.high);
        at_start[lane] = counts & if name.falling() { upper } else { lower };
        at_end[lane] = counts & if name.falling() { lower } else { upper };
    }
    (planes, Neighbours { at_start: bits(&at_start), at_end: bits(&at_end), followed })
}

/// Heights of a move at the corners of a square, infinite where they are not known for sure.
#[inline(always)]
fn corners<T: Real, S: Sweep<T>>(sweep: &S, m: &LocalMove<T>, square: &Square<T>) -> [T; 4] {
    let (x0, x1) = (square.x - square.half_x, square.x + square.half_x);
    let (y0, y1) = (square.y - square.half_y, square.y + square.half_y);
    [
        sure_height(sweep, m, x0, y0),
        sure_height(sweep, m, x1, y0),
        sure_height(sweep, m, x0, y1),
        sure_height(sweep, m, x1, y1),
    ]
}

#[inline(always)]
fn sure_height<T: Real, S: Sweep<T>>(sweep: &S, m: &LocalMove<T>, x: T, y: T) -> T {
    let (along, across) = m.along_across(x, y);
    let (height, doubt) = sweep.height(m, along, across);
    let infinite = T::of(f64::INFINITY);
    // NaN is not below.
    if (height < infinite) & (doubt >= infinite) { height } else { infinite }
}
