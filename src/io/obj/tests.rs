use super::*;
use crate::mesh_file::tests::{damaged, damages, holds_up};
use proptest::prelude::*;

const CUBE: &str = "# a cube\nmtllib none.mtl\no cube\n\
    v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\nvn 0 0 1\nvt 0 0\n\
    usemtl steel\ns off\nf 4 3 2 1\nf 5/1 6/1 7/1 8/1\nf 1//1 2//1 6//1 5//1\ng side\n\
    f 2/1/1 3/1/1 7/1/1 6/1/1\nf -6 -5 -1 -2 # counted back\nf 1 5 8 4\nl 1 2 3\np 4\n";

fn refusal(text: &str) -> String {
    parse(text.as_bytes()).unwrap_err().to_string()
}

fn is_cube(text: &str) {
    let (mesh, notes) = parse(text.as_bytes()).unwrap();
    assert_eq!((mesh.triangles().len(), mesh.vertices().len()), (12, 8));
    assert!(mesh.is_closed() && notes.is_clean(), "{notes}");
}

#[test]
fn a_cube_in_all_ways_of_writing_it() {
    is_cube(CUBE);
    is_cube(&CUBE.replace('\n', "\r\n"));
    is_cube(&CUBE.replace("v 1 1 0", "v  1.0e0\t+1 -0 1.0"));
    is_cube(&CUBE.replace("v 1 1 0", "v 1 1 0 0.5 0.5 0.5"));
    is_cube(&CUBE.replace("f 4 3 2 1", "f 4 3 \\\n 2 1"));
    is_cube(&format!("\u{feff}{CUBE}"));
    let mut latin = CUBE.as_bytes().to_vec();
    latin.extend(b"# Gr\xf6\xdfe\no Stra\xdfe\n");
    assert!(parse(&latin).is_ok());
}

#[test]
fn coordinates_keep_all_their_digits() {
    let (mesh, _) = parse(b"v 0.1234567890123456 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3").unwrap();
    assert_eq!(mesh.vertices()[0].x, 0.1234567890123456);
}

/// Area of the mesh in the plan view, and whether every triangle faces up.
fn plan(text: &str) -> (f64, bool) {
    let (mesh, notes) = parse(text.as_bytes()).unwrap();
    assert_eq!(notes.flipped_triangles, 0);
    let cross = |t: usize| {
        let [a, b, c] = mesh.corners(t);
        (b - a).cross(&(c - a)).z
    };
    let n = mesh.triangles().len();
    ((0..n).map(|t| 0.5 * cross(t)).sum(), (0..n).all(|t| cross(t) > 0.0))
}

#[test]
fn polygons_are_covered_once() {
    let polygon = |points: &[[f64; 2]]| {
        let vertices: String =
            points.iter().map(|[x, y]| format!("v {x} {y} {}\n", 0.1 * x + 0.2 * y)).collect();
        let face: String = (1..=points.len()).map(|i| format!(" {i}")).collect();
        plan(&format!("{vertices}f{face}\n"))
    };
    // A dart, whose fan from the first corner would fold over, in all rotations.
    let dart = [[0.0, 0.0], [4.0, 0.0], [1.0, 1.0], [0.0, 4.0]];
    for k in 0..4 {
        let mut turned = dart;
        turned.rotate_left(k);
        let (area, up) = polygon(&turned);
        assert!((area - 4.0).abs() < 1e-12 && up, "{area}");
    }
    // A comb with five teeth.
    let mut comb = vec![[10.0, 0.0], [10.0, 5.0]];
    for k in (0..5).rev() {
        let x = 2.0 * f64::from(k);
        comb.extend([[x + 1.0, 5.0], [x + 1.0, 1.0], [x, 1.0], [x, 5.0]]);
    }
    comb.push([0.0, 0.0]);
    comb.dedup();
    let shoelace: f64 = (0..comb.len())
        .map(|k| {
            let (p, q) = (comb[k], comb[(k + 1) % comb.len()]);
            0.5 * (p[0] * q[1] - p[1] * q[0])
        })
        .sum();
    let (area, up) = polygon(&comb);
    assert!((area - shoelace).abs() < 1e-12 && up, "{area} {shoelace}");
}

#[test]
fn errors_say_the_line_and_the_cure() {
    let starts = |text: &str, start: &str| {
        let refused = refusal(text);
        assert!(refused.starts_with(start), "{refused}");
    };
    starts("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", "line 4: the face refers to vertex 4, but 3 vertices");
    starts("v 0 0 0\nf 0 1 1\n", "line 2: the face refers to vertex 0");
    starts("v 0 0 0\nf -2 1 1\n", "line 2: the face refers to vertex -2");
    starts("v 0 0 0\nf 1 -9223372036854775808 1\n", "line 2: the face refers to vertex -9223372036854775808");
    starts("v 0 0 0\nf 1 x 1\n", "line 2: the number of a vertex should stand here, not \"x\"");
    starts("v 0 0\n", "line 1: a coordinate is missing");
    starts("\nv 0 nan 0\n", "line 2: NaN is no coordinate");
    starts("v 0 1,5 0\n", "line 1: a number should stand here, not \"1,5\"; write decimals with a point");
    starts("v 0 0 0\nv 1 0 0\nf 1 2\n", "line 3: a third corner of the face is missing");
    starts("v 1 1 1\nsurf 0 1 0 1 1 2 3 4\n", "line 2: a vertex or a face should stand here, not \"surf\"");
    starts("hello\nworld", "the mesh has no triangles");
    starts("", "the file is empty");
    let many: String = (0..2_001).map(|_| " 1").collect();
    starts(&format!("v 0 0 0\nf{many}"), "line 2: the face has 2001 corners; at most 2000 are read");
}

#[test]
fn the_largest_face_takes_no_long_time() {
    // A saw: half of the corners are reflex.
    let n = 1500;
    let mut text: String =
        (0..n).map(|k| format!("v {k} {} 0\n", if k % 2 == 0 { 0.0 } else { 1.0 })).collect();
    text += &format!("v {n} 5 0\nv 0 5 0\nf");
    text.extend((1..=n + 2).map(|k| format!(" {k}")));
    let (mesh, _) = parse(text.as_bytes()).unwrap();
    assert_eq!(mesh.triangles().len(), n as usize);
}

proptest! {
    #[test]
    fn any_bytes_hold_up(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        holds_up(parse, &bytes);
    }

    #[test]
    fn any_statements_hold_up(
        words in prop::collection::vec(
            prop::sample::select(vec!["v", "f", "\n", "\n", "1", "2", "-1", "0.5", "1e5", "3", "/", "//", "\\", "#"]),
            0..200,
        ),
    ) {
        holds_up(parse, words.join(" ").as_bytes());
    }

    #[test]
    fn damaged_files_hold_up(damages in damages()) {
        holds_up(parse, &damaged(CUBE.as_bytes().to_vec(), &damages));
    }
}
