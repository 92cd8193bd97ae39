//! Relocation: moves a run to a new domain in shared memory, where it resumes; for participants in processes.
//!
//! All participants are paused. Each moves to the new domain and receives the activation at which it continues: a participant
//! that stays keeps its state or gets that of a checkpoint; a new program starts cold or with the state of its predecessor. A
//! participant that fails during the move is missing when the others have arrived; this is handled like any other failure.

use std::time::Instant;

use lockstep::plan::Cut;

use super::child::GRACE;
use super::executor::Processes;
use super::handshake;
use super::participants::{self, ParticipantHandle};
use super::placement::Placement;
use super::resources;
use super::run_services::{PlannedServices, RunServices};
use crate::run::executor::Slot;
use crate::run::failed::FailedParticipant;
use crate::run::outcome::RunFailure;
use crate::run::state::RunState;
use crate::run::timeout::ActiveTime;
use crate::scenario::Entry;

impl Processes {
    /// Moves all participants to a new domain, where they continue at `cut`, and returns those that failed during the move. The
    /// others have arrived and are paused.
    ///
    /// # Errors
    /// A failure that no participant caused; then no participant is left.
    pub(crate) fn relocate(
        &mut self,
        run_state: &mut RunState,
        cut: &Cut,
        slots: Vec<Slot>,
    ) -> Result<Vec<FailedParticipant>, RunFailure> {
        resources::check_relocation(&run_state.plan)?;
        let folder = run_state
            .folder
            .clone()
            .ok_or_else(|| RunFailure::Other("the run has no folder for logs".into()))?;
        let old_address = self.services.address().clone();
        self.scope.next_domain()?;
        let names = run_state.plan.participants.iter().map(|planned| planned.name.as_str());
        let (domain, ports) = RunServices::enter_domain(self.scope.address(), names)?;
        // If anything else fails from here on, the participants in `old` and `handles` are shut down when these are dropped.
        let mut old = std::mem::take(&mut self.handles);
        let mut failed = FailedMoves::default();
        let address = domain.address().to_string();
        for (number, (handle, slot)) in old.iter_mut().zip(&slots).enumerate() {
            match slot {
                Slot::Same(_) => failed.run_step(number, handle, |handle| {
                    handshake::request_move(handle, &address, &self.monitor)
                })?,
                Slot::New(..) => handshake::notify_replaced(handle, &self.monitor),
            }
        }
        self.services.clock.terminate();
        old.iter().for_each(ParticipantHandle::wake);
        let (mut handles, mut states) = (Vec::new(), Vec::new());
        let mut replacements = Vec::new();
        for (number, ((mut handle, slot), ports)) in old.into_iter().zip(slots).zip(ports).enumerate() {
            let (replacement, state) = match slot {
                Slot::Same(state) => (None, state),
                Slot::New(entry, state) => {
                    handle.process.shut_down(GRACE);
                    self.programs += 1;
                    let log = folder.stderr(&format!("{}.{}", entry.setup.name, self.programs));
                    failed.run_step(number, &mut handle, |handle| {
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
                replacement.as_deref().unwrap_or(&run_state.entries[number]),
                &run_state.options,
            );
            handles.push(ParticipantHandle::new(handle.process, ports, within));
            replacements.push(replacement);
            states.push(state);
        }
        self.await_all(run_state, &mut handles, &replacements, &mut failed)?;
        let planned = PlannedServices::create(&domain, &run_state.plan)?;
        self.services = RunServices::new(domain, planned);
        self.scope.clear(&old_address);
        self.connect(run_state, cut, &mut handles, states, &mut failed)?;
        self.handles = handles;
        run_state.recorder().continue_at(cut);
        for (entry, replacement) in run_state.entries.iter_mut().zip(replacements) {
            if let Some(replacement) = replacement {
                *entry = *replacement;
            }
        }
        self.periodic.stall_timeout.restart();
        Ok(failed.0)
    }

    /// Connects all participants in the new domain, where they continue at `cut` with `states`.
    fn connect(
        &self,
        run_state: &RunState,
        cut: &Cut,
        handles: &mut [ParticipantHandle],
        states: Vec<Option<Vec<u8>>>,
        failed: &mut FailedMoves,
    ) -> Result<(), RunFailure> {
        let mut positions = run_state.positions(cut)?;
        for (position, state) in positions.iter_mut().zip(states) {
            position.state = state;
        }
        let placement = Placement::choose(&run_state.plan, &run_state.options);
        let rings = resources::ring_sizes_now(&run_state.plan)?;
        let connector = handshake::Connector {
            placement: &placement,
            rings: &rings,
            monitor: &self.monitor,
        };
        let parts = run_state.plan.assignments().zip(positions);
        for (number, (handle, (assignment, position))) in handles.iter_mut().zip(parts).enumerate() {
            failed.run_step(number, handle, |handle| {
                connector.connect_one(number, handle, assignment, Some(position))
            })?;
        }
        Ok(())
    }

    /// Waits until all participants have entered the new domain, and sends them the hello request; new programs also describe their
    /// ports.
    fn await_all(
        &self,
        run_state: &RunState,
        handles: &mut [ParticipantHandle],
        replacements: &[Option<Box<Entry>>],
        failed: &mut FailedMoves,
    ) -> Result<(), RunFailure> {
        let mut waited = ActiveTime::since(Instant::now());
        for (number, (handle, replacement)) in handles.iter_mut().zip(replacements).enumerate() {
            failed.run_step(number, handle, |handle| {
                participants::await_entry(handle, &mut waited, &self.monitor)?;
                match replacement {
                    None => handshake::send_hello(handle, &self.monitor),
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

/// The participants that failed during the move to a new domain.
#[derive(Default)]
struct FailedMoves(Vec<FailedParticipant>);

impl FailedMoves {
    /// Performs the next step of the move for participant number `number`, unless it is missing already. If the step fails, the
    /// participant is missing from now on, and its process is ended.
    fn run_step(
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
        handle.process.shut_down(std::time::Duration::ZERO);
        self.0.push(FailedParticipant { number, reason });
        Ok(())
    }
}
