//! Volumes between bounds: closed forms, and brute force where there are none.

use super::*;

/// The tool's radius as its height above the tip grows, by the angle of its corner.
struct Round {
    radius: f64,
    corner: f64,
}

impl Round {
    /// The integral over heights from `low` to `high` of a function of the radius there.
    fn integral(&self, low: f64, high: f64, of: impl Fn(f64) -> f64) -> f64 {
        let Self { radius, corner } = *self;
        let angle = |height: f64| (1.0 - height.min(corner) / corner.max(1e-300)).clamp(-1.0, 1.0).acos();
        let mut sum = (high - low.max(corner)).max(0.0) * of(radius);
        if corner > 0.0 && low < corner {
            // Simpson, in the angle: smooth there.
            let (a, b, n) = (angle(low), angle(high), 400);
            let f = |k: usize| {
                let at = a + (b - a) * k as f64 / n as f64;
                of(radius - corner + corner * at.sin()) * corner * at.sin()
            };
            let inner: f64 = (1..n).map(|k| f(k) * if k % 2 == 1 { 4.0 } else { 2.0 }).sum();
            sum += (f(0) + inner + f(n)) * (b - a) / (3.0 * n as f64);
        }
        sum
    }

    /// The height at which it is so wide.
    fn height(&self, wide: f64) -> f64 {
        let out = (wide - self.radius + self.corner).max(0.0);
        self.corner - (self.corner * self.corner - out * out).max(0.0).sqrt()
    }

    fn cutter(&self) -> Cutter {
        match self.corner {
            0.0 => Cutter::flat(2.0 * self.radius).unwrap(),
            c if c == self.radius => Cutter::ball(2.0 * c).unwrap(),
            c => Cutter::bull(2.0 * self.radius, c).unwrap(),
        }
    }
}

/// A cut of one of six kinds in a block of 24 × 20 × 8 mm, and what it takes.
fn random_cut(rng: &mut Rng, k: usize) -> (Round, Stock, Toolpath, f64) {
    let radius = rng.within(1.5, 3.0);
    let corner = match k % 3 {
        0 => 0.0,
        1 => radius,
        _ => rng.within(0.2, 0.9) * radius,
    };
    let round = Round { radius, corner };
    let stock = block([-12.0, -10.0, -8.0], [12.0, 10.0, 0.0]);
    let depth = rng.within(0.3, 7.0);
    let place = |rng: &mut Rng, z: f64| Point3::new(rng.within(-5.0, 5.0), rng.within(-5.0, 5.0), z);
    let lean = rng.within(0.0, 0.5);
    let deep = rng.within(4.7, 6.4);
    match k % 6 {
        0 => {
            let (a, b) = (place(rng, -depth), place(rng, -depth));
            let exact = round.integral(0.0, depth, |w| 2.0 * w * (b - a).norm() + PI * w * w);
            (round, stock, path_through([a, b]), exact)
        }
        1 => {
            let axis = Vector3::new(0.0, lean.sin(), lean.cos());
            let at = |x: f64| ClPoint { tip: Point3::new(x, 0.3, -deep), axis };
            let area = 2.0 * radius * deep / lean.cos() - corner * corner * (2.0 - 0.5 * PI);
            (round, stock, through(&[at(-40.0), at(40.0)]), 24.0 * area)
        }
        2 => {
            // Two passes side by side; below the ridge each has its own section.
            let apart = rng.within(0.1, 1.9) * radius;
            let at = |x: f64, y: f64| Point3::new(x, y, -depth);
            let y = rng.within(-3.0, 3.0);
            let ridge = round.height(0.5 * apart).min(depth);
            let area =
                round.integral(0.0, ridge, |w| 4.0 * w) + round.integral(ridge, depth, |w| 2.0 * w + apart);
            let passes = [at(-40.0, y), at(40.0, y), at(40.0, y + apart), at(-40.0, y + apart)];
            (round, stock, path_through(passes), 24.0 * area)
        }
        3 => {
            let around = rng.within(0.0, 2.0 * PI);
            let axis = Vector3::new(lean.sin() * around.cos(), lean.sin() * around.sin(), lean.cos());
            let tip = Point3::new(0.2, 0.1, -deep);
            let up = ClPoint { tip: tip + axis * 30.0, axis };
            let bottom = round.integral(0.0, corner, |w| PI * w * w);
            let exact = bottom + PI * radius * radius * (deep / lean.cos() - corner);
            (round, stock, through(&[up, ClPoint { tip, axis }]), exact)
        }
        4 => {
            // A ball on a ramp through all of the block: the cylinder that it sweeps, and the strip above.
            let round = Round { radius, corner: radius };
            let (slope, middle) = (rng.within(-0.1, 0.1), rng.within(-3.5, -1.5));
            let at = |x: f64| Point3::new(x, 0.7, middle + slope * x - radius);
            let area = -2.0 * radius * middle + 0.5 * PI * radius * radius * slope.hypot(1.0);
            (round, stock, path_through([at(-40.0), at(40.0)]), 24.0 * area)
        }
        _ => {
            // A flat end that turns about its own tip, inside of the stock: at x a rectangle of half width w,
            // whose far corners run on a circle about the middle of its near side.
            let radius = 0.4 * radius;
            let round = Round { radius, corner: 0.0 };
            let long = Solid::of_cutter(&round.cutter(), None).heights()[1];
            let turn = rng.within(0.05, 1.2);
            let at = |a: f64| ClPoint { tip: Point3::origin(), axis: Vector3::new(0.0, a.sin(), a.cos()) };
            let area = |w: f64| {
                let far = w * w + long * long;
                0.5 * turn * far + far * (w / long).atan() + w * long
            };
            // In the angle at which x lies on the circle the rectangle's width is smooth.
            let (n, mut sum) = (4000, 0.0);
            for k in 0..n {
                let at = PI * (k as f64 + 0.5) / n as f64;
                sum += area(radius * at.sin()) * radius * at.sin() * PI / n as f64;
            }
            let stock = block([-3.0, -16.0, -4.0], [3.0, 16.0, 16.0]);
            (round, stock, through(&[at(-0.5 * turn), at(0.5 * turn)]), sum)
        }
    }
}

#[test]
fn two_hundred_random_cuts_lie_within_their_bounds() {
    let mut rng = Rng::new(61);
    for k in 0..200 {
        let (round, stock, path, exact) = random_cut(&mut rng, k);
        let solid = Solid::of_cutter(&round.cutter(), None);
        let voxel = rng.within(0.3, 0.6);
        let engine = VoxelEngine::new(&stock, &solid, &path).unwrap();
        let VoxelVolumes { left, removed: [low, high] } = engine.volumes(voxel, &Silent).unwrap();
        let hair = 1e-9 * exact;
        assert!(low <= exact + hair && exact <= high + hair, "{k}: {exact} {low} {high}, voxel {voxel}");
        let (whole, middle) = (stock.volume().unwrap(), 0.5 * (low + high));
        assert!((0.5 * (left[0] + left[1]) + middle - whole).abs() < 1e-9 * whole, "{k}");
        // Not by being wide: faces bend within a voxel, edges and turning moves take as much again.
        assert!(high - low < 0.03 * exact + voxel.powi(3), "{k}: {exact} {low} {high}, voxel {voxel}");
    }
}

#[test]
fn brute_force_lies_within_the_bounds() {
    let mut rng = Rng::new(62);
    for (c, cutter) in cutters().iter().enumerate() {
        let solid = Solid::of_cutter(cutter, None);
        let stock = match c % 2 {
            0 => block([0.0; 3], [10.0, 9.0, 8.0]),
            _ => Stock::Cylinder {
                base: Point3::new(0.5, 5.0, 5.0),
                axis: BarAxis::X,
                radius: 4.0,
                length: 9.0,
            },
        };
        let path = if c % 3 == 0 { random_path(&mut rng, 12, 9.0) } else { five_axis_path(&mut rng, 12) };
        let engine = VoxelEngine::new(&stock, &solid, &path).unwrap();
        let of = |k| SweptSolid::new(&solid, &path.location_before(k), &path.moves[k].to).unwrap();
        let swept: Vec<_> = (0..path.len()).map(of).collect();
        // Places spread evenly (Roberts 2018) miss by less than random ones do.
        let (bounds, n) = (stock.bounds(), 100_000u32);
        let steps = Vector3::new(0.819_172_513_396_164, 0.671_043_606_703_789, 0.549_700_477_901_960);
        let inside = |k: &u32| {
            let share = (steps * f64::from(*k)).map(f64::fract);
            let q = bounds.min + bounds.size().component_mul(&share);
            stock.foot(&q).0 < 0.0 && swept.iter().any(|s| s.below(&q, 0.0).is_some())
        };
        let share = (0..n).filter(inside).count() as f64 / f64::from(n);
        let box_volume = bounds.size().product();
        let chance = 2.0 * box_volume * (share * (1.0 - share) / f64::from(n)).sqrt();
        let by_count = share * box_volume;
        for voxel in [0.5, 0.25] {
            let VoxelVolumes { removed: [low, high], .. } = engine.volumes(voxel, &Silent).unwrap();
            assert!(
                low < by_count + chance && by_count < high + chance,
                "cutter {c}: {by_count} {low} {high}"
            );
            assert!(high - low < 0.02 * by_count * (voxel / 0.5), "cutter {c}: {by_count} {low} {high}");
        }
    }
}
