//! Lines through places that lie along curves, in no order.

use std::collections::{HashMap, VecDeque};

use geometry::Point2;

/// The next place of a line is no farther than so many times what places are apart at least.
const FARTHEST: f64 = 4.0;

/// Lines through places that lie along curves: each goes on to the nearest place ahead, at both ends. Of places
/// within `apart`, mm, the first is taken; a line ends so many mm `beyond` its last one, before a gap of four times
/// that. A place alone is a line of one.
pub(super) fn lines_through(places: Vec<Point2>, apart: f64, beyond: f64) -> Vec<Vec<Point2>> {
    let mut open = Open { reach: FARTHEST * apart, places: HashMap::new() };
    let mut starts = Vec::new();
    for at in places {
        if open.near(at).all(|other| (other - at).norm() >= apart) {
            open.places.entry(open.square(&at)).or_default().push(at);
            starts.push(at);
        }
    }
    let line_from = |start: Point2| {
        open.take(&start)?;
        let mut line = VecDeque::from([start]);
        while let Some(next) = open.take_after(line[line.len() - 1], line.iter().rev().nth(1)) {
            line.push_back(next);
        }
        while let Some(next) = open.take_after(line[0], line.get(1)) {
            line.push_front(next);
        }
        // Around a hollow it comes back to where it began.
        let (first, last) = (line[0], line[line.len() - 1]);
        if line.len() > 3 && (last - first).norm() <= open.reach {
            line.push_back(first);
        } else if line.len() > 1 {
            let further = |end: Point2, before: Point2| end + (end - before).normalize() * beyond;
            line.push_back(further(last, line[line.len() - 2]));
            line.push_front(further(first, line[1]));
        }
        Some(line.into())
    };
    starts.into_iter().filter_map(line_from).collect()
}

/// Places that no line goes through so far, by squares.
struct Open {
    /// Edge of the squares, mm, and how far a line goes to the next place.
    reach: f64,
    places: HashMap<[i64; 2], Vec<Point2>>,
}

impl Open {
    fn square(&self, at: &Point2) -> [i64; 2] {
        at.coords.map(|x| (x / self.reach).floor() as i64).into()
    }

    /// The places in the squares around one.
    fn near(&self, at: Point2) -> impl Iterator<Item = &Point2> {
        let [x, y] = self.square(&at);
        let around = (-1..=1).flat_map(move |i| (-1..=1).map(move |j| [x + i, y + j]));
        around.filter_map(|square| self.places.get(&square)).flatten()
    }

    /// Takes a place; `None` where a line goes through it.
    fn take(&mut self, at: &Point2) -> Option<Point2> {
        let square = self.square(at);
        let places = self.places.get_mut(&square)?;
        let k = places.iter().position(|place| place == at)?;
        Some(places.swap_remove(k))
    }

    /// Takes the nearest place within reach of the end of a line, ahead of the place `before` it.
    fn take_after(&mut self, end: Point2, before: Option<&Point2>) -> Option<Point2> {
        let is_ahead = |at: &&Point2| {
            (*at - end).norm() <= self.reach
                && before.is_none_or(|before| (*at - end).dot(&(end - before)) > 0.0)
        };
        let near = self.near(end).filter(is_ahead);
        let next = near.min_by(|a, b| (*a - end).norm().total_cmp(&(*b - end).norm())).copied()?;
        self.take(&next)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Places of a circle and of a straight line, in no order and twice: a closed line and an open one, with no
    /// corner sharper than the places make it.
    #[test]
    fn a_circle_and_a_straight_line_are_one_line_each() {
        let circle = (0..400).map(|k| {
            let (sin, cos) = (f64::from(k * 57 % 400) * std::f64::consts::TAU / 400.0).sin_cos();
            Point2::new(5.0 * cos, 5.0 * sin)
        });
        let straight = (0..300).map(|k| Point2::new(20.0, f64::from(k * 101 % 300) * 0.04));
        let lines = lines_through(circle.chain(straight).collect(), 0.1, 0.5);
        assert_eq!(lines.len(), 2, "{lines:?}");
        let length = |line: &[Point2]| line.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum::<f64>();
        assert_eq!(lines[0][0], lines[0][lines[0].len() - 1]);
        assert!((length(&lines[0]) - 10.0 * std::f64::consts::PI).abs() < 0.01, "{}", length(&lines[0]));
        assert!((length(&lines[1]) - 299.0 * 0.04 - 1.0).abs() < 0.2, "{}", length(&lines[1]));
        assert_eq!(lines_through(vec![Point2::origin()], 0.1, 0.5), [[Point2::origin()]]);
    }
}
