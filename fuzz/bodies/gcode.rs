//! Any bytes as G-code for every control: a message with a line, or motion that can be followed.

use super::program::holds;
use millstream::program::{CONTROLS, Setup, read_gcode};

pub fn check(bytes: &[u8]) {
    let setup = Setup { most_repeats: 2_000, ..Setup::from_above(200.0) };
    for control in &CONTROLS {
        holds(read_gcode("fuzz.nc", bytes, control, &setup), bytes);
    }
}
