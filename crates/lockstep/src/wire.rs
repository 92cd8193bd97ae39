//! The wire format, and the only module that names bincode: fixed-width little-endian integers, lengths as 64-bit integers, enum variants
//! as 32-bit integers, strings and byte sequences as length and bytes. `docs/protocol.md` specifies the format for other languages.

use serde::Serialize;
use serde::de::DeserializeOwned;

/// The most bytes that a decoder accepts or allocates.
pub const SIZE_MAX: usize = 64 << 20;

fn configuration() -> impl bincode::config::Config {
    bincode::config::standard()
        .with_fixed_int_encoding()
        .with_little_endian()
        .with_limit::<SIZE_MAX>()
}

/// Why bytes are not a valid message.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{what} cannot be decoded: {reason}")]
pub struct WireError {
    what: &'static str,
    reason: String,
}

/// Encodes `value`.
///
/// # Errors
/// When it is larger than [`SIZE_MAX`].
pub fn encode<T: Serialize>(what: &'static str, value: &T) -> Result<Vec<u8>, WireError> {
    bincode::serde::encode_to_vec(value, configuration()).map_err(|error| WireError {
        what,
        reason: error.to_string(),
    })
}

/// Decodes `bytes`, which may come from any source: it never panics and never allocates more than [`SIZE_MAX`].
///
/// # Errors
/// When they are not exactly one `T`.
pub fn decode<T: DeserializeOwned>(what: &'static str, bytes: &[u8]) -> Result<T, WireError> {
    let (value, used) = bincode::serde::decode_from_slice(bytes, configuration()).map_err(|error| WireError {
        what,
        reason: error.to_string(),
    })?;
    if used != bytes.len() {
        return Err(WireError {
            what,
            reason: format!("{} bytes too many", bytes.len() - used),
        });
    }
    Ok(value)
}
