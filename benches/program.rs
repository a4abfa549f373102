//! Reading programs: two million plain lines, and what they take as motion.

use millstream::motion::Toolpath;
use millstream::program::{GENERAL_CONTROL, Placing, Program, Setup, read_apt, read_gcode};

const LINES: usize = 2_000_000;

fn main() {
    divan::main();
}

/// Feeds as finishing programs have them.
fn gcode() -> String {
    let place = |k: usize| (0.05 * (k % 2000) as f64, 0.1 * (k / 2000) as f64, -0.5 + 1e-4 * (k % 97) as f64);
    let mut text = "G21 G90 G17\nS12000 M3\nG0 X0 Y0 Z5\nG1 Z0 F1000\n".to_owned();
    for k in 0..LINES {
        let (x, y, z) = place(k);
        text += &format!("X{x:.4} Y{y:.3} Z{z:.4}\n");
    }
    text + "M30\n"
}

fn apt() -> String {
    let gcode = gcode();
    let words = |line: &str| line.replace(['X', 'Y', 'Z'], "").replace(' ', ",");
    let goto =
        gcode.lines().filter(|line| line.starts_with('X')).map(|line| format!("GOTO/{}\n", words(line)));
    format!("FROM/0,0,5\nFEDRAT/1000,MMPM\n{}FINI\n", goto.collect::<String>())
}

#[divan::bench(sample_count = 5)]
fn two_million_lines_of_g_code(bencher: divan::Bencher) {
    let text = gcode();
    let read = || read_gcode("a.nc", text.as_bytes(), GENERAL_CONTROL, &Setup::default()).unwrap();
    bencher.counter(divan::counter::ItemsCount::new(LINES)).bench(read);
}

#[divan::bench(sample_count = 5)]
fn two_million_locations_of_apt(bencher: divan::Bencher) {
    let text = apt();
    let read = || read_apt("a.cls", text.as_bytes()).unwrap();
    bencher.counter(divan::counter::ItemsCount::new(LINES)).bench(read);
}

#[divan::bench(sample_count = 5)]
fn two_million_moves(bencher: divan::Bencher) {
    let text = gcode();
    let read: Program = read_gcode("a.nc", text.as_bytes(), GENERAL_CONTROL, &Setup::default()).unwrap();
    let placing = || Placing { chord: 0.001, kinematics: None, lengths: &|_| None };
    let path = || -> Toolpath { read.runs(&placing()).unwrap().swap_remove(0).path };
    bencher.counter(divan::counter::ItemsCount::new(LINES)).bench(path);
}
