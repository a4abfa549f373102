//! Which passes lie beside a place: for each of them the stretch, and the place on it, that comes nearest.

use geometry::{BoxTree, Extent, Point3, foot};

/// A pass is beside a place up to this many times as far off as the nearest one.
const BESIDE: f64 = 2.0;

/// Stretches of passes, by place.
pub struct PassStretches {
    stretches: Vec<([Point3; 2], u32)>,
    tree: Option<(BoxTree, Vec<u32>)>,
}

/// A pass beside a place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Beside {
    /// The pass.
    pub pass: u32,
    /// Its stretch that comes nearest, in the order given.
    pub stretch: u32,
    /// Where on it, from 0 at its beginning to 1 at its end.
    pub at: f64,
    /// How far off, mm.
    pub distance: f64,
}

impl PassStretches {
    /// Straight stretches from one contact to the next (mm), each with its pass.
    pub fn new(stretches: Vec<([Point3; 2], u32)>) -> Self {
        let boxes: Vec<Extent> =
            stretches.iter().map(|([a, b], _)| Extent::new(a.inf(b).into(), a.sup(b).into())).collect();
        let tree = (!boxes.is_empty()).then(|| BoxTree::around(&boxes, 2));
        Self { stretches, tree }
    }

    /// The passes beside a place `p` (mm) of the pass `own`: up to twice as far off as the nearest, and no
    /// farther than `within` mm.
    pub fn beside(&self, p: &Point3, own: u32, within: f64) -> Vec<Beside> {
        let mut found: Vec<Beside> = Vec::new();
        let Some((tree, slots)) = &self.tree else {
            return found;
        };
        // What the walk makes as great as it can is the reach, negative.
        let reach = |nearest: f64| -(BESIDE * nearest).min(within);
        let mut nearest = f64::INFINITY;
        tree.search(
            reach(nearest),
            |_, node, _| -node.distance_squared(p).sqrt(),
            |slot, best| {
                let stretch = slots[slot];
                let (ends, pass) = self.stretches[stretch as usize];
                if pass == own {
                    return best;
                }
                let (at, distance) = foot(p, &ends);
                let one = Beside { pass, stretch, at, distance };
                match found.iter_mut().find(|known| known.pass == pass) {
                    Some(known) if distance < known.distance => *known = one,
                    Some(_) => {}
                    None => found.push(one),
                }
                nearest = nearest.min(distance);
                best.max(reach(nearest))
            },
        );
        found.retain(|one| -one.distance >= reach(nearest));
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against a look at every stretch.
    #[test]
    fn passes_beside_a_place_are_those_of_brute_force() {
        let mut state = 7u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        let mut point = |pass: u32| Point3::new(20.0 * random(), f64::from(pass) + random(), random());
        let stretches: Vec<_> = (0..600).map(|k| ([point(k % 12), point(k % 12)], k % 12)).collect();
        let places: Vec<_> = (0..50).map(|k| (point(k % 12), k % 12)).collect();
        let tree = PassStretches::new(stretches.clone());
        for (p, own) in places {
            let of_pass = |pass: u32| {
                let its = stretches.iter().filter(|(_, other)| *other == pass);
                its.map(|(ends, _)| foot(&p, ends).1).fold(f64::INFINITY, f64::min)
            };
            let all: Vec<f64> = (0..12).filter(|pass| *pass != own).map(of_pass).collect();
            let nearest = all.iter().copied().fold(f64::INFINITY, f64::min);
            let mut expected: Vec<f64> = all.into_iter().filter(|d| *d <= (2.0 * nearest).min(0.7)).collect();
            let mut got: Vec<f64> = tree.beside(&p, own, 0.7).iter().map(|one| one.distance).collect();
            expected.sort_by(f64::total_cmp);
            got.sort_by(f64::total_cmp);
            assert_eq!(got, expected);
        }
        assert_eq!(PassStretches::new(Vec::new()).beside(&Point3::origin(), 0, 1.0), []);
    }
}
