//! The horizon and the order to all participants: a small blackboard that all processes read at any time and only the orchestrator
//! writes.

use iceoryx2::port::reader::{EntryHandle, Reader};
use iceoryx2::port::writer::{EntryHandleMut, Writer};
use iceoryx2::service::port_factory::blackboard::PortFactory;

use super::domain::{Domain, DomainError};
use super::ipc::Ipc;
use crate::time::Ticks;
use crate::transport::lock_free::clock::{self, GO_ON, Horizon, Order};

const SERVICE: &str = "clock";
const HORIZON: u64 = 0;
const ORDER: u64 = 1;

/// The orchestrator's end. No participant does anything before the horizon is moved for the first time.
pub struct ClockWriter {
    horizon: EntryHandleMut<Ipc, u64, i64>,
    order: EntryHandleMut<Ipc, u64, u64>,
    now: Horizon,
    _writer: Writer<Ipc, u64>,
    _service: PortFactory<Ipc, u64>,
}

impl ClockWriter {
    /// Creates the clock for up to `readers` participants.
    pub fn create(domain: &Domain, readers: usize) -> Result<ClockWriter, DomainError> {
        let failed = |error: &dyn std::fmt::Debug| domain.failed("creating the clock", error);
        let service = domain
            .service(SERVICE)?
            .blackboard_creator::<u64>()
            .add::<i64>(HORIZON, Ticks::MIN)
            .add::<u64>(ORDER, GO_ON)
            .max_readers(readers)
            .max_nodes(readers + 1)
            .create()
            .map_err(|error| failed(&error))?;
        let writer = service.writer_builder().create().map_err(|error| failed(&error))?;
        Ok(ClockWriter {
            horizon: writer.entry::<i64>(&HORIZON).map_err(|error| failed(&error))?,
            order: writer.entry::<u64>(&ORDER).map_err(|error| failed(&error))?,
            now: Horizon::START,
            _writer: writer,
            _service: service,
        })
    }

    /// Moves the horizon; it only goes forward.
    pub fn extend(&mut self, horizon: Ticks) {
        self.now.extend(&self.horizon, horizon);
    }

    /// The horizon.
    pub fn horizon(&self) -> Ticks {
        self.now.now()
    }

    /// Orders all participants to leave at the next opportunity.
    pub fn stop(&mut self) {
        clock::give(&self.order, Order::Leave);
    }

    /// Orders all participants to come to rest at their current activation.
    pub fn recall(&mut self) {
        clock::give(&self.order, Order::Rest);
    }
}

/// A participant's end.
pub struct ClockReader {
    horizon: EntryHandle<Ipc, u64, i64>,
    order: EntryHandle<Ipc, u64, u64>,
    _reader: Reader<Ipc, u64>,
    _service: PortFactory<Ipc, u64>,
}

impl ClockReader {
    /// Opens the clock.
    pub fn open(domain: &Domain) -> Result<ClockReader, DomainError> {
        let failed = |error: &dyn std::fmt::Debug| domain.failed("opening the clock", error);
        let service = domain
            .service(SERVICE)?
            .blackboard_opener::<u64>()
            .open()
            .map_err(|error| failed(&error))?;
        let reader = service.reader_builder().create().map_err(|error| failed(&error))?;
        Ok(ClockReader {
            horizon: reader.entry::<i64>(&HORIZON).map_err(|error| failed(&error))?,
            order: reader.entry::<u64>(&ORDER).map_err(|error| failed(&error))?,
            _reader: reader,
            _service: service,
        })
    }

    /// The horizon; [`Ticks::MIN`] before the run starts.
    pub fn horizon(&self) -> Ticks {
        *self.horizon.get()
    }

    /// The order to all participants.
    pub fn order(&self) -> Order {
        clock::order(&self.order)
    }
}
