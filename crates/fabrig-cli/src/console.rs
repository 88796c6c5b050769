//! Standard output, standard error, progress bars and Ctrl-C.

use std::io::Write;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Where a command prints, and whether it was asked to stop.
pub(crate) struct Console {
    bar: ProgressBar,
    is_stopped: Arc<AtomicBool>,
}

impl Console {
    /// Bars are drawn on standard error, if that is a terminal.
    pub(crate) fn new() -> Self {
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
        let is_stopped = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&is_stopped);
        // Fails only where a handler stands already; Ctrl-C then ends the program as usual.
        let _ = ctrlc::set_handler(move || {
            if flag.swap(true, Ordering::SeqCst) {
                // Asked twice: leave at once.
                std::process::exit(130);
            }
        });
        Self { bar, is_stopped }
    }

    /// A line of result on standard output.
    pub(crate) fn result(&self, line: &str) {
        self.bar.suspend(|| {
            // A reader that has gone away wants no more lines.
            let _ = writeln!(std::io::stdout().lock(), "{line}");
        });
    }

    /// A line for the person on standard error.
    pub(crate) fn note(&self, line: &str) {
        self.bar.suspend(|| {
            let _ = writeln!(std::io::stderr().lock(), "{line}");
        });
    }

    /// Shows a share of work, 0 to 1, and says whether to go on.
    pub(crate) fn share(&self, stage: &str, fraction: f64) -> ControlFlow<()> {
        const STEPS: u64 = 1000;
        self.show(stage, (fraction * STEPS as f64) as u64, STEPS, "")
    }

    /// Shows `done` of `total`, and says whether to go on.
    pub(crate) fn show(&self, stage: &str, done: u64, total: u64, detail: &str) -> ControlFlow<()> {
        const TEMPLATE: &str = "{prefix:>10} {wide_bar} {percent:>3}% {msg} {eta}";
        self.draw(TEMPLATE, stage, done, total, detail)
    }

    /// As [`Self::show`], where `detail` says itself how long the rest takes.
    pub(crate) fn show_with(
        &self,
        stage: &str,
        done: u64,
        total: u64,
        detail: &str,
    ) -> ControlFlow<()> {
        const TEMPLATE: &str = "{prefix:>10} {wide_bar} {percent:>3}% {msg}";
        self.draw(TEMPLATE, stage, done, total, detail)
    }

    fn draw(
        &self,
        template: &str,
        stage: &str,
        done: u64,
        total: u64,
        detail: &str,
    ) -> ControlFlow<()> {
        if self.bar.length() != Some(total) {
            self.bar.set_length(total);
            if let Ok(style) = ProgressStyle::with_template(template) {
                self.bar.set_style(style);
            }
        }
        self.bar.set_prefix(stage.to_owned());
        self.bar.set_message(detail.to_owned());
        self.bar.set_position(done);
        if self.is_stopped() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }

    /// Whether Ctrl-C was pressed.
    pub(crate) fn is_stopped(&self) -> bool {
        self.is_stopped.load(Ordering::SeqCst)
    }

    /// Takes the bar away.
    pub(crate) fn clear(&self) {
        self.bar.finish_and_clear();
    }
}
