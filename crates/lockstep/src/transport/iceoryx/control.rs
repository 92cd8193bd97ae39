//! Requests to a participant and their replies.

use std::time::Duration;

use iceoryx2::pending_response::PendingResponse;
use iceoryx2::port::DegradationAction;
use iceoryx2::port::client::Client;
use iceoryx2::port::server::Server;
use iceoryx2::prelude::*;
use iceoryx2::service::port_factory::PortFactory as _;
use iceoryx2::service::port_factory::request_response::PortFactory;

use super::domain::{Domain, DomainError};
use super::ipc::{Ipc, transport_error};
use crate::control::{Reply, Request};
use crate::transport::interface::TransportError;
use crate::wire;

type Factory = PortFactory<Ipc, [u8], (), [u8], ()>;

/// The initial reservation for a request or a reply; a larger one allocates more.
const INITIAL_BYTES: usize = 64 * 1024;
/// The pause between two polls for a reply.
const POLL_INTERVAL: Duration = Duration::from_micros(200);

fn name(participant: &str) -> String {
    format!("control/{participant}")
}

/// The orchestrator's end, one per participant.
pub struct ControlClient {
    client: Client<Ipc, [u8], (), [u8], ()>,
    service: Factory,
}

impl ControlClient {
    /// Creates the control service of `participant`.
    pub fn create(domain: &Domain, participant: &str) -> Result<ControlClient, DomainError> {
        let failed =
            |error: &dyn std::fmt::Debug| domain.failed(format!("creating the control of `{participant}`"), error);
        let service = domain
            .service(&name(participant))?
            .request_response::<[u8], [u8]>()
            .max_clients(1)
            .max_servers(2)
            .max_nodes(4)
            .max_active_requests_per_client(1)
            .max_loaned_requests(1)
            .max_response_buffer_size(1)
            .max_borrowed_responses_per_pending_response(1)
            .create()
            .map_err(|error| failed(&error))?;
        let client = service
            .client_builder()
            .initial_max_slice_len(INITIAL_BYTES)
            .allocation_strategy(AllocationStrategy::PowerOfTwo)
            // A connection that cannot be made is an error, not a request that reaches no server.
            .set_request_degradation_handler(|_, _| DegradationAction::DegradeAndFail)
            .set_response_degradation_handler(|_, _| DegradationAction::DegradeAndFail)
            .create()
            .map_err(|error| failed(&error))?;
        Ok(ControlClient { client, service })
    }

    /// Whether the participant's server is present.
    pub fn has_server(&self) -> bool {
        self.service.dynamic_config().number_of_servers() > 0
    }

    /// Sends `request` and polls for the reply until `abandon`, which is called before each pause, returns true. `Ok(None)` when there is
    /// no reply.
    pub fn request(
        &self,
        request: &Request,
        mut abandon: impl FnMut() -> bool,
    ) -> Result<Option<Reply>, TransportError> {
        let mut pending = self.begin_request(request)?;
        loop {
            pending.send()?;
            if let Some(reply) = pending.reply()? {
                return Ok(Some(reply));
            }
            if abandon() {
                return Ok(None);
            }
            std::thread::sleep(POLL_INTERVAL);
        }
    }

    /// Begins a request, which is sent without waiting: requests to other participants can be sent before the reply has arrived. One request at
    /// a time.
    pub fn begin_request(&self, request: &Request) -> Result<PendingRequest<'_>, TransportError> {
        let bytes = wire::encode("a request", request).map_err(|error| TransportError(error.to_string()))?;
        Ok(PendingRequest {
            client: &self.client,
            bytes,
            pending: None,
        })
    }
}

/// The pending reply.
type PendingReply = PendingResponse<Ipc, [u8], (), [u8], ()>;

/// A pending request.
pub struct PendingRequest<'a> {
    client: &'a Client<Ipc, [u8], (), [u8], ()>,
    bytes: Vec<u8>,
    /// Set once the request has reached a server.
    pending: Option<PendingReply>,
}

impl PendingRequest<'_> {
    /// The pause between two polls for a reply.
    pub const POLL_INTERVAL: Duration = POLL_INTERVAL;

    /// Sends the request, unless it has reached a server already. Returns whether it has reached one by this call.
    pub fn send(&mut self) -> Result<bool, TransportError> {
        if self.pending.is_some() {
            return Ok(false);
        }
        let message = self
            .client
            .loan_slice_uninit(self.bytes.len())
            .map_err(|error| transport_error("no memory", error))?;
        let sent = message.write_from_slice(&self.bytes).send();
        let pending = sent.map_err(|error| transport_error("asking", error))?;
        // A server is counted before a client can reach it. A request that reached no server has not been sent.
        self.pending = (pending.number_of_server_connections() > 0).then_some(pending);
        Ok(self.pending.is_some())
    }

    /// Returns the reply once it has arrived.
    pub fn reply(&self) -> Result<Option<Reply>, TransportError> {
        let Some(pending) = &self.pending else {
            return Ok(None);
        };
        let Some(reply) = pending
            .receive()
            .map_err(|error| transport_error("receiving a reply", error))?
        else {
            return Ok(None);
        };
        // A copy, so that the bytes do not change during decoding.
        let bytes = reply.payload().to_vec();
        let reply = wire::decode("a reply", &bytes).map_err(|error| TransportError(error.to_string()))?;
        Ok(Some(reply))
    }
}

/// The participant's end.
pub struct ControlServer {
    server: Server<Ipc, [u8], (), [u8], ()>,
    _service: Factory,
}

impl ControlServer {
    /// Opens the control service of `participant`. From now on the orchestrator knows that the participant is present.
    pub fn open(domain: &Domain, participant: &str) -> Result<ControlServer, DomainError> {
        let failed =
            |error: &dyn std::fmt::Debug| domain.failed(format!("opening the control of `{participant}`"), error);
        let service = domain
            .service(&name(participant))?
            .request_response::<[u8], [u8]>()
            .open()
            .map_err(|error| failed(&error))?;
        let server = service
            .server_builder()
            .initial_max_slice_len(INITIAL_BYTES)
            .allocation_strategy(AllocationStrategy::PowerOfTwo)
            .set_request_degradation_handler(|_, _| DegradationAction::DegradeAndFail)
            .set_response_degradation_handler(|_, _| DegradationAction::DegradeAndFail)
            .create()
            .map_err(|error| failed(&error))?;
        Ok(ControlServer {
            server,
            _service: service,
        })
    }

    /// Answers one request, if there is one, with the result of `answer`. Returns whether there was one.
    pub fn serve(&self, answer: impl FnOnce(Request) -> Reply) -> Result<bool, TransportError> {
        self.serve_bytes(|request| {
            let reply = match wire::decode("a request", request) {
                Ok(request) => answer(request),
                Err(error) => refusal(error.to_string()),
            };
            // A reply too large for the wire (a state, say) is reported, not sent.
            wire::encode("a reply", &reply)
                .or_else(|error| wire::encode("a reply", &refusal(error.to_string())))
                .unwrap_or_default()
        })
    }

    /// As [`ControlServer::serve`], with the encoded request and the encoded reply.
    pub fn serve_bytes(&self, answer: impl FnOnce(&[u8]) -> Vec<u8>) -> Result<bool, TransportError> {
        let Some(active) = self
            .server
            .receive()
            .map_err(|error| transport_error("receiving a request", error))?
        else {
            return Ok(false);
        };
        // A copy, so that the bytes do not change during decoding.
        let request = active.payload().to_vec();
        let bytes = answer(&request);
        let message = active
            .loan_slice_uninit(bytes.len())
            .map_err(|error| transport_error("no memory", error))?;
        message
            .write_from_slice(&bytes)
            .send()
            .map_err(|error| transport_error("replying", error))?;
        Ok(true)
    }
}

fn refusal(reason: String) -> Reply {
    let key = String::new();
    Reply::Refused { key, reason }
}

#[cfg(test)]
mod tests {
    use super::super::test_domain::TestDomain;
    use super::*;

    #[test]
    fn client_resends_request_that_reached_no_server() {
        let test = TestDomain::new();
        let client = ControlClient::create(&test.domain, "late").expect("a new domain has room");
        let (mut polls, mut server) = (0, None);
        let reply = client.request(&Request::Terminate, || {
            polls += 1;
            if polls == 3 {
                server = Some(ControlServer::open(&test.domain, "late").expect("the client is there"));
            }
            if let Some(server) = &server {
                server.serve(|_| Reply::Done).expect("a control service");
            }
            polls == 1000
        });
        assert_eq!(reply, Ok(Some(Reply::Done)));
    }
}
