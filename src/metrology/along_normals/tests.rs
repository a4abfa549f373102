use super::super::flat_scene::{path, plane};
use super::*;
use cutter::Solid;
use geometry::{Aabb, TriangleMesh, distance_to_segment, samples};
use motion::{ClPoint, Move, MoveKind};
use part::Patch;
use scallop::ball_scallop_height;
use sim::{Rays, Stock, VoxelEngine};
use work::monitor::Silent;

const RADIUS: f64 = 3.0;
const LIMITS: Limits = Limits { scallop: 0.02, gouge: 0.005, uncut: 0.05, chord: 0.001 };

/// What is cut of a block far larger than the part, looked for as far as `reach`, mm, on both sides of it.
fn swept<'a>(part: &'a Part, cut: &'a dyn FirstCut, reach: f64) -> SweptVolume<'a> {
    let block = Aabb { min: Point3::new(-1e3, -1e3, -1e3), max: Point3::new(1e3, 1e3, 1e3) };
    SweptVolume { part, cut, inward: reach, outward: reach, shallow: 1e-6, block }
}

/// All moves of a ball, one by one: steps as long as the distance.
struct BruteForce<'a>(&'a Toolpath);

impl AlongNormal for BruteForce<'_> {
    fn hit(&self, point: &Point3, normal: &Vector3, _: Option<&NormalHit>) -> Option<NormalHit> {
        let up = Vector3::z() * RADIUS;
        let mut best: Option<NormalHit> = None;
        for (k, (from, to, step)) in self.0.segments().enumerate() {
            if step.kind == MoveKind::Rapid {
                continue;
            }
            let (a, b) = (from + up, to + up);
            let mut s = -1.0;
            while s < best.map_or(self.reach(), |best| best.deviation) {
                let d = distance_to_segment(&(point + normal * s), &a, &b) - RADIUS;
                if d < 1e-12 {
                    let at = point + normal * s;
                    let t = ((at - a).dot(&(b - a)) / (b - a).norm_squared()).clamp(0.0, 1.0);
                    let inward = (a + (b - a) * t - at) / RADIUS;
                    best = Some(NormalHit {
                        way: Way::Normal,
                        deviation: s,
                        by: k as u32,
                        normal: inward,
                        seed: 0,
                        uncertain: 0.0,
                    });
                    break;
                }
                s += d;
            }
        }
        best
    }

    fn reach(&self) -> f64 {
        0.5
    }

    fn depth(&self) -> f64 {
        1.0
    }
}

fn measured(part: &Part, path: &Toolpath, spacing: f64) -> (Measurement, NormalMap) {
    let ball = Cutter::ball(2.0 * RADIUS).unwrap();
    measure_along_normals(part, &ball, path, &BruteForce(path), spacing, &LIMITS, 1e-4, None, &Silent)
        .unwrap()
}

/// Passes along x, half a mm apart, the third one `lower` by so much.
fn passes(lower: f64) -> Vec<Vec<Point3>> {
    let tip = |x: f64, k: usize| Point3::new(x, 0.5 * k as f64, if k == 3 { -lower } else { 0.0 });
    (0..7)
        .map(|k| if k % 2 == 0 { vec![tip(-4.0, k), tip(8.0, k)] } else { vec![tip(8.0, k), tip(-4.0, k)] })
        .collect()
}

#[test]
fn a_plane_has_the_scallops_of_the_closed_form_whatever_the_spacing() {
    for spacing in [0.17, 0.31] {
        let (measured, map) = measured(&plane([4.0, 3.0]), &path(&passes(0.0)), spacing);
        let exact = RADIUS - (RADIUS * RADIUS - 0.0625).sqrt();
        let scallop = &measured.scallop;
        let (max, p50) = (scallop.max_mm.unwrap(), scallop.p50_mm.unwrap());
        assert!((max - exact).abs() < 1e-7 && (p50 - exact).abs() < 1e-7, "{max} {p50} {exact}");
        assert!(scallop.error_bound_mm.unwrap() < 3e-4, "{scallop:?}");
        assert!((scallop.ridge_length_mm / 24.0 - 1.0).abs() < 1e-3, "six ridges of 4 mm: {scallop:?}");
        assert!(measured.gouge.max_depth_mm < 1e-9 && measured.uncut.region_count == 0);
        assert!((measured.deviation.area_mm2 - 12.0).abs() < 1e-9);
        assert_eq!(map.points.len(), map.deviations.len());
    }
}

/// Passes half a mm apart, and a border 0.2 mm beside the last one, by places half an interval and more
/// apart.
#[test]
fn a_look_at_ridges_alone_finds_their_heights_and_what_stands_along_borders() {
    let (part, path) = (plane([4.0, 3.2]), path(&passes(0.0)));
    let cutters = Cutter::ball(2.0 * RADIUS).unwrap().into();
    let limits = Limits { scallop: 0.005, ..LIMITS };
    let sagitta = |half: f64| RADIUS - (RADIUS * RADIUS - half * half).sqrt();
    for spacing in [0.25, 0.41] {
        let net = Net::over(&part, spacing);
        let (engine, asked) = (&BruteForce(&path), 1e-4);
        let along = Along {
            part: &part,
            cutters: &cutters,
            path: &path,
            engine,
            limits: &limits,
            spacing,
            asked,
            most_divided: 0,
            figures: Figure::ALL,
        };
        let map = along.ridges(&net, &Silent).unwrap();
        let (max, p50) = (map.scallop.max_mm.unwrap(), map.scallop.p50_mm.unwrap());
        assert!((max / sagitta(0.25) - 1.0).abs() < 0.01, "{max} {}", sagitta(0.25));
        assert!((p50 / sagitta(0.25) - 1.0).abs() < 0.01, "{p50}");
        // Ridges end at the border as well.
        assert!(map.border >= sagitta(0.2) - 1e-9 && map.border <= max, "{} {max}", map.border);
        let beside: Vec<f64> =
            map.above.iter().filter(|place| place.at.y > 3.19).map(|place| place.height).collect();
        assert!(beside.len() > 9, "{beside:?}");
        assert!(beside.iter().all(|height| (height - sagitta(0.2)).abs() < 1e-6), "{beside:?}");
        assert!(map.above.iter().any(|place| (place.at.y - 1.25).abs() < 0.01));
    }
}

/// A pass 1 mm deep, where no deeper than 0.6 mm is looked: that is cut for certain, and the bound holds the
/// rest.
#[test]
fn what_is_cut_deeper_than_is_looked_has_a_bound_that_holds_it() {
    let (part, path) = (plane([4.0, 3.0]), path(&passes(1.0)));
    let cutter = Cutter::ball(2.0 * RADIUS).unwrap();
    let solid = Solid::of_cutter(&cutter, None);
    let rays = Rays::new(&path, &solid, &Silent).unwrap();
    let by_rays = RaysCut { rays: &rays, path: &path, solid: &solid };
    for (reach, bound) in [(0.6, f64::INFINITY), (1.5, 1e-3)] {
        let cut = swept(&part, &by_rays, reach);
        let (measured, _) =
            measure_along_normals(&part, &cutter, &path, &cut, 0.2, &LIMITS, 1e-4, None, &Silent).unwrap();
        let gouge = &measured.gouge;
        assert!((gouge.max_depth_mm - 1.0).abs() <= gouge.error_bound_mm, "{gouge:?}");
        assert!(gouge.error_bound_mm < bound && gouge.at_least_mm > reach.min(1.0) - 1e-3, "{gouge:?}");
    }
}

#[test]
fn a_gouge_is_found_with_its_depth_area_and_move() {
    let (measured, _) = measured(&plane([4.0, 3.0]), &path(&passes(0.03)), 0.1);
    let gouge = &measured.gouge;
    assert!((gouge.max_depth_mm - 0.03).abs() <= gouge.error_bound_mm, "{gouge:?}");
    assert!((gouge.max_depth_mm - 0.03).abs() < 1e-4 && gouge.error_bound_mm < 1e-3, "{gouge:?}");
    assert_eq!((gouge.region_count, gouge.regions[0].move_index), (1, 7));
    // Deeper than 5 µm over 2 √(2 r 0.025) across, less what the neighbours cut not.
    let width = 2.0 * (2.0 * RADIUS * 0.025f64).sqrt();
    assert!((gouge.area_mm2 / (4.0 * width) - 1.0).abs() < 0.1, "{gouge:?}");
}

/// A ball dips a little deeper than the limit, in the middle between places that are four times as far apart as
/// the dip is wide.
#[test]
fn a_gouge_between_the_places_has_a_place_and_a_move_as_well() {
    let dip = [1.0, -0.0055, 1.0].map(|z| Point3::new(2.2, 1.3, z));
    let (measured, map) = measured(&plane([4.0, 3.0]), &path(&[dip.to_vec()]), 0.8);
    let gouge = &measured.gouge;
    assert!((gouge.max_depth_mm - 0.0055).abs() <= gouge.error_bound_mm, "{gouge:?}");
    assert!(map.deviations.iter().all(|x| x.is_nan() || *x > -5e-3), "the net is to miss it");
    let [region] = &gouge.regions[..] else { panic!("{gouge:?}") };
    assert!((Point3::from(region.at_mm) - dip[1]).norm() < 0.06, "{region:?}");
    assert_eq!((gouge.region_count, region.depth_mm, region.area_mm2), (1, gouge.max_depth_mm, 0.0));
    assert!([1, 2].contains(&region.move_index), "{region:?}");
}

/// Passes along x with tips at these places across, in turns.
fn along_x(tips: &[[f64; 2]]) -> Vec<Vec<Point3>> {
    let pass = |(k, [y, z]): (usize, &[f64; 2])| {
        let ends = if k % 2 == 0 { [-4.0, 8.0] } else { [8.0, -4.0] };
        ends.map(|x| Point3::new(x, *y, *z)).to_vec()
    };
    tips.iter().enumerate().map(pass).collect()
}

/// A tall scallop is a bad scallop; no place of it is uncut, neither beside a missing pass nor everywhere.
#[test]
fn tall_scallops_are_scallops() {
    let mut missing = passes(0.0);
    missing.drain(2..5);
    let even: Vec<[f64; 2]> = (0..3).map(|k| [1.5 * f64::from(k), 0.0]).collect();
    for (passes, apart) in [(missing, 2.0f64), (along_x(&even), 1.5)] {
        let (measured, _) = measured(&plane([4.0, 3.0]), &path(&passes), 0.1);
        let exact = RADIUS - (RADIUS * RADIUS - 0.25 * apart * apart).sqrt();
        assert!(exact > 0.09);
        let (height, bound) = (measured.scallop.max_mm.unwrap(), measured.scallop.error_bound_mm.unwrap());
        assert!((height - exact).abs() < 1e-6 && bound < 3e-4, "{height} ± {bound}, {exact}");
        let uncut = &measured.uncut;
        assert_eq!((uncut.region_count, uncut.area_mm2, uncut.max_height_mm), (0, 0.0, 0.0), "{uncut:?}");
        assert!(uncut.error_bound_mm < 1e-3, "{uncut:?}");
    }
}

/// Where no pass comes, and along the bottom of a right angle that the ball does not fit.
#[test]
fn what_no_pass_came_down_to_is_uncut() {
    let half: Vec<[f64; 2]> = (0..4).map(|k| [0.5 * f64::from(k), 0.0]).collect();
    let (bare, _) = measured(&plane([4.0, 6.0]), &path(&along_x(&half)), 0.1);
    assert_eq!((bare.uncut.region_count, bare.uncut.max_height_mm), (1, 0.5), "{:?}", bare.uncut);
    // From where the last pass rises above the tolerance on.
    let width = 4.5 - (RADIUS * RADIUS - (RADIUS - 0.05f64).powi(2)).sqrt();
    assert!((bare.uncut.area_mm2 / (4.0 * width) - 1.0).abs() < 0.05, "{:?}", bare.uncut);

    let corners = [
        [0.0, 0.0, 0.0],
        [4.0, 0.0, 0.0],
        [0.0, 6.0, 6.0],
        [4.0, 6.0, 6.0],
        [0.0, -6.0, 6.0],
        [4.0, -6.0, 6.0],
    ];
    let triangles = vec![[0, 1, 2], [1, 3, 2], [0, 4, 1], [1, 4, 5]];
    let part = Part::from_mesh(TriangleMesh::new(corners.map(Point3::from).to_vec(), triangles).unwrap().0);
    // The centre goes down one wall and up the other, half a mm at a time.
    let bottom = RADIUS * 2f64.sqrt() - RADIUS;
    let down = |k: i32| f64::from(k.abs()) * 0.5 * 0.5f64.sqrt();
    let tips: Vec<[f64; 2]> = (-8..=8).map(|k| [down(k).copysign(f64::from(k)), bottom + down(k)]).collect();
    let (groove, _) = measured(&part, &path(&along_x(&tips)), 0.1);
    // Along either wall's normal at the bottom, up to the ball that touches both.
    let exact = RADIUS * (2f64.sqrt() - 1.0);
    assert!(groove.uncut.max_height_mm > 0.4 && groove.uncut.max_height_mm <= exact * 2f64.sqrt());
    assert!(groove.uncut.region_count >= 1 && groove.uncut.area_mm2 > 4.0, "{:?}", groove.uncut);
    let scallop = groove.scallop.max_mm.unwrap();
    assert!((scallop - (RADIUS - (RADIUS * RADIUS - 0.0625).sqrt())).abs() < 1e-4, "{scallop}");
}

/// What no pass cut stands as high as the stock, or as far as is looked, and at most as high as the stock.
#[test]
fn what_was_never_cut_stands_as_high_as_the_stock() {
    let half: Vec<[f64; 2]> = (0..4).map(|k| [0.5 * f64::from(k), 0.0]).collect();
    let (part, path) = (plane([3.0, 4.0]), path(&along_x(&half)));
    let ball = Cutter::ball(2.0 * RADIUS).unwrap();
    let solid = Solid::of_cutter(&ball, None);
    let rays = Rays::new(&path, &solid, &Silent).unwrap();
    let by_rays = RaysCut { rays: &rays, path: &path, solid: &solid };
    let limits = Limits { scallop: 0.02, gouge: 0.005, uncut: 0.05, chord: 0.001 };
    for (top, height, most) in [(0.3, 0.3, 0.301), (0.9, 0.9, 0.901), (2.5, 1.0, 2.501)] {
        let mut block = part.bounds();
        block.max.z = top;
        let cut = SweptVolume { block, ..swept(&part, &by_rays, 1.0) };
        let (measured, _) =
            measure_along_normals(&part, &ball, &path, &cut, 0.1, &limits, 1e-4, None, &Silent).unwrap();
        let (found, bound) = (measured.uncut.max_height_mm, measured.uncut.error_bound_mm);
        assert!((found - height).abs() < 1e-9, "{found} of {height}");
        assert!(found + bound >= top && found + bound <= most, "{found} ± {bound} under {top}");
    }
}

/// A ball beside the upper border of a slope, as deep below it as it is wide, cuts the edge by micrometres.
/// The way down along the slope's normal leads out over the border, where the ball has cut all.
#[test]
fn a_cut_beside_the_border_of_a_sheet_is_as_deep_as_it_is_far_from_its_wall() {
    let corners = [[0.0, 0.0, 0.0], [0.0, 3.0, -3.0], [1.0, 0.0, 0.0], [1.0, 3.0, -3.0]].map(Point3::from);
    let part = Part::from_mesh(TriangleMesh::new(corners.to_vec(), vec![[0, 2, 1], [2, 3, 1]]).unwrap().0);
    let ball = Cutter::ball(2.0 * RADIUS).unwrap();
    let solid = Solid::of_cutter(&ball, None);
    for deep in [0.001, 0.02] {
        let path = path(&along_x(&[[deep - RADIUS, -RADIUS]]));
        let rays = Rays::new(&path, &solid, &Silent).unwrap();
        let by_rays = RaysCut { rays: &rays, path: &path, solid: &solid };
        let cut = swept(&part, &by_rays, 1.0);
        let (found, _) =
            measure_along_normals(&part, &ball, &path, &cut, 0.1, &LIMITS, 1e-3, None, &Silent).unwrap();
        let gouge = &found.gouge;
        // On the ball, as far from the wall as from the slope.
        let on_ball = |down: f64| (RADIUS * RADIUS - down * down).sqrt() - RADIUS + deep;
        let truth = (0..9).fold(deep, |truth, _| on_ball(truth * (1.0 + 2f64.sqrt())));
        let off = (gouge.max_depth_mm - truth).abs();
        assert!(off <= gouge.error_bound_mm, "{deep}: {truth} {gouge:?}");
        // The limit is decided.
        let to_limit = (LIMITS.gouge - gouge.max_depth_mm).abs();
        assert!(
            gouge.error_bound_mm < to_limit && gouge.error_bound_mm < 2.5e-3,
            "{deep}: {truth} {gouge:?}"
        );
    }
}

/// A ball plunges aside into a wall of 85 degrees, a millimetre below its top, where its shank cuts as well: the
/// way along the middle between wall and top is longer than the one along the wall's normal.
#[test]
fn a_deep_cut_below_a_step_is_as_deep_as_the_lesser_way() {
    let (lean, high, radius) = (0.35, 4.0, 2.0);
    let corners = [[0.0, 0.0], [lean, high], [3.0, high]];
    let corners = corners.iter().flat_map(|&[y, z]| [0.0, 5.0].map(|x| Point3::new(x, y, z))).collect();
    let triangles = vec![[0, 1, 3], [0, 3, 2], [2, 3, 5], [2, 5, 4]];
    let part = Part::from_mesh(TriangleMesh::new(corners, triangles).unwrap().0);
    let ball = Cutter::ball(2.0 * radius).unwrap();
    let solid = Solid::of_cutter(&ball, None);
    let path = path(&[[-1.9, -1.5].map(|y| Point3::new(2.5, y, 1.0)).to_vec()]);
    let rays = Rays::new(&path, &solid, &Silent).unwrap();
    let by_rays = RaysCut { rays: &rays, path: &path, solid: &solid };
    let cut = swept(&part, &by_rays, 2.0);
    let (found, _) =
        measure_along_normals(&part, &ball, &path, &cut, 0.1, &LIMITS, 1e-3, None, &Silent).unwrap();
    let gouge = &found.gouge;
    let truth = radius - (1.5 * high + lean * (1.0 + radius)) / high.hypot(lean);
    assert!((gouge.max_depth_mm - truth).abs() <= gouge.error_bound_mm, "{truth} {gouge:?}");
}

/// A wall, the ground that falls from its crest, and walls at both ends of it, cut as deep as the ground lies
/// below its passes: the way inward from the crest leads out over the ground, and at the corners from ridge
/// to ridge over a third face.
#[test]
fn a_crest_that_stands_is_no_gouge_and_its_corners_are_as_deep_as_they_are_lower() {
    let (fall, low) = (0.45, -4.0);
    let top = [[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]];
    let above = top.map(|[x, y]| Point3::new(x, y, -fall * y));
    let below = top.map(|[x, y]| Point3::new(x, y, low));
    let triangles =
        vec![[0, 1, 2], [0, 2, 3], [4, 5, 1], [4, 1, 0], [5, 6, 2], [5, 2, 1], [7, 4, 0], [7, 0, 3]];
    let mesh = TriangleMesh::new([above, below].concat(), triangles).unwrap().0;
    let part = Part::from_mesh(mesh);
    let normal = Vector3::new(0.0, fall, 1.0).normalize();
    let ball = Cutter::ball(2.0 * RADIUS).unwrap();
    let solid = Solid::of_cutter(&ball, None);
    for deep in [-2e-5, 1e-3] {
        let tip = |k: usize| {
            let y = 0.25 * k as f64;
            let centre = Point3::new(0.0, y, -fall * y) + normal * (RADIUS - deep);
            [centre.y, centre.z - RADIUS]
        };
        let path = path(&along_x(&(0..13).map(tip).collect::<Vec<_>>()));
        let rays = Rays::new(&path, &solid, &Silent).unwrap();
        let by_rays = RaysCut { rays: &rays, path: &path, solid: &solid };
        let cut = swept(&part, &by_rays, 1.0);
        let (found, _) =
            measure_along_normals(&part, &ball, &path, &cut, 0.1, &LIMITS, 1e-4, None, &Silent).unwrap();
        let gouge = &found.gouge;
        assert!(gouge.max_depth_mm >= deep && gouge.max_depth_mm <= 3.0 * deep.max(0.0), "{deep}: {gouge:?}");
        assert!(gouge.max_depth_mm + gouge.error_bound_mm < LIMITS.gouge, "{deep}: {gouge:?}");
    }
}

/// A wedge of 15 degrees whose one face is cut to size, or a little deeper, while stock stands on the other: lines
/// along the normals of that run through the wedge, and come out where the first face was cut.
#[test]
fn what_stands_beside_a_sharp_edge_is_as_high_as_elsewhere() {
    let (slope, high) = (7.5f64.to_radians().tan(), 0.2);
    let corners = [[0.0, 0.0], [1.0, slope], [1.0, -slope]];
    let corners = corners.iter().flat_map(|&[y, z]| [0.0, 1.0].map(|x| Point3::new(x, y, z))).collect();
    let triangles = vec![[0, 1, 3], [0, 3, 2], [0, 4, 5], [0, 5, 1]];
    let part = Part::from_mesh(TriangleMesh::new(corners, triangles).unwrap().0);
    let [upper, lower] = [1.0, -1.0].map(|up| Vector3::new(0.0, -slope, up).normalize());
    let ball = Cutter::ball(2.0 * RADIUS).unwrap();
    let solid = Solid::of_cutter(&ball, None);
    for deep in [0.0, 1e-3] {
        // Each face with a tool that stands upright on it.
        let faces = [(1.0, upper * (RADIUS + high)), (-1.0, lower * (RADIUS - deep))];
        let mut moves = Vec::new();
        for (pass, (up, off)) in (0..40).flat_map(|k| faces.map(|face| (k, face))) {
            let y = 0.05 * f64::from(pass) - 0.5;
            for (x, kind) in [(-4.0, MoveKind::Rapid), (8.0, MoveKind::Cut)] {
                let (centre, axis) = (Point3::new(x, y, up * slope * y) + off, Vector3::z() * up);
                let to = ClPoint { tip: centre - axis * RADIUS, axis };
                moves.push(Move { to, kind, feed_rate: 1000.0, pass });
            }
        }
        let path = Toolpath::new(moves[0].to, moves);
        let rays = Rays::new(&path, &solid, &Silent).unwrap();
        let by_rays = RaysCut { rays: &rays, path: &path, solid: &solid };
        let cut = swept(&part, &by_rays, 1.0);
        // Between two passes a little more.
        let holds = |height: f64| height >= high - 1e-9 && height <= high + 0.025f64.powi(2) / RADIUS;
        for y in [0.0, 1e-7, 1e-5, 1e-3, 0.01, 0.1, 0.5] {
            let hit = cut.hit(&Point3::new(0.4, y, slope * y), &upper, None).unwrap();
            assert!(holds(hit.deviation), "{deep} {y}: {hit:?}");
        }
        let (found, _) =
            measure_along_normals(&part, &ball, &path, &cut, 0.1, &LIMITS, 1e-3, None, &Silent).unwrap();
        let (uncut, gouge) = (&found.uncut, &found.gouge);
        assert!(holds(uncut.max_height_mm) && uncut.error_bound_mm < 1e-3, "{deep}: {uncut:?}");
        assert!((uncut.area_mm2 - slope.hypot(1.0)).abs() < 0.01, "{deep}: {uncut:?}");
        assert!(gouge.max_depth_mm - gouge.error_bound_mm <= 8.0 * deep, "{deep}: {gouge:?}");
    }
}

/// A wall in the side of the block, and one a millimetre within it, which nothing cuts.
#[test]
fn before_a_wall_stands_no_more_than_the_block_holds() {
    let (part, up) = (plane([4.0, 3.0]), path(&passes(0.0)));
    let solid = Solid::of_cutter(&Cutter::ball(2.0 * RADIUS).unwrap(), None);
    let rays = Rays::new(&up, &solid, &Silent).unwrap();
    let by_rays = RaysCut { rays: &rays, path: &up, solid: &solid };
    let block = Aabb { min: Point3::new(0.0, 0.0, -5.0), max: Point3::new(4.0, 3.0, 2.0) };
    let cut = SweptVolume { block, ..swept(&part, &by_rays, 2.5) };
    for (x, left) in [(0.0, 0.0), (1.0, 1.0), (3.0, 2.5)] {
        let (place, outward) = (Point3::new(x, 1.0, -2.0), -Vector3::x());
        assert!(cut.hit(&place, &outward, None).is_none());
        assert_eq!(cut.standing(&place, &outward), left);
    }
}

/// Knives of ten and of four degrees, one face of which is cut too deep: the crest is lower by what is lost over
/// the sine of half the angle.
#[test]
fn a_cut_beside_the_crest_of_a_knife_is_as_deep_as_the_crest_is_lower() {
    for half in [5f64, 2.0] {
        let (slope, deep) = (half.to_radians().tan(), 2e-3);
        let corners = [[0.0, 0.0], [1.0, slope], [1.0, -slope]];
        let corners = corners.iter().flat_map(|&[y, z]| [0.0, 1.0].map(|x| Point3::new(x, y, z))).collect();
        let triangles = vec![[0, 1, 3], [0, 3, 2], [0, 4, 5], [0, 5, 1]];
        let part = Part::from_mesh(TriangleMesh::new(corners, triangles).unwrap().0);
        let ball = Cutter::ball(2.0 * RADIUS).unwrap();
        let solid = Solid::of_cutter(&ball, None);
        for lost in [1.0, -1.0] {
            let mut moves = Vec::new();
            for (pass, up) in (0..24).flat_map(|k| [1.0, -1.0].map(|up| (k, up))) {
                let normal = Vector3::new(0.0, -slope, up).normalize();
                let y = 0.1 * f64::from(pass) - 0.5;
                let axis = (Vector3::z() * up - Vector3::y()).normalize();
                for (x, kind) in [(-4.0, MoveKind::Rapid), (8.0, MoveKind::Cut)] {
                    let off = normal * (RADIUS - if up == lost { deep } else { 0.0 });
                    let tip = Point3::new(x, y, up * slope * y) + off - axis * RADIUS;
                    moves.push(Move { to: ClPoint { tip, axis }, kind, feed_rate: 1000.0, pass });
                }
            }
            let path = Toolpath::new(moves[0].to, moves);
            let rays = Rays::new(&path, &solid, &Silent).unwrap();
            let by_rays = RaysCut { rays: &rays, path: &path, solid: &solid };
            let cut = swept(&part, &by_rays, 1.0);
            let (found, _) =
                measure_along_normals(&part, &ball, &path, &cut, 0.1, &LIMITS, 1e-3, None, &Silent).unwrap();
            // How far the crest is cut off, by all balls.
            let is_cut = |y: f64| {
                let passes = path.moves.iter().map(|step| step.to.tip + step.to.axis * RADIUS);
                passes.map(|centre| (centre.y - y).hypot(centre.z)).any(|distance| distance < RADIUS)
            };
            let truth = (1..).map(|k| 1e-5 * f64::from(k)).find(|y| !is_cut(*y)).unwrap();
            let gouge = found.gouge;
            let off = (gouge.max_depth_mm - truth).abs();
            assert!(off < 1e-5 + gouge.error_bound_mm, "{half} {lost}: {truth} {gouge:?}");
            assert!(truth > 0.7 * deep / half.to_radians().sin() && gouge.error_bound_mm < 1e-3, "{gouge:?}");
        }
    }
}

/// A ball that dips into the corner of a block: lines along the walls, and along the middle of both walls,
/// graze what it took of the top.
#[test]
fn a_corner_is_cut_as_deep_as_it_is_lower() {
    let (deep, low) = (3e-4, -4.0);
    let side = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]];
    let ring = |z: f64| side.map(|[x, y]| Point3::new(x, y, z));
    let triangles = vec![
        [0, 1, 2],
        [0, 2, 3],
        [4, 5, 1],
        [4, 1, 0],
        [5, 6, 2],
        [5, 2, 1],
        [6, 7, 3],
        [6, 3, 2],
        [7, 4, 0],
        [7, 0, 3],
    ];
    let block = TriangleMesh::new([ring(0.0), ring(low)].concat(), triangles).unwrap().0;
    let (part, ball) = (Part::from_mesh(block), Cutter::ball(2.0 * RADIUS).unwrap());
    let solid = Solid::of_cutter(&ball, None);
    let down = |z: f64| Move {
        to: ClPoint::upright(Point3::new(0.0, 0.0, z)),
        kind: MoveKind::Cut,
        feed_rate: 1000.0,
        pass: 0,
    };
    let path = Toolpath::new(ClPoint::upright(Point3::new(0.0, 0.0, 2.0)), vec![down(-deep)]);
    let rays = Rays::new(&path, &solid, &Silent).unwrap();
    let by_rays = RaysCut { rays: &rays, path: &path, solid: &solid };
    let cut = swept(&part, &by_rays, 1.0);
    // The line down the middle of all three faces is the longest that counts.
    for below in [1e-7, 1e-6, 1e-5, 1e-4] {
        for normal in [-Vector3::x(), -Vector3::y()] {
            let hit = cut.hit(&Point3::new(0.0, 0.0, -below), &normal, None).unwrap();
            let depth = -hit.deviation;
            assert!(depth > 0.0 && depth <= 3f64.sqrt() * deep, "{below}: {hit:?}");
        }
    }
}

/// Along the foot of a wall, a mm before it, a flat end cuts the floor: lines along the wall's normal graze
/// what was cut, so that its slope says nothing.
#[test]
fn a_wall_that_nothing_comes_near_to_is_not_gouged() {
    let corners = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [4.0, 0.0, 2.0], [0.0, 0.0, 2.0]].map(Point3::from);
    let wall = TriangleMesh::new(corners.to_vec(), vec![[0, 1, 2], [0, 2, 3]]).unwrap().0;
    let (part, flat) = (Part::from_mesh(wall), Cutter::flat(2.0 * RADIUS).unwrap());
    let (path, solid) = (path(&along_x(&[[-RADIUS - 1.0, 0.0]])), Solid::of_cutter(&flat, None));
    let rays = Rays::new(&path, &solid, &Silent).unwrap();
    let by_rays = RaysCut { rays: &rays, path: &path, solid: &solid };
    let cut = swept(&part, &by_rays, 2.0);
    let (found, _) =
        measure_along_normals(&part, &flat, &path, &cut, 0.5, &LIMITS, 1e-4, None, &Silent).unwrap();
    let gouge = &found.gouge;
    assert!(gouge.max_depth_mm == 0.0 && gouge.error_bound_mm <= 1e-6, "{gouge:?}");
    assert!((found.uncut.max_height_mm - 1.0).abs() < 1e-5, "{:?}", found.uncut);
}

/// Rings of constant latitude around a dome: sections across the feed are circles.
#[test]
fn a_dome_has_the_scallops_of_a_circle_also_where_it_is_steep() {
    let (centre, rho) = (Point3::new(0.0, 0.0, 0.0), 10.0);
    let part = Part::from_patches(vec![Patch::Nurbs(samples::hemisphere(centre, rho))], 0.01).unwrap();
    let step = 0.06f64;
    let ring = |k: usize| {
        let polar = 0.5 * step + step * k as f64;
        let at = |n: usize| {
            let turn = std::f64::consts::TAU * n as f64 / 240.0;
            let normal = Vector3::new(polar.sin() * turn.cos(), polar.sin() * turn.sin(), polar.cos());
            centre + normal * (rho + RADIUS) - Vector3::z() * RADIUS
        };
        (0..=240).map(at).collect::<Vec<_>>()
    };
    // One ring more, below the equator, would let the shank cut the dome.
    let rings: Vec<Vec<Point3>> = (0..26).map(ring).collect();
    let (path, ball) = (path(&rings), Cutter::ball(2.0 * RADIUS).unwrap());
    let solid = Solid::of_cutter(&ball, None);
    let rays = Rays::new(&path, &solid, &Silent).unwrap();
    let by_rays = RaysCut { rays: &rays, path: &path, solid: &solid };
    let cut = swept(&part, &by_rays, 1.0);
    let (measured, map) =
        measure_along_normals(&part, &ball, &path, &cut, 0.25, &LIMITS, 5e-4, None, &Silent).unwrap();
    let exact = ball_scallop_height(RADIUS, -1.0 / rho, step * rho).unwrap();
    let (max, p50) = (measured.scallop.max_mm.unwrap(), measured.scallop.p50_mm.unwrap());
    // Chords of 240 a turn lie up to 1.1 µm inside the greatest ring.
    assert!((p50 - exact).abs() < 1.5e-3 && (max - exact).abs() < 2e-3, "{p50} {max} {exact}");
    assert!(measured.gouge.max_depth_mm < 1.3e-3, "{:?}", measured.gouge);
    let length: f64 = (1..26).map(|k| std::f64::consts::TAU * rho * (step * k as f64).sin()).sum();
    assert!(
        (measured.scallop.ridge_length_mm / length - 1.0).abs() < 0.02,
        "{length} {:?}",
        measured.scallop
    );
    assert_eq!(map.grids.len(), 1);
}

/// The figures by rays and by voxels of the same moves, all of which cut.
fn by_both(
    part: &Part,
    cutter: &Cutter,
    locations: &[Vec<ClPoint>],
    voxel: f64,
) -> [(Measurement, NormalMap); 2] {
    let step = |pass: usize, to: ClPoint| Move { to, kind: MoveKind::Cut, feed_rate: 1e3, pass: pass as u32 };
    let moves = locations.iter().enumerate().flat_map(|(k, pass)| pass.iter().map(move |&at| step(k, at)));
    let path = Toolpath::new(locations[0][0], moves.collect());
    let solid = Solid::of_cutter(cutter, None);
    let reach = 0.6;
    let geometry::Aabb { min, max } = part.bounds();
    let around = Vector3::repeat(reach + 1.0);
    let space = Stock::Box(geometry::Aabb { min: min - around, max: max + around });
    let engine = VoxelEngine::new(&space, &solid, &path).unwrap();
    let voxels = engine.cut(voxel, 1 << 30, &Silent).unwrap();
    let rays = Rays::new(&path, &solid, &Silent).unwrap();
    let by_rays = RaysCut { rays: &rays, path: &path, solid: &solid };
    let by_voxels = VoxelCut { engine: &engine, voxels: &voxels };
    let limits = Limits { scallop: 0.02, gouge: 0.005, uncut: 0.05, chord: 0.001 };
    let cuts: [&dyn FirstCut; 2] = [&by_rays, &by_voxels];
    cuts.map(|cut| {
        let cut = swept(part, cut, reach);
        measure_along_normals(part, cutter, &path, &cut, 0.4, &limits, 1e-3, None, &Silent).unwrap()
    })
}

/// Rays and voxels of a path agree within what both say they may be off, and nearly everywhere far closer.
fn agree(part: &Part, cutter: &Cutter, locations: &[Vec<ClPoint>], voxel: f64, most: f64) {
    let [(rays, at), (voxels, by_voxels)] = by_both(part, cutter, locations, voxel);
    let scallop = |m: &Measurement| (m.scallop.max_mm.unwrap(), m.scallop.error_bound_mm.unwrap());
    let gouge = |m: &Measurement| (m.gouge.max_depth_mm, m.gouge.error_bound_mm);
    let uncut = |m: &Measurement| (m.uncut.max_height_mm, m.uncut.error_bound_mm);
    for figure in [&scallop as &dyn Fn(&Measurement) -> (f64, f64), &gouge, &uncut] {
        let (a, b) = (figure(&rays), figure(&voxels));
        assert!((a.0 - b.0).abs() <= a.1 + b.1 && b.1 < most, "{a:?} {b:?}");
    }
    let pairs = || at.deviations.iter().zip(&by_voxels.deviations);
    assert!(pairs().all(|(a, b)| a.is_nan() == b.is_nan()));
    let mut off: Vec<f32> = pairs().filter(|(a, _)| !a.is_nan()).map(|(a, b)| (a - b).abs()).collect();
    off.sort_by(f32::total_cmp);
    let at = |share: f64| off[((off.len() - 1) as f64 * share) as usize];
    assert!(off.len() > 200 && at(0.9) < 2e-5 && f64::from(at(1.0)) < most, "{} {}", at(0.9), at(1.0));
}

#[test]
fn voxels_measure_what_rays_do_upright_and_tilted() {
    let rho = 6.0;
    let dome =
        Part::from_patches(vec![Patch::Nurbs(samples::hemisphere(Point3::origin(), rho))], 0.01).unwrap();
    let (ball, step) = (Cutter::ball(2.0 * RADIUS).unwrap(), 0.1f64);
    let rings = |lean: f64| {
        let ring = |k: usize| {
            let polar = 0.5 * step + step * k as f64;
            let at = |n: usize| {
                let turn = std::f64::consts::TAU * n as f64 / 120.0;
                let normal = Vector3::new(polar.sin() * turn.cos(), polar.sin() * turn.sin(), polar.cos());
                let axis = (Vector3::z() * (1.0 - lean) + normal * lean).normalize();
                ClPoint { tip: Point3::from(normal * (rho + RADIUS)) - axis * RADIUS, axis }
            };
            (0..=120).map(at).collect()
        };
        (0..16).map(ring).collect::<Vec<Vec<ClPoint>>>()
    };
    for lean in [0.0, 0.6] {
        agree(&dome, &ball, &rings(lean), 0.12, 0.02);
    }
    // A bull that leads by five degrees, one pass too deep and one left out.
    let (bull, lead) = (Cutter::bull(6.0, 1.0).unwrap(), 5f64.to_radians());
    let axis = Vector3::new(lead.sin(), 0.0, lead.cos());
    let pass = |k: usize| {
        let normal = if k == 2 { -0.02 } else { 0.0 };
        let at = |x: f64| {
            let contact = Point3::new(x, 0.9 * k as f64 - 1.0, normal);
            ClPoint { tip: contact + bull.contact_to_tip_along(&Vector3::z(), &axis), axis }
        };
        [-3.0, 7.0].map(at).to_vec()
    };
    let passes: Vec<Vec<ClPoint>> = (0..7).filter(|&k| k != 4).map(pass).collect();
    agree(&plane([4.0, 3.0]), &bull, &passes, 0.1, 0.02);
}

/// An engine that counts how often all moves are asked.
struct Counted<'a> {
    engine: SweptVolume<'a>,
    by_moves: bool,
    lines: std::sync::atomic::AtomicUsize,
}

impl AlongNormal for Counted<'_> {
    fn hit(&self, point: &Point3, normal: &Vector3, near: Option<&NormalHit>) -> Option<NormalHit> {
        self.lines.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        self.engine.hit(point, normal, near)
    }

    fn cut_by(&self, point: &Point3, normal: &Vector3, by: u32) -> Option<RayHit> {
        if self.by_moves { self.engine.cut_by(point, normal, by) } else { None }
    }

    fn normal_of(&self, point: &Point3, normal: &Vector3, hit: &RayHit) -> Option<Vector3> {
        self.engine.normal_of(point, normal, hit)
    }

    fn reach(&self) -> f64 {
        self.engine.reach()
    }

    fn depth(&self) -> f64 {
        self.engine.depth()
    }
}

/// Ridges told by the two moves that meet stand where looks along all moves find them, and take one such look
/// each. On a dome, leaning forth and back, some passes deeper, so that they leave nothing of their
/// neighbours between them.
#[test]
fn the_two_moves_that_meet_tell_the_ridges_that_all_moves_do() {
    let rho = 6.0;
    let dome =
        Part::from_patches(vec![Patch::Nurbs(samples::hemisphere(Point3::origin(), rho))], 0.01).unwrap();
    for cutter in [Cutter::ball(2.0 * RADIUS).unwrap(), Cutter::bull(6.0, 1.0).unwrap()] {
        let ring = |k: usize| {
            let polar = 0.05 + 0.1 * k as f64;
            let lower = if k % 3 == 1 { 0.01 * (k % 4) as f64 } else { 0.0 };
            let at = |n: usize| {
                let turn = std::f64::consts::TAU * n as f64 / 60.0;
                let normal = Vector3::new(polar.sin() * turn.cos(), polar.sin() * turn.sin(), polar.cos());
                let feed =
                    Vector3::new(-turn.sin(), turn.cos(), 0.0) * if k.is_multiple_of(2) { 1.0 } else { -1.0 };
                let axis = (normal + feed * 0.1).normalize();
                let contact = Point3::from(normal * (rho - lower));
                ClPoint { tip: contact + cutter.contact_to_tip_along(&normal, &axis), axis }
            };
            (0..=60).map(at).collect::<Vec<_>>()
        };
        let step =
            |pass: usize, to: ClPoint| Move { to, kind: MoveKind::Cut, feed_rate: 1e3, pass: pass as u32 };
        let rings: Vec<Vec<ClPoint>> = (0..16).map(ring).collect();
        let moves = rings.iter().enumerate().flat_map(|(k, ring)| ring.iter().map(move |&at| step(k, at)));
        let path = Toolpath::new(rings[0][0], moves.collect());
        let solid = Solid::of_cutter(&cutter, None);
        let rays = Rays::new(&path, &solid, &Silent).unwrap();
        let by_rays = RaysCut { rays: &rays, path: &path, solid: &solid };
        let tracks = Tracks::new(&path, cutter);
        let net = Net::over(&dome, 0.2);
        let look = |by_moves: bool| {
            let engine = Counted { engine: swept(&dome, &by_rays, 1.0), by_moves, lines: Default::default() };
            let along = Along {
                part: &dome,
                cutters: &(&cutter).into(),
                path: &path,
                engine: &engine,
                limits: &LIMITS,
                spacing: 0.2,
                asked: 1e-4,
                most_divided: 0,
                figures: Figure::ALL,
            };
            let kept = vec![true; net.places.len()];
            let seen = along.inspection(&tracks).look(&net, &kept, &Silent).unwrap();
            let lines = engine.lines.into_inner() - net.places.len();
            (seen.of_triangle.into_iter().flatten().collect::<Vec<_>>(), lines)
        };
        let ((quick, few), (slow, many)) = (look(true), look(false));
        assert!(
            quick.len() > 1000 && quick.len().abs_diff(slow.len()) * 100 <= slow.len(),
            "{} {}",
            quick.len(),
            slow.len()
        );
        let near = |c: &&Crossing| slow.iter().find(|other| (other.at - c.at).norm() < 1e-4);
        let off: Vec<f64> = quick.iter().filter_map(|c| Some((c.height - near(&c)?.height).abs())).collect();
        let worst = off.iter().copied().fold(0.0, f64::max);
        assert!(
            off.len() * 100 >= quick.len() * 99 && worst < 1e-5,
            "{} of {}, {worst}",
            off.len(),
            quick.len()
        );
        assert!(few * 3 < many, "{few} {many}");
    }
}

/// Two passes that meet in the middle of a place's way, as deep as is looked, where both nearly hold the normal.
struct Flanks;

impl AlongNormal for Flanks {
    fn hit(&self, point: &Point3, _: &Vector3, _: Option<&NormalHit>) -> Option<NormalHit> {
        let (by, aside) = if point.x < 0.5 { (0, 1.0) } else { (2, -1.0) };
        let normal = Vector3::new(aside, 0.0, 1e-7).normalize();
        Some(NormalHit { way: Way::Normal, deviation: -self.depth(), by, normal, seed: 0, uncertain: 0.0 })
    }

    fn reach(&self) -> f64 {
        0.5
    }

    fn depth(&self) -> f64 {
        1.0
    }
}

#[test]
fn no_ridge_is_told_deeper_than_is_looked() {
    let part = plane([1.0, 1.0]);
    let path = path(&passes(0.0));
    let tracks = Tracks::new(&path, Cutter::ball(2.0 * RADIUS).unwrap());
    let finder = Finder { part: &part, engine: &Flanks, tracks: &tracks, radius: RADIUS, close: CLOSE };
    let place = |x: f64| NetPlace::at_foot(&part.closest_point(&Point3::new(x, 0.5, 0.0)).0);
    let with_hit = |at: &NetPlace| Flanks.hit(&at.point, &at.normal, None).unwrap();
    let [from, to] = [place(0.2), place(0.8)];
    let mut found = Vec::new();
    finder.between((&from, with_hit(&from)), (&to, with_hit(&to)), &mut found);
    assert!(!found.is_empty() && found.iter().all(|c| c.height >= -1.0), "{found:?}");
}
