//! The orchestrator's ends of the services of one participant.

use lockstep::transport::iceoryx::{
    ControlClient, Domain, DomainError, RecordReceiver, StatusReader, StatusService, WakeNotifier, WakeService,
};

/// The orchestrator's ends of the services of one participant in one domain in shared memory. They exist before the participant
/// opens them.
pub(crate) struct Ports {
    pub(crate) status: StatusReader,
    pub(crate) notifier: WakeNotifier,
    pub(crate) record: RecordReceiver,
    pub(crate) control: ControlClient,
    _services: (StatusService, WakeService),
}

impl Ports {
    /// Creates the services of the participant `name`, one of `count`.
    pub(crate) fn create(domain: &Domain, name: &str, count: usize) -> Result<Ports, DomainError> {
        let services = (
            StatusService::create(domain, name, count + 1)?,
            WakeService::create(domain, name, count + 1)?,
        );
        Ok(Ports {
            control: ControlClient::create(domain, name)?,
            record: RecordReceiver::create(domain, name)?,
            status: StatusReader::open(domain, name)?,
            notifier: services.1.notifier(domain)?,
            _services: services,
        })
    }
}
