use super::*;
use crate::mesh_file::tests::{damaged, damages, holds_up};
use geometry::MeshError;
use proptest::prelude::*;

const TETRAHEDRON: [[[f32; 3]; 3]; 4] = [
    [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]],
    [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
    [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]],
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
];

fn binary_of(header: &[u8], triangles: &[[[f32; 3]; 3]]) -> Vec<u8> {
    let mut bytes = header.to_vec();
    bytes.resize(80, 0);
    bytes.extend((triangles.len() as u32).to_le_bytes());
    for t in triangles {
        bytes.extend([[0.0f32; 3]].iter().chain(t).flatten().flat_map(|x| x.to_le_bytes()));
        bytes.extend([7, 9]);
    }
    bytes
}

fn text_of(triangles: &[[[f32; 3]; 3]]) -> String {
    let mut text = String::from("solid part\n");
    for t in triangles {
        text += "  facet normal 0 0 0\n    outer loop\n";
        for [x, y, z] in t {
            text += &format!("      vertex {x:e} {y} {z:.3}\n");
        }
        text += "    endloop\n  endfacet\n";
    }
    text + "endsolid part\n"
}

fn tetrahedron() -> Vec<u8> {
    binary_of(b"binary", &TETRAHEDRON)
}

fn refusal(bytes: &[u8]) -> String {
    parse(bytes).unwrap_err().to_string()
}

fn is_tetrahedron(bytes: &[u8]) {
    let (mesh, notes) = parse(bytes).unwrap();
    assert_eq!((mesh.triangles().len(), mesh.vertices().len()), (4, 4));
    assert!(mesh.is_closed() && notes.is_clean(), "{notes}");
}

#[test]
fn binary_and_text_give_the_same_mesh() {
    is_tetrahedron(&tetrahedron());
    is_tetrahedron(text_of(&TETRAHEDRON).as_bytes());
    let (a, _) = parse(&tetrahedron()).unwrap();
    let (b, _) = parse(text_of(&TETRAHEDRON).as_bytes()).unwrap();
    assert_eq!((a.vertices(), a.triangles()), (b.vertices(), b.triangles()));
}

#[test]
fn what_is_written_is_read_back() {
    let vertices = [[0.0f32, 0.0, 0.0], [30.5, 0.0, 0.1], [0.0, 20.25, 0.7], [31.0, 21.0, -3.0]];
    let mut bytes = Vec::new();
    crate::stl_write::write(&mut bytes, &vertices, &[[0, 1, 2], [2, 1, 3]]).unwrap();
    let (mesh, _) = parse(&bytes).unwrap();
    assert_eq!(mesh.triangles(), [[0, 1, 2], [2, 1, 3]]);
    assert_eq!(mesh.vertices()[1], Point3::new(30.5, 0.0, f64::from(0.1f32)));
}

#[test]
fn a_binary_file_may_begin_with_solid() {
    is_tetrahedron(&binary_of(b"solid exported by some program\nfacet normal", &TETRAHEDRON));
}

#[test]
fn text_comes_in_many_shapes() {
    let text = text_of(&TETRAHEDRON);
    for variant in [
        text.to_uppercase(),
        text.replace('\n', "\r\n"),
        text.replace('\n', " \n\n\t").replace(' ', "  "),
        text.replace("solid part", "solid"),
        text.replace("solid part", "solid facet normal endsolid"),
        text.replace("normal 0 0 0", "normal nan -nan(ind) 1.#QNAN"),
        text.replace("facet normal 0 0 0\n", "facet\n"),
        text.replace("facet normal 0 0 0\n", "facet normal\n"),
        text.replace("vertex 1e0", "vertex +1.0E+00"),
        format!("\u{feff}{text}"),
        format!("  \n {text}\n\n"),
        // Each triangle a solid of its own.
        TETRAHEDRON.iter().map(|t| text_of(&[*t])).collect(),
    ] {
        is_tetrahedron(variant.as_bytes());
    }
}

#[test]
fn a_false_count_is_refused_with_both_lengths() {
    let mut more = tetrahedron();
    more[80] = 5;
    let text = refusal(&more);
    assert!(text.contains("byte 80 of the file says 5 triangles"), "{text}");
    assert!(text.contains("334 bytes long, but it is 284 bytes long: it was cut off"), "{text}");
    let mut fewer = tetrahedron();
    fewer[80] = 3;
    assert!(refusal(&fewer).contains("not written to its format"));
    let mut enormous = tetrahedron();
    enormous[80..84].fill(255);
    assert!(refusal(&enormous).contains("says 4294967295 triangles"));
    assert!(refusal(&tetrahedron()[..283]).contains("cut off"));
    assert_eq!(
        parse(&binary_of(b"", &[])).unwrap_err(),
        MeshFileError::Mesh(MeshError::Empty { dropped: 0 })
    );
}

#[test]
fn bad_numbers_are_refused_with_their_place() {
    for (value, shown) in [(f32::NAN, "NaN"), (f32::INFINITY, "inf"), (-3e6, "-3000000")] {
        let mut bytes = tetrahedron();
        let at = 84 + 2 * 50 + 12 + 16;
        bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
        let text = refusal(&bytes);
        assert!(text.starts_with(&format!("byte {at}: {shown} is no coordinate")), "{text}");
    }
    let text = text_of(&TETRAHEDRON);
    for (word, shown) in [("nan", "NaN"), ("inf", "inf"), ("1e7", "10000000"), ("1e999", "inf")] {
        let bad = refusal(text.replacen("vertex 1e0", &format!("vertex {word}"), 1).as_bytes());
        assert!(bad.starts_with(&format!("line 6: {shown} is no coordinate")), "{bad}");
    }
    let comma = refusal(text.replacen("vertex 1e0", "vertex 1,5", 1).as_bytes());
    assert!(
        comma.contains("a number should stand here, not \"1,5\"; write decimals with a point"),
        "{comma}"
    );
}

#[test]
fn text_that_breaks_off_or_off_its_grammar_is_refused_with_its_line() {
    let text = text_of(&TETRAHEDRON);
    let cut = text.replace("endsolid part\n", "");
    assert!(refusal(cut.as_bytes()).starts_with("line 30: \"facet\" or \"endsolid\" is missing"));
    assert!(
        refusal(b"solid x\nfacet normal 0 0 1\nouter loop\nvertex 1 2")
            .starts_with("line 4: a coordinate is missing")
    );
    let four = text.replacen("    endloop", "      vertex 1 1 1\n    endloop", 1);
    assert!(
        refusal(four.as_bytes()).starts_with("line 7: \"endloop\" after three corners should stand here")
    );
    let other = text.replacen("outer loop", "inner loop", 1);
    assert!(refusal(other.as_bytes()).starts_with("line 3: \"outer loop\" should stand here, not \"inner\""));
    let tail = format!("{text}and more");
    assert!(refusal(tail.as_bytes()).contains("not \"and\""));
    assert!(refusal(b"solid x\nendsolid\n").contains("no triangles"));
}

#[test]
fn what_is_no_stl_file_is_called_so() {
    assert_eq!(parse(b"").unwrap_err(), MeshFileError::Empty);
    assert_eq!(parse(b"hello").unwrap_err(), MeshFileError::TooShort { bytes: 5 });
    assert!(refusal(&[b'P'; 500]).ends_with("it was cut off, or is no STL file; export or copy it again"));
    let missing = read("/nonexistent/part.stl".as_ref()).unwrap_err().to_string();
    assert!(missing.starts_with("cannot read /nonexistent/part.stl: "), "{missing}");
}

proptest! {
    #[test]
    fn any_bytes_hold_up(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        holds_up(parse, &bytes);
        let mut text = b"solid ".to_vec();
        text.extend(&bytes);
        holds_up(parse, &text);
    }

    #[test]
    fn damaged_files_hold_up(damages in damages()) {
        holds_up(parse, &damaged(tetrahedron(), &damages));
        holds_up(parse, &damaged(text_of(&TETRAHEDRON).into_bytes(), &damages));
    }

    #[test]
    fn any_coordinates_hold_up(corners in prop::collection::vec(any::<[[f32; 3]; 3]>(), 1..8)) {
        holds_up(parse, &binary_of(b"", &corners));
    }
}

/// Corners that differ by a step of f32, as modellers round them, and one that lies on the edge of a neighbour.
#[test]
fn what_rounding_tore_apart_is_whole_again() {
    let mut torn = TETRAHEDRON.map(|t| t.map(|p| p.map(|x| 1000.0 + 30.0 * x)));
    // The last face in two, at the middle of an edge.
    let middle = [1015.0, 1015.0, 1000.0];
    let [a, b, c] = torn[3];
    torn[3] = [a, middle, c];
    let mut torn = [&torn[..], &[[middle, b, c]]].concat();
    for (k, x) in torn.iter_mut().flatten().flatten().enumerate() {
        if k % 3 == 0 || k % 5 == 0 {
            *x = x.next_up();
        }
    }
    for bytes in [binary_of(b"binary", &torn), text_of(&torn).into_bytes()] {
        assert!(!corners(&bytes).unwrap().mesh(0.0).unwrap().0.is_closed());
        let (mesh, notes) = parse(&bytes).unwrap();
        assert!(mesh.is_closed() && mesh.triangles().len() == 6, "{notes}");
        assert_eq!((mesh.vertices().len(), notes.split_edges), (5, 1), "{notes}");
        // A step is 2⁻¹⁴ mm.
        assert!(notes.moved > 0.0 && notes.moved < 4e-4, "{notes}");
    }
}
