//! The current payloads of a participant's ports, aligned for any message.

use std::fmt::Display;
use std::ops::Range;

use super::Log;
use crate::port::{Descriptor, Element, Field, Message};

/// The bytes of one payload, aligned to 8.
#[derive(Debug, Clone)]
pub struct Payload {
    words: Vec<u64>,
    size: usize,
}

impl Payload {
    /// All zeros.
    pub fn zeroed(size: usize) -> Payload {
        Payload {
            words: vec![0; size.div_ceil(8)],
            size,
        }
    }

    /// The payload of `message`.
    pub fn of(message: &impl Message) -> Payload {
        let bytes = bytemuck::bytes_of(message);
        let mut payload = Payload::zeroed(bytes.len());
        payload.bytes_mut().copy_from_slice(bytes);
        payload
    }

    /// The payload as the message `M`.
    ///
    /// # Panics
    /// When the size of `M` differs, or the bytes are not a valid `M`: compare descriptors first.
    pub fn get<M: Message>(&self) -> M {
        *bytemuck::checked::from_bytes(self.bytes())
    }

    /// The bytes.
    pub fn bytes(&self) -> &[u8] {
        &bytemuck::cast_slice(&self.words)[..self.size]
    }

    /// The bytes, for writing.
    pub fn bytes_mut(&mut self) -> &mut [u8] {
        &mut bytemuck::cast_slice_mut(&mut self.words)[..self.size]
    }
}

/// The exponent bits of a floating-point number, and the lowest of them.
const DOUBLE_EXPONENT: u64 = 0x7ff << 52;
const DOUBLE_ONE: u64 = 1 << 52;
const SINGLE_EXPONENT: u32 = 0xff << 23;
const SINGLE_ONE: u32 = 1 << 23;

/// Whether all doubles of `bytes` are finite.
///
/// The exponent alone decides. Only an exponent of all ones overflows into the sign bit when one is added. Every processor has SIMD
/// additions of this width; not every one has SIMD comparisons of it.
#[inline(never)]
fn all_finite(bytes: &[u8]) -> bool {
    let finite = |words: &[[u8; 8]]| {
        let sum = |word: &[u8; 8]| (u64::from_le_bytes(*word) & DOUBLE_EXPONENT) + DOUBLE_ONE;
        words.iter().fold(0, |all, word| all | sum(word)) >> 63 == 0
    };
    // Blocks of a known size are computed with SIMD without a loop, those after an answer are not computed.
    let (blocks, rest) = bytes.as_chunks::<8>().0.as_chunks::<8>();
    blocks.iter().all(|block| finite(block)) && finite(rest)
}

/// The elements of a payload whose type does not allow every bit pattern, merged into runs.
#[derive(Debug, Clone)]
pub(crate) struct ValueCheck {
    /// Whether a fault upstream may have made numbers NaN or infinite; numbers are then not checked.
    allow_non_finite: bool,
    doubles: Vec<Range<usize>>,
    singles: Vec<Range<usize>>,
    /// Truth values and enumerations, each with a bit for every byte that is a valid value.
    bytes: Vec<(Range<usize>, [u64; 4])>,
    /// Texts and bytes.
    contents: Vec<(Range<usize>, Element)>,
    /// Whether there are no others than doubles: most payloads.
    only_doubles: bool,
}

impl ValueCheck {
    pub(crate) fn new(descriptor: &Descriptor, allow_non_finite: bool) -> ValueCheck {
        let runs = |element: Element| {
            let mut runs: Vec<Range<usize>> = Vec::new();
            let fields = descriptor
                .fields
                .iter()
                .filter(|f| !allow_non_finite && f.element == element);
            for range in fields.map(|f| f.range()) {
                match runs.last_mut() {
                    Some(last) if last.end == range.start => last.end = range.end,
                    _ => runs.push(range),
                }
            }
            runs
        };
        let (contents, bytes): (Vec<&Field>, Vec<&Field>) = (descriptor.fields.iter())
            .filter(|field| !field.element.is_number())
            .partition(|field| field.element.room().is_some());
        let allowed = |field: &Field| {
            let mut allowed = [0; 4];
            for byte in (0..=u8::MAX).filter(|byte| field.allows(f64::from(*byte))) {
                allowed[usize::from(byte / 64)] |= 1_u64 << (byte % 64);
            }
            allowed
        };
        let singles = runs(Element::F32);
        ValueCheck {
            allow_non_finite,
            doubles: runs(Element::F64),
            only_doubles: singles.is_empty() && bytes.is_empty() && contents.is_empty(),
            singles,
            bytes: bytes.iter().map(|field| (field.range(), allowed(field))).collect(),
            contents: contents.iter().map(|field| (field.range(), field.element)).collect(),
        }
    }

    /// True when every element is a value of its type.
    pub(crate) fn passes(&self, payload: &[u8]) -> bool {
        let finite = self.doubles.iter().all(|run| all_finite(&payload[run.clone()]));
        finite && (self.only_doubles || self.non_doubles_pass(payload))
    }

    /// The same for elements other than doubles.
    fn non_doubles_pass(&self, payload: &[u8]) -> bool {
        let mut singles = 0;
        for run in &self.singles {
            for chunk in payload[run.clone()].as_chunks::<4>().0 {
                singles |= (u32::from_le_bytes(*chunk) & SINGLE_EXPONENT) + SINGLE_ONE;
            }
        }
        let mut valid = singles >> 31 == 0;
        for (run, allowed) in &self.bytes {
            for byte in &payload[run.clone()] {
                valid &= allowed[usize::from(byte / 64)] >> (byte % 64) & 1 == 1;
            }
        }
        for (run, element) in &self.contents {
            let mut each = payload[run.clone()].chunks_exact(element.size());
            valid &= each.all(|bytes| element.content(bytes).is_ok());
        }
        valid
    }

    /// Describes the element of `payload` that does not pass, and why; `what` names what must be finite.
    pub(crate) fn describe_invalid(&self, descriptor: &Descriptor, payload: &[u8], what: &str) -> String {
        let mut invalid = descriptor.invalid(payload);
        let found = invalid.find(|one| !self.allow_non_finite || !one.is_number());
        found.map(|one| one.describe(what)).unwrap_or_default()
    }
}

/// The inputs of an activation.
#[derive(Debug)]
pub struct Inputs {
    pub(crate) payloads: Vec<Payload>,
}

impl Inputs {
    /// The payload of input number `port` as the message `M` that the interface declares for it.
    ///
    /// # Panics
    /// When there is no such port, the size of `M` differs, or the bytes are not a valid `M`: a mistake in the participant's own code.
    pub fn get<M: Message>(&self, port: usize) -> &M {
        bytemuck::checked::from_bytes(self.payloads[port].bytes())
    }

    /// The raw bytes of input number `port`.
    pub fn bytes(&self, port: usize) -> &[u8] {
        self.payloads[port].bytes()
    }
}

/// Whether an output is seen (see [`Outputs::is_seen`]).
#[derive(Debug, Clone, Copy)]
pub(crate) struct SeenFlags {
    /// Whether the current sample is seen.
    pub(crate) now: bool,
    /// Whether any sample of the run is seen.
    pub(crate) ever: bool,
}

/// The outputs of an activation. An output that a step does not write keeps its last value.
#[derive(Debug)]
pub struct Outputs {
    pub(crate) payloads: Vec<Payload>,
    pub(crate) seen_flags: Vec<SeenFlags>,
    pub(crate) log: Log,
}

impl Outputs {
    /// The payload of output number `port` as the message `M` that the interface declares for it.
    ///
    /// # Panics
    /// When there is no such port, the size of `M` differs, or the bytes are not a valid `M`: a mistake in the participant's own code.
    pub fn get_mut<M: Message>(&mut self, port: usize) -> &mut M {
        bytemuck::checked::from_bytes_mut(self.payloads[port].bytes_mut())
    }

    /// The raw bytes of output number `port`.
    pub fn bytes_mut(&mut self, port: usize) -> &mut [u8] {
        self.payloads[port].bytes_mut()
    }

    /// Whether the current sample of output number `port` is seen: read by an input, recorded on the tape, measured, assessed, guarded, or
    /// accessible to a program that drives the run. An unseen sample need not be computed: what is written is not recorded, not sent and
    /// not checked.
    ///
    /// A seen sample must not depend on which samples were seen before: the tape has the same bits whatever else is seen.
    ///
    /// # Panics
    /// When there is no such port.
    pub fn is_seen(&self, port: usize) -> bool {
        self.seen_flags[port].now
    }

    /// Writes a line to the participant's log, with the simulated time: `outputs.log(format_args!("the valve opens at {level} m"))`. With
    /// [`format_args!`] nothing is allocated on the heap when no line is written.
    pub fn log(&self, text: impl Display) {
        self.log.write(text);
    }

    /// The participant's log, for a participant that hosts another one.
    pub fn log_of(&self) -> &Log {
        &self.log
    }

    /// Sets the destination of log lines, for code that drives a participant by hand.
    pub fn set_log(&mut self, log: Log) {
        self.log = log;
    }

    /// Sets the simulated time of log lines, s, for code that drives a participant by hand.
    pub fn set_time(&mut self, t: f64) {
        self.log.set_time(t);
    }

    /// Whether any sample of output number `port` is seen in this run. If none is, the participant need not even update the state on
    /// which later samples of that output depend.
    ///
    /// # Panics
    /// When there is no such port.
    pub fn is_ever_seen(&self, port: usize) -> bool {
        self.seen_flags[port].ever
    }
}

impl Inputs {
    /// Zeroed buffers for the inputs of `interface`.
    pub fn zeroed(interface: &super::Interface) -> Inputs {
        Inputs {
            payloads: interface
                .inputs
                .iter()
                .map(|p| Payload::zeroed(p.descriptor.size as usize))
                .collect(),
        }
    }

    /// The payload of input number `port` as `M`, for a test that drives a participant by hand.
    ///
    /// # Panics
    /// As [`Inputs::get`].
    pub fn get_mut<M: Message>(&mut self, port: usize) -> &mut M {
        bytemuck::checked::from_bytes_mut(self.payloads[port].bytes_mut())
    }

    /// The raw bytes of input number `port`, for code that drives a participant by hand.
    pub fn bytes_mut(&mut self, port: usize) -> &mut [u8] {
        self.payloads[port].bytes_mut()
    }
}

impl Outputs {
    /// Zeroed buffers for the outputs of `interface`, all of which are seen.
    pub fn zeroed(interface: &super::Interface) -> Outputs {
        Outputs::of(interface, Log::new("participant", None))
    }

    /// The same, with a log.
    pub(crate) fn of(interface: &super::Interface, log: Log) -> Outputs {
        Outputs {
            seen_flags: vec![SeenFlags { now: true, ever: true }; interface.outputs.len()],
            log,
            payloads: interface
                .outputs
                .iter()
                .map(|p| Payload::zeroed(p.descriptor.size as usize))
                .collect(),
        }
    }

    /// The payload of output number `port` as `M`.
    ///
    /// # Panics
    /// As [`Outputs::get_mut`].
    pub fn get<M: Message>(&self, port: usize) -> &M {
        bytemuck::checked::from_bytes(self.payloads[port].bytes())
    }

    /// The raw bytes of output number `port`, for code that drives a participant by hand.
    pub fn bytes(&self, port: usize) -> &[u8] {
        self.payloads[port].bytes()
    }

    /// Sets whether the current sample of output number `port` is seen, and whether any sample is, for a test that drives a participant
    /// by hand.
    pub fn set_seen(&mut self, port: usize, now: bool, ever: bool) {
        self.seen_flags[port] = SeenFlags { now, ever };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn field(name: &str, element: Element, count: u32, offset: u32) -> Field {
        Field {
            name: name.into(),
            element,
            shape: vec![count],
            unit: "1".into(),
            frame: String::new(),
            offset,
            values: Vec::new(),
        }
    }

    /// Bit patterns of numbers; those near the largest and the smallest exponent are more frequent.
    fn bits(exponent: u32, width: u32) -> impl Strategy<Value = u64> {
        let all_ones = ((1_u64 << exponent) - 1) << (width - 1 - exponent);
        let near = prop_oneof![Just(all_ones - 1), Just(all_ones), Just(all_ones + 1), Just(0), Just(1)];
        let signed = (near, any::<bool>()).prop_map(move |(bits, negative)| bits | u64::from(negative) << (width - 1));
        prop_oneof![4 => any::<u64>(), 1 => signed]
    }

    proptest! {
        #[test]
        fn value_check_passes_finite_payloads_only(
            doubles in prop::collection::vec(bits(11, 64), 7),
            singles in prop::collection::vec(bits(8, 32), 5),
        ) {
            let descriptor = Descriptor {
                name: "x".into(),
                size: 84,
                fields: vec![
                    field("a", Element::F64, 3, 0),
                    field("b", Element::F64, 2, 24),
                    // Integers may have any bits.
                    field("c", Element::U64, 1, 40),
                    field("d", Element::F64, 2, 48),
                    field("e", Element::F32, 1, 64),
                    field("f", Element::F32, 4, 68),
                ],
            };
            let mut payload = Vec::new();
            let mut finite = true;
            for (number, bits) in doubles.iter().enumerate() {
                if number == 5 {
                    payload.extend(u64::MAX.to_le_bytes());
                }
                payload.extend(bits.to_le_bytes());
                finite &= f64::from_bits(*bits).is_finite();
            }
            for bits in singles {
                payload.extend((bits as u32).to_le_bytes());
                finite &= f32::from_bits(bits as u32).is_finite();
            }
            let check = ValueCheck::new(&descriptor, false);
            prop_assert_eq!(check.passes(&payload), finite);
            prop_assert!(ValueCheck::new(&descriptor, true).passes(&payload));
        }
    }
}
