//! Any bytes as cutter locations: a message with a line, or motion that can be followed.

use super::program::holds;
use millstream::program::{looks_like_apt, read_apt};

pub fn check(bytes: &[u8]) {
    let _ = looks_like_apt(bytes);
    holds(read_apt("fuzz.cls", bytes), bytes);
}
