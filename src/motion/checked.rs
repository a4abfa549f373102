//! Whether a path of somebody else can be cut and measured.

use geometry::{MAX_COORDINATE, Vector3};

use crate::{ClPoint, Toolpath};

/// The length of a tool axis differs from 1 by no more than this: rounding.
const UNIT: f64 = 1e-9;

/// Why a path cannot be cut. The move is counted from 0; `None` is the start of the path.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum PathError {
    /// A coordinate is not a number, or no machine goes there.
    #[error(
        "{} goes to x {} y {} z {}; coordinates must be numbers within ±1e6 mm", name(.move_index), .tip[0], .tip[1], .tip[2]
    )]
    Place {
        /// The move.
        move_index: Option<usize>,
        /// Where it ends, mm.
        tip: [f64; 3],
    },
    /// A tool axis is no unit vector.
    #[error("{} has the tool axis ({}, {}, {}); it must be a unit vector", name(.move_index), .axis[0], .axis[1], .axis[2])]
    Axis {
        /// The move.
        move_index: Option<usize>,
        /// Its axis.
        axis: [f64; 3],
    },
    /// The tool leans, where only upright ones can be cut.
    #[error(
        "{} has the tool axis ({}, {}, {}); heights need an upright tool, (0, 0, 1). The engines `rays` and `voxel` cut leaning tools",
        name(.move_index), .axis[0], .axis[1], .axis[2]
    )]
    Leans {
        /// The move.
        move_index: Option<usize>,
        /// Its axis.
        axis: [f64; 3],
    },
}

fn name(move_index: &Option<usize>) -> String {
    move_index.map_or_else(|| "the start of the path".into(), |k| format!("move {k} of the path"))
}

impl Toolpath {
    /// Whether it can be cut: all coordinates are numbers within [`MAX_COORDINATE`], all axes unit vectors.
    ///
    /// # Errors
    /// [`PathError`], of the first location that is wrong.
    pub fn check(&self) -> Result<(), PathError> {
        let wrong = |to: &ClPoint| {
            let is_place = to.tip.coords.iter().all(|x| x.abs() <= MAX_COORDINATE);
            let is_unit = (to.axis.norm() - 1.0).abs() <= UNIT;
            !(is_place && is_unit)
        };
        match self.first(wrong) {
            None => Ok(()),
            Some((move_index, to)) if (to.axis.norm() - 1.0).abs() <= UNIT => {
                Err(PathError::Place { move_index, tip: to.tip.into() })
            }
            Some((move_index, to)) => Err(PathError::Axis { move_index, axis: to.axis.into() }),
        }
    }

    /// As [`Toolpath::check`], and the tool is upright at each location.
    ///
    /// # Errors
    /// As [`Toolpath::check`]; [`PathError::Leans`].
    pub fn check_upright(&self) -> Result<(), PathError> {
        self.check()?;
        match self.first(|to| to.axis != Vector3::z()) {
            Some((move_index, to)) => Err(PathError::Leans { move_index, axis: to.axis.into() }),
            None => Ok(()),
        }
    }

    /// The first location with a property, and the move that ends there.
    fn first(&self, is_so: impl Fn(&ClPoint) -> bool) -> Option<(Option<usize>, &ClPoint)> {
        if is_so(&self.start) {
            return Some((None, &self.start));
        }
        let at = self.moves.iter().position(|step| is_so(&step.to))?;
        Some((Some(at), &self.moves[at].to))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Move, MoveKind};
    use geometry::Point3;

    fn path(to: ClPoint) -> Toolpath {
        let step = |to| Move { to, kind: MoveKind::Cut, feed_rate: 1.0, pass: u32::MAX };
        let start = ClPoint::upright(Point3::origin());
        Toolpath::new(start, vec![step(start), step(to)])
    }

    #[test]
    fn the_first_wrong_move_is_named() {
        let at = |x: f64| path(ClPoint::upright(Point3::new(1.0, x, 2.0)));
        for x in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e12, -1.01e6] {
            let error = at(x).check().unwrap_err();
            assert!(matches!(error, PathError::Place { move_index: Some(1), .. }), "{x}: {error}");
            assert!(error.to_string().starts_with("move 1 of the path goes to x 1 y "), "{error}");
        }
        assert_eq!([at(1e6).check_upright(), at(-1e6).check()], [Ok(()); 2]);
        let leaning = |axis| path(ClPoint { tip: Point3::origin(), axis });
        for axis in [[0.0; 3], [0.5, 0.0, 0.866], [f64::NAN, 0.0, 1.0], [0.0, 0.0, f64::INFINITY]] {
            let error = leaning(axis.into()).check().unwrap_err();
            assert!(matches!(error, PathError::Axis { move_index: Some(1), .. }), "{axis:?}: {error}");
        }
        let lean = leaning(Vector3::new(0.6, 0.0, 0.8));
        assert_eq!(lean.check(), Ok(()));
        let axis = [0.6, 0.0, 0.8];
        assert_eq!(lean.check_upright(), Err(PathError::Leans { move_index: Some(1), axis }));
        let nowhere = Toolpath::new(ClPoint::upright(Point3::new(0.0, 0.0, f64::NAN)), Vec::new());
        assert!(nowhere.check().unwrap_err().to_string().starts_with("the start of the path goes to"));
    }
}
