//! Progress on stderr while it is a terminal, and the wish to stop.

use std::io::{IsTerminal as _, Write as _};
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::signals;
use super::watch::{self, Watched};
use scene::printable_lines;
use work::monitor::Monitor;

/// True when people read stderr.
pub fn stderr_is_terminal() -> bool {
    std::io::stderr().is_terminal()
}

/// Shows what the stages report and hands them the user's wish to stop.
#[derive(Debug)]
pub struct Progress {
    watched: Arc<Watched>,
    bar: ProgressBar,
    /// The toolpath at work, before the stage's name.
    prefix: Mutex<String>,
}

impl Progress {
    /// Draws on stderr if that is a terminal, and begins to listen for the wish to stop.
    pub fn new() -> Self {
        let target =
            if stderr_is_terminal() { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let bar = ProgressBar::with_draw_target(Some(0), target);
        let watched = Arc::<Watched>::default();
        signals::listen(&watched.stop, super::COULD_NOT_RUN);
        watch::begin(&watched, &bar);
        Self { watched, bar, prefix: Mutex::new(String::new()) }
    }

    /// Shows nothing and hears no signal.
    #[cfg(test)]
    pub fn quiet() -> Self {
        Self { watched: Arc::default(), bar: ProgressBar::hidden(), prefix: Mutex::new(String::new()) }
    }

    /// As if the user had asked to stop.
    #[cfg(test)]
    pub fn stop(&self) {
        self.watched.stop.store(true, Ordering::Relaxed);
    }

    /// What the run and its watch know of each other.
    pub fn watched(&self) -> &Watched {
        &self.watched
    }

    /// Writes a line to stderr, above the bar.
    pub fn line(&self, text: &str) {
        let text = printable_lines(text);
        if self.bar.is_hidden() {
            // Where stderr takes nothing, nobody reads it.
            let _ = writeln!(std::io::stderr(), "{text}");
        } else {
            self.bar.println(text);
        }
    }

    /// Wipes the bar away.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

impl Monitor for Progress {
    fn belongs_to(&self, name: &str) {
        if let Ok(mut prefix) = self.prefix.lock() {
            name.clone_into(&mut prefix);
        }
    }

    fn start(&self, stage: &str, steps: u64) {
        /// How often a bar of unknown length moves.
        const BEAT: Duration = Duration::from_millis(120);
        let template =
            if steps == 0 { "{spinner} {msg}" } else { "{msg:50} {wide_bar} {percent:>3} %  {eta}" };
        if let Ok(style) = ProgressStyle::with_template(template) {
            self.bar.set_style(style);
        }
        let prefix = self.prefix.lock().map(|p| p.clone()).unwrap_or_default();
        self.bar.set_message(if prefix.is_empty() { stage.to_owned() } else { format!("{prefix}: {stage}") });
        self.bar.reset();
        self.bar.set_length(steps);
        if !self.bar.is_hidden() {
            self.bar.enable_steady_tick(BEAT);
        }
    }

    fn advance(&self, steps: u64) {
        self.bar.inc(steps);
    }

    fn cancelled(&self) -> bool {
        self.watched.stop.load(Ordering::Relaxed)
    }
}
