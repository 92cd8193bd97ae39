//! Terminal: the progress line of a run or a campaign, notices, and Enter at a pause.

use std::io::stdin;
use std::sync::mpsc::{self, Receiver, TryRecvError};
use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::Instant;

use engine::{Event, Observer, PauseDecision, Progress};

use crate::line::{Line, percent, remaining_time};

/// Reports on standard error: a progress line, and notices.
struct Terminal {
    line: Line,
    started: Instant,
    /// Simulated time from which the progress is measured, s; after a pause, the time at which the run continues.
    from_s: Option<f64>,
    duration_s: f64,
    /// The number of completed points of a campaign, since the first observation.
    completed: Option<CompletedPoints>,
    /// Whether a pause is waiting for a line of input.
    awaits_input: bool,
    /// Notice that is printed when the run begins.
    start_notice: Option<String>,
}

/// Completed points of a campaign, since the first observation.
#[derive(Debug, Clone, Copy)]
struct CompletedPoints {
    since: Instant,
    first: usize,
    last: usize,
}

impl CompletedPoints {
    /// Updates the count to `done` at `now`. A count below the previous one belongs to other work, such as runs that are
    /// kept: counting starts again.
    fn with(before: Option<CompletedPoints>, done: usize, now: Instant) -> CompletedPoints {
        let restarted = CompletedPoints {
            since: now,
            first: done,
            last: done,
        };
        let before = before.filter(|before| before.last <= done).unwrap_or(restarted);
        CompletedPoints { last: done, ..before }
    }

    /// The number completed since then, and the number of seconds up to `now`.
    fn since_start(&self, now: Instant) -> (usize, f64) {
        let wall = now.saturating_duration_since(self.since);
        (self.last - self.first, wall.as_secs_f64())
    }
}

/// Progress output to the terminal. With `quiet`, only notices are shown.
pub fn progress(quiet: bool) -> Progress {
    progress_with(quiet, None)
}

/// The same, with the notice `start_notice` as soon as the run has been accepted and begins.
pub fn progress_with(quiet: bool, start_notice: Option<String>) -> Progress {
    Progress::new(Terminal {
        line: Line::new(quiet),
        started: Instant::now(),
        from_s: None,
        duration_s: 0.0,
        completed: None,
        awaits_input: false,
        start_notice,
    })
}

/// `t = 12.300 s of 35 s (35 %), 3.1 times real time, 8 s left`
fn run_line(t_s: f64, from_s: f64, duration_s: f64, wall_s: f64) -> String {
    let factor = (t_s - from_s).max(0.0) / wall_s.max(1e-3);
    let rest = if factor > 0.0 {
        remaining_time((duration_s - t_s) / factor)
    } else {
        String::new()
    };
    format!(
        "t = {t_s:.3} s of {duration_s} s ({:.0} %), {} times real time{rest}",
        percent(t_s, duration_s),
        if factor < 100.0 {
            format!("{factor:.1}")
        } else {
            format!("{factor:.0}")
        }
    )
}

/// `42 of 84 points (50 %), 3.1 a second, 14 s left`, of which `own` were completed in `wall_s`. The end of a campaign that
/// grows with its results is not known: `42 of 84 points so far, 3.1 a second`.
fn campaign_line(done: usize, all: usize, grows: bool, (own, wall_s): (usize, f64)) -> String {
    let mut text = format!("{done} of {all} points");
    text += &match grows {
        true => " so far".to_owned(),
        false => format!(" ({:.0} %)", percent(done as f64, all as f64)),
    };
    if own > 0 {
        let each = wall_s / own as f64;
        text += &match each {
            1.0.. => format!(", {each:.1} s each"),
            _ => format!(", {:.1} a second", 1.0 / each.max(1e-6)),
        };
        if !grows {
            text += &remaining_time(all.saturating_sub(done) as f64 * each);
        }
    }
    text
}

impl Observer for Terminal {
    fn event(&mut self, event: Event<'_>) {
        match event {
            Event::Begun { duration_s } => {
                self.duration_s = duration_s;
                self.from_s = None;
                if let Some(words) = self.start_notice.take() {
                    self.line.notice(&words);
                }
            }
            Event::Time { t_s } => {
                crate::signals::record_run_event();
                let Some(from_s) = self.from_s else {
                    self.started = Instant::now();
                    self.from_s = Some(t_s);
                    return;
                };
                let wall_s = self.started.elapsed().as_secs_f64();
                self.line.show(|| run_line(t_s, from_s, self.duration_s, wall_s));
            }
            Event::Points { done, all, grows, .. } => {
                let now = Instant::now();
                let completed = CompletedPoints::with(self.completed, done, now);
                self.completed = Some(completed);
                self.line
                    .show(|| campaign_line(done, all, grows, completed.since_start(now)));
            }
            Event::Notice { text } => self.line.notice(text),
            Event::Paused { t_s, processes } => {
                self.line.notice(&format!(
                    "paused at t = {t_s} s ({processes}): Enter continues, q and Enter ends the run"
                ));
                self.awaits_input = true;
                self.from_s = None;
            }
            Event::Over => {
                crate::signals::record_run_event();
                self.line.clear();
            }
            _ => {}
        }
    }

    fn pause_decision(&mut self) -> Option<PauseDecision> {
        if !self.awaits_input {
            return None;
        }
        match stdin_lines().lock().unwrap_or_else(PoisonError::into_inner).try_recv() {
            Ok(line) if line.trim() == "q" => Some(PauseDecision::End),
            Ok(_) => Some(PauseDecision::Continue),
            // After the end of the input no further line can come.
            Err(TryRecvError::Disconnected) => Some(PauseDecision::Unavailable),
            Err(TryRecvError::Empty) => None,
        }
    }
}

/// The lines of standard input. One thread reads them for all pauses: a pause that a failure ends leaves no reader behind
/// that would consume the line of the next pause.
fn stdin_lines() -> &'static Mutex<Receiver<String>> {
    static LINES: OnceLock<Mutex<Receiver<String>>> = OnceLock::new();
    LINES.get_or_init(|| {
        let (sender, receiver) = mpsc::channel();
        // The thread ends with the input, or with the program.
        std::thread::spawn(move || {
            for line in stdin().lines().map_while(Result::ok) {
                if sender.send(line).is_err() {
                    return;
                }
            }
        });
        Mutex::new(receiver)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn run_progress_shows_time_and_remaining_time() {
        assert_eq!(
            run_line(12.25, 0.0, 35.0, 4.0),
            "t = 12.250 s of 35 s (35 %), 3.1 times real time, 7 s left"
        );
        // Continued from 10 s: the simulated time before that took no wall-clock time in this run.
        assert_eq!(
            run_line(12.0, 10.0, 1000.0, 1.0),
            "t = 12.000 s of 1000 s (1 %), 2.0 times real time, 8 min left"
        );
        assert_eq!(
            run_line(0.0, 0.0, 5.0, 30.0),
            "t = 0.000 s of 5 s (0 %), 0.0 times real time"
        );
    }

    #[test]
    fn campaign_progress_estimates_from_own_points() {
        assert_eq!(
            campaign_line(42, 84, false, (42, 14.0)),
            "42 of 84 points (50 %), 3.0 a second, 14 s left"
        );
        assert_eq!(
            campaign_line(12, 20, false, (2, 30.0)),
            "12 of 20 points (60 %), 15.0 s each, 2 min left"
        );
        assert_eq!(campaign_line(10, 20, false, (0, 60.0)), "10 of 20 points (50 %)");
        assert_eq!(
            campaign_line(401, 410, true, (401, 14.0)),
            "401 of 410 points so far, 28.6 a second"
        );
    }

    #[test]
    fn campaign_progress_counts_levels_and_restarts_for_other_work() {
        let start = Instant::now();
        let at = |s: u64| start + std::time::Duration::from_secs(s);
        // Three points existed; the work continues level by level.
        let mut completed = None;
        for (s, done) in [(5, 3), (6, 13), (7, 23), (8, 23), (15, 43)] {
            completed = Some(CompletedPoints::with(completed, done, at(s)));
        }
        assert_eq!(completed.unwrap().since_start(at(15)), (40, 10.0));
        for (s, done) in [(20, 0), (22, 1)] {
            completed = Some(CompletedPoints::with(completed, done, at(s)));
        }
        assert_eq!(completed.unwrap().since_start(at(22)), (1, 2.0));
    }
}
