//! A bar for work that takes more than a second, on a terminal.

use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

/// Nothing is shown before.
const PATIENCE: Duration = Duration::from_secs(1);
/// Steps of a bar.
const STEPS: u64 = 1000;

/// How far a piece of work has come.
pub(super) struct Progress {
    name: &'static str,
    started: Instant,
    bar: Option<ProgressBar>,
}

impl Progress {
    /// Work that has just begun.
    pub(super) fn new(name: &'static str) -> Self {
        Self {
            name,
            started: Instant::now(),
            bar: None,
        }
    }

    /// `share` of it, 0 to 1, is done.
    pub(super) fn tell(&mut self, share: f64) {
        if self.started.elapsed() < PATIENCE {
            return;
        }
        let name = self.name;
        let bar = self.bar.get_or_insert_with(|| {
            // indicatif draws on stderr, and only where that is a terminal.
            let bar = ProgressBar::new(STEPS);
            if let Ok(style) = ProgressStyle::with_template("{msg} {wide_bar} {percent}%") {
                bar.set_style(style);
            }
            bar.set_message(name);
            bar
        });
        bar.set_position((share.clamp(0.0, 1.0) * STEPS as f64) as u64);
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
