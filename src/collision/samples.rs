//! Meshes, holders, cutters and numbers that tests share.
#![allow(missing_docs, clippy::unwrap_used)]

use cutter::{AptWords, Cutter, Holder, HolderSection, Solid};
use geometry::{Aabb, Bvh, Point3, TriangleMesh, Vector3};

/// Deterministic numbers (xorshift64*, Vigna 2016).
pub struct Numbers(pub u64);

impl Numbers {
    pub fn within(&mut self, low: f64, high: f64) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        let share = (self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 11) as f64 / (1u64 << 53) as f64;
        low + (high - low) * share
    }

    pub fn direction(&mut self) -> Vector3 {
        loop {
            let v = Vector3::from_fn(|_, _| self.within(-1.0, 1.0));
            if v.norm() < 1.0 && v.norm() > 0.1 {
                return v.normalize();
            }
        }
    }

    pub fn point(&mut self, size: f64) -> Point3 {
        Point3::from(Vector3::from_fn(|_, _| self.within(-size, size)))
    }
}

pub fn mesh(vertices: Vec<Point3>, triangles: Vec<[u32; 3]>) -> (TriangleMesh, Bvh) {
    let mesh = TriangleMesh::new(vertices, triangles).unwrap().0;
    let bvh = Bvh::new(&mesh);
    (mesh, bvh)
}

/// A box with its outside outward.
pub fn block(low: [f64; 3], high: [f64; 3]) -> (TriangleMesh, Bvh) {
    let (vertices, triangles) = Aabb { min: low.into(), max: high.into() }.surface();
    mesh(vertices, triangles)
}

/// A height field over a square, `n` quads a side.
pub fn sheet(size: f64, n: u32, z: impl Fn(f64, f64) -> f64) -> (TriangleMesh, Bvh) {
    let at = |k: u32| size * (f64::from(k) / f64::from(n) - 0.5);
    let vertex = |i: u32| {
        let (x, y) = (at(i % (n + 1)), at(i / (n + 1)));
        Point3::new(x, y, z(x, y))
    };
    let quads = (0..n * n).map(|q| (q / n) * (n + 1) + q % n);
    let triangles = quads.flat_map(|a| [[a, a + 1, a + n + 2], [a, a + n + 2, a + n + 1]]).collect();
    mesh((0..(n + 1) * (n + 1)).map(vertex).collect(), triangles)
}

pub fn holder(cutting_length: f64) -> Holder {
    let section = |diameter, top_diameter, length| HolderSection { diameter, top_diameter, length };
    let sections = vec![section(6.0, 6.0, 20.0), section(16.0, 24.0, 15.0), section(40.0, 34.0, 30.0)];
    Holder::new(cutting_length, sections).unwrap()
}

pub fn cutters() -> Vec<Cutter> {
    let taper = |corner: f64| Cutter::taper(2.0, corner, 10f64.to_radians(), 5.0).unwrap();
    let named = [Cutter::ball(6.0), Cutter::flat(6.0), Cutter::bull(6.0, 1.0)].map(Result::unwrap);
    let apt = AptWords::examples().into_iter().map(|words| Cutter::apt(&words).unwrap());
    named.into_iter().chain([taper(1.0), taper(0.3), taper(0.0)]).chain(apt).collect()
}

pub fn solids() -> Vec<Solid> {
    let of = |cutter: &Cutter| {
        [
            Solid::of_cutter(cutter, None),
            Solid::of_cutter(cutter, Some(&holder(4.0))),
            Solid::of_tool(cutter, &holder(9.0)),
        ]
    };
    cutters().iter().flat_map(of).chain([Solid::of_holder(&holder(3.0))]).collect()
}

pub fn close(a: f64, b: f64) {
    assert!((a - b).abs() < 1e-9, "{a} {b}");
}
