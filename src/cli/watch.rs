//! A thread that ends what does not answer, a run that was asked to stop or one that takes more memory than it may,
//! and that tells a log how far long work is.
//!
//! Long work asks its monitor whether to go on, and answers within milliseconds. What has to hold whatever
//! the work does is held here: the process ends soon after a signal, and its memory stays within what the
//! scene allows. Estimates refuse most runs before they begin; this is for those that no estimate covers.
//! Only memory that the process wrote counts: the system takes back the pages of the program's own file when
//! it needs them. It is known on Linux only.

use std::fmt;
use std::process::exit;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use indicatif::ProgressBar;

use report::duration;

use super::error::CliError;
use super::{system, to_stderr};

/// How often memory and wishes are looked at. Longer lets a run take more memory unseen; each look takes some
/// 20 µs.
const LOOK: Duration = Duration::from_millis(5);

/// A run that has not answered after this time is ended. Longer is felt as hanging; shorter ends work that
/// was about to answer.
const ANSWER: Duration = Duration::from_millis(700);

/// How often a log is told what is being done. More often fills it; more seldom looks like hanging.
const TOLD: Duration = Duration::from_secs(30);

/// What the program takes beside the memory that a scene allows, MiB: its stacks, its tables, and what its
/// allocator keeps; and what the allocator keeps for each further thread. Less stops small runs, more lets a
/// run exceed what was allowed.
const BESIDES: u64 = 12;
const A_THREAD: u64 = 1;

const MIB: u64 = 1 << 20;

/// What is done before a run is ended that does not answer.
#[derive(Default)]
struct Discarding(Option<Box<dyn FnOnce() + Send>>);

impl fmt::Debug for Discarding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Discarding")
    }
}

/// What the run and its watch know of each other.
#[derive(Debug, Default)]
pub struct Watched {
    /// The wish to stop: the user's, or the watch's.
    pub stop: Arc<AtomicBool>,
    /// Memory that the scene allows, MiB; 0 for any.
    allowed_mib: AtomicU64,
    /// Memory that the process may take, bytes.
    most: AtomicU64,
    too_much: AtomicBool,
    /// Nobody is told what is being done: what stderr takes is another program's.
    silent: AtomicBool,
    discarding: Mutex<Discarding>,
    /// The results are on their way to their place: nothing ends the process any more but a second signal.
    committed: AtomicBool,
}

impl Watched {
    /// From now on the process may take what a scene allows.
    pub fn allow_memory(&self, mib: u32, threads: usize) {
        let besides = BESIDES + A_THREAD * (threads as u64).saturating_sub(1);
        self.allowed_mib.store(mib.into(), Ordering::Relaxed);
        self.most.store((u64::from(mib) + besides) * MIB, Ordering::Relaxed);
    }

    /// What removes the results that were begun, should the run be ended.
    pub fn discard_by(&self, discarding: impl FnOnce() + Send + 'static) {
        if let Ok(mut known) = self.discarding.lock() {
            known.0 = Some(Box::new(discarding));
        }
    }

    /// Removes the results that were begun.
    fn discard(&self) {
        if let Ok(Some(discarding)) = self.discarding.lock().map(|mut known| known.0.take()) {
            discarding();
        }
    }

    /// From now on nobody is told what is being done.
    pub fn tell_nobody(&self) {
        self.silent.store(true, Ordering::Relaxed);
    }

    /// From now on the run is not ended for being slow.
    pub fn commit(&self) {
        self.committed.store(true, Ordering::Relaxed);
    }

    /// Why the run was stopped.
    pub fn reason(&self) -> CliError {
        let allowed_mib = self.allowed_mib.load(Ordering::Relaxed);
        if self.too_much.load(Ordering::Relaxed) {
            CliError::Memory { allowed_mib }
        } else {
            CliError::Interrupted
        }
    }

    /// Whether the process takes more than it may.
    fn takes_too_much(&self, written: u64) -> bool {
        let most = self.most.load(Ordering::Relaxed);
        most > 0 && written > most
    }
}

/// Begins to watch.
pub fn begin(watched: &Arc<Watched>, bar: &ProgressBar) {
    let (watched, bar) = (Arc::clone(watched), bar.clone());
    // Without the thread, the work's own answers are all there is.
    let _ = std::thread::Builder::new().name("watch".into()).spawn(move || watch(&watched, &bar));
}

fn watch(watched: &Watched, bar: &ProgressBar) {
    let (begun, mut told) = (Instant::now(), 0);
    let mut asked: Option<Instant> = None;
    loop {
        std::thread::sleep(LOOK);
        if watched.committed.load(Ordering::Relaxed) {
            return;
        }
        // The bar shows nothing where stderr is no terminal.
        let passed = begun.elapsed();
        if bar.is_hidden() && passed >= (told + 1) * TOLD {
            told += 1;
            if !watched.silent.load(Ordering::Relaxed) {
                // Where stderr takes nothing, nobody reads it.
                let _ = to_stderr(&told_of(bar, passed));
            }
        }
        if !watched.too_much.load(Ordering::Relaxed)
            && written().is_some_and(|now| watched.takes_too_much(now))
        {
            watched.too_much.store(true, Ordering::Relaxed);
            watched.stop.store(true, Ordering::Relaxed);
        }
        if !watched.stop.load(Ordering::Relaxed) {
            continue;
        }
        if asked.get_or_insert_with(Instant::now).elapsed() > ANSWER {
            bar.finish_and_clear();
            watched.discard();
            exit(super::report_error(&watched.reason()).into());
        }
    }
}

/// What is being done, how much of it is done, and for how long the run has been at work.
fn told_of(bar: &ProgressBar, passed: Duration) -> String {
    let steps = bar.length().unwrap_or(0);
    let share = (100 * bar.position().min(steps)).checked_div(steps);
    let share = share.map_or_else(String::new, |share| format!(" {share} %"));
    format!("{}  {}{share}\n", duration(passed.as_secs_f64()), bar.message())
}

/// Memory that the process has written to and holds now, bytes.
fn written() -> Option<u64> {
    system::kib(&system::text("self/status"), "RssAnon").map(|kib| 1024 * kib)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(target_os = "linux")]
    fn the_memory_of_the_process_is_read() {
        let before = written().unwrap();
        let held = vec![1u8; 64 * MIB as usize];
        assert!(written().unwrap() >= before + 32 * MIB, "{before}");
        drop(std::hint::black_box(held));
    }

    #[test]
    fn a_log_is_told_what_is_being_done() {
        let bar = ProgressBar::hidden();
        bar.set_message("wave: cutting");
        assert_eq!(told_of(&bar, Duration::from_secs(30)), "30.0 s  wave: cutting\n");
        bar.set_length(8);
        bar.inc(3);
        assert_eq!(told_of(&bar, Duration::from_secs(90)), "1:30  wave: cutting 37 %\n");
    }

    #[test]
    fn what_was_begun_is_discarded_once() {
        let watched = Watched::default();
        let count = Arc::new(AtomicU64::new(0));
        let counted = Arc::clone(&count);
        watched.discard_by(move || {
            counted.fetch_add(1, Ordering::Relaxed);
        });
        watched.discard();
        watched.discard();
        assert_eq!(count.load(Ordering::Relaxed), 1);
    }

    #[test]
    fn a_run_may_take_what_is_allowed_and_what_the_program_takes() {
        let watched = Watched::default();
        assert!(!watched.takes_too_much(u64::MAX));
        watched.allow_memory(100, 1);
        assert!(!watched.takes_too_much(112 * MIB) && watched.takes_too_much(112 * MIB + 1));
        watched.allow_memory(100, 4);
        assert!(!watched.takes_too_much(115 * MIB) && watched.takes_too_much(115 * MIB + 1));
        assert!(matches!(watched.reason(), CliError::Interrupted));
        watched.too_much.store(true, Ordering::Relaxed);
        assert!(matches!(watched.reason(), CliError::Memory { allowed_mib: 100 }));
    }
}
