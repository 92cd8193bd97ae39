//! Linear interpolation between the two newest samples of a link.

use super::StepError;
use super::source::Source;
use crate::link::{DeliveryRule, Read, interpolate};
use crate::participant::Payload;
use crate::port::Descriptor;
use crate::time::Ticks;

pub(super) struct Interpolator {
    descriptor: Descriptor,
    delivery: DeliveryRule,
    before: BufferedSample,
    after: BufferedSample,
}

struct BufferedSample {
    index: Option<u64>,
    payload: Payload,
}

impl Interpolator {
    pub(super) fn new(descriptor: &Descriptor, delivery: DeliveryRule) -> Interpolator {
        let empty = || BufferedSample {
            index: None,
            payload: Payload::zeroed(descriptor.size as usize),
        };
        Interpolator {
            descriptor: descriptor.clone(),
            delivery,
            before: empty(),
            after: empty(),
        }
    }

    /// Writes the value read at `t` to `out`; returns the index of the sample that has not arrived yet, if one is missing.
    pub(super) fn fetch(
        &mut self,
        source: &mut Source,
        read: Read,
        t: Ticks,
        out: &mut [u8],
    ) -> Result<Option<u64>, Box<StepError>> {
        let (before, after) = match read {
            Read::Initial => return Ok(None),
            Read::Sample(index) => (index, None),
            Read::Between(before, after) => (before, Some(after)),
        };
        if self.before.index != Some(before) {
            // The later sample becomes the earlier one, unless both have been passed.
            if self.after.index != Some(before) && !self.receive(source, before)? {
                return Ok(Some(before));
            }
            std::mem::swap(&mut self.before, &mut self.after);
        }
        let Some(after) = after else {
            out.copy_from_slice(self.before.payload.bytes());
            return Ok(None);
        };
        if self.after.index != Some(after) && !self.receive(source, after)? {
            return Ok(Some(after));
        }
        let weight = self.delivery.weight(t, before, after);
        let (before, after) = (self.before.payload.bytes(), self.after.payload.bytes());
        interpolate(&self.descriptor, before, after, weight, out);
        Ok(None)
    }

    fn receive(&mut self, source: &mut Source, index: u64) -> Result<bool, Box<StepError>> {
        self.after.index = None;
        let arrived = source.receive_to(index, self.after.payload.bytes_mut())?;
        self.after.index = arrived.then_some(index);
        Ok(arrived)
    }
}
