//! Running the points: workers, progress, the journal.

use std::collections::VecDeque;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

use super::folder::{Folder, digest_of_scenario};
use super::point::{Outcome, Result as PointResult};
use super::worker::{Answer, AnyPath, Task, Word, Worker};
use super::{Campaign, CampaignError};
use crate::observer::{Event, Interrupt, Progress};
use crate::scenario::Scenario;

/// What the command line says about a campaign besides its points.
#[derive(Clone, Default)]
pub struct Options {
    /// The campaign's folder; one named after the scenario and the points unless given.
    pub out: Option<PathBuf>,
    /// Processes that work side by side; one a core unless given.
    pub workers: Option<usize>,
    /// Keep the run folder of every point.
    pub keep: bool,
    /// Receives what happens.
    pub progress: Progress,
    /// Asks for an end in order.
    pub interrupt: Interrupt,
}

/// A campaign that has ended, or was stopped.
#[derive(Debug)]
pub struct Finished {
    /// Its folder.
    pub folder: Folder,
    /// What became of each point; `None` for those that were not run.
    pub results: Vec<Option<PointResult>>,
    /// How many were there from before.
    pub resumed: usize,
    /// Whether it was stopped.
    pub interrupted: bool,
    /// Wall time, s.
    pub wall_s: f64,
}

impl Finished {
    /// How many points became that.
    pub fn count(&self, outcome: Outcome) -> usize {
        self.results
            .iter()
            .flatten()
            .filter(|result| result.outcome == outcome)
            .count()
    }

    /// Whether every point ran to its end.
    pub fn all_ran(&self) -> bool {
        self.results
            .iter()
            .all(|result| result.as_ref().is_some_and(|result| result.outcome.ran()))
    }
}

/// Runs those points of `campaign` that its folder does not have yet. The first point has been checked.
///
/// # Errors
/// When the folder cannot be taken or written, or no process can be started. What was complete before stays in the journal.
pub fn run(campaign: &Campaign, scenario: &Scenario, options: &Options) -> Result<Finished, CampaignError> {
    let (mut folder, mut results) = Folder::open(campaign, scenario, options.out.as_deref())?;
    for (point, reason) in &campaign.refused {
        if results[*point].is_none() {
            let result = PointResult::without(Outcome::Refused, reason.clone());
            folder.note(campaign, point + 1, &result)?;
            results[*point] = Some(result);
        }
    }
    let interrupt = options.interrupt.clone();
    let open: VecDeque<usize> = (0..results.len()).filter(|&at| results[at].is_none()).collect();
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let workers = options.workers.unwrap_or(cores).clamp(1, open.len().max(1));
    let (sender, receiver) = channel();
    let started = Instant::now();
    let mut crew = Crew {
        resumed: results.len() - open.len(),
        campaign,
        digest: digest_of_scenario(scenario).to_string(),
        keep: options.keep,
        folder,
        results,
        open,
        seats: Vec::new(),
        sender,
    };
    let progress = options.progress.clone();
    let outcome = crew.work(workers, &receiver, &interrupt, &progress);
    progress.report(Event::Over);
    let interrupted = interrupt.asked();
    // All are asked before any is waited for.
    crew.seats.iter_mut().for_each(|seat| seat.worker.dismiss());
    for number in 0..crew.seats.len() {
        let scratch = crew.folder.scratch(number);
        crew.seats[number].busy = None;
        let _ = std::fs::remove_dir_all(scratch);
    }
    crew.seats.clear();
    outcome?;
    Ok(Finished {
        folder: crew.folder,
        results: crew.results,
        resumed: crew.resumed,
        interrupted,
        wall_s: started.elapsed().as_secs_f64(),
    })
}

/// A worker and the point that it has.
struct Seat {
    worker: Worker,
    busy: Option<usize>,
}

struct Crew<'a> {
    campaign: &'a Campaign,
    digest: String,
    keep: bool,
    folder: Folder,
    results: Vec<Option<PointResult>>,
    resumed: usize,
    /// Points that nobody has yet.
    open: VecDeque<usize>,
    seats: Vec<Seat>,
    sender: Sender<(usize, Word)>,
}

impl Crew<'_> {
    fn work(
        &mut self,
        workers: usize,
        words: &Receiver<(usize, Word)>,
        interrupt: &Interrupt,
        progress: &Progress,
    ) -> Result<(), CampaignError> {
        for number in 0..workers.min(self.open.len()) {
            let worker = self.hire(number)?;
            self.seats.push(Seat { worker, busy: None });
            self.order(number)?;
        }
        while self.seats.iter().any(|seat| seat.busy.is_some()) {
            if interrupt.asked() {
                return Ok(());
            }
            progress.report(self.progress());
            let (number, word) = match words.recv_timeout(Duration::from_millis(50)) {
                Ok(word) => word,
                Err(RecvTimeoutError::Timeout) => continue,
                Err(RecvTimeoutError::Disconnected) => return Ok(()),
            };
            match word {
                Word::Answer(Answer::Changed) => {
                    let path = self.campaign.scenario.clone();
                    return Err(CampaignError::Changed { path });
                }
                Word::Answer(Answer::Done(result)) => self.note(number, *result)?,
                Word::Gone => {
                    let reason = self.seats[number].worker.obituary();
                    self.note(number, PointResult::without(Outcome::Crashed, reason))?;
                    self.seats[number].worker = self.hire(number)?;
                }
            }
            self.order(number)?;
        }
        Ok(())
    }

    fn hire(&self, number: usize) -> Result<Worker, CampaignError> {
        Worker::start(number, &self.sender).map_err(|source| CampaignError::Io {
            path: Path::new("/proc/self/exe").to_owned(),
            action: "start a worker",
            source,
        })
    }

    fn note(&mut self, number: usize, result: PointResult) -> Result<(), CampaignError> {
        if let Some(point) = self.seats[number].busy.take() {
            self.folder.note(self.campaign, point + 1, &result)?;
            self.results[point] = Some(result);
        }
        Ok(())
    }

    /// Gives worker `number` the next point, if there is one.
    fn order(&mut self, number: usize) -> Result<(), CampaignError> {
        let Some(point) = self.open.pop_front() else {
            return Ok(());
        };
        let task = Task {
            scenario: AnyPath(self.campaign.scenario.clone()),
            digest: self.digest.clone(),
            common: self.campaign.overrides.clone(),
            changes: self.campaign.points[point].clone(),
            keep: self.keep.then(|| AnyPath(self.folder.run(point + 1))),
            scratch: AnyPath(self.folder.scratch(number)),
        };
        let seat = &mut self.seats[number];
        seat.busy = Some(point);
        match seat.worker.order(&task) {
            // It is gone, and its end is about to be heard.
            Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
            ordered => ordered.map_err(|source| CampaignError::Io {
                path: self.campaign.scenario.clone(),
                action: "give a worker its point",
                source,
            }),
        }
    }

    fn progress(&self) -> Event<'static> {
        Event::Points {
            done: self.results.iter().flatten().count(),
            all: self.results.len(),
            resumed: self.resumed,
        }
    }
}
