use proptest::prelude::*;
use proptest::sample::Index;

use super::junctions::cut;
use crate::mesh::{RepairNotes, TriangleMesh};
use crate::{Aabb, Point3, Vector3};

type Soup = (Vec<Point3>, Vec<[u32; 3]>);

/// Squares along each side of a random solid.
const SQUARES: usize = 4;

/// A solid whose top stands at `heights` over a square grid, in squares of `size` mm, each with either diagonal.
fn solid(heights: &[f64], diagonals: &[bool], size: f64) -> Soup {
    let n = SQUARES + 1;
    let point = |k: usize, z: f64| Point3::new(size * (k % n) as f64, size * (k / n) as f64, z);
    let top = (0..n * n).map(|k| point(k, heights[k]));
    let vertices = top.chain((0..n * n).map(|k| point(k, -1.0))).collect();
    let mut triangles: Vec<[usize; 3]> = Vec::new();
    for k in 0..SQUARES * SQUARES {
        let a = k / SQUARES * n + k % SQUARES;
        let [a, b, c, d] = [a, a + 1, a + n + 1, a + n];
        let halves = if diagonals[k] { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] };
        triangles.extend(halves);
        triangles.extend(halves.map(|t| [t[0], t[2], t[1]].map(|v| v + n * n)));
    }
    let mut wall = |a: usize, b: usize| triangles.extend([[b, a, a + n * n], [b, a + n * n, b + n * n]]);
    for k in 0..SQUARES {
        wall(k, k + 1);
        wall(n * n - 1 - k, n * n - 2 - k);
        wall(n * (k + 1) - 1, n * (k + 2) - 1);
        wall(n * (n - 1 - k), n * (n - 2 - k));
    }
    (vertices, triangles.into_iter().map(|t| t.map(|v| v as u32)).collect())
}

fn solids() -> impl Strategy<Value = Soup> {
    let heights = prop::collection::vec(-0.5..0.5, (SQUARES + 1) * (SQUARES + 1));
    let diagonals = prop::collection::vec(any::<bool>(), SQUARES * SQUARES);
    (heights, diagonals, 0.05..5.0).prop_map(|(heights, diagonals, size)| solid(&heights, &diagonals, size))
}

/// Every corner stated anew, as `moved` has it.
fn shattered((vertices, triangles): &Soup, mut moved: impl FnMut(&Point3) -> Point3) -> Soup {
    let corners: Vec<Point3> = triangles.iter().flatten().map(|&v| moved(&vertices[v as usize])).collect();
    (corners, (0..triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect())
}

fn welded((vertices, triangles): Soup, tolerance: f64) -> (TriangleMesh, RepairNotes) {
    TriangleMesh::welded(vertices, triangles, tolerance).unwrap()
}

fn open_edges(mesh: &TriangleMesh) -> usize {
    let sides = (0..mesh.triangles().len()).flat_map(|t| (0..3).map(move |k| (t, k)));
    sides.filter(|&(t, k)| mesh.neighbour(t, k).is_none()).count()
}

fn volume(mesh: &TriangleMesh) -> f64 {
    let origin = mesh.bounds().min;
    let corners = (0..mesh.triangles().len()).map(|t| mesh.corners(t).map(|p| p - origin));
    corners.map(|[a, b, c]| a.dot(&b.cross(&c)) / 6.0).sum()
}

/// The mesh of a soup that was shattered has the neighbours of the one that was not, and lies where it says.
fn is_mended(clean: Soup, broken: &Soup, tolerance: f64) -> Result<(), TestCaseError> {
    let mesh = TriangleMesh::new(clean.0, clean.1).unwrap().0;
    prop_assert!(open_edges(&welded(broken.clone(), 0.0).0) > 0);
    let (mended, notes) = welded(broken.clone(), tolerance);
    prop_assert!(mended.is_closed() && mended.surface().is_ok(), "{}", notes);
    prop_assert_eq!(mended.vertices().len(), mesh.vertices().len());
    prop_assert!(mended.moved() > 0.0 && mended.moved() <= tolerance && mended.moved() == notes.moved);
    for t in 0..mesh.triangles().len() {
        let (given, now) = (broken.1[t].map(|v| broken.0[v as usize]), mended.corners(t));
        for k in 0..3 {
            prop_assert_eq!(mended.neighbour(t, k), mesh.neighbour(t, k));
            prop_assert!((now[k] - given[k]).norm() <= mended.moved());
        }
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_mesh_whose_corners_differ_a_little_is_whole_again(
        clean in solids(),
        noise in prop::collection::vec(-1e-9..1e-9, 97),
    ) {
        let mut noise = noise.iter().cycle();
        let mut next = || *noise.next().unwrap();
        let broken = shattered(&clean, |p| p + Vector3::new(next(), next(), next()));
        is_mended(clean, &broken, 2e-6)?;
    }

    /// Copies of a corner are rounded up or down to f32.
    #[test]
    fn so_is_one_that_rounding_tore_apart_far_from_the_origin(
        clean in solids(),
        up in prop::collection::vec(any::<bool>(), 97),
    ) {
        let away = Vector3::new(1000.0, -700.0, 300.0);
        let clean = (clean.0.iter().map(|p| p + away).collect(), clean.1);
        let mut up = up.iter().cycle();
        let mut rounded = |x: f64| match up.next() {
            Some(true) => f64::from(crate::round_up(x)),
            _ => f64::from(crate::round_down(x)),
        };
        let broken = shattered(&clean, |p| Point3::from(p.coords.map(&mut rounded)));
        is_mended(clean, &broken, 2.0 * 2f64.powi(-14))?;
    }

    /// Edges have vertices for one of their triangles alone.
    #[test]
    fn t_junctions_are_split(
        (vertices, triangles) in solids(),
        on_edges in prop::collection::vec((any::<Index>(), 0..3usize, 1..4u32), 1..40),
        noise in prop::collection::vec(-1e-9..1e-9, 97),
    ) {
        let mesh = TriangleMesh::new(vertices.clone(), triangles.clone()).unwrap().0;
        let (mut points, mut on_sides) = (vertices, vec![<[Vec<u32>; 3]>::default(); triangles.len()]);
        let mut noise = noise.iter().cycle();
        for (t, k, count) in on_edges {
            let t = t.index(triangles.len());
            let other = mesh.neighbour(t, k).unwrap();
            let back = (0..3).find(|&j| mesh.neighbour(other, j) == Some(t)).unwrap();
            if !on_sides[t][k].is_empty() || !on_sides[other][back].is_empty() {
                continue;
            }
            let [from, to] = [k, (k + 1) % 3].map(|k| points[triangles[t][k] as usize]);
            for n in 1..=count {
                on_sides[t][k].push(points.len() as u32);
                let aside = Vector3::from_fn(|_, _| *noise.next().unwrap());
                points.push(from + (to - from) * (f64::from(n) / f64::from(count + 1)) + aside);
            }
        }
        let pieces: Vec<[u32; 3]> =
            triangles.iter().zip(&on_sides).flat_map(|(face, on)| cut(face, on)).collect();
        let split = on_sides.iter().flatten().filter(|on| !on.is_empty()).count();
        prop_assert!(!TriangleMesh::new(points.clone(), pieces.clone()).unwrap().0.is_closed());
        let (whole, notes) = welded((points, pieces), 2e-6);
        prop_assert!(whole.is_closed() && whole.surface().is_ok(), "{}", notes);
        prop_assert_eq!((notes.split_edges, notes.welded_vertices), (split, 0));
        prop_assert!(whole.moved() < 2e-9);
        prop_assert!((volume(&whole) / volume(&mesh) - 1.0).abs() < 1e-6);
    }
}

#[test]
fn a_triangle_is_cut_into_pieces_that_cover_it_once() {
    let corners = [Point3::new(0.0, 0.0, 0.0), Point3::new(4.0, 0.0, 0.0), Point3::new(1.0, 3.0, 0.0)];
    for counts in (0..64_usize).map(|k| [k % 4, k / 4 % 4, k / 16]) {
        let (mut points, mut on_sides) = (corners.to_vec(), <[Vec<u32>; 3]>::default());
        for k in 0..3 {
            for n in 1..=counts[k] {
                on_sides[k].push(points.len() as u32);
                let way = corners[(k + 1) % 3] - corners[k];
                points.push(corners[k] + way * (n as f64 / (counts[k] + 1) as f64));
            }
        }
        let pieces = cut(&[0, 1, 2], &on_sides);
        assert_eq!(pieces.len(), 1 + counts.iter().sum::<usize>(), "{counts:?}");
        let areas = pieces.iter().map(|piece| {
            let [a, b, c] = piece.map(|v| points[v as usize]);
            (b - a).cross(&(c - a)).z
        });
        assert!(
            areas.clone().all(|area| area > 0.1) && (areas.sum::<f64>() - 12.0).abs() < 1e-12,
            "{counts:?}"
        );
        let used = |v: u32| pieces.iter().flatten().any(|&w| w == v);
        assert!((0..points.len() as u32).all(used), "{counts:?}");
    }
}

/// A wall thinner than the tolerance would collapse: it is left as it is given.
#[test]
fn a_wall_thinner_than_the_tolerance_keeps_both_sides() {
    let block = Aabb { min: Point3::origin(), max: Point3::new(5.0, 1e-6, 3.0) }.surface();
    let mut k = 0.0;
    let broken = shattered(&block, |p| {
        k += 1.0;
        p + Vector3::repeat(1e-10 * k)
    });
    let (mesh, notes) = welded(broken.clone(), 2e-6);
    assert_eq!((notes.welded_vertices, mesh.moved(), mesh.triangles().len()), (0, 0.0, 12));
    assert!(welded(broken, 4e-7).0.is_closed());
}

/// A level sheet of squares at a height, over a part of the plane.
fn sheet(from: [f64; 2], counts: [u32; 2], size: f64, z: f64) -> Soup {
    let nx = counts[0] + 1;
    let point =
        |k: u32| Point3::new(from[0] + size * f64::from(k % nx), from[1] + size * f64::from(k / nx), z);
    let squares = (0..counts[0] * counts[1]).map(|k| k / counts[0] * nx + k % counts[0]);
    let triangles = squares.flat_map(|a| [[a, a + 1, a + nx + 1], [a, a + nx + 1, a + nx]]).collect();
    ((0..nx * (counts[1] + 1)).map(point).collect(), triangles)
}

fn both(mut a: Soup, b: Soup) -> Soup {
    let n = a.0.len() as u32;
    a.0.extend(b.0);
    a.1.extend(b.1.iter().map(|t| t.map(|v| v + n)));
    a
}

/// Sheets on each other, with the same vertices, with others, and each corner stated anew.
#[test]
fn sheets_that_lie_on_each_other_stay_apart() {
    let below = sheet([0.0, 0.0], [4, 4], 1.0, 0.0);
    let finer = sheet([0.0, 0.0], [8, 8], 0.5, 1e-9);
    for squares in [[1, 1], [4, 4]] {
        let below = sheet([0.0, 0.0], squares, 1.0, 0.0);
        let above = sheet([0.0, 0.0], squares, 1.0, 1e-9);
        let turned = (above.0.clone(), above.1.iter().map(|t| [t[0], t[2], t[1]]).collect());
        for above in [above, turned] {
            let (mesh, notes) = welded(both(below.clone(), above), 2e-6);
            let around = 4 * (squares[0] + squares[1]) as usize;
            assert_eq!((open_edges(&mesh), notes.welded_vertices), (around, 0), "{notes}");
        }
    }
    let (mesh, notes) = welded(both(below.clone(), finer), 2e-6);
    assert_eq!((open_edges(&mesh), notes.split_edges), (16 + 32, 0), "{notes}");
    let mut k = 0.0;
    let mut aside = |p: &Point3| {
        k += 1.0;
        p + Vector3::new(0.0, 0.0, 1e-10 * k)
    };
    let twice = both(shattered(&below, &mut aside), shattered(&below, &mut aside));
    let (mesh, notes) = welded(twice, 2e-6);
    assert_eq!(mesh.triangles().len(), 2 * below.1.len(), "{notes}");
}

/// Beside each other sheets are one, whatever their vertices; where a corner touches an edge, none is split.
#[test]
fn sheets_beside_each_other_are_one() {
    let left = sheet([0.0, 0.0], [2, 2], 1.0, 0.0);
    for (size, split) in [(1.0, 0), (0.5, 2), (2.0 / 3.0, 3)] {
        let count = (2.0 / size + 0.5) as u32;
        let (mesh, notes) =
            welded(both(left.clone(), sheet([2.0 + 1e-9, 0.0], [count, count], size, 0.0)), 2e-6);
        assert_eq!((open_edges(&mesh), notes.split_edges), (6 + 3 * count as usize, split), "{notes}");
    }
    let tip = (
        vec![Point3::new(2.0, 0.5, 0.0), Point3::new(3.0, 0.0, 0.0), Point3::new(3.0, 1.0, 0.0)],
        vec![[0, 1, 2]],
    );
    let (mesh, notes) = welded(both(left, tip), 2e-6);
    assert_eq!((open_edges(&mesh), notes), (8 + 3, RepairNotes::default()));
}

/// Where rounding is greater than the tolerance some vertices still find others. None of that turns a triangle over.
#[test]
fn what_is_welded_in_part_faces_the_side_that_it_did() {
    let heights: Vec<f64> = (0..25).map(|k| 0.3 * (7.0 * k as f64).sin()).collect();
    let clean = solid(&heights, &[false; 16], 1.0);
    let mut numbers = 1_u64;
    let mut noise = || {
        numbers = numbers.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        1e-5 * ((numbers >> 40) as f64 / f64::from(1 << 24) - 0.5)
    };
    for _ in 0..50 {
        let broken = shattered(&clean, |p| p + Vector3::from_fn(|_, _| noise()));
        let (mesh, notes) = welded(broken, 4e-6);
        assert!(notes.welded_vertices > 0 && !mesh.is_closed(), "{notes}");
        assert_eq!(
            (notes.flipped_triangles, notes.turned_over, notes.opened_edges),
            (0, false, 0),
            "{notes}"
        );
    }
}

/// An inner edge of a sheet is no place for a third triangle.
#[test]
fn what_hangs_together_takes_no_third_triangle() {
    let square = sheet([0.0, 0.0], [1, 1], 1.0, 0.0);
    let fin = (
        vec![Point3::new(0.0, 0.0, 1e-9), Point3::new(1.0, 1.0, 1e-9), Point3::new(0.5, 0.5, 1.0)],
        vec![[0, 1, 2]],
    );
    let (mesh, notes) = welded(both(square, fin), 2e-6);
    assert_eq!((mesh.surface(), open_edges(&mesh), notes), (Ok(()), 7, RepairNotes::default()));
}

#[test]
fn a_closed_mesh_is_left_alone_however_fine_it_is() {
    let block = Aabb { min: Point3::origin(), max: Point3::new(1e-3, 1e-3, 1e-3) }.surface();
    let (mesh, notes) = welded(block.clone(), 1.0);
    assert_eq!(
        (mesh.vertices(), mesh.triangles(), notes),
        (&block.0[..], &block.1[..], RepairNotes::default())
    );
}

#[test]
fn many_vertices_at_one_edge_or_one_place_take_no_quadratic_time() {
    const MANY: u32 = 100_000;
    // A triangle whose long side meets as many small ones.
    let x = |k: u32| f64::from(k) / f64::from(MANY) * 1e4;
    let mut vertices: Vec<Point3> = (0..=MANY).map(|k| Point3::new(x(k), 0.0, 0.0)).collect();
    vertices.extend([Point3::new(5e3, -1e4, 0.0), Point3::new(5e3, 1e4, 0.0)]);
    let mut triangles: Vec<[u32; 3]> = (0..MANY).map(|k| [k, k + 1, MANY + 2]).collect();
    triangles.push([MANY, 0, MANY + 1]);
    let (mesh, notes) = welded((vertices, triangles), 1e-3);
    assert_eq!((open_edges(&mesh), notes.split_edges), (4, 1));
    // Corners all within the tolerance of each other.
    let corner = |k: u32| Point3::new(1e-10 * f64::from(k), 0.0, 0.0);
    let far = |k: u32, x: f64| Point3::new(x, f64::from(k), 1.0);
    let vertices = (0..MANY).flat_map(|k| [corner(k), far(k, 9.0), far(k, 8.0)]).collect();
    let (mesh, _) = welded((vertices, (0..MANY).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect()), 2e-5);
    assert_eq!(mesh.triangles().len(), MANY as usize);
}

#[test]
fn what_was_done_is_told_with_how_far_it_moved_the_surface() {
    let block = Aabb { min: Point3::origin(), max: Point3::new(1.0, 1.0, 1.0) }.surface();
    let mut k = 0.0;
    let broken = shattered(&block, |p| {
        k += 1.0;
        p + Vector3::new(1e-10 * k, 0.0, 0.0)
    });
    let (mesh, notes) = welded(broken, 1e-7);
    assert_eq!(notes.to_string(), "welded 28 vertices to others within 3.0e-9 mm");
    assert!(!notes.is_clean() && mesh.moved() > 2.9e-9 && mesh.moved() <= 3.0e-9);
    let inches = mesh.scaled(25.4).unwrap();
    assert_eq!(inches.moved(), 25.4 * mesh.moved());
}
