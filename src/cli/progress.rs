//! A progress bar on a terminal, none in a pipe.

use std::time::Duration;

use cfodi::count::count_of;
use cfodi::line::one_line;
use cfodi::replay::Progress;
use cfodi::say::{flush, say};
use indicatif::{ProgressBar, ProgressStyle};

/// How far a bag has been read, or a simulation has come, with the rate and the time that remains.
pub(crate) struct Bar(ProgressBar);

impl Bar {
    /// A bar for a bag of `size` bytes.
    pub(crate) fn new(size: u64) -> Self {
        // Hidden by itself where stderr is no terminal.
        let bar = ProgressBar::new(size);
        Self::styled(bar, "{wide_bar} {bytes} of {total_bytes}{msg}, {bytes_per_sec}, {eta} left")
    }

    /// A bar for so many simulated scans.
    pub(crate) fn of_scans(scans: u64) -> Self {
        let all = count_of(scans, "scan");
        Self::styled(ProgressBar::new(scans), &format!("{{wide_bar}} {{pos}} of {all}{{msg}}, {{eta}} left"))
    }

    fn styled(bar: ProgressBar, template: &str) -> Self {
        // It is drawn below the lines so far.
        flush();
        // The templates are constants; were one wrong, the default style would do.
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        bar.enable_steady_tick(Duration::from_millis(200));
        Self(bar)
    }

    /// One scan more.
    pub(crate) fn advance(&self) {
        self.0.inc(1);
    }

    /// Says this behind how far it has come.
    pub(crate) fn tell(&self, message: &str) {
        self.0.set_message(format!(", {message}"));
    }

    pub(crate) fn set(&self, progress: Progress) {
        self.0.set_position(progress.bytes);
        if !self.0.is_hidden() {
            let seconds = self.0.elapsed().as_secs_f64().max(1e-9);
            let rate = progress.scans as f64 / seconds;
            self.tell(&format!("{}, {rate:.0} a second", count_of(progress.scans, "scan")));
        }
    }

    /// Writes a line to stderr, above the bar.
    pub(crate) fn say(&self, line: &str) {
        // The bar itself cannot be asked while it is suspended.
        let is_drawn = !self.0.is_hidden();
        self.0.suspend(|| {
            say(one_line(line));
            if is_drawn {
                flush();
            }
        });
    }

    pub(crate) fn finish(&self) {
        self.0.finish_and_clear();
    }
}
