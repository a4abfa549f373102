//! What the fuzz targets do, without a fuzzer: their seeds and all that once failed, every day; cases made by
//! chance from these, every night.

#[path = "../../fuzz/bodies/lib.rs"]
mod bodies;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use bodies::{TARGETS, Target};

/// Cases of each target in the nightly test. `MILLSTREAM_FUZZ_CASES` asks for another number,
/// `MILLSTREAM_FUZZ_TARGET` for one target only.
const CASES: usize = 20_000;

/// Longest input that is made, bytes.
const LONGEST: usize = 8_192;

/// Longest that a case may take.
const SLOWEST: Duration = Duration::from_secs(10);

/// Changes of one input at most.
const CHANGES: usize = 6;

/// Numbers at which readers go wrong, and marks of the formats.
const WORDS: [&str; 24] = [
    "0",
    "-0",
    "1",
    "-1",
    "1e308",
    "-1e308",
    "1e-308",
    "nan",
    "inf",
    "0.1",
    "3",
    "1e9",
    "4294967296",
    "18446744073709551616",
    "\n",
    "\0",
    "\"",
    "[",
    "]",
    "<",
    ">",
    "=",
    "#",
    "\u{feff}",
];

fn inputs(folder: &str, target: &str) -> Vec<(PathBuf, Vec<u8>)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz").join(folder).join(target);
    let Ok(files) = std::fs::read_dir(folder) else { return Vec::new() };
    let mut paths: Vec<PathBuf> = files.map(|file| file.unwrap().path()).collect();
    paths.sort();
    paths.into_iter().map(|path| (path.clone(), std::fs::read(path).unwrap())).collect()
}

#[test]
fn seeds_and_what_once_failed_hold() {
    for (target, check) in TARGETS {
        let seeds = inputs("seeds", target);
        assert!(!seeds.is_empty(), "{target} has no seeds");
        for (path, bytes) in seeds.iter().chain(&inputs("failed", target)) {
            let done = catch_unwind(|| check(bytes));
            assert!(done.is_ok(), "{}", path.display());
        }
    }
}

#[test]
#[ignore = "minutes: every night"]
fn cases_made_by_chance_hold() {
    let asked = |name: &str| std::env::var(name).ok();
    let cases = asked("MILLSTREAM_FUZZ_CASES").map_or(CASES, |count| count.parse().expect("a count"));
    let only = asked("MILLSTREAM_FUZZ_TARGET");
    for target in TARGETS.iter().filter(|(name, _)| only.as_deref().is_none_or(|only| only == *name)) {
        let began = Instant::now();
        hold(target, cases);
        println!("{}: {cases} cases in {:.0} s", target.0, began.elapsed().as_secs_f64());
    }
}

/// How long this thread has worked: a busy machine makes no case slow.
struct Worked {
    busy: Option<Duration>,
    clock: Instant,
}

impl Worked {
    fn now() -> Self {
        // Nanoseconds on a processor come first (Linux); elsewhere the clock has to do.
        let stat = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
        let busy = stat.and_then(|stat| stat.split(' ').next()?.parse().ok()).map(Duration::from_nanos);
        Self { busy, clock: Instant::now() }
    }

    fn elapsed(&self) -> Duration {
        let busy = self.busy.zip(Self::now().busy).map(|(before, now)| now - before);
        busy.unwrap_or_else(|| self.clock.elapsed())
    }
}

/// Each case follows from its number alone, so that it can be made again.
fn hold((target, check): &Target, cases: usize) {
    let seeds: Vec<Vec<u8>> = inputs("seeds", target).into_iter().map(|(_, bytes)| bytes).collect();
    millstream::parallel::map(cases, |case| {
        let (bytes, began) = (Chance::new(case as u64).input(&seeds), Worked::now());
        let held = catch_unwind(AssertUnwindSafe(|| check(&bytes))).is_ok();
        let took = began.elapsed();
        if !held || took > SLOWEST {
            let path = std::env::temp_dir().join(format!("{target}-{case}"));
            std::fs::write(&path, &bytes).unwrap();
            panic!("{target}, case {case} after {took:.1?}: {}", path.display());
        }
    });
}

/// Xorshift, from a number spread by splitmix64.
struct Chance(u64);

impl Chance {
    fn new(case: u64) -> Self {
        let mut z = case.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        Self((z ^ (z >> 27)) | 1)
    }

    /// A number below `end`; 0 where that is 0.
    fn below(&mut self, end: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        ((self.0 >> 16) as usize).checked_rem(end).unwrap_or(0)
    }

    /// A seed with changes.
    fn input(&mut self, seeds: &[Vec<u8>]) -> Vec<u8> {
        let mut bytes = seeds[self.below(seeds.len())].clone();
        for _ in 0..=self.below(CHANGES) {
            self.change(&mut bytes, seeds);
            bytes.truncate(LONGEST);
        }
        bytes
    }

    fn change(&mut self, bytes: &mut Vec<u8>, seeds: &[Vec<u8>]) {
        let at = self.below(bytes.len() + 1);
        let end = (at + 1 + self.below(16)).min(bytes.len());
        match self.below(7) {
            0 if at < bytes.len() => bytes[at] ^= 1 << self.below(8),
            1 if at < bytes.len() => bytes[at] = self.below(256) as u8,
            2 => drop(bytes.drain(at..end)),
            3 => {
                let piece = bytes[at..end].to_vec();
                bytes.splice(at..at, piece);
            }
            4 => {
                let other = &seeds[self.below(seeds.len())];
                let from = self.below(other.len());
                let to = (from + 1 + self.below(64)).min(other.len());
                bytes.splice(at..end, other[from..to].iter().copied());
            }
            5 => {
                let number = number_around(bytes, at);
                let word = WORDS[self.below(WORDS.len())];
                bytes.splice(number, word.bytes());
            }
            _ => {
                let word = WORDS[self.below(WORDS.len())];
                bytes.splice(at..at, word.bytes());
            }
        }
    }
}

/// The number at or after a place; nothing where there is none.
fn number_around(bytes: &[u8], at: usize) -> std::ops::Range<usize> {
    let is_digit = |b: &u8| b.is_ascii_digit() || b".-+".contains(b);
    let Some(start) = bytes[at..].iter().position(is_digit).map(|k| at + k) else { return at..at };
    let length = bytes[start..].iter().position(|b| !is_digit(b)).unwrap_or(bytes.len() - start);
    start..start + length
}
