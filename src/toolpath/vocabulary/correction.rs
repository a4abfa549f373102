//! What a measurement of the cut surface found about the distance of passes: by which factor it should be
//! wider or narrower, from place to place.
//!
//! Enters: measured places with a factor each, and the distance over which a factor holds, an interval
//! between passes. Leaves: a continuous field of factors, 1 where nothing was measured.
//!
//! Places are gathered in cubes of that distance. A cube has the least factor of its own and its 26
//! neighbours', so that the highest ridge rules what lies within an interval of it. Between the centres of
//! cubes factors are interpolated; they are never more than the least one in the cube of a place.

use geometry::Point3;

/// Most columns of cubes over the plan view; on larger parts cubes grow. They take 4 bytes each.
const MOST_COLUMNS: f64 = 4e6;

/// A factor is less than that of all places by no less than this share.
const NARROWER: f64 = 1e-6;

/// Factors of the distance of passes over a surface.
#[derive(Debug, Clone, PartialEq)]
pub struct Correction {
    /// The factor where nothing was measured, by which all others are multiplied too.
    everywhere: f64,
    /// Edge of a cube, mm.
    edge: f64,
    /// Least corner of the first cube, mm.
    origin: Point3,
    /// Cubes along x and y.
    count: [usize; 2],
    /// Where the cubes of each column begin, and a last end.
    begin: Vec<u32>,
    /// Level and factor of each cube, by column and level.
    cubes: Vec<(i32, f64)>,
}

impl Default for Correction {
    fn default() -> Self {
        let (origin, count) = (Point3::origin(), [0; 2]);
        Self { everywhere: 1.0, edge: 1.0, origin, count, begin: Vec::new(), cubes: Vec::new() }
    }
}

impl Correction {
    /// From places and factors (positive), each of which holds for `reach` mm around; 1 everywhere without
    /// any.
    pub fn new(places: &[(Point3, f64)], reach: f64) -> Self {
        let sound = |&&(p, factor): &&(Point3, f64)| {
            factor > 0.0 && factor.is_finite() && p.iter().all(|x| x.is_finite())
        };
        let places: Vec<&(Point3, f64)> = places.iter().filter(sound).collect();
        let ends = |c: usize| {
            let values = places.iter().map(|(p, _)| p[c]);
            values.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], x| [a.min(x), b.max(x)])
        };
        let [[x0, x1], [y0, y1], [z0, _]] = [0, 1, 2].map(ends);
        if places.is_empty() || reach.is_nan() || reach <= 0.0 {
            return Self::default();
        }
        let edge = reach
            .max(((x1 - x0) * (y1 - y0) / MOST_COLUMNS).sqrt())
            .max((x1 - x0).max(y1 - y0) / MOST_COLUMNS);
        // Room for the neighbours of the outermost cubes.
        let origin = Point3::new(x0 - edge, y0 - edge, z0 - edge);
        let count = [(x1 - x0) / edge, (y1 - y0) / edge].map(|cubes| cubes as usize + 3);
        let mut field = Self { edge, origin, count, ..Self::default() };
        let own = field.least(places.iter().map(|&&(p, factor)| (field.cube(&p), factor)).collect());
        let around = own.into_iter().flat_map(|([x, y, z], factor)| {
            (0..27).map(move |k| ([x + k % 3 - 1, y + k / 3 % 3 - 1, z + k / 9 - 1], factor))
        });
        let spread = field.least(around.collect());
        field.begin = vec![0; count[0] * count[1] + 1];
        for &(cube, _) in &spread {
            if let Some(column) = field.column(cube) {
                field.begin[column + 1] += 1;
            }
        }
        for k in 1..field.begin.len() {
            field.begin[k] += field.begin[k - 1];
        }
        let inside = spread.into_iter().filter(|(cube, _)| field.column(*cube).is_some());
        field.cubes = inside.map(|([.., z], factor)| (z, factor)).collect();
        field
    }

    /// The factor at a place.
    pub fn at(&self, p: &Point3) -> f64 {
        if self.is_even() {
            return self.everywhere;
        }
        // From the centre of a cube to that of the next.
        let from = (p - self.origin) / self.edge - geometry::Vector3::repeat(0.5);
        let low = from.map(f64::floor);
        let share = from - low;
        let low = [low.x as i32, low.y as i32, low.z as i32];
        let (mut sum, mut weights) = (0.0, 0.0);
        for corner in 0..8 {
            let up = [corner & 1, corner >> 1 & 1, corner >> 2];
            let weight: f64 = (0..3).map(|c| if up[c] == 1 { share[c] } else { 1.0 - share[c] }).product();
            if let Some(factor) =
                self.factor([0, 1, 2].map(|c| low[c].saturating_add(up[c]))).filter(|_| weight > 0.0)
            {
                sum += weight * factor;
                weights += weight;
            }
        }
        // Toward the edge of what was measured it fades to 1.
        self.everywhere * (sum + (1.0 - weights))
    }

    /// Whether the factor at a place is less than that of all places.
    pub fn is_narrower_at(&self, p: &Point3) -> bool {
        self.at(p) < (1.0 - NARROWER) * self.everywhere
    }

    /// Whether there are no other factors than that of all places.
    pub fn is_even(&self) -> bool {
        self.cubes.is_empty()
    }

    /// The same with all factors multiplied by one.
    pub fn scaled(&self, factor: f64) -> Self {
        Self { everywhere: factor * self.everywhere, ..self.clone() }
    }

    /// Least and greatest factor.
    pub fn range(&self) -> [f64; 2] {
        if self.is_even() {
            return [self.everywhere; 2];
        }
        let factors = self.cubes.iter().map(|(_, factor)| *factor);
        factors.fold([f64::INFINITY, 0.0], |[a, b], f| [a.min(f), b.max(f)]).map(|f| f * self.everywhere)
    }

    fn cube(&self, p: &Point3) -> [i32; 3] {
        let at = (p - self.origin) / self.edge;
        [at.x as i32, at.y as i32, at.z as i32]
    }

    fn column(&self, [x, y, _]: [i32; 3]) -> Option<usize> {
        let [nx, ny] = self.count;
        let (x, y) = (usize::try_from(x).ok()?, usize::try_from(y).ok()?);
        (x < nx && y < ny).then(|| y * nx + x)
    }

    fn factor(&self, cube: [i32; 3]) -> Option<f64> {
        let column = self.column(cube)?;
        let [a, b] = [0, 1].map(|k| self.begin[column + k] as usize);
        self.cubes[a..b].iter().find(|(z, _)| *z == cube[2]).map(|(_, factor)| *factor)
    }

    /// The least factor of each cube, by column and level.
    fn least(&self, mut factors: Vec<([i32; 3], f64)>) -> Vec<([i32; 3], f64)> {
        factors.sort_by(|([ax, ay, az], a), ([bx, by, bz], b)| {
            (ay, ax, az).cmp(&(by, bx, bz)).then(a.total_cmp(b))
        });
        factors.dedup_by_key(|(cube, _)| *cube);
        factors
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_factor_rules_around_it_and_nothing_far_away() {
        let line = (0..100).map(|k| (Point3::new(0.1 * f64::from(k), 2.0, 1.0), 1.02));
        let mut places: Vec<(Point3, f64)> = line.collect();
        places.push((Point3::new(5.0, 2.1, 1.0), 0.9));
        let field = Correction::new(&places, 0.5);
        assert!((field.at(&Point3::new(5.0, 2.0, 1.0)) - 0.9).abs() < 1e-12);
        assert!((field.at(&Point3::new(1.0, 2.0, 1.0)) - 1.02).abs() < 1e-12);
        assert_eq!(field.at(&Point3::new(5.0, 20.0, 1.0)), 1.0);
        assert_eq!(field.at(&Point3::new(5.0, 2.0, 9.0)), 1.0);
        assert_eq!(field.range(), [0.9, 1.02]);
        let wider = field.scaled(1.5);
        assert!((wider.at(&Point3::new(5.0, 2.0, 1.0)) - 1.35).abs() < 1e-12);
        assert_eq!(wider.at(&Point3::new(5.0, 20.0, 1.0)), 1.5);
        for (p, factor) in &places {
            assert!(field.at(p) <= factor + 1e-12, "{p} {factor}");
        }
    }

    #[test]
    fn it_is_continuous_and_nothing_without_places() {
        let places: Vec<(Point3, f64)> = (0..400)
            .map(|k| {
                (
                    Point3::new(0.1 * f64::from(k % 20), 0.1 * f64::from(k / 20), 0.0),
                    if k == 210 { 0.8 } else { 1.0 },
                )
            })
            .collect();
        let field = Correction::new(&places, 0.3);
        let at = |k: i32| field.at(&Point3::new(1e-4 * f64::from(k), 1.03, 0.01));
        assert!((0..20_000).all(|k| (at(k + 1) - at(k)).abs() < 2e-4));
        let none = Correction::new(&[], 0.3);
        assert_eq!((none.at(&Point3::origin()), none.range()), (1.0, [1.0; 2]));
        assert_eq!(Correction::new(&[(Point3::new(f64::NAN, 0.0, 0.0), 0.5)], 0.3), none);
    }
}
