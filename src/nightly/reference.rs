//! The work that a run's cost is measured against.

/// A fixed computation: the lowest of many balls over a grid of points, plain and brute. It has the mix of
/// square roots, comparisons and memory that simulation has, and none of its code: a slower simulation must
/// not make the reference slower too. Takes some milliseconds on one thread. Leaves a sum, so that no
/// compiler leaves the work out.
///
/// Do not change it: every cost of every history is measured against it.
pub fn reference_work() -> f64 {
    const POINTS: usize = 192;
    const BALLS: usize = 64;
    let ball = |k: usize| {
        let t = k as f64 * 0.618_033_988_749_895;
        [(t.fract()) * 10.0, ((t * 7.0).fract()) * 10.0, (t * 3.0).fract()]
    };
    let balls: Vec<[f64; 3]> = (0..BALLS).map(ball).collect();
    let mut heights = vec![f64::INFINITY; POINTS * POINTS];
    for [x, y, z] in balls {
        for (k, height) in heights.iter_mut().enumerate() {
            let dx = (k % POINTS) as f64 * (10.0 / POINTS as f64) - x;
            let dy = (k / POINTS) as f64 * (10.0 / POINTS as f64) - y;
            let inside = 9.0 - dx * dx - dy * dy;
            if inside > 0.0 {
                *height = height.min(z + 3.0 - inside.sqrt());
            }
        }
    }
    heights.iter().filter(|height| height.is_finite()).sum()
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_reference_work_does_the_same_each_time() {
        let first = super::reference_work();
        assert!(first.is_finite() && first > 0.0);
        assert_eq!(first, super::reference_work());
    }
}
