//! How much narrower or wider than by calculation passes are planned, where their chords are shorter, and
//! which places get passes of their own.

use geometry::{Point2, Point3, Vector3};
use motion::ROUNDING;
use toolpath::{Correction, Lowered};

use super::SLACK;

/// No width is corrected by more than this factor in a round.
pub(super) const MOST_NARROWED: f64 = 0.5;

/// A place whose factor is less than one by more than this was narrowed before.
const STILL_WIDE: f64 = 1e-6;

/// The height that corrected ridges are to have, mm.
pub(super) fn aim(target: f64) -> f64 {
    (1.0 - 0.5 * SLACK) * target
}

/// A place that comes near the target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct HighPlace {
    pub at: Point3,
    /// The part's outward unit normal there.
    pub normal: Vector3,
    /// The top of what stands there.
    pub top: Point3,
    /// The tip of an upright cutter that touches the part there.
    pub tip: Point3,
    /// By how much it may stand above the target, mm.
    pub over: f64,
    /// By how much moves beside it should go deeper, mm.
    pub deeper: f64,
    /// The height that it is to have as a share of the one it has.
    pub factor: f64,
}

/// How much narrower or wider than by calculation passes are planned, and where their chords are shorter.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Widths {
    /// Places where ridges stood above the target, with their factors.
    pub places: Vec<(Point3, f64)>,
    /// The factor of all places.
    pub everywhere: f64,
    /// Places beside which moves go deeper, round after round, while all passes stay where they are.
    pub lowered: Vec<Vec<Lowered>>,
    /// Places that get passes of their own, while all others stay where they are.
    pub touch_up: Vec<Point3>,
    /// Lines in the plan view that get passes of their own likewise.
    pub creases: Vec<Vec<Point2>>,
    /// How far around a place its factor holds, mm: the interval of passes on a plane.
    pub interval: f64,
}

impl Widths {
    /// As calculated, for passes that lie so far apart on a plane, mm.
    pub fn by_calculation(interval: f64) -> Self {
        let (places, lowered, touch_up, creases) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        Self { places, everywhere: 1.0, lowered, touch_up, creases, interval }
    }

    pub fn correction(&self) -> Correction {
        Correction::new(&self.places, self.interval).scaled(self.everywhere)
    }

    pub fn scaled(&self, factor: f64) -> Self {
        Self { everywhere: factor * self.everywhere, ..self.unserved() }
    }

    /// Without what served the places of these very passes.
    fn unserved(&self) -> Self {
        Self { lowered: Vec::new(), touch_up: Vec::new(), creases: Vec::new(), ..self.clone() }
    }

    /// Whether passes are the same, but for those of their own and for how deep they go.
    pub fn is_alike(&self, other: &Self) -> bool {
        (&self.places, self.everywhere) == (&other.places, other.everywhere)
    }

    /// How much deeper than planned moves beside a place go, mm.
    pub fn depth_at(&self, place: &HighPlace) -> f64 {
        let beside = |lowered: &&Lowered| (lowered.top - place.top).norm() <= self.interval;
        let deepest = |round: &Vec<Lowered>| {
            round.iter().filter(beside).map(|lowered| lowered.by.norm()).fold(0.0, f64::max)
        };
        self.lowered.iter().map(deepest).sum()
    }

    /// With deeper moves beside places: by what is aimed at, as far as there is `room`, mm.
    pub fn lowered(&self, places: &[HighPlace], room: f64) -> Self {
        let deeper = |place: &HighPlace| {
            let left = room - 2.0 * ROUNDING - self.depth_at(place);
            Lowered { top: place.top, by: -place.normal * place.deeper.min(left).max(0.0) }
        };
        let round = places.iter().map(deeper).collect();
        Self { lowered: self.lowered.iter().cloned().chain([round]).collect(), ..self.clone() }
    }

    /// Whether a pass of its own was to serve a place.
    pub fn is_touched_up(&self, place: &HighPlace) -> bool {
        self.touch_up.iter().any(|at| (at - place.at).norm() <= 0.5 * self.interval)
    }

    /// With passes of their own over places, the highest first.
    pub fn touched_up(&self, places: &[HighPlace]) -> Self {
        let mut places = places.to_vec();
        places.sort_by(|a, b| b.over.total_cmp(&a.over));
        let touch_up = self.touch_up.iter().copied().chain(places.iter().map(|place| place.at)).collect();
        Self { touch_up, ..self.clone() }
    }

    /// With passes of their own along further lines.
    pub fn with_creases(&self, lines: Vec<Vec<Point2>>) -> Self {
        Self { creases: self.creases.iter().cloned().chain(lines).collect(), ..self.clone() }
    }

    /// Narrower where ridges and borders stand above the target, so that they come to the middle of the
    /// slack: height goes with the square of width. A place that was narrowed already and did not give way
    /// enough is narrowed by twice as much: there passes may lie nearer than they have to, or less than all
    /// of the height goes with their width.
    pub fn narrowed(&self, places: &[HighPlace]) -> Self {
        if places.is_empty() {
            return self.clone();
        }
        let now = Correction::new(&self.places, self.interval);
        let narrower = places.iter().map(|place| {
            let before = now.at(&place.at);
            let power = if before < 1.0 - STILL_WIDE { 1.0 } else { 0.5 };
            (place.at, before * place.factor.powf(power).max(MOST_NARROWED))
        });
        let places = self.places.iter().copied().chain(narrower).collect();
        Self { places, ..self.unserved() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn widths_go_with_the_root_of_heights_above_the_target() {
        let above = |x: f64, height: f64| {
            let at = Point3::new(x, 0.0, 0.0);
            HighPlace {
                at,
                normal: Vector3::z(),
                top: at,
                tip: at,
                over: height - 1.0,
                deeper: height - 0.99,
                factor: 0.99 / height,
            }
        };
        let places = [above(0.0, 1.2), above(40.0, 1.1)];
        let by_calculation = Widths::by_calculation(1.0);
        let once = by_calculation.narrowed(&places);
        let found = [0.0, 10.0, 20.0, 40.0].map(|x| once.correction().at(&Point3::new(x, 0.0, 0.0)));
        let wanted = [(0.99f64 / 1.2).sqrt(), 1.0, 1.0, (0.99f64 / 1.1).sqrt()];
        assert!(found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}");
        // What was narrowed stays so, and is narrowed further where that was not enough.
        let twice = once.narrowed(&[above(0.0, 1.1)]).correction();
        assert!((twice.at(&places[0].at) - wanted[0] * 0.99 / 1.1).abs() < 1e-12);
        assert!((twice.at(&places[1].at) - wanted[3]).abs() < 1e-12);
        // Without room nothing moves, and nothing ever moves up.
        let ways = [0.0, 0.3].map(|room| once.lowered(&[above(0.0, 1.2)], room).lowered[0][0].by.z);
        assert!(ways[0] == 0.0 && ways[1] < -0.2, "{ways:?}");
        // Deeper moves leave all widths as they are, and are void where widths change.
        let deeper = once.lowered(&[above(0.0, 1.2)], 0.3).lowered(&[above(0.5, 1.1)], 0.4);
        assert!(deeper.is_alike(&once) && !deeper.is_alike(&by_calculation));
        let depths = [0.2, 40.0].map(|x| deeper.depth_at(&above(x, 1.0)));
        assert!((depths[0] - 0.32).abs() < 1e-12 && depths[1] == 0.0, "{depths:?}");
        assert!(deeper.narrowed(&places).lowered.is_empty() && deeper.scaled(0.9).lowered.is_empty());
    }
}
