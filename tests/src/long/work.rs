//! Rounds in parallel: each worker has a process and, where the machine allows it, a private `/dev/shm`.

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Sender, channel};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use super::round::ReferenceRuns;
use super::{RoundKind, Tally, campaign, inspect, round, start};
use crate::program::{all_built, participant};

/// One in this many rounds with signals is a campaign.
const CAMPAIGNS: u64 = 16;

/// The rounds to execute.
#[derive(Debug, Clone, Copy)]
pub struct Work {
    /// The kind of each round.
    pub kind: RoundKind,
    /// The seed of their random samples.
    pub seed: u64,
    /// The number of the first round.
    pub first: u64,
    /// The number of rounds.
    pub rounds: u64,
    /// The number of parallel processes.
    pub jobs: u64,
    /// Threads that keep the processors busy meanwhile: two for each processor.
    pub beside_load: bool,
}

/// The result of one round.
#[derive(Debug, Serialize, Deserialize)]
struct Line {
    number: u64,
    tally: Tally,
    failure: Option<String>,
}

/// The result of all rounds.
#[derive(Debug, Default)]
pub struct Report {
    /// Rounds executed.
    pub rounds: u64,
    /// The work done in them.
    pub tally: Tally,
    /// Failures, each with the command that repeats it.
    pub failures: Vec<String>,
}

impl Work {
    fn numbers(&self) -> std::ops::Range<u64> {
        self.first..self.first + self.rounds
    }

    /// Executes the work of a worker: every `jobs`-th round from number `share` on, with a line on standard output for each.
    pub fn run_share(&self, share: u64) {
        all_built();
        let mut references = ReferenceRuns::default();
        for number in self.numbers().skip(share as usize).step_by(self.jobs as usize) {
            let mut tally = Tally::default();
            let (seed, kind) = (self.seed, self.kind);
            let found = match kind {
                RoundKind::Killer if number % CAMPAIGNS == 7 => campaign::run(seed, number, &mut tally),
                RoundKind::Killer => round::run(seed, number, false, &mut references, &mut tally),
                RoundKind::Suspensions => round::run(seed, number, true, &mut references, &mut tally),
                RoundKind::Starts => start::run(seed, number, &mut references, &mut tally),
            };
            let failure = found.err();
            let line = Line { number, tally, failure };
            let text = serde_json::to_string(&line).expect("a line is plain data");
            // Without a reader the parent has ended.
            if writeln!(std::io::stdout(), "{text}").is_err() {
                return;
            }
        }
    }

    /// Executes all rounds. `progress` is called with the results so far from time to time.
    pub fn run(&self, mut progress: impl FnMut(&Report)) -> Report {
        // Built here, once, for all workers.
        let program = participant("long");
        let private = can_have_private_memory();
        if !private {
            eprintln!(
                "note: /dev/shm is shared with the rest of the machine: no namespace with one of its own can be made"
            );
        }
        let (sender, lines) = channel();
        let over = AtomicBool::new(false);
        let mut report = Report::default();
        std::thread::scope(|scope| {
            let cores = std::thread::available_parallelism().map_or(1, usize::from);
            for number in 0..if self.beside_load { 2 * cores } else { 0 } {
                let over = &over;
                scope.spawn(move || generate_load(number % 2 == 0, over));
            }
            let jobs = self.jobs.clamp(1, self.rounds.max(1));
            let workers: Vec<Child> = (0..jobs)
                .map(|share| self.start_worker(&program, share, jobs, private, &sender))
                .collect();
            drop(sender);
            let mut last_report = Instant::now();
            for line in lines {
                report.add(self, line);
                if last_report.elapsed() > Duration::from_secs(10) {
                    last_report = Instant::now();
                    progress(&report);
                }
            }
            for mut worker in workers {
                let status = worker.wait().expect("a worker can be waited for");
                if !status.success() {
                    report.failures.push(format!("a worker {status}"));
                }
            }
            over.store(true, Ordering::Relaxed);
        });
        if report.rounds != self.rounds {
            let missing = format!(
                "{} of {} rounds were not done",
                self.rounds - report.rounds,
                self.rounds
            );
            report.failures.push(missing);
        }
        report
    }

    fn start_worker(&self, program: &Path, share: u64, jobs: u64, private: bool, sender: &Sender<Line>) -> Child {
        let mut command = if private {
            let mut command = in_namespace(program);
            inspect::private_memory(&mut command);
            command
        } else {
            Command::new(program)
        };
        for (name, value) in [
            ("--seed", self.seed),
            ("--first", self.first),
            ("--rounds", self.rounds),
            ("--jobs", jobs),
        ] {
            command.args([name, &value.to_string()]);
        }
        command.args(["--share", &share.to_string(), self.kind.name()]);
        command.stdin(Stdio::null()).stdout(Stdio::piped());
        let mut worker = command.spawn().expect("a worker can be started");
        let lines = BufReader::new(worker.stdout.take().expect("it is piped")).lines();
        let sender = sender.clone();
        std::thread::spawn(move || {
            for line in lines.map_while(Result::ok) {
                let line = serde_json::from_str(&line).unwrap_or_else(|error| panic!("{error}: {line}"));
                if sender.send(line).is_err() {
                    return;
                }
            }
        });
        worker
    }
}

impl Report {
    fn add(&mut self, work: &Work, line: Line) {
        self.rounds += 1;
        self.tally += line.tally;
        if let Some(failure) = line.failure {
            let (kind, seed, number) = (work.kind.name(), work.seed, line.number);
            self.failures.push(format!(
                "round {number}: {failure}\n  again: cargo run --release -p escapement-tests --bin long -- --seed {seed} --first \
                 {number} --rounds 1 {kind}"
            ));
        }
    }
}

/// A command that runs `program` with a private `/dev/shm`, to which arguments are added.
fn in_namespace(program: &Path) -> Command {
    let mut command = Command::new("unshare");
    if !rustix::process::geteuid().is_root() {
        command.args(["--user", "--map-root-user"]);
    }
    let script = r#"mount -t tmpfs -o mode=1777 tmpfs /dev/shm && exec "$0" "$@""#;
    command
        .args(["--mount", "--propagation", "private", "sh", "-c", script])
        .arg(program);
    command
}

/// Whether the machine lets a process have a private `/dev/shm`.
fn can_have_private_memory() -> bool {
    let mut command = in_namespace(Path::new("true"));
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    command.status().is_ok_and(|status| status.success())
}

/// Keeps a processor busy, all the time or most of it.
fn generate_load(always: bool, over: &AtomicBool) {
    let mut turns = 0_u64;
    while !over.load(Ordering::Relaxed) {
        let started = Instant::now();
        while started.elapsed() < Duration::from_millis(2 + turns % 7) {
            std::hint::spin_loop();
        }
        turns += 1;
        if !always {
            std::thread::sleep(Duration::from_millis(1 + turns % 3));
        }
    }
}
