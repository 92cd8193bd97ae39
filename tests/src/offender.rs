//! A damper that follows the protocol until it is to violate it: it uses the transport directly, where a host would prevent violations.

use std::cell::RefCell;
use std::process::{ExitCode, exit};
use std::rc::Rc;

use lockstep::control::{PROTOCOL, ParticipantEvent, Reply, Request};
use lockstep::participant::{Interface, Kind};
use lockstep::plan::Assignment;
use lockstep::time::Ticks;
use lockstep::transport::iceoryx::{
    ClockReader, Command, ControlServer, Domain, LinkReceiver, LinkSender, LinkService, RecordSender, SharedRecord,
    Sleeper, StatusWriter,
};
use lockstep::transport::{Header, Receiver, Recording, Sender};
use lockstep::wire;

use crate::participants::{Motion, Push};

/// Its slot in a run, with the ends of its links.
pub struct Offender {
    /// Its assignment in the plan.
    pub assignment: Assignment,
    /// The destination of its samples.
    pub record: SharedRecord,
    clock: ClockReader,
    input: LinkReceiver,
    output: LinkSender,
    control: ControlServer,
    name: String,
    _links: [LinkService; 2],
    domain: Domain,
}

/// The answers of the healthy damper.
pub fn conforming_reply(request: &Request) -> Reply {
    match request {
        Request::Hello { .. } => Reply::Hello {
            protocol: PROTOCOL,
            program: "offender".into(),
        },
        Request::Configure { .. } => Reply::Described {
            interface: Interface::new(Kind::Sampled)
                .input::<Motion>("motion")
                .output::<Push>("push"),
        },
        _ => Reply::Done,
    }
}

/// Joins the run in the damper's slot; `reply` returns the bytes of each answer, or none to stay silent, and `act` runs after the start.
pub fn run_offender(reply: impl Fn(&Request) -> Option<Vec<u8>>, act: impl FnOnce(&mut Offender)) -> ExitCode {
    let variable = |name| std::env::var(name).expect("started by an orchestrator");
    let (address, name) = (variable(lockstep::host::ADDRESS), variable(lockstep::host::PARTICIPANT));
    let domain = Domain::enter(address.parse().expect("an address"), &name).expect("the run is there");
    let _status = StatusWriter::open(&domain, &name).expect("a status");
    let mut sleeper = Sleeper::open(&domain, &name).expect("an event");
    let control = ControlServer::open(&domain, &name).expect("a control service");
    let mut sleep_briefly = || sleeper.sleep(std::time::Duration::from_millis(1)).expect("an event");
    let mut connected = None;
    while connected.is_none() {
        let served = control.serve_bytes(|bytes| {
            let request: Request = wire::decode("a request", bytes).expect("the orchestrator keeps to the protocol");
            let answer = reply(&request);
            if let (Request::Connect { assignment, .. }, Some(_)) = (request, &answer) {
                let record = record(&domain, &name, assignment.outputs[0].stream);
                connected = Some((assignment, record));
            }
            // A participant that does not answer once stays silent for good.
            answer.unwrap_or_else(|| {
                loop {
                    std::thread::park();
                }
            })
        });
        if !served.expect("a control service") {
            sleep_briefly();
        }
    }
    let (assignment, record) = connected.expect("just seen");
    let link =
        |number, size, capacity: u32| LinkService::open(&domain, number, size, capacity as usize).expect("a link");
    let (from, to) = (&assignment.inputs[0], &assignment.outputs[0].consumers[0]);
    let links = [
        link(from.link, size_of::<Motion>(), from.capacity),
        link(to.link, size_of::<Push>(), to.capacity),
    ];
    let mut offender = Offender {
        clock: ClockReader::open(&domain).expect("a clock"),
        input: links[0].receiver(&domain).expect("a subscriber"),
        output: links[1].sender(&domain).expect("a publisher"),
        record,
        assignment,
        control,
        name,
        _links: links,
        domain,
    };
    while offender.clock.horizon() == Ticks::MIN {
        sleep_briefly();
    }
    act(&mut offender);
    while offender.clock.command() == Command::Run {
        sleep_briefly();
    }
    ExitCode::SUCCESS
}

fn record(domain: &Domain, name: &str, stream: u32) -> SharedRecord {
    let sender = RecordSender::open(domain, name, stream, &[size_of::<Push>()], 1 << 20).expect("a record");
    SharedRecord(Rc::new(RefCell::new(sender)))
}

impl Offender {
    /// The correct header of sample `k`.
    pub fn header(&self, k: u64) -> Header {
        let stamp = self.assignment.sample_time.instant(k);
        Header { index: k, stamp }
    }

    /// The payload of its sample `k`: no force, and the count `k`.
    pub fn payload(k: u64) -> Vec<u8> {
        bytemuck::bytes_of(&Push { force: 0.0, count: k }).to_vec()
    }

    /// Executes the plan for activations 0 to `until`.
    pub fn step_until(&mut self, until: u64) {
        self.step_range(0, until);
    }

    /// Executes the plan for activations `from` to `until`.
    pub fn step_range(&mut self, from: u64, until: u64) {
        for k in from..until {
            let mut motion = [0; size_of::<Motion>()];
            let mut newest = None;
            while newest.is_none_or(|index| index < 10 * k) {
                newest = self
                    .input
                    .try_receive(&mut motion)
                    .expect("a link")
                    .map(|header| header.index)
                    .or(newest);
                self.exit_unless_running();
            }
            self.record(None, self.header(k), &Offender::payload(k));
            self.send(self.header(k), &Offender::payload(k));
        }
    }

    /// Reports `event` about itself.
    pub fn event(&mut self, event: &ParticipantEvent) {
        while !self.record.0.borrow_mut().try_append_event(event).expect("a record") {
            self.exit_unless_running();
        }
    }

    /// Pauses at `horizon` with activation `next` to come, and answers requests with `reply` from then on.
    pub fn pause_at(&mut self, horizon: Ticks, next: u64, reply: impl Fn(&Request) -> Option<Vec<u8>>) {
        self.event(&ParticipantEvent::AtHorizon { horizon, next });
        loop {
            let served = self.control.serve_bytes(|bytes| {
                let request = wire::decode("a request", bytes).expect("the orchestrator keeps to the protocol");
                reply(&request).expect("an answer")
            });
            served.expect("a control service");
            self.exit_unless_running();
        }
    }

    /// Opens a second connection to the recorder, replacing the first.
    pub fn reopen_record(&mut self) {
        self.record = record(&self.domain, &self.name, self.assignment.outputs[0].stream);
    }

    /// Opens the recorder connection that belongs to `another`, in addition to its own.
    pub fn open_record_of(&self, another: &str) -> RecordSender {
        RecordSender::open(&self.domain, another, 0, &[size_of::<Push>()], 1 << 20).expect("a record")
    }

    /// Writes a sample to the tape: to its own stream, unless another is named.
    pub fn record(&mut self, stream: Option<u32>, header: Header, payload: &[u8]) {
        let own = self.assignment.outputs[0].stream;
        let stream = stream.unwrap_or(own);
        while !self.record.try_append(stream, header, payload).expect("a record") {
            self.exit_unless_running();
        }
        self.record.commit();
    }

    /// Sends a sample.
    pub fn send(&mut self, header: Header, payload: &[u8]) {
        while !self.output.try_send(header, payload).expect("a link") {
            self.exit_unless_running();
        }
    }

    fn exit_unless_running(&self) {
        std::thread::yield_now();
        if self.clock.command() != Command::Run {
            exit(0);
        }
    }
}
