//! From the coordinates of a program to those of the machine: work offsets, shifts, rotations, the tool's
//! length.
//!
//! mm and degrees. The tip is where the tool's length would put it: machine coordinates less that length.

/// X Y Z A B C, mm and degrees.
pub type Place = [f64; 6];

/// Work offsets: G54 to G59.3.
pub const WORK_OFFSETS: usize = 9;

/// A turn in the plane of the first two axes of a plane, about a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Rotation {
    /// The axes.
    pub axes: [usize; 2],
    /// The point, in the coordinates of the program.
    pub centre: [f64; 2],
    /// Degrees, anticlockwise.
    pub angle: f64,
}

impl Rotation {
    fn turned(&self, mut at: Place, sense: f64) -> Place {
        let [u, v] = self.axes;
        let (sin, cos) = (sense * self.angle).to_radians().sin_cos();
        let (x, y) = (at[u] - self.centre[0], at[v] - self.centre[1]);
        at[u] = self.centre[0] + x * cos - y * sin;
        at[v] = self.centre[1] + x * sin + y * cos;
        at
    }
}

/// X Y and Z that differ by less, mm, do not move.
const NO_WAY: f64 = 1e-9;

/// The length that a feed counts: of X Y Z, mm, or where they stand, of the rotary axes, degrees.
pub(crate) fn fed_length(from: &Place, to: &Place) -> f64 {
    let apart = |k: usize| to[k] - from[k];
    let straight = apart(0).hypot(apart(1)).hypot(apart(2));
    if straight > NO_WAY { straight } else { apart(3).hypot(apart(4)).hypot(apart(5)) }
}

/// What stands between a program's coordinates and the machine's.
#[derive(Debug, Clone)]
pub(crate) struct Frame {
    /// Work offsets with their turns about z, degrees.
    pub work: Vec<(Place, f64)>,
    /// The lines that set them to machine coordinates, of each axis.
    pub set: Vec<[Option<u32>; 6]>,
    /// The one in force, from 0.
    pub active: usize,
    /// G92.
    pub shift: Place,
    /// Whether the shift counts.
    pub shifted: bool,
    /// G52.
    pub local: Place,
    /// G68.
    pub rotation: Option<Rotation>,
    /// What the control takes the tool's length for: x y z.
    pub length: [f64; 3],
}

impl Frame {
    pub fn new(work: [Place; WORK_OFFSETS]) -> Self {
        Self {
            work: work.map(|offset| (offset, 0.0)).to_vec(),
            set: vec![[None; 6]; WORK_OFFSETS],
            active: 0,
            shift: [0.0; 6],
            shifted: true,
            local: [0.0; 6],
            rotation: None,
            length: [0.0; 3],
        }
    }

    /// The turn of the active work offset.
    fn turn(&self) -> Option<Rotation> {
        let angle = self.work[self.active].1;
        (angle != 0.0).then_some(Rotation { axes: [0, 1], centre: [0.0; 2], angle })
    }

    /// Whether axes of the program are not those of the machine.
    pub fn turns(&self) -> bool {
        self.rotation.is_some() || self.work[self.active].1 != 0.0
    }

    /// Shift and local offset together.
    fn shifts(&self, axis: usize) -> f64 {
        self.local[axis] + if self.shifted { self.shift[axis] } else { 0.0 }
    }

    /// Coordinates of the program as the machine's.
    #[inline]
    pub fn machine_place(&self, at: &Place) -> Place {
        let mut place = *at;
        if let Some(rotation) = &self.rotation {
            place = rotation.turned(place, 1.0);
        }
        for (axis, x) in place.iter_mut().enumerate() {
            *x += self.shifts(axis);
        }
        if let Some(turn) = self.turn() {
            place = turn.turned(place, 1.0);
        }
        for (x, offset) in place.iter_mut().zip(&self.work[self.active].0) {
            *x += offset;
        }
        place
    }

    /// Coordinates of the machine as the program's.
    pub fn program_place(&self, at: &Place) -> Place {
        let mut place = *at;
        for (x, offset) in place.iter_mut().zip(&self.work[self.active].0) {
            *x -= offset;
        }
        if let Some(turn) = self.turn() {
            place = turn.turned(place, -1.0);
        }
        for (axis, x) in place.iter_mut().enumerate() {
            *x -= self.shifts(axis);
        }
        match &self.rotation {
            Some(rotation) => rotation.turned(place, -1.0),
            None => place,
        }
    }

    /// A direction of the program's axes as the machine's.
    pub fn direction(&self, axis: usize) -> [f64; 3] {
        let mut along: Place = [0.0; 6];
        along[axis] = 1.0;
        if let Some(rotation) = &self.rotation {
            along = Rotation { centre: [0.0; 2], ..*rotation }.turned(along, 1.0);
        }
        if let Some(turn) = self.turn() {
            along = turn.turned(along, 1.0);
        }
        [along[0], along[1], along[2]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn frame(angle: f64, turn: f64) -> Frame {
        let mut frame = Frame::new([[1.0, -2.0, 3.0, 10.0, 0.0, 0.0]; WORK_OFFSETS]);
        frame.work[0].1 = turn;
        frame.shift = [5.0, 0.0, -1.0, 0.0, 0.0, 0.0];
        frame.local = [0.0, 7.0, 0.0, 0.0, 0.0, 1.0];
        frame.rotation = Some(Rotation { axes: [0, 1], centre: [3.0, 4.0], angle });
        frame
    }

    #[test]
    fn a_rotation_turns_about_its_centre() {
        let mut frame = frame(90.0, 0.0);
        (frame.shift, frame.local) = ([0.0; 6], [0.0; 6]);
        let at = frame.machine_place(&[4.0, 4.0, 0.0, 0.0, 0.0, 0.0]);
        for (x, expected) in at.iter().zip([4.0, 3.0, 3.0, 10.0]) {
            assert!((x - expected).abs() < 1e-12, "{at:?}");
        }
        assert!((frame.direction(0)[1] - 1.0).abs() < 1e-12);
    }

    proptest! {
        #[test]
        fn both_ways_undo_each_other(at in prop::array::uniform6(-500.0..500.0), angle in -400.0..400.0, turn in -180.0..180.0) {
            let frame = frame(angle, turn);
            let back = frame.program_place(&frame.machine_place(&at));
            for (a, b) in at.iter().zip(back) {
                prop_assert!((a - b).abs() < 1e-9);
            }
        }
    }
}
