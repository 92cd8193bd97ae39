//! Links over publish-subscribe: one publisher, one subscriber, no overflow.

use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::*;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;

use super::domain::{Domain, DomainError};
use super::{Ipc, broken};
use crate::transport::{Broken, Header, Receiver, Sender};

// SAFETY: `Header` is `repr(C)`, holds two 64-bit integers and nothing else: no pointers, no padding, no drop.
unsafe impl ZeroCopySend for Header {
    unsafe fn type_name() -> &'static str {
        "EscapementHeader"
    }
}

/// The service of one link. Whoever holds it keeps the service alive.
pub struct LinkService {
    factory: PortFactory<Ipc, [u8], Header>,
    size: usize,
    capacity: usize,
}

impl LinkService {
    fn builder(
        domain: &Domain,
        link: u32,
    ) -> Result<iceoryx2::service::builder::publish_subscribe::Builder<[u8], Header, Ipc>, DomainError> {
        let builder = domain
            .service(&format!("link/{link}"))?
            .publish_subscribe::<[u8]>()
            .user_header::<Header>();
        Ok(builder.payload_alignment(Alignment::ALIGN_8))
    }

    /// Creates the service of link number `link` for samples of `size` bytes.
    pub fn create(domain: &Domain, link: u32, size: usize, capacity: usize) -> Result<LinkService, DomainError> {
        let builder = Self::builder(domain, link)?
            .enable_safe_overflow(false)
            .history_size(0)
            .subscriber_max_buffer_size(capacity)
            .subscriber_max_borrowed_samples(1)
            // One of each at a time; a second place, so that a substitute can open before the other has left.
            .max_publishers(2)
            .max_subscribers(2)
            .max_nodes(8);
        let factory = builder
            .create()
            .map_err(|error| domain.failed(format!("creating link {link}"), error))?;
        Ok(LinkService {
            factory,
            size,
            capacity,
        })
    }

    /// Opens the service of link number `link`.
    pub fn open(domain: &Domain, link: u32, size: usize, capacity: usize) -> Result<LinkService, DomainError> {
        let factory = Self::builder(domain, link)?
            .open()
            .map_err(|error| domain.failed(format!("opening link {link}"), error))?;
        Ok(LinkService {
            factory,
            size,
            capacity,
        })
    }

    /// The sending end.
    pub fn sender(&self, domain: &Domain) -> Result<LinkSender, DomainError> {
        let publisher = self
            .factory
            .publisher_builder()
            .initial_max_slice_len(self.size)
            .max_loaned_samples(1)
            // A sample without room is not lost: `try_send` sees that nobody took it, and it is sent again.
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(|error| domain.failed("opening a publisher", error))?;
        Ok(LinkSender {
            publisher,
            size: self.size,
        })
    }

    /// The receiving end.
    pub fn receiver(&self, domain: &Domain) -> Result<LinkReceiver, DomainError> {
        let subscriber = self
            .factory
            .subscriber_builder()
            .buffer_size(self.capacity)
            .create()
            .map_err(|error| domain.failed("opening a subscriber", error))?;
        Ok(LinkReceiver { subscriber })
    }
}

/// The sending end of a link in shared memory.
pub struct LinkSender {
    publisher: Publisher<Ipc, [u8], Header>,
    size: usize,
}

impl Sender for LinkSender {
    fn try_send(&mut self, header: Header, payload: &[u8]) -> Result<bool, Broken> {
        if payload.len() != self.size {
            return Err(Broken(format!(
                "a sample of {} bytes on a link of {}",
                payload.len(),
                self.size
            )));
        }
        let mut sample = self
            .publisher
            .loan_slice_uninit(payload.len())
            .map_err(|e| broken("no memory", e))?;
        *sample.user_header_mut() = header;
        let taken_by = sample
            .write_from_slice(payload)
            .send()
            .map_err(|e| broken("sending", e))?;
        Ok(taken_by > 0)
    }
}

/// The receiving end of a link in shared memory.
pub struct LinkReceiver {
    subscriber: Subscriber<Ipc, [u8], Header>,
}

impl Receiver for LinkReceiver {
    fn try_receive(&mut self, payload: &mut [u8]) -> Result<Option<Header>, Broken> {
        let Some(sample) = self.subscriber.receive().map_err(|e| broken("receiving", e))? else {
            return Ok(None);
        };
        let bytes = sample.payload();
        if bytes.len() != payload.len() {
            return Err(Broken(format!(
                "a sample of {} bytes where {} are expected",
                bytes.len(),
                payload.len()
            )));
        }
        // A copy, so that what is checked is what is used, whatever the sender does to its memory afterwards.
        payload.copy_from_slice(bytes);
        Ok(Some(*sample.user_header()))
    }
}
