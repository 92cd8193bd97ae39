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
#[error("{what} {reason}")]
pub struct WireError {
    what: &'static str,
    reason: String,
}

/// Refuses bytes that no decoder would take.
fn fits(what: &'static str, bytes: usize) -> Result<(), WireError> {
    if bytes <= SIZE_MAX {
        return Ok(());
    }
    let reason = format!("has {bytes} bytes; at most {SIZE_MAX} (64 MiB) are possible");
    Err(WireError { what, reason })
}

/// Encodes `value`, whatever its size: for bytes that become a part of another value.
///
/// # Errors
/// When serde rejects it.
pub(crate) fn encode_part<T: Serialize>(what: &'static str, value: &T) -> Result<Vec<u8>, WireError> {
    // The limit of the configuration concerns decoders alone.
    bincode::serde::encode_to_vec(value, configuration()).map_err(|error| WireError {
        what,
        reason: format!("cannot be encoded: {error}"),
    })
}

/// Encodes `value`.
///
/// # Errors
/// When it is larger than [`SIZE_MAX`], or serde rejects it.
pub fn encode<T: Serialize>(what: &'static str, value: &T) -> Result<Vec<u8>, WireError> {
    let bytes = encode_part(what, value)?;
    fits(what, bytes.len())?;
    Ok(bytes)
}

/// Decodes `bytes`, which may come from any source: it never panics and never allocates more than [`SIZE_MAX`].
///
/// # Errors
/// When they are not exactly one `T`.
pub fn decode<T: DeserializeOwned>(what: &'static str, bytes: &[u8]) -> Result<T, WireError> {
    fits(what, bytes.len())?;
    let (value, used) = bincode::serde::decode_from_slice(bytes, configuration()).map_err(|error| WireError {
        what,
        reason: format!("cannot be decoded: {error}"),
    })?;
    if used != bytes.len() {
        return Err(WireError {
            what,
            reason: format!("cannot be decoded: {} bytes too many", bytes.len() - used),
        });
    }
    Ok(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codec_rejects_oversized_value_in_both_directions() {
        let (head, words) = (
            size_of::<u64>(),
            "a list has 67108865 bytes; at most 67108864 (64 MiB) are possible",
        );
        let list = vec![0_u8; SIZE_MAX - head];
        let bytes = encode("a list", &list).unwrap();
        assert_eq!(decode::<Vec<u8>>("a list", &bytes), Ok(list));
        let list = vec![0_u8; SIZE_MAX - head + 1];
        assert_eq!(encode("a list", &list).unwrap_err().to_string(), words);
        let bytes = vec![0; SIZE_MAX + 1];
        assert_eq!(decode::<Vec<u8>>("a list", &bytes).unwrap_err().to_string(), words);
    }
}
