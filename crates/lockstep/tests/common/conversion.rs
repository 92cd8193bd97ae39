//! Random conversions between the messages of random plans, and a second implementation of their result.

use lockstep::fault::Slot;
use lockstep::link::{Conversion, Pair, Term};
use lockstep::port::Message;
use proptest::prelude::*;

use super::Mixed;

/// The conversion of a link's samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LinkConversion {
    /// The input.
    Whole,
    /// Both fields of the input, the second one otherwise.
    Both(f64, f64),
    /// Only the first field.
    Hash,
    /// Only the second: its own multiple of the number, and an offset.
    X(f64, f64),
    /// The same, added to the values of other links.
    Adds(f64, f64),
    /// The sum of the number and a multiple of it.
    Twice(f64),
    /// A constant, independent of the sample.
    Always(f64),
}

/// The data received over a link: a sample, or the initial value in place of one.
pub enum ReceivedSample {
    Sample(Vec<u8>),
    Initial(Vec<u8>),
}

impl LinkConversion {
    /// Whether both may feed one input.
    pub fn is_compatible_with(self, other: LinkConversion) -> bool {
        let hash = |conversion_kind| matches!(conversion_kind, LinkConversion::Hash);
        match (self, other) {
            (LinkConversion::Whole | LinkConversion::Both(..), _)
            | (_, LinkConversion::Whole | LinkConversion::Both(..)) => false,
            (LinkConversion::Adds(..), LinkConversion::Adds(..)) => true,
            _ => hash(self) != hash(other),
        }
    }

    pub fn conversion(self) -> Option<Conversion> {
        let message = Mixed::descriptor();
        let slot = |name: &str| Slot::resolve(&message, name).unwrap().1[0];
        let pair = |name: &str, scales: &[f64], offset: f64, adds: bool| Pair {
            to: slot(name),
            count: 1,
            terms: scales
                .iter()
                .map(|&scale| Term {
                    from: slot(name),
                    scale,
                })
                .collect(),
            offset,
            adds,
        };
        let hash = || pair("hash", &[1.0], 0.0, false);
        let pairs = match self {
            LinkConversion::Whole => return None,
            LinkConversion::Both(scale, offset) => vec![hash(), pair("x", &[scale], offset, false)],
            LinkConversion::Hash => vec![hash()],
            LinkConversion::X(scale, offset) => vec![pair("x", &[scale], offset, false)],
            LinkConversion::Adds(scale, offset) => vec![pair("x", &[scale], offset, true)],
            LinkConversion::Twice(scale) => vec![pair("x", &[1.0, scale], 0.0, false)],
            LinkConversion::Always(value) => vec![pair("x", &[], value, false)],
        };
        Some(Conversion { message, pairs })
    }
}

/// The payload of an input assembled from the data received over each of its links.
pub fn assemble_input(links: impl Iterator<Item = (LinkConversion, ReceivedSample)>) -> Vec<u8> {
    let (mut hash, mut x) = ([0; 8], 0.0);
    for (conversion_kind, received) in links {
        let (initial, bytes) = match received {
            ReceivedSample::Sample(bytes) => (false, bytes),
            ReceivedSample::Initial(bytes) => (true, bytes),
        };
        let own_hash: [u8; 8] = bytes[..8].try_into().unwrap();
        let own = f64::from_le_bytes(bytes[8..].try_into().unwrap());
        let converted = |scale: f64, offset: f64| match (initial, offset == 0.0) {
            (true, _) => own,
            // Copied bit by bit: a product would change the bits of some NaNs.
            (false, true) if scale == 1.0 => own,
            (false, true) => own * scale,
            (false, false) => own * scale + offset,
        };
        match conversion_kind {
            LinkConversion::Whole => (hash, x) = (own_hash, own),
            LinkConversion::Both(scale, offset) => (hash, x) = (own_hash, converted(scale, offset)),
            LinkConversion::Hash => hash = own_hash,
            LinkConversion::X(scale, offset) => x = converted(scale, offset),
            LinkConversion::Adds(scale, offset) => x += converted(scale, offset),
            LinkConversion::Twice(_) if initial => x = own,
            LinkConversion::Twice(scale) => x = own + own * scale,
            LinkConversion::Always(value) => x = value,
        }
    }
    [hash, x.to_le_bytes()].concat()
}

/// Half of them have no conversion.
pub fn link_conversions() -> impl Strategy<Value = LinkConversion> {
    let scale = || prop_oneof![Just(1.0), -2.0..2.0];
    let offset = || prop_oneof![Just(0.0), -1e6..1e6];
    prop_oneof![
        8 => Just(LinkConversion::Whole),
        1 => (scale(), offset()).prop_map(|(scale, offset)| LinkConversion::Both(scale, offset)),
        2 => Just(LinkConversion::Hash),
        1 => (scale(), offset()).prop_map(|(scale, offset)| LinkConversion::X(scale, offset)),
        3 => (scale(), offset()).prop_map(|(scale, offset)| LinkConversion::Adds(scale, offset)),
        1 => scale().prop_map(LinkConversion::Twice),
        1 => offset().prop_map(LinkConversion::Always),
    ]
}
