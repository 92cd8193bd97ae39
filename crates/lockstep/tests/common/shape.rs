//! Random conversions between the messages of random plans, and what they make, written down once more.

use lockstep::fault::Slot;
use lockstep::link::{Conversion, Pair, Term};
use lockstep::port::Message;
use proptest::prelude::*;

use super::Mixed;

/// What a link makes of a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shape {
    /// The input.
    Whole,
    /// Both fields of the input, the second one otherwise.
    Both(f64, f64),
    /// Only the first field.
    Hash,
    /// Only the second: its own multiple of the number, and an offset.
    X(f64, f64),
    /// The same, added to what others give.
    Adds(f64, f64),
    /// The sum of the number and a multiple of it.
    Twice(f64),
    /// Nothing of the sample: a constant.
    Always(f64),
}

/// What came over a link: a sample, or what the input shows instead of one.
pub enum Came {
    Sample(Vec<u8>),
    Initial(Vec<u8>),
}

impl Shape {
    /// Whether both may feed one input.
    pub fn goes_with(self, other: Shape) -> bool {
        let hash = |shape| matches!(shape, Shape::Hash);
        match (self, other) {
            (Shape::Whole | Shape::Both(..), _) | (_, Shape::Whole | Shape::Both(..)) => false,
            (Shape::Adds(..), Shape::Adds(..)) => true,
            _ => hash(self) != hash(other),
        }
    }

    pub fn conversion(self) -> Option<Conversion> {
        let message = Mixed::descriptor();
        let slot = |name: &str| Slot::named(&message, name).unwrap().1[0];
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
            Shape::Whole => return None,
            Shape::Both(scale, offset) => vec![hash(), pair("x", &[scale], offset, false)],
            Shape::Hash => vec![hash()],
            Shape::X(scale, offset) => vec![pair("x", &[scale], offset, false)],
            Shape::Adds(scale, offset) => vec![pair("x", &[scale], offset, true)],
            Shape::Twice(scale) => vec![pair("x", &[1.0, scale], 0.0, false)],
            Shape::Always(value) => vec![pair("x", &[], value, false)],
        };
        Some(Conversion { message, pairs })
    }
}

/// The payload of an input out of what came over each of its links.
pub fn together(links: impl Iterator<Item = (Shape, Came)>) -> Vec<u8> {
    let (mut hash, mut x) = ([0; 8], 0.0);
    for (shape, came) in links {
        let (initial, bytes) = match came {
            Came::Sample(bytes) => (false, bytes),
            Came::Initial(bytes) => (true, bytes),
        };
        let own_hash: [u8; 8] = bytes[..8].try_into().unwrap();
        let own = f64::from_le_bytes(bytes[8..].try_into().unwrap());
        let turned = |scale: f64, offset: f64| match (initial, offset == 0.0) {
            (true, _) => own,
            // Taken over bit by bit: a product would make another NaN of some.
            (false, true) if scale == 1.0 => own,
            (false, true) => own * scale,
            (false, false) => own * scale + offset,
        };
        match shape {
            Shape::Whole => (hash, x) = (own_hash, own),
            Shape::Both(scale, offset) => (hash, x) = (own_hash, turned(scale, offset)),
            Shape::Hash => hash = own_hash,
            Shape::X(scale, offset) => x = turned(scale, offset),
            Shape::Adds(scale, offset) => x += turned(scale, offset),
            Shape::Twice(_) if initial => x = own,
            Shape::Twice(scale) => x = own + own * scale,
            Shape::Always(value) => x = value,
        }
    }
    [hash, x.to_le_bytes()].concat()
}

/// Half of them convert nothing.
pub fn shapes() -> impl Strategy<Value = Shape> {
    let scale = || prop_oneof![Just(1.0), -2.0..2.0];
    let offset = || prop_oneof![Just(0.0), -1e6..1e6];
    prop_oneof![
        8 => Just(Shape::Whole),
        1 => (scale(), offset()).prop_map(|(scale, offset)| Shape::Both(scale, offset)),
        2 => Just(Shape::Hash),
        1 => (scale(), offset()).prop_map(|(scale, offset)| Shape::X(scale, offset)),
        3 => (scale(), offset()).prop_map(|(scale, offset)| Shape::Adds(scale, offset)),
        1 => scale().prop_map(Shape::Twice),
        1 => offset().prop_map(Shape::Always),
    ]
}
