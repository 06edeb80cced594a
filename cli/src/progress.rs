//! Progress on the standard error stream: bars on a terminal, lines elsewhere, nothing if quiet.

use std::io::IsTerminal;
use std::time::Duration;

use hankel_system::text::visible;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::print::note;

/// One line that says what goes on.
pub struct Progress {
    bar: ProgressBar,
    /// Whether steps are printed as lines, for want of a terminal.
    lines: bool,
}

impl Progress {
    pub fn new(quiet: bool) -> Self {
        let terminal = std::io::stderr().is_terminal();
        let bar = ProgressBar::with_draw_target(
            None,
            if quiet || !terminal {
                ProgressDrawTarget::hidden()
            } else {
                ProgressDrawTarget::stderr()
            },
        );
        bar.set_style(spinner());
        Self {
            bar,
            lines: !quiet && !terminal,
        }
    }

    /// Something begins.
    pub fn begin(&self, what: &str) {
        if self.lines {
            note(format_args!("{}", visible(what)));
        }
        self.bar.enable_steady_tick(Duration::from_millis(120));
        self.bar.set_message(visible(what).into_owned());
    }

    /// A passing detail: shown on a terminal only.
    pub fn detail(&self, what: &str) {
        self.bar
            .set_message(visible(what.trim()).chars().take(100).collect::<String>());
    }

    /// Whether details are shown.
    #[cfg(all(feature = "frames", feature = "measure"))]
    pub fn is_seen(&self) -> bool {
        !self.bar.is_hidden()
    }

    /// `done` of `total`.
    fn position(&self, done: u64, total: Option<u64>) {
        match total {
            Some(total) if total > 0 => {
                if self.bar.length() != Some(total) {
                    self.bar.set_length(total);
                    self.bar.set_style(bar());
                }
                self.bar.set_position(done);
            }
            _ => self.bar.set_position(done),
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

fn spinner() -> ProgressStyle {
    ProgressStyle::with_template("{spinner} {wide_msg}")
        .unwrap_or_else(|_| ProgressStyle::default_spinner())
}

fn bar() -> ProgressStyle {
    ProgressStyle::with_template("{bar:30} {percent:>3} %  {wide_msg}")
        .unwrap_or_else(|_| ProgressStyle::default_bar())
}

impl hankel_toolchain::Progress for Progress {
    fn step(&mut self, name: &str, index: usize, count: usize) {
        self.bar.set_style(spinner());
        self.begin(&format!("[{index}/{count}] {name}"));
    }

    fn advance(&mut self, done: u64, total: Option<u64>) {
        self.position(done, total);
    }

    fn line(&mut self, text: &str) {
        if self.lines {
            note(format_args!("{}", visible(text)));
        } else {
            self.bar.println(visible(text));
        }
    }
}

#[cfg(feature = "frames")]
impl hankel_frames::Progress for Progress {
    fn begin(&mut self, name: &str, step: usize, steps: usize) {
        self.bar.set_style(spinner());
        Self::begin(self, &format!("[{step}/{steps}] {name}"));
    }

    fn advance(&mut self, share: f32) {
        // Thousandths: the bar counts in integers.
        self.position(
            (f64::from(share.clamp(0.0, 1.0)) * 1000.0) as u64,
            Some(1000),
        );
    }
}
