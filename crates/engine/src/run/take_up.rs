//! Relocation: moves a run in mid-course to a fresh place in shared memory, where it resumes; for participants in processes.
//!
//! All participants are at rest. Each moves to the fresh place and receives the activation at which it continues: a participant
//! that stays keeps its state or gets that of a checkpoint; a new program starts cold or with the state of its predecessor. A
//! participant that fails during the move is missing when the others have arrived; this is handled like any other failure.

use std::time::Instant;

use lockstep::plan::Cut;

use super::awake::Awake;
use super::child::GRACE;
use super::course::Course;
use super::crew::{self, Member};
use super::executor::Seat;
use super::fallen::Fallen;
use super::handshake;
use super::outcome::RunFailure;
use super::place::Place;
use super::placement::Placement;
use super::processes::Processes;
use super::room;
use crate::scenario::Entry;

impl Processes {
    /// Moves all participants to a fresh place, where they continue at `cut`, and returns those that failed during the move. The
    /// others have arrived and are at rest.
    ///
    /// # Errors
    /// A failure that no participant caused; then no participant is left.
    pub(super) fn move_everybody(
        &mut self,
        course: &mut Course,
        cut: &Cut,
        seats: Vec<Seat>,
    ) -> Result<Vec<Fallen>, RunFailure> {
        room::enough_to_move(&course.plan)?;
        let folder = course
            .folder
            .clone()
            .ok_or_else(|| RunFailure::Other("the run has no folder for logs".into()))?;
        let left = self.place.address().clone();
        self.scope.move_on()?;
        let names = course.plan.participants.iter().map(|own| own.name.as_str());
        let (domain, ports) = Place::enter(self.scope.address(), names)?;
        // If anything else fails from here on, the participants in `old` and `crew` are shut down when these are dropped.
        let mut old = std::mem::take(&mut self.crew);
        let mut missing = Missing::default();
        let address = domain.address().to_string();
        for (number, (member, seat)) in old.iter_mut().zip(&seats).enumerate() {
            match seat {
                Seat::Same(_) => missing.unless(number, member, |member| {
                    handshake::send_to(member, &address, &self.monitor)
                })?,
                Seat::New(..) => handshake::tell_replaced(member, &self.monitor),
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
                    let log = folder.stderr(&format!("{}.{}", entry.setup.name, self.programs));
                    missing.unless(number, &mut member, |member| {
                        member.process = crew::start(&course.scenario, &entry, &domain, &log, course.options.detail())?;
                        Ok(())
                    })?;
                    (Some(entry), state)
                }
            };
            let within = crew::start_within(newcomer.as_deref().unwrap_or(&course.entries[number]), &course.options);
            crew.push(Member::new(member.process, ports, within));
            newcomers.push(newcomer);
            states.push(state);
        }
        self.receive(course, &mut crew, &newcomers, &mut missing)?;
        self.place = Place::furnish(domain, &course.plan)?;
        self.scope.clear(&left);
        let mut positions = course.positions(cut)?;
        for (position, state) in positions.iter_mut().zip(states) {
            position.state = state;
        }
        let placement = Placement::choose(&course.plan, &course.options);
        let rings = room::rings_now(&course.plan)?;
        let connecting = handshake::Connecting {
            placement: &placement,
            rings: &rings,
            monitor: &self.monitor,
        };
        let parts = course.plan.assignments().zip(positions);
        for (number, (member, (assignment, position))) in crew.iter_mut().zip(parts).enumerate() {
            missing.unless(number, member, |member| {
                connecting.one(number, member, assignment, Some(position))
            })?;
        }
        self.crew = crew;
        course.recorder().stand_at(cut);
        for (entry, newcomer) in course.entries.iter_mut().zip(newcomers) {
            if let Some(newcomer) = newcomer {
                *entry = *newcomer;
            }
        }
        self.rounds.patience.renew();
        Ok(missing.0)
    }

    /// Waits until all participants have entered the new place, and greets them; new programs are also asked for their ports.
    fn receive(
        &self,
        course: &Course,
        crew: &mut [Member],
        newcomers: &[Option<Box<Entry>>],
        missing: &mut Missing,
    ) -> Result<(), RunFailure> {
        let mut waited = Awake::since(Instant::now());
        for (number, (member, newcomer)) in crew.iter_mut().zip(newcomers).enumerate() {
            missing.unless(number, member, |member| {
                crew::arrive(member, &mut waited, &self.monitor)?;
                match newcomer {
                    None => handshake::greet(member, &self.monitor),
                    Some(entry) => {
                        let known = &course.plan.participants[number].interface;
                        handshake::introduce(&course.scenario, entry, Some(known), member, &self.monitor).map(drop)
                    }
                }
            })?;
        }
        Ok(())
    }
}

/// The participants that failed during the move to a fresh place.
#[derive(Default)]
struct Missing(Vec<Fallen>);

impl Missing {
    /// Performs the next step of the move for participant number `number`, unless it is missing already. If the step fails, the
    /// participant is missing from now on, and its process is ended.
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
            // The program refused its parameters, which only the program itself can detect.
            Err(RunFailure::Scenario(error)) => error.to_string(),
            Err(other) => return Err(other),
        };
        member.process.bring_down(std::time::Duration::ZERO);
        self.0.push(Fallen { number, reason });
        Ok(())
    }
}
