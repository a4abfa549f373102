//! One scene as a process of its own, watched: its time, its memory, why it failed.

use std::fs;
use std::io::{Read as _, Seek as _, SeekFrom};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use ::nightly::Cost;
use keys::printable_lines;

use crate::system;

/// What a process may take.
#[derive(Debug, Clone, Copy)]
pub struct Limits {
    /// Time from start to end.
    pub time: Duration,
    /// Resident memory, MiB.
    pub memory_mib: u64,
}

/// How often a process is looked at. A longer time lets it take more memory before it is stopped.
const POLL: Duration = Duration::from_millis(20);

/// What of an error's text is kept, bytes.
const LONGEST_REASON: u64 = 16 << 10;

/// Why there are no figures.
#[derive(Debug, PartialEq, Eq)]
pub enum Stopped {
    /// The process failed, or was stopped at a limit. A text for people.
    Failed(String),
    /// The user asked to stop.
    Cancelled,
}

/// Runs a command to its end. Standard input stays open meanwhile, and standard error is kept. Leaves what it
/// took; its `reference_s` is left at zero.
///
/// # Errors
/// [`Stopped`] unless the process ends with status 0 or 1.
pub fn watch(
    mut command: Command,
    limits: &Limits,
    cancelled: &dyn Fn() -> bool,
) -> (Result<(), Stopped>, Cost) {
    let start = Instant::now();
    let mut cost = Cost::default();
    let ended = started(&mut command).and_then(|(mut child, said)| {
        let ended = wait(&mut child, limits, cancelled, start, &mut cost);
        if ended.is_err() {
            // It has ended by itself, or ends now.
            let _ = child.kill();
            let _ = child.wait();
        }
        judged(ended?, said)
    });
    cost.wall_s = start.elapsed().as_secs_f64();
    (ended, cost)
}

/// Starts the process; leaves the file of its standard error, too.
fn started(command: &mut Command) -> Result<(Child, fs::File), Stopped> {
    let mut start = || {
        let said = tempfile::tempfile()?;
        let child = command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(said.try_clone()?).spawn()?;
        Ok((child, said))
    };
    start().map_err(|e: std::io::Error| {
        Stopped::Failed(format!("The scene's process could not be started: {e}"))
    })
}

fn wait(
    child: &mut Child,
    limits: &Limits,
    cancelled: &dyn Fn() -> bool,
    start: Instant,
    cost: &mut Cost,
) -> Result<ExitStatus, Stopped> {
    loop {
        // First: the system forgets a process that was waited for.
        look(child.id(), cost);
        if let Some(status) = child.try_wait().map_err(|e| Stopped::Failed(e.to_string()))? {
            return Ok(status);
        }
        if cancelled() {
            return Err(Stopped::Cancelled);
        }
        if start.elapsed() > limits.time {
            let text = format!("Stopped after {} s. Allow more with --time-limit.", limits.time.as_secs());
            return Err(Stopped::Failed(text));
        }
        if cost.peak_mib.is_some_and(|peak| peak > limits.memory_mib as f64) {
            let text = format!(
                "Stopped because it took more than {} MiB of memory. Use larger cells, or allow more with memory_mib in \
                 the scene and with --memory.",
                limits.memory_mib
            );
            return Err(Stopped::Failed(text));
        }
        std::thread::sleep(POLL);
    }
}

/// Whether the process has figures, or else what it said.
fn judged(status: ExitStatus, mut said: fs::File) -> Result<(), Stopped> {
    if matches!(status.code(), Some(0 | 1)) {
        return Ok(());
    }
    let mut bytes = Vec::new();
    // What cannot be read is no reason.
    let _ = said.seek(SeekFrom::Start(0)).and_then(|_| said.take(LONGEST_REASON).read_to_end(&mut bytes));
    let text = printable_lines(&String::from_utf8_lossy(&bytes));
    let said = text.trim().trim_start_matches('×').trim_start();
    // Messages of the program name what is wrong; any other status is a crash.
    let reason = match status.code() {
        Some(2) if !said.is_empty() => said.to_owned(),
        _ => format!("{}\n{said}", ending(status)),
    };
    Err(Stopped::Failed(reason.trim_end().to_owned()))
}

#[cfg(unix)]
fn ending(status: ExitStatus) -> String {
    use std::os::unix::process::ExitStatusExt as _;
    match status.signal() {
        // SIGKILL.
        Some(9) => "Killed from outside. The system does so when its memory runs out.".into(),
        _ => format!("Ended with {status}."),
    }
}

#[cfg(not(unix))]
fn ending(status: ExitStatus) -> String {
    format!("Ended with {status}.")
}

/// Notes the time and the highest resident memory that a process has taken so far.
fn look(id: u32, cost: &mut Cost) {
    cost.cpu_s = cpu_s(&system::text(&format!("{id}/stat"))).or(cost.cpu_s);
    let highest = system::kib(&system::text(&format!("{id}/status")), "VmHWM");
    cost.peak_mib = highest.map(|kib| kib as f64 / 1024.0).or(cost.peak_mib);
}

/// CPU time of all threads, from /proc/ID/stat.
fn cpu_s(stat: &str) -> Option<f64> {
    /// Linux shows times in these, whatever the machine.
    const TICKS_PER_SECOND: f64 = 100.0;
    // The name, in brackets, may have spaces and brackets. After it: the state is number 0.
    let mut fields = stat.rsplit_once(')')?.1.split_whitespace().skip(11);
    let [user, system] = [fields.next()?, fields.next()?].map(|field| field.parse::<u64>().ok());
    Some((user? + system?) as f64 / TICKS_PER_SECOND)
}

/// Memory that is free on this machine, MiB; `None` where the system does not say.
pub fn free_mib() -> Option<u64> {
    system::kib(&system::text("meminfo"), "MemAvailable").map(|kib| kib / 1024)
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    const LONG: Limits = Limits { time: Duration::from_secs(600), memory_mib: 1 << 20 };

    fn shell(text: &str, limits: &Limits) -> (Result<(), Stopped>, Cost) {
        let mut command = Command::new("sh");
        command.args(["-c", text]);
        watch(command, limits, &|| false)
    }

    fn reason(text: &str, limits: &Limits) -> String {
        match shell(text, limits).0 {
            Err(Stopped::Failed(reason)) => reason,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn figures_come_with_status_0_and_1_only() {
        assert!(shell("exit 0", &LONG).0.is_ok() && shell("exit 1", &LONG).0.is_ok());
        assert_eq!(reason("echo '  × no part' >&2; exit 2", &LONG), "no part");
        assert_eq!(reason("echo panicked >&2; exit 101", &LONG), "Ended with exit status: 101.\npanicked");
        assert!(reason("kill -9 $$", &LONG).starts_with("Killed from outside"));
        assert!(reason("kill -SEGV $$", &LONG).contains("signal: 11"));
        let (ended, _) = watch(Command::new("/no/such/program"), &LONG, &|| false);
        assert!(matches!(ended, Err(Stopped::Failed(reason)) if reason.contains("could not be started")));
    }

    #[test]
    fn what_hangs_is_stopped() {
        let short = Limits { time: Duration::from_millis(50), ..LONG };
        assert!(reason("exec sleep 600", &short).contains("Stopped after"));
        let mut command = Command::new("sleep");
        command.arg("600");
        assert_eq!(watch(command, &LONG, &|| true).0, Err(Stopped::Cancelled));
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn what_takes_too_much_memory_is_stopped() {
        let small = Limits { memory_mib: 60, ..LONG };
        let reason = reason("x=$(head -c 200000000 /dev/zero | tr '\\0' a); sleep 600", &small);
        assert!(reason.contains("more than 60 MiB"), "{reason}");
        let (ended, cost) = shell("i=0; while [ $i -lt 50000 ]; do i=$((i+1)); done; sleep 0.1", &LONG);
        assert!(ended.is_ok() && cost.cpu_s.unwrap() > 0.0 && cost.peak_mib.unwrap() > 0.1, "{cost:?}");
    }

    #[test]
    fn the_time_of_a_process_is_read() {
        let stat = "12 (a ) b) S 1 2 3 4 5 6 7 8 9 10 150 50 0 0 20 0";
        assert_eq!((cpu_s(stat), cpu_s("")), (Some(2.0), None));
    }
}
