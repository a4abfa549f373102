//! Walls of a block against closed forms.

use super::*;
use crate::measure::measure_with_walls;
use crate::{Asked, Judged, Measurement};
use cutter::Cutter;
use geometry::TriangleMesh;
use sim::scenes::path_through;
use sim::{ZMap, cut};
use work::monitor::Silent;

/// Height and size of the block along x and y, mm.
const HEIGHT: f64 = 5.0;
const SIZE: [f64; 2] = [20.0, 12.0];
const LIMITS: Limits = Limits { scallop: 0.01, gouge: 0.005, uncut: 0.05, chord: 0.001 };

/// A block over a plane of rectangles: `heights` of each of 3 x 3, whose borders are `at` along x and y.
fn steps(at: [[f64; 4]; 2], heights: [[f64; 3]; 3]) -> Part {
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    let mut quad = |corners: [[f64; 3]; 4]| {
        let first = vertices.len() as u32;
        vertices.extend(corners.map(Point3::from));
        triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    };
    let height = |i: i32, j: i32| {
        let inside = (0..3).contains(&i) && (0..3).contains(&j);
        if inside { heights[j as usize][i as usize] } else { 0.0 }
    };
    for (i, j) in (0..3).flat_map(|j| (0..3).map(move |i| (i, j))) {
        let [x0, x1] = [at[0][i as usize], at[0][i as usize + 1]];
        let [y0, y1] = [at[1][j as usize], at[1][j as usize + 1]];
        let z = height(i, j);
        quad([[x0, y0, z], [x1, y0, z], [x1, y1, z], [x0, y1, z]]);
        quad([[x0, y0, 0.0], [x0, y1, 0.0], [x1, y1, 0.0], [x1, y0, 0.0]]);
        // Walls where the neighbour is lower, from its height up.
        let sides = [
            (i + 1, j, [[x1, y0], [x1, y1]]),
            (i - 1, j, [[x0, y1], [x0, y0]]),
            (i, j + 1, [[x1, y1], [x0, y1]]),
            (i, j - 1, [[x0, y0], [x1, y0]]),
        ];
        for (ni, nj, [[ax, ay], [bx, by]]) in sides {
            let low = height(ni, nj);
            if low < z {
                quad([[ax, ay, low], [bx, by, low], [bx, by, z], [ax, ay, z]]);
            }
        }
    }
    Part::from_mesh(TriangleMesh::new(vertices, triangles).unwrap().0)
}

fn block() -> Part {
    let [x, y] = SIZE;
    steps([[0.0, 5.0, 15.0, x], [0.0, 4.0, 8.0, y]], [[HEIGHT; 3]; 3])
}

fn measured(part: &Part, cutter: &Cutter, path: &Toolpath) -> Measurement {
    measured_on(0.1, part, cutter, path)
}

fn measured_on(cell: f64, part: &Part, cutter: &Cutter, path: &Toolpath) -> Measurement {
    let mut area = part.bounds();
    (area.min.x, area.min.y, area.max.x, area.max.y) =
        (area.min.x - 2.0, area.min.y - 2.0, area.max.x + 2.0, area.max.y + 2.0);
    area.max.z += 1.0;
    let grid = Grid::covering(&area, cell, 8, 1 << 30).unwrap();
    let cut = cut(ZMap::block(grid, area.max.z), cutter, path, &Silent).unwrap();
    let asked = Asked {
        allowed_depth: 0.0,
        error_bound: 5e-4,
        border_cuts: true,
        steep_elsewhere: false,
        most_cells: 1 << 20,
        most_squares: 1 << 20,
        is_first_look: false,
    };
    let facing = Facing::new(part, path, area);
    assert!(facing.is_judged(Judged::Walls, PlaceKind::Wall));
    measure_with_walls(part, &cutter.into(), path, &cut, &LIMITS, &asked, Some(&facing), &Silent).unwrap()
}

/// Rows over the top, at the height of `z`, and a way around at the tip height `below` whose sides are `off`
/// from the walls.
fn faced_and_around(radius: f64, z: f64, off: [f64; 4], below: f64) -> Toolpath {
    let [x, y] = SIZE;
    let rows = (0..=6).flat_map(|k| {
        let at = -1.0 + 2.4 * f64::from(k);
        let ends = if k % 2 == 0 { [-4.0, x + 4.0] } else { [x + 4.0, -4.0] };
        ends.map(|end| Point3::new(end, at, z))
    });
    let [x0, y0, x1, y1] = [-radius - off[0], -radius - off[1], x + radius + off[2], y + radius + off[3]];
    let up = Point3::new(x0, y0, 20.0);
    let around = [[x0, y0], [x1, y0], [x1, y1], [x0, y1], [x0, y0]].map(|[a, b]| Point3::new(a, b, below));
    let lifted = Point3::new(x + 4.0, 13.4, 20.0);
    path_through(rows.chain([lifted, up]).chain(around))
}

#[test]
fn a_sound_block_has_no_gouge_and_nothing_uncut() {
    let measured =
        measured(&block(), &Cutter::flat(6.0).unwrap(), &faced_and_around(3.0, HEIGHT, [0.0; 4], 0.0));
    assert!(measured.gouge.max_depth_mm < 1e-6 && measured.uncut.region_count == 0, "{:?}", measured.gouge);
    assert!(measured.excess.highest.at_most() < 2e-3, "{:?}", measured.excess);
}

#[test]
fn a_cut_into_a_wall_is_as_deep_as_it_goes_along_the_normal() {
    for depth in [0.003, 0.02, 0.4] {
        let path = faced_and_around(3.0, HEIGHT, [0.0, 0.0, -depth, 0.0], 0.0);
        let measured = measured(&block(), &Cutter::flat(6.0).unwrap(), &path);
        let gouge = &measured.gouge;
        assert!(
            (gouge.max_depth_mm - depth).abs() < 1e-6 && gouge.error_bound_mm < 2e-3,
            "{depth} {gouge:?}"
        );
        if depth > LIMITS.gouge {
            assert!((gouge.regions[0].at_mm[0] - SIZE[0]).abs() < 1e-9, "{gouge:?}");
        }
        assert!(
            measured.uncut.region_count == 0 && measured.excess.highest.at_most() < 2e-3,
            "{:?}",
            measured.excess
        );
    }
}

#[test]
fn what_stands_before_a_wall_is_as_high_as_it_is_thick() {
    for thick in [0.004, 0.03, 0.3] {
        let path = faced_and_around(3.0, HEIGHT, [thick, 0.0, 0.0, 0.0], 0.0);
        let measured = measured(&block(), &Cutter::flat(6.0).unwrap(), &path);
        let highest = measured.excess.highest;
        assert!(
            (highest.max_mm - thick).abs() < 1e-6 && highest.error_bound_mm < 2e-3,
            "{thick} {highest:?}"
        );
        assert_eq!(measured.uncut.region_count, usize::from(thick > LIMITS.uncut), "{:?}", measured.uncut);
        assert!(measured.gouge.max_depth_mm < 1e-6, "{:?}", measured.gouge);
    }
}

/// A ball that dips into the top cuts the uppermost line of each wall wide, and no deeper than the top.
#[test]
fn a_cut_over_the_edge_of_a_top_is_no_deeper_than_below_it() {
    let depth = 0.02;
    let mut path = faced_and_around(3.0, HEIGHT, [0.0; 4], 0.0);
    path.moves.extend(
        path_through(
            [[-5.0, 6.0, 20.0], [-5.0, 6.0, HEIGHT - depth], [25.0, 6.0, HEIGHT - depth]].map(Point3::from),
        )
        .moves,
    );
    let part = block();
    let flat = measured(&part, &Cutter::flat(6.0).unwrap(), &path);
    assert!((flat.gouge.max_depth_mm - depth).abs() < 1e-6, "{:?}", flat.gouge);
    let ball = measured(&part, &Cutter::ball(6.0).unwrap(), &path);
    assert!((ball.gouge.max_depth_mm - depth).abs() < 1e-6, "{:?}", ball.gouge);
}

/// In an inner corner a cutter of radius r leaves material that is farthest from both walls on the diagonal:
/// r (1 - 1/√2).
#[test]
fn an_inner_corner_keeps_what_the_cutter_does_not_reach() {
    let part = steps(
        [[0.0, 5.0, 15.0, 20.0], [0.0, 4.0, 14.0, 18.0]],
        [[5.0, 5.0, 5.0], [5.0, 1.0, 5.0], [5.0, 5.0, 5.0]],
    );
    let (radius, floor) = (2.0, 1.0);
    let rows = (0..=4).flat_map(|k| {
        let y = 6.0 + 1.5 * f64::from(k);
        let ends = if k % 2 == 0 { [7.0, 13.0] } else { [13.0, 7.0] };
        ends.map(|x| Point3::new(x, y, floor))
    });
    let around = [[7.0, 12.0], [7.0, 6.0], [13.0, 6.0], [13.0, 12.0], [7.0, 12.0]]
        .map(|[x, y]| Point3::new(x, y, floor));
    let over = [[7.0, 12.0, 20.0], [-4.0, -1.0, 20.0]].map(Point3::from);
    let top = (0..=7).flat_map(|k| {
        let y = -1.0 + 3.0 * f64::from(k);
        let ends = if k % 2 == 0 { [-4.0, 24.0] } else { [24.0, -4.0] };
        ends.map(|x| Point3::new(x, y, 5.0))
    });
    let outside = [
        [-4.0, 20.0, 20.0],
        [-2.0, -2.0, 20.0],
        [-2.0, -2.0, 0.0],
        [22.0, -2.0, 0.0],
        [22.0, 20.0, 0.0],
        [-2.0, 20.0, 0.0],
        [-2.0, -2.0, 0.0],
    ]
    .map(Point3::from);
    let path = path_through(rows.chain(around).chain(over).chain(top).chain(outside));
    let measured = measured(&part, &Cutter::flat(2.0 * radius).unwrap(), &path);
    let exact = radius * (1.0 - 0.5f64.sqrt());
    assert!((measured.uncut.max_height_mm - exact).abs() < 2e-3, "{exact} {:?}", measured.uncut);
    assert_eq!(measured.uncut.region_count % 4, 0, "{:?}", measured.uncut);
    assert!(measured.gouge.max_depth_mm < 1e-6, "{:?}", measured.gouge);
    assert!(measured.excess.unreached.error_bound_mm < 2e-3, "{:?}", measured.excess);
}

/// A step from a floor at z = 1 up to `high` over it, along y = 4 on `length` mm, as a cutter of a radius
/// leaves it: rows over the top, rows over the floor from `aside` before the step on, and once around the
/// outer walls.
fn step(length: f64, high: f64, radius: f64, aside: f64) -> (Part, Toolpath) {
    let floor = 1.0;
    let top = floor + high;
    let part = steps(
        [[0.0, length / 3.0, length / 1.5, length], [0.0, 4.0, 6.0, 8.0]],
        [[floor; 3], [top; 3], [top; 3]],
    );
    let rows = |from: f64, z: f64| {
        (0..=40).flat_map(move |k| {
            let ends = if k % 2 == 0 { [-3.0, length + 3.0] } else { [length + 3.0, -3.0] };
            ends.map(|x| Point3::new(x, from - 0.1 * f64::from(k), z))
        })
    };
    let [low, far] = [-radius, length + radius];
    let around = [[low, low], [far, low], [far, 8.0 + radius], [low, 8.0 + radius], [low, low]];
    let around = around.map(|[x, y]| Point3::new(x, y, -radius));
    let above = |x: f64, y: f64| [Point3::new(x, y, 20.0)];
    let path = path_through(
        rows(8.0, top)
            .chain(above(-3.0, 4.0 - aside))
            .chain(rows(4.0 - aside, floor))
            .chain(above(low, low))
            .chain(around),
    );
    (part, path)
}

/// The facets of a long wall meet aslant: beside the lower one, far below the top, the wall above it stands
/// before the floor as well.
#[test]
fn floors_beside_facets_that_meet_aslant_belong_to_the_wall() {
    let radius = 3.0;
    let cutter = Cutter::flat(2.0 * radius).unwrap();
    for (cell, thick) in [(0.1, 0.02), (0.05, 0.02), (0.1, 0.3)] {
        let (part, path) = step(90.0, 1.0, radius, radius + thick);
        let measured = measured_on(cell, &part, &cutter, &path);
        let highest = measured.excess.highest;
        assert!((highest.max_mm - thick).abs() < 1e-6 && highest.error_bound_mm < 2e-3, "{cell} {highest:?}");
        assert_eq!(measured.uncut.region_count > 0, thick > LIMITS.uncut, "{:?}", measured.uncut);
    }
}

/// What a ball leaves at the foot of a step that is little higher than the uncut tolerance is the same on all
/// cells: the floor's up to the uncut tolerance, and above that a few µm before the wall.
#[test]
fn what_stands_at_the_foot_of_a_low_step_does_not_depend_on_cells() {
    let (radius, aside) = (1.5f64, 0.41);
    let high = radius - (radius * radius - aside * aside).sqrt();
    let (part, path) = step(9.0, high, radius, aside);
    let cutter = Cutter::ball(2.0 * radius).unwrap();
    assert!(high > LIMITS.uncut + 5e-3, "{high}");
    for cell in [0.15, 0.1, 0.05, 0.03] {
        let found = measured_on(cell, &part, &cutter, &path).excess;
        assert!((found.highest.max_mm - LIMITS.uncut).abs() < 1e-3, "{cell} {found:?}");
        assert!(found.highest.error_bound_mm < 2e-3, "{cell} {found:?}");
    }
}

/// A ring of facets whose section is a polygon of radii, at mid-facet, and heights.
fn turned(facets: usize, section: &[[f64; 2]]) -> Part {
    let vertices =
        section.iter().flat_map(|&[r, z]| (0..facets).map(move |k| corner(facets, r, k, z))).collect();
    let triangles = (0..section.len())
        .flat_map(|ring| (0..facets).map(move |k| (ring, k)))
        .flat_map(|(ring, k)| {
            let at = |ring: usize, k: usize| (ring % section.len() * facets + k % facets) as u32;
            let [a, b, c, d] = [at(ring, k), at(ring + 1, k), at(ring + 1, k + 1), at(ring, k + 1)];
            [[a, c, b], [a, d, c]]
        })
        .collect();
    Part::from_mesh(TriangleMesh::new(vertices, triangles).unwrap().0)
}

/// A corner of a regular polygon, the middles of whose sides lie `apothem` from the axis.
fn corner(sides: usize, apothem: f64, k: usize, z: f64) -> Point3 {
    let turn = std::f64::consts::TAU / sides as f64;
    let (sin, cos) = (turn * k as f64).sin_cos();
    let r = apothem / (0.5 * turn).cos();
    Point3::new(r * cos, r * sin, z)
}

/// Once around such a polygon, from above and back.
fn once_around(sides: usize, apothem: f64, z: f64) -> impl Iterator<Item = Point3> {
    let above = corner(sides, apothem, 0, 20.0);
    let around = (0..=sides).map(move |k| corner(sides, apothem, k, z));
    std::iter::once(above).chain(around).chain([above])
}

/// Rows over all that lies so far around the axis, at the height of the blocks.
fn faced(far: f64) -> impl Iterator<Item = Point3> {
    (0..=16).flat_map(move |k| {
        let y = far * (0.125 * f64::from(k) - 1.0);
        let ends = if k % 2 == 0 { [-far, far, far] } else { [far, -far, -far] };
        let heights = if k == 16 { [HEIGHT, HEIGHT, 20.0] } else { [HEIGHT; 3] };
        (0..3).map(move |end| Point3::new(ends[end], y, heights[end]))
    })
}

/// A round plate of facets from z = 0 up, with a round hole of as many, whose mid-facets lie `radius` from
/// the axis; and how a flat that is as wide as the hole cuts its outer wall and, down to `bottom`, the hole.
fn drilled(facets: usize, radius: f64, bottom: Option<f64>) -> (Part, Cutter, Toolpath) {
    let part =
        turned(facets, &[[radius, 0.0], [3.0 * radius, 0.0], [3.0 * radius, HEIGHT], [radius, HEIGHT]]);
    let hole = bottom.into_iter().flat_map(|z| [20.0, z, 20.0].map(|z| Point3::new(0.0, 0.0, z)));
    let around = once_around(facets, 4.0 * radius, 0.0);
    let path = path_through(faced(3.0 * radius + 3.0).chain(around).chain(hole));
    (part, Cutter::flat(2.0 * radius).unwrap(), path)
}

/// What is left in a hole stands out from its wall by the hole's radius, however narrow the facets are beside
/// the cells.
#[test]
fn a_plug_left_in_a_round_hole_stands() {
    let radius = 1.5;
    for (facets, bottom, cell) in
        [(12, None, 0.2), (48, None, 0.2), (48, None, 0.05), (48, Some(3.0), 0.1), (300, Some(3.0), 0.1)]
    {
        let (part, cutter, path) = drilled(facets, radius, bottom);
        let Measurement { uncut, excess, .. } = measured_on(cell, &part, &cutter, &path);
        let wide = std::f64::consts::TAU * radius * bottom.unwrap_or(HEIGHT);
        let off = (uncut.max_height_mm - radius).abs();
        assert!(off < 2e-3 && uncut.error_bound_mm < 2e-3, "{facets} {bottom:?} {cell} {uncut:?}");
        assert!((uncut.area_mm2 - wide).abs() < 0.1 * wide, "{facets} {bottom:?} {cell} {uncut:?} {wide}");
        assert!(excess.unreached.at_most() > LIMITS.uncut, "{excess:?}");
    }
}

/// A flat as wide as a hole leaves the corners between its facets, and nothing else.
#[test]
fn a_drilled_hole_holds_no_more_than_its_corners() {
    let radius = 1.5;
    for (facets, cell) in [(48, 0.2), (48, 0.05), (300, 0.1)] {
        let (part, cutter, path) = drilled(facets, radius, Some(-0.5));
        let Measurement { uncut, excess, gouge, .. } = measured_on(cell, &part, &cutter, &path);
        let corner = radius / (std::f64::consts::PI / facets as f64).cos() - radius;
        assert!(uncut.region_count == 0 && gouge.max_depth_mm < 1e-6, "{facets} {cell} {uncut:?} {gouge:?}");
        assert!(excess.highest.at_most() < corner + 2e-3, "{facets} {cell} {excess:?} {corner}");
    }
}
/// A ring with a floor at z = 1 before a round wall whose corners lie 4 mm from the axis, inside of it (a
/// pocket) or outside (a boss). A flat of 2 mm follows the true circle and leaves `thick` on it.
fn round_wall(facets: usize, is_pocket: bool, thick: f64) -> (Part, Cutter, Toolpath) {
    const SIDES: usize = 2000;
    let (tool, hole, wall, out, floor) = (1.0, 1.0, 4.0, 7.0, 1.0);
    let at = wall * (std::f64::consts::PI / facets as f64).cos();
    let [inner, outer] = if is_pocket { [floor, HEIGHT] } else { [HEIGHT, floor] };
    let section = [[hole, 0.0], [out, 0.0], [out, outer], [at, outer], [at, inner], [hole, inner]];
    let part = turned(facets, &section);
    let side = if is_pocket { -1.0 } else { 1.0 };
    let last = wall + side * (tool + thick);
    let rings = [last + side * 2.6, last + side * 1.3, last];
    let rings = rings.into_iter().filter(move |r| *r > 0.0);
    let floors = rings.flat_map(move |r| once_around(SIDES, r, floor));
    let drilled = [20.0, -0.5, 20.0].map(|z| Point3::new(0.0, 0.0, z));
    let path = faced(out + 2.0).chain(once_around(facets, out + tool, 0.0)).chain(floors).chain(drilled);
    (part, Cutter::flat(2.0 * tool).unwrap(), path_through(path))
}

/// A cutter that follows a circle leaves what the circle is off the facets, and what it keeps off the circle.
#[test]
fn what_is_left_on_a_round_wall_is_as_high_as_it_is_thick() {
    for (facets, cell) in [(120, 0.1), (400, 0.05)] {
        let sagitta = 4.0 * (1.0 - (std::f64::consts::PI / facets as f64).cos());
        for (is_pocket, thick) in [(true, 0.0), (true, 0.001), (true, 0.03), (false, 0.0), (false, 0.01)] {
            let (part, cutter, path) = round_wall(facets, is_pocket, thick);
            let Measurement { uncut, excess, gouge, .. } = measured_on(cell, &part, &cutter, &path);
            let [left, cut] = if is_pocket { [thick, sagitta - thick] } else { [thick + sagitta, -thick] };
            let told = format!("{facets} {is_pocket} {thick} {uncut:?} {excess:?} {gouge:?}");
            assert!(uncut.region_count == 0, "{told}");
            assert!((excess.highest.max_mm - left).abs() < 2e-3, "{left} {told}");
            assert!(excess.highest.at_most() < left + 3e-3, "{left} {told}");
            assert!((gouge.max_depth_mm - cut.max(0.0)).abs() < 2e-3, "{cut} {told}");
        }
    }
}

/// A flat that runs along a wall touches the end of the walls across it, and cuts nothing there.
#[test]
fn a_cutter_that_touches_a_wall_cuts_none_across_it() {
    let floor = 1.0;
    for depth in [0.0, 1e-7, 0.02] {
        let part = steps([[0.0, 7.0, 15.0, 20.0], [0.0, 4.0, 8.0, 12.0]], [[floor, HEIGHT, HEIGHT]; 3]);
        let mut path = faced_and_around(3.0, HEIGHT, [0.0; 4], 0.0);
        let x = 4.0 + depth;
        let rows = [[0.5, 20.0], [0.5, floor]].map(|[x, z]| [x, -8.0, z]);
        let along = [[0.5, 20.0, floor], [x, 20.0, floor], [x, -8.0, floor], [x, -8.0, 20.0]];
        path.moves.extend(path_through(rows.into_iter().chain(along).map(Point3::from)).moves);
        let measured = measured(&part, &Cutter::flat(6.0).unwrap(), &path);
        let deepest = measured.gouge.max_depth_mm;
        assert!((deepest - depth).abs() < 2e-6, "{depth} {:?}", measured.gouge);
    }
}

/// A block whose plan is a polygon of corners that turn left, from z = 0 to a height.
fn prism(corners: &[[f64; 2]], high: f64) -> Part {
    let n = corners.len() as u32;
    let ring = |z: f64| corners.iter().map(move |&[x, y]| Point3::new(x, y, z));
    let walls = (0..n).flat_map(|k| {
        let next = (k + 1) % n;
        [[k, next, n + next], [k, n + next, n + k]]
    });
    let ends = (1..n - 1).flat_map(|k| [[0, k + 1, k], [n, n + k, n + k + 1]]);
    let triangles = walls.chain(ends).collect();
    Part::from_mesh(TriangleMesh::new(ring(0.0).chain(ring(high)).collect(), triangles).unwrap().0)
}

/// What a cut past the end of a wall takes off is as deep as it is far from the nearer of both walls: at
/// corners of any angle, and where the top beyond the end is lower by any step.
#[test]
fn a_cut_past_the_end_of_a_wall_is_as_deep_as_the_nearer_wall_is_far() {
    let (radius, deep) = (3.0, 0.5);
    for low in [0.5, 2.0, 3.0, 4.5] {
        let part = steps([[0.0, 7.0, 15.0, 20.0], [0.0, 4.0, 8.0, 12.0]], [[low, HEIGHT, HEIGHT]; 3]);
        let mut path = faced_and_around(radius, HEIGHT, [0.0; 4], 0.0);
        let x = 7.0 - radius + deep;
        let along = [[0.5, -8.0, 20.0], [x, -8.0, low], [x, 20.0, low], [x, 20.0, 20.0]];
        path.moves.extend(path_through(along.map(Point3::from)).moves);
        let gouge = measured(&part, &Cutter::flat(2.0 * radius).unwrap(), &path).gouge;
        let off = (gouge.max_depth_mm - deep).abs();
        assert!(off <= gouge.error_bound_mm && off < 1e-6, "{low} {gouge:?}");
    }
    // A way along one wall that cuts it as deep, past the end where the other wall begins at an angle.
    for degrees in [30.0, 50.0, 90.0, 130.0, 150.0f64] {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let part = prism(
            &[[0.0, 0.0], [20.0, 0.0], [20.0 + 12.0 * cos, 12.0 * sin], [12.0 * cos, 12.0 * sin]],
            HEIGHT,
        );
        let y = deep - radius;
        let path = path_through([[-30.0, y, 20.0], [-30.0, y, -1.0], [50.0, y, -1.0]].map(Point3::from));
        let gouge = measured(&part, &Cutter::flat(2.0 * radius).unwrap(), &path).gouge;
        let off = (gouge.max_depth_mm - deep).abs();
        assert!(off <= gouge.error_bound_mm && off < 1e-6, "{degrees} {gouge:?}");
    }
}
