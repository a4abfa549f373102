//! The hierarchy of triangles over the cells, and how far each lies from the cut surface.
//!
//! A right-triangulated irregular network (Evans, Kirkpatrick and Townsend 2001): right triangles
//! over the grid of cell centres, halved at the middle of their longest side. Sides that a ridge
//! crosses carry the ridge's point, and the triangles at them are cut along it ([`super::split`]).
//! Which points a side carries depends on that side alone, so its two triangles agree.
//!
//! The bound of a middle is the greatest vertical distance from the two triangles at its side to the
//! cell centres and ridge points that they cover, and no less than the bounds of the middles below it
//! (Lindstrom and others 1996). A side is halved exactly when its bound exceeds the tolerance; both
//! triangles at a side read the same bound, so that no crack can open.

use std::cmp::Ordering;

use super::Node;
use super::ridge_points::{Line, RidgePoints};
use super::split::{Corner, split};
use sim::ZMap;

/// Side of the squares from which halving starts, cells (a power of two). Greater squares allow
/// greater triangles on flat ground, but more of the last row of squares hangs over the border.
const MAX_SQUARE: usize = 256;

/// A side longer than a cell carries its ridge points if they are so many at most: between more of
/// them it would need the valleys too.
const MOST_RIDGES: usize = 2;

/// A long side carries its ridge points if they bring it at least this much closer.
const WORTH: f64 = 0.5;

/// Places, in cells, that differ by less are the same. Triangles are 1/256 of a cell at least.
const SAME_PLACE: f64 = 1e-9;

/// Factor by which the tolerance grows while there are too many triangles, and how often the last
/// such step is then halved: 2^(1/8) is 9 % more than the least tolerance at most.
const GROWTH: f64 = 2.0;
const HALVINGS: usize = 3;

/// The bounds at all middles, over whole squares that cover the grid.
pub(super) struct Network<'a> {
    cut: &'a ZMap,
    ridges: &'a RidgePoints,
    /// Ridge points closer to a side than this, mm, are left out of it.
    floor: f64,
    /// Bounds above this, mm, are not worked out, but infinite.
    cap: f64,
    /// Side of a square, cells.
    square: usize,
    /// Nodes along x and y: whole squares, and one.
    width: usize,
    height: usize,
    bound: Vec<f32>,
    /// How many ridge points the side carries whose middle is there; of no meaning where the bound is
    /// infinite.
    carried: Vec<u8>,
    /// Greatest finite bound.
    coarsest: f64,
}

/// Room for the pieces of one triangle.
#[derive(Default)]
pub(super) struct Scratch {
    /// Ridge points on the longest side, in the order of the triangle that looks at it.
    longest: Vec<Corner>,
    outline: Vec<Corner>,
    planes: Vec<Plane>,
    pub pieces: Vec<[Corner; 3]>,
}

impl<'a> Network<'a> {
    pub fn new(cut: &'a ZMap, ridges: &'a RidgePoints, floor: f64, cap: f64) -> Self {
        let longest = cut.grid.nx.max(cut.grid.ny) - 1;
        let square = longest.next_power_of_two().min(MAX_SQUARE);
        let whole = |nodes: usize| (nodes - 1).div_ceil(square) * square + 1;
        let (width, height) = (whole(cut.grid.nx), whole(cut.grid.ny));
        let (bound, carried) = (vec![0.0; width * height], vec![0; width * height]);
        let mut network =
            Self { cut, ridges, floor, cap, square, width, height, bound, carried, coarsest: 0.0 };
        // From the smallest triangles up, since a bound holds those below it.
        let mut size = 2;
        while size <= square {
            let half = size / 2;
            // Middles of the sides of all squares of this size, then the middles of those squares.
            network.bound_rows(0, half, size, |_, y| if y % size == 0 { half } else { 0 });
            network.bound_rows(half, size, size, |_, _| half);
            size *= 2;
        }
        let finite = network.bound.iter().copied().filter(|b| b.is_finite());
        network.coarsest = f64::from(finite.fold(0.0, f32::max));
        network
    }

    /// Bounds at the middles of one kind: rows from `first` in steps of `row_step`, in each of them
    /// columns from `start` on in steps of `size`.
    fn bound_rows(
        &mut self,
        first: usize,
        row_step: usize,
        size: usize,
        start: impl Fn(usize, usize) -> usize + Sync + Send,
    ) {
        let rows: Vec<usize> = (first..self.height).step_by(row_step).collect();
        let this = &*self;
        let found = work::parallel::map(rows.len(), |k| {
            let mut scratch = Scratch::default();
            let columns = (start(k, rows[k])..this.width).step_by(size);
            columns.map(|x| this.bound_at((x, rows[k]), size, &mut scratch)).collect::<Vec<(f32, u8)>>()
        });
        for (k, row) in found.into_iter().enumerate() {
            let x0 = start(k, rows[k]);
            for (n, (bound, carried)) in row.into_iter().enumerate() {
                let at = rows[k] * self.width + x0 + n * size;
                (self.bound[at], self.carried[at]) = (bound, carried);
            }
        }
    }

    /// The bound at a middle (of the side of a square of `size` or of such a square), and how many ridge
    /// points the longest side through it carries.
    fn bound_at(&self, (x, y): Node, size: usize, scratch: &mut Scratch) -> (f32, u8) {
        let half = size / 2;
        let of_square = x % size == half && y % size == half;
        let mut bound = 0f32;
        let step = if of_square { half } else { half / 2 } as i64;
        let below = if of_square {
            [(-step, 0), (step, 0), (0, -step), (0, step)]
        } else {
            [(-step, -step), (step, -step), (-step, step), (step, step)]
        };
        for (dx, dy) in below.into_iter().filter(|_| step > 0) {
            let (x, y) = (x as i64 + dx, y as i64 + dy);
            if (0..self.width as i64).contains(&x) && (0..self.height as i64).contains(&y) {
                bound = bound.max(self.bound[y as usize * self.width + x as usize]);
            }
        }
        if f64::from(bound) > self.cap {
            return (f32::INFINITY, 0);
        }
        let triangles = if of_square {
            halves((x - half, y - half), size).map(Some)
        } else {
            // The side lies or stands; its two triangles have their right angles to either hand.
            let (a, b) =
                if y % size == 0 { ((x - half, y), (x + half, y)) } else { ((x, y + half), (x, y - half)) };
            let ahead = if y % size == 0 { (x, y + half) } else { (x + half, y) };
            let behind = if y % size == 0 {
                y.checked_sub(half).map(|y| (x, y))
            } else {
                x.checked_sub(half).map(|x| (x, y))
            };
            let inside = (ahead.0 < self.width && ahead.1 < self.height).then_some([ahead, a, b]);
            [inside, behind.map(|behind| [behind, b, a])]
        };
        let mut triangles = triangles.into_iter().flatten();
        let Some(first) = triangles.next() else { return (bound, 0) };
        let [_, a, b] = first;
        if size == 2 && self.is_plain((x, y), of_square) {
            // The middles of the other sides have their bounds.
            let z = |node: Node| f64::from(self.cut.height[self.cut.grid.index(node.0, node.1)]);
            let worst = (0.5 * (z(a) + z(b)) - z((x, y))).abs();
            return (if worst > self.cap { f32::INFINITY } else { bound.max(worst as f32) }, 0);
        }
        scratch.longest.clear();
        if a.0.max(b.0) < self.cut.grid.nx && a.1.max(b.1) < self.cut.grid.ny {
            self.choose(a, b, &mut scratch.longest);
        }
        bound = bound.max(self.misfit(first, scratch));
        if let Some(second) = triangles.next() {
            scratch.longest.reverse();
            bound = bound.max(self.misfit(second, scratch));
        }
        (bound, scratch.longest.len() as u8)
    }

    /// True where the two smallest triangles at a middle lie inside the grid and no ridge touches them.
    fn is_plain(&self, (x, y): Node, of_square: bool) -> bool {
        let grid = &self.cut.grid;
        if x == 0 || y == 0 || x + 1 >= grid.nx || y + 1 >= grid.ny {
            return false;
        }
        let crosses = |i: usize, j: usize, line: Line| self.ridges.crosses((i, j), line);
        let (columns, rows) = ([x - 1, x], [y - 1, y]);
        let through = |line: Line| columns.iter().any(|&i| rows.iter().any(|&j| crosses(i, j, line)));
        if !of_square {
            // A square on its corner: its sides are diagonals, and the middle's four lines lie within.
            let along_x = columns.iter().any(|&i| crosses(i, y, Line::AlongX));
            let along_y = rows.iter().any(|&j| crosses(x, j, Line::AlongY));
            return !(along_x || along_y || through(Line::Diagonal));
        }
        let top = columns.iter().any(|&i| crosses(i, y + 1, Line::AlongX));
        let right = rows.iter().any(|&j| crosses(x + 1, j, Line::AlongY));
        let inside = [Line::AlongX, Line::AlongY, Line::Diagonal].into_iter().any(through);
        !(inside || top || right)
    }

    /// Greatest vertical distance of a triangle from the centres and ridge points that it covers, mm;
    /// infinite across the grid's border, where it must be halved down to the border. Its longest side
    /// carries `scratch.longest`.
    fn misfit(&self, corners: [Node; 3], scratch: &mut Scratch) -> f32 {
        let grid = &self.cut.grid;
        let [columns, rows] = [corners.map(|c| c.0), corners.map(|c| c.1)];
        let range = |of: [usize; 3]| (of[0].min(of[1]).min(of[2]), of[0].max(of[1]).max(of[2]));
        let ((x0, x1), (y0, y1)) = (range(columns), range(rows));
        if x0 >= grid.nx - 1 || y0 >= grid.ny - 1 {
            return 0.0;
        }
        if x1 >= grid.nx || y1 >= grid.ny {
            return f32::INFINITY;
        }
        let Scratch { longest, outline, pieces, planes } = scratch;
        let [apex, a, b] = corners;
        outline.clear();
        pieces.clear();
        outline.push(Corner { sides: 0b101, ..self.corner(apex) });
        self.side(apex, a, 0b001, outline);
        outline.push(Corner { sides: 0b011, ..self.corner(a) });
        outline.extend(longest.iter().map(|point| Corner { sides: 0b010, ..*point }));
        outline.push(Corner { sides: 0b110, ..self.corner(b) });
        self.side(b, apex, 0b100, outline);
        split(outline, pieces);
        planes.clear();
        planes.extend(pieces.iter().map(Plane::through));
        let mut worst = match planes[..] {
            [ref plane] => self.whole_misfit(corners, y0..=y1, plane),
            _ => self.divided_misfit(pieces, planes),
        };
        if worst > self.cap {
            return f32::INFINITY;
        }
        for j in y0..=y1 {
            for point in self.ridges.of_cells(x0, x1, j) {
                let (x, y) = point.place(j);
                if let Some(k) = pieces.iter().position(|piece| covers(piece, x, y)) {
                    worst = worst.max((planes[k].at(x, y) - f64::from(point.z)).abs());
                }
            }
        }
        worst as f32
    }

    /// Greatest vertical distance of the pieces of a triangle from the centres that they cover, or one
    /// above the cap.
    fn divided_misfit(&self, pieces: &[[Corner; 3]], planes: &[Plane]) -> f64 {
        let mut worst = 0f64;
        for (piece, plane) in pieces.iter().zip(planes) {
            let (low, high) = extent(piece.map(|c| c.y));
            for j in rounded_up(low - SAME_PLACE)..=(high + SAME_PLACE) as usize {
                let Some((left, right)) = across(piece, j as f64) else { continue };
                for i in rounded_up(left - SAME_PLACE)..=(right + SAME_PLACE) as usize {
                    let z = f64::from(self.cut.height[self.cut.grid.index(i, j)]);
                    worst = worst.max((plane.at(i as f64, j as f64) - z).abs());
                }
                if worst > self.cap {
                    return worst;
                }
            }
        }
        worst
    }

    /// Greatest vertical distance of a triangle that no ridge divides from the centres that it covers, or
    /// one above the cap. Its sides run along rows, columns and diagonals, so they meet rows at nodes.
    fn whole_misfit(&self, corners: [Node; 3], rows: std::ops::RangeInclusive<usize>, plane: &Plane) -> f64 {
        let nodes = corners.map(|(i, j)| (i as i64, j as i64));
        let mut worst = 0f64;
        for j in rows {
            let (mut left, mut right) = (i64::MAX, 0);
            for k in 0..3 {
                let (p, q) = (nodes[k], nodes[(k + 1) % 3]);
                let (from, to) = (j as i64 - p.1, q.1 - p.1);
                let met = if to == 0 { from == 0 } else { (0..=to.abs()).contains(&(from * to.signum())) };
                if met {
                    let x = p.0 + (q.0 - p.0).signum() * from.abs();
                    (left, right) = (left.min(x), right.max(x));
                }
            }
            let start = plane.at(left as f64, j as f64);
            let row =
                &self.cut.height[self.cut.grid.index(left as usize, j)..][..(right - left) as usize + 1];
            for (k, &z) in row.iter().enumerate() {
                let miss = (start + plane.by_x * k as f64 - f64::from(z)).abs();
                worst = if miss > worst { miss } else { worst };
            }
            if worst > self.cap {
                break;
            }
        }
        worst
    }

    /// The pieces of a triangle whose `corners` begin at the right angle and run counter-clockwise.
    pub fn pieces(&self, corners: [Node; 3], scratch: &mut Scratch) {
        let Scratch { outline, pieces, .. } = scratch;
        outline.clear();
        pieces.clear();
        for k in 0..3 {
            let (own, before) = (1u8 << k, 1u8 << ((k + 2) % 3));
            outline.push(Corner { sides: own | before, ..self.corner(corners[k]) });
            self.side(corners[k], corners[(k + 1) % 3], own, outline);
        }
        split(outline, pieces);
    }

    fn corner(&self, (i, j): Node) -> Corner {
        let vertex = self.cut.grid.index(i, j);
        let z = f64::from(self.cut.height[vertex]);
        Corner { x: i as f64, y: j as f64, z, vertex, on_ridge: false, sides: 0 }
    }

    /// Adds the ridge points that the side from `a` to `b` carries, in that order. The bound at its middle
    /// is known, and finite.
    fn side(&self, a: Node, b: Node, side: u8, out: &mut Vec<Corner>) {
        let begin = out.len();
        if is_long(a, b) {
            let count = self.carried[self.middle(a, b)];
            if count > 0 {
                self.gather(a, b, usize::from(count), out);
            }
        } else {
            self.choose(a, b, out);
        }
        out[begin..].iter_mut().for_each(|point| point.sides = side);
    }

    /// Chooses the ridge points that the side from `a` to `b` carries, and adds them in that order.
    fn choose(&self, a: Node, b: Node, out: &mut Vec<Corner>) {
        let begin = out.len();
        let most = if is_long(a, b) { MOST_RIDGES } else { usize::MAX };
        self.gather(a, b, most.saturating_add(1), out);
        let points = &mut out[begin..];
        if points.is_empty() {
            return;
        }
        // Both triangles at a side look at it from its left or lower end.
        let (p, q) = if a < b { (a, b) } else { (b, a) };
        if p != a {
            points.reverse();
        }
        if points.len() > most || !self.worthwhile(p, q, points) {
            out.truncate(begin);
        } else if p != a {
            points.reverse();
        }
    }

    /// Adds the ridge points on a side from `a` to `b`, in that order, until they are `enough`.
    fn gather(&self, a: Node, b: Node, enough: usize, out: &mut Vec<Corner>) {
        let begin = out.len();
        let (p, q) = if a < b { (a, b) } else { (b, a) };
        let (dx, dy) = (q.0 - p.0, q.1.abs_diff(p.1));
        let falls = q.1 < p.1;
        for k in 0..dx.max(dy) {
            let (cell, line) = match (dx, dy) {
                (_, 0) => ((p.0 + k, p.1), Line::AlongX),
                (0, _) => ((p.0, p.1 + k), Line::AlongY),
                _ if falls => ((p.0 + k, p.1 - k - 1), Line::Diagonal),
                _ => ((p.0 + k, p.1 + k), Line::Diagonal),
            };
            let (first, points) = self.ridges.on(cell, line);
            for (n, point) in points.iter().enumerate() {
                let (x, y) = point.place(cell.1);
                let vertex = self.cut.grid.len() + first + n;
                out.push(Corner { x, y, z: f64::from(point.z), vertex, on_ridge: true, sides: 0 });
            }
            if out.len() - begin >= enough {
                break;
            }
        }
        if p != a {
            out[begin..].reverse();
        }
    }

    /// Index of the middle of a side.
    fn middle(&self, a: Node, b: Node) -> usize {
        (a.1 + b.1) / 2 * self.width + (a.0 + b.0) / 2
    }

    /// True when a side comes closer to its centres and ridge points by carrying those points.
    fn worthwhile(&self, p: Node, q: Node, points: &[Corner]) -> bool {
        let (from, to) = (self.corner(p), self.corner(q));
        // Share of the side from its beginning, in cells.
        let along = |c: &Corner| (c.x - from.x).max((c.y - from.y).abs());
        let between =
            |a: &Corner, b: &Corner, s: f64| a.z + (b.z - a.z) * (s - along(a)) / (along(b) - along(a));
        let (mut without, mut with) = (0f64, 0f64);
        for point in points {
            without = without.max((between(&from, &to, along(point)) - point.z).abs());
        }
        let mut next = 0;
        let length = p.0.abs_diff(q.0).max(p.1.abs_diff(q.1));
        let step = |k: usize, from: usize, to: usize| match from.cmp(&to) {
            Ordering::Less => from + k,
            Ordering::Equal => from,
            Ordering::Greater => from - k,
        };
        for k in 1..length {
            let (z, s) = (self.corner((step(k, p.0, q.0), step(k, p.1, q.1))).z, k as f64);
            while next < points.len() && along(&points[next]) <= s {
                next += 1;
            }
            let (a, b) = (if next == 0 { &from } else { &points[next - 1] }, points.get(next).unwrap_or(&to));
            without = without.max((between(&from, &to, s) - z).abs());
            with = with.max((between(a, b, s) - z).abs());
        }
        without > self.floor && with <= WORTH * without
    }

    /// Hands every triangle to `emit` until that returns false.
    pub fn visit(&self, tolerance: f64, emit: &mut dyn FnMut([Node; 3]) -> bool) {
        for y in (0..self.height - 1).step_by(self.square) {
            for x in (0..self.width - 1).step_by(self.square) {
                let two = halves((x, y), self.square);
                if !two.into_iter().all(|corners| self.halve(corners, tolerance, emit)) {
                    return;
                }
            }
        }
    }

    /// `corners` begin at the right angle and run counter-clockwise.
    fn halve(&self, corners: [Node; 3], tolerance: f64, emit: &mut dyn FnMut([Node; 3]) -> bool) -> bool {
        let [apex, a, b] = corners;
        let least = (apex.0.min(a.0).min(b.0), apex.1.min(a.1).min(b.1));
        if least.0 >= self.cut.grid.nx - 1 || least.1 >= self.cut.grid.ny - 1 {
            return true;
        }
        let unit = (a.0 + b.0) % 2 == 1;
        if unit || f64::from(self.bound[self.middle(a, b)]) <= tolerance {
            return emit(corners);
        }
        let middle = ((a.0 + b.0) / 2, (a.1 + b.1) / 2);
        self.halve([middle, apex, a], tolerance, emit) && self.halve([middle, b, apex], tolerance, emit)
    }

    /// The least tolerance from `tolerance` up (about) that needs no more than `max_triangles`.
    pub fn least_tolerance(&self, mut tolerance: f64, max_triangles: usize) -> f64 {
        let mut factor = 1.0;
        while self.exceeds(tolerance, max_triangles) && tolerance < self.coarsest {
            factor = GROWTH;
            tolerance *= factor;
        }
        for _ in 0..if factor > 1.0 { HALVINGS } else { 0 } {
            factor = factor.sqrt();
            if !self.exceeds(tolerance / factor, max_triangles) {
                tolerance /= factor;
            }
        }
        tolerance
    }

    /// True when a tolerance takes more triangles.
    pub fn exceeds(&self, tolerance: f64, max_triangles: usize) -> bool {
        let (mut count, mut points) = (0, Vec::new());
        self.visit(tolerance, &mut |corners| {
            points.clear();
            for k in 0..3 {
                self.side(corners[k], corners[(k + 1) % 3], 0, &mut points);
            }
            // Each point on a side makes one triangle more.
            count += 1 + points.len();
            count <= max_triangles
        });
        count > max_triangles
    }
}

/// The two triangles of a square, right angle first, counter-clockwise. Squares alternate like a
/// chessboard, so that the diagonals of the four quarters of a square meet in its middle.
fn halves((x, y): Node, size: usize) -> [[Node; 3]; 2] {
    let (south_west, south_east, north_west, north_east) =
        ((x, y), (x + size, y), (x, y + size), (x + size, y + size));
    if super::ridge_points::rises((x / size, y / size)) {
        [[south_east, north_east, south_west], [north_west, south_west, north_east]]
    } else {
        [[north_east, north_west, south_east], [south_west, south_east, north_west]]
    }
}

/// True for a side longer than from cell to cell.
fn is_long(a: Node, b: Node) -> bool {
    a.0.abs_diff(b.0).max(a.1.abs_diff(b.1)) > 1
}

/// The least whole number from `value` up, 0 below: [`f64::ceil`] is a call on the plainest machines.
fn rounded_up(value: f64) -> usize {
    let below = value as usize;
    below + usize::from((below as f64) < value)
}

fn extent(of: [f64; 3]) -> (f64, f64) {
    (of[0].min(of[1]).min(of[2]), of[0].max(of[1]).max(of[2]))
}

/// Where the row at `y` enters and leaves a triangle.
fn across(piece: &[Corner; 3], y: f64) -> Option<(f64, f64)> {
    let (mut left, mut right) = (f64::INFINITY, f64::NEG_INFINITY);
    for k in 0..3 {
        let (p, q) = (&piece[k], &piece[(k + 1) % 3]);
        if (p.y - y).abs() <= SAME_PLACE {
            (left, right) = (left.min(p.x), right.max(p.x));
        }
        if (p.y - y) * (q.y - y) < 0.0 {
            let x = p.x + (q.x - p.x) * (y - p.y) / (q.y - p.y);
            (left, right) = (left.min(x), right.max(x));
        }
    }
    (left <= right).then_some((left, right))
}

fn covers(piece: &[Corner; 3], x: f64, y: f64) -> bool {
    (0..3).all(|k| {
        let (p, q) = (&piece[k], &piece[(k + 1) % 3]);
        (q.x - p.x) * (y - p.y) - (x - p.x) * (q.y - p.y) >= -SAME_PLACE
    })
}

/// The height of a triangle as a function of place.
struct Plane {
    x: f64,
    y: f64,
    z: f64,
    by_x: f64,
    by_y: f64,
}

impl Plane {
    fn through([a, b, c]: &[Corner; 3]) -> Self {
        let (ux, uy, uz) = (b.x - a.x, b.y - a.y, b.z - a.z);
        let (vx, vy, vz) = (c.x - a.x, c.y - a.y, c.z - a.z);
        let area = ux * vy - vx * uy;
        let (by_x, by_y) = ((uz * vy - vz * uy) / area, (ux * vz - vx * uz) / area);
        Self { x: a.x, y: a.y, z: a.z, by_x, by_y }
    }

    fn at(&self, x: f64, y: f64) -> f64 {
        self.z + self.by_x * (x - self.x) + self.by_y * (y - self.y)
    }
}
