//! The iceoryx2 service type of this transport.

use iceoryx2::prelude::*;

use crate::transport::interface::TransportError;

/// The version of iceoryx2 that this transport is built on; participants in other languages need the same one.
pub const VERSION: &str = "0.10.0";

/// One kind of service for the whole run: every port belongs to one thread.
pub(super) type Ipc = ipc::Service;

/// A failure of the transport itself, with iceoryx2's message.
pub(super) fn transport_error(what: impl std::fmt::Display, error: impl std::fmt::Debug) -> TransportError {
    TransportError(format!("{what}: {error:?}"))
}
