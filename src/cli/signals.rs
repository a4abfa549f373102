//! The user's wish to stop: Ctrl-C, SIGTERM, SIGHUP.
//!
//! The first signal asks the run to stop, the second ends the process at once. What a killed run leaves is
//! put in order by the next one. A signal that was ignored when the program started stays ignored: `nohup`
//! ignores SIGHUP, and a shell ignores SIGINT for what it starts in the background.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Sets `stop` at the first signal, and exits with `status` at the second.
#[cfg(unix)]
pub fn listen(stop: &Arc<AtomicBool>, status: u8) {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    use signal_hook::flag;

    let ignored = ignored();
    for signal in [SIGINT, SIGTERM, SIGHUP] {
        if ignored & (1 << (signal - 1)) != 0 {
            continue;
        }
        // In this order: the first signal finds the flag unset. Without a handler the process simply ends.
        let _ = flag::register_conditional_shutdown(signal, i32::from(status), Arc::clone(stop));
        let _ = flag::register(signal, Arc::clone(stop));
    }
}

/// The signals that the process ignores: a bit for each, the lowest for signal 1. Only Linux says so without
/// unsafe code; elsewhere none counts as ignored.
#[cfg(unix)]
fn ignored() -> u64 {
    mask(&super::system::text("self/status")).unwrap_or(0)
}

#[cfg(unix)]
fn mask(status: &str) -> Option<u64> {
    let digits = status.lines().find_map(|line| line.strip_prefix("SigIgn:"))?;
    u64::from_str_radix(digits.trim(), 16).ok()
}

/// Sets `stop` at the first signal, and exits with `status` at the second.
#[cfg(not(unix))]
pub fn listen(stop: &Arc<AtomicBool>, status: u8) {
    use std::sync::atomic::Ordering;

    let flag = Arc::clone(stop);
    // Without a handler the process simply ends.
    let _ = ctrlc::set_handler(move || {
        if flag.swap(true, Ordering::Relaxed) {
            std::process::exit(i32::from(status));
        }
    });
}

/// Exits with `status` when standard input closes: whoever holds its other end has died, killed perhaps.
pub fn end_with_stdin(status: u8) {
    std::thread::spawn(move || {
        // An error means as much as the end.
        let _ = std::io::copy(&mut std::io::stdin().lock(), &mut std::io::sink());
        std::process::exit(i32::from(status));
    });
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn the_mask_of_ignored_signals_is_read() {
        // SIGPIPE, 13, and SIGHUP, 1.
        assert_eq!(mask("Name:\tx\nSigIgn:\t0000000000001001\nSigCgt:\t0\n"), Some(0x1001));
        assert_eq!(mask("Name:\tx\n"), None);
    }
}
