//! The sweeps of all families against the closed forms of the reference, at samples.

use super::*;
use crate::form::Family;
use crate::scenes::{Rng, cutters, random_path};
use crate::swept::swept_height;

/// A point up to `by` beside a point of the track, in x and in y.
fn near(track: &Track, rng: &mut Rng, by: f64) -> (f64, f64) {
    let s = rng.within(0.0, track.length);
    let [x, y] = track.in_plan(s, 0.0);
    (track.x + x + rng.within(-by, by), track.y + y + rng.within(-by, by))
}

/// The track that is only the upper end of another, or the lower.
fn end(track: &Track, upper: bool) -> Track {
    let s = if upper { track.length } else { 0.0 };
    let [x, y] = track.in_plan(s, 0.0);
    Track { x: track.x + x, y: track.y + y, z: track.tip(s), length: 0.0, slope: 0.0, cos: 1.0, ..*track }
}

/// A sweep at points of the plane.
struct Probe<'a> {
    form: &'a Form,
    track: &'a Track,
    height: &'a dyn Fn(f64, f64) -> (f64, f64),
    /// Height and slopes.
    plane: &'a dyn Fn(f64, f64) -> [f64; 3],
    /// Of a square around a point, reaching so far along the track and across it.
    beyond: &'a dyn Fn(f64, f64, f64) -> (bool, bool),
    /// Of the cutter at the upper end or the lower.
    at_end: &'a dyn Fn(bool, f64, f64) -> (f64, f64),
}

/// Calls `check` with the sweeps of all cutters along moves of all kinds but the steepest, in f64.
fn for_each_sweep(mut check: impl FnMut(&Probe)) {
    let mut rng = Rng::new(21);
    for cutter in cutters() {
        let form = Form::new(&cutter);
        for (from, to, _) in random_path(&mut rng, 400, 8.0).segments() {
            let track = Track::new(from, to);
            if track.slope > 100.0 {
                continue;
            }
            let m = LocalMove::of(&track);
            match form.family {
                Family::Ball => probe(&form, &track, &m, Ball::<f64>::new(form.radius, 0.0), &mut check),
                Family::Flat => probe(&form, &track, &m, Flat::<f64>::new(form.radius, 0.0), &mut check),
                Family::Rounded => {
                    probe(&form, &track, &m, Rounded::<f64, true>::new(&form, 0.0), &mut check)
                }
            }
        }
    }
}

fn probe<S: Sweep<f64>>(
    form: &Form,
    track: &Track,
    m: &LocalMove<f64>,
    sweep: S,
    check: &mut dyn FnMut(&Probe),
) {
    let height = |x: f64, y: f64| {
        let (along, across) = m.along_across(x, y);
        let (height, doubt) = sweep.height(m, along, across);
        (if height.is_nan() { f64::INFINITY } else { height }, doubt)
    };
    let plane = |x: f64, y: f64| {
        let (along, across) = m.along_across(x, y);
        let p = sweep.plane(m, along, across);
        [p.z, p.along * m.ux - p.across * m.uy, p.along * m.uy + p.across * m.ux]
    };
    let beyond = |x: f64, y: f64, half: f64| {
        let (along, across) = m.along_across(x, y);
        let nearest = (across.abs() - half).max(0.0);
        sweep.beyond(m, [along - half, along + half], [nearest, across.abs() + half])
    };
    let at_end = |upper: bool, x: f64, y: f64| {
        let (along, across) = m.along_across(x, y);
        sweep.at_end(m, upper, along, across)
    };
    check(&Probe { form, track, height: &height, plane: &plane, beyond: &beyond, at_end: &at_end });
}

#[test]
fn heights_are_those_of_the_reference() {
    let mut rng = Rng::new(22);
    let (mut compared, mut doubted) = (0, 0);
    for_each_sweep(|probe| {
        for _ in 0..20 {
            let (x, y) = (probe.track.x + rng.within(-3.5, 3.5), probe.track.y + rng.within(-3.5, 3.5));
            let ((got, doubt), expected) =
                ((probe.height)(x, y), swept_height(probe.form, probe.track, x, y));
            compared += 1;
            if doubt <= expected && doubt < f64::INFINITY {
                doubted += 1;
            } else {
                let limit = if probe.form.family == Family::Rounded { 2e-11 } else { 2e-12 };
                let same = got == expected || (got - expected).abs() < limit;
                assert!(same, "{:?} {:?} at {x} {y}: {got} {expected}", probe.form, probe.track);
            }
        }
    });
    assert!(doubted * 100 < compared, "{doubted} of {compared} in doubt");
}

/// The planes of the bound lie nowhere above the sweep, and no plane that lies a micrometre higher does.
#[test]
fn planes_lie_below_and_touch() {
    let mut rng = Rng::new(23);
    let (mut planes, mut touching) = (0, 0);
    for_each_sweep(|probe| {
        for _ in 0..4 {
            let (x, y) = near(probe.track, &mut rng, 4.0);
            let [z, gx, gy] = (probe.plane)(x, y);
            planes += 1;
            touching += usize::from(z + 1e-3 > swept_height(probe.form, probe.track, x, y));
            for _ in 0..40 {
                let (px, py) = near(probe.track, &mut rng, 3.0);
                let height = swept_height(probe.form, probe.track, px, py);
                let bound = z + gx * (px - x) + gy * (py - y);
                assert!(bound <= height + 1e-9, "{:?} {:?}: {bound} {height}", probe.form, probe.track);
            }
        }
    });
    assert!(touching * 10 > planes * 3, "{touching} of {planes}");
}

/// Where a square is said to be cut from one end of the track, the whole sweep cuts no lower; and that is
/// said of most squares of which it seems true.
#[test]
fn squares_beyond_an_end_are_cut_by_the_cutter_there() {
    let mut rng = Rng::new(24);
    let (mut said, mut could) = (0, 0);
    for_each_sweep(|probe| {
        for _ in 0..8 {
            let (x, y) = near(probe.track, &mut rng, 3.0);
            let half = 10f64.powf(rng.within(-3.0, 0.0));
            let (at_low, at_high) = (probe.beyond)(x, y, half);
            for (upper, claimed) in [(false, at_low), (true, at_high)] {
                let alone = end(probe.track, upper);
                let mut lower = false;
                for k in 0..30 {
                    // The corners and the middles of the sides, then any points.
                    let side = |i: i32| f64::from(i - 1) * half;
                    let (a, w) = match k {
                        0..9 => (side(k % 3), side(k / 3)),
                        _ => (rng.within(-half, half), rng.within(-half, half)),
                    };
                    let [dx, dy] = probe.track.in_plan(a, w);
                    let whole = swept_height(probe.form, probe.track, x + dx, y + dy);
                    let there = swept_height(probe.form, &alone, x + dx, y + dy);
                    // At the very rim rounding says whether it is reached.
                    let rho = (x + dx - alone.x).hypot(y + dy - alone.y);
                    lower |= whole < there - 1e-9 && (rho - probe.form.radius).abs() > 1e-9;
                }
                assert!(!(claimed && lower), "{:?} {:?} {upper} {x} {y} {half}", probe.form, probe.track);
                (said, could) = (said + usize::from(claimed), could + usize::from(!lower));
            }
        }
    });
    assert!(said * 2 > could, "{said} of {could}");
}

/// What the cutter at one end tells of the whole sweep: its height, or one that lies below.
#[test]
fn the_cutter_at_an_end_bounds_the_sweep() {
    let mut rng = Rng::new(25);
    let (mut settled, mut could, mut close) = (0, 0, 0);
    for_each_sweep(|probe| {
        for upper in [false, true] {
            let alone = end(probe.track, upper);
            for _ in 0..20 {
                let (x, y) = near(probe.track, &mut rng, 3.5);
                let (there, least) = (probe.at_end)(upper, x, y);
                let whole = swept_height(probe.form, probe.track, x, y);
                let place = || format!("{:?} {:?} {upper} {x} {y}", probe.form, probe.track);
                if least == f64::NEG_INFINITY {
                    continue;
                }
                could += usize::from(
                    whole < f64::INFINITY && whole >= swept_height(probe.form, &alone, x, y) - 1e-12,
                );
                if least == f64::INFINITY {
                    settled += usize::from(whole < f64::INFINITY);
                    assert!(whole == there || (whole - there).abs() < 1e-9, "{} {there} {whole}", place());
                } else {
                    close += usize::from(least > whole - 1e-2);
                    assert!(least <= whole + 1e-9 && there >= whole - 1e-9, "{} {there} {whole}", place());
                }
            }
        }
    });
    assert!(settled * 10 > could * 9 && close * 20 > could, "{settled} of {could}, {close} close");
}

/// Points of round coordinates on the rim itself are left to the reference.
#[test]
fn points_on_the_rim_are_in_doubt() {
    let track = |x: f64, y: f64, length: f64, slope: f64| Track {
        x,
        y,
        z: 0.0,
        ux: 0.6,
        uy: 0.8,
        length,
        slope,
        cos: 1.0 / slope.hypot(1.0),
    };
    let mut seen = 0;
    for cutter in cutters() {
        let form = Form::new(&cutter);
        for k in 0..2000 {
            let track =
                track(0.1 * f64::from(k), 0.07 * f64::from(k % 13), f64::from(k % 3), 0.1 * f64::from(k % 5));
            // Behind the lower end, in the direction of a triangle of sides 3, 4 and 5 from the track.
            let [x, y] = track.in_plan(-0.6 * form.radius, 0.8 * form.radius);
            let expected = swept_height(&form, &track, track.x + x, track.y + y);
            let m = LocalMove::of(&track);
            let (along, across) = m.along_across(track.x + x, track.y + y);
            let (got, doubt) = match form.family {
                Family::Ball => Ball::new(form.radius, 0.0).height(&m, along, across),
                Family::Flat => Flat::new(form.radius, 0.0).height(&m, along, across),
                Family::Rounded => Rounded::<f64, true>::new(&form, 0.0).height(&m, along, across),
            };
            let reached = |height: f64| height < f64::INFINITY;
            seen += usize::from(reached(got) != reached(expected));
            assert!(reached(got) == reached(expected) || doubt < f64::INFINITY, "{cutter:?} {track:?}");
        }
    }
    assert!(seen > 0, "no point of these needs the reference");
}
