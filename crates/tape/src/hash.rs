//! The digest of a tape, computed from those of its streams.

use super::{Digest, StreamSpec};

/// The digest of a tape from the counts and hashes of its streams, given in any order.
pub(crate) fn combine_hashes<'a>(streams: impl Iterator<Item = (&'a StreamSpec, u64, Digest)>) -> Digest {
    let mut streams: Vec<_> = streams.collect();
    streams.sort_by(|a, b| a.0.key().cmp(&b.0.key()));
    let mut hasher = blake3::Hasher::new_derive_key("escapement tape 1");
    // Every part is preceded by its length, so that different lists of parts have different bytes.
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
