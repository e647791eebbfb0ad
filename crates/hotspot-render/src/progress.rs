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
    /// The share of the samples asked for that will be taken; unknown at first where the render ends by its error.
    expected: Mutex<Option<f64>>,
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
        Self { mode, quiet: talk.quiet, estimate: Mutex::new(None), expected: Mutex::new(Some(1.0)) }
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

    /// The share of the samples asked for that is expected to be enough; `None`: not known yet. All, unless told.
    pub(crate) fn expect(&self, share: Option<f64>) {
        if let Ok(mut expected) = self.expected.lock() {
            *expected = share;
        }
    }

    /// Called from worker threads.
    pub(crate) fn progress(&self, progress: Progress) {
        let expected = self.expected.lock().ok().and_then(|expected| *expected);
        let share =
            expected.map(|expected| (progress.done as f64 / (progress.total as f64 * expected)).min(1.0));
        let elapsed = progress.elapsed.as_secs_f64();
        let rate = progress.done as f64 / elapsed.max(1e-9) * 1e-6;
        let left = share.map(|share| elapsed * (1.0 - share) / share.max(1e-9));
        let share = share.unwrap_or(0.0);
        let words = left.map_or("time left not known yet".to_owned(), |left| format!("{left:.0} s left"));
        let estimate = self.estimate.lock().ok().and_then(|estimate| *estimate);
        match &self.mode {
            Mode::Silent => {}
            Mode::Bar(bar) => {
                bar.set_position((share * 1000.0) as u64);
                let error = estimate.map_or(String::new(), |(error, unbiased)| {
                    format!(", relMSE {}{error:.1e}", if unbiased { "" } else { "below " })
                });
                bar.set_message(format!("{rate:.2} Msamples/s, {words}{error}"));
            }
            Mode::Lines(last) => {
                if due(last, LINE_EVERY) {
                    crate::say::err!("{:3.0} %  {rate:.2} Msamples/s, {words}", share * 100.0);
                }
            }
            Mode::Json(last) => {
                if due(last, JSON_EVERY) || progress.done == progress.total {
                    let error = estimate.map_or(String::new(), |(error, unbiased)| {
                        format!(",\"estimated_relmse\":{error:e},\"unbiased\":{unbiased}")
                    });
                    crate::say::err!(
                        "{{\"progress\":{share:.4},\"seconds\":{elapsed:.3},\"msamples_per_second\":{rate:.4},\
                         \"seconds_left\":{}{error}}}",
                        left.map_or("null".to_owned(), |left| format!("{left:.1}"))
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
