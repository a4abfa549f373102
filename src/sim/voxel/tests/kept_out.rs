//! Rapid moves of leaning tools in and out of stock, against brute force and by hand.

use super::*;
use crate::{ENGAGED, InStock};

fn first(stock: &Stock, cutter: &Cutter, path: &Toolpath) -> Option<InStock> {
    let solid = Solid::of_cutter(cutter, None);
    VoxelEngine::new(stock, &solid, path).unwrap().first_rapid_in_stock(0.0, &Silent).unwrap()
}

fn leaning() -> Vector3 {
    Vector3::new(0.3, 0.1, 1.0).normalize()
}

/// Cuts and rapid moves (`true`) of a tool with one axis.
fn leaning_path(start: [f64; 3], to: &[(bool, Point3)]) -> Toolpath {
    let at = |tip: Point3| ClPoint { tip, axis: leaning() };
    let moves = to.iter().map(|&(rapid, tip)| Move {
        to: at(tip),
        kind: if rapid { MoveKind::Rapid } else { MoveKind::Cut },
        feed_rate: 600.0,
        pass: 0,
    });
    Toolpath::new(at(start.into()), moves.collect())
}

fn slab() -> Stock {
    block([-5.0, -5.0, -10.0], [45.0, 35.0, 0.0])
}

fn ends() -> [Cutter; 3] {
    [Cutter::ball(6.0).unwrap(), Cutter::flat(6.0).unwrap(), Cutter::bull(6.0, 1.0).unwrap()]
}

#[test]
fn a_rib_however_thin_is_found() {
    // How far apart two slots leave no rib at their floor's level.
    let across = leaning().cross(&Vector3::x()).normalize();
    for thin in [0.5, 0.03, 0.002] {
        let apart = across * (6.0 + thin);
        let begin = Point3::new(-15.0, 8.0, -4.0);
        let along = Vector3::new(70.0, 0.0, 0.0);
        let high = Vector3::z() * 40.0;
        let to = [
            (false, begin + along),
            (false, begin + along + high),
            (false, begin + apart + along + high),
            (false, begin + apart + along),
            (false, begin + apart),
            (false, begin + apart + high),
            (false, begin + apart * 0.5 + high),
            (true, begin + apart * 0.5),
            (true, begin + apart * 0.5 + along),
        ];
        let path = leaning_path(begin.into(), &to);
        let found = first(&slab(), &Cutter::flat(6.0).unwrap(), &path).unwrap();
        assert!(found.move_index == 8 && found.depth.unwrap() > ENGAGED, "{thin}: {found:?}");
    }
}

#[test]
fn where_the_tool_has_been_it_may_go_again() {
    let (begin, end) = (Point3::new(5.0, 8.0, -4.0), Point3::new(30.0, 12.0, -5.0));
    let up = leaning() * 30.0;
    let to = [
        (false, end),
        (true, end + up),
        (true, end + up * 0.5),
        (true, end),
        (true, begin),
        (true, begin + (end - begin) * 0.5 + up * 0.1),
        (true, begin + up),
    ];
    for cutter in ends() {
        assert_eq!(first(&slab(), &cutter, &leaning_path(begin.into(), &to)), None, "{cutter:?}");
        let beyond = [to[0], (true, end + (end - begin) * 0.001)];
        let found = first(&slab(), &cutter, &leaning_path(begin.into(), &beyond)).unwrap();
        assert!(found.depth.is_some() && found.move_index == 1, "{found:?}");
    }
}

/// Over ridges of a floor that was cut in passes.
#[test]
fn over_a_floor_that_was_cut() {
    let floor = |clear: f64| {
        let mut to = Vec::new();
        for k in 0..10 {
            let y = 4.0 + 1.5 * f64::from(k);
            let x = if k % 2 == 0 { [5.0, 35.0] } else { [35.0, 5.0] };
            to.extend(x.map(|x| (false, Point3::new(x, y, -3.0))));
        }
        to.push((true, Point3::new(5.0, 17.5, -3.0) + leaning() * (clear / leaning().z)));
        to.push((true, Point3::new(20.0, 11.0, -3.0 + clear)));
        to.push((true, Point3::new(20.0, 10.0, 20.0)));
        leaning_path([5.0, 4.0, -3.0], &to)
    };
    let stock = block([-5.0, -5.0, -10.0], [45.0, 35.0, -2.5]);
    for cutter in ends() {
        assert_eq!(first(&stock, &cutter, &floor(0.5)), None, "{cutter:?}");
    }
    // A ball leaves ridges of 95 um.
    let found = first(&stock, &ends()[0], &floor(0.05)).unwrap();
    assert!(found.depth.is_some() && found.move_index == 21, "{found:?}");
}

/// Along a side of the block and over its top.
#[test]
fn beside_the_block() {
    let cutter = Cutter::ball(6.0).unwrap();
    let reach = 3.0;
    let along = |y: f64| {
        // The shank leans over the block's side by no more than the ball's middle is away.
        let at = |x: f64| ClPoint {
            tip: Point3::new(x, y, -reach),
            axis: Vector3::new(0.3, 0.0, 1.0).normalize(),
        };
        let rapid = Move { to: at(60.0), kind: MoveKind::Rapid, feed_rate: 1.0, pass: 0 };
        first(&slab(), &cutter, &Toolpath::new(at(-20.0), vec![rapid]))
    };
    assert_eq!(along(-5.0 - reach), None);
    assert_eq!(along(-5.0 - reach + 0.5 * ENGAGED), None);
    assert!(along(-5.0 - reach + 3.0 * ENGAGED).unwrap().depth.is_some());
}

/// Against places all over the block.
#[test]
fn no_place_of_the_block_is_in_stock_on_a_move_that_is_clear() {
    let mut rng = Rng::new(71);
    let stock = block([0.0; 3], [10.0; 3]);
    let (mut met, mut clear) = (0, 0);
    for round in 0..60 {
        let cutter = cutters()[round % cutters().len()];
        let solid = Solid::of_cutter(&cutter, None);
        let mut path = five_axis_path(&mut rng, 14);
        for (k, step) in path.moves.iter_mut().enumerate() {
            step.kind = if matches!(k % 7, 3 | 4) { MoveKind::Rapid } else { MoveKind::Cut };
        }
        let engine = VoxelEngine::new(&stock, &solid, &path).unwrap();
        let found = engine.first_rapid_in_stock(0.0, &Silent).unwrap();
        let until =
            found.filter(|found| found.depth.is_some()).map_or(path.len(), |found| found.move_index as usize);
        met += usize::from(until < path.len());
        clear += usize::from(found.is_none());
        for _ in 0..4000 {
            let q = Point3::from([0, 1, 2].map(|_| rng.within(0.0, 10.0)));
            for k in (0..until).filter(|k| path.moves[*k].kind == MoveKind::Rapid) {
                let tool = engine.parts.of_move(k as u32, &q, f64::INFINITY).unwrap().distance;
                let depth = engine.standing(&q, k as u32).min(-tool);
                assert!(depth <= ENGAGED, "{round}: {depth} before {found:?}, {cutter:?}");
            }
        }
        if let Some(InStock { move_index, at, depth: Some(depth) }) = found {
            let tool = engine.parts.of_move(move_index, &at, f64::INFINITY).unwrap().distance;
            assert!((engine.standing(&at, move_index).min(-tool) - depth).abs() < 1e-9, "{found:?}");
        }
    }
    assert!(met > 10 && clear > 10, "{met} {clear}");
}
