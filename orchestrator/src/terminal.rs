//! The terminal: a line that moves while a run or a campaign goes on, notices, and Enter at a pause.

use std::io::{IsTerminal, Write, stderr, stdin};
use std::sync::mpsc::{self, Receiver, TryRecvError};
use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use engine::{Answer, Event, Observer, Progress};

/// The line is written at most this often.
const BETWEEN: Duration = Duration::from_millis(100);

/// Reports on standard error: a moving line in a terminal, notices everywhere.
struct Terminal {
    shown: bool,
    started: Instant,
    last: Option<Instant>,
    duration_s: f64,
    width: usize,
    /// Whether a pause has asked for a line.
    asks: bool,
}

/// A terminal's observer. With `quiet`, notices alone.
pub fn progress(quiet: bool) -> Progress {
    Progress::new(Terminal {
        shown: !quiet && stderr().is_terminal(),
        started: Instant::now(),
        last: None,
        duration_s: 0.0,
        width: 0,
        asks: false,
    })
}

impl Terminal {
    /// Shows what `text` says, at most ten times a second.
    fn show(&mut self, text: impl FnOnce(&Self) -> String) {
        let now = Instant::now();
        if !self.shown || self.last.is_some_and(|last| now - last < BETWEEN) {
            return;
        }
        self.last = Some(now);
        let text = text(self);
        self.print(&text);
    }

    fn notice(&mut self, text: &str) {
        self.clear();
        eprintln!("{text}");
    }

    fn clear(&mut self) {
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

    fn run_line(&self, t_s: f64) -> String {
        let wall = self.started.elapsed().as_secs_f64();
        let factor = if wall > 0.0 { t_s.max(0.0) / wall } else { 0.0 };
        format!("t = {t_s:8.3} s of {} s   {factor:6.1} x real time", self.duration_s)
    }

    /// `[#####     ] 42 of 84   3.1 a second   14 s left`
    fn campaign_line(&self, done: usize, all: usize, resumed: usize) -> String {
        let rate = done.saturating_sub(resumed) as f64 / self.started.elapsed().as_secs_f64().max(1e-3);
        let filled = 30 * done / all.max(1);
        let mut text = format!("[{:<30}] {done} of {all}", "#".repeat(filled));
        if rate > 0.0 {
            let left = (all - done) as f64 / rate;
            text += &format!("   {rate:.1} a second   {left:.0} s left");
        }
        text
    }
}

impl Observer for Terminal {
    fn event(&mut self, event: Event<'_>) {
        match event {
            Event::Begun { duration_s } => {
                self.duration_s = duration_s;
                self.started = Instant::now();
            }
            Event::Time { t_s } => self.show(|line| line.run_line(t_s)),
            Event::Points { done, all, resumed } => self.show(|line| line.campaign_line(done, all, resumed)),
            Event::Notice { text } => self.notice(text),
            Event::Paused { t_s, processes } => {
                self.notice(&format!(
                    "paused at t = {t_s} s ({processes}): Enter goes on, q and Enter ends the run"
                ));
                self.asks = true;
            }
            Event::Over => self.clear(),
            _ => {}
        }
    }

    fn answer(&mut self) -> Option<Answer> {
        if !self.asks {
            return None;
        }
        match typed().lock().unwrap_or_else(PoisonError::into_inner).try_recv() {
            Ok(line) if line.trim() == "q" => Some(Answer::End),
            Ok(_) => Some(Answer::Continue),
            // At the end of the input nothing more will be typed.
            Err(TryRecvError::Disconnected) => Some(Answer::Never),
            Err(TryRecvError::Empty) => None,
        }
    }
}

/// The lines of standard input. One thread reads them for all pauses: a pause that a failure ends leaves no reader behind that would
/// take the line of the next one.
fn typed() -> &'static Mutex<Receiver<String>> {
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
