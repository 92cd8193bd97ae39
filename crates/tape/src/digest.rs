//! Whether two tapes are the same, in 32 bytes.

use std::fmt;
use std::path::Path;
use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::{ReadError, Reader, Source, StreamSpec};

/// A BLAKE3 hash, of a whole tape or of one stream; 64 hexadecimal digits as text.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Digest([u8; 32]);

impl Digest {
    /// The hash of `bytes`.
    pub fn of(bytes: &[u8]) -> Digest {
        blake3::hash(bytes).into()
    }

    /// The raw bytes.
    pub fn as_bytes(&self) -> &[u8; 32] {
        &self.0
    }
}

impl From<blake3::Hash> for Digest {
    fn from(hash: blake3::Hash) -> Digest {
        Digest(*hash.as_bytes())
    }
}

impl fmt::Display for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl fmt::Debug for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

/// The text is not a digest.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{text}` is not a digest: 64 hexadecimal digits are expected")]
pub struct ParseDigestError {
    /// What was given.
    pub text: String,
}

impl FromStr for Digest {
    type Err = ParseDigestError;

    fn from_str(text: &str) -> Result<Digest, ParseDigestError> {
        blake3::Hash::from_hex(text)
            .map(Digest::from)
            .map_err(|_| ParseDigestError { text: text.to_owned() })
    }
}

impl Serialize for Digest {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Digest {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        text.parse().map_err(serde::de::Error::custom)
    }
}

/// The digest of a tape from the counts and hashes of its streams, given in any order.
pub(crate) fn combine<'a>(streams: impl Iterator<Item = (&'a StreamSpec, u64, Digest)>) -> Digest {
    let mut streams: Vec<_> = streams.collect();
    streams.sort_by(|a, b| a.0.key().cmp(&b.0.key()));
    let mut hasher = blake3::Hasher::new_derive_key("escapement tape 1");
    // Every part is preceded by its length, so that no two lists of parts are the same bytes.
    let mut part = |bytes: &[u8]| {
        hasher.update(&(bytes.len() as u64).to_le_bytes());
        hasher.update(bytes);
    };
    for (spec, count, hash) in streams {
        part(spec.name().as_bytes());
        part(spec.descriptor.canonical().as_bytes());
        part(spec.offset.to_string().as_bytes());
        part(spec.period.to_string().as_bytes());
        part(&spec.first_index.to_le_bytes());
        part(&count.to_le_bytes());
        part(hash.as_bytes());
    }
    hasher.finalize().into()
}

/// The digest of the tape in the folder `dir`, from its bytes; what the writer stated when it finished is not consulted.
pub fn digest_of(dir: &Path) -> Result<Digest, ReadError> {
    let reader = Reader::open(dir)?;
    reader.digest()
}

/// The hash of one stream's complete records.
pub(crate) fn hash_stream(source: &(impl Source + ?Sized), stream: usize) -> Result<Digest, ReadError> {
    let stride = source.streams()[stream].stride();
    let at_once = (1 << 20) / stride + 1;
    let mut buffer = vec![0; at_once * stride];
    let mut hasher = blake3::Hasher::new();
    let (mut next, count) = (0, source.count(stream));
    while next < count {
        let records = (count - next).min(at_once as u64);
        let bytes = &mut buffer[..records as usize * stride];
        source.read(stream, next, bytes)?;
        hasher.update(bytes);
        next += records;
    }
    Ok(hasher.finalize().into())
}
