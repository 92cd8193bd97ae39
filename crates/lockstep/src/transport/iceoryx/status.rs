//! A participant's status, for processes that may have to wake it or to explain a stall.

use std::cell::RefCell;

use iceoryx2::port::reader::{BlackboardValue, EntryHandle, Reader};
use iceoryx2::port::writer::{EntryHandleMut, Writer, WriterCreateError};
use iceoryx2::prelude::*;
use iceoryx2::service::builder::blackboard::BlackboardOpenError;
use iceoryx2::service::port_factory::blackboard::PortFactory;

use super::domain::{Domain, DomainError};
use super::ipc::Ipc;
use crate::transport::lock_free::board::Get;
use crate::transport::lock_free::wait_reason::{self, SetWaitReason, WaitReason};

const WAIT_REASON: u64 = 0;
const STATUS: u64 = 1;

/// The current activity of a participant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Activity {
    /// Not ready yet.
    Starting,
    /// Working on an activation.
    Computing,
    /// Waiting for sample `index` of input `input`.
    Input {
        /// The input.
        input: u32,
        /// The sample.
        index: u64,
    },
    /// Waiting for room at consumer `consumer` of output `output`.
    Room {
        /// The output.
        output: u32,
        /// The consumer.
        consumer: u32,
    },
    /// Waiting for the recorder.
    Recorder,
    /// At the horizon, or paused by a command.
    Paused,
    /// Done.
    Finished,
}

/// A participant's row on the blackboard: four 64-bit words.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[repr(C)]
struct Row {
    next: u64,
    activity: u64,
    first: u64,
    second: u64,
}

// SAFETY: four 64-bit integers in C layout: no pointers, no padding, no drop.
unsafe impl ZeroCopySend for Row {
    unsafe fn type_name() -> &'static str {
        "EscapementStatus"
    }
}

/// A participant's status, as other processes read it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Status {
    /// Its next activation: all before it are complete.
    pub next: u64,
    /// Its current activity.
    pub activity: Activity,
}

fn name(participant: &str) -> String {
    format!("status/{participant}")
}

/// The service of one participant's row; the orchestrator holds it from before the participant starts.
pub struct StatusService {
    _service: PortFactory<Ipc, u64>,
}

impl StatusService {
    /// Creates the row of `participant` for up to `readers` other processes.
    pub fn create(domain: &Domain, participant: &str, readers: usize) -> Result<StatusService, DomainError> {
        let service = domain
            .service(&name(participant))?
            .blackboard_creator::<u64>()
            .add::<u64>(WAIT_REASON, 0)
            .add::<Row>(STATUS, Row::default())
            .max_readers(readers)
            .max_nodes(readers + 2)
            .create();
        let what = || format!("creating the status of `{participant}`");
        Ok(StatusService {
            _service: service.map_err(|error| domain.failed(what(), error))?,
        })
    }
}

/// The participant's own end.
pub struct StatusWriter {
    wait_reason: EntryHandleMut<Ipc, u64, u64>,
    row: EntryHandleMut<Ipc, u64, Row>,
    _writer: Writer<Ipc, u64>,
    _service: PortFactory<Ipc, u64>,
}

impl StatusWriter {
    /// Opens the participant's own row.
    pub fn open(domain: &Domain, participant: &str) -> Result<StatusWriter, DomainError> {
        let failed =
            |error: &dyn std::fmt::Debug| domain.failed(format!("opening the status of `{participant}`"), error);
        let (address, own_name) = (domain.address().clone(), participant.to_owned());
        let service = domain
            .service(&name(participant))?
            .blackboard_opener::<u64>()
            .open()
            .map_err(|error| match error {
                BlackboardOpenError::DoesNotExist => DomainError::NoParticipant {
                    address,
                    name: own_name,
                },
                other => failed(&other),
            })?;
        let (address, name) = (domain.address().clone(), participant.to_owned());
        // The row has one writer: its participant.
        let writer = service.writer_builder().create().map_err(|error| match error {
            WriterCreateError::ExceedsMaxSupportedWriters => DomainError::NameInUse { address, name },
            other => failed(&other),
        })?;
        Ok(StatusWriter {
            wait_reason: writer.entry::<u64>(&WAIT_REASON).map_err(|error| failed(&error))?,
            row: writer.entry::<Row>(&STATUS).map_err(|error| failed(&error))?,
            _writer: writer,
            _service: service,
        })
    }

    /// Publishes the participant's status.
    pub fn set(&mut self, status: Status) {
        let (activity, first, second) = match status.activity {
            Activity::Starting => (0, 0, 0),
            Activity::Computing => (1, 0, 0),
            Activity::Input { input, index } => (2, u64::from(input), index),
            Activity::Room { output, consumer } => (3, u64::from(output), u64::from(consumer)),
            Activity::Recorder => (4, 0, 0),
            Activity::Paused => (5, 0, 0),
            Activity::Finished => (6, 0, 0),
        };
        self.row.update_with_copy(Row {
            next: status.next,
            activity,
            first,
            second,
        });
    }
}

impl SetWaitReason for StatusWriter {
    fn set_wait_reason(&mut self, what: Option<WaitReason>) {
        wait_reason::set_wait_reason(&self.wait_reason, what);
    }
}

/// The *wait reason* word of another participant. Reading a blackboard writes to it (a compare-and-exchange), which takes the line away
/// from its owner: while nothing was written, its count of writes is read alone.
struct WaitReasonWord {
    handle: EntryHandle<Ipc, u64, u64>,
    known: RefCell<BlackboardValue<u64>>,
}

impl Get<u64> for WaitReasonWord {
    #[inline]
    fn get(&self) -> u64 {
        let mut known = self.known.borrow_mut();
        if !self.handle.is_up_to_date(&known) {
            *known = self.handle.get();
        }
        **known
    }
}

/// The reading end, for other processes.
pub struct StatusReader {
    wait_reason: WaitReasonWord,
    row: EntryHandle<Ipc, u64, Row>,
    _reader: Reader<Ipc, u64>,
    _service: PortFactory<Ipc, u64>,
}

impl StatusReader {
    /// Opens the row of `participant`.
    pub fn open(domain: &Domain, participant: &str) -> Result<StatusReader, DomainError> {
        let failed =
            |error: &dyn std::fmt::Debug| domain.failed(format!("opening the status of `{participant}`"), error);
        let service = domain
            .service(&name(participant))?
            .blackboard_opener::<u64>()
            .open()
            .map_err(|error| failed(&error))?;
        let reader = service.reader_builder().create().map_err(|error| failed(&error))?;
        let handle = reader.entry::<u64>(&WAIT_REASON).map_err(|error| failed(&error))?;
        Ok(StatusReader {
            wait_reason: WaitReasonWord {
                known: RefCell::new(handle.get()),
                handle,
            },
            row: reader.entry::<Row>(&STATUS).map_err(|error| failed(&error))?,
            _reader: reader,
            _service: service,
        })
    }

    /// What the participant sleeps for, or is about to sleep for.
    pub fn wait_reason(&self) -> Option<WaitReason> {
        wait_reason::wait_reason(&self.wait_reason)
    }

    /// Whether the participant must be woken for a condition for which `occurred` is true and which has been published.
    pub(super) fn must_be_woken(&self, occurred: impl Fn(WaitReason) -> bool) -> bool {
        wait_reason::must_be_woken(&self.wait_reason, occurred)
    }

    /// The participant's status. The row is written by another process, so an unknown word is read as `Starting`.
    pub fn get(&self) -> Status {
        let row = *self.row.get();
        let activity = match row.activity {
            1 => Activity::Computing,
            2 => Activity::Input {
                input: row.first as u32,
                index: row.second,
            },
            3 => Activity::Room {
                output: row.first as u32,
                consumer: row.second as u32,
            },
            4 => Activity::Recorder,
            5 => Activity::Paused,
            6 => Activity::Finished,
            _ => Activity::Starting,
        };
        Status {
            next: row.next,
            activity,
        }
    }
}
