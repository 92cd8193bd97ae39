//! Detection latency of the death of a participant.

use std::path::Path;
use std::time::{Duration, Instant};

use lockstep::random::Stream;
use rustix::process::{Pid, Signal, kill_process};

use super::Measurements;
use engine::run::{Ending, Outcome};

/// Milliseconds from `kill -9` of a participant to its detection by the orchestrator, `count` times. Each time `run` starts
/// a run of some participants in `out` that is far from its end, and one of them is killed at a random time.
///
/// # Errors
/// An error of `run`, or a run that ends in another way.
pub fn death_detection_latency(
    count: usize,
    out: &Path,
    mut run: impl FnMut() -> anyhow::Result<Outcome>,
) -> anyhow::Result<Measurements> {
    let draws = Stream::new(1, "deaths");
    let mut figures = Measurements::default();
    for number in 0..count as u64 {
        let draw = |which: u64| draws.uniform(4 * number + which);
        // Up to 20 ms: several polling periods of the orchestrator, whatever it waits for between them.
        let pause = Duration::from_secs_f64(0.02 * draw(0));
        let killer = {
            let (out, victim) = (out.to_owned(), draw(1));
            std::thread::spawn(move || kill_one(&out, pause, victim))
        };
        // In this thread, because the kernel kills participants when the thread that started them ends.
        let outcome = run()?;
        let killed = killer.join().unwrap_or(None);
        match (killed, &outcome.ending) {
            (Some(killed), Ending::Failed { .. }) => {
                figures.add(1e3 * outcome.ended_at.saturating_duration_since(killed).as_secs_f64());
            }
            (_, ending) => anyhow::bail!("no participant was killed: {ending:?}"),
        }
        std::fs::remove_dir_all(out)?;
    }
    Ok(figures)
}

/// Kills one of this process's children when the run in `out` has been in progress for `pause`; returns the time of the
/// kill.
fn kill_one(out: &Path, pause: Duration, victim: f64) -> Option<Instant> {
    let samples = || std::fs::read_dir(out.join("tape")).into_iter().flatten().flatten();
    let under_way = || {
        samples().any(|file| {
            file.metadata()
                .is_ok_and(|about| about.len() > 0 && is_stream(&file.path()))
        })
    };
    let started = Instant::now();
    while !under_way() {
        if started.elapsed() > Duration::from_secs(60) {
            return None;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    std::thread::sleep(pause);
    let children = children();
    let child = children.get((victim * children.len() as f64) as usize)?;
    let killed = Instant::now();
    kill_process(*child, Signal::KILL).ok()?;
    Some(killed)
}

fn is_stream(file: &Path) -> bool {
    file.extension().is_some_and(|ending| ending == "bin")
}

fn children() -> Vec<Pid> {
    let threads = std::fs::read_dir("/proc/self/task").into_iter().flatten().flatten();
    let lists = threads.filter_map(|thread| std::fs::read_to_string(thread.path().join("children")).ok());
    let numbers: Vec<i32> = lists
        .flat_map(|list| {
            list.split_whitespace()
                .filter_map(|pid| pid.parse().ok())
                .collect::<Vec<_>>()
        })
        .collect();
    numbers.into_iter().filter_map(Pid::from_raw).collect()
}
