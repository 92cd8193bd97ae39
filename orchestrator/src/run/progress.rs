//! The line that moves while a run goes on.

use std::io::{IsTerminal, Write, stderr};
use std::time::{Duration, Instant};

/// A progress line on standard error: moving in a terminal, absent elsewhere.
pub struct Progress {
    shown: bool,
    started: Instant,
    last: Option<Instant>,
    duration_s: f64,
    width: usize,
}

impl Progress {
    /// A line for a run of `duration_s` simulated seconds.
    pub fn new(duration_s: f64, quiet: bool) -> Progress {
        let shown = !quiet && stderr().is_terminal();
        Progress {
            shown,
            started: Instant::now(),
            last: None,
            duration_s,
            width: 0,
        }
    }

    /// Shows simulated time `t_s` and the real-time factor, at most ten times a second.
    pub fn show(&mut self, t_s: f64) {
        let (started, duration_s) = (self.started, self.duration_s);
        self.tell(|| {
            let wall = started.elapsed().as_secs_f64();
            let factor = if wall > 0.0 { t_s.max(0.0) / wall } else { 0.0 };
            format!("t = {t_s:8.3} s of {duration_s} s   {factor:6.1} x real time")
        });
    }

    /// Shows what `text` says, at most ten times a second.
    pub fn tell(&mut self, text: impl FnOnce() -> String) {
        let now = Instant::now();
        if !self.shown || self.last.is_some_and(|last| now - last < Duration::from_millis(100)) {
            return;
        }
        self.last = Some(now);
        self.print(&text());
    }

    /// Says something that the user should see, in place of the line.
    pub fn say(&mut self, text: &str) {
        self.clear();
        eprintln!("{text}");
    }

    /// Removes the line.
    pub fn clear(&mut self) {
        if self.width > 0 {
            self.print("");
            eprint!("\r");
            self.width = 0;
        }
    }

    fn print(&mut self, text: &str) {
        let width = self.width.max(text.len());
        eprint!("\r{text:width$}");
        let _ = stderr().flush();
        self.width = text.len();
    }
}
