//! Taking up a run in mid-course: checkpoints, substitutes, restarts.
//!
//! All of them are one operation. Everybody is at rest somewhere; everybody moves to a fresh place in shared memory and is
//! told where to go on: those who stay with the state that they have or that a checkpoint has, those who are new from afresh
//! or with the state of the one before.

use std::time::{Duration, Instant};

use lockstep::control::{Reply, Request};
use lockstep::plan::Cut;
use lockstep::time::Ticks;
use recorder::tape::{Event, EventKind};

use super::agenda::Business;
use super::checkpoint::Checkpoint;
use super::conduct::{Conductor, GRACE};
use super::crew::{self, Member};
use super::outcome::{Ending, RunFailure};
use super::place::Place;
use super::prepare;
use crate::scenario::{Entry, OnFailure, State};

/// How often somebody may be restarted without getting any further.
const RESTARTS_MAX: u32 = 5;

/// Who sits where when a run is taken up.
enum Seat {
    /// The same process, with this state, or the one it has.
    Same(Option<Vec<u8>>),
    /// A new process, with this state, or from afresh.
    New(Box<Entry>, Option<Vec<u8>>),
}

/// How often a participant was restarted where.
#[derive(Debug, Default, Clone, Copy)]
pub(super) struct Restarts {
    furthest: u64,
    count: u32,
}

impl Conductor<'_> {
    /// Does what the agenda has for `now`, at which everybody is at rest. `Some` when the run is over; the error is a failure
    /// that the run may survive, and then what was not done is still on the agenda.
    pub(super) fn attend(&mut self, now: Ticks) -> Result<Option<Ending>, Ending> {
        while let Some(business) = self.guide.take(now) {
            let done = match business {
                Business::Checkpoint { file } => self.checkpoint(now, file),
                Business::Substitute(number) => self.substitute(now, number),
                Business::Pause => match self.pause(now) {
                    Ok(false) => {
                        let t = self.plan.timebase.seconds(now);
                        let reason = format!("stopped at t = {t} s");
                        return Ok(Some(Ending::Stopped { reason }));
                    }
                    other => other.map(drop),
                },
            };
            done.map_err(|failure| {
                self.guide.put_back(now, business);
                self.over(failure)
            })?;
            self.last_moved = Instant::now();
            if !self.crew.iter().all(|member| member.rests_at(now)) {
                // They were moved and have to come to this rest again.
                break;
            }
        }
        Ok(None)
    }

    /// How a failure of the orchestrator's own work ends the run.
    fn over(&self, failure: RunFailure) -> Ending {
        match failure {
            RunFailure::Participant { participant, reason } => Ending::Failed { participant, reason },
            RunFailure::Interrupted => Ending::Stopped {
                reason: format!(
                    "interrupted at t = {} s",
                    self.plan.timebase.seconds(self.recorder.newest.max(0))
                ),
            },
            other => Ending::Failed {
                participant: "orchestrator".into(),
                reason: other.to_string(),
            },
        }
    }

    fn checkpoint(&mut self, now: Ticks, file: bool) -> Result<(), RunFailure> {
        let mut states = Vec::with_capacity(self.crew.len());
        for member in &mut self.crew {
            states.push(crew::save(member, &self.interrupt)?);
        }
        let checkpoint = Checkpoint {
            version: env!("CARGO_PKG_VERSION").into(),
            time: self.time(now),
            participants: self.plan.participants.iter().map(|own| own.name.clone()).collect(),
            cut: self.plan.cut_at(now),
            states,
            substitutions: self.substituted as u64,
            replaced: self.entries.iter().map(|entry| entry.replaced).collect(),
        };
        if file {
            // The tape first: a checkpoint is of no use without the samples before it.
            self.recorder.flush()?;
            checkpoint.write(&self.folder.checkpoints())?;
        }
        self.last_checkpoint = Some(checkpoint);
        Ok(())
    }

    fn time(&self, ticks: Ticks) -> lockstep::time::Rational {
        self.plan.timebase.time(ticks).unwrap_or_default()
    }

    fn note(&mut self, kind: EventKind, at: Ticks, participant: &str, text: String) -> Result<(), RunFailure> {
        let event = Event {
            time: self.time(at),
            kind,
            participant: Some(participant.to_owned()),
            text,
        };
        Ok(self.recorder.event(&event)?)
    }

    /// The substitution number `number` of the scenario, at `now`.
    fn substitute(&mut self, now: Ticks, number: usize) -> Result<(), RunFailure> {
        let substitution = &self.scenario.substitutions[number];
        let seat = substitution.participant;
        let state = match substitution.state {
            State::Cold => None,
            State::Keep => Some(crew::save(&mut self.crew[seat], &self.interrupt)?),
        };
        let entry = substitution.entry(&self.scenario.participants[seat]);
        let cut = self.plan.cut_at(now);
        let event = prepare::substitution_event(&self.plan, now, &cut, seat, &entry, substitution.state);
        self.take_up_at(&cut, seat, entry, state)?;
        self.substituted = number + 1;
        self.last_checkpoint = None;
        Ok(self.recorder.event(&event)?)
    }

    fn take_up_at(&mut self, cut: &Cut, seat: usize, entry: Entry, state: Option<Vec<u8>>) -> Result<(), RunFailure> {
        let mut new = Some((entry, state));
        let seats = (0..self.crew.len())
            .map(|number| match new.take_if(|_| number == seat) {
                Some((entry, state)) => Seat::New(Box::new(entry), state),
                None => Seat::Same(None),
            })
            .collect();
        self.take_up(cut, seats)
    }

    /// Moves everybody to a fresh place, where they go on at `cut`.
    fn take_up(&mut self, cut: &Cut, seats: Vec<Seat>) -> Result<(), RunFailure> {
        let left = self.place.address().clone();
        self.scope.move_on()?;
        let names = self.plan.participants.iter().map(|own| own.name.as_str());
        let (domain, ports) = Place::enter(self.scope.address(), names)?;
        // If anything fails from here on, whoever is in these hands is brought down with them.
        let mut old = std::mem::take(&mut self.crew);
        let address = domain.address().to_string();
        for (member, seat) in old.iter_mut().zip(&seats) {
            if let Seat::Same(_) = seat {
                let address = address.clone();
                match member.ask(&Request::Move { address }, &self.interrupt)? {
                    Reply::Done => {}
                    Reply::Refused { reason, .. } => {
                        return Err(member.odd(format!("cannot take part in a substitution or a restart: {reason}")));
                    }
                    other => return Err(member.odd(format!("answered the request to move with {other:?}"))),
                }
            }
        }
        self.place.clock.stop();
        old.iter().for_each(Member::ring);
        let (mut crew, mut states) = (Vec::new(), Vec::new());
        let mut newcomers = Vec::new();
        for ((mut member, seat), ports) in old.into_iter().zip(seats).zip(ports) {
            let (process, state) = match seat {
                Seat::Same(state) => {
                    newcomers.push(None);
                    (member.process, state)
                }
                Seat::New(entry, state) => {
                    member.process.bring_down(GRACE);
                    self.programs += 1;
                    let log = self.folder.stderr(&format!("{}.{}", entry.setup.name, self.programs));
                    let process = crew::start(&entry, &domain, &log)?;
                    newcomers.push(Some(entry));
                    (process, state)
                }
            };
            crew.push(Member::new(process, ports));
            states.push(state);
        }
        crew::gather(&mut crew, &self.interrupt)?;
        let seated = crew.iter_mut().zip(&newcomers).zip(&self.plan.participants);
        for ((member, newcomer), own) in seated {
            match newcomer {
                None => crew::greet(member, &self.interrupt)?,
                Some(entry) => {
                    crew::introduce(self.scenario, entry, Some(&own.interface), member, &self.interrupt)?;
                }
            }
        }
        self.place = Place::furnish(domain, &self.plan)?;
        self.scope.clear(&left);
        let positions = prepare::positions(&self.plan, cut, &self.recorder.played()?, states)?;
        crew::connect(&self.plan, &mut crew, Some(positions), self.options, &self.interrupt)?;
        self.crew = crew;
        for (entry, newcomer) in self.entries.iter_mut().zip(newcomers) {
            if let Some(newcomer) = newcomer {
                *entry = *newcomer;
            }
        }
        self.last_moved = Instant::now();
        Ok(())
    }

    /// What the scenario says about the failure in `ending`: goes on, or gives the ending back.
    pub(super) fn survive(&mut self, ending: Ending) -> Result<(), Ending> {
        let Ending::Failed { participant, reason } = &ending else {
            return Err(ending);
        };
        let Some(number) = self.plan.participant(participant) else {
            return Err(ending);
        };
        let policy = self.entries[number].on_failure.clone();
        if policy == OnFailure::Stop || self.crew.is_empty() {
            return Err(ending);
        }
        let furthest = self.crew[number].status().next;
        let restarts = &mut self.restarts[number];
        if furthest > restarts.furthest {
            *restarts = Restarts { furthest, count: 0 };
        }
        restarts.count += 1;
        if restarts.count > RESTARTS_MAX {
            let (participant, reason) = (
                participant.clone(),
                format!("{reason}\n(restarted {RESTARTS_MAX} times without getting any further)"),
            );
            return Err(Ending::Failed { participant, reason });
        }
        self.progress.say(&format!("participant `{participant}` {reason}"));
        let result = self.recall(number).and_then(|()| match &policy {
            OnFailure::Restart => self.restart(number, reason),
            OnFailure::Substitute(program) => {
                let entry = self.entries[number].replaced_by(program);
                self.replace(number, entry, reason)
            }
            OnFailure::Stop => Ok(()),
        });
        result.map_err(|failure| match failure {
            // What went wrong first is what matters most.
            RunFailure::Interrupted => self.over(RunFailure::Interrupted),
            second => Ending::Failed {
                participant: participant.clone(),
                reason: format!("{reason}\nand the run could not be taken up: {second}"),
            },
        })
    }

    /// Ends what is left of participant number `dead`, and brings everybody else to rest.
    fn recall(&mut self, dead: usize) -> Result<(), RunFailure> {
        self.crew[dead].process.bring_down(Duration::ZERO);
        self.crew[dead].failed = None;
        // What it had handed over counts, up to what was wrong with it.
        while let Ok(true) = self.crew[dead].take(dead, &mut self.recorder) {}
        self.place.clock.recall();
        let started = Instant::now();
        loop {
            let mut left = false;
            for number in (0..self.crew.len()).filter(|&number| number != dead) {
                let member = &mut self.crew[number];
                member.ring();
                while member
                    .take(number, &mut self.recorder)
                    .map_err(|broken| member.odd(broken.0))?
                {}
                if member.failed.is_some() || (member.recalled.is_none() && member.process.ended().is_some()) {
                    return Err(member.odd("failed too"));
                }
                left |= member.recalled.is_none();
            }
            if !left {
                return Ok(());
            }
            if self.interrupt.asked() {
                return Err(RunFailure::Interrupted);
            }
            if started.elapsed().as_secs_f64() > self.options.patience_s {
                let busy = self.crew.iter().position(|member| member.recalled.is_none());
                return Err(self.crew[busy.unwrap_or(dead)].odd("did not come to rest"));
            }
            std::thread::sleep(Duration::from_micros(300));
        }
    }

    /// Everybody goes back to the last checkpoint; participant number `dead` in a new process.
    fn restart(&mut self, dead: usize, why: &str) -> Result<(), RunFailure> {
        let Some(checkpoint) = self.last_checkpoint.clone() else {
            return Err(RunFailure::Other(
                "there is no checkpoint since the last substitution".into(),
            ));
        };
        let mut seats = Vec::new();
        for (number, state) in checkpoint.states.into_iter().enumerate() {
            seats.push(if number == dead {
                Seat::New(Box::new(self.entries[number].clone()), Some(state))
            } else {
                Seat::Same(Some(state))
            });
        }
        self.recorder.expect_again()?;
        self.take_up(&checkpoint.cut, seats)?;
        let name = self.plan.participants[dead].name.clone();
        let first = why.lines().next().unwrap_or_default();
        let text = format!("restarted from the checkpoint at t = {}: it {first}", checkpoint.time);
        let newest = self.recorder.newest.max(0);
        self.progress.say(&format!("participant `{name}` {text}"));
        self.note(EventKind::Restart, newest, &name, text)
    }

    /// Another program takes over from participant number `dead`, where that one had come to.
    fn replace(&mut self, dead: usize, entry: Entry, why: &str) -> Result<(), RunFailure> {
        let mut next = Vec::new();
        for (number, member) in self.crew.iter().enumerate() {
            next.push(match member.recalled.filter(|_| number != dead) {
                Some(next) => next,
                None => self
                    .recorder
                    .activations(number)
                    .unwrap_or_else(|| member.status().next),
            });
        }
        let at = self.plan.participants[dead].sample_time.instant(next[dead]);
        let cut = Cut { next };
        let first = why.lines().next().unwrap_or_default();
        let text = format!(
            "{} takes over at activation {} from afresh: the one before {first}",
            entry.program, cut.next[dead]
        );
        let name = entry.setup.name.clone();
        // What the one before had been shown last is shown to the substitute again.
        self.recorder.expect_again()?;
        self.take_up_at(&cut, dead, entry, None)?;
        self.last_checkpoint = None;
        self.progress.say(&format!("participant `{name}`: {text}"));
        self.note(EventKind::Substitution, at, &name, text)
    }
}
