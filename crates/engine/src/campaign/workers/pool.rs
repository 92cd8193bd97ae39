//! Execution of the points: workers, progress, the journal.

use std::collections::VecDeque;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

use super::batch_size::efficient_lanes;
use super::pending_point::{PendingPoint, Purpose, missing_points};
use super::point::{Outcome, Result as PointResult};
use super::worker::{Answer, Task, Worker, WorkerMessage};
use crate::campaign::folder::any_path::AnyPath;
use crate::campaign::folder::campaign_folder::Folder;
use crate::campaign::folder::identity::{Identity, digest_of_scenario};
use crate::campaign::folder::keep::{Keep, selected_points};
use crate::campaign::folder::table::sheet;
use crate::campaign::options::Options;
use crate::campaign::stopping_rule::Watch;
use crate::campaign::{Campaign, CampaignError};
use crate::observer::Event;
use crate::scenario::Scenario;

/// A campaign that has ended, or was stopped.
#[derive(Debug)]
pub struct Finished {
    /// Its folder.
    pub folder: Folder,
    /// The identity of the folder.
    pub identity: Identity,
    /// The result of each point; `None` for points that were not run. Where the stopping rule ended the campaign, these are
    /// the points up to there.
    pub results: Vec<Option<PointResult>>,
    /// The number of points that had results before.
    pub resumed: usize,
    /// Whether it was stopped.
    pub interrupted: bool,
    /// Wall-clock time, s.
    pub wall_s: f64,
}

impl Finished {
    /// The number of points with that outcome.
    pub fn count(&self, outcome: Outcome) -> usize {
        self.results
            .iter()
            .flatten()
            .filter(|result| result.outcome == outcome)
            .count()
    }

    /// Whether every point that the folder is for ran to its end.
    pub fn all_ran(&self) -> bool {
        let ran = |result: &Option<PointResult>| result.as_ref().is_some_and(|result| result.outcome.ran());
        let mut all = self.results.iter().enumerate();
        all.all(|(at, result)| !self.identity.owns(at) || ran(result))
    }

    /// The number of points that the folder is for.
    pub fn own(&self) -> usize {
        (0..self.results.len()).filter(|at| self.identity.owns(*at)).count()
    }

    /// Runs those points again, with whole tapes, whose run folders are requested and missing.
    ///
    /// # Errors
    /// As [`run`], and when a point has another result than before.
    pub fn keep(&mut self, campaign: &Campaign, scenario: &Scenario, options: &Options) -> Result<(), CampaignError> {
        let there = |at: &usize| self.folder.has_run(at + 1);
        let wanted = selected_points(&options.keep, &self.results, options.figure.as_ref()).into_iter();
        let pending = wanted
            .filter(|at| !there(at))
            .map(|point| PendingPoint {
                point,
                purpose: Purpose::Rerun,
            })
            .collect();
        let mut pool = Pool::new(campaign, scenario, &self.folder, &mut self.results, pending);
        let outcome = pool.run(options);
        self.interrupted |= pool.stopped;
        outcome
    }
}

/// Runs those points of `campaign` whose results its folder does not have yet. The first point has been checked.
///
/// # Errors
/// When the folder cannot be locked or written, or no process can be started. Earlier results stay in the journal.
pub fn run(campaign: &Campaign, scenario: &Scenario, options: &Options) -> Result<Finished, CampaignError> {
    let identity = Identity {
        shard: options.shard,
        audit: options.audit,
        until: options.stopping_rule(),
        ..Identity::of(campaign, scenario)?
    };
    run_with_identity(campaign, scenario, identity, options, None)
}

/// The same for a campaign that was read from a folder, with the identity that it must still have.
///
/// # Errors
/// As [`run`], and when the scenario or a program has changed.
pub fn run_as(
    known: &Identity,
    campaign: &Campaign,
    scenario: &Scenario,
    options: &Options,
) -> Result<Finished, CampaignError> {
    let now = Identity::of(campaign, scenario)?;
    let refuse = |reason: String| {
        let path = campaign.scenario.clone();
        Err(CampaignError::Folder { path, reason })
    };
    if (now.program, now.content) != (known.program, known.content) {
        return refuse(format!(
            "is not what the campaign was made of: {}; start a new campaign",
            known.difference(&now)
        ));
    }
    if let Some(own) = known.shard.filter(|own| options.shard != Some(*own)) {
        return refuse(format!(
            "the folder has the points of shard {own} alone: leave --shard out"
        ));
    }
    let identity = Identity {
        shard: options.shard,
        audit: options.audit,
        until: options.stopping_rule(),
        file: now.file,
        source: now.source,
        ..known.clone()
    };
    run_with_identity(campaign, scenario, identity, options, None)
}

/// Runs `campaign` in the folder with this identity. A campaign that grows had `before` points with results when it began; any
/// other has those in its folder.
pub(crate) fn run_with_identity(
    campaign: &Campaign,
    scenario: &Scenario,
    identity: Identity,
    options: &Options,
    before: Option<usize>,
) -> Result<Finished, CampaignError> {
    let started = Instant::now();
    let (mut folder, mut known) = Folder::open(campaign, &identity, options)?;
    for (point, reason) in &campaign.refused {
        let result = PointResult::without(Outcome::Refused, reason.clone());
        if identity.owns(*point) && known.results[*point].is_none() {
            folder.append_result(campaign, point + 1, false, &result)?;
            known.results[*point] = Some(result);
        } else if identity.audits(*point) && known.audited.insert(*point) {
            folder.append_result(campaign, point + 1, true, &result)?;
        }
    }
    let pending = missing_points(&known, &identity);
    folder.write_holder(options.workers(pending.len()))?;
    let done = known.results.iter().flatten().count();
    let resumed = before.unwrap_or(done);
    let mut results = known.results;
    let mut pool = Pool::new(campaign, scenario, &folder, &mut results, pending);
    pool.total = (0..campaign.points.len()).filter(|at| identity.owns(*at)).count();
    (pool.resumed, pool.done) = (resumed, done);
    pool.grows = campaign.source.as_ref().is_some_and(|source| source.rare);
    pool.keep = options.keep.contains(&Keep::All);
    pool.until = options.until.clone();
    pool.partial_table = identity.shard.is_none().then(|| PartialTable::new(&folder));
    let outcome = pool.run(options);
    let (interrupted, enough) = (pool.stopped, pool.enough);
    outcome?;
    results.truncate(enough.unwrap_or(results.len()));
    let mut finished = Finished {
        folder,
        identity,
        results,
        resumed,
        interrupted,
        wall_s: 0.0,
    };
    if !interrupted {
        finished.keep(campaign, scenario, options)?;
    }
    finished.wall_s = started.elapsed().as_secs_f64();
    Ok(finished)
}

impl Options {
    /// The number of processes that work on `pending` points.
    fn workers(&self, pending: usize) -> usize {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        self.workers.unwrap_or(cores).clamp(1, pending.max(1))
    }
}

/// A worker and the points that it is running, each with its ticket.
struct WorkerSlot {
    worker: Worker,
    busy: Vec<(u64, PendingPoint)>,
    /// Whether its point is one that is run again alone.
    alone: bool,
}

struct Pool<'a> {
    campaign: &'a Campaign,
    digest: String,
    folder: &'a Folder,
    results: &'a mut Vec<Option<PointResult>>,
    /// Points that no worker has yet.
    pending: VecDeque<PendingPoint>,
    /// Points of workers whose processes ended abnormally; one of these points is the cause. A worker runs such a point alone.
    suspects: VecDeque<PendingPoint>,
    /// The maximum number of points of a worker at a time.
    lanes: usize,
    last_ticket: u64,
    /// The numbers of results before the start, now, and at the end.
    resumed: usize,
    done: usize,
    total: usize,
    /// Whether more points may follow, depending on the results.
    grows: bool,
    /// Whether run folders are kept during the campaign.
    keep: bool,
    until: Option<Watch>,
    /// The number of points that the stopping rule found enough.
    enough: Option<usize>,
    /// Whether the user requested an end.
    stopped: bool,
    /// The table of the results so far; a shard of a campaign has none.
    partial_table: Option<PartialTable>,
    slots: Vec<WorkerSlot>,
}

/// The table that is written during a campaign.
struct PartialTable {
    path: PathBuf,
    last_write: Instant,
    /// The wait before the next write.
    interval: Duration,
}

/// Minimum interval between two writes of the table.
const TABLE_INTERVAL: Duration = Duration::from_secs(10);

impl PartialTable {
    fn new(folder: &Folder) -> PartialTable {
        PartialTable {
            path: folder.root().join("table.csv"),
            last_write: Instant::now(),
            interval: TABLE_INTERVAL,
        }
    }

    /// Writes the table if the interval has passed. Writing takes at most a twentieth of the time.
    fn write_if_due(&mut self, campaign: &Campaign, results: &[Option<PointResult>]) -> Result<(), CampaignError> {
        if self.last_write.elapsed() < self.interval {
            return Ok(());
        }
        let started = Instant::now();
        sheet(campaign, results).csv(&self.path)?;
        self.last_write = Instant::now();
        self.interval = TABLE_INTERVAL.max(20 * started.elapsed());
        Ok(())
    }
}

type WorkerChannel = (Sender<(usize, WorkerMessage)>, Receiver<(usize, WorkerMessage)>);

impl<'a> Pool<'a> {
    fn new(
        campaign: &'a Campaign,
        scenario: &Scenario,
        folder: &'a Folder,
        results: &'a mut Vec<Option<PointResult>>,
        pending: VecDeque<PendingPoint>,
    ) -> Pool<'a> {
        Pool {
            campaign,
            digest: digest_of_scenario(scenario.spec()).to_string(),
            folder,
            results,
            resumed: 0,
            done: 0,
            total: pending.len(),
            grows: false,
            pending,
            suspects: VecDeque::new(),
            lanes: efficient_lanes(scenario),
            last_ticket: 0,
            keep: false,
            until: None,
            enough: None,
            stopped: false,
            partial_table: None,
            slots: Vec::new(),
        }
    }

    /// Runs the open points until none is left, or there are enough, or the user requests an end.
    fn run(&mut self, options: &Options) -> Result<(), CampaignError> {
        let messages = channel();
        let outcome = self.run_workers(options, &messages);
        options.progress.report(Event::Over);
        self.stopped = options.interrupt.is_requested();
        // All workers receive the request to end before the first is waited for.
        self.slots.iter_mut().for_each(|slot| slot.worker.shut_down());
        for number in 0..self.slots.len() {
            let _ = std::fs::remove_dir_all(self.folder.scratch(number));
        }
        self.slots.clear();
        outcome
    }

    fn run_workers(&mut self, options: &Options, messages: &WorkerChannel) -> Result<(), CampaignError> {
        self.evaluate_stopping_rule();
        let workers = options.workers(self.pending.len()).min(self.pending.len());
        // where lanes bring no benefit one is used, whatever the options say
        let lanes = if self.lanes == 1 {
            1
        } else {
            options.lanes.unwrap_or(self.lanes)
        };
        // A run whose folder is kept runs alone.
        let kept = self.keep
            || self
                .pending
                .iter()
                .any(|pending_point| pending_point.purpose == Purpose::Rerun);
        self.lanes = if kept {
            1
        } else {
            lanes.min(self.pending.len().div_ceil(workers.max(1)))
        };
        for number in 0..workers {
            if self.enough.is_some() {
                return Ok(());
            }
            let worker = start_worker(number, &messages.0)?;
            self.slots.push(WorkerSlot {
                worker,
                busy: Vec::new(),
                alone: false,
            });
            self.send_points(number)?;
        }
        while self.enough.is_none() && self.slots.iter().any(|slot| !slot.busy.is_empty()) {
            if options.interrupt.is_requested() {
                return Ok(());
            }
            options.progress.report(Event::Points {
                done: self.done,
                all: self.total,
                resumed: self.resumed,
                grows: self.grows,
            });
            let (number, message) = match messages.1.recv_timeout(Duration::from_millis(50)) {
                Ok(message) => message,
                Err(RecvTimeoutError::Timeout) => continue,
                Err(RecvTimeoutError::Disconnected) => return Ok(()),
            };
            match message {
                WorkerMessage::Answer(Answer::Changed) => {
                    let path = self.campaign.scenario.clone();
                    return Err(CampaignError::Changed { path });
                }
                WorkerMessage::Answer(Answer::Done(ticket, result)) => self.record_result(number, ticket, *result)?,
                WorkerMessage::Exited => {
                    let slot = &mut self.slots[number];
                    let reason = slot.worker.exit_report();
                    match slot.busy[..] {
                        [(ticket, _)] => {
                            self.record_result(number, ticket, PointResult::without(Outcome::Crashed, reason))?
                        }
                        _ => self
                            .suspects
                            .extend(slot.busy.drain(..).map(|(_, pending_point)| pending_point)),
                    }
                    self.slots[number].worker = start_worker(number, &messages.0)?;
                }
            }
            self.send_points(number)?;
            if let Some(partial_table) = &mut self.partial_table {
                partial_table.write_if_due(self.campaign, self.results)?;
            }
        }
        Ok(())
    }

    /// Evaluates the stopping rule.
    fn evaluate_stopping_rule(&mut self) {
        if let Some(watch) = &mut self.until {
            self.enough = watch.evaluate(self.results);
        }
    }

    fn record_result(&mut self, number: usize, ticket: u64, result: PointResult) -> Result<(), CampaignError> {
        let busy = &mut self.slots[number].busy;
        let Some(at) = busy.iter().position(|(own, _)| *own == ticket) else {
            return Ok(());
        };
        let PendingPoint { point, purpose } = busy.remove(at).1;
        self.done += 1;
        match purpose {
            Purpose::Own => {
                self.folder.append_result(self.campaign, point + 1, false, &result)?;
                self.results[point] = Some(result);
                self.evaluate_stopping_rule();
            }
            Purpose::Audit => self.folder.append_result(self.campaign, point + 1, true, &result)?,
            Purpose::Rerun => {
                let known = self.results[point].as_ref().filter(|known| known.outcome.ran());
                if let Some((now, before)) = known.and_then(|known| result.difference(known)) {
                    return Err(CampaignError::Folder {
                        path: self.folder.run_folder(point + 1),
                        reason: format!(
                            "has {now} where the same point had {before}: this machine cannot be relied upon"
                        ),
                    });
                }
            }
        }
        Ok(())
    }

    /// Sends points to worker `number`, as long as there are any and it has room for them.
    fn send_points(&mut self, number: usize) -> Result<(), CampaignError> {
        while let Some(pending_point) = self.next(number) {
            let (point, keep) = (pending_point.point, pending_point.purpose == Purpose::Rerun);
            let keep = keep || (self.keep && pending_point.purpose == Purpose::Own);
            let slot = &mut self.slots[number];
            self.last_ticket += 1;
            let task = Task {
                ticket: self.last_ticket,
                alone: slot.alone || self.lanes == 1,
                scenario: AnyPath(self.campaign.scenario.clone()),
                digest: self.digest.clone(),
                common: self.campaign.overrides.clone(),
                changes: self.campaign.points[point].clone(),
                keep: keep.then(|| AnyPath(self.folder.run_folder(point + 1))),
                scratch: AnyPath(self.folder.scratch(number)),
                digests: self.campaign.digests,
            };
            slot.busy.push((self.last_ticket, pending_point));
            match slot.worker.send(&task) {
                // The worker process has ended, and its message `Exited` follows.
                Err(error) if error.kind() == ErrorKind::BrokenPipe => return Ok(()),
                sent => sent.map_err(|source| CampaignError::Io {
                    path: self.campaign.scenario.clone(),
                    action: "give a worker a point of",
                    source,
                })?,
            }
        }
        Ok(())
    }

    /// The next point for worker `number`.
    fn next(&mut self, number: usize) -> Option<PendingPoint> {
        let slot = &mut self.slots[number];
        if slot.busy.is_empty() {
            let suspect = self.suspects.pop_front();
            slot.alone = suspect.is_some();
            return suspect.or_else(|| self.pending.pop_front());
        }
        if slot.alone || slot.busy.len() >= self.lanes || !self.suspects.is_empty() {
            return None;
        }
        self.pending.pop_front()
    }
}

fn start_worker(number: usize, messages: &Sender<(usize, WorkerMessage)>) -> Result<Worker, CampaignError> {
    Worker::start(number, messages).map_err(|source| CampaignError::Io {
        path: Path::new("/proc/self/exe").to_owned(),
        action: "start a worker",
        source,
    })
}
