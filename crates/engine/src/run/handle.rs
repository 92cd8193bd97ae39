//! A run that is driven from code: started, let on from rest to rest, looked at, changed, taken back, ended.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use lockstep::participant::Payload;
use lockstep::port::Message;
use lockstep::time::{Rational, Ticks};
use tape::folder::{Claim, RunFolder};
use tape::{Event, EventKind};
use toml::{Table, Value};

use super::agenda::Agenda;
use super::attend::{self, attend};
use super::checkpoint;
use super::course::Course;
use super::executor::{Executor, Turn};
use super::horizon::Guide;
use super::inputs::{self, Inputs};
use super::monitor::Monitor;
use super::newest::{Sample, no_field};
use super::outcome::{Ending, Outcome, RunFailure};
use super::prepare::{self, Ready};
use super::recording::streams;
use super::store::{Record, no_samples};
use super::{Options, in_process, instants, room, set_up};
use crate::observer::Event as Report;
use crate::scenario::{Program, Scenario, payload};
use crate::scope;

/// A run under way, which rests until it is told to go on.
///
/// It belongs to the thread that starts it. When it is dropped its processes end, and nothing of it stays in shared memory; what
/// is in its folder can be read up to the last complete sample, but has no seal. [`Run::end`] is the end in order.
///
/// Nothing of it writes to standard streams or handles signals.
pub struct Run {
    // Dropped first: the recorder must outlive whoever records.
    executor: Box<dyn Executor>,
    course: Course,
    /// Everybody has done exactly what lies before this instant.
    now: Ticks,
    over: Option<Over>,
    /// Values were set that the participants do not have yet.
    unseen: bool,
    /// The number of this run in this process.
    number: u64,
    /// The checkpoints that the run can go back to, oldest first.
    saves: Vec<u64>,
    saved: u64,
    wall: Duration,
}

/// How a run has come to its end.
struct Over {
    ending: Ending,
    known: Instant,
}

/// The state of a [`Run`] at an instant, in memory.
#[derive(Debug, Clone)]
pub struct Checkpoint {
    state: checkpoint::Checkpoint,
    inputs: Inputs,
    told: usize,
    now: Ticks,
    run: u64,
    number: u64,
}

impl Checkpoint {
    /// The instant: everybody has done exactly the activations before it.
    pub fn time(&self) -> Rational {
        self.state.time
    }

    /// The state that participant `name` saved.
    pub fn state(&self, name: &str) -> Option<&[u8]> {
        let number = self.state.participants.iter().position(|own| own == name)?;
        self.state.states.get(number).map(Vec::as_slice)
    }
}

/// An instant, as code names it: exactly, or as a scenario would.
pub trait Instantlike {
    /// The instant.
    ///
    /// # Errors
    /// When a text is no time.
    fn instant(&self) -> Result<Rational, RunFailure>;
}

impl Instantlike for Rational {
    fn instant(&self) -> Result<Rational, RunFailure> {
        Ok(*self)
    }
}

impl Instantlike for &str {
    fn instant(&self) -> Result<Rational, RunFailure> {
        self.parse().map_err(|error| RunFailure::Instant {
            time: (*self).to_owned(),
            reason: format!("is not a time: {error}; write such as \"2.5 s\" or \"1/300 s\""),
        })
    }
}

impl Run {
    /// Starts a run of `scenario`: everybody is there, has published what exists before the first activation, and rests.
    ///
    /// # Errors
    /// What keeps the run from starting; then it has left nothing, unless there was something to record.
    pub fn start(scenario: &Scenario, options: &Options) -> Result<Run, RunFailure> {
        let mut run = Run::begin(Arc::new(scenario.clone()), options.clone())?;
        run.course.recorder().keep_newest();
        let from = run.now;
        run.go(Some(from));
        match run.over.take() {
            None => Ok(run),
            Some(Over { ending, .. }) => match ending {
                Ending::Failed { participant, reason } => Err(RunFailure::Participant { participant, reason }),
                Ending::Complete | Ending::Stopped { .. } => Err(RunFailure::Interrupted),
            },
        }
    }

    /// Everything before the first step.
    pub(crate) fn begin(scenario: Arc<Scenario>, options: Options) -> Result<Run, RunFailure> {
        instants::check(scenario.duration, &options)?;
        options.check_record()?;
        // Whatever can be refused is refused before anything starts or is written.
        let made = if options.in_process {
            scenario.make_here()?
        } else {
            scenario.make()?
        };
        let (known, made) = prepare::checked(&scenario, made)?;
        let entries = prepare::entries(&scenario, &options)?;
        let participants = if options.in_process {
            Some(in_process::seated(&scenario, &options, &entries, made)?)
        } else {
            drop(made);
            refuse_inside_a_participant(&scenario)?;
            scope::leftovers().iter().for_each(scope::Leftover::remove);
            room::check(&known.plan, scenario.moves())?;
            None
        };
        let mut claim = match options.record {
            Record::Folder => Some(prepare::folder(&scenario, &options)?),
            Record::Memory | Record::Digest | Record::Nothing => None,
        };
        let folder = claim.as_ref().map(|claim| claim.folder().clone());
        let made: Result<(Ready, Making), RunFailure> = match (participants, &folder) {
            (Some(participants), folder) => {
                let plan = Arc::new(known.plan);
                prepare::recorder(&scenario, &plan, options.record, folder.as_ref()).and_then(|mut recorder| {
                    let start = prepare::start(&scenario, &plan, &options, &mut recorder)?;
                    let recovered = Vec::new();
                    let ready = Ready {
                        entries,
                        plan,
                        recorder,
                        start,
                        recovered,
                    };
                    Ok((ready, Making::Here(participants)))
                })
            }
            (None, Some(folder)) => {
                let monitor = Monitor::new(options.interrupt.clone());
                let (interfaces, plan) = (&known.interfaces, &known.plan);
                set_up::set_up(&scenario, &options, interfaces, plan, entries, folder, &monitor)
                    .map(|(ready, processes)| (ready, Making::Done(Box::new(processes))))
            }
            (None, None) => Err(no_samples()),
        };
        let run = made.and_then(|(ready, making)| Run::of(scenario, options, ready, making, folder));
        // One that was refused leaves nothing in its folder.
        if run.as_ref().err().is_none_or(|failure| failure.exit_code() != 2) {
            claim.iter_mut().for_each(Claim::settle);
        }
        run
    }

    fn of(
        scenario: Arc<Scenario>,
        options: Options,
        ready: Ready,
        making: Making,
        folder: Option<RunFolder>,
    ) -> Result<Run, RunFailure> {
        static RUNS: AtomicU64 = AtomicU64::new(0);
        let Ready {
            entries,
            plan,
            recorder,
            start,
            recovered,
        } = ready;
        let (from, substituted) = (start.from, start.substituted);
        let agenda = Agenda::new(&scenario, &plan, &options, from, substituted)?;
        let recorder = Arc::new(Mutex::new(recorder));
        let executor: Box<dyn Executor> = match making {
            Making::Here(participants) => {
                let looped = in_process::set_up(&plan, &entries, from, start.positions, &recorder, participants)?;
                Box::new(looped)
            }
            Making::Done(processes) => processes,
        };
        options.begin(&plan, folder.as_ref());
        let course = Course {
            guide: Guide::new(&plan, &options, agenda, from),
            entries,
            substituted,
            inputs: start.inputs,
            // What a run goes on from is good for going back to as well, until its first own checkpoint.
            last_checkpoint: options.origin.as_ref().map(|origin| origin.checkpoint.clone()),
            recovered,
            folder,
            recorder,
            scenario,
            options,
            plan,
        };
        Ok(Run {
            executor,
            course,
            now: from,
            over: None,
            unseen: false,
            number: RUNS.fetch_add(1, Ordering::Relaxed),
            saves: Vec::new(),
            saved: 0,
            wall: Duration::ZERO,
        })
    }

    /// Lets the run on until everybody rests at `bound`, or to its end.
    pub(super) fn go(&mut self, bound: Option<Ticks>) {
        if self.over.is_some() {
            return;
        }
        let started = Instant::now();
        let bound = bound.filter(|bound| *bound < self.course.plan.end);
        self.course.guide.drive_to(bound);
        self.course.guide.go_on();
        self.executor.renew_patience();
        let ending = self.conduct(bound);
        self.now = bound.unwrap_or(self.course.plan.end);
        if let Some(ending) = ending {
            let newest = self.course.newest().clamp(0, self.course.plan.end);
            if ending != Ending::Complete {
                self.now = newest;
            }
            let known = Instant::now();
            self.over = Some(Over { ending, known });
        }
        self.wall += started.elapsed();
    }

    /// The one loop of every run: turns, rests, and failures that are survived. Gives the ending when the run is over.
    fn conduct(&mut self, bound: Option<Ticks>) -> Option<Ending> {
        let Run { executor, course, .. } = self;
        let executor = executor.as_mut();
        let mut shown = !std::mem::take(&mut self.unseen);
        loop {
            let turn = if shown {
                executor.turn(course)
            } else {
                shown = true;
                show_inputs(executor, course, self.now).map(|()| Turn::Going)
            };
            let done = turn.and_then(|turn| match turn {
                Turn::Going => Ok(None),
                Turn::Over(ending) => Ok(Some(Some(ending))),
                Turn::Rests(now) => {
                    let ending = attend(executor, course, now)?;
                    let rests = bound == Some(now) && course.guide.is_free(now) && executor.rests_at(now);
                    Ok(ending.map(Some).or(rests.then_some(None)))
                }
            });
            match done {
                Ok(None) => {}
                Ok(Some(done)) => return done,
                Err(failed) => {
                    if let Err(ending) = executor.survive(course, failed) {
                        return Some(ending);
                    }
                }
            }
        }
    }

    /// Everybody has done exactly the activations before this instant.
    pub fn now(&self) -> Rational {
        self.course.time(self.now)
    }

    /// The same, s.
    pub fn now_s(&self) -> f64 {
        self.course.plan.timebase.seconds(self.now)
    }

    /// Whether nothing more happens: the run has come to its end, or has failed.
    pub fn is_over(&self) -> bool {
        self.over.is_some()
    }

    /// Lets the run on until everybody has done exactly the activations before `time`, rounded up to the plan's tick, and rests.
    ///
    /// # Errors
    /// [`RunFailure::Instant`] for a time that lies behind or after the end, [`RunFailure::Over`] when the run is over before it
    /// gets there; [`Run::end`] says how.
    pub fn run_to(&mut self, time: impl Instantlike) -> Result<(), RunFailure> {
        let time = time.instant()?;
        let refuse = |reason: String| {
            let time = time.to_string();
            Err(RunFailure::Instant { time, reason })
        };
        let plan = &self.course.plan;
        let ticks = match plan.timebase.ceil(time) {
            Ok(ticks) if time <= self.course.scenario.duration => ticks.min(plan.end),
            _ => {
                return refuse(format!(
                    "lies behind the end of the run at {}",
                    self.course.scenario.duration
                ));
            }
        };
        if ticks < self.now {
            return refuse(format!(
                "has passed: the run rests at {}; `restore` goes back",
                self.now()
            ));
        }
        self.on_to(ticks)
    }

    /// Lets the run on to the next communication point after now, and rests there; at the end of the run after the last one.
    ///
    /// # Errors
    /// As [`Run::run_to`].
    pub fn step(&mut self) -> Result<(), RunFailure> {
        let (plan, now) = (&self.course.plan, self.now);
        let next = plan.participants.iter().filter_map(|own| {
            let next = own.sample_time.count_before(now.saturating_add(1));
            (next < own.activations).then(|| own.sample_time.instant(next))
        });
        let next = next.min().unwrap_or(plan.end);
        if self.over.is_none() && now >= plan.end {
            return Err(self.ended());
        }
        self.on_to(next)
    }

    fn on_to(&mut self, ticks: Ticks) -> Result<(), RunFailure> {
        if self.over.is_some() {
            return Err(self.ended());
        }
        if ticks > self.now {
            self.go(Some(ticks));
        }
        match &self.over {
            None => Ok(()),
            Some(Over { ending, .. }) if *ending == Ending::Complete => Ok(()),
            Some(_) => Err(self.ended()),
        }
    }

    fn ended(&self) -> RunFailure {
        let how = self.over.as_ref().and_then(|over| over.ending.words());
        RunFailure::Over {
            how: how.unwrap_or_else(|| format!("it has come to its end at {}", self.now())),
        }
    }

    /// The newest sample of `PARTICIPANT.OUTPUT`, as the participant gave it out, before any fault. A sampled participant's is
    /// stamped before now, a continuous one's at or after now.
    ///
    /// # Errors
    /// When there is no such output, or no sample of it yet.
    pub fn newest(&self, port: &str) -> Result<Sample, RunFailure> {
        let streams = streams(&self.course.plan);
        let refuse = |reason: String| RunFailure::Port {
            port: port.to_owned(),
            reason,
        };
        let number = streams.iter().position(|spec| spec.name() == port);
        let number = number.ok_or_else(|| {
            let known: Vec<String> = streams.iter().map(|spec| format!("`{}`", spec.name())).collect();
            refuse(format!("there is no such output; there is {}", known.join(", ")))
        })?;
        let recorder = self.course.recorder();
        let (header, payload) = recorder
            .newest_of(number)
            .ok_or_else(|| refuse(format!("has no sample yet at t = {}", self.now())))?;
        Ok(Sample {
            name: port.to_owned(),
            descriptor: streams[number].descriptor.clone(),
            index: header.index,
            stamp_s: self.course.plan.timebase.seconds(header.stamp),
            payload: payload.clone(),
        })
    }

    /// Sets `PARTICIPANT.INPUT`, which nobody feeds, to `value`: the activations at or after now see it, until it is set again. An
    /// event on the tape says so.
    ///
    /// # Errors
    /// [`RunFailure::Port`] when there is no such input, when it is fed (and by whom), when its payload has other fields than `M`,
    /// and for a number that is not finite; [`RunFailure::Over`].
    pub fn set<M: Message>(&mut self, port: &str, value: &M) -> Result<(), RunFailure> {
        let (participant, input) = inputs::find(&self.course.plan, port)?;
        let descriptor = &self.course.plan.participants[participant].interface.inputs[input].descriptor;
        if let Some(difference) = M::descriptor().difference(descriptor) {
            return Err(RunFailure::Port {
                port: port.to_owned(),
                reason: format!("its payload is no `{}`: {difference}", M::descriptor().name),
            });
        }
        self.set_bytes(port, Payload::of(value).bytes())
    }

    /// The same with fields by their names, each with its elements row-major in the field's unit; fields that are not named are
    /// zero.
    ///
    /// # Errors
    /// As [`Run::set`]; also for an unknown field and another number of elements.
    pub fn set_fields(&mut self, port: &str, fields: &[(&str, &[f64])]) -> Result<(), RunFailure> {
        let (participant, input) = inputs::find(&self.course.plan, port)?;
        let descriptor = &self.course.plan.participants[participant].interface.inputs[input].descriptor;
        let refuse = |reason: String| RunFailure::Port {
            port: port.to_owned(),
            reason,
        };
        let mut table = Table::new();
        for (name, values) in fields {
            if descriptor.field(name).is_none() {
                return Err(refuse(no_field(descriptor, name)));
            }
            let values = values.iter().copied().map(Value::Float).collect();
            table.insert((*name).to_owned(), Value::Array(values));
        }
        let bytes = payload(&Value::Table(table), descriptor).map_err(refuse)?;
        self.set_bytes(port, &bytes)
    }

    /// The same with the bytes of the payload.
    ///
    /// # Errors
    /// As [`Run::set`]; also for another size.
    pub fn set_bytes(&mut self, port: &str, bytes: &[u8]) -> Result<(), RunFailure> {
        let input = inputs::find(&self.course.plan, port)?;
        if self.over.is_some() {
            return Err(self.ended());
        }
        let descriptor = &self.course.plan.participants[input.0].interface.inputs[input.1].descriptor;
        let refuse = |reason: String| RunFailure::Port {
            port: port.to_owned(),
            reason,
        };
        if bytes.len() != descriptor.size as usize {
            let reason = format!("its payload has {} bytes, not {}", descriptor.size, bytes.len());
            return Err(refuse(reason));
        }
        for field in &descriptor.fields {
            let odd = (0..field.len()).find(|&at| !field.value(bytes, at).is_finite());
            if let Some(at) = odd {
                let (name, value) = (field.element_name(at), field.value(bytes, at));
                return Err(refuse(format!(
                    "cannot be set to {name} = {value}: a value must be finite"
                )));
            }
        }
        let event = inputs::event(&self.course.plan, self.now(), input, bytes);
        self.course.recorder().event(&event)?;
        self.course.inputs.insert(input, bytes.to_owned());
        self.unseen = true;
        Ok(())
    }

    /// The state of the run now.
    ///
    /// # Errors
    /// When a participant cannot save its state; when the run keeps no samples to go back to ([`Record`]); [`RunFailure::Over`].
    pub fn save(&mut self) -> Result<Checkpoint, RunFailure> {
        if self.over.is_some() {
            return Err(self.ended());
        }
        let (cut, told) = {
            let recorder = self.course.recorder();
            recorder.check_samples()?;
            (recorder.cut_at(self.now), recorder.told())
        };
        let time = self.now();
        let state = attend::saved(self.executor.as_mut(), &self.course, time, cut)?;
        self.saved += 1;
        self.saves.push(self.saved);
        Ok(Checkpoint {
            state,
            inputs: self.course.inputs.clone(),
            told,
            now: self.now,
            run: self.number,
            number: self.saved,
        })
    }

    /// Goes back to `checkpoint`, which this run has saved: everybody has its state of then, and the tape, the figures and the
    /// events are cut back to there. Also after the end of the run, as long as nobody has failed.
    ///
    /// # Errors
    /// When the checkpoint is another run's, or when the run has gone back to before it since: then the samples that lead to it
    /// are no longer there.
    pub fn restore(&mut self, checkpoint: &Checkpoint) -> Result<(), RunFailure> {
        let time = checkpoint.time();
        let refuse = |reason: &str| {
            let reason = reason.to_owned();
            let time = time.to_string();
            Err(RunFailure::Instant { time, reason })
        };
        if checkpoint.run != self.number {
            return refuse("is the instant of a checkpoint of another run: a run goes back to its own alone");
        }
        if !self.saves.contains(&checkpoint.number) {
            return refuse(
                "is the instant of a checkpoint that the run has left behind: it has gone back to before it, and what led to it is \
                 no longer recorded",
            );
        }
        if self.over.as_ref().is_some_and(|over| over.ending != Ending::Complete) {
            return Err(self.ended());
        }
        let restored = self.go_back(checkpoint);
        if let Err(failure) = &restored {
            let ending = Ending::own(failure.to_string());
            let known = Instant::now();
            self.over = Some(Over { ending, known });
        }
        restored
    }

    fn go_back(&mut self, checkpoint: &Checkpoint) -> Result<(), RunFailure> {
        let course = &mut self.course;
        let state = &checkpoint.state;
        let (assessment, watches) = prepare::judges(&course.scenario, &course.plan, &streams(&course.plan))?;
        let (cut, told) = (&state.cut, checkpoint.told);
        course.recorder().cut_back(cut, told, assessment, watches)?;
        course.inputs.clone_from(&checkpoint.inputs);
        course.substituted = usize::try_from(state.substitutions).unwrap_or(usize::MAX);
        let agenda = Agenda::new(
            &course.scenario,
            &course.plan,
            &course.options,
            checkpoint.now,
            course.substituted,
        )?;
        let seats = prepare::seats_at(course, state, |_| false);
        let fallen = self.executor.take_up(course, cut, seats, true)?;
        if let Some(first) = fallen.first() {
            return Err(RunFailure::Participant {
                participant: course.name(first.number).to_owned(),
                reason: first.reason.clone(),
            });
        }
        course.guide.go_back(agenda, checkpoint.now);
        course.last_checkpoint = course.scenario.restarts().then(|| state.clone());
        self.executor.went_back(checkpoint.now);
        (self.now, self.over, self.unseen) = (checkpoint.now, None, false);
        self.saves.retain(|save| *save <= checkpoint.number);
        Ok(())
    }

    /// Ends the run, here if it has not come to its end: the tape is sealed, and the figures are those of the samples so far.
    ///
    /// # Errors
    /// When the summary cannot be written.
    pub fn end(mut self) -> Result<Outcome, RunFailure> {
        if self.over.is_none() {
            let ending = Ending::Stopped {
                reason: format!("ended at t = {} s", self.now_s()),
            };
            let known = Instant::now();
            self.over = Some(Over { ending, known });
        }
        let outcome = self.conclude();
        if let Some(folder) = &outcome.folder {
            let folder = RunFolder::open(folder);
            folder.write_json(&folder.summary(), &outcome.summary())?;
        }
        Ok(outcome)
    }

    /// Sets again what `events` of another run's tape say was set, each at its time, as far as this run has the inputs.
    pub(crate) fn repeat_inputs(&mut self, events: &[Event]) -> Result<(), RunFailure> {
        for event in events.iter().filter(|event| event.kind == EventKind::Input) {
            let there = event.participant.as_ref();
            let there = there.is_some_and(|name| self.course.plan.participant(name).is_some());
            if !there || self.over.is_some() || event.time >= self.course.scenario.duration {
                continue;
            }
            let (input, payload) = inputs::read(&self.course.plan, event).map_err(RunFailure::Other)?;
            let ticks = self.course.plan.timebase.ceil(event.time);
            self.go(Some(ticks.map_err(|error| RunFailure::Other(error.to_string()))?));
            if self.over.is_none() {
                self.course.recorder().event(event)?;
                self.course.inputs.insert(input, payload);
                self.unseen = true;
            }
        }
        Ok(())
    }

    /// Lets the run on to its end.
    pub(crate) fn finish(mut self) -> Outcome {
        self.go(None);
        self.conclude()
    }

    fn conclude(mut self) -> Outcome {
        let course = &mut self.course;
        course.options.progress.report(Report::Over);
        self.executor.bring_down(course);
        let account = self.executor.account();
        drop(self.executor);
        let known = self.over.as_ref().map_or_else(Instant::now, |over| over.known);
        let ending = self.over.map_or(Ending::Complete, |over| over.ending);
        let Course {
            plan,
            recorder,
            folder,
            recovered,
            ..
        } = self.course;
        let recorder = Arc::into_inner(recorder).expect("the participants are gone");
        let mut recorder = recorder.into_inner().unwrap_or_else(PoisonError::into_inner);
        // A tape that cannot be written is the fault of no participant.
        let ending = match recorder.take_error() {
            Some(error) => Ending::own(error.to_string()),
            None => ending,
        };
        if let Ending::Failed { participant, reason } = &ending {
            // A full disk has no room for the event either; the reason is told all the same.
            let _ = recorder.event(&Event {
                time: plan.timebase.time(recorder.newest.max(0)).unwrap_or_default(),
                kind: EventKind::Failure,
                participant: Some(participant.clone()),
                text: reason.clone(),
            });
        }
        let simulated_s = plan.timebase.seconds(recorder.newest.clamp(0, plan.end));
        let ending = recorder.with_active_faults(ending);
        let (sealed, figures) = recorder.finish();
        let (ending, digest) = Outcome::sealed(ending, sealed);
        Outcome {
            folder: folder.map(|folder| folder.root().to_owned()),
            ending,
            simulated_s,
            wall_s: self.wall.as_secs_f64(),
            known,
            digest,
            recovered,
            figures,
            sources: prepare::sources(&plan),
            timing: account.timing,
            placement: account.placement,
        }
    }
}

/// A program that is started again as a participant of its own run, and starts that run again, would never end.
fn refuse_inside_a_participant(scenario: &Scenario) -> Result<(), RunFailure> {
    let own = scenario
        .programs()
        .any(|program| matches!(program, Program::Builtin(_)));
    match std::env::var(lockstep::host::PARTICIPANT) {
        Ok(name) if own => Err(RunFailure::Other(format!(
            "this process was started as the participant `{name}` of a run: let the program's `main` begin with `Program::main`, which \
             becomes the participant, or run in this process"
        ))),
        _ => Ok(()),
    }
}

/// Who does the steps of a run, as far as they are there.
enum Making {
    Here(Vec<Box<dyn lockstep::participant::Participant>>),
    Done(Box<super::processes::Processes>),
}

/// Inputs that nobody feeds get the values that were set.
fn show_inputs(executor: &mut dyn Executor, course: &mut Course, now: Ticks) -> Result<(), Ending> {
    let cut = course.recorder().cut_at(now);
    let shown = executor.show_inputs(course, &cut).and_then(|mut fallen| {
        if fallen.is_empty() {
            fallen.extend(attend::keep_for_restarts(executor, course, course.time(now), cut)?);
        }
        Ok(fallen)
    });
    let fallen = shown.map_err(|failure| course.over(failure))?;
    attend::fell(executor, course, fallen)
}
