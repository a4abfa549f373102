use super::*;
use crate::MAX_COORDINATE;

type Soup = (Vec<Point3>, Vec<[u32; 3]>);

/// A unit cube with outward triangles.
fn cube() -> Soup {
    Aabb { min: Point3::origin(), max: Point3::new(1.0, 1.0, 1.0) }.surface()
}

/// Every corner stated anew, as in an STL file.
fn unweld((vertices, triangles): &Soup) -> Soup {
    let corners: Vec<Point3> = triangles.iter().flatten().map(|&i| vertices[i as usize]).collect();
    let n = triangles.len() as u32;
    (corners, (0..n).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect())
}

fn volume(mesh: &TriangleMesh) -> f64 {
    let corners = (0..mesh.triangles().len()).map(|t| mesh.corners(t));
    corners.map(|[a, b, c]| a.coords.dot(&b.coords.cross(&c.coords)) / 6.0).sum()
}

fn consistent(mesh: &TriangleMesh) -> bool {
    mesh.triangles().iter().enumerate().all(|(t, face)| {
        (0..3).all(|k| {
            mesh.neighbour(t, k).is_none_or(|n| {
                let other = mesh.triangles()[n];
                (0..3).any(|j| {
                    other[j] == face[(k + 1) % 3]
                        && other[(j + 1) % 3] == face[k]
                        && mesh.neighbour(n, j) == Some(t)
                })
            })
        })
    })
}

#[test]
fn a_clean_mesh_keeps_its_numbering() {
    let (vertices, triangles) = cube();
    let (mesh, notes, sources) =
        TriangleMesh::with_sources(vertices.clone(), triangles.clone(), Outside::Found).unwrap();
    assert_eq!((mesh.vertices(), mesh.triangles()), (&vertices[..], &triangles[..]));
    assert_eq!(sources, triangles);
    assert_eq!(notes.to_string(), "no repairs");
    assert!(notes.is_clean() && mesh.is_closed() && consistent(&mesh));
    assert!((volume(&mesh) - 1.0).abs() < 1e-15);
    assert_eq!(mesh.bounds().max, Point3::new(1.0, 1.0, 1.0));
    assert_eq!(mesh.normal(0), Vector3::new(0.0, 0.0, -1.0));
}

#[test]
fn inches_become_millimetres() {
    let (mesh, _) = TriangleMesh::new(cube().0, cube().1).unwrap();
    let scaled = mesh.scaled(25.4).unwrap();
    assert!((volume(&scaled) - 25.4f64.powi(3)).abs() < 1e-9);
    assert_eq!(scaled.triangles(), mesh.triangles());
    assert!(matches!(mesh.scaled(1e7), Err(MeshError::TooFar { .. })));
    assert!(matches!(mesh.scaled(f64::NAN), Err(MeshError::NotFinite { .. })));
}

#[test]
fn a_soup_is_welded_and_minus_zero_is_zero() {
    let (mut vertices, triangles) = unweld(&cube());
    vertices
        .iter_mut()
        .step_by(2)
        .for_each(|p| *p = Point3::from(p.coords.map(|x| if x == 0.0 { -0.0 } else { x })));
    let (mesh, notes) = TriangleMesh::new(vertices, triangles).unwrap();
    assert_eq!((mesh.vertices().len(), notes.merged_vertices), (8, 28));
    assert!(mesh.is_closed() && notes.is_clean());
    assert_eq!(notes.to_string(), "merged 28 coincident vertices");
}

#[test]
fn single_triangles_are_turned_to_agree_and_sources_follow() {
    let (vertices, mut triangles) = cube();
    for t in [1, 4, 7, 8] {
        triangles[t].swap(0, 1);
    }
    let (mesh, notes, sources) =
        TriangleMesh::with_sources(vertices.clone(), triangles, Outside::Found).unwrap();
    assert_eq!((notes.flipped_triangles, notes.turned_over), (4, false));
    assert!(consistent(&mesh));
    assert!((volume(&mesh) - 1.0).abs() < 1e-15);
    for (face, source) in mesh.triangles().iter().zip(&sources) {
        for k in 0..3 {
            assert_eq!(mesh.vertices()[face[k] as usize], vertices[source[k] as usize]);
        }
    }
}

#[test]
fn a_solid_inside_out_is_turned_over_also_with_a_hole_or_open_seams() {
    let (vertices, mut triangles) = cube();
    triangles.iter_mut().for_each(|t| t.swap(1, 2));
    let (mesh, notes) = TriangleMesh::new(vertices, triangles).unwrap();
    assert!(notes.turned_over && volume(&mesh) > 0.99);
    // A solid cut apart into its six faces (seams that do not match) still faces outward.
    let (mut vertices, triangles) = unweld(&cube());
    for (i, p) in vertices.iter_mut().enumerate() {
        p.coords *= 1.0 + 1e-9 * (i / 6) as f64;
    }
    let (mesh, notes) = TriangleMesh::new(vertices, triangles).unwrap();
    assert!(!mesh.is_closed() && !notes.turned_over);
    assert!(volume(&mesh) > 0.99);
}

#[test]
fn an_open_surface_is_made_to_face_up() {
    let vertices = vec![
        Point3::new(0.0, 0.0, 0.0),
        Point3::new(1.0, 0.0, 0.0),
        Point3::new(0.0, 1.0, 0.5),
        Point3::new(1.0, 1.0, 0.0),
    ];
    let (mesh, notes) = TriangleMesh::new(vertices, vec![[0, 2, 1], [1, 2, 3]]).unwrap();
    assert!(notes.turned_over && (0..2).all(|t| mesh.normal(t).z > 0.0));
    assert!(!mesh.is_closed() && consistent(&mesh));
    assert_eq!(mesh.neighbour(0, 1).or(mesh.neighbour(0, 0)).or(mesh.neighbour(0, 2)), Some(1));
}

#[test]
fn degenerate_and_duplicate_triangles_are_dropped_with_their_vertices() {
    let (mut vertices, mut triangles) = cube();
    vertices.push(Point3::new(0.5, 0.0, 0.0));
    vertices.push(Point3::new(9.0, 9.0, 9.0));
    triangles.insert(0, [0, 8, 1]);
    triangles.insert(3, [0, 0, 1]);
    triangles.push([1, 3, 7]);
    triangles.push([7, 1, 3]);
    triangles.push([1, 7, 3]);
    let (mesh, notes) = TriangleMesh::new(vertices, triangles).unwrap();
    assert_eq!((notes.dropped_degenerate, notes.dropped_duplicates), (2, 3));
    assert_eq!((mesh.triangles().len(), mesh.vertices().len()), (12, 8));
    assert_eq!(notes.to_string(), "dropped 2 triangles without area, dropped 3 duplicate triangles");
    assert!(mesh.is_closed());
}

#[test]
fn a_thin_but_honest_sliver_is_kept() {
    let sliver = vec![Point3::origin(), Point3::new(100.0, 0.0, 0.0), Point3::new(50.0, 1e-9, 0.0)];
    assert!(TriangleMesh::new(sliver, vec![[0, 1, 2]]).is_ok());
    let line = vec![Point3::origin(), Point3::new(0.1, 0.2, 0.3), Point3::new(0.3, 0.6, 0.9)];
    let refused = TriangleMesh::new(line, vec![[0, 1, 2]]).unwrap_err();
    assert_eq!(refused, MeshError::Empty { dropped: 1 });
}

#[test]
fn what_cannot_be_repaired_is_refused_with_its_place() {
    assert_eq!(TriangleMesh::new(cube().0, vec![]).unwrap_err(), MeshError::Empty { dropped: 0 });
    let bad = |change: fn(&mut Soup)| {
        let mut soup = cube();
        change(&mut soup);
        TriangleMesh::new(soup.0, soup.1).unwrap_err().to_string()
    };
    let text = bad(|(_, t)| t[5][2] = 8);
    assert!(text.starts_with("triangle 5 refers to vertex 8, but there are 8"), "{text}");
    let text = bad(|(v, _)| v[7].y = f64::NAN);
    assert!(text.contains("triangle 2 has the corner (1, NaN, 1), which is not finite"), "{text}");
    let text = bad(|(v, _)| v[7].y = 2.0 * MAX_COORDINATE);
    assert!(text.contains("(1, 2000000, 1) mm") && text.contains("±1000000 mm"), "{text}");
    let text = bad(|(v, t)| {
        v.push(Point3::new(-1.0, -1.0, 0.5));
        t.push([0, 4, 8]);
    });
    assert!(
        text.starts_with("3 triangles (5, 8, 12) meet at the edge from (0, 0, 0) to (0, 0, 1)"),
        "{text}"
    );
}

fn moebius() -> Soup {
    const N: u32 = 12;
    let mut vertices = Vec::new();
    for i in 0..N {
        let turn = std::f64::consts::TAU * f64::from(i) / f64::from(N);
        for side in [-1.0, 1.0] {
            let r = 10.0 + side * (0.5 * turn).cos();
            vertices.push(Point3::new(r * turn.cos(), r * turn.sin(), side * (0.5 * turn).sin()));
        }
    }
    let mut triangles = Vec::new();
    for i in 0..N {
        let (a, b) = (2 * i, 2 * i + 1);
        // After one turn the two sides have changed places.
        let (c, d) = if i + 1 < N { (a + 2, b + 2) } else { (1, 0) };
        triangles.extend([[a, b, c], [b, d, c]]);
    }
    (vertices, triangles)
}

#[test]
fn a_moebius_strip_is_refused() {
    let (vertices, triangles) = moebius();
    let refused = TriangleMesh::new(vertices, triangles).unwrap_err();
    assert!(matches!(refused, MeshError::NotOrientable { .. }), "{refused}");
    assert!(refused.to_string().contains("one-sided"));
}

#[test]
fn many_triangles_at_one_edge_take_no_quadratic_time() {
    // A book with 100,000 pages: the pairwise comparison of pages would take seconds.
    let mut vertices = vec![Point3::origin(), Point3::new(0.0, 0.0, 1.0)];
    vertices.extend((0..100_000).map(|i| Point3::new(f64::from(i), 1.0, 0.0)));
    let triangles = (0..100_000).map(|i| [0, 1, i + 2]).collect();
    let refused = TriangleMesh::new(vertices, triangles).unwrap_err();
    assert!(matches!(refused, MeshError::NonManifoldEdge { count: 100_000, triangles: [0, 1, 2], .. }));
}

/// A level square with a fin below one of its inner edges.
#[test]
fn three_triangles_at_an_edge_make_no_surface_but_a_soup() {
    let points = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.0, 1.0, 0.0), (0.5, 0.5, -1.0)];
    let vertices: Vec<Point3> = points.into_iter().map(|(x, y, z)| Point3::new(x, y, z)).collect();
    // The second faces down.
    let triangles = vec![[0, 1, 2], [0, 3, 2], [0, 2, 4]];
    let refused = TriangleMesh::new(vertices.clone(), triangles.clone()).unwrap_err();
    let (soup, notes) = TriangleMesh::opened(vertices, triangles).unwrap();
    assert_eq!((soup.surface(), notes.opened_edges), (Err(&refused), 1));
    assert!(consistent(&soup) && (0..3).all(|t| (0..3).all(|k| soup.neighbour(t, k).is_none())));
    assert!((0..2).all(|t| soup.normal(t).z == 1.0), "both are turned to face up");
    assert!(notes.to_string().contains("left 1 edge open"), "{notes}");
    assert!(soup.scaled(2.0).unwrap().surface().is_err());
    let (clean, notes) = TriangleMesh::opened(cube().0, cube().1).unwrap();
    assert_eq!((clean.surface(), notes), (Ok(()), RepairNotes::default()));
}

#[test]
fn a_moebius_strip_is_cut_open_once() {
    let (vertices, triangles) = moebius();
    let (soup, notes) = TriangleMesh::opened(vertices, triangles).unwrap();
    assert!(consistent(&soup) && !soup.is_closed());
    assert_eq!(notes.opened_edges, 1);
    assert!(matches!(soup.surface(), Err(MeshError::NotOrientable { .. })));
}
