//! The processes that run the points: each takes points as lines of JSON and answers each with one.

use std::io::{self, BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, Stdio};
use std::sync::mpsc::{Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};

use rustix::process::{Pid, Signal, kill_process};
use serde::{Deserialize, Serialize};

use super::abreast::Points;
use super::any_path::AnyPath;
use super::identity::digest_of_scenario;
use super::point::{Order, Result as PointResult};
use crate::Catalogue;
use crate::scenario::{Changes, ScenarioSpec};

/// A point for a worker.
#[derive(Debug, Serialize, Deserialize)]
pub struct Task {
    /// What the answer is to carry.
    pub ticket: u64,
    /// Whether no other point may be under way beside it.
    pub alone: bool,
    /// The scenario file.
    pub scenario: AnyPath,
    /// What it must still be, with the changes that all points share.
    pub digest: String,
    /// Those changes.
    pub common: Changes,
    /// The changes of this point.
    pub changes: Vec<String>,
    /// The run folder, if it is kept.
    pub keep: Option<AnyPath>,
    /// Where a run folder may be made for a while.
    pub scratch: AnyPath,
    /// Whether the digest of the tape is wanted.
    pub digests: bool,
}

/// A worker's answer.
#[derive(Debug, Serialize, Deserialize)]
pub enum Answer {
    /// The point with this ticket was run, or could not be.
    Done(u64, Box<PointResult>),
    /// The scenario is not what it was.
    Changed,
}

/// Serves the points that come as lines on `tasks`, one answer a line, until there are no more. Those that have come go side by side.
///
/// # Errors
/// When nobody listens any more.
pub fn serve(
    catalogue: &Arc<Catalogue>,
    tasks: impl BufRead + Send + 'static,
    mut answers: impl Write,
) -> io::Result<()> {
    let (sender, lines) = channel();
    std::thread::spawn(move || {
        for line in tasks.lines() {
            if sender.send(line).is_err() {
                return;
            }
        }
    });
    let mut answer = |answer: Answer| {
        writeln!(answers, "{}", serde_json::to_string(&answer)?)?;
        answers.flush()
    };
    let mut points = Points::new(catalogue.clone());
    loop {
        let next = match points.is_empty() {
            true => lines.recv().map(Some),
            false => Ok(lines.try_recv().ok()),
        };
        let Ok(next) = next else {
            return Ok(());
        };
        let Some(line) = next else {
            for (ticket, result) in points.advance() {
                answer(Answer::Done(ticket, Box::new(result)))?;
            }
            continue;
        };
        let task: Task = serde_json::from_str(&line?)?;
        let Some(spec) = task.current() else {
            answer(Answer::Changed)?;
            continue;
        };
        let (ticket, alone) = (task.ticket, task.alone);
        if let Some((ticket, result)) = points.begin(ticket, task.order(spec), alone) {
            answer(Answer::Done(ticket, Box::new(result)))?;
        }
    }
}

impl Task {
    /// The scenario with the changes that all points share, if it still is what it was.
    fn current(&self) -> Option<ScenarioSpec> {
        let spec = ScenarioSpec::changed(&self.scenario.0, &self.common).ok()?;
        (digest_of_scenario(&spec).to_string() == self.digest).then_some(spec)
    }

    fn order(self, spec: ScenarioSpec) -> Order {
        Order {
            file: self.scenario.0,
            spec,
            changes: self.changes,
            keep: self.keep.map(|path| path.0),
            scratch: self.scratch.0,
            digests: self.digests,
        }
    }
}

/// What a worker has to say.
#[derive(Debug)]
pub enum Word {
    /// An answer.
    Answer(Answer),
    /// It is gone.
    Gone,
}

/// A worker's process.
#[derive(Debug)]
pub struct Worker {
    child: Child,
    orders: Option<ChildStdin>,
    said: Arc<Mutex<String>>,
}

impl Worker {
    /// Starts worker number `number`, whose words go to `words` with the number.
    ///
    /// The kernel kills it when the thread that starts it dies, so this must be called from the main thread.
    pub fn start(number: usize, words: &Sender<(usize, Word)>) -> io::Result<Worker> {
        let mut command = crate::run::own_program();
        command
            .arg("campaign-worker")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        crate::run::tie(&mut command);
        let mut child = command.spawn()?;
        let orders = child.stdin.take();
        let said = Arc::new(Mutex::new(String::new()));
        let mut listeners = Vec::new();
        if let Some(errors) = child.stderr.take() {
            let said = said.clone();
            listeners.push(std::thread::spawn(move || {
                for line in BufReader::new(errors).lines().map_while(Result::ok) {
                    let mut said = said.lock().unwrap_or_else(PoisonError::into_inner);
                    if said.len() < 2000 {
                        *said += &line;
                        said.push(' ');
                    }
                }
            }));
        }
        if let Some(answers) = child.stdout.take() {
            let words = words.clone();
            std::thread::spawn(move || {
                for line in BufReader::new(answers).lines().map_while(Result::ok) {
                    // What is no answer was printed by somebody's model, and is nobody's business.
                    if let Ok(answer) = serde_json::from_str(&line)
                        && words.send((number, Word::Answer(answer))).is_err()
                    {
                        return;
                    }
                }
                listeners.into_iter().for_each(|listener| drop(listener.join()));
                let _ = words.send((number, Word::Gone));
            });
        }
        Ok(Worker { child, orders, said })
    }

    /// Gives it a point.
    ///
    /// # Errors
    /// [`io::ErrorKind::BrokenPipe`] when it is gone; any other error is one of the task.
    pub fn order(&mut self, task: &Task) -> io::Result<()> {
        let orders = self.orders.as_mut().ok_or(io::ErrorKind::BrokenPipe)?;
        let line = serde_json::to_string(task)? + "\n";
        orders.write_all(line.as_bytes())?;
        orders.flush()
    }

    /// How it ended and what it said last, once it is gone.
    pub fn obituary(&mut self) -> String {
        let ending = match self.child.wait() {
            Ok(status) => crate::run::ending_of_process(status),
            Err(error) => error.to_string(),
        };
        let said = self.said.lock().unwrap_or_else(PoisonError::into_inner);
        let said = said.trim();
        if said.is_empty() {
            format!("the process that ran it {ending}")
        } else {
            format!("the process that ran it {ending}: {said}")
        }
    }

    /// Asks it to end in order: a run that it has under way takes its processes along.
    pub fn dismiss(&mut self) {
        self.orders = None;
        let _ = kill_process(Pid::from_child(&self.child), Signal::TERM);
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        self.orders = None;
        let started = std::time::Instant::now();
        while started.elapsed().as_secs() < 2 {
            if !matches!(self.child.try_wait(), Ok(None)) {
                return;
            }
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
