//! The shortest round trip that iceoryx2 can do, as the reference for this transport: a typed payload, two services, polling only.

use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;

use super::domain::{Domain, DomainError};
use super::ipc::{Ipc, transport_error};
use crate::transport::interface::TransportError;

/// The payload in each direction: as many doubles as a measured state of the stock plant.
pub type Payload = [f64; 27];

/// One end of a bare ping-pong.
pub struct BarePingPong {
    publisher: Publisher<Ipc, Payload, ()>,
    subscriber: Subscriber<Ipc, Payload, ()>,
    _services: [PortFactory<Ipc, Payload, ()>; 2],
}

impl BarePingPong {
    /// Opens one of the two ends; either may be opened first.
    pub fn open(domain: &Domain, first: bool) -> Result<BarePingPong, DomainError> {
        let service = |name: &str| {
            let builder = domain
                .service(name)?
                .publish_subscribe::<Payload>()
                .enable_safe_overflow(false);
            builder
                .open_or_create()
                .map_err(|error| domain.failed("opening a bare service", error))
        };
        let (ping, pong) = (service("bare/ping")?, service("bare/pong")?);
        let (to, from) = if first { (&ping, &pong) } else { (&pong, &ping) };
        let subscriber = from
            .subscriber_builder()
            .create()
            .map_err(|e| domain.failed("opening a subscriber", e))?;
        let publisher = to
            .publisher_builder()
            .create()
            .map_err(|e| domain.failed("opening a publisher", e))?;
        Ok(BarePingPong {
            publisher,
            subscriber,
            _services: [ping, pong],
        })
    }

    /// Sends; returns whether a receiver took the payload.
    pub fn send(&self, payload: &Payload) -> Result<bool, TransportError> {
        let sample = self
            .publisher
            .loan_uninit()
            .map_err(|error| transport_error("no memory", error))?;
        Ok(sample
            .write_payload(*payload)
            .send()
            .map_err(|error| transport_error("sending", error))?
            > 0)
    }

    /// Polls once.
    pub fn receive(&self) -> Result<Option<Payload>, TransportError> {
        Ok(self
            .subscriber
            .receive()
            .map_err(|error| transport_error("receiving", error))?
            .map(|sample| *sample))
    }
}
