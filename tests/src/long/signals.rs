//! Signals to the processes of one run, each at an instant determined by its tape or by the clock.

use std::fs::{self, File};
use std::os::fd::OwnedFd;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use rustix::process::{Pid, PidfdFlags, Signal, WaitOptions, pidfd_open, pidfd_send_signal, waitpid};

use super::{CheckResult, Rng};
use crate::program::{orchestrator, root};

/// The time limit of a run, resumed run or campaign, including the time in which its processes are stopped.
const LIMIT: Duration = Duration::from_secs(240);
/// The environment variable that identifies the processes of a run, whatever their names.
const TOKEN: &str = "ESCAPEMENT_LONG";

/// The target of a signal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Target {
    /// The participant in this slot, or a worker of a campaign.
    One(usize),
    Orchestrator,
    /// All processes; the orchestrator first or last.
    All {
        orchestrator_first: bool,
    },
}

/// The signal to the target.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Action {
    Signal(Signal),
    /// Stopped, and continued after this long.
    Pause {
        ms: u64,
    },
    /// Stopped and not continued.
    Stop,
}

/// The moment of the signal. If its condition never becomes true, the moment is the end of the run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Moment {
    /// This long after the previous strike, or after the start.
    After { us: u64 },
    /// This long after this part of the tape has been written.
    Tape { per_mille: u64, us: u64 },
}

/// A signal, or a stop with its continuation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct ScheduledSignal {
    pub(super) moment: Moment,
    pub(super) target: Target,
    pub(super) action: Action,
}

/// The outcome of a strike.
#[derive(Debug, Clone, Copy)]
pub(super) struct DeliveredSignal {
    pub(super) target: Target,
    pub(super) action: Action,
    /// The slots or workers that were reached.
    pub(super) slot: Option<usize>,
    /// Whether the orchestrator had opened the run folder, which it does after it has begun to handle signals.
    pub(super) opened: bool,
    /// Whether samples of the run were on the disk, so that every participant had been connected.
    pub(super) began: bool,
}

/// A stream of the tape that shows the progress of a run.
#[derive(Debug, Clone)]
pub(super) struct TapeProgress {
    pub(super) stream: PathBuf,
    /// Its full size.
    pub(super) whole: u64,
    /// Its size before the run begins: zero, or the size in the run that is continued.
    pub(super) before: u64,
}

/// The names of an orchestrator's processes.
pub(super) enum ProcessNames {
    /// The names of the participants.
    Participants(Vec<String>),
    /// The workers of a campaign.
    Workers,
}

/// A process, held open so that its process id cannot be reused.
struct Process {
    handle: OwnedFd,
    slot: Option<usize>,
}

impl Process {
    fn send(&self, signal: Signal) -> bool {
        pidfd_send_signal(&self.handle, signal).is_ok()
    }
}

/// A running orchestrator, with all the processes that it has started.
pub(super) struct Running {
    child: Child,
    token: String,
    output_files: [PathBuf; 2],
    started: Instant,
    /// Signals that reached a process.
    pub(super) signals: u64,
}

/// How an orchestrator ended.
#[derive(Debug)]
pub(super) struct RunOutcome {
    /// The exit code; `None` when a signal ended it.
    pub(super) code: Option<i32>,
    pub(super) signal: Option<i32>,
    pub(super) err: String,
}

impl Running {
    /// Starts the orchestrator with `arguments`; `folder` is for its output and its temporary files.
    pub(super) fn start(arguments: &[String], folder: &Path, token: &str) -> Running {
        let output_files = ["stdout", "stderr"].map(|name| folder.join(name));
        let [out, err] = [0, 1].map(|at| File::create(&output_files[at]).expect("the folder can be written"));
        let scratch = folder.join("scratch");
        fs::create_dir_all(&scratch).expect("the folder can be written");
        let child = Command::new(orchestrator())
            .args(arguments)
            .current_dir(root())
            .env(TOKEN, token)
            .env("TMPDIR", scratch)
            .stdin(Stdio::null())
            .stdout(out)
            .stderr(err)
            .spawn();
        Running {
            child: child.expect("the orchestrator can be started"),
            token: token.to_owned(),
            output_files,
            started: Instant::now(),
            signals: 0,
        }
    }

    /// Its standard error so far.
    pub(super) fn err(&self) -> String {
        fs::read_to_string(&self.output_files[1]).unwrap_or_default()
    }

    /// Whether it has ended; it can still be waited for.
    pub(super) fn over(&mut self) -> bool {
        self.child.try_wait().expect("a child can be waited for").is_some()
    }

    /// Waits for the end.
    pub(super) fn finish(mut self) -> CheckResult<RunOutcome> {
        while !self.over() {
            if self.started.elapsed() > LIMIT {
                let seen = self.err();
                let _ = self.child.kill();
                let _ = self.child.wait();
                return Err(format!("it hangs; standard error so far: {seen}"));
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        let status = self.child.wait().expect("a child can be waited for");
        Ok(RunOutcome {
            code: status.code(),
            signal: std::os::unix::process::ExitStatusExt::signal(&status),
            err: self.err(),
        })
    }

    /// Its participants, or the workers of a campaign, with their process ids.
    fn processes(&self, parts: &ProcessNames) -> Vec<Process> {
        let found = processes_with_token(&self.token)
            .into_iter()
            .filter_map(|(pid, variables)| {
                let handle = pidfd_open(Pid::from_raw(pid)?, PidfdFlags::empty()).ok()?;
                let slot = match parts {
                    ProcessNames::Participants(names) => {
                        let name = variables
                            .split(|byte| *byte == 0)
                            .find_map(|one| one.strip_prefix(format!("{}=", lockstep::host::PARTICIPANT).as_bytes()))?;
                        Some(names.iter().position(|own| own.as_bytes() == name)?)
                    }
                    ProcessNames::Workers => is_worker(pid, self.child.id()).then_some(0),
                }?;
                // It is held open now: if it is still the same, its process id cannot have been reused.
                (environment(pid)? == variables).then_some((
                    pid,
                    Process {
                        handle,
                        slot: Some(slot),
                    },
                ))
            });
        let mut found: Vec<_> = found.collect();
        if matches!(parts, ProcessNames::Workers) {
            found.sort_by_key(|(pid, _)| *pid);
            for (number, (_, worker)) in found.iter_mut().enumerate() {
                worker.slot = Some(number);
            }
        }
        found.into_iter().map(|(_, process)| process).collect()
    }

    /// Waits for the moment of `strike` and delivers it; returns what it reached.
    pub(super) fn deliver(
        &mut self,
        scheduled: &ScheduledSignal,
        parts: &ProcessNames,
        out: &Path,
        progress: &TapeProgress,
    ) -> Vec<DeliveredSignal> {
        let us = match scheduled.moment {
            Moment::After { us } => us,
            Moment::Tape { per_mille, us } => {
                let size = progress.whole * per_mille / 1000;
                while !self.over()
                    && length(&progress.stream) < size.max(progress.before + 1).min(progress.whole)
                    && self.started.elapsed() < LIMIT
                {
                    std::thread::sleep(Duration::from_millis(1));
                }
                us
            }
        };
        std::thread::sleep(Duration::from_micros(us));
        let (opened, began) = (
            out.join("run.json").exists(),
            length(&progress.stream) > progress.before,
        );
        let targets = self.targets(scheduled.target, parts);
        let (first, last) = match scheduled.action {
            Action::Signal(signal) => (signal, None),
            Action::Pause { ms } => (Signal::STOP, Some(ms)),
            Action::Stop => (Signal::STOP, None),
        };
        let mut delivered = Vec::new();
        for process in &targets {
            if process.send(first) {
                self.signals += 1;
                delivered.push(DeliveredSignal {
                    target: scheduled.target,
                    action: scheduled.action,
                    slot: process.slot,
                    opened,
                    began,
                });
            }
        }
        if let Some(ms) = last {
            std::thread::sleep(Duration::from_millis(ms));
            // Processes started or missed meanwhile were not stopped; a further signal does no harm.
            let continued = targets.iter().filter(|process| process.send(Signal::CONT));
            self.signals += continued.count() as u64;
        }
        delivered
    }

    fn targets(&mut self, target: Target, parts: &ProcessNames) -> Vec<Process> {
        let own = (!self.over())
            .then(|| pidfd_open(Pid::from_child(&self.child), PidfdFlags::empty()).ok())
            .flatten()
            .map(|handle| Process { handle, slot: None });
        match target {
            Target::Orchestrator => own.into_iter().collect(),
            Target::One(slot) => {
                let mut found = self.processes(parts);
                found.retain(|process| process.slot == Some(slot));
                found
            }
            Target::All { orchestrator_first } => {
                let others = self.processes(parts);
                if orchestrator_first {
                    own.into_iter().chain(others).collect()
                } else {
                    others.into_iter().chain(own).collect()
                }
            }
        }
    }
}

fn length(path: &Path) -> u64 {
    fs::metadata(path).map_or(0, |about| about.len())
}

fn environment(pid: i32) -> Option<Vec<u8>> {
    fs::read(format!("/proc/{pid}/environ")).ok()
}

/// Whether `pid` is a worker of a campaign, and not a child of one between fork and exec.
fn is_worker(pid: i32, campaign: u32) -> bool {
    let line = fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
    let stat = fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
    let parent = stat.rsplit_once(") ").and_then(|(_, rest)| rest.split(' ').nth(1));
    line.windows(15).any(|part| part == b"campaign-worker")
        && parent.and_then(|text| text.parse().ok()) == Some(campaign)
}

/// The living processes of the run with `token`, with their environment. A zombie has none.
fn processes_with_token(token: &str) -> Vec<(i32, Vec<u8>)> {
    let mark = format!("{TOKEN}={token}\0");
    let entries = fs::read_dir("/proc").into_iter().flatten().flatten();
    let numbers = entries.filter_map(|entry| entry.file_name().to_str()?.parse::<i32>().ok());
    let found = numbers.filter_map(|pid| Some((pid, environment(pid)?)));
    found
        .filter(|(_, variables)| variables.windows(mark.len()).any(|part| part == mark.as_bytes()))
        .collect()
}

/// Fails when a process of the run with `token` is left. Processes that the kernel ends with the orchestrator get `time`.
pub(super) fn ensure_no_process_left(token: &str, time: Duration) -> CheckResult<()> {
    let started = Instant::now();
    loop {
        let left = processes_with_token(token);
        if left.is_empty() {
            return Ok(());
        }
        if started.elapsed() > time {
            let lines = left.iter().map(|(pid, _)| {
                let line = fs::read_to_string(format!("/proc/{pid}/cmdline")).unwrap_or_default();
                format!("{pid}: {}", line.replace('\0', " "))
            });
            let lines: Vec<String> = lines.collect();
            for (pid, _) in &left {
                if let Some(pid) = Pid::from_raw(*pid) {
                    let _ = rustix::process::kill_process(pid, Signal::KILL);
                    let _ = waitpid(Some(pid), WaitOptions::NOHANG);
                }
            }
            return Err(format!("processes are left: {lines:?}"));
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// The longest time for which a process may be stopped, and the time without progress after which a run ends.
///
/// On two processors under a load of forty, a healthy participant with others ahead of it was observed to get no CPU time for 2 s.
pub(super) const PATIENCE: &str = "6 s";
/// Longer than [`PATIENCE`].
const LONG_MS: [u64; 2] = [6500, 8000];

impl ScheduledSignal {
    /// A signal, or a stop and its continuation, among those that a run with `slots` participants may receive.
    pub(super) fn random(rng: &mut Rng, slots: usize, pauses_only: bool) -> ScheduledSignal {
        let moment = match rng.below(8) {
            0 | 1 => Moment::After { us: rng.below(120_000) },
            2 => Moment::Tape {
                per_mille: 1000,
                us: rng.below(60_000),
            },
            _ => Moment::Tape {
                per_mille: rng.below(1000),
                us: rng.below(20_000),
            },
        };
        let target = match rng.below(8) {
            0 | 1 => Target::Orchestrator,
            2 => Target::All {
                orchestrator_first: rng.one_in(2),
            },
            _ => Target::One(rng.below(slots as u64) as usize),
        };
        let pause = pauses_only || rng.one_in(4);
        let action = match target {
            _ if pause => ScheduledSignal::pause(rng, target),
            Target::One(_) => Action::Signal(rng.choose(&[
                Signal::KILL,
                Signal::KILL,
                Signal::KILL,
                Signal::TERM,
                Signal::INT,
                Signal::HUP,
                Signal::ABORT,
                Signal::SEGV,
                Signal::USR1,
            ])),
            Target::Orchestrator => Action::Signal(rng.choose(&[Signal::KILL, Signal::TERM, Signal::INT, Signal::HUP])),
            Target::All { .. } => Action::Signal(rng.choose(&[Signal::KILL, Signal::TERM])),
        };
        ScheduledSignal { moment, target, action }
    }

    fn pause(rng: &mut Rng, target: Target) -> Action {
        match rng.below(8) {
            0 if matches!(target, Target::One(_)) => Action::Stop,
            0..=2 => Action::Pause {
                ms: rng.between(LONG_MS[0], LONG_MS[1]),
            },
            _ => Action::Pause {
                ms: rng.between(1, 500),
            },
        }
    }

    /// Whether it lasts longer than [`PATIENCE`].
    pub(super) fn is_long(&self) -> bool {
        match self.action {
            Action::Stop => true,
            Action::Pause { ms } => ms >= LONG_MS[0],
            Action::Signal(_) => false,
        }
    }
}

impl DeliveredSignal {
    /// Whether a participant that it reached may fail because of it. A suspension of everything, or of the orchestrator, does no harm.
    pub(super) fn can_fail_a_participant(&self) -> bool {
        let one = matches!(self.target, Target::One(_));
        match self.action {
            Action::Signal(_) => self.slot.is_some(),
            Action::Stop => one,
            Action::Pause { ms } => one && ms >= LONG_MS[0],
        }
    }

    /// The signal that it sent to the orchestrator to end it.
    pub(super) fn ends_the_orchestrator(&self) -> Option<Signal> {
        match self.action {
            Action::Signal(signal) if self.slot.is_none() => Some(signal),
            _ => None,
        }
    }
}
