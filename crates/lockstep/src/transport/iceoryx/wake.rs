//! Waking a sleeping participant.

use std::time::Duration;

use iceoryx2::port::listener::{Listener, ListenerWaitError};
use iceoryx2::port::notifier::Notifier;
use iceoryx2::service::port_factory::event::PortFactory;

use super::domain::{Domain, DomainError};
use super::ipc::{Ipc, transport_error};
use super::status::StatusReader;
use crate::transport::interface::TransportError;
use crate::transport::lock_free::wait_reason::{Sleep, WaitReason};

fn name(participant: &str) -> String {
    format!("wake/{participant}")
}

/// The event of one participant; the orchestrator holds it from before the participant starts.
pub struct WakeService(PortFactory<Ipc>);

impl WakeService {
    /// Creates the event of `participant` for up to `wakers` other processes.
    pub fn create(domain: &Domain, participant: &str, wakers: usize) -> Result<WakeService, DomainError> {
        let service = domain
            .service(&name(participant))?
            .event()
            .event_id_max_value(1)
            .max_notifiers(wakers)
            .max_listeners(2)
            .max_nodes(wakers + 2)
            .create();
        Ok(WakeService(service.map_err(|error| {
            domain.failed(format!("creating the wake-up of `{participant}`"), error)
        })?))
    }

    /// A notifier that wakes the participant whatever it is doing, for the orchestrator.
    pub fn notifier(&self, domain: &Domain) -> Result<WakeNotifier, DomainError> {
        Ok(WakeNotifier(
            self.0
                .notifier_builder()
                .create()
                .map_err(|error| domain.failed("opening a notifier", error))?,
        ))
    }
}

/// Wakes one participant unconditionally.
pub struct WakeNotifier(Notifier<Ipc>);

impl WakeNotifier {
    /// Notifies the participant, whether it sleeps or not.
    pub fn notify(&self) {
        // A missing listener is not an error: a participant that has left needs no waking.
        let _ = self.0.notify();
    }
}

/// The sleeping participant's end.
pub struct Sleeper {
    listener: Listener<Ipc>,
    _service: PortFactory<Ipc>,
}

impl Sleeper {
    /// Opens the participant's own event.
    pub fn open(domain: &Domain, participant: &str) -> Result<Sleeper, DomainError> {
        let failed =
            |error: &dyn std::fmt::Debug| domain.failed(format!("opening the wake-up of `{participant}`"), error);
        let service = domain
            .service(&name(participant))?
            .event()
            .open()
            .map_err(|error| failed(&error))?;
        let listener = service.listener_builder().create().map_err(|error| failed(&error))?;
        Ok(Sleeper {
            listener,
            _service: service,
        })
    }

    /// Sleeps until woken, or for `limit`.
    pub fn sleep(&mut self, limit: Duration) -> Result<(), TransportError> {
        match self.listener.timed_wait(|_| {}, limit) {
            // A signal, such as that of a debugger, counts as a wake-up.
            Ok(_) | Err(ListenerWaitError::InterruptSignal) => Ok(()),
            Err(error) => Err(transport_error("sleeping", error)),
        }
    }
}

impl Sleep for Sleeper {
    fn sleep(&mut self, limit: Duration) -> Result<(), TransportError> {
        Sleeper::sleep(self, limit)
    }
}

/// The end of a process for which the participant may be waiting.
pub struct Waker {
    status: StatusReader,
    notifier: Notifier<Ipc>,
    _service: PortFactory<Ipc>,
}

impl Waker {
    /// Opens the event of `participant`.
    pub fn open(domain: &Domain, participant: &str) -> Result<Waker, DomainError> {
        let failed =
            |error: &dyn std::fmt::Debug| domain.failed(format!("opening the wake-up of `{participant}`"), error);
        let service = domain
            .service(&name(participant))?
            .event()
            .open()
            .map_err(|error| failed(&error))?;
        let notifier = service.notifier_builder().create().map_err(|error| failed(&error))?;
        Ok(Waker {
            status: StatusReader::open(domain, participant)?,
            notifier,
            _service: service,
        })
    }

    /// Wakes the participant if it sleeps for a condition for which `occurred` is true. To be called after that has been published; costs
    /// one read of its row while it is awake.
    pub fn wake(&self, occurred: impl Fn(WaitReason) -> bool) {
        if self.status.must_be_woken(occurred) {
            let _ = self.notifier.notify();
        }
    }
}
