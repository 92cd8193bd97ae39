//! A participant with all of its links connected: stepping, waiting, pausing.

use std::cell::RefCell;
use std::rc::Rc;
use std::time::{Duration, Instant};

use super::HostError;
use super::backoff::Backoff;
use super::neighbours::Neighbours;
use super::spans::Spans;
use crate::control::{ParticipantEvent, WaitStrategy, WallTimeBreakdown};
use crate::participant::Participant;
use crate::plan::{Assignment, Position};
use crate::span::{SpanActivity, now_ns};
use crate::stepper::{LinkEnds, PositionError, Progress, StepError, Stepper, Wait};
use crate::time::Ticks;
use crate::transport::TransportError;
use crate::transport::iceoryx::{
    Activity, ClockReader, Command, Domain, DomainError, LinkService, RecordSender, SharedRecord, Sleeper, Status,
    StatusWriter, WaitReason,
};

/// The time between two polls of a participant that must hand something over when there is no room.
const RETRY_INTERVAL: Duration = Duration::from_millis(1);

/// Why a participant cannot connect.
#[derive(Debug, thiserror::Error)]
pub(super) enum ConnectError {
    #[error(transparent)]
    Domain(#[from] DomainError),
    #[error(transparent)]
    Position(#[from] PositionError),
}

/// A participant with all of its links.
pub(super) struct ConnectedParticipant {
    pub(super) stepper: Stepper,
    pub(super) clock: ClockReader,
    record: SharedRecord,
    /// The participants that may be waiting for a sample of an output, or for room on the link into an input.
    neighbours: Neighbours,
    pub(super) backoff: Backoff,
    pub(super) timing: WallTimeBreakdown,
    /// The spans of wall-clock time, if they were requested.
    pub(super) spans: Option<Spans>,
    /// Whether the links have been prepared.
    prepared: bool,
    /// Keeps the services of the links open.
    _links: Vec<LinkService>,
}

/// A wait, up to the last poll at which the clock was read.
#[derive(Debug, Clone, Copy)]
struct WaitInterval {
    what: Wait,
    since: Instant,
    until: Instant,
    /// The participant's total number of sleeps before this wait.
    sleeps: u64,
    /// `since` on the clock of spans, if spans were requested.
    since_ns: u64,
}

/// Why [`ConnectedParticipant::advance`] returned.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum AdvanceOutcome {
    /// Everything before this horizon is done.
    AtHorizon(Ticks),
    /// Everything is done.
    Finished,
    /// The clock has a command for all participants.
    Commanded,
}

/// Opens all links of `participant`; `room` is the size of its record's ring, bytes.
#[allow(
    clippy::too_many_arguments,
    reason = "each is a part of one request, which is taken apart once, by the caller"
)]
pub(super) fn connect(
    domain: &Domain,
    name: &str,
    participant: Box<dyn Participant>,
    assignment: Assignment,
    cores: &[u32],
    waiting: WaitStrategy,
    room: u32,
    position: Option<Position>,
) -> Result<ConnectedParticipant, ConnectError> {
    let mut links = Vec::new();
    let mut ends = LinkEnds {
        receivers: Vec::new(),
        senders: Vec::new(),
        recording: Box::new(crate::transport::NoRecording),
    };
    let mut neighbours = Neighbours::of(name);
    for link in &assignment.inputs {
        let port = &assignment.interface.inputs[link.input as usize];
        let size = link.message(&port.descriptor).size as usize;
        let service = LinkService::open(domain, link.link, size, link.capacity as usize)?;
        let receiver = neighbours.receiver(domain, link, service.receiver(domain)?)?;
        ends.receivers.push(receiver);
        links.push(service);
    }
    for (output, port) in assignment.outputs.iter().zip(&assignment.interface.outputs) {
        let mut senders = Vec::new();
        for to in &output.consumers {
            let service = LinkService::open(domain, to.link, port.descriptor.size as usize, to.capacity as usize)?;
            senders.push(neighbours.sender(domain, to, service.sender(domain)?)?);
            links.push(service);
        }
        ends.senders.push(senders);
    }
    let clock = ClockReader::open(domain)?;
    // Not earlier: several participants may get the same core, and until here they use all of them. Not later: the memory of the rings
    // is allocated where it is first touched.
    stay_on(cores);
    let (streams, sizes): (Vec<u32>, Vec<usize>) = assignment.streams().unzip();
    let first = streams.first().copied().unwrap_or(0);
    let record = RecordSender::open(domain, name, first, &sizes, room)?;
    let record = SharedRecord(Rc::new(RefCell::new(record)));
    ends.recording = Box::new(record.clone());
    let timing = WallTimeBreakdown {
        inputs_ns: vec![0; assignment.inputs.len()],
        ..WallTimeBreakdown::default()
    };
    let stepper = match position {
        None => Stepper::new(participant, assignment, ends),
        Some(position) => Stepper::resume(participant, assignment, ends, position)?,
    };
    Ok(ConnectedParticipant {
        stepper,
        clock,
        record,
        neighbours,
        backoff: Backoff::new(waiting),
        timing,
        spans: None,
        prepared: false,
        _links: links,
    })
}

/// Keeps this process on `cores`, if there are any. A hint: failure makes the run slower, but does not change it.
fn stay_on(cores: &[u32]) {
    if !cores.is_empty() {
        let mut set = rustix::thread::CpuSet::new();
        cores.iter().for_each(|&core| set.set(core as usize));
        let _ = rustix::thread::sched_setaffinity(None, &set);
    }
}

impl ConnectedParticipant {
    /// Steps until `horizon`, the end, or a command of the clock.
    pub(super) fn advance(
        &mut self,
        horizon: Ticks,
        status: &mut StatusWriter,
        sleeper: &mut Sleeper,
    ) -> Result<AdvanceOutcome, HostError> {
        let started = Instant::now();
        let count = self.stepper.assignment().activations;
        self.stepper.extend_horizon(horizon);
        if !std::mem::replace(&mut self.prepared, true) {
            let prepared = self.stepper.prepare();
            prepared.map_err(|source| self.step_error(source))?;
        }
        if let Some(spans) = &mut self.spans {
            spans.end_pause(self.stepper.next_activation());
        }
        let mut waiting: Option<WaitInterval> = None;
        status.set(Status {
            next: self.stepper.next_activation(),
            activity: Activity::Computing,
        });
        loop {
            let activation = self.stepper.next_activation();
            let begun_ns = self.spans.as_ref().map(|_| now_ns());
            let progress = match self.stepper.poll() {
                Ok(progress) => progress,
                Err(source) => return Err(self.step_error(source)),
            };
            self.neighbours.wake();
            if let Some(begun_ns) = begun_ns {
                self.record_spans(activation, progress, waiting, begun_ns);
            }
            if let Progress::Waiting(wait) = progress {
                if self.wait(wait, &mut waiting, status, sleeper)? {
                    return Ok(AdvanceOutcome::Commanded);
                }
                continue;
            }
            if let Some(waited) = waiting.take() {
                self.add_to_breakdown(waited);
                self.backoff.reset(status);
            }
            match progress {
                Progress::Stepped => {
                    status.set(Status {
                        next: activation + 1,
                        activity: Activity::Computing,
                    });
                    self.try_send_spans()?;
                    if activation % 256 == 255 && self.clock.command() != Command::Run {
                        return Ok(AdvanceOutcome::Commanded);
                    }
                }
                Progress::AtHorizon => {
                    let next = activation;
                    let activity = Activity::Paused;
                    self.finish_advance(started, Status { next, activity }, status, sleeper)?;
                    self.spans.iter_mut().for_each(Spans::begin_pause);
                    self.send_event(&ParticipantEvent::AtHorizon { horizon, next }, sleeper)?;
                    return Ok(AdvanceOutcome::AtHorizon(horizon));
                }
                Progress::Finished => {
                    self.timing.sleeps = self.backoff.sleeps;
                    let (next, activity) = (count, Activity::Finished);
                    self.finish_advance(started, Status { next, activity }, status, sleeper)?;
                    self.send_event(&ParticipantEvent::Finished(self.timing.clone()), sleeper)?;
                    return Ok(AdvanceOutcome::Finished);
                }
                // In a process, no participant is paused before its step and no step is left to the caller.
                Progress::Waiting(_) | Progress::BeforeStep | Progress::Deferred => {}
            }
        }
    }

    /// Ends the advance that began at `started`: records its duration, publishes this status and sends the spans.
    fn finish_advance(
        &mut self,
        started: Instant,
        now: Status,
        status: &mut StatusWriter,
        sleeper: &mut Sleeper,
    ) -> Result<(), TransportError> {
        self.timing.total_ns += started.elapsed().as_nanos() as u64;
        status.set(now);
        self.send_all_spans(sleeper)
    }

    /// Pauses before the next poll; returns whether the clock has a command.
    fn wait(
        &mut self,
        wait: Wait,
        waiting: &mut Option<WaitInterval>,
        status: &mut StatusWriter,
        sleeper: &mut Sleeper,
    ) -> Result<bool, HostError> {
        if waiting.is_none_or(|known| known.what != wait) {
            let now = Instant::now();
            let begun = WaitInterval {
                what: wait,
                since: now,
                until: now,
                sleeps: self.backoff.sleeps,
                since_ns: self.spans.as_ref().map_or(0, |_| now_ns()),
            };
            if let Some(known) = waiting.replace(begun) {
                self.add_to_breakdown(WaitInterval { until: now, ..known });
            }
        }
        if self.backoff.is_long_wait() {
            status.set(Status {
                next: self.stepper.next_activation(),
                activity: status_activity(wait),
            });
            if self.clock.command() != Command::Run {
                return Ok(true);
            }
        }
        self.backoff.pause(self.wait_reason(wait), status, sleeper)?;
        if let Some(waiting) = waiting.as_mut().filter(|_| self.backoff.should_read_clock()) {
            waiting.until = Instant::now();
        }
        Ok(false)
    }

    fn step_error(&self, source: StepError) -> HostError {
        HostError::Step {
            activation: self.stepper.next_activation(),
            t: self.stepper.next_seconds(),
            source,
        }
    }

    /// Pauses at the current activation, and reports which one that is.
    pub(super) fn pause(&mut self, status: &mut StatusWriter, sleeper: &mut Sleeper) -> Result<(), HostError> {
        loop {
            let paused = self.stepper.pause();
            if paused.map_err(|source| self.step_error(source))? {
                break;
            }
            if self.clock.command() == Command::Terminate {
                return Ok(());
            }
            sleeper.sleep(RETRY_INTERVAL)?;
        }
        self.backoff.reset(status);
        let next = self.stepper.next_activation();
        let activity = Activity::Paused;
        status.set(Status { next, activity });
        self.send_all_spans(sleeper)?;
        Ok(self.send_event(&ParticipantEvent::Paused { next }, sleeper)?)
    }

    /// Ends the participant's part, and leaves its ends in shared memory to the exit of the process.
    pub(super) fn leave_open(self) {
        let ConnectedParticipant {
            stepper,
            clock,
            record,
            neighbours,
            _links,
            ..
        } = self;
        stepper.leave_open();
        std::mem::forget((clock, record, neighbours, _links));
    }

    fn wait_reason(&self, wait: Wait) -> WaitReason {
        let own = self.stepper.assignment();
        match wait {
            Wait::Sample { input, .. } => Some(WaitReason::for_sample(own.inputs[input].link)),
            Wait::Room { output, consumer } => Some(WaitReason::for_room(own.outputs[output].consumers[consumer].link)),
            Wait::Recording => None,
        }
        .unwrap_or(WaitReason::FOR_ANYTHING)
    }

    fn add_to_breakdown(&mut self, WaitInterval { what, since, until, .. }: WaitInterval) {
        let nanos = (until - since).as_nanos() as u64;
        match what {
            Wait::Sample { input, .. } => self.timing.inputs_ns[input] += nanos,
            Wait::Room { .. } => self.timing.room_ns += nanos,
            Wait::Recording => self.timing.recorder_ns += nanos,
        }
    }

    /// Sends an event to the recorder, after all samples.
    pub(super) fn send_event(&mut self, event: &ParticipantEvent, sleeper: &mut Sleeper) -> Result<(), TransportError> {
        while !self.record.0.borrow_mut().try_append_event(event)? && self.clock.command() != Command::Terminate {
            sleeper.sleep(RETRY_INTERVAL)?;
        }
        Ok(())
    }
}

impl ConnectedParticipant {
    /// Records the spans of a call of the stepper for `activation`, which began at `begun_ns` and returned `progress`; `waiting` is the
    /// wait before it.
    fn record_spans(&mut self, activation: u64, progress: Progress, waiting: Option<WaitInterval>, begun_ns: u64) {
        let Some(spans) = &mut self.spans else { return };
        let now_for = match progress {
            Progress::Waiting(wait) => Some(wait),
            Progress::Stepped
            | Progress::AtHorizon
            | Progress::Finished
            | Progress::BeforeStep
            | Progress::Deferred => None,
        };
        let over = waiting.filter(|waited| Some(waited.what) != now_for);
        if let Some(waited) = over {
            let sleeps = self.backoff.sleeps - waited.sleeps;
            spans.record_wait(
                activation,
                span_activity(waited.what),
                sleeps as u32,
                waited.since_ns,
                begun_ns.max(waited.since_ns),
            );
        }
        match progress {
            Progress::Stepped => spans.record_step(activation, begun_ns, true),
            // The time before the wait belongs to the step.
            Progress::Waiting(Wait::Room { .. } | Wait::Recording) if over.is_some() || waiting.is_none() => {
                spans.record_step(activation, begun_ns, false);
            }
            Progress::Waiting(_)
            | Progress::AtHorizon
            | Progress::Finished
            | Progress::BeforeStep
            | Progress::Deferred => {}
        }
    }

    /// Sends spans as far as there is room, when they are due.
    fn try_send_spans(&mut self) -> Result<(), TransportError> {
        while let Some(spans) = self.spans.as_mut().filter(|spans| spans.is_due())
            && let Some(event) = spans.event()
            && self.record.0.borrow_mut().try_append_event(&event)?
        {
            spans.mark_sent();
        }
        Ok(())
    }

    /// Sends all spans.
    pub(super) fn send_all_spans(&mut self, sleeper: &mut Sleeper) -> Result<(), TransportError> {
        while let Some(event) = self.spans.as_ref().and_then(Spans::event) {
            self.send_event(&event, sleeper)?;
            self.spans.iter_mut().for_each(Spans::mark_sent);
        }
        Ok(())
    }
}

fn span_activity(wait: Wait) -> SpanActivity {
    match wait {
        Wait::Sample { input, index } => SpanActivity::Sample {
            link: input as u32,
            index,
        },
        Wait::Room { output, consumer } => SpanActivity::Room {
            output: output as u32,
            consumer: consumer as u32,
        },
        Wait::Recording => SpanActivity::Recorder,
    }
}

fn status_activity(wait: Wait) -> Activity {
    match wait {
        Wait::Sample { input, index } => Activity::Input {
            input: input as u32,
            index,
        },
        Wait::Room { output, consumer } => Activity::Room {
            output: output as u32,
            consumer: consumer as u32,
        },
        Wait::Recording => Activity::Recorder,
    }
}
