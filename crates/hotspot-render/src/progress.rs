//! Progress on standard error: a bar on a terminal, plain lines elsewhere, JSON lines on request, or nothing.

use crate::args::TalkArgs;
use hotspot_integrator::Progress;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// Speaks to the person who waits.
pub(crate) struct Talker {
    mode: Mode,
    quiet: bool,
    /// The estimated relMSE so far, and whether it is unbiased rather than an upper bound.
    estimate: Mutex<Option<(f64, bool)>>,
}

enum Mode {
    Silent,
    Bar(ProgressBar),
    /// When the last line was written.
    Lines(Mutex<Option<Instant>>),
    Json(Mutex<Option<Instant>>),
}

/// Plain lines come this far apart.
const LINE_EVERY: Duration = Duration::from_secs(5);
const JSON_EVERY: Duration = Duration::from_millis(500);

impl Talker {
    pub(crate) fn new(talk: &TalkArgs) -> Self {
        let mode = if talk.quiet {
            Mode::Silent
        } else if talk.json_progress {
            Mode::Json(Mutex::new(None))
        } else if std::io::stderr().is_terminal() {
            let bar = ProgressBar::with_draw_target(Some(1000), ProgressDrawTarget::stderr_with_hz(10));
            if let Ok(style) = ProgressStyle::with_template("{bar:32} {percent:>3} %  {msg}") {
                bar.set_style(style);
            }
            Mode::Bar(bar)
        } else {
            Mode::Lines(Mutex::new(None))
        };
        Self { mode, quiet: talk.quiet, estimate: Mutex::new(None) }
    }

    /// One line for people on standard output, unless quiet.
    pub(crate) fn say(&self, line: &str) {
        if !self.quiet {
            crate::say::out!("{line}");
        }
    }

    /// A warning on standard error; also when quiet.
    pub(crate) fn warn(&self, line: &str) {
        match &self.mode {
            Mode::Bar(bar) => bar.suspend(|| crate::say::err!("{line}")),
            _ => crate::say::err!("{line}"),
        }
    }

    /// Whether an estimate of the error would be seen.
    pub(crate) const fn shows_estimate(&self) -> bool {
        matches!(self.mode, Mode::Bar(_) | Mode::Json(_))
    }

    /// The relative squared error of the picture so far, shown with the progress from now on.
    pub(crate) fn estimate(&self, error: f64, unbiased: bool) {
        if let Ok(mut estimate) = self.estimate.lock() {
            *estimate = Some((error, unbiased));
        }
    }

    /// Called from worker threads.
    pub(crate) fn progress(&self, progress: Progress) {
        let share = progress.done as f64 / progress.total as f64;
        let elapsed = progress.elapsed.as_secs_f64();
        let rate = progress.done as f64 / elapsed.max(1e-9) * 1e-6;
        let left = elapsed * (1.0 - share) / share.max(1e-9);
        let estimate = self.estimate.lock().ok().and_then(|estimate| *estimate);
        match &self.mode {
            Mode::Silent => {}
            Mode::Bar(bar) => {
                bar.set_position((share * 1000.0) as u64);
                let error = estimate.map_or(String::new(), |(error, unbiased)| {
                    format!(", relMSE {}{error:.1e}", if unbiased { "" } else { "below " })
                });
                bar.set_message(format!("{rate:.2} Msamples/s, {left:.0} s left{error}"));
            }
            Mode::Lines(last) => {
                if due(last, LINE_EVERY) {
                    crate::say::err!("{:3.0} %  {rate:.2} Msamples/s, {left:.0} s left", share * 100.0);
                }
            }
            Mode::Json(last) => {
                if due(last, JSON_EVERY) || progress.done == progress.total {
                    let error = estimate.map_or(String::new(), |(error, unbiased)| {
                        format!(",\"estimated_relmse\":{error:e},\"unbiased\":{unbiased}")
                    });
                    crate::say::err!(
                        "{{\"progress\":{share:.4},\"seconds\":{elapsed:.3},\"msamples_per_second\":{rate:.4},\
                         \"seconds_left\":{left:.1}{error}}}"
                    );
                }
            }
        }
    }

    pub(crate) fn finish(&self) {
        if let Mode::Bar(bar) = &self.mode {
            bar.finish_and_clear();
        }
    }
}

/// True when `every` has passed since the last time it was; the first interval starts with the first call.
fn due(last: &Mutex<Option<Instant>>, every: Duration) -> bool {
    let Ok(mut last) = last.try_lock() else { return false };
    match *last {
        Some(at) if at.elapsed() < every => false,
        Some(_) => {
            *last = Some(Instant::now());
            true
        }
        None => {
            *last = Some(Instant::now());
            false
        }
    }
}
