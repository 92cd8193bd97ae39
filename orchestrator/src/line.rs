//! Progress line on standard error: in a terminal it is redrawn; elsewhere one is written every ten seconds, so that a log
//! shows the progress.

use std::io::{IsTerminal, Write, stderr};
use std::path::Path;
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Minimum interval between two redraws.
const REDRAW_INTERVAL: Duration = Duration::from_millis(100);
/// Interval of the lines where nothing can be redrawn. Work that ends sooner prints none.
const LOG_INTERVAL: Duration = Duration::from_secs(10);

/// The display mode.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum DisplayMode {
    Redrawn,
    Logged,
    Off,
}

/// A progress line.
#[derive(Debug)]
pub struct Line {
    mode: DisplayMode,
    last: Option<Instant>,
    /// The number of columns on the screen.
    drawn: usize,
}

impl Line {
    /// A line that has not been drawn yet; with `quiet` it is never drawn.
    pub fn new(quiet: bool) -> Line {
        let mode = match (quiet, stderr().is_terminal()) {
            (true, _) => DisplayMode::Off,
            (false, true) => DisplayMode::Redrawn,
            (false, false) => DisplayMode::Logged,
        };
        Line::with_mode(mode, Instant::now())
    }

    fn with_mode(mode: DisplayMode, now: Instant) -> Line {
        let last = (mode == DisplayMode::Logged).then_some(now);
        Line { mode, last, drawn: 0 }
    }

    /// Whether an update is due at `now`; if so, it counts as made.
    fn is_due(&mut self, now: Instant) -> bool {
        let every = match self.mode {
            DisplayMode::Redrawn => REDRAW_INTERVAL,
            DisplayMode::Logged => LOG_INTERVAL,
            DisplayMode::Off => return false,
        };
        let due = self
            .last
            .is_none_or(|last| now.saturating_duration_since(last) >= every);
        if due {
            self.last = Some(now);
        }
        due
    }

    /// Shows `text`, if an update is due.
    pub fn show(&mut self, text: impl FnOnce() -> String) {
        if !self.is_due(Instant::now()) {
            return;
        }
        match self.mode {
            DisplayMode::Redrawn => self.draw(&text()),
            DisplayMode::Logged => eprintln!("{}", text()),
            DisplayMode::Off => {}
        }
    }

    /// Prints `text` in lines of its own.
    pub fn notice(&mut self, text: &str) {
        self.clear();
        eprintln!("{text}");
    }

    /// Erases the line.
    pub fn clear(&mut self) {
        if self.drawn > 0 {
            self.draw("");
            eprint!("\r");
            self.drawn = 0;
        }
    }

    fn draw(&mut self, text: &str) {
        let drawn = self.redraw_text(text, columns());
        eprint!("\r{drawn}");
        let _ = stderr().flush();
    }

    /// The characters that replace the line on the screen by `text`, in a terminal with `columns`. Text that does not fit
    /// into a row is cut off: the terminal would wrap it into the next row, from which a carriage return does not come
    /// back. The last column stays empty, because some terminals wrap as soon as it is filled.
    fn redraw_text(&mut self, text: &str, columns: Option<usize>) -> String {
        let room = columns.map_or(usize::MAX, |columns| columns.saturating_sub(1));
        let (mut drawing, mut count) = (String::with_capacity(text.len()), 0);
        for one in text.chars() {
            let shown = printable(one);
            let width: usize = shown.chars().map(width).sum();
            if count + width > room {
                break;
            }
            drawing.push_str(&shown);
            count += width;
        }
        // The terminal may have become narrower since the last redraw.
        let over = self.drawn.min(room).saturating_sub(count);
        drawing.extend(std::iter::repeat_n(' ', over));
        self.drawn = count;
        drawing
    }
}

/// The number of columns of the terminal at standard error, which changes with its window. `None` where it is not a
/// terminal or unknown.
fn columns() -> Option<usize> {
    let size = rustix::termios::tcgetwinsize(stderr()).ok()?;
    Some(usize::from(size.ws_col)).filter(|columns| *columns > 0)
}

/// The displayed form of a character: control characters, which file names may contain, as their numbers.
fn printable(one: char) -> String {
    match one.is_control() {
        true => one.escape_unicode().to_string(),
        false => one.to_string(),
    }
}

/// Zero-width characters: combining marks, joiners, variants.
const ZERO_WIDTH: [(u32, u32); 7] = [
    (0x300, 0x36f),
    (0x483, 0x489),
    (0x591, 0x5bd),
    (0x64b, 0x65f),
    (0x200b, 0x200f),
    (0x20d0, 0x20f0),
    (0xfe00, 0xfe0f),
];
/// Double-width characters: East Asian scripts, and emoji.
const DOUBLE_WIDTH: [(u32, u32); 11] = [
    (0x1100, 0x115f),
    (0x2e80, 0x303e),
    (0x3041, 0x4dbf),
    (0x4e00, 0xa4cf),
    (0xa960, 0xa97c),
    (0xac00, 0xd7a3),
    (0xf900, 0xfaff),
    (0xfe30, 0xfe6f),
    (0xff00, 0xff60),
    (0xffe0, 0xffe6),
    (0x1f300, 0x3fffd),
];

/// The number of columns of a character.
fn width(one: char) -> usize {
    let among = |ranges: &[(u32, u32)]| ranges.iter().any(|&(from, to)| (from..=to).contains(&u32::from(one)));
    match (among(&ZERO_WIDTH), among(&DOUBLE_WIDTH)) {
        (true, _) => 0,
        (false, true) => 2,
        (false, false) => 1,
    }
}

/// The remaining time of `seconds`, rounded as suits an estimate.
pub fn remaining_time(seconds: f64) -> String {
    if !seconds.is_finite() {
        return String::new();
    }
    let seconds = seconds.max(0.0).round() as u64;
    match seconds {
        0..120 => format!(", {seconds} s left"),
        120..7200 => format!(", {} min left", (seconds + 30) / 60),
        _ => format!(", {} h left", (seconds + 1800) / 3600),
    }
}

/// `done` of `all` in percent, rounded down: 100 is shown at the end only.
pub fn percent(done: f64, all: f64) -> f64 {
    if all > 0.0 {
        (100.0 * done / all).clamp(0.0, 100.0).floor()
    } else {
        100.0
    }
}

/// Work that reports no progress itself. As long as this value lives, the line shows its name and elapsed time.
pub struct Busy {
    finished: Arc<(Mutex<bool>, Condvar)>,
    thread: Option<JoinHandle<()>>,
}

impl Busy {
    /// Work called `what`; `bytes` is the number of bytes it reads from files, where known.
    pub fn with(what: String, bytes: Option<u64>) -> Busy {
        let finished = Arc::new((Mutex::new(false), Condvar::new()));
        let shared = finished.clone();
        let (started, read_before) = (Instant::now(), read_so_far());
        let say = move || {
            let wall = started.elapsed().as_secs_f64();
            let read = read_so_far()
                .zip(read_before)
                .map(|(now, read_before)| now.saturating_sub(read_before) as f64);
            match (bytes.map(|bytes| bytes as f64), read) {
                (Some(all), Some(read)) if read > 0.0 => {
                    let rest = remaining_time((all - read).max(0.0) * wall / read);
                    let (read_mb, all_mb) = (read.min(all) / 1e6, all / 1e6);
                    format!(
                        "{what}: {read_mb:.0} of {all_mb:.0} MB read ({:.0} %){rest}",
                        percent(read, all)
                    )
                }
                _ => format!("{what}: {wall:.0} s so far"),
            }
        };
        let thread = std::thread::spawn(move || {
            let mut line = Line::new(false);
            let mut finished = shared.0.lock().unwrap_or_else(PoisonError::into_inner);
            // Short work shows no line.
            let mut wait = Duration::from_secs(1);
            while !*finished {
                finished = (shared.1.wait_timeout(finished, wait))
                    .map_or_else(|poisoned| poisoned.into_inner().0, |woken| woken.0);
                if !*finished {
                    line.show(&say);
                }
                wait = REDRAW_INTERVAL;
            }
            line.clear();
        });
        Busy {
            finished,
            thread: Some(thread),
        }
    }

    /// Reading the tape in `run`, a run folder or its tape.
    pub fn reading(what: &str, run: &Path) -> Busy {
        Busy::with(
            format!("{what} {}", run.display()),
            Some(size(run) + size(&run.join("tape"))),
        )
    }
}

impl Drop for Busy {
    fn drop(&mut self) {
        *self.finished.0.lock().unwrap_or_else(PoisonError::into_inner) = true;
        self.finished.1.notify_all();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// Total size of the streams in `folder`, bytes.
fn size(folder: &Path) -> u64 {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let streams = entries.filter(|entry| entry.path().extension().is_some_and(|ending| ending == "bin"));
    streams.filter_map(|entry| Some(entry.metadata().ok()?.len())).sum()
}

/// Number of bytes that this process has read from files.
fn read_so_far() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/self/io").ok()?;
    text.lines().find_map(|line| line.strip_prefix("rchar: "))?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn progress_without_terminal_is_due_every_ten_seconds() {
        let start = Instant::now();
        let mut line = Line::with_mode(DisplayMode::Logged, start);
        let due: Vec<u64> = (0..42_000)
            .step_by(7)
            .filter(|ms| line.is_due(start + Duration::from_millis(*ms)))
            .collect();
        assert_eq!(due, [10_003, 20_006, 30_009, 40_012]);
    }

    #[test]
    fn progress_in_terminal_is_due_at_once_and_never_if_quiet() {
        let start = Instant::now();
        let count = |mode: DisplayMode| {
            let mut line = Line::with_mode(mode, start);
            (0..1000)
                .filter(|ms| line.is_due(start + Duration::from_millis(*ms)))
                .count()
        };
        assert_eq!((count(DisplayMode::Redrawn), count(DisplayMode::Off)), (10, 0));
    }

    #[test]
    fn progress_line_is_cut_to_terminal_width() {
        let mut line = Line::with_mode(DisplayMode::Redrawn, Instant::now());
        let all = "t = 12.250 s of 35 s (35 %)";
        assert_eq!(line.redraw_text(all, None), all);
        assert_eq!(line.redraw_text("t = 1", Some(80)), format!("t = 1{:22}", ""));
        assert_eq!(line.redraw_text(all, Some(20)), &all[..19]);
        // The window has become narrower: the new text fits into it.
        assert_eq!(line.redraw_text("t", Some(10)), format!("t{:8}", ""));
        assert_eq!(line.redraw_text("t", Some(1)), "");
        // Double-width characters, an incomplete one, and zero-width marks.
        assert_eq!(line.redraw_text("試験/run", Some(6)), "試験/");
        assert_eq!(line.redraw_text("試験", Some(4)), "試 ");
        assert_eq!(line.redraw_text("e\u{301}e\u{301}e", Some(3)), "e\u{301}e\u{301}");
        // A file name may contain any character.
        assert_eq!(line.redraw_text("a\nb", Some(80)), "a\\u{a}b");
    }

    #[test]
    fn remaining_time_is_rounded() {
        let texts: Vec<String> = [0.2, 119.4, 150.0, 8000.0, f64::INFINITY].map(remaining_time).into();
        assert_eq!(texts, [", 0 s left", ", 119 s left", ", 3 min left", ", 2 h left", ""]);
        assert_eq!(
            (percent(199.0, 200.0), percent(200.0, 200.0), percent(0.0, 0.0)),
            (99.0, 100.0, 100.0)
        );
    }
}
