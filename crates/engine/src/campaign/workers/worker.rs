//! Worker processes that run the points: each reads points as lines of JSON and answers each with one line.

use std::io::{self, BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, Stdio};
use std::sync::mpsc::{Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};

use rustix::process::{Pid, Signal, kill_process};
use serde::{Deserialize, Serialize};

use super::batched::PointBatch;
use super::point::{PointRequest, Result as PointResult};
use crate::Catalogue;
use crate::campaign::folder::any_path::AnyPath;
use crate::campaign::folder::identity::digest_of_scenario;
use crate::scenario::{Changes, ScenarioSpec};

/// Maximum length of the retained tail of a worker's output, bytes.
const OUTPUT_MAX: usize = 2000;

/// A point for a worker.
#[derive(Debug, Serialize, Deserialize)]
pub struct Task {
    /// The ticket that the answer must carry.
    pub ticket: u64,
    /// Whether no other point may run beside it.
    pub alone: bool,
    /// The scenario file.
    pub scenario: AnyPath,
    /// The digest that it must still have, with the changes that all points share.
    pub digest: String,
    /// Those changes.
    pub common: Changes,
    /// The changes of this point.
    pub changes: Vec<String>,
    /// The run folder, if it is kept.
    pub keep: Option<AnyPath>,
    /// The path where a temporary run folder may be made.
    pub scratch: AnyPath,
    /// Whether the digest of the tape is requested.
    pub digests: bool,
}

/// A worker's answer.
#[derive(Debug, Serialize, Deserialize)]
pub enum Answer {
    /// The point with this ticket was run, or could not be run.
    Done(u64, Box<PointResult>),
    /// The scenario has changed.
    Changed,
}

/// Serves the points that arrive as lines on `tasks`, one line of answer each, until the input ends. Points that have
/// arrived run side by side.
///
/// # Errors
/// When the reader of the answers is gone.
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
    let mut points = PointBatch::new(catalogue.clone());
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
        let Some(spec) = task.unchanged_spec() else {
            answer(Answer::Changed)?;
            continue;
        };
        let (ticket, alone) = (task.ticket, task.alone);
        if let Some((ticket, result)) = points.start(ticket, task.into_request(spec), alone) {
            answer(Answer::Done(ticket, Box::new(result)))?;
        }
    }
}

impl Task {
    /// The scenario with the changes that all points share, if it has not changed.
    fn unchanged_spec(&self) -> Option<ScenarioSpec> {
        let spec = ScenarioSpec::changed(&self.scenario.0, &self.common).ok()?;
        (digest_of_scenario(&spec).to_string() == self.digest).then_some(spec)
    }

    fn into_request(self, spec: ScenarioSpec) -> PointRequest {
        PointRequest {
            file: self.scenario.0,
            spec,
            changes: self.changes,
            keep: self.keep.map(|path| path.0),
            scratch: self.scratch.0,
            digests: self.digests,
        }
    }
}

/// A message from a worker.
#[derive(Debug)]
pub enum WorkerMessage {
    /// An answer.
    Answer(Answer),
    /// The worker process has ended.
    Exited,
}

/// A worker's process.
#[derive(Debug)]
pub struct Worker {
    child: Child,
    stdin: Option<ChildStdin>,
    output_tail: Arc<Mutex<String>>,
}

impl Worker {
    /// Starts worker number `number`; its messages go to `messages` with the number.
    ///
    /// The kernel kills it when the thread that starts it dies, so this must be called from the main thread.
    pub fn start(number: usize, messages: &Sender<(usize, WorkerMessage)>) -> io::Result<Worker> {
        let mut command = crate::run::own_program();
        command
            .arg("campaign-worker")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        crate::run::end_with_parent(&mut command);
        let mut child = command.spawn()?;
        let stdin = child.stdin.take();
        let output_tail = Arc::new(Mutex::new(String::new()));
        let mut stderr_readers = Vec::new();
        if let Some(errors) = child.stderr.take() {
            let output_tail = output_tail.clone();
            stderr_readers.push(std::thread::spawn(move || {
                for line in BufReader::new(errors).lines().map_while(Result::ok) {
                    let mut output_tail = output_tail.lock().unwrap_or_else(PoisonError::into_inner);
                    append_output(&mut output_tail, &line);
                }
            }));
        }
        if let Some(answers) = child.stdout.take() {
            let messages = messages.clone();
            std::thread::spawn(move || {
                for line in BufReader::new(answers).lines().map_while(Result::ok) {
                    // Other lines were printed by a user's model, and are ignored.
                    if let Ok(answer) = serde_json::from_str(&line)
                        && messages.send((number, WorkerMessage::Answer(answer))).is_err()
                    {
                        return;
                    }
                }
                stderr_readers.into_iter().for_each(|reader| drop(reader.join()));
                let _ = messages.send((number, WorkerMessage::Exited));
            });
        }
        Ok(Worker {
            child,
            stdin,
            output_tail,
        })
    }

    /// Sends a point to the worker.
    ///
    /// # Errors
    /// [`io::ErrorKind::BrokenPipe`] when the worker process has ended; any other error is one of the task.
    pub fn send(&mut self, task: &Task) -> io::Result<()> {
        let stdin = self.stdin.as_mut().ok_or(io::ErrorKind::BrokenPipe)?;
        let line = serde_json::to_string(task)? + "\n";
        stdin.write_all(line.as_bytes())?;
        stdin.flush()
    }

    /// How the process ended, and its last output; waits for the end of the process.
    pub fn exit_report(&mut self) -> String {
        let ending = match self.child.wait() {
            Ok(status) => crate::run::ending_of_process(status),
            Err(error) => error.to_string(),
        };
        let output_tail = self.output_tail.lock().unwrap_or_else(PoisonError::into_inner);
        let output_tail = output_tail.trim();
        if output_tail.is_empty() {
            format!("the process that ran it {ending}")
        } else {
            format!("the process that ran it {ending}: {output_tail}")
        }
    }

    /// Requests an orderly end of the worker: a run in progress ends its own processes first.
    pub fn shut_down(&mut self) {
        self.stdin = None;
        let _ = kill_process(Pid::from_child(&self.child), Signal::TERM);
    }
}

/// Appends a line to the output of a worker, of which only the tail is kept: models may print there too, and the reason for an abnormal
/// end comes last.
fn append_output(output_tail: &mut String, line: &str) {
    *output_tail += line;
    output_tail.push(' ');
    let start = (output_tail.len().saturating_sub(OUTPUT_MAX)..).find(|&at| output_tail.is_char_boundary(at));
    output_tail.drain(..start.unwrap_or(0));
}

impl Drop for Worker {
    fn drop(&mut self) {
        self.stdin = None;
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn worker_output_tail_is_bounded_and_keeps_last_line() {
        let mut output_tail = String::new();
        append_output(&mut output_tail, "first");
        assert_eq!(output_tail, "first ");
        for _ in 0..1000 {
            append_output(&mut output_tail, "the ball is at 1 µm");
        }
        append_output(&mut output_tail, "it: the FMU called exit()");
        assert!(
            output_tail.len() <= OUTPUT_MAX && output_tail.len() > OUTPUT_MAX - 4,
            "{}",
            output_tail.len()
        );
        assert!(
            output_tail.ends_with("it: the FMU called exit() ") && !output_tail.contains("first"),
            "{output_tail}"
        );
    }
}
