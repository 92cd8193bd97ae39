//! Relocation: moves a run to a fresh place in shared memory, where it resumes; for participants in processes.
//!
//! All participants are at rest. Each moves to the fresh place and receives the activation at which it continues: a participant
//! that stays keeps its state or gets that of a checkpoint; a new program starts cold or with the state of its predecessor. A
//! participant that fails during the move is missing when the others have arrived; this is handled like any other failure.

use std::time::Instant;

use lockstep::plan::Cut;

use super::child::GRACE;
use super::executor::Processes;
use super::handshake;
use super::participants::{self, ParticipantHandle};
use super::place::Place;
use super::placement::Placement;
use super::resources;
use crate::run::executor::Slot;
use crate::run::failed::FailedParticipant;
use crate::run::outcome::RunFailure;
use crate::run::state::RunState;
use crate::run::timeout::Awake;
use crate::scenario::Entry;

impl Processes {
    /// Moves all participants to a fresh place, where they continue at `cut`, and returns those that failed during the move. The
    /// others have arrived and are at rest.
    ///
    /// # Errors
    /// A failure that no participant caused; then no participant is left.
    pub(crate) fn relocate(
        &mut self,
        run_state: &mut RunState,
        cut: &Cut,
        slots: Vec<Slot>,
    ) -> Result<Vec<FailedParticipant>, RunFailure> {
        resources::enough_to_move(&run_state.plan)?;
        let folder = run_state
            .folder
            .clone()
            .ok_or_else(|| RunFailure::Other("the run has no folder for logs".into()))?;
        let left = self.place.address().clone();
        self.scope.move_on()?;
        let names = run_state.plan.participants.iter().map(|own| own.name.as_str());
        let (domain, ports) = Place::enter(self.scope.address(), names)?;
        // If anything else fails from here on, the participants in `old` and `handles` are shut down when these are dropped.
        let mut old = std::mem::take(&mut self.handles);
        let mut missing = Missing::default();
        let address = domain.address().to_string();
        for (number, (handle, slot)) in old.iter_mut().zip(&slots).enumerate() {
            match slot {
                Slot::Same(_) => missing.unless(number, handle, |handle| {
                    handshake::send_to(handle, &address, &self.monitor)
                })?,
                Slot::New(..) => handshake::tell_replaced(handle, &self.monitor),
            }
        }
        self.place.clock.terminate();
        old.iter().for_each(ParticipantHandle::ring);
        let (mut handles, mut states) = (Vec::new(), Vec::new());
        let mut newcomers = Vec::new();
        for (number, ((mut handle, slot), ports)) in old.into_iter().zip(slots).zip(ports).enumerate() {
            let (newcomer, state) = match slot {
                Slot::Same(state) => (None, state),
                Slot::New(entry, state) => {
                    handle.process.bring_down(GRACE);
                    self.programs += 1;
                    let log = folder.stderr(&format!("{}.{}", entry.setup.name, self.programs));
                    missing.unless(number, &mut handle, |handle| {
                        handle.process = participants::start(
                            &run_state.scenario,
                            &entry,
                            &domain,
                            &log,
                            run_state.options.detail(),
                        )?;
                        Ok(())
                    })?;
                    (Some(entry), state)
                }
            };
            let within = participants::start_within(
                newcomer.as_deref().unwrap_or(&run_state.entries[number]),
                &run_state.options,
            );
            handles.push(ParticipantHandle::new(handle.process, ports, within));
            newcomers.push(newcomer);
            states.push(state);
        }
        self.receive(run_state, &mut handles, &newcomers, &mut missing)?;
        self.place = Place::create_services(domain, &run_state.plan)?;
        self.scope.clear(&left);
        self.connect(run_state, cut, &mut handles, states, &mut missing)?;
        self.handles = handles;
        run_state.recorder().stand_at(cut);
        for (entry, newcomer) in run_state.entries.iter_mut().zip(newcomers) {
            if let Some(newcomer) = newcomer {
                *entry = *newcomer;
            }
        }
        self.rounds.patience.renew();
        Ok(missing.0)
    }

    /// Connects all participants at the new place, where they continue at `cut` with `states`.
    fn connect(
        &self,
        run_state: &RunState,
        cut: &Cut,
        handles: &mut [ParticipantHandle],
        states: Vec<Option<Vec<u8>>>,
        missing: &mut Missing,
    ) -> Result<(), RunFailure> {
        let mut positions = run_state.positions(cut)?;
        for (position, state) in positions.iter_mut().zip(states) {
            position.state = state;
        }
        let placement = Placement::choose(&run_state.plan, &run_state.options);
        let rings = resources::rings_now(&run_state.plan)?;
        let connecting = handshake::Connecting {
            placement: &placement,
            rings: &rings,
            monitor: &self.monitor,
        };
        let parts = run_state.plan.assignments().zip(positions);
        for (number, (handle, (assignment, position))) in handles.iter_mut().zip(parts).enumerate() {
            missing.unless(number, handle, |handle| {
                connecting.one(number, handle, assignment, Some(position))
            })?;
        }
        Ok(())
    }

    /// Waits until all participants have entered the new place, and greets them; new programs are also asked for their ports.
    fn receive(
        &self,
        run_state: &RunState,
        handles: &mut [ParticipantHandle],
        newcomers: &[Option<Box<Entry>>],
        missing: &mut Missing,
    ) -> Result<(), RunFailure> {
        let mut waited = Awake::since(Instant::now());
        for (number, (handle, newcomer)) in handles.iter_mut().zip(newcomers).enumerate() {
            missing.unless(number, handle, |handle| {
                participants::arrive(handle, &mut waited, &self.monitor)?;
                match newcomer {
                    None => handshake::say_hello(handle, &self.monitor),
                    Some(entry) => {
                        let known = &run_state.plan.participants[number].interface;
                        handshake::handshake_one(&run_state.scenario, entry, Some(known), handle, &self.monitor)
                            .map(drop)
                    }
                }
            })?;
        }
        Ok(())
    }
}

/// The participants that failed during the move to a fresh place.
#[derive(Default)]
struct Missing(Vec<FailedParticipant>);

impl Missing {
    /// Performs the next step of the move for participant number `number`, unless it is missing already. If the step fails, the
    /// participant is missing from now on, and its process is ended.
    fn unless(
        &mut self,
        number: usize,
        handle: &mut ParticipantHandle,
        step: impl FnOnce(&mut ParticipantHandle) -> Result<(), RunFailure>,
    ) -> Result<(), RunFailure> {
        if self.0.iter().any(|one| one.number == number) {
            return Ok(());
        }
        let reason = match step(handle) {
            Ok(()) => return Ok(()),
            Err(RunFailure::Participant { reason, .. }) => reason,
            // The program refused its parameters, which only the program itself can detect.
            Err(RunFailure::Scenario(error)) => error.to_string(),
            Err(other) => return Err(other),
        };
        handle.process.bring_down(std::time::Duration::ZERO);
        self.0.push(FailedParticipant { number, reason });
        Ok(())
    }
}
