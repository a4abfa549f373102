//! What is measured of a pocket besides its floor: cuts beyond its walls, and the engagement.
//!
//! Enters: region, cutter, path, the cut stock. Leaves: how far the cutter cut beyond the outline in the plan
//! view, once from the moves in closed form and once from the cells of the simulated stock, which know
//! nothing of each other; mm. Where moves lie does not matter, nor who planned them: programs also come from
//! beside the stock.

use serde::Serialize;

use cutter::Cutter;
use geometry::{
    Aabb, Piece, Point2, Point3, Region, RegionIndex, SegmentGrid, Vector2, distance_of_segments,
};
use motion::Toolpath;
use sim::ZMap;
use work::monitor::{self, Cancelled, Monitor};
use work::parallel;

/// A cell counts as cut when it lies lower than the stock's top by more than this, mm: stored heights
/// round.
const CUT: f64 = 1.0e-4;

/// A centre nearer to the outline than this, mm, is on it.
const ON_OUTLINE: f64 = 1.0e-9;

/// The block is drawn in by this, mm, so that no sliver of stock is left where it ends at an open side.
const EDGE: f64 = 1.0e-5;

/// Sloped moves of cutters with corners are looked at in so many parts.
const PARTS: u32 = 32;

/// Moves that cross a wall are looked at in places this far apart over the radius, and in so many at most.
const PLACES_APART: f64 = 0.05;
const MOST_PLACES: f64 = 512.0;

/// Halvings in search of the radius at a height.
const HALVINGS: usize = 60;

/// A stretch of passes above the engagement that was asked for.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ExceedingStretch {
    /// Where it begins: the tip.
    pub x: f64,
    /// y.
    pub y: f64,
    /// z.
    pub z: f64,
    /// Its length.
    pub length_mm: f64,
    /// The greatest angle on it; its error is bounded as that of [`EngagementFigures::max_engagement_deg`].
    pub max_engagement_deg: f64,
    /// Its first move, counted from 0.
    pub first_move: u32,
    /// Its line in the program.
    pub line: Option<u32>,
}

/// The engagement of passes with thinner layers of stock counted than in what is judged.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ThinLayers {
    /// Layers from this thickness on count.
    pub counted_from_mm: f64,
    /// Greatest angle of the cutter's circumference in stock along passes.
    pub max_engagement_deg: f64,
    /// Bound of its error.
    pub max_engagement_error_bound_deg: f64,
    /// The move with the greatest angle, counted from 0.
    pub max_engagement_move: u32,
    /// Length of passes above the limit.
    pub over_engagement_limit_mm: f64,
    /// The stretches above it, the one with the greatest angle first and [`PocketFigures::LISTED`] at most.
    pub over_engagement_limit: Vec<ExceedingStretch>,
    /// How many there are.
    pub over_engagement_limit_count: usize,
}

/// Figures of a pocket.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct PocketFigures {
    /// Area of the region.
    pub area_mm2: f64,
    /// Area of it that no position of the cutter reaches: its corners.
    pub unreachable_area_mm2: f64,
    /// Distance of passes, where they were planned here.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stepover_mm: Option<f64>,
    /// Farthest that the cutter's radius came beyond the outline in the plan view, of all moves, in closed
    /// form; 0 when none did.
    pub wall_gouge_mm: f64,
    /// Bound of its error: chords of the drawing's curves, and arcs of the program.
    pub wall_gouge_error_bound_mm: f64,
    /// The move that came so far, counted from 0.
    pub wall_gouge_move: u32,
    /// Farthest centre of a cut cell beyond the outline.
    pub wall_gouge_of_cells_mm: f64,
    /// How much farther a cut may reach between centres.
    pub wall_gouge_of_cells_error_bound_mm: f64,
    /// Area of the cut cells beyond the outline.
    pub wall_gouge_area_mm2: f64,
    /// Thickest material on the walls that the cutter comes to, along their normals.
    pub wall_uncut_mm: f64,
    /// Bound of its error; `None` where no move comes near, so that it is no thinner.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wall_uncut_error_bound_mm: Option<f64>,
    /// Where it stands in the plan view, if anything does.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wall_uncut_at_mm: Option<[f64; 2]>,
    /// The engagement, where passes were planned here.
    #[serde(flatten)]
    pub engagement: Option<EngagementFigures>,
}

/// The engagement of passes.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct EngagementFigures {
    /// Greatest angle of the cutter's circumference in stock along passes, ways down left out.
    pub max_engagement_deg: f64,
    /// Bound of its error.
    pub max_engagement_error_bound_deg: f64,
    /// Thinner layers of stock beside ground that was cut before do not count in it.
    pub uncounted_layer_mm: f64,
    /// The move with the greatest angle, counted from 0.
    pub max_engagement_move: u32,
    /// 95 % of the cutting length have less.
    pub p95_engagement_deg: f64,
    /// Angle that passes are planned within, if one was asked for; above it the feed falls.
    pub engagement_limit_deg: f64,
    /// Share of the cutting length above it.
    pub over_engagement_limit_fraction: f64,
    /// The stretches above it, the longest first and [`LISTED`](PocketFigures::LISTED) at most; none where no
    /// engagement was asked for.
    pub over_engagement_limit: Vec<ExceedingStretch>,
    /// How many there are.
    pub over_engagement_limit_count: usize,
    /// The engagement with thinner layers counted, where one was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub thin_layers: Option<ThinLayers>,
}

impl PocketFigures {
    /// Stretches that are listed at most.
    pub const LISTED: usize = 100;
}

/// A cut beyond walls.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct WallGouge {
    /// How far the cutter came beyond the outline for certain, mm.
    pub depth: f64,
    /// How much farther it may have come, mm.
    pub error_bound: f64,
    /// The move that came so far, counted from 0.
    pub move_index: u32,
}

/// The stock of a block beside what a cutter may sweep: what moves must not cut.
pub fn stock_beside(free: &Region, block: &Aabb) -> RegionIndex {
    let (min, max) = (block.min.xy() + Vector2::repeat(EDGE), block.max.xy() - Vector2::repeat(EDGE));
    let outer = vec![min, Point2::new(max.x, min.y), max, Point2::new(min.x, max.y)];
    let whole = Region { pieces: vec![Piece { outer, islands: Vec::new() }] };
    RegionIndex::new(whole.without(free))
}

/// How far a cutter came into the [stock beside](stock_beside) a pocket, and on which move: every move below
/// `top`, mm.
///
/// # Errors
/// [`Cancelled`] when the monitor says so.
pub fn wall_gouge_of_moves(
    beside: &RegionIndex,
    cutter: &Cutter,
    path: &Toolpath,
    top: f64,
    monitor: &dyn Monitor,
) -> Result<WallGouge, Cancelled> {
    let depths = parallel::try_map(path.len(), |k| {
        monitor::check(monitor)?;
        Ok(depth_beyond(beside, cutter, [path.start_of(k), path.moves[k].to.tip], top))
    })?;
    let mut worst = WallGouge::default();
    for (k, [depth, _]) in depths.iter().enumerate() {
        if *depth > worst.depth {
            (worst.depth, worst.move_index) = (*depth, k as u32);
        }
    }
    // What rounding leaves is none.
    if worst.depth < 1e-9 {
        worst = WallGouge::default();
    }
    let most = depths.iter().map(|depth| depth[1]).fold(0.0, f64::max);
    let more = most - worst.depth;
    Ok(WallGouge { error_bound: if more < 1e-9 { 0.0 } else { more }, ..worst })
}

/// How far a straight move comes into stock for certain, and at most, mm.
fn depth_beyond(beside: &RegionIndex, cutter: &Cutter, [a, b]: [Point3; 2], top: f64) -> [f64; 2] {
    if a.z.min(b.z) >= top {
        return [0.0; 2];
    }
    // Above the stock nothing is cut.
    let below = |from: &Point3, to: &Point3| {
        if from.z <= top { *from } else { to + (from - to) * ((top - to.z) / (from.z - to.z)) }
    };
    let (a, b) = (below(&a, &b), below(&b, &a));
    let parts = if a.z == b.z || a.xy() == b.xy() || cutter.side_height() <= 0.0 { 1 } else { PARTS };
    let at = |k: u32| a + (b - a) * (f64::from(k) / f64::from(parts));
    let all = (0..parts).map(|k| part_beyond(beside, cutter, [at(k), at(k + 1)], top));
    all.fold([0.0f64; 2], |most, one| [0, 1].map(|k| most[k].max(one[k])))
}

/// The same of a part of a move below the top, on which the cutter's radius there changes little.
fn part_beyond(beside: &RegionIndex, cutter: &Cutter, [a, b]: [Point3; 2], top: f64) -> [f64; 2] {
    let radius_at = |z: f64| radius_below(cutter, top - z);
    let (wide, narrow) = (radius_at(a.z.min(b.z)), radius_at(a.z.max(b.z)));
    let ends = [a.xy(), b.xy()];
    // A straight way down is as wide as at its foot.
    let narrow = if ends[0] == ends[1] { wide } else { narrow };
    let reach = Vector2::repeat(wide);
    let around = [ends[0].inf(&ends[1]) - reach, ends[0].sup(&ends[1]) + reach];
    let mut nearest = wide;
    let sides = beside.sides();
    sides.near(&around, |s| {
        nearest = nearest.min(distance_of_segments(&ends, &sides.segments()[s as usize].ends));
    });
    if nearest > 0.0 && !beside.contains(&ends[0]) {
        return [narrow - nearest, wide - nearest];
    }
    let length = (ends[1] - ends[0]).norm();
    let count = (length / (PLACES_APART * wide)).ceil().clamp(1.0, MOST_PLACES);
    let of = |k: usize| beside.depth(&(ends[0] + (ends[1] - ends[0]) * (k as f64 / count)));
    let deepest = (0..=count as usize).map(of).fold(f64::NEG_INFINITY, f64::max);
    [narrow + deepest, wide + deepest + 0.5 * length / count]
}

/// The greatest radius that a cutter has up to some height above its tip, mm.
pub fn radius_below(cutter: &Cutter, height: f64) -> f64 {
    if height >= cutter.side_height() {
        return cutter.radius();
    }
    let (mut within, mut beyond) = (0.0, cutter.radius());
    for _ in 0..HALVINGS {
        let middle = 0.5 * (within + beyond);
        let is_within = cutter.height(middle).is_some_and(|above| above <= height);
        *(if is_within { &mut within } else { &mut beyond }) = middle;
    }
    beyond
}

/// Farthest centre of a cut cell outside of the region and the area of all such cells, mm and mm².
///
/// # Errors
/// [`Cancelled`] when the monitor says so.
pub fn wall_gouge_of_cells(
    region: &Region,
    cut: &ZMap,
    top: f64,
    monitor: &dyn Monitor,
) -> Result<(f64, f64), Cancelled> {
    let walls = SegmentGrid::of_curves(region.curves());
    let grid = &cut.grid;
    let rows = parallel::try_map(grid.ny, |j| {
        monitor::check(monitor)?;
        let y = grid.centre(0, j).y;
        let mut crossings: Vec<f64> = walls
            .segments()
            .iter()
            .filter(|s| (s.ends[0].y > y) != (s.ends[1].y > y))
            .map(|s| {
                s.ends[0].x + (y - s.ends[0].y) / (s.ends[1].y - s.ends[0].y) * (s.ends[1].x - s.ends[0].x)
            })
            .collect();
        crossings.sort_by(f64::total_cmp);
        let (mut farthest, mut count, mut passed) = (0.0f64, 0usize, 0usize);
        for i in 0..grid.nx {
            let centre = grid.centre(i, j);
            while passed < crossings.len() && crossings[passed] <= centre.x {
                passed += 1;
            }
            if passed % 2 == 0 && f64::from(cut.height[grid.index(i, j)]) < top - CUT {
                let beyond = walls.distance(&centre);
                if beyond > ON_OUTLINE {
                    farthest = farthest.max(beyond);
                    count += 1;
                }
            }
        }
        Ok((farthest, count))
    })?;
    let farthest = rows.iter().map(|r| r.0).fold(0.0, f64::max);
    let count: usize = rows.iter().map(|r| r.1).sum();
    Ok((farthest, count as f64 * grid.cell * grid.cell))
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::Point2;
    use geometry::Point3;
    use motion::{ClPoint, Move, MoveKind};
    use sim::{Grid, cut};
    use work::monitor::Silent;

    /// A straight pass planted nearer to the wall than the radius, and one right through it.
    #[test]
    fn cuts_beyond_the_outline_are_found_by_moves_and_by_cells() {
        let square = [(0.0, 0.0), (30.0, 0.0), (30.0, 20.0), (0.0, 20.0)].map(|(x, y)| Point2::new(x, y));
        let region = Region::nested(vec![square.to_vec()]).unwrap().0;
        let block = Aabb { min: Point3::new(-9.0, -9.0, -9.0), max: Point3::new(39.0, 29.0, 0.0) };
        let beside = stock_beside(&region, &block);
        let cutter = Cutter::flat(6.0).unwrap();
        let grid = Grid { origin: Point2::new(-6.97, -6.97), cell: 0.05, nx: 860, ny: 660 };
        let measured = |y: f64, x: f64| {
            let to = |x: f64, y: f64, z: f64| Move {
                to: ClPoint::upright(Point3::new(x, y, z)),
                kind: MoveKind::Cut,
                feed_rate: 1.0,
                pass: 0,
            };
            let path = Toolpath::new(
                ClPoint::upright(Point3::new(10.0, 10.0, 5.0)),
                vec![to(10.0, 10.0, -2.0), to(10.0, y, -2.0), to(x, y, -2.0)],
            );
            let stock = cut(ZMap::block(grid, 0.0), &cutter, &path, &Silent).unwrap();
            let cells = wall_gouge_of_cells(&region, &stock, 0.0, &Silent).unwrap();
            let gouge = wall_gouge_of_moves(&beside, &cutter, &path, 0.0, &Silent).unwrap();
            ((gouge.depth, gouge.move_index), cells)
        };
        assert_eq!(measured(3.0, 27.0), ((0.0, 0), (0.0, 0.0)));
        let ((exact, _), (cells, area)) = measured(2.8, 20.0);
        assert!(
            (exact - 0.2).abs() < 1e-12 && cells <= exact && cells > exact - 0.05 * 1.5,
            "{exact} {cells}"
        );
        // A strip of 10 mm and the two caps of the discs at its ends.
        let cap = 2.0 * (9.0 * (2.8f64 / 3.0).acos() - 2.8 * (9.0 - 2.8f64 * 2.8).sqrt()) / 2.0;
        assert!((area - (10.0 * 0.2 + cap)).abs() < 0.25, "{area}");
        let ((exact, at), (cells, _)) = measured(10.0, 32.0);
        assert!((exact - 5.0).abs() < 1e-12 && at == 2 && (cells - 5.0).abs() < 0.075, "{exact} {cells}");
    }
    /// A program mills an island away, comes from beside the stock, leaves over the top, and goes down beside
    /// a wall with the round of a ball.
    #[test]
    fn moves_from_anywhere_are_held_against_walls() {
        let rectangle = |x: [f64; 2], y: [f64; 2]| {
            [(x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1])].map(|(x, y)| Point2::new(x, y)).to_vec()
        };
        let curves = vec![rectangle([0.0, 30.0], [0.0, 30.0]), rectangle([10.0, 20.0], [11.0, 21.0])];
        let region = Region::nested(curves).unwrap().0;
        let block = Aabb { min: Point3::new(-3.0, -3.0, -7.0), max: Point3::new(33.0, 33.0, 0.0) };
        let beside = stock_beside(&region, &block);
        let of = |cutter: &Cutter, tips: &[(f64, f64, f64)]| {
            let at = |&(x, y, z): &(f64, f64, f64)| ClPoint::upright(Point3::new(x, y, z));
            let to = |tip| Move { to: at(tip), kind: MoveKind::Rapid, feed_rate: 1.0, pass: 0 };
            let path = Toolpath::new(at(&tips[0]), tips[1..].iter().map(to).collect());
            wall_gouge_of_moves(&beside, cutter, &path, 0.0, &Silent).unwrap()
        };
        let flat = Cutter::flat(6.0).unwrap();
        // Amid the island: half of its width, and the radius.
        let across = of(&flat, &[(4.0, 15.0, -2.0), (26.0, 15.0, -2.0)]);
        assert!(across.depth <= 7.0 + 1e-9 && across.depth + across.error_bound >= 7.0, "{across:?}");
        assert!(across.error_bound < 0.1 && across.move_index == 0, "{across:?}");
        // Beside the block, and over it down to beside a wall.
        let none = WallGouge::default();
        assert_eq!(of(&flat, &[(-9.0, 15.0, 2.0), (-6.0, 15.0, -2.0), (-6.0, 40.0, -2.0)]), none);
        assert_eq!(of(&flat, &[(-9.0, 3.0, 6.0), (9.0, 3.0, -3.0)]).depth, 0.0);
        let into = of(&flat, &[(-9.0, 15.0, 2.0), (-5.5, 15.0, 2.0), (-5.5, 15.0, -2.0)]);
        assert!((into.depth - 0.5).abs() < 2.0 * EDGE && into.move_index == 1, "{into:?}");
        // A ball is as wide at the top as its round: it cuts beyond the wall once it is too deep.
        let ball = Cutter::ball(6.0).unwrap();
        let wide = |deep: f64| (6.0 * deep - deep * deep).sqrt();
        assert_eq!(of(&ball, &[(1.5, 15.0, 2.0), (1.5, 15.0, -0.3)]), none);
        let deeper = of(&ball, &[(1.5, 15.0, 2.0), (1.5, 15.0, -0.6)]);
        assert!((deeper.depth - (wide(0.6) - 1.5)).abs() < 1e-9 && deeper.error_bound == 0.0, "{deeper:?}");
        let sloped = of(&ball, &[(1.5, 15.0, 2.0), (1.5, 15.0, -0.2), (1.5, 25.0, -0.6)]);
        assert!(
            (sloped.depth + sloped.error_bound - deeper.depth).abs() < 1e-9 && sloped.error_bound < 0.03,
            "{sloped:?}"
        );
    }
}
