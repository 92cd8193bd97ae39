//! The horizon and the command to all participants: a small blackboard that all processes read at any time and only the orchestrator
//! writes.

use iceoryx2::port::reader::{EntryHandle, Reader};
use iceoryx2::port::writer::{EntryHandleMut, Writer};
use iceoryx2::service::port_factory::blackboard::PortFactory;

use super::domain::{Domain, DomainError};
use super::ipc::Ipc;
use crate::time::Ticks;
use crate::transport::lock_free::clock::{self, Command, Horizon, RUN};

const SERVICE: &str = "clock";
const HORIZON: u64 = 0;
const COMMAND: u64 = 1;

/// The orchestrator's end. No participant does anything before the horizon is moved for the first time.
pub struct ClockWriter {
    horizon: EntryHandleMut<Ipc, u64, i64>,
    command: EntryHandleMut<Ipc, u64, u64>,
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
            .add::<u64>(COMMAND, RUN)
            .max_readers(readers)
            .max_nodes(readers + 1)
            .create()
            .map_err(|error| failed(&error))?;
        let writer = service.writer_builder().create().map_err(|error| failed(&error))?;
        Ok(ClockWriter {
            horizon: writer.entry::<i64>(&HORIZON).map_err(|error| failed(&error))?,
            command: writer.entry::<u64>(&COMMAND).map_err(|error| failed(&error))?,
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

    /// Commands all participants to terminate at the next opportunity.
    pub fn terminate(&mut self) {
        clock::set_command(&self.command, Command::Terminate);
    }

    /// Commands all participants to pause at their current activation.
    pub fn pause(&mut self) {
        clock::set_command(&self.command, Command::Pause);
    }
}

/// A participant's end.
pub struct ClockReader {
    horizon: EntryHandle<Ipc, u64, i64>,
    command: EntryHandle<Ipc, u64, u64>,
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
            command: reader.entry::<u64>(&COMMAND).map_err(|error| failed(&error))?,
            _reader: reader,
            _service: service,
        })
    }

    /// The horizon; [`Ticks::MIN`] before the run starts.
    pub fn horizon(&self) -> Ticks {
        *self.horizon.get()
    }

    /// The command to all participants.
    pub fn command(&self) -> Command {
        clock::command(&self.command)
    }
}
