//! Taking up a run in mid-course: checkpoints, substitutes, and the move that all of it rests on.
//!
//! Everybody is at rest somewhere; everybody moves to a fresh place in shared memory and is told where to go on: those who
//! stay with the state that they have or that a checkpoint has, those who are new from afresh or with the state of the one
//! before. Whoever fails on the way is missing when the others have arrived, and that is a failure like any other.

use std::time::Instant;

use lockstep::plan::Cut;
use lockstep::time::{Rational, Ticks};

use super::agenda::Business;
use super::awake::Awake;
use super::checkpoint::Checkpoint;
use super::conduct::{Conductor, GRACE};
use super::crew::{self, Member};
use super::outcome::{Ending, ORCHESTRATOR, RunFailure};
use super::place::Place;
use super::placement::Placement;
use super::prepare;
use super::room;
use super::survive::Fallen;
use crate::scenario::{Entry, State};

/// Who sits where when a run is taken up.
pub(super) enum Seat {
    /// The same process, with this state, or the one it has.
    Same(Option<Vec<u8>>),
    /// A new process, with this state, or from afresh.
    New(Box<Entry>, Option<Vec<u8>>),
}

impl Conductor<'_> {
    /// Does what the agenda has for `now`, at which everybody is at rest. `Some` when the run is over; the error is a failure
    /// that the run may survive, and then what was not done is still on the agenda.
    pub(super) fn attend(&mut self, now: Ticks) -> Result<Option<Ending>, Ending> {
        while let Some(business) = self.guide.take(now) {
            let done = match business {
                Business::Checkpoint { file } => self.checkpoint(now, file).map(|()| Vec::new()),
                Business::Substitute(number) => self.substitute(now, number),
                Business::Pause => match self.pause(now) {
                    Ok(false) => {
                        let t = self.plan.timebase.seconds(now);
                        let reason = format!("stopped at t = {t} s");
                        return Ok(Some(Ending::Stopped { reason }));
                    }
                    other => other.map(|_| Vec::new()),
                },
            };
            let fallen = done.map_err(|failure| {
                self.guide.put_back(now, business);
                self.over(failure)
            })?;
            self.patience.renew();
            if let Some(first) = fallen.first() {
                let ending = Ending::Failed {
                    participant: self.plan.participants[first.number].name.clone(),
                    reason: first.reason.clone(),
                };
                self.fallen = fallen;
                return Err(ending);
            }
            if !self.crew.iter().all(|member| member.rests_at(now)) {
                // They were moved and have to come to this rest again.
                break;
            }
        }
        Ok(None)
    }

    /// How a failure of the orchestrator's own work ends the run.
    pub(super) fn over(&self, failure: RunFailure) -> Ending {
        match failure {
            RunFailure::Participant { participant, reason } => Ending::Failed { participant, reason },
            RunFailure::Interrupted => Ending::Stopped {
                reason: format!(
                    "interrupted at t = {} s",
                    self.plan.timebase.seconds(self.recorder.newest.max(0))
                ),
            },
            other => Ending::Failed {
                participant: ORCHESTRATOR.into(),
                reason: other.to_string(),
            },
        }
    }

    fn checkpoint(&mut self, now: Ticks, file: bool) -> Result<(), RunFailure> {
        let checkpoint = self.saved(self.time(now), self.recorder.cut_at(now))?;
        if file {
            // The tape first: a checkpoint is of no use without the samples before it.
            self.recorder.flush()?;
            checkpoint.write(&self.folder.checkpoints())?;
        }
        self.last_checkpoint = Some(checkpoint);
        Ok(())
    }

    /// The state of the run, with everybody at rest at `cut`.
    pub(super) fn saved(&mut self, time: Rational, cut: Cut) -> Result<Checkpoint, RunFailure> {
        let states = self.crew.iter_mut().map(|member| crew::save(member, &self.monitor));
        let states = states.collect::<Result<_, _>>()?;
        Ok(Checkpoint::new(
            &self.plan,
            time,
            cut,
            states,
            self.substituted,
            &self.entries,
        ))
    }

    pub(super) fn time(&self, ticks: Ticks) -> Rational {
        self.plan.timebase.time(ticks).unwrap_or_default()
    }

    /// The substitution number `number` of the scenario, at `now`.
    fn substitute(&mut self, now: Ticks, number: usize) -> Result<Vec<Fallen>, RunFailure> {
        let substitution = &self.scenario.substitutions[number];
        let seat = substitution.participant;
        let state = match substitution.state {
            State::Cold => None,
            State::Keep => Some(crew::save(&mut self.crew[seat], &self.monitor)?),
        };
        let entry = substitution.entry.clone();
        let cut = self.recorder.cut_at(now);
        let event = prepare::substitution_event(&self.plan, now, &cut, seat, &entry, substitution.state);
        let mut new = Some((entry, state));
        let seats = (0..self.crew.len())
            .map(|number| match new.take_if(|_| number == seat) {
                Some((entry, state)) => Seat::New(Box::new(entry), state),
                None => Seat::Same(None),
            })
            .collect();
        let fallen = self.take_up(&cut, seats)?;
        self.substituted = number + 1;
        self.recorder.renew(seat);
        self.recorder.event(&event)?;
        if fallen.is_empty() && self.scenario.restarts() {
            // A restart need not go back to before it.
            let checkpoint = self.saved(self.time(now), cut);
            match checkpoint {
                Ok(checkpoint) => self.last_checkpoint = Some(checkpoint),
                Err(failure) => return self.fallen(failure).map(|one| vec![one]),
            }
        }
        Ok(fallen)
    }

    /// The participant whose failure `failure` is; the others are the orchestrator's own.
    pub(super) fn fallen(&self, failure: RunFailure) -> Result<Fallen, RunFailure> {
        let (participant, reason) = match failure {
            RunFailure::Participant { participant, reason } => (participant, reason),
            other => return Err(other),
        };
        match self.plan.participant(&participant) {
            Some(number) => Ok(Fallen { number, reason }),
            None => Err(RunFailure::Participant { participant, reason }),
        }
    }

    /// Moves everybody to a fresh place, where they go on at `cut`, and gives those who failed on the way. The others have
    /// arrived and are at rest.
    ///
    /// # Errors
    /// What has nothing to do with a participant; then nobody is left.
    pub(super) fn take_up(&mut self, cut: &Cut, seats: Vec<Seat>) -> Result<Vec<Fallen>, RunFailure> {
        room::enough_to_move(&self.plan)?;
        let left = self.place.address().clone();
        self.scope.move_on()?;
        let names = self.plan.participants.iter().map(|own| own.name.as_str());
        let (domain, ports) = Place::enter(self.scope.address(), names)?;
        // If anything else fails from here on, whoever is in these hands is brought down with them.
        let mut old = std::mem::take(&mut self.crew);
        let mut missing = Missing::default();
        let address = domain.address().to_string();
        for (number, (member, seat)) in old.iter_mut().zip(&seats).enumerate() {
            if let Seat::Same(_) = seat {
                missing.unless(number, member, |member| crew::send_to(member, &address, &self.monitor))?;
            }
        }
        self.place.clock.stop();
        old.iter().for_each(Member::ring);
        let (mut crew, mut states) = (Vec::new(), Vec::new());
        let mut newcomers = Vec::new();
        for (number, ((mut member, seat), ports)) in old.into_iter().zip(seats).zip(ports).enumerate() {
            let (newcomer, state) = match seat {
                Seat::Same(state) => (None, state),
                Seat::New(entry, state) => {
                    member.process.bring_down(GRACE);
                    self.programs += 1;
                    let log = self.folder.stderr(&format!("{}.{}", entry.setup.name, self.programs));
                    missing.unless(number, &mut member, |member| {
                        member.process = crew::start(self.scenario, &entry, &domain, &log)?;
                        Ok(())
                    })?;
                    (Some(entry), state)
                }
            };
            let within = crew::start_within(newcomer.as_deref().unwrap_or(&self.entries[number]), self.options);
            crew.push(Member::new(member.process, ports, within));
            newcomers.push(newcomer);
            states.push(state);
        }
        let mut waited = Awake::since(Instant::now());
        for (number, (member, newcomer)) in crew.iter_mut().zip(&newcomers).enumerate() {
            missing.unless(number, member, |member| {
                crew::arrive(member, &mut waited, &self.monitor)?;
                match newcomer {
                    None => crew::greet(member, &self.monitor),
                    Some(entry) => {
                        let known = &self.plan.participants[number].interface;
                        crew::introduce(self.scenario, entry, Some(known), member, &self.monitor).map(drop)
                    }
                }
            })?;
        }
        self.place = Place::furnish(domain, &self.plan)?;
        self.scope.clear(&left);
        let positions = prepare::positions(&self.plan, cut, &self.recorder.played()?, states)?;
        let placement = Placement::choose(&self.plan, self.options);
        let rings = room::rings_now(&self.plan)?;
        for (number, (member, position)) in crew.iter_mut().zip(positions).enumerate() {
            missing.unless(number, member, |member| {
                let position = Some(position);
                let ring = rings[number];
                crew::connect(&self.plan, number, member, position, &placement, ring, &self.monitor)
            })?;
        }
        self.crew = crew;
        self.recorder.stand_at(cut);
        for (entry, newcomer) in self.entries.iter_mut().zip(newcomers) {
            if let Some(newcomer) = newcomer {
                *entry = *newcomer;
            }
        }
        self.patience.renew();
        Ok(missing.0)
    }
}

/// Who failed on the way to a fresh place.
#[derive(Default)]
struct Missing(Vec<Fallen>);

impl Missing {
    /// Does the next step of the way with participant number `number`, unless it is missing already. If that fails, it is
    /// missing from now on, and its process is ended.
    fn unless(
        &mut self,
        number: usize,
        member: &mut Member,
        step: impl FnOnce(&mut Member) -> Result<(), RunFailure>,
    ) -> Result<(), RunFailure> {
        if self.0.iter().any(|one| one.number == number) {
            return Ok(());
        }
        let reason = match step(member) {
            Ok(()) => return Ok(()),
            Err(RunFailure::Participant { reason, .. }) => reason,
            // Its parameters are refused, which only the program itself can tell.
            Err(RunFailure::Scenario(error)) => error.to_string(),
            Err(other) => return Err(other),
        };
        member.process.bring_down(std::time::Duration::ZERO);
        self.0.push(Fallen { number, reason });
        Ok(())
    }
}
