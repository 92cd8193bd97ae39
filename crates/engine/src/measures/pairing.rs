//! Two streams at different rates: what is known of the second at the instants of the first.

use std::collections::VecDeque;

use lockstep::time::SampleTime;
use serde::{Deserialize, Serialize};

use super::window::Window;

/// Brings samples of two streams together, whichever comes first: to each sample of the first belongs the newest of the second
/// that is stamped at or before it, the one that an input without delay would read. What comes too early is kept, which is
/// as much as one participant runs ahead of the other, and no sample of the second that belongs to none of the first.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Pairing {
    first: SampleTime,
    second: SampleTime,
    /// Which samples of the first count.
    window: Window,
    /// How many samples of the second have come.
    come: u64,
    /// Samples of the first whose partner has not come: stamp, s, index of the partner, and the values of all behind one another.
    waiting: VecDeque<(f64, u64)>,
    waiting_values: VecDeque<f64>,
    /// Samples of the second by index, and their values.
    held: VecDeque<u64>,
    held_values: VecDeque<f64>,
    width: usize,
}

impl Pairing {
    /// Of samples with `width` values each; of the first those in `window`.
    pub(super) fn new(first: SampleTime, second: SampleTime, window: Window, width: usize) -> Pairing {
        Pairing {
            first,
            second,
            window,
            come: 0,
            waiting: VecDeque::new(),
            waiting_values: VecDeque::new(),
            held: VecDeque::new(),
            held_values: VecDeque::new(),
            width,
        }
    }

    /// Takes sample number `index` of the first, which lies in the window. One before the first sample of the second has no partner, and is left out.
    pub(super) fn first(&mut self, index: u64, stamp_s: f64, values: impl FnOnce(&mut VecDeque<f64>)) {
        if let Some(partner) = self.second.index_at_or_before(self.first.instant(index)) {
            self.waiting.push_back((stamp_s, partner));
            values(&mut self.waiting_values);
        }
    }

    /// Takes the next sample of the second.
    pub(super) fn second(&mut self, values: impl FnOnce(&mut VecDeque<f64>)) {
        let index = self.come;
        self.come += 1;
        // Is there an instant of the first, one that counts, before the next sample of the second?
        let (now, next) = (self.second.instant(index), self.second.instant(index + 1));
        let reader = self.window.from(self.first.count_before(now));
        if self.window.contains(reader) && self.first.instant(reader) < next {
            self.held.push_back(index);
            values(&mut self.held_values);
        }
    }

    /// Gives the next pair to `take`, if there is one: the stamp of the first, s, and the values of both.
    pub(super) fn next(&mut self, first: &mut Vec<f64>, second: &mut Vec<f64>) -> Option<f64> {
        let &(stamp_s, partner) = self.waiting.front()?;
        while self.held.front().is_some_and(|index| *index < partner) {
            self.held.pop_front();
            self.held_values.drain(..self.width);
        }
        if self.held.front() != Some(&partner) {
            return None;
        }
        self.waiting.pop_front();
        first.clear();
        first.extend(self.waiting_values.drain(..self.width));
        second.clear();
        second.extend(self.held_values.iter().take(self.width));
        Some(stamp_s)
    }
}
